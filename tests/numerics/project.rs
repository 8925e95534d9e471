//! Where points fall in the image: `project` and `predict`, over world offsets, scales, fields of view, sizes of
//! images, ranges of depth, mirrored and singular cameras.

use std::sync::LazyLock;

use epigraph_core::{
    Harness, Host, Side, View,
    testing::{Both, Random, settings},
};
use epigraph_stages::{
    predict::Predict,
    project::{Project, ProjectParams},
    shared::cloud::{LIVE, NOT_DRAWN},
};
use epigraph_tests::gpu;

use crate::{
    Group, both,
    interval::{Interval, Number, ulp},
    measured,
    table::{Expected, Measure, Row, Unit, markdown, rounded_up},
};

pub static ROWS: Group = LazyLock::new(|| {
    measured(&[|| places().into(), || vec![singular()], || vec![many()], || vec![occupancy()]])
});

/// Points of each case.
const POINTS: usize = 1024;

/// A camera, and points in front of it.
struct Case {
    name: String,
    size: [u32; 2],
    view: View,
    points: Vec<[f32; 4]>,
}

/// What a case varies; the rest is as usual.
#[derive(Clone, Copy)]
struct Setup {
    size: [u32; 2],
    /// Metres of each coordinate of the eye.
    offset: f32,
    /// Distance of the near plane, metres.
    near: f32,
    /// Far over near.
    ratio: f32,
    /// Vertical field of view, degrees.
    fov: f64,
    mirrored: bool,
}

const USUAL: Setup =
    Setup { size: [512, 384], offset: 0.0, near: 0.1, ratio: 1e4, fov: 60.0, mirrored: false };

impl Case {
    fn new(setup: Setup, random: &mut Random) -> Self {
        let Setup { size, offset, near, ratio, fov, mirrored } = setup;
        let tan_y = (fov.to_radians() / 2.0).tan();
        let tan = [tan_y * f64::from(size[0]) / f64::from(size[1]), tan_y];
        // A camera turned at random: Gram-Schmidt on random vectors.
        let mut any = || [0; 3].map(|_| f64::from(random.between(-1.0, 1.0)));
        let (a, b) = (any(), any());
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let unit = |a: [f64; 3]| a.map(|x| x / dot(a, a).sqrt());
        let forward = unit(a);
        let right = unit(std::array::from_fn(|i| b[i] - dot(b, forward) * forward[i]));
        let up: [f64; 3] = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            right[j] * forward[k] - right[k] * forward[j]
        });
        let right = if mirrored { right.map(|x| -x) } else { right };
        let eye = [offset, -0.7 * offset, 0.3 * offset];
        let single = |a: [f64; 3]| a.map(|x| x as f32);
        let view = View {
            eye,
            near,
            far: near * ratio,
            right: single(right),
            up: single(up),
            forward: single(forward),
            tan_x: tan[0] as f32,
            tan_y: tan[1] as f32,
        };
        let points = (0..POINTS).map(|i| {
            let z = f64::from(near) * f64::from(ratio * 4.0).powf(f64::from(random.between(-0.05, 1.0)));
            // A little more than the image.
            let [x, y] = tan.map(|tan| tan * z * f64::from(random.between(-1.05, 1.05)));
            let at = std::array::from_fn::<f64, 3, _>(|i| x * right[i] + y * up[i] + z * forward[i]);
            let w = if i % 16 == 0 { 0.0 } else { 1.0 };
            let [x, y, z]: [f32; 3] = std::array::from_fn(|i| (at[i] + w * f64::from(eye[i])) as f32);
            [x, y, z, w as f32]
        });
        let points = points.collect();
        let name = format!(
            "{size:?}, offset {offset:e} m, near {near:e} m, ratio {ratio:e}, {fov} degrees{}",
            if mirrored { ", mirrored" } else { "" }
        );
        Self { name, size, view, points }
    }

    fn harness<S: epigraph_core::Stage>(&self, params: S::Params) -> Harness<S> {
        let mut harness = Harness::<S>::new(params, &settings(self.size, 1));
        harness.frame.view = self.view;
        harness.set("cloud.position", &self.points);
        harness.set("cloud.meta", &vec![LIVE; self.points.len()]);
        harness
    }
}

