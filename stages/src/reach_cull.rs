//! Drops samples that shine through a nearer surface, once edges are known: a sample is dropped if at least half of the
//! samples that it can be mixed with, the reachable ones of its 5x5 pixels, are clearly nearer (`algorithms.md`
//! sections 2.9 and 11.2). In a sparse image most such samples have no near neighbour in the 3x3 pixels that the depth
//! cull examines.
//!
//! Every pass judges by the samples that the previous pass left. A sample without others in reach stays; so do those of
//! complex pixels, which reach nothing and are used only by complex pixels.

use std::ops::Range;

use epigraph_core::{CpuContext, Extent, Finding, In, Io, Out, Site, Stage, params};
use fearless_simd::{Level, Simd, dispatch, f32x8, prelude::*, u32x8};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{CLASS, DEPTH, ID, KEPT, REACH},
    project::EMPTY_DEPTH,
    shared::{
        cloud::NO_POINT,
        edge_pixel::VALID,
        lanes::{LANES, bits},
        nearer::{self, BAND, SPAN, is_inside, where_changed, where_nearer},
    },
};

#[path = "explain/reach_cull.rs"]
mod explain;

params! {
    /// Parameters of [`ReachCull`].
    pub struct ReachCullParams {
        /// A sample is clearly nearer if (1 + threshold) times its distance is less.
        threshold: f32 = 0.05, in 0.0..=10.0;
        /// Number of passes over all samples; 0 drops none.
        passes: u32 = 2, in 0..=4;
    }
}

/// See the module.
pub struct ReachCull {
    kept: In<u32>,
    depth: In<u32>,
    r24: In<u32>,
    cls: Out<u32>,
    id: Out<u32>,
    spare: Out<u32>,
}

impl Stage for ReachCull {
    const KIND: &'static str = "reach_cull";
    const DOC: &'static str =
        "Drops points that lie behind at least half of the points that they can be interpolated with.";
    type Params = ReachCullParams;

    fn declare(params: &ReachCullParams, io: &mut Io) -> Self {
        io.column(column::I2);
        io.per_view();
        let pixels = || Extent::Frame(1);
        let kept = io.read("kept", KEPT, pixels());
        let depth =
            io.read("depth", DEPTH.doc("Bits of the points' distance along the axis, metres."), pixels());
        let r24 =
            io.read("r24", REACH.doc("Which of the other 5x5 pixels each pixel reaches, as bits."), pixels());
        let cls = io.update(
            "cls",
            CLASS.doc("State of the pixels, as bits; those whose sample is dropped have none."),
            pixels(),
        );
        let id = io.write("id", ID.doc("The points without those that are dropped."), pixels());
        let spare = io.write("spare", KEPT.doc("The points after every other pass.").scratch(), pixels());
        io.shader(shader!("reach_cull"));
        for pass in 0..params.passes {
            let entry = match (pass, writes_id(pass, params.passes)) {
                (0, true) => "kept_to_id",
                (0, false) => "kept_to_spare",
                (_, true) => "spare_to_id",
                (_, false) => "id_to_spare",
            };
            io.dispatch(entry, id);
        }
        if params.passes == 0 {
            io.dispatch("copy", id);
        }
        Self { kept, depth, r24, cls, id, spare }
    }

    fn cpu(&self, params: &ReachCullParams, cx: &CpuContext) -> Result<(), String> {
        let dims = cx.dims(self.id);
        let (kept, depth, r24) = (&cx.read(self.kept)[..], &cx.read(self.depth)[..], &cx.read(self.r24)[..]);
        let (id, spare) = (&mut cx.write(self.id)[..], &mut cx.write(self.spare)[..]);
        let (width, height) = (dims.width as usize, dims.height as usize);

        let level = cx.level();
        for number in 0..params.passes {
            let (id, to) = match (number, writes_id(number, params.passes)) {
                (0, true) => (kept, &mut *id),
                (0, false) => (kept, &mut *spare),
                (_, true) => (&*spare, &mut *id),
                (_, false) => (&*id, &mut *spare),
            };
            // Later passes write where the samples of the pass before the last are.
            let before = (number == 1).then_some(kept);
            let scale = 1.0 + params.threshold;
            let samples = Samples { id, depth, r24, width, height, scale, level };
            to.par_chunks_mut(width * BAND)
                .enumerate()
                .for_each(|(band, to)| samples.cull(band * BAND, before, to));
        }
        if params.passes == 0 {
            id.copy_from_slice(kept);
        }
        let cls = &mut cx.write(self.cls)[..];
        cls.par_chunks_mut(width).zip(id.par_chunks(width)).for_each(|(cls, id)| {
            for (cls, id) in cls.iter_mut().zip(id) {
                *cls &= if *id == NO_POINT { !VALID } else { !0 };
            }
        });
        Ok(())
    }

