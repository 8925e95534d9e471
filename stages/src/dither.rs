//! Turns priorities into requests for samples (`algorithms.md` sections 1.7, 1.8 and 11.2).
//!
//! *Systematic*, the default: visits pixels in an order that keeps neighbours together and adds up their priorities;
//! each time the sum passes a multiple of T = (sum of all) / (samples wanted), the pixel requests a sample. All
//! arithmetic is in integers, so both sides agree bit for bit. The order is tiles of 16x16 in scanline order, and the
//! Morton curve inside a tile. Priorities are clamped to T first, because a pixel requests at most one sample. Clamping
//! lowers T; if priorities still exceed the lower T, there are fewer requests than wanted; otherwise the number is
//! exact.
//!
//! *Serpentine*: error diffusion along scanlines of alternating direction, as in the papers; sequential, hence on the
//! CPU only. The first frame gets slightly too few requests; the error left after the last row goes to the first row of
//! the next frame.
//!
//! *Blue noise*: takes the pixels with the least quotients of a threshold and their priority (sequential Poisson sampling,
//! Ohlsson 1998), where the thresholds are a mask of blue noise: pixels of equal priority are spread without clusters and
//! gaps. The mask lies elsewhere in each frame. The greatest quotient that counts is found exactly, by counting the
//! quotients in three rounds, ten bits at a time; so the number of requests is exact, where `Systematic` may fall short.
//!
//! While the camera moves, empty cells of `occupancy` come first: they request samples of the predicted view, up to
//! their share of the budget. If there are more cells, about every n-th is picked, systematically, like pixels of equal
//! priority.
//!
//! Near the frame's border, half of the pixels in bare places request a sample of the predicted view as well: what
//! moves out of the frame is gone before a sample of the current view arrives, so a strip of background narrower than a
//! cell, between an object and the border, would never get one.

use std::ops::Range;

use epigraph_core::{
    CpuContext, Dims, Extent, Finding, Frame, In, Io, Out, Site, Stage, Threads, choice, constants, params,
    scratch,
};
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;

use crate::{
    column,
    meaning::{AIM, ID, OCCUPANCY, PRIORITY, REQUESTS},
    predict::{self, CELL},
    shared::{
        cloud::NO_POINT,
        random::pcg,
        requests::{NO_PIXEL, PIXEL_CENTER, Request, SPREAD, VIEW_NOW, VIEW_PREDICTED},
    },
};

#[path = "explain/dither.rs"]
mod explain;
mod mask;

constants! {
    /// Pixels on each side of a tile.
    const TILE: u32 = 16;
    /// The highest priority.
    const MAX_PRIORITY: u32 = 255;
    /// From this priority on, a pixel without a point has almost no samples around it.
    const BARE: u32 = 200;
    /// 2^32 over the golden ratio: its multiples, modulo 2^32, are evenly spread for any count.
    const GOLDEN: u32 = 0x9E37_79B9;
    /// Bits of a quotient that are found in a round.
    const ROUND_BITS: u32 = 10;
    /// Numbers that these bits may be.
    const BINS: u32 = 1 << ROUND_BITS;
    /// Bits of a rank of the mask.
    const RANK_BITS: u32 = 12;
    /// Rounds until all bits of a quotient are found.
    const ROUNDS: u32 = 3;
    /// The quotient of a pixel without priority, which is greater than all others.
    const NEVER: u32 = u32::MAX;
}

/// Tiles per parallel task on the CPU.
const TASK_TILES: usize = 16;

/// Requests per parallel task.
const ASK_TASK: usize = 1024;

/// Pixels per parallel task that counts quotients.
const COUNT_TASK: usize = 16384;

choice! {
    /// How pixels are picked.
    pub enum Kind {
        /// Systematic sampling along a space-filling order; parallel.
        Systematic,
        /// Error diffusion along alternating scanlines; sequential, CPU only.
        Serpentine,
        /// Pixels of about equal priority are spread as blue noise, by a mask of thresholds; parallel.
        BlueNoise,
    }
}

choice! {
    /// Where in the pixel a sample is requested.
    pub enum Aim {
        /// At the centre, or at the input `aim`.
        Center,
        /// Anywhere, at random.
        Random,
    }
}

params! {
    /// Parameters of [`Dither`].
    pub struct DitherParams {
        /// How pixels are picked.
        kind: Kind = Kind::Systematic;
        /// Where in the pixel a sample is requested; samples of the predicted view are always requested at random
        /// positions.
        aim: Aim = Aim::Center;
        /// Maximum share of the samples for empty cells of the predicted view.
        predicted_share: f32 = 0.5, in 0.0..=1.0;
        /// Width of the strip along the frame's border in which half of the bare pixels request a sample of the
        /// predicted view while the camera moves; 0: none.
        border: u32 = 16, in 0..=256, unit "pixels";
    }
}

/// See the module.
pub struct Dither {
    priority: In<u32>,
    id: In<u32>,
    aim: Option<In<u32>>,
    prediction: Option<Prediction>,
    requests: Out<Request>,
    by_kind: ByKind,
}

#[derive(Clone, Copy)]
struct Prediction {
    occupancy: In<u32>,
    tiles: Out<u32>,
}

enum ByKind {
    Systematic { tiles: Out<u32> },
    Serpentine { carry: Out<f32> },
    BlueNoise { tiles: Out<u32>, quotients: Out<u32> },
}

impl Stage for Dither {
    const KIND: &'static str = "dither";
    const DOC: &'static str = "Turns priorities into requests for samples.";
    type Params = DitherParams;

