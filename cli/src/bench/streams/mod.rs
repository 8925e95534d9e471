//! `epigraph bench --streams`: the paper's figures of vertex transformation streams for models of ours, and codecs side
//! by side.

mod flight;
mod peer;
mod report;

use std::{hint::black_box, time::Instant};

use epigraph_points::{ReadError, read};
use epigraph_scenes::SceneError;
use epigraph_streams::{Codec, Layout, Model, Node, Points, Pool, Settings};

use super::{Skipped, needs_fetch};
use crate::{args::BenchArgs, encode::watched, error::CliError, output::Outputs, progress, svg};
use flight::{Flight, frames_per_second};

/// Models by default: those with the most vertices. The first two have to be fetched.
const MODELS: [&str; 4] = ["dragon", "bust", "chains", "room"];

/// Numbers of pools, as in the paper's figures 13 and 14.
const POOLS: [usize; 5] = [1, 2, 3, 4, 8];
const QUICK_POOLS: [usize; 1] = [2];

/// The paper's tags.
const TRANSLATIONS: usize = 88;

/// Points of a node in the paper's models: 1.0 to 1.7 million in 128 nodes.
const POINTS_OF_A_NODE: f64 = 10_000.0;

/// Each decoder runs for so long; the fastest pass counts.
const SECONDS: f64 = 0.5;

/// The figures of a model.
struct Figures {
    name: String,
    points: usize,
    /// By the number of pools, in the paper's way: the last level, and the one whose nodes have about as many points as
    /// the paper's.
    pools: Vec<[Coverage; 2]>,
    codecs: Vec<Coded>,
    /// Frames a second of all points, packed and as streams.
    frames: [f64; 2],
    flight: Flight,
}

/// A level of a model in the paper's layout.
struct Coverage {
    pools: usize,
    /// Of all levels.
    seconds: f64,
    level: u32,
    nodes: usize,
    points: usize,
    covered: usize,
    /// 8 bytes a point.
    conventional: usize,
    streams: usize,
    /// Of these, those of pools.
    in_pools: usize,
}

/// The last level of a model by a codec.
struct Coded {
    codec: String,
    bytes: usize,
    points: usize,
    /// To encode all levels; only the last one by the peer.
    encode: f64,
    /// Points a second, on one core.
    decode: f64,
}

/// Measures and reports.
pub fn bench(args: &BenchArgs) -> Result<(), CliError> {
    let threads = rayon::current_num_threads();
    let mut outputs = Outputs::default();
    let json = outputs.json(args.json.as_deref())?;
    let plot = args.plot.as_deref().map(|path| svg::add(&mut outputs, "--plot", path)).transpose()?;
    let mut skipped = Vec::new();
    let inputs = inputs(args, &mut skipped)?;
    let mut outputs = outputs.ready()?;
    let models = inputs.into_iter().map(|(name, points)| figures(name, points, args));
    let models = models.collect::<Result<Vec<_>, _>>()?;
    if let Some(plot) = plot {
        outputs.put(plot, flight::plot(models.iter().map(|model| &model.flight)).as_bytes())?;
    }
    let report = report::Report { models: &models, skipped: &skipped, threads };
    outputs.finish(json, &report.json(), &report.text())
}

