//! The stages that keep the point cloud: ages, slots, samples that enter, bodies that move. Mostly whole numbers.

use std::{collections::HashSet, sync::LazyLock};

use epigraph_core::{
    Harness, Side,
    testing::{Both, Random, settings},
};
use epigraph_stages::{
    age::{Age, AgeParams},
    albedo::Albedo,
    carry::{Carry, CarryParams},
    image_id::{Ids, ImageId, ImageIdParams},
    integrate::{Integrate, IntegrateParams},
    pending::Pending,
    point_cloud::{PointCloud, PointCloudParams},
    replace::{Replace, ReplaceParams},
    shared::{
        moves::{Blocker, Lamp, Move},
        requests::{Request, Sample},
    },
};

use crate::{
    Group, both,
    interval::{Interval, Number, ulp},
    measured,
    table::{Expected, Measure, Row, Unit},
};

pub static ROWS: Group = LazyLock::new(|| {
    measured(&[
        || vec![memory()],
        || vec![seen()],
        || vec![under_way()],
        || ages().into(),
        || vec![slots()],
        || samples().into(),
        || vec![albedos()],
        || moved().into(),
        || vec![shadowed()],
    ])
});

// The bits of `meta` and the marks of `algorithms.md` section 1.1.
const LIVE: u32 = 1 << 16;
const CHANGED: u32 = 1 << 17;
const FRESH: u32 = 1 << 18;
const NONE: u32 = u32::MAX;

fn sides(outputs: &Both) -> [(Side, &epigraph_core::Outputs); 2] {
    [(Side::Cpu, &outputs.cpu), (Side::Gpu, &outputs.gpu)]
}

/// An empty cloud is of zeros, whatever its size.
fn memory() -> Row {
    let mut measure = Measure::exact(
        "point_cloud",
        "words of a new cloud",
        "0.01 and 16 points a pixel; 1x1, 31x17, 16384x1",
        "zero",
    );
    for size in [[1, 1], [31, 17], [16384, 1]] {
        for points_per_pixel in [0.01, 16.0] {
            let mut harness = Harness::<PointCloud>::new(
                PointCloudParams { points_per_pixel, accumulate: false },
                &settings(size, 1),
            );
            let slots =
                (f64::from(size[0] * size[1]) * f64::from(points_per_pixel)).round().max(1.0) as usize;
            for (side, outputs) in sides(&both(&mut harness)) {
                for (field, words) in [("position", 4), ("radiance", 1), ("image_id", 1), ("meta", 1)] {
                    let got = outputs.get::<u32>(&format!("cloud.{field}"));
                    measure.compare_words(
                        side,
                        &format!("{field} {size:?}"),
                        [1, 1],
                        &got,
                        &vec![0; words * slots],
                    );
                }
            }
        }
    }
    measure.row()
}

/// The pixel that shows each point.
fn seen() -> Row {
    let mut measure = Measure::exact(
        "image_id",
        "the pixel that shows a point",
        "1x1 to 4096x2049, more than 2^23 pixels; both `ids`",
        "a loop over the pixels",
    );
    let mut random = Random(1);
    for (size, ids) in [
        ([1, 1], Ids::Word),
        ([1, 33], Ids::Texel),
        ([31, 17], Ids::Word),
        ([16384, 1], Ids::Word),
        ([4096, 2049], Ids::Word),
        ([4096, 2049], Ids::Texel),
    ] {
        let pixels = (size[0] * size[1]) as usize;
        let slots = pixels + pixels / 7;
        // Each pixel shows a point of its own, or none.
        let id: Vec<u32> = (0..pixels as u32)
            .map(|i| if random.below(3) == 0 { NONE } else { slots as u32 - 1 - i })
            .collect();
        let mut expected = vec![NONE; slots];
        for (pixel, &id) in id.iter().enumerate().filter(|(_, id)| **id != NONE) {
            // The papers' texel: pixel 0x7FFFFF stands for none.
            if ids == Ids::Word || pixel < 0x7F_FFFF {
                expected[id as usize] = pixel as u32;
            }
        }
        let mut harness = Harness::<ImageId>::new(ImageIdParams { ids }, &settings(size, 1));
        harness.set("id", &id);
        harness.set("cloud.image_id", &vec![7u32; slots]);
        for (side, outputs) in sides(&both(&mut harness)) {
            measure.compare_words(
                side,
                &format!("{size:?} {ids:?}"),
                [1, 1],
                &outputs.get("cloud.image_id"),
                &expected,
            );
        }
    }
    measure.row()
}