    fn declare(params: &DitherParams, io: &mut Io) -> Self {
        io.column(column::P1);
        io.per_budget();
        let priority = io.read("priority", PRIORITY, Extent::Frame(1));
        let id = io.read("id", ID, Extent::Frame(1));
        let aim = io.optional(
            "aim",
            AIM.doc(
                "Where in the pixel its sample should go, in 1/65536 of it: x low, y high; unconnected: at the centre.",
            ),
            Extent::Frame(1),
        );
        let occupancy = io.optional(
            "occupancy",
            OCCUPANCY.doc(
                "1 where the predicted view has a point in 4x4 pixels; unconnected: nothing is predicted.",
            ),
            Extent::Frame(CELL),
        );
        let requests = io.write("requests", REQUESTS, Extent::Requests);
        let prediction = occupancy.map(|occupancy| Prediction {
            occupancy,
            tiles: io.write(
                "cell_tiles",
                scratch("Empty cells before each tile of cells."),
                Extent::Frame(CELL * TILE),
            ),
        });
        let by_kind = match params.kind {
            Kind::Systematic | Kind::BlueNoise => {
                let tiles =
                    io.write("tiles", scratch("Sum of priorities before each tile."), Extent::Frame(TILE));
                let words = if let Kind::BlueNoise = params.kind { 5 } else { 4 };
                let _: Out<u32> =
                    io.write("state", scratch("Sums that every thread needs."), Extent::Fixed([words, 1]));
                io.shader(shader!("dither"));
                io.constants(CONSTANTS);
                io.constants(predict::CONSTANTS);
                if aim.is_some() {
                    io.define("AIM");
                }
                io.dispatch("clear", requests);
                if let Some(Prediction { occupancy, .. }) = prediction {
                    io.define("OCCUPANCY");
                    io.dispatch("add_cells", occupancy);
                    io.compute("scan_cells", Threads::Groups(1));
                    io.dispatch("ask_cells", occupancy);
                }
                let by_kind = if let Kind::BlueNoise = params.kind {
                    let doc = "Threshold divided by priority; the least are picked.";
                    let quotients = io.write("quotients", scratch(doc), Extent::Frame(1));
                    let doc = "Pixels by the bits of their quotient that a round finds.";
                    let _: Out<u32> = io.write("bins", scratch(doc), Extent::Fixed([BINS, 1]));
                    io.define("BLUE_NOISE");
                    io.constants(mask::CONSTANTS);
                    io.table("mask", "Ranks of the mask, row by row, two to a word.", &mask::WORDS);
                    io.compute("begin", Threads::Groups(1));
                    io.dispatch("divide_pixels", priority);
                    io.compute("find_bin", Threads::Groups(1));
                    for _ in 1..ROUNDS {
                        io.dispatch("count_pixels", priority);
                        io.compute("find_bin", Threads::Groups(1));
                    }
                    ByKind::BlueNoise { tiles, quotients }
                } else {
                    io.dispatch("add_pixels", priority);
                    io.compute("find_limit", Threads::Groups(1));
                    ByKind::Systematic { tiles }
                };
                io.dispatch("add_limited_pixels", priority);
                io.compute("scan_pixels", Threads::Groups(1));
                io.dispatch("ask_pixels", priority);
                by_kind
            }
            Kind::Serpentine => {
                let carry = io.persistent(
                    "carry",
                    "First row: what each column hands to the next frame.",
                    Extent::Frame(1),
                );
                ByKind::Serpentine { carry }
            }
        };
        Self { priority, id, aim, prediction, requests, by_kind }
    }

    fn cpu(&self, params: &DitherParams, cx: &CpuContext) -> Result<(), String> {
        let (frame, pixels) = (cx.frame(), cx.dims(self.priority));
        let (priority, id) = (&cx.read(self.priority)[..], &cx.read(self.id)[..]);
        let aims = self.aim.map(|aim| cx.read(aim));
        let aims = aims.as_deref();
        let requests = &mut cx.write(self.requests)[..];

        let level = cx.level();
        requests.fill(Request::NONE);
        let moving = self.prediction.is_some() && frame.predicted != frame.view;
        let wanted = (frame.samples as usize).min(requests.len());
        let mut rest = &mut requests[..wanted];
        if let Some(Prediction { occupancy, tiles }) = self.prediction {
            let cells = cx.dims(occupancy);
            let occupancy = &cx.read(occupancy)[..];
            let of = |occupied| u32::from(moving && occupied == 0);
            let empty = Weights { dims: cells, values: occupancy, of, level };
            let tiles = &mut cx.write(tiles)[..];
            empty.add(tiles);
            let total = scan(tiles);
            let allowed = (rest.len() as f32 * params.predicted_share) as u32;
            let predicted = total.min(allowed) as usize;
            let selection =
                Selection { tiles, total, wanted: predicted as u32, offset: offset(frame, total) };
            let (first, others) = rest.split_at_mut(predicted);
            selection.ask(&empty, 0..tiles.len(), first, &|[x, y]| ask_cell(frame, [x, y]));
            rest = others;
        }

        let wanted = rest.len() as u32;
        // First picks pixels and then looks up what their requests say: many look-ups are in flight at once, while no pick
        // waits for one.
        let pick = |[x, y]: [u32; 2]| Request { pixel: y * pixels.width + x, ..Request::NONE };
        match self.by_kind {
            ByKind::Systematic { tiles } => {
                let shift = shift(pixels);
                let tiles = &mut cx.write(tiles)[..];
                let weights = |limit| Weights {
                    dims: pixels,
                    values: priority,
                    of: move |priority| weight(priority, shift, limit),
                    level,
                };
                weights(MAX_PRIORITY).add(tiles);
                let limited = weights(limit(tiles.iter().sum(), wanted));
                limited.add(tiles);
                ask_systematically(frame, &limited, tiles, rest, &pick);
            }
            ByKind::BlueNoise { tiles, quotients } => {
                let quotients = &mut cx.write(quotients)[..];
                divide(frame, pixels, priority, quotients);
                let greatest = greatest(quotients, wanted);
                let of = move |quotient| u32::from(quotient <= greatest);
                let picked = Weights { dims: pixels, values: quotients, of, level };
                let tiles = &mut cx.write(tiles)[..];
                picked.add(tiles);
                ask_systematically(frame, &picked, tiles, rest, &pick);
            }
            ByKind::Serpentine { carry } => {
                serpentine(priority, &mut cx.write(carry)[..pixels.width as usize], rest, &pick);
            }
        }
        rest.par_iter_mut().with_min_len(ASK_TASK).filter(|request| request.pixel != NO_PIXEL).for_each(
            |request| {
                let pixel = request.pixel;
                let [x, y] = [pixel % pixels.width, pixel / pixels.width];
                let margin = x.min(y).min(pixels.width - 1 - x).min(pixels.height - 1 - y);
                let is_near = moving && margin < params.border;
                let is_bare = || id[pixel as usize] == NO_POINT && priority[pixel as usize] >= BARE;
                *request = if is_near && is_bare() && hash(frame, pixel) & 1 == 1 {
                    ask_predicted(frame, pixel, pixel)
                } else {
                    ask_pixel(frame, params.aim, pixel, id, aims)
                };
            },
        );
        Ok(())
    }

