//! The graph beside: a second graph that runs with the same views and sample budget, but its own cloud and tracer
//! queue.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, PoisonError},
    time::{Duration, Instant},
};

use epigraph::Pace;
use epigraph_core::{Frame, Host, RunError};

use super::{Rebuild, Worker, costs::own_ms, host, message};
use crate::engine::{
    self, OtherState,
    running::{Running, Taps},
};

/// The graph beside.
pub(super) struct Other {
    asked: engine::Other,
    /// The graph as last compiled.
    running: Option<Running>,
    host: Arc<Host>,
    pacing: Pace,
    /// True if it must be compiled again.
    stale: bool,
    /// True if it failed, so it does not run until something changes.
    failed: bool,
}

impl Worker {
    /// Runs this graph beside the current one from the next frame on; `None` ends that.
    pub(super) fn set_other(&mut self, asked: Option<engine::Other>) {
        let Some(asked) = asked else {
            (self.other, self.state.other) = (None, None);
            return;
        };
        if self.options.paused && self.index > 0 {
            // It has nothing to show until a frame has run.
            self.owed = self.owed.max(1);
        }
        match &mut self.other {
            Some(other) if other.asked.file.name() == asked.file.name() => {
                (other.asked, other.stale, other.failed) = (asked, true, false);
            }
            _ => {
                let pacing = self.pacing();
                self.state.other = Some(OtherState { path: asked.file.name(), ..OtherState::default() });
                let host = host(&self.place, pacing);
                self.other = Some(Other { asked, running: None, host, pacing, stale: true, failed: false });
            }
        }
    }

    /// Makes the graph beside be compiled again too, when the current graph is.
    pub(super) fn rebuild_other(&mut self, rebuild: Rebuild) {
        let (place, pacing) = (self.place.clone(), self.pacing());
        let Some(other) = self.other.as_mut().filter(|_| rebuild > Rebuild::Taps) else { return };
        (other.stale, other.failed) = (true, false);
        if rebuild == Rebuild::Afresh {
            (other.running, other.host, other.pacing) = (None, host(&place, pacing), pacing);
        }
    }

    /// Runs the frame in the graph beside.
    pub(super) fn run_other(&mut self, frame: &Frame) {
        let Some(mut other) = self.other.take_if(|other| !other.failed) else { return };
        let ran = catch_unwind(AssertUnwindSafe(|| self.try_other(&mut other, frame)));
        let ran =
            ran.unwrap_or_else(|panic| Err(format!("running it panicked: {}", message(panic.as_ref()))));
        other.failed = ran.is_err();
        if let Some(state) = &mut self.state.other {
            state.graph = other.running.as_ref().map(|running| running.info.clone());
            if let (Ok(took), Some(running), true) = (&ran, &other.running, self.options.measured) {
                state.frame_ms = own_ms(*took, &running.info, running.run.executor.times());
            }
            state.trouble = ran.err();
        }
        self.other = Some(other);
    }

    /// Runs a frame of the graph beside. Returns how long it took, or why it does not run.
    fn try_other(&mut self, other: &mut Other, frame: &Frame) -> Result<Duration, String> {
        if other.pacing != self.pacing() {
            other.pacing = self.pacing();
            other.host = host(&self.place, other.pacing);
        }
        if other.stale || other.running.is_none() {
            other.stale = false;
            *self.read.lock().unwrap_or_else(PoisonError::into_inner) = other.asked.shaders.clone();
            let taps = Taps { watched: other.asked.watched.clone(), all: 0 };
            let mut made = self.compile(&other.asked.file, taps).map_err(|problems| problems.to_string())?;
            if let Some(mut old) = other.running.take() {
                made.run.executor.inherit(&mut old.run.executor).map_err(|error| error.to_string())?;
            }
            other.running = Some(made);
        }
        let Some(running) = &mut other.running else { return Ok(Duration::ZERO) };
        let text = |error: RunError| error.to_string();
        let start = Instant::now();
        running.run.set_host(other.host.clone());
        running.run.run(frame, true).map_err(text)?;
        let took = start.elapsed();
        let snapshots = running.run.executor.snapshots().map_err(text)?;
        let snapshots = snapshots.into_iter().map(|snapshot| Arc::new(snapshot.clone())).collect();
        if let Some(state) = &mut self.state.other {
            state.snapshots = snapshots;
        }
        Ok(took)
    }
}
