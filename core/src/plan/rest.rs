//! Which nodes may be skipped, and what is kept for that.
//!
//! A node that runs per view ([`Runs::PerView`]) is skipped while its inputs and the view are unchanged. What its inputs
//! follow from in the end, through other such nodes, are its *origins*. A reader that has no origins but the writer's is
//! skipped whenever the writer is. If all readers are like that, the output needs no memory of its own: while the
//! writer is skipped, nobody looks at it. Otherwise it is kept from frame to frame.
//!
//! A writer with fewer origins than a reader may be woken by those that it lacks
//! ([`PlannedNode::wakes`](super::PlannedNode::wakes)): it then runs whenever the reader does, and the output need not be
//! kept either. That is done where it costs next to no time: if the missing origins seldom change
//! ([`Io::seldom`](crate::Io::seldom)), or if the node that writes them writes other origins of the writer as well. They
//! must be there before the writer's turn.
//!
//! Such a reader may also change the output in place, on the same side, as then all of them are skipped, or all run, in
//! order. If another node changes the output, or reads it before it is changed, the writer runs in every frame.

use std::collections::{BTreeSet, HashMap};

use index_vec::IndexVec;

use super::{Life, Nodes, Storages, Value};
use crate::{
    graph::Graph,
    id::{NodeId, StorageId},
    port::Access,
    side::{Download, PerSide, Side},
    stage::Runs,
};

/// A node with more origins counts as one with unknown ones, so that large graphs take time and memory in proportion to
/// their nodes.
const MOST_ORIGINS: usize = 64;

/// Contents that may change while the view does not.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Origin {
    /// What a node writes in this frame.
    Written(NodeId, StorageId),
    /// What a storage holds since the frame before.
    Before(StorageId),
    /// What came late from the GPU.
    Late(StorageId),
}

type Origins = BTreeSet<Origin>;

/// What a storage holds at some place in the order.
#[derive(Clone, Default)]
struct Contents {
    /// What it follows from, on the sides that hold it.
    origins: PerSide<Option<Origins>>,
    /// The node that wrote it, if that may be skipped.
    writer: Option<NodeId>,
    /// Whether it is read while the writer is skipped.
    needed: bool,
}

impl Contents {
    /// What a value follows from, for a node on one side; `late`: that side gets the GPU's values later.
    fn origins(&self, value: Value, side: Side, late: bool) -> Origins {
        let alone = if late { Origin::Late(value.storage) } else { Origin::Before(value.storage) };
        if value.previous {
            return [alone].into();
        }
        let elsewhere = &self.origins[side.other()];
        let transferred = || elsewhere.clone().filter(|_| !late).unwrap_or_else(|| [alone].into());
        self.origins[side].clone().unwrap_or_else(transferred)
    }
}

/// Lets nodes run in every frame that must, and keeps what is read while its writer is skipped.
pub(super) fn rest(graph: &Graph, order: &[NodeId], nodes: &mut Nodes, storages: &mut Storages) {
    loop {
        let Walk { needed, spoilt, mut wakes, .. } = Walk::new(graph, order, nodes, storages);
        wakes.retain(|&(storage, writer, _)| !needed.contains(&(storage, writer)));
        if spoilt.is_empty() && wakes.is_empty() {
            for (storage, _) in needed {
                if storages[storage].life == Life::Transient {
                    storages[storage].life = Life::Persistent;
                }
            }
            return;
        }
        for node in spoilt {
            nodes[node].runs = Runs::Always;
            nodes[node].wakes.clear();
        }
        let news: BTreeSet<_> = wakes.into_iter().map(|(_, node, by)| (node, by)).collect();
        for (node, by) in news {
            if nodes[node].runs == Runs::PerView && !nodes[node].wakes.contains(&by) {
                nodes[node].wakes.push(by);
            }
        }
    }
}

/// What a walk along the order finds.
struct Walk {
    contents: IndexVec<StorageId, Contents>,
    /// What each node that runs per view follows from, if that is known.
    origins: IndexVec<NodeId, Option<Origins>>,
    /// What is read while its writer is skipped: storages with writers.
    needed: BTreeSet<(StorageId, NodeId)>,
    /// Nodes that may not be skipped, because their outputs are changed in place.
    spoilt: BTreeSet<NodeId>,
    /// What need not be kept if these contents, on a side, wake its writer.
    wakes: BTreeSet<(StorageId, NodeId, (StorageId, Side))>,
    /// For each storage: the nodes that have written it so far, with their places in the order.
    writers: IndexVec<StorageId, Vec<(usize, NodeId)>>,
    /// The places of the nodes that have run so far.
    places: HashMap<NodeId, usize>,
}

