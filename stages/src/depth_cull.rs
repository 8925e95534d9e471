//! Drops points that shine through a nearer surface, and computes the depth that later stages test against: the mean of
//! the 3x3 pixels, shifted back by the threshold (`algorithms.md` sections 1.3 and 3).
//!
//! *Majority*, the default, lets the points of the 5x5 pixels vote: a point is dropped if at least half of the others
//! are clearly nearer, z_q (1 + threshold) < z. There are two votes, the second without the points that the first
//! dropped. On a surface so steep that its depth changes by the threshold from pixel to pixel, as in images a few
//! pixels high, half of the others are nearer, and a larger threshold is needed. Along the image's border, where part
//! of the square is missing, more than half are needed.
//!
//! The other two rules compare with a mean over 3x3 pixels, as the papers do. Hidden points raise that mean: if a
//! surface has points in only half of its pixels, as after a quick turn, the hidden points keep each other alive, and
//! one at infinity keeps all around it. *Relative* compares linear distances: z > (1 + threshold) * mean. *SeedExact*
//! is the papers' rule: means of the depth zd of a 24-bit z-buffer, f (z - n) / (z (f - n)), shifted by
//! threshold * (f - n) metres. The mean of zd is a harmonic mean of z, and near zd = 1 the shift loses precision: the
//! rule suits scenes with f / n of a few hundred.

use std::ops::Range;

use epigraph_core::{CpuContext, Extent, Finding, In, Io, Out, Site, Stage, choice, params};
use fearless_simd::{Level, Simd, dispatch, f32x8, prelude::*, u32x8};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{DEPTH, ID},
    project::{self, EMPTY_DEPTH},
    shared::{
        cloud::NO_POINT,
        lanes::{LANES, bits},
        nearer::{BAND, REACH, SPAN, is_inside, where_nearer},
    },
};

#[path = "explain/depth_cull.rs"]
mod explain;

/// Pixels of a row whose means are computed together.
const BLOCK: usize = 64;

choice! {
    /// When a point counts as hidden.
    pub enum Rule {
        /// At least half of the other points of the 5x5 pixels are nearer by the threshold.
        Majority,
        /// Farther than (1 + threshold) times the mean distance of the 3x3 pixels.
        Relative,
        /// Farther than the mean z-buffer depth shifted by threshold * (far - near): the papers' rule.
        SeedExact,
    }
}

params! {
    /// Parameters of [`DepthCull`].
    pub struct DepthCullParams {
        /// When a point counts as hidden.
        rule: Rule = Rule::Majority;
        /// How far behind it may lie: a share of the distance, or of far - near.
        threshold: f32 = 0.05, in 0.0..=10.0;
    }
}

/// See the module.
pub struct DepthCull {
    id: Out<u32>,
    depth: In<u32>,
    filtered: Out<f32>,
    first_vote: Option<Out<u32>>,
}

impl Stage for DepthCull {
    const KIND: &'static str = "depth_cull";
    const DOC: &'static str = "Drops points that lie behind the points around them.";
    type Params = DepthCullParams;

    fn declare(params: &DepthCullParams, io: &mut Io) -> Self {
        io.column(column::P4);
        io.per_view();
        let id = io.update(
            "id",
            ID.doc("The point that each pixel shows; 0xFFFFFFFF where it is dropped."),
            Extent::Frame(1),
        );
        let depth = io.read(
            "depth",
            DEPTH.doc("Bits of the points' distance; infinity where there is none."),
            Extent::Frame(1),
        );
        const FINITE: &[epigraph_core::Rule] = &[epigraph_core::Rule::floats(0.0, f32::MAX)];
        let filtered = io.write(
            "filtered",
            DEPTH.doc(
                "Mean distance of the 3x3 pixels, shifted back by the threshold, metres; the far plane where all \
                 are empty.",
            )
            .within(FINITE),
            Extent::Frame(1),
        );
        io.shader(shader!("depth_cull"));
        io.constants(project::CONSTANTS);
        let first_vote = (params.rule == Rule::Majority).then(|| {
            io.define("MAJORITY");
            io.write(
                "first_vote",
                DEPTH.doc("The depths that the first vote leaves.").scratch(),
                Extent::Frame(1),
            )
        });
        if let Some(first_vote) = first_vote {
            io.dispatch("vote", first_vote);
        }
        io.dispatch("cull", id);
        Self { id, depth, filtered, first_vote }
    }

