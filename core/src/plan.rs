//! The plan: a checked graph as a list of steps over numbered memory. A plain value that needs no GPU.
//!
//! Four passes, each a function below: *order* (petgraph; producers before consumers, readers before the updater that
//! overwrites them), *storages* (one for each written field; updates in place share their source's), *steps* (nodes
//! with the transfers that their sides make necessary), *slots* (memory shared by transients whose lives do not overlap).

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    fmt,
};

use petgraph::{
    Direction,
    algo::tarjan_scc,
    graph::{DiGraph, NodeIndex},
    visit::EdgeRef,
};

use crate::{
    error::{GraphError, Problem, Problems},
    file::{Download, GraphFile, Side},
    graph::{Culled, Graph, PortRef, Settings},
    port::{Access, Dims, Element, Lifetime},
    registry::Registry,
};

/// How the memory of a written field lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Life {
    /// Pooled.
    Transient,
    /// Kept from frame to frame.
    Persistent,
    /// Two copies that swap at the frame's end, because somebody reads the last frame's.
    History,
}

/// One written field.
#[derive(Clone, Debug, PartialEq)]
pub struct Storage {
    /// `node.port` or `node.port.field` of its writer.
    pub name: String,
    /// Its elements.
    pub element: Element,
    /// How many.
    pub dims: Dims,
    /// How it lives.
    pub life: Life,
    /// The side that holds its contents at the frame's end.
    pub home: Side,
    /// Its memory on the CPU and on the GPU: this frame's and last frame's slot (equal but for history).
    pub slots: [Option<[usize; 2]>; 2],
}

impl Storage {
    /// Bytes of its elements.
    pub fn bytes(&self) -> u64 {
        self.dims.count() as u64 * u64::from(self.element.bytes())
    }
}

/// A storage, this frame's or last frame's copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Copy {
    /// Index in [`Plan::storages`].
    pub storage: usize,
    /// Last frame's.
    pub previous: bool,
}

/// One thing that a frame does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Runs a node: index in the graph's nodes.
    Run(usize),
    /// CPU memory to GPU memory.
    Upload(Copy),
    /// GPU memory to CPU memory.
    Download(Copy, Download),
    /// Hands a tapped storage's present contents to whoever asked: index in [`Plan::taps`], and which of its fields.
    Tap(usize, usize),
}

/// Memory on one side.
#[derive(Clone, Debug, PartialEq)]
pub struct Slot {
    /// What it holds; all of its users agree on it.
    pub element: Element,
    /// How many elements.
    pub dims: Dims,
}

impl Slot {
    /// Bytes.
    pub fn bytes(&self) -> u64 {
        self.dims.count() as u64 * u64::from(self.element.bytes())
    }
}

/// A tapped port: its storages, field by field.
#[derive(Clone, Debug, PartialEq)]
pub struct Tap {
    /// `node.port`, or the name of the output.
    pub name: String,
    /// The port.
    pub at: PortRef,
    /// Field name and storage.
    pub fields: Vec<(String, usize)>,
}

/// Order, memory and transfers of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What happens, in order.
    pub steps: Vec<Step>,
    /// All written fields.
    pub storages: Vec<Storage>,
    /// For each node, port and field: what it works on; `None` where an optional input is not connected.
    pub bindings: Vec<Vec<Vec<Option<Copy>>>>,
    /// Memory on the CPU and on the GPU.
    pub slots: [Vec<Slot>; 2],
    /// Ports that are read from outside: the settings' taps first, then the outputs.
    pub taps: Vec<Tap>,
    /// For each node: the storages that it is the first to write in a frame.
    pub first_writes: Vec<Vec<usize>>,
    /// For each node: the storages that it changes in place.
    pub updates: Vec<Vec<usize>>,
    /// For each node: whether it is skipped in frames in which neither its inputs nor the view have changed. Its outputs
    /// are kept then.
    pub per_view: Vec<bool>,
    /// Names and kinds of the nodes, and where they run.
    pub nodes: Vec<(String, String, Side)>,
    /// What was left out.
    pub culled: Vec<Culled>,
}

/// Checks a file and compiles it: the way from text to a graph and its plan.
pub fn compile(
    file: &GraphFile,
    registry: &Registry,
    settings: &Settings,
) -> Result<(Graph, Plan), Problems> {
    let graph = Graph::check(file, registry, settings)?;
    let plan = Plan::new(&graph, settings).map_err(|mut problems| {
        for problem in &mut problems.0 {
            let found = problem.node.as_ref().and_then(|name| file.node_at(name));
            problem.place = found.map(|(node, file)| file.place(node.name.span));
        }
        problems
    })?;
    Ok((graph, plan))
}