impl Walk {
    fn new(graph: &Graph, order: &[NodeId], nodes: &Nodes, storages: &Storages) -> Self {
        let mut walk = Self {
            contents: storages.iter().map(|_| Contents::default()).collect(),
            origins: nodes.iter().map(|_| None).collect(),
            needed: BTreeSet::new(),
            spoilt: BTreeSet::new(),
            wakes: BTreeSet::new(),
            writers: storages.iter().map(|_| Vec::new()).collect(),
            places: HashMap::new(),
        };
        let taps = || graph.taps.iter().map(|(_, at)| at).chain(graph.outputs.iter().map(|(_, at)| at));
        let mut tapped: IndexVec<NodeId, Vec<Value>> = nodes.iter().map(|_| Vec::new()).collect();
        for at in taps() {
            let root = graph.root(*at);
            tapped[at.node].extend(nodes[root.node].bindings[root.port].iter().flatten());
        }
        for &node in order {
            if !graph.nodes[node].declaration().idle {
                walk.run(graph, nodes, storages, node);
            }
            tapped[node].iter().for_each(|value| walk.read(graph, nodes, value.storage, None));
        }
        walk
    }

    fn run(&mut self, graph: &Graph, nodes: &Nodes, storages: &Storages, node: NodeId) {
        let (planned, declaration) = (&nodes[node], graph.nodes[node].declaration());
        let late = planned.side == Side::Cpu && graph.nodes[node].download != Download::Sync;
        let inputs = declaration.ports.iter().zip(&planned.bindings);
        let inputs = inputs.filter(|(port, _)| port.access != Access::Write);
        let inputs: Vec<Value> = inputs.flat_map(|(_, values)| values.iter().flatten().copied()).collect();

        let mut origins = Origins::new();
        for &value in &inputs {
            origins.append(&mut self.contents[value.storage].origins(value, planned.side, late));
        }
        for &(storage, side) in &planned.wakes {
            origins.append(&mut self.contents[storage].origins(Value::now(storage), side, false));
        }
        let per_view = planned.runs == Runs::PerView;
        let origins = (per_view && origins.len() <= MOST_ORIGINS).then_some(origins);
        // It fills both slots of an output with history, so it runs once more while its writers are skipped.
        let repeats = planned.first_writes.iter().any(|&storage| storages[storage].life == Life::History);
        let skipped_for = origins.as_ref().filter(|_| !repeats);
        inputs.iter().filter(|value| !value.previous).for_each(|value| {
            self.read(graph, nodes, value.storage, skipped_for);
        });
        for storage in &planned.updates {
            let &Contents { writer, needed, .. } = &self.contents[*storage];
            self.spoilt.extend(writer.filter(|writer| needed || nodes[*writer].side != planned.side));
        }
        let place = self.places.len();
        self.places.insert(node, place);
        for storage in planned.written() {
            self.writers[storage].push((place, node));
            let own = || [Origin::Written(node, storage)].into();
            let mut written = Contents::default();
            written.origins[planned.side] = Some(origins.clone().unwrap_or_else(own));
            let skippable =
                per_view || planned.runs != Runs::Always && planned.first_writes.contains(&storage);
            written.writer = skippable.then_some(node);
            self.contents[storage] = written;
        }
        self.origins[node] = origins;
    }

    /// A node, with what it follows from if it runs per view, reads what a storage holds.
    fn read(&mut self, graph: &Graph, nodes: &Nodes, storage: StorageId, reader: Option<&Origins>) {
        let Some(writer) = self.contents[storage].writer else { return };
        let missing: Option<Origins> = match (reader, &self.origins[writer]) {
            (Some(reader), Some(of_writer)) => Some(reader.difference(of_writer).copied().collect()),
            _ => None,
        };
        let waking = |origin| self.waking(graph, nodes, writer, origin);
        let wakes = missing.and_then(|missing| missing.into_iter().map(waking).collect::<Option<Vec<_>>>());
        match wakes {
            Some(wakes) => self.wakes.extend(wakes.into_iter().map(|by| (storage, writer, by))),
            None => {
                self.contents[storage].needed = true;
                self.needed.insert((storage, writer));
            }
        }
    }

    /// The contents by which an origin wakes a node that runs per view; `None` if it cannot, or should not.
    fn waking(
        &self,
        graph: &Graph,
        nodes: &Nodes,
        node: NodeId,
        origin: Origin,
    ) -> Option<(StorageId, Side)> {
        let Origin::Written(source, storage) = origin else { return None };
        let of_source = |origin: &Origin| matches!(origin, Origin::Written(other, _) if *other == source);
        let known = self.origins[node].as_ref().is_some_and(|origins| origins.iter().any(of_source));
        // What the node finds there must be what the source wrote.
        let place = self.places[&node];
        let last = self.writers[storage].iter().rfind(|(at, _)| *at < place);
        let is_there = last.is_some_and(|(_, writer)| *writer == source);
        let is_cheap = known || graph.nodes[source].declaration().seldom;
        (is_there && is_cheap).then_some((storage, nodes[source].side))
    }
}
