//! The settings of a run, and the steps from a graph's name to allocated memory.

use std::{mem, path::Path, sync::Arc};

use epigraph_core::{Executor, Gpu, Graph, GraphFile, Host, Plan, Registry, Settings, Source, compile};
use epigraph_scenes::Scene;
use epigraph_stages::{Pace, SampleSource, facts::CAMERA_MOVES};

use crate::{
    Backend, Device, Error, Place, Run, Samples,
    backend::require_memory,
    graphs,
    run::{self, Parts, source},
};

/// The default scene and camera path.
const SCENE: &str = "cornell";
const CAMERA: &str = "orbit";

/// The settings of a run. Every setting has a default: the Cornell box, an orbit of one degree per frame, 512 x 512
/// pixels, 5% of them sampled per frame, a hardware GPU if available.
///
/// Apart from the graph file, nothing is read or checked before [`Setup::compile`] or [`Setup::start`].
pub struct Setup {
    file: GraphFile,
    registry: Arc<Registry>,
    scene: SceneChoice,
    camera: Option<String>,
    device: DeviceChoice,
    size: [u32; 2],
    samples: Samples,
    pace: Pace,
    threads: usize,
    source: Option<Box<dyn SampleSource>>,
    host: Option<Arc<Host>>,
    seed: u32,
    prune: bool,
    pooling: bool,
    poison: bool,
    watch: bool,
    vectors: bool,
    profile: bool,
    keep: Vec<Source>,
    live: bool,
}

enum SceneChoice {
    Named(String),
    Made(Arc<Scene>),
    Place(Place),
}

enum DeviceChoice {
    Backend(Backend),
    Open(Device),
}

impl Setup {
    /// The default settings for a graph, with the built-in stages.
    pub fn new(file: GraphFile) -> Self {
        Self {
            file,
            registry: Arc::new(epigraph_stages::registry()),
            scene: SceneChoice::Named(SCENE.into()),
            camera: None,
            device: DeviceChoice::Backend(Backend::default()),
            size: [512, 512],
            samples: Samples::Share(0.05),
            pace: Pace::default(),
            threads: rayon::current_num_threads(),
            source: None,
            host: None,
            seed: 1,
            prune: true,
            pooling: true,
            poison: false,
            watch: false,
            vectors: true,
            profile: true,
            keep: Vec::new(),
            live: false,
        }
    }

    /// Uses other stage kinds, such as those of your own crate.
    pub fn registry(mut self, registry: Arc<Registry>) -> Self {
        self.registry = registry;
        self
    }

    /// The scene by its name or file.
    pub fn scene(mut self, scene: &str) -> Self {
        self.scene = SceneChoice::Named(scene.into());
        self
    }

    /// A scene made by code.
    pub fn in_scene(mut self, scene: Arc<Scene>) -> Self {
        self.scene = SceneChoice::Made(scene);
        self
    }

    /// A scene and a camera path, which other runs may share.
    pub fn at(mut self, place: &Place) -> Self {
        self.scene = SceneChoice::Place(place.clone());
        self.camera = None;
        self
    }

    /// The camera path as given on the command line: `still`, `orbit`, `fly:FILE.ron` and so on.
    pub fn camera(mut self, path: &str) -> Self {
        self.camera = Some(path.into());
        self
    }

    /// Says that somebody may move the camera by hand ([`Run::look`], [`Run::run`]): nothing is left out that a still
    /// camera makes needless.
    pub fn live(mut self) -> Self {
        self.live = true;
        self
    }

    /// Width and height of the frame in pixels, 1 to [`epigraph_core::MAX_SIDE`].
    pub fn size(mut self, size: [u32; 2]) -> Self {
        self.size = size;
        self
    }

    /// The maximum number of samples per frame.
    pub fn samples(mut self, samples: Samples) -> Self {
        self.samples = samples;
        self
    }

    /// Default placement for nodes without `on:`.
    pub fn backend(mut self, backend: Backend) -> Self {
        self.device = DeviceChoice::Backend(backend);
        self
    }

    /// Uses a GPU that is already open, or the CPU.
    pub fn device(mut self, device: &Device) -> Self {
        self.device = DeviceChoice::Open(device.clone());
        self
    }

    /// When samples arrive.
    pub fn pace(mut self, pace: Pace) -> Self {
        self.pace = pace;
        self
    }

    /// Number of tracing threads with [`Pace::Async`]; the default is one per core.
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// Takes samples from this source instead of the scene's ray tracer.
    pub fn source(mut self, source: impl SampleSource + 'static) -> Self {
        self.source = Some(Box::new(source));
        self
    }

    /// Uses the caller's host, the resources that stages use in addition to their ports. It must contain a
    /// [`epigraph_stages::World`].
    pub fn host(mut self, host: Arc<Host>) -> Self {
        self.host = Some(host);
        self
    }

