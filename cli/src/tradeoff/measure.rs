//! Measures one cell: runs its frames, compares some of them with their references, and adds up what they cost.

use std::{collections::BTreeMap, sync::Arc};

use epigraph::{Run, Source};
use epigraph_core::{Graph, Meaning, Plan, Port, Side, Step};
use epigraph_pictures::{Difference, Look, Picture, metrics, show, size, tone};
use epigraph_stages::{
    column::TRACE,
    meaning::{ID, SAMPLES},
    shared::{
        cloud::NO_POINT,
        requests::{HIT_NONE, Sample},
    },
};
use serde_json::Value;

use super::{
    cell::{Cell, Figures, FrameErrors, Measured, NodeCost},
    experiment::Experiment,
    figure::{Cost, INEFFICIENCY, Metric, REFERENCE},
    references::{Noise, Reference, Wanted, light},
    store::Store,
    study::Study,
};
use crate::{bench::quantile, edge_mask, error::CliError, interrupt};

/// The first frames are slower, as caches and threads warm up. One in [`WARM_UP_SHARE`] frames, but at most
/// [`MOST_WARM_UP`], is not timed.
const WARM_UP_SHARE: u32 = 6;
const MOST_WARM_UP: u32 = 10;

/// The greatest change of a channel of the reference, in bytes, of a pixel that counts as static.
const STATIC: u8 = 1;

/// After a change, the error counts as steady where it is at most this many times its steady value.
const NEARLY_STEADY: f64 = 1.1;

/// The steady value of the error after a change is its mean over the last frames: one in so many of those compared.
const STEADY_SHARE: usize = 4;

/// The references of a cell by frame: those of the compared frames, and of the frames before if flicker is measured.
/// Frames of the same view share theirs.
pub type References = BTreeMap<u32, Arc<Reference>>;

/// The frames whose references a cell needs.
pub fn reference_frames(experiment: &Experiment, cell: &Cell) -> Vec<u32> {
    let before = |frame: &u32| frame.checked_sub(1).filter(|_| experiment.metrics.contains(&Metric::Flicker));
    let mut frames: Vec<u32> =
        cell.compare.iter().filter_map(before).chain(cell.compare.iter().copied()).collect();
    frames.sort_unstable();
    frames.dedup();
    frames
}

/// The references of a cell, from the store if there is one, or traced.
///
/// # Errors
/// Those of [`Wanted::get`].
pub fn references(study: &Study, cell: &Cell, store: Option<&Store>) -> Result<References, CliError> {
    let mut known: BTreeMap<String, Arc<Reference>> = BTreeMap::new();
    let get = |frame| {
        let wanted = Wanted::new(study, cell, frame);
        let reference = match known.get(wanted.key()) {
            Some(reference) => reference.clone(),
            None => Arc::new(wanted.get(store)?),
        };
        known.insert(wanted.key().to_owned(), reference.clone());
        Ok((frame, reference))
    };
    reference_frames(study.experiment, cell).into_iter().map(get).collect()
}

