//! The GPU half of an executor: memory, pipelines and bind groups built once, and the recording of a frame.

use std::{cell::RefCell, collections::HashMap, sync::Arc};

use index_vec::IndexVec;

use super::{
    Gpu, RunError,
    programs::{Program, Raster},
    readback::Readback,
};
use crate::{
    frame::Frame,
    graph::Graph,
    id::{NodeId, SlotId, StorageId},
    plan::{Plan, PlannedNode, SlotPair, Step, Value},
    port::{Dims, Element, FieldRef, Format, Scalar},
    reflect::{self, Entry, Reflected},
    registry::Registry,
    shader::{Pass, Threads},
    side::{Download, Side},
    stage::Block,
};

/// Copies between buffers and textures want rows of a multiple of this many bytes.
const ROW_ALIGNMENT: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;
/// Lists are dispatched in rows of at most this many workgroups; `shared/index.wgsl` knows it as `groups.x`.
const MAX_GROUPS_X: u32 = 32768;

/// Memory of one slot.
pub(super) enum Memory {
    Buffer(wgpu::Buffer),
    Texture(wgpu::Texture, wgpu::TextureView),
}

/// How a slot's contents lie in a staging buffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    row: usize,
    padded_row: u32,
    rows: u32,
}

impl Layout {
    pub fn new(element: &Element, dims: Dims) -> Self {
        let bytes = dims.width * element.bytes();
        match element {
            Element::Item { .. } => {
                let row = dims.count() * element.bytes() as usize;
                Self { row, padded_row: row as u32, rows: 1 }
            }
            _ => Self {
                row: bytes as usize,
                padded_row: bytes.next_multiple_of(ROW_ALIGNMENT),
                rows: dims.height,
            },
        }
    }

    pub fn staged_bytes(&self) -> u64 {
        u64::from(self.padded_row) * u64::from(self.rows)
    }

    /// Removes the padding.
    pub fn unpad(&self, staged: &[u8], out: &mut [u8]) {
        for row in 0..self.rows as usize {
            let from = row * self.padded_row as usize;
            out[row * self.row..][..self.row].copy_from_slice(&staged[from..][..self.row]);
        }
    }

    fn pad(&self, bytes: &[u8], staged: &mut [u8]) {
        for row in 0..self.rows as usize {
            let to = row * self.padded_row as usize;
            staged[to..][..self.row].copy_from_slice(&bytes[row * self.row..][..self.row]);
        }
    }
}

enum Pipeline {
    Compute {
        pipeline: wgpu::ComputePipeline,
        groups: [u32; 2],
    },
    Raster {
        pipeline: wgpu::RenderPipeline,
        vertices: u32,
        slot: SlotId,
        clear: u32,
        depth: Option<wgpu::TextureView>,
    },
}

struct GpuPass {
    pipeline: Pipeline,
    /// For even and odd frames, which see the history pairs swapped.
    bindings: [wgpu::BindGroup; 2],
}

struct GpuNode {
    passes: Vec<GpuPass>,
    /// Kept for the executor that comes after this one.
    _program: Arc<Program>,
}

struct Upload {
    staging: wgpu::Buffer,
    layout: Layout,
    padded: Vec<u8>,
}

/// Timestamps of all nodes of a frame.
struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: Readback,
    nanoseconds: f32,
}

/// The GPU half of an executor.
pub(super) struct GpuSide {
    pub gpu: Arc<Gpu>,
    memory: IndexVec<SlotId, Memory>,
    frame: wgpu::Buffer,
    nodes: IndexVec<NodeId, Option<GpuNode>>,
    uploads: HashMap<Value, Upload>,
    downloads: HashMap<Value, Readback>,
    poison: Option<IndexVec<SlotId, wgpu::Buffer>>,
    encoder: Option<wgpu::CommandEncoder>,
    clock: Option<Clock>,
}

