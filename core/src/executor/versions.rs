//! Which contents of each storage each side holds, as version numbers: contents with equal numbers are equal. A write
//! makes a new number, a transfer copies it. Work that would repeat with the same numbers is skipped: transfers to a
//! side that holds the contents, and nodes that have nothing to do (see [`Runs`]).

use std::{collections::VecDeque, ops::Range};

use index_vec::{IndexVec, index_vec};

use crate::{
    frame::{Frame, View},
    id::{NodeId, StorageId},
    plan::{Life, Plan, PlannedNode, Value},
    port::FieldRef,
    side::{PerSide, Side},
    stage::{Changes, Runs},
};

/// The number of all contents that are reported as blank, and of a frame that may request no samples.
const BLANK: u64 = 0;

/// Whether a node has to run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Due {
    /// Its outputs will be new.
    Run,
    /// It writes what it wrote in its last run, for the second slot of an output with history.
    Repeat,
    /// Its outputs are what it would write.
    Skip,
}

/// The version numbers of a plan's contents.
pub(super) struct Versions {
    /// The last number used.
    last: u64,
    /// The lowest bit of the frame number: history pairs swap with it.
    parity: usize,
    /// For each storage: what each side holds, in the slots of even and of odd frames if it has history.
    held: IndexVec<StorageId, [PerSide<u64>; 2]>,
    /// For each storage: the elements in which the CPU's contents differ from the GPU's, if that is known.
    differ: IndexVec<StorageId, Vec<Range<usize>>>,
    /// For each storage: the numbers of the GPU's contents, this frame's or the last frame's, that are on their way to the
    /// CPU, oldest first.
    under_way: IndexVec<StorageId, [VecDeque<u64>; 2]>,
    views: [View; 2],
    view_version: u64,
    budget: u64,
    /// For each node that may be skipped: the numbers that [`Versions::state`] tells, as of its last run. Empty before
    /// its first run.
    seen: IndexVec<NodeId, Vec<u64>>,
    /// For each node that is run per view: the numbers of what it wrote in its last run.
    left: IndexVec<NodeId, Vec<u64>>,
    /// For each node: whether both slots of its outputs with history hold what it would write.
    repeated: IndexVec<NodeId, bool>,
    /// The state of the node that is looked at.
    state: Vec<u64>,
}

impl Versions {
    /// At the start, nothing is known to be equal on both sides.
    pub fn new(plan: &Plan) -> Self {
        let most = |node: &PlannedNode| 1 + node.values().count() + node.wakes.len();
        let numbers = || plan.nodes.iter().map(|node| Vec::with_capacity(most(node))).collect();
        Self {
            last: 2,
            parity: 0,
            held: index_vec![[PerSide { cpu: 1, gpu: 2 }; 2]; plan.storages.len()],
            differ: plan.storages.iter().map(|_| Vec::new()).collect(),
            under_way: plan.storages.iter().map(|_| [VecDeque::new(), VecDeque::new()]).collect(),
            views: [View::default(); 2],
            view_version: BLANK,
            budget: BLANK,
            seen: numbers(),
            left: numbers(),
            repeated: index_vec![false; plan.nodes.len()],
            state: Vec::with_capacity(plan.nodes.iter().map(most).max().unwrap_or(0)),
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
            for slot in 0..2 {
                let [cpu, gpu] = [self.next(), self.next()];
                self.held[storage][slot] = PerSide { cpu, gpu };
            }
        }
        self.differ.iter_mut().for_each(Vec::clear);
        self.under_way.iter_mut().flatten().for_each(VecDeque::clear);
        self.seen.iter_mut().for_each(Vec::clear);
    }

    /// Begins a frame. Views are equal if their bits are.
    pub fn begin(&mut self, frame: &Frame, parity: usize) {
        self.parity = parity;
        let views = [frame.view, frame.predicted];
        if bytemuck::bytes_of(&views) != bytemuck::bytes_of(&self.views) {
            self.views = views;
            self.view_version = self.next();
        }
        self.budget = if frame.samples == 0 { BLANK } else { self.next() };
    }

    /// The number of a value on one side.
    fn held(&mut self, plan: &Plan, value: Value, side: Side) -> &mut u64 {
        let slot = self.slot(plan, value);
        &mut self.held[value.storage][slot][side]
    }

    fn slot(&self, plan: &Plan, value: Value) -> usize {
        let history = plan.storages[value.storage].life == Life::History;
        if history { self.parity ^ usize::from(value.previous) } else { 0 }
    }

