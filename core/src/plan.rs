//! The plan: a checked graph as a list of steps over numbered memory. A plain value that needs no GPU.
//!
//! Five passes, each a function below: *order* (petgraph; producers before consumers, readers before the updater that
//! overwrites their input), *storages* (one for each written field; updates in place share their source's), *rest*
//! (which nodes may be skipped, and what is kept for that), *steps* (nodes with the transfers between their sides),
//! *slots* (memory shared by transients whose lifetimes do not overlap).
//!
//! The words for memory, here and in the executor:
//!
//! - A *storage* ([`Storage`]) is the resource behind one field of an output. Ports that are updated in place use the
//!   storage of their source.
//! - A *value* ([`Value`]) is the contents of a storage, of this frame or of the frame before.
//! - A *binding* ([`PlannedNode::bindings`]) is the value that a field of a port reads or writes.
//! - A *slot* ([`Slot`]) is room for the contents of a storage on one side. Storages whose lifetimes do not overlap
//!   take turns in a slot; a storage with history has two.
//! - *Memory* is what the executor allocates for a slot: bytes on the CPU, a buffer or a texture on the GPU.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, HashMap},
    fmt,
};

use index_vec::IndexVec;
use petgraph::{
    Direction,
    algo::tarjan_scc,
    graph::{DiGraph, NodeIndex},
    visit::EdgeRef,
};

mod rest;

use crate::{
    error::{GraphError, Problem, Problems},
    graph::{Culled, Graph, Node, PortRef, Settings},
    id::{NodeId, SlotId, StepId, StorageId, TapId},
    port::{Access, Dims, Element, FieldRef, Lifetime, Meaning, Port},
    side::{Download, PerSide, Side},
    stage::Runs,
};

/// How long the contents of a storage live.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Life {
    /// Until the last step of the frame that uses them; the slot is pooled.
    Transient,
    /// Persistent, from frame to frame.
    Persistent,
    /// Until the end of the next frame, because some node reads last frame's contents: two slots that swap.
    History,
}

/// One written field.
#[derive(Clone, Debug, PartialEq)]
pub struct Storage {
    /// `node.port` or `node.port.field` of the port that first writes it.
    pub name: String,
    /// Its elements.
    pub element: Element,
    /// The number of elements, as width and height.
    pub dims: Dims,
    /// How long its contents live.
    pub life: Life,
    /// The side that holds its contents at the frame's end.
    pub home: Side,
    /// Its memory on each side that uses it.
    pub slots: PerSide<Option<SlotPair>>,
}

impl Storage {
    /// Bytes of its elements.
    pub fn bytes(&self) -> u64 {
        self.dims.count() as u64 * u64::from(self.element.bytes())
    }

    /// A slot that fits it.
    fn slot(&self) -> Slot {
        Slot { element: self.element.clone(), dims: self.dims }
    }
}

/// The slots of this frame's and last frame's value of a storage, which swap after each frame. Without history, both
/// are the same slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlotPair([SlotId; 2]);

impl SlotPair {
    /// One slot for both values.
    fn same(slot: SlotId) -> Self {
        Self([slot; 2])
    }

    /// The slot of one of the values in frames of this parity: 0 for even frames, 1 for odd ones.
    pub fn at(self, parity: usize, previous: bool) -> SlotId {
        self.0[parity ^ usize::from(previous)]
    }

    /// Both slots.
    pub fn both(self) -> [SlotId; 2] {
        self.0
    }
}

/// The contents of a storage, of this frame or of the frame before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Value {
    /// The storage.
    pub storage: StorageId,
    /// Whether this is last frame's value.
    pub previous: bool,
}

impl Value {
    /// This frame's contents of a storage.
    pub fn now(storage: StorageId) -> Self {
        Self { storage, previous: false }
    }
}

/// One step of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Runs a node.
    Run(NodeId),
    /// Copies CPU memory to GPU memory.
    Upload(Value),
    /// Copies GPU memory to CPU memory.
    Download(Value, Download),
    /// Captures the current contents of a tapped storage.
    Tap {
        /// The tap.
        tap: TapId,
        /// Index in [`Tap::fields`].
        field: usize,
    },
}

