//! The edge-and-point image of meshes unlike those of the built-in scenes: as large as the papers' largest, with
//! borders only, and seen along the planes of their faces. Both sides start each frame from the same state, with poison
//! on.

use std::sync::Arc;

use epigraph_core::{Settings, Side};
use epigraph_scenes::{CREASE_ANGLE, Camera, Material, Scene, SceneBuilder, Shape};
use epigraph_tests::{Run, frame_on_both, graph, sampled, tap};
use glam::Vec3;

const SIZE: [u32; 2] = [96, 72];
const INTEGERS: [&str; 3] = ["silhouette.drawn", "edge_raster.mask", "reach_cull.cls"];

/// How many elements of an integer list or image may differ because of rounding.
const ROUNDING: usize = 4;

/// A shape under a lamp, seen from `eye`, which looks at the origin.
fn scene(shape: &Shape, eye: Vec3) -> Arc<Scene> {
    let mut builder = SceneBuilder::new();
    let material = builder.material(Material::diffuse("clay", Vec3::splat(0.7)));
    builder.add(shape, material).unwrap();
    builder.point_light(Vec3::new(1.0, 3.0, 2.0), Vec3::splat(30.0));
    let camera = Camera::look_at(eye, Vec3::ZERO, 0.9, 0.05, 50.0);
    Arc::new(builder.build("test", camera, Vec3::splat(0.1), 0.0, CREASE_ANGLE).unwrap())
}

/// Runs some frames on both sides and compares them. Returns the last frame's bits of silhouettes, and its picture.
#[track_caller]
fn both_sides(scene: &Arc<Scene>, frames: u32) -> (Vec<u32>, Vec<u8>) {
    let [mut cpu, mut gpu] = [Side::Cpu, Side::Gpu].map(|side| {
        let taps = INTEGERS.map(tap).to_vec();
        let settings = Settings { side, poison: true, taps, ..sampled(SIZE, 0.2) };
        Run::in_scene(&graph("epi.ron"), scene, "still", settings)
    });
    for frame in 0..frames {
        frame_on_both(&mut cpu, &mut gpu, &INTEGERS, ROUNDING, &format!("frame {frame}"));
        let [a, b] = [&mut cpu, &mut gpu].map(|run| run.captured("image").bytes);
        let differ = a.iter().zip(&b).filter(|(a, b)| a.abs_diff(**b) > 1).count();
        assert!(differ <= a.len() / 200, "frame {frame}: {differ} of {} bytes differ", a.len());
    }
    (cpu.captured("silhouette.drawn").get(), cpu.captured("image").bytes)
}

fn ones(words: &[u32]) -> u32 {
    words.iter().map(|word| word.count_ones()).sum()
}

/// The number of pixels that differ from the background, which the first pixel shows.
fn covered(image: &[u8]) -> usize {
    image.chunks_exact(4).filter(|pixel| pixel[..] != image[..4]).count()
}

#[test]
fn a_mesh_with_as_many_edges_as_the_papers_dragon() {
    let scene = scene(&Shape::sphere(1.0, 768, 569), Vec3::new(0.0, 1.0, 3.0));
    assert_eq!(scene.mesh.edges.len(), 1_308_672);
    let (drawn, image) = both_sides(&scene, 2);
    assert!((900..5000).contains(&ones(&drawn)), "{} silhouettes", ones(&drawn));
    assert!(covered(&image) > 500, "{} pixels covered", covered(&image));
}

#[test]
fn a_mesh_of_borders_only() {
    // A fan of triangles that do not touch each other.
    let leaf = |i: u32| {
        let turn = glam::Quat::from_rotation_z(i as f32 * 0.7) * glam::Quat::from_rotation_x(i as f32 * 0.3);
        [Vec3::new(0.1, 0.0, 0.1), Vec3::new(0.9, -0.25, 0.0), Vec3::new(0.9, 0.25, -0.1)].map(|p| turn * p)
    };
    let shape = Shape {
        positions: (0..9).flat_map(leaf).collect(),
        triangles: (0..9).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..Shape::default()
    };
    let scene = scene(&shape, Vec3::new(0.0, 0.2, 2.5));
    let (drawn, image) = both_sides(&scene, 6);
    // All edges are drawn: borders always are, as the back of their face may be visible.
    assert_eq!(ones(&drawn), 27);
    assert!(covered(&image) > 300, "{} pixels covered", covered(&image));
}

#[test]
fn the_eye_in_the_plane_of_faces() {
    // The eye is level with the box's upper side, and in the plane of a quad, which it sees as a line.
    let cube = Shape::cuboid(Vec3::new(-0.5, -1.0, -0.5), Vec3::new(0.5, 0.0, 0.5));
    let (drawn, image) = both_sides(&scene(&cube, Vec3::new(0.0, 0.0, 2.5)), 6);
    // Only one side of the box faces the eye.
    assert_eq!(ones(&drawn), 4);
    assert!(covered(&image) > 300, "{} pixels covered", covered(&image));
    let corners = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
    let quad = Shape::quad(corners.map(Vec3::from));
    let (drawn, _) = both_sides(&scene(&quad, Vec3::new(0.0, 0.0, 2.5)), 6);
    assert_eq!(ones(&drawn), 4);
}
