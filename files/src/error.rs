use std::path::{Path, PathBuf};

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
