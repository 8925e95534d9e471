//! Which contents of each storage each side holds, as version numbers: a write makes a new one, a transfer copies it.
//! Work that would repeat with the same numbers is skipped: transfers of kept memory, and nodes that depend only on
//! their inputs and the view (see [`Io::per_view`](crate::Io::per_view)).

use std::ops::Range;

use index_vec::IndexVec;

use crate::{
    frame::View,
    id::{NodeId, StorageId},
    plan::{Life, Plan},
    port::FieldRef,
    side::{PerSide, Side},
    stage::Changes,
};

/// The version numbers of a plan's contents.
pub(super) struct Versions {
    /// The last number used.
    last: u64,
    /// For each storage: what each side holds.
    held: IndexVec<StorageId, PerSide<u64>>,
    /// For each storage: the elements in which the CPU's contents differ from the GPU's, if that is known.
    differ: IndexVec<StorageId, Vec<Range<usize>>>,
    view: View,
    view_version: u64,
    /// For each node that may be skipped, as of its last run: the number of the view, then those of everything it reads
    /// and writes. Empty before its first run.
    seen: IndexVec<NodeId, Vec<u64>>,
}

impl Versions {
    /// At the start, nothing is known to be equal on both sides.
    pub fn new(plan: &Plan) -> Self {
        let seen = plan
            .nodes
            .iter()
            .map(|node| Vec::with_capacity(if node.per_view { 1 + node.values().count() } else { 0 }));
        Self {
            last: 1,
            held: plan.storages.iter().map(|_| PerSide { cpu: 0, gpu: 1 }).collect(),
            differ: plan.storages.iter().map(|_| Vec::new()).collect(),
            view: View::default(),
            view_version: 0,
            seen: seen.collect(),
        }
    }

    fn next(&mut self) -> u64 {
        self.last += 1;
        self.last
    }

    /// Forgets everything, as after a failed frame: each side may hold anything, so the next frame does all transfers
    /// and runs all nodes.
    pub fn forget(&mut self) {
        for storage in self.held.indices() {
            let [cpu, gpu] = [self.next(), self.next()];
            self.held[storage] = PerSide { cpu, gpu };
        }
        self.differ.iter_mut().for_each(Vec::clear);
        self.seen.iter_mut().for_each(Vec::clear);
    }

    /// Begins a frame. Views are equal if their bits are.
    pub fn begin(&mut self, view: &View) {
        if bytemuck::bytes_of(view) != bytemuck::bytes_of(&self.view) {
            self.view = *view;
            self.view_version = self.next();
        }
    }

    /// Whether a node may be skipped because its outputs already hold what it would write.
    pub fn is_current(&self, plan: &Plan, node: NodeId) -> bool {
        plan.nodes[node].per_view && self.state(plan, node).eq(self.seen[node].iter().copied())
    }

    /// The numbers of the view and of everything a node reads and writes. Its outputs are included: another node may
    /// have changed them in place, or the caller replaced them.
    fn state<'a>(&'a self, plan: &'a Plan, node: NodeId) -> impl Iterator<Item = u64> + 'a {
        let node = &plan.nodes[node];
        let held = node.values().map(|value| self.held[value.storage][node.side]);
        std::iter::once(self.view_version).chain(held)
    }

    /// Records that a node ran and wrote everything except what it reports of its kept fields as unchanged.
    pub fn ran(&mut self, plan: &Plan, node: NodeId, changes: &Changes) {
        let planned = &plan.nodes[node];
        let is = |field: &FieldRef| planned.value(*field).map(|value| value.storage);
        for storage in planned.written() {
            let kept = plan.storages[storage].life == Life::Persistent;
            if kept && changes.unchanged.iter().any(|field| is(field) == Some(storage)) {
                continue;
            }
            let ranges = changes.ranges.iter().filter(|(field, _)| kept && is(field) == Some(storage));
            let differ = &mut self.differ[storage];
            let mut known = ranges.map(|(_, range)| range.clone()).peekable();
            let PerSide { cpu, gpu } = self.held[storage];
            if known.peek().is_none() || planned.side == Side::Gpu {
                differ.clear();
            } else if cpu == gpu || !differ.is_empty() {
                differ.extend(known);
            }
            self.held[storage][planned.side] = self.next();
        }
        if planned.per_view {
            let mut seen = std::mem::take(&mut self.seen[node]);
            seen.clear();
            seen.extend(self.state(plan, node));
            self.seen[node] = seen;
        }
    }

    /// Records a transfer; false if the side already holds the contents. A transient's memory is shared, and a history
    /// pair swaps: only kept memory still holds its old contents.
    pub fn transfer(&mut self, plan: &Plan, storage: StorageId, to: Side) -> bool {
        let held = &mut self.held[storage];
        let same = held.cpu == held.gpu;
        held[to] = held[to.other()];
        !(same && plan.storages[storage].life == Life::Persistent)
    }

    /// The elements to upload, after [`Versions::transfer`] to the GPU; empty for all.
    pub fn differing(&mut self, storage: StorageId) -> std::vec::Drain<'_, Range<usize>> {
        self.differ[storage].drain(..)
    }

    /// Records that a side received the contents of some earlier frame.
    pub fn late(&mut self, storage: StorageId, to: Side) {
        self.held[storage][to] = self.next();
        self.differ[storage].clear();
    }

    /// Records that a storage's contents were replaced on both sides.
    pub fn replaced(&mut self, storage: StorageId) {
        let next = self.next();
        self.held[storage] = PerSide { cpu: next, gpu: next };
        self.differ[storage].clear();
    }
}
