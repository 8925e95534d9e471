//! Random bits. Mirrored by `shaders/shared/random.wgsl`.

/// 32 bits that look random and depend on all bits of `value`: the PCG output function RXS-M-XS (O'Neill 2014).
pub fn pcg(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}
