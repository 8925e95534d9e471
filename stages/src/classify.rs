//! Classifies pixels by the edges that cross their sides: empty, simple (a chord cuts it in two) or complex. Finds
//! which region of a simple pixel is the primary one, that of its sample, and its area; and drops samples whose
//! sub-pixel cell does not determine the region (`algorithms.md` sections 2.3 and 2.4).
//!
//! If one segment ends and the next begins within a pixel, the edge is not a chord but bends at that vertex: at a
//! corner of a lamp, a sample beyond the chord would spread the lamp's light around. If `vertex` is connected, region
//! and area are those of the bent edge.
//!
//! A pixel whose sample is dropped requests another one. If that were always traced through the pixel's centre and the
//! chord passed there, it would be dropped again in every frame: `aim` moves it elsewhere. Because of rounding, a
//! sample aimed at the centre may come back in any of the four cells that meet there; so if the chord touches one of
//! these cells, `aim` is the middle of the cell of the primary region that is farthest from the chord. All cells have
//! the same size, so that one is unambiguous if any cell of the region is.

use epigraph_core::{CpuContext, Extent, Finding, In, Io, Out, Site, Stage, choice, params};
use fearless_simd::dispatch;
use rayon::prelude::*;

use crate::{
    column,
    meaning::{self, AIM, CELL, CROSSINGS, ID, KEPT, TURN},
    shared::{
        cloud::NO_POINT,
        edge_pixel::{
            AMBIGUOUS, AREA_SHIFT, CELL_SHIFT, CLASS, Chord, EMPTY, P_SHIFT, PIXEL_AREA, PRIMARY_IS_A,
            Q_SHIFT, RUN, SIMPLE, VALID, area_of_a, class_of, ring, slot_position,
        },
        requests::PIXEL_CENTER,
    },
};

#[path = "explain/classify.rs"]
mod explain;

choice! {
    /// How to treat a sample whose cell touches the chord.
    pub enum Ambiguous {
        /// It does not count in this frame; the cloud keeps it.
        Drop,
        /// It counts as on the side of its cell's centre.
        Guess,
    }
}

params! {
    /// Parameters of [`Classify`].
    pub struct ClassifyParams {
        /// Bits of the sub-pixel cell, half of them for each axis: the same as those of the projection.
        subpixel_bits: u32 = 8, in 4..=8, unit "bits";
        /// How to treat a sample whose cell touches the chord.
        ambiguous: Ambiguous = Ambiguous::Drop;
    }
}

/// See the module.
pub struct Classify {
    mask: In<u32>,
    id: In<u32>,
    subpixel: In<u32>,
    vertex: Option<In<u32>>,
    cls: Out<u32>,
    kept: Out<u32>,
    aim: Out<u32>,
}

impl Stage for Classify {
    const KIND: &'static str = "classify";
    const DOC: &'static str = "Classes of pixels by the edges that cross them, the side that their samples lie on, \
                                and where to sample next.";
    type Params = ClassifyParams;

    fn declare(_: &ClassifyParams, io: &mut Io) -> Self {
        io.column(column::I1);
        io.per_view();
        let pixels = || Extent::Frame(1);
        let mask = io.read("mask", CROSSINGS, Extent::Corners);
        let id = io.read("id", ID, pixels());
        let subpixel = io.read("subpixel", CELL, pixels());
        let vertex = io.optional("vertex", TURN, pixels());
        let cls = io.write(
            "cls",
            meaning::CLASS.doc("Class, chord, primary region and state of the sample, as bits."),
            pixels(),
        );
        let kept = io.write(
            "kept",
            KEPT.doc("The point that the pixel shows, without those that are dropped."),
            pixels(),
        );
        let aim = io.write("aim", AIM, pixels());
        io.shader(shader!("classify"));
        if vertex.is_some() {
            io.define("VERTEX");
        }
        io.dispatch("classify", cls);
        Self { mask, id, subpixel, vertex, cls, kept, aim }
    }

