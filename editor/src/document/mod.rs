//! The open graph: its text and the texts of its parts, with undo and redo.
//!
//! The texts are the source of truth. Each change (typing, or one of core's edits, which touch only the characters
//! concerned) makes a new set of texts and pushes the previous one onto the undo stack, so undo restores it byte for
//! byte. While a text is broken, [`Document::file`] is the last good graph and [`Document::problems`] lists the errors.
//! The positions of the canvas's boxes are part of the same history, but are saved in a file of their own ([`places`]).

mod conflict;
mod moved;
pub mod nodes;
mod params;
mod pins;
pub mod places;
mod shaders;
mod swap;
#[cfg(test)]
pub(crate) mod tests;
mod unsaved;

use std::{
    collections::{BTreeMap, BTreeSet},
    io,
    path::Path,
    sync::Arc,
};

use epigraph::graphs::Shipped;
use epigraph_core::{Difference, GraphError, GraphFile, Library, Origin, Place, Problem, Problems, Registry};
use epigraph_files::Target;

pub use params::{home, param_text, remove_param};
pub use pins::{INPUTS, Pin, ends, output_port, pins};
pub use places::Places;
use shaders::ShaderFiles;
pub use shaders::Sources;
pub use swap::{fitting, swap};

/// Texts of the graph, its parts and its shaders, by file path.
type Texts = BTreeMap<String, Arc<str>>;

/// Groups changes for undo: consecutive changes with the same tag are undone together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Tag {
    /// A change that is undone on its own.
    Once,
    /// Typing in a file.
    Typing(String),
    /// Dragging a parameter: node and name.
    Param(String, String),
    /// Moving boxes of the canvas with the arrow keys.
    Moving,
    /// Restoring the unsaved changes of the last session.
    Recovery,
}

/// The contents that undo and redo restore.
#[derive(Clone, PartialEq)]
struct Contents {
    texts: Texts,
    places: Arc<Places>,
}

/// An open graph file.
pub struct Document {
    path: String,
    contents: Contents,
    saved: Contents,
    past: Vec<Contents>,
    future: Vec<Contents>,
    tag: Tag,
    notice: Option<String>,
    /// The text of the layout's file as last read or written; `None` if there was no file.
    layout: Option<Arc<str>>,
    /// The texts of files with unsaved changes that another program has changed, by path.
    theirs: Texts,
    file: Option<Arc<GraphFile>>,
    /// The graph with its changes to the base applied.
    whole: Option<Arc<GraphFile>>,
    /// Its changes to the base.
    differences: Arc<Vec<Difference>>,
    /// The paths of texts that come with the program, which cannot be edited: graphs that the open one refers to.
    fixed: BTreeSet<String>,
    /// The files that the shaders of stages come from.
    sources: Arc<Sources>,
    shaders: ShaderFiles,
    problems: Vec<Problem>,
    revision: u64,
}

