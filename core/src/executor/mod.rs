//! Runs a plan, frame after frame.
//!
//! [`Executor::new`] makes all memory, pipelines and bind groups; a frame only walks the plan's steps. GPU steps are
//! recorded into one encoder that is submitted at the frame's end, or earlier where a CPU step must wait for a result.

mod device;
mod gpu;
mod programs;
mod readback;
mod versions;
mod watch;

use std::{
    cell::RefCell,
    collections::HashMap,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
    time::Instant,
};

pub use device::{AdapterChoice, Gpu};
use fearless_simd::Level;
pub(crate) use gpu::{GpuPass, Groups, Pipeline};
use gpu::{GpuSide, Layout, poison_word};
use index_vec::{IndexSlice, IndexVec, index_vec};
use readback::Readback;
use versions::{Due, Versions};
use watch::Watch;

use crate::{
    capture::Snapshot,
    frame::Frame,
    graph::{Graph, Node, PortRef, Settings},
    id::{NodeId, SlotId, StepId, StorageId, TapId},
    plan::{Life, Plan, PlannedNode, Slot, Step, Storage, TapField, Value},
    port::Element,
    registry::Registry,
    side::{Download, Side},
    stage::{Binding, Changes, CpuContext, CpuMemory, Host},
    watch::BadValue,
};

/// What to do where there is no GPU adapter.
pub const INSTALL_GPU: &str = "install a driver; for a software GPU on Debian or Ubuntu: apt-get install \
                               mesa-vulkan-drivers libvulkan1";

/// Errors while a plan is built or run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RunError {
    /// No adapter.
    #[error("no GPU adapter was found. Run with --backend cpu, or {}", INSTALL_GPU)]
    NoGpu,
    /// Out of memory, or a call that the device rejects.
    #[error("GPU: {0}")]
    Gpu(String),
    /// The device is lost with everything on it; another may be opened.
    #[error("the GPU was lost: {0}")]
    Lost(String),
    /// A stage failed.
    #[error("node `{node}`: {message}")]
    Stage {
        /// The node.
        node: String,
        /// The stage's message.
        message: String,
    },
    /// A node wrote a bad value: see [`Settings::watch`].
    #[error("{0}")]
    Watch(Box<BadValue>),
    /// Not enough main memory.
    #[error("not enough memory for {bytes} bytes of `{name}`; choose a smaller size")]
    Memory {
        /// The storage.
        name: String,
        /// Its size in bytes.
        bytes: u64,
    },
}

/// What memory is filled with before a node writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fill {
    /// Zeros.
    Zeros,
    /// NaN, or 0xDEADBEEF where not all is float.
    Poison,
}

impl Fill {
    fn of(settings: &Settings) -> Option<Self> {
        match settings {
            Settings { watch: true, .. } => Some(Self::Zeros),
            Settings { poison: true, .. } => Some(Self::Poison),
            _ => None,
        }
    }

    /// The 32-bit pattern for an element.
    fn word(self, element: &Element) -> u32 {
        match self {
            Self::Zeros => 0,
            Self::Poison => poison_word(element),
        }
    }
}

/// The bindings of a node's ports on the CPU, field by field.
type CpuBindings = Vec<Vec<Option<Binding>>>;

struct TapState {
    tap: TapId,
    storage: StorageId,
    snapshot: Snapshot,
    taken: bool,
    wanted: bool,
    ring: Option<Readback>,
}

/// A plan with its memory, ready to run.
pub struct Executor {
    graph: Graph,
    plan: Plan,
    fill: Option<Fill>,
    watch: Option<Watch>,
    cpu: IndexVec<SlotId, RefCell<CpuMemory>>,
    /// For even and odd frames.
    bindings: [IndexVec<NodeId, CpuBindings>; 2],
    gpu: Option<GpuSide>,
    taps: Vec<TapState>,
    times: IndexVec<StepId, f32>,
    starts: IndexVec<StepId, f32>,
    moved: IndexVec<StepId, u64>,
    versions: Versions,
    /// For even and odd frames: whether each node ran.
    ran: [IndexVec<NodeId, bool>; 2],
    changes: RefCell<Changes>,
    level: Level,
    step_of_node: HashMap<NodeId, StepId>,
    frame: u64,
    /// Measure each step. On a software GPU that means waiting after each.
    pub profile: bool,
}

