//! Runs one graph on one scene for many frames and times each stage.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use epigraph::{Device, Error, Place, Registry, Run, Samples, Setup};
use epigraph_core::{
    Access, Dims, Graph, GraphFile, Node, NodeId, Plan, PlannedNode, Port, RunError, Runs, Side, Step,
};
use epigraph_stages::{column::TRACE, facts, meaning::POINTS};

use super::{
    column,
    times::{Times, quantile},
};
use crate::{args::BenchArgs, error::CliError, interrupt, open, progress};

/// The cloud starts empty, and the fuller it is, the longer a frame takes. Samples that renew a point fill no slot, so
/// the number of points settles only after this multiple of the frames that would fill the cloud.
const FILLS: f64 = 1.5;

/// Least and most warm-up frames, which are not counted.
const WARM_UP: [u64; 2] = [10, 300];

/// The same for `--quick`.
const QUICK_WARM_UP: [u64; 2] = [3, 8];

/// Frames to count if the user gives no number.
const FRAMES: u32 = 60;
const QUICK_FRAMES: u32 = 10;

/// Limits for slow machines and large images. The warm-up ends after this time, once [`WARM_UP`]'s least is done; so
/// does counting, once [`LEAST_FRAMES`] frames are counted, unless the user gives a number of frames.
const PATIENCE: Duration = Duration::from_secs(20);
const LEAST_FRAMES: usize = 5;

/// Frames after which what is skipped while nothing changes is skipped.
const SETTLED: u32 = 4;

/// A loaded scene, ready to be traced.
pub struct Loaded {
    /// Its name.
    pub name: String,
    /// The scene and the camera's path.
    pub place: Place,
}

/// A measurement to make.
pub struct Job<'a> {
    /// Label of the progress bar.
    pub label: String,
    /// The command line.
    pub args: &'a BenchArgs,
    /// The stages.
    pub registry: &'a Arc<Registry>,
    /// The graph.
    pub graph: &'a GraphFile,
    /// The default device of nodes.
    pub device: &'a Device,
    /// The scene.
    pub loaded: &'a Loaded,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

impl Job<'_> {
    fn setup(&self, samples: Samples) -> Setup {
        let compile = &self.args.compile;
        Setup::new(self.graph.clone())
            .registry(self.registry.clone())
            .at(&self.loaded.place)
            .device(self.device)
            .size(self.size)
            .samples(samples)
            .seed(self.args.seed)
            .prune(!compile.no_prune)
            .pooling(!compile.no_pooling)
            .vectors(!compile.no_vectors)
    }
}

/// The time of one node or transfer.
pub struct Part {
    /// Its name in the plan.
    pub name: String,
    /// The kind of its stage, or `transfer`.
    pub kind: String,
    /// Where it ran; `None` for a transfer.
    pub side: Option<Side>,
    /// Median time in milliseconds.
    pub ms: f64,
}

/// The figures of many frames.
pub struct Measured {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Edges of the scene's mesh.
    pub edges: u32,
    /// Slots of the point cloud.
    pub points: u64,
    /// Maximum number of samples per frame.
    pub samples: u32,
    /// Warm-up frames, which are not counted.
    pub warm_up: u64,
    /// True if the warm-up was long enough to fill the point cloud.
    pub filled: bool,
    /// Number of counted frames.
    pub frames: usize,
    /// Median times.
    pub times: Times,
    /// 95th percentile of the frame time without tracing, in milliseconds.
    pub p95: f64,
    /// Median time of tracing, in milliseconds.
    pub trace: f64,
    /// Every node and transfer in the order of the plan.
    pub parts: Vec<Part>,
}

/// The result of a measurement.
pub enum Outcome {
    /// Figures.
    Measured(Box<Measured>),
    /// The reason why this machine cannot run it.
    Beyond(String),
}

/// Checks that the graph compiles for the scene.
///
/// # Errors
/// Problems of the graph for this scene.
pub fn check(job: &Job) -> Result<(), CliError> {
    open::samples(job.args.compile.samples, job.size)?;
    job.setup(job.args.compile.samples).compile()?;
    Ok(())
}

