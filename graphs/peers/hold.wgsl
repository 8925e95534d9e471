//! Each pixel shows the last sample that was traced for it.

#import frame
#import pixel

/// Linear radiance of this frame's samples; alpha is 0 where there is none.
@group(0) @binding(1) var color: texture_2d<f32>;
/// `held` of the frame before.
/// = last frame
@group(0) @binding(2) var before: texture_2d<f32>;
/// Linear radiance of the last sample of each pixel; all is 0 before the first.
/// = output, means radiance
@group(0) @binding(3) var held: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    let sample = textureLoad(color, id.xy, 0);
    textureStore(held, id.xy, select(textureLoad(before, id.xy, 0), sample, sample.a > 0.0));
}
