//! Filters, anti-aliasing and tone mapping: colours, against the same means in f64.

use std::sync::LazyLock;

use epigraph_core::{
    Harness,
    testing::{Random, settings},
};
use epigraph_stages::{
    antialias::{Antialias, AntialiasParams, Neighbour},
    fill::{Empty, Fill, FillParams, Priority},
    interpolate::{Interpolate, InterpolateParams, Kernel, Space},
    spread::{self, Spread, SpreadParams},
    subdivide::{Subdivide, SubdivideParams},
    tonemap::{Curve, Tonemap, TonemapParams},
};

use crate::{
    Group, both,
    interval::{Interval, Number, ulp},
    measured,
    pixels::{COMPLEX, EMPTY, SIMPLE, SIZES, class_of, crossed, masks, random_classes, sides},
    table::{Expected, Measure, Row, Unit},
};

pub static ROWS: Group = LazyLock::new(|| {
    measured(&[
        || filled().into(),
        || interpolated().into(),
        || vec![blended()],
        || vec![spread_out()],
        || vec![quartered()],
        || vec![codes()],
        || vec![whites()],
    ])
});

const NONE: u32 = u32::MAX;

/// The colour of RGB9E5.
fn decoded(word: u32) -> [f32; 3] {
    let scale = ((word >> 27) as i32 - 24) as f32;
    [0, 9, 18].map(|shift| (word >> shift & 511) as f32 * scale.exp2())
}

/// Words of the cloud's radiance: black, as dark and as bright as can be, and anything.
fn lights(count: usize, random: &mut Random) -> Vec<u32> {
    let ends = [0, 1, 511, 31 << 27 | 0x7FF_FFFF, 31 << 27 | 1, 16 << 27 | 256];
    (0..count)
        .map(|_| if random.below(3) == 0 { ends[random.below(6) as usize] } else { random.bits() })
        .collect()
}

/// A picture and its pixels.
#[derive(Clone, Copy)]
pub struct Shape([i32; 2]);

impl Shape {
    pub fn new(size: [u32; 2]) -> Self {
        Self(size.map(|side| side as i32))
    }

    pub fn pixels(self) -> impl Iterator<Item = [i32; 2]> {
        let [width, height] = self.0;
        (0..height).flat_map(move |y| (0..width).map(move |x| [x, y]))
    }

    pub fn index(self, [x, y]: [i32; 2]) -> Option<usize> {
        let inside = (0..self.0[0]).contains(&x) && (0..self.0[1]).contains(&y);
        inside.then(|| (y * self.0[0] + x) as usize)
    }

    fn lanes(self) -> [usize; 2] {
        [4 * self.0[0] as usize, self.0[1] as usize]
    }
}

/// A colour and its weight, or a sum of such.
type Tap<N> = [N; 4];

fn add<N: Number>(a: Tap<N>, b: Tap<N>) -> Tap<N> {
    std::array::from_fn(|lane| a[lane] + b[lane])
}

fn scaled<N: Number>(a: Tap<N>, by: f32) -> Tap<N> {
    a.map(|lane| lane * N::given(by))
}

fn mean<N: Number>([r, g, b, weight]: Tap<N>) -> [N; 3] {
    [r / weight, g / weight, b / weight]
}

/// What is expected of a colour with alpha, from both evaluations of its oracle.
fn expect(exact: [f64; 3], allowed: [Interval; 3], alpha: f32, unit: impl Fn(f64) -> f64) -> [Expected; 4] {
    let alpha = f64::from(alpha);
    std::array::from_fn(|lane| match lane {
        3 => Expected { exact: alpha, allowed: Interval::exactly(alpha), unit: ulp(alpha) },
        _ => Expected { exact: exact[lane], allowed: allowed[lane], unit: unit(exact[lane]) },
    })
}

fn bits(color: [f32; 4]) -> [Expected; 4] {
    let [r, g, b, alpha] = color;
    let exact = [r, g, b].map(f64::from);
    expect(exact, exact.map(Interval::exactly), alpha, ulp)
}

// ---- Render cache

