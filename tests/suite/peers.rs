//! The peers' pictures are better than the samples that they are made of.

use std::sync::Arc;

use epigraph_core::{Facts, Settings, Side};
use epigraph_pictures::tone;
use epigraph_scenes::{CameraPath, Mode, Scene, TraceSettings, Tracer, reference};
use epigraph_tests::{PEERS, Run, Stage, graph, tap};

const SIZE: [u32; 2] = [256, 192];
const FRAMES: u32 = 25;

fn run(name: &str, camera: &'static str, taps: &[&str]) -> Run {
    let settings = Settings {
        taps: taps.iter().map(|port| tap(port)).collect(),
        side: Side::Gpu,
        ..Settings::new(SIZE, SIZE[0] * SIZE[1] / 20, Facts::none())
    };
    Run::new(&graph(name), Stage { scene: "cornell", camera, settings })
}

#[test]
fn held_pixels_show_their_last_samples_and_all_get_one() {
    let mut run = run("peers/hold.ron", "orbit", &["sparse/scatter.color", "hold.held"]);
    let mut last = vec![[0.0; 4]; (SIZE[0] * SIZE[1]) as usize];
    for frame in 0..40 {
        run.frame(true);
        let samples = run.captured("sparse/scatter.color").get::<[f32; 4]>();
        let arrived = samples.iter().filter(|sample| sample[3] > 0.0).count();
        assert_eq!(arrived, last.len() / 20, "frame {frame}");
        for (pixel, sample) in last.iter_mut().zip(samples) {
            if sample[3] > 0.0 {
                *pixel = sample;
            }
        }
        assert!(run.captured("hold.held").get::<[f32; 4]>() == last, "frame {frame}");
    }
    // Every pixel's turn comes within twice the 20 frames that it would take in a fixed order.
    assert!(last.iter().all(|pixel| pixel[3] > 0.0));
}

#[test]
fn peers_have_less_error_than_their_samples_held() {
    let scene = Arc::new(Scene::load("cornell").unwrap());
    let camera = CameraPath::parse("orbit", &scene).unwrap().camera(FRAMES - 1);
    let settings = TraceSettings { mode: Mode::Path, ..TraceSettings::default() };
    let truth = reference::render(&Tracer::new(scene), &camera, SIZE, 64, &settings, 7, &|| true)
        .expect("not stopped");
    let error = |name: &str| {
        let color = match name {
            "peers/hold.ron" => "hold.held",
            "peers/taa.ron" => "taa.blended",
            "peers/svgf.ron" => "modulate.color",
            _ => "enlarge.color",
        };
        let mut run = run(name, "orbit", &[color]);
        run.frames(FRAMES);
        // Of displayed colours: in linear ones the pixels at the rim of the lamp outweigh all others.
        let found = run.captured(color).get::<[f32; 4]>();
        let squares = found.iter().zip(&truth).flat_map(|(found, truth)| {
            let shown = |light: f32| f64::from(tone::encode(light.clamp(0.0, 1.0)));
            (0..3).map(move |channel| (shown(found[channel]) - shown(truth[channel])).powi(2))
        });
        (squares.sum::<f64>() / (3 * truth.len()) as f64).sqrt()
    };
    let held = error(PEERS[0]);
    // Measured: 0.38, 0.35, 0.41, 0.91.
    for (name, most) in PEERS[1..].iter().zip([0.5, 0.45, 0.55, 0.97]) {
        let share = error(name) / held;
        println!("{name}: {share:.2} of the error of the samples");
        assert!(share < most, "{name}: {share}");
    }
}
