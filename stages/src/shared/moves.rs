//! Rigid motions as matrices, lights, and the boxes of bodies that may occlude them. Mirrored by
//! `shaders/shared/moves.wgsl`.

use epigraph_scenes::{Body, Light, Pose};
use glam::{Mat3, Vec3};

use super::{color::luminance, view::dot};

epigraph_core::item! {
    /// A rigid motion.
    pub struct Move {
        /// Row of the new x: coefficients of x, y, z and 1.
        x: [f32; 4],
        /// Row of the new y.
        y: [f32; 4],
        /// Row of the new z.
        z: [f32; 4],
    }
}

impl Move {
    /// The motion of a body at rest.
    pub const REST: Self = Self { x: [1.0, 0.0, 0.0, 0.0], y: [0.0, 1.0, 0.0, 0.0], z: [0.0, 0.0, 1.0, 0.0] };

    /// The motion that takes a body from its rest pose to a pose.
    pub fn of(pose: &Pose) -> Self {
        let rows = Mat3::from_quat(pose.rotation).transpose();
        let row = |row: Vec3, shift: f32| row.extend(shift).to_array();
        let Vec3 { x, y, z } = pose.translation;
        Self { x: row(rows.x_axis, x), y: row(rows.y_axis, y), z: row(rows.z_axis, z) }
    }

    /// The moved point.
    pub fn point(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        [self.x, self.y, self.z].map(|row| row[0] * x + row[1] * y + row[2] * z + row[3])
    }

    /// The point that is moved there: rotations are undone by their transpose.
    pub fn point_before(&self, moved: [f32; 3]) -> [f32; 3] {
        let rows = [self.x, self.y, self.z];
        let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| moved[axis] - rows[axis][3]);
        std::array::from_fn(|axis| rows[0][axis] * x + rows[1][axis] * y + rows[2][axis] * z)
    }
}

epigraph_core::constants! {
    /// A quad's light at less than this cosine to its normal counts as zero: at the quad's own points it would be a
    /// rounding error.
    const GRAZING: f32 = 1e-3;
}

epigraph_core::item! {
    /// A light, approximated by its centre if it has an area.
    pub struct Lamp {
        /// Where it is, metres.
        position: [f32; 3],
        /// Luminance of its radiant intensity; for a quad, along its normal. 0 for unused entries, which follow all
        /// others.
        power: f32,
        /// The unit direction in which a quad emits; zero for a point light.
        normal: [f32; 3],
        /// The share of its light that does not depend on direction: 1 for a point light, 0 for a quad.
        uniform_share: f32,
        /// Radius around its position, metres; 0 for a point light.
        radius: f32,
        /// Pads the size to a multiple of 16 bytes.
        pad: u32,
        /// Padding.
        more: [u32; 2],
    }
}

impl Lamp {
    /// An unused entry.
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
            // Outside its cone, a spot lights nothing; what it may light there does no harm.
            Light::Point { position, intensity } | Light::Spot { position, intensity, .. } => Self {
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

    /// Luminance of the unoccluded light at a point, per area perpendicular to its direction.
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
        /// Rows of the matrix that takes a point to the body's rest pose, with the middle of its box at the origin.
        x: [f32; 4],
        /// The second row.
        y: [f32; 4],
        /// The third row.
        z: [f32; 4],
        /// Half of its sides, metres.
        extent: [f32; 3],
        /// Number of the body; 0 for unused entries, which follow all others.
        body: u32,
    }
}

impl Blocker {
    /// An unused entry.
    pub const NONE: Self =
        Self { x: Move::REST.x, y: Move::REST.y, z: Move::REST.z, extent: [0.0; 3], body: 0 };

    /// The body with this number in a pose; an unused entry if it has no surface.
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

    /// Whether it may cover a part of a lamp from a point: whether the line between them hits the box, enlarged by the
    /// distance there between that line and the lines to the rim of the lamp.
    pub fn covers(&self, lamp: &Lamp, point: [f32; 3]) -> bool {
        let here = Move { x: self.x, y: self.y, z: self.z };
        let start = here.point(point);
        let along = difference(here.point(lamp.position), start);
        let nearest = (-dot(start, along) / dot(along, along).max(1e-12)).clamp(0.0, 1.0);
        // Most lines pass far from the box; a bounding sphere rejects them.
        let middle: [f32; 3] = std::array::from_fn(|axis| start[axis] + nearest * along[axis]);
        let ball = dot(self.extent, self.extent).sqrt() + 2.0 * lamp.radius * nearest;
        if dot(middle, middle) > ball * ball {
            return false;
        }
        let (mut enter, mut leave) = (0f32, 1f32);
        for axis in 0..3 {
            let extent = self.extent[axis] + lamp.radius * nearest;
            // A line parallel to a slab is inside or outside: the quotients are then far beyond 0 and 1.
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
    fn a_box_covers_the_points_in_its_shadow() {
        // A cube with sides of length 2 around (0, 2, 0), and a lamp at height 4: the shadow of its upper edge is at x
        // = 4 on the floor.
        let rows = Move { y: [0.0, 1.0, 0.0, -2.0], ..Move::REST };
        let cube = Blocker { x: rows.x, y: rows.y, z: rows.z, extent: [1.0; 3], body: 1 };
        for (x, covered) in [(0.0, true), (3.99, true), (4.01, false), (-3.99, true), (-4.01, false)] {
            assert_eq!(cube.covers(&LAMP, [x, 0.0, 0.5]), covered, "{x}");
        }
        assert!(!cube.covers(&LAMP, [0.0, 5.0, 0.0]), "the cube is behind the lamp");
        // If the lamp has an area, a part of it is covered from points farther out.
        let wide = Lamp { radius: 0.2, ..LAMP };
        assert!(cube.covers(&wide, [4.4, 0.0, 0.0]) && !cube.covers(&wide, [9.0, 0.0, 0.0]));
    }
}
