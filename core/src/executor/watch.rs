//! Finds the first bad value that a node wrote in a frame.
//!
//! A CPU node's outputs are examined right after its twin has run. A GPU node is followed by passes that find the first
//! bad element of each field and keep a copy of it (`gpu/watch.rs`); the CPU reads them at the frame's end, and judges
//! the copies by the same code. So both sides report the same, and the frame runs to its end.

use std::cell::RefCell;

use index_vec::{IndexSlice, IndexVec};

use crate::{
    frame::Frame,
    graph::{Graph, PortRef, Settings},
    id::{NodeId, SlotId, StorageId},
    plan::{Plan, Value},
    port::{Dims, Element, FieldRef},
    side::Side,
    stage::CpuMemory,
    values::{self, Counts, Number, Wrong},
    watch::{BadValue, Failed},
};

/// What is watched, and what was found in this frame.
pub(super) struct Watch {
    nodes: IndexVec<NodeId, WatchedNode>,
    /// The checks of the CPU node that is running.
    pub failed: Failed,
    size: [u32; 2],
    /// The node that wrote the first bad value so far.
    found: Option<(NodeId, BadValue)>,
}

/// What is watched of a node.
pub(super) struct WatchedNode {
    name: String,
    kind: String,
    side: Side,
    /// Its place in the order of execution.
    place: usize,
    /// The fields that it writes, in the order of their declaration.
    pub fields: Vec<WatchedField>,
    /// The ports that it reads.
    read: Vec<String>,
}

/// A field that a node writes.
pub(super) struct WatchedField {
    at: FieldRef,
    /// `node.port`, or `node.port.field`.
    pub name: String,
    /// Its WGSL variable.
    pub variable: String,
    pub storage: StorageId,
    pub element: Element,
    pub dims: Dims,
    /// The numbers of an element that may be wrong.
    pub numbers: Vec<Number>,
}

impl WatchedField {
    /// The first number of an element that is not allowed, with its bits; `word` has the element's words.
    fn fault(&self, word: impl Fn(usize) -> u32) -> Option<(&Number, u32)> {
        let mut numbers = self.numbers.iter().map(|number| (number, word(number.word)));
        numbers.find(|(number, word)| !number.holds(*word))
    }
}

/// An element that is bad, or that fails a check.
pub(super) struct Suspect<'a> {
    /// Index in [`WatchedNode::fields`].
    pub field: usize,
    pub element: usize,
    pub words: &'a [u32],
    /// The check that fails.
    pub check: Option<&'a str>,
}

impl Watch {
    pub fn new(graph: &Graph, plan: &Plan, settings: &Settings) -> Self {
        let mut nodes: IndexVec<NodeId, WatchedNode> =
            graph.nodes.indices().map(|node| watched(graph, plan, node, settings)).collect();
        for (place, node) in plan.order().enumerate() {
            nodes[node].place = place;
        }
        Self { nodes, failed: Failed::default(), size: settings.size, found: None }
    }

    /// What is watched of each node.
    pub fn nodes(&self) -> &IndexVec<NodeId, WatchedNode> {
        &self.nodes
    }

    /// Examines what a CPU node has written. Of one that comes after a bad value, nothing is of interest.
    pub fn examine(
        &mut self,
        node: NodeId,
        plan: &Plan,
        memory: &IndexSlice<SlotId, [RefCell<CpuMemory>]>,
        parity: usize,
        frame: &Frame,
    ) {
        let failed = self.failed.take();
        if self.found.is_some() {
            return;
        }
        let fields = &self.nodes[node].fields;
        let bytes_of =
            |field: &WatchedField| memory[plan.slot(Value::now(field.storage), Side::Cpu, parity)].borrow();
        let check = failed.and_then(|(at, element, text)| {
            let field = fields.iter().position(|field| field.at == at)?;
            Some((field, element, Some(text)))
        });
        let first_bad = || {
            fields.iter().enumerate().find_map(|(index, field)| {
                if field.numbers.is_empty() {
                    return None;
                }
                let (size, memory) = (field.element.bytes() as usize, bytes_of(field));
                let mut elements = memory.bytes()[..field.dims.count() * size].chunks_exact(size);
                let is_bad =
                    |bytes: &[u8]| field.fault(|at| values::word(&field.element, bytes, at)).is_some();
                elements.position(is_bad).map(|element| (index, element, None))
            })
        };
        if let Some((index, element, check)) = check.or_else(first_bad) {
            let field = &fields[index];
            let (size, memory) = (field.element.bytes() as usize, bytes_of(field));
            let bytes = memory.bytes().get(element * size..(element + 1) * size).unwrap_or_default();
            let count = if bytes.is_empty() { 0 } else { values::words(&field.element) };
            let words: Vec<u32> = (0..count).map(|at| values::word(&field.element, bytes, at)).collect();
            self.report(node, &Suspect { field: index, element, words: &words, check }, frame);
        }
    }

