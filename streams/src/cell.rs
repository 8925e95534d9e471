//! The grid of a node: its cells and the translations between them.

use std::fmt;

/// Cells along each axis of a node's grid: 7 bits.
pub const GRID: u32 = 128;

/// A cell of a node's grid, packed as `x | y << 7 | z << 14`. Cells are ordered by z, then y, then x.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell(u32);

impl Cell {
    /// The cell (0, 0, 0).
    pub(crate) const FIRST: Self = Self(0);

    /// The cell whose packed coordinates are larger by a number. The caller knows that it is in the grid, or does not
    /// use it.
    pub(crate) fn plus(self, bits: u32) -> Self {
        Self(self.0.wrapping_add(bits))
    }

    /// The cell at these coordinates, or `None` outside the grid.
    pub fn new(at: [i32; 3]) -> Option<Self> {
        let [x, y, z] = at.map(|part| u32::try_from(part).ok().filter(|&part| part < GRID));
        Some(Self(x? | y? << 7 | z? << 14))
    }

    /// The cell with these packed coordinates, or `None` if a bit above them is set.
    pub fn from_bits(bits: u32) -> Option<Self> {
        (bits < GRID.pow(3)).then_some(Self(bits))
    }

    /// The packed coordinates.
    pub fn bits(self) -> u32 {
        self.0
    }

    /// The coordinates x, y and z.
    pub fn at(self) -> [i32; 3] {
        [0, 7, 14].map(|shift| (self.0 >> shift & (GRID - 1)) as i32)
    }

    /// The cell that a translation leads to, or `None` outside the grid.
    pub fn moved(self, by: Translation) -> Option<Self> {
        let (at, by) = (self.at(), by.by());
        Self::new([0, 1, 2].map(|axis| at[axis] + by[axis]))
    }
}

impl fmt::Debug for Cell {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.at().fmt(f)
    }
}

/// A step from one cell of a grid to another: x, y and z, each from -127 to 127.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Translation([i8; 3]);

impl Translation {
    /// The translation by these steps, or `None` if one leads out of every grid.
    pub fn new(by: [i32; 3]) -> Option<Self> {
        let [x, y, z] = by.map(|part| i8::try_from(part).ok().filter(|&part| part != i8::MIN));
        Some(Self([x?, y?, z?]))
    }

    /// The steps along x, y and z.
    pub fn by(self) -> [i32; 3] {
        self.0.map(i32::from)
    }

    /// What it adds to the packed coordinates of a cell. Carries between the coordinates cancel if the sum is in the grid.
    pub fn step(self) -> u32 {
        let [x, y, z] = self.by();
        (x + (y << 7) + (z << 14)).cast_unsigned()
    }

    /// The translation as four bytes: x, y, z and 0.
    pub fn bytes(self) -> [u8; 4] {
        let [x, y, z] = self.0.map(|part| part.cast_unsigned());
        [x, y, z, 0]
    }
}

impl fmt::Debug for Translation {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A set of cells.
#[derive(Clone)]
pub(crate) struct Cells(Vec<u64>);

/// Bits between rows and between planes of [`Cells`]: twice the grid. A translation that leaves the grid along x or y
/// then ends in the gap after a row or plane, where no bit is set, so that no coordinate is checked by itself.
const PITCH: u32 = 8;

impl Cells {
    pub(crate) fn empty() -> Self {
        Self(vec![0; ((GRID as usize) << (2 * PITCH)) / 64])
    }

    pub(crate) fn new(cells: &[Cell]) -> Self {
        let mut set = Self::empty();
        for &cell in cells {
            set.insert(Self::place(cell));
        }
        set
    }

    /// A cell's place in the set.
    pub(crate) fn place(cell: Cell) -> i32 {
        let [x, y, z] = cell.at();
        x | y << PITCH | z << (2 * PITCH)
    }

