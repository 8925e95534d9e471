//! The graphs of the render cache as a whole: `graphs/render-cache.ron` on the Cornell box under a moving camera.

use std::{path::Path, sync::Arc};

use epigraph_core::{
    AdapterChoice, Executor, Gpu, GraphFile, Host, Registry, Settings, Side, Source, check_shader, compile,
    compose_shader,
};
use epigraph_scenes::{CameraPath, Scene, TraceSettings, Tracer, reference};
use epigraph_stages::{
    Pace, World, registry,
    shared::{
        cloud::{LIVE, NOT_DRAWN},
        requests::{HIT_NONE, NO_PIXEL, NO_POINT, Request, Sample},
    },
};

const SIZE: [u32; 2] = [128, 128];

/// Samples of a frame: 5% of the pixels.
const SAMPLES: u32 = 819;

/// A graph that runs, with what it needs.
struct Run {
    executor: Executor,
    host: Host,
    path: CameraPath,
    tracer: Arc<Tracer>,
}

/// Ports that the tests look at.
const TAPS: [&str; 7] = [
    "image_id.cloud",
    "fill.color",
    "fill.priority",
    "cull.id",
    "request.requests",
    "trace.samples",
    "replace.slots",
];

impl Run {
    fn new(graph: &str, side: Side, camera: &str, change: impl FnOnce(&mut Settings)) -> Self {
        let scene = Arc::new(Scene::load("cornell").expect("a built-in scene"));
        let path = CameraPath::parse(camera, &scene).expect("a built-in path");
        let taps = TAPS.map(|tap| tap.parse::<Source>().expect("NODE.PORT")).to_vec();
        let facts = World::facts(&scene, path.moves());
        let mut settings = Settings { facts, side, taps, ..Settings::new(SIZE, SAMPLES) };
        change(&mut settings);
        let mut host = Host::default();
        let tracer = Arc::new(Tracer::new(scene));
        host.insert(World::new(tracer.clone(), Pace::Exact, 1));

        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(graph);
        let file = GraphFile::load(&file).unwrap_or_else(|problems| panic!("{problems}"));
        let (graph, plan) =
            compile(&file, &registry(), &settings).unwrap_or_else(|problems| panic!("{problems}"));
        let gpu = (side == Side::Gpu)
            .then(|| Arc::new(Gpu::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("{error}"))));
        let executor =
            Executor::new(graph, plan, &settings, &registry(), gpu).unwrap_or_else(|error| panic!("{error}"));
        Self { executor, host, path, tracer }
    }

    fn frame(&mut self, index: u32) {
        let frame = World::frame(&self.path, index, SIZE, SAMPLES, 1);
        self.executor.run(&frame, &self.host, true).unwrap_or_else(|error| panic!("frame {index}: {error}"));
    }

    fn get<T: bytemuck::Pod>(&mut self, port: &str, field: &str) -> Vec<T> {
        let snapshot = self.executor.snapshot(port, field).unwrap_or_else(|error| panic!("{error}"));
        snapshot.unwrap_or_else(|| panic!("`{port}` is not tapped")).get()
    }

    fn image(&mut self) -> Vec<u8> {
        self.get("image", "")
    }

    /// Mean difference between the image and a converged one of frame `index`, as a share of the converged one's mean:
    /// 1 for a black image.
    fn error(&mut self, index: u32) -> f32 {
        let settings = TraceSettings { spp: 4, ..TraceSettings::default() };
        let truth =
            reference::render(&self.tracer, &self.path.camera(index), SIZE, 16, &settings, 9, &|| true)
                .unwrap();
        let color = self.get::<[f32; 4]>("fill.color", "");
        // Like a screen, so that the light itself does not outweigh all else.
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
}

/// Runs frames on this many threads; gives the last picture.
fn picture(graph: &str, threads: usize, frames: u32, change: impl FnOnce(&mut Settings) + Send) -> Vec<u8> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let mut run = Run::new(graph, Side::Cpu, "orbit", change);
        (0..frames).for_each(|index| run.frame(index));
        run.image()
    })
}

