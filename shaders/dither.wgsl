// Turns priorities into requests for samples by systematic sampling; `stages/src/dither.rs` explains the algorithm.
//
// Cells of the predicted view and pixels are processed alike: weights are summed by tile, one workgroup scans the
// tiles' sums, and each pixel tests whether the sum of weights passes a multiple of total / wanted in it.

#import cloud
#import frame
#import index
#import pixel
#import random
#import requests
#import scan
#import view
#import wide

struct Params {
    kind: u32,
    aim: u32,
    predicted_share: f32,
    border: u32,
}

// Entries of `state`: empty cells; requests for them; the weight of one request, or the greatest quotient that counts;
// sum of all clamped weights.
const CELLS_TOTAL: u32 = 0u;
const CELLS_WANTED: u32 = 1u;
const LIMIT: u32 = 2u;
const TOTAL: u32 = 3u;
#ifdef BLUE_NOISE
// While the greatest quotient that counts is searched, LIMIT has its bits that are known. Pixels wanted among those whose
// quotients have the same bits; rounds that are done.
const REST: u32 = 3u;
const ROUND: u32 = 4u;
#endif

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> priority: array<u32>;
@group(0) @binding(3) var<storage, read> id: array<u32>;
@group(0) @binding(4) var<storage, read_write> requests: array<Request>;
@group(0) @binding(5) var<storage, read_write> tiles: array<u32>;
@group(0) @binding(6) var<storage, read_write> state: array<u32>;
#ifdef OCCUPANCY
@group(0) @binding(7) var<storage, read> occupancy: array<u32>;
@group(0) @binding(8) var<storage, read_write> cell_tiles: array<u32>;
#endif
#ifdef AIM
@group(0) @binding(9) var<storage, read> aim: array<u32>;
#endif
#ifdef BLUE_NOISE
@group(0) @binding(10) var<storage, read_write> quotients: array<u32>;
@group(0) @binding(11) var<storage, read_write> bins: array<atomic<u32>>;
@group(0) @binding(12) var<storage, read_write> mask: array<u32>;
#endif

@compute @workgroup_size(64, 1, 1)
fn clear(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 64u);
    if i < arrayLength(&requests) {
        requests[i] = Request(NO_PIXEL, PIXEL_CENTER, NO_POINT, VIEW_NOW);
    }
}

// The number of tiles of an image.
fn tile_count(size: vec2<u32>) -> u32 {
    let tiles = (size + TILE - 1u) / TILE;
    return tiles.x * tiles.y;
}

// Total number of samples wanted.
fn budget() -> u32 {
    return min(frame.samples, arrayLength(&requests));
}

// 32 pseudorandom bits, different in each frame and run.
fn hash(value: u32) -> u32 {
    return pcg(value ^ pcg(frame.index ^ pcg(frame.seed)));
}

// Position of the n-th pixel of a tile: the even bits of n are x, the odd ones y.
fn morton(n: u32) -> vec2<u32> {
    let bits = vec2(n, n >> 1u);
    return (bits & vec2(1u)) | ((bits >> vec2(1u)) & vec2(2u)) | ((bits >> vec2(2u)) & vec2(4u))
        | ((bits >> vec2(3u)) & vec2(8u));
}

// Number of requests due when the weights so far add up to `sum`.
fn due(sum: u32, total: u32, wanted: u32) -> u32 {
    let offset = wide_multiply(frame.index * GOLDEN, total).high;
    return wide_divide(wide_add(wide_multiply(sum, wanted), offset), total);
}

#ifdef OCCUPANCY
fn cells_size() -> vec2<u32> {
    return (frame.size + CELL - 1u) / CELL;
}

// Whether the predicted view is another than the current one.
fn moving() -> bool {
    return !same_view(frame.predicted, frame.view);
}

fn cell_weight(cell: vec2<u32>) -> u32 {
    let size = cells_size();
    if any(cell >= size) || !moving() {
        return 0u;
    }
    return select(0u, 1u, occupancy[cell.y * size.x + cell.x] == 0u);
}

@compute @workgroup_size(16, 16, 1)
fn add_cells(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let sum = workgroup_scan(lane, cell_weight(tile.xy * TILE + morton(lane))).total;
    if lane == 0u {
        cell_tiles[tile.y * groups.x + tile.x] = sum;
    }
}

