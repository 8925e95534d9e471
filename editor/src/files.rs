//! Files that dialogs offer, and paths from one graph file to another.

use std::{
    fs,
    path::{Path, PathBuf},
};

use epigraph_core::GraphFile;

/// The extension of files of recorded paths, as dialogs suggest it.
pub const PATH_ENDING: &str = ".path.ron";

/// A file or a name to choose.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The text for the field.
    pub text: String,
    /// Its description, in one line.
    pub doc: String,
}

/// A path without its folders; a name unchanged. Changes that follow a graph's path stay.
pub fn short(text: &str) -> &str {
    let path = text.find(" +").map_or(text, |changes| &text[..changes]);
    let name = Path::new(path).file_name().and_then(|name| name.to_str()).unwrap_or(path);
    &text[path.len() - name.len()..]
}

/// The folder of the graphs that come with the program: `graphs` here or in a folder above.
pub fn shipped_folder() -> Option<PathBuf> {
    let here = std::env::current_dir().ok()?;
    let found = here.ancestors().map(|folder| folder.join("graphs")).find(|folder| folder.is_dir())?;
    Some(found.strip_prefix(&here).map(Path::to_owned).unwrap_or(found))
}

/// The file at this path, or else the shipped graph of this name.
pub fn find_graph(name: &str) -> PathBuf {
    let path = PathBuf::from(name);
    let shipped = shipped_folder().map(|folder| folder.join(format!("{name}.ron")));
    shipped.filter(|shipped| !path.is_file() && shipped.is_file()).unwrap_or(path)
}

/// Graphs that come with the program, those beside `open`, and experiments, without duplicates.
pub fn graphs(open: &Path) -> Vec<Choice> {
    let beside = open.parent().map(Path::to_owned);
    let experiments = shipped_folder().map(|folder| folder.join("experiments"));
    let folders = shipped_folder().into_iter().chain(beside).chain(experiments);
    let mut files: Vec<PathBuf> = folders.flat_map(|folder| in_folder(&folder)).collect();
    let mut seen = Vec::new();
    files.retain(|file| {
        let real = file.canonicalize().unwrap_or_else(|_| file.clone());
        let new = !seen.contains(&real);
        seen.push(real);
        new
    });
    let choice = |file: PathBuf| {
        let name = file.display().to_string();
        // Files that are not graphs are not offered.
        let graph = GraphFile::parse(&name, &epigraph_files::text(&file).ok()?).ok()?;
        Some(Choice { text: name, doc: graph.doc })
    };
    files.into_iter().filter_map(choice).collect()
}

/// Files of recorded paths in the current folder.
pub fn paths() -> Vec<Choice> {
    let files = in_folder(Path::new(".")).into_iter();
    let files = files.filter_map(|file| Some(file.file_name()?.to_string_lossy().into_owned()));
    files.filter(|name| name.ends_with(PATH_ENDING)).map(|text| Choice { text, doc: String::new() }).collect()
}

/// Scenes that come with the program.
pub fn scenes() -> Vec<Choice> {
    let choice = |scene: &epigraph_scenes::SceneInfo| {
        let fetch =
            if scene.needs_fetch { format!(" (first: scenes/fetch {})", scene.name) } else { String::new() };
        Choice { text: scene.name.into(), doc: format!("{}{fetch}", scene.doc) }
    };
    epigraph_scenes::scene_names().iter().map(choice).collect()
}

/// The files `*.ron` of a folder, sorted.
fn in_folder(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok).map(|entry| entry.path());
    let mut files: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|ending| ending == "ron")).collect();
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shipped_graphs_and_scenes_are_offered_once() {
        let offered = graphs(Path::new("../graphs/epi.ron"));
        let epi: Vec<_> = offered.iter().filter(|choice| choice.text.ends_with("epi.ron")).collect();
        assert_eq!(epi.len(), 1, "{offered:?}");
        assert!(epi[0].doc.starts_with("Edge-and-point image"));
        assert_eq!(offered.iter().filter(|choice| choice.text.ends_with("experiments/blur.ron")).count(), 1);
        assert!(scenes().iter().any(|choice| choice.text == "cornell" && !choice.doc.is_empty()));
        assert_eq!(
            [short("a/b.ron"), short("b"), short("a/b.ron +c/d.e=0.5")],
            ["b.ron", "b", "b.ron +c/d.e=0.5"]
        );
        assert_eq!(find_graph("epi"), Path::new(&epi[0].text));
        assert_eq!(find_graph("no-such"), Path::new("no-such"));
    }
}