    /// Whether a node has to run in this frame. If not, what it writes has the numbers that its last run gave it, even
    /// if nodes that will be skipped too have changed it in place since.
    pub fn due(&mut self, plan: &Plan, node: NodeId) -> Due {
        let planned = &plan.nodes[node];
        self.note(plan, node);
        let same = match planned.runs {
            Runs::Always => false,
            Runs::PerView | Runs::PerChange(_) => self.state == self.seen[node],
            Runs::PerArrival(_) | Runs::PerBudget => self.state == [BLANK] && self.seen[node] == [BLANK],
        };
        if !same {
            if planned.runs == Runs::PerView {
                self.seen[node].clone_from(&self.state);
            }
            return Due::Run;
        }
        if planned.runs == Runs::PerView {
            for (index, storage) in planned.written().enumerate() {
                *self.held(plan, Value::now(storage), planned.side) = self.left[node][index];
            }
        }
        let history = planned.written().any(|storage| plan.storages[storage].life == Life::History);
        if history && !self.repeated[node] { Due::Repeat } else { Due::Skip }
    }

    /// Writes into `state` the numbers that decide whether a node has to run.
    fn note(&mut self, plan: &Plan, node: NodeId) {
        let mut state = std::mem::take(&mut self.state);
        state.clear();
        let planned = &plan.nodes[node];
        let add = |value: Value| state.push(*self.held(plan, value, planned.side));
        match &planned.runs {
            Runs::Always => {}
            Runs::PerView => {
                let written =
                    |value: &Value| !value.previous && planned.first_writes.contains(&value.storage);
                planned.values().filter(|value| !written(value)).for_each(add);
                for &(storage, side) in &planned.wakes {
                    state.push(*self.held(plan, Value::now(storage), side));
                }
                state.push(self.view_version);
            }
            Runs::PerChange(fields) => {
                let own = |value: &Value| value.previous && planned.first_writes.contains(&value.storage);
                let values = fields.iter().filter_map(|field| planned.value(*field));
                values.filter(|value| !own(value)).for_each(add);
            }
            Runs::PerArrival(field) => planned.value(*field).into_iter().for_each(add),
            Runs::PerBudget => state.push(self.budget),
        }
        self.state = state;
    }

    /// Records that a node ran and wrote everything except what it reports of its kept fields as unchanged.
    pub fn ran(&mut self, plan: &Plan, node: NodeId, changes: &Changes, due: Due) {
        let planned = &plan.nodes[node];
        let per_view = planned.runs == Runs::PerView;
        self.repeated[node] = due == Due::Repeat;
        if due == Due::Repeat {
            let history = |storage: &StorageId| plan.storages[*storage].life == Life::History;
            for storage in planned.written().filter(|storage| !per_view && history(storage)) {
                let same = *self.held(plan, Value { storage, previous: true }, planned.side);
                *self.held(plan, Value::now(storage), planned.side) = same;
            }
            return;
        }
        let is = |field: &FieldRef| planned.value(*field).map(|value| value.storage);
        for storage in planned.written() {
            let reports = |fields: &[FieldRef]| fields.iter().any(|field| is(field) == Some(storage));
            let kept = plan.storages[storage].life == Life::Persistent;
            if kept && reports(&changes.unchanged) {
                continue;
            }
            let ranges = changes.ranges.iter().filter(|(field, _)| kept && is(field) == Some(storage));
            let slot = self.slot(plan, Value::now(storage));
            let PerSide { cpu, gpu } = self.held[storage][slot];
            let differ = &mut self.differ[storage];
            let mut known = ranges.map(|(_, range)| range.clone()).peekable();
            if known.peek().is_none() || planned.side == Side::Gpu {
                differ.clear();
            } else if cpu == gpu || !differ.is_empty() {
                differ.extend(known);
            }
            let number = if reports(&changes.blank) { BLANK } else { self.next() };
            self.held[storage][slot][planned.side] = number;
        }
        match planned.runs {
            Runs::Always => {}
            Runs::PerView => {
                let mut left = std::mem::take(&mut self.left[node]);
                left.clear();
                let written = planned.written();
                left.extend(written.map(|storage| *self.held(plan, Value::now(storage), planned.side)));
                self.left[node] = left;
            }
            Runs::PerChange(_) | Runs::PerArrival(_) | Runs::PerBudget => {
                self.note(plan, node);
                self.seen[node].clone_from(&self.state);
            }
        }
    }

    /// Records a transfer; false if the side already holds the contents. The memory of a transient that has not been
    /// written in this frame may hold anything, but then those that read it are skipped.
    pub fn transfer(&mut self, plan: &Plan, value: Value, to: Side) -> bool {
        let slot = self.slot(plan, value);
        let held = &mut self.held[value.storage][slot];
        let same = held.cpu == held.gpu;
        held[to] = held[to.other()];
        !same
    }