    /// What a translation adds to a place.
    pub(crate) fn step(translation: Translation) -> i32 {
        let [x, y, z] = translation.by();
        x + (y << PITCH) + (z << (2 * PITCH))
    }

    /// Whether the set contains a cell. Places outside the grid are in no set.
    pub(crate) fn contains(&self, place: i32) -> bool {
        self.0.get((place >> 6) as usize).is_some_and(|word| word >> (place & 63) & 1 == 1)
    }

    /// Adds the cell at a place in the grid; false if the set contained it.
    pub(crate) fn insert(&mut self, place: i32) -> bool {
        let word = &mut self.0[(place >> 6) as usize];
        let before = *word;
        *word |= 1 << (place & 63);
        *word != before
    }

    pub(crate) fn remove(&mut self, place: i32) {
        self.0[(place >> 6) as usize] &= !(1 << (place & 63));
    }

    /// The number of cells, and the function from the place of a cell of the set to its index in their order.
    pub(crate) fn ranks(&self) -> (usize, impl Fn(i32) -> usize) {
        let mut count = 0;
        let before = self.0.iter().map(|word| {
            count += word.count_ones();
            count - word.count_ones()
        });
        let before: Vec<u32> = before.collect();
        let rank = move |place: i32| {
            let word = (place >> 6) as usize;
            let lower = self.0[word] & ((1 << (place & 63)) - 1);
            (before[word] + lower.count_ones()) as usize
        };
        (count as usize, rank)
    }

    /// The cells in their order.
    pub(crate) fn in_order(&self) -> Vec<Cell> {
        let mut cells = Vec::new();
        for (index, &word) in self.0.iter().enumerate() {
            let mut rest = word;
            while rest != 0 {
                let place = index as i32 * 64 + rest.trailing_zeros() as i32;
                let at = [0, PITCH, 2 * PITCH].map(|shift| place >> shift & 0xFF);
                cells.extend(Cell::new(at));
                rest &= rest - 1;
            }
        }
        cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_and_translations_are_packed_and_bounded() {
        let cell = Cell::new([1, 2, 127]).unwrap();
        assert_eq!((cell.bits(), cell.at()), (1 | 2 << 7 | 127 << 14, [1, 2, 127]));
        assert_eq!(Cell::from_bits(cell.bits()), Some(cell));
        assert_eq!(
            (Cell::from_bits(1 << 21), Cell::new([0, 128, 0]), Cell::new([0, 0, -1])),
            (None, None, None)
        );
        let back = Translation::new([-1, 0, -127]).unwrap();
        assert_eq!(back.bytes(), [255, 0, 129, 0]);
        assert_eq!(cell.moved(back).map(Cell::at), Some([0, 2, 0]));
        assert_eq!(cell.moved(Translation::new([0, 0, 1]).unwrap()), None);
        assert_eq!((Translation::new([128, 0, 0]), Translation::new([0, -128, 0])), (None, None));
    }

    #[test]
    fn sets_answer_for_each_translation_as_cells_do() {
        let corners: Vec<Cell> =
            (0..8).map(|i| Cell::new([0, 1, 2].map(|axis| 127 * (i >> axis & 1))).unwrap()).collect();
        let set = Cells::new(&corners);
        assert_eq!(set.in_order(), corners);
        let (count, rank) = set.ranks();
        let ranks: Vec<usize> = corners.iter().map(|corner| rank(Cells::place(*corner))).collect();
        assert_eq!((count, ranks), (8, (0..8).collect()));
        let steps = [-127, -126, -1, 0, 1, 126, 127];
        for cell in corners.iter().copied() {
            for by in steps.iter().flat_map(|&x| steps.iter().flat_map(move |&y| steps.map(|z| [x, y, z]))) {
                let by = Translation::new(by).unwrap();
                let found = set.contains(Cells::place(cell) + Cells::step(by));
                assert_eq!(found, cell.moved(by).is_some_and(|to| corners.contains(&to)), "{cell:?} {by:?}");
            }
        }
    }
}
