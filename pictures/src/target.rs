//! Atomic file writes: a file is written whole or not at all.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

/// Why a file cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot {action} {}: {cause}", path.display())]
pub struct FileError {
    action: &'static str,
    path: PathBuf,
    cause: String,
}

impl FileError {
    /// `path` cannot be written.
    pub fn write(path: &Path, cause: impl ToString) -> Self {
        Self { action: "write", path: path.to_owned(), cause: cause.to_string() }
    }

    /// `path` cannot be read.
    pub fn read(path: &Path, cause: impl ToString) -> Self {
        Self { action: "read", path: path.to_owned(), cause: cause.to_string() }
    }

    /// The reason, without the path.
    pub fn cause(&self) -> &str {
        &self.cause
    }
}

/// A file to be written later, in a folder that was found to be writable.
#[derive(Debug)]
pub struct Target {
    path: PathBuf,
}

impl Target {
    /// Checks that the file can be written, so that no work is lost to a mistyped path. Leaves nothing behind.
    ///
    /// # Errors
    /// The path is a folder, its folder does not exist, or one of them is write-protected.
    pub fn new(path: &Path) -> Result<Self, FileError> {
        let target = Self { path: path.to_owned() };
        if path.is_dir() {
            return Err(FileError::write(path, "it is a folder; name a file in it"));
        }
        if path.file_name().is_none() {
            return Err(FileError::write(path, "it has no name"));
        }
        let folder = folder_of(path);
        if !folder.is_dir() {
            let cause = format!("there is no folder {}; make it first", folder.display());
            return Err(FileError::write(path, cause));
        }
        if path.exists() {
            // Renaming would replace even a write-protected file, which its owner does not want.
            fs::OpenOptions::new().append(true).open(path).map_err(|error| FileError::write(path, error))?;
        }
        if !target.is_device() {
            // Dropping the file removes it again.
            target.beside().map_err(|error| FileError::write(path, error))?;
        }
        Ok(target)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the whole file, or leaves the old one in place.
    ///
    /// # Errors
    /// The system's error.
    pub fn write(&self, bytes: &[u8]) -> Result<(), FileError> {
        let mut draft = self.begin()?;
        draft.file.write_all(bytes).map_err(|error| FileError::write(&self.path, error))?;
        draft.commit()
    }

    /// Begins a file that is written in pieces.
    ///
    /// # Errors
    /// The system's error.
    pub fn begin(&self) -> Result<Draft, FileError> {
        let fail = |error: io::Error| FileError::write(&self.path, error);
        if self.is_device() {
            let file = File::create(&self.path).map_err(fail)?;
            return Ok(Draft { path: self.path.clone(), file, beside: None });
        }
        let beside = self.beside().map_err(fail)?;
        if let Ok(old) = fs::metadata(&self.path) {
            beside.as_file().set_permissions(old.permissions()).map_err(fail)?;
        }
        let file = beside.as_file().try_clone().map_err(fail)?;
        Ok(Draft { path: self.path.clone(), file, beside: Some((beside, self.real())) })
    }

    /// A device such as /dev/null, which is written to and never replaced.
    fn is_device(&self) -> bool {
        fs::metadata(&self.path).is_ok_and(|data| !data.is_file())
    }

    /// The file that a link points to.
    fn real(&self) -> PathBuf {
        self.path.canonicalize().unwrap_or_else(|_| self.path.clone())
    }

    /// A temporary file in the same folder, so that renaming it completes the write.
    fn beside(&self) -> io::Result<NamedTempFile> {
        let real = self.real();
        let prefix = format!(".{}.", real.file_name().unwrap_or_default().to_string_lossy());
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(".tmp");
        #[cfg(unix)]
        {
            // The permissions of any new file, less the user's umask; the default lets nobody else read it.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        builder.tempfile_in(folder_of(&real))
    }
}

/// A file that replaces its target when committed. Dropping it leaves the old file as it was, and nothing else.
#[derive(Debug)]
pub struct Draft {
    path: PathBuf,
    file: File,
    /// The temporary file and the path that it replaces; `None` for a device.
    beside: Option<(NamedTempFile, PathBuf)>,
}

impl Draft {
    /// A handle to write through. Writes after [`Draft::commit`] may be lost.
    ///
    /// # Errors
    /// The system's error.
    pub fn writer(&self) -> Result<File, FileError> {
        self.file.try_clone().map_err(|error| FileError::write(&self.path, error))
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// The system's error; the old file stays.
    pub fn commit(self) -> Result<(), FileError> {
        let Some((beside, real)) = self.beside else { return Ok(()) };
        let placed = self.file.sync_all().and_then(|()| Ok(beside.persist(real)?));
        placed.map(drop).map_err(|error| FileError::write(&self.path, error))
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
    fn what_fails_or_is_given_up_leaves_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let draft = Target::new(&path).unwrap().begin().unwrap();
        draft.writer().unwrap().write_all(b"half").unwrap();
        drop(draft);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);

        // A folder takes the place in the meantime.
        let target = Target::new(&folder.path().join("b")).unwrap();
        fs::create_dir(target.path()).unwrap();
        fs::write(target.path().join("c"), "").unwrap();
        let text = target.begin().unwrap_err().to_string();
        assert!(text.starts_with(&format!("cannot write {}: ", target.path().display())), "{text}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_so_do_permissions() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("a.txt"), folder.path().join("link.txt"));
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        fs::write(&path, "old").unwrap();
        let usual = mode(&path);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        symlink(&path, &link).unwrap();
        Target::new(&link).unwrap().write(b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!((fs::read(&path).unwrap(), mode(&path)), (b"new".to_vec(), 0o640));

        let fresh = folder.path().join("b.txt");
        Target::new(&fresh).unwrap().write(b"new").unwrap();
        assert_eq!(mode(&fresh), usual);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_are_written_to_and_not_replaced() {
        use std::os::unix::fs::FileTypeExt;
        let is_device = |path: &str| fs::metadata(path).unwrap().file_type().is_char_device();
        Target::new(Path::new("/dev/null")).unwrap().write(b"gone").unwrap();
        assert!(Target::new(Path::new("/dev/full")).unwrap().write(b"too much").is_err());
        assert!(is_device("/dev/null") && is_device("/dev/full"));
    }

    #[test]
    fn what_cannot_be_written_is_found_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        let text = |path: &Path| Target::new(path).unwrap_err().to_string();
        assert!(text(folder.path()).contains("it is a folder"));
        assert!(text(&folder.path().join("none/a.png")).contains("there is no folder"));
        let file = folder.path().join("a.txt");
        fs::write(&file, "").unwrap();
        assert!(text(&file.join("b.txt")).contains("there is no folder"));
        assert!(text(Path::new("")).contains("it has no name"));
    }
}