impl GpuSide {
    /// Allocates and builds everything that a plan needs on the GPU.
    pub fn new(
        gpu: Arc<Gpu>,
        graph: &Graph,
        plan: &Plan,
        registry: &Registry,
        poison: bool,
    ) -> Result<Self, RunError> {
        check_limits(&gpu, plan)?;
        let memory = gpu.scoped(|| allocate(&gpu.device, graph, plan))?;
        let frame = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size: size_of::<Frame>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut side = Self {
            gpu,
            memory,
            frame,
            nodes: IndexVec::new(),
            uploads: HashMap::new(),
            downloads: HashMap::new(),
            poison: None,
            encoder: None,
            clock: None,
        };
        for (id, node) in graph.nodes.iter_enumerated() {
            let built = if node.side == Side::Gpu && !node.declaration().idle {
                Some(side.build(graph, plan, id, registry)?)
            } else {
                None
            };
            side.nodes.push(built);
        }
        let gpu = side.gpu.clone();
        gpu.scoped(|| side.build_transfers(plan))?;
        if poison {
            side.poison = Some(gpu.scoped(|| poison_buffers(&gpu.device, plan))?);
        }
        if gpu.has_timestamps() {
            side.clock = Some(gpu.scoped(|| clock(&gpu, graph.nodes.len() as u32))?);
        }
        gpu.check()?;
        Ok(side)
    }

    fn build(
        &mut self,
        graph: &Graph,
        plan: &Plan,
        id: NodeId,
        registry: &Registry,
    ) -> Result<GpuNode, RunError> {
        let node = &graph.nodes[id];
        let declaration = node.declaration();
        let shader = declaration.shader.as_ref().expect("checked: a GPU node has a shader");
        let fail = |message: String| RunError::Stage { node: node.name.clone(), message };
        if declaration.needs.atomic64 && !self.gpu.has_atomic64() {
            return Err(fail(format!("{} has no 64-bit atomics; choose another method", self.gpu.name())));
        }
        let programs = &self.gpu.programs;
        let program = programs.get(&self.gpu, shader, &registry.library, declaration.needs).map_err(fail)?;
        let wrong = reflect::check(&program.reflected, &shader.name, declaration, &node.stage.specs());
        if let Some(error) = wrong.first() {
            return Err(fail(error.to_string()));
        }
        let device = &self.gpu.device;
        let words = node.stage.words();
        let params = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("params"),
            size: (4 * words.len() as u64).next_multiple_of(16).max(16),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.gpu.queue.write_buffer(&params, 0, bytemuck::cast_slice(&words));
        let built = self.gpu.scoped(|| {
            let passes = declaration.passes.iter().map(|pass| {
                let pipeline = self.pipeline(&program, pass, &node.dims, plan, id);
                let bindings = [0, 1].map(|parity| {
                    self.bind(&pipeline, &program.reflected, pass, graph, plan, id, parity, &params)
                });
                GpuPass { pipeline, bindings }
            });
            passes.collect()
        });
        built
            .map(|passes| GpuNode { passes, _program: program.clone() })
            .map_err(|error| fail(error.to_string()))
    }

    fn pipeline(&self, program: &Program, pass: &Pass, dims: &[Dims], plan: &Plan, node: NodeId) -> Pipeline {
        let device = &self.gpu.device;
        match pass {
            Pass::Compute { entry, threads } => {
                let size = entry_of(&program.reflected, entry).workgroup_size;
                let pipeline = program.compute(device, entry);
                Pipeline::Compute { pipeline, groups: groups(*threads, size, dims) }
            }
            Pass::Points { vertex, fragment, count, target, clear } => {
                let slot = self.slot(plan, node, *target, 0);
                let dims = dims[target.port as usize];
                let depth = device.create_texture(&texture(dims, wgpu::TextureFormat::Depth32Float, false));
                let raster = Raster {
                    vertex,
                    fragment,
                    topology: wgpu::PrimitiveTopology::PointList,
                    format: self.format(slot),
                    depth_test: true,
                };
                Pipeline::Raster {
                    pipeline: program.raster(device, &raster),
                    vertices: self.list_length(plan, node, *count),
                    slot,
                    clear: *clear,
                    depth: Some(depth.create_view(&Default::default())),
                }
            }
            Pass::Lines { vertex, fragment, count, target } => {
                let slot = self.slot(plan, node, *target, 0);
                let raster = Raster {
                    vertex,
                    fragment,
                    topology: wgpu::PrimitiveTopology::TriangleList,
                    format: self.format(slot),
                    depth_test: false,
                };
                Pipeline::Raster {
                    pipeline: program.raster(device, &raster),
                    vertices: self.list_length(plan, node, *count).saturating_mul(6),
                    slot,
                    clear: 0,
                    depth: None,
                }
            }
        }
    }