    fn explain(&self, params: &DitherParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, params.kind, site)
    }
}

/// The request of an empty cell: at a random place in it, from the predicted view.
fn ask_cell(frame: &Frame, [x, y]: [u32; 2]) -> Request {
    let noise = hash(frame, y << 16 | x);
    // The last cells may reach beyond the image.
    let x = (x * CELL + noise % CELL).min(frame.size[0] - 1);
    let y = (y * CELL + noise / CELL % CELL).min(frame.size[1] - 1);
    ask_predicted(frame, y * frame.size[0] + x, noise)
}

/// A request of the predicted view at a place in a pixel given by `noise`.
fn ask_predicted(frame: &Frame, pixel: u32, noise: u32) -> Request {
    Request { pixel, aim: hash(frame, noise), reuse: NO_POINT, view: VIEW_PREDICTED }
}

/// The request of a pixel.
fn ask_pixel(frame: &Frame, aim: Aim, pixel: u32, id: &[u32], aims: Option<&[u32]>) -> Request {
    let aim = match aim {
        Aim::Center => aims.map_or(PIXEL_CENTER, |aims| aims[pixel as usize]),
        Aim::Random => hash(frame, pixel) & !SPREAD,
    };
    Request { pixel, aim, reuse: id[pixel as usize], view: VIEW_NOW }
}

/// 32 pseudorandom bits, different in each frame and run.
fn hash(frame: &Frame, value: u32) -> u32 {
    pcg(value ^ pcg(frame.index ^ pcg(frame.seed)))
}

/// The number of bits by which priorities are shifted down, so that their sum stays below 2^32 in images of more than
/// 2^24 pixels.
fn shift(dims: Dims) -> u32 {
    if dims.count() <= 1 << 24 { 0 } else { 4 }
}

fn weight(priority: u32, shift: u32, limit: u32) -> u32 {
    (priority.min(MAX_PRIORITY) >> shift).min(limit)
}

/// The weight of one request: any excess would be lost.
fn limit(total: u32, wanted: u32) -> u32 {
    (total / wanted.max(1)).max(1)
}

/// The position of the frame's first request in the first interval: u * total, with u evenly distributed over frames.
fn offset(frame: &Frame, total: u32) -> u32 {
    ((u64::from(frame.index.wrapping_mul(GOLDEN)) * u64::from(total)) >> 32) as u32
}

/// Systematic sampling of weights whose sums by tile are in `tiles`.
fn ask_systematically<F: Fn(u32) -> u32 + Sync>(
    frame: &Frame,
    weights: &Weights<'_, F>,
    tiles: &mut [u32],
    requests: &mut [Request],
    ask: &(impl Fn([u32; 2]) -> Request + Sync),
) {
    let total = scan(tiles);
    let selection = Selection { tiles, total, wanted: requests.len() as u32, offset: offset(frame, total) };
    selection.ask(weights, 0..tiles.len(), requests, ask);
}

/// Divides the thresholds of a frame by the priorities.
fn divide(frame: &Frame, dims: Dims, priority: &[u32], quotients: &mut [u32]) {
    let width = dims.width as usize;
    let rows = quotients.par_chunks_mut(width).zip(priority.par_chunks(width)).enumerate();
    rows.for_each(|(y, (quotients, priority))| {
        for (x, (quotient, &priority)) in quotients.iter_mut().zip(priority).enumerate() {
            let [x, y] = [x as u32, y as u32];
            // Where the mask is repeated, pixels of one rank need an order too.
            let order = hash(frame, y * dims.width + x) >> (RANK_BITS + 2);
            let threshold = mask::rank([x, y], frame.index) << (ROUNDS * ROUND_BITS - RANK_BITS) | order;
            *quotient = threshold.checked_div(priority.min(MAX_PRIORITY)).unwrap_or(NEVER);
        }
    });
}

