//! What an experiment keeps in its folder: finished cells and references, each in a file that is named by what it was
//! made from. Several processes may work on one folder: a file is whole or absent, and two processes that make the same
//! file make the same contents, but for times.

use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
};

use epigraph_files::{MOST_DATA, Target, commit};
use epigraph_pictures::{Picture, Ramp, exr, png, tone};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::Value;

use super::cell::{Found, Record};
use crate::{error::CliError, folder::Folder};

/// The folder of an experiment.
pub struct Store {
    // Dropped first: a folder that was made and is empty goes.
    cells: Folder,
    searches: Folder,
    pictures: Folder,
    references: Folder,
    root: Folder,
}

impl Store {
    /// Makes the folder if it does not exist.
    ///
    /// # Errors
    /// If it is a file, or cannot be made.
    pub fn new(path: &Path) -> Result<Self, CliError> {
        let root = Folder::new(path)?;
        let folder = |name: &str| Folder::new(&root.file(name));
        let (cells, searches) = (folder("cells")?, folder("searches")?);
        let (pictures, references) = (folder("pictures")?, folder("references")?);
        Ok(Self { cells, searches, pictures, references, root })
    }

    /// The folder.
    pub fn root(&self) -> &Folder {
        &self.root
    }

    /// The result of a cell, if it is there.
    ///
    /// # Errors
    /// The file is there, but is not one that this program has written.
    pub fn cell(&self, key: &str) -> Result<Option<Record>, CliError> {
        read(&self.cells.file(&format!("{key}.json")))
    }

    /// Keeps the result of a cell.
    ///
    /// # Errors
    /// The system's error.
    pub fn keep_cell(&self, record: &Record) -> Result<(), CliError> {
        keep(&self.cells.file(&format!("{}.json", record.cell.key)), record)
    }

    /// The last compared picture of a cell, if it is there.
    ///
    /// # Errors
    /// The file is there, but is not one that this program has written.
    pub fn picture(&self, key: &str) -> Result<Option<Picture>, CliError> {
        let path = self.picture_path(key);
        Ok(path.exists().then(|| Picture::read(&path)).transpose()?)
    }

    /// The same as a PNG file.
    ///
    /// # Errors
    /// The system's error.
    pub fn picture_file(&self, key: &str) -> Result<Option<Vec<u8>>, CliError> {
        file(&self.picture_path(key))
    }

    /// The FLIP error map of this picture as a PNG file, if it is there.
    ///
    /// # Errors
    /// The system's error.
    pub fn map_file(&self, key: &str) -> Result<Option<Vec<u8>>, CliError> {
        file(&self.map_path(key))
    }

    /// Keeps the last compared picture of a cell, and its FLIP error map from the errors of its pixels.
    ///
    /// # Errors
    /// The system's error.
    pub fn keep_picture(&self, key: &str, picture: &Picture, errors: &[f32]) -> Result<(), CliError> {
        let colors = picture.srgb().into_iter().map(|color| color.map(tone::to_byte)).collect();
        let map = errors.iter().map(|error| Ramp::Magma.color(*error)).collect();
        let draft = |(path, colors): (PathBuf, Vec<[u8; 3]>)| {
            let bytes = png(picture.size, &colors).map_err(|cause| CliError::write(&path, cause))?;
            Ok(Target::new(&path)?.draft(&bytes)?)
        };
        let files = [(self.picture_path(key), colors), (self.map_path(key), map)];
        let drafts = files.into_iter().map(draft).collect::<Result<_, CliError>>()?;
        Ok(commit(drafts)?)
    }

    /// The answer of a search, if it is there.
    ///
    /// # Errors
    /// The file is there, but is not one that this program has written.
    pub fn search(&self, key: &str) -> Result<Option<Found>, CliError> {
        read(&self.searches.file(&format!("{key}.json")))
    }

    /// Keeps the answer of a search.
    ///
    /// # Errors
    /// The system's error.
    pub fn keep_search(&self, found: &Found) -> Result<(), CliError> {
        keep(&self.searches.file(&format!("{}.json", found.key)), found)
    }

    /// Whether a reference is there.
    ///
    /// # Errors
    /// What is known of it is there, but is not what this program has written.
    pub fn has_reference(&self, key: &str) -> Result<bool, CliError> {
        let [_, facts] = self.reference_paths(key);
        Ok(read::<Value>(&facts)?.is_some())
    }

