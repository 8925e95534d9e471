//! Which pixels have something clearly nearer around them: the first question of both culls, and cheap enough to ask
//! everywhere. Most of an image is smooth, so few pixels need to be looked at closely.

use std::ops::Range;

/// Pixels around one in each direction; those along an axis, itself included.
const REACH: usize = 2;
const SPAN: usize = 2 * REACH + 1;

/// Rows that one task goes through: the first has to look at two rows before it as well.
pub const BAND: usize = 32;

/// Pixels of a row that are looked at together.
const BLOCK: usize = 64;

/// The lesser distance, as the processor's minimum has it.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Calls `each` with column and row of the pixels of some rows whose distance is finite and more than `scale` times the
/// least distance of the 5x5 pixels around. `distances` writes those of a stretch of pixels, counted row by row, infinite
/// where there is nothing.
#[inline(always)]
pub fn where_nearer(
    [width, height]: [usize; 2],
    rows: Range<usize>,
    scale: f32,
    distances: impl Fn(Range<usize>, &mut [f32]),
    mut each: impl FnMut(usize, usize),
) {
    for left in (0..width).step_by(BLOCK) {
        // The least distances of the SPAN pixels around each of a block, in row y - REACH of the image, which may lie outside.
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
        // That of y at y modulo SPAN.
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
            // Apart from the calls, and so several at a time: which pixels hold nothing is random.
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