#[test]
fn the_cloud_fills_and_stays_consistent() {
    let mut run = Run::new("render-cache.ron", Side::Cpu, "orbit", |settings| settings.poison = true);
    let mut live = 0;
    for index in 0..20 {
        run.frame(index);
        let meta = run.get::<u32>("image_id.cloud", "meta");
        live = meta.iter().filter(|&&meta| meta & LIVE != 0).count();

        // Every sample of the frame before has a slot of its own.
        let mut slots = run.get::<u32>("replace.slots", "");
        slots.retain(|&slot| slot != NO_POINT);
        let taken = slots.len();
        slots.sort_unstable();
        slots.dedup();
        assert_eq!(slots.len(), taken, "frame {index}: two samples in one slot");
        assert!(slots.iter().all(|&slot| (slot as usize) < meta.len()));

        // Points and pixels know each other.
        let (ids, image_id) = (run.get::<u32>("cull.id", ""), run.get::<u32>("image_id.cloud", "image_id"));
        for (pixel, &id) in ids.iter().enumerate().filter(|(_, id)| **id != NO_POINT) {
            assert_eq!(image_id[id as usize], pixel as u32);
            assert!(meta[id as usize] & LIVE != 0);
        }
        let drawn = image_id.iter().filter(|&&pixel| pixel != NOT_DRAWN).count();
        assert_eq!(drawn, ids.iter().filter(|&&id| id != NO_POINT).count());

        // As many requests as the frame may make, within the image, each answered.
        let requests = run.get::<Request>("request.requests", "");
        let valid = requests.iter().filter(|request| request.pixel != NO_PIXEL).count();
        assert!(
            valid <= SAMPLES as usize && valid >= SAMPLES as usize * 9 / 10,
            "frame {index}: {valid} requests"
        );
        assert!(
            requests.iter().all(|request| request.pixel == NO_PIXEL || request.pixel < SIZE[0] * SIZE[1])
        );
        let answered =
            run.get::<Sample>("trace.samples", "").iter().filter(|sample| sample.hit != HIT_NONE).count();
        assert_eq!(answered, valid);

        let color = run.get::<[f32; 4]>("fill.color", "");
        assert!(
            color.iter().flatten().all(|channel| channel.is_finite() && *channel >= 0.0),
            "frame {index}"
        );
        assert!(run.get::<u32>("fill.priority", "").iter().all(|&priority| priority <= 255));
    }
    // 19 frames brought 819 samples each to 18,678 slots, some of them to slots that were taken.
    assert!(live > 9_000, "{live} live points");
    let error = run.error(19);
    assert!(error < 0.2, "the image of a moving camera is off by {error}");
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
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
fn a_still_camera_converges_to_what_the_tracer_sees() {
    let mut run = Run::new("render-cache.ron", Side::Cpu, "still", |_| {});
    (0..2).for_each(|index| run.frame(index));
    let early = run.error(1);
    (2..60).for_each(|index| run.frame(index));
    let late = run.error(59);
    assert!(late < 0.12 && late < 0.5 * early, "off by {early} after 2 frames, by {late} after 60");
}

#[test]
fn shaders_fit_their_stages() {
    let registry: Registry = registry();
    for kind in registry.kinds() {
        let Some(declaration) = kind.declaration() else { continue };
        let Some(shader) = &declaration.shader else { continue };
        let reflected = compose_shader(shader, &registry.library, declaration.needs)
            .unwrap_or_else(|error| panic!("{}: {error}", kind.name()));
        let errors = check_shader(&reflected, &shader.name, &declaration, &kind.specs());
        assert!(errors.is_empty(), "{}: {errors:#?}", kind.name());
    }
}

#[test]
fn both_sides_show_the_same() {
    let [mut cpu, mut gpu] = [Side::Cpu, Side::Gpu]
        .map(|side| Run::new("render-cache.ron", side, "orbit", |settings| settings.poison = true));
    for index in 0..10 {
        cpu.frame(index);
        gpu.frame(index);
    }
    // A point whose projection rounds to another pixel changes the requests that follow, and with them the samples; so
    // the pictures need not be the same for ever. On lavapipe they are.
    let differing = cpu.image().iter().zip(gpu.image()).filter(|(a, b)| a.abs_diff(*b) > 1).count();
    assert!(differing <= 128 * 128 * 4 / 100, "{differing} bytes differ");
}

#[test]
fn readbacks_that_come_late_do_little_harm() {
    let mut split =
        Run::new("render-cache-cpu-dither.ron", Side::Gpu, "orbit", |settings| settings.poison = true);
    (0..20).for_each(|index| split.frame(index));
    let error = split.error(19);
    assert!(error < 0.2, "off by {error}");
}
