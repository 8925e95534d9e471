//! Points as they are given.

use glam::{DVec3, Vec3};

/// A point set to encode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// What to add to the positions. Single precision keeps small numbers best: with an origin among the points,
    /// survey coordinates of ten million metres lose nothing.
    pub origin: DVec3,
    /// Where the points are, from the origin.
    pub positions: Vec<Vec3>,
    /// A colour for each point: sRGB, and alpha.
    pub colors: Option<Vec<[u8; 4]>>,
    /// The direction of the surface at each point, of any length; zero where there is none.
    pub normals: Option<Vec<Vec3>>,
}

impl Points {
    /// Points in double precision. The origin is the centre of their bounds, in whole units of length where the points
    /// extend over more than a few of them.
    pub fn from_double(positions: &[DVec3]) -> Self {
        let bounds = positions.iter().fold(None, |bounds: Option<[DVec3; 2]>, &at| {
            let [low, high] = bounds.unwrap_or([at; 2]);
            Some([low.min(at), high.max(at)])
        });
        let [low, high] = bounds.unwrap_or_default();
        let center = low + 0.5 * (high - low);
        let origin = if (high - low).max_element() > 8.0 { center.round() } else { center };
        let positions = positions.iter().map(|at| (at - origin).as_vec3()).collect();
        Self { origin, positions, ..Self::default() }
    }
}

impl From<Vec<Vec3>> for Points {
    fn from(positions: Vec<Vec3>) -> Self {
        Self { positions, ..Self::default() }
    }
}

/// A point in the order of the hierarchy, and its index among those given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) at: Vec3,
    pub(crate) index: u32,
}

impl Point {
    /// All points in the order given. There are less than 2³².
    pub(crate) fn all(positions: &[Vec3]) -> Vec<Self> {
        (0..).zip(positions).map(|(index, &at)| Self { at, index }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn survey_coordinates_keep_their_millimetres() {
        let at = |x, y| DVec3::new(4_500_000.001 + x, 5_600_000.002 + y, 312.003);
        let points = Points::from_double(&[at(0.0, 0.0), at(100.0, 0.004), at(40.0, 80.0)]);
        assert_eq!(points.origin, DVec3::new(4_500_050.0, 5_600_040.0, 312.0));
        for (found, expected) in points.positions.iter().zip([[-49.999, -39.998], [50.001, -39.994]]) {
            assert!(found.truncate().abs_diff_eq(expected.into(), 1e-5), "{found}");
        }
        let small = Points::from_double(&[DVec3::splat(0.25), DVec3::splat(0.75)]);
        assert_eq!((small.origin, small.positions[0]), (DVec3::splat(0.5), Vec3::splat(-0.25)));
        assert_eq!(Points::from_double(&[]), Points::default());
    }
}