fn filled() -> [Row; 2] {
    const DOMAIN: &str = "radiance 0, 2^-24 to 65408, any; ages at both ends; all rules; 1x1 to 16384x1";
    let mut color = Measure::within("fill", "colours", DOMAIN, "f64", 3.0, Unit::Of("ULP"));
    let mut priority = Measure::exact("fill", "priorities", "the same", "section 1.6");
    let mut random = Random(1);
    for size in SIZES {
        for number in 0..4 {
            let shape = Shape::new(size);
            let pixels = (size[0] * size[1]) as usize;
            let radiance = lights(pixels, &mut random);
            let meta: Vec<u32> =
                (0..pixels).map(|_| [0, 0xFFFF, random.bits() & 0xFFFF][random.below(3) as usize]).collect();
            let share = [30, 2, 99, 10][number];
            let id: Vec<u32> =
                (0..pixels as u32).map(|i| if random.below(100) < share { i } else { NONE }).collect();
            let previous: Vec<[f32; 4]> =
                (0..pixels).map(|_| [0; 4].map(|_| random.between(0.0, 9.0))).collect();
            let params = FillParams {
                empty: [Empty::Hold, Empty::Clear][number % 2],
                keep_points: number == 2,
                wide: number != 3,
                priority: [Priority::Measured, Priority::Classic][number / 2],
            };
            let mut harness = Harness::<Fill>::new(params.clone(), &settings(size, 1));
            harness.set("cloud.radiance", &radiance);
            harness.set("cloud.meta", &meta);
            harness.set("id", &id);
            harness.set("previous", &previous);
            fn tap<N: Number>(shape: Shape, id: &[u32], radiance: &[u32], at: [i32; 2]) -> Tap<N> {
                match shape.index(at).filter(|&at| id[at] != NONE) {
                    Some(at) => {
                        let [r, g, b] = decoded(radiance[id[at] as usize]);
                        [r, g, b, 1.0].map(N::given)
                    }
                    None => [0.0; 4].map(N::given),
                }
            }
            fn near<N: Number>(shape: Shape, id: &[u32], radiance: &[u32], [x, y]: [i32; 2]) -> Tap<N> {
                let column = |x: i32| {
                    let at = |y: i32| tap::<N>(shape, id, radiance, [x, y]);
                    add(add(at(y - 1), scaled(at(y), 2.0)), at(y + 1))
                };
                add(add(column(x - 1), scaled(column(x), 2.0)), column(x + 1))
            }
            fn around<N: Number>(shape: Shape, id: &[u32], radiance: &[u32], [x, y]: [i32; 2]) -> Tap<N> {
                let taps = (-3..=3).flat_map(|dy| (-3..=3).map(move |dx| [x + dx, y + dy]));
                taps.map(|at| tap::<N>(shape, id, radiance, at)).reduce(add).expect("49")
            }
            let (mut colors, mut priorities) = (vec![], vec![]);
            for at in shape.pixels() {
                let own = shape.index(at).expect("inside");
                let weight = near::<f64>(shape, &id, &radiance, at)[3];
                let (exact, allowed) = if id[own] != NONE && params.keep_points {
                    (tap(shape, &id, &radiance, at), tap(shape, &id, &radiance, at))
                } else if weight > 0.0 || !params.wide {
                    (near(shape, &id, &radiance, at), near(shape, &id, &radiance, at))
                } else {
                    (around(shape, &id, &radiance, at), around(shape, &id, &radiance, at))
                };
                colors.extend(match (exact[3] > 0.0, params.empty) {
                    (true, _) => {
                        // Weights are whole numbers, and exact.
                        let [r, g, b, _]: Tap<Interval> = allowed;
                        let allowed = mean([r, g, b, Interval::exactly(exact[3])]);
                        expect(mean(exact), allowed, 1.0, ulp)
                    }
                    (false, Empty::Hold) => bits(previous[own]),
                    (false, Empty::Clear) => bits([0.0, 0.0, 0.0, 1.0]),
                });
                let missing = (16.0 - weight) / 16.0;
                priorities.push(match (id[own] == NONE, params.priority) {
                    (true, Priority::Measured) => (255.0 * missing.powi(6)).round() as u32,
                    (true, Priority::Classic) => (255.0 * missing) as u32,
                    (false, rule) => by_age(rule, meta[id[own] as usize]),
                });
            }
            for (side, outputs) in sides(&both(&mut harness)) {
                let name = format!("{size:?}, {share}%");
                color.compare(side, &name, shape.lanes(), &outputs.get("color"), &colors);
                priority.compare_words(
                    side,
                    &name,
                    size.map(|side| side as usize),
                    &outputs.get("priority"),
                    &priorities,
                );
            }
        }
    }
    [color.row(), priority.row()]
}

/// The priority of a pixel that shows a point, by the point's age (section 1.6).
fn by_age(rule: Priority, meta: u32) -> u32 {
    let age = meta & 0xFFFF;
    match rule {
        Priority::Measured => age / 512,
        Priority::Classic => (age / 256).min(254),
    }
}

// ---- Edge-and-point image

/// The weights of a sample along an axis, by its cell and the pixel's offset + 2 (section 2.7).
fn weights(kernel: Kernel, sigma: f32, cells: u32) -> Vec<[f64; 5]> {
    let sigma = f64::from(sigma);
    let value = |offset: f64| match kernel {
        Kernel::Gaussian => (-offset * offset / (2.0 * sigma * sigma)).exp(),
        Kernel::Binomial => [6.0, 4.0, 1.0][offset.abs().round() as usize],
    };
    let scale = 2048.0 / (-2..=2).map(|offset| value(f64::from(offset))).sum::<f64>();
    let of = |cell: u32, pixel: usize| {
        let aside = match kernel {
            Kernel::Gaussian => (f64::from(cell) + 0.5) / f64::from(cells) - 0.5,
            Kernel::Binomial => 0.0,
        };
        let exact = value(pixel as f64 - 2.0 + aside) * scale;
        // Single precision must not decide how a weight is rounded.
        assert!((exact.fract() - 0.5).abs() > 2e-6 * exact, "{sigma}: {exact} is too near to a half");
        exact.round().max(1.0)
    };
    (0..cells).map(|cell| std::array::from_fn(|pixel| of(cell, pixel))).collect()
}

