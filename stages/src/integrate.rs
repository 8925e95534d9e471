//! Puts new samples into the cloud.

use std::sync::{Mutex, PoisonError};

use epigraph_core::{Access, CpuContext, Extent, Finding, In, Io, Out, Site, Stage, Threads};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{ARRIVED, DATE, LIGHT_SHIFT, POINTS, SAMPLES, SLOT},
    shared::{
        cloud::{AGE, BODY_SHIFT, CHANGED, FRESH, LIVE, NOT_DRAWN, decode_radiance, encode_radiance},
        color::{luminance, tone_mapped_luma},
        estimate::{Estimate, MOST_AT_REST},
        renewal::{Eye, is_spread},
        requests::{HIT_NONE, Sample, VIEW_LATE, VIEW_NOW},
    },
};

#[path = "explain/integrate.rs"]
mod explain;

epigraph_core::constants! {
    /// Points seen at most this many pixels from a changed one, on each axis, are flagged: a square of 7 x 7.
    const REACH: u32 = 3;
    /// Pixels on each side of a tile, of which all samples together tell whether its light has changed.
    pub const TILE: u32 = 32;
    /// What remains of a tile's evidence from one frame with samples to the next.
    const MEMORY: f32 = 0.8;
    /// Noise hardly explains a sum of differences of more than this many standard deviations.
    const CERTAIN: f32 = 5.0;
    /// Smaller shares do not count as a change of a tile's light.
    const LEAST_SHIFT: f32 = 0.1;
}

epigraph_core::params! {
    /// When a colour counts as changed, and whether samples accumulate.
    pub struct IntegrateParams {
        /// Difference of tone-mapped luma Y / (1 + Y), between a new sample and the point that it was requested to
        /// renew, above which the points seen around it are flagged.
        threshold: f32 = 0.1, in 0.0..=1.0, unit "luma";
        /// Whether a sample joins the mean of those that it renews, if they lie on the same surface, instead of replacing
        /// it. A colour then counts as changed only if noise does not explain the difference, too. The cloud must keep
        /// means: see `point_cloud`.
        accumulate: bool = false;
        /// The most samples that a mean counts for while the camera moves. More hide more noise, and what changes with
        /// the view follows more slowly.
        most: f32 = 64.0, in 1.0..=65536.0, unit "samples";
    }
}

/// Writes each sample into its slot, as a fresh point of age 0, and records the frame in which it came. If a sample has
/// a different colour from the point that its pixel showed, the points seen in the 7 x 7 pixels around it are flagged
/// as changed, which makes them age faster (`algorithms.md` section 1.5).
///
/// If samples accumulate, the point keeps the mean of the samples that renewed it, with its variance, and its colour is that
/// mean (section 12.1). Single samples may then be too noisy to tell that the light has changed, but all of a tile of 32 x 32
/// pixels together do: its points age by the share of a life by which the light has changed.
pub struct Integrate {
    cloud_position: Out<[f32; 4]>,
    /// The two fields of the points' estimates, if samples accumulate.
    means: Option<[Out<[f32; 4]>; 2]>,
    tiles: Option<Tiles>,
    cloud_radiance: Out<u32>,
    cloud_image_id: Out<u32>,
    cloud_meta: Out<u32>,
    samples: In<Sample>,
    slots: In<u32>,
    arrived: Out<u32>,
    changed: Out<u32>,
    dates: Out<u32>,
}

/// Which samples belong to a tile, what they have told, and by how much its light has changed.
#[derive(Clone, Copy)]
struct Tiles {
    asked: Out<u32>,
    evidence: Out<[f32; 2]>,
    shift: Out<f32>,
}

impl Stage for Integrate {
    const KIND: &'static str = "integrate";
    const DOC: &'static str =
        "Writes new samples into their slots; flags points around a pixel whose colour changed.";
    type Params = IntegrateParams;

