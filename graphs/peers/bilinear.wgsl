//! Enlarges a small image: between four of its pixels the colour is interpolated.

#import frame

/// Linear radiance of the small image, row by row; alpha is 0 where no sample has arrived.
@group(0) @binding(1) var<storage, read> colors: array<vec4<f32>>;
/// Width and height of the small image.
/// = 2 elements
@group(0) @binding(2) var<storage, read> small: array<u32>;
/// Linear radiance.
/// = output, means radiance
@group(0) @binding(3) var color: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let size = vec2(small[0], small[1]);
    // The pixel's centre, from the centre of the small image's first pixel.
    let at = (vec2<f32>(id.xy) + 0.5) / vec2<f32>(frame.size) * vec2<f32>(size) - 0.5;
    let corner = floor(at);
    let part = at - corner;
    var sum = vec4(0.0);
    for (var i = 0; i < 4; i++) {
        let step = vec2(i & 1, i >> 1u);
        let cell = vec2<u32>(clamp(vec2<i32>(corner) + step, vec2(0), vec2<i32>(size) - 1));
        let near = select(1.0 - part, part, step == vec2(1));
        sum += near.x * near.y * colors[cell.y * size.x + cell.x];
    }
    textureStore(color, id.xy, sum / max(sum.a, 1e-6));
}
