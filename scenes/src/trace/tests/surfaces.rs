//! What a ray's first surface looks like, without light.

use glam::Vec2;

use super::*;
use crate::{Map, Maps, Texture};

/// A floor that faces up, seen from above.
fn seen(material: Material, color: f32) -> Surface {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, material, color);
    stage.tracer().surface(Vec3::new(0.25, 2.0, 0.5), Vec3::new(0.0, -4.0, 0.0), 0.0).unwrap()
}

#[test]
fn albedo_is_the_sum_of_what_the_lobes_scatter() {
    let all = |value: f32| Vec3::splat(value);
    let Surface { position, normal, albedo, emission, roughness, .. } = seen(diffuse(), 0.3);
    assert_eq!((position, normal), (Vec3::new(0.25, 0.0, 0.5), UP));
    assert_eq!((albedo, emission, roughness), (all(0.3), Vec3::ZERO, 1.0));
    assert_eq!(seen(glossy(0.4, 0.25), 0.5).albedo, all(0.75));
    assert_eq!(seen(glossy(0.4, 0.05), 0.3).roughness, 0.4);
    assert_eq!(seen(Material::metal("", Vec3::ONE, 0.2), 0.3).albedo, all(0.3));
    assert_eq!(seen(Material::glass("", Vec3::ONE, 1.5), 1.0).albedo, all(1.04));
    let half = Material { metallic: 0.5, f0: 0.1, ..diffuse() };
    assert_eq!(seen(half, 0.5).albedo, all(0.55));
    let unlit = seen(Material { unlit: true, ..diffuse() }, 0.3);
    assert_eq!((unlit.albedo, unlit.emission), (Vec3::ZERO, all(0.3)));
}

#[test]
fn only_the_sides_of_a_lamp_that_emit_do_so() {
    for (double_sided, below) in [(false, 0.0), (true, 7.0)] {
        let mut stage = Stage::new(1.0);
        let lamp = Material { double_sided, ..diffuse() };
        stage.quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, lamp, 0.0, 7.0);
        let tracer = stage.tracer();
        let from = |y: f32| tracer.surface(Vec3::Y * y, Vec3::Y * -y, 0.0).unwrap();
        assert_eq!([from(1.0).emission.x, from(-1.0).emission.x], [7.0, below]);
        assert_eq!([from(1.0).normal.y, from(-1.0).normal.y], [1.0, -1.0]);
    }
    // What blends hides its share of what is behind, and emits as much less.
    let veil = Material { opacity: 0.25, alpha: Alpha::Blend, emission: Vec3::splat(8.0), ..diffuse() };
    let mut stage = Stage::new(1.0);
    stage.quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, veil, 0.0, 8.0);
    assert_eq!(stage.tracer().surface(Vec3::Y, -Vec3::Y, 0.0).unwrap().emission, Vec3::splat(2.0));
}

#[test]
fn maps_and_the_near_plane_count() {
    let mut stage = Stage::new(1.0);
    let map = |channel: usize| Some(Map { nearest: true, ..Map::new(0).of_channel(channel) });
    let maps = Maps { color: map(0), roughness: map(3), ..Maps::default() };
    floor(&mut stage, Material { maps, roughness: 0.5, ..diffuse() }, 0.5);
    let texels = vec![[255, 0, 0, 255], [0, 255, 0, 51]];
    stage.scene.textures = Arc::new(vec![Arc::new(Texture { name: String::new(), size: [2, 1], texels })]);
    let uv = |p: Vec3| Vec2::new(0.1 * p.x + 0.5, 0.5);
    let mesh = &stage.scene.mesh;
    let uvs = mesh.triangles.iter().map(|t| t.map(|i| uv(mesh.positions[i as usize]))).collect();
    stage.scene.mesh.corner_uvs = Arc::new([uvs, vec![]]);
    let tracer = stage.tracer();
    let at = |x: f32, start: f32| tracer.surface(Vec3::new(x, 1.0, 0.0), Vec3::new(0.0, -0.5, 0.0), start);
    let [left, right] = [-1.0, 1.0].map(|x| at(x, 0.0).unwrap());
    assert_eq!((left.albedo, left.roughness), (Vec3::new(0.5, 0.0, 0.0), 0.5));
    assert_eq!((right.albedo, right.roughness), (Vec3::new(0.0, 0.5, 0.0), 0.1));
    // The floor is two lengths of the direction away.
    assert!(at(1.0, 1.9).is_some() && at(1.0, 2.1).is_none());
}

#[test]
fn it_is_the_surface_of_the_sample() {
    for name in ["still-life", "cornell", "chains"] {
        let tracer = Tracer::new(Arc::new(Scene::load(name).unwrap()));
        let camera = tracer.scene().camera;
        let (mut hits, size) = (0, [64, 48]);
        for pixel in 0..64 * 48 {
            let [x, y] = [pixel % 64, pixel / 64].map(|side| side as f32 + 0.5);
            let direction = camera.direction(x, y, size);
            let settings = settings(Mode::Direct, 1);
            let hit = tracer.trace_from(camera.eye, direction, camera.near, &settings, &mut Rng::new(1, 1));
            let surface = tracer.surface(camera.eye, direction, camera.near);
            assert_eq!(
                surface.map(|surface| (surface.position, surface.face)),
                hit.hit.then_some((hit.position, hit.face))
            );
            hits += usize::from(hit.hit);
        }
        assert!(hits > 500, "{name}: {hits}");
    }
}
