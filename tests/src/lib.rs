//! Helpers of the integration tests and benches: they run a graph on a scene and a camera path, like the command line.

use std::{
    ops::{Deref, DerefMut},
    path::Path,
    sync::Arc,
};

use epigraph::{Change, Device, Place, Samples, Setup, Snapshot, Source, changed, graphs::Shipped};
use epigraph_core::{Facts, GraphFile, Port, Settings, Side};
use epigraph_scenes::Scene;
use epigraph_stages::{facts::CAMERA_MOVES, registry};

pub use epigraph_core::testing::gpu;

/// The shipped graph that shows point sets.
pub const POINT_GRAPH: &str = "streams.ron";

/// The other shipped graph files, which show surfaces.
pub const GRAPHS: [&str; 14] = [
    "render-cache.ron",
    "epi.ron",
    "hybrid.ron",
    "render-cache-cpu-dither.ron",
    "experiments/outline.ron",
    "experiments/complex-pixels.ron",
    "experiments/blur.ron",
    "experiments/median.ron",
    "experiments/tent.ron",
    "experiments/atrous.ron",
    "experiments/accumulate.ron",
    "experiments/lines.ron",
    "experiments/gbuffer.ron",
    "epi-filtered.ron",
];

/// The graphs of other algorithms, to compare with: they have shaders of their own, so they need a GPU.
pub const PEERS: [&str; 5] =
    ["peers/hold.ron", "peers/taa.ron", "peers/svgf.ron", "peers/bilateral.ron", "peers/bilinear.ron"];

/// Runs a frame of both from the CPU's state and compares ports of integers. Returns the largest number of elements
/// that differ in a port. Two whole runs cannot be compared, as one unit of one priority would change all later
/// requests.
///
/// # Panics
/// If more than `allowed` elements of a port differ.
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

/// The shipped graph with the given file name.
///
/// # Panics
/// If there is no such graph or it does not parse.
pub fn graph(name: &str) -> GraphFile {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(name);
    GraphFile::load_with(&path, &Shipped).unwrap_or_else(|problems| panic!("{problems}"))
}

/// A shipped graph that sees the cornell box by samples that a shader makes up, so that all of its frames run on the
/// GPU: 5% of the pixels a frame, while the camera moves around it.
///
/// # Panics
/// On any error.
pub fn on_gpu_alone(name: &str, size: [u32; 2]) -> Run {
    let swap = concat!("trace=", env!("CARGO_MANIFEST_DIR"), "/benches/answers.wgsl");
    let swap = Change::swap(swap).expect("a change");
    let file = changed(graph(name), [&swap], &registry()).unwrap_or_else(|problems| panic!("{problems}"));
    let settings = Settings { side: Side::Gpu, ..sampled(size, 0.05) };
    Run::new(&file, Stage { scene: "cornell", camera: "orbit", settings })
}

/// A graph that runs frame by frame. All errors are panics.
pub struct Run(epigraph::Run);

/// The scene, the camera path and the settings of a run.
pub struct Stage {
    /// Scene name.
    pub scene: &'static str,
    /// Camera path.
    pub camera: &'static str,
    /// Size, samples, side and so on. The facts are ignored: they come from the scene.
    pub settings: Settings,
}

impl Run {
    /// Compiles a graph and allocates its memory, with exact pace, seed 1 and no profiling.
    ///
    /// # Panics
    /// On any error, as tests use valid graphs.
    pub fn new(file: &GraphFile, on: Stage) -> Self {
        let place = Place::load(on.scene, on.camera).expect("a built-in scene and a camera path");
        Self::at(file, &place, &on.settings)
    }

    /// Like [`Run::new`], in a scene made by the test.
    ///
    /// # Panics
    /// On any error.
    pub fn in_scene(file: &GraphFile, scene: &Arc<Scene>, camera: &str, settings: Settings) -> Self {
        let place = Place::new(scene.clone(), camera).expect("a camera path");
        Self::at(file, &place, &settings)
    }

