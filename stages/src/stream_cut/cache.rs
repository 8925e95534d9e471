//! Which blocks are in memory, and where.

use std::ops::Range;

use range_alloc::RangeAllocator;

/// Places for the blocks of nodes in a list of words.
pub struct Cache {
    free: RangeAllocator<u32>,
    /// The place of each node's block.
    places: Vec<Option<Range<u32>>>,
    /// The frame in which each node was last part of the cut.
    used: Vec<u64>,
    frame: u64,
    /// Nodes of the last cut whose blocks are new.
    pub new: Vec<usize>,
}

impl Cache {
    /// An empty one for the blocks of `nodes` nodes.
    pub fn new(nodes: usize, words: u32) -> Self {
        let free = RangeAllocator::new(0..words);
        Self { free, places: vec![None; nodes], used: vec![0; nodes], frame: 0, new: Vec::new() }
    }

    /// Where a node's block is.
    pub fn place(&self, node: usize) -> Option<Range<u32>> {
        self.places[node].clone()
    }

    /// Makes room for the blocks of a cut; [`Cache::new`](Self#structfield.new) then has those that are yet to be
    /// written. Blocks that have not been used for the longest time make room. If the rest is too scattered, all blocks
    /// are placed anew. `None` if the cache is too small.
    pub fn hold(&mut self, cut: &[usize], words: impl Fn(usize) -> u32) -> Option<()> {
        self.frame += 1;
        cut.iter().for_each(|&node| self.used[node] = self.frame);
        self.new.clear();
        self.new.extend(cut.iter().copied().filter(|&node| self.places[node].is_none()));
        let found = (0..self.new.len()).all(|index| self.make_room(self.new[index], words(self.new[index])));
        if found {
            return Some(());
        }
        for place in self.places.iter_mut().filter_map(Option::take) {
            self.free.free_range(place);
        }
        self.new.clear();
        self.new.extend(cut);
        cut.iter().all(|&node| self.make_room(node, words(node))).then_some(())
    }

    fn make_room(&mut self, node: usize, words: u32) -> bool {
        loop {
            if let Ok(place) = self.free.allocate_range(words) {
                self.places[node] = Some(place);
                return true;
            }
            let unused = |node: &usize| self.places[*node].is_some() && self.used[*node] < self.frame;
            let Some(oldest) = (0..self.places.len()).filter(unused).min_by_key(|&node| self.used[node])
            else {
                return false;
            };
            self.free.free_range(self.places[oldest].take().expect("only blocks with a place"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_block_that_was_not_used_for_longest_makes_room() {
        let mut cache = Cache::new(4, 10);
        for (cut, new) in [(&[0, 1][..], &[0, 1][..]), (&[1], &[]), (&[2], &[2])] {
            assert_eq!(cache.hold(cut, |_| 4), Some(()));
            assert_eq!(cache.new, new);
        }
        assert_eq!([0, 1, 2].map(|node| cache.place(node)), [None, Some(4..8), Some(0..4)]);
        assert_eq!(cache.hold(&[1, 2, 3], |_| 4), None);
    }

    #[test]
    fn scattered_room_is_joined_by_placing_all_anew() {
        let words = |node: usize| [3, 3, 3, 6][node];
        let mut cache = Cache::new(4, 9);
        cache.hold(&[0, 1, 2], words).unwrap();
        // Six words are free without nodes 0 and 2, but not in one piece.
        cache.hold(&[1, 3], words).unwrap();
        assert_eq!(cache.new, [1, 3]);
        assert_eq!([1, 3].map(|node| cache.place(node)), [Some(0..3), Some(3..9)]);
    }
}
