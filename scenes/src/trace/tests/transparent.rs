//! What passes light, and what emits it: holes, blending, glass, both sides of a lamp, emissive triangles, textures and skies.

use glam::{DVec3, Vec2};

use super::*;
use crate::{Map, Maps, Medium, Sky, Texture};

/// A sheet of 2 x 2 m at height `y`, which faces up.
fn sheet(stage: &mut Stage, y: f32, material: Material) {
    let color = material.color.x;
    stage.quad(Vec3::new(-1.0, y, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, material, color, 0.0);
}

fn point_light(stage: &mut Stage, position: Vec3, intensity: f32) {
    stage.scene.lights.push(Light::Point { position, intensity: Vec3::splat(intensity) });
}

/// A floor below a sheet, with a point light 2 m above, and what the floor shows at the origin without the sheet.
fn under(material: Material) -> (Tracer, f32) {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.8);
    sheet(&mut stage, 1.0, material);
    point_light(&mut stage, 2.0 * UP, 3.0);
    (stage.tracer(), 0.8 / PI * 3.0 / 4.0)
}

/// The radiance of the floor at the origin, seen from below the sheet.
fn seen(tracer: &Tracer, mode: Mode) -> f32 {
    look(tracer, Vec3::new(0.1, 0.5, 0.0), Vec3::ZERO, &TraceSettings { spp: 64, mode, max_bounces: 0 })
        .radiance
        .x
}

#[test]
fn blending_sheets_pass_their_share() {
    for opacity in [0.0, 0.25, 1.0] {
        let (tracer, open) = under(Material { opacity, alpha: Alpha::Blend, ..diffuse() });
        for mode in [Mode::Direct, Mode::Path] {
            assert!((seen(&tracer, mode) - (1.0 - opacity) * open).abs() < 1e-5, "{opacity}, {mode:?}");
        }
        // From above, the sheet before the floor: its own light, and what comes through, twice.
        let settings = TraceSettings { spp: 1 << 14, mode: Mode::Direct, max_bounces: 2 };
        let found = look(&tracer, Vec3::new(0.05, 1.5, 0.0), Vec3::ZERO, &settings).radiance.x;
        let own = 1.0 / PI * 3.0;
        let expected = opacity * own + (1.0 - opacity).powi(2) * open;
        assert!((found / expected - 1.0).abs() < 0.02, "{opacity}: {found}, expected {expected}");
    }
}

#[test]
fn masks_cut_holes_for_eyes_and_light() {
    // Opaque left of the middle, a hole to the right.
    let build = |cutoff: f32| {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, diffuse(), 0.8);
        let maps =
            Maps { opacity: Some(Map { nearest: true, ..Map::new(0).of_channel(3) }), ..Maps::default() };
        sheet(&mut stage, 1.0, Material { alpha: Alpha::Mask(cutoff), maps, ..diffuse() });
        let texels = vec![[0, 0, 0, 255], [255, 255, 255, 100]];
        stage.scene.textures =
            Arc::new(vec![Arc::new(Texture { name: String::new(), size: [2, 1], texels })]);
        let uv = |p: Vec3| Vec2::new(0.5 * (p.x + 1.0), 0.5);
        let mesh = &stage.scene.mesh;
        let uvs = mesh.triangles.iter().map(|t| t.map(|i| uv(mesh.positions[i as usize]))).collect();
        stage.scene.mesh.corner_uvs = Arc::new([uvs, vec![]]);
        point_light(&mut stage, 2.0 * UP, 3.0);
        stage.tracer()
    };
    let tracer = build(0.5);
    let height = |x: f32| {
        look(&tracer, Vec3::new(x, 2.5, 0.1), Vec3::new(x, 0.0, 0.1), &settings(Mode::Direct, 1)).position.y
    };
    assert_eq!([height(-0.5), height(0.5)], [1.0, 0.0]);
    let lit = |x: f32| {
        look(&tracer, Vec3::new(x, 0.5, 0.1), Vec3::new(x, 0.0, 0.1), &settings(Mode::Direct, 1)).radiance.x
    };
    assert!(lit(-0.6) == 0.0 && lit(0.6) > 0.1);
    assert!(tracer.visible(Vec3::new(0.5, 2.0, 0.0), Vec3::new(0.5, 0.5, 0.0)));
    assert!(!tracer.visible(Vec3::new(-0.5, 2.0, 0.0), Vec3::new(-0.5, 0.5, 0.0)));
    // 100 of 255 is more than a quarter: no hole.
    let tracer = build(0.25);
    assert!(!tracer.visible(Vec3::new(0.5, 2.0, 0.0), Vec3::new(0.5, 0.5, 0.0)));
}

