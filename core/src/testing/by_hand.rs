//! A frame's dispatches recorded with nothing but wgpu, to measure what the executor adds.

use std::sync::Arc;

use crate::{
    executor::{Executor, Gpu, GpuPass, Groups, Pipeline, RunError},
    frame::Frame,
};

/// The dispatches of a frame as a program without a graph would record them. Pipelines, bind groups and memory are an
/// executor's, but nothing looks at its plan.
pub struct ByHand {
    gpu: Arc<Gpu>,
    constants: wgpu::Buffer,
    dispatches: Vec<Dispatch>,
}

struct Dispatch {
    pipeline: wgpu::ComputePipeline,
    /// For even and odd frames.
    bindings: [wgpu::BindGroup; 2],
    groups: Groups,
}

impl ByHand {
    /// What ran in an executor's last frame; `None` if that was nothing on a GPU, or not only dispatches.
    pub fn of(executor: &Executor) -> Option<Self> {
        let (gpu, constants, passes) = executor.recorded()?;
        let dispatch = |GpuPass { pipeline, bindings }| match pipeline {
            Pipeline::Compute { pipeline, groups } => Some(Dispatch { pipeline, bindings, groups }),
            Pipeline::Raster { .. } => None,
        };
        let dispatches: Vec<Dispatch> = passes.into_iter().map(dispatch).collect::<Option<_>>()?;
        Some(Self { gpu: gpu.clone(), constants: constants.clone(), dispatches })
    }

    /// The number of dispatches.
    pub fn dispatches(&self) -> usize {
        self.dispatches.len()
    }

    /// Records a frame into one encoder and submits it; `parity` is the lowest bit of the frame's number.
    pub fn frame(&self, frame: &Frame, parity: usize) {
        let Gpu { device, queue, .. } = &*self.gpu;
        queue.write_buffer(&self.constants, 0, bytemuck::bytes_of(frame));
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        for Dispatch { pipeline, bindings, groups } in &self.dispatches {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bindings[parity], &[]);
            match groups {
                Groups::Known([x, y]) => pass.dispatch_workgroups(*x, *y, 1),
                Groups::InBuffer(counts) => pass.dispatch_workgroups_indirect(&counts[parity], 0),
            }
        }
        drop(pass);
        queue.submit([encoder.finish()]);
    }

    /// Waits until the GPU has done all that was submitted.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn wait(&self) -> Result<(), RunError> {
        self.gpu.wait()
    }
}
