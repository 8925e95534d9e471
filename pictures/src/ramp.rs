//! Colour ramps for quantities. Lightness changes evenly along each, so that equal steps look equal, in greyscale too.

use std::{f32::consts::TAU, sync::OnceLock};

use crate::tone;

/// A ramp of colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Ramp {
    /// From violet through blue and green to yellow.
    #[default]
    Spectrum,
    /// From black through purple and orange to pale yellow.
    Magma,
    /// From black through blue to white: a single hue, for viewers who distinguish few.
    Ice,
    /// From blue through dark grey to red: for values about a midpoint, such as signed ones.
    Diverging,
}

impl Ramp {
    /// All ramps, with their labels.
    pub const ALL: [(Self, &str); 4] = [
        (Self::Spectrum, "Spectrum"),
        (Self::Magma, "Magma"),
        (Self::Ice, "Ice"),
        (Self::Diverging, "Diverging"),
    ];

    /// The label shown to users.
    pub fn label(self) -> &'static str {
        Self::ALL.iter().find(|(ramp, _)| *ramp == self).map_or("", |(_, label)| label)
    }

    /// The sRGB colour at a share from 0 to 1.
    pub fn color(self, share: f32) -> [u8; 3] {
        type Table = OnceLock<[[u8; 3]; 256]>;
        static TABLES: [Table; 3] = [const { Table::new() }; 3];
        let (table, color): (_, fn(f32) -> [u8; 3]) = match self {
            Self::Spectrum => (0, |share| lch(0.22 + 0.73 * share, 0.14, 0.82 - 0.53 * share)),
            Self::Magma => return magma(share),
            // Chroma is least at the ends, where the sRGB gamut is narrowest.
            Self::Ice => (1, |share| lch(share, 0.42 * share * (1.0 - share), 0.69 - 0.14 * share)),
            Self::Diverging => (2, |share| {
                let away = (2.0 * share - 1.0).abs();
                lch(0.25 + 0.6 * away, 0.15 * away, if share < 0.5 { 0.69 } else { 0.08 })
            }),
        };
        let table = TABLES[table].get_or_init(|| std::array::from_fn(|step| color(step as f32 / 255.0)));
        table[usize::from(tone::to_byte(share))]
    }
}

/// A colour by its lightness, chroma and hue (in turns) in OKLab (Ottosson 2020; from linear Rec. 709), as sRGB,
/// clamped to the gamut.
fn lch(lightness: f32, chroma: f32, hue: f32) -> [u8; 3] {
    let (a, b) = (chroma * (hue * TAU).cos(), chroma * (hue * TAU).sin());
    let l = (lightness + 0.396_337_78 * a + 0.215_803_76 * b).powi(3);
    let m = (lightness - 0.105_561_346 * a - 0.063_854_17 * b).powi(3);
    let s = (lightness - 0.089_484_18 * a - 1.291_485_5 * b).powi(3);
    tone::to_srgb8([
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_38 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    ])
}

/// Colours of the magma map at equal steps from 0 to 1; between them it is nearly straight.
const MAGMA: [[u8; 3]; 17] = [
    [0, 0, 4],
    [10, 8, 34],
    [29, 17, 71],
    [54, 16, 107],
    [81, 18, 124],
    [106, 28, 129],
    [131, 38, 129],
    [156, 46, 127],
    [183, 55, 121],
    [207, 64, 112],
    [229, 80, 100],
    [244, 105, 92],
    [251, 135, 97],
    [254, 165, 113],
    [254, 194, 135],
    [253, 224, 161],
    [252, 253, 191],
];

fn magma(share: f32) -> [u8; 3] {
    let at = share.clamp(0.0, 1.0) * (MAGMA.len() - 1) as f32;
    let low = (at as usize).min(MAGMA.len() - 2);
    let mix = |i: usize| {
        let (from, to) = (f32::from(MAGMA[low][i]), f32::from(MAGMA[low + 1][i]));
        (from + (to - from) * (at - low as f32) + 0.5) as u8
    };
    [0, 1, 2].map(mix)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luma([r, g, b]: [u8; 3]) -> f32 {
        0.21 * f32::from(r) + 0.72 * f32::from(g) + 0.07 * f32::from(b)
    }

    #[test]
    fn ramps_get_lighter_all_the_way() {
        for ramp in [Ramp::Spectrum, Ramp::Magma, Ramp::Ice] {
            let shades: Vec<f32> = (0..=16).map(|step| luma(ramp.color(step as f32 / 16.0))).collect();
            assert!(shades.windows(2).all(|pair| pair[0] < pair[1]), "{ramp:?} {shades:?}");
        }
    }

    #[test]
    fn the_diverging_ramp_is_dark_in_the_middle_with_a_hue_on_either_side() {
        let [low, middle, high] = [0.0, 0.5, 1.0].map(|share| Ramp::Diverging.color(share));
        assert!(luma(low) > 2.0 * luma(middle) && luma(high) > 2.0 * luma(middle));
        assert!(low[2] > low[0] + 80 && high[0] > high[2] + 80, "{low:?} {high:?}");
    }

    #[test]
    fn magma_is_magma() {
        let lut = nv_flip::magma_lut().to_vec();
        for (step, theirs) in (0..=255u8).zip(lut.chunks_exact(3)) {
            let ours = Ramp::Magma.color(f32::from(step) / 255.0);
            let far = ours.iter().zip(theirs).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(far <= Some(4), "{ours:?} {theirs:?}");
        }
    }
}
