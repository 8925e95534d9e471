//! Colours every pixel from the samples in its 5x5 pixels that are on the same side of all edges, and computes how much
//! a new sample there is worth (`algorithms.md` sections 1.6, 2.7 and 11.2).
//!
//! The colour is that of the pixel's primary region. It is the mean of the pixel's own sample and the samples that the
//! primary region reaches according to `r24`. A complex pixel, whose regions are unknown, takes all samples around it.
//! Weights depend on the distance from the pixel's centre to the sample's actual position in its pixel; the papers'
//! fixed kernel is the alternative.
//!
//! Weights are whole numbers, and small enough that their sums are exact in any order: both sides compute the same
//! priorities, and so request the same samples. Only the colours are rounded.
//!
//! Alpha is the sum of the weights, relative to that of a sample in the centre of each of the 25 pixels. Alpha 0 means
//! that no sample could be reached: the colour is black, and `spread` has to find one.

use epigraph_core::{
    Access, CpuContext, Extent, Finding, In, Io, Out, Site, Stage, View, choice, constants, params, texel,
};
use fearless_simd::{Simd, dispatch, f32x8, i32x8, prelude::*, u32x8};
use rayon::{iter::Either, prelude::*};

pub use crate::fill::Priority;
use crate::{
    column,
    fill::with_points,
    meaning::{self, ALBEDO_CODE, CELL, ID, POINT_ALBEDOS, POINTS, PRIORITY, RADIANCE, VARIANCE},
    shared::{
        albedo::{NO_ALBEDO, code_of, unpack_mean},
        cloud::{AGE, NO_POINT, decode_radiance, gather, radiance_of},
        color::{luminance, luminances},
        edge_pixel::{CLASS, COMPLEX},
        estimate::{shown_variance, shown_variance_of},
        lanes::{LANES, bits, if_odd, lesser, load_transposed, look_up, padded, store, store_vectors},
        requests::UNKNOWN,
    },
};

#[path = "explain/interpolate.rs"]
mod explain;

constants! {
    /// Radius of the kernel in pixels.
    const REACH: usize = 2;
    /// Width of the kernel in pixels.
    const SPAN: usize = 2 * REACH + 1;
    /// The sum of the weights of five samples in the centres of their pixels along an axis, up to rounding. Samples at
    /// their nearest possible positions weigh at most 1.5 times as much: a sum of products stays below 2^24.
    const AXIS: f32 = 2048.0;
    /// The sum of all 25 weights of samples in the centres.
    const FULL: f32 = AXIS * AXIS;
    /// The samples around a pixel tell their variance if no single one has nearly all of the weight.
    const LEAST_SHARE: f32 = 0.05;
    /// Sixteenths of a priority for each unit of uncertainty, and the fewest and the most.
    const UNCERTAINTY_GAIN: f32 = 30.0;
    const LEAST_UNCERTAINTY: f32 = 4.0;
    const MOST_UNCERTAINTY: f32 = 64.0;
    /// The bits of all 25 pixels of the kernel.
    const ALL: u32 = 0x1FF_FFFF;
}

/// Rows per parallel task on the CPU.
const BAND: usize = 32;
/// Columns that a task processes at a time.
const TILE: usize = 64;

choice! {
    /// How the weight of a sample depends on its position.
    pub enum Kernel {
        /// A Gaussian of the distance to the sample's position in its pixel.
        Gaussian,
        /// The papers' kind of kernel: 1, 4, 6, 4, 1 along each axis, regardless of the position in the pixel.
        Binomial,
    }
}

choice! {
    /// What is averaged.
    pub enum Space {
        /// Linear radiance. Measured best.
        Linear,
        /// Radiance divided by 1 + luminance, so that a bright sample does not outshine all others.
        ToneMapped,
    }
}

params! {
    /// Parameters of [`Interpolate`].
    pub struct InterpolateParams {
        /// How the weight of a sample depends on its position.
        kernel: Kernel = Kernel::Gaussian;
        /// Standard deviation of the Gaussian. Between 0.6, which keeps detail, and 0.8, which hides noise.
        sigma: f32 = 0.7, in 0.3..=2.0, unit "px";
        /// Bits of the cells in `subpixel`, as in `project`.
        subpixel_bits: u32 = 8, in 2..=8, unit "bits";
        /// What is averaged.
        space: Space = Space::Linear;
        /// How the priority of a pixel depends on its surroundings.
        priority: Priority = Priority::Measured;
        /// Whether to write the variance of colours, for filters. The cloud must keep means: see `point_cloud`.
        variance: bool = false;
        /// Whether priorities grow with the uncertainty of colours: by the differences between the samples around the pixel,
        /// the noise of its own point, and what that point may change with the view. The cloud must keep means.
        uncertain: bool = false;
    }
}

/// See the module.
pub struct Interpolate {
    radiance: In<u32>,
    meta: In<u32>,
    id: In<u32>,
    cls: In<u32>,
    r24: In<u32>,
    subpixel: In<u32>,
    color: Out<texel::Rgba32Float>,
    priority: Out<u32>,
    noise: Option<Noise>,
    pattern: Option<Pattern>,
}

/// The albedos of points, and the means of those around each pixel.
#[derive(Clone, Copy)]
struct Pattern {
    albedos: In<[u32; 2]>,
    albedo: Out<u32>,
}

/// What is needed to know how noisy colours are.
#[derive(Clone, Copy)]
struct Noise {
    mean: In<[f32; 4]>,
    variance: Option<Out<f32>>,
    /// What else is known of points, if priorities depend on it.
    record: Option<In<[f32; 4]>>,
}

impl Stage for Interpolate {
    const KIND: &'static str = "interpolate";
    const DOC: &'static str = "Colours every pixel from the samples around it that no edge separates from it; \
                                computes where new ones are worth most.";
    type Params = InterpolateParams;

    fn declare(params: &InterpolateParams, io: &mut Io) -> Self {
        io.column(column::I2);
        io.per_view();
        let mut cloud = io.bundle(Access::Read, "cloud", POINTS, Extent::Any);
        let (radiance, meta) = (cloud.read("radiance"), cloud.read("meta"));
        let mean = (params.variance || params.uncertain).then(|| cloud.read("mean"));
        let record = params.uncertain.then(|| cloud.read("record"));
        let pixels = || Extent::Frame(1);
        let id = io.read("id", ID, pixels());
        let cls = io.read("cls", meaning::CLASS, pixels());
        let r24 = io.read("r24", meaning::REACH, pixels());
        let subpixel = io.read("subpixel", CELL, pixels());
        let color = io.write(
            "color",
            RADIANCE.doc(
                "Linear radiance of the primary region; alpha: the share of the kernel's weight that was there.",
            ),
            pixels(),
        );
        let priority = io.write("priority", PRIORITY, pixels());
        let noise = mean.map(|mean| Noise {
            mean,
            variance: params.variance.then(|| io.write("variance", VARIANCE, pixels())),
            record,
        });
        let doc = "The mean albedo of each point's samples, if `albedo` is wanted.";
        let pattern = io.optional("albedos", POINT_ALBEDOS.doc(doc), Extent::Any).map(|albedos| {
            let doc = "The mean albedo of the samples, with the same weights; 0 without a sample.";
            Pattern { albedos, albedo: io.write("albedo", ALBEDO_CODE.doc(doc), pixels()) }
        });
        io.shader(shader!("interpolate"));
        io.constants(CONSTANTS);
        if pattern.is_some() {
            io.define("ALBEDO");
        }
        if noise.is_some() {
            io.define("NOISE");
        }
        if params.variance {
            io.define("VARIANCE");
        }
        if params.uncertain {
            io.define("UNCERTAIN");
        }
        io.dispatch("interpolate", color);
        if let Some(Pattern { albedo, .. }) = pattern {
            io.dispatch("mean_albedo", albedo);
        }
        Self { radiance, meta, id, cls, r24, subpixel, color, priority, noise, pattern }
    }

