//! Which ports are captured in which frames: those in view in each, and all of them in a frame that is looked at long.

use super::{Path, Rebuild, Worker};
use crate::engine::{
    GraphInfo,
    running::{Running, Taps},
};

/// Bytes that copies of all ports may take for a pause alone: those of about two million pixels. Where they would be
/// larger, a port that was not watched takes one more frame to be seen.
const LARGEST: u64 = 1 << 30;

impl Worker {
    /// The taps that the graph should have now.
    pub(super) fn taps(&self) -> Taps {
        let all = match self.inspected {
            Some(_) => u64::MAX,
            None if self.options.paused || self.is_last_of_path() => LARGEST,
            None => 0,
        };
        Taps { watched: self.watched.clone(), all }
    }

    /// Sees to it that the graph has these taps before it runs again.
    pub(super) fn follow_taps(&mut self) {
        let taps = self.taps();
        let serves = |running: &Running| {
            let has_all = || taps.watched.iter().all(|name| has(running, name));
            running.taps == taps || running.is_open && taps.all > 0 && has_all()
        };
        // One that has failed would only fail again.
        if self.has_work() && !self.running.as_ref().is_some_and(serves) {
            self.rebuild = self.rebuild.max(Rebuild::Taps);
        }
    }

    /// Watches these ports from now on.
    pub(super) fn watch(&mut self, watched: Vec<String>) {
        self.watched = watched;
        if !self.options.paused || self.index == 0 {
            return;
        }
        if let (Some(capture), Some(running)) = (&self.capture, &self.running) {
            let is_watched = |name: &str| is_watched(&running.info, &self.watched, name);
            let snapshots = capture.snapshots.iter().filter(|snapshot| is_watched(&snapshot.name));
            self.state.snapshots = snapshots.cloned().collect();
        } else if self.watched.iter().any(|name| self.is_unseen(name)) {
            // Memory of the last frame is in use again by other ports.
            self.owed = self.owed.max(1);
        }
    }

    /// Whether all ports are captured in the coming frame.
    pub(super) fn captures(&self) -> bool {
        let wanted = self.inspected.as_ref().is_some_and(|inspected| inspected.wanted);
        let last = self.options.paused && self.owed <= 1 || self.is_last_of_path();
        self.running.as_ref().is_some_and(|running| running.is_open) && (wanted || last)
    }

    /// Whether a pause comes after the next frame, as the path is at its end then.
    fn is_last_of_path(&self) -> bool {
        self.path.as_ref().is_some_and(|path: &Path| self.index + 1 == path.frames)
    }

    /// Whether the graph has a port of that name, `node.port`, that the last frame was not asked for.
    fn is_unseen(&self, name: &str) -> bool {
        let there = self.running.as_ref().is_some_and(|running| has(running, name));
        there && self.state.fields(name).next().is_none()
    }
}

/// Whether a node of the graph has a port of that name, `node.port`.
fn has(running: &Running, name: &str) -> bool {
    let node = name.rsplit_once('.').and_then(|(node, port)| Some((running.info.node(node)?, port)));
    node.is_some_and(|(node, port)| node.ports.iter().any(|info| info.port.name == port))
}

/// Whether a snapshot of that name is of an output, or is watched.
pub(super) fn is_watched(graph: &GraphInfo, watched: &[String], name: &str) -> bool {
    watched.iter().any(|watched| watched == name) || graph.outputs.iter().any(|(output, _)| output == name)
}
