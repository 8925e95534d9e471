//! Takes the picture of a resting camera to what its samples converge to (`algorithms.md` section 12.4).
//!
//! However clean samples are, a picture interpolated from them stays wrong where it lacks something: in pixels in which edges meet,
//! at highlights and textures finer than a pixel. But while the camera rests, each pixel gets samples of its own. From
//! the fourth one on they are requested all over the pixel's area, so their mean converges to the pixel's true colour. That
//! mean is noisy at first. So it is mixed into the picture by the share of their difference that noise does not explain.

use epigraph_core::{
    CpuContext, Extent, Finding, Frame, In, Io, Out, Site, Stage, Threads, constants, scratch, texel,
};
use rayon::prelude::*;

use crate::{
    column, integrate,
    meaning::{AIM, ID, LIGHT_SHIFT, MOVES, RADIANCE, SAMPLES},
    shared::{
        cloud::{NO_POINT, bounded},
        color::luminance,
        moves::Move,
        random::pcg,
        renewal::is_spread,
        requests::{HIT_NONE, Request, SPREAD, Sample, VIEW_LATE, VIEW_NOW},
        view::place_in_image,
    },
};

#[path = "explain/refine.rs"]
mod explain;

constants! {
    /// As many samples of a pixel come first, where the cloud needs them: they clear most of its noise.
    const FIRST: u32 = 3;
    /// The fewest samples of a mean that tell anything.
    const FEWEST: u32 = 4;
    /// How much more a variance may be than so few samples say: 1 + this / (samples - 1) times.
    const DOUBT: f32 = 2.0;
    /// What so few samples may have missed, over the square of their number: the mean squared step to neighbours in the picture,
    /// and the squared luminance of the picture, times these.
    const MISSED_STEPS: f32 = 2.0;
    const MISSED_LIGHT: f32 = 16.0;
    /// How many times the variance the squared differences of a pixel and its neighbours must be, together.
    const CAUTION: f32 = 2.0;
    /// A late sample counts if it is at most this many pixels, on each axis, from where it was aimed.
    const NEAR: f32 = 0.0625;
    /// Steps from sample to sample, in 1/65536 of a pixel: 1/g and 1/g² with g³ = g + 1, rounded to odd numbers. The
    /// sequence of Roberts (2018), R2, is spread evenly for any count.
    const STEP_X: u32 = 49471;
    const STEP_Y: u32 = 37345;
    /// The most samples that a mean counts for: beyond that, steps of its f32 are too coarse.
    const MOST: u32 = 1 << 20;
    /// Pixels on each side of a tile of `shift`.
    const TILE: u32 = integrate::TILE;
    /// The bits of one axis of an aim.
    const AXIS: u32 = 0xFFFF;
}

/// See the module.
pub struct Refine {
    color: In<texel::Rgba32Float>,
    samples: In<Sample>,
    id: In<u32>,
    aim: In<u32>,
    shift: Option<In<f32>>,
    moves: Option<In<Move>>,
    refined: Out<texel::Rgba32Float>,
    next: Out<u32>,
    mean: Out<[f32; 4]>,
    count: Out<u32>,
    asked: Out<u32>,
    evidence: Out<[f32; 2]>,
}

