//! Output folders.

use std::{
    fs,
    path::{Path, PathBuf},
};

use epigraph_files::Target;

use crate::error::CliError;

/// An output folder. If it is made for a command and nothing is written there, it goes again.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    made: bool,
}

impl Folder {
    /// Makes the folder if it does not exist.
    ///
    /// # Errors
    /// If the path is a file, or if the folder's parent is missing or write-protected.
    pub fn new(path: &Path) -> Result<Self, CliError> {
        let made = !path.is_dir();
        if path.exists() && made {
            return Err(CliError::write(path, "it is a file; name a folder"));
        }
        if made {
            Target::new(path)?;
            fs::create_dir(path).map_err(|error| CliError::write(path, error))?;
        }
        Ok(Self { path: path.to_owned(), made })
    }

    /// The path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if self.made {
            // Succeeds only if the folder is empty, and nothing is lost if it stays.
            let _ = fs::remove_dir(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_was_made_goes_if_it_is_empty() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("new");
        drop(Folder::new(&path).unwrap());
        assert!(!path.exists());
        let folder = Folder::new(&path).unwrap();
        fs::write(folder.file("a.txt"), "a").unwrap();
        drop(folder);
        assert_eq!(fs::read(path.join("a.txt")).unwrap(), b"a");
        drop(Folder::new(&path).unwrap());
        fs::remove_file(path.join("a.txt")).unwrap();
        drop(Folder::new(&path).unwrap());
        assert!(path.exists(), "it was there before");
    }

    #[test]
    fn invalid_folders_are_reported_beforehand() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("file");
        fs::write(&file, "x").unwrap();
        let text = |path: &Path| Folder::new(path).unwrap_err().to_string();
        assert!(text(&file).contains("name a folder"));
        assert!(text(&place.path().join("none/new")).contains("there is no folder"));
    }
}