/// Ages of points whose samples are under way (section 12.1).
fn under_way() -> Row {
    let mut measure = Measure::exact(
        "pending",
        "ages of points with a sample under way",
        "1 to 2^24 + 1 points; up to 2^20 requests and samples, some of no point; camera at rest and moving",
        "whole numbers",
    );
    let mut random = Random(8);
    for (slots, count) in [(1, 1), (2, 50), (1000, 300), (65_537, 9000), ((1 << 24) + 1, 1 << 20)] {
        let word = |random: &mut Random| {
            [0, LIVE, LIVE | CHANGED][random.below(3) as usize] | random.bits() & 0xFF00_FFFF
        };
        let before: Vec<u32> = (0..slots).map(|_| word(&mut random)).collect();
        let requests: Vec<Request> = (0..count)
            .map(|pixel| {
                let reuse = if random.below(4) == 0 { NONE } else { random.below(slots + 1) };
                Request { pixel, reuse, ..Request::NONE }
            })
            .collect();
        let samples: Vec<Sample> = (0..count)
            .map(|_| Sample { hit: random.below(3), reuse: random.below(slots + 1), ..Sample::default() })
            .collect();
        let answered: HashSet<u32> =
            samples.iter().filter(|sample| sample.hit != 0).map(|sample| sample.reuse).collect();
        for moves in [false, true] {
            let mut after = before.clone();
            for request in requests.iter().filter(|request| !moves && request.reuse < slots) {
                let word = &mut after[request.reuse as usize];
                if *word & LIVE != 0 && !answered.contains(&request.reuse) {
                    *word = *word >> 16 << 16;
                }
            }
            let mut harness = Harness::<Pending>::new((), &settings([1, 1], count));
            harness.frame.view.near += if moves { 0.5 } else { 0.0 };
            harness.set("cloud.meta", &before);
            harness.set("requests", &requests);
            harness.set("samples", &samples);
            for (side, outputs) in sides(&both(&mut harness)) {
                let got = outputs.get("cloud.meta");
                measure.compare_words(side, &format!("{slots} points"), [1, 1], &got, &after);
            }
        }
    }
    measure.row()
}

/// Ages of all points, and the average of arrivals from which the increment follows (`algorithms.md` section 1.5).
fn ages() -> [Row; 2] {
    let mut ages = Measure::exact(
        "age",
        "ages, flags, evictions, points by age",
        "1 to 2^24 + 1 points; 0 to 2^24 arrivals; ages 0 to 65535/256; penalties 0 and 255; both `evict`",
        "whole numbers",
    );
    let mut rates = Measure::within(
        "age",
        "average of arrivals",
        "the same, over 12 frames",
        "f64",
        2.0,
        Unit::Of("ULP"),
    );
    let mut random = Random(2);
    for (number, slots) in [1, 2, 1000, 65_537, (1 << 24) + 1].into_iter().enumerate() {
        for (evict, not_drawn, change) in [(true, 3.0, 64.0), (false, 255.0, 255.0), (false, 0.0, 0.0)] {
            let params = AgeParams { not_drawn_penalty: not_drawn, change_penalty: change, evict };
            let mut harness = Harness::<Age>::new(params, &settings([1, 1], 1));
            let is_large = slots > 1 << 20;
            if is_large && !evict {
                continue;
            }
            let frames = if is_large { 1 } else { 12 };
            let mut exact = 0.0;
            for frame in 0..frames {
                let arrived = [5000, 1000, 0, 1, slots as u32, 1 << 24][(frame + number) % 6];
                let ends = [0, 1, 255, 256, 0xFEFF, 0xFF00, 0xFFFF];
                let meta: Vec<u32> = (0..slots)
                    .map(|_| {
                        let bits = random.bits();
                        let age =
                            if bits >> 28 < 8 { ends[(bits >> 20) as usize % 7] } else { bits & 0xFFFF };
                        bits & 0xFF07_0000 | age
                    })
                    .collect();
                let image_id: Vec<u32> =
                    (0..slots).map(|i| if random.below(2) == 0 { NONE } else { i as u32 }).collect();
                harness.set("cloud.meta", &meta);
                harness.set("cloud.image_id", &image_id);
                harness.set("arrived", &[arrived]);
                let outputs = both(&mut harness);
                harness.frame.index += 1;
                exact = match f64::from(arrived) {
                    0.0 => exact,
                    arrived if exact == 0.0 => arrived,
                    arrived => exact + 0.1 * (arrived - exact),
                };
                for (side, outputs) in sides(&outputs) {
                    let rate = outputs.get::<f32>("rate")[0];
                    // Errors of a frame live on in the next ones, a tenth less each time.
                    let allowed =
                        Interval { low: exact - 20.0 * ulp(exact), high: exact + 20.0 * ulp(exact) };
                    let name = format!("{slots} points, frame {frame}, {arrived} arrive, evict {evict}");
                    rates.compare(
                        side,
                        &name,
                        [1, 1],
                        &[rate],
                        &[Expected { exact, allowed, unit: ulp(exact) }],
                    );
                    let rate = if arrived == 0 { 0.0 } else { rate };
                    let (aged, counts) = aged(&meta, &image_id, rate, [not_drawn, change], evict);
                    ages.compare_words(side, &name, [1, 1], &outputs.get("cloud.meta"), &aged);
                    ages.compare_words(side, &name, [256, 1], &outputs.get("histogram"), &counts);
                }
            }
        }
    }
    [ages.row(), rates.row()]
}

