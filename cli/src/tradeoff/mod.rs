//! `epigraph tradeoff`: what graphs reach for what they cost, cell by cell. `epigraph quality` measures in the same way, an
//! experiment that the command line describes.

pub mod cell;
pub mod experiment;
pub mod figure;
pub mod plot;
pub mod results;
pub mod runner;
pub mod store;
pub mod study;

mod bisect;
mod crops;
mod intervals;
mod measure;
mod page;
mod paper;
mod references;
mod search;
mod stacks;

use std::{collections::BTreeSet, path::Path, process::ExitCode, sync::Arc, time::Duration};

use epigraph::Registry;
use epigraph_core::Side;
use indicatif::ProgressBar;
use serde::Deserialize;
use serde_json::{Value, json};

use self::{
    cell::{Cell, Found, Outcome, Reached, Record},
    experiment::{Experiment, Frames, Over},
    figure::Cost,
    page::Shown,
    paper::Figure,
    results::Results,
    runner::{Runner, interrupted, is_open_cell, open_cells, open_ones, records, wanted},
    store::Store,
    study::{Study, Task},
};
use crate::{
    args::TradeoffArgs,
    error::CliError,
    interrupt,
    machine::Machine,
    output::{Output, Outputs, Ready, print},
    svg,
    table::Table,
};

/// The files of the results.
const CSV: &str = "results.csv";
const SEARCHES: &str = "searches.csv";
const JSON: &str = "results.json";
const PAGE: &str = "page.html";

const STACKS: &str = "ms-by-node.svg";
const INTERVALS: &str = "searches.svg";

/// What the plot over frames is called after.
const FRAMES: &str = "frames";

/// Runs an experiment, or the part of it that the options choose.
pub fn tradeoff(args: &TradeoffArgs, registry: &Arc<Registry>) -> Result<ExitCode, CliError> {
    let threads = rayon::current_num_threads();
    let experiment = Experiment::read(&args.experiment, args.quick)?;
    let study = Study::open(&experiment, registry)?;
    let store = args.out.as_deref().map(Store::new).transpose()?;
    if args.list {
        return list(&study, store.as_ref()).map(|()| ExitCode::SUCCESS);
    }
    if args.jobs {
        return jobs(&study, store.as_ref()).map(|()| ExitCode::SUCCESS);
    }
    // The command line asks for a folder in all other cases.
    let Some(store) = store else { return Err(CliError::Input("--out DIR is missing".into())) };
    let figure = args.figure.figure.as_ref().map(|_| Figure::plan(&args.figure, &study)).transpose()?;
    let gpu = study.device.gpu.as_ref().filter(|_| study.device.side == Side::Gpu);
    let machine = Machine::new(threads, gpu.map(Arc::as_ref)).json();
    let work = Work { study: &study, store: &store, machine };
    if let Some(job) = &args.run {
        return work.run_job(job);
    }
    let outputs = Files::new(args, &experiment, &store)?;
    let all = || work.collect(args, figure.as_ref(), outputs);
    if args.collect { all() } else { work.run_all(all) }
}

/// Prints the cells in words.
fn list(study: &Study, store: Option<&Store>) -> Result<(), CliError> {
    let mut table =
        Table::new(&["graph", "scene", "camera", "size", "budget", ">samples", ">paths/px", ">seed", ""]);
    let mut references = BTreeSet::new();
    for cell in &study.cells {
        let state = match store.map(|store| store.cell(&cell.key)).transpose()?.flatten() {
            None => "",
            Some(Record { result: Outcome::Measured(_), .. }) => "done",
            Some(Record { result: Outcome::Failed(_), .. }) => "failed",
        };
        let size = format!("{}x{}", cell.size[0], cell.size[1]);
        let paths = cell.paths_per_pixel.map_or_else(|| "-".to_owned(), |paths| format!("{paths:.3}"));
        let (samples, seed) = (cell.samples.to_string(), cell.seed.to_string());
        let (scene, camera, budget) = (cell.scene.clone(), cell.camera.clone(), cell.budget.clone());
        table.row([cell.variation(), scene, camera, size, budget, samples, paths, seed, state.into()]);
        references.extend(wanted(study, cell).map(|wanted| wanted.key().to_owned()));
    }
    let mut searches = String::new();
    for task in &study.tasks {
        let Task { setting, search, range: [from, to], .. } = task;
        let what = format!("{} of {}, {}", task.label(), setting.cell.variation(), setting.cell.view());
        let unit = if matches!(search.over, Over::Samples(_)) { " samples" } else { "" };
        searches += &format!("search for {what}, from {from} to {to}{unit}\n");
        references.extend(wanted(study, &setting.cell).map(|wanted| wanted.key().to_owned()));
    }
    let (cells, tasks, count) = (study.cells.len(), study.tasks.len(), references.len());
    let spp = study.experiment.spp;
    let table = if cells > 0 { format!("{table}\n") } else { String::new() };
    let tasks = if tasks > 0 { format!("{searches}\n{tasks} searches, ") } else { String::new() };
    print(&format!("{table}{tasks}{cells} cells, {count} references of {spp} samples per pixel\n"))
}