/// The greatest of the `wanted` least quotients; if there are fewer, the greatest possible.
fn greatest(quotients: &[u32], wanted: u32) -> u32 {
    let (mut found, mut rest) = (0, wanted);
    for round in 1..=ROUNDS {
        let shift = (ROUNDS - round) * ROUND_BITS;
        // What is found before the first round are the two highest bits, which are zero but for `NEVER`.
        let counts = |&&quotient: &&u32| quotient >> (shift + ROUND_BITS) == found;
        let count = |mut bins: [u32; BINS as usize], quotients: &[u32]| {
            for quotient in quotients.iter().filter(counts) {
                bins[(quotient >> shift & (BINS - 1)) as usize] += 1;
            }
            bins
        };
        let add = |mut bins: [u32; BINS as usize], others: [u32; BINS as usize]| {
            bins.iter_mut().zip(others).for_each(|(bin, other)| *bin += other);
            bins
        };
        let none = || [0; BINS as usize];
        let bins = quotients.par_chunks(COUNT_TASK).fold(none, count).reduce(none, add);
        let mut bin = 0;
        while bin < BINS - 1 && bins[bin as usize] < rest {
            rest -= bins[bin as usize];
            bin += 1;
        }
        found = found << ROUND_BITS | bin;
    }
    found
}

/// Positions of a tile's pixels along the Morton curve: the even bits of the index are x, the odd ones y.
const MORTON: [[u8; 2]; (TILE * TILE) as usize] = {
    const fn even(n: usize) -> u8 {
        ((n & 1) | (n >> 1 & 2) | (n >> 2 & 4) | (n >> 3 & 8)) as u8
    }
    let mut places = [[0; 2]; (TILE * TILE) as usize];
    let mut n = 0;
    while n < places.len() {
        places[n] = [even(n), even(n >> 1)];
        n += 1;
    }
    places
};

/// An image of weights.
struct Weights<'a, F> {
    dims: Dims,
    values: &'a [u32],
    /// The weight of a value.
    of: F,
    level: Level,
}

impl<F: Fn(u32) -> u32 + Sync> Weights<'_, F> {
    /// Adds up each tile.
    fn add(&self, tiles: &mut [u32]) {
        let (width, tile) = (self.dims.width as usize, TILE as usize);
        let rows = self.values.par_chunks(width * tile);
        tiles.par_chunks_mut(width.div_ceil(tile)).zip(rows).for_each(|(tiles, rows)| {
            tiles.fill(0);
            dispatch!(self.level, _ => for row in rows.chunks(width) {
                for (tile, values) in tiles.iter_mut().zip(row.chunks(tile)) {
                    *tile += values.iter().map(|&value| (self.of)(value)).sum::<u32>();
                }
            });
        });
    }
}

impl<F: Fn(u32) -> u32> Weights<'_, F> {
    /// The weights of a tile, row by row; 0 outside the image.
    #[inline(always)]
    fn tile(&self, [left, top]: [u32; 2]) -> [u32; (TILE * TILE) as usize] {
        let mut weights = [0; (TILE * TILE) as usize];
        let columns = left..self.dims.width.min(left + TILE);
        for (y, weights) in (top..self.dims.height).zip(weights.chunks_mut(TILE as usize)) {
            let row = (y * self.dims.width) as usize;
            let values = &self.values[row + columns.start as usize..row + columns.end as usize];
            weights.iter_mut().zip(values).for_each(|(weight, value)| *weight = (self.of)(*value));
        }
        weights
    }
}

/// Replaces each sum by the sum of all before it; returns the total.
fn scan(tiles: &mut [u32]) -> u32 {
    let mut sum = 0;
    for tile in tiles {
        sum += std::mem::replace(tile, sum);
    }
    sum
}

/// Systematic sampling by definition: adds up the weights in order, and makes a request for each multiple of the total
/// / `wanted` that the sum, shifted by `offset`, passes. If one weight passes several, only the last counts.
#[cfg(test)]
fn ask_in_order<F: Fn(u32) -> u32>(
    weights: &Weights<'_, F>,
    wanted: u32,
    offset: u32,
    requests: &mut [Request],
    ask: &impl Fn([u32; 2]) -> Request,
) {
    let Dims { width, height } = weights.dims;
    let total: u64 = weights.values.iter().map(|&value| u64::from((weights.of)(value))).sum();
    let (mut sum, mut asked) = (0, 0);
    for tile in 0..width.div_ceil(TILE) * height.div_ceil(TILE) {
        let [left, top] = [tile % width.div_ceil(TILE) * TILE, tile / width.div_ceil(TILE) * TILE];
        for [x, y] in MORTON.map(|[x, y]| [left + u32::from(x), top + u32::from(y)]) {
            if x < width && y < height {
                sum += u64::from((weights.of)(weights.values[(y * width + x) as usize]));
                let due = (sum * u64::from(wanted) + u64::from(offset)).checked_div(total).unwrap_or(0);
                if due > asked {
                    asked = due;
                    requests[due as usize - 1] = ask([x, y]);
                }
            }
        }
    }
}

/// Systematic sampling: which of the `wanted` multiples of `total` / `wanted`, moved by `offset`, each weight reaches.
struct Selection<'a> {
    /// Sum of the weights before each tile.
    tiles: &'a [u32],
    total: u32,
    wanted: u32,
    /// Less than `total`.
    offset: u32,
}

