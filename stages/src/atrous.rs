//! Averages noisy colours along surfaces: an à-trous filter that crosses no edge and knows how noisy each colour is
//! (`algorithms.md` section 12.3).
//!
//! Level l takes the pixel's colour and those of the four pixels 2^l to its sides, with binomial weights. A tap counts if
//! a straight walk to it, from neighbour to neighbour, crosses no edge: so edges need not be guessed from normals and
//! depths. What remains are smooth gradients, textures, and edges that are not known. They are kept by comparing the
//! tap's difference with the colour's standard deviation.

use epigraph_core::{CpuContext, Extent, In, Io, Out, Stage, constants, params, scratch, texel};
use fearless_simd::{Simd, dispatch, f32x8, prelude::*, u32x8};
use glam::Vec3;
use rayon::prelude::*;

use crate::{
    meaning::{ALBEDO_CODE, JOINS, RADIANCE, VARIANCE},
    shared::{
        albedo::{NO_ALBEDO, albedo_of, decode_albedo, encode_albedo},
        color::luminances,
        lanes::{LANES, bits, if_odd, load_transposed, padded, store, store_vectors},
        requests::UNKNOWN,
    },
};

constants! {
    /// The bit of a nibble of N8: both primary regions are joined.
    const PRIMARY: u32 = 1;
    /// The weight of the pixel itself; that of a tap is 1.
    const OWN_WEIGHT: f32 = 2.0;
    /// Smaller variances count as this.
    const LEAST_VARIANCE: f32 = 1e-30;
    /// Where the code of a pixel's albedo begins, above the bits of its taps.
    const ALBEDO_SHIFT: u32 = 8;
    const ALBEDO_BITS: u32 = 0xFFFF_FF00;
}

/// The directions of taps, as nibbles of N8. With the four corners, too, pictures are not better.
const SIDES: [usize; 4] = [EAST, SOUTH, WEST, NORTH];
const EAST: usize = 0;
const SOUTH: usize = 2;
const WEST: usize = 4;
const NORTH: usize = 6;

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
    albedo: Option<In<u32>>,
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
        let doc = "By what colours are divided before they are averaged, and multiplied then.";
        let albedo = io.optional("albedo", ALBEDO_CODE.doc(doc), pixels());
        let filtered = io.write("filtered", RADIANCE.doc("The averaged radiance."), pixels());
        let doc = "Colour and variance after every other level.";
        let even = io.write("even", scratch(doc), pixels());
        let odd = io.write("odd", scratch(doc), pixels());
        let doc = "Which taps of every other level can be reached, a bit for each direction; above 8 bits, the albedo.";
        let even_reach = io.write("even_reach", scratch(doc), pixels());
        let odd_reach = io.write("odd_reach", scratch(doc), pixels());
        io.shader(shader!("atrous"));
        io.constants(CONSTANTS);
        if albedo.is_some() {
            io.define("ALBEDO");
        }
        io.dispatch("prepare", filtered);
        LEVELS.iter().take(params.levels as usize).for_each(|level| io.dispatch(level, filtered));
        Self { color, variance, n8, albedo, filtered, even, odd, even_reach, odd_reach }
    }

    fn cpu(&self, params: &AtrousParams, cx: &CpuContext) -> Result<(), String> {
        let width = cx.dims(self.filtered).width as usize;
        let (color, variance) = (&cx.read(self.color)[..], &cx.read(self.variance)[..]);
        let n8 = &cx.read(self.n8)[..];
        let filtered = &mut cx.write(self.filtered)[..];
        // Colours that are certain stay as they are.
        if variance.iter().all(|&variance| variance == 0.0) {
            filtered.copy_from_slice(color);
            return Ok(());
        }
        let (mut even, mut odd) = (cx.write(self.even), cx.write(self.odd));
        let (mut even_reach, mut odd_reach) = (cx.write(self.even_reach), cx.write(self.odd_reach));
        let mut from = Planes::new(&mut even, &mut even_reach, width);
        let mut to = Planes::new(&mut odd, &mut odd_reach, width);
        let level = cx.level();
        let albedo = self.albedo.map(|albedo| cx.read(albedo));
        let albedo = albedo.as_ref().map(|albedo| &albedo[..]);
        let input = Input { color, variance, n8, albedo, width };
        from.rows_mut().for_each(|(y, row)| dispatch!(level, simd => input.prepare(simd, y, row)));
        let scale = 1.0 / (params.tolerance * params.tolerance);
        for step in (0..params.levels).map(|level| 1 << level) {
            to.rows_mut().for_each(|(y, row)| {
                if albedo.is_some() {
                    dispatch!(level, simd => from.average::<_, true>(simd, y, step, scale, row));
                } else {
                    dispatch!(level, simd => from.average::<_, false>(simd, y, step, scale, row));
                }
            });
            std::mem::swap(&mut from, &mut to);
        }
        let rows = filtered.par_chunks_mut(width).zip(color.par_chunks(width)).enumerate();
        rows.for_each(|(y, (filtered, color))| {
            dispatch!(level, simd => from.row(y).interleave(simd, color, albedo.is_some(), filtered));
        });
        Ok(())
    }
}

