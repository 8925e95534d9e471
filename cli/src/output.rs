//! Results on stdout, and files that are written whole or not at all.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

use serde_json::Value;

use crate::error::CliError;

/// Writes to stdout. A reader that has gone away (`| head`) is no error.
pub fn print(text: &str) -> Result<(), CliError> {
    match io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(CliError::write(Path::new("stdout"), error))
        }
        _ => Ok(()),
    }
}

/// Where JSON goes.
pub enum JsonTarget {
    /// Nowhere.
    None,
    /// To stdout, in place of the text for people.
    Stdout,
    /// To a file beside it.
    File(Target),
}

impl JsonTarget {
    /// The target of `--json`; an error where the file cannot be written.
    pub fn new(path: Option<&Path>) -> Result<Self, CliError> {
        match path {
            None => Ok(Self::None),
            Some(path) if path == Path::new("-") => Ok(Self::Stdout),
            Some(path) => Target::new(path).map(Self::File),
        }
    }

    /// Writes `value` to the target, and `text` to stdout unless `value` goes there.
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

/// A file to be written later, in a folder that was seen to be writable.
#[derive(Debug)]
pub struct Target {
    path: PathBuf,
}

impl Target {
    /// Makes sure that the file can be written, so that no work is lost for a mistyped path. Leaves nothing behind.
    pub fn new(path: &Path) -> Result<Self, CliError> {
        let target = Self { path: path.to_owned() };
        if path.is_dir() {
            return Err(CliError::write(path, "it is a folder; name a file in it"));
        }
        let folder = folder_of(path);
        if !folder.is_dir() {
            let cause = format!("there is no folder {}; make it first", folder.display());
            return Err(CliError::write(path, cause));
        }
        if path.exists() {
            // A write-protected file would be replaced by renaming; its owner does not want that.
            fs::OpenOptions::new().append(true).open(path).map_err(|error| CliError::write(path, error))?;
        }
        if !target.is_device() {
            let probe = target.fresh();
            File::create(&probe)
                .and_then(|_| fs::remove_file(&probe))
                .map_err(|error| CliError::write(path, error))?;
        }
        Ok(target)
    }

    /// The same for a plot.
    pub fn svg(path: &Path) -> Result<Self, CliError> {
        if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("svg")) {
            return Err(CliError::write(path, "the plot is drawn as SVG; name it FILE.svg"));
        }
        Self::new(path)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the whole file, or leaves what was there.
    pub fn write(&self, bytes: &[u8]) -> Result<(), CliError> {
        let fail = |error: io::Error| CliError::write(&self.path, error);
        if self.is_device() {
            return fs::write(&self.path, bytes).map_err(fail);
        }
        let fresh = self.fresh();
        let written = fs::write(&fresh, bytes).and_then(|()| fs::rename(&fresh, self.real()));
        if written.is_err() {
            // The first error is the one to tell; a file that was never made cannot be removed.
            let _ = fs::remove_file(&fresh);
        }
        written.map_err(fail)
    }

    /// Something like /dev/null, which must be written to and never replaced.
    fn is_device(&self) -> bool {
        fs::metadata(&self.path).is_ok_and(|data| !data.is_file())
    }

    /// The file that a link leads to.
    fn real(&self) -> PathBuf {
        self.path.canonicalize().unwrap_or_else(|_| self.path.clone())
    }

    fn fresh(&self) -> PathBuf {
        let real = self.real();
        let name = real.file_name().unwrap_or_default().to_string_lossy();
        folder_of(&real).join(format!(".{name}.{}.tmp", std::process::id()))
    }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let target = Target::new(&path).unwrap();
        assert!(!path.exists(), "only write() makes the file");
        target.write(b"one").unwrap();
        Target::new(&path).unwrap().write(b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_cannot_be_written_is_found_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        let text = |path: &Path| Target::new(path).unwrap_err().to_string();
        assert!(text(folder.path()).contains("it is a folder"));
        assert!(text(&folder.path().join("none/a.png")).contains("there is no folder"));
    }
}
