//! An encoded point set.

use glam::{DVec3, Vec3};

use crate::{
    attributes::Attributes,
    cell::{Cell, Cells},
    frame::Frame,
    pool::{Pool, TOGETHER},
};

/// The points of a part of space, at one level of detail.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    pub(crate) frame: Frame,
    pub(crate) points: u32,
    pub(crate) first_child: Option<usize>,
    pub(crate) pools: Vec<Pool>,
    pub(crate) singles: Vec<Cell>,
    /// In the order of [`Node::cells`].
    pub(crate) attributes: Attributes,
}

impl Node {
    /// Where the node's grid lies in space.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// The number of points that were encoded. Those in one cell are one point of the node.
    pub fn points(&self) -> usize {
        self.points as usize
    }

    /// The number of cells that contain points.
    pub fn cell_count(&self) -> usize {
        self.covered() + self.singles.len()
    }

    /// The number of points that share a cell with an earlier one.
    pub fn merged(&self) -> usize {
        self.points() - self.cell_count()
    }

    /// The number of cells that the pools contain.
    pub fn covered(&self) -> usize {
        self.pools.iter().map(Pool::points).sum()
    }

    /// The vertex transformation pools.
    pub fn pools(&self) -> &[Pool] {
        &self.pools
    }

    /// The cells that no pool contains.
    pub fn singles(&self) -> &[Cell] {
        &self.singles
    }

    /// The indices of the node's children, which hold its points in more detail.
    pub fn children(&self) -> Option<[usize; 2]> {
        self.first_child.map(|first| [first, first + 1])
    }

    /// The cells that contain points, each once: pool by pool, then the rest.
    pub fn cells(&self) -> Vec<Cell> {
        let mut cells = Vec::with_capacity(self.cell_count() + TOGETHER);
        for pool in &self.pools {
            pool.expand(&mut cells);
        }
        cells.extend_from_slice(&self.singles);
        cells
    }

    /// The colours of [`Node::cells`], if the points have some: of each cell the mean of its points, in linear light.
    /// [`unpack_color`](crate::unpack_color) reads one.
    pub fn colors(&self) -> Option<&[u32]> {
        self.attributes.colors.as_deref()
    }

    /// The normals of [`Node::cells`], if the points have some: of each cell the direction of the sum over its points,
    /// in the space of the points. [`unpack_normal`](crate::unpack_normal) reads one.
    pub fn normals(&self) -> Option<&[u32]> {
        self.attributes.normals.as_deref()
    }

    /// The centres of [`Node::cells`] from [`Model::origin`], in the units of the points that were encoded.
    pub fn positions(&self) -> Vec<Vec3> {
        self.cells().into_iter().map(|cell| self.frame.center(cell)).collect()
    }

    /// The first cell that the node contains twice, if any.
    pub(crate) fn repeated(&self) -> Option<Cell> {
        let mut seen = Cells::empty();
        self.cells().into_iter().find(|&cell| !seen.insert(Cells::place(cell)))
    }
}

/// A point set as a binary tree of [`Node`]s. The nodes of any cut through the tree hold all points.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    pub(crate) origin: DVec3,
    pub(crate) nodes: Vec<Node>,
}

impl Model {
    /// What to add to the positions of points.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The nodes by levels. The first is the root; siblings follow each other.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The number of levels: of nodes on the longest way from the root to a leaf.
    pub fn levels(&self) -> u32 {
        self.depths().into_iter().max().unwrap_or(0)
    }

    /// The nodes of a level, and the leaves above it: a cut, which holds all points. The root is level 1.
    pub fn level(&self, level: u32) -> impl Iterator<Item = &Node> {
        let depths = self.depths();
        self.nodes.iter().zip(depths).filter_map(move |(node, depth)| {
            (depth == level || depth < level && node.first_child.is_none()).then_some(node)
        })
    }

    /// The level of each node.
    fn depths(&self) -> Vec<u32> {
        let mut depths = vec![1; self.nodes.len()];
        for (index, node) in self.nodes.iter().enumerate() {
            for child in node.children().into_iter().flatten() {
                depths[child] = depths[index] + 1;
            }
        }
        depths
    }

    /// The nodes without children: the points in most detail.
    pub fn leaves(&self) -> impl Iterator<Item = &Node> {
        self.nodes.iter().filter(|node| node.first_child.is_none())
    }
}
