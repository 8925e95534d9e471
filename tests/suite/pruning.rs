//! Leaving out what a scene does not need changes no bit of any picture: in every shipped graph, in scenes that need
//! much and scenes that need little, while the camera moves and while it does not.

use epigraph_core::{Settings, Side};
use epigraph_tests::{GRAPHS, Run, Stage, graph, sampled};

const FRAMES: u32 = 5;

/// The pictures of all frames, and the names of the nodes that are left out.
fn pictures(
    name: &str,
    scene: &'static str,
    camera: &'static str,
    settings: Settings,
) -> (Vec<Vec<u8>>, Vec<String>) {
    let mut run = Run::new(&graph(name), Stage { scene, camera, settings });
    let frames = (0..FRAMES).map(|_| {
        run.frame(true);
        run.captured("image").bytes
    });
    let frames = frames.collect();
    (frames, run.plan().culled.iter().map(|culled| culled.node.clone()).collect())
}

fn same_with_and_without(name: &str, scene: &'static str, camera: &'static str, side: Side) -> Vec<String> {
    let settings = Settings { side, ..sampled([47, 38], 0.1) };
    let whole = Settings { prune: false, ..settings.clone() };
    let [(whole, all), (pruned, left_out)] =
        [whole, settings].map(|settings| pictures(name, scene, camera, settings));
    for (frame, (whole, pruned)) in whole.iter().zip(&pruned).enumerate() {
        assert!(
            whole == pruned,
            "{name}, {scene}, {camera}, {side}: frame {frame} is another without {left_out:?}"
        );
    }
    left_out.into_iter().filter(|node| !all.contains(node)).collect()
}

#[test]
fn pictures_of_shipped_graphs_are_the_same_without_what_a_scene_does_not_need() {
    let mut left_out = Vec::new();
    for name in GRAPHS {
        for scene in ["cornell", "chains", "cornell-moving"] {
            for camera in ["still", "orbit"] {
                left_out.extend(same_with_and_without(name, scene, camera, Side::Cpu));
            }
        }
    }
    for name in ["render-cache.ron", "epi.ron"] {
        for camera in ["still", "orbit"] {
            left_out.extend(same_with_and_without(name, "chains", camera, Side::Gpu));
        }
    }
    left_out.sort();
    left_out.dedup();
    for needless in ["motion", "carry", "predict", "albedo"] {
        assert!(left_out.iter().any(|node| node.ends_with(needless)), "{left_out:?}");
    }
}
