//! Vertex transformation pools: made, and expanded.

use std::cmp::Reverse;

use rayon::prelude::*;

use crate::{
    brick,
    bytes::Layout,
    cell::{Cell, Cells, Translation},
    encode::Settings,
};

/// The most translations of a pool: four words of tags for each vertex.
pub const MOST_TRANSLATIONS: usize = 128;

/// Vertices, translations, and which of their sums are points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pool {
    vertices: Vec<Cell>,
    translations: Vec<Translation>,
    tags: Vec<u32>,
}

/// Why vertices, translations and tags are no pool.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PoolError {
    /// No translations, or too many.
    #[error("a pool has 1 to {MOST_TRANSLATIONS} translations, not {0}")]
    Translations(usize),
    /// The tags do not fit the vertices.
    #[error("{vertices} vertices need {expected} words of tags, not {found}")]
    Tags {
        /// The number of vertices.
        vertices: usize,
        /// Words of tags that they need.
        expected: usize,
        /// Words of tags given.
        found: usize,
    },
    /// A tag names a translation that the pool does not have.
    #[error("vertex {vertex} has a tag for translation {translation}, but the pool has only {translations}")]
    Translation {
        /// The vertex by its index.
        vertex: usize,
        /// The translation by its index.
        translation: usize,
        /// The number of translations.
        translations: usize,
    },
    /// A tagged pair leads out of the grid.
    #[error("translation {translation} takes vertex {vertex} out of the grid")]
    Outside {
        /// The vertex by its index.
        vertex: usize,
        /// The translation by its index.
        translation: usize,
    },
}

impl Pool {
    /// A pool of vertices and translations. Each vertex has a word of tags for each 32 translations; bit `i % 32` of
    /// word `i / 32` says that the vertex moved by translation `i` is a point.
    ///
    /// # Errors
    /// The numbers do not fit each other, or a tagged pair is no cell of the grid.
    pub fn new(
        vertices: Vec<Cell>,
        translations: Vec<Translation>,
        tags: Vec<u32>,
    ) -> Result<Self, PoolError> {
        let count = translations.len();
        if count == 0 || count > MOST_TRANSLATIONS {
            return Err(PoolError::Translations(count));
        }
        let expected = vertices.len() * count.div_ceil(32);
        if tags.len() != expected {
            return Err(PoolError::Tags { vertices: vertices.len(), expected, found: tags.len() });
        }
        let pool = Self { vertices, translations, tags };
        for (vertex, translation) in pool.pairs() {
            let Some(by) = pool.translations.get(translation) else {
                return Err(PoolError::Translation { vertex, translation, translations: count });
            };
            if pool.vertices[vertex].moved(*by).is_none() {
                return Err(PoolError::Outside { vertex, translation });
            }
        }
        Ok(pool)
    }

    /// The cells that the translations move.
    pub fn vertices(&self) -> &[Cell] {
        &self.vertices
    }

    /// The translations.
    pub fn translations(&self) -> &[Translation] {
        &self.translations
    }

    /// The tags, [`Pool::words`] for each vertex.
    pub fn tags(&self) -> &[u32] {
        &self.tags
    }

    /// Words of tags for each vertex: one for 32 translations.
    pub fn words(&self) -> usize {
        self.translations.len().div_ceil(32)
    }

    /// Whether the pool is one of bricks: the translations are the cells of a block of 4 x 4 x 4 from its corner, x
    /// fastest. Files do without such translations.
    pub fn is_of_bricks(&self) -> bool {
        self.translations.iter().copied().eq(brick::block())
    }

    /// The translations that are stored: none for bricks.
    pub fn stored_translations(&self) -> &[Translation] {
        if self.is_of_bricks() { &[] } else { &self.translations }
    }

    /// The number of points: of tags that are set.
    pub fn points(&self) -> usize {
        self.tags.iter().map(|tags| tags.count_ones() as usize).sum()
    }

    /// The pairs of vertex and translation, by index, that are points. This is the order of the points.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        let words = self.words();
        self.tags.iter().enumerate().flat_map(move |(index, &tags)| {
            set_bits(tags).map(move |bit| (index / words, index % words * 32 + bit))
        })
    }

    /// Appends the pool's points. The twin of the shader that expands a pool: integer additions, one for each tag.
    ///
    /// Tags are taken 64 at a time, points `TOGETHER` at a time: the branches after each tag would cost more than all
    /// else, as no processor can foresee them. What is too much is written over by the next points.
    pub fn expand(&self, points: &mut Vec<Cell>) {
        let mut steps = [[0_u32; 64]; MOST_TRANSLATIONS / 64];
        for (steps, translations) in steps.iter_mut().zip(self.translations.chunks(64)) {
            steps.iter_mut().zip(translations).for_each(|(step, by)| *step = by.step());
        }
        let mut end = points.len();
        points.resize(end + self.points() + TOGETHER, Cell::FIRST);
        for (vertex, tags) in self.vertices.iter().zip(self.tags.chunks_exact(self.words())) {
            for (tags, steps) in tags.chunks(2).zip(&steps) {
                let mut rest = tags.iter().rev().fold(0_u64, |rest, &tags| rest << 32 | u64::from(tags));
                let mut at = end;
                end += rest.count_ones() as usize;
                while rest != 0 {
                    for place in &mut points[at..][..TOGETHER] {
                        *place = vertex.plus(steps[rest.trailing_zeros() as usize & 63]);
                        rest &= rest.wrapping_sub(1);
                    }
                    at += TOGETHER;
                }
            }
        }
        points.truncate(end);
    }
}

