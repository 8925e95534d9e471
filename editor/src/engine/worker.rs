//! The engine's thread: obeys commands, runs frames, publishes states.

mod build;
mod capture;
mod costs;
mod frame;
mod inspected;
mod other;
mod playback;

use std::{
    collections::VecDeque,
    panic::catch_unwind,
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, RecvTimeoutError, TryRecvError},
    },
    thread,
    time::{Duration, Instant},
};

use epigraph_core::{Capture, Gpu, GraphFile, Host, MAX_SIDE, Registry};
use epigraph_scenes::{Camera, FRAMES_PER_SECOND, Scene, Tracer};
use epigraph_stages::{Pace, World};

use build::{Rebuild, shader_kind};
use inspected::Inspected;
use other::Other;
use playback::Path;

use super::{
    Command, MAX_RATE, Options, Pacing, Phase, RECORDED, Record, Shaders, State,
    running::{Running, message},
};

/// Runs until the sender of the commands is gone.
pub fn run(options: Options, registry: Registry, commands: &Receiver<Command>, publish: &dyn Fn(State)) {
    let mut options = options;
    let mut early = Vec::new();
    // Without a scene there is nothing to do but to wait for one.
    let scene = loop {
        match load(&options.scene) {
            Ok(scene) => break scene,
            Err(error) => publish(State { phase: Phase::Failed(error), ..State::default() }),
        }
        loop {
            match commands.recv() {
                Ok(Command::Scene(name)) => {
                    options.scene = name;
                    break;
                }
                Ok(command) => early.push(command),
                Err(_) => return,
            }
        }
        publish(State::default());
    };
    let mut worker = Worker::new(options, registry, scene);
    for command in early {
        worker.obey(command, publish);
    }
    worker.run(commands, publish);
}

/// Reads a scene.
fn load(name: &str) -> Result<Arc<Scene>, String> {
    let read = || Scene::load(name).map(Arc::new).map_err(|error| error.to_string());
    catch_unwind(read).unwrap_or_else(|panic| {
        Err(format!("reading the scene {name} panicked: {}", message(panic.as_ref())))
    })
}

struct Worker {
    options: Options,
    registry: Registry,
    tracer: Arc<Tracer>,
    host: Host,
    gpu: Option<Arc<Gpu>>,
    /// The graph that was given last.
    file: Option<Arc<GraphFile>>,
    /// The texts of its shaders.
    shaders: Arc<Shaders>,
    /// The graph that compiled last, and its shaders.
    good: Option<(Arc<GraphFile>, Arc<Shaders>)>,
    /// The shaders that a graph is compiled with, where the registry finds them.
    read: Arc<Mutex<Arc<Shaders>>>,
    watched: Vec<String>,
    rebuild: Rebuild,
    running: Option<Running>,
    /// What ran before, until the new one has shown that it runs.
    before: Option<Running>,
    camera: Camera,
    /// The camera of the last frame.
    shown: Option<Camera>,
    /// The path under way.
    path: Option<Path>,
    /// Frames to run though paused.
    owed: u32,
    index: u32,
    /// A frame has failed; nothing runs until something changes.
    stopped: bool,
    /// What is inspected.
    inspected: Option<Inspected>,
    /// All that the graph's nodes wrote in the last frame, where that was captured.
    capture: Option<Capture>,
    /// The graph beside.
    other: Option<Other>,
    /// What the last frames cost.
    records: VecDeque<Arc<Record>>,
    /// When the engine began.
    began: Instant,
    /// The GPU was lost, and no frame has run since.
    lost: bool,
    /// The ends of the frames of the last second.
    ends: Vec<Instant>,
    state: State,
}

impl Worker {
    fn new(options: Options, registry: Registry, scene: Arc<Scene>) -> Self {
        let state = State { paused: options.paused, ..State::default() };
        let camera = scene.camera;
        let tracer = Arc::new(Tracer::new(scene));
        let read = Arc::default();
        let mut worker = Self {
            host: host(&tracer, options.pacing),
            options,
            registry: registry.with_kind(shader_kind(&read)),
            read,
            shaders: Arc::default(),
            tracer,
            gpu: None,
            file: None,
            good: None,
            watched: Vec::new(),
            rebuild: Rebuild::No,
            running: None,
            before: None,
            camera,
            shown: None,
            owed: 0,
            index: 0,
            path: None,
            inspected: None,
            capture: None,
            other: None,
            records: VecDeque::with_capacity(RECORDED),
            began: Instant::now(),
            stopped: false,
            lost: false,
            ends: Vec::new(),
            state,
        };
        worker.tell_scene();
        worker
    }

    /// Says which scene it is.
    fn tell_scene(&mut self) {
        let scene = self.tracer.scene();
        self.state.phase = Phase::Ready;
        self.state.scene = self.options.scene.clone();
        self.state.home = Some(scene.camera);
        self.state.bounds = scene.bounds.map(Into::into);
    }