    /// Keeps a suspect if it is bad and its node runs before that of the bad value that is known.
    pub fn report(&mut self, id: NodeId, suspect: &Suspect, frame: &Frame) {
        let node = &self.nodes[id];
        let is_later = |(known, _): &(NodeId, BadValue)| self.nodes[*known].place <= node.place;
        if self.found.as_ref().is_some_and(is_later) {
            return;
        }
        let &Suspect { field, element, words, check } = suspect;
        let field = &node.fields[field];
        let count = field.dims.count();
        let (number, wrong, value, expected) = match check {
            Some(text) if element >= count => {
                let value = format!("missing: there are {count}");
                (String::new(), Wrong::Check, value, text.to_owned())
            }
            Some(text) => (String::new(), Wrong::Check, values::text(&field.element, words), text.to_owned()),
            None => {
                let Some((number, word)) = field.fault(|at| words[at]) else { return };
                (number.name.clone(), number.wrong(word), number.text(word), number.allowed.clone())
            }
        };
        let bad = BadValue {
            node: node.name.clone(),
            kind: node.kind.clone(),
            port: field.name.clone(),
            element,
            number,
            pixel: pixel(element, field.dims, self.size),
            frame: frame.index,
            side: node.side,
            wrong,
            value,
            expected,
            read: node.read.clone(),
        };
        self.found = Some((id, bad));
    }

    /// The first bad value of the frame.
    pub fn take(&mut self) -> Option<BadValue> {
        self.failed.take();
        self.found.take().map(|(_, bad)| bad)
    }
}

/// The pixel of an element, if there is one for each pixel of the frame, or for each corner of a pixel.
fn pixel(element: usize, dims: Dims, size: [u32; 2]) -> Option<[u32; 2]> {
    let [width, height] = size;
    let corners = [width + 1, height + 1];
    let fits = [size, corners].contains(&[dims.width, dims.height]) && element < dims.count();
    let (x, y) = (element as u32 % dims.width, element as u32 / dims.width);
    fits.then(|| [x.min(width - 1), y.min(height - 1)])
}

/// What is watched of a node; its place is not known yet.
fn watched(graph: &Graph, plan: &Plan, id: NodeId, settings: &Settings) -> WatchedNode {
    let node = &graph.nodes[id];
    let mut fields = Vec::new();
    let mut read = Vec::new();
    let nearest = |meaning: &str| nearest(graph, id, meaning);
    let [width, height] = settings.size.map(|side| side as usize);
    let counts = Counts { of: &nearest, pixels: width * height };
    for (index, port) in node.declaration().ports.iter().enumerate() {
        let at = PortRef { node: id, port: index };
        if let (true, Some(source)) = (port.is_input(), node.sources[index]) {
            read.push(graph.name(source));
        }
        if !port.is_output() || node.declaration().idle {
            continue;
        }
        let meaning = graph.meaning(at);
        let rules = match &port.rules[..] {
            [] => meaning.map_or(&[][..], |meaning| meaning.rules),
            own => own,
        };
        for (field, declared) in port.fields.iter().enumerate() {
            let at = FieldRef { port: index as u16, field: field as u16 };
            let Some(value) = plan.nodes[id].value(at) else { continue };
            let name = graph.name(PortRef { node: id, port: index });
            let name = if declared.name.is_empty() { name } else { format!("{name}.{}", declared.name) };
            fields.push(WatchedField {
                at,
                name,
                variable: port.variable(field),
                storage: value.storage,
                element: declared.element.clone(),
                dims: plan.storages[value.storage].dims,
                numbers: values::numbers(&declared.name, &declared.element, rules, &counts),
            });
        }
    }
    WatchedNode { name: node.name.clone(), kind: node.kind.clone(), side: node.side, place: 0, fields, read }
}

/// The number of elements of the nearest port with a meaning: one of the node, or of those that its inputs come from.
fn nearest(graph: &Graph, node: NodeId, meaning: &str) -> Option<usize> {
    let mut seen = vec![node];
    let mut next = 0;
    while let Some(&id) = seen.get(next) {
        next += 1;
        let node = &graph.nodes[id];
        let mut ports = (0..node.sources.len()).map(|port| PortRef { node: id, port });
        let means = |at: &PortRef| graph.meaning(*at).is_some_and(|found| found.name == meaning);
        if let Some(PortRef { port, .. }) = ports.find(means) {
            return Some(node.dims[port].count());
        }
        let sources = node.sources.iter().flatten().map(|source| source.node);
        seen.extend(sources.filter(|source| !seen.contains(source)).collect::<Vec<_>>());
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_for_each_pixel_or_corner_have_a_pixel() {
        let dims = |width, height| Dims { width, height };
        assert_eq!(pixel(13, dims(5, 3), [5, 3]), Some([3, 2]));
        assert_eq!(pixel(23, dims(6, 4), [5, 3]), Some([4, 2]), "the last corner");
        assert_eq!(pixel(7, dims(15, 1), [5, 3]), None);
    }
}
