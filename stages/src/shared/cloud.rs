//! The point cloud: a structure of arrays with a fixed number of slots, some of which hold a live point. The bundle
//! port `cloud` carries it; a stage declares the fields that it uses. Mirrored by `shaders/shared/cloud.wgsl`.
//!
//! | field | element | holds |
//! |---|---|---|
//! | `position` | `vec4<f32>` | w = 1: a point, metres; w = 0: the unit direction of a ray that hit nothing |
//! | `radiance` | `u32` | RGB9E5, see [`encode_radiance`] |
//! | `image_id` | `u32` | index y * W + x of the pixel that last showed the point, or [`NOT_DRAWN`] |
//! | `meta` | `u32` | age, flags and body |
//! | `mean` | `vec4<f32>` | only if samples accumulate: the mean of the point's samples, and the variance of its luminance |
//! | `record` | `vec4<f32>` | likewise: direction to the eye that saw the last one, of length 1 + its sharpness, and the number of samples |
//!
//! The bits of `meta`: 0 to 15 are the age in 8.8 fixed point, then come [`LIVE`], [`CHANGED`] and [`FRESH`], and 24 to
//! 31 are the number of the body on which the point lies, or 0 if it lies on static geometry.

use fearless_simd::{Simd, f32x8, i32x8, prelude::*, u32x8};

epigraph_core::constants! {
    /// The bits of `meta` that hold the age.
    pub const AGE: u32 = 0xFFFF;
    /// One unit of age in the 8.8 fixed point of `meta`.
    pub const AGE_ONE: u32 = 256;
    /// Bit of `meta`: the slot holds a point. Zeroed memory is an empty cloud.
    pub const LIVE: u32 = 1 << 16;
    /// Bit of `meta`: a new sample near the point's pixel had another colour than the point that was shown there.
    pub const CHANGED: u32 = 1 << 17;
    /// Bit of `meta`: the point came into the cloud in this frame.
    pub const FRESH: u32 = 1 << 18;
    /// Where the number of the body begins in `meta`.
    pub const BODY_SHIFT: u32 = 24;
    /// The index of no point: the value of a pixel without a point, and the slot of a sample that finds no slot.
    pub const NO_POINT: u32 = u32::MAX;
    /// The `image_id` of a point that no pixel shows.
    pub const NOT_DRAWN: u32 = u32::MAX;
    /// Largest number in RGB9E5: 511/512 * 2^16.
    pub const MAX_RADIANCE: f32 = 65408.0;
}

/// Linear radiance as RGB9E5 (`EXT_texture_shared_exponent`): three 9-bit mantissas from the low bits up, one 5-bit
/// exponent, bias 15. The error of a channel is at most 1/512 of the largest channel. Negative numbers and NaN become
/// 0; numbers above [`MAX_RADIANCE`], and infinity, are clamped to it.
pub fn encode_radiance(color: [f32; 3]) -> u32 {
    let [r, g, b] = bounded(color);
    let largest = r.max(g).max(b);
    // The exponent as f32 stores it, less its bias: floor(log2(largest)) without rounding.
    let floor_log2 = (largest.to_bits() >> 23) as i32 - 127;
    let mut exponent = floor_log2.max(-16) + 16;
    if (largest * power_of_two(24 - exponent) + 0.5).floor() == 512.0 {
        exponent += 1;
    }
    let scale = power_of_two(24 - exponent);
    let mantissa = |channel: f32| (channel * scale + 0.5).floor() as u32;
    mantissa(r) | mantissa(g) << 9 | mantissa(b) << 18 | (exponent as u32) << 27
}

/// Linear radiance from 0 to [`MAX_RADIANCE`]; negative numbers and NaN become 0.
#[inline]
pub fn bounded(color: [f32; 3]) -> [f32; 3] {
    // Bit patterns of positive floats are ordered like the floats; those above infinity are NaN or negative. Shaders
    // may assume that neither exists, so both sides test the bits.
    color.map(|channel| {
        let bits = channel.to_bits();
        f32::from_bits(if bits > f32::INFINITY.to_bits() { 0 } else { bits.min(MAX_RADIANCE.to_bits()) })
    })
}

/// The linear radiance of [`encode_radiance`].
#[inline]
pub fn decode_radiance(bits: u32) -> [f32; 3] {
    let scale = power_of_two((bits >> 27) as i32 - 24);
    [bits & 511, bits >> 9 & 511, bits >> 18 & 511].map(|mantissa| mantissa as f32 * scale)
}

/// [`decode_radiance`] of eight points.
#[inline(always)]
pub fn radiance_of<S: Simd>(simd: S, bits: u32x8<S>) -> [f32x8<S>; 3] {
    let scale = f32x8::from_bits(((bits >> 27) + u32x8::splat(simd, 127 - 24)) << 23);
    [bits, bits >> 9, bits >> 18]
        .map(|bits| (bits & 511).bitcast::<i32x8<S>>().to_float::<f32x8<S>>() * scale)
}

/// Copies the values of the points `ids` from those of all points; any value if an id is not a point's. Cache misses
/// dominate, and a loop that does nothing else keeps many of them in flight at once.
#[inline(always)]
pub fn gather<T: Copy>(values: &[T], ids: &[u32], to: &mut [T]) {
    let last = values.len() - 1;
    to.iter_mut().zip(ids).for_each(|(to, &id)| *to = values[(id as usize).min(last)]);
}

/// 2^n for n from -126 to 127, exactly.
fn power_of_two(n: i32) -> f32 {
    f32::from_bits(((n + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_with_nine_bits_are_exact() {
        for color in [[0.0; 3], [1.0, 0.5, 0.25], [511.0, 1.0, 0.0], [MAX_RADIANCE; 3], [2f32.powi(-24); 3]] {
            assert_eq!(decode_radiance(encode_radiance(color)), color);
        }
        // By hand: 1 = 256 * 2^-8, so the mantissa is 256 and the exponent 16 (16 - 24 = -8).
        assert_eq!(encode_radiance([1.0, 0.0, 0.0]), 16 << 27 | 256);
    }

    #[test]
    fn the_error_is_half_a_step_of_the_largest_channel() {
        for exponent in -12..15 {
            for fraction in [1.0, 1.001, 1.3, 1.77, 1.998, 1.9999] {
                let color = [fraction, 0.37 * fraction, 0.003 * fraction].map(|c| c * 2f32.powi(exponent));
                let decoded = decode_radiance(encode_radiance(color));
                for (before, after) in color.into_iter().zip(decoded) {
                    assert!((before - after).abs() <= color[0] / 512.0, "{color:?} {decoded:?}");
                }
            }
        }
    }

    #[test]
    fn invalid_radiance_is_replaced() {
        let encoded = encode_radiance([f32::NAN, -1.0, 2.0]);
        assert_eq!(decode_radiance(encoded), [0.0, 0.0, 2.0]);
        let encoded = encode_radiance([f32::INFINITY, f32::NEG_INFINITY, f32::MAX]);
        assert_eq!(decode_radiance(encoded), [MAX_RADIANCE, 0.0, MAX_RADIANCE]);
        assert_eq!(encode_radiance([-0.0, f32::MIN_POSITIVE, 1e-40]), 0);
    }
}
