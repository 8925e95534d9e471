//! The core's helpers for tests ([`epigraph_core::testing`]), with the modules of this package's shaders.

pub use epigraph_core::testing::{Both, Random, settings};

use epigraph_core::{Harness, Outputs, Stage, testing};

/// Runs a frame of the twin.
#[track_caller]
pub fn run_cpu<S: Stage>(harness: &mut Harness<S>) -> Outputs {
    testing::run_cpu(harness, &crate::registry())
}

/// Runs a frame of the twin, and one of the shader.
#[track_caller]
pub fn run_both<S: Stage>(harness: &mut Harness<S>) -> Both {
    testing::run_both(harness, &crate::registry())
}
