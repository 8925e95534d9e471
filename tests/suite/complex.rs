//! Complex pixels coloured by quarters: both sides agree, and the picture is closer to the converged one.

use std::{path::Path, sync::Arc};

use epigraph_core::{GraphFile, Settings, Side};
use epigraph_scenes::{CameraPath, Scene, TraceSettings, Tracer, reference};
use epigraph_tests::{Run, Stage, sampled, tap};

const SIZE: [u32; 2] = [128, 128];
const FRAMES: u32 = 20;
const TAPS: [&str; 2] = ["antialias.color", "reach_cull.cls"];

/// Colours and classes of the last of some frames of a graph.
fn run(name: &str, side: Side, frames: u32) -> (Vec<[f32; 4]>, Vec<u32>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace");
    let mut file = GraphFile::load(&root.join("graphs").join(name)).unwrap_or_else(|p| panic!("{p}"));
    file.set_param("trace", "spp", "32").unwrap_or_else(|problems| panic!("{problems}"));
    let taps = TAPS.map(tap).to_vec();
    let settings = Settings { side, taps, poison: true, ..sampled(SIZE, 0.05) };
    let mut run = Run::new(&file, Stage { scene: "cornell", camera: "orbit", settings });
    run.frames(frames);
    (run.captured(TAPS[0]).get(), run.captured(TAPS[1]).get())
}

fn converged(frames: u32) -> Vec<[f32; 4]> {
    let scene = Arc::new(Scene::load("cornell").expect("a built-in scene"));
    let camera = CameraPath::parse("orbit", &scene).expect("a camera path").camera(frames - 1);
    let settings = TraceSettings { spp: 1, ..TraceSettings::default() };
    let picture = reference::render(&Tracer::new(scene), &camera, SIZE, 64, &settings, 7, &|| true)
        .expect("not stopped");
    picture.iter().map(|color| [color[0], color[1], color[2], 1.0]).collect()
}

/// The sum of the squared differences of radiance, clamped to 1, over some pixels.
fn squares(a: &[[f32; 4]], b: &[[f32; 4]], pixels: &[usize]) -> f32 {
    let square = |p: usize, channel: usize| (a[p][channel].min(1.0) - b[p][channel].min(1.0)).powi(2);
    pixels.iter().map(|&p| (0..3).map(|channel| square(p, channel)).sum::<f32>()).sum()
}

#[test]
fn quarters_improve_complex_pixels_and_leave_the_others_unchanged() {
    // A frame has a score of complex pixels, of whose samples some are lucky: of several frames, the sums count.
    let mut sums = [0.0; 2];
    for frames in [12, 16, 20, 24] {
        let (before, classes) = run("epi.ron", Side::Cpu, frames);
        let (after, same) = run("experiments/complex-pixels.ron", Side::Cpu, frames);
        assert!(classes == same, "the stage changes a class");
        // The lowest two bits are the class; 2 is complex.
        let (complex, others): (Vec<_>, Vec<_>) = (0..classes.len()).partition(|&p| classes[p] & 3 == 2);
        assert!(complex.len() >= 10, "{} complex pixels", complex.len());
        assert!(others.iter().all(|&p| before[p] == after[p]));
        let converged = converged(frames);
        let errors = [before, after].map(|color| squares(&color, &converged, &complex));
        sums = [sums[0] + errors[0], sums[1] + errors[1]];
    }
    let [before, after] = sums;
    assert!(after < 0.2 * before, "{after} against {before}");
}

#[test]
fn quarters_agree_on_both_sides() {
    let [cpu, gpu] = [Side::Cpu, Side::Gpu].map(|side| run("experiments/complex-pixels.ron", side, FRAMES).0);
    // After rounding has moved one request, all later samples differ.
    let all: Vec<usize> = (0..cpu.len()).collect();
    let rms = (squares(&cpu, &gpu, &all) / (3 * cpu.len()) as f32).sqrt();
    assert!(rms < 0.01, "{rms}");
}
