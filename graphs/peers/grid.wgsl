//! Asks for one sample at the centre of each pixel of an image that is as much smaller as the frame's samples allow.

#import cloud
#import frame
#import index
#import pixel
#import requests

/// = output, per request, means requests
@group(0) @binding(1) var<storage, read_write> requests: array<Request>;
/// Width and height of the small image.
/// = output, 2 elements
@group(0) @binding(2) var<storage, read_write> small: array<u32>;

@compute @workgroup_size(64)
fn ask(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 64u);
    let budget = min(frame.samples, arrayLength(&requests));
    let full = vec2<f32>(frame.size);
    // The same shape as the frame's, rounded down.
    let width = clamp(u32(sqrt(f32(budget) * full.x / full.y)), 1u, frame.size.x);
    let size = vec2(width, min(budget / width, frame.size.y));
    if i == 0u {
        small[0] = size.x;
        small[1] = size.y;
    }
    if i >= arrayLength(&requests) {
        return;
    }
    if i >= size.x * size.y {
        requests[i] = Request(NO_PIXEL, PIXEL_CENTER, NO_POINT, VIEW_NOW);
        return;
    }
    let at = (vec2<f32>(vec2(i % size.x, i / size.x)) + 0.5) * (full / vec2<f32>(size));
    let pixel = min(vec2<u32>(at), frame.size - 1u);
    requests[i] = Request(pixel_index(pixel), PIXEL_CENTER, NO_POINT, VIEW_NOW);
}