    /// The elements to upload, after [`Versions::transfer`] to the GPU; empty for all.
    pub fn differing(&mut self, storage: StorageId) -> std::vec::Drain<'_, Range<usize>> {
        self.differ[storage].drain(..)
    }

    /// Records that the CPU receives what the GPU held some frames ago. False if this frame's contents need not be sent:
    /// they are those of the frame before, and nothing but what arrives changes them on the CPU.
    pub fn late(&mut self, plan: &Plan, value: Value, frames: u32) -> bool {
        let storage = value.storage;
        let now = *self.held(plan, value, Side::Gpu);
        let queue = &mut self.under_way[storage][usize::from(value.previous)];
        let same = queue.back() == Some(&now);
        queue.push_back(now);
        let arrived = if queue.len() > frames as usize { queue.pop_front() } else { None };
        let arrived = arrived.unwrap_or_else(|| self.next());
        *self.held(plan, value, Side::Cpu) = arrived;
        self.differ[storage].clear();
        let changed = |node: &PlannedNode| node.side == Side::Cpu && node.updates.contains(&storage);
        let stays = plan.storages[storage].life == Life::Persistent && !plan.nodes.iter().any(changed);
        !(same && stays)
    }

    /// Records that a storage's contents were replaced on both sides.
    pub fn replaced(&mut self, storage: StorageId) {
        let next = self.next();
        self.held[storage] = [PerSide { cpu: next, gpu: next }; 2];
        self.differ[storage].clear();
        self.under_way[storage].iter_mut().for_each(VecDeque::clear);
        self.seen.iter_mut().for_each(Vec::clear);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        CpuContext, Facts, GraphFile, In, Registry, Settings,
        compile::compile,
        port::Extent,
        stage::{Io, Stage},
    };

    /// A stage that does nothing, with its declaration.
    macro_rules! stage {
        ($stage:ident, $kind:literal, |$io:ident| $declare:expr) => {
            struct $stage;
            impl Stage for $stage {
                const KIND: &'static str = $kind;
                const DOC: &'static str = "Does nothing.";
                type Params = ();
                fn declare((): &(), $io: &mut Io) -> Self {
                    $declare;
                    Self
                }
                fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
                    Ok(())
                }
            }
        };
    }
    stage!(Sum, "sum", |io| {
        io.per_budget();
        io.history::<u32>("before", "its output", Extent::Frame(1));
        io.write::<u32>("sum", "numbers", Extent::Frame(1));
    });
    stage!(See, "see", |io| {
        io.per_view();
        io.read::<u32>("sum", "numbers", Extent::Frame(1));
        io.write::<u32>("seen", "numbers", Extent::Frame(1));
    });
    stage!(Wait, "wait", |io| {
        let before: In<u32> = io.history("before", "last frame's numbers", Extent::Frame(1));
        io.per_change([before.into()]);
        io.write::<u32>("waited", "numbers", Extent::Frame(1));
    });
    stage!(Both, "both", |io| {
        io.read::<u32>("seen", "numbers", Extent::Frame(1));
        io.read::<u32>("waited", "numbers", Extent::Frame(1));
        io.write::<u32>("out", "numbers", Extent::Frame(1));
    });

    fn plan(text: &str, registry: &Registry, samples: u32) -> Plan {
        let file = GraphFile::parse("test.ron", text).unwrap();
        compile(&file, registry, &Settings::new([4, 4], samples, Facts::none())).unwrap().1
    }

    const GRAPH: &str = r#"Graph(version: 1, nodes: {
        "sum": (kind: "sum", inputs: { "before": "sum.sum" }),
        "see": (kind: "see", inputs: { "sum": "sum.sum" }),
        "wait": (kind: "wait", inputs: { "before": "sum.sum" }),
        "both": (kind: "both", inputs: { "seen": "see.seen", "waited": "wait.waited" }),
    }, outputs: { "image": "both.out" })"#;

    #[test]
    fn what_a_frame_without_samples_leaves_has_the_numbers_of_the_frame_before() {
        use Due::{Repeat, Run, Skip};
        let registry = Registry::default().with::<Sum>().with::<See>().with::<Wait>().with::<Both>();
        let plan = plan(GRAPH, &registry, 1);
        let mut versions = Versions::new(&plan);
        let node = |name| plan.nodes.position(|node| node.name == name).unwrap();
        let sum = plan.nodes[node("sum")].first_writes[0];
        // One sample is a budget. `sum` runs once more without; `wait` sees its last frame.
        for (index, samples, expected) in [
            (0, 1, [Run, Run, Run]),
            (1, 1, [Run, Run, Run]),
            (2, 0, [Run, Run, Run]),
            (3, 0, [Repeat, Skip, Run]),
            (4, 0, [Skip, Skip, Skip]),
            (5, 0, [Skip, Skip, Skip]),
        ] {
            versions.begin(&Frame { index, samples, ..Frame::default() }, index as usize & 1);
            let due = ["sum", "see", "wait"].map(|name| {
                let due = versions.due(&plan, node(name));
                if due != Skip {
                    versions.ran(&plan, node(name), &Changes::default(), due);
                }
                due
            });
            assert!(due == expected, "frame {index}");
            // Contents are sent once.
            let sent = [0, 1].map(|_| versions.transfer(&plan, Value::now(sum), Side::Gpu));
            assert_eq!(sent, [index < 4, false], "frame {index}");
        }
        // After a failure nothing is known, of both slots.
        versions.forget();
        for parity in [0, 1] {
            versions.begin(&Frame::default(), parity);
            assert!(["sum", "see", "wait"].into_iter().all(|name| versions.due(&plan, node(name)) == Run));
            assert!(versions.transfer(&plan, Value::now(sum), Side::Gpu));
        }
    }

    stage!(Grow, "grow", |io| {
        let list = io.update::<u32>("list", "changed in place", Extent::Any);
        io.per_change([list.into()]);
    });
    stage!(Add, "add", |io| {
        io.update::<u32>("list", "changed in place", Extent::Any);
        io.per_budget();
    });

    #[test]
    fn what_a_node_left_itself_is_no_change() {
        let registry = Registry::default().with::<Keep>().with::<Grow>().with::<Add>();
        let text = r#"Graph(version: 1, nodes: {
            "keep": (kind: "keep"),
            "add": (kind: "add", inputs: { "list": "keep.one" }),
            "grow": (kind: "grow", inputs: { "list": "add.list" }),
        }, outputs: { "image": "grow.list" })"#;
        let plan = plan(text, &registry, 0);
        let mut versions = Versions::new(&plan);
        let [add, grow] = ["add", "grow"].map(|name| plan.nodes.position(|node| node.name == name).unwrap());
        // `add` changes the list while there are samples, and in the first frame without.
        for (index, samples, expected) in [
            (0, 1, true),
            (1, 1, true),
            (2, 0, true),
            (3, 0, false),
            (4, 0, false),
            (5, 1, true),
            (6, 0, true),
        ] {
            versions.begin(&Frame { index, samples, ..Frame::default() }, index as usize & 1);
            for node in [add, grow] {
                let due = versions.due(&plan, node);
                assert_eq!(due == Due::Run, expected, "frame {index}");
                if due == Due::Run {
                    versions.ran(&plan, node, &Changes::default(), due);
                }
            }
        }
    }

    stage!(Keep, "keep", |io| {
        io.persistent::<u32>("one", "numbers", Extent::Frame(1));
        io.persistent::<u32>("other", "numbers", Extent::Frame(1));
    });
    stage!(Take, "take", |io| {
        io.read::<u32>("one", "numbers", Extent::Frame(1));
        io.read::<u32>("other", "numbers", Extent::Frame(1));
        io.write::<u32>("out", "numbers", Extent::Frame(1));
    });

    #[test]
    fn elements_that_changed_are_those_of_the_field_that_is_named() {
        let registry = Registry::default().with::<Keep>().with::<Take>();
        let text = r#"Graph(version: 1, nodes: {
            "keep": (kind: "keep"),
            "take": (kind: "take", inputs: { "one": "keep.one", "other": "keep.other" }),
        }, outputs: { "image": "take.out" })"#;
        let plan = plan(text, &registry, 0);
        let mut versions = Versions::new(&plan);
        let keep = plan.nodes.position(|node| node.name == "keep").unwrap();
        let [one, other] = [0, 1].map(|at| plan.nodes[keep].first_writes[at]);
        versions.begin(&Frame::default(), 0);
        versions.ran(&plan, keep, &Changes::default(), Due::Run);
        for storage in [one, other] {
            versions.transfer(&plan, Value::now(storage), Side::Gpu);
        }
        // Then some of `one` change, and all of `other`.
        let changes = Changes { ranges: vec![(FieldRef { port: 0, field: 0 }, 3..5)], ..Changes::default() };
        versions.ran(&plan, keep, &changes, Due::Run);
        assert!(versions.differing(one).eq(std::iter::once(3..5)));
        assert_eq!(versions.differing(other).count(), 0);
    }
}