    fn cpu(&self, params: &InterpolateParams, cx: &CpuContext) -> Result<(), String> {
        let (width, height) = (cx.dims(self.color).width as usize, cx.dims(self.color).height as usize);
        let (radiance, meta) = (&cx.read(self.radiance)[..], &cx.read(self.meta)[..]);
        let (id, subpixel) = (&cx.read(self.id)[..], &cx.read(self.subpixel)[..]);
        let (cls, r24) = (&cx.read(self.cls)[..], &cx.read(self.r24)[..]);
        let (color, priority) = (&mut cx.write(self.color)[..], &mut cx.write(self.priority)[..]);

        let weights = Weights::new(params);
        let mean = self.noise.map(|noise| cx.read(noise.mean));
        let mean = mean.as_ref().map(|mean| &mean[..]);
        let record = self.noise.and_then(|noise| noise.record).map(|record| cx.read(record));
        let record = record.as_ref().map(|record| &record[..]);
        let points = mean.zip(record).map(|(mean, record)| Points {
            mean,
            record,
            view: &cx.frame().view,
            size: [width as u32, height as u32],
        });
        let albedos = self.pattern.map(|pattern| cx.read(pattern.albedos));
        let albedos = albedos.as_ref().map(|albedos| &albedos[..]);
        let image = Image { radiance, mean, albedos, id, subpixel, width, height, space: params.space };
        let work = Work { image, weights, meta, points, cls, r24, rule: params.priority };
        let level = cx.level();
        let more = mean.is_some() || albedos.is_some();
        let mut variance = self.noise.and_then(|noise| noise.variance).map(|variance| cx.write(variance));
        let mut albedo = self.pattern.map(|pattern| cx.write(pattern.albedo));
        let count = height.div_ceil(BAND);
        let bands = color
            .par_chunks_mut(width * BAND)
            .zip(priority.par_chunks_mut(width * BAND))
            .zip(bands_of(variance.as_deref_mut(), width * BAND, count))
            .zip(bands_of(albedo.as_deref_mut(), width * BAND, count));
        bands.enumerate().for_each(|(band, (((color, priority), variance), albedo))| {
            let outputs = Outputs { color, priority, variance, albedo };
            // Compiled for each: with the sums for noise in it, the loop that needs none would take a quarter longer.
            if more {
                dispatch!(level, simd => work.band::<_, true>(simd, band * BAND, outputs));
            } else {
                dispatch!(level, simd => work.band::<_, false>(simd, band * BAND, outputs));
            }
        });
        Ok(())
    }

    fn explain(&self, params: &InterpolateParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// Bands of this length of an output, or as many times nothing.
fn bands_of<T: Send>(
    output: Option<&mut [T]>,
    length: usize,
    count: usize,
) -> impl IndexedParallelIterator<Item = Option<&mut [T]>> {
    match output {
        Some(output) => Either::Left(output.par_chunks_mut(length).map(Some)),
        None => Either::Right((0..count).into_par_iter().map(|_| None)),
    }
}

/// What bands of rows are computed from.
struct Work<'a> {
    image: Image<'a>,
    weights: Weights,
    meta: &'a [u32],
    /// What priorities depend on, if not only on ages and emptiness.
    points: Option<Points<'a>>,
    cls: &'a [u32],
    r24: &'a [u32],
    rule: Priority,
}

/// What is known of the cloud's points.
struct Points<'a> {
    mean: &'a [[f32; 4]],
    record: &'a [[f32; 4]],
    view: &'a View,
    size: [u32; 2],
}

impl Points<'_> {
    /// The shown variance of the points that eight pixels of a row show, from `pixel` on; 0 without one.
    #[inline(always)]
    fn shown_variance<S: Simd>(&self, simd: S, ids: &[u32; LANES], pixel: [usize; 2]) -> f32x8<S> {
        let (mut mean, mut record) = ([[0.0; 4]; LANES], [[0.0; 4]; LANES]);
        gather(self.mean, ids, &mut mean);
        gather(self.record, ids, &mut record);
        let (mean, record) = (load_transposed(simd, &mean), load_transposed(simd, &record));
        let shown = shown_variance_of(simd, mean, record, self.towards_eye(simd, pixel));
        let is_there = u32x8::load_array_ref(simd, ids).simd_ne(u32x8::splat(simd, NO_POINT));
        is_there.select(shown, f32x8::splat(simd, 0.0))
    }

    /// The unit directions from what eight pixels of a row show to the eye, by axis: those of
    /// [`Ray::through`](crate::shared::source::Ray::through) their middles, reversed.
    #[inline(always)]
    fn towards_eye<S: Simd>(&self, simd: S, [x, y]: [usize; 2]) -> [f32x8<S>; 3] {
        let View { forward, right, up, tan_x, tan_y, .. } = self.view;
        let [width, height] = self.size;
        let x = f32x8::from_fn(simd, |lane| (x + lane) as f32 + 0.5);
        let u = (x * 2.0 / width as f32 - 1.0) * *tan_x;
        let v = (1.0 - 2.0 * (y as f32 + 0.5) / height as f32) * tan_y;
        let mut along = [u; 3];
        for axis in 0..3 {
            along[axis] = u * right[axis] + forward[axis] + v * up[axis];
        }
        let [x, y, z] = along;
        let inverse = f32x8::splat(simd, 1.0) / (x * x + y * y + z * z).sqrt();
        [-(x * inverse), -(y * inverse), -(z * inverse)]
    }
}

/// A band of the outputs.
struct Outputs<'a> {
    color: &'a mut [[f32; 4]],
    priority: &'a mut [u32],
    variance: Option<&'a mut [f32]>,
    albedo: Option<&'a mut [u32]>,
}

impl Work<'_> {
    /// Computes the rows from `top` on; `MORE`: from the points' means or albedos, too.
    #[inline(always)]
    fn band<S: Simd, const MORE: bool>(&self, simd: S, top: usize, outputs: Outputs) {
        let Outputs { color, priority, mut variance, mut albedo } = outputs;
        let width = self.image.width;
        let rows = top..top + color.len() / width;
        for left in (0..width).step_by(TILE) {
            let mut around = Around::new();
            for y in rows.start..rows.end + 2 * REACH {
                around.load(simd, &self.image, &self.weights, left, y);
                // This row completes the surroundings of one above it.
                if y < rows.start + 2 * REACH {
                    continue;
                }
                let y = y - 2 * REACH;
                let columns = left..width.min(left + TILE);
                let id = &self.image.id[y * width..][columns.clone()];
                let mut metas = [0; TILE];
                gather(self.meta, id, &mut metas);
                for x in columns.step_by(LANES) {
                    let (at, out) = (y * width + x, (y - top) * width + x);
                    let taps = taps_of(simd, padded(self.cls, at), padded(self.r24, at));
                    let means = around.sum(simd, x - left, y, taps, Row::rgb).over(simd, self.image.space);
                    let lanes = LANES.min(width - x);
                    store_vectors(simd, means, &mut color[out..][..lanes]);
                    let metas: &[u32; LANES] =
                        metas[x - left..].first_chunk().expect("a tile has whole groups");
                    let points = padded(id, x - left);
                    let metas = u32x8::load_array_ref(simd, metas);
                    let point = u32x8::load_array(simd, points);
                    let mut priorities = by_age(simd, self.rule, point, metas, means[3]);
                    if MORE && self.image.mean.is_some() {
                        let [found, spread] = around.noise(simd, x - left, y, taps);
                        if let Some(known) = &self.points {
                            let own = known.shown_variance(simd, &points, [x, y]);
                            priorities = uncertain(simd, priorities, own.max_precise(spread));
                        }
                        if let Some(variance) = &mut variance {
                            store(&found.to_array(), &mut variance[out..][..lanes]);
                        }
                    }
                    if let (true, Some(albedo)) = (MORE, &mut albedo) {
                        let codes = around.albedo(simd, x - left, y, taps);
                        store(&codes.to_array(), &mut albedo[out..][..lanes]);
                    }
                    store(&priorities.to_array(), &mut priority[out..][..lanes]);
                }
            }
        }
    }
}

