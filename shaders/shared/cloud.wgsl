// The point cloud: bits of cloud_meta and the codec of cloud_radiance. Mirrors `stages/src/shared/cloud.rs`, which
// declares the constants AGE, AGE_ONE, LIVE, CHANGED, FRESH, BODY_SHIFT, NO_POINT, NOT_DRAWN and MAX_RADIANCE.

// Linear radiance as RGB9E5: three 9-bit mantissas from the low bits up, one 5-bit exponent, bias 15.
fn encode_radiance(color: vec3<f32>) -> u32 {
    let c = bounded(color);
    let largest = max(max(c.r, c.g), c.b);
    // The exponent as f32 stores it, less its bias: floor(log2(largest)) without rounding.
    let floor_log2 = i32(bitcast<u32>(largest) >> 23u) - 127;
    var exponent = max(floor_log2, -16) + 16;
    if floor(largest * power_of_two(24 - exponent) + 0.5) == 512.0 {
        exponent += 1;
    }
    let mantissa = vec3<u32>(floor(c * power_of_two(24 - exponent) + 0.5));
    return mantissa.r | (mantissa.g << 9u) | (mantissa.b << 18u) | (u32(exponent) << 27u);
}

// Linear radiance from 0 to MAX_RADIANCE; negative numbers and NaN become 0.
fn bounded(color: vec3<f32>) -> vec3<f32> {
    // Bit patterns of positive floats are ordered like the floats; those above infinity are NaN or negative.
    // A shader compiler may assume that neither exists, so test the bits.
    let bits = bitcast<vec3<u32>>(color);
    let most = min(bits, vec3(bitcast<u32>(MAX_RADIANCE)));
    return bitcast<vec3<f32>>(select(most, vec3(0u), bits > vec3(0x7F800000u)));
}

// The linear radiance of encode_radiance.
fn decode_radiance(bits: u32) -> vec3<f32> {
    let scale = power_of_two(i32(bits >> 27u) - 24);
    return vec3<f32>((vec3(bits) >> vec3(0u, 9u, 18u)) & vec3(511u)) * scale;
}

// 2^n for n from -126 to 127, exactly.
fn power_of_two(n: i32) -> f32 {
    return bitcast<f32>(u32(n + 127) << 23u);
}
