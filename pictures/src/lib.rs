//! From numbers to pictures: a port's contents as colours and text, differences between pictures, and picture files.
//! The command line and the editor show ports by the same rules; this crate knows neither of them.
//!
//! - [`lanes`]: the scalars of an element.
//! - [`show`]: an image as sRGB colours, with a [`Look`]; [`describe`]: a pixel as text.
//! - [`Scale`], [`Histogram`]: the mapping from values to shades, and counts of the values; [`Table`]: a list's
//!   elements.
//! - [`edges`]: the words of the edge-and-point image, drawn.
//! - [`Difference`], [`flip`], [`metrics`]: measures of the difference between two pictures.
//! - [`Picture`], [`PortFile`]: files.
//! - [`svg`]: drawings of lines and words.
//!
//! ```
//! use epigraph_pictures::{Difference, Picture};
//!
//! let grey = vec![[128; 3]; 64];
//! let mut spot = grey.clone();
//! spot[27] = [255, 0, 0];
//! let [grey, spot] = [grey, spot].map(|colors| Picture::shown([8, 8], &colors));
//! let difference = Difference::new(&grey, &spot);
//! assert!(difference.flip() > 0.0 && difference.psnr() < 30.0);
//! assert_eq!(Difference::new(&grey, &grey).flip(), 0.0);
//! ```

pub mod edges;
pub mod flip;
pub mod metrics;
pub mod svg;
pub mod tone;

mod ages;
mod describe;
mod difference;
mod encode;
mod histogram;
mod lanes;
mod look;
mod picture;
mod port_file;
mod ramp;
mod scale;
mod table;
mod tiles;

pub use ages::{ages, frames_ago};
pub use describe::{describe, grouped, in_pixel, readable};
pub use difference::{Difference, apart};
pub use encode::{exr, png};
pub use histogram::Histogram;
pub use lanes::{Lane, Number, is_image, lanes, size};
pub use look::{EMPTY, INFINITE, Look, Mode, NAN, POISONED, Shown, show};
pub use picture::{MOST_PIXELS, Picture};
pub use port_file::{Kind, PortFile};
pub use ramp::Ramp;
pub use scale::{Curve, Paint, Scale};
pub use table::Table;