/// Prints the cells and searches that are not done as lines of JSON.
fn jobs(study: &Study, store: Option<&Store>) -> Result<(), CliError> {
    for cell in open_cells(study, store)? {
        let Cell { key, variant, budget, seed, .. } = cell;
        let line =
            json!({ "cell": key, "variant": variant, "view": cell.view(), "budget": budget, "seed": seed });
        print(&format!("{line}\n"))?;
    }
    for task in open_tasks(study, store)? {
        let Cell { variant, .. } = &task.setting.cell;
        let (view, what) = (task.setting.cell.view(), task.label());
        let line = json!({ "search": task.key, "variant": variant, "view": view, "what": what });
        print(&format!("{line}\n"))?;
    }
    Ok(())
}

/// The searches that have no answer yet.
fn open_tasks<'s>(study: &'s Study, store: Option<&Store>) -> Result<Vec<&'s Task>, CliError> {
    open_ones(&study.tasks, store, is_open_task)
}

fn is_open_task(task: &Task, store: &Store) -> Result<bool, CliError> {
    Ok(store.search(&task.key)?.is_none_or(|found| matches!(found.result, Reached::Failed(_))))
}

/// A study with its folder.
struct Work<'a> {
    study: &'a Study<'a>,
    store: &'a Store,
    machine: Value,
}

/// A line of `--jobs`.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Key {
    Cell(String),
    Search(String),
}

#[derive(Deserialize)]
struct Job {
    #[serde(flatten)]
    key: Key,
}

