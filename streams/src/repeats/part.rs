//! A part with what is the same for all its copies.

use glam::{DMat3, DVec3, Vec3};

use super::{Settings, Surface};
use crate::frame::eigen;

/// Numbers that rotations and translations leave as they are.
pub(super) const MEASURES: usize = 9;

/// The measure by which parts are sorted: the mean distance of the vertices from their centre.
pub(super) const SIZE: usize = 3;

/// How often marks take in those of their neighbours. Four steps tell the corners of a regular grid from its inside.
const ROUNDS: usize = 4;

/// A connected part of a surface. Its vertices are those with different positions.
pub(super) struct Part {
    /// Its triangles by their index in the surface.
    pub(super) sources: Vec<u32>,
    /// In the coordinates of the surface.
    pub(super) positions: Vec<Vec3>,
    /// The corners of the triangles, in the order of `sources`.
    pub(super) triangles: Vec<[u32; 3]>,
    /// For each vertex, a hash of the triangles around it, up to [`ROUNDS`] steps away.
    pub(super) marks: Vec<u64>,
    /// A hash of numbers and marks: different for parts whose triangles are connected in another way.
    pub(super) key: u64,
    /// The mean of the vertices.
    pub(super) center: DVec3,
    /// The directions of greatest variance; a rotation.
    pub(super) axes: DMat3,
    /// The standard deviation along each axis; mean, largest and smallest distance of the vertices from the centre;
    /// mean, largest and smallest length of the triangles' sides. If no vertex moves by more than d, they change by 2 d
    /// at most.
    pub(super) measures: [f64; MEASURES],
    /// The largest coordinate of a vertex.
    pub(super) extent: f64,
}

impl Part {
    pub(super) fn new(surface: &Surface, welded: &[u32], sources: Vec<u32>) -> Self {
        let corners =
            |triangle: u32| surface.triangles[triangle as usize].map(|vertex| welded[vertex as usize]);
        let mut vertices: Vec<u32> = sources.iter().flat_map(|&triangle| corners(triangle)).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let local = |vertex: u32| vertices.binary_search(&vertex).expect("it is a corner") as u32;
        let triangles: Vec<[u32; 3]> = sources.iter().map(|&triangle| corners(triangle).map(local)).collect();
        let positions: Vec<Vec3> =
            vertices.iter().map(|&vertex| surface.positions[vertex as usize]).collect();
        let marks = marks(positions.len(), &triangles);
        let key = marks.iter().fold(mix(triangles.len() as u64, positions.len() as u64), |sum, &mark| {
            sum.wrapping_add(mix(mark, 1))
        });

        let count = positions.len() as f64;
        let center = positions.iter().map(|at| at.as_dvec3()).sum::<DVec3>() / count;
        let from_center = || positions.iter().map(|at| at.as_dvec3() - center);
        let outer = |at: DVec3| DMat3::from_cols(at * at.x, at * at.y, at * at.z);
        let covariance = from_center().fold(DMat3::ZERO, |sum, at| sum + outer(at)) * (1.0 / count);
        let (axes, deviations) = principal(covariance);
        let radii = Statistics::of(from_center().map(DVec3::length));
        let sides = Statistics::of(triangles.iter().flat_map(|corners| sides(&positions, *corners)));
        let measures = [
            deviations.x,
            deviations.y,
            deviations.z,
            radii.mean,
            radii.high,
            radii.low,
            sides.mean,
            sides.high,
            sides.low,
        ];
        let extent = positions.iter().map(|at| f64::from(at.abs().max_element())).fold(0.0, f64::max);
        Self { sources, positions, triangles, marks, key, center, axes, measures, extent }
    }

    /// The largest distance of a vertex from the centre.
    pub(super) fn radius(&self) -> f64 {
        self.measures[SIZE + 1]
    }

    /// How far a vertex of this part may be from its place in a shape.
    pub(super) fn bound(&self, settings: &Settings) -> f64 {
        settings.bound(self.radius(), self.extent)
    }

    /// Whether it has as many vertices and triangles as another part.
    pub(super) fn counts_as(&self, other: &Self) -> bool {
        self.positions.len() == other.positions.len() && self.triangles.len() == other.triangles.len()
    }

    /// A hash of a triangle's marks, which does not depend on where the triangle begins.
    pub(super) fn mark_of(&self, triangle: usize) -> u64 {
        let [a, b, c] = self.marks_at(triangle);
        mix(a, b).wrapping_add(mix(b, c)).wrapping_add(mix(c, a))
    }

    pub(super) fn marks_at(&self, triangle: usize) -> [u64; 3] {
        self.triangles[triangle].map(|vertex| self.marks[vertex as usize])
    }

    /// The lengths of a triangle's sides, from its first corner on.
    pub(super) fn sides(&self, triangle: usize) -> [f64; 3] {
        sides(&self.positions, self.triangles[triangle])
    }

    pub(super) fn at(&self, vertex: u32) -> DVec3 {
        self.positions[vertex as usize].as_dvec3()
    }
}

fn sides(positions: &[Vec3], corners: [u32; 3]) -> [f64; 3] {
    let [a, b, c] = corners.map(|vertex| positions[vertex as usize].as_dvec3());
    [a.distance(b), b.distance(c), c.distance(a)]
}

/// The principal axes and the standard deviations along them, the largest first.
fn principal(covariance: DMat3) -> (DMat3, DVec3) {
    let (variances, vectors) = eigen(covariance);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| variances[b].total_cmp(&variances[a]));
    let [first, second, _] = order.map(|axis| vectors.col(axis));
    let deviations = order.map(|axis| variances[axis].max(0.0).sqrt());
    (DMat3::from_cols(first, second, first.cross(second)), deviations.into())
}

struct Statistics {
    mean: f64,
    high: f64,
    low: f64,
}

impl Statistics {
    /// Of one value or more.
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let (mut count, mut sum, mut high, mut low) = (0.0, 0.0, 0.0_f64, f64::INFINITY);
        for value in values {
            count += 1.0;
            sum += value;
            high = high.max(value);
            low = low.min(value);
        }
        Self { mean: sum / count, high, low }
    }
}

/// Hashes of the vertices' neighbourhoods. The order of vertices and triangles does not matter, the winding does.
fn marks(vertices: usize, triangles: &[[u32; 3]]) -> Vec<u64> {
    let mut marks = vec![0_u64; vertices];
    for _ in 0..ROUNDS {
        let mut next = marks.clone();
        for &[a, b, c] in triangles {
            for [at, from, to] in [[a, b, c], [b, c, a], [c, a, b]] {
                let around = mix(marks[from as usize], marks[to as usize]);
                next[at as usize] = next[at as usize].wrapping_add(around);
            }
        }
        marks = next.into_iter().map(|mark| mix(mark, 0)).collect();
    }
    marks
}

/// A hash of two numbers in this order, by the finaliser of SplitMix64.
fn mix(a: u64, b: u64) -> u64 {
    let mut hash = a.wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_mul(0xff51_afd7_ed55_8ccd) ^ b;
    hash = (hash ^ hash >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    hash = (hash ^ hash >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    hash ^ hash >> 31
}
