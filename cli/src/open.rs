//! Opens the inputs of commands: graphs with their changes, scenes with a progress display, threads.

use std::sync::Arc;

use epigraph::{Change, Place, Registry, Run, Samples, Source, graphs};
use epigraph_core::{Graph, GraphError, GraphFile};
use epigraph_scenes::{LoadOptions, Scene, Sky, Tracer};
use epigraph_stages::meaning::WHITE;

use crate::{
    args::{ChangeArgs, SceneArgs},
    error::CliError,
    progress,
};

/// Bytes of each thread's stack: those of a program's first thread, on which commands would run otherwise.
const STACK: usize = 8 << 20;

/// Names of commands, to suggest one for a mistyped word.
const COMMANDS: [&str; 11] = [
    "render",
    "check",
    "stages",
    "reference",
    "compare",
    "bench",
    "gallery",
    "quality",
    "tradeoff",
    "encode",
    "decode",
];

/// Reads a graph by its name or file, with its variant's changes and those of the options.
///
/// # Errors
/// Problems of the graph file and of changes, such as a `--set` with an unknown node. Unknown parameters and ports are
/// reported on compiling.
pub fn graph(name: &str, changes: &ChangeArgs, registry: &Registry) -> Result<GraphFile, CliError> {
    let changes: Vec<Change> = changes.all().cloned().collect();
    let file = graphs::load_with(name, &changes, registry).map_err(|mut problems| {
        for problem in &mut problems.0 {
            if let GraphError::Unknown { what: graphs::UNKNOWN, found, .. } = &problem.error {
                let known = graphs::names().chain(COMMANDS);
                problem.error = GraphError::unknown("graph, file or command", found, known);
            }
        }
        problems
    })?;
    Ok(file)
}

/// The name of a graph in tables: without the folder `graphs` and the ending, with the changes of a variant.
pub fn label(name: &str) -> String {
    let base = epigraph::split(name).map_or(name, |(base, _)| base);
    let bare = base.strip_prefix("graphs/").unwrap_or(base);
    format!("{}{}", bare.strip_suffix(".ron").unwrap_or(bare), &name[base.len()..])
}

/// Refuses a graph that fits the exposure to its picture, for commands that compare it with converged pictures.
///
/// # Errors
/// [`CliError::Input`], with the parameter to set.
pub fn require_fixed_exposure(graph: &Graph) -> Result<(), CliError> {
    match fitted(graph).next() {
        None => Ok(()),
        Some(Source { node, .. }) => Err(CliError::Input(format!(
            "{node}: its exposure is Auto, but pictures are compared at one exposure, that of the converged ones, \
             0 EV; leave it at 0, or use `render` to see the picture as it fits"
        ))),
    }
}

/// The ports with the radiance that is shown as white, of stages that find it from the picture.
pub fn fitted(graph: &Graph) -> impl Iterator<Item = Source> {
    graph.nodes.iter().flat_map(|node| {
        let ports = node.declaration().ports.iter();
        let white = ports.filter(|port| port.is_output() && port.meaning == Some(WHITE));
        white.map(|port| Source { node: node.name.clone(), port: port.name.to_string() })
    })
}

/// The maximum number of samples per frame of `size` pixels.
///
/// # Errors
/// If it is more than one per pixel.
pub fn samples(samples: Samples, size: [u32; 2]) -> Result<u32, CliError> {
    let (count, pixels) = (samples.of(size), size[0] * size[1]);
    if count > pixels {
        let text = format!("--samples {samples} is more than one per pixel; the image has {pixels} pixels");
        return Err(CliError::Input(text));
    }
    Ok(count)
}

/// Reads a scene and the camera's path through it, and tells what of its files is not in it.
pub fn place(scene: &str, camera: &str) -> Result<Place, CliError> {
    place_with(scene, camera, &LoadOptions::default())
}

/// The same for the options of a command.
pub fn place_of(args: &SceneArgs) -> Result<Place, CliError> {
    let sky = args.sky.as_deref().map(Sky::load).transpose()?.map(Arc::new);
    place_with(&args.scene, &args.camera, &LoadOptions { sky, single_sided: args.single_sided })
}

fn place_with(scene: &str, camera: &str, options: &LoadOptions) -> Result<Place, CliError> {
    let load = || Scene::load_with(scene, options);
    let loaded = progress::spinner(format!("loading scene {scene}"), load)?;
    for note in loaded.report.notes() {
        eprintln!("{scene}: {note}");
    }
    Ok(Place::new(Arc::new(loaded), camera)?)
}

/// The ray tracer of a place that has surfaces, built on first use.
///
/// # Errors
/// If the scene has only points: rays would meet nothing.
pub fn tracer_of_surfaces(place: &Place) -> Result<&Arc<Tracer>, CliError> {
    if place.scene.has_only_points() {
        let text = format!("`{}` has points and no surfaces to trace rays to", place.scene.name);
        return Err(CliError::Input(text));
    }
    Ok(tracer(place))
}

/// The ray tracer of a place, built on first use.
pub fn tracer(place: &Place) -> &Arc<Tracer> {
    progress::spinner("building the tracer".into(), || place.tracer())
}

/// Runs a command on one of the threads of the global pool, which has as many as the user wants: work that enters the pool
/// from outside, as each parallel loop would, waits for a thread to wake up, and allocates.
pub fn in_pool<T: Send>(wanted: Option<u16>, command: impl FnOnce() -> T + Send) -> Result<T, CliError> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(wanted.unwrap_or(0).into())
        .stack_size(STACK)
        .build_global()
        .map_err(|error| match wanted {
            Some(threads) => CliError::Input(format!("--threads {threads}: {error}")),
            None => CliError::Input(format!("threads: {error}")),
        })?;
    Ok(rayon::scope(|_| command()))
}

/// Warns about samples whose radiance is not finite: a fault of the scene or the tracer that is invisible in the
/// picture.
pub fn warn_of_bad_samples(count: u64) {
    if count > 0 {
        eprintln!("warning: {count} samples had a radiance that is not finite; they count as black");
    }
}

/// Warns about boundaries of shadows that were not searched for.
pub fn warn_of_missing_shadows(count: usize) {
    if count > 0 {
        eprintln!(
            "warning: the shadows of {count} edges have no boundaries, or not all: too many triangles lie in one place (are \
             there objects more than once?)"
        );
    }
}

/// Says that boundaries of shadows are left out for lack of room.
pub fn warn_of_dropped_shadows(count: usize) {
    if count > 0 {
        eprintln!(
            "warning: {count} boundaries of shadows are left out for lack of room: set a larger `capacity` of the node of kind \
             `shadow_edges`"
        );
    }
}

/// Runs `frames` frames with a progress bar. `capture` decides by a frame's number if the frame is captured; `after` is
/// called after each frame.
///
/// # Errors
/// Errors of the frames and of `after`, and [`CliError::Interrupted`].
pub fn frames(
    run: &mut Run,
    frames: u32,
    label: &str,
    capture: impl Fn(u32) -> bool,
    mut after: impl FnMut(&mut Run, u32) -> Result<(), CliError>,
) -> Result<(), CliError> {
    let bar = progress::bar(frames.into(), label, "frames");
    for index in 0..frames {
        crate::interrupt::check()?;
        run.advance(capture(index))?;
        after(run, index)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(())
}