    fn list_length(&self, plan: &Plan, node: NodeId, at: FieldRef) -> u32 {
        let value = plan.nodes[node].value(at);
        value.map_or(0, |value| plan.storages[value.storage].dims.count() as u32)
    }

    fn format(&self, slot: SlotId) -> wgpu::TextureFormat {
        match &self.memory[slot] {
            Memory::Texture(texture, _) => texture.format(),
            Memory::Buffer(_) => unreachable!("checked: raster targets are textures"),
        }
    }

    fn slot(&self, plan: &Plan, node: NodeId, at: FieldRef, parity: usize) -> SlotId {
        let value = plan.nodes[node].value(at).expect("checked: connected");
        plan.slot(value, Side::Gpu, parity)
    }

    fn bind(
        &self,
        pipeline: &Pipeline,
        reflected: &Reflected,
        pass: &Pass,
        graph: &Graph,
        plan: &Plan,
        node: NodeId,
        parity: usize,
        params: &wgpu::Buffer,
    ) -> wgpu::BindGroup {
        let declaration = graph.nodes[node].declaration();
        let mut fields: HashMap<String, FieldRef> = HashMap::new();
        for (port, declared) in declaration.ports.iter().enumerate() {
            for field in 0..declared.fields.len() {
                fields.insert(declared.variable(field), FieldRef { port: port as u16, field: field as u16 });
            }
        }
        let mut used: Vec<usize> = Vec::new();
        let names: &[&str] = match pass {
            Pass::Compute { entry, .. } => &[entry],
            Pass::Points { vertex, fragment, .. } | Pass::Lines { vertex, fragment, .. } => {
                &[vertex, fragment]
            }
        };
        for name in names {
            used.extend(&entry_of(reflected, name).uses);
        }
        used.sort_unstable();
        used.dedup();
        let entries: Vec<wgpu::BindGroupEntry> = used
            .into_iter()
            .map(|variable| {
                let variable = &reflected.variables[variable];
                let resource = match variable.name.as_str() {
                    "frame" => self.frame.as_entire_binding(),
                    "params" => params.as_entire_binding(),
                    name => match &self.memory[self.slot(plan, node, fields[name], parity)] {
                        Memory::Buffer(buffer) => buffer.as_entire_binding(),
                        Memory::Texture(_, view) => wgpu::BindingResource::TextureView(view),
                    },
                };
                wgpu::BindGroupEntry { binding: variable.binding, resource }
            })
            .collect();
        let layout = match pipeline {
            Pipeline::Compute { pipeline, .. } => pipeline.get_bind_group_layout(0),
            Pipeline::Raster { pipeline, .. } => pipeline.get_bind_group_layout(0),
        };
        self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&graph.nodes[node].name),
            layout: &layout,
            entries: &entries,
        })
    }

    fn build_transfers(&mut self, plan: &Plan) {
        let device = &self.gpu.device;
        for step in &plan.steps {
            match step {
                Step::Upload(value) => {
                    let storage = &plan.storages[value.storage];
                    let layout = Layout::new(&storage.element, storage.dims);
                    let staging = device.create_buffer(&wgpu::BufferDescriptor {
                        label: Some(&storage.name),
                        size: layout.staged_bytes(),
                        usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                        mapped_at_creation: false,
                    });
                    let padded = vec![0; layout.staged_bytes() as usize];
                    self.uploads.insert(*value, Upload { staging, layout, padded });
                }
                Step::Download(value, mode) => {
                    let storage = &plan.storages[value.storage];
                    let late = match mode {
                        Download::Sync => 0,
                        Download::Latent(frames) => *frames as usize,
                    };
                    let layout = Layout::new(&storage.element, storage.dims);
                    self.downloads.insert(*value, Readback::new(device, layout.staged_bytes(), late + 1));
                }
                Step::Run(_) | Step::Tap { .. } => {}
            }
        }
    }

    /// Writes the frame's constants; the first thing of a frame.
    pub fn begin(&mut self, frame: &Frame) {
        self.gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(frame));
    }

    /// Records a node; `parity` is the frame number's last bit.
    pub fn run(&mut self, plan: &Plan, node: NodeId, parity: usize, timed: bool) {
        let Some(built) = &self.nodes[node] else { return };
        if let Some(buffers) = &self.poison {
            let encoder = encoder(&self.gpu, &mut self.encoder);
            for storage in plan.written_anew(node) {
                let storage = &plan.storages[storage];
                let Some(slots) = storage.slots.gpu else { continue };
                let slot = slots.at(parity, false);
                copy_in(
                    encoder,
                    &buffers[slot],
                    &self.memory[slot],
                    Layout::new(&storage.element, storage.dims),
                );
            }
        }
        let encoder = encoder(&self.gpu, &mut self.encoder);
        let count = built.passes.len();
        let mut next = 0;
        while next < count {
            // One compute pass for each run of dispatches; wgpu orders dispatches that share memory.
            let run = built.passes[next..]
                .iter()
                .take_while(|p| matches!(p.pipeline, Pipeline::Compute { .. }))
                .count();
            let last = next + run.max(1) == count;
            let clock = self.clock.as_ref().filter(|_| timed);
            let begin = (next == 0).then_some(2 * node.raw());
            let end = last.then_some(2 * node.raw() + 1);
            if run > 0 {
                let timestamp_writes =
                    clock.filter(|_| begin.or(end).is_some()).map(|clock| wgpu::ComputePassTimestampWrites {
                        query_set: &clock.queries,
                        beginning_of_pass_write_index: begin,
                        end_of_pass_write_index: end,
                    });
                let mut pass = encoder
                    .begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
                for step in &built.passes[next..next + run] {
                    let Pipeline::Compute { pipeline, groups } = &step.pipeline else {
                        unreachable!("taken above")
                    };
                    pass.set_pipeline(pipeline);
                    pass.set_bind_group(0, &step.bindings[parity], &[]);
                    pass.dispatch_workgroups(groups[0], groups[1], 1);
                }
                next += run;
                continue;
            }
            let step = &built.passes[next];
            if let Pipeline::Raster { pipeline, vertices, slot, clear, depth } = &step.pipeline {
                let Memory::Texture(_, view) = &self.memory[*slot] else {
                    unreachable!("raster targets are textures")
                };
                let timestamp_writes =
                    clock.filter(|_| begin.or(end).is_some()).map(|clock| wgpu::RenderPassTimestampWrites {
                        query_set: &clock.queries,
                        beginning_of_pass_write_index: begin,
                        end_of_pass_write_index: end,
                    });
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: None,
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view,
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load: wgpu::LoadOp::Clear(wgpu::Color {
                                r: f64::from(*clear),
                                ..wgpu::Color::BLACK
                            }),
                            store: wgpu::StoreOp::Store,
                        },
                    })],
                    depth_stencil_attachment: depth.as_ref().map(|view| {
                        wgpu::RenderPassDepthStencilAttachment {
                            view,
                            depth_ops: Some(wgpu::Operations {
                                load: wgpu::LoadOp::Clear(1.0),
                                store: wgpu::StoreOp::Discard,
                            }),
                            stencil_ops: None,
                        }
                    }),
                    timestamp_writes,
                    ..Default::default()
                });
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &step.bindings[parity], &[]);
                pass.draw(0..*vertices, 0..1);
            }
            next += 1;
        }
    }

    /// Records a copy from the CPU. The staging buffer is written before the submission, each upload has its own.
    pub fn upload(&mut self, plan: &Plan, value: Value, parity: usize, block: &RefCell<Block>) {
        let slot = plan.slot(value, Side::Gpu, parity);
        let upload = self.uploads.get_mut(&value).expect("built for every upload");
        let block = block.borrow();
        if upload.layout.row == upload.layout.padded_row as usize {
            let bytes = &block.bytes()[..upload.layout.staged_bytes() as usize];
            self.gpu.queue.write_buffer(&upload.staging, 0, bytes);
        } else {
            upload.layout.pad(block.bytes(), &mut upload.padded);
            self.gpu.queue.write_buffer(&upload.staging, 0, &upload.padded);
        }
        let encoder = encoder(&self.gpu, &mut self.encoder);
        copy_in(encoder, &upload.staging, &self.memory[slot], upload.layout);
    }

    /// Copies to the CPU: submits and waits when `late` is 0, else delivers what was recorded that many frames ago.
    pub fn download(
        &mut self,
        plan: &Plan,
        value: Value,
        parity: usize,
        frame: u64,
        block: &RefCell<Block>,
    ) -> Result<(), RunError> {
        let slot = plan.slot(value, Side::Gpu, parity);
        let storage = &plan.storages[value.storage];
        let layout = Layout::new(&storage.element, storage.dims);
        let mut readback = self.downloads.remove(&value).expect("built for every download");
        let late = readback.len() as u64 - 1;
        if late > 0 {
            // Deliver first: the ring's oldest entry is the one this frame overwrites next.
            readback.take_late(&self.gpu, frame, late, |staged| {
                layout.unpad(staged, block.borrow_mut().bytes_mut());
            })?;
            let target = readback.record(frame);
            copy_out(encoder(&self.gpu, &mut self.encoder), &self.memory[slot], target, layout);
        } else {
            let target = readback.record(frame);
            copy_out(encoder(&self.gpu, &mut self.encoder), &self.memory[slot], target, layout);
            self.submit();
            readback.map();
            readback.take(&self.gpu, frame, |staged| layout.unpad(staged, block.borrow_mut().bytes_mut()))?;
        }
        self.downloads.insert(value, readback);
        Ok(())
    }

    /// Takes over what is on its way to the CPU from a side that has run so many frames, wherever it is the same storage.
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

    /// Records a copy of a storage into a readback ring.
    pub fn tap(&mut self, plan: &Plan, storage: StorageId, parity: usize, frame: u64, ring: &mut Readback) {
        let slot = plan.slot(Value::now(storage), Side::Gpu, parity);
        let layout = Layout::new(&plan.storages[storage].element, plan.storages[storage].dims);
        copy_out(encoder(&self.gpu, &mut self.encoder), &self.memory[slot], ring.record(frame), layout);
    }

    /// Submits what is recorded, if anything.
    pub fn submit(&mut self) {
        if let Some(encoder) = self.encoder.take() {
            self.gpu.queue.submit([encoder.finish()]);
        }
    }

    /// Ends a frame: resolves the timestamps, submits, starts the readbacks' mapping.
    pub fn end(&mut self, frame: u64, timed: bool) -> Result<(), RunError> {
        if timed && let Some(mut clock) = self.clock.take() {
            let count = 2 * self.nodes.len() as u32;
            let encoder = encoder(&self.gpu, &mut self.encoder);
            encoder.resolve_query_set(&clock.queries, 0..count, &clock.resolved, 0);
            encoder.copy_buffer_to_buffer(
                &clock.resolved,
                0,
                clock.readback.record(frame),
                0,
                u64::from(count) * 8,
            );
            self.clock = Some(clock);
        }
        self.submit();
        for readback in self.downloads.values_mut() {
            readback.map();
        }
        if let Some(clock) = &mut self.clock {
            clock.readback.map();
        }
        self.gpu.check()
    }

    /// For each node of frame `frame`, where the device keeps time: when it began, from the first of those that `ran`, and
    /// how long it took, both in milliseconds; zeros for those that did not run.
    pub fn node_times(
        &mut self,
        frame: u64,
        ran: impl Fn(NodeId) -> bool,
        mut each: impl FnMut(NodeId, [f32; 2]),
    ) -> Result<(), RunError> {
        let Some(clock) = &mut self.clock else { return Ok(()) };
        let milliseconds = |ticks: u64| ticks as f32 * clock.nanoseconds * 1e-6;
        clock.readback.take(&self.gpu, frame, |bytes| {
            let ticks: &[[u8; 8]] = bytemuck::cast_slice(bytes);
            let tick = |at: usize| u64::from_le_bytes(ticks[at]);
            let nodes = || self.nodes.indices();
            let begin = |node: NodeId| tick(2 * node.index());
            let first = nodes().filter(|node| ran(*node)).map(begin).min().unwrap_or(0);
            for node in nodes() {
                let [begin, end] = [begin(node), tick(2 * node.index() + 1)];
                let span = [begin.saturating_sub(first), end.saturating_sub(begin)].map(milliseconds);
                each(node, if ran(node) { span } else { [0.0; 2] });
            }
        })
    }

    pub fn has_clock(&self) -> bool {
        self.clock.is_some()
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
        copy_out(encoder(&self.gpu, &mut self.encoder), &self.memory[slot], readback.record(0), layout);
        self.submit();
        readback.map();
        readback.take(&self.gpu, 0, |staged| layout.unpad(staged, bytes))
    }

    /// Replaces the contents of a slot.
    pub fn write(&mut self, slot: SlotId, element: &Element, dims: Dims, bytes: &[u8]) {
        let layout = Layout::new(element, dims);
        let mut padded = vec![0; layout.staged_bytes() as usize];
        layout.pad(bytes, &mut padded);
        match &self.memory[slot] {
            Memory::Buffer(buffer) => self.gpu.queue.write_buffer(buffer, 0, &padded),
            Memory::Texture(texture, _) => self.gpu.queue.write_texture(
                texture.as_image_copy(),
                &padded,
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(layout.padded_row),
                    rows_per_image: None,
                },
                texture.size(),
            ),
        }
    }
}

