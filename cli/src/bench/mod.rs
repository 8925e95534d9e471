//! `epigraph bench`: the papers' table of stage times measured on this machine, beside the papers' own figures.

mod choice;
mod column;
mod instructions;
mod json;
mod measure;
mod papers;
mod plot;
mod pruning;
mod report;
mod streams;
mod times;

use std::sync::Arc;

use epigraph::{Backend, Device, Registry};
use epigraph_core::{GraphFile, Side};

use self::{
    choice::Split,
    measure::{Job, Loaded, Measured, Outcome},
    report::Report,
};
pub use self::{
    choice::{Choice, Sweep},
    times::quantile,
};
use crate::{args::BenchArgs, error::CliError, machine::Machine, open, output::Outputs, svg};

/// Scenes measured by default, in the order of the papers. The last two have to be fetched.
pub const SCENES: [&str; 5] = ["cornell", "chains", "room", "bust", "dragon"];

/// The default graph of the rows `cpu` and `gpu`, and its split between CPU and GPU for the rows `hybrid`.
const GRAPH: &str = "epi";
const HYBRID: &str = "hybrid";

/// Sides of the square images of the sweep over pixels. The last one is too large for a software GPU.
const SIDES: [u32; 5] = [256, 512, 1024, 2048, 4096];
const LARGEST_SOFTWARE_SIDE: u32 = 2048;

/// Points per pixel in the sweep over points.
const POINTS_PER_PIXEL: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];

/// Both sweeps with `--quick`.
const QUICK_SIDES: [u32; 3] = [64, 128, 256];
const QUICK_POINTS_PER_PIXEL: [f64; 3] = [0.25, 1.0, 4.0];

/// A measured row.
pub struct Row {
    /// The scene.
    pub scene: String,
    /// The side that did the work.
    pub backend: Split,
    /// The graph.
    pub graph: String,
    /// Its place among the graphs that were asked for, and its name; `None` if there is only one.
    pub variant: Option<(usize, String)>,
    /// Its figures.
    pub measured: Measured,
}

/// A row that could not be measured.
pub struct Skipped {
    /// Name of the row.
    pub what: String,
    /// Reason.
    pub why: String,
}

/// All rows of a run.
#[derive(Default)]
pub struct Results {
    /// One row for each scene and backend.
    pub rows: Vec<Row>,
    /// The sweep over pixels.
    pub pixels: Vec<Row>,
    /// The sweep over points.
    pub points: Vec<Row>,
    /// Rows that could not be measured.
    pub skipped: Vec<Skipped>,
}

/// Runs the benchmark and reports its figures.
pub fn bench(args: &BenchArgs, registry: &Arc<Registry>) -> Result<(), CliError> {
    if args.streams {
        return streams::bench(args);
    }
    if args.pruning {
        return pruning::bench(args, registry);
    }
    if args.instructions {
        return instructions::bench(args, registry);
    }
    let threads = rayon::current_num_threads();
    let mut outputs = Outputs::default();
    let json = outputs.json(args.json.as_deref())?;
    let plot = args.plot.as_deref().map(|path| svg::add(&mut outputs, "--plot", path)).transpose()?;
    let bench = Bench::new(args, registry)?;
    let gpu = bench.gpu.as_ref().ok().and_then(Option::as_ref).and_then(|device| device.gpu.as_deref());
    let machine = Machine::new(threads, gpu);
    if machine.software {
        eprintln!("warning: {SOFTWARE_WARNING}");
    }
    let mut results = Results::default();
    let scenes = bench.load(&mut results)?;
    let mut outputs = outputs.ready()?;
    bench.run(scenes, &mut results)?;
    let report = Report { args, machine: &machine, sweeps: &bench.sweeps, results: &results };
    if let Some(plot) = plot {
        outputs.put(plot, plot::svg(&report).as_bytes())?;
    }
    outputs.finish(json, &json::figures(&report), &report.text())
}

/// The graphs that the user names, or the default ones, with their names as given.
fn graphs(
    args: &BenchArgs,
    default: &[&str],
    registry: &Arc<Registry>,
) -> Result<Vec<(String, GraphFile)>, CliError> {
    let open = |name: String| {
        let file = open::graph(&name, &args.compile.changes, registry)?;
        Ok((name, file))
    };
    named(&args.graph, default).into_iter().map(open).collect()
}

/// The graphs or scenes that the user names, or the default ones.
fn named(given: &[String], default: &[&str]) -> Vec<String> {
    if given.is_empty() { default.iter().map(|name| (*name).to_owned()).collect() } else { given.to_vec() }
}

