//! The engine's thread: obeys commands, runs frames, publishes states.

mod capture;
mod costs;
mod inspected;
mod other;
mod playback;

use std::{
    collections::{HashMap, VecDeque},
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, RecvTimeoutError, TryRecvError},
    },
    thread,
    time::{Duration, Instant},
};

use epigraph_core::{
    AdapterChoice, Capture, Frame, Gpu, GraphFile, Host, Kind, MAX_SIDE, Problems, Registry, RunError,
    Settings, Side, wgsl_kind_from,
};
use epigraph_scenes::{AsyncTracer, Camera, FRAMES_PER_SECOND, Scene, Tracer, predict};
use epigraph_stages::{Pace, World, shared::world::PREDICTION_FRAMES};

use capture::is_watched;
use costs::step_costs;
use inspected::Inspected;
use other::Other;
use playback::Path;

use super::{
    Backend, Command, MAX_RATE, Options, Pacing, Phase, RECORDED, Record, Shaders, State,
    running::{Running, Taps, message},
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

/// Whether the memory of the running graph is still right.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Rebuild {
    No,
    /// Compile the same graph again, for other ports to be captured.
    Taps,
    /// Compile again and take over what is kept.
    Keep,
    /// Compile again and start anew.
    Afresh,
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

    /// Compiles the file that was given last. Where that fails, the last good one runs on, under the present settings.
    fn build(&mut self) {
        let rebuild = std::mem::replace(&mut self.rebuild, Rebuild::No);
        // Whoever only looks has not read yet what was said.
        if !self.lost && rebuild > Rebuild::Taps {
            self.state.trouble = None;
        }
        self.state.problems = Vec::new();
        self.rebuild_other(rebuild);
        let newest = self.file.clone().map(|file| (file, self.shaders.clone()));
        for (file, shaders) in [newest, self.good.clone()].into_iter().flatten() {
            *self.read.lock().unwrap_or_else(PoisonError::into_inner) = shaders.clone();
            let taps = self.taps();
            match self.compile(&file, taps) {
                Ok(made) => {
                    self.good = Some((file, shaders));
                    self.replace(made, rebuild);
                    return;
                }
                // Those of the newest file count.
                Err(problems) if self.state.problems.is_empty() => self.state.problems = problems.0,
                Err(_) => {}
            }
        }
    }

    fn compile(&mut self, file: &GraphFile, taps: Taps) -> Result<Running, Problems> {
        let size = self.options.size;
        let side = self.side();
        let settings = Settings {
            facts: World::facts(self.tracer.scene(), true),
            side,
            ..Settings::new(size, samples(size, self.options.samples))
        };
        let gpu = &mut self.gpu;
        let mut open = || open_gpu(gpu);
        Running::new(file, &self.registry, &settings, taps, &mut open)
    }

    /// Lets a graph run from now on, with what the one before keeps.
    fn replace(&mut self, mut made: Running, rebuild: Rebuild) {
        self.stopped = false;
        if rebuild == Rebuild::Afresh {
            self.running = None;
            self.before = None;
            self.index = 0;
            self.shown = None;
            self.state.frames = 0;
            if self.path.is_none() {
                self.state.playing = None;
            }
            // Samples of before the reset that are still under way belong to no frame.
            self.host = host(&self.tracer, self.pacing());
        }
        // One that never ran a frame has nothing yet that its successor could not take from the one before.
        let old = match (self.running.take(), self.before.take()) {
            (Some(running), _) if running.executor.frames() > 0 => Some(running),
            (running, before) => before.or(running),
        };
        if let Some(mut old) = old {
            made.is_timed = rebuild == Rebuild::Taps && old.is_timed;
            if let Err(error) = made.executor.inherit(&mut old.executor) {
                self.state.trouble = Some(format!("the cloud could not be kept: {error}"));
            }
            self.before = Some(old);
        }
        self.run_graph(made);
    }

    fn run_graph(&mut self, running: Running) {
        // Until a frame has run, what is known of the steps is what they cost before.
        let known = self.state.graph.iter().flat_map(|graph| &graph.steps).zip(&self.state.times);
        let known: HashMap<&str, f32> = known.map(|(step, ms)| (step.name.as_str(), *ms)).collect();
        let steps = running.info.steps.iter();
        let times = steps.map(|step| known.get(step.name.as_str()).copied().unwrap_or_default()).collect();
        self.state.times = times;
        self.state.graph = Some(running.info.clone());
        self.running = Some(running);
        self.capture = None;
    }

    /// When samples arrive now: along a path, all of them in the frame of their request.
    fn pacing(&self) -> Pacing {
        if self.path.is_some() { Pacing::Exact } else { self.options.pacing }
    }

    /// Where nodes run by default.
    fn side(&mut self) -> Side {
        match self.options.backend {
            Backend::Cpu => Side::Cpu,
            Backend::Gpu => Side::Gpu,
            Backend::Auto => {
                if self.gpu.is_none() {
                    self.gpu = Gpu::open(AdapterChoice::Hardware).ok().map(Arc::new);
                }
                let hardware = self.gpu.as_ref().is_some_and(|gpu| !gpu.is_software());
                if hardware { Side::Gpu } else { Side::Cpu }
            }
        }
    }

    /// The camera and what the stages get of this frame.
    fn next_frame(&self, size: [u32; 2]) -> (Camera, Frame) {
        let samples = samples(size, self.options.samples);
        if let Some(Path { path, .. }) = &self.path {
            return (
                path.camera(self.index),
                World::frame(path, self.index, size, samples, self.options.seed),
            );
        }
        let previous = self.shown.unwrap_or(self.camera);
        let frame = Frame {
            view: World::view(&self.camera, size),
            previous: World::view(&previous, size),
            predicted: World::view(&predict(&previous, &self.camera, PREDICTION_FRAMES), size),
            size,
            index: self.index,
            seed: self.options.seed,
            samples,
            ..Frame::default()
        };
        (self.camera, frame)
    }

    fn frame(&mut self) {
        let Some(running) = &self.running else { return };
        let start = Instant::now();
        let (camera, frame) = self.next_frame(running.info.size);
        let captures = self.captures();
        let Some(running) = &mut self.running else { return };
        let info = running.info.clone();
        let is_watched = |name: &str| is_watched(&info, &self.watched, name);
        let executor = &mut running.executor;
        if running.is_open {
            executor.want(|name| captures || is_watched(name));
        }
        let host = &self.host;
        let result = catch_unwind(AssertUnwindSafe(|| {
            executor.run(&frame, host, true)?;
            let took = start.elapsed();
            let snapshots = executor.snapshots()?;
            let snapshots = snapshots.into_iter().map(|snapshot| Arc::new(snapshot.clone()));
            Ok((took, snapshots.collect::<Vec<_>>()))
        }));
        let result = result.unwrap_or_else(|panic| {
            Err(RunError::Gpu(format!("running it panicked: {}", message(panic.as_ref()))))
        });
        match result {
            Ok((took, mut snapshots)) => {
                // Copies of all ports slow down the steps between them, as they push everything out of the caches. So where
                // there is a frame before that was timed without, its costs stay.
                let costs = (!(captures && running.is_timed)).then(|| step_costs(executor));
                running.is_timed |= !captures;
                let captured = captures.then(|| snapshots.clone());
                if captures {
                    snapshots.retain(|snapshot| is_watched(&snapshot.name));
                }
                self.state.snapshots = snapshots;
                self.succeeded(camera, frame.samples);
                if let Some(costs) = costs {
                    self.measure(took, &info, &costs);
                    self.record(info, costs);
                }
                self.run_other(&frame);
                self.capture = captured.map(|snapshots| Capture { frame, snapshots });
                self.tell_capture();
                self.advance();
            }
            Err(error) => self.failed(&error),
        }
    }

    fn succeeded(&mut self, camera: Camera, samples: u32) {
        self.before = None;
        self.lost = false;
        self.shown = Some(camera);
        self.index = self.index.wrapping_add(1);
        self.owed = self.owed.saturating_sub(1);
        self.state.camera = self.shown;
        if self.path.is_none() {
            self.state.playing = None;
        }
        self.state.frames = self.index;
        self.state.samples = samples;
    }

    /// The graph before takes over where this one never ran; else frames stop until something changes.
    fn failed(&mut self, error: &RunError) {
        self.owed = self.owed.saturating_sub(1);
        self.leave_path();
        match error {
            RunError::Lost(_) => return self.lose(error),
            RunError::Gpu(_) => self.gpu = None,
            _ => {}
        }
        match self.before.take() {
            Some(before) => {
                self.state.trouble =
                    Some(format!("the changed graph failed, so the one before runs on: {error}"));
                self.run_graph(before);
            }
            None => {
                self.state.trouble = Some(format!("stopped: {error}"));
                self.stopped = true;
                self.owed = 0;
            }
        }
    }

    /// What was on the GPU is gone. Another device is opened once; a loss before its first frame stops everything.
    fn lose(&mut self, error: &RunError) {
        self.gpu = None;
        self.running = None;
        self.before = None;
        if self.lost {
            self.state.trouble =
                Some(format!("stopped, as it happened again: {error}; the CPU can be chosen instead"));
        } else {
            self.state.trouble = Some(format!("{error}; a new start was made"));
            self.lost = true;
            self.rebuild = Rebuild::Afresh;
        }
    }
}