@compute @workgroup_size(SCAN_THREADS, 1, 1)
fn scan_cells(@builtin(local_invocation_index) lane: u32) {
    let count = tile_count(cells_size());
    var before = 0u;
    for (var first = 0u; first < count; first += SCAN_THREADS) {
        let i = first + lane;
        var value = 0u;
        if i < count {
            value = cell_tiles[i];
        }
        let scan = workgroup_scan(lane, value);
        if i < count {
            cell_tiles[i] = before + scan.before;
        }
        before += scan.total;
    }
    if lane == 0u {
        state[CELLS_TOTAL] = before;
        state[CELLS_WANTED] = min(before, u32(f32(budget()) * params.predicted_share));
    }
}

@compute @workgroup_size(16, 16, 1)
fn ask_cells(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = tile.xy * TILE + morton(lane);
    let weight = cell_weight(cell);
    let sum = cell_tiles[tile.y * groups.x + tile.x] + workgroup_scan(lane, weight).before;
    let total = state[CELLS_TOTAL];
    let wanted = state[CELLS_WANTED];
    if weight == 0u || wanted == 0u {
        return;
    }
    let after = due(sum + weight, total, wanted);
    if after == due(sum, total, wanted) {
        return;
    }
    let noise = hash((cell.y << 16u) | cell.x);
    // The last cells may reach beyond the image.
    let pixel = min(cell * CELL + vec2(noise, noise / CELL) % CELL, frame.size - 1u);
    requests[after - 1u] = ask_predicted(pixel_index(pixel), noise);
}

// A request of the predicted view at a place in a pixel given by `noise`.
fn ask_predicted(pixel: u32, noise: u32) -> Request {
    return Request(pixel, hash(noise), NO_POINT, VIEW_PREDICTED);
}

// Whether the content of a pixel may leave the frame before a sample of it arrives.
fn leaves(at: vec2<u32>, pixel: u32) -> bool {
    let margin = min(at, frame.size - 1u - at);
    return moving() && id[pixel] == NO_POINT && priority[pixel] >= BARE
        && min(margin.x, margin.y) < params.border && (hash(pixel) & 1u) == 1u;
}
#endif

// Number of requests for cells, which come first.
fn cells_wanted() -> u32 {
#ifdef OCCUPANCY
    return state[CELLS_WANTED];
#else
    return 0u;
#endif
}

// Number of samples left for pixels.
fn pixels_wanted() -> u32 {
    return budget() - cells_wanted();
}

// Number of bits by which priorities are shifted down, so that their sum stays below 2^32 in images of more than 2^24
// pixels.
fn priority_shift() -> u32 {
    return select(4u, 0u, frame.size.x * frame.size.y <= 0x1000000u);
}

fn pixel_weight(pixel: vec2<u32>, limit: u32) -> u32 {
    if any(pixel >= frame.size) {
        return 0u;
    }
#ifdef BLUE_NOISE
    return select(0u, 1u, quotients[pixel_index(pixel)] <= limit);
#else
    return min(min(priority[pixel_index(pixel)], MAX_PRIORITY) >> priority_shift(), limit);
#endif
}

fn add_tile(tile: vec2<u32>, groups: vec3<u32>, lane: u32, limit: u32) {
    let sum = workgroup_scan(lane, pixel_weight(tile * TILE + morton(lane), limit)).total;
    if lane == 0u {
        tiles[tile.y * groups.x + tile.x] = sum;
    }
}

#ifdef BLUE_NOISE
// The rank of a pixel in the mask, which is in another place in each frame.
fn rank_of(pixel: vec2<u32>) -> u32 {
    let at = (pixel + ((frame.index * vec2(STEP_X, STEP_Y)) >> vec2(26u))) % MASK_SIDE;
    let index = at.y * MASK_SIDE + at.x;
    return (mask[index / 2u] >> (16u * (index % 2u))) & 0xFFFFu;
}

@compute @workgroup_size(SCAN_THREADS, 1, 1)
fn begin(@builtin(local_invocation_index) lane: u32) {
    for (var bin = lane; bin < BINS; bin += SCAN_THREADS) {
        atomicStore(&bins[bin], 0u);
    }
    if lane == 0u {
        state[LIMIT] = 0u;
        state[REST] = pixels_wanted();
        state[ROUND] = 0u;
    }
}

// Divides the thresholds of a frame by the priorities.
@compute @workgroup_size(16, 16, 1)
fn divide_pixels(@builtin(global_invocation_id) at: vec3<u32>) {
    if any(at.xy >= frame.size) {
        return;
    }
    let pixel = pixel_index(at.xy);
    let weight = min(priority[pixel], MAX_PRIORITY);
    if weight == 0u {
        quotients[pixel] = NEVER;
        return;
    }
    // Where the mask is repeated, pixels of one rank need an order too.
    let order = hash(pixel) >> (RANK_BITS + 2u);
    let quotient = ((rank_of(at.xy) << (ROUNDS * ROUND_BITS - RANK_BITS)) | order) / weight;
    quotients[pixel] = quotient;
    atomicAdd(&bins[quotient >> ((ROUNDS - 1u) * ROUND_BITS)], 1u);
}

