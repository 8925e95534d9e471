//! What is known of the radiance of a point that was sampled several times: the mean of its samples, and how uncertain
//! that is. Mirrored by `shaders/shared/estimate.wgsl`.
//!
//! It is a Kalman filter of a radiance that rests (`algorithms.md` section 12.1): a sample joins the mean with the weight
//! that both variances give it, and what may have changed the radiance makes the mean more uncertain, so that the next
//! samples count more.

use fearless_simd::{Simd, f32x8, prelude::*};
use glam::Vec3;

use super::{
    cloud::{MAX_RADIANCE, bounded},
    color::{luminance, luminances, tone_mapped_luma},
    octahedral::decode_oct16,
    requests::{Sample, UNKNOWN},
    view::dot,
};

epigraph_core::constants! {
    /// The most samples that a mean counts for while the view rests. With more, f32 would ignore a further one.
    pub const MOST_AT_REST: f32 = 1048576.0;
    /// Noise hardly explains a difference of more than this many standard deviations, and not twice in a row.
    const SURPRISE: f32 = 3.0;
    /// Nor one of so many deviations even once.
    const SHOCK: f32 = 10.0;
    /// The distance of a point to the plane of a sample up to which both lie on the same surface, in pixels.
    const FLATNESS: f32 = 0.25;
    /// The distance of a point to the line of sight of a late sample up to which it may be what the sample was to renew, in
    /// pixels: what one pixel shows is closer together.
    const NEARNESS: f32 = 1.5;
    /// A mean that counts for fewer samples does not count at all.
    const LEAST: f32 = 0.5;
    /// Luminance that a display hardly tells from black.
    const DARK: f32 = 0.01;
    /// The count of a mean that is entirely in doubt.
    const NOTHING: f32 = 1e-3;
}

/// The radiance of a point, as its samples tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Mean linear radiance.
    pub mean: [f32; 3],
    /// Variance of the luminance of one sample; [`UNKNOWN`] if there was one only, of one light path.
    pub variance: f32,
    /// The number of samples that the mean counts for.
    pub count: f32,
    /// Unit direction to the eye that saw the last one.
    pub towards_eye: [f32; 3],
    /// The share by which the radiance may change per radian of this direction, as [`Sample::sharpness`].
    pub sharpness: f32,
    /// Whether the last one was a surprise: noise hardly explains its difference from the mean.
    pub is_suspect: bool,
}

impl Estimate {
    /// From the two values that the cloud stores of a point.
    pub fn load([r, g, b, variance_of_mean]: [f32; 4], [x, y, z, count]: [f32; 4]) -> Self {
        let (is_suspect, count) = (count < 0.0, count.abs());
        let variance = if variance_of_mean < 0.0 { UNKNOWN } else { variance_of_mean * count };
        let (towards_eye, sharpness) = direction([x, y, z]);
        Self { mean: [r, g, b], variance, count, towards_eye, sharpness, is_suspect }
    }

    /// What the cloud stores: red, green, blue and the variance of their luminance; the direction to the eye, of length 1 +
    /// sharpness, and the count, negative after a surprise.
    pub fn store(&self) -> [[f32; 4]; 2] {
        let variance_of_mean = if self.variance < 0.0 { UNKNOWN } else { self.variance / self.count };
        let ([r, g, b], [x, y, z]) = (self.mean, self.towards_eye.map(|axis| axis * (1.0 + self.sharpness)));
        [[r, g, b, variance_of_mean], [x, y, z, if self.is_suspect { -self.count } else { self.count }]]
    }

    /// That of a single sample.
    pub fn of(sample: &Sample, eye: [f32; 3]) -> Self {
        Self {
            mean: bounded(sample.radiance),
            variance: known_variance(sample),
            count: 1.0,
            towards_eye: towards_eye(sample.position, eye),
            // Whatever a source says of its samples, this is a number.
            sharpness: bounded([sample.sharpness; 3])[0],
            is_suspect: false,
        }
    }

    /// After something that may have changed the radiance by this share of itself: the mean counts for no more than `most`
    /// samples, and for as many as would leave it as uncertain as it is now.
    pub fn doubt(self, change: f32, most: f32) -> Self {
        let change = change * luminance(self.mean);
        let count = self.count.min(most);
        if change == 0.0 || self.variance < 0.0 {
            return Self { count, ..self };
        }
        let uncertain = self.variance + count * change * change;
        Self {
            count: if uncertain > 0.0 { (count * self.variance / uncertain).max(NOTHING) } else { NOTHING },
            ..self
        }
    }