    /// Like [`Run::new`], at a place, and keeps every port that a node writes, but for scratch ports.
    ///
    /// # Panics
    /// On any error.
    pub fn with_all_ports(file: &GraphFile, place: &Place, settings: &Settings) -> Self {
        Self::with_ports(file, place, settings, |port| !port.scratch)
    }

    /// The same with those of the ports that are `wanted`.
    ///
    /// # Panics
    /// On any error.
    pub fn with_ports(
        file: &GraphFile,
        place: &Place,
        settings: &Settings,
        wanted: impl Fn(&Port) -> bool,
    ) -> Self {
        let setup = setup(file, place, settings).compile().unwrap_or_else(|error| panic!("{error}"));
        let written = setup.graph().nodes.iter().flat_map(|node| {
            let ports = node.declaration().ports.iter().filter(|port| port.is_output() && wanted(port));
            ports.map(|port| Source { node: node.name.clone(), port: port.name.to_string() })
        });
        Self::at(file, place, &Settings { taps: written.collect(), ..settings.clone() })
    }

    fn at(file: &GraphFile, place: &Place, settings: &Settings) -> Self {
        let mut setup = setup(file, place, settings).compile().unwrap_or_else(|error| panic!("{error}"));
        setup.keep(&settings.taps).unwrap_or_else(|error| panic!("{error}"));
        Self(setup.start().unwrap_or_else(|error| panic!("{error}")))
    }

    /// Runs the next frame.
    ///
    /// # Panics
    /// If a stage or the device fails.
    pub fn frame(&mut self, capture: bool) {
        self.0.advance(capture).unwrap_or_else(|error| panic!("{error}"));
    }

    /// Runs `count` frames, and captures the taps and outputs of the last one.
    pub fn frames(&mut self, count: u32) {
        self.0.frames(count).unwrap_or_else(|error| panic!("{error}"));
    }

    /// A captured port or output (`node.port`), or a field of one (`node.port.field`).
    ///
    /// # Panics
    /// If the port was not tapped.
    pub fn captured(&mut self, name: &str) -> Snapshot {
        self.0.snapshot(name).unwrap_or_else(|error| panic!("{error}")).clone()
    }
}

impl Deref for Run {
    type Target = epigraph::Run;

    fn deref(&self) -> &epigraph::Run {
        &self.0
    }
}

impl DerefMut for Run {
    fn deref_mut(&mut self) -> &mut epigraph::Run {
        &mut self.0
    }
}

/// Exact pace, seed 1 and no profiling.
fn setup(file: &GraphFile, place: &Place, settings: &Settings) -> Setup {
    let &Settings { size, samples, side, prune, pooling, poison, watch, vectors, .. } = settings;
    let device = if side == Side::Gpu { Device::on(gpu()) } else { Device::CPU };
    Setup::new(file.clone())
        .at(place)
        .size(size)
        .samples(Samples::Count(samples))
        .device(&device)
        .prune(prune)
        .pooling(pooling)
        .poison(poison)
        .watch(watch)
        .vectors(vectors)
        .profile(false)
}

/// The facts of the Cornell box, with a camera that moves or not.
///
/// # Panics
/// Never: the scene is built in.
pub fn facts(camera_moves: bool) -> Facts {
    let place = Place::load("cornell", "still").expect("a built-in scene");
    place.facts().stating(CAMERA_MOVES, camera_moves)
}

/// Settings for frames of a size with this share of the pixels sampled; the facts are the scene's.
pub fn sampled(size: [u32; 2], share: f64) -> Settings {
    Settings::new(size, Samples::Share(share).of(size), Facts::none())
}

/// The port `node.port` as a tap.
pub fn tap(name: &str) -> Source {
    name.parse().unwrap_or_else(|_| panic!("`{name}` is not NODE.PORT"))
}