impl Plan {
    /// Compiles a checked graph.
    pub fn new(graph: &Graph, settings: &Settings) -> Result<Self, Problems> {
        let order = order(graph)?;
        let (mut storages, bindings) = storages(graph);
        let taps = taps(graph, &bindings);
        let first_writes = with_access(graph, &bindings, Access::Write);
        let updates = with_access(graph, &bindings, Access::Update);
        let per_view = per_view(graph, &first_writes, &updates, &mut storages, settings.prune);
        let steps = steps(graph, &order, &bindings, &mut storages, &taps);
        let slots = slots(&steps, &bindings, graph, &mut storages, &taps, settings.pooling);
        let nodes =
            graph.nodes.iter().map(|node| (node.name.clone(), node.kind.clone(), node.side)).collect();
        Ok(Self {
            steps,
            storages,
            bindings,
            slots,
            taps,
            first_writes,
            updates,
            per_view,
            nodes,
            culled: graph.culled.clone(),
        })
    }

    /// Bytes of all memory on one side.
    pub fn bytes(&self, side: Side) -> u64 {
        self.slots[side as usize].iter().map(Slot::bytes).sum()
    }

    /// Bytes that pooling saves on one side.
    pub fn pooled_bytes(&self, side: Side) -> u64 {
        let wanted: u64 = self
            .storages
            .iter()
            .filter(|storage| storage.slots[side as usize].is_some())
            .map(|storage| storage.bytes() * if storage.life == Life::History { 2 } else { 1 })
            .sum();
        wanted - self.bytes(side)
    }

    /// Bytes that one node writes.
    pub fn node_bytes(&self, node: usize) -> u64 {
        self.first_writes[node].iter().map(|&storage| self.storages[storage].bytes()).sum()
    }

    /// The storages that a node fills whatever they held before, which poison mode makes sure of.
    pub(crate) fn written_anew(&self, node: usize) -> impl Iterator<Item = usize> {
        let kept = |storage: &usize| self.storages[*storage].life == Life::Persistent;
        self.first_writes[node].iter().copied().filter(move |storage| self.per_view[node] || !kept(storage))
    }

    /// What a step is called in tables: the node's name, or the transfer's.
    pub fn step_name(&self, step: &Step) -> String {
        match step {
            Step::Run(node) => self.nodes[*node].0.clone(),
            Step::Upload(copy) => format!("upload {}", self.storages[copy.storage].name),
            Step::Download(copy, Download::Sync) => format!("download {}", self.storages[copy.storage].name),
            Step::Download(copy, Download::Latent(n)) => {
                format!("download {} ({n} frames late)", self.storages[copy.storage].name)
            }
            Step::Tap(tap, field) => format!("tap {}", self.storages[self.taps[*tap].fields[*field].1].name),
        }
    }

