mod analytic;
mod surfaces;
mod transparent;

use std::f32::consts::PI;
use std::sync::atomic::Ordering;

use super::*;
use crate::{Camera, Light, reference};

/// A scene of quads, each with its own material. All coordinates are multiplied by `scale`.
struct Stage {
    scene: Scene,
    scale: f32,
}

impl Stage {
    fn new(scale: f32) -> Self {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.0, 0.1, 10.0);
        let scene = Scene::empty("test", camera, [Vec3::NEG_ONE * scale, Vec3::ONE * scale]);
        Self { scene, scale }
    }

    /// Adds the parallelogram `corner + s u + t v`, whose front side faces `u x v`.
    fn quad(&mut self, corner: Vec3, u: Vec3, v: Vec3, surface: Material, color: f32, emission: f32) {
        let mesh = &mut self.scene.mesh;
        let base = mesh.positions.len() as u32;
        mesh.positions.extend([corner, corner + u, corner + u + v, corner + v].map(|p| p * self.scale));
        for triangle in [[0, 1, 2], [0, 2, 3]] {
            Arc::make_mut(&mut mesh.triangles).push(triangle.map(|i| base + i));
            mesh.face_normals.push(u.cross(v).normalize());
            Arc::make_mut(&mut mesh.material).push(self.scene.materials.len() as u32);
            Arc::make_mut(&mut mesh.object).push(0);
        }
        let (color, emission) = (Vec3::splat(color), Vec3::splat(emission));
        self.scene.materials.push(Material { color, emission, ..surface });
    }

    /// Adds a quad light and its triangles.
    fn quad_light(&mut self, corner: Vec3, u: Vec3, v: Vec3, radiance: f32) {
        self.quad(corner, u, v, diffuse(), 0.0, radiance);
        let [corner, u, v] = [corner, u, v].map(|p| p * self.scale);
        self.scene.lights.push(Light::Quad { corner, u, v, radiance: Vec3::splat(radiance) });
    }

    /// Adds the six sides of the cube [-1, 1]^3, facing inwards.
    fn room(&mut self, color: f32, emission: f32) {
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let [n, u, v] = [0, 1, 2].map(|i| Vec3::AXES[(axis + i) % 3]);
                // u x v = n, so u and v are swapped for the side at +n, which must face -n.
                let (u, v) = if sign < 0.0 { (u, v) } else { (v, u) };
                self.quad(n * sign - u - v, 2.0 * u, 2.0 * v, diffuse(), color, emission);
            }
        }
    }

    fn tracer(self) -> Tracer {
        Tracer::new(Arc::new(self.scene))
    }
}

const UP: Vec3 = Vec3::Y;

fn diffuse() -> Material {
    Material::diffuse("", Vec3::ONE)
}

fn mirror() -> Material {
    Material::mirror("", Vec3::ONE)
}

fn glossy(roughness: f32, f0: f32) -> Material {
    Material::glossy("", Vec3::ONE, roughness, f0)
}