impl Stage for Refine {
    const KIND: &'static str = "refine";
    const DOC: &'static str = "Takes the picture of a resting camera to what its samples converge to.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.column(column::I2);
        let pixels = || Extent::Frame(1);
        let color = io.read("color", RADIANCE.doc("Linear radiance of whole pixels."), pixels());
        let samples =
            io.history("samples", SAMPLES.doc("The samples that arrived in the last frame."), Extent::Any);
        let id = io.read("id", ID, pixels());
        let aim = io.read("aim", AIM.doc("Where the first sample of a pixel should go."), pixels());
        let doc =
            "Of each tile of 32 x 32 pixels: means begin anew. Without it, light is taken not to change.";
        let shift = io.optional("shift", LIGHT_SHIFT.doc(doc), Extent::Frame(TILE));
        let doc = "While bodies move, the picture stays as it is. Without it, nothing does.";
        let moves = io.optional("moves", MOVES.doc(doc), Extent::Any);
        let refined = io.write("refined", RADIANCE.doc("Linear radiance of whole pixels."), pixels());
        let next = io.write("next", AIM, pixels());
        let doc = "Mean of the samples that were spread over each pixel since the camera rests, and the sum of squares \
                   of their luminance around its mean.";
        let mean = io.persistent("mean", doc, pixels());
        let count = io.persistent(
            "count",
            "The number of samples of each pixel since then: the first, and those in the mean.",
            pixels(),
        );
        let asked =
            io.persistent("asked", "Index + 1 of the sample that joins in this frame; then 0.", pixels());
        let doc = "Variance of the mean, and squared difference from the picture; 0 where they are unknown.";
        let evidence = io.write("evidence", scratch(doc), pixels());
        let _: Out<u32> =
            io.write("still", scratch("Whether nothing moves, the camera included."), Extent::Fixed([1, 1]));
        io.shader(shader!("refine"));
        io.constants(CONSTANTS);
        if shift.is_some() {
            io.define("SHIFT");
        }
        if moves.is_some() {
            io.define("MOVES");
        }
        io.compute("begin", Threads::Groups(1));
        io.dispatch("claim", samples);
        io.dispatch("join", refined);
        io.dispatch("mix_in", refined);
        let fields = [color.into(), samples.into(), id.into(), aim.into()];
        io.per_change(fields.into_iter().chain(moves.map(Into::into)));
        Self { color, samples, id, aim, shift, moves, refined, next, mean, count, asked, evidence }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let frame = cx.frame();
        let [width, height] = frame.size.map(|side| side as usize);
        let (color, samples) = (&cx.read(self.color)[..], &cx.read(self.samples)[..]);
        let (id, aim) = (&cx.read(self.id)[..], &cx.read(self.aim)[..]);
        let (mut refined, mut next) = (cx.write(self.refined), cx.write(self.next));
        let (mut mean, mut count) = (cx.write(self.mean), cx.write(self.count));
        let is_still = |moves| cx.read(moves).iter().all(|motion| *motion == Move::REST);
        if frame.view != frame.previous || !self.moves.is_none_or(is_still) {
            refined
                .par_chunks_mut(width)
                .zip(color.par_chunks(width))
                .for_each(|(to, from)| to.copy_from_slice(from));
            next.copy_from_slice(aim);
            count.fill(0);
            return Ok(());
        }

        // claim: of two samples of a pixel, the last one counts
        let mut asked = cx.write(self.asked);
        for (index, sample) in (1..).zip(samples).filter(|(_, sample)| is_of_its_pixel(frame, sample)) {
            if let Some(asked) = asked.get_mut(sample.pixel as usize) {
                *asked = index;
            }
        }

        // join
        let shift = self.shift.map(|shift| cx.read(shift));
        let tile = TILE as usize;
        let shift = shift.as_ref().map(|shift| (&shift[..], width.div_ceil(tile)));
        let mut evidence = cx.write(self.evidence);
        let rows =
            mean.par_chunks_mut(width).zip(count.par_chunks_mut(width)).zip(asked.par_chunks_mut(width));
        let rows = rows.zip(evidence.par_chunks_mut(width)).zip(color.par_chunks(width)).enumerate();
        rows.for_each(|(y, ((((mean, count), asked), evidence), color))| {
            for x in 0..width {
                if shift.is_some_and(|(shift, columns)| shift[y / tile * columns + x / tile] > 0.0) {
                    count[x] = 0;
                }
                let sample = std::mem::take(&mut asked[x]);
                if sample != 0 {
                    (mean[x], count[x]) = joined(mean[x], count[x], &samples[sample as usize - 1]);
                }
                evidence[x] = weigh(mean[x], count[x], color[x]);
            }
        });

        // mix_in
        let (mean, count, evidence) = (&mean[..], &count[..], &evidence[..]);
        let rows = refined.par_chunks_mut(width).zip(next.par_chunks_mut(width)).enumerate();
        rows.for_each(|(y, (refined, next))| {
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            for x in 0..width {
                let at = y * width + x;
                next[x] = if count[at] >= FIRST && id[at] != NO_POINT {
                    place(at as u32, count[at], frame.seed)
                } else {
                    aim[at]
                };
                refined[x] = color[at];
                if count[at] < FIRST + FEWEST {
                    continue;
                }
                let columns = x.saturating_sub(1)..(x + 2).min(width);
                let around = rows.clone().flat_map(|y| columns.clone().map(move |x| y * width + x));
                let share = share_of_mean(at, count[at] - FIRST, around, evidence, color);
                for channel in 0..3 {
                    refined[x][channel] += share * (mean[at][channel] - color[at][channel]);
                }
            }
        });
        Ok(())
    }

    fn explain(&self, (): &(), site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, site)
    }
}

