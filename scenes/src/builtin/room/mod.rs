//! A furnished living room for global illumination. Its lights are a window, a pendant lamp and a desk lamp; its
//! objects are diffuse, glossy or mirrors. It has about as many triangles as the papers' room (101k, `algorithms.md`
//! section 7.3).
//!
//! Objects stand exactly on their support or [`GAP`] away from it: meshes that interpenetrate have no edge where they
//! meet.

mod furniture;
mod objects;
mod paint;

use glam::{Affine3A, Vec3};

use crate::builder::{CREASE_ANGLE, MeshError, SceneBuilder};
use crate::{Camera, Scene, Shape};
use paint::Paint;

/// Gap between objects that touch, metres.
const GAP: f32 = 0.001;

/// The room extends in x from -HALF_WIDTH (the window) to HALF_WIDTH, in z from -HALF_DEPTH to HALF_DEPTH (behind the
/// camera), and in y from 0 to HEIGHT, metres.
const HALF_WIDTH: f32 = 2.5;
const HALF_DEPTH: f32 = 2.2;
const HEIGHT: f32 = 2.7;

/// The position of the desk lamp, metres, and its rotation about the vertical axis, degrees.
const DESK_LAMP_AT: [f32; 3] = [2.2, furniture::DESK_HEIGHT, -0.52];
const DESK_LAMP_TURN: f32 = -20.0;

/// A part of an object: its material and its shape.
type Piece = (Paint, Shape);

/// Adds an object, rotated by `degrees` about its vertical axis and moved to `at`.
fn place(
    builder: &mut SceneBuilder,
    pieces: Vec<Piece>,
    at: [f32; 3],
    degrees: f32,
) -> Result<(), MeshError> {
    let transform = Affine3A::from_translation(at.into()) * Affine3A::from_rotation_y(degrees.to_radians());
    pieces.iter().try_for_each(|(paint, shape)| builder.add(&shape.transformed(transform), *paint as u32))
}

pub(super) fn scene() -> Result<Scene, MeshError> {
    let mut builder = SceneBuilder::new();
    for paint in Paint::ALL {
        builder.material(paint.material());
    }
    let b = &mut builder;
    shell(b)?;
    lights(b)?;

    place(b, furniture::sofa(), [-0.48, 0.0, -1.62], 0.0)?;
    place(b, furniture::armchair(), [-1.62, 0.0, 0.15], 68.0)?;
    place(b, furniture::shelf(), [1.72, 0.0, -2.02], 0.0)?;
    place(b, furniture::desk(), [2.14, 0.0, 0.05], -90.0)?;
    place(b, furniture::chair(), [1.46, 0.0, 0.05], 78.0)?;
    place(
        b,
        vec![(Paint::Rug, Shape::rounded_box(Vec3::new(0.7, 0.008, 0.72), 0.007, 4))],
        [-0.26, 0.008, -0.3],
        0.0,
    )?;
    let table_at = [-0.42, 0.016, -0.33];
    place(b, furniture::coffee_table(), table_at, 15.0)?;

    let on_table =
        |x: f32, z: f32| [table_at[0] + x, table_at[1] + furniture::COFFEE_TABLE_HEIGHT, table_at[2] + z];
    place(b, objects::vase(Paint::Ceramic, 0.24), on_table(-0.2, -0.14), 0.0)?;
    place(b, objects::fruit_bowl(), on_table(0.14, -0.04), 0.0)?;
    place(b, objects::cup(), on_table(-0.1, 0.2), 35.0)?;
    place(b, objects::book_pile(), on_table(0.12, 0.27), -12.0)?;

    place(b, objects::desk_lamp(), DESK_LAMP_AT, DESK_LAMP_TURN)?;
    place(b, objects::laptop(), [2.14, furniture::DESK_HEIGHT, 0.08], -90.0)?;
    place(b, objects::cup(), [1.98, furniture::DESK_HEIGHT, 0.5], 160.0)?;
    place(b, objects::plant(), [-2.03, 0.0, -1.77], 0.0)?;
    place(b, objects::vase(Paint::Copper, 0.55), [0.86, 0.0, -1.9], 0.0)?;
    for (x, degrees) in [(-1.35, 0.0), (0.37, 180.0)] {
        place(b, objects::curtain(), [-HALF_WIDTH + 0.1, 0.03, x], degrees)?;
    }
    place(b, objects::round_mirror(), [-0.95, 1.62, -HALF_DEPTH + GAP], 0.0)?;
    for (x, y, size, picture) in [
        (0.15, 1.72, [0.24, 0.3], Paint::PictureBlue),
        (0.62, 1.82, [0.16, 0.2], Paint::PictureRed),
        (0.62, 1.4, [0.16, 0.14], Paint::PictureYellow),
    ] {
        place(b, objects::picture(size, picture), [x, y, -HALF_DEPTH + GAP], 0.0)?;
    }

    let camera = Camera::look_at(
        Vec3::new(1.0, 1.53, 2.13),
        Vec3::new(-0.1, 0.86, -0.9),
        62_f32.to_radians(),
        0.05,
        8.0,
    );
    builder.build("room", camera, Vec3::ZERO, 0.0, CREASE_ANGLE)
}

