//! The principal axes of points, and the grid along them.

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::{
    cell::{Cell, Cells, GRID},
    points::Point,
};

/// Points whose sums one task computes. Sums are added in the order of these blocks, on any number of cores.
pub(crate) const BLOCK: usize = 1 << 15;

/// The mean of points, the axes along which they spread, largest first, and the standard deviation along the first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    pub(crate) mean: DVec3,
    /// Orthonormal and right-handed.
    pub(crate) axes: DMat3,
    pub(crate) deviation: f64,
}

impl Spread {
    /// The principal components of one point or more.
    pub(crate) fn new(points: &[Point]) -> Self {
        let sum = |term: &(dyn Fn(DVec3) -> DMat3 + Sync)| -> DMat3 {
            let blocks: Vec<DMat3> = points
                .par_chunks(BLOCK)
                .map(|block| block.iter().fold(DMat3::ZERO, |sum, point| sum + term(point.at.as_dvec3())))
                .collect();
            blocks.into_iter().fold(DMat3::ZERO, |sum, block| sum + block)
        };
        let count = points.len() as f64;
        let mean = sum(&|point| DMat3::from_cols(point, DVec3::ZERO, DVec3::ZERO)).x_axis / count;
        let covariance = sum(&|point| {
            let from = point - mean;
            DMat3::from_cols(from * from.x, from * from.y, from * from.z)
        });
        let (variances, vectors) = eigen(covariance * (1.0 / count));
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| variances[b].total_cmp(&variances[a]));
        let [first, second, _] = order.map(|axis| upright(vectors.col(axis)));
        let axes = DMat3::from_cols(first, second, first.cross(second));
        Self { mean, axes, deviation: variances[order[0]].max(0.0).sqrt() }
    }
}

/// An eigenvector of the two opposite ones: its largest component is positive.
fn upright(vector: DVec3) -> DVec3 {
    if vector[vector.abs().max_position()] < 0.0 { -vector } else { vector }
}

/// The eigenvalues and eigenvectors of a symmetric matrix, by Jacobi's rotations. Only exactly rounded operations, so
/// that all machines find the same.
pub(crate) fn eigen(matrix: DMat3) -> (DVec3, DMat3) {
    let mut a = matrix.to_cols_array_2d();
    let mut vectors = DMat3::IDENTITY.to_cols_array_2d();
    // Each sweep squares the ratio of the rest to the diagonal; ten are more than enough for 53 bits.
    for _ in 0..10 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let sine = tangent * cosine;
            let turn = |x: f64, y: f64| (cosine * x - sine * y, sine * x + cosine * y);
            for row in &mut a {
                (row[p], row[q]) = turn(row[p], row[q]);
            }
            for k in 0..3 {
                (a[p][k], a[q][k]) = turn(a[p][k], a[q][k]);
                (vectors[p][k], vectors[q][k]) = turn(vectors[p][k], vectors[q][k]);
            }
        }
    }
    (DVec3::new(a[0][0], a[1][1], a[2][2]), DMat3::from_cols_array_2d(&vectors))
}

/// Where a node's grid lies in space. The cells are cubes. Coordinates are from the model's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The corner of cell (0, 0, 0), in the units of the points.
    pub origin: Vec3,
    /// The directions of the grid's x, y and z: orthonormal up to rounding.
    pub axes: [Vec3; 3],
    /// The length of a cell's edge, in the units of the points; 0 if all points are one.
    pub cell: f32,
}

