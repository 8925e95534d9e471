//! What to run, and how: from a graph's name to memory that is ready for frames.

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

/// The scene and camera path where none are named.
const SCENE: &str = "cornell";
const CAMERA: &str = "orbit";

/// What to run, and how. Every setting has a default: the Cornell box, an orbit of one degree a frame, 512 x 512 pixels,
/// 5% of them sampled a frame, a hardware GPU if there is one.
///
/// Nothing is read or checked before [`Setup::compile`] or [`Setup::start`], but for the graph file.
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
    /// A graph that has been read, with the stages of the algorithms.
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
            profile: true,
            keep: Vec::new(),
            live: false,
        }
    }

    /// Other kinds of stage, such as those of your own crate.
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

    /// A scene and a camera path that other runs may share.
    pub fn at(mut self, place: &Place) -> Self {
        self.scene = SceneChoice::Place(place.clone());
        self.camera = None;
        self
    }

    /// The camera path as the command line takes it: `still`, `orbit`, `fly:FILE.ron` and so on.
    pub fn camera(mut self, path: &str) -> Self {
        self.camera = Some(path.into());
        self
    }

    /// Says that somebody may move the camera by hand ([`Run::look`], [`Run::run`]): nothing is left out that a still camera
    /// makes needless.
    pub fn live(mut self) -> Self {
        self.live = true;
        self
    }

    /// Width and height of the frame in pixels, 1 to [`epigraph_core::MAX_SIDE`].
    pub fn size(mut self, size: [u32; 2]) -> Self {
        self.size = size;
        self
    }

    /// How many samples a frame may ask for.
    pub fn samples(mut self, samples: Samples) -> Self {
        self.samples = samples;
        self
    }

    /// Where the nodes run that the graph does not place.
    pub fn backend(mut self, backend: Backend) -> Self {
        self.device = DeviceChoice::Backend(backend);
        self
    }

    /// A GPU that is open already, or the CPU.
    pub fn device(mut self, device: &Device) -> Self {
        self.device = DeviceChoice::Open(device.clone());
        self
    }

    /// When samples arrive.
    pub fn pace(mut self, pace: Pace) -> Self {
        self.pace = pace;
        self
    }

    /// Threads that the ray tracer takes with [`Pace::Async`]; by default one for each core.
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// Samples from elsewhere than the scene's ray tracer.
    pub fn source(mut self, source: impl SampleSource + 'static) -> Self {
        self.source = Some(Box::new(source));
        self
    }

    /// What stages get beside their ports, made by the caller. It has to hold a [`epigraph_stages::World`].
    pub fn host(mut self, host: Arc<Host>) -> Self {
        self.host = Some(host);
        self
    }

    /// The random seed.
    pub fn seed(mut self, seed: u32) -> Self {
        self.seed = seed;
        self
    }

    /// Whether nodes are left out that the scene makes needless; they are by default.
    pub fn prune(mut self, prune: bool) -> Self {
        self.prune = prune;
        self
    }

    /// Whether intermediate results share memory; they do by default.
    pub fn pooling(mut self, pooling: bool) -> Self {
        self.pooling = pooling;
        self
    }

    /// Whether memory is filled with NaN and 0xDEADBEEF before use, to find stages that read what nobody wrote.
    pub fn poison(mut self, poison: bool) -> Self {
        self.poison = poison;
        self
    }

    /// Whether each step's time is taken; it is by default. On a software GPU that means waiting after each.
    pub fn profile(mut self, profile: bool) -> Self {
        self.profile = profile;
        self
    }

    /// Sets a parameter of a node, as RON text: `set("cull", "threshold", "0.1")`.
    ///
    /// # Errors
    /// That there is no such node, or that the value is no RON. Whether the stage knows the parameter shows on compiling.
    pub fn set(mut self, node: &str, param: &str, value: &str) -> Result<Self, Error> {
        self.file.set_param(node, param, value)?;
        Ok(self)
    }

    /// Copies these ports, as `node.port`, in each captured frame, so that [`Run::read`] finds them; the graph's outputs
    /// always are. A port that is kept keeps its node from being left out.
    ///
    /// # Panics
    /// Where a name is not of the form `node.port`. Whether the graph has such a port shows on compiling.
    pub fn keep(mut self, ports: &[&str]) -> Self {
        self.keep.extend(ports.iter().map(|port| source(port)));
        self
    }

    /// Checks the graph for the scene and plans a frame. Needs no GPU, unless [`Backend::Gpu`] or [`Backend::Auto`] look
    /// for one.
    ///
    /// # Errors
    /// All problems of the graph; what is wrong with the scene or the camera path; that there is no GPU.
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
        let moves = self.live || facts.holds(CAMERA_MOVES);
        let settings = Settings {
            facts: facts.stating(CAMERA_MOVES, moves),
            side: device.side,
            prune: self.prune,
            pooling: self.pooling,
            poison: self.poison,
            taps: Vec::new(),
            ..Settings::new(self.size, samples)
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
    /// As [`Setup::compile`] and [`Compiled::start`].
    pub fn start(self) -> Result<Run, Error> {
        self.compile()?.start()
    }
}

/// A graph that is checked and planned for a scene. Holds no memory yet.
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

    /// What a frame does, in order, and with which memory.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// What it is compiled for.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The scene and the camera path.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// The ports that are copied in captured frames beside the outputs.
    pub fn kept(&self) -> &[Source] {
        &self.settings.taps
    }

    /// Copies further ports in captured frames; see [`Setup::keep`].
    ///
    /// # Errors
    /// That the graph has no such port. All is then as it was.
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

    /// The output that is the picture: the one called `image`, else the first. Its name.
    ///
    /// # Errors
    /// That it does not have the shape of an image.
    pub fn picture(&self) -> Result<String, Error> {
        run::picture(&self.file, &self.graph, self.settings.size)
    }

    /// Opens the GPU that the plan needs, if it is not open yet; none for a plan on the CPU alone.
    ///
    /// # Errors
    /// That there is none, naming the node that needs it.
    pub fn gpu(&mut self) -> Result<Option<Arc<Gpu>>, Error> {
        let gpu = self.device.gpu_for(&self.plan)?;
        if gpu.is_some() {
            self.device.gpu.clone_from(&gpu);
        }
        Ok(gpu)
    }

    /// Makes sure that this machine has the GPU and the memory that the plan needs. [`Compiled::start`] does so too.
    ///
    /// # Errors
    /// [`Error::Memory`] where main memory does not suffice, and that there is no GPU.
    pub fn require(&mut self) -> Result<(), Error> {
        let gpu = self.gpu()?;
        require_memory(&self.plan, gpu.as_deref())
    }

    /// Allocates all memory and builds all pipelines, and the scene's ray tracer if nobody has built it.
    ///
    /// # Errors
    /// What the machine lacks, see [`Compiled::require`]; shaders that do not fit their stages.
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
    /// Begins with a graph: a file, or the name of one that comes with the program.
    ///
    /// # Errors
    /// That there is no such graph, or what is wrong with its text.
    pub fn open(graph: &str) -> Result<Setup, Error> {
        Ok(Setup::new(graphs::load(graph)?))
    }

    /// Begins with the text of a graph; `path` is what messages call it, and where relative paths in it start.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub fn parse(path: &Path, text: &str) -> Result<Setup, Error> {
        Ok(Setup::new(GraphFile::parse(&path.display().to_string(), text)?))
    }
}