@compute @workgroup_size(16, 16, 1)
fn count_pixels(@builtin(global_invocation_id) at: vec3<u32>) {
    if any(at.xy >= frame.size) {
        return;
    }
    let shift = (ROUNDS - 1u - state[ROUND]) * ROUND_BITS;
    let quotient = quotients[pixel_index(at.xy)];
    if quotient >> (shift + ROUND_BITS) == state[LIMIT] {
        atomicAdd(&bins[(quotient >> shift) & (BINS - 1u)], 1u);
    }
}

// Finds the next bits of the greatest quotient that counts; all bits are set if there are fewer than wanted.
@compute @workgroup_size(SCAN_THREADS, 1, 1)
fn find_bin(@builtin(local_invocation_index) lane: u32) {
    const EACH = BINS / SCAN_THREADS;
    let first = lane * EACH;
    var sum = 0u;
    for (var bin = first; bin < first + EACH; bin++) {
        sum += atomicLoad(&bins[bin]);
    }
    let found = state[LIMIT];
    let rest = state[REST];
    let round = state[ROUND];
    // All threads have read before one of them writes.
    storageBarrier();
    var before = workgroup_scan(lane, sum).before;
    for (var bin = first; bin < first + EACH; bin++) {
        let count = atomicExchange(&bins[bin], 0u);
        if before < rest && (before + count >= rest || bin == BINS - 1u) {
            state[LIMIT] = (found << ROUND_BITS) | bin;
            state[REST] = rest - before;
            state[ROUND] = round + 1u;
        }
        before += count;
    }
}
#else
@compute @workgroup_size(16, 16, 1)
fn add_pixels(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    add_tile(tile.xy, groups, lane, MAX_PRIORITY);
}

@compute @workgroup_size(SCAN_THREADS, 1, 1)
fn find_limit(@builtin(local_invocation_index) lane: u32) {
    var sum = 0u;
    for (var i = lane; i < tile_count(frame.size); i += SCAN_THREADS) {
        sum += tiles[i];
    }
    let total = workgroup_scan(lane, sum).total;
    if lane == 0u {
        state[LIMIT] = max(total / max(pixels_wanted(), 1u), 1u);
    }
}
#endif

@compute @workgroup_size(16, 16, 1)
fn add_limited_pixels(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    add_tile(tile.xy, groups, lane, state[LIMIT]);
}

@compute @workgroup_size(SCAN_THREADS, 1, 1)
fn scan_pixels(@builtin(local_invocation_index) lane: u32) {
    let count = tile_count(frame.size);
    var before = 0u;
    for (var first = 0u; first < count; first += SCAN_THREADS) {
        let i = first + lane;
        var value = 0u;
        if i < count {
            value = tiles[i];
        }
        let scan = workgroup_scan(lane, value);
        if i < count {
            tiles[i] = before + scan.before;
        }
        before += scan.total;
    }
    if lane == 0u {
        state[TOTAL] = before;
    }
}

// Where in a pixel its sample should go.
fn aim_of(pixel: u32) -> u32 {
    if params.aim == AIM_RANDOM {
        return hash(pixel) & ~SPREAD;
    }
#ifdef AIM
    return aim[pixel];
#else
    return PIXEL_CENTER;
#endif
}

@compute @workgroup_size(16, 16, 1)
fn ask_pixels(
    @builtin(workgroup_id) tile: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let at = tile.xy * TILE + morton(lane);
    let weight = pixel_weight(at, state[LIMIT]);
    let sum = tiles[tile.y * groups.x + tile.x] + workgroup_scan(lane, weight).before;
    let total = state[TOTAL];
    let wanted = pixels_wanted();
    if weight == 0u || wanted == 0u {
        return;
    }
    let after = due(sum + weight, total, wanted);
    if after == due(sum, total, wanted) {
        return;
    }
    let pixel = pixel_index(at);
    let request = cells_wanted() + after - 1u;
#ifdef OCCUPANCY
    if leaves(at, pixel) {
        requests[request] = ask_predicted(pixel, pixel);
        return;
    }
#endif
    requests[request] = Request(pixel, aim_of(pixel), id[pixel], VIEW_NOW);
}
