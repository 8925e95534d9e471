//! Where new samples are asked for: whole numbers where they decide, statistics where chance does.

use std::sync::LazyLock;

use epigraph_core::{
    Harness, Outputs, Side, View,
    testing::{Random, settings},
};
use epigraph_stages::{
    dither::{Aim, Dither, DitherParams, Kind},
    shared::requests::Request,
};

use crate::{
    Group, both, measured,
    pixels::sides,
    table::{Measure, Row, Unit},
};

pub static ROWS: Group = LazyLock::new(|| {
    measured(&[
        || vec![requests(Kind::Systematic), requests(Kind::BlueNoise)],
        || vec![cells()],
        || shares(Kind::Systematic).into(),
        || shares(Kind::BlueNoise).into(),
        || vec![aims()],
        || vec![borders()],
        || vec![serpentine()],
    ])
});

const NONE: u32 = u32::MAX;

/// Pixels in the order of systematic sampling: tiles of 16 x 16 row by row, a Morton curve in each (section 1.7).
fn order(size: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    let tiles = size.map(|side| side.div_ceil(16));
    let within =
        |n: u32| [0, 1].map(|axis| (0..4).fold(0, |at, bit| at | (n >> (2 * bit + axis) & 1) << bit));
    (0..tiles[0] * tiles[1])
        .flat_map(move |tile| {
            (0..256).map(move |n| {
                let [x, y] = within(n);
                [tile % tiles[0] * 16 + x, tile / tiles[0] * 16 + y]
            })
        })
        .filter(move |at| at[0] < size[0] && at[1] < size[1])
}

/// The pixels that are asked for, in order; `NONE` for requests that no pixel takes.
fn chosen(size: [u32; 2], weights: &[u128], wanted: u128, index: u32) -> Vec<u32> {
    let mut chosen = vec![NONE; wanted as usize];
    let total: u128 = weights.iter().sum();
    if total == 0 || wanted == 0 {
        return chosen;
    }
    let offset = (u128::from(index.wrapping_mul(0x9E37_79B9)) * total) >> 32;
    let due = |sum: u128| (sum * wanted + offset) / total;
    let mut sum = 0;
    for [x, y] in order(size) {
        let pixel = y * size[0] + x;
        let before = due(sum);
        sum += weights[pixel as usize];
        if due(sum) > before {
            chosen[due(sum) as usize - 1] = pixel;
        }
    }
    chosen
}

/// Priorities of all kinds: none, one hot spot, all the same, any, and more than there can be.
fn priorities(kind: usize, pixels: usize, random: &mut Random) -> Vec<u32> {
    (0..pixels)
        .map(|at| match kind {
            0 => 0,
            1 => {
                if at == pixels / 2 {
                    255
                } else {
                    0
                }
            }
            2 => 255,
            3 => [0, 1, 255, random.below(256)][random.below(4) as usize],
            _ => [random.bits(), 255, 3][random.below(3) as usize],
        })
        .collect()
}

/// The ranks of the mask of blue noise, row by row.
const MASK: &[u8; 8192] = include_bytes!("../../stages/src/dither/mask.bin");

/// Whether each pixel is among those with the least quotients of threshold and priority, as many as wanted. Where several
/// have the greatest of these quotients, all of them are.
fn least([width, _]: [u32; 2], priority: &[u32], wanted: usize, frame: u32) -> Vec<u128> {
    let place = |at: u32, step: u32| (at + (frame.wrapping_mul(step) >> 26)) % 64;
    let quotients: Vec<Option<u64>> = (0..)
        .zip(priority)
        .map(|(pixel, &priority)| {
            let [x, y] = [place(pixel % width, 0xC13F_A9A9), place(pixel / width, 0x91E1_0DA5)];
            let at = 2 * (64 * y + x) as usize;
            let rank = u64::from(MASK[at]) + 256 * u64::from(MASK[at + 1]);
            let order = u64::from(hash(pixel ^ hash(frame ^ hash(0))) >> 14);
            ((rank << 18) + order).checked_div(priority.min(255).into())
        })
        .collect();
    let mut sorted: Vec<u64> = quotients.iter().flatten().copied().collect();
    sorted.sort_unstable();
    let greatest = wanted.min(sorted.len()).checked_sub(1).map(|last| sorted[last]);
    let is_picked = |quotient: Option<u64>| quotient.is_some() && quotient <= greatest;
    quotients.into_iter().map(|quotient| u128::from(is_picked(quotient))).collect()
}