/// Memory on one side.
#[derive(Clone, Debug, PartialEq)]
pub struct Slot {
    /// Its elements. On the GPU they are those of all of its users, on the CPU those of its largest one.
    pub element: Element,
    /// The number of elements, as width and height.
    pub dims: Dims,
}

impl Slot {
    /// Bytes.
    pub fn bytes(&self) -> u64 {
        self.dims.count() as u64 * u64::from(self.element.bytes())
    }
}

/// A port that is read from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Tap {
    /// `node.port`, or the name of the output.
    pub name: String,
    /// The port.
    pub at: PortRef,
    /// What the port's values mean, if declared.
    pub meaning: Option<Meaning>,
    /// Its storages, field by field.
    pub fields: Vec<TapField>,
}

/// A field of a tapped port.
#[derive(Clone, Debug, PartialEq)]
pub struct TapField {
    /// Its name; empty for the only one.
    pub name: String,
    /// What holds it.
    pub storage: StorageId,
    /// Where it is read: on the node's side, or on the other one if the node does not use this field and only that side
    /// has it.
    pub side: Side,
}

/// The value of each field of each port; `None` for an optional input that is not connected.
pub type Bindings = Vec<Vec<Option<Value>>>;

/// A node and the values it reads and writes.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedNode {
    /// Its name.
    pub name: String,
    /// Its stage kind.
    pub kind: String,
    /// The column of the application's table of times that it counts towards; `None`: the rest of the frame.
    pub column: Option<&'static str>,
    /// Where it runs.
    pub side: Side,
    /// The values of its ports.
    pub bindings: Bindings,
    /// The storages that it is the first to write in a frame.
    pub first_writes: Vec<StorageId>,
    /// The storages that it changes in place.
    pub updates: Vec<StorageId>,
    /// The storages that it writes completely, whatever they hold before.
    pub written_anew: Vec<StorageId>,
    /// In which frames it runs. Otherwise its outputs keep what they hold.
    pub runs: Runs,
    /// If it runs per view: other contents, on a side, that wake it when they change. Its readers run then, and what they
    /// read is not kept.
    pub wakes: Vec<(StorageId, Side)>,
}

impl PlannedNode {
    /// The values of its connected ports.
    pub fn values(&self) -> impl Iterator<Item = Value> {
        self.bindings.iter().flatten().flatten().copied()
    }

    /// The value of one field; `None` if its input is not connected.
    pub fn value(&self, at: FieldRef) -> Option<Value> {
        self.bindings[at.port as usize][at.field as usize]
    }

    /// The storages whose contents it changes.
    pub fn written(&self) -> impl Iterator<Item = StorageId> {
        self.first_writes.iter().chain(&self.updates).copied()
    }
}

/// The order, memory and transfers of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The steps, in order.
    pub steps: IndexVec<StepId, Step>,
    /// The graph's nodes.
    pub nodes: IndexVec<NodeId, PlannedNode>,
    /// All written fields.
    pub storages: IndexVec<StorageId, Storage>,
    /// The memory of each side.
    pub slots: PerSide<IndexVec<SlotId, Slot>>,
    /// Ports that are read from outside: the settings' taps first, then the outputs.
    pub taps: IndexVec<TapId, Tap>,
    /// What was left out.
    pub culled: Vec<Culled>,
}

impl Plan {
    /// Compiles a checked graph.
    ///
    /// # Errors
    /// [`GraphError::Cycle`] if nodes wait for each other.
    pub fn new(graph: &Graph, settings: &Settings) -> Result<Self, Problems> {
        let order = order(graph)?;
        let (mut storages, bindings) = storages(graph);
        let mut nodes = nodes(graph, bindings);
        if settings.prune {
            rest::rest(graph, &order, &mut nodes, &mut storages);
        } else {
            nodes.iter_mut().for_each(|node| node.runs = Runs::Always);
        }
        let mut taps = taps(graph, &nodes);
        let steps = steps(graph, &order, &nodes, &mut storages, &mut taps);
        let slots = slots(&steps, graph, &nodes, &mut storages, &taps, settings.pooling);
        Ok(Self { steps, nodes, storages, slots, taps, culled: graph.culled.clone() })
    }

    /// The nodes in execution order.
    pub fn order(&self) -> impl Iterator<Item = NodeId> {
        self.steps.iter().filter_map(|step| match step {
            Step::Run(node) => Some(*node),
            _ => None,
        })
    }

