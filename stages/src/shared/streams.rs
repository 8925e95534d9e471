//! A cut through a point set of vertex transformation streams, as `stream_cut` gives it to `stream_decode`. Mirrored by
//! `shaders/shared/streams.wgsl`.
//!
//! A node's block in the list of words has the translations, vertices and tags of each pool, then the points that no
//! pool contains, then the node's colours and normals. Pools of bricks have no translations there. Vertices and points are packed cells, `x | y << 7 | z << 14`;
//! translations are packed so that a sum of words is the sum of cells.

use epigraph_scenes::streams::{Cell, Frame, Node};
use glam::Vec3;

epigraph_core::constants! {
    /// Where the cut's number of points is in `numbers`, after the three numbers of workgroups: one for each vertex.
    pub const POINTS: u32 = 3;
    /// Where its number of vertices is. A point that no pool contains counts as a vertex, too.
    pub const VERTICES: u32 = 4;
    /// Where the number of pools is. The points of a node that no pool contains are a pool without translations.
    pub const POOLS: u32 = 5;
    /// Where the number of nodes is.
    pub const NODES: u32 = 6;
    /// Where the number of bytes of new blocks in this frame is.
    pub const NEW_BYTES: u32 = 7;
    /// Length of `numbers`.
    pub const NUMBERS: u32 = 8;
    /// Most workgroups along x for the vertices; the others are along y.
    pub const MOST_GROUPS: u32 = 32768;
    /// Points for each of which `starts` names the pool of the first.
    pub const START_STEP: u32 = 256;
    /// The place of the translations of a pool of bricks: the cells of a block of 4 x 4 x 4, x fastest.
    pub const BRICKS: u32 = u32::MAX;
    /// The place of the colours or normals of a node without any.
    pub const NO_ATTRIBUTE: u32 = u32::MAX;
}

epigraph_core::item! {
    /// A node of the cut.
    pub struct StreamNode {
        /// The corner of the grid's cell (0, 0, 0), metres.
        origin: [f32; 3],
        /// The length of a cell's edge, metres.
        cell: f32,
        /// Direction of the grid's x.
        x: [f32; 3],
        /// Where the colours are in the list of words, one for each point.
        colors: u32,
        /// Direction of the grid's y.
        y: [f32; 3],
        /// Where the normals are in the list of words, one for each point.
        normals: u32,
        /// Direction of the grid's z.
        z: [f32; 3],
        /// The node's first slot in the cloud.
        first_point: u32,
        /// A unit quaternion, x, y, z and w: the rotation of its model.
        rotation: [f32; 4],
        /// Its index in the point set.
        index: u32,
        /// Splits from the root to it.
        level: u32,
        /// Its place by its index in the point set.
        place: u32,
        /// Aligns the next node.
        pad: u32,
    }
}

epigraph_core::item! {
    /// A pool of the cut.
    pub struct StreamPool {
        /// Its node by its index in the cut.
        node: u32,
        /// Words of tags for each vertex; 0 for the points that no pool contains.
        tag_words: u32,
        /// Where the translations are in the list of words, or [`BRICKS`].
        translations: u32,
        /// Where the vertices are.
        vertices: u32,
        /// Where the tags are.
        tags: u32,
        /// The number of its first vertex among those of the cut.
        first_vertex: u32,
        /// Its first slot in the cloud.
        first_point: u32,
        /// Its number among the node's pools.
        number: u32,
    }
}

/// Words of a node's block.
pub fn block_words(node: &Node) -> usize {
    let pools = node.pools().iter();
    let pools: usize =
        pools.map(|p| p.stored_translations().len() + p.vertices().len() + p.tags().len()).sum();
    let attributes = [node.colors(), node.normals()].into_iter().flatten().map(<[u32]>::len);
    pools + node.singles().len() + attributes.sum::<usize>()
}

/// Pools of a node in a cut.
pub fn pool_count(node: &Node) -> usize {
    node.pools().len() + usize::from(!node.singles().is_empty())
}

/// Writes a node's block.
pub fn write_block(node: &Node, words: &mut [u32]) {
    let pools = node.pools().iter().flat_map(|pool| {
        let translations = pool.stored_translations().iter().map(|by| by.step());
        let vertices = pool.vertices().iter().map(|cell| cell.bits());
        translations.chain(vertices).chain(pool.tags().iter().copied())
    });
    let singles = node.singles().iter().map(|cell| cell.bits());
    let attributes = [node.colors(), node.normals()].into_iter().flatten().flatten().copied();
    words.iter_mut().zip(pools.chain(singles).chain(attributes)).for_each(|(word, value)| *word = value);
}

