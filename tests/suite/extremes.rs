//! The whole render cache at the ends of what it may be given: sizes, budgets, clouds. Poison is on throughout.

use epigraph_core::{Executor, Facts, RunError, Settings, Side, compile};
use epigraph_stages::facts::CAMERA_MOVES;
use epigraph_tests::{Run, Stage, gpu, graph};

fn image(size: [u32; 2], samples: u32, side: Side, frames: u32) -> Vec<u8> {
    let settings = Settings { side, poison: true, ..Settings::new(size, samples) };
    let mut run = Run::new(&graph("render-cache.ron"), Stage { scene: "cornell", camera: "shake", settings });
    run.frames(frames);
    let image = run.captured("image");
    assert_eq!(image.bytes.len(), 4 * size[0] as usize * size[1] as usize);
    image.bytes
}

/// How many bytes differ by more than one code.
fn differing(a: &[u8], b: &[u8]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a.abs_diff(**b) > 1).count()
}

#[test]
fn odd_sizes_run_alike_on_both_sides() {
    for (size, samples) in [([1, 1], 1), ([1, 64], 20), ([8192, 3], 4000), ([3, 8192], 4000), ([17, 1], 40)] {
        let [cpu, gpu] = [Side::Cpu, Side::Gpu].map(|side| image(size, samples, side, 6));
        let differ = differing(&cpu, &gpu);
        // A point that a rounding moves by a pixel changes that pixel and its neighbours.
        assert!(differ <= cpu.len() / 100, "{size:?}: {differ} of {} bytes", cpu.len());
        // In the wide ones the box is a speck beside the black around it.
        let seen = cpu.iter().any(|byte| *byte != 0 && *byte != 255);
        assert!(seen || size[0] > size[1], "{size:?}: nothing to see");
    }
}

#[test]
fn without_samples_the_picture_stays_black() {
    for side in [Side::Cpu, Side::Gpu] {
        let image = image([40, 30], 0, side, 3);
        assert!(image.chunks_exact(4).all(|pixel| pixel == [0, 0, 0, 255]), "on {side}");
    }
}

#[test]
fn a_budget_beyond_the_pixels_is_no_harm() {
    let [cpu, gpu] = [Side::Cpu, Side::Gpu].map(|side| image([24, 16], 5000, side, 5));
    assert!(differing(&cpu, &gpu) <= cpu.len() / 100);
}

#[test]
fn a_cloud_of_sixteen_million_points_runs() {
    let mut file = graph("render-cache.ron");
    file.set_param("points", "points_per_pixel", "16.0").unwrap();
    let settings = Settings::new([1024, 1024], 20_000);
    let mut run = Run::new(&file, Stage { scene: "cornell", camera: "orbit", settings });
    let cloud =
        run.executor.plan().storages.iter().find(|storage| storage.name == "cloud/points.cloud.position");
    assert_eq!(cloud.expect("the cloud's positions").dims.count(), 1 << 24);
    run.frames(3);
    let image = run.captured("image").bytes;
    let lit = image.chunks_exact(4).filter(|pixel| pixel[..3] != [0, 0, 0]).count();
    assert!(lit > 100_000, "{lit} pixels lit");
}

#[test]
fn a_cloud_beyond_the_device_is_refused_with_its_name() {
    let mut file = graph("render-cache.ron");
    file.set_param("points", "points_per_pixel", "16.0").unwrap();
    let facts = Facts::default().stating(CAMERA_MOVES, true);
    let settings = Settings { side: Side::Gpu, facts, ..Settings::new([1024, 1024], 1000) };
    let registry = epigraph_stages::registry();
    let (graph, plan) = compile(&file, &registry, &settings).unwrap_or_else(|problems| panic!("{problems}"));
    // 256 MiB of positions: lavapipe binds 128. A device that binds them may run.
    match Executor::new(graph, plan, &settings, &registry, Some(gpu())) {
        Err(RunError::Gpu(message)) => assert!(message.contains("cloud/points.cloud.position"), "{message}"),
        Err(other) => panic!("{other}"),
        Ok(_) => assert!(!gpu().is_software()),
    }
}