/// The output function of PCG (O'Neill 2014).
fn hash(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = (state >> ((state >> 28) + 4) ^ state).wrapping_mul(277_803_737);
    word >> 22 ^ word
}

fn asked(outputs: &Outputs) -> Vec<Request> {
    outputs.get("requests")
}

fn requests(kind: Kind) -> Row {
    let (what, oracle) = match kind {
        Kind::BlueNoise => ("pixels and slots asked for, `BlueNoise`", "64-bit integers, by sorting"),
        _ => ("pixels and slots asked for", "sums in 128-bit integers"),
    };
    let mut measure = Measure::exact(
        "dither",
        what,
        "priorities 0, one hot spot, all 255, any; budgets of 0, 1, 1%, 100%; 1x1 to 4097x4096 (over 2^24 pixels)",
        oracle,
    );
    let mut random = Random(1);
    for (number, size) in [[1, 1], [1, 41], [61, 47], [16384, 1], [4097, 4096]].into_iter().enumerate() {
        let pixels = (size[0] * size[1]) as usize;
        let is_large = pixels > 1 << 24;
        for image in 0..5 {
            if is_large && image != 3 {
                continue;
            }
            for samples in [0, 1, pixels.div_ceil(100), pixels]
                .into_iter()
                .take(if is_large { 3 } else { 4 })
                .skip(if is_large { 2 } else { 0 })
            {
                let priority = priorities(image, pixels, &mut random);
                let id: Vec<u32> =
                    (0..pixels as u32).map(|i| if i % 3 == 0 { NONE } else { 7 * i }).collect();
                let params = DitherParams { kind, ..DitherParams::default() };
                let mut harness = Harness::<Dither>::new(params, &settings(size, samples as u32));
                harness.frame.index = 5 + number as u32;
                harness.set("priority", &priority);
                harness.set("id", &id);
                let weights = if kind == Kind::BlueNoise {
                    least(size, &priority, samples, harness.frame.index)
                } else {
                    // More than 2^24 pixels lose four bits, so that sums fit.
                    let shift = if is_large { 4 } else { 0 };
                    let plain = || priority.iter().map(|&p| u128::from(p.min(255) >> shift));
                    let most = (plain().sum::<u128>() / (samples as u128).max(1)).max(1);
                    plain().map(|weight| weight.min(most)).collect()
                };
                let expected = chosen(size, &weights, samples as u128, harness.frame.index);
                for (side, outputs) in sides(&both(&mut harness)) {
                    let found = asked(outputs);
                    let name = format!("{size:?}, kind {image}, {samples} samples");
                    let pixel: Vec<u32> = found.iter().map(|request| request.pixel).collect();
                    let reuse: Vec<u32> = found.iter().map(|request| request.reuse).collect();
                    let slots: Vec<u32> = expected
                        .iter()
                        .map(|&pixel| if pixel == NONE { NONE } else { id[pixel as usize] })
                        .collect();
                    // A list has at least one element.
                    let padded = |mut list: Vec<u32>| {
                        list.resize(found.len(), NONE);
                        list
                    };
                    measure.compare_words(side, &name, [1, 1], &pixel, &padded(expected.clone()));
                    measure.compare_words(side, &name, [1, 1], &reuse, &padded(slots));
                }
            }
        }
    }
    measure.row()
}

/// A frame with a camera that moves.
fn moving(harness: &mut Harness<Dither>) {
    harness.frame.predicted = View { eye: [1.0, 0.0, 0.0], ..View::default() };
}

