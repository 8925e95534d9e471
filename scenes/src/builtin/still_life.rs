//! Balls of gold, steel and glass on a wooden table before a tiled wall, behind a perforated screen: textures, metals, glass
//! and holes. Everything is made by code, in metres.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use crate::builder::{CREASE_ANGLE, MeshError, SceneBuilder};
use crate::{Alpha, Camera, Map, Maps, Material, Scene, Shape, Texture};

/// Texels along a side of each texture.
const SIDE: u32 = 256;

const BALL: f32 = 0.11;
/// Gap between objects that touch, metres: meshes that interpenetrate have no edge where they meet.
const GAP: f32 = 0.001;

pub(super) fn scene() -> Result<Scene, MeshError> {
    let mut builder = SceneBuilder::new();
    let mut texture = |name: &str, texel: fn(Vec2) -> [f32; 4]| {
        let texels = (0..SIDE * SIDE).map(|i| {
            let at = Vec2::new((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5) / SIDE as f32;
            texel(at).map(|share| (255.0 * share.clamp(0.0, 1.0)).round() as u8)
        });
        let texture = Texture { name: name.to_owned(), size: [SIDE; 2], texels: texels.collect() };
        Map::new(builder.texture(&Arc::new(texture)))
    };
    let [wood, tiles, bumps, holes] =
        [texture("wood", wood), texture("tiles", tiles), texture("bumps", bumps), texture("holes", holes)];

    let mapped = |material: Material, maps: Maps| Material { maps, ..material };
    let oak = builder.material(mapped(
        Material::glossy("oak", Vec3::ONE, 0.35, 0.04),
        Maps { color: Some(wood), ..Maps::default() },
    ));
    let wall = builder.material(mapped(
        Material::glossy("tiles", Vec3::ONE, 0.25, 0.04),
        Maps { color: Some(tiles), normal: Some((bumps, 1.0)), ..Maps::default() },
    ));
    let screen =
        Material { alpha: Alpha::Mask(0.5), ..Material::metal("screen", Vec3::new(0.30, 0.34, 0.40), 0.4) };
    let screen =
        builder.material(mapped(screen, Maps { opacity: Some(holes.of_channel(3)), ..Maps::default() }));
    let gold = builder.material(Material::metal("gold", Vec3::new(1.0, 0.77, 0.34), 0.2));
    let steel = builder.material(Material::metal("steel", Vec3::new(0.65, 0.66, 0.68), 0.0));
    let glass = builder.material(Material::glass("glass", Vec3::ONE, 1.5));
    let bulb = builder.material(Material::lamp("bulb", Vec3::new(14.0, 10.0, 6.0)));

    // A plank of half a metre is as wide as the texture.
    let above = |p: Vec3| Vec2::new(p.x / 0.5 + 0.25, p.z / 0.5);
    builder
        .add(&Shape::cuboid(Vec3::new(-0.7, -0.05, -0.45), Vec3::new(0.7, 0.0, 0.45)).with_uvs(above), oak)?;
    let before = |p: Vec3| Vec2::new(p.x / 0.6, -p.y / 0.6);
    let corners = [[-1.1, -0.05], [1.1, -0.05], [1.1, 1.0], [-1.1, 1.0]].map(|[x, y]| Vec3::new(x, y, -0.5));
    builder.add(&Shape::quad(corners).with_uvs(before), wall)?;
    let corners =
        [[-0.62, GAP], [-0.3, GAP], [-0.3, 0.36], [-0.62, 0.36]].map(|[x, y]| Vec3::new(x, y, 0.05));
    let across = |p: Vec3| Vec2::new((p.x + 0.62) / 0.32, (0.36 - p.y) / 0.32);
    builder.add(&Shape::quad(corners).with_uvs(across), screen)?;
    let ball = Shape::sphere(BALL, 96, 48);
    for (x, z, material) in [(-0.42, -0.2, gold), (0.0, -0.12, glass), (0.33, -0.22, steel)] {
        builder.add(&ball.moved(Vec3::new(x, BALL + GAP, z)), material)?;
    }
    builder.add(&Shape::sphere(0.03, 32, 16).moved(Vec3::new(0.25, 0.03 + GAP, 0.18)), bulb)?;
    builder.quad_light(
        Vec3::new(-0.5, 1.4, 0.6),
        Vec3::new(0.6, 0.0, 0.0),
        Vec3::new(0.0, -0.25, 0.4),
        Vec3::new(16.0, 16.0, 17.0),
    )?;
    let camera = Camera::look_at(Vec3::new(0.1, 0.42, 1.25), Vec3::new(0.0, 0.12, -0.1), 0.62, 0.05, 6.0);
    builder.build("still-life", camera, Vec3::ZERO, 0.0, CREASE_ANGLE)
}

/// Planks of bent growth rings.
fn wood(at: Vec2) -> [f32; 4] {
    let plank = (4.0 * at.y).floor();
    let bend = (std::f32::consts::TAU * at.x + plank).sin() * 0.02;
    let ring = (std::f32::consts::TAU * (9.0 * (4.0 * (at.y + bend)).fract() + 0.3 * plank)).sin();
    let joint = if (4.0 * at.y).fract() < 0.02 { 0.5 } else { 1.0 };
    let light = (0.8 + 0.09 * ring + 0.06 * (2.3 * plank).sin()) * joint;
    [0.78 * light, 0.58 * light, 0.40 * light, 1.0]
}

/// Squares of two blues with light joints.
fn tiles(at: Vec2) -> [f32; 4] {
    let cell = (4.0 * at).floor();
    if is_joint(at) {
        return [0.82, 0.81, 0.78, 1.0];
    }
    if (cell.x + cell.y) as i32 % 2 == 0 { [0.30, 0.48, 0.58, 1.0] } else { [0.72, 0.78, 0.80, 1.0] }
}

fn is_joint(at: Vec2) -> bool {
    let within = (4.0 * at).fract();
    within.min_element() < 0.05 || within.max_element() > 0.95
}

/// Tiles whose borders slope down to the joints, as a normal map.
fn bumps(at: Vec2) -> [f32; 4] {
    let within = (4.0 * at).fract() - 0.5;
    let slope =
        |offset: f32| if offset.abs() > 0.4 && offset.abs() < 0.45 { 0.6 * offset.signum() } else { 0.0 };
    let normal = Vec3::new(slope(within.x), -slope(within.y), 1.0).normalize();
    let [x, y, z] = (0.5 * normal + 0.5).to_array();
    [x, y, z, 1.0]
}

/// Round holes within a frame.
fn holes(at: Vec2) -> [f32; 4] {
    let within = (8.0 * at).fract() - 0.5;
    let frame = at.min_element() < 0.06 || at.max_element() > 0.94;
    let is_hole = !frame && within.length() < 0.33;
    [1.0, 1.0, 1.0, if is_hole { 0.0 } else { 1.0 }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_every_kind_of_material() {
        let scene = scene().unwrap();
        let any = |is: fn(&Material) -> bool| scene.materials.iter().any(is);
        assert!(any(|m| m.maps.color.is_some()) && any(|m| m.maps.normal.is_some()));
        assert!(any(|m| m.alpha == Alpha::Mask(0.5)) && any(|m| m.transmission == 1.0));
        assert!(any(|m| m.metallic == 1.0 && m.roughness == 0.0) && any(Material::emits));
        assert_eq!(scene.textures.len(), 4);
        assert!(scene.report.is_empty());
    }

    #[test]
    fn every_hole_lies_within_the_frame() {
        for i in 0..256 {
            let along = i as f32 / 255.0;
            let border =
                [Vec2::new(along, 0.0), Vec2::new(along, 1.0), Vec2::new(0.0, along), Vec2::new(1.0, along)];
            assert!(border.into_iter().all(|at| holes(at)[3] == 1.0));
        }
        assert_eq!(holes(Vec2::splat(0.5 + 1.0 / 16.0))[3], 0.0);
    }
}
