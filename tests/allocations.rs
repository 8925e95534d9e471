//! A steady frame allocates nothing: counted over the whole process, tracing included. A binary of its own with one test,
//! because the counting allocator is global.

use epigraph_core::{Settings, Side};
use epigraph_tests::{Run, Stage, graph, tap};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, Stats, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<std::alloc::System> = &INSTRUMENTED_SYSTEM;

#[test]
fn a_steady_frame_allocates_nothing() {
    // Inside the pool, as the command line runs it: work handed in from outside goes through a queue that allocates.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let none = |what: &str, stats: Stats| {
        assert_eq!((stats.allocations, stats.reallocations), (0, 0), "{what}: {stats:?}");
    };
    pool.install(|| {
        none("render cache", of_frames(&mut render_cache()));

        // Few samples and a moving camera: holes in every frame, some of which no colour spreads to.
        let mut epi = epi();
        none("edge-and-point image", of_frames(&mut epi));
        let filled = epi.captured("spread.filled").get::<u32>();
        let holes = filled.iter().filter(|&&round| round != 0).count();
        let enclosed = filled.iter().filter(|&&round| round == u32::MAX).count();
        assert!(holes > 100 && enclosed > 0, "{holes} holes, {enclosed} enclosed");

        let region = Region::new(ALLOCATOR);
        drop(std::hint::black_box(vec![1u8; 100]));
        assert!(region.change().allocations >= 1, "the count must be able to fail");
    });
}

fn render_cache() -> Run {
    let settings = Settings { side: Side::Cpu, ..Settings::new([160, 120], 900) };
    Run::new(&graph("render-cache.ron"), Stage { scene: "cornell", camera: "orbit", settings })
}

fn epi() -> Run {
    let taps = vec![tap("spread.filled")];
    let settings = Settings { side: Side::Cpu, taps, ..Settings::new([160, 120], 200) };
    Run::new(&graph("epi.ron"), Stage { scene: "chains", camera: "orbit", settings })
}

/// What twenty frames allocate once a run has warmed up.
fn of_frames(run: &mut Run) -> Stats {
    run.frames(12);
    let region = Region::new(ALLOCATOR);
    for _ in 0..20 {
        run.frame(true);
    }
    region.change()
}