/// The points after a frame in which points are replaced at this rate, and how many there are of each age.
fn aged(
    meta: &[u32],
    image_id: &[u32],
    rate: f32,
    [not_drawn, change]: [f32; 2],
    evict: bool,
) -> (Vec<u32>, Vec<u32>) {
    // The quotient is rounded once before it is rounded to a whole number: no case may be so near to a half that this
    // matters.
    let exact = 32768.0 * f64::from(rate) / meta.len() as f64;
    assert!((exact.fract() - 0.5).abs() > 1e-6 * exact || exact > 65536.0, "{exact} is too near to a half");
    let increment = exact.round().min(65535.0);
    let not_drawn = (increment * f64::from(not_drawn)).round() as u64;
    let change = (f64::from(change) * 256.0).round() as u64;
    let mut counts = vec![0; 256];
    let aged = meta.iter().zip(image_id).map(|(&meta, &image_id)| {
        if meta & LIVE == 0 {
            return meta;
        }
        let mut age = u64::from(meta & 0xFFFF);
        if meta & FRESH == 0 {
            let unseen = age > 0 && image_id == NONE;
            age += increment as u64;
            age += if unseen { not_drawn } else { 0 };
            age += if meta & CHANGED != 0 { change } else { 0 };
            age = age.min(0xFFFF);
        }
        if evict && age >= 0xFF00 {
            return 0;
        }
        counts[age as usize / 256] += 1;
        meta & !(0xFFFF | CHANGED) | age as u32
    });
    (aged.collect(), counts)
}

/// Which slot each sample takes (`algorithms.md` section 1.9).
fn slots() -> Row {
    let mut measure = Measure::exact(
        "replace",
        "the slot of each sample",
        "1 to 70,000 slots, 1 to 70,000 samples, empty to full clouds; both `reuse`",
        "sorting",
    );
    let mut random = Random(3);
    for (slots, count) in [(1, 1), (1, 50), (300, 300), (1000, 70_000), (70_000, 1), (70_000, 65_537)] {
        for (live, reuse) in [(0, true), (60, true), (100, true), (100, false)] {
            let meta: Vec<u32> = (0..slots)
                .map(|_| {
                    let age = [random.bits() & 0xFFFF, 0, 0xFFFF, 0x8000][random.below(4) as usize];
                    if random.below(100) < live { LIVE | age } else { 0 }
                })
                .collect();
            let samples: Vec<Sample> = (0..count)
                .map(|_| Sample {
                    hit: random.below(3),
                    reuse: if random.below(2) == 0 { random.below(slots as u32 + 2) } else { NONE },
                    ..Sample::default()
                })
                .collect();
            let mut histogram = vec![0u32; 256];
            meta.iter()
                .filter(|meta| **meta & LIVE != 0)
                .for_each(|meta| histogram[(meta & 0xFFFF) as usize / 256] += 1);
            let mut harness = Harness::<Replace>::new(ReplaceParams { reuse }, &settings([1, 1], 1));
            harness.set("cloud.meta", &meta);
            harness.set("samples", &samples);
            harness.set("histogram", &histogram);
            let expected = chosen(&meta, &samples, reuse);
            for (side, outputs) in sides(&both(&mut harness)) {
                let name = format!("{slots} slots, {live}% live, {count} samples, reuse {reuse}");
                measure.compare_words(side, &name, [1, 1], &outputs.get("slots"), &expected);
            }
        }
    }
    measure.row()
}

