//! The results that a formula may have in single precision, as intervals: the way WebGPU's conformance tests do it.
//!
//! An oracle is a formula over any [`Number`]. With `f64` it gives the exact result, with [`Interval`] all results that
//! WGSL allows: an operation is *correctly rounded*, but in either direction; or off by *n ULP*; or its error is
//! *inherited* from the operations of which it is composed. Numbers below the smallest normal one may be flushed to
//! zero, as operands and as results.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// The error that WGSL allows to a quotient.
const DIVISION_ULP: f64 = 2.5;

/// The spacing of single-precision numbers at `x`: of the smallest normal number for all that are smaller.
pub fn ulp(x: f64) -> f64 {
    let x = x.abs().max(f32::MIN_POSITIVE.into());
    if x.is_finite() { (x.log2().floor() - 23.0).exp2() } else { f64::INFINITY }
}

/// What an oracle computes with.
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A number that the stage is given.
    fn given(x: f32) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    fn exp(self) -> Self;
    fn exp2(self) -> Self;
    /// This number to the power of `y`, if it is not negative.
    fn powf(self, y: f64) -> Self;
}

impl Number for f64 {
    fn given(x: f32) -> Self {
        x.into()
    }
    fn min(self, other: Self) -> Self {
        f64::min(self, other)
    }
    fn max(self, other: Self) -> Self {
        f64::max(self, other)
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    fn exp(self) -> Self {
        f64::exp(self)
    }
    fn exp2(self) -> Self {
        f64::exp2(self)
    }
    fn powf(self, y: f64) -> Self {
        f64::powf(self, y)
    }
}

/// The single-precision numbers from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    pub low: f64,
    pub high: f64,
}

impl Interval {
    /// One number only.
    pub const fn exactly(x: f64) -> Self {
        Self { low: x, high: x }
    }

    /// All numbers: for results that WGSL leaves open.
    pub const ANY: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    pub fn contains(self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }

    /// The results of an operation whose exact ones are between `low` and `high`: a distance of `ulps` is allowed, then
    /// the neighbours in single precision, and zero in the place of what is smaller than normal numbers.
    fn rounded(low: f64, high: f64, ulps: f64) -> Self {
        if low.is_nan() || high.is_nan() {
            return Self::ANY;
        }
        // The operation in f64 has been rounded itself.
        let widened =
            |x: f64, sign: f64| if x.is_finite() { x + sign * (ulps * ulp(x) + x.abs() * 1e-15) } else { x };
        let (low, high) = (widened(low, -1.0), widened(high, 1.0));
        let down = |x: f64| if f64::from(x as f32) > x { (x as f32).next_down() } else { x as f32 };
        let rounded = Self { low: down(low).into(), high: (-down(-high)).into() };
        rounded.flushed()
    }

    fn flushed(self) -> Self {
        let smallest = f64::from(f32::MIN_POSITIVE);
        let flush = |x: f64, bound: fn(f64, f64) -> f64| if x.abs() < smallest { bound(x, 0.0) } else { x };
        Self { low: flush(self.low, f64::min), high: flush(self.high, f64::max) }
    }

    /// The results of an operation that is monotonic or has its extremes where the operands have theirs.
    fn of_corners(a: Self, b: Self, ulps: f64, operation: impl Fn(f64, f64) -> f64) -> Self {
        let corners = [(a.low, b.low), (a.low, b.high), (a.high, b.low), (a.high, b.high)];
        let results = corners.map(|(a, b)| operation(a, b));
        if results.iter().any(|x| x.is_nan()) {
            return Self::ANY;
        }
        let low = results.into_iter().fold(f64::INFINITY, f64::min);
        let high = results.into_iter().fold(f64::NEG_INFINITY, f64::max);
        Self::rounded(low, high, ulps)
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::rounded(self.low + other.low, self.high + other.high, 0.0)
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self::of_corners(self, other, 0.0, |a, b| a * b)
    }
}

impl Div for Interval {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        if other.contains(0.0) {
            return Self::ANY;
        }
        Self::of_corners(self, other, DIVISION_ULP, |a, b| a / b)
    }
}

