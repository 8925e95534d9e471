//! Which samples a pixel may be interpolated from: those that a fairly direct path reaches without crossing an edge
//! (`algorithms.md` section 2.5).
//!
//! Paths go from pixel to pixel. For pixels that share a side, the crossings of the side determine which of their
//! regions touch: a 2x2 Boolean matrix. A path through a third pixel is a Boolean product, a choice of paths a sum.
//! Diagonal neighbours are reached through the two pixels beside them, and the outer ring of the 5x5 pixels through the
//! inner one. A complex pixel joins nothing, and neither does anything outside the image. Both sides work on tiles, and
//! skip those in which all pixels are empty, as 85 to 95% of an image's are: every path is open there.

use epigraph_core::{
    CpuContext, Extent, Finding, In, Io, Out, Site, Stage, choice, constants, params, scratch,
};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{self, CROSSINGS, JOINS, REACH},
    shared::edge_pixel::{CLASS, COMPLEX, DIRECTIONS, EMPTY, chain, if_odd, joined, transpose},
};

#[path = "explain/reach.rs"]
mod explain;

constants! {
    /// N8 of a pixel whose 3x3 pixels are all empty: all primary regions are joined.
    const ALL_NEIGHBOURS: u32 = 0x1111_1111;
    /// R24 of a pixel whose 5x5 pixels are all empty.
    const ALL_REACHED: u32 = 0xFF_FFFF;
}

/// Pixels on each side of a tile.
const TILE: usize = 16;
/// The same with the margin of pixels that the tile depends on.
const SPAN: usize = TILE + 4;

choice! {
    /// Which pixels of the inner ring lead to one of the outer ring.
    pub enum Rule {
        /// Those within half a pixel of the straight line: the path turns by at most 45 degrees.
        Narrow,
        /// All adjacent ones: from a diagonal neighbour the path may also turn by 90 degrees.
        Wide,
    }
}

choice! {
    /// How the GPU divides the work; the results are the same.
    pub enum Method {
        /// One pass over tiles in workgroup memory.
        Fused,
        /// The papers' passes: neighbours, one half of the outer ring, and its copy for the other half.
        ThreePass,
    }
}

params! {
    /// Parameters of [`Reach`].
    pub struct ReachParams {
        /// Which pixels of the inner ring lead to one of the outer ring.
        rule: Rule = Rule::Narrow;
        /// How the GPU divides the work; the CPU has a single method.
        method: Method = Method::Fused;
    }
}

/// See the module.
pub struct Reach {
    mask: In<u32>,
    cls: In<u32>,
    n8: Out<u32>,
    r24: Out<u32>,
}

impl Stage for Reach {
    const KIND: &'static str = "reach";
    const DOC: &'static str = "Which pixels of the 5x5 around each can be reached without crossing an edge.";
    type Params = ReachParams;

    fn declare(params: &ReachParams, io: &mut Io) -> Self {
        io.column(column::I2);
        io.per_view();
        let pixels = || Extent::Frame(1);
        let mask = io.read("mask", CROSSINGS, Extent::Corners);
        let cls = io.read(
            "cls",
            meaning::CLASS.doc("Class, chord and primary region of each pixel, as bits."),
            pixels(),
        );
        let n8 = io.write(
            "n8",
            JOINS.doc(
                "Joined regions of the eight neighbours: four bits each for E, SE, S, SW, W, NW, N, NE.",
            ),
            pixels(),
        );
        let r24 = io.write(
            "r24",
            REACH.doc("Bit k: the k-th of the other 5x5 pixels, in reading order, can be reached."),
            pixels(),
        );
        io.shader(shader!("reach"));
        io.constants(CONSTANTS);
        match params.method {
            Method::Fused => {
                io.define("FUSED");
                io.dispatch("fused", n8);
            }
            Method::ThreePass => {
                let half: Out<u32> =
                    io.write("half", scratch("The half of r24 that is not copied."), pixels());
                io.dispatch("neighbours", n8);
                io.dispatch("main_half", half);
                io.dispatch("copy_half", r24);
            }
        }
        Self { mask, cls, n8, r24 }
    }

    fn cpu(&self, params: &ReachParams, cx: &CpuContext) -> Result<(), String> {
        let dims = cx.dims(self.n8);
        let (width, height) = (dims.width as usize, dims.height as usize);
        let (mask, cls) = (&cx.read(self.mask)[..], &cx.read(self.cls)[..]);
        let (n8, r24) = (&mut cx.write(self.n8)[..], &mut cx.write(self.r24)[..]);

        let image = Image { mask, cls, width, height };
        let wide = params.rule == Rule::Wide;
        let bands = n8.par_chunks_mut(TILE * width).zip(r24.par_chunks_mut(TILE * width));
        bands.enumerate().for_each(|(band, (n8, r24))| {
            for first in (0..width).step_by(TILE) {
                let tile = image.tile(first as i32 - 2, (band * TILE) as i32 - 2, wide);
                let columns = first..(first + TILE).min(width);
                for (y, (n8, r24)) in n8.chunks_mut(width).zip(r24.chunks_mut(width)).enumerate() {
                    let inner = (y + 2) * SPAN + 2..(y + 2) * SPAN + 2 + columns.len();
                    n8[columns.clone()].copy_from_slice(&tile.n8[inner.clone()]);
                    r24[columns.clone()].copy_from_slice(&tile.r24[inner]);
                }
            }
        });
        Ok(())
    }

