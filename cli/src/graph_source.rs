//! From what the user calls a graph to its text.

use std::{io, path::Path};

use epigraph_core::{GraphError, GraphFile, Problems};

use crate::{error::CliError, values::Setting};

/// The graph that is rendered where none is named.
pub const DEFAULT_GRAPH: &str = "epi";

/// Reads a graph: the file of that name if there is one, else the graph that comes with the program under that name,
/// written `render-cache`, `render-cache.ron` or `graphs/render-cache.ron`.
///
/// # Errors
/// That there is neither, or the problems of the text.
pub fn load(name: &str) -> Result<GraphFile, Problems> {
    let path = Path::new(name);
    if path.exists() {
        return GraphFile::load(path);
    }
    let bare = name.strip_prefix("graphs/").unwrap_or(name);
    let bare = bare.strip_suffix(".ron").unwrap_or(bare);
    match epigraph_graphs::text(&format!("{bare}.ron")) {
        Some(text) => GraphFile::parse(&format!("graphs/{bare}.ron"), text)?.with_parts(&|path| {
            let part =
                path.strip_prefix("graphs").ok().and_then(Path::to_str).and_then(epigraph_graphs::text);
            part.map(str::to_owned).ok_or_else(|| io::ErrorKind::NotFound.into())
        }),
        None => {
            let mut problems = GraphFile::load(path).err().unwrap_or_default();
            // One word is as likely a mistyped name as a mistyped path.
            if !name.contains(['/', '\\', '.'])
                && let Some(problem) = problems.0.first_mut()
            {
                problem.error = GraphError::unknown("graph, file or command", name, known_words());
                problem.place = None;
            }
            Err(problems)
        }
    }
}

fn known_words() -> impl Iterator<Item = &'static str> {
    let commands = ["render", "check", "stages", "reference", "compare", "bench", "gallery", "quality"];
    epigraph_graphs::names().chain(commands)
}

/// Applies `--set` in order.
///
/// # Errors
/// That there is no such node, or that the value is no RON. Whether the stage knows the parameter shows on compiling.
pub fn apply(file: &mut GraphFile, settings: &[Setting]) -> Result<(), CliError> {
    for Setting { node, param, value } in settings {
        file.set_param(node, param, value)
            .map_err(|problems| CliError::Input(format!("--set {node}.{param}={value}: {problems}")))?;
    }
    Ok(())
}
