// Puts new samples into the cloud. Twin: `stages/src/integrate.rs`.

#import cloud
#import color
#import frame
#import index
#import pixel
#import requests

struct Params {
    threshold: f32,
}

@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read_write> cloud_position: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> cloud_radiance: array<u32>;
@group(0) @binding(4) var<storage, read_write> cloud_image_id: array<u32>;
@group(0) @binding(5) var<storage, read_write> cloud_meta: array<u32>;
@group(0) @binding(6) var<storage, read> samples: array<Sample>;
@group(0) @binding(7) var<storage, read> slots: array<u32>;
@group(0) @binding(8) var<storage, read_write> arrived: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> changed: array<atomic<u32>>;
@group(0) @binding(10) var<storage, read_write> dates: array<u32>;

@compute @workgroup_size(1)
fn clear() {
    atomicStore(&arrived[0], 0u);
}

@compute @workgroup_size(64)
fn compare(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = linear_index(id, groups, 64u);
    if index >= arrayLength(&slots) || !takes(index) {
        return;
    }
    atomicAdd(&arrived[0], 1u);
    if differs_from_shown(index) {
        stamp_around(samples[index].pixel);
    }
}

@compute @workgroup_size(256)
fn flag(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = linear_index(id, groups, 256u);
    if slot >= arrayLength(&cloud_meta) || (cloud_meta[slot] & LIVE) == 0u {
        return;
    }
    var bits = cloud_meta[slot] & ~FRESH;
    let pixel = cloud_image_id[slot];
    if pixel < arrayLength(&changed) && atomicLoad(&changed[pixel]) == frame.index + 1u {
        bits |= CHANGED;
    }
    cloud_meta[slot] = bits;
}

@compute @workgroup_size(64)
fn insert(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = linear_index(id, groups, 64u);
    if index >= arrayLength(&slots) || !takes(index) {
        return;
    }
    let slot = slots[index];
    let is_point = samples[index].hit == HIT_SURFACE;
    cloud_position[slot] = vec4(samples[index].position, select(0.0, 1.0, is_point));
    cloud_radiance[slot] = encode_radiance(samples[index].radiance);
    cloud_image_id[slot] = NOT_DRAWN;
    cloud_meta[slot] = LIVE | FRESH | (samples[index].body << BODY_SHIFT);
    dates[slot] = frame.index + 1u;
}

// Whether there is a sample and it has a slot.
fn takes(index: u32) -> bool {
    return samples[index].hit != HIT_NONE && slots[index] < arrayLength(&cloud_meta);
}

// Whether the point that a sample was requested to renew is live and had a different colour.
fn differs_from_shown(index: u32) -> bool {
    let point = samples[index].reuse;
    if samples[index].view != VIEW_NOW || point >= arrayLength(&cloud_meta) {
        return false;
    }
    if (cloud_meta[point] & LIVE) == 0u {
        return false;
    }
    let before = decode_radiance(cloud_radiance[point]);
    // Compared with stored precision.
    let after = decode_radiance(encode_radiance(samples[index].radiance));
    return abs(tone_mapped_luma(after) - tone_mapped_luma(before)) > params.threshold;
}

// Stamps the 7 x 7 pixels around one, clipped to the image.
fn stamp_around(index: u32) {
    let pixel = vec2(index % frame.size.x, index / frame.size.x);
    let first = pixel - min(pixel, vec2(REACH));
    let end = min(pixel + REACH + 1u, frame.size);
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            atomicStore(&changed[pixel_index(vec2(x, y))], frame.index + 1u);
        }
    }
}

// Y / (1 + Y) with Rec. 709 luminance Y: from 0 to 1, and never steeper than Y.
fn tone_mapped_luma(color: vec3<f32>) -> f32 {
    let y = luminance(color);
    return y / (1.0 + y);
}