/// Runs the frames of a cell and measures them. Returns the last compared picture too. `frame_done` is called after
/// each frame.
///
/// # Errors
/// Problems of this machine (memory, a missing GPU), stages that fail, and [`CliError::Interrupted`].
pub fn measure(
    study: &Study,
    cell: &Cell,
    references: &References,
    machine: Value,
    mut frame_done: impl FnMut(),
) -> Result<(Measured, Picture), CliError> {
    let mut compiled = study.setup(cell)?.compile()?;
    let output = compiled.picture()?;
    // Before ports are kept, which takes memory.
    let peak_bytes: u64 = Side::ALL.iter().map(|side| compiled.plan().bytes(*side)).sum();
    let ports = Ports::of(compiled.graph(), compiled.plan());
    compiled.keep(&ports.all())?;
    let mut run = compiled.start()?;

    let metrics = &study.experiment.metrics;
    let (mut log, mut frames, mut rays) = (Log::new(cell.frames), Vec::new(), Vec::new());
    let mut before: Option<(u32, Picture)> = None;
    let mut compared: Option<Picture> = None;
    for index in 0..cell.frames {
        interrupt::check()?;
        let is_compared = cell.compare.binary_search(&index).is_ok();
        run.advance(is_compared || references.contains_key(&index))?;
        log.frame(index, &run);
        if references.contains_key(&index) || is_compared {
            let picture = picture(&mut run, &output, index)?;
            if is_compared {
                let last = before.as_ref().filter(|(frame, _)| frame + 1 == index).map(|(_, last)| last);
                let mut errors = errors(metrics, index, &picture, last, references);
                if metrics.contains(&Metric::Holes) {
                    errors.insert(Metric::Holes.column().into(), ports.holes(&mut run)?);
                }
                frames.push(FrameErrors { frame: index, errors });
                rays.extend(ports.rays(&mut run)?);
                compared = Some(picture.clone());
            }
            before = Some((index, picture));
        }
        frame_done();
    }
    let plan = run.plan();
    let mut costs = log.costs(plan);
    let count = |number: u64| Some(number as f64);
    costs.insert(Cost::PathsPerPixel.column().into(), cell.paths_per_pixel);
    costs.insert(Cost::Samples.column().into(), count(cell.samples.into()));
    costs.insert(Cost::PeakBytes.column().into(), count(peak_bytes));
    let rays = mean(rays.into_iter().map(|rays| rays as f64));
    let pixels = f64::from(cell.size[0]) * f64::from(cell.size[1]);
    let traced = rays.zip(cell.paths_per_sample).map(|(rays, paths)| rays * f64::from(paths) / pixels);
    costs.insert(Cost::Rays.column().into(), rays);
    costs.insert(Cost::PathsTraced.column().into(), traced);
    let mut errors = means(metrics, &frames);
    if let Some(found) = errors.get_mut(Metric::Latency.column()) {
        *found = study.experiment.change.and_then(|_| latency(&frames));
    }
    let of_references = of_references(&cell.compare, metrics, references);
    errors.extend(REFERENCE.iter().zip(of_references).map(|((name, _), value)| ((*name).to_owned(), value)));
    let of = |figures: &Figures, column: &str| figures.get(column).copied().flatten();
    let inefficiency = of(&errors, Metric::RelMse.column())
        .zip(of(&costs, Cost::TotalMs.column()))
        .map(|(error, ms)| error * ms);
    costs.insert(INEFFICIENCY.0.into(), inefficiency);
    let backend = study.device.side.to_string();
    let measured = Measured { errors, frames, costs, nodes: log.nodes(plan), backend, machine };
    Ok((measured, compared.expect("an experiment compares at least one of its frames")))
}

/// The picture of the last frame as displayed.
fn picture(run: &mut Run, output: &str, frame: u32) -> Result<Picture, CliError> {
    let look = Look { far: run.path().camera(frame).far, ..Look::default() };
    let image = run.snapshot(output)?;
    Ok(Picture::shown(size(image.dims), &show(image, &look).colors))
}

/// The metrics of one frame, but for holes. `last` is the picture of the frame before.
fn errors(
    wanted: &[Metric],
    frame: u32,
    picture: &Picture,
    last: Option<&Picture>,
    references: &References,
) -> Figures {
    let Reference { converged, .. } = &*references[&frame];
    let edges = Some(&converged.edges).filter(|edges| edges.contains(&true));
    let difference = Difference::new(&converged.picture, picture);
    let (reference, test) = (light(&converged.picture), light(picture));
    let flicker = || {
        let before = &references.get(&frame.checked_sub(1)?)?.converged.picture;
        flicker([before, &converged.picture], [last?, picture])
    };
    let of = |metric: Metric| match metric {
        Metric::Flip => Some(difference.flip()),
        Metric::Rmse => Some(metrics::rmse(&reference, &test)),
        Metric::RelMse => Some(metrics::rel_mse(&reference, &test)),
        Metric::Psnr => finite(difference.psnr()),
        Metric::Ssim => Some(difference.ssim()),
        Metric::EdgeFlip => edges.map(|edges| difference.flip_within(edges)),
        Metric::EdgePsnr => edges.and_then(|edges| finite(difference.psnr_within(edges))),
        Metric::Flicker => flicker(),
        // Of ports, and of all frames.
        Metric::Holes | Metric::Latency => None,
    };
    wanted.iter().map(|&metric| (metric.column().to_owned(), of(metric))).collect()
}

