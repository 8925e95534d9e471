//! The steps of the algorithm, as in figure 4 of the papers: a few enlarged pixels with the data of each.

use epigraph_pictures::{
    EMPTY, Ramp,
    edges::{self, EDGE},
};

use super::{
    canvas::Canvas,
    shot::{Dissected, Layers, Shot},
    window::Window,
};
use crate::sheet::Tile;

/// Side of an enlarged pixel: 5x5 squares of two pixels each, and a border of one pixel.
const CELL: usize = 12;

/// Colour of shadow boundaries.
const SHADOW: [u8; 3] = [255, 165, 50];
/// Colour of the lines between pixels, and width of strokes.
const GRID: [u8; 3] = [44, 49, 72];
const STROKE: f32 = 2.0;

/// A drawing of one step of the algorithm.
#[derive(Clone, Copy, Debug)]
pub enum Panel {
    /// The colours of the points.
    Points,
    /// The edges' crossings with pixels.
    Edges,
    /// The classes of the pixels: empty, simple or complex.
    Classes,
    /// The reachable neighbours of each pixel.
    Reachability,
    /// The priority of new samples.
    Priority,
    /// The final picture.
    Result,
}

impl Panel {
    /// All steps, in the order of the algorithm.
    pub const ALL: [Self; 6] =
        [Self::Points, Self::Edges, Self::Classes, Self::Reachability, Self::Priority, Self::Result];

    /// Draws the part of the image within the window.
    pub fn draw(self, window: Window, image: &Dissected) -> Tile {
        let layers = &image.layers;
        match self {
            Self::Points => {
                blocks("points", window, layers.size, |pixel| layers.points[pixel].unwrap_or(EMPTY))
            }
            Self::Edges => edges(window, layers),
            Self::Classes => {
                blocks("classes", window, layers.size, |pixel| edges::class_color(layers.cls[pixel]))
            }
            Self::Reachability => reachability(window, layers),
            Self::Priority => blocks("priority", window, layers.size, |pixel| heat(layers.priority[pixel])),
            Self::Result => magnified("result", window, &image.shot),
        }
    }
}

/// Draws an enlarged part of a picture.
pub fn magnified(label: &str, window: Window, shot: &Shot) -> Tile {
    blocks(label, window, shot.size, |pixel| shot.colors[pixel])
}

fn canvas(window: Window) -> Canvas {
    Canvas::new(window.size.map(|side| side * CELL), EMPTY)
}

/// Draws each pixel in one colour.
fn blocks(label: &str, window: Window, image: [usize; 2], color: impl Fn(usize) -> [u8; 3]) -> Tile {
    let mut canvas = canvas(window);
    for (at, pixel) in window.pixels(image[0]) {
        canvas.fill(at.map(|at| at * CELL), [CELL; 2], color(pixel));
    }
    canvas.tile(label)
}

fn heat(priority: u32) -> [u8; 3] {
    Ramp::Magma.color(priority as f32 / 255.0)
}

/// Draws the chords of simple pixels, and ticks at the other crossings.
fn edges(window: Window, layers: &Layers) -> Tile {
    let mut canvas = canvas(window);
    for (at, _) in window.pixels(layers.size[0]) {
        let corner = at.map(|at| at * CELL);
        canvas.fill(corner, [CELL, 1], GRID);
        canvas.fill(corner, [1, CELL], GRID);
    }
    for (at, _) in window.pixels(layers.size[0]) {
        let corner = at.map(|at| (at * CELL) as f32);
        let pixel = [0, 1].map(|axis| window.at[axis] + at[axis]);
        let [all, outlines] = [&layers.mask, &layers.outlines]
            .map(|mask| edges::perimeter(mask, layers.size, pixel).unwrap_or_default());
        // Each half of a chord shows the kind of edge that crosses the side there.
        for stroke in edges::strokes(all) {
            let on_canvas = |place: [f32; 2]| [0, 1].map(|axis| corner[axis] + CELL as f32 * place[axis]);
            let color = if outlines >> stroke.slot & 1 != 0 { EDGE } else { SHADOW };
            canvas.stroke(on_canvas(stroke.from), on_canvas(stroke.to), STROKE, color);
        }
    }
    canvas.tile("edges")
}

/// Draws in each pixel a small map of the 5x5 pixels around it.
fn reachability(window: Window, layers: &Layers) -> Tile {
    let mut canvas = canvas(window);
    for (at, pixel) in window.pixels(layers.size[0]) {
        for (square, color) in edges::reach_glyph(layers.r24[pixel]).into_iter().enumerate() {
            let place = [square % 5, square / 5];
            let corner = [0, 1].map(|axis| at[axis] * CELL + 1 + 2 * place[axis]);
            canvas.fill(corner, [2; 2], color);
        }
    }
    canvas.tile("reachability")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 7x7 pixels with the given crossings of left and top sides (column, row, bit). Those of left sides are outlines.
    fn layers(left: &[[usize; 3]], top: &[[usize; 3]]) -> Layers {
        let mut mask = vec![0; 64];
        let mut mark = |list: &[[usize; 3]], shift: usize| {
            list.iter().for_each(|[x, y, bit]| mask[8 * y + x] |= 1 << (bit + shift));
        };
        mark(left, 0);
        mark(top, 8);
        Layers {
            size: [7, 7],
            points: vec![None; 49],
            cls: vec![0; 49],
            outlines: mask.iter().map(|word| word & 0xFF).collect(),
            mask,
            r24: vec![0; 49],
            priority: vec![0; 49],
        }
    }

    const WHOLE: Window = Window { at: [0, 0], size: [7, 7] };

    /// The segment of E10 in `algorithms.md` section 2.6.
    fn example() -> Layers {
        let left = [[1, 2, 5], [2, 3, 0], [3, 3, 3], [4, 3, 6], [5, 4, 1], [6, 4, 4]];
        layers(&left, &[[1, 3, 6], [4, 4, 4]])
    }

    #[test]
    fn chords_of_neighbours_meet() {
        let tile = edges(WHOLE, &example());
        let at = |x: usize, y: usize| tile.colors[y * tile.size[0] + x];
        // Pixel (3, 3) is crossed at 7/16 on its left and 13/16 on its right: rows 41.25 and 45.75.
        for x in 36..48 {
            let row = 41.25 + 4.5 * (x as f32 + 0.5 - 36.0) / 12.0;
            assert_eq!(at(x, row as usize), EDGE, "{x}");
        }
        // A chord that ends on a bottom side has the shadow colour in that half.
        assert!(tile.colors.contains(&SHADOW) && at(5, 5) == EMPTY && at(5, 0) == GRID);
    }

    #[test]
    fn the_highest_priority_is_the_brightest() {
        let brightness = |priority| heat(priority).iter().map(|&channel| u32::from(channel)).sum::<u32>();
        assert!(brightness(0) < 10 && brightness(128) > brightness(64) && brightness(255) > 600);
    }
}
