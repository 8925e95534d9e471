//! The origin of a file's coordinates, so that single precision suffices for what is around it.

use glam::{DVec3, Vec3};

/// The share of an object's size that may be lost to rounding.
const TOLERANCE: f64 = 1e-5;

/// What to subtract from coordinates between `low` and `high` before they become single-precision numbers, metres. Zero
/// unless rounding them as they are would cost more than 1e-5 of the size of the box; otherwise near the centre of the box,
/// in whole metres, or in fractions of a metre (halves, quarters, ...) if the box is smaller than that.
///
/// The box is that of the vertices that faces use. Zero if there are none (a box that is inverted or not finite).
pub(crate) fn origin_of(low: DVec3, high: DVec3) -> DVec3 {
    let size = (high - low).max_element();
    let farthest = low.abs().max(high.abs()).max_element();
    let rounding = 0.5 * f64::from(f32::EPSILON) * farthest;
    if !farthest.is_finite() || size < 0.0 || rounding <= TOLERANCE * size {
        return DVec3::ZERO;
    }
    // A single point has no size; whole metres do for it.
    let unit = if size > 0.0 { size.log2().floor().min(0.0).exp2() } else { 1.0 };
    (low.midpoint(high) / unit).round() * unit
}

/// Whether single precision tears what is in this box, relative to the scene's origin: rounding may cost more than a
/// hundredth of its size.
pub(crate) fn is_torn(low: Vec3, high: Vec3) -> bool {
    let size = (high - low).max_element();
    let farthest = low.abs().max(high.abs()).max_element();
    size > 0.0 && 0.5 * f32::EPSILON * farthest > 0.01 * size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_coordinates_far_out_for_their_size_get_an_origin() {
        let origin = |centre: DVec3, size: f64| {
            let half = DVec3::new(0.5 * size, 0.1 * size, 0.3 * size);
            origin_of(centre - half, centre + half)
        };
        for (x, size, expected) in [
            (0.0, 1.0, 0.0),
            (160.0, 1.0, 0.0),
            (175.25, 1.0, 175.0),
            (-175.25, 1.0, -175.0),
            (5e5 + 0.3, 40.0, 500_000.0),
            (0.05, 5e-4, 0.0),
            (0.1, 5e-4, 205.0 / 2048.0),
            (1e7, 1e6, 0.0),
            // A millimetre 20.5 m away: by 1/1024 m.
            (20.5, 0.001, 20.5),
            (20.5 + 0.0004, 0.001, 20.5),
        ] {
            let found = origin(DVec3::new(x, 0.0, 0.0), size);
            assert_eq!(found, DVec3::new(expected, 0.0, 0.0), "{x}, {size}");
        }
        let utm = DVec3::new(4.5e6 + 0.4, -123.0, -7.25e6);
        assert_eq!(origin(utm, 12.0), DVec3::new(4.5e6, -123.0, -7.25e6));
        // What is left is small enough for single precision to keep it to 1e-5 of the size.
        for size in [1e-6, 1e-3, 0.7, 1.0, 30.0, 1e4] {
            let left = (utm - origin(utm, size)).abs().max_element();
            assert!(left <= 0.5 * size.max(1.0) && left <= 100.0 * size, "{size}: {left}");
        }
    }

    #[test]
    fn the_distance_at_which_rounding_costs_too_much_is_that_of_the_farther_end() {
        // Of boxes of 1 m, along each axis and on both sides: half of 2^-23 of this is exactly 1e-5 m.
        let far = 1e-5 * f64::from(1 << 24);
        for axis in DVec3::AXES {
            for (end, is_far) in [(far, false), (far.next_up(), true)] {
                let (near, end) = ((end - 1.0) * axis, end * axis);
                assert_eq!(origin_of(near, end) != DVec3::ZERO, is_far, "{end}");
                assert_eq!(origin_of(-end, -near) != DVec3::ZERO, is_far, "-{end}");
            }
        }
        // And of this, a hundredth.
        let far = 0.01 * (1 << 24) as f32;
        for axis in Vec3::AXES {
            for (end, is_far) in [(far, false), (far.next_up(), true)] {
                let (near, end) = ((end - 1.0) * axis, end * axis);
                assert_eq!([is_torn(near, end), is_torn(-end, -near)], [is_far; 2], "{end}");
            }
        }
    }

    #[test]
    fn what_is_small_and_far_from_the_origin_is_torn() {
        for (x, size, expected) in
            [(1e3, 1.0, false), (1e5, 1.0, false), (1e6, 1.0, true), (1e6, 100.0, false), (1e6, 0.0, false)]
        {
            let low = Vec3::new(x, 0.0, 0.0);
            assert_eq!(is_torn(low, low + size), expected, "{x}, {size}");
        }
    }

    #[test]
    fn boxes_without_a_size_do_not_panic() {
        let (none, all) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        assert_eq!(origin_of(none, all), DVec3::ZERO);
        assert_eq!(origin_of(all, none), DVec3::ZERO);
        assert_eq!(origin_of(DVec3::NAN, DVec3::NAN), DVec3::ZERO);
        assert_eq!(origin_of(DVec3::splat(7e6), DVec3::splat(7e6)), DVec3::splat(7e6));
        assert_eq!(origin_of(DVec3::ZERO, DVec3::ZERO), DVec3::ZERO);
        // To a whole metre, not to two.
        assert_eq!(origin_of(DVec3::splat(7e6 + 1.25), DVec3::splat(7e6 + 1.25)), DVec3::splat(7e6 + 1.0));
    }
}
