//! Finds graphs by name or file.

use std::{io, path::Path};

use epigraph_core::{GraphError, GraphFile, Library, Origin, Problems, Registry};

use crate::change::{Change, changed, split};

pub use epigraph_graphs::names;

/// The default graph.
pub const DEFAULT: &str = "epi-filtered";

/// What [`load`] says it was looking for if a name is unknown.
pub const UNKNOWN: &str = "graph or file";

/// Files, and the graphs that come with the program, given as `render-cache`, `render-cache.ron` or
/// `graphs/render-cache.ron`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shipped;

impl Library for Shipped {
    fn read(&self, path: &Path) -> io::Result<String> {
        epigraph_files::text(path)
    }

    fn shipped(&self, name: &str) -> Option<(String, String)> {
        let bare = name.strip_prefix("graphs/").unwrap_or(name);
        let file = format!("{}.ron", bare.strip_suffix(".ron").unwrap_or(bare));
        let text = epigraph_graphs::text(&file)?;
        Some((format!("graphs/{file}"), text.to_owned()))
    }

    fn names(&self) -> Vec<String> {
        names().map(str::to_owned).collect()
    }
}

/// Reads a graph: the file of that name if it exists, else the graph of that name that comes with the program. Graphs
/// that it names itself, as parts or as its base, are found in the same way. Changes may follow the name, each after a
/// plus:
///
/// | name | graph |
/// |---|---|
/// | `epi+interpolate.sigma=0.5` | with this parameter |
/// | `epi+sigma=0.5` | the same, as only one node has such a parameter |
/// | `epi+swap:interpolate=mine.wgsl` | with a shader file, a kind or a graph file in the place of a node |
/// | `epi+insert:tonemap.color=median.wgsl` | with a new node in the wire to an input |
/// | `epi+wire:tonemap.color=spread.color` | with an input connected to another port, or to `none` |
///
/// Paths in them start at the current folder. `registry` has the stages.
///
/// # Errors
/// The problems of the file and of the changes. If there is neither a file nor a shipped graph, a single word gives
/// [`GraphError::Unknown`] with [`UNKNOWN`].
pub fn load(name: &str, registry: &Registry) -> Result<GraphFile, Problems> {
    load_with(name, &[], registry)
}

/// The same, with further changes: those of the name win.
///
/// # Errors
/// Those of [`load`].
pub fn load_with(name: &str, changes: &[Change], registry: &Registry) -> Result<GraphFile, Problems> {
    let (base, own) = split(name)?;
    changed(load_file(base)?, changes.iter().chain(&own), registry)
}

fn load_file(name: &str) -> Result<GraphFile, Problems> {
    let path = Path::new(name);
    if let (false, Some((path, text))) = (path.is_file(), Shipped.shipped(name)) {
        let mut file = GraphFile::parse(&path, &text)?;
        file.origin = Origin::Shipped;
        return file.with_parts(&Shipped);
    }
    GraphFile::load_with(path, &Shipped).map_err(|mut problems| {
        // A single word is probably a mistyped name rather than a path.
        if !path.exists()
            && !name.contains(['/', '\\', '.'])
            && let Some(problem) = problems.0.first_mut()
        {
            problem.error = GraphError::unknown(UNKNOWN, name, names());
            problem.place = None;
        }
        problems
    })
}
