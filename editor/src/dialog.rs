//! The dialog that asks for a file or a name, to open or to save.

use std::path::Path;

use egui::{
    Button, ComboBox, DragValue, Frame, Id, Key, Label, Modal, RichText, ScrollArea, TextEdit, Ui, vec2,
};

use crate::{
    files::{self, Choice},
    intent::Ask,
    output::Format,
    theme,
};

/// Width of a dialog's contents, points.
const WIDTH: f32 = 540.0;

impl Ask {
    /// The title, the field's label, and the button.
    fn words(self) -> [&'static str; 3] {
        match self {
            Self::NewGraph => ["New graph", "Name of the new file", "Create"],
            Self::NewChange => {
                ["New change to a graph", "Name of the new file, which holds only what differs", "Create"]
            }
            Self::OpenGraph => ["Open graph", "File", "Open"],
            Self::OpenScene => ["Open scene", "Name, or a .glb, .gltf, .obj, .ply or .ron file", "Open"],
            Self::OpenPath => ["Open path", "File of keyframes", "Open"],
            Self::SaveGraph => ["Save graph as", "File", "Save"],
            Self::FullGraph => {
                ["Write out in full", "File for the whole graph, without base and parts", "Write"]
            }
            Self::SavePath => ["Save path", "File; the command line takes it as --camera fly:FILE", "Save"],
            Self::SaveImage => ["Save image", "File: .png as shown, .exr with raw values", "Save"],
            Self::RecordFrames => ["Record the path's frames", "File", "Record"],
        }
    }

    /// True if it writes the named file.
    fn writes(self) -> bool {
        matches!(
            self,
            Self::NewGraph
                | Self::NewChange
                | Self::SaveGraph
                | Self::FullGraph
                | Self::SavePath
                | Self::SaveImage
                | Self::RecordFrames
        )
    }
}

/// An open dialog.
pub struct Dialog {
    /// The purpose of the dialog.
    pub ask: Ask,
    /// The field's text.
    pub text: String,
    /// The graph to copy, or the port to save.
    pub source: String,
    /// How frames are recorded.
    pub format: Format,
    /// Number of frames.
    pub frames: u32,
    /// The files to pick from.
    choices: Vec<Choice>,
    error: Option<String>,
    /// An existing file, which a second click replaces.
    replaces: Option<String>,
    opened: bool,
}

/// The current state that dialogs show.
pub struct Known {
    /// Ports that are images, `node.port`.
    pub images: Vec<String>,
    /// True if the chosen port has values.
    pub has_values: bool,
    /// The label of the current path.
    pub path: String,
}

/// The user's answer to a dialog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Nothing yet.
    Open,
    /// Close it.
    Cancel,
    /// Carry out its action.
    Accept,
}

impl Dialog {
    /// Opens with `text` in the field; a click on one of the choices fills the field, or chooses the graph to copy.
    pub fn new(ask: Ask, text: String, choices: Vec<Choice>) -> Self {
        let source = match (ask, choices.first()) {
            (Ask::NewGraph | Ask::NewChange, Some(first)) => first.text.clone(),
            _ => String::new(),
        };
        Self {
            ask,
            text,
            source,
            format: Format::Animation,
            frames: 1,
            choices,
            error: None,
            replaces: None,
            opened: false,
        }
    }

    /// The port whose values it needs.
    pub fn watched(&self) -> Option<String> {
        (self.ask == Ask::SaveImage && !self.source.is_empty()).then(|| self.source.clone())
    }

    /// Shows why the action failed.
    pub fn fail(&mut self, error: String) {
        self.error = Some(error);
    }