/// The figures of [`REFERENCE`], means over the compared frames.
fn of_references(
    compare: &[u32],
    metrics: &[Metric],
    references: &References,
) -> [Option<f64>; REFERENCE.len()] {
    let mean = |of: &dyn Fn(u32) -> Option<f64>| mean(compare.iter().filter_map(|frame| of(*frame)));
    let noise = |of: fn(&Noise) -> Option<f64>| mean(&|frame| of(&references[&frame].noise));
    let static_share = |frame: u32| {
        let before = references.get(&frame.checked_sub(1)?)?;
        let is_static = static_pixels([&before.converged.picture, &references[&frame].converged.picture]);
        Some(edge_mask::share(&is_static))
    };
    [
        noise(|noise| Some(noise.flip)),
        noise(|noise| Some(noise.rmse)),
        noise(|noise| Some(noise.rel_mse)),
        noise(|noise| noise.psnr),
        mean(&|frame| Some(edge_mask::share(&references[&frame].converged.edges))),
        metrics.contains(&Metric::Flicker).then(|| mean(&static_share)).flatten(),
    ]
}

/// Equal pictures have an infinite PSNR, which neither JSON nor a mean can have.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Root mean square change of the displayed values between two frames, over the pixels whose reference is static.
fn flicker(references: [&Picture; 2], pictures: [&Picture; 2]) -> Option<f64> {
    let is_static = static_pixels(references);
    let chosen: Vec<usize> = (0..is_static.len()).filter(|index| is_static[*index]).collect();
    let side = |picture: &Picture| chosen.iter().map(|index| picture.srgb_at(*index)).collect::<Vec<_>>();
    (!chosen.is_empty()).then(|| metrics::rmse(&side(pictures[0]), &side(pictures[1])))
}

/// Whether each pixel shows the same in the references of two frames.
fn static_pixels([a, b]: [&Picture; 2]) -> Vec<bool> {
    let bytes = |picture: &Picture, index| picture.srgb_at(index).map(tone::to_byte);
    let is_static = |index| {
        let (a, b) = (bytes(a, index), bytes(b, index));
        a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= STATIC)
    };
    (0..a.colors.len()).map(is_static).collect()
}

/// The mean, or `None` of no values.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// The means over the frames that have a figure.
fn means(metrics: &[Metric], frames: &[FrameErrors]) -> Figures {
    let of = |metric: &Metric| {
        let column = metric.column();
        let values = frames.iter().filter_map(|frame| frame.errors.get(column).copied().flatten());
        (column.to_owned(), mean(values))
    };
    metrics.iter().map(of).collect()
}

/// The number of frames after the first one, in which something changes abruptly, until FLIP is nearly steady.
fn latency(frames: &[FrameErrors]) -> Option<f64> {
    let flip = |frame: &FrameErrors| frame.errors.get(Metric::Flip.column()).copied().flatten();
    let errors: Vec<f64> = frames.iter().filter_map(flip).collect();
    let last = errors.len().div_ceil(STEADY_SHARE);
    let steady = mean(errors[errors.len() - last..].iter().copied())?;
    errors.iter().position(|error| *error <= NEARLY_STEADY * steady).map(|frames| frames as f64)
}