/// The kind `wgsl` with texts that stand in for files.
fn shader_kind(read: &Arc<Mutex<Arc<Shaders>>>) -> Box<dyn Kind> {
    let read = read.clone();
    wgsl_kind_from(move |path| {
        let text = read.lock().unwrap_or_else(PoisonError::into_inner).get(path).cloned();
        text.map_or_else(|| fs::read_to_string(path), |text| Ok(text.to_string()))
    })
}

/// What the stages get beside their ports.
fn host(tracer: &Arc<Tracer>, pacing: Pacing) -> Host {
    let pace = match pacing {
        Pacing::Exact => Pace::Exact,
        Pacing::Async => {
            // One core stays for the frame and the window.
            let cores = thread::available_parallelism().map_or(1, usize::from);
            Pace::Async(AsyncTracer::new((cores - 1).max(1)))
        }
    };
    let mut host = Host::default();
    host.insert(World::new(tracer.clone(), pace));
    host
}

/// The samples of a frame of `size`: at least one, at most one for each pixel.
fn samples(size: [u32; 2], share: f32) -> u32 {
    let pixels = size[0] * size[1];
    ((pixels as f32 * share).round() as u32).clamp(1, pixels)
}

fn open_gpu(open: &mut Option<Arc<Gpu>>) -> Result<Arc<Gpu>, RunError> {
    if let Some(gpu) = open {
        return Ok(gpu.clone());
    }
    let gpu = Arc::new(Gpu::open(AdapterChoice::Any)?);
    *open = Some(gpu.clone());
    Ok(gpu)
}

#[cfg(test)]
mod tests;
