//! The blocks and wires of a graph or part, as the canvas shows them. The model is a projection of the document,
//! rebuilt whenever the document changes; it holds no positions.

use epigraph_core::{Difference, GraphFile, Port, Registry, Source, handed};

use crate::document::{
    INPUTS, Pin, ends,
    nodes::{join, scope, split, within},
    pins,
    places::{INPUTS_BOX, OUTPUTS_BOX},
};
use crate::engine::GraphInfo;

/// The role of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A node with a stage.
    Stage,
    /// A node that is a graph of its own.
    Part,
    /// The inputs of the part.
    Inputs,
    /// The outputs of the graph or part.
    Outputs,
}

/// A box on the canvas.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// The node's address in the whole graph.
    pub address: String,
    /// Its name in its file.
    pub name: String,
    /// Its stage kind.
    pub kind: String,
    /// Its purpose, one line.
    pub doc: String,
    /// Its role.
    pub role: Role,
    /// True if the file bypasses it: its input is passed through as its output.
    pub bypass: bool,
    /// How often it is repeated in a row, as text; all copies are one block.
    pub times: Option<String>,
    /// Where wires end.
    pub inputs: Vec<Pin>,
    /// Where wires begin.
    pub outputs: Vec<Pin>,
    /// What the graph changes here in its base, in words.
    pub changes: Vec<String>,
}

impl Block {
    /// True if it is a node, which can be edited; false for the blocks of inputs and outputs.
    pub fn is_node(&self) -> bool {
        matches!(self.role, Role::Stage | Role::Part)
    }

    /// Its name in the whole graph.
    pub fn label(&self) -> String {
        if self.is_node() { self.address.clone() } else { join(split(&self.address).0, &self.name) }
    }

    /// The pins of one side.
    pub fn pins(&self, output: bool) -> &[Pin] {
        if output { &self.outputs } else { &self.inputs }
    }
}

/// A pin of the model, by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PinRef {
    /// Index in [`Model::blocks`].
    pub block: usize,
    /// True for an output, where wires begin.
    pub output: bool,
    /// Index in the block's outputs or inputs.
    pub pin: usize,
}

/// A wire from an output to an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wire {
    /// Where it begins.
    pub from: PinRef,
    /// Where it ends.
    pub to: PinRef,
    /// True if it carries the last frame's value.
    pub history: bool,
}

/// Blocks and wires.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The address of the part that is shown; empty for the graph itself.
    pub part: String,
    /// Nodes in the order of the file, with the blocks of inputs and outputs at the ends.
    pub blocks: Vec<Block>,
    /// Wires in the order of the file.
    pub wires: Vec<Wire>,
}

impl Model {
    /// The graph itself if `part` is empty, or the part of that address; `None` if there is no such part. Ports that
    /// are known only after compilation are taken from the running graph.
    pub fn new(file: &GraphFile, part: &str, registry: &Registry, graph: Option<&GraphInfo>) -> Option<Self> {
        let within = scope(file, part)?;
        let [inputs, outputs] = ends(within, registry);
        let around = |name: &str, title: &str, role, inputs, outputs| Block {
            address: join(part, name),
            name: title.into(),
            kind: String::new(),
            doc: match role {
                Role::Inputs => "The inputs of this part, wired by the outer graph.".into(),
                _ => "The outputs of this graph.".into(),
            },
            role,
            bypass: false,
            times: None,
            inputs,
            outputs,
            changes: Vec::new(),
        };
        let mut blocks = Vec::new();
        if !inputs.is_empty() {
            blocks.push(around(INPUTS_BOX, "inputs", Role::Inputs, Vec::new(), inputs));
        }
        for node in &within.nodes {
            let mut sides = pins(within, node, registry);
            let running = graph.and_then(|graph| graph.node(&join(part, &node.name.value)));
            for (pins, is_such) in
                sides.iter_mut().zip([Port::is_input as fn(&Port) -> bool, Port::is_output])
            {
                let ports = running.into_iter().flat_map(|node| &node.ports).map(|info| &info.port);
                learn(pins, ports.filter(|port| is_such(port)));
            }
            let [inputs, outputs] = sides;
            let inner = within.parts.iter().find(|(name, _)| *name == node.name.value);
            let kind = registry.get(&node.kind.value);
            blocks.push(Block {
                address: join(part, &node.name.value),
                name: node.name.value.clone(),
                kind: node.kind.value.clone(),
                doc: inner
                    .map_or_else(|| kind.map_or("", |kind| kind.doc()).into(), |(_, part)| part.doc.clone()),
                role: if inner.is_some() { Role::Part } else { Role::Stage },
                bypass: node.bypass,
                times: node.repeat.as_ref().map(|repeat| times(within, part, &repeat.times.value, graph)),
                inputs,
                outputs,
                changes: Vec::new(),
            });
        }
        if !outputs.is_empty() {
            blocks.push(around(OUTPUTS_BOX, "outputs", Role::Outputs, outputs, Vec::new()));
        }
        let mut model = Self { part: part.into(), blocks, wires: Vec::new() };
        for node in &within.nodes {
            for input in &node.inputs {
                model.join(&input.from.value, &join(part, &node.name.value), &input.port.value);
            }
        }
        for output in &within.outputs {
            model.join(&output.from.value, &join(part, OUTPUTS_BOX), &output.name.value);
        }
        Some(model)
    }

