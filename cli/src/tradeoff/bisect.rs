//! The search for the number of samples at which a noisy figure reaches a target.
//!
//! The figure is measured several times, with another seed each, at some numbers of samples. A number counts as too
//! few (or enough) only if a t-test says so; between such numbers the search bisects. Where noise does not let it
//! decide, the answer is an interval. The figure must rise or fall with the samples.

/// A value of the normal distribution exceeds this one with a chance of 0.0005: the doubt with which too few samples
/// are taken for enough, or the other way round.
const NORMAL_QUANTILE: f64 = 3.290_527;

/// The search ends where the ends of an interval differ by less than this share: 0.5%.
const PRECISION: f64 = 1.005;

/// What is searched.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The figure to reach.
    pub value: f64,
    /// Whether the figure falls when there are more samples.
    pub falls: bool,
    /// Whether ratios of the figure count, not differences. Its noise is then as large a share everywhere.
    pub ratios: bool,
    /// The fewest and the most samples.
    pub range: [u32; 2],
}

/// The number of samples at which the figure reaches its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Most likely at `samples`, and hardly ever outside of the interval.
    Within {
        /// By a line through the figures around the target, over the logarithm of the samples.
        samples: f64,
        /// The fewest and the most samples at which it may be.
        interval: [u32; 2],
    },
    /// The fewest samples of the range are enough.
    Fewer,
    /// The most samples of the range are too few.
    More,
}

/// What was measured at a number of samples: distances from the target, positive where samples are too few.
struct Point {
    samples: u32,
    values: Vec<f64>,
}

impl Point {
    fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.values.len() as f64
    }

    /// The sum of squared deviations from the mean.
    fn squares(&self) -> f64 {
        let mean = self.mean();
        self.values.iter().map(|value| (value - mean).powi(2)).sum()
    }
}

/// Searches. `measure` gives the figure at a number of samples, once for each repetition; it is called once for each
/// number.
///
/// # Errors
/// Those of `measure`.
pub fn search<E>(target: &Target, mut measure: impl FnMut(u32) -> Result<Vec<f64>, E>) -> Result<Answer, E> {
    let mut points: Vec<Point> = Vec::new();
    let mut at = |samples: u32, points: &mut Vec<Point>| -> Result<(), E> {
        let values = measure(samples)?.into_iter().map(|figure| target.distance(figure)).collect();
        points.push(Point { samples, values });
        points.sort_by_key(|point| point.samples);
        Ok(())
    };
    let [fewest, most] = target.range;
    at(fewest, &mut points)?;
    if most > fewest {
        at(most, &mut points)?;
    }
    // The next number is in the middle of the wider of two gaps: between too few and undecided, undecided and enough.
    // As long as all are decided, both are one.
    while let Some(next) = next(&points) {
        at(next, &mut points)?;
    }
    Ok(answer(&points))
}

impl Target {
    fn distance(&self, figure: f64) -> f64 {
        let distance = if self.ratios { (figure / self.value).ln() } else { figure - self.value };
        if self.falls { distance } else { -distance }
    }
}

/// For each point, whether its samples are surely too few (`Some(true)`) or enough (`Some(false)`).
fn sides(points: &[Point]) -> Vec<Option<bool>> {
    let freedom: usize = points.iter().map(|point| point.values.len().saturating_sub(1)).sum();
    // The noise is about the same at all numbers of samples, so that all points tell about it.
    let variance = points.iter().map(Point::squares).sum::<f64>() / freedom.max(1) as f64;
    let side = |point: &Point| {
        let bound = quantile(freedom) * (variance / point.values.len() as f64).sqrt();
        let mean = point.mean();
        (mean.abs() > bound).then_some(mean > 0.0)
    };
    points.iter().map(side).collect()
}

/// The indices of the last point up to which all are surely too few, and of the first one from which all are surely
/// enough.
fn bounds(points: &[Point]) -> [Option<usize>; 2] {
    let sides = sides(points);
    let few = sides.iter().take_while(|side| **side == Some(true)).count();
    let enough = sides.iter().rev().take_while(|side| **side == Some(false)).count();
    [few.checked_sub(1), (enough > 0).then(|| points.len() - enough)]
}

