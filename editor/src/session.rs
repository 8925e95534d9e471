//! What all panes share: the document, the engine, the camera, what is selected.

use std::{path::Path, sync::Arc};

use egui::ThemePreference;
use epigraph_core::{GraphFile, MAX_SIDE, Problem, Problems, Registry, Snapshot};
use epigraph_scenes::Camera;

use crate::{
    beside::Beside,
    camera::Rig,
    dialog::Ask,
    document::{Document, Places, Tag},
    engine::{Backend, Command, Engine, Options, Pacing, Playback, Playing, State},
    inspect::Picked,
    jobs::Jobs,
    output::CommandLine,
    pulse::Pulse,
    route::{Recorder, Route},
    store::Seen,
};

/// Frames of a still view on a command line, at most: more change little of the picture.
const SETTLED: u32 = 300;

/// Shares of the set size in which frames may be computed.
pub const SCALES: std::ops::RangeInclusive<f32> = 0.25..=2.0;

/// A place in a text that a pane should show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Jump {
    /// The file.
    pub path: String,
    /// Line and column, from 1.
    pub at: (usize, usize),
}

/// An open graph that runs.
pub struct Session {
    /// The graph's text.
    pub document: Document,
    /// What runs it.
    pub engine: Engine,
    /// What the engine said last, taken once for each frame of the window.
    pub state: Arc<State>,
    /// All stage kinds.
    pub registry: Registry,
    /// The camera, once the scene is there.
    pub rig: Option<Rig>,
    /// The address of the selected node.
    pub selected: Option<String>,
    /// A port that the user wants to see; the viewer in use takes it.
    pub wanted: Option<String>,
    /// Which viewer is in use, by [`crate::panes::Viewer::id`].
    pub viewer: u64,
    /// The port that it shows; empty for the output.
    pub viewed: String,
    /// Ports that the number keys 1 to 9 recall.
    pub slots: [Option<String>; 9],
    /// The pixel that the user has picked.
    pub inspection: Picked,
    /// The graph that views are compared with.
    pub beside: Beside,
    /// Ports that panes want snapshots of beside those in view; they ask anew in each frame of the window.
    pub asides: Vec<String>,
    /// A place that the user wants to see; the text pane takes it.
    pub jump: Option<Jump>,
    /// What became of the last action.
    pub notice: Option<String>,
    /// The scene that was asked for, by its name or file.
    pub scene: String,
    /// Samples a frame may ask for, percent of its pixels.
    pub samples: f32,
    /// Width and height of the frame at a scale of 1, pixels.
    pub size: [u32; 2],
    /// The resolution's scale, of [`SCALES`].
    pub scale: f32,
    /// The run's seed.
    pub seed: u32,
    /// Where nodes run that do not say.
    pub backend: Backend,
    /// When samples arrive.
    pub pacing: Pacing,
    /// Whether times are measured; see [`Options::measured`].
    pub measured: bool,
    /// The path that is being recorded.
    pub recorder: Option<Recorder>,
    /// The path at hand.
    pub route: Option<Route>,
    /// A dialog that the user wants; the window shows it.
    pub ask: Option<Ask>,
    /// A port to take beside those in view: the one that a dialog is about.
    pub extra: String,
    /// Work beside this thread.
    pub jobs: Jobs,
    /// How often the window is drawn.
    pub pulse: Pulse,
    /// Light, dark, or as the system has it.
    pub theme: ThemePreference,
    /// Whether the help is open.
    pub help: bool,
    /// The panes are to be put back as they stood at first.
    pub reset_layout: bool,
    /// Where to look once the scene of that name is there.
    pub look: Option<Seen>,
    /// The window's time, seconds.
    now: f64,
    sent: u64,
    watched: Vec<String>,
    /// The scene that the camera is in.
    within: String,
}