/// What the stage reads.
struct Input<'a> {
    color: &'a [[f32; 4]],
    variance: &'a [f32],
    n8: &'a [u32],
    albedo: Option<&'a [u32]>,
    width: usize,
}

impl Input<'_> {
    /// A row of the image before the first level. Variances are noisy themselves: each becomes the mean of those around
    /// that can be reached.
    #[inline(always)]
    fn prepare<S: Simd>(&self, simd: S, y: usize, mut to: RowMut) {
        let width = self.width;
        let height = self.variance.len() / width;
        let row = |y: usize| {
            let albedo = self.albedo.map(|albedo| &albedo[y * width..][..width]);
            (&self.variance[y * width..][..width], albedo)
        };
        let (here, below, above) = (row(y), row((y + 1).min(height - 1)), row(y.saturating_sub(1)));
        let (color, n8) = (&self.color[y * width..][..width], &self.n8[y * width..][..width]);
        // N8 without what would leave the image.
        let join = |d: usize| PRIMARY << (4 * d);
        let mut inside = !0;
        if y + 1 == height {
            inside &= !join(SOUTH);
        }
        if y == 0 {
            inside &= !join(NORTH);
        }
        for x in (0..width).step_by(LANES) {
            let column = u32x8::from_fn(simd, |lane| (x + lane) as u32);
            let is_end = [column.simd_eq(width as u32 - 1), column.simd_eq(0)];
            let mut joins = lanes_beside::<S, u32x8<S>>(simd, n8, x, 0) & inside;
            joins &= !(bits(simd, is_end[0]) & join(EAST));
            joins &= !(bits(simd, is_end[1]) & join(WEST));
            let own = light_variance(simd, here, x, 0);
            let mut mean = Variance { joins, sum: own * OWN_WEIGHT, weights: f32x8::splat(simd, OWN_WEIGHT) };
            mean.add(simd, EAST, light_variance(simd, here, x, 1));
            mean.add(simd, SOUTH, light_variance(simd, below, x, 0));
            mean.add(simd, WEST, light_variance(simd, here, x, -1));
            mean.add(simd, NORTH, light_variance(simd, above, x, 0));
            let is_hole = own.simd_lt(f32x8::splat(simd, 0.0));
            let smoothed = is_hole.select(f32x8::splat(simd, UNKNOWN), mean.sum / mean.weights);
            let [r, g, b, _] = load_transposed(simd, &padded(color, x));
            let mut channels = [r, g, b, smoothed];
            let mut reach = u32x8::splat(simd, 0);
            if let (_, Some(albedo)) = here {
                // A hole shows what it takes of others: it has no albedo of its own.
                let code = u32x8::load_array(simd, padded(albedo, x));
                let code = is_hole.select(u32x8::splat(simd, NO_ALBEDO), code);
                reach |= code << ALBEDO_SHIFT;
                let [of_r, of_g, of_b] = albedo_of(simd, code);
                channels = [r / of_r, g / of_g, b / of_b, smoothed];
            }
            for d in SIDES {
                reach |= ((joins >> (4 * d) as u32) & PRIMARY) << d as u32;
            }
            to.store(x, Pixels { channels, reach });
        }
    }
}