#[test]
fn rays_pass_through_culled_backs() {
    let culled = || Material { culled: true, ..diffuse() };
    let (above, below) = (Vec3::new(0.1, 1.5, 0.0), Vec3::new(0.1, 0.5, 0.0));
    for mode in [Mode::Direct, Mode::Path] {
        // The sheet faces up, to the light. The floor sees its back, which is not there.
        let (tracer, open) = under(culled());
        assert!((seen(&tracer, mode) - open).abs() < 1e-5, "{mode:?}");
        let height = |eye: Vec3, at: Vec3| look(&tracer, eye, at, &settings(mode, 1)).position.y;
        assert_eq!([height(above, Vec3::ZERO), height(below, Vec3::ZERO)], [1.0, 0.0]);
        assert!(!look(&tracer, below, above, &settings(mode, 1)).hit);
        assert!(tracer.visible(below, above) && !tracer.visible(above, below));
        assert!(tracer.reaches(above, below, || true) && !tracer.reaches(below, above, || true));
    }
    // One that faces down is a roof.
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.8);
    stage.quad(Vec3::new(-1.0, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, culled(), 0.5, 0.0);
    point_light(&mut stage, 2.0 * UP, 3.0);
    let tracer = stage.tracer();
    assert_eq!(seen(&tracer, Mode::Direct), 0.0);
    let through = look(&tracer, above, Vec3::ZERO, &settings(Mode::Direct, 1)).position.y;
    assert_eq!(through, 0.0);
    // A mirror below a sheet that faces up shows the sky.
    let mut stage = Stage::new(1.0);
    stage.scene.background = Vec3::ONE;
    floor(&mut stage, Material::mirror("", Vec3::ONE), 1.0);
    sheet(&mut stage, 1.0, culled());
    let mirrored = look(&stage.tracer(), below, Vec3::ZERO, &settings(Mode::Direct, 1)).radiance.x;
    assert_near(mirrored, 1.0, 1e-4);
}

#[test]
fn thin_clear_glass_passes_what_it_does_not_reflect() {
    let glass = Material { medium: None, ..Material::glass("", Vec3::new(0.9, 0.9, 0.9), 1.5) };
    let (tracer, open) = under(glass);
    for mode in [Mode::Direct, Mode::Path] {
        assert_near(seen(&tracer, mode), 0.96 * 0.9 * open, 1e-3);
    }
    // Where it is there by halves, the other half of the light meets nothing.
    for opacity in [0.25, 0.5] {
        let clear = Material::glass("", Vec3::splat(0.9), 1.5);
        let (tracer, open) = under(Material { medium: None, opacity, alpha: Alpha::Blend, ..clear });
        for mode in [Mode::Direct, Mode::Path] {
            let share = opacity * 0.96 * 0.9 + 1.0 - opacity;
            assert_near(seen(&tracer, mode), share * open, 1e-3);
        }
    }
    // A lamp behind it, by shadow rays and by scattered rays together, is as bright as by either.
    let mut stage = Stage::new(1.0);
    floor(&mut stage, glossy(0.4, 0.3), 0.5);
    ceiling_light(&mut stage, 0.5, 4.0);
    let bare = stage.tracer();
    let mut stage = Stage::new(1.0);
    floor(&mut stage, glossy(0.4, 0.3), 0.5);
    ceiling_light(&mut stage, 0.5, 4.0);
    sheet(&mut stage, 0.8, Material { medium: None, ..Material::glass("", Vec3::ONE, 1.0) });
    let behind = stage.tracer();
    for (mode, bounces) in [(Mode::Direct, 2), (Mode::Path, 3)] {
        let settings = TraceSettings { spp: 1 << 15, mode, max_bounces: bounces };
        let [bare, behind] = [&bare, &behind]
            .map(|tracer| look(tracer, Vec3::new(0.3, 0.6, 0.0), Vec3::ZERO, &settings).radiance.x);
        // Glass of the index of air reflects nothing.
        assert_near(behind, bare, 0.02);
    }
}

