//! How edges divide a pixel: crossings with its sides, its class, its two regions, and the 2x2 Boolean matrices of
//! which regions of two pixels are joined (`algorithms.md` sections 2.3 to 2.5). Mirrored by
//! `shaders/shared/edge_pixel.wgsl`.
//!
//! The perimeter of a pixel is a ring of 32 slots, eight a side, clockwise from the top left corner. A simple pixel is
//! cut by the chord between the centres of its two crossed slots p < q: region A is on the side of the slots between p
//! and q, region B on the other.

epigraph_core::constants! {
    /// The class of a pixel with at most one crossing: it is one region.
    pub const EMPTY: u32 = 0;
    /// The class of a pixel with two crossings: a chord cuts it into two regions.
    pub const SIMPLE: u32 = 1;
    /// The class of a pixel with more crossings, and of everything outside the image: its regions are unknown.
    pub const COMPLEX: u32 = 2;
    /// Bits of `cls` that hold the class.
    pub const CLASS: u32 = 3;
    /// Lowest of the five bits of `cls` that hold the first crossed slot of a simple pixel.
    pub const P_SHIFT: u32 = 2;
    /// Lowest of the five bits of `cls` that hold the second crossed slot of a simple pixel.
    pub const Q_SHIFT: u32 = 7;
    /// Set in `cls` if the primary region is A.
    pub const PRIMARY_IS_A: u32 = 1 << 12;
    /// Lowest of the ten bits of `cls` that hold the area of the primary region, see [`PIXEL_AREA`].
    pub const AREA_SHIFT: u32 = 13;
    /// Set in `cls` if the pixel has a sample that counts.
    pub const VALID: u32 = 1 << 23;
    /// Set in `cls` if the cell of the pixel's sample touches the chord.
    pub const AMBIGUOUS: u32 = 1 << 24;
    /// Lowest of the four bits of `cls` that hold the sample's cell of 4x4, row by row.
    pub const CELL_SHIFT: u32 = 25;
    /// The area of a whole pixel: areas are in 1/512 of it, so that those of all chords are whole numbers.
    pub const PIXEL_AREA: u32 = 512;
}

/// Pixels of a row that are skipped together where no edge crosses them.
pub const RUN: usize = 16;

/// The neighbours of a pixel in the order of the nibbles of N8: E, SE, S, SW, W, NW, N, NE. The opposite of d is
/// (d + 4) & 7.
pub const DIRECTIONS: [[i32; 2]; 8] = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];

/// The perimeter of a pixel from the 8-bit masks of its sides, bit k for a crossing between k/8 and (k+1)/8 from the
/// left or top.
pub fn ring(left: u32, top: u32, right: u32, bottom: u32) -> u32 {
    let reversed = |mask: u32| mask.reverse_bits() >> 24;
    top | (right << 8) | (reversed(bottom) << 16) | (reversed(left) << 24)
}

/// The perimeter of a pixel of an image `width` pixels wide, from the crossings with the left (bits 0 to 7) and top (8
/// to 15) side of every pixel, one column and row more than there are pixels.
pub fn ring_at(mask: &[u32], [x, y]: [u32; 2], width: usize) -> u32 {
    let own = y as usize * (width + 1) + x as usize;
    let [right, below] = [mask[own + 1], mask[own + width + 1]];
    ring(mask[own] & 0xFF, mask[own] >> 8 & 0xFF, right & 0xFF, below >> 8 & 0xFF)
}

/// The class of a pixel with this perimeter.
pub fn class_of(ring: u32) -> u32 {
    match ring.count_ones() {
        0 | 1 => EMPTY,
        2 => SIMPLE,
        _ => COMPLEX,
    }
}

/// The crossed slots p < q of a simple pixel.
pub fn ends(cls: u32) -> [u32; 2] {
    [(cls >> P_SHIFT) & 31, (cls >> Q_SHIFT) & 31]
}

/// The area of the primary region, in 1/512 pixel.
pub fn primary_area(cls: u32) -> u32 {
    (cls >> AREA_SHIFT) & 0x3FF
}

/// Centre of a slot, in 1/16 pixel from the pixel's top left corner.
pub fn slot_position(slot: u32) -> [i32; 2] {
    let along = 2 * (slot & 7) as i32 + 1;
    match slot >> 3 {
        0 => [along, 0],
        1 => [16, along],
        2 => [16 - along, 16],
        _ => [0, 16 - along],
    }
}

