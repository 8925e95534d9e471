//! Recovery of unsaved changes after the program ended or crashed.

use std::{collections::BTreeMap, path::PathBuf, sync::Arc};

use serde::{Deserialize, Serialize};

use super::{Store, real, text};
use crate::{
    document::{Document, Places, places},
    files::short,
};

/// The unsaved changes of a graph and its parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recovery {
    /// The graph's file.
    pub graph: String,
    /// Files and their texts.
    pub texts: Vec<(String, String)>,
    /// Positions of the canvas's boxes; `None` if they are saved.
    #[serde(default)]
    pub places: Option<Places>,
    /// Hashes of the texts that the changes were made to, by file. Files that have other texts now have been changed by
    /// another program.
    #[serde(default)]
    pub bases: BTreeMap<String, u64>,
}

/// Identifies a state of a document.
#[derive(PartialEq)]
pub(super) struct Kept {
    revision: u64,
    places: Arc<Places>,
    path: String,
    bases: BTreeMap<String, u64>,
}

impl Kept {
    fn of(document: &Document) -> Self {
        Self {
            revision: document.revision(),
            places: document.places().clone(),
            path: document.path().to_owned(),
            bases: bases(document),
        }
    }
}

impl Store {
    /// Keeps the unsaved changes of a document, and deletes them once it is saved; does nothing while neither has
    /// changed.
    pub fn keep_unsaved(&mut self, document: &Document) {
        if !document.is_dirty() {
            if let Some(kept) = self.kept.take() {
                self.keeper.remove(self.recovery_file(&kept.path));
            }
            return;
        }
        let now = Kept::of(document);
        if self.kept.as_ref() != Some(&now) {
            if let Ok(text) = text(&Recovery::of(document)) {
                self.keeper.write(self.recovery_file(document.path()), text);
            }
            self.kept = Some(now);
        }
    }

    /// Another document is open from now on: the previous one's unsaved changes stay.
    pub fn change_document(&mut self) {
        self.kept = None;
    }

    /// The unsaved changes of a document when it was last open, if they differ from its current contents.
    pub fn recovery(&self, document: &Document) -> Option<Recovery> {
        let name = self.recovery_file(document.path());
        let recovery: Recovery = self.read(name.file_name()?.to_str()?).ok()??;
        let is_sound = recovery.graph == real(document.path())
            && recovery.places.as_ref().is_none_or(places::are_finite);
        (is_sound && recovery.differs_from(document)).then_some(recovery)
    }

    /// Deletes the unsaved changes.
    pub fn discard(&mut self, document: &Document) {
        self.keeper.remove(self.recovery_file(document.path()));
    }

    fn recovery_file(&self, path: &str) -> PathBuf {
        // A hash makes a file name of a path of any length with any characters.
        self.folder.join(format!("unsaved-{:016x}.ron", hash(&real(path))))
    }
}

impl Recovery {
    fn of(document: &Document) -> Self {
        Self {
            graph: real(document.path()),
            texts: document.unsaved().map(|(path, text)| (real(path), text.to_owned())).collect(),
            places: document.unsaved_places().cloned(),
            bases: bases(document),
        }
    }

    fn differs_from(&self, document: &Document) -> bool {
        let text =
            |path: &str| self.texts.iter().any(|(of, text)| *of == real(path) && document.text(path) != text);
        // Compare positions as written to a file, which holds whole points: the program may have crashed after saving.
        let written = |places: &Places| places::write(places, None);
        document.paths().any(text)
            || self.places.as_ref().is_some_and(|places| written(places) != written(document.places()))
    }

    /// A description of the changes, as the beginning of a sentence.
    pub fn what(&self) -> String {
        let name = short(&self.graph);
        match self.texts.len() {
            0 => format!("{name} had unsaved box positions"),
            1 => format!("{name} had unsaved changes"),
            files => format!("{name} and its parts ({files} files) had unsaved changes"),
        }
    }

    /// The files of the document that another program has changed since the changes were made.
    pub fn changed_since(&self, document: &Document) -> Vec<String> {
        let changed = |(path, [file, unsaved]): (String, [String; 2])| {
            let of_same = self.bases.get(&real(&path)) == Some(&hash(&file));
            (!of_same && file != unsaved).then_some(path)
        };
        self.compared(document).into_iter().filter_map(changed).collect()
    }

