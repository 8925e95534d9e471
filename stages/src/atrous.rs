//! Averages noisy colours along surfaces: an à-trous filter that crosses no edge and knows how noisy each colour is
//! (`algorithms.md` section 12.3).
//!
//! Level l takes the pixel's colour and those of the four pixels 2^l to its sides, with binomial weights. A tap counts if
//! a straight walk to it, from neighbour to neighbour, crosses no edge: so edges need not be guessed from normals and
//! depths. What remains are smooth gradients, textures, and edges that are not known. They are kept by comparing the
//! tap's difference with the colour's standard deviation.

use std::ops::Range;

use epigraph_core::{CpuContext, Extent, In, Io, Out, Stage, constants, params, scratch, texel};
use rayon::prelude::*;

use crate::{
    meaning::{JOINS, RADIANCE, VARIANCE},
    shared::{color::luminance, edge_pixel::DIRECTIONS, requests::UNKNOWN},
};

constants! {
    /// The bit of a nibble of N8: both primary regions are joined.
    const PRIMARY: u32 = 1;
    /// The weight of the pixel itself; that of a tap is 1.
    const OWN_WEIGHT: f32 = 2.0;
    /// Smaller variances count as this.
    const LEAST_VARIANCE: f32 = 1e-30;
}

/// The directions of taps, as indices of [`DIRECTIONS`]: E, S, W and N. With the four corners, too, pictures are not
/// better.
const SIDES: [usize; 4] = [0, 2, 4, 6];

/// Columns that a task processes at a time.
const TILE: usize = 64;

params! {
    /// Parameters of [`Atrous`].
    pub struct AtrousParams {
        /// Number of levels; the taps of the last are 2^(levels - 1) pixels away.
        levels: u32 = 5, in 1..=8;
        /// Difference of colours, in standard deviations, from which on a tap does not count. Neighbouring colours are
        /// means of partly the same samples, so this is more than for independent ones.
        tolerance: f32 = 24.0, in 0.5..=1000.0, unit "deviations";
    }
}

/// See the module.
pub struct Atrous {
    color: In<texel::Rgba32Float>,
    variance: In<f32>,
    n8: In<u32>,
    filtered: Out<texel::Rgba32Float>,
    even: Out<[f32; 4]>,
    odd: Out<[f32; 4]>,
    even_reach: Out<u32>,
    odd_reach: Out<u32>,
}

/// The passes, one for each level.
const LEVELS: [&str; 8] =
    ["level_0", "level_1", "level_2", "level_3", "level_4", "level_5", "level_6", "level_7"];

impl Stage for Atrous {
    const KIND: &'static str = "atrous";
    const DOC: &'static str = "Averages noisy colours along surfaces, without crossing edges.";
    type Params = AtrousParams;

    fn declare(params: &AtrousParams, io: &mut Io) -> Self {
        io.per_view();
        let pixels = || Extent::Frame(1);
        let color = io.read("color", RADIANCE.doc("Linear radiance of the primary regions."), pixels());
        let variance = io.read(
            "variance",
            VARIANCE.doc("Variance of its luminance; negative in holes, whose colours do not count."),
            pixels(),
        );
        let n8 = io.read("n8", JOINS, pixels());
        let filtered = io.write("filtered", RADIANCE.doc("The averaged radiance."), pixels());
        let doc = "Colour and variance after every other level.";
        let even = io.write("even", scratch(doc), pixels());
        let odd = io.write("odd", scratch(doc), pixels());
        let doc = "Which taps of every other level can be reached, a bit for each direction.";
        let even_reach = io.write("even_reach", scratch(doc), pixels());
        let odd_reach = io.write("odd_reach", scratch(doc), pixels());
        io.shader(shader!("atrous"));
        io.constants(CONSTANTS);
        io.dispatch("prepare", filtered);
        LEVELS.iter().take(params.levels as usize).for_each(|level| io.dispatch(level, filtered));
        Self { color, variance, n8, filtered, even, odd, even_reach, odd_reach }
    }

