//! Which contents of each storage each side holds, as numbers: a write gives a new one, a transfer hands it on. What would
//! be done again with the same numbers is left out: transfers of kept memory, and nodes that follow from their inputs and
//! the view (see [`Io::per_view`](crate::Io::per_view)).

use crate::{
    file::Side,
    frame::View,
    plan::{Life, Plan},
    port::FieldRef,
};

/// The numbers of a plan's contents.
pub(super) struct Versions {
    /// The number given out last.
    last: u64,
    /// For each storage: what the CPU and the GPU hold.
    held: Vec<[u64; 2]>,
    view: View,
    view_version: u64,
    /// For each node that may be skipped, after its last run: the number of the view, then those of all that it works
    /// on. Empty before its first run.
    seen: Vec<Vec<u64>>,
}

impl Versions {
    /// Nothing is known to be the same on both sides yet.
    pub fn new(plan: &Plan) -> Self {
        let seen = (0..plan.nodes.len()).map(|node| {
            let fields = plan.bindings[node].iter().flatten().count();
            Vec::with_capacity(if plan.per_view[node] { 1 + fields } else { 0 })
        });
        Self {
            last: 1,
            held: vec![[0, 1]; plan.storages.len()],
            view: View::default(),
            view_version: 0,
            seen: seen.collect(),
        }
    }

    fn next(&mut self) -> u64 {
        self.last += 1;
        self.last
    }

    /// Begins a frame. Views are the same if their bits are.
    pub fn begin(&mut self, view: &View) {
        if bytemuck::bytes_of(view) != bytemuck::bytes_of(&self.view) {
            self.view = *view;
            self.view_version = self.next();
        }
    }

    /// Whether a node may be skipped because its outputs hold what it would write.
    pub fn is_current(&self, plan: &Plan, node: usize) -> bool {
        plan.per_view[node] && self.state(plan, node).eq(self.seen[node].iter().copied())
    }

    /// The numbers of the view and of all that a node works on. Its outputs are among them: somebody may have changed
    /// them in place or replaced them.
    fn state(&self, plan: &Plan, node: usize) -> impl Iterator<Item = u64> {
        let side = plan.nodes[node].2 as usize;
        let ports = plan.bindings[node].iter().flatten().flatten();
        std::iter::once(self.view_version).chain(ports.map(move |copy| self.held[copy.storage][side]))
    }

    /// Notes that a node ran and wrote everything but the kept fields that it says are unchanged.
    pub fn ran(&mut self, plan: &Plan, node: usize, unchanged: &[FieldRef]) {
        let side = plan.nodes[node].2 as usize;
        let bindings = &plan.bindings[node];
        let is =
            |field: &FieldRef| bindings[field.port as usize][field.field as usize].map(|copy| copy.storage);
        for &storage in plan.first_writes[node].iter().chain(&plan.updates[node]) {
            let kept = plan.storages[storage].life == Life::Persistent;
            if !(kept && unchanged.iter().any(|field| is(field) == Some(storage))) {
                self.held[storage][side] = self.next();
            }
        }
        if plan.per_view[node] {
            let mut seen = std::mem::take(&mut self.seen[node]);
            seen.clear();
            seen.extend(self.state(plan, node));
            self.seen[node] = seen;
        }
    }

    /// Notes a transfer; false where the side holds the contents already. A transient's memory is shared, and a history
    /// pair swaps: only kept memory still holds what it held.
    pub fn transfer(&mut self, plan: &Plan, storage: usize, to: Side) -> bool {
        let from = if to == Side::Cpu { Side::Gpu } else { Side::Cpu };
        let held = &mut self.held[storage];
        let same = held[to as usize] == held[from as usize];
        held[to as usize] = held[from as usize];
        !(same && plan.storages[storage].life == Life::Persistent)
    }

    /// Notes that a side was given contents of some earlier frame.
    pub fn late(&mut self, storage: usize, to: Side) {
        self.held[storage][to as usize] = self.next();
    }

    /// Notes that a storage's contents were replaced on both sides.
    pub fn replaced(&mut self, storage: usize) {
        self.held[storage] = [self.next(); 2];
    }
}
