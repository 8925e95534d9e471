//! Which vertex of a part is which of another: two walks over the triangles of both, step by step.

use std::collections::HashMap;

use glam::DVec3;

use super::part::Part;

const NONE: u32 = u32::MAX;

/// A part prepared for walks.
pub(super) struct Net<'a> {
    pub(super) part: &'a Part,
    /// For each side of a triangle, the next one between the same vertices, around to itself. Side `3 t + k` is that
    /// from corner k of triangle t.
    next: Vec<u32>,
}

impl<'a> Net<'a> {
    pub(super) fn new(part: &'a Part) -> Self {
        let mut sides: Vec<([u32; 2], u32)> = (0..3 * part.triangles.len() as u32)
            .map(|side| {
                let [a, b] = ends(part, side);
                ([a.min(b), a.max(b)], side)
            })
            .collect();
        sides.sort_unstable();
        let mut next = vec![0; sides.len()];
        for edge in sides.chunk_by(|a, b| a.0 == b.0) {
            for (i, &(_, side)) in edge.iter().enumerate() {
                next[side as usize] = edge[(i + 1) % edge.len()].1;
            }
        }
        Self { part, next }
    }

    /// The other sides between the same vertices.
    fn others(&self, side: u32) -> impl Iterator<Item = u32> {
        let mut at = side;
        std::iter::from_fn(move || {
            at = self.next[at as usize];
            (at != side).then_some(at)
        })
    }

    /// The triangle with the fewest others like it, where walks begin. Those are alike whose sides, by their lengths,
    /// differ by less than `slack`; some count that differ by up to twice as much.
    pub(super) fn seed(&self, slack: f64) -> usize {
        let cell = |triangle: usize| {
            let mut sides = self.part.sides(triangle);
            sides.sort_unstable_by(f64::total_cmp);
            (self.part.mark_of(triangle), sides.map(|side| (side / slack) as i64))
        };
        let mut counts: HashMap<(u64, [i64; 3]), usize> = HashMap::new();
        let mut first = Vec::new();
        for triangle in 0..self.part.triangles.len() {
            let count = counts.entry(cell(triangle)).or_default();
            *count += 1;
            if *count == 1 {
                first.push(triangle);
            }
        }
        let alike = |triangle: usize| {
            let (mark, [x, y, z]) = cell(triangle);
            let near = (0..27).map(|i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
            near.filter_map(|cell| counts.get(&(mark, cell))).sum::<usize>()
        };
        // The longest of equally rare ones, as rounding matters least there.
        let longest = |triangle: usize| self.part.sides(triangle).into_iter().fold(0.0, f64::max);
        let best = first.into_iter().map(|triangle| (alike(triangle), -longest(triangle), triangle));
        let best = best.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        best.expect("a part has triangles").2
    }
}

/// The two vertices of a side.
fn ends(part: &Part, side: u32) -> [u32; 2] {
    let corners = part.triangles[side as usize / 3];
    let k = side as usize % 3;
    [corners[k], corners[(k + 1) % 3]]
}

/// The corner that is not on a side.
fn apex(part: &Part, side: u32) -> u32 {
    part.triangles[side as usize / 3][(side as usize + 2) % 3]
}

/// The third corner of the triangle at `side`, in the frame of the triangle at `from`, which has the same edge.
fn seen_from(part: &Part, from: u32, side: u32) -> DVec3 {
    let [a, b] = ends(part, from).map(|vertex| part.at(vertex));
    let along = (b - a).normalize_or_zero();
    let up = along.cross(part.at(apex(part, from)) - a).normalize_or_zero();
    let offset = part.at(apex(part, side)) - a;
    DVec3::new(offset.dot(along), offset.dot(up), offset.dot(up.cross(along)))
}

/// A triangle of the copy: three times its index, plus its corner at which the original's triangle begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Match(u32);

impl Match {
    const NONE: Self = Self(NONE);

    /// The same triangle, beginning at the same corner.
    pub(super) fn itself(triangle: u32) -> Self {
        Self(3 * triangle)
    }

    pub(super) fn triangle(self) -> usize {
        self.0 as usize / 3
    }

    /// The copy's corner for a corner of the original, both from 0 to 2.
    pub(super) fn corner(self, corner: usize) -> usize {
        (corner + self.0 as usize) % 3
    }

    /// The copy's side for side `corner` of the original.
    fn side(self, corner: usize) -> u32 {
        3 * (self.0 / 3) + self.corner(corner) as u32
    }

    /// The match in which one side becomes another.
    fn of_sides(from: u32, to: u32) -> Self {
        Self(3 * (to / 3) + (to % 3 + 3 - from % 3) % 3)
    }
}

/// A walk over an original and what may be its copy.
pub(super) struct Walk<'a> {
    original: &'a Net<'a>,
    copy: &'a Net<'a>,
    /// The triangle of the original where walks begin.
    seed: usize,
    /// How much the lengths of corresponding sides may differ.
    slack: f64,
    /// The copy's triangle for each triangle of the original.
    triangles: Vec<Match>,
    /// The triangles of the copy that are the original's.
    taken: Vec<bool>,
    /// The copy's vertex for each vertex of the original, and the reverse.
    to: Vec<u32>,
    from: Vec<u32>,
    /// The triangles and vertices of the original that have been reached.
    reached: Vec<u32>,
    named: Vec<u32>,
}

