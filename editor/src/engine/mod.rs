//! The engine: a thread that owns the scene, its tracer, the graph and its memory, and runs frame after frame.
//!
//! The user interface sends [`Command`]s and reads the last published [`State`]. Neither side waits for the other:
//! commands queue up, and of several of one kind the last counts; a state is a value that is replaced as a whole.
//! Failures (a graph that does not compile, a stage that panics, a lost device) are reported in the state, and the last
//! working graph runs on.

mod info;
mod playback;
mod record;
mod running;
#[cfg(test)]
mod tests;
mod worker;

use std::{
    collections::BTreeMap,
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError, mpsc},
    thread::{self, JoinHandle},
};

use epigraph_core::{BadValue, GraphFile, Problem, Registry, Snapshot};
use epigraph_scenes::{Camera, Report};

use crate::inspect::Inspection;
use worker::{ReadShaders, edited};

pub use epigraph::{Backend, Pace};
pub use info::{GraphInfo, NodeInfo, PortInfo, StepInfo, Transfer};
pub use playback::{Playback, Playing, Sink, Way};
pub use record::{RECORDED, Record, StepCost};

/// Most frames per second: more than a screen shows would only take cores from the tracer.
pub const MAX_RATE: f32 = 60.0;

/// The engine's initial settings.
#[derive(Clone, Debug)]
pub struct Options {
    /// The scene's name or file.
    pub scene: String,
    /// Width and height of the frame, pixels.
    pub size: [u32; 2],
    /// Maximum number of samples per frame, as a share of its pixels, above 0 and at most 1.
    pub samples: f32,
    /// Default placement for nodes without `on:`.
    pub backend: Backend,
    /// When samples arrive.
    pub pacing: Pace,
    /// True if frames wait for [`Command::Step`].
    pub paused: bool,
    /// True if frames pause after the first one in which a node writes a bad number.
    pub guarded: bool,
    /// The run's seed.
    pub seed: u32,
    /// True if times are measured. If not, every step counts as a millisecond and the rate is [`MAX_RATE`], so that a
    /// picture of the window is the same in every run.
    pub measured: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            scene: "cornell".into(),
            size: [512, 512],
            samples: 0.05,
            backend: Backend::default(),
            pacing: Pace::Async,
            paused: false,
            guarded: false,
            seed: 1,
            measured: true,
        }
    }
}

/// Texts of shader files, by path, that override the files' contents.
pub type Shaders = BTreeMap<PathBuf, Arc<str>>;

/// A graph to run beside the current one for comparison, with the same views and number of samples.
#[derive(Clone, Debug)]
pub struct Other {
    /// The graph.
    pub file: Arc<GraphFile>,
    /// The texts of its shaders.
    pub shaders: Arc<Shaders>,
    /// Ports to take [`Snapshot`]s of, as `node.port`, beside its outputs. Unknown ones are skipped.
    pub watched: Vec<String>,
}

/// The engine's report on the graph beside.
#[derive(Clone, Debug, Default)]
pub struct OtherState {
    /// Its file.
    pub path: String,
    /// The compiled graph.
    pub graph: Option<Arc<GraphInfo>>,
    /// Why it does not run.
    pub trouble: Option<String>,
    /// Milliseconds of its last frame, as [`State::frame_ms`].
    pub frame_ms: f32,
    /// The watched ports and the outputs as of its last frame.
    pub snapshots: Vec<Arc<Snapshot>>,
}

/// The user interface's commands to the engine.
#[derive(Clone, Debug)]
pub enum Command {
    /// Run this graph from now on, with the current graph's history wherever that fits.
    Graph(Arc<GraphFile>),
    /// Compile the graph again, with these texts for its shaders.
    Shaders(Arc<Shaders>),
    /// Look from here.
    Camera(Camera),
    /// Pause until [`Command::Step`], or go on.
    Pause(bool),
    /// Run this many frames even while paused.
    Step(u32),
    /// Pause after a frame in which a node writes a bad number (see [`State::bad`]), or no longer.
    Guard(bool),
    /// Discard everything kept from frame to frame, and count frames from 0 again.
    Reset,
    /// Maximum number of samples per frame, as a share of its pixels.
    Samples(f32),
    /// Width and height of the frame, pixels.
    Size([u32; 2]),
    /// Load another scene, by its name or file. If it cannot be read, the current one stays.
    Scene(String),
    /// Discard everything kept and run along a path, always with [`Pace::Exact`]; then pause. This stops a path that is
    /// under way.
    Play(Playback),
    /// Leave the path, and pause.
    Stop,
    /// Default placement for nodes without `on:`.
    Backend(Backend),
    /// When samples arrive.
    Pace(Pace),
    /// Ports to take [`Snapshot`]s of, as `node.port`; the graph's outputs are always taken. Unknown ones are skipped.
    /// While paused, all ports of the last frame are available, unless their copies were too large: then one more is
    /// run.
    Watch(Vec<String>),
    /// Run this graph beside the current one, frame for frame; `None` ends that.
    Other(Option<Other>),
    /// Report what every node did at this pixel, column and row, in the next frame; while paused, in the last one if
    /// all ports were copied, else in one more. `None` ends that.
    Inspect(Option<[u32; 2]>),
}