impl Executor {
    /// Allocates and builds everything. `gpu` may be `None` for a plan that only uses the CPU.
    ///
    /// # Errors
    /// [`RunError::NoGpu`] if the plan needs a GPU and none is given, [`RunError::Memory`] and [`RunError::Gpu`] if
    /// memory does not suffice, [`RunError::Stage`] if a shader does not fit its stage.
    pub fn new(
        graph: Graph,
        plan: Plan,
        settings: &Settings,
        registry: &Registry,
        gpu: Option<Arc<Gpu>>,
    ) -> Result<Self, RunError> {
        let fill = Fill::of(settings);
        let watch = settings.watch.then(|| Watch::new(&graph, &plan, settings));
        let gpu = match (plan.uses(Side::Gpu), gpu) {
            (true, Some(gpu)) => {
                Some(GpuSide::new(gpu, &graph, &plan, &registry.library, fill, watch.as_ref())?)
            }
            (true, None) => return Err(RunError::NoGpu),
            (false, _) => None,
        };
        let cpu = allocate(&plan)?;
        let bindings = [0, 1].map(|parity| bindings(&graph, &plan, parity));
        let taps = tap_states(&plan, gpu.as_ref());
        let run_of = |(id, step): (StepId, &Step)| match step {
            Step::Run(node) => Some((*node, id)),
            _ => None,
        };
        let step_of_node = plan.steps.iter_enumerated().filter_map(run_of).collect();
        let times = index_vec![0.0; plan.steps.len()];
        let versions = Versions::new(&plan);
        let ran = [0, 1].map(|_| index_vec![false; plan.nodes.len()]);
        let most_fields = plan.nodes.iter().map(|node| node.values().count()).max().unwrap_or(0);
        let [unchanged, blank] = [0, 1].map(|_| Vec::with_capacity(most_fields));
        let changes = RefCell::new(Changes { unchanged, blank, ranges: Vec::new() });
        let mut executor = Self {
            graph,
            plan,
            fill,
            watch,
            cpu,
            bindings,
            gpu,
            taps,
            starts: times.clone(),
            moved: index_vec![0; times.len()],
            times,
            versions,
            ran,
            changes,
            level: if settings.vectors { Level::new() } else { Level::baseline() },
            step_of_node,
            frame: 0,
            profile: true,
        };
        for (name, numbers) in tables(&executor.graph) {
            executor.restore(&name, bytemuck::cast_slice(numbers));
        }
        Ok(executor)
    }

    /// The running graph.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The running plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Whether the GPU is in use and measures time itself.
    pub fn gpu_has_clock(&self) -> bool {
        self.gpu.as_ref().is_some_and(GpuSide::has_clock)
    }

    /// Duration in milliseconds of each of the plan's steps in the last frame. If the device measures time, GPU steps
    /// are those of the frame before it. Steps that are only recorded are zero.
    pub fn times(&self) -> &[f32] {
        self.times.as_raw_slice()
    }

    /// When each of the plan's steps began, in milliseconds since the frame began. On a GPU that measures time, the
    /// steps are those of the frame before, as in [`Executor::times`], relative to the first of them.
    pub fn starts(&self) -> &[f32] {
        self.starts.as_raw_slice()
    }

    /// Bytes that each of the plan's steps moved between CPU and GPU in the last frame: zero if the other side was up
    /// to date.
    pub fn moved(&self) -> &[u64] {
        self.moved.as_raw_slice()
    }

    /// For each of the plan's nodes: whether it ran in the last frame. Nodes that only own memory never run, and
    /// [`PlannedNode::runs`] says when others do.
    pub fn ran(&self) -> &IndexSlice<NodeId, [bool]> {
        &self.ran[self.parity() ^ 1]
    }

    /// The device, the frame's constants, and the passes that nodes recorded in the last frame. `None` if no node runs
    /// on a GPU.
    pub(crate) fn recorded(&self) -> Option<(&Arc<Gpu>, &wgpu::Buffer, Vec<GpuPass>)> {
        let side = self.gpu.as_ref()?;
        let ran = self.plan.order().filter(|node| self.ran()[*node]);
        let passes = ran.flat_map(|node| side.passes(node)).cloned().collect();
        Some((&side.gpu, side.constants(), passes))
    }

    /// The number of frames that have run.
    pub fn frames(&self) -> u64 {
        self.frame
    }

