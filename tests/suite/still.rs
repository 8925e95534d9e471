//! While nothing moves, stages that depend only on the mesh and the view are skipped; while no samples arrive either,
//! nearly all. Neither changes the picture.

use epigraph::{Pace, Place, Query, Sample, SampleSource};
use epigraph_core::{Frame, Settings, Side};
use epigraph_stages::World;
use epigraph_tests::{GRAPHS as SHIPPED, Run, Stage, graph, sampled, tap};

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

/// Runs a frame with the camera at rest where it is in frame `at` of its path; `asks`: it may request samples.
fn rest(run: &mut Run, at: u32, asks: bool, capture: bool) {
    let Frame { view, .. } = World::frame_of(run.path(), at, SIZE, 0, 1);
    let next = run.next_frame();
    let samples = if asks { next.samples } else { 0 };
    run.run(&Frame { view, previous: view, predicted: view, samples, ..next }, capture).unwrap();
}

/// The nodes that ran in the last frame.
fn names(run: &Run) -> Vec<&str> {
    let nodes = run.executor.plan().nodes.iter().zip(run.executor.ran());
    nodes.filter(|(_, ran)| **ran).map(|(node, _)| node.name.as_str()).collect()
}

#[test]
fn a_frame_without_news_runs_only_what_looks_for_them() {
    let looks: [(&str, &[&str]); 3] = [
        ("render-cache.ron", &["trace"]),
        ("epi.ron", &["mesh", "shadow_edges", "trace"]),
        ("hybrid.ron", &["mesh", "shadow_edges", "trace"]),
    ];
    for (name, looks) in looks {
        for side in [Side::Cpu, Side::Gpu] {
            for poison in [false, true] {
                let mut run = start(name, "orbit", &[], Settings { poison, ..settings(side) });
                for _ in 0..2 {
                    for at in 0..4 {
                        rest(&mut run, at, true, false);
                    }
                    // The last samples arrive; in the next two frames all comes to rest, on both slots of what swaps.
                    let counts = [0; 8].map(|_| {
                        rest(&mut run, 3, false, false);
                        names(&run).len()
                    });
                    let late = if name == "hybrid.ron" { 1 } else { 0 };
                    assert_eq!(names(&run), looks, "{name} on {side}: {counts:?}");
                    assert_eq!(counts[3 + late..6], [looks.len(); 3][late..], "{name} on {side}: {counts:?}");
                    assert!(counts[2] < counts[1], "{name} on {side}: {counts:?}");
                    assert_eq!(run.executor.moved().iter().sum::<u64>(), 0, "{name} on {side}");
                }
            }
        }
    }
}

/// Answers in some frames, with a sample in the middle of the picture.
struct Sometimes;

impl SampleSource for Sometimes {
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        let asked = query.requests().next();
        if let (Some(request), true) = (asked, query.frame.index < 4) {
            let ray = query.ray(request);
            samples[0] = Sample::surface(request, ray.origin + 2.0 * ray.direction, ray.direction.abs());
        }
    }

    fn pace(&self) -> Pace {
        Pace::Exact
    }
}

#[test]
fn requests_are_made_although_no_answer_comes() {
    for side in [Side::Cpu, Side::Gpu] {
        let mut run = start("epi.ron", "still", &[], settings(side));
        let place = Place::load("chains", "still").unwrap();
        run.set_host(place.host_with(Box::new(Sometimes)));
        for frame in 0..9 {
            rest(&mut run, 0, true, false);
            let few = names(&run) == ["mesh", "shadow_edges", "request", "trace"];
            assert_eq!(few, frame >= 7, "{side}, frame {frame}: {:?}", names(&run));
        }
    }
}

/// Where the camera is on its path, and whether samples are requested.
const PLAY: [(u32, bool); 18] = [
    (0, true),
    (1, true),
    (2, true),
    (2, true),
    (2, false),
    (2, false),
    (2, false),
    (2, false),
    (2, true),
    (2, false),
    (2, false),
    (3, false),
    (3, false),
    (3, false),
    (3, false),
    (3, true),
    (3, true),
    (4, true),
];

fn same_while_resting(name: &str, scene: &'static str, side: Side, poison: bool) {
    let run = |settings| Run::new(&graph(name), Stage { scene, camera: "orbit", settings });
    let mut whole = run(Settings { prune: false, ..settings(side) });
    let mut pruned = run(Settings { poison, ..settings(side) });
    for (frame, (at, asks)) in PLAY.into_iter().enumerate() {
        let [whole, pruned] = [&mut whole, &mut pruned].map(|run| {
            rest(run, at, asks, true);
            run.captured("image").bytes
        });
        assert!(whole == pruned, "{name}, {scene}, {side}, poison {poison}: frame {frame} is another");
    }
}

#[test]
fn pictures_are_the_same_whatever_rests() {
    for name in SHIPPED {
        same_while_resting(name, "cornell-moving", Side::Cpu, false);
    }
    for name in ["render-cache.ron", "epi.ron", "hybrid.ron"] {
        for side in [Side::Cpu, Side::Gpu] {
            same_while_resting(name, "cornell", side, true);
        }
        same_while_resting(name, "cornell-moving", Side::Gpu, true);
    }
}
