//! Files that another program has changed while they have unsaved changes.

use std::{path::Path, sync::Arc};

use super::{Document, Places, Tag, places};

impl Document {
    /// The files with unsaved changes that another program has changed since they were read, and their texts there; as of
    /// the last [`Document::refresh`] or [`Document::save`].
    pub fn conflicts(&self) -> impl Iterator<Item = (&str, &str)> {
        self.theirs.iter().map(|(path, text)| (path.as_str(), &**text))
    }

    /// The text of a file or of the layout, as it would be saved.
    pub fn mine(&self, path: &str) -> String {
        match path == self.layout_path() {
            true => places::write(&self.contents.places, self.whole.as_deref()),
            false => self.text(path).to_owned(),
        }
    }

    /// The text of a file or of the layout as last read or written; `None` if there was no file.
    pub fn on_disk(&self, path: &str) -> Option<&str> {
        match path == self.layout_path() {
            true => self.layout.as_deref(),
            false => self.saved.texts.get(path).map(|text| &**text),
        }
    }

    /// The path of the file with the positions of the boxes.
    pub fn layout_path(&self) -> String {
        places::layout_path(&self.path).display().to_string()
    }

    /// Keeps the unsaved changes of a file that is in conflict: saving replaces what the other program wrote.
    pub fn keep_mine(&mut self, path: &str) {
        if let Some(theirs) = self.theirs.remove(path) {
            self.note(path, theirs);
        }
    }

    /// Discards the unsaved changes of a file that is in conflict: what the other program wrote takes their place. Undo
    /// brings them back.
    pub fn take_theirs(&mut self, path: &str) {
        let Some(theirs) = self.theirs.remove(path) else { return };
        self.note(path, theirs.clone());
        let mut texts = self.contents.texts.clone();
        if path != self.layout_path() {
            texts.insert(path.to_owned(), theirs);
            self.change_texts(Tag::Once, texts);
        } else {
            self.change(Tag::Once, texts, Places::clone(&self.saved.places));
        }
    }

    /// Looks for files with unsaved changes that another program has changed.
    pub(super) fn find_conflicts(&mut self) {
        self.theirs.clear();
        let texts = self.unsaved().map(|(path, _)| path.to_owned());
        let unsaved: Vec<String> = texts.chain(self.unsaved_places().map(|_| self.layout_path())).collect();
        for path in unsaved {
            let Ok(found) = epigraph_files::text(Path::new(&path)) else { continue };
            if self.on_disk(&path) == Some(&found) {
                continue;
            }
            if self.mine(&path) != found {
                self.theirs.insert(path, found.into());
            } else if path == self.layout_path() {
                (self.layout, self.saved.places) = (Some(found.into()), self.contents.places.clone());
            } else {
                self.note(&path, found.into());
            }
        }
    }

    /// Notes what is in a file now.
    pub(super) fn note(&mut self, path: &str, text: Arc<str>) {
        if path == self.layout_path() {
            // Boxes of a layout that cannot be used are arranged.
            self.saved.places = Arc::new(places::parse(path, &text).unwrap_or_default());
            self.layout = Some(text);
        } else {
            self.saved.texts.insert(path.to_owned(), text);
        }
    }
}
