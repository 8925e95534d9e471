//! `epigraph render`: runs a graph along a camera path and writes the last frame.

use std::{path::Path, sync::Arc, time::Instant};

use epigraph_core::{
    AdapterChoice, Executor, Gpu, Graph, GraphError, GraphFile, Host, PerSide, Plan, PlannedNode, Problem,
    Registry, RunError, Settings, Side, Source, compile,
};
use epigraph_pictures::{Look, Number, PortFile, Target, is_image, lanes, png, show, size};
use epigraph_scenes::{AsyncTracer, CameraPath, Scene, Tracer};
use epigraph_stages::{Pace, World, shared::requests::HIT_NONE};

use crate::{
    args::RenderArgs,
    error::CliError,
    graph_source, memory,
    output::JsonTarget,
    progress,
    reference::load_scene,
    report::{Measured, Report},
    sheet::{self, Tile},
    values::{self, Backend},
};

/// The picture where none is named, and the sheet beside it.
const PICTURE: &str = "epigraph.png";
const SHEET: &str = "epigraph-sheet.png";

/// Kind of the stage that traces, whose time is told apart, and its port of samples.
pub const TRACE: &str = "trace";
const SAMPLES: &str = "samples";

/// The beginning of the documentation of ports that only their own stage reads.
const SCRATCH: &str = "Scratch";

/// Every so many frames, and in the last one, the samples that arrived are counted.
const PROBE_INTERVAL: u32 = 8;

/// Renders.
pub fn render(args: &RenderArgs) -> Result<(), CliError> {
    let threads = set_threads(args.threads)?;
    let mut file = graph_source::load(args.graph.as_deref().unwrap_or(graph_source::DEFAULT_GRAPH))?;
    graph_source::apply(&mut file, &args.compile.set)?;
    let files = Files::new(args)?;
    let size = args.scene.size.0;
    let samples = args.compile.samples.of(size).map_err(CliError::Input)?;

    let registry = epigraph_stages::registry();
    let (scene, path) = load_scene(&args.scene)?;
    let (side, gpu) = placement(args.backend)?;
    let mut settings = Settings {
        facts: World::facts(&scene, path.moves()),
        side,
        prune: !args.compile.no_prune,
        pooling: !args.compile.no_pooling,
        poison: args.poison,
        ..Settings::new(size, samples)
    };
    let (graph, plan) = compile(&file, &registry, &settings)?;
    let output = files.picture.as_ref().map(|_| image_output(&file, &graph, size)).transpose()?;
    // Only now is it known which nodes run: taps would keep the others alive.
    let tiles = if files.sheet.is_some() { image_ports(&graph, &plan, size) } else { Vec::new() };
    let traced = traced_ports(&graph);
    let saved = files.saves.iter().map(|(source, _)| source);
    for source in saved.chain(&tiles).chain(&traced) {
        if !settings.taps.contains(source) {
            settings.taps.push(source.clone());
        }
    }
    // The graph is sound, so what is wrong now is what was asked for.
    let (graph, plan) = compile(&file, &registry, &settings)
        .map_err(|problems| CliError::Input(format!("--save: {problems}")))?;
    check_saves(&plan, size, &files)?;
    let gpu = gpu_for(&plan, gpu)?;
    let pooled = PerSide::new(|side| plan.pooled_bytes(side));
    let mut executor = executor(graph, plan, &settings, &registry, gpu.clone())?;
    let host = host(tracer(&scene), args.pace, threads);
    let measured = run(&mut executor, &host, &path, args, samples, &traced)?;
    warn_of_bad_samples(&host);

    let look = Look { far: path.camera(args.frames - 1).far, ..Look::default() };
    files.write(&mut executor, output.as_deref(), &tiles, &look)?;
    let report = Report {
        args,
        graph: &file.path,
        threads,
        samples,
        side,
        gpu: gpu.as_deref(),
        plan: executor.plan(),
        pooled_bytes: pooled,
        measured: &measured,
        written: files.written(),
    };
    files.json.finish(&report.json(), &report.text())
}

/// Makes the pool of threads that all computing shares; how many they are.
pub fn set_threads(wanted: Option<u16>) -> Result<usize, CliError> {
    if let Some(threads) = wanted {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.into())
            .build_global()
            .map_err(|error| CliError::Input(format!("--threads {threads}: {error}")))?;
    }
    Ok(rayon::current_num_threads())
}

/// Where nodes run by default, and the GPU if it is that.
pub fn placement(backend: Backend) -> Result<(Side, Option<Arc<Gpu>>), RunError> {
    match backend {
        Backend::Cpu => Ok((Side::Cpu, None)),
        Backend::Gpu => Ok((Side::Gpu, Some(Arc::new(Gpu::open(AdapterChoice::Any)?)))),
        Backend::Auto => match Gpu::open(AdapterChoice::Hardware) {
            Ok(gpu) => Ok((Side::Gpu, Some(Arc::new(gpu)))),
            Err(_) => Ok((Side::Cpu, None)),
        },
    }
}