    /// The random seed.
    pub fn seed(mut self, seed: u32) -> Self {
        self.seed = seed;
        self
    }

    /// If true (the default), nodes that have no effect in the scene are pruned.
    pub fn prune(mut self, prune: bool) -> Self {
        self.prune = prune;
        self
    }

    /// If true (the default), intermediate results share memory.
    pub fn pooling(mut self, pooling: bool) -> Self {
        self.pooling = pooling;
        self
    }

    /// If true, memory is filled with NaN and 0xDEADBEEF before use, to find stages that read unwritten memory.
    pub fn poison(mut self, poison: bool) -> Self {
        self.poison = poison;
        self
    }

    /// If true, a frame in which a node writes a bad value ends with [`RunError::Watch`](epigraph_core::RunError::Watch).
    /// Memory is not poisoned then.
    pub fn watch(mut self, watch: bool) -> Self {
        self.watch = watch;
        self
    }

    /// If true (the default), stages on the CPU use the vector instructions that the processor has beyond those of every
    /// processor of its kind. No bit of a picture depends on it.
    pub fn vectors(mut self, vectors: bool) -> Self {
        self.vectors = vectors;
        self
    }

    /// If true (the default), each step is timed. On a software GPU that requires a wait after each step.
    pub fn profile(mut self, profile: bool) -> Self {
        self.profile = profile;
        self
    }

    /// Sets a parameter of a node, as RON text: `set("cull", "threshold", "0.1")`.
    ///
    /// # Errors
    /// If there is no such node, or if the value is not valid RON. Unknown parameters are reported on compiling.
    pub fn set(mut self, node: &str, param: &str, value: &str) -> Result<Self, Error> {
        let address = self.file.whole()?.address_of(node);
        self.file = self.file.with_param(&format!("set {node}.{param}={value}"), &address, param, value)?;
        // An unknown node is reported here, where it is named.
        self.file.whole()?;
        Ok(self)
    }

    /// Sets one of the graph's own parameters, as RON text: `set_graph("sigma", "0.5")`.
    ///
    /// # Errors
    /// If the graph has no such parameter, or it cannot have this value.
    pub fn set_graph(mut self, param: &str, value: &str) -> Result<Self, Error> {
        self.file = self.file.with_param(&format!("set {param}={value}"), "", param, value)?;
        Ok(self)
    }

    /// Copies these ports, given as `node.port`, in each captured frame, so that [`Run::read`] finds them. The graph's
    /// outputs are always copied. The node of a kept port is not pruned.
    ///
    /// # Panics
    /// If a name is not of the form `node.port`. Unknown ports are reported on compiling.
    pub fn keep(mut self, ports: &[&str]) -> Self {
        self.keep.extend(ports.iter().map(|port| source(port)));
        self
    }

    /// Checks the graph for the scene and plans a frame. Opens a GPU only for [`Backend::Gpu`] and [`Backend::Auto`].
    ///
    /// # Errors
    /// All problems of the graph, an invalid scene or camera path, and a missing GPU.
    pub fn compile(self) -> Result<Compiled, Error> {
        let samples = self.samples.of(self.size);
        let place = match self.scene {
            SceneChoice::Named(name) => Place::load(&name, self.camera.as_deref().unwrap_or(CAMERA))?,
            SceneChoice::Made(scene) => Place::new(scene, self.camera.as_deref().unwrap_or(CAMERA))?,
            SceneChoice::Place(place) => match &self.camera {
                Some(camera) => place.along(camera)?,
                None => place,
            },
        };
        let device = match self.device {
            DeviceChoice::Backend(backend) => Device::open(backend)?,
            DeviceChoice::Open(device) => device,
        };
        let facts = place.facts();
        let facts = if self.live { facts.stating(CAMERA_MOVES, true) } else { facts };
        let settings = Settings {
            side: device.side,
            prune: self.prune,
            pooling: self.pooling,
            poison: self.poison,
            watch: self.watch,
            vectors: self.vectors,
            taps: Vec::new(),
            ..Settings::new(self.size, samples, facts)
        };
        let (graph, plan) = compile(&self.file, &self.registry, &settings)?;
        let mut compiled = Compiled {
            file: self.file,
            registry: self.registry,
            place,
            device,
            settings,
            graph,
            plan,
            pace: self.pace,
            threads: self.threads,
            source: self.source,
            host: self.host,
            seed: self.seed,
            profile: self.profile,
        };
        if !self.keep.is_empty() {
            compiled.keep(&self.keep)?;
        }
        Ok(compiled)
    }

    /// Compiles and allocates.
    ///
    /// # Errors
    /// Those of [`Setup::compile`] and [`Compiled::start`].
    pub fn start(self) -> Result<Run, Error> {
        self.compile()?.start()
    }
}

