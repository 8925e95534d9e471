// Decodes the points of a cut: count and sum find the points before each vertex; decode has a thread for each slot of
// the cloud, pairs (after clear) one for each pair of a vertex and a translation.

#import cloud
#import color
#import frame
#import index
#import octahedral
#import scan
#import streams
#import view

struct Params {
    expand: u32,
    show: u32,
    light: f32,
    points_per_pixel: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> words: array<u32>;
@group(0) @binding(3) var<storage, read> nodes: array<StreamNode>;
@group(0) @binding(4) var<storage, read> pools: array<StreamPool>;
@group(0) @binding(5) var<storage, read> starts: array<u32>;
@group(0) @binding(6) var<storage, read> numbers: array<u32>;
@group(0) @binding(7) var<storage, read_write> cloud_position: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> cloud_radiance: array<u32>;
@group(0) @binding(9) var<storage, read_write> cloud_meta: array<u32>;
@group(0) @binding(10) var<storage, read_write> sums: array<u32>;
@group(0) @binding(11) var<storage, read_write> blocks: array<u32>;

@compute @workgroup_size(SCAN_THREADS)
fn count(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let range = scan_block(group.x, numbers[VERTICES]);
    var points = 0u;
    for (var vertex = range.x + lane; vertex < range.y; vertex += SCAN_THREADS) {
        points += points_of(vertex);
    }
    let total = workgroup_scan(lane, points).total;
    if lane == 0u {
        blocks[group.x] = total;
    }
}

@compute @workgroup_size(SCAN_THREADS)
fn sum(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let range = scan_block(group.x, numbers[VERTICES]);
    var before = workgroup_scan(lane, select(0u, blocks[lane], lane < group.x)).total;
    for (var tile = range.x; tile < range.y; tile += SCAN_THREADS) {
        let vertex = tile + lane;
        var points = 0u;
        if vertex < range.y {
            points = points_of(vertex);
        }
        let scan = workgroup_scan(lane, points);
        if vertex < range.y {
            sums[vertex] = before + scan.before;
        }
        before += scan.total;
    }
}

@compute @workgroup_size(128)
fn decode(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = linear_index(id, groups, 128u);
    if slot >= arrayLength(&cloud_position) {
        return;
    }
    if slot >= numbers[POINTS] {
        cloud_meta[slot] = 0u;
        return;
    }
    var pool = starts[min(slot / START_STEP, arrayLength(&starts) - 1u)];
    while pool + 1u < numbers[POOLS] && pools[pool + 1u].first_point <= slot {
        pool += 1u;
    }
    // The last of the pool's vertices with no more points before it.
    var first = pools[pool].first_vertex;
    var last = vertices_end(pool);
    while first + 1u < last {
        let middle = (first + last) / 2u;
        if sums[middle] <= slot {
            first = middle;
        } else {
            last = middle;
        }
    }
    let vertex = first - pools[pool].first_vertex;
    write(slot, pool, vertex, tag_of(pool, vertex, slot - sums[first]));
}

@compute @workgroup_size(128)
fn clear(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = linear_index(id, groups, 128u);
    if slot >= numbers[POINTS] && slot < arrayLength(&cloud_meta) {
        cloud_meta[slot] = 0u;
    }
}

// A workgroup for each vertex, a thread for each translation that a pool can have.
@compute @workgroup_size(128)
fn pairs(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) translation: u32) {
    let numbered = group.x + group.y * MOST_GROUPS;
    if numbered >= numbers[VERTICES] {
        return;
    }
    let pool = pool_of(numbered);
    let vertex = numbered - pools[pool].first_vertex;
    let tag_words = pools[pool].tag_words;
    if translation >= max(32u * tag_words, 1u) {
        return;
    }
    var before = 0u;
    if tag_words > 0u {
        let tags = pools[pool].tags + vertex * tag_words;
        let own = words[tags + translation / 32u];
        if (own >> (translation % 32u) & 1u) == 0u {
            return;
        }
        for (var word = 0u; word < translation / 32u; word++) {
            before += countOneBits(words[tags + word]);
        }
        before += countOneBits(own & ((1u << (translation % 32u)) - 1u));
    }
    write(sums[numbered] + before, pool, vertex, translation);
}

