//! Gives a colour to pixels that reach no sample: at the start, where something comes into view, and with the smallest
//! budgets (`algorithms.md` sections 2.10 and 11.2).
//!
//! First colours spread: in each step, a hole takes the mean colour of those of its eight neighbours that have one and
//! whose primary region joins its own, so no colour crosses an edge. Steps come in rounds of eight; a round is a single
//! GPU pass, which performs all its steps on tiles that overlap by eight pixels; its list skips tiles without holes
//! that any neighbour joins. The result equals that of single steps.
//!
//! What remains are regions without any sample: enclosed by edges, or too far away for the number of steps. Each hole
//! takes the mean of the smallest square around it that holds colours: 3, 5, 9 or 17 pixels wide, then aligned blocks
//! of 16, 32, 64 and so on. It is a cheap relative of push-pull, without smoothing: only specks need it.

use epigraph_core::{
    CpuContext, Extent, Finding, In, Io, Out, Rule, Site, Stage, Threads, choice, constants, params, scratch,
    texel,
};
use fearless_simd::{Simd, dispatch, f32x8, mask32x8, prelude::*};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{JOINS, RADIANCE},
    shared::{edge_pixel::DIRECTIONS, lanes::LANES},
};

#[path = "explain/spread.rs"]
mod explain;

constants! {
    /// Pixels on each side of a tile, which is the smallest of the aligned blocks.
    const TILE: usize = 16;
    /// Steps per round.
    const ROUND: u32 = 8;
    /// What `filled` holds for holes; otherwise the round in which a hole was filled, 0 for pixels that were not holes.
    const HOLE: u32 = u32::MAX;
}

/// Pixels per GPU thread in a round, if all were holes. More would leave cores idle at the start, when most are; fewer
/// would start threads for nothing later, when only a few are.
const PIXELS_PER_THREAD: u32 = 8;

/// Terminates the list of a row's holes.
const END: u32 = u32::MAX;

/// Pixels to each side of the squares around a hole.
const SQUARES: [usize; 4] = [1, 2, 4, 8];

/// Holes per parallel task.
const CHUNK: usize = 512;

/// Holes whose colours are found before they are assigned.
const PART: usize = 8 * CHUNK;

choice! {
    /// How holes are filled.
    pub enum Method {
        /// From what joins them, step by step; the remaining ones like `PushPull`.
        Spread,
        /// From what is around them, across edges too.
        PushPull,
        /// Not at all: they stay black, with alpha 0.
        Off,
    }
}

params! {
    /// Parameters of [`Spread`].
    pub struct SpreadParams {
        /// How holes are filled.
        method: Method = Method::Spread;
        /// How far colours spread, in rounds of eight steps.
        rounds: u32 = 8, in 1..=64;
    }
}

/// See the module.
pub struct Spread {
    primary: In<texel::Rgba32Float>,
    n8: In<u32>,
    color: Out<texel::Rgba32Float>,
    pyramid: Out<[f32; 4]>,
    found: Out<[f32; 4]>,
    filled: Out<u32>,
}

impl Stage for Spread {
    const KIND: &'static str = "spread";
    const DOC: &'static str = "Fills pixels that no sample reached, without crossing edges.";
    type Params = SpreadParams;