    fn cpu(&self, params: &AtrousParams, cx: &CpuContext) -> Result<(), String> {
        let width = cx.dims(self.filtered).width as usize;
        let (color, variance) = (&cx.read(self.color)[..], &cx.read(self.variance)[..]);
        let n8 = &cx.read(self.n8)[..];
        let filtered = &mut cx.write(self.filtered)[..];
        if variance.iter().all(|&variance| variance == 0.0) {
            filtered.copy_from_slice(color);
            return Ok(());
        }
        let (mut even, mut odd) = (cx.write(self.even), cx.write(self.odd));
        let (mut even_reach, mut odd_reach) = (cx.write(self.even_reach), cx.write(self.odd_reach));
        let mut from = Planes::new(&mut even, &mut even_reach, width);
        let mut to = Planes::new(&mut odd, &mut odd_reach, width);
        from.prepare(color, variance, n8);
        let scale = 1.0 / (params.tolerance * params.tolerance);
        for level in 0..params.levels {
            to.average(&from, 1 << level, scale);
            std::mem::swap(&mut from, &mut to);
        }
        let rgb = from.rgb.each_ref().map(|plane| &plane[..]);
        filtered.par_chunks_mut(width).enumerate().for_each(|(y, filtered)| {
            let [r, g, b] = rgb.map(|plane| &plane[y * width..][..width]);
            let channels = r.iter().zip(g).zip(b).zip(&color[y * width..][..width]);
            for (filtered, (((r, g), b), color)) in filtered.iter_mut().zip(channels) {
                *filtered = [*r, *g, *b, color[3]];
            }
        });
        Ok(())
    }
}

/// An image between levels: red, green, blue, variance, and which taps of the next level can be reached.
struct Planes<'a> {
    rgb: [&'a mut [f32]; 3],
    variance: &'a mut [f32],
    reach: &'a mut [u32],
    width: usize,
}

impl<'a> Planes<'a> {
    fn new(memory: &'a mut [[f32; 4]], reach: &'a mut [u32], width: usize) -> Self {
        let count = memory.len();
        let (r, rest) = memory.as_flattened_mut().split_at_mut(count);
        let (g, rest) = rest.split_at_mut(count);
        let (b, variance) = rest.split_at_mut(count);
        Self { rgb: [r, g, b], variance, reach, width }
    }

    /// The rows with their number: red, green, blue, variance, and reach.
    fn rows(&mut self) -> impl IndexedParallelIterator<Item = (usize, [&mut [f32]; 4], &mut [u32])> {
        let [r, g, b] = &mut self.rgb;
        let [r, g, b, variance] = [r, g, b, &mut self.variance].map(|plane| plane.par_chunks_mut(self.width));
        let rows = r.zip(g).zip(b).zip(variance).zip(self.reach.par_chunks_mut(self.width)).enumerate();
        rows.map(|(y, ((((r, g), b), variance), reach))| (y, [r, g, b, variance], reach))
    }

    /// The image before the first level. Variances are noisy themselves: each becomes the mean of those around that can
    /// be reached.
    fn prepare(&mut self, color: &[[f32; 4]], variance: &[f32], n8: &[u32]) {
        let size = [self.width, variance.len() / self.width];
        self.rows().for_each(|(y, [r, g, b, smoothed], reach)| {
            let row = y * size[0];
            let channels = r.iter_mut().zip(g).zip(b);
            for (((r, g), b), color) in channels.zip(&color[row..][..size[0]]) {
                [*r, *g, *b, _] = *color;
            }
            reach.fill(0);
            for left in (0..size[0]).step_by(TILE) {
                let columns = left..size[0].min(left + TILE);
                let own = &variance[row..][columns.clone()];
                let (mut sums, mut weights) = ([0.0; TILE], [OWN_WEIGHT; TILE]);
                sums.iter_mut().zip(own).for_each(|(sum, variance)| *sum = OWN_WEIGHT * variance);
                for d in SIDES {
                    let Some(Taps { first, here, there, count }) = Taps::of(columns.clone(), y, d, 1, size)
                    else {
                        continue;
                    };
                    let (joins, there) = (&n8[here..][..count], &variance[there..][..count]);
                    let reach = &mut reach[first..][..count];
                    let (sums, weights) =
                        (&mut sums[first - left..][..count], &mut weights[first - left..][..count]);
                    for i in 0..count {
                        let is_joined = joins[i] >> (4 * d) & PRIMARY;
                        reach[i] |= is_joined << d;
                        let counts = (is_joined & !(there[i].to_bits() >> 31)).wrapping_neg();
                        let weight = f32::from_bits(1f32.to_bits() & counts);
                        sums[i] += weight * there[i];
                        weights[i] += weight;
                    }
                }
                for (i, &own) in own.iter().enumerate() {
                    smoothed[left + i] = if own < 0.0 { UNKNOWN } else { sums[i] / weights[i] };
                }
            }
        });
    }

