//! A graph that runs frame by frame.

use std::sync::Arc;

use epigraph_core::{
    Executor, Frame, Gpu, Graph, GraphError, GraphFile, Host, Plan, Problem, RunError, Settings, Snapshot,
    Source,
};
use epigraph_pictures::is_image;
use epigraph_scenes::{Camera, CameraPath};
use epigraph_stages::World;

use crate::{Error, Image, Pixel};

/// The preferred name of the output with the picture.
const PICTURE: &str = "image";

/// A graph with its memory, on a scene. It runs frame after frame along the camera path.
pub struct Run {
    file: GraphFile,
    /// The executor of the plan, for times, memory sizes, and everything else that this type does not offer itself.
    pub executor: Executor,
    host: Arc<Host>,
    path: CameraPath,
    gpu: Option<Arc<Gpu>>,
    settings: Settings,
    seed: u32,
    index: u32,
    /// The camera from the next frame on, if it has left the path.
    camera: Option<Camera>,
    /// The camera of the last frame.
    shown: Option<Camera>,
}

/// The parts of a run.
pub(crate) struct Parts {
    pub file: GraphFile,
    pub executor: Executor,
    pub host: Arc<Host>,
    pub path: CameraPath,
    pub gpu: Option<Arc<Gpu>>,
    pub settings: Settings,
    pub seed: u32,
}

impl Run {
    pub(crate) fn new(parts: Parts) -> Self {
        let Parts { file, executor, host, path, gpu, settings, seed } = parts;
        Self { file, executor, host, path, gpu, settings, seed, index: 0, camera: None, shown: None }
    }

    /// The checked graph.
    pub fn graph(&self) -> &Graph {
        self.executor.graph()
    }

    /// The execution order and memory of a frame.
    pub fn plan(&self) -> &Plan {
        self.executor.plan()
    }

    /// The settings for which the graph was compiled.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The GPU in use.
    pub fn gpu(&self) -> Option<&Arc<Gpu>> {
        self.gpu.as_ref()
    }

    /// The path that the camera follows.
    pub fn path(&self) -> &CameraPath {
        &self.path
    }

    /// The index of the next frame, which equals the number of frames that have run.
    pub fn index(&self) -> u32 {
        self.index
    }

    /// The number of samples so far whose radiance was not finite: a fault of the scene or the tracer. They count as
    /// black.
    pub fn non_finite_samples(&self) -> u64 {
        self.host.get::<World>().map_or(0, |world| world.tracer.non_finite())
    }

    /// See [`World::incomplete_shadows`].
    pub fn incomplete_shadows(&self) -> usize {
        self.host.get::<World>().map_or(0, World::incomplete_shadows)
    }

    /// See [`World::dropped_shadows`].
    pub fn dropped_shadows(&self) -> usize {
        self.host.get::<World>().map_or(0, World::dropped_shadows)
    }

    /// Leaves the path: the next frames use this camera.
    pub fn look(&mut self, camera: Camera) {
        self.camera = Some(camera);
    }

    /// The frame data that the next frame passes to the stages.
    pub fn next_frame(&self) -> Frame {
        let Settings { size, samples, .. } = self.settings;
        match &self.camera {
            Some(camera) => {
                let previous = self.shown.as_ref().unwrap_or(camera);
                World::frame(previous, camera, self.index, size, samples, self.seed)
            }
            None => World::frame_of(&self.path, self.index, size, samples, self.seed),
        }
    }

    /// Runs the next frame and captures the outputs and the kept ports.
    ///
    /// # Errors
    /// If a stage fails or panics, or if the GPU is lost.
    pub fn frame(&mut self) -> Result<(), Error> {
        self.advance(true)
    }

    /// Runs a frame made by the caller, with any view and index. Without `capture` nothing is copied.
    ///
    /// # Errors
    /// Those of [`Run::frame`].
    pub fn run(&mut self, frame: &Frame, capture: bool) -> Result<(), RunError> {
        self.executor.run(frame, &self.host, capture)?;
        self.index = frame.index.wrapping_add(1);
        Ok(())
    }

    /// Replaces the host that stages use from the next frame on, for example to change the source of samples.
    pub fn set_host(&mut self, host: Arc<Host>) {
        self.host = host;
    }

