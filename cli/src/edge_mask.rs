//! The pixels near the edges of a reference, where pictures of sparse samples are worst and the eye looks first.

use std::path::Path;

use epigraph_pictures::{Picture, png as encode};
use epigraph_scenes::{Camera, Tracer, reference};

use crate::error::CliError;

/// How far from an edge a pixel counts as near, in pixels.
pub const REACH: f32 = 2.0;

/// Which pixels of an image of `size` lie within [`REACH`] of a pixel that an edge cuts.
pub fn trace(tracer: &Tracer, camera: &Camera, size: [u32; 2]) -> Vec<bool> {
    reference::within(&reference::edges(tracer, camera, size), size[0] as usize, REACH)
}

/// A PNG file's bytes: white where the mask is set, black elsewhere.
pub fn png(mask: &[bool], size: [usize; 2]) -> Result<Vec<u8>, String> {
    let colors: Vec<[u8; 3]> = mask.iter().map(|&set| if set { [255; 3] } else { [0; 3] }).collect();
    encode(size, &colors)
}

/// Reads a mask of an image of `size`: set where the file is brighter than middle grey.
///
/// # Errors
/// That it cannot be read, has another size, or is nowhere set.
pub fn read(path: &Path, size: [usize; 2]) -> Result<Vec<bool>, CliError> {
    let picture = Picture::read(path)?;
    if picture.size != size {
        let [[width, height], [wanted_width, wanted_height]] = [picture.size, size];
        let cause = format!("the mask is {width}x{height}, the images are {wanted_width}x{wanted_height}");
        return Err(CliError::read(path, cause));
    }
    let mask: Vec<bool> = picture.srgb().iter().map(|color| color.iter().sum::<f32>() > 1.5).collect();
    if !mask.contains(&true) {
        return Err(CliError::read(path, "the mask is black: white pixels are the ones to compare"));
    }
    Ok(mask)
}

/// The share of pixels that are set, 0 to 1.
pub fn share(mask: &[bool]) -> f64 {
    mask.iter().filter(|&&set| set).count() as f64 / mask.len().max(1) as f64
}