    /// The plan as a Graphviz graph: nodes by side, dashed wires for last frame's values.
    pub fn dot(&self) -> String {
        let mut text =
            String::from("digraph plan {\n  rankdir=LR;\n  node [shape=box, fontname=\"sans-serif\"];\n");
        for (name, kind, side) in &self.nodes {
            let fill = if *side == Side::Gpu { "#d5e8d4" } else { "#dae8fc" };
            let line = format!(
                "  {name:?} [label=\"{name}\\n{kind} ({side})\", style=filled, fillcolor=\"{fill}\"];\n"
            );
            text += &line;
        }
        let mut writer: HashMap<usize, &str> = HashMap::new();
        let mut wires: BTreeSet<(String, String, bool)> = BTreeSet::new();
        let last_writer = self.last_writers();
        for step in &self.steps {
            let Step::Run(node) = step else { continue };
            let name = &self.nodes[*node].0;
            for copy in self.bindings[*node].iter().flatten().flatten() {
                let from =
                    if copy.previous { last_writer.get(&copy.storage) } else { writer.get(&copy.storage) };
                if let Some(from) = from.filter(|from| **from != name) {
                    wires.insert(((*from).to_owned(), name.clone(), copy.previous));
                }
            }
            for storage in self.written(*node) {
                writer.insert(storage, name);
            }
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

    fn written(&self, node: usize) -> BTreeSet<usize> {
        let first = self.first_writes[node].iter().copied();
        first.chain(self.updates[node].iter().copied()).collect()
    }

    fn last_writers(&self) -> HashMap<usize, &str> {
        let mut last = HashMap::new();
        for step in &self.steps {
            if let Step::Run(node) = step {
                for storage in self.written(*node) {
                    last.insert(storage, self.nodes[*node].0.as_str());
                }
            }
        }
        last
    }
}

/// The plan as the table that `epigraph check` prints.
impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let longest = |texts: &mut dyn Iterator<Item = &String>| texts.map(String::len).max().unwrap_or(0);
        let names = longest(&mut self.nodes.iter().map(|(name, ..)| name));
        let kinds = longest(&mut self.nodes.iter().map(|(_, kind, _)| kind));
        for (index, step) in self.steps.iter().enumerate() {
            match step {
                Step::Run(node) => {
                    let (name, kind, side) = &self.nodes[*node];
                    let bytes = megabytes(self.node_bytes(*node));
                    writeln!(f, "{:>3}  {name:<names$} {kind:<kinds$} {side}  {bytes:>10}", index + 1)?;
                }
                Step::Upload(copy) | Step::Download(copy, _) => {
                    let bytes = megabytes(self.storages[copy.storage].bytes());
                    let width = names + kinds + 6;
                    writeln!(f, "{:>3}  {:<width$} {bytes:>10}", index + 1, self.step_name(step))?;
                }
                Step::Tap(..) => {}
            }
        }
        for side in [Side::Cpu, Side::Gpu] {
            if !self.slots[side as usize].is_empty() {
                let (bytes, saved) = (megabytes(self.bytes(side)), megabytes(self.pooled_bytes(side)));
                writeln!(f, "memory on the {side}: {bytes} ({saved} saved by pooling)")?;
            }
        }
        for culled in &self.culled {
            writeln!(f, "left out: {} ({}): {}", culled.node, culled.kind, culled.why)?;
        }
        for (node, (name, kind, _)) in self.nodes.iter().enumerate().filter(|(node, _)| self.per_view[*node])
        {
            let bytes = megabytes(self.node_bytes(node));
            writeln!(f, "not again while its inputs and the view stay the same: {name} ({kind}), {bytes}")?;
        }
        Ok(())
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.2} MiB", bytes as f64 / (1024.0 * 1024.0))
}

/// Producers before consumers; readers of a version before its updater. Among nodes that may run, one on the same side
/// as the last comes first (fewer changes of side, fewer submissions), then the file's order decides.
fn order(graph: &Graph) -> Result<Vec<usize>, Problems> {
    let mut before: DiGraph<usize, ()> = DiGraph::new();
    for node in 0..graph.nodes.len() {
        before.add_node(node);
    }
    let mut readers: HashMap<PortRef, Vec<usize>> = HashMap::new();
    let mut updaters: Vec<(PortRef, usize)> = Vec::new();
    for (index, node) in graph.nodes.iter().enumerate() {
        for (port, declared) in node.declaration().ports.iter().enumerate() {
            let Some(source) = node.sources[port] else { continue };
            match declared.access {
                Access::History => continue,
                Access::Update => updaters.push((source, index)),
                Access::Read | Access::Write => readers.entry(source).or_default().push(index),
            }
            before.update_edge(NodeIndex::new(source.node), NodeIndex::new(index), ());
        }
    }
    for (version, updater) in updaters {
        for &reader in readers.get(&version).into_iter().flatten() {
            if reader != updater {
                before.update_edge(NodeIndex::new(reader), NodeIndex::new(updater), ());
            }
        }
    }

    let mut waiting: Vec<usize> =
        before.node_indices().map(|node| before.edges_directed(node, Direction::Incoming).count()).collect();
    let mut ready: BTreeSet<usize> = (0..waiting.len()).filter(|&node| waiting[node] == 0).collect();
    let mut order = Vec::with_capacity(waiting.len());
    let mut side = None;
    while let Some(&first) = ready.first() {
        let same_side = ready.iter().copied().find(|&node| Some(graph.nodes[node].side) == side);
        let node = same_side.unwrap_or(first);
        ready.remove(&node);
        side = Some(graph.nodes[node].side);
        order.push(node);
        for edge in before.edges(NodeIndex::new(node)) {
            let next = edge.target().index();
            waiting[next] -= 1;
            if waiting[next] == 0 {
                ready.insert(next);
            }
        }
    }
    if order.len() == waiting.len() { Ok(order) } else { Err(cycle(graph, &before).into()) }
}

