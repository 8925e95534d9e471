//! Which nodes to show.

use std::{array, cmp::Reverse, collections::BinaryHeap};

use epigraph_core::View;
use epigraph_scenes::streams::{Cell, Model, Node};
use glam::Vec3;

use crate::shared::{streams::block_words, view::dot};

/// What decides about a node.
pub struct Branch {
    pub children: Option<[usize; 2]>,
    /// Splits from the root to it.
    pub level: u32,
    /// The corners of the box around its cells, metres.
    pub corners: [Vec3; 8],
    /// The length of a cell's edge, metres.
    pub cell: f32,
    pub points: u32,
    /// Vertices of its pools, and points that no pool contains.
    pub vertices: u32,
    /// Words of its block.
    pub words: u32,
}

/// What a cut may take.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Cells larger than this are split, pixels.
    pub cell: f32,
    /// Cells of nodes that are split already are merged if they are smaller than this, pixels.
    pub merge: f32,
    /// Points, and vertices.
    pub slots: u64,
    /// Words of all blocks.
    pub words: u64,
    /// Words of new blocks.
    pub new_words: u64,
}

impl Branch {
    /// All nodes of a point set.
    pub fn all(model: &Model) -> Vec<Self> {
        let mut branches: Vec<Self> = model.nodes().iter().map(Self::new).collect();
        for index in 0..branches.len() {
            for child in branches[index].children.into_iter().flatten() {
                branches[child].level = branches[index].level + 1;
            }
        }
        branches
    }

    fn new(node: &Node) -> Self {
        let ends = node.cells().iter().fold([[i32::MAX; 3], [i32::MIN; 3]], |[low, high], cell: &Cell| {
            let at = cell.at();
            [[0, 1, 2].map(|i| low[i].min(at[i])), [0, 1, 2].map(|i| high[i].max(at[i] + 1))]
        });
        let frame = node.frame();
        let corner = |index: usize| {
            let at = [0, 1, 2].map(|axis| ends[index >> axis & 1][axis] as f32 * frame.cell);
            frame.origin + frame.axes[0] * at[0] + frame.axes[1] * at[1] + frame.axes[2] * at[2]
        };
        let vertices: usize = node.pools().iter().map(|pool| pool.vertices().len()).sum();
        Self {
            children: node.children(),
            level: 0,
            corners: array::from_fn(corner),
            cell: frame.cell,
            // A grid has 2 million cells, so that all of these numbers fit.
            points: node.cell_count() as u32,
            vertices: (vertices + node.singles().len()) as u32,
            words: block_words(node) as u32,
        }
    }

    /// Slots that decoding takes.
    pub fn slots(&self) -> u64 {
        u64::from(self.points.max(self.vertices))
    }

    /// The edge of a cell in pixels where the node is nearest to the eye; `None` if the view contains no part of it.
    fn projected(&self, view: &View, size: [u32; 2]) -> Option<f32> {
        let eye = Vec3::from(view.eye);
        let seen = self.corners.map(|corner| {
            let p = (corner - eye).to_array();
            [dot(p, view.right), dot(p, view.up), dot(p, view.forward)]
        });
        let all = |outside: &dyn Fn([f32; 3]) -> bool| seen.iter().all(|p| outside(*p));
        let beside = all(&|[x, _, z]| x > z * view.tan_x) || all(&|[x, _, z]| -x > z * view.tan_x);
        let above = all(&|[_, y, z]| y > z * view.tan_y) || all(&|[_, y, z]| -y > z * view.tan_y);
        if all(&|[_, _, z]| z < view.near) || beside || above {
            return None;
        }
        let nearest = seen.iter().map(|p| p[2]).fold(f32::INFINITY, f32::min).max(view.near);
        Some(self.cell * size[1] as f32 / (2.0 * view.tan_y * nearest))
    }
}

/// A node that is in the image, by the bits of its projected cells, which are ordered as the sizes are.
type Entry = (u32, Reverse<usize>);

/// Chooses the nodes to show, frame after frame.
pub struct Chooser {
    /// Nodes that are split now.
    split: Vec<bool>,
    /// Nodes that were split in the frame before.
    before: Vec<bool>,
    waiting: BinaryHeap<Entry>,
    /// The nodes to show, by index.
    pub cut: Vec<usize>,
}

