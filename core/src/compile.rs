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
    let whole = &*file.whole()?;
    let graph = Graph::check(whole, registry, settings)?;
    check_edited(whole, &graph, registry)?;
    let plan = Plan::new(&graph, settings).map_err(|mut problems| {
        for problem in &mut problems.0 {
            let wire = match &problem.error {
                GraphError::Cycle { path } => wire_of(file, whole, path),
                _ => None,
            };
            let node = || problem.node.as_ref().and_then(|name| whole.node_at(name));
            problem.place = wire.or_else(|| node().map(|(node, file)| file.place(node.name.span)));
        }
        problems
    })?;
    Ok((graph, plan))
}

/// The place of a wire between two of these nodes, which wait for each other, that is written in the graph's own file:
/// where the graph changes another, the others have done no harm so far.
fn wire_of(file: &GraphFile, whole: &GraphFile, path: &[String]) -> Option<Place> {
    file.base.as_ref()?;
    let flat = whole.flatten().ok()?;
    let on_path = flat.nodes.iter().filter(|node| path.contains(&node.def.name.value));
    let wires = on_path.flat_map(|node| node.def.inputs.iter().map(|input| (node.file, &input.from)));
    let mut wires = wires.filter(|(_, from)| path.contains(&from.value.node));
    wires
        .find(|(within, from)| within.path_at(from.span) == file.path)
        .map(|(within, from)| within.place(from.span))
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
