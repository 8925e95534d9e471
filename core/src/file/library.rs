//! Where the texts of graphs come from: files, the program itself, options of a command line.

use std::{io, path::Path};

use super::GraphFile;
use crate::error::GraphError;

/// Finds the graphs that a graph names: the files of its parts and its base. A closure from a path to the text of that
/// file is a library without graphs of its own.
pub trait Library {
    /// The text of a file.
    ///
    /// # Errors
    /// The file cannot be read.
    fn read(&self, path: &Path) -> io::Result<String>;

    /// The path and the text of a graph that comes with the program, from its name: `epi`, `epi.ron` or
    /// `graphs/epi.ron`.
    fn shipped(&self, _name: &str) -> Option<(String, String)> {
        None
    }

    /// The names of the graphs that come with the program, for messages.
    fn names(&self) -> Vec<String> {
        Vec::new()
    }
}

impl<F: Fn(&Path) -> io::Result<String>> Library for F {
    fn read(&self, path: &Path) -> io::Result<String> {
        self(path)
    }
}

/// Where a graph's text is from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Origin {
    /// A file.
    #[default]
    File,
    /// The program, which has it embedded: nobody can change it, and what it names comes with the program too.
    Shipped,
    /// An option of a command line, or a piece of a graph's name. `path` is its text, and paths in it start at the
    /// current folder.
    Option,
}

/// A text that was found.
pub(super) struct Found {
    pub path: String,
    pub text: String,
    pub origin: Origin,
}

impl GraphFile {
    /// The folder where relative paths in the file start.
    pub(crate) fn folder(&self) -> &Path {
        folder(&self.path, self.origin)
    }

    /// Finds a graph that this file names. A file on disk wins over a graph of the program.
    pub(super) fn find_named(&self, name: &str, library: &dyn Library) -> Result<Found, GraphError> {
        let path = self.folder().join(name);
        let shown = path.display().to_string();
        let shipped = |name: &str| {
            let (path, text) = library.shipped(name)?;
            Some(Found { path, text, origin: Origin::Shipped })
        };
        let error = match self.origin {
            Origin::Shipped => match shipped(&shown).or_else(|| shipped(name)) {
                Some(found) => return Ok(found),
                None => io::ErrorKind::NotFound.into(),
            },
            Origin::File | Origin::Option => match library.read(&path) {
                Ok(text) => return Ok(Found { path: shown, text, origin: Origin::File }),
                Err(error) => match shipped(name).filter(|_| is_no_file(&error)) {
                    Some(found) => return Ok(found),
                    None => error,
                },
            },
        };
        let mut cause = format!("{shown}: {error}");
        if is_no_file(&error) {
            cause += match self.origin {
                Origin::Option => "; the path starts at the current folder",
                Origin::File | Origin::Shipped => "; the path starts at the folder of the graph file",
            };
            let names = library.names();
            if !names.is_empty() {
                cause += &format!(", and graphs that come with the program are {}", names.join(", "));
            }
        }
        Err(GraphError::Io { action: "read", cause })
    }
}

/// Whether there is no file of that path.
fn is_no_file(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::NotFound | io::ErrorKind::IsADirectory | io::ErrorKind::NotADirectory
    )
}

/// The folder where relative paths start in a text of this path and origin.
pub(super) fn folder(path: &str, origin: Origin) -> &Path {
    match origin {
        Origin::Option => Path::new(""),
        Origin::File | Origin::Shipped => Path::new(path).parent().unwrap_or(Path::new("")),
    }
}
