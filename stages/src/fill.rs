//! Colours every pixel from the points near it, and computes how much a new sample there is worth
//! (`algorithms.md` sections 1.4, 1.6 and 11.2).
//!
//! Colour: the weighted mean of the 3x3 pixels that show a point, weights 4 for the centre, 2 for edges, 1 for corners;
//! if none does, the plain mean of the 7x7, unless `wide` is off; if that is empty too, last frame's colour or black. The
//! mean is of linear radiance, which measured better than tone-mapped.

use epigraph_core::{
    Access, CpuContext, Extent, Finding, In, Io, Out, Site, Stage, choice, constants, params, texel,
};
use fearless_simd::{Simd, dispatch, f32x8, i32x8, prelude::*, u32x8};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{ID, POINTS, PRIORITY, RADIANCE},
    shared::{
        cloud::{AGE, AGE_ONE, NO_POINT, gather, radiance_of},
        lanes::{LANES, bits, load_transposed, padded, store, store_vectors},
    },
};

#[path = "explain/fill.rs"]
mod explain;

constants! {
    /// Sum of the weights of the 3x3 pixels.
    const WEIGHTS_SUM: u32 = 16;
    /// Pixels to each side of the centre of the wide kernel.
    const REACH: usize = 3;
}

/// Pixels of a row that are processed together.
const BLOCK: usize = 64;

choice! {
    /// What a pixel without any point within the kernel shows.
    pub enum Empty {
        /// The colour of the frame before.
        Hold,
        /// Black.
        Clear,
    }
}

choice! {
    /// How the priority of a pixel depends on its surroundings.
    pub enum Priority {
        /// Pixels without a point: 255 (1 - w)^6, where w is the present share of the kernel's weight; others: half the
        /// point's age. The best of the measured rules.
        Measured,
        /// Pixels without a point: 255 (1 - w); others: the point's age, at most 254.
        Classic,
    }
}

params! {
    /// Parameters of [`Fill`].
    pub struct FillParams {
        /// What a pixel without any point within the kernel shows.
        empty: Empty = Empty::Hold;
        /// Show the points as they are, and mix colours only in pixels without a point. Sharper and noisier: measured
        /// at 5%, mean FLIP is 5 to 12% lower on the Cornell box and 2 to 4% higher on the room with its noisier light.
        keep_points: bool = false;
        /// Fill pixels whose 3x3 pixels show no point from the 7x7. Without it, dense points keep narrower outlines.
        wide: bool = true;
        /// How the priority of a pixel depends on its surroundings.
        priority: Priority = Priority::Measured;
    }
}

/// See the module.
pub struct Fill {
    radiance: In<u32>,
    meta: In<u32>,
    id: In<u32>,
    previous: In<texel::Rgba32Float>,
    points: Out<[f32; 4]>,
    color: Out<texel::Rgba32Float>,
    priority: Out<u32>,
}

impl Stage for Fill {
    const KIND: &'static str = "fill";
    const DOC: &'static str =
        "Colours every pixel from the points near it; computes where new samples are worth most.";
    type Params = FillParams;

    fn declare(_: &FillParams, io: &mut Io) -> Self {
        io.column(column::I2);
        let mut cloud = io.bundle(Access::Read, "cloud", POINTS, Extent::Any);
        let (radiance, meta) = (cloud.read("radiance"), cloud.read("meta"));
        let pixels = || Extent::Frame(1);
        let id = io.read("id", ID, pixels());
        let previous = io.history("previous", RADIANCE.doc("The colours of the frame before."), pixels());
        let points =
            io.write("points", RADIANCE.doc("The point's radiance and 1, or zeros.").scratch(), pixels());
        let color = io.write("color", RADIANCE.doc("Linear radiance; alpha 1."), pixels());
        let priority = io.write("priority", PRIORITY, pixels());
        io.shader(shader!("fill"));
        io.constants(CONSTANTS);
        io.dispatch("gather", points);
        io.dispatch("fill", color);
        // Held colours are held again.
        io.per_change([radiance.into(), meta.into(), id.into(), previous.into()]);
        Self { radiance, meta, id, previous, points, color, priority }
    }

