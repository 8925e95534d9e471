use glam::Vec3;

use crate::limits::{is_intensity, is_near, is_radiance};

/// A light that casts shadows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// A point light of `intensity` (W/sr, per colour channel), which casts hard shadows.
    Point {
        /// Position, metres.
        position: Vec3,
        /// Radiant intensity.
        intensity: Vec3,
    },
    /// A point light that shines into a cone, as in KHR_lights_punctual.
    Spot {
        /// Position, metres.
        position: Vec3,
        /// Unit direction in which it shines.
        axis: Vec3,
        /// Radiant intensity along the axis.
        intensity: Vec3,
        /// The cosines of the angles to the axis at which it begins to fade and beyond which it is dark.
        cosines: [f32; 2],
    },
    /// A one-sided parallelogram `corner + s*u + t*v` that emits `radiance` towards `u x v`.
    /// Its two triangles are also part of the mesh, with an emissive material, so that eye rays see it.
    Quad {
        /// One corner, metres.
        corner: Vec3,
        /// First side.
        u: Vec3,
        /// Second side.
        v: Vec3,
        /// Emitted radiance.
        radiance: Vec3,
    },
}

impl Light {
    /// Whether all numbers are within the limits of a scene.
    pub(crate) fn is_valid(&self) -> bool {
        match *self {
            Self::Point { position, intensity } => is_near(position) && is_intensity(intensity),
            Self::Spot { position, axis, intensity, cosines: [inner, outer] } => {
                let is_cone = outer >= -1.0 && (outer..=1.0).contains(&inner);
                is_near(position) && is_intensity(intensity) && axis.is_normalized() && is_cone
            }
            Self::Quad { corner, u, v, radiance } => {
                is_near(corner) && is_near(u) && is_near(v) && is_radiance(radiance)
            }
        }
    }
}

/// The share of its intensity that a spot sends at this cosine to its axis: smooth between the two angles, as the
/// specification of KHR_lights_punctual suggests.
pub(crate) fn cone(cosine: f32, [inner, outer]: [f32; 2]) -> f32 {
    if cosine >= inner {
        return 1.0;
    }
    // Where both angles are the same, the edge is sharp.
    ((cosine - outer) / (inner - outer)).max(0.0).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::{MAX_COORDINATE, MAX_INTENSITY, MAX_RADIANCE};

    #[test]
    fn each_number_outside_its_limits_makes_a_light_invalid() {
        let far = Vec3::new(0.0, -MAX_COORDINATE, 0.0);
        let point =
            |position, intensity| Light::Point { position, intensity: Vec3::new(0.0, intensity, 0.0) };
        let spot = |position, intensity, axis, cosines| Light::Spot {
            position,
            axis,
            intensity: Vec3::new(0.0, 0.0, intensity),
            cosines,
        };
        let quad = |corner, u, v, radiance| Light::Quad { corner, u, v, radiance: Vec3::splat(radiance) };
        for good in [
            point(far, MAX_INTENSITY),
            spot(far, MAX_INTENSITY, Vec3::Y, [1.0, -1.0]),
            spot(Vec3::ZERO, 1.0, Vec3::Y, [1.0, 1.0]),
            spot(Vec3::ZERO, 1.0, Vec3::Y, [-1.0, -1.0]),
            quad(far, far, far, MAX_RADIANCE),
        ] {
            assert!(good.is_valid(), "{good:?}");
        }
        let out = 1.01 * far;
        for bad in [
            point(out, 1.0),
            point(Vec3::ZERO, 1.01 * MAX_INTENSITY),
            point(Vec3::NAN, 1.0),
            spot(out, 1.0, Vec3::Y, [1.0, 0.0]),
            spot(far, 1.01 * MAX_INTENSITY, Vec3::Y, [1.0, 0.0]),
            spot(far, 1.0, 1.1 * Vec3::Y, [1.0, 0.0]),
            spot(far, 1.0, Vec3::Y, [1.01, 0.0]),
            spot(far, 1.0, Vec3::Y, [1.5, 1.2]),
            spot(far, 1.0, Vec3::Y, [1.0, -1.01]),
            spot(far, 1.0, Vec3::Y, [-1.2, -1.5]),
            spot(far, 1.0, Vec3::Y, [0.4, 0.5]),
            quad(out, far, far, 1.0),
            quad(far, out, far, 1.0),
            quad(far, far, out, 1.0),
            quad(far, far, far, 1.01 * MAX_RADIANCE),
        ] {
            assert!(!bad.is_valid(), "{bad:?}");
        }
    }

    #[test]
    fn a_cone_fades_between_two_angles() {
        for (cosine, expected) in [(1.0, 1.0), (0.9, 1.0), (0.8, 0.25), (0.7, 0.0), (-1.0, 0.0)] {
            assert!((cone(cosine, [0.9, 0.7]) - expected).abs() < 1e-5, "{cosine}");
        }
        assert_eq!([cone(0.5, [0.5, 0.5]), cone(0.499, [0.5, 0.5])], [1.0, 0.0]);
    }
}
