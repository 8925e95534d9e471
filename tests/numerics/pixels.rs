//! Classes of pixels, regions and reachability: whole numbers, against `algorithms.md` sections 2.3 to 2.5.

use std::sync::LazyLock;

use epigraph_core::{
    Harness, Outputs, Side,
    testing::{Both, Random, settings},
};
use epigraph_stages::{
    classify::{Ambiguous, Classify, ClassifyParams},
    reach::{self, Reach, ReachParams, Rule},
};

use crate::{
    Group, both, measured,
    table::{Measure, Row},
};

pub static ROWS: Group = LazyLock::new(|| measured(&[|| vec![classes()], || vec![reached()]]));

pub const SIZES: [[u32; 2]; 4] = [[1, 1], [1, 41], [61, 47], [16384, 1]];

pub fn sides(outputs: &Both) -> [(Side, &Outputs); 2] {
    [(Side::Cpu, &outputs.cpu), (Side::Gpu, &outputs.gpu)]
}

// ---- Pixels as the algorithms describe them

/// Classes.
pub const EMPTY: u32 = 0;
pub const SIMPLE: u32 = 1;
pub const COMPLEX: u32 = 2;

/// The place of a slot's centre on the perimeter, in 1/16 pixel.
fn place(slot: u32) -> [i64; 2] {
    let along = i64::from(2 * (slot % 8) + 1);
    match slot / 8 {
        0 => [along, 0],
        1 => [16, along],
        2 => [16 - along, 16],
        _ => [0, 16 - along],
    }
}

/// Positive on one side of the line from P to Q, negative on the other: E of section 2.3.
fn side_of(p: [i64; 2], q: [i64; 2], [x, y]: [i64; 2]) -> i64 {
    (p[0] - q[0]) * (y - q[1]) - (p[1] - q[1]) * (x - q[0])
}

/// The crossed slots of a pixel's perimeter, in order.
pub fn crossed(mask: &[u32], width: u32, [x, y]: [u32; 2]) -> Vec<u32> {
    let at = |x: u32, y: u32| mask[(y * (width + 1) + x) as usize];
    let [left, top] = [at(x, y), at(x, y) >> 8];
    let [right, bottom] = [at(x + 1, y), at(x, y + 1) >> 8];
    (0..32)
        .filter(|slot| {
            let (bits, bit) = match slot / 8 {
                0 => (top, slot % 8),
                1 => (right, slot % 8),
                2 => (bottom, 7 - slot % 8),
                _ => (left, 7 - slot % 8),
            };
            bits >> bit & 1 == 1
        })
        .collect()
}

/// The class of a pixel with these crossed slots.
pub fn class_of(slots: &[u32]) -> u32 {
    match slots.len() {
        0 | 1 => EMPTY,
        2 => SIMPLE,
        _ => COMPLEX,
    }
}

/// The area of region A in 1/512 pixel: that of the polygon along the ring from p to q.
fn area([p, q]: [u32; 2]) -> i64 {
    let corners = [(8, [16, 0]), (16, [16, 16]), (24, [0, 16])];
    let between = corners.into_iter().filter(|&(position, _)| p < position && position <= q);
    let mut polygon = vec![place(p)];
    polygon.extend(between.map(|(_, corner)| corner));
    polygon.push(place(q));
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum()
}

/// How an edge divides a pixel: a chord, or two halves that meet in a vertex.
struct Edge {
    ends: [[i64; 2]; 2],
    /// The vertex, and E there; not if the vertex is on the chord.
    bend: Option<([i64; 2], i64)>,
}

impl Edge {
    fn new(slots: &[u32], vertex: u32) -> Self {
        let ends = [slots[0], slots[1]].map(place);
        let at = [vertex & 0xFF, vertex >> 8 & 0xFF].map(i64::from);
        let side = side_of(ends[0], ends[1], at);
        Self { ends, bend: (vertex != 0 && side != 0).then_some((at, side)) }
    }