/// [`taps`] of eight pixels.
#[inline(always)]
fn taps_of<S: Simd>(simd: S, cls: [u32; LANES], r24: [u32; LANES]) -> u32x8<S> {
    let (cls, r24) = (u32x8::load_array(simd, cls), u32x8::load_array(simd, r24));
    let is_complex = (cls & CLASS).simd_eq(u32x8::splat(simd, COMPLEX));
    is_complex.select(u32x8::splat(simd, ALL), (r24 & 0xFFF) | (1 << 12) | ((r24 & 0xFF_F000) << 1))
}

/// The priorities of eight pixels: [`without_point`], or by the age of the point.
#[inline(always)]
fn by_age<S: Simd>(simd: S, rule: Priority, point: u32x8<S>, meta: u32x8<S>, share: f32x8<S>) -> u32x8<S> {
    let splat = |number: u32| u32x8::splat(simd, number);
    let missing = (f32x8::splat(simd, 1.0) - share) * f32x8::splat(simd, 256.0) + f32x8::splat(simd, 0.5);
    let missing: u32x8<S> = missing.to_int::<i32x8<S>>().bitcast();
    let without_point = match rule {
        Priority::Measured => {
            let cube = (missing * missing * missing) >> 9;
            (splat(255) * ((cube * cube) >> 8) + splat(1 << 21)) >> 22
        }
        Priority::Classic => (splat(255) * missing) >> 8,
    };
    point.simd_eq(splat(NO_POINT)).select(without_point, with_points(simd, rule, meta & AGE))
}

/// Which of the 25 pixels of the kernel count; bit 12 is the pixel itself.
fn taps(cls: u32, r24: u32) -> u32 {
    if cls & CLASS == COMPLEX {
        return ALL;
    }
    // `r24` does not include the centre.
    (r24 & 0xFFF) | 1 << 12 | (r24 & 0xFF_F000) << 1
}

/// The priorities of eight pixels, given those by age and emptiness, and the variance of what they show.
#[inline(always)]
fn uncertain<S: Simd>(simd: S, by_age: u32x8<S>, variance: f32x8<S>) -> u32x8<S> {
    let splat = |number: f32| f32x8::splat(simd, number);
    // The root of the deviation, so that the noisiest places do not get nearly all samples. In 1/16, so that the sides round
    // alike.
    let root = variance.sqrt().sqrt();
    let factor = (root * UNCERTAINTY_GAIN).max(splat(LEAST_UNCERTAINTY)).min(splat(MOST_UNCERTAINTY));
    let factor: u32x8<S> = factor.to_int::<i32x8<S>>().bitcast();
    ((by_age * factor) >> 4).min(u32x8::splat(simd, 255))
}

/// Priority of a pixel without a point, given the present share of the kernel's weight.
fn without_point(rule: Priority, share: f32) -> u32 {
    // In 1/256, to the nearest. Exact, as the share is a whole number of 1 / FULL.
    let missing = ((1.0 - share) * 256.0 + 0.5) as u32;
    match rule {
        Priority::Measured => {
            // In whole numbers: 255 * (missing / 256)^6, to about the nearest.
            let cube = (missing * missing * missing) >> 9;
            (255 * ((cube * cube) >> 8) + (1 << 21)) >> 22
        }
        Priority::Classic => 255 * missing / 256,
    }
}

/// Compresses radiance to a luminance below 1.
fn compress(color: [f32; 3]) -> [f32; 3] {
    let scale = 1.0 / (1.0 + luminance(color));
    color.map(|channel| channel * scale)
}

/// The inverse of [`compress`]. For the largest radiance that the cloud can hold, 1 - luminance is 1.5e-5.
fn expand(color: [f32; 3]) -> [f32; 3] {
    let scale = 1.0 / (1.0 - luminance(color)).max(1e-5);
    color.map(|channel| channel * scale)
}

/// The kernel, as products of a weight for each axis.
struct Weights {
    /// For each offset + [`REACH`], the weights of a sample in each row or column of cells.
    axis: [[f32; 16]; SPAN],
    /// Bits of a row or column, and their mask.
    shift: u32,
    mask: u32,
}

impl Weights {
    fn new(params: &InterpolateParams) -> Self {
        let shift = params.subpixel_bits / 2;
        let cells = 1u32 << shift;
        let weight = |pixel: usize, aside: f32| match params.kernel {
            Kernel::Gaussian => {
                let distance = pixel as f32 - REACH as f32 + aside;
                (-distance * distance / (2.0 * params.sigma * params.sigma)).exp()
            }
            Kernel::Binomial => [1.0, 4.0, 6.0, 4.0, 1.0][pixel],
        };
        let scale = AXIS / (0..SPAN).map(|pixel| weight(pixel, 0.0)).sum::<f32>();
        // Every reached sample counts, however far it is.
        let rounded = |weight: f32| (weight * scale + 0.5).floor().max(1.0);
        let aside = |cell: usize| (cell as f32 + 0.5) / cells as f32 - 0.5;
        let axis =
            std::array::from_fn(|pixel| std::array::from_fn(|cell| rounded(weight(pixel, aside(cell)))));
        Self { axis, shift, mask: cells - 1 }
    }
}

/// The samples as an image.
struct Image<'a> {
    radiance: &'a [u32],
    /// The points' means with their variance, if that is wanted.
    mean: Option<&'a [[f32; 4]]>,
    /// The points' albedos, if they are.
    albedos: Option<&'a [[u32; 2]]>,
    id: &'a [u32],
    subpixel: &'a [u32],
    width: usize,
    height: usize,
    space: Space,
}

/// The offsets of the 25 pixels of the kernel, in reading order.
fn offsets() -> impl Iterator<Item = [i32; 2]> {
    let reach = REACH as i32;
    (-reach..=reach).flat_map(move |dy| (-reach..=reach).map(move |dx| [dx, dy]))
}

impl Image<'_> {
    /// The weight and the colour of the sample at an offset from a pixel, or `None`.
    fn tap(&self, weights: &Weights, pixel: [usize; 2], offset: [i32; 2]) -> Option<(f32, [f32; 3])> {
        let along = |axis: usize| pixel[axis].checked_add_signed(offset[axis] as isize);
        let (x, y) = (along(0)?, along(1)?);
        if x >= self.width || y >= self.height {
            return None;
        }
        let at = y * self.width + x;
        // NO_POINT is not a point's id.
        let color = decode_radiance(*self.radiance.get(self.id[at] as usize)?);
        let weight = |cell: u32, offset: i32| {
            weights.axis[(offset + REACH as i32) as usize][(cell & weights.mask) as usize]
        };
        let cell = self.subpixel[at];
        let weight = weight(cell, offset[0]) * weight(cell >> weights.shift, offset[1]);
        let color = match self.space {
            Space::Linear => color,
            Space::ToneMapped => compress(color),
        };
        Some((weight, color))
    }

    /// The weighted sums of red, green and blue of the samples that count for a pixel, and the sum of their weights:
    /// the rule. [`Around::sum`] computes the same for several pixels at once, with identical bits.
    fn sum_at(&self, weights: &Weights, pixel: [usize; 2], taps: u32) -> [f32; 4] {
        let mut sums = [0.0; 4];
        for (tap, offset) in offsets().enumerate() {
            if taps >> tap & 1 != 0
                && let Some((weight, [r, g, b])) = self.tap(weights, pixel, offset)
            {
                sums.iter_mut().zip([r, g, b, 1.0]).for_each(|(sum, value)| *sum += weight * value);
            }
        }
        sums
    }
}

/// Columns of a row of samples: a tile plus the radius of its kernels.
const COLUMNS: usize = TILE + 2 * REACH;
/// Where groups of eight begin that together are these columns. The last two overlap.
const GROUPS: [usize; COLUMNS.div_ceil(LANES)] = {
    let mut groups = [0; COLUMNS.div_ceil(LANES)];
    let mut group = 0;
    while group < groups.len() {
        let first = group * LANES;
        groups[group] = if first + LANES <= COLUMNS { first } else { COLUMNS - LANES };
        group += 1;
    }
    groups
};

