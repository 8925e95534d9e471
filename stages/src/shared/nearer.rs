//! Which pixels have something clearly nearer around them: the first test of both culls, cheap enough to run
//! everywhere. Most of an image is smooth, so few pixels need more tests; these run in lanes, for neighbours together.

use std::ops::Range;

use super::lanes::LANES;

/// Radius of the neighbourhood, in pixels.
pub const REACH: usize = 2;
/// Its width.
pub const SPAN: usize = 2 * REACH + 1;

/// Rows per parallel task: the first row also needs the two rows before it.
pub const BAND: usize = 32;

/// Pixels of a row that are processed together.
const BLOCK: usize = 64;

/// The smaller distance, as [`lanes::lesser`](super::lanes::lesser); compiles to the processor's minimum.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The smallest distances of the [`SPAN`] pixels around each of a block that begins at column `left`, in a row of the image.
#[inline(always)]
fn nearest_of_row(
    width: usize,
    left: usize,
    y: usize,
    distances: &impl Fn(Range<usize>, &mut [f32]),
) -> [f32; BLOCK] {
    let mut row = [f32::INFINITY; BLOCK + 2 * REACH];
    let (from, to) = (left.saturating_sub(REACH), (left + BLOCK + REACH).min(width));
    distances(y * width + from..y * width + to, &mut row[from + REACH - left..to + REACH - left]);
    let mut nearest = [f32::INFINITY; BLOCK];
    for dx in 0..SPAN {
        let row = &row[dx..dx + BLOCK];
        nearest.iter_mut().zip(row).for_each(|(nearest, z)| *nearest = lesser(*z, *nearest));
    }
    nearest
}

/// Finds the pixels of some rows whose distance is finite and more than `scale` times the smallest distance of the 5x5
/// pixels around. Calls `each` with column and row of the first of [`LANES`] pixels and the bits of those that are such, if any is.
/// `distances` writes those of a range of pixels, indexed row by row, infinite for empty ones.
#[inline(always)]
pub fn where_nearer(
    [width, height]: [usize; 2],
    rows: Range<usize>,
    scale: f32,
    distances: impl Fn(Range<usize>, &mut [f32]),
    mut each: impl FnMut(usize, usize, u8),
) {
    for left in (0..width).step_by(BLOCK) {
        // Row `last` - REACH of the image, which may be outside, is at index `last` modulo SPAN.
        let mut nearest_of_rows = [[f32::INFINITY; BLOCK]; SPAN];
        let count = BLOCK.min(width - left);
        for last in rows.start..rows.end + 2 * REACH {
            nearest_of_rows[last % SPAN] = if (REACH..height + REACH).contains(&last) {
                nearest_of_row(width, left, last - REACH, &distances)
            } else {
                [f32::INFINITY; BLOCK]
            };
            if last < rows.start + 2 * REACH {
                continue;
            }
            // The row around which all are now there.
            let y = last - 2 * REACH;
            let mut nearest = [f32::INFINITY; BLOCK];
            for row in &nearest_of_rows {
                nearest.iter_mut().zip(row).for_each(|(nearest, z)| *nearest = lesser(*z, *nearest));
            }
            let mut own = [f32::INFINITY; BLOCK];
            distances(y * width + left..y * width + left + count, &mut own[..count]);
            // Separate from the calls, so that several are processed at a time: which pixels are empty is random.
            let mut is_farther = [0u8; BLOCK];
            for (i, ((is_farther, own), nearest)) in is_farther.iter_mut().zip(&own).zip(&nearest).enumerate()
            {
                *is_farther = u8::from((nearest * scale < *own) & (*own < f32::INFINITY)) << (i % LANES);
            }
            for (group, is_farther) in is_farther.as_chunks::<LANES>().0.iter().enumerate() {
                if u64::from_ne_bytes(*is_farther) != 0 {
                    let bits = is_farther.iter().fold(0, |bits, bit| bits | bit);
                    each(left + group * LANES, y, bits);
                }
            }
        }
    }
}

