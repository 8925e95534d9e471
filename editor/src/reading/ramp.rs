//! A ramp of colours for amounts: lightness rises evenly, so that equal steps look equal and it reads in grey too.

use std::{f32::consts::TAU, sync::OnceLock};

use super::{byte, encode};

/// Lightness in OKLab at either end.
const LIGHTNESS: [f32; 2] = [0.22, 0.95];
/// Hue in turns at either end: from violet by blue and green to yellow.
const HUE: [f32; 2] = [0.82, 0.29];
/// Chroma; what sRGB cannot show of it is cut off.
const CHROMA: f32 = 0.14;

/// The colour at a share from 0 to 1.
pub fn ramp(share: f32) -> [u8; 3] {
    static TABLE: OnceLock<[[u8; 3]; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|index| color(index as f32 / 255.0)))[usize::from(byte(share))]
}

fn color(share: f32) -> [u8; 3] {
    let mix = |[from, to]: [f32; 2]| from + share * (to - from);
    let (lightness, hue) = (mix(LIGHTNESS), mix(HUE) * TAU);
    oklab(lightness, CHROMA * hue.cos(), CHROMA * hue.sin()).map(|linear| byte(encode(linear)))
}

/// OKLab to linear Rec. 709 (Ottosson 2020).
fn oklab(lightness: f32, a: f32, b: f32) -> [f32; 3] {
    let l = (lightness + 0.396_337_78 * a + 0.215_803_76 * b).powi(3);
    let m = (lightness - 0.105_561_346 * a - 0.063_854_17 * b).powi(3);
    let s = (lightness - 0.089_484_18 * a - 1.291_485_5 * b).powi(3);
    [
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_38 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    ]
}
