//! A graph with its memory, ready to run, and how one is made from a file.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
};

use epigraph_core::{
    Executor, Gpu, Graph, GraphError, GraphFile, Plan, Problem, Problems, Registry, RunError, Settings, Side,
    Source, compile,
};

use super::GraphInfo;
use crate::inspect;

/// A graph that runs.
pub struct Running {
    pub executor: Executor,
    pub info: Arc<GraphInfo>,
    /// The taps that it was compiled with.
    pub taps: Taps,
    /// Whether it can capture all that its nodes write.
    pub is_open: bool,
    /// Whether a frame of it has been timed in which it did not.
    pub is_timed: bool,
}

/// Which ports can be captured beside the outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Taps {
    /// These, as `node.port`, as far as the graph has them.
    pub watched: Vec<String>,
    /// And all that nodes write, unless copies of that would be larger than so many bytes.
    pub all: u64,
}

impl Running {
    /// Compiles a file for `settings`. `open` gives the GPU where the plan needs one.
    ///
    /// # Errors
    /// All problems of the file; those of a device or of memory stand without a place.
    pub fn new(
        file: &GraphFile,
        registry: &Registry,
        settings: &Settings,
        taps: Taps,
        open: &mut dyn FnMut() -> Result<Arc<Gpu>, RunError>,
    ) -> Result<Self, Problems> {
        // A panic here is a bug of the compiler; the window and the files outlive it.
        let made = catch_unwind(AssertUnwindSafe(|| {
            let (graph, plan, settings, is_open) = compile_tapped(file, registry, settings, &taps)?;
            let gpu =
                if plan.uses(Side::Gpu) { Some(open().map_err(|error| problems(&error))?) } else { None };
            let info = GraphInfo::new(&graph, &plan, settings.size, gpu.as_ref().map(|gpu| gpu.name()));
            let executor = Executor::new(graph, plan, &settings, registry, gpu);
            let executor = executor.map_err(|error| problems(&error))?;
            Ok(Self { executor, info: Arc::new(info), taps, is_open, is_timed: false })
        }));
        made.unwrap_or_else(|panic| {
            let text = format!("compiling it panicked: {}", message(panic.as_ref()));
            Err(Problem::new(GraphError::Invalid(text)).into())
        })
    }
}

/// What a panic says.
pub fn message(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}

/// A failure to make memory or pipelines as a problem of the graph.
fn problems(error: &RunError) -> Problems {
    let problem = Problem::new(GraphError::Invalid(error.to_string()));
    match error {
        RunError::Stage { node, message } => {
            Problem::new(GraphError::Invalid(message.clone())).node(node).into()
        }
        _ => problem.into(),
    }
}

fn compile_tapped(
    file: &GraphFile,
    registry: &Registry,
    settings: &Settings,
    taps: &Taps,
) -> Result<(Graph, Plan, Settings, bool), Problems> {
    let with = |taps: Vec<Source>| {
        let settings = Settings { taps, ..settings.clone() };
        compile(file, registry, &settings).map(|(graph, plan)| (graph, plan, settings))
    };
    let mut watched: Vec<Source> = taps.watched.iter().filter_map(|name| name.parse().ok()).collect();
    let mut made = with(watched.clone());
    if made.is_err() {
        // Is it the graph, or a port that it no longer has?
        with(Vec::new())?;
        watched.retain(|tap| with(vec![tap.clone()]).is_ok());
        made = with(watched.clone());
    }
    let (graph, plan, settings) = made?;
    let bytes: u64 = graph.nodes.indices().map(|node| plan.node_bytes(node)).sum();
    if bytes > taps.all {
        return Ok((graph, plan, settings, false));
    }
    // Only of nodes that run anyway: looking must not change what is left out. And no port twice.
    let more = inspect::taps(&graph).into_iter().filter(|tap| !watched.contains(tap)).collect();
    with([watched, more].concat()).map(|(graph, plan, settings)| (graph, plan, settings, true))
}
