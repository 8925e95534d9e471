//! A graph that runs frame by frame.

use std::sync::Arc;

use epigraph_core::{
    Executor, Frame, Gpu, Graph, GraphError, GraphFile, Host, Plan, Problem, RunError, Settings, Snapshot,
    Source,
};
use epigraph_pictures::is_image;
use epigraph_scenes::{Camera, CameraPath, predict};
use epigraph_stages::{World, shared::world::PREDICTION_FRAMES};

use crate::{Error, Image, Pixel};

/// The output that is the picture, where there is one of that name.
const PICTURE: &str = "image";

/// A graph with its memory, on a scene: runs frame after frame along the camera's path.
pub struct Run {
    file: GraphFile,
    /// What runs the plan: times, bytes, and everything that this type does not offer itself.
    pub executor: Executor,
    host: Arc<Host>,
    path: CameraPath,
    gpu: Option<Arc<Gpu>>,
    settings: Settings,
    seed: u32,
    index: u32,
    /// The camera from the next frame on, where it has left the path.
    camera: Option<Camera>,
    /// The camera of the last frame.
    shown: Option<Camera>,
}

/// What a run is made of.
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

    /// What a frame does, in order, and with which memory.
    pub fn plan(&self) -> &Plan {
        self.executor.plan()
    }

    /// What it was compiled for.
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

    /// The number of the next frame; as many have run.
    pub fn index(&self) -> u32 {
        self.index
    }

    /// How many samples had a radiance that is not finite so far. They count as black; the scene or the tracer is at fault.
    pub fn non_finite_samples(&self) -> u64 {
        self.host.get::<World>().map_or(0, |world| world.tracer.non_finite())
    }

    /// Leaves the path: the camera looks from here from the next frame on.
    pub fn look(&mut self, camera: Camera) {
        self.camera = Some(camera);
    }

    /// What the stages get of the next frame.
    pub fn next_frame(&self) -> Frame {
        let Settings { size, samples, .. } = self.settings;
        match &self.camera {
            Some(camera) => {
                Self::live_frame(self.shown.as_ref(), camera, self.index, size, samples, self.seed)
            }
            None => World::frame(&self.path, self.index, size, samples, self.seed),
        }
    }

    /// Frame `index` of a camera that somebody moves by hand: from `shown` in the frame before, if there was one.
    pub fn live_frame(
        shown: Option<&Camera>,
        camera: &Camera,
        index: u32,
        size: [u32; 2],
        samples: u32,
        seed: u32,
    ) -> Frame {
        let previous = shown.unwrap_or(camera);
        Frame {
            view: World::view(camera, size),
            previous: World::view(previous, size),
            predicted: World::view(&predict(previous, camera, PREDICTION_FRAMES), size),
            size,
            index,
            seed,
            samples,
            ..Frame::default()
        }
    }

    /// Runs the next frame and captures the outputs and the kept ports.
    ///
    /// # Errors
    /// A stage that fails or panics, a GPU that is lost.
    pub fn frame(&mut self) -> Result<(), Error> {
        self.advance(true)
    }

    /// Runs a frame of the caller's own, of whatever view and number. Without `capture` nothing is copied.
    ///
    /// # Errors
    /// As [`Run::frame`].
    pub fn run(&mut self, frame: &Frame, capture: bool) -> Result<(), RunError> {
        self.executor.run(frame, &self.host, capture)?;
        self.index = frame.index.wrapping_add(1);
        Ok(())
    }

    /// Gives the stages another host from the next frame on, for instance with another source of samples.
    pub fn set_host(&mut self, host: Arc<Host>) {
        self.host = host;
    }

    /// Runs the next frame. Without `capture` nothing is copied: [`Run::read`] gives what was captured last.
    ///
    /// # Errors
    /// As [`Run::frame`].
    pub fn advance(&mut self, capture: bool) -> Result<(), Error> {
        let frame = self.next_frame();
        self.run(&frame, capture)?;
        self.shown = Some(self.camera.unwrap_or_else(|| self.path.camera(frame.index)));
        Ok(())
    }

    /// Runs `count` frames and captures the last one.
    ///
    /// # Errors
    /// As [`Run::frame`].
    pub fn frames(&mut self, count: u32) -> Result<(), Error> {
        (1..=count).try_for_each(|index| self.advance(index == count))
    }

    /// The contents of an output or a kept port (`node.port`, or `node.port.field` of a bundle), as of the last captured
    /// frame. Floats of any width are read as f32.
    ///
    /// # Errors
    /// That it was not kept, or holds elements of another type.
    pub fn read<T: Pixel>(&mut self, port: &str) -> Result<Image<T>, Error> {
        Image::of(self.snapshot(port)?)
    }

    /// As [`Run::read`], as it lies in memory.
    ///
    /// # Errors
    /// That it was not kept; that the GPU is lost.
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
                let known = known.collect::<Vec<_>>().join(", ");
                Err(Error::Input(format!(
                    "`{port}` is not kept; name it in keep(..) before start(). There are {known}"
                )))
            }
        }
    }

    /// The output that is the picture: the one called `image`, else the first. Its name.
    ///
    /// # Errors
    /// That it does not have the shape of an image.
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
        "the output `{name}` is no image but {dims} elements of `{source}` ({}); name an image as output, or save the \
         list: epigraph render --save {source}=FILE.csv",
        port.extent
    );
    let problem = Problem::new(GraphError::Invalid(text));
    let written = file.outputs.iter().find(|output| output.name.value == *name);
    Err(written.map_or(problem.clone(), |output| problem.at(file.place(output.from.span))).into())
}

/// `node.port`.
pub(crate) fn source(name: &str) -> Source {
    name.parse().unwrap_or_else(|_| panic!("`{name}` is not of the form node.port"))
}
