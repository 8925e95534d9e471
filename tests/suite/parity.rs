//! The whole render cache on CPU and GPU, with a still and a moving camera: the pictures agree within the stated
//! bounds.

use epigraph_core::{Settings, Side};
use epigraph_tests::{Run, Stage, graph, sampled, tap};

const SIZE: [u32; 2] = [96, 72];
const FRAMES: u32 = 12;

fn settings(side: Side) -> Settings {
    let taps = ["cull.id", "fill.priority"].map(tap).to_vec();
    Settings { side, taps, ..sampled(SIZE, 0.05) }
}

fn run(name: &str, camera: &'static str, settings: Settings) -> Run {
    let mut run = Run::new(&graph(name), Stage { scene: "cornell", camera, settings });
    run.frames(FRAMES);
    run
}

/// Mean absolute difference of two 8-bit images, in codes.
fn difference(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

/// If a number rounds differently on the two sides, a point may move by one pixel, which changes the next requests for
/// samples. From then on, the sides no longer agree exactly. But few pixels may differ, and the picture must look the
/// same: at most 1% of the pixels show another point, and the mean difference is at most half a code.
#[test]
fn both_sides_show_the_same() {
    for camera in ["still", "orbit"] {
        let mut cpu = run("render-cache.ron", camera, settings(Side::Cpu));
        let mut gpu = run("render-cache.ron", camera, settings(Side::Gpu));
        let ids = [&mut cpu, &mut gpu].map(|run| run.captured("cull.id").get::<u32>());
        let other = ids[0].iter().zip(&ids[1]).filter(|(a, b)| a != b).count();
        let images = [&mut cpu, &mut gpu].map(|run| run.captured("image").bytes);
        let mean = difference(&images[0], &images[1]);
        println!("{camera}: {other} pixels with another point, mean difference {mean}");
        assert!(other <= ids[0].len() / 100, "{camera}: {other} of {} pixels", ids[0].len());
        assert!(mean <= 0.5, "{camera}: mean difference {mean} codes");
    }
}

#[test]
fn the_comparison_can_fail() {
    let mut file = graph("render-cache.ron");
    file.set_param("cull", "threshold", "0.0").unwrap();
    let mut other =
        Run::new(&file, Stage { scene: "cornell", camera: "orbit", settings: settings(Side::Cpu) });
    other.frames(FRAMES);
    let mut same = run("render-cache.ron", "orbit", settings(Side::Cpu));
    let ids = [&mut other, &mut same].map(|run| run.captured("cull.id").get::<u32>());
    assert!(ids[0].iter().zip(&ids[1]).filter(|(a, b)| a != b).count() > ids[0].len() / 100);
}

#[test]
fn poison_pooling_and_pruning_change_nothing() {
    for side in [Side::Cpu, Side::Gpu] {
        for camera in ["still", "orbit"] {
            let plain = run("render-cache.ron", camera, settings(side)).captured("image");
            let poisoned = Settings { poison: true, ..settings(side) };
            let unpooled = Settings { pooling: false, ..settings(side) };
            for (what, settings) in [("poison", poisoned), ("no pooling", unpooled)] {
                let image = run("render-cache.ron", camera, settings).captured("image");
                assert!(plain == image, "{what} on {side}, {camera}");
            }
        }
        let plain = run("render-cache.ron", "still", settings(side)).captured("image");
        let unpruned = Settings { prune: false, ..settings(side) };
        assert!(plain == run("render-cache.ron", "still", unpruned).captured("image"), "unpruned on {side}");
    }
}