    /// Runs one frame. With `capture`, the tapped ports are copied as they pass; [`Executor::snapshots`] has them.
    ///
    /// # Errors
    /// [`RunError::Stage`] if a stage fails or panics, [`RunError::Gpu`] if the device rejects something. The next call
    /// runs a frame again: the failed frame does not count, so [`Executor::frames`] and the values that nodes read from
    /// the frame before are as if it had never begun. It is not undone, though. Kept values, on both sides, hold what
    /// the nodes before the failing one wrote, and perhaps part of what the failing one would have written. The next
    /// frame transfers everything and runs every node, even if nothing seems to have changed. Taps of nodes that ran
    /// show the failed frame, the others an earlier one.
    ///
    /// [`RunError::Watch`] if a node wrote a bad value and the run is watched. The frame has run to its end and counts.
    /// If a stage failed after the bad value, this error is returned all the same, but the frame is one that failed.
    ///
    /// [`RunError::Lost`] if the device is lost. Every further call then fails with it and does nothing.
    pub fn run(&mut self, frame: &Frame, host: &Host, capture: bool) -> Result<(), RunError> {
        if let Some(gpu) = &self.gpu {
            gpu.gpu.check_lost()?;
        }
        let done = self.steps(frame, host, capture).and_then(|()| self.end());
        match done {
            Ok(()) => self.frame += 1,
            Err(_) => self.abandon(),
        }
        match (self.bad_value(frame), done) {
            (Ok(Some(bad)), _) => Err(RunError::Watch(Box::new(bad))),
            (Ok(None), done) => done,
            (Err(error), done) => done.and(Err(error)),
        }
    }

    /// The first bad value of the frame that has just ended, if the run is watched.
    fn bad_value(&mut self, frame: &Frame) -> Result<Option<BadValue>, RunError> {
        let Some(watch) = &mut self.watch else { return Ok(None) };
        if let Some(gpu) = &mut self.gpu {
            gpu.found(watch, frame)?;
        }
        Ok(watch.take())
    }

    /// The lowest bit of the frame number: history pairs swap with it.
    fn parity(&self) -> usize {
        (self.frame % 2) as usize
    }

    /// Walks the plan's steps.
    fn steps(&mut self, frame: &Frame, host: &Host, capture: bool) -> Result<(), RunError> {
        let parity = self.parity();
        self.versions.begin(frame, parity);
        self.ran[parity].raw.fill(false);
        self.moved.raw.fill(0);
        let begin = Instant::now();
        if let Some(gpu) = &mut self.gpu {
            gpu.begin(frame);
        }
        for index in self.plan.steps.indices() {
            let start = self.profile.then(Instant::now);
            self.step(index, frame, host, parity, capture)?;
            self.finish_step(index)?;
            if let Some(start) = start {
                let on_device_clock = self.gpu_has_clock() && self.is_gpu_step(index);
                if !on_device_clock {
                    self.times[index] = start.elapsed().as_secs_f32() * 1000.0;
                    self.starts[index] = (start - begin).as_secs_f32() * 1000.0;
                }
            }
        }
        Ok(())
    }

    /// Submits the frame and reads the times of the frame before.
    fn end(&mut self) -> Result<(), RunError> {
        let parity = self.parity();
        let Some(gpu) = &mut self.gpu else { return Ok(()) };
        gpu.end(self.frame, self.profile)?;
        self.taps.iter_mut().filter_map(|tap| tap.ring.as_mut()).for_each(Readback::map);
        if self.profile && self.frame > 0 {
            let (times, starts) = (&mut self.times, &mut self.starts);
            let (step_of_node, nodes) = (&self.step_of_node, &self.plan.nodes);
            // A skipped node still has the timestamps of an earlier frame.
            let ran_before = &self.ran[parity ^ 1];
            let on_gpu = |node: NodeId| nodes[node].side == Side::Gpu;
            gpu.node_times(
                self.frame - 1,
                |node| on_gpu(node) && ran_before[node],
                |node, span| {
                    if on_gpu(node) {
                        let step = step_of_node[&node];
                        [starts[step], times[step]] = span;
                    }
                },
            )?;
        }
        Ok(())
    }

