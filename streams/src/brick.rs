//! Bricks: blocks of 4 x 4 x 4 cells with a bit for each.

use crate::{
    cell::{Cell, Translation},
    pool::Pool,
};

/// The edge of a brick in cells.
const EDGE: i32 = 4;

/// A brick takes a word for its corner and two for its bits, as three cells by themselves do. More cells than this save
/// bytes.
const WORTH: usize = 3;

/// The translations of a pool of bricks: the cells of a block from its corner, x fastest, then y, then z.
pub(crate) fn block() -> impl Iterator<Item = Translation> {
    (0..EDGE.pow(3)).map(|index| {
        let by = [index % EDGE, index / EDGE % EDGE, index / (EDGE * EDGE)];
        Translation::new(by).expect("shorter than a grid")
    })
}

/// All cells in bricks: a pool whose vertices are the bricks' corners.
pub(crate) fn all_bricks(cells: &[Cell]) -> Option<Pool> {
    bricks(cells, 0).0
}

/// The bricks that take fewer bytes than their cells by themselves, and the other cells.
pub(crate) fn full_bricks(cells: &[Cell]) -> (Option<Pool>, Vec<Cell>) {
    bricks(cells, WORTH)
}

/// The bricks of more than `few` cells, and the cells of the others in their order.
fn bricks(cells: &[Cell], few: usize) -> (Option<Pool>, Vec<Cell>) {
    let mut by_brick = cells.to_vec();
    by_brick.sort_unstable_by_key(|cell| corner(*cell));
    let (mut corners, mut tags, mut rest) = (Vec::new(), Vec::new(), Vec::new());
    for brick in by_brick.chunk_by(|a, b| corner(*a) == corner(*b)) {
        if brick.len() > few {
            let bits = brick.iter().fold(0_u64, |bits, cell| bits | 1 << bit(*cell));
            corners.push(corner(brick[0]));
            tags.extend([bits as u32, (bits >> 32) as u32]);
        } else {
            rest.extend_from_slice(brick);
        }
    }
    rest.sort_unstable();
    let pool = (!corners.is_empty())
        .then(|| Pool::new(corners, block().collect(), tags).expect("bricks divide the grid"));
    (pool, rest)
}

/// The corner of a cell's brick.
fn corner(cell: Cell) -> Cell {
    Cell::new(cell.at().map(|part| part - part % EDGE)).expect("within the grid")
}

/// A cell's bit in its brick: its index in [`block`].
fn bit(cell: Cell) -> i32 {
    let [x, y, z] = cell.at().map(|part| part % EDGE);
    x + EDGE * (y + EDGE * z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bytes::Layout, testing::Random};

    fn cells<const N: usize>(at: [[i32; 3]; N]) -> Vec<Cell> {
        at.map(|at| Cell::new(at).unwrap()).into()
    }

    #[test]
    fn a_brick_by_hand() {
        let set = cells([[4, 0, 0], [5, 0, 0], [3, 3, 0], [4, 1, 0], [7, 3, 3]]);
        let pool = all_bricks(&set).unwrap();
        assert_eq!(pool.vertices(), cells([[0, 0, 0], [4, 0, 0]]));
        assert_eq!(pool.tags(), [1 << 15, 0, 0b1_0011, 1 << 31]);
        assert!(pool.is_of_bricks());
        let mut points = Vec::new();
        pool.expand(&mut points);
        assert_eq!(points, cells([[3, 3, 0], [4, 0, 0], [5, 0, 0], [4, 1, 0], [7, 3, 3]]));
        // One cell alone takes 4 bytes, a brick 12.
        let (pool, rest) = full_bricks(&set);
        assert_eq!((pool.unwrap().points(), rest), (4, cells([[3, 3, 0]])));
        assert_eq!(full_bricks(&set[..3]), (None, set[..3].to_vec()));
    }

    #[test]
    fn bricks_hold_each_cell_once() {
        let mut random = Random(9);
        for round in 0..50 {
            let extent = [0; 3].map(|_| 1 + random.below(2 << (round % 7)).min(127));
            let set = random.cells(1 + round * 40, extent);
            for (pool, rest) in [(all_bricks(&set), vec![]), full_bricks(&set)] {
                let mut found = rest.clone();
                pool.iter().for_each(|pool| pool.expand(&mut found));
                found.sort();
                assert_eq!(found, set);
                assert!(rest.is_sorted());
                // 12 bytes a brick; the standard translations take none.
                if let Some(pool) = pool {
                    assert_eq!(Layout::PACKED.pool(&pool), 12 * pool.vertices().len());
                }
            }
        }
    }
}
