//! The times of a frame, measured here or taken from the papers.

use super::column;

/// Milliseconds of a frame and of its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Times {
    /// Times of [`column::COLUMNS`]; `None` if no such stage runs or the papers give no figure.
    pub columns: [Option<f64>; column::COUNT],
    /// Time that no column counts: tone mapping, a user's shaders, transfers, commands and waiting. Zero if the columns
    /// sum to more than the frame, as CPU and GPU work concurrently.
    pub rest: f64,
    /// All work on the GPU; `None` if the GPU does no work or the papers give no figure.
    pub gpu: Option<f64>,
    /// The frame time without tracing.
    pub frame: f64,
}

impl Times {
    /// Frames per second.
    pub fn fps(&self) -> f64 {
        1000.0 / self.frame.max(1e-6)
    }
}

/// The quantile of `values` at `share`, 0 to 1; zero if `values` is empty.
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        count => values[(share * (count - 1) as f64).round() as usize],
    }
}

/// The exponent p of the best fit y ~ x^p (least squares of the logarithms), or `None` for fewer than two different x.
pub fn growth(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.max(1e-9).ln())).collect();
    let count = logs.len() as f64;
    let mean = |pick: fn(&(f64, f64)) -> f64| logs.iter().map(pick).sum::<f64>() / count;
    let (mean_x, mean_y) = (mean(|log| log.0), mean(|log| log.1));
    let spread: f64 = logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    let product: f64 = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    (spread > 1e-9).then(|| product / spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles() {
        let values = vec![9.0, 1.0, 3.0, 2.0, 100.0];
        assert_eq!([0.0, 0.5, 0.95].map(|share| quantile(values.clone(), share)), [1.0, 3.0, 100.0]);
        assert_eq!(quantile(Vec::new(), 0.5), 0.0);
    }

    #[test]
    fn growth_finds_the_exponent_of_a_power() {
        let squares: Vec<(f64, f64)> = [1.0, 2.0, 4.0, 8.0].map(|x| (x, 3.0 * x * x)).into();
        assert!((growth(&squares).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(growth(&[(5.0, 1.0), (5.0, 2.0)]), None);
        assert_eq!(growth(&[]), None);
    }
}
