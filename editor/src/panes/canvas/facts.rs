//! Information from the engine about blocks: their cost, side, and why they do not run.

use epigraph_core::{Download, Element, Field, GraphFile, PerSide, Side, Source};
use epigraph_pictures::{Mode, readable};

use super::model::{Block, Model, PinRef, Role};
use crate::{
    document::{INPUTS, nodes, output_port},
    engine::{GraphInfo, PortInfo, Transfer},
};

/// The engine's information about a block.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Milliseconds of the node, or of all nodes in the part.
    pub ms: Option<f32>,
    /// Bytes that it writes.
    pub bytes: u64,
    /// For each side, true if any of the nodes runs there.
    pub sides: PerSide<bool>,
    /// Number of its nodes that run, and number of those left out.
    pub nodes: [usize; 2],
    /// Why it does not run.
    pub why: Option<String>,
    /// Bytes that its nodes that are left out would write in a frame.
    pub saved: u64,
    /// The image of its thumbnail.
    pub picture: Option<PictureOf>,
}

/// The image of a block's thumbnail.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureOf {
    /// The port, `node.port`.
    pub port: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

impl Facts {
    /// Collects the information. `file` is the whole graph, `times` are milliseconds of the graph's steps.
    pub fn new(block: &Block, model: &Model, file: &GraphFile, graph: &GraphInfo, times: &[f32]) -> Self {
        if !block.is_node() {
            return Self::default();
        }
        let is_in = |address: &str| contains(&block.address, address);
        let mut facts = Self::default();
        for (step, ms) in graph.steps.iter().zip(times) {
            if step.node.as_deref().is_some_and(is_in) {
                facts.ms = Some(facts.ms.unwrap_or(0.0) + ms);
            }
        }
        for node in graph.nodes.iter().filter(|node| is_in(&node.name)) {
            facts.bytes += node.bytes;
            facts.sides[node.side] = true;
            facts.nodes[0] += 1;
        }
        let left_out: Vec<_> = graph.left_out.iter().filter(|node| is_in(&node.name)).collect();
        facts.nodes[1] = left_out.len();
        facts.saved = left_out.iter().filter_map(|node| node.bytes).sum();
        if facts.nodes[0] == 0 {
            facts.why = left_out.first().map(|node| node.why.clone());
        }
        facts.picture = picture(block, model, file, graph);
        facts
    }

    /// The line below the block's name.
    pub fn info(&self, block: &Block) -> String {
        let mut words = Vec::new();
        if let Some(times) = &block.times {
            words.push(format!("{times} in a row"));
        }
        match block.role {
            Role::Part => {
                let nodes = self.nodes[0] + self.nodes[1];
                words.push(format!("part of {nodes} nodes"));
            }
            Role::Stage if block.kind != block.name => words.push(block.kind.clone()),
            Role::Stage => {}
            Role::Inputs | Role::Outputs if block.address.contains('/') => return "of the part".into(),
            Role::Inputs | Role::Outputs => return "of the graph".into(),
        }
        match self.sides {
            PerSide { cpu: true, gpu: false } => words.push("CPU".into()),
            PerSide { cpu: false, gpu: true } => words.push("GPU".into()),
            PerSide { cpu: true, gpu: true } => words.push("CPU + GPU".into()),
            PerSide { cpu: false, gpu: false } => {}
        }
        if self.bytes > 0 {
            words.push(readable(self.bytes));
        }
        words.join(" · ")
    }
}

/// True if the node is the block itself, or in it.
pub fn contains(block: &str, node: &str) -> bool {
    nodes::within(node, block).is_some()
}

/// The first texture that a block writes, or else its first list of one element per pixel. Ids are the last choice, as
/// their colours mean little.
fn picture(block: &Block, model: &Model, file: &GraphFile, graph: &GraphInfo) -> Option<PictureOf> {
    let index = model.block(&block.address)?;
    let outputs = (0..block.outputs.len()).filter_map(|pin| {
        let source = origin(file, &model.part, &model.source(PinRef { block: index, output: true, pin }))?;
        let info = port(graph, &source.node, &source.port)?;
        let size = [info.dims.width, info.dims.height];
        let [Field { element, .. }] = &info.port.fields[..] else { return None };
        let texture = matches!(element, Element::Texel(_));
        let rank = match Mode::of_port(info.port.meaning, element) {
            Mode::Names => 2,
            _ if !texture => 1,
            _ => 0,
        };
        let whole = texture || (info.is_image(graph.size) && size == graph.size);
        whole.then(|| (rank, PictureOf { port: source.to_string(), size }))
    });
    outputs.min_by_key(|(rank, _)| *rank).map(|(_, picture)| picture)
}

