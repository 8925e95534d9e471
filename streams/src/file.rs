//! Files of models, `.vts`. `docs/vts.md` describes the format.

use std::path::Path;

use epigraph_files::{FileError, MOST_DATA, Target};
use glam::{DVec3, Vec3};

use crate::{
    attributes::Attributes,
    brick,
    cell::{Cell, GRID, Translation},
    frame::Frame,
    model::{Model, Node},
    pool::{Pool, PoolError},
    repeats::{BlockError, Repeats},
};

const MAGIC: &[u8; 8] = b"EPIGRVTS";
const VERSION: u32 = 2;
const HEADER: usize = 48;
/// Where the bytes begin that the header's checksum is of.
const CHECKED: usize = 16;
const RECORD: usize = 76;

/// Bits of the header's flags.
const COLORS: u32 = 1;
const NORMALS: u32 = 2;
const REPEATS: u32 = 4;

/// Why bytes are no model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum VtsError {
    /// The file begins otherwise.
    #[error("it is no file of vertex transformation streams: it does not begin with EPIGRVTS")]
    Magic,
    /// The file is of another version.
    #[error("it has version {0} of the format; this program reads version {VERSION}")]
    Version(u32),
    /// The file ends early.
    #[error("it ends at byte {length}, before the end of {part}: it is cut off")]
    Short {
        /// The length of the file in bytes.
        length: usize,
        /// What is cut off.
        part: String,
    },
    /// The bytes have changed since they were written.
    #[error("the checksum of {part} is wrong: the file is damaged")]
    Checksum {
        /// What has changed.
        part: String,
    },
    /// The header has flags that this version does not define.
    #[error(
        "its flags are {0:#x}; this version of the format has only {COLORS} for colours and {NORMALS} for normals, or \
         {REPEATS} for repeats"
    )]
    Flags(u32),
    /// The file holds [`Repeats`], not a tree of points.
    #[error("it holds repeats, the parts of a mesh and where they are, and no tree of points")]
    IsRepeats,
    /// The file holds a tree of points, not [`Repeats`].
    #[error("it holds a tree of points, and no repeats")]
    IsPoints,
    /// What the file holds is no [`Repeats`].
    #[error(transparent)]
    Repeats(#[from] BlockError),
    /// The origin is not finite.
    #[error("its origin is not made of finite numbers")]
    Origin,
    /// The table of nodes is no tree.
    #[error("node {node} cannot have node {child} as its first child")]
    Child {
        /// The node by its index.
        node: usize,
        /// The child that it names.
        child: u32,
    },
    /// A node's frame is not finite, or its cells have no size.
    #[error("the frame of node {node} is not made of finite numbers")]
    Frame {
        /// The node by its index.
        node: usize,
    },
    /// A block holds something else than pools and points.
    #[error("node {node}, byte {offset} of its block: {cause}")]
    Block {
        /// The node by its index.
        node: usize,
        /// Where in the block.
        offset: usize,
        /// What is wrong.
        cause: String,
    },
    /// A node's pools and points do not fit its number of points.
    #[error("node {node}: {cause}")]
    Points {
        /// The node by its index.
        node: usize,
        /// What is wrong.
        cause: String,
    },
}

/// What a file begins with.
struct Header<'a> {
    flags: u32,
    origin: DVec3,
    /// The table of nodes.
    table: &'a [u8],
}

impl<'a> Header<'a> {
    fn read(bytes: &'a [u8]) -> Result<Self, VtsError> {
        let short = |part: &str| VtsError::Short { length: bytes.len(), part: part.into() };
        if !bytes.starts_with(MAGIC) {
            return Err(VtsError::Magic);
        }
        let mut header = Words(bytes.get(8..HEADER).ok_or_else(|| short("the header"))?);
        let [version, checksum, count, flags] = [0; 4].map(|_| header.next());
        let origin = DVec3::from([0; 3].map(|_| f64::from_bits(header.next_long())));
        if version != VERSION {
            return Err(VtsError::Version(version));
        }
        // The file is at least as long as the table, so the table's length is a safe one to allocate.
        let table =
            (count as usize).checked_mul(RECORD).and_then(|length| bytes.get(HEADER..)?.get(..length));
        let table = table.ok_or_else(|| short("the table of nodes"))?;
        if crc32fast::hash(&bytes[CHECKED..HEADER + table.len()]) != checksum {
            return Err(VtsError::Checksum { part: "the header and the table of nodes".into() });
        }
        let is_points = flags & !(COLORS | NORMALS) == 0;
        if !is_points && (flags != REPEATS || !table.is_empty()) {
            return Err(VtsError::Flags(flags));
        }
        if !origin.is_finite() {
            return Err(VtsError::Origin);
        }
        Ok(Self { flags, origin, table })
    }
}

