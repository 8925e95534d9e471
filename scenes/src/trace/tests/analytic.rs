//! Radiance against closed forms: each number of bounces, several lights, mirrors, and surfaces with two lobes.
//!
//! Tolerances of 0.5% and 1% leave room for the noise of 2^14 and 2^16 paths.

use glam::DVec3;

use super::*;

/// A rectangular lamp parallel to the floor.
#[derive(Clone, Copy)]
struct Lamp {
    x: [f32; 2],
    y: f32,
    z: [f32; 2],
    radiance: f32,
}

impl Lamp {
    fn shine_down(self, stage: &mut Stage) {
        let Self { x, y, z, radiance } = self;
        stage.quad_light(
            Vec3::new(x[0], y, z[0]),
            Vec3::X * (x[1] - x[0]),
            Vec3::Z * (z[1] - z[0]),
            radiance,
        );
    }

    fn shine_up(self, stage: &mut Stage) {
        let Self { x, y, z, radiance } = self;
        stage.quad_light(
            Vec3::new(x[0], y, z[0]),
            Vec3::Z * (z[1] - z[0]),
            Vec3::X * (x[1] - x[0]),
            radiance,
        );
    }

    /// Radiance of a white surface that faces the lamp's plane, for the point at `x`, 0 and a distance of `height` from
    /// that plane: the sum of four rectangles with a corner opposite to the point (Howell, configuration C-11).
    fn lights(self, x: f32, height: f32) -> f32 {
        let corner = |a: f32, b: f32| {
            let (root_a, root_b) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
            (a / root_a * (b / root_a).atan() + b / root_b * (a / root_b).atan()) / (2.0 * PI)
        };
        let [[x0, x1], [z0, z1]] = [self.x.map(|end| (end - x) / height), self.z.map(|end| end / height)];
        self.radiance * (corner(x1, z1) - corner(x0, z1) - corner(x1, z0) + corner(x0, z0))
    }
}

/// A glossy surface that reflects all light, almost like a mirror.
fn smooth() -> Material {
    glossy(0.02, 1.0)
}

/// A viewer of the origin to whom [`smooth`] shows the point at x = y = 1.
const ASLANT: Vec3 = Vec3::new(-0.5, 0.5, 0.0);

fn limited(mode: Mode, spp: u32, max_bounces: u32) -> TraceSettings {
    TraceSettings { spp, mode, max_bounces }
}

/// Adds a large ceiling at y = 1 that faces down.
fn ceiling(stage: &mut Stage, surface: Material, color: f32) {
    stage.quad(Vec3::new(-5.0, 1.0, -5.0), Vec3::X * 10.0, Vec3::Z * 10.0, surface, color, 0.0);
}

fn point_light(stage: &mut Stage, position: Vec3, intensity: f32) {
    stage.scene.lights.push(Light::Point { position, intensity: Vec3::splat(intensity) });
}

/// A glossy surface with normal +y, in f64 and by definitions alone: GGX with height-correlated masking (Heitz 2014) and
/// Schlick's Fresnel term; what it loses between microfacets scattered diffusely (Kulla and Conty 2017); and a base that
/// gets what the rest leaves.
struct Analytic {
    color: f64,
    roughness: f64,
    f0: f64,
    /// The shares of light that single scattering reflects, without and with the Fresnel term, by cosine.
    single: Vec<[f64; 2]>,
    /// Their means, weighted by the cosine.
    means: [f64; 2],
}

impl Analytic {
    const STEPS: usize = 64;

