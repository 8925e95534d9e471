//! Contact sheets: one image of many labelled pictures.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// The font of labels.
const WEIGHT: FontWeight = FontWeight::Regular;
const LETTER: RasterHeight = RasterHeight::Size24;

/// Pixels around each picture, and between a label and its picture.
const GAP: usize = 12;
const LABEL_GAP: usize = 4;
/// Longest side of a picture on the sheet, in pixels. Larger pictures are shrunk, much smaller ones enlarged.
const LONGEST_SIDE: usize = 512;
/// Largest ratio of columns to rows: a sheet has at least as many columns as rows.
const ASPECT: f64 = 2.0;

const BACKGROUND: [u8; 3] = [32, 33, 36];
const TEXT: [u8; 3] = [225, 225, 220];

/// A picture with its label.
pub struct Tile {
    /// Text above the picture.
    pub label: String,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// sRGB, rows from the top.
    pub colors: Vec<[u8; 3]>,
}

/// Arranges all tiles in rows, in their order, as one image: its width and height, and its sRGB pixels.
pub fn sheet(tiles: &[Tile]) -> ([usize; 2], Vec<[u8; 3]>) {
    let tiles: Vec<Tile> = tiles.iter().map(fitted).collect();
    let columns = columns(tiles.len());
    let rows = tiles.len().div_ceil(columns);
    let letter = get_raster_width(WEIGHT, LETTER);
    let label_width = |tile: &Tile| tile.label.chars().count() * letter;
    let cell_width = tiles.iter().map(|tile| tile.size[0].max(label_width(tile))).max().unwrap_or(0);
    let cell_height = tiles.iter().map(|tile| tile.size[1]).max().unwrap_or(0) + LETTER.val() + LABEL_GAP;
    let size = [columns * (cell_width + GAP) + GAP, rows * (cell_height + GAP) + GAP];
    let mut canvas = Canvas { size, colors: vec![BACKGROUND; size[0] * size[1]] };
    for (index, tile) in tiles.iter().enumerate() {
        let left = GAP + index % columns * (cell_width + GAP);
        let top = GAP + index / columns * (cell_height + GAP);
        canvas.text([left, top], &tile.label);
        canvas.picture([left, top + LETTER.val() + LABEL_GAP], tile);
    }
    (canvas.size, canvas.colors)
}

/// The number of columns that leaves the fewest cells empty.
fn columns(tiles: usize) -> usize {
    let side = |ratio: f64| (tiles.max(1) as f64 * ratio).sqrt().ceil() as usize;
    let empty = |columns: usize| tiles.div_ceil(columns) * columns - tiles;
    (side(1.0)..=side(ASPECT)).min_by_key(|&columns| empty(columns)).unwrap_or(1)
}

struct Canvas {
    size: [usize; 2],
    colors: Vec<[u8; 3]>,
}

impl Canvas {
    fn picture(&mut self, [left, top]: [usize; 2], tile: &Tile) {
        let [width, _] = tile.size;
        for (row, colors) in tile.colors.chunks_exact(width.max(1)).enumerate() {
            let start = (top + row) * self.size[0] + left;
            self.colors[start..start + width].copy_from_slice(colors);
        }
    }

    /// Draws a line of text; characters that the font lacks become question marks.
    fn text(&mut self, [mut left, top]: [usize; 2], text: &str) {
        for letter in text.chars() {
            let Some(raster) = get_raster(letter, WEIGHT, LETTER).or_else(|| get_raster('?', WEIGHT, LETTER))
            else {
                continue;
            };
            for (y, row) in raster.rows().enumerate() {
                for (x, &coverage) in row.iter().enumerate() {
                    let color = &mut self.colors[(top + y) * self.size[0] + left + x];
                    for (channel, text) in color.iter_mut().zip(TEXT) {
                        let mix = u32::from(*channel) * (255 - u32::from(coverage))
                            + u32::from(text) * u32::from(coverage);
                        *channel = (mix / 255) as u8;
                    }
                }
            }
            left += raster.width();
        }
    }
}

/// The tile scaled by an integer factor, so that its longest side comes close to [`LONGEST_SIDE`].
fn fitted(tile: &Tile) -> Tile {
    let longest = tile.size[0].max(tile.size[1]).max(1);
    let (size, colors) = if longest > LONGEST_SIDE {
        shrunk(tile, longest.div_ceil(LONGEST_SIDE))
    } else {
        enlarged(tile, LONGEST_SIDE / longest)
    };
    Tile { label: tile.label.clone(), size, colors }
}