/// Red, green and blue of a row of samples.
type Planes = [[f32; COLUMNS]; 3];

/// A row of samples, as structures of arrays, so that neighbouring pixels are summed in parallel lanes.
#[derive(Clone, Copy)]
struct Row {
    rgb: Planes,
    /// The weight along x of each sample, seen from each offset; 0 if there is no sample.
    x: [[f32; COLUMNS]; SPAN],
    /// The weight along y.
    y: [[f32; COLUMNS]; SPAN],
    /// Luminance and its variance, if that is wanted.
    luminance: [f32; COLUMNS],
    variance: [f32; COLUMNS],
    /// Red, green and blue of the albedo, likewise.
    albedo: Planes,
}

impl Row {
    const EMPTY: Self = Self {
        rgb: [[0.0; COLUMNS]; 3],
        x: [[0.0; COLUMNS]; SPAN],
        y: [[0.0; COLUMNS]; SPAN],
        luminance: [0.0; COLUMNS],
        variance: [0.0; COLUMNS],
        albedo: [[0.0; COLUMNS]; 3],
    };

    #[inline(always)]
    fn rgb(&self) -> &Planes {
        &self.rgb
    }

    #[inline(always)]
    fn albedo(&self) -> &Planes {
        &self.albedo
    }
}

/// The values of eight columns.
#[inline(always)]
fn lanes<S: Simd>(simd: S, plane: &[f32; COLUMNS], first: usize) -> f32x8<S> {
    f32x8::from_slice(simd, &plane[first..][..LANES])
}

/// The five rows of samples that the kernels of a row of pixels reach.
struct Around {
    /// Row y - [`REACH`] of the image is at y modulo [`SPAN`].
    rows: [Row; SPAN],
}

impl Around {
    fn new() -> Self {
        Self { rows: [Row::EMPTY; SPAN] }
    }

    /// Loads row `y` - [`REACH`] of the image, which may be outside, from column `left` - [`REACH`] on.
    #[inline(always)]
    fn load<S: Simd>(&mut self, simd: S, image: &Image, weights: &Weights, left: usize, y: usize) {
        let row = &mut self.rows[y % SPAN];
        let columns = REACH.saturating_sub(left)..COLUMNS.min(image.width + REACH - left);
        let is_inside = (REACH..image.height + REACH).contains(&y);
        if !is_inside || columns.len() < COLUMNS {
            row.x.iter_mut().for_each(|weights| weights.fill(0.0));
        }
        if !is_inside {
            return;
        }
        let first = (y - REACH) * image.width + left + columns.start - REACH;
        let (id, subpixel) = (&image.id[first..][..columns.len()], &image.subpixel[first..][..columns.len()]);
        let (mut radiance, mut ids, mut cells) = ([0; COLUMNS], [NO_POINT; COLUMNS], [0; COLUMNS]);
        gather(image.radiance, id, &mut radiance[columns.clone()]);
        if let Some(albedos) = image.albedos {
            let mut found = [[0; 2]; COLUMNS];
            gather(albedos, id, &mut found[columns.clone()]);
            for (column, found) in found.into_iter().enumerate() {
                let [r, g, b] = unpack_mean(found);
                (row.albedo[0][column], row.albedo[1][column], row.albedo[2][column]) = (r, g, b);
            }
        }
        ids[columns.clone()].copy_from_slice(id);
        cells[columns.clone()].copy_from_slice(subpixel);
        for first in GROUPS {
            let at = |plane: &[u32; COLUMNS]| u32x8::from_slice(simd, &plane[first..][..LANES]);
            let to =
                |plane: &mut [f32; COLUMNS], lanes: f32x8<S>| lanes.store_slice(&mut plane[first..][..LANES]);
            // A pixel without a sample has weight 0: a branch on that would be predicted badly.
            let there = bits(simd, at(&ids).simd_ne(u32x8::splat(simd, NO_POINT)));
            let [x, y] = [at(&cells), at(&cells) >> weights.shift].map(|place| place & weights.mask);
            for offset in 0..SPAN {
                let along_x = look_up(simd, &weights.axis[offset], x);
                to(&mut row.x[offset], f32x8::from_bits(along_x.to_bits() & there));
                to(&mut row.y[offset], look_up(simd, &weights.axis[offset], y));
            }
            let color = radiance_of(simd, at(&radiance));
            let color = if image.space == Space::ToneMapped { compressed(simd, color) } else { color };
            row.rgb.iter_mut().zip(color).for_each(|(plane, channel)| to(plane, channel));
        }
        if let Some(mean) = image.mean {
            let mut means = [[0.0; 4]; COLUMNS];
            gather(mean, id, &mut means[columns]);
            for first in GROUPS {
                let means = means[first..].first_chunk().expect("a group has eight columns");
                let [r, g, b, variance] = load_transposed(simd, means);
                luminances(simd, [r, g, b]).store_slice(&mut row.luminance[first..][..LANES]);
                variance.store_slice(&mut row.variance[first..][..LANES]);
            }
        }
    }

    /// [`Image::sum_at`] of eight pixels of row `y`, from column `x` of the tile on; of these planes.
    #[inline(always)]
    fn sum<S: Simd>(
        &self,
        simd: S,
        x: usize,
        y: usize,
        taps: u32x8<S>,
        planes: impl Fn(&Row) -> &Planes,
    ) -> Sums<S> {
        // Far from all edges, as most pixels are, no tap needs a test.
        if taps.simd_eq(u32x8::splat(simd, ALL)).all_true() {
            self.sum_of(simd, x, y, planes, |_, weight| weight)
        } else {
            self.sum_of(simd, x, y, planes, |tap, weight| {
                f32x8::from_bits(if_odd(simd, taps >> tap as u32, weight.to_bits()))
            })
        }
    }

    /// [`Around::sum`], where `counted` is a tap's weight if it counts, else 0.
    #[inline(always)]
    fn sum_of<S: Simd>(
        &self,
        simd: S,
        x: usize,
        y: usize,
        planes: impl Fn(&Row) -> &Planes,
        counted: impl Fn(usize, f32x8<S>) -> f32x8<S>,
    ) -> Sums<S> {
        assert!(x + LANES <= TILE, "eight pixels of a tile");
        let mut sums = [f32x8::splat(simd, 0.0); 4];
        for dy in 0..SPAN {
            let row = &self.rows[(y + dy) % SPAN];
            for dx in 0..SPAN {
                let of = |plane| lanes(simd, plane, x + dx);
                let weight = counted(dy * SPAN + dx, of(&row.x[dx]) * of(&row.y[dy]));
                for (sum, plane) in sums.iter_mut().zip(planes(row)) {
                    *sum += weight * of(plane);
                }
                sums[3] += weight;
            }
        }
        Sums(sums)
    }

    /// The codes of the mean albedos around eight pixels, as [`Around::sum`].
    #[inline(always)]
    fn albedo<S: Simd>(&self, simd: S, x: usize, y: usize, taps: u32x8<S>) -> u32x8<S> {
        let Sums([r, g, b, weights]) = self.sum(simd, x, y, taps, Row::albedo);
        let codes = code_of(simd, [r / weights, g / weights, b / weights]);
        weights.simd_gt(f32x8::splat(simd, 0.0)).select(codes, u32x8::splat(simd, NO_ALBEDO))
    }

