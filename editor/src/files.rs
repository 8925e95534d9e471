//! Files that dialogs offer, and paths from one graph file to another.

use std::{
    fs,
    path::{Component, Path, PathBuf},
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

/// A path without its folders; a name unchanged.
pub fn short(text: &str) -> &str {
    Path::new(text).file_name().and_then(|name| name.to_str()).unwrap_or(text)
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

/// Graphs that come with the program, then those beside `open`, without duplicates.
pub fn graphs(open: &Path) -> Vec<Choice> {
    let beside = open.parent().map(Path::to_owned);
    let mut files: Vec<PathBuf> =
        shipped_folder().into_iter().chain(beside).flat_map(|folder| in_folder(&folder)).collect();
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
        let graph = GraphFile::parse(&name, &fs::read_to_string(&file).ok()?).ok()?;
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

/// The relative path from a folder to a file; absolute if there is none.
pub fn relative(folder: &Path, file: &Path) -> PathBuf {
    let real = |path: &Path| {
        let path = if path == Path::new("") { Path::new(".") } else { path };
        path.canonicalize().unwrap_or_else(|_| path.to_owned())
    };
    let (folder, file) = (real(folder), real(file));
    let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    if !matches!(folder.components().next(), Some(Component::Prefix(_) | Component::RootDir)) || common == 0 {
        return file;
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    up.chain(file.components().skip(common)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_paths_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        fs::create_dir_all(root.join("a/b")).unwrap();
        fs::create_dir_all(root.join("c")).unwrap();
        fs::write(root.join("c/x.ron"), "").unwrap();
        assert_eq!(relative(&root.join("a/b"), &root.join("c/x.ron")), Path::new("../../c/x.ron"));
        assert_eq!(relative(&root.join("c"), &root.join("c/x.ron")), Path::new("x.ron"));
    }

    #[test]
    fn shipped_graphs_and_scenes_are_offered_once() {
        let offered = graphs(Path::new("../graphs/epi.ron"));
        let epi: Vec<_> = offered.iter().filter(|choice| choice.text.ends_with("epi.ron")).collect();
        assert_eq!(epi.len(), 1, "{offered:?}");
        assert!(epi[0].doc.starts_with("Edge-and-point image"));
        assert!(scenes().iter().any(|choice| choice.text == "cornell" && !choice.doc.is_empty()));
        assert_eq!(find_graph("epi"), Path::new(&epi[0].text));
        assert_eq!(find_graph("no-such"), Path::new("no-such"));
    }
}