// The number of points of a vertex.
fn points_of(numbered: u32) -> u32 {
    let pool = pool_of(numbered);
    let tag_words = pools[pool].tag_words;
    if tag_words == 0u {
        return 1u;
    }
    let tags = pools[pool].tags + (numbered - pools[pool].first_vertex) * tag_words;
    var points = 0u;
    for (var word = 0u; word < tag_words; word++) {
        points += countOneBits(words[tags + word]);
    }
    return points;
}

// The pool of a vertex.
fn pool_of(numbered: u32) -> u32 {
    var first = 0u;
    var last = numbers[POOLS];
    while first + 1u < last {
        let middle = (first + last) / 2u;
        if pools[middle].first_vertex <= numbered {
            first = middle;
        } else {
            last = middle;
        }
    }
    return first;
}

// The number of the first vertex after those of a pool.
fn vertices_end(pool: u32) -> u32 {
    if pool + 1u < numbers[POOLS] {
        return pools[pool + 1u].first_vertex;
    }
    return numbers[VERTICES];
}

// The translation of a vertex's nth point.
fn tag_of(pool: u32, vertex: u32, nth: u32) -> u32 {
    let tag_words = pools[pool].tag_words;
    var left = nth;
    for (var word = 0u; word < tag_words; word++) {
        var tags = words[pools[pool].tags + vertex * tag_words + word];
        let points = countOneBits(tags);
        if left < points {
            for (; left > 0u; left--) {
                tags &= tags - 1u;
            }
            return 32u * word + firstTrailingBit(tags);
        }
        left -= points;
    }
    return 0u;
}

// Writes the point of a vertex and a translation.
fn write(slot: u32, pool: u32, vertex: u32, translation: u32) {
    var cell = words[pools[pool].vertices + vertex];
    if pools[pool].translations == BRICKS {
        cell += (translation & 3u) | ((translation >> 2u & 3u) << 7u) | ((translation >> 4u) << 14u);
    } else if pools[pool].tag_words > 0u {
        cell += words[pools[pool].translations + translation];
    }
    let node = nodes[pools[pool].node];
    cloud_position[slot] = vec4(cell_center(node, cell), 1.0);
    cloud_radiance[slot] = encode_radiance(color(node, pool, slot) * light(node, slot));
    cloud_meta[slot] = LIVE;
}

// The linear colour of a point.
fn color(node: StreamNode, pool: u32, slot: u32) -> vec3<f32> {
    if params.show == SHOW_LEVEL {
        return hue(node.level);
    }
    if params.show == SHOW_POOL {
        if pools[pool].tag_words == 0u {
            return vec3(0.2);
        }
        return hue(8u * node.index + pools[pool].number);
    }
    if node.colors == NO_ATTRIBUTE {
        return vec3(GREY);
    }
    return decode_srgb(unpack4x8unorm(words[node.colors + slot - node.first_point]).rgb);
}

// How bright the light makes a point.
fn light(node: StreamNode, slot: u32) -> f32 {
    if node.normals == NO_ATTRIBUTE {
        return 1.0;
    }
    let bits = words[node.normals + slot - node.first_point];
    if bits == NO_NORMAL {
        return 1.0;
    }
    let normal = decode_oct16(bits);
    let facing = abs(dot_in_order(normal, turned_back(node.rotation, frame.view.forward)));
    let length = sqrt(dot_in_order(normal, normal));
    return 1.0 - params.light + params.light * facing / length;
}

// A direction in the space of a model that a unit quaternion rotates.
fn turned_back(rotation: vec4<f32>, direction: vec3<f32>) -> vec3<f32> {
    let across = 2.0 * cross(direction, rotation.xyz);
    return direction + rotation.w * across + cross(across, rotation.xyz);
}

// A colour for a number, far from those of the numbers beside it.
fn hue(number: u32) -> vec3<f32> {
    let bits = vec3((number + 1u) * 0x9E3779B1u);
    return (vec3<f32>((bits >> vec3(24u, 16u, 8u)) & vec3(255u)) + 16.0) / 271.0;
}