    fn explain(&self, _: &ReachParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, site)
    }
}

/// A word for each pixel of a tile and its margin, row by row.
type Span = [u32; SPAN * SPAN];

/// The results for a tile's pixels; the words of the margin are meaningless.
struct Tile {
    n8: Span,
    r24: Span,
}

/// The inputs of an image.
struct Image<'a> {
    mask: &'a [u32],
    cls: &'a [u32],
    width: usize,
    height: usize,
}

impl Image<'_> {
    /// The tile whose span begins at this pixel, which may be outside the image.
    fn tile(&self, x: i32, y: i32, wide: bool) -> Tile {
        let cls = self.classes(x, y);
        if cls.iter().fold(0, |all, cls| all | cls) & CLASS == EMPTY {
            return Tile { n8: [ALL_NEIGHBOURS; SPAN * SPAN], r24: [ALL_REACHED; SPAN * SPAN] };
        }
        let n8 = neighbours(&self.pairs(x, y, &cls));
        Tile { n8, r24: reached(&n8, wide) }
    }

    fn classes(&self, x: i32, y: i32) -> Span {
        let mut span = [COMPLEX; SPAN * SPAN];
        let columns = x.max(0) as usize..(x as usize).wrapping_add(SPAN).min(self.width);
        let skipped = (-x).max(0) as usize;
        for (y, row) in (y..).zip(span.chunks_mut(SPAN)) {
            if (0..self.height as i32).contains(&y) {
                let from = y as usize * self.width;
                let inside = &self.cls[from + columns.start..from + columns.end];
                row[skipped..skipped + inside.len()].copy_from_slice(inside);
            }
        }
        span
    }

    /// The matrices of each pixel of a span and its right (bits 0 to 3) and lower (4 to 7) neighbours.
    fn pairs(&self, x: i32, y: i32, cls: &Span) -> Span {
        let mask = |i: usize, dx: usize, dy: usize| {
            let at = [(x + (i % SPAN) as i32) as usize + dx, (y + (i / SPAN) as i32) as usize + dy];
            self.mask[at[1] * (self.width + 1) + at[0]]
        };
        // Nothing depends on the pixels to the right of and below the span.
        let cls = |i: usize| cls.get(i).copied().unwrap_or(COMPLEX);
        std::array::from_fn(|i| {
            let (own, right, below) = (cls(i), cls(i + 1), cls(i + SPAN));
            let east = joined(own, right, || mask(i, 1, 0) & 0xFF, 8, |place| [32 + place, 128 - place]);
            let south = joined(own, below, || mask(i, 0, 1) >> 8 & 0xFF, 8, |place| [96 - place, place]);
            east | south << 4
        })
    }
}

/// N8 of the pixels of a span except the outermost.
fn neighbours(pairs: &Span) -> Span {
    let mut n8 = [0; SPAN * SPAN];
    for y in 1..SPAN - 1 {
        let row = |y: usize| &pairs[y * SPAN..][..SPAN];
        let (above, own, below) = (row(y - 1), row(y), row(y + 1));
        let n8 = &mut n8[y * SPAN..][..SPAN];
        for x in 1..SPAN - 1 {
            let (e, s) = (own[x] & 15, own[x] >> 4);
            let (w, n) = (transpose(own[x - 1] & 15), transpose(above[x] >> 4));
            let se = chain(e, own[x + 1] >> 4) | chain(s, below[x] & 15);
            let sw = chain(s, transpose(below[x - 1] & 15)) | chain(w, own[x - 1] >> 4);
            let nw = chain(w, transpose(above[x - 1] >> 4)) | chain(n, transpose(above[x - 1] & 15));
            let ne = chain(n, above[x] & 15) | chain(e, transpose(above[x + 1] >> 4));
            n8[x] = e | se << 4 | s << 8 | sw << 12 | w << 16 | nw << 20 | n << 24 | ne << 28;
        }
    }
    n8
}

/// The bit of R24 for an offset.
pub(crate) fn bit_of([x, y]: [i32; 2]) -> u32 {
    let raw = (y + 2) * 5 + x + 2;
    1 << (raw - i32::from(raw > 12))
}

