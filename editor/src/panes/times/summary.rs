//! The last frames, step by step.

use std::sync::Arc;

use epigraph_core::Side;

use crate::engine::{Record, StepCost, StepInfo};

/// A step of the graph over the last frames.
#[derive(Clone, Debug, PartialEq)]
pub struct StepSummary {
    /// The node's name, or the transfer's.
    pub name: String,
    /// The node that runs; `None` for transfers.
    pub node: Option<String>,
    /// The side it runs on.
    pub side: Side,
    /// Cost in the last frame.
    pub last: StepCost,
    /// Milliseconds: the median over the frames.
    pub median: f32,
    /// Milliseconds in each frame, the oldest first.
    pub series: Vec<f32>,
}

/// The steps of the last frame's graph, in order, over the last frames in which the graph had the same steps. Copies
/// for viewers are left out.
pub fn summarize(records: &[Arc<Record>]) -> Vec<StepSummary> {
    let Some(last) = records.last() else { return Vec::new() };
    let wanted = steps(last);
    // Watching another port recompiles the graph, but its steps stay the same.
    let same = |own: &Vec<(&StepInfo, StepCost)>| {
        own.iter().map(|step| &step.0.name).eq(wanted.iter().map(|step| &step.0.name))
    };
    let frames: Vec<_> = records.iter().map(|record| steps(record)).filter(same).collect();
    let step = |(index, (step, last)): (usize, &(&StepInfo, StepCost))| {
        let series: Vec<f32> = frames.iter().map(|steps| steps[index].1.ms).collect();
        StepSummary {
            name: step.name.clone(),
            node: step.node.clone(),
            side: step.side,
            last: *last,
            median: median(&series),
            series,
        }
    };
    wanted.iter().enumerate().map(step).collect()
}

/// The steps of a frame with their costs, without copies for viewers.
pub fn steps(record: &Record) -> Vec<(&StepInfo, StepCost)> {
    let steps = record.graph.steps.iter().zip(record.steps.iter().copied());
    steps.filter(|(step, _)| !step.is_tap).collect()
}

/// The median; of an even number of values, the lower middle one; 0 for no values.
pub fn median(values: &[f32]) -> f32 {
    let mut values = values.to_vec();
    let Some(middle) = values.len().checked_sub(1).map(|last| last / 2) else { return 0.0 };
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::GraphInfo;

    fn graph(names: &[&str]) -> Arc<GraphInfo> {
        let step = |name: &&str| StepInfo {
            name: (*name).into(),
            node: None,
            side: Side::Cpu,
            is_tap: name.starts_with("tap"),
            transfer: None,
        };
        let steps = names.iter().map(step).collect();
        Arc::new(GraphInfo {
            nodes: Vec::new(),
            left_out: Vec::new(),
            outputs: Vec::new(),
            steps,
            bytes: [0; 2],
            size: [1, 1],
            params: Vec::new(),
            gpu: None,
            dot: String::new(),
        })
    }

    fn record(graph: &Arc<GraphInfo>, ms: &[f32]) -> Arc<Record> {
        let steps = ms.iter().map(|&ms| StepCost { ms, ..StepCost::default() }).collect();
        Arc::new(Record { frame: 0, at: 0.0, ms: 0.0, graph: graph.clone(), steps })
    }

    #[test]
    fn medians_are_of_the_current_graph() {
        let (old, new) = (graph(&["a"]), graph(&["a", "tap a", "b"]));
        let records = [
            record(&old, &[100.0]),
            record(&new, &[1.0, 50.0, 7.0]),
            record(&graph(&["a", "b"]), &[9.0, 8.0]),
            record(&new, &[2.0, 50.0, 9.0]),
        ];
        let steps = summarize(&records);
        assert_eq!((steps[0].median, steps[1].median), (2.0, 8.0));
        assert_eq!(steps[0].series, [1.0, 9.0, 2.0]);
        assert_eq!(steps[1].last.ms, 9.0);
        assert_eq!(median(&[]), 0.0);
        assert_eq!(median(&[4.0, 1.0, 3.0, 2.0]), 2.0);
    }
}