    fn declare(params: &Self::Params, io: &mut Io) -> Self {
        io.column(column::P1);
        let mut cloud = io.bundle(Access::Update, "cloud", POINTS, Extent::Any);
        let cloud_position = cloud.write("position");
        let cloud_radiance = cloud.write("radiance");
        let cloud_image_id = cloud.write("image_id");
        let cloud_meta = cloud.write("meta");
        let means = params.accumulate.then(|| [cloud.write("mean"), cloud.write("record")]);
        let samples =
            io.history("samples", SAMPLES.doc("The samples that arrived in the last frame."), Extent::Any);
        let slots = io.read("slots", SLOT, Extent::Like("samples".into()));
        let arrived = io.write("arrived", ARRIVED, Extent::Fixed([1, 1]));
        // Stamps are frame numbers, so they need no clearing.
        let changed = io.persistent(
            "changed",
            "Frame number + 1 in which a colour last changed nearby.",
            Extent::Frame(1),
        );
        let dates = io.persistent("dates", DATE, Extent::Like("cloud".into()));
        let tiles = params.accumulate.then(|| Tiles {
            asked: io.persistent(
                "asked",
                "Index + 1 of the sample that this frame compares with the point that the pixel showed; then 0.",
                Extent::Frame(1),
            ),
            evidence: io.persistent(
                "evidence",
                "For each tile the sum of the differences of luminance between samples and means, and its variance.",
                Extent::Frame(TILE),
            ),
            shift: io.write(
                "shift",
                LIGHT_SHIFT.doc("Of each tile of 32 x 32 pixels."),
                Extent::Frame(TILE),
            ),
        });

        io.shader(shader!("integrate"));
        io.constants(CONSTANTS);
        if params.accumulate {
            io.define("ACCUMULATE");
        }
        io.compute("clear", Threads::Groups(1));
        io.dispatch("compare", slots);
        if let Some(Tiles { shift, .. }) = tiles {
            io.dispatch("weigh", shift);
        }
        io.dispatch("flag", cloud_meta);
        io.dispatch("insert", slots);
        io.per_arrival(samples);
        Self {
            cloud_position,
            means,
            tiles,
            cloud_radiance,
            cloud_image_id,
            cloud_meta,
            samples,
            slots,
            arrived,
            changed,
            dates,
        }
    }

    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let (samples, slots) = (cx.read(self.samples), cx.read(self.slots));
        let (mut position, mut radiance) = (cx.write(self.cloud_position), cx.write(self.cloud_radiance));
        let (mut image_id, mut meta) = (cx.write(self.cloud_image_id), cx.write(self.cloud_meta));
        let (mut arrived, mut changed) = (cx.write(self.arrived), cx.write(self.changed));
        let mut dates = cx.write(self.dates);
        let mut means = self.means.map(|means| means.map(|field| cx.write(field)));
        let (samples, slots, changed) = (&samples[..], &slots[..], &mut changed[..]);
        let (size, stamp) = (cx.frame().size, cx.frame().index.wrapping_add(1));
        let capacity = meta.len();
        let arrivals = || samples.iter().zip(slots).filter(|&(sample, &slot)| takes(sample, slot, capacity));

        // clear, compare
        let estimates = means.as_ref().map(|means| means.each_ref().map(|field| &field[..]));
        let eye = Eye::of(cx.frame());
        let shown = Shown {
            meta: &meta,
            position: &position,
            radiance: &radiance,
            estimates,
            threshold: params.threshold,
            eye: &eye,
        };
        // Equal stamps may be written in any order, and there are few: threads rarely meet.
        let stamps = Mutex::new(&mut *changed);
        let compared = samples.par_iter().zip(slots).with_min_len(1024).filter(|&(sample, &slot)| {
            let takes = takes(sample, slot, capacity);
            if takes && shown.differs_from(sample) {
                let mut changed = stamps.lock().unwrap_or_else(PoisonError::into_inner);
                stamp_around(sample.pixel, size, stamp, &mut changed);
            }
            takes
        });
        arrived[0] = compared.count() as u32;

        // weigh
        let shift = self.tiles.map(|Tiles { asked, evidence, shift }| {
            let (mut asked, mut evidence, mut shift) = (cx.write(asked), cx.write(evidence), cx.write(shift));
            for (index, (sample, &slot)) in (1..).zip(samples.iter().zip(slots)) {
                if takes(sample, slot, capacity) && shown.renewed_by(sample).is_some() {
                    // What a source asks for twice counts once.
                    if let Some(asked) = asked.get_mut(sample.pixel as usize) {
                        *asked = index;
                    }
                }
            }
            let (width, tile) = (size[0] as usize, TILE as usize);
            let columns = width.div_ceil(tile);
            let rows = evidence.par_chunks_mut(columns).zip(shift.par_chunks_mut(columns));
            rows.zip(asked.par_chunks_mut(width * tile)).for_each(|((evidence, shift), asked)| {
                for (column, (evidence, shift)) in evidence.iter_mut().zip(shift).enumerate() {
                    let mut found = Evidence::default();
                    for row in asked.chunks_mut(width) {
                        let pixels = column * tile..width.min((column + 1) * tile);
                        for asked in row[pixels].iter_mut().filter(|asked| **asked != 0) {
                            found.add(&shown, &samples[std::mem::take(asked) as usize - 1]);
                        }
                    }
                    (*evidence, *shift) = found.after(*evidence);
                }
            });
            shift
        });

        // flag: most points pass every test, so branchless code is faster than skipping
        let last = changed.len() as u32 - 1;
        let changed = &*changed;
        meta.par_iter_mut().zip(&*image_id).with_min_len(4096).for_each(|(meta, &pixel)| {
            let within = pixel.min(last);
            let is_stamped = (changed[within as usize] == stamp) & (within == pixel) & (*meta & LIVE != 0);
            *meta = (*meta & !FRESH) | (CHANGED * u32::from(is_stamped));
        });
        let shift = shift.as_deref().unwrap_or_default();
        if let Some([mean, record]) = &mut means
            && shift.iter().any(|&shift| shift > 0.0)
        {
            let estimates = mean.par_iter_mut().zip(&mut record[..]);
            let points = meta.par_iter_mut().zip(&*image_id).zip(estimates).with_min_len(4096);
            points.for_each(|((meta, &pixel), (mean, record))| {
                let share = tile_of(pixel, size).map_or(0.0, |tile| shift[tile]);
                if share > 0.0 && *meta & LIVE != 0 {
                    let age = (*meta & AGE) + (share * AGE as f32) as u32;
                    *meta = *meta & !AGE | age.min(AGE);
                    [*mean, *record] = Estimate::load(*mean, *record).doubt(share, MOST_AT_REST).store();
                }
            });
        }

