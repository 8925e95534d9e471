//! Drops points that shine through a nearer surface: a pixel whose point lies clearly behind the mean depth of its 3x3
//! neighbourhood becomes empty. The shifted mean is also the depth that later stages test against
//! (`algorithms.md` sections 1.3 and 3).
//!
//! *Relative*, the default, compares linear distances: z > (1 + threshold) * mean. *SeedExact* is the papers' rule: means
//! of the depth zd of a 24-bit z-buffer, f (z - n) / (z (f - n)), shifted by threshold * (f - n) metres. The mean of zd
//! is a harmonic mean of z, and near zd = 1 the shift loses its digits: it fits scenes with f / n of a few hundred.

use epigraph_core::{CpuContext, Extent, In, Io, Out, Stage, choice, params, shader};
use rayon::prelude::*;

use crate::{project::EMPTY_DEPTH, shared::requests::NO_POINT};

choice! {
    /// When a point counts as hidden.
    pub enum Rule {
        /// Farther than (1 + threshold) times the mean distance.
        Relative,
        /// Farther than the mean z-buffer depth shifted by threshold * (far - near): the papers' rule.
        SeedExact,
    }
}

params! {
    /// Parameters of [`DepthCull`].
    pub struct DepthCullParams {
        /// When a point counts as hidden.
        rule: Rule = Rule::Relative;
        /// How far behind the mean it may lie: a share of the mean, or of far - near.
        threshold: f32 = 0.05, in 0.0..=10.0;
    }
}

/// See the module.
pub struct DepthCull {
    id: Out<u32>,
    depth: In<u32>,
    filtered: Out<f32>,
}

impl Stage for DepthCull {
    const KIND: &'static str = "depth_cull";
    const DOC: &'static str = "Drops points that lie behind the mean depth of their 3x3 pixels.";
    type Params = DepthCullParams;

    fn declare(_: &DepthCullParams, io: &mut Io) -> Self {
        let id = io.update(
            "id",
            "The point that each pixel shows; 0xFFFFFFFF where it is dropped.",
            Extent::Frame(1),
        );
        let depth =
            io.read("depth", "Bits of the points' distance; infinity where there is none.", Extent::Frame(1));
        let filtered = io.write(
            "filtered",
            "Mean distance of the 3x3 pixels, shifted back by the threshold, metres; the far plane where all are empty.",
            Extent::Frame(1),
        );
        io.shader(shader!("depth_cull"));
        io.dispatch("cull", id);
        Self { id, depth, filtered }
    }

    fn cpu(&self, params: &DepthCullParams, cx: &CpuContext) -> Result<(), String> {
        let (view, dims) = (&cx.frame().view, cx.dims(self.id));
        let depth = &cx.read(self.depth)[..];
        let (id, filtered) = (&mut cx.write(self.id)[..], &mut cx.write(self.filtered)[..]);

        let image = Image { depth, width: dims.width as usize, height: dims.height as usize };
        let far = view.far;
        match params.rule {
            Rule::Relative => {
                let threshold = 1.0 + params.threshold;
                image.cull(id, filtered, far, |z| z, |mean| mean * threshold, |z| z.min(far));
            }
            Rule::SeedExact => {
                let buffer = ZBuffer { near: view.near, far };
                let shift = |mean| buffer.shift(params.threshold, mean);
                image.cull(id, filtered, far, |z| buffer.depth(z), shift, |value| buffer.distance(value));
            }
        }
        Ok(())
    }
}

/// Bits of distances.
struct Image<'a> {
    depth: &'a [u32],
    width: usize,
    height: usize,
}

