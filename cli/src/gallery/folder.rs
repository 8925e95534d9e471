//! A folder that is filled in one go.

use std::{
    fs,
    path::{Path, PathBuf},
};

use epigraph_pictures::Target;

use crate::error::CliError;

/// A folder to be filled later, and made then where there is none.
#[derive(Debug)]
pub struct Folder(PathBuf);

impl Folder {
    /// Makes sure that files can be written there, so that no work is lost for a mistyped path. Leaves nothing behind.
    ///
    /// # Errors
    /// That it is a file, or that it, or the folder for it, is not there or write-protected.
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

    /// Writes files by name, each whole or not at all.
    ///
    /// # Errors
    /// The first file that cannot be written; those before it are there then.
    pub fn write(&self, files: &[(String, Vec<u8>)]) -> Result<(), CliError> {
        if !self.0.is_dir() {
            fs::create_dir(&self.0).map_err(|error| CliError::write(&self.0, error))?;
        }
        // All are seen to be writable before the first changes.
        let targets: Result<Vec<_>, _> =
            files.iter().map(|(name, _)| Target::new(&self.0.join(name))).collect();
        targets?.iter().zip(files).try_for_each(|(target, (_, bytes))| Ok(target.write(bytes)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_is_made_when_there_is_something_to_put_in() {
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
    fn what_is_no_folder_is_found_beforehand() {
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