fn cases() -> Vec<Case> {
    let mut setups = vec![];
    for size in [[1, 1], [1, 37], [31, 17], [512, 384], [16384, 1], [1, 16384], [16384, 16]] {
        setups.push(Setup { size, ..USUAL });
    }
    for offset in [1e1, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8] {
        setups.push(Setup { offset, near: 1.0, ..USUAL });
        setups.push(Setup { offset, near: 1e-3 * offset, mirrored: true, ..USUAL });
    }
    for exponent in 1..=9 {
        setups.push(Setup { ratio: 10f32.powi(exponent), ..USUAL });
    }
    for exponent in [-6, -4, -2, 2, 4, 6] {
        setups.push(Setup { near: 10f32.powi(exponent), ..USUAL });
    }
    for fov in FIELDS {
        setups.push(Setup { fov, ..USUAL });
        setups.push(Setup { fov, size: [1023, 1], mirrored: true, ..USUAL });
    }
    let mut random = Random(1);
    setups.into_iter().map(|setup| Case::new(setup, &mut random)).collect()
}

/// Vertical fields of view, degrees.
const FIELDS: [f64; 6] = [0.01, 0.1, 1.0, 60.0, 179.0, 179.9];

/// Pixels from the left and top, and distance along the axis (`algorithms.md` section 1.2).
fn projected<N: Number>(view: &View, [x, y, z, w]: [f32; 4], size: [u32; 2]) -> [N; 3] {
    let eye = view.eye.map(|at| N::given(if w == 0.0 { 0.0 } else { at }));
    let at = [x, y, z].map(N::given);
    let p = if w == 0.0 { at } else { [at[0] - eye[0], at[1] - eye[1], at[2] - eye[2]] };
    let along = |axis: [f32; 3]| {
        let axis = axis.map(N::given);
        p[0] * axis[0] + p[1] * axis[1] + p[2] * axis[2]
    };
    let half = size.map(|side| N::given(0.5 * side as f32));
    let z = along(view.forward);
    let inverse = N::given(1.0) / z;
    let x = half[0] + along(view.right) * inverse * (half[0] / N::given(view.tan_x));
    let y = half[1] - along(view.up) * inverse * (half[1] / N::given(view.tan_y));
    [x, y, z]
}

/// Whether a point is drawn; `None` where single precision may decide either way.
fn is_drawn(view: &View, [x, y, z]: [Interval; 3], size: [u32; 2], is_direction: bool) -> Option<bool> {
    let nearest = f64::from(if is_direction { f32::MIN_POSITIVE } else { view.near });
    let [width, height] = size.map(f64::from);
    let tests = [(x, 0.0, width), (y, 0.0, height), (z, nearest, f64::INFINITY)];
    let surely = tests.iter().all(|&(at, from, to)| at.low >= from && at.high < to);
    let never = tests.iter().any(|&(at, from, to)| at.high < from || at.low >= to);
    (surely || never).then_some(surely)
}

/// What the stage found of each point on a side: pixel and bits of the distance, and the cell.
fn found(outputs: &Both, side: Side) -> Vec<([u32; 2], u32)> {
    let outputs = if side == Side::Cpu { &outputs.cpu } else { &outputs.gpu };
    outputs.get::<[u32; 2]>("projected").into_iter().zip(outputs.get::<u32>("cells")).collect()
}

/// How far a place is from a cell of a sixteenth of a pixel, in pixels.
fn outside(at: f64, pixel: u32, cell: u32) -> f64 {
    let from = f64::from(pixel) + f64::from(cell) / 16.0;
    (from - at).max(at - from - 1.0 / 16.0).max(0.0)
}

