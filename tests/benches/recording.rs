//! What the executor adds to wgpu: frames through it, and the same dispatches recorded by hand, in turn. Each is timed until
//! it is submitted, and until the GPU has done it, which on a software GPU is the time of the shaders.
//!
//! `cargo bench -p epigraph-tests --bench recording` runs it.

use std::time::Instant;

use epigraph_core::testing::ByHand;
use epigraph_tests::{gpu, on_gpu_alone};

const WARM_UP: u32 = 30;
const FRAMES: usize = 300;

fn main() {
    // Inside the pool, like the command line: work that is passed in from outside goes through a queue.
    rayon::ThreadPoolBuilder::new().build().expect("threads").install(frames);
}

fn frames() {
    // The number of pixels changes no dispatch, and software takes long for each.
    let size = if gpu().is_software() { [128, 128] } else { [512, 512] };
    println!("{FRAMES} frames of {}x{} pixels on {}, milliseconds", size[0], size[1], gpu().name());
    for name in ["render-cache.ron", "epi.ron"] {
        let mut run = on_gpu_alone(name, size);
        run.frames(WARM_UP);
        let by_hand = ByHand::of(&run.executor).expect("only dispatches");
        let wait = || by_hand.wait().expect("a device that works");
        wait();
        // By executor and by hand: until a frame is submitted, and until it is done.
        let mut times = [(); 4].map(|()| Vec::with_capacity(FRAMES));
        for round in 0..FRAMES {
            let (frame, parity) = (run.next_frame(), run.executor.frames() as usize % 2);
            // Who comes first in a frame comes second in the next.
            for who in [round % 2, 1 - round % 2] {
                let start = Instant::now();
                match who {
                    0 => run.run(&frame, false).expect("stages and a device that work"),
                    _ => by_hand.frame(&frame, parity),
                }
                times[2 * who].push(start.elapsed());
                wait();
                times[2 * who + 1].push(start.elapsed());
            }
        }
        let times = times.map(|mut times| {
            times.sort_unstable();
            // On a busy machine, the fastest tenth is what other programs have not disturbed.
            [FRAMES / 10, FRAMES / 2].map(|nth| times[nth].as_secs_f64() * 1000.0)
        });
        println!("{name}: {} dispatches", by_hand.dispatches());
        for (what, [executor, by_hand]) in
            [("submitted", [times[0], times[2]]), ("done", [times[1], times[3]])]
        {
            for (nth, rank) in ["fastest tenth", "median"].into_iter().enumerate() {
                let (executor, by_hand) = (executor[nth], by_hand[nth]);
                let ratio = executor / by_hand;
                println!(
                    "  {what:<9}  {rank:<13}  executor {executor:.3}  by hand {by_hand:.3}  ratio {ratio:.3}"
                );
            }
        }
    }
}
