//! Albedos of textured surfaces, by which colours are divided before they are averaged (`algorithms.md` section 12.3). Codes
//! have 24 bits: 255 times the root of each channel, red in the low ones. Mirrored by `shaders/shared/albedo.wgsl`.

use epigraph_core::constants;
use fearless_simd::{Simd, f32x8, i32x8, prelude::*, u32x8};
use glam::Vec3;

constants! {
    /// The code of an albedo of 1: that of surfaces whose albedo is the same everywhere.
    pub const PLAIN: u32 = 0xFF_FFFF;
    /// The code of an albedo that nobody knows. It counts as 1.
    pub const NO_ALBEDO: u32 = 0;
    /// The largest code of a channel, and its inverse.
    const MOST_CODE: f32 = 255.0;
    const CODE_STEP: f32 = 1.0 / 255.0;
    /// What is less counts as this much, since colours are divided by it.
    const FAINTEST: f32 = 0.05;
    /// The largest number of a channel of a mean, and its inverse. Means need more bits than samples: each step is a small
    /// part of a difference.
    const MOST_MEAN: f32 = 65535.0;
    const MEAN_STEP: f32 = 1.0 / 65535.0;
}

/// The least of the brightest channel of what [`divisible`] returns.
const DARKEST: f32 = 0.2;

/// The albedo by which a colour is divided for a surface of this albedo. It is not too dark: light that a surface does not
/// tint, such as a highlight's, is divided at one point and multiplied at another, and grows by no more than the inverse. It
/// keeps the hue.
pub fn divisible(albedo: Vec3) -> Vec3 {
    let brightest = albedo.max_element();
    let scale = if brightest > 0.0 { (DARKEST / brightest).max(1.0) } else { 1.0 };
    (albedo * scale).clamp(Vec3::splat(FAINTEST), Vec3::ONE)
}

/// The code of an albedo from 0 to 1.
pub fn encode_albedo(albedo: Vec3) -> u32 {
    let [r, g, b] = albedo.to_array().map(|share| (share.clamp(0.0, 1.0).sqrt() * MOST_CODE + 0.5) as u32);
    r | g << 8 | b << 16
}

/// The albedo of a code, at least `FAINTEST`.
pub fn decode_albedo(code: u32) -> [f32; 3] {
    let code = if code == NO_ALBEDO { PLAIN } else { code };
    [code & 255, code >> 8 & 255, code >> 16 & 255].map(|code| {
        let root = code as f32 * CODE_STEP;
        (root * root).max(FAINTEST)
    })
}

/// [`encode_albedo`] of eight pixels.
#[inline(always)]
pub fn code_of<S: Simd>(simd: S, [r, g, b]: [f32x8<S>; 3]) -> u32x8<S> {
    channel_code(simd, r) | channel_code(simd, g) << 8 | channel_code(simd, b) << 16
}

#[inline(always)]
fn channel_code<S: Simd>(simd: S, share: f32x8<S>) -> u32x8<S> {
    let share = share.max_precise(f32x8::splat(simd, 0.0)).min_precise(f32x8::splat(simd, 1.0));
    (share.sqrt() * MOST_CODE + 0.5).to_int::<i32x8<S>>().bitcast()
}

/// [`decode_albedo`] of eight pixels.
#[inline(always)]
pub fn albedo_of<S: Simd>(simd: S, code: u32x8<S>) -> [f32x8<S>; 3] {
    let is_unknown = code.simd_eq(u32x8::splat(simd, NO_ALBEDO));
    let code = is_unknown.select(u32x8::splat(simd, PLAIN), code);
    [channel_of(simd, code), channel_of(simd, code >> 8), channel_of(simd, code >> 16)]
}

#[inline(always)]
fn channel_of<S: Simd>(simd: S, code: u32x8<S>) -> f32x8<S> {
    let root = (code & 255).bitcast::<i32x8<S>>().to_float::<f32x8<S>>() * CODE_STEP;
    (root * root).max_precise(f32x8::splat(simd, FAINTEST))
}

/// The albedo of a point.
#[inline(always)]
pub fn unpack_mean([rg, b]: [u32; 2]) -> [f32; 3] {
    [(rg & 0xFFFF) as f32 * MEAN_STEP, (rg >> 16) as f32 * MEAN_STEP, b as f32 * MEAN_STEP]
}

/// What is stored of the albedo of a point, from 0 to 1: red and green have 16 bits of the first word each, blue of the second.
pub fn pack_mean(albedo: [f32; 3]) -> [u32; 2] {
    let [r, g, b] = albedo.map(|share| (share * MOST_MEAN + 0.5) as u32);
    [r | g << 16, b]
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;
    use crate::shared::{lanes::LANES, testing::Random};

    #[test]
    fn codes_are_a_255th_of_the_root_apart() {
        for code in 0..=255 {
            let share = (code as f32 / 255.0).powi(2);
            assert_eq!(encode_albedo(Vec3::splat(share)), code * 0x01_0101);
            let decoded = decode_albedo(code * 0x01_0101);
            let expected = if code == 0 { 1.0 } else { share.max(FAINTEST) };
            assert!(decoded.iter().all(|decoded| (decoded - expected).abs() < 2e-7), "{code}: {decoded:?}");
        }
        assert_eq!(encode_albedo(Vec3::new(1.0, 0.25, 0.0)), 128 << 8 | 255);
        // What lies outside counts as 0 and 1.
        assert_eq!(encode_albedo(Vec3::new(7.0, -1.0, f32::NAN)), 255);
    }

    #[test]
    fn an_albedo_of_1_is_exact() {
        assert_eq!(encode_albedo(Vec3::ONE), PLAIN);
        assert_eq!(decode_albedo(PLAIN), [1.0; 3]);
        assert_eq!(unpack_mean(pack_mean([1.0; 3])), [1.0; 3]);
    }

    #[test]
    fn a_divisible_albedo_keeps_the_hue() {
        let bright = Vec3::new(0.9, 0.2, 0.06);
        assert_eq!(divisible(bright), bright);
        assert!(divisible(Vec3::new(0.1, 0.05, 0.03)).distance(Vec3::new(0.2, 0.1, 0.06)) < 1e-7);
        assert_eq!(divisible(Vec3::new(0.8, 0.0, 1.3)), Vec3::new(0.8, FAINTEST, 1.0));
        assert_eq!(divisible(Vec3::ZERO), Vec3::splat(FAINTEST));
    }

    #[test]
    fn lanes_have_the_same_codes() {
        let mut random = Random(3);
        for level in [Level::new(), Level::baseline()] {
            for _ in 0..100 {
                let albedo = [0; 3].map(|_| [0; LANES].map(|_| random.between(-0.1, 1.2)));
                let codes: [u32; LANES] = std::array::from_fn(|lane| {
                    if random.below(9) == 0 {
                        NO_ALBEDO
                    } else {
                        encode_albedo(albedo.map(|channel| channel[lane]).into())
                    }
                });
                let got = dispatch!(level, simd => {
                    let albedo = albedo.map(|channel| f32x8::load_array(simd, channel));
                    let decoded = albedo_of(simd, u32x8::load_array(simd, codes));
                    (code_of(simd, albedo).to_array(), decoded.map(|channel| channel.to_array()))
                });
                for lane in 0..LANES {
                    assert!(codes[lane] == NO_ALBEDO || got.0[lane] == codes[lane]);
                    assert_eq!(got.1.map(|channel| channel[lane]), decode_albedo(codes[lane]));
                }
            }
        }
    }
}
