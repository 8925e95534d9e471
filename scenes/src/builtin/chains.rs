//! Three chains hang from a beam. They cast shadows on each other and on the round floor below.
//!
//! The papers' scene of this name has 73,728 triangles and 110,592 edges (`algorithms.md` section 7.3), that is, 3/2
//! edges per triangle: all of its meshes are closed. This scene has the same counts: 22 links of 3,072 triangles, a
//! frame of three rods of 1,024 and a floor of 3,072, all closed. Its two lights are points and have no triangles.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine3A, Quat, Vec2, Vec3};

use crate::builder::{CREASE_ANGLE, MeshError, SceneBuilder};
use crate::{Camera, Material, Scene, Shape};

/// Radius of a link's wire, metres.
const WIRE: f32 = 0.036;
/// Radius of the half circles at both ends of a link, measured to the middle of the wire, metres.
const BEND: f32 = 0.086;
/// Half the length of a link's straight sides, metres.
const STRAIGHT: f32 = 0.075;
/// Numbers of facets along a link (a multiple of 4) and around its wire.
const ALONG: u32 = 64;
const AROUND: u32 = 24;
/// Gap between objects that touch, metres: meshes that interpenetrate have no edge where they meet.
const GAP: f32 = 0.001;

const BEAM_RADIUS: f32 = 0.04;
const BEAM_HEIGHT: f32 = 2.2;
const POST_X: f32 = 1.0;

pub(super) fn scene() -> Result<Scene, MeshError> {
    let mut builder = SceneBuilder::new();
    let mut glossy = |name: &str, color: [f32; 3], roughness: f32, f0: f32| {
        builder.material(Material::glossy(name, color.into(), roughness, f0))
    };
    let steel = glossy("steel", [0.32, 0.34, 0.37], 0.35, 0.25);
    let brass = glossy("brass", [0.62, 0.42, 0.13], 0.35, 0.25);
    let copper = glossy("copper", [0.60, 0.24, 0.13], 0.35, 0.25);
    let frame = glossy("frame", [0.10, 0.13, 0.18], 0.4, 0.04);
    let floor = builder.material(Material::diffuse("floor", Vec3::new(0.62, 0.60, 0.56)));

    builder.add(&round_floor(), floor)?;
    let post = rod(0.055, BEAM_HEIGHT - BEAM_RADIUS - 2.0 * GAP);
    for x in [-POST_X, POST_X] {
        builder.add(&post.moved(Vec3::new(x, GAP, 0.0)), frame)?;
    }
    let length = 2.0 * POST_X + 0.3;
    let lie = Affine3A::from_rotation_translation(
        Quat::from_rotation_z(FRAC_PI_2),
        Vec3::new(0.5 * length, BEAM_HEIGHT, 0.0),
    );
    builder.add(&rod(BEAM_RADIUS, length).transformed(lie), frame)?;

    let link = link();
    for (x, links, swing, material) in
        [(-0.52, 7, -8.0_f32, steel), (0.0, 8, 3.0, brass), (0.52, 7, 10.0, copper)]
    {
        let swing = Affine3A::from_translation(Vec3::new(x, BEAM_HEIGHT, 0.0))
            * Affine3A::from_rotation_x(swing.to_radians());
        // The beam passes through the upper bend of the first link. Each of the others hangs from the link above it.
        let first = BEAM_RADIUS + GAP - (STRAIGHT + BEND - WIRE);
        let pitch = 2.0 * (STRAIGHT + BEND - WIRE) - GAP;
        for i in 0..links {
            // Links are alternately parallel and perpendicular to the beam, and the chain is slightly twisted.
            let twist = FRAC_PI_2 * (i + 1) as f32 + 0.11 * i as f32;
            let hang = Affine3A::from_rotation_translation(
                Quat::from_rotation_y(twist),
                Vec3::new(0.0, first - pitch * i as f32, 0.0),
            );
            builder.add(&link.transformed(swing * hang), material)?;
        }
    }

    builder.point_light(Vec3::new(-2.8, 3.1, 2.0), Vec3::new(42.0, 38.0, 33.0));
    builder.point_light(Vec3::new(2.2, 2.6, 3.2), Vec3::new(10.0, 13.0, 18.0));
    let camera =
        Camera::look_at(Vec3::new(0.9, 1.85, 4.5), Vec3::new(0.0, 1.02, 0.0), 34_f32.to_radians(), 0.1, 20.0);
    builder.build("chains", camera, Vec3::new(0.03, 0.04, 0.06), 0.0, CREASE_ANGLE)
}

/// A link in the xy plane, centred on the origin, its long axis along y.
fn link() -> Shape {
    let quarter = ALONG / 4;
    let centre_line = move |i: u32| {
        // Two half circles of ALONG / 2 points each. The straight sides connect their ends.
        let (half, step) = (i / (2 * quarter), i % (2 * quarter));
        let angle = PI * step as f32 / (2 * quarter - 1) as f32;
        let bend = BEND * Vec3::new(angle.cos(), angle.sin(), 0.0) + STRAIGHT * Vec3::Y;
        if half == 0 { bend } else { Vec3::new(-bend.x, -bend.y, 0.0) }
    };
    Shape::ring(ALONG, AROUND, WIRE, centre_line, |_| Vec3::Z)
}

/// A round rod that extends from the origin along y and has rounded ends: 1,024 triangles.
fn rod(radius: f32, length: f32) -> Shape {
    const ROUNDING: u32 = 7;
    let end = 0.35 * radius;
    let mut profile = vec![Vec2::ZERO];
    for (base, first) in [(end, -FRAC_PI_2), (length - end, 0.0)] {
        profile.extend((0..=ROUNDING).map(|k| {
            let angle = first + FRAC_PI_2 * k as f32 / ROUNDING as f32;
            Vec2::new(radius - end + end * angle.cos(), base + end * angle.sin())
        }));
    }
    profile.push(Vec2::new(0.0, length));
    Shape::lathe(&profile, 32)
}

/// A round plate with a rounded upper rim and its upper side at y = 0: 3,072 triangles.
fn round_floor() -> Shape {
    const RADIUS: f32 = 1.9;
    const THICKNESS: f32 = 0.12;
    const RIM: f32 = 0.05;
    let mut profile = vec![Vec2::new(0.0, -THICKNESS), Vec2::new(RADIUS, -THICKNESS)];
    profile.extend((0..=6).map(|k| {
        let angle = FRAC_PI_2 * k as f32 / 6.0;
        Vec2::new(RADIUS - RIM + RIM * angle.cos(), RIM * (angle.sin() - 1.0))
    }));
    profile.extend([1.4, 0.9, 0.5, 0.2, 0.0].map(|radius| Vec2::new(radius, 0.0)));
    Shape::lathe(&profile, 128)
}
