//! What points take in bytes.

use crate::{model::Node, pool::Pool};

/// Bytes of the parts of a node, in one way to store it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// A vertex of a pool, without its tags.
    pub vertex: usize,
    /// The tags of a vertex, however many translations there are; `None` for a word for each 32.
    pub tags: Option<usize>,
    /// A translation.
    pub translation: usize,
    /// Whether translations are stored that make bricks of a pool, [`Pool::is_of_bricks`].
    pub stores_bricks: bool,
    /// A point by itself.
    pub point: usize,
}

impl Layout {
    /// The paper's (section 7): an index of 2 bytes and four shorts for a vertex, four floats for 88 tags; four shorts
    /// and two more for a translation; four shorts for a point.
    pub const PAPER: Self =
        Self { vertex: 10, tags: Some(16), translation: 12, stores_bricks: true, point: 8 };

    /// That of this crate's files: a word for a vertex, a translation or a point, and a word for each 32 tags.
    pub const PACKED: Self = Self { vertex: 4, tags: None, translation: 4, stores_bricks: false, point: 4 };

    /// Bytes of a pool.
    pub fn pool(&self, pool: &Pool) -> usize {
        let tags = self.tags.unwrap_or(4 * pool.words());
        let stored = self.stores_bricks || !pool.is_of_bricks();
        let translations = if stored { pool.translations().len() } else { 0 };
        pool.vertices().len() * (self.vertex + tags) + translations * self.translation
    }

    /// Bytes of points by themselves.
    pub fn points(&self, count: usize) -> usize {
        count * self.point
    }

    /// Bytes of a node without its colours and normals: of its pools and of the points that none contains.
    pub fn node(&self, node: &Node) -> usize {
        node.pools().iter().map(|pool| self.pool(pool)).sum::<usize>() + self.points(node.singles().len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::{Cell, Translation};

    /// The paper's pool for its David: 150 vertices, 88 translations, 0.32 of the pairs.
    #[test]
    fn a_pool_of_the_papers_takes_the_papers_bytes() {
        let cell = Cell::new([0; 3]).unwrap();
        let pool = |translations: usize| {
            let translation = Translation::new([1, 0, 0]).unwrap();
            let tags = vec![0; 150 * translations.div_ceil(32)];
            Pool::new(vec![cell; 150], vec![translation; translations], tags).unwrap()
        };
        assert_eq!(Layout::PAPER.pool(&pool(88)), 4956);
        assert_eq!(Layout::PAPER.points(150 * 88 * 32 / 100), 33_792);
        // 4 for the vertex, 12 or 16 for its tags, as section 6.4 of the derivation has it.
        assert_eq!(Layout::PACKED.pool(&pool(96)), 150 * 16 + 96 * 4);
        assert_eq!(Layout::PACKED.pool(&pool(128)), 150 * 20 + 128 * 4);
    }
}
