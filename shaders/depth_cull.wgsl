// Drops points that lie behind the mean depth of their 3x3 pixels, and keeps the shifted mean.

#import frame

struct Params {
    rule: u32,
    threshold: f32,
}

const RELATIVE: u32 = 0u;

// Bits of infinity.
const EMPTY_DEPTH: u32 = 0x7F800000u;
const NO_POINT: u32 = 0xFFFFFFFFu;

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read_write> id: array<u32>;
@group(0) @binding(3) var<storage, read> depth: array<u32>;
@group(0) @binding(4) var<storage, read_write> filtered: array<f32>;

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

// The depth of what lies share * (far - near) behind, at most 1.
fn buffer_shift(share: f32, d: f32) -> f32 {
    let rho = frame.view.near / frame.view.far;
    let q = 1.0 - rho;
    let a = rho - share * q;
    let b = share;
    let g = -share * q * q;
    let h = rho + share * q;
    let denominator = g * d + h;
    // Where rounding leaves nothing of it, the result lies beyond the far plane.
    if denominator > 0.0 {
        return min((a * d + b) / denominator, 1.0);
    }
    return 1.0;
}

// What the rule compares: the distance or the z-buffer's depth.
fn value(z: u32) -> f32 {
    if params.rule == RELATIVE {
        return bitcast<f32>(z);
    }
    return buffer_depth(bitcast<f32>(z));
}

@compute @workgroup_size(8, 8, 1)
fn cull(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= frame.size) {
        return;
    }
    // Column by column: the twin adds each column up once.
    var sum = 0.0;
    var count = 0.0;
    for (var dx = -1; dx <= 1; dx++) {
        var column = 0.0;
        for (var dy = -1; dy <= 1; dy++) {
            let q = vec2<i32>(pixel.xy) + vec2(dx, dy);
            if any(q < vec2(0)) || any(q >= vec2<i32>(frame.size)) {
                continue;
            }
            let z = depth[u32(q.y) * frame.size.x + u32(q.x)];
            if z < EMPTY_DEPTH {
                column += value(z);
                count += 1.0;
            }
        }
        sum += column;
    }
    let p = pixel.y * frame.size.x + pixel.x;
    if count == 0.0 {
        filtered[p] = frame.view.far;
        return;
    }
    let mean = sum / count;
    var shifted: f32;
    if params.rule == RELATIVE {
        shifted = mean * (1.0 + params.threshold);
        filtered[p] = min(shifted, frame.view.far);
    } else {
        shifted = buffer_shift(params.threshold, mean);
        filtered[p] = buffer_distance(shifted);
    }
    if depth[p] < EMPTY_DEPTH && value(depth[p]) > shifted {
        id[p] = NO_POINT;
    }
}