fn cycle(graph: &Graph, before: &DiGraph<usize, ()>) -> Problem {
    let on_cycle: BTreeSet<usize> = tarjan_scc(before)
        .into_iter()
        .find(|group| group.len() > 1 || before.contains_edge(group[0], group[0]))
        .into_iter()
        .flatten()
        .map(NodeIndex::index)
        .collect();
    // Inside a strongly connected group, walking on always closes a loop.
    let mut path: Vec<usize> = on_cycle.first().copied().into_iter().collect();
    while let Some(&last) = path.last() {
        let next = before
            .neighbors(NodeIndex::new(last))
            .map(NodeIndex::index)
            .filter(|n| on_cycle.contains(n))
            .min();
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

type Bindings = Vec<Vec<Vec<Option<Copy>>>>;

/// One storage for each field of each written port, and what every port works on.
fn storages(graph: &Graph) -> (Vec<Storage>, Bindings) {
    let mut storages = Vec::new();
    let mut of_field: BTreeMap<(PortRef, String), usize> = BTreeMap::new();
    for (node, declared) in graph.nodes.iter().enumerate() {
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
                of_field.insert((at, field.name.to_string()), storages.len());
                let element = field.element.clone();
                let node_side = declared.side;
                storages.push(Storage {
                    name,
                    element,
                    dims: declared.dims[port],
                    life,
                    home: node_side,
                    slots: [None; 2],
                });
            }
        }
    }
    let mut bindings = Vec::new();
    for (index, node) in graph.nodes.iter().enumerate() {
        let mut of_node = Vec::new();
        for (port, declared) in node.declaration().ports.iter().enumerate() {
            let at = PortRef { node: index, port };
            let source =
                if declared.is_input() { node.sources[port].map(|at| graph.root(at)) } else { Some(at) };
            let previous = declared.access == Access::History;
            let of_port: Vec<Option<Copy>> = declared
                .fields
                .iter()
                .map(|field| {
                    let storage = of_field[&(source?, field.name.to_string())];
                    Some(Copy { storage, previous })
                })
                .collect();
            if previous {
                for copy in of_port.iter().flatten() {
                    storages[copy.storage].life = Life::History;
                }
            }
            of_node.push(of_port);
        }
        bindings.push(of_node);
    }
    (storages, bindings)
}

/// All fields of the tapped ports, whichever of them the tapped node itself uses.
fn taps(graph: &Graph, bindings: &Bindings) -> Vec<Tap> {
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
                .zip(&bindings[root.node][root.port])
                .filter_map(|(field, copy)| Some((field.name.to_string(), (*copy)?.storage)))
                .collect();
            Tap { name, at, fields }
        })
        .collect()
}

/// For each node, the storages of its ports with that access.
fn with_access(graph: &Graph, bindings: &Bindings, access: Access) -> Vec<Vec<usize>> {
    let of_node = |node: usize| {
        let ports = graph.nodes[node].declaration().ports.iter().zip(&bindings[node]);
        ports
            .filter(|(port, _)| port.access == access)
            .flat_map(|(_, copies)| copies.iter().flatten().map(|copy| copy.storage))
            .collect()
    };
    (0..graph.nodes.len()).map(of_node).collect()
}

/// Which nodes may be skipped; their outputs become kept ones. A node that changes something in place must do so in every
/// frame, and so must one whose outputs of the last frame are read, because these swap.
fn per_view(
    graph: &Graph,
    first_writes: &[Vec<usize>],
    updates: &[Vec<usize>],
    storages: &mut [Storage],
    prune: bool,
) -> Vec<bool> {
    let mut per_view = vec![false; graph.nodes.len()];
    for (node, declared) in graph.nodes.iter().enumerate() {
        let written = &first_writes[node];
        let swaps = written.iter().any(|&storage| storages[storage].life == Life::History);
        if prune && declared.declaration().per_view && updates[node].is_empty() && !swaps {
            written.iter().for_each(|&storage| storages[storage].life = Life::Persistent);
            per_view[node] = true;
        }
    }
    per_view
}

/// Which sides hold a storage's present contents.
#[derive(Clone, Copy, Default)]
struct Valid([bool; 2]);

