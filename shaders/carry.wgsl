// Moves the points of moving bodies, and ages points where the light changes. Twin: `stages/src/carry.rs`.

#import cloud
#import index
#import moves
#ifdef ACCUMULATE
#import color
#import estimate
#import octahedral
#import requests
#endif

struct Params {
    penalty: f32,
    relight: f32,
    shadow: f32,
    accumulate: u32,
    most: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> cloud_position: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> cloud_meta: array<u32>;
@group(0) @binding(3) var<storage, read> moves: array<Move>;
@group(0) @binding(4) var<storage, read> lights_before: array<Lamp>;
@group(0) @binding(5) var<storage, read> lights: array<Lamp>;
@group(0) @binding(6) var<storage, read> blockers_before: array<Blocker>;
@group(0) @binding(7) var<storage, read> blockers: array<Blocker>;
#ifdef ACCUMULATE
@group(0) @binding(8) var<storage, read_write> cloud_mean: array<vec4<f32>>;
@group(0) @binding(9) var<storage, read_write> cloud_record: array<vec4<f32>>;
#endif

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
    // A source of samples may name bodies that the scene does not have.
    let body = bits >> BODY_SHIFT;
    let motion = moves[min(body, arrayLength(&moves) - 1u)];
    let is_resting = body >= arrayLength(&moves) || rests(motion);
    let point = cloud_position[slot];
    var there = point.xyz;
    if !is_resting {
        there = moved_point(motion, point.xyz);
    }
    cloud_position[slot] = vec4(there, point.w);
    // A point at infinity emits its own light.
    if (bits & FRESH) != 0u || point.w == 0.0 {
        return;
    }
    var before = 0.0;
    var now = 0.0;
    for (var i = 0u; i < arrayLength(&lights) && lights[i].power > 0.0; i++) {
        before += light_at(lights_before[i], point.xyz);
        now += light_at(lights[i], there);
    }
    let turn = select(params.penalty, 0.0, is_resting);
    let shadowed = shadowed(point.xyz, there, body);
    let change = change(before, now);
    let penalty = min(turn + params.relight * 100.0 * change + params.shadow * shadowed, 255.0) * f32(AGE_ONE);
    cloud_meta[slot] = (bits & ~AGE) | min((bits & AGE) + u32(round(penalty)), AGE);
#ifdef ACCUMULATE
    let relative = change + SHADOW_DOUBT * shadowed + select(TURN_DOUBT, 0.0, is_resting);
    if relative > 0.0 {
        let estimate = doubted(load_estimate(cloud_mean[slot], cloud_record[slot]), relative, params.most);
        cloud_mean[slot] = stored_mean(estimate);
        cloud_record[slot] = stored_record(estimate);
    }
#endif
}

// The share of a point's light that is or was partly occluded by a body, other than its own, that moves relative to the
// light.
fn shadowed(here: vec3<f32>, there: vec3<f32>, own: u32) -> f32 {
    var light = 0.0;
    var covered = 0.0;
    for (var i = 0u; i < arrayLength(&lights) && lights[i].power > 0.0; i++) {
        let luminance = light_at(lights[i], there);
        if luminance == 0.0 {
            continue;
        }
        light += luminance;
        let same_lamp = all(lights[i].position == lights_before[i].position)
            && all(lights[i].normal == lights_before[i].normal);
        for (var k = 0u; k < arrayLength(&blockers) && blockers[k].body != 0u; k++) {
            let body = blockers[k].body;
            if body == own || (same_lamp && same_box(k)) {
                continue;
            }
            if covers(blockers_before[k], lights_before[i], here) || covers(blockers[k], lights[i], there) {
                covered += luminance;
                break;
            }
        }
    }
    return select(0.0, covered / light, light > 0.0);
}

// Whether a body has not moved.
fn same_box(k: u32) -> bool {
    return all(blockers[k].x == blockers_before[k].x)
        && all(blockers[k].y == blockers_before[k].y)
        && all(blockers[k].z == blockers_before[k].z);
}

// The relative difference of two luminances, as a share of the larger.
fn change(before: f32, now: f32) -> f32 {
    let larger = max(before, now);
    return select(0.0, abs(before - now) / larger, larger > 0.0);
}