    /// How surely a place is in A: positive in A, negative in B, 0 on the edge.
    fn at(&self, place: [i64; 2]) -> i64 {
        let [p, q] = self.ends;
        match self.bend {
            None => side_of(p, q, place),
            // The inside of the corner is in A if the edge bends into B.
            Some((v, side)) => {
                let halves = [side_of(p, v, place), side_of(v, q, place)].map(|half| -side.signum() * half);
                -side.signum() * halves[0].min(halves[1])
            }
        }
    }

    /// The region that contains a whole square, in units of 1/32 pixel; `None` if the edge touches it.
    fn contains(&self, from: [i64; 2], size: i64) -> Option<bool> {
        let scaled = |at: [i64; 2]| at.map(|x| 2 * x);
        let [p, q] = self.ends.map(scaled);
        let corners =
            [[0, 0], [size, 0], [0, size], [size, size]].map(|by| [from[0] + by[0], from[1] + by[1]]);
        let is =
            |a, b, sign: i64, test: fn(i64) -> bool| corners.iter().all(|&at| test(sign * side_of(a, b, at)));
        let lines = match self.bend {
            None => {
                return if is(p, q, 1, |x| x > 0) {
                    Some(true)
                } else if is(p, q, 1, |x| x < 0) {
                    Some(false)
                } else {
                    None
                };
            }
            Some((v, _)) => [(p, scaled(v)), (scaled(v), q)],
        };
        let sign = -self.bend.map_or(0, |(_, side)| side.signum());
        if lines.iter().all(|&(a, b)| is(a, b, sign, |x| x > 0)) {
            Some(sign > 0)
        } else if lines.iter().any(|&(a, b)| is(a, b, sign, |x| x < 0)) {
            Some(sign < 0)
        } else {
            None
        }
    }
}

/// `cls` of a pixel, whether its sample counts, and the places at which the next one may aim.
fn classified(
    slots: &[u32],
    vertex: u32,
    cell: Option<u32>,
    log2: u32,
    guess: bool,
) -> (u32, bool, Vec<u32>) {
    let cells = 1 << log2;
    let mut cls = class_of(slots);
    let mut valid = cell.is_some();
    let cell = cell.map(|cell| [cell % cells, cell / cells % cells]);
    if let Some([x, y]) = cell {
        cls |= (4 * (4 * y / cells) + 4 * x / cells) << 25;
    }
    let centre = 0x8000_8000;
    if cls & 3 != SIMPLE {
        return (cls | 1 << 12 | 512 << 13 | u32::from(valid) << 23, valid, vec![centre]);
    }
    let edge = Edge::new(slots, vertex);
    // In 1/512; the triangle between chord and bend changes sides.
    let area = area([slots[0], slots[1]]) - edge.bend.map_or(0, |(_, side)| side);
    let mut is_a = 2 * area >= 512;
    let size = i64::from(32 / cells);
    if let Some(cell) = cell {
        let from = cell.map(|at| i64::from(at) * size);
        let region = edge.contains(from, size);
        if region.is_none() {
            cls |= 1 << 24;
            valid = guess;
        }
        if let Some(region) = region {
            is_a = region;
        } else if guess {
            // Twice the scale of the centre's function: its sign is all that counts.
            let scaled = |at: [i64; 2]| at.map(|x| 2 * x);
            let double =
                Edge { ends: edge.ends.map(scaled), bend: edge.bend.map(|(at, side)| (scaled(at), side)) };
            let here = double.at(from.map(|at| at + size / 2));
            if here != 0 {
                is_a = here > 0;
            }
        }
    }
    let primary = if is_a { area } else { 512 - area } as u32;
    cls |= slots[0] << 2 | slots[1] << 7 | u32::from(is_a) << 12 | primary << 13 | u32::from(valid) << 23;
    // The four cells that meet in the centre.
    let aims = if edge.contains([16 - size; 2], 2 * size).is_some() {
        vec![centre]
    } else {
        // Corner cells of the primary region, the farthest from the chord.
        let last = cells - 1;
        let corners = [[0, 0], [last, 0], [0, last], [last, last]];
        let middle = |cell: u32| (2 * cell + 1) << (15 - log2);
        let [p, q] = edge.ends.map(|at| at.map(|x| 4 * x));
        let far = |[x, y]: [u32; 2]| {
            let at = [x, y].map(|cell| i64::from(2 * cell + 1) * 2 * size / 2);
            let side = side_of(p, q, at.map(|x| 2 * x));
            if is_a { side } else { -side }
        };
        let most = corners.into_iter().map(far).max().expect("four");
        corners.into_iter().filter(|&at| far(at) == most).map(|[x, y]| middle(x) | middle(y) << 16).collect()
    };
    (cls, valid, aims)
}