    /// The files of the document that have unsaved changes: their paths, their texts, and the texts with the changes.
    pub fn compared(&self, document: &Document) -> Vec<(String, [String; 2])> {
        let layout = document.layout_path();
        let in_file = |path: &str| document.on_disk(path).unwrap_or_default().to_owned();
        let texts = document.paths().filter_map(|path| {
            let (_, text) = self.texts.iter().find(|(of, _)| *of == real(path))?;
            Some((path.to_owned(), [in_file(path), text.clone()]))
        });
        let places = self.places.iter().map(|moved| places::write(moved, None));
        texts.chain(places.map(|text| (layout.clone(), [in_file(&layout), text]))).collect()
    }

    /// Applies the changes to the document, as one step.
    pub fn take_over(self, document: &mut Document) {
        let (mut left, mut places) = (self.texts, self.places);
        loop {
            // A text may name files that the document did not hold before.
            let (mut texts, before) = (Vec::new(), left.len());
            for path in document.paths() {
                let real = real(path);
                if let Some(found) = left.iter().position(|(of, _)| *of == real) {
                    texts.push((path.to_owned(), left.swap_remove(found).1));
                }
            }
            if texts.is_empty() && places.is_none() {
                break;
            }
            document.restore_unsaved(texts, places.take());
            if left.len() == before {
                break;
            }
        }
        document.seal();
    }
}

/// Hashes of the texts that the unsaved changes were made to, by file.
fn bases(document: &Document) -> BTreeMap<String, u64> {
    let texts = document.unsaved().map(|(path, _)| path.to_owned());
    let layout = document.unsaved_places().map(|_| document.layout_path());
    let hashed = |path: String| (real(&path), hash(document.on_disk(&path).unwrap_or_default()));
    texts.chain(layout).map(hashed).collect()
}

