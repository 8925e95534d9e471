//! A graph with its memory, ready to run, and its compilation from a file.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
};

use epigraph::{Compiled, Error, Run, Setup, Source};
use epigraph_core::{GraphError, Problem, Problems, RunError};

use super::GraphInfo;
use crate::inspect;

/// A graph that runs.
pub struct Running {
    pub run: Run,
    pub info: Arc<GraphInfo>,
    /// The ports that it can capture.
    pub taps: Taps,
    /// True if it can capture all outputs of its nodes.
    pub is_open: bool,
    /// True if a frame without that capture has been timed.
    pub is_timed: bool,
}

/// The ports that can be captured besides the outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Taps {
    /// Ports as `node.port`; those that the graph lacks are skipped.
    pub watched: Vec<String>,
    /// All outputs of all nodes are captured too, unless their copies would exceed this many bytes.
    pub all: u64,
}

impl Running {
    /// Compiles and allocates.
    ///
    /// # Errors
    /// All problems of the file. Those of a device or of memory have no position in it.
    pub fn new(setup: Setup, taps: Taps) -> Result<Self, Problems> {
        // A panic here is a bug of the compiler; the window and the files survive it.
        let made = catch_unwind(AssertUnwindSafe(|| {
            let mut compiled = setup.compile().map_err(problems)?;
            let is_open = keep(&mut compiled, &taps)?;
            let gpu = compiled.gpu().map_err(problems)?;
            let size = compiled.settings().size;
            // Problems of nodes that do not run are none of this graph.
            let whole = compiled.whole().ok();
            let gpu = gpu.as_ref().map(|gpu| gpu.name());
            let info = GraphInfo::new(compiled.graph(), compiled.plan(), whole.as_ref(), size, gpu);
            let run = compiled.start().map_err(problems)?;
            Ok(Self { run, info: Arc::new(info), taps, is_open, is_timed: false })
        }));
        made.unwrap_or_else(|panic| {
            let text = format!("compiling it panicked: {}", message(panic.as_ref()));
            Err(Problem::new(GraphError::Invalid(text)).into())
        })
    }
}

/// The message of a panic.
pub fn message(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}

/// The reasons why a graph cannot run, as problems of it.
pub fn problems(error: impl Into<Error>) -> Problems {
    match error.into() {
        Error::Graph(problems) => problems,
        Error::Run(RunError::Stage { node, message }) => {
            Problem::new(GraphError::Invalid(message)).node(&node).into()
        }
        error => Problem::new(GraphError::Invalid(error.to_string())).into(),
    }
}

/// Keeps the watched ports that the graph has, and all outputs of all nodes, unless the copies would be too large: then
/// it returns false.
fn keep(compiled: &mut Compiled, taps: &Taps) -> Result<bool, Problems> {
    let watched: Vec<Source> = taps.watched.iter().filter_map(|name| name.parse().ok()).collect();
    if compiled.keep(&watched).is_err() {
        for port in &watched {
            // A port that the graph no longer has.
            let _ = compiled.keep(std::slice::from_ref(port));
        }
    }
    let plan = compiled.plan();
    let bytes: u64 = compiled.graph().nodes.indices().map(|node| plan.node_bytes(node)).sum();
    if bytes > taps.all {
        return Ok(false);
    }
    // Only those of nodes that run anyway: viewing must not change which nodes are left out.
    let all = inspect::taps(compiled.graph());
    compiled.keep(&all).map_err(problems)?;
    Ok(true)
}