    /// Whether some node runs on that side.
    pub fn uses(&self, side: Side) -> bool {
        self.nodes.iter().any(|node| node.side == side)
    }

    /// Bytes of all memory on one side.
    pub fn bytes(&self, side: Side) -> u64 {
        self.slots[side].iter().map(Slot::bytes).sum()
    }

    /// Bytes that pooling saves on one side.
    pub fn pooled_bytes(&self, side: Side) -> u64 {
        let wanted: u64 = self
            .storages
            .iter()
            .filter(|storage| storage.slots[side].is_some())
            .map(|storage| storage.bytes() * if storage.life == Life::History { 2 } else { 1 })
            .sum();
        wanted - self.bytes(side)
    }

    /// Bytes that one node writes.
    pub fn node_bytes(&self, node: NodeId) -> u64 {
        self.nodes[node].first_writes.iter().map(|&storage| self.storages[storage].bytes()).sum()
    }

    /// Bytes of what one node writes that outlives the frame.
    fn kept_bytes(&self, node: NodeId) -> u64 {
        let storages = self.nodes[node].first_writes.iter().map(|&storage| &self.storages[storage]);
        storages.filter(|storage| storage.life == Life::Persistent).map(Storage::bytes).sum()
    }

    /// The slot of a value on one side, in frames of this parity.
    ///
    /// # Panics
    /// If no step uses the value on that side.
    pub(crate) fn slot(&self, value: Value, side: Side, parity: usize) -> SlotId {
        let pair = self.storages[value.storage].slots[side];
        pair.expect("the plan gives memory wherever a step needs it").at(parity, value.previous)
    }

    /// A step's name in tables: the node's, or the transfer's.
    pub fn step_name(&self, step: &Step) -> String {
        let name = |value: &Value| &self.storages[value.storage].name;
        match step {
            Step::Run(node) => self.nodes[*node].name.clone(),
            Step::Upload(value) => format!("upload {}", name(value)),
            Step::Download(value, Download::Sync) => format!("download {}", name(value)),
            Step::Download(value, Download::Latent(n)) => {
                format!("download {} ({n} frames late)", name(value))
            }
            Step::Tap { tap, field } => {
                format!("tap {}", self.storages[self.taps[*tap].fields[*field].storage].name)
            }
        }
    }

    /// The plan as a Graphviz graph: nodes by side, dashed wires for last frame's values.
    pub fn dot(&self) -> String {
        let mut text =
            String::from("digraph plan {\n  rankdir=LR;\n  node [shape=box, fontname=\"sans-serif\"];\n");
        for PlannedNode { name, kind, side, .. } in &self.nodes {
            let fill = if *side == Side::Gpu { "#d5e8d4" } else { "#dae8fc" };
            let line = format!(
                "  {name:?} [label=\"{name}\\n{kind} ({side})\", style=filled, fillcolor=\"{fill}\"];\n"
            );
            text += &line;
        }
        let mut writer: HashMap<StorageId, &str> = HashMap::new();
        let mut wires: BTreeSet<(String, String, bool)> = BTreeSet::new();
        let last_writer = self.last_writers();
        for step in &self.steps {
            let Step::Run(node) = step else { continue };
            let node = &self.nodes[*node];
            let name = &node.name;
            for Value { storage, previous } in node.values() {
                let from = if previous { last_writer.get(&storage) } else { writer.get(&storage) };
                if let Some(from) = from.filter(|from| **from != name) {
                    wires.insert(((*from).to_owned(), name.clone(), previous));
                }
            }
            writer.extend(node.written().map(|storage| (storage, name.as_str())));
        }
        for (from, to, previous) in wires {
            let style = if previous { " [style=dashed]" } else { "" };
            text += &format!("  {from:?} -> {to:?}{style};\n");
        }
        for culled in &self.culled {
            text +=
                &format!("  {:?} [style=dotted, fontcolor=gray, tooltip={:?}];\n", culled.node, culled.why);
        }
        text + "}\n"
    }

    fn last_writers(&self) -> HashMap<StorageId, &str> {
        let mut last = HashMap::new();
        for step in &self.steps {
            if let Step::Run(node) = step {
                let node = &self.nodes[*node];
                last.extend(node.written().map(|storage| (storage, node.name.as_str())));
            }
        }
        last
    }
}