/// Makes what runs a plan, if this machine has the GPU and the memory that it needs.
pub fn executor(
    graph: Graph,
    plan: Plan,
    settings: &Settings,
    registry: &Registry,
    open: Option<Arc<Gpu>>,
) -> Result<Executor, CliError> {
    let gpu = gpu_for(&plan, open)?;
    require_memory(&plan, gpu.as_deref())?;
    Ok(Executor::new(graph, plan, settings, registry, gpu)?)
}

/// The GPU that the plan needs: some stages have no other form.
pub fn gpu_for(plan: &Plan, open: Option<Arc<Gpu>>) -> Result<Option<Arc<Gpu>>, CliError> {
    let Some(PlannedNode { name, kind, .. }) = plan.nodes.iter().find(|node| node.side == Side::Gpu) else {
        return Ok(None);
    };
    if open.is_some() {
        return Ok(open);
    }
    let gpu = Gpu::open(AdapterChoice::Any)
        .map_err(|error| CliError::Input(format!("node `{name}` ({kind}) runs on a GPU here: {error}")))?;
    Ok(Some(Arc::new(gpu)))
}

/// Makes sure that the plan's memory is there.
pub fn require_memory(plan: &Plan, gpu: Option<&Gpu>) -> Result<(), CliError> {
    let tapped =
        plan.taps.iter().flat_map(|tap| &tap.fields).map(|field| plan.storages[field.storage].bytes());
    // A software GPU's memory is the machine's.
    let gpu_bytes = if gpu.is_some_and(Gpu::is_software) { plan.bytes(Side::Gpu) } else { 0 };
    memory::require(plan.bytes(Side::Cpu) + gpu_bytes + tapped.sum::<u64>())
}

/// Builds the tracer of a scene.
pub fn tracer(scene: &Arc<Scene>) -> Arc<Tracer> {
    progress::spinner("building the tracer".into(), || Arc::new(Tracer::new(scene.clone())))
}

/// What the stages get beside their ports: the scene behind its tracer.
pub fn host(tracer: Arc<Tracer>, pace: values::Pace, threads: usize) -> Host {
    let pace = match pace {
        values::Pace::Exact => Pace::Exact,
        values::Pace::Async => Pace::Async(AsyncTracer::new(threads)),
    };
    let mut host = Host::default();
    host.insert(World::new(tracer, pace));
    host
}

/// Runs all frames; the last one is captured.
fn run(
    executor: &mut Executor,
    host: &Host,
    path: &CameraPath,
    args: &RenderArgs,
    samples: u32,
    traced: &[Source],
) -> Result<Measured, CliError> {
    let mut measured = Measured::new(args.frames);
    let bar = progress::bar(args.frames.into(), "rendering", "frames");
    let start = Instant::now();
    for index in 0..args.frames {
        let frame = World::frame(path, index, args.scene.size.0, samples, args.seed);
        let capture = index % PROBE_INTERVAL == 0 || index + 1 == args.frames;
        executor.run(&frame, host, capture)?;
        measured.times(index, executor.times());
        measured.ran(executor.ran().as_raw_slice());
        if capture && !traced.is_empty() {
            measured.arrived(arrived(executor, traced)?);
        }
        bar.inc(1);
    }
    measured.seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    Ok(measured)
}

/// A radiance that is no number is a fault of the scene or of the tracer, which the picture alone would not show.
pub fn warn_of_bad_samples(host: &Host) {
    let count = host.get::<World>().map_or(0, |world| world.tracer.non_finite());
    if count > 0 {
        eprintln!("warning: {count} samples had a radiance that is not finite; they count as black");
    }
}

/// The ports of samples of nodes that trace.
fn traced_ports(graph: &Graph) -> Vec<Source> {
    let tracing =
        graph.nodes.iter().filter(|node| node.kind == TRACE && node.declaration().port(SAMPLES).is_some());
    tracing.map(|node| Source { node: node.name.clone(), port: SAMPLES.into() }).collect()
}

/// How many samples lie in the captured ports.
fn arrived(executor: &mut Executor, traced: &[Source]) -> Result<u64, RunError> {
    let names: Vec<String> = traced.iter().map(Source::to_string).collect();
    let snapshots = executor.snapshots()?;
    let lists = snapshots.into_iter().filter(|snapshot| names.contains(&snapshot.name));
    let count = |list: &epigraph_core::Snapshot| {
        let hits = lanes(&list.element).into_iter().find(|lane| lane.name == "hit");
        hits.map_or(0, |hit| hit.numbers(list).filter(|number| *number != Number::Unsigned(HIT_NONE)).count())
    };
    Ok(lists.map(|list| count(list) as u64).sum())
}

