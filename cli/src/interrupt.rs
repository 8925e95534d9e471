//! Ctrl-C: work ends at the next frame or row of pixels, and files are whole or untouched. A second Ctrl-C ends the program
//! at once.

use std::{
    process::exit,
    sync::atomic::{AtomicBool, Ordering},
};

use crate::{INTERRUPTED, error::CliError};

static ASKED: AtomicBool = AtomicBool::new(false);

/// Takes Ctrl-C from now on.
pub fn watch() {
    let taken = ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::Relaxed) {
            exit(INTERRUPTED.into());
        }
    });
    if let Err(error) = taken {
        // Ctrl-C then ends the program at once, which loses nothing but the work.
        eprintln!("warning: Ctrl-C cannot be caught: {error}");
    }
}

/// Whether the user has asked to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// Ends a command that has nothing to write yet.
///
/// # Errors
/// [`CliError::Interrupted`] where the user has asked to stop.
pub fn check() -> Result<(), CliError> {
    if asked() { Err(CliError::Interrupted) } else { Ok(()) }
}
