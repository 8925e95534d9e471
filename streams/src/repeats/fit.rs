//! The rigid transformation that takes points nearest to others.

use glam::{DMat3, DQuat, DVec3};

/// The rotation and translation that take the first points of pairs to the second ones with the least sum of squared
/// distances. For two pairs or more, of different points.
///
/// The rotation maximises the trace of `R^T B`, where B is the sum of the products of both points from their means. A
/// first guess comes from three points far from each other; Newton's steps go on from there. If all points are in a
/// line, any of the rotations about it is found. Only exactly rounded operations, so that all machines find the same.
pub(super) fn fit(pairs: &[(DVec3, DVec3)]) -> (DQuat, DVec3) {
    let count = pairs.len() as f64;
    let mean = |point: fn(&(DVec3, DVec3)) -> DVec3| pairs.iter().map(point).sum::<DVec3>() / count;
    let [from, to] = [mean(|pair| pair.0), mean(|pair| pair.1)];
    let products = pairs.iter().fold(DMat3::ZERO, |sum, pair| {
        let (x, y) = (pair.0 - from, pair.1 - to);
        sum + DMat3::from_cols(y * x.x, y * x.y, y * x.z)
    });
    let mut rotation = DQuat::from_mat3(&guess(pairs, from, to));
    // The steps square the error, and the guess is good to a few digits.
    for _ in 0..12 {
        let b = products * DMat3::from_quat(rotation).transpose();
        let trace = b.x_axis.x + b.y_axis.y + b.z_axis.z;
        let torque = DVec3::new(b.y_axis.z - b.z_axis.y, b.z_axis.x - b.x_axis.z, b.x_axis.y - b.y_axis.x);
        let symmetric = (b + b.transpose()) * 0.5;
        // The small part keeps the inverse finite for points in a line.
        let stiffness = DMat3::from_diagonal(DVec3::splat(trace * (1.0 + 1e-9))) - symmetric;
        let turn = stiffness.inverse() * torque;
        if !turn.is_finite() {
            break;
        }
        rotation = (DQuat::from_xyzw(0.5 * turn.x, 0.5 * turn.y, 0.5 * turn.z, 1.0) * rotation).normalize();
        if turn.length_squared() < 1e-28 {
            break;
        }
    }
    (rotation, to - rotation * from)
}

/// The rotation that takes the frame of two of the first points to that of the second ones: the point farthest from
/// the mean, and that farthest from the line through both.
fn guess(pairs: &[(DVec3, DVec3)], from: DVec3, to: DVec3) -> DMat3 {
    let farthest = |distance: &dyn Fn(DVec3) -> f64| {
        let distances = pairs.iter().map(|pair| distance(pair.0 - from)).enumerate();
        let (index, _) = distances.fold((0, -1.0), |best, next| if next.1 > best.1 { next } else { best });
        index
    };
    let first = farthest(&|at| at.length_squared());
    let line = (pairs[first].0 - from).normalize_or_zero();
    let second = farthest(&|at| at.cross(line).length_squared());
    let frame = |mean: DVec3, a: DVec3, b: DVec3| {
        let x = (a - mean).try_normalize().unwrap_or(DVec3::X);
        let y = (b - mean)
            .reject_from_normalized(x)
            .try_normalize()
            .unwrap_or_else(|| x.any_orthonormal_vector());
        DMat3::from_cols(x, y, x.cross(y))
    };
    let [a, b] = [pairs[first], pairs[second]];
    frame(to, a.1, b.1) * frame(from, a.0, b.0).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn the_transformation_of_copies_is_found_again() {
        let mut random = Random(1);
        for round in 0..2000 {
            let mut signed =
                |scale: f64| DVec3::from([0; 3].map(|_| scale * (2.0 * f64::from(random.unit()) - 1.0)));
            // Round, flat, and long parts, some of three points.
            let shape = [DVec3::ONE, DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, 0.02, 0.01)][round % 3];
            let count = [3, 4, 30][round / 3 % 3];
            let points: Vec<DVec3> = (0..count).map(|_| signed(1.0) * shape).collect();
            let axis = signed(1.0);
            let rotation = DQuat::from_xyzw(axis.x, axis.y, axis.z, signed(1.0).x).normalize();
            let translation = signed(300.0);
            let pairs: Vec<_> = points.iter().map(|&at| (at, rotation * at + translation)).collect();
            let (turn, by) = fit(&pairs);
            let error = pairs.iter().map(|&(x, y)| (turn * x + by).distance(y)).fold(0.0, f64::max);
            assert!(error < 1e-11, "round {round}: {error}");
        }
    }

    /// No small turn or move lessens the sum of squares.
    #[test]
    fn noise_is_fitted_with_the_least_squares() {
        let mut random = Random(2);
        for round in 0..200 {
            let mut signed = || DVec3::from([0; 3].map(|_| 2.0 * f64::from(random.unit()) - 1.0));
            let shape = [DVec3::ONE, DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.0, 0.02, 0.01)][round % 3];
            let mut pair = || {
                let at = signed() * shape;
                (at, at + 0.01 * signed())
            };
            let pairs: Vec<_> = (0..20).map(|_| pair()).collect();
            let (rotation, by) = fit(&pairs);
            let error = |turn: DVec3, shift: DVec3| -> f64 {
                let turn = (DQuat::from_xyzw(turn.x, turn.y, turn.z, 1.0) * rotation).normalize();
                pairs.iter().map(|&(x, y)| (turn * x + by + shift).distance_squared(y)).sum()
            };
            let least = error(DVec3::ZERO, DVec3::ZERO);
            for axis in DVec3::AXES {
                for step in [-1e-5, 1e-5] {
                    assert!(error(axis * step, DVec3::ZERO) >= least, "round {round}");
                    assert!(error(DVec3::ZERO, axis * step) > least, "round {round}");
                }
            }
        }
    }

    #[test]
    fn points_in_a_line_are_laid_on_the_line() {
        let pairs: Vec<_> = (0..4).map(f64::from).map(|t| (DVec3::X * t, DVec3::new(2.0, t, 5.0))).collect();
        let (rotation, by) = fit(&pairs);
        assert!(pairs.iter().all(|&(x, y)| (rotation * x + by).abs_diff_eq(y, 1e-12)));
    }
}
