//! Which samples a pixel may be interpolated from: those that a fairly direct path reaches without crossing an edge
//! (`algorithms.md` section 2.5).
//!
//! Paths go from pixel to pixel. For pixels that share a side, the crossings of the side determine which of their
//! regions touch: a 2x2 Boolean matrix. A path through a third pixel is a Boolean product, a choice of paths a sum.
//! Diagonal neighbours are reached through the two pixels beside them, and the outer ring of the 5x5 pixels through the
//! inner one. A complex pixel joins nothing, and neither does anything outside the image. Both sides work on tiles, and
//! skip those in which all pixels are empty, as 85 to 95% of an image's are: every path is open there.
//!
//! Pixel by pixel: `reach.wgsl`, and with Boolean matrices `tests/numerics/pixels.rs`.

use epigraph_core::{
    CpuContext, Extent, Finding, In, Io, Out, Site, Stage, choice, constants, params, scratch,
};
use fearless_simd::{Simd, dispatch, prelude::*, u32x8};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{self, CROSSINGS, JOINS, REACH},
    shared::{
        edge_pixel::{CLASS, COMPLEX, DIRECTIONS, EMPTY, joined},
        lanes::{LANES, if_odd},
    },
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
/// Pixels around a tile that it depends on, on each side.
const MARGIN: usize = 2;
/// A tile with its margin.
const SPAN: usize = TILE + 2 * MARGIN;
/// Words from row to row of what is computed for a span: eight at a time, so there is room behind each row.
const STRIDE: usize = SPAN + LANES;

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
        let level = cx.level();
        bands.enumerate().for_each(|(band, (n8, r24))| {
            dispatch!(level, simd => image.band(simd, (band * TILE) as i32, wide, n8, r24));
        });
        Ok(())
    }

    fn explain(&self, _: &ReachParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, site)
    }
}

/// Both matrices of a pixel that is empty like its right and lower neighbours: primary regions are joined.
const OPEN_PAIRS: u32 = 0x11;

/// A word for each pixel of a tile and its margin, row by row.
type Span = [u32; STRIDE * SPAN];

/// Which pixels of a span have an edge: for each row, a bit for each column.
struct Edges {
    /// In the pixel itself: those that are not empty.
    here: [u32; SPAN],
    /// In their 3x3 pixels.
    in_3x3: [u32; SPAN],
    /// In their 5x5 pixels.
    in_5x5: [u32; SPAN],
}

/// The inputs of an image.
struct Image<'a> {
    mask: &'a [u32],
    cls: &'a [u32],
    width: usize,
    height: usize,
}

impl Image<'_> {
    /// Writes the rows from `top` on, as many as a tile has or are left.
    #[inline(always)]
    fn band<S: Simd>(&self, simd: S, top: i32, wide: bool, n8: &mut [u32], r24: &mut [u32]) {
        let width = self.width;
        for first in (0..width).step_by(TILE) {
            let at = [first as i32 - MARGIN as i32, top - MARGIN as i32];
            let cls = self.classes(at);
            let edges = Edges::new(simd, &cls);
            let (mut joined, mut reached) = ([ALL_NEIGHBOURS; STRIDE * SPAN], [ALL_REACHED; STRIDE * SPAN]);
            if edges.here != [0; SPAN] {
                let pairs = self.pairs(at, &cls, &edges);
                neighbours(simd, &pairs, &edges, &mut joined);
                reach(simd, &joined, wide, &edges, &mut reached);
            }
            let columns = first..(first + TILE).min(width);
            for (y, (n8, r24)) in n8.chunks_mut(width).zip(r24.chunks_mut(width)).enumerate() {
                let inner = (y + MARGIN) * STRIDE + MARGIN;
                store_row(&joined[inner..], &mut n8[columns.clone()]);
                store_row(&reached[inner..], &mut r24[columns.clone()]);
            }
        }
    }

    /// The classes of a span that begins at this pixel, which may be outside the image.
    #[inline(always)]
    fn classes(&self, [x, y]: [i32; 2]) -> Span {
        let mut span = [COMPLEX; STRIDE * SPAN];
        let columns = x.max(0) as usize..(x as usize).wrapping_add(SPAN).min(self.width);
        let skipped = (-x).max(0) as usize;
        for (y, row) in (y..).zip(span.chunks_mut(STRIDE)) {
            if (0..self.height as i32).contains(&y) {
                let from = y as usize * self.width;
                let inside = &self.cls[from + columns.start..from + columns.end];
                match inside.as_array::<SPAN>() {
                    Some(inside) => *row.first_chunk_mut().expect("a row is longer") = *inside,
                    None => row[skipped..skipped + inside.len()].copy_from_slice(inside),
                }
            }
        }
        span
    }

    /// The matrices of each pixel of a span and its right (bits 0 to 3) and lower (4 to 7) neighbours. Nothing depends on
    /// what is to the right of and below the span.
    #[inline(always)]
    fn pairs(&self, [x, y]: [i32; 2], cls: &Span, edges: &Edges) -> Span {
        let mask = |column: usize, row: usize| {
            let [x, y] = [(x + column as i32) as usize, (y + row as i32) as usize];
            self.mask[y * (self.width + 1) + x]
        };
        let mut pairs = [OPEN_PAIRS; STRIDE * SPAN];
        for row in 0..SPAN {
            // Those that are not empty, or whose right or lower neighbour is not.
            let below = edges.here.get(row + 1).copied().unwrap_or(0);
            let mut rest = edges.here[row] | edges.here[row] >> 1 | below;
            while rest != 0 {
                let column = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let i = row * STRIDE + column;
                let below = cls.get(i + STRIDE).copied().unwrap_or(COMPLEX);
                let (own, right) = (cls[i], cls[i + 1]);
                let east = || mask(column + 1, row) & 0xFF;
                let south = || mask(column, row + 1) >> 8 & 0xFF;
                let east = joined(own, right, east, 8, |place| [32 + place, 128 - place]);
                let south = joined(own, below, south, 8, |place| [96 - place, place]);
                pairs[i] = east | south << 4;
            }
        }
        pairs
    }
}