/// Errors of a point's place, along the axes, in pixels, and in roundings of what the place is computed from.
fn place_errors(case: &Case, point: [f32; 4], pixel: u32, cell: u32) -> [f64; 2] {
    let exact = projected::<f64>(&case.view, point, case.size);
    let [column, row] = [pixel % case.size[0], pixel / case.size[0]];
    let errors = [outside(exact[0], column, cell % 16), outside(exact[1], row, cell / 16)];
    let eye = if point[3] == 0.0 { [0.0; 3] } else { case.view.eye };
    let far: f64 = (0..3).map(|i| (f64::from(point[i]) - f64::from(eye[i])).powi(2)).sum::<f64>().sqrt();
    let tan = [case.view.tan_x, case.view.tan_y].map(f64::from);
    let roundings = [0, 1].map(|axis| {
        let half = 0.5 * f64::from(case.size[axis]);
        errors[axis] / ((-24f64).exp2() * half * (1.0 + (1.0 + 1.0 / tan[axis]) * far / exact[2]))
    });
    [errors[0].max(errors[1]), roundings[0].max(roundings[1])]
}

fn places() -> [Row; 3] {
    const DOMAIN: &str = "offsets 0 to 10^8 m, near planes 10^-6 to 10^6 m, far / near 10 to 10^9, 0.01 to 179.9 \
                          degrees, mirrored, 1x1 to 16384x16";
    let mut distance = Measure::within(
        "project",
        "distance along the axis",
        DOMAIN,
        "f64",
        2.0,
        Unit::Of("ULP of the distance from the eye"),
    );
    let mut place = Measure::within(
        "project",
        "place, beyond its 1/16 pixel",
        "the same",
        "f64",
        1.0,
        Unit::Of("unit of place"),
    );
    let mut pixel = Measure::exact(
        "project",
        "pixel and cell, not drawn",
        "the same; what lies on a border either way",
        "intervals",
    );
    for case in cases() {
        let outputs = both(&mut case.harness::<Project>(ProjectParams::default()));
        for side in [Side::Cpu, Side::Gpu] {
            let (mut depths, mut expected, mut wrong) = (vec![], vec![], 0);
            let mut worst = (0f64, 0);
            for (&point, ([at, depth], cell)) in case.points.iter().zip(found(&outputs, side)) {
                let allowed = projected::<Interval>(&case.view, point, case.size);
                let drawn = is_drawn(&case.view, allowed, case.size, point[3] == 0.0);
                wrong += usize::from(drawn.is_some_and(|drawn| drawn == (at == NOT_DRAWN)));
                if at == NOT_DRAWN {
                    continue;
                }
                let [column, row] = [at % case.size[0], at / case.size[0]];
                for (axis, (pixel, cell)) in [(column, cell % 16), (row, cell / 16)].into_iter().enumerate() {
                    let from = f64::from(pixel) + f64::from(cell) / 16.0;
                    wrong += usize::from(allowed[axis].high < from || allowed[axis].low >= from + 1.0 / 16.0);
                }
                worst = (worst.0.max(place_errors(&case, point, at, cell)[1]), worst.1 + 1);
                let exact = projected::<f64>(&case.view, point, case.size)[2];
                let eye = if point[3] == 0.0 { [0.0; 3] } else { case.view.eye };
                let length =
                    (0..3).map(|i| (f64::from(point[i]) - f64::from(eye[i])).powi(2)).sum::<f64>().sqrt();
                let far = f64::from(case.view.far);
                depths.push(f32::from_bits(depth));
                expected.push(if point[3] == 0.0 {
                    Expected { exact: far, allowed: Interval::exactly(far), unit: ulp(far) }
                } else {
                    let allowed = allowed[2].min(Interval::exactly(far));
                    Expected { exact: exact.min(far), allowed, unit: ulp(length) }
                });
            }
            distance.compare(side, &case.name, [depths.len(), 1], &depths, &expected);
            place.record(side, &case.name, worst.0, worst.1);
            pixel.count(side, &case.name, wrong, case.points.len());
        }
    }
    [distance.row(), place.row(), pixel.row()]
}