/// Shown prominently if the GPU is a software one.
pub const SOFTWARE_WARNING: &str =
    "SOFTWARE GPU: it computes on the CPU, so the times of `gpu` and `hybrid` say nothing about a real GPU";

/// A graph on the side that a row is for.
struct Runs {
    backend: Split,
    variant: Option<(usize, String)>,
    graph: GraphFile,
}

struct Bench<'a> {
    args: &'a BenchArgs,
    registry: &'a Arc<Registry>,
    /// What runs in the rows of a scene.
    runs: Vec<Runs>,
    sweeps: Vec<Sweep>,
    /// The GPU if one is needed, or the reason why it is missing.
    gpu: Result<Option<Device>, String>,
}

impl<'a> Bench<'a> {
    fn new(args: &'a BenchArgs, registry: &'a Arc<Registry>) -> Result<Self, CliError> {
        let named = if args.graph.is_empty() { vec![GRAPH.to_owned()] } else { args.graph.clone() };
        let backends = backends(args);
        if let (Some(graph), [Split::Hybrid]) = (args.graph.first(), &backends[..]) {
            let text = format!(
                "--graph {graph} is for the rows `cpu` and `gpu`; the row `hybrid` always runs `{HYBRID}`"
            );
            return Err(CliError::Input(text));
        }
        if args.sweep.contains(&Sweep::None) && args.sweep.len() > 1 {
            return Err(CliError::Input("--sweep none excludes other sweeps; drop it, or the others".into()));
        }
        let mut runs = Vec::new();
        for backend in backends {
            let names = if backend == Split::Hybrid { &[HYBRID.to_owned()][..] } else { &named[..] };
            for (nth, name) in names.iter().enumerate() {
                let variant = (names.len() > 1).then(|| (nth, open::label(name)));
                runs.push(Runs {
                    backend,
                    variant,
                    graph: open::graph(name, &args.compile.changes, registry)?,
                });
            }
        }
        let needs_gpu = runs.iter().any(|runs| runs.backend.side() == Side::Gpu);
        let gpu = match needs_gpu.then(|| Device::open(Backend::Gpu)) {
            Some(opened) => opened.map(Some).map_err(|error| error.to_string()),
            None => Ok(None),
        };
        Ok(Self { args, registry, runs, sweeps: sweeps(args), gpu })
    }

    /// Loads the scenes, and checks that the graphs compile for them: no input is found wrong only after others were
    /// measured.
    fn load(&self, results: &mut Results) -> Result<Vec<Loaded>, CliError> {
        if let Err(why) = &self.gpu {
            let what = Split::ALL.into_iter().filter(|backend| backend.side() == Side::Gpu);
            let what = what.filter(|backend| self.runs.iter().any(|runs| runs.backend == *backend));
            let what: Vec<String> = what.map(|backend| format!("rows `{backend}`")).collect();
            results.skipped.push(Skipped { what: what.join(", "), why: why.clone() });
        }
        let by_default = self.args.scene.is_empty();
        let named = self.args.scene.iter().map(String::as_str);
        let names: Vec<&str> = if by_default { SCENES.into() } else { named.collect() };
        let mut scenes = Vec::new();
        for name in names {
            match open::place(name, &self.args.camera) {
                Ok(place) => scenes.push(Loaded { name: name.into(), place }),
                // A default scene whose mesh is not fetched is skipped; one that the user names must load.
                Err(error) if by_default && needs_fetch(name) => {
                    results.skipped.push(Skipped { what: name.into(), why: error.to_string() });
                }
                Err(error) => return Err(error),
            }
        }
        for loaded in &scenes {
            for (runs, device) in self.possible() {
                measure::check(&self.job(loaded, runs, device, self.args.size.0))?;
            }
        }
        Ok(scenes)
    }

    fn run(&self, scenes: Vec<Loaded>, results: &mut Results) -> Result<(), CliError> {
        // Each scene's tracer goes with the scene.
        for (index, loaded) in scenes.into_iter().enumerate() {
            open::tracer_of_surfaces(&loaded.place)?;
            self.scene(&loaded, results)?;
            if index == 0 {
                self.sweep_pixels(&loaded, results)?;
                self.sweep_points(&loaded, results)?;
            }
        }
        Ok(())
    }

    /// What this machine can run, each with its device.
    fn possible(&self) -> impl Iterator<Item = (&Runs, &Device)> {
        self.runs.iter().filter_map(|runs| match (runs.backend.side(), &self.gpu) {
            (Side::Cpu, _) => Some((runs, &Device::CPU)),
            (Side::Gpu, Ok(Some(device))) => Some((runs, device)),
            (Side::Gpu, _) => None,
        })
    }