/// The points of all models.
fn inputs(args: &BenchArgs, skipped: &mut Vec<Skipped>) -> Result<Vec<(String, Points)>, CliError> {
    let by_default = args.scene.is_empty();
    let names: Vec<&str> =
        if by_default { MODELS.into() } else { args.scene.iter().map(String::as_str).collect() };
    let mut inputs = Vec::new();
    for name in names {
        match progress::spinner(format!("reading {name}"), || read(name)) {
            Ok(input) => inputs.push((name.to_owned(), input.points)),
            Err(ReadError::Scene(error @ SceneError::Invalid { .. })) if by_default && needs_fetch(name) => {
                skipped.push(Skipped { what: name.into(), why: error.to_string() });
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(inputs)
}

fn figures(name: String, mut points: Points, args: &BenchArgs) -> Result<Figures, CliError> {
    let whole = watched(&points, &Settings::default(), &format!("{name}: "))?;
    let flight = Flight::new(&name, whole, args)?;
    // Colours and normals take the same bytes whatever the codec.
    (points.colors, points.normals) = (None, None);
    let encode = |label: String, settings: Settings| {
        let start = Instant::now();
        let model = watched(&points, &settings, &format!("{name}, {label}: "))?;
        Ok::<_, CliError>((model, start.elapsed().as_secs_f64()))
    };
    let numbers: &[usize] = if args.quick { &QUICK_POOLS } else { &POOLS };
    let pools = numbers.iter().map(|&pools| {
        let settings =
            Settings { codec: Codec::Streams, translations: TRANSLATIONS, pools, ..Settings::default() };
        let (model, seconds) = encode(format!("{pools} pools"), settings)?;
        let alike = like_the_papers(&model);
        Ok([model.levels(), alike].map(|level| Coverage::new(&model, level, pools, seconds)))
    });
    let pools = pools.collect::<Result<Vec<_>, CliError>>()?;
    let (mut codecs, mut frames) = (Vec::new(), [0.0; 2]);
    let mut last = None;
    for (codec, label, _) in Codec::ALL {
        let (model, seconds) = encode(label.into(), Settings { codec, ..Settings::default() })?;
        codecs.push(Coded::new(label, &model, seconds));
        match codec {
            Codec::Packed => frames[0] = frames_per_second(&name, model, args)?,
            Codec::Streams => frames[1] = frames_per_second(&name, model, args)?,
            _ => last = Some(model),
        }
    }
    let leaves: Vec<&Node> = last.iter().flat_map(Model::leaves).collect();
    codecs.extend(peer::measure(&leaves));
    Ok(Figures { name, points: points.positions.len(), pools, codecs, frames, flight })
}

/// The level whose nodes have about as many points as the paper's.
fn like_the_papers(model: &Model) -> u32 {
    let distance = |level: &u32| {
        let nodes: Vec<&Node> = model.level(*level).collect();
        let points: usize = nodes.iter().map(|node| node.cell_count()).sum();
        (points as f64 / nodes.len() as f64 / POINTS_OF_A_NODE).ln().abs()
    };
    (1..=model.levels()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(1)
}

impl Coverage {
    fn new(model: &Model, level: u32, pools: usize, seconds: f64) -> Self {
        let nodes: Vec<&Node> = model.level(level).collect();
        let sum = |of: &dyn Fn(&Node) -> usize| nodes.iter().map(|node| of(node)).sum::<usize>();
        let points = sum(&Node::cell_count);
        Self {
            pools,
            seconds,
            level,
            nodes: nodes.len(),
            points,
            covered: sum(&Node::covered),
            conventional: Layout::PAPER.points(points),
            streams: sum(&|node| Layout::PAPER.node(node)),
            in_pools: sum(&|node| node.pools().iter().map(|pool: &Pool| Layout::PAPER.pool(pool)).sum()),
        }
    }
}

impl Coded {
    fn new(codec: &str, model: &Model, encode: f64) -> Self {
        let leaves: Vec<&Node> = model.leaves().collect();
        let points = leaves.iter().map(|node| node.cell_count()).sum();
        let decode = rate(points, || {
            leaves.iter().for_each(|node| drop(black_box(node.cells())));
        });
        let bytes = leaves.iter().map(|node| Layout::PACKED.node(node)).sum();
        Self { codec: codec.into(), bytes, points, encode, decode }
    }
}

/// Points a second of a decoder that decodes so many.
fn rate(points: usize, mut decode: impl FnMut()) -> f64 {
    let begin = Instant::now();
    let mut fastest = f64::INFINITY;
    while begin.elapsed().as_secs_f64() < SECONDS {
        let start = Instant::now();
        decode();
        fastest = fastest.min(start.elapsed().as_secs_f64());
    }
    points as f64 / fastest
}