/// Cameras without a direction, without a field of view, with numbers that are none, and points that are none: whatever
/// is drawn has a pixel and a finite distance.
fn singular() -> Row {
    let mut measure = Measure::exact(
        "project",
        "pixels and distances that are none",
        "axes of length 0, equal axes, fields of 0 and infinity, near 0, far 3e38, NaN and infinity anywhere",
        "every pixel is in the image, every distance finite and positive",
    );
    let mut random = Random(2);
    let usual = Case::new(USUAL, &mut random);
    let zero = [0.0; 3];
    let view = usual.view;
    let views = [
        View { forward: zero, ..view },
        View { right: zero, ..view },
        View { right: view.forward, up: view.forward, ..view },
        View { tan_x: 0.0, tan_y: 0.0, ..view },
        View { tan_x: f32::INFINITY, ..view },
        View { near: 0.0, far: f32::MAX, ..view },
        View { forward: [f32::NAN; 3], ..view },
        View { eye: [f32::INFINITY; 3], ..view },
        View { eye: [f32::MAX; 3], ..view },
        View { far: view.near, ..view },
    ];
    let values = [0.0, -0.0, 1e-40, 1.0, -1.0, 1e30, f32::MAX, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let odd = (0..POINTS).map(|_| [0; 4].map(|_| values[random.below(10) as usize]));
    let points: Vec<_> = odd.chain(usual.points.iter().copied()).collect();
    for (number, view) in views.into_iter().enumerate() {
        let case = Case { view, points: points.clone(), name: format!("view {number}"), ..usual };
        let outputs = both(&mut case.harness::<Project>(ProjectParams::default()));
        for side in [Side::Cpu, Side::Gpu] {
            let bad = found(&outputs, side).into_iter().filter(|([pixel, depth], cell)| {
                let z = f32::from_bits(*depth);
                *pixel != NOT_DRAWN && !(*pixel < 512 * 384 && *cell < 256 && z.is_finite() && z >= 0.0)
            });
            measure.count(side, &case.name, bad.count(), case.points.len());
        }
    }
    measure.row()
}

/// The most points of 16 bytes that the GPU can bind, at most one more than 2^24.
fn most_points() -> usize {
    usize::try_from(gpu().most_bound() / 16).map_or(MANY, |most| most.min(MANY))
}

const MANY: usize = (1 << 24) + 1;

/// 0, 1 and 2^24 + 1 points: the pixel shows the nearest, and of the nearest the first.
fn many() -> Row {
    let mut measure = Measure::exact(
        "project",
        "the point that each pixel shows",
        "0, 1 and 2^24 + 1 points (as many as the GPU can bind: on lavapipe 2^24), half of them equally near",
        "a loop over the points",
    );
    for (side, count) in [(Side::Cpu, 1), (Side::Gpu, 1), (Side::Cpu, MANY), (Side::Gpu, most_points())] {
        let size = [16, 8];
        let mut random = Random(3);
        let mut case = Case::new(Setup { size, ..USUAL }, &mut random);
        case.view = View { near: 0.5, ..View::default() };
        // Places and distances that are exact: multiples of 1/16.
        let point = |_| {
            let z = 1.0 + random.below(3) as f32;
            let [x, y] = [16.0, 8.0].map(|side| (random.below(side as u32) as f32 + 0.5) * 2.0 / side - 1.0);
            [x * z, y * z, -z, 1.0]
        };
        case.points = (0..count).map(point).collect();
        // A cloud of no points is one of slots without any.
        for live in [true, false].into_iter().filter(|live| *live || count == 1) {
            let mut harness = case.harness::<Project>(ProjectParams::default());
            harness.set("cloud.meta", &vec![if live { LIVE } else { 0 }; count]);
            let registry = epigraph_stages::registry();
            let device = (side == Side::Gpu).then(gpu);
            let outputs = harness.run(side, &registry, &Host::default(), device).expect("it fits");
            let mut expected = vec![(f32::INFINITY, u32::MAX); 128];
            for (id, &[x, y, z, _]) in (0..).zip(case.points.iter().filter(|_| live)) {
                let at =
                    [(x / -z, 16.0), (-y / -z, 8.0)].map(|(at, side)| ((at + 1.0) / 2.0 * side) as usize);
                let nearest = &mut expected[at[1] * 16 + at[0]];
                if -z < nearest.0 {
                    *nearest = (-z, id);
                }
            }
            let expected: Vec<u32> = expected.into_iter().map(|(_, id)| id).collect();
            let name = format!("{count} points, {live}");
            measure.compare_words(side, &name, [16, 8], &outputs.get("id"), &expected);
        }
    }
    measure.row()
}

fn occupancy() -> Row {
    let mut measure = Measure::exact(
        "predict",
        "occupied cells",
        "the cases of `project`; what lies on a border either way",
        "intervals",
    );
    for case in cases() {
        let mut harness = case.harness::<Predict>(());
        // The predicted view is the case's, that of the frame any other.
        harness.frame.predicted = case.view;
        harness.frame.view = View { near: 2.0 * case.view.near, ..case.view };
        let outputs = both(&mut harness);
        let cells = case.size.map(|side| side.div_ceil(4));
        let mut marks = vec![[false; 2]; (cells[0] * cells[1]) as usize];
        for &point in &case.points {
            let at = projected::<Interval>(&case.view, point, case.size);
            let drawn = is_drawn(&case.view, at, case.size, point[3] == 0.0);
            if drawn == Some(false) {
                continue;
            }
            // The cells in which the point may be.
            let range = |axis: usize| {
                let last = f64::from(case.size[axis] - 1);
                let cell = |x: f64| (x.clamp(0.0, last) / 4.0) as u32;
                cell(at[axis].low)..=cell(at[axis].high)
            };
            let sure = drawn == Some(true) && range(0).count() == 1 && range(1).count() == 1;
            for row in range(1) {
                for column in range(0) {
                    let mark = &mut marks[(row * cells[0] + column) as usize];
                    *mark = [true, mark[1] || sure];
                }
            }
        }
        for (side, outputs) in [(Side::Cpu, &outputs.cpu), (Side::Gpu, &outputs.gpu)] {
            let got = outputs.get::<u32>("occupancy");
            let expected: Vec<u32> = marks
                .iter()
                .zip(&got)
                .map(|(&[may, must], &got)| match (may, must) {
                    (_, true) => 1,
                    (false, _) => 0,
                    _ => got.min(1),
                })
                .collect();
            measure.compare_words(side, &case.name, cells.map(|side| side as usize), &got, &expected);
        }
    }
    measure.row()
}

/// The worst errors of places in pixels, by field of view and by the offset of the world.
pub fn errors_in_pixels() -> String {
    let mut lines = vec![];
    for size in [[512, 512], [16384, 64]] {
        for fov in FIELDS {
            let mut random = Random(4);
            // Of the width.
            let tan = (fov.to_radians() / 2.0).tan() * f64::from(size[1]) / f64::from(size[0]);
            let setup = Setup { size, fov: 2.0 * tan.atan().to_degrees(), offset: 100.0, near: 1.0, ..USUAL };
            let case = Case::new(setup, &mut random);
            let outputs = both(&mut case.harness::<Project>(ProjectParams::default()));
            let worst = [Side::Cpu, Side::Gpu].map(|side| {
                let places = case.points.iter().zip(found(&outputs, side));
                let drawn = places.filter(|(_, ([pixel, _], _))| *pixel != NOT_DRAWN);
                let errors =
                    drawn.map(|(point, ([pixel, _], cell))| place_errors(&case, *point, pixel, cell)[0]);
                rounded_up(errors.fold(0.0, f64::max))
            });
            lines.push(
                [fov.to_string(), format!("{}x{}", size[0], size[1])].into_iter().chain(worst).collect(),
            );
        }
    }
    markdown(
        &["horizontal field of view, degrees", "image", "worst, CPU, pixels", "worst, GPU, pixels"],
        &lines,
    )
}
