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

/// Checks that no two flags name the same file: the later one would replace what the earlier one wrote.
///
/// # Errors
/// The first two flags that do.
pub fn separate_files<'p>(
    files: impl IntoIterator<Item = (&'p str, Option<&'p Path>)>,
) -> Result<(), CliError> {
    let mut known: Vec<(&str, &Path)> = Vec::new();
    for (flag, path) in files {
        // `-` is stdout.
        let Some(path) = path.filter(|path| *path != Path::new("-")) else { continue };
        if let Some((other, _)) = known.iter().find(|(_, other)| *other == path) {
            let text = format!("{other} and {flag} both write {}; name another file", path.display());
            return Err(CliError::Input(text));
        }
        known.push((flag, path));
    }
    Ok(())
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
