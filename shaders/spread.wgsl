// Gives a colour to pixels that reach no sample. Spread runs clear, prepare, some rounds of spread,
// pull and push; PushPull skips the rounds; Off only copies.

#import edge_pixel
#import frame
#import pixel

struct Params {
    method: u32,
    rounds: u32,
}

// Pixels on each side of the area that influences a tile in a round: one pixel of margin per step.
const SIDE: u32 = TILE + 2u * ROUND;

// Threads of a workgroup, and pixels per thread in a round.
const THREADS: u32 = 256u;
const EACH: u32 = SIDE * SIDE / THREADS;

// The red of a hole.
const NONE: f32 = -1.0;

// The bits of N8: the primary regions of both pixels are joined.
const PRIMARY_TO_PRIMARY: u32 = 0x11111111u;

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var primary: texture_2d<f32>;
@group(0) @binding(3) var<storage, read> n8: array<u32>;
@group(0) @binding(4) var color: texture_storage_2d<rgba32float, write>;
@group(0) @binding(5) var<storage, read_write> pyramid: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> found: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> filled: array<atomic<u32>>;
@group(0) @binding(8) var<storage, read_write> tiles: array<vec2<u32>>;
@group(0) @binding(9) var<storage, read_write> open_tiles: array<vec2<u32>>;
@group(0) @binding(10) var<storage, read_write> open_count: array<atomic<u32>>;

// The colours of SIDE x SIDE pixels with the tile in the middle.
var<workgroup> red: array<f32, SIDE * SIDE>;
var<workgroup> green: array<f32, SIDE * SIDE>;
var<workgroup> blue: array<f32, SIDE * SIDE>;
// Sums of the tile's rows.
var<workgroup> row_sums: array<vec4<f32>, TILE>;
// Holes of the tile that are joined to anything.
var<workgroup> open: atomic<u32>;
// The last step in which a hole was filled, counted from 1.
var<workgroup> grown: atomic<u32>;
// Values that all threads need.
var<workgroup> shared_state: vec2<u32>;

fn put_at(i: u32, c: vec3<f32>) {
    red[i] = c.r;
    green[i] = c.g;
    blue[i] = c.b;
}

// The colour at a position and 1; zeros for a hole.
fn color_at(i: u32) -> vec4<f32> {
    if red[i] < 0.0 {
        return vec4(0.0);
    }
    return vec4(red[i], green[i], blue[i], 1.0);
}

// The colour of a pixel that was filled in this round; 0 for pixels that were not holes.
fn color_of(pixel: vec2<u32>, round: u32) -> vec3<f32> {
    if round == 0u {
        return textureLoad(primary, pixel, 0).rgb;
    }
    return found[pixel_index(pixel)].rgb;
}

@compute @workgroup_size(8, 8, 1)
fn copy(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let given = textureLoad(primary, pixel.xy, 0);
    atomicStore(&filled[pixel_index(pixel.xy)], select(HOLE, 0u, given.a > 0.0));
    textureStore(color, pixel.xy, select(vec4(0.0), vec4(given.rgb, 1.0), given.a > 0.0));
}

// Where in red, green and blue the tile's own pixels are.
fn tile_place(local: vec2<u32>) -> u32 {
    return (local.y + ROUND) * SIDE + local.x + ROUND;
}

fn tiles_size() -> vec2<u32> {
    return (frame.size + TILE - 1u) / TILE;
}

// Writes the current state of the tile's pixels.
fn add_up(t: u32, lane: u32, rounds: u32) {
    workgroupBarrier();
    if lane < TILE {
        var sum = vec4(0.0);
        for (var x = 0u; x < TILE; x++) {
            sum += color_at(tile_place(vec2(x, lane)));
        }
        row_sums[lane] = sum;
    }
    workgroupBarrier();
    if lane == 0u {
        var sum = vec4(0.0);
        for (var y = 0u; y < TILE; y++) {
            sum += row_sums[y];
        }
        pyramid[t] = sum;
        tiles[t] = vec2(atomicLoad(&open), rounds);
    }
}

