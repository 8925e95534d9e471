//! A steady frame allocates nothing: counted over the whole process, tracing included. A binary of its own, because the
//! counting allocator is global.

use epigraph_core::{Settings, Side};
use epigraph_tests::{Run, Stage, graph};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<std::alloc::System> = &INSTRUMENTED_SYSTEM;

#[test]
fn a_steady_frame_allocates_nothing() {
    let settings = Settings { side: Side::Cpu, ..Settings::new([160, 120], 900) };
    let mut run = Run::new(&graph("render-cache.ron"), Stage { scene: "cornell", camera: "orbit", settings });
    // Inside the pool, as the command line runs it: work handed in from outside goes through a queue that allocates.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let (steady, control) = pool.install(|| {
        run.frames(12);
        let region = Region::new(ALLOCATOR);
        for _ in 0..20 {
            run.frame(false);
        }
        let steady = region.change();
        let region = Region::new(ALLOCATOR);
        drop(std::hint::black_box(vec![1u8; 100]));
        (steady, region.change())
    });
    assert!(control.allocations >= 1, "the count must be able to fail");
    assert_eq!(steady.allocations, 0, "{steady:?}");
    assert_eq!(steady.reallocations, 0, "{steady:?}");
}