/// Points that [`Pool::expand`] writes together: it needs room for so many more than there are.
pub(crate) const TOGETHER: usize = 4;

/// The indices of the bits that are set, the lowest first.
fn set_bits(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = bits.trailing_zeros();
        bits &= bits.wrapping_sub(1);
        (bit < 32).then_some(bit as usize)
    })
}

/// Divides a set of cells among pools, greedily (section 4 of the paper), and returns the pools and the cells that no
/// pool contains. The pools end early when one would take more bytes than its points alone.
pub(crate) fn pools(cells: &[Cell], palette: &[Translation], settings: &Settings) -> (Vec<Pool>, Vec<Cell>) {
    let steps: Vec<i32> = palette.iter().map(|by| Cells::step(*by)).collect();
    let mut left = Cells::new(cells);
    let mut pools = Vec::new();
    for _ in 0..settings.pools {
        let Some((pool, rest)) = pool(cells, palette, &steps, &left, settings) else { break };
        if Layout::PACKED.pool(&pool) > Layout::PACKED.points(pool.points()) {
            break;
        }
        pools.push(pool);
        left = rest;
    }
    (pools, left.in_order())
}

/// The next pool, and the cells that it leaves.
fn pool(
    cells: &[Cell],
    palette: &[Translation],
    steps: &[i32],
    left: &Cells,
    settings: &Settings,
) -> Option<(Pool, Cells)> {
    // The vertex that most translations take to a point, and these translations, the most frequent ones.
    let reached = |cell: Cell, steps: &[i32]| {
        let place = Cells::place(cell);
        steps.iter().filter(|step| left.contains(place + *step)).count()
    };
    let counts: Vec<usize> = cells.par_iter().map(|cell| reached(*cell, steps)).collect();
    let (_, best) = counts.iter().zip(cells).rev().max_by_key(|(count, _)| **count)?;
    let place = Cells::place(*best);
    let rows = (0..steps.len()).filter(|&row| left.contains(place + steps[row]));
    let rows: Vec<usize> = rows.take(settings.translations).collect();
    let translations: Vec<Translation> = rows.iter().map(|&row| palette[row]).collect();
    let steps: Vec<i32> = rows.iter().map(|&row| steps[row]).collect();
    let least = settings.threshold * steps.len() as f64;

    // All vertices that reach more points than the threshold asks for, those that reach most first.
    let counts: Vec<usize> = cells.par_iter().map(|cell| reached(*cell, &steps)).collect();
    let mut order: Vec<usize> = (0..cells.len()).filter(|&index| counts[index] as f64 > least).collect();
    order.sort_by_key(|&index| Reverse(counts[index]));

    let mut rest = left.clone();
    let mut vertices = Vec::new();
    let mut tags = Vec::new();
    for index in order {
        let place = Cells::place(cells[index]);
        let mut new = [0_u32; MOST_TRANSLATIONS / 32];
        for (row, _) in steps.iter().enumerate().filter(|(_, step)| rest.contains(place + *step)) {
            new[row / 32] |= 1 << (row % 32);
        }
        let count: u32 = new.iter().map(|tags| tags.count_ones()).sum();
        if f64::from(count) > least {
            for row in (0..steps.len()).filter(|row| new[row / 32] >> (row % 32) & 1 == 1) {
                rest.remove(place + steps[row]);
            }
            vertices.push(cells[index]);
            tags.extend_from_slice(&new[..steps.len().div_ceil(32)]);
        }
    }
    (!vertices.is_empty()).then_some((Pool { vertices, translations, tags }, rest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        palette::Counts,
        testing::{patch, repeats, scatter},
    };

    fn cells<const N: usize>(at: [[i32; 3]; N]) -> Vec<Cell> {
        at.map(|at| Cell::new(at).unwrap()).into()
    }

    fn translations<const N: usize>(by: [[i32; 3]; N]) -> Vec<Translation> {
        by.map(|by| Translation::new(by).unwrap()).into()
    }

    /// Figure 4 (b) of the paper.
    fn figure(tags: [u32; 4]) -> Result<Pool, PoolError> {
        let vertices = cells([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]);
        let translations = translations([[0, 0, 0], [0, 0, 1], [3, 0, 0], [3, 0, 1]]);
        Pool::new(vertices, translations, tags.into())
    }

    #[test]
    fn the_table_of_the_figure_is_twelve_points() {
        let pool = figure([13, 7, 11, 11]).unwrap();
        let mut points = Vec::new();
        pool.expand(&mut points);
        let first = [[0, 0, 0], [3, 0, 0], [3, 0, 1], [1, 0, 0], [1, 0, 1], [4, 0, 0]];
        let second = [[1, 1, 0], [1, 1, 1], [4, 1, 1], [0, 1, 0], [0, 1, 1], [3, 1, 1]];
        assert_eq!(points, [cells(first), cells(second)].concat());
        assert_eq!((pool.points(), pool.words()), (12, 1));
        assert_eq!(pool.pairs().take(4).collect::<Vec<_>>(), [(0, 0), (0, 2), (0, 3), (1, 0)]);
    }

    #[test]
    fn pools_that_do_not_fit_are_errors() {
        let error = |pool: Result<Pool, PoolError>| pool.unwrap_err().to_string();
        assert_eq!(
            error(figure([13, 7, 16, 11])),
            "vertex 2 has a tag for translation 4, but the pool has only 4"
        );
        let down = translations([[0, 0, 0], [0, 0, -1]]);
        assert_eq!(
            error(Pool::new(cells([[5, 5, 0]]), down.clone(), vec![3])),
            "translation 1 takes vertex 0 out of the grid"
        );
        assert_eq!(
            error(Pool::new(cells([[5, 5, 0]]), down, vec![1, 1])),
            "1 vertices need 1 words of tags, not 2"
        );
        assert_eq!(error(Pool::new(vec![], vec![], vec![])), "a pool has 1 to 128 translations, not 0");
        let many = vec![Translation::new([0; 3]).unwrap(); 129];
        assert_eq!(error(Pool::new(vec![], many, vec![])), "a pool has 1 to 128 translations, not 129");
    }

    /// Three vertices moved by three translations, and one cell more.
    #[test]
    fn a_small_set_by_hand() {
        let row = |y, z| [[0, y, z], [1, y, z], [2, y, z]];
        let set = [cells(row(0, 0)), cells(row(5, 0)), cells(row(0, 9)), cells([[40, 50, 60]])].concat();
        let palette = translations([[0, 0, 0], [0, 5, 0], [0, 0, 9]]);
        let (found, singles) = pools(&set, &palette, &Settings { threshold: 0.5, ..Settings::default() });
        assert_eq!(found, [Pool::new(cells(row(0, 0)), palette.clone(), vec![7; 3]).unwrap()]);
        assert_eq!(singles, cells([[40, 50, 60]]));
        // 8 bytes for the vertex and its tags, 12 for the translations: more than 12 for the three points alone.
        let (found, singles) =
            pools(&cells([[0, 0, 0], [0, 5, 0], [0, 0, 9]]), &palette, &Settings::default());
        assert_eq!((found.len(), singles.len()), (0, 3));
    }

    /// Found by `reference/vts.py`, an independent program, on the same cells: vertices, translations and points of two
    /// pools, and the cells left.
    #[test]
    fn pools_are_those_of_the_reference() {
        let encode = |set: &[Cell], translations| {
            let palette: Vec<_> = Counts::new(set).most_frequent(256).into_iter().map(|(by, _)| by).collect();
            let settings = Settings { translations, ..Settings::default() };
            let (pools, singles) = pools(set, &palette, &settings);
            let mut decoded = singles.clone();
            pools.iter().for_each(|pool| pool.expand(&mut decoded));
            decoded.sort();
            assert_eq!(decoded, set);
            let size = |pool: &Pool| (pool.vertices().len(), pool.translations().len(), pool.points());
            (pools.iter().map(size).collect::<Vec<_>>(), singles.len())
        };
        let patch = patch();
        assert_eq!(encode(&patch, 88), (vec![(414, 88, 13_565), (51, 43, 699)], 2120));
        assert_eq!(encode(&patch, 96), (vec![(391, 96, 13_580), (30, 47, 447)], 2357));
        assert_eq!(encode(&patch, 128), (vec![(299, 128, 13_196), (31, 56, 629)], 2559));
        assert_eq!(encode(&repeats(), 88), (vec![(56, 24, 480)], 0));
        // The reference finds a pool of 47 vertices, 6 translations and 99 points: 400 bytes in place of 396.
        assert_eq!(encode(&scatter(), 88), (vec![], 2999));
    }
}