impl Image<'_> {
    /// Applies a rule: `value` is what it compares, for a distance; `shift` gives the least value that is hidden where
    /// the mean is its argument, and `distance` the distance of a value, at most `far`.
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
            let (mut left, mut centre) = (Sum::default(), self.column(0, y, &value));
            for x in 0..self.width {
                let right = self.column(x + 1, y, &value);
                let sum = left.plus(centre).plus(right);
                (left, centre) = (centre, right);
                if sum.count == 0.0 {
                    filtered[x] = far;
                    continue;
                }
                let shifted = shift(sum.sum / sum.count);
                filtered[x] = distance(shifted);
                let own = self.depth[y * self.width + x];
                if own < EMPTY_DEPTH && value(f32::from_bits(own)) > shifted {
                    id[x] = NO_POINT;
                }
            }
        });
    }

    /// The values of the pixels above, at and below (x, y), as far as they are there.
    #[inline(always)]
    fn column(&self, x: usize, y: usize, value: impl Fn(f32) -> f32) -> Sum {
        let mut column = Sum::default();
        for y in [y.wrapping_sub(1), y, y + 1] {
            if x < self.width && y < self.height {
                let depth = self.depth[y * self.width + x];
                // All ones where depth < EMPTY_DEPTH. A branch on whether a pixel is empty would be predicted badly.
                let there = (depth.wrapping_sub(EMPTY_DEPTH) as i32 >> 31) as u32;
                column.sum += f32::from_bits(value(f32::from_bits(depth)).to_bits() & there);
                column.count += f32::from_bits(1f32.to_bits() & there);
            }
        }
        column
    }
}

/// The sum of some values, and how many there are.
#[derive(Clone, Copy, Default)]
struct Sum {
    sum: f32,
    count: f32,
}

impl Sum {
    fn plus(self, other: Self) -> Self {
        Self { sum: self.sum + other.sum, count: self.count + other.count }
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
        (near / (1.0 - depth * ((far - near) / far))).clamp(*near, *far)
    }

