// Which edges of the mesh are silhouettes from the eye. All passes but the first work on bits: 32 faces or edges per
// word.

#import frame
#import index
#import octahedral
#import scan
#import segments
#import view

struct Params {
    normals: u32,
    compaction: u32,
    two_sided_borders: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> vertices: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> faces: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read> edges: array<MeshEdge>;
@group(0) @binding(6) var<storage, read_write> facing: array<u32>;
@group(0) @binding(7) var<storage, read_write> drawn: array<u32>;

#ifdef F16
@group(0) @binding(4) var<storage, read> normals: array<vec2<u32>>;

fn normal_of(face: u32) -> vec3<f32> {
    let bits = normals[face];
    return vec3(unpack2x16float(bits.x), unpack2x16float(bits.y).x);
}
#else
#ifdef OCT16
@group(0) @binding(4) var<storage, read> normals: array<u32>;

fn normal_of(face: u32) -> vec3<f32> {
    return decode_oct16(normals[face]);
}
#else
@group(0) @binding(4) var<storage, read> normals: array<vec4<f32>>;

fn normal_of(face: u32) -> vec3<f32> {
    return normals[face].xyz;
}
#endif
#endif

var<workgroup> words: array<atomic<u32>, 8>;

// Collects one bit of each of the workgroup's 256 threads: in thread k < 8 the bits of threads 32 k to 32 k + 31.
fn workgroup_bits(lane: u32, bit: bool) -> u32 {
    if lane < 8u {
        atomicStore(&words[lane], 0u);
    }
    workgroupBarrier();
    atomicOr(&words[lane / 32u], u32(bit) << (lane % 32u));
    workgroupBarrier();
    return atomicLoad(&words[lane % 8u]);
}

// A face faces the eye if the eye is on the side of its plane to which its normal points, not in the plane.
@compute @workgroup_size(256, 1, 1)
fn face_eye(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let face = linear_index(id, groups, 256u);
    var bit = false;
    if face < arrayLength(&faces) {
        let p = vertices[faces[face].x].xyz - frame.view.eye;
        bit = dot_in_order(normal_of(face), p) < 0.0;
    }
    let word = workgroup_bits(lane, bit);
    let at = (face - lane) / 32u + lane;
    if lane < 8u && at < arrayLength(&facing) {
        facing[at] = word;
    }
}

@compute @workgroup_size(256, 1, 1)
fn choose(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let edge = linear_index(id, groups, 256u);
    var bit = false;
    if edge < arrayLength(&edges) {
        bit = is_drawn(edges[edge].faces, edges[edge].kind);
    }
    let word = workgroup_bits(lane, bit);
    let at = (edge - lane) / 32u + lane;
    if lane < 8u && at < arrayLength(&drawn) {
        drawn[at] = word;
    }
}

fn is_drawn(faces: vec2<u32>, kind: u32) -> bool {
    let first = faces_eye(faces.x);
    switch kind {
        case REGULAR: {
            return first != faces_eye(faces.y);
        }
        case CREASE: {
            return first || faces_eye(faces.y);
        }
        default: {
            return first || params.two_sided_borders != 0u;
        }
    }
}

fn faces_eye(face: u32) -> bool {
    return ((facing[face / 32u] >> (face % 32u)) & 1u) != 0u;
}

#ifdef PREFIX_SUM
@group(0) @binding(8) var<storage, read_write> segments: array<Segment>;
@group(0) @binding(9) var<storage, read_write> count: array<u32>;
@group(0) @binding(10) var<storage, read_write> sums: array<u32>;

@compute @workgroup_size(SCAN_THREADS)
fn add_up(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let range = scan_block(group.x, arrayLength(&drawn));
    var sum = 0u;
    for (var word = range.x + lane; word < range.y; word += SCAN_THREADS) {
        sum += countOneBits(drawn[word]);
    }
    let total = workgroup_scan(lane, sum).total;
    if lane == 0u {
        sums[group.x] = total;
    }
}

@compute @workgroup_size(SCAN_THREADS)
fn collect(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if group.x == 0u {
        let total = workgroup_scan(lane, sums[lane]).total;
        if lane == 0u {
            count[0] = total;
        }
    }
    let range = scan_block(group.x, arrayLength(&drawn));
    if range.x == range.y {
        return;
    }
    var next = workgroup_scan(lane, select(0u, sums[lane], lane < group.x)).total;
    for (var tile = range.x; tile < range.y; tile += SCAN_THREADS) {
        let word = tile + lane;
        var bits = 0u;
        if word < range.y {
            bits = drawn[word];
        }
        let scan = workgroup_scan(lane, countOneBits(bits));
        var place = next + scan.before;
        while bits != 0u {
            let edge = word * 32u + firstTrailingBit(bits);
            let ends = edges[edge].vertices;
            segments[place] = Segment(vertices[ends.x].xyz, 0u, vertices[ends.y].xyz, edge);
            bits &= bits - 1u;
            place += 1u;
        }
        next += scan.total;
    }
}
#endif