/// A large floor at y = 0 that faces up.
fn floor(stage: &mut Stage, surface: Material, color: f32) {
    stage.quad(Vec3::new(-5.0, 0.0, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0, surface, color, 0.0);
}

/// A square light with sides of length `side`, at height 1 above the origin, that shines down.
fn ceiling_light(stage: &mut Stage, side: f32, radiance: f32) {
    stage.quad_light(Vec3::new(-0.5 * side, 1.0, -0.5 * side), Vec3::X * side, Vec3::Z * side, radiance);
}

fn settings(mode: Mode, spp: u32) -> TraceSettings {
    TraceSettings { spp, mode, max_bounces: 8 }
}

fn look(tracer: &Tracer, from: Vec3, to: Vec3, settings: &TraceSettings) -> Hit {
    tracer.trace(from, to - from, settings, &mut Rng::new(1, 1))
}

#[track_caller]
fn assert_near(found: f32, expected: f32, relative: f32) {
    assert!((found / expected - 1.0).abs() <= relative, "found {found}, expected {expected}");
}

/// Form factor of a square light with sides of length `side`, `height` above a parallel surface, for the point below
/// its centre: four times the corner form factor (Howell, configuration C-11 with equal sides).
fn form_factor(side: f32, height: f32) -> f32 {
    let x = 0.5 * side / height;
    let root = (1.0 + x * x).sqrt();
    4.0 / (2.0 * PI) * 2.0 * (x / root) * (x / root).atan()
}

/// What colours of the mesh vary is a pattern where all of the radiance is scattered light.
#[test]
fn patterns_are_albedos_that_vary_of_surfaces_that_only_scatter() {
    let pattern = |surface: Material, emission: f32, varies: bool| {
        let mut stage = Stage::new(1.0);
        stage.quad(Vec3::new(-5.0, 0.0, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0, surface, 0.5, emission);
        if varies {
            let colors = vec![[glam::Vec4::new(0.8, 0.4, 0.2, 1.0); 3]; 2];
            stage.scene.mesh.corner_colors = Arc::new(colors);
        }
        look(&stage.tracer(), Vec3::new(0.3, 1.0, 0.2), Vec3::ZERO, &settings(Mode::Path, 1)).pattern
    };
    let is = |found: Vec3, expected: [f32; 3]| {
        assert!(found.distance(expected.into()) < 1e-6, "{found}, expected {expected:?}");
    };
    is(pattern(diffuse(), 0.0, true), [0.4, 0.2, 0.1]);
    is(pattern(glossy(0.3, 0.04), 0.0, true), [0.44, 0.24, 0.14]);
    is(pattern(mirror(), 0.0, true), [0.4, 0.2, 0.1]);
    is(pattern(diffuse(), 0.0, false), [1.0; 3]);
    is(pattern(diffuse(), 2.0, true), [1.0; 3]);
    is(pattern(Material { unlit: true, ..diffuse() }, 0.0, true), [1.0; 3]);
    is(pattern(Material::glass("", Vec3::ONE, 1.5), 0.0, true), [1.0; 3]);
    is(pattern(Material { alpha: Alpha::Blend, opacity: 0.5, ..diffuse() }, 0.0, true), [1.0; 3]);
    // Where nothing is hit, nothing is divided either.
    is(look(&Stage::new(1.0).tracer(), Vec3::ZERO, Vec3::X, &settings(Mode::Path, 1)).pattern, [1.0; 3]);
}

#[test]
fn quad_light_matches_its_form_factor() {
    for side in [0.1, 1.0, 4.0] {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, diffuse(), 0.8);
        ceiling_light(&mut stage, side, 3.0);
        let tracer = stage.tracer();
        // Radiance = albedo * E / pi with E = pi * L * F.
        let expected = 0.8 * 3.0 * form_factor(side, 1.0);
        for mode in [Mode::Direct, Mode::Path] {
            // The light's material is black, so paths end at the light.
            let hit = look(&tracer, Vec3::new(0.1, 0.5, 0.0), Vec3::ZERO, &settings(mode, 1 << 14));
            assert_near(hit.radiance.x, expected, 0.01);
        }
    }
}

#[test]
fn point_light_falls_with_the_square_of_the_distance() {
    for height in [0.5, 1.0, 4.0] {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, diffuse(), 0.5);
        stage.scene.lights.push(Light::Point { position: UP * height, intensity: Vec3::splat(2.0) });
        let hit = look(&stage.tracer(), Vec3::new(0.3, 0.3, 0.0), Vec3::ZERO, &settings(Mode::Direct, 1));
        assert_near(hit.radiance.x, 0.5 / PI * 2.0 / (height * height), 1e-5);
    }
}

#[test]
fn point_light_casts_a_hard_shadow_at_the_right_place() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.5);
    // The blocker is halfway between floor and light, so the shadow is twice as wide: |x| < 0.4.
    stage.quad(Vec3::new(-0.2, 1.0, -0.2), Vec3::Z * 0.4, Vec3::X * 0.4, diffuse(), 0.5, 0.0);
    stage.scene.lights.push(Light::Point { position: UP * 2.0, intensity: Vec3::ONE });
    let tracer = stage.tracer();
    let at = |x: f32| {
        let target = Vec3::new(x, 0.0, 0.0);
        look(&tracer, target + Vec3::new(1.0, 0.5, 0.0), target, &settings(Mode::Direct, 1)).radiance.x
    };
    assert_eq!(at(0.399), 0.0);
    assert_eq!(at(-0.399), 0.0);
    assert!(at(0.401) > 0.03);
    assert!(at(-0.401) > 0.03);
}