    /// The variance of the luminance of the colours of [`LANES`] pixels, in the linear space. Samples are independent;
    /// those that do not know their own variance have that of the samples around them, and a single one is as uncertain
    /// as it is bright. [`UNKNOWN`] without samples. Also the variance of one of these samples as it is shown.
    #[inline(always)]
    fn noise<S: Simd>(&self, simd: S, x: usize, y: usize, taps: u32x8<S>) -> [f32x8<S>; 2] {
        assert!(x + LANES <= TILE, "eight pixels of a tile");
        let splat = |number: f32| f32x8::splat(simd, number);
        let mut sums = Scatter::none(simd);
        for dy in 0..SPAN {
            let row = &self.rows[(y + dy) % SPAN];
            for dx in 0..SPAN {
                let of = |plane| lanes(simd, plane, x + dx);
                let (luminance, variance) = (of(&row.luminance), of(&row.variance));
                let weight = (of(&row.x[dx]) * of(&row.y[dy])).to_bits();
                let weight = f32x8::from_bits(if_odd(simd, taps >> (dy * SPAN + dx) as u32, weight));
                sums.add_sample(simd, weight / splat(FULL), luminance, variance);
            }
        }
        let [mean, variance] = sums.one_of(simd);
        let is_there = sums.weights.simd_gt(splat(0.0));
        let shown = is_there.select(shown_variance(mean, variance), splat(f32::MAX));
        [is_there.select(sums.variance_of_mean(variance), splat(UNKNOWN)), shown]
    }
}

/// Sums over samples of eight pixels, from which follow the variances of their weighted means.
struct Scatter<S: Simd> {
    weights: f32x8<S>,
    squared_weights: f32x8<S>,
    /// Of squared weights times variances, where these are known.
    known: f32x8<S>,
    /// Of squared weights of the other samples.
    unknown: f32x8<S>,
    luminance: f32x8<S>,
    squared_luminance: f32x8<S>,
}

impl<S: Simd> Scatter<S> {
    #[inline(always)]
    fn none(simd: S) -> Self {
        let zero = f32x8::splat(simd, 0.0);
        Self {
            weights: zero,
            squared_weights: zero,
            known: zero,
            unknown: zero,
            luminance: zero,
            squared_luminance: zero,
        }
    }

    /// Adds a sample to each; its variance is unknown where it is negative.
    #[inline(always)]
    fn add_sample(&mut self, simd: S, weight: f32x8<S>, luminance: f32x8<S>, variance: f32x8<S>) {
        let (squared, zero) = (weight * weight, f32x8::splat(simd, 0.0));
        let is_unknown = (variance.to_bits() >> 31).simd_ne(u32x8::splat(simd, 0));
        self.weights += weight;
        self.squared_weights += squared;
        self.known += is_unknown.select(zero, squared * variance);
        self.unknown += is_unknown.select(squared, zero);
        self.luminance += weight * luminance;
        self.squared_luminance += weight * luminance * luminance;
    }

    /// Mean luminance and variance of one of these samples. A single one is as uncertain as it is bright.
    #[inline(always)]
    fn one_of(&self, simd: S) -> [f32x8<S>; 2] {
        let splat = |number: f32| f32x8::splat(simd, number);
        let mean = self.luminance / self.weights;
        let between = (self.squared_luminance / self.weights - mean * mean).max_precise(splat(0.0));
        // From the variance in these samples to that of which they are samples.
        let share = splat(1.0) - self.squared_weights / (self.weights * self.weights);
        [mean, share.simd_gt(splat(LEAST_SHARE)).select(between / share, mean * mean)]
    }

    /// The variance of the mean of independent samples. Those that do not know their own have that of one of them.
    #[inline(always)]
    fn variance_of_mean(&self, of_one: f32x8<S>) -> f32x8<S> {
        (self.known + self.unknown * of_one) / (self.weights * self.weights)
    }
}

/// Weighted sums of red, green and blue, and of the weights.
struct Sums<S: Simd>([f32x8<S>; 4]);

impl<S: Simd> Sums<S> {
    /// The colours, and the present share of the kernel's weight; zeros without any sample.
    #[inline(always)]
    fn over(self, simd: S, space: Space) -> [f32x8<S>; 4] {
        let Self([r, g, b, weight]) = self;
        let zero = f32x8::splat(simd, 0.0);
        let is_there = weight.simd_gt(zero);
        let mut means = [r, g, b].map(|sum| is_there.select(sum / weight, zero));
        if space == Space::ToneMapped {
            let channels = means.map(|mean| mean.to_array());
            let colors: [[f32; 3]; LANES] =
                std::array::from_fn(|lane| expand(channels.map(|channel| channel[lane])));
            means =
                std::array::from_fn(|channel| f32x8::load_array(simd, colors.map(|color| color[channel])));
        }
        let [r, g, b] = means;
        let one = f32x8::splat(simd, 1.0);
        [r, g, b, lesser(simd, weight / f32x8::splat(simd, FULL), one)]
    }
}

