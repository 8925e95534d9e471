//! Graph files: RON text, the graph's structure as read from it, and the place of everything.
//!
//! A file is read in three layers, so that one mistake does not hide the next. ron checks that the text is RON at all;
//! only such a problem is reported alone. [`scan`] then splits the text into blocks and items, and [`parse`] reads each
//! field separately and collects every problem. Because an item knows its bytes, an [`edit`] replaces only those and
//! parses the result again: all other comments, order and spacing stay. A graph may contain others ([`parts`]), have
//! parameters ([`param`]), repeat nodes ([`repeat`]), and change another graph ([`base`]).

mod base;
mod edit;
mod edit_base;
mod library;
mod param;
mod parse;
mod parts;
mod paths;
mod repeat;
mod scan;

use std::{fmt, io, path::Path, str::FromStr};

use crate::{
    error::{GraphError, Place, Problem, Problems, Spanned},
    side::{Download, Side},
};
pub(crate) use base::SourceText;
pub use base::{Changes, Replaced, Rewire};
pub use edit_base::{Changed, Difference};
pub use library::{Library, Origin};
pub use param::{GraphParam, GraphValue, handed, handing};
pub use parse::ron_problem;
pub(crate) use parts::{Flat, FlatNode, Swap};
pub use parts::{PART_KIND, ParamPlaces};
pub use paths::{moved_path, names_file, relative};
pub use repeat::{MAX_REPEAT, RepeatDef};

/// A graph file as written: its text, and the graph's structure with the place of everything in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphFile {
    /// The file's name as the user gave it.
    pub path: String,
    /// The whole text.
    pub text: String,
    /// Version of the format; always 1 so far.
    pub version: u32,
    /// What the graph does, in words; empty if the file does not say.
    pub doc: String,
    /// Parameters of the graph itself, in file order; names are unique.
    pub params: Vec<GraphParam>,
    /// Nodes in file order; names are unique.
    pub nodes: Vec<NodeDef>,
    /// Outputs in file order; names are unique.
    pub outputs: Vec<OutputDef>,
    /// The files of nodes of kind `graph`, by node name; read by [`GraphFile::load`] and
    /// [`GraphFile::with_parts`].
    pub parts: Vec<(String, GraphFile)>,
    /// What it changes in another graph, its base; `nodes` and `outputs` are then added to those of the base. `None`
    /// for a graph that has no base.
    pub base: Option<Changes>,
    /// Where the text is from.
    pub origin: Origin,
    /// Texts of other files that items are from, for a graph made by [`GraphFile::whole`]; by ascending starts.
    pub(crate) others: Vec<SourceText>,
}

/// One node as written. Its kind, ports and parameters are not checked yet.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeDef {
    /// Its name, unique in the file, without a dot.
    pub name: Spanned<String>,
    /// The stage kind.
    pub kind: Spanned<String>,
    /// How it is repeated; `None` if it is there once.
    pub repeat: Option<RepeatDef>,
    /// Where it runs; `None` for the run's default.
    pub on: Option<Spanned<Side>>,
    /// How GPU results reach it when it runs on the CPU; `None` means [`Download::Sync`].
    pub download: Option<Spanned<Download>>,
    /// Whether the user bypasses it.
    pub bypass: bool,
    /// Connected inputs in file order; ports are unique.
    pub inputs: Vec<InputDef>,
    /// Parameters in file order; names are unique.
    pub params: Vec<ParamDef>,
    /// For nodes of a part, by their addresses in it, and for copies of a repeated node, by their numbers: parameters
    /// that override those written elsewhere.
    pub set: Vec<(Spanned<String>, Vec<ParamDef>)>,
    /// What it keeps of the node of the base whose place it has taken; `None` for any other node.
    pub replaced: Option<Box<Replaced>>,
    /// Inputs that a change to the base has disconnected.
    pub cut: Vec<Spanned<String>>,
}

/// A wire into a node.
#[derive(Clone, Debug, PartialEq)]
pub struct InputDef {
    /// The consuming port.
    pub port: Spanned<String>,
    /// The producing port.
    pub from: Spanned<Source>,
}

/// A named output of the graph.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputDef {
    /// Its name.
    pub name: Spanned<String>,
    /// The producing port.
    pub from: Spanned<Source>,
}

/// A parameter as written.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamDef {
    /// Its name.
    pub name: Spanned<String>,
    /// The value's RON text, without surrounding space and comments.
    pub value: Spanned<String>,
}

/// A producing port, written `NODE.PORT`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Source {
    /// The node.
    pub node: String,
    /// The port.
    pub port: String,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.node, self.port)
    }
}

impl FromStr for Source {
    type Err = GraphError;

    /// Parses `NODE.PORT`; [`GraphError::Invalid`] unless there is exactly one dot with a name on either side.
    fn from_str(text: &str) -> Result<Self, GraphError> {
        match text.split_once('.') {
            Some((node, port)) if !node.is_empty() && !port.is_empty() && !port.contains('.') => {
                Ok(Self { node: node.to_owned(), port: port.to_owned() })
            }
            _ => {
                // Nodes within parts are separated by slashes.
                let hint = match text.rsplit_once('.') {
                    Some((node, port)) if node.contains('.') => format!("{}.{port}", node.replace('.', "/")),
                    _ => "NODE.PORT".into(),
                };
                Err(GraphError::Invalid(format!("`{text}` is not a port; write {hint:?}")))
            }
        }
    }
}

impl GraphFile {
    /// Reads a file, its parts and its base, which are files too.
    ///
    /// # Errors
    /// If a file cannot be read, or all problems of their texts; see [`GraphFile::parse`].
    pub fn load(path: &Path) -> Result<Self, Problems> {
        Self::load_with(path, &epigraph_files::text)
    }

    /// Reads a file, its parts and its base, which may be graphs of the library.
    ///
    /// # Errors
    /// Those of [`GraphFile::load`].
    pub fn load_with(path: &Path, library: &dyn Library) -> Result<Self, Problems> {
        let name = path.display().to_string();
        let text = library.read(path).map_err(|error| unreadable(&name, &error))?;
        Self::parse(&name, &text)?.with_parts(library)
    }

    /// The node with this name.
    pub fn node(&self, name: &str) -> Option<&NodeDef> {
        self.nodes.iter().find(|node| node.name.value == name)
    }
}

fn unreadable(path: &str, error: &io::Error) -> Problems {
    let error = GraphError::Io { action: "read", cause: error.to_string() };
    Problem::new(error).at(Place::file(path)).into()
}
