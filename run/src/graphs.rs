//! From what the user calls a graph to its text.

use std::{io, path::Path};

use epigraph_core::{GraphError, GraphFile, Problems};

pub use epigraph_graphs::names;

/// The graph that runs where none is named.
pub const DEFAULT: &str = "epi";

/// What a name that leads to no graph is said to be; see [`load`].
pub const UNKNOWN: &str = "graph or file";

/// Reads a graph: the file of that name if there is one, else the graph that comes with the program under that name,
/// written `render-cache`, `render-cache.ron` or `graphs/render-cache.ron`.
///
/// # Errors
/// The problems of the text. Where there is neither, a single word is a [`GraphError::Unknown`] of what is [`UNKNOWN`].
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
            // A single word is as likely a mistyped name as a mistyped path.
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