        // insert
        let (position, radiance, meta) = (&mut position[..], &mut radiance[..], &mut meta[..]);
        let (image_id, dates) = (&mut image_id[..], &mut dates[..]);
        if let Some([mean, record]) = &mut means {
            for (sample, &slot) in arrivals() {
                let point = slot as usize;
                let mut estimate = Estimate::of(sample, eye.position);
                if sample.reuse == slot && eye.renews(sample, meta[point], position[point]) {
                    let before = Estimate::load(mean[point], record[point]);
                    let before = eye.looks_again(before, &estimate, params.most);
                    estimate = before.join(estimate);
                }
                [mean[point], record[point]] = estimate.store();
                radiance[point] = encode_radiance(estimate.mean);
            }
        } else {
            arrivals().for_each(|(sample, &slot)| radiance[slot as usize] = encode_radiance(sample.radiance));
        }
        rayon::join(
            || {
                // One that is spread over the pixel renews the point where it lies, which is where classes need it.
                for (sample, &slot) in arrivals().filter(|(sample, _)| !is_spread(sample)) {
                    position[slot as usize] = sample.place();
                }
            },
            || {
                for (sample, &slot) in arrivals() {
                    let slot = slot as usize;
                    image_id[slot] = NOT_DRAWN;
                    meta[slot] = LIVE | FRESH | sample.body << BODY_SHIFT;
                    dates[slot] = stamp;
                }
            },
        );
        Ok(())
    }

    fn explain(&self, params: &IntegrateParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// Whether there is a sample and it has a slot.
fn takes(sample: &Sample, slot: u32, capacity: usize) -> bool {
    sample.hit != HIT_NONE && (slot as usize) < capacity
}

/// What pixels showed before this frame's samples arrived.
struct Shown<'a> {
    meta: &'a [u32],
    position: &'a [[f32; 4]],
    radiance: &'a [u32],
    /// As in [`Integrate`].
    estimates: Option<[&'a [[f32; 4]]; 2]>,
    threshold: f32,
    eye: &'a Eye,
}

impl Shown<'_> {
    /// The live point that a sample was requested to renew.
    fn renewed_by(&self, sample: &Sample) -> Option<usize> {
        let point = sample.reuse as usize;
        let meta = *self.meta.get(point).filter(|meta| **meta & LIVE != 0)?;
        let is_it = match sample.view {
            VIEW_NOW => true,
            VIEW_LATE => self.eye.renews(sample, meta, self.position[point]),
            _ => false,
        };
        is_it.then_some(point)
    }

    /// Whether the point that a sample was requested to renew is live and had a different colour.
    fn differs_from(&self, sample: &Sample) -> bool {
        let Some(point) = self.renewed_by(sample) else { return false };
        if let Some([mean, record]) = self.estimates {
            // The eye does not matter here.
            let single = Estimate::of(sample, [0.0; 3]);
            return Estimate::load(mean[point], record[point]).differs(&single, self.threshold);
        }
        let before = luminance(decode_radiance(self.radiance[point]));
        // Compared with stored precision.
        let after = luminance(decode_radiance(encode_radiance(sample.radiance)));
        (tone_mapped_luma(after) - tone_mapped_luma(before)).abs() > self.threshold
    }
}

/// What the samples of a tile tell of a frame's light.
#[derive(Clone, Copy, Default)]
struct Evidence {
    /// The sum of the differences between the luminance of samples and that of the means of points, and its variance.
    difference: f32,
    variance: f32,
    /// The sum of the luminance of the means.
    before: f32,
}

impl Evidence {
    fn add(&mut self, shown: &Shown, sample: &Sample) {
        let (Some(point), Some([mean, record])) = (shown.renewed_by(sample), shown.estimates) else { return };
        let before = Estimate::load(mean[point], record[point]);
        // The eye does not matter here.
        let [difference, variance] = before.difference(&Estimate::of(sample, [0.0; 3]));
        self.difference += difference;
        // Textures and edges differ by more than their noise, but not all to one side.
        self.variance += variance.max(difference * difference);
        self.before += luminance(before.mean);
    }

    /// The evidence of a tile and the share by which its light has changed, after these samples.
    fn after(&self, [difference, variance]: [f32; 2]) -> ([f32; 2], f32) {
        let difference = MEMORY * difference + self.difference;
        let variance = MEMORY * MEMORY * variance + self.variance;
        let share = self.difference.abs() / self.before.max(f32::MIN_POSITIVE);
        let is_certain = difference * difference > CERTAIN * CERTAIN * variance;
        let goes_on = difference * self.difference > 0.0 && share > LEAST_SHIFT;
        ([difference, variance], if is_certain && goes_on { share.min(1.0) } else { 0.0 })
    }
}

/// The tile of a pixel; none beyond the image.
fn tile_of(pixel: u32, [width, height]: [u32; 2]) -> Option<usize> {
    let (x, y) = (pixel % width, pixel / width);
    (y < height).then(|| (y / TILE * width.div_ceil(TILE) + x / TILE) as usize)
}