/// The area of region A of the chord from slot p to slot q, in 1/512 pixel.
pub fn area_of_a(p: u32, q: u32) -> u32 {
    let corners = [(8, [16, 0]), (16, [16, 16]), (24, [0, 16])];
    area_of_arc([p, q], [p, q].map(slot_position), corners)
}

/// The area between a ring's arc from slot p to slot q, given by their positions, and the chord: in 1/512 pixel, with
/// positions in 1/16. `corners` are the ring's corners, each with the slot that follows it.
pub fn area_of_arc([p, q]: [u32; 2], [first, end]: [[i32; 2]; 2], corners: [(u32, [i32; 2]); 3]) -> u32 {
    let cross = |a: [i32; 2], b: [i32; 2]| a[0] * b[1] - b[0] * a[1];
    // The polygon: along the ring from p over the corners to q, and back along the chord.
    let (mut doubled, mut last) = (0, first);
    for (position, corner) in corners {
        if p < position && position <= q {
            doubled += cross(last, corner);
            last = corner;
        }
    }
    (doubled + cross(last, end) + cross(end, first)) as u32
}

/// The line of a simple pixel's chord, as a linear function of position, positive in region A and negative in B.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chord {
    /// Normal of the chord, towards A.
    pub normal: [i32; 2],
    /// The function's value at the pixel's top left corner.
    pub offset: i32,
}

impl Chord {
    /// The chord from slot p to slot q.
    pub fn new(p: u32, q: u32) -> Self {
        Self::between(slot_position(p), slot_position(q))
    }

    /// The chord between two positions on the perimeter, clockwise, in 1/16 pixel.
    pub fn between(p: [i32; 2], q: [i32; 2]) -> Self {
        let normal = [q[1] - p[1], p[0] - q[0]];
        Self { normal, offset: -(normal[0] * q[0] + normal[1] * q[1]) }
    }

    /// The function at a position in 1/16 pixel from the top left corner.
    pub fn side(self, [x, y]: [i32; 2]) -> i32 {
        self.normal[0] * x + self.normal[1] * y + self.offset
    }
}

/// The region of a pixel that is not complex, at a position on its ring that is not a crossing: 0 primary, 1 secondary.
/// The position is in quarters of a slot from the top left corner, 0 to 128.
#[inline]
pub fn region(cls: u32, place: u32) -> u32 {
    let [p, q] = ends(cls);
    let is_a = 4 * p + 2 < place && place < 4 * q + 2;
    u32::from(cls & CLASS == SIMPLE && is_a != (cls & PRIMARY_IS_A != 0))
}

/// Which regions of two pixels touch at the side that they share, as a matrix. `crossings` is the side's mask with this
/// many slots; `places` maps a position on the side to the positions on both rings, in quarters of a slot.
#[inline(always)]
pub fn joined(
    p: u32,
    q: u32,
    crossings: impl FnOnce() -> u32,
    slots: u32,
    places: impl Fn(u32) -> [u32; 2],
) -> u32 {
    if (p | q) & CLASS == EMPTY {
        return 1;
    }
    if (p | q) & COMPLEX != 0 {
        return 0;
    }
    // The crossings cut the side into intervals; each joins the regions at its middle.
    let (mut rest, mut start, mut joined) = (crossings(), 0, 0);
    loop {
        // In half slots.
        let end = if rest == 0 { 2 * slots } else { 2 * rest.trailing_zeros() + 1 };
        let [in_p, in_q] = places(start + end);
        joined |= 1 << (2 * region(p, in_p) + region(q, in_q));
        if rest == 0 {
            return joined;
        }
        rest &= rest - 1;
        start = end;
    }
}

/// The Boolean product of two matrices: which regions of P and R are joined through Q, from the matrix of P and Q and
/// that of Q and R. Bit 2 * (region of the first) + (region of the second).
#[inline(always)]
pub fn chain(pq: u32, qr: u32) -> u32 {
    // Each column of the first times each row of the second: through the primary region of Q, or the secondary.
    let through_primary = if_odd(pq, qr & 3) | if_odd(pq >> 2, (qr & 3) << 2);
    let through_secondary = if_odd(pq >> 1, qr >> 2) | if_odd(pq >> 3, qr & 12);
    through_primary | through_secondary
}

/// The bits if the lowest bit of the number is set, otherwise 0. Branchless. [`lanes::if_odd`](super::lanes::if_odd) does the
/// same for eight.
#[inline(always)]
pub fn if_odd(number: u32, bits: u32) -> u32 {
    0u32.wrapping_sub(number & 1) & bits
}

/// The matrix of Q and P, from that of P and Q.
#[inline(always)]
pub fn transpose(pq: u32) -> u32 {
    (pq & 9) | ((pq & 2) << 1) | ((pq & 4) >> 1)
}

