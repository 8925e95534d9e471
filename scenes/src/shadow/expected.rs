//! How many boundaries a scene will have, before they are searched.

use glam::Vec3;

use crate::{Light, NO_FACE, Scene};

/// The most edges that are looked at, counted anew for each light; of more, a part stands for all. It takes some ten
/// milliseconds.
const MOST_TESTS: usize = 1 << 21;

/// 2^32 over the golden ratio.
const GOLDEN: u32 = 0x9E37_79B9;

/// The number of boundaries, roughly: at most twice as many were found in any scene that was tried, and mostly a fifth.
///
/// Each silhouette edge, as seen from the middle of a light, counts for one, and for as many more as edges of average
/// length fit into its shadow: the triangles on which a shadow falls divide it. A shadow is taken to be as long as if it
/// fell on the farthest corner of the scene, but no longer than the scene.
pub(crate) fn expected_segments(scene: &Scene) -> usize {
    let mesh = &scene.mesh;
    let tests = mesh.edges.len() * scene.lights.len();
    // Multiples of the golden ratio keep in step with no pattern of the mesh.
    let share = (MOST_TESTS as f64 / tests.max(1) as f64).min(1.0);
    let least = (share * f64::from(u32::MAX)) as u32;
    let counts = move |index: &usize| (*index as u32).wrapping_mul(GOLDEN) <= least;
    let ends = |edge: &crate::Edge| edge.vertices.map(|vertex| mesh.positions[vertex as usize]);
    let edges = || (0..mesh.edges.len()).filter(counts).map(|index| &mesh.edges[index]);
    let lengths = edges().map(|edge| length(ends(edge)));
    let mean = (lengths.sum::<f64>() / edges().count().max(1) as f64).max(f64::MIN_POSITIVE);
    let [low, high] = scene.bounds;
    let diagonal = length(scene.bounds);
    let mut expected = 0.0;
    for light in &scene.lights {
        let middle = match *light {
            Light::Point { position, .. } | Light::Spot { position, .. } => position,
            Light::Quad { corner, u, v, .. } => corner + 0.5 * (u + v),
        };
        let farthest = length([Vec3::ZERO, (middle - low).abs().max((middle - high).abs())]);
        for edge in edges() {
            let [a, b] = ends(edge);
            let faces = |face: u32| mesh.face_normals[face as usize].dot(middle - a) > 0.0;
            let [first, second] = edge.faces;
            if second != NO_FACE && faces(first) == faces(second) {
                continue;
            }
            let distance = length([a.midpoint(b), middle]).clamp(f64::MIN_POSITIVE, farthest);
            let shadow = (length([a, b]) * (farthest / distance)).min(diagonal);
            expected += 1.0 + shadow / mean;
        }
    }
    // Rounds to the largest number if it is too large.
    (expected / share) as usize
}