/// The table of a file's nodes, which are read one by one.
pub struct Reader<'a> {
    bytes: &'a [u8],
    origin: DVec3,
    flags: u32,
    records: Vec<Record>,
}

struct Record {
    frame: Frame,
    points: u32,
    first_child: Option<usize>,
    offset: u64,
    length: u32,
    checksum: u32,
}

impl<'a> Reader<'a> {
    /// Reads header and table of a whole file. The blocks are not touched.
    ///
    /// # Errors
    /// The bytes are no file of this kind and version, or the table is cut off, damaged or no tree.
    pub fn new(bytes: &'a [u8]) -> Result<Self, VtsError> {
        let Header { flags, origin, table } = Header::read(bytes)?;
        if flags & REPEATS != 0 {
            return Err(VtsError::IsRepeats);
        }
        let records: Vec<Record> = table.chunks_exact(RECORD).map(Record::read).collect();
        check_tree(&records)?;
        Ok(Self { bytes, origin, flags, records })
    }

    /// What to add to the positions of points: [`Model::origin`].
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The number of nodes.
    pub fn node_count(&self) -> usize {
        self.records.len()
    }

    /// Reads a node; it is less than [`Reader::node_count`].
    ///
    /// # Errors
    /// Its block is cut off, damaged or no set of pools and points.
    pub fn node(&self, node: usize) -> Result<Node, VtsError> {
        let record = &self.records[node];
        let part = || format!("node {node}");
        let block = usize::try_from(record.offset).ok().and_then(|offset| self.bytes.get(offset..));
        let block = block.and_then(|block| block.get(..record.length as usize));
        let block = block.ok_or_else(|| VtsError::Short { length: self.bytes.len(), part: part() })?;
        if crc32fast::hash(block) != record.checksum {
            return Err(VtsError::Checksum { part: part() });
        }
        let mut block = Block { node, bytes: block, offset: 0 };
        let (pools, singles) = block.cells_of_node()?;
        let Record { frame, points, first_child, .. } = *record;
        let mut read = Node { frame, points, first_child, pools, singles, attributes: Attributes::default() };
        let fail = |cause| Err(VtsError::Points { node, cause });
        // Before the points are expanded: a few bytes of tags are many points.
        let cells = read.cell_count();
        if cells == 0 || cells > read.points() || cells > GRID.pow(3) as usize {
            return fail(format!("{points} points cannot fill {cells} cells"));
        }
        read.attributes = block.attributes(cells, self.flags)?;
        if let Some(cell) = read.repeated() {
            return fail(format!("it contains cell {cell:?} twice"));
        }
        Ok(read)
    }
}

impl Record {
    fn read(bytes: &[u8]) -> Self {
        let mut words = Words(bytes);
        let mut vector = || Vec3::from([0; 3].map(|_| f32::from_bits(words.next())));
        let origin = vector();
        let axes = [0; 3].map(|_| vector());
        let cell = f32::from_bits(words.next());
        let points = words.next();
        let first_child = Some(words.next() as usize).filter(|&child| child != 0);
        let offset = words.next_long();
        let [length, checksum] = [0; 2].map(|_| words.next());
        Self { frame: Frame { origin, axes, cell }, points, first_child, offset, length, checksum }
    }

    fn write(&self, bytes: &mut Vec<u8>) {
        let Frame { origin, axes, cell } = self.frame;
        let floats = [origin, axes[0], axes[1], axes[2]].into_iter().flat_map(|vector| vector.to_array());
        for float in floats.chain([cell]) {
            bytes.extend(float.to_le_bytes());
        }
        bytes.extend(self.points.to_le_bytes());
        bytes.extend((self.first_child.unwrap_or(0) as u32).to_le_bytes());
        bytes.extend(self.offset.to_le_bytes());
        bytes.extend(self.length.to_le_bytes());
        bytes.extend(self.checksum.to_le_bytes());
    }
}

/// Checks that the records are a tree by levels, whose children have the points of their parents.
fn check_tree(records: &[Record]) -> Result<(), VtsError> {
    let mut next = 1;
    for (node, record) in records.iter().enumerate() {
        let Frame { origin, axes, cell } = record.frame;
        let finite = origin.is_finite() && axes.iter().all(|axis| axis.is_finite());
        if !finite || !cell.is_finite() || cell < 0.0 {
            return Err(VtsError::Frame { node });
        }
        if let Some(child) = record.first_child {
            if child != next || child + 1 >= records.len() {
                return Err(VtsError::Child { node, child: child as u32 });
            }
            let points = u64::from(records[child].points) + u64::from(records[child + 1].points);
            if points != u64::from(record.points) {
                let cause = format!("it has {} points, its children {points}", record.points);
                return Err(VtsError::Points { node, cause });
            }
            next += 2;
        }
    }
    if next != records.len() {
        let cause = format!("the table has {} nodes, of which {next} belong to the tree", records.len());
        return Err(VtsError::Points { node: 0, cause });
    }
    Ok(())
}