impl Work<'_> {
    /// Measures and searches what is not there, and writes the results.
    fn run_all(&self, collect: impl FnOnce() -> Result<ExitCode, CliError>) -> Result<ExitCode, CliError> {
        let tasks = open_tasks(self.study, Some(self.store))?;
        match self.runner().all().and_then(|_| self.run_tasks(&tasks)) {
            Err(CliError::Interrupted) => interrupted(self.study, self.store),
            Err(error) => Err(error),
            Ok(()) => collect(),
        }
    }

    fn runner(&self) -> Runner<'_> {
        Runner { study: self.study, store: Some(self.store), machine: &self.machine }
    }

    fn run_tasks(&self, tasks: &[&Task]) -> Result<(), CliError> {
        self.runner().trace_references(tasks.iter().map(|task| &task.setting.cell), self.store)?;
        let bar = ProgressBar::new_spinner();
        bar.enable_steady_tick(Duration::from_millis(100));
        for task in tasks {
            interrupt::check()?;
            let found = self.search(task, &bar)?;
            if let Reached::Failed(message) = &found.result {
                let Task { setting, .. } = task;
                let what = format!("{}, {}", setting.cell.variation(), setting.cell.view());
                bar.suspend(|| eprintln!("failed: search for {} of {what}: {message}", task.label()));
            }
            self.store.keep_search(&found)?;
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// Measures the cell, or makes the search, of a line of `--jobs`.
    fn run_job(&self, job: &str) -> Result<ExitCode, CliError> {
        let Job { key } = serde_json::from_str(job)
            .map_err(|error| CliError::Input(format!("--run {job}: {error}; expected a line of --jobs")))?;
        let unknown = |what: &str, key: &str| {
            CliError::Input(format!(
                "--run: the experiment has no {what} {key}; the experiment, a file that it names, or the program has \
                 changed since --jobs, or --quick differs"
            ))
        };
        let (label, failed) = match &key {
            Key::Cell(key) => {
                let cell = self.study.cells.iter().find(|cell| cell.key == *key);
                let cell = cell.ok_or_else(|| unknown("cell", key))?;
                if is_open_cell(cell, self.store)? {
                    self.runner().run(&[cell])?;
                }
                (cell.label(), is_open_cell(cell, self.store)?)
            }
            Key::Search(key) => {
                let task = self.study.tasks.iter().find(|task| task.key == *key);
                let task = task.ok_or_else(|| unknown("search", key))?;
                if is_open_task(task, self.store)? {
                    self.run_tasks(&[task])?;
                }
                let label = format!("search for {} of {}", task.label(), task.setting.cell.variation());
                (label, is_open_task(task, self.store)?)
            }
        };
        print(&format!("{label}: {}\n", if failed { "failed" } else { "done" }))?;
        Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
    }

    /// The references of all views and the pictures of the first seed's cells that are kept.
    fn pictures(&self, records: &[Record]) -> Result<Vec<Shown>, CliError> {
        let Experiment { metrics, seeds, spp, .. } = self.study.experiment;
        let mut pictures: Vec<Shown> = Vec::new();
        for record in records.iter().filter(|record| seeds.first() == Some(&record.cell.seed)) {
            if pictures.iter().all(|shown| shown.view != record.cell.view())
                && let Some(last) = wanted(self.study, &record.cell).last()
                && let Some(picture) = last.picture(self.store)?
            {
                pictures.push(Shown::reference(record, *spp, &picture).map_err(CliError::Input)?);
            }
            let (png, map) =
                (self.store.picture_file(&record.cell.key)?, self.store.map_file(&record.cell.key)?);
            let both = png.zip(map).filter(|_| record.measured().is_some());
            pictures.extend(both.map(|(png, map)| Shown::of(record, metrics, png, map)));
        }
        Ok(pictures)
    }

    /// What was measured, where and with what, in a line.
    fn about(&self) -> String {
        let Study { experiment, device, .. } = self.study;
        let Experiment { frames: Frames { count: frames, compare }, spp, .. } = experiment;
        let compare: Vec<String> = compare.iter().map(u32::to_string).collect();
        let cpu = self.machine["cpu"].as_str().unwrap_or_default();
        format!(
            "{frames} frames each; frames {} compared with references of {spp} samples per pixel; {}, \
             {cpu}; epigraph {}",
            compare.join(", "),
            device.side,
            env!("CARGO_PKG_VERSION")
        )
    }

    /// Writes the results of the cells that are there.
    fn collect(
        &self,
        args: &TradeoffArgs,
        figure: Option<&Figure>,
        mut outputs: Files,
    ) -> Result<ExitCode, CliError> {
        let records = records(self.study, self.store)?;
        let mut found = Vec::new();
        for task in &self.study.tasks {
            let cell = || task.setting.cell.clone();
            found.extend(self.store.search(&task.key)?.map(|found| Found { cell: cell(), ..found }));
        }
        let all = self.study.cells.len() + self.study.tasks.len();
        let missing = all - records.len() - found.len();
        let results =
            Results { experiment: self.study.experiment, records: &records, found: &found, missing };
        let command: Vec<String> = std::env::args().collect();
        let json = format!("{:#}\n", results.json(&command, &self.machine));
        let mut files = vec![(CSV.to_owned(), results.csv()), (JSON.to_owned(), json)];
        if !self.study.tasks.is_empty() {
            files.push((SEARCHES.to_owned(), results.searches_csv()));
        }
        let plots = plots(self.study.experiment, &records, &found);
        if !(records.is_empty() && found.is_empty()) {
            let svgs: Vec<&str> = plots.iter().map(|(_, svg)| svg.as_str()).collect();
            let page = page::page(&results, &svgs, &self.pictures(&records)?, &self.about());
            files.push((PAGE.to_owned(), page));
        }
        files.extend(plots);
        for (name, text) in &files {
            outputs.put(name, text)?;
        }
        if let Some((figure, file)) = figure.zip(outputs.figure) {
            outputs.ready.put(file, self.figure(figure, &records)?.as_bytes())?;
        }
        outputs.ready.commit()?;
        let failed = records.iter().filter(|record| record.measured().is_none()).count()
            + found.iter().filter(|found| matches!(found.result, Reached::Failed(_))).count();
        let mut text = format!("{}\n", results.text());
        for (name, _) in &files {
            let what = match name.rsplit_once('.') {
                Some((_, "svg")) => "plot",
                Some((_, "html")) => "page",
                _ => "results",
            };
            text += &format!("{what:<7}  {}\n", self.store.root().file(name).display());
        }
        if let Some(path) = &args.figure.figure {
            text += &format!("figure   {}\n", path.display());
        }
        print(&text)?;
        let what = if self.study.tasks.is_empty() { "cells" } else { "cells and searches" };
        if missing > 0 {
            eprintln!("{missing} of {all} {what} are missing; {} measures them", rerun(args));
        }
        if failed > 0 {
            eprintln!("error: {failed} of {all} {what} failed");
        }
        Ok(if failed + missing > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS })
    }
}

