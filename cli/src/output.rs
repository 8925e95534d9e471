//! Results on stdout and as JSON.

use std::{
    io::{self, Write},
    path::Path,
};

use epigraph_pictures::Target;
use serde_json::Value;

use crate::error::CliError;

/// Writes to stdout. A closed pipe (`| head`) is not an error.
pub fn print(text: &str) -> Result<(), CliError> {
    match io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(CliError::write(Path::new("stdout"), error))
        }
        _ => Ok(()),
    }
}

/// The destination of JSON.
pub enum JsonTarget {
    /// No JSON.
    None,
    /// Stdout, instead of the text.
    Stdout,
    /// A file, in addition to the text on stdout.
    File(Target),
}

impl JsonTarget {
    /// The target of `--json`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn new(path: Option<&Path>) -> Result<Self, CliError> {
        match path {
            None => Ok(Self::None),
            Some(path) if path == Path::new("-") => Ok(Self::Stdout),
            Some(path) => Ok(Self::File(Target::new(path)?)),
        }
    }

    /// Writes `value` to the target, and `text` to stdout unless that is the target.
    pub fn finish(&self, value: &Value, text: &str) -> Result<(), CliError> {
        let json = format!("{value:#}\n");
        match self {
            Self::None => print(text),
            Self::Stdout => print(&json),
            Self::File(target) => {
                target.write(json.as_bytes())?;
                print(text)
            }
        }
    }
}