impl<'a> Walk<'a> {
    /// Both parts have equal numbers of vertices and triangles.
    pub(super) fn new(original: &'a Net, copy: &'a Net, seed: usize, slack: f64) -> Self {
        let [triangles, vertices] = [original.part.triangles.len(), original.part.positions.len()];
        Self {
            original,
            copy,
            seed,
            slack,
            triangles: vec![Match::NONE; triangles],
            taken: vec![false; triangles],
            to: vec![NONE; vertices],
            from: vec![NONE; vertices],
            reached: Vec::new(),
            named: Vec::new(),
        }
    }

    /// The triangles of the copy that may be the original's `seed`, with how much their sides differ, the least first.
    pub(super) fn starts(&self) -> Vec<(f64, Match)> {
        let all = (0..3 * self.triangles.len() as u32).map(Match);
        let mut starts: Vec<(f64, Match)> =
            all.filter_map(|start| Some((self.difference(self.seed, start)?, start))).collect();
        starts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        starts
    }

    /// How much the sides of a triangle differ from those of the copy's; `None` if the triangles cannot be the same.
    fn difference(&self, triangle: usize, there: Match) -> Option<f64> {
        let (original, copy) = (self.original.part, self.copy.part);
        let [here, other] = [original.marks_at(triangle), copy.marks_at(there.triangle())];
        if (0..3).any(|corner| here[corner] != other[there.corner(corner)]) {
            return None;
        }
        let [here, other] = [original.sides(triangle), copy.sides(there.triangle())];
        let differences = [0, 1, 2].map(|corner| (here[corner] - other[there.corner(corner)]).abs());
        let most = differences.into_iter().fold(0.0, f64::max);
        (most <= self.slack).then_some(most)
    }

    /// The copy's triangles and vertices for those of the original if `start` is `seed`; `None` if that leads to a
    /// contradiction. Each triangle looked at takes 1 of `work`; when none is left, there is no result.
    pub(super) fn go(&mut self, start: Match, work: &mut u64) -> Option<(&[Match], &[u32])> {
        self.clear();
        let mut right = self.take(self.seed as u32, start);
        let mut next = 0;
        while right && next < self.reached.len() {
            *work = work.checked_sub(1)?;
            let triangle = self.reached[next];
            next += 1;
            let there = self.triangles[triangle as usize];
            right = (0..3).all(|corner| self.cross(3 * triangle + corner, there.side(corner as usize)));
        }
        let whole = right && self.reached.len() == self.triangles.len();
        whole.then_some((&self.triangles, &self.to))
    }

    /// Takes the triangles on the other sides of an edge; false for a contradiction.
    fn cross(&mut self, from: u32, to: u32) -> bool {
        let (original, copy) = (self.original, self.copy);
        let count = original.others(from).count();
        if count != copy.others(to).count() {
            return false;
        }
        for side in original.others(from) {
            let known = self.triangles[side as usize / 3];
            if known != Match::NONE {
                if !copy.others(to).any(|other| Match::of_sides(side, other) == known) {
                    return false;
                }
                continue;
            }
            let other = if count == 1 { copy.others(to).next() } else { self.choose(from, side, to) };
            if !other.is_some_and(|other| self.take(side / 3, Match::of_sides(side, other))) {
                return false;
            }
        }
        true
    }

    /// Where an edge has more than two triangles, that of the copy which lies as `side` does, seen from the triangle
    /// that was reached.
    fn choose(&self, from: u32, side: u32, to: u32) -> Option<u32> {
        let (original, copy) = (self.original.part, self.copy.part);
        let wanted = seen_from(original, from, side);
        let begin = self.to[ends(original, side)[0] as usize];
        let candidates = self
            .copy
            .others(to)
            .filter(|&other| !self.taken[other as usize / 3] && ends(copy, other)[0] == begin);
        let distance = |other: &u32| seen_from(copy, to, *other).distance_squared(wanted);
        candidates.min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// Notes that a triangle of the original is one of the copy; false if that contradicts what was noted before, or
    /// the lengths of their sides.
    fn take(&mut self, triangle: u32, there: Match) -> bool {
        if self.taken[there.triangle()] {
            return false;
        }
        self.taken[there.triangle()] = true;
        self.triangles[triangle as usize] = there;
        self.reached.push(triangle);
        for corner in 0..3 {
            let vertex = self.original.part.triangles[triangle as usize][corner];
            let other = self.copy.part.triangles[there.triangle()][there.corner(corner)];
            let (to, from) = (&mut self.to[vertex as usize], &mut self.from[other as usize]);
            if *to == NONE && *from == NONE {
                (*to, *from) = (other, vertex);
                self.named.push(vertex);
            } else if *to != other {
                return false;
            }
        }
        let [here, other] =
            [self.original.part.sides(triangle as usize), self.copy.part.sides(there.triangle())];
        (0..3).all(|corner| (here[corner] - other[there.corner(corner)]).abs() <= self.slack)
    }

    /// Forgets everything, in time proportional to what was noted.
    fn clear(&mut self) {
        for triangle in self.reached.drain(..) {
            let there = std::mem::replace(&mut self.triangles[triangle as usize], Match::NONE);
            self.taken[there.triangle()] = false;
        }
        for vertex in self.named.drain(..) {
            let other = std::mem::replace(&mut self.to[vertex as usize], NONE);
            self.from[other as usize] = NONE;
        }
    }
}
