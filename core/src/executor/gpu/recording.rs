//! Records a frame's steps.

use std::{cell::RefCell, ops::Range};

use super::{
    GpuSide, RunError,
    memory::{GpuMemory, Layout},
    pipelines::{GpuPass, Groups, Pipeline},
};
use crate::{
    executor::readback::Readback,
    id::{NodeId, StorageId},
    plan::{Life, Plan, Value},
    shader::MAX_TARGETS,
    side::Side,
    stage::CpuMemory,
};

impl GpuSide {
    /// Records a node; `parity` is the lowest bit of the frame number.
    pub fn run(&mut self, plan: &Plan, node: NodeId, parity: usize, timed: bool) {
        let Some(built) = &self.nodes[node] else { return };
        if let Some(fill) = &self.fill {
            let encoder = self.commands.encoder(&self.gpu);
            for &storage in &plan.nodes[node].written_anew {
                let storage = &plan.storages[storage];
                let Some(slots) = storage.slots.gpu else { continue };
                let slot = slots.at(parity, false);
                let layout = Layout::new(&storage.element, storage.dims);
                self.memory[slot].copy_in(encoder, &fill[slot], layout);
            }
        }
        // wgpu orders dispatches of a pass that share memory.
        let compute = |pass: &GpuPass| pass.pipeline.is_compute();
        let runs = || built.passes.chunk_by(|a, b| compute(a) && compute(b));
        let last = runs().count().saturating_sub(1);
        for (index, run) in runs().enumerate() {
            let clock = self.clock.as_ref().filter(|_| timed);
            let times = clock.and_then(|clock| clock.of_pass(node, index == 0, index == last));
            if compute(&run[0]) {
                let times = times.map(|times| times.compute());
                let recorded = self.commands.dispatches(&self.gpu, times);
                for pass in run {
                    let Pipeline::Compute { pipeline, groups } = &pass.pipeline else {
                        unreachable!("a run of dispatches")
                    };
                    recorded.set_pipeline(pipeline);
                    recorded.set_bind_group(0, &pass.bindings[parity], &[]);
                    match groups {
                        Groups::Known([x, y]) => recorded.dispatch_workgroups(*x, *y, 1),
                        Groups::InBuffer(counts) => {
                            recorded.dispatch_workgroups_indirect(&counts[parity], 0);
                        }
                    }
                }
            } else if let Pipeline::Raster { pipeline, vertices, targets, depth, clear } = &run[0].pipeline {
                let clear = wgpu::Color { r: *clear, g: *clear, b: *clear, a: *clear };
                let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(clear), store: wgpu::StoreOp::Store };
                let targets = &targets[parity];
                // An array, because a steady frame allocates nothing.
                let attachments: [_; MAX_TARGETS] = std::array::from_fn(|index| {
                    Some(wgpu::RenderPassColorAttachment {
                        view: targets.get(index)?,
                        depth_slice: None,
                        resolve_target: None,
                        ops,
                    })
                });
                let encoder = self.commands.encoder(&self.gpu);
                let mut recorded = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: None,
                    color_attachments: &attachments[..targets.len()],
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
                    timestamp_writes: times.map(|times| times.raster()),
                    ..Default::default()
                });
                recorded.set_pipeline(pipeline);
                recorded.set_bind_group(0, &run[0].bindings[parity], &[]);
                recorded.draw(0..*vertices, 0..1);
            }
        }
    }

    /// Records a copy from the CPU: of some ranges of elements, or of all if there are none. Returns its bytes. Each
    /// upload has its own staging buffer, which is written before the submission.
    pub fn upload(
        &mut self,
        plan: &Plan,
        value: Value,
        parity: usize,
        memory: &RefCell<CpuMemory>,
        ranges: impl ExactSizeIterator<Item = Range<usize>>,
    ) -> u64 {
        let storage = &plan.storages[value.storage];
        let upload = self.uploads.get_mut(&value).expect("built for every upload");
        let memory = memory.borrow();
        let slot = &self.memory[plan.slot(value, Side::Gpu, parity)];
        let encoder = self.commands.encoder(&self.gpu);
        if let (GpuMemory::Buffer(buffer), true) = (slot, ranges.len() > 0) {
            let size = storage.element.bytes() as usize;
            let mut moved = 0;
            for range in ranges {
                let bytes = &memory.bytes()[range.start * size..range.end * size];
                let (at, length) = ((range.start * size) as u64, bytes.len() as u64);
                self.gpu.queue.write_buffer(&upload.staging, at, bytes);
                encoder.copy_buffer_to_buffer(&upload.staging, at, buffer, at, length);
                moved += length;
            }
            return moved;
        }
        if upload.layout.is_packed() {
            let bytes = &memory.bytes()[..upload.layout.staged_bytes() as usize];
            self.gpu.queue.write_buffer(&upload.staging, 0, bytes);
        } else {
            upload.layout.pad(memory.bytes(), &mut upload.padded);
            self.gpu.queue.write_buffer(&upload.staging, 0, &upload.padded);
        }
        slot.copy_in(encoder, &upload.staging, upload.layout);
        storage.bytes()
    }

    /// Copies to the CPU. Without latency, submits and waits; with a latency of N frames, delivers what was recorded N
    /// frames ago, and records this frame's contents if they are new. Until something arrives, contents that are not kept
    /// are zeros: other contents take turns with them in their memory.
    pub fn download(
        &mut self,
        plan: &Plan,
        value: Value,
        parity: usize,
        frame: u64,
        memory: &RefCell<CpuMemory>,
        new: bool,
    ) -> Result<(), RunError> {
        let storage = &plan.storages[value.storage];
        let layout = Layout::new(&storage.element, storage.dims);
        let from = &self.memory[plan.slot(value, Side::Gpu, parity)];
        let readback = self.downloads.get_mut(&value).expect("built for every download");
        let late = readback.len() as u64 - 1;
        let read = |staged: &[u8]| layout.unpad(staged, memory.borrow_mut().bytes_mut());
        if late > 0 {
            // Deliver first: this frame overwrites the ring's oldest entry next.
            let mut arrived = false;
            readback.take_late(&self.gpu, frame, late, |staged| {
                arrived = true;
                read(staged);
            })?;
            if !arrived && storage.life == Life::Transient {
                memory.borrow_mut().bytes_mut().fill(0);
            }
            if new {
                from.copy_out(self.commands.encoder(&self.gpu), readback.record(frame), layout);
            }
            return Ok(());
        }
        from.copy_out(self.commands.encoder(&self.gpu), readback.record(frame), layout);
        self.commands.submit(&self.gpu);
        readback.map();
        readback.take(&self.gpu, frame, read)
    }

    /// Records a copy of a storage into a readback ring.
    pub fn tap(&mut self, plan: &Plan, storage: StorageId, parity: usize, frame: u64, ring: &mut Readback) {
        let slot = plan.slot(Value::now(storage), Side::Gpu, parity);
        let layout = Layout::new(&plan.storages[storage].element, plan.storages[storage].dims);
        self.memory[slot].copy_out(self.commands.encoder(&self.gpu), ring.record(frame), layout);
    }
}