/// Masks with few crossings in most places: all classes occur, and all slots.
pub fn masks(size: [u32; 2], random: &mut Random) -> Vec<u32> {
    (0..(size[0] + 1) * (size[1] + 1))
        .map(|_| match random.below(8) {
            0..4 => 0,
            4..7 => 1 << random.below(16),
            _ => random.bits() & random.bits() & 0xFFFF,
        })
        .collect()
}

/// The classes of an image without samples, with regions chosen at random.
pub fn random_classes(mask: &[u32], size: [u32; 2], random: &mut Random) -> Vec<u32> {
    let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y]));
    pixels
        .map(|at| {
            let slots = crossed(mask, size[0], at);
            let cell = (random.below(2) == 0).then(|| random.below(256));
            classified(&slots, 0, cell, 4, true).0
        })
        .collect()
}

fn classes() -> Row {
    let mut measure = Measure::exact(
        "classify",
        "class, chord, regions, areas, sample, aim",
        "all slots; 16 to 256 cells; bends; both `ambiguous`; 1x1 to 16384x1",
        "section 2.4, with the corners of each cell",
    );
    let mut random = Random(1);
    for size in SIZES {
        for (number, bits) in [4, 5, 6, 7, 8, 8].into_iter().enumerate() {
            let mask = masks(size, &mut random);
            let pixels = (size[0] * size[1]) as usize;
            let id: Vec<u32> =
                (0..pixels as u32).map(|i| if random.below(3) == 0 { u32::MAX } else { i }).collect();
            let subpixel: Vec<u32> = (0..pixels).map(|_| random.below(256)).collect();
            let vertex: Vec<u32> = (0..pixels)
                .map(|_| match random.below(3) {
                    0 => 0,
                    _ => 0x1_0000 | random.below(17) << 8 | random.below(17),
                })
                .collect();
            let guess = number % 2 == 1;
            let ambiguous = if guess { Ambiguous::Guess } else { Ambiguous::Drop };
            let mut harness = Harness::<Classify>::new(
                ClassifyParams { subpixel_bits: bits, ambiguous },
                &settings(size, 1),
            );
            harness.set("mask", &mask);
            harness.set("id", &id);
            harness.set("subpixel", &subpixel);
            harness.set("vertex", &vertex);
            for (side, outputs) in sides(&both(&mut harness)) {
                let found = outputs.get::<u32>("aim");
                let (mut cls, mut kept, mut aim) = (vec![], vec![], vec![]);
                for at in 0..pixels {
                    let slots = crossed(&mask, size[0], [at as u32 % size[0], at as u32 / size[0]]);
                    let cell = (id[at] != u32::MAX).then_some(subpixel[at]);
                    let (word, valid, aims) = classified(&slots, vertex[at], cell, bits / 2, guess);
                    cls.push(word);
                    kept.push(if valid { id[at] } else { u32::MAX });
                    aim.push(if aims.contains(&found[at]) { found[at] } else { aims[0] });
                }
                let shape = size.map(|side| side as usize);
                let name = format!("{size:?}, {bits} bits, guess {guess}");
                measure.compare_words(side, &name, shape, &outputs.get("cls"), &cls);
                measure.compare_words(side, &name, shape, &outputs.get("kept"), &kept);
                measure.compare_words(side, &name, shape, &found, &aim);
            }
        }
    }
    measure.row()
}

// ---- Reachability

/// Which regions of two pixels are joined: primary and secondary of the one, by those of the other.
type Matrix = [[bool; 2]; 2];

const APART: Matrix = [[false; 2]; 2];

fn through(a: Matrix, b: Matrix) -> Matrix {
    [0, 1].map(|p| [0, 1].map(|q| (0..2).any(|x| a[p][x] && b[x][q])))
}