impl Repeats {
    /// The bytes of a file `.vts` with these repeats in place of a tree.
    pub fn to_file(&self) -> Vec<u8> {
        [head(REPEATS, self.origin(), &[]), self.to_bytes()].concat()
    }

    /// Repeats from the bytes of a file.
    ///
    /// # Errors
    /// The bytes are no file of this kind and version, it holds a tree of points, or it is cut off or damaged.
    pub fn from_file(bytes: &[u8]) -> Result<Self, VtsError> {
        let Header { flags, origin, .. } = Header::read(bytes)?;
        match flags {
            REPEATS => Ok(Self::from_bytes(&bytes[HEADER..])?.at(origin)),
            _ => Err(VtsError::IsPoints),
        }
    }

    /// Reads a file of at most [`MOST_DATA`] bytes.
    ///
    /// # Errors
    /// The file cannot be read, or [`Repeats::from_file`]; the message names the file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let bytes = epigraph_files::bytes(path, MOST_DATA).map_err(|error| FileError::read(path, error))?;
        Self::from_file(&bytes).map_err(|error| FileError::read(path, error))
    }

    /// Writes a file, whole or not at all.
    ///
    /// # Errors
    /// The system's error.
    pub fn write(&self, target: &Target) -> Result<(), FileError> {
        target.write(&self.to_file())
    }
}

/// Words of bytes whose length was checked.
struct Words<'a>(&'a [u8]);

impl Words<'_> {
    fn next_long(&mut self) -> u64 {
        u64::from(self.next()) | u64::from(self.next()) << 32
    }

    fn next(&mut self) -> u32 {
        let (word, rest) = self.0.split_first_chunk().expect("the length was checked");
        self.0 = rest;
        u32::from_le_bytes(*word)
    }
}

/// A block while it is read.
struct Block<'a> {
    node: usize,
    bytes: &'a [u8],
    offset: usize,
}

impl Block<'_> {
    /// The pools, and the cells that none contains.
    fn cells_of_node(&mut self) -> Result<(Vec<Pool>, Vec<Cell>), VtsError> {
        let numbers = self.words(2, "the numbers of pools and of cells by themselves")?;
        let [count, singles] = [numbers[0], numbers[1]];
        let mut pools = Vec::new();
        for _ in 0..count {
            let begin = self.offset;
            let numbers = self.words(2, "a pool's numbers")?;
            let [vertices, translations] = [numbers[0] as usize, numbers[1] as usize];
            let translations = if translations == 0 {
                Some(brick::block().collect())
            } else {
                let words = self.words(translations, "translations")?;
                words.into_iter().map(translation).collect::<Option<Vec<_>>>()
            };
            let translations =
                translations.ok_or_else(|| self.fail(begin, "a translation leaves the grid"))?;
            let words = translations.len().div_ceil(32);
            let vertices = self.cells(vertices)?;
            let tags = self.words(vertices.len().saturating_mul(words), "tags")?;
            let pool = Pool::new(vertices, translations, tags);
            pools.push(pool.map_err(|error: PoolError| self.fail(begin, error))?);
        }
        let singles = self.cells(singles as usize)?;
        Ok((pools, singles))
    }

    /// The colours and normals of the node's cells, up to the end of the block.
    fn attributes(mut self, cells: usize, flags: u32) -> Result<Attributes, VtsError> {
        let mut read = |flag, what| (flags & flag != 0).then(|| self.words(cells, what)).transpose();
        let attributes = Attributes { colors: read(COLORS, "colours")?, normals: read(NORMALS, "normals")? };
        match self.bytes.len() - self.offset {
            0 => Ok(attributes),
            rest => {
                Err(self.fail(self.offset, format!("{rest} bytes follow the last of the node's numbers")))
            }
        }
    }

    /// The next words. They are in the block before memory is allocated for them.
    fn words(&mut self, count: usize, what: &str) -> Result<Vec<u32>, VtsError> {
        let bytes = count.checked_mul(4).and_then(|length| self.bytes[self.offset..].get(..length));
        let Some(bytes) = bytes else {
            return Err(self.fail(self.offset, format!("the block ends within {what}")));
        };
        self.offset += bytes.len();
        let (words, _) = bytes.as_chunks();
        Ok(words.iter().map(|word| u32::from_le_bytes(*word)).collect())
    }

    fn cells(&mut self, count: usize) -> Result<Vec<Cell>, VtsError> {
        let begin = self.offset;
        let cells = self.words(count, "cells")?.into_iter().map(Cell::from_bits).collect::<Option<Vec<_>>>();
        cells.ok_or_else(|| self.fail(begin, "a cell is outside of the grid"))
    }

    fn fail(&self, offset: usize, cause: impl ToString) -> VtsError {
        VtsError::Block { node: self.node, offset, cause: cause.to_string() }
    }
}

