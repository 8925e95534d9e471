//! The search for the value of a parameter, or the number of samples, at which a noisy figure reaches a target.
//!
//! The figure is measured several times, with another seed each, at some values. A value counts as too small (or large
//! enough) only if a t-test says so; between such values the search bisects. Where noise does not let it decide, the
//! answer is an interval. The figure must rise or fall with the value.

/// A value of the normal distribution exceeds this one with a chance of 0.0005: the doubt with which a value that is too
/// small is taken for large enough, or the other way round.
const NORMAL_QUANTILE: f64 = 3.290_527;

/// The search ends where the ends of an interval differ by less: by 0.5%, or on a linear scale by 0.5% of the range.
const PRECISION: f64 = 0.005;

/// What is searched.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The figure to reach.
    pub value: f64,
    /// Whether the figure falls where the value rises; `None` if the ends of the range are to tell.
    pub falls: Option<bool>,
    /// Whether ratios of the figure count, not differences. Its noise is then as large a share everywhere.
    pub ratios: bool,
    /// The smallest and the largest value. If both are above 0, the search is over their logarithms.
    pub range: [f64; 2],
    /// Whether values are whole numbers.
    pub whole: bool,
}

/// The value at which the figure reaches its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Most likely at `value`, and hardly ever outside of the interval.
    Within {
        /// By a line through the figures around the target, over the logarithm of the value or the value itself.
        value: f64,
        /// The smallest and the largest value at which it may be.
        interval: [f64; 2],
    },
    /// At the start of the range, the figure is beyond the target already.
    Below,
    /// At the end of the range, it is not there yet.
    Above,
}

/// What was measured at a value: distances of the figure from the target, positive where the value is too small.
struct Point {
    value: f64,
    distances: Vec<f64>,
}

impl Point {
    fn mean(&self) -> f64 {
        self.distances.iter().sum::<f64>() / self.distances.len() as f64
    }

    /// The sum of squared deviations from the mean.
    fn squares(&self) -> f64 {
        let mean = self.mean();
        self.distances.iter().map(|distance| (distance - mean).powi(2)).sum()
    }
}

/// Searches. `measure` gives the figure at a value, once for each repetition; it is called once for each value.
///
/// # Errors
/// Those of `measure`.
pub fn search<E>(target: &Target, mut measure: impl FnMut(f64) -> Result<Vec<f64>, E>) -> Result<Answer, E> {
    let mut at = |value: f64| -> Result<Point, E> {
        let distances = measure(value)?.into_iter().map(|figure| target.distance(figure)).collect();
        Ok(Point { value, distances })
    };
    let [first, last] = target.range;
    let mut points = vec![at(first)?];
    if last > first {
        points.push(at(last)?);
    }
    let falls = target.falls.unwrap_or_else(|| points[0].mean() > points[points.len() - 1].mean());
    let turned = |mut point: Point| {
        if !falls {
            point.distances.iter_mut().for_each(|distance| *distance = -*distance);
        }
        point
    };
    let mut points: Vec<Point> = points.into_iter().map(turned).collect();
    // The next value is in the middle of the wider of two gaps: between too small and undecided, undecided and large
    // enough. As long as all are decided, both are one.
    while let Some(next) = target.next(&points) {
        points.push(turned(at(next)?));
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
    }
    Ok(target.answer(&points))
}

/// For each point, whether its value is surely too small (`Some(true)`) or large enough (`Some(false)`).
fn sides(points: &[Point]) -> Vec<Option<bool>> {
    let freedom: usize = points.iter().map(|point| point.distances.len().saturating_sub(1)).sum();
    // The noise is about the same at all values, so that all points tell about it.
    let variance = points.iter().map(Point::squares).sum::<f64>() / freedom.max(1) as f64;
    let side = |point: &Point| {
        let bound = quantile(freedom) * (variance / point.distances.len() as f64).sqrt();
        let mean = point.mean();
        (mean.abs() > bound).then_some(mean > 0.0)
    };
    points.iter().map(side).collect()
}

/// The indices of the last point up to which all are surely too small, and of the first one from which all are surely
/// large enough.
fn bounds(points: &[Point]) -> [Option<usize>; 2] {
    let sides = sides(points);
    let small = sides.iter().take_while(|side| **side == Some(true)).count();
    let enough = sides.iter().rev().take_while(|side| **side == Some(false)).count();
    [small.checked_sub(1), (enough > 0).then(|| points.len() - enough)]
}

impl Target {
    /// How far a figure is above the target.
    fn distance(&self, figure: f64) -> f64 {
        if self.ratios { (figure / self.value).ln() } else { figure - self.value }
    }

    /// Whether the search is over logarithms.
    fn is_logarithmic(&self) -> bool {
        self.range[0] > 0.0
    }

    /// The place of a value on the scale of the search.
    fn place(&self, value: f64) -> f64 {
        if self.is_logarithmic() { value.ln() } else { value }
    }

    /// The value at a place on the scale, a whole number if it has to be.
    fn value(&self, place: f64) -> f64 {
        let value = if self.is_logarithmic() { place.exp() } else { place };
        if self.whole { value.round() } else { value }
    }

