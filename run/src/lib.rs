//! Epigraph as a library: open a graph on a scene, run it frame by frame, read any port.
//!
//! ```
//! use epigraph::{Image, Run, Samples};
//!
//! # fn main() -> Result<(), epigraph::Error> {
//! let mut run = Run::open("epi")?
//!     .scene("cornell")
//!     .camera("orbit")
//!     .size([512, 512])
//!     .samples(Samples::Share(0.05))
//!     .keep(&["interpolate.color"])
//!     .start()?;
//! run.frames(30)?;
//! let color: Image<[f32; 4]> = run.read("interpolate.color")?;      // `size`, and `pixels` row by row
//! let red = color.pixels.iter().map(|pixel| pixel[0]).sum::<f32>() / color.pixels.len() as f32;
//! # assert!(color.size == [512, 512] && red > 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! A [`Setup`] collects the settings of a run: a graph, a [`Place`] (a scene and a camera path through it), the image
//! size, the number of samples and the placement of nodes. [`Setup::compile`] checks the graph and makes a plan, which
//! needs no GPU; [`Compiled::start`] allocates memory. The resulting [`Run`] only runs frames. The command line and the
//! editor are built on these types.
//!
//! The layers below offer more control: [`epigraph_core`] (graph files, plans, executors, the stage interface),
//! [`epigraph_stages`] (the built-in stages), [`epigraph_scenes`] (scenes, camera paths, the ray tracer) and
//! [`epigraph_pictures`] (conversion of port contents to pictures and files).

mod backend;
mod change;
mod error;
pub mod graphs;
mod image;
pub mod memory;
mod place;
mod run;
mod samples;
mod setup;

pub use epigraph_core::{Registry, Snapshot, Source};
pub use epigraph_stages::{
    Pace, Query, Ray, SampleSource, registry,
    shared::requests::{Request, Sample},
};

pub use backend::{Backend, Device};
pub use change::{Change, changed, split};
pub use error::Error;
pub use image::{Image, Pixel};
pub use place::Place;
pub use run::Run;
pub use samples::Samples;
pub use setup::{Compiled, Setup};
