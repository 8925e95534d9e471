//! Converged pictures of the frames to compare, kept until all graphs are compared with them.

use epigraph::memory;
use epigraph_pictures::{Difference, Picture};

use super::measure::{Figures, FrameFigures, View};
use crate::{
    args::QualityArgs,
    converged::{self, Converged, Take},
    edge_mask,
    error::CliError,
};

/// Bytes per pixel during a comparison, and in each reference.
const BYTES_TO_COMPARE: u64 = 256;
const BYTES_TO_KEEP: u64 = 16;

/// The references of one scene and camera path.
pub struct References {
    /// In the order of the frames; a single one if nothing moves.
    views: Vec<Converged>,
}

impl References {
    /// Traces the references.
    ///
    /// # Errors
    /// If there is not enough memory.
    pub fn trace(args: &QualityArgs, view: &View, frames: &[u32]) -> Result<Self, CliError> {
        let size = args.size.0;
        let frames = converged::different(&view.place, frames);
        let bytes = BYTES_TO_COMPARE + BYTES_TO_KEEP * frames.len() as u64;
        memory::require(u64::from(size[0]) * u64::from(size[1]) * bytes)?;
        let converged = |&frame: &u32| -> Result<_, CliError> {
            let label = format!("{}, {}, reference {frame}", view.scene_name, view.camera);
            let take = Take { place: &view.place, frame, size, mode: args.mode };
            Ok(take.converged(take.colors(&label, args.spp, args.seed)?))
        };
        Ok(Self { views: frames.iter().map(converged).collect::<Result<_, _>>()? })
    }

    /// The share of pixels near edges, 0 to 1, mean over the frames.
    pub fn edge_share(&self) -> f64 {
        let shares = self.views.iter().map(|view| edge_mask::share(&view.edges));
        shares.sum::<f64>() / self.views.len().max(1) as f64
    }

    /// Compares a picture with its reference; `index` is the index of `frame` in the list of frames.
    pub fn compare(&self, index: usize, frame: u32, picture: &Picture) -> FrameFigures {
        let Converged { picture: reference, edges } = &self.views[index.min(self.views.len() - 1)];
        let difference = Difference::new(reference, picture);
        let near = || Figures { psnr: difference.psnr_within(edges), flip: difference.flip_within(edges) };
        FrameFigures {
            frame,
            whole: Figures { psnr: difference.psnr(), flip: difference.flip() },
            edges: edges.contains(&true).then(near),
        }
    }
}
