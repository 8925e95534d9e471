// Products of two u32 and their quotients, exactly: the 64 bits that a portable shader lacks.

struct Wide {
    high: u32,
    low: u32,
}

fn wide_multiply(a: u32, b: u32) -> Wide {
    let a0 = a & 0xFFFFu;
    let a1 = a >> 16u;
    let b0 = b & 0xFFFFu;
    let b1 = b >> 16u;
    let middle = a1 * b0 + ((a0 * b0) >> 16u);
    let carried = a0 * b1 + (middle & 0xFFFFu);
    return Wide(a1 * b1 + (middle >> 16u) + (carried >> 16u), a * b);
}

fn wide_add(a: Wide, b: u32) -> Wide {
    let low = a.low + b;
    return Wide(a.high + select(0u, 1u, low < b), low);
}

fn wide_subtract(a: Wide, b: Wide) -> Wide {
    return Wide(a.high - b.high - select(0u, 1u, a.low < b.low), a.low - b.low);
}

// floor(a / b) if that is below 2^32 and b is not 0. Each iteration subtracts a multiple of b computed in f32, reduced
// so that rounding cannot make it too large; three iterations leave a remainder of a few b.
fn wide_divide(a: Wide, b: u32) -> u32 {
    var quotient = 0u;
    var rest = a;
    for (var turn = 0; turn < 3; turn++) {
        let estimate = (f32(rest.high) * 4294967296.0 + f32(rest.low)) / f32(b);
        let part = u32(estimate * 0.999999);
        quotient += part;
        rest = wide_subtract(rest, wide_multiply(part, b));
    }
    while rest.high != 0u || rest.low >= b {
        quotient += 1u;
        rest = wide_subtract(rest, Wide(0u, b));
    }
    return quotient;
}