    /// Whether a single sample tells that the colour has changed: it differs from the mean by more than `threshold` in
    /// tone-mapped luma, and is a surprise.
    pub fn differs(&self, single: &Self, threshold: f32) -> bool {
        let (before, after) = (luminance(self.mean), luminance(single.mean));
        let is_seen = (tone_mapped_luma(after) - tone_mapped_luma(before)).abs() > threshold;
        is_seen && self.surprise(single) > SURPRISE * SURPRISE
    }

    /// The difference of luminance of a single sample from the mean, and its variance if the radiance rests; 0 if that is
    /// not known.
    pub fn difference(&self, single: &Self) -> [f32; 2] {
        if self.variance < 0.0 {
            return [0.0; 2];
        }
        let difference = luminance(single.mean) - luminance(self.mean);
        [difference, self.variance / self.count + self.noise(single)]
    }

    /// The squared difference of a single sample from the mean, in variances; 0 if none is known.
    fn surprise(&self, single: &Self) -> f32 {
        let [difference, variance] = self.difference(single);
        difference * difference / variance.max(f32::MIN_POSITIVE)
    }

    /// The variance of a single sample. A few light paths may look more alike than they are.
    fn noise(&self, single: &Self) -> f32 {
        self.variance.max(single.variance)
    }

    /// The number of samples that the mean counts for when a single one joins it, and whether that one was a surprise.
    fn trusted(&self, single: &Self) -> (f32, bool) {
        let surprise = self.surprise(single);
        let is_suspect = surprise > SURPRISE * SURPRISE;
        let difference = luminance(single.mean) - luminance(self.mean);
        // A single light path that carries much more than others is rare, but not wrong.
        let is_lucky = single.variance < 0.0 && difference > 0.0;
        let is_shock = surprise > SHOCK * SHOCK && !is_lucky;
        if !(is_shock || is_suspect && self.is_suspect) {
            return (self.count, is_suspect);
        }
        // As many as would explain the difference: it is SURPRISE deviations.
        let variance = difference * difference / (SURPRISE * SURPRISE) - self.noise(single);
        let trusted = (self.variance / variance).min(self.count);
        (if is_lucky { trusted.max(1.0) } else { trusted }, is_suspect)
    }

    /// After one more sample, given as the estimate of that sample alone.
    pub fn join(self, single: Self) -> Self {
        let (before, is_suspect) = self.trusted(&single);
        if before < LEAST {
            return single;
        }
        let count = before + 1.0;
        let channel = |of: usize| self.mean[of] + (single.mean[of] - self.mean[of]) / count;
        // The expected square of the difference is the variance of one sample times count / before.
        let difference = luminance(single.mean) - luminance(self.mean);
        let innovation = difference * difference * before / count;
        let own = if single.variance < 0.0 { innovation } else { single.variance };
        let variance = if self.variance < 0.0 { own } else { self.variance + (own - self.variance) / count };
        Self { mean: [channel(0), channel(1), channel(2)], variance, count, is_suspect, ..single }
    }
}

/// The variance that a sample states of itself, bounded; [`UNKNOWN`] if none, or if it is not a number.
fn known_variance(sample: &Sample) -> f32 {
    let bits = sample.variance.to_bits();
    if bits > f32::INFINITY.to_bits() {
        UNKNOWN
    } else {
        f32::from_bits(bits.min((MAX_RADIANCE * MAX_RADIANCE).to_bits()))
    }
}

/// The variance of eight luminances as a display shows them, roughly: relative to the luminance.
#[inline(always)]
pub fn shown_variance<S: Simd>(luminance: f32x8<S>, variance: f32x8<S>) -> f32x8<S> {
    variance / (luminance + DARK)
}