    fn cpu(&self, params: &ClassifyParams, cx: &CpuContext) -> Result<(), String> {
        let width = cx.dims(self.cls).width as usize;
        let (mask, id, subpixel) =
            (&cx.read(self.mask)[..], &cx.read(self.id)[..], &cx.read(self.subpixel)[..]);
        let vertex = self.vertex.map(|vertex| cx.read(vertex));
        let vertex = vertex.as_deref();
        let (mut cls, mut kept, mut aim) = (cx.write(self.cls), cx.write(self.kept), cx.write(self.aim));

        let level = cx.level();
        let grid = Grid { log2: params.subpixel_bits / 2, guess: params.ambiguous == Ambiguous::Guess };
        let outputs =
            cls.par_chunks_mut(width).zip(kept.par_chunks_mut(width)).zip(aim.par_chunks_mut(width));
        outputs.enumerate().for_each(|(y, ((cls, kept), aim))| {
            let row = y * width..(y + 1) * width;
            let (id, subpixel) = (&id[row.clone()], &subpixel[row.clone()]);
            let above = &mask[y * (width + 1)..][..width + 1];
            let below = &mask[(y + 1) * (width + 1)..][..width];
            // First treats all pixels as if no edge crossed them, several at a time, which is enough for most of them.
            kept.copy_from_slice(id);
            aim.fill(PIXEL_CENTER);
            dispatch!(level, _ => grid.without_edges(id, subpixel, cls));
            for first in (0..width).step_by(RUN) {
                let group = first..width.min(first + RUN);
                // `above` has the left, top and right sides, `below` the bottom ones.
                let crossings = |bits: u32, mask: &u32| bits | mask;
                let beside = above[group.start..group.end + 1].iter().fold(0, crossings) & 0xFFFF;
                if beside | below[group.clone()].iter().fold(0, crossings) & 0xFF00 == 0 {
                    continue;
                }
                for x in group {
                    let [left, top] = [above[x] & 0xFF, above[x] >> 8 & 0xFF];
                    let [right, bottom] = [above[x + 1] & 0xFF, below[x] >> 8 & 0xFF];
                    if left | top | right | bottom != 0 {
                        let ring = ring(left, top, right, bottom);
                        let vertex = vertex.map_or(0, |vertex| vertex[row.start + x]);
                        (cls[x], aim[x]) = grid.classify(ring, vertex, id[x] != NO_POINT, subpixel[x]);
                        kept[x] = if cls[x] & VALID != 0 { id[x] } else { NO_POINT };
                    }
                }
            }
        });
        Ok(())
    }

