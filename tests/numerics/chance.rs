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
        || vec![requests()],
        || vec![cells()],
        || shares().into(),
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

fn asked(outputs: &Outputs) -> Vec<Request> {
    outputs.get("requests")
}

fn requests() -> Row {
    let mut measure = Measure::exact(
        "dither",
        "pixels and slots asked for",
        "priorities 0, one hot spot, all 255, any; budgets of 0, 1, 1%, 100%; 1x1 to 4097x4096 (over 2^24 pixels)",
        "sums in 128-bit integers",
    );
    let mut random = Random(1);
    for (number, size) in [[1, 1], [1, 41], [61, 47], [16384, 1], [4097, 4096]].into_iter().enumerate() {
        let pixels = (size[0] * size[1]) as usize;
        let is_large = pixels > 1 << 24;
        for kind in 0..5 {
            if is_large && kind != 3 {
                continue;
            }
            for samples in [0, 1, pixels.div_ceil(100), pixels]
                .into_iter()
                .take(if is_large { 3 } else { 4 })
                .skip(if is_large { 2 } else { 0 })
            {
                let priority = priorities(kind, pixels, &mut random);
                let id: Vec<u32> =
                    (0..pixels as u32).map(|i| if i % 3 == 0 { NONE } else { 7 * i }).collect();
                let mut harness =
                    Harness::<Dither>::new(DitherParams::default(), &settings(size, samples as u32));
                harness.frame.index = 5 + number as u32;
                harness.set("priority", &priority);
                harness.set("id", &id);
                // More than 2^24 pixels lose four bits, so that sums fit.
                let shift = if is_large { 4 } else { 0 };
                let plain: Vec<u128> = priority.iter().map(|&p| u128::from(p.min(255) >> shift)).collect();
                let most = (plain.iter().sum::<u128>() / (samples as u128).max(1)).max(1);
                let weights: Vec<u128> = plain.into_iter().map(|weight| weight.min(most)).collect();
                let expected = chosen(size, &weights, samples as u128, harness.frame.index);
                for (side, outputs) in sides(&both(&mut harness)) {
                    let found = asked(outputs);
                    let name = format!("{size:?}, kind {kind}, {samples} samples");
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
fn shares() -> [Row; 2] {
    let mut count = Measure::exact(
        "dither",
        "number of requests",
        "1000 frames, no priority above the threshold",
        "the budget",
    );
    let mut share = Measure::statistic(
        "dither",
        "how often a pixel is asked for",
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
        let mut harness = Harness::<Dither>::new(DitherParams::default(), &settings(size, samples));
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
