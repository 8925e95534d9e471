//! The last step: from linear radiance to the bytes that a screen shows.

use epigraph_core::{CpuContext, Extent, Finding, In, Io, Out, Site, Stage, choice, params, texel};
use rayon::prelude::*;

use crate::{
    meaning::{PICTURE, RADIANCE},
    shared::color::{decode_srgb, luminance},
};

#[path = "explain/tonemap.rs"]
mod explain;

/// The colour of NaN: conspicuous, so that it is found.
const MAGENTA: [u8; 3] = [255, 0, 255];

choice! {
    /// How radiance is mapped to the range of a screen.
    pub enum Curve {
        /// Clamped to 1.
        Clamp,
        /// Divided by 1 + luminance, then clamped (Reinhard et al. 2002).
        Reinhard,
    }
}

params! {
    /// Parameters of [`Tonemap`].
    pub struct TonemapParams {
        /// Each step doubles the brightness.
        exposure: f32 = 0.0, in -24.0..=24.0, unit "EV";
        /// How radiance is mapped to the range of a screen.
        curve: Curve = Curve::Clamp;
    }
}

/// Linear Rec. 709 radiance to sRGB bytes. NaN becomes magenta and infinity white.
pub struct Tonemap {
    color: In<texel::Rgba32Float>,
    image: Out<texel::Rgba8Unorm>,
    srgb: Srgb,
}

impl Stage for Tonemap {
    const KIND: &'static str = "tonemap";
    const DOC: &'static str =
        "Exposure, a curve, and the sRGB encoding: from linear radiance to the picture.";
    type Params = TonemapParams;

    fn declare(_: &TonemapParams, io: &mut Io) -> Self {
        let color = io.read("color", RADIANCE, Extent::Frame(1));
        let image = io.write("image", PICTURE, Extent::Frame(1));
        io.shader(shader!("tonemap"));
        io.dispatch("tonemap", image);
        Self { color, image, srgb: Srgb::new() }
    }

    fn cpu(&self, params: &TonemapParams, cx: &CpuContext) -> Result<(), String> {
        let width = cx.dims(self.image).width as usize;
        let (color, image) = (cx.read(self.color), &mut cx.write(self.image)[..]);
        let gain = params.exposure.exp2();
        image.par_chunks_mut(width).zip(color.par_chunks(width)).for_each(|(image, color)| {
            for (image, &[r, g, b, _]) in image.iter_mut().zip(color) {
                let [r, g, b] = self.srgb.show(params.curve, [r * gain, g * gain, b * gain]);
                *image = [r, g, b, 255];
            }
        });
        Ok(())
    }