    fn explain(&self, params: &ClassifyParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// The bits of a pixel with a single region.
const WHOLE: u32 = PRIMARY_IS_A | PIXEL_AREA << AREA_SHIFT;

/// The cells of a pixel, and how to treat ambiguous samples.
#[derive(Clone, Copy)]
struct Grid {
    /// Logarithm of the number of cells of an axis, 2 to 4.
    log2: u32,
    guess: bool,
}

impl Grid {
    /// The `cls` of pixels that no edge crosses.
    #[inline(always)]
    fn without_edges(self, id: &[u32], subpixel: &[u32], cls: &mut [u32]) {
        for (cls, (id, cell)) in cls.iter_mut().zip(id.iter().zip(subpixel)) {
            *cls = EMPTY | WHOLE | self.state(*id != NO_POINT, *cell);
        }
    }

    /// The bits of `cls` for the sample's cell; 0 without a sample.
    #[inline(always)]
    fn state(self, has_sample: bool, cell: u32) -> u32 {
        let [x, y] = self.place(cell).map(|index| index >> (self.log2 - 2));
        if has_sample { (y << 2 | x) << CELL_SHIFT | VALID } else { 0 }
    }

    /// Column and row of a cell.
    #[inline(always)]
    fn place(self, cell: u32) -> [u32; 2] {
        let last = (1 << self.log2) - 1;
        [cell & last, cell >> self.log2 & last]
    }

    /// The `cls` and `aim` of a pixel with the given perimeter, vertex and cell of its sample, if it has one.
    fn classify(self, ring: u32, vertex: u32, has_sample: bool, cell: u32) -> (u32, u32) {
        let mut cls = class_of(ring) | self.state(has_sample, cell);
        if cls & CLASS != SIMPLE {
            return (cls | WHOLE, PIXEL_CENTER);
        }

        let (p, q) = (ring.trailing_zeros(), 31 - ring.leading_zeros());
        let chord = Chord::new(p, q);
        let bend = Bend::new(chord, [p, q].map(slot_position), vertex);
        // The triangle between chord and vertex belongs to the other side.
        let area = (area_of_a(p, q) as i32 - bend.map_or(0, |bend| bend.side)) as u32;
        // Without a sample the larger region is the primary one.
        let mut is_a = 2 * area >= PIXEL_AREA;
        if has_sample {
            let place = self.place(cell);
            let (distance, is_ambiguous) = match bend {
                Some(bend) => bend.locate(|half| self.distance(half, place), |half| self.reach(half)),
                None => {
                    let distance = self.distance(chord, place);
                    (distance, distance.abs() <= self.reach(chord))
                }
            };
            if is_ambiguous {
                cls |= AMBIGUOUS;
            }
            if is_ambiguous && !self.guess {
                cls &= !VALID;
            } else if distance != 0 {
                is_a = distance > 0;
            }
        }
        let area = if is_a { area } else { PIXEL_AREA - area };
        let side = if is_a { PRIMARY_IS_A } else { 0 };
        cls |= p << P_SHIFT | q << Q_SHIFT | side | area << AREA_SHIFT;
        (cls, self.aim(chord, bend, is_a))
    }

    /// Twice the chord's function at the centre of a cell.
    fn distance(self, chord: Chord, [x, y]: [u32; 2]) -> i32 {
        let size = 16 >> self.log2;
        let corner = [x, y].map(|index| index as i32 * size);
        chord.side(corner) + chord.side(corner.map(|at| at + size))
    }

    /// Maximum difference between twice the chord's function at a cell's corners and at its centre: if the value at the
    /// centre is larger, the chord does not touch the cell.
    fn reach(self, chord: Chord) -> i32 {
        let [x, y] = chord.normal;
        (16 >> self.log2) * (x.abs() + y.abs())
    }

    /// The `aim` of a simple pixel with this chord.
    fn aim(self, chord: Chord, bend: Option<Bend>, is_a: bool) -> u32 {
        // The square of the four cells that meet at the centre is twice as wide as a cell.
        let is_near = match bend {
            Some(bend) => bend.locate(|half| half.side([8, 8]), |half| self.reach(half)).1,
            None => chord.side([8, 8]).abs() <= self.reach(chord),
        };
        if !is_near {
            return PIXEL_CENTER;
        }
        // The chord's function grows towards A, so a corner cell is the farthest from the chord.
        let last = (1 << self.log2) - 1;
        let [x, y] = chord.normal.map(|towards_a| if (towards_a > 0) == is_a { last } else { 0 });
        let middle = |index: u32| (2 * index + 1) << (15 - self.log2);
        middle(x) | middle(y) << 16
    }
}

/// An edge that bends at a vertex within the pixel: instead of the chord, two halves that meet in the vertex. The
/// region inside the corner is the area on the inner side of both halves, as their ends are on the pixel's perimeter.
#[derive(Clone, Copy)]
struct Bend {
    /// From the first crossing to the vertex, and from there to the second.
    halves: [Chord; 2],
    /// The chord's function at the vertex: negative if the edge bends into B. Also the triangle's area, in 1/512 pixel.
    side: i32,
}

impl Bend {
    /// The bend at `vertex`; `None` if there is no vertex or it is on the chord.
    fn new(chord: Chord, [p, q]: [[i32; 2]; 2], vertex: u32) -> Option<Self> {
        let at = [vertex & 0xFF, vertex >> 8 & 0xFF].map(|along| along as i32);
        let side = if vertex == 0 { 0 } else { chord.side(at) };
        (side != 0).then(|| Self { halves: [Chord::between(p, at), Chord::between(at, q)], side })
    }

    /// The side of a square, from the functions of both halves at its centre and their maximum change within it: a
    /// number that is positive for region A and negative for B, and whether the edge may touch the square.
    fn locate(self, distance: impl Fn(Chord) -> i32, reach: impl Fn(Chord) -> i32) -> (i32, bool) {
        // Region A is inside the corner if the edge bends into B.
        let sign = -self.side.signum();
        let inwards = self.halves.map(|half| sign * distance(half));
        let reach = self.halves.map(reach);
        let is_inside = inwards[0] > reach[0] && inwards[1] > reach[1];
        let is_outside = inwards[0] < -reach[0] || inwards[1] < -reach[1];
        (sign * inwards[0].min(inwards[1]), !is_inside && !is_outside)
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::{
        edge_pixel::{COMPLEX, ends, primary_area, testing::Mask},
        testing::{Both, Random, run_both, settings},
    };

    const FINE: Grid = Grid { log2: 4, guess: false };
    const COARSE: Grid = Grid { log2: 2, guess: false };

    /// The cell that contains an aim.
    fn cell_at(aim: u32, log2: u32) -> u32 {
        let index = |share: u32| (share << log2) >> 16;
        index(aim >> 16) << log2 | index(aim & 0xFFFF)
    }

    /// All perimeters of simple pixels.
    fn simple_rings() -> impl Iterator<Item = u32> {
        (0..32).flat_map(|p| (p + 1..32).map(move |q| 1 << p | 1 << q))
    }

    #[test]
    fn golden_pixels() {
        // algorithms.md section 2.6: masks, crossed slots, area of A, and the side of each of the 4x4 cells.
        let golden = [
            ([8, 0, 64, 0], [14, 28], 192, "BBBB?BBB????AAA?"),
            ([4, 8, 0, 0], [3, 29], 477, "??AA?AAAAAAAAAAA"),
            ([0, 32, 0, 2], [5, 22], 288, "BB?AB??AB?AA??AA"),
            ([0, 128, 1, 0], [7, 8], 1, "BBB?BBBBBBBBBBBB"),
            ([0, 0, 4, 16], [10, 19], 77, "BBBBBBB?BB??BB?A"),
            ([128, 0, 0, 1], [23, 24], 1, "BBBBBBBBBBBB?BBB"),
            ([36, 0, 0, 0], [26, 29], 0, "?BBB?BBB?BBB?BBB"),
            ([0, 16, 0, 16], [4, 19], 224, "BB?ABB?ABB?ABB?A"),
            ([16, 0, 16, 0], [12, 27], 224, "BBBBBBBB????AAAA"),
        ];
        for ([left, top, right, bottom], slots, area, cells) in golden {
            let ring = ring(left, top, right, bottom);
            let (cls, _) = COARSE.classify(ring, 0, false, 0);
            let larger_is_a = 2 * area >= 512;
            let larger = if larger_is_a { area } else { 512 - area };
            assert_eq!((cls & CLASS, ends(cls), primary_area(cls)), (SIMPLE, slots, larger));
            assert_eq!(cls & (PRIMARY_IS_A | VALID), u32::from(larger_is_a) * PRIMARY_IS_A);
            for (cell, expected) in (0..).zip(cells.chars()) {
                let (cls, _) = COARSE.classify(ring, 0, true, cell);
                let found = match (cls & AMBIGUOUS != 0, cls & PRIMARY_IS_A != 0) {
                    (true, is_a) => {
                        assert_eq!((cls & VALID, is_a), (0, larger_is_a));
                        '?'
                    }
                    (false, true) => 'A',
                    (false, false) => 'B',
                };
                assert_eq!(found, expected, "{slots:?} {cell}");
                let primary = if cls & PRIMARY_IS_A != 0 { area } else { 512 - area };
                assert_eq!((primary_area(cls), cls >> CELL_SHIFT), (primary, cell));
            }
        }
    }

    #[test]
    fn pixels_without_a_chord_have_one_region() {
        for (ring, class) in [(0, EMPTY), (8, EMPTY), (0x8000_0101, COMPLEX), (u32::MAX, COMPLEX)] {
            let whole = class | PRIMARY_IS_A | 512 << AREA_SHIFT;
            assert_eq!(FINE.classify(ring, 0, false, 77), (whole, PIXEL_CENTER));
            // Row 10 and column 7 of 16 are row 2 and column 1 of 4.
            assert_eq!(
                FINE.classify(ring, 0, true, 10 * 16 + 7),
                (whole | VALID | 9 << CELL_SHIFT, PIXEL_CENTER)
            );
        }
    }

    #[test]
    fn the_share_of_ambiguous_cells() {
        // The mean over all chords. For random lines, algorithms.md section 2.4 gives 26.5, 13.6 and 7.7%.
        for (log2, share) in [(2, 0.286458), (3, 0.146484), (4, 0.081543)] {
            let grid = Grid { log2, guess: false };
            let rings =
                simple_rings().filter(|ring| ring.trailing_zeros() / 8 != (31 - ring.leading_zeros()) / 8);
            let (mut count, mut ambiguous) = (0, 0);
            for ring in rings {
                for cell in 0..1 << (2 * log2) {
                    count += 1;
                    ambiguous += u32::from(grid.classify(ring, 0, true, cell).0 & AMBIGUOUS != 0);
                }
            }
            let found = ambiguous as f32 / count as f32;
            assert!((found - share).abs() < 1e-6, "{found} of {}x{0} cells", 1 << log2);
        }
    }

    #[test]
    fn the_next_sample_is_never_ambiguous() {
        for log2 in 2..=4 {
            let grid = Grid { log2, guess: false };
            let mut centres = 0;
            for ring in simple_rings() {
                let (without, aim) = grid.classify(ring, 0, false, 0);
                // A sample whose position has a rounding error is not ambiguous either.
                for (dx, dy) in [(0, 0), (0, -64), (-64, 0), (-64, -64), (64, 64)] {
                    let moved = |share: u32, by: i32| share.wrapping_add_signed(by);
                    let landed = moved(aim & 0xFFFF, dx) | moved(aim >> 16, dy) << 16;
                    let (healed, _) = grid.classify(ring, 0, true, cell_at(landed, log2));
                    assert_eq!(healed & (VALID | AMBIGUOUS), VALID, "{ring:#x} {log2}");
                    // If it is not the centre, the aim is in the region that was the primary one.
                    assert!(
                        aim == PIXEL_CENTER || (healed ^ without) & PRIMARY_IS_A == 0,
                        "{ring:#x} {log2}"
                    );
                }
                centres += u32::from(aim == PIXEL_CENTER);
            }
            // The aim is the centre unless the chord is near the centre.
            assert!(centres > 160 && centres < 496, "{centres} of 496");
        }
    }

    #[test]
    fn the_next_sample_is_aimed_at_the_region_of_the_present_one_even_if_it_is_the_smaller() {
        // Cell 14 of E1 is in A, the smaller region; the centre is ambiguous.
        let (cls, aim) = COARSE.classify(0x1000_4000, 0, true, 14);
        assert_eq!((cls & PRIMARY_IS_A, primary_area(cls)), (PRIMARY_IS_A, 192));
        assert_eq!(cell_at(aim, 2), 12);
    }

    #[test]
    fn guesses_take_the_side_of_the_cells_centre() {
        let guess = Grid { guess: true, ..COARSE };
        for ring in simple_rings() {
            for cell in 0..16 {
                let (guessed, dropped) =
                    (guess.classify(ring, 0, true, cell).0, COARSE.classify(ring, 0, true, cell).0);
                if dropped & AMBIGUOUS == 0 {
                    assert_eq!(guessed, dropped);
                    continue;
                }
                assert_eq!(guessed & (VALID | AMBIGUOUS), VALID | AMBIGUOUS);
                let [p, q] = ends(guessed);
                let centre = [4 * (cell & 3) as i32 + 2, 4 * (cell >> 2) as i32 + 2];
                let side = Chord::new(p, q).side(centre);
                assert!(side == 0 || (guessed & PRIMARY_IS_A != 0) == (side > 0));
            }
        }
    }

    /// Region A of an edge that bends at a vertex, as a polygon in 1/16 pixel.
    fn polygon(p: u32, q: u32, vertex: [i32; 2]) -> Vec<[i32; 2]> {
        let corners = [(8, [16, 0]), (16, [16, 16]), (24, [0, 16])];
        let passed = corners.into_iter().filter(|(slot, _)| p < *slot && *slot <= q).map(|(_, at)| at);
        [slot_position(p)].into_iter().chain(passed).chain([slot_position(q), vertex]).collect()
    }

    /// Returns true if a position in 1/32 pixel, odd in x, is inside a polygon, by the number of sides that an upward
    /// ray crosses.
    fn holds(polygon: &[[i32; 2]], [x, y]: [i32; 2]) -> bool {
        let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
        sides.fold(false, |inside, (a, b)| {
            let ([ax, ay], [bx, by]) = (a.map(|c| 2 * c), b.map(|c| 2 * c));
            let is_above = (by - ay) * (x - ax) * (bx - ax).signum() < (y - ay) * (bx - ax).abs();
            inside ^ (((ax < x) != (bx < x)) && is_above)
        })
    }

    #[test]
    fn the_area_and_regions_of_an_edge_that_bends() {
        // A chord straight across at 9/16 from the top, and a vertex 8/16 above it: a quarter of the pixel is added to
        // A.
        let (ring, vertex) = (0x0800_1000, 0x10000 | 1 << 8 | 8);
        let area = |vertex, cell| {
            let (cls, _) = FINE.classify(ring, vertex, true, cell);
            (cls & VALID != 0).then(|| (cls & PRIMARY_IS_A != 0, primary_area(cls)))
        };
        let [below_the_tip, beside_it, on_the_slope] = [5 * 16 + 7, 2 * 16 + 1, 4 * 16 + 4];
        assert_eq!(
            [0, vertex].map(|vertex| area(vertex, below_the_tip)),
            [Some((false, 288)), Some((true, 352))]
        );
        assert_eq!(
            [0, vertex].map(|vertex| area(vertex, beside_it)),
            [Some((false, 288)), Some((false, 160))]
        );
        assert_eq!([0, vertex].map(|vertex| area(vertex, on_the_slope)), [Some((false, 288)), None]);
    }

    #[test]
    fn bent_edges_divide_a_pixel_like_polygons() {
        let mut random = Random(21);
        let (mut ambiguous, mut lost) = (0, 0);
        for ring in simple_rings() {
            let (p, q) = (ring.trailing_zeros(), 31 - ring.leading_zeros());
            for _ in 0..4 {
                let at = [random.below(17), random.below(17)];
                let polygon = polygon(p, q, at.map(|c| c as i32));
                let vertex = 0x10000 | at[1] << 8 | at[0];
                let cross = |(a, b): (&[i32; 2], &[i32; 2])| a[0] * b[1] - a[1] * b[0];
                let area: i32 = polygon.iter().zip(polygon.iter().cycle().skip(1)).map(cross).sum();
                for cell in 0..256 {
                    let (cls, aim) = FINE.classify(ring, vertex, true, cell);
                    let centre = [2 * (cell & 15) + 1, 2 * (cell >> 4) + 1].map(|c| c as i32);
                    if cls & AMBIGUOUS == 0 {
                        let is_a = cls & PRIMARY_IS_A != 0;
                        assert_eq!(is_a, holds(&polygon, centre), "{ring:x} {at:?} {cell}");
                        let primary = if is_a { area } else { 512 - area };
                        assert_eq!(primary_area(cls) as i32, primary, "{ring:x} {at:?}");
                    } else {
                        ambiguous += 1;
                        lost +=
                            u32::from(FINE.classify(ring, vertex, true, cell_at(aim, 4)).0 & AMBIGUOUS != 0);
                    }
                }
            }
        }
        // If the region is a sliver at the vertex, the cell farthest from the chord may touch the edge. The next sample
        // is then ambiguous too.
        assert!(50 * lost < ambiguous, "{lost} of {ambiguous} are ambiguous again at their aim");
    }

    fn harness(params: ClassifyParams, mask: &Mask, id: &[u32], subpixel: &[u32]) -> Harness<Classify> {
        let mut harness = Harness::new(params, &settings(mask.size, 0));
        harness.set("mask", &mask.words);
        harness.set("id", id);
        harness.set("subpixel", subpixel);
        harness
    }

    fn assert_agree(both: &Both) {
        ["cls", "kept", "aim"].iter().for_each(|name| both.assert_equal::<u32>(name));
    }

    #[test]
    fn an_edge_across_an_image() {
        // E10 of algorithms.md section 2.6.
        let mut mask = Mask::new([7, 7]);
        mask.line([-256, 496], [2048, 1360]);
        let none = [NO_POINT; 49];
        let both = run_both(&mut harness(ClassifyParams::default(), &mask, &none, &[0; 49]));
        assert_agree(&both);
        let classes: Vec<u32> = both.cpu.get::<u32>("cls").iter().map(|cls| cls & CLASS).collect();
        let row = |y: usize| &classes[7 * y + 1..7 * y + 6];
        assert_eq!([2, 3, 4].map(row), [[1, 0, 0, 0, 0], [1, 1, 1, 1, 0], [0, 0, 0, 1, 1]]);
        assert_eq!([0, 1, 5, 6].map(row), [[0; 5]; 4]);
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(11);
        for size in [[1, 1], [13, 1], [67, 41]] {
            let mask = Mask::random(size, 25, &mut random);
            let pixels = (size[0] * size[1]) as usize;
            let id: Vec<u32> =
                (0..pixels as u32).map(|p| if random.below(3) == 0 { NO_POINT } else { p }).collect();
            for subpixel_bits in 4..=8 {
                for ambiguous in [Ambiguous::Drop, Ambiguous::Guess] {
                    let subpixel: Vec<u32> =
                        (0..pixels).map(|_| random.below(1 << (subpixel_bits / 2 * 2))).collect();
                    let params = ClassifyParams { subpixel_bits, ambiguous };
                    let mut harness = harness(params, &mask, &id, &subpixel);
                    if random.below(2) == 0 {
                        let place = |random: &mut Random| random.below(17) << 8 | random.below(17);
                        let vertex = |_| if random.below(3) == 0 { 0 } else { 0x10000 | place(&mut random) };
                        harness.set("vertex", &(0..pixels).map(vertex).collect::<Vec<u32>>());
                    }
                    let both = run_both(&mut harness);
                    assert_agree(&both);
                    let (cls, kept) = (both.cpu.get::<u32>("cls"), both.cpu.get::<u32>("kept"));
                    for p in 0..pixels {
                        let dropped = ambiguous == Ambiguous::Drop && cls[p] & AMBIGUOUS != 0;
                        assert_eq!(kept[p], if dropped { NO_POINT } else { id[p] });
                        assert_eq!(cls[p] & VALID != 0, kept[p] != NO_POINT);
                    }
                }
            }
        }
    }

    #[test]
    fn an_ambiguous_pixel_gets_a_valid_sample() {
        let mut random = Random(12);
        let mask = Mask::random([48, 40], 40, &mut random);
        let id: Vec<u32> = (0..48 * 40).collect();
        for subpixel_bits in [4, 8] {
            let params = ClassifyParams { subpixel_bits, ..ClassifyParams::default() };
            let log2 = subpixel_bits / 2;
            let subpixel: Vec<u32> = id.iter().map(|_| random.below(1 << subpixel_bits)).collect();
            let first = run_both(&mut harness(params.clone(), &mask, &id, &subpixel));
            assert_agree(&first);
            let kept = first.gpu.get::<u32>("kept");
            assert!(kept.iter().filter(|&&id| id == NO_POINT).count() > 20);
            // Every dropped sample is traced again at its aim.
            let mut next = subpixel;
            for (p, aim) in first.gpu.get::<u32>("aim").into_iter().enumerate() {
                if kept[p] == NO_POINT {
                    next[p] = cell_at(aim, log2);
                }
            }
            let second = run_both(&mut harness(params, &mask, &id, &next));
            assert_agree(&second);
            assert_eq!(second.gpu.get::<u32>("kept"), id);
        }
    }
}
