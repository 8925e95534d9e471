//! The times of a frame, ours or the papers'.

use super::column;

/// Milliseconds of a frame and of its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Times {
    /// Of each of [`column::COLUMNS`]; none where nothing of the kind runs or the papers tell no figure.
    pub columns: [Option<f64>; column::COUNT],
    /// What no column counts: tone mapping, a user's shaders, transfers, commands and waiting. Zero where the columns take
    /// more than the frame, because a GPU works while the CPU does.
    pub rest: f64,
    /// All work on the GPU; none where there is none or no figure is told.
    pub gpu: Option<f64>,
    /// The frame without tracing.
    pub frame: f64,
}

impl Times {
    /// Frames a second.
    pub fn fps(&self) -> f64 {
        1000.0 / self.frame.max(1e-6)
    }
}

/// The value below which this share of `values` lies, 0 to 1; zero where there are none.
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        count => values[(share * (count - 1) as f64).round() as usize],
    }
}

/// The exponent p of y ~ x^p that fits the points best (least squares of the logarithms); none for fewer than two
/// different x.
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
    fn the_exponent_of_a_power_is_found() {
        let squares: Vec<(f64, f64)> = [1.0, 2.0, 4.0, 8.0].map(|x| (x, 3.0 * x * x)).into();
        assert!((growth(&squares).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(growth(&[(5.0, 1.0), (5.0, 2.0)]), None);
        assert_eq!(growth(&[]), None);
    }
}
