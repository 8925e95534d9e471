//! Polygons in space as triangles.

use std::collections::HashMap;

use earcut::Earcut;
use glam::{DVec2, DVec3};

/// The share of a polygon's area that rounding may change.
const ROUNDING: f64 = 1e-9;
/// The share of a polygon's area by which its triangles may differ before it counts as one that crosses itself.
const LOST_AREA: f64 = 1e-6;
/// The height of a polygon over its plane, in its diameters, above which it no longer counts as flat.
const BENT: f64 = 0.02;

/// The most work for the polygons of a file, in squares of their numbers of corners: that is how the time to cut ears grows
/// if their corners are far from one another. A minute at most; a coast of as many corners takes less than a second.
const MOST_WORK: u64 = 250_000 * 250_000;

/// What is wrong with a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// Its sides cross, so that it has no inside that triangles could fill.
    Crossed,
    /// It is neither convex nor flat, so that the triangles are those of its projection to a plane.
    Bent,
    /// It is not convex, and has so many corners that it is not cut but taken as convex.
    Large,
}

/// Cuts polygons into triangles. It is kept from polygon to polygon for its memory.
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    flat: Vec<DVec2>,
    cut: Vec<u32>,
    /// What is done of [`MOST_WORK`].
    work: u64,
}

impl Triangulator {
    pub fn new() -> Self {
        Self { earcut: Earcut::new(), flat: Vec::new(), cut: Vec::new(), work: 0 }
    }

    /// Appends the triangles of the polygon with these `corners`, at least three, all finite, as indices into them, in
    /// the polygon's orientation. Every side of the polygon is a side of a triangle, also between corners on one line, so
    /// that neighbours meet along whole sides.
    ///
    /// A polygon that its first corner sees whole, as it does in every convex one, becomes a fan around that corner.
    pub fn add(&mut self, corners: &[DVec3], triangles: &mut Vec<[u32; 3]>) -> Option<Fault> {
        let count = corners.len() as u32;
        let fan = (2..count).map(|k| [0, k - 1, k]);
        if count < 4 {
            triangles.extend(fan);
            return None;
        }
        let from_first = |k: u32| corners[k as usize] - corners[0];
        let area = |k: u32| from_first(k - 1).cross(from_first(k));
        // Twice the area, along the normal.
        let whole: DVec3 = (2..count).map(area).sum();
        let allowed = ROUNDING * whole.length_squared();
        if (2..count).all(|k| area(k).dot(whole) >= -allowed) {
            // Opposite parts that cancel are no polygon, but one without any area is a harmless line.
            let is_whole = whole != DVec3::ZERO || (2..count).all(|k| area(k) == DVec3::ZERO);
            triangles.extend(fan);
            return (!is_whole).then_some(Fault::Crossed);
        }
        let size = (1..count).map(|k| from_first(k).length()).fold(0.0, f64::max);
        let normal = whole.normalize_or_zero();
        if normal == DVec3::ZERO {
            triangles.extend(fan);
            return Some(Fault::Crossed);
        }
        let work = self.work + u64::from(count) * u64::from(count);
        if work > MOST_WORK {
            triangles.extend(fan);
            return Some(Fault::Large);
        }
        self.work = work;
        let across = normal.any_orthonormal_vector();
        let up = normal.cross(across);
        self.flat.clear();
        self.flat.extend(
            (0..count).map(from_first).map(|point| DVec2::new(point.dot(across), point.dot(up)) / size),
        );
        self.earcut.earcut(self.flat.iter().map(|point| point.to_array()), &[], &mut self.cut);
        let begin = triangles.len();
        let flat = &self.flat;
        let doubled = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| flat[corner as usize]);
            (b - a).perp_dot(c - a)
        };
        // Ears have one orientation, but for those so thin that rounding decides.
        let cut = || self.cut.chunks_exact(3).map(|t| [t[0], t[1], t[2]]);
        let covered: f64 = cut().map(doubled).sum();
        triangles.extend(cut().map(|[a, b, c]| if covered < 0.0 { [a, c, b] } else { [a, b, c] }));
        let wanted = whole.length() / (size * size);
        if triangles.len() == begin {
            triangles.extend(fan);
            return Some(Fault::Crossed);
        }
        insert_skipped(count, begin, triangles);
        if (covered.abs() - wanted).abs() > LOST_AREA * wanted {
            return Some(Fault::Crossed);
        }
        let height = (0..count).map(|k| from_first(k).dot(normal).abs()).fold(0.0, f64::max);
        (height > BENT * size).then_some(Fault::Bent)
    }
}

