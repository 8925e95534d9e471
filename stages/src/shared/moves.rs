//! Rigid motions as matrices, and how lights have moved. Mirrored by `shaders/shared/moves.wgsl`.

use epigraph_scenes::{Light, Pose};
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

epigraph_core::item! {
    /// A light, or the middle of one with an area, seen from afar.
    pub struct Lamp {
        /// Where it is, metres.
        position: [f32; 3],
        /// Luminance of its radiant intensity: of a quad's, straight ahead. 0 for an entry that stands for no light.
        power: f32,
        /// The direction in which a quad emits, of unit length; zero for a point light.
        normal: [f32; 3],
        /// The share that it emits whatever the direction: 1 for a point light, 0 for a quad.
        uniform_share: f32,
    }
}

impl Lamp {
    /// Nothing.
    pub const NONE: Self = Self { position: [0.0; 3], power: 0.0, normal: [0.0; 3], uniform_share: 0.0 };

    /// A light of a scene.
    pub fn of(light: &Light) -> Self {
        let luminance = |color: Vec3| color.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        match *light {
            Light::Point { position, intensity } => Self {
                position: position.into(),
                power: luminance(intensity),
                normal: [0.0; 3],
                uniform_share: 1.0,
            },
            Light::Quad { corner, u, v, radiance } => {
                let (normal, area) = u.cross(v).normalize_and_length();
                let position = (corner + 0.5 * (u + v)).into();
                Self {
                    position,
                    power: area * luminance(radiance),
                    normal: normal.into(),
                    uniform_share: 0.0,
                }
            }
        }
    }

    /// Luminance of the light that it sends to a point where nothing is in the way, per area across its direction.
    pub fn at(&self, point: [f32; 3]) -> f32 {
        let towards: [f32; 3] = std::array::from_fn(|axis| point[axis] - self.position[axis]);
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let squared = dot(towards, towards).max(1e-12);
        let share = self.uniform_share + dot(self.normal, towards).max(0.0) / squared.sqrt();
        self.power * share / squared
    }
}