    /// Ends a frame that failed.
    fn abandon(&mut self) {
        if let Some(gpu) = &mut self.gpu {
            gpu.abandon();
            self.taps.iter_mut().filter_map(|tap| tap.ring.as_mut()).for_each(Readback::map);
        }
        self.versions.forget();
    }

    fn is_gpu_step(&self, index: StepId) -> bool {
        matches!(self.plan.steps[index], Step::Run(node) if self.plan.nodes[node].side == Side::Gpu)
    }

    /// Without a clock on the device, waiting after each step is the only way to measure each one.
    fn finish_step(&mut self, index: StepId) -> Result<(), RunError> {
        let wait = self.profile && self.is_gpu_step(index);
        match &mut self.gpu {
            Some(gpu) if wait && !gpu.has_clock() => {
                gpu.submit();
                gpu.gpu.wait()
            }
            _ => Ok(()),
        }
    }

    fn step(
        &mut self,
        index: StepId,
        frame: &Frame,
        host: &Host,
        parity: usize,
        capture: bool,
    ) -> Result<(), RunError> {
        match self.plan.steps[index] {
            Step::Run(node) => {
                if self.graph.nodes[node].declaration().idle {
                    return Ok(());
                }
                let due = self.versions.due(&self.plan, node);
                if due == Due::Skip {
                    return Ok(());
                }
                self.changes.borrow_mut().clear();
                match self.plan.nodes[node].side {
                    Side::Gpu => {
                        let gpu = self.gpu.as_mut().expect("made where a node needs it");
                        gpu.run(&self.plan, node, parity, self.profile);
                    }
                    Side::Cpu => {
                        self.run_cpu(node, frame, host, parity)?;
                        if let Some(watch) = &mut self.watch {
                            watch.examine(node, &self.plan, &self.cpu, parity, frame);
                        }
                    }
                }
                self.versions.ran(&self.plan, node, &self.changes.borrow(), due);
                self.ran[parity][node] = true;
                Ok(())
            }
            Step::Upload(value) => {
                if !self.versions.transfer(&self.plan, value, Side::Gpu) {
                    return Ok(());
                }
                let memory = &self.cpu[self.plan.slot(value, Side::Cpu, parity)];
                let gpu = self.gpu.as_mut().expect("made where a node needs it");
                let differing = self.versions.differing(value.storage);
                self.moved[index] = gpu.upload(&self.plan, value, parity, memory, differing);
                Ok(())
            }
            Step::Download(value, mode) => {
                let new = match mode {
                    Download::Latent(frames) => self.versions.late(&self.plan, value, frames),
                    Download::Sync if self.versions.transfer(&self.plan, value, Side::Cpu) => true,
                    Download::Sync => return Ok(()),
                };
                self.moved[index] = if new { self.plan.storages[value.storage].bytes() } else { 0 };
                let memory = &self.cpu[self.plan.slot(value, Side::Cpu, parity)];
                let gpu = self.gpu.as_mut().expect("made where a node needs it");
                gpu.download(&self.plan, value, parity, self.frame, memory, new)
            }
            Step::Tap { tap, field } => {
                if capture {
                    self.tap(tap, field, parity);
                }
                Ok(())
            }
        }
    }

    fn run_cpu(&mut self, node: NodeId, frame: &Frame, host: &Host, parity: usize) -> Result<(), RunError> {
        let stage = &self.graph.nodes[node].stage;
        if let Some(fill) = self.fill {
            self.fill_cpu(fill, node, parity);
        }
        let cx = CpuContext {
            frame,
            host,
            memory: &self.cpu,
            bindings: &self.bindings[parity][node],
            changes: &self.changes,
            failed: self.watch.as_ref().map(|watch| &watch.failed),
            level: self.level,
        };
        let fail = |message| RunError::Stage { node: self.plan.nodes[node].name.clone(), message };
        // A stage that panics is a bug, but it must not take down the application, with its window and unsaved files.
        match catch_unwind(AssertUnwindSafe(|| stage.run_cpu(&cx))) {
            Ok(result) => result.map_err(fail),
            Err(panic) => {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                let text = text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
                Err(fail(format!("the stage panicked: {text}")))
            }
        }
    }

    fn fill_cpu(&self, fill: Fill, node: NodeId, parity: usize) {
        for &storage in &self.plan.nodes[node].written_anew {
            let slot = self.plan.slot(Value::now(storage), Side::Cpu, parity);
            let word = fill.word(&self.plan.storages[storage].element).to_le_bytes();
            let mut memory = self.cpu[slot].borrow_mut();
            for bytes in memory.bytes_mut().chunks_exact_mut(4) {
                bytes.copy_from_slice(&word);
            }
        }
    }

