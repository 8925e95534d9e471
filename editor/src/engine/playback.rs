//! Camera paths played frame by frame: the same frames each time.

use std::{
    fmt,
    path::Path,
    sync::{Arc, Mutex},
};

use epigraph_core::Snapshot;
use epigraph_scenes::{CameraPath, PathError, Scene};

/// A camera path as a text.
#[derive(Clone, Debug, PartialEq)]
pub enum Way {
    /// An argument of the command line's `--camera`, such as `orbit:2` or `fly:FILE.ron`.
    Named(String),
    /// The contents of a file of keyframes.
    Keys(Arc<str>),
}

impl Way {
    /// The path through a scene.
    ///
    /// # Errors
    /// The text is not a path, or its file cannot be read.
    pub fn path(&self, scene: &Scene) -> Result<CameraPath, PathError> {
        match self {
            Self::Named(text) => CameraPath::parse(text, scene),
            Self::Keys(text) => CameraPath::through(text, Path::new("recorded path"), scene),
        }
    }
}

/// Receives the frames of a playback, one after the other, on the engine's thread, which waits for it.
pub trait Sink: Send {
    /// Receives the contents of the watched ports and the outputs after frame `index`.
    ///
    /// # Errors
    /// The frame could not be recorded; the playback then stops.
    fn take(&mut self, index: u32, snapshots: &[Arc<Snapshot>]) -> Result<(), String>;

    /// Ends the recording after the last frame. Returns the outcome, as text for the user. A sink that is dropped
    /// without this was cancelled.
    ///
    /// # Errors
    /// The frames could not be recorded.
    fn finish(&mut self) -> Result<String, String>;
}

/// A path to play.
#[derive(Clone)]
pub struct Playback {
    /// The path.
    pub way: Way,
    /// Number of frames; `None`: until the path stops or repeats, or [`Playback::ENDLESS`] if it never does.
    pub frames: Option<u32>,
    /// The receiver of the frames. With one, frames run as fast as possible; without one, at the path's frame rate.
    pub sink: Option<Arc<Mutex<dyn Sink>>>,
}

impl Playback {
    /// Number of frames for a path that neither ends nor repeats: ten seconds of its time.
    pub const ENDLESS: u32 = 300;
}

impl fmt::Debug for Playback {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Playback")
            .field("way", &self.way)
            .field("frames", &self.frames)
            .finish_non_exhaustive()
    }
}

/// The progress of a playback.
#[derive(Clone, Debug, PartialEq)]
pub struct Playing {
    /// The path.
    pub way: Way,
    /// Number of frames shown.
    pub frame: u32,
    /// Number of frames in all.
    pub frames: u32,
    /// True if they are recorded.
    pub recorded: bool,
}

impl Playing {
    /// True if frames remain.
    pub fn is_under_way(&self) -> bool {
        self.frame < self.frames
    }
}
