//! Files that are written whole or not at all.

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

/// Why a file cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot {action} {}: {cause}", path.display())]
pub struct FileError {
    action: &'static str,
    path: PathBuf,
    cause: String,
}

impl FileError {
    /// That `path` cannot be written.
    pub fn write(path: &Path, cause: impl ToString) -> Self {
        Self { action: "write", path: path.to_owned(), cause: cause.to_string() }
    }

    /// That `path` cannot be read.
    pub fn read(path: &Path, cause: impl ToString) -> Self {
        Self { action: "read", path: path.to_owned(), cause: cause.to_string() }
    }
}

/// A file to be written later, in a folder that was seen to be writable.
#[derive(Debug)]
pub struct Target {
    path: PathBuf,
}

impl Target {
    /// Makes sure that the file can be written, so that no work is lost for a mistyped path. Leaves nothing behind.
    ///
    /// # Errors
    /// That it is a folder, or that its folder is not there, or that one of them is write-protected.
    pub fn new(path: &Path) -> Result<Self, FileError> {
        let target = Self { path: path.to_owned() };
        if path.is_dir() {
            return Err(FileError::write(path, "it is a folder; name a file in it"));
        }
        let folder = folder_of(path);
        if !folder.is_dir() {
            let cause = format!("there is no folder {}; make it first", folder.display());
            return Err(FileError::write(path, cause));
        }
        if path.exists() {
            // A write-protected file would be replaced by renaming; its owner does not want that.
            fs::OpenOptions::new().append(true).open(path).map_err(|error| FileError::write(path, error))?;
        }
        if !target.is_device() {
            let probe = target.fresh();
            File::create(&probe)
                .and_then(|_| fs::remove_file(&probe))
                .map_err(|error| FileError::write(path, error))?;
        }
        Ok(target)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the whole file, or leaves what was there.
    ///
    /// # Errors
    /// What the system says.
    pub fn write(&self, bytes: &[u8]) -> Result<(), FileError> {
        let fail = |error: io::Error| FileError::write(&self.path, error);
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