/// Finds the pixels of some rows with one in their 5x5 pixels at which two images differ, and some others: calls `each` with
/// column and row of the first of [`LANES`] pixels.
///
/// A pass of a cull judges a point by the points around. If the pass before has left these as they were, it has judged
/// the point by the same ones, and the judgement stays. So only where that pass dropped something there is anything to do.
#[inline(always)]
pub fn where_changed(
    [width, height]: [usize; 2],
    rows: Range<usize>,
    before: &[u32],
    after: &[u32],
    mut each: impl FnMut(usize, usize),
) {
    for left in (0..width).step_by(BLOCK) {
        // Which groups of row `last` - REACH are near a change in that row; at index `last` modulo SPAN.
        let mut groups_of_rows = [0; SPAN];
        for last in rows.start..rows.end + 2 * REACH {
            groups_of_rows[last % SPAN] = if (REACH..height + REACH).contains(&last) {
                changed_groups(width, left, last - REACH, before, after)
            } else {
                0
            };
            if last < rows.start + 2 * REACH {
                continue;
            }
            let mut groups = groups_of_rows.iter().fold(0, |all, groups| all | groups);
            while groups != 0 {
                each(left + groups.trailing_zeros() as usize * LANES, last - 2 * REACH);
                groups &= groups - 1;
            }
        }
    }
}

/// A bit for each group of [`LANES`] pixels in the block that begins at column `left` of a row: whether the group or one beside
/// it differs in two images.
#[inline(always)]
fn changed_groups(width: usize, left: usize, y: usize, before: &[u32], after: &[u32]) -> u32 {
    let columns = left.saturating_sub(LANES)..(left + BLOCK + LANES).min(width);
    let pixels = y * width + columns.start..y * width + columns.end;
    let (before, after) = (&before[pixels.clone()], &after[pixels]);
    // Most rows of a block are as before.
    if before == after {
        return 0;
    }
    // From the group beside the block on, where there is one.
    let first = (left - columns.start) / LANES;
    let groups = before.chunks(LANES).zip(after.chunks(LANES)).enumerate();
    let differs =
        groups.fold(0u32, |bits, (group, (before, after))| bits | u32::from(before != after) << group);
    let near = differs << 1 | differs | differs >> 1;
    let inside = (width - left).div_ceil(LANES).min(BLOCK / LANES);
    near >> first & ((1 << inside) - 1)
}

/// Whether all 5x5 pixels around each of [`LANES`] pixels, of which the first is at (x, y), are in the image.
#[inline(always)]
pub fn is_inside([width, height]: [usize; 2], x: usize, y: usize) -> bool {
    (REACH..).contains(&x) && x + LANES + REACH <= width && (REACH..).contains(&y) && y + REACH < height
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::testing::Random;

    #[test]
    fn changes_are_found_from_all_pixels_around() {
        let mut random = Random(7);
        for [width, height] in [[1, 1], [7, 3], [8, 40], [63, 5], [64, 9], [65, 33], [150, 70]] {
            for changes in [0, 1, 2, 9] {
                let before = vec![5; width * height];
                let mut after = before.clone();
                (0..changes).for_each(|_| after[random.below((width * height) as u32) as usize] = 6);
                let is_changed = |x: usize, y: usize| before[y * width + x] != after[y * width + x];
                let changed_within = |[x, y]: [usize; 2], aside: usize| {
                    let rows = y.saturating_sub(REACH)..(y + REACH + 1).min(height);
                    let columns = x.saturating_sub(aside)..(x + aside + 1).min(width);
                    rows.into_iter().any(|y| columns.clone().any(|x| is_changed(x, y)))
                };
                let mut found = vec![0; width * height];
                for top in (0..height).step_by(BAND) {
                    let rows = top..(top + BAND).min(height);
                    where_changed([width, height], rows, &before, &after, |x, y| {
                        assert!(x.is_multiple_of(LANES));
                        (x..width.min(x + LANES)).for_each(|x| found[y * width + x] += 1);
                    });
                }
                for (at, found) in found.into_iter().enumerate() {
                    let pixel = [at % width, at / width];
                    let (least, most) = (changed_within(pixel, REACH), changed_within(pixel, 2 * LANES - 1));
                    assert!(found <= 1 && (found == 1 || !least) && (found == 0 || most), "{pixel:?}");
                }
            }
        }
    }
}
