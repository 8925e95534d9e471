//! Finds graphs by name or file.

use std::{io, path::Path};

use epigraph_core::{GraphError, GraphFile, Problems};

pub use epigraph_graphs::names;

/// The default graph.
pub const DEFAULT: &str = "epi";

/// What [`load`] says it was looking for if a name is unknown.
pub const UNKNOWN: &str = "graph or file";

/// Reads a graph: the file of that name if it exists, else the built-in graph of that name, given as `render-cache`,
/// `render-cache.ron` or `graphs/render-cache.ron`.
///
/// # Errors
/// The problems of the file. If there is neither a file nor a built-in graph, a single word gives
/// [`GraphError::Unknown`] with [`UNKNOWN`].
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
            // A single word is probably a mistyped name rather than a path.
            if !name.contains(['/', '\\', '.'])
                && let Some(problem) = problems.0.first_mut()
            {
                problem.error = GraphError::unknown(UNKNOWN, name, names());
                problem.place = None;
            }
            Err(problems)
        }
    }
}
