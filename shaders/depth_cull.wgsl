// Drops points behind those around them, and writes the shifted mean depth of 3x3 pixels. With MAJORITY: `vote`,
// then `cull`; otherwise `cull` only.

#import cloud
#import frame
#import pixel

struct Params {
    rule: u32,
    threshold: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read_write> id: array<u32>;
@group(0) @binding(3) var<storage, read> depth: array<u32>;
@group(0) @binding(4) var<storage, read_write> filtered: array<f32>;
#ifdef MAJORITY
@group(0) @binding(5) var<storage, read_write> first_vote: array<u32>;
#endif

// The depth of a z-buffer with range 0 (near) to 1 (far).
fn buffer_depth(z: f32) -> f32 {
    let near = frame.view.near;
    let far = frame.view.far;
    return (1.0 - near / z) * (far / (far - near));
}

// The distance of a depth.
fn buffer_distance(d: f32) -> f32 {
    let near = frame.view.near;
    let far = frame.view.far;
    return clamp(near / (1.0 - d * ((far - near) / far)), near, far);
}

// The depth of a point share * (far - near) behind, at most 1.
fn buffer_shift(share: f32, d: f32) -> f32 {
    let rho = frame.view.near / frame.view.far;
    let q = 1.0 - rho;
    let a = rho - share * q;
    let b = share;
    let g = -share * q * q;
    let h = rho + share * q;
    let denominator = g * d + h;
    // If rounding leaves nothing of it, the result is beyond the far plane.
    if denominator > 0.0 {
        return min((a * d + b) / denominator, 1.0);
    }
    return 1.0;
}

// The quantity that the rule compares: the distance or the z-buffer's depth.
fn value(z: u32) -> f32 {
    if params.rule == RULE_SEED_EXACT {
        return buffer_depth(bitcast<f32>(z));
    }
    return bitcast<f32>(z);
}

// The depths to average: those of all points, or those left by the first vote.
fn averaged(p: u32) -> u32 {
#ifdef MAJORITY
    return first_vote[p];
#else
    return depth[p];
#endif
}

// The mean value of the 3x3 pixels, negative if all are empty.
fn mean_of(pixel: vec2<i32>) -> f32 {
    // Column by column, like the twin, which sums each column only once.
    var sum = 0.0;
    var count = 0.0;
    for (var dx = -1; dx <= 1; dx++) {
        var column = 0.0;
        for (var dy = -1; dy <= 1; dy++) {
            let q = pixel + vec2(dx, dy);
            if is_outside(q) {
                continue;
            }
            let z = averaged(pixel_index(vec2<u32>(q)));
            if z < EMPTY_DEPTH {
                column += value(z);
                count += 1.0;
            }
        }
        sum += column;
    }
    return select(sum / count, -1.0, count == 0.0);
}

#ifdef MAJORITY
const ALL: u32 = 0u;
const FIRST_VOTE: u32 = 1u;

fn voter(round: u32, p: u32) -> u32 {
    if round == ALL {
        return depth[p];
    }
    return first_vote[p];
}

// The number of votes that outvote a point: half; pixels outside the image count as points that are not nearer, but 7
// of 8 are always enough.
fn majority(pixel: vec2<i32>, voters: i32) -> i32 {
    let span = min(pixel + 3, vec2<i32>(frame.size)) - max(pixel - 2, vec2(0));
    let inside = max(span.x * span.y - 1, 1);
    return (voters * min(inside * 7 / 4, 24) + 2 * inside - 1) / (2 * inside);
}

// Whether there are other points in the 5x5 pixels, and enough of them are clearly nearer.
fn is_outvoted(round: u32, pixel: vec2<i32>) -> bool {
    let z = bitcast<f32>(voter(round, pixel_index(vec2<u32>(pixel))));
    let scale = 1.0 + params.threshold;
    // The point itself is not a voter, and is never nearer than itself.
    var voters = -1;
    var nearer = 0;
    for (var dy = -2; dy <= 2; dy++) {
        for (var dx = -2; dx <= 2; dx++) {
            let q = pixel + vec2(dx, dy);
            if is_outside(q) {
                continue;
            }
            let other = voter(round, pixel_index(vec2<u32>(q)));
            if other < EMPTY_DEPTH {
                voters += 1;
                nearer += i32(bitcast<f32>(other) * scale < z);
            }
        }
    }
    return voters > 0 && nearer >= majority(pixel, voters);
}

@compute @workgroup_size(8, 8, 1)
fn vote(@builtin(global_invocation_id) thread: vec3<u32>) {
    let pixel = vec2<i32>(thread.xy);
    if is_outside(pixel) {
        return;
    }
    let p = pixel_index(thread.xy);
    let own = depth[p];
    first_vote[p] = select(own, EMPTY_DEPTH, own < EMPTY_DEPTH && is_outvoted(ALL, pixel));
}

#endif

@compute @workgroup_size(8, 8, 1)
fn cull(@builtin(global_invocation_id) thread: vec3<u32>) {
    let pixel = vec2<i32>(thread.xy);
    if is_outside(pixel) {
        return;
    }
    let p = pixel_index(thread.xy);
    let mean = mean_of(pixel);
    var shifted = mean * (1.0 + params.threshold);
    var distance = min(shifted, frame.view.far);
    if params.rule == RULE_SEED_EXACT {
        shifted = buffer_shift(params.threshold, mean);
        distance = buffer_distance(shifted);
    }
    filtered[p] = select(distance, frame.view.far, mean < 0.0);
#ifdef MAJORITY
    let is_hidden = first_vote[p] >= EMPTY_DEPTH || is_outvoted(FIRST_VOTE, pixel);
#else
    let is_hidden = depth[p] < EMPTY_DEPTH && value(depth[p]) > shifted;
#endif
    if is_hidden {
        id[p] = NO_POINT;
    }
}
