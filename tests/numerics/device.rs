//! The arithmetic of the device itself, by a node of kind `wgsl`: what all shaders are made of.

use std::{fs, path::Path, sync::LazyLock};

use epigraph::{Device, Place, Samples, Setup};
use epigraph_core::{GraphFile, Side};
use epigraph_tests::gpu;

use crate::{
    Group,
    interval::{Interval, Number, ulp},
    measured,
    table::{Expected, Measure, Row, Unit},
};

pub static ROWS: Group = LazyLock::new(|| measured(&[operations]));

const SHADER: &str = "
#import frame
/// Numbers of both signs from 2^-20 to 2^20; one from -10 to 10, one from 0 to 1.
@group(0) @binding(1) var operands: texture_storage_2d<rgba32float, write>;
/// Sum, difference, product, quotient of the first two.
@group(0) @binding(2) var basic: texture_storage_2d<rgba32float, write>;
/// Root of the first, powers of e and 2 of the third, power of the fourth.
@group(0) @binding(3) var powers: texture_storage_2d<rgba32float, write>;
/// Whole parts.
@group(0) @binding(4) var whole: texture_storage_2d<rgba32float, write>;
fn hash(value: u32) -> u32 {
    let bits = value * 747796405u + 2891336453u;
    let word = ((bits >> ((bits >> 28u) + 4u)) ^ bits) * 277803737u;
    return (word >> 22u) ^ word;
}
fn number(seed: u32) -> f32 {
    let exponent = 107u + hash(seed + 7u) % 41u;
    return bitcast<f32>((hash(seed) & 0x807FFFFFu) | (exponent << 23u));
}
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= frame.size) { return; }
    let seed = 8u * (id.y * frame.size.x + id.x);
    let a = number(seed);
    let b = number(seed + 1u);
    let c = f32(hash(seed + 2u) >> 8u) / 16777216.0 * 20.0 - 10.0;
    let s = f32((hash(seed + 3u) >> 8u) + 1u) / 16777216.0;
    textureStore(operands, id.xy, vec4(a, b, c, s));
    textureStore(basic, id.xy, vec4(a + b, a - b, a * b, a / b));
    textureStore(powers, id.xy, vec4(sqrt(abs(a)), exp(c), exp2(c), pow(s, 1.0 / 2.4)));
    textureStore(whole, id.xy, vec4(floor(a), round(a), trunc(a), f32(i32(c * 1000.0))));
}
";

const GRAPH: &str = r#"Graph(
    version: 1,
    nodes: {
        "device": (kind: "wgsl", params: (shader: "device.wgsl")),
        "tonemap": (kind: "tonemap", inputs: { "color": "device.basic" }),
    },
    outputs: { "image": "tonemap.image" },
)"#;

fn operations() -> Vec<Row> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("numerics");
    fs::create_dir_all(&folder).expect("the build's folder can be written");
    fs::write(folder.join("device.wgsl"), SHADER).expect("the build's folder can be written");
    fs::write(folder.join("device.ron"), GRAPH).expect("the build's folder can be written");
    let file = GraphFile::load(&folder.join("device.ron")).unwrap_or_else(|problems| panic!("{problems}"));
    let place = Place::load("cornell", "still").expect("a built-in scene");
    let ports = ["device.operands", "device.basic", "device.powers", "device.whole"];
    let setup = Setup::new(file).at(&place).size([128, 128]).samples(Samples::Count(1)).keep(&ports);
    let mut run = setup.device(&Device::on(gpu())).start().unwrap_or_else(|error| panic!("{error}"));
    run.frame().unwrap_or_else(|error| panic!("{error}"));
    let [given, basic, powers, whole] =
        ports.map(|port| run.snapshot(port).expect("it is kept").get::<[f32; 4]>());

    let within = |quantity, bound| {
        let domain = "16384 pairs of 2^-20 to 2^20, both signs; exponents -10 to 10; 0 to 1";
        Measure::within("wgsl", quantity, domain, "f64; the interval of WGSL", bound, Unit::Of("ULP"))
            .on_gpu_only()
    };
    let mut rows = vec![];
    let mut check = |mut measure: Measure, got: Vec<f32>, expected: Vec<Expected>| {
        measure.compare(Side::Gpu, "all", [128, 128], &got, &expected);
        rows.push(measure.row());
    };
    let lane = |of: &[[f32; 4]], lane: usize| of.iter().map(|all| all[lane]).collect::<Vec<_>>();
    let expect = |exact: f64, allowed: Interval| Expected { exact, allowed, unit: ulp(exact) };
    macro_rules! each {
        ($name:literal, $bound:literal, $got:expr, |$a:ident, $b:ident, $c:ident, $s:ident| $formula:expr) => {{
            fn of<N: Number>([$a, $b, $c, $s]: [f32; 4]) -> N {
                let ($a, $b, $c, $s) = (N::given($a), N::given($b), N::given($c), N::given($s));
                let _ = ($a, $b, $c, $s);
                $formula
            }
            let expected = given.iter().map(|&all| expect(of::<f64>(all), of::<Interval>(all))).collect();
            check(within($name, $bound), $got, expected);
        }};
    }
    each!("a + b", 0.51, lane(&basic, 0), |a, b, c, s| a + b);
    each!("a - b", 0.51, lane(&basic, 1), |a, b, c, s| a - b);
    each!("a b", 0.51, lane(&basic, 2), |a, b, c, s| a * b);
    each!("a / b", 0.51, lane(&basic, 3), |a, b, c, s| a / b);
    each!("sqrt", 0.51, lane(&powers, 0), |a, b, c, s| a.max(-a).sqrt());
    each!("exp", 10.0, lane(&powers, 1), |a, b, c, s| c.exp());
    each!("exp2", 4.0, lane(&powers, 2), |a, b, c, s| c.exp2());
    each!("pow, to 1/2.4", 6.0, lane(&powers, 3), |a, b, c, s| s.powf(1.0 / 2.4));
    let mut exact = Measure::exact("wgsl", "floor, round, trunc", "the same", "f64").on_gpu_only();
    for (at, part) in [f64::floor, f64::round_ties_even, f64::trunc].into_iter().enumerate() {
        let expected: Vec<u32> = given.iter().map(|all| (part(all[0].into()) as f32).to_bits()).collect();
        // Zero has either sign.
        let bits = |x: f32| if x == 0.0 { 0 } else { x.to_bits() };
        let expected: Vec<u32> = expected.into_iter().map(|word| bits(f32::from_bits(word))).collect();
        let got: Vec<u32> = lane(&whole, at).into_iter().map(bits).collect();
        exact.compare_words(Side::Gpu, "all", [128, 128], &got, &expected);
    }
    rows.push(exact.row());
    rows
}
