//! Files that a mesh file names, such as its materials.

use std::fs;
use std::path::{Path, PathBuf};

use epigraph_files as files;

/// The files that the one at `mesh` names. Such a name is relative to the folder of the mesh. Names from other systems are
/// understood: with backslashes, in other case, or absolute on the machine where the mesh was made; the file is then
/// expected beside the mesh.
pub(super) struct Beside<'a> {
    /// The path of the file that names others.
    pub mesh: &'a Path,
}

impl Beside<'_> {
    /// The bytes of a file of at most `most` bytes.
    ///
    /// # Errors
    /// There is no such file, or it cannot be read.
    pub fn bytes(&self, name: &str, most: u64) -> Result<Vec<u8>, String> {
        let path = self.find(name).unwrap_or_else(|| self.mesh.with_file_name(name));
        files::bytes(&path, most).map_err(|error| format!("cannot read {}: {error}", path.display()))
    }

    /// The file of that name, if there is one.
    fn find(&self, name: &str) -> Option<PathBuf> {
        let folder = self.mesh.parent()?;
        let as_written = folder.join(name);
        if as_written.is_file() {
            return Some(as_written);
        }
        let unified = name.trim().trim_matches('"').replace('\\', "/");
        let parts: Vec<&str> = unified.split('/').filter(|part| !part.is_empty() && *part != ".").collect();
        // As a path from the folder; then the last part alone.
        [&parts[..], parts.last().map_or(&[], std::slice::from_ref)]
            .into_iter()
            .find_map(|parts| walk(folder, parts))
            .filter(|path| path.is_file())
    }
}

/// The entry of a folder at a path of names, each in the case in which it is written, or in any.
fn walk(folder: &Path, parts: &[&str]) -> Option<PathBuf> {
    parts.iter().try_fold(folder.to_owned(), |folder, part| {
        let exact = folder.join(part);
        if exact.exists() {
            return Some(exact);
        }
        let listed = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
        let lower = part.to_lowercase();
        let is_like = |name: &PathBuf| {
            name.file_name().is_some_and(|name| name.to_string_lossy().to_lowercase() == lower)
        };
        // The first by name if there are several, whatever the order of the folder.
        fs::read_dir(listed).ok()?.filter_map(Result::ok).map(|entry| entry.path()).filter(is_like).min()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_systems_are_found() {
        let folder = std::env::temp_dir().join(format!("epigraph-beside-{}", std::process::id()));
        fs::create_dir_all(folder.join("Tex dir")).unwrap();
        fs::write(folder.join("Wood.PNG"), "wood").unwrap();
        fs::write(folder.join("Tex dir/stone 1.png"), "stone").unwrap();
        let mesh = folder.join("mesh.obj");
        let beside = Beside { mesh: &mesh };
        let text = |name: &str| beside.bytes(name, 100).map(|bytes| String::from_utf8(bytes).unwrap());
        for name in [
            "Wood.PNG",
            "wood.png",
            ".\\wood.png",
            "./Wood.PNG",
            "\"Wood.PNG\"",
            "wood.png/",
            "C:\\Users\\me\\textures\\wood.png",
            "/home/me/textures/WOOD.png",
            "textures/wood.png",
        ] {
            assert_eq!(text(name).as_deref(), Ok("wood"), "{name}");
        }
        for name in ["Tex dir/stone 1.png", "tex DIR\\Stone 1.PNG", "./Tex dir//stone 1.png"] {
            assert_eq!(text(name).as_deref(), Ok("stone"), "{name}");
        }
        for name in ["none.png", "Tex dir", "", "/", "..", "stone 1.png"] {
            assert!(text(name).is_err(), "{name}");
        }
        assert!(text("none.png").unwrap_err().contains("none.png"));
        fs::remove_dir_all(&folder).unwrap();
    }
}