    /// Runs the next frame. Without `capture` nothing is copied, and [`Run::read`] returns the last captured frame.
    ///
    /// # Errors
    /// Those of [`Run::frame`].
    pub fn advance(&mut self, capture: bool) -> Result<(), Error> {
        let frame = self.next_frame();
        self.run(&frame, capture)?;
        self.shown = Some(self.camera.unwrap_or_else(|| self.path.camera(frame.index)));
        Ok(())
    }

    /// Runs `count` frames and captures the last one.
    ///
    /// # Errors
    /// Those of [`Run::frame`].
    pub fn frames(&mut self, count: u32) -> Result<(), Error> {
        (1..=count).try_for_each(|index| self.advance(index == count))
    }

    /// The contents of an output or a kept port (`node.port`, or `node.port.field` for a bundle) in the last captured
    /// frame. Floats of any width are read as f32.
    ///
    /// # Errors
    /// If the port was not kept, or holds elements of another type.
    pub fn read<T: Pixel>(&mut self, port: &str) -> Result<Image<T>, Error> {
        Image::of(self.snapshot(port)?)
    }

    /// Like [`Run::read`], but as raw bytes with their type.
    ///
    /// # Errors
    /// If the port was not kept, or if the GPU is lost.
    pub fn snapshot(&mut self, port: &str) -> Result<&Snapshot, Error> {
        let (head, last) = port.rsplit_once('.').unwrap_or((port, ""));
        let snapshots = self.executor.snapshots()?;
        let is =
            |snapshot: &&Snapshot, name: &str, field: &str| snapshot.name == name && snapshot.field == field;
        let found = snapshots.iter().position(|snapshot| is(snapshot, port, ""));
        let found = found.or_else(|| snapshots.iter().position(|snapshot| is(snapshot, head, last)));
        match found {
            Some(found) => Ok(snapshots[found]),
            None => {
                let known = snapshots.iter().map(|snapshot| match snapshot.field.as_str() {
                    "" => snapshot.name.clone(),
                    field => format!("{}.{field}", snapshot.name),
                });
                let known = known.collect::<Vec<_>>();
                let nearest = match GraphError::unknown("port", port, &known) {
                    GraphError::Unknown { nearest, .. } if !nearest.is_empty() => {
                        format!(", did you mean `{}`?", nearest[0])
                    }
                    _ => "; name it in keep(..) before start().".into(),
                };
                let known = known.join(", ");
                Err(Error::Input(format!("`{port}` is not kept{nearest} Kept are {known}")))
            }
        }
    }

    /// The name of the output with the picture: `image` if there is one, else the first output.
    ///
    /// # Errors
    /// If the output does not have the shape of an image.
    pub fn picture(&self) -> Result<String, Error> {
        picture(&self.file, self.graph(), self.settings.size)
    }
}

/// See [`Run::picture`].
pub(crate) fn picture(file: &GraphFile, graph: &Graph, size: [u32; 2]) -> Result<String, Error> {
    let outputs = &graph.outputs;
    let chosen = outputs.iter().find(|(name, _)| name == PICTURE).or(outputs.first());
    // A graph without outputs does not compile.
    let Some((name, at)) = chosen else { return Err(Error::Input("the graph has no output".into())) };
    let port = &graph.nodes[at.node].declaration().ports[at.port];
    let dims = graph.nodes[at.node].dims[at.port];
    let is_image = port.fields.len() == 1 && is_image(&port.fields[0].element, dims, size);
    if is_image {
        return Ok(name.clone());
    }
    let source = graph.name(*at);
    let text = format!(
        "the output `{name}` is not an image: it has {dims} elements of `{source}` ({}); name an image as output, or save \
         the list: epigraph render --save {source}=FILE.csv",
        port.extent
    );
    let problem = Problem::new(GraphError::Invalid(text));
    // The graph has compiled, so its changes fit.
    let whole = file.whole()?;
    let written = whole.outputs.iter().find(|output| output.name.value == *name);
    Err(written.map_or(problem.clone(), |output| problem.at(whole.place(output.from.span))).into())
}

/// Parses `node.port`.
pub(crate) fn source(name: &str) -> Source {
    name.parse().unwrap_or_else(|_| panic!("`{name}` is not of the form node.port"))
}
