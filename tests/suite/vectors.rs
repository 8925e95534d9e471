//! Twins write the same bits with and without the processor's wider vectors, on one thread and on two: in every shipped graph,
//! at sizes of which no side is a multiple of the number of lanes.

use epigraph::Place;
use epigraph_core::{Settings, Side, Snapshot};
use epigraph_tests::{GRAPHS, Run, graph, sampled};

const FRAMES: u32 = 6;

/// Every port that a node writes in the last of some frames, in order.
fn ports(name: &str, place: &Place, settings: &Settings, threads: usize) -> Vec<Snapshot> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let mut run = Run::with_all_ports(&graph(name), place, settings);
        run.frames(FRAMES);
        let snapshots = run.executor.snapshots().expect("of a frame that has run");
        snapshots.into_iter().cloned().collect()
    })
}

#[test]
fn every_port_of_shipped_graphs_is_the_same_with_and_without_vectors() {
    let places = ["cornell", "chains"].map(|scene| Place::load(scene, "orbit").expect("a built-in scene"));
    for name in GRAPHS {
        for (place, size) in places.iter().zip([[75, 46], [131, 39]]) {
            let settings = Settings { side: Side::Cpu, ..sampled(size, 0.1) };
            let baseline = ports(name, place, &Settings { vectors: false, ..settings.clone() }, 1);
            assert!(!baseline.is_empty(), "{name}");
            for (vectors, threads) in [(false, 2), (true, 1), (true, 2)] {
                let found = ports(name, place, &Settings { vectors, ..settings.clone() }, threads);
                for (baseline, found) in baseline.iter().zip(&found) {
                    let what = format!("{name}: {} {}", baseline.name, baseline.field);
                    assert!(
                        baseline.bytes == found.bytes,
                        "{what} with vectors: {vectors}, {threads} threads"
                    );
                }
            }
        }
    }
}