    /// Marks the blocks that differ from the base.
    pub fn mark(&mut self, differences: &[Difference]) {
        for found in differences {
            let place = if found.node == "outputs" { OUTPUTS_BOX } else { &found.node };
            for block in &mut self.blocks {
                let Some(inner) = within(place, &block.address) else { continue };
                block.changes.push(match inner.trim_start_matches('/') {
                    "" => found.what.to_string(),
                    inner => format!("{inner}: {}", found.what),
                });
            }
        }
    }

    fn join(&mut self, from: &Source, to: &str, port: &str) {
        let source = (0..self.blocks.len()).find_map(|block| {
            let pins = 0..self.blocks[block].outputs.len();
            let pin =
                pins.map(|pin| PinRef { block, output: true, pin }).find(|pin| self.source(*pin) == *from);
            pin.filter(|_| self.blocks[block].role != Role::Outputs)
        });
        let target = self.pin(to, false, port);
        if let (Some(from), Some(to)) = (source, target) {
            let history = self.at(to).history;
            self.wires.push(Wire { from, to, history });
        }
    }

    /// The block of that address.
    pub fn block(&self, address: &str) -> Option<usize> {
        self.blocks.iter().position(|block| block.address == address)
    }

    /// The pin of that name.
    pub fn pin(&self, address: &str, output: bool, name: &str) -> Option<PinRef> {
        let block = self.block(address)?;
        let pin = self.blocks[block].pins(output).iter().position(|pin| pin.name == name)?;
        Some(PinRef { block, output, pin })
    }

    /// The information on a pin.
    pub fn at(&self, at: PinRef) -> &Pin {
        &self.blocks[at.block].pins(at.output)[at.pin]
    }

    /// The source of a wire from this output, as the file names it.
    pub fn source(&self, at: PinRef) -> Source {
        let (block, pin) = (&self.blocks[at.block], self.at(at));
        if block.role == Role::Inputs {
            return Source { node: INPUTS.into(), port: pin.name.clone() };
        }
        // The pin of a node within a part is named `NODE.PORT`.
        match pin.name.rsplit_once('.') {
            Some((inner, port)) => Source { node: format!("{}/{inner}", block.name), port: port.into() },
            None => Source { node: block.name.clone(), port: pin.name.clone() },
        }
    }

    /// The label of a pin: `node.port`.
    pub fn name(&self, at: PinRef) -> String {
        format!("{}.{}", self.blocks[at.block].name, self.at(at).name)
    }

    /// The wire into an input.
    pub fn wire_to(&self, to: PinRef) -> Option<&Wire> {
        self.wires.iter().find(|wire| wire.to == to)
    }

    /// The reason why a wire cannot connect two pins, as text; `None` if it can.
    pub fn refusal(&self, a: PinRef, b: PinRef) -> Option<String> {
        let (from, to) = match (a.output, b.output) {
            (true, false) => (a, b),
            (false, true) => (b, a),
            (true, true) => return Some("a wire ends at an input, and both are outputs".into()),
            (false, false) => return Some("a wire begins at an output, and both are inputs".into()),
        };
        let (output, input) = (self.at(from), self.at(to));
        (!input.accepts(output)).then(|| {
            let (given, taken) = (output.words(), input.words());
            format!("{} writes {given}, but {} reads {taken}", self.name(from), self.name(to))
        })
    }

    /// The blocks that are connected to a block by a wire, in either direction.
    pub fn neighbours(&self, block: usize) -> impl Iterator<Item = usize> {
        self.wires.iter().filter_map(move |wire| match (wire.from.block, wire.to.block) {
            (from, to) if from == block => Some(to),
            (from, to) if to == block => Some(from),
            _ => None,
        })
    }
}

/// The number of copies of a repeated node, as text: that of the running graph if it is a parameter of the graph.
fn times(within: &GraphFile, part: &str, text: &str, graph: Option<&GraphInfo>) -> String {
    let Some(name) = handed(text) else { return text.to_owned() };
    let running = graph.and_then(|graph| graph.value(part, &name));
    let declared = || within.param(&name).map(|param| &param.default.value);
    running.or_else(declared).map_or_else(|| text.to_owned(), Clone::clone)
}

/// Completes the pins of a node from its compiled ports, if its kind declares none.
fn learn<'p>(pins: &mut Vec<Pin>, ports: impl Iterator<Item = &'p Port>) {
    if pins.iter().any(|pin| pin.fields.is_some()) {
        return;
    }
    for port in ports {
        match pins.iter_mut().find(|pin| pin.name == port.name) {
            Some(pin) => *pin = Pin::of(port),
            None => pins.push(Pin::of(port)),
        }
    }
}