/// The number of samples to measure next, or `None` at the end.
fn next(points: &[Point]) -> Option<u32> {
    let last = points.len() - 1;
    let [few, enough] = bounds(points);
    // An end of the range that is on the other side answers the question.
    if enough == Some(0) || few == Some(last) {
        return None;
    }
    let lower = few.map(|few| [few, few + 1]);
    let upper = enough.map(|enough| [enough - 1, enough]);
    let gaps = [lower, upper].into_iter().flatten().map(|gap| gap.map(|index| points[index].samples));
    let middle = |[a, b]: [u32; 2]| (f64::from(a) * f64::from(b)).sqrt().round() as u32;
    let open = gaps.filter(|[a, b]| {
        f64::from(*b) > PRECISION * f64::from(*a) && middle([*a, *b]) != *a && middle([*a, *b]) != *b
    });
    open.max_by(|[a, b], [c, d]| (f64::from(*b) / f64::from(*a)).total_cmp(&(f64::from(*d) / f64::from(*c))))
        .map(middle)
}

fn answer(points: &[Point]) -> Answer {
    let last = points.len() - 1;
    let [few, enough] = bounds(points);
    if enough == Some(0) {
        return Answer::Fewer;
    }
    if few == Some(last) {
        return Answer::More;
    }
    let (low, high) = (few.unwrap_or(0), enough.unwrap_or(last));
    let interval = [points[low].samples, points[high].samples];
    // A line through the points of the interval and the next ones.
    let around = &points[low.saturating_sub(1)..(high + 2).min(points.len())];
    let samples = crossing(around).clamp(f64::from(interval[0]), f64::from(interval[1]));
    Answer::Within { samples, interval }
}

/// Where the line of least squares through the means, over the logarithm of the samples, crosses zero.
fn crossing(points: &[Point]) -> f64 {
    let logs: Vec<[f64; 2]> =
        points.iter().map(|point| [f64::from(point.samples).ln(), point.mean()]).collect();
    let mean = |lane: usize| logs.iter().map(|log| log[lane]).sum::<f64>() / logs.len() as f64;
    let [x, y] = [mean(0), mean(1)];
    let spread: f64 = logs.iter().map(|log| (log[0] - x).powi(2)).sum();
    let slope = logs.iter().map(|log| (log[0] - x) * (log[1] - y)).sum::<f64>() / spread;
    if slope < 0.0 { (x - y / slope).exp() } else { x.exp() }
}

