//! The state that all panes share: the document, the engine, the camera, the selection.

use std::{
    path::Path,
    sync::{Arc, Mutex},
    time::Instant,
};

use egui::ThemePreference;
use epigraph_core::{BadValue, GraphFile, MAX_SIDE, Problem, Problems, Registry, Snapshot};
use epigraph_files::Target;
use epigraph_scenes::Camera;

use crate::{
    beside::Beside,
    camera::Rig,
    document::{Document, Places, Tag},
    engine::{Backend, Command, Engine, Options, Pace, Playback, Playing, Sink, State, Way},
    inspect::Picked,
    intent::Intent,
    jobs::{Jobs, Outcome},
    output::CommandLine,
    pulse::Pulse,
    route::{Recorder, Route},
    store::Seen,
};

/// Maximum number of frames of a still view on a command line: more hardly change the picture.
const SETTLED: u32 = 300;

/// Range of the resolution's scale.
pub const SCALES: std::ops::RangeInclusive<f32> = 0.25..=2.0;

/// The user's settings for the run.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Maximum number of samples per frame, percent of its pixels.
    pub samples: f32,
    /// Width and height of the frame at a scale of 1, pixels.
    pub size: [u32; 2],
    /// The resolution's scale, of [`SCALES`].
    pub scale: f32,
    /// Default placement for nodes without `on:`.
    pub backend: Backend,
    /// When samples arrive.
    pub pacing: Pace,
    /// Light, dark, or following the system.
    pub theme: ThemePreference,
}

/// An open graph that runs.
pub struct Session {
    /// The graph's text.
    pub document: Document,
    /// The engine that runs it.
    pub engine: Engine,
    /// The engine's last state, taken once for each frame of the window.
    pub state: Arc<State>,
    /// All stage kinds.
    pub registry: Arc<Registry>,
    /// The address of the selected node.
    pub selected: Option<String>,
    /// The pixel that the user has picked.
    pub inspection: Picked,
    /// The graph that views are compared with.
    pub beside: Beside,
    /// The user's settings.
    pub settings: Settings,
    /// Requests of panes in this frame of the window.
    intents: Vec<Intent>,
    /// The outcome of the last action.
    notice: Option<String>,
    /// The camera, once the scene is loaded.
    rig: Option<Rig>,
    /// The requested scene, by its name or file.
    scene: String,
    /// The scene that the camera is in.
    within: String,
    /// The camera to set once the scene of that name is loaded.
    look: Option<Seen>,
    /// The path that is being recorded.
    recorder: Option<Recorder>,
    /// The current path.
    route: Option<Route>,
    /// Work on other threads.
    jobs: Jobs,
    /// The frame rate of the window.
    pulse: Pulse,
    /// The window's time, seconds.
    now: f64,
    /// The run's seed.
    seed: u32,
    /// True if times are measured; see [`Options::measured`].
    measured: bool,
    /// True if frames pause at the first bad number; see [`Options::guarded`].
    guarded: bool,
    /// The revision of the document that the engine has.
    sent: u64,
    /// The ports that the engine captures.
    watched: Vec<String>,
}

impl Session {
    /// Runs a document, with these kinds of stage. `wake` is called from the engine's thread when there is something
    /// new to show.
    pub fn new(
        mut document: Document,
        options: Options,
        registry: Registry,
        wake: impl Fn() + Clone + Send + Sync + 'static,
    ) -> Self {
        let Options { size, backend, pacing, seed, measured, guarded, .. } = options;
        let (samples, scene) = (options.samples * 100.0, options.scene.clone());
        let theme = ThemePreference::default();
        let jobs = Jobs::new(wake.clone());
        let engine = Engine::start(options, registry, wake);
        let session = Self {
            state: engine.state(),
            sent: document.revision(),
            registry: engine.registry().clone(),
            engine,
            selected: None,
            inspection: Picked::default(),
            beside: Beside::default(),
            settings: Settings { samples, size, scale: 1.0, backend, pacing, theme },
            intents: Vec::new(),
            notice: document.take_notice(),
            rig: None,
            scene,
            within: String::new(),
            look: None,
            recorder: None,
            route: None,
            jobs,
            pulse: Pulse::default(),
            now: 0.0,
            seed,
            measured,
            guarded,
            watched: Vec::new(),
            document,
        };
        session.send_graph();
        session
    }

