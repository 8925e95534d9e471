//! Chooses the slots of the cloud that new samples take over.

use epigraph_core::{Access, CpuContext, Extent, In, Io, Out, Stage, Threads, scratch};
use fearless_simd::{Simd, dispatch, prelude::*, u32x8};

use crate::{
    column,
    meaning::{AGES, POINTS, SAMPLES, SLOT},
    shared::{
        cloud::{AGE, AGE_ONE, LIVE, NO_POINT},
        lanes::{LANES, padded},
        renewal::{Eye, is_spread},
        requests::{HIT_NONE, Sample},
        scan::SCAN_BLOCKS,
    },
};

epigraph_core::constants! {
    /// The age of empty slots: higher than any point's.
    const EMPTY: u32 = 256;
    /// The claim of no sample.
    const UNCLAIMED: u32 = u32::MAX;
}

epigraph_core::params! {
    /// Which slots samples may take.
    pub struct ReplaceParams {
        /// A sample replaces the point that its pixel showed when the sample was requested.
        reuse: bool = true;
    }
}

/// Assigns each sample a slot of its own (`algorithms.md` section 1.9). A sample requested at a pixel that showed a
/// point takes that point's slot; if several samples want one, the lowest index wins. All others take the remaining
/// slots, oldest first, where empty slots are older than any point: all slots older than the age at which the histogram
/// of ages covers the need, then some of exactly that age, both in slot order. Samples that find no slot get
/// [`NO_POINT`].
pub struct Replace {
    cloud_position: In<[f32; 4]>,
    cloud_meta: In<u32>,
    samples: In<Sample>,
    histogram: In<u32>,
    claims: Out<u32>,
    claimed: Out<u32>,
    choice: Out<[u32; 2]>,
    oldest: Out<u32>,
    slots: Out<u32>,
}

impl Stage for Replace {
    const KIND: &'static str = "replace";
    const DOC: &'static str =
        "Chooses the slots that new samples take over: the point they renew, else the oldest.";
    type Params = ReplaceParams;

    fn declare(_: &Self::Params, io: &mut Io) -> Self {
        io.column(column::P1);
        let like = |port: &'static str| Extent::Like(port.into());
        let mut cloud = io.bundle(
            Access::Read,
            "cloud",
            POINTS.doc("The points before this frame's samples."),
            Extent::Any,
        );
        let cloud_position = cloud.read("position");
        let cloud_meta = cloud.read("meta");
        let samples =
            io.history("samples", SAMPLES.doc("The samples that arrived in the last frame."), Extent::Any);
        let histogram = io.history(
            "histogram",
            AGES.doc("Live points of each whole age, of this same cloud."),
            Extent::Fixed([256, 1]),
        );
        let slots = io.write("slots", SLOT, like("samples"));

        let claims =
            io.write("claims", scratch("Lowest sample that renews the point of a slot."), like("cloud"));
        let claimed = io.write("claimed", scratch("Claimed slots of each age."), Extent::Fixed([256, 1]));
        let choice = io.write(
            "choice",
            scratch("The youngest age that is replaced, and how many free slots are older."),
            Extent::Fixed([1, 1]),
        );
        let oldest = io.write("oldest", scratch("Free slots, oldest first."), like("samples"));
        let sums = Extent::Fixed([SCAN_BLOCKS, 1]);
        io.write::<u32>("sample_sums", scratch("Samples without a claim, by block."), sums.clone());
        io.write::<[u32; 2]>(
            "slot_sums",
            scratch("Free slots older than, and of, the chosen age, by block."),
            sums,
        );

        io.shader(shader!("replace"));
        io.constants(CONSTANTS);
        io.dispatch("clear", claims);
        io.dispatch("claim", slots);
        io.compute("count_samples", Threads::Groups(SCAN_BLOCKS));
        io.compute("choose", Threads::Groups(1));
        io.compute("count_slots", Threads::Groups(SCAN_BLOCKS));
        io.compute("collect_slots", Threads::Groups(SCAN_BLOCKS));
        io.compute("assign", Threads::Groups(SCAN_BLOCKS));
        io.per_arrival(samples);
        Self { cloud_position, cloud_meta, samples, histogram, claims, claimed, choice, oldest, slots }
    }