#[cfg(test)]
mod tests {
    use super::{testing::Mask, *};

    #[test]
    fn crossings_of_a_segment() {
        // E10 of algorithms.md section 2.6: pixel and bit of each crossing with a left and a top side.
        let mut mask = Mask::new([7, 7]);
        mask.line([-256, 496], [2048, 1360]);
        let left = [(1, 2, 5), (2, 3, 0), (3, 3, 3), (4, 3, 6), (5, 4, 1), (6, 4, 4)];
        let top = [(1, 3, 6), (4, 4, 4)];
        for y in 1..6 {
            for x in 1..7 {
                let bits = |list: &[(usize, usize, u32)]| {
                    list.iter().filter(|at| (at.0, at.1) == (x, y)).fold(0, |bits, at| bits | 1 << at.2)
                };
                assert_eq!(mask.words[8 * y + x], bits(&left) | bits(&top) << 8, "{x} {y}");
            }
        }
    }

    #[test]
    fn products_and_transposes_of_matrices() {
        // algorithms.md section 2.5.
        let chains =
            [(9, 9, 9), (6, 6, 9), (9, 6, 6), (6, 9, 6), (1, 1, 1), (5, 3, 15), (2, 4, 1), (15, 1, 5)];
        for (a, b, ab) in chains {
            assert_eq!(chain(a, b), ab, "{a} {b}");
        }
        let transposed = [1, 2, 3, 4, 5, 6, 9, 15].map(transpose);
        assert_eq!(transposed, [1, 4, 5, 2, 3, 6, 9, 15]);
        for a in 0..16 {
            assert_eq!((chain(0, a), chain(a, 0), transpose(transpose(a))), (0, 0, a));
            for b in 0..16 {
                assert_eq!(transpose(chain(a, b)), chain(transpose(b), transpose(a)), "{a} {b}");
            }
        }
    }

    #[test]
    fn rings_and_areas() {
        // Left, top, right, bottom masks; ring; area of A: algorithms.md section 2.6.
        let golden = [
            ([1 << 3, 0, 1 << 6, 0], 0x1000_4000, 192),
            ([1 << 2, 1 << 3, 0, 0], 0x2000_0008, 477),
            ([0, 1 << 5, 0, 1 << 1], 0x0040_0020, 288),
            ([0, 1 << 7, 1 << 0, 0], 0x0000_0180, 1),
            ([0, 0, 1 << 2, 1 << 4], 0x0008_0400, 77),
            ([1 << 7, 0, 0, 1 << 0], 0x0180_0000, 1),
            ([0b10_0100, 0, 0, 0], 0x2400_0000, 0),
            ([0, 1 << 4, 0, 1 << 4], 0x0008_0010, 224),
            ([1 << 4, 0, 1 << 4, 0], 0x0800_1000, 224),
        ];
        for ([left, top, right, bottom], expected, area) in golden {
            let ring = ring(left, top, right, bottom);
            assert_eq!((ring, class_of(ring)), (expected, SIMPLE));
            assert_eq!(area_of_a(ring.trailing_zeros(), 31 - ring.leading_zeros()), area, "{ring:#x}");
        }
        assert_eq!(class_of(ring(0, 8, 0, 0)), EMPTY);
        assert_eq!((ring(1, 1, 1, 0), class_of(0x8000_0101)), (0x8000_0101, COMPLEX));
    }

    #[test]
    fn areas_and_regions_agree_for_every_chord() {
        for p in 0..32 {
            for q in p + 1..32 {
                let chord = Chord::new(p, q);
                assert_eq!([p, q].map(|slot| chord.side(slot_position(slot))), [0, 0]);
                // The area by counting the cells of a fine grid: exact except for cells that the chord cuts.
                let inside = (0..64).flat_map(|x| (0..64).map(move |y| [2 * x + 1, 2 * y + 1]));
                let [nx, ny] = chord.normal;
                let is_a = |at: &[i32; 2]| nx * at[0] + ny * at[1] + 8 * chord.offset > 0;
                let share = inside.filter(is_a).count() as f32 / 4096.0;
                let area = area_of_a(p, q);
                assert!(area <= PIXEL_AREA);
                // A chord passes through at most 128 of the 64 x 64 cells, and halves them on average.
                assert!((share - area as f32 / 512.0).abs() < 0.017, "{p} {q}: {share} {area}");
                // The centres of all other slots are on the side that `region` returns, unless they are on the chord's
                // line.
                let cls = SIMPLE | p << P_SHIFT | q << Q_SHIFT | PRIMARY_IS_A;
                for slot in (0..32).filter(|&slot| slot != p && slot != q) {
                    let side = chord.side(slot_position(slot));
                    let region = region(cls, 4 * slot + 2);
                    assert!(side == 0 || region == u32::from(side < 0), "{p} {q} {slot}");
                    assert_eq!(region, u32::from(!(p < slot && slot < q)));
                }
            }
        }
    }
}