/// The ports that figures are taken from.
struct Ports {
    /// The points of the pixels, as the last node leaves them.
    id: Option<Source>,
    samples: Vec<Source>,
}

impl Ports {
    fn of(graph: &Graph, plan: &Plan) -> Self {
        let with = |meaning: Meaning| {
            plan.order().flat_map(move |node| {
                let node = &graph.nodes[node];
                let is = move |port: &&Port| port.is_output() && port.meaning == Some(meaning);
                let ports = node.declaration().ports.iter().filter(is);
                ports.map(|port| Source { node: node.name.clone(), port: port.name.to_string() })
            })
        };
        // Those of a source, not of nodes that pass samples on.
        let is_source = |source: &Source| {
            let node = graph.node(&source.node).expect("its ports were listed");
            let mut ports = graph.nodes[node].declaration().ports.iter();
            !ports.any(|port| !port.is_output() && port.meaning == Some(SAMPLES))
        };
        Self { id: with(ID).last(), samples: with(SAMPLES).filter(is_source).collect() }
    }

    fn all(&self) -> Vec<Source> {
        self.id.iter().chain(&self.samples).cloned().collect()
    }

    /// The share of the pixels without a point.
    fn holes(&self, run: &mut Run) -> Result<Option<f64>, CliError> {
        let Some(id) = &self.id else { return Ok(None) };
        let ids = run.read::<u32>(&id.to_string())?.pixels;
        Ok(mean(ids.iter().map(|id| f64::from(u8::from(*id == NO_POINT)))))
    }

    /// The samples that arrived, if there is a source of samples.
    fn rays(&self, run: &mut Run) -> Result<Option<u64>, CliError> {
        let mut rays = None;
        for port in &self.samples {
            let samples = run.snapshot(&port.to_string())?.get::<Sample>();
            let count = samples.iter().filter(|sample| sample.hit != HIT_NONE).count();
            *rays.get_or_insert(0) += count as u64;
        }
        Ok(rays)
    }
}

/// Times and transfers of the steps of each frame after the warm-up.
struct Log {
    warm_up: u32,
    times: Vec<Vec<f32>>,
    moved: Vec<Vec<u64>>,
}

impl Log {
    fn new(frames: u32) -> Self {
        Self { warm_up: (frames / WARM_UP_SHARE).min(MOST_WARM_UP), times: Vec::new(), moved: Vec::new() }
    }

    fn frame(&mut self, index: u32, run: &Run) {
        if index >= self.warm_up {
            self.times.push(run.executor.times().to_vec());
            self.moved.push(run.executor.moved().to_vec());
        }
    }

    /// The median over the frames of the sum over the chosen steps.
    fn ms(&self, chosen: impl Fn(usize) -> bool) -> f64 {
        median(&self.times, |ms| f64::from(*ms), chosen)
    }

    fn bytes(&self, chosen: impl Fn(usize) -> bool) -> f64 {
        median(&self.moved, |bytes| *bytes as f64, chosen)
    }

    fn costs(&self, plan: &Plan) -> Figures {
        let column = |step: usize| match plan.steps[step] {
            Step::Run(node) => plan.nodes[node].column,
            _ => None,
        };
        let is_trace = |step: usize| column(step) == Some(TRACE);
        // Copies for these figures are no cost of the graph.
        let counts = |step: usize| !matches!(plan.steps[step], Step::Tap { .. });
        let costs = [
            (Cost::TotalMs, self.ms(counts)),
            (Cost::FrameMs, self.ms(|step| counts(step) && !is_trace(step))),
            (Cost::TraceMs, self.ms(is_trace)),
            (Cost::BytesMoved, self.bytes(counts)),
        ];
        costs.into_iter().map(|(cost, value)| (cost.column().to_owned(), Some(value))).collect()
    }

