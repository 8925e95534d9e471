//! The sample behind a pixel: which point of the cloud it shows, and what is known of it.

use epigraph_core::{Access, Capture, Extent, Finding, Graph, Node, Port, PortElement, Snapshot};

use super::{
    cloud::{AGE, AGE_ONE, CHANGED, FRESH, decode_radiance},
    requests::NO_POINT,
    words::place,
};
use crate::age::increment;

/// A point of the cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Its slot.
    pub point: usize,
    /// Where it lies, metres; none for one whose ray met nothing.
    pub surface: Option<[f32; 3]>,
    /// What the cloud knows of it.
    pub findings: Vec<Finding>,
}

/// The point of the cloud that a pixel first shows, before any is culled, with what the cloud knows of it; `order` are the
/// graph's nodes in the order in which they run. None where no node gives a point to each pixel, or this pixel has none.
pub fn behind(
    graph: &Graph,
    order: impl Iterator<Item = usize>,
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
    let mut sources = node.sources.iter().flatten().map(|source| graph.name(*source));
    if let Some(cloud) = sources.find(|name| capture.field(name, "meta").is_some()) {
        know(graph, capture, &cloud, &mut sample);
    }
    Some(sample)
}

/// The output that says which point each pixel shows.
fn id_port(node: &Node) -> Option<&Port> {
    let is_id = |port: &&Port| {
        port.name == "id"
            && port.access == Access::Write
            && port.extent == Extent::Frame(1)
            && port.fields.iter().any(|field| field.element == u32::element())
    };
    node.declaration().ports.iter().find(is_id)
}

/// Adds what the cloud knows of a point.
fn know(graph: &Graph, capture: &Capture, cloud: &str, sample: &mut Sample) -> Option<()> {
    let meta = capture.field(cloud, "meta")?;
    let bits: u32 = element(meta, sample.point)?;
    let [x, y, z, w]: [f32; 4] = element(capture.field(cloud, "position")?, sample.point)?;
    let radiance: u32 = element(capture.field(cloud, "radiance")?, sample.point)?;
    sample.surface = (w != 0.0).then_some([x, y, z]);
    sample.findings.extend([
        match sample.surface {
            Some(position) => Finding::value("position", format!("{} m", place(position))),
            None => Finding::value("direction", format!("{}; its ray met nothing", place([x, y, z]))),
        },
        Finding::color("radiance", &decode_radiance(radiance)),
        Finding::value("age", format!("{:.2} of 255", (bits & AGE) as f32 / AGE_ONE as f32)),
        Finding::value("traced", traced(graph, capture, bits, meta.dims.count())),
    ]);
    if bits & CHANGED != 0 {
        sample.findings.push(Finding::value("flagged", "a colour changed near it"));
    }
    Some(())
}

/// When a point was traced, as far as its age tells: the cloud keeps no date.
fn traced(graph: &Graph, capture: &Capture, meta: u32, slots: usize) -> String {
    if meta & FRESH != 0 {
        return "since the last frame; it came into the cloud in this one".into();
    }
    let rate = graph
        .nodes
        .iter()
        .filter(|node| node.kind == "age")
        .find_map(|node| element::<f32>(capture.field(&format!("{}.rate", node.name), "")?, 0));
    match rate.map(|rate| increment(rate, slots as u32)).filter(|step| *step > 0) {
        Some(step) => {
            let frames = (meta & AGE) as f32 / step as f32;
            format!(
                "about {:.0} frames ago at most, by its age at {:.2} a frame",
                frames.ceil() + 1.0,
                step as f32 / AGE_ONE as f32
            )
        }
        None => "earlier; the cloud keeps no date".into(),
    }
}

/// One element of a copy.
fn element<T: bytemuck::Pod>(snapshot: &Snapshot, at: usize) -> Option<T> {
    let bytes = snapshot.bytes.get(at * size_of::<T>()..(at + 1) * size_of::<T>())?;
    Some(bytemuck::pod_read_unaligned(bytes))
}
