//! The words of the edge-and-point image decoded into strokes and colours: crossings, classes, reachability
//! (`algorithms.md` sections 2.2 to 2.5).

use epigraph_stages::shared::edge_pixel::{CLASS, COMPLEX, SIMPLE, ends, ring_at, slot_position};

/// Names and colours of the classes: no edge crosses the pixel or one ends in it; one edge cuts it in two; anything
/// else.
pub const CLASSES: [(&str, [u8; 3]); 3] =
    [("empty", [58, 63, 82]), ("simple", [92, 190, 140]), ("complex", [232, 86, 80])];

/// The colour of edges.
pub const EDGE: [u8; 3] = [130, 205, 255];

/// The colour of the centre pixel of a neighbourhood.
pub const SELF: [u8; 3] = [255, 255, 255];
/// The colour of pixels that the centre reaches.
pub const REACHED: [u8; 3] = [70, 150, 130];
/// The colour of pixels that an edge separates from the centre.
pub const BARRED: [u8; 3] = [48, 30, 52];

/// Length of a tick, from the pixel's side towards its centre.
const TICK: f32 = 0.5;

/// A straight segment of an edge within a pixel; positions in pixels from the top left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// The slot of the pixel's perimeter where it begins.
    pub slot: u32,
    /// Where it begins, on the pixel's side.
    pub from: [f32; 2],
    /// Where it ends.
    pub to: [f32; 2],
}

/// The crossings around a pixel, as a ring of 32 slots. `mask` has a word for each pixel, and one extra column and row.
/// `None` outside the pixels.
pub fn perimeter(mask: &[u32], pixels: [usize; 2], [x, y]: [usize; 2]) -> Option<u32> {
    if x >= pixels[0] || y >= pixels[1] {
        return None;
    }
    // The word of the pixel below is the last one that is read.
    let is_there = (y + 1) * (pixels[0] + 1) + x < mask.len();
    is_there.then(|| ring_at(mask, [x as u32, y as u32], pixels[0]))
}

/// The strokes of the edges in a pixel with this perimeter: both halves of a simple pixel's chord, ticks at all other
/// crossings.
pub fn strokes(ring: u32) -> Vec<Stroke> {
    let slots: Vec<u32> = (0..32).filter(|slot| ring >> slot & 1 != 0).collect();
    let place = |slot: u32| slot_position(slot).map(|sixteenths| sixteenths as f32 / 16.0);
    let between = |a: [f32; 2], b: [f32; 2], t: f32| [0, 1].map(|axis| a[axis] + t * (b[axis] - a[axis]));
    let stroke = |&slot: &u32| {
        let from = place(slot);
        let to = match slots.as_slice() {
            [p, q] => between(place(*p), place(*q), 0.5),
            _ => between(from, [0.5; 2], TICK),
        };
        Stroke { slot, from, to }
    };
    slots.iter().map(stroke).collect()
}

/// The class in a word of `cls`, as an index of [`CLASSES`].
pub fn class(cls: u32) -> usize {
    match cls & CLASS {
        SIMPLE => 1,
        COMPLEX => 2,
        _ => 0,
    }
}

/// The colour of the class in a word of `cls`.
pub fn class_color(cls: u32) -> [u8; 3] {
    CLASSES[class(cls)].1
}

/// The perimeter of a pixel with the chord of a word of `cls`; no crossings if the word has no chord.
pub fn chord(cls: u32) -> u32 {
    let [p, q] = ends(cls);
    if cls & CLASS == SIMPLE { 1 << p | 1 << q } else { 0 }
}

/// The colours of a 5x5 neighbourhood, row by row, from the centre pixel's word of `r24`.
pub fn reach_glyph(r24: u32) -> [[u8; 3]; 25] {
    std::array::from_fn(|square| match square {
        12 => SELF,
        // The centre pixel has no bit.
        _ if r24 >> (square - usize::from(square > 12)) & 1 != 0 => REACHED,
        _ => BARRED,
    })
}

#[cfg(test)]
mod tests {
    use epigraph_stages::shared::edge_pixel::{EMPTY, class_of};

    use super::*;

    /// The words of 7x7 pixels with these crossings at left and top sides: column, row, bit.
    fn mask(left: &[[usize; 3]], top: &[[usize; 3]]) -> Vec<u32> {
        let mut mask = vec![0; 64];
        let mut mark = |list: &[[usize; 3]], shift: usize| {
            list.iter().for_each(|[x, y, bit]| mask[8 * y + x] |= 1 << (bit + shift));
        };
        mark(left, 0);
        mark(top, 8);
        mask
    }