/// The plan as the table that `epigraph check` prints.
impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, None)
    }
}

/// Further columns of a plan's table.
pub(crate) struct Columns {
    /// Their headings.
    pub headings: &'static str,
    /// What stands behind each step.
    pub cells: Vec<String>,
    /// What stands behind the whole frame.
    pub frame: String,
}

impl Plan {
    /// Writes the table, with or without further columns.
    pub(crate) fn write(&self, f: &mut fmt::Formatter<'_>, more: Option<&Columns>) -> fmt::Result {
        let longest = |texts: &mut dyn Iterator<Item = &String>| texts.map(String::len).max().unwrap_or(0);
        let names = longest(&mut self.nodes.iter().map(|node| &node.name));
        let kinds = longest(&mut self.nodes.iter().map(|node| &node.kind));
        let width = names + kinds + 6;
        if let Some(Columns { headings, .. }) = more {
            writeln!(f, "     {:<width$} {:>10}{headings}", "", "memory")?;
        }
        for (index, step) in self.steps.iter().enumerate() {
            let (name, bytes) = match step {
                Step::Run(node) => {
                    let PlannedNode { name, kind, side, .. } = &self.nodes[*node];
                    (format!("{name:<names$} {kind:<kinds$} {side}"), self.node_bytes(*node))
                }
                Step::Upload(value) | Step::Download(value, _) => {
                    (self.step_name(step), self.storages[value.storage].bytes())
                }
                Step::Tap { .. } => continue,
            };
            let cells = more.map_or("", |more| more.cells[index].trim_end());
            writeln!(f, "{:>3}  {name:<width$} {:>10}{cells}", index + 1, megabytes(bytes))?;
        }
        if let Some(Columns { frame, .. }) = more {
            writeln!(f, "     {:<width$} {:>10}{frame}", "frame", "")?;
        }
        for side in Side::ALL {
            if !self.slots[side].is_empty() {
                let (bytes, saved) = (megabytes(self.bytes(side)), megabytes(self.pooled_bytes(side)));
                writeln!(f, "memory on the {side}: {bytes} ({saved} saved by pooling)")?;
            }
        }
        for culled in &self.culled {
            writeln!(f, "left out: {} ({}): {}", culled.node, culled.kind, culled.why)?;
        }
        let mut skipped: Vec<(&str, Vec<&str>, u64)> = Vec::new();
        for (id, node) in self.nodes.iter_enumerated() {
            let Some(why) = node.runs.unless() else { continue };
            let (name, bytes) = (node.name.as_str(), self.kept_bytes(id));
            match skipped.iter_mut().find(|(other, ..)| *other == why) {
                Some((_, names, sum)) => {
                    names.push(name);
                    *sum += bytes;
                }
                None => skipped.push((why, vec![name], bytes)),
            }
        }
        for (why, names, bytes) in skipped {
            writeln!(f, "skipped while {why}: {}; {} kept", names.join(", "), megabytes(bytes))?;
        }
        Ok(())
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.2} MiB", bytes as f64 / (1024.0 * 1024.0))
}

/// Producers before consumers; readers of a version before its updater. Among the nodes that are ready, one whose outputs
/// seldom change comes first ([`rest`]), then one on the same side as the previous node (fewer changes of side, fewer
/// submissions), then file order decides.
fn order(graph: &Graph) -> Result<Vec<NodeId>, Problems> {
    let before = precedence(graph);
    let mut waiting: IndexVec<NodeId, usize> = graph
        .nodes
        .indices()
        .map(|node| before.edges_directed(vertex(node), Direction::Incoming).count())
        .collect();
    let mut ready: BTreeSet<NodeId> = waiting.indices().filter(|&node| waiting[node] == 0).collect();
    let mut order = Vec::with_capacity(waiting.len());
    let mut side = None;
    while let Some(&first) = ready.first() {
        let seldom = ready.iter().copied().find(|&node| graph.nodes[node].declaration().seldom);
        let same_side = || ready.iter().copied().find(|&node| Some(graph.nodes[node].side) == side);
        let node = seldom.or_else(same_side).unwrap_or(first);
        ready.remove(&node);
        side = Some(graph.nodes[node].side);
        order.push(node);
        for edge in before.edges(vertex(node)) {
            let next = before[edge.target()];
            waiting[next] -= 1;
            if waiting[next] == 0 {
                ready.insert(next);
            }
        }
    }
    if order.len() == waiting.len() { Ok(order) } else { Err(cycle(graph, &before).into()) }
}