/// Empty cells of the predicted view come first.
fn cells() -> Row {
    let mut measure = Measure::exact(
        "dither",
        "cells of the predicted view asked for",
        "shares of 0, 0.5 and 1; none, few and all cells empty; 1x1 to 16384x1",
        "sums in 128-bit integers",
    );
    let mut random = Random(2);
    for size in [[1, 1], [1, 41], [61, 47], [16384, 1]] {
        for (share, empty) in [(0.0, 50), (0.5, 0), (0.5, 3), (0.5, 100), (1.0, 60)] {
            let grid = size.map(|side: u32| side.div_ceil(4));
            let pixels = (size[0] * size[1]) as usize;
            let occupancy: Vec<u32> =
                (0..grid[0] * grid[1]).map(|_| u32::from(random.below(100) >= empty)).collect();
            let samples = pixels.div_ceil(7) as u32;
            let params = DitherParams { predicted_share: share, border: 0, ..DitherParams::default() };
            let mut harness = Harness::<Dither>::new(params, &settings(size, samples));
            moving(&mut harness);
            harness.frame.index = 3;
            harness.set("priority", &vec![100u32; pixels]);
            harness.set("id", &vec![NONE; pixels]);
            harness.set("occupancy", &occupancy);
            let weights: Vec<u128> = occupancy.iter().map(|&of| u128::from(of == 0)).collect();
            let wanted = weights.iter().sum::<u128>().min((f64::from(samples) * f64::from(share)) as u128);
            let expected = chosen(grid, &weights, wanted, 3);
            for (side, outputs) in sides(&both(&mut harness)) {
                let found: Vec<u32> = asked(outputs)
                    .iter()
                    .map(|request| match request.view {
                        1 => request.pixel / size[0] / 4 * grid[0] + request.pixel % size[0] / 4,
                        _ => NONE,
                    })
                    .collect();
                let mut all = expected.clone();
                all.resize(found.len(), NONE);
                measure.compare_words(
                    side,
                    &format!("{size:?}, share {share}, {empty}% empty"),
                    [1, 1],
                    &found,
                    &all,
                );
            }
        }
    }
    measure.row()
}

/// How often each pixel is asked for over many frames: in proportion to its priority.
fn shares(kind: Kind) -> [Row; 2] {
    let [number, often] = match kind {
        Kind::BlueNoise => ["number of requests, `BlueNoise`", "how often a pixel is asked for, `BlueNoise`"],
        _ => ["number of requests", "how often a pixel is asked for"],
    };
    let mut count =
        Measure::exact("dither", number, "1000 frames, no priority above the threshold", "the budget");
    let mut share = Measure::statistic(
        "dither",
        often,
        "1000 frames, priorities 1 to 255",
        "its share of all priorities",
        "standard deviations of independent draws (z-test, level 10^-6 over all pixels)",
        5.9,
    );
    let (size, frames) = ([24, 20], 1000);
    let mut random = Random(3);
    let priority: Vec<u32> = (0..480).map(|_| 1 + random.below(255)).collect();
    let sum: u32 = priority.iter().sum();
    let samples = 24;
    for side in [Side::Cpu, Side::Gpu] {
        let mut harness = Harness::<Dither>::new(
            DitherParams { kind, ..DitherParams::default() },
            &settings(size, samples),
        );
        harness.set("priority", &priority);
        harness.set("id", &vec![NONE; 480]);
        let mut often = vec![0u32; 480];
        let mut asked_for = vec![];
        for index in 0..frames {
            harness.frame.index = index;
            let device = (side == Side::Gpu).then(epigraph_tests::gpu);
            let out = harness
                .run(side, &epigraph_stages::registry(), &epigraph_core::Host::default(), device)
                .expect("it runs");
            let found = asked(&out);
            asked_for.push(found.iter().filter(|request| request.pixel != NONE).count() as u32);
            found
                .iter()
                .filter(|request| request.pixel != NONE)
                .for_each(|request| often[request.pixel as usize] += 1);
        }
        count.compare_words(side, "each frame", [1, 1], &asked_for, &vec![samples; frames as usize]);
        let worst = often.iter().zip(&priority).map(|(&often, &priority)| {
            let chance = f64::from(samples) * f64::from(priority) / f64::from(sum);
            let n = f64::from(frames);
            (f64::from(often) - n * chance).abs() / (n * chance * (1.0 - chance)).sqrt()
        });
        share.record(side, "all frames", worst.fold(0.0, f64::max), 480);
    }
    [count.row(), share.row()]
}

