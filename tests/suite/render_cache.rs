//! The graphs of the render cache as a whole: `graphs/render-cache.ron` on the Cornell box under a moving camera.

use std::{fs, path::Path};

use epigraph_core::{Facts, Registry, Settings, Side, check_shader, compose_shader};
use epigraph_scenes::{Scene, TraceSettings, Tracer, reference};
use epigraph_stages::{
    registry,
    shared::{
        cloud::{LIVE, NO_POINT, NOT_DRAWN},
        requests::{HIT_NONE, NO_PIXEL, Request, Sample},
    },
};
use epigraph_tests::{Run, Stage, graph, tap};

const SIZE: [u32; 2] = [128, 128];

/// Number of samples per frame: 5% of the pixels.
const SAMPLES: u32 = 819;

/// The ports that the tests read.
const TAPS: [&str; 7] = [
    "image_id.cloud",
    "fill.color",
    "fill.priority",
    "cull.id",
    "request.requests",
    "trace.samples",
    "replace.slots",
];

fn start(name: &str, side: Side, camera: &'static str, change: impl FnOnce(&mut Settings)) -> Run {
    let taps = TAPS.map(tap).to_vec();
    let mut settings = Settings { side, taps, ..Settings::new(SIZE, SAMPLES, Facts::none()) };
    change(&mut settings);
    Run::new(&graph(name), Stage { scene: "cornell", camera, settings })
}

/// Mean difference between the image of the last frame and a converged image, as a share of the converged image's mean:
/// 1 for a black image.
fn error(run: &mut Run) -> f32 {
    let settings = TraceSettings { spp: 4, ..TraceSettings::default() };
    let camera = run.path().camera(run.index() - 1);
    let tracer = Tracer::new(Scene::load("cornell").expect("a built-in scene").into());
    let truth = reference::render(&tracer, &camera, SIZE, 16, &settings, 9, &|| true).expect("not stopped");
    let color = run.captured("fill.color").get::<[f32; 4]>();
    // Clamped like a display, so that the light itself does not dominate.
    let shown = |[r, g, b]: [f32; 3]| [r, g, b].map(|channel| channel.min(1.0));
    let (mut difference, mut sum) = (0.0, 0.0);
    for ([r, g, b, _], truth) in color.into_iter().zip(truth) {
        for (channel, truth) in shown([r, g, b]).into_iter().zip(shown(truth.into())) {
            difference += (channel - truth).abs();
            sum += truth;
        }
    }
    difference / sum
}

/// Runs frames on `threads` threads and returns the last picture.
fn picture(graph: &str, threads: usize, frames: u32, change: impl FnOnce(&mut Settings) + Send) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let mut run = start(graph, Side::Cpu, "orbit", change);
        run.frames(frames);
        run.captured("image").bytes
    })
}

#[test]
fn the_cloud_fills_and_stays_consistent() {
    let mut run = start("render-cache.ron", Side::Cpu, "orbit", |settings| settings.poison = true);
    let mut live = 0;
    for index in 0..20 {
        run.frame(true);
        let meta = run.captured("image_id.cloud.meta").get::<u32>();
        live = meta.iter().filter(|&&meta| meta & LIVE != 0).count();

        // Every sample of the previous frame has its own slot.
        let mut slots = run.captured("replace.slots").get::<u32>();
        slots.retain(|&slot| slot != NO_POINT);
        let taken = slots.len();
        slots.sort_unstable();
        slots.dedup();
        assert_eq!(slots.len(), taken, "frame {index}: two samples in one slot");
        assert!(slots.iter().all(|&slot| (slot as usize) < meta.len()));

        // Points and pixels refer to each other.
        let (ids, image_id) =
            (run.captured("cull.id").get::<u32>(), run.captured("image_id.cloud.image_id").get::<u32>());
        for (pixel, &id) in ids.iter().enumerate().filter(|(_, id)| **id != NO_POINT) {
            assert_eq!(image_id[id as usize], pixel as u32);
            assert!(meta[id as usize] & LIVE != 0);
        }
        let drawn = image_id.iter().filter(|&&pixel| pixel != NOT_DRAWN).count();
        assert_eq!(drawn, ids.iter().filter(|&&id| id != NO_POINT).count());

        // The maximum number of requests per frame, all within the image and answered.
        let requests = run.captured("request.requests").get::<Request>();
        let valid = requests.iter().filter(|request| request.pixel != NO_PIXEL).count();
        assert!(
            valid <= SAMPLES as usize && valid >= SAMPLES as usize * 9 / 10,
            "frame {index}: {valid} requests"
        );
        assert!(
            requests.iter().all(|request| request.pixel == NO_PIXEL || request.pixel < SIZE[0] * SIZE[1])
        );
        let answered = run
            .captured("trace.samples")
            .get::<Sample>()
            .iter()
            .filter(|sample| sample.hit != HIT_NONE)
            .count();
        assert_eq!(answered, valid);

        let color = run.captured("fill.color").get::<[f32; 4]>();
        assert!(
            color.iter().flatten().all(|channel| channel.is_finite() && *channel >= 0.0),
            "frame {index}"
        );
        assert!(run.captured("fill.priority").get::<u32>().iter().all(|&priority| priority <= 255));
    }
    // 19 frames added 819 samples each to 18,678 slots, some of them to occupied slots.
    assert!(live > 9_000, "{live} live points");
    let error = error(&mut run);
    assert!(error < 0.2, "the image of a moving camera is off by {error}");
}