/// The engine's phase.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Phase {
    /// The scene is being read and its tracer built.
    #[default]
    Loading,
    /// The scene is loaded; frames run if there is a graph.
    Ready,
    /// The scene could not be loaded, for this reason.
    Failed(String),
}

/// The engine's published state; replaced after every frame and every command.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// Whether the scene is loaded.
    pub phase: Phase,
    /// Number of commands carried out.
    pub commands: u64,
    /// The scene's name or file, once it is loaded.
    pub scene: String,
    /// The scene's own view, once it is loaded.
    pub home: Option<Camera>,
    /// Lowest and highest corner of the scene, metres.
    pub bounds: [[f32; 3]; 2],
    /// What of the scene's files is not in the scene as it stands.
    pub report: Arc<Report>,
    /// The graph that runs.
    pub graph: Option<Arc<GraphInfo>>,
    /// Problems of the graph given last; it then does not run, and [`State::graph`] is an earlier one.
    pub problems: Vec<Problem>,
    /// Why frames have stopped, or why a setting could not be applied.
    pub trouble: Option<String>,
    /// The first bad number of the last frame, if frames are guarded; they are paused then.
    pub bad: Option<Arc<BadValue>>,
    /// Frames run since the start or the last reset.
    pub frames: u32,
    /// True if frames are paused.
    pub paused: bool,
    /// Number of frames that still run while paused.
    pub owed: u32,
    /// The path of the last frame, until the camera is moved or the frame count is reset.
    pub playing: Option<Playing>,
    /// The outcome of the last recording.
    pub recorded: Option<Result<String, String>>,
    /// The camera of the last frame.
    pub camera: Option<Camera>,
    /// Milliseconds of each of the graph's steps in the last frame, in the order of [`GraphInfo::steps`].
    pub times: Vec<f32>,
    /// The costs of the last [`RECORDED`] frames, the oldest first.
    pub records: Arc<[Arc<Record>]>,
    /// Milliseconds of the last frame, without copies for viewers.
    pub frame_ms: f32,
    /// Frames in the last second.
    pub rate: f32,
    /// Maximum number of samples of the last frame.
    pub samples: u32,
    /// The inspected pixel, as of the last frame that was captured for it.
    pub inspection: Option<Arc<Inspection>>,
    /// The state of the graph beside, if there is one.
    pub other: Option<OtherState>,
    /// The watched ports and the outputs as of the last frame: one for each field.
    pub snapshots: Vec<Arc<Snapshot>>,
}

impl State {
    /// The fields of a watched port or output, in the port's order.
    pub fn fields<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Arc<Snapshot>> {
        self.snapshots.iter().filter(move |snapshot| snapshot.name == name)
    }
}

/// The user interface's handle to the engine. Dropping it ends the thread after the frame under way.
pub struct Engine {
    commands: Option<mpsc::Sender<Command>>,
    published: Arc<Mutex<Arc<State>>>,
    registry: Arc<Registry>,
    thread: Option<JoinHandle<()>>,
}

impl Engine {
    /// Starts the thread, with these kinds of stage. `wake` is called from it whenever there is a new state.
    pub fn start(options: Options, registry: Registry, wake: impl Fn() + Send + 'static) -> Self {
        let read = ReadShaders::default();
        let registry = Arc::new(registry.with_edited(edited(&read)));
        let (sender, commands) = mpsc::channel();
        let first = State { paused: options.paused, ..State::default() };
        let published = Arc::new(Mutex::new(Arc::new(first)));
        let shared = published.clone();
        let publish = move |state: State| {
            *shared.lock().unwrap_or_else(PoisonError::into_inner) = Arc::new(state);
            wake();
        };
        let kinds = registry.clone();
        let thread = thread::Builder::new()
            .name("engine".into())
            .spawn(move || worker::run(options, kinds, read, &commands, &publish))
            .ok();
        Self { commands: Some(sender), published, registry, thread }
    }

    /// The kinds of stage.
    pub fn registry(&self) -> &Arc<Registry> {
        &self.registry
    }

    /// Queues a command.
    pub fn send(&self, command: Command) {
        // The thread ends only with this handle, or if it could not start, which `is_alive` reports.
        if let Some(commands) = &self.commands {
            let _ = commands.send(command);
        }
    }

    /// The engine's last state.
    pub fn state(&self) -> Arc<State> {
        self.published.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// True if the thread still runs.
    pub fn is_alive(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.commands = None;
        if let Some(thread) = self.thread.take() {
            // A panic has been printed already.
            let _ = thread.join();
        }
    }
}
