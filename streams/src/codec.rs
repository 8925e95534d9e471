//! How the cells of a node are stored: whole codecs, and the smallest.

use crate::{
    brick::{all_bricks, full_bricks},
    bytes::Layout,
    cell::{Cell, Cells, Translation},
    encode::Settings,
    palette::Counts,
    pool::{Pool, pools},
};

/// Bytes of a pool in a file beside its [`Layout`]: two numbers.
const POOL_HEADER: usize = 8;

/// How the cells of a node are stored. Whatever the codec, a node is pools and cells by themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Codec {
    /// Each cell by itself: 4 bytes.
    Packed,
    /// Blocks of 4 x 4 x 4 cells with a bit for each: a pool in which vertices are the blocks' corners and translations
    /// lead to all cells of a block. 12 bytes for a block.
    Brick,
    /// The paper's pools, and cells by themselves.
    Streams,
    /// For each node the smallest of the paper's first pools, or none of them; then bricks for the blocks in which they
    /// save bytes; then cells by themselves. No node is larger than in another codec.
    Best,
}

impl Codec {
    /// All codecs, with the names and meanings that programs show.
    pub const ALL: [(Self, &str, &str); 4] = [
        (Self::Packed, "packed", "each point by itself, 4 bytes"),
        (Self::Brick, "brick", "blocks of 4x4x4 cells with a bit for each cell, 12 bytes a block"),
        (Self::Streams, "streams", "the paper's pools of vertices and translations, the rest by itself"),
        (Self::Best, "best", "for each node the smallest of these, or pools with bricks for the rest"),
    ];

    /// The codec's name in [`Codec::ALL`].
    pub fn name(self) -> &'static str {
        let [packed, brick, streams, best] = Self::ALL.map(|(_, name, _)| name);
        match self {
            Self::Packed => packed,
            Self::Brick => brick,
            Self::Streams => streams,
            Self::Best => best,
        }
    }

    /// Divides cells, in their order, among pools and cells by themselves.
    pub(crate) fn divide(self, cells: &[Cell], settings: &Settings) -> (Vec<Pool>, Vec<Cell>) {
        match self {
            Self::Packed => (Vec::new(), cells.to_vec()),
            Self::Brick => (all_bricks(cells).into_iter().collect(), Vec::new()),
            Self::Streams => streams(cells, settings),
            Self::Best => smallest(cells, streams(cells, settings).0),
        }
    }

    /// Whether the codec looks for the paper's pools, which takes most of the time.
    pub(crate) fn searches(self) -> bool {
        matches!(self, Self::Streams | Self::Best)
    }
}

fn streams(cells: &[Cell], settings: &Settings) -> (Vec<Pool>, Vec<Cell>) {
    let palette = Counts::new(cells).most_frequent(settings.palette);
    let palette: Vec<Translation> = palette.into_iter().map(|(by, _)| by).collect();
    pools(cells, &palette, settings)
}

/// The smallest of: some of the first pools, bricks for what they leave, and the rest.
fn smallest(cells: &[Cell], pools: Vec<Pool>) -> (Vec<Pool>, Vec<Cell>) {
    let mut left = Cells::new(cells);
    let mut best = with_bricks(&left);
    let mut best_size = size(&best.0, &best.1);
    for count in 1..=pools.len() {
        let mut points = Vec::new();
        pools[count - 1].expand(&mut points);
        points.iter().for_each(|cell| left.remove(Cells::place(*cell)));
        let (bricks, singles) = with_bricks(&left);
        let all = [&pools[..count], &bricks].concat();
        let size = size(&all, &singles);
        if size < best_size {
            (best, best_size) = ((all, singles), size);
        }
    }
    best
}

/// Cells in bricks where these save bytes, and the other cells.
fn with_bricks(cells: &Cells) -> (Vec<Pool>, Vec<Cell>) {
    let cells = cells.in_order();
    let (pool, rest) = full_bricks(&cells);
    let saves = |pool: &Pool| size(std::slice::from_ref(pool), &rest) < size(&[], &cells);
    match pool.filter(saves) {
        Some(pool) => (vec![pool], rest),
        None => (Vec::new(), cells),
    }
}

/// Bytes in a file.
fn size(pools: &[Pool], singles: &[Cell]) -> usize {
    let pools: usize = pools.iter().map(|pool| POOL_HEADER + Layout::PACKED.pool(pool)).sum();
    pools + Layout::PACKED.points(singles.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    /// A part of 40 cells at 150 places, for which pools are made, and a full cube, for which bricks are.
    #[test]
    fn the_best_codec_mixes_pools_and_bricks() {
        let mut random = Random(4);
        let part = random.cells(40, [30, 30, 30]);
        let places = random.cells(150, [90, 90, 90]);
        let mut set = Cells::empty();
        for (place, cell) in places.iter().flat_map(|place| part.iter().map(move |cell| (place, cell))) {
            let by = Translation::new(place.at()).unwrap();
            set.insert(Cells::place(cell.moved(by).unwrap()));
        }
        for index in 0..125 {
            let cell = Cell::new([index % 5, index / 5 % 5, index / 25].map(|part| 120 + part)).unwrap();
            set.insert(Cells::place(cell));
        }
        let settings = Settings { palette: 1 << 16, ..Settings::default() };
        let (pools, singles) = Codec::Best.divide(&set.in_order(), &settings);
        let bricks: Vec<bool> = pools.iter().map(Pool::is_of_bricks).collect();
        // One cell of the cube is at the end of a part.
        assert_eq!((bricks, pools[1].points()), (vec![false, true], 124));
        let others = [Codec::Packed, Codec::Brick, Codec::Streams].map(|codec| {
            let (pools, singles) = codec.divide(&set.in_order(), &settings);
            size(&pools, &singles)
        });
        assert!(others.iter().all(|other| size(&pools, &singles) < *other));
    }
}