    fn tap(&mut self, tap: TapId, field: usize, parity: usize) {
        let storage = self.plan.taps[tap].fields[field].storage;
        let state = self.taps.iter_mut().find(|state| state.tap == tap && state.storage == storage);
        let state = state.expect("made for every tapped field");
        if !state.wanted {
            return;
        }
        state.snapshot.frame = self.frame;
        match &mut state.ring {
            None => {
                let slot = self.plan.slot(Value::now(storage), Side::Cpu, parity);
                let bytes = state.snapshot.bytes.len();
                state.snapshot.bytes.copy_from_slice(&self.cpu[slot].borrow().bytes()[..bytes]);
            }
            Some(ring) => {
                let gpu = self.gpu.as_mut().expect("made where a node needs it");
                gpu.tap(&self.plan, storage, parity, self.frame, ring);
                state.taken = false;
            }
        }
    }

    /// From now on, captures only the taps and outputs whose names `wanted` accepts. Other taps cost memory but no
    /// time.
    pub fn want(&mut self, wanted: impl Fn(&str) -> bool) {
        for state in &mut self.taps {
            state.wanted = wanted(&state.snapshot.name);
        }
    }

    /// The wanted taps as of the last captured frame; waits for pending ones.
    pub fn snapshots(&mut self) -> Result<Vec<&Snapshot>, RunError> {
        for state in self.taps.iter_mut().filter(|state| state.wanted) {
            if let (Some(ring), Some(gpu), false) = (&mut state.ring, &self.gpu, state.taken) {
                let layout = Layout::new(&state.snapshot.element, state.snapshot.dims);
                let bytes = &mut state.snapshot.bytes;
                ring.take(&gpu.gpu, state.snapshot.frame, |staged| layout.unpad(staged, bytes))?;
                state.taken = true;
            }
        }
        Ok(self.taps.iter().filter(|state| state.wanted).map(|state| &state.snapshot).collect())
    }

    /// The captured field of a tap or output.
    pub fn snapshot(&mut self, name: &str, field: &str) -> Result<Option<&Snapshot>, RunError> {
        let all = self.snapshots()?;
        Ok(all.into_iter().find(|snapshot| snapshot.name == name && snapshot.field == field))
    }

    /// Takes over what an earlier executor keeps from frame to frame, and its pending readbacks, for storages whose
    /// name, element and size are equal: a changed graph continues with the points it has.
    ///
    /// # Errors
    /// [`RunError::Gpu`] where the old contents cannot be read.
    pub fn inherit(&mut self, old: &mut Self) -> Result<(), RunError> {
        for storage in old.plan.storages.indices() {
            if old.plan.storages[storage].life != Life::Transient {
                let bytes = old.contents(storage)?;
                self.restore(&old.plan.storages[storage].name, &bytes);
            }
        }
        if let (Some(gpu), Some(old_gpu)) = (&mut self.gpu, &mut old.gpu) {
            gpu.take_over_downloads(&self.plan, old_gpu, &old.plan, old.frame);
        }
        Ok(())
    }

    /// What the next frame reads from a persistent storage.
    fn contents(&mut self, id: StorageId) -> Result<Vec<u8>, RunError> {
        let storage = &self.plan.storages[id];
        let parity = self.parity();
        let value = Value { storage: id, previous: storage.life == Life::History };
        let mut bytes = vec![0; storage.bytes() as usize];
        // Memory that no node touches is on neither side; it is still zero.
        if storage.slots[storage.home].is_none() {
            return Ok(bytes);
        }
        let slot = self.plan.slot(value, storage.home, parity);
        match (&mut self.gpu, storage.home) {
            (Some(gpu), Side::Gpu) => gpu.read(slot, &storage.element, storage.dims, &mut bytes)?,
            _ => bytes.copy_from_slice(&self.cpu[slot].borrow().bytes()[..storage.bytes() as usize]),
        }
        Ok(bytes)
    }

