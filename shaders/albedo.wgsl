// Keeps the mean albedo of each point's samples. Twin: `stages/src/albedo.rs`.

#import albedo
#import index
#import requests

@group(0) @binding(0) var<storage, read> cloud_record: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> samples: array<Sample>;
@group(0) @binding(2) var<storage, read> slots: array<u32>;
@group(0) @binding(3) var<storage, read_write> albedos: array<vec2<u32>>;

@compute @workgroup_size(64)
fn join(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = linear_index(id, groups, 64u);
    if index >= arrayLength(&slots) || samples[index].hit == HIT_NONE || slots[index] >= arrayLength(&albedos) {
        return;
    }
    let slot = slots[index];
    let before = unpack_mean(albedos[slot]);
    let own = decode_albedo(samples[index].albedo);
    // The mean of the colours has counted this sample already. What begins anew counts for one.
    let count = max(abs(cloud_record[slot].w), 1.0);
    albedos[slot] = pack_mean(select(before + (own - before) / count, own, count == 1.0));
}
