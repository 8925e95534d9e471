//! Gives surfaces their colours and their own light back.

#import frame

@group(0) @binding(1) var light: texture_2d<f32>;
@group(0) @binding(2) var albedo: texture_2d<f32>;
@group(0) @binding(3) var emission: texture_2d<f32>;
/// Linear radiance.
/// = output, means radiance
@group(0) @binding(4) var color: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) {
        return;
    }
    // What is divided by no less than DARK in svgf-temporal is multiplied by no less here.
    let share = max(textureLoad(albedo, id.xy, 0).rgb, vec3(0.01));
    let radiance = textureLoad(light, id.xy, 0).rgb * share + textureLoad(emission, id.xy, 0).rgb;
    textureStore(color, id.xy, vec4(radiance, 1.0));
}
