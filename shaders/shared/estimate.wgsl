// What is known of the radiance of a point that was sampled several times. Mirrors `stages/src/shared/estimate.rs`, which
// declares the constants MOST_AT_REST, SURPRISE, SHOCK, FLATNESS, LEAST, DARK and NOTHING. Import cloud, color, octahedral and requests too.

struct Estimate {
    // Mean linear radiance.
    mean: vec3<f32>,
    // Variance of the luminance of one sample, or UNKNOWN.
    variance: f32,
    // The number of samples that the mean counts for.
    count: f32,
    // Unit direction to the eye that saw the last one.
    towards_eye: vec3<f32>,
    // The share by which the radiance may change per radian of this direction.
    sharpness: f32,
    // Whether the last one was a surprise: noise hardly explains its difference from the mean.
    is_suspect: bool,
}

// From the two values that the cloud stores of a point.
fn load_estimate(mean: vec4<f32>, record: vec4<f32>) -> Estimate {
    let count = abs(record.w);
    let variance = select(mean.w * count, UNKNOWN, mean.w < 0.0);
    // A point at the eye has no direction.
    let length = length(record.xyz);
    let towards_eye = select(vec3(0.0), record.xyz / length, length > 0.0);
    return Estimate(mean.rgb, variance, count, towards_eye, max(length - 1.0, 0.0), record.w < 0.0);
}

// The first of these values: the mean, and the variance of its luminance.
fn stored_mean(e: Estimate) -> vec4<f32> {
    return vec4(e.mean, select(e.variance / e.count, UNKNOWN, e.variance < 0.0));
}

// The second: the direction to the eye, of length 1 + sharpness, and the count, negative after a surprise.
fn stored_record(e: Estimate) -> vec4<f32> {
    return vec4(e.towards_eye * (1.0 + e.sharpness), select(e.count, -e.count, e.is_suspect));
}

// That of a single sample.
fn single_estimate(radiance: vec3<f32>, variance: f32, sharpness: f32, towards_eye: vec3<f32>) -> Estimate {
    // Whatever a source says of its samples, this is a number.
    let bounded_sharpness = bounded(vec3(sharpness)).x;
    return Estimate(bounded(radiance), known_variance(variance), 1.0, towards_eye, bounded_sharpness, false);
}

// The variance of a luminance as a display shows it, roughly: relative to the luminance.
fn shown_variance(luminance: f32, variance: f32) -> f32 {
    return variance / (luminance + DARK);
}

// The shown variance of a point, of which these are stored, for an eye in a unit direction.
fn shown_variance_of(mean: vec4<f32>, record: vec4<f32>, towards_eye: vec3<f32>) -> f32 {
    let luminance = luminance(mean.rgb);
    // A single light path is as uncertain as it is bright.
    let of_mean = select(mean.w, luminance * luminance, mean.w < 0.0);
    let e = load_estimate(mean, record);
    let change = luminance * e.sharpness * distance(e.towards_eye, towards_eye);
    return shown_variance(luminance, of_mean + change * change);
}

// After something that may have changed the radiance by this share of itself.
fn doubted(e: Estimate, relative: f32, most: f32) -> Estimate {
    let change = relative * luminance(e.mean);
    var left = e;
    left.count = min(e.count, most);
    if change != 0.0 && e.variance >= 0.0 {
        let uncertain = e.variance + left.count * change * change;
        left.count = select(NOTHING, max(left.count * e.variance / uncertain, NOTHING), uncertain > 0.0);
    }
    return left;
}

// Whether a single sample tells that the colour has changed.
fn differs_from(e: Estimate, single: Estimate, threshold: f32) -> bool {
    let before = luminance(e.mean);
    let after = luminance(single.mean);
    let is_seen = abs(tone_mapped_luma(after) - tone_mapped_luma(before)) > threshold;
    return is_seen && surprise(e, single) > SURPRISE * SURPRISE;
}

// The difference of luminance of a single sample from the mean, and its variance if the radiance rests; 0 if that is not
// known.
fn difference_from(e: Estimate, single: Estimate) -> vec2<f32> {
    if e.variance < 0.0 {
        return vec2(0.0);
    }
    let difference = luminance(single.mean) - luminance(e.mean);
    return vec2(difference, e.variance / e.count + noise_of_one(e, single));
}

// The squared difference of a single sample from the mean, in variances; 0 if none is known.
fn surprise(e: Estimate, single: Estimate) -> f32 {
    let found = difference_from(e, single);
    return found.x * found.x / max(found.y, 1.17549435e-38);
}

// The variance of a single sample. A few light paths may look more alike than they are.
fn noise_of_one(e: Estimate, single: Estimate) -> f32 {
    return max(e.variance, single.variance);
}

// After one more sample.
fn joined(e: Estimate, single: Estimate) -> Estimate {
    let surprise = surprise(e, single);
    let is_suspect = surprise > SURPRISE * SURPRISE;
    let difference = luminance(single.mean) - luminance(e.mean);
    // A single light path that carries much more than others is rare, but not wrong.
    let is_lucky = single.variance < 0.0 && difference > 0.0;
    let is_shock = surprise > SHOCK * SHOCK && !is_lucky;
    var before = e.count;
    if is_shock || (is_suspect && e.is_suspect) {
        // As many as would explain the difference: it is SURPRISE deviations.
        let variance = difference * difference / (SURPRISE * SURPRISE) - noise_of_one(e, single);
        before = min(e.variance / variance, before);
        before = select(before, max(before, 1.0), is_lucky);
    }
    if before < LEAST {
        return single;
    }
    let count = before + 1.0;
    // The expected square of the difference is the variance of one sample times count / before.
    let own = select(single.variance, difference * difference * before / count, single.variance < 0.0);
    let variance = select(e.variance + (own - e.variance) / count, own, e.variance < 0.0);
    let mean = e.mean + (single.mean - e.mean) / count;
    return Estimate(mean, variance, count, single.towards_eye, single.sharpness, is_suspect);
}

// The variance that a sample states of itself, bounded; UNKNOWN if it is not a number.
fn known_variance(variance: f32) -> f32 {
    let bits = bitcast<u32>(variance);
    let known = bitcast<f32>(min(bits, bitcast<u32>(MAX_RADIANCE * MAX_RADIANCE)));
    return select(known, UNKNOWN, bits > 0x7F800000u);
}

// The unit direction from a point to the eye.
fn towards_eye(position: vec3<f32>, eye: vec3<f32>) -> vec3<f32> {
    let towards = eye - position;
    let distance = length(towards);
    return select(vec3(0.0), towards / distance, distance > 0.0);
}

// Whether the eye sees a point and a sample at the same place of the image. `pixel` is the width of a pixel at a distance of 1.
fn in_line(point: vec3<f32>, position: vec3<f32>, eye: vec3<f32>, pixel: f32) -> bool {
    let away = position - eye;
    return length(cross(point - position, away)) <= NEARNESS * pixel * dot(away, away);
}

// Whether a point lies on the surface on which a sample was taken. `pixel` is the width of a pixel at a distance of 1.
fn on_surface(point: vec3<f32>, position: vec3<f32>, normal: u32, eye: vec3<f32>, pixel: f32) -> bool {
    let direction = decode_oct16(normal);
    let plane = select(vec3(0.0), normalize(direction), any(direction != vec3(0.0)));
    return abs(dot(point - position, plane)) <= FLATNESS * pixel * distance(position, eye);
}
