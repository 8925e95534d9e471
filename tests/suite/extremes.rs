//! The whole render cache with extreme image sizes, numbers of samples and sizes of the cloud, mostly with poison on.

use epigraph_core::{Executor, Facts, RunError, Settings, Side, compile};
use epigraph_tests::{Run, Stage, facts, gpu, graph};
use glam::Vec3;

use crate::epi::converged;

const CAMERA: &str = "shake";
const FRAMES: u32 = 6;

fn run(size: [u32; 2], samples: u32, side: Side) -> Run {
    let settings = Settings { side, poison: true, ..Settings::new(size, samples, Facts::none()) };
    Run::new(&graph("render-cache.ron"), Stage { scene: "cornell", camera: CAMERA, settings })
}

/// The picture of the next frame.
fn image(run: &mut Run) -> Vec<[u8; 4]> {
    run.frame(true);
    let image = run.captured("image");
    assert_eq!(image.bytes.len(), 4 * image.dims.count());
    image.get()
}

/// Numbers of pixels: those that are not black in `image`, those that are not black in both, and those that are not
/// black in `truth`.
fn lit(image: &[[u8; 4]], truth: &[Vec3]) -> [usize; 3] {
    assert_eq!(image.len(), truth.len());
    let is_lit = |color: &[u8; 4]| color[..3] != [0; 3];
    let both =
        image.iter().zip(truth).filter(|(color, truth)| is_lit(color) && **truth != Vec3::ZERO).count();
    let seen = truth.iter().filter(|color| **color != Vec3::ZERO).count();
    [image.iter().filter(|color| is_lit(color)).count(), both, seen]
}

/// Runs both sides, compares each frame, and returns the pictures of the last one.
fn same_on_both_sides(size: [u32; 2], samples: u32) -> [Vec<[u8; 4]>; 2] {
    // A software GPU rounds like the CPU. On other GPUs, rounding may move a point by a pixel, which changes the
    // colours around it, and any colour may be rounded to the next code.
    let bytes = 4 * (size[0] * size[1]) as usize;
    let [codes, allowed] = if gpu().is_software() { [0, 0] } else { [1, bytes / 100] };
    let mut sides = [Side::Cpu, Side::Gpu].map(|side| run(size, samples, side));
    let mut images = [Vec::new(), Vec::new()];
    for frame in 0..FRAMES {
        images = sides.each_mut().map(image);
        let [cpu, gpu] = images.each_ref().map(|image| image.as_flattened());
        let differ = cpu.iter().zip(gpu).filter(|(a, b)| usize::from(a.abs_diff(**b)) > codes).count();
        assert!(differ <= allowed, "{size:?}, frame {frame}: {differ} bytes differ");
    }
    images
}

#[test]
fn extreme_sizes_give_the_same_picture_on_both_sides() {
    for (size, samples) in [([1, 1], 1), ([1, 64], 20), ([8192, 3], 4000), ([3, 8192], 4000), ([17, 1], 40)] {
        let truth = converged("cornell", CAMERA, size, FRAMES - 1);
        for image in same_on_both_sides(size, samples) {
            // In small or narrow pictures the box is inexact: half of its pixels may be missing, and a tenth of their
            // number, or two pixels, may lie beside it.
            let [lit, both, seen] = lit(&image, &truth);
            assert!(2 * both >= seen && seen > 0, "{size:?}: of {seen} pixels of the box {both} are lit");
            assert!(lit - both <= 2 + seen / 10, "{size:?}: {lit} lit, {both} of them in the box");
            assert!(
                image.as_flattened().iter().any(|byte| *byte != 0 && *byte != 255),
                "{size:?}: the picture is empty"
            );
        }
    }
}

#[test]
fn without_samples_the_picture_stays_black() {
    for side in [Side::Cpu, Side::Gpu] {
        let mut run = run([40, 30], 0, side);
        for _ in 0..3 {
            assert_eq!(image(&mut run), [[0, 0, 0, 255]; 40 * 30], "on {side}");
        }
    }
}

#[test]
fn more_samples_than_pixels_are_harmless() {
    let size = [24, 16];
    let truth = converged("cornell", CAMERA, size, FRAMES - 1);
    for image in same_on_both_sides(size, 5000) {
        // The box may be a few pixels wider, as the colours at its rim spread. A black or white picture would agree in
        // only half of the pixels.
        let [lit, both, seen] = lit(&image, &truth);
        let agree = image.len() + 2 * both - lit - seen;
        assert!(10 * agree >= 8 * image.len(), "{agree} of {} pixels agree with the tracer", image.len());
        assert!(20 * both >= 19 * seen, "{} of {seen} pixels of the box are black", seen - both);
    }
}

#[test]
fn a_cloud_of_sixteen_million_points_runs() {
    let mut file = graph("render-cache.ron");
    file.set_param("points", "points_per_pixel", "16.0").unwrap();
    let settings = Settings::new([1024, 1024], 20_000, Facts::none());
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
fn a_cloud_too_large_for_the_device_is_refused_with_its_name() {
    let mut file = graph("render-cache.ron");
    file.set_param("points", "points_per_pixel", "16.0").unwrap();
    // 16 points per pixel, of 16 bytes each: one row of pixels more than the device's largest binding holds.
    let width = 4096;
    let rows = gpu().most_bound() / (16 * 16 * u64::from(width)) + 1;
    let size = [width, u32::try_from(rows).expect("devices bind less")];
    let settings = Settings { side: Side::Gpu, ..Settings::new(size, 1000, facts(true)) };
    let registry = epigraph_stages::registry();
    let (graph, plan) = compile(&file, &registry, &settings).unwrap_or_else(|problems| panic!("{problems}"));
    match Executor::new(graph, plan, &settings, &registry, Some(gpu())).err() {
        Some(RunError::Gpu(message)) => assert!(message.contains("cloud/points.cloud.position"), "{message}"),
        other => panic!("{other:?}"),
    }
}
