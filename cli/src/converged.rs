//! Converged pictures of frames, with the pixels near their edges.

use std::sync::Arc;

use epigraph::Place;
use epigraph_pictures::Picture;
use epigraph_scenes::Tracer;

use crate::{
    edge_mask,
    error::CliError,
    reference::{trace, trace_settings},
    values::Light,
};

/// A converged picture of one frame.
pub struct Converged {
    /// Linear.
    pub picture: Picture,
    /// The pixels near edges.
    pub edges: Vec<bool>,
}

/// The frames of which a converged picture is needed, if pictures of `frames` are compared: only the first one if nothing
/// moves, since the others are the same.
pub fn different<'f>(place: &Place, frames: &'f [u32]) -> &'f [u32] {
    let moves = place.path.moves() || !place.scene.bodies.is_empty();
    if moves { frames } else { &frames[..frames.len().min(1)] }
}

/// What is traced: a frame of a place, and how.
pub struct Take<'a> {
    /// The scene and the camera.
    pub place: &'a Place,
    /// The frame.
    pub frame: u32,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Light transport.
    pub mode: Light,
}

impl Take<'_> {
    /// Traces the linear colours with `spp` samples per pixel. `label` is shown at the progress bar.
    ///
    /// # Errors
    /// [`CliError::Interrupted`].
    pub fn colors(&self, label: &str, spp: u32, seed: u32) -> Result<Vec<[f32; 3]>, CliError> {
        let camera = self.place.path.camera(self.frame);
        trace(label, &self.tracer(), &camera, self.size, spp, &trace_settings(self.mode), seed)
    }

    /// The picture with these linear colours, and its edges.
    pub fn converged(&self, colors: Vec<[f32; 3]>) -> Converged {
        let edges = edge_mask::trace(&self.tracer(), &self.place.path.camera(self.frame), self.size);
        let size = self.size.map(|side| side as usize);
        Converged { picture: Picture { size, colors, linear: true }, edges }
    }

    fn tracer(&self) -> Arc<Tracer> {
        self.place.tracer().at(self.frame)
    }
}
