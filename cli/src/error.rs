use std::path::Path;

use epigraph_core::{GraphError, Problem, Problems, RunError};
use epigraph_pictures::FileError;
use epigraph_scenes::{PathError, SceneError};

/// Why a command failed. Its text says what is wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The graph is wrong; each problem with its place.
    #[error("{0}")]
    Graph(#[from] Problems),
    /// The graph does not run.
    #[error("{0}")]
    Run(#[from] RunError),
    /// The scene does not load.
    #[error("{0}")]
    Scene(#[from] SceneError),
    /// The camera path is wrong.
    #[error("{0}")]
    Path(#[from] PathError),
    /// A file cannot be read or written.
    #[error("{0}")]
    File(#[from] FileError),
    /// Anything else that the user can mend.
    #[error("{0}")]
    Input(String),
}

impl CliError {
    /// That `path` cannot be written.
    pub fn write(path: &Path, cause: impl ToString) -> Self {
        FileError::write(path, cause).into()
    }

    /// That `path` cannot be read.
    pub fn read(path: &Path, cause: impl ToString) -> Self {
        FileError::read(path, cause).into()
    }
}

impl From<Problem> for CliError {
    fn from(problem: Problem) -> Self {
        Self::Graph(problem.into())
    }
}

impl From<GraphError> for CliError {
    fn from(error: GraphError) -> Self {
        Problem::new(error).into()
    }
}
