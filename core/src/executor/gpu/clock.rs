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

    /// Hands on the [`spans`] of a frame's nodes. Nothing happens if the frame was not recorded.
    pub fn read(
        &mut self,
        gpu: &Gpu,
        frame: u64,
        ran: impl Fn(NodeId) -> bool,
        each: impl FnMut(NodeId, [f32; 2]),
    ) -> Result<(), RunError> {
        let (nodes, nanoseconds) = (self.nodes, self.nanoseconds);
        self.readback.take(gpu, frame, |bytes| {
            let ticks: &[[u8; 8]] = bytemuck::cast_slice(bytes);
            let tick = |at: usize| u64::from_le_bytes(ticks[at]);
            let of = |node: NodeId| [tick(2 * node.index()), tick(2 * node.index() + 1)];
            spans(nodes, of, nanoseconds, ran, each);
        })
    }
}

/// For each node: when it began, relative to the first node that `ran`, and how long it took, both in milliseconds;
/// zeros for nodes that did not run. `ticks` are the timestamps of its begin and end, each of so many nanoseconds.
fn spans(
    nodes: u32,
    ticks: impl Fn(NodeId) -> [u64; 2],
    nanoseconds: f32,
    ran: impl Fn(NodeId) -> bool,
    mut each: impl FnMut(NodeId, [f32; 2]),
) {
    let milliseconds = |ticks: u64| ticks as f32 * nanoseconds * 1e-6;
    let nodes = || (0..nodes).map(NodeId::from_raw);
    let begins = nodes().filter(|node| ran(*node)).map(|node| ticks(node)[0]);
    let first = begins.min().unwrap_or_default();
    for node in nodes() {
        let [begin, end] = ticks(node);
        let times = [begin.saturating_sub(first), end.saturating_sub(begin)].map(milliseconds);
        each(node, if ran(node) { times } else { [0.0; 2] });
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AdapterChoice;

    #[test]
    fn times_are_milliseconds_since_the_first_node_that_ran() {
        // The third node did not run: what it holds is an earlier frame's.
        let ticks =
            [[5_000_000, 5_500_000], [4_000_000, 6_000_000], [1_000_000, 9_000_000], [7_000_000, 7_000_000]];
        let spans = |ran: &dyn Fn(NodeId) -> bool| {
            let mut found = Vec::new();
            spans(4, |node| ticks[node.index()], 0.5, ran, |node, span| found.push((node.raw(), span)));
            found
        };
        let expected = [(0, [0.5, 0.25]), (1, [0.0, 1.0]), (2, [0.0, 0.0]), (3, [1.5, 0.0])];
        assert_eq!(spans(&|node| node.raw() != 2), expected);
        assert_eq!(spans(&|_| false), [0, 1, 2, 3].map(|node| (node, [0.0, 0.0])));
    }

    #[test]
    fn the_first_pass_of_a_node_writes_its_begin_and_the_last_one_its_end() {
        let gpu = Gpu::open(AdapterChoice::Any).unwrap();
        if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return;
        }
        let clock = Clock::new(&gpu, 4);
        let of = |is_first, is_last| {
            let times = clock.of_pass(NodeId::from_raw(3), is_first, is_last);
            times.map(|PassTimes { begin, end, .. }| (begin, end))
        };
        assert_eq!(of(false, false), None);
        assert_eq!(of(true, false), Some((Some(6), None)));
        assert_eq!(of(false, true), Some((None, Some(7))));
        assert_eq!(of(true, true), Some((Some(6), Some(7))));
    }
}
