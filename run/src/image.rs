//! The contents of a port as values.

use std::ops::Index;

use epigraph_core::{ItemMember, Scalar, Snapshot};
use epigraph_pictures::{Number, lanes};

use crate::Error;

/// An element type of [`crate::Run::read`]: one to four f32, u32 or i32.
pub trait Pixel: ItemMember + bytemuck::Pod {}

impl<T: ItemMember + bytemuck::Pod> Pixel for T {}

/// The elements of a port: an image, or a list of height 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Image<T> {
    /// Width and height; a list has height 1.
    pub size: [u32; 2],
    /// The elements row by row, from the top.
    pub pixels: Vec<T>,
    /// The frame in which it was captured, from 0.
    pub frame: u64,
}

impl<T: Pixel> Image<T> {
    /// Converts a snapshot. Floats of any width are read as f32.
    pub(crate) fn of(snapshot: &Snapshot) -> Result<Self, Error> {
        let lanes = lanes(&snapshot.element);
        let fits = |lane: &epigraph_pictures::Lane| match T::SCALAR {
            Scalar::F32 => lane.is_float(),
            Scalar::U32 => lane.is_unsigned(),
            Scalar::I32 => !lane.is_float() && !lane.is_unsigned(),
        };
        if lanes.len() != T::LANES as usize || !lanes.iter().all(fits) {
            return Err(Error::Input(format!(
                "`{}` holds {}, which cannot be read as {} {}",
                full_name(snapshot),
                snapshot.element,
                T::LANES,
                T::SCALAR.wgsl()
            )));
        }
        let count = snapshot.dims.count();
        let mut words = vec![0u32; count * lanes.len()];
        for (at, lane) in lanes.iter().enumerate() {
            for (index, number) in lane.numbers(snapshot).enumerate() {
                words[index * lanes.len() + at] = Number::bits(number);
            }
        }
        Ok(Self {
            size: [snapshot.dims.width, snapshot.dims.height],
            pixels: bytemuck::pod_collect_to_vec(&words),
            frame: snapshot.frame,
        })
    }
}

/// `node.port` or `node.port.field`.
fn full_name(snapshot: &Snapshot) -> String {
    match snapshot.field.as_str() {
        "" => snapshot.name.clone(),
        field => format!("{}.{field}", snapshot.name),
    }
}

/// The pixel in column `x` and row `y`, from the top left.
impl<T> Index<[u32; 2]> for Image<T> {
    type Output = T;

    /// # Panics
    /// If the image has no such pixel.
    fn index(&self, [x, y]: [u32; 2]) -> &T {
        let [width, height] = self.size;
        // A column too far to the right would be a pixel of the next row.
        assert!(x < width && y < height, "no pixel {x},{y} in an image of {width}x{height}");
        &self.pixels[y as usize * self.size[0] as usize + x as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> Image<u32> {
        Image { size: [3, 2], pixels: (0..6).collect(), frame: 0 }
    }

    #[test]
    fn pixels_are_found_by_column_and_row() {
        assert_eq!([[0, 0], [2, 0], [0, 1], [2, 1]].map(|at| image()[at]), [0, 2, 3, 5]);
    }

    #[test]
    #[should_panic(expected = "no pixel 3,0 in an image of 3x2")]
    fn a_column_beyond_the_last_is_no_pixel_of_the_next_row() {
        let _ = image()[[3, 0]];
    }
}
