//! The light of a scene that has none of its own to speak of.

use glam::Vec3;

use super::model::radius_of;
use crate::builder::{MeshError, SceneBuilder};
use crate::limits::is_near;
use crate::report::NoteKind;
use crate::{Camera, Rng};

/// Emissive surfaces count as lights if half of the other surfaces, if they were grey, would show at least this radiance,
/// a hundredth of what the default light makes of them.
const LEAST_RADIANCE: f32 = 0.005;

/// Points of surfaces, and of emissive surfaces, at which this is judged.
const POINTS: usize = 256;
const EMITTERS: usize = 64;

/// Directions in which the eye looks for walls, and how many of them must meet one.
const DIRECTIONS: u32 = 64;
const WALLS: usize = 60;

/// Adds a light if the scene has none, no sky, and no emissive surfaces that are bright and large enough to see the rest by:
/// a quad in front of it, or if `camera`, the file's own, is indoors, a point where the eye is.
pub(crate) fn add_default_light(
    builder: &mut SceneBuilder,
    camera: Option<&Camera>,
    bounds: [Vec3; 2],
) -> Result<(), MeshError> {
    if builder.has_own_light() {
        return Ok(());
    }
    if !builder.has_triangles() {
        return Err(MeshError::Empty);
    }
    let surfaces = Surfaces::of(builder);
    if surfaces.passive.is_empty() || surfaces.lit_by_emitters() >= LEAST_RADIANCE {
        return Ok(());
    }
    let why =
        if surfaces.emissive.is_empty() { "there is none" } else { "its emissive surfaces are too dim" };
    if let Some(eye) = camera.map(|camera| camera.eye)
        && let Some(distance) = surfaces.wall_distance(eye)
    {
        builder.report.add(NoteKind::Added, format!("a point light at the eye, as {why}"), "");
        builder.point_light(eye, Vec3::splat(std::f32::consts::PI * distance * distance));
        return Ok(());
    }
    builder.report.add(NoteKind::Added, format!("a light in front, to the upper left, as {why}"), "");
    add_quad(builder, bounds)
}

/// A quad light to the upper left in front of the box, half as wide as the box's diagonal, that makes a white surface
/// that faces it about as bright as white.
fn add_quad(builder: &mut SceneBuilder, bounds: [Vec3; 2]) -> Result<(), MeshError> {
    let centre = bounds[0].midpoint(bounds[1]);
    let radius = radius_of(bounds);
    let towards = Vec3::new(-0.6, 1.2, 0.8).normalize();
    let distance = 3.0 * radius;
    let side = radius;
    let u = side * towards.cross(Vec3::Y).normalize();
    let v = side * u.normalize().cross(towards);
    let (u, v) = if u.cross(v).dot(towards) < 0.0 { (u, v) } else { (v, u) };
    // Radiance of a white surface: L A / (pi d^2).
    let radiance = std::f32::consts::PI * (distance / side).powi(2);
    let corner = centre + distance * towards - 0.5 * (u + v);
    if ![corner, corner + u, corner + u + v, corner + v].into_iter().all(is_near) {
        return Err(MeshError::NoRoomForLight);
    }
    builder.added_quad_light(corner, u, v, Vec3::splat(radiance))
}

/// The triangles of a scene under construction.
struct Surfaces {
    all: Vec<[Vec3; 3]>,
    /// Those that other surfaces light.
    passive: Weighted,
    /// Those that emit, weighted by their power.
    emissive: Weighted,
}

/// Triangles, each with its weight and area normal.
#[derive(Default)]
struct Weighted {
    faces: Vec<([Vec3; 3], f32)>,
    /// The sum of the weights of each triangle and all before.
    sums: Vec<f64>,
}

impl Weighted {
    fn push(&mut self, corners: [Vec3; 3], weight: f32) {
        let area = f64::from(area_normal(corners).length());
        self.faces.push((corners, weight));
        self.sums.push(self.sums.last().unwrap_or(&0.0) + area * f64::from(weight));
    }

    fn is_empty(&self) -> bool {
        self.total() == 0.0
    }

    fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or_default()
    }

    /// Random points with the unit normals there; dense in proportion to the weights.
    fn points(&self, count: usize) -> Vec<[Vec3; 2]> {
        let mut rng = Rng::new(0, count as u64);
        (0..count)
            .map(|index| {
                let at = (index as f64 + f64::from(rng.next_f32())) / count as f64 * self.total();
                let face = self.sums.partition_point(|&sum| sum <= at).min(self.faces.len() - 1);
                let [a, b, c] = self.faces[face].0;
                let [s, t] = rng.next_pair();
                let root = s.sqrt();
                let point = a * (1.0 - root) + b * (root * (1.0 - t)) + c * (root * t);
                [point, area_normal([a, b, c]).normalize_or_zero()]
            })
            .collect()
    }
}

