//! The translations that map most cells of a set to cells of the set.

use std::cmp::Reverse;

use rayon::prelude::*;
use rustfft::{Fft, FftPlanner, num_complex::Complex};

use crate::cell::{Cell, Translation};

/// Pairs that the direct histogram counts in the time that the transforms take for one element of their grid: 0.6 to 3
/// ns for a pair and 6 to 10 ns for an element, as measured on grids of different shapes.
const ADDITIONS: usize = 8;

/// Sorting pairs takes less time than filling and reading a histogram of more than this many times their number: 11 to
/// 14 ns for a pair, 1.3 ns for a number of the histogram, as measured.
const SPARSE: usize = 10;

/// How often each translation leads from one cell of a set to another: the set's autocorrelation.
///
/// A translation and its opposite are equally frequent, so only the half is kept whose last coordinate other than 0 is
/// positive.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Counts {
    /// One more than the largest coordinate of the cells.
    extent: [usize; 3],
    cells: usize,
    /// Of the translations that occur, in order: index, and how often. The index counts z from 0, y and x from
    /// `1 - extent`; x is the innermost.
    counts: Vec<(u32, u32)>,
}

impl Counts {
    /// The histogram of a set of cells, in their order.
    pub(crate) fn new(cells: &[Cell]) -> Self {
        if is_small(cells) { Self::direct(cells) } else { Self::fourier(cells) }
    }

    /// The counts of a whole histogram, by index.
    fn of(histogram: &[u32], cells: &[Cell]) -> Self {
        let counts =
            (0..).zip(histogram).filter(|&(_, &count)| count > 0).map(|(index, &count)| (index, count));
        Self { extent: extent(cells), cells: cells.len(), counts: counts.collect() }
    }

    /// The histogram by visiting all pairs.
    fn direct(cells: &[Cell]) -> Self {
        let extent = extent(cells);
        let [row, plane] = pitch(extent);
        let zero = (extent[1] - 1) * row + extent[0] - 1;
        let places: Vec<usize> = cells
            .iter()
            .map(|cell| {
                let [x, y, z] = cell.at().map(|part| part as usize);
                z * plane + y * row + x
            })
            .collect();
        let all = places
            .iter()
            .enumerate()
            .flat_map(|(index, from)| places[index + 1..].iter().map(move |to| (to + zero - from) as u32));
        let size = plane * extent[2];
        if SPARSE * cells.len() * cells.len() / 2 < size {
            let mut all: Vec<u32> = all.collect();
            all.sort_unstable();
            let counts = all.chunk_by(|a, b| a == b).map(|equal| (equal[0], equal.len() as u32)).collect();
            return Self { extent, cells: cells.len(), counts };
        }
        let mut histogram = vec![0; size];
        for index in all {
            histogram[index as usize] += 1;
        }
        Self::of(&histogram, cells)
    }

