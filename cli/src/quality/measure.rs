//! Runs one graph and compares the pictures of some of its frames.

use std::sync::Arc;

use epigraph_core::{Gpu, Graph, GraphFile, Host, Plan, Registry, Settings, Side, compile};
use epigraph_pictures::{Look, Picture, show, size};
use epigraph_scenes::{CameraPath, Scene};
use epigraph_stages::World;

use super::reference::References;
use crate::{error::CliError, progress, render, values::Samples};

/// A graph and what the user calls it.
pub struct Named {
    /// The name.
    pub name: String,
    /// The graph.
    pub file: GraphFile,
}

/// A scene and a camera's way through it.
pub struct View {
    /// What the user calls the scene.
    pub scene_name: String,
    /// What the user calls the path.
    pub camera: String,
    /// Its mesh and lights.
    pub scene: Arc<Scene>,
    /// The path.
    pub path: CameraPath,
}

/// How far pictures are from their references.
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
    /// Of all pixels.
    pub whole: Figures,
    /// Of the pixels near edges; none where there are none.
    pub edges: Option<Figures>,
}

/// A run of a graph.
pub struct Job<'a> {
    /// The stages.
    pub registry: &'a Registry,
    /// The graph.
    pub named: &'a Named,
    /// Where nodes run that do not say.
    pub side: Side,
    /// The GPU, where it is open.
    pub gpu: Option<Arc<Gpu>>,
    /// The scene and the camera.
    pub view: &'a View,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples that a frame may ask for, as the user has it.
    pub samples: Samples,
    /// The same as a number.
    pub count: u32,
    /// Chooses the random numbers.
    pub seed: u32,
}

impl Job<'_> {
    /// Makes sure that the graph compiles for the scene and shows a picture.
    pub fn check(&self) -> Result<(), CliError> {
        let (graph, plan) = self.compile()?;
        render::image_output(&self.named.file, &graph, self.size)?;
        render::require_memory(&plan, self.gpu.as_deref())
    }

    /// Runs all frames up to the last of `frames` (ascending), and compares those with their references.
    pub fn run(
        &self,
        host: &Host,
        frames: &[u32],
        references: &References,
    ) -> Result<Vec<FrameFigures>, CliError> {
        let View { scene_name, camera, path, .. } = self.view;
        let (graph, plan) = self.compile()?;
        let output = render::image_output(&self.named.file, &graph, self.size)?;
        let mut executor = render::executor(graph, plan, &self.settings(), self.registry, self.gpu.clone())?;
        let count = frames.last().map_or(0, |last| last + 1);
        let label = format!("{scene_name}, {camera}, {}, {}", self.named.name, self.samples);
        let bar = progress::bar(count.into(), &label, "frames");
        let mut figures = Vec::with_capacity(frames.len());
        for index in 0..count {
            let compared = frames.binary_search(&index).ok();
            let frame = World::frame(path, index, self.size, self.count, self.seed);
            executor.run(&frame, host, compared.is_some())?;
            if let Some(nth) = compared
                && let Some(image) = executor.snapshot(&output, "")?
            {
                let look = Look { far: path.camera(index).far, ..Look::default() };
                let picture = Picture::shown(size(image.dims), &show(image, &look).colors);
                figures.push(references.compare(nth, index, &picture));
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(figures)
    }

    fn compile(&self) -> Result<(Graph, Plan), CliError> {
        Ok(compile(&self.named.file, self.registry, &self.settings())?)
    }

    fn settings(&self) -> Settings {
        let facts = World::facts(&self.view.scene, self.view.path.moves());
        Settings { facts, side: self.side, ..Settings::new(self.size, self.count) }
    }
}