/// An edge from each node to each node that must come after it.
fn precedence(graph: &Graph) -> DiGraph<NodeId, ()> {
    let mut before = DiGraph::new();
    for node in graph.nodes.indices() {
        before.add_node(node);
    }
    let mut readers: HashMap<PortRef, Vec<NodeId>> = HashMap::new();
    let mut updaters: Vec<(PortRef, NodeId)> = Vec::new();
    for (id, node) in graph.nodes.iter_enumerated() {
        for (port, declared) in node.declaration().ports.iter().enumerate() {
            let Some(source) = node.sources[port] else { continue };
            match declared.access {
                Access::History => continue,
                Access::Update => updaters.push((source, id)),
                Access::Read | Access::Write => readers.entry(source).or_default().push(id),
            }
            before.update_edge(vertex(source.node), vertex(id), ());
        }
    }
    for (source, updater) in updaters {
        for &reader in readers.get(&source).into_iter().flatten() {
            if reader != updater {
                before.update_edge(vertex(reader), vertex(updater), ());
            }
        }
    }
    before
}

/// The vertex of a node: nodes were added in the same order.
fn vertex(node: NodeId) -> NodeIndex {
    NodeIndex::new(node.index())
}

fn cycle(graph: &Graph, before: &DiGraph<NodeId, ()>) -> Problem {
    let on_cycle: BTreeSet<NodeId> = tarjan_scc(before)
        .into_iter()
        .find(|group| group.len() > 1 || before.contains_edge(group[0], group[0]))
        .into_iter()
        .flatten()
        .map(|node| before[node])
        .collect();
    // Inside a strongly connected group, any walk eventually closes a loop.
    let mut path: Vec<NodeId> = on_cycle.first().copied().into_iter().collect();
    while let Some(&last) = path.last() {
        let next =
            before.neighbors(vertex(last)).map(|node| before[node]).filter(|n| on_cycle.contains(n)).min();
        let Some(next) = next else { break };
        if let Some(start) = path.iter().position(|&node| node == next) {
            path.drain(..start);
            path.push(next);
            break;
        }
        path.push(next);
    }
    let names: Vec<String> = path.iter().map(|&node| graph.nodes[node].name.clone()).collect();
    let first = names.first().cloned().unwrap_or_default();
    Problem::new(GraphError::Cycle { path: names }).node(&first)
}

type Storages = IndexVec<StorageId, Storage>;
type Nodes = IndexVec<NodeId, PlannedNode>;
type Taps = IndexVec<TapId, Tap>;

/// One storage for each field of each written port, and the value of every port.
fn storages(graph: &Graph) -> (Storages, IndexVec<NodeId, Bindings>) {
    let mut storages = Storages::new();
    let mut of_field: BTreeMap<(PortRef, String), StorageId> = BTreeMap::new();
    for (node, declared) in graph.nodes.iter_enumerated() {
        for (port, written) in declared.declaration().ports.iter().enumerate() {
            if written.access != Access::Write {
                continue;
            }
            for field in &written.fields {
                let at = PortRef { node, port };
                let mut name = graph.name(at);
                if !field.name.is_empty() {
                    name = format!("{name}.{}", field.name);
                }
                let life = match written.lifetime {
                    Lifetime::Transient => Life::Transient,
                    Lifetime::Persistent => Life::Persistent,
                };
                let storage = storages.push(Storage {
                    name,
                    element: field.element.clone(),
                    dims: declared.dims[port],
                    life,
                    home: declared.side,
                    slots: PerSide::default(),
                });
                of_field.insert((at, field.name.to_string()), storage);
            }
        }
    }
    let mut bindings = IndexVec::new();
    for (id, node) in graph.nodes.iter_enumerated() {
        let mut of_node = Bindings::new();
        for (port, declared) in node.declaration().ports.iter().enumerate() {
            let at = PortRef { node: id, port };
            let source =
                if declared.is_input() { node.sources[port].map(|at| graph.root(at)) } else { Some(at) };
            let previous = declared.access == Access::History;
            let of_port: Vec<Option<Value>> = declared
                .fields
                .iter()
                .map(|field| {
                    let storage = of_field[&(source?, field.name.to_string())];
                    Some(Value { storage, previous })
                })
                .collect();
            if previous {
                for value in of_port.iter().flatten() {
                    storages[value.storage].life = Life::History;
                }
            }
            of_node.push(of_port);
        }
        bindings.push(of_node);
    }
    (storages, bindings)
}