    fn cpu(&self, params: &Self::Params, cx: &CpuContext) -> Result<(), String> {
        let (position, meta) = (cx.read(self.cloud_position), cx.read(self.cloud_meta));
        let (samples, histogram) = (cx.read(self.samples), cx.read(self.histogram));
        let eye = Eye::of(cx.frame());
        let renews = |sample: &Sample| {
            let point = sample.reuse as usize;
            let Some(&meta) = meta.get(point).filter(|meta| **meta & LIVE != 0) else { return false };
            params.reuse && sample.hit != HIT_NONE && eye.replaces(sample, meta, position[point])
        };
        let (mut claims, mut claimed) = (cx.write(self.claims), cx.write(self.claimed));
        let (mut choice, mut oldest, mut slots) =
            (cx.write(self.choice), cx.write(self.oldest), cx.write(self.slots));

        // clear
        claims.fill(UNCLAIMED);
        claimed.fill(0);
        oldest.fill(NO_POINT);

        // claim
        for (index, sample) in samples.iter().enumerate() {
            if renews(sample) {
                let claim = &mut claims[sample.reuse as usize];
                *claim = (*claim).min(index as u32);
            }
        }

        // count_samples
        let wins =
            |index: usize, sample: &Sample| renews(sample) && claims[sample.reuse as usize] == index as u32;
        let mut need = 0;
        for (index, sample) in samples.iter().enumerate() {
            if wins(index, sample) {
                claimed[age(meta[sample.reuse as usize]) as usize] += 1;
            } else if needs(sample) {
                need += 1;
            }
        }

        // choose
        let [threshold, older] = choose(meta.len(), need, &histogram, &claimed);
        choice[0] = [threshold, older];

        // count_slots, collect_slots: one after the other, no counting ahead is needed
        let free = Free { meta: &meta, claims: &claims };
        dispatch!(cx.level(), simd => free.collect(simd, threshold, older, &mut oldest));

        // assign
        let mut next = 0;
        for (index, (sample, slot)) in samples.iter().zip(&mut *slots).enumerate() {
            *slot = NO_POINT;
            if wins(index, sample) {
                *slot = sample.reuse;
            } else if needs(sample) {
                *slot = oldest[next];
                next += 1;
            }
        }
        Ok(())
    }
}

/// The slots that no sample claims.
struct Free<'a> {
    meta: &'a [u32],
    claims: &'a [u32],
}

impl Free<'_> {
    /// Lists the slots older than `threshold`, of which there are `older`, then those of that age, as far as there is room.
    #[inline(always)]
    fn collect<S: Simd>(&self, simd: S, threshold: u32, older: u32, list: &mut [u32]) {
        let splat = |number: u32| u32x8::splat(simd, number);
        let (mut next_older, mut next_equal) = (0, older as usize);
        for first in (0..self.meta.len()).step_by(LANES) {
            // What is behind the last slot counts as claimed.
            let meta = u32x8::load_array(simd, padded(self.meta, first));
            let claim = u32x8::load_array(simd, padded(self.claims, first));
            // As [`age`].
            let is_live = (meta & LIVE).simd_ne(splat(0));
            let age = is_live.select((meta & AGE) >> AGE_ONE.trailing_zeros(), splat(EMPTY));
            let is_free = claim.simd_eq(splat(UNCLAIMED)) & age.simd_ge(splat(threshold));
            let is_older = age.simd_gt(splat(threshold)).to_bitmask();
            let mut rest = is_free.to_bitmask();
            while rest != 0 {
                let lane = rest.trailing_zeros();
                rest &= rest - 1;
                let slot = first + lane as usize;
                let next = if is_older >> lane & 1 != 0 { &mut next_older } else { &mut next_equal };
                if let Some(place) = list.get_mut(*next) {
                    *place = slot as u32;
                }
                *next += 1;
            }
        }
    }
}

/// Whether a sample takes any slot, if it does not get that of its point.
fn needs(sample: &Sample) -> bool {
    sample.hit != HIT_NONE && !is_spread(sample)
}

/// The whole-number age of a point; [`EMPTY`] for an empty slot.
fn age(meta: u32) -> u32 {
    if meta & LIVE == 0 { EMPTY } else { (meta & AGE) / AGE_ONE }
}