    /// One level: the taps are `step` pixels away.
    fn average(&mut self, from: &Planes, step: usize, scale: f32) {
        let width = self.width;
        self.rows().for_each(|(y, mut to, reach)| {
            for left in (0..width).step_by(TILE) {
                let columns = left..width.min(left + TILE);
                let mut sums = Sums::of(from, y, columns.clone(), scale);
                for d in SIDES {
                    sums.add(from, d, step);
                }
                sums.store(from, &mut to, reach);
            }
        });
    }
}

/// Pixels of a row whose taps in a direction are in the image.
struct Taps {
    /// Column of the first.
    first: usize,
    /// Its index, and that of its tap.
    here: usize,
    there: usize,
    count: usize,
}

impl Taps {
    /// Of some columns of row `y`, if there are any; the taps are `step` pixels away.
    fn of(
        columns: Range<usize>,
        y: usize,
        d: usize,
        step: usize,
        [width, height]: [usize; 2],
    ) -> Option<Self> {
        let [dx, dy] = DIRECTIONS[d].map(|axis| axis as isize * step as isize);
        let row = y.checked_add_signed(dy).filter(|&row| row < height)?;
        let first = columns.start.max(dx.min(0).unsigned_abs());
        let end = columns.end.min(width.saturating_sub(dx.max(0).unsigned_abs()));
        let there = (row * width + first).wrapping_add_signed(dx);
        (first < end).then(|| Self { first, here: y * width + first, there, count: end - first })
    }
}

/// Weighted sums over the taps of some pixels of a row.
struct Sums {
    y: usize,
    left: usize,
    count: usize,
    rgb: [[f32; TILE]; 3],
    weights: [f32; TILE],
    variance: [f32; TILE],
    /// By what squared differences are multiplied, to be 1 at the tolerance.
    scale: [f32; TILE],
    reach: [u32; TILE],
}

impl Sums {
    /// With the pixels' own colours, if they are not holes.
    fn of(from: &Planes, y: usize, columns: Range<usize>, scale: f32) -> Self {
        let (left, count) = (columns.start, columns.len());
        let mut sums = Self {
            y,
            left,
            count,
            rgb: [[0.0; TILE]; 3],
            weights: [0.0; TILE],
            variance: [0.0; TILE],
            scale: [0.0; TILE],
            reach: [0; TILE],
        };
        let first = y * from.width + left;
        let variance = &from.variance[first..][..count];
        for (i, &variance) in variance.iter().enumerate() {
            let weight = if variance < 0.0 { 0.0 } else { OWN_WEIGHT };
            sums.weights[i] = weight;
            sums.variance[i] = weight * weight * variance;
            // A hole takes any colour.
            sums.scale[i] = if variance < 0.0 { 0.0 } else { scale / variance.max(LEAST_VARIANCE) };
        }
        for (sum, plane) in sums.rgb.iter_mut().zip(&from.rgb) {
            for ((sum, color), weight) in sum.iter_mut().zip(&plane[first..][..count]).zip(&sums.weights) {
                *sum = weight * color;
            }
        }
        sums
    }

