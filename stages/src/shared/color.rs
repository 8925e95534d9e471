//! Luminance and the encoding of colours. Mirrored by `shaders/shared/color.wgsl`.

use fearless_simd::{Simd, f32x8, prelude::*};

/// How much red, green and blue count in the luminance.
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Relative luminance of a linear Rec. 709 colour.
#[inline]
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    LUMINANCE[0] * r + LUMINANCE[1] * g + LUMINANCE[2] * b
}

/// [`luminance`] of eight colours.
#[inline(always)]
pub fn luminances<S: Simd>(simd: S, [r, g, b]: [f32x8<S>; 3]) -> f32x8<S> {
    let [of_r, of_g, of_b] = LUMINANCE.map(|share| f32x8::splat(simd, share));
    of_r * r + of_g * g + of_b * b
}

/// Luminance Y as Y / (1 + Y): from 0 to 1, and never steeper than Y.
pub fn tone_mapped_luma(luminance: f32) -> f32 {
    luminance / (1.0 + luminance)
}

/// The linear value of an sRGB code between 0 and 1 (IEC 61966-2-1).
pub fn decode_srgb(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}
