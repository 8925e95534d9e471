//! Ctrl-C: work ends at the next frame or pixel, and files are complete or untouched. A second Ctrl-C ends the
//! program at once.

use std::{
    process::exit,
    sync::atomic::{AtomicBool, Ordering},
};

use crate::{INTERRUPTED, error::CliError};

static ASKED: AtomicBool = AtomicBool::new(false);

/// Installs the handler for Ctrl-C.
pub fn watch() {
    let taken = ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::Relaxed) {
            exit(INTERRUPTED.into());
        }
    });
    if let Err(error) = taken {
        // Ctrl-C then ends the program at once, and only unfinished work is lost.
        eprintln!("warning: Ctrl-C cannot be caught: {error}");
    }
}

/// Returns true if the user has pressed Ctrl-C.
pub fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// Ends a command that has not written anything yet.
///
/// # Errors
/// [`CliError::Interrupted`] if the user has pressed Ctrl-C.
pub fn check() -> Result<(), CliError> {
    if asked() { Err(CliError::Interrupted) } else { Ok(()) }
}