impl Selection<'_> {
    /// The sum of weights, scaled so that a request is due at every multiple of `total`.
    fn progress(&self, sum: u32) -> u64 {
        u64::from(sum) * u64::from(self.wanted) + u64::from(self.offset)
    }

    /// Requests due before tile `index`.
    fn due(&self, index: usize) -> usize {
        let sum = self.tiles.get(index).copied().unwrap_or(self.total);
        (self.progress(sum) / u64::from(self.total)) as usize
    }

    /// Writes the requests of a range of tiles, given as `requests`: a part of the output of `ask_in_order`.
    fn ask<F: Fn(u32) -> u32 + Sync>(
        &self,
        weights: &Weights<'_, F>,
        range: Range<usize>,
        requests: &mut [Request],
        ask: &(impl Fn([u32; 2]) -> Request + Sync),
    ) {
        if self.total == 0 || self.wanted == 0 {
            return;
        }
        if range.len() > TASK_TILES {
            let middle = range.start + range.len() / 2;
            let (left, right) = requests.split_at_mut(self.due(middle) - self.due(range.start));
            rayon::join(
                || self.ask(weights, range.start..middle, left, ask),
                || self.ask(weights, middle..range.end, right, ask),
            );
            return;
        }
        let first = self.due(range.start);
        let columns = weights.dims.width.div_ceil(TILE);
        for tile in range {
            let origin = [tile as u32 % columns * TILE, tile as u32 / columns * TILE];
            let of_tile = dispatch!(weights.level, _ => weights.tile(origin));
            let mut sum = self.tiles[tile];
            let mut next = (self.due(tile) as u64 + 1) * u64::from(self.total);
            // Four places in a row along the curve are a block of 2x2. Most blocks reach no multiple.
            for [left, top] in
                MORTON[..MORTON.len() / 4].iter().map(|place| place.map(|along| 2 * u32::from(along)))
            {
                let of_block: [u32; 4] = std::array::from_fn(|place| {
                    let [x, y] = MORTON[place];
                    of_tile[((top + u32::from(y)) * TILE + left + u32::from(x)) as usize]
                });
                let after = sum + of_block.iter().sum::<u32>();
                if self.progress(after) < next {
                    sum = after;
                    continue;
                }
                for (weight, [x, y]) in of_block.into_iter().zip(MORTON) {
                    sum += weight;
                    let progress = self.progress(sum);
                    if progress >= next {
                        // A weight above total / wanted may reach several multiples; the last one counts.
                        let due = progress / u64::from(self.total);
                        let [x, y] = [left + u32::from(x), top + u32::from(y)];
                        requests[due as usize - 1 - first] = ask([origin[0] + x, origin[1] + y]);
                        next = (due + 1) * u64::from(self.total);
                    }
                }
            }
        }
    }
}

