//! The binary hierarchy of a point set, by 2-means.

use std::{collections::VecDeque, ops::Range};

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    encode::Watch,
    frame::{BLOCK, Spread},
    points::Point,
};

/// After this many rounds the clusters are as they are (section 6 of the paper).
const MOST_ROUNDS: usize = 30;

/// A round that changes the distortion by less than this part of it is the last. The paper's bound, which is absolute
/// there; a part of the distortion does not depend on the unit of length.
const STEADY: f64 = 1e-7;

/// A node: its points, and where its two children are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Branch {
    pub(crate) points: Range<usize>,
    /// The second child follows the first.
    pub(crate) first_child: Option<usize>,
}

/// Nodes by levels, the root first. The points are put in the order of the leaves. Ends early if the watch is stopped.
pub(crate) fn hierarchy(points: &mut [Point], levels: u32, watch: &Watch) -> Vec<Branch> {
    let mut branches = Vec::new();
    let mut next = VecDeque::from([grow(points, 0, levels, watch)]);
    let mut count = 1;
    while let Some(tree) = next.pop_front() {
        let first_child = tree.children.is_some().then_some(count);
        if let Some(children) = tree.children {
            count += 2;
            next.extend(*children);
        }
        branches.push(Branch { points: tree.points, first_child });
    }
    branches
}

struct Tree {
    points: Range<usize>,
    children: Option<Box<[Tree; 2]>>,
}

fn grow(points: &mut [Point], start: usize, levels: u32, watch: &Watch) -> Tree {
    let range = start..start + points.len();
    let middle = if levels > 1 { split(points, watch) } else { None };
    // A leaf has no levels below.
    let levels_done = if middle.is_some() { 1 } else { levels as usize };
    watch.done(levels_done * points.len());
    let children = middle.map(|middle| {
        let (left, right) = points.split_at_mut(middle);
        let (left, right) = rayon::join(
            || grow(left, start, levels - 1, watch),
            || grow(right, start + middle, levels - 1, watch),
        );
        Box::new([left, right])
    });
    Tree { points: range, children }
}

/// Sorts the points into two clusters and returns the size of the first; `None` if they are one, or the watch is stopped.
fn split(points: &mut [Point], watch: &Watch) -> Option<usize> {
    let Spread { mean, axes, deviation } = Spread::new(points);
    let mut means = [-0.5, 0.5].map(|part| mean + axes.x_axis * (part * deviation));
    let mut distortion = f64::INFINITY;
    for _ in 0..MOST_ROUNDS {
        if watch.is_stopped() {
            return None;
        }
        let blocks: Vec<Cluster> = points.par_chunks(BLOCK).map(|block| Cluster::of(block, means)).collect();
        let all = blocks.iter().fold(Cluster::default(), Cluster::and);
        if all.counts.contains(&0.0) {
            return None;
        }
        let before = distortion;
        distortion = all.distortion;
        let next = [0, 1].map(|i| all.sums[i] / all.counts[i]);
        if (before - distortion).abs() <= STEADY * distortion {
            break;
        }
        means = next;
    }
    let (left, right): (Vec<Point>, Vec<Point>) =
        points.iter().partition(|point| nearest(point.at.as_dvec3(), means).0 == 0);
    points[..left.len()].copy_from_slice(&left);
    points[left.len()..].copy_from_slice(&right);
    (!left.is_empty() && !right.is_empty()).then_some(left.len())
}

/// The nearer mean, the first of equals, and the distance to it.
fn nearest(point: DVec3, means: [DVec3; 2]) -> (usize, f64) {
    let [a, b] = means.map(|mean| point.distance_squared(mean));
    if b < a { (1, b.sqrt()) } else { (0, a.sqrt()) }
}

/// Sums over the points nearest to each of two means.
#[derive(Clone, Copy, Default)]
struct Cluster {
    sums: [DVec3; 2],
    counts: [f64; 2],
    /// The sum of the distances to the nearer mean.
    distortion: f64,
}

impl Cluster {
    fn of(points: &[Point], means: [DVec3; 2]) -> Self {
        let mut of = Self::default();
        for point in points {
            let at = point.at.as_dvec3();
            let (side, distance) = nearest(at, means);
            of.sums[side] += at;
            of.counts[side] += 1.0;
            of.distortion += distance;
        }
        of
    }

    fn and(self, other: &Self) -> Self {
        Self {
            sums: [0, 1].map(|i| self.sums[i] + other.sums[i]),
            counts: [0, 1].map(|i| self.counts[i] + other.counts[i]),
            distortion: self.distortion + other.distortion,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use glam::Vec3;

    use super::*;
    use crate::encode::Step;

    fn divided(points: &mut [Point], levels: u32) -> Vec<Branch> {
        hierarchy(points, levels, &Watch::new(Step::Divide, 1, &|_, _| ControlFlow::Continue(())))
    }

    fn on_a_line(at: &[f32]) -> Vec<Point> {
        (0..).zip(at).map(|(index, &x)| Point { at: Vec3::new(x, 0.0, 0.0), index }).collect()
    }

    #[test]
    fn two_heaps_of_unequal_size_are_two_children() {
        let mut points = on_a_line(&[10.0, 0.0, 1.0, 11.0, 2.0, 0.0]);
        let nodes = divided(&mut points, 2);
        let places: Vec<_> = points.iter().map(|point| (point.at.x, point.index)).collect();
        assert_eq!(places, [(0.0, 1), (1.0, 2), (2.0, 4), (0.0, 5), (10.0, 0), (11.0, 3)]);
        let leaf = |points| Branch { points, first_child: None };
        assert_eq!(nodes, [Branch { points: 0..6, first_child: Some(1) }, leaf(0..4), leaf(4..6)]);
    }

    #[test]
    fn later_rounds_move_the_border() {
        // The mean is 3.23, so that 3.6 is first with the far points. Their mean is 6.53 then, that of the others 0.75:
        // the border moves to 3.64, and 3.6 changes sides.
        let mut points = on_a_line(&[0.0, 1.0, 1.0, 1.0, 3.6, 6.0, 10.0]);
        let nodes = divided(&mut points, 2);
        assert_eq!(nodes[1].points, 0..5);
    }

    #[test]
    fn levels_are_in_order_and_equal_points_are_not_split() {
        let mut points = on_a_line(&[0.0, 0.0, 0.0, 7.0, 9.0]);
        let nodes = divided(&mut points, 8);
        let children: Vec<_> = nodes.iter().map(|node| node.first_child).collect();
        assert_eq!(children, [Some(1), None, Some(3), None, None]);
        assert_eq!(divided(&mut points, 1).len(), 1);
    }
}
