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

/// The smallest and the largest value, if a logarithmic axis can show them.
pub fn span(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let [low, high] =
        values.fold([f64::INFINITY, 0.0], |[low, high], value| [low.min(value), f64::max(high, value)]);
    (low > 0.0 && low.is_finite()).then_some([low, high])
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
}