fn interpolated() -> [Row; 3] {
    const DOMAIN: &str =
        "radiance 0, 2^-24 to 65408, any; sigma 0.3 to 2; 2 to 8 bits; all rules; 1x1 to 16384x1";
    let mut linear = Measure::within("interpolate", "colours", DOMAIN, "f64", 4.0, Unit::Of("ULP"));
    let mut toned = Measure::within(
        "interpolate",
        "colours, `ToneMapped`",
        "the same; luminances to 65408, where 1 - Y/(1 + Y) is 1.5e-5",
        "f64",
        0.5,
        Unit::Of("of the interval that WGSL allows"),
    );
    let mut priority =
        Measure::exact("interpolate", "priorities, weights (alpha)", "the same", "section 1.6");
    let mut random = Random(2);
    for size in SIZES {
        for (number, (kernel, sigma, subpixel_bits)) in [
            (Kernel::Gaussian, 0.7, 8),
            (Kernel::Gaussian, 0.3, 2),
            (Kernel::Gaussian, 2.0, 5),
            (Kernel::Binomial, 0.7, 4),
        ]
        .into_iter()
        .enumerate()
        {
            let shape = Shape::new(size);
            let pixels = (size[0] * size[1]) as usize;
            let radiance = lights(pixels, &mut random);
            let meta: Vec<u32> =
                (0..pixels).map(|_| [0, 0xFFFF, random.bits() & 0xFFFF][random.below(3) as usize]).collect();
            let id: Vec<u32> =
                (0..pixels as u32).map(|i| if random.below(3) == 0 { i } else { NONE }).collect();
            let subpixel: Vec<u32> =
                (0..pixels).map(|_| random.below(1 << (subpixel_bits / 2 * 2))).collect();
            let r24: Vec<u32> = (0..pixels)
                .map(|_| [0xFF_FFFF, random.bits() & 0xFF_FFFF, 0][random.below(3) as usize])
                .collect();
            let cls: Vec<u32> =
                (0..pixels).map(|_| [EMPTY, SIMPLE, COMPLEX][random.below(3) as usize]).collect();
            let shift = subpixel_bits / 2;
            let axis = weights(kernel, sigma, 1 << shift);
            for space in [Space::Linear, Space::ToneMapped] {
                let rule = [Priority::Measured, Priority::Classic][number % 2];
                let params = InterpolateParams {
                    kernel,
                    sigma,
                    subpixel_bits,
                    space,
                    priority: rule,
                    variance: false,
                    uncertain: false,
                };
                let mut harness = Harness::<Interpolate>::new(params, &settings(size, 1));
                harness.set("cloud.radiance", &radiance);
                harness.set("cloud.meta", &meta);
                harness.set("id", &id);
                harness.set("cls", &cls);
                harness.set("r24", &r24);
                harness.set("subpixel", &subpixel);
                let taps = |[x, y]: [i32; 2]| -> Vec<(f64, u32)> {
                    let own = shape.index([x, y]).expect("inside");
                    (0..25)
                        .filter_map(|raw| {
                            let counts = match raw {
                                12 => true,
                                _ => cls[own] == COMPLEX || r24[own] >> (raw - i32::from(raw > 12)) & 1 == 1,
                            };
                            let (dx, dy) = (raw % 5, raw / 5);
                            let at = shape
                                .index([x + dx - 2, y + dy - 2])
                                .filter(|&at| counts && id[at] != NONE)?;
                            let [column, row] =
                                [subpixel[at] % (1 << shift), subpixel[at] >> shift & ((1 << shift) - 1)];
                            let weight = axis[column as usize][dx as usize] * axis[row as usize][dy as usize];
                            Some((weight, radiance[id[at] as usize]))
                        })
                        .collect()
                };
                fn colour<N: Number>(taps: &[(f64, u32)], space: Space) -> [N; 3] {
                    let luminance = |[r, g, b]: [N; 3]| {
                        N::given(0.2126) * r + N::given(0.7152) * g + N::given(0.0722) * b
                    };
                    let one = N::given(1.0);
                    let sum = taps
                        .iter()
                        .map(|&(weight, word)| {
                            let mut color = decoded(word).map(N::given);
                            if space == Space::ToneMapped {
                                let scale = one + luminance(color);
                                color = color.map(|channel| channel / scale);
                            }
                            color.map(|channel| channel * N::given(weight as f32))
                        })
                        .reduce(|a, b| std::array::from_fn(|i| a[i] + b[i]));
                    let total: f64 = taps.iter().map(|tap| tap.0).sum();
                    let color = sum.map_or([N::given(0.0); 3], |sum: [N; 3]| {
                        sum.map(|channel| channel / N::given(total as f32))
                    });
                    if space == Space::ToneMapped {
                        let scale = (one - luminance(color)).max(N::given(1e-5));
                        return color.map(|channel| channel / scale);
                    }
                    color
                }
                let (mut colors, mut priorities) = (vec![], vec![]);
                for at in shape.pixels() {
                    let own = shape.index(at).expect("inside");
                    let taps = taps(at);
                    let total: f64 = taps.iter().map(|tap| tap.0).sum();
                    assert!(total < f64::from(1 << 24), "sums of weights are exact");
                    let share = (total / 4_194_304.0).min(1.0);
                    let (exact, allowed) = (colour::<f64>(&taps, space), colour::<Interval>(&taps, space));
                    let four = expect(exact, allowed, share as f32, ulp);
                    colors.extend(four.map(|of| match space {
                        Space::Linear => of,
                        Space::ToneMapped => {
                            let half = (of.allowed.high - of.exact).max(of.exact - of.allowed.low);
                            Expected { unit: half.max(ulp(of.exact)), ..of }
                        }
                    }));
                    priorities.push(match (id[own] == NONE, rule) {
                        (true, _) => {
                            let missing = ((1.0 - share) * 256.0 + 0.5) as u64;
                            match rule {
                                Priority::Measured => {
                                    let cube = (missing * missing * missing) >> 9;
                                    ((255 * ((cube * cube) >> 8) + (1 << 21)) >> 22) as u32
                                }
                                Priority::Classic => (255 * missing / 256) as u32,
                            }
                        }
                        (false, _) => by_age(rule, meta[id[own] as usize]),
                    });
                }
                for (side, outputs) in sides(&both(&mut harness)) {
                    let name = format!("{size:?} {kernel:?} {sigma} {space:?}");
                    let measure = if space == Space::Linear { &mut linear } else { &mut toned };
                    measure.compare(side, &name, shape.lanes(), &outputs.get("color"), &colors);
                    priority.compare_words(
                        side,
                        &name,
                        size.map(|side| side as usize),
                        &outputs.get("priority"),
                        &priorities,
                    );
                }
            }
        }
    }
    [linear.row(), toned.row(), priority.row()]
}

/// Radiance that a shader may hand on: nothing, almost nothing, anything, very much, and less than nothing.
fn any_light(random: &mut Random) -> f32 {
    match random.below(8) {
        0 => 0.0,
        1 => 1e-40,
        2 => 1e30,
        3 => -random.between(0.0, 10.0),
        _ => random.between(0.0, 1.0) * random.between(-20.0, 20.0).exp2(),
    }
}

pub const DIRECTIONS: [[i32; 2]; 8] = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];