/// The lists of a cut, and the words that they lead to.
#[derive(Clone, Copy)]
pub struct Cut<'a> {
    /// The blocks of the nodes at hand.
    pub words: &'a [u32],
    /// The nodes of the cut.
    pub nodes: &'a [StreamNode],
    /// Their pools.
    pub pools: &'a [StreamPool],
    /// The number of points before each vertex.
    pub sums: &'a [u32],
    /// The number of points.
    pub points: u32,
    /// The number of vertices.
    pub vertices: u32,
}

/// A point of a cut, and what made it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decoded {
    /// The pool by its index in the cut.
    pub pool: usize,
    /// The pool's vertex by its index.
    pub vertex: u32,
    /// The pool's translation by its index; `None` for a point that no pool contains.
    pub translation: Option<u32>,
    /// The cell.
    pub cell: Cell,
}

impl StreamNode {
    /// Where its grid lies.
    pub fn frame(&self) -> Frame {
        Frame { origin: self.origin.into(), axes: [self.x, self.y, self.z].map(Vec3::from), cell: self.cell }
    }
}

impl Cut<'_> {
    /// The number of points of a vertex.
    pub fn points_of(&self, pool: &StreamPool, vertex: u32) -> u32 {
        if pool.tag_words == 0 {
            return 1;
        }
        let first = (pool.tags + vertex * pool.tag_words) as usize;
        self.words[first..][..pool.tag_words as usize].iter().map(|tags| tags.count_ones()).sum()
    }

    /// The number of vertices of a pool.
    pub fn vertices_of(&self, pool: usize) -> u32 {
        let end = self.pools.get(pool + 1).map_or(self.vertices, |next| next.first_vertex);
        end - self.pools[pool].first_vertex
    }

    /// The points from slot `first` on; `pool` is the pool that contains it, or one before.
    pub fn points_from(&self, first: u32, pool: usize) -> impl Iterator<Item = Decoded> {
        let begin = (first < self.points).then(|| self.vertex_of(first, pool));
        begin.into_iter().flat_map(move |(begin, vertex)| {
            let skip = first - self.sums[(self.pools[begin].first_vertex + vertex) as usize];
            let pools = (begin..self.pools.len()).flat_map(move |pool| {
                let from = if pool == begin { vertex } else { 0 };
                (from..self.vertices_of(pool)).flat_map(move |vertex| self.points_at(pool, vertex))
            });
            pools.skip(skip as usize)
        })
    }

    /// The pool and the vertex of a point; the search begins at a pool that is not after it.
    fn vertex_of(&self, slot: u32, mut pool: usize) -> (usize, u32) {
        while self.pools.get(pool + 1).is_some_and(|next| next.first_point <= slot) {
            pool += 1;
        }
        let first = self.pools[pool].first_vertex as usize;
        let sums = &self.sums[first..][..self.vertices_of(pool) as usize];
        // The first vertex has no more points before it than the pool.
        (pool, sums.partition_point(|&before| before <= slot) as u32 - 1)
    }

    /// The points of a vertex, by rising translation.
    fn points_at(&self, pool: usize, vertex: u32) -> impl Iterator<Item = Decoded> {
        let found = self.pools[pool];
        let bits = self.words[(found.vertices + vertex) as usize];
        let point = move |translation, bits| {
            let cell = Cell::from_bits(bits).expect("a cell of the set");
            Decoded { pool, vertex, translation, cell }
        };
        let single = (found.tag_words == 0).then(|| point(None, bits));
        let tags = (0..found.tag_words).flat_map(move |word| {
            let mut tags = self.words[(found.tags + vertex * found.tag_words + word) as usize];
            std::iter::from_fn(move || {
                let bit = tags.trailing_zeros();
                tags &= tags.wrapping_sub(1);
                (bit < 32).then_some(32 * word + bit)
            })
        });
        single.into_iter().chain(tags.map(move |translation| {
            let step = match found.translations {
                BRICKS => translation & 3 | (translation >> 2 & 3) << 7 | (translation >> 4) << 14,
                first => self.words[(first + translation) as usize],
            };
            point(Some(translation), bits.wrapping_add(step))
        }))
    }
}
