//! The mask of pixels near the edges of a reference, where pictures from sparse samples are worst and errors most
//! visible.

use std::path::Path;

use epigraph_pictures::{Picture, png as encode};
use epigraph_scenes::{Camera, Tracer, reference};

use crate::error::CliError;

/// Greatest distance of a pixel near an edge, in pixels.
pub const REACH: f32 = 2.0;

/// Traces the mask of an image of `size`: set where a pixel lies within [`REACH`] of a pixel that an edge cuts.
pub fn trace(tracer: &Tracer, camera: &Camera, size: [u32; 2]) -> Vec<bool> {
    reference::within(&reference::edges(tracer, camera, size), size[0] as usize, REACH)
}

/// A PNG file's bytes: white where the mask is set, black elsewhere.
pub fn png(mask: &[bool], size: [usize; 2]) -> Result<Vec<u8>, String> {
    let colors: Vec<[u8; 3]> = mask.iter().map(|&set| if set { [255; 3] } else { [0; 3] }).collect();
    encode(size, &colors)
}

/// A mask that was read.
pub struct Mask<'a> {
    path: &'a Path,
    size: [usize; 2],
    set: Vec<bool>,
}

/// Reads a mask: set where the file is brighter than middle grey.
///
/// # Errors
/// If the file cannot be read, or sets no pixel.
pub fn read(path: &Path) -> Result<Mask<'_>, CliError> {
    let picture = Picture::read(path)?;
    let is_bright = |index| picture.srgb_at(index).iter().sum::<f32>() > 1.5;
    let set: Vec<bool> = (0..picture.colors.len()).map(is_bright).collect();
    if !set.contains(&true) {
        return Err(CliError::read(path, "the mask is black; the pixels to compare must be white"));
    }
    Ok(Mask { path, size: picture.size, set })
}

impl Mask<'_> {
    /// The pixels, for an image of `size`.
    ///
    /// # Errors
    /// The mask has another size.
    pub fn of_size(self, size: [usize; 2]) -> Result<Vec<bool>, CliError> {
        if self.size != size {
            let [[width, height], [wanted_width, wanted_height]] = [self.size, size];
            let cause =
                format!("the mask is {width}x{height}, the images are {wanted_width}x{wanted_height}");
            return Err(CliError::read(self.path, cause));
        }
        Ok(self.set)
    }
}

/// The share of set pixels, 0 to 1.
pub fn share(mask: &[bool]) -> f64 {
    mask.iter().filter(|&&set| set).count() as f64 / mask.len().max(1) as f64
}
