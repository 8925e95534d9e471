//! Texts and box positions that are not saved yet.

use super::{Document, Places, Tag};

impl Document {
    /// Paths and texts of the files with unsaved changes.
    pub fn unsaved(&self) -> impl Iterator<Item = (&str, &str)> {
        let differs = |path: &&str| self.contents.texts.get(*path) != self.saved.texts.get(*path);
        self.paths().filter(differs).map(|path| (path, self.text(path)))
    }

    /// Positions of the canvas's boxes, if they have unsaved changes.
    pub fn unsaved_places(&self) -> Option<&Places> {
        (self.contents.places != self.saved.places).then_some(&self.contents.places)
    }

    /// Restores texts of the document's files, and the box positions if given. Consecutive calls are one change, which
    /// [`Document::seal`] ends.
    pub fn restore_unsaved(&mut self, replaced: Vec<(String, String)>, places: Option<Places>) {
        let mut texts = self.contents.texts.clone();
        for (path, text) in replaced {
            texts.insert(path, text.into());
        }
        let places = places.unwrap_or_else(|| Places::clone(&self.contents.places));
        self.change(Tag::Recovery, texts, places);
    }
}