fn chosen(meta: &[u32], samples: &[Sample], reuse: bool) -> Vec<u32> {
    let age = |slot: usize| if meta[slot] & LIVE == 0 { 256 } else { (meta[slot] & 0xFFFF) / 256 };
    let mut taken = vec![false; meta.len()];
    let mut chosen = vec![NONE; samples.len()];
    for (sample, slot) in samples.iter().zip(&mut chosen).filter(|_| reuse) {
        let wanted = sample.reuse as usize;
        if sample.hit != 0 && wanted < meta.len() && meta[wanted] & LIVE != 0 && !taken[wanted] {
            taken[wanted] = true;
            *slot = sample.reuse;
        }
    }
    let others = |chosen: &[u32], at: usize| samples[at].hit != 0 && chosen[at] == NONE;
    let need = (0..samples.len()).filter(|&at| others(&chosen, at)).count();
    let mut free: Vec<usize> = (0..meta.len()).filter(|&slot| !taken[slot]).collect();
    // The youngest age that is needed; older slots come first, in their order, then those of this age.
    free.sort_by_key(|&slot| std::cmp::Reverse(age(slot)));
    free.truncate(need);
    let youngest = free.last().map_or(0, |&slot| age(slot));
    free.sort_by_key(|&slot| (age(slot) == youngest, slot));
    let mut free = free.into_iter();
    for at in 0..samples.len() {
        if others(&chosen, at) {
            chosen[at] = free.next().map_or(NONE, |slot| slot as u32);
        }
    }
    chosen
}