/// The frame's encoder; a new one after each submission.
fn encoder<'e>(gpu: &Gpu, encoder: &'e mut Option<wgpu::CommandEncoder>) -> &'e mut wgpu::CommandEncoder {
    encoder.get_or_insert_with(|| gpu.device.create_command_encoder(&Default::default()))
}

fn entry_of<'r>(reflected: &'r Reflected, name: &str) -> &'r Entry {
    reflected.entry(name).expect("checked: every pass has its entry point").1
}

fn groups(threads: Threads, size: [u32; 3], dims: &[Dims]) -> [u32; 2] {
    let list = |count: usize| {
        let groups = u32::try_from(count.div_ceil(size[0] as usize)).unwrap_or(u32::MAX).max(1);
        let x = groups.min(MAX_GROUPS_X);
        [x, groups.div_ceil(x)]
    };
    match threads {
        Threads::Over(at) => {
            let dims = dims[at.port as usize];
            if size[1] > 1 {
                [dims.width.div_ceil(size[0]), dims.height.div_ceil(size[1])]
            } else {
                list(dims.count())
            }
        }
        Threads::Blocks(at, n) => list(dims[at.port as usize].count().div_ceil(n as usize)),
        Threads::Groups(count) => [count, 1],
    }
}

fn check_limits(gpu: &Gpu, plan: &Plan) -> Result<(), RunError> {
    let limits = gpu.device.limits();
    for storage in &plan.storages {
        if storage.slots.gpu.is_none() {
            continue;
        }
        let too_large = match storage.element {
            Element::Item { .. } => storage.bytes() > limits.max_storage_buffer_binding_size,
            _ => storage.dims.width.max(storage.dims.height) > limits.max_texture_dimension_2d,
        };
        if too_large {
            return Err(RunError::Gpu(format!(
                "`{}` has {} elements, {} bytes: more than {} can bind; run with --backend cpu or at a smaller size",
                storage.name,
                storage.dims.count(),
                storage.bytes(),
                gpu.name()
            )));
        }
    }
    Ok(())
}