    /// Replaces what the next frame reads from a persistent storage, on both sides. Does nothing and returns false if
    /// there is no such storage or its size differs.
    pub(crate) fn restore(&mut self, storage: &str, bytes: &[u8]) -> bool {
        let Some(id) = self.plan.storages.position(|s| s.name == storage) else { return false };
        let storage = &self.plan.storages[id];
        if storage.bytes() != bytes.len() as u64 {
            return false;
        }
        self.versions.replaced(id);
        let parity = self.parity();
        let value = Value { storage: id, previous: storage.life == Life::History };
        if storage.slots.cpu.is_some() {
            let slot = self.plan.slot(value, Side::Cpu, parity);
            self.cpu[slot].borrow_mut().bytes_mut()[..bytes.len()].copy_from_slice(bytes);
        }
        if let (Some(gpu), Some(_)) = (&mut self.gpu, storage.slots.gpu) {
            let slot = self.plan.slot(value, Side::Gpu, parity);
            gpu.write(slot, &storage.element, storage.dims, bytes);
        }
        true
    }
}

/// The tables of all nodes, with the names of their storages.
fn tables(graph: &Graph) -> Vec<(String, &'static [u32])> {
    let mut tables = Vec::new();
    for (node, declared) in graph.nodes.iter_enumerated() {
        for (port, written) in declared.declaration().ports.iter().enumerate() {
            if !written.table.is_empty() {
                tables.push((graph.name(PortRef { node, port }), written.table));
            }
        }
    }
    tables
}

fn allocate(plan: &Plan) -> Result<IndexVec<SlotId, RefCell<CpuMemory>>, RunError> {
    let allocate = |(id, slot): (SlotId, &Slot)| {
        CpuMemory::new(slot.bytes()).map(RefCell::new).ok_or_else(|| {
            let uses_it =
                |storage: &&Storage| storage.slots.cpu.is_some_and(|pair| pair.both().contains(&id));
            let name = plan.storages.iter().find(uses_it).map(|storage| storage.name.clone());
            RunError::Memory { name: name.unwrap_or_default(), bytes: slot.bytes() }
        })
    };
    plan.slots.cpu.iter_enumerated().map(allocate).collect()
}

fn bindings(graph: &Graph, plan: &Plan, parity: usize) -> IndexVec<NodeId, CpuBindings> {
    let of_node = |(node, planned): (&Node, &PlannedNode)| {
        let on_cpu = node.side == Side::Cpu && !node.declaration().idle;
        let bind = |value: &Option<Value>| {
            let value = value.filter(|_| on_cpu)?;
            let dims = plan.storages[value.storage].dims;
            Some(Binding { slot: plan.slot(value, Side::Cpu, parity), dims })
        };
        planned.bindings.iter().map(|fields| fields.iter().map(bind).collect()).collect()
    };
    graph.nodes.iter().zip(&plan.nodes).map(of_node).collect()
}