/// What enters the cloud: the radiance in its nine bits, and the flags around pixels whose colour changed.
fn samples() -> [Row; 2] {
    let mut radiance = Measure::within(
        "integrate",
        "stored radiance",
        "0, 10^-45 to 3*10^38, all bits of a channel; negative, NaN and infinity as 0 and 65408",
        "f64",
        1.0,
        Unit::Of("1/512 of the brightest channel, or 2^-25"),
    );
    let mut flags = Measure::exact(
        "integrate",
        "flags, slots, positions, pixels, number that arrived",
        "1x1 to 16384x1; every mark of a sample; thresholds 0 and 1",
        "whole numbers",
    );
    let mut random = Random(4);
    for (number, size) in [[1, 1], [1, 40], [31, 17], [16384, 1]].into_iter().enumerate() {
        let pixels = (size[0] * size[1]) as usize;
        let (slots, count) = (2 * pixels + 3, pixels + 5);
        let odd = [
            0.0,
            -0.0,
            1e-45,
            1e-40,
            -1.0,
            1e30,
            65408.0,
            65407.9,
            f32::MAX,
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
        ];
        let mut light = || {
            [0; 3].map(|_| match random.below(3) {
                0 => odd[random.below(12) as usize],
                1 => random.between(0.0, 1.0),
                _ => random.between(1.0, 2.0) * random.between(-30.0, 17.0).exp2(),
            })
        };
        let light: Vec<[f32; 3]> = (0..count).map(|_| light()).collect();
        // Of half of the slots each is taken by one sample.
        let taken: Vec<u32> = (0..count as u32).map(|i| if i % 5 == 4 { NONE } else { 2 * i }).collect();
        let samples: Vec<Sample> = (0..count)
            .map(|i| Sample {
                position: [i as f32, -1e8, 1e-6],
                hit: random.below(3),
                radiance: light[i],
                body: random.below(256),
                pixel: random.below(pixels as u32),
                reuse: random.below(slots as u32 + 2),
                view: random.below(2),
                ..Sample::default()
            })
            .collect();
        let meta: Vec<u32> = (0..slots).map(|_| random.bits() & 0xFF07_FFFF).collect();
        let image_id: Vec<u32> = (0..slots)
            .map(|_| if random.below(4) == 0 { NONE } else { random.below(pixels as u32) })
            .collect();
        // Black or bright: what differs does so by far more than the threshold of 0, and by less than that of 1.
        let before: Vec<u32> =
            (0..slots).map(|_| if random.below(2) == 0 { 0 } else { 31 << 27 | 511 }).collect();
        let threshold = [0.0, 1.0][number % 2];
        let mut harness = Harness::<Integrate>::new(
            IntegrateParams { threshold, ..IntegrateParams::default() },
            &settings(size, 1),
        );
        harness.set("cloud.position", &vec![[5.0f32; 4]; slots]);
        harness.set("cloud.radiance", &before);
        harness.set("cloud.image_id", &image_id);
        harness.set("cloud.meta", &meta);
        harness.set("samples", &samples);
        harness.set("slots", &taken);
        harness.frame.index = 11;
        let outputs = both(&mut harness);

        let takes = |i: usize| samples[i].hit != 0 && (taken[i] as usize) < slots;
        let mut stamped = vec![false; pixels];
        for sample in (0..count).filter(|&i| takes(i)).map(|i| &samples[i]) {
            let shown = sample.reuse as usize;
            // The threshold of 0 sees every other colour, that of 1 none. What is black in nine bits is black.
            let now = sample.radiance.map(|x| if x > (-25f64).exp2() as f32 { x } else { 0.0 });
            let is_black = now == [0.0; 3];
            let differs = shown < slots && (before[shown] == 0) != is_black
                || shown < slots && !is_black && before[shown] != 0 && !same(now);
            if sample.view == 0 && shown < slots && meta[shown] & LIVE != 0 && threshold == 0.0 && differs {
                let (x, y) = (sample.pixel % size[0], sample.pixel / size[0]);
                for at in 0..pixels as u32 {
                    if (at % size[0]).abs_diff(x) <= 3 && (at / size[0]).abs_diff(y) <= 3 {
                        stamped[at as usize] = true;
                    }
                }
            }
        }
        let mut flagged: Vec<u32> = meta
            .iter()
            .zip(&image_id)
            .map(|(&meta, &pixel)| {
                let is_stamped = stamped.get(pixel as usize) == Some(&true);
                match meta & LIVE {
                    0 => meta,
                    _ => meta & !FRESH | if is_stamped { CHANGED } else { 0 },
                }
            })
            .collect();
        let (mut pixel, mut place) = (image_id.clone(), vec![[5.0f32; 4]; slots]);
        for i in (0..count).filter(|&i| takes(i)) {
            let slot = taken[i] as usize;
            flagged[slot] = LIVE | FRESH | samples[i].body << 24;
            pixel[slot] = NONE;
            let [x, y, z] = samples[i].position;
            place[slot] = [x, y, z, if samples[i].hit == 1 { 1.0 } else { 0.0 }];
        }
        let place: Vec<u32> = place.as_flattened().iter().map(|x| x.to_bits()).collect();
        let arrived = (0..count).filter(|&i| takes(i)).count() as u32;
        for (side, outputs) in sides(&outputs) {
            let name = format!("{size:?}");
            // Slots without a point may keep any bits but that of life.
            let known = |words: Vec<u32>| -> Vec<u32> {
                words.into_iter().map(|word| if word & LIVE == 0 { 0 } else { word }).collect()
            };
            flags.compare_words(
                side,
                &name,
                [1, 1],
                &known(outputs.get("cloud.meta")),
                &known(flagged.clone()),
            );
            flags.compare_words(side, &name, [1, 1], &outputs.get("cloud.image_id"), &pixel);
            flags.compare_words(side, &name, [1, 1], &outputs.get("cloud.position"), &place);
            flags.compare_words(side, &name, [1, 1], &outputs.get("arrived"), &[arrived]);
            let stored = outputs.get::<u32>("cloud.radiance");
            let (mut got, mut expected) = (vec![], vec![]);
            for i in (0..count).filter(|&i| takes(i)) {
                let word = stored[taken[i] as usize];
                let scale = f64::from(word >> 27) - 24.0;
                let clamped =
                    light[i].map(|x| f64::from(if x.is_nan() { 0.0 } else { x.clamp(0.0, 65408.0) }));
                let brightest = clamped.into_iter().fold(0.0, f64::max);
                for (channel, exact) in clamped.into_iter().enumerate() {
                    got.push((f64::from(word >> (9 * channel) & 511) * scale.exp2()) as f32);
                    let unit = (brightest / 512.0).max((-25f64).exp2());
                    let allowed = Interval { low: exact - unit, high: exact + unit };
                    expected.push(Expected { exact, allowed, unit });
                }
            }
            radiance.compare(side, &name, [3, got.len() / 3], &got, &expected);
        }
    }
    [radiance.row(), flags.row()]
}

/// Whether a colour is that of the bright points: red as bright as can be, and nothing else.
fn same([r, g, b]: [f32; 3]) -> bool {
    let step = 64.0;
    r >= 65408.0 - step && g < step && b < step
}

