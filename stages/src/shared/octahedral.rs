//! Unit vectors on an unfolded octahedron. Mirrored by `shaders/shared/octahedral.wgsl`.

epigraph_core::constants! {
    /// The code of a zero normal in [`encode_oct16`]: -32768 twice, which no unit vector maps to.
    pub const NO_NORMAL: u32 = 0x8000_8000;
}

/// A unit vector, or zero, mapped to an unfolded octahedron: x in the low 16 bits and y in the high ones, each from
/// -32767 to 32767. The error is less than 7e-5 radians.
pub fn encode_oct16([x, y, z]: [f32; 3]) -> u32 {
    let sum = x.abs() + y.abs() + z.abs();
    if sum == 0.0 {
        return NO_NORMAL;
    }
    let [x, y] = [x / sum, y / sum];
    // The lower half is folded over the edges of the upper one.
    let fold = |a: f32, b: f32| (1.0 - b.abs()).copysign(a);
    let [x, y] = if z < 0.0 { [fold(x, y), fold(y, x)] } else { [x, y] };
    let bits = |value: f32| (value * 32767.0).round() as i16 as u16;
    u32::from(bits(x)) | u32::from(bits(y)) << 16
}

/// The inverse of [`encode_oct16`], not normalized: silhouettes need only its sign.
pub fn decode_oct16(bits: u32) -> [f32; 3] {
    if bits == NO_NORMAL {
        return [0.0; 3];
    }
    let [x, y] = [bits as u16 as i16, (bits >> 16) as u16 as i16].map(|value| f32::from(value) / 32767.0);
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let unfold = |a: f32| if a < 0.0 { a + fold } else { a - fold };
    [unfold(x), unfold(y), z]
}