/// FNV-1a.
fn hash(text: &str) -> u64 {
    text.bytes()
        .fold(0xCBF2_9CE4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3))
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::*;
    use crate::document::Tag;

    /// A folder with a graph, and its document.
    fn document() -> (tempfile::TempDir, Document) {
        let folder = tempfile::tempdir().unwrap();
        let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/render-cache.ron");
        let document = Document::copy(&graph, &folder.path().join("mine.ron")).unwrap();
        (folder, document)
    }

    fn again(document: &Document) -> Document {
        Document::open(Path::new(document.path())).unwrap()
    }

    fn put(document: &mut Document, node: &str, at: [f32; 2]) {
        document.place(Tag::Once, |places| {
            places.insert(node.into(), at);
        });
    }

    #[test]
    fn moved_boxes_are_restored_as_one_change_with_the_texts() {
        let (folder, mut document) = document();
        let mut store = Store::at(folder.path().join("kept"));
        put(&mut document, "fill", [10.0, 20.0]);
        store.keep_unsaved(&document);
        store.flush();
        let recovery = store.recovery(&again(&document)).unwrap();
        assert!(recovery.texts.is_empty() && recovery.what().contains("box positions"), "{recovery:?}");

        // Another move is kept too, although the graph's texts are unchanged.
        put(&mut document, "fill", [30.0, 40.25]);
        let path = document.path().to_owned();
        let typed = format!("{}// more\n", document.text(&path));
        store.keep_unsaved(&document);
        document.type_text(&path, &typed);
        store.keep_unsaved(&document);
        store.flush();
        let mut opened = again(&document);
        let before = opened.text(&path).to_owned();
        store.recovery(&opened).unwrap().take_over(&mut opened);
        assert_eq!((opened.places(), opened.text(&path)), (document.places(), typed.as_str()));
        opened.undo();
        assert!(opened.places().is_empty() && opened.text(&path) == before && !opened.can_undo());

        // What is saved is not what another program has changed.
        assert_eq!(store.recovery(&again(&document)).unwrap().changed_since(&again(&document)), [""; 0]);

        // Saved changes are not offered, even if the program ends before it deletes them.
        document.save().unwrap();
        assert_eq!(store.recovery(&again(&document)), None);
        store.keep_unsaved(&document);
        store.flush();
        assert!(!store.recovery_file(&path).exists());
    }

    #[test]
    fn files_without_positions_are_read_and_infinite_positions_are_rejected() {
        let (folder, document) = document();
        let store = Store::at(folder.path().to_owned());
        let file = store.recovery_file(document.path());
        let graph = real(document.path());
        fs::write(&file, format!("(graph: {graph:?}, texts: [({graph:?}, \"Graph(\")])")).unwrap();
        let recovery = store.recovery(&document).unwrap();
        assert_eq!((recovery.texts.len(), recovery.places), (1, None));
        let with = |at: &str| {
            let text = format!("(graph: {graph:?}, texts: [], places: Some({{\"fill\": ({at}, 2.0)}}))");
            fs::write(&file, text).unwrap();
            store.recovery(&document)
        };
        assert!(with("1.0").is_some());
        assert_eq!(with("inf"), None);
    }

    #[test]
    fn files_that_another_program_has_changed_since_are_named() {
        let (folder, mut document) = document();
        let mut store = Store::at(folder.path().join("kept"));
        let path = document.path().to_owned();
        let saved = document.text(&path).to_owned();
        let part = document.paths().find(|path| path.ends_with("view.ron")).unwrap().to_owned();
        let (mine, theirs) = (format!("{saved}// mine\n"), format!("{saved}// theirs\n"));
        document.type_text(&path, &mine);
        put(&mut document, "fill", [10.0, 20.0]);
        store.keep_unsaved(&document);
        store.flush();
        let changed = || {
            let opened = again(&document);
            let recovery = store.recovery(&opened).unwrap();
            recovery.changed_since(&opened).iter().map(|path| short(path).to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(changed(), [""; 0]);
        assert_ne!(short(&part), "mine.ron");
        fs::write(&path, &theirs).unwrap();
        assert_eq!(changed(), ["mine.ron"]);
        let layout = folder.path().join("mine.layout.ron");
        fs::write(&layout, "Layout(version: 1, nodes: {\"fill\": (1, 2)})").unwrap();
        assert_eq!(changed(), ["mine.ron", "mine.layout.ron"]);
        // The same text by another program is no difference.
        fs::write(&path, &mine).unwrap();
        assert_eq!(changed(), ["mine.layout.ron"]);
        fs::write(&path, &theirs).unwrap();

        // Nothing is written until the user decides, and then as the user decides.
        let mut opened = again(&document);
        let recovery = store.recovery(&opened).unwrap();
        let compared = recovery.compared(&opened);
        assert_eq!(compared[0], (path.clone(), [theirs.clone(), mine.clone()]));
        recovery.take_over(&mut opened);
        assert_eq!(fs::read_to_string(&path).unwrap(), theirs);
        opened.save().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), mine);
        opened.undo();
        assert_eq!((opened.text(&path), opened.places()["fill"]), (&*theirs, [1.0, 2.0]));

        // A file without hashes says nothing of the text that it was made to.
        let file = store.recovery_file(&path);
        let kept = fs::read_to_string(&file).unwrap();
        let without = kept[..kept.find("bases").unwrap()].trim_end().to_owned() + ")";
        fs::write(&file, without).unwrap();
        fs::write(&path, &saved).unwrap();
        let names = store.recovery(&again(&document)).unwrap().changed_since(&again(&document));
        assert!(names.contains(&path), "{names:?}");
    }

    #[test]
    fn texts_of_files_that_only_the_unsaved_text_names_come_back_in_the_same_step() {
        let (folder, mut document) = document();
        let mut store = Store::at(folder.path().join("kept"));
        let path = document.path().to_owned();
        let saved = document.text(&path).to_owned();
        fs::write(folder.path().join("part.ron"), "Graph(version: 1, nodes: {}, outputs: {})").unwrap();
        let more = r#"nodes: { "more": (kind: "graph", params: (file: "part.ron")),"#;
        document.type_text(&path, &saved.replacen("nodes: {", more, 1));
        assert_eq!(document.problems(), []);
        let part = document.paths().find(|path| path.ends_with("part.ron")).unwrap().to_owned();
        document.type_text(&part, "Graph(version: 1, nodes: {}, outputs: {}) // mine");
        store.keep_unsaved(&document);
        store.flush();
        let mut opened = again(&document);
        assert!(opened.paths().all(|path| !path.ends_with("part.ron")));
        store.recovery(&opened).unwrap().take_over(&mut opened);
        assert!(opened.text(&part).ends_with("// mine") && opened.text(&path) == document.text(&path));
        opened.undo();
        assert!(opened.text(&path) == saved && !opened.can_undo());
    }
}