impl Session {
    /// Runs a document. `wake` is called from the engine's thread when there is something new to show.
    pub fn new(
        mut document: Document,
        options: Options,
        wake: impl Fn() + Clone + Send + Sync + 'static,
    ) -> Self {
        let Options { size, backend, pacing, seed, measured, .. } = options;
        let (samples, scene) = (options.samples * 100.0, options.scene.clone());
        let jobs = Jobs::new(wake.clone());
        let engine = Engine::start(options, wake);
        let session = Self {
            state: engine.state(),
            sent: document.revision(),
            engine,
            registry: epigraph_stages::registry(),
            rig: None,
            selected: None,
            wanted: None,
            viewer: 0,
            viewed: String::new(),
            slots: Default::default(),
            inspection: Picked::default(),
            beside: Beside::default(),
            asides: Vec::new(),
            jump: None,
            notice: document.take_notice(),
            scene,
            samples,
            size,
            scale: 1.0,
            seed,
            backend,
            pacing,
            measured,
            recorder: None,
            route: None,
            ask: None,
            extra: String::new(),
            jobs,
            pulse: Pulse::default(),
            theme: ThemePreference::default(),
            help: false,
            reset_layout: false,
            look: None,
            now: 0.0,
            watched: Vec::new(),
            within: String::new(),
            document,
        };
        session.send_graph();
        session
    }