    fn cpu(&self, params: &FillParams, cx: &CpuContext) -> Result<(), String> {
        let (width, height) = (cx.dims(self.color).width as usize, cx.dims(self.color).height as usize);
        let (radiance, meta) = (&cx.read(self.radiance)[..], &cx.read(self.meta)[..]);
        let (id, previous) = (&cx.read(self.id)[..], &cx.read(self.previous)[..]);
        let points = &mut cx.write(self.points)[..];
        let (color, priority) = (&mut cx.write(self.color)[..], &mut cx.write(self.priority)[..]);

        let level = cx.level();
        let rows = points.par_chunks_mut(width).zip(priority.par_chunks_mut(width)).zip(id.par_chunks(width));
        rows.for_each(|((points, priority), id)| {
            let cloud = Cloud { radiance, meta, rule: params.priority };
            dispatch!(level, simd => cloud.gather(simd, id, points, priority));
        });

        let image = Image { texels: points, id, previous, width, height };
        let rows = color.par_chunks_mut(width).zip(priority.par_chunks_mut(width));
        rows.enumerate().for_each(|(y, (color, priority))| {
            dispatch!(level, simd => image.fill_row(simd, params, y, color, priority));
        });
        Ok(())
    }

    fn explain(&self, params: &FillParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// What is known of points.
struct Cloud<'a> {
    radiance: &'a [u32],
    meta: &'a [u32],
    rule: Priority,
}

impl Cloud<'_> {
    /// Writes for each pixel of a row the radiance of the point that it shows and 1, and its priority, or zeros.
    #[inline(always)]
    fn gather<S: Simd>(&self, simd: S, id: &[u32], points: &mut [[f32; 4]], priority: &mut [u32]) {
        let (mut radiance, mut meta) = ([0; BLOCK], [0; BLOCK]);
        let blocks = id.chunks(BLOCK).zip(points.chunks_mut(BLOCK)).zip(priority.chunks_mut(BLOCK));
        for ((id, points), priority) in blocks {
            gather(self.radiance, id, &mut radiance);
            gather(self.meta, id, &mut meta);
            for first in (0..id.len()).step_by(LANES) {
                let at = |plane: &[u32; BLOCK]| u32x8::from_slice(simd, &plane[first..][..LANES]);
                // 0xFFFFFFFF, for none, is not a point's id.
                let point = u32x8::load_array(simd, padded(id, first));
                let there = bits(simd, point.simd_lt(u32x8::splat(simd, self.radiance.len() as u32)));
                let [r, g, b] = radiance_of(simd, at(&radiance))
                    .map(|channel| f32x8::from_bits(channel.to_bits() & there));
                let alpha = f32x8::from_bits(u32x8::splat(simd, 1f32.to_bits()) & there);
                let by_age = with_points(simd, self.rule, at(&meta) & AGE);
                let count = LANES.min(id.len() - first);
                store_vectors(simd, [r, g, b, alpha], &mut points[first..][..count]);
                store(&(by_age & there).to_array(), &mut priority[first..][..count]);
            }
        }
    }
}

/// Priority of a pixel that shows a point of this age, in 8.8 fixed point.
pub(crate) fn with_point(rule: Priority, age: u32) -> u32 {
    match rule {
        Priority::Measured => age / (2 * AGE_ONE),
        Priority::Classic => (age / AGE_ONE).min(254),
    }
}

/// Priority of a pixel without a point whose neighbours weigh `weight` of [`WEIGHTS_SUM`].
#[cfg(test)]
fn without_point(rule: Priority, weight: u32) -> u32 {
    let missing = WEIGHTS_SUM - weight;
    match rule {
        // In whole numbers: 255 * (missing / 16)^6, rounded to the nearest.
        Priority::Measured => (255 * missing.pow(6) + (1 << 23)) >> 24,
        Priority::Classic => 255 * missing / WEIGHTS_SUM,
    }
}

/// [`with_point`] of eight pixels.
#[inline(always)]
pub(crate) fn with_points<S: Simd>(simd: S, rule: Priority, age: u32x8<S>) -> u32x8<S> {
    let years = age >> AGE_ONE.trailing_zeros();
    match rule {
        Priority::Measured => years >> 1,
        Priority::Classic => {
            let most = u32x8::splat(simd, 254);
            years.simd_lt(most).select(years, most)
        }
    }
}