/// Points that move with their bodies, and that age as the light on them changes.
fn moved() -> [Row; 2] {
    let mut moved = Measure::within(
        "carry",
        "moved positions",
        "turns and shifts of 0, 10^-6 to 10^8 m; scales 10^-6 to 10^6",
        "f64",
        4.0,
        Unit::Of("ULP of the largest term"),
    );
    let mut lit = Measure::within(
        "carry",
        "ages",
        "moving lights of 0 to 10^30; penalties at both ends; no time step",
        "f64",
        1.0,
        Unit::Of("1/256 of an age"),
    );
    let mut random = Random(5);
    for exponent in [-6, -3, 0, 3, 6, 8] {
        let scale = 10f32.powi(exponent);
        for (number, power) in [0.0, 1e-30, 1.0, 1e30].into_iter().enumerate() {
            let count = 2000;
            let mut moves = vec![Move::REST; 256];
            for by in &mut moves[1..200] {
                // A turn about an axis and a shift.
                let (sin, cos) = random.between(-3.2, 3.2).sin_cos();
                let mut shift = || scale * random.between(-1.0, 1.0);
                *by = match number {
                    0 => Move::REST,
                    1 => Move {
                        x: [1.0, 0.0, 0.0, shift()],
                        y: [0.0, 1.0, 0.0, shift()],
                        z: [0.0, 0.0, 1.0, shift()],
                    },
                    _ => Move {
                        x: [cos, 0.0, sin, shift()],
                        y: [0.0, 1.0, 0.0, shift()],
                        z: [-sin, 0.0, cos, shift()],
                    },
                };
            }
            let position: Vec<[f32; 4]> = (0..count)
                .map(|i| {
                    let [x, y, z] = [0; 3].map(|_| scale * random.between(-1.0, 1.0));
                    [x, y, z, if i % 10 == 0 { 0.0 } else { 1.0 }]
                })
                .collect();
            let meta: Vec<u32> = (0..count).map(|_| random.bits() & 0xFF07_00FF).collect();
            let lamp =
                |at: f32| Lamp { position: [at, 3.0 * scale, at], power, uniform_share: 1.0, ..Lamp::NONE };
            // Some per cent more or less light, or the same.
            let [before, now] =
                [0.0, [0.0, 0.05, 0.01, 0.3][number]].map(|at| [lamp(at * scale), Lamp::NONE]);
            let params = CarryParams {
                penalty: [2.0, 0.0, 255.0, 2.0][number],
                relight: [255.0, 32.0, 0.0, 1.0][number],
                shadow: 64.0,
                ..CarryParams::default()
            };
            let mut harness = Harness::<Carry>::new(params.clone(), &settings([1, 1], 1));
            harness.set("cloud.position", &position);
            harness.set("cloud.meta", &meta);
            harness.set("moves", &moves);
            harness.set("lights_before", &before);
            harness.set("lights", &now);
            harness.set("blockers_before", &[Blocker::NONE; 2]);
            harness.set("blockers", &[Blocker::NONE; 2]);
            for (side, outputs) in sides(&both(&mut harness)) {
                let name = format!("scale {scale:e}, light {power:e}");
                let got = outputs.get::<[f32; 4]>("cloud.position");
                let (mut numbers, mut expected) = (vec![], vec![]);
                for ((&meta, &from), got) in
                    meta.iter().zip(&position).zip(&got).filter(|((meta, _), _)| **meta & LIVE != 0)
                {
                    let by = &moves[(meta >> 24) as usize];
                    for (axis, row) in [by.x, by.y, by.z].into_iter().enumerate() {
                        fn along<N: Number>(row: [f32; 4], [x, y, z, _]: [f32; 4]) -> N {
                            let [a, b, c, d] = row.map(N::given);
                            a * N::given(x) + b * N::given(y) + c * N::given(z) + d
                        }
                        let terms = (0..3)
                            .map(|i| f64::from(row[i] * from[i]).abs())
                            .fold(f64::from(row[3]).abs(), f64::max);
                        numbers.push(got[axis]);
                        expected.push(Expected {
                            exact: along(row, from),
                            allowed: along(row, from),
                            unit: ulp(terms),
                        });
                    }
                }
                moved.compare(side, &name, [3, numbers.len() / 3], &numbers, &expected);
                let (mut numbers, mut expected) = (vec![], vec![]);
                let ages = outputs.get::<u32>("cloud.meta");
                for i in (0..count).filter(|&i| meta[i] & (LIVE | FRESH) == LIVE && position[i][3] != 0.0) {
                    let by = &moves[(meta[i] >> 24) as usize];
                    let here = position[i].map(f64::from);
                    let there = [by.x, by.y, by.z].map(|row| {
                        (0..3).map(|k| f64::from(row[k]) * here[k]).sum::<f64>() + f64::from(row[3])
                    });
                    let light = |lamp: &Lamp, at: [f64; 3]| {
                        let squared: f64 =
                            (0..3).map(|k| (at[k] - f64::from(lamp.position[k])).powi(2)).sum();
                        f64::from(lamp.power) / squared.max(1e-12)
                    };
                    let lights = [light(&before[0], [here[0], here[1], here[2]]), light(&now[0], there)];
                    let more = lights[0].max(lights[1]);
                    // Light too weak for single precision is none, or any: nothing is claimed of the age then.
                    if more != 0.0 && !(1e-37..1e38).contains(&more) {
                        continue;
                    }
                    let change = if more > 0.0 { (lights[0] - lights[1]).abs() / more } else { 0.0 };
                    let turn = if *by == Move::REST { 0.0 } else { f64::from(params.penalty) };
                    let penalty = (turn + f64::from(params.relight) * 100.0 * change).min(255.0) * 256.0;
                    let exact = (f64::from(meta[i] & 0xFFFF) + penalty).min(65535.0);
                    numbers.push((ages[i] & 0xFFFF) as f32);
                    // What rounding makes of the change, times its weight.
                    let slack =
                        1.0 + f64::from(params.relight) * 100.0 * 256.0 * 40.0 * f64::from(f32::EPSILON);
                    expected.push(Expected {
                        exact,
                        allowed: Interval { low: exact - slack, high: exact + slack },
                        unit: 1.0,
                    });
                }
                lit.compare(side, &name, [1, numbers.len()], &numbers, &expected);
            }
        }
    }
    [moved.row(), lit.row()]
}

