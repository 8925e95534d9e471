//! Axes of plots.

/// A logarithmic axis.
pub struct Log {
    low: f64,
    high: f64,
    screen: [f64; 2],
}

impl Log {
    /// An axis for these values, with a margin at both ends. It spans at least a decade, so that noise does not look
    /// like growth.
    pub fn new([low, high]: [f64; 2], screen: [f64; 2]) -> Self {
        let span = high / low;
        let room = span.powf(0.06).max((10.0 / span).sqrt());
        Self { low: low / room, high: high * room, screen }
    }

    /// The screen position of a value.
    pub fn at(&self, value: f64) -> f64 {
        let share = (value / self.low).ln() / (self.high / self.low).ln();
        self.screen[0] + share * (self.screen[1] - self.screen[0])
    }

    /// Powers of ten, and their multiples by two and five unless the axis is long.
    pub fn ticks(&self) -> Vec<f64> {
        let decades = (self.high / self.low).log10();
        let mantissas: &[f64] = if decades > 3.0 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let from = self.low.log10().floor() as i32;
        let to = self.high.log10().ceil() as i32;
        let all = (from..=to).flat_map(|power| mantissas.iter().map(move |m| m * 10f64.powi(power)));
        all.filter(|value| (self.low..=self.high).contains(value)).collect()
    }
}

/// An axis with equal steps.
pub struct Linear {
    low: f64,
    high: f64,
    screen: [f64; 2],
}

impl Linear {
    /// An axis for these values, with a margin at both ends.
    pub fn new([low, high]: [f64; 2], screen: [f64; 2]) -> Self {
        let room = 0.06 * (high - low).max(1e-9);
        Self { low: low - room, high: high + room, screen }
    }

    /// The screen position of a value.
    pub fn at(&self, value: f64) -> f64 {
        let share = (value - self.low) / (self.high - self.low);
        self.screen[0] + share * (self.screen[1] - self.screen[0])
    }

    /// Four to nine multiples of a power of ten, or of two or five of them.
    pub fn ticks(&self) -> Vec<f64> {
        let step = round_step((self.high - self.low) / 8.0);
        let nth = |value: f64| (value / step).ceil() as i64;
        (nth(self.low)..=nth(self.high))
            .map(|nth| nth as f64 * step)
            .filter(|value| *value <= self.high)
            .collect()
    }
}

/// An axis of either kind.
pub enum Axis {
    /// For positive values that span decades.
    Log(Log),
    /// For all others.
    Linear(Linear),
}

impl Axis {
    /// An axis for these values; `None` if it can show none of them.
    pub fn new(values: impl Iterator<Item = f64>, logarithmic: bool, screen: [f64; 2]) -> Option<Self> {
        if logarithmic {
            return Some(Self::Log(Log::new(span(values.filter(|value| *value > 0.0))?, screen)));
        }
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), f64::max(high, value)]
        });
        (low <= high).then(|| Self::Linear(Linear::new([low, high], screen)))
    }

    /// Whether it can show a value.
    pub fn shows(&self, value: f64) -> bool {
        matches!(self, Self::Linear(_)) || value > 0.0
    }

    /// The screen position of a value.
    pub fn at(&self, value: f64) -> f64 {
        match self {
            Self::Log(axis) => axis.at(value),
            Self::Linear(axis) => axis.at(value),
        }
    }

    /// Round numbers.
    pub fn ticks(&self) -> Vec<f64> {
        match self {
            Self::Log(axis) => axis.ticks(),
            Self::Linear(axis) => axis.ticks(),
        }
    }
}

/// The smallest and the largest value, if a logarithmic axis can show them.
pub fn span(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let [low, high] =
        values.fold([f64::INFINITY, 0.0], |[low, high], value| [low.min(value), f64::max(high, value)]);
    (low > 0.0 && low.is_finite()).then_some([low, high])
}

/// 1, 2 or 5 times a power of ten, at least `least`.
pub fn round_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|step| *step >= least).unwrap_or(least)
}

/// A number without trailing zeros.
pub fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!([0.05, 100.0, 2.5].map(number), ["0.05", "100", "2.5"]);
        let axis = Log::new([10.0, 100.0], [0.0, 1.0]);
        assert_eq!(axis.ticks(), [10.0, 20.0, 50.0, 100.0]);
        assert!((axis.at(axis.low)).abs() < 1e-12 && (axis.at(axis.high) - 1.0).abs() < 1e-12);
        assert_eq!(Log::new([30.0, 40.0], [0.0, 1.0]).ticks().len(), 3);
        assert_eq!(span([3.0, 0.0].into_iter()), None);
        assert_eq!(span([3.0, 1.0].into_iter()), Some([1.0, 3.0]));
    }

    #[test]
    fn linear_ticks_are_multiples_of_round_steps() {
        let ticks = |values| Linear::new(values, [0.0, 1.0]).ticks();
        assert_eq!(ticks([0.0, 30.0]), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0]);
        assert_eq!(ticks([19.0, 29.0]), [20.0, 22.0, 24.0, 26.0, 28.0]);
        for width in [0.3, 1.0, 7.0, 1e5] {
            assert!(
                (4..=9).contains(&ticks([1.0, 1.0 + width]).len()),
                "{width}: {:?}",
                ticks([1.0, 1.0 + width])
            );
        }
        let axis = Axis::new([-1.0, 3.0].into_iter(), false, [10.0, 20.0]).unwrap();
        assert_eq!((axis.at(1.0), axis.shows(-1.0)), (15.0, true));
        assert!(Axis::new([0.0, -3.0].into_iter(), true, [0.0, 1.0]).is_none());
        let axis = Axis::new([0.0, 3.0, 30.0].into_iter(), true, [0.0, 1.0]).unwrap();
        assert!(!axis.shows(0.0) && axis.shows(1e-3));
    }
}