    /// The segment of E10 in `algorithms.md` section 2.6.
    fn example() -> Vec<u32> {
        let left = [[1, 2, 5], [2, 3, 0], [3, 3, 3], [4, 3, 6], [5, 4, 1], [6, 4, 4]];
        mask(&left, &[[1, 3, 6], [4, 4, 4]])
    }

    fn strokes_at(mask: &[u32], at: [usize; 2]) -> Vec<Stroke> {
        strokes(perimeter(mask, [7, 7], at).unwrap())
    }

    #[test]
    fn a_simple_pixel_has_its_chord() {
        // E1: from the left side at 7/16 to the right side at 13/16; the slots go clockwise, the right side's comes
        // first.
        let right = Stroke { slot: 14, from: [1.0, 0.8125], to: [0.5, 0.625] };
        let left = Stroke { slot: 28, from: [0.0, 0.4375], to: [0.5, 0.625] };
        assert_eq!(strokes_at(&example(), [3, 3]), [right, left]);
        // One end on the bottom side, which the lower neighbour's word has.
        assert_eq!(strokes_at(&example(), [4, 3])[0].from, [0.5625, 1.0]);
        assert_eq!(strokes_at(&example(), [0, 0]), []);
        assert_eq!(perimeter(&example(), [7, 7], [7, 3]), None);
    }

    #[test]
    fn pixels_end_where_the_picture_does() {
        let mask = vec![0; 64];
        // The last word counts for no pixel: below the last pixel is the one before it.
        for (words, at, is_there) in [
            (64, [0, 0], true),
            (64, [6, 6], true),
            (64, [7, 6], false),
            (64, [6, 7], false),
            (63, [6, 6], true),
            (62, [6, 6], false),
            (62, [5, 6], true),
            (0, [0, 0], false),
        ] {
            assert_eq!(perimeter(&mask[..words], [7, 7], at).is_some(), is_there, "{words} words, {at:?}");
        }
        for [width, height] in [[3, 9], [9, 3]] {
            let mask = vec![0; (width + 1) * (height + 1)];
            let all = (0..width * height)
                .all(|pixel| perimeter(&mask, [width, height], [pixel % width, pixel / width]).is_some());
            assert!(all, "{width}x{height}");
        }
    }

    #[test]
    fn other_pixels_have_ticks() {
        // E9: left, top and right side cross at their first slots.
        let found = strokes_at(&mask(&[[2, 2, 0], [3, 2, 0]], &[[2, 2, 0]]), [2, 2]);
        assert_eq!(found.len(), 3);
        assert_eq!(found[0], Stroke { slot: 0, from: [0.0625, 0.0], to: [0.28125, 0.25] });
        // E8: the loose end of an edge.
        let found = strokes_at(&mask(&[], &[[2, 2, 3]]), [2, 2]);
        assert_eq!(found, [Stroke { slot: 3, from: [0.4375, 0.0], to: [0.46875, 0.25] }]);
    }

    #[test]
    fn classes_have_three_colours() {
        let crossed = mask(&[[2, 2, 0], [3, 2, 0]], &[[2, 2, 0]]);
        let color = |mask: &[u32], at| class_color(class_of(perimeter(mask, [7, 7], at).unwrap()));
        let [empty, simple, complex] = CLASSES.map(|(_, color)| color);
        assert_eq!([[0, 0], [2, 2], [1, 2]].map(|at| color(&crossed, at)), [empty, complex, empty]);
        let row = [0, 1, 2, 3, 4, 5, 6].map(|x| color(&example(), [x, 3]));
        assert_eq!(row, [empty, simple, simple, simple, simple, empty, empty]);
        assert_eq!(class_color(EMPTY | 0xFFFF_FFF0), empty);
    }

    #[test]
    fn the_map_of_reached_pixels() {
        // E10 without a sample: the two rows above, E and E2 beside.
        let found = reach_glyph(0x0033FF);
        assert_eq!((&found[..10], &found[15..]), (&[REACHED; 10][..], &[BARRED; 10][..]));
        assert_eq!(found[10..15], [BARRED, BARRED, SELF, REACHED, REACHED]);
        // From its other side, the rest.
        let found = reach_glyph(0xFFCC00);
        assert_eq!((&found[..10], &found[15..]), (&[BARRED; 10][..], &[REACHED; 10][..]));
        assert_eq!(found[10..15], [REACHED, REACHED, SELF, BARRED, BARRED]);
    }
}
