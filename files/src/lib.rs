//! The files of Epigraph's users. All of Epigraph reads and writes them here, and nowhere else.
//!
//! - [`text`] and [`bytes`] read a file up to a limit, so that a device or a mistyped path cannot fill the memory.
//! - [`Target`] and [`Draft`] write a file whole or not at all; [`commit`] does so for files that belong together,
//!   [`write_folder`] for a new folder.
//! - [`Journal`] keeps what long work has done, until it is done.
//! - [`Fingerprint`] names what is kept by what it was made from.
//! - [`Target::input`] tells whether a file to be written was read, and [`Target::is`] whether two are one file, by
//!   whatever paths and links.
//!
//! ```
//! use epigraph_files::{Target, text};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("a.ron");
//! // Found to be writable before the work begins, and written when it is done.
//! let target = Target::new(&path)?;
//! target.write("Graph(version: 1)".as_bytes())?;
//! assert_eq!(text(&path)?, "Graph(version: 1)");
//! // What was read is an input; a command does not replace it.
//! assert!(Target::new(&path)?.input().is_some());
//! # Ok(())
//! # }
//! ```

mod error;
mod fingerprint;
mod identity;
mod journal;
mod read;
mod write;

pub use error::FileError;
pub use fingerprint::Fingerprint;
pub use identity::is_stream;
pub use journal::Journal;
pub use read::{MOST_DATA, MOST_TEXT, bytes, text, text_of, without_mark};
pub use write::{Draft, Target, TemporaryFolder, commit, write_folder};