fn blended() -> Row {
    let mut measure = Measure::within(
        "antialias",
        "colours",
        "radiance 0, 10^-40 to 10^30, negative; all chords; all rules; 1x1 to 16384x1",
        "f64, section 2.8",
        2.0,
        Unit::Of("ULP of the largest term"),
    );
    let mut random = Random(3);
    for size in SIZES {
        for rule in [Neighbour::Best, Neighbour::Average, Neighbour::Off] {
            let shape = Shape::new(size);
            let pixels = (size[0] * size[1]) as usize;
            let primary: Vec<[f32; 4]> =
                (0..pixels).map(|_| [0; 4].map(|_| any_light(&mut random))).collect();
            let mask = masks(size, &mut random);
            let cls = random_classes(&mask, size, &mut random);
            let n8: Vec<u32> = (0..pixels).map(|_| random.bits()).collect();
            let mut harness =
                Harness::<Antialias>::new(AntialiasParams { neighbour: rule }, &settings(size, 1));
            harness.set("primary", &primary);
            harness.set("cls", &cls);
            harness.set("n8", &n8);
            // The neighbours beyond the edge, and their weights.
            let beyond = |at: [i32; 2], own: usize| -> Vec<(usize, f32)> {
                let place = |slot: u32| {
                    let along = (2 * (slot % 8) + 1) as i32;
                    [[along, 0], [16, along], [16 - along, 16], [0, 16 - along]][slot as usize / 8]
                };
                let [p, q] = [cls[own] >> 2 & 31, cls[own] >> 7 & 31].map(place);
                let to_a = [q[1] - p[1], p[0] - q[0]];
                let sign = if cls[own] >> 12 & 1 == 1 { -1 } else { 1 };
                let all = (0..8).filter_map(|d| {
                    let by = DIRECTIONS[d];
                    let dot = (sign * (to_a[0] * by[0] + to_a[1] * by[1])) as f32;
                    let weight = if d % 2 == 0 { dot } else { dot * std::f32::consts::FRAC_1_SQRT_2 };
                    let there = shape.index([at[0] + by[0], at[1] + by[1]])?;
                    (n8[own] >> (4 * d) & 4 != 0 && weight > 0.0).then_some((there, weight))
                });
                let all: Vec<_> = all.collect();
                if rule == Neighbour::Average {
                    return all;
                }
                let best = all.iter().copied().reduce(|best, next| if next.1 > best.1 { next } else { best });
                best.into_iter().collect()
            };
            fn mixed<N: Number>(own: [f32; 4], others: &[([f32; 4], f32)], share: f32) -> [N; 3] {
                let total = others.iter().map(|other| N::given(other.1)).reduce(|a, b| a + b).expect("some");
                std::array::from_fn(|lane| {
                    let sum = others.iter().map(|(color, weight)| N::given(color[lane]) * N::given(*weight));
                    let sum = sum.reduce(|a, b| a + b).expect("some");
                    N::given(own[lane]) * N::given(share) + sum / total * N::given(1.0 - share)
                })
            }
            let mut expected = vec![];
            for at in shape.pixels() {
                let own = shape.index(at).expect("inside");
                let others: Vec<_> = match cls[own] & 3 == SIMPLE && rule != Neighbour::Off {
                    true => {
                        beyond(at, own).into_iter().map(|(there, weight)| (primary[there], weight)).collect()
                    }
                    false => vec![],
                };
                if others.is_empty() {
                    expected.extend(bits(primary[own]));
                    continue;
                }
                let share = (cls[own] >> 13 & 0x3FF) as f32 / 512.0;
                let (exact, allowed) =
                    (mixed(primary[own], &others, share), mixed(primary[own], &others, share));
                let four = expect(exact, allowed, primary[own][3], ulp);
                expected.extend(std::array::from_fn::<_, 4, _>(|lane| {
                    let terms = others.iter().map(|(color, _)| color[lane]).chain([primary[own][lane]]);
                    let largest = terms.fold(0f32, |most, term| most.max(term.abs()));
                    Expected { unit: ulp(largest.into()), ..four[lane] }
                }));
            }
            // Denormal numbers may be copied or flushed.
            for of in &mut expected {
                if of.exact.abs() < f32::MIN_POSITIVE.into() {
                    of.allowed = Interval { low: of.allowed.low.min(0.0), high: of.allowed.high.max(0.0) };
                }
            }
            for (side, outputs) in sides(&both(&mut harness)) {
                measure.compare(
                    side,
                    &format!("{size:?} {rule:?}"),
                    shape.lanes(),
                    &outputs.get("color"),
                    &expected,
                );
            }
        }
    }
    measure.row()
}