/// The nodes with the values they read and write.
fn nodes(graph: &Graph, bindings: IndexVec<NodeId, Bindings>) -> Nodes {
    let plan_node = |(bindings, node): (Bindings, &Node)| {
        let declaration = node.declaration();
        let of_ports = |wanted: &dyn Fn(&Port) -> bool| -> Vec<StorageId> {
            let ports = declaration.ports.iter().zip(&bindings).filter(|(port, _)| wanted(port));
            ports.flat_map(|(_, values)| values.iter().flatten().map(|value| value.storage)).collect()
        };
        let kept = |port: &Port| port.lifetime == Lifetime::Persistent && declaration.runs != Runs::PerView;
        let first_writes = of_ports(&|port| port.access == Access::Write);
        let updates = of_ports(&|port| port.access == Access::Update);
        let written_anew = of_ports(&|port| port.access == Access::Write && !kept(port));
        let (name, kind, side) = (node.name.clone(), node.kind.clone(), node.side);
        let (column, runs) = (declaration.column, declaration.runs.clone());
        let wakes = Vec::new();
        PlannedNode { name, kind, column, side, bindings, first_writes, updates, written_anew, runs, wakes }
    };
    bindings.into_iter().zip(&graph.nodes).map(plan_node).collect()
}

/// All fields of the tapped ports, including those that the tapped node itself does not use.
fn taps(graph: &Graph, nodes: &Nodes) -> Taps {
    let named = graph.taps.iter().map(|(source, at)| (source.to_string(), *at));
    let outputs = graph.outputs.iter().map(|(name, at)| (name.clone(), *at));
    named
        .chain(outputs)
        .map(|(name, at)| {
            let root = graph.root(at);
            let declared = &graph.nodes[root.node].declaration().ports[root.port];
            let fields = declared
                .fields
                .iter()
                .zip(&nodes[root.node].bindings[root.port])
                .filter_map(|(field, value)| {
                    let side = graph.nodes[at.node].side;
                    Some(TapField { name: field.name.to_string(), storage: (*value)?.storage, side })
                })
                .collect();
            Tap { name, at, meaning: graph.meaning(at), fields }
        })
        .collect()
}

/// Which sides hold the current contents of each storage.
type Valid = IndexVec<StorageId, PerSide<bool>>;

/// The nodes in order, with transfers to a side that lacks its inputs. A persistent storage begins a frame valid on the
/// sides where the last frame left it valid, so the walk is done twice: the first finds out which sides those are.
fn steps(
    graph: &Graph,
    order: &[NodeId],
    nodes: &Nodes,
    storages: &mut Storages,
    taps: &mut Taps,
) -> IndexVec<StepId, Step> {
    let mut end: Valid = storages.iter().map(|_| PerSide::new(|_| true)).collect();
    let mut steps = IndexVec::new();
    for _ in 0..2 {
        let mut now: Valid = storages
            .iter()
            .zip(&end)
            .map(|(storage, end)| if storage.life == Life::Persistent { *end } else { PerSide::default() })
            .collect();
        let mut previous = end.clone();
        steps.clear();
        for &node in order {
            let side = graph.nodes[node].side;
            let declaration = graph.nodes[node].declaration();
            let ports = declaration.ports.iter().zip(&nodes[node].bindings);
            // A stage that only owns kept memory accesses it on neither side.
            let ports = ports.filter(|(port, _)| !declaration.idle || port.lifetime == Lifetime::Transient);
            for (port, values) in ports.clone() {
                if port.access == Access::Write && port.lifetime == Lifetime::Transient {
                    continue;
                }
                for value in values.iter().flatten() {
                    let valid = if value.previous { &mut previous } else { &mut now };
                    if std::mem::replace(&mut valid[value.storage][side], true) {
                        continue;
                    }
                    steps.push(match side {
                        Side::Gpu => Step::Upload(*value),
                        Side::Cpu => Step::Download(*value, graph.nodes[node].download),
                    });
                }
            }
            steps.push(Step::Run(node));
            for (port, values) in ports {
                if matches!(port.access, Access::Write | Access::Update) {
                    for value in values.iter().flatten() {
                        now[value.storage] = PerSide::new(|written| written == side);
                    }
                }
            }
            for (tap, tapped) in taps.iter_mut_enumerated().filter(|(_, tap)| tap.at.node == node) {
                for (field, tapped) in tapped.fields.iter_mut().enumerate() {
                    let valid = &now[tapped.storage];
                    tapped.side = if valid[side] || !valid[side.other()] { side } else { side.other() };
                    steps.push(Step::Tap { tap, field });
                }
            }
        }
        end = now;
    }
    for (storage, valid) in storages.iter_mut().zip(end) {
        storage.home = if valid.cpu { Side::Cpu } else { Side::Gpu };
    }
    steps
}

