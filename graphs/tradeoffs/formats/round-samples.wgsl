//! Rounds the radiance of samples to displayed colours of 8 bits a channel, clamped at white.

#import color
#import index
#import requests

/// = means samples
@group(0) @binding(1) var<storage, read> samples: array<Sample>;
/// The same, rounded.
/// = output, per request, means samples
@group(0) @binding(2) var<storage, read_write> rounded: array<Sample>;

// The sRGB curve of values from 0 to 1.
fn encode_srgb(light: vec3<f32>) -> vec3<f32> {
    return select(1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, 12.92 * light, light <= vec3(0.0031308));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 64u);
    if i >= arrayLength(&rounded) {
        return;
    }
    var sample = samples[i];
    let shown = encode_srgb(clamp(sample.radiance, vec3(0.0), vec3(1.0)));
    sample.radiance = decode_srgb(round(shown * 255.0) / 255.0);
    rounded[i] = sample;
}
