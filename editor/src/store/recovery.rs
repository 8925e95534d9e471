//! Recovery of unsaved changes after the program ended or crashed.

use std::{path::PathBuf, sync::Arc};

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
}

/// Identifies a state of a document.
#[derive(PartialEq)]
pub(super) struct Kept {
    revision: u64,
    places: Arc<Places>,
    path: String,
}

impl Kept {
    fn of(document: &Document) -> Self {
        Self {
            revision: document.revision(),
            places: document.places().clone(),
            path: document.path().to_owned(),
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
        // FNV-1a makes a file name of a path of any length with any characters.
        let hash = real(path).bytes().fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
        });
        self.folder.join(format!("unsaved-{hash:016x}.ron"))
    }
}

impl Recovery {
    fn of(document: &Document) -> Self {
        Self {
            graph: real(document.path()),
            texts: document.unsaved().map(|(path, text)| (real(path), text.to_owned())).collect(),
            places: document.unsaved_places().cloned(),
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

    /// Applies the changes to the document, as one step.
    pub fn take_over(self, document: &mut Document) {
        let paths: Vec<String> = document.paths().map(Into::into).collect();
        let texts = paths.into_iter().filter_map(|path| {
            let (_, text) = self.texts.iter().find(|(of, _)| *of == real(&path))?;
            Some((path, text.clone()))
        });
        document.take_over(texts.collect(), self.places);
    }
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
}
