//! The last step: from linear radiance to the bytes that a screen shows (`algorithms.md` section 1.10). The exposure is a
//! number, or found from the picture.

use epigraph_core::{
    CpuContext, Extent, Finding, In, Io, Out, Site, Stage, Threads, choice, params, scratch, texel,
};
use fearless_simd::{Simd, dispatch, f32x8, prelude::*, u32x8};
use rayon::prelude::*;

use crate::{
    meaning::{PICTURE, RADIANCE, WHITE},
    shared::{
        color::{decode_srgb, luminance, luminances},
        lanes::{LANES, bits, load_transposed},
    },
};

mod auto;
#[path = "explain/tonemap.rs"]
mod explain;

/// Pixels that each GPU thread counts: few enough to keep all cores busy, many enough that the histograms of the
/// workgroups are cheap to add.
const PIXELS_PER_THREAD: u32 = 16;

/// Pixels per parallel task of the count: as many as a GPU's workgroup counts.
const CHUNK: usize = 256 * PIXELS_PER_THREAD as usize;

/// A histogram of some pixels.
type Bins = [u32; auto::BINS as usize];

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
        /// Each step doubles the brightness. Auto fits it to the picture: at once at the start, then slowly, so that
        /// it follows a moving camera without flicker.
        exposure: Option<f32> = Some(0.0), in -24.0..=24.0, unit "EV";
        /// How radiance is mapped to the range of a screen.
        curve: Curve = Curve::Clamp;
        /// With exposure Auto, the share of the pixels with light that are at most as bright as what is shown as 1.
        percentile: u32 = 90, in 1..=100, unit "%";
    }
}

/// Linear Rec. 709 radiance to sRGB bytes. NaN becomes magenta and infinity white.
pub struct Tonemap {
    color: In<texel::Rgba32Float>,
    image: Out<texel::Rgba8Unorm>,
    auto: Option<Auto>,
    srgb: Srgb,
}

/// What the exposure `Auto` adds to the stage.
struct Auto {
    histogram: Out<u32>,
    white: Out<f32>,
}

impl Stage for Tonemap {
    const KIND: &'static str = "tonemap";
    const DOC: &'static str =
        "Exposure, a curve, and the sRGB encoding: from linear radiance to the picture.";
    type Params = TonemapParams;

    fn declare(params: &TonemapParams, io: &mut Io) -> Self {
        let color = io.read("color", RADIANCE, Extent::Frame(1));
        let image = io.write("image", PICTURE, Extent::Frame(1));
        io.shader(shader!("tonemap"));
        let auto = params.exposure.is_none().then(|| Auto::declare(io, image));
        if auto.is_none() {
            io.per_view();
        }
        io.dispatch("tonemap", image);
        Self { color, image, auto, srgb: Srgb::new() }
    }

    fn cpu(&self, params: &TonemapParams, cx: &CpuContext) -> Result<(), String> {
        let width = cx.dims(self.image).width as usize;
        let (color, image) = (cx.read(self.color), &mut cx.write(self.image)[..]);
        let gain = match (params.exposure, &self.auto) {
            (None, Some(auto)) => auto.gain(params.percentile, &color, cx),
            (exposure, _) => exposure.unwrap_or_default().exp2(),
        };
        let level = cx.level();
        image.par_chunks_mut(width).zip(color.par_chunks(width)).for_each(|(image, color)| {
            dispatch!(level, simd => self.srgb.show_row(simd, params.curve, gain, color, image));
        });
        Ok(())
    }