    fn cpu(&self, params: &DepthCullParams, cx: &CpuContext) -> Result<(), String> {
        let (view, dims) = (&cx.frame().view, cx.dims(self.id));
        let depth = &cx.read(self.depth)[..];
        let (id, filtered) = (&mut cx.write(self.id)[..], &mut cx.write(self.filtered)[..]);

        let (width, height, level) = (dims.width as usize, dims.height as usize, cx.level());
        let image = |depth| Image { depth, width, height, level };
        let far = view.far;
        let scale = 1.0 + params.threshold;
        match params.rule {
            Rule::Majority => {
                let first_vote = &mut cx.write(self.first_vote.expect("declared for this rule"))[..];
                image(depth).vote(scale, first_vote);
                image(first_vote).vote_again(scale, id, filtered, far);
            }
            Rule::Relative => {
                image(depth).cull(id, filtered, far, |z| z, |mean| mean * scale, |z| z.min(far));
            }
            Rule::SeedExact => {
                let buffer = ZBuffer { near: view.near, far };
                let shift = |mean| buffer.shift(params.threshold, mean);
                image(depth).cull(
                    id,
                    filtered,
                    far,
                    |z| buffer.depth(z),
                    shift,
                    |value| buffer.distance(value),
                );
            }
        }
        Ok(())
    }

    fn explain(&self, params: &DepthCullParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// Bits of distances.
#[derive(Clone, Copy)]
struct Image<'a> {
    depth: &'a [u32],
    width: usize,
    height: usize,
    level: Level,
}

impl Image<'_> {
    /// Applies a rule of means: `value` maps a distance to the quantity that the rule compares; `shift` maps a mean to
    /// the smallest hidden value, and `distance` maps a value to a distance of at most `far`.
    fn cull(
        &self,
        id: &mut [u32],
        filtered: &mut [f32],
        far: f32,
        value: impl Fn(f32) -> f32 + Sync,
        shift: impl Fn(f32) -> f32 + Sync,
        distance: impl Fn(f32) -> f32 + Sync,
    ) {
        let rows = id.par_chunks_mut(self.width).zip(filtered.par_chunks_mut(self.width));
        rows.enumerate().for_each(|(y, (id, filtered))| {
            let depth = &self.depth[y * self.width..][..self.width];
            self.means(y, &value, |x, mean| {
                let shifted = mean.map(&shift);
                filtered[x] = shifted.map_or(far, &distance);
                let own = depth[x];
                if shifted.is_some_and(|shifted| own < EMPTY_DEPTH && value(f32::from_bits(own)) > shifted) {
                    id[x] = NO_POINT;
                }
            });
        });
    }

    /// Calls `each` with [`Image::mean_at`] of every pixel of a row. Sums each column only once, several columns at a
    /// time.
    #[inline(always)]
    fn means(&self, y: usize, value: impl Fn(f32) -> f32, mut each: impl FnMut(usize, Option<f32>)) {
        for first in (0..self.width).step_by(BLOCK) {
            // For the columns of the block and the one on either side of it.
            let (mut sums, mut counts) = ([0f32; BLOCK + 2], [0f32; BLOCK + 2]);
            let (from, to) = (first.saturating_sub(1), (first + BLOCK + 1).min(self.width));
            let inside = from + 1 - first..to + 1 - first;
            for row in y.saturating_sub(1)..(y + 2).min(self.height) {
                let row = &self.depth[row * self.width..][from..to];
                let columns = sums[inside.clone()].iter_mut().zip(&mut counts[inside.clone()]);
                for ((sum, count), depth) in columns.zip(row) {
                    // All ones if depth < EMPTY_DEPTH. A branch on whether a pixel is empty would be predicted badly.
                    let there = (depth.wrapping_sub(EMPTY_DEPTH) as i32 >> 31) as u32;
                    *sum += f32::from_bits(value(f32::from_bits(*depth)).to_bits() & there);
                    *count += f32::from_bits(1f32.to_bits() & there);
                }
            }
            for i in 0..BLOCK.min(self.width - first) {
                let [sum, count] = [&sums, &counts].map(|of| of[i] + of[i + 1] + of[i + 2]);
                each(first + i, (count > 0.0).then(|| sum / count));
            }
        }
    }