    /// A reference with what is known of it, if it is there.
    ///
    /// # Errors
    /// The files are there, but are not those that this program has written.
    pub fn reference<T: DeserializeOwned>(&self, key: &str) -> Result<Option<(Picture, T)>, CliError> {
        let [picture, facts] = self.reference_paths(key);
        let Some(facts) = read(&facts)? else { return Ok(None) };
        Ok(Some((Picture::read(&picture)?, facts)))
    }

    /// Keeps a reference with what is known of it.
    ///
    /// # Errors
    /// The system's error.
    pub fn keep_reference(&self, key: &str, picture: &Picture, facts: &Value) -> Result<(), CliError> {
        let [to, to_facts] = self.reference_paths(key);
        let bytes = exr(picture.size, &picture.colors).map_err(|cause| CliError::write(&to, cause))?;
        // The picture is in its place before the facts are, which say that it is there.
        let picture = Target::new(&to)?.draft(&bytes)?;
        let facts = Target::new(&to_facts)?.draft(format!("{facts:#}\n").as_bytes())?;
        Ok(commit(vec![picture, facts])?)
    }

    fn picture_path(&self, key: &str) -> PathBuf {
        self.pictures.file(&format!("{key}.png"))
    }

    fn map_path(&self, key: &str) -> PathBuf {
        self.pictures.file(&format!("{key}-flip.png"))
    }

    fn reference_paths(&self, key: &str) -> [PathBuf; 2] {
        ["exr", "json"].map(|ending| self.references.file(&format!("{key}.{ending}")))
    }
}

fn keep<T: Serialize>(path: &Path, value: &T) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value).expect("the keys of all maps are texts");
    Ok(Target::new(path)?.write(text.as_bytes())?)
}

/// The contents of a file, if it is there.
fn file(path: &Path) -> Result<Option<Vec<u8>>, CliError> {
    match epigraph_files::bytes(path, MOST_DATA) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        bytes => bytes.map(Some).map_err(|error| CliError::read(path, error)),
    }
}

fn read<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, CliError> {
    match epigraph_files::text(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(CliError::read(path, error)),
        Ok(text) => serde_json::from_str(&text)
            .map(Some)
            .map_err(|error| CliError::read(path, format!("{error}; remove the file, and it is made again"))),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use serde_json::json;

    use super::*;
    use crate::tradeoff::cell::tests::{cell, record};

    #[test]
    fn what_is_kept_is_found_and_what_is_damaged_reported() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("out");
        drop(Store::new(&path).unwrap());
        assert!(!path.exists(), "nothing was kept");
        let store = Store::new(&path).unwrap();
        let kept = record(cell("epi", 5, 1), 0.25, 3.0);
        assert_eq!(store.cell(&kept.cell.key).unwrap(), None);
        store.keep_cell(&kept).unwrap();
        assert_eq!(store.cell(&kept.cell.key).unwrap().as_ref(), Some(&kept));
        // It is replaced, though it was read.
        store.keep_cell(&kept).unwrap();
        let picture = Picture { size: [2, 1], colors: vec![[0.1, 7.0, 0.0]; 2], linear: true };
        assert!(store.picture("a").unwrap().is_none() && store.map_file("a").unwrap().is_none());
        store.keep_picture("a", &picture, &[0.0, 1.0]).unwrap();
        // As displayed.
        let kept = store.picture("a").unwrap().unwrap();
        assert_eq!((kept.srgb_at(1)[1], kept.srgb_at(1)[2]), (1.0, 0.0));
        assert!(store.map_file("a").unwrap().unwrap().starts_with(b"\x89PNG"));
        assert!(store.reference::<Value>("a").unwrap().is_none());
        store.keep_reference("a", &picture, &json!({ "spp": 4 })).unwrap();
        assert_eq!(store.reference::<Value>("a").unwrap(), Some((picture, json!({ "spp": 4 }))));
        fs::write(path.join("cells/b.json"), "{").unwrap();
        let text = store.cell("b").unwrap_err().to_string();
        assert!(text.contains("b.json") && text.contains("remove the file"), "{text}");
    }
}