/// Cutting ears leaves corners out that are on one line with their neighbours. They are put back into the side of the
/// triangle on which they are.
fn insert_skipped(count: u32, begin: usize, triangles: &mut Vec<[u32; 3]>) {
    let mut is_used = vec![false; count as usize];
    triangles[begin..].iter().flatten().for_each(|&corner| is_used[corner as usize] = true);
    if is_used.iter().all(|&used| used) {
        return;
    }
    let mut sides = HashMap::new();
    for (index, &[a, b, c]) in triangles.iter().enumerate().skip(begin) {
        sides.extend([([a, b], index), ([b, c], index), ([c, a], index)]);
    }
    let used: Vec<u32> = (0..count).filter(|&corner| is_used[corner as usize]).collect();
    for (place, &from) in used.iter().enumerate() {
        let to = used[(place + 1) % used.len()];
        let skipped = (to + count - from) % count - 1;
        let Some(&index) = sides.get(&[from, to]).filter(|_| skipped > 0) else { continue };
        let triangle = triangles[index];
        let Some(&apex) = triangle.iter().find(|corner| **corner != from && **corner != to) else { continue };
        let corner = |step: u32| (from + step) % count;
        triangles[index] = [from, corner(1), apex];
        triangles.extend((1..=skipped).map(|step| [corner(step), corner(step + 1), apex]));
        // Other corners may have to be put into this side.
        sides.insert([to, apex], triangles.len() - 1);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn triangulate(corners: &[DVec3]) -> (Vec<[u32; 3]>, Option<Fault>) {
        let mut triangles = Vec::new();
        let fault = Triangulator::new().add(corners, &mut triangles);
        (triangles, fault)
    }

    /// A tilted plane far from the origin.
    fn tilted(points: &[[f64; 2]]) -> Vec<DVec3> {
        let (u, v) = (DVec3::new(0.8, 0.6, 0.0), DVec3::new(0.0, 0.0, 1.0));
        points.iter().map(|[x, y]| DVec3::new(5e5, -3.0, 4e6) + *x * u + *y * v).collect()
    }

    /// The plane z = 0.
    fn upright(points: &[[f64; 2]]) -> Vec<DVec3> {
        points.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect()
    }

    /// The vector area of triangles, and the sum of their areas.
    fn areas(corners: &[DVec3], triangles: &[[u32; 3]]) -> (DVec3, f64) {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|corner| corners[corner as usize]);
            0.5 * (b - a).cross(c - a)
        };
        (triangles.iter().map(area).sum(), triangles.iter().map(|t| area(t).length()).sum())
    }

    /// Whether each side of the polygon is the side of one triangle, and each other side belongs to two.
    fn fits(count: u32, triangles: &[[u32; 3]]) -> bool {
        let mut sides = HashMap::new();
        for &[a, b, c] in triangles {
            [[a, b], [b, c], [c, a]].into_iter().for_each(|side| *sides.entry(side).or_insert(0) += 1);
        }
        let is_side = |[a, b]: [u32; 2]| (a + 1) % count == b;
        (0..count).all(|k| sides.get(&[k, (k + 1) % count]) == Some(&1))
            && sides.iter().all(|(&[a, b], &n)| n == 1 && (is_side([a, b]) || sides.contains_key(&[b, a])))
    }

    const C: [[f64; 2]; 8] = [
        [-1.0, -1.0],
        [1.0, -1.0],
        [1.0, -0.4],
        [-0.4, -0.4],
        [-0.4, 0.4],
        [1.0, 0.4],
        [1.0, 1.0],
        [-1.0, 1.0],
    ];

    #[test]
    fn what_the_first_corner_sees_becomes_a_fan() {
        let hexagon: Vec<[f64; 2]> =
            (0..6).map(|k| f64::from(k) * TAU / 6.0).map(|angle| [angle.cos(), angle.sin()]).collect();
        let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
        assert_eq!(triangulate(&tilted(&hexagon)), (fan.to_vec(), None));
        // A dart, from its notch or its tip.
        let dart = [[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]];
        assert_eq!(triangulate(&tilted(&dart)), (vec![[0, 1, 2], [0, 2, 3]], None));
        // A saddle is as good one way as the other.
        let saddle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [1.0, 1.0, 0.0], [0.0, 1.0, 0.3]].map(DVec3::from);
        assert_eq!(triangulate(&saddle), (vec![[0, 1, 2], [0, 2, 3]], None));
    }

    #[test]
    fn concave_polygons_keep_their_notches_from_every_corner() {
        for reversed in [false, true] {
            for turn in 0..C.len() {
                let mut points = C;
                points.rotate_left(turn);
                if reversed {
                    points.reverse();
                }
                let corners = tilted(&points);
                let (triangles, fault) = triangulate(&corners);
                let (vector, sum) = areas(&corners, &triangles);
                let sign = if reversed { -1.0 } else { 1.0 };
                let expected = sign * DVec3::new(0.6, -0.8, 0.0) * (4.0 - 1.4 * 0.8);
                assert!(
                    vector.distance(expected) < 1e-8 && (sum - expected.length()).abs() < 1e-8,
                    "{vector}"
                );
                assert!(fault.is_none() && fits(8, &triangles), "{turn}: {triangles:?}");
            }
        }
    }

    #[test]
    fn polygons_of_all_sizes_keep_their_notches() {
        for scale in [1e-6, 1e-3, 1e3, 1e6] {
            let corners = upright(&C.map(|point| point.map(|at| scale * at)));
            let (triangles, fault) = triangulate(&corners);
            let sum = areas(&corners, &triangles).1 / (scale * scale);
            assert!((sum - 2.88).abs() < 1e-8 && fault.is_none() && fits(8, &triangles), "{scale}: {sum}");
        }
    }

    #[test]
    fn sides_are_kept_whole_for_their_neighbours() {
        // Each side of the C in four parts.
        let points: Vec<[f64; 2]> = (0..C.len())
            .flat_map(|k| {
                let ([x, y], [u, v]) = (C[k], C[(k + 1) % C.len()]);
                (0..4).map(|step| f64::from(step) / 4.0).map(move |t| [x + t * (u - x), y + t * (v - y)])
            })
            .collect();
        // Rounding decides which corners of the tilted one are on one line, but all of the upright one are.
        for of in [tilted as fn(&[[f64; 2]]) -> Vec<DVec3>, upright] {
            for turn in 0..points.len() {
                let mut points = points.clone();
                points.rotate_left(turn);
                let corners = of(&points);
                let (triangles, fault) = triangulate(&corners);
                assert!(fault.is_none() && fits(32, &triangles), "{turn}: {triangles:?}");
                assert!((areas(&corners, &triangles).1 - 2.88).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn a_side_that_comes_back_on_itself_is_kept_whole() {
        // Cutting ears leaves out corners of a spike, as they are on one line with their neighbours.
        let spike = [[1.0, 0.0], [2.0, 1.0], [2.0, 0.0], [2.0, 3.0]];
        let twice = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [4.0, -1.0], [4.0, 4.0], [1.0, 1.0]];
        // Both sides of an ear have corners that are put back.
        let ear = [[1.0, 1.0], [0.0, 0.0], [0.0, 3.0], [0.0, 1.0], [2.0, 1.0]];
        for points in [&spike[..], &twice, &ear] {
            for (turn, reversed) in (0..points.len()).flat_map(|turn| [(turn, false), (turn, true)]) {
                let mut corners = upright(points);
                corners.rotate_left(turn);
                if reversed {
                    corners.reverse();
                }
                let (triangles, fault) = triangulate(&corners);
                let whole = fits(corners.len() as u32, &triangles);
                assert!(fault.is_none() && whole, "{turn}, {reversed}: {triangles:?}");
            }
        }
    }

    #[test]
    fn a_hole_is_a_polygon_that_goes_in_and_back() {
        let ring = [
            [0.0, 0.0],
            [3.0, 0.0],
            [3.0, 3.0],
            [0.0, 3.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [2.0, 2.0],
            [2.0, 1.0],
            [1.0, 1.0],
        ];
        let corners = tilted(&ring);
        let (triangles, fault) = triangulate(&corners);
        assert_eq!(fault, None);
        assert!((areas(&corners, &triangles).1 - 8.0).abs() < 1e-8, "{triangles:?}");
    }

    #[test]
    fn what_has_no_inside_or_no_plane_is_reported() {
        let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        let uneven = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 3.0]];
        let star: Vec<[f64; 2]> =
            (0..5).map(|k| f64::from(2 * k) * TAU / 5.0).map(|angle| [angle.cos(), angle.sin()]).collect();
        let thin = uneven.map(|[x, y]| [x, 1e-4 * y]);
        for points in [&bow[..], &uneven, &star, &thin] {
            let (triangles, fault) = triangulate(&tilted(points));
            assert!(
                fault == Some(Fault::Crossed) && !triangles.is_empty(),
                "{points:?}: {fault:?} {triangles:?}"
            );
        }
        let mut bent = tilted(&C);
        bent[3] += DVec3::new(0.3, -0.4, 0.0);
        let (triangles, fault) = triangulate(&bent);
        assert_eq!((fault, triangles.len()), (Some(Fault::Bent), 6));
        // Two parts that cancel, and what is left is too small to say where the front is.
        let cancelled = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [2.0, 1e-170]];
        let fan = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4]];
        assert_eq!(triangulate(&upright(&cancelled)), (fan, Some(Fault::Crossed)));
        // What cutting ears makes nothing of.
        let crossed = [[3.0, 4.0], [2.0, 4.0], [2.0, 2.0], [4.0, 3.0], [0.0, 1.0]];
        let fan = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4]];
        assert_eq!(triangulate(&upright(&crossed)), (fan, Some(Fault::Crossed)));
        // A line has no area to lose.
        let line: Vec<DVec3> = (0..5).map(|k| f64::from(k) * DVec3::ONE).collect();
        assert_eq!(triangulate(&line).1, None);
    }

    #[test]
    fn polygons_are_cut_alike_whatever_was_cut_before() {
        // A comb of three teeth, and the C.
        let comb =
            [[0.0, 0.0], [5.0, 0.0], [5.0, 3.0], [4.0, 3.0], [4.0, 1.0], [3.0, 1.0], [3.0, 3.0], [2.0, 3.0]];
        let comb = [&comb[..], &[[2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]]].concat();
        let polygons = [tilted(&comb), tilted(&C), tilted(&comb)];
        let mut triangulator = Triangulator::new();
        let mut all = Vec::new();
        for corners in &polygons {
            let before = all.len();
            assert_eq!(triangulator.add(corners, &mut all), None);
            assert_eq!((all[before..].to_vec(), None), triangulate(corners));
            assert!(fits(corners.len() as u32, &all[before..]));
        }
    }

    #[test]
    fn a_polygon_counts_as_flat_up_to_a_fiftieth_of_its_diameter() {
        // A C of diameter 50, to its sixth corner or along its first side, and smaller ones. Two corners are as far
        // above its plane as below, so that the plane is z = 0.
        let [far, near] = [
            [[40.0, 0.0], [40.0, 10.0], [10.0, 10.0], [10.0, 20.0], [40.0, 20.0], [40.0, 30.0], [0.0, 30.0]],
            [[50.0, 0.0], [45.0, 10.0], [15.0, 10.0], [10.0, 20.0], [40.0, 20.0], [40.0, 29.0], [0.0, 29.0]],
        ];
        for (points, scale) in [(far, 1.0), (near, 1.0), (far, 1.0 / 1024.0), (near, 64.0)] {
            let fault = |height: f64| {
                let mut corners = upright(&[&[[0.0; 2]][..], &points].concat());
                (corners[2].z, corners[3].z) = (height, -height);
                triangulate(&corners.into_iter().map(|at| scale * at).collect::<Vec<_>>()).1
            };
            assert_eq!([0.999, 1.0, 1.001].map(fault), [None, None, Some(Fault::Bent)], "{points:?} {scale}");
        }
    }

    #[test]
    fn no_polygon_panics_or_takes_long() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / (1_u64 << 24) as f64
        };
        let start = std::time::Instant::now();
        for count in (3..40).chain([3000]) {
            for scale in [1e-30, 1.0, 1e30, 1e200] {
                // On a grid, so that corners coincide and are on one line.
                let mut number = || (4.0 * random()).floor() * scale;
                let corners: Vec<DVec3> = (0..count).map(|_| DVec3::from([0; 3].map(|_| number()))).collect();
                let (triangles, _) = triangulate(&corners);
                assert!(triangles.iter().flatten().all(|&corner| corner < count));
            }
        }
        assert!(start.elapsed().as_secs_f64() < 20.0);
    }

    #[test]
    fn polygons_that_would_take_minutes_become_fans() {
        let count = 250_001;
        let star: Vec<DVec3> = (0..count)
            .map(|k| (f64::from(k) / f64::from(count) * TAU, f64::from(1 + k % 2)))
            .map(|(angle, radius)| radius * DVec3::new(angle.cos(), angle.sin(), 0.0))
            .collect();
        let mut triangulator = Triangulator::new();
        let mut triangles = Vec::new();
        let start = std::time::Instant::now();
        assert_eq!(triangulator.add(&star, &mut triangles), Some(Fault::Large));
        assert!(start.elapsed().as_secs_f64() < 2.0 && triangles.len() == star.len() - 2);
        assert_eq!(triangles[1000], [0, 1001, 1002]);
        // Others are cut nevertheless, until all together are too many.
        assert_eq!(triangulator.add(&tilted(&C), &mut triangles), None);
        assert_eq!(triangulator.work, 64);
        triangulator.work = MOST_WORK - 64;
        assert_eq!(triangulator.add(&tilted(&C), &mut triangles), None);
        assert_eq!(triangulator.add(&tilted(&C), &mut triangles), Some(Fault::Large));
    }
}