    fn new(color: f32, roughness: f32, f0: f32) -> Self {
        let [color, roughness, f0] = [color, roughness, f0].map(f64::from);
        let mut surface = Self { color, roughness, f0, single: vec![], means: [0.0; 2] };
        let share = |step: usize| {
            let cosine = (step as f64 + 0.5) / Self::STEPS as f64;
            let viewer = DVec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
            let (rows, columns) = (400, 400);
            let mut sums = [0.0; 2];
            for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
                let y = (f64::from(row) + 0.5) / f64::from(rows);
                let angle = std::f64::consts::PI * (f64::from(column) + 0.5) / f64::from(columns);
                let light =
                    DVec3::new((1.0 - y * y).sqrt() * angle.cos(), y, (1.0 - y * y).sqrt() * angle.sin());
                let area = std::f64::consts::TAU / f64::from(rows * columns);
                let [all, colored] = surface.single_scattering(viewer, light);
                sums = [sums[0] + area * all, sums[1] + area * colored];
            }
            sums
        };
        let single: Vec<[f64; 2]> = (0..Self::STEPS).map(share).collect();
        for (step, share) in single.iter().enumerate() {
            let weight = 2.0 * (step as f64 + 0.5) / (Self::STEPS * Self::STEPS) as f64;
            surface.means = [0, 1].map(|k| surface.means[k] + weight * share[k]);
        }
        surface.single = single;
        surface
    }

    /// BSDF times cosine, without and with the Fresnel term.
    fn single_scattering(&self, to_viewer: DVec3, to_light: DVec3) -> [f64; 2] {
        let a2 = self.roughness.powi(4);
        let half = (to_viewer + to_light).normalize();
        let (cos_o, cos_i) = (to_viewer.y, to_light.y);
        let density = a2 / (std::f64::consts::PI * (half.y * half.y * (a2 - 1.0) + 1.0).powi(2));
        let fresnel = self.f0 + (1.0 - self.f0) * (1.0 - half.dot(to_light)).powi(5);
        let root = |cosine: f64| (a2 + (1.0 - a2) * cosine * cosine).sqrt();
        let visibility = 0.5 / (cos_o * root(cos_i) + cos_i * root(cos_o));
        let value = cos_i * density * visibility;
        [value, value * fresnel]
    }

    /// BSDF times cosine.
    fn scattered(&self, to_viewer: DVec3, to_light: DVec3) -> f64 {
        let at = |cosine: f64, k: usize| {
            let x = (cosine * Self::STEPS as f64 - 0.5).clamp(0.0, Self::STEPS as f64 - 1.001);
            let (first, t) = (x as usize, x.fract());
            self.single[first][k] * (1.0 - t) + self.single[first + 1][k] * t
        };
        let fresnel = self.f0 + (1.0 - self.f0) / 21.0;
        let again = fresnel * fresnel * self.means[0] / (1.0 - fresnel * (1.0 - self.means[0]));
        let lost = |cosine: f64| 1.0 - at(cosine, 0);
        let reflected = |cosine: f64| at(cosine, 1) + again * lost(cosine);
        let mean = self.means[1] + again * (1.0 - self.means[0]);
        let (cos_o, cos_i) = (to_viewer.y, to_light.y);
        let base = self.color * (1.0 - reflected(cos_o)) * (1.0 - reflected(cos_i)) / (1.0 - mean);
        let repeated = again * lost(cos_o) * lost(cos_i) / (1.0 - self.means[0]);
        self.single_scattering(to_viewer, to_light)[1] + cos_i * (base + repeated) / std::f64::consts::PI
    }
}

#[test]
fn lamps_add_up() {
    let small = Lamp { x: [-0.9, -0.5], y: 1.0, z: [-0.2, 0.2], radiance: 5.0 };
    let large = Lamp { x: [0.2, 1.8], y: 1.2, z: [-0.5, 1.0], radiance: 2.0 };
    let low = Lamp { x: [-1.5, -0.2], y: 0.8, z: [0.6, 2.0], radiance: 1.0 };
    for lamps in [&[small][..], &[small, large], &[large, small], &[low, large, small]] {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, diffuse(), 0.8);
        lamps.iter().for_each(|lamp| lamp.shine_down(&mut stage));
        let expected = 0.8 * lamps.iter().map(|lamp| lamp.lights(0.0, lamp.y)).sum::<f32>();
        let tracer = stage.tracer();
        // Nothing but the lamps, which are black, is above the floor.
        for (mode, bounces) in
            [(Mode::Direct, 0), (Mode::Direct, 8), (Mode::Path, 0), (Mode::Path, 1), (Mode::Path, 8)]
        {
            let hit = look(&tracer, Vec3::new(0.1, 0.5, 0.0), Vec3::ZERO, &limited(mode, 1 << 14, bounces));
            assert_near(hit.radiance.x, expected, 0.005);
        }
    }
}

#[test]
fn an_emissive_face_beside_a_lamp_lights_like_it() {
    // They share a side, and only one is declared as a light.
    let lamp = Lamp { x: [-1.0, 0.5], y: 1.0, z: [-1.0, 1.0], radiance: 2.0 };
    let beside = Lamp { x: [0.5, 2.0], radiance: 1.0, ..lamp };
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.8);
    lamp.shine_down(&mut stage);
    beside.shine_down(&mut stage);
    stage.scene.lights.pop();
    let tracer = stage.tracer();
    let expected = 0.8 * (lamp.lights(0.0, 1.0) + beside.lights(0.0, 1.0));
    for (mode, bounces) in [(Mode::Direct, 8), (Mode::Path, 0), (Mode::Path, 1)] {
        let hit = look(&tracer, Vec3::new(0.1, 0.5, 0.0), Vec3::ZERO, &limited(mode, 1 << 14, bounces));
        assert_near(hit.radiance.x, expected, 0.005);
    }
}