    /// The value to measure next, or `None` at the end.
    fn next(&self, points: &[Point]) -> Option<f64> {
        let last = points.len() - 1;
        let [small, enough] = bounds(points);
        // An end of the range that is on the other side answers the question.
        if enough == Some(0) || small == Some(last) {
            return None;
        }
        let lower = small.map(|small| [small, small + 1]);
        let upper = enough.map(|enough| [enough - 1, enough]);
        let gaps = [lower, upper].into_iter().flatten().map(|gap| gap.map(|index| points[index].value));
        let width = |[a, b]: [f64; 2]| self.place(b) - self.place(a);
        let middle = |[a, b]: [f64; 2]| self.value(0.5 * (self.place(a) + self.place(b)));
        let precise = if self.is_logarithmic() { PRECISION.ln_1p() } else { PRECISION * width(self.range) };
        let open = gaps.filter(|&gap| width(gap) > precise && !gap.contains(&middle(gap)));
        open.max_by(|a, b| width(*a).total_cmp(&width(*b))).map(middle)
    }

    fn answer(&self, points: &[Point]) -> Answer {
        let last = points.len() - 1;
        let [small, enough] = bounds(points);
        if enough == Some(0) {
            return Answer::Below;
        }
        if small == Some(last) {
            return Answer::Above;
        }
        let (low, high) = (small.unwrap_or(0), enough.unwrap_or(last));
        let interval = [points[low].value, points[high].value];
        // A line through the points of the interval and the next ones.
        let around = &points[low.saturating_sub(1)..(high + 2).min(points.len())];
        let value = self.crossing(around).clamp(interval[0], interval[1]);
        Answer::Within { value, interval }
    }

    /// Where the line of least squares through the means crosses zero.
    fn crossing(&self, points: &[Point]) -> f64 {
        let of = |point: &Point| [self.place(point.value), point.mean()];
        let all: Vec<[f64; 2]> = points.iter().map(of).collect();
        let mean = |lane: usize| all.iter().map(|pair| pair[lane]).sum::<f64>() / all.len() as f64;
        let [x, y] = [mean(0), mean(1)];
        let spread: f64 = all.iter().map(|pair| (pair[0] - x).powi(2)).sum();
        let slope = all.iter().map(|pair| (pair[0] - x) * (pair[1] - y)).sum::<f64>() / spread;
        let place = if slope < 0.0 { x - y / slope } else { x };
        if self.is_logarithmic() { place.exp() } else { place }
    }
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
        let target = Target {
            value: 0.02,
            falls: Some(exponent > 0.0),
            ratios: true,
            range: [10.0, 60_000.0],
            whole: true,
        };
        let mut count = 0;
        let answer = search(&target, |samples| {
            count += 1;
            let exact = 0.02 * (samples / TRUTH).powf(-exponent);
            let figure = |nth| exact * (noise * normal([seed, samples as u32, nth])).exp();
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
                let Answer::Within { value, interval: [low, high] } = answer else {
                    panic!("{seed}: {answer:?}")
                };
                assert!((low..=high).contains(&TRUTH), "{seed}, {noise}: {answer:?}");
                widths.push(high / low);
                off.push((value / TRUTH).ln().abs());
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
            Answer::Within { interval: [low, high], .. } => !(low..=high).contains(&(2.0 * TRUTH)),
            _ => true,
        };
        assert!((0..100).filter(|seed| wrong(*seed)).count() > 95);
    }

    #[test]
    fn without_noise_the_answer_is_exact() {
        let (answer, count) = run(1, 2, 0.0, 0.4);
        let Answer::Within { value, interval: [low, high] } = answer else { panic!("{answer:?}") };
        assert!(low <= 1234.0 && high >= 1235.0 && high - low <= 8.0, "{low} to {high}");
        assert!((value - TRUTH).abs() < 1.0 && count < 16, "{value} after {count} measurements");
    }

    #[test]
    fn targets_beyond_the_range_are_recognised() {
        let find = |value: f64, falls: bool| {
            let target =
                Target { value, falls: Some(falls), ratios: false, range: [1.0, 100.0], whole: true };
            let sign = if falls { -1.0 } else { 1.0 };
            search(&target, |samples| {
                Ok::<_, Infallible>(
                    (0..3).map(|nth| sign * samples + 0.1 * normal([7, samples as u32, nth])).collect(),
                )
            })
            .unwrap()
        };
        assert_eq!((find(-101.0, true), find(200.0, false)), (Answer::Above, Answer::Above));
        assert_eq!((find(0.0, true), find(-3.0, false)), (Answer::Below, Answer::Below));
        assert!(
            matches!(find(50.5, false), Answer::Within { interval: [50.0, 51.0], .. }),
            "{:?}",
            find(50.5, false)
        );
    }

    #[test]
    fn a_fractional_parameter_is_found_whether_the_figure_rises_or_falls() {
        // The figure crosses its target at 0.3, in a range with or without zero.
        for (sign, from) in [(1.0, 0.0), (-1.0, 0.0), (1.0, -0.5), (-1.0, 0.01), (1.0, 0.01)] {
            for seed in 0..100 {
                let target =
                    Target { value: 2.0, falls: None, ratios: false, range: [from, 1.0], whole: false };
                let mut nth = 0;
                let answer = search(&target, |value| {
                    let mut figure = || {
                        nth += 1;
                        2.0 + sign * (value - 0.3) + 0.02 * normal([seed, 11, nth])
                    };
                    Ok::<_, Infallible>((0..4).map(|_| figure()).collect())
                });
                let Ok(Answer::Within { value, interval: [low, high] }) = answer else {
                    panic!("{seed}: {answer:?}")
                };
                assert!(
                    low <= 0.3 && high >= 0.3 && high - low < 0.3,
                    "{sign}, {from}, {seed}: {low} to {high}"
                );
                assert!((value - 0.3).abs() < 0.05, "{sign}, {from}, {seed}: {value}");
            }
        }
    }

    #[test]
    fn an_error_ends_the_search() {
        let target = Target { value: 1.0, falls: Some(true), ratios: true, range: [1.0, 100.0], whole: true };
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
