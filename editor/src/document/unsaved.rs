//! Texts and places that no file holds yet.

use super::{Document, Places, Tag};

impl Document {
    /// The files whose texts are not saved, with these.
    pub fn unsaved(&self) -> impl Iterator<Item = (&str, &str)> {
        let differs = |path: &&str| self.contents.texts.get(*path) != self.saved.texts.get(*path);
        self.paths().filter(differs).map(|path| (path, self.text(path)))
    }

    /// Where the boxes of the canvas stand, if that is not saved.
    pub fn unsaved_places(&self) -> Option<&Places> {
        (self.contents.places != self.saved.places).then_some(&self.contents.places)
    }

    /// Gives files of the document other texts, and the boxes other places if there are any, as one change.
    pub fn take_over(&mut self, replaced: Vec<(String, String)>, places: Option<Places>) {
        let mut texts = self.contents.texts.clone();
        for (path, text) in replaced {
            texts.insert(path, text.into());
        }
        let places = places.unwrap_or_else(|| Places::clone(&self.contents.places));
        self.change(Tag::Once, texts, places);
    }
}
