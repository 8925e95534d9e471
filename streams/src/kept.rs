//! What encoding has found so far, kept as bytes, so that an interrupted run need not begin anew. A record for each
//! node, in any order: its index, the length and the checksum of its block, and the block of its pools and points.

use std::collections::HashMap;

use crate::{
    Settings,
    cell::{Cell, Cells},
    file::{block_of, cells_of},
    pool::Pool,
};

const MAGIC: &[u8; 8] = b"EPIGRPRT";
/// Bytes of a record before its block.
const RECORD: usize = 12;

/// Pools, and the cells that none contains.
pub(crate) type Division = (Vec<Pool>, Vec<Cell>);

/// The nodes that an earlier run has encoded.
#[derive(Default)]
pub struct Kept {
    nodes: HashMap<usize, Division>,
    length: usize,
}

impl Kept {
    /// The first bytes of what a run with these settings keeps.
    pub fn header(settings: &Settings) -> Vec<u8> {
        // All settings decide about the pools, and this is all of them.
        let checksum = crc32fast::hash(format!("{settings:?}").as_bytes());
        [MAGIC.as_slice(), &checksum.to_le_bytes()].concat()
    }

    /// Whether these bytes were kept by a run with any settings.
    pub fn is_kept(bytes: &[u8]) -> bool {
        bytes.starts_with(MAGIC)
    }

    /// Reads what an earlier run has kept: nothing of a run with other settings, and nothing from the first record on that
    /// is cut off or damaged. That the records are of the same points is found out while they are encoded.
    pub fn read(bytes: &[u8], settings: &Settings) -> Self {
        let header = Self::header(settings);
        let Some(mut rest) = bytes.strip_prefix(header.as_slice()) else { return Self::default() };
        let mut kept = Self { nodes: HashMap::new(), length: header.len() };
        while let Some((head, after)) = rest.split_first_chunk::<RECORD>() {
            let [index, length, checksum] =
                [0, 4, 8].map(|at| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]));
            let Some(block) = after.get(..length as usize).filter(|block| crc32fast::hash(block) == checksum)
            else {
                break;
            };
            let Ok(division) = cells_of(index as usize, block) else { break };
            kept.nodes.insert(index as usize, division);
            kept.length += RECORD + block.len();
            rest = &after[block.len()..];
        }
        kept
    }

    /// How many of the bytes were read: the others are cut off, damaged or of other settings.
    pub fn length(&self) -> usize {
        self.length
    }

    /// The number of nodes.
    pub fn count(&self) -> usize {
        self.nodes.len()
    }

    /// The division of a node with these cells, in their order; `None` if it is not kept, or is one of other points.
    pub(crate) fn division(&self, node: usize, cells: &[Cell]) -> Option<Division> {
        let (pools, singles) = self.nodes.get(&node)?;
        let count = pools.iter().map(Pool::points).sum::<usize>() + singles.len();
        if count != cells.len() {
            return None;
        }
        let mut found = Vec::with_capacity(count);
        pools.iter().for_each(|pool| pool.expand(&mut found));
        found.extend_from_slice(singles);
        let set = Cells::new(&found);
        (set.in_order() == cells).then(|| (pools.clone(), singles.clone()))
    }
}

/// The record of a node.
pub(crate) fn record(node: usize, pools: &[Pool], singles: &[Cell]) -> Vec<u8> {
    let block = block_of(pools, singles);
    let head = [node as u32, block.len() as u32, crc32fast::hash(&block)].map(u32::to_le_bytes);
    [head.as_flattened(), &block].concat()
}

#[cfg(test)]
mod tests {
    use std::{
        ops::ControlFlow,
        sync::{
            Mutex,
            atomic::{AtomicUsize, Ordering},
        },
    };

    use super::*;
    use crate::{Codec, EncodeError, Points, encode, encode_from, testing::patch};

    fn points() -> Points {
        let cells = patch();
        Points::from(
            cells.iter().map(|cell| glam::Vec3::from(cell.at().map(|part| part as f32))).collect::<Vec<_>>(),
        )
    }

    const SETTINGS: Settings = Settings {
        codec: Codec::Streams,
        levels: 4,
        pools: 2,
        translations: 96,
        palette: 256,
        threshold: 0.25,
    };

    /// Encodes from what was kept, and returns the result and what was kept of this run.
    fn run(kept: &Kept, stop_after: usize) -> (Result<crate::Model, EncodeError>, Vec<u8>) {
        let bytes = Mutex::new(Kept::header(&SETTINGS));
        let count = AtomicUsize::new(0);
        let keep = |record: &[u8]| {
            count.fetch_add(1, Ordering::Relaxed);
            bytes.lock().unwrap().extend_from_slice(record);
        };
        let watch = |_, _| match count.load(Ordering::Relaxed) >= stop_after {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let model = encode_from(&points(), &SETTINGS, &watch, kept, &keep);
        (model, bytes.into_inner().unwrap())
    }

    #[test]
    fn an_interrupted_run_goes_on_to_the_same_model() {
        let expected = encode(&points(), &SETTINGS).unwrap();
        let (stopped, bytes) = run(&Kept::default(), 5);
        assert_eq!(stopped.unwrap_err(), EncodeError::Stopped);
        let kept = Kept::read(&bytes, &SETTINGS);
        assert!(kept.count() >= 5 && kept.count() < expected.nodes().len(), "{}", kept.count());
        let (model, rest) = run(&kept, usize::MAX);
        assert_eq!(model.unwrap(), expected);
        // Only the others were encoded.
        assert_eq!(Kept::read(&rest, &SETTINGS).count(), expected.nodes().len() - kept.count());
    }

    #[test]
    fn what_is_cut_off_or_damaged_or_of_other_settings_does_not_count() {
        let (_, bytes) = run(&Kept::default(), usize::MAX);
        let all = Kept::read(&bytes, &SETTINGS).count();
        assert_eq!(Kept::read(&bytes, &SETTINGS).length(), bytes.len());
        let cut = Kept::read(&bytes[..bytes.len() - 1], &SETTINGS);
        assert_eq!(cut.count(), all - 1);
        assert_eq!(Kept::read(&bytes[..cut.length()], &SETTINGS).count(), all - 1);
        assert_eq!(Kept::read(&bytes, &Settings { pools: 3, ..SETTINGS }).count(), 0);
        assert_eq!(Kept::read(b"something else", &SETTINGS).count(), 0);
        assert!(Kept::is_kept(&bytes) && !Kept::is_kept(b"something else"));
        let mut damaged = bytes.clone();
        damaged[Kept::header(&SETTINGS).len() + RECORD] ^= 1;
        assert_eq!(Kept::read(&damaged, &SETTINGS).count(), 0);
    }

    #[test]
    fn records_of_other_points_are_not_used() {
        let (_, bytes) = run(&Kept::default(), usize::MAX);
        let mut moved = points();
        moved.positions.truncate(moved.positions.len() / 2);
        let expected = encode(&moved, &SETTINGS).unwrap();
        let watch = |_, _| ControlFlow::Continue(());
        let kept = Kept::read(&bytes, &SETTINGS);
        assert_eq!(encode_from(&moved, &SETTINGS, &watch, &kept, &|_| ()).unwrap(), expected);
    }
}