/// `without_point` of eight pixels.
#[inline(always)]
fn without_points<S: Simd>(simd: S, rule: Priority, weight: u32x8<S>) -> u32x8<S> {
    let missing = u32x8::splat(simd, WEIGHTS_SUM) - weight;
    let scaled = u32x8::splat(simd, 255);
    match rule {
        Priority::Measured => {
            let cube = missing * missing * missing;
            (scaled * (cube * cube) + u32x8::splat(simd, 1 << 23)) >> 24
        }
        Priority::Classic => (scaled * missing) >> WEIGHTS_SUM.trailing_zeros(),
    }
}

/// Colours with weight 1, or zeros.
struct Image<'a> {
    texels: &'a [[f32; 4]],
    id: &'a [u32],
    previous: &'a [[f32; 4]],
    width: usize,
    height: usize,
}

impl Image<'_> {
    /// Fills row `y`; gives priorities to its pixels without a point.
    #[inline(always)]
    fn fill_row<S: Simd>(
        &self,
        simd: S,
        params: &FillParams,
        y: usize,
        color: &mut [[f32; 4]],
        priority: &mut [u32],
    ) {
        for left in (0..self.width).step_by(BLOCK) {
            let near = self.near(left, y);
            let count = BLOCK.min(self.width - left);
            for first in (0..count).step_by(LANES) {
                let x = left + first;
                let count = LANES.min(count - first);
                let near: &[[f32; 4]; LANES] = near[first..].first_chunk().expect("a block has whole groups");
                let [r, g, b, weight] = load_transposed(simd, near);
                let color = &mut color[x..][..count];
                let is_near = weight.simd_gt(f32x8::splat(simd, 0.0));
                if is_near.all_true() && !params.keep_points {
                    let one = f32x8::splat(simd, 1.0);
                    store_vectors(simd, [r / weight, g / weight, b / weight, one], color);
                } else {
                    for (lane, color) in color.iter_mut().enumerate() {
                        *color = self.color(params, [x + lane, y], near[lane]);
                    }
                }
                let point = u32x8::load_array(simd, padded(&self.id[y * self.width..][..self.width], x));
                let has_point = point.simd_ne(u32x8::splat(simd, NO_POINT));
                let priority = &mut priority[x..][..count];
                let with_point = u32x8::load_array(simd, padded(priority, 0));
                let without_point =
                    without_points(simd, params.priority, weight.to_int::<i32x8<S>>().bitcast());
                store(&has_point.select(with_point, without_point).to_array(), priority);
            }
        }
    }

    /// The colour of a pixel from its weighted 3x3 pixels.
    fn color(&self, params: &FillParams, [x, y]: [usize; 2], near: [f32; 4]) -> [f32; 4] {
        let at = y * self.width + x;
        let own = self.texels[at];
        let [r, g, b, weight] = if own[3] > 0.0 && params.keep_points {
            own
        } else if near[3] > 0.0 || !params.wide {
            near
        } else {
            self.sum_7x7(x, y)
        };
        match params.empty {
            _ if weight > 0.0 => [r / weight, g / weight, b / weight, 1.0],
            Empty::Hold => self.previous[at],
            Empty::Clear => [0.0, 0.0, 0.0, 1.0],
        }
    }

    /// The weighted sums of the 3x3 pixels around each pixel of a row from column `left` on. Each column is summed from
    /// above, weighted 1, 2 and 1; three such columns, weighted likewise, make the weights 4 for the centre, 2 for edges,
    /// 1 for corners.
    #[inline(always)]
    fn near(&self, left: usize, y: usize) -> [[f32; 4]; BLOCK] {
        let (from, to) = (left.saturating_sub(1), (left + BLOCK + 1).min(self.width));
        let row = |y: usize| {
            let inside = y < self.height;
            if inside {
                &self.texels[y * self.width..][from..to]
            } else {
                &[[0.0; 4]; BLOCK + 2][..to - from]
            }
        };
        let [above, own, below] = [row(y.wrapping_sub(1)), row(y), row(y + 1)].map(|row| row.as_flattened());
        let mut columns = [[0.0; 4]; BLOCK + 2];
        let inside = columns[from + 1 - left..to + 1 - left].as_flattened_mut();
        for (((column, above), own), below) in inside.iter_mut().zip(above).zip(own).zip(below) {
            *column = above + own * 2.0 + below;
        }
        let mut near = [[0.0; 4]; BLOCK];
        let columns = columns.as_flattened();
        let sides = columns.iter().zip(&columns[4..]).zip(&columns[8..]);
        for (near, ((left, own), right)) in near.as_flattened_mut().iter_mut().zip(sides) {
            *near = left + own * 2.0 + right;
        }
        near
    }

    /// The sum of the 7x7 texels around (x, y).
    fn sum_7x7(&self, x: usize, y: usize) -> [f32; 4] {
        let mut sum = [0.0; 4];
        for y in y.saturating_sub(REACH)..(y + REACH + 1).min(self.height) {
            let row = &self.texels[y * self.width..][..self.width];
            for &texel in &row[x.saturating_sub(REACH)..(x + REACH + 1).min(self.width)] {
                sum = add(sum, texel);
            }
        }
        sum
    }
}