    fn declare(params: &SpreadParams, io: &mut Io) -> Self {
        io.column(column::I2);
        io.per_view();
        let pixels = || Extent::Frame(1);
        let primary =
            io.read("primary", RADIANCE.doc("Linear radiance, not negative; alpha 0 in holes."), pixels());
        let n8 = io.read("n8", JOINS, pixels());
        let color = io.write(
            "color",
            RADIANCE.doc("Linear radiance; alpha 1, or 0 where no colour was found."),
            pixels(),
        );
        let pyramid = io.write(
            "pyramid",
            scratch(
                "Sums and numbers of colours, of tiles of 16x16 pixels, then of blocks of 2x2, 4x4 ... tiles.",
            ),
            // A quarter of that would do, but for what rounding adds to images of a few tiles.
            Extent::Frame(TILE as u32 / 4),
        );
        const ANYTHING: &[Rule] = &[Rule::any()];
        let colors = RADIANCE.doc("The colours that holes took.").scratch().within(ANYTHING);
        let found = io.write("found", colors, pixels());
        // The twin keeps a list of holes there instead of colours, four to an element.
        io.extent_on_cpu(found, Extent::Frame(2));
        let filled = io.write(
            "filled",
            "The round in which a hole was filled, 0xFFFFFFFF if in none; 0: no hole.",
            pixels(),
        );
        let tiles = || Extent::Frame(TILE as u32);
        io.write::<[u32; 2]>(
            "tiles",
            scratch("Holes of each tile that may be filled, and rounds done."),
            tiles(),
        );
        io.write::<[u32; 2]>(
            "open_tiles",
            scratch("Tiles with such holes at the start, in any order."),
            tiles(),
        );
        io.write::<u32>("open_count", scratch("The number of these tiles."), Extent::Fixed([1, 1]));
        io.shader(shader!("spread"));
        io.constants(CONSTANTS);
        match params.method {
            Method::Off => io.dispatch("copy", color),
            Method::PushPull | Method::Spread => {
                io.compute("clear", Threads::Groups(1));
                io.dispatch("prepare", color);
                if params.method == Method::Spread {
                    let threads = Threads::Blocks(color.into(), PIXELS_PER_THREAD);
                    (0..params.rounds).for_each(|_| io.compute("spread", threads));
                }
                io.compute("pull", Threads::Groups(1));
                io.dispatch("push", color);
            }
        }
        Self { primary, n8, color, pyramid, found, filled }
    }

    fn cpu(&self, params: &SpreadParams, cx: &CpuContext) -> Result<(), String> {
        let (width, height) = (cx.dims(self.color).width as usize, cx.dims(self.color).height as usize);
        let (primary, n8) = (&cx.read(self.primary)[..], &cx.read(self.n8)[..]);
        let (color, filled) = (&mut cx.write(self.color)[..], &mut cx.write(self.filled)[..]);
        let mut memory = cx.write(self.found);
        let list: &mut [u32] = &mut bytemuck::cast_slice_mut(&mut memory)[..width * height];

        let level = cx.level();
        let rows =
            color.par_chunks_mut(width).zip(filled.par_chunks_mut(width)).zip(primary.par_chunks(width));
        let has_holes = rows.map(
            |((color, filled), primary)| dispatch!(level, simd => find_holes(simd, primary, color, filled)),
        );
        if !has_holes.reduce(|| false, |a, b| a | b) || params.method == Method::Off {
            return Ok(());
        }

        let mut image = Image { color, width, height };
        let mut found: Found = [[0.0; 4]; PART];
        if params.method == Method::Spread {
            image.spread(n8, filled, params.rounds, list, &mut found);
        }
        let left = list_holes(list, width, filled, |_| true);
        if left > 0 {
            let mut sums = cx.write(self.pyramid);
            let mut pyramid = Pyramid::new(&mut sums, width, height);
            if pyramid.pull(&image) {
                image.fill(&list[..left], &mut found, |image, hole| image.mean_around(&pyramid, hole));
            }
        }
        Ok(())
    }

    fn explain(&self, params: &SpreadParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params, site)
    }
}

/// Copies colours, marks the pixels without one, and tells whether there is any.
#[inline(always)]
fn find_holes<S: Simd>(simd: S, primary: &[[f32; 4]], color: &mut [[f32; 4]], filled: &mut [u32]) -> bool {
    let (groups, last) = primary.as_chunks::<LANES>();
    let (colors, last_color) = color.as_chunks_mut::<LANES>();
    let (marks, last_marks) = filled.as_chunks_mut::<LANES>();
    let mut has_holes = false;
    // A vector holds two pixels; these are their alphas.
    const ALPHAS: u64 = 0x88;
    let is_alpha = mask32x8::from_bitmask(simd, ALPHAS);
    let [zero, one] = [0.0, 1.0].map(|number| f32x8::splat(simd, number));
    for ((primary, color), filled) in groups.iter().zip(colors).zip(marks) {
        let mut holes = 0;
        let (pairs, _) = primary.as_flattened().as_chunks::<LANES>();
        let (to, _) = color.as_flattened_mut().as_chunks_mut::<LANES>();
        for (pair, to) in pairs.iter().zip(to) {
            let pair = f32x8::load_array_ref(simd, pair);
            holes |= pair.simd_le(zero).to_bitmask();
            is_alpha.select(one, pair).store_array(to);
        }
        *filled = [0; LANES];
        // Most groups have no hole.
        if holes & ALPHAS != 0 {
            has_holes = true;
            mark_holes(primary, color, filled);
        }
    }
    has_holes | mark_holes(last, last_color, last_marks)
}