/// The plan of a job.
///
/// # Errors
/// Problems of the graph for this scene.
pub fn plan(job: &Job) -> Result<Plan, CliError> {
    Ok(job.setup(job.args.compile.samples).compile()?.plan().clone())
}

/// The plan of a job, and the nodes that are skipped once nothing changes but what always does.
///
/// # Errors
/// Those of [`measure`], and a machine on which the graph does not run.
pub fn skipped(job: &Job) -> Result<(Plan, Vec<NodeId>), CliError> {
    let mut run = job.setup(job.args.compile.samples).start()?;
    for _ in 0..SETTLED {
        interrupt::check()?;
        run.advance(false)?;
    }
    let plan = run.plan();
    let skipped =
        plan.order().filter(|node| plan.nodes[*node].runs != Runs::Always && !run.executor.ran()[*node]);
    let skipped = skipped.collect();
    Ok((plan.clone(), skipped))
}

/// Runs a measurement.
///
/// # Errors
/// Problems of the graph for this scene, and stages that fail. Insufficient memory or an unsuitable GPU is not an error
/// but [`Outcome::Beyond`].
pub fn measure(job: &Job) -> Result<Outcome, CliError> {
    match try_measure(job) {
        Err(CliError::Run(
            error @ (Error::Memory(_) | Error::Run(RunError::Gpu(_) | RunError::Memory { .. })),
        )) => Ok(Outcome::Beyond(error.to_string())),
        outcome => outcome,
    }
}

fn try_measure(job: &Job) -> Result<Outcome, CliError> {
    let args = job.args;
    open::samples(args.compile.samples, job.size)?;
    let mut run: Run = job.setup(args.compile.samples).start()?;
    let points = clouds(run.graph()).map(|(_, dims)| dims.count() as u64).sum();
    let samples = run.settings().samples;

    let fills = fills(points, samples);
    let [least, most] = if args.quick { QUICK_WARM_UP } else { WARM_UP };
    let wanted = args.frames.unwrap_or(if args.quick { QUICK_FRAMES } else { FRAMES });
    let patience = if args.frames.is_none() { PATIENCE } else { Duration::MAX };
    let mut warm_up = fills.clamp(least, most);
    let bar = progress::bar(warm_up + u64::from(wanted), &job.label, "frames");
    let mut log = Log::default();
    let mut start = Instant::now();
    while log.wall.len() < wanted as usize {
        interrupt::check()?;
        let began = Instant::now();
        run.advance(false)?;
        let wall = began.elapsed();
        bar.inc(1);
        let index = run.index();
        if u64::from(index) <= warm_up {
            if u64::from(index) >= least && start.elapsed() > PATIENCE {
                warm_up = index.into();
            }
            if u64::from(index) == warm_up {
                start = Instant::now();
            }
            continue;
        }
        log.wall.push(wall.as_secs_f64() * 1000.0);
        log.steps.push(run.executor.times().to_vec());
        if log.wall.len() >= LEAST_FRAMES && start.elapsed() > patience {
            break;
        }
    }
    bar.finish_and_clear();

    let plan = run.plan();
    Ok(Outcome::Measured(Box::new(Measured {
        size: job.size,
        edges: run.settings().facts.count(facts::EDGES).unwrap_or(0),
        points,
        samples,
        warm_up,
        filled: warm_up >= fills,
        frames: log.wall.len(),
        times: log.times(plan),
        p95: quantile(log.frame_ms(plan), 0.95),
        trace: log.median(|step| is_trace(plan, step)),
        parts: log.parts(plan),
    })))
}

/// The number of frames after which the point cloud counts as full.
fn fills(points: u64, samples: u32) -> u64 {
    (points as f64 / f64::from(samples.max(1)) * FILLS).ceil() as u64
}

/// The nodes that own point clouds, with the clouds' dims.
fn clouds(graph: &Graph) -> impl Iterator<Item = (&Node, Dims)> {
    let is_cloud = |port: &Port| port.access == Access::Write && port.meaning == Some(POINTS);
    graph.nodes.iter().flat_map(move |node| {
        let ports = node.declaration().ports.iter().zip(&node.dims);
        ports.filter(move |(port, _)| is_cloud(port)).map(move |(_, dims)| (node, *dims))
    })
}

