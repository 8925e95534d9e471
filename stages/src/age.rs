//! Ages points and evicts the oldest.

use epigraph_core::{Access, CpuContext, Extent, Finding, In, Io, Out, Site, Stage, Threads};
use fearless_simd::{Simd, dispatch, prelude::*, u32x8};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{AGES, ARRIVED, POINTS},
    shared::{
        cloud::{AGE, AGE_ONE, CHANGED, FRESH, LIVE, NOT_DRAWN},
        lanes::{LANES, bits, padded, store},
    },
};

#[path = "explain/age.rs"]
mod explain;

epigraph_core::constants! {
    /// The age in 8.8 fixed point that a point reaches on average when it is replaced.
    const AGE_WHEN_REPLACED: f32 = 128.0 * AGE_ONE as f32;
    /// The age in 8.8 fixed point from which points are evicted.
    const AGE_OF_EVICTION: u32 = 255 * AGE_ONE;
    /// Weight of one frame in the moving average of arrivals.
    const RATE_WEIGHT: f32 = 0.1;
}

/// Points per parallel task.
const CHUNK: usize = 16384;

epigraph_core::params! {
    /// How fast points age.
    pub struct AgeParams {
        /// Points that no pixel shows age faster by this many times the increment.
        not_drawn_penalty: f32 = 3.0, in 0.0..=255.0, unit "increments";
        /// Age added once to points near a pixel whose colour changed.
        change_penalty: f32 = 64.0, in 0.0..=255.0, unit "age";
        /// Points of age 255 leave the cloud even if no sample replaces them.
        evict: bool = true;
    }
}

/// Ages every point except this frame's by an increment that brings it to age 128 when its turn to be replaced comes
/// (`algorithms.md` section 1.5), and counts the points of each whole age. Frames in which no sample arrives do not
/// count: nothing is replaced in them, so nothing ages.
pub struct Age {
    cloud_image_id: In<u32>,
    cloud_meta: Out<u32>,
    arrived: In<u32>,
    rate: Out<f32>,
    histogram: Out<u32>,
}

impl Stage for Age {
    const KIND: &'static str = "age";
    const DOC: &'static str =
        "Ages the points, faster where they are not seen or out of date; evicts the oldest.";
    type Params = AgeParams;

    fn declare(_: &Self::Params, io: &mut Io) -> Self {
        io.column(column::P1);
        let mut cloud = io.bundle(Access::Update, "cloud", POINTS, Extent::Any);
        let cloud_image_id = cloud.read("image_id");
        let cloud_meta = cloud.write("meta");
        let arrived = io.read("arrived", ARRIVED, Extent::Fixed([1, 1]));
        let rate = io.persistent(
            "rate",
            "Moving average of the samples that arrive per frame, of frames in which some do.",
            Extent::Fixed([1, 1]),
        );
        let histogram = io.write("histogram", AGES, Extent::Fixed([256, 1]));

        io.shader(shader!("age"));
        io.constants(CONSTANTS);
        io.compute("measure", Threads::Groups(1));
        io.dispatch("grow", cloud_meta);
        // Who sees which point matters only in a frame in which points age.
        io.per_change([arrived.into(), cloud_meta.into()]);
        Self { cloud_image_id, cloud_meta, arrived, rate, histogram }
    }

    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let (image_id, mut meta) = (cx.read(self.cloud_image_id), cx.write(self.cloud_meta));
        let (mut rate, mut histogram) = (cx.write(self.rate), cx.write(self.histogram));

        // measure
        let arrived = cx.read(self.arrived)[0] as f32;
        rate[0] = averaged(rate[0], arrived);