fn or(a: Matrix, b: Matrix) -> Matrix {
    [0, 1].map(|p| [0, 1].map(|q| a[p][q] || b[p][q]))
}

/// An image's pixels and the crossings of their sides.
struct Image<'a> {
    size: [i32; 2],
    mask: &'a [u32],
    cls: &'a [u32],
}

impl Image<'_> {
    fn cls(&self, [x, y]: [i32; 2]) -> u32 {
        let is_inside = (0..self.size[0]).contains(&x) && (0..self.size[1]).contains(&y);
        if is_inside { self.cls[(y * self.size[0] + x) as usize] } else { COMPLEX }
    }

    /// The region of a pixel at a place on its ring, 0 to 32: 0 primary, 1 secondary.
    fn region(&self, at: [i32; 2], place: f64) -> usize {
        let cls = self.cls(at);
        if cls & 3 != SIMPLE {
            return 0;
        }
        let [p, q] = [cls >> 2 & 31, cls >> 7 & 31].map(f64::from);
        let is_a = p + 0.5 < place && place < q + 0.5;
        usize::from(is_a != (cls >> 12 & 1 == 1))
    }

    /// Pixels that share a side: to the right of each other, or below.
    fn beside(&self, p: [i32; 2], is_right: bool) -> Matrix {
        let q = if is_right { [p[0] + 1, p[1]] } else { [p[0], p[1] + 1] };
        let mut joined = APART;
        if self.cls(p) & 3 == COMPLEX || self.cls(q) & 3 == COMPLEX {
            return joined;
        }
        let word = self.mask[(q[1] * (self.size[0] + 1) + q[0]) as usize];
        let bits = if is_right { word } else { word >> 8 };
        let mut cuts = vec![0.0];
        cuts.extend((0..8).filter(|bit| bits >> bit & 1 == 1).map(|bit| f64::from(bit) + 0.5));
        cuts.push(8.0);
        for interval in cuts.windows(2) {
            let t = 0.5 * (interval[0] + interval[1]);
            let [in_p, in_q] = if is_right { [8.0 + t, 32.0 - t] } else { [24.0 - t, t] };
            joined[self.region(p, in_p)][self.region(q, in_q)] = true;
        }
        joined
    }

    /// The matrix of a pixel and its neighbour at an offset of at most 1.
    fn neighbour(&self, p: [i32; 2], by: [i32; 2]) -> Matrix {
        let back = |m: Matrix| [[m[0][0], m[1][0]], [m[0][1], m[1][1]]];
        match by {
            [1, 0] => self.beside(p, true),
            [0, 1] => self.beside(p, false),
            [-1, 0] => back(self.beside([p[0] - 1, p[1]], true)),
            [0, -1] => back(self.beside([p[0], p[1] - 1], false)),
            [x, y] => {
                let way = |first: [i32; 2], then: [i32; 2]| {
                    through(
                        self.neighbour(p, first),
                        self.neighbour([p[0] + first[0], p[1] + first[1]], then),
                    )
                };
                or(way([x, 0], [0, y]), way([0, y], [x, 0]))
            }
        }
    }

    fn n8(&self, p: [i32; 2]) -> u32 {
        let directions = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];
        (0..8).fold(0, |n8, d| {
            let m = self.neighbour(p, directions[d]);
            let nibble = (0..4).fold(0, |bits, i| bits | u32::from(m[i / 2][i % 2]) << i);
            n8 | nibble << (4 * d)
        })
    }

    fn r24(&self, p: [i32; 2], wide: bool) -> u32 {
        let mut r24 = 0;
        for raw in (0..25).filter(|&raw| raw != 12) {
            let [x, y]: [i32; 2] = [raw % 5 - 2, raw / 5 - 2];
            let reached = if x.abs().max(y.abs()) == 1 {
                self.neighbour(p, [x, y])[0][0]
            } else {
                let steps =
                    (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| [dx, dy])).filter(|by| *by != [0, 0]);
                steps
                    .filter(|[dx, dy]| {
                        // Wide: any pixel next to both. Narrow: within half a pixel of the straight line.
                        let next = [x - dx, y - dy];
                        next[0].abs().max(next[1].abs()) == 1
                            && (wide || (2 * dx - x).abs().max((2 * dy - y).abs()) <= 1)
                    })
                    .any(|by| {
                        let middle = [p[0] + by[0], p[1] + by[1]];
                        let onward = self.neighbour(middle, [x - by[0], y - by[1]]);
                        through(self.neighbour(p, by), onward)[0][0]
                    })
            };
            r24 |= u32::from(reached) << if raw < 12 { raw } else { raw - 1 };
        }
        r24
    }
}

