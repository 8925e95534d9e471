//! `epigraph quality`: compares the pictures of graphs with converged references, at equal numbers of light paths: an
//! experiment as `epigraph tradeoff` measures it, from the options of the command line.

mod report;

use std::{process::ExitCode, sync::Arc};

use epigraph::Registry;
use epigraph_core::Side;

use self::report::Report;
use crate::{
    args::QualityArgs,
    error::CliError,
    machine::Machine,
    open,
    output::Outputs,
    svg,
    tradeoff::{
        experiment::{Budget, Experiment, Frames, Named, Placed},
        figure::Metric,
        plot,
        results::Results,
        runner::{Runner, interrupted},
        store::Store,
        study::Study,
    },
    values::{Halves, Paths, Percent},
};

/// The defaults. The first graph is the baseline for the others.
const GRAPHS: [&str; 2] = ["render-cache", "epi"];
const SCENES: [&str; 3] = ["cornell", "chains", "room"];
const CAMERAS: [&str; 2] = ["still", "orbit"];

/// Default budgets in light paths per pixel and frame.
const PATHS: [f64; 6] = [0.05, 0.1, 0.25, 0.5, 1.0, 4.0];

/// Default frames to compare: for a still camera, one after the picture has settled; for a moving one three, since the
/// error varies from frame to frame (`algorithms.md` section 11).
const STILL_FRAMES: [u32; 1] = [39];
const MOVING_FRAMES: [u32; 3] = [19, 24, 29];

/// What is measured.
const METRICS: [Metric; 5] =
    [Metric::Psnr, Metric::Flip, Metric::Flicker, Metric::EdgePsnr, Metric::EdgeFlip];

/// What the plot shows.
const PLOTTED: [Metric; 4] = [Metric::Psnr, Metric::Flip, Metric::EdgePsnr, Metric::EdgeFlip];

/// What the plot is called.
const TITLE: &str = "Difference from a converged picture";