/// The shown variance of eight points, of which these are stored, for an eye in unit directions. All vectors are given by
/// axis or channel.
#[inline(always)]
pub fn shown_variance_of<S: Simd>(
    simd: S,
    [r, g, b, variance_of_mean]: [f32x8<S>; 4],
    [x, y, z, _]: [f32x8<S>; 4],
    towards_eye: [f32x8<S>; 3],
) -> f32x8<S> {
    let zero = f32x8::splat(simd, 0.0);
    let luminance = luminances(simd, [r, g, b]);
    // A single light path is as uncertain as it is bright.
    let of_mean = variance_of_mean.simd_lt(zero).select(luminance * luminance, variance_of_mean);
    // As [`direction`] and [`angle`].
    let length = (x * x + y * y + z * z).sqrt();
    let sharpness = length - 1.0;
    let [x, y, z] = [x / length - towards_eye[0], y / length - towards_eye[1], z / length - towards_eye[2]];
    let angle = (x * x + y * y + z * z).sqrt();
    let change = sharpness.simd_gt(zero).select(luminance * sharpness * angle, zero);
    shown_variance(luminance, of_mean + change * change)
}

/// The unit direction of a vector and its length - 1; a point at the eye has neither.
fn direction(vector: [f32; 3]) -> ([f32; 3], f32) {
    let length = dot(vector, vector).sqrt();
    if length > 0.0 { (vector.map(|axis| axis / length), (length - 1.0).max(0.0)) } else { ([0.0; 3], 0.0) }
}

/// The unit direction from a point to the eye.
fn towards_eye(position: [f32; 3], eye: [f32; 3]) -> [f32; 3] {
    let towards = [eye[0] - position[0], eye[1] - position[1], eye[2] - position[2]];
    let length = dot(towards, towards).sqrt();
    if length > 0.0 { towards.map(|axis| axis / length) } else { [0.0; 3] }
}