    /// The mean of the values of the 3x3 pixels around one; `None` if all are empty. Sums each column, then the
    /// columns.
    fn mean_at(&self, [x, y]: [usize; 2], value: impl Fn(f32) -> f32) -> Option<f32> {
        let (mut sum, mut count) = (0.0, 0);
        for x in x.saturating_sub(1)..(x + 2).min(self.width) {
            let mut column = 0.0;
            for y in y.saturating_sub(1)..(y + 2).min(self.height) {
                let depth = self.depth[y * self.width + x];
                if depth < EMPTY_DEPTH {
                    column += value(f32::from_bits(depth));
                    count += 1;
                }
            }
            sum += column;
        }
        (count > 0).then(|| sum / count as f32)
    }

    /// The depths after the majority rule.
    fn vote(&self, scale: f32, kept: &mut [u32]) {
        kept.par_chunks_mut(self.width * BAND).enumerate().for_each(|(band, kept)| {
            let first = band * BAND * self.width;
            kept.copy_from_slice(&self.depth[first..][..kept.len()]);
            let pixels = first..first + kept.len();
            dispatch!(self.level, simd => self.outvoted(simd, pixels.clone(), scale, |p| kept[p - first] = EMPTY_DEPTH));
        });
    }

    /// Drops the points that the first vote dropped and those that this vote drops; the filtered depth is that
    /// of the points before this vote.
    fn vote_again(&self, scale: f32, id: &mut [u32], filtered: &mut [f32], far: f32) {
        let band = self.width * BAND;
        let bands = id.par_chunks_mut(band).zip(filtered.par_chunks_mut(band));
        bands.enumerate().for_each(|(number, (id, filtered))| {
            let first = number * band;
            dispatch!(self.level, simd => self.vote_again_in(simd, first, scale, id, filtered, far));
        });
    }

    /// [`Image::vote_again`] in some rows, from pixel `first` on.
    #[inline(always)]
    fn vote_again_in<S: Simd>(
        &self,
        simd: S,
        first: usize,
        scale: f32,
        id: &mut [u32],
        filtered: &mut [f32],
        far: f32,
    ) {
        for (id, depth) in id.iter_mut().zip(&self.depth[first..]) {
            // Without a branch, so that several are processed at a time.
            *id |= u32::from(*depth == EMPTY_DEPTH).wrapping_neg() & NO_POINT;
        }
        self.outvoted(simd, first..first + id.len(), scale, |p| id[p - first] = NO_POINT);
        for (y, filtered) in (first / self.width..).zip(filtered.chunks_mut(self.width)) {
            self.means(y, |z| z, |x, mean| filtered[x] = mean.map_or(far, |mean| (mean * scale).min(far)));
        }
    }

    /// Calls `drop` for the pixels of some whole rows, indexed row by row, for which [`Image::is_outvoted`] holds.
    /// Tests only pixels that have a clearly nearer pixel around them.
    #[inline(always)]
    fn outvoted<S: Simd>(&self, simd: S, pixels: Range<usize>, scale: f32, mut drop: impl FnMut(usize)) {
        let rows = pixels.start / self.width..pixels.end / self.width;
        let distances = |pixels: Range<usize>, distances: &mut [f32]| {
            let depth = &self.depth[pixels];
            distances.iter_mut().zip(depth).for_each(|(distance, bits)| *distance = f32::from_bits(*bits));
        };
        where_nearer([self.width, self.height], rows, scale, distances, |x, y, wanted| {
            let outvoted = self.are_outvoted(simd, x, y, scale, wanted);
            for lane in (0..LANES).filter(|lane| outvoted >> lane & 1 != 0) {
                drop(y * self.width + x + lane);
            }
        });
    }