fn wgpu_format(format: Format) -> wgpu::TextureFormat {
    match format {
        Format::R32Float => wgpu::TextureFormat::R32Float,
        Format::R32Uint => wgpu::TextureFormat::R32Uint,
        Format::Rgba8Unorm => wgpu::TextureFormat::Rgba8Unorm,
        Format::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
        Format::Rgba32Float => wgpu::TextureFormat::Rgba32Float,
    }
}

fn texture(dims: Dims, format: wgpu::TextureFormat, storage: bool) -> wgpu::TextureDescriptor<'static> {
    let usage = if storage {
        wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::COPY_DST
    } else {
        wgpu::TextureUsages::empty()
    };
    wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: dims.width, height: dims.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: if storage { usage } else { wgpu::TextureUsages::RENDER_ATTACHMENT },
        view_formats: &[],
    }
}

fn allocate(device: &wgpu::Device, graph: &Graph, plan: &Plan) -> IndexVec<SlotId, Memory> {
    let targets = raster_targets(graph, plan);
    plan.slots
        .gpu
        .iter_enumerated()
        .map(|(id, slot)| match &slot.element {
            Element::Texel(format) => {
                let mut descriptor = texture(slot.dims, wgpu_format(*format), true);
                if targets.contains(&id) {
                    descriptor.usage |= wgpu::TextureUsages::RENDER_ATTACHMENT;
                }
                let texture = device.create_texture(&descriptor);
                let view = texture.create_view(&Default::default());
                Memory::Texture(texture, view)
            }
            _ => Memory::Buffer(device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: slot.bytes(),
                usage: wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::COPY_SRC
                    | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })),
        })
        .collect()
}

