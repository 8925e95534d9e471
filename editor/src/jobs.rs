//! Work on other threads than the window's: files are written while the window stays responsive.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, mpsc},
    thread,
};

/// The outcome of a job, as text for the user.
pub type Outcome = Result<String, String>;

/// Jobs under way.
pub struct Jobs {
    done: mpsc::Receiver<Outcome>,
    tell: mpsc::Sender<Outcome>,
    wake: Arc<dyn Fn() + Send + Sync>,
}

impl Jobs {
    /// No jobs yet. `wake` is called from a job's thread when the job is done.
    pub fn new(wake: impl Fn() + Send + Sync + 'static) -> Self {
        let (tell, done) = mpsc::channel();
        Self { done, tell, wake: Arc::new(wake) }
    }

    /// Starts a job on a thread of its own.
    pub fn start(&self, work: impl FnOnce() -> Outcome + Send + 'static) {
        let (tell, wake) = (self.tell.clone(), self.wake.clone());
        let started = thread::Builder::new().name("job".into()).spawn(move || {
            let outcome = catch_unwind(AssertUnwindSafe(work));
            // The window may be gone by now; then the outcome is lost.
            let _ =
                tell.send(outcome.unwrap_or_else(|_| Err("the action panicked and was cancelled".into())));
            wake();
        });
        if let Err(error) = started {
            let _ = self.tell.send(Err(error.to_string()));
        }
    }

    /// The outcome of the job that ended first since the last call.
    pub fn news(&self) -> Option<Outcome> {
        self.done.try_recv().ok()
    }
}