/// Mean albedos of points, whose colours have joined `count` samples (section 12.3).
fn albedos() -> Row {
    let mut measure = Measure::within(
        "albedo",
        "mean albedo of a point",
        "counts of 1 to 2^20, below 1 and negative; 1 to 70,000 samples, with and without slots",
        "f64",
        0.6,
        Unit::Of("1/65535"),
    );
    let mut random = Random(7);
    for count in [1, 50, 70_000] {
        let record: Vec<[f32; 4]> = (0..count)
            .map(|_| {
                let counts = [
                    1.0,
                    random.between(0.001, 1.0),
                    random.between(1.0, 9.0),
                    random.between(1.0, 1048576.0),
                ];
                let sign = if random.below(3) == 0 { -1.0 } else { 1.0 };
                [0.0, 0.0, 1.0, sign * counts[random.below(4) as usize]]
            })
            .collect();
        let mut sampled = |hit: u32| -> Vec<Sample> {
            let hits = |random: &mut Random| if hit > 0 { hit } else { random.below(3) };
            (0..count)
                .map(|_| Sample {
                    hit: hits(&mut random),
                    albedo: random.bits() & 0xFF_FFFF,
                    ..Sample::default()
                })
                .collect()
        };
        let [first, samples] = [sampled(1), sampled(0)];
        let all: Vec<u32> = (0..count as u32).collect();
        let some: Vec<u32> = all.iter().map(|&i| if i % 5 == 4 { NONE } else { i }).collect();
        let mut harness = Harness::<Albedo>::new((), &settings([1, 1], 1));
        harness.set("cloud.record", &vec![[0.0f32, 0.0, 1.0, 1.0]; count]);
        harness.set("samples", &first);
        harness.set("slots", &all);
        let before = both(&mut harness);
        harness.set("cloud.record", &record);
        harness.set("samples", &samples);
        harness.set("slots", &some);
        let codes = |[rg, b]: [u32; 2]| [rg & 0xFFFF, rg >> 16, b].map(f64::from);
        for ((side, outputs), (_, before)) in sides(&both(&mut harness)).into_iter().zip(sides(&before)) {
            let before = before.get::<[u32; 2]>("albedos");
            let mut worst = 0f64;
            for (i, got) in outputs.get::<[u32; 2]>("albedos").into_iter().enumerate() {
                let share = match some[i] {
                    NONE => 0.0,
                    _ if samples[i].hit == 0 => 0.0,
                    _ => 1.0 / f64::from(record[i][3].abs().max(1.0)),
                };
                let code = if samples[i].albedo == 0 { 0xFF_FFFF } else { samples[i].albedo };
                for (lane, (before, got)) in codes(before[i]).into_iter().zip(codes(got)).enumerate() {
                    let root = f64::from(code >> (8 * lane) & 255) / 255.0;
                    let own = 65535.0 * (root * root).max(0.05);
                    worst = worst.max((before + (own - before) * share - got).abs());
                }
            }
            measure.record(side, &format!("{count} samples"), worst, 3 * count);
        }
    }
    measure.row()
}