// Counts a hole of the tile, unless nothing can ever reach it.
fn count_hole(p: u32) {
    if (n8[p] & PRIMARY_TO_PRIMARY) != 0u {
        atomicAdd(&open, 1u);
    }
}

@compute @workgroup_size(1, 1, 1)
fn clear() {
    atomicStore(&open_count[0], 0u);
}

// Finds the holes, and lists the tiles with holes that may be filled.
@compute @workgroup_size(16, 16, 1)
fn prepare(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let t = tile.y * groups.x + tile.x;
    if lane == 0u {
        atomicStore(&open, 0u);
    }
    workgroupBarrier();
    for (var i = lane; i < TILE * TILE; i += THREADS) {
        let local = vec2(i % TILE, i / TILE);
        let pixel = tile.xy * TILE + local;
        var c = vec3(NONE);
        if all(pixel < frame.size) {
            let p = pixel_index(pixel);
            let given = textureLoad(primary, pixel, 0);
            if given.a > 0.0 {
                c = given.rgb;
                atomicStore(&filled[p], 0u);
            } else {
                atomicStore(&filled[p], HOLE);
                count_hole(p);
            }
        }
        put_at(tile_place(local), c);
    }
    add_up(t, lane, 0u);
    if lane == 0u && atomicLoad(&open) != 0u {
        open_tiles[atomicAdd(&open_count[0], 1u)] = tile.xy;
    }
}

// A round of steps: the workgroups share the listed tiles. If few are open, starting a workgroup for each of the others
// would cost more than everything else.
@compute @workgroup_size(THREADS, 1, 1)
fn spread(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    if lane == 0u {
        shared_state.x = atomicLoad(&open_count[0]);
    }
    let count = workgroupUniformLoad(&shared_state).x;
    for (var i = group.y * groups.x + group.x; i < count; i += groups.x * groups.y) {
        spread_tile(open_tiles[i], lane);
    }
}

// Neighbouring tiles may write their pixels at the same time: pixels that they fill in this round have its number and
// still count as holes.
fn spread_tile(tile: vec2<u32>, lane: u32) {
    let t = tile.y * tiles_size().x + tile.x;
    if lane == 0u {
        shared_state = tiles[t];
        atomicStore(&open, 0u);
        atomicStore(&grown, 0u);
    }
    let begun = workgroupUniformLoad(&shared_state);
    if begun.x == 0u {
        return;
    }
    let done = begun.y;
    let corner = vec2<i32>(tile * TILE) - i32(ROUND);
    var joined: array<u32, EACH>;
    for (var k = 0u; k < EACH; k++) {
        let i = lane + k * THREADS;
        let q = corner + vec2<i32>(vec2(i % SIDE, i / SIDE));
        joined[k] = 0u;
        put_at(i, vec3(NONE));
        if !is_outside(q) {
            let p = pixel_index(vec2<u32>(q));
            let round = atomicLoad(&filled[p]);
            if round <= done {
                put_at(i, color_of(vec2<u32>(q), round));
            } else {
                joined[k] = n8[p] & PRIMARY_TO_PRIMARY;
            }
        }
    }
    workgroupBarrier();
    for (var step = 0u; step < ROUND; step++) {
        var sums: array<vec4<f32>, EACH>;
        for (var k = 0u; k < EACH; k++) {
            sums[k] = sum_joined(lane + k * THREADS, joined[k]);
            if sums[k].w > 0.0 {
                atomicStore(&grown, step + 1u);
            }
        }
        workgroupBarrier();
        for (var k = 0u; k < EACH; k++) {
            if sums[k].w > 0.0 {
                put_at(lane + k * THREADS, sums[k].rgb / sums[k].w);
                joined[k] = 0u;
            }
        }
        if lane == 0u {
            shared_state.x = atomicLoad(&grown);
        }
        // Once a step fills nothing, no later one does. (This waits for all threads, like a barrier.)
        if workgroupUniformLoad(&shared_state).x <= step {
            break;
        }
    }

    for (var i = lane; i < TILE * TILE; i += THREADS) {
        let local = vec2(i % TILE, i / TILE);
        let pixel = tile * TILE + local;
        if any(pixel >= frame.size) {
            continue;
        }
        let p = pixel_index(pixel);
        if atomicLoad(&filled[p]) == HOLE {
            let now = color_at(tile_place(local));
            if now.w > 0.0 {
                found[p] = now;
                atomicStore(&filled[p], done + 1u);
            } else {
                count_hole(p);
            }
        }
    }
    add_up(t, lane, done + 1u);
}

