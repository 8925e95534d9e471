//! Shipped graphs write nothing that their ports may not hold: no NaN, no infinity, no negative colour, no index beyond
//! its list.

use epigraph_core::{Settings, Side};
use epigraph_tests::{GRAPHS, PEERS, Run, Stage, graph, sampled};

const FRAMES: u32 = 5;

fn watch(name: &str, scene: &'static str, camera: &'static str, side: Side) {
    let settings = Settings { side, watch: true, ..sampled([61, 43], 0.1) };
    let mut run = Run::new(&graph(name), Stage { scene, camera, settings });
    for frame in 0..FRAMES {
        run.advance(false).unwrap_or_else(|error| panic!("{name}, {scene}, frame {frame}: {error}"));
    }
}

#[test]
fn shipped_graphs_run_watched_in_every_scene() {
    for name in GRAPHS.into_iter().chain(PEERS) {
        for scene in ["cornell", "chains", "room"] {
            for side in Side::ALL {
                watch(name, scene, "orbit", side);
            }
        }
    }
    for name in ["render-cache.ron", "epi.ron", "hybrid.ron"] {
        for scene in ["cornell-moving", "still-life"] {
            for (side, camera) in [(Side::Cpu, "still"), (Side::Gpu, "orbit")] {
                watch(name, scene, camera, side);
            }
        }
    }
}