/// The output that is the picture: the one called `image`, else the first. Its name.
pub fn image_output(file: &GraphFile, graph: &Graph, size: [u32; 2]) -> Result<String, CliError> {
    let outputs = &graph.outputs;
    let chosen = outputs.iter().find(|(name, _)| name == "image").or(outputs.first());
    // A graph without outputs does not compile.
    let Some((name, at)) = chosen else { return Err(CliError::Input("the graph has no output".into())) };
    let port = &graph.nodes[at.node].declaration().ports[at.port];
    let dims = graph.nodes[at.node].dims[at.port];
    let is_image = port.fields.len() == 1 && is_image(&port.fields[0].element, dims, size);
    if is_image {
        return Ok(name.clone());
    }
    let source = graph.name(*at);
    let text = format!(
        "the output `{name}` is no image but {dims} elements of `{source}` ({}); name an image as output, or save the \
         list: epigraph render --save {source}=FILE.csv",
        port.extent
    );
    let problem = Problem::new(GraphError::Invalid(text));
    let written = file.outputs.iter().find(|output| output.name.value == *name);
    Err(written.map_or(problem.clone(), |output| problem.at(file.place(output.from.span))).into())
}

/// Makes sure that what is to be saved as an image is one.
fn check_saves(plan: &Plan, size: [u32; 2], files: &Files) -> Result<(), CliError> {
    for (source, save) in files.saves.iter().filter(|(_, save)| save.is_image()) {
        let tap = plan.taps.iter().find(|tap| tap.name == source.to_string());
        let storages: Vec<_> =
            tap.iter().flat_map(|tap| &tap.fields).map(|field| &plan.storages[field.storage]).collect();
        let what = match storages.as_slice() {
            [only] if is_image(&only.element, only.dims, size) => continue,
            [_] => "a list",
            _ => "a bundle of lists",
        };
        let cause = format!("`{source}` is {what}, not an image; save it as .csv");
        return Err(CliError::write(save.path(), cause));
    }
    Ok(())
}

/// Every written port with the shape of an image, in the order in which they are written.
fn image_ports(graph: &Graph, plan: &Plan, size: [u32; 2]) -> Vec<Source> {
    let mut sources = Vec::new();
    for node in plan.order() {
        let node = &graph.nodes[node];
        for (port, declared) in node.declaration().ports.iter().enumerate() {
            let [field] = declared.fields.as_slice() else { continue };
            // Sums over tiles and the like show nothing of the picture.
            let dims = node.dims[port];
            if declared.doc.starts_with(SCRATCH) && [dims.width, dims.height] != size {
                continue;
            }
            if declared.is_output() && is_image(&field.element, dims, size) {
                sources.push(Source { node: node.name.clone(), port: declared.name.to_string() });
            }
        }
    }
    sources
}

/// What is written at the end. All of it was seen to be writable before the first frame.
struct Files {
    picture: Option<PortFile>,
    saves: Vec<(Source, PortFile)>,
    sheet: Option<Target>,
    json: JsonTarget,
}

impl Files {
    fn new(args: &RenderArgs) -> Result<Self, CliError> {
        let saves: Result<Vec<_>, CliError> =
            args.save.iter().map(|save| Ok((save.source.clone(), PortFile::new(&save.file)?))).collect();
        let saves = saves?;
        // Who asks for ports only may have a graph that shows no picture.
        let picture = match &args.out {
            Some(out) => Some(PortFile::picture(out)?),
            None if saves.is_empty() => Some(PortFile::picture(Path::new(PICTURE))?),
            None => None,
        };
        let plain = args.graph.is_none() && args.out.is_none() && picture.is_some();
        let sheet = args.sheet.as_deref().or(plain.then_some(Path::new(SHEET)));
        Ok(Self {
            picture,
            saves,
            sheet: sheet.map(Target::new).transpose()?,
            json: JsonTarget::new(args.json.as_deref())?,
        })
    }

    fn write(
        &self,
        executor: &mut Executor,
        output: Option<&str>,
        tiles: &[Source],
        look: &Look,
    ) -> Result<(), CliError> {
        let snapshots = executor.snapshots()?;
        let fields = |name: &str| -> Vec<_> {
            snapshots.iter().copied().filter(|snapshot| snapshot.name == name).collect()
        };
        if let (Some(picture), Some(output)) = (&self.picture, output) {
            picture.write(&fields(output), look)?;
        }
        for (source, save) in &self.saves {
            save.write(&fields(&source.to_string()), look)?;
        }
        if let Some(target) = &self.sheet {
            let tile = |source: &Source| {
                let name = source.to_string();
                let colors = fields(&name).first().map(|field| (field.dims, show(field, look).colors));
                colors.map(|(dims, colors)| Tile { label: name, size: size(dims), colors })
            };
            let tiles: Vec<Tile> = tiles.iter().filter_map(tile).collect();
            let (size, colors) = sheet::sheet(&tiles);
            let png = png(size, &colors).map_err(|error| CliError::write(target.path(), error))?;
            target.write(&png)?;
        }
        Ok(())
    }

    /// What the files are, and where.
    fn written(&self) -> Vec<(String, String)> {
        let picture = self.picture.iter().map(|picture| ("picture".to_owned(), picture.path()));
        let sheet = self.sheet.iter().map(|sheet| ("sheet".to_owned(), sheet.path()));
        let saves = self.saves.iter().map(|(source, save)| (source.to_string(), save.path()));
        picture.chain(sheet).chain(saves).map(|(what, path)| (what, path.display().to_string())).collect()
    }
}