fn port<'g>(graph: &'g GraphInfo, node: &str, port: &str) -> Option<&'g PortInfo> {
    graph.node(node)?.ports.iter().find(|info| info.port.name == port)
}

/// The source of a wire in a part, as a stage's port with its address in the whole graph; `None` if the part has no
/// such input.
fn origin(file: &GraphFile, part: &str, source: &Source) -> Option<Source> {
    if source.node == INPUTS && !part.is_empty() {
        let (outer, name) = nodes::split(part);
        let node = nodes::scope(file, outer)?.node(name)?;
        let input = node.inputs.iter().find(|input| input.port.value == source.port)?;
        return origin(file, outer, &input.from.value);
    }
    let found = output_port(nodes::scope(file, part)?, source);
    Some(Source { node: nodes::join(part, &found.node), port: found.port })
}

/// A value that crosses between the sides on a wire.
#[derive(Clone, Debug, PartialEq)]
pub struct Crossing {
    /// Index of the wire in the model: the first of those that carry it.
    pub wire: usize,
    /// The receiving side.
    pub to: Side,
    /// How a download waits.
    pub download: Option<Download>,
    /// Bytes.
    pub bytes: u64,
    /// Milliseconds.
    pub ms: f32,
}

impl Crossing {
    /// All transfers of the model: one for each output and direction, even if several wires carry it.
    pub fn all(model: &Model, file: &GraphFile, graph: &GraphInfo, times: &[f32]) -> Vec<Self> {
        let mut found: Vec<Self> = Vec::new();
        for (step, ms) in graph.steps.iter().zip(times) {
            let Some(transfer) = &step.transfer else { continue };
            let carries = |wire: &super::model::Wire| is_on(wire, transfer, model, file, graph);
            let Some(wire) = model.wires.iter().position(carries) else { continue };
            let from = model.wires[wire].from;
            match found.iter_mut().find(|one| model.wires[one.wire].from == from && one.to == step.side) {
                Some(one) => {
                    one.bytes += transfer.bytes;
                    one.ms += ms;
                }
                None => found.push(Self {
                    wire,
                    to: step.side,
                    download: transfer.download,
                    bytes: transfer.bytes,
                    ms: *ms,
                }),
            }
        }
        found
    }

    /// `upload` or `download`.
    pub fn verb(&self) -> &'static str {
        if self.to == Side::Gpu { "upload" } else { "download" }
    }

    /// When its readers get the value, as text.
    pub fn waits(&self) -> String {
        match self.download {
            None => "before its first reader runs".into(),
            Some(Download::Sync) => "the frame waits for it".into(),
            Some(Download::Latent(1)) => "1 frame late, without waiting".into(),
            Some(Download::Latent(frames)) => format!("{frames} frames late, without waiting"),
        }
    }
}

/// True if a transfer starts at the wire's source and serves its end.
fn is_on(
    wire: &super::model::Wire,
    transfer: &Transfer,
    model: &Model,
    file: &GraphFile,
    graph: &GraphInfo,
) -> bool {
    let target = &model.blocks[wire.to.block];
    let Some(origin) = origin(file, &model.part, &model.source(wire.from)) else { return false };
    // What leaves a repeated node is its last copy's.
    let node = graph.node(&origin.node).map_or(&origin.node, |node| &node.name);
    let origin = format!("{node}.{}", origin.port);
    transfer.to.iter().filter_map(|to| to.rsplit_once('.')).any(|(node, name)| {
        let ends_here =
            contains(&target.address, node) && (target.role == Role::Part || name == model.at(wire.to).name);
        ends_here && port(graph, node, name).is_some_and(|info| info.source.as_deref() == Some(&origin))
    })
}
