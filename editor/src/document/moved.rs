//! Copying a graph to another path, so that it still refers to the same files.

use std::{fs, path::Path};

use epigraph_core::{GraphError, GraphFile, Place, Problem, Problems, handed};

use super::{Contents, Document, Places, places, write};
use crate::files::relative;

/// Kinds of stage that name a file, and the parameter that holds the name.
const REFERENCES: [(&str, &str); 2] = [("graph", "file"), ("wgsl", "shader")];

impl Document {
    /// Writes a copy of a graph file, which refers to the same files, to another path and opens it.
    ///
    /// # Errors
    /// The graph has problems, the file exists already, or it cannot be written.
    pub fn copy(source: &Path, path: &Path) -> Result<Self, Problems> {
        let text = moved(&GraphFile::load(source)?, path);
        if path.exists() {
            let cause = "the file exists already; choose another name";
            let error = GraphError::Io { action: "write", cause: cause.into() };
            return Err(Problem::new(error).at(Place::file(&path.display().to_string())).into());
        }
        write(path, &text)?;
        // An unusable layout is not copied.
        if let Ok(found) = places::read(&source.display().to_string()) {
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

fn refused(why: &str) -> Problems {
    Problem::new(GraphError::Invalid(why.into())).into()
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
    let mut names = Vec::new();
    for node in &file.nodes {
        for (_, param) in REFERENCES.iter().filter(|(kind, _)| node.kind.value == *kind) {
            names.extend(node.params.iter().filter(|def| def.name.value == *param).map(|def| &def.value));
        }
        let set = node.set.iter().flat_map(|(_, params)| params);
        let is_file = |name: &str| REFERENCES.iter().any(|(_, param)| name == *param);
        names.extend(set.filter(|def| is_file(&def.name.value)).map(|def| &def.value));
    }
    // A parameter of the graph that names a file does so in its default.
    let default = |name: &String| file.param(name).map(|param| &param.default);
    let defaults: Vec<_> = names.iter().filter_map(|name| default(&handed(&name.value)?)).collect();
    names.extend(defaults);
    // Replace from the end, so that the earlier spans stay valid; each once.
    names.sort_by_key(|name| std::cmp::Reverse(name.span.start));
    names.dedup_by_key(|name| name.span.start);
    let mut text = file.text.clone();
    for name in names {
        if let Ok(named) = ron::from_str::<String>(&name.value) {
            let leads = relative(&to, &from.join(&named)).display().to_string().replace('\\', "/");
            if leads != named {
                text.replace_range(name.span.start..name.span.end, &format!("{leads:?}"));
            }
        }
    }
    text
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
