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
    // Its front, towards u x v, is that to the box.
    let v = side * u.normalize().cross(towards);
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
                // The random number is below 1, and this below the last sum.
                let face = self.sums.partition_point(|&sum| sum <= at);
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
        assert_eq!(notes, ["added: a light in front, to the upper left, as there is none"]);
        let [Light::Quad { corner, u, v, .. }] = lights[..] else { panic!("{lights:?}") };
        // Three radii away.
        let expected = 3.0 * 3_f32.sqrt() * Vec3::new(-3.0, 6.0, 4.0) / 61_f32.sqrt();
        assert!((corner + 0.5 * (u + v)).distance(expected) < 1e-5);
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
    fn points_are_spread_evenly_within_a_face() {
        let mut faces = Weighted::default();
        let [a, b, c] = [Vec3::new(1.0, 0.0, 5.0), Vec3::new(4.0, 0.0, 5.0), Vec3::new(1.0, 6.0, 5.0)];
        faces.push([a, b, c], 2.0);
        assert_eq!(faces.total(), 18.0);
        let points = faces.points(4096);
        let mean = points.iter().map(|[point, _]| *point).sum::<Vec3>() / 4096.0;
        assert!(mean.distance((a + b + c) / 3.0) < 0.05, "{mean}");
        // A quarter of the face is nearer to each corner than the line through the middles of its sides.
        let near = |corner: Vec3, across: Vec3, half: f32| {
            points.iter().filter(|[point, _]| (*point - corner).dot(across) < half).count()
        };
        for count in
            [near(b, Vec3::NEG_X, 1.5), near(c, Vec3::NEG_Y, 3.0), near(a, Vec3::new(2.0, 1.0, 0.0), 3.0)]
        {
            assert!(count.abs_diff(1024) < 100, "{count}");
        }
        assert!(
            points
                .iter()
                .all(|[point, normal]| (point.z - 5.0).abs() < 1e-5 && normal.distance(Vec3::Z) < 1e-6)
        );
    }

    /// A small square around `at`, with a normal along z, in triangles; its area is 1e-4.
    fn patch(at: Vec3) -> [[Vec3; 3]; 2] {
        let [a, b, c, d] = [[-5e-3, -5e-3], [5e-3, -5e-3], [5e-3, 5e-3], [-5e-3, 5e-3]]
            .map(|[x, y]| at + Vec3::new(x, y, 0.0));
        [[a, b, c], [a, c, d]]
    }

    #[test]
    fn grey_surfaces_show_what_emissive_ones_send() {
        let lit = |passive: &[Vec3], emissive: &[(Vec3, f32)]| {
            let mut surfaces =
                Surfaces { all: vec![], passive: Weighted::default(), emissive: Weighted::default() };
            for at in passive {
                patch(*at).into_iter().for_each(|corners| surfaces.passive.push(corners, 1.0));
            }
            for (at, weight) in emissive {
                patch(*at).into_iter().for_each(|corners| surfaces.emissive.push(corners, *weight));
            }
            surfaces.lit_by_emitters()
        };
        // By the power, the square of the distance and both cosines.
        let at = Vec3::new(1.0, -2.0, 3.0);
        for (offset, weight) in [
            (Vec3::new(0.0, 0.0, 2.0), 1.0),
            (Vec3::new(0.0, 0.0, -0.5), 1.0),
            (Vec3::new(0.0, 3.0, 4.0), 40.0),
            (Vec3::new(-3.0, 0.0, -4.0), 7.0),
        ] {
            let cosine = offset.z / offset.length();
            let expected =
                0.5 / std::f32::consts::PI * 1e-4 * weight * cosine * cosine / offset.length_squared();
            let found = lit(&[at], &[(at + offset, weight)]);
            assert!((found / expected - 1.0).abs() < 0.03, "{offset}: {found}, expected {expected}");
        }
        assert_eq!(lit(&[at], &[]), 0.0);
        // The median of three, whatever their order.
        let [near, middle, far] = [1.0, 2.0, 4.0].map(|z| z * Vec3::NEG_Z);
        let alone = lit(&[middle], &[(Vec3::ZERO, 1.0)]);
        for order in [[near, middle, far], [far, near, middle], [middle, far, near]] {
            assert!((lit(&order, &[(Vec3::ZERO, 1.0)]) / alone - 1.0).abs() < 0.03, "{order:?}");
        }
    }

    #[test]
    fn surfaces_emit_from_one_side_or_two_in_all_channels() {
        let square = Shape::quad([Vec3::ZERO, 2.0 * Vec3::X, Vec3::new(2.0, 3.0, 0.0), 3.0 * Vec3::Y]);
        let lamp = |double_sided, radiance| Material { double_sided, ..Material::lamp("", radiance) };
        let totals = |material: Material| {
            let surfaces = Surfaces::of(&builder(&[(square.clone(), material), (cube(0.5), grey())]));
            (surfaces.all.len(), surfaces.emissive.total(), surfaces.passive.total())
        };
        assert_eq!(totals(lamp(false, Vec3::ONE)), (14, 6.0, 6.0));
        assert_eq!(totals(lamp(true, Vec3::new(3.0, 0.0, 0.0))), (14, 12.0, 6.0));
        assert_eq!(totals(lamp(false, Vec3::new(0.0, 6.0, 3.0))), (14, 18.0, 6.0));
        assert_eq!(totals(grey()), (14, 0.0, 12.0));
        assert_eq!(totals(Material { unlit: true, ..grey() }), (14, 0.0, 6.0));
    }

    /// The triangles of a room from -2 to 2 with a square hole in its ceiling, of so much to each side.
    fn room(hole: f32) -> Surfaces {
        let face = |at: &dyn Fn(f32, f32) -> Vec3, [x0, x1]: [f32; 2], [y0, y1]: [f32; 2]| {
            let [a, b, c, d] = [at(x0, y0), at(x1, y0), at(x1, y1), at(x0, y1)];
            [[a, b, c], [a, c, d]]
        };
        let whole = [-2.0, 2.0];
        let ceiling = |x, z| Vec3::new(x, 2.0, z);
        let all = [
            face(&|x, z| Vec3::new(x, -2.0, z), whole, whole),
            face(&|y, z| Vec3::new(-2.0, y, z), whole, whole),
            face(&|y, z| Vec3::new(2.0, y, z), whole, whole),
            face(&|x, y| Vec3::new(x, y, -2.0), whole, whole),
            face(&|x, y| Vec3::new(x, y, 2.0), whole, whole),
            face(&ceiling, [-2.0, -hole], whole),
            face(&ceiling, [hole, 2.0], whole),
            face(&ceiling, [-hole, hole], [-2.0, -hole]),
            face(&ceiling, [-hole, hole], [hole, 2.0]),
        ];
        Surfaces { all: all.concat(), passive: Weighted::default(), emissive: Weighted::default() }
    }

    #[test]
    fn walls_are_looked_for_in_all_directions() {
        for eye in [Vec3::ZERO, Vec3::new(0.5, -0.3, 0.25)] {
            // Even steps of height and golden angles, up to the first of the planes at 2 and -2.
            let mut distances: Vec<f64> = (0..64)
                .map(|index| {
                    let y = 1.0 - (2.0 * f64::from(index) + 1.0) / 64.0;
                    let (radius, angle) = ((1.0 - y * y).sqrt(), 2.399_963 * f64::from(index));
                    let direction = [radius * angle.cos(), y, radius * angle.sin()];
                    let ways = direction.into_iter().zip(eye.to_array());
                    let way = |(along, at): (f64, f32)| (2.0 - along.signum() * f64::from(at)) / along.abs();
                    ways.map(way).fold(f64::INFINITY, f64::min)
                })
                .collect();
            distances.sort_by(f64::total_cmp);
            let found = room(0.0).wall_distance(eye).unwrap();
            assert!((f64::from(found) - distances[48]).abs() < 1e-4, "{found} {}", distances[48]);
        }
        // Four directions lead out of a hole of 1.1, five out of a slightly larger one.
        let [closed, open] = [0.0, 1.1].map(|hole| room(hole).wall_distance(Vec3::ZERO).unwrap());
        assert!(open > 2.0 && open < closed + 0.2, "{open} {closed}");
        assert_eq!(room(1.16).wall_distance(Vec3::ZERO), None);
        // Four and five lead out of holes in the floor, too.
        let turned = |hole: f32| {
            let mut room = room(hole);
            room.all.iter_mut().flatten().for_each(|corner| corner.y = -corner.y);
            room.wall_distance(Vec3::ZERO)
        };
        assert!(turned(1.0).is_some() && turned(1.13).is_none());
    }

    #[test]
    fn rays_hit_a_triangle_within_its_sides_and_before_them() {
        let triangle = [Vec3::new(1.0, 1.0, 2.0), Vec3::new(3.0, 1.0, 2.0), Vec3::new(1.0, 5.0, 2.0)];
        for (x, y, is_hit) in [
            (1.5, 2.0, true),
            (1.0, 1.0, true),
            (1.0, 4.0, true),
            (2.0, 1.0, true),
            (2.0, 3.0, true),
            (3.0, 1.0, true),
            (0.99, 2.0, false),
            (2.0, 0.99, false),
            (2.01, 3.0, false),
            (1.0, 5.01, false),
            (3.01, 1.0, false),
        ] {
            for z in [0.0, 1.75, 2.5, 4.0] {
                let (origin, towards) = (Vec3::new(x, y, z), if z < 2.0 { Vec3::Z } else { Vec3::NEG_Z });
                let expected = if is_hit { (z - 2.0_f32).abs() } else { f32::INFINITY };
                assert_eq!(hit(triangle, origin, towards), expected, "{origin}");
                assert_eq!(hit(triangle, origin, -towards), f32::INFINITY, "{origin}, away");
            }
            // On the triangle, and along its plane.
            assert_eq!(hit(triangle, Vec3::new(x, y, 2.0), Vec3::Z), f32::INFINITY);
            assert_eq!(hit(triangle, Vec3::new(-9.0, y, 2.0), Vec3::X), f32::INFINITY);
        }
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