/// The highest age such that there are `need` free slots of that age or higher (0 if there are not that many at all),
/// and the number of free slots of higher age. Empty slots are the oldest.
fn choose(capacity: usize, need: u32, histogram: &[u32], claimed: &[u32]) -> [u32; 2] {
    let empty = (capacity as u32).saturating_sub(histogram.iter().sum());
    if empty >= need {
        return [EMPTY, 0];
    }
    let mut older = empty;
    for age in (1..EMPTY).rev() {
        let free = histogram[age as usize].saturating_sub(claimed[age as usize]);
        if older + free >= need {
            return [age, older];
        }
        older += free;
    }
    [0, older]
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::{
        octahedral::encode_oct16,
        requests::{HIT_BACKGROUND, HIT_SURFACE, SPREAD},
        testing::{Random, run_alike, run_both, settings},
    };

    /// A live point of the given age, in 8.8 fixed point.
    fn point(age: u32) -> u32 {
        LIVE | age
    }

    fn sample(reuse: u32) -> Sample {
        Sample { hit: HIT_SURFACE, reuse, ..Sample::default() }
    }

    fn harness(reuse: bool, meta: &[u32], samples: &[Sample]) -> Harness<Replace> {
        let mut histogram = [0; 256];
        for &meta in meta.iter().filter(|&&meta| meta & LIVE != 0) {
            histogram[age(meta) as usize] += 1;
        }
        let mut harness = Harness::new(ReplaceParams { reuse }, &settings([8, 8], samples.len() as u32));
        harness.set("cloud.meta", meta);
        harness.set("samples", samples);
        harness.set("histogram", &histogram);
        harness
    }

    fn slots(reuse: bool, meta: &[u32], samples: &[Sample]) -> Vec<u32> {
        run_alike(&mut harness(reuse, meta, samples)).get("slots")
    }

    /// Of samples that are spread over a pixel, those on the point's surface renew it, and others get no slot.
    #[test]
    fn what_lies_beside_a_point_in_its_pixel_does_not_take_its_slot() {
        let up = encode_oct16(glam::Vec3::Y);
        let on = Sample { position: [0.3, 1.0, 0.2], normal: up, aim: SPREAD, ..sample(0) };
        let samples = [
            on,
            Sample { position: [0.3, 1.5, 0.2], reuse: 1, ..on },
            Sample { body: 1, reuse: 2, ..on },
            Sample { hit: HIT_BACKGROUND, reuse: 3, ..on },
            // A direction, and a place beyond it.
            Sample { hit: HIT_BACKGROUND, reuse: 4, ..on },
            Sample { reuse: 5, ..on },
            // What has no point to renew takes the oldest slot, and what is not spread any.
            Sample { reuse: NO_POINT, ..on },
            Sample { body: 1, aim: 0, reuse: 2, ..on },
            Sample { aim: 0, reuse: NO_POINT, ..on },
        ];
        let mut harness = harness(true, &[point(3); 8], &samples);
        let mut position = [[0.0f32, 1.0, 0.0, 1.0]; 8];
        (position[4][3], position[5][3]) = (0.0, 0.0);
        harness.set("cloud.position", &position);
        harness.frame.previous.eye = [0.0, 3.0, 0.0];
        let slots = run_alike(&mut harness).get::<u32>("slots");
        assert_eq!(slots, [0, NO_POINT, NO_POINT, NO_POINT, 4, NO_POINT, 1, 2, 3]);
    }

    #[test]
    fn empty_slots_come_first_and_in_order() {
        let meta = [point(0), 0, point(0xFFFF), 0];
        assert_eq!(slots(true, &meta, &[sample(NO_POINT); 2]), [1, 3]);
        // As in the first frame, all slots are empty. Entries without a sample get no slot.
        assert_eq!(slots(true, &[0; 5], &[sample(NO_POINT), Sample::default(), sample(3)]), [0, NO_POINT, 1]);
    }

    #[test]
    fn the_oldest_points_are_replaced_and_equal_ages_in_slot_order() {
        // Whole ages 7, 9, 7, 200, 7, 9: three are older than 7, so a fourth sample takes the first slot of age 7,
        // regardless of the fractions.
        let meta = [0x07_F0, 0x09_00, 0x07_00, 0xC8_00, 0x07_FF, 0x09_80].map(point);
        assert_eq!(slots(true, &meta, &[sample(NO_POINT); 4]), [1, 3, 5, 0]);
    }

    #[test]
    fn points_of_every_age_are_replaced_in_their_turn() {
        // One point of each age, in no order: 37 has no factor in common with 256.
        let age_of = |slot: u32| slot * 37 % 256;
        let meta: Vec<u32> = (0..256).map(|slot| point(age_of(slot) << 8)).collect();
        for count in [1, 2, 100, 255, 256] {
            let mut ages: Vec<u32> =
                slots(true, &meta, &vec![sample(NO_POINT); count]).into_iter().map(age_of).collect();
            ages.sort_unstable();
            let oldest: Vec<u32> = (256 - count as u32..256).collect();
            assert_eq!(ages, oldest);
        }
    }

    #[test]
    fn a_sample_renews_its_point_and_the_first_of_several_wins() {
        let meta = [point(5), point(0x10_00), point(0x20_00), 0];
        let samples =
            [sample(0), sample(0), Sample { hit: HIT_BACKGROUND, ..sample(1) }, sample(3), sample(99)];
        // Slot 3 is not live, slot 99 does not exist, and the second sample loses its claim. So three samples need a
        // slot, but only two are free.
        assert_eq!(slots(true, &meta, &samples), [0, 2, 1, 3, NO_POINT]);
        // Without reuse, three samples need a slot: slots 2 and 3 are older than slot 1.
        assert_eq!(slots(false, &meta, &samples[..3]), [2, 3, 1]);
    }

    #[test]
    fn a_claimed_slot_does_not_count_as_old() {
        // The oldest point is claimed, so the other sample takes the next oldest.
        let meta = [point(0x01_00), point(0xF0_00), point(0x02_00)];
        assert_eq!(slots(true, &meta, &[sample(1), sample(NO_POINT)]), [1, 2]);
    }

    /// Random points, some of them dead, and samples, some of which request the same slots.
    fn random(seed: u64, capacity: u32, count: u32) -> (Vec<u32>, Vec<Sample>) {
        let mut random = Random(seed);
        let meta = (0..capacity)
            .map(|_| if random.below(8) == 0 { 0 } else { point(random.below(40 * 256)) })
            .collect();
        let samples = (0..count)
            .map(|_| Sample {
                hit: random.below(3),
                reuse: if random.below(2) == 0 { NO_POINT } else { random.below(capacity) },
                ..Sample::default()
            })
            .collect();
        (meta, samples)
    }

    #[test]
    fn slots_are_distinct_and_no_replaced_point_is_younger_than_one_that_stays() {
        for (seed, count) in [(1, 0), (2, 1), (3, 700), (4, 3000)] {
            let (meta, samples) = random(seed, 2000, count);
            let slots = slots(true, &meta, &samples);
            let valid = samples.iter().filter(|sample| sample.hit != HIT_NONE).count();
            let mut taken: Vec<u32> = slots.iter().copied().filter(|&slot| slot != NO_POINT).collect();
            taken.sort_unstable();
            taken.dedup();
            assert_eq!(taken.len(), valid.min(2000), "seed {seed}");
            let renewed =
                |slot: u32| samples.iter().any(|sample| sample.hit != HIT_NONE && sample.reuse == slot);
            let youngest =
                taken.iter().filter(|&&slot| !renewed(slot)).map(|&slot| age(meta[slot as usize])).min();
            let stays = (0..2000).filter(|slot| taken.binary_search(slot).is_err());
            if let (Some(youngest), Some(oldest)) =
                (youngest, stays.map(|slot| age(meta[slot as usize])).max())
            {
                assert!(youngest >= oldest, "seed {seed}: {youngest} goes, {oldest} stays");
            }
        }
    }

    #[test]
    fn both_sides_agree() {
        // With 70,001 slots, blocks have two tiles, and the last block is shorter.
        for (seed, capacity, count) in [(5, 70_001, 9_000), (6, 300, 400), (7, 5, 1), (8, 70_001, 1)] {
            for reuse in [true, false] {
                let (meta, samples) = random(seed, capacity, count);
                run_both(&mut harness(reuse, &meta, &samples)).assert_equal::<u32>("slots");
            }
        }
    }
}
