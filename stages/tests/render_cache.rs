//! The graphs of the render cache as a whole: `graphs/render-cache.ron` on the Cornell box under a moving camera.

use std::{path::Path, sync::Arc};

use epigraph_core::{
    AdapterChoice, Executor, Gpu, GraphFile, Host, Registry, Settings, Side, Source, check_shader, compile,
    compose_shader,
};
use epigraph_scenes::{CameraPath, Scene, Tracer};
use epigraph_stages::{
    Pace, World, registry,
    shared::{
        cloud::{LIVE, NOT_DRAWN},
        requests::{HIT_NONE, NO_PIXEL, NO_POINT, Request, Sample},
    },
};

const SIZE: [u32; 2] = [64, 64];
const SAMPLES: u32 = 400;

/// A graph that runs, with what it needs.
struct Run {
    executor: Executor,
    host: Host,
    path: CameraPath,
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
        host.insert(World::new(Arc::new(Tracer::new(scene)), Pace::Exact));

        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(graph);
        let file = GraphFile::load(&file).unwrap_or_else(|problems| panic!("{problems}"));
        let (graph, plan) =
            compile(&file, &registry(), &settings).unwrap_or_else(|problems| panic!("{problems}"));
        let gpu = (side == Side::Gpu)
            .then(|| Arc::new(Gpu::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("{error}"))));
        let executor =
            Executor::new(graph, plan, &settings, &registry(), gpu).unwrap_or_else(|error| panic!("{error}"));
        Self { executor, host, path }
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
    // 19 frames brought up to 400 samples each to 4670 slots, some of them to slots that were taken.
    assert!(live > 3000, "{live} live points");
    // Nearly all of the box's image shows something by then.
    let dark = run.get::<[f32; 4]>("fill.color", "").iter().filter(|color| color[..3] == [0.0; 3]).count();
    assert!(dark < 64 * 64 / 10, "{dark} black pixels");
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
    (0..40).for_each(|index| run.frame(index));
    let ids = run.get::<u32>("cull.id", "");
    let occupied = ids.iter().filter(|&&id| id != NO_POINT).count();
    assert!(occupied > 64 * 64 * 3 / 4, "{occupied} pixels show a point");
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
    for graph in ["render-cache.ron", "render-cache-cpu-dither.ron"] {
        let [mut cpu, mut gpu] = [Side::Cpu, Side::Gpu]
            .map(|side| Run::new(graph, side, "orbit", |settings| settings.poison = true));
        for index in 0..3 {
            cpu.frame(index);
            gpu.frame(index);
        }
        let (cpu, gpu) = (cpu.image(), gpu.image());
        let differing = cpu.iter().zip(&gpu).filter(|(a, b)| a.abs_diff(**b) > 1).count();
        eprintln!("{graph}: {differing} of {} bytes differ", cpu.len());
        assert!(differing <= cpu.len() / 100, "{graph}: {differing} of {} bytes differ", cpu.len());
    }
}