/// Random aims are evenly spread over the pixel.
fn aims() -> Row {
    let mut measure = Measure::statistic(
        "dither",
        "random aims",
        "100,000 requests",
        "evenly spread: the mean, and each sixteenth of an axis",
        "standard deviations (z-test, level 10^-6 over 34 figures)",
        5.5,
    );
    let size = [400, 250];
    let mut harness = Harness::<Dither>::new(
        DitherParams { aim: Aim::Random, ..DitherParams::default() },
        &settings(size, 100_000),
    );
    harness.set("priority", &vec![255u32; 100_000]);
    harness.set("id", &vec![NONE; 100_000]);
    for (side, outputs) in sides(&both(&mut harness)) {
        let aims: Vec<[u32; 2]> =
            asked(outputs).iter().map(|request| [request.aim & 0xFFFF, request.aim >> 16]).collect();
        let n = aims.len() as f64;
        let mut worst = 0f64;
        for axis in 0..2 {
            let mean = aims.iter().map(|aim| (f64::from(aim[axis]) + 0.5) / 65536.0).sum::<f64>() / n;
            worst = worst.max((mean - 0.5).abs() / (1.0 / (12.0 * n)).sqrt());
            for part in 0..16 {
                let inside = aims.iter().filter(|aim| aim[axis] >> 12 == part).count() as f64;
                worst = worst.max((inside - n / 16.0).abs() / (n / 16.0 * 15.0 / 16.0).sqrt());
            }
        }
        measure.record(side, "all", worst, aims.len());
    }
    measure.row()
}

/// Of the bare pixels along the border, half ask for the predicted view.
fn borders() -> Row {
    let mut measure = Measure::statistic(
        "dither",
        "bare pixels along the border that ask for the predicted view",
        "borders of 0, 16 and 256 pixels",
        "half of them, and none elsewhere",
        "standard deviations (z-test, level 10^-6)",
        5.2,
    );
    let size = [300, 200];
    for border in [0, 16, 256] {
        let params = DitherParams { border, predicted_share: 0.0, ..DitherParams::default() };
        let mut harness = Harness::<Dither>::new(params, &settings(size, 60_000));
        moving(&mut harness);
        harness.set("priority", &vec![255u32; 60_000]);
        harness.set("id", &vec![NONE; 60_000]);
        harness.set("occupancy", &vec![1u32; 75 * 50]);
        for (side, outputs) in sides(&both(&mut harness)) {
            let found = asked(outputs);
            let is_near = |pixel: u32| {
                let [x, y] = [pixel % 300, pixel / 300];
                x.min(y).min(299 - x).min(199 - y) < border
            };
            let ahead = found.iter().filter(|request| request.view == 1);
            assert!(ahead.clone().all(|request| is_near(request.pixel)), "border {border} on {side}");
            let near = found.iter().filter(|request| is_near(request.pixel)).count() as f64;
            let z = (ahead.count() as f64 - 0.5 * near).abs() / (0.25 * near).sqrt().max(1.0);
            measure.record(side, &format!("border {border}"), z, near as usize);
        }
    }
    measure.row()
}

/// Error diffusion along scanlines: over many frames as many requests as wanted, but for what is still carried.
fn serpentine() -> Row {
    let mut measure = Measure::within(
        "dither",
        "requests that `Serpentine` owes after 50 frames",
        "priorities 0 to 255; budgets of 1 or 10%; 1x1 to 1024x2",
        "the budget",
        0.5,
        Unit::Of("of the image's width, and 1"),
    )
    .on_cpu_only();
    let mut random = Random(4);
    for size in [[1, 1], [1, 41], [61, 47], [1024, 2]] {
        let pixels = (size[0] * size[1]) as usize;
        let samples = pixels.div_ceil([100, 10][random.below(2) as usize]) as u32;
        let mut harness = Harness::<Dither>::new(
            DitherParams { kind: Kind::Serpentine, ..DitherParams::default() },
            &settings(size, samples),
        );
        harness.set("priority", &(0..pixels).map(|_| random.below(256)).collect::<Vec<_>>());
        harness.set("id", &vec![NONE; pixels]);
        let mut count = 0;
        for index in 0..50 {
            harness.frame.index = index;
            let out = harness
                .run(Side::Cpu, &epigraph_stages::registry(), &epigraph_core::Host::default(), None)
                .expect("it runs");
            count += asked(&out).iter().filter(|request| request.pixel != NONE).count() as u32;
        }
        let owed = f64::from(50 * samples) - f64::from(count);
        measure.record(Side::Cpu, &format!("{size:?}"), (owed.abs() - 1.0).max(0.0) / f64::from(size[0]), 50);
    }
    measure.row()
}