#[test]
fn quad_light_casts_a_soft_shadow() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.5);
    ceiling_light(&mut stage, 0.2, 10.0);
    // The blocker is the half plane x < 0, halfway up: at x = 0, half of the light is visible, and the penumbra is |x|
    // < 0.1.
    stage.quad(Vec3::new(-4.0, 0.5, -4.0), Vec3::Z * 8.0, Vec3::X * 4.0, diffuse(), 0.5, 0.0);
    let tracer = stage.tracer();
    let at = |x: f32| {
        let target = Vec3::new(x, 0.0, 0.0);
        look(&tracer, Vec3::new(x + 1.0, 0.3, 0.0), target, &settings(Mode::Direct, 4096)).radiance.x
    };
    assert_eq!(at(-0.11), 0.0);
    // The irradiance of a small light is proportional to the fourth power of the cosine.
    assert_near(at(0.0) / at(0.11), 0.5 * (1.0f32 + 0.11 * 0.11).powi(2), 0.01);
    assert!(at(-0.05) < at(0.0) && at(0.0) < at(0.05));
}

#[test]
fn a_quad_light_emits_only_to_its_front() {
    let mut stage = Stage::new(1.0);
    ceiling_light(&mut stage, 1.0, 7.0);
    let tracer = stage.tracer();
    let settings = settings(Mode::Direct, 1);
    assert_eq!(look(&tracer, Vec3::ZERO, UP, &settings).radiance, Vec3::splat(7.0));
    assert_eq!(look(&tracer, UP * 2.0, UP, &settings).radiance, Vec3::ZERO);
}

#[test]
fn closed_furnace_has_the_radiance_of_the_geometric_series() {
    for (albedo, bounces) in [(0.5, 64), (0.9, 400)] {
        let mut stage = Stage::new(1.0);
        stage.room(albedo, 0.25);
        let settings = TraceSettings { spp: 1 << 14, mode: Mode::Path, max_bounces: bounces };
        let hit = look(&stage.tracer(), Vec3::new(0.2, 0.1, 0.0), Vec3::new(0.3, -1.0, 0.4), &settings);
        assert_near(hit.radiance.x, 0.25 / (1.0 - albedo), 0.02);
    }
}

#[test]
fn closed_furnace_of_quad_lights_counts_each_light_once() {
    // All six sides are quad lights too. Light sampling and scattered rays both find them, and the result is the same.
    let mut stage = Stage::new(1.0);
    stage.room(0.5, 0.25);
    for face in (0..12).step_by(2) {
        let [a, b, _] = stage.scene.mesh.triangles[face].map(|i| stage.scene.mesh.positions[i as usize]);
        let d = stage.scene.mesh.positions[stage.scene.mesh.triangles[face + 1][2] as usize];
        stage.scene.lights.push(Light::Quad { corner: a, u: b - a, v: d - a, radiance: Vec3::splat(0.25) });
    }
    let settings = TraceSettings { spp: 1 << 14, mode: Mode::Path, max_bounces: 64 };
    let hit = look(&stage.tracer(), Vec3::new(0.2, 0.1, 0.0), Vec3::new(0.3, -1.0, 0.4), &settings);
    assert_near(hit.radiance.x, 0.5, 0.02);
}

#[test]
fn convex_surface_before_a_white_background_shows_its_albedo() {
    let glossy = glossy(0.4, 0.04);
    for (surface, albedo, tolerance) in [(diffuse(), 0.6, 0.0), (mirror(), 0.6, 0.0), (glossy, 1.0, 0.03)] {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, surface, albedo);
        stage.scene.background = Vec3::ONE;
        let hit = look(&stage.tracer(), Vec3::new(0.3, 1.0, 0.0), Vec3::ZERO, &settings(Mode::Path, 4096));
        assert_near(hit.radiance.x, albedo, tolerance + 1e-4);
    }
}