/// Holes that take colours from around them (section 2.10).
fn spread_out() -> Row {
    let mut measure = Measure::within(
        "spread",
        "colours",
        "50 to 99.9% holes; 8 to 512 steps; all methods; radiance 0, 10^-40 to 10^30; 1x1 to 2048x1",
        "f64, step by step",
        14.0,
        Unit::Of("ULP"),
    );
    let mut random = Random(4);
    for size in [[1, 1], [1, 41], [61, 47], [130, 70], [2048, 1]] {
        for (method, rounds, holes) in [
            (spread::Method::Spread, 8, 900),
            (spread::Method::Spread, 1, 999),
            (spread::Method::Spread, 64, 995),
            (spread::Method::PushPull, 8, 990),
            (spread::Method::Off, 8, 500),
        ] {
            let shape = Shape::new(size);
            let pixels = (size[0] * size[1]) as usize;
            let primary: Vec<[f32; 4]> = (0..pixels)
                .map(|_| {
                    let light = [0; 3].map(|_| any_light(&mut random).abs());
                    let alpha = if random.below(1000) < holes { 0.0 } else { random.between(0.1, 1.0) };
                    [light[0], light[1], light[2], alpha]
                })
                .collect();
            // Joined to some neighbours, which are joined to it.
            let mut n8 = vec![0u32; pixels];
            for at in shape.pixels() {
                for (d, by) in DIRECTIONS.into_iter().enumerate().take(4) {
                    let there = shape.index([at[0] + by[0], at[1] + by[1]]);
                    if let Some(there) = there.filter(|_| random.below(3) == 0) {
                        n8[shape.index(at).expect("inside")] |= 1 << (4 * d);
                        n8[there] |= 1 << (4 * (d + 4));
                    }
                }
            }
            let mut harness = Harness::<Spread>::new(SpreadParams { method, rounds }, &settings(size, 1));
            harness.set("primary", &primary);
            harness.set("n8", &n8);
            fn result<N: Number>(
                shape: Shape,
                primary: &[[f32; 4]],
                n8: &[u32],
                method: spread::Method,
                rounds: u32,
            ) -> Vec<Option<[N; 3]>> {
                let sum = |taps: Vec<[N; 3]>| {
                    let count = taps.len() as f32;
                    let sum = taps.into_iter().reduce(|a, b| std::array::from_fn(|i| a[i] + b[i]));
                    sum.map(|sum: [N; 3]| sum.map(|channel| channel / N::given(count)))
                };
                let mut colors: Vec<Option<[N; 3]>> =
                    primary.iter().map(|&[r, g, b, a]| (a > 0.0).then(|| [r, g, b].map(N::given))).collect();
                if method == spread::Method::Off {
                    return colors;
                }
                for _ in 0..if method == spread::Method::Spread { 8 * rounds } else { 0 } {
                    let before = colors.clone();
                    let mut grown = false;
                    for at in shape.pixels() {
                        let own = shape.index(at).expect("inside");
                        if before[own].is_none() {
                            let joined = (0..8).filter(|d| n8[own] >> (4 * d) & 1 == 1);
                            let places = joined.filter_map(|d| {
                                let by = DIRECTIONS[d as usize];
                                before[shape.index([at[0] + by[0], at[1] + by[1]])?]
                            });
                            colors[own] = sum(places.collect());
                            grown |= colors[own].is_some();
                        }
                    }
                    if !grown {
                        break;
                    }
                }
                let before = colors.clone();
                let within = |x: std::ops::Range<i32>, y: std::ops::Range<i32>| {
                    let places = y.flat_map(|y| x.clone().map(move |x| [x, y]));
                    sum(places.filter_map(|at| before[shape.index(at)?]).collect())
                };
                for at in shape.pixels() {
                    let own = shape.index(at).expect("inside");
                    if colors[own].is_some() {
                        continue;
                    }
                    let [x, y] = at;
                    let squares =
                        [1, 2, 4, 8].into_iter().map(|r| within(x - r..x + r + 1, y - r..y + r + 1));
                    let blocks = (4..12).map(|log2| {
                        let corner = |at: i32| at >> log2 << log2;
                        within(corner(x)..corner(x) + (1 << log2), corner(y)..corner(y) + (1 << log2))
                    });
                    colors[own] = squares.chain(blocks).flatten().next();
                }
                colors
            }
            let exact = result::<f64>(shape, &primary, &n8, method, rounds);
            let allowed = result::<Interval>(shape, &primary, &n8, method, rounds);
            let expected: Vec<Expected> = exact
                .into_iter()
                .zip(allowed)
                .flat_map(|pair| match pair {
                    (Some(exact), Some(allowed)) => {
                        // Denormal numbers may be copied or flushed.
                        let allowed =
                            allowed.map(|of| Interval { low: of.low.min(0.0).max(of.low - 1e-37), ..of });
                        expect(exact, allowed, 1.0, ulp)
                    }
                    _ => bits([0.0; 4]),
                })
                .collect();
            for (side, outputs) in sides(&both(&mut harness)) {
                let name = format!("{size:?} {method:?} {rounds} rounds, {holes} of 1000");
                measure.compare(side, &name, shape.lanes(), &outputs.get("color"), &expected);
            }
        }
    }
    measure.row()
}

// ---- Complex pixels by quarters (section 2.11)

/// The four slots of a side of a quarter: the left (axis 0) or top one.
fn slots_of(mask: &[u32], width: i32, quarter: [i32; 2], axis: usize) -> Vec<u32> {
    let word = mask[((quarter[1] >> 1) * (width + 1) + (quarter[0] >> 1)) as usize];
    let bits = word >> (16 * (quarter[axis] & 1) + 8 * axis as i32 + 4 * (quarter[1 - axis] & 1));
    (0..4).filter(|bit| bits >> bit & 1 == 1).collect()
}

/// The crossed slots of a quarter's ring of 16, clockwise.
fn ring_of(mask: &[u32], width: i32, [x, y]: [i32; 2]) -> Vec<u32> {
    let top = slots_of(mask, width, [x, y], 1);
    let right = slots_of(mask, width, [x + 1, y], 0).into_iter().map(|slot| 4 + slot);
    let bottom = slots_of(mask, width, [x, y + 1], 1).into_iter().rev().map(|slot| 11 - slot);
    let left = slots_of(mask, width, [x, y], 0).into_iter().rev().map(|slot| 15 - slot);
    top.into_iter().chain(right).chain(bottom).chain(left).collect()
}

/// The place of a slot's centre on a quarter's perimeter, in 1/16 pixel.
fn quarter_place(slot: u32) -> [i32; 2] {
    let along = (2 * (slot % 4) + 1) as i32;
    [[along, 0], [8, along], [8 - along, 8], [0, 8 - along]][slot as usize / 4]
}

/// Twice the signed area of a triangle: positive on the side of region A of the line from P to Q.
fn half_plane(p: [i32; 2], q: [i32; 2], at: [i32; 2]) -> i32 {
    (p[0] - q[0]) * (at[1] - q[1]) - (p[1] - q[1]) * (at[0] - q[0])
}

/// The area of region A of a quarter, in 1/512 pixel.
fn quarter_area(p: u32, q: u32) -> i32 {
    let mut polygon = vec![quarter_place(p)];
    let corners = [(4, [8, 0]), (8, [8, 8]), (12, [0, 8])];
    polygon.extend(corners.into_iter().filter(|&(slot, _)| p < slot && slot <= q).map(|(_, corner)| corner));
    polygon.push(quarter_place(q));
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum()
}

/// The region at a place of a quarter's ring, 0 to 16.
fn region_on(ring: &[u32], place: f64) -> usize {
    match ring {
        [p, q] => usize::from(!(f64::from(*p) + 0.5 < place && place < f64::from(*q) + 0.5)),
        _ => 0,
    }
}

