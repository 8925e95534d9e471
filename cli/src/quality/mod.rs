//! `epigraph quality`: compares the pictures of graphs with converged references, at equal numbers of samples per
//! frame.

mod measure;
mod plot;
mod reference;
mod report;

use std::sync::Arc;

use epigraph::{Device, Place, Registry, Samples};

use self::{
    measure::{Figures, FrameFigures, Job, Named, View},
    reference::References,
    report::Report,
};
use crate::{args::QualityArgs, error::CliError, open, output::Outputs, svg};

/// The defaults. The first graph is the baseline for the others.
const GRAPHS: [&str; 2] = ["render-cache", "epi"];
const SCENES: [&str; 3] = ["cornell", "chains", "room"];
const CAMERAS: [&str; 2] = ["still", "orbit"];

/// Default frames to compare: for a still camera, one after the picture has settled; for a moving one three, since the
/// error varies from frame to frame (`algorithms.md` section 11).
const STILL_FRAMES: [u32; 1] = [39];
const MOVING_FRAMES: [u32; 3] = [19, 24, 29];

/// The figures of one graph in one setting.
pub struct Row {
    /// The graph's name.
    pub graph: String,
    /// The scene.
    pub scene: String,
    /// The camera's path.
    pub camera: String,
    /// Samples per frame, as given on the command line.
    pub samples: Samples,
    /// The same as a count.
    pub count: u32,
    /// The share of pixels near edges, 0 to 1, mean over the frames.
    pub edge_share: f64,
    /// The figures of each frame, in order.
    pub frames: Vec<FrameFigures>,
}

impl Row {
    /// Figures of all pixels, mean over the frames.
    pub fn whole(&self) -> Figures {
        let count = self.frames.len().max(1) as f64;
        let mean = |pick: fn(&Figures) -> f64| {
            self.frames.iter().map(|frame| pick(&frame.whole)).sum::<f64>() / count
        };
        Figures { psnr: mean(|figures| figures.psnr), flip: mean(|figures| figures.flip) }
    }

    /// Figures of the pixels near edges, mean over the frames with such pixels; `None` if there are no such frames.
    pub fn edges(&self) -> Option<Figures> {
        let edges: Vec<Figures> = self.frames.iter().filter_map(|frame| frame.edges).collect();
        let mean = |pick: fn(&Figures) -> f64| edges.iter().map(pick).sum::<f64>() / edges.len() as f64;
        let figures = || Figures { psnr: mean(|figures| figures.psnr), flip: mean(|figures| figures.flip) };
        (!edges.is_empty()).then(figures)
    }
}

/// Runs the comparison and reports its figures.
pub fn quality(args: &QualityArgs, registry: &Arc<Registry>) -> Result<(), CliError> {
    open::threads(args.threads)?;
    let mut outputs = Outputs::default();
    let json = outputs.json(args.json.as_deref())?;
    let plot = args.plot.as_deref().map(|path| svg::add(&mut outputs, "--plot", path)).transpose()?;
    let quality = Quality::new(args, registry)?;
    let views = quality.checked_views()?;
    let mut outputs = outputs.ready()?;
    let rows = quality.run(&views)?;
    let Device { side, gpu } = &quality.device;
    let report = Report { args, side: *side, gpu: gpu.as_deref(), rows: &rows };
    if let Some(plot) = plot {
        outputs.put(plot, plot::svg(&report).as_bytes())?;
    }
    outputs.finish(json, &report.json(), &report.text())
}

struct Quality<'a> {
    args: &'a QualityArgs,
    registry: &'a Arc<Registry>,
    graphs: Vec<Named>,
    /// Ascending and without duplicates; empty for the defaults.
    frames: Vec<u32>,
    /// Samples per frame as given, and as a count.
    samples: Vec<(Samples, u32)>,
    device: Device,
}

impl<'a> Quality<'a> {
    fn new(args: &'a QualityArgs, registry: &'a Arc<Registry>) -> Result<Self, CliError> {
        let mut graphs = Vec::new();
        for name in named_or(&args.graphs, &GRAPHS) {
            let file = open::graph(name, &args.changes, registry)?;
            graphs.push(Named { name: open::label(name), file });
        }
        let count = |samples: &Samples| Ok((*samples, open::samples(*samples, args.size.0)?));
        let samples: Result<Vec<_>, CliError> = args.samples.iter().map(count).collect();
        let samples = distinct(samples?);
        let mut frames = args.frames.clone();
        frames.sort_unstable();
        frames.dedup();
        let device = Device::open(args.backend)?;
        Ok(Self { args, registry, graphs, frames, samples, device })
    }

