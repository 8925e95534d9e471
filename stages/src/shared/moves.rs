//! Rigid motions as matrices, lights, and the boxes of bodies that may stand in their way. Mirrored by `shaders/shared/moves.wgsl`.

use epigraph_scenes::{Body, Light, Pose};
use glam::{Mat3, Vec3};

use super::{color::luminance, view::dot};

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

epigraph_core::constants! {
    /// A quad's light at less than this cosine to its normal counts as none: that of its own points would be a rounding.
    const GRAZING: f32 = 1e-3;
}

epigraph_core::item! {
    /// A light, or the middle of one with an area, seen from afar.
    pub struct Lamp {
        /// Where it is, metres.
        position: [f32; 3],
        /// Luminance of its radiant intensity: of a quad's, straight ahead. 0 for an entry that stands for no light, after all
        /// others.
        power: f32,
        /// The direction in which a quad emits, of unit length; zero for a point light.
        normal: [f32; 3],
        /// The share that it emits whatever the direction: 1 for a point light, 0 for a quad.
        uniform_share: f32,
        /// How far from its position it reaches, metres; 0 for a point light.
        radius: f32,
        /// Keeps the size a multiple of 16 bytes.
        pad: u32,
        /// Likewise.
        more: [u32; 2],
    }
}

impl Lamp {
    /// Nothing.
    pub const NONE: Self = Self {
        position: [0.0; 3],
        power: 0.0,
        normal: [0.0; 3],
        uniform_share: 0.0,
        radius: 0.0,
        pad: 0,
        more: [0; 2],
    };

    /// A light of a scene.
    pub fn of(light: &Light) -> Self {
        match *light {
            Light::Point { position, intensity } => Self {
                position: position.into(),
                power: luminance(intensity.into()),
                uniform_share: 1.0,
                ..Self::NONE
            },
            Light::Quad { corner, u, v, radiance } => {
                let (normal, area) = u.cross(v).normalize_and_length();
                Self {
                    position: (corner + 0.5 * (u + v)).into(),
                    power: area * luminance(radiance.into()),
                    normal: normal.into(),
                    radius: 0.5 * (u + v).length().max((u - v).length()),
                    ..Self::NONE
                }
            }
        }
    }

    /// Luminance of the light that it sends to a point where nothing is in the way, per area across its direction.
    pub fn at(&self, point: [f32; 3]) -> f32 {
        let towards = difference(point, self.position);
        let squared = dot(towards, towards).max(1e-12);
        let cosine = dot(self.normal, towards) / squared.sqrt();
        let share = self.uniform_share + (cosine - GRAZING).max(0.0);
        self.power * share / squared
    }
}

epigraph_core::item! {
    /// The box of a body, in its pose.
    pub struct Blocker {
        /// Rows that take a point to where the body is at rest, and the middle of its box the origin.
        x: [f32; 4],
        /// Likewise.
        y: [f32; 4],
        /// Likewise.
        z: [f32; 4],
        /// Half of its sides, metres.
        extent: [f32; 3],
        /// Number of the body; 0 for an entry that stands for none, after all others.
        body: u32,
    }
}

impl Blocker {
    /// Nothing.
    pub const NONE: Self =
        Self { x: Move::REST.x, y: Move::REST.y, z: Move::REST.z, extent: [0.0; 3], body: 0 };

    /// The body of that number in a pose; nothing if it has no surface.
    pub fn of(body: &Body, number: u32, pose: &Pose) -> Self {
        let [low, high] = body.bounds_at_rest();
        if low.x > high.x {
            return Self::NONE;
        }
        let mut to_rest = pose.inverse();
        to_rest.translation -= 0.5 * (low + high);
        let Move { x, y, z } = Move::of(&to_rest);
        Self { x, y, z, extent: (0.5 * (high - low)).into(), body: number }
    }

    /// Whether it may cover a part of a lamp from a point: whether the line between them meets the box, grown by as much
    /// of the lamp's radius as the lines to the rest of the lamp are apart there.
    pub fn covers(&self, lamp: &Lamp, point: [f32; 3]) -> bool {
        let here = Move { x: self.x, y: self.y, z: self.z };
        let start = here.point(point);
        let along = difference(here.point(lamp.position), start);
        let nearest = (-dot(start, along) / dot(along, along).max(1e-12)).clamp(0.0, 1.0);
        // Most lines pass far from the box, which a ball around it tells.
        let middle: [f32; 3] = std::array::from_fn(|axis| start[axis] + nearest * along[axis]);
        let ball = dot(self.extent, self.extent).sqrt() + 2.0 * lamp.radius * nearest;
        if dot(middle, middle) > ball * ball {
            return false;
        }
        let (mut enter, mut leave) = (0f32, 1f32);
        for axis in 0..3 {
            let extent = self.extent[axis] + lamp.radius * nearest;
            // A line along the slab is in it or not: the quotients are then far beyond 0 and 1.
            let slope = if along[axis].abs() < 1e-12 { 1e-12 } else { along[axis] };
            let (a, b) = ((-extent - start[axis]) / slope, (extent - start[axis]) / slope);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter <= leave
    }
}

fn difference(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAMP: Lamp = Lamp { position: [0.0, 4.0, 0.0], power: 1.0, uniform_share: 1.0, ..Lamp::NONE };

    #[test]
    fn a_box_covers_what_lies_in_its_shadow() {
        // A cube of half side 1 around (0, 2, 0), lit from 4: its shadow on the floor ends at 4, that of its upper edge.
        let rows = Move { y: [0.0, 1.0, 0.0, -2.0], ..Move::REST };
        let cube = Blocker { x: rows.x, y: rows.y, z: rows.z, extent: [1.0; 3], body: 1 };
        for (x, covered) in [(0.0, true), (3.99, true), (4.01, false), (-3.99, true), (-4.01, false)] {
            assert_eq!(cube.covers(&LAMP, [x, 0.0, 0.5]), covered, "{x}");
        }
        assert!(!cube.covers(&LAMP, [0.0, 5.0, 0.0]), "it lies behind the lamp");
        // Of a lamp with an area a part is covered farther out.
        let wide = Lamp { radius: 0.2, ..LAMP };
        assert!(cube.covers(&wide, [4.4, 0.0, 0.0]) && !cube.covers(&wide, [9.0, 0.0, 0.0]));
    }
}