/// The files of the results that there may be. None of them is an input.
struct Files {
    ready: Ready,
    /// Those in the folder, by their names.
    named: Vec<(String, Output)>,
    /// That of `--figure`.
    figure: Option<Output>,
}

impl Files {
    fn new(args: &TradeoffArgs, experiment: &Experiment, store: &Store) -> Result<Self, CliError> {
        let metric = experiment.metrics.first().map_or("", |metric| metric.column());
        let over = experiment.costs.iter().map(|cost| cost.column()).chain([FRAMES]);
        let plots = over.map(|over| plot_name(metric, over));
        let mut outputs = Outputs::default();
        let named =
            [CSV, SEARCHES, JSON, PAGE, STACKS, INTERVALS].map(String::from).into_iter().chain(plots).map(
                |name| {
                    let file = outputs.add("--out", &store.root().file(&name))?;
                    Ok((name, file))
                },
            );
        let named = named.collect::<Result<_, CliError>>()?;
        let figure = args.figure.figure.as_deref();
        let figure = figure.map(|path| svg::add(&mut outputs, "--figure", path)).transpose()?;
        Ok(Self { ready: outputs.ready()?, named, figure })
    }

    /// Writes a file beside its place.
    fn put(&mut self, name: &str, text: &str) -> Result<(), CliError> {
        let file = self.named.iter().find(|(known, _)| known == name);
        let (_, file) = file.expect("all files are named beforehand");
        self.ready.put(*file, text.as_bytes())
    }
}

fn plot_name(metric: &str, over: &str) -> String {
    format!("{metric}-over-{over}.svg")
}

/// The plots of an experiment, by the names of their files: its first metric over each of its costs and over frames,
/// the times of nodes, and the answers of searches.
fn plots(experiment: &Experiment, records: &[Record], found: &[Found]) -> Vec<(String, String)> {
    let Some(&metric) = experiment.metrics.first() else { return Vec::new() };
    let column = metric.column();
    let over_cost = |cost: &Cost| {
        let svg = plot::over_cost(&experiment.doc, records, metric, *cost)?;
        Some((plot_name(column, cost.column()), svg))
    };
    let over_frames = plot::over_frames(&experiment.doc, records, metric);
    let over_frames = over_frames.map(|svg| (plot_name(column, FRAMES), svg));
    let stacks = stacks::stacks(&experiment.doc, records).map(|svg| (STACKS.to_owned(), svg));
    let intervals = intervals::intervals(&experiment.doc, found).map(|svg| (INTERVALS.to_owned(), svg));
    experiment.costs.iter().filter_map(over_cost).chain(over_frames).chain(stacks).chain(intervals).collect()
}

/// The command that measures what is missing.
fn rerun(args: &TradeoffArgs) -> String {
    let out = args.out.as_deref().unwrap_or(Path::new("DIR"));
    let quick = if args.quick { " --quick" } else { "" };
    format!("epigraph tradeoff {}{quick} --out {}", args.experiment.display(), out.display())
}
