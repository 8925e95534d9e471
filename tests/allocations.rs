//! A steady frame allocates no memory; on the GPU, none but what wgpu does for the same dispatches. Allocations are counted
//! in the whole process, including the tracer. The counting allocator is global, so this test is a binary of its own.

use std::sync::Arc;

use epigraph_core::{Facts, Settings, Side, testing::ByHand};
use epigraph_scenes::{
    Scene,
    streams::{self, Points, encode},
};
use epigraph_tests::{Run, Stage, graph, on_gpu_alone, tap};
use glam::Vec3;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, Stats, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<std::alloc::System> = &INSTRUMENTED_SYSTEM;

#[test]
fn a_steady_frame_allocates_nothing() {
    // Runs inside the pool, like the command line: work passed in from outside goes through a queue that allocates.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let none = |what: &str, stats: Stats| {
        assert_eq!((stats.allocations, stats.reallocations), (0, 0), "{what}: {stats:?}");
    };
    pool.install(|| {
        none("render cache", of_frames(&mut render_cache()));

        // With few samples and a moving camera, every frame has holes, some of which no colour spreads to.
        let mut epi = epi();
        none("edge-and-point image", of_frames(&mut epi));
        let filled = epi.captured("spread.filled").get::<u32>();
        let holes = filled.iter().filter(|&&round| round != 0).count();
        let enclosed = filled.iter().filter(|&&round| round == u32::MAX).count();
        assert!(holes > 100 && enclosed > 0, "{holes} holes, {enclosed} enclosed");

        none("filtered image", of_frames(&mut epi_filtered()));

        none("point set", of_frames(&mut point_set()));

        for graph in ["render-cache.ron", "epi.ron"] {
            let count = |stats: Stats| [stats.allocations, stats.reallocations, stats.bytes_allocated];
            let [executor, by_hand] = on_gpu(graph).map(count);
            assert!(by_hand[0] > 0, "wgpu allocates for each dispatch");
            assert_eq!(executor, by_hand, "{graph}: allocations, reallocations and bytes of twenty frames");
        }

        let region = Region::new(ALLOCATOR);
        drop(std::hint::black_box(vec![1u8; 100]));
        assert!(region.change().allocations >= 1, "an allocation was not counted");
    });
}

fn render_cache() -> Run {
    let settings = Settings { side: Side::Cpu, ..Settings::new([160, 120], 900, Facts::none()) };
    Run::new(&graph("render-cache.ron"), Stage { scene: "cornell", camera: "orbit", settings })
}

fn epi() -> Run {
    let taps = vec![tap("spread.filled")];
    let settings = Settings { side: Side::Cpu, taps, ..Settings::new([160, 120], 200, Facts::none()) };
    Run::new(&graph("epi.ron"), Stage { scene: "chains", camera: "orbit", settings })
}

fn epi_filtered() -> Run {
    let settings = Settings { side: Side::Cpu, ..Settings::new([160, 120], 900, Facts::none()) };
    Run::new(&graph("epi-filtered.ron"), Stage { scene: "cornell", camera: "orbit", settings })
}

fn point_set() -> Run {
    let wall: Vec<Vec3> =
        (0..128 * 128).map(|i| Vec3::new((i % 128) as f32, (i / 128) as f32, 0.0)).collect();
    let points = encode(&Points::from(wall), &streams::Settings { levels: 4, ..Default::default() }).unwrap();
    let scene = Arc::new(Scene::of_points("wall", Arc::new(points.into())));
    let settings = Settings { side: Side::Cpu, ..Settings::new([160, 120], 1, Facts::none()) };
    Run::in_scene(&graph("streams.ron"), &scene, "orbit", settings)
}

/// The allocations of twenty frames on the GPU by the executor, and of the same dispatches recorded by hand: wgpu's own.
/// Each frame ends before the next begins: how often wgpu finds an encoder to use again depends on how far the GPU is. Of
/// several rounds the fewest count: hash tables of wgpu's allocator grow in one or the other, by their random seeds.
fn on_gpu(graph: &str) -> [Stats; 2] {
    let mut run = on_gpu_alone(graph, [64, 48]);
    run.frames(12);
    let by_hand = ByHand::of(&run.executor).expect("only dispatches");
    let frame = run.next_frame();
    let of_twenty = |record: &mut dyn FnMut(usize)| {
        let mut record = |number| {
            record(number);
            by_hand.wait().expect("a device that works");
        };
        (0..4).for_each(&mut record);
        let rounds = (0..5).map(|_| {
            let region = Region::new(ALLOCATOR);
            (0..20).for_each(&mut record);
            region.change()
        });
        rounds.min_by_key(|stats| stats.allocations).expect("several rounds")
    };
    [of_twenty(&mut |_| run.frame(false)), of_twenty(&mut |number| by_hand.frame(&frame, number % 2))]
}

/// The allocations of twenty frames of a run that has warmed up.
fn of_frames(run: &mut Run) -> Stats {
    run.frames(12);
    let region = Region::new(ALLOCATOR);
    for _ in 0..20 {
        run.frame(true);
    }
    region.change()
}
