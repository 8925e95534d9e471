// Unit vectors on an unfolded octahedron. Mirrors `stages/src/shared/octahedral.rs`, which declares NO_NORMAL.

// The vector of two signed 16-bit integers, x in the low bits; not normalized.
fn decode_oct16(bits: u32) -> vec3<f32> {
    if bits == NO_NORMAL {
        return vec3(0.0);
    }
    let at = vec2(f32(bitcast<i32>(bits << 16u) >> 16u), f32(bitcast<i32>(bits) >> 16u)) / 32767.0;
    let z = 1.0 - abs(at.x) - abs(at.y);
    let fold = max(-z, 0.0);
    return vec3(at + select(vec2(-fold), vec2(fold), at < vec2(0.0)), z);
}

// The code of a unit vector, or of zero; the error is less than 7e-5 radians.
fn encode_oct16(normal: vec3<f32>) -> u32 {
    let sum = abs(normal.x) + abs(normal.y) + abs(normal.z);
    if sum == 0.0 {
        return NO_NORMAL;
    }
    var at = normal.xy / sum;
    if normal.z < 0.0 {
        // The lower half is folded outwards, over the edges of the upper half.
        let folded = 1.0 - abs(at.yx);
        at = select(folded, -folded, at < vec2(0.0));
    }
    let scaled = vec2<i32>(sign(at) * floor(abs(at) * 32767.0 + 0.5));
    return u32(scaled.x & 0xFFFF) | u32(scaled.y) << 16u;
}