/// [`compress`] of eight colours.
#[inline(always)]
fn compressed<S: Simd>(simd: S, color: [f32x8<S>; 3]) -> [f32x8<S>; 3] {
    let one = f32x8::splat(simd, 1.0);
    let scale = one / (one + luminances(simd, color));
    color.map(|channel| channel * scale)
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Harness, View};
    use fearless_simd::Level;
    use glam::Vec3;

    use super::*;
    use crate::shared::{
        albedo::{decode_albedo, encode_albedo, pack_mean},
        cloud::{AGE_ONE, LIVE, MAX_RADIANCE, encode_radiance},
        edge_pixel::{EMPTY, SIMPLE},
        source::Ray,
        testing::{Random, run_alike, run_both, run_cpu, settings},
    };

    /// A pixel: its sample (radiance, age and cell), class, and reached pixels.
    #[derive(Clone, Copy)]
    struct Pixel {
        sample: Option<([f32; 3], u32, u32)>,
        cls: u32,
        r24: u32,
    }

    /// The cell of 16 x 16 below and to the right of the pixel's centre.
    const CENTER: u32 = 8 * 16 + 8;
    const OPEN: Pixel = Pixel { sample: None, cls: EMPTY, r24: 0xFF_FFFF };

    /// The samples of pixels, as points in reading order.
    struct Samples {
        radiance: Vec<u32>,
        /// With their variances: their ages, in percent, less 1; below 0 they are unknown.
        mean: Vec<[f32; 4]>,
        id: Vec<u32>,
        subpixel: Vec<u32>,
    }

    impl Samples {
        fn of(pixels: &[Pixel]) -> Self {
            let samples = || pixels.iter().filter_map(|pixel| pixel.sample);
            let mut next = 0..;
            let id = |pixel: &Pixel| pixel.sample.map_or(NO_POINT, |_| next.next().unwrap_or(NO_POINT));
            Self {
                radiance: samples().map(|(color, ..)| encode_radiance(color)).collect(),
                mean: samples().map(|([r, g, b], age, _)| [r, g, b, age as f32 / 100.0 - 1.0]).collect(),
                id: pixels.iter().map(id).collect(),
                subpixel: pixels.iter().map(|pixel| pixel.sample.map_or(0, |sample| sample.2)).collect(),
            }
        }

        fn image(&self, size: [u32; 2], space: Space) -> Image<'_> {
            let [width, height] = size.map(|along| along as usize);
            let Self { radiance, mean, id, subpixel } = self;
            Image { radiance, mean: Some(mean), albedos: None, id, subpixel, width, height, space }
        }
    }

    fn harness(params: InterpolateParams, size: [u32; 2], pixels: &[Pixel]) -> Harness<Interpolate> {
        let samples: Vec<_> = pixels.iter().filter_map(|pixel| pixel.sample).collect();
        let known = Samples::of(pixels);
        let (has_means, is_uncertain) = (params.variance || params.uncertain, params.uncertain);
        let mut harness = Harness::new(params, &settings(size, 0));
        harness.set("id", &known.id);
        harness.set("cls", &pixels.iter().map(|pixel| pixel.cls).collect::<Vec<_>>());
        harness.set("r24", &pixels.iter().map(|pixel| pixel.r24).collect::<Vec<_>>());
        harness.set("subpixel", &known.subpixel);
        let albedos = samples.iter().map(|sample| pack_mean(albedo_of_color(sample.0)));
        harness.set("albedos", &albedos.chain([[0; 2]]).collect::<Vec<_>>());
        // A cloud has at least one slot.
        let none = [0].into_iter().filter(|_| samples.is_empty());
        let radiance = known.radiance.into_iter().chain(none.clone());
        harness.set("cloud.radiance", &radiance.collect::<Vec<_>>());
        if has_means {
            let mean = known.mean.into_iter().chain(none.clone().map(|_| [0.0; 4]));
            harness.set("cloud.mean", &mean.collect::<Vec<_>>());
        }
        if is_uncertain {
            // Seen as they are now by the middle of a narrow view.
            harness.frame.view = View { tan_x: 1e-3, tan_y: 1e-3, ..View::default() };
            harness.set("cloud.record", &vec![[0.0f32, 0.0, 1.0, 1.0]; samples.len().max(1)]);
        }
        harness
            .set("cloud.meta", &samples.iter().map(|sample| sample.1 | LIVE).chain(none).collect::<Vec<_>>());
        harness
    }

    /// Of each sample in these tests: 0.9 less a tenth of its colour's channels.
    fn albedo_of_color(color: [f32; 3]) -> [f32; 3] {
        color.map(|channel| (0.9 - 0.1 * channel).clamp(0.1, 0.9))
    }

    fn binomial() -> InterpolateParams {
        InterpolateParams { kernel: Kernel::Binomial, ..InterpolateParams::default() }
    }

    fn gray(value: f32) -> Option<([f32; 3], u32, u32)> {
        Some(([value; 3], 0, CENTER))
    }

    #[test]
    fn directions_to_the_eye_are_those_of_rays() {
        let view = View {
            right: [0.6, 0.0, 0.8],
            up: [0.0, 1.0, 0.0],
            forward: [0.8, 0.0, -0.6],
            tan_x: 0.7,
            tan_y: 0.4,
            ..View::default()
        };
        let size = [37, 21];
        let points = Points { mean: &[], record: &[], view: &view, size };
        for (x, y) in [(0, 0), (8, 20), (32, 7)] {
            let rays: [[f32; 3]; LANES] = std::array::from_fn(|lane| {
                let ray = Ray::through(&view, [(x + lane) as f32 + 0.5, y as f32 + 0.5], size);
                (-ray.direction.normalize_or_zero()).into()
            });
            for level in [Level::new(), Level::baseline()] {
                let got =
                    dispatch!(level, simd => points.towards_eye(simd, [x, y]).map(|axis| axis.to_array()));
                for (lane, ray) in rays.iter().enumerate() {
                    assert_eq!(got.map(|axis| axis[lane]), *ray, "{level:?} {x} {y}");
                }
            }
        }
    }

    #[test]
    fn binomial_weights() {
        // One sample in each of the 5x5 pixels in turn: alpha is its weight, in 1/256.
        let row = [1, 4, 6, 4, 1];
        for at in 0..25 {
            let mut pixels = [OPEN; 25];
            pixels[at].sample = gray(2.0);
            let color = run_alike(&mut harness(binomial(), [5, 5], &pixels)).get::<[f32; 4]>("color");
            let share = (row[at % 5] * row[at / 5]) as f32 / 256.0;
            assert_eq!(color[12], [2.0, 2.0, 2.0, share]);
        }
        let mut pixels = [OPEN; 25];
        (0..).zip(&mut pixels).for_each(|(i, pixel)| pixel.sample = gray(i as f32));
        let color = run_alike(&mut harness(binomial(), [5, 5], &pixels)).get::<[f32; 4]>("color");
        assert_eq!(color[12], [12.0, 12.0, 12.0, 1.0]);
    }

    #[test]
    fn gaussian_weights_depend_on_the_position_in_the_pixel() {
        // Two samples in row 0 of a 3x1 image, seen from the middle: at 1 + 7.5/16 and 1 - 7.5/16 pixels along x, both
        // 0.5/16 below the middle.
        let mut pixels = [OPEN; 3];
        pixels[0].sample = Some(([1.0; 3], 0, 8 * 16));
        pixels[2].sample = Some(([3.0; 3], 0, 8 * 16));
        for sigma in [0.3, 0.7, 2.0] {
            let params = InterpolateParams { sigma, ..InterpolateParams::default() };
            let color = run_alike(&mut harness(params, [3, 1], &pixels)).get::<[f32; 4]>("color");
            let gaussian = |x: f64, y: f64| (-(x * x + y * y) / (2.0 * f64::from(sigma).powi(2))).exp();
            let y = 0.5 / 16.0;
            let (far, near) = (gaussian(1.0 + 7.5 / 16.0, y), gaussian(1.0 - 7.5 / 16.0, y));
            let mean = (far + 3.0 * near) / (far + near);
            // Weights along an axis are rounded to whole numbers, here of at least 8; the far one of sigma 0.3 is 1.
            let error = (f64::from(color[1][0]) - mean).abs();
            assert!(error < 0.02, "{sigma}: {:?} {mean}", color[1]);
            let full = (-2..=2).map(|x| gaussian(f64::from(x), 0.0)).sum::<f64>().powi(2);
            assert!((f64::from(color[1][3]) - (far + near) / full).abs() < 1e-3);
        }
    }

    #[test]
    fn weights_are_whole_and_their_sums_exact() {
        for kernel in [Kernel::Gaussian, Kernel::Binomial] {
            for sigma in [0.3, 0.7, 2.0] {
                let weights = Weights::new(&InterpolateParams { kernel, sigma, ..Default::default() });
                let most = |offset: usize| weights.axis[offset].into_iter().fold(0.0, f32::max);
                let sum: f32 = (0..SPAN).map(most).sum();
                assert!(sum * sum < (1 << 24) as f32, "{sigma}: {sum}");
                assert!(weights.axis.iter().flatten().all(|&weight| weight >= 1.0 && weight.fract() == 0.0));
            }
        }
    }

    #[test]
    fn positions_can_have_fewer_bits() {
        // Two bits are 2 x 2 cells. Cell 1 is the upper right one, with its centre a quarter pixel right of the
        // pixel's.
        let mut pixels = [OPEN; 2];
        pixels[1].sample = Some(([1.0; 3], 0, 1));
        let params = InterpolateParams { subpixel_bits: 2, sigma: 1.0, ..InterpolateParams::default() };
        let both = run_both(&mut harness(params, [2, 1], &pixels));
        let full = (1.0 + 2.0 * ((-0.5f32).exp() + (-2f32).exp())).powi(2);
        let share = (-(1.25f32 * 1.25 + 0.25 * 0.25) / 2.0).exp() / full;
        for out in [both.cpu, both.gpu] {
            assert!((out.get::<[f32; 4]>("color")[0][3] - share).abs() < 1e-3);
        }
    }

    #[test]
    fn only_reached_samples_count() {
        // 5x5 pixels with values 0 to 24. Bit k of `r24` is pixel k, or pixel k + 1 from the centre on.
        let mut pixels = [OPEN; 25];
        (0..).zip(&mut pixels).for_each(|(i, pixel)| pixel.sample = gray(1.0 + i as f32));
        let value = |pixels: &[Pixel; 25]| {
            run_alike(&mut harness(binomial(), [5, 5], pixels)).get::<[f32; 4]>("color")[12]
        };
        // The pixel's own sample always counts.
        pixels[12].r24 = 0;
        assert_eq!(value(&pixels), [13.0, 13.0, 13.0, 36.0 / 256.0]);
        pixels[12].sample = None;
        assert_eq!(value(&pixels), [0.0; 4]);
        for bit in 0..24 {
            pixels[12].r24 = 1 << bit;
            let expected = 1.0 + (bit + u32::from(bit >= 12)) as f32;
            assert_eq!(value(&pixels)[0], expected, "bit {bit}");
        }
        // In a complex pixel, all samples count.
        pixels[12].r24 = 0;
        pixels[12].cls = COMPLEX;
        let [mean, .., share] = value(&pixels);
        assert_eq!((mean, share), (13.0, 220.0 / 256.0));
        pixels[12].cls = SIMPLE;
        assert_eq!(value(&pixels), [0.0; 4]);
    }

    #[test]
    fn tone_mapped_means() {
        // 0 and 3 are compressed to 0 and 3/4. Their mean, 3/8, expands to 3/5.
        let mut pixels = [OPEN; 2];
        pixels[0].sample = gray(0.0);
        pixels[1].sample = gray(3.0);
        let params = InterpolateParams { space: Space::ToneMapped, sigma: 2.0, ..binomial() };
        let color = run_alike(&mut harness(params.clone(), [2, 1], &pixels)).get::<[f32; 4]>("color");
        // With weights 6 : 4 in one row, the mean is 0.75 * 4 / 10 = 0.3, which expands to 3/7.
        assert!((color[0][0] - 3.0 / 7.0).abs() < 1e-6, "{color:?}");
        // The brightest possible point is compressed and expanded with the precision that is left in 1 - luminance.
        pixels[0].sample = None;
        pixels[1].sample = gray(MAX_RADIANCE);
        let both = run_both(&mut harness(params, [2, 1], &pixels));
        for out in [both.cpu, both.gpu] {
            let color = out.get::<[f32; 4]>("color");
            assert!((color[0][0] / MAX_RADIANCE - 1.0).abs() < 0.02, "{color:?}");
        }
    }

    #[test]
    fn priorities() {
        let mut pixels = [OPEN; 25];
        pixels[12].sample = Some(([1.0; 3], 80 * AGE_ONE, CENTER));
        for (rule, own, beside) in [
            (Priority::Measured, 40, 255.0 * (232f64 / 256.0).powi(6)),
            (Priority::Classic, 80, (255.0 * 232f64 / 256.0).floor()),
        ] {
            let params = InterpolateParams { priority: rule, ..binomial() };
            let both = run_both(&mut harness(params, [5, 5], &pixels));
            for out in [both.cpu, both.gpu] {
                let priority = out.get::<u32>("priority");
                assert_eq!((priority[12], priority[13]), (own, beside.round() as u32), "{rule:?}");
            }
        }
        pixels[13].r24 = 0;
        for rule in [Priority::Measured, Priority::Classic] {
            let params = InterpolateParams { priority: rule, ..binomial() };
            assert_eq!(run_alike(&mut harness(params, [5, 5], &pixels)).get::<u32>("priority")[13], 255);
        }
    }

    /// An image with random classes and reached pixels, and with samples that are dense on the left and sparse on the
    /// right.
    fn random_image(size: [u32; 2], brightest: f32) -> Vec<Pixel> {
        let mut random = Random(31);
        let pixel = |p| {
            let color = [0; 3].map(|_| random.between(0.0, brightest));
            let sample = (color, random.below(AGE + 1), random.below(256));
            Pixel {
                sample: (random.below(1 + (p % size[0]) / 8) == 0).then_some(sample),
                cls: random.below(3) | random.bits() << 2,
                r24: random.bits() & random.bits() & 0xFF_FFFF,
            }
        };
        (0..size[0] * size[1]).map(pixel).collect()
    }

    #[test]
    fn sums_of_several_pixels_equal_the_sums_at_each_pixel() {
        for size in [[1, 1], [2, 7], [7, 2], [64, 33], [67, 3], [151, 70]] {
            for (kernel, space, brightest) in [
                (Kernel::Gaussian, Space::Linear, MAX_RADIANCE),
                (Kernel::Gaussian, Space::ToneMapped, MAX_RADIANCE),
                (Kernel::Binomial, Space::Linear, 1e-6),
            ] {
                let params = InterpolateParams { kernel, space, ..Default::default() };
                let pixels = random_image(size, brightest);
                let out = run_cpu(&mut harness(params.clone(), size, &pixels));

                let samples = Samples::of(&pixels);
                let image = samples.image(size, space);
                let width = image.width;
                let weights = Weights::new(&params);
                for (p, found) in out.get::<[f32; 4]>("color").into_iter().enumerate() {
                    let taps = taps(pixels[p].cls, pixels[p].r24);
                    let [r, g, b, weight] = image.sum_at(&weights, [p % width, p / width], taps);
                    let mean = [r, g, b].map(|sum| if weight > 0.0 { sum / weight } else { 0.0 });
                    let [r, g, b] = if space == Space::ToneMapped { expand(mean) } else { mean };
                    let expected = [r, g, b, (weight / FULL).min(1.0)];
                    assert_eq!(found.map(f32::to_bits), expected.map(f32::to_bits), "pixel {p} of {size:?}");
                }
            }
        }
    }

    #[test]
    fn both_sides_agree() {
        // The image is wider than a tile, and its width is not a multiple of the lanes.
        let size = [151, 70];
        let pixels = random_image(size, 2.0);
        for kernel in [Kernel::Gaussian, Kernel::Binomial] {
            for space in [Space::Linear, Space::ToneMapped] {
                for priority in [Priority::Measured, Priority::Classic] {
                    let params = InterpolateParams { kernel, space, priority, ..Default::default() };
                    let both = run_both(&mut harness(params, size, &pixels));
                    // The colours are sums of 25 numbers up to 2, and a division.
                    both.assert_close("color", 4e-6);
                    both.assert_equal::<u32>("priority");
                    let color = both.cpu.get::<[f32; 4]>("color");
                    assert!(color.iter().any(|color| color[3] == 0.0));
                }
            }
        }
    }

    #[test]
    fn the_variance_of_a_mean_of_independent_samples() {
        let params = InterpolateParams { variance: true, ..binomial() };
        let variance =
            |pixels: &[Pixel]| run_alike(&mut harness(params.clone(), [3, 1], pixels)).get::<f32>("variance");
        let sample = |grey: f32, variance: f32| Pixel {
            sample: Some(([grey; 3], (100.0 * (variance + 1.0)).round() as u32, CENTER)),
            ..OPEN
        };
        let close = |got: f32, expected: f32| assert!((got - expected).abs() < 1e-5, "{got} {expected}");
        // Weights 4, 6 and 4: (16 * 1 + 36 * 2 + 16 * 3) / 14^2.
        let known = variance(&[sample(5.0, 1.0), sample(5.0, 2.0), sample(5.0, 3.0)]);
        close(known[1], 136.0 / 196.0);
        // Samples of 2, 3 and 5 that do not know theirs: the mean is (4 * 2 + 6 * 3 + 4 * 5) / 14 = 46 / 14, that of
        // the squares (4 * 4 + 6 * 9 + 4 * 25) / 14 = 170 / 14.
        let between = 170.0 / 14.0 - (46.0f32 / 14.0).powi(2);
        let of_one = between / (1.0 - 68.0 / 196.0);
        close(variance(&[sample(2.0, -1.0), sample(3.0, -1.0), sample(5.0, -1.0)])[1], of_one * 68.0 / 196.0);
        // Only the one in the middle knows.
        let some = variance(&[sample(2.0, -1.0), sample(3.0, 2.0), sample(5.0, -1.0)]);
        close(some[1], (36.0 * 2.0 + 32.0 * of_one) / 196.0);
        // A single one is as uncertain as it is bright.
        close(variance(&[sample(3.0, -1.0), OPEN, OPEN])[1], 9.0);
        assert_eq!(variance(&[OPEN; 3]), [UNKNOWN; 3]);
    }

    /// The variance of the luminance of a pixel's colour: the rule that [`Around::noise`] computes for eight.
    fn variance_at(image: &Image, weights: &Weights, pixel: [usize; 2], taps: u32) -> f32 {
        let [mut sum, mut squares, mut known, mut unknown, mut luminances, mut squared] = [0.0f32; 6];
        for (tap, [dx, dy]) in offsets().enumerate() {
            let Some((weight, _)) = image.tap(weights, pixel, [dx, dy]) else { continue };
            if taps >> tap & 1 == 0 {
                continue;
            }
            let at = (pixel[1] as i32 + dy) as usize * image.width + (pixel[0] as i32 + dx) as usize;
            let [r, g, b, variance] = image.mean.expect("given")[image.id[at] as usize];
            let (weight, luminance) = (weight / FULL, luminance([r, g, b]));
            sum += weight;
            squares += weight * weight;
            if variance < 0.0 {
                unknown += weight * weight;
            } else {
                known += weight * weight * variance;
            }
            luminances += weight * luminance;
            squared += weight * luminance * luminance;
        }
        if sum == 0.0 {
            return UNKNOWN;
        }
        let mean = luminances / sum;
        let share = 1.0 - squares / (sum * sum);
        let of_one = match share > LEAST_SHARE {
            true => (squared / sum - mean * mean).max(0.0) / share,
            false => mean * mean,
        };
        (known + unknown * of_one) / (sum * sum)
    }

    #[test]
    fn variances_of_several_pixels_equal_those_at_each_pixel() {
        for (size, kernel) in
            [([1, 1], Kernel::Gaussian), ([67, 3], Kernel::Binomial), ([151, 70], Kernel::Gaussian)]
        {
            let params = InterpolateParams { kernel, variance: true, ..Default::default() };
            let mut pixels = random_image(size, 4.0);
            // One in three does not know its variance: see `Samples`.
            let ages = pixels.iter_mut().filter_map(|pixel| pixel.sample.as_mut());
            ages.enumerate().for_each(|(index, sample)| sample.1 = if index % 3 == 0 { 0 } else { sample.1 });
            let found = run_cpu(&mut harness(params.clone(), size, &pixels)).get::<f32>("variance");

            let samples = Samples::of(&pixels);
            let image = samples.image(size, Space::Linear);
            let width = image.width;
            let weights = Weights::new(&params);
            for (p, found) in found.into_iter().enumerate() {
                let taps = taps(pixels[p].cls, pixels[p].r24);
                let expected = variance_at(&image, &weights, [p % width, p / width], taps);
                assert_eq!(found.to_bits(), expected.to_bits(), "pixel {p} of {size:?}: {found} {expected}");
            }
        }
    }

    #[test]
    fn albedos_have_the_weights_of_the_colours() {
        let pixels = [Some(([1.0, 2.0, 3.0], 0, CENTER)), None, Some(([4.0, 0.0, 5.0], 0, CENTER))];
        let pixels = pixels.map(|sample| Pixel { sample, ..OPEN });
        let codes = |pixels: &[Pixel]| {
            let both = run_both(&mut harness(binomial(), [3, 1], pixels));
            both.assert_equal::<u32>("albedo");
            both.cpu.get::<u32>("albedo")
        };
        // Weights 6 and 1, 4 and 4, 1 and 6, of (0.8, 0.7, 0.6) and (0.5, 0.9, 0.4).
        let mean = |near: f32, far: f32| {
            let (near, far) = (near / (near + far), far / (near + far));
            encode_albedo(near * Vec3::new(0.8, 0.7, 0.6) + far * Vec3::new(0.5, 0.9, 0.4))
        };
        assert_eq!(codes(&pixels), [mean(6.0, 1.0), mean(4.0, 4.0), mean(1.0, 6.0)]);
        // Only the sample that the pixel reaches.
        let mut apart = pixels;
        apart[0].r24 = 0;
        assert_eq!(codes(&apart)[0], mean(1.0, 0.0));
        // Without a sample, none is known.
        assert_eq!(codes(&[OPEN; 3]), [NO_ALBEDO; 3]);
    }

    /// Colours that are a multiple of their albedos are it still, whatever the weights: so dividing one mean by the other
    /// leaves light without textures.
    #[test]
    fn both_sides_average_albedos_as_colours() {
        let mut pixels = random_image([67, 40], 4.0);
        for (color, ..) in pixels.iter_mut().filter_map(|pixel| pixel.sample.as_mut()) {
            // Of an albedo of 0.9 - 0.1 c, 9 - c is ten times.
            let grey = color[0].clamp(0.0, 4.0);
            *color = [grey; 3];
        }
        let both = run_both(&mut harness(InterpolateParams::default(), [67, 40], &pixels));
        for out in [&both.cpu, &both.gpu] {
            let colors = out.get::<[f32; 4]>("color");
            for (code, color) in out.get::<u32>("albedo").into_iter().zip(colors) {
                assert_eq!(code == NO_ALBEDO, color[3] == 0.0);
                // The mean of 0.9 - 0.1 c is 0.9 less a tenth of that of c: up to one code of the root.
                let expected = 0.9 - 0.1 * color[0];
                let error = decode_albedo(code)[0].sqrt() - expected.sqrt();
                assert!(color[3] == 0.0 || error.abs() < 0.6 / 255.0 + 0.002, "{code:x} {expected}");
            }
        }
    }

    #[test]
    fn both_sides_know_the_variance() {
        let mut random = Random(17);
        let size = [70, 37];
        let pixels: Vec<_> = (0..size[0] * size[1])
            .map(|_| Pixel {
                sample: (random.below(3) > 0).then(|| {
                    (std::array::from_fn(|_| random.between(0.0, 2.0)), random.below(250), random.below(256))
                }),
                cls: [EMPTY, SIMPLE, COMPLEX][random.below(3) as usize],
                r24: random.bits() & 0xFF_FFFF,
            })
            .collect();
        let params = InterpolateParams { variance: true, ..InterpolateParams::default() };
        run_both(&mut harness(params, size, &pixels)).assert_close("variance", 1e-5);
    }

    #[test]
    fn priorities_grow_with_uncertainty() {
        let params = InterpolateParams { uncertain: true, ..binomial() };
        // A point of age 80, of the given variance of its luminance 1, and its neighbour to the right.
        let priority = |variance: f32, beside: Option<f32>, record: [f32; 4]| {
            let mut pixels = [OPEN; 25];
            pixels[12].sample = Some(([1.0; 3], 80 * AGE_ONE, CENTER));
            pixels[13].sample = beside.and_then(gray);
            let mut harness = harness(params.clone(), [5, 5], &pixels);
            let count = 1 + usize::from(beside.is_some());
            let mean = |grey: f32| [grey, grey, grey, variance];
            harness.set("cloud.mean", &[mean(1.0), mean(beside.unwrap_or_default())][..count]);
            harness.set("cloud.record", &[record; 2][..count]);
            run_alike(&mut harness).get::<u32>("priority")[12]
        };
        let seen = [0.0, 0.0, 1.0, 1.0];
        let of = |variance: f32| {
            let factor = (30.0 * (variance / 1.01).powf(0.25)).clamp(4.0, 64.0);
            40 * factor as u32 / 16
        };
        // A single sample within reach is as uncertain as it is bright.
        assert_eq!(priority(0.0, None, seen), of(1.0));
        // Of two alike, nothing is uncertain but what each says of itself.
        assert_eq!(priority(0.0, Some(1.0), seen), 10);
        assert_eq!(priority(0.01, Some(1.0), seen), of(0.01));
        assert_eq!(priority(0.3, Some(1.0), seen), of(0.3));
        assert_eq!(priority(1e6, Some(1.0), seen), 160);
        assert_eq!(priority(UNKNOWN, Some(1.0), seen), of(1.0));
        // Weights 6 and 4 in a row, so 0.6 and 0.4: their variance is 0.24 * 0.5^2, over 1 - 0.52; the mean is 1.2.
        let factor = 30.0 * (0.24 * 0.25 / 0.48 / 1.21f32).powf(0.25);
        assert_eq!(priority(0.0, Some(1.5), seen), 40 * factor as u32 / 16);
        // A glossy one, of sharpness 0.5, that was seen from the side: sqrt(2) aside.
        assert_eq!(priority(0.0, Some(1.0), [1.5, 0.0, 0.0, 1.0]), of(0.25 * 2.0));
        // For a surface that looks alike from everywhere, that does not matter.
        assert_eq!(priority(0.0, Some(1.0), [1.0, 0.0, 0.0, 1.0]), 10);
        // Where nothing is within reach, all is uncertain.
        let pixels = [OPEN; 25];
        let priorities = run_alike(&mut harness(params, [5, 5], &pixels)).get::<u32>("priority");
        assert_eq!(priorities, [255; 25]);
    }

    #[test]
    fn both_sides_find_the_same_priorities() {
        let params = InterpolateParams { uncertain: true, ..Default::default() };
        let pixels = random_image([67, 40], 4.0);
        // Uncertainties are rounded, but none is so close to a step of the factor that this matters.
        run_both(&mut harness(params, [67, 40], &pixels)).assert_equal::<u32>("priority");
    }
}
