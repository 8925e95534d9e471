//! Copying a graph to another path, so that it still refers to the same files.

use std::{fs, path::Path};

use epigraph::graphs::Shipped;
use epigraph_core::{
    Changes, GraphError, GraphFile, NodeDef, Origin, ParamDef, Place, Problem, Problems, Span, Spanned,
    handed, moved_path, names_file, relative,
};

use super::{Contents, Document, Places, places, refused, write};

impl Document {
    /// Writes a copy of a graph file, which refers to the same files, to another path and opens it.
    ///
    /// # Errors
    /// The graph has problems, the file exists already, or it cannot be written.
    pub fn copy(source: &Path, path: &Path) -> Result<Self, Problems> {
        let text = moved(&GraphFile::load_with(source, &Shipped)?, path);
        require_new(path)?;
        write(path, &text)?;
        // An unusable layout is not copied.
        if let Ok((_, found)) = places::read(&source.display().to_string()) {
            write_places(path, &found)?;
        }
        Self::open(path)
    }

    /// Writes a graph file that has `base` as its base and no changes yet, and opens it.
    ///
    /// # Errors
    /// The base has problems, the file exists already, or it cannot be written.
    pub fn new_change(base: &Path, path: &Path) -> Result<Self, Problems> {
        GraphFile::load_with(base, &Shipped)?.whole()?;
        require_new(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let leads = relative(folder, base).display().to_string().replace('\\', "/");
        write(path, &format!("Graph(\n    version: 1,\n    base: {leads:?},\n)\n"))?;
        if let Ok((_, found)) = places::read(&base.display().to_string()) {
            write_places(path, &found)?;
        }
        Self::open(path)
    }

    /// Saves the graph to another path, from where it refers to the same files, and continues with the new file. If the
    /// folder is the same, earlier changes can still be undone.
    ///
    /// # Errors
    /// The file cannot be written; or the folder is a different one, and parts have unsaved changes or the text has
    /// problems, so that its file names cannot be adapted. The document then stays as it was.
    pub fn save_as(&mut self, path: &Path) -> Result<(), Problems> {
        let name = path.display().to_string();
        let folder = |path: &Path| {
            fs::canonicalize(path.parent().filter(|p| *p != Path::new("")).unwrap_or(Path::new(".")))
        };
        let beside = folder(path).ok() == folder(Path::new(&self.path)).ok();
        if beside {
            let text = self.text(&self.path).to_owned();
            write(path, &text)?;
            write_places(path, &self.contents.places)?;
            let old = std::mem::replace(&mut self.path, name);
            let rename = |contents: &mut Contents| {
                if let Some(text) = contents.texts.remove(&old) {
                    contents.texts.insert(self.path.clone(), text);
                }
            };
            let mut present = self.contents.clone();
            self.past.iter_mut().chain(&mut self.future).chain([&mut present]).for_each(rename);
            self.saved.texts.remove(&old);
            self.saved.texts.insert(self.path.clone(), text.into());
            self.saved.places = self.contents.places.clone();
            self.layout = epigraph_files::text(Path::new(&self.layout_path())).ok().map(Into::into);
            self.theirs.clear();
            self.restore(present);
            return Ok(());
        }
        let (Some(file), []) = (&self.file, self.problems.as_slice()) else {
            return Err(refused("the text has problems; fix them before you save it in another folder"));
        };
        let unsaved = |part: &&str| self.contents.texts.get(*part) != self.saved.texts.get(*part);
        if let Some(part) = self.paths().skip(1).find(unsaved) {
            return Err(refused(&format!("{part} has unsaved changes; save first")));
        }
        write(path, &moved(file, path))?;
        write_places(path, &self.contents.places)?;
        let revision = self.revision;
        let sources = self.sources.clone();
        *self = Self::open(path)?;
        self.use_sources(sources);
        self.revision = revision + 1;
        Ok(())
    }
}

/// Reports a file that exists.
fn require_new(path: &Path) -> Result<(), Problems> {
    if !path.exists() {
        return Ok(());
    }
    let cause = "the file exists already; choose another name";
    let error = GraphError::Io { action: "write", cause: cause.into() };
    Err(Problem::new(error).at(Place::file(&path.display().to_string())).into())
}

/// Writes the layout of a graph, unless it is empty.
fn write_places(graph: &Path, places: &Places) -> Result<(), Problems> {
    let graph = graph.display().to_string();
    if places.is_empty() { Ok(()) } else { write(&places::layout_path(&graph), &places::write(places, None)) }
}

/// The text of a graph for a file at `path`, with file names adapted to that folder.
fn moved(file: &GraphFile, path: &Path) -> String {
    let folder = |path: &Path| path.parent().unwrap_or(Path::new("")).to_owned();
    let (from, to) = (folder(Path::new(&file.path)), folder(path));
    let changes = file.base.as_ref();
    let (replaced, parts) = changes.map_or((&[][..], &[][..]), |changes| (&changes.replace, &changes.parts));
    // A graph that comes with the program has no path.
    let is_shipped = |node: &NodeDef| {
        let mut parts = file.parts.iter().chain(parts);
        parts.any(|(part, graph)| *part == node.name.value && graph.origin == Origin::Shipped)
    };
    let mut names: Vec<&Spanned<String>> = Vec::new();
    for node in file.nodes.iter().chain(replaced) {
        if !is_shipped(node) {
            names.extend(files(node).map(|def| &def.value));
        }
    }
    // What is set for a node elsewhere is a shader: the file of a part cannot be set so.
    let set = file.nodes.iter().chain(replaced).flat_map(|node| &node.set);
    for (_, params) in set.chain(changes.into_iter().flat_map(|changes| &changes.set)) {
        names.extend(params.iter().filter(|def| names_file("wgsl", &def.name.value)).map(|def| &def.value));
    }
    // A parameter of the graph that names a file does so in its default.
    let whole = file.whole();
    let nodes = whole.as_ref().map_or(&file.nodes, |whole| &whole.nodes);
    let handed = nodes.iter().flat_map(files).filter_map(|def| handed(&def.value.value));
    names.extend(handed.filter_map(|name| file.param(&name)).map(|param| &param.default));

    let mut moved: Vec<(Span, String)> =
        names.iter().filter_map(|name| Some((name.span, moved_path(&name.value, &from, &to)?))).collect();
    if let Some(changes) = changes.filter(|changes| is_file(changes)) {
        let base = format!("{:?}", changes.base.value);
        moved.extend(moved_path(&base, &from, &to).map(|text| (changes.base.span, text)));
    }
    // Replace from the end, so that the earlier spans stay valid; each once.
    moved.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    moved.dedup_by_key(|(span, _)| span.start);
    let mut text = file.text.clone();
    for (span, leads) in moved {
        text.replace_range(span.start..span.end, &leads);
    }
    text
}

/// The parameters of a node that name files.
fn files(node: &NodeDef) -> impl Iterator<Item = &ParamDef> {
    let kind = &node.kind.value;
    node.params.iter().filter(move |def| names_file(kind, &def.name.value))
}

/// Whether the base is a file, which has a path; not a graph that comes with the program.
fn is_file(changes: &Changes) -> bool {
    changes.graph.as_ref().is_some_and(|base| base.origin == Origin::File)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_parameters_name_stay_the_same() {
        let text = r#"Graph(
            version: 1,
            params: { "look": (default: "a.wgsl") },
            nodes: {
                "a": (kind: "wgsl", params: (shader: Param("look"))),
                "b": (kind: "wgsl", params: (shader: Param("look"))),
                "c": (kind: "graph", params: (file: "part.ron"), set: { "d": (shader: "b.wgsl", size: 3) }),
            },
            outputs: {},
        )"#;
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("deep");
        fs::create_dir(&deep).unwrap();
        for name in ["a.wgsl", "part.ron", "b.wgsl"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let file = GraphFile::parse(&folder.path().join("old.ron").display().to_string(), text).unwrap();
        let wanted = ["a.wgsl", "part.ron", "b.wgsl"]
            .iter()
            .fold(text.to_owned(), |text, name| text.replace(&format!("\"{name}"), &format!("\"../{name}")));
        assert_eq!(moved(&file, &deep.join("new.ron")), wanted);
    }

    #[test]
    fn a_copy_in_another_folder_is_the_same_graph() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.ron");
        let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
        let copy = Document::copy(&graphs.join("epi.ron"), &path).unwrap();
        assert_eq!(copy.problems(), []);
        let parts = copy.file().unwrap().parts.len();
        assert!(parts > 1 && !copy.is_dirty());
        let kept = |text: &str| {
            text.lines().filter(|line| !line.contains("file:")).map(str::to_owned).collect::<Vec<_>>()
        };
        let source = fs::read_to_string(graphs.join("epi.ron")).unwrap();
        assert_eq!(kept(copy.text(copy.path())), kept(&source));
        assert!(Document::copy(&graphs.join("epi.ron"), &path).is_err(), "the file exists already");
    }

    #[test]
    fn saving_under_another_name_keeps_undo_and_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let old = folder.path().join("a.ron");
        let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
        let mut document = Document::copy(&graphs.join("render-cache.ron"), &old).unwrap();
        let before = document.text(document.path()).to_owned();
        let path = document.path().to_owned();
        document.type_text(&path, &format!("{before}// more\n"));
        let new = folder.path().join("b.ron");
        document.save_as(&new).unwrap();
        assert_eq!(fs::read_to_string(&old).unwrap(), before);
        assert_eq!(fs::read_to_string(&new).unwrap(), format!("{before}// more\n"));
        assert!(!document.is_dirty() && document.path().ends_with("b.ron"));
        document.undo();
        assert_eq!(document.text(document.path()), before);
        fs::create_dir(folder.path().join("deep")).unwrap();
        document.save_as(&folder.path().join("deep/c.ron")).unwrap();
        assert_eq!(document.problems(), []);
        assert!(document.text(document.path()).contains("file: \"../"), "{}", document.text(document.path()));
    }
}