impl Number for Interval {
    fn given(x: f32) -> Self {
        Self::exactly(x.into()).flushed()
    }
    fn min(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.min(other.high) }
    }
    fn max(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.max(other.high) }
    }
    /// Inherited from 1 / inverseSqrt(x), which may be off by 2 ULP, and a quotient.
    fn sqrt(self) -> Self {
        let root = |x: f64| x.max(0.0).sqrt();
        Self::rounded(root(self.low), root(self.high), 2.0 + DIVISION_ULP)
    }
    /// Off by 3 + 2 |x| ULP.
    fn exp(self) -> Self {
        Self::rounded(self.low.exp(), self.high.exp(), 3.0 + 2.0 * self.low.abs().max(self.high.abs()))
    }
    /// As [`Number::exp`].
    fn exp2(self) -> Self {
        Self::rounded(self.low.exp2(), self.high.exp2(), 3.0 + 2.0 * self.low.abs().max(self.high.abs()))
    }
    /// Inherited from exp2(y * log2(x)), where the logarithm may be off by 3 ULP, or by 2^-21 near 1.
    fn powf(self, y: f64) -> Self {
        let power = |x: f64, sign: f64| {
            let x = x.max(0.0);
            let logarithm = x.log2();
            let logarithm = logarithm + sign * (3.0 * ulp(logarithm)).max((-21f64).exp2());
            let exponent = y * logarithm + sign * ulp(y * logarithm);
            exponent.exp2() + sign * (3.0 + 2.0 * exponent.abs()) * ulp(exponent.exp2())
        };
        Self::rounded(power(self.low, -1.0).max(0.0), power(self.high, 1.0), 0.0)
    }
}

mod tests {
    use super::*;

    const TINY: f32 = 1e-40;

    #[test]
    fn an_exact_result_has_its_neighbours_beside_it() {
        // 1 + 2^-30 lies between 1 and the next number: either may be the result.
        let sum = Interval::given(1.0) + Interval::given(9.313_226e-10);
        assert_eq!(sum, Interval { low: 1.0, high: f64::from(1f32.next_up()) });
        // 3 * 5 is exact in f64 and in f32, but the interval does not know that: one ULP.
        let product = Interval::given(3.0) * Interval::given(5.0);
        assert!(product.contains(15.0) && product.high - product.low <= 2.0 * ulp(15.0));
    }

    #[test]
    fn errors_are_inherited() {
        let [one, three] = [1.0, 3.0].map(Interval::given);
        let third = one / three;
        let width = |x: Interval| (x.high - x.low) / ulp(x.low);
        assert!((5.0..=7.0).contains(&width(third)), "{}", width(third));
        let sum = third + third + third;
        assert!(sum.contains(1.0) && width(sum) >= width(third));
        // A difference of nearly equal numbers keeps the errors of both, however small it is.
        let lost = sum - one;
        assert!(lost.contains(0.0) && lost.high - lost.low >= 2.0 * width(third) * ulp(0.25));
    }

    #[test]
    fn numbers_below_the_normal_ones_may_be_flushed() {
        let tiny = Interval::given(TINY);
        assert!(tiny.contains(0.0) && tiny.contains(TINY.into()) && !tiny.contains(1e-30));
        let product = Interval::given(1e-30) * Interval::given(1e-10);
        assert!(product.contains(0.0) && product.contains(TINY.into()));
        assert_eq!(Interval::given(1.0) / tiny, Interval::ANY);
        assert!(!Interval::given(f32::MIN_POSITIVE).contains(0.0));
    }

    #[test]
    fn what_single_precision_computes_is_allowed() {
        let mut random = epigraph_core::testing::Random(1);
        for _ in 0..10_000 {
            let [a, b] = [0; 2].map(|_| random.between(-1.0, 1.0) * random.between(-60.0, 60.0).exp2());
            let [x, y] = [a, b].map(Interval::given);
            let results = [(x + y, a + b), (x - y, a - b), (x * y, a * b), (x / y, a / b)];
            let roots = [(x.max(-x).sqrt(), a.abs().sqrt()), (x.min(y), a.min(b)), (x.max(y), a.max(b))];
            for (allowed, result) in results.into_iter().chain(roots) {
                assert!(allowed.contains(result.into()), "{a:e}, {b:e}: {result:e} is not in {allowed:?}");
            }
            let small = a.clamp(-80.0, 80.0);
            assert!(Interval::given(small).exp().contains(small.exp().into()), "exp {small}");
            let share = a.abs().min(1.0);
            assert!(Interval::given(share).powf(1.0 / 2.4).contains(share.powf(1.0 / 2.4).into()), "{share}");
        }
    }

    #[test]
    fn a_wrong_result_is_not_allowed() {
        let [a, b] = [1.25f32, 3.7].map(Interval::given);
        for (allowed, exact) in
            [(a + b, 4.95), (a * b, 4.625), (a / b, 1.25 / 3.7), (b.sqrt(), 3.7f64.sqrt())]
        {
            for step in [-16.0, 16.0] {
                assert!(!allowed.contains(exact + step * ulp(exact)), "{exact} {step}");
            }
        }
    }
}