        // grow
        let increment = increment(rate[0], arrived, meta.len() as u32);
        let not_drawn = (increment as f32 * params.not_drawn_penalty).round_ties_even() as u32;
        let change = (params.change_penalty * AGE_ONE as f32).round_ties_even() as u32;
        let level = cx.level();
        let counts = meta.par_chunks_mut(CHUNK).zip(image_id.par_chunks(CHUNK)).map(|(meta, image_id)| {
            let step = Step { increment, not_drawn, change, evict: params.evict };
            dispatch!(level, simd => step.grow(simd, meta, image_id))
        });
        let counts = counts.reduce(|| [0; 256], |a, b| std::array::from_fn(|age| a[age] + b[age]));
        histogram.copy_from_slice(&counts);
        Ok(())
    }

    fn explain(&self, params: &AgeParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// How points age in a frame, in 8.8 fixed point.
struct Step {
    increment: u32,
    /// In addition, for a point that no pixel shows.
    not_drawn: u32,
    /// In addition, for a point whose surroundings have changed.
    change: u32,
    /// Whether points of [`AGE_OF_EVICTION`] leave the cloud.
    evict: bool,
}

impl Step {
    /// A point's `meta` after the frame. This is the rule; [`Step::grow`] applies it to eight points at a time.
    #[cfg(test)]
    fn grow_point(&self, meta: u32, image_id: u32) -> u32 {
        if meta & LIVE == 0 {
            return meta;
        }
        let mut age = meta & AGE;
        if meta & FRESH == 0 {
            let not_drawn = if age > 0 && image_id == NOT_DRAWN { self.not_drawn } else { 0 };
            let change = if meta & CHANGED != 0 { self.change } else { 0 };
            age = (age + self.increment + not_drawn + change).min(AGE);
        }
        let is_evicted = self.evict && age >= AGE_OF_EVICTION;
        if is_evicted { 0 } else { meta & !(AGE | CHANGED) | age }
    }

    /// Ages points; returns how many have each age in whole numbers.
    #[inline(always)]
    fn grow<S: Simd>(&self, simd: S, meta: &mut [u32], image_id: &[u32]) -> [u32; 256] {
        let splat = |number: u32| u32x8::splat(simd, number);
        let zero = splat(0);
        // Neighbouring points are often of one age. With counters for each lane, no addition waits for the one before.
        let mut counts = [[0; 256]; LANES];
        for first in (0..meta.len()).step_by(LANES) {
            let before = u32x8::load_array(simd, padded(meta, first));
            let shown = u32x8::load_array(simd, padded(image_id, first));
            let is_live = (before & LIVE).simd_ne(zero);
            let age = before & AGE;
            let is_unseen = age.simd_gt(zero) & shown.simd_eq(splat(NOT_DRAWN));
            let grown = age
                + splat(self.increment)
                + is_unseen.select(splat(self.not_drawn), zero)
                + (before & CHANGED).simd_ne(zero).select(splat(self.change), zero);
            let grown = grown.simd_gt(splat(AGE)).select(splat(AGE), grown);
            let age = (before & FRESH).simd_ne(zero).select(age, grown);
            let is_evicted = age.simd_ge(splat(if self.evict { AGE_OF_EVICTION } else { u32::MAX }));
            let after = is_evicted.select(zero, (before & !(AGE | CHANGED)) | age);
            let count = LANES.min(meta.len() - first);
            store(&is_live.select(after, before).to_array(), &mut meta[first..][..count]);
            let years = (age >> AGE_ONE.trailing_zeros()).to_array();
            let counted = bits(simd, is_live & !is_evicted).to_array();
            for lane in 0..LANES {
                // Ages have 16 bits, so all of these are below 256; the mask lets the compiler omit the check.
                counts[lane][(years[lane] & 0xFF) as usize] += counted[lane] & 1;
            }
        }
        std::array::from_fn(|age| counts.iter().map(|counts| counts[age]).sum())
    }
}

/// The moving average after one more frame; it starts at the first frame with samples.
fn averaged(rate: f32, arrived: f32) -> f32 {
    if arrived == 0.0 {
        rate
    } else if rate == 0.0 {
        arrived
    } else {
        rate + RATE_WEIGHT * (arrived - rate)
    }
}

/// The age increment of a frame, 8.8 fixed point: if `rate` of `capacity` points are replaced in a frame, oldest first,
/// a point lives capacity / rate frames. 0 if no sample arrived.
fn increment(rate: f32, arrived: f32, capacity: u32) -> u32 {
    if arrived == 0.0 {
        return 0;
    }
    (AGE_WHEN_REPLACED * rate / capacity as f32).round_ties_even().min(AGE as f32) as u32
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;
    use fearless_simd::Level;

    use super::*;
    use crate::shared::testing::{Random, run_alike, run_both, settings};

    fn harness(params: AgeParams, arrived: u32, meta: &[u32], image_id: &[u32]) -> Harness<Age> {
        let mut harness = Harness::new(params, &settings([8, 8], 16));
        harness.set("arrived", &[arrived]);
        harness.set("cloud.meta", meta);
        harness.set("cloud.image_id", image_id);
        harness
    }

    #[test]
    fn increments_are_those_of_the_specification() {
        // algorithms.md section 1.5: 2.133 = 546/256 and 0.4267 = 109/256.
        assert_eq!(increment(5000.0, 1.0, 300_000), 546);
        assert_eq!(increment(1000.0, 1.0, 300_000), 109);
        assert_eq!(increment(1000.0, 0.0, 300_000), 0);
        assert_eq!(increment(0.0, 1.0, 300_000), 0);
        assert_eq!(increment(300_000.0, 1.0, 300_000), 128 * 256);
    }

    #[test]
    fn each_kind_of_point_ages_by_its_own_rule() {
        // One of four points is replaced per frame, so the increment is 128 / 4 = 32 = 0x20.00.
        let meta = [LIVE | FRESH, LIVE | 0x01_80, LIVE | CHANGED | 0x01_00, LIVE | 0x01_00];
        let seen = [7, 7, 7, NOT_DRAWN];
        let out = run_alike(&mut harness(AgeParams::default(), 1, &meta, &seen));
        // Unchanged; + 32; + 32 + 64; + 4 * 32.
        let expected = [LIVE | FRESH, LIVE | 0x21_80, LIVE | 0x61_00, LIVE | 0x81_00];
        assert_eq!(out.get::<u32>("cloud.meta"), expected);
        let histogram = out.get::<u32>("histogram");
        assert_eq!([0, 0x21, 0x61, 0x81].map(|age| histogram[age]), [1; 4]);
        assert_eq!(histogram.iter().sum::<u32>(), 4);
    }

    #[test]
    fn a_point_of_age_0_is_not_penalised() {
        let out = run_alike(&mut harness(AgeParams::default(), 1, &[LIVE; 4], &[NOT_DRAWN; 4]));
        assert_eq!(out.get::<u32>("cloud.meta"), [LIVE | 0x20_00; 4]);
    }

    #[test]
    fn the_oldest_points_are_evicted_or_keep_the_maximum_age() {
        let meta = [0, LIVE | 0xE0_00, LIVE | 0xDE_FF, LIVE | FRESH | 0xFF_00];
        let run = |evict| {
            let mut harness = harness(AgeParams { evict, ..AgeParams::default() }, 1, &meta, &[0; 4]);
            let out = run_alike(&mut harness);
            (out.get::<u32>("cloud.meta"), out.get::<u32>("histogram"))
        };
        let (meta, histogram) = run(true);
        assert_eq!(meta, [0, 0, LIVE | 0xFE_FF, 0]);
        assert_eq!((histogram[254], histogram.iter().sum()), (1, 1));
        let (meta, histogram) = run(false);
        assert_eq!(meta, [0, LIVE | 0xFF_FF, LIVE | 0xFE_FF, LIVE | FRESH | 0xFF_00]);
        assert_eq!((histogram[254], histogram[255]), (1, 2));
    }

    #[test]
    fn the_rate_starts_at_the_first_samples_and_then_changes_slowly() {
        let mut harness = harness(AgeParams::default(), 0, &[0; 4], &[0; 4]);
        let mut rate = |arrived: u32| {
            harness.set("arrived", &[arrived]);
            run_alike(&mut harness).get::<f32>("rate")[0]
        };
        let rates = [0, 100, 200, 200, 0, 0, 219].map(&mut rate);
        assert_eq!(rates, [0.0, 100.0, 110.0, 119.0, 119.0, 119.0, 129.0]);
    }

    #[test]
    fn nothing_ages_in_a_frame_without_samples() {
        let meta = [LIVE | FRESH, LIVE | 0x01_80, LIVE | 0xFF_00, LIVE | 0x01_00];
        let mut harness = harness(AgeParams::default(), 1, &[LIVE; 4], &[7; 4]);
        run_alike(&mut harness);
        harness.set("arrived", &[0]);
        harness.set("cloud.meta", &meta);
        harness.set("cloud.image_id", &[7, NOT_DRAWN, 7, 7]);
        let out = run_alike(&mut harness);
        // But the one that reached 255 before, as points in changing light do, leaves.
        assert_eq!(out.get::<u32>("cloud.meta"), [meta[0], meta[1], 0, meta[3]]);
        assert_eq!(out.get::<u32>("histogram").iter().sum::<u32>(), 3);
    }

    #[test]
    fn eight_points_age_as_each_alone() {
        let mut random = Random(12);
        // Not a multiple of the number of lanes. Ages near 0, near the eviction, and between.
        let mut meta: Vec<u32> = Vec::new();
        for _ in 0..2003 {
            let age = match random.below(4) {
                0 => random.below(3),
                1 => AGE_OF_EVICTION - 2 + random.below(4),
                _ => random.below(AGE + 1),
            };
            let flags = [LIVE, FRESH, CHANGED].map(|flag| flag * u32::from(random.below(4) != 0));
            meta.push(age | flags.iter().sum::<u32>());
        }
        let image_id: Vec<u32> =
            meta.iter().map(|_| if random.below(2) == 0 { NOT_DRAWN } else { 5 }).collect();
        for (increment, evict) in [(0, false), (1, true), (546, false), (546, true), (AGE, true)] {
            let step = Step { increment, not_drawn: 3 * increment, change: 64 * AGE_ONE, evict };
            let points = meta.iter().zip(&image_id);
            let expected: Vec<u32> =
                points.map(|(&meta, &image_id)| step.grow_point(meta, image_id)).collect();
            let mut counts = [0; 256];
            let live = expected.iter().filter(|&meta| meta & LIVE != 0);
            live.for_each(|meta| counts[((meta & AGE) / AGE_ONE) as usize] += 1);
            for level in [Level::baseline(), Level::new()] {
                let mut grown = meta.clone();
                let counted = dispatch!(level, simd => step.grow(simd, &mut grown, &image_id));
                for (i, (grown, expected)) in grown.iter().zip(&expected).enumerate() {
                    assert_eq!(grown, expected, "{:#x} with increment {increment}, {evict}", meta[i]);
                }
                assert_eq!(counted, counts, "increment {increment}, {evict}");
            }
        }
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(11);
        let count = 20_000;
        let meta: Vec<u32> = (0..count)
            .map(|_| match random.below(16) {
                0 => 0,
                1 => LIVE | FRESH,
                _ => LIVE | (random.below(2) * CHANGED) | random.below(0x1_0000),
            })
            .collect();
        let image_id: Vec<u32> =
            (0..count).map(|_| if random.below(3) == 0 { NOT_DRAWN } else { 5 }).collect();
        for arrived in [0, 1, 777, count] {
            let mut harness = harness(AgeParams::default(), arrived, &meta, &image_id);
            let both = run_both(&mut harness);
            // Quotients within a rounding error of a half could round differently; none of these does.
            both.assert_equal::<u32>("cloud.meta");
            both.assert_equal::<u32>("histogram");
            both.assert_close("rate", 0.0);
        }
    }
}