/// Copies as many words of a tile's row as there is room for.
#[inline(always)]
fn store_row(words: &[u32], to: &mut [u32]) {
    match to.as_mut_array::<TILE>() {
        Some(to) => *to = *words.first_chunk().expect("a row of a tile"),
        None => to.copy_from_slice(&words[..to.len()]),
    }
}

impl Edges {
    #[inline(always)]
    fn new<S: Simd>(simd: S, cls: &Span) -> Self {
        let mut here = [0; SPAN];
        for (here, cls) in here.iter_mut().zip(cls.chunks(STRIDE)) {
            for first in (0..SPAN).step_by(LANES) {
                let cls = u32x8::from_slice(simd, &cls[first..][..LANES]) & CLASS;
                *here |= (cls.simd_ne(u32x8::splat(simd, EMPTY)).to_bitmask() as u32) << first;
            }
            *here &= (1 << SPAN) - 1;
        }
        let (mut in_3x3, mut in_5x5) = ([0; SPAN], [0; SPAN]);
        for y in MARGIN - 1..=SPAN - MARGIN {
            let rows = here[y - 1] | here[y] | here[y + 1];
            in_3x3[y] = rows | rows << 1 | rows >> 1;
        }
        for y in MARGIN..SPAN - MARGIN {
            let rows = in_3x3[y - 1] | in_3x3[y] | in_3x3[y + 1];
            in_5x5[y] = rows | rows << 1 | rows >> 1;
        }
        Self { here, in_3x3, in_5x5 }
    }
}

/// Calls `each` with the index of the first of eight pixels of a span in which there is one of the bits given for each row;
/// columns are counted from `first` on.
#[inline(always)]
fn groups(bits: &[u32; SPAN], first: usize, mut each: impl FnMut(usize)) {
    for (y, bits) in bits.iter().enumerate() {
        for column in (first..SPAN - first).step_by(LANES) {
            if bits >> column & 0xFF != 0 {
                each(y * STRIDE + column);
            }
        }
    }
}

/// The words of eight pixels.
#[inline(always)]
fn load<S: Simd>(simd: S, span: &Span, first: usize) -> u32x8<S> {
    u32x8::from_slice(simd, &span[first..][..LANES])
}

/// Writes N8 of those pixels of a span, except the outermost, that have an edge in their 3x3 pixels, and of some others.
#[inline(always)]
fn neighbours<S: Simd>(simd: S, pairs: &Span, edges: &Edges, n8: &mut Span) {
    groups(
        &edges.in_3x3,
        1,
        #[inline(always)]
        |i| {
            let at = |i: usize| load(simd, pairs, i);
            let (own, left, right) = (at(i), at(i - 1), at(i + 1));
            let (above, above_left, above_right) = (at(i - STRIDE), at(i - STRIDE - 1), at(i - STRIDE + 1));
            let (below, below_left) = (at(i + STRIDE), at(i + STRIDE - 1));
            let (e, s) = (own & 15, own >> 4);
            let (w, n) = (transposed(left & 15), transposed(above >> 4));
            let se = chained(simd, e, right >> 4) | chained(simd, s, below & 15);
            let sw = chained(simd, s, transposed(below_left & 15)) | chained(simd, w, left >> 4);
            let nw =
                chained(simd, w, transposed(above_left >> 4)) | chained(simd, n, transposed(above_left & 15));
            let ne = chained(simd, n, above & 15) | chained(simd, e, transposed(above_right >> 4));
            let low = e | (se << 4) | (s << 8) | (sw << 12);
            let high = (w << 16) | (nw << 20) | (n << 24) | (ne << 28);
            (low | high).store_slice(&mut n8[i..][..LANES]);
        },
    );
}

