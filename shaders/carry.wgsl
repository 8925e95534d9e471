// Takes the points of a body along when it moves. Twin: `stages/src/carry.rs`.

#import cloud
#import index
#import moves

struct Params {
    penalty: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> cloud_position: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> cloud_meta: array<u32>;
@group(0) @binding(3) var<storage, read> moves: array<Move>;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = linear_index(id, groups, 256u);
    if slot >= arrayLength(&cloud_meta) {
        return;
    }
    let bits = cloud_meta[slot];
    let body = bits >> BODY_SHIFT;
    if body == 0u || (bits & LIVE) == 0u || rests(moves[body]) {
        return;
    }
    cloud_position[slot] = vec4(moved_point(moves[body], cloud_position[slot].xyz), cloud_position[slot].w);
    if (bits & FRESH) == 0u {
        let penalty = u32(round(params.penalty * f32(AGE_ONE)));
        cloud_meta[slot] = (bits & ~AGE) | min((bits & AGE) + penalty, AGE);
    }
}
