//! Playing camera paths frame by frame, and passing the frames to a sink that records them.

use std::sync::{Arc, Mutex, PoisonError};

use epigraph_scenes::CameraPath;

use super::{Rebuild, Worker};
use crate::engine::{Playback, Playing, Sink};

/// A playback under way.
pub(super) struct Path {
    pub path: CameraPath,
    pub frames: u32,
    pub sink: Option<Arc<Mutex<dyn Sink>>>,
}

impl Worker {
    pub(super) fn play(&mut self, Playback { way, frames, sink }: Playback) -> Rebuild {
        self.leave_path();
        let path = match way.path(&self.place.scene) {
            Ok(path) => path,
            Err(error) => {
                self.state.trouble = Some(error.to_string());
                return Rebuild::No;
            }
        };
        let frames = frames.or(path.frames()).unwrap_or(Playback::ENDLESS);
        self.state.recorded = None;
        self.state.playing = Some(Playing { way, frame: 0, frames, recorded: sink.is_some() });
        self.path = Some(Path { path, frames, sink });
        self.pause(false);
        Rebuild::Afresh
    }

    /// Ends the playback under way, if any. The camera stays where it is.
    pub(super) fn leave_path(&mut self) {
        if self.path.take().is_some() {
            if let Some(playing) = &mut self.state.playing {
                playing.frames = playing.frame;
            }
            self.camera = self.shown.unwrap_or(self.camera);
            self.renew_host();
        }
    }

    /// Passes the frame to the sink of the path under way, and leaves the path at its end.
    pub(super) fn advance(&mut self) {
        let Some(Path { frames, sink, .. }) = &self.path else { return };
        let taken = sink.as_ref().map(|sink| {
            // A sink that panicked has already stopped its playback.
            let mut sink = sink.lock().unwrap_or_else(PoisonError::into_inner);
            let taken = sink.take(self.index - 1, &self.state.snapshots);
            taken.and_then(|()| if self.index == *frames { sink.finish().map(Some) } else { Ok(None) })
        });
        if let Some(playing) = &mut self.state.playing {
            playing.frame = self.index;
        }
        let at_end = self.index == *frames;
        match taken {
            Some(Ok(Some(done))) => self.state.recorded = Some(Ok(done)),
            Some(Err(error)) => self.state.recorded = Some(Err(error)),
            Some(Ok(None)) | None if !at_end => return,
            _ => {}
        }
        self.leave_path();
        self.pause(true);
    }
}