/// R24 of the pixels of a span except the two outermost. One direction at a time for a row of pixels, so that the
/// compiler vectorizes it.
fn reached(n8: &Span, wide: bool) -> Span {
    let mut r24 = [0; SPAN * SPAN];
    for y in 2..SPAN - 2 {
        let first = y * SPAN + 2;
        let own = &n8[first..][..TILE];
        let reached = &mut r24[first..][..TILE];
        for (d, offset) in DIRECTIONS.into_iter().enumerate() {
            let [dx, dy] = offset;
            let next = &n8[(first as i32 + dy * SPAN as i32 + dx) as usize..][..TILE];
            // Bit 4 d: the path continues in direction d, from a region of the neighbour that is joined to the primary
            // region here.
            let mut onward = [0; TILE];
            for x in 0..TILE {
                let matrix = own[x] >> (4 * d);
                reached[x] |= if_odd(matrix, bit_of(offset));
                onward[x] = if_odd(matrix, next[x]) | if_odd(matrix >> 1, next[x] >> 2);
            }
            let most = if wide && d % 2 == 1 { 2 } else { 1 };
            for turned in d + 8 - most..=d + 8 + most {
                let [turned_x, turned_y] = DIRECTIONS[turned & 7];
                let bit = bit_of([dx + turned_x, dy + turned_y]);
                for x in 0..TILE {
                    reached[x] |= if_odd(onward[x] >> (4 * (turned & 7)), bit);
                }
            }
        }
    }
    r24
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::{
        classify::{Classify, ClassifyParams},
        shared::{
            cloud::NO_POINT,
            edge_pixel::testing::Mask,
            testing::{Random, run_alike, run_both, settings},
        },
    };

    /// The classes of an image in which `cells` gives the cell, of 4x4, of each pixel's sample.
    fn classes(mask: &Mask, cells: &[Option<u32>]) -> Vec<u32> {
        let params = ClassifyParams { subpixel_bits: 4, ..ClassifyParams::default() };
        let mut harness = Harness::<Classify>::new(params, &settings(mask.size, 0));
        harness.set("mask", &mask.words);
        harness.set(
            "id",
            &cells.iter().map(|cell| if cell.is_some() { 0 } else { NO_POINT }).collect::<Vec<_>>(),
        );
        harness.set("subpixel", &cells.iter().map(|cell| cell.unwrap_or(0)).collect::<Vec<_>>());
        run_alike(&mut harness).get("cls")
    }

    fn harness(params: ReachParams, mask: &Mask, cls: &[u32]) -> Harness<Reach> {
        let mut harness = Harness::new(params, &settings(mask.size, 0));
        harness.set("mask", &mask.words);
        harness.set("cls", cls);
        harness
    }

    /// N8 and R24. Asserts that both methods give the same on both sides.
    fn reach(rule: Rule, mask: &Mask, cls: &[u32]) -> (Vec<u32>, Vec<u32>) {
        let [fused, three] = [Method::Fused, Method::ThreePass].map(|method| {
            let both = run_both(&mut harness(ReachParams { rule, method }, mask, cls));
            ["n8", "r24"].map(|name| {
                both.assert_equal::<u32>(name);
                both.cpu.get::<u32>(name)
            })
        });
        assert_eq!(fused, three);
        let [n8, r24] = fused;
        (n8, r24)
    }

    /// An image of 7x7 pixels with these segments, and a sample in a cell of pixel (3, 3).
    fn seven(segments: &[[[i64; 2]; 2]], cell: Option<u32>) -> (Mask, Vec<u32>) {
        let mut mask = Mask::new([7, 7]);
        segments.iter().for_each(|[a, b]| mask.line(*a, *b));
        let mut cells = [None; 49];
        cells[3 * 7 + 3] = cell;
        let cls = classes(&mask, &cells);
        (mask, cls)
    }

    #[test]
    fn an_edge_divides_the_neighbourhood() {
        // E10 of algorithms.md section 2.6.
        let golden = [
            (None, 0x1116_4469, 0x00_33FF),
            (Some(1), 0x1116_4469, 0x00_33FF),
            (Some(14), 0x4449_1196, 0xFF_CC00),
        ];
        for (cell, n8, r24) in golden {
            let (mask, cls) = seven(&[[[-256, 496], [2048, 1360]]], cell);
            let found = reach(Rule::Narrow, &mask, &cls);
            assert_eq!((found.0[24], found.1[24]), (n8, r24), "{cell:?}");
        }
    }

    #[test]
    fn paths_go_around_the_end_of_an_edge() {
        let (mask, cls) = seven(&[[[896, -256], [896, 832]]], None);
        let (n8, r24) = reach(Rule::Narrow, &mask, &cls);
        assert_eq!((n8[17], r24[17]), (0x4911_5554, 0xFF_CCE7));
        assert_eq!((n8[24], r24[24]), (0x1311_1111, 0xFF_FFFF));
        let (wide_n8, wide) = reach(Rule::Wide, &mask, &cls);
        assert_eq!((wide_n8, wide[17]), (n8, 0xFF_ECE7));
    }

    #[test]
    fn a_complex_pixel_joins_nothing() {
        let (mask, cls) = seven(&[[[-256, 832], [2048, 960]], [[832, -256], [960, 2048]]], None);
        let (n8, r24) = reach(Rule::Narrow, &mask, &cls);
        let at = |x: usize, y: usize| r24[7 * y + x];
        assert_eq!([at(2, 2), at(4, 4), at(2, 3), at(3, 2)], [0x00_0CE7, 0xE7_3000, 0x7B_CC00, 0x06_339C]);
        assert_eq!(n8[7 * 2 + 2], 0x2111_2202);
        assert_eq!((n8[24], at(3, 3)), (0, 0));
    }

    #[test]
    fn without_edges_all_pixels_of_the_image_are_reached() {
        for size in [[1, 1], [2, 3], [40, 9]] {
            let mask = Mask::new(size);
            let cls = classes(&mask, &vec![None; (size[0] * size[1]) as usize]);
            let [width, height] = size.map(|side| side as i32);
            let is_inside = |x, y| (0..width).contains(&x) && (0..height).contains(&y);
            for rule in [Rule::Narrow, Rule::Wide] {
                let (n8, r24) = reach(rule, &mask, &cls);
                for (p, (n8, r24)) in n8.into_iter().zip(r24).enumerate() {
                    let (x, y) = (p as i32 % width, p as i32 / width);
                    for (d, [dx, dy]) in DIRECTIONS.into_iter().enumerate() {
                        assert_eq!(n8 >> (4 * d) & 15, u32::from(is_inside(x + dx, y + dy)), "{x} {y} {d}");
                    }
                    for (dx, dy) in offsets() {
                        assert_eq!(
                            r24 & bit_of([dx, dy]) != 0,
                            is_inside(x + dx, y + dy),
                            "{x} {y} {dx} {dy}"
                        );
                    }
                }
            }
        }
    }

    fn offsets() -> impl Iterator<Item = (i32, i32)> {
        (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| (dx, dy))).filter(|&offset| offset != (0, 0))
    }

    #[test]
    fn reachability_between_random_polygons_is_symmetric() {
        let mut random = Random(21);
        let mut narrower = 0;
        for size in [[9, 9], [1, 20], [49, 33], [70, 51]] {
            for _ in 0..3 {
                let pixels = size[0] * size[1];
                let mask = Mask::random(size, 1 + pixels / 60, &mut random);
                let cells: Vec<_> =
                    (0..pixels).map(|_| (random.below(5) > 1).then(|| random.below(16))).collect();
                let cls = classes(&mask, &cells);
                let (n8, narrow) = reach(Rule::Narrow, &mask, &cls);
                let (_, wide) = reach(Rule::Wide, &mask, &cls);
                assert_symmetric(size, &n8, &narrow);
                assert_symmetric(size, &n8, &wide);
                for (narrow, wide) in narrow.iter().zip(&wide) {
                    assert_eq!(narrow & !wide, 0);
                    narrower += u32::from(narrow != wide);
                }
                for (p, cls) in cls.iter().enumerate().filter(|(_, cls)| *cls & CLASS == COMPLEX) {
                    assert_eq!((n8[p], narrow[p], wide[p]), (0, 0, 0), "{cls:#x}");
                }
            }
        }
        assert!(narrower > 100, "{narrower}");
    }

    /// Asserts that the matrix of P and Q is the transpose of that of Q and P, and that reachability is symmetric.
    fn assert_symmetric(size: [u32; 2], n8: &[u32], r24: &[u32]) {
        let [width, height] = size.map(|side| side as i32);
        let at = |words: &[u32], x: i32, y: i32| {
            let is_inside = (0..width).contains(&x) && (0..height).contains(&y);
            if is_inside { words[(y * width + x) as usize] } else { 0 }
        };
        for y in 0..height {
            for x in 0..width {
                for (d, [dx, dy]) in DIRECTIONS.into_iter().enumerate() {
                    let there = at(n8, x, y) >> (4 * d) & 15;
                    let back = at(n8, x + dx, y + dy) >> (4 * ((d + 4) & 7)) & 15;
                    assert_eq!(there, transpose(back), "{x} {y} {d}");
                }
                for (dx, dy) in offsets() {
                    let there = at(r24, x, y) & bit_of([dx, dy]) != 0;
                    let back = at(r24, x + dx, y + dy) & bit_of([-dx, -dy]) != 0;
                    assert_eq!(there, back, "{x} {y} {dx} {dy}");
                }
            }
        }
    }
}