// The sum of the colours of the neighbours that a hole is joined to.
fn sum_joined(i: u32, joined: u32) -> vec4<f32> {
    var sum = vec4(0.0);
    var rest = joined;
    while rest != 0u {
        let d = firstTrailingBit(rest) / 4u;
        rest &= rest - 1u;
        let at = vec2<i32>(vec2(i % SIDE, i / SIDE)) + direction(d);
        if all(at >= vec2(0)) && all(at < vec2(i32(SIDE))) {
            sum += color_at(u32(at.y) * SIDE + u32(at.x));
        }
    }
    return sum;
}

// Sums blocks of tiles, level by level.
@compute @workgroup_size(THREADS, 1, 1)
fn pull(@builtin(local_invocation_index) lane: u32) {
    var size = tiles_size();
    var finer = 0u;
    while size.x * size.y > 1u {
        let blocks = (size + 1u) / 2u;
        let coarser = finer + size.x * size.y;
        for (var i = lane; i < blocks.x * blocks.y; i += THREADS) {
            let corner = 2u * vec2(i % blocks.x, i / blocks.x);
            let end = min(corner + 2u, size);
            var sum = vec4(0.0);
            for (var y = corner.y; y < end.y; y++) {
                for (var x = corner.x; x < end.x; x++) {
                    sum += pyramid[finer + y * size.x + x];
                }
            }
            pyramid[coarser + i] = sum;
        }
        storageBarrier();
        finer = coarser;
        size = blocks;
    }
}

// The picture; each remaining hole takes the mean of the smallest area around it that holds colours.
@compute @workgroup_size(8, 8, 1)
fn push(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    let round = atomicLoad(&filled[pixel_index(pixel.xy)]);
    var result = vec4(0.0);
    if round != HOLE {
        result = vec4(color_of(pixel.xy, round), 1.0);
    } else {
        let sum = sum_around(vec2<i32>(pixel.xy));
        if sum.w > 0.0 {
            result = vec4(sum.rgb / sum.w, 1.0);
        }
    }
    textureStore(color, pixel.xy, result);
}

// The sum of the smallest square around a hole that holds colours.
fn sum_around(centre: vec2<i32>) -> vec4<f32> {
    for (var reach = 1; reach <= 8; reach *= 2) {
        var sum = vec4(0.0);
        let first = max(centre - reach, vec2(0));
        let last = min(centre + reach, vec2<i32>(frame.size) - 1);
        for (var y = first.y; y <= last.y; y++) {
            for (var x = first.x; x <= last.x; x++) {
                let q = vec2<u32>(vec2(x, y));
                let round = atomicLoad(&filled[pixel_index(q)]);
                if round != HOLE {
                    sum += vec4(color_of(q, round), 1.0);
                }
            }
        }
        if sum.w > 0.0 {
            return sum;
        }
    }
    var level = 0u;
    var size = tiles_size();
    var at = vec2<u32>(centre) / TILE;
    loop {
        let sum = pyramid[level + at.y * size.x + at.x];
        if sum.w > 0.0 || size.x * size.y == 1u {
            return sum;
        }
        level += size.x * size.y;
        size = (size + 1u) / 2u;
        at /= 2u;
    }
    return vec4(0.0);
}