impl Chooser {
    /// For a set of so many nodes.
    pub fn new(nodes: usize) -> Self {
        let (split, before) = (vec![false; nodes], vec![false; nodes]);
        Self { split, before, waiting: BinaryHeap::new(), cut: Vec::new() }
    }

    /// Chooses the next [`Chooser::cut`]. From the root on, the node with the largest cells in the image is split first,
    /// as long as its cells are too large and the limits allow. Nodes outside the view are left out.
    ///
    /// `is_new` tells whether a node's block is yet to be uploaded. One new block, or those of one split, may exceed the
    /// limit of new words, so that large nodes are shown in the end, too. A node is not merged if its block would exceed
    /// the limit while those of its parts are there.
    pub fn choose(
        &mut self,
        nodes: &[Branch],
        view: &View,
        size: [u32; 2],
        limits: &Limits,
        is_new: impl Fn(usize) -> bool,
    ) {
        let entry = |node: usize| Some((nodes[node].projected(view, size)?.to_bits(), Reverse(node)));
        let is_seen = |node: usize| entry(node).is_some();
        let is_ready = |node: usize| is_ready(nodes, node, &is_seen, &is_new);
        let words = |node: usize, count: bool| if count { u64::from(nodes[node].words) } else { 0 };
        // The slots, the words and the new words of a node, if it is not split.
        let cost = |node: usize| [nodes[node].slots(), words(node, true), words(node, !is_ready(node))];
        std::mem::swap(&mut self.split, &mut self.before);
        self.split.fill(false);
        self.cut.clear();
        self.waiting.extend(entry(0));
        let mut total = if self.waiting.is_empty() { [0; 3] } else { cost(0) };
        while let Some((bits, Reverse(node))) = self.waiting.pop() {
            let least = if self.before[node] { limits.merge } else { limits.cell };
            let children = nodes[node].children.map(|children| children.map(entry));
            let children = children.iter().flatten().flatten();
            let rest: [u64; 3] = array::from_fn(|i| total[i] - cost(node)[i]);
            let split = children
                .clone()
                .fold(rest, |sum, (_, Reverse(child))| array::from_fn(|i| sum[i] + cost(*child)[i]));
            let is_uploadable = |new: u64| new <= limits.new_words || rest[2] == 0;
            let whole = rest[2] + words(node, is_new(node));
            let is_wanted = f32::from_bits(bits) > least && is_uploadable(split[2]);
            let is_needed = is_new(node) && is_ready(node) && !is_uploadable(whole);
            let fits = split[0] <= limits.slots && split[1] <= limits.words;
            if children.clone().next().is_some() && fits && (is_wanted || is_needed) {
                self.split[node] = true;
                total = split;
                self.waiting.extend(children);
            } else {
                total[2] = whole;
                self.cut.push(node);
            }
        }
        self.cut.sort_unstable();
    }
}