fn length([a, b]: [Vec3; 2]) -> f64 {
    a.as_dvec3().distance(b.as_dvec3())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{Camera, Material, SceneBuilder, ShadowSettings, Shape, Tracer, shadow_segments};

    /// The most segments of a scene in some of its frames, with the widest penumbrae.
    fn found(scene: Scene) -> usize {
        let frames = if scene.bodies.is_empty() { 1 } else { 80 };
        let tracer = Arc::new(Tracer::new(Arc::new(scene)));
        let settings =
            ShadowSettings { capacity: usize::MAX, max_penumbra: 1.0, ..ShadowSettings::default() };
        let search = |frame| shadow_segments(&tracer.at(frame), &settings, &|_| true).unwrap().segments.len();
        (0..frames).step_by(10).map(search).max().unwrap()
    }

    /// `posts` on a rough ground of `n` x `n` quads: the scene with the most boundaries for its edges.
    fn posts(n: u32, posts: u32, quad: bool) -> Scene {
        let mut builder = SceneBuilder::new();
        let white = builder.material(Material::diffuse("", Vec3::ONE));
        let place = |i: u32, j: u32| {
            let height = (7919 * i + 104_729 * j) % 17;
            Vec3::new(10.0 * i as f32 / n as f32, 0.001 * height as f32, -10.0 * j as f32 / n as f32)
        };
        builder.add(&Shape::surface(n, n, place), white).unwrap();
        for post in 0..posts {
            let foot = Vec3::new(0.5 + 0.22 * (post % 40) as f32, 0.1, -0.5 - 0.36 * (post / 40) as f32);
            builder.add(&Shape::cuboid(foot, foot + Vec3::new(0.1, 0.9, 0.1)), white).unwrap();
        }
        let at = Vec3::new(5.0, 6.0, -5.0);
        if quad {
            builder.quad_light(at, 0.3 * Vec3::X, 0.3 * Vec3::Z, Vec3::ONE).unwrap();
        } else {
            builder.point_light(at, Vec3::ONE);
        }
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        builder.build("", camera, Vec3::ZERO, 0.0, 40.0).unwrap()
    }

    #[test]
    fn scenes_have_at_most_twice_the_expected_boundaries_and_not_far_fewer() {
        let load = |name: &str| Scene::load(name).unwrap();
        let scenes = ["cornell", "cornell-moving", "chains", "still-life", "room"].map(load).into_iter();
        let made =
            [(10, 1, true), (100, 100, false), (100, 1000, true)].map(|(n, many, quad)| posts(n, many, quad));
        for scene in scenes.chain(made) {
            let (name, expected) = (scene.name.clone(), expected_segments(&scene));
            let found = found(scene);
            println!("{name}: {found} of {expected}");
            assert!(found <= 2 * expected && expected <= 10 * found, "{name}: {found}, expected {expected}");
        }
    }

    #[test]
    fn of_many_edges_and_lights_a_part_stands_for_all() {
        let mut scene = Scene::load("chains").unwrap();
        let one = expected_segments(&scene) / scene.lights.len();
        scene.lights = vec![scene.lights[0]; 50];
        let many = expected_segments(&scene);
        let lights = Scene { lights: vec![scene.lights[0]], ..scene };
        let expected = 50 * expected_segments(&lights);
        assert!(one > 0 && many.abs_diff(expected) < expected / 10, "{many}, not {expected}");
        // Not all were looked at: rounding alone would make less of a difference.
        println!("{many} {expected}");
        assert!(many.abs_diff(expected) > 50);
    }

    #[test]
    fn each_silhouette_edge_counts_for_itself_and_the_edges_in_its_shadow() {
        // A square with four borders of 1 m and a diagonal of 1.414, on average 1.083.
        let corners = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];
        let place = Vec3::new(16.0, -8.0, -32.0);
        let mut builder = SceneBuilder::new();
        let white = builder.material(Material::diffuse("", Vec3::ONE));
        builder.add(&Shape::quad(corners.map(|[x, z]| place + Vec3::new(x, 0.0, z))), white).unwrap();
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        let scene = builder.build("", camera, Vec3::ZERO, 0.0, 40.0).unwrap();
        let expected = |position: [f32; 3]| {
            let light = Light::Point { position: place + Vec3::from(position), intensity: Vec3::ONE };
            expected_segments(&Scene { lights: vec![light; 100], ..scene.clone() })
        };
        // From the middle of a border it is 2.062 to the light, and from there 2.121 to the farthest corner: four times
        // 1 + 2.121 / 2.062 / 1.083.
        assert_eq!(expected([0.5, 2.0, 0.5]), 780);
        // Near one border, the shadows of three are as long as the square's diagonal, and that of the fourth is 1.0782 /
        // 0.9552: 3 (1 + 1.414 / 1.083) + 1 + 1.1287 / 1.083.
        assert_eq!(expected([0.5, 0.1, 0.05]), 896);
    }

    #[test]
    fn without_edges_or_lights_nothing_is_expected() {
        let scene = Scene::load("cornell").unwrap();
        assert_eq!(expected_segments(&Scene { lights: vec![], ..scene.clone() }), 0);
        assert_eq!(expected_segments(&Scene::empty("", scene.camera, scene.bounds)), 0);
    }
}