/// A slab of glass between y = 1 and y = 1.5, and a lamp of radiance 2 above it.
fn slab(glass: Material) -> Tracer {
    let mut stage = Stage::new(1.0);
    stage.quad(Vec3::new(-3.0, 1.5, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0, glass.clone(), 1.0, 0.0);
    stage.quad(Vec3::new(-3.0, 1.0, -3.0), Vec3::X * 6.0, Vec3::Z * 6.0, glass, 1.0, 0.0);
    stage.quad(Vec3::new(-5.0, 3.0, -5.0), Vec3::X * 10.0, Vec3::Z * 10.0, diffuse(), 0.0, 2.0);
    stage.tracer()
}

#[test]
fn a_slab_of_glass_passes_what_reflections_within_leave() {
    let settings = TraceSettings { spp: 1 << 15, mode: Mode::Path, max_bounces: 32 };
    let reflected = 0.04_f32;
    let clear = slab(Material::glass("", Vec3::ONE, 1.5));
    let found = look(&clear, Vec3::ZERO, Vec3::new(1e-3, 1.0, 0.0), &settings).radiance.x;
    assert_near(found, 2.0 * (1.0 - reflected) / (1.0 + reflected), 0.01);
    // By half a metre of glass that keeps a third, each way: the series of reflections within.
    let tinted = Material {
        medium: Some(Medium { ior: 1.5, absorption: Vec3::splat(2.0 * 3_f32.ln()) }),
        ..Material::glass("", Vec3::ONE, 1.5)
    };
    let found = look(&slab(tinted), Vec3::ZERO, Vec3::new(1e-3, 1.0, 0.0), &settings).radiance.x;
    let kept = 1.0 / 3.0_f32;
    let expected = 2.0 * (1.0 - reflected).powi(2) * kept / (1.0 - (reflected * kept).powi(2));
    assert_near(found, expected, 0.01);
}

#[test]
fn a_lamp_of_two_sides_lights_both_ways() {
    for (double_sided, up) in [(false, 0.0), (true, 1.0)] {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, diffuse(), 0.8);
        stage.quad(
            Vec3::new(-0.5, 1.0, -0.5),
            Vec3::X,
            Vec3::Z,
            Material { double_sided, ..diffuse() },
            0.0,
            4.0,
        );
        stage.quad(Vec3::new(-5.0, 2.0, -5.0), Vec3::X * 10.0, Vec3::Z * 10.0, diffuse(), 0.8, 0.0);
        let tracer = stage.tracer();
        // The floor and the ceiling are as far from it.
        let lit = 0.8 * 4.0 * form_factor(1.0, 1.0);
        let settings = TraceSettings { spp: 1 << 14, mode: Mode::Direct, max_bounces: 0 };
        let on_floor = look(&tracer, Vec3::new(0.1, 0.5, 0.0), Vec3::ZERO, &settings).radiance.x;
        let on_ceiling = look(&tracer, Vec3::new(0.1, 1.5, 0.0), 2.0 * UP, &settings).radiance.x;
        assert_near(on_floor, lit, 0.01);
        assert!((on_ceiling - up * lit).abs() <= 0.01 * lit, "{on_ceiling}");
        // Both sides are seen as they emit.
        let above = look(&tracer, Vec3::new(0.1, 1.5, 0.0), UP, &settings).radiance.x;
        assert_eq!(above, 4.0 * up);
    }
}