#[test]
fn the_picture_has_the_same_bytes_on_any_number_of_threads() {
    for graph in ["render-cache.ron", "render-cache-cpu-dither.ron"] {
        let one = picture(graph, 1, 20, |_| {});
        assert!(one == picture(graph, 2, 20, |_| {}), "{graph}");
        assert!(
            one == picture(graph, 2, 20, |settings| (settings.poison, settings.pooling) = (true, false)),
            "{graph}"
        );
    }
}

#[test]
fn with_a_still_camera_the_image_converges_to_the_tracers() {
    let mut run = start("render-cache.ron", Side::Cpu, "still", |_| {});
    run.frames(2);
    let early = error(&mut run);
    run.frames(58);
    let late = error(&mut run);
    assert!(late < 0.12 && late < 0.5 * early, "off by {early} after 2 frames, by {late} after 60");
}

#[test]
fn shaders_fit_their_stages() {
    let registry: Registry = registry();
    let mut checked = Vec::new();
    for kind in registry.kinds() {
        let Some(declaration) = kind.declaration() else { continue };
        let Some(shader) = &declaration.shader else { continue };
        let reflected = compose_shader(shader, &registry.library, declaration.needs)
            .unwrap_or_else(|error| panic!("{}: {error}", kind.name()));
        let errors = check_shader(&reflected, &shader.name, &declaration, &kind.specs());
        assert!(errors.is_empty(), "{}: {errors:#?}", kind.name());
        checked.push(shader.name.to_string());
    }
    checked.sort_unstable();
    // The checked shaders are all shaders of the folder, each once.
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shaders");
    let names = fs::read_dir(folder).expect("the shaders").map(|entry| entry.expect("a file").file_name());
    let mut shipped: Vec<_> =
        names.map(|name| name.into_string().expect("UTF-8")).filter(|name| name.ends_with(".wgsl")).collect();
    shipped.sort_unstable();
    assert_eq!(checked, shipped);
}

#[test]
fn both_sides_show_the_same() {
    let [mut cpu, mut gpu] = [Side::Cpu, Side::Gpu]
        .map(|side| start("render-cache.ron", side, "orbit", |settings| settings.poison = true));
    for _ in 0..10 {
        cpu.frame(true);
        gpu.frame(true);
    }
    // If rounding projects a point to another pixel, later requests and samples change, so the pictures may differ in
    // the end. With lavapipe they do not.
    let differing = cpu
        .captured("image")
        .bytes
        .iter()
        .zip(gpu.captured("image").bytes)
        .filter(|(a, b)| a.abs_diff(*b) > 1)
        .count();
    assert!(differing <= 128 * 128 * 4 / 100, "{differing} bytes differ");
}

#[test]
fn late_readbacks_hardly_increase_the_error() {
    let mut split =
        start("render-cache-cpu-dither.ron", Side::Gpu, "orbit", |settings| settings.poison = true);
    split.frames(20);
    let error = error(&mut split);
    assert!(error < 0.2, "off by {error}");
}
