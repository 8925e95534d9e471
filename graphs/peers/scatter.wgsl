//! Writes each sample to its pixel.

#import frame
#import index
#import pixel
#import requests

@group(0) @binding(1) var<storage, read> samples: array<Sample>;
/// Linear radiance of this frame's samples, alpha 1; alpha is 0 where there is none.
/// = per pixel, means radiance
@group(0) @binding(2) var color: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn clear(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id.xy < frame.size) {
        textureStore(color, id.xy, vec4(0.0));
    }
}

/// = over samples
@compute @workgroup_size(64)
fn put(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 64u);
    if i >= arrayLength(&samples) || samples[i].hit == HIT_NONE {
        return;
    }
    let pixel = samples[i].pixel;
    textureStore(color, vec2(pixel % frame.size.x, pixel / frame.size.x), vec4(samples[i].radiance, 1.0));
}
