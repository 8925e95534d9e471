//! `epigraph render`: runs a graph along a camera path and writes the last frame.

use std::{path::Path, process::ExitCode, sync::Arc, time::Instant};

use epigraph::{Device, Place, Registry, Run, Setup, Source, graphs};
use epigraph_core::{Executor, Graph, Node, PerSide, Plan, Port, RunError, Side, Snapshot};
use epigraph_pictures::{Kind, Look, is_image, png, show, size};
use epigraph_stages::{
    meaning,
    shared::requests::{HIT_NONE, Sample},
};

use crate::{
    INTERRUPTED,
    args::RenderArgs,
    blank,
    error::CliError,
    interrupt, open,
    output::{Json, Output, Outputs, Ready},
    progress,
    report::{self, Measured, Report},
    sheet::{self, Tile},
    values::Save,
};

/// Default file names of the picture and the contact sheet.
const PICTURE: &str = "epigraph.png";
const SHEET: &str = "epigraph-sheet.png";

/// The samples that arrived are counted in every frame of this interval, and in the last one.
const PROBE_INTERVAL: u32 = 8;

/// Renders frames and writes the last one. If the user interrupts it, one more frame runs and is written.
pub fn render(args: &RenderArgs, registry: &Arc<Registry>) -> Result<ExitCode, CliError> {
    let threads = rayon::current_num_threads();
    let named = args.graph.as_deref().unwrap_or(graphs::DEFAULT);
    let mut outputs = Outputs::default();
    let files = Files::new(args, &mut outputs)?;
    let file = open::graph(named, &args.compile.changes, registry)?;
    let size = args.scene.size.0;
    // Checked before the scene is loaded, which may take long.
    open::samples(args.compile.samples, size)?;
    let place = open::place_of(&args.scene)?;
    let device = Device::open(args.backend)?;
    let mut compiled = Setup::new(file)
        .registry(registry.clone())
        .at(&place)
        .device(&device)
        .size(size)
        .samples(args.compile.samples)
        .pace(args.pace)
        .threads(threads)
        .seed(args.seed)
        .prune(!args.compile.no_prune)
        .pooling(!args.compile.no_pooling)
        .vectors(!args.compile.no_vectors)
        .poison(args.poison)
        .watch(args.watch)
        .compile()?;
    let mut outputs = outputs.ready()?;
    let output = files.picture.as_ref().map(|_| compiled.picture()).transpose()?;
    // The sheet shows only nodes that run; tapping the ports of the others would keep them alive.
    let tiles =
        if files.sheet.is_some() { image_ports(compiled.graph(), compiled.plan(), size) } else { Vec::new() };
    let traced = traced_ports(compiled.graph());
    let saved = args.save.iter().map(|save| &save.source);
    let whites: Vec<Source> = open::fitted(compiled.graph()).collect();
    let kept: Vec<Source> = saved.chain(&tiles).chain(&traced).chain(&whites).cloned().collect();
    // The graph itself compiles, so an error here is about the ports to save.
    compiled.keep(&kept).map_err(|problems| CliError::Input(format!("--save: {problems}")))?;
    check_saves(compiled.plan(), size, args)?;
    compiled.require()?;
    let pooled = PerSide::new(|side| compiled.plan().pooled_bytes(side));
    let culled_bytes = total(&compiled.whole()?).saturating_sub(total(compiled.plan()));
    open::tracer(&place);
    let graph = compiled.file().name();
    let mut run = compiled.start()?;
    let measured = match run_frames(&mut run, args.frames, &traced) {
        Err(CliError::Run(epigraph::Error::Run(RunError::Watch(bad)))) => {
            // The pictures are not written: they are not what the graph is meant to make.
            outputs.finish(files.json, &report::of_bad_value(args, &graph, device.side, &bad), "")?;
            return Err(RunError::Watch(bad).into());
        }
        measured => measured?,
    };
    open::warn_of_bad_samples(run.non_finite_samples());
    open::warn_of_missing_shadows(run.incomplete_shadows());
    open::warn_of_dropped_shadows(run.dropped_shadows());

    let look = Look { far: place.path.camera(run.index() - 1).far, ..Look::default() };
    files.put(&mut outputs, &mut run.executor, output.as_deref(), &tiles, &look)?;
    let exposures = exposures(&mut run, &whites)?;
    let blank = why_blank(&mut run, output.as_deref(), &place, &look)?;
    let report = Report {
        args,
        graph: &graph,
        threads,
        samples: run.settings().samples,
        side: device.side,
        gpu: run.gpu().map(Arc::as_ref),
        plan: run.plan(),
        pooled_bytes: pooled,
        culled_bytes,
        frames: run.index(),
        measured: &measured,
        exposures: &exposures,
        notes: &place.scene.report,
        blank: blank.as_deref(),
        written: files.written(&outputs),
    };
    outputs.finish(files.json, &report.json(), &report.text())?;
    if let Some(why) = &blank {
        eprintln!("warning: {why}");
    }
    if run.index() < args.frames {
        eprintln!("interrupted after {} of {} frames", run.index(), args.frames);
        return Ok(ExitCode::from(INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

/// Bytes of a plan's memory on both sides.
fn total(plan: &Plan) -> u64 {
    Side::ALL.into_iter().map(|side| plan.bytes(side)).sum()
}

/// Why the picture shows nothing, if it does not.
fn why_blank(
    run: &mut Run,
    output: Option<&str>,
    place: &Place,
    look: &Look,
) -> Result<Option<String>, CliError> {
    if place.scene.has_only_points() {
        return Ok(None);
    }
    let (frame, size) = (run.index() - 1, run.settings().size);
    let snapshots = run.executor.snapshots()?;
    let field = output.and_then(|output| snapshots.iter().copied().find(|snapshot| snapshot.name == output));
    let tracer = place.tracer().at(frame);
    Ok(field
        .and_then(|field| blank::why(&show(field, look).colors, &tracer, &place.path.camera(frame), size)))
}

/// The nodes that fit the exposure to the picture, and their exposures in the last frame, in EV.
fn exposures(run: &mut Run, whites: &[Source]) -> Result<Vec<(String, f64)>, CliError> {
    let ev = |white: &Source| {
        let shown_as_1 = run.snapshot(&white.to_string())?.get::<f32>()[0];
        // 0 before there is light.
        let ev = if shown_as_1 > 0.0 { -f64::from(shown_as_1).log2() } else { 0.0 };
        Ok((white.node.clone(), ev))
    };
    whites.iter().map(ev).collect()
}

/// Runs all frames, or up to the one after an interruption. The last one is captured.
fn run_frames(run: &mut Run, frames: u32, traced: &[Source]) -> Result<Measured, CliError> {
    let mut measured = Measured::new(frames);
    let bar = progress::bar(frames.into(), "rendering", "frames");
    let start = Instant::now();
    loop {
        let index = run.index();
        let last = index + 1 == frames || interrupt::asked();
        let capture = index.is_multiple_of(PROBE_INTERVAL) || last;
        run.advance(capture)?;
        measured.times(index, run.executor.times());
        measured.ran(run.executor.ran().as_raw_slice());
        if capture && !traced.is_empty() {
            measured.arrived(arrived(&mut run.executor, traced)?);
        }
        bar.inc(1);
        if last {
            break;
        }
    }
    measured.seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    Ok(measured)
}

/// The ports that samples come from.
fn traced_ports(graph: &Graph) -> Vec<Source> {
    let ports = |node: &Node| {
        let declared = node.declaration().ports.iter();
        let samples = declared.filter(|port| port.is_output() && port.meaning == Some(meaning::SAMPLES));
        let source = |port: &Port| Source { node: node.name.clone(), port: port.name.to_string() };
        samples.map(source).collect::<Vec<_>>()
    };
    graph.nodes.iter().flat_map(ports).collect()
}

/// The number of samples in the captured ports.
fn arrived(executor: &mut Executor, traced: &[Source]) -> Result<u64, RunError> {
    let names: Vec<String> = traced.iter().map(Source::to_string).collect();
    let snapshots = executor.snapshots()?;
    let lists = snapshots.into_iter().filter(|snapshot| names.contains(&snapshot.name));
    let count = |list: &Snapshot| list.get::<Sample>().iter().filter(|sample| sample.hit != HIT_NONE).count();
    Ok(lists.map(|list| count(list) as u64).sum())
}

/// Checks that ports to be saved as images are images.
fn check_saves(plan: &Plan, size: [u32; 2], args: &RenderArgs) -> Result<(), CliError> {
    for Save { source, file } in &args.save {
        if !Kind::of(file)?.is_image() {
            continue;
        }
        let tap = plan.taps.iter().find(|tap| tap.name == source.to_string());
        let storages: Vec<_> =
            tap.iter().flat_map(|tap| &tap.fields).map(|field| &plan.storages[field.storage]).collect();
        let what = match storages.as_slice() {
            [only] if is_image(&only.element, only.dims, size) => continue,
            [_] => "a list",
            _ => "a bundle of lists",
        };
        let cause = format!("`{source}` is {what}, not an image; save it as .csv");
        return Err(CliError::write(file, cause));
    }
    Ok(())
}

/// All written ports with the shape of an image, in execution order, without scratch ports: nobody but their stage can make
/// sense of them.
fn image_ports(graph: &Graph, plan: &Plan, size: [u32; 2]) -> Vec<Source> {
    let mut sources = Vec::new();
    for node in plan.order() {
        let node = &graph.nodes[node];
        for (port, declared) in node.declaration().ports.iter().enumerate() {
            let [field] = declared.fields.as_slice() else { continue };
            if declared.is_output() && !declared.scratch && is_image(&field.element, node.dims[port], size) {
                sources.push(Source { node: node.name.clone(), port: declared.name.to_string() });
            }
        }
    }
    sources
}

/// The output files, checked to be writable before the first frame.
struct Files {
    picture: Option<(Kind, Output)>,
    saves: Vec<(Source, Kind, Output)>,
    sheet: Option<Output>,
    json: Json,
}

impl Files {
    fn new(args: &RenderArgs, outputs: &mut Outputs) -> Result<Self, CliError> {
        let mut saves = Vec::new();
        for Save { source, file } in &args.save {
            saves.push((source.clone(), Kind::of(file)?, outputs.add("--save", file)?));
        }
        // With --save alone, the graph need not have a picture.
        let out = args.out.as_deref().or(saves.is_empty().then_some(Path::new(PICTURE)));
        let mut picture = None;
        if let Some(out) = out {
            picture = Some((Kind::of_picture(out)?, outputs.add("--out", out)?));
        }
        let plain = args.graph.is_none() && args.out.is_none() && picture.is_some();
        let sheet = args.sheet.as_deref().or(plain.then_some(Path::new(SHEET)));
        let sheet = sheet.map(|path| outputs.add("--sheet", path)).transpose()?;
        let json = outputs.json(args.json.as_deref())?;
        Ok(Self { picture, saves, sheet, json })
    }

    /// Writes pictures and ports, but not the JSON.
    fn put(
        &self,
        outputs: &mut Ready,
        executor: &mut Executor,
        output: Option<&str>,
        tiles: &[Source],
        look: &Look,
    ) -> Result<(), CliError> {
        let snapshots = executor.snapshots()?;
        let fields = |name: &str| -> Vec<_> {
            snapshots.iter().copied().filter(|snapshot| snapshot.name == name).collect()
        };
        let picture = self.picture.zip(output).map(|((kind, file), output)| (output.to_owned(), kind, file));
        let saves = self.saves.iter().map(|(source, kind, file)| (source.to_string(), *kind, *file));
        for (name, kind, file) in picture.into_iter().chain(saves) {
            let bytes = kind.encode(&fields(&name), look);
            outputs.put(file, &bytes.map_err(|cause| CliError::write(outputs.path(file), cause))?)?;
        }
        if let Some(file) = self.sheet {
            let tile = |source: &Source| {
                let name = source.to_string();
                let colors = fields(&name).first().map(|field| (field.dims, show(field, look).colors));
                colors.map(|(dims, colors)| Tile { label: name, size: size(dims), colors })
            };
            let tiles: Vec<Tile> = tiles.iter().filter_map(tile).collect();
            let (size, colors) = sheet::sheet(&tiles);
            let png = png(size, &colors).map_err(|error| CliError::write(outputs.path(file), error))?;
            outputs.put(file, &png)?;
        }
        Ok(())
    }

    /// The contents and the path of each file.
    fn written(&self, outputs: &Ready) -> Vec<(String, String)> {
        let picture = self.picture.map(|(_, file)| ("picture".to_owned(), file));
        let sheet = self.sheet.map(|file| ("sheet".to_owned(), file));
        let saves = self.saves.iter().map(|(source, _, file)| (source.to_string(), *file));
        let files = picture.into_iter().chain(sheet).chain(saves);
        files.map(|(what, file)| (what, outputs.path(file).display().to_string())).collect()
    }
}

#[cfg(test)]
mod tests {
    use epigraph::Backend;

    use super::*;

    #[test]
    fn scratch_ports_are_not_on_the_sheet_but_can_be_saved() {
        let size = [48, 32];
        let setup = Run::open("epi").unwrap().scene("cornell").camera("still").size(size);
        let mut compiled = setup.backend(Backend::Cpu).compile().unwrap();
        let (graph, plan) = (compiled.graph(), compiled.plan());
        let sheet = image_ports(graph, plan, size);
        let mut left_out = Vec::new();
        // The number of scratch ports that have the shape of an image.
        let mut images = 0;
        for node in plan.order().map(|id| &graph.nodes[id]) {
            for (port, dims) in node.declaration().ports.iter().zip(&node.dims) {
                if port.scratch && port.is_output() {
                    let source = Source { node: node.name.clone(), port: port.name.to_string() };
                    assert!(!sheet.contains(&source), "{source}");
                    images += usize::from(is_image(&port.fields[0].element, *dims, size));
                    left_out.push(source);
                }
            }
        }
        assert!(images > 0, "{left_out:?}");
        compiled.keep(&left_out).unwrap();
    }
}
