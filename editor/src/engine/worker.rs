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

use epigraph::{Pace, Place, Samples};
use epigraph_core::{Capture, Gpu, GraphFile, Host, MAX_SIDE, Registry};
use epigraph_scenes::{Camera, FRAMES_PER_SECOND};

use build::Rebuild;
pub use build::edited;
use inspected::Inspected;
use other::Other;
use playback::Path;

use super::{
    Command, MAX_RATE, Options, Phase, RECORDED, Record, Shaders, State,
    running::{Running, message},
};

/// The shader texts that a graph is compiled with, where [`edited`] finds them.
pub type ReadShaders = Arc<Mutex<Arc<Shaders>>>;

/// Runs until the sender of the commands is gone. `registry` reads shaders from `read`.
pub fn run(
    options: Options,
    registry: Arc<Registry>,
    read: ReadShaders,
    commands: &Receiver<Command>,
    publish: &dyn Fn(State),
) {
    let mut options = options;
    let mut early = Vec::new();
    // Without a scene, wait for one.
    let place = loop {
        match load(&options.scene) {
            Ok(place) => break place,
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
    let mut worker = Worker::new(options, registry, read, place);
    for command in early {
        worker.obey(command, publish);
    }
    worker.run(commands, publish);
}

/// Reads a scene and builds its tracer. The camera moves by hand until a path is played.
fn load(name: &str) -> Result<Place, String> {
    let read = || {
        let place = Place::load(name, "still").map_err(|error| error.to_string())?;
        place.tracer();
        Ok(place)
    };
    catch_unwind(read).unwrap_or_else(|panic| {
        Err(format!("reading the scene {name} panicked: {}", message(panic.as_ref())))
    })
}

struct Worker {
    options: Options,
    registry: Arc<Registry>,
    place: Place,
    host: Arc<Host>,
    gpu: Option<Arc<Gpu>>,
    /// The graph given last.
    file: Option<Arc<GraphFile>>,
    /// The texts of its shaders.
    shaders: Arc<Shaders>,
    /// The last graph that compiled, and its shaders.
    good: Option<(Arc<GraphFile>, Arc<Shaders>)>,
    /// The shaders that a graph is compiled with, where the registry finds them.
    read: ReadShaders,
    watched: Vec<String>,
    rebuild: Rebuild,
    /// The next graph that compiles starts from frame 0: none has since that was due.
    afresh: bool,
    running: Option<Running>,
    /// The previous graph, kept until the new one has run a frame.
    before: Option<Running>,
    camera: Camera,
    /// The camera of the last frame.
    shown: Option<Camera>,
    /// The path under way.
    path: Option<Path>,
    /// Number of frames to run although paused.
    owed: u32,
    index: u32,
    /// A frame has failed; nothing runs until something changes.
    stopped: bool,
    /// The inspected pixel.
    inspected: Option<Inspected>,
    /// All outputs of the graph's nodes in the last frame, if they were captured.
    capture: Option<Capture>,
    /// The graph beside.
    other: Option<Other>,
    /// The costs of the last frames.
    records: VecDeque<Arc<Record>>,
    /// When the engine started.
    began: Instant,
    /// The GPU was lost, and no frame has run since.
    lost: bool,
    /// The ends of the frames of the last second.
    ends: Vec<Instant>,
    state: State,
}

impl Worker {
    fn new(options: Options, registry: Arc<Registry>, read: ReadShaders, place: Place) -> Self {
        let state = State { paused: options.paused, ..State::default() };
        let camera = place.scene.camera;
        let mut worker = Self {
            host: host(&place, options.pacing),
            options,
            registry,
            read,
            shaders: Arc::default(),
            place,
            gpu: None,
            file: None,
            good: None,
            watched: Vec::new(),
            rebuild: Rebuild::No,
            afresh: false,
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

    /// Records the scene in the state.
    fn tell_scene(&mut self) {
        let scene = &self.place.scene;
        self.state.phase = Phase::Ready;
        self.state.scene = self.options.scene.clone();
        self.state.home = Some(scene.camera);
        self.state.bounds = scene.bounds.map(Into::into);
        self.state.report = scene.report.clone();
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

    /// Returns the state to publish.
    fn news(&mut self) -> State {
        self.state.owed = self.owed;
        self.state.clone()
    }

    /// The minimum time between the beginnings of two frames.
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
                // One more frame, with all ports captured for the pause.
                self.owed = u32::from(begins && self.index > 0);
                Rebuild::No
            }
            Command::Step(frames) => {
                self.owed += frames;
                Rebuild::No
            }
            Command::Guard(guarded) => {
                self.options.guarded = guarded;
                self.state.bad = None;
                Rebuild::Keep
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
            Command::Pace(pacing) => {
                self.options.pacing = pacing;
                if self.path.is_none() {
                    self.renew_host();
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
            Ok(place) => {
                self.camera = place.scene.camera;
                self.place = place;
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

    /// The current pace: along a path, all samples arrive in the frame that requests them.
    fn pacing(&self) -> Pace {
        if self.path.is_some() { Pace::Exact } else { self.options.pacing }
    }

    /// Replaces the host, with the current pace. Samples that are still being traced are dropped.
    fn renew_host(&mut self) {
        self.host = host(&self.place, self.pacing());
        for running in [&mut self.running, &mut self.before].into_iter().flatten() {
            running.run.set_host(self.host.clone());
        }
    }
}

/// The services that stages get besides their ports.
fn host(place: &Place, pacing: Pace) -> Arc<Host> {
    // One core is left to the frame and the window.
    let cores = thread::available_parallelism().map_or(1, usize::from);
    place.host(pacing, (cores - 1).max(1))
}

/// This share of the pixels. NaN and 0 still mean one sample.
fn samples(share: f32) -> Samples {
    Samples::Share(f64::from(share))
}

#[cfg(test)]
mod tests;
