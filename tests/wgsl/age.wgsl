//! Ages the points, faster where they are not seen or out of date; evicts the oldest.
//! = column P1

#import cloud
#import index

struct Params {
    /// Points that no pixel shows age faster by this many times the increment.
    /// = 3.0 in 0..255 unit increments
    not_drawn_penalty: f32,
    /// Age added once to points near a pixel whose colour changed.
    /// = 64.0 in 0..255 unit age
    change_penalty: f32,
    /// Points of age 255 leave the cloud even if no sample replaces them.
    /// = true
    evict: u32,
}

// The age in 8.8 fixed point that a point reaches on average when it is replaced, and that from which points are
// evicted.
const AGE_WHEN_REPLACED: f32 = 32768.0;
const AGE_OF_EVICTION: u32 = 255u * AGE_ONE;
// Weight of one frame in the moving average of arrivals.
const RATE_WEIGHT: f32 = 0.1;

@group(0) @binding(0) var<uniform> params: Params;
/// = field of cloud, means points
@group(0) @binding(1) var<storage, read> cloud_image_id: array<u32>;
/// = field of cloud
@group(0) @binding(2) var<storage, read_write> cloud_meta: array<u32>;
/// = means arrived samples, 1 element
@group(0) @binding(3) var<storage, read> arrived: array<u32>;
/// Moving average of the samples that arrive per frame, of frames in which some do.
/// = kept, 1 element
@group(0) @binding(4) var<storage, read_write> rate: array<f32>;
/// = output, 256 elements, means points by age
@group(0) @binding(5) var<storage, read_write> histogram: array<atomic<u32>>;

/// = 1 group
@compute @workgroup_size(256)
fn measure(@builtin(local_invocation_index) lane: u32) {
    atomicStore(&histogram[lane], 0u);
    if lane == 0u {
        rate[0] = averaged(rate[0], f32(arrived[0]));
    }
}

// The workgroup's part of the histogram: most points share a few ages, so its threads would contend for the same bin.
var<workgroup> counts: array<atomic<u32>, 256>;

/// = over cloud_meta
@compute @workgroup_size(256)
fn grow(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    atomicStore(&counts[lane], 0u);
    workgroupBarrier();
    let slot = linear_index(id, groups, 256u);
    if slot < arrayLength(&cloud_meta) {
        grow_point(slot);
    }
    workgroupBarrier();
    let count = atomicLoad(&counts[lane]);
    if count != 0u {
        atomicAdd(&histogram[lane], count);
    }
}

fn grow_point(slot: u32) {
    let increment = increment(rate[0], f32(arrived[0]), arrayLength(&cloud_meta));
    let not_drawn = u32(round(f32(increment) * params.not_drawn_penalty));
    let change = u32(round(params.change_penalty * f32(AGE_ONE)));
    let bits = cloud_meta[slot];
    if (bits & LIVE) == 0u {
        return;
    }
    var age = bits & AGE;
    if (bits & FRESH) == 0u {
        let unseen = age > 0u && cloud_image_id[slot] == NOT_DRAWN;
        age += increment;
        if unseen {
            age += not_drawn;
        }
        if (bits & CHANGED) != 0u {
            age += change;
        }
        age = min(age, AGE);
    }
    cloud_meta[slot] = (bits & ~(AGE | CHANGED)) | age;
    if params.evict != 0u && age >= AGE_OF_EVICTION {
        cloud_meta[slot] = 0u;
        return;
    }
    atomicAdd(&counts[age / AGE_ONE], 1u);
}

// The moving average after one more frame; it starts at the first frame with samples.
fn averaged(rate: f32, arrived: f32) -> f32 {
    if arrived == 0.0 {
        return rate;
    }
    return select(rate + RATE_WEIGHT * (arrived - rate), arrived, rate == 0.0);
}

// The age increment of a frame, 8.8 fixed point: if `rate` of `capacity` points are replaced in a frame, oldest first, a
// point lives capacity / rate frames. 0 if no sample arrived.
fn increment(rate: f32, arrived: f32, capacity: u32) -> u32 {
    if arrived == 0.0 {
        return 0u;
    }
    return u32(min(round(AGE_WHEN_REPLACED * rate / f32(capacity)), f32(AGE)));
}