    /// Shows it.
    pub fn show(&mut self, ui: &Ui, known: &Known) -> Answer {
        let [title, doc, accept] = self.ask.words();
        let mut answer = Answer::Open;
        let frame = Frame::popup(ui.style()).inner_margin(12.0);
        let modal = Modal::new(Id::new("dialog")).frame(frame).show(ui.ctx(), |ui| {
            ui.set_width(WIDTH);
            ui.heading(title);
            ui.add_space(6.0);
            self.choices(ui, &mut answer);
            self.more(ui, known);
            let label = ui.label(RichText::new(doc).weak());
            let field = ui.add(TextEdit::singleline(&mut self.text).desired_width(f32::INFINITY));
            let field = field.labelled_by(label.id);
            if !self.opened {
                self.opened = true;
                field.request_focus();
            }
            if field.changed() {
                (self.error, self.replaces) = (None, None);
            }
            if field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter)) {
                answer = Answer::Accept;
            }
            if let Some(error) = &self.error {
                ui.colored_label(theme::palette(ui).bad, error);
            }
            ui.add_space(6.0);
            ui.horizontal(|ui| {
                let word = if self.replaces.as_ref() == Some(&self.text) { "Replace" } else { accept };
                let ready = !self.text.trim().is_empty() && self.is_ready(known);
                if ui.add_enabled(ready, Button::new(word).min_size(vec2(80.0, 0.0))).clicked() {
                    answer = Answer::Accept;
                }
                if ui.add(Button::new("Cancel").min_size(vec2(80.0, 0.0))).clicked() {
                    answer = Answer::Cancel;
                }
            });
        });
        if answer == Answer::Open && modal.should_close() {
            answer = Answer::Cancel;
        }
        if answer == Answer::Accept && !(self.is_ready(known) && self.may_write()) {
            answer = Answer::Open;
        }
        answer
    }

    /// The list to pick from. A double click accepts the dialog if it only opens a file.
    fn choices(&mut self, ui: &mut Ui, answer: &mut Answer) {
        if self.choices.is_empty() {
            return;
        }
        let picked = if self.makes() { &mut self.source } else { &mut self.text };
        ScrollArea::vertical().max_height(300.0).auto_shrink([false, true]).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 2.0;
            for choice in &self.choices {
                let row = ui.horizontal(|ui| {
                    let name = files::short(&choice.text);
                    let button = ui.add(Button::selectable(*picked == choice.text, name));
                    ui.add(Label::new(RichText::new(&choice.doc).weak()).truncate());
                    button.on_hover_text(format!("{}\n{}", choice.text, choice.doc))
                });
                if row.inner.clicked() {
                    picked.clone_from(&choice.text);
                    (self.error, self.replaces) = (None, None);
                }
                if row.inner.double_clicked() && !self.ask.writes() {
                    *answer = Answer::Accept;
                }
            }
        });
        ui.add_space(4.0);
    }

    /// The settings of an image and of a recording besides the name.
    fn more(&mut self, ui: &mut Ui, known: &Known) {
        match self.ask {
            Ask::SaveImage => self.port(ui, known),
            Ask::RecordFrames => self.recording(ui, known),
            _ => {}
        }
    }

    fn port(&mut self, ui: &mut Ui, known: &Known) {
        let shown =
            |port: &str| if port.is_empty() { "the graph's output".to_owned() } else { port.to_owned() };
        ui.horizontal(|ui| {
            let label = ui.label("Port");
            let combo = ComboBox::from_id_salt("saved port").selected_text(shown(&self.source)).width(260.0);
            let combo = combo.show_ui(ui, |ui| {
                ui.selectable_value(&mut self.source, String::new(), shown(""));
                for name in &known.images {
                    ui.selectable_value(&mut self.source, name.clone(), name);
                }
            });
            combo.response.labelled_by(label.id);
        });
        if !known.has_values {
            ui.weak("This port is captured from the next frame on.");
        }
        ui.add_space(4.0);
    }

    fn recording(&mut self, ui: &mut Ui, known: &Known) {
        let path = &known.path;
        ui.label(format!("{path}, as shown in the active view, with all samples of each frame"));
        ui.horizontal(|ui| {
            let label = ui.label("Frames");
            ui.add(DragValue::new(&mut self.frames).range(1..=100_000)).labelled_by(label.id);
            ui.weak(format!("{:.1} s", self.frames as f32 / epigraph_scenes::FRAMES_PER_SECOND));
        });
        for (format, text) in [
            (Format::Animation, "One animated PNG"),
            (Format::Numbered, "A PNG for each frame: NAME-0000.png, NAME-0001.png, ..."),
        ] {
            ui.radio_value(&mut self.format, format, text);
        }
        ui.add_space(4.0);
    }

    /// Whether it makes a new graph from another one.
    fn makes(&self) -> bool {
        matches!(self.ask, Ask::NewGraph | Ask::NewChange)
    }

    fn is_ready(&self, known: &Known) -> bool {
        self.ask != Ask::SaveImage || known.has_values
    }

    /// An existing file is replaced only after a second confirmation.
    fn may_write(&mut self) -> bool {
        let numbered = self.ask == Ask::RecordFrames && self.format == Format::Numbered;
        let there = self.ask.writes() && !numbered && Path::new(&self.text).is_file();
        if !there || self.makes() || self.replaces.as_ref() == Some(&self.text) {
            return true;
        }
        self.replaces = Some(self.text.clone());
        self.error = Some("The file exists already.".into());
        false
    }
}