/// The floor, the ceiling and the walls, all facing inwards, and the skirting boards.
fn shell(b: &mut SceneBuilder) -> Result<(), MeshError> {
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x * HALF_WIDTH, y * HEIGHT, z * HALF_DEPTH);
    let [a0, b0, c0, d0] =
        [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, z)| corner(x, 0.0, z));
    let [a1, b1, c1, d1] = [a0, b0, c0, d0].map(|p| p + HEIGHT * Vec3::Y);
    for (paint, corners) in [
        (Paint::Floor, [a0, b0, c0, d0]),
        (Paint::Ceiling, [a1, d1, c1, b1]),
        (Paint::Wall, [d0, c0, c1, d1]),
        (Paint::Wall, [a0, d0, d1, a1]),
        (Paint::AccentWall, [c0, b0, b1, c1]),
        (Paint::Wall, [b0, a0, a1, b1]),
    ] {
        b.add(&Shape::quad(corners), paint as u32)?;
    }
    for (at, half) in [
        ([0.0, 0.05, -HALF_DEPTH + 0.008], [HALF_WIDTH - 0.03, 0.05, 0.007]),
        ([-HALF_WIDTH + 0.008, 0.05, 0.0], [0.007, 0.05, HALF_DEPTH - 0.03]),
        ([HALF_WIDTH - 0.008, 0.05, 0.0], [0.007, 0.05, HALF_DEPTH - 0.03]),
    ] {
        place(b, vec![(Paint::White, Shape::rounded_box(half.into(), 0.004, 2))], at, 0.0)?;
    }
    Ok(())
}

fn lights(b: &mut SceneBuilder) -> Result<(), MeshError> {
    // The window: a bright pane just off the left wall, with a frame in front of it.
    let (low, high) =
        (Vec3::new(-HALF_WIDTH + 0.004, 0.95, -1.16), Vec3::new(-HALF_WIDTH + 0.004, 2.3, 0.18));
    let [width, height] = [high.z - low.z, high.y - low.y];
    b.quad_light(low, height * Vec3::Y, width * Vec3::Z, Vec3::new(5.2, 6.1, 7.4))?;
    let frame = objects::window_frame(width, height);
    place(b, frame, [low.x + GAP, low.y, 0.5 * (low.z + high.z)], 0.0)?;

    // The pendant lamp over the table.
    let drop = 0.85;
    let at = [-0.42, HEIGHT - drop, -0.33];
    place(b, objects::pendant(drop), at, 0.0)?;
    let half = 0.1;
    let corner = Vec3::from(at) + Vec3::new(-half, 0.06, -half);
    b.quad_light(corner, 2.0 * half * Vec3::X, 2.0 * half * Vec3::Z, Vec3::new(34.0, 27.0, 18.0))?;

    // The light in the shade of the desk lamp.
    let [x, y, z] = objects::DESK_LAMP_LIGHT;
    let turn = Affine3A::from_translation(DESK_LAMP_AT.into())
        * Affine3A::from_rotation_y(DESK_LAMP_TURN.to_radians());
    let half = 0.035;
    let corner = turn.transform_point3(Vec3::new(x - half, y, z - half));
    let [u, v] = [Vec3::X, Vec3::Z].map(|axis| turn.transform_vector3(2.0 * half * axis));
    b.quad_light(corner, u, v, Vec3::new(80.0, 60.0, 36.0))
}