/// What `subdivide` is given.
struct Quarters<'a> {
    shape: Shape,
    mask: &'a [u32],
    cls: &'a [u32],
    id: &'a [u32],
    subpixel: &'a [u32],
    radiance: &'a [u32],
    primary: &'a [[f32; 4]],
    log2: u32,
    sigma: f32,
}

impl Quarters<'_> {
    /// The crossed slots of a quarter; `None` outside of the image.
    fn ring(&self, quarter: [i32; 2]) -> Option<Vec<u32>> {
        self.shape.index(quarter.map(|at| at >> 1)).map(|_| ring_of(self.mask, self.shape.0[0], quarter))
    }

    /// Whether regions of a quarter and the one to its right or below are joined.
    fn joined(&self, p: [i32; 2], axis: usize, [own, other]: [usize; 2]) -> bool {
        let mut q = p;
        q[axis] += 1;
        let (Some(ring), Some(next)) = (self.ring(p), self.ring(q)) else { return false };
        if ring.len() > 2 || next.len() > 2 {
            return false;
        }
        let mut cuts = vec![0.0];
        cuts.extend(
            slots_of(self.mask, self.shape.0[0], q, axis).into_iter().map(|slot| f64::from(slot) + 0.5),
        );
        cuts.push(4.0);
        cuts.windows(2).any(|cut| {
            let t = 0.5 * (cut[0] + cut[1]);
            let [here, there] = if axis == 0 { [4.0 + t, 16.0 - t] } else { [12.0 - t, t] };
            [region_on(&ring, here), region_on(&next, there)] == [own, other]
        })
    }

    /// Whether a region reaches another by some shortest way over sides.
    fn reaches(&self, from: [i32; 2], region: usize, to: [i32; 2], other: usize) -> bool {
        if from == to {
            return region == other
                && self.ring(from).is_some_and(|ring| ring.len() == 2 || ring.len() < 2 && region == 0);
        }
        (0..2).filter(|&axis| from[axis] != to[axis]).any(|axis| {
            let mut next = from;
            next[axis] += (to[axis] - from[axis]).signum();
            (0..2).any(|between| {
                let is_joined = if next[axis] > from[axis] {
                    self.joined(from, axis, [region, between])
                } else {
                    self.joined(next, axis, [between, region])
                };
                is_joined && self.reaches(next, between, to, other)
            })
        })
    }

    /// Region of a square of a quarter, `size` in 1/16 pixel; `None` if unknown.
    fn region_of(&self, quarter: [i32; 2], corner: [i32; 2], size: i32) -> Option<usize> {
        let ring = self.ring(quarter)?;
        match ring[..] {
            [] | [_] => Some(0),
            [p, q] => {
                let [p, q] = [quarter_place(p), quarter_place(q)];
                let corners = [[0, 0], [size, 0], [0, size], [size, size]];
                let sides = corners.map(|by| half_plane(p, q, [corner[0] + by[0], corner[1] + by[1]]));
                if sides.iter().all(|&side| side > 0) {
                    Some(0)
                } else if sides.iter().all(|&side| side < 0) {
                    Some(1)
                } else {
                    None
                }
            }
            _ => None,
        }
    }

    fn color<N: Number>(&self, [x, y]: [i32; 2]) -> [N; 3] {
        let own = self.primary[self.shape.index([x, y]).expect("inside")];
        let around = || (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [x + dx, y + dy]));
        let size = 16 >> self.log2;
        let mut sum: [Option<N>; 3] = [None; 3];
        for start in [[0, 0], [1, 0], [0, 1], [1, 1]].map(|by| [2 * x + by[0], 2 * y + by[1]]) {
            let ring = self.ring(start).expect("inside");
            let a = if let [p, q] = ring[..] { quarter_area(p, q) } else { 128 };
            for (region, area) in [a, 128 - a].into_iter().enumerate().filter(|&(_, area)| area > 0) {
                // Distances in 1/32 pixel.
                let weighted = |at: [i32; 2], color: [f32; 3]| -> Tap<N> {
                    let d = [0, 1].map(|axis| f64::from(at[axis] - (16 * start[axis] + 8)));
                    let squared = N::given((d[0] * d[0] + d[1] * d[1]) as f32);
                    let sigma = N::given(self.sigma);
                    let scale = N::given(0.5) / (N::given(1024.0) * sigma * sigma);
                    let weight = (-squared * scale).exp();
                    let [r, g, b] = color.map(N::given);
                    [r * weight, g * weight, b * weight, weight]
                };
                let samples = around().filter_map(|at| {
                    let there = self.shape.index(at).filter(|&there| self.id[there] != NONE)?;
                    let cell = [
                        self.subpixel[there] & ((1 << self.log2) - 1),
                        self.subpixel[there] >> self.log2 & ((1 << self.log2) - 1),
                    ];
                    let corner = cell.map(|cell| cell as i32 * size);
                    let quarter = [0, 1].map(|axis| 2 * at[axis] + corner[axis] / 8);
                    let other = self.region_of(quarter, corner.map(|at| at % 8), size)?;
                    let place = [0, 1].map(|axis| 32 * at[axis] + 2 * corner[axis] + size);
                    self.reaches(start, region, quarter, other)
                        .then(|| weighted(place, decoded(self.radiance[self.id[there] as usize])))
                });
                let mut taps = samples.reduce(add);
                if taps.is_none() {
                    let quarters = (-2..4).flat_map(|v| (-2..4).map(move |u| [2 * x + u, 2 * y + v]));
                    taps = quarters
                        .filter_map(|quarter| {
                            let at = quarter.map(|at| at >> 1);
                            let there = self.shape.index(at)?;
                            let odd = quarter.map(|at| at & 1);
                            // The pixel's corner at this quarter, on both rings.
                            let nth = [[0, 1], [3, 2]][odd[1] as usize][odd[0] as usize];
                            let (cls, ring) = (self.cls[there], self.ring(quarter)?);
                            if cls & 3 == COMPLEX || ring.len() > 2 {
                                return None;
                            }
                            let [p, q] = [cls >> 2 & 31, cls >> 7 & 31].map(|slot| f64::from(slot) + 0.5);
                            let place = f64::from(8 * nth);
                            let is_a = p < place && place < q;
                            if cls & 3 == SIMPLE && is_a != (cls >> 12 & 1 == 1) {
                                return None;
                            }
                            let other = region_on(&ring, f64::from(4 * nth));
                            let [r, g, b, _] = self.primary[there];
                            let corner = [0, 1].map(|axis| 16 * (quarter[axis] + odd[axis]));
                            self.reaches(start, region, quarter, other).then(|| weighted(corner, [r, g, b]))
                        })
                        .reduce(add);
                }
                let color = taps.map_or([own[0], own[1], own[2]].map(N::given), mean);
                for (sum, channel) in sum.iter_mut().zip(color) {
                    let part = N::given(area as f32) * channel;
                    *sum = Some(sum.map_or(part, |sum| sum + part));
                }
            }
        }
        sum.map(|sum| sum.expect("four quarters") / N::given(512.0))
    }
}

