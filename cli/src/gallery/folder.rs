//! An output folder whose files are all written at the end.

use std::{
    fs,
    path::{Path, PathBuf},
};

use epigraph_pictures::Target;

use crate::error::CliError;

/// An output folder. It is created on the first write if it does not exist.
#[derive(Debug)]
pub struct Folder(PathBuf);

impl Folder {
    /// Checks that files can be written there, so that a mistyped path costs no work. Leaves nothing behind.
    ///
    /// # Errors
    /// If the path is a file, or if the folder or its parent is missing or write-protected.
    pub fn new(path: &Path) -> Result<Self, CliError> {
        if path.is_dir() {
            Target::new(&path.join("probe"))?;
        } else if path.exists() {
            return Err(CliError::write(path, "it is a file; name a folder"));
        } else {
            Target::new(path)?;
        }
        Ok(Self(path.to_owned()))
    }

    /// Writes files by name, each completely or not at all.
    ///
    /// # Errors
    /// The first file that cannot be written. Files before it may have been written.
    pub fn write(&self, files: &[(String, Vec<u8>)]) -> Result<(), CliError> {
        if !self.0.is_dir() {
            fs::create_dir(&self.0).map_err(|error| CliError::write(&self.0, error))?;
        }
        // All files are checked before the first one is written.
        let targets: Result<Vec<_>, _> =
            files.iter().map(|(name, _)| Target::new(&self.0.join(name))).collect();
        targets?.iter().zip(files).try_for_each(|(target, (_, bytes))| Ok(target.write(bytes)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_is_created_on_the_first_write() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("new");
        let folder = Folder::new(&path).unwrap();
        assert!(!path.exists());
        folder.write(&[("a.txt".into(), b"a".into()), ("b.txt".into(), b"b".into())]).unwrap();
        Folder::new(&path).unwrap().write(&[("a.txt".into(), b"c".into())]).unwrap();
        assert_eq!(fs::read(path.join("a.txt")).unwrap(), b"c");
        assert_eq!(fs::read_dir(&path).unwrap().count(), 2);
    }

    #[test]
    fn invalid_folders_are_reported_beforehand() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("file");
        fs::write(&file, "x").unwrap();
        let text = |path: &Path| Folder::new(path).unwrap_err().to_string();
        assert!(text(&file).contains("name a folder"));
        assert!(text(&place.path().join("none/new")).contains("there is no folder"));
        fs::create_dir(place.path().join("a.txt")).unwrap();
        let folder = Folder::new(place.path()).unwrap();
        assert!(folder.write(&[("b.txt".into(), vec![]), ("a.txt".into(), vec![])]).is_err());
        assert!(!place.path().join("b.txt").exists());
    }
}
