//! Copies of what the nodes of a graph wrote in one frame, and each node's view of them.

use std::sync::Arc;

use crate::{
    explain::{Fields, PortContents, Site},
    frame::Frame,
    graph::Graph,
    id::NodeId,
    port::{Access, Dims, Element, Meaning},
    side::{Download, Side},
};

/// The contents of one field of a tapped port at the end of its node.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// The tap's name: `node.port` or an output.
    pub name: String,
    /// The field, empty for the only one.
    pub field: String,
    /// What the port's values mean, if declared.
    pub meaning: Option<Meaning>,
    /// Its elements.
    pub element: Element,
    /// The number of elements, as width and height.
    pub dims: Dims,
    /// The frame it was taken in.
    pub frame: u64,
    /// The elements, tightly packed, row by row.
    pub bytes: Vec<u8>,
}

impl Snapshot {
    /// The elements as values of `T`, whose size must be the element's or a divisor of it.
    pub fn get<T: bytemuck::Pod>(&self) -> Vec<T> {
        bytemuck::pod_collect_to_vec(&self.bytes)
    }
}

/// Copies of what the nodes of a graph wrote in one frame, each taken right after its node ran.
#[derive(Clone, Debug, Default)]
pub struct Capture {
    /// The frame.
    pub frame: Frame,
    /// The copies, named `node.port`.
    pub snapshots: Vec<Arc<Snapshot>>,
}

impl Capture {
    /// The copy of one field of `node.port`; the field of a port of one variable has no name.
    pub fn field(&self, port: &str, field: &str) -> Option<&Snapshot> {
        let found = self.snapshots.iter().find(|snapshot| snapshot.name == port && snapshot.field == field);
        found.map(Arc::as_ref)
    }

    /// Bytes of all copies.
    pub fn bytes(&self) -> u64 {
        self.snapshots.iter().map(|snapshot| snapshot.bytes.len() as u64).sum()
    }

    /// A pixel inside the frame, as seen by a node of the captured `graph`. `element` becomes [`Site::element`].
    pub fn site(&self, graph: &Graph, node: NodeId, pixel: [u32; 2], element: Option<usize>) -> Site<'_> {
        let ports = (0..graph.nodes[node].sources.len()).map(|port| self.contents(graph, node, port));
        Site::new(&self.frame, pixel, element, ports.collect())
    }

    fn contents(&self, graph: &Graph, id: NodeId, port: usize) -> PortContents<'_> {
        let node = &graph.nodes[id];
        let declared = &node.declaration().ports[port];
        let fields = |name: &str| -> Fields<'_> {
            let bytes = |field: &str| Some(self.field(name, field)?.bytes.as_slice());
            declared.fields.iter().map(|field| bytes(&field.name)).collect()
        };
        let source = node.sources[port].filter(|source| {
            let is_late = matches!(node.download, Download::Latent(frames) if frames > 0)
                && node.side == Side::Cpu
                && graph.nodes[source.node].side == Side::Gpu;
            !is_late && declared.access != Access::History
        });
        PortContents {
            read: source.map_or_else(Vec::new, |source| fields(&graph.name(source))),
            written: fields(&format!("{}.{}", node.name, declared.name)),
        }
    }
}