    /// [`Image::is_outvoted`] for those of [`LANES`] pixels that are wanted; they show points. As bits.
    #[inline(always)]
    fn are_outvoted<S: Simd>(&self, simd: S, x: usize, y: usize, scale: f32, wanted: u8) -> u8 {
        if is_inside([self.width, self.height], x, y) {
            let [voters, nearer] = self.ballots(simd, x, y, scale);
            // Half of them, as [`Image::majority`] where the 5x5 pixels are inside. Without voters, none is nearer either.
            wanted
                & (voters.simd_gt(u32x8::splat(simd, 0)) & (nearer << 1).simd_ge(voters)).to_bitmask() as u8
        } else {
            let is_outvoted = |lane: &usize| wanted >> lane & 1 != 0 && self.is_outvoted(x + lane, y, scale);
            (0..LANES).filter(is_outvoted).fold(0, |bits, lane| bits | 1 << lane)
        }
    }

    /// [`Image::ballot`] for [`LANES`] pixels whose 5x5 pixels are inside.
    #[inline(always)]
    fn ballots<S: Simd>(&self, simd: S, x: usize, y: usize, scale: f32) -> [u32x8<S>; 2] {
        let row = |dy: usize| &self.depth[(y + dy - REACH) * self.width + x - REACH..][..LANES + SPAN - 1];
        let z = f32x8::from_bits(u32x8::from_slice(simd, &row(REACH)[REACH..][..LANES]));
        // The point itself is not a voter, so these are counted from -1. All ones are -1 too: to subtract them adds 1.
        let (mut voters, mut nearer) = (u32x8::splat(simd, u32::MAX), u32x8::splat(simd, 0));
        for dy in 0..SPAN {
            for dx in 0..SPAN {
                let depth = u32x8::from_slice(simd, &row(dy)[dx..][..LANES]);
                voters -= bits(simd, depth.simd_lt(u32x8::splat(simd, EMPTY_DEPTH)));
                let scaled = f32x8::from_bits(depth) * f32x8::splat(simd, scale);
                nearer -= bits(simd, scaled.simd_lt(z));
            }
        }
        [voters, nearer]
    }

    /// Whether a pixel shows a point, there are others in the 5x5 pixels, and enough of these are clearly nearer.
    fn is_outvoted(&self, x: usize, y: usize, scale: f32) -> bool {
        let [voters, nearer] = self.ballot(x, y, scale);
        let is_there = self.depth[y * self.width + x] < EMPTY_DEPTH;
        is_there && voters > 0 && nearer >= self.majority(x, y, voters)
    }

    /// The number of votes that outvote a point, given the number of voters: half. Pixels outside the image count as
    /// voters that are not nearer; otherwise a strip of background along the border, narrower than the object that
    /// hides it, would lose its points. But 7 of 8 are always enough.
    fn majority(&self, x: usize, y: usize, voters: i32) -> i32 {
        let span = |at: usize, size: usize| ((at + 3).min(size) - at.saturating_sub(2)) as i32;
        // Without the pixel itself. If there are none, there are no voters either.
        let inside = (span(x, self.width) * span(y, self.height) - 1).max(1);
        (voters * (inside * 7 / 4).min(24) + 2 * inside - 1) / (2 * inside)
    }

    /// The number of other points in the 5x5 pixels, and how many of them are clearly nearer.
    #[inline(always)]
    fn ballot(&self, x: usize, y: usize, scale: f32) -> [i32; 2] {
        let z = f32::from_bits(self.depth[y * self.width + x]);
        // The point itself is not a voter, and is never nearer than itself.
        let (mut voters, mut nearer) = (-1, 0);
        for y in y.saturating_sub(2)..(y + 3).min(self.height) {
            for depth in &self.depth[y * self.width..][x.saturating_sub(2)..(x + 3).min(self.width)] {
                voters += i32::from(*depth < EMPTY_DEPTH);
                nearer += i32::from(f32::from_bits(*depth) * scale < z);
            }
        }
        [voters, nearer]
    }
}

/// The depth of a z-buffer with range 0 (near) to 1 (far): `algorithms.md` section 3.
struct ZBuffer {
    near: f32,
    far: f32,
}

impl ZBuffer {
    /// The depth of a distance.
    fn depth(&self, z: f32) -> f32 {
        let Self { near, far } = self;
        (1.0 - near / z) * (far / (far - near))
    }