    /// Adds the taps in a direction.
    fn add(&mut self, from: &Planes, d: usize, step: usize) {
        let size = [from.width, from.variance.len() / from.width];
        let columns = self.left..self.left + self.count;
        let Some(Taps { first, here, there, count }) = Taps::of(columns, self.y, d, step, size) else {
            return;
        };
        let skipped = first - self.left;
        // Slices of one length each, so that the loop is vectorized.
        let [own_r, own_g, own_b] = from.rgb.each_ref().map(|plane| &plane[here..][..count]);
        let [tap_r, tap_g, tap_b] = from.rgb.each_ref().map(|plane| &plane[there..][..count]);
        let tap_variance = &from.variance[there..][..count];
        let (own_reach, tap_reach) = (&from.reach[here..][..count], &from.reach[there..][..count]);
        let [r, g, b] = self.rgb.each_mut().map(|sum| &mut sum[skipped..][..count]);
        let weights = &mut self.weights[skipped..][..count];
        let variance = &mut self.variance[skipped..][..count];
        let scale = &self.scale[skipped..][..count];
        let reach = &mut self.reach[skipped..][..count];
        for i in 0..count {
            let aside =
                [(tap_r[i] - own_r[i]).abs(), (tap_g[i] - own_g[i]).abs(), (tap_b[i] - own_b[i]).abs()];
            let difference = luminance(aside);
            let unlike = 1.0 - difference * difference * scale[i];
            let like = if unlike > 0.0 { unlike } else { 0.0 };
            // All ones if the tap counts: it can be reached, and is no hole.
            let counts = (own_reach[i] >> d & 1 & !(tap_variance[i].to_bits() >> 31)).wrapping_neg();
            let weight = f32::from_bits((like * like).to_bits() & counts);
            r[i] += weight * tap_r[i];
            g[i] += weight * tap_g[i];
            b[i] += weight * tap_b[i];
            weights[i] += weight;
            variance[i] += weight * weight * tap_variance[i];
            reach[i] |= own_reach[i] & tap_reach[i] & 1 << d;
        }
    }

