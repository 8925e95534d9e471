//! The steps as in figure 4 of the papers: a few pixels, enlarged, with what is known within each of them.

use epigraph_stages::shared::edge_pixel::{CLASS, COMPLEX, SIMPLE, ring, slot_position};

use super::{
    canvas::Canvas,
    shot::{Dissected, Layers, Shot},
    window::Window,
};
use crate::{flip, sheet::Tile, visual::EMPTY};

/// Side of an enlarged pixel: 5x5 squares of two pixels, and a line around them.
const CELL: usize = 12;

/// Edges of objects, and boundaries of shadows.
const OUTLINE: [u8; 3] = [130, 205, 255];
const SHADOW: [u8; 3] = [255, 165, 50];
/// The lines between pixels, and width of strokes.
const GRID: [u8; 3] = [44, 49, 72];
const STROKE: f32 = 2.0;
/// How far a tick reaches from the pixel's side towards its middle.
const TICK: f32 = 0.5;

/// Pixels that no edge crosses, those that one cuts in two, and those where more happens.
const CLASSES: [[u8; 3]; 3] = [[58, 63, 82], [92, 190, 140], [232, 86, 80]];

/// The pixel itself, those that it reaches, and those that it does not.
const SELF: [u8; 3] = [255, 255, 255];
const REACHED: [u8; 3] = [70, 150, 130];
const BARRED: [u8; 3] = [48, 30, 52];

/// A step of the algorithm, drawn.
#[derive(Clone, Copy, Debug)]
pub enum Panel {
    /// The colours of the points.
    Points,
    /// Where edges cross pixels.
    Edges,
    /// What that makes of the pixels.
    Classes,
    /// Which pixels can be reached from each.
    Reachability,
    /// Where new samples are worth most.
    Priority,
    /// The picture.
    Result,
}

impl Panel {
    /// In the order of the algorithm.
    pub const ALL: [Self; 6] =
        [Self::Points, Self::Edges, Self::Classes, Self::Reachability, Self::Priority, Self::Result];

    /// Draws a part of the image.
    pub fn draw(self, window: Window, image: &Dissected) -> Tile {
        let layers = &image.layers;
        match self {
            Self::Points => {
                blocks("points", window, layers.size, |pixel| layers.points[pixel].unwrap_or(EMPTY))
            }
            Self::Edges => edges(window, layers),
            Self::Classes => blocks("classes", window, layers.size, |pixel| class(layers.cls[pixel])),
            Self::Reachability => reachability(window, layers),
            Self::Priority => blocks("priority", window, layers.size, |pixel| heat(layers.priority[pixel])),
            Self::Result => magnified("result", window, &image.shot),
        }
    }
}

/// A part of a picture, enlarged.
pub fn magnified(label: &str, window: Window, shot: &Shot) -> Tile {
    blocks(label, window, shot.size, |pixel| shot.colors[pixel])
}

fn canvas(window: Window) -> Canvas {
    Canvas::new(window.size.map(|side| side * CELL), EMPTY)
}

/// One colour for each pixel of the image.
fn blocks(label: &str, window: Window, image: [usize; 2], color: impl Fn(usize) -> [u8; 3]) -> Tile {
    let mut canvas = canvas(window);
    for (at, pixel) in window.pixels(image[0]) {
        canvas.fill(at.map(|at| at * CELL), [CELL; 2], color(pixel));
    }
    canvas.tile(label)
}

fn class(cls: u32) -> [u8; 3] {
    match cls & CLASS {
        SIMPLE => CLASSES[1],
        COMPLEX => CLASSES[2],
        _ => CLASSES[0],
    }
}

fn heat(priority: u32) -> [u8; 3] {
    flip::magma(&[priority as f32 / 255.0])[0]
}

