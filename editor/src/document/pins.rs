//! A node's pins: what wires may end and begin there.

use std::borrow::Cow;

use epigraph_core::{Field, GraphFile, NodeDef, Port, Registry, Source};

/// The node of a part that stands for what the part is given.
const INPUTS: &str = "inputs";

/// A place where wires end or begin.
#[derive(Clone, Debug, PartialEq)]
pub struct Pin {
    /// The port.
    pub name: String,
    /// One sentence.
    pub doc: String,
    /// Its fields; none where only compiling tells.
    pub fields: Option<Vec<Field>>,
    /// Whether an input may stay without a wire.
    pub optional: bool,
}

impl Pin {
    fn of(port: &Port) -> Self {
        Self {
            name: port.name.to_string(),
            doc: port.doc.to_string(),
            fields: Some(port.fields.clone()),
            optional: port.optional,
        }
    }

    fn unknown(name: &str) -> Self {
        Self { name: name.to_owned(), doc: String::new(), fields: None, optional: true }
    }

    /// What it holds, in words.
    pub fn words(&self) -> Cow<'static, str> {
        match self.fields.as_deref() {
            None => "any elements".into(),
            Some([only]) => only.element.to_string().into(),
            Some(several) => format!("a bundle of {}", several.len()).into(),
        }
    }

    /// Whether a wire from `output` may end here, as far as elements say. A bundle that was updated in place has fields
    /// that its updater does not name, so those that are missing do not count against it.
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
        Some((_, part)) => part_pins(part, registry),
        None => {
            let declared =
                registry.get(&node.kind.value).and_then(|kind| kind.declaration()).unwrap_or_default();
            let side = |takes: fn(&Port) -> bool| {
                declared.ports.iter().filter(|port| takes(port)).map(Pin::of).collect()
            };
            [side(Port::is_input), side(Port::is_output)]
        }
    };
    // What is wired is shown, whether or not the stage knows it.
    for input in &node.inputs {
        add(&mut pins[0], &input.port.value);
    }
    let wires = file.nodes.iter().flat_map(|node| &node.inputs).map(|input| &input.from.value);
    let outputs = file.outputs.iter().map(|output| &output.from.value);
    for source in wires.chain(outputs).filter(|source| source.node == node.name.value) {
        add(&mut pins[1], &source.port);
    }
    pins
}

fn add(pins: &mut Vec<Pin>, name: &str) {
    if pins.iter().all(|pin| pin.name != name) {
        pins.push(Pin::unknown(name));
    }
}

fn part_pins(part: &GraphFile, registry: &Registry) -> [Vec<Pin>; 2] {
    let pin = |side: usize, at: &Source, name: &str| {
        let node = part.node(&at.node)?;
        let pin = pins(part, node, registry)[side].iter().find(|pin| pin.name == at.port).cloned()?;
        Some(Pin { name: name.to_owned(), ..pin })
    };
    let mut inputs: Vec<Pin> = Vec::new();
    for node in &part.nodes {
        for input in node.inputs.iter().filter(|input| input.from.value.node == INPUTS) {
            let name = &input.from.value.port;
            if inputs.iter().all(|known| known.name != *name) {
                let at = Source { node: node.name.value.clone(), port: input.port.value.clone() };
                inputs.push(pin(0, &at, name).unwrap_or_else(|| Pin::unknown(name)));
            }
        }
    }
    let output = |output: &epigraph_core::OutputDef| {
        pin(1, &output.from.value, &output.name.value).unwrap_or_else(|| Pin::unknown(&output.name.value))
    };
    [inputs, part.outputs.iter().map(output).collect()]
}
