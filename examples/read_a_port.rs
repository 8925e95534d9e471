//! cargo run --release -p epigraph-examples --bin read_a_port
//!
//! Reads what a stage in the middle of a graph wrote: which point each pixel shows, and how far away it is.

use std::error::Error;

use epigraph::{Image, Run};

fn main() -> Result<(), Box<dyn Error>> {
    // Only ports that are kept can be read; the others share their memory.
    let graph = Run::open("render-cache")?.scene("cornell").size([320, 240]);
    let mut run = graph.keep(&["view/cull.id", "view/project.depth"]).start()?;
    for index in 0..10 {
        run.frame()?;
        let id: Image<u32> = run.read("view/cull.id")?;
        let depth: Image<u32> = run.read("view/project.depth")?;
        // Pixels without a point have the id 0xFFFFFFFF. Depths are the bits of an f32, which integer atomics can
        // compare.
        let seen = id.pixels.iter().zip(&depth.pixels).filter(|(id, _)| **id != u32::MAX);
        let metres: Vec<f32> = seen.map(|(_, depth)| f32::from_bits(*depth)).collect();
        let share = 100.0 * metres.len() as f32 / id.pixels.len() as f32;
        let mean = metres.iter().sum::<f32>() / metres.len().max(1) as f32;
        println!("frame {index}: {share:.0}% of the pixels show a point, {mean:.2} m away on average");
    }
    Ok(())
}