    fn explain(&self, params: &ReachCullParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// Whether a pass writes `id`: every second one, and the last.
fn writes_id(pass: u32, passes: u32) -> bool {
    (passes - pass) % 2 == 1
}

/// The samples that a pass judges.
struct Samples<'a> {
    id: &'a [u32],
    depth: &'a [u32],
    r24: &'a [u32],
    width: usize,
    height: usize,
    scale: f32,
    level: Level,
}

impl Samples<'_> {
    /// The samples of the rows from `top` on for which [`Samples::is_behind`] does not hold.
    /// `before`: those that the pass before judged, if known.
    fn cull(&self, top: usize, before: Option<&[u32]>, to: &mut [u32]) {
        dispatch!(self.level, simd => self.cull_in(simd, top, before, to));
    }

    /// [`Samples::cull`]. Tests only those with a clearly nearer one around them, or with one that the pass before dropped.
    #[inline(always)]
    fn cull_in<S: Simd>(&self, simd: S, top: usize, before: Option<&[u32]>, to: &mut [u32]) {
        to.copy_from_slice(&self.id[top * self.width..][..to.len()]);
        let rows = top..top + to.len() / self.width;
        if let Some(before) = before {
            // Pixels without a sample stay as they are in any case.
            where_changed([self.width, self.height], rows, before, self.id, |x, y| {
                let all = (1u32 << LANES.min(self.width - x)) - 1;
                self.cull_group(simd, [x, y], all as u8, top, to);
            });
            return;
        }
        let distances = |pixels: Range<usize>, distances: &mut [f32]| {
            let given = self.id[pixels.clone()].iter().zip(&self.depth[pixels]);
            for (distance, (&id, &depth)) in distances.iter_mut().zip(given) {
                // Without a branch, so that several are processed at a time.
                let none = 0u32.wrapping_sub(u32::from(id == NO_POINT));
                *distance = f32::from_bits(depth & !none | EMPTY_DEPTH & none);
            }
        };
        where_nearer([self.width, self.height], rows, self.scale, distances, |x, y, wanted| {
            self.cull_group(simd, [x, y], wanted, top, to);
        });
    }

    /// Drops those of the wanted ones of [`LANES`] pixels that are behind, in rows from `top` on.
    #[inline(always)]
    fn cull_group<S: Simd>(&self, simd: S, [x, y]: [usize; 2], wanted: u8, top: usize, to: &mut [u32]) {
        let behind = self.are_behind(simd, x, y, wanted);
        for lane in (0..LANES).filter(|lane| behind >> lane & 1 != 0) {
            to[(y - top) * self.width + x + lane] = NO_POINT;
        }
    }

    /// [`Samples::is_behind`] for those of [`LANES`] pixels that are wanted, as bits.
    #[inline(always)]
    fn are_behind<S: Simd>(&self, simd: S, x: usize, y: usize, wanted: u8) -> u8 {
        if is_inside([self.width, self.height], x, y) {
            let [count, nearer] = self.ballots(simd, x, y);
            wanted & (count.simd_gt(u32x8::splat(simd, 0)) & (nearer << 1).simd_ge(count)).to_bitmask() as u8
        } else {
            let is_behind = |lane: &usize| wanted >> lane & 1 != 0 && self.is_behind(x + lane, y);
            (0..LANES).filter(is_behind).fold(0, |bits, lane| bits | 1 << lane)
        }
    }

    /// [`Samples::ballot`] for [`LANES`] pixels whose 5x5 pixels are inside.
    #[inline(always)]
    fn ballots<S: Simd>(&self, simd: S, x: usize, y: usize) -> [u32x8<S>; 2] {
        let at = |plane: &[u32], at: usize| u32x8::from_slice(simd, &plane[at..][..LANES]);
        let own = y * self.width + x;
        let (r24, z) = (at(self.r24, own), f32x8::from_bits(at(self.depth, own)));
        let (mut count, mut nearer) = (u32x8::splat(simd, 0), u32x8::splat(simd, 0));
        for dy in 0..SPAN {
            let row = own - nearer::REACH * (self.width + 1) + dy * self.width;
            for dx in (0..SPAN).filter(|dx| [*dx, dy] != [nearer::REACH; 2]) {
                let raw = dy * SPAN + dx;
                let bit = raw - usize::from(raw > SPAN * SPAN / 2);
                let is_there = bits(simd, at(self.id, row + dx).simd_ne(u32x8::splat(simd, NO_POINT)));
                let counts = (r24 >> bit as u32) & is_there & 1;
                let scaled = f32x8::from_bits(at(self.depth, row + dx)) * f32x8::splat(simd, self.scale);
                count += counts;
                nearer += counts & bits(simd, scaled.simd_lt(z));
            }
        }
        [count, nearer]
    }