/// Whether a node can be shown without new blocks: its own is there, or all parts that are in the image are.
fn is_ready(
    nodes: &[Branch],
    node: usize,
    is_seen: &dyn Fn(usize) -> bool,
    is_new: &dyn Fn(usize) -> bool,
) -> bool {
    let mut children = nodes[node].children.iter().flatten();
    let has_children = nodes[node].children.is_some();
    !is_new(node)
        || has_children && children.all(|&child| !is_seen(child) || is_ready(nodes, child, is_seen, is_new))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A root in the box from -2 to 2 in x at z = -10, its halves, and a quarter of each side.
    fn nodes() -> Vec<Branch> {
        let branch = |ends: [f32; 2], cell, children, points| Branch {
            children,
            level: 0,
            corners: array::from_fn(|i| {
                let side = |bit: usize| (i >> bit & 1) as f32;
                Vec3::new(ends[i & 1], side(1) - 0.5, -10.0 - side(2))
            }),
            cell,
            points,
            vertices: points / 2,
            words: 10 * points,
        };
        vec![
            branch([-2.0, 2.0], 0.1, Some([1, 2]), 10),
            branch([-2.0, 0.0], 0.05, Some([3, 4]), 12),
            branch([0.0, 2.0], 0.04, None, 13),
            branch([-2.0, -1.0], 0.02, None, 20),
            branch([-1.0, 0.0], 0.02, None, 30),
        ]
    }

    const ALL: Limits = Limits { cell: 1.0, merge: 0.5, slots: 1000, words: 10_000, new_words: 10_000 };

    /// At the distance of the nodes, 100 pixels see `wide` metres.
    fn view(wide: f32) -> View {
        let tan = wide / 20.0;
        View { tan_x: tan, tan_y: tan, near: 0.1, far: 100.0, ..View::default() }
    }

    fn choose(chooser: &mut Chooser, view: &View, limits: Limits, known: &[usize]) -> Vec<usize> {
        chooser.choose(&nodes(), view, [100, 100], &limits, |node| !known.contains(&node));
        chooser.cut.clone()
    }

    #[test]
    fn nodes_are_split_until_their_cells_are_small_enough() {
        // Cells of the root are one pixel if 100 pixels see 10 metres.
        for (wide, expected) in
            [(10.1, &[0][..]), (9.9, &[1, 2]), (5.1, &[1, 2]), (4.9, &[2, 3, 4]), (4.1, &[2, 3, 4])]
        {
            assert_eq!(choose(&mut Chooser::new(5), &view(wide), ALL, &[]), expected, "{wide}");
        }
    }

    #[test]
    fn a_split_node_is_merged_late() {
        let mut chooser = Chooser::new(5);
        let mut at = |wide| choose(&mut chooser, &view(wide), ALL, &[]);
        assert_eq!(
            [at(10.1), at(9.9), at(19.9), at(20.1), at(10.1)],
            [vec![0], vec![1, 2], vec![1, 2], vec![0], vec![0]]
        );
    }

    #[test]
    fn a_node_whose_block_exceeds_the_limit_stays_split() {
        let of =
            |wide, new_words| choose(&mut Chooser::new(5), &view(wide), Limits { new_words, ..ALL }, &[3, 4]);
        // The root may come alone. Where it is split, node 2 comes, and node 1 only if both fit.
        assert_eq!([of(10.1, 1), of(9.9, 130), of(9.9, 249)], [vec![0], vec![2, 3, 4], vec![2, 3, 4]]);
        assert_eq!(of(9.9, 250), [1, 2]);
        // What is there stays whole, whatever else comes.
        let limits = Limits { new_words: 1, ..ALL };
        assert_eq!(choose(&mut Chooser::new(5), &view(9.9), limits, &[1, 3, 4]), [1, 2]);
    }

    #[test]
    fn nodes_outside_the_view_are_left_out() {
        let mut turned = view(4.1);
        let of = |view: &View| choose(&mut Chooser::new(5), view, ALL, &[]);
        // Half of the nodes is left of a view that begins at x = 0.
        turned.eye = [2.5, 0.0, 0.0];
        assert_eq!(of(&turned), [2]);
        turned.eye = [-3.1, 0.0, 0.0];
        assert_eq!(of(&turned), [3, 4]);
        turned.eye = [-4.3, 0.0, 0.0];
        assert!(of(&turned).is_empty());
        let mut behind = view(4.1);
        behind.eye = [0.0, 0.0, -12.0];
        assert!(of(&behind).is_empty());
        let mut above = view(4.1);
        above.eye = [0.0, 2.8, 0.0];
        assert!(of(&above).is_empty());
    }

    #[test]
    fn limits_stop_the_splits() {
        let of = |limits: Limits, known: &[usize]| choose(&mut Chooser::new(5), &view(4.1), limits, known);
        assert_eq!(of(Limits { slots: 24, ..ALL }, &[]), [0]);
        assert_eq!(of(Limits { slots: 25, ..ALL }, &[]), [1, 2]);
        assert_eq!(of(Limits { slots: 62, ..ALL }, &[]), [1, 2]);
        assert_eq!(of(Limits { slots: 63, ..ALL }, &[]), [2, 3, 4]);
        assert_eq!(of(Limits { words: 249, ..ALL }, &[]), [0]);
        // One split without another new block may exceed the limit of new words.
        assert_eq!(of(Limits { new_words: 1, ..ALL }, &[0]), [1, 2]);
        assert_eq!(of(Limits { new_words: 1, ..ALL }, &[1, 2]), [2, 3, 4]);
        assert_eq!(of(Limits { new_words: 249, ..ALL }, &[1]), [1, 2]);
        // What is there is split as far, whatever its unused ancestors would take.
        assert_eq!(of(Limits { new_words: 1, ..ALL }, &[2, 3, 4]), [2, 3, 4]);
        assert_eq!(of(Limits { new_words: 629, ..ALL }, &[]), [1, 2]);
        assert_eq!(of(Limits { new_words: 630, ..ALL }, &[]), [2, 3, 4]);
    }
}