/// The quantile of Student's distribution that [`NORMAL_QUANTILE`] is of the normal one, by the expansion in
/// Abramowitz and Stegun, 26.7.5: 1% too low at 8 degrees of freedom, less with more.
fn quantile(freedom: usize) -> f64 {
    let (x, n) = (NORMAL_QUANTILE, freedom.max(1) as f64);
    let terms = [
        (x.powi(3) + x) / 4.0,
        (5.0 * x.powi(5) + 16.0 * x.powi(3) + 3.0 * x) / 96.0,
        (3.0 * x.powi(7) + 19.0 * x.powi(5) + 17.0 * x.powi(3) - 15.0 * x) / 384.0,
        (79.0 * x.powi(9) + 776.0 * x.powi(7) + 1482.0 * x.powi(5) - 1920.0 * x.powi(3) - 945.0 * x)
            / 92_160.0,
    ];
    terms.iter().zip(1..).fold(x, |sum, (term, power)| sum + term / n.powi(power))
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    /// Where the synthetic figure reaches its target.
    const TRUTH: f64 = 1234.5;

    /// A number of the standard normal distribution, another one for each key.
    fn normal(key: [u32; 3]) -> f64 {
        let mut state = key.iter().fold(0x9E37_79B9_7F4A_7C15_u64, |state, word| {
            (state ^ u64::from(*word)).wrapping_mul(0xBF58_476D_1CE4_E5B9).rotate_left(29)
        });
        let mut uniform = || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ z >> 31) >> 11) as f64 / (1_u64 << 53) as f64
        };
        (-2.0 * (1.0 - uniform()).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
    }

    /// Searches where 0.02 (samples / TRUTH)^-exponent, with relative noise, is 0.02. Returns the answer and the
    /// number of measurements.
    fn run(seed: u32, repetitions: u32, noise: f64, exponent: f64) -> (Answer, usize) {
        let target = Target { value: 0.02, falls: exponent > 0.0, ratios: true, range: [10, 60_000] };
        let mut count = 0;
        let answer = search(&target, |samples| {
            count += 1;
            let exact = 0.02 * (f64::from(samples) / TRUTH).powf(-exponent);
            let figure = |nth| exact * (noise * normal([seed, samples, nth])).exp();
            Ok::<_, Infallible>((0..repetitions).map(figure).collect())
        });
        (answer.unwrap(), count)
    }

    #[test]
    fn the_truth_is_within_the_interval_for_a_hundred_of_a_hundred_seeds() {
        for (repetitions, noise, exponent) in [(3, 0.05, 0.4), (5, 0.05, 0.4), (5, 0.2, 0.5), (3, 0.03, -1.0)]
        {
            let (mut widths, mut off, mut most) = (Vec::new(), Vec::new(), 0);
            for seed in 0..100 {
                let (answer, count) = run(seed, repetitions, noise, exponent);
                let Answer::Within { samples, interval: [low, high] } = answer else {
                    panic!("{seed}: {answer:?}")
                };
                assert!((f64::from(low)..=f64::from(high)).contains(&TRUTH), "{seed}, {noise}: {answer:?}");
                widths.push(f64::from(high) / f64::from(low));
                off.push((samples / TRUTH).ln().abs());
                most = most.max(count);
            }
            widths.sort_by(f64::total_cmp);
            off.sort_by(f64::total_cmp);
            // What the noise of a mean is worth in samples, in standard deviations.
            let worth = noise / f64::from(repetitions).sqrt() / f64::abs(exponent);
            println!(
                "{repetitions} x {noise}: width {:.2}, off {:.3}, worth {worth:.3}, at most {most}",
                widths[50], off[50]
            );
            assert!(widths[50].ln() < 16.0 * worth, "intervals of a factor {} say little", widths[50]);
            assert!(off[50] < worth && most < 60, "{}, {most}", off[50]);
        }
    }

    #[test]
    fn another_truth_is_not_within_the_interval() {
        let wrong = |seed| match run(seed, 5, 0.05, 0.4).0 {
            Answer::Within { interval: [low, high], .. } => {
                !(f64::from(low)..=f64::from(high)).contains(&(2.0 * TRUTH))
            }
            _ => true,
        };
        assert!((0..100).filter(|seed| wrong(*seed)).count() > 95);
    }

    #[test]
    fn without_noise_the_answer_is_exact() {
        let (answer, count) = run(1, 2, 0.0, 0.4);
        let Answer::Within { samples, interval } = answer else { panic!("{answer:?}") };
        assert!(interval[0] <= 1234 && interval[1] >= 1235 && interval[1] - interval[0] <= 8, "{interval:?}");
        assert!((samples - TRUTH).abs() < 1.0 && count < 16, "{samples} after {count} measurements");
    }

    #[test]
    fn targets_beyond_the_range_are_recognised() {
        let find = |value: f64, falls: bool| {
            let target = Target { value, falls, ratios: false, range: [1, 100] };
            let sign = if falls { -1.0 } else { 1.0 };
            search(&target, |samples| {
                Ok::<_, Infallible>(
                    (0..3).map(|nth| sign * f64::from(samples) + 0.1 * normal([7, samples, nth])).collect(),
                )
            })
            .unwrap()
        };
        assert_eq!((find(-101.0, true), find(200.0, false)), (Answer::More, Answer::More));
        assert_eq!((find(0.0, true), find(-3.0, false)), (Answer::Fewer, Answer::Fewer));
        assert!(
            matches!(find(50.5, false), Answer::Within { interval: [50, 51], .. }),
            "{:?}",
            find(50.5, false)
        );
    }

    #[test]
    fn an_error_ends_the_search() {
        let target = Target { value: 1.0, falls: true, ratios: true, range: [1, 100] };
        assert_eq!(search(&target, |_| Err("no")), Err("no"));
    }

    #[test]
    fn quantiles_are_those_of_tables() {
        for (freedom, expected) in [(8, 5.041), (10, 4.587), (20, 3.850), (60, 3.460)] {
            let found = quantile(freedom);
            assert!((found / expected - 1.0).abs() < 0.015, "{freedom}: {found}, not {expected}");
        }
    }
}