    /// Adds a request of a pane to the window.
    pub fn push(&mut self, intent: Intent) {
        self.intents.push(intent);
    }

    /// The requests of panes since the last call.
    pub fn take_intents(&mut self) -> Vec<Intent> {
        std::mem::take(&mut self.intents)
    }

    /// The outcome of the last action.
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_deref()
    }

    /// Shows a notice of an action's outcome.
    pub fn tell(&mut self, notice: impl Into<String>) {
        self.notice = Some(notice.into());
    }

    /// Starts work on a thread of its own; a notice reports its outcome.
    pub fn start(&self, work: impl FnOnce() -> Outcome + Send + 'static) {
        self.jobs.start(work);
    }

    /// Takes the engine's last state, and sends it the document's changes and the watched ports. Call it once in each
    /// frame of the window, at `now` seconds of its time.
    pub fn sync(&mut self, mut watched: Vec<String>, now: f64) {
        self.now = now;
        self.pulse.beat(Instant::now());
        let before = std::mem::replace(&mut self.state, self.engine.state());
        if let Some(recorded) = self.state.recorded.clone().filter(|_| before.recorded != self.state.recorded)
        {
            self.conclude(recorded);
        }
        if let Some(outcome) = self.jobs.news() {
            self.conclude(outcome);
        }
        if let Some(bad) = self.state.bad.clone().filter(|_| before.bad != self.state.bad) {
            self.point_at(&bad);
        }
        self.follow();
        if self.document.revision() != self.sent {
            self.sent = self.document.revision();
            self.notice = None;
            self.send_graph();
        }
        if let Some(pixel) = self.inspection.news() {
            self.engine.send(Command::Inspect(pixel));
        }
        if let Some(other) = self.beside.news(&self.document, &self.registry) {
            self.engine.send(Command::Other(other));
        }
        watched.sort();
        watched.dedup();
        if watched != self.watched {
            self.watched = watched;
            self.engine.send(Command::Watch(self.watched.clone()));
        }
    }

    /// Sets the user's camera for a new scene, and moves it along the path under way.
    fn follow(&mut self) {
        if let Some(home) = self.state.home
            && self.within != self.state.scene
        {
            self.within.clone_from(&self.state.scene);
            self.rig = Some(Rig::new(home, self.state.bounds));
            if let Some(Seen { eye, rotation, .. }) = self.look.take_if(|seen| seen.scene == self.within) {
                self.move_camera(|rig| rig.camera = Camera { eye, rotation, ..home });
            }
        }
        let playing = self.is_playing();
        if let (Some(rig), Some(camera), true) = (&mut self.rig, self.state.camera, playing) {
            rig.camera = camera;
        }
        if let (Some(route), Some(playing)) = (&mut self.route, &self.state.playing)
            && route.way == playing.way
            && playing.is_under_way()
        {
            route.frames = Some(playing.frames);
        }
        if let (Some(recorder), Some(rig)) = (&mut self.recorder, &self.rig) {
            recorder.note(self.now, rig.camera);
        }
    }

    fn conclude(&mut self, outcome: Outcome) {
        self.notice = Some(outcome.unwrap_or_else(|error| error));
    }

    /// True if frames pause at the first bad number.
    pub fn is_guarded(&self) -> bool {
        self.guarded
    }

    /// Lets frames pause at the first bad number, or no longer.
    pub fn guard(&mut self, guarded: bool) {
        self.guarded = guarded;
        self.engine.send(Command::Guard(guarded));
    }

    /// Selects the node that wrote a bad number, shows the port, and picks the pixel.
    fn point_at(&mut self, bad: &BadValue) {
        self.selected = Some(bad.node.clone());
        // A bundle's port comes before its field.
        let port = bad.port.strip_prefix(&format!("{}.", bad.node)).unwrap_or(&bad.port);
        let port = port.split('.').next().unwrap_or(port);
        self.push(Intent::Show(format!("{}.{port}", bad.node)));
        if let Some(pixel) = bad.pixel {
            self.push(Intent::Inspect(pixel));
        }
    }

    /// The window's frames in the last second, if times are measured.
    pub fn window_rate(&self) -> Option<usize> {
        self.measured.then(|| self.pulse.rate())
    }

    /// Switches to another graph.
    pub fn open(&mut self, document: Document) {
        self.document = document;
        self.selected = None;
        self.notice = None;
        self.sent = self.document.revision();
        self.send_graph();
        self.engine.send(Command::Reset);
    }

    /// The requested scene, by its name or file.
    pub fn scene(&self) -> &str {
        &self.scene
    }

    /// Switches to another scene, once it is read.
    pub fn open_scene(&mut self, scene: String) {
        self.recorder = None;
        self.route = None;
        self.scene.clone_from(&scene);
        self.engine.send(Command::Scene(scene));
    }

    /// Sets the camera as soon as the scene is loaded.
    pub fn look_from(&mut self, seen: Seen) {
        self.look = Some(seen);
    }

    /// The scene's name, or its file's name without folder and extension.
    pub fn scene_stem(&self) -> String {
        Path::new(&self.scene).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Width and height of the frame, pixels.
    pub fn frame_size(&self) -> [u32; 2] {
        self.settings.size.map(|side| ((side as f32 * self.settings.scale).round() as u32).clamp(1, MAX_SIDE))
    }

    /// Sends a changed size or scale to the engine.
    pub fn resize(&self) {
        self.engine.send(Command::Size(self.frame_size()));
    }

    /// The camera, once the scene is loaded.
    pub fn camera(&self) -> Option<Camera> {
        self.rig.map(|rig| rig.camera)
    }

    /// Length in seconds of the path that is being recorded.
    pub fn recorded_seconds(&self) -> Option<f32> {
        self.recorder.as_ref().map(Recorder::seconds)
    }

    /// The current path.
    pub fn route(&self) -> Option<&Route> {
        self.route.as_ref()
    }

    /// Starts recording the camera's path, or stops and makes it the current path.
    pub fn toggle_recorder(&mut self) {
        match (self.recorder.take(), &self.rig) {
            (Some(mut recorder), rig) => {
                if let Some(rig) = rig {
                    recorder.note(self.now, rig.camera);
                }
                self.notice =
                    Some(format!("recorded a path of {:.1} s; play or save it", recorder.seconds()));
                self.route = Some(recorder.finish());
            }
            (None, Some(rig)) => {
                self.notice = None;
                self.recorder = Some(Recorder::new(self.now, rig.camera));
            }
            (None, None) => {}
        }
    }

    /// True if a path is playing.
    pub fn is_playing(&self) -> bool {
        self.state.playing.as_ref().is_some_and(Playing::is_under_way)
    }

    /// Number of frames of the current path, if known; else 60, two seconds.
    pub fn route_frames(&self) -> u32 {
        self.route.as_ref().and_then(|route| route.frames).unwrap_or(60)
    }

    /// Makes a path the current one and plays it from its beginning.
    pub fn play(&mut self, route: Route) {
        self.recorder = None;
        self.notice = None;
        self.engine.send(Command::Play(Playback { way: route.way.clone(), frames: None, sink: None }));
        self.route = Some(route);
    }

    /// Plays the first frames of the current path into a sink, as fast as they can be rendered.
    ///
    /// # Errors
    /// There is no path.
    pub fn record(&mut self, frames: u32, sink: Arc<Mutex<dyn Sink>>) -> Result<(), String> {
        let way = self.route.as_ref().ok_or("there is no path")?.way.clone();
        self.notice = None;
        self.engine.send(Command::Play(Playback { way, frames: Some(frames), sink: Some(sink) }));
        Ok(())
    }

    /// Saves the current path; the notice shows the command line for it.
    ///
    /// # Errors
    /// There is no path, the path has a name and needs no file, or the file cannot be written.
    pub fn save_route(&mut self, path: &Path) -> Result<(), String> {
        let route = self.route.as_mut().ok_or("there is no path")?;
        let Way::Keys(text) = &route.way else {
            return Err(format!("{} needs no file: the command line takes its name", route.label()));
        };
        let written = Target::new(path).and_then(|target| target.write(text.as_bytes()));
        written.map_err(|error| error.to_string())?;
        route.file = Some(path.to_owned());
        self.tell(format!("saved; epigraph render --camera fly:{}", path.display()));
        Ok(())
    }

    /// Plays the current path, or leaves it.
    pub fn toggle_playback(&mut self) {
        if self.is_playing() {
            self.engine.send(Command::Stop);
        } else if let Some(route) = self.route.clone() {
            self.play(route);
        }
    }

    /// The first field of a port as of the last frame. An empty name means the graph's first output.
    pub fn snapshot(&self, port: &str) -> Option<&Arc<Snapshot>> {
        let output = self.state.graph.as_ref()?.outputs.first().map(|(name, _)| name.as_str());
        let name = if port.is_empty() { output? } else { port };
        self.state.snapshots.iter().find(|snapshot| snapshot.name == name)
    }

    /// The command line that renders the picture of a port. An empty name means the graph's first output.
    ///
    /// # Errors
    /// The graph or the path must be saved first, or no frame has run yet.
    pub fn command_line(&self, port: &str) -> Result<CommandLine, String> {
        if self.document.unsaved().next().is_some() {
            return Err("save the graph first: the command line reads its file".into());
        }
        let state = &self.state;
        let (Some(camera), 1..) = (state.camera, state.frames) else {
            return Err("no frame has run yet".into());
        };
        let (camera, frames) = match &state.playing {
            Some(playing) => {
                let of_file = self.route.iter().find(|route| route.way == playing.way);
                let route =
                    of_file.cloned().unwrap_or(Route { way: playing.way.clone(), file: None, frames: None });
                let argument = route.argument();
                (argument.ok_or("save the path first: the command line reads its file")?, playing.frame)
            }
            None => (CommandLine::still(&camera, state.home), state.frames.min(SETTLED)),
        };
        Ok(CommandLine {
            graph: self.document.path().into(),
            scene: state.scene.clone(),
            camera,
            size: state.graph.as_ref().map_or(self.frame_size(), |graph| graph.size),
            samples: state.samples,
            seed: self.seed,
            backend: self.settings.backend,
            frames,
            port: port.into(),
        })
    }

    fn send_graph(&self) {
        // While the text is broken, the last good graph keeps running.
        if let (Some(file), true) = (self.document.file(), self.document.problems().is_empty()) {
            let shaders = self.document.shaders().map(|(path, text)| (path.into(), text.clone()));
            self.engine.send(Command::Shaders(Arc::new(shaders.collect())));
            self.engine.send(Command::Graph(file.clone()));
        }
    }

    /// The problems of the graph: of its text, else of its contents.
    pub fn problems(&self) -> &[Problem] {
        match self.document.problems() {
            [] => &self.state.problems,
            problems => problems,
        }
    }

    /// Makes one of core's edits; if it fails, a notice says why.
    pub fn edit(&mut self, tag: Tag, edit: impl FnOnce(&mut GraphFile) -> Result<(), Problems>) {
        self.notice = self.document.edit(tag, edit).err().map(|problems| problems.to_string());
    }

    /// Makes one of core's edits and moves boxes of the canvas, as one step of undo. Returns true if it succeeded.
    pub fn edit_placed(
        &mut self,
        edit: impl FnOnce(&mut GraphFile, &mut Places) -> Result<(), Problems>,
    ) -> bool {
        self.notice = self.document.edit_placed(Tag::Once, edit).err().map(|problems| problems.to_string());
        self.notice.is_none()
    }

    /// Saves; a notice reports the outcome.
    pub fn save(&mut self) {
        self.notice = Some(match self.document.save() {
            Ok(()) => "saved".into(),
            Err(problems) => problems.to_string(),
        });
    }

    /// Reloads files that other programs have changed.
    pub fn refresh(&mut self) {
        if self.document.refresh() {
            self.notice = Some("reloaded: another program has changed the file".into());
        }
        self.beside.refresh();
    }

    /// Moves the camera.
    pub fn move_camera(&mut self, change: impl FnOnce(&mut Rig)) {
        if let Some(rig) = &mut self.rig {
            let before = rig.camera;
            change(rig);
            if rig.camera != before {
                self.engine.send(Command::Camera(rig.camera));
            }
        }
    }
}