impl Document {
    /// Opens a file with its parts. A file with problems opens too, so that the user can fix it.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn open(path: &Path) -> Result<Self, Problems> {
        let name = path.display().to_string();
        let text = epigraph_files::text(path).map_err(|error| {
            let error = GraphError::Io { action: "read", cause: error.to_string() };
            Problem::new(error).at(Place::file(&name))
        })?;
        let (layout, places, notice) = match places::read(&name) {
            Ok((layout, places)) => (layout, Arc::new(places), None),
            Err(why) => (None, Arc::default(), Some(why)),
        };
        let mut document = Self {
            contents: Contents { texts: Texts::from([(name.clone(), text.into())]), places: places.clone() },
            path: name,
            saved: Contents { texts: Texts::new(), places },
            notice,
            layout: layout.map(Into::into),
            theirs: Texts::new(),
            past: Vec::new(),
            future: Vec::new(),
            tag: Tag::Once,
            file: None,
            whole: None,
            differences: Arc::default(),
            fixed: BTreeSet::new(),
            sources: Arc::default(),
            shaders: ShaderFiles::default(),
            problems: Vec::new(),
            revision: 0,
        };
        document.read();
        document.saved.texts.clone_from(&document.contents.texts);
        Ok(document)
    }

    /// The graph's own path.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The paths of all texts: the graph's own first, then its parts' and its shaders'.
    pub fn paths(&self) -> impl Iterator<Item = &str> {
        let parts = self.contents.texts.keys().map(String::as_str).filter(|path| *path != self.path);
        std::iter::once(self.path.as_str()).chain(parts)
    }

    /// The text of the file at this path; empty if the document has no such file.
    pub fn text(&self, path: &str) -> &str {
        self.contents.texts.get(path).map_or("", |text| text)
    }

    /// The graph as of the last texts without problems; `None` if there have not been any. If the graph has a base, this is
    /// only its change to the base; see [`Document::whole`].
    pub fn file(&self) -> Option<&Arc<GraphFile>> {
        self.file.as_ref()
    }

    /// The graph with its changes to the base applied, to be displayed.
    pub fn whole(&self) -> Option<&Arc<GraphFile>> {
        self.whole.as_ref()
    }

    /// The changes of the graph to its base; empty if it has no base.
    pub fn differences(&self) -> &Arc<Vec<Difference>> {
        &self.differences
    }

    /// The changes to a node, and to all nodes in it if it is a part.
    pub fn differences_of<'d>(&'d self, address: &'d str) -> impl Iterator<Item = &'d Difference> {
        self.differences.iter().filter(move |found| nodes::within(&found.node, address).is_some())
    }

    /// The name of the base as written in the text; `None` if the graph has no base.
    pub fn base(&self) -> Option<&str> {
        Some(&self.file.as_ref()?.base.as_ref()?.base.value)
    }

    /// Whether a text comes with the program, so that it cannot be edited.
    pub fn is_fixed(&self, path: &str) -> bool {
        self.fixed.contains(path)
    }

    /// The whole graph as the text of one file, for a path.
    ///
    /// # Errors
    /// The graph's problems.
    pub fn full(&self, path: &Path, registry: &Registry) -> Result<String, Problems> {
        match (&self.file, self.problems.as_slice()) {
            (Some(file), []) => file.full(registry, path),
            _ => Err(refused("the text has problems; mend them first")),
        }
    }

    /// Problems of the current texts. Unknown ports and parameters are found later, when the graph is compiled.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }

    /// A number that increases when a text changes, also by undo and redo.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Positions of the boxes that the user has placed on the canvas.
    pub fn places(&self) -> &Arc<Places> {
        &self.contents.places
    }

    /// A message about opening the file, for the user; returned once.
    pub fn take_notice(&mut self) -> Option<String> {
        self.notice.take()
    }

    /// True if a text or a box position differs from its file as last read or written.
    pub fn is_dirty(&self) -> bool {
        let (present, saved) = (&self.contents, &self.saved);
        let changed = |(path, text): (&String, &Arc<str>)| saved.texts.get(path) != Some(text);
        present.texts.iter().any(changed) || present.places != saved.places
    }

    /// True if there is a change to undo.
    pub fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    /// True if there is a change to redo.
    pub fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }

    /// Replaces a text with the user's typing.
    pub fn type_text(&mut self, path: &str, text: &str) {
        if self.is_fixed(path) {
            return;
        }
        let mut texts = self.contents.texts.clone();
        texts.insert(path.to_owned(), text.into());
        self.change_texts(Tag::Typing(path.to_owned()), texts);
    }

    /// Makes one of core's edits. A part that the graph uses several times changes everywhere.
    ///
    /// # Errors
    /// Those of the edit, or the text has problems and can only be edited by typing. Nothing is changed then.
    pub fn edit(
        &mut self,
        tag: Tag,
        edit: impl FnOnce(&mut GraphFile) -> Result<(), Problems>,
    ) -> Result<(), Problems> {
        self.edit_placed(tag, |file, _| edit(file))
    }

    /// Makes one of core's edits and moves boxes, as one step of undo.
    ///
    /// # Errors
    /// Those of [`Document::edit`].
    pub fn edit_placed(
        &mut self,
        tag: Tag,
        edit: impl FnOnce(&mut GraphFile, &mut Places) -> Result<(), Problems>,
    ) -> Result<(), Problems> {
        let (Some(file), []) = (&self.file, self.problems.as_slice()) else {
            let text = "the text has problems; fix them first";
            return Err(Problem::new(GraphError::Invalid(text.into())).into());
        };
        let mut edited = GraphFile::clone(file);
        let mut places = Places::clone(&self.contents.places);
        edit(&mut edited, &mut places)?;
        let mut texts = self.contents.texts.clone();
        take_changed(&edited, &self.contents.texts, &mut texts);
        self.change(tag, texts, places);
        Ok(())
    }

    /// Moves boxes of the canvas.
    pub fn place(&mut self, tag: Tag, change: impl FnOnce(&mut Places)) {
        let mut places = Places::clone(&self.contents.places);
        change(&mut places);
        self.change(tag, self.contents.texts.clone(), places);
    }

    /// Ends a drag or a stretch of typing: the next change is undone separately, even with the same tag.
    pub fn seal(&mut self) {
        self.tag = Tag::Once;
    }

    /// Undoes the last change.
    pub fn undo(&mut self) {
        if let Some(contents) = self.past.pop() {
            let present = self.restore(contents);
            self.future.push(present);
        }
    }

    /// Redoes the change that was undone last.
    pub fn redo(&mut self) {
        if let Some(contents) = self.future.pop() {
            let present = self.restore(contents);
            self.past.push(present);
        }
    }

    /// Writes every changed text, and the box positions if they changed, to its file, each whole or not at all.
    ///
    /// # Errors
    /// Another program has changed such a file since it was read: then nothing is written, and
    /// [`Document::conflicts`] has these files. Or a file cannot be written: its text then stays unsaved; files before it
    /// in [`Document::paths`] have been written.
    pub fn save(&mut self) -> Result<(), Problems> {
        self.seal();
        self.find_conflicts();
        let conflict = |path: &String| {
            let cause =
                "another program has changed it since it was read; keep your changes or discard them first";
            let error = GraphError::Io { action: "write", cause: cause.into() };
            Problem::new(error).at(Place::file(path))
        };
        Problems(self.theirs.keys().map(conflict).collect()).into_result()?;
        let changed: Vec<String> = self
            .paths()
            .filter(|path| self.contents.texts.get(*path) != self.saved.texts.get(*path))
            .map(Into::into)
            .collect();
        for path in changed {
            let Some(text) = self.contents.texts.get(&path).cloned() else { continue };
            write(Path::new(&path), &text)?;
            self.saved.texts.insert(path, text);
        }
        if self.contents.places != self.saved.places {
            let text = places::write(&self.contents.places, self.whole.as_deref());
            write(&places::layout_path(&self.path), &text)?;
            (self.layout, self.saved.places) = (Some(text.into()), self.contents.places.clone());
        }
        Ok(())
    }

    /// Reloads the files that another program has changed, unless they have unsaved changes: those are in
    /// [`Document::conflicts`] then. Returns true if any was reloaded. Undo restores the previous texts.
    pub fn refresh(&mut self) -> bool {
        // A shader file may have been created since.
        let mut changed = self.add_shaders();
        let mut texts = self.contents.texts.clone();
        for (path, saved) in &mut self.saved.texts {
            if !self.fixed.contains(path)
                && texts.get(path) == Some(saved)
                && let Ok(found) = epigraph_files::text(Path::new(path))
                && found != **saved
            {
                *saved = found.into();
                texts.insert(path.clone(), saved.clone());
            }
        }
        self.revision += u64::from(changed);
        let mut places = self.contents.places.clone();
        let layout = self.layout_path();
        if self.unsaved_places().is_none()
            && let Ok(found) = epigraph_files::text(Path::new(&layout))
            && self.layout.as_deref() != Some(&found)
        {
            self.note(&layout, found.into());
            places = self.saved.places.clone();
        }
        changed |= texts != self.contents.texts || places != self.contents.places;
        self.change(Tag::Once, texts, Places::clone(&places));
        self.find_conflicts();
        changed
    }

    fn change_texts(&mut self, tag: Tag, texts: Texts) {
        self.change(tag, texts, Places::clone(&self.contents.places));
    }

    fn change(&mut self, tag: Tag, texts: Texts, places: Places) {
        if texts == self.contents.texts && places == *self.contents.places {
            return;
        }
        let before = self.replace(Contents { texts, places: Arc::new(places) });
        if tag == Tag::Once || tag != self.tag {
            self.past.push(before);
        }
        self.tag = tag;
        self.future.clear();
    }

    fn restore(&mut self, contents: Contents) -> Contents {
        self.seal();
        self.replace(contents)
    }

    /// Replaces the contents; returns the previous ones.
    fn replace(&mut self, contents: Contents) -> Contents {
        let before = std::mem::replace(&mut self.contents, contents);
        // Moving boxes does not change the graph.
        if before.texts != self.contents.texts {
            self.read();
            self.revision += 1;
        }
        before
    }

    /// Parses the texts. Parts that the document does not hold yet are read from their files.
    fn read(&mut self) {
        let read = GraphFile::parse(&self.path, self.text(&self.path))
            .and_then(|file| file.with_parts(&Known(&self.contents.texts)))
            .and_then(|file| Ok((file.whole()?.into_owned(), file)));
        match read {
            Ok((whole, file)) => {
                self.fixed.clear();
                self.add_texts(&file);
                self.find_shaders(&file, &whole);
                self.differences = Arc::new(file.differences());
                self.file = Some(Arc::new(file));
                self.whole = Some(Arc::new(whole));
                self.problems = Vec::new();
            }
            Err(problems) => self.problems = problems.0,
        }
    }

    /// Adds the texts of parts and of the base that were read for the first time, as saved, and notes which are fixed.
    fn add_texts(&mut self, file: &GraphFile) {
        for named in named(file) {
            if named.origin == Origin::Shipped {
                self.fixed.insert(named.path.clone());
            }
            if !self.contents.texts.contains_key(&named.path) {
                let text: Arc<str> = named.text.as_str().into();
                self.contents.texts.insert(named.path.clone(), text.clone());
                self.saved.texts.insert(named.path.clone(), text);
            }
            self.add_texts(named);
        }
    }
}

