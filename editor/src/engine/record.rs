//! The costs of the last frames.

use std::sync::Arc;

use super::GraphInfo;

/// Number of frames remembered.
pub const RECORDED: usize = 300;

/// The cost of a frame.
#[derive(Clone, Debug)]
pub struct Record {
    /// Its number.
    pub frame: u32,
    /// When it ended, in seconds since the engine started.
    pub at: f64,
    /// Milliseconds of the whole frame.
    pub ms: f32,
    /// Its graph.
    pub graph: Arc<GraphInfo>,
    /// The costs of the graph's steps, in the order of [`GraphInfo::steps`].
    pub steps: Vec<StepCost>,
}

/// The cost of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepCost {
    /// When it began, in milliseconds since the frame began. If the GPU measures its own times, its nodes have the
    /// times of the previous frame.
    pub start: f32,
    /// Milliseconds.
    pub ms: f32,
    /// Bytes transferred between the sides.
    pub moved: u64,
}

impl StepCost {
    /// When it ended, in milliseconds since the frame began.
    pub fn end(&self) -> f32 {
        self.start + self.ms
    }
}

#[cfg(test)]
mod tests {
    use std::{
        path::Path,
        thread,
        time::{Duration, Instant},
    };

    use epigraph_core::{GraphFile, Side};

    use super::*;
    use crate::engine::{Backend, Command, Engine, Options, Pace};

    fn run(graph: &str, frames: u32) -> Arc<[Arc<Record>]> {
        let options = Options {
            size: [48, 32],
            backend: Backend::Cpu,
            pacing: Pace::Exact,
            paused: true,
            ..Options::default()
        };
        let engine = Engine::start(options, epigraph::registry(), || ());
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(graph);
        engine.send(Command::Graph(Arc::new(GraphFile::load(&path).unwrap())));
        engine.send(Command::Step(frames));
        let start = Instant::now();
        while engine.state().frames < frames {
            assert!(start.elapsed() < Duration::from_secs(120), "{:?}", engine.state().trouble);
            thread::sleep(Duration::from_millis(2));
        }
        engine.state().records.clone()
    }

    #[test]
    fn steps_on_the_cpu_run_one_after_the_other() {
        // The last frame captures all ports for the pause, and is not timed.
        let records = run("render-cache.ron", RECORDED as u32 + 4);
        assert_eq!((records.len(), records[0].frame), (RECORDED, 3));
        let last = records.last().unwrap();
        assert_eq!(last.steps.len(), last.graph.steps.len());
        for pair in last.steps.windows(2) {
            // The tolerance covers the rounding of milliseconds to f32.
            assert!(pair[1].start >= pair[0].end() - 1e-3, "{pair:?}");
        }
        let own = last.graph.steps.iter().zip(&last.steps).filter(|(step, _)| !step.is_tap);
        assert!(own.map(|(_, cost)| cost.ms).sum::<f32>() <= last.ms + 1e-3);
        assert!(last.steps.iter().all(|step| step.moved == 0));
        assert!(records.windows(2).all(|pair| pair[0].at < pair[1].at));
    }

    #[test]
    fn bytes_transferred_between_the_sides_are_counted() {
        let records = run("hybrid.ron", 3);
        let last = records.last().unwrap();
        let moved = |name: &str| {
            let steps = last.graph.steps.iter().zip(&last.steps);
            steps.filter(|(step, _)| step.name.starts_with(name)).map(|(_, cost)| cost.moved).sum::<u64>()
        };
        // Priorities, 4 bytes per pixel, are downloaded in every frame; the mesh was uploaded in the first.
        assert!(moved("download interpolate.priority") == 48 * 32 * 4, "{:?}", last.graph.steps);
        assert_eq!(moved("upload mesh."), 0);
        let first = &records[0];
        let of_mesh =
            first.graph.steps.iter().zip(&first.steps).filter(|(step, _)| step.name.contains("mesh."));
        assert!(of_mesh.map(|(_, cost)| cost.moved).sum::<u64>() > 0);
        assert!(last.graph.steps.iter().any(|step| step.side == Side::Gpu));
    }
}