/// Scales down: every new pixel is the mean of a block.
fn shrunk(tile: &Tile, factor: usize) -> ([usize; 2], Vec<[u8; 3]>) {
    let [width, height] = tile.size;
    let mean = |[x, y]: [usize; 2]| {
        let xs = x * factor..((x + 1) * factor).min(width);
        let ys = y * factor..((y + 1) * factor).min(height);
        let count = (xs.len() * ys.len()) as u32;
        let mut sum = [0u32; 3];
        for pixel in ys.flat_map(|y| xs.clone().map(move |x| y * width + x)) {
            for (sum, channel) in sum.iter_mut().zip(tile.colors[pixel]) {
                *sum += u32::from(channel);
            }
        }
        sum.map(|sum| ((sum + count / 2) / count) as u8)
    };
    let size = tile.size.map(|side| side.div_ceil(factor));
    (size, places(size).map(mean).collect())
}

/// Scales up: every pixel becomes a block.
fn enlarged(tile: &Tile, factor: usize) -> ([usize; 2], Vec<[u8; 3]>) {
    let size = tile.size.map(|side| side * factor);
    (size, places(size).map(|[x, y]| tile.colors[y / factor * tile.size[0] + x / factor]).collect())
}

/// All pixel positions of an image, row by row.
fn places([width, height]: [usize; 2]) -> impl Iterator<Item = [usize; 2]> {
    (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(label: &str, size: [usize; 2], color: [u8; 3]) -> Tile {
        Tile { label: label.into(), size, colors: vec![color; size[0] * size[1]] }
    }

    #[test]
    fn every_tile_is_on_the_sheet_with_a_label() {
        let red = [200, 0, 0];
        let (size, colors) = sheet(&[tile("a.b", [40, 30], red), tile("c.d", [40, 30], [0, 200, 0])]);
        assert_eq!(colors.len(), size[0] * size[1]);
        // Enlarged twelve times, to 480 x 360, and side by side.
        let [pictures, labels] = [GAP + LETTER.val() + LABEL_GAP, GAP];
        assert_eq!(size, [2 * (480 + GAP) + GAP, pictures + 360 + GAP]);
        let cut = |[left, top]: [usize; 2], size_of: [usize; 2]| -> Vec<[u8; 3]> {
            places(size_of).map(|[x, y]| colors[(top + y) * size[0] + left + x]).collect()
        };
        for (column, (text, color)) in [("a.b", red), ("c.d", [0, 200, 0])].into_iter().enumerate() {
            let left = GAP + column * (480 + GAP);
            assert!(cut([left, pictures], [480, 360]).iter().all(|&found| found == color), "{text}");
            assert!(cut([left, labels], [480, LETTER.val()]) == label(text, 480), "{text}");
        }
        let background = colors.iter().filter(|&&color| color == BACKGROUND).count();
        let drawn: usize = ["a.b", "c.d"]
            .iter()
            .map(|text| label(text, 480).iter().filter(|&&color| color != BACKGROUND).count())
            .sum();
        assert_eq!(background, colors.len() - 2 * 480 * 360 - drawn, "something else was drawn");
    }

    /// A line of text on nothing else.
    fn label(text: &str, width: usize) -> Vec<[u8; 3]> {
        let size = [width, LETTER.val()];
        let mut canvas = Canvas { size, colors: vec![BACKGROUND; size[0] * size[1]] };
        canvas.text([0, 0], text);
        canvas.colors
    }

    #[test]
    fn labels_can_be_read() {
        let letter = get_raster_width(WEIGHT, LETTER);
        let width = 4 * letter;
        let inked = |colors: &[[u8; 3]], column: usize| {
            let columns = column * letter..(column + 1) * letter;
            colors
                .chunks_exact(width)
                .flat_map(|row| &row[columns.clone()])
                .filter(|&&[r, ..]| r > 150)
                .count()
        };
        // Letters where letters are, and none where none are.
        let colors = label("a b", width);
        assert_eq!([0, 1, 2, 3].map(|column| inked(&colors, column) > 10), [true, false, true, false]);
        assert_ne!(label("a.b", width), label("c.d", width));
        assert_ne!(label("ab", width), label("ba", width));
        // What the font lacks.
        assert_eq!(label("\u{1f600}", width), label("?", width));
    }

    #[test]
    fn few_cells_stay_empty() {
        assert_eq!([0, 1, 2, 11, 12, 13].map(columns), [1, 1, 2, 4, 4, 5]);
    }

    #[test]
    fn large_pictures_are_averaged() {
        let mut large = tile("x", [2 * LONGEST_SIDE, 3], [0; 3]);
        large.colors[0] = [200; 3];
        let small = fitted(&large);
        assert_eq!(small.size, [LONGEST_SIDE, 2]);
        assert_eq!((small.colors[0], small.colors[1]), ([50; 3], [0; 3]));
    }

    #[test]
    fn no_tiles_make_an_empty_sheet() {
        let (size, colors) = sheet(&[]);
        assert_eq!(colors.len(), size[0] * size[1]);
    }
}
