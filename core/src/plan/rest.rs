//! Which nodes may be skipped, and what is kept for that.
//!
//! A node that runs per view ([`Runs::PerView`]) is skipped while its inputs and the view are unchanged. What its inputs
//! follow from in the end, through other such nodes, are its *origins*. A reader that has no origins but the writer's is
//! skipped whenever the writer is. If all readers are like that, the output needs no memory of its own: while the
//! writer is skipped, nobody looks at it. Otherwise it is kept from frame to frame.
//!
//! Such a reader may also change the output in place, on the same side, as then all of them are skipped, or all run, in
//! order. If another node changes the output, or reads it before it is changed, the writer runs in every frame.

use std::collections::BTreeSet;

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
    fn origins(&mut self, value: Value, side: Side, late: bool) -> Origins {
        let alone = if late { Origin::Late(value.storage) } else { Origin::Before(value.storage) };
        if value.previous {
            return [alone].into();
        }
        let elsewhere = &self.origins[side.other()];
        let transferred = || elsewhere.clone().filter(|_| !late).unwrap_or_else(|| [alone].into());
        let origins = self.origins[side].clone().unwrap_or_else(transferred);
        self.origins[side] = Some(origins.clone());
        origins
    }
}

/// Lets nodes run in every frame that must, and keeps what is read while its writer is skipped.
pub(super) fn rest(graph: &Graph, order: &[NodeId], nodes: &mut Nodes, storages: &mut Storages) {
    loop {
        let Walk { needed, spoilt, .. } = Walk::new(graph, order, nodes, storages.len());
        if spoilt.is_empty() {
            for storage in needed {
                if storages[storage].life == Life::Transient {
                    storages[storage].life = Life::Persistent;
                }
            }
            return;
        }
        for node in spoilt {
            nodes[node].runs = Runs::Always;
        }
    }
}

/// What a walk along the order finds.
struct Walk {
    contents: IndexVec<StorageId, Contents>,
    /// What each node that runs per view follows from, if that is known.
    origins: IndexVec<NodeId, Option<Origins>>,
    /// Storages that are read while their writer is skipped.
    needed: BTreeSet<StorageId>,
    /// Nodes that may not be skipped, because their outputs are changed in place.
    spoilt: BTreeSet<NodeId>,
}

impl Walk {
    fn new(graph: &Graph, order: &[NodeId], nodes: &Nodes, storages: usize) -> Self {
        let mut walk = Self {
            contents: (0..storages).map(|_| Contents::default()).collect(),
            origins: nodes.iter().map(|_| None).collect(),
            needed: BTreeSet::new(),
            spoilt: BTreeSet::new(),
        };
        let taps = || graph.taps.iter().map(|(_, at)| at).chain(graph.outputs.iter().map(|(_, at)| at));
        let mut tapped: IndexVec<NodeId, Vec<Value>> = nodes.iter().map(|_| Vec::new()).collect();
        for at in taps() {
            let root = graph.root(*at);
            tapped[at.node].extend(nodes[root.node].bindings[root.port].iter().flatten());
        }
        for &node in order {
            if !graph.nodes[node].declaration().idle {
                walk.run(graph, nodes, node);
            }
            tapped[node].iter().for_each(|value| walk.read(value.storage, None));
        }
        walk
    }

    fn run(&mut self, graph: &Graph, nodes: &Nodes, node: NodeId) {
        let (planned, declaration) = (&nodes[node], graph.nodes[node].declaration());
        let late = planned.side == Side::Cpu && graph.nodes[node].download != Download::Sync;
        let inputs = declaration.ports.iter().zip(&planned.bindings);
        let inputs = inputs.filter(|(port, _)| port.access != Access::Write);
        let inputs: Vec<Value> = inputs.flat_map(|(_, values)| values.iter().flatten().copied()).collect();

        let mut origins = Origins::new();
        for &value in &inputs {
            origins.append(&mut self.contents[value.storage].origins(value, planned.side, late));
        }
        let per_view = planned.runs == Runs::PerView;
        let origins = (per_view && origins.len() <= MOST_ORIGINS).then_some(origins);
        inputs.iter().filter(|value| !value.previous).for_each(|value| {
            self.read(value.storage, origins.as_ref());
        });
        for storage in &planned.updates {
            let &Contents { writer, needed, .. } = &self.contents[*storage];
            self.spoilt.extend(writer.filter(|writer| needed || nodes[*writer].side != planned.side));
        }
        for storage in planned.written() {
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
    fn read(&mut self, storage: StorageId, reader: Option<&Origins>) {
        let contents = &mut self.contents[storage];
        let Some(writer) = contents.writer else { return };
        let skipped_with_it = match (reader, &self.origins[writer]) {
            (Some(reader), Some(writer)) => reader.is_subset(writer),
            _ => false,
        };
        if !skipped_with_it {
            contents.needed = true;
            self.needed.insert(storage);
        }
    }
}
