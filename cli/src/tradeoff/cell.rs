//! Cells: one graph, scene, camera, size, budget and seed each. What a cell gave is kept as a file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::experiment::Set;

/// What is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The fingerprint of everything that the errors depend on: the name of its file.
    pub key: String,
    /// The graph's name in the experiment.
    pub graph: String,
    /// The graph with all changes, as `render` takes it.
    pub variant: String,
    /// The parameters that vary.
    pub params: Vec<Set>,
    /// The scene.
    pub scene: String,
    /// The camera path.
    pub camera: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Number of frames that run.
    pub frames: u32,
    /// Those that are compared.
    pub compare: Vec<u32>,
    /// The budget as in the experiment.
    pub budget: String,
    /// The same in samples per frame.
    pub samples: u32,
    /// Light paths of a sample; `None` if no node has a number of paths.
    pub paths_per_sample: Option<u32>,
    /// The budget in light paths per pixel and frame, likewise.
    pub paths_per_pixel: Option<f64>,
    /// The random seed.
    pub seed: u32,
}

/// Figures by column; `None` where there is nothing to measure.
pub type Figures = BTreeMap<String, Option<f64>>;

/// The time of one node or transfer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodeCost {
    /// Its name in the plan.
    pub node: String,
    /// The kind of its stage, or `transfer`.
    pub kind: String,
    /// `cpu` or `gpu`; `None` for a transfer.
    pub backend: Option<String>,
    /// Median time in milliseconds.
    pub ms: f64,
    /// Median bytes that it moved between CPU and GPU in a frame.
    pub bytes_moved: f64,
}

/// The errors of one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameErrors {
    /// Its number, from 0.
    pub frame: u32,
    /// The metrics.
    pub errors: Figures,
}

/// What was measured of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The metrics, means over the compared frames, and the errors of the reference.
    pub errors: Figures,
    /// The metrics of each compared frame.
    pub frames: Vec<FrameErrors>,
    /// The costs.
    pub costs: Figures,
    /// Every node and transfer in the order of the plan.
    pub nodes: Vec<NodeCost>,
    /// The default side of nodes.
    pub backend: String,
    /// The machine that measured it.
    pub machine: Value,
}

/// The result of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// Figures.
    Measured(Box<Measured>),
    /// The message of what went wrong.
    Failed(String),
}

/// A cell with its result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The cell.
    pub cell: Cell,
    /// Its result.
    pub result: Outcome,
}

/// A search with its answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The fingerprint of everything that it depends on: the name of its file.
    pub key: String,
    /// What is searched in, without budget and seed.
    pub cell: Cell,
    /// What is searched: `samples`, or a parameter.
    pub over: String,
    /// The column of the figure.
    pub column: String,
    /// What the figure is to be.
    pub target: f64,
    /// The answer.
    pub result: Reached,
}

/// The answer of a search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reached {
    /// The target is reached.
    Within {
        /// The samples per frame, or the value of the parameter, most likely.
        value: f64,
        /// The smallest and the largest value at which it may be.
        interval: [f64; 2],
        /// What was measured there: means over the seeds.
        figures: Figures,
    },
    /// The smallest value that was tried is beyond the target already.
    Below(f64),
    /// The largest value that was tried does not reach the target.
    Above(f64),
    /// The message of what went wrong.
    Failed(String),
}

impl Reached {
    /// The figure of a column at the answer, if there is one.
    pub fn figure(&self, column: &str) -> Option<f64> {
        match self {
            Self::Within { figures, .. } => figures.get(column).copied().flatten(),
            _ => None,
        }
    }

    /// The most likely value and the ends of its interval, as far as they are known.
    pub fn values(&self) -> Vec<f64> {
        match self {
            Self::Within { value, interval: [low, high], .. } => vec![*low, *value, *high],
            Self::Below(value) | Self::Above(value) => vec![*value],
            Self::Failed(_) => Vec::new(),
        }
    }
}

