// Chooses the slots of the cloud that new samples take over. Twin: `stages/src/replace.rs`.

#import cloud
#import color
#import estimate
#import frame
#import index
#import octahedral
#import renewal
#import requests
#import scan

struct Params {
    reuse: u32,
}

@group(0) @binding(11) var<uniform> params: Params;
@group(0) @binding(12) var<storage, read> cloud_position: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> cloud_meta: array<u32>;
@group(0) @binding(2) var<storage, read> samples: array<Sample>;
@group(0) @binding(3) var<storage, read> histogram: array<u32>;
@group(0) @binding(4) var<storage, read_write> slots: array<u32>;
@group(0) @binding(5) var<storage, read_write> claims: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> claimed: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> choice: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> oldest: array<u32>;
@group(0) @binding(9) var<storage, read_write> sample_sums: array<u32>;
@group(0) @binding(10) var<storage, read_write> slot_sums: array<vec2<u32>>;

@compute @workgroup_size(256)
fn clear(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = linear_index(id, groups, 256u);
    if slot < arrayLength(&claims) {
        atomicStore(&claims[slot], UNCLAIMED);
    }
    if slot < arrayLength(&claimed) {
        atomicStore(&claimed[slot], 0u);
    }
}

@compute @workgroup_size(64)
fn claim(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = linear_index(id, groups, 64u);
    if index >= arrayLength(&samples) {
        return;
    }
    oldest[index] = NO_POINT;
    if renews(index) {
        atomicMin(&claims[samples[index].reuse], index);
    }
}

@compute @workgroup_size(SCAN_THREADS)
fn count_samples(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let range = scan_block(group.x, arrayLength(&samples));
    var need = 0u;
    for (var index = range.x + lane; index < range.y; index += SCAN_THREADS) {
        if wins(index) {
            atomicAdd(&claimed[age(cloud_meta[samples[index].reuse])], 1u);
        } else if needs(index) {
            need += 1u;
        }
    }
    let total = workgroup_scan(lane, need).total;
    if lane == 0u {
        sample_sums[group.x] = total;
    }
}

// One thread for each age of points, from the highest down. Finds the highest age such that there are enough free slots
// of that age or higher (0 if there are not that many at all), and the number of free slots of higher age.
@compute @workgroup_size(SCAN_THREADS)
fn choose(@builtin(local_invocation_index) lane: u32) {
    let need = workgroup_scan(lane, sample_sums[lane]).total;
    let capacity = arrayLength(&cloud_meta);
    let age = 255u - lane;
    let live = histogram[age];
    let empty = capacity - min(capacity, workgroup_scan(lane, live).total);
    let free = live - min(live, atomicLoad(&claimed[age]));
    let older = empty + workgroup_scan(lane, free).before;
    if empty >= need {
        if lane == 0u {
            choice[0] = vec2(EMPTY, 0u);
        }
    } else if older < need && (older + free >= need || age == 0u) {
        choice[0] = vec2(age, older);
    }
}

@compute @workgroup_size(SCAN_THREADS)
fn count_slots(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let range = scan_block(group.x, arrayLength(&cloud_meta));
    var count = vec2(0u);
    for (var slot = range.x + lane; slot < range.y; slot += SCAN_THREADS) {
        count += vec2<u32>(candidate(slot));
    }
    let total = vec2(workgroup_scan(lane, count.x).total, workgroup_scan(lane, count.y).total);
    if lane == 0u {
        slot_sums[group.x] = total;
    }
}

@compute @workgroup_size(SCAN_THREADS)
fn collect_slots(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let range = scan_block(group.x, arrayLength(&cloud_meta));
    if range.x == range.y {
        return;
    }
    let sums = select(vec2(0u), slot_sums[lane], lane < group.x);
    // Where to write the next free slot that is older than the chosen age, and the next one of exactly that age.
    var next = vec2(workgroup_scan(lane, sums.x).total, choice[0].y + workgroup_scan(lane, sums.y).total);
    for (var tile = range.x; tile < range.y; tile += SCAN_THREADS) {
        let slot = tile + lane;
        var is = vec2(false);
        if slot < range.y {
            is = candidate(slot);
        }
        // Both counts of a tile fit into one sum: 16 bits each.
        let both = workgroup_scan(lane, u32(is.x) | (u32(is.y) << 16u));
        let place = next + vec2(both.before & 0xFFFFu, both.before >> 16u);
        if is.x && place.x < arrayLength(&oldest) {
            oldest[place.x] = slot;
        }
        if is.y && place.y < arrayLength(&oldest) {
            oldest[place.y] = slot;
        }
        next += vec2(both.total & 0xFFFFu, both.total >> 16u);
    }
}

@compute @workgroup_size(SCAN_THREADS)
fn assign(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let range = scan_block(group.x, arrayLength(&samples));
    if range.x == range.y {
        return;
    }
    var next = workgroup_scan(lane, select(0u, sample_sums[lane], lane < group.x)).total;
    for (var tile = range.x; tile < range.y; tile += SCAN_THREADS) {
        let index = tile + lane;
        var renewing = false;
        var needing = false;
        if index < range.y {
            renewing = wins(index);
            needing = !renewing && needs(index);
        }
        let scan = workgroup_scan(lane, u32(needing));
        if index < range.y {
            if renewing {
                slots[index] = samples[index].reuse;
            } else if needing {
                slots[index] = oldest[next + scan.before];
            } else {
                slots[index] = NO_POINT;
            }
        }
        next += scan.total;
    }
}

// Whether a sample renews a live point.
fn renews(index: u32) -> bool {
    let slot = samples[index].reuse;
    if params.reuse == 0u || samples[index].hit == HIT_NONE || slot >= arrayLength(&cloud_meta) {
        return false;
    }
    let meta_bits = cloud_meta[slot];
    return (meta_bits & LIVE) != 0u && may_replace(samples[index], meta_bits, cloud_position[slot]);
}

// Whether a sample takes any slot, if it does not get that of its point.
fn needs(index: u32) -> bool {
    return samples[index].hit != HIT_NONE && !is_spread(samples[index]);
}

// Whether a sample takes the slot of the point that it renews.
fn wins(index: u32) -> bool {
    if !renews(index) {
        return false;
    }
    return atomicLoad(&claims[samples[index].reuse]) == index;
}

// The whole-number age of a point; EMPTY for an empty slot.
fn age(meta_bits: u32) -> u32 {
    return select((meta_bits & AGE) / AGE_ONE, EMPTY, (meta_bits & LIVE) == 0u);
}

// Whether a slot is free and older than the chosen age; whether it is free and of exactly that age.
fn candidate(slot: u32) -> vec2<bool> {
    if atomicLoad(&claims[slot]) != UNCLAIMED {
        return vec2(false);
    }
    let age = age(cloud_meta[slot]);
    return vec2(age > choice[0].x, age == choice[0].x);
}
