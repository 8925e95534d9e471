//! Which file a path leads to.

use std::{
    fs::{self, Metadata},
    io,
    path::{Path, PathBuf},
};

/// The file that a path leads to, whatever the path's spelling, through symbolic links and hard ones.
#[derive(Clone, Debug)]
pub struct Identity {
    /// The path without links, `.` and `..`.
    path: PathBuf,
    /// Device and number of the file, which hard links share; `None` for a file that does not exist.
    node: Option<(u64, u64)>,
}

impl Identity {
    /// The file at this path, or the one that writing would make there. `None` for a stream: many may write to one.
    ///
    /// # Errors
    /// The path is a folder, or leads through a folder that does not exist or cannot be searched.
    pub fn of(path: &Path) -> io::Result<Option<Self>> {
        match fs::metadata(path) {
            Ok(data) if data.is_file() => Ok(Some(Self { path: path.canonicalize()?, node: node(&data) })),
            Ok(data) if data.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
            Ok(_) => Ok(None),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                Ok(Some(Self { path: absent(path)?, node: None }))
            }
            Err(error) => Err(error),
        }
    }

    /// Where this process writes results and messages, by name, as far as these are files (`> FILE`).
    pub fn of_standard_streams() -> Vec<(&'static str, Self)> {
        #[cfg(unix)]
        {
            use std::os::fd::AsFd;
            let (stdout, stderr) = (io::stdout(), io::stderr());
            let file = |(name, stream): (_, std::os::fd::BorrowedFd)| {
                let data = fs::File::from(stream.try_clone_to_owned().ok()?).metadata().ok()?;
                data.is_file().then(|| (name, Self { path: PathBuf::new(), node: node(&data) }))
            };
            [("stdout", stdout.as_fd()), ("stderr", stderr.as_fd())].into_iter().filter_map(file).collect()
        }
        #[cfg(not(unix))]
        Vec::new()
    }

    /// Whether both are one file.
    pub fn is(&self, other: &Self) -> bool {
        self.path == other.path || (self.node.is_some() && self.node == other.node)
    }

    /// The file's path without links.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Whether a path leads to a pipe, a socket or a device: it has no contents that could be replaced.
pub fn is_stream(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|data| !data.is_file() && !data.is_dir())
}

/// Where writing would make a file: where a link leads if it leads nowhere yet.
fn absent(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    // Links that lead in a circle are another error than that the file is missing, so this ends.
    while let Ok(to) = fs::read_link(&path) {
        path = folder_of(&path).join(to);
    }
    let name = path.file_name().ok_or(io::ErrorKind::InvalidFilename)?;
    Ok(folder_of(&path).canonicalize()?.join(name))
}

/// The folder that a file is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

#[cfg(unix)]
fn node(data: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((data.dev(), data.ino()))
}

#[cfg(not(unix))]
fn node(_: &Metadata) -> Option<(u64, u64)> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is(a: &Path, b: &Path) -> bool {
        let [a, b] = [a, b].map(|path| Identity::of(path).unwrap().unwrap());
        a.is(&b)
    }

    #[cfg(unix)]
    #[test]
    fn a_file_is_the_same_by_every_spelling_and_link() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("deep")).unwrap();
        fs::write(path("a"), "same").unwrap();
        fs::write(path("b"), "same").unwrap();
        std::os::unix::fs::symlink("../a", path("deep/link")).unwrap();
        fs::hard_link(path("a"), path("deep/hard")).unwrap();
        for other in ["a", "./a", "deep/../a", "deep/link", "deep/hard"] {
            assert!(is(&path("a"), &path(other)), "{other}");
            assert!(!is(&path("b"), &path(other)), "{other}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn files_to_be_made_are_the_same_by_every_spelling_and_link() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("deep")).unwrap();
        std::os::unix::fs::symlink("../new", path("deep/link")).unwrap();
        std::os::unix::fs::symlink("link", path("deep/again")).unwrap();
        for other in ["new", "deep/../new", "deep/link", "deep/again"] {
            assert!(is(&path("new"), &path(other)), "{other}");
            assert!(!is(&path("deep/new"), &path(other)), "{other}");
        }
        std::os::unix::fs::symlink("circle", path("circle")).unwrap();
        assert!(Identity::of(&path("circle")).is_err());
        assert!(Identity::of(&path("none/new")).is_err());
        assert!(Identity::of(&path("deep")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn streams_are_no_files() {
        assert!(Identity::of(Path::new("/dev/null")).unwrap().is_none());
        assert!(
            is_stream(Path::new("/dev/null")) && !is_stream(Path::new("/")) && !is_stream(Path::new("/none"))
        );
    }
}
