//! The edge-and-point image: both sides agree, with poison on, and at equal numbers of samples the picture is closer to
//! the converged one than that of the render cache.

use std::sync::Arc;

use epigraph_core::{Facts, Settings, Side};
use epigraph_scenes::{CameraPath, Scene, TraceSettings, Tracer, reference};
use epigraph_tests::{Run, Stage, frame_on_both, graph, sampled, tap};
use glam::Vec3;

const SIZE: [u32; 2] = [96, 72];
const FRAMES: u32 = 12;

/// The ports of the edge stages that hold integers.
const INTEGERS: [&str; 5] =
    ["edge_raster.mask", "reach_cull.cls", "reach_cull.id", "reach.r24", "interpolate.priority"];

/// How many of the 6,912 pixels of an integer image may differ because of rounding.
const ROUNDING: usize = 4;

fn start(name: &str, scene: &'static str, camera: &'static str, side: Side) -> Run {
    let taps = INTEGERS.map(tap).to_vec();
    let settings = Settings { side, poison: true, taps, ..sampled(SIZE, 0.05) };
    Run::new(&graph(name), Stage { scene, camera, settings })
}

/// Mean absolute difference of two 8-bit images, in codes.
fn difference(a: &[u8], b: &[u8]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

/// Both sides start each frame from the same state. Because of f32 rounding, a few pixels of each integer image may
/// differ, and the picture hardly does.
#[test]
fn both_sides_compute_the_same_frame_from_the_same_state() {
    let mut worst = 0;
    let cases = [
        ("epi.ron", "cornell", "still"),
        ("epi.ron", "cornell", "orbit"),
        ("epi.ron", "chains", "orbit"),
        ("epi-filtered.ron", "cornell-moving", "still"),
        ("epi-filtered.ron", "chains", "orbit"),
    ];
    for (name, scene, camera) in cases {
        let [mut cpu, mut gpu] = [Side::Cpu, Side::Gpu].map(|side| start(name, scene, camera, side));
        for frame in 0..FRAMES {
            let what = format!("{name}, {scene}, {camera}, frame {frame}");
            worst = worst.max(frame_on_both(&mut cpu, &mut gpu, &INTEGERS, ROUNDING, &what));
            let mean = difference(&cpu.captured("image").bytes, &gpu.captured("image").bytes);
            assert!(mean <= 0.02, "{what}: mean difference {mean} codes");
        }
    }
    println!("at most {worst} pixels differ in an integer image");
}

#[test]
fn the_comparison_can_fail() {
    let mut file = graph("epi.ron");
    file.set_param("edge_raster", "depth_test", "Off").unwrap();
    let settings =
        Settings { taps: vec![tap("edge_raster.mask")], ..Settings::new(SIZE, 345, Facts::none()) };
    let mut other = Run::new(&file, Stage { scene: "chains", camera: "still", settings });
    let mut same = start("epi.ron", "chains", "still", Side::Cpu);
    let [a, b] = [&mut other, &mut same].map(|run| {
        run.frames(FRAMES);
        run.captured("edge_raster.mask").get::<u32>()
    });
    assert!(a.iter().zip(&b).filter(|(a, b)| a != b).count() > ROUNDING);
}

/// Root mean square difference from the converged picture, of radiance clamped to 1.
fn error(name: &str, color: &str, scene: &'static str, camera: &'static str) -> f64 {
    let size = [128, 128];
    let mut file = graph(name);
    file.set_param("trace", "spp", "32").unwrap();
    let settings = Settings { taps: vec![tap(color)], ..sampled(size, 0.02) };
    let mut run = Run::new(&file, Stage { scene, camera, settings });
    run.frames(25);
    let picture = run.captured(color).get::<[f32; 4]>();
    rms(&picture, &converged(scene, camera, size, 24))
}

/// The tracer's picture of frame `index`, with 64 rays per pixel.
pub fn converged(scene: &str, camera: &str, size: [u32; 2], index: u32) -> Vec<Vec3> {
    let scene = Arc::new(Scene::load(scene).expect("a built-in scene"));
    let camera = CameraPath::parse(camera, &scene).expect("a camera path").camera(index);
    let tracer = Tracer::new(scene);
    let settings = TraceSettings { spp: 1, ..TraceSettings::default() };
    reference::render(&tracer, &camera, size, 64, &settings, 7, &|| true).expect("not stopped")
}

/// Root mean square difference of two pictures, of radiance clamped to 1.
pub fn rms(a: &[[f32; 4]], b: &[Vec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares = a.iter().zip(b).flat_map(|(a, b)| {
        (0..3).map(move |channel| f64::from(a[channel].clamp(0.0, 1.0) - b[channel].clamp(0.0, 1.0)).powi(2))
    });
    (squares.sum::<f64>() / (3 * a.len()) as f64).sqrt()
}

#[test]
fn the_error_is_less_than_that_of_the_render_cache() {
    // The links of the chains are only a few pixels wide here, so most of their pixels are complex.
    for (scene, camera, share) in
        [("cornell", "still", 0.7), ("cornell", "orbit", 0.7), ("chains", "orbit", 0.95)]
    {
        let cache = error("render-cache.ron", "fill.color", scene, camera);
        let epi = error("epi.ron", "antialias.color", scene, camera);
        println!("{scene}, {camera}: {cache:.4} render cache, {epi:.4} EPI");
        assert!(epi < share * cache, "{scene}, {camera}: {epi} against {cache}");
    }
}