fn raster_targets(graph: &Graph, plan: &Plan) -> Vec<SlotId> {
    let mut targets = Vec::new();
    for (node, PlannedNode { bindings, .. }) in graph.nodes.iter().zip(&plan.nodes) {
        for pass in &node.declaration().passes {
            if let (Some(target), Side::Gpu) = (pass.target(), node.side) {
                let values = bindings[target.port as usize].iter().flatten();
                let slots = values.filter_map(|value| plan.storages[value.storage].slots.gpu);
                targets.extend(slots.flat_map(SlotPair::both));
            }
        }
    }
    targets
}

/// The 32-bit pattern that poisons an element: NaN where it is a float.
pub(super) fn poison_word(element: &Element) -> u32 {
    match element {
        Element::Texel(Format::R32Float | Format::Rgba32Float) => f32::NAN.to_bits(),
        // Two half-precision NaNs.
        Element::Texel(Format::Rgba16Float) => 0x7E00_7E00,
        Element::Item { members, .. } if members.iter().all(|m| m.scalar == Scalar::F32) => {
            f32::NAN.to_bits()
        }
        _ => 0xDEAD_BEEF,
    }
}

fn poison_buffers(device: &wgpu::Device, plan: &Plan) -> IndexVec<SlotId, wgpu::Buffer> {
    plan.slots
        .gpu
        .iter()
        .map(|slot| {
            let size = Layout::new(&slot.element, slot.dims).staged_bytes().max(16);
            let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("poison"),
                size,
                usage: wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: true,
            });
            let words = vec![poison_word(&slot.element); (size / 4) as usize];
            if let Ok(mut range) = buffer.get_mapped_range_mut(..) {
                range.copy_from_slice(bytemuck::cast_slice(&words));
            }
            buffer.unmap();
            buffer
        })
        .collect()
}