/// [`find_holes`], one pixel at a time.
fn mark_holes(primary: &[[f32; 4]], color: &mut [[f32; 4]], filled: &mut [u32]) -> bool {
    let mut has_holes = false;
    for ((&[r, g, b, alpha], color), filled) in primary.iter().zip(color).zip(filled) {
        let is_hole = alpha <= 0.0;
        *color = if is_hole { [0.0; 4] } else { [r, g, b, 1.0] };
        *filled = if is_hole { HOLE } else { 0 };
        has_holes |= is_hole;
    }
    has_holes
}

/// Lists the holes for which `wanted` holds, in order; returns their number. There must be room for all pixels.
fn list_holes(
    list: &mut [u32],
    width: usize,
    filled: &[u32],
    wanted: impl Fn(usize) -> bool + Sync,
) -> usize {
    // Each row lists its own in its own place; then the lists are compacted.
    list.par_chunks_mut(width).zip(filled.par_chunks(width)).enumerate().for_each(|(y, (row, filled))| {
        let mut count = 0;
        for (block, filled) in filled.chunks(TILE).enumerate() {
            // Most blocks have no hole. A hole has all bits set, so the union of a block's values shows whether it has
            // any.
            if filled.iter().fold(0, |bits, filled| bits | filled) != HOLE {
                continue;
            }
            for (p, &filled) in (y * width + block * TILE..).zip(filled) {
                if filled == HOLE && wanted(p) {
                    row[count] = p as u32;
                    count += 1;
                }
            }
        }
        if let Some(next) = row.get_mut(count) {
            *next = END;
        }
    });
    let mut count = 0;
    for row in (0..list.len()).step_by(width) {
        for at in row..row + width {
            if list[at] == END {
                break;
            }
            list[count] = list[at];
            count += 1;
        }
    }
    count
}

/// The colours of holes until they are assigned.
type Found = [[f32; 4]; PART];

/// Colours with alpha 1, or zeros: an alpha of 0 or less marks a hole.
struct Image<'a> {
    color: &'a mut [[f32; 4]],
    width: usize,
    height: usize,
}

impl Image<'_> {
    /// Spreads colours into the holes, in this many rounds.
    fn spread(&mut self, n8: &[u32], filled: &mut [u32], rounds: u32, list: &mut [u32], found: &mut Found) {
        // The holes next to colours: those that the coming step fills. Each step appends those of the next one; none is
        // listed twice, so there is room.
        let is_next_to_color = |p| self.joined(n8, p).any(|q| self.color[q][3] > 0.0);
        let mut front = 0..list_holes(list, self.width, filled, is_next_to_color);
        for step in 0..rounds * ROUND {
            if front.is_empty() {
                break;
            }
            let mean_joined = |image: &Self, hole| mean(image.joined(n8, hole).map(|p| image.color[p]));
            self.fill(&list[front.clone()], found, mean_joined);
            let mut end = front.end;
            for at in front.clone() {
                let hole = list[at] as usize;
                filled[hole] = step / ROUND + 1;
                for p in joined(self.width, self.height, n8, hole) {
                    if self.color[p][3] == 0.0 {
                        // Listed, but still without a colour.
                        self.color[p][3] = -1.0;
                        list[end] = p as u32;
                        end += 1;
                    }
                }
            }
            front = front.end..end;
        }
        // Holes that the last step has listed stay holes.
        list[front].iter().for_each(|&hole| self.color[hole as usize][3] = 0.0);
    }

    /// Assigns colours to holes, each from the image without the others. There must be one for each.
    fn fill(&mut self, holes: &[u32], found: &mut Found, color: impl Fn(&Self, usize) -> [f32; 4] + Sync) {
        for part in holes.chunks(PART) {
            found[..part.len()].par_iter_mut().zip(part).with_min_len(CHUNK).for_each(|(found, &hole)| {
                *found = color(self, hole as usize);
            });
            // They count as holes until all have their colours.
            for (&[r, g, b, _], &hole) in found.iter().zip(part) {
                self.color[hole as usize] = [r, g, b, -1.0];
            }
        }
        holes.iter().for_each(|&hole| self.color[hole as usize][3] = 1.0);
    }

    fn joined(&self, n8: &[u32], p: usize) -> impl Iterator<Item = usize> {
        joined(self.width, self.height, n8, p)
    }

    /// The mean of the smallest square around a hole that holds colours.
    fn mean_around(&self, pyramid: &Pyramid, hole: usize) -> [f32; 4] {
        let (x, y) = (hole % self.width, hole / self.width);
        for reach in SQUARES {
            let columns = x.saturating_sub(reach)..(x + reach + 1).min(self.width);
            let rows = y.saturating_sub(reach)..(y + reach + 1).min(self.height);
            let found = mean(rows.flat_map(|y| &self.color[y * self.width..][columns.clone()]).copied());
            if found[3] > 0.0 {
                return found;
            }
        }
        over(pyramid.smallest(x / TILE, y / TILE))
    }
}