    fn run(mut self, commands: &Receiver<Command>, publish: &dyn Fn(State)) {
        publish(self.news());
        let mut next = Instant::now();
        loop {
            let first = if self.has_work() || self.rebuild != Rebuild::No {
                match commands.recv_timeout(next.saturating_duration_since(Instant::now())) {
                    Ok(command) => Some(command),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => return,
                }
            } else {
                match commands.recv() {
                    Ok(command) => Some(command),
                    Err(_) => return,
                }
            };
            let mut command = first;
            let mut obeyed = false;
            while let Some(given) = command {
                self.obey(given, publish);
                obeyed = true;
                command = match commands.try_recv() {
                    Ok(command) => Some(command),
                    Err(TryRecvError::Empty) => None,
                    Err(TryRecvError::Disconnected) => return,
                };
            }
            self.follow_taps();
            if self.rebuild != Rebuild::No {
                self.build();
            }
            if self.has_work() && next <= Instant::now() {
                next = Instant::now() + self.interval();
                self.frame();
                publish(self.news());
            } else if obeyed {
                publish(self.news());
            }
        }
    }

    /// What there is to say now.
    fn news(&mut self) -> State {
        self.state.owed = self.owed;
        self.state.clone()
    }

    /// From the beginning of a frame to that of the next, at least.
    fn interval(&self) -> Duration {
        let rate = match &self.path {
            Some(Path { sink: Some(_), .. }) => return Duration::ZERO,
            Some(_) => FRAMES_PER_SECOND,
            None => MAX_RATE,
        };
        Duration::from_secs_f32(1.0 / rate)
    }

    fn has_work(&self) -> bool {
        self.running.is_some() && !self.stopped && (!self.options.paused || self.owed > 0)
    }

    fn obey(&mut self, command: Command, publish: &dyn Fn(State)) {
        self.state.commands += 1;
        let rebuild = match command {
            Command::Graph(file) => {
                self.file = Some(file);
                Rebuild::Keep
            }
            Command::Shaders(shaders) => {
                self.shaders = shaders;
                Rebuild::Keep
            }
            Command::Camera(camera) => {
                self.leave_path();
                self.state.playing = None;
                self.camera = camera;
                Rebuild::No
            }
            Command::Pause(paused) => {
                let begins = paused && !self.options.paused;
                self.pause(paused);
                // One more, of which all can be seen while frames wait.
                self.owed = u32::from(begins && self.index > 0);
                Rebuild::No
            }
            Command::Step(frames) => {
                self.owed += frames;
                Rebuild::No
            }
            Command::Reset => {
                self.leave_path();
                Rebuild::Afresh
            }
            Command::Samples(share) => {
                self.options.samples = share.clamp(0.0, 1.0);
                Rebuild::Keep
            }
            Command::Size(size) => {
                self.options.size = size.map(|side| side.clamp(1, MAX_SIDE));
                Rebuild::Keep
            }
            Command::Scene(name) => self.change_scene(name, publish),
            Command::Play(playback) => self.play(playback),
            Command::Stop => {
                self.leave_path();
                self.pause(true);
                Rebuild::No
            }
            Command::Backend(backend) => {
                self.options.backend = backend;
                Rebuild::Keep
            }
            Command::Pacing(pacing) => {
                self.options.pacing = pacing;
                if self.path.is_none() {
                    self.host = host(&self.tracer, pacing);
                }
                Rebuild::No
            }
            Command::Other(other) => {
                self.set_other(other);
                Rebuild::No
            }
            Command::Watch(watched) => {
                self.watch(watched);
                Rebuild::No
            }
            Command::Inspect(pixel) => {
                self.inspect(pixel);
                Rebuild::No
            }
        };
        self.rebuild = self.rebuild.max(rebuild);
    }

    fn pause(&mut self, paused: bool) {
        self.options.paused = paused;
        self.state.paused = paused;
        self.owed = 0;
    }

    fn change_scene(&mut self, name: String, publish: &dyn Fn(State)) -> Rebuild {
        self.leave_path();
        publish(State { phase: Phase::Loading, ..self.state.clone() });
        match load(&name) {
            Ok(scene) => {
                self.camera = scene.camera;
                self.tracer = Arc::new(Tracer::new(scene));
                self.options.scene = name;
                self.tell_scene();
                Rebuild::Afresh
            }
            Err(error) => {
                self.state.trouble = Some(error);
                Rebuild::No
            }
        }
    }

    /// When samples arrive now: along a path, all of them in the frame of their request.
    fn pacing(&self) -> Pacing {
        if self.path.is_some() { Pacing::Exact } else { self.options.pacing }
    }
}

/// What the stages get beside their ports.
fn host(tracer: &Arc<Tracer>, pacing: Pacing) -> Host {
    let pace = match pacing {
        Pacing::Exact => Pace::Exact,
        Pacing::Async => Pace::Async,
    };
    // One core stays for the frame and the window.
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let mut host = Host::default();
    host.insert(World::new(tracer.clone(), pace, (cores - 1).max(1)));
    host
}

/// The samples of a frame of `size`: at least one, at most one for each pixel.
fn samples(size: [u32; 2], share: f32) -> u32 {
    let pixels = size[0] * size[1];
    ((pixels as f32 * share).round() as u32).clamp(1, pixels)
}

#[cfg(test)]
mod tests;
