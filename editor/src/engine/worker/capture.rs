//! The choice of captured ports: the watched ones in every frame, and all ports in a frame shown during a pause.

use super::{Path, Rebuild, Worker};
use crate::engine::{
    GraphInfo,
    running::{Running, Taps},
};

/// Limit on the copies of all ports for a pause, bytes: enough for about two million pixels. Above it, a port that was
/// not watched takes one more frame to appear.
const LARGEST: u64 = 1 << 30;

impl Worker {
    /// The taps that the graph should have now.
    pub(super) fn taps(&self) -> Taps {
        let all = match self.inspected {
            Some(_) => u64::MAX,
            None if self.options.paused || self.options.guarded || self.is_last_of_path() => LARGEST,
            None => 0,
        };
        Taps { watched: self.watched.clone(), all }
    }

    /// Makes sure that the graph has these taps before it runs again.
    pub(super) fn follow_taps(&mut self) {
        let taps = self.taps();
        let serves = |running: &Running| {
            let has_all = || taps.watched.iter().all(|name| has(running, name));
            running.taps == taps || running.is_open && taps.all > 0 && has_all()
        };
        // A failed graph would only fail again.
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
            // Other ports have reused the memory of the last frame.
            self.owed = self.owed.max(1);
        }
    }

    /// True if all ports are captured in the coming frame.
    pub(super) fn captures(&self) -> bool {
        let wanted = self.inspected.as_ref().is_some_and(|inspected| inspected.wanted);
        // A pause may follow any guarded frame.
        let guarded = self.options.guarded;
        let last = guarded || self.options.paused && self.owed <= 1 || self.is_last_of_path();
        self.running.as_ref().is_some_and(|running| running.is_open) && (wanted || last)
    }

    /// True if a pause follows the next frame because it is the last one of the path.
    fn is_last_of_path(&self) -> bool {
        self.path.as_ref().is_some_and(|path: &Path| self.index + 1 == path.frames)
    }

    /// True if the graph has a port of that name, `node.port`, that the last frame did not capture.
    fn is_unseen(&self, name: &str) -> bool {
        let there = self.running.as_ref().is_some_and(|running| has(running, name));
        there && self.state.fields(name).next().is_none()
    }
}

/// True if a node of the graph has a port of that name, `node.port`.
fn has(running: &Running, name: &str) -> bool {
    let node = name.rsplit_once('.').and_then(|(node, port)| Some((running.info.node(node)?, port)));
    node.is_some_and(|(node, port)| node.ports.iter().any(|info| info.port.name == port))
}

/// True if a snapshot of that name is of an output or of a watched port.
pub(super) fn is_watched(graph: &GraphInfo, watched: &[String], name: &str) -> bool {
    watched.iter().any(|watched| watched == name) || graph.outputs.iter().any(|(output, _)| output == name)
}
