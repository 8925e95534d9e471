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

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the coordinates of three corners with those that are expected.
    #[track_caller]
    fn check(shape: &ShapeSpec, corners: [[f32; 3]; 3], expected: [[f32; 2]; 3]) {
        let found = of_triangle(shape, corners.map(Vec3::from)).unwrap();
        let is_near = |(found, expected): (Vec2, [f32; 2])| found.distance(expected.into()) < 1e-6;
        assert!(found.into_iter().zip(expected).all(is_near), "{corners:?}: {found:?}, not {expected:?}");
    }

    #[test]
    fn an_image_goes_once_around_a_sphere_with_its_middle_at_the_front() {
        let sphere = ShapeSpec::Sphere { center: Vec3::new(1.0, 2.0, 3.0), radius: 2.0 };
        let [front, right, back, left] =
            [[1.0, 2.0, 5.0], [3.0, 2.0, 3.0], [1.0, 2.0, 1.0], [-1.0, 2.0, 3.0]];
        let [top, bottom] = [[1.0, 4.0, 3.0], [1.0, 0.0, 3.0]];
        // The poles are above and below the middle of each triangle, and the seam is at both ends of the image.
        check(&sphere, [front, right, top], [[0.5, 0.5], [0.75, 0.5], [0.625, 0.0]]);
        check(&sphere, [right, back, top], [[0.75, 0.5], [1.0, 0.5], [0.875, 0.0]]);
        check(&sphere, [left, back, bottom], [[0.25, 0.5], [0.0, 0.5], [0.125, 1.0]]);
        // Half way up, a third of the way from the pole, and as far down.
        let [up, down] = [1.0, -1.0].map(|y| [1.0 + 3_f32.sqrt(), 2.0 + y, 3.0]);
        check(&sphere, [right, back, up], [[0.75, 0.5], [1.0, 0.5], [0.75, 1.0 / 3.0]]);
        check(&sphere, [right, back, down], [[0.75, 0.5], [1.0, 0.5], [0.75, 2.0 / 3.0]]);
        // Poles that rounding moves beyond the radius.
        let small = ShapeSpec::Sphere { center: Vec3::new(0.0, 0.1, 0.0), radius: 0.2 };
        let (top, bottom) = ([0.0, 0.3, 0.0], [0.0, -0.100_000_024, 0.0]);
        let [front, right] = [[0.0, 0.1, 0.2], [0.2, 0.1, 0.0]];
        check(&small, [front, right, top], [[0.5, 0.5], [0.75, 0.5], [0.625, 0.0]]);
        check(&small, [front, right, bottom], [[0.5, 0.5], [0.75, 0.5], [0.625, 1.0]]);
    }

    #[test]
    fn an_image_goes_once_around_a_cylinder_and_its_ends_cut_circles_out() {
        let cylinder = ShapeSpec::Cylinder { base: Vec3::new(1.0, 2.0, 3.0), radius: 2.0, height: 4.0 };
        let at = |[x, z]: [f32; 2], y: f32| [1.0 + 2.0 * x, y, 3.0 + 2.0 * z];
        let [middle, front, right, left, back] = [[0.0; 2], [0.0, 1.0], [1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]];
        check(
            &cylinder,
            [at(front, 2.0), at(right, 2.0), at(right, 6.0)],
            [[0.5, 1.0], [0.75, 1.0], [0.75, 0.0]],
        );
        check(
            &cylinder,
            [at(back, 2.0), at(left, 2.0), at(left, 5.0)],
            [[0.0, 1.0], [0.25, 1.0], [0.25, 0.25]],
        );
        check(
            &cylinder,
            [middle, front, right].map(|corner| at(corner, 6.0)),
            [[0.5; 2], [0.5, 1.0], [1.0, 0.5]],
        );
        check(
            &cylinder,
            [middle, right, front].map(|corner| at(corner, 2.0)),
            [[0.5; 2], [1.0, 0.5], [0.5, 0.0]],
        );
    }

    #[test]
    fn an_image_covers_each_side_of_a_box_and_reads_from_outside() {
        // In any order of its corners.
        let [low, high] = [Vec3::new(1.0, 4.0, 3.0), Vec3::new(2.0, 2.0, 6.0)];
        let cuboid = ShapeSpec::Box { low, high };
        // The lower left corner, the lower right one and the one above it, of the sides to the right, left, front and back.
        let upright = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];
        check(&cuboid, [[2.0, 2.0, 6.0], [2.0, 2.0, 3.0], [2.0, 4.0, 3.0]], upright);
        check(&cuboid, [[1.0, 2.0, 3.0], [1.0, 2.0, 6.0], [1.0, 4.0, 6.0]], upright);
        check(&cuboid, [[1.0, 2.0, 6.0], [2.0, 2.0, 6.0], [2.0, 4.0, 6.0]], upright);
        check(&cuboid, [[2.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0, 4.0, 3.0]], upright);
        // What looks up has -z on top, what looks down +z.
        let lying = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        check(&cuboid, [[1.0, 4.0, 3.0], [1.0, 4.0, 6.0], [2.0, 4.0, 6.0]], lying);
        check(&cuboid, [[1.0, 2.0, 6.0], [1.0, 2.0, 3.0], [2.0, 2.0, 3.0]], lying);
    }

    #[test]
    fn an_image_covers_a_slanted_quad() {
        let quad =
            ShapeSpec::Quad { corner: Vec3::ONE, u: Vec3::new(2.0, 0.0, 1.0), v: Vec3::new(1.0, 3.0, 0.0) };
        check(&quad, [[1.0; 3], [3.0, 1.0, 2.0], [4.0, 4.0, 2.0]], [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
        assert_eq!(of_triangle(&ShapeSpec::File("a.obj".into()), [Vec3::ZERO; 3]), None);
    }
}