fn area_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    0.5 * (b - a).cross(c - a)
}

impl Surfaces {
    fn of(builder: &SceneBuilder) -> Self {
        let mut surfaces = Self { all: vec![], passive: Weighted::default(), emissive: Weighted::default() };
        for (corners, material) in builder.faces() {
            surfaces.all.push(corners);
            if material.emits() {
                let sides = if material.double_sided { 2.0 } else { 1.0 };
                surfaces.emissive.push(corners, sides * material.emission.element_sum() / 3.0);
            } else if !material.unlit {
                surfaces.passive.push(corners, 1.0);
            }
        }
        surfaces
    }

    /// The median radiance over the passive surfaces, were they grey, by the light of the emissive ones, were nothing in
    /// its way.
    fn lit_by_emitters(&self) -> f32 {
        if self.emissive.is_empty() {
            return 0.0;
        }
        let emitters = self.emissive.points(EMITTERS);
        let power = self.emissive.total() as f32 / EMITTERS as f32;
        let mut lit: Vec<f32> = self
            .passive
            .points(POINTS)
            .into_iter()
            .map(|[point, normal]| {
                let arriving = |&[from, axis]: &[Vec3; 2]| {
                    let (direction, distance) = (from - point).normalize_and_length();
                    // Half of the emissive surface is seen from its back; twice the other half makes up for it.
                    let cosines = axis.dot(direction).abs() * normal.dot(direction).abs();
                    if distance > 0.0 { power * cosines / (distance * distance) } else { 0.0 }
                };
                0.5 * std::f32::consts::FRAC_1_PI * emitters.iter().map(arriving).sum::<f32>()
            })
            .collect();
        lit.sort_by(f32::total_cmp);
        lit[POINTS / 2]
    }

    /// The distance to the walls around a point, farther than three quarters of what is seen from it; `None` if it is
    /// outdoors.
    fn wall_distance(&self, eye: Vec3) -> Option<f32> {
        let mut distances: Vec<f32> = (0..DIRECTIONS)
            .map(|index| {
                // A spiral over the sphere, in even steps.
                let y = 1.0 - (2.0 * index as f32 + 1.0) / DIRECTIONS as f32;
                let angle = 2.399_963 * index as f32;
                let radius = (1.0 - y * y).sqrt();
                let direction = Vec3::new(radius * angle.cos(), y, radius * angle.sin());
                self.all.iter().map(|&corners| hit(corners, eye, direction)).fold(f32::INFINITY, f32::min)
            })
            .filter(|distance| distance.is_finite())
            .collect();
        distances.sort_by(f32::total_cmp);
        (distances.len() >= WALLS).then(|| distances[distances.len() * 3 / 4])
    }
}

