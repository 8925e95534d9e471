//! Darkens the picture where lines are.

#import frame

struct Params {
    /// How much of the light the lines take.
    /// = 0.8 in 0..1
    ink: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
/// Linear radiance.
@group(0) @binding(2) var color: texture_2d<f32>;
/// 1 where a line was drawn.
@group(0) @binding(3) var lines: texture_2d<f32>;
/// Linear radiance, with the lines over it.
/// = means radiance
@group(0) @binding(4) var inked: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn darken(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let below = textureLoad(color, id.xy, 0);
    let light = 1.0 - params.ink * textureLoad(lines, id.xy, 0).r;
    textureStore(inked, id.xy, vec4(below.rgb * light, below.a));
}
