//! The pins of a node: its ports as the canvas shows them, where wires begin and end.

use std::borrow::Cow;

use epigraph_core::{Access, Extent, Field, GraphFile, Meaning, NodeDef, Port, Registry, Source};

/// The name in a part's wires that refers to the part's own inputs.
pub const INPUTS: &str = "inputs";

/// A place where wires end or begin.
#[derive(Clone, Debug, PartialEq)]
pub struct Pin {
    /// The port; of a node within a part, `NODE.PORT`.
    pub name: String,
    /// A sentence about it.
    pub doc: String,
    /// The declared meaning of its values, if any.
    pub meaning: Option<Meaning>,
    /// Its fields; `None` if they are known only after compiling.
    pub fields: Option<Vec<Field>>,
    /// Number of elements; `None` if it is known only after compiling.
    pub extent: Option<Extent>,
    /// True for an input that may stay unconnected.
    pub optional: bool,
    /// True for an input that reads the previous frame's value, so that it may close a cycle.
    pub history: bool,
}

impl Pin {
    /// The pin of a declared port.
    pub fn of(port: &Port) -> Self {
        Self {
            name: port.name.to_string(),
            doc: port.doc.to_string(),
            meaning: port.meaning,
            fields: Some(port.fields.clone()),
            extent: Some(port.extent.clone()),
            optional: port.optional,
            history: port.access == Access::History,
        }
    }

    /// A pin without a declaration.
    pub fn unknown(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            doc: String::new(),
            meaning: None,
            fields: None,
            extent: None,
            optional: true,
            history: false,
        }
    }

    /// A description of its elements.
    pub fn words(&self) -> Cow<'static, str> {
        match self.fields.as_deref() {
            None => "any elements".into(),
            Some([only]) => only.element.to_string().into(),
            Some(several) => format!("a bundle of {}", several.len()).into(),
        }
    }

    /// True if the elements of `output` fit, so that a wire from it may end here. A stage that updates a bundle in
    /// place need not declare all of its fields, so missing fields are accepted.
    pub fn accepts(&self, output: &Self) -> bool {
        let (Some(taken), Some(given)) = (&self.fields, &output.fields) else { return true };
        taken.iter().all(|field| match given.iter().find(|other| other.name == field.name) {
            Some(other) => field.element.accepts(&other.element),
            None => !field.name.is_empty() && given.iter().all(|other| !other.name.is_empty()),
        })
    }
}

/// The inputs and outputs of a node.
pub fn pins(file: &GraphFile, node: &NodeDef, registry: &Registry) -> [Vec<Pin>; 2] {
    let part = file.parts.iter().find(|(name, _)| *name == node.name.value);
    let mut pins = match part {
        Some((_, part)) => ends(part, registry),
        None => {
            let declared =
                registry.get(&node.kind.value).and_then(|kind| kind.declaration()).unwrap_or_default();
            let side = |takes: fn(&Port) -> bool| {
                declared.ports.iter().filter(|port| takes(port)).map(Pin::of).collect()
            };
            [side(Port::is_input), side(Port::is_output)]
        }
    };
    // Wired ports get a pin even if the stage does not declare them.
    for input in &node.inputs {
        add(&mut pins[0], &input.port.value);
    }
    let wires = file.nodes.iter().flat_map(|node| &node.inputs).map(|input| &input.from.value);
    let outputs = file.outputs.iter().map(|output| &output.from.value);
    for source in wires.chain(outputs) {
        match source.node.split_once('/') {
            _ if source.node == node.name.value => add(&mut pins[1], &source.port),
            Some((outer, inner)) if outer == node.name.value => {
                let name = format!("{inner}.{}", source.port);
                if pins[1].iter().all(|pin| pin.name != name) {
                    let at = Source { node: inner.to_owned(), port: source.port.clone() };
                    // One copy of a repeated node has the pins of all.
                    let of_copy = || {
                        let known =
                            pins[1].iter().find(|pin| node.repeat.is_some() && pin.name == source.port);
                        known.map(|pin| Pin { name: name.clone(), ..pin.clone() })
                    };
                    let pin =
                        part.and_then(|(_, part)| pin_at(part, 1, &at, &name, registry)).or_else(of_copy);
                    let pin = pin.unwrap_or_else(|| Pin::unknown(&name));
                    pins[1].push(pin);
                }
            }
            _ => {}
        }
    }
    pins
}

/// The pin of a node in the graph or in its parts, renamed to `name`.
fn pin_at(file: &GraphFile, side: usize, at: &Source, name: &str, registry: &Registry) -> Option<Pin> {
    let (node, file) = file.node_at(&at.node)?;
    let pin = pins(file, node, registry)[side].iter().find(|pin| pin.name == at.port).cloned()?;
    Some(Pin { name: name.to_owned(), ..pin })
}

/// The stage's port that an output shows, found through the outputs of parts.
pub fn output_port(file: &GraphFile, source: &Source) -> Source {
    let Some((node, copy, rest)) = file.enter(&source.node) else { return source.clone() };
    let head = &node.name.value;
    let Some((_, part)) = file.parts.iter().find(|(name, _)| name == head) else { return source.clone() };
    let head = copy.map_or(head.clone(), |copy| format!("{head}/{copy}"));
    let inner = match rest {
        Some(rest) => Some(Source { node: rest.to_owned(), port: source.port.clone() }),
        None => {
            let output = part.outputs.iter().find(|output| output.name.value == source.port);
            output.map(|output| output.from.value.clone())
        }
    };
    let Some(inner) = inner.map(|inner| output_port(part, &inner)) else { return source.clone() };
    Source { node: format!("{head}/{}", inner.node), port: inner.port }
}

fn add(pins: &mut Vec<Pin>, name: &str) {
    if pins.iter().all(|pin| pin.name != name) {
        pins.push(Pin::unknown(name));
    }
}

/// The inputs and outputs of a graph, as the pins of the node that represents it.
pub fn ends(part: &GraphFile, registry: &Registry) -> [Vec<Pin>; 2] {
    let mut inputs: Vec<Pin> = Vec::new();
    for node in &part.nodes {
        for input in node.inputs.iter().filter(|input| input.from.value.node == INPUTS) {
            let name = &input.from.value.port;
            let at = Source { node: node.name.value.clone(), port: input.port.value.clone() };
            let pin = pin_at(part, 0, &at, name, registry).unwrap_or_else(|| Pin::unknown(name));
            match inputs.iter_mut().find(|known| known.name == *name) {
                // The pin is of the current frame if any reader needs it so, and required if any reader requires it.
                Some(known) => {
                    known.history &= pin.history;
                    known.optional &= pin.optional;
                }
                None => inputs.push(pin),
            }
        }
    }
    let output = |output: &epigraph_core::OutputDef| {
        let name = &output.name.value;
        pin_at(part, 1, &output.from.value, name, registry).unwrap_or_else(|| Pin::unknown(name))
    };
    [inputs, part.outputs.iter().map(output).collect()]
}