fn copy_in(encoder: &mut wgpu::CommandEncoder, from: &wgpu::Buffer, to: &Memory, layout: Layout) {
    match to {
        Memory::Buffer(buffer) => encoder.copy_buffer_to_buffer(from, 0, buffer, 0, layout.staged_bytes()),
        Memory::Texture(texture, _) => {
            encoder.copy_buffer_to_texture(staged(from, layout), texture.as_image_copy(), texture.size());
        }
    }
}

fn copy_out(encoder: &mut wgpu::CommandEncoder, from: &Memory, to: &wgpu::Buffer, layout: Layout) {
    match from {
        Memory::Buffer(buffer) => encoder.copy_buffer_to_buffer(buffer, 0, to, 0, layout.staged_bytes()),
        Memory::Texture(texture, _) => {
            encoder.copy_texture_to_buffer(texture.as_image_copy(), staged(to, layout), texture.size());
        }
    }
}

fn staged(buffer: &wgpu::Buffer, layout: Layout) -> wgpu::TexelCopyBufferInfo<'_> {
    wgpu::TexelCopyBufferInfo {
        buffer,
        layout: wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(layout.padded_row),
            rows_per_image: None,
        },
    }
}

fn clock(gpu: &Gpu, nodes: u32) -> Clock {
    let count = 2 * nodes.max(1);
    let bytes = u64::from(count) * 8;
    Clock {
        queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("node times"),
            ty: wgpu::QueryType::Timestamp,
            count,
        }),
        resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("node times"),
            size: bytes,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        }),
        readback: Readback::new(&gpu.device, bytes, 2),
        nanoseconds: gpu.queue.get_timestamp_period(),
    }
}
