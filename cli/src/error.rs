use std::path::Path;

use epigraph_core::{GraphError, Problem, Problems, RunError};
use epigraph_files::FileError;
use epigraph_scenes::{PathError, SceneError};

/// The reason why a command failed. Its text says what is wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The graph, the scene or the camera path is wrong, or does not run here.
    #[error("{0}")]
    Run(#[from] epigraph::Error),
    /// A file cannot be read or written.
    #[error("{0}")]
    File(#[from] FileError),
    /// Points cannot be read.
    #[error("{0}")]
    Points(#[from] epigraph_points::ReadError),
    /// Any other error that the user can fix.
    #[error("{0}")]
    Input(String),
    /// The user interrupted the command before it wrote anything.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

impl CliError {
    /// The error that `path` cannot be written.
    pub fn write(path: &Path, cause: impl ToString) -> Self {
        FileError::write(path, cause).into()
    }

    /// The error that `path` cannot be read.
    pub fn read(path: &Path, cause: impl ToString) -> Self {
        FileError::read(path, cause).into()
    }
}

macro_rules! from_run {
    ($($error:ty),*) => {$(
        impl From<$error> for CliError {
            fn from(error: $error) -> Self {
                Self::Run(error.into())
            }
        }
    )*};
}
from_run!(GraphError, Problem, Problems, RunError, SceneError, PathError);
