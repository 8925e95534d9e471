//! The sample of a pixel: which point of the cloud it shows, and what the cloud stores about it.

use epigraph_core::{
    Access, Capture, Extent, Finding, Graph, Node, NodeId, Port, PortElement, PortRef, Snapshot,
};

use super::{
    cloud::{AGE, AGE_ONE, CHANGED, NO_POINT, decode_radiance},
    words::place,
};
use crate::meaning::{DATE, ID, POINTS};

/// A point of the cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Its slot.
    pub point: usize,
    /// Its position, metres; `None` if its ray hit nothing.
    pub surface: Option<[f32; 3]>,
    /// What the cloud stores about it.
    pub findings: Vec<Finding>,
}

/// The point of the cloud that a pixel first shows, before any is culled, with what the cloud stores about it; `order`
/// is the graph's nodes in execution order. `None` if no node assigns points to pixels, or this pixel has none.
pub fn behind(
    graph: &Graph,
    order: impl Iterator<Item = NodeId>,
    capture: &Capture,
    pixel: [u32; 2],
) -> Option<Sample> {
    let (node, port) = order.map(|node| &graph.nodes[node]).find_map(|node| Some((node, id_port(node)?)))?;
    let at = (pixel[1] * capture.frame.size[0] + pixel[0]) as usize;
    let id = element::<u32>(capture.field(&format!("{}.{}", node.name, port.name), "")?, at)?;
    if id == NO_POINT {
        return None;
    }
    let mut sample =
        Sample { point: id as usize, surface: None, findings: vec![Finding::value("point", id.to_string())] };
    let mut sources = node.sources.iter().flatten().copied();
    if let Some(cloud) = sources.find(|source| graph.meaning(*source) == Some(POINTS)) {
        know(graph, capture, cloud, &mut sample);
    }
    Some(sample)
}

/// The output with the point that each pixel shows.
fn id_port(node: &Node) -> Option<&Port> {
    let is_id = |port: &&Port| {
        port.meaning == Some(ID)
            && !port.scratch
            && port.access == Access::Write
            && port.extent == Extent::Frame(1)
            && port.fields.iter().any(|field| field.element == u32::element())
    };
    node.declaration().ports.iter().find(is_id)
}

/// Adds what the cloud stores about a point.
fn know(graph: &Graph, capture: &Capture, cloud: PortRef, sample: &mut Sample) -> Option<()> {
    let name = graph.name(cloud);
    let bits: u32 = element(capture.field(&name, "meta")?, sample.point)?;
    let [x, y, z, w]: [f32; 4] = element(capture.field(&name, "position")?, sample.point)?;
    let radiance: u32 = element(capture.field(&name, "radiance")?, sample.point)?;
    sample.surface = (w != 0.0).then_some([x, y, z]);
    sample.findings.extend([
        match sample.surface {
            Some(position) => Finding::value("position", format!("{} m", place(position))),
            None => Finding::value("direction", format!("{}; its ray met nothing", place([x, y, z]))),
        },
        Finding::color("radiance", &decode_radiance(radiance)),
    ]);
    // Points that no sample renews have neither.
    if let Some(dates) = dates(graph, capture, cloud) {
        sample.findings.extend([
            Finding::value("age", format!("{:.2} of 255", (bits & AGE) as f32 / AGE_ONE as f32)),
            Finding::value("came", came(capture, element::<u32>(dates, sample.point))),
        ]);
    }
    if bits & CHANGED != 0 {
        sample.findings.push(Finding::value("flagged", "a colour changed near it"));
    }
    Some(())
}

/// The frame in which a point came into the cloud. Its sample was traced before that: in the previous frame at the
/// latest, and if frames do not wait for samples, as many frames earlier as tracing took.
fn came(capture: &Capture, date: Option<u32>) -> String {
    let Some(frame) = date.and_then(|date| date.checked_sub(1)) else {
        return "not known; the cloud had it before dates were kept".into();
    };
    match capture.frame.index.saturating_sub(frame) {
        0 => format!("in this frame, {frame}"),
        1 => format!("in frame {frame}, the one before"),
        ago => format!("in frame {frame}, {ago} frames ago"),
    }
}

/// The dates that a stage between the cloud's memory and here records.
fn dates<'a>(graph: &Graph, capture: &'a Capture, mut cloud: PortRef) -> Option<&'a Snapshot> {
    loop {
        let node = &graph.nodes[cloud.node];
        if let Some(port) = node.declaration().ports.iter().position(|port| port.meaning == Some(DATE)) {
            return capture.field(&graph.name(PortRef { node: cloud.node, port }), "");
        }
        if node.declaration().ports[cloud.port].access != Access::Update {
            return None;
        }
        cloud = node.sources[cloud.port]?;
    }
}

/// One element of a copy.
fn element<T: bytemuck::Pod>(snapshot: &Snapshot, at: usize) -> Option<T> {
    let bytes = snapshot.bytes.get(at * size_of::<T>()..(at + 1) * size_of::<T>())?;
    Some(bytemuck::pod_read_unaligned(bytes))
}