/// The distance at which a ray hits a triangle, infinite for a miss (Möller and Trumbore 1997).
fn hit([a, b, c]: [Vec3; 3], origin: Vec3, direction: Vec3) -> f32 {
    let [first, second, from] = [b - a, c - a, origin - a];
    let across = direction.cross(second);
    let scale = 1.0 / first.dot(across);
    let u = from.dot(across) * scale;
    let turned = from.cross(first);
    let v = direction.dot(turned) * scale;
    let distance = second.dot(turned) * scale;
    // A ray along the triangle's plane divides by zero, and is no hit.
    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 { distance } else { f32::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::MAX_COORDINATE;
    use crate::{Light, Material, Report, Shape};

    fn builder(parts: &[(Shape, Material)]) -> SceneBuilder {
        let mut builder = SceneBuilder::new();
        for (shape, material) in parts {
            let material = builder.material(material.clone());
            builder.add(shape, material).unwrap();
        }
        builder
    }

    fn cube(half: f32) -> Shape {
        Shape::cuboid(Vec3::splat(-half), Vec3::splat(half))
    }

    fn grey() -> Material {
        Material::diffuse("", Vec3::splat(0.5))
    }

    /// The lights and the notes after a default light was added, if it was.
    fn added(mut builder: SceneBuilder, camera: Option<&Camera>) -> (Vec<Light>, Vec<String>) {
        let bounds = builder.bounds();
        add_default_light(&mut builder, camera, bounds).unwrap();
        let any = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        let scene = builder.build("", any, Vec3::ZERO, 0.0, 40.0).unwrap();
        let is_added = |notes: &Report| notes.notes().iter().any(|note| note.what.starts_with("a light in"));
        let added = if is_added(&scene.report) { 2 } else { 0 };
        let triangles = scene.mesh.triangles.len();
        assert!(scene.added.clone().eq(triangles - added..triangles), "{:?}", scene.added);
        (scene.lights.to_vec(), scene.report.notes().iter().map(ToString::to_string).collect())
    }

    #[test]
    fn a_scene_without_lights_gets_one_in_front() {
        let (lights, notes) = added(builder(&[(cube(1.0), grey())]), None);
        assert!(matches!(lights[..], [Light::Quad { .. }]));
        assert_eq!(notes, ["added: a light in front, to the upper left, as there is none"]);
    }

    #[test]
    fn all_corners_of_the_light_are_within_the_limits() {
        let half = Vec3::splat(1e6);
        let corners_around = |centre: Vec3| {
            let mut builder = SceneBuilder::new();
            add_quad(&mut builder, [centre - half, centre + half])?;
            let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
            let scene = builder.build("", camera, Vec3::ZERO, 0.0, 40.0).unwrap();
            let [Light::Quad { corner, u, v, .. }] = scene.lights[..] else { panic!("{:?}", scene.lights) };
            Ok::<_, MeshError>([corner, corner + u, corner + v, corner + u + v])
        };
        let corners = corners_around(Vec3::ZERO).unwrap();
        // Each corner is the outermost one in one of these directions.
        for axis in [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z] {
            let most = corners.map(|corner| corner.dot(axis)).into_iter().fold(f32::NEG_INFINITY, f32::max);
            let at = |outermost: f32| corners_around((outermost - most) * axis);
            assert!(at(MAX_COORDINATE - 1e3).is_ok(), "{axis}");
            assert_eq!(at(MAX_COORDINATE + 1e3), Err(MeshError::NoRoomForLight), "{axis}");
        }
    }

    #[test]
    fn small_or_dim_emissive_surfaces_do_not_take_it_away() {
        let lamp = |half: f32, radiance: f32| {
            let lamp = cube(half).moved(2.0 * Vec3::Y);
            added(builder(&[(cube(1.0), grey()), (lamp, Material::lamp("", Vec3::splat(radiance)))]), None)
        };
        for (half, radiance, own) in
            [(0.01, 1.0, false), (0.01, 1e4, true), (0.5, 1.0, true), (0.5, 0.01, false)]
        {
            let (lights, notes) = lamp(half, radiance);
            assert_eq!(lights.is_empty(), own, "{half}, {radiance}");
            let expected = "added: a light in front, to the upper left, as its emissive surfaces are too dim";
            assert!(own || notes == [expected], "{notes:?}");
        }
    }

    #[test]
    fn lamps_of_a_scene_and_surfaces_that_need_none_are_enough() {
        let mut with_point = builder(&[(cube(1.0), grey())]);
        with_point.point_light(Vec3::splat(3.0), Vec3::splat(1e-6));
        assert_eq!(added(with_point, None).1, [""; 0]);
        let mut with_quad = builder(&[(cube(1.0), grey())]);
        with_quad.quad_light(Vec3::splat(3.0), Vec3::X, Vec3::Z, Vec3::splat(1e-6)).unwrap();
        assert_eq!(added(with_quad, None).1, [""; 0]);
        let unlit = Material { unlit: true, ..grey() };
        assert!(added(builder(&[(cube(1.0), unlit)]), None).0.is_empty());
    }

    #[test]
    fn points_are_spread_over_faces_as_these_are_weighted() {
        let mut faces = Weighted::default();
        for (x, weight) in [(0.0, 1.0), (1.0, 2.0), (2.0, 0.0), (3.0, 1.0)] {
            faces.push([Vec3::ZERO, 0.5 * Vec3::X, Vec3::Y].map(|corner| corner + x * Vec3::X), weight);
        }
        let on = |count| faces.points(count).iter().map(|[point, _]| point.x as u32).collect::<Vec<_>>();
        assert_eq!(on(4), [0, 1, 1, 3]);
        assert_eq!(on(8), [0, 0, 1, 1, 1, 1, 3, 3]);
    }

    #[test]
    fn indoors_it_stands_at_the_eye() {
        let eye = Vec3::new(0.2, -0.1, 0.3);
        let camera = Camera::look_at(eye, Vec3::ZERO, 1.0, 0.1, 10.0);
        let (lights, notes) = added(builder(&[(cube(2.0), grey())]), Some(&camera));
        let [Light::Point { position, intensity }] = lights[..] else { panic!("{lights:?}") };
        // A white wall 2 to 3.5 m away is about as bright as white.
        let distance = (intensity.x / std::f32::consts::PI).sqrt();
        assert!(position == eye && (1.7..3.5).contains(&distance), "{distance}");
        assert_eq!(notes, ["added: a point light at the eye, as there is none"]);
        // The same camera before a wall, and one that looks into the room from outside.
        let wall = Shape::quad(
            [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, y]| Vec3::new(x, y, -1.0)),
        );
        assert!(matches!(added(builder(&[(wall, grey())]), Some(&camera)).0[..], [Light::Quad { .. }]));
        let outside = Camera { eye: Vec3::splat(5.0), ..camera };
        assert!(matches!(added(builder(&[(cube(2.0), grey())]), Some(&outside)).0[..], [Light::Quad { .. }]));
    }
}