/// The chords of simple pixels, and ticks at the other crossings.
fn edges(window: Window, layers: &Layers) -> Tile {
    let mut canvas = canvas(window);
    for (at, _) in window.pixels(layers.size[0]) {
        let corner = at.map(|at| at * CELL);
        canvas.fill(corner, [CELL, 1], GRID);
        canvas.fill(corner, [1, CELL], GRID);
    }
    for (at, pixel) in window.pixels(layers.size[0]) {
        let corner = at.map(|at| (at * CELL) as f32);
        for Line { from, to, is_outline } in lines(layers, pixel) {
            let on_canvas = |place: [f32; 2]| [0, 1].map(|axis| corner[axis] + CELL as f32 * place[axis]);
            let color = if is_outline { OUTLINE } else { SHADOW };
            canvas.stroke(on_canvas(from), on_canvas(to), STROKE, color);
        }
    }
    canvas.tile("edges")
}

/// A stroke within a pixel, from its side; in pixels from the top left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    from: [f32; 2],
    to: [f32; 2],
    is_outline: bool,
}

/// What to draw of the edges in a pixel. Each half of a chord shows the kind of edge that crosses the side there.
fn lines(layers: &Layers, pixel: usize) -> Vec<Line> {
    let [all, outlines] = [&layers.mask, &layers.outlines].map(|mask| perimeter(mask, layers.size[0], pixel));
    let slots: Vec<u32> = (0..32).filter(|slot| all >> slot & 1 != 0).collect();
    let place = |slot: u32| slot_position(slot).map(|sixteenths| sixteenths as f32 / 16.0);
    let between = |a: [f32; 2], b: [f32; 2], t: f32| [0, 1].map(|axis| a[axis] + t * (b[axis] - a[axis]));
    let is_chord = layers.cls[pixel] & CLASS == SIMPLE && slots.len() == 2;
    let line = |&slot: &u32| {
        let from = place(slot);
        let to = match slots.as_slice() {
            [p, q] if is_chord => between(place(*p), place(*q), 0.5),
            _ => between(from, [0.5; 2], TICK),
        };
        Line { from, to, is_outline: outlines >> slot & 1 != 0 }
    };
    slots.iter().map(line).collect()
}

/// The crossings around a pixel, `algorithms.md` section 2.3.
fn perimeter(mask: &[u32], width: usize, pixel: usize) -> u32 {
    let above = pixel / width * (width + 1) + pixel % width;
    let [own, right, below] = [above, above + 1, above + width + 1].map(|at| mask[at]);
    ring(own & 0xFF, own >> 8 & 0xFF, right & 0xFF, below >> 8 & 0xFF)
}

/// In each pixel a small picture of the 5x5 pixels around it.
fn reachability(window: Window, layers: &Layers) -> Tile {
    let mut canvas = canvas(window);
    for (at, pixel) in window.pixels(layers.size[0]) {
        for (square, color) in glyph(layers.r24[pixel]).into_iter().enumerate() {
            let place = [square % 5, square / 5];
            let corner = [0, 1].map(|axis| at[axis] * CELL + 1 + 2 * place[axis]);
            canvas.fill(corner, [2; 2], color);
        }
    }
    canvas.tile("reachability")
}

/// The colours of the 5x5 pixels, row by row, from the bits of those around (`algorithms.md` section 2.5).
fn glyph(r24: u32) -> [[u8; 3]; 25] {
    std::array::from_fn(|square| match square {
        12 => SELF,
        // The pixel itself has no bit.
        _ if r24 >> (square - usize::from(square > 12)) & 1 != 0 => REACHED,
        _ => BARRED,
    })
}

#[cfg(test)]
mod tests {
    use epigraph_stages::shared::edge_pixel::EMPTY as EMPTY_PIXEL;

    use super::*;

