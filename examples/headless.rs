//! cargo run --release -p epigraph-examples --bin headless
//!
//! Renders the edge-and-point image along a camera path and writes each frame as a PNG: headless-0.png to
//! headless-7.png.

use std::{error::Error, path::Path};

use epigraph::{Run, Samples};
use epigraph_pictures::{Look, PortFile};

fn main() -> Result<(), Box<dyn Error>> {
    let graph = Run::open("epi")?.scene("chains").camera("fly").size([320, 240]);
    let mut run = graph.samples(Samples::Share(0.1)).start()?;
    for index in 0..8 {
        run.frame()?;
        let name = format!("headless-{index}.png");
        PortFile::picture(Path::new(&name))?.write(&[run.snapshot("image")?], &Look::default())?;
        println!("{name}");
    }
    Ok(())
}