    fn scene(&self, loaded: &Loaded, results: &mut Results) -> Result<(), CliError> {
        for (runs, device) in self.possible() {
            let job = self.job(loaded, runs, device, self.args.size.0);
            results.take(&job, runs, |results| &mut results.rows)?;
        }
        Ok(())
    }

    fn sweep_pixels(&self, loaded: &Loaded, results: &mut Results) -> Result<(), CliError> {
        let sides: &[u32] = if self.args.quick { &QUICK_SIDES } else { &SIDES };
        for (runs, device) in self.possible().filter(|_| self.sweeps.contains(&Sweep::Pixels)) {
            let software = device.gpu.as_ref().is_some_and(|gpu| gpu.is_software());
            for &side in sides {
                let job = self.job(loaded, runs, device, [side, side]);
                if software && side > LARGEST_SOFTWARE_SIDE {
                    results.skip(&job, "not on a software GPU".into());
                    continue;
                }
                results.take(&job, runs, |results| &mut results.pixels)?;
            }
        }
        Ok(())
    }

    fn sweep_points(&self, loaded: &Loaded, results: &mut Results) -> Result<(), CliError> {
        let densities: &[f64] = if self.args.quick { &QUICK_POINTS_PER_PIXEL } else { &POINTS_PER_PIXEL };
        for (runs, device) in self.possible().filter(|_| self.sweeps.contains(&Sweep::Points)) {
            for &density in densities {
                let mut job = self.job(loaded, runs, device, self.args.size.0);
                let graph = measure::with_points(&job, density)?;
                job.label += &format!(" {density} points/pixel");
                job.graph = &graph;
                results.take(&job, runs, |results| &mut results.points)?;
            }
        }
        Ok(())
    }

    fn job<'b>(&'b self, loaded: &'b Loaded, runs: &'b Runs, device: &'b Device, size: [u32; 2]) -> Job<'b> {
        let variant = runs.variant.as_ref().map_or(String::new(), |(_, name)| format!(" {name}"));
        let label = format!("{} {}{variant} {}x{}", loaded.name, runs.backend, size[0], size[1]);
        Job { label, args: self.args, registry: self.registry, graph: &runs.graph, device, loaded, size }
    }
}

impl Results {
    /// Measures a row and adds it to its list, or the reason for its absence to the skipped ones.
    fn take(
        &mut self,
        job: &Job,
        runs: &Runs,
        place: impl Fn(&mut Self) -> &mut Vec<Row>,
    ) -> Result<(), CliError> {
        match measure::measure(job)? {
            Outcome::Measured(measured) => place(self).push(Row {
                scene: job.loaded.name.clone(),
                backend: runs.backend,
                graph: runs.graph.name(),
                variant: runs.variant.clone(),
                measured: *measured,
            }),
            Outcome::Beyond(why) => self.skip(job, why),
        }
        Ok(())
    }

    fn skip(&mut self, job: &Job, why: String) {
        self.skipped.push(Skipped { what: job.label.clone(), why });
    }
}

/// The requested backends, without duplicates. The default is all, except the hybrid if the user chooses another graph
/// than the one that it splits.
fn backends(args: &BenchArgs) -> Vec<Split> {
    let asked = |backend: Split| {
        let choice = match backend {
            Split::Cpu => Choice::Cpu,
            Split::Gpu => Choice::Gpu,
            Split::Hybrid => Choice::Hybrid,
        };
        match args.backend.as_slice() {
            [] => backend != Split::Hybrid || args.graph.is_empty(),
            choices => choices.contains(&choice) || choices.contains(&Choice::All),
        }
    };
    Split::ALL.into_iter().filter(|backend| asked(*backend)).collect()
}

/// The requested sweeps, without duplicates. The default is all, or none with `--quick`.
fn sweeps(args: &BenchArgs) -> Vec<Sweep> {
    let all = [Sweep::Pixels, Sweep::Points, Sweep::Edges];
    let asked = |sweep: &Sweep| match args.sweep.as_slice() {
        [] => !args.quick,
        chosen => chosen.contains(sweep),
    };
    all.into_iter().filter(asked).collect()
}

/// Returns true if a scene has to be fetched before it can be loaded.
pub fn needs_fetch(scene: &str) -> bool {
    epigraph_scenes::scene_names().iter().any(|known| known.name == scene && known.needs_fetch)
}