/// Runs the comparison and reports its figures.
pub fn quality(args: &QualityArgs, registry: &Arc<Registry>) -> Result<ExitCode, CliError> {
    let threads = rayon::current_num_threads();
    let mut outputs = Outputs::default();
    let json = outputs.json(args.json.as_deref())?;
    let csv = args.csv.as_deref().map(|path| outputs.add("--csv", path)).transpose()?;
    let plot = args.plot.as_deref().map(|path| svg::add(&mut outputs, "--plot", path)).transpose()?;
    let experiment = experiment(args);
    // None is found wrong only after others were measured.
    let study = Study::open(&experiment, registry)?;
    let mut outputs = outputs.ready()?;
    let store = args.keep.as_deref().map(Store::new).transpose()?;
    let gpu = study.device.gpu.as_deref().filter(|_| study.device.side == Side::Gpu);
    let machine = Machine::new(threads, gpu).json();
    let records = match (Runner { study: &study, store: store.as_ref(), machine: &machine }).all() {
        Err(CliError::Interrupted) if let Some(store) = &store => return interrupted(&study, store),
        records => records?,
    };
    let report = Report { args, study: &study, gpu, records: &records };
    if let Some(csv) = csv {
        let results = Results { experiment: &experiment, records: &records, found: &[], missing: 0 };
        outputs.put(csv, results.csv().as_bytes())?;
    }
    if let Some(plot) = plot {
        match plot::over_paths(TITLE, report.about(), &records, &PLOTTED) {
            Some(svg) => outputs.put(plot, svg.as_bytes())?,
            None => eprintln!(
                "warning: there is nothing to plot; {} is not written",
                outputs.path(plot).display()
            ),
        }
    }
    outputs.finish(json, &report.json(), &report.text())?;
    let failed = records.iter().filter(|record| record.measured().is_none()).count();
    if failed > 0 {
        eprintln!("error: {failed} of {} cells failed", records.len());
    }
    Ok(if failed > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The experiment that the options describe.
fn experiment(args: &QualityArgs) -> Experiment {
    let QualityArgs { paths, samples, size, spp: Halves(spp), mode, backend, seed, .. } = args;
    let paths = paths.iter().map(|Paths(paths)| *paths);
    let paths: Vec<f64> =
        if args.paths.is_empty() && samples.is_empty() { PATHS.into() } else { paths.collect() };
    let budgets =
        paths.into_iter().map(Budget::PathsPerPixel).chain(samples.iter().copied().map(Budget::Samples));
    let strings = |names: Vec<&str>| names.into_iter().map(|name| nowhere(name.to_owned())).collect();
    let frames = |default: &[u32]| frames(if args.frames.is_empty() { default } else { &args.frames });
    Experiment {
        doc: String::new(),
        graphs: graphs(args),
        scenes: strings(named_or(&args.scene, &SCENES)),
        cameras: strings(named_or(&args.camera, &CAMERAS)),
        sizes: vec![nowhere(size.0)],
        frames: frames(&MOVING_FRAMES),
        still: Some(frames(&STILL_FRAMES)),
        change: None,
        budgets: distinct(budgets).into_iter().map(nowhere).collect(),
        density: args.density.map(|Percent(share)| share),
        leaves_out: true,
        variations: vec![Vec::new()],
        searches: Vec::new(),
        seeds: vec![*seed],
        metrics: METRICS.into(),
        costs: Vec::new(),
        spp: *spp,
        mode: *mode,
        backend: *backend,
    }
}

/// The graphs with the changes to all of them. Two that would have the same short name keep their own.
fn graphs(args: &QualityArgs) -> Vec<Placed<Named>> {
    let names = named_or(&args.graphs, &GRAPHS);
    let label = |name: &str| {
        let is_alone = names.iter().filter(|other| open::label(other) == open::label(name)).count() == 1;
        if is_alone { open::label(name) } else { name.to_owned() }
    };
    let all = changes(args).iter().map(|piece| format!("+{piece}")).collect::<String>();
    names.iter().map(|name| nowhere(Named { label: label(name), variant: format!("{name}{all}") })).collect()
}

/// The changes to all graphs, as they follow a plus in a graph's name.
fn changes(args: &QualityArgs) -> Vec<String> {
    let per_sample = args.per_sample.map(|paths| format!("spp={paths}"));
    args.changes.all().map(epigraph::Change::piece).chain(per_sample).collect()
}

/// These frames, sorted and without duplicates.
fn frames(compare: &[u32]) -> Frames {
    let mut compare = compare.to_vec();
    compare.sort_unstable();
    compare.dedup();
    Frames { count: compare.last().map_or(0, |last| last + 1), compare }
}

fn nowhere<T>(value: T) -> Placed<T> {
    Placed { value, place: None }
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
    use clap::Parser;

    use super::*;
    use crate::args::{Cli, Command};

    fn of(words: &str) -> Experiment {
        let cli =
            Cli::try_parse_from(["epigraph", "quality"].into_iter().chain(words.split_whitespace())).unwrap();
        let Some(Command::Quality(args)) = cli.command else { panic!("{words}") };
        experiment(&args)
    }

    fn budgets(experiment: &Experiment) -> Vec<String> {
        experiment.budgets.iter().map(|budget| budget.value.to_string()).collect()
    }

    #[test]
    fn names_are_measured_once() {
        let named = ["room", "cornell", "room"].map(String::from);
        assert_eq!(named_or(&named, &SCENES), ["room", "cornell"]);
        assert_eq!(named_or(&[], &SCENES), SCENES);
    }

    #[test]
    fn budgets_are_paths_unless_samples_are_given() {
        assert_eq!(of("").budgets.len(), 6);
        assert_eq!(budgets(&of("--samples 5%,300")), ["5%", "300"]);
        assert_eq!(budgets(&of("--paths 0.2,4,0.2")), ["0.2 paths/pixel", "4 paths/pixel"]);
        assert_eq!(budgets(&of("--paths 1 --samples 7%")), ["1 paths/pixel", "7%"]);
    }

    #[test]
    fn still_cameras_have_frames_of_their_own_unless_they_are_given() {
        let experiment = of("");
        assert_eq!(experiment.frames, Frames { count: 30, compare: vec![19, 24, 29] });
        assert_eq!(experiment.still, Some(Frames { count: 40, compare: vec![39] }));
        let experiment = of("--frames 7,3,7");
        assert_eq!(experiment.frames, Frames { count: 8, compare: vec![3, 7] });
        assert_eq!(experiment.still.as_ref(), Some(&experiment.frames));
    }

    #[test]
    fn changes_apply_to_all_graphs() {
        let words = "epi graphs/epi.ron a.ron+x=1 --set b=2 --swap fill=spread --per-sample 16";
        let experiment = of(words);
        let graphs = experiment.graphs.iter().map(|graph| (&*graph.value.label, &*graph.value.variant));
        assert_eq!(
            graphs.collect::<Vec<_>>(),
            [
                ("epi", "epi+swap:fill=spread+b=2+spp=16"),
                ("graphs/epi.ron", "graphs/epi.ron+swap:fill=spread+b=2+spp=16"),
                ("a+x=1", "a.ron+x=1+swap:fill=spread+b=2+spp=16"),
            ]
        );
    }
}
