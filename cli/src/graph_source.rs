//! From what the user calls a graph to its text.

use std::{io, path::Path};

use epigraph_core::{GraphError, GraphFile, Problems};

use crate::{error::CliError, values::Setting};

/// The graph that is rendered where none is named.
pub const DEFAULT_GRAPH: &str = "epi";

/// Graphs that come with the program, by name: `graphs/NAME.ron`.
const EMBEDDED: &[(&str, &str)] = &[
    ("render-cache", include_str!("../../graphs/render-cache.ron")),
    ("epi", include_str!("../../graphs/epi.ron")),
    ("hybrid", include_str!("../../graphs/hybrid.ron")),
    ("render-cache-cpu-dither", include_str!("../../graphs/render-cache-cpu-dither.ron")),
];

/// The files that they are made of, by their paths.
const PARTS: &[(&str, &str)] = &[
    ("graphs/parts/cloud.ron", include_str!("../../graphs/parts/cloud.ron")),
    ("graphs/parts/view.ron", include_str!("../../graphs/parts/view.ron")),
    ("graphs/parts/edges.ron", include_str!("../../graphs/parts/edges.ron")),
];

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
    match EMBEDDED.iter().find(|(known, _)| *known == bare) {
        Some((known, text)) => GraphFile::parse(&format!("graphs/{known}.ron"), text)?.with_parts(&|path| {
            let part = PARTS.iter().find(|(known, _)| Path::new(known) == path);
            part.map(|(_, text)| (*text).to_owned()).ok_or_else(|| io::ErrorKind::NotFound.into())
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
    EMBEDDED.iter().map(|(name, _)| *name).chain(commands)
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
