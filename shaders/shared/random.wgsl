// Random bits. Mirrors `stages/src/shared/random.rs`.

// 32 bits that look random and depend on all bits of `value` (PCG-RXS-M-XS).
fn pcg(value: u32) -> u32 {
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}
