//! Rigid motions as matrices. Mirrored by `shaders/shared/moves.wgsl`.

use epigraph_scenes::Pose;
use glam::{Mat3, Vec3};

epigraph_core::item! {
    /// A rigid motion.
    pub struct Move {
        /// Row of the new x: factors of x, y, z and 1.
        x: [f32; 4],
        /// Row of the new y.
        y: [f32; 4],
        /// Row of the new z.
        z: [f32; 4],
    }
}

impl Move {
    /// The motion of a body that rests.
    pub const REST: Self = Self { x: [1.0, 0.0, 0.0, 0.0], y: [0.0, 1.0, 0.0, 0.0], z: [0.0, 0.0, 1.0, 0.0] };

    /// The motion that takes a body from rest to a pose.
    pub fn of(pose: &Pose) -> Self {
        let rows = Mat3::from_quat(pose.rotation).transpose();
        let row = |row: Vec3, shift: f32| row.extend(shift).to_array();
        let Vec3 { x, y, z } = pose.translation;
        Self { x: row(rows.x_axis, x), y: row(rows.y_axis, y), z: row(rows.z_axis, z) }
    }

    /// Where it takes a point.
    pub fn point(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        [self.x, self.y, self.z].map(|row| row[0] * x + row[1] * y + row[2] * z + row[3])
    }
}
