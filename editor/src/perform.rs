//! Opening of dialogs, and their actions.

use std::{fs, path::Path};

use epigraph_pictures::{Look, PortFile};

use crate::{
    app::App,
    dialog::{Dialog, Known},
    document::{Document, write},
    files::{self, PATH_ENDING, find_graph},
    intent::Ask,
    output,
    route::Route,
};

impl App {
    /// Opens a dialog.
    pub(crate) fn ask(&mut self, ask: Ask) {
        let session = &self.session;
        let (path, port) = (session.document.path(), self.port_in_view());
        let graph = Path::new(path);
        let stem = || graph.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let (text, choices) = match ask {
            Ask::NewGraph => ("new.ron".into(), files::graphs(graph)),
            Ask::NewChange => ("change.ron".into(), files::graphs(graph)),
            Ask::OpenGraph => (path.into(), files::graphs(graph)),
            Ask::OpenScene => (session.scene().into(), files::scenes()),
            Ask::OpenPath => {
                let paths = files::paths();
                (paths.first().map_or(String::new(), |choice| choice.text.clone()), paths)
            }
            Ask::SaveGraph => (path.into(), Vec::new()),
            Ask::FullGraph => (format!("{}-full.ron", graph.with_extension("").display()), Vec::new()),
            Ask::SavePath => (format!("{}{PATH_ENDING}", session.scene_stem()), Vec::new()),
            Ask::SaveImage if !port.is_empty() => {
                (format!("{}.png", port.replace(['/', '.'], "-")), Vec::new())
            }
            Ask::SaveImage | Ask::RecordFrames => (format!("{}.png", stem()), Vec::new()),
        };
        let mut dialog = Dialog::new(ask, text, choices);
        if ask == Ask::SaveImage {
            dialog.source = port.into();
        }
        dialog.frames = session.route_frames();
        self.dialog = Some(dialog);
    }

    /// The current state that a dialog shows.
    pub(crate) fn known(&self, dialog: &Dialog) -> Known {
        let session = &self.session;
        Known {
            images: session.state.graph.as_ref().map_or(Vec::new(), |graph| graph.images()),
            has_values: session.snapshot(&dialog.source).is_some(),
            path: session.route().map_or(String::new(), Route::label),
        }
    }

    /// Carries out a dialog's action. A notice may report more afterwards; long work continues on another thread.
    ///
    /// # Errors
    /// Why the action failed; the dialog shows it and stays open.
    pub(crate) fn perform(&mut self, dialog: &Dialog) -> Result<(), String> {
        let session = &mut self.session;
        let name = dialog.text.trim();
        let path = Path::new(name);
        let words = |problems: epigraph_core::Problems| problems.to_string();
        match dialog.ask {
            Ask::NewGraph => self.go_on(Document::copy(Path::new(&dialog.source), path).map_err(words)?),
            Ask::NewChange => {
                self.go_on(Document::new_change(Path::new(&dialog.source), path).map_err(words)?)
            }
            Ask::OpenGraph => self.go_on(Document::open(&find_graph(name)).map_err(words)?),
            Ask::OpenScene => session.open_scene(name.into()),
            Ask::OpenPath => {
                // Playing reports errors in the path; a missing file is reported here.
                fs::metadata(path).map_err(|error| format!("{name}: {error}"))?;
                session.play(Route::of_file(path));
            }
            Ask::SaveGraph => {
                session.document.save_as(path).map_err(words)?;
                session.tell("saved");
            }
            Ask::FullGraph => {
                let text = session.document.full(path, &session.registry).map_err(words)?;
                write(path, &text).map_err(words)?;
                session.tell(format!("wrote the whole graph to {}", path.display()));
            }
            Ask::SavePath => session.save_route(path)?,
            Ask::SaveImage => self.save_image(&dialog.source, path)?,
            Ask::RecordFrames => {
                let port = self.session.snapshot(self.port_in_view());
                let name = port.map_or(String::new(), |snapshot| snapshot.name.clone());
                let sink = output::sink(dialog.format, path, dialog.frames, name, self.look_in_view())?;
                self.session.record(dialog.frames, sink)?;
            }
        }
        Ok(())
    }

    /// The look of the viewer in use.
    fn look_in_view(&self) -> Look {
        self.viewer_in_use().map(|viewer| viewer.look).unwrap_or_default()
    }

    /// Saves a port as the viewer in use shows it, or with the port's default look if that viewer shows another port.
    fn save_image(&mut self, port: &str, path: &Path) -> Result<(), String> {
        let session = &self.session;
        let snapshot = session.snapshot(port).cloned().ok_or("the port has not been captured yet")?;
        let look = if port == self.port_in_view() { self.look_in_view() } else { Look::default() };
        let file = PortFile::picture(path).map_err(|error| error.to_string())?;
        session.start(move || {
            file.write(&[&snapshot], &look).map_err(|error| error.to_string())?;
            Ok(format!("wrote {}", file.path().display()))
        });
        Ok(())
    }
}
