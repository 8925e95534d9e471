//! The frames of a path as files: an animated PNG, or a PNG per frame.

use std::{
    fs::File,
    io::BufWriter,
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use epigraph_core::Snapshot;
use epigraph_files::{Draft, Target};
use epigraph_pictures::{Look, Shown, png as still, show};
use epigraph_scenes::FRAMES_PER_SECOND;
use png::{BitDepth, ColorType, Encoder, Writer};

use crate::engine::Sink;

/// The format of recorded frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// One animated PNG.
    Animation,
    /// A PNG per frame.
    Numbered,
}

/// Records the port `name` of `frames` frames under `path`, shown with the given look.
///
/// # Errors
/// The file cannot be written.
pub fn sink(
    format: Format,
    path: &Path,
    frames: u32,
    name: String,
    look: Look,
) -> Result<Arc<Mutex<dyn Sink>>, String> {
    let (port, target) =
        (Port { name, look }, |path: &Path| Target::new(path).map_err(|error| error.to_string()));
    Ok(match format {
        Format::Animation => {
            Arc::new(Mutex::new(Animation { port, target: target(path)?, frames, writing: None }))
        }
        Format::Numbered => {
            target(&frame_path(path, 0))?;
            Arc::new(Mutex::new(Numbered { port, path: path.to_owned(), written: 0 }))
        }
    })
}

/// The recorded port.
struct Port {
    /// Its name among the snapshots.
    name: String,
    look: Look,
}

impl Port {
    fn picture(&self, snapshots: &[Arc<Snapshot>]) -> Result<Shown, String> {
        let found = snapshots.iter().find(|snapshot| snapshot.name == self.name);
        let snapshot =
            found.ok_or_else(|| format!("{} does not run, so it cannot be recorded", self.name))?;
        Ok(show(snapshot, &self.look))
    }
}

/// A PNG per frame.
struct Numbered {
    port: Port,
    path: PathBuf,
    written: u32,
}

/// `NAME-0000.png` for `NAME.png` and frame 0.
fn frame_path(path: &Path, index: u32) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{index:04}.png"))
}

impl Sink for Numbered {
    fn take(&mut self, index: u32, snapshots: &[Arc<Snapshot>]) -> Result<(), String> {
        let picture = self.port.picture(snapshots)?;
        let bytes = still(picture.size, &picture.colors)?;
        let target = Target::new(&frame_path(&self.path, index)).map_err(|error| error.to_string())?;
        target.write(&bytes).map_err(|error| error.to_string())?;
        self.written += 1;
        Ok(())
    }

    fn finish(&mut self) -> Result<String, String> {
        let last = self.written.saturating_sub(1);
        Ok(format!("wrote {} to {last:04}", frame_path(&self.path, 0).display()))
    }
}

/// A looping animated PNG at the path's frame rate. Unless it is the only frame, frame 0 is left out: it is empty, as
/// no sample has arrived yet, and programs that do not support animation would show it.
struct Animation {
    port: Port,
    target: Target,
    /// Number of frames of the path.
    frames: u32,
    writing: Option<Writing>,
}

/// The unfinished file. Dropping it, as when the user cancels, leaves no file.
struct Writing {
    encoder: Writer<BufWriter<File>>,
    draft: Draft,
}

impl Animation {
    /// The first frame in the file.
    fn first(&self) -> u32 {
        u32::from(self.frames > 1)
    }

    fn open(&self, [width, height]: [usize; 2]) -> Result<Writing, String> {
        let draft = self.target.begin().map_err(|error| error.to_string())?;
        let file = BufWriter::new(draft.writer().map_err(|error| error.to_string())?);
        let mut encoder = Encoder::new(file, width as u32, height as u32);
        encoder.set_color(ColorType::Rgb);
        encoder.set_depth(BitDepth::Eight);
        let made = encoder
            .set_animated(self.frames - self.first(), 0)
            .and_then(|()| encoder.set_frame_delay(1, FRAMES_PER_SECOND as u16))
            .and_then(|()| encoder.write_header());
        Ok(Writing { encoder: made.map_err(|error| error.to_string())?, draft })
    }
}

impl Sink for Animation {
    fn take(&mut self, index: u32, snapshots: &[Arc<Snapshot>]) -> Result<(), String> {
        if index < self.first() {
            return Ok(());
        }
        let picture = self.port.picture(snapshots)?;
        if self.writing.is_none() {
            self.writing = Some(self.open(picture.size)?);
        }
        let Some(writing) = &mut self.writing else { return Ok(()) };
        // The encoder rejects frames of another size.
        writing.encoder.write_image_data(picture.colors.as_flattened()).map_err(|error| error.to_string())
    }

    fn finish(&mut self) -> Result<String, String> {
        let Writing { encoder, draft } = self.writing.take().ok_or("there was no frame")?;
        encoder.finish().map_err(|error| error.to_string())?;
        draft.commit().map_err(|error| error.to_string())?;
        Ok(format!("wrote {}, {} frames", self.target.path().display(), self.frames - self.first()))
    }
}