/// A graph that is checked and planned for a scene, before its memory is allocated.
pub struct Compiled {
    file: GraphFile,
    registry: Arc<Registry>,
    place: Place,
    device: Device,
    settings: Settings,
    graph: Graph,
    plan: Plan,
    pace: Pace,
    threads: usize,
    source: Option<Box<dyn SampleSource>>,
    host: Option<Arc<Host>>,
    seed: u32,
    profile: bool,
}

impl Compiled {
    /// The graph file.
    pub fn file(&self) -> &GraphFile {
        &self.file
    }

    /// The checked graph.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The execution order and memory of a frame.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The settings for which the graph is compiled.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The plan with the nodes that the scene makes needless, to find out what leaving them out saves.
    ///
    /// # Errors
    /// If the graph has a problem with these nodes.
    pub fn whole(&self) -> Result<Plan, Error> {
        let settings = Settings { prune: false, ..self.settings.clone() };
        Ok(compile(&self.file, &self.registry, &settings)?.1)
    }

    /// The scene and the camera path.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// The ports that are copied in captured frames in addition to the outputs.
    pub fn kept(&self) -> &[Source] {
        &self.settings.taps
    }

    /// Copies further ports in captured frames; see [`Setup::keep`].
    ///
    /// # Errors
    /// If the graph has no such port. Nothing is changed then.
    pub fn keep(&mut self, ports: &[Source]) -> Result<(), Error> {
        let mut taps = self.settings.taps.clone();
        for port in ports {
            if !taps.contains(port) {
                taps.push(port.clone());
            }
        }
        let before = mem::replace(&mut self.settings.taps, taps);
        match compile(&self.file, &self.registry, &self.settings) {
            Ok((graph, plan)) => {
                (self.graph, self.plan) = (graph, plan);
                Ok(())
            }
            Err(problems) => {
                self.settings.taps = before;
                Err(problems.into())
            }
        }
    }

    /// The name of the output with the picture: `image` if there is one, else the first output.
    ///
    /// # Errors
    /// If the output does not have the shape of an image.
    pub fn picture(&self) -> Result<String, Error> {
        run::picture(&self.file, &self.graph, self.settings.size)
    }

    /// Opens the GPU that the plan needs, if it is not yet open; `None` if no node runs on a GPU.
    ///
    /// # Errors
    /// If there is no GPU. The error names a node that needs it.
    pub fn gpu(&mut self) -> Result<Option<Arc<Gpu>>, Error> {
        let gpu = self.device.gpu_for(&self.plan)?;
        if gpu.is_some() {
            self.device.gpu.clone_from(&gpu);
        }
        Ok(gpu)
    }

    /// Checks that this machine has the GPU and the memory that the plan needs, as [`Compiled::start`] does.
    ///
    /// # Errors
    /// [`Error::Memory`] if main memory is too small, and a missing GPU.
    pub fn require(&mut self) -> Result<(), Error> {
        let gpu = self.gpu()?;
        require_memory(&self.plan, gpu.as_deref())
    }

    /// Allocates all memory and builds all pipelines, and the scene's ray tracer if it is not yet built.
    ///
    /// # Errors
    /// Those of [`Compiled::require`], and shaders that do not match their stages.
    pub fn start(mut self) -> Result<Run, Error> {
        self.require()?;
        let gpu = self.gpu()?;
        let host = match (self.host, self.source) {
            (Some(host), _) => host,
            (None, Some(source)) => self.place.host_with(source),
            (None, None) => self.place.host(self.pace, self.threads),
        };
        let mut executor = Executor::new(self.graph, self.plan, &self.settings, &self.registry, gpu.clone())?;
        executor.profile = self.profile;
        Ok(Run::new(Parts {
            file: self.file,
            executor,
            host,
            path: self.place.path,
            gpu,
            settings: self.settings,
            seed: self.seed,
        }))
    }
}

impl Run {
    /// Opens a graph by its file or by the name of a shipped one, with changes if the name has any:
    /// `epi+interpolate.sigma=0.5`. See [`graphs::load`], which takes stages of your own in changes, too.
    ///
    /// # Errors
    /// If there is no such graph, and all problems of its text and of the changes.
    pub fn open(graph: &str) -> Result<Setup, Error> {
        Ok(Setup::new(graphs::load(graph, &epigraph_stages::registry())?))
    }

    /// Opens a graph from its text. Messages name it by `path`, and relative paths in it start there. Its parts and its
    /// base may be files, and graphs that come with the program.
    ///
    /// # Errors
    /// All problems of the text and of what it names.
    pub fn parse(path: &Path, text: &str) -> Result<Setup, Error> {
        let file = GraphFile::parse(&path.display().to_string(), text)?;
        Ok(Setup::new(file.with_parts(&graphs::Shipped)?))
    }
}