#[inline(always)]
fn add(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|lane| a[lane] + b[lane])
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;
    use fearless_simd::Level;

    use super::*;
    use crate::shared::{
        cloud::{LIVE, NO_POINT, encode_radiance},
        testing::{Random, run_alike, run_both, settings},
    };

    const HELD: [f32; 4] = [0.25, 0.5, 0.75, 1.0];

    fn harness(params: FillParams, size: [u32; 2], id: &[u32], points: &[([f32; 3], u32)]) -> Harness<Fill> {
        let mut harness = Harness::new(params, &settings(size, 0));
        harness
            .set("cloud.radiance", &points.iter().map(|point| encode_radiance(point.0)).collect::<Vec<_>>());
        harness.set("cloud.meta", &points.iter().map(|point| point.1 | LIVE).collect::<Vec<_>>());
        harness.set("id", id);
        harness.set("previous", &vec![HELD; id.len()]);
        harness
    }

    /// An image of `size` with the given pixels and the points that they show.
    fn image(size: [u32; 2], points: &[(usize, u32)]) -> Vec<u32> {
        let mut id = vec![NO_POINT; (size[0] * size[1]) as usize];
        points.iter().for_each(|&(pixel, point)| id[pixel] = point);
        id
    }

    #[test]
    fn weights_are_four_two_one() {
        // Red in the middle, green to the right, blue in the lower left corner of 3x3.
        let points = [([1.0, 0.0, 0.0], 0), ([0.0, 1.0, 0.0], 0), ([0.0, 0.0, 1.0], 0)];
        let id = image([3, 3], &[(4, 0), (5, 1), (6, 2)]);
        let color =
            run_alike(&mut harness(FillParams::default(), [3, 3], &id, &points)).get::<[f32; 4]>("color");
        assert_eq!(color[4], [4.0 / 7.0, 2.0 / 7.0, 1.0 / 7.0, 1.0]);
        // In the pixel above the middle, red has weight 2 and green 1.
        assert_eq!(color[1], [2.0 / 3.0, 1.0 / 3.0, 0.0, 1.0]);
        assert_eq!(color[2], [1.0 / 3.0, 2.0 / 3.0, 0.0, 1.0]);
    }

    #[test]
    fn points_can_be_kept() {
        let points = [([1.0, 0.0, 0.0], 0), ([0.0, 1.0, 0.0], 0)];
        let params = FillParams { keep_points: true, ..FillParams::default() };
        let mut harness = harness(params, [3, 1], &image([3, 1], &[(0, 0), (1, 1)]), &points);
        let color = run_alike(&mut harness).get::<[f32; 4]>("color");
        assert_eq!(color, [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]]);
    }

    #[test]
    fn the_wide_kernel_is_used_only_if_the_3x3_pixels_are_empty() {
        // A row of nine pixels: a red point in the first, a green one in the fifth.
        let points = [([1.0, 0.0, 0.0], 0), ([0.0, 1.0, 0.0], 0)];
        let id = image([9, 1], &[(0, 0), (4, 1)]);
        for (empty, last) in [(Empty::Hold, HELD), (Empty::Clear, [0.0, 0.0, 0.0, 1.0])] {
            let params = FillParams { empty, ..FillParams::default() };
            let out = run_alike(&mut harness(params, [9, 1], &id, &points));
            let (color, priority) = (out.get::<[f32; 4]>("color"), out.get::<u32>("priority"));
            assert_eq!(color[1], [1.0, 0.0, 0.0, 1.0]);
            assert_eq!(color[2], [0.5, 0.5, 0.0, 1.0]);
            assert_eq!(color[6], [0.0, 1.0, 0.0, 1.0]);
            assert_eq!(color[8], last);
            // The wide kernel does not affect priorities.
            assert_eq!([priority[2], priority[6], priority[8]], [255; 3]);

            let params = FillParams { empty, wide: false, ..FillParams::default() };
            let color = run_alike(&mut harness(params, [9, 1], &id, &points)).get::<[f32; 4]>("color");
            assert_eq!([color[1], color[2], color[6]], [[1.0, 0.0, 0.0, 1.0], last, last]);
        }
    }

    #[test]
    fn classic_priorities() {
        // algorithms.md section 1.6: w = 12, 1 and 0.
        let of = |weight| without_point(Priority::Classic, weight);
        assert_eq!([of(12), of(1), of(0)], [63, 239, 255]);
        let of = |age| with_point(Priority::Classic, age);
        assert_eq!([of(0), of(100 * AGE_ONE + 255), of(AGE)], [0, 100, 254]);
    }

    #[test]
    fn measured_priorities() {
        // algorithms.md section 11.2: 255 (1 - w)^6.
        let of = |weight| without_point(Priority::Measured, weight);
        assert_eq!(of(0), 255);
        for weight in 0..=12 {
            let exact = 255.0 * (1.0 - f64::from(weight) / 16.0).powi(6);
            assert_eq!(of(weight), exact.round() as u32, "{weight}");
        }
        let of = |age| with_point(Priority::Measured, age);
        assert_eq!([of(0), of(100 * AGE_ONE), of(AGE)], [0, 50, 127]);
    }

    #[test]
    fn priorities_of_eight_pixels_are_those_of_each() {
        for rule in [Priority::Measured, Priority::Classic] {
            dispatch!(Level::new(), simd => {
                // Every weight of neighbours, at most 12, and every age.
                for first in (0..WEIGHTS_SUM).step_by(LANES) {
                    let weights: [u32; LANES] = std::array::from_fn(|lane| first + lane as u32);
                    let found = without_points(simd, rule, u32x8::load_array(simd, weights)).to_array();
                    assert_eq!(found, weights.map(|weight| without_point(rule, weight)), "{weights:?}");
                }
                for first in (0..=AGE).step_by(LANES) {
                    let ages: [u32; LANES] = std::array::from_fn(|lane| first + lane as u32);
                    let found = with_points(simd, rule, u32x8::load_array(simd, ages)).to_array();
                    assert_eq!(found, ages.map(|age| with_point(rule, age)), "{ages:?}");
                }
            });
        }
    }

    #[test]
    fn priorities_of_an_image() {
        let points = [([1.0; 3], 80 * AGE_ONE)];
        let mut harness = harness(FillParams::default(), [4, 1], &image([4, 1], &[(0, 0)]), &points);
        // Beside the point, w is 2 of 16: 255 (14 / 16)^6 = 114.4.
        assert_eq!(run_alike(&mut harness).get::<u32>("priority"), [40, 114, 255, 255]);
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(11);
        let points: Vec<([f32; 3], u32)> =
            (0..500).map(|_| ([0; 3].map(|_| random.between(0.0, 1.0)), random.below(AGE + 1))).collect();
        let size = [53, 41];
        // Dense on the left and sparse on the right, so that all three ways of filling occur.
        let id: Vec<u32> = (0..size[0] * size[1])
            .map(|p| if random.below(1 + (p % 53) * 8) < 4 { random.below(500) } else { NO_POINT })
            .collect();
        for (empty, keep_points) in [(Empty::Hold, false), (Empty::Clear, false), (Empty::Clear, true)] {
            for priority in [Priority::Measured, Priority::Classic] {
                let params = FillParams { empty, keep_points, priority, wide: !keep_points };
                let both = run_both(&mut harness(params, size, &id, &points));
                both.assert_equal::<u32>("priority");
                // The colours are sums of up to 49 numbers below 1, and a division.
                both.assert_close("color", 1e-6);
                let color = both.cpu.get::<[f32; 4]>("color");
                assert!(color.contains(&if empty == Empty::Hold { HELD } else { [0.0, 0.0, 0.0, 1.0] }));
            }
        }
    }
}