#[test]
fn each_bounce_adds_a_term_of_the_geometric_series() {
    let mut stage = Stage::new(1.0);
    stage.room(0.5, 0.25);
    let tracer = stage.tracer();
    // The walls are sampled as lights at the last bounce too.
    for (bounces, expected) in [(0, 0.375), (1, 0.4375), (2, 0.46875), (3, 0.484375)] {
        let hit =
            look(&tracer, Vec3::ZERO, Vec3::new(0.3, -1.0, 0.4), &limited(Mode::Path, 1 << 14, bounces));
        assert_near(hit.radiance.x, expected, 0.01);
    }
}

#[test]
fn lamps_light_the_last_bounce_too() {
    let mut stage = Stage::new(1.0);
    stage.room(0.5, 0.0);
    let sides: Vec<[Vec3; 4]> =
        stage.scene.mesh.positions.chunks(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
    let mut stage = Stage::new(1.0);
    for [a, b, _, d] in sides {
        stage.quad_light(a, b - a, d - a, 0.25);
        stage.scene.materials.last_mut().unwrap().color = Vec3::splat(0.5);
    }
    let tracer = stage.tracer();
    for (bounces, expected) in [(0, 0.375), (1, 0.4375), (2, 0.46875)] {
        let to = Vec3::new(0.3, -1.0, 0.4);
        let hit = look(&tracer, Vec3::ZERO, to, &limited(Mode::Path, 1 << 16, bounces));
        assert_near(hit.radiance.x, expected, 0.005);
    }
}

#[test]
fn mirrors_count_as_bounces() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, diffuse(), 0.5);
    stage.quad(Vec3::new(1.0, 0.0, -5.0), Vec3::Z * 10.0, Vec3::Y * 5.0, mirror(), 0.6, 0.0);
    point_light(&mut stage, UP * 2.0, 3.0);
    stage.scene.background = Vec3::ONE;
    let tracer = stage.tracer();
    // The mirror shows the floor below the light. Without a bounce to spare, the floor is not lit by the background.
    let floor = 0.6 * 0.5 * 3.0 / (4.0 * PI);
    for (mode, bounces, expected) in [
        (Mode::Direct, 0, 0.0),
        (Mode::Direct, 1, floor),
        (Mode::Direct, 2, floor),
        (Mode::Path, 0, 0.0),
        (Mode::Path, 1, floor),
    ] {
        let hit = look(&tracer, UP, Vec3::new(1.0, 0.5, 0.0), &limited(mode, 16, bounces));
        assert!((hit.radiance.x - expected).abs() < 1e-5, "{mode:?}, {bounces} bounces: {hit:?}");
    }
}

#[test]
fn light_comes_by_a_mirror() {
    // The mirror above shows a lamp that shines up, beside the way of its light.
    let lamp = Lamp { x: [0.5, 3.0], y: 0.2, z: [-3.0, 3.0], radiance: 2.0 };
    // On the diffuse floor, the light of the lamp's image, 1.8 above.
    let lit = 0.8 * 0.7 * lamp.lights(0.0, 1.8);
    for (surface, color, mode, expected) in [
        (diffuse(), 0.8, Mode::Path, lit),
        (diffuse(), 0.8, Mode::Direct, 0.0),
        (smooth(), 0.0, Mode::Path, 0.7 * 2.0),
        (smooth(), 0.0, Mode::Direct, 0.7 * 2.0),
    ] {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, surface, color);
        ceiling(&mut stage, mirror(), 0.7);
        lamp.shine_up(&mut stage);
        let tracer = stage.tracer();
        for (bounces, expected) in [(0, 0.0), (1, 0.0), (2, expected)] {
            let found = look(&tracer, ASLANT, Vec3::ZERO, &limited(mode, 1 << 16, bounces)).radiance.x;
            assert!((found - expected).abs() <= 0.01 * expected, "{bounces}: {found}, expected {expected}");
        }
        assert_eq!(tracer.non_finite(), 0);
    }
}