    /// The depth of what lies `share` * (far - near) behind, at most 1.
    fn shift(&self, share: f32, depth: f32) -> f32 {
        let rho = self.near / self.far;
        let q = 1.0 - rho;
        let (a, b) = (rho - share * q, share);
        let (g, h) = (-share * q * q, rho + share * q);
        let denominator = g * depth + h;
        // Where rounding leaves nothing of it, the result lies beyond the far plane.
        if denominator > 0.0 { ((a * depth + b) / denominator).min(1.0) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Harness, View};

    use super::*;
    use crate::shared::testing::{Random, run_both, run_cpu, settings};

    const EMPTY: f32 = f32::INFINITY;

    fn harness(params: DepthCullParams, size: [u32; 2], depths: &[f32]) -> Harness<DepthCull> {
        let mut harness = Harness::new(params, &settings(size, 0));
        harness.frame.view = View { near: 0.1, far: 1000.0, ..View::default() };
        let id = |(p, depth): (u32, &f32)| if *depth < EMPTY { p } else { NO_POINT };
        harness.set("id", &(0..).zip(depths).map(id).collect::<Vec<u32>>());
        harness.set("depth", &depths.iter().map(|depth| depth.to_bits()).collect::<Vec<u32>>());
        harness
    }

    /// Whether a point at `z` in the middle of 3x3 pixels is dropped where `count` neighbours lie at `z0`.
    fn is_dropped(params: DepthCullParams, view: View, z: f32, count: usize, z0: f32) -> bool {
        let mut depths = [EMPTY; 9];
        depths[4] = z;
        let neighbours = [0, 1, 2, 3, 5, 6, 7, 8];
        neighbours[..count].iter().for_each(|&p| depths[p] = z0);
        let mut harness = harness(params, [3, 3], &depths);
        harness.frame.view = view;
        run_cpu(&mut harness).get::<u32>("id")[4] == NO_POINT
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
                    |ratio| is_dropped(DepthCullParams::default(), view(0.1, 1000.0), ratio * z0, count, z0);
                assert!(!dropped(ratio - 2e-4) && dropped(ratio + 2e-4), "{count} neighbours at {z0}");
            }
        }
    }

    #[test]
    fn a_lone_point_stays() {
        for rule in [Rule::Relative, Rule::SeedExact] {
            for threshold in [0.0, 0.05] {
                let params = DepthCullParams { rule, threshold };
                assert!(!is_dropped(params, view(0.1, 1000.0), 999.0, 0, 0.0), "{rule:?}");
            }
        }
    }

    #[test]
    fn golden_numbers_of_the_shift() {
        // algorithms.md section 3: n = 100, f = 1e4, c = 0.05.
        let buffer = ZBuffer { near: 100.0, far: 1e4 };
        let golden =
            [(0.0, 0.840336134f64), (0.909090909, 0.942535725), (0.98989899, 0.991718826), (1.0, 1.0)];
        for (depth, shifted) in golden {
            // Some ulps of 1.
            assert!((f64::from(buffer.shift(0.05, depth as f32)) - shifted).abs() < 5e-7, "{depth}");
        }
        assert!((f64::from(buffer.depth(1000.0)) - 0.909090909).abs() < 2e-7);
        assert!((buffer.distance(0.942535725f64 as f32) - 1495.0).abs() < 0.02);
        assert_eq!(buffer.depth(100.0), 0.0);
        assert!((buffer.depth(1e4) - 1.0).abs() < 2e-7);
        assert_eq!((buffer.distance(0.0), buffer.distance(1.0)), (100.0, 1e4));
    }

    #[test]
    fn the_papers_rule_shifts_by_a_share_of_the_range() {
        // One neighbour at 1000. A point at z is dropped where z > m + 0.05 * 9900, m the harmonic mean of both distances:
        // z - 2000 z / (1000 + z) > 495.
        let params = DepthCullParams { rule: Rule::SeedExact, threshold: 0.05 };
        let dropped = |z| is_dropped(params.clone(), view(100.0, 1e4), z, 1, 1000.0);
        let least = (1495.0 + (1495.0f32.powi(2) + 4.0 * 495_000.0).sqrt()) / 2.0;
        assert!(!dropped(least * 0.999) && dropped(least * 1.001), "{least}");
    }

    #[test]
    fn conditioning() {
        let far = 1e6;
        let view = view(0.1, far);
        for z in [1.0, 1e3, 1e5, 9e5] {
            let dropped =
                |rule, ratio| is_dropped(DepthCullParams { rule, threshold: 0.05 }, view, ratio * z, 8, z);
            // Near to far is 1 : 10^7. The relative rule holds at every distance.
            assert!(!dropped(Rule::Relative, 1.05) && dropped(Rule::Relative, 1.07), "{z}");
        }
        // The papers' has lost all its digits: what is a thousand times farther than its surroundings stays.
        let params = DepthCullParams { rule: Rule::SeedExact, threshold: 0.05 };
        assert!(!is_dropped(params, view, 8e5, 8, 800.0));
    }

    #[test]
    fn the_filtered_depth() {
        let params = || DepthCullParams { threshold: 0.5, ..DepthCullParams::default() };
        let out = run_cpu(&mut harness(params(), [3, 1], &[2.0, EMPTY, 4.0]));
        assert_eq!(out.get::<f32>("filtered"), [3.0, 4.5, 6.0]);
        let out = run_cpu(&mut harness(params(), [2, 2], &[EMPTY; 4]));
        assert_eq!(out.get::<f32>("filtered"), [1000.0; 4]);
        // Never beyond the far plane.
        let out = run_cpu(&mut harness(params(), [1, 1], &[900.0]));
        assert_eq!((out.get::<f32>("filtered")[0], out.get::<u32>("id")[0]), (1000.0, 0));
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
        for rule in [Rule::Relative, Rule::SeedExact] {
            let mut harness = harness(DepthCullParams { rule, threshold: 0.05 }, [61, 47], &depths);
            let both = run_both(&mut harness);
            let dropped = both.cpu.get::<u32>("id").iter().filter(|&&id| id == NO_POINT).count();
            assert!(dropped > 61 * 47 / 4, "{dropped} empty or dropped");
            // A comparison within a rounding of equality may fall the other way.
            both.assert_equal_but::<u32>("id", 2);
            match rule {
                // Nine sums and a division, of numbers up to 1000: some ulps of 1000.
                Rule::Relative => both.assert_close("filtered", 1e-3),
                // The shift loses digits as z^2 / (c n f) ulps: 1e4 of them at a mean of 1000.
                Rule::SeedExact => both.assert_close("filtered", 2.0),
            }
        }
    }
}