fn tap_states(plan: &Plan, gpu: Option<&GpuSide>) -> Vec<TapState> {
    let mut states = Vec::new();
    for (id, tap) in plan.taps.iter_enumerated() {
        for TapField { name, storage, side } in &tap.fields {
            let stored = &plan.storages[*storage];
            let layout = Layout::new(&stored.element, stored.dims);
            let on_gpu = gpu.filter(|_| *side == Side::Gpu);
            states.push(TapState {
                tap: id,
                storage: *storage,
                snapshot: Snapshot {
                    name: tap.name.clone(),
                    field: name.clone(),
                    meaning: tap.meaning,
                    element: stored.element.clone(),
                    dims: stored.dims,
                    frame: 0,
                    bytes: vec![0; stored.bytes() as usize],
                },
                taken: true,
                wanted: true,
                ring: on_gpu.map(|gpu| Readback::new(&gpu.gpu.device, layout.staged_bytes(), 2)),
            });
        }
    }
    states
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CpuContext, Extent, GraphFile, Io, Out, Shader, Stage, compile};

    struct Fill {
        out: Out<u32>,
    }

    struct Pass;

    impl Stage for Pass {
        const KIND: &'static str = "pass";
        const DOC: &'static str = "Hands on what it is given.";
        type Params = ();
        fn declare((): &(), io: &mut Io) -> Self {
            io.update::<u32>("in", "handed on", Extent::Any);
            Self
        }
        fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
            Ok(())
        }
    }

    impl Stage for Fill {
        const KIND: &'static str = "fill";
        const DOC: &'static str = "Writes sevens.";
        type Params = ();
        fn declare((): &(), io: &mut Io) -> Self {
            let source = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
                @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
                    if id.x < arrayLength(&out) { out[id.x] = 7u; }
                }";
            io.shader(Shader::new("fill.wgsl", source));
            let out = io.write("out", "sevens", Extent::Frame(1));
            io.dispatch("main", out);
            Self { out }
        }
        fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
            cx.write(self.out).fill(7);
            Ok(())
        }
    }

    /// The fill runs on a GPU of its own; a node on the CPU reads the downloaded result in the same frame.
    fn fill(gpu: &Arc<Gpu>) -> Result<Executor, RunError> {
        let text = r#"#![enable(implicit_some)]
            Graph(version: 1, nodes: {
                "fill": (kind: "fill", on: Gpu),
                "pass": (kind: "pass", inputs: { "in": "fill.out" }),
            }, outputs: { "image": "pass.in" })"#;
        let file = GraphFile::parse("fill.ron", text).unwrap();
        let registry = Registry::default().with::<Fill>().with::<Pass>();
        let settings = Settings::new([8, 8], 0, crate::facts::Facts::none());
        let (graph, plan) = compile(&file, &registry, &settings).unwrap();
        Executor::new(graph, plan, &settings, &registry, Some(gpu.clone()))
    }

    /// One frame and its image.
    fn run(executor: &mut Executor) -> Result<Vec<u32>, RunError> {
        let frame = Frame { size: [8, 8], ..Frame::default() };
        executor.run(&frame, &Host::default(), true)?;
        Ok(executor.snapshot("image", "")?.unwrap().get::<u32>())
    }

    /// A device of its own: other tests keep theirs.
    fn gpu() -> Arc<Gpu> {
        Arc::new(Gpu::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("{error}")))
    }

    #[test]
    fn a_lost_device_comes_back_as_an_error() {
        let gpu = gpu();
        let mut executor = fill(&gpu).unwrap();
        assert_eq!(run(&mut executor), Ok(vec![7; 64]));
        gpu.lose();
        for _ in 0..3 {
            let result = run(&mut executor);
            assert!(matches!(result, Err(RunError::Lost(_))), "{result:?}");
            assert_eq!(executor.frames(), 1);
        }
        assert!(matches!(fill(&gpu), Err(RunError::Lost(_) | RunError::Gpu(_) | RunError::Stage { .. })));
    }

    #[test]
    fn a_device_that_keeps_time_tells_that_of_the_frame_before() {
        let gpu = gpu();
        let mut executor = fill(&gpu).unwrap();
        executor.gpu.as_mut().unwrap().keep_time();
        if !executor.gpu_has_clock() {
            return;
        }
        let fill = executor.step_of_node[&executor.graph.node("fill").unwrap()];
        let mut seen = Vec::new();
        for _ in 0..4 {
            (executor.times[fill], executor.starts[fill]) = (-1.0, -1.0);
            assert_eq!(run(&mut executor), Ok(vec![7; 64]));
            seen.push((executor.times[fill] >= 0.0, executor.starts[fill]));
        }
        // It is the first node on the GPU; begins are relative to it.
        assert_eq!(seen, [(false, -1.0), (true, 0.0), (true, 0.0), (true, 0.0)]);
    }

    /// Works on a list for a while, on the GPU.
    struct Work;

    crate::params! {
        struct WorkParams {
            /// Whether it is skipped while the view and the list are the same.
            skipped: bool = false;
        }
    }

    impl Stage for Work {
        const KIND: &'static str = "work";
        const DOC: &'static str = "Takes a while.";
        type Params = WorkParams;
        fn declare(params: &WorkParams, io: &mut Io) -> Self {
            let source = "@group(0) @binding(0) var<storage, read> in: array<u32>;
                @group(0) @binding(1) var<storage, read_write> out: array<u32>;
                fn work(index: u32) {
                    if index >= arrayLength(&out) { return; }
                    var number = in[index];
                    for (var i = 0u; i < 100000u; i++) { number = number * 1664525u + 1013904223u; }
                    out[index] = number;
                }
                @compute @workgroup_size(64) fn first(@builtin(global_invocation_id) id: vec3<u32>) { work(id.x); }
                @compute @workgroup_size(64) fn again(@builtin(global_invocation_id) id: vec3<u32>) { work(id.x); }";
            if params.skipped {
                io.per_view();
            }
            io.shader(Shader::new("work.wgsl", source));
            io.read::<u32>("in", "numbers", Extent::Any);
            let out = io.write::<u32>("out", "other numbers", Extent::Like("in".into()));
            io.dispatch("first", out);
            io.dispatch("again", out);
            Self
        }
        fn cpu(&self, _: &WorkParams, _: &CpuContext) -> Result<(), String> {
            Ok(())
        }
    }

    #[test]
    fn a_device_that_keeps_time_tells_when_each_node_ran_and_how_long() {
        let text = r#"#![enable(implicit_some)]
            Graph(version: 1, nodes: {
                "fill": (kind: "fill", on: Cpu),
                "first": (kind: "work", on: Gpu, inputs: { "in": "fill.out" }),
                "once": (kind: "work", on: Gpu, inputs: { "in": "kept.out" }, params: (skipped: true)),
                "kept": (kind: "keep"),
                "last": (kind: "work", on: Gpu, inputs: { "in": "first.out" }),
            }, outputs: { "image": "last.out", "other": "once.out" })"#;
        let file = GraphFile::parse("work.ron", text).unwrap();
        let registry = Registry::default().with::<Fill>().with::<Work>().with::<Keep>();
        let settings = Settings::new([8, 8], 0, crate::facts::Facts::none());
        let (graph, plan) = compile(&file, &registry, &settings).unwrap();
        let mut executor = Executor::new(graph, plan, &settings, &registry, Some(gpu())).unwrap();
        executor.gpu.as_mut().unwrap().keep_time();
        if !executor.gpu_has_clock() {
            return;
        }
        let mut before = 0.0;
        for frame in 0..4 {
            let start = Instant::now();
            run(&mut executor).unwrap();
            let took = start.elapsed().as_secs_f32() * 1000.0;
            let span = |name| {
                let step = executor.step_of_node[&executor.graph.node(name).unwrap()];
                [executor.starts[step], executor.starts[step] + executor.times[step]]
            };
            let [fill, first, once, last] = ["fill", "first", "once", "last"].map(span);
            assert!(0.0 <= fill[0] && fill[0] <= fill[1] && fill[1] <= took, "{fill:?} of {took} ms");
            // The others are those of the frame before.
            let on_device = [first, once, last];
            let begin = on_device.iter().map(|span| span[0]).fold(f32::MAX, f32::min);
            assert_eq!(begin, 0.0, "frame {frame}: {on_device:?}");
            match frame {
                0 => assert_eq!(on_device, [[0.0; 2]; 3]),
                1 => assert!(once[1] > once[0] && last[0] >= once[1].min(first[1]), "{on_device:?}"),
                _ => assert_eq!(once, [0.0; 2], "it did not run in frame {}", frame - 1),
            }
            if frame > 0 {
                let worked = first[1] - first[0] + last[1] - last[0];
                assert!(last[0] >= first[1] - 1e-3, "frame {frame}: {on_device:?}");
                // The rest is submission and waiting.
                assert!(worked > 0.1 * before && last[1] <= before, "{on_device:?} of {before} ms");
            }
            before = took;
        }
    }

    /// Only owns memory.
    struct Keep;

    impl Stage for Keep {
        const KIND: &'static str = "keep";
        const DOC: &'static str = "Keeps a list.";
        type Params = ();
        fn declare((): &(), io: &mut Io) -> Self {
            io.idle();
            io.persistent::<u32>("out", "kept", Extent::Frame(1));
            Self
        }
        fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
            Ok(())
        }
    }

    #[test]
    fn after_an_error_of_the_device_the_next_frame_runs() {
        let gpu = gpu();
        let mut executor = fill(&gpu).unwrap();
        assert_eq!(run(&mut executor), Ok(vec![7; 64]));
        // A copy beyond the end of a buffer invalidates everything recorded with it.
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 16,
            usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        executor.gpu.as_mut().unwrap().record(|encoder| encoder.clear_buffer(&buffer, 0, Some(64)));
        assert!(matches!(run(&mut executor), Err(RunError::Gpu(_))));
        assert_eq!(executor.frames(), 1);
        assert_eq!(run(&mut executor), Ok(vec![7; 64]));
        assert_eq!(run(&mut executor), Ok(vec![7; 64]));
    }
}
