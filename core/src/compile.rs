//! From a file to a plan: check the file and the shaders that an editor has changed, then plan the graph.

use crate::{
    error::{GraphError, Place, Problem, Problems},
    file::GraphFile,
    graph::{Graph, Node, Settings},
    plan::Plan,
    reflect,
    registry::Registry,
    shader::Shader,
};

/// Checks a file and compiles it to a graph and its plan.
pub fn compile(
    file: &GraphFile,
    registry: &Registry,
    settings: &Settings,
) -> Result<(Graph, Plan), Problems> {
    let graph = Graph::check(file, registry, settings)?;
    check_edited(file, &graph, registry)?;
    let plan = Plan::new(&graph, settings).map_err(|mut problems| {
        for problem in &mut problems.0 {
            let found = problem.node.as_ref().and_then(|name| file.node_at(name));
            problem.place = found.map(|(node, file)| file.place(node.name.span));
        }
        problems
    })?;
    Ok((graph, plan))
}

/// Checks the shaders that differ from what is embedded. The embedded ones are sound: tests see to that.
fn check_edited(file: &GraphFile, graph: &Graph, registry: &Registry) -> Result<(), Problems> {
    let mut problems: Vec<Problem> = Vec::new();
    for node in &graph.nodes {
        let Some(shader) = &node.declaration().shader else { continue };
        if !reflect::is_edited(shader, &registry.library) {
            continue;
        }
        for error in reflect::check_stage(&*node.stage, &registry.library) {
            let problem = reflect::at_its_line(error, shader, &registry.library)
                .unwrap_or_else(|error| in_whole_file(error, shader, node, file));
            // Nodes of one kind have their shader in common, and shaders their modules.
            let is_new = |other: &Problem| (&other.error, &other.place) != (&problem.error, &problem.place);
            if problems.iter().all(is_new) {
                problems.push(problem.node(&node.name));
            }
        }
    }
    Problems(problems).into_result()
}

/// A problem without a line: of the shader's file, or of the node where the shader has none.
fn in_whole_file(error: GraphError, shader: &Shader, node: &Node, file: &GraphFile) -> Problem {
    let place = match &shader.file {
        Some(path) => Some(Place::file(&path.display().to_string())),
        None => file.node_at(&node.name).map(|(node, file)| file.place(node.kind.span)),
    };
    Problem { place, ..Problem::new(error) }
}