    /// Takes the engine's news and hands over the document's; once for each frame of the window, at `now` seconds of its
    /// time.
    pub fn sync(&mut self, mut watched: Vec<String>, now: f64) {
        self.now = now;
        let before = std::mem::replace(&mut self.state, self.engine.state());
        if let Some(recorded) = self.state.recorded.clone().filter(|_| before.recorded != self.state.recorded)
        {
            self.tell(recorded);
        }
        if let Some(outcome) = self.jobs.news() {
            self.tell(outcome);
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
        if let Some(other) = self.beside.news(&self.document) {
            self.engine.send(Command::Other(other));
        }
        if !self.extra.is_empty() {
            watched.push(self.extra.clone());
        }
        watched.append(&mut self.asides);
        watched.sort();
        watched.dedup();
        if watched != self.watched {
            self.watched = watched;
            self.engine.send(Command::Watch(self.watched.clone()));
        }
    }

    /// The camera in the hand goes where the scene and the path under way lead it.
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

    fn tell(&mut self, outcome: Result<String, String>) {
        self.notice = Some(outcome.unwrap_or_else(|error| error));
    }

    /// Goes on with another graph.
    pub fn open(&mut self, document: Document) {
        self.document = document;
        self.selected = None;
        self.slots = Default::default();
        self.notice = None;
        self.sent = self.document.revision();
        self.send_graph();
        self.engine.send(Command::Reset);
        self.wanted = Some(String::new());
    }

    /// Goes on with another scene, once it is read.
    pub fn open_scene(&mut self, scene: String) {
        self.recorder = None;
        self.route = None;
        self.scene.clone_from(&scene);
        self.engine.send(Command::Scene(scene));
    }

    /// The scene's name, or its file's without folder and ending.
    pub fn scene_stem(&self) -> String {
        Path::new(&self.scene).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Width and height of the frame, pixels.
    pub fn frame_size(&self) -> [u32; 2] {
        self.size.map(|side| ((side as f32 * self.scale).round() as u32).clamp(1, MAX_SIDE))
    }

    /// Tells the engine of a changed size or scale.
    pub fn resize(&self) {
        self.engine.send(Command::Size(self.frame_size()));
    }

    /// Begins to record the camera's path, or ends that and has it at hand.
    pub fn toggle_recorder(&mut self) {
        match (self.recorder.take(), &self.rig) {
            (Some(mut recorder), rig) => {
                if let Some(rig) = rig {
                    recorder.note(self.now, rig.camera);
                }
                self.notice =
                    Some(format!("a path of {:.1} s is at hand: play it, or save it", recorder.seconds()));
                self.route = Some(recorder.finish());
            }
            (None, Some(rig)) => {
                self.notice = None;
                self.recorder = Some(Recorder::new(self.now, rig.camera));
            }
            (None, None) => {}
        }
    }

    /// Whether frames of a path are to come.
    pub fn is_playing(&self) -> bool {
        self.state.playing.as_ref().is_some_and(Playing::is_under_way)
    }

    /// How many frames the path at hand has, as far as that is known; else two seconds' worth.
    pub fn route_frames(&self) -> u32 {
        self.route.as_ref().and_then(|route| route.frames).unwrap_or(60)
    }

    /// Plays the path at hand from its beginning.
    pub fn play(&mut self) {
        if let Some(route) = &self.route {
            self.recorder = None;
            self.notice = None;
            self.engine.send(Command::Play(Playback { way: route.way.clone(), frames: None, sink: None }));
        }
    }

    /// Plays the path at hand, or leaves it.
    pub fn toggle_playback(&mut self) {
        if self.is_playing() {
            self.engine.send(Command::Stop);
        } else {
            self.play();
        }
    }

    /// The first field of a port as of the last frame; of the graph's first output where it is empty.
    pub fn snapshot(&self, port: &str) -> Option<&Arc<Snapshot>> {
        let output = self.state.graph.as_ref()?.outputs.first().map(|(name, _)| name.as_str());
        let name = if port.is_empty() { output? } else { port };
        self.state.snapshots.iter().find(|snapshot| snapshot.name == name)
    }

    /// The command line that makes the picture in view.
    ///
    /// # Errors
    /// What has to be saved first, or that there is no picture yet.
    pub fn command_line(&self) -> Result<CommandLine, String> {
        if self.document.unsaved().next().is_some() {
            return Err("save the graph first: the command line reads its file".into());
        }
        let state = &self.state;
        let (Some(camera), 1..) = (state.camera, state.frames) else {
            return Err("there is no frame yet".into());
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
            backend: self.backend,
            frames,
            port: self.viewed.clone(),
        })
    }

    /// Puts the command line on the clipboard, or says why there is none.
    pub fn copy_command_line(&mut self, context: &egui::Context) {
        self.notice = Some(match self.command_line() {
            Ok(line) => {
                context.copy_text(line.to_string());
                "the command line is on the clipboard".into()
            }
            Err(error) => error,
        });
    }

    fn send_graph(&self) {
        // While the text is broken the last good graph runs on.
        if let (Some(file), true) = (self.document.file(), self.document.problems().is_empty()) {
            let shaders = self.document.shaders().map(|(path, text)| (path.into(), text.clone()));
            self.engine.send(Command::Shaders(Arc::new(shaders.collect())));
            self.engine.send(Command::Graph(file.clone()));
        }
    }

    /// What is wrong with the graph: with its text, else with what it says.
    pub fn problems(&self) -> &[Problem] {
        match self.document.problems() {
            [] => &self.state.problems,
            problems => problems,
        }
    }

    /// Makes one of core's edits; where it fails, the notice says why.
    pub fn edit(&mut self, tag: Tag, edit: impl FnOnce(&mut GraphFile) -> Result<(), Problems>) {
        self.notice = self.document.edit(tag, edit).err().map(|problems| problems.to_string());
    }

    /// The same, with places of the canvas that change in the same step.
    pub fn edit_placed(
        &mut self,
        edit: impl FnOnce(&mut GraphFile, &mut Places) -> Result<(), Problems>,
    ) -> bool {
        self.notice = self.document.edit_placed(Tag::Once, edit).err().map(|problems| problems.to_string());
        self.notice.is_none()
    }

    /// Saves; the notice says what became of it.
    pub fn save(&mut self) {
        self.notice = Some(match self.document.save() {
            Ok(()) => "saved".into(),
            Err(problems) => problems.to_string(),
        });
    }

    /// Puts the port in view on a number key.
    pub fn assign(&mut self, slot: usize) {
        let shown = if self.viewed.is_empty() { "the output" } else { &self.viewed };
        self.notice = Some(format!("key {} now shows {shown}", slot + 1));
        self.slots[slot] = Some(self.viewed.clone());
    }

    /// Shows the port on a number key.
    pub fn recall(&mut self, slot: usize) {
        match &self.slots[slot] {
            Some(port) => self.wanted = Some(port.clone()),
            None => {
                let key = slot + 1;
                self.notice =
                    Some(format!("nothing is on key {key} yet; Ctrl+{key} puts the port in view there"));
            }
        }
    }

    /// Takes over what other programs have written to the files since.
    pub fn refresh(&mut self) {
        if self.document.refresh() {
            self.notice = Some("read again, as another program has changed it".into());
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