#[test]
fn a_glossy_floor_reflects_a_quad_light_alike_in_both_modes_and_by_either_sampling() {
    // The floor has no diffuse colour, so all of its light comes from the quad light, and both modes agree. Without the
    // light's triangles, scattered rays cannot hit the light: sampling the light alone is noisy, but correct.
    let build = |in_mesh: bool| {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, glossy(0.5, 0.3), 0.0);
        ceiling_light(&mut stage, 0.5, 4.0);
        if !in_mesh {
            Arc::make_mut(&mut stage.scene.mesh.triangles).truncate(2);
            Arc::make_mut(&mut stage.scene.mesh.material).truncate(2);
        }
        stage.tracer()
    };
    let (from, to) = (Vec3::new(0.5, 0.7, 0.0), Vec3::new(0.05, 0.0, 0.0));
    let expected = look(&build(false), from, to, &settings(Mode::Direct, 1 << 16)).radiance.x;
    assert!(expected > 0.01);
    for mode in [Mode::Direct, Mode::Path] {
        let found = look(&build(true), from, to, &settings(mode, 1 << 14)).radiance.x;
        assert_near(found, expected, 0.02);
    }
}

#[test]
fn mirror_shows_the_reflected_surface() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, mirror(), 0.5);
    ceiling_light(&mut stage, 0.2, 8.0);
    stage.scene.background = Vec3::splat(3.0);
    let tracer = stage.tracer();
    let settings = settings(Mode::Direct, 1);
    let hit = look(&tracer, Vec3::new(0.5, 0.5, 0.0), Vec3::new(1.0 / 3.0, 0.0, 0.0), &settings);
    assert_near(hit.radiance.x, 4.0, 1e-5);
    assert!(hit.position.distance(Vec3::new(1.0 / 3.0, 0.0, 0.0)) < 1e-6, "the first surface is the mirror");
    let past = look(&tracer, Vec3::new(2.0, 0.5, 0.0), Vec3::ZERO, &settings);
    // At a cosine of 1 / sqrt(17), by Schlick's approximation.
    assert_near(past.radiance.x, 3.0 * (0.5 + 0.5 * (1.0 - 0.242_536_f32).powi(5)), 1e-4);
}

#[test]
fn parallel_mirrors_end_at_the_bounce_limit() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, mirror(), 1.0);
    stage.quad(Vec3::new(-5.0, 1.0, -5.0), Vec3::X * 10.0, Vec3::Z * 10.0, mirror(), 1.0, 0.0);
    stage.scene.background = Vec3::ONE;
    let tracer = stage.tracer();
    for mode in [Mode::Direct, Mode::Path] {
        let hit = look(&tracer, UP * 0.5, Vec3::ZERO, &settings(mode, 1));
        assert!(hit.hit);
        assert_eq!(hit.radiance, Vec3::ZERO);
    }
}

#[test]
fn a_ray_that_hits_nothing_gives_its_direction_and_the_background() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.5);
    stage.scene.background = Vec3::new(0.1, 0.2, 0.3);
    let hit = look(&stage.tracer(), UP, Vec3::new(0.0, 1.0, -3.0), &settings(Mode::Path, 1));
    assert_eq!((hit.hit, hit.face), (false, u32::MAX));
    assert_eq!(hit.position, Vec3::NEG_Z);
    assert_eq!(hit.radiance, Vec3::new(0.1, 0.2, 0.3));
}

#[test]
fn an_empty_scene_is_all_background() {
    let hit = look(&Stage::new(1.0).tracer(), Vec3::ZERO, Vec3::ONE, &settings(Mode::Path, 4));
    assert!(!hit.hit);
}

