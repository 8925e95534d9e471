//! What long work has done so far, in a file beside its output, for a run that goes on after an interruption.

use std::{
    ffi::OsString,
    fs::{self, File, OpenOptions},
    io::{ErrorKind, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use crate::{FileError, MOST_DATA};

/// The file `OUTPUT.part`.
pub struct Journal {
    path: PathBuf,
    file: Option<File>,
}

impl Journal {
    /// That of an output. No file is made before something is appended.
    pub fn beside(output: &Path) -> Self {
        let mut name = OsString::from(output);
        name.push(".part");
        Self { path: name.into(), file: None }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What an earlier run has appended; nothing if there is no file.
    ///
    /// # Errors
    /// The file is there but cannot be read.
    pub fn read(&self) -> Result<Vec<u8>, FileError> {
        let mut bytes = Vec::new();
        let read = match File::open(&self.path) {
            Ok(file) => file.take(MOST_DATA).read_to_end(&mut bytes).map(drop),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) => Err(error),
        };
        read.map_err(|error| FileError::read(&self.path, error)).map(|()| bytes)
    }

    /// Appends bytes. The first time, what follows the first `valid` bytes of the file is cut off: a killed run leaves
    /// half a record.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, valid: u64, bytes: &[u8]) -> Result<(), FileError> {
        let fail = |error| FileError::write(&self.path, error);
        if self.file.is_none() {
            let open = OpenOptions::new().create(true).truncate(false).write(true).open(&self.path);
            let mut file = open.map_err(fail)?;
            file.set_len(valid).and_then(|()| file.seek(SeekFrom::End(0))).map_err(fail)?;
            self.file = Some(file);
        }
        let file = self.file.as_mut().expect("opened above");
        file.write_all(bytes).map_err(|error| FileError::write(&self.path, error))
    }

    /// Removes the file, if there is one.
    ///
    /// # Errors
    /// It cannot be removed.
    pub fn remove(self) -> Result<(), FileError> {
        drop(self.file);
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(FileError::write(&self.path, error)),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_goes_on_behind_what_is_valid() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("a.vts");
        let journal = Journal::beside(&output);
        assert_eq!((journal.read().unwrap(), journal.path()), (vec![], &*folder.path().join("a.vts.part")));
        let mut journal = Journal::beside(&output);
        journal.append(0, b"one").unwrap();
        journal.append(0, b"two").unwrap();
        drop(journal);
        let mut journal = Journal::beside(&output);
        assert_eq!(journal.read().unwrap(), b"onetwo");
        journal.append(4, b"!").unwrap();
        assert_eq!(journal.read().unwrap(), b"onet!");
        journal.remove().unwrap();
        Journal::beside(&output).remove().unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_journal_that_cannot_be_written_names_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = Journal::beside(&folder.path().join("missing/a.vts"));
        assert!(journal.append(0, b"one").unwrap_err().to_string().contains("a.vts.part"));
    }
}
