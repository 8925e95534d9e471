//! Work on a picture in tiles: what a measure needs beside its result is bounded by the size of a few tiles, whatever
//! the size of the picture.

use std::ops::Range;

use rayon::prelude::*;

/// Pixels of a band, some whole rows: its tiles are in work at the same time.
const BAND: usize = 1 << 20;
/// Width of a tile. Its height is that of the band.
const WIDTH: usize = 256;

/// A rectangle of pixels.
pub(crate) struct Tile {
    pub x: Range<usize>,
    pub y: Range<usize>,
}

impl Tile {
    /// This tile and all pixels of an image of `size` that are at most `radius` to each side.
    pub fn grown(&self, radius: usize, [width, height]: [usize; 2]) -> Self {
        let grow = |range: &Range<usize>, count: usize| {
            range.start.saturating_sub(radius)..(range.end + radius).min(count)
        };
        Self { x: grow(&self.x, width), y: grow(&self.y, height) }
    }

    /// Its values, row by row, from those of each pixel of an image that is `width` wide.
    pub fn map<T>(&self, width: usize, value: impl Fn(usize) -> T) -> Vec<T> {
        self.y.clone().flat_map(|y| self.x.clone().map(move |x| y * width + x)).map(value).collect()
    }
}

/// Computes a value for each pixel, tile by tile on all threads: `tile` gives the values of a tile, row by row. `band`
/// takes the values of some whole rows at a time, in the order of the image.
pub(crate) fn by_tiles<T: Copy + Default + Send + Sync>(
    size: [usize; 2],
    tile: impl Fn(&Tile) -> Vec<T> + Sync,
    band: impl FnMut(&[T]),
) {
    in_bands(size, [WIDTH, (BAND / size[0].max(1)).max(1)], tile, band);
}

fn in_bands<T: Copy + Default + Send + Sync>(
    [width, height]: [usize; 2],
    [columns, rows]: [usize; 2],
    tile: impl Fn(&Tile) -> Vec<T> + Sync,
    mut band: impl FnMut(&[T]),
) {
    let mut values = Vec::new();
    for top in (0..height).step_by(rows) {
        let y = top..(top + rows).min(height);
        let tiles: Vec<(Tile, Vec<T>)> = (0..width.div_ceil(columns))
            .into_par_iter()
            .map(|column| {
                let x = column * columns..((column + 1) * columns).min(width);
                let place = Tile { x, y: y.clone() };
                let values = tile(&place);
                (place, values)
            })
            .collect();
        values.clear();
        values.resize(width * y.len(), T::default());
        for (place, part) in &tiles {
            for (row, part) in values.chunks_mut(width).zip(part.chunks(place.x.len())) {
                row[place.x.clone()].copy_from_slice(part);
            }
        }
        band(&values);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_gets_its_value_in_order() {
        for size in [[1, 1], [7, 5], [5, 7], [300, 2], [2, 300]] {
            for tiles in [[1, 1], [3, 2], [64, 64], [1000, 1]] {
                let mut all = Vec::new();
                in_bands(size, tiles, |tile| tile.map(size[0], |i| i), |band| all.extend_from_slice(band));
                assert_eq!(all, (0..size[0] * size[1]).collect::<Vec<usize>>(), "{size:?} in {tiles:?}");
            }
        }
        by_tiles([0, 0], |_| Vec::<usize>::new(), |_| panic!("no rows"));
    }

    #[test]
    fn a_tile_grows_within_its_image() {
        let grown = Tile { x: 2..4, y: 9..10 }.grown(3, [6, 10]);
        assert_eq!((grown.x, grown.y), (0..6, 6..10));
    }
}