    /// Whether at least half of the samples in reach are clearly nearer.
    fn is_behind(&self, x: usize, y: usize) -> bool {
        let [count, nearer] = self.ballot(x, y);
        count > 0 && 2 * nearer >= count
    }

    /// The number of samples in reach, and how many of them are clearly nearer.
    #[inline(always)]
    fn ballot(&self, x: usize, y: usize) -> [u32; 2] {
        let p = y * self.width + x;
        let z = f32::from_bits(self.depth[p]);
        let (mut count, mut nearer) = (0, 0);
        let mut rest = self.r24[p];
        while rest != 0 {
            let k = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let raw = k + usize::from(k >= 12);
            let (x, y) = ((x + raw % 5).wrapping_sub(2), (y + raw / 5).wrapping_sub(2));
            // Bits never point outside the image; this guards against invalid input.
            if x < self.width && y < self.height {
                let q = y * self.width + x;
                let is_there = self.id[q] != NO_POINT;
                count += u32::from(is_there);
                nearer += u32::from(is_there && f32::from_bits(self.depth[q]) * self.scale < z);
            }
        }
        [count, nearer]
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::testing::{Both, Random, run_alike, run_both, settings};

    /// An image of samples with the distances `z`, infinite for pixels without a sample, and with the reached pixels
    /// `r24`.
    fn harness(params: ReachCullParams, size: [u32; 2], z: &[f32], r24: &[u32]) -> Harness<ReachCull> {
        let mut harness = Harness::new(params, &settings(size, 0));
        let id = |(p, z): (u32, &f32)| if z.is_infinite() { NO_POINT } else { 1000 + p };
        let id: Vec<u32> = (0..).zip(z).map(id).collect();
        let valid = |&id: &u32| if id == NO_POINT { 0x7F } else { 0x7F | VALID };
        harness.set("cls", &id.iter().map(valid).collect::<Vec<u32>>());
        harness.set("kept", &id);
        harness.set("depth", &z.iter().map(|z| z.to_bits()).collect::<Vec<u32>>());
        harness.set("r24", r24);
        harness
    }

    /// Asserts that both sides agree and that exactly the pixels with a sample are valid. Returns which pixels have
    /// one.
    fn stay(both: &Both) -> Vec<bool> {
        both.assert_equal::<u32>("id");
        both.assert_equal::<u32>("cls");
        let stay = (0..).zip(both.cpu.get::<u32>("id")).map(|(p, id)| {
            assert!(id == NO_POINT || id == 1000 + p);
            id != NO_POINT
        });
        let stay: Vec<bool> = stay.collect();
        let cls = both.cpu.get::<u32>("cls");
        assert!(cls.iter().zip(&stay).all(|(&cls, &stay)| cls == if stay { 0x7F | VALID } else { 0x7F }));
        stay
    }

    /// Returns true if a sample at `z` stays after one pass. `others` are the distances of the other pixels of its row.
    fn stays(threshold: f32, z: f32, others: [f32; 4], r24: u32) -> bool {
        let row = [others[0], others[1], z, others[2], others[3]];
        let mut words = [0; 5];
        words[2] = r24;
        let params = ReachCullParams { threshold, passes: 1 };
        stay(&run_both(&mut harness(params, [5, 1], &row, &words)))[2]
    }

    /// The bits of the pixels of the same row.
    const ROW: u32 = 0b1111 << 10;
    const NONE: f32 = f32::INFINITY;

    #[test]
    fn half_of_the_samples_in_reach_cull_a_sample() {
        let all = |others| stays(0.05, 10.0, others, ROW);
        assert!(all([10.0, 10.0, 10.0, 1.0]));
        assert!(!all([10.0, 10.0, 1.0, 1.0]));
        assert!(!all([10.0, 1.0, 1.0, 1.0]));
        // A few samples are enough to decide, even a single one.
        assert!(all([10.0, NONE, 1.0, 20.0]));
        assert!(!all([10.0, NONE, NONE, 1.0]));
        assert!(!all([NONE, NONE, 1.0, NONE]));
        assert!(all([NONE; 4]));
        // Samples beyond an edge do not count: bits 11 and 12 are the pixels beside the sample.
        assert!(stays(0.05, 10.0, [1.0, 10.0, 10.0, 1.0], 0b11 << 11));
        assert!(!stays(0.05, 10.0, [10.0, 1.0, 1.0, 10.0], 0b11 << 11));
        // A complex pixel reaches nothing.
        assert!(stays(0.05, 10.0, [1.0; 4], 0));
    }

    #[test]
    fn the_threshold_defines_clearly_nearer() {
        for (z, stay) in [(1.0, true), (1.5, true), (1.5f32.next_up(), false)] {
            assert_eq!(stays(0.5, z, [1.0; 4], ROW), stay, "{z}");
        }
        assert!(!stays(0.0, 1f32.next_up(), [1.0; 4], ROW) && stays(0.0, 1.0, [1.0; 4], ROW));
        assert!(stays(10.0, 10.9, [1.0; 4], ROW) && !stays(10.0, 11.1, [1.0; 4], ROW));
    }

    #[test]
    fn each_pass_uses_the_samples_that_the_last_pass_left() {
        // The far samples 1 and 2 do not reach each other. The first pass drops both because of sample 0, so in the
        // second pass sample 3 reaches only sample 0.
        let (size, z) = ([2, 2], [1.0, 10.0, 10.0, 10.0]);
        // Offsets in reading order: (1, 0) is bit 12, (0, 1) bit 16, (1, 1) bit 17; the opposite of k is 23 - k.
        let r24 =
            [1 << 12 | 1 << 16 | 1 << 17, 1 << 11 | 1 << 16, 1 << 7 | 1 << 12, 1 << 6 | 1 << 7 | 1 << 11];
        let left = |passes| {
            stay(&run_both(&mut harness(ReachCullParams { passes, ..Default::default() }, size, &z, &r24)))
        };
        assert_eq!(left(0), [true; 4]);
        assert_eq!(left(1), [true, false, false, true]);
        for passes in 2..=4 {
            assert_eq!(left(passes), [true, false, false, false], "{passes}");
        }
    }

    #[test]
    fn a_pass_equals_the_rule_for_each_sample() {
        let mut random = Random(13);
        for size in [[1, 1], [2, 9], [63, 3], [64, 33], [65, 34]] {
            let pixels = size[0] * size[1];
            for threshold in [0.0, 0.05, 10.0] {
                let z = |_| match random.below(6) {
                    0 => NONE,
                    1 => f32::MIN_POSITIVE,
                    2 => f32::MAX,
                    3 => f32::next_up(10.0 * 1.05),
                    4 => random.between(10.0, 11.0),
                    _ => 10.0,
                };
                let z: Vec<f32> = (0..pixels).map(z).collect();
                let r24: Vec<u32> = (0..pixels).map(|_| random.bits() & 0xFF_FFFF).collect();
                let mut harness = harness(ReachCullParams { threshold, passes: 1 }, size, &z, &r24);
                let found = run_alike(&mut harness).get::<u32>("id");

                let shown = |(p, z): (u32, &f32)| if z.is_infinite() { NO_POINT } else { 1000 + p };
                let id: Vec<u32> = (0..).zip(&z).map(shown).collect();
                let depth: Vec<u32> = z.iter().map(|z| z.to_bits()).collect();
                let [width, height] = size.map(|along| along as usize);
                let samples = Samples {
                    id: &id,
                    depth: &depth,
                    r24: &r24,
                    width,
                    height,
                    scale: 1.0 + threshold,
                    level: Level::new(),
                };
                let judged =
                    |p: usize| if samples.is_behind(p % width, p / width) { NO_POINT } else { id[p] };
                assert_eq!(found, (0..id.len()).map(judged).collect::<Vec<_>>(), "{threshold}, {size:?}");
            }
        }
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(31);
        for size in [[1, 1], [3, 2], [61, 47]] {
            let pixels = size[0] * size[1];
            // A near surface with holes, in the right part in front of a far one.
            let z = |p: u32| match random.below(6) {
                0 | 1 => NONE,
                2 if p % size[0] > size[0] / 3 => random.between(40.0, 50.0),
                _ => random.between(10.0, 10.4),
            };
            let z: Vec<f32> = (0..pixels).map(z).collect();
            // Some bits point outside the image, and must have no effect.
            let r24: Vec<u32> =
                (0..pixels).map(|_| random.bits() & (random.bits() | 0xFF00) & 0xFF_FFFF).collect();
            let mut before = usize::MAX;
            for passes in 0..=4 {
                let params = ReachCullParams { passes, ..ReachCullParams::default() };
                let left = stay(&run_both(&mut harness(params, size, &z, &r24)));
                let count = left.iter().filter(|&&stay| stay).count();
                assert!(count <= before, "{passes}");
                before = count;
                if passes == 0 {
                    assert!(left.iter().zip(&z).all(|(stay, z)| *stay == z.is_finite()));
                } else if pixels > 1000 {
                    let dropped = (0..pixels as usize).filter(|&p| z[p].is_finite() && !left[p]);
                    let (far, near): (Vec<usize>, Vec<usize>) = dropped.partition(|&p| z[p] >= 40.0);
                    assert!(far.len() > 250 && near.is_empty(), "{} {}", far.len(), near.len());
                }
            }
        }
    }

    #[test]
    fn an_image_without_samples_stays_empty() {
        let both = run_both(&mut harness(ReachCullParams::default(), [4, 3], &[NONE; 12], &[0xFF_FFFF; 12]));
        assert_eq!(stay(&both), [false; 12]);
    }
}