/// Stamps the 7 x 7 pixels around one, clipped to the image.
fn stamp_around(pixel: u32, [width, height]: [u32; 2], stamp: u32, changed: &mut [u32]) {
    let (x, y) = (pixel % width, pixel / width);
    for y in y.saturating_sub(REACH)..(y + REACH + 1).min(height) {
        for x in x.saturating_sub(REACH)..(x + REACH + 1).min(width) {
            changed[(y * width + x) as usize] = stamp;
        }
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::{
        cloud::{MAX_RADIANCE, NO_POINT},
        octahedral::{NO_NORMAL, encode_oct16},
        requests::{HIT_BACKGROUND, HIT_SURFACE, SPREAD, VIEW_PREDICTED},
        testing::{Random, run_alike, run_both, settings},
    };

    const SIZE: [u32; 2] = [16, 12];
    const GREY: [f32; 3] = [0.5; 3];

    /// A cloud in which point i is grey and live, has age i and is shown by pixel i.
    fn harness(capacity: u32, samples: &[Sample], slots: &[u32]) -> Harness<Integrate> {
        let mut harness = Harness::new(IntegrateParams::default(), &settings(SIZE, samples.len() as u32));
        harness.set("cloud.position", &vec![[1.0f32; 4]; capacity as usize]);
        harness.set("cloud.radiance", &vec![encode_radiance(GREY); capacity as usize]);
        harness.set("cloud.image_id", &(0..capacity).collect::<Vec<_>>());
        harness.set("cloud.meta", &(0..capacity).map(|age| LIVE | age & AGE).collect::<Vec<_>>());
        harness.set("samples", samples);
        harness.set("slots", slots);
        harness
    }

    fn sample(pixel: u32, radiance: [f32; 3]) -> Sample {
        Sample {
            position: [1.0, 2.0, 3.0],
            hit: HIT_SURFACE,
            radiance,
            pixel,
            reuse: pixel,
            ..Sample::default()
        }
    }

    #[test]
    fn samples_become_fresh_points() {
        let sky = Sample { hit: HIT_BACKGROUND, ..sample(5, GREY) };
        let samples = [sample(4, GREY), Sample::default(), sky, sample(6, GREY)];
        let out = run_alike(&mut harness(16, &samples, &[9, 3, 2, NO_POINT]));
        let (position, meta) = (out.get::<[f32; 4]>("cloud.position"), out.get::<u32>("cloud.meta"));
        assert_eq!((position[9], meta[9]), ([1.0, 2.0, 3.0, 1.0], LIVE | FRESH));
        assert_eq!((position[2], meta[2]), ([1.0, 2.0, 3.0, 0.0], LIVE | FRESH));
        // An empty entry has no effect, whatever its slot.
        assert_eq!((position[3], meta[3]), ([1.0; 4], LIVE | 3));
        let of_body = Sample { body: 200, ..sample(4, GREY) };
        let meta = run_alike(&mut harness(16, &[of_body], &[9])).get::<u32>("cloud.meta")[9];
        assert_eq!(meta, LIVE | FRESH | 200 << BODY_SHIFT);
        let image_id = out.get::<u32>("cloud.image_id");
        assert_eq!([image_id[9], image_id[2], image_id[3]], [NOT_DRAWN, NOT_DRAWN, 3]);
        assert_eq!(out.get::<u32>("arrived"), [2]);
    }

    #[test]
    fn a_point_stays_where_it_is_when_a_sample_from_elsewhere_in_its_pixel_renews_it() {
        let spread = Sample { aim: SPREAD, ..sample(4, [1.0; 3]) };
        let out = run_alike(&mut harness(16, &[spread], &[4]));
        assert_eq!(out.get::<[f32; 4]>("cloud.position")[4], [1.0; 4]);
        assert_eq!(out.get::<u32>("cloud.radiance")[4], encode_radiance([1.0; 3]));
        assert_eq!(out.get::<u32>("cloud.meta")[4], LIVE | FRESH);
        // What has no point to renew is where it is.
        let predicted = Sample { reuse: NO_POINT, view: VIEW_PREDICTED, ..spread };
        let out = run_alike(&mut harness(16, &[predicted], &[4]));
        assert_eq!(out.get::<[f32; 4]>("cloud.position")[4], [1.0, 2.0, 3.0, 1.0]);
    }

    #[test]
    fn a_slot_keeps_the_date_of_its_last_sample() {
        let mut harness = harness(8, &[sample(4, GREY), sample(5, GREY)], &[6, 2]);
        assert_eq!(run_alike(&mut harness).get::<u32>("dates"), [0, 0, 1, 0, 0, 0, 1, 0]);
        // Frames without samples, and samples without a slot, do not change it.
        harness.frame.index = 4;
        harness.set("slots", &[6, NO_POINT]);
        assert_eq!(run_alike(&mut harness).get::<u32>("dates"), [0, 0, 1, 0, 0, 0, 5, 0]);
        harness.frame.index = 5;
        harness.set("samples", &[Sample::default(); 2]);
        assert_eq!(run_alike(&mut harness).get::<u32>("dates"), [0, 0, 1, 0, 0, 0, 5, 0]);
    }

    #[test]
    fn points_are_fresh_in_their_first_frame_only() {
        let mut harness = harness(4, &[Sample::default()], &[NO_POINT]);
        harness.set("cloud.meta", &[LIVE | FRESH, 0, LIVE | CHANGED | 7, LIVE]);
        assert_eq!(run_alike(&mut harness).get::<u32>("cloud.meta"), [LIVE, 0, LIVE | CHANGED | 7, LIVE]);
    }

    #[test]
    fn empty_slots_are_neither_flagged_nor_compared() {
        // Every second slot is empty, but keeps the age and the pixel of the point that was there.
        let meta: Vec<u32> = (0..192).map(|slot| if slot % 2 == 0 { LIVE | 7 } else { 7 }).collect();
        let with = |reuse: u32| {
            let mut harness = harness(192, &[Sample { reuse, ..sample(40, [2.0; 3]) }], &[191]);
            harness.set("cloud.meta", &meta);
            let found = run_alike(&mut harness).get::<u32>("cloud.meta");
            assert!((0..191).all(|slot| found[slot] & !CHANGED == meta[slot]));
            let is_flagged = |slot: &usize| found[*slot] & CHANGED != 0;
            [(0..191).step_by(2).filter(is_flagged).count(), (1..191).step_by(2).filter(is_flagged).count()]
        };
        // Of 7 columns and of the 6 rows from 0 to 5, the 3 columns with even numbers.
        assert_eq!((with(40), with(41)), ([18, 0], [0, 0]));
    }

    #[test]
    fn a_slot_beyond_the_cloud_is_none() {
        for slot in [8, 9, NO_POINT] {
            let mut harness = harness(8, &[sample(4, [2.0; 3])], &[slot]);
            let out = run_alike(&mut harness);
            assert_eq!(out.get::<u32>("arrived"), [0], "{slot}");
            assert_eq!(out.get::<u32>("cloud.meta"), (0..8).map(|age| LIVE | age).collect::<Vec<_>>());
            assert_eq!(out.get::<u32>("cloud.radiance"), [encode_radiance(GREY); 8]);
            assert_eq!(out.get::<u32>("dates"), [0; 8]);
        }
    }

    /// The slots that are flagged when this sample arrives.
    fn flagged(sample: Sample) -> Vec<u32> {
        let out = run_alike(&mut harness(SIZE[0] * SIZE[1], &[sample], &[sample.pixel]));
        let meta = out.get::<u32>("cloud.meta");
        (0..meta.len() as u32).filter(|&slot| meta[slot as usize] & CHANGED != 0).collect()
    }

    #[test]
    fn a_changed_colour_flags_the_points_of_the_7x7_pixels_but_not_the_new_point() {
        // The luma changes from 1/3 to 2/3.
        let slots = flagged(sample(5 * 16 + 8, [2.0; 3]));
        let around = |x: std::ops::Range<u32>, y: std::ops::Range<u32>, but: u32| -> Vec<u32> {
            y.flat_map(|y| x.clone().map(move |x| y * 16 + x)).filter(|&slot| slot != but).collect()
        };
        assert_eq!(slots, around(5..12, 2..9, 5 * 16 + 8));
        // The image's corners clip the square.
        assert_eq!(flagged(sample(0, [2.0; 3])), around(0..4, 0..4, 0));
        assert_eq!(flagged(sample(16 * 12 - 1, [2.0; 3])), around(12..16, 8..12, 16 * 12 - 1));
    }

    #[test]
    fn the_threshold_applies_to_tone_mapped_luma() {
        // 0.5 has luma 1/3. The threshold of 0.1 is exceeded above Y = x / (1 - x) with x = 1/3 + 0.1: 0.7647.
        assert!(flagged(sample(40, [0.755; 3])).is_empty());
        assert!(!flagged(sample(40, [0.775; 3])).is_empty());
    }

    #[test]
    fn only_a_new_view_of_the_shown_point_is_compared() {
        let bright = sample(40, [2.0; 3]);
        assert!(!flagged(bright).is_empty());
        assert!(flagged(Sample { view: VIEW_PREDICTED, ..bright }).is_empty());
        assert!(flagged(Sample { reuse: NO_POINT, ..bright }).is_empty());
    }

    #[test]
    fn stamps_of_earlier_frames_do_not_count() {
        let mut harness = harness(64, &[sample(20, [2.0; 3])], &[63]);
        assert!(run_alike(&mut harness).get::<u32>("cloud.meta").iter().any(|meta| meta & CHANGED != 0));
        harness.frame.index = 1;
        harness.set("samples", &[sample(20, GREY)]);
        assert!(run_alike(&mut harness).get::<u32>("cloud.meta").iter().all(|meta| meta & CHANGED == 0));
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(21);
        let capacity = 400;
        // Every slot occurs at most once, as in the output of `replace`.
        let samples: Vec<Sample> = (0..300)
            .map(|_| Sample {
                hit: random.below(3),
                body: random.below(256),
                radiance: std::array::from_fn(|_| random.between(0.0, 1.0)),
                reuse: random.below(2 * capacity),
                view: random.below(2),
                ..sample(random.below(SIZE[0] * SIZE[1]), GREY)
            })
            .collect();
        let slots: Vec<u32> =
            (0..300).map(|slot| if random.below(9) == 0 { NO_POINT } else { 399 - slot }).collect();
        let mut harness = harness(capacity, &samples, &slots);
        harness.frame.index = 17;
        let both = run_both(&mut harness);
        for output in ["cloud.radiance", "cloud.image_id", "cloud.meta", "arrived", "changed", "dates"] {
            // Lumas are rounded, but none is so close to the threshold that this matters.
            both.assert_equal::<u32>(output);
        }
        both.assert_equal::<[f32; 4]>("cloud.position");
    }

    #[test]
    fn radiance_that_is_no_radiance_is_stored_as_the_nearest() {
        let radiance = [
            [-1.0, f32::NAN, -f32::INFINITY],
            [f32::INFINITY, 1e30, -0.0],
            [f32::MIN_POSITIVE, f32::NAN, 1.0],
        ];
        let samples = radiance.map(|radiance| sample(4, radiance));
        let out = run_alike(&mut harness(8, &samples, &[1, 2, 3]));
        let stored: Vec<_> =
            out.get::<u32>("cloud.radiance")[1..4].iter().map(|&r| decode_radiance(r)).collect();
        assert_eq!(stored, [[0.0; 3], [MAX_RADIANCE, MAX_RADIANCE, 0.0], [0.0, 0.0, 1.0]]);
    }

    #[test]
    fn a_threshold_of_0_still_takes_a_difference() {
        let flags = |radiance| {
            let mut harness = Harness::<Integrate>::new(
                IntegrateParams { threshold: 0.0, ..IntegrateParams::default() },
                &settings(SIZE, 1),
            );
            harness.set("cloud.position", &[[1.0f32; 4]; 192]);
            harness.set("cloud.radiance", &[encode_radiance(GREY); 192]);
            harness.set("cloud.image_id", &(0..192).collect::<Vec<u32>>());
            harness.set("cloud.meta", &[LIVE; 192]);
            harness.set("samples", &[sample(5 * 16 + 8, radiance)]);
            harness.set("slots", &[191u32]);
            run_alike(&mut harness)
                .get::<u32>("cloud.meta")
                .iter()
                .filter(|&&meta| meta & CHANGED != 0)
                .count()
        };
        assert_eq!((flags(GREY), flags([0.51; 3])), (0, 49));
    }

    /// As [`harness`], for points that accumulate: each has had four samples of grey, with a variance of 0.01 each.
    fn accumulating(capacity: u32, samples: &[Sample], slots: &[u32]) -> Harness<Integrate> {
        let params = IntegrateParams { accumulate: true, ..IntegrateParams::default() };
        let mut harness = Harness::new(params, &settings(SIZE, samples.len() as u32));
        harness.set("cloud.position", &vec![[1.0f32, 2.0, 3.0, 1.0]; capacity as usize]);
        harness.set("cloud.radiance", &vec![encode_radiance(GREY); capacity as usize]);
        harness.set("cloud.image_id", &(0..capacity).collect::<Vec<_>>());
        harness.set("cloud.meta", &vec![LIVE; capacity as usize]);
        harness.set("cloud.mean", &vec![[0.5, 0.5, 0.5, 0.0025f32]; capacity as usize]);
        let [x, y, z] = Estimate::of(&sample(0, GREY), harness.frame.previous.eye).towards_eye;
        harness.set("cloud.record", &vec![[x, y, z, 4.0]; capacity as usize]);
        harness.set("samples", samples);
        harness.set("slots", slots);
        harness
    }

    /// Mean, variance of the mean, and count of the point in slot 4 after a sample of 0.6 with a variance of 0.01.
    fn after(change: impl Fn(&mut Harness<Integrate>, &mut Sample)) -> [f32; 3] {
        let mut sample = Sample { variance: 0.01, normal: NO_NORMAL, ..sample(4, [0.6; 3]) };
        let mut harness = accumulating(8, &[sample], &[4]);
        change(&mut harness, &mut sample);
        harness.set("samples", &[sample]);
        let out = run_alike(&mut harness);
        let mean = out.get::<[f32; 4]>("cloud.mean")[4];
        assert_eq!(out.get::<u32>("cloud.radiance")[4], encode_radiance([mean[0], mean[1], mean[2]]));
        [mean[0], mean[3], out.get::<[f32; 4]>("cloud.record")[4][3]]
    }

    fn assert_close(got: [f32; 3], expected: [f32; 3]) {
        let is_close = got.iter().zip(&expected).all(|(got, expected)| (got - expected).abs() < 1e-6);
        assert!(is_close, "{got:?} {expected:?}");
    }

    #[test]
    fn a_sample_joins_the_mean_of_the_point_that_it_renews() {
        assert_close(after(|_, _| ()), [0.52, 0.002, 5.0]);
        let alone = [0.6, 0.01, 1.0];
        assert_close(after(|_, sample| sample.reuse = 5), alone);
        assert_close(after(|_, sample| sample.hit = HIT_BACKGROUND), alone);
        assert_close(after(|_, sample| sample.body = 1), alone);
        assert_close(after(|harness, _| harness.set("cloud.meta", &[0u32; 8])), alone);
        assert_close(after(|harness, _| harness.set("cloud.position", &[[1.0f32, 2.0, 3.0, 0.0]; 8])), alone);
    }

    #[test]
    fn points_of_another_surface_do_not_accumulate() {
        // The normal is z; a pixel is 2 tan_x / 16 times the distance wide.
        let at = |aside: f32| {
            after(|harness, sample| {
                let view = &mut harness.frame.previous;
                (view.eye, view.tan_x) = ([1.0, 2.0, 5.0], 0.8);
                sample.normal = encode_oct16(glam::Vec3::Z);
                harness.set("cloud.position", &[[1.0, 2.0, 3.0 + aside, 1.0]; 8]);
            })[2]
        };
        // Pixels are 0.2 wide there, so a quarter is 0.05.
        assert_eq!([at(0.049), at(0.051), at(-0.051)], [5.0, 1.0, 1.0]);
    }

    #[test]
    fn late_samples_join_only_what_is_at_the_same_place() {
        // The eye looks at the sample along z; a pixel is 0.2 wide there, so 1.5 pixels are 0.3.
        let at = |view: u32, aside: f32, near: f32| {
            after(|harness, sample| {
                let previous = &mut harness.frame.previous;
                (previous.eye, previous.tan_x) = ([1.0, 2.0, 5.0], 0.8);
                (sample.view, sample.normal) = (view, NO_NORMAL);
                harness.set("cloud.position", &[[1.0 + aside, 2.0, 3.0 + near, 1.0]; 8]);
            })[2]
        };
        assert_eq!([at(VIEW_LATE, 0.299, 0.0), at(VIEW_LATE, -0.301, 0.0)], [5.0, 1.0]);
        // Before or behind it, as on a surface that is seen at a flat angle.
        assert_eq!([at(VIEW_LATE, 0.0, 1.9), at(VIEW_LATE, 0.0, -1.9)], [5.0, 5.0]);
        // Others were requested for what is in the slot.
        assert_eq!(at(VIEW_NOW, 9.0, 0.0), 5.0);
    }

    #[test]
    fn late_samples_tell_of_changes_where_their_point_still_is() {
        let flags = |x: f32| {
            let sample = Sample { view: VIEW_LATE, ..sample(5 * 16 + 8, [2.0; 3]) };
            let mut harness = harness(192, &[sample], &[191]);
            harness.set("cloud.position", &[[x, 2.0, 3.0, 1.0f32]; 192]);
            let meta = run_alike(&mut harness).get::<u32>("cloud.meta").to_vec();
            meta.iter().filter(|&&meta| meta & CHANGED != 0).count()
        };
        assert_eq!([flags(1.0), flags(9.0)], [49, 0]);
    }

    #[test]
    fn a_moving_camera_caps_the_count_and_forgets_what_depends_on_direction() {
        let moving = |sharpness: f32| {
            after(|harness, sample| {
                harness.frame.previous.eye = [1.0, 2.0, 4.0];
                harness.set("cloud.record", &[[0.0, 0.6, 0.8, 100.0f32]; 8]);
                harness.set("cloud.mean", &[[0.5, 0.5, 0.5, 0.0001f32]; 8]);
                sample.sharpness = sharpness;
            })
        };
        // The variance of one sample is 0.01.
        assert_close(moving(0.0), [0.5 + 0.1 / 65.0, 0.01 / 65.0, 65.0]);
        // The chord from (0, 0.6, 0.8) to (0, 0, 1) is sqrt(0.4) long. So a sharpness of 0.5 adds 0.4 * (0.5 * 0.5)^2 =
        // 0.025 to the variance of the mean: less than half a sample is left.
        assert_close(moving(0.5), [0.6, 0.01, 1.0]);
        let count = 0.01 / (0.01 / 64.0 + 0.4 * 0.05f32.powi(2));
        assert_close(moving(0.1), [0.5 + 0.1 / (count + 1.0), 0.01 / (count + 1.0), count + 1.0]);
    }

    #[test]
    fn noise_does_not_count_as_a_change() {
        let flags = |variance: f32, radiance: f32| {
            let sample = Sample { variance, normal: NO_NORMAL, ..sample(40, [radiance; 3]) };
            let out = run_alike(&mut accumulating(192, &[sample], &[40]));
            out.get::<u32>("cloud.meta").iter().filter(|&&meta| meta & CHANGED != 0).count()
        };
        // Far beyond the threshold of 0.1; three deviations are 0.335 at least.
        assert_eq!([flags(0.0, 0.83), flags(0.0, 0.84), flags(1.0, 2.0), flags(1.0, 4.0)], [0, 41, 0, 41]);
    }

    #[test]
    fn both_sides_accumulate_alike() {
        let mut random = Random(22);
        let mut between = |low, high| random.between(low, high);
        let samples: Vec<Sample> = (0..192)
            .map(|slot| Sample {
                radiance: std::array::from_fn(|_| between(0.0, 1.0)),
                variance: between(-0.02, 0.1),
                sharpness: between(-2.0, 2.0).max(0.0),
                normal: encode_oct16(glam::Vec3::new(between(-1.0, 1.0), 0.3, between(-1.0, 1.0))),
                position: std::array::from_fn(|_| between(0.9, 1.1)),
                view: if slot % 3 == 0 { VIEW_LATE } else { VIEW_NOW },
                ..sample(slot, GREY)
            })
            .collect();
        let slots: Vec<u32> = (0..192).collect();
        let mut harness = accumulating(192, &samples, &slots);
        let mean: Vec<_> = (0..192).map(|_| [0; 4].map(|_| between(0.0, 1.0))).collect();
        harness.set("cloud.mean", &mean.iter().map(|m| [m[0], m[1], m[2], m[3] - 0.1]).collect::<Vec<_>>());
        let record = |_| [between(-1.0, 1.0), 0.6, between(-1.0, 1.0), between(0.0, 90.0)];
        harness.set("cloud.record", &(0..192).map(record).collect::<Vec<_>>());
        harness.set("cloud.position", &vec![[1.0f32; 4]; 192]);
        (harness.frame.previous.eye, harness.frame.previous.tan_x) = ([0.0, 0.0, 5.0], 0.5);
        let both = run_both(&mut harness);
        both.assert_close("cloud.mean", 1e-4);
        both.assert_close("cloud.record", 1e-4);
        let joined = both.cpu.get::<[f32; 4]>("cloud.record").iter().filter(|record| record[3] > 1.0).count();
        assert!((40..190).contains(&joined), "{joined}");
    }

    /// Samples of `grey` for the first `count` points of a tile, whose means are 0.5 with a variance of 0.0025.
    fn tile_of_samples(count: u32, grey: f32, variance: f32) -> Harness<Integrate> {
        let sample = |slot| Sample { variance, normal: NO_NORMAL, ..sample(slot, [grey; 3]) };
        let samples: Vec<_> = (0..count).map(sample).collect();
        // They take slots whose points are beyond the image.
        accumulating(512, &samples, &(192..192 + count).collect::<Vec<_>>())
    }

    /// The evidence of the only tile, and the share by which its light has changed.
    #[track_caller]
    fn weighed(mut harness: Harness<Integrate>) -> ([f32; 2], f32) {
        let both = run_both(&mut harness);
        both.assert_close("evidence", 1e-5);
        both.assert_close("shift", 1e-5);
        assert!(both.gpu.get::<u32>("asked").iter().all(|&asked| asked == 0));
        (both.cpu.get::<[f32; 2]>("evidence")[0], both.cpu.get::<f32>("shift")[0])
    }

    #[test]
    fn all_samples_of_a_tile_tell_of_a_change_that_none_tells_alone() {
        let close = |(got, shift): ([f32; 2], f32), expected: [f32; 2], share: f32| {
            let near = |a: f32, b: f32| (a - b).abs() < 1e-5 * b.abs().max(0.1);
            let is_close = near(got[0], expected[0]) && near(got[1], expected[1]) && near(shift, share);
            assert!(is_close, "{got:?} {shift}, expected {expected:?} {share}");
        };
        // Each differs by -0.2, less than two deviations of sqrt(0.0025 + 0.0125). As differences they count as noise of 0.2:
        // 40 differ by 8, which are 6.3 deviations of sqrt(40 * 0.04). The share is 0.2 / 0.5.
        close(weighed(tile_of_samples(40, 0.3, 0.0125)), [-8.0, 40.0 * 0.04], 0.4);
        // Nine do not suffice: 1.8 are 3 deviations.
        close(weighed(tile_of_samples(9, 0.3, 0.0125)), [-1.8, 9.0 * 0.04], 0.0);
        // Nor does a small share.
        close(weighed(tile_of_samples(192, 0.451, 1e-5)), [-192.0 * 0.049, 192.0 * 0.0125], 0.0);
        let known = 0.3 * 0.3;
        close(weighed(tile_of_samples(100, 0.8, 0.0125)), [30.0, 100.0 * known], 0.6);
        close(weighed(tile_of_samples(24, 0.8, 0.0125)), [7.2, 24.0 * known], 0.0);
        // More than all of it does not change.
        close(weighed(tile_of_samples(100, 2.0, 0.0125)), [150.0, 225.0], 1.0);
    }

    #[test]
    fn evidence_of_earlier_frames_fades() {
        let nine = Evidence { difference: -1.8, variance: 0.135, before: 4.5 };
        let close = |(got, shift): ([f32; 2], f32), expected: [f32; 2], share: f32| {
            let near = |a: f32, b: f32| (a - b).abs() < 1e-5;
            let is_close = near(got[0], expected[0]) && near(got[1], expected[1]) && near(shift, share);
            assert!(is_close, "{got:?} {shift}, expected {expected:?} {share}");
        };
        // With what was known before, of which four fifths remain, nine suffice.
        close(nine.after([-1.0, 0.05]), [-2.6, 0.032 + 0.135], 0.4);
        // Not if it points to the other side, and not without any sample.
        close(nine.after([10.0, 0.1]), [6.2, 0.064 + 0.135], 0.0);
        close(Evidence::default().after([-5.0, 0.05]), [-4.0, 0.032], 0.0);
    }

    #[test]
    fn the_points_of_a_changed_tile_age_and_are_in_doubt() {
        let mut harness = tile_of_samples(40, 0.31, 0.0125);
        let mut meta = vec![LIVE; 512];
        (meta[7], meta[8]) = (0, LIVE | FRESH);
        harness.set("cloud.meta", &meta);
        // Point 9 is beyond the image.
        let mut ids: Vec<u32> = (0..512).collect();
        ids[9] = NOT_DRAWN;
        harness.set("cloud.image_id", &ids);
        let both = run_both(&mut harness);
        both.assert_close("cloud.record", 1e-4);
        both.assert_equal::<u32>("cloud.meta");
        let meta: Vec<u32> = both.cpu.get("cloud.meta");
        let record: Vec<[f32; 4]> = both.cpu.get("cloud.record");
        // 39 samples are left: that of an empty slot tells nothing.
        let doubted =
            Estimate::load([0.5, 0.5, 0.5, 0.0025], [0.0, 0.0, 1.0, 4.0]).doubt(0.38, MOST_AT_REST).count;
        for (slot, (meta, [.., count])) in meta.into_iter().zip(record).take(192).enumerate() {
            let is_left = matches!(slot, 7 | 9);
            assert_eq!(meta & AGE, if is_left { 0 } else { (0.38 * 65535.0) as u32 }, "{slot}");
            let expected = if is_left { 4.0 } else { doubted };
            assert!((count - expected).abs() < 1e-4, "{slot}: {count}, expected {expected}");
        }
    }
}
