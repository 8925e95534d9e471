// Takes the points of a body along when it moves, and ages points where the light changes. Twin: `stages/src/carry.rs`.

#import cloud
#import index
#import moves

struct Params {
    penalty: f32,
    relight: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> cloud_position: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> cloud_meta: array<u32>;
@group(0) @binding(3) var<storage, read> moves: array<Move>;
@group(0) @binding(4) var<storage, read> lights_before: array<Lamp>;
@group(0) @binding(5) var<storage, read> lights: array<Lamp>;

@compute @workgroup_size(256)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = linear_index(id, groups, 256u);
    if slot >= arrayLength(&cloud_meta) {
        return;
    }
    let bits = cloud_meta[slot];
    if (bits & LIVE) == 0u {
        return;
    }
    let motion = moves[bits >> BODY_SHIFT];
    let is_resting = rests(motion);
    if is_resting && same_lights() {
        return;
    }
    let point = cloud_position[slot];
    var there = point.xyz;
    if !is_resting {
        there = moved_point(motion, point.xyz);
    }
    cloud_position[slot] = vec4(there, point.w);
    // What is infinitely far away sends its own light.
    if (bits & FRESH) != 0u || point.w == 0.0 {
        return;
    }
    var before = 0.0;
    var now = 0.0;
    for (var i = 0u; i < arrayLength(&lights); i++) {
        before += light_at(lights_before[i], point.xyz);
        now += light_at(lights[i], there);
    }
    let turn = select(params.penalty, 0.0, is_resting);
    let penalty = min(turn + params.relight * 100.0 * change(before, now), 255.0) * f32(AGE_ONE);
    cloud_meta[slot] = (bits & ~AGE) | min((bits & AGE) + u32(round(penalty)), AGE);
}

// Whether no light has moved.
fn same_lights() -> bool {
    for (var i = 0u; i < arrayLength(&lights); i++) {
        let same = all(lights[i].position == lights_before[i].position)
            && all(lights[i].normal == lights_before[i].normal);
        if !same {
            return false;
        }
    }
    return true;
}

// How far two luminances are apart, as a share of the larger.
fn change(before: f32, now: f32) -> f32 {
    let larger = max(before, now);
    return select(0.0, abs(before - now) / larger, larger > 0.0);
}