/// The same graph with `per_pixel` points per pixel in all of its clouds.
///
/// # Errors
/// The problems of the graph, or that the cloud lacks the parameter.
pub fn with_points(job: &Job, per_pixel: f64) -> Result<GraphFile, CliError> {
    let compiled = job.setup(Samples::Count(1)).compile()?;
    let mut graph = job.graph.clone();
    for (node, _) in clouds(compiled.graph()) {
        let value = format!("{per_pixel:?}");
        graph =
            graph.with_param(&format!("{value} points per pixel"), &node.name, "points_per_pixel", &value)?;
    }
    Ok(graph)
}

/// The times of the counted frames, in milliseconds.
#[derive(Default)]
struct Log {
    /// Wall-clock time of each frame.
    wall: Vec<f64>,
    /// Time of each of the plan's steps, for each frame.
    steps: Vec<Vec<f32>>,
}

impl Log {
    /// For each frame, the sum of the chosen steps.
    fn sums(&self, chosen: impl Fn(usize) -> bool) -> Vec<f64> {
        let sum = |times: &Vec<f32>| -> f64 {
            times.iter().enumerate().filter(|(step, _)| chosen(*step)).map(|(_, ms)| f64::from(*ms)).sum()
        };
        self.steps.iter().map(sum).collect()
    }

    fn median(&self, chosen: impl Fn(usize) -> bool) -> f64 {
        quantile(self.sums(chosen), 0.5)
    }

    /// The median, or `None` if no step is chosen.
    fn median_of_any(&self, plan: &Plan, chosen: impl Fn(usize) -> bool) -> Option<f64> {
        (0..plan.steps.len()).any(&chosen).then(|| self.median(chosen))
    }

    /// For each frame, the wall-clock time minus the time of tracing.
    fn frame_ms(&self, plan: &Plan) -> Vec<f64> {
        let trace = self.sums(|step| is_trace(plan, step));
        self.wall.iter().zip(trace).map(|(wall, trace)| wall - trace).collect()
    }

    fn times(&self, plan: &Plan) -> Times {
        let in_column = |column: usize| {
            move |step: usize| name(plan, step).and_then(column::of).is_some_and(|found| found == column)
        };
        let on_gpu =
            |step: usize| matches!(plan.steps[step], Step::Run(node) if plan.nodes[node].side == Side::Gpu);
        let counted = self.sums(|step| name(plan, step).and_then(column::of).is_some());
        let rest = self.frame_ms(plan).iter().zip(counted).map(|(frame, counted)| frame - counted).collect();
        Times {
            rest: quantile(rest, 0.5).max(0.0),
            columns: std::array::from_fn(|column| self.median_of_any(plan, in_column(column))),
            gpu: self.median_of_any(plan, on_gpu),
            frame: quantile(self.frame_ms(plan), 0.5),
        }
    }

    fn parts(&self, plan: &Plan) -> Vec<Part> {
        let part = |(index, step): (usize, &Step)| {
            let ms = self.median(|step| step == index);
            let name = plan.step_name(step);
            match step {
                Step::Run(node) => {
                    let PlannedNode { kind, side, .. } = &plan.nodes[*node];
                    Part { name, kind: kind.clone(), side: Some(*side), ms }
                }
                _ => Part { name, kind: "transfer".into(), side: None, ms },
            }
        };
        let steps = plan.steps.iter().enumerate();
        steps.filter(|(_, step)| !matches!(step, Step::Tap { .. })).map(part).collect()
    }
}

/// The column that the stage of a step counts towards, if it runs a stage that names one.
fn name(plan: &Plan, step: usize) -> Option<&'static str> {
    match plan.steps[step] {
        Step::Run(node) => plan.nodes[node].column,
        _ => None,
    }
}

fn is_trace(plan: &Plan, step: usize) -> bool {
    name(plan, step) == Some(TRACE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_warm_up_fills_the_cloud() {
        // 1.14 points for each of 512 x 512 pixels at 5%: 22.8 frames fill it.
        assert_eq!(fills(298_845, 13_107), 35);
        assert_eq!(fills(0, 0), 0);
    }
}
