//! The ports of the shipped graphs, and what their stages explain about pixels.

use std::collections::HashSet;

use epigraph::Place;
use epigraph_core::{Capture, GraphFile, Settings, Snapshot};
use epigraph_tests::{GRAPHS, Run, graph, sampled};

use super::{Figure, Figures, assert_same};
use crate::sides::with_random_parameters;

/// Scenes and camera paths.
const PLACES: [(&str, &str); 5] = [
    ("cornell", "orbit"),
    ("cornell-moving", "shake"),
    ("chains", "fly"),
    ("cornell", "still"),
    ("cornell-moving", "still"),
];

impl Figure {
    /// Adds the elements of a port.
    fn port(&mut self, snapshot: &Snapshot) {
        self.debug(&(snapshot.dims, &snapshot.element));
        let size = snapshot.element.bytes() as usize;
        let floats = snapshot.element.floats();
        for element in snapshot.bytes.chunks_exact(size) {
            for at in (0..size).step_by(4) {
                let word: [u8; 4] = std::array::from_fn(|byte| element[at + byte]);
                match floats.contains(&at) {
                    true => self.number(f64::from(f32::from_le_bytes(word))),
                    false => self.exact(&word),
                }
            }
        }
    }
}

/// Runs some frames on the CPU, and adds figures of all ports and of what the stages explain.
fn measure(what: &str, file: &GraphFile, place: &Place, settings: &Settings, figures: &mut Figures) {
    // What stages explain follows from their scratch ports too.
    let mut run = Run::with_ports(file, place, settings, |_| true);
    let nodes = run.graph().nodes.iter();
    let scratch: HashSet<String> = nodes
        .flat_map(|node| {
            let ports = node.declaration().ports.iter().filter(|port| port.scratch);
            ports.map(|port| format!("{}.{}", node.name, port.name))
        })
        .collect();
    for _ in 0..5 {
        let frame = run.next_frame();
        run.frame(true);
        let snapshots = run.executor.snapshots().expect("on the CPU");
        for snapshot in snapshots.iter().filter(|snapshot| !scratch.contains(&snapshot.name)) {
            let Snapshot { name, field, .. } = snapshot;
            let dot = if field.is_empty() { "" } else { "." };
            figures.entry(format!("{what} {name}{dot}{field}")).or_default().port(snapshot);
        }
        let capture = Capture { frame, snapshots: snapshots.into_iter().cloned().map(Into::into).collect() };
        let graph = run.graph();
        let [width, height] = settings.size;
        for (id, node) in graph.nodes.iter_enumerated() {
            for pixel in (0..width * height).step_by(13) {
                let site = capture.site(graph, id, [pixel % width, pixel / width], Some(pixel as usize));
                if let Some(findings) = node.stage.explain(&site) {
                    figures.entry(format!("{what} {} explained", node.name)).or_default().debug(&findings);
                }
            }
        }
    }
}

#[test]
fn ports_of_the_shipped_graphs_are_as_before() {
    let mut figures = Figures::new();
    for (index, name) in GRAPHS.iter().enumerate() {
        let (scene, camera) = PLACES[index % PLACES.len()];
        let place = Place::load(scene, camera).expect("a scene and a camera path");
        let file = crate::sides::without_placements(graph(name));
        let what = format!("{} {scene} {camera}", name.trim_end_matches(".ron"));
        measure(&what, &file, &place, &sampled([41, 33], 0.08), &mut figures);
    }
    assert_same("graphs", &figures);
}

#[test]
fn ports_with_random_parameters_are_as_before() {
    let mut figures = Figures::new();
    for index in 0..30 {
        let name = ["epi.ron", "render-cache.ron", "experiments/complex-pixels.ron"][index % 3];
        let (file, _) = with_random_parameters(name, index as u64);
        let (scene, camera) = PLACES[index / 3 % PLACES.len()];
        let place = Place::load(scene, camera).expect("a scene and a camera path");
        let what = format!("{} {scene} {camera}", name.trim_end_matches(".ron"));
        let settings = Settings { poison: true, ..sampled([33, 26], 0.08) };
        measure(&what, &file, &place, &settings, &mut figures);
    }
    assert_same("parameters", &figures);
}
