//! While nothing moves, stages that depend only on the mesh and the view are skipped, which does not change the
//! picture.

use epigraph_core::{Settings, Side};
use epigraph_tests::{Run, Stage, graph, sampled, tap};

const SIZE: [u32; 2] = [64, 48];
const FRAMES: u32 = 5;

/// Graphs, their nodes that depend only on the mesh and the view, and the ports that must be the same with and without
/// pruning.
const GRAPHS: [(&str, &[&str], &[&str]); 2] = [
    ("epi.ron", &["silhouette"], &["silhouette.drawn", "edge_raster.mask", "image"]),
    ("hybrid.ron", &["silhouette", "compact"], &["silhouette.drawn", "compact.count", "image"]),
];

fn start(name: &str, camera: &'static str, ports: &[&str], settings: Settings) -> Run {
    let taps = ports.iter().filter(|port| port.contains('.')).map(|port| tap(port)).collect();
    let settings = Settings { taps, ..settings };
    Run::new(&graph(name), Stage { scene: "chains", camera, settings })
}

fn settings(side: Side) -> Settings {
    Settings { side, ..sampled(SIZE, 0.05) }
}

fn ran(run: &Run, name: &str) -> bool {
    let nodes = &run.executor.plan().nodes;
    let node = nodes.position(|node| node.name == name).unwrap_or_else(|| panic!("no node `{name}`"));
    run.executor.ran()[node]
}

#[test]
fn silhouettes_are_recomputed_only_when_the_camera_moves() {
    for (name, nodes, _) in GRAPHS {
        for side in [Side::Cpu, Side::Gpu] {
            for (camera, moves) in [("still", false), ("orbit", true)] {
                let mut run = start(name, camera, &[], settings(side));
                for frame in 0..FRAMES {
                    run.frame(false);
                    for node in nodes {
                        let expected = moves || frame == 0;
                        assert_eq!(
                            ran(&run, node),
                            expected,
                            "{node} of {name} on {side}, {camera}, frame {frame}"
                        );
                    }
                    assert!(ran(&run, "edges/edge_raster"));
                }
            }
        }
    }
}

#[test]
fn skipping_stages_changes_no_bit() {
    for (name, nodes, ports) in GRAPHS {
        for side in [Side::Cpu, Side::Gpu] {
            for (camera, poison) in [("still", false), ("still", true), ("orbit", true)] {
                let whole = Settings { prune: false, ..settings(side) };
                let pruned = Settings { poison, ..settings(side) };
                let [mut whole, mut pruned] =
                    [whole, pruned].map(|settings| start(name, camera, ports, settings));
                for frame in 0..FRAMES {
                    whole.frame(true);
                    pruned.frame(true);
                    assert!(nodes.iter().all(|node| ran(&whole, node)), "{name} on {side}, frame {frame}");
                    for port in ports {
                        let same = whole.captured(port).bytes == pruned.captured(port).bytes;
                        assert!(same, "{port} of {name} on {side}, {camera}, poison {poison}, frame {frame}");
                    }
                }
            }
        }
    }
}