/// The neighbours whose primary region joins that of pixel `p`.
fn joined(width: usize, height: usize, n8: &[u32], p: usize) -> impl Iterator<Item = usize> {
    let (x, y, word) = (p % width, p / width, n8[p]);
    (0..8).filter(move |d| word >> (4 * d) & 1 != 0).filter_map(move |d| {
        let [dx, dy] = DIRECTIONS[d];
        let (x, y) = (x.checked_add_signed(dx as isize)?, y.checked_add_signed(dy as isize)?);
        (x < width && y < height).then_some(y * width + x)
    })
}

/// The mean of those colours that are not holes; a hole if all are.
fn mean(colors: impl Iterator<Item = [f32; 4]>) -> [f32; 4] {
    let mut sum = [0.0; 4];
    colors.filter(|color| color[3] > 0.0).for_each(|color| add(&mut sum, color));
    over(sum)
}

fn add(sum: &mut [f32; 4], color: [f32; 4]) {
    (0..4).for_each(|channel| sum[channel] += color[channel]);
}

/// The mean of a sum of colours; zeros if it is empty.
fn over([r, g, b, count]: [f32; 4]) -> [f32; 4] {
    if count > 0.0 { [r / count, g / count, b / count, 1.0] } else { [0.0; 4] }
}

/// Sums of colours and their number: for tiles, then for blocks of 2x2, of 4x4 tiles and so on, up to the whole image.
struct Pyramid<'a> {
    sums: &'a mut [[f32; 4]],
    /// Size of the finest level, in tiles.
    width: usize,
    height: usize,
}

impl<'a> Pyramid<'a> {
    /// For an image of this size in pixels.
    fn new(sums: &'a mut [[f32; 4]], width: usize, height: usize) -> Self {
        Self { sums, width: width.div_ceil(TILE), height: height.div_ceil(TILE) }
    }

    /// Sums an image; returns whether it contains any colour.
    fn pull(&mut self, image: &Image) -> bool {
        let (mut width, mut height) = (self.width, self.height);
        let (tiles, mut coarser) = self.sums.split_at_mut(width * height);
        tiles.par_chunks_mut(width).enumerate().for_each(|(tile_y, tiles)| {
            for (tile_x, tile) in tiles.iter_mut().enumerate() {
                *tile = [0.0; 4];
                for y in tile_y * TILE..((tile_y + 1) * TILE).min(image.height) {
                    let row = &image.color[y * image.width..][..image.width];
                    let mut sum = [0.0; 4];
                    row.iter().skip(tile_x * TILE).take(TILE).for_each(|&color| add(&mut sum, color));
                    add(tile, sum);
                }
            }
        });
        let mut finer = tiles;
        while width * height > 1 {
            let (blocks_x, blocks_y) = (width.div_ceil(2), height.div_ceil(2));
            let (blocks, rest) = coarser.split_at_mut(blocks_x * blocks_y);
            for (i, block) in blocks.iter_mut().enumerate() {
                let (left, top) = (i % blocks_x * 2, i / blocks_x * 2);
                *block = [0.0; 4];
                for y in top..(top + 2).min(height) {
                    (left..(left + 2).min(width)).for_each(|x| add(block, finer[y * width + x]));
                }
            }
            (finer, coarser) = (blocks, rest);
            (width, height) = (blocks_x, blocks_y);
        }
        finer[0][3] > 0.0
    }