    fn explain(&self, params: &TonemapParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

impl Auto {
    /// Declares the passes that find the white, before the one that shows it.
    fn declare(io: &mut Io, image: Out<texel::Rgba8Unorm>) -> Self {
        let histogram = io.write(
            "histogram",
            scratch("Pixels by the brightness of their brightest channel, 16 bins an octave, from 2^-24."),
            Extent::Fixed([auto::BINS, 1]),
        );
        let white = io.persistent("white", WHITE, Extent::Fixed([1, 1]));
        io.constants(auto::CONSTANTS);
        io.define("AUTO");
        io.dispatch("clear", histogram);
        io.compute("count", Threads::Blocks(image.into(), PIXELS_PER_THREAD));
        io.compute("adapt", Threads::Groups(1));
        Self { histogram, white }
    }

    /// Moves the white towards what fits this picture, and returns the factor that shows it as 1.
    fn gain(&self, percentile: u32, color: &[[f32; 4]], cx: &CpuContext) -> f32 {
        let mut histogram = cx.write(self.histogram);
        let empty = || [0; auto::BINS as usize];
        let count = |mut histogram: Bins, pixels: &[[f32; 4]]| {
            let bins = pixels.iter().filter_map(|&[r, g, b, _]| auto::bin([r, g, b]));
            bins.for_each(|bin| histogram[bin] += 1);
            histogram
        };
        let add = |mut sum: Bins, other: Bins| {
            sum.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
            sum
        };
        histogram.copy_from_slice(&color.par_chunks(CHUNK).fold(empty, count).reduce(empty, add));
        let white = &mut cx.write(self.white)[0];
        if let Some(fitting) = auto::fitting(&histogram, percentile) {
            *white = auto::follow(*white, fitting);
        }
        auto::gain(*white)
    }
}

/// The sRGB encoding as a search: the same bytes as the rounded formula, without its power.
struct Srgb {
    /// For given upper bits of a value, from those of [`Srgb::FIRST`] to those of 1: where the byte of the smallest value
    /// with them ends, which is the smallest value of the next byte, or infinity after the last; and that byte.
    table: Vec<(f32, u32)>,
}

impl Srgb {
    /// Below this every value is byte 0.
    const FIRST: f32 = 1.0 / 8192.0;
    /// Bits of a value that the table leaves to the search.
    const SHIFT: u32 = 16;

    fn new() -> Self {
        let end: [f32; 256] = std::array::from_fn(|byte| match byte {
            255 => f32::INFINITY,
            byte => decode_srgb((byte as f64 + 0.5) / 255.0) as f32,
        });
        let upper_bits = Self::FIRST.to_bits() >> Self::SHIFT..=1f32.to_bits() >> Self::SHIFT;
        let entry_of = |bits: u32| {
            let value = f32::from_bits(bits << Self::SHIFT);
            let byte = end.partition_point(|&end| end <= value);
            (end[byte], byte as u32)
        };
        Self { table: upper_bits.map(entry_of).collect() }
    }

    /// The byte of a value that is not NaN. This is the rule; [`Srgb::code`] applies it to eight values.
    #[inline(always)]
    fn encode(&self, value: f32) -> u8 {
        let value = value.clamp(Self::FIRST, 1.0);
        let (end, byte) = self.table[((value.to_bits() - Self::FIRST.to_bits()) >> Self::SHIFT) as usize];
        // Values with the same upper bits differ by a factor of at most 1/128, and codes by 0.87: one step is enough.
        (byte + u32::from(value >= end)) as u8
    }

    /// [`Srgb::show`] colours times `gain`.
    #[inline(always)]
    fn show_row<S: Simd>(&self, simd: S, curve: Curve, gain: f32, color: &[[f32; 4]], image: &mut [[u8; 4]]) {
        let show = |image: &mut [[u8; 4]], color: &[[f32; 4]]| {
            for (image, &[r, g, b, _]) in image.iter_mut().zip(color) {
                let [r, g, b] = self.show(curve, [r * gain, g * gain, b * gain]);
                *image = [r, g, b, 255];
            }
        };
        let (groups, last) = image.as_chunks_mut::<LANES>();
        let (colors, last_colors) = color.as_chunks::<LANES>();
        for (image, color) in groups.iter_mut().zip(colors) {
            let [r, g, b, _] = load_transposed(simd, color);
            let gain = f32x8::splat(simd, gain);
            let (r, g, b) = (r * gain, g * gain, b * gain);
            if (r.is_finite() & g.is_finite() & b.is_finite()).all_true() {
                let [r, g, b] = self.codes(simd, curve, [r, g, b]);
                let codes = r | (g << 8) | (b << 16) | u32x8::splat(simd, 255 << 24);
                *image = codes.to_array().map(u32::to_le_bytes);
            } else {
                show(image, color);
            }
        }
        show(last, last_colors);
    }

    /// The bytes of eight finite colours.
    #[inline(always)]
    fn codes<S: Simd>(&self, simd: S, curve: Curve, color: [f32x8<S>; 3]) -> [u32x8<S>; 3] {
        let splat = |number: f32| f32x8::splat(simd, number);
        let color = match curve {
            Curve::Clamp => color,
            Curve::Reinhard => {
                let luminance = luminances(simd, color);
                let positive = luminance.simd_gt(splat(0.0)).select(luminance, splat(0.0));
                let scale = splat(1.0) / (splat(1.0) + positive);
                color.map(|channel| channel * scale)
            }
        };
        let [r, g, b] = color;
        [self.code(simd, r), self.code(simd, g), self.code(simd, b)]
    }

    /// [`Srgb::encode`] eight numbers that are not NaN.
    #[inline(always)]
    fn code<S: Simd>(&self, simd: S, channel: f32x8<S>) -> u32x8<S> {
        let [first, one] = [Self::FIRST, 1.0].map(|number| f32x8::splat(simd, number));
        let above = channel.simd_lt(first).select(first, channel);
        let value = above.simd_gt(one).select(one, above);
        let at = (value.to_bits() - u32x8::splat(simd, Self::FIRST.to_bits())) >> Self::SHIFT;
        let at = at.to_array();
        let (mut end, mut byte) = ([0.0; LANES], [0; LANES]);
        for lane in 0..LANES {
            (end[lane], byte[lane]) = self.table[at[lane] as usize];
        }
        let (end, byte) = (f32x8::load_array(simd, end), u32x8::load_array(simd, byte));
        // All ones are -1.
        byte - bits(simd, value.simd_ge(end))
    }

    /// The bytes of a colour. This is the rule; [`Srgb::codes`] applies it to eight finite colours.
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
    use fearless_simd::Level;

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
    fn a_row_is_shown_as_its_colours_one_by_one() {
        let srgb = Srgb::new();
        let mut random = Random(4);
        let extremes =
            [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, -0.0, 1.0, Srgb::FIRST];
        let mut channel = || match random.below(200) {
            extreme @ 0..8 => extremes[extreme as usize],
            8..50 => random.between(-0.1, 1.2),
            // Where a byte ends, or just below.
            _ => {
                let (end, _) = srgb.table[random.below(srgb.table.len() as u32) as usize];
                if random.below(2) == 0 { end } else { end.next_down() }
            }
        };
        // The last group is not full.
        let colors: Vec<[f32; 4]> = (0..4099).map(|_| [0; 4].map(|_| channel())).collect();
        let curves = [Curve::Clamp, Curve::Reinhard];
        for (curve, gain) in curves.into_iter().flat_map(|curve| [(curve, 1.0), (curve, 1.7)]) {
            let show = |&[r, g, b, _]: &[f32; 4]| {
                let [r, g, b] = srgb.show(curve, [r, g, b].map(|channel| channel * gain));
                [r, g, b, 255]
            };
            let expected: Vec<[u8; 4]> = colors.iter().map(show).collect();
            for level in [Level::baseline(), Level::new()] {
                let mut image = vec![[0; 4]; colors.len()];
                dispatch!(level, simd => srgb.show_row(simd, curve, gain, &colors, &mut image));
                for (i, (found, expected)) in image.iter().zip(&expected).enumerate() {
                    assert_eq!(found, expected, "{:?} times {gain}", colors[i]);
                }
            }
        }
    }

    #[test]
    fn exposure_doubles() {
        let brighter =
            shown(TonemapParams { exposure: Some(2.0), ..TonemapParams::default() }, &[[0.1, 0.2, 0.02]]);
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

    fn auto() -> TonemapParams {
        TonemapParams { exposure: None, ..TonemapParams::default() }
    }

    /// Runs a frame on both sides, which must find the same white, bit for bit, from the same histogram. Returns the white
    /// and the twin's picture.
    fn fitted(harness: &mut Harness<Tonemap>) -> (f32, Vec<[u8; 4]>) {
        let both = run_both(harness);
        assert_eq!(both.cpu.get::<u32>("histogram"), both.gpu.get::<u32>("histogram"));
        let [cpu, gpu] = [&both.cpu, &both.gpu].map(|out| out.get::<f32>("white")[0]);
        assert_eq!(cpu.to_bits(), gpu.to_bits(), "{cpu} {gpu}");
        let [cpu_image, gpu_image] = [&both.cpu, &both.gpu].map(|out| out.get::<[u8; 4]>("image"));
        // As in `both_sides_agree`.
        let apart = cpu_image.iter().flatten().zip(gpu_image.iter().flatten());
        assert!(apart.map(|(cpu, gpu)| cpu.abs_diff(*gpu)).all(|apart| apart <= 1));
        (cpu, cpu_image)
    }

    #[test]
    fn auto_by_hand() {
        // Of 10 pixels with light, 9 are to be at most white: to the end of their bin, 0.25 to 0.25 * 17/16.
        let mut colors = [[0.25, 0.1, 0.0]; 9].to_vec();
        colors.push([8.0; 3]);
        let (white, image) = fitted(&mut harness(auto(), &colors));
        assert_eq!(white, 0.265625);
        // 0.25 / 0.265625 = 16/17: 1.055 * 0.9412^(1 / 2.4) - 0.055 = 0.9737 = 248.3 / 255; 0.1 likewise.
        assert_eq!((image[0], image[9]), ([248, 165, 0, 255], [255; 4]));
        // Pixels without light, or not finite, do not count.
        colors.extend([[0.0; 3], [-1.0; 3], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0]].repeat(30));
        assert_eq!(fitted(&mut harness(auto(), &colors)).0, white);
    }

    #[test]
    fn auto_at_the_extremes() {
        let most = 2f32.powi(24);
        // 2^-24 times 17/16: the end of the darkest bin.
        for (color, white, byte) in [(1e-30, 1.0625 / most, 0), (1e30, most, 255), (0.5, 0.53125, 248)] {
            assert_eq!(fitted(&mut harness(auto(), &[[color; 3]])), (white, vec![[byte, byte, byte, 255]]));
        }
        // No light, before and after there was some.
        let mut dark = harness(auto(), &[[0.0; 3], [f32::NAN; 3]]);
        assert_eq!(fitted(&mut dark), (0.0, vec![[0, 0, 0, 255], [255, 0, 255, 255]]));
        dark.set("color", &[[4.0f32; 4], [0.0; 4]]);
        assert_eq!(fitted(&mut dark), (4.25, vec![[248, 248, 248, 255], [0, 0, 0, 255]]));
        dark.set("color", &[[0.0f32; 4]; 2]);
        assert_eq!(fitted(&mut dark).0, 4.25);
        // As wide as textures may be, and rows that no workgroup ends with.
        let row: Vec<[f32; 4]> = (0..8192 * 3).map(|i| [0.001 * (i % 8192) as f32; 4]).collect();
        let mut wide = Harness::<Tonemap>::new(auto(), &settings([8192, 3], 0));
        wide.set("color", &row);
        let (white, _) = fitted(&mut wide);
        // 8191 pixels of a row have light: 90% of them are up to 7.37.
        assert!((white / 7.37 - 1.0).abs() < 0.01, "{white}");
    }

    #[test]
    fn auto_agrees_on_both_sides_frame_by_frame() {
        let mut random = Random(3);
        let mut harness = Harness::<Tonemap>::new(auto(), &settings([67, 41], 0));
        for frame in 0..40 {
            // Colours over many octaves, some black, some not finite, which grow brighter.
            let mut color = || {
                let scale = (random.between(-20.0, 0.0) + 0.3 * frame as f32).exp2();
                let [r, g, b] = [0; 3].map(|_| scale * random.between(-0.1, 1.0));
                match random.below(20) {
                    0 => [0.0; 4],
                    1 => [r, f32::NAN, b, 1.0],
                    2 => [r, g, f32::INFINITY, 1.0],
                    _ => [r, g, b, 1.0],
                }
            };
            let colors: Vec<[f32; 4]> = (0..67 * 41).map(|_| color()).collect();
            harness.set("color", &colors);
            fitted(&mut harness);
        }
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(2);
        let colors: Vec<[f32; 3]> = (0..4000).map(|_| [0; 3].map(|_| random.between(-0.1, 1.2))).collect();
        for curve in [Curve::Clamp, Curve::Reinhard] {
            let mut harness =
                harness(TonemapParams { curve, exposure: Some(0.3), ..TonemapParams::default() }, &colors);
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