/// Masks for tests: the output of the edge raster, computed by the exact rule in i64.
#[cfg(test)]
pub mod testing {
    use crate::shared::testing::Random;

    /// Crossings of the pixels' sides, (W + 1) x (H + 1) words.
    pub struct Mask {
        /// Width and height of the image.
        pub size: [u32; 2],
        /// Row by row.
        pub words: Vec<u32>,
        /// Lines per pixel: 1, or 2 with the middle ones.
        lines: i64,
    }

    impl Mask {
        /// No edges.
        pub fn new(size: [u32; 2]) -> Self {
            Self { size, words: vec![0; (size[0] as usize + 1) * (size[1] as usize + 1)], lines: 1 }
        }

        /// The same mask, in which crossings of the pixels' middle lines are marked too.
        pub fn with_middle(self) -> Self {
            Self { lines: 2, ..self }
        }

        /// `count` closed polygons and open polylines, from a third of a pixel wide to as wide as the image.
        pub fn random(size: [u32; 2], count: u32, random: &mut Random) -> Self {
            let mut mask = Self::new(size);
            mask.random_lines(count, random);
            mask
        }

        /// Marks the crossings of such polygons.
        pub fn random_lines(&mut self, count: u32, random: &mut Random) {
            let size = self.size;
            for _ in 0..count {
                let corners = 2 + random.below(5);
                let extent = [80 << random.below(9), 80 << random.below(9)].map(|e: u32| e.min(1 << 14));
                let base = [random.below(256 * size[0]), random.below(256 * size[1])];
                // Every other polygon has its vertices on corners of pixels.
                let step = if random.below(2) == 0 { 1 } else { 256 };
                let mut vertex = || {
                    let at = [0, 1].map(|axis| {
                        let at = i64::from(base[axis]) + i64::from(random.below(extent[axis]));
                        at - i64::from(extent[axis] / 2)
                    });
                    at.map(|at| at / step * step)
                };
                let vertices: Vec<_> = (0..corners).map(|_| vertex()).collect();
                vertices.windows(2).for_each(|pair| self.line(pair[0], pair[1]));
                if corners > 2 {
                    self.line(vertices[vertices.len() - 1], vertices[0]);
                }
            }
        }

        /// Marks the crossings of a segment, in 1/256 pixel: `algorithms.md` section 2.2.
        pub fn line(&mut self, a: [i64; 2], b: [i64; 2]) {
            for axis in [0, 1] {
                let (a, b) = if a[axis] < b[axis] { (a, b) } else { (b, a) };
                let (along, across) = (b[axis] - a[axis], b[1 - axis] - a[1 - axis]);
                // A vertex on a line counts as behind it.
                let step = 256 / self.lines;
                for line in a[axis].div_euclid(step) + 1..=b[axis].div_euclid(step) {
                    let crossing = 8 * (a[1 - axis] * along + (step * line - a[axis]) * across);
                    let unit = 256 * along;
                    // Vertices are moved by (e, e^2), with e infinitesimal. This decides for crossings on a boundary of
                    // slots: a segment that descends crosses vertical lines slightly higher.
                    let slot = if axis == 0 && across > 0 {
                        -(-crossing).div_euclid(unit) - 1
                    } else {
                        crossing.div_euclid(unit)
                    };
                    let (pixel, bit) = (slot.div_euclid(8), slot.rem_euclid(8));
                    let (line, half) = (line.div_euclid(self.lines), line.rem_euclid(self.lines));
                    let at = if axis == 0 { [line, pixel] } else { [pixel, line] };
                    // The corners beyond the last pixels have no middle lines.
                    if half == 0 || line < i64::from(self.size[axis]) {
                        self.mark(at, (bit + 8 * axis as i64 + 16 * half) as u32);
                    }
                }
            }
        }

        fn mark(&mut self, at: [i64; 2], bit: u32) {
            let [width, height] = self.size.map(i64::from);
            if (0..=width).contains(&at[0]) && (0..=height).contains(&at[1]) {
                self.words[(at[1] * (width + 1) + at[0]) as usize] |= 1 << bit;
            }
        }
    }
}