    /// The sum of the smallest block around a tile that holds colours.
    fn smallest(&self, mut x: usize, mut y: usize) -> [f32; 4] {
        let (mut first, mut width, mut height) = (0, self.width, self.height);
        loop {
            let sum = self.sums[first + y * width + x];
            if sum[3] > 0.0 || width * height == 1 {
                return sum;
            }
            first += width * height;
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            (x, y) = (x / 2, y / 2);
        }
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Harness;

    use super::*;
    use crate::shared::testing::{Random, run_alike, run_both, settings};

    const NONE: [f32; 4] = [0.0; 4];
    const RED: [f32; 4] = [1.0, 0.0, 0.0, 0.5];
    const BLUE: [f32; 4] = [0.0, 0.0, 1.0, 0.01];

    fn params(method: Method, rounds: u32) -> SpreadParams {
        SpreadParams { method, rounds }
    }

    fn harness(params: SpreadParams, size: [u32; 2], color: &[[f32; 4]], n8: &[u32]) -> Harness<Spread> {
        let mut harness = Harness::new(params, &settings(size, 0));
        harness.set("primary", color);
        harness.set("n8", n8);
        harness
    }

    /// N8 in which two neighbours are joined if `open` returns true. It is called once for each pair.
    fn reach(size: [u32; 2], mut open: impl FnMut([usize; 2], [usize; 2]) -> bool) -> Vec<u32> {
        let [width, height] = size.map(|side| side as usize);
        let mut n8 = vec![0; width * height];
        for p in 0..width * height {
            for (d, [dx, dy]) in DIRECTIONS.into_iter().take(4).enumerate() {
                let (x, y) = (p as i32 % size[0] as i32 + dx, p as i32 / size[0] as i32 + dy);
                if (0..size[0] as i32).contains(&x) && (0..size[1] as i32).contains(&y) {
                    let q = (x + y * size[0] as i32) as usize;
                    if open([p % width, p / width], [q % width, q / width]) {
                        n8[p] |= 1 << (4 * d);
                        n8[q] |= 1 << (4 * (d + 4));
                    }
                }
            }
        }
        n8
    }

    /// Spreads colours by definition: `count` times, every hole takes the mean of the colours that it is joined to.
    fn steps(size: [u32; 2], color: &[[f32; 4]], n8: &[u32], count: u32) -> Vec<[f32; 4]> {
        let [width, height] = size.map(|side| side as usize);
        let opaque = |&[r, g, b, a]: &[f32; 4]| if a > 0.0 { [r, g, b, 1.0] } else { NONE };
        let mut color: Vec<_> = color.iter().map(opaque).collect();
        for _ in 0..count {
            let before = color.clone();
            for (p, color) in color.iter_mut().enumerate().filter(|(_, color)| color[3] == 0.0) {
                *color = mean(joined(width, height, n8, p).map(|q| before[q]));
            }
        }
        color
    }

    #[test]
    fn a_round_is_eight_steps() {
        // A row of pixels of which the first is red: each step fills one more pixel.
        let size = [200, 1];
        let mut color = [NONE; 200];
        color[0] = RED;
        let n8 = reach(size, |_, _| true);
        for rounds in [1, 2, 8, 20] {
            let filled = (8 * rounds as usize + 1).min(200);
            let expected = steps(size, &color, &n8, 8 * rounds);
            assert_eq!(expected.iter().filter(|color| color[3] > 0.0).count(), filled);
            let mut image = expected.clone();
            image[filled..].fill([1.0, 0.0, 0.0, 1.0]);
            let both = run_both(&mut harness(params(Method::Spread, rounds), size, &color, &n8));
            assert!(both.cpu.get::<[f32; 4]>("color") == image, "{rounds}");
            assert!(both.gpu.get::<[f32; 4]>("color") == image, "{rounds}");
            let round = |p: usize| if p < filled { p.div_ceil(8) as u32 } else { HOLE };
            assert_eq!(both.cpu.get::<u32>("filled"), (0..200).map(round).collect::<Vec<_>>());
        }
    }

    #[test]
    fn no_color_crosses_an_edge() {
        // A wall between columns 19 and 20 with red on one side and blue on the other.
        let size = [50, 40];
        let n8 = reach(size, |p, q| (p[0] < 20) == (q[0] < 20));
        let mut color = vec![NONE; 2000];
        color[50 * 7 + 3] = RED;
        color[50 * 33 + 47] = BLUE;
        let both = run_both(&mut harness(params(Method::Spread, 8), size, &color, &n8));
        for out in [both.cpu, both.gpu] {
            for (p, color) in out.get::<[f32; 4]>("color").into_iter().enumerate() {
                let expected = if p % 50 < 20 { [1.0, 0.0, 0.0, 1.0] } else { [0.0, 0.0, 1.0, 1.0] };
                assert_eq!(color, expected, "{p}");
            }
        }
    }

    #[test]
    fn closed_regions_take_the_mean_of_the_colours_around() {
        // 5x5 pixels, red and blue halves, with a closed pixel in the middle and one in the corner.
        let size = [5, 5];
        let closed = |p: [usize; 2]| p == [2, 2] || p == [0, 0];
        let n8 = reach(size, |p, q| !closed(p) && !closed(q));
        let mut color: Vec<_> = (0..25).map(|p| if p % 5 < 2 { RED } else { BLUE }).collect();
        color[12] = NONE;
        color[0] = NONE;
        for method in [Method::Spread, Method::PushPull] {
            let out = run_alike(&mut harness(params(method, 8), size, &color, &n8)).get::<[f32; 4]>("color");
            assert_eq!(out[12], [3.0 / 8.0, 0.0, 5.0 / 8.0, 1.0]);
            assert_eq!(out[0], [1.0, 0.0, 0.0, 1.0]);
        }
        let both = run_both(&mut harness(params(Method::Off, 8), size, &color, &n8));
        for out in [both.cpu, both.gpu] {
            let out = out.get::<[f32; 4]>("color");
            assert_eq!((out[12], out[0], out[1]), (NONE, NONE, [1.0, 0.0, 0.0, 1.0]));
        }
    }

    #[test]
    fn one_color_anywhere_fills_the_image() {
        // Sizes about those of tiles and blocks of tiles.
        for size in [[1, 1], [16, 16], [17, 1], [33, 8], [3, 161], [300, 170]] {
            let count = (size[0] * size[1]) as usize;
            let mut harness = harness(params(Method::Spread, 1), size, &vec![NONE; count], &vec![0; count]);
            for n8 in [vec![0; count], reach(size, |_, _| true)] {
                harness.set("n8", &n8);
                for at in [0, count / 2, count - 1] {
                    let mut color = vec![NONE; count];
                    color[at] = BLUE;
                    harness.set("primary", &color);
                    let both = run_both(&mut harness);
                    for out in [both.cpu, both.gpu] {
                        assert!(
                            out.get::<[f32; 4]>("color") == vec![[0.0, 0.0, 1.0, 1.0]; count],
                            "{size:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn an_empty_image_is_black() {
        let size = [40, 30];
        let n8 = reach(size, |_, _| true);
        let both = run_both(&mut harness(params(Method::Spread, 2), size, &[NONE; 1200], &n8));
        for out in [both.cpu, both.gpu] {
            assert!(out.get::<[f32; 4]>("color") == [NONE; 1200]);
        }
    }

    #[test]
    fn both_sides_follow_the_definition() {
        let mut random = Random(23);
        for size in [[151, 70], [16, 96], [47, 33]] {
            // Mazes with more or fewer walls. The wall around one block has no opening.
            for walls in [1, 3, 6] {
                let n8 = reach(size, |p, q| {
                    let is_block = |[x, y]: [usize; 2]| x / 20 == 1 && y / 10 == 1;
                    is_block(p) == is_block(q) && random.below(8) >= walls
                });
                let color: Vec<[f32; 4]> = (0..size[0] * size[1])
                    .map(|_| match random.below(120) {
                        0 => [
                            random.between(0.0, 1.0),
                            random.between(0.0, 9.0),
                            0.0,
                            random.between(0.1, 1.0),
                        ],
                        _ => NONE,
                    })
                    .collect();
                for rounds in [1, 3] {
                    let both = run_both(&mut harness(params(Method::Spread, rounds), size, &color, &n8));
                    // Colours are means of means, some hundred in a chain, of numbers below 9.
                    both.assert_close("color", 1e-5);
                    both.assert_equal::<u32>("filled");
                    let cpu = both.cpu.get::<[f32; 4]>("color");
                    for (expected, color) in steps(size, &color, &n8, 8 * rounds).into_iter().zip(cpu) {
                        assert!(color == expected || expected == NONE);
                        assert_eq!(color[3], 1.0);
                    }
                }
                // Thousands of holes, whose colours are not all found at once.
                let both = run_both(&mut harness(params(Method::PushPull, 1), size, &color, &n8));
                both.assert_close("color", 1e-5);
            }
        }
    }
}