/// The document's texts; for other paths, files and graphs that come with the program.
struct Known<'t>(&'t Texts);

impl Library for Known<'_> {
    fn read(&self, path: &Path) -> io::Result<String> {
        match self.0.get(&path.display().to_string()) {
            Some(text) => Ok(text.to_string()),
            None => epigraph_files::text(path),
        }
    }

    fn shipped(&self, name: &str) -> Option<(String, String)> {
        Shipped.shipped(name)
    }

    fn names(&self) -> Vec<String> {
        Shipped.names()
    }
}

/// The graphs that a graph file names: its parts, those of its changes, and its base.
pub(super) fn named(file: &GraphFile) -> impl Iterator<Item = &GraphFile> {
    let changes = file.base.iter();
    let changed = changes
        .flat_map(|changes| changes.parts.iter().map(|(_, part)| part).chain(changes.graph.as_deref()));
    file.parts.iter().map(|(_, part)| part).chain(changed)
}

fn refused(why: &str) -> Problems {
    Problem::new(GraphError::Invalid(why.into())).into()
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// It cannot be written.
pub fn write(path: &Path, text: &str) -> Result<(), Problems> {
    Target::new(path).and_then(|target| target.write(text.as_bytes())).map_err(|error| {
        let error = GraphError::Io { action: "write", cause: error.cause().into() };
        Problem::new(error).at(Place::file(&path.display().to_string())).into()
    })
}

/// Copies to `texts` the texts of `file`, its parts and its base that differ from `before`.
fn take_changed(file: &GraphFile, before: &Texts, texts: &mut Texts) {
    if before.get(&file.path).is_none_or(|text| **text != *file.text) {
        texts.insert(file.path.clone(), file.text.as_str().into());
    }
    for named in named(file) {
        take_changed(named, before, texts);
    }
}
