//! Depths: the encodings of `algorithms.md` section 3, and the stages that compare depths.

use std::sync::LazyLock;

use epigraph_core::{
    Harness, Side,
    testing::{Random, settings},
};
use epigraph_stages::{
    depth_cull::{DepthCull, DepthCullParams, Rule},
    reach_cull::{ReachCull, ReachCullParams},
};

use crate::{
    Group, both,
    interval::{Interval, Number, ulp},
    measured,
    table::{Expected, Measure, Row, Unit, markdown, rounded_up},
};

/// The bits of infinity: no point.
const NONE: u32 = 0x7F80_0000;

pub static ROWS: Group = LazyLock::new(|| {
    measured(&[|| vec![means()], || vec![seed_exact()], || vec![votes()], || vec![reachable_votes()]])
});

// ---- Encodings

/// Relative error of a shift by c (f - n) metres, in single precision: of the forward z-buffer, the reversed one, the
/// reversed one without a far plane, and of linear depth. Infinite where the shifted depth is beyond the far plane.
fn shift_errors(n: f64, f: f64, c: f64, z: f64) -> [f64; 4] {
    let (rho, d) = (n / f, f - n);
    let q = d / f;
    let given = |x: f64| x as f32;
    let fraction = |x: f32, [a, b, g, h]: [f64; 4]| -> f64 {
        ((given(a) * x + given(b)) / (given(g) * x + given(h))).into()
    };
    let forward = fraction(given(f * (z - n) / (z * d)), [rho - c * q, c, -c * q * q, rho + c * q]);
    let forward = if forward < 1.0 { f * n / (f - forward * d) } else { f64::INFINITY };
    let reversed = [rho * (1.0 - c * q), -rho * c * rho, c * q * q, rho * (1.0 + c * q)];
    let reversed = f * n / (n + fraction(given(n * (f - z) / (z * d)), reversed) * d);
    let infinite = given(n / z);
    let infinite = n / f64::from(infinite / (1.0 + given(c * d / n) * infinite));
    let linear = f64::from(given(z) + given(c * d));
    [forward, reversed, infinite, linear].map(|shifted| (shifted - z - c * d).abs() / (c * d))
}

/// The error of a distance after it was stored as a depth: forward, reversed, reversed without a far plane, linear.
fn stored_errors(n: f64, f: f64, z: f64) -> [f64; 4] {
    let d = f - n;
    let stored = |x: f64| f64::from(x as f32);
    let forward = f * n / (f - stored(f * (z - n) / (z * d)) * d);
    let reversed = f * n / (n + stored(n * (f - z) / (z * d)) * d);
    [forward, reversed, n / stored(n / z), stored(z)].map(|back| (back - z).abs())
}

