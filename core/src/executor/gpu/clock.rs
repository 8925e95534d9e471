//! When nodes begin and end on a device with timestamps.

use super::{Gpu, RunError};
use crate::{executor::readback::Readback, id::NodeId};

/// Two timestamps for each node of a frame.
pub(super) struct Clock {
    queries: wgpu::QuerySet,
    nodes: u32,
    resolved: wgpu::Buffer,
    readback: Readback,
    nanoseconds: f32,
}

impl Clock {
    /// For a plan with this many nodes.
    pub fn new(gpu: &Gpu, nodes: usize) -> Self {
        let nodes = nodes as u32;
        let count = 2 * nodes.max(1);
        let bytes = u64::from(count) * 8;
        Self {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("node times"),
                ty: wgpu::QueryType::Timestamp,
                count,
            }),
            nodes,
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

    /// The timestamps that one pass of a node writes: the first pass writes the node's begin, the last one its end.
    pub fn of_pass(&self, node: NodeId, is_first: bool, is_last: bool) -> Option<PassTimes<'_>> {
        let begin = is_first.then_some(2 * node.raw());
        let end = is_last.then_some(2 * node.raw() + 1);
        (is_first || is_last).then_some(PassTimes { queries: &self.queries, begin, end })
    }

    /// Records the end of a frame, after all of its nodes.
    pub fn resolve(&mut self, encoder: &mut wgpu::CommandEncoder, frame: u64) {
        let count = 2 * self.nodes;
        encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
        let staged = self.readback.record(frame);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, staged, 0, u64::from(count) * 8);
    }

    /// Requests the recorded timestamps; call it after the submission.
    pub fn map(&mut self) {
        self.readback.map();
    }

    /// For each node: when it began, relative to the first node that `ran`, and how long it took, both in milliseconds;
    /// zeros for nodes that did not run. `None` if the frame was not recorded.
    pub fn read(
        &mut self,
        gpu: &Gpu,
        frame: u64,
        ran: impl Fn(NodeId) -> bool,
        mut each: impl FnMut(NodeId, [f32; 2]),
    ) -> Result<(), RunError> {
        let (nodes, nanoseconds) = (self.nodes, self.nanoseconds);
        let milliseconds = |ticks: u64| ticks as f32 * nanoseconds * 1e-6;
        self.readback.take(gpu, frame, |bytes| {
            let ticks: &[[u8; 8]] = bytemuck::cast_slice(bytes);
            let tick = |at: usize| u64::from_le_bytes(ticks[at]);
            let span = |node: NodeId| [tick(2 * node.index()), tick(2 * node.index() + 1)];
            let nodes = || (0..nodes).map(NodeId::from_raw);
            let first = nodes().filter(|node| ran(*node)).map(|node| span(node)[0]).min().unwrap_or(0);
            for node in nodes() {
                let [begin, end] = span(node);
                let times = [begin.saturating_sub(first), end.saturating_sub(begin)].map(milliseconds);
                each(node, if ran(node) { times } else { [0.0; 2] });
            }
        })
    }
}

/// The timestamps that a pass writes.
pub(super) struct PassTimes<'a> {
    queries: &'a wgpu::QuerySet,
    begin: Option<u32>,
    end: Option<u32>,
}

impl<'a> PassTimes<'a> {
    pub fn compute(self) -> wgpu::ComputePassTimestampWrites<'a> {
        wgpu::ComputePassTimestampWrites {
            query_set: self.queries,
            beginning_of_pass_write_index: self.begin,
            end_of_pass_write_index: self.end,
        }
    }

    pub fn raster(self) -> wgpu::RenderPassTimestampWrites<'a> {
        wgpu::RenderPassTimestampWrites {
            query_set: self.queries,
            beginning_of_pass_write_index: self.begin,
            end_of_pass_write_index: self.end,
        }
    }
}