#[test]
fn rays_along_axes_hit_with_positive_and_negative_zeros() {
    let mut stage = Stage::new(1.0);
    stage.room(0.5, 0.0);
    let tracer = stage.tracer();
    for axis in 0..3 {
        for (sign, zero) in [(1.0, 0.0), (1.0, -0.0), (-1.0, 0.0), (-1.0, -0.0)] {
            let mut direction = Vec3::splat(zero);
            direction[axis] = sign;
            let hit = tracer.trace(Vec3::ZERO, direction, &settings(Mode::Direct, 1), &mut Rng::new(0, 0));
            assert!(hit.hit && hit.position == Vec3::AXES[axis] * sign, "{direction}: {hit:?}");
        }
    }
}

#[test]
fn no_ray_leaves_a_closed_room_and_no_surface_shadows_itself_at_any_scale() {
    for scale in [1e-3, 1.0, 555.0, 1e7] {
        let mut stage = Stage::new(scale);
        // Grids of small tiles: many shared edges, with coordinates that are not exact in binary.
        let n = 24;
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let [normal, u, v] = [0, 1, 2].map(|i| Vec3::AXES[(axis + i) % 3]);
                let (u, v) = if sign < 0.0 { (u, v) } else { (v, u) };
                add_grid(&mut stage, normal * sign, u, v, n);
            }
        }
        let inside = Vec3::new(0.013, -0.4, 0.27) * scale;
        let position = inside + Vec3::new(0.3, 0.2, 0.1) * scale;
        stage.scene.lights.push(Light::Point { position, intensity: Vec3::ONE * scale * scale });
        let tracer = stage.tracer();
        let mut rng = Rng::new(2, 3);
        let mut aim = |vertex: bool| {
            let mut p = Vec3::from_array([0; 3].map(|_| 2.0 * rng.next_f32() - 1.0));
            let axis = (rng.next_u32() % 3) as usize;
            p[axis] = p[axis].signum();
            if vertex {
                // A point of the lattice: the ray passes through a vertex or an edge.
                p = (p * (0.5 * n as f32)).round() / (0.5 * n as f32);
            }
            p * scale
        };
        for i in 0..20_000 {
            let target = aim(i % 2 == 0);
            let hit = look(&tracer, inside, target, &settings(Mode::Direct, 1));
            assert!(hit.hit, "scale {scale}: a ray to {target} got out");
            assert!(hit.position.distance(target) < 1e-5 * scale, "scale {scale}: {target} {hit:?}");
            assert!(hit.radiance.x > 1e-3, "scale {scale}: {target} shadows itself, {hit:?}");
        }
    }
}

/// An n x n grid of diffuse tiles with shared vertices on the side of the cube [-1, 1]^3 at `center`.
fn add_grid(stage: &mut Stage, center: Vec3, u: Vec3, v: Vec3, n: u32) {
    let mesh = &mut stage.scene.mesh;
    let base = mesh.positions.len() as u32;
    let at = |i: u32| 2.0 * i as f32 / n as f32 - 1.0;
    for j in 0..=n {
        mesh.positions.extend((0..=n).map(|i| (center + u * at(i) + v * at(j)) * stage.scale));
    }
    for j in 0..n {
        for i in 0..n {
            let a = base + j * (n + 1) + i;
            for triangle in [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]] {
                Arc::make_mut(&mut mesh.triangles).push(triangle);
                mesh.face_normals.push(u.cross(v));
                Arc::make_mut(&mut mesh.material).push(stage.scene.materials.len() as u32);
                Arc::make_mut(&mut mesh.object).push(0);
            }
        }
    }
    stage.scene.materials.push(Material::diffuse("", Vec3::splat(0.5)));
}

#[test]
fn radiance_that_is_not_finite_becomes_black_and_is_counted() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.5);
    stage.scene.lights.push(Light::Point { position: UP, intensity: Vec3::INFINITY });
    let tracer = stage.tracer();
    let hit = look(&tracer, UP * 0.5, Vec3::ZERO, &settings(Mode::Direct, 1));
    assert_eq!(hit.radiance, Vec3::ZERO);
    assert_eq!(tracer.non_finite(), 1);
}

