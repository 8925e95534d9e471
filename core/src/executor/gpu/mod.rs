//! The GPU half of an executor: memory, pipelines and bind groups built once, and the recording of a frame.

mod clock;
mod memory;
mod pipelines;
mod recording;
mod watch;

use std::{collections::HashMap, sync::Arc};

use clock::Clock;
use index_vec::IndexVec;
use memory::GpuMemory;
pub(super) use memory::{Layout, poison_word};
use pipelines::{Builder, GpuNode};
pub(crate) use pipelines::{GpuPass, Groups, Pipeline};
use watch::GpuWatch;

use super::{Fill, Gpu, RunError, readback::Readback, watch::Watch};
use crate::{
    frame::Frame,
    graph::{Graph, Node},
    id::{NodeId, SlotId},
    plan::{Plan, Step, Value},
    port::{Dims, Element},
    shader::ShaderLibrary,
    side::{Download, Side},
};

/// A staging buffer for one upload.
struct Upload {
    staging: wgpu::Buffer,
    layout: Layout,
    padded: Vec<u8>,
}

/// The GPU half of an executor.
pub(super) struct GpuSide {
    pub gpu: Arc<Gpu>,
    memory: IndexVec<SlotId, GpuMemory>,
    frame: wgpu::Buffer,
    /// `None` for nodes that run on the CPU or only own memory.
    nodes: IndexVec<NodeId, Option<GpuNode>>,
    uploads: HashMap<Value, Upload>,
    downloads: HashMap<Value, Readback>,
    /// If memory is filled before a node writes it: for each slot, the buffer that fills it.
    fill: Option<IndexVec<SlotId, wgpu::Buffer>>,
    commands: Commands,
    clock: Option<Clock>,
    watch: Option<GpuWatch>,
}

impl GpuSide {
    /// Allocates and builds everything that a plan needs on the GPU.
    pub fn new(
        gpu: Arc<Gpu>,
        graph: &Graph,
        plan: &Plan,
        library: &ShaderLibrary,
        fill: Option<Fill>,
        watch: Option<&Watch>,
    ) -> Result<Self, RunError> {
        memory::check_limits(&gpu, plan)?;
        let memory = gpu.scoped(|| memory::allocate(&gpu.device, graph, plan))?;
        let frame = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size: size_of::<Frame>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let on_gpu = watch.map(|watch| GpuWatch::new(&gpu, graph, watch, library)).transpose()?;
        let watch = watch.zip(on_gpu.as_ref());
        let builder = Builder { gpu: &gpu, graph, plan, library, memory: &memory, frame: &frame, watch };
        let build = |(id, node): (NodeId, &Node)| {
            (node.side == Side::Gpu && !node.declaration().idle).then(|| builder.node(id)).transpose()
        };
        let nodes = graph.nodes.iter_enumerated().map(build).collect::<Result<_, _>>()?;
        let (uploads, downloads) = gpu.scoped(|| transfers(&gpu.device, plan))?;
        let fill =
            fill.map(|fill| gpu.scoped(|| memory::fill_buffers(&gpu.device, plan, fill))).transpose()?;
        let clock =
            gpu.has_timestamps().then(|| gpu.scoped(|| Clock::new(&gpu, graph.nodes.len()))).transpose()?;
        gpu.check()?;
        let (commands, watch) = (Commands::default(), on_gpu);
        Ok(Self { gpu, memory, frame, nodes, uploads, downloads, fill, commands, clock, watch })
    }

