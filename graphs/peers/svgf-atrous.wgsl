//! One level of SVGF's à-trous filter: a 5x5 B-spline with holes, cut where depth, normal, or luminance differ by more
//! than noise explains.

#import color
#import frame
#import octahedral
#import pixel

struct Params {
    /// The level, from 0: taps are 2^level pixels apart.
    /// = 0 in 0..8
    level: u32,
    /// Tolerance of depth, as multiples of what the surface's slope explains.
    /// = 1 in 0.01..100
    sigma_depth: f32,
    /// Power of the cosine between normals.
    /// = 128 in 1..1000
    sigma_normal: f32,
    /// Tolerance of luminance, in standard deviations.
    /// = 4 in 0.01..1000
    sigma_light: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// Light without the colours of surfaces; alpha is the variance of its luminance, negative where there is none.
@group(0) @binding(2) var light: texture_2d<f32>;
/// = per pixel, means depth
@group(0) @binding(3) var<storage, read> distance: array<f32>;
/// = per pixel, means normal
@group(0) @binding(4) var<storage, read> normal: array<u32>;
/// The same, filtered.
@group(0) @binding(5) var filtered: texture_storage_2d<rgba32float, write>;

fn distance_at(pixel: vec2<i32>) -> f32 {
    let inside = clamp(pixel, vec2(0), vec2<i32>(frame.size) - 1);
    return distance[pixel_index(vec2<u32>(inside))];
}

// How distance changes from pixel to pixel along x and y. Of both sides the flatter one, which does not cross an edge.
fn slope(pixel: vec2<i32>, z: f32) -> vec2<f32> {
    let right = distance_at(pixel + vec2(1, 0)) - z;
    let left = z - distance_at(pixel - vec2(1, 0));
    let below = distance_at(pixel + vec2(0, 1)) - z;
    let above = z - distance_at(pixel - vec2(0, 1));
    return vec2(select(left, right, abs(right) < abs(left)), select(above, below, abs(below) < abs(above)));
}

// The variance of the pixels around, by a 3x3 binomial filter, without those that have none.
fn smooth_variance(pixel: vec2<i32>) -> f32 {
    var sum = vec2(0.0);
    for (var i = 0; i < 9; i++) {
        let step = vec2(i % 3 - 1, i / 3 - 1);
        if is_outside(pixel + step) {
            continue;
        }
        let variance = textureLoad(light, pixel + step, 0).a;
        let weight = select(0.0, exp2(-f32(abs(step.x) + abs(step.y))), variance >= 0.0);
        sum += weight * vec2(variance, 1.0);
    }
    return sum.x / max(sum.y, 1e-6);
}

// The B-spline: 3/8, 1/4, 1/16.
fn spline(step: i32) -> f32 {
    let away = abs(step);
    return select(select(0.0625, 0.25, away == 1), 0.375, away == 0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let pixel = vec2<i32>(id.xy);
    let here = textureLoad(light, pixel, 0);
    let z = distance_at(pixel);
    let n = normalize(decode_oct16(normal[pixel_index(id.xy)]) + vec3(0.0, 0.0, 1e-9));
    let tilt = slope(pixel, z);
    let deviation = params.sigma_light * sqrt(smooth_variance(pixel)) + 1e-4;
    // A pixel that no sample has reached takes what the others have.
    let known = here.a >= 0.0;
    var sum = vec3(0.0);
    var variance = 0.0;
    var total = 0.0;
    for (var y = -2; y <= 2; y++) {
        for (var x = -2; x <= 2; x++) {
            let apart = vec2(x, y) << vec2(params.level);
            let at = pixel + apart;
            if is_outside(at) {
                continue;
            }
            let there = textureLoad(light, at, 0);
            if there.a < 0.0 {
                continue;
            }
            let explained = params.sigma_depth * abs(dot(tilt, vec2<f32>(apart))) + 1e-3 * z;
            let m = normalize(decode_oct16(normal[pixel_index(vec2<u32>(at))]) + vec3(0.0, 0.0, 1e-9));
            var exponent = abs(distance_at(at) - z) / explained;
            if known {
                exponent += abs(luminance(there.rgb) - luminance(here.rgb)) / deviation;
            }
            let weight = spline(x) * spline(y) * exp(-exponent) * pow(max(dot(n, m), 0.0), params.sigma_normal);
            sum += weight * there.rgb;
            variance += weight * weight * there.a;
            total += weight;
        }
    }
    if total < 1e-9 {
        textureStore(filtered, id.xy, here);
        return;
    }
    textureStore(filtered, id.xy, vec4(sum / total, variance / (total * total)));
}
