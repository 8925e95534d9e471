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
            Self::Quad { corner, u, v, radiance } => {
                is_near(corner) && is_near(u) && is_near(v) && is_radiance(radiance)
            }
        }
    }
}