/// Whether a point lies on the surface on which a sample was taken, and near it: within `FLATNESS` pixels of the
/// sample's plane. `pixel` is the width of a pixel at a distance of 1.
pub fn on_surface(point: [f32; 3], sample: &Sample, eye: [f32; 3], pixel: f32) -> bool {
    let minus = |a: [f32; 3], b: [f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let aside = dot(minus(point, sample.position), decode_oct16(sample.normal).normalize_or_zero().into());
    let away = minus(sample.position, eye);
    aside.abs() <= FLATNESS * pixel * dot(away, away).sqrt()
}

/// Whether the eye sees a point and a sample at the same place of the image, or within `NEARNESS` pixels. `pixel` is the
/// width of a pixel at a distance of 1.
pub fn in_line(point: [f32; 3], sample: [f32; 3], eye: [f32; 3], pixel: f32) -> bool {
    let [point, sample, eye] = [point, sample, eye].map(Vec3::from);
    let away = sample - eye;
    // The cross product is as long as the point's distance from the line of sight, times the distance to the eye.
    (point - sample).cross(away).length() <= NEARNESS * pixel * away.length_squared()
}

/// How far apart two unit directions are, radians; a little less for large angles.
pub fn angle(a: [f32; 3], b: [f32; 3]) -> f32 {
    let between = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    dot(between, between).sqrt()
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;
    use crate::shared::{
        lanes::{LANES, load_transposed},
        octahedral::{NO_NORMAL, encode_oct16},
        testing::Random,
    };

    const EYE: [f32; 3] = [0.0, 0.0, 2.0];

    fn sample(grey: f32, variance: f32) -> Sample {
        Sample { radiance: [grey; 3], variance, normal: NO_NORMAL, ..Sample::default() }
    }

    fn single(grey: f32, variance: f32) -> Estimate {
        Estimate::of(&sample(grey, variance), EYE)
    }

    fn close(a: f32, b: f32) {
        assert!((a - b).abs() <= 2e-6 * b.abs(), "{a} {b}");
    }

    #[test]
    fn equal_samples_have_the_mean_of_all_and_a_variance_that_falls() {
        let grey = [1.0, 2.0, 3.0, 2.0, 2.0];
        let mut estimate = single(grey[0], 0.5);
        grey[1..].iter().for_each(|&grey| estimate = estimate.join(single(grey, 0.5)));
        close(estimate.mean[1], 2.0);
        close(estimate.variance, 0.5);
        assert_eq!((estimate.count, estimate.towards_eye), (5.0, [0.0, 0.0, 1.0]));
        let [mean, record] = estimate.store();
        close(mean[3], 0.1);
        assert_eq!(record, [0.0, 0.0, 1.0, 5.0]);
        let loaded = Estimate::load(mean, record);
        close(loaded.variance, estimate.variance);
    }

    #[test]
    fn single_light_paths_tell_their_variance_by_their_differences() {
        let mut random = Random(3);
        let mut mean = 0.0;
        for _ in 0..200 {
            let mut estimate = single(random.between(0.0, 2.0), UNKNOWN);
            assert_eq!(estimate.store()[0][3], UNKNOWN);
            for _ in 0..20 {
                estimate = estimate.join(single(random.between(0.0, 2.0), UNKNOWN));
            }
            mean += estimate.variance / 200.0;
        }
        // 1/3 is the variance of numbers between 0 and 2.
        assert!((mean - 1.0 / 3.0).abs() < 0.02, "{mean}");
    }

    #[test]
    fn a_change_makes_the_mean_less_certain_and_a_known_one_replaces_it() {
        // Variance 0.04 of 16 samples of 2; a change by a tenth adds 0.04: 16 * 0.04 / (0.04 + 16 * 0.04) = 16 / 17.
        let before = Estimate { count: 16.0, ..single(2.0, 0.04) };
        close(before.doubt(0.1, 64.0).count, 16.0 / 17.0);
        assert_eq!(before.doubt(0.0, 8.0).count, 8.0);
        // Exact colours are worth nothing once they may have changed.
        let exact = Estimate { count: 16.0, ..single(2.0, 0.0) };
        assert!(exact.doubt(1e-3, 64.0).count < LEAST);
        assert_eq!(exact.doubt(1e-3, 64.0).join(single(3.0, 0.0)), single(3.0, 0.0));
        // Whatever happens, what is stored is a number.
        for variance in [0.0, UNKNOWN, 1e-38, 1e9] {
            for change in [0.0, 1e-30, 1.0, 1e10] {
                let doubted = Estimate { count: 5.0, ..single(2.0, variance) }.doubt(change, 64.0);
                assert!(
                    doubted.store().as_flattened().iter().all(|number| number.is_finite()),
                    "{doubted:?}"
                );
            }
        }
    }

    #[test]
    fn a_difference_that_noise_does_not_explain_replaces_the_mean() {
        let before = Estimate { count: 64.0, ..single(2.0, 0.01) };
        // Within three deviations of 0.1: one of 65 samples.
        close(before.join(single(1.8, 0.01)).mean[0], 2.0 - 0.2 / 65.0);
        // The light went out.
        assert_eq!(before.join(single(0.0, 0.0)), single(0.0, 0.0));
        assert!(before.differs(&single(0.0, 0.0), 0.1) && !before.differs(&single(1.8, 0.01), 0.0));
        // A single light path may be much brighter than all others, but not darker than nothing: only the second of two
        // counts, and not for all.
        let path = before.join(single(100.0, UNKNOWN));
        close(path.mean[0], 2.0 + 98.0 / 65.0);
        assert!(path.is_suspect && Estimate::load(path.store()[0], path.store()[1]).is_suspect);
        let again = Estimate { variance: 0.01, ..path };
        close(again.join(single(100.0, UNKNOWN)).mean[0], (100.0 + path.mean[0]) / 2.0);
        close(before.join(single(100.0, 0.0)).mean[0], 100.0);
        assert_eq!(before.join(single(0.0, UNKNOWN)).mean, [0.0; 3]);
        // Four deviations are a surprise; the next decides.
        let once = before.join(single(1.6, 0.01));
        close(once.mean[0], 2.0 - 0.4 / 65.0);
        assert!(once.is_suspect && !once.join(single(2.0, 0.01)).is_suspect);
        assert!(once.join(single(1.6, 0.01)).mean[0] < 1.85);
        // One that knows that it is noisy is explained.
        close(before.join(single(100.0, 1e4)).mean[0], 2.0 + 98.0 / 65.0);
        // The threshold is for the eye, and does not keep clean colours from following.
        let clean = Estimate { variance: 1e-6, ..before };
        assert!(!clean.differs(&single(2.1, 0.0), 0.2));
        close(clean.join(single(2.1, 0.0)).mean[0], 2.1);
    }

    #[test]
    fn samples_that_are_no_numbers_are_bounded() {
        for wrong in [f32::NAN, f32::INFINITY, -3.0, f32::MAX] {
            let estimate = single(1.0, 0.5).join(Estimate::of(&sample(wrong, wrong), EYE));
            assert!(estimate.store().as_flattened().iter().all(|number| number.is_finite()), "{estimate:?}");
            assert!(estimate.mean.iter().all(|&channel| (0.0..=MAX_RADIANCE).contains(&channel)));
        }
    }

    #[test]
    fn a_surface_is_flat_to_a_quarter_of_a_pixel() {
        let on_floor = Sample { normal: encode_oct16(Vec3::Z), ..sample(1.0, 0.0) };
        // Two metres away, a pixel of 0.01 is 0.02 wide.
        assert!(on_surface([7.0, 3.0, 0.0049], &on_floor, EYE, 0.01));
        assert!(!on_surface([0.0, 0.0, 0.0051], &on_floor, EYE, 0.01));
        assert!(!on_surface([0.0, 0.0, -0.0051], &on_floor, EYE, 0.01));
        assert!(
            on_surface([0.0, 0.0, 1.0], &sample(1.0, 0.0), EYE, 0.01),
            "without a normal, nothing is known"
        );
        close(angle([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), 2f32.sqrt());
    }

    #[test]
    fn the_cloud_keeps_how_much_a_colour_depends_on_direction() {
        for sharpness in [0.0, 0.25, 500.0] {
            let stored = Estimate::of(&Sample { sharpness, ..sample(1.0, 0.5) }, EYE).store();
            assert_eq!(stored[1], [0.0, 0.0, 1.0 + sharpness, 1.0]);
            let loaded = Estimate::load(stored[0], stored[1]);
            assert_eq!((loaded.towards_eye, loaded.sharpness), ([0.0, 0.0, 1.0], sharpness));
        }
        // A point at the eye has no direction, and so nothing to depend on.
        let at_eye = Estimate::of(&Sample { sharpness: 3.0, ..sample(1.0, 0.5) }, [0.0; 3]);
        let [mean, record] = at_eye.store();
        assert_eq!(record, [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(Estimate::load(mean, record).sharpness, 0.0);
        let wrong = Estimate::of(&Sample { sharpness: f32::NAN, ..sample(1.0, 0.5) }, EYE);
        assert_eq!(wrong.sharpness, 0.0);
    }

    #[test]
    fn eight_points_have_the_shown_variance_of_each() {
        let shown = |mean: [f32; 4], record: [f32; 4], towards_eye: [f32; 3]| {
            let luminance = luminance([mean[0], mean[1], mean[2]]);
            let of_mean = if mean[3] < 0.0 { luminance * luminance } else { mean[3] };
            let (before, sharpness) = direction([record[0], record[1], record[2]]);
            let change =
                if sharpness > 0.0 { luminance * sharpness * angle(before, towards_eye) } else { 0.0 };
            (of_mean + change * change) / (luminance + DARK)
        };
        let mut random = Random(31);
        for round in 0..100 {
            // The first is at the eye, the second black, the third a single path; every other point is matte.
            let means: [[f32; 4]; LANES] = std::array::from_fn(|lane| match lane {
                1 => [0.0; 4],
                _ => {
                    let [r, g, b] = [0; 3].map(|_| random.between(0.0, 4.0));
                    [r, g, b, if lane == 2 { UNKNOWN } else { random.between(0.0, 1.0) }]
                }
            });
            let mut unit = || Vec3::from([0; 3].map(|_| random.between(-1.0, 1.0))).normalize_or(Vec3::X);
            let eyes: [[f32; 4]; LANES] = std::array::from_fn(|_| unit().extend(0.0).into());
            let records: [[f32; 4]; LANES] = std::array::from_fn(|lane| match lane {
                0 => [0.0; 4],
                _ => (unit() * (1.0 + (lane % 2 * round) as f32)).extend(1.0).into(),
            });
            let expected: [f32; LANES] = std::array::from_fn(|lane| {
                let [x, y, z, _] = eyes[lane];
                shown(means[lane], records[lane], [x, y, z])
            });
            for level in [Level::new(), Level::baseline()] {
                let got = dispatch!(level, simd => {
                    let [x, y, z, _] = load_transposed(simd, &eyes);
                    let (means, records) = (load_transposed(simd, &means), load_transposed(simd, &records));
                    shown_variance_of(simd, means, records, [x, y, z]).to_array()
                });
                assert_eq!(got, expected, "{level:?}");
            }
        }
    }
}