#[test]
fn corner_normals_shade_smoothly_and_let_no_light_through_a_surface() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.5);
    let tilted = Vec3::new(0.6, 0.8, 0.0);
    stage.scene.mesh.corner_normals = vec![[tilted; 3]; 2];
    let above = Light::Point { position: UP, intensity: Vec3::ONE };
    // This light is below the floor, but on the front side of the tilted normal.
    let below = Light::Point { position: Vec3::new(4.0, -0.5, 0.0), intensity: Vec3::ONE };
    for (light, expected) in [(above, 0.5 / PI * 0.8), (below, 0.0)] {
        stage.scene.lights = vec![light];
        let tracer = Tracer::new(Arc::new(stage.scene.clone()));
        let hit = look(&tracer, Vec3::new(0.3, 0.6, 0.0), Vec3::ZERO, &settings(Mode::Direct, 1));
        assert!((hit.radiance.x - expected).abs() < 1e-5, "{hit:?}");
    }
}

/// A closed room with a quad light and a glossy block, and one ray for each pixel of a small image.
fn room_and_jobs() -> (Tracer, Vec<Job>) {
    let mut stage = Stage::new(1.0);
    stage.room(0.6, 0.0);
    stage.quad_light(Vec3::new(-0.3, 0.99, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6, 10.0);
    let glossy = glossy(0.3, 0.2);
    stage.quad(Vec3::new(-0.5, -0.5, -0.5), Vec3::X, Vec3::new(0.0, 0.3, -0.5), glossy, 0.5, 0.0);
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 0.95), Vec3::ZERO, 1.2, 0.1, 3.0);
    let jobs = (0..32 * 32).map(|i| {
        let direction = camera.direction((i % 32) as f32 + 0.5, (i / 32) as f32 + 0.5, [32, 32]);
        Job { origin: camera.eye, direction, start: camera.near, key: Rng::key(0, i) }
    });
    (stage.tracer(), jobs.collect())
}

fn in_pool<R: Send>(threads: usize, run: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run)
}

#[test]
fn batches_depend_on_the_seed_but_not_on_the_number_of_threads() {
    let (tracer, jobs) = room_and_jobs();
    let batch = |threads, seed| {
        let mut out = vec![Hit::default(); jobs.len()];
        in_pool(threads, || tracer.trace_batch(&jobs, &settings(Mode::Path, 2), seed, &mut out));
        out
    };
    assert_eq!(batch(1, 1), batch(3, 1));
    assert_ne!(batch(1, 1), batch(1, 2));
    assert_eq!(tracer.non_finite(), 0);
}

#[test]
fn reference_image_is_the_same_on_any_number_of_threads_and_converges() {
    let (tracer, _) = room_and_jobs();
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 0.95), Vec3::ZERO, 1.2, 0.1, 3.0);
    let render = |threads, spp, seed| {
        let settings = settings(Mode::Path, 1);
        in_pool(threads, || {
            reference::render(&tracer, &camera, [12, 8], spp, &settings, seed, &|| true).unwrap()
        })
    };
    assert_eq!(render(1, 4, 1), render(3, 4, 1));
    let converged = render(2, 4096, 2);
    assert_eq!(converged.len(), 96);
    let error = |spp| -> f32 {
        let image = render(2, spp, 1);
        image.iter().zip(&converged).map(|(a, b)| a.distance_squared(*b)).sum::<f32>().sqrt()
    };
    let (rough, fine) = (error(4), error(256));
    // With 64 times as many samples, the error is an eighth if they are independent, and less if they are stratified.
    assert!(fine < rough / 6.0, "{rough} -> {fine}");
}

#[test]
fn each_sample_of_a_reference_has_its_own_random_numbers() {
    let (tracer, _) = room_and_jobs();
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 0.95), Vec3::ZERO, 1.2, 0.1, 3.0);
    let settings = settings(Mode::Path, 1);
    for (size, spp) in [([3, 2], 1), ([1, 3], 2), ([2, 1], 3)] {
        let found = reference::render(&tracer, &camera, size, spp, &settings, 7, &|| true).unwrap();
        assert_eq!(found.len() as u32, size[0] * size[1]);
        for (pixel, &found) in (0..).zip(&found) {
            let [x, y] = [pixel % size[0], pixel / size[0]];
            let samples = (0..spp).map(|nth| {
                let mut rng = Rng::nth(7, Rng::key(0, pixel), nth);
                let [dx, dy] = rng.subpixel();
                let direction = camera.direction(x as f32 + dx, y as f32 + dy, size);
                tracer.trace_from(camera.eye, direction, camera.near, &settings, &mut rng).radiance
            });
            let expected = samples.sum::<Vec3>() / spp as f32;
            assert!(found.distance(expected) <= 1e-5 * expected.length(), "{pixel}: {found}, not {expected}");
        }
    }
    // None counts as one.
    let render = |spp| reference::render(&tracer, &camera, [3, 2], spp, &settings, 7, &|| true);
    assert_eq!(render(0), render(1));
}

