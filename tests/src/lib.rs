//! What the integration tests and benches share: a graph on a scene along a camera path, run as the command line does.

use std::{
    path::Path,
    sync::{Arc, OnceLock},
};

use epigraph_core::{AdapterChoice, Executor, Gpu, GraphFile, Host, Settings, Snapshot, Source, compile};
use epigraph_scenes::{CameraPath, Scene, Tracer};
use epigraph_stages::{Pace, World, registry};

/// The shipped graph files.
pub const GRAPHS: [&str; 6] = [
    "render-cache.ron",
    "epi.ron",
    "hybrid.ron",
    "render-cache-cpu-dither.ron",
    "experiments/outline.ron",
    "experiments/complex-pixels.ron",
];

/// Runs a frame of both from the CPU's state, and counts how many elements of each port of whole numbers differ; the most.
/// A frame each from the same state: one unit of one priority shifts every later request, so that two runs part though
/// nothing is wrong.
///
/// # Panics
/// Where more than `allowed` differ.
pub fn frame_on_both(cpu: &mut Run, gpu: &mut Run, ports: &[&str], allowed: usize, what: &str) -> usize {
    gpu.executor.inherit(&mut cpu.executor).unwrap_or_else(|error| panic!("{error}"));
    cpu.frame(true);
    gpu.frame(true);
    let differ = ports.iter().map(|port| {
        let [a, b] = [&mut *cpu, &mut *gpu].map(|run| run.captured(port).get::<u32>());
        let differ = a.iter().zip(&b).filter(|(a, b)| a != b).count();
        assert!(differ <= allowed, "{what}: {differ} differ in {port}");
        differ
    });
    differ.max().unwrap_or(0)
}

/// The tests' GPU.
///
/// # Panics
/// Where there is none, naming the packages that bring one: GPU tests never skip.
pub fn gpu() -> Arc<Gpu> {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    let open = || Arc::new(Gpu::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("{error}")));
    GPU.get_or_init(open).clone()
}

/// The shipped graph of that name.
///
/// # Panics
/// Where there is none or it does not parse.
pub fn graph(name: &str) -> GraphFile {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(name);
    GraphFile::load(&path).unwrap_or_else(|problems| panic!("{problems}"))
}

/// A graph that runs frame by frame.
pub struct Run {
    /// Its executor.
    pub executor: Executor,
    host: Host,
    path: CameraPath,
    settings: Settings,
    seed: u32,
    next: u32,
}

/// Where a graph runs.
pub struct Stage {
    /// Scene name.
    pub scene: &'static str,
    /// Camera path.
    pub camera: &'static str,
    /// Size, samples, side and so on; the facts are filled in from the scene.
    pub settings: Settings,
}

impl Run {
    /// Compiles and builds; exact pace, seed 1, profiling off.
    ///
    /// # Panics
    /// Where anything is wrong: tests give sound graphs.
    pub fn new(file: &GraphFile, on: Stage) -> Self {
        let scene = Arc::new(Scene::load(on.scene).expect("a built-in scene"));
        Self::in_scene(file, &scene, on.camera, on.settings)
    }

    /// As [`Run::new`], in a scene that a test has made.
    ///
    /// # Panics
    /// Where anything is wrong.
    pub fn in_scene(file: &GraphFile, scene: &Arc<Scene>, camera: &str, settings: Settings) -> Self {
        let registry = registry();
        let path = CameraPath::parse(camera, scene).expect("a camera path");
        let settings = Settings { facts: World::facts(scene, path.moves()), ..settings };
        let (graph, plan) =
            compile(file, &registry, &settings).unwrap_or_else(|problems| panic!("{problems}"));
        let gpu = plan.uses(epigraph_core::Side::Gpu).then(gpu);
        let mut executor =
            Executor::new(graph, plan, &settings, &registry, gpu).unwrap_or_else(|error| panic!("{error}"));
        executor.profile = false;
        let mut host = Host::default();
        host.insert(World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact));
        Self { executor, host, path, settings, seed: 1, next: 0 }
    }

    /// Runs the next frame.
    ///
    /// # Panics
    /// Where a stage or the device fails.
    pub fn frame(&mut self, capture: bool) {
        let Settings { size, samples, .. } = self.settings;
        let frame = World::frame(&self.path, self.next, size, samples, self.seed);
        self.next += 1;
        self.executor.run(&frame, &self.host, capture).unwrap_or_else(|error| panic!("{error}"));
    }

    /// Runs `count` frames; the taps and outputs of the last one are captured.
    pub fn frames(&mut self, count: u32) {
        for index in 0..count {
            self.frame(index + 1 == count);
        }
    }

    /// A captured port or output.
    ///
    /// # Panics
    /// Where it is neither.
    pub fn captured(&mut self, name: &str) -> Snapshot {
        let snapshot = self.executor.snapshot(name, "").unwrap_or_else(|error| panic!("{error}"));
        snapshot.unwrap_or_else(|| panic!("no output or tap `{name}`")).clone()
    }
}

/// `node.port`, to be tapped.
pub fn tap(name: &str) -> Source {
    name.parse().unwrap_or_else(|_| panic!("`{name}` is not NODE.PORT"))
}