impl Cell {
    /// The scene, the camera and the size.
    pub fn view(&self) -> String {
        format!("{}, {}, {}x{}", self.scene, self.camera, self.size[0], self.size[1])
    }

    /// The graph with the parameters that vary.
    pub fn variation(&self) -> String {
        let params = self.params.iter().map(|(param, value)| format!(" {param}={value}"));
        format!("{}{}", self.graph, params.collect::<String>())
    }

    /// All of it in a line.
    pub fn label(&self) -> String {
        format!("{}, {}, {}, seed {}", self.variation(), self.view(), self.budget, self.seed)
    }

    /// Whether both differ in nothing but the seed.
    pub fn repeats(&self, other: &Self) -> bool {
        let of = |cell: &Self| Self { key: String::new(), seed: 0, ..cell.clone() };
        of(self) == of(other)
    }
}

impl Record {
    /// What was measured, unless it failed.
    pub fn measured(&self) -> Option<&Measured> {
        match &self.result {
            Outcome::Measured(measured) => Some(measured),
            Outcome::Failed(_) => None,
        }
    }

    /// The figure of a column, if there is one.
    pub fn figure(&self, column: &str) -> Option<f64> {
        let Measured { errors, costs, .. } = self.measured()?;
        errors.get(column).or_else(|| costs.get(column)).copied().flatten()
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// A cell of a graph with a number of samples.
    pub fn cell(graph: &str, samples: u32, seed: u32) -> Cell {
        Cell {
            key: format!("{graph}-{samples}-{seed}"),
            graph: graph.into(),
            variant: graph.into(),
            params: Vec::new(),
            scene: "cornell".into(),
            camera: "orbit".into(),
            size: [10, 10],
            frames: 3,
            compare: vec![2],
            budget: format!("{samples}"),
            samples,
            paths_per_sample: Some(4),
            paths_per_pixel: Some(f64::from(samples) * 0.04),
            seed,
        }
    }

    /// A record with this FLIP in this time.
    pub fn record(cell: Cell, flip: f64, ms: f64) -> Record {
        let figures = |pairs: &[(&str, f64)]| {
            pairs.iter().map(|(name, value)| ((*name).to_owned(), Some(*value))).collect::<Figures>()
        };
        let (samples, paths) = (f64::from(cell.samples), cell.paths_per_pixel.unwrap_or(0.0));
        let measured = Measured {
            errors: figures(&[("flip", flip)]),
            frames: vec![FrameErrors { frame: 2, errors: figures(&[("flip", flip)]) }],
            costs: figures(&[("total_ms", ms), ("samples_per_frame", samples), ("paths_per_pixel", paths)]),
            nodes: Vec::new(),
            backend: "cpu".into(),
            machine: Value::Null,
        };
        Record { cell, result: Outcome::Measured(Box::new(measured)) }
    }

    #[test]
    fn repetitions_differ_in_the_seed_alone() {
        let first = cell("epi", 5, 1);
        assert!(first.repeats(&cell("epi", 5, 2)));
        assert!(!first.repeats(&cell("epi", 6, 1)) && !first.repeats(&cell("render-cache", 5, 1)));
    }

    #[test]
    fn records_are_read_as_they_were_written() {
        let mut record = record(cell("epi", 5, 1), 0.1 + 0.2, 1.0 / 3.0);
        if let Outcome::Measured(measured) = &mut record.result {
            measured.errors.insert("psnr".into(), None);
        }
        let text = serde_json::to_string(&record).unwrap();
        assert_eq!(serde_json::from_str::<Record>(&text).unwrap(), record);
        assert_eq!((record.figure("total_ms"), record.figure("psnr")), (Some(1.0 / 3.0), None));
        let failed = Record { result: Outcome::Failed("no".into()), ..record };
        let text = serde_json::to_string(&failed).unwrap();
        assert!(text.ends_with("\"result\":{\"failed\":\"no\"}}"), "{text}");
        assert_eq!(serde_json::from_str::<Record>(&text).unwrap().measured(), None);
    }
}
