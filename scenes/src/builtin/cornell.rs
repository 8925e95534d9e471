//! The Cornell box, from the measurements that the Cornell University Program of Computer Graphics published.
//!
//! Positions are the published ones, converted from millimetres to metres. Their x axis points to the left of the
//! picture, y up and z away from the camera: a right-handed frame like ours, so that no axis has to be flipped.
//! Reflectance spectra are converted to linear Rec. 709 colours, and the light's emission to an RGB radiance of the
//! same hue.

use glam::Vec3;

use crate::builder::{CREASE_ANGLE, MeshError, SceneBuilder};
use crate::{Camera, Material, Scene, Shape};

const WHITE: Vec3 = Vec3::new(0.725, 0.71, 0.68);
const RED: Vec3 = Vec3::new(0.63, 0.065, 0.05);
const GREEN: Vec3 = Vec3::new(0.14, 0.45, 0.091);
const LIGHT: Vec3 = Vec3::new(17.0, 12.0, 4.0);

/// Distance of the light below the ceiling, millimetres. The published light lies in a hole of the ceiling; here the
/// ceiling has no hole.
const LIGHT_DROP: f32 = 1.0;

pub(super) fn scene() -> Result<Scene, MeshError> {
    let mut builder = SceneBuilder::new();
    let [white, red, green] = [("white", WHITE), ("red", RED), ("green", GREEN)]
        .map(|(name, color)| builder.material(Material::diffuse(name, color)));

    let floor = [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]];
    let ceiling = [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]];
    let back = [floor[3], floor[2], ceiling[2], ceiling[1]];
    let right = [floor[2], floor[1], ceiling[3], ceiling[2]];
    let left = [floor[0], floor[3], ceiling[1], ceiling[0]];
    for (corners, material) in [(floor, white), (ceiling, white), (back, white), (right, green), (left, red)]
    {
        builder.add(&Shape::quad(corners.map(metres)), material)?;
    }

    let short = [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]];
    let tall = [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]];
    for (outline, height) in [(short, 165.0), (tall, 330.0)] {
        let at = |y: f32| outline.map(|[x, z]| metres([x, y, z]));
        builder.add(&Shape::prism(&at(0.0), &at(height)), white)?;
    }

    let corner = metres([213.0, 548.8 - LIGHT_DROP, 227.0]);
    builder.quad_light(corner, metres([130.0, 0.0, 0.0]), metres([0.0, 0.0, 105.0]), LIGHT)?;

    // 39.3 degrees: a film of 25 mm behind a lens of 35 mm.
    let camera = Camera::look_at(
        metres([278.0, 273.0, -800.0]),
        metres([278.0, 273.0, 0.0]),
        2.0 * (12.5_f32 / 35.0).atan(),
        0.1,
        5.0,
    );
    builder.build("cornell", camera, Vec3::ZERO, 0.0, CREASE_ANGLE)
}

fn metres(millimetres: [f32; 3]) -> Vec3 {
    Vec3::from(millimetres) / 1000.0
}
