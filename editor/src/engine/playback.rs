//! Camera paths that are run frame by frame: the same frames each time.

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
    /// As the command line's `--camera` takes it, such as `orbit:2` or `fly:FILE.ron`.
    Named(String),
    /// What stands in a file of keyframes.
    Keys(Arc<str>),
}

impl Way {
    /// The path through a scene.
    ///
    /// # Errors
    /// That the text makes no path, or that its file cannot be read.
    pub fn path(&self, scene: &Scene) -> Result<CameraPath, PathError> {
        match self {
            Self::Named(text) => CameraPath::parse(text, scene),
            Self::Keys(text) => CameraPath::through(text, Path::new("recorded path"), scene),
        }
    }
}

/// Takes the frames of a playback, one after the other, on the engine's thread, which waits for it.
pub trait Sink: Send {
    /// Takes what the watched ports and the outputs hold after frame `index`.
    ///
    /// # Errors
    /// That it could not be kept; the playback then stops.
    fn take(&mut self, index: u32, snapshots: &[Arc<Snapshot>]) -> Result<(), String>;

    /// The last frame has been taken. What became of them, for people to read. A sink that is dropped without this was
    /// cancelled.
    ///
    /// # Errors
    /// That they could not be kept.
    fn finish(&mut self) -> Result<String, String>;
}

/// What to run.
#[derive(Clone)]
pub struct Playback {
    /// Along which path.
    pub way: Way,
    /// How many frames; none: until the path stands still or begins anew, or [`Playback::ENDLESS`] where it never does.
    pub frames: Option<u32>,
    /// Who takes the frames; then they run as fast as they can, else at the path's pace.
    pub sink: Option<Arc<Mutex<dyn Sink>>>,
}

impl Playback {
    /// Frames of a path that neither ends nor repeats itself: ten seconds of its time.
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

/// How far a playback is.
#[derive(Clone, Debug, PartialEq)]
pub struct Playing {
    /// Along which path.
    pub way: Way,
    /// Frames shown.
    pub frame: u32,
    /// Of so many.
    pub frames: u32,
    /// Whether they are recorded.
    pub recorded: bool,
}

impl Playing {
    /// Whether there are frames to come.
    pub fn is_under_way(&self) -> bool {
        self.frame < self.frames
    }
}