fn quartered() -> Row {
    let mut measure = Measure::within(
        "subdivide",
        "colours",
        "radiance 0 to 65408; all rings of quarters; sigma 0.3 to 2; 4 to 8 bits; 1x1 to 1024x1",
        "f64, section 2.11",
        0.5,
        Unit::Of("of the interval that WGSL allows"),
    );
    let mut random = Random(5);
    for size in [[1, 1], [1, 41], [31, 17], [1024, 1]] {
        for (subpixel_bits, sigma) in [(8, 0.5), (4, 2.0), (6, 0.3)] {
            let shape = Shape::new(size);
            let pixels = (size[0] * size[1]) as usize;
            let mask: Vec<u32> = (0..(size[0] + 1) * (size[1] + 1))
                .map(|_| match random.below(4) {
                    0 => random.bits() & random.bits() & random.bits(),
                    1 => 0,
                    _ => 1 << random.below(32) | 1 << random.below(32),
                })
                .collect();
            let slots = |at: [i32; 2]| crossed(&mask, size[0], at.map(|at| at as u32));
            let cls: Vec<u32> = shape
                .pixels()
                .zip(random_classes(&mask, size, &mut random))
                .map(|(at, cls)| {
                    // Some pixels with crossings of their middle lines only are called complex, too.
                    if class_of(&slots(at)) != COMPLEX && random.below(4) == 0 { COMPLEX } else { cls }
                })
                .collect();
            let radiance = lights(pixels, &mut random);
            let id: Vec<u32> =
                (0..pixels as u32).map(|i| if random.below(3) > 0 { NONE } else { i }).collect();
            let subpixel: Vec<u32> = (0..pixels).map(|_| random.below(1 << subpixel_bits)).collect();
            let primary: Vec<[f32; 4]> =
                (0..pixels).map(|_| [0; 4].map(|_| random.between(0.0, 100.0))).collect();
            let quarters = Quarters {
                shape,
                mask: &mask,
                cls: &cls,
                id: &id,
                subpixel: &subpixel,
                radiance: &radiance,
                primary: &primary,
                log2: subpixel_bits / 2,
                sigma,
            };
            let mut harness =
                Harness::<Subdivide>::new(SubdivideParams { sigma, subpixel_bits }, &settings(size, 1));
            harness.set("cloud.radiance", &radiance);
            harness.set("id", &id);
            harness.set("subpixel", &subpixel);
            harness.set("mask", &mask);
            harness.set("cls", &cls);
            harness.set("primary", &primary);
            let expected: Vec<Expected> = shape
                .pixels()
                .flat_map(|at| {
                    let own = shape.index(at).expect("inside");
                    if cls[own] & 3 != COMPLEX {
                        return bits(primary[own]);
                    }
                    let (exact, allowed) = (quarters.color::<f64>(at), quarters.color::<Interval>(at));
                    expect(exact, allowed, primary[own][3], |_| 1.0).map(|of| {
                        let half = (of.allowed.high - of.exact).max(of.exact - of.allowed.low);
                        Expected { unit: half.max(ulp(of.exact)), ..of }
                    })
                })
                .collect();
            for (side, outputs) in sides(&both(&mut harness)) {
                let name = format!("{size:?}, {subpixel_bits} bits, sigma {sigma}");
                measure.compare(side, &name, shape.lanes(), &outputs.get("color"), &expected);
            }
        }
    }
    measure.row()
}

// ---- Tone mapping

/// A code of 8 bits before it is rounded, with the result of a division and a clamp before.
fn code<N: Number>(color: [f32; 3], gain: f32, curve: Curve) -> [N; 3] {
    let color = color.map(|channel| N::given(channel) * N::given(gain));
    let [zero, one] = [0.0, 1.0].map(N::given);
    let luminance = N::given(0.2126) * color[0] + N::given(0.7152) * color[1] + N::given(0.0722) * color[2];
    let scale = match curve {
        Curve::Clamp => one,
        Curve::Reinhard => one / (one + luminance.max(zero)),
    };
    color.map(|channel| (channel * scale).max(zero).min(one))
}

