//! Running a frame and handling its outcome.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
    time::Instant,
};

use epigraph_core::{Capture, Frame, RunError};
use epigraph_scenes::Camera;
use epigraph_stages::World;

use super::{Path, Rebuild, Worker, capture::is_watched, costs::step_costs, message, samples};

impl Worker {
    /// The camera and the description of the next frame.
    fn next_frame(&self, size: [u32; 2]) -> (Camera, Frame) {
        let samples = samples(self.options.samples).of(size);
        let (index, seed) = (self.index, self.options.seed);
        if let Some(Path { path, .. }) = &self.path {
            return (path.camera(index), World::frame_of(path, index, size, samples, seed));
        }
        let previous = self.shown.as_ref().unwrap_or(&self.camera);
        (self.camera, World::frame(previous, &self.camera, index, size, samples, seed))
    }

    pub(super) fn frame(&mut self) {
        let Some(running) = &self.running else { return };
        let start = Instant::now();
        let (camera, frame) = self.next_frame(running.info.size);
        let captures = self.captures();
        let Some(running) = &mut self.running else { return };
        let info = running.info.clone();
        let is_watched = |name: &str| is_watched(&info, &self.watched, name);
        let run = &mut running.run;
        if running.is_open {
            run.executor.want(|name| captures || is_watched(name));
        }
        let result = catch_unwind(AssertUnwindSafe(|| {
            let bad = match run.run(&frame, true) {
                // The frame has run to its end.
                Err(RunError::Watch(bad)) => Some(Arc::from(bad)),
                result => result.map(|()| None)?,
            };
            let took = start.elapsed();
            let snapshots = run.executor.snapshots()?;
            let snapshots = snapshots.into_iter().map(|snapshot| Arc::new(snapshot.clone()));
            Ok((took, snapshots.collect::<Vec<_>>(), bad))
        }));
        let result = result.unwrap_or_else(|panic| {
            Err(RunError::Gpu(format!("running it panicked: {}", message(panic.as_ref()))))
        });
        match result {
            Ok((took, mut snapshots, bad)) => {
                // Copies of all ports slow down the steps between them, because they evict everything from the caches.
                // So if an earlier frame was timed without them, its costs stay.
                let costs = (!(captures && running.is_timed)).then(|| step_costs(&run.executor));
                running.is_timed |= !captures;
                let captured = captures.then(|| snapshots.clone());
                if captures {
                    snapshots.retain(|snapshot| is_watched(&snapshot.name));
                }
                self.state.snapshots = snapshots;
                self.succeeded(camera, frame.samples);
                if let Some(costs) = costs {
                    self.measure(took, &info, &costs);
                    self.record(info, costs);
                }
                self.run_other(&frame);
                self.capture = captured.map(|snapshots| Capture { frame, snapshots });
                self.tell_capture();
                self.advance();
                if bad.is_some() {
                    self.leave_path();
                    self.pause(true);
                }
                self.state.bad = bad;
            }
            Err(error) => self.failed(&error),
        }
    }

    fn succeeded(&mut self, camera: Camera, samples: u32) {
        self.before = None;
        self.lost = false;
        self.shown = Some(camera);
        self.index = self.index.wrapping_add(1);
        self.owed = self.owed.saturating_sub(1);
        self.state.camera = self.shown;
        if self.path.is_none() {
            self.state.playing = None;
        }
        self.state.frames = self.index;
        self.state.samples = samples;
    }

    /// If this graph has not run yet, the previous graph takes over; else frames stop until something changes.
    fn failed(&mut self, error: &RunError) {
        self.owed = self.owed.saturating_sub(1);
        self.leave_path();
        match error {
            RunError::Lost(_) => return self.lose(error),
            RunError::Gpu(_) => self.gpu = None,
            _ => {}
        }
        match self.before.take() {
            Some(before) => {
                self.state.trouble =
                    Some(format!("the changed graph failed, so the previous one keeps running: {error}"));
                self.run_graph(before);
            }
            None => {
                self.state.trouble = Some(format!("stopped: {error}"));
                self.stopped = true;
                self.owed = 0;
            }
        }
    }

    /// Handles the loss of the GPU and its memory: opens another device, unless that was lost before its first frame.
    fn lose(&mut self, error: &RunError) {
        self.gpu = None;
        self.running = None;
        self.before = None;
        if self.lost {
            self.state.trouble =
                Some(format!("stopped, because it happened again: {error}; choose the CPU backend instead"));
        } else {
            self.state.trouble = Some(format!("{error}; restarted"));
            self.lost = true;
            self.rebuild = Rebuild::Afresh;
        }
    }
}