    /// The histogram by Fourier transforms: the autocorrelation is the inverse transform of the power spectrum. Zeros
    /// around the cells keep translations from wrapping round.
    ///
    /// Planes of zeros are neither stored nor transformed, nor is the half of the spectrum that mirrors the other.
    /// Double precision keeps the error of a count far below the half that rounding to integers allows.
    fn fourier(cells: &[Cell]) -> Self {
        let extent = extent(cells);
        let size = extent.map(|extent| transform_size(2 * extent - 1));
        let mut planner = FftPlanner::<f64>::new();
        let forward = size.map(|size| planner.plan_fft_forward(size));
        let inverse = size.map(|size| planner.plan_fft_inverse(size));
        let half = size[0] / 2 + 1;
        let plane_size = size[1] * half;
        let zero = Complex::new(0.0, 0.0);

        let mut spectrum = vec![zero; extent[2] * plane_size];
        let by_plane: Vec<&[Cell]> = (0..extent[2])
            .map(|z| {
                let begin = cells.partition_point(|cell| (cell.at()[2] as usize) < z);
                let end = cells.partition_point(|cell| cell.at()[2] as usize <= z);
                &cells[begin..end]
            })
            .collect();
        spectrum.par_chunks_mut(plane_size).zip(by_plane).for_each(|(plane, cells)| {
            let mut row = vec![zero; size[0]];
            for cells in cells.chunk_by(|a, b| a.at()[1] == b.at()[1]) {
                row.fill(zero);
                for cell in cells {
                    row[cell.at()[0] as usize].re = 1.0;
                }
                forward[0].process(&mut row);
                let y = cells[0].at()[1] as usize;
                plane[y * half..][..half].copy_from_slice(&row[..half]);
            }
            columns(plane, half, &*forward[1]);
        });

        // Along z, the power spectrum needs no more than the column itself: there and back again in one go.
        let mut by_row: Vec<Vec<&mut [Complex<f64>]>> = (0..size[1]).map(|_| Vec::new()).collect();
        for (index, row) in spectrum.chunks_mut(half).enumerate() {
            by_row[index % size[1]].push(row);
        }
        by_row.into_par_iter().for_each(|mut rows| {
            let mut column = vec![zero; size[2]];
            for x in 0..half {
                column.fill(zero);
                for (element, row) in column.iter_mut().zip(&rows) {
                    *element = row[x];
                }
                forward[2].process(&mut column);
                for element in &mut column {
                    *element = Complex::new(element.norm_sqr(), 0.0);
                }
                inverse[2].process(&mut column);
                for (element, row) in column.iter().zip(&mut rows) {
                    row[x] = *element;
                }
            }
        });

        let scale = 1.0 / size.iter().product::<usize>() as f64;
        let [row_pitch, plane_pitch] = pitch(extent);
        let [x0, y0, _] = extent.map(|extent| extent as i32 - 1);
        let mut histogram = vec![0; plane_pitch * extent[2]];
        let planes =
            spectrum.par_chunks_mut(plane_size).zip(histogram.par_chunks_mut(plane_pitch)).enumerate();
        planes.for_each(|(z, (plane, counts))| {
            columns(plane, half, &*inverse[1]);
            let mut row = vec![zero; size[0]];
            for (y, counts) in (-y0..).zip(counts.chunks_mut(row_pitch)) {
                let from = y.rem_euclid(size[1] as i32) as usize * half;
                row[..half].copy_from_slice(&plane[from..][..half]);
                for x in half..size[0] {
                    row[x] = row[size[0] - x].conj();
                }
                inverse[0].process(&mut row);
                for (x, count) in (-x0..).zip(counts) {
                    if (z as i32, y, x) > (0, 0, 0) {
                        *count = (row[x.rem_euclid(size[0] as i32) as usize].re * scale).round() as u32;
                    }
                }
            }
        });
        Self::of(&histogram, cells)
    }

    /// The most frequent translations with their counts, the most frequent first; of equally frequent ones the shorter,
    /// then the smaller by z, y, x. The first is no translation, which leads from each cell to itself.
    pub(crate) fn most_frequent(&self, most: usize) -> Vec<(Translation, u32)> {
        // No translation is rarer than this one if the frequent ones fill the palette.
        let mut with_count = vec![0_usize; self.cells + 1];
        for &(_, count) in &self.counts {
            with_count[count as usize] += 2;
        }
        let mut found = 1;
        let least = (1..=self.cells).rev().find(|&count| {
            found += with_count[count];
            found >= most
        });
        let least = least.unwrap_or(1) as u32;

        let [row, plane] = pitch(self.extent);
        let [x0, y0, _] = self.extent.map(|extent| extent as i32 - 1);
        let key = |count: u32, by: [i32; 3]| {
            let [x, y, z] = by;
            (Reverse(count), x * x + y * y + z * z, [z, y, x])
        };
        let mut keys = vec![key(self.cells as u32, [0; 3])];
        for &(index, count) in self.counts.iter().filter(|&&(_, count)| count >= least) {
            let index = index as usize;
            let [x, y, z] = [index % row, index % plane / row, index / plane].map(|part| part as i32);
            let by = [x - x0, y - y0, z];
            keys.extend([key(count, by), key(count, by.map(|part| -part))]);
        }
        if keys.len() > most {
            keys.select_nth_unstable(most);
            keys.truncate(most);
        }
        keys.sort_unstable();
        let translation = |[z, y, x]: [i32; 3]| Translation::new([x, y, z]).expect("between cells of a grid");
        keys.into_iter().map(|(Reverse(count), _, by)| (translation(by), count)).collect()
    }
}

/// Whether visiting all pairs of a set takes less time than the transform.
pub(crate) fn is_small(cells: &[Cell]) -> bool {
    let elements: usize = extent(cells).iter().map(|&extent| transform_size(2 * extent - 1)).product();
    cells.len() * cells.len() / 2 <= ADDITIONS * elements
}

