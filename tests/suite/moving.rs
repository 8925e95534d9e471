//! A scene in motion: points, edges and shadows move in the same way on both sides, and stages that do not depend on
//! the motion are skipped.

use std::sync::Arc;

use epigraph_core::{GraphFile, Settings, Side};
use epigraph_scenes::{CameraPath, Scene, TraceSettings, Tracer, reference};
use epigraph_tests::{Run, Stage, frame_on_both, graph, sampled, tap};
use glam::Vec3;

const SCENE: &str = "cornell-moving";
const SIZE: [u32; 2] = [96, 96];

fn start(file: &GraphFile, scene: &'static str, settings: Settings) -> Run {
    Run::new(file, Stage { scene, camera: "still", settings })
}

fn settings(side: Side, ports: &[&str]) -> Settings {
    let taps = ports.iter().map(|port| tap(port)).collect();
    Settings { side, taps, ..sampled(SIZE, 0.05) }
}

#[test]
fn both_sides_show_the_same_motion() {
    let ports = ["silhouette.drawn", "edge_raster.mask", "cull.id"];
    let [mut cpu, mut gpu] =
        [Side::Cpu, Side::Gpu].map(|side| start(&graph("epi.ron"), SCENE, settings(side, &ports)));
    for frame in 0..12 {
        // The rounding of an f32 matrix may move a point to the next pixel.
        frame_on_both(&mut cpu, &mut gpu, &ports, 20, &format!("frame {frame}"));
    }
}

#[test]
fn stages_that_depend_on_motion_run_only_where_something_moves() {
    let ran = |run: &Run, name: &str| {
        run.executor.plan().nodes.position(|node| node.name == name).map(|node| run.executor.ran()[node])
    };
    let [mut moving, mut still] =
        [SCENE, "cornell"].map(|scene| start(&graph("epi.ron"), scene, settings(Side::Cpu, &[])));
    for frame in 0..4 {
        moving.frame(false);
        still.frame(false);
        assert_eq!(ran(&moving, "silhouette"), Some(true));
        assert_eq!(ran(&still, "silhouette"), Some(frame == 0));
        assert_eq!((ran(&moving, "cloud/carry"), ran(&moving, "cloud/motion")), (Some(true), Some(true)));
        assert_eq!((ran(&still, "cloud/carry"), ran(&still, "cloud/motion")), (None, None));
    }
    let image = |prune| {
        let settings = Settings { prune, poison: true, ..settings(Side::Cpu, &[]) };
        let mut run = start(&graph("epi.ron"), "cornell", settings);
        run.frames(8);
        run.captured("image")
    };
    assert!(image(true) == image(false), "in a static scene, a stage of motion changes the picture");
}

/// Root mean square difference between a frame and the converged picture, of values as shown on a screen.
fn error(file: &GraphFile, color: &str) -> f64 {
    const FRAME: u32 = 24;
    let size = [192, 192];
    let wanted = Settings { taps: vec![tap(color)], ..sampled(size, 0.05) };
    let mut run = start(file, SCENE, wanted);
    run.frames(FRAME + 1);
    let picture = run.captured(color).get::<[f32; 4]>();
    let scene = Arc::new(Scene::load(SCENE).expect("a built-in scene"));
    let camera = CameraPath::parse("still", &scene).expect("a camera path").camera(FRAME);
    let tracer = Arc::new(Tracer::new(scene)).at(FRAME);
    let settings = TraceSettings { spp: 1, ..TraceSettings::default() };
    let converged: Vec<Vec3> =
        reference::render(&tracer, &camera, size, 64, &settings, 7, &|| true).expect("not stopped");
    // The lamp is excluded: it is far brighter than white, so that a few pixels at its rim would dominate.
    let lit: Vec<_> = picture.iter().zip(&converged).filter(|(_, b)| b.max_element() < 1.0).collect();
    let shown = |radiance: f32| f64::from(radiance.clamp(0.0, 1.0)).powf(1.0 / 2.2);
    let squares =
        lit.iter().flat_map(|(a, b)| (0..3).map(|channel| (shown(a[channel]) - shown(b[channel])).powi(2)));
    (squares.sum::<f64>() / (3 * lit.len()) as f64).sqrt()
}

#[test]
fn ageing_points_where_light_changes_reduces_the_error() {
    let mut aged = graph("epi.ron");
    aged.set_param("trace", "spp", "16").unwrap();
    let mut not = aged.clone();
    for param in ["penalty", "relight", "shadow"] {
        not.set_param("carry", param, "0.0").unwrap();
    }
    let [aged, not] = [aged, not].map(|file| error(&file, "antialias.color"));
    println!("{aged:.4} aged by the light, {not:.4} not");
    assert!(aged < 0.9 * not, "{aged} against {not}");
}
