use epigraph_core::{GraphError, Problem, Problems, RunError};
use epigraph_scenes::{PathError, SceneError};

/// Why something cannot run. The text says what is wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
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
    /// The machine has too little memory.
    #[error("{0}")]
    Memory(String),
    /// Anything else that whoever asked can mend.
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
