//! The first part of SVGF: samples without the colours of surfaces are averaged over frames, with the mean of their
//! squares, and the variance of the average is estimated.

#import color
#import frame
#import octahedral
#import pixel

struct Params {
    /// The most samples that the history counts as; the inverse of the least weight of a new one.
    /// = 16 in 1..1000
    most: f32,
    /// Largest difference of distance between a surface and its history, as a share.
    /// = 0.05 in 0..1
    depth: f32,
    /// Least cosine between the normals of a surface and of its history.
    /// = 0.9 in -1..1
    facing: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// Linear radiance of this frame's samples; alpha is 0 where there is none.
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var albedo: texture_2d<f32>;
@group(0) @binding(4) var emission: texture_2d<f32>;
/// = per pixel, means depth
@group(0) @binding(5) var<storage, read> distance: array<f32>;
/// = per pixel, means normal
@group(0) @binding(6) var<storage, read> normal: array<u32>;
/// Where each pixel's surface was in the last frame, from the pixel's centre, pixels.
/// = per pixel, means motion
@group(0) @binding(7) var<storage, read> motion: array<vec2<f32>>;
/// = last frame, per pixel, means depth
@group(0) @binding(8) var<storage, read> distance_before: array<f32>;
/// = last frame, per pixel, means normal
@group(0) @binding(9) var<storage, read> normal_before: array<u32>;
/// The averaged light of the frame before, perhaps filtered.
/// = last frame
@group(0) @binding(10) var before: texture_2d<f32>;
/// `moments` of the frame before.
/// = last frame
@group(0) @binding(11) var moments_before: texture_2d<f32>;
/// Light without the colours of surfaces; alpha is the variance of its luminance, NO_LIGHT where there is none.
/// = output
@group(0) @binding(12) var light: texture_storage_2d<rgba32float, write>;
/// Means of the luminance and of its square, and the number of samples in them.
/// = output
@group(0) @binding(13) var moments: texture_storage_2d<rgba32float, write>;

// Variance where no sample has been.
const NO_LIGHT: f32 = -1.0;
// Albedo below which nothing is divided.
const DARK: f32 = 0.01;
// Samples from which on their own variance is used.
const ENOUGH: f32 = 4.0;

struct Past {
    light: vec3<f32>,
    moments: vec2<f32>,
    samples: f32,
}

// The distance that a still surface at a pixel had in the last frame.
fn distance_then(pixel: vec2<u32>, z: f32) -> f32 {
    let at = 2.0 * (vec2<f32>(pixel) + 0.5) / vec2<f32>(frame.size) - 1.0;
    let view = frame.view;
    let ray = view.forward + at.x * view.tan_x * view.right - at.y * view.tan_y * view.up;
    return dot(view.eye + z * ray - frame.previous.eye, frame.previous.forward);
}

// The history at a position, interpolated between those of the four pixels around that show the surface.
fn history(at: vec2<f32>, z: f32, n: vec3<f32>) -> Past {
    var past = Past(vec3(0.0), vec2(0.0), 0.0);
    if any(abs(at) > vec2(1e6)) {
        return past;
    }
    let corner = floor(at - 0.5);
    let part = at - 0.5 - corner;
    var sum = 0.0;
    for (var i = 0; i < 4; i++) {
        let step = vec2(i & 1, i >> 1u);
        let there = vec2<i32>(corner) + step;
        if is_outside(there) {
            continue;
        }
        let index = pixel_index(vec2<u32>(there));
        let other = decode_oct16(normal_before[index]);
        let alike = dot(other, n) >= params.facing * length(other) * length(n);
        let known = textureLoad(moments_before, there, 0);
        if abs(distance_before[index] - z) > params.depth * z || !alike || known.z == 0.0 {
            continue;
        }
        let near = select(1.0 - part, part, step == vec2(1));
        let weight = near.x * near.y;
        past.light += weight * textureLoad(before, there, 0).rgb;
        past.moments += weight * known.xy;
        past.samples += weight * known.z;
        sum += weight;
    }
    if sum < 0.01 {
        return Past(vec3(0.0), vec2(0.0), 0.0);
    }
    return Past(past.light / sum, past.moments / sum, past.samples / sum);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let index = pixel_index(id.xy);
    let at = vec2<f32>(id.xy) + 0.5 + motion[index];
    let z = distance_then(id.xy, distance[index]);
    let past = history(at, z, decode_oct16(normal[index]));
    var now = past;
    let sample = textureLoad(color, id.xy, 0);
    if sample.a > 0.0 {
        let own = textureLoad(emission, id.xy, 0).rgb;
        let share = max(textureLoad(albedo, id.xy, 0).rgb, vec3(DARK));
        let arrived = max(sample.rgb - own, vec3(0.0)) / share;
        let bright = luminance(arrived);
        now.samples = min(past.samples + 1.0, params.most);
        now.light = mix(past.light, arrived, 1.0 / now.samples);
        now.moments = mix(past.moments, vec2(bright, bright * bright), 1.0 / now.samples);
    }
    var variance = NO_LIGHT;
    if now.samples > 0.0 {
        // Of the mean of so many samples. Of few, their own variance says little: it is taken to be as large as the
        // light itself.
        let spread = max(now.moments.y - now.moments.x * now.moments.x, 0.0);
        let unsure = now.moments.y * max(1.0 - now.samples / ENOUGH, 0.0);
        variance = (spread + unsure) / now.samples;
    }
    textureStore(light, id.xy, vec4(now.light, variance));
    textureStore(moments, id.xy, vec4(now.moments, now.samples, 0.0));
}