    fn nodes(&self, plan: &Plan) -> Vec<NodeCost> {
        let cost = |(index, step): (usize, &Step)| {
            let (kind, backend) = match step {
                Step::Run(node) => (plan.nodes[*node].kind.clone(), Some(plan.nodes[*node].side.to_string())),
                Step::Upload(_) | Step::Download(..) => ("transfer".into(), None),
                Step::Tap { .. } => return None,
            };
            let (ms, bytes_moved) = (self.ms(|step| step == index), self.bytes(|step| step == index));
            Some(NodeCost { node: plan.step_name(step), kind, backend, ms, bytes_moved })
        };
        plan.steps.iter().enumerate().filter_map(cost).collect()
    }
}

fn median<T>(frames: &[Vec<T>], of: impl Fn(&T) -> f64, chosen: impl Fn(usize) -> bool) -> f64 {
    let sum = |steps: &Vec<T>| -> f64 {
        steps.iter().enumerate().filter(|(step, _)| chosen(*step)).map(|(_, value)| of(value)).sum()
    };
    quantile(frames.iter().map(sum).collect(), 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flicker_is_the_change_where_the_reference_stays() {
        let picture = |colors: [[u8; 3]; 4]| Picture::shown([4, 1], &colors);
        let grey = [100; 3];
        // The first pixel stays, the second one changes by 1, the third one by 2, the last one in one channel.
        let references =
            [picture([grey; 4]), picture([grey, [101, 99, 100], [102, 100, 100], [100, 100, 90]])];
        let pictures = [picture([[0; 3]; 4]), picture([[51; 3], [0; 3], [255; 3], [255; 3]])];
        let found = |references: [&Picture; 2]| flicker(references, [&pictures[0], &pictures[1]]);
        // 51/255 = 0.2 in one of two pixels.
        let expected = (0.2_f64 * 0.2 / 2.0).sqrt();
        assert_eq!(static_pixels([&references[0], &references[1]]), [true, true, false, false]);
        assert!((found([&references[0], &references[1]]).unwrap() - expected).abs() < 1e-6);
        let other = picture([[0; 3]; 4]);
        assert_eq!(found([&references[0], &other]), None);
    }

    #[test]
    fn latency_is_counted_until_the_error_is_nearly_steady() {
        let frames = |errors: &[f64]| -> Vec<FrameErrors> {
            let of = |flip: &f64| [("flip".to_owned(), Some(*flip))].into_iter().collect();
            errors.iter().zip(0..).map(|(flip, frame)| FrameErrors { frame, errors: of(flip) }).collect()
        };
        // The last two of seven are steady at 0.1, and 0.11 is near enough.
        let found = |errors: &[f64]| latency(&frames(errors));
        assert_eq!(found(&[0.5, 0.3, 0.12, 0.1099, 0.105, 0.09, 0.11]), Some(3.0));
        assert_eq!(found(&[0.1; 8]), Some(0.0));
        assert_eq!(found(&[0.0; 8]), Some(0.0));
        assert_eq!(found(&[]), None);
    }

    #[test]
    fn means_leave_out_what_is_not_there() {
        let frame = |frame, psnr| {
            let errors = [("flip".to_owned(), Some(f64::from(frame))), ("psnr".to_owned(), psnr)];
            FrameErrors { frame, errors: errors.into_iter().collect() }
        };
        let found = means(&[Metric::Flip, Metric::Psnr], &[frame(1, None), frame(2, Some(30.0))]);
        assert_eq!((found["flip"], found["psnr"]), (Some(1.5), Some(30.0)));
        assert_eq!(means(&[Metric::Psnr], &[frame(1, None)])["psnr"], None);
    }

    #[test]
    fn medians_are_of_the_frames_sums() {
        let frames = vec![vec![1.0, 5.0], vec![2.0, 9.0], vec![3.0, 1.0]];
        assert_eq!(median(&frames, |ms| *ms, |step| step == 0), 2.0);
        assert_eq!(median(&frames, |ms| *ms, |_| true), 6.0);
        assert_eq!(median(&frames, |ms| *ms, |_| false), 0.0);
    }
}
