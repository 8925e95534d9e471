//! What all panes share: the document, the engine, the camera, what is selected.

use std::sync::Arc;

use epigraph_core::{GraphFile, Problem, Problems, Registry};

use crate::{
    camera::Rig,
    document::{Document, Tag},
    engine::{Backend, Command, Engine, Options, Pacing, State},
};

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
    /// A place that the user wants to see; the text pane takes it.
    pub jump: Option<Jump>,
    /// What became of the last action.
    pub notice: Option<String>,
    /// Samples a frame may ask for, percent of its pixels.
    pub samples: f32,
    /// Width and height of the frame, pixels.
    pub size: [u32; 2],
    /// Where nodes run that do not say.
    pub backend: Backend,
    /// When samples arrive.
    pub pacing: Pacing,
    sent: u64,
    watched: Vec<String>,
}

impl Session {
    /// Runs a document. `wake` is called from the engine's thread when there is something new to show.
    pub fn new(document: Document, options: Options, wake: impl Fn() + Send + 'static) -> Self {
        let (samples, size) = (options.samples * 100.0, options.size);
        let (backend, pacing) = (options.backend, options.pacing);
        let engine = Engine::start(options, wake);
        let session = Self {
            state: engine.state(),
            sent: document.revision(),
            document,
            engine,
            registry: epigraph_stages::registry(),
            rig: None,
            selected: None,
            wanted: None,
            viewer: 0,
            viewed: String::new(),
            slots: Default::default(),
            jump: None,
            notice: None,
            samples,
            size,
            backend,
            pacing,
            watched: Vec::new(),
        };
        session.send_graph();
        session
    }

    /// Takes the engine's news and hands over the document's; once for each frame of the window.
    pub fn sync(&mut self, watched: Vec<String>) {
        self.state = self.engine.state();
        if let (None, Some(home)) = (self.rig, self.state.home) {
            self.rig = Some(Rig::new(home, self.state.bounds));
        }
        if self.document.revision() != self.sent {
            self.sent = self.document.revision();
            self.notice = None;
            self.send_graph();
        }
        if watched != self.watched {
            self.watched = watched;
            self.engine.send(Command::Watch(self.watched.clone()));
        }
    }

    fn send_graph(&self) {
        // While the text is broken the last good graph runs on.
        if let (Some(file), true) = (self.document.file(), self.document.problems().is_empty()) {
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