    /// The views, after a check of all inputs: none is found wrong only after others were measured.
    fn checked_views(&self) -> Result<Vec<View>, CliError> {
        let views = self.views()?;
        for job in views.iter().flat_map(|view| self.jobs(view)) {
            job.check()?;
        }
        Ok(views)
    }

    fn run(&self, views: &[View]) -> Result<Vec<Row>, CliError> {
        let mut rows = Vec::new();
        for views in views.chunk_by(|a, b| a.scene_name == b.scene_name) {
            let tracer = open::tracer_of_surfaces(&views[0].place)?;
            for view in views {
                let frames = self.frames(view);
                let references = References::trace(self.args, view, &frames)?;
                for job in self.jobs(view) {
                    rows.push(Row {
                        graph: job.named.name.clone(),
                        scene: view.scene_name.clone(),
                        camera: view.camera.clone(),
                        samples: job.samples,
                        count: job.count,
                        edge_share: references.edge_share(),
                        frames: job.run(&frames, &references)?,
                    });
                }
            }
            open::warn_of_bad_samples(tracer.non_finite());
        }
        Ok(rows)
    }

    /// Every scene with every camera path.
    fn views(&self) -> Result<Vec<View>, CliError> {
        let mut views = Vec::new();
        for name in named_or(&self.args.scene, &SCENES) {
            // All camera paths share the tracer and the shadow edges that stages cache.
            let mut shared: Option<Place> = None;
            for camera in named_or(&self.args.camera, &CAMERAS) {
                let place = match &shared {
                    Some(place) => place.along(camera)?,
                    None => open::place(name, camera)?,
                };
                shared = Some(place.clone());
                views.push(View { scene_name: name.into(), camera: camera.into(), place });
            }
        }
        Ok(views)
    }

    /// All graphs at all numbers of samples.
    fn jobs<'b>(&'b self, view: &'b View) -> impl Iterator<Item = Job<'b>> {
        self.graphs.iter().flat_map(move |named| {
            self.samples.iter().map(move |&(samples, count)| Job {
                registry: self.registry,
                named,
                device: &self.device,
                view,
                size: self.args.size.0,
                samples,
                count,
                seed: self.args.seed,
            })
        })
    }

    fn frames(&self, view: &View) -> Vec<u32> {
        match (self.frames.as_slice(), view.place.path.moves()) {
            ([], false) => STILL_FRAMES.into(),
            ([], true) => MOVING_FRAMES.into(),
            (frames, _) => frames.into(),
        }
    }
}

/// The given names without duplicates, or the default.
fn named_or<'a>(named: &'a [String], default: &[&'a str]) -> Vec<&'a str> {
    if named.is_empty() { default.into() } else { distinct(named.iter().map(String::as_str)) }
}

/// The values without duplicates, in the order of their first occurrence.
fn distinct<T: PartialEq>(values: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut known = Vec::new();
    for value in values {
        if !known.contains(&value) {
            known.push(value);
        }
    }
    known
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_measured_once() {
        let named = ["room", "cornell", "room"].map(String::from);
        assert_eq!(named_or(&named, &SCENES), ["room", "cornell"]);
        assert_eq!(named_or(&[], &SCENES), SCENES);
    }

    #[test]
    fn a_row_is_the_mean_of_its_frames() {
        let figures = |psnr, flip| Figures { psnr, flip };
        let frame = |frame, whole, edges| FrameFigures { frame, whole, edges };
        let row = Row {
            graph: "epi".into(),
            scene: "cornell".into(),
            camera: "orbit".into(),
            samples: Samples::Count(7),
            count: 7,
            edge_share: 0.1,
            frames: vec![
                frame(3, figures(30.0, 0.25), Some(figures(20.0, 0.5))),
                frame(5, figures(40.0, 0.75), None),
            ],
        };
        assert_eq!((row.whole(), row.edges()), (figures(35.0, 0.5), Some(figures(20.0, 0.5))));
        assert_eq!(Row { frames: vec![frame(3, figures(30.0, 0.25), None)], ..row }.edges(), None);
    }
}