#[test]
fn many_emissive_triangles_light_by_their_power() {
    // 400 lamps of different brightness at random places of a ceiling, in all 0.1 m^2.
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.8);
    let (mut rng, mut expected) = (Rng::new(5, 5), 0.0);
    for _ in 0..400 {
        let [x, z] = rng.next_pair().map(|share| 4.0 * share - 2.0);
        let radiance = 10.0 * rng.next_f32().powi(4);
        let side = 0.016;
        stage.quad(Vec3::new(x, 1.0, z), Vec3::X * side, Vec3::Z * side, diffuse(), 0.0, radiance);
        let to_lamp = DVec3::new(f64::from(x) + 0.008, 1.0, f64::from(z) + 0.008);
        expected += f64::from(radiance * side * side) / to_lamp.length_squared().powi(2);
    }
    let expected = (0.8 * expected / std::f64::consts::PI) as f32;
    let tracer = stage.tracer();
    for mode in [Mode::Direct, Mode::Path] {
        let settings = TraceSettings { spp: 1 << 15, mode, max_bounces: 0 };
        let hit = look(&tracer, Vec3::new(0.1, 0.5, 0.0), Vec3::ZERO, &settings);
        assert_near(hit.radiance.x, expected, 0.01);
    }
}

#[test]
fn a_textured_lamp_emits_as_its_texels_say() {
    let lamp = |left: u8, right: u8| {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, diffuse(), 0.8);
        let maps = Maps { emission: Some(Map { nearest: true, ..Map::new(0) }), ..Maps::default() };
        stage.quad(Vec3::new(-0.5, 1.0, -0.5), Vec3::X, Vec3::Z, Material { maps, ..diffuse() }, 0.0, 4.0);
        let texels = vec![[left, left, left, 255], [right, right, right, 255]];
        stage.scene.textures =
            Arc::new(vec![Arc::new(Texture { name: String::new(), size: [2, 1], texels })]);
        let mesh = &stage.scene.mesh;
        let uv = |p: Vec3| Vec2::new(p.x + 0.5, 0.5);
        let uvs = mesh.triangles.iter().map(|t| t.map(|i| uv(mesh.positions[i as usize]))).collect();
        stage.scene.mesh.corner_uvs = Arc::new([uvs, vec![]]);
        let settings = TraceSettings { spp: 1 << 15, mode: Mode::Direct, max_bounces: 0 };
        look(&stage.tracer(), Vec3::new(0.1, 0.5, 0.0), Vec3::ZERO, &settings).radiance.x
    };
    let full = 0.8 * 4.0 * form_factor(1.0, 1.0);
    assert_near(lamp(255, 255), full, 0.01);
    // The halves light the point between them alike.
    assert_near(lamp(255, 0), 0.5 * full, 0.01);
    assert_near(lamp(0, 255), 0.5 * full, 0.01);
}

#[test]
fn a_spot_lights_its_cone() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.8);
    let cosines = [0.2_f32, 0.4].map(f32::cos);
    let intensity = Vec3::splat(3.0);
    stage.scene.lights.push(Light::Spot { position: 2.0 * UP, axis: -UP, intensity, cosines });
    let tracer = stage.tracer();
    let lit = |angle: f32| {
        let at = Vec3::new(2.0 * angle.tan(), 0.0, 0.0);
        let open = 0.8 / PI * 3.0 / 4.0 * angle.cos().powi(3);
        look(&tracer, at + Vec3::new(0.1, 1.0, 0.0), at, &settings(Mode::Direct, 1)).radiance.x / open
    };
    assert!((lit(0.0) - 1.0).abs() < 1e-5 && (lit(0.19) - 1.0).abs() < 1e-5 && lit(0.41) == 0.0);
    let cosine = 0.3_f32.cos();
    assert_near(lit(0.3), ((cosine - cosines[1]) / (cosines[0] - cosines[1])).powi(2), 1e-3);
}