/// The variances of the light of eight pixels of a row, without their albedo.
#[inline(always)]
fn light_variance<S: Simd>(
    simd: S,
    (variance, albedo): (&[f32], Option<&[u32]>),
    x: usize,
    dx: isize,
) -> f32x8<S> {
    let variance: f32x8<S> = lanes_beside(simd, variance, x, dx);
    let Some(albedo) = albedo else { return variance };
    let luminance = luminances(simd, albedo_of(simd, lanes_beside(simd, albedo, x, dx)));
    variance / (luminance * luminance)
}

/// Weighted sums of the variances around eight pixels.
struct Variance<S: Simd> {
    joins: u32x8<S>,
    sum: f32x8<S>,
    weights: f32x8<S>,
}

impl<S: Simd> Variance<S> {
    /// Adds those in direction `d`.
    #[inline(always)]
    fn add(&mut self, simd: S, d: usize, there: f32x8<S>) {
        let is_known = (self.joins >> (4 * d) as u32) & !(there.to_bits() >> 31);
        let weight = f32x8::from_bits(if_odd(simd, is_known, u32x8::splat(simd, 1f32.to_bits())));
        self.sum += weight * there;
        self.weights += weight;
    }
}

/// The elements of a row `dx` columns to the right of the eight from column `x` on, if all are there.
#[inline(always)]
fn beside<T>(row: &[T], x: usize, dx: isize) -> Option<&[T; LANES]> {
    // A column before the first wraps to one behind the last.
    row.get(x.wrapping_add_signed(dx)..)?.first_chunk()
}

/// Those of [`beside`] at the ends of a row, with zeros outside.
#[cold]
#[inline(never)]
fn beside_end<T: Copy + Default>(row: &[T], x: usize, dx: isize) -> [T; LANES] {
    std::array::from_fn(|lane| {
        let at = (x + lane).checked_add_signed(dx);
        at.and_then(|at| row.get(at)).copied().unwrap_or_default()
    })
}

/// Either of them as a vector.
#[inline(always)]
fn lanes_beside<S, V>(simd: S, row: &[V::Element], x: usize, dx: isize) -> V
where
    S: Simd,
    V: SimdBase<S, Array = [<V as SimdBase<S>>::Element; LANES]>,
    V::Element: Default,
{
    match beside(row, x, dx) {
        Some(lanes) => V::load_array_ref(simd, lanes),
        None => V::load_array(simd, beside_end(row, x, dx)),
    }
}

/// An image between levels: red, green, blue and variance, and which taps of the next level can be reached.
struct Planes<'a> {
    channels: [&'a mut [f32]; 4],
    reach: &'a mut [u32],
    width: usize,
}

/// A row of an image between levels.
#[derive(Clone, Copy)]
struct Row<'a> {
    channels: [&'a [f32]; 4],
    reach: &'a [u32],
}

struct RowMut<'a> {
    channels: [&'a mut [f32]; 4],
    reach: &'a mut [u32],
}

impl<'a> Planes<'a> {
    fn new(memory: &'a mut [[f32; 4]], reach: &'a mut [u32], width: usize) -> Self {
        let count = memory.len();
        let (r, rest) = memory.as_flattened_mut().split_at_mut(count);
        let (g, rest) = rest.split_at_mut(count);
        let (b, variance) = rest.split_at_mut(count);
        Self { channels: [r, g, b, variance], reach, width }
    }

    fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = (usize, RowMut<'_>)> {
        let [r, g, b, variance] = self.channels.each_mut().map(|plane| plane.par_chunks_mut(self.width));
        let rows = r.zip(g).zip(b).zip(variance).zip(self.reach.par_chunks_mut(self.width)).enumerate();
        rows.map(|(y, ((((r, g), b), variance), reach))| (y, RowMut { channels: [r, g, b, variance], reach }))
    }

    #[inline(always)]
    fn row(&self, y: usize) -> Row<'_> {
        // Slices of one length, so that their bounds are checked together.
        let (first, width) = (y * self.width, self.width);
        let [r, g, b, variance] = &self.channels;
        let channels =
            [&r[first..][..width], &g[first..][..width], &b[first..][..width], &variance[first..][..width]];
        Row { channels, reach: &self.reach[first..][..width] }
    }

    /// A row after the next level, whose taps are `step` pixels away. Squared differences of colours are multiplied by
    /// `scale`, which is 1 / tolerance²: over a pixel's variance, that makes them 1 at the tolerance.
    #[inline(always)]
    fn average<S: Simd, const HAS_ALBEDO: bool>(
        &self,
        simd: S,
        y: usize,
        step: usize,
        scale: f32,
        mut to: RowMut,
    ) {
        let last = self.reach.len() / self.width - 1;
        // Nothing outside the image can be reached, whatever is read there.
        let (here, below, above) =
            (self.row(y), self.row((y + step).min(last)), self.row(y.saturating_sub(step)));
        let aside = step as isize;
        for x in (0..self.width).step_by(LANES) {
            let own = here.beside(simd, x, 0);
            let mut sums = Sums::of(simd, own, scale);
            sums.add(simd, EAST, here.beside(simd, x, aside));
            sums.add(simd, SOUTH, below.beside(simd, x, 0));
            sums.add(simd, WEST, here.beside(simd, x, -aside));
            sums.add(simd, NORTH, above.beside(simd, x, 0));
            let mut means = sums.means(simd);
            let is_hole = own.channels[3].simd_lt(f32x8::splat(simd, 0.0));
            if HAS_ALBEDO && is_hole.any_true() {
                let taps = [
                    here.beside(simd, x, aside).words(),
                    below.beside(simd, x, 0).words(),
                    here.beside(simd, x, -aside).words(),
                    above.beside(simd, x, 0).words(),
                ];
                let filled = fill_albedos(own.words(), &taps, means.reach.to_array());
                means.reach = u32x8::load_array(simd, filled);
            }
            to.store(x, means);
        }
    }
}

/// Eight pixels of an image between levels.
#[derive(Clone, Copy)]
struct Pixels<S: Simd> {
    channels: [f32x8<S>; 4],
    reach: u32x8<S>,
}

impl<S: Simd> Pixels<S> {
    /// Variances and bits.
    #[inline(always)]
    fn words(self) -> ([f32; LANES], [u32; LANES]) {
        (self.channels[3].to_array(), self.reach.to_array())
    }
}

/// Weighted sums over the taps of eight pixels.
struct Sums<S: Simd> {
    own: Pixels<S>,
    /// By what squared differences are multiplied, to be 1 at the tolerance.
    scale: f32x8<S>,
    channels: [f32x8<S>; 4],
    weights: f32x8<S>,
    reach: u32x8<S>,
}

impl<S: Simd> Sums<S> {
    /// With the pixels' own colours, if they are not holes.
    #[inline(always)]
    fn of(simd: S, own: Pixels<S>, scale: f32) -> Self {
        let splat = |number: f32| f32x8::splat(simd, number);
        let [r, g, b, variance] = own.channels;
        let is_hole = variance.simd_lt(splat(0.0));
        let weights = is_hole.select(splat(0.0), splat(OWN_WEIGHT));
        Self {
            own,
            // A hole takes any colour.
            scale: is_hole.select(splat(0.0), splat(scale) / variance.max_precise(splat(LEAST_VARIANCE))),
            channels: [weights * r, weights * g, weights * b, weights * weights * variance],
            weights,
            reach: own.reach & ALBEDO_BITS,
        }
    }

