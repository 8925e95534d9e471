// Makes points young while a sample of them is under way. Twin: `stages/src/pending.rs`.

#import cloud
#import frame
#import index
#import requests
#import view

@group(0) @binding(1) var<storage, read_write> cloud_meta: array<u32>;
@group(0) @binding(2) var<storage, read> requests: array<Request>;
@group(0) @binding(3) var<storage, read> samples: array<Sample>;
@group(0) @binding(4) var<storage, read_write> answered: array<u32>;

// If several samples or requests name one point, all write the same.

@compute @workgroup_size(64)
fn note(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 64u);
    if i >= arrayLength(&samples) || !same_view(frame.view, frame.previous) {
        return;
    }
    let point = samples[i].reuse;
    if samples[i].hit != HIT_NONE && point < arrayLength(&answered) {
        answered[point] = frame.index + 1u;
    }
}

@compute @workgroup_size(64)
fn rejuvenate(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = linear_index(thread, groups, 64u);
    if i >= arrayLength(&requests) || !same_view(frame.view, frame.previous) {
        return;
    }
    let point = requests[i].reuse;
    if point >= arrayLength(&cloud_meta) || answered[point] == frame.index + 1u {
        return;
    }
    let bits = cloud_meta[point];
    if (bits & LIVE) != 0u {
        cloud_meta[point] = bits & ~AGE;
    }
}