/// Whether a sample was requested at its pixel as the camera sees it now.
fn is_of_its_pixel(frame: &Frame, sample: &Sample) -> bool {
    if sample.hit == HIT_NONE {
        return false;
    }
    match sample.view {
        VIEW_NOW => true,
        VIEW_LATE => {
            let [x, y, z] = place_in_image(&frame.view, sample.place(), frame.size);
            let Sample { pixel, aim, reuse, view, .. } = *sample;
            let [to_x, to_y] = Request { pixel, aim, reuse, view }.target(frame.size[0]);
            z > 0.0 && (x - to_x).abs() <= NEAR && (y - to_y).abs() <= NEAR
        }
        _ => false,
    }
}

/// A pixel's mean, the sum of squares around it, and the number of its samples, with another one (Welford 1962). What is not
/// spread over the pixel does not join the mean.
fn joined(mean: [f32; 4], count: u32, sample: &Sample) -> ([f32; 4], u32) {
    if !is_spread(sample) {
        return (mean, count.max((count + 1).min(FIRST)));
    }
    let (radiance, number) = (bounded(sample.radiance), count.max(FIRST) - FIRST + 1);
    if number == 1 {
        return ([radiance[0], radiance[1], radiance[2], 0.0], FIRST + 1);
    }
    let [r, g, b, squares] = mean;
    let before = [r, g, b];
    let after =
        [0, 1, 2].map(|channel| before[channel] + (radiance[channel] - before[channel]) / number as f32);
    let [from, to] = [before, after].map(|mean| luminance(radiance) - luminance(mean));
    ([after[0], after[1], after[2], squares + from * to], (FIRST + number).min(MOST))
}

/// The variance of a mean, and its squared difference from the picture; zeros if so few samples do not tell.
fn weigh([r, g, b, squares]: [f32; 4], count: u32, color: [f32; 4]) -> [f32; 2] {
    if count < FIRST + FEWEST {
        return [0.0; 2];
    }
    let (number, others) = ((count - FIRST) as f32, (count - FIRST - 1) as f32);
    let difference = luminance([(r - color[0]).abs(), (g - color[1]).abs(), (b - color[2]).abs()]);
    [squares / (number * others) * (1.0 + DOUBT / others), difference * difference]
}

/// How much of the mean of `number` samples replaces the picture at a pixel: what noise does not explain of their squared difference
/// there, or of the sum of those in the pixels around it and itself, whichever is less.
fn share_of_mean(
    at: usize,
    number: u32,
    around: impl Iterator<Item = usize>,
    evidence: &[[f32; 2]],
    color: &[[f32; 4]],
) -> f32 {
    let shown = |[r, g, b, _]: [f32; 4]| luminance([r, g, b]);
    let (own, mut pixels, mut steps) = (shown(color[at]), 0.0, 0.0);
    let [mut variances, mut differences] = [0.0; 2];
    for there in around {
        let [variance, difference] = evidence[there];
        variances += variance;
        differences += difference;
        let step = shown(color[there]) - own;
        steps += step * step;
        pixels += 1.0;
    }
    let [variance, difference] = evidence[at];
    let missed =
        (MISSED_STEPS * (steps / pixels) + MISSED_LIGHT * own * own) / (number as f32 * number as f32);
    let unexplained = |noise: f32, all: f32| if all > noise { 1.0 - noise / all } else { 0.0 };
    unexplained(variance + missed, difference).min(unexplained(CAUTION * variances, differences))
}