#[test]
fn reference_pixels_are_averaged_over_their_area_and_each_is_reported_once() {
    let mut stage = Stage::new(1.0);
    // The left half of the view is emissive, the right half black. The image is one row of three pixels.
    stage.quad(Vec3::new(-9.0, -9.0, -1.0), Vec3::X * 9.0, Vec3::Y * 18.0, diffuse(), 0.0, 1.0);
    let (tracer, camera) = (stage.tracer(), Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.0, 0.1, 10.0));
    let pixels = std::sync::atomic::AtomicUsize::new(0);
    let render = |size, stop_at| {
        pixels.store(0, Ordering::Relaxed);
        let pixel_done = || pixels.fetch_add(1, Ordering::Relaxed) + 1 < stop_at;
        reference::render(&tracer, &camera, size, 64, &settings(Mode::Direct, 1), 0, &pixel_done)
    };
    let image = render([3, 1], usize::MAX).unwrap();
    assert_eq!(image[0], Vec3::ONE);
    assert_near(image[1].x, 0.5, 1e-6);
    assert_eq!(image[2], Vec3::ZERO);
    assert_eq!(pixels.load(Ordering::Relaxed), 3);
    assert!(render([3, 9], usize::MAX).is_some() && pixels.load(Ordering::Relaxed) == 27);
    // A stopped render returns no image and skips the pixels that have not begun.
    assert_eq!(render([3, 1000], 1), None);
    assert!(pixels.load(Ordering::Relaxed) < 100);
}

#[test]
fn workers_answer_every_request_with_its_tag_and_the_same_bits() {
    let (tracer, jobs) = room_and_jobs();
    let (tracer, how) = (Arc::new(tracer), settings(Mode::Path, 2));
    let mut expected = vec![Hit::default(); jobs.len()];
    tracer.trace_batch(&jobs, &how, 5, &mut expected);
    // In two batches, of which the second waits for the first.
    let queue = AsyncTracer::new(2);
    let tagged: Vec<_> = (0u32..).zip(&jobs).map(|(tag, &job)| TaggedJob { job, tag }).collect();
    let (first, second) = tagged.split_at(jobs.len() / 3);
    assert_eq!(queue.submit(&tracer, first.to_vec(), how, 5), 0);
    assert_eq!(queue.submit(&tracer, second.to_vec(), how, 5), 0);
    let start = std::time::Instant::now();
    let mut found = Vec::new();
    while found.len() < jobs.len() {
        assert!(start.elapsed().as_secs() < 60, "{} of {}", found.len(), jobs.len());
        let before = found.len();
        queue.collect(100, &mut found);
        assert!(found.len() - before <= 100);
        std::thread::yield_now();
    }
    assert_eq!(queue.waiting(), 0);
    found.sort_by_key(|hit| hit.tag);
    for (tag, (found, expected)) in (0u32..).zip(found.iter().zip(&expected)) {
        assert_eq!((found.tag, &found.hit), (tag, expected));
    }
}

#[test]
fn workers_without_work_wait_for_more() {
    let (tracer, jobs) = room_and_jobs();
    let (tracer, queue) = (Arc::new(tracer), AsyncTracer::new(2));
    let mut found = Vec::new();
    for batch in 1..=3 {
        // Long enough for all workers to fall asleep.
        std::thread::sleep(std::time::Duration::from_millis(50));
        let tagged = jobs.iter().map(|&job| TaggedJob { job, tag: batch }).collect();
        assert_eq!(queue.submit(&tracer, tagged, settings(Mode::Direct, 1), 0), 0);
        let start = std::time::Instant::now();
        while found.len() < batch * jobs.len() {
            assert!(start.elapsed().as_secs() < 60, "{} of {} x {batch}", found.len(), jobs.len());
            queue.collect(usize::MAX, &mut found);
            std::thread::yield_now();
        }
    }
}

