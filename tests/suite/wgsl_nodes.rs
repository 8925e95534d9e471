//! Shader files alone can stand in for stages: those of `tests/wgsl/` take the places of the shipped nodes, each alone
//! and all together, and the pictures stay the same, byte for byte.

use std::path::Path;

use epigraph::{Change, changed};
use epigraph_core::{GraphFile, Settings, Side};
use epigraph_stages::registry;
use epigraph_tests::{Run, Stage, graph, sampled, tap};

/// The files, named like the nodes that they stand in for.
const NODES: [&str; 5] = ["age", "edge_raster", "classify", "reach", "interpolate"];

/// The edge-and-point image with shader files in the places of these nodes, and the same parameters.
fn swapped(names: &[&str]) -> GraphFile {
    let epi = graph("epi.ron");
    let mut changes = Vec::new();
    for name in names {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("wgsl").join(name);
        changes.push(Change::swap(&format!("{name}={}.wgsl", file.display())).unwrap());
        let (node, _) = epi.node_at(&epi.address_of(name)).unwrap();
        let set =
            node.params.iter().map(|param| format!("{name}.{}={}", param.name.value, param.value.value));
        changes.extend(set.map(|text| Change::set(&text).unwrap()));
    }
    changed(epi, &changes, &registry()).unwrap_or_else(|problems| panic!("{problems}"))
}

const SIZE: [u32; 2] = [97, 71];

/// What the nodes write, and the picture.
const PORTS: [&str; 9] = [
    "cloud/age.cloud.meta",
    "cloud/age.histogram",
    "edges/edge_raster.mask",
    "edges/edge_raster.vertex",
    "edges/classify.cls",
    "edges/reach.n8",
    "edges/reach.r24",
    "interpolate.color",
    "interpolate.priority",
];

/// The ports and the picture after some frames, of a graph with this many nodes of kind `wgsl`.
fn run(file: &GraphFile, scene: &'static str, nodes: usize) -> Vec<(&'static str, Vec<u8>)> {
    let taps = PORTS.iter().map(|port| tap(port.trim_end_matches(".meta"))).collect();
    let settings = Settings { side: Side::Gpu, taps, poison: true, ..sampled(SIZE, 0.05) };
    let mut run = Run::new(file, Stage { scene, camera: "orbit", settings });
    assert_eq!(run.executor.plan().nodes.iter().filter(|node| node.kind == "wgsl").count(), nodes);
    run.frames(6);
    PORTS.iter().chain(&["image"]).map(|port| (*port, run.captured(port).bytes)).collect()
}

/// Compares a graph with the shipped one.
fn assert_same(names: &[&str], shipped: &[(&str, Vec<u8>)], scene: &'static str) {
    for ((port, found), (_, expected)) in run(&swapped(names), scene, names.len()).iter().zip(shipped) {
        let differ = found.iter().zip(expected).filter(|(a, b)| a != b).count();
        assert!(
            found.len() == expected.len() && differ == 0,
            "{names:?} on {scene}: {differ} bytes of {port} differ"
        );
    }
}

#[test]
fn shader_files_stand_in_for_stages() {
    let shipped = run(&swapped(&[]), "cornell", 0);
    for node in NODES {
        assert_same(&[node], &shipped, "cornell");
    }
    assert_same(&NODES, &shipped, "cornell");
    // With lights, bodies and shadow boundaries that move.
    assert_same(&NODES, &run(&swapped(&[]), "cornell-moving", 0), "cornell-moving");
}

#[test]
fn the_comparison_can_fail() {
    let shipped = run(&swapped(&[]), "cornell", 0);
    let other = swapped(&NODES).with_param("test", "interpolate", "sigma", "0.6").unwrap();
    let differs: Vec<&str> = run(&other, "cornell", NODES.len())
        .iter()
        .zip(&shipped)
        .filter(|((_, found), (_, expected))| found != expected)
        .map(|((port, _), _)| *port)
        .collect();
    assert!(differs.contains(&"interpolate.color") && differs.contains(&"image"), "{differs:?}");
}