impl Frame {
    /// The grid along the principal axes whose longest side just contains the points, and the cells with a point.
    pub(crate) fn quantize(points: &[Point]) -> (Self, Cells) {
        let spread = Spread::new(points);
        let axes = [0, 1, 2].map(|axis| spread.axes.col(axis).as_vec3());
        let rotation = inverse(axes);
        let along = |point: &Point| rotation * (point.at.as_dvec3() - spread.mean);
        let bounds = points
            .par_chunks(BLOCK)
            .map(|block| {
                block
                    .iter()
                    .fold(NOTHING, |[low, high], point| [low.min(along(point)), high.max(along(point))])
            })
            .reduce(|| NOTHING, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let [low, high] = bounds;
        let cell = ((high - low).max_element() / f64::from(GRID)) as f32;
        let origin = (spread.mean + matrix(axes) * low).as_vec3();
        let frame = Self { origin, axes, cell };
        let cell_of = frame.cell_of();
        let mut set = Cells::empty();
        for point in points {
            set.insert(Cells::place(cell_of(point.at)));
        }
        (frame, set)
    }

    /// The function that finds the cell of a point; the nearest one for a point that rounding put outside.
    pub(crate) fn cell_of(&self) -> impl Fn(Vec3) -> Cell {
        let (rotation, origin, cell) = (inverse(self.axes), self.origin.as_dvec3(), f64::from(self.cell));
        move |point| {
            let along = (rotation * (point.as_dvec3() - origin)).to_array();
            // 0 / 0 is no number, which becomes 0.
            let at = along.map(|along| ((along / cell).floor() as i32).clamp(0, GRID as i32 - 1));
            Cell::new(at).expect("clamped to the grid")
        }
    }

    /// The centre of a cell: at most half a cell from each of its points along each axis.
    pub fn center(&self, cell: Cell) -> Vec3 {
        let at = cell.at().map(|part| (part as f32 + 0.5) * self.cell);
        self.origin + self.axes[0] * at[0] + self.axes[1] * at[1] + self.axes[2] * at[2]
    }

    /// A point's coordinates along the axes from the origin, in cells.
    pub fn coordinates(&self, point: Vec3) -> [f64; 3] {
        let along = inverse(self.axes) * (point.as_dvec3() - self.origin.as_dvec3());
        (along / f64::from(self.cell)).to_array()
    }
}

const NOTHING: [DVec3; 2] = [DVec3::INFINITY, DVec3::NEG_INFINITY];

fn matrix(axes: [Vec3; 3]) -> DMat3 {
    let [x, y, z] = axes.map(Vec3::as_dvec3);
    DMat3::from_cols(x, y, z)
}

/// The exact inverse: the axes in single precision are not quite orthonormal.
fn inverse(axes: [Vec3; 3]) -> DMat3 {
    matrix(axes).inverse()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_axes_of_hand_worked_points() {
        // Variance 4 along (1, 1, 0) / sqrt 2 times 2, 1 / 2 along z, none along the third.
        let diagonal = Vec3::new(2.0, 2.0, 0.0);
        let center = Vec3::new(5.0, 6.0, 7.0);
        let points = [diagonal, -diagonal, Vec3::Z, -Vec3::Z].map(|offset| center + offset);
        let spread = Spread::new(&Point::all(&points));
        assert_eq!(spread.mean, center.as_dvec3());
        let [first, second] = [spread.axes.x_axis, spread.axes.y_axis];
        assert!(first.abs_diff_eq(DVec3::new(0.5f64.sqrt(), 0.5f64.sqrt(), 0.0), 1e-15), "{first}");
        assert!(second.abs_diff_eq(DVec3::Z, 1e-15), "{second}");
        // The sum of squares along the first axis is 2 x 8, over 4 points.
        assert!((spread.deviation - 2.0).abs() < 1e-15);
        assert!((spread.axes.determinant() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn the_longest_side_of_the_grid_contains_the_points() {
        let points = [0.0, 10.0, 63.5, 128.0].map(|x| Vec3::new(x, 0.0, 0.0));
        let (frame, cells) = Frame::quantize(&Point::all(&points));
        let cells = cells.in_order();
        assert_eq!((frame.cell, frame.axes[0], frame.origin), (1.0, Vec3::X, Vec3::ZERO));
        assert_eq!(cells.iter().map(|cell| cell.at()[0]).collect::<Vec<_>>(), [0, 10, 63, 127]);
        assert_eq!(frame.center(cells[2]), Vec3::new(63.5, 0.5, 0.5));
        assert_eq!(frame.coordinates(points[1]), [10.0, 0.0, 0.0]);
    }

    #[test]
    fn equal_points_are_one_cell() {
        let point = Vec3::new(1e6, -3.0, 0.25);
        let (frame, cells) = Frame::quantize(&Point::all(&[point; 5]));
        let cells = cells.in_order();
        assert_eq!((frame.cell, cells.len()), (0.0, 1));
        assert_eq!(frame.center(cells[0]), point);
    }
}