/// A case of `algorithms.md` section 3: near, far, shift and distances; and the worst that it prints: the error of the
/// stored depth, and of the shift forward, reversed, and reversed without a far plane.
type Case = ([f64; 3], &'static [f64], [f64; 4]);

const SECTION_3: [Case; 6] = [
    ([100.0, 1e4, 0.05], &[5000.0], [2.5e-3, 1.4e-4, 1e-7, 3e-7]),
    ([100.0, 1e4, 1e-5], &[9500.0], [1.6e-2, 0.84, 3e-4, 1e-2]),
    ([0.1, 1e3, 0.05], &[100.0], [2.7e-5, 0.094, 2e-7, 2e-8]),
    ([0.1, 1e3, 0.05], &[500.0], [1.7e-2, 3.9, 4e-8, 1e-6]),
    ([0.1, 1e3, 0.05], &[950.0], [0.17, f64::INFINITY, 4e-8, 1e-6]),
    ([0.1, 1e4, 0.05], &[1000.0, 5000.0, 9500.0], [9.0, f64::INFINITY, 2e-7, 7e-7]),
];

/// The error of the stored depth and of the four shifts of a case, at worst.
fn worst([n, f, c]: [f64; 3], distances: &[f64]) -> [f64; 5] {
    distances.iter().fold([0.0; 5], |worst, &z| {
        let [forward, reversed, infinite, linear] = shift_errors(n, f, c, z);
        let errors = [stored_errors(n, f, z)[0], forward, reversed, infinite, linear];
        std::array::from_fn(|i| errors[i].max(worst[i]))
    })
}

fn text(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    if x.is_finite() { format!("{x:.1e}") } else { "beyond the far plane".into() }
}

/// The table of section 3.
pub fn shifts() -> String {
    let lines = SECTION_3.map(|(given, distances, _)| {
        let [first, .., last] = [&distances[..1], distances].concat()[..] else {
            unreachable!("two or more")
        };
        let distances_text = if first == last { first.to_string() } else { format!("{first} to {last}") };
        let given_text = given.map(|x| x.to_string());
        let errors = worst(given, distances).map(text);
        given_text.into_iter().chain([distances_text]).chain(errors).collect()
    });
    let headings = [
        "near, m",
        "far, m",
        "shift, of far - near",
        "distance, m",
        "error of the stored depth, m",
        "shift: forward",
        "reversed",
        "reversed, no far plane",
        "linear",
    ];
    markdown(&headings, &lines)
}

/// The worst relative error of a distance that was stored, by the ratio of far and near.
pub fn encodings() -> String {
    let lines: Vec<_> = (1..=9)
        .map(|exponent| {
            let (n, f) = (1.0, 10f64.powi(exponent));
            let mut worst = [0f64; 4];
            for step in 0..=4000 {
                let z = n * (f / n).powf(f64::from(step) / 4000.0);
                let errors = stored_errors(n, f, z.min(f));
                worst = std::array::from_fn(|i| worst[i].max(errors[i] / z));
            }
            std::iter::once(format!("10^{exponent}")).chain(worst.map(rounded_up)).collect()
        })
        .collect();
    markdown(&["far / near", "forward", "reversed", "reversed, no far plane", "linear"], &lines)
}

#[test]
fn the_figures_of_section_3_come_out_again() {
    for (given, distances, printed) in SECTION_3 {
        let found = worst(given, distances);
        for (found, printed) in found.into_iter().zip(printed) {
            // The section prints one or two digits, and errors of a single rounding depend on the compiler.
            let close = found == printed || (0.3..=3.0).contains(&(found / printed));
            assert!(close, "{given:?} {distances:?}: {found:e}, printed is {printed:e}");
        }
        // Linear depth: the roundings of the distance, of the shift and of their sum.
        let [n, f, c] = given;
        let shift = c * (f - n);
        let bound = |z: f64| 0.5 * (ulp(z) + ulp(shift) + ulp(z + shift)) / shift;
        assert!(found[4] <= distances.iter().map(|&z| bound(z)).fold(0.0, f64::max), "{:e}", found[4]);
    }
}

// ---- The cull

/// An image of distances with holes.
struct Image {
    size: [u32; 2],
    depth: Vec<u32>,
}

impl Image {
    /// Distances evenly spread on a logarithmic scale.
    fn random(size: [u32; 2], near: f32, far: f32, share: f32, random: &mut Random) -> Self {
        let depth = (0..size[0] * size[1]).map(|_| {
            let z = near * (far / near).powf(random.between(0.0, 1.0));
            if random.between(0.0, 1.0) < share { z.clamp(near, far).to_bits() } else { NONE }
        });
        Self { size, depth: depth.collect() }
    }

    fn shape(&self) -> [usize; 2] {
        self.size.map(|side| side as usize)
    }

    /// Indices of the pixels around one, within a reach, that are in the image.
    fn around(&self, at: usize, reach: i32) -> impl Iterator<Item = usize> + use<> {
        let [width, height] = self.size.map(|side| side as i32);
        let (x, y) = (at as i32 % width, at as i32 / width);
        let columns = (x - reach).max(0)..=(x + reach).min(width - 1);
        columns.flat_map(move |x| {
            ((y - reach).max(0)..=(y + reach).min(height - 1)).map(move |y| (y * width + x) as usize)
        })
    }

    /// The mean of what `value` makes of the distances of 3x3 pixels.
    fn mean<N: Number>(&self, at: usize, kept: &[bool], value: impl Fn(N) -> N) -> Option<N> {
        // Columns are summed first: the order decides how sums are rounded.
        let there: Vec<usize> = self.around(at, 1).filter(|&q| self.depth[q] != NONE && kept[q]).collect();
        let columns = there.chunk_by(|a, b| a % self.size[0] as usize == b % self.size[0] as usize);
        let add = |a: N, b: N| a + b;
        let sums = columns.filter_map(|column| {
            column.iter().map(|&q| value(N::given(f32::from_bits(self.depth[q])))).reduce(add)
        });
        sums.reduce(add).map(|sum| sum / N::given(there.len() as f32))
    }

    /// The points that a vote leaves, among those that the one before left; `None` where single precision may decide
    /// either way. At least half of the others in the 5x5 pixels are clearly nearer; along the border as many pixels
    /// more are needed as are missing, but 7 of 8 are enough (`depth_cull`'s documentation).
    fn vote(&self, kept: &[bool], threshold: f32, at: usize) -> Option<bool> {
        let inside = self.around(at, 2).count() - 1;
        let others = self.around(at, 2).filter(|&q| q != at && kept[q]);
        let scale = 1.0 + threshold;
        self.nearer(at, others, scale, |nearer, voters| {
            voters > 0 && nearer * 2 * inside.max(1) >= voters * (inside.max(1) * 7 / 4).min(24)
        })
        .map(|hidden| !hidden)
    }

    /// What `decide` makes of the number of the others that are clearly nearer, and the number of the others.
    fn nearer(
        &self,
        at: usize,
        others: impl Iterator<Item = usize>,
        scale: f32,
        decide: impl Fn(usize, usize) -> bool,
    ) -> Option<bool> {
        let own = f64::from(f32::from_bits(self.depth[at]));
        let (mut voters, mut surely, mut perhaps) = (0, 0, 0);
        for q in others {
            let scaled = Interval::given(f32::from_bits(self.depth[q])) * Interval::given(scale);
            voters += 1;
            surely += usize::from(scaled.high < own);
            perhaps += usize::from(scaled.low < own);
        }
        let [least, most] = [surely, perhaps].map(|nearer| decide(nearer, voters));
        (least == most).then_some(least)
    }
}

/// Ratios of far and near, from 10 to 10^9.
fn ratios() -> impl Iterator<Item = (f32, f32)> {
    (1..=9).map(|exponent| (1e-3, 1e-3 * 10f32.powi(exponent)))
}

const SIZES: [[u32; 2]; 5] = [[1, 1], [1, 23], [31, 17], [64, 65], [16384, 1]];

/// Runs a rule over all ratios, sizes and thresholds, and calls `check` with each side's outputs.
fn cull(rule: Rule, mut check: impl FnMut(Side, &str, &Image, &DepthCullParams, [f32; 2], &[u32], &[f32])) {
    let mut random = Random(1);
    for size in SIZES {
        for (number, (near, far)) in ratios().enumerate() {
            let threshold = [0.0, 0.05, 10.0][number % 3];
            let image = Image::random(size, near, far, [0.2, 1.0][number % 2], &mut random);
            let params = DepthCullParams { rule, threshold };
            let mut harness = Harness::<DepthCull>::new(params.clone(), &settings(size, 1));
            (harness.frame.view.near, harness.frame.view.far) = (near, far);
            harness.set("id", &(0..image.depth.len() as u32).collect::<Vec<_>>());
            harness.set("depth", &image.depth);
            let outputs = both(&mut harness);
            let case = format!("{rule:?} {size:?} 1:{:e} threshold {threshold}", far / near);
            for (side, outputs) in [(Side::Cpu, &outputs.cpu), (Side::Gpu, &outputs.gpu)] {
                let (id, filtered) = (outputs.get::<u32>("id"), outputs.get::<f32>("filtered"));
                check(side, &case, &image, &params, [near, far], &id, &filtered);
            }
        }
    }
}

/// What the linear rules write: the mean of 3x3 distances, shifted by the threshold.
fn means() -> Row {
    let mut measure = Measure::within(
        "depth_cull",
        "filtered depth, linear",
        "far / near 10 to 10^9; thresholds 0, 0.05, 10; 1x1 to 16384x1",
        "f64",
        5.0,
        Unit::Of("ULP"),
    );
    cull(Rule::Relative, |side, case, image, params, [_, far], _, filtered| {
        fn shifted<N: Number>(image: &Image, at: usize, threshold: f32, far: f32) -> N {
            let all = vec![true; image.depth.len()];
            let scale = N::given(1.0) + N::given(threshold);
            let mean = image.mean::<N>(at, &all, |z| z);
            mean.map_or(N::given(far), |mean| (mean * scale).min(N::given(far)))
        }
        let expected: Vec<Expected> = (0..filtered.len())
            .map(|at| {
                let exact = shifted::<f64>(image, at, params.threshold, far);
                let allowed = shifted::<Interval>(image, at, params.threshold, far);
                Expected { exact, allowed, unit: ulp(exact) }
            })
            .collect();
        measure.compare(side, case, image.shape(), filtered, &expected);
    });
    measure.row()
}

/// The papers' rule, in the depths of a z-buffer: what it writes, and what it drops where that is certain.
fn seed_exact() -> Row {
    let mut measure = Measure::within(
        "depth_cull",
        "filtered depth, `SeedExact`",
        "the same; measured where the interval is narrower than half of the distance",
        "f64, section 3",
        0.2,
        Unit::Of("of the interval that WGSL allows"),
    );
    cull(Rule::SeedExact, |side, case, image, params, range, _, filtered| {
        fn distance<N: Number>(image: &Image, at: usize, threshold: f32, [near, far]: [f32; 2]) -> N {
            let all = vec![true; image.depth.len()];
            let [one, n, f, c] = [1.0, near, far, threshold].map(N::given);
            let mean = image.mean::<N>(at, &all, |z| (one - n / z) * (f / (f - n)));
            let Some(mean) = mean else { return f };
            let (rho, q) = (n / f, one - n / f);
            let shifted = ((rho - c * q) * mean + c) / (-(c * q * q) * mean + (rho + c * q));
            (n / (one - shifted.min(one) * ((f - n) / f))).max(n).min(f)
        }
        let expected: Vec<Expected> = (0..filtered.len())
            .map(|at| {
                let exact = distance::<f64>(image, at, params.threshold, range);
                let allowed = distance::<Interval>(image, at, params.threshold, range);
                // Where the interval is wide, nothing is left of the shift to measure.
                let half = (allowed.high - exact).max(exact - allowed.low).max(ulp(exact));
                Expected { exact, allowed, unit: if half < 0.5 * exact { half } else { f64::INFINITY } }
            })
            .collect();
        measure.compare(side, case, image.shape(), filtered, &expected);
    });
    measure.row()
}

/// Which points the votes drop.
fn votes() -> Row {
    let mut measure = Measure::exact(
        "depth_cull",
        "points dropped, `Majority`",
        "the same; undecided ones either way",
        "two votes over 5x5",
    );
    cull(Rule::Majority, |side, case, image, params, _, id, _| {
        let there: Vec<bool> = image.depth.iter().map(|&depth| depth != NONE).collect();
        let first: Vec<_> = (0..there.len())
            .map(|at| if there[at] { image.vote(&there, params.threshold, at) } else { Some(false) })
            .collect();
        let kept: Vec<bool> = first.iter().map(|kept| kept.unwrap_or(true)).collect();
        let expected: Vec<u32> = (0..id.len())
            .map(|at| {
                let unsure = image.around(at, 2).any(|q| first[q].is_none());
                let stays = if kept[at] { image.vote(&kept, params.threshold, at) } else { Some(false) };
                match stays {
                    Some(stays) if !unsure => {
                        if stays || !there[at] {
                            at as u32
                        } else {
                            u32::MAX
                        }
                    }
                    _ => id[at],
                }
            })
            .collect();
        // A pixel without a point keeps whatever it had or loses it: it shows none.
        let shown: Vec<u32> = (0..id.len()).map(|at| if there[at] { id[at] } else { expected[at] }).collect();
        measure.compare_words(side, case, image.shape(), &shown, &expected);
    });
    measure.row()
}

/// Which points the votes of those in reach drop.
fn reachable_votes() -> Row {
    let mut measure = Measure::exact(
        "reach_cull",
        "points dropped",
        "far / near 10 to 10^9; thresholds 0, 0.05, 10; 0 to 4 passes; 1x1 to 16384x1",
        "votes among those in reach",
    );
    let mut random = Random(2);
    for (number, size) in SIZES.into_iter().enumerate() {
        for passes in 0..=4 {
            let (near, far) = ratios().nth((2 * number + passes as usize) % 9).expect("nine ratios");
            let threshold = [0.05, 0.0, 10.0][passes as usize % 3];
            let image = Image::random(size, near, far, 0.6, &mut random);
            let r24: Vec<u32> = image.depth.iter().map(|_| random.bits() & 0xFF_FFFF).collect();
            let kept: Vec<u32> =
                (0..).zip(&image.depth).map(|(at, &z)| if z == NONE { u32::MAX } else { at }).collect();
            let mut harness =
                Harness::<ReachCull>::new(ReachCullParams { threshold, passes }, &settings(size, 1));
            harness.set("kept", &kept);
            harness.set("depth", &image.depth);
            harness.set("r24", &r24);
            harness.set("cls", &vec![u32::MAX; kept.len()]);
            let outputs = both(&mut harness);
            let (mut there, mut unsure): (Vec<bool>, Vec<bool>) =
                kept.iter().map(|&id| (id != u32::MAX, false)).unzip();
            for _ in 0..passes {
                let judged: Vec<Option<bool>> = (0..there.len())
                    .map(|at| {
                        let [width, height] = image.size.map(|side| side as i32);
                        let (x, y) = (at as i32 % width, at as i32 / width);
                        // Bit k of r24 is the k-th of the other pixels of the 5x5, row by row (section 2.5).
                        let others =
                            (0..24).filter(|k| r24[at] >> k & 1 == 1).map(|k| if k < 12 { k } else { k + 1 });
                        let places = others.map(|raw| [x + raw % 5 - 2, y + raw / 5 - 2]);
                        let inside =
                            places.filter(|[x, y]| (0..width).contains(x) && (0..height).contains(y));
                        let others: Vec<usize> = inside.map(|[x, y]| (y * width + x) as usize).collect();
                        let hidden = image.nearer(
                            at,
                            others.iter().copied().filter(|&q| there[q]),
                            1.0 + threshold,
                            |nearer, count| count > 0 && 2 * nearer >= count,
                        );
                        let sure = !unsure[at] && others.iter().all(|&q| !unsure[q]);
                        if there[at] {
                            hidden.filter(|_| sure).map(|hidden| !hidden)
                        } else {
                            Some(false).filter(|_| !unsure[at])
                        }
                    })
                    .collect();
                there = judged.iter().map(|stays| stays.unwrap_or(true)).collect();
                unsure = judged.iter().map(Option::is_none).collect();
            }
            for (side, outputs) in [(Side::Cpu, &outputs.cpu), (Side::Gpu, &outputs.gpu)] {
                let id = outputs.get::<u32>("id");
                let expected: Vec<u32> = (0..id.len())
                    .map(|at| match (unsure[at], there[at]) {
                        (true, _) => id[at],
                        (false, true) => kept[at],
                        (false, false) => u32::MAX,
                    })
                    .collect();
                measure.compare_words(
                    side,
                    &format!("{size:?}, {passes} passes"),
                    image.shape(),
                    &id,
                    &expected,
                );
            }
        }
    }
    measure.row()
}