    fn explain(&self, params: &TonemapParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// The sRGB encoding as a search: the same bytes as the rounded formula, without its power.
struct Srgb {
    /// Where each byte ends: the smallest value of the next one, infinity for the last.
    end: [f32; 256],
    /// The byte of the smallest value with given upper bits, from those of [`Srgb::FIRST`] to those of 1.
    start: Vec<u8>,
}

impl Srgb {
    /// Below this every value is byte 0.
    const FIRST: f32 = 1.0 / 8192.0;
    /// Bits of a value that the table leaves to the search.
    const SHIFT: u32 = 16;

    fn new() -> Self {
        let end = std::array::from_fn(|byte| match byte {
            255 => f32::INFINITY,
            byte => decode_srgb((byte as f64 + 0.5) / 255.0) as f32,
        });
        let table = Self::FIRST.to_bits() >> Self::SHIFT..=1f32.to_bits() >> Self::SHIFT;
        let byte_of = |bits: u32| {
            let value = f32::from_bits(bits << Self::SHIFT);
            end.partition_point(|&end| end <= value) as u8
        };
        Self { end, start: table.map(byte_of).collect() }
    }

    #[inline(always)]
    fn encode(&self, value: f32) -> u8 {
        let value = value.clamp(Self::FIRST, 1.0);
        let byte = self.start[((value.to_bits() - Self::FIRST.to_bits()) >> Self::SHIFT) as usize];
        // Values with the same upper bits differ by a factor of at most 1/128, and codes by 0.87: one step is enough.
        byte + u8::from(value >= self.end[usize::from(byte)])
    }

    #[inline(always)]
    fn show(&self, curve: Curve, color: [f32; 3]) -> [u8; 3] {
        if color.iter().any(|channel| channel.is_nan()) {
            return MAGENTA;
        }
        if color.contains(&f32::INFINITY) {
            return [255; 3];
        }
        let [r, g, b] = match curve {
            Curve::Clamp => color,
            Curve::Reinhard => {
                let scale = 1.0 / (1.0 + luminance(color).max(0.0));
                color.map(|channel| channel * scale)
            }
        };
        [self.encode(r), self.encode(g), self.encode(b)]
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::testing::{Random, run_alike, run_both, settings};

    fn harness(params: TonemapParams, colors: &[[f32; 3]]) -> Harness<Tonemap> {
        let mut harness = Harness::new(params, &settings([colors.len() as u32, 1], 0));
        let texels: Vec<[f32; 4]> = colors.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
        harness.set("color", &texels);
        harness
    }

    fn shown(params: TonemapParams, colors: &[[f32; 3]]) -> Vec<[u8; 4]> {
        run_alike(&mut harness(params, colors)).get("image")
    }

    #[test]
    fn the_search_equals_the_rounded_formula() {
        let srgb = Srgb::new();
        for step in 0..=200_000 {
            let value = step as f32 / 200_000.0 * 1.02;
            let linear = f64::from(value).min(1.0);
            let code =
                if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
            // A value whose code is within a rounding error of a half may round either way.
            let code = 255.0 * code;
            let byte = srgb.encode(value);
            assert!((f64::from(byte) - code).abs() < 0.5 + 1e-4, "{value}: {byte} for {code}");
        }
    }

    #[test]
    fn by_hand() {
        let image = shown(TonemapParams::default(), &[[0.0, 1.0, 0.5], [-1.0, 2.0, 0.0031308]]);
        // 1.055 * 0.5^(1 / 2.4) - 0.055 = 0.7354 = 187.5 / 255; 12.92 * 0.0031308 = 0.04045 = 10.3 / 255.
        assert_eq!(image, [[0, 255, 188, 255], [0, 255, 10, 255]]);
    }

    #[test]
    fn exposure_doubles() {
        let brighter =
            shown(TonemapParams { exposure: 2.0, ..TonemapParams::default() }, &[[0.1, 0.2, 0.02]]);
        assert_eq!(brighter, shown(TonemapParams::default(), &[[0.4, 0.8, 0.08]]));
    }

    #[test]
    fn reinhard_halves_one() {
        let params = || TonemapParams { curve: Curve::Reinhard, ..TonemapParams::default() };
        assert_eq!(shown(params(), &[[1.0; 3]]), shown(TonemapParams::default(), &[[0.5; 3]]));
        // The curve never reaches white.
        assert!(shown(params(), &[[100.0; 3]])[0][0] < 255);
    }

    #[test]
    fn nan_is_magenta_and_infinity_is_white() {
        let colors = [[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [f32::NEG_INFINITY, 0.5, 0.0]];
        for curve in [Curve::Clamp, Curve::Reinhard] {
            let mut harness = harness(TonemapParams { curve, ..TonemapParams::default() }, &colors[..2]);
            let both = run_both(&mut harness);
            for out in [both.cpu, both.gpu] {
                assert_eq!(out.get::<[u8; 4]>("image"), [[255, 0, 255, 255], [255; 4]]);
            }
        }
        assert_eq!(shown(TonemapParams::default(), &colors[2..]), [[0, 188, 0, 255]]);
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(2);
        let colors: Vec<[f32; 3]> = (0..4000).map(|_| [0; 3].map(|_| random.between(-0.1, 1.2))).collect();
        for curve in [Curve::Clamp, Curve::Reinhard] {
            let mut harness = harness(TonemapParams { curve, exposure: 0.3 }, &colors);
            let both = run_both(&mut harness);
            let (cpu, gpu) = (both.cpu.get::<u8>("image"), both.gpu.get::<u8>("image"));
            let apart: Vec<u8> = cpu.iter().zip(gpu).map(|(cpu, gpu)| cpu.abs_diff(gpu)).collect();
            // The shader's power function is approximate: a code close to a half may round the other way.
            assert!(apart.iter().all(|&apart| apart <= 1));
            let rounded = apart.iter().filter(|&&apart| apart == 1).count();
            assert!(rounded <= 16, "{rounded} bytes differ by 1");
        }
    }
}