    /// The distance of a depth.
    fn distance(&self, depth: f32) -> f32 {
        let Self { near, far } = self;
        (near / (1.0 - depth * ((far - near) / far))).max(*near).min(*far)
    }

    /// The depth of a point `share` * (far - near) behind, at most 1.
    fn shift(&self, share: f32, depth: f32) -> f32 {
        let rho = self.near / self.far;
        let q = 1.0 - rho;
        let (a, b) = (rho - share * q, share);
        let (g, h) = (-share * q * q, rho + share * q);
        let denominator = g * depth + h;
        // If rounding leaves nothing of it, the result is beyond the far plane.
        if denominator > 0.0 { ((a * depth + b) / denominator).min(1.0) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Harness, View};

    use super::*;
    use crate::shared::testing::{Random, run_alike, run_both, settings};

    const EMPTY: f32 = f32::INFINITY;

    fn harness(params: DepthCullParams, size: [u32; 2], depths: &[f32]) -> Harness<DepthCull> {
        let mut harness = Harness::new(params, &settings(size, 0));
        harness.frame.view = View { near: 0.1, far: 1000.0, ..View::default() };
        let id = |(p, depth): (u32, &f32)| if *depth < EMPTY { p } else { NO_POINT };
        harness.set("id", &(0..).zip(depths).map(id).collect::<Vec<u32>>());
        harness.set("depth", &depths.iter().map(|depth| depth.to_bits()).collect::<Vec<u32>>());
        harness
    }

    /// Parameters of the rule.
    fn settled(rule: Rule) -> DepthCullParams {
        DepthCullParams { rule, threshold: 0.05 }
    }

    /// Returns true if a point at `z` in the middle of 3x3 pixels is dropped if `count` neighbours are at `z0`.
    fn is_dropped(params: DepthCullParams, view: View, z: f32, count: usize, z0: f32) -> bool {
        let mut depths = [EMPTY; 9];
        depths[4] = z;
        let neighbours = [0, 1, 2, 3, 5, 6, 7, 8];
        neighbours[..count].iter().for_each(|&p| depths[p] = z0);
        let mut harness = harness(params, [3, 3], &depths);
        harness.frame.view = view;
        run_alike(&mut harness).get::<u32>("id")[4] == NO_POINT
    }

    fn view(near: f32, far: f32) -> View {
        View { near, far, ..View::default() }
    }

    #[test]
    fn thresholds_of_the_relative_rule() {
        // (1 + t) k / (k - t): algorithms.md section 1.3.
        for (count, ratio) in [(1, 1.1053), (2, 1.0769), (8, 1.0566)] {
            for z0 in [0.2, 7.0, 900.0] {
                let dropped =
                    |ratio| is_dropped(settled(Rule::Relative), view(0.1, 1000.0), ratio * z0, count, z0);
                assert!(!dropped(ratio - 2e-4) && dropped(ratio + 2e-4), "{count} neighbours at {z0}");
            }
        }
    }

    #[test]
    fn a_lone_point_stays() {
        for rule in [Rule::Majority, Rule::Relative, Rule::SeedExact] {
            for threshold in [0.0, 0.05] {
                let params = DepthCullParams { rule, threshold };
                assert!(!is_dropped(params, view(0.1, 1000.0), 999.0, 0, 0.0), "{rule:?}");
            }
        }
    }

    #[test]
    fn half_of_the_others_outvote_a_point() {
        // 5x5 pixels: n nearer, f a little farther, . empty; p is at 10.
        let dropped = |rows: [&str; 5], near: f32| {
            let z = |c| match c {
                'n' => near,
                'f' => 10.2,
                'p' => 10.0,
                _ => EMPTY,
            };
            let depths: Vec<f32> = rows.iter().flat_map(|row| row.chars().map(z)).collect();
            let both = run_both(&mut harness(settled(Rule::Majority), [5, 5], &depths));
            both.assert_equal::<u32>("id");
            both.cpu.get::<u32>("id")[12] == NO_POINT
        };
        // Clearly nearer: 9.5 * 1.05 < 10, but not 9.53 * 1.05.
        assert!(dropped([".....", ".....", ".np..", ".....", "....."], 9.5));
        assert!(!dropped([".....", ".....", ".np..", ".....", "....."], 9.53));
        // Half of the others are enough, fewer are not. Voters at the rim count as much as those beside the point.
        assert!(dropped(["n...f", ".....", "..p..", ".....", "....."], 5.0));
        assert!(!dropped(["n...f", ".....", "..p..", ".....", "f...."], 5.0));
        // A straight border of a full surface, one pixel away: two columns of five, 10 of 24.
        assert!(!dropped(["nnfff", "nnfff", "nnpff", "nnfff", "nnfff"], 5.0));
    }

    /// The points that are left of some rows: n is near, f far, a dot empty.
    fn voted(rows: &[&str]) -> Vec<String> {
        let z = |c| match c {
            'n' => 1.0,
            'f' => 9.0,
            _ => EMPTY,
        };
        let depths: Vec<f32> = rows.iter().flat_map(|row| row.chars().map(z)).collect();
        let size = [rows[0].len(), rows.len()].map(|side| side as u32);
        let both = run_both(&mut harness(settled(Rule::Majority), size, &depths));
        both.assert_equal::<u32>("id");
        let id = both.cpu.get::<u32>("id");
        let left = |(row, id): (&&str, &[u32])| {
            row.chars().zip(id).map(|(c, id)| if *id == NO_POINT { '.' } else { c }).collect()
        };
        rows.iter().zip(id.chunks(rows[0].len())).map(left).collect()
    }

    #[test]
    fn a_strip_along_the_border_keeps_its_points() {
        // Anywhere else, the same strip of one pixel is outvoted, by 20 of 24.
        assert_eq!(voted(&["fnnnnnnn"; 7])[3], "fnnnnnnn");
        assert_eq!(voted(&["nnnnnnnf"; 7])[3], "nnnnnnnf");
        assert_eq!(voted(&["nnnfnnnn"; 7])[3], "nnn.nnnn");
        // A single far point is dropped at the border too, and in the corner.
        let all = "nnnnnnnn";
        assert_eq!(voted(&[all, all, "fnnnnnnn", all, all])[2], ".nnnnnnn");
        assert_eq!(voted(&["fnnnnnnn", all, all])[0], ".nnnnnnn");
    }

    #[test]
    fn points_dropped_by_the_first_vote_do_not_vote_again() {
        // A row of points between empty rows: the two points to the left and the two to the right vote.
        let left = |text: &str| -> String {
            let empty = ".".repeat(text.len());
            voted(&[&empty, &empty, text, &empty, &empty]).swap_remove(2)
        };
        // f at 2 has the voters n n f f: two of four are nearer, and it is dropped. f at 3 has n f f f and stays; it
        // stays in the second vote too, when f at 2 is gone: one of three.
        assert_eq!(left("nnffffff"), "nn.fffff");
        // All are dropped in the first vote: f at 2 has the voters n n f f, f at 3 has n f f n, and f at 4 has f f n n.
        assert_eq!(left("nnfffnn"), "nn...nn");
        // The middle one of five has only far voters, and so stays in both votes.
        assert_eq!(left("nnfffffnn"), "nn.fff.nn");
    }

    #[test]
    fn golden_numbers_of_the_shift() {
        // algorithms.md section 3: n = 100, f = 1e4, c = 0.05.
        let buffer = ZBuffer { near: 100.0, far: 1e4 };
        let golden =
            [(0.0, 0.840336134f64), (0.909090909, 0.942535725), (0.98989899, 0.991718826), (1.0, 1.0)];
        for (depth, shifted) in golden {
            // The tolerance is some ulps of 1.
            assert!((f64::from(buffer.shift(0.05, depth as f32)) - shifted).abs() < 5e-7, "{depth}");
        }
        assert!((f64::from(buffer.depth(1000.0)) - 0.909090909).abs() < 2e-7);
        assert!((buffer.distance(0.942535725f64 as f32) - 1495.0).abs() < 0.02);
        assert_eq!(buffer.depth(100.0), 0.0);
        // A range without extent, or the wrong way round, has distances too.
        assert_eq!(ZBuffer { near: 2.0, far: 1.0 }.distance(0.5), 1.0);
        assert!((buffer.depth(1e4) - 1.0).abs() < 2e-7);
        assert_eq!((buffer.distance(0.0), buffer.distance(1.0)), (100.0, 1e4));
    }

    #[test]
    fn the_papers_rule_shifts_by_a_share_of_the_range() {
        // One neighbour at 1000. A point at z is dropped where z > m + 0.05 * 9900, m the harmonic mean of both
        // distances: z - 2000 z / (1000 + z) > 495.
        let params = settled(Rule::SeedExact);
        let dropped = |z| is_dropped(params.clone(), view(100.0, 1e4), z, 1, 1000.0);
        let least = (1495.0 + (1495.0f32.powi(2) + 4.0 * 495_000.0).sqrt()) / 2.0;
        assert!(!dropped(least * 0.999) && dropped(least * 1.001), "{least}");
    }

    #[test]
    fn conditioning() {
        let far = 1e6;
        let view = view(0.1, far);
        for z in [1.0, 1e3, 1e5, 9e5] {
            let dropped = |rule, ratio| is_dropped(settled(rule), view, ratio * z, 8, z);
            // Near to far is 1 : 10^7. Relative rules hold at every distance.
            assert!(!dropped(Rule::Majority, 1.049) && dropped(Rule::Majority, 1.051), "{z}");
            assert!(!dropped(Rule::Relative, 1.05) && dropped(Rule::Relative, 1.07), "{z}");
        }
        // The papers' rule has lost all its digits: points a thousand times farther than their surroundings stay.
        let params = settled(Rule::SeedExact);
        assert!(!is_dropped(params, view, 8e5, 8, 800.0));
    }

    #[test]
    fn the_filtered_depth() {
        let params = || DepthCullParams { rule: Rule::Relative, threshold: 0.5 };
        let out = run_alike(&mut harness(params(), [3, 1], &[2.0, EMPTY, 4.0]));
        assert_eq!(out.get::<f32>("filtered"), [3.0, 4.5, 6.0]);
        let out = run_alike(&mut harness(params(), [2, 2], &[EMPTY; 4]));
        assert_eq!(out.get::<f32>("filtered"), [1000.0; 4]);
        // The filtered depth is never beyond the far plane.
        let out = run_alike(&mut harness(params(), [1, 1], &[900.0]));
        assert_eq!((out.get::<f32>("filtered")[0], out.get::<u32>("id")[0]), (1000.0, 0));
    }

    /// Images of all widths around a block, with depths that are random or difficult: extreme, equal, or a rounding
    /// apart.
    fn images() -> Vec<([usize; 2], Vec<u32>)> {
        let mut random = Random(17);
        let mut images = Vec::new();
        for size in [[1, 1], [1, 9], [9, 1], [2, 2], [61, 47], [63, 3], [64, 33], [65, 35], [130, 5]] {
            for hard in [false, true] {
                let depth = |_| match (random.below(6), hard) {
                    (0, _) => EMPTY,
                    (1, false) => random.between(0.1, 1000.0),
                    (_, false) => random.between(10.0, 11.0),
                    (1, true) => f32::MIN_POSITIVE,
                    (2, true) => f32::MAX,
                    (3, true) => 10.0 * 1.05,
                    (4, true) => f32::next_up(10.0 * 1.05),
                    (_, true) => 10.0,
                };
                let depths = (0..size[0] * size[1]).map(depth).map(f32::to_bits).collect();
                images.push((size, depths));
            }
        }
        images
    }

    #[test]
    fn means_of_rows_equal_the_means_at_each_pixel() {
        let buffer = ZBuffer { near: 0.1, far: 1000.0 };
        for ([width, height], depth) in images() {
            let image = Image { depth: &depth, width, height, level: Level::new() };
            for y in 0..height {
                let mut next = 0;
                let mut assert_same = |x, tuned: Option<f32>, plain: Option<f32>| {
                    assert_eq!(
                        tuned.map(f32::to_bits),
                        plain.map(f32::to_bits),
                        "({x}, {y}) of {width}x{height}"
                    );
                    next += 1;
                };
                image.means(y, |z| z, |x, mean| assert_same(x, mean, image.mean_at([x, y], |z| z)));
                let depth = |z| buffer.depth(z);
                image.means(y, depth, |x, mean| assert_same(x, mean, image.mean_at([x, y], depth)));
                assert_eq!(next, 2 * width);
            }
        }
    }

    #[test]
    fn the_vote_of_rows_equals_the_vote_at_each_pixel() {
        for threshold in [0.0, 0.05, 10.0] {
            let scale = 1.0 + threshold;
            for ([width, height], depth) in images() {
                let voted = |depth: &[u32]| -> Vec<u32> {
                    let image = Image { depth, width, height, level: Level::new() };
                    let kept = |p| {
                        if image.is_outvoted(p % width, p / width, scale) { EMPTY_DEPTH } else { depth[p] }
                    };
                    (0..depth.len()).map(kept).collect()
                };
                let (first, depths) = (voted(&depth), depth.iter().map(|&bits| f32::from_bits(bits)));
                let mut harness = harness(
                    DepthCullParams { rule: Rule::Majority, threshold },
                    [width as u32, height as u32],
                    &depths.collect::<Vec<_>>(),
                );
                let out = run_alike(&mut harness);
                assert_eq!(out.get::<u32>("first_vote"), first, "{width}x{height}");
                let shows = |(p, depth): (u32, u32)| if depth == EMPTY_DEPTH { NO_POINT } else { p };
                let second: Vec<u32> = (0..).zip(voted(&first)).map(shows).collect();
                assert_eq!(out.get::<u32>("id"), second, "{width}x{height}");
            }
        }
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(5);
        let depth = |_| match random.below(4) {
            0 => EMPTY,
            1 => random.between(0.1, 1000.0),
            _ => random.between(10.0, 11.0),
        };
        let depths: Vec<f32> = (0..61 * 47).map(depth).collect();
        for rule in [Rule::Majority, Rule::Relative, Rule::SeedExact] {
            let mut harness = harness(settled(rule), [61, 47], &depths);
            let both = run_both(&mut harness);
            let dropped = both.cpu.get::<u32>("id").iter().filter(|&&id| id == NO_POINT).count();
            assert!(dropped > 61 * 47 / 4, "{dropped} empty or dropped");
            // Values that are equal up to rounding may compare either way.
            both.assert_equal_but::<u32>("id", 2);
            match rule {
                // Nine sums and a division of numbers up to 1000: some ulps of 1000.
                Rule::Majority | Rule::Relative => both.assert_close("filtered", 1e-3),
                // The shift loses digits as z^2 / (c n f) ulps: 1e4 of them at a mean of 1000.
                Rule::SeedExact => both.assert_close("filtered", 2.0),
            }
        }
    }

    #[test]
    fn equally_near_points_outvote_nobody() {
        for threshold in [0.0, 0.05] {
            let params = DepthCullParams { rule: Rule::Majority, threshold };
            let out = run_alike(&mut harness(params, [6, 4], &[3.0; 24]));
            assert_eq!(out.get::<u32>("id"), (0..24).collect::<Vec<u32>>());
        }
        // Without a threshold, the next nearer number is nearer.
        let params = DepthCullParams { rule: Rule::Majority, threshold: 0.0 };
        let mut depths = [f32::from_bits(3.0f32.to_bits() - 1); 25];
        depths[12] = 3.0;
        assert_eq!(run_alike(&mut harness(params, [5, 5], &depths)).get::<u32>("id")[12], NO_POINT);
    }

    #[test]
    fn every_number_of_votes_at_every_distance_from_the_border() {
        // A far point somewhere in 5x5 pixels, and more and more near ones around it: where it goes depends on both.
        let mut harness = harness(settled(Rule::Majority), [5, 5], &[EMPTY; 25]);
        for at in 0..25 {
            let near: Vec<usize> = (0..25).filter(|&p| p != at).collect();
            for count in 0..=24 {
                // The others are as far as the point itself.
                let mut depths = [9.0f32; 25];
                near[..count].iter().for_each(|&p| depths[p] = 1.0);
                harness.set("id", &(0..25).collect::<Vec<u32>>());
                harness.set("depth", &depths.map(f32::to_bits));
                let is_dropped = run_alike(&mut harness).get::<u32>("id")[at] == NO_POINT;
                assert!(if is_dropped { count > 0 } else { count < 24 }, "pixel {at}, {count} near ones");
            }
        }
    }
}
