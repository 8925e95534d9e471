//! The costs of frames: times of the last frame, the frame rate over the last second, and a record of each frame.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use epigraph_core::Executor;

use super::Worker;
use crate::engine::{GraphInfo, MAX_RATE, RECORDED, Record, StepCost};

impl Worker {
    /// Records the cost of a frame that has just ended and lasted `took`, copies for viewers included.
    pub(super) fn measure(&mut self, took: Duration, graph: &GraphInfo, steps: &[StepCost]) {
        self.state.times = steps.iter().map(|step| step.ms).collect();
        if !self.options.measured {
            self.state.times.fill(1.0);
            self.state.frame_ms = graph.steps.iter().filter(|step| !step.is_tap).count() as f32;
            self.state.rate = MAX_RATE;
            return;
        }
        let now = Instant::now();
        self.ends.retain(|end| now - *end < Duration::from_secs(1));
        self.ends.push(now);
        self.state.frame_ms = own_ms(took, graph, &self.state.times);
        self.state.rate = self.ends.len() as f32;
    }

    /// Adds the cost of the frame that has just ended to the records.
    pub(super) fn record(&mut self, graph: Arc<GraphInfo>, steps: Vec<StepCost>) {
        while self.records.len() >= RECORDED {
            self.records.pop_front();
        }
        let (frame, ms) = (self.state.frames.saturating_sub(1), self.state.frame_ms);
        let (mut at, mut steps) = (self.began.elapsed().as_secs_f64(), steps);
        if !self.options.measured {
            at = f64::from(self.state.frames) / f64::from(MAX_RATE);
            let one = |(index, step): (usize, &mut StepCost)| {
                *step = StepCost { start: index as f32, ms: 1.0, moved: step.moved };
            };
            steps.iter_mut().enumerate().for_each(one);
        }
        self.records.push_back(Arc::new(Record { frame, at, ms, graph, steps }));
        self.state.records = self.records.iter().cloned().collect();
    }
}

/// Milliseconds without the steps that only copy a port for a viewer.
pub(super) fn own_ms(took: Duration, graph: &GraphInfo, times: &[f32]) -> f32 {
    let taps = graph.steps.iter().zip(times).filter(|(step, _)| step.is_tap).map(|(_, ms)| ms);
    (took.as_secs_f32() * 1000.0 - taps.sum::<f32>()).max(0.0)
}

/// The cost of each step of the last frame.
pub(super) fn step_costs(executor: &Executor) -> Vec<StepCost> {
    let costs = executor.starts().iter().zip(executor.times()).zip(executor.moved());
    costs.map(|((&start, &ms), &moved)| StepCost { start, ms, moved }).collect()
}
