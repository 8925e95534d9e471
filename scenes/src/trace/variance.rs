//! How noisy the mean of a few light paths is.

use glam::Vec3;

/// The variance of a sample with a single light path.
pub const UNKNOWN_VARIANCE: f32 = -1.0;

/// Number of groups of paths.
const GROUPS: u32 = 4;

/// Relative luminance of a linear Rec. 709 colour.
pub(super) fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// The luminance of a sample's light paths, summed in four groups of consecutive paths.
///
/// Paths are stratified, so they differ more from one another than their mean varies. A group of consecutive paths is
/// stratified too: the differences between groups are nearly those between samples.
pub(super) struct Groups {
    paths: u64,
    count: u64,
    sums: [f32; GROUPS as usize],
}

impl Groups {
    /// For this many paths, at least one.
    pub fn new(paths: u32) -> Self {
        Self { paths: paths.into(), count: paths.min(GROUPS).into(), sums: [0.0; GROUPS as usize] }
    }

    /// Adds the luminance of the path with this number.
    #[inline]
    pub fn add(&mut self, path: u32, luminance: f32) {
        self.sums[(u64::from(path) * self.count / self.paths) as usize] += luminance;
    }

    /// The estimated variance of the mean of all paths; [`UNKNOWN_VARIANCE`] if there is only one.
    pub fn variance_of_mean(&self) -> f32 {
        if self.count < 2 {
            return UNKNOWN_VARIANCE;
        }
        let first = |group: u64| (group * self.paths).div_ceil(self.count);
        let means = (0..self.count).zip(self.sums);
        let means = means.map(|(group, sum)| sum / (first(group + 1) - first(group)) as f32);
        let count = self.count as f32;
        let mean = means.clone().sum::<f32>() / count;
        means.map(|of_group| (of_group - mean).powi(2)).sum::<f32>() / (count * (count - 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn variance(paths: &[f32]) -> f32 {
        let mut groups = Groups::new(paths.len() as u32);
        (0..).zip(paths).for_each(|(path, &luminance)| groups.add(path, luminance));
        groups.variance_of_mean()
    }

    #[test]
    fn the_variance_of_the_mean_is_that_between_groups() {
        assert_eq!(variance(&[3.0]), UNKNOWN_VARIANCE);
        // (1 + 1) / (2 * 1).
        assert_eq!(variance(&[1.0, 3.0]), 1.0);
        // Four groups of one: (9 + 1 + 1 + 9) / (4 * 3).
        assert_eq!(variance(&[1.0, 3.0, 5.0, 7.0]), 20.0 / 12.0);
        // The same groups of two, however their paths differ.
        assert_eq!(variance(&[0.0, 2.0, 6.0, 0.0, 5.0, 5.0, 14.0, 0.0]), 20.0 / 12.0);
        // Five paths: groups of 2, 1, 1 and 1.
        assert_eq!(variance(&[0.0, 2.0, 3.0, 5.0, 7.0]), 20.0 / 12.0);
        assert_eq!(variance(&[4.0; 37]), 0.0);
    }
}