#[test]
fn both_lobes_of_a_surface_reflect_a_lamp() {
    let lamp = Lamp { x: [-1.2, -0.2], y: 1.0, z: [-0.5, 0.5], radiance: 4.0 };
    let from = Vec3::new(0.5, 0.7, 0.0);
    for (color, roughness, f0) in [(0.5, 0.3, 0.04), (0.5, 0.5, 0.3), (0.9, 0.7, 0.04), (0.05, 0.4, 0.5)] {
        let mut stage = Stage::new(1.0);
        floor(&mut stage, glossy(roughness, f0), color);
        lamp.shine_down(&mut stage);
        let tracer = stage.tracer();
        // The sum over a grid of points of the lamp, whose area is 1.
        let to_viewer = from.as_dvec3().normalize();
        let surface = Analytic::new(color, roughness, f0);
        let grid = (0..300 * 300).map(|i| {
            let [s, t] = [i % 300, i / 300].map(|k| (f64::from(k) + 0.5) / 300.0);
            let to_lamp = DVec3::new(s - 1.2, 1.0, t - 0.5);
            let direction = to_lamp.normalize();
            let value = surface.scattered(to_viewer, direction);
            4.0 * value * direction.y / to_lamp.length_squared() / (300.0 * 300.0)
        });
        let expected = grid.sum::<f64>() as f32;
        for (mode, bounces) in [(Mode::Direct, 0), (Mode::Direct, 1), (Mode::Path, 0), (Mode::Path, 1)] {
            let hit = look(&tracer, from, Vec3::ZERO, &limited(mode, 1 << 16, bounces));
            assert_near(hit.radiance.x, expected, 0.01);
        }
    }
}

#[test]
fn direct_light_has_one_glossy_reflection() {
    let mut stage = Stage::new(1.0);
    stage.room(0.0, 0.25);
    stage.scene.materials.iter_mut().for_each(|material| {
        *material = Material { emission: material.emission, color: Vec3::ZERO, ..glossy(0.3, 1.0) }
    });
    let tracer = stage.tracer();
    // The walls are sampled as lights at the last surface too.
    for (mode, terms) in [(Mode::Direct, [2.0, 3.0, 3.0, 3.0]), (Mode::Path, [2.0, 3.0, 4.0, 5.0])] {
        for (bounces, terms) in (0..).zip(terms) {
            let hit = look(&tracer, Vec3::ZERO, Vec3::new(0.1, -1.0, 0.2), &limited(mode, 1 << 15, bounces));
            // The last term is noisy: a missing one is a sixth at least.
            assert_near(hit.radiance.x, 0.25 * terms, 0.06);
        }
    }
}

#[test]
fn a_glossy_surface_shows_another_by_the_light_on_it() {
    // Off the highlight, where a small change of direction changes little.
    let light = Vec3::new(1.2, 0.3, 0.4);
    let (own, f0) = (0.2, 0.5);
    let mut stage = Stage::new(1.0);
    floor(&mut stage, smooth(), 0.0);
    ceiling(&mut stage, glossy(own, f0), 0.0);
    point_light(&mut stage, light, 3.0);
    let tracer = stage.tracer();
    // At x = y = 1; the ceiling faces down.
    let to_light = DVec3::new(0.2, 0.7, 0.4);
    for (mode, roughness) in [(Mode::Direct, REFLECTED_ALPHA.sqrt()), (Mode::Path, own)] {
        let to_viewer = DVec3::new(-1.0, 1.0, 0.0).normalize();
        let value = Analytic::new(0.0, roughness, f0).scattered(to_viewer, to_light.normalize());
        let expected = (3.0 * value / to_light.length_squared()) as f32;
        let hit = look(&tracer, ASLANT, Vec3::ZERO, &limited(mode, 1 << 10, 1));
        assert_near(hit.radiance.x, expected, 0.02);
    }
}

#[test]
fn a_glossy_surface_shows_the_light_of_every_lamp() {
    let mut stage = Stage::new(1.0);
    floor(&mut stage, smooth(), 0.0);
    ceiling(&mut stage, diffuse(), 0.5);
    let lamps = [
        Lamp { x: [1.5, 2.5], y: 0.1, z: [0.5, 1.5], radiance: 4.0 },
        Lamp { x: [-0.5, 1.5], y: 0.3, z: [-3.0, -0.5], radiance: 2.0 },
    ];
    lamps.iter().for_each(|lamp| lamp.shine_up(&mut stage));
    let points = [(Vec3::new(1.0, 0.2, 0.0), 1.0), (Vec3::new(2.0, 0.5, 0.3), 2.0)];
    points.iter().for_each(|&(position, intensity)| point_light(&mut stage, position, intensity));
    let of_points = points.map(|(position, intensity)| {
        let to_light = position - Vec3::new(1.0, 1.0, 0.0);
        intensity * -to_light.y / to_light.length().powi(3) / PI
    });
    let of_lamps = lamps.map(|lamp| lamp.lights(1.0, 1.0 - lamp.y));
    let expected = 0.5 * of_points.iter().chain(&of_lamps).sum::<f32>();
    let tracer = stage.tracer();
    for mode in [Mode::Direct, Mode::Path] {
        let hit = look(&tracer, ASLANT, Vec3::ZERO, &limited(mode, 1 << 16, 1));
        assert_near(hit.radiance.x, expected, 0.01);
    }
}