/// Allocates a slot for every storage on every side that uses it. Transients share a slot if their first and last uses do
/// not overlap; on the GPU, which has a buffer or a texture there, only those with equal descriptions. The largest choose
/// first, of equal ones those that live longest, each the smallest slot that is large enough (Pisarchyk and Lee, *Efficient
/// Memory Management for Deep Neural Net Inference*, 2020, section 4.3).
fn slots(
    steps: &IndexVec<StepId, Step>,
    graph: &Graph,
    nodes: &Nodes,
    storages: &mut Storages,
    taps: &Taps,
    pooling: bool,
) -> PerSide<IndexVec<SlotId, Slot>> {
    let mut uses: PerSide<BTreeMap<StorageId, (StepId, StepId)>> = PerSide::default();
    let mut touch = |side: Side, storage: StorageId, at: StepId| {
        let span = uses[side].entry(storage).or_insert((at, at));
        span.1 = at;
    };
    for (at, step) in steps.iter_enumerated() {
        match step {
            Step::Run(node) if graph.nodes[*node].declaration().idle => {}
            Step::Run(node) => {
                for value in nodes[*node].values() {
                    touch(nodes[*node].side, value.storage, at);
                }
            }
            Step::Upload(value) | Step::Download(value, _) => {
                touch(Side::Cpu, value.storage, at);
                touch(Side::Gpu, value.storage, at);
            }
            Step::Tap { tap, field } => {
                let field = &taps[*tap].fields[*field];
                touch(field.side, field.storage, at);
            }
        }
    }
    PerSide::new(|side| {
        let mut slots: IndexVec<SlotId, Slot> = IndexVec::new();
        let rank = |&storage: &StorageId| {
            let (start, end) = uses[side][&storage];
            (Reverse(storages[storage].bytes()), Reverse(end.index() - start.index()), start)
        };
        let mut largest_first: Vec<StorageId> = uses[side].keys().copied().collect();
        largest_first.sort_by_key(rank);
        // The slots of transients, with the first and last steps at which each is in use.
        let mut shared: Vec<(SlotId, BTreeMap<StepId, StepId>)> = Vec::new();
        for id in largest_first {
            let storage = &mut storages[id];
            let pair = match storage.life {
                Life::Persistent => SlotPair::same(slots.push(storage.slot())),
                Life::History => SlotPair([slots.push(storage.slot()), slots.push(storage.slot())]),
                Life::Transient => {
                    let (start, end) = uses[side][&id];
                    let own = storage.slot();
                    let free = shared.iter_mut().rev().find(|(slot, uses)| {
                        let fits = side == Side::Cpu || slots[*slot] == own;
                        let is_free = || uses.range(..=end).next_back().is_none_or(|(_, &last)| last < start);
                        pooling && fits && is_free()
                    });
                    match free {
                        Some((slot, uses)) => {
                            uses.insert(start, end);
                            SlotPair::same(*slot)
                        }
                        None => {
                            let slot = slots.push(own);
                            shared.push((slot, [(start, end)].into()));
                            SlotPair::same(slot)
                        }
                    }
                }
            };
            storage.slots[side] = Some(pair);
        }
        slots
    })
}
