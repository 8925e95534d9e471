//! Lights what each pixel shows by a lamp at the eye: a picture without a single sample.

#import frame
#import octahedral
#import pixel

struct Params {
    /// Brightness of the lamp: the radiance of a white surface that faces the eye.
    /// = 1.0 in 0..100
    lamp: f32,
    /// The share of the lamp's light that comes from all around.
    /// = 0.2 in 0..1
    ambient: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// = per pixel, means albedo
@group(0) @binding(2) var albedo: texture_2d<f32>;
/// = per pixel, means emission
@group(0) @binding(3) var emission: texture_2d<f32>;
/// = per pixel, means normal
@group(0) @binding(4) var<storage, read> normal: array<u32>;
/// Linear radiance; black where there is no surface.
/// = per pixel, means radiance
@group(0) @binding(5) var color: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    // The direction to what the pixel shows.
    let at = (2.0 * (vec2<f32>(id.xy) + 0.5) / vec2<f32>(frame.size) - 1.0) * vec2(frame.view.tan_x, -frame.view.tan_y);
    let direction = frame.view.forward + at.x * frame.view.right + at.y * frame.view.up;
    // A pixel without a surface has a normal of zero, which must not be divided by its length.
    let n = decode_oct16(normal[pixel_index(id.xy)]);
    let cosine = max(-dot(n, direction), 0.0) / max(length(n) * length(direction), 1e-9);
    let light = params.lamp * mix(cosine, 1.0, params.ambient);
    textureStore(color, id.xy, textureLoad(albedo, id.xy, 0) * light + textureLoad(emission, id.xy, 0));
}