/// One more than the largest coordinate of cells along each axis.
fn extent(cells: &[Cell]) -> [usize; 3] {
    cells
        .iter()
        .fold([1; 3], |extent, cell| [0, 1, 2].map(|axis| extent[axis].max(cell.at()[axis] as usize + 1)))
}

/// The differences of index from a row, and from a plane, of the histogram to the next.
fn pitch(extent: [usize; 3]) -> [usize; 2] {
    let [x, y, _] = extent;
    [2 * x - 1, (2 * x - 1) * (2 * y - 1)]
}

/// The least size of at least this one whose only factors are 2 and 3, for which transforms are fast.
fn transform_size(least: usize) -> usize {
    let only_small_factors = |mut size: usize| {
        for factor in [2, 3] {
            while size.is_multiple_of(factor) {
                size /= factor;
            }
        }
        size == 1
    };
    (least..).find(|&size| only_small_factors(size)).expect("a power of two")
}

/// Transforms the columns of a plane in rows of `width`. Four columns at a time share the cache lines that they are on.
fn columns(plane: &mut [Complex<f64>], width: usize, transform: &dyn Fft<f64>) {
    const TOGETHER: usize = 4;
    let height = transform.len();
    let mut together = vec![Complex::new(0.0, 0.0); TOGETHER * height];
    let mut scratch = vec![Complex::new(0.0, 0.0); transform.get_inplace_scratch_len()];
    for begin in (0..width).step_by(TOGETHER) {
        let columns = TOGETHER.min(width - begin);
        for (y, row) in plane.chunks(width).enumerate() {
            for (x, element) in row[begin..begin + columns].iter().enumerate() {
                together[x * height + y] = *element;
            }
        }
        transform.process_with_scratch(&mut together[..columns * height], &mut scratch);
        for (y, row) in plane.chunks_mut(width).enumerate() {
            for (x, element) in row[begin..begin + columns].iter_mut().enumerate() {
                *element = together[x * height + y];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, patch, repeats, scatter};

    /// {0, 1, 3} along each axis: three translations of each length to 3, once each, and three cells that stay.
    #[test]
    fn counts_of_the_hand_worked_row() {
        for axis in 0..3 {
            let mut cells = [0, 1, 3].map(|at| {
                let mut place = [0; 3];
                place[axis] = at;
                Cell::new(place).unwrap()
            });
            cells.sort();
            for counts in [Counts::direct(&cells), Counts::fourier(&cells)] {
                let palette = counts.most_frequent(256);
                let steps: Vec<_> = palette.iter().map(|(by, count)| (by.by()[axis], *count)).collect();
                assert_eq!(steps, [(0, 3), (-1, 1), (1, 1), (-2, 1), (2, 1), (-3, 1), (3, 1)]);
                assert_eq!(counts.most_frequent(3), palette[..3]);
            }
        }
    }

    #[test]
    fn transforms_and_pairs_count_the_same() {
        let mut random = Random(7);
        for round in 0..40 {
            // Boxes of all shapes, from a single cell to the whole grid, sparse and dense.
            let extent = [0; 3].map(|_| 1 + random.below(1 << (1 + round % 7)));
            let count = 1 + random.below(600) as usize;
            let cells = random.cells(count, extent);
            assert_eq!(Counts::direct(&cells), Counts::fourier(&cells), "{extent:?} {}", cells.len());
        }
        let full = random.cells(40_000, [32; 3]);
        assert_eq!(Counts::direct(&full), Counts::fourier(&full));
    }

    /// Found by `reference/vts.py`, an independent program, on the same cells.
    #[test]
    fn palettes_are_those_of_the_reference() {
        let short = |cells: &[Cell]| {
            let palette = Counts::new(cells).most_frequent(256);
            let sum: u32 = palette.iter().map(|(_, count)| count).sum();
            (palette[1], palette[255], sum)
        };
        let entry = |by, count| (Translation::new(by).unwrap(), count);
        let found = [patch(), scatter(), repeats()].map(|cells| short(&cells));
        let expected = [
            (entry([1, -1, 0], 11_738), entry([-11, 6, -1], 4801), 1_603_017),
            (entry([1, -8, 0], 15), entry([14, 20, -3], 10), 5715),
            (entry([-26, -9, -1], 61), entry([-1, 0, 0], 9), 6105),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn sizes_have_small_factors() {
        assert_eq!([1, 5, 7, 13, 97, 129, 217, 255].map(transform_size), [1, 6, 8, 16, 108, 144, 243, 256]);
    }
}
