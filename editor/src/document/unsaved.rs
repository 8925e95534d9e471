//! Texts that no file holds yet.

use super::{Document, Tag};

impl Document {
    /// The files whose texts are not saved, with these.
    pub fn unsaved(&self) -> impl Iterator<Item = (&str, &str)> {
        let differs = |path: &&str| self.contents.texts.get(*path) != self.saved.texts.get(*path);
        self.paths().filter(differs).map(|path| (path, self.text(path)))
    }

    /// Gives files of the document other texts, as one change.
    pub fn replace_texts(&mut self, replaced: Vec<(String, String)>) {
        let mut texts = self.contents.texts.clone();
        for (path, text) in replaced {
            texts.insert(path, text.into());
        }
        self.change_texts(Tag::Once, texts);
    }
}
