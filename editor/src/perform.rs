//! What dialogs are for.

use std::{fs, path::Path};

use epigraph_pictures::{Look, PortFile};

use crate::{
    app::App,
    dialog::{Ask, Dialog},
    document::Document,
    engine::{Command, Playback, Way},
    files::find_graph,
    output,
    route::Route,
};

impl App {
    /// Does what a dialog is for. Afterwards a notice may tell more; what takes long goes on beside this thread.
    ///
    /// # Errors
    /// Why it could not be done; the dialog says so and stays.
    pub(crate) fn perform(&mut self, dialog: &Dialog) -> Result<(), String> {
        let session = &mut self.session;
        let name = dialog.text.trim();
        let path = Path::new(name);
        let words = |problems: epigraph_core::Problems| problems.to_string();
        match dialog.ask {
            Ask::NewGraph => self.go_on(Document::copy(Path::new(&dialog.source), path).map_err(words)?),
            Ask::OpenGraph => self.go_on(Document::open(&find_graph(name)).map_err(words)?),
            Ask::OpenScene => session.open_scene(name.into()),
            Ask::OpenPath => {
                // What is wrong with it shows when it is played; that there is none shows here.
                fs::metadata(path).map_err(|error| format!("{name}: {error}"))?;
                session.route = Some(Route::of_file(path));
                session.play();
            }
            Ask::SaveGraph => {
                session.document.save_as(path).map_err(words)?;
                session.notice = Some("saved".into());
            }
            Ask::SavePath => self.save_path(path)?,
            Ask::SaveImage => self.save_image(&dialog.source, path)?,
            Ask::RecordFrames => {
                let (name, look) = self.viewed();
                let sink = output::sink(dialog.format, path, dialog.frames, name, look)?;
                let session = &mut self.session;
                let route = session.route.as_ref().ok_or("there is no path")?;
                let playback =
                    Playback { way: route.way.clone(), frames: Some(dialog.frames), sink: Some(sink) };
                session.notice = None;
                session.engine.send(Command::Play(playback));
            }
        }
        Ok(())
    }

    /// The port of the viewer in use as snapshots call it, and how it is shown.
    fn viewed(&self) -> (String, Look) {
        let name = self.session.snapshot(&self.session.viewed).map(|snapshot| snapshot.name.clone());
        let viewer = self.viewers().find(|viewer| viewer.id == self.session.viewer);
        (name.unwrap_or_default(), viewer.map(|viewer| viewer.look).unwrap_or_default())
    }

    fn save_path(&mut self, path: &Path) -> Result<(), String> {
        let session = &mut self.session;
        let route = session.route.as_mut().ok_or("there is no path")?;
        let Way::Keys(text) = &route.way else {
            return Err(format!("{} needs no file: the command line knows it by that name", route.label()));
        };
        let target = epigraph_pictures::Target::new(path).map_err(|error| error.to_string())?;
        target.write(text.as_bytes()).map_err(|error| error.to_string())?;
        route.file = Some(path.to_owned());
        session.notice = Some(format!("saved; epigraph render --camera fly:{}", path.display()));
        Ok(())
    }

    /// Saves a port as it is shown in the viewer in use, or, where that shows another, as suits it.
    fn save_image(&mut self, port: &str, path: &Path) -> Result<(), String> {
        let session = &self.session;
        let snapshot = session.snapshot(port).cloned().ok_or("there is no frame of it yet")?;
        let look = if port == session.viewed { self.viewed().1 } else { Look::default() };
        let file = PortFile::picture(path).map_err(|error| error.to_string())?;
        session.jobs.start(move || {
            file.write(&[&snapshot], &look).map_err(|error| error.to_string())?;
            Ok(format!("wrote {}", file.path().display()))
        });
        Ok(())
    }
}