/// Where in a pixel its next sample goes, as [`Request`]'s `aim`, if it has had so many.
fn place(pixel: u32, count: u32, seed: u32) -> u32 {
    let first = pcg(pixel ^ pcg(seed));
    let x = (first & AXIS).wrapping_add(count.wrapping_mul(STEP_X)) & AXIS;
    let y = (first >> 16).wrapping_add(count.wrapping_mul(STEP_Y)) & AXIS;
    y << 16 | x | SPREAD
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::{
        requests::{HIT_BACKGROUND, HIT_SURFACE, PIXEL_CENTER, VIEW_PREDICTED},
        testing::{Random, run_alike, run_both, settings},
    };

    const GREY: [f32; 4] = [0.25, 0.25, 0.25, 1.0];

    /// A picture of one colour, of which every pixel shows a point.
    fn harness(size: [u32; 2], samples: usize) -> Harness<Refine> {
        let mut harness = Harness::new((), &settings(size, samples as u32));
        let count = (size[0] * size[1]) as usize;
        harness.set("color", &vec![GREY; count]);
        harness.set("id", &vec![7u32; count]);
        harness.set("aim", &vec![PIXEL_CENTER; count]);
        harness.set("samples", &vec![Sample::default(); samples]);
        harness.set("moves", &[Move::REST]);
        harness.set("shift", &vec![0.0f32; (size[0].div_ceil(32) * size[1].div_ceil(32)) as usize]);
        harness
    }

    fn sample(pixel: u32, grey: f32) -> Sample {
        Sample { hit: HIT_SURFACE, pixel, radiance: [grey; 3], aim: SPREAD, reuse: 7, ..Sample::default() }
    }

    #[test]
    fn a_pixel_by_hand() {
        // Four samples 1, 1, 1 and 2: their mean is 1.25, and squares add up to 0.75. The mean's variance is 0.75 / 12, times
        // 1 + 2/3 as they are few: 5/48. The picture is 1 darker, so of the pixel's squared difference noise explains that and
        // what they may have missed, 16 / 16 of 0.25²: together 1/6. Of the sum over all pixels around, which is this one alone,
        // it explains twice 5/48. That is more, so 19/24 of the mean replace the picture.
        let mut harness = harness([1, 1], 1);
        for grey in [1.0, 1.0, 1.0] {
            harness.set("samples", &[sample(0, grey)]);
            assert_eq!(run_alike(&mut harness).get::<[f32; 4]>("refined"), [GREY], "too few tell nothing");
        }
        harness.set("samples", &[sample(0, 2.0)]);
        let [r, g, b, a] = run_alike(&mut harness).get::<[f32; 4]>("refined")[0];
        let expected = 0.25 + 19.0 / 24.0;
        assert!(
            [r, g, b].iter().all(|channel| (channel - expected).abs() < 1e-6) && a == 1.0,
            "{r} {expected}"
        );
    }

    #[test]
    fn what_noise_explains_stays() {
        let mut harness = harness([1, 1], 1);
        // Means of 0.5 with deviations of 0.5 are no surprise over a picture of 0.25.
        for grey in [0.0, 1.0, 0.0, 1.0, 0.0, 1.0] {
            harness.set("samples", &[sample(0, grey)]);
            assert_eq!(run_alike(&mut harness).get::<[f32; 4]>("refined"), [GREY]);
        }
    }

    /// A pixel alone may differ much from the picture by chance. So its neighbours have a say.
    #[test]
    fn a_pixel_needs_its_neighbours_consent() {
        let greys = |of_others: [f32; 4]| {
            let mut harness = harness([3, 3], 9);
            let mut refined = Vec::new();
            for (frame, of_other) in of_others.into_iter().enumerate() {
                let own = [0.9, 1.1, 0.9, 1.1][frame];
                let samples: Vec<_> =
                    (0..9).map(|pixel| sample(pixel, if pixel == 4 { own } else { of_other })).collect();
                harness.set("samples", &samples);
                refined = run_alike(&mut harness).get::<[f32; 4]>("refined");
            }
            refined[4][0]
        };
        assert!(greys([0.9, 1.1, 0.9, 1.1]) > 0.85, "all say the same");
        assert!(greys([0.25; 4]) > 0.85, "the others are as shown, exactly");
        assert_eq!(greys([0.0, 4.0, 0.0, 4.0]), GREY[0], "the others are noise");
    }

    /// Four samples of a pixel at the rim of a lamp may all have missed it, and then they have no noise.
    #[test]
    fn few_samples_do_not_tell_what_they_may_have_missed() {
        let refined = |samples: usize| {
            let mut harness = harness([3, 1], 1);
            harness.set("color", &[[0.1f32, 0.1, 0.1, 1.0], [4.0, 4.0, 4.0, 1.0], [20.0, 20.0, 20.0, 1.0]]);
            harness.set("samples", &[sample(1, 0.1)]);
            let mut refined = 0.0;
            for _ in 0..samples {
                refined = run_alike(&mut harness).get::<[f32; 4]>("refined")[1][0];
            }
            refined
        };
        // Steps of 3.9 and 16: their mean square is 90.4. Twice that and 16 times 4² are 436.8: over 4², more than the difference
        // of 3.9², and over 20², little.
        assert_eq!(refined(4), 4.0);
        let many = refined(20);
        assert!((many - (4.0 - 3.9 * (1.0 - 436.8 / 400.0 / 15.21))).abs() < 1e-3, "{many}");
    }

    #[test]
    fn a_moving_camera_shows_the_picture_and_forgets() {
        let mut harness = harness([2, 1], 2);
        for _ in 0..6 {
            harness.set("samples", &[sample(0, 1.0), sample(1, 2.0)]);
            run_alike(&mut harness);
        }
        let out = run_alike(&mut harness);
        assert_eq!(out.get::<u32>("count"), [10, 10]);
        let refined = out.get::<[f32; 4]>("refined");
        assert!((0.95..1.0).contains(&refined[0][0]) && (1.95..2.0).contains(&refined[1][0]), "{refined:?}");
        harness.frame.view.eye[0] += 1.0;
        let out = run_alike(&mut harness);
        assert_eq!(out.get::<u32>("count"), [0, 0]);
        assert_eq!(out.get::<u32>("next"), [PIXEL_CENTER; 2]);
        assert_eq!(out.get::<[f32; 4]>("refined"), [GREY; 2]);
        // At rest again, and the old mean does not come back.
        harness.frame.previous = harness.frame.view;
        assert_eq!(run_alike(&mut harness).get::<[f32; 4]>("refined"), [GREY; 2]);
        assert_eq!(run_alike(&mut harness).get::<u32>("count"), [5, 5]);
    }

    #[test]
    fn while_a_body_moves_the_picture_stays_as_it_is() {
        let mut harness = harness([1, 1], 1);
        harness.set("samples", &[sample(0, 1.0)]);
        let mut counts = |motion: Move| {
            harness.set("moves", &[Move::REST, motion]);
            run_alike(&mut harness).get::<u32>("count")[0]
        };
        let moved =
            Move::of(&epigraph_scenes::Pose { translation: glam::Vec3::X, ..epigraph_scenes::Pose::REST });
        assert_eq!([Move::REST, Move::REST, moved, Move::REST].map(&mut counts), [4, 5, 0, 4]);
    }

    #[test]
    fn where_the_light_has_changed_means_begin_anew() {
        let mut harness = harness([40, 40], 2);
        let far = 39 * 40 + 39;
        for _ in 0..6 {
            harness.set("samples", &[sample(0, 1.0), sample(far, 1.0)]);
            run_alike(&mut harness);
        }
        harness.set("shift", &[0.0f32, 0.0, 0.0, 0.3]);
        let out = run_alike(&mut harness);
        let [first, last] = [0, far as usize].map(|at| out.get::<[f32; 4]>("refined")[at][0]);
        assert!(first > 0.95 && last == 0.25, "{first} {last}");
        assert_eq!(out.get::<u32>("count")[far as usize], FIRST + 1);
    }

    #[test]
    fn the_first_samples_go_where_the_cloud_needs_them_and_the_others_all_over_the_pixel() {
        let mut harness = harness([2, 1], 2);
        harness.set("aim", &[0x1234_0000u32, 0x5678_0000]);
        harness.set("id", &[3, NO_POINT]);
        let mut aims = Vec::new();
        for frame in 0..3 + 256 {
            // The answer to the last request.
            let aim = aims.last().copied().unwrap_or(0x1234_0000);
            harness.set("samples", &[Sample { aim, ..sample(0, 1.0) }, Sample { aim: 0, ..sample(1, 1.0) }]);
            let out = run_alike(&mut harness);
            let next = out.get::<u32>("next");
            assert_eq!(next[1], 0x5678_0000, "a pixel without a point needs one first");
            if frame < 2 {
                assert_eq!(next[0], 0x1234_0000);
            } else {
                assert_eq!(next[0] & SPREAD, SPREAD);
                aims.push(next[0]);
            }
            assert_eq!(out.get::<u32>("count"), [frame + 1, FIRST.min(frame + 1)]);
        }
        // 256 places in 8 x 8 squares: 4 each, or nearly.
        let mut squares = [0; 64];
        aims[..256].iter().for_each(|aim| squares[(aim >> 29 << 3 | aim >> 13 & 7) as usize] += 1);
        assert!(squares.iter().all(|count| (2..=6).contains(count)), "{squares:?}");
    }

    #[test]
    fn only_samples_of_this_view_count() {
        let mut harness = harness([4, 4], 1);
        let view = &mut harness.frame.view;
        (view.eye, view.tan_x, view.tan_y) = ([10.0, 0.0, 0.0], 1.0, 1.0);
        harness.frame.previous = harness.frame.view;
        // Two metres away, a pixel is 1 m wide; this is the upper left quarter of pixel 5.
        let aim = 0x4000_4000 | SPREAD;
        let mut count = |changes: &dyn Fn(&mut Sample)| {
            let mut sample = Sample { position: [9.25, 0.75, -2.0], aim, ..sample(5, 1.0) };
            changes(&mut sample);
            harness.reset();
            harness.set("samples", &[sample]);
            run_alike(&mut harness).get::<u32>("count")[5]
        };
        let late = |sample: &mut Sample| sample.view = VIEW_LATE;
        assert_eq!(count(&|_| ()), FIRST + 1);
        assert_eq!(count(&late), FIRST + 1);
        assert_eq!(count(&|sample| sample.position = [0.0; 3]), FIRST + 1, "asked for in this view");
        assert_eq!(count(&|sample| (late(sample), sample.position[0] = 9.35).0), 0, "beside");
        assert_eq!(count(&|sample| (late(sample), sample.position[1] = 0.65).0), 0, "below");
        assert_eq!(count(&|sample| (late(sample), sample.position = [10.75, -0.75, 2.0]).0), 0, "behind");
        assert_eq!(count(&|sample| sample.view = VIEW_PREDICTED), 0);
        assert_eq!(count(&|sample| sample.hit = HIT_NONE), 0);
        assert_eq!(count(&|sample| sample.pixel = 16), 0);
        let far = |sample: &mut Sample| {
            (sample.hit, sample.position) = (HIT_BACKGROUND, [-0.375, 0.375, -1.0]);
            late(sample);
        };
        assert_eq!(count(&far), FIRST + 1, "directions do not depend on the eye");
    }

    #[test]
    fn of_two_samples_of_a_pixel_the_last_one_counts() {
        let mut harness = harness([2, 1], 3);
        harness.set("samples", &[sample(1, 5.0), sample(0, 2.0), sample(1, 3.0)]);
        let out = run_alike(&mut harness);
        assert_eq!(out.get::<[f32; 4]>("mean"), [[2.0, 2.0, 2.0, 0.0], [3.0, 3.0, 3.0, 0.0]]);
        assert_eq!(out.get::<u32>("count"), [FIRST + 1; 2]);
    }

    #[test]
    fn invalid_radiance_does_no_harm() {
        let mut harness = harness([1, 1], 1);
        for grey in [f32::NAN, f32::INFINITY, -1.0, 1.0, f32::MAX] {
            harness.set("samples", &[sample(0, grey)]);
            let both = run_both(&mut harness);
            for out in [&both.cpu, &both.gpu] {
                assert!(out.get::<[f32; 4]>("refined")[0].iter().all(|channel| channel.is_finite()));
            }
        }
    }

    /// The rule in double precision, from all samples that a pixel has had.
    fn rule([width, height]: [usize; 2], color: &[[f32; 4]], samples: &[Vec<[f32; 3]>]) -> Vec<[f64; 3]> {
        let luminance = |of: [f64; 3]| 0.2126 * of[0] + 0.7152 * of[1] + 0.0722 * of[2];
        let means: Vec<[f64; 3]> = samples
            .iter()
            .map(|samples| {
                let sum = |channel: usize| samples.iter().map(|of| f64::from(of[channel])).sum::<f64>();
                [0, 1, 2].map(|channel| sum(channel) / samples.len().max(1) as f64)
            })
            .collect();
        let evidence = |at: usize| {
            let number = samples[at].len() as f64;
            if number < 4.0 {
                return [0.0; 2];
            }
            let mean = luminance(means[at]);
            let squares: f64 =
                samples[at].iter().map(|of| (luminance(of.map(f64::from)) - mean).powi(2)).sum();
            let apart = [0, 1, 2].map(|channel| (means[at][channel] - f64::from(color[at][channel])).abs());
            [squares / number / (number - 1.0) * (1.0 + 2.0 / (number - 1.0)), luminance(apart).powi(2)]
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels
            .map(|(x, y)| {
                let at = y * width + x;
                let own = color[at].map(f64::from);
                if samples[at].len() < 4 {
                    return [own[0], own[1], own[2]];
                }
                let (mut variances, mut differences, mut steps, mut pixels) = (0.0, 0.0, 0.0, 0.0);
                let shown = |at: usize| luminance([0, 1, 2].map(|channel| f64::from(color[at][channel])));
                for y in y.saturating_sub(1)..height.min(y + 2) {
                    for x in x.saturating_sub(1)..width.min(x + 2) {
                        let [variance, difference] = evidence(y * width + x);
                        (variances, differences) = (variances + variance, differences + difference);
                        steps += (shown(y * width + x) - shown(at)).powi(2);
                        pixels += 1.0;
                    }
                }
                let [mut variance, difference] = evidence(at);
                let missed = 2.0 * steps / pixels + 16.0 * shown(at).powi(2);
                variance += missed / (samples[at].len() as f64).powi(2);
                let of = |noise: f64, all: f64| if all > noise { 1.0 - noise / all } else { 0.0 };
                let share = of(variance, difference).min(of(2.0 * variances, differences));
                [0, 1, 2].map(|channel| own[channel] + share * (means[at][channel] - own[channel]))
            })
            .collect()
    }

    #[test]
    fn both_sides_follow_the_rule() {
        let mut random = Random(31);
        for size in [[37, 21], [1, 1], [1, 40], [64, 2]] {
            let count = size[0] * size[1];
            let mut harness = harness(size.map(|side| side as u32), count);
            let color: Vec<_> = (0..count).map(|_| [0; 4].map(|_| random.between(0.0, 1.0))).collect();
            harness.set("color", &color);
            let noise: Vec<f32> = (0..count).map(|_| random.between(0.0, 0.5)).collect();
            let mut had = vec![Vec::new(); count];
            for frame in 0..20 {
                let mut samples = vec![Sample::default(); count];
                for pixel in 0..count {
                    if random.below(3) > 0 {
                        let grey = 0.5 + noise[pixel] * random.between(-1.0, 1.0);
                        let radiance = [grey, grey * random.between(0.8, 1.0), 0.5 * grey];
                        had[pixel].push(radiance);
                        samples[pixel] = Sample { radiance, ..sample(pixel as u32, 0.0) };
                    }
                }
                harness.set("samples", &samples);
                let both = run_both(&mut harness);
                let expected = rule(size, &color, &had);
                for out in [&both.cpu, &both.gpu] {
                    for (got, expected) in out.get::<[f32; 4]>("refined").iter().zip(&expected) {
                        for channel in 0..3 {
                            let error = (f64::from(got[channel]) - expected[channel]).abs();
                            assert!(error < 2e-5, "frame {frame} of {size:?}: {got:?} {expected:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_mean_that_counts_many_samples_stays_a_number() {
        assert_eq!(joined([1.0, 1.0, 1.0, 3.0], MOST, &sample(0, 2.0)).1, MOST);
        let ([mean, ..], _) = joined([1.0, 1.0, 1.0, 3.0], MOST, &sample(0, 2.0));
        assert!(mean > 1.0 && mean < 1.0 + 1e-5, "{mean}");
    }
}