#[test]
fn a_sky_lights_a_floor() {
    // A half of even brightness, with a sun as wide as a texel in the other.
    let texels = (0..64 * 32).map(|i| {
        let sun = if (i % 64, i / 64) == (20, 6) { 200.0 } else { 0.0 };
        Vec3::splat(if i % 64 < 32 { 0.5 } else { 0.25 } + sun)
    });
    let sky = Arc::new(Sky::new("", [64, 32], texels.collect()).unwrap());
    // The integral of radiance times cosine, by an even grid of directions.
    let (rows, columns) = (800, 3200);
    let mut irradiance = 0.0;
    for row in 0..rows {
        let y = (row as f32 + 0.5) / rows as f32;
        for column in 0..columns {
            let angle = 2.0 * PI * (column as f32 + 0.5) / columns as f32;
            let radius = (1.0 - y * y).sqrt();
            let direction = Vec3::new(radius * angle.cos(), y, radius * angle.sin());
            irradiance += f64::from(y * sky.radiance(direction).x);
        }
    }
    irradiance *= 2.0 * std::f64::consts::PI / f64::from(rows * columns);
    let mut stage = Stage::new(1.0);
    floor(&mut stage, glossy(0.3, 0.04), 0.6);
    floor(&mut stage, diffuse(), 0.6);
    stage.scene.mesh.positions[0..4].iter_mut().for_each(|p| *p -= 3.0 * UP);
    stage.scene.sky = Some(sky.clone());
    let tracer = stage.tracer();
    let expected = (0.6 / std::f64::consts::PI * irradiance) as f32;
    for (mode, bounces) in [(Mode::Direct, 0), (Mode::Path, 0), (Mode::Path, 2)] {
        let settings = TraceSettings { spp: 1 << 15, mode, max_bounces: bounces };
        let hit = look(&tracer, Vec3::new(0.1, 0.5, 0.0), Vec3::ZERO, &settings);
        assert_near(hit.radiance.x, expected, 0.01);
    }
    // A ray past everything shows it.
    let past = look(&tracer, 9.0 * UP, Vec3::new(0.3, 10.0, 0.2), &settings(Mode::Direct, 1));
    assert_eq!((past.hit, past.radiance), (false, sky.radiance(Vec3::new(0.3, 1.0, 0.2).normalize())));
}

#[test]
fn a_large_floor_shows_shadows_as_a_small_one() {
    let lit = |half: f32, x: f32| {
        let mut stage = Stage::new(1.0);
        let side = 2.0 * half;
        stage.quad(Vec3::new(-half, 0.0, -half), Vec3::Z * side, Vec3::X * side, diffuse(), 0.5, 0.0);
        // A box of a tenth of a metre that stands on it.
        stage.quad(Vec3::new(-0.05, 0.1, -0.05), Vec3::Z * 0.1, Vec3::X * 0.1, diffuse(), 0.5, 0.0);
        point_light(&mut stage, Vec3::new(-1.0, 1.0, 0.0), 1.0);
        look(&stage.tracer(), Vec3::new(x, 0.5, 0.3), Vec3::new(x, 0.0, 0.0), &settings(Mode::Direct, 1))
            .radiance
            .x
    };
    for x in [0.04, 0.1, 0.17, 0.3, -0.5] {
        let expected = lit(10.0, x);
        for half in [1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 9e8] {
            let found = lit(half, x);
            let is_same = (found - expected).abs() <= 0.02 * expected.max(1e-3);
            assert!(is_same, "half {half}, at {x}: {found}, expected {expected}");
        }
    }
    assert!(lit(10.0, 0.1) == 0.0 && lit(10.0, 0.3) > 0.03);
}
