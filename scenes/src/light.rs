use glam::Vec3;

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