    /// 7x7 pixels with these crossings at left and top sides: column, row, bit. Outlines are those on the left sides.
    fn layers(left: &[[usize; 3]], top: &[[usize; 3]]) -> Layers {
        let mut mask = vec![0; 64];
        let mut mark = |list: &[[usize; 3]], shift: usize| {
            list.iter().for_each(|[x, y, bit]| mask[8 * y + x] |= 1 << (bit + shift));
        };
        mark(left, 0);
        mark(top, 8);
        let cls = (0..49).map(|pixel| match perimeter(&mask, 7, pixel).count_ones() {
            0 | 1 => EMPTY_PIXEL,
            2 => SIMPLE,
            _ => COMPLEX,
        });
        Layers {
            size: [7, 7],
            points: vec![None; 49],
            cls: cls.collect(),
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
    fn a_simple_pixel_has_its_chord() {
        // E1: from the left side at 7/16 to the right side at 13/16; the slots go clockwise, the right side's comes first.
        let left = Line { from: [0.0, 0.4375], to: [0.5, 0.625], is_outline: true };
        let right = Line { from: [1.0, 0.8125], to: [0.5, 0.625], is_outline: true };
        let layers = example();
        assert_eq!(lines(&layers, 3 * 7 + 3), [right, left]);
        // One end on the bottom side, which the lower neighbour's word has: no outline here.
        let found = lines(&layers, 3 * 7 + 4);
        assert_eq!(found.iter().map(|line| line.is_outline).collect::<Vec<_>>(), [false, true]);
        assert_eq!(found[0].from, [0.5625, 1.0]);
        assert_eq!(lines(&layers, 0), []);
    }

    #[test]
    fn other_pixels_have_ticks() {
        // E9: left, top and right side cross at their first slots.
        let complex = layers(&[[2, 2, 0], [3, 2, 0]], &[[2, 2, 0]]);
        let found = lines(&complex, 2 * 7 + 2);
        assert_eq!(found.len(), 3);
        let top = Line { from: [0.0625, 0.0], to: [0.28125, 0.25], is_outline: false };
        assert_eq!(found[0], top);
        // E8: the loose end of an edge.
        let empty = layers(&[], &[[2, 2, 3]]);
        assert_eq!(
            lines(&empty, 2 * 7 + 2),
            [Line { from: [0.4375, 0.0], to: [0.46875, 0.25], is_outline: false }]
        );
    }

    #[test]
    fn chords_of_neighbours_meet_on_the_picture() {
        let tile = edges(WHOLE, &example());
        let at = |x: usize, y: usize| tile.colors[y * tile.size[0] + x];
        // Pixel (3, 3) is crossed at 7/16 on its left and 13/16 on its right: rows 41.25 and 45.75.
        for x in 36..48 {
            let row = 41.25 + 4.5 * (x as f32 + 0.5 - 36.0) / 12.0;
            assert_eq!(at(x, row as usize), OUTLINE, "{x}");
        }
        // Where an end lies on a bottom side, its half is a shadow's.
        assert!(tile.colors.contains(&SHADOW) && at(5, 5) == EMPTY && at(5, 0) == GRID);
    }

    #[test]
    fn classes_have_three_colours() {
        let crossed = layers(&[[2, 2, 0], [3, 2, 0]], &[[2, 2, 0]]);
        assert_eq!([0, 16, 9].map(|pixel| class(crossed.cls[pixel])), [CLASSES[0], CLASSES[2], CLASSES[0]]);
        let row: Vec<_> = example().cls[21..28].iter().map(|&cls| class(cls)).collect();
        let [empty, simple, _] = CLASSES;
        assert_eq!(row, [empty, simple, simple, simple, simple, empty, empty]);
    }

    #[test]
    fn the_map_of_reached_pixels() {
        // E10 without a sample: the two rows above, E and E2 beside.
        let found = glyph(0x0033FF);
        assert_eq!((&found[..10], &found[15..]), (&[REACHED; 10][..], &[BARRED; 10][..]));
        assert_eq!(found[10..15], [BARRED, BARRED, SELF, REACHED, REACHED]);
        // From its other side, the rest.
        let found = glyph(0xFFCC00);
        assert_eq!((&found[..10], &found[15..]), (&[BARRED; 10][..], &[REACHED; 10][..]));
        assert_eq!(found[10..15], [REACHED, REACHED, SELF, BARRED, BARRED]);
    }

    #[test]
    fn the_hottest_is_the_palest() {
        let brightness = |priority| heat(priority).iter().map(|&channel| u32::from(channel)).sum::<u32>();
        assert!(brightness(0) < 10 && brightness(128) > brightness(64) && brightness(255) > 600);
    }
}
