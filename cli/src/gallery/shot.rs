//! Runs a graph and captures its last frame: the picture, and the data for the drawings of the edge-and-point image.
//!
//! The data is found by what ports mean, so names do not matter.

use std::sync::Arc;

use epigraph::{Device, Place, Registry, Run, Samples, Setup, graphs::Shipped};
use epigraph_core::{Graph, GraphFile, Meaning, Node, NodeId, Port, PortRef, Snapshot, Source};
use epigraph_pictures::{Look, Picture, show, size, tone};
use epigraph_stages::{
    meaning::{CLASS, CROSSINGS, ID, POINTS, PRIORITY, REACH, SHADOWS},
    shared::cloud::{NO_POINT, decode_radiance},
};

use crate::{args::GalleryArgs, error::CliError, open};

/// The graph's output with the picture.
const IMAGE: &str = "image";

/// The added node that rasterises the edges without those of shadows.
const OUTLINES: &str = "gallery outlines";

/// A picture.
pub struct Shot {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// sRGB, rows from the top.
    pub colors: Vec<[u8; 3]>,
}

impl Shot {
    /// The picture in a form that can be compared.
    pub fn picture(&self) -> Picture {
        Picture::shown(self.size, &self.colors)
    }
}

/// The intermediate images of an edge-and-point image, row by row.
pub struct Layers {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// The sRGB colour of each pixel's point, or `None` for a pixel without one.
    pub points: Vec<Option<[u8; 3]>>,
    /// Crossings with the left and the top side of each pixel. It has one more column and row than the image.
    pub mask: Vec<u32>,
    /// The same without shadow boundaries.
    pub outlines: Vec<u32>,
    /// Class and regions, see `algorithms.md` section 2.4.
    pub cls: Vec<u32>,
    /// Reachability of the 5x5 neighbourhood, section 2.5.
    pub r24: Vec<u32>,
    /// Priority of a new sample, 0 to 255.
    pub priority: Vec<u32>,
}

/// A picture with its intermediate images.
pub struct Dissected {
    /// The picture.
    pub shot: Shot,
    /// Its intermediate images.
    pub layers: Layers,
}

/// The setup in which graphs run on a scene.
pub struct Camera<'a> {
    /// Label of the progress bar.
    pub label: &'a str,
    /// The stages.
    pub registry: &'a Arc<Registry>,
    /// The default device of nodes.
    pub device: &'a Device,
    /// The scene and the camera's path.
    pub place: &'a Place,
    /// The command line.
    pub args: &'a GalleryArgs,
    /// Maximum number of samples per frame.
    pub samples: u32,
}

impl Camera<'_> {
    /// Renders the last frame of a graph.
    ///
    /// # Errors
    /// Problems of the graph for this scene, and stages that fail.
    pub fn shoot(&self, file: &GraphFile) -> Result<Shot, CliError> {
        let mut run = self.setup(file).start()?;
        self.run(&mut run, file)
    }

    /// Renders the last frame of a graph that interpolates between edges, with its intermediate images.
    ///
    /// # Errors
    /// Those of [`Camera::shoot`], and a missing stage.
    pub fn dissect(&self, file: &GraphFile) -> Result<Dissected, CliError> {
        let compiled = self.setup(file).compile()?;
        let graph = compiled.graph();
        let ports = Ports::find(graph, &file.name())?;
        let file = &with_outlines(file, graph, ports.raster)?;
        let mut compiled = self.setup(file).compile()?;
        compiled.keep(&ports.all())?;
        let mut run = compiled.start()?;
        let shot = self.run(&mut run, file)?;
        let layers = ports.read(&run.executor.snapshots()?, shot.size);
        Ok(Dissected { shot, layers })
    }

    /// Checks that a graph compiles for the scene, and that its exposure is fixed.
    ///
    /// # Errors
    /// Problems of the graph for this scene, and an exposure that fits the picture.
    pub fn check(&self, file: &GraphFile) -> Result<(), CliError> {
        open::require_fixed_exposure(self.setup(file).compile()?.graph())
    }

    fn setup(&self, file: &GraphFile) -> Setup {
        Setup::new(file.clone())
            .registry(self.registry.clone())
            .at(self.place)
            .device(self.device)
            .size(self.args.size.0)
            .samples(Samples::Count(self.samples))
            .seed(self.args.seed)
    }

    /// Runs all frames and returns the picture of the last one.
    fn run(&self, run: &mut Run, file: &GraphFile) -> Result<Shot, CliError> {
        let frames = self.args.frames;
        let label = format!("{}, {}", self.label, file.name());
        open::frames(run, frames, &label, |index| index + 1 == frames, |_, _| Ok(()))?;
        let look = Look { far: run.path().camera(frames - 1).far, ..Look::default() };
        let image = run.executor.snapshot(IMAGE, "")?;
        let image = image.ok_or_else(|| lacks(&file.name(), &format!("output `{IMAGE}`")))?;
        Ok(Shot { size: size(image.dims), colors: show(image, &look).colors })
    }
}