/// [`chain`](crate::shared::edge_pixel::chain) of eight matrices.
#[inline(always)]
fn chained<S: Simd>(simd: S, pq: u32x8<S>, qr: u32x8<S>) -> u32x8<S> {
    let through_primary = if_odd(simd, pq, qr & 3) | if_odd(simd, pq >> 2, (qr & 3) << 2);
    let through_secondary = if_odd(simd, pq >> 1, qr >> 2) | if_odd(simd, pq >> 3, qr & 12);
    through_primary | through_secondary
}

/// [`transpose`](crate::shared::edge_pixel::transpose) of eight matrices.
#[inline(always)]
fn transposed<S: Simd>(pq: u32x8<S>) -> u32x8<S> {
    (pq & 9) | ((pq & 2) << 1) | ((pq & 4) >> 1)
}

/// The bit of R24 for an offset.
pub(crate) fn bit_of(offset: [i32; 2]) -> u32 {
    1 << place_of(offset)
}

/// Which bit that is.
#[inline(always)]
fn place_of([x, y]: [i32; 2]) -> u32 {
    let raw = (y + 2) * 5 + x + 2;
    (raw - i32::from(raw > 12)) as u32
}

/// Writes R24 of those pixels of a tile that have an edge in their 5x5 pixels, and of some others.
#[inline(always)]
fn reach<S: Simd>(simd: S, n8: &Span, wide: bool, edges: &Edges, r24: &mut Span) {
    groups(
        &edges.in_5x5,
        MARGIN,
        #[inline(always)]
        |i| {
            // A function for each direction: its shifts and bits are constants.
            let own = load(simd, n8, i);
            let even = toward::<S, 0>(simd, own, n8, i, wide) | toward::<S, 2>(simd, own, n8, i, wide);
            let even = even | toward::<S, 4>(simd, own, n8, i, wide) | toward::<S, 6>(simd, own, n8, i, wide);
            let odd = toward::<S, 1>(simd, own, n8, i, wide) | toward::<S, 3>(simd, own, n8, i, wide);
            let odd = odd | toward::<S, 5>(simd, own, n8, i, wide) | toward::<S, 7>(simd, own, n8, i, wide);
            (even | odd).store_slice(&mut r24[i..][..LANES]);
        },
    );
}

/// The part of R24 that eight pixels reach by a first step in direction `D`.
#[inline(always)]
fn toward<S: Simd, const D: usize>(simd: S, own: u32x8<S>, n8: &Span, i: usize, wide: bool) -> u32x8<S> {
    let [dx, dy] = DIRECTIONS[D];
    let next = load(simd, n8, (i as i32 + dy * STRIDE as i32 + dx) as usize);
    let matrix = own >> (4 * D as u32);
    // Bit 4 d: the path continues in direction d, from a region of the neighbour that is joined to the primary region here.
    let onward = if_odd(simd, matrix, next) | if_odd(simd, matrix >> 1, next >> 2);
    let reached = moved(matrix, 0, place_of([dx, dy])) | onward_by::<S, D>(onward, 7);
    let reached = reached | onward_by::<S, D>(onward, 0) | onward_by::<S, D>(onward, 1);
    if wide && D % 2 == 1 {
        reached | onward_by::<S, D>(onward, 6) | onward_by::<S, D>(onward, 2)
    } else {
        reached
    }
}

/// The bits of R24 of what is reached by a step in direction `D` and one that turns from it by so many eighths.
#[inline(always)]
fn onward_by<S: Simd, const D: usize>(onward: u32x8<S>, turn: usize) -> u32x8<S> {
    let turned = (D + turn) & 7;
    let [[x, y], [turned_x, turned_y]] = [DIRECTIONS[D], DIRECTIONS[turned]];
    moved(onward, 4 * turned as u32, place_of([x + turned_x, y + turned_y]))
}

/// A bit of each lane, moved from one place to another.
#[inline(always)]
fn moved<S: Simd>(lanes: u32x8<S>, from: u32, to: u32) -> u32x8<S> {
    let shifted = if from < to { lanes << (to - from) } else { lanes >> (from - to) };
    shifted & (1 << to)
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
                    assert_eq!(there, crate::shared::edge_pixel::transpose(back), "{x} {y} {d}");
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