    /// Adds the taps in direction `d`.
    #[inline(always)]
    fn add(&mut self, simd: S, d: usize, tap: Pixels<S>) {
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let ([own_r, own_g, own_b, _], [r, g, b, variance]) = (self.own.channels, tap.channels);
        let aside = [(r - own_r).abs(), (g - own_g).abs(), (b - own_b).abs()];
        let difference = luminances(simd, aside);
        let like = one - difference * difference * self.scale;
        let like = like.simd_gt(zero).select(like, zero);
        // A tap counts if it can be reached, and is no hole.
        let counts = (self.own.reach >> d as u32) & !(variance.to_bits() >> 31);
        let weight = f32x8::from_bits(if_odd(simd, counts, (like * like).to_bits()));
        self.channels[0] += weight * r;
        self.channels[1] += weight * g;
        self.channels[2] += weight * b;
        self.channels[3] += weight * weight * variance;
        self.weights += weight;
        self.reach |= self.own.reach & tap.reach & (1 << d);
    }

    /// The means. A hole that reaches no colour keeps its own.
    #[inline(always)]
    fn means(self, simd: S) -> Pixels<S> {
        let is_colored = self.weights.simd_gt(f32x8::splat(simd, 0.0));
        let mut channels = self.own.channels;
        for (channel, sum) in channels[..3].iter_mut().zip(self.channels) {
            *channel = is_colored.select(sum / self.weights, *channel);
        }
        let variance = self.channels[3] / (self.weights * self.weights);
        channels[3] = is_colored.select(variance, f32x8::splat(simd, UNKNOWN));
        Pixels { channels, reach: self.reach }
    }
}

/// The bits of eight pixels after a level, `to`, with the albedos of those that were holes: the mean of those of the taps,
/// all of which count alike. Variances and bits before the level are given.
#[cold]
#[inline(never)]
fn fill_albedos(
    (variance, reach): ([f32; LANES], [u32; LANES]),
    taps: &[([f32; LANES], [u32; LANES]); 4],
    mut to: [u32; LANES],
) -> [u32; LANES] {
    for lane in (0..LANES).filter(|&lane| variance[lane] < 0.0) {
        let (mut sum, mut count) = (Vec3::ZERO, 0.0);
        for (d, (variance, bits)) in SIDES.into_iter().zip(taps) {
            if reach[lane] >> d & 1 != 0 && variance[lane] >= 0.0 {
                sum += Vec3::from(decode_albedo(bits[lane] >> ALBEDO_SHIFT));
                count += 1.0;
            }
        }
        if count > 0.0 {
            to[lane] |= encode_albedo(sum / count) << ALBEDO_SHIFT;
        }
    }
    to
}

impl RowMut<'_> {
    /// Writes eight pixels from column `x` on, or as many as there are.
    #[inline(always)]
    fn store<S: Simd>(&mut self, x: usize, Pixels { channels, reach }: Pixels<S>) {
        for (plane, lanes) in self.channels.iter_mut().zip(channels) {
            let count = LANES.min(plane.len() - x);
            store(&lanes.to_array(), &mut plane[x..][..count]);
        }
        let count = LANES.min(self.reach.len() - x);
        store(&reach.to_array(), &mut self.reach[x..][..count]);
    }
}