/// The error that a graph lacks something to draw.
fn lacks(graph: &str, what: &str) -> CliError {
    CliError::Input(format!("{graph} has no {what}, which the gallery shows"))
}

/// The ports of the intermediate images.
struct Ports {
    /// The node that draws edges.
    raster: NodeId,
    cloud: Source,
    id: Source,
    cls: Source,
    r24: Source,
    mask: Source,
    outlines: Source,
    priority: Source,
}

impl Ports {
    fn find(graph: &Graph, path: &str) -> Result<Self, CliError> {
        let lacks = |what| lacks(path, what);
        let interpolate = |node: &&Node| {
            [POINTS, ID, CLASS, REACH].iter().all(|meaning| input(node, *meaning).is_some())
                && output(node, PRIORITY).is_some()
        };
        let interpolate =
            graph.nodes.iter().find(interpolate).ok_or_else(|| lacks("interpolation within edges"))?;
        let read = |node: &Node, meaning: Meaning| input(node, meaning).ok_or_else(|| lacks(meaning.name));
        let r24 = read(interpolate, REACH)?;
        let mask = read(&graph.nodes[graph.root(r24).node], CROSSINGS)?;
        let written = |name: &str, node: &Node, meaning: Meaning| {
            let port = output(node, meaning).ok_or_else(|| lacks(meaning.name))?;
            Ok::<_, CliError>(Source { node: name.to_owned(), port: port.name.to_string() })
        };
        Ok(Self {
            raster: mask.node,
            cloud: source(graph, read(interpolate, POINTS)?),
            id: source(graph, read(interpolate, ID)?),
            cls: source(graph, read(interpolate, CLASS)?),
            r24: source(graph, r24),
            mask: source(graph, mask),
            outlines: written(OUTLINES, &graph.nodes[mask.node], CROSSINGS)?,
            priority: written(&interpolate.name, interpolate, PRIORITY)?,
        })
    }

    fn all(&self) -> Vec<Source> {
        let ports = [&self.cloud, &self.id, &self.cls, &self.r24, &self.mask, &self.outlines, &self.priority];
        ports.map(Clone::clone).into()
    }

    fn read(&self, snapshots: &[&Snapshot], size: [usize; 2]) -> Layers {
        let words = |port: &Source, field: &str| -> Vec<u32> {
            let name = port.to_string();
            let found = snapshots.iter().find(|snapshot| snapshot.name == name && snapshot.field == field);
            found.map(|snapshot| snapshot.get()).unwrap_or_default()
        };
        let radiance = words(&self.cloud, "radiance");
        let color = |id: u32| {
            let bits = (id != NO_POINT).then(|| radiance.get(id as usize)).flatten();
            bits.map(|&bits| tone::to_srgb8(decode_radiance(bits)))
        };
        Layers {
            size,
            points: words(&self.id, "").into_iter().map(color).collect(),
            mask: words(&self.mask, ""),
            outlines: words(&self.outlines, ""),
            cls: words(&self.cls, ""),
            r24: words(&self.r24, ""),
            priority: words(&self.priority, ""),
        }
    }
}

/// Where an input of that meaning takes its values from.
fn input(node: &Node, meaning: Meaning) -> Option<PortRef> {
    let mut inputs = node.declaration().ports.iter().zip(&node.sources).filter(|(port, _)| port.is_input());
    inputs.find_map(|(port, from)| from.filter(|_| port.meaning == Some(meaning)))
}

/// An output of that meaning.
fn output(node: &Node, meaning: Meaning) -> Option<&Port> {
    node.declaration().ports.iter().find(|port| port.is_output() && port.meaning == Some(meaning))
}

fn source(graph: &Graph, at: PortRef) -> Source {
    let node = &graph.nodes[at.node];
    Source { node: node.name.clone(), port: node.declaration().ports[at.port].name.to_string() }
}

/// The graph with a second edge raster that omits shadows, to distinguish both kinds of edges.
fn with_outlines(file: &GraphFile, graph: &Graph, raster: NodeId) -> Result<GraphFile, CliError> {
    let raster = &graph.nodes[raster];
    let shadows = input(raster, SHADOWS).map(|from| from.node);
    let inputs = raster.declaration().ports.iter().zip(&raster.sources).filter_map(|(port, from)| {
        let from = from.filter(|from| Some(from.node) != shadows)?;
        Some(format!("{:?}: {:?}", port.name, source(graph, from).to_string()))
    });
    let inputs: Vec<String> = inputs.collect();
    let params = raster.params.iter().map(|(param, value)| format!("{param}: {value}"));
    let params: Vec<String> = params.collect();
    let fields = format!(
        "nodes: {{ {OUTLINES:?}: (kind: {:?}, inputs: {{ {} }}, params: ({})) }}",
        raster.kind,
        inputs.join(", "),
        params.join(", ")
    );
    Ok(file.changed("the gallery's outlines", &fields, &Shipped)?)
}