fn translation(word: u32) -> Option<Translation> {
    let [x, y, z, zero] = word.to_le_bytes();
    let by = [x, y, z].map(|part| i32::from(part.cast_signed()));
    Translation::new(by).filter(|_| zero == 0)
}

/// The pools and the points by themselves of a node's block without colours and normals.
pub(crate) fn cells_of(node: usize, bytes: &[u8]) -> Result<(Vec<Pool>, Vec<Cell>), VtsError> {
    Block { node, bytes, offset: 0 }.cells_of_node()
}

/// The inverse of [`cells_of`].
pub(crate) fn block_of(pools: &[Pool], singles: &[Cell]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut word = |word: u32| bytes.extend(word.to_le_bytes());
    word(pools.len() as u32);
    word(singles.len() as u32);
    for pool in pools {
        let translations = pool.stored_translations();
        word(pool.vertices().len() as u32);
        word(translations.len() as u32);
        translations.iter().for_each(|by| word(u32::from_le_bytes(by.bytes())));
        pool.vertices().iter().for_each(|cell| word(cell.bits()));
        pool.tags().iter().for_each(|&tags| word(tags));
    }
    singles.iter().for_each(|cell| word(cell.bits()));
    bytes
}

pub(crate) fn block(node: &Node) -> Vec<u8> {
    let mut bytes = block_of(&node.pools, &node.singles);
    let attributes = [node.colors(), node.normals()].into_iter().flatten().flatten();
    bytes.extend(attributes.flat_map(|value| value.to_le_bytes()));
    bytes
}

/// What comes before the blocks: the header and a table of nodes.
fn head(flags: u32, origin: DVec3, table: &[u8]) -> Vec<u8> {
    let mut checked = Vec::with_capacity(HEADER + table.len());
    checked.extend(((table.len() / RECORD) as u32).to_le_bytes());
    checked.extend(flags.to_le_bytes());
    checked.extend(origin.to_array().iter().flat_map(|at| at.to_le_bytes()));
    checked.extend(table);
    let checksum = crc32fast::hash(&checked);
    [MAGIC, &VERSION.to_le_bytes()[..], &checksum.to_le_bytes(), &checked].concat()
}

impl Model {
    /// The model as the bytes of a file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut table = Vec::with_capacity(self.nodes.len() * RECORD);
        let mut blocks = Vec::new();
        let begin = HEADER + self.nodes.len() * RECORD;
        for node in &self.nodes {
            let block = block(node);
            let record = Record {
                frame: node.frame,
                points: node.points,
                first_child: node.first_child,
                offset: (begin + blocks.len()) as u64,
                // A grid of 2 million cells takes less than 2^32 bytes however it is encoded.
                length: block.len() as u32,
                checksum: crc32fast::hash(&block),
            };
            record.write(&mut table);
            blocks.extend(block);
        }
        let has = |values: fn(&Node) -> Option<&[u32]>| self.nodes.first().and_then(values).is_some();
        let colors = if has(Node::colors) { COLORS } else { 0 };
        let normals = if has(Node::normals) { NORMALS } else { 0 };
        [head(colors | normals, self.origin, &table), blocks].concat()
    }

    /// The model from the bytes of a file.
    ///
    /// # Errors
    /// The bytes are no file of this kind and version, or it is cut off or damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, VtsError> {
        let reader = Reader::new(bytes)?;
        let nodes = (0..reader.node_count()).map(|node| reader.node(node)).collect::<Result<_, _>>()?;
        Ok(Self { origin: reader.origin(), nodes })
    }

    /// Reads a file of at most [`MOST_DATA`] bytes.
    ///
    /// # Errors
    /// The file cannot be read, or [`Model::from_bytes`]; the message names the file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let bytes = epigraph_files::bytes(path, MOST_DATA).map_err(|error| FileError::read(path, error))?;
        Self::from_bytes(&bytes).map_err(|error| FileError::read(path, error))
    }

    /// Writes a file, whole or not at all.
    ///
    /// # Errors
    /// The system's error.
    pub fn write(&self, target: &Target) -> Result<(), FileError> {
        target.write(&self.to_bytes())
    }
}

#[cfg(test)]
mod tests;