impl Row<'_> {
    /// The pixels `dx` columns to the right of the eight from column `x` on; zeros outside.
    #[inline(always)]
    fn beside<S: Simd>(&self, simd: S, x: usize, dx: isize) -> Pixels<S> {
        let [r, g, b, variance] = self.channels;
        let of = [
            lanes_beside(simd, r, x, dx),
            lanes_beside(simd, g, x, dx),
            lanes_beside(simd, b, x, dx),
            lanes_beside(simd, variance, x, dx),
        ];
        Pixels { channels: of, reach: lanes_beside(simd, self.reach, x, dx) }
    }

    /// The colours, with the alpha of `color`.
    #[inline(always)]
    fn interleave<S: Simd>(&self, simd: S, color: &[[f32; 4]], has_albedo: bool, to: &mut [[f32; 4]]) {
        for x in (0..to.len()).step_by(LANES) {
            let Pixels { channels: [mut r, mut g, mut b, _], reach } = self.beside(simd, x, 0);
            if has_albedo {
                let albedo = albedo_of(simd, reach >> ALBEDO_SHIFT);
                [r, g, b] = [r * albedo[0], g * albedo[1], b * albedo[2]];
            }
            let [.., alpha] = load_transposed(simd, &padded(color, x));
            let count = LANES.min(to.len() - x);
            store_vectors(simd, [r, g, b, alpha], &mut to[x..][..count]);
        }
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::{
        albedo::PLAIN,
        edge_pixel::DIRECTIONS,
        testing::{Random, run_alike, run_both, run_cpu, settings},
    };

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
        harness.set("albedo", &vec![PLAIN; color.len()]);
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
        albedo: &[u32],
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
        let mut albedos: Vec<[f64; 3]> =
            albedo.iter().map(|&code| decode_albedo(code).map(f64::from)).collect();
        (0..albedos.len()).filter(|&at| variance[at] < 0.0).for_each(|at| albedos[at] = [1.0; 3]);
        let light = |at: usize| [0, 1, 2].map(|channel| f64::from(color[at][channel]) / albedos[at][channel]);
        let mut colors: Vec<[f64; 3]> = (0..color.len()).map(light).collect();
        let variance = |at: usize| {
            let [r, g, b] = albedos[at];
            f64::from(variance[at]) / (0.2126 * r + 0.7152 * g + 0.0722 * b).powi(2)
        };
        let smoothed = pixels().map(|pixel| {
            let own = variance(index(pixel));
            if own < 0.0 {
                return None;
            }
            let taps = SIDES.into_iter().filter_map(|d| Some((1.0, variance(index(walk(pixel, d, 1)?)))));
            let taps = taps.filter(|tap| tap.1 >= 0.0).chain([(2.0, own)]);
            let (weights, sum) = taps.fold((0.0, 0.0), |sums, tap| (sums.0 + tap.0, sums.1 + tap.0 * tap.1));
            Some(sum / weights)
        });
        let mut variances: Vec<Option<f64>> = smoothed.collect();
        for level in 0..params.levels {
            let before = albedos.clone();
            for pixel in pixels().filter(|&pixel| variances[index(pixel)].is_none()) {
                let taps = SIDES.into_iter().filter_map(|d| walk(pixel, d, 1 << level));
                let taps: Vec<usize> = taps.map(index).filter(|&tap| variances[tap].is_some()).collect();
                if !taps.is_empty() {
                    let mean = |channel: usize| taps.iter().map(|&tap| before[tap][channel]).sum::<f64>();
                    albedos[index(pixel)] = [0, 1, 2].map(|channel| mean(channel) / taps.len() as f64);
                }
            }
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
        let shown = colors.iter().zip(&albedos);
        shown.map(|(color, albedo)| [0, 1, 2].map(|channel| color[channel] * albedo[channel])).collect()
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

    /// A texture under even light, with noise: the light becomes even, and the texture stays. Holes show the mean of what
    /// joins them, not the light of one albedo under another.
    #[test]
    fn textures_stay_and_holes_show_those_around() {
        let mut random = Random(9);
        let size = [50, 40];
        let codes = [0x60_40FF, 0xF0_C080];
        // Columns in pairs; holes in a block.
        let code = |p: usize| codes[p % 50 / 2 % 2];
        let is_hole = |p: usize| (20..26).contains(&(p % 50)) && (10..16).contains(&(p / 50));
        let albedo: Vec<u32> = (0..2000).map(|p| if is_hole(p) { NO_ALBEDO } else { code(p) }).collect();
        let color: Vec<[f32; 4]> = (0..2000)
            .map(|p| {
                let noise = random.between(0.5, 1.5);
                let [r, g, b] = decode_albedo(code(p)).map(|share| share * noise);
                if is_hole(p) { [9.0, 9.0, 9.0, 1.0] } else { [r, g, b, 1.0] }
            })
            .collect();
        let variance: Vec<f32> = (0..2000)
            .map(|p| {
                let [r, g, b] = decode_albedo(code(p));
                let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
                if is_hole(p) { UNKNOWN } else { luminance * luminance / 12.0 }
            })
            .collect();
        let n8 = reach(size, |_, _| true);
        let mut harness = harness(AtrousParams::default(), size, &color, &variance, &n8);
        harness.set("albedo", &albedo);
        let both = run_both(&mut harness);
        let [first, second] = codes.map(decode_albedo);
        for out in [&both.cpu, &both.gpu] {
            for (p, filtered) in out.get::<[f32; 4]>("filtered").into_iter().enumerate() {
                for channel in 0..3 {
                    let (low, high) =
                        (first[channel].min(second[channel]), first[channel].max(second[channel]));
                    let expected = decode_albedo(code(p))[channel];
                    let is_near = if is_hole(p) {
                        (0.9 * low..1.1 * high).contains(&filtered[channel])
                    } else {
                        (filtered[channel] / expected - 1.0).abs() < 0.1
                    };
                    assert!(is_near, "{p}: {filtered:?}, of {first:?} and {second:?}");
                }
            }
        }
    }

    #[test]
    fn an_unknown_albedo_counts_as_1() {
        let (size, color, n8) = walled(&mut Random(8));
        let mut harness = harness(AtrousParams::default(), size, &color, &[1.0 / 3.0; 2000], &n8);
        let plain = run_both(&mut harness);
        harness.set("albedo", &[NO_ALBEDO; 2000]);
        let unknown = run_both(&mut harness);
        for [plain, unknown] in [[&plain.cpu, &unknown.cpu], [&plain.gpu, &unknown.gpu]] {
            assert!(plain.get::<[f32; 4]>("filtered") == unknown.get::<[f32; 4]>("filtered"));
        }
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
            let plain = vec![PLAIN; count];
            let textured: Vec<_> = (0..count).map(|_| random.bits() & 0xFF_FFFF | 0x40_4040).collect();
            for albedo in [plain, textured] {
                let mut harness = harness(params.clone(), size, &color, &variance, &n8);
                harness.set("albedo", &albedo);
                let both = run_both(&mut harness);
                let is_plain = albedo.iter().all(|&code| code == PLAIN);
                if is_plain {
                    both.assert_close("filtered", 1e-5);
                }
                let expected = rule(&params, size, &color, &variance, &n8, &albedo);
                for out in [&both.cpu, &both.gpu] {
                    for (at, (got, expected)) in
                        out.get::<[f32; 4]>("filtered").iter().zip(&expected).enumerate()
                    {
                        // Holes have the albedos of others in 8 bits of the root.
                        let bound = |expected: f64| match is_plain {
                            true => 1e-5,
                            false if variance[at] < 0.0 => 0.02 * (1.0 + expected),
                            false => 1e-5 * (1.0 + expected),
                        };
                        for channel in 0..3 {
                            let error = (f64::from(got[channel]) - expected[channel]).abs();
                            assert!(error < bound(expected[channel]), "{got:?} {expected:?} at {size:?}");
                        }
                    }
                }
            }
        }
    }
}
