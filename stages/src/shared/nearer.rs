//! Which pixels have something clearly nearer around them: the first test of both culls, cheap enough to run
//! everywhere. Most of an image is smooth, so few pixels need more tests.

use std::ops::Range;

/// Radius and width of the neighbourhood, in pixels.
const REACH: usize = 2;
const SPAN: usize = 2 * REACH + 1;

/// Rows per parallel task: the first row also needs the two rows before it.
pub const BAND: usize = 32;

/// Pixels of a row that are processed together.
const BLOCK: usize = 64;

/// The smaller distance; compiles to the processor's minimum.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Calls `each` with column and row of the pixels of some rows whose distance is finite and more than `scale` times the
/// smallest distance of the 5x5 pixels around. `distances` writes those of a range of pixels, indexed row by row,
/// infinite for empty ones.
#[inline(always)]
pub fn where_nearer(
    [width, height]: [usize; 2],
    rows: Range<usize>,
    scale: f32,
    distances: impl Fn(Range<usize>, &mut [f32]),
    mut each: impl FnMut(usize, usize),
) {
    for left in (0..width).step_by(BLOCK) {
        // The smallest distances of the SPAN pixels around each of a block, in row y - REACH of the image, which may be
        // outside.
        let nearest_of_row = |y: usize| {
            let mut row = [f32::INFINITY; BLOCK + 2 * REACH];
            if (REACH..height + REACH).contains(&y) {
                let (from, to) = (left.saturating_sub(REACH), (left + BLOCK + REACH).min(width));
                let start = (y - REACH) * width;
                distances(start + from..start + to, &mut row[from + REACH - left..to + REACH - left]);
            }
            let mut nearest = [f32::INFINITY; BLOCK];
            for dx in 0..SPAN {
                let row = &row[dx..dx + BLOCK];
                nearest.iter_mut().zip(row).for_each(|(nearest, z)| *nearest = lesser(*z, *nearest));
            }
            nearest
        };
        // Row y is at index y modulo SPAN.
        let mut nearest_of_rows = [[f32::INFINITY; BLOCK]; SPAN];
        for y in rows.start..rows.start + 2 * REACH {
            nearest_of_rows[y % SPAN] = nearest_of_row(y);
        }
        let count = BLOCK.min(width - left);
        for y in rows.clone() {
            nearest_of_rows[(y + 2 * REACH) % SPAN] = nearest_of_row(y + 2 * REACH);
            let mut nearest = [f32::INFINITY; BLOCK];
            for row in &nearest_of_rows {
                nearest.iter_mut().zip(row).for_each(|(nearest, z)| *nearest = lesser(*z, *nearest));
            }
            let mut own = [f32::INFINITY; BLOCK];
            distances(y * width + left..y * width + left + count, &mut own[..count]);
            // Separate from the calls, so that several are processed at a time: which pixels are empty is random.
            let mut is_farther = [false; BLOCK];
            for ((is_farther, own), nearest) in is_farther.iter_mut().zip(&own).zip(&nearest) {
                *is_farther = (nearest * scale < *own) & (*own < f32::INFINITY);
            }
            for i in (0..count).filter(|i| is_farther[*i]) {
                each(left + i, y);
            }
        }
    }
}
