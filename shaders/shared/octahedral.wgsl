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
