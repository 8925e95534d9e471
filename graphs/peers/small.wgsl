//! Writes each sample to the pixel of the small image that it was asked for.

#import frame
#import index
#import requests

@group(0) @binding(1) var<storage, read> samples: array<Sample>;
/// Width and height of the small image.
/// = 2 elements
@group(0) @binding(2) var<storage, read> small: array<u32>;
/// Linear radiance of the samples, row by row; alpha is 0 where none has arrived.
/// = output, per request
@group(0) @binding(3) var<storage, read_write> colors: array<vec4<f32>>;

@compute @workgroup_size(64)
fn clear(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 64u);
    if i < arrayLength(&colors) {
        colors[i] = vec4(0.0);
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
    // The small pixel that the centre is in.
    let center = 2u * vec2(pixel % frame.size.x, pixel / frame.size.x) + 1u;
    let at = center * vec2(small[0], small[1]) / (2u * frame.size);
    colors[at.y * small[0] + at.x] = vec4(samples[i].radiance, 1.0);
}
