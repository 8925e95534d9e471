//! The render graphs that come with Epigraph as text: `NAME.ron` is a graph, `parts/NAME.ron` a file that graphs are
//! made of. The experiments and the peers are left out.
//!
//! ```
//! assert!(epigraph_graphs::text("epi.ron").is_some());
//! ```

/// The path of each file within this folder, and its text; in alphabetical order of the paths.
pub const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/files.rs"));

/// The text of a file by its path within this folder.
pub fn text(path: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == path).map(|(_, text)| *text)
}

/// The names of the graphs: what is embedded but for the parts, without `.ron`.
pub fn names() -> impl Iterator<Item = &'static str> {
    FILES.iter().filter(|(path, _)| !path.contains('/')).filter_map(|(path, _)| path.strip_suffix(".ron"))
}