    /// Writes the means. A hole that reaches no colour keeps its own.
    fn store(&self, from: &Planes, to: &mut [&mut [f32]; 4], reach: &mut [u32]) {
        let first = self.y * from.width + self.left;
        let weights = &self.weights[..self.count];
        let [to @ .., variance] = to.each_mut().map(|plane| &mut plane[self.left..][..self.count]);
        for ((to, sum), from) in to.into_iter().zip(&self.rgb).zip(&from.rgb) {
            for (((to, sum), from), weights) in to.iter_mut().zip(sum).zip(&from[first..]).zip(weights) {
                *to = if *weights > 0.0 { sum / weights } else { *from };
            }
        }
        for ((to, sum), weights) in variance.iter_mut().zip(&self.variance).zip(weights) {
            *to = if *weights > 0.0 { sum / (weights * weights) } else { UNKNOWN };
        }
        reach[self.left..][..self.count].copy_from_slice(&self.reach[..self.count]);
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::testing::{Random, run_alike, run_both, run_cpu, settings};

    type Size = [usize; 2];

    fn harness(
        params: AtrousParams,
        [width, height]: Size,
        color: &[[f32; 4]],
        variance: &[f32],
        n8: &[u32],
    ) -> Harness<Atrous> {
        let mut harness = Harness::new(params, &settings([width as u32, height as u32], 0));
        harness.set("color", color);
        harness.set("variance", variance);
        harness.set("n8", n8);
        harness
    }

    /// N8 of an image in which neighbours are joined if `joins` says so.
    fn reach([width, height]: Size, joins: impl Fn(Size, Size) -> bool) -> Vec<u32> {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        let of = |pixel: Size| {
            let taps = DIRECTIONS.into_iter().enumerate().filter(|(_, direction)| {
                let there = stepped(pixel, *direction, 1, [width, height]);
                there.is_some_and(|there| joins(pixel, there))
            });
            taps.map(|(d, _)| PRIMARY << (4 * d)).sum()
        };
        pixels.map(of).collect()
    }

    fn stepped(pixel: Size, direction: [i32; 2], steps: isize, size: Size) -> Option<Size> {
        let along = |axis: usize| pixel[axis].checked_add_signed(direction[axis] as isize * steps);
        Some([along(0)?, along(1)?]).filter(|there| there[0] < size[0] && there[1] < size[1])
    }

    /// The rule, pixel by pixel, in double precision: colours and variances after all levels.
    fn rule(
        params: &AtrousParams,
        size: Size,
        color: &[[f32; 4]],
        variance: &[f32],
        n8: &[u32],
    ) -> Vec<[f64; 3]> {
        let index = |[x, y]: Size| y * size[0] + x;
        let pixels = || (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y]));
        // Whether a straight walk of this many steps crosses no edge, and where it leads.
        let walk = |pixel: Size, d: usize, steps: u32| {
            (0..steps).try_fold(pixel, |at, _| {
                let is_joined = n8[index(at)] >> (4 * d) & PRIMARY != 0;
                stepped(at, DIRECTIONS[d], 1, size).filter(|_| is_joined)
            })
        };
        let mut colors: Vec<[f64; 3]> = color.iter().map(|c| [c[0], c[1], c[2]].map(f64::from)).collect();
        let smoothed = pixels().map(|pixel| {
            let own = f64::from(variance[index(pixel)]);
            if own < 0.0 {
                return None;
            }
            let taps =
                SIDES.into_iter().filter_map(|d| Some((1.0, f64::from(variance[index(walk(pixel, d, 1)?)]))));
            let taps = taps.filter(|tap| tap.1 >= 0.0).chain([(2.0, own)]);
            let (weights, sum) = taps.fold((0.0, 0.0), |sums, tap| (sums.0 + tap.0, sums.1 + tap.0 * tap.1));
            Some(sum / weights)
        });
        let mut variances: Vec<Option<f64>> = smoothed.collect();
        for level in 0..params.levels {
            let averaged = pixels().map(|pixel| {
                let (own, noise) = (colors[index(pixel)], variances[index(pixel)]);
                let (mut sum, mut weights, mut spread) = ([0.0; 3], 0.0, 0.0);
                let mut add = |color: [f64; 3], weight: f64, variance: f64| {
                    (0..3).for_each(|channel| sum[channel] += weight * color[channel]);
                    weights += weight;
                    spread += weight * weight * variance;
                };
                if let Some(noise) = noise {
                    add(own, 2.0, noise);
                }
                for d in SIDES {
                    let Some(there) = walk(pixel, d, 1 << level) else { continue };
                    let (color, Some(variance)) = (colors[index(there)], variances[index(there)]) else {
                        continue;
                    };
                    let aside = |channel: usize| (color[channel] - own[channel]).abs();
                    let difference = 0.2126 * aside(0) + 0.7152 * aside(1) + 0.0722 * aside(2);
                    let tolerance = noise.map(|noise| noise.max(1e-30).sqrt() * f64::from(params.tolerance));
                    let like = tolerance.map_or(1.0, |most| (1.0 - (difference / most).powi(2)).max(0.0));
                    add(color, like * like, variance);
                }
                if weights == 0.0 {
                    (own, None)
                } else {
                    (sum.map(|sum| sum / weights), Some(spread / (weights * weights)))
                }
            });
            (colors, variances) = averaged.unzip();
        }
        colors
    }

    #[test]
    fn three_pixels_by_hand() {
        // 1, 2 and 4 in a row, with variance 1: at a tolerance of 4 deviations, a difference of 1 is 1/4 of it, and of 2
        // one half. So taps have the weights (1 - 1/16)^2 and (1 - 1/4)^2.
        let size = [3, 1];
        let color = [1.0, 2.0, 4.0].map(|grey| [grey, grey, grey, 1.0]);
        let n8 = reach(size, |_, _| true);
        let params = AtrousParams { levels: 1, tolerance: 4.0 };
        let out = run_alike(&mut harness(params, size, &color, &[1.0; 3], &n8)).get::<[f32; 4]>("filtered");
        let (near, far) = ((15.0f32 / 16.0).powi(2), 0.75f32.powi(2));
        let middle = (4.0 + near + 4.0 * far) / (2.0 + near + far);
        assert!((out[1][0] - middle).abs() < 1e-6, "{out:?} {middle}");
        assert!((out[0][0] - (2.0 + 2.0 * near) / (2.0 + near)).abs() < 1e-6, "{out:?}");
    }

    #[test]
    fn a_hole_takes_what_joins_it_and_gives_nothing() {
        let size = [3, 1];
        let color = [[1.0, 0.0, 0.0, 1.0], [9.0, 9.0, 9.0, 0.5], [0.0, 0.0, 1.0, 1.0]];
        let n8 = reach(size, |p, q| p[0] + q[0] != 3);
        let params = AtrousParams { levels: 1, tolerance: 4.0 };
        let out = run_alike(&mut harness(params.clone(), size, &color, &[0.01, UNKNOWN, 0.01], &n8));
        let out = out.get::<[f32; 4]>("filtered");
        assert_eq!(out[1], [1.0, 0.0, 0.0, 0.5]);
        assert_eq!(out[0], color[0]);
        assert_eq!(out[2], color[2]);
        // One that nothing joins keeps its colour.
        let out = run_alike(&mut harness(params, size, &color, &[0.01, UNKNOWN, 0.01], &[0; 3]));
        assert_eq!(out.get::<[f32; 4]>("filtered"), color);
    }

    /// Noisy colours on both sides of a wall between columns 19 and 20.
    fn walled(random: &mut Random) -> (Size, Vec<[f32; 4]>, Vec<u32>) {
        let size = [50, 40];
        let color = (0..2000).map(|p| {
            let noise = random.between(0.0, 2.0);
            if p % 50 < 20 { [noise, 0.0, 0.0, 1.0] } else { [0.0, 0.0, noise, 1.0] }
        });
        (size, color.collect(), reach(size, |p, q| (p[0] < 20) == (q[0] < 20)))
    }

    #[test]
    fn noise_goes_and_no_colour_crosses_an_edge() {
        let (size, color, n8) = walled(&mut Random(5));
        let both = run_both(&mut harness(AtrousParams::default(), size, &color, &[1.0 / 3.0; 2000], &n8));
        for out in [&both.cpu, &both.gpu] {
            let filtered = out.get::<[f32; 4]>("filtered");
            let mut squares = 0.0;
            for (p, [r, g, b, a]) in filtered.into_iter().enumerate() {
                let (own, other) = if p % 50 < 20 { (r, b) } else { (b, r) };
                assert_eq!((g, other, a), (0.0, 0.0, 1.0), "{p}");
                squares += (own - 1.0).powi(2);
            }
            // The variance of the noise is 1/3. Kernels of 61 pixels reach far beyond this image.
            assert!(squares / 2000.0 < 0.005, "{squares}");
        }
    }

    #[test]
    fn clean_colours_stay() {
        let (size, color, n8) = walled(&mut Random(6));
        let out = run_alike(&mut harness(AtrousParams::default(), size, &color, &[0.0; 2000], &n8));
        assert!(out.get::<[f32; 4]>("filtered") == color);
        // And a difference beyond the tolerance, however many levels there are.
        let out = run_cpu(&mut harness(AtrousParams::default(), size, &color, &[1e-20; 2000], &n8));
        assert!(out.get::<[f32; 4]>("filtered") == color);
    }

    #[test]
    fn both_sides_follow_the_rule() {
        let mut random = Random(23);
        for (size, levels) in
            [([61, 43], 5), ([1, 1], 3), ([1, 70], 6), ([200, 3], 8), ([64, 2], 1), ([65, 9], 2)]
        {
            let count = size[0] * size[1];
            let color: Vec<_> = (0..count).map(|_| [0; 4].map(|_| random.between(0.0, 4.0))).collect();
            let variance: Vec<_> = (0..count)
                .map(|_| match random.below(8) {
                    0 => UNKNOWN,
                    1 => 0.0,
                    _ => random.between(0.0, 0.1),
                })
                .collect();
            // Bits that point outside the image, too, and joins that are not mutual.
            let n8: Vec<_> = (0..count).map(|_| random.bits() | random.bits()).collect();
            let params = AtrousParams { levels, tolerance: 12.0 };
            let both = run_both(&mut harness(params.clone(), size, &color, &variance, &n8));
            both.assert_close("filtered", 1e-5);
            let expected = rule(&params, size, &color, &variance, &n8);
            for (got, expected) in both.cpu.get::<[f32; 4]>("filtered").iter().zip(expected) {
                for channel in 0..3 {
                    let error = (f64::from(got[channel]) - expected[channel]).abs();
                    assert!(error < 1e-5, "{got:?} {expected:?} at {size:?}");
                }
            }
        }
    }
}
