//! The way from a file to a plan: check the file, then plan the graph.

use crate::{
    error::Problems,
    file::GraphFile,
    graph::{Graph, Settings},
    plan::Plan,
    registry::Registry,
};

/// Checks a file and compiles it: the way from text to a graph and its plan.
pub fn compile(
    file: &GraphFile,
    registry: &Registry,
    settings: &Settings,
) -> Result<(Graph, Plan), Problems> {
    let graph = Graph::check(file, registry, settings)?;
    let plan = Plan::new(&graph, settings).map_err(|mut problems| {
        for problem in &mut problems.0 {
            let found = problem.node.as_ref().and_then(|name| file.node_at(name));
            problem.place = found.map(|(node, file)| file.place(node.name.span));
        }
        problems
    })?;
    Ok((graph, plan))
}
