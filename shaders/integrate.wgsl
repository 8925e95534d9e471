// Puts new samples into the cloud. Twin: `stages/src/integrate.rs`.

#import cloud
#import color
#import frame
#import index
#import pixel
#import requests
#import estimate
#import octahedral
#import renewal
#ifdef ACCUMULATE
#import view
#endif

struct Params {
    threshold: f32,
    accumulate: u32,
    most: f32,
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
#ifdef ACCUMULATE
@group(0) @binding(11) var<storage, read_write> cloud_mean: array<vec4<f32>>;
@group(0) @binding(12) var<storage, read_write> cloud_record: array<vec4<f32>>;
@group(0) @binding(13) var<storage, read_write> asked: array<u32>;
@group(0) @binding(14) var<storage, read_write> evidence: array<vec2<f32>>;
@group(0) @binding(15) var<storage, read_write> shift: array<f32>;
#endif

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
#ifdef ACCUMULATE
    if is_renewal(index) && samples[index].pixel < arrayLength(&asked) {
        // What a source asks for twice counts once.
        asked[samples[index].pixel] = index + 1u;
    }
#endif
}

#ifdef ACCUMULATE
// Whether all samples of a tile together tell that its light has changed, and by what share.
@compute @workgroup_size(64)
fn weigh(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let tile = linear_index(id, groups, 64u);
    if tile >= arrayLength(&shift) {
        return;
    }
    let columns = (frame.size.x + TILE - 1u) / TILE;
    let first = TILE * vec2(tile % columns, tile / columns);
    let end = min(first + TILE, frame.size);
    // The sums of differences, of their variances, and of the luminance of the means.
    var found = vec3(0.0);
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            let pixel = pixel_index(vec2(x, y));
            if asked[pixel] != 0u {
                found += told(asked[pixel] - 1u);
                asked[pixel] = 0u;
            }
        }
    }
    let difference = MEMORY * evidence[tile].x + found.x;
    let variance = MEMORY * MEMORY * evidence[tile].y + found.y;
    let share = abs(found.x) / max(found.z, 1.17549435e-38);
    let is_certain = difference * difference > CERTAIN * CERTAIN * variance;
    let goes_on = difference * found.x > 0.0 && share > LEAST_SHIFT;
    evidence[tile] = vec2(difference, variance);
    shift[tile] = select(0.0, min(share, 1.0), is_certain && goes_on);
}

// What a sample adds to these sums.
fn told(index: u32) -> vec3<f32> {
    let point = samples[index].reuse;
    let before = load_estimate(cloud_mean[point], cloud_record[point]);
    let found = difference_from(before, single(index));
    // Textures and edges differ by more than their noise, but not all to one side.
    return vec3(found.x, max(found.y, found.x * found.x), luminance(before.mean));
}
#endif

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
#ifdef ACCUMULATE
    let share = shift_at(pixel);
    if share > 0.0 {
        bits = (bits & ~AGE) | min((bits & AGE) + u32(share * f32(AGE)), AGE);
        let estimate = doubted(load_estimate(cloud_mean[slot], cloud_record[slot]), share, MOST_AT_REST);
        cloud_mean[slot] = stored_mean(estimate);
        cloud_record[slot] = stored_record(estimate);
    }
#endif
    cloud_meta[slot] = bits;
}

#ifdef ACCUMULATE
// The share by which the light of a pixel's tile has changed; 0 beyond the image.
fn shift_at(pixel: u32) -> f32 {
    let at = vec2(pixel % frame.size.x, pixel / frame.size.x);
    if at.y >= frame.size.y {
        return 0.0;
    }
    let columns = (frame.size.x + TILE - 1u) / TILE;
    return shift[at.y / TILE * columns + at.x / TILE];
}
#endif

@compute @workgroup_size(64)
fn insert(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = linear_index(id, groups, 64u);
    if index >= arrayLength(&slots) || !takes(index) {
        return;
    }
    let slot = slots[index];
    let is_point = samples[index].hit == HIT_SURFACE;
#ifdef ACCUMULATE
    let estimate = estimate_with(index, slot);
    cloud_mean[slot] = stored_mean(estimate);
    cloud_record[slot] = stored_record(estimate);
    cloud_radiance[slot] = encode_radiance(estimate.mean);
#else
    cloud_radiance[slot] = encode_radiance(samples[index].radiance);
#endif
    // One that is spread over the pixel renews the point where it lies, which is where classes need it.
    if !is_spread(samples[index]) {
        cloud_position[slot] = vec4(samples[index].position, select(0.0, 1.0, is_point));
    }
    cloud_image_id[slot] = NOT_DRAWN;
    cloud_meta[slot] = LIVE | FRESH | (samples[index].body << BODY_SHIFT);
    dates[slot] = frame.index + 1u;
}

// Whether there is a sample and it has a slot.
fn takes(index: u32) -> bool {
    return samples[index].hit != HIT_NONE && slots[index] < arrayLength(&cloud_meta);
}

// Whether a sample was requested to renew a live point.
fn is_renewal(index: u32) -> bool {
    let point = samples[index].reuse;
    if point >= arrayLength(&cloud_meta) || (cloud_meta[point] & LIVE) == 0u {
        return false;
    }
    return samples[index].view == VIEW_NOW || (samples[index].view == VIEW_LATE && renews(index, point));
}

// Whether the point that a sample was requested to renew is live and had a different colour.
fn differs_from_shown(index: u32) -> bool {
    if !is_renewal(index) {
        return false;
    }
    let point = samples[index].reuse;
#ifdef ACCUMULATE
    return differs_from(load_estimate(cloud_mean[point], cloud_record[point]), single(index), params.threshold);
#else
    let before = luminance(decode_radiance(cloud_radiance[point]));
    // Compared with stored precision.
    let after = luminance(decode_radiance(encode_radiance(samples[index].radiance)));
    return abs(tone_mapped_luma(after) - tone_mapped_luma(before)) > params.threshold;
#endif
}

#ifdef ACCUMULATE
// The estimate of a sample alone. It was seen from the eye of the frame before, which requested it.
fn single(index: u32) -> Estimate {
    let eye = frame.previous.eye;
    return single_estimate(
        samples[index].radiance,
        samples[index].variance,
        samples[index].sharpness,
        towards_eye(samples[index].position, eye),
    );
}

// The estimate of the point in a slot with a sample that takes the slot.
fn estimate_with(index: u32, slot: u32) -> Estimate {
    let alone = single(index);
    if samples[index].reuse != slot || !renews(index, slot) {
        return alone;
    }
    let before = load_estimate(cloud_mean[slot], cloud_record[slot]);
    let change = bounded(vec3(alone.sharpness * distance(before.towards_eye, alone.towards_eye))).x;
    let most = select(params.most, MOST_AT_REST, same_view(frame.view, frame.previous));
    return joined(doubted(before, change, most), alone);
}
#endif

// Whether a sample was taken on the surface of the point that it was requested to renew.
fn renews(index: u32, slot: u32) -> bool {
    return is_on_surface_of(samples[index], cloud_meta[slot], cloud_position[slot]);
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