    /// Writes the frame's constants; must come first in a frame.
    pub fn begin(&mut self, frame: &Frame) {
        self.gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(frame));
        if let Some(watch) = &self.watch {
            watch.begin(&self.gpu.queue);
        }
    }

    /// Reports the first bad value of each node, of the frame that has just ended.
    pub fn found(&mut self, to: &mut Watch, frame: &Frame) -> Result<(), RunError> {
        match &mut self.watch {
            Some(watch) => watch.read(&self.gpu, to, frame),
            None => Ok(()),
        }
    }

    /// Measures time even on a software device, whose times mean little, if the device can.
    #[cfg(test)]
    pub fn keep_time(&mut self) {
        if self.gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            self.clock = Some(Clock::new(&self.gpu, self.nodes.len()));
        }
    }

    /// Records a test's own commands.
    #[cfg(test)]
    pub fn record(&mut self, commands: impl FnOnce(&mut wgpu::CommandEncoder)) {
        commands(self.commands.encoder(&self.gpu));
    }

    /// Submits the recorded commands, if any.
    pub fn submit(&mut self) {
        self.commands.submit(&self.gpu);
    }

    /// Ends a frame: resolves the timestamps, submits, starts the readbacks' mapping.
    pub fn end(&mut self, frame: u64, timed: bool) -> Result<(), RunError> {
        if timed && let Some(clock) = &mut self.clock {
            clock.resolve(self.commands.encoder(&self.gpu), frame);
        }
        self.close();
        self.gpu.check()
    }

    /// Ends a frame that failed: the commands recorded so far take effect, as do the CPU steps that have run. Errors
    /// that follow from the failure are dropped.
    pub fn abandon(&mut self) {
        self.close();
        let _ = self.gpu.check();
    }

    fn close(&mut self) {
        if let Some(watch) = &mut self.watch {
            watch.end(self.commands.encoder(&self.gpu));
        }
        self.submit();
        if let Some(watch) = &mut self.watch {
            watch.map();
        }
        for readback in self.downloads.values_mut() {
            readback.map();
        }
        if let Some(clock) = &mut self.clock {
            clock.map();
        }
    }

    /// The frame's constants.
    pub fn constants(&self) -> &wgpu::Buffer {
        &self.frame
    }

    /// What a node records.
    pub fn passes(&self, node: NodeId) -> &[GpuPass] {
        self.nodes[node].as_ref().map_or(&[], |node| &node.passes)
    }

    /// Whether the device measures time itself.
    pub fn has_clock(&self) -> bool {
        self.clock.is_some()
    }

    /// The begins and durations of the nodes of frame `frame`, as [`Clock::read`] hands them on, if the device measures
    /// time.
    pub fn node_times(
        &mut self,
        frame: u64,
        ran: impl Fn(NodeId) -> bool,
        each: impl FnMut(NodeId, [f32; 2]),
    ) -> Result<(), RunError> {
        match &mut self.clock {
            Some(clock) => clock.read(&self.gpu, frame, ran, each),
            None => Ok(()),
        }
    }

    /// Takes over the pending readbacks of another executor's GPU side, which has run this many frames, for equal
    /// storages.
    pub fn take_over_downloads(&mut self, plan: &Plan, old: &mut Self, old_plan: &Plan, frames: u64) {
        if !Arc::ptr_eq(&self.gpu, &old.gpu) {
            return;
        }
        for (value, readback) in &mut self.downloads {
            let storage = &plan.storages[value.storage];
            let same = old.downloads.iter_mut().find(|(other, _)| {
                let found = &old_plan.storages[other.storage];
                found.name == storage.name
                    && found.element == storage.element
                    && found.dims == storage.dims
                    && other.previous == value.previous
            });
            if let Some((_, other)) = same {
                readback.take_over(other, frames);
            }
        }
    }

    /// Reads the contents of a slot and waits for them.
    pub fn read(
        &mut self,
        slot: SlotId,
        element: &Element,
        dims: Dims,
        bytes: &mut [u8],
    ) -> Result<(), RunError> {
        let layout = Layout::new(element, dims);
        let mut readback = Readback::new(&self.gpu.device, layout.staged_bytes(), 1);
        self.memory[slot].copy_out(self.commands.encoder(&self.gpu), readback.record(0), layout);
        self.submit();
        readback.map();
        readback.take(&self.gpu, 0, |staged| layout.unpad(staged, bytes))
    }

    /// Replaces the contents of a slot.
    pub fn write(&mut self, slot: SlotId, element: &Element, dims: Dims, bytes: &[u8]) {
        self.memory[slot].write(&self.gpu.queue, bytes, Layout::new(element, dims));
    }
}

/// The commands that have not been submitted.
#[derive(Default)]
struct Commands {
    /// The pass that the last dispatches are in, while it is open. To begin and to end one costs the processor as much as
    /// several dispatches.
    dispatches: Option<wgpu::ComputePass<'static>>,
    encoder: Option<wgpu::CommandEncoder>,
}

impl Commands {
    /// The encoder, for anything but dispatches; a new one is made after each submission.
    fn encoder(&mut self, gpu: &Gpu) -> &mut wgpu::CommandEncoder {
        self.dispatches = None;
        self.encoder.get_or_insert_with(|| gpu.device.create_command_encoder(&Default::default()))
    }

    /// A pass for dispatches: the open one, unless the pass is to be timed.
    fn dispatches(
        &mut self,
        gpu: &Gpu,
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites>,
    ) -> &mut wgpu::ComputePass<'static> {
        if self.dispatches.is_none() || timestamp_writes.is_some() {
            let described = wgpu::ComputePassDescriptor { label: None, timestamp_writes };
            self.dispatches = Some(self.encoder(gpu).begin_compute_pass(&described).forget_lifetime());
        }
        self.dispatches.as_mut().expect("begun above")
    }

    fn submit(&mut self, gpu: &Gpu) {
        self.dispatches = None;
        if let Some(encoder) = self.encoder.take() {
            gpu.queue.submit([encoder.finish()]);
        }
    }
}

/// Makes staging buffers for the plan's uploads and readback rings for its downloads.
fn transfers(device: &wgpu::Device, plan: &Plan) -> (HashMap<Value, Upload>, HashMap<Value, Readback>) {
    let (mut uploads, mut downloads) = (HashMap::new(), HashMap::new());
    let layout = |value: Value| {
        let storage = &plan.storages[value.storage];
        Layout::new(&storage.element, storage.dims)
    };
    for step in &plan.steps {
        match *step {
            Step::Upload(value) => {
                let layout = layout(value);
                let staging = device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(&plan.storages[value.storage].name),
                    size: layout.staged_bytes(),
                    usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                });
                let padded = vec![0; layout.staged_bytes() as usize];
                uploads.insert(value, Upload { staging, layout, padded });
            }
            Step::Download(value, mode) => {
                let late = match mode {
                    Download::Sync => 0,
                    Download::Latent(frames) => frames as usize,
                };
                let ring = Readback::new(device, layout(value).staged_bytes(), late + 1);
                downloads.insert(value, ring);
            }
            Step::Run(_) | Step::Tap { .. } => {}
        }
    }
    (uploads, downloads)
}