#[test]
fn if_workers_fall_behind_the_oldest_waiting_batches_are_dropped() {
    let (tracer, jobs) = room_and_jobs();
    let tracer = Arc::new(tracer);
    // One worker is busy with a long batch, so the next batches wait.
    let long = settings(Mode::Path, 1 << 12);
    let queue = AsyncTracer::new(1);
    let batch = |tag: u32| jobs.iter().map(|&job| TaggedJob { job, tag }).collect::<Vec<_>>();
    assert_eq!(queue.submit(&tracer, batch(0), long, 0), 0);
    while queue.waiting() == jobs.len() {
        std::thread::yield_now();
    }
    for tag in 1..=3 {
        assert_eq!(queue.submit(&tracer, batch(tag), settings(Mode::Direct, 1), 0), 0);
    }
    assert_eq!(queue.submit(&tracer, batch(4), settings(Mode::Direct, 1), 0), jobs.len());
    assert!(queue.waiting() >= 3 * jobs.len());
    // Dropping the queue waits for one chunk of work at most, not for the waiting batches.
    drop(queue);
}

/// Tracers of a room in which a ball and a quad light have moved, and of a static scene with the same geometry.
fn moved_and_still() -> [Tracer; 2] {
    let mut builder = crate::SceneBuilder::new();
    let white = builder.material(Material::diffuse("", Vec3::ONE));
    builder.add(&crate::Shape::cuboid(Vec3::NEG_ONE * 3.0, Vec3::ONE * 2.0), white).unwrap();
    let motion = || {
        let rotate = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.0, 0.2);
        let translate = Vec3::new(0.4, 0.7, -0.3);
        let key = crate::MotionKey { time: 0.0, translate, rotate };
        crate::Motion { pivot: Vec3::X, keys: vec![key], looped: false }
    };
    let mut ball = crate::Shape::sphere(0.7, 24, 12);
    ball.smooth(90.0);
    builder.moving(motion(), |b| b.add(&ball, white)).unwrap();
    builder.moving(motion(), |b| b.quad_light(Vec3::Y, Vec3::X, Vec3::Z, Vec3::ONE)).unwrap();
    let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
    let rest = Arc::new(Tracer::new(Arc::new(builder.build("", camera, Vec3::ZERO, 0.0, 40.0).unwrap())));
    let moved = rest.at(7);
    assert!(Arc::ptr_eq(&moved, &moved.at(8)), "the motion has only one pose");
    let still = Scene { bodies: Arc::default(), poses: vec![], ..moved.scene().as_ref().clone() };
    [Tracer::new(moved.scene().clone()), Tracer::new(Arc::new(still))]
}

#[test]
fn a_moved_scene_renders_like_a_static_one_in_the_same_pose() {
    let [moved, still] = moved_and_still();
    let (mut rng, how, mut on_ball) = (Rng::new(3, 0), settings(Mode::Direct, 4), 0);
    let mut point = |size: f32| size * (2.0 * Vec3::from([0; 3].map(|_| rng.next_f32())) - 1.0);
    let (mut differ, rays) = (0, 4000);
    for ray in 0..rays {
        let (origin, target) = (point(1.9), point(1.0));
        let [a, b] = [&moved, &still].map(|t| t.trace(origin, target - origin, &how, &mut Rng::new(1, ray)));
        on_ball += u32::from(moved.scene().body_of_face(a.face) == 1);
        let same = a.hit == b.hit && a.position.distance(b.position) < 1e-4;
        differ += u32::from(!same || (a.radiance - b.radiance).abs().max_element() > 1e-2);
    }
    // Rays along an edge of a facet or of a shadow may fall to either side.
    assert!(on_ball > 400 && differ < 20, "{on_ball} on the ball, {differ} differ");
}
