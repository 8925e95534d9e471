use epigraph_core::{GraphError, Problem, Problems, RunError};
use epigraph_scenes::{PathError, SceneError};

/// The reason why a graph cannot run. The text says what is wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The graph has problems, each with its place in the file.
    #[error("{0}")]
    Graph(#[from] Problems),
    /// The graph failed to run.
    #[error("{0}")]
    Run(#[from] RunError),
    /// The scene cannot be loaded.
    #[error("{0}")]
    Scene(#[from] SceneError),
    /// The camera path is invalid.
    #[error("{0}")]
    Path(#[from] PathError),
    /// The machine has too little memory.
    #[error("{0}")]
    Memory(String),
    /// Any other error that the caller can fix.
    #[error("{0}")]
    Input(String),
}

impl From<Problem> for Error {
    fn from(problem: Problem) -> Self {
        Self::Graph(problem.into())
    }
}

impl From<GraphError> for Error {
    fn from(error: GraphError) -> Self {
        Problem::new(error).into()
    }
}
