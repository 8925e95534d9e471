//! Paths in graph files: where they are written, and how they lead from one folder to another.

use std::path::{Component, Path, PathBuf};

use super::parts::{FILE_PARAM, PART_KIND};

/// Whether this parameter of a node of this kind is the path of a file, from the folder of the file that sets it.
pub fn names_file(kind: &str, param: &str) -> bool {
    matches!((kind, param), (PART_KIND, FILE_PARAM) | ("wgsl", "shader"))
}

/// The RON text of a path that led from one folder to a file, for another folder; `None` if it stays as it is.
pub fn moved_path(value: &str, from: &Path, to: &Path) -> Option<String> {
    let named: String = ron::from_str(value).ok()?;
    let leads = relative(to, &from.join(&named)).display().to_string().replace('\\', "/");
    (leads != named).then(|| format!("{leads:?}"))
}

/// The relative path from a folder to a file; absolute if there is none.
pub fn relative(folder: &Path, file: &Path) -> PathBuf {
    let real = |path: &Path| {
        let path = if path == Path::new("") { Path::new(".") } else { path };
        path.canonicalize().unwrap_or_else(|_| path.to_owned())
    };
    let (folder, file) = (real(folder), real(file));
    let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    if !matches!(folder.components().next(), Some(Component::Prefix(_) | Component::RootDir)) || common == 0 {
        return file;
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    up.chain(file.components().skip(common)).collect()
}
