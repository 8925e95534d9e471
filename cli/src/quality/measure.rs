//! Runs one graph and compares the pictures of some of its frames.

use std::sync::Arc;

use epigraph::{Device, Place, Registry, Samples, Setup};
use epigraph_core::GraphFile;
use epigraph_pictures::{Look, Picture, show, size};

use super::reference::References;
use crate::{error::CliError, open};

/// A graph and the user's name for it.
pub struct Named {
    /// The name.
    pub name: String,
    /// The graph.
    pub file: GraphFile,
}

/// A scene and a camera path through it.
pub struct View {
    /// The scene as given on the command line.
    pub scene_name: String,
    /// The path as given on the command line.
    pub camera: String,
    /// The loaded scene and path.
    pub place: Place,
}

/// The difference of pictures from their references.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Peak signal-to-noise ratio, decibels.
    pub psnr: f64,
    /// Mean FLIP, 0 to 1.
    pub flip: f64,
}

/// The figures of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameFigures {
    /// Its number, from 0.
    pub frame: u32,
    /// Figures of all pixels.
    pub whole: Figures,
    /// Figures of the pixels near edges; `None` if there are no such pixels.
    pub edges: Option<Figures>,
}

/// A run of a graph.
pub struct Job<'a> {
    /// The stages.
    pub registry: &'a Arc<Registry>,
    /// The graph.
    pub named: &'a Named,
    /// The default device of nodes.
    pub device: &'a Device,
    /// The scene and the camera.
    pub view: &'a View,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Maximum number of samples per frame, as given on the command line.
    pub samples: Samples,
    /// The same as a count.
    pub count: u32,
    /// The random seed.
    pub seed: u32,
}

impl Job<'_> {
    /// Checks that the graph compiles for the scene and outputs a picture, of a fixed exposure.
    pub fn check(&self) -> Result<(), CliError> {
        let mut compiled = self.setup().compile()?;
        compiled.picture()?;
        open::require_fixed_exposure(compiled.graph())?;
        Ok(compiled.require()?)
    }

    /// Runs all frames up to the last one in `frames` (ascending), and compares those in `frames` with their
    /// references.
    pub fn run(&self, frames: &[u32], references: &References) -> Result<Vec<FrameFigures>, CliError> {
        let View { scene_name, camera, .. } = self.view;
        let mut run = self.setup().start()?;
        let output = run.picture()?;
        let count = frames.last().map_or(0, |last| last + 1);
        let label = format!("{scene_name}, {camera}, {}, {}", self.named.name, self.samples);
        let mut figures = Vec::with_capacity(frames.len());
        let nth = |index: u32| frames.binary_search(&index).ok();
        open::frames(
            &mut run,
            count,
            &label,
            |index| nth(index).is_some(),
            |run, index| {
                if let Some(nth) = nth(index) {
                    let look = Look { far: run.path().camera(index).far, ..Look::default() };
                    let image = run.snapshot(&output)?;
                    let picture = Picture::shown(size(image.dims), &show(image, &look).colors);
                    figures.push(references.compare(nth, index, &picture));
                }
                Ok(())
            },
        )?;
        Ok(figures)
    }

    fn setup(&self) -> Setup {
        Setup::new(self.named.file.clone())
            .registry(self.registry.clone())
            .at(&self.view.place)
            .device(self.device)
            .size(self.size)
            .samples(Samples::Count(self.count))
            .seed(self.seed)
    }
}