fn reached() -> Row {
    let mut measure = Measure::exact(
        "reach",
        "neighbours (n8) and 5x5 (r24)",
        "all classes; both rules, both methods; 1x1 to 16384x1",
        "section 2.5, with Boolean matrices",
    );
    let mut random = Random(2);
    for size in SIZES {
        for rule in [Rule::Narrow, Rule::Wide] {
            for method in [reach::Method::Fused, reach::Method::ThreePass] {
                let mask = masks(size, &mut random);
                let cls = random_classes(&mask, size, &mut random);
                let mut harness = Harness::<Reach>::new(ReachParams { rule, method }, &settings(size, 1));
                harness.set("mask", &mask);
                harness.set("cls", &cls);
                let image = Image { size: size.map(|side| side as i32), mask: &mask, cls: &cls };
                let pixels = (0..size[1] as i32).flat_map(|y| (0..size[0] as i32).map(move |x| [x, y]));
                let (n8, r24): (Vec<_>, Vec<_>) =
                    pixels.map(|at| (image.n8(at), image.r24(at, rule == Rule::Wide))).unzip();
                for (side, outputs) in sides(&both(&mut harness)) {
                    let (name, shape) =
                        (format!("{size:?} {rule:?} {method:?}"), size.map(|side| side as usize));
                    measure.compare_words(side, &name, shape, &outputs.get("n8"), &n8);
                    measure.compare_words(side, &name, shape, &outputs.get("r24"), &r24);
                }
            }
        }
    }
    measure.row()
}

/// The oracle's own worked values, of `algorithms.md` section 2.6.
#[test]
fn the_oracle_gives_the_worked_values() {
    for (slots, expected) in
        [([14, 28], 192), ([3, 29], 477), ([5, 22], 288), ([7, 8], 1), ([10, 19], 77), ([26, 29], 0)]
    {
        assert_eq!(area(slots), expected);
    }
    let (cls, valid, _) = classified(&[12, 27], 0x1_0000 | 1 << 8 | 8, Some(5 * 16 + 7), 4, false);
    assert!(valid && cls >> 12 & 1 == 1 && cls >> 13 & 0x3FF == 352);
    let (cls, valid, _) = classified(&[12, 27], 0x1_0000 | 1 << 8 | 8, Some(2 * 16 + 1), 4, false);
    assert!(valid && cls >> 12 & 1 == 0 && cls >> 13 & 0x3FF == 160);
    assert!(!classified(&[12, 27], 0x1_0000 | 1 << 8 | 8, Some(4 * 16 + 4), 4, false).1);
    // E10: the crossings of a segment of slope 3/8.
    let mut mask = vec![0; 64];
    for (x, y, bit) in [(1, 2, 5), (2, 3, 0), (3, 3, 3), (4, 3, 6), (5, 4, 1), (6, 4, 4)] {
        mask[8 * y + x] |= 1 << bit;
    }
    for (x, y, bit) in [(1, 3, 6), (4, 4, 4)] {
        mask[8 * y + x] |= 0x100 << bit;
    }
    for (cell, n8, r24) in [(None, 0x1116_4469, 0x0033FF), (Some(14 * 16), 0x4449_1196, 0xFF_CC00)] {
        let cls: Vec<u32> = (0..49u32)
            .map(|at| {
                let slots = crossed(&mask, 7, [at % 7, at / 7]);
                classified(&slots, 0, cell.filter(|_| at == 24), 4, true).0
            })
            .collect();
        let image = Image { size: [7, 7], mask: &mask, cls: &cls };
        assert_eq!((image.n8([3, 3]), image.r24([3, 3], false)), (n8, r24));
    }
}