/// Error diffusion. `carry` has one entry per column.
fn serpentine(
    priority: &[u32],
    carry: &mut [f32],
    requests: &mut [Request],
    ask: &impl Fn([u32; 2]) -> Request,
) {
    let total: u64 = priority.iter().map(|&priority| u64::from(priority)).sum();
    if total == 0 || requests.is_empty() {
        return;
    }
    let threshold = total as f32 / requests.len() as f32;
    let mut free = requests.iter_mut();
    let width = carry.len();
    for (y, row) in priority.chunks(width).enumerate() {
        let column = |step: usize| if y % 2 == 0 { step } else { width - 1 - step };
        let mut next = 0.0;
        for x in (0..width).map(column) {
            let mut value = row[x] as f32 + carry[x] + next;
            if value >= threshold
                && let Some(free) = free.next()
            {
                *free = ask([x as u32, y as u32]);
                value -= threshold;
            }
            next = value / 2.0;
            carry[x] = value / 2.0;
        }
        carry[column(width - 1)] += next;
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use epigraph_core::{Harness, View};

    use super::*;
    use crate::shared::{
        requests::NO_PIXEL,
        testing::{Random, run_alike, run_both, run_cpu, settings},
    };

    fn harness(params: DitherParams, size: [u32; 2], priority: &[u32], samples: u32) -> Harness<Dither> {
        let mut harness = Harness::new(params, &settings(size, samples));
        harness.set("priority", priority);
        harness.set("id", &(1000..1000 + priority.len() as u32).collect::<Vec<_>>());
        harness
    }

    /// The requests that are not empty.
    fn asked(requests: &[Request]) -> Vec<Request> {
        requests.iter().filter(|request| request.pixel != NO_PIXEL).copied().collect()
    }

    /// Runs both sides, asserts that they agree, and returns the non-empty requests. Asserts that each has its own
    /// pixel of the image and names its point.
    fn ask(harness: &mut Harness<Dither>) -> Vec<Request> {
        let both = run_both(harness);
        both.assert_equal::<[u32; 4]>("requests");
        let requests = asked(&both.cpu.get::<Request>("requests"));
        let pixels: BTreeSet<u32> = requests.iter().map(|request| request.pixel).collect();
        assert_eq!(pixels.len(), requests.len());
        let [width, height] = harness.frame.size;
        assert!(pixels.iter().all(|&pixel| pixel < width * height));
        assert!(
            requests.iter().all(|request| request.view == VIEW_NOW && request.reuse == request.pixel + 1000)
        );
        requests
    }

    /// The kinds that have two sides.
    const PARALLEL: [Kind; 2] = [Kind::Systematic, Kind::BlueNoise];

    fn of_kind(kind: Kind) -> DitherParams {
        DitherParams { kind, ..DitherParams::default() }
    }

    /// Images of priorities: mixed, a step, flat.
    fn images() -> [Vec<u32>; 3] {
        let mut random = Random(1);
        let mixed = (0..65536).map(|_| if random.below(10) < 3 { 200 } else { random.below(255) }).collect();
        let step = (0..65536).map(|p| if p % 256 < 64 { 255 } else { 10 }).collect();
        [mixed, step, vec![128; 65536]]
    }

    #[test]
    fn a_request_is_worth_an_equal_share_of_the_total() {
        for (total, wanted, expected) in [(1000, 10, 100), (1009, 10, 100), (5, 10, 1), (7, 0, 7), (0, 3, 1)]
        {
            assert_eq!(limit(total, wanted), expected, "{total} for {wanted}");
        }
    }

    #[test]
    fn the_number_of_requests_is_exact() {
        for (kind, priority) in PARALLEL.into_iter().flat_map(|kind| images().map(|image| (kind, image))) {
            for samples in [655, 6554, 13107] {
                let mut harness = harness(of_kind(kind), [256, 256], &priority, samples);
                for index in [0, 1, 77] {
                    harness.frame.index = index;
                    assert_eq!(ask(&mut harness).len(), samples as usize);
                }
            }
        }
    }

    #[test]
    fn only_blue_noise_is_exact_where_few_priorities_are_high() {
        // Cut at 265 / 2, the first priority still has 132 of 142: in most frames, both multiples of 71 fall on it.
        let counts = PARALLEL.map(|kind| {
            let mut harness = harness(of_kind(kind), [2, 1], &[255, 10], 2);
            harness.frame.index = 1;
            ask(&mut harness).len()
        });
        assert_eq!(counts, [1, 2]);
    }

    #[test]
    fn requests_follow_the_priority() {
        let [_, step, _] = images();
        for kind in PARALLEL {
            let requests = ask(&mut harness(of_kind(kind), [256, 256], &step, 6554));
            let left = requests.iter().filter(|request| request.pixel % 256 < 64).count() as f32;
            // A quarter of the pixels has 255 / (255 + 3 * 10) of the sum of priorities.
            assert!((left / 6554.0 - 255.0 / 285.0).abs() < 0.01, "{left}");
        }
    }

    #[test]
    fn a_pixel_requests_at_most_one_sample() {
        let hot =
            |p: u32| if (100..110).contains(&(p / 256)) && (50..60).contains(&(p % 256)) { 255 } else { 0 };
        let priority: Vec<u32> = (0..65536).map(hot).collect();
        for kind in PARALLEL {
            // 100 pixels have a priority, and 6554 samples are wanted.
            assert_eq!(ask(&mut harness(of_kind(kind), [256, 256], &priority, 6554)).len(), 100);
            assert_eq!(ask(&mut harness(of_kind(kind), [256, 256], &priority, 60)).len(), 60);
        }
    }

    #[test]
    fn extremes() {
        let count = |size: [u32; 2], priority: u32, samples| {
            let priority = vec![priority; (size[0] * size[1]) as usize];
            let counts =
                PARALLEL.map(|kind| ask(&mut harness(of_kind(kind), size, &priority, samples)).len());
            assert_eq!(counts[0], counts[1]);
            counts[0]
        };
        assert_eq!(count([40, 30], 0, 50), 0);
        assert_eq!(count([40, 30], 9, 0), 0);
        assert_eq!(count([1, 1], 9, 1), 1);
        assert_eq!(count([1, 1], 1, 1000), 1);
        assert_eq!(count([40, 30], 255, 5000), 1200);
        assert_eq!(count([40, 30], 1, 1200), 1200);
        assert_eq!(count([17, 1], 200, 5), 5);
    }

    #[test]
    fn each_frame_picks_other_pixels() {
        let priority = vec![100; 64 * 64];
        for kind in PARALLEL {
            let mut harness = harness(of_kind(kind), [64, 64], &priority, 100);
            let [first, second] = [0, 1].map(|index| {
                harness.frame.index = index;
                ask(&mut harness)
            });
            let first: BTreeSet<u32> = first.iter().map(|request| request.pixel).collect();
            assert!(second.iter().filter(|request| first.contains(&request.pixel)).count() < 10);
        }
    }

    #[test]
    fn requests_of_blue_noise_keep_a_distance_where_priorities_are_the_same() {
        // The distance of each request to the nearest other one, with opposite borders joined, pixels; the hundredth of
        // them that have the least.
        let nearest = |kind| {
            let requests = ask(&mut harness(of_kind(kind), [128, 128], &[100; 128 * 128], 819));
            let at: Vec<[u32; 2]> =
                requests.iter().map(|request| [request.pixel % 128, request.pixel / 128]).collect();
            let apart = |a: u32, b: u32| a.abs_diff(b).min(128 - a.abs_diff(b)).pow(2);
            let mut distances: Vec<f32> = (0..at.len())
                .map(|i| {
                    let others = (0..at.len()).filter(|&j| j != i);
                    let squared = others.map(|j| apart(at[i][0], at[j][0]) + apart(at[i][1], at[j][1]));
                    (squared.min().unwrap() as f32).sqrt()
                })
                .collect();
            distances.sort_by(f32::total_cmp);
            distances[distances.len() / 100]
        };
        // Of a triangular lattice of one pixel in 20, the nearest are 4.8 pixels apart.
        let [systematic, blue] = PARALLEL.map(nearest);
        assert!(blue > 2.5 && systematic < 1.5, "{blue}, systematic {systematic}");
    }

    #[test]
    fn the_greatest_quotient_is_the_one_that_sorting_finds() {
        let mut random = Random(5);
        for most in [1, 5, 1 << 12, 1 << 30] {
            let quotients: Vec<u32> =
                (0..40_000).map(|_| if random.below(4) == 0 { NEVER } else { random.below(most) }).collect();
            let mut sorted: Vec<u32> =
                quotients.iter().copied().filter(|&quotient| quotient != NEVER).collect();
            sorted.sort_unstable();
            for wanted in [1, 2, 1000, sorted.len()] {
                assert_eq!(greatest(&quotients, wanted as u32), sorted[wanted - 1], "{wanted} below {most}");
            }
            assert_eq!(greatest(&quotients, sorted.len() as u32 + 1), (1 << 30) - 1);
        }
    }

    #[test]
    fn aims_are_the_centre_or_random() {
        let priority = vec![100; 64 * 64];
        let aims = |aim| {
            let params = DitherParams { aim, ..DitherParams::default() };
            let requests = ask(&mut harness(params, [64, 64], &priority, 1000));
            requests.into_iter().map(|request| request.aim).collect::<BTreeSet<u32>>()
        };
        assert_eq!(aims(Aim::Center), BTreeSet::from([PIXEL_CENTER]));
        let random = aims(Aim::Random);
        assert!(random.len() > 990);
        for shift in [0, 16] {
            let mean =
                random.iter().map(|aim| f64::from(aim >> shift & 0xFFFF)).sum::<f64>() / random.len() as f64;
            // The tolerance is ten standard deviations of the mean of 1000 uniform numbers.
            assert!((mean / 65536.0 - 0.5).abs() < 0.1, "{mean}");
        }
    }

    #[test]
    fn the_input_aim_replaces_the_centre() {
        for aim in [Aim::Center, Aim::Random] {
            let params = DitherParams { aim, ..DitherParams::default() };
            let mut harness = harness(params, [20, 10], &[100; 200], 50);
            harness.set("aim", &(0..200).map(|pixel| pixel << 16 | 7).collect::<Vec<u32>>());
            let requests = ask(&mut harness);
            let follow = requests.iter().filter(|request| request.aim == request.pixel << 16 | 7).count();
            assert_eq!((requests.len(), follow), (50, if aim == Aim::Center { 50 } else { 0 }));
        }
    }

    /// The predicted view is another than the current one.
    fn look_ahead(harness: &mut Harness<Dither>) {
        harness.frame.predicted = View { eye: [1.0, 0.0, 0.0], ..harness.frame.view };
    }

    #[test]
    fn empty_cells_come_first() {
        // 30x22 pixels are 8x6 cells, of which the last row and column are cut off. The 24 cells in even columns are
        // empty.
        let occupancy: Vec<u32> = (0..48).map(|cell| cell % 8 % 2).collect();
        for (samples, share, expected) in
            [(100, 0.5, 24), (20, 0.5, 10), (20, 0.0, 0), (20, 1.0, 20), (1, 0.5, 0)]
        {
            let params = DitherParams { predicted_share: share, ..DitherParams::default() };
            let mut harness = harness(params, [30, 22], &[100; 660], samples);
            harness.set("occupancy", &occupancy);
            look_ahead(&mut harness);
            let both = run_both(&mut harness);
            both.assert_equal::<[u32; 4]>("requests");
            let requests = both.cpu.get::<Request>("requests");
            assert_eq!(asked(&requests).len(), samples as usize);
            let (cells, pixels) = requests.split_at(expected);
            assert!(pixels.iter().all(|request| request.view == VIEW_NOW));
            let cell_of = |request: &Request| request.pixel / 30 / CELL * 8 + request.pixel % 30 / CELL;
            for request in cells {
                assert_eq!((request.view, request.reuse), (VIEW_PREDICTED, NO_POINT));
                assert!(request.pixel < 660 && occupancy[cell_of(request) as usize] == 0);
            }
            assert_eq!(cells.iter().map(cell_of).collect::<BTreeSet<u32>>().len(), expected);
        }
    }

    #[test]
    fn while_the_camera_rests_occupancy_has_no_effect() {
        // Read late, it is empty in the first frame, whatever the camera does.
        let priority: Vec<u32> = (0..660).map(|p| p % 200).collect();
        let mut harness = harness(DitherParams::default(), [30, 22], &priority, 50);
        let without = run_alike(&mut harness).get::<Request>("requests");
        harness.reset();
        harness.set("occupancy", &[0; 48]);
        assert_eq!(run_alike(&mut harness).get::<Request>("requests"), without);
    }

    #[test]
    fn without_empty_cells_occupancy_has_no_effect() {
        let priority: Vec<u32> = (0..660).map(|p| p % 200).collect();
        let mut harness = harness(DitherParams::default(), [30, 22], &priority, 50);
        let without = run_alike(&mut harness).get::<Request>("requests");
        harness.reset();
        harness.set("occupancy", &[1; 48]);
        look_ahead(&mut harness);
        assert_eq!(run_alike(&mut harness).get::<Request>("requests"), without);
    }

    #[test]
    fn bare_pixels_near_the_border_request_the_predicted_view_while_the_camera_moves() {
        // 40x32 pixels, all of the highest priority. Every second row is bare, and there are as many samples as pixels.
        let id: Vec<u32> =
            (0..40 * 32).map(|pixel| if pixel / 40 % 2 == 0 { NO_POINT } else { pixel }).collect();
        for (border, moves) in [(8, true), (0, true), (8, false)] {
            let params = DitherParams { border, ..DitherParams::default() };
            let mut harness = harness(params, [40, 32], &[MAX_PRIORITY; 40 * 32], 40 * 32);
            harness.set("id", &id);
            harness.set("occupancy", &[1; 80]);
            if moves {
                look_ahead(&mut harness);
            }
            let both = run_both(&mut harness);
            both.assert_equal::<[u32; 4]>("requests");
            let requests = both.cpu.get::<Request>("requests");
            let ahead: Vec<&Request> =
                requests.iter().filter(|request| request.view == VIEW_PREDICTED).collect();
            // Half of the 40 * 32 - 24 * 16 pixels near the border are bare.
            let expected = if moves && border > 0 { 448 } else { 0 };
            assert!(ahead.len().abs_diff(expected / 2) <= expected / 10, "{} of {expected}", ahead.len());
            for request in ahead {
                let [x, y] = [request.pixel % 40, request.pixel / 40];
                assert!(x < 8 || y < 8 || x >= 32 || y >= 24);
                assert_eq!((id[request.pixel as usize], request.reuse), (NO_POINT, NO_POINT));
            }
        }
    }

    #[test]
    fn sampling_by_tiles_equals_sampling_pixel_by_pixel() {
        let mut random = Random(3);
        for [width, height] in [[1, 1], [16, 16], [17, 1], [3, 40], [300, 200]] {
            for most in [1, 2, 256] {
                let values: Vec<u32> = (0..width * height).map(|_| random.below(most)).collect();
                let dims = Dims { width, height };
                let weights = Weights { dims, values: &values, of: |value: u32| value, level: Level::new() };
                let mut tiles = vec![0; (width.div_ceil(TILE) * height.div_ceil(TILE)) as usize];
                weights.add(&mut tiles);
                let total = scan(&mut tiles);
                for wanted in [0, 1, 7, total / 100, total / 2, total] {
                    for offset in [0, total / 3, total.saturating_sub(1)] {
                        let ask = |[x, y]: [u32; 2]| Request { pixel: y * width + x, ..Request::NONE };
                        let mut expected = vec![Request::NONE; wanted as usize];
                        ask_in_order(&weights, wanted, offset, &mut expected, &ask);
                        let mut found = vec![Request::NONE; wanted as usize];
                        let selection = Selection { tiles: &tiles, total, wanted, offset };
                        selection.ask(&weights, 0..tiles.len(), &mut found, &ask);
                        let pixels = |requests: &[Request]| {
                            requests.iter().map(|request| request.pixel).collect::<Vec<_>>()
                        };
                        assert_eq!(
                            pixels(&found),
                            pixels(&expected),
                            "{wanted} of {total}, {width}x{height}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn both_sides_agree() {
        let mut random = Random(9);
        for size in [[1000u32, 3], [129, 257], [16, 16]] {
            let pixels = size[0] * size[1];
            let priority: Vec<u32> = (0..pixels).map(|_| random.below(256)).collect();
            let cells = size[0].div_ceil(CELL) * size[1].div_ceil(CELL);
            let occupancy: Vec<u32> = (0..cells).map(|_| random.below(2)).collect();
            let id: Vec<u32> = (0..pixels).map(|_| NO_POINT * random.below(2)).collect();
            for (samples, kind) in [1, 37, pixels / 7, pixels / 2]
                .into_iter()
                .flat_map(|samples| PARALLEL.map(|kind| (samples, kind)))
            {
                let params = DitherParams { kind, aim: Aim::Random, ..DitherParams::default() };
                let mut harness = harness(params, size, &priority, samples);
                harness.set("occupancy", &occupancy);
                harness.set("id", &id);
                look_ahead(&mut harness);
                harness.frame.seed = samples;
                for index in [0, 1, 1_000_003, u32::MAX] {
                    harness.frame.index = index;
                    run_both(&mut harness).assert_equal::<[u32; 4]>("requests");
                }
            }
        }
    }

    fn serpentine_params() -> DitherParams {
        DitherParams { kind: Kind::Serpentine, ..DitherParams::default() }
    }

    #[test]
    fn golden_serpentine() {
        // The example of algorithms.md section 1.7.
        let mut harness = harness(serpentine_params(), [4, 2], &[0, 100, 0, 100, 200, 0, 0, 0], 2);
        let out = run_cpu(&mut harness);
        let pixels: Vec<u32> =
            asked(&out.get::<Request>("requests")).iter().map(|request| request.pixel).collect();
        assert_eq!(pixels, [4]);
        assert_eq!(out.get::<f32>("carry")[..4], [46.875, 46.875, 43.75, 62.5]);
    }

    #[test]
    fn serpentine_is_exact_in_the_long_run() {
        for priority in images() {
            for samples in [655, 6554] {
                let mut harness = harness(serpentine_params(), [256, 256], &priority, samples);
                let counts = [0; 20].map(|_| asked(&run_cpu(&mut harness).get::<Request>("requests")).len());
                // The last row carries up to half a sample per column over to the next frame.
                let short = samples as usize - counts[0];
                assert!((1..=128).contains(&short), "{short}");
                let all: usize = counts.iter().sum();
                assert!(20 * samples as usize - all <= 128, "{counts:?}");
            }
        }
    }

    #[test]
    fn serpentine_extremes() {
        let count = |size: [u32; 2], priority: u32, samples| {
            let priority = vec![priority; (size[0] * size[1]) as usize];
            let mut harness = harness(serpentine_params(), size, &priority, samples);
            asked(&run_cpu(&mut harness).get::<Request>("requests")).len()
        };
        assert_eq!(count([8, 8], 0, 5), 0);
        assert_eq!(count([8, 8], 9, 0), 0);
        assert_eq!(count([1, 1], 9, 1), 1);
        assert_eq!(count([8, 8], 9, 1000), 64);
    }
}
