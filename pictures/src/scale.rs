//! The mapping from values to shades, and the axis that explains the shades.

use crate::{Ramp, tone};

/// Shade of the farthest depth, so that it differs from empty pixels.
const DARKEST_DEPTH: f32 = 0.15;

/// How values are spread between the ends of a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// Linearly.
    Linear,
    /// By logarithm; if the dark end is not positive, by the logarithm of one plus the distance from it.
    Log,
    /// By reciprocal, as depths shrink on screen.
    Reciprocal,
}

/// What shades look like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paint {
    /// From black to white.
    Grey,
    /// From dark grey to white.
    Depth,
    /// Along a ramp.
    Ramp(Ramp),
}

/// The mapping from values to shades.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Values at the dark and at the bright end.
    pub range: [f32; 2],
    /// How values are spread between them.
    pub curve: Curve,
    /// What shades look like.
    pub paint: Paint,
}

impl Scale {
    /// Where a value lies between the dark end (0) and the bright end (1).
    pub fn share(&self, value: f32) -> f32 {
        let [low, high] = self.range.map(|end| self.bend(end));
        let at = self.bend(value);
        if high > low { ((at - low) / (high - low)).clamp(0.0, 1.0) } else { f32::from(u8::from(at >= high)) }
    }

    /// The value at a share from 0 to 1.
    pub fn value(&self, share: f32) -> f32 {
        let [low, high] = self.range.map(|end| self.bend(end));
        let at = low + share * (high - low);
        match self.curve {
            Curve::Linear => at,
            Curve::Log if self.range[0] > 0.0 => at.exp(),
            Curve::Log => at.exp_m1() + self.range[0],
            Curve::Reciprocal => at.recip(),
        }
    }

    /// The sRGB colour of a value.
    pub fn color(&self, value: f32) -> [u8; 3] {
        self.color_at(self.share(value))
    }

    /// The sRGB colour at a share from 0 to 1.
    pub fn color_at(&self, share: f32) -> [u8; 3] {
        match self.paint {
            Paint::Grey => [tone::to_byte(share); 3],
            Paint::Depth => [tone::to_byte(DARKEST_DEPTH + (1.0 - DARKEST_DEPTH) * share); 3],
            Paint::Ramp(ramp) => ramp.color(share),
        }
    }

    /// Round values between the ends, at most `most`: 1, 2 or 5 times a power of ten apart, or powers of ten on a wide
    /// logarithmic axis.
    pub fn ticks(&self, most: usize) -> Vec<f32> {
        let [low, high] = [self.range[0].min(self.range[1]), self.range[0].max(self.range[1])];
        if !(high > low && low.is_finite() && high.is_finite()) || most == 0 {
            return Vec::new();
        }
        let decades = (high / low).log10();
        if self.curve == Curve::Log && low > 0.0 && decades >= 2.0 {
            let step = (decades / most as f32).ceil().max(1.0) as i32;
            let first = low.log10().ceil() as i32;
            let last = high.log10().floor() as i32;
            return (first..=last).step_by(step as usize).map(|power| 10f32.powi(power)).collect();
        }
        let rough = f64::from(high - low) / most as f64;
        let power = 10f64.powf(rough.log10().floor());
        let step =
            power * [1.0, 2.0, 5.0, 10.0].into_iter().find(|step| step * power >= rough).unwrap_or(10.0);
        let (first, last) = ((f64::from(low) / step).ceil(), (f64::from(high) / step).floor());
        (0..=(last - first).max(0.0) as usize)
            .filter(|_| last >= first)
            .map(|index| ((first + index as f64) * step) as f32)
            .collect()
    }

    fn bend(&self, value: f32) -> f32 {
        match self.curve {
            Curve::Linear => value,
            Curve::Log if self.range[0] > 0.0 => value.max(f32::MIN_POSITIVE).ln(),
            Curve::Log => (value - self.range[0]).max(0.0).ln_1p(),
            Curve::Reciprocal => value.recip(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(range: [f32; 2], curve: Curve) -> Scale {
        Scale { range, curve, paint: Paint::Grey }
    }

    #[test]
    fn shares_and_values_are_inverse() {
        let scales = [
            scale([2.0, 50.0], Curve::Linear),
            scale([2.0, 50.0], Curve::Log),
            scale([0.0, 50.0], Curve::Log),
            scale([50.0, 2.0], Curve::Reciprocal),
        ];
        for scale in scales {
            assert_eq!([scale.share(scale.range[0]), scale.share(scale.range[1])], [0.0, 1.0]);
            for share in [0.0, 0.25, 0.5, 1.0] {
                assert!((scale.share(scale.value(share)) - share).abs() < 1e-4, "{scale:?}");
            }
        }
        // Halfway in each sense.
        assert_eq!(scale([0.0, 8.0], Curve::Linear).value(0.5), 4.0);
        assert!((scale([1.0, 16.0], Curve::Log).value(0.5) - 4.0).abs() < 1e-5);
        assert!((scale([6.0, 2.0], Curve::Reciprocal).value(0.5) - 3.0).abs() < 1e-5);
        // An empty range separates the values below it from the rest.
        assert_eq!([2.0, 3.0].map(|value| scale([3.0, 3.0], Curve::Linear).share(value)), [0.0, 1.0]);
    }

    #[test]
    fn ticks_are_round_and_lie_in_the_range() {
        assert_eq!(scale([0.0, 255.0], Curve::Linear).ticks(6), [0.0, 50.0, 100.0, 150.0, 200.0, 250.0]);
        assert_eq!(scale([7.3, 1.9], Curve::Reciprocal).ticks(4), [2.0, 4.0, 6.0]);
        assert_eq!(scale([-0.3, 0.3], Curve::Linear).ticks(4), [-0.2, 0.0, 0.2]);
        assert_eq!(scale([0.5, 2e4], Curve::Log).ticks(6), [1.0, 10.0, 100.0, 1e3, 1e4]);
        assert!(scale([1.0, 1.0], Curve::Linear).ticks(4).is_empty());
        assert!(scale([0.0, 255.0], Curve::Linear).ticks(0).is_empty());
        assert!(scale([0.0, f32::INFINITY], Curve::Linear).ticks(4).is_empty());
    }

    #[test]
    fn only_wide_ranges_of_logarithms_have_powers_of_ten() {
        for (range, curve, ticks) in [
            ([1.0, 100.0], Curve::Log, &[1.0, 10.0, 100.0][..]),
            ([1.0, 99.0], Curve::Log, &[20.0, 40.0, 60.0, 80.0]),
            ([1.0, 100.0], Curve::Linear, &[20.0, 40.0, 60.0, 80.0, 100.0]),
            ([0.0, 100.0], Curve::Log, &[0.0, 20.0, 40.0, 60.0, 80.0, 100.0]),
            ([-1.0, 100.0], Curve::Log, &[0.0, 50.0, 100.0]),
            ([1.0, 1e8], Curve::Log, &[1.0, 100.0, 1e4, 1e6, 1e8]),
            ([2.0, 300.0], Curve::Log, &[10.0, 100.0]),
        ] {
            assert_eq!(scale(range, curve).ticks(5), ticks, "{curve:?} of {range:?}");
        }
    }
}