/// The nodes in order, with transfers where a side lacks what it reads. A storage that lives on begins a frame valid
/// where the last frame left it valid, so the walk is done twice: the first one finds that out.
fn steps(
    graph: &Graph,
    order: &[usize],
    bindings: &Bindings,
    storages: &mut [Storage],
    taps: &[Tap],
) -> Vec<Step> {
    let mut end = vec![Valid([true, true]); storages.len()];
    let mut steps = Vec::new();
    for _ in 0..3 {
        let mut now: Vec<Valid> = storages
            .iter()
            .zip(&end)
            .map(|(storage, end)| if storage.life == Life::Persistent { *end } else { Valid::default() })
            .collect();
        let mut previous = end.clone();
        steps.clear();
        for &node in order {
            let side = graph.nodes[node].side;
            let declaration = graph.nodes[node].declaration();
            let ports = declaration.ports.iter().zip(&bindings[node]);
            // A stage that only owns kept memory touches it on neither side.
            let ports = ports.filter(|(port, _)| !declaration.idle || port.lifetime == Lifetime::Transient);
            for (port, copies) in ports.clone() {
                if port.access == Access::Write && port.lifetime == Lifetime::Transient {
                    continue;
                }
                for copy in copies.iter().flatten() {
                    let valid = if copy.previous { &mut previous } else { &mut now };
                    let valid = &mut valid[copy.storage].0;
                    if valid[side as usize] {
                        continue;
                    }
                    valid[side as usize] = true;
                    steps.push(match side {
                        Side::Gpu => Step::Upload(*copy),
                        Side::Cpu => Step::Download(*copy, graph.nodes[node].download),
                    });
                }
            }
            steps.push(Step::Run(node));
            for (port, copies) in ports {
                if matches!(port.access, Access::Write | Access::Update) {
                    for copy in copies.iter().flatten() {
                        let mut valid = Valid::default();
                        valid.0[side as usize] = true;
                        now[copy.storage] = valid;
                    }
                }
            }
            for (index, tap) in taps.iter().enumerate().filter(|(_, tap)| tap.at.node == node) {
                steps.extend((0..tap.fields.len()).map(|field| Step::Tap(index, field)));
            }
        }
        end = now;
    }
    for (storage, valid) in storages.iter_mut().zip(end) {
        storage.home = if valid.0[Side::Cpu as usize] { Side::Cpu } else { Side::Gpu };
    }
    steps
}

/// Where a tap finds a storage: on the side of the node it taps.
pub(crate) fn tap_side(plan: &Plan, tap: usize) -> Side {
    plan.nodes[plan.taps[tap].at.node].2
}

/// Gives memory to every storage on every side that uses it. Transients with equal descriptions share a slot when their
/// first and last uses do not overlap.
fn slots(
    steps: &[Step],
    bindings: &Bindings,
    graph: &Graph,
    storages: &mut [Storage],
    taps: &[Tap],
    pooling: bool,
) -> [Vec<Slot>; 2] {
    let mut uses: [BTreeMap<usize, (usize, usize)>; 2] = Default::default();
    let mut touch = |side: Side, storage: usize, at: usize| {
        let span = uses[side as usize].entry(storage).or_insert((at, at));
        span.1 = at;
    };
    for (at, step) in steps.iter().enumerate() {
        match step {
            Step::Run(node) if graph.nodes[*node].declaration().idle => {}
            Step::Run(node) => {
                for copy in bindings[*node].iter().flatten().flatten() {
                    touch(graph.nodes[*node].side, copy.storage, at);
                }
            }
            Step::Upload(copy) | Step::Download(copy, _) => {
                touch(Side::Cpu, copy.storage, at);
                touch(Side::Gpu, copy.storage, at);
            }
            Step::Tap(tap, field) => {
                let side = graph.nodes[taps[*tap].at.node].side;
                touch(side, taps[*tap].fields[*field].1, at);
            }
        }
    }
    let mut all: [Vec<Slot>; 2] = Default::default();
    for side in [Side::Cpu, Side::Gpu] {
        let slots = &mut all[side as usize];
        let mut by_start: Vec<(usize, usize, usize)> =
            uses[side as usize].iter().map(|(&storage, &(start, end))| (start, end, storage)).collect();
        by_start.sort_unstable();
        // The last step at which each pooled slot is in use.
        let mut busy_until: Vec<(usize, usize)> = Vec::new();
        for (start, end, index) in by_start {
            let storage = &mut storages[index];
            let pair = match storage.life {
                Life::Persistent => [add_slot(slots, storage); 2],
                Life::History => [add_slot(slots, storage), add_slot(slots, storage)],
                Life::Transient => {
                    let free = busy_until.iter_mut().find(|(slot, until)| {
                        let fits =
                            slots[*slot].element == storage.element && slots[*slot].dims == storage.dims;
                        pooling && fits && *until < start
                    });
                    match free {
                        Some((slot, until)) => {
                            *until = end;
                            [*slot; 2]
                        }
                        None => {
                            let slot = add_slot(slots, storage);
                            busy_until.push((slot, end));
                            [slot; 2]
                        }
                    }
                }
            };
            storage.slots[side as usize] = Some(pair);
        }
    }
    all
}

/// A slot of its own for a storage; its index.
fn add_slot(slots: &mut Vec<Slot>, storage: &Storage) -> usize {
    slots.push(Slot { element: storage.element.clone(), dims: storage.dims });
    slots.len() - 1
}