/// The sRGB encoding (IEC 61966-2-1) in codes of 8 bits.
fn encoded(x: f64) -> f64 {
    255.0 * if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

fn codes() -> Row {
    let mut measure = Measure::within(
        "tonemap",
        "codes of the picture",
        "0, denormal, 10^30, 3*10^38, NaN (magenta), infinity (white), negative; exposures -24 to 24; both curves",
        "f64, IEC 61966-2-1",
        0.51,
        Unit::Of("codes (0.5 is the rounding)"),
    );
    let mut random = Random(6);
    let special = [
        0.0,
        -0.0,
        1e-45,
        1e-40,
        -1e-40,
        -1.0,
        1e30,
        f32::MAX,
        f32::MIN,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
    ];
    for size in SIZES {
        for exposure in [-24.0, -3.5, 0.0, 1.25, 24.0] {
            for curve in [Curve::Clamp, Curve::Reinhard] {
                let pixels = (size[0] * size[1]) as usize;
                let color: Vec<[f32; 4]> = (0..pixels)
                    .map(|_| match random.below(4) {
                        0 => [0; 4].map(|_| special[random.below(12) as usize]),
                        1 => [0; 4].map(|_| random.between(0.0, 1.2)),
                        // Around what is shown as white.
                        _ => [0; 4].map(|_| {
                            random.between(0.0, 2.0) * (random.between(-8.0, 1.0) - exposure).exp2()
                        }),
                    })
                    .collect();
                let params = TonemapParams { exposure: Some(exposure), curve, ..TonemapParams::default() };
                let mut harness = Harness::<Tonemap>::new(params, &settings(size, 1));
                harness.set("color", &color);
                let gain = exposure.exp2();
                let expected: Vec<Expected> = color
                    .iter()
                    .flat_map(|&[r, g, b, _]| {
                        let color = [r, g, b];
                        let of =
                            |code: f64| Expected { exact: code, allowed: Interval::exactly(code), unit: 1.0 };
                        let shown = color.map(|channel| channel * gain);
                        if color.iter().any(|channel| channel.is_nan()) {
                            return [255.0, 0.0, 255.0, 255.0].map(of);
                        }
                        if shown.contains(&f32::INFINITY) {
                            return [255.0; 4].map(of);
                        }
                        let (exact, allowed) =
                            (code::<f64>(color, gain, curve), code::<Interval>(color, gain, curve));
                        std::array::from_fn(|lane| match lane {
                            3 => of(255.0),
                            _ => {
                                // Powers of single precision are off by some 1/1000 of a code.
                                let [low, high] = [(allowed[lane].low, -0.01), (allowed[lane].high, 0.01)]
                                    .map(|(x, slack)| (encoded(x) + slack + 0.5).floor().clamp(0.0, 255.0));
                                Expected {
                                    exact: encoded(exact[lane]),
                                    allowed: Interval { low, high },
                                    unit: 1.0,
                                }
                            }
                        })
                    })
                    .collect();
                for (side, outputs) in sides(&both(&mut harness)) {
                    let image: Vec<f32> = outputs.get::<u8>("image").into_iter().map(f32::from).collect();
                    let name = format!("{size:?} exposure {exposure} {curve:?}");
                    measure.compare(side, &name, [4 * size[0] as usize, size[1] as usize], &image, &expected);
                }
            }
        }
    }
    measure.row()
}

/// The white that `Auto` finds, over some frames (section 1.10).
fn whites() -> Row {
    let mut measure = Measure::exact(
        "tonemap",
        "white of `exposure: Auto`",
        "2^-30 to 2^30, denormal, negative, NaN, infinity; percentiles 1 to 100; 1x1 to 16384x1; 6 frames",
        "section 1.10 in 64-bit integers",
    );
    let mut random = Random(7);
    for size in SIZES {
        for percentile in [1, 50, 90, 100] {
            let pixels = (size[0] * size[1]) as usize;
            let params = TonemapParams { exposure: None, percentile, ..TonemapParams::default() };
            let mut harness = Harness::<Tonemap>::new(params, &settings(size, 1));
            let mut white = 0i64;
            for frame in 0..6 {
                let around = random.between(-26.0, 26.0);
                let color: Vec<[f32; 4]> = (0..pixels)
                    .map(|_| match random.below(12) {
                        0 => [f32::NAN, 1.0, 1.0, 1.0],
                        1 => [1.0, f32::INFINITY, 1.0, 1.0],
                        2 => [-5.0, 1e-40, 0.0, 1.0],
                        _ => [0; 4].map(|_| (around + random.between(-4.0, 4.0)).exp2()),
                    })
                    .collect();
                harness.set("color", &color);
                let outputs = both(&mut harness);
                harness.frame.index += 1;
                if let Some(fitting) = fitting(&color, percentile.into()) {
                    let away = fitting - white;
                    let beyond = away.signum() * (away.abs() - (1 << 20)).max(0);
                    white = if white == 0 { fitting } else { white + beyond / 16 };
                }
                for (side, outputs) in sides(&outputs) {
                    let name = format!("{size:?}, {percentile}%, frame {frame}");
                    measure.compare_words(side, &name, [1, 1], &outputs.get("white"), &[white as u32]);
                }
            }
        }
    }
    measure.row()
}

/// The bits of the white that fits a picture.
fn fitting(color: &[[f32; 4]], percentile: u64) -> Option<i64> {
    let mut bins = vec![0u64; 48 * 16];
    for &[r, g, b, _] in color {
        let brightest = r.max(g).max(b);
        if [r, g, b].iter().all(|channel| channel.is_finite()) && brightest >= f32::MIN_POSITIVE {
            // A sixteenth of an octave, in bits of a float: 2^-24 has an exponent of 103.
            let bin = (i64::from(brightest.to_bits()) - (103 << 23)).max(0) >> 19;
            bins[(bin as usize).min(48 * 16 - 1)] += 1;
        }
    }
    let count: u64 = bins.iter().sum();
    let rank = (count * percentile / 100).max(1);
    let mut before = 0;
    for (bin, &pixels) in bins.iter().enumerate() {
        if before + pixels >= rank {
            let step = 8 * (rank - before) / pixels;
            return Some((103 << 23) + ((bin as i64) << 19) + ((step as i64) << 19) / 8);
        }
        before += pixels;
    }
    None
}

/// The oracle's own worked values, of `algorithms.md` sections 1.10, 2.7 and 2.11.
#[test]
fn the_oracles_of_colours_give_the_worked_values() {
    assert_eq!(weights(Kernel::Gaussian, 0.7, 16)[8], [22.0, 448.0, 1166.0, 394.0, 17.0]);
    assert_eq!([(7, 12), (0, 11), (0, 15), (3, 4)].map(|(p, q)| quarter_area(p, q)), [16, 112, 127, 1]);
    let mut picture = vec![[0.25; 4]; 9];
    picture.push([8.0; 4]);
    assert_eq!(fitting(&picture, 90), Some(0.265_625f32.to_bits().into()));
    assert!(encoded(0.0) == 0.0 && (encoded(1.0) - 255.0).abs() < 1e-9);
}
