//! Which nodes to show.

use std::{array, cmp::Ordering, collections::BinaryHeap};

use epigraph_core::View;
use epigraph_scenes::streams::{Cell, Node, Place, PointSet};
use glam::Vec3;

use crate::shared::{streams::block_words, view::dot};

/// What decides about a node, wherever it is.
#[derive(Clone)]
pub struct Branch {
    pub children: Option<[usize; 2]>,
    /// Splits from the root to it.
    pub level: u32,
    /// The corners of the box around its cells, from its model's origin, metres.
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
    /// All nodes of a point set, in its order.
    pub fn all(points: &PointSet) -> Vec<Self> {
        let mut branches: Vec<Self> = Vec::new();
        for model in points.models() {
            let root = branches.len();
            branches.extend(model.nodes().iter().map(|node| Self::new(node, root)));
            for index in root..branches.len() {
                for child in branches[index].children.into_iter().flatten() {
                    branches[child].level = branches[index].level + 1;
                }
            }
        }
        branches
    }

    /// A node of the model whose first node is `root` in the set.
    fn new(node: &Node, root: usize) -> Self {
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
            children: node.children().map(|children| children.map(|child| root + child)),
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
    fn projected(&self, place: &Place, view: &View, size: [u32; 2]) -> Option<f32> {
        let eye = Vec3::from(view.eye);
        let seen = self.corners.map(|corner| {
            let p = (place.apply(corner) - eye).to_array();
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

/// A node at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placed {
    /// The place by its index.
    pub place: usize,
    /// The node by its index in the set.
    pub node: usize,
}

/// A node that may be split.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Entry {
    /// The bits of the size of its cells in the image, which are ordered as the sizes are.
    size: u32,
    at: Placed,
    /// New words that are counted for it.
    new: u32,
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        let key = |entry: &Self| (entry.size, std::cmp::Reverse((entry.at.place, entry.at.node)));
        key(self).cmp(&key(other))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// What the nodes that may be split and those of the cut take together.
#[derive(Clone, Copy, Default)]
struct Total {
    slots: u64,
    words: u64,
    new: u64,
}

/// Chooses the nodes to show, frame after frame.
pub struct Chooser {
    branches: Vec<Branch>,
    places: Vec<Place>,
    /// Of each place: its root, and where the flags of its nodes begin.
    roots: Vec<[usize; 2]>,
    /// Nodes that are split now.
    split: Vec<bool>,
    /// Nodes that were split in the frame before.
    before: Vec<bool>,
    waiting: BinaryHeap<Entry>,
    /// How often the block of each node is needed.
    uses: Vec<u32>,
    /// The nodes to show, by place and index.
    pub cut: Vec<Placed>,
    /// The nodes whose blocks that takes, by index, each once.
    pub blocks: Vec<usize>,
}

impl Chooser {
    /// For a point set.
    pub fn new(points: &PointSet) -> Self {
        let models = points.models().iter().enumerate();
        let (firsts, sizes): (Vec<usize>, Vec<usize>) =
            models.map(|(model, of)| (points.first_node(model), of.nodes().len())).unzip();
        Self::with(Branch::all(points), points.places(), &firsts, &sizes)
    }

    /// For nodes of models with these first nodes and numbers of nodes.
    fn with(branches: Vec<Branch>, places: &[Place], firsts: &[usize], sizes: &[usize]) -> Self {
        let mut flags = 0;
        let roots = places.iter().map(|place| {
            let begin = flags;
            flags += sizes[place.model];
            [firsts[place.model], begin]
        });
        let roots = roots.collect();
        Self {
            places: places.to_vec(),
            roots,
            split: vec![false; flags],
            before: vec![false; flags],
            waiting: BinaryHeap::new(),
            uses: vec![0; branches.len()],
            branches,
            cut: Vec::new(),
            blocks: Vec::new(),
        }
    }

    /// A node, wherever it is.
    pub fn branch(&self, node: usize) -> &Branch {
        &self.branches[node]
    }

    /// Slots that the cut takes.
    pub fn slots(&self) -> u64 {
        self.cut.iter().map(|at| self.branches[at.node].slots()).sum()
    }

    /// Where the flags of a node at a place are.
    fn flag(&self, at: Placed) -> usize {
        let [root, begin] = self.roots[at.place];
        begin + at.node - root
    }

    /// Chooses the next [`Chooser::cut`]. From the roots on, the node with the largest cells in the image is split first,
    /// as long as its cells are too large and the limits allow. Nodes outside the view are left out.
    ///
    /// `is_new` tells whether a node's block is yet to be uploaded. One new block, or those of one split, may exceed the
    /// limit of new words, so that large nodes are shown in the end, too. A node is not merged if its block would exceed
    /// the limit while those of its parts are there. A block is counted once, at however many places it is.
    pub fn choose(&mut self, view: &View, size: [u32; 2], limits: &Limits, is_new: impl Fn(usize) -> bool) {
        std::mem::swap(&mut self.split, &mut self.before);
        self.split.fill(false);
        self.uses.fill(0);
        self.cut.clear();
        let mut total = Total::default();
        for place in 0..self.places.len() {
            let at = Placed { place, node: self.roots[place][0] };
            if let Some(entry) = self.entry(at, view, size, &is_new) {
                self.count(&mut total, entry);
                self.waiting.push(entry);
            }
        }
        while let Some(entry) = self.waiting.pop() {
            let Entry { at, new, .. } = entry;
            let branch = &self.branches[at.node];
            let children = branch
                .children
                .map(|children| children.map(|node| self.entry(Placed { node, ..at }, view, size, &is_new)));
            let children = children.unwrap_or_default();
            let own = if is_new(at.node) && self.uses[at.node] == 1 { branch.words } else { new };
            let before = total;
            self.discount(&mut total, entry);
            let rest = total;
            children.iter().flatten().for_each(|child| self.count(&mut total, *child));

            let is_uploadable = |new: u64| new <= limits.new_words || rest.new == 0;
            let whole = rest.new + u64::from(own);
            let before_split = self.before[self.flag(at)];
            let least = if before_split { limits.merge } else { limits.cell };
            let is_wanted = f32::from_bits(entry.size) > least && is_uploadable(total.new);
            // Its parts are there, but it is not.
            let is_needed = own > new && !is_uploadable(whole);
            let fits = total.slots <= limits.slots && total.words <= limits.words;
            if children.iter().flatten().next().is_some() && fits && (is_wanted || is_needed) {
                let flag = self.flag(at);
                self.split[flag] = true;
                self.waiting.extend(children.iter().flatten());
            } else {
                children.iter().flatten().for_each(|child| self.discount(&mut total, *child));
                self.uses[at.node] += 1;
                total = Total { new: whole, ..before };
                self.cut.push(at);
            }
        }
        self.cut.sort_unstable_by_key(|at| (at.place, at.node));
        self.blocks.clear();
        self.blocks.extend(self.cut.iter().map(|at| at.node));
        self.blocks.sort_unstable();
        self.blocks.dedup();
    }

    /// A node that may be split; `None` outside the view. New words are counted if neither its block nor those of its
    /// parts are there.
    fn entry(
        &self,
        at: Placed,
        view: &View,
        size: [u32; 2],
        is_new: &dyn Fn(usize) -> bool,
    ) -> Option<Entry> {
        let branch = &self.branches[at.node];
        let projected = branch.projected(&self.places[at.place], view, size)?;
        let counts = self.uses[at.node] == 0 && !self.is_ready(at, view, size, is_new);
        Some(Entry { size: projected.to_bits(), at, new: if counts { branch.words } else { 0 } })
    }

    /// Whether a node can be shown without new blocks: its own is there, or those of all parts that are in the image.
    fn is_ready(&self, at: Placed, view: &View, size: [u32; 2], is_new: &dyn Fn(usize) -> bool) -> bool {
        let is_unseen =
            |node: usize| self.branches[node].projected(&self.places[at.place], view, size).is_none();
        let is_part_ready = |node: &usize| {
            is_unseen(*node) || self.is_ready(Placed { node: *node, ..at }, view, size, is_new)
        };
        let children = self.branches[at.node].children;
        !is_new(at.node) || children.is_some_and(|children| children.iter().all(is_part_ready))
    }

    fn count(&mut self, total: &mut Total, entry: Entry) {
        let branch = &self.branches[entry.at.node];
        let uses = &mut self.uses[entry.at.node];
        total.slots += branch.slots();
        total.words += if *uses == 0 { u64::from(branch.words) } else { 0 };
        total.new += u64::from(entry.new);
        *uses += 1;
    }

    fn discount(&mut self, total: &mut Total, entry: Entry) {
        let branch = &self.branches[entry.at.node];
        let uses = &mut self.uses[entry.at.node];
        *uses -= 1;
        total.slots -= branch.slots();
        total.words -= if *uses == 0 { u64::from(branch.words) } else { 0 };
        total.new -= u64::from(entry.new);
    }
}

#[cfg(test)]
mod tests {
    use glam::Quat;

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

    fn place(x: f32) -> Place {
        Place { model: 0, rotation: Quat::IDENTITY, translation: Vec3::new(x, 0.0, 0.0) }
    }

    fn chooser() -> Chooser {
        Chooser::with(nodes(), &[place(0.0)], &[0], &[5])
    }

    const ALL: Limits = Limits { cell: 1.0, merge: 0.5, slots: 1000, words: 10_000, new_words: 10_000 };

    /// At the distance of the nodes, 100 pixels see `wide` metres.
    fn view(wide: f32) -> View {
        let tan = wide / 20.0;
        View { tan_x: tan, tan_y: tan, near: 0.1, far: 100.0, ..View::default() }
    }

    fn choose(chooser: &mut Chooser, view: &View, limits: Limits, known: &[usize]) -> Vec<usize> {
        chooser.choose(view, [100, 100], &limits, |node| !known.contains(&node));
        chooser.cut.iter().map(|at| at.node).collect()
    }

    #[test]
    fn nodes_are_split_until_their_cells_are_small_enough() {
        // Cells of the root are one pixel if 100 pixels see 10 metres.
        for (wide, expected) in
            [(10.1, &[0][..]), (9.9, &[1, 2]), (5.1, &[1, 2]), (4.9, &[2, 3, 4]), (4.1, &[2, 3, 4])]
        {
            assert_eq!(choose(&mut chooser(), &view(wide), ALL, &[]), expected, "{wide}");
        }
    }

    #[test]
    fn a_split_node_is_merged_late() {
        let mut chooser = chooser();
        let mut at = |wide| choose(&mut chooser, &view(wide), ALL, &[]);
        assert_eq!(
            [at(10.1), at(9.9), at(19.9), at(20.1), at(10.1)],
            [vec![0], vec![1, 2], vec![1, 2], vec![0], vec![0]]
        );
    }

    #[test]
    fn a_node_whose_block_exceeds_the_limit_stays_split() {
        let of = |wide, new_words| choose(&mut chooser(), &view(wide), Limits { new_words, ..ALL }, &[3, 4]);
        // The root may come alone. Where it is split, node 2 comes, and node 1 only if both fit.
        assert_eq!([of(10.1, 1), of(9.9, 130), of(9.9, 249)], [vec![0], vec![2, 3, 4], vec![2, 3, 4]]);
        assert_eq!(of(9.9, 250), [1, 2]);
        // What is there stays whole, whatever else comes.
        let limits = Limits { new_words: 1, ..ALL };
        assert_eq!(choose(&mut chooser(), &view(9.9), limits, &[1, 3, 4]), [1, 2]);
    }

    #[test]
    fn nodes_outside_the_view_are_left_out() {
        let mut turned = view(4.1);
        let of = |view: &View| choose(&mut chooser(), view, ALL, &[]);
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

    /// Two copies beside each other, and one that is turned away from the view.
    #[test]
    fn copies_share_their_blocks_and_have_cuts_of_their_own() {
        let turned = Place { rotation: Quat::from_rotation_y(std::f32::consts::PI), ..place(0.0) };
        let mut chooser = Chooser::with(nodes(), &[place(0.0), place(3.0), turned], &[0], &[5]);
        let mut choose = |limits: Limits, eye: [f32; 3]| {
            chooser.choose(&View { eye, ..view(9.9) }, [100, 100], &limits, |_| true);
            let cut: Vec<_> = chooser.cut.iter().map(|at| (at.place, at.node)).collect();
            (cut, chooser.blocks.clone(), chooser.slots())
        };
        let both = vec![(0, 1), (0, 2), (1, 1), (1, 2)];
        assert_eq!(choose(ALL, [1.5, 0.0, 0.0]), (both.clone(), vec![1, 2], 50));
        // 250 words of the two blocks, and 100 of the root while the other copy has it.
        assert_eq!(choose(Limits { words: 350, ..ALL }, [1.5, 0.0, 0.0]).0, both);
        assert_eq!(choose(Limits { words: 349, ..ALL }, [1.5, 0.0, 0.0]).0, [(0, 0), (1, 0)]);
        // A little nearer to the first one.
        let (cut, blocks, slots) = choose(Limits { slots: 35, ..ALL }, [1.5, 0.0, 0.0]);
        assert_eq!((cut, blocks, slots), (vec![(0, 1), (0, 2), (1, 0)], vec![0, 1, 2], 35));
    }

    #[test]
    fn limits_stop_the_splits() {
        let of = |limits: Limits, known: &[usize]| choose(&mut chooser(), &view(4.1), limits, known);
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
