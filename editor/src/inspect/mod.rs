//! One pixel, traced through the whole graph: the effect of every node at that pixel in one frame, in execution order.
//!
//! This needs copies of all outputs of all nodes ([`Capture`]), which the engine makes only for frames that are
//! inspected. The stages themselves explain the values.

mod picked;
#[cfg(test)]
mod tests;

use epigraph_core::{Capture, Extent, Finding, Graph, NodeId, Plan, Side, Snapshot, Source};
use epigraph_scenes::{Rng, TraceSettings, Tracer};
use epigraph_stages::shared::sample::{self, Sample};
use glam::Vec3;

pub use picked::Picked;

/// Largest distance between a ray's hit and the point that it was aimed at, as a share of the ray's length.
const SAME_PLACE: f32 = 1e-3;

/// One pixel, traced through the graph in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Inspection {
    /// Column and row.
    pub pixel: [u32; 2],
    /// The frame's number, from 0.
    pub frame: u32,
    /// Bytes copied for the inspection.
    pub bytes: u64,
    /// The point of the cloud that projects to the pixel, nearest to the eye; `None` if there is none.
    pub sample: Option<Vec<Finding>>,
    /// The nodes that run, in execution order.
    pub nodes: Vec<Visit>,
}

/// The effect of one node at the pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Visit {
    /// Its address.
    pub node: String,
    /// Its stage kind.
    pub kind: String,
    /// The side it ran on.
    pub side: Side,
    /// The stage's explanation; `None` if it has none.
    pub findings: Option<Vec<Finding>>,
    /// The values that it wrote at the pixel, as plain numbers: port and values. Scratch ports are left out.
    pub values: Vec<(String, String)>,
}

impl Visit {
    /// True if there is nothing to show.
    pub fn is_silent(&self) -> bool {
        match &self.findings {
            Some(findings) => findings.is_empty(),
            None => self.values.is_empty(),
        }
    }
}

/// The ports to copy: all outputs of all nodes.
pub fn taps(graph: &Graph) -> Vec<Source> {
    let ports = |node: &epigraph_core::Node| {
        let outputs = node.declaration().ports.iter().filter(|port| port.is_output());
        outputs
            .map(|port| Source { node: node.name.clone(), port: port.name.to_string() })
            .collect::<Vec<_>>()
    };
    graph.nodes.iter().flat_map(ports).collect()
}

/// Inspects one pixel of a captured frame.
pub fn inspect(
    graph: &Graph,
    plan: &Plan,
    capture: &Capture,
    pixel: [u32; 2],
    tracer: &Tracer,
) -> Inspection {
    let sample = sample::behind(graph, plan.order(), capture, pixel);
    let point = sample.as_ref().map(|sample| sample.point);
    let visit = |node: NodeId| {
        let site = capture.site(graph, node, pixel, point);
        let node = &graph.nodes[node];
        let outputs = node.declaration().ports.iter().filter(|port| port.is_output());
        let values = outputs.filter(|port| !port.scratch).filter_map(|port| {
            let snapshot = capture.field(&format!("{}.{}", node.name, port.name), "")?;
            Some((port.name.to_string(), value(snapshot, &port.extent, capture.frame.size, pixel)?))
        });
        Visit {
            node: node.name.clone(),
            kind: node.kind.clone(),
            side: node.side,
            findings: node.stage.explain(&site),
            values: values.collect(),
        }
    };
    Inspection {
        pixel,
        frame: capture.frame.index,
        bytes: capture.bytes(),
        nodes: plan.order().map(visit).collect(),
        sample: sample.map(|sample| with_surface(sample, capture, tracer)),
    }
}

/// The contents of a port at a pixel; `None` for lists.
fn value(snapshot: &Snapshot, extent: &Extent, size: [u32; 2], [x, y]: [u32; 2]) -> Option<String> {
    let scale = match extent {
        Extent::Frame(scale) => (*scale).max(1),
        _ => 1,
    };
    let dims = [snapshot.dims.width, snapshot.dims.height];
    let fits = (0..2).all(|axis| dims[axis] >= size[axis].div_ceil(scale));
    fits.then(|| epigraph_pictures::describe(snapshot, [x / scale, y / scale].map(|along| along as usize)))?
}

/// Adds the surface on which the sample lies. The cloud does not store it, so a ray is traced to the point.
fn with_surface(sample: Sample, capture: &Capture, tracer: &Tracer) -> Vec<Finding> {
    let mut findings = sample.findings;
    let Some(position) = sample.surface.map(Vec3::from) else { return findings };
    if tracer.scene().mesh.triangles.is_empty() {
        return findings;
    }
    let eye = Vec3::from(capture.frame.view.eye);
    let distance = eye.distance(position);
    let hit = tracer.trace(eye, position - eye, &TraceSettings::default(), &mut Rng::new(0, 0));
    if !hit.hit || hit.position.distance(position) > SAME_PLACE * distance.max(1.0) {
        findings.push(Finding::value("surface", "not visible from the eye: it is hidden, or has moved"));
        return findings;
    }
    let scene = tracer.scene();
    let material = scene.mesh.material.get(hit.face as usize).copied();
    let name =
        material.and_then(|index| scene.materials.get(index as usize)).map_or("", |material| &material.name);
    let material = match (name, material) {
        ("", Some(index)) => format!(", material {index}"),
        ("", None) => String::new(),
        (name, _) => format!(", material {name}"),
    };
    findings.push(Finding::value("surface", format!("triangle {}{material}", hit.face)));
    findings
}
