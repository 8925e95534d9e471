//! Temporal upsampling: the colour that the surface had in the last frame, clamped to this frame's samples around and
//! blended with them.

#import color
#import frame
#import pixel

struct Params {
    /// Half the width of the window in which samples are looked for, as a multiple of their mean distance.
    /// = 2 in 0.5..4
    window: f32,
    /// Standard deviation of the kernel by which a sample counts at pixels near it.
    /// = 0.7 in 0.1..8 unit pixels
    sigma: f32,
    /// The most samples that the history counts as.
    /// = 16 in 1..1000
    most: f32,
    /// How far the history may lie outside the samples around, in standard deviations.
    /// = 4 in 0..100
    width: f32,
    /// Largest difference of distance between surfaces that share colours, as a share.
    /// = 0.05 in 0..1
    depth: f32,
    /// Blend and clamp radiance divided by 1 + luminance, so that one bright sample does not outweigh all others.
    /// = true
    compress: u32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// Linear radiance of this frame's samples; alpha is 0 where there is none.
@group(0) @binding(2) var color: texture_2d<f32>;
/// = per pixel, means depth
@group(0) @binding(3) var<storage, read> distance: array<f32>;
/// Where each pixel's surface was in the last frame, from the pixel's centre, pixels.
/// = per pixel, means motion
@group(0) @binding(4) var<storage, read> motion: array<vec2<f32>>;
/// `blended` of the frame before.
/// = last frame
@group(0) @binding(5) var before: texture_2d<f32>;
/// `distance` of the frame before.
/// = last frame, per pixel, means depth
@group(0) @binding(6) var<storage, read> distance_before: array<f32>;
/// Linear radiance; alpha is the number of samples that it is made of.
/// = output, means radiance
@group(0) @binding(7) var blended: texture_storage_2d<rgba32float, write>;

// Weight in the mean of a sample of another surface.
const FAR: f32 = 1e-3;
// The most pixels that the window reaches to any side, whatever the number of samples.
const WIDEST: f32 = 16.0;
// As how many samples the mean of those around counts.
const FIRST: f32 = 0.1;

fn compressed(color: vec3<f32>) -> vec3<f32> {
#ifdef COMPRESS
    return color / (1.0 + luminance(color));
#else
    return color;
#endif
}

fn expanded(color: vec3<f32>) -> vec3<f32> {
#ifdef COMPRESS
    return color / max(1.0 - luminance(color), 1e-4);
#else
    return color;
#endif
}

fn is_near(a: f32, b: f32) -> bool {
    return abs(a - b) <= params.depth * max(a, b);
}

// The distance that a still surface at a pixel had in the last frame.
fn distance_then(pixel: vec2<u32>, z: f32) -> f32 {
    let at = 2.0 * (vec2<f32>(pixel) + 0.5) / vec2<f32>(frame.size) - 1.0;
    let view = frame.view;
    let ray = view.forward + at.x * view.tan_x * view.right - at.y * view.tan_y * view.up;
    return dot(view.eye + z * ray - frame.previous.eye, frame.previous.forward);
}

// The last frame's colour at a position, interpolated between the four pixels around, without those of other surfaces.
// Alpha is the number of samples.
fn history(at: vec2<f32>, z: f32) -> vec4<f32> {
    if any(abs(at) > vec2(1e6)) {
        return vec4(0.0);
    }
    let corner = floor(at - 0.5);
    let part = at - 0.5 - corner;
    var sum = vec4(0.0);
    var samples = 0.0;
    for (var i = 0; i < 4; i++) {
        let step = vec2(i & 1, i >> 1u);
        let pixel = vec2<i32>(corner) + step;
        if is_outside(pixel) || !is_near(distance_before[pixel_index(vec2<u32>(pixel))], z) {
            continue;
        }
        let seen = textureLoad(before, pixel, 0);
        let there = vec4(compressed(seen.rgb), seen.a);
        let near = select(1.0 - part, part, step == vec2(1));
        // A pixel that has seen no sample has no colour.
        let weight = near.x * near.y * select(0.0, 1.0, there.a > 0.0);
        sum += weight * vec4(there.rgb, 1.0);
        samples += weight * there.a;
    }
    if sum.a < 0.01 {
        return vec4(0.0);
    }
    return vec4(sum.rgb, samples) / sum.a;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let z = distance[pixel_index(id.xy)];
    // This frame's samples: those of the same surface splatted into the pixel, and the mean and deviation of all.
    // Nearer samples count more in the mean, which the pixel shows until it has a history.
    let apart = sqrt(f32(frame.size.x * frame.size.y) / f32(max(frame.samples, 1u)));
    let radius = i32(clamp(ceil(params.window * apart), 1.0, WIDEST));
    var splat = vec4(0.0);
    var around = vec4(0.0);
    var squares = vec3(0.0);
    for (var y = -radius; y <= radius; y++) {
        for (var x = -radius; x <= radius; x++) {
            let at = vec2<i32>(id.xy) + vec2(x, y);
            if is_outside(at) {
                continue;
            }
            let sample = textureLoad(color, at, 0);
            if sample.a == 0.0 {
                continue;
            }
            let light = vec4(compressed(sample.rgb), 1.0);
            let squared = f32(x * x + y * y);
            // Samples of other surfaces count where there are no others.
            var near = FAR / (1.0 + squared);
            if is_near(distance[pixel_index(vec2<u32>(at))], z) {
                splat += exp(-0.5 * squared / (params.sigma * params.sigma)) * light;
                near = 1.0 / (1.0 + squared);
            }
            around += near * light;
            squares += near * light.rgb * light.rgb;
        }
    }
    let mean = around.rgb / max(around.a, 1e-6);
    let reach = params.width * sqrt(max(squares / max(around.a, 1e-6) - mean * mean, vec3(0.0)));

    var past = history(vec2<f32>(id.xy) + 0.5 + motion[pixel_index(id.xy)], distance_then(id.xy, z));
    past.a = min(past.a, params.most);
    if around.a > 0.0 {
        if past.a > 0.0 {
            past = vec4(clamp(past.rgb, mean - reach, mean + reach), past.a);
        } else {
            past = vec4(mean, FIRST);
        }
    }
    let samples = past.a + splat.a;
    let mixed = (past.rgb * past.a + splat.rgb) / max(samples, 1e-6);
    textureStore(blended, id.xy, vec4(expanded(mixed), samples));
}
