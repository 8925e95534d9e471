//! The texture coordinates of the shapes of scene files: seen from outside, an image stands upright and reads from left to
//! right.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::file::ShapeSpec;

/// What happens to maps on meshes without coordinates for them.
pub(super) const WITHOUT_UVS: &str = "a texture where its mesh has no coordinates, by one texel";

/// The coordinates of the corners of one of a shape's triangles; `None` for shapes from elsewhere.
///
/// The image covers a quad, and each side of a box. It goes once around a sphere or a cylinder, with its middle at +z; the
/// ends of a cylinder cut a circle out of it. What looks up or down is seen with -z or +z on top.
pub(super) fn of_triangle(shape: &ShapeSpec, corners: [Vec3; 3]) -> Option<[Vec2; 3]> {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let middle = (a + b + c) / 3.0;
    match *shape {
        ShapeSpec::File(_) | ShapeSpec::Builtin(_) => None,
        ShapeSpec::Quad { corner, u, v } => {
            let [u, v] = [u, v].map(Vec3::as_dvec3);
            let front = u.cross(v);
            Some(corners.map(|point| {
                let from = (point - corner).as_dvec3();
                let shares =
                    [from.cross(v), u.cross(from)].map(|part| part.dot(front) / front.length_squared());
                Vec2::new(shares[0] as f32, 1.0 - shares[1] as f32)
            }))
        }
        ShapeSpec::Box { low, high } => {
            let [low, high] = [low.min(high), low.max(high)];
            // A flat box has no extent along one axis.
            let size = (high - low).max(Vec3::splat(f32::MIN_POSITIVE));
            Some(corners.map(|point| {
                let Vec3 { x, y, z } = (point - low) / size;
                match normal.abs().max_position() {
                    0 if normal.x > 0.0 => Vec2::new(1.0 - z, 1.0 - y),
                    0 => Vec2::new(z, 1.0 - y),
                    1 if normal.y > 0.0 => Vec2::new(x, z),
                    1 => Vec2::new(x, 1.0 - z),
                    _ if normal.z > 0.0 => Vec2::new(x, 1.0 - y),
                    _ => Vec2::new(1.0 - x, 1.0 - y),
                }
            }))
        }
        ShapeSpec::Sphere { center, radius } => Some(corners.map(|point| {
            let from_top = ((point.y - center.y) / radius).clamp(-1.0, 1.0).acos();
            Vec2::new(around(point - center, middle - center), from_top / PI)
        })),
        ShapeSpec::Cylinder { base, radius, height } => Some(corners.map(|point| {
            let from = point - base;
            if normal.y.abs() < 0.5 {
                return Vec2::new(around(from, middle - base), 1.0 - from.y / height);
            }
            let [right, down] = [from.x / radius, from.z / radius * normal.y.signum()];
            0.5 + 0.5 * Vec2::new(right, down)
        })),
    }
}

/// The share of a turn around the y axis, counter-clockwise from -z as seen from above, at a corner of the triangle around
/// `middle`.
fn around(point: Vec3, middle: Vec3) -> f32 {
    let turn = |point: Vec3| 0.5 + point.x.atan2(point.z) / TAU;
    let of_middle = turn(middle);
    if point.x == 0.0 && point.z == 0.0 {
        return of_middle;
    }
    // The corners of a triangle at the seam are on one side of it.
    let step = turn(point) - of_middle;
    of_middle + step - step.round()
}