/// Points that age as a body moves between them and their light.
fn shadowed() -> Row {
    let mut measure = Measure::exact(
        "carry",
        "ages of points behind a body that moves",
        "lamps of radius 0 to the body's size; scales 10^-3 to 10^6; lines that graze the box either way",
        "slabs in f64",
    );
    let mut random = Random(6);
    for exponent in [-3, 0, 3, 6] {
        for share in [0.0, 0.3, 1.0] {
            let scale = 10f32.powi(exponent);
            let (sin, cos) = random.between(-3.0, 3.0).sin_cos();
            let turned = |shift: f32| Blocker {
                x: [cos, 0.0, sin, shift * scale],
                y: [0.0, 1.0, 0.0, 0.0],
                z: [-sin, 0.0, cos, -shift * scale],
                extent: [0.5, 0.3, 0.4].map(|half: f32| half * scale),
                body: 3,
            };
            let boxes = [turned(0.0), turned(0.2)];
            let lamp = Lamp {
                position: [0.2, 3.0, -0.1].map(|at: f32| at * scale),
                power: scale * scale,
                uniform_share: 1.0,
                radius: share * 0.5 * scale,
                ..Lamp::NONE
            };
            let count = 3000;
            let position: Vec<[f32; 4]> = (0..count)
                .map(|_| {
                    let [x, y, z] = [0; 3].map(|_| scale * random.between(-2.0, 2.0));
                    [x, y, z, 1.0]
                })
                .collect();
            // Some points are on the body itself.
            let meta: Vec<u32> =
                (0..count).map(|i| LIVE | (u32::from(i % 5 == 0) * 3) << 24 | i & 0xFF).collect();
            let params = CarryParams { penalty: 0.0, relight: 0.0, shadow: 64.0, ..CarryParams::default() };
            let mut harness = Harness::<Carry>::new(params, &settings([1, 1], 1));
            harness.set("cloud.position", &position);
            harness.set("cloud.meta", &meta);
            harness.set("moves", &[Move::REST; 256]);
            harness.set("lights_before", &[lamp, Lamp::NONE]);
            harness.set("lights", &[lamp, Lamp::NONE]);
            harness.set("blockers_before", &[boxes[0], Blocker::NONE]);
            harness.set("blockers", &[boxes[1], Blocker::NONE]);
            let expected: Vec<Option<u32>> = (0..count as usize)
                .map(|i| {
                    let point = [0, 1, 2].map(|axis| f64::from(position[i][axis]));
                    // A little larger or smaller, the box must be hit as often, or rounding may decide.
                    let covered = |size: f64| boxes.iter().any(|of| is_between(of, &lamp, point, size));
                    let hits = [covered(1.0 - 1e-4), covered(1.0 + 1e-4)];
                    let ages = hits[0] && meta[i] >> 24 == 0;
                    (hits[0] == hits[1]).then_some(meta[i] + if ages { 64 * 256 } else { 0 })
                })
                .collect();
            for (side, outputs) in sides(&both(&mut harness)) {
                let got = outputs.get::<u32>("cloud.meta");
                let expected: Vec<u32> =
                    expected.iter().zip(&got).map(|(of, &got)| of.unwrap_or(got)).collect();
                let aged = expected.iter().zip(&meta).filter(|(a, b)| a != b).count();
                assert!((50..2500).contains(&aged), "{aged} points are in shadow");
                measure.compare_words(
                    side,
                    &format!("scale {scale:e}, radius {share}"),
                    [1, 1],
                    &got,
                    &expected,
                );
            }
        }
    }
    measure.row()
}

/// Whether the line from a point to a lamp hits a box, enlarged by the lamp's radius as it is seen there.
fn is_between(body: &Blocker, lamp: &Lamp, point: [f64; 3], size: f64) -> bool {
    let at_rest = |at: [f64; 3]| {
        [body.x, body.y, body.z]
            .map(|row| (0..3).map(|axis| f64::from(row[axis]) * at[axis]).sum::<f64>() + f64::from(row[3]))
    };
    let (start, end) = (at_rest(point), at_rest(lamp.position.map(f64::from)));
    let along = [0, 1, 2].map(|axis| end[axis] - start[axis]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    // Where the line passes the box's middle.
    let nearest = (-dot(start, along) / dot(along, along)).clamp(0.0, 1.0);
    let (mut enter, mut leave) = (0f64, 1f64);
    for axis in 0..3 {
        let half = (f64::from(body.extent[axis]) + f64::from(lamp.radius) * nearest) * size;
        let ends = [-half, half].map(|side| (side - start[axis]) / along[axis]);
        enter = enter.max(ends[0].min(ends[1]));
        leave = leave.min(ends[0].max(ends[1]));
    }
    enter <= leave
}
