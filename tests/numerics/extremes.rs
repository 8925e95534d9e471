//! Whole graphs at the extremes: everything finite stays finite, nothing panics or hangs, and limits are told before
//! the first frame.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use epigraph::{Device, Place, Samples, Setup};
use epigraph_core::{ParamKind, ParamSpec, Settings, Side, View, compile};
use epigraph_scenes::{
    CREASE_ANGLE, Camera, Material, Scene, SceneBuilder, Shape,
    streams::{Codec, Points, encode},
};
use epigraph_stages::{
    Pace, Query, SampleSource,
    shared::requests::{HIT_BACKGROUND, HIT_SURFACE, Sample},
};
use epigraph_tests::{gpu, graph};
use glam::{DVec3, Vec3};

use crate::table::markdown;

/// Graphs of surfaces.
const GRAPHS: [&str; 3] = ["render-cache.ron", "epi.ron", "epi-filtered.ron"];

/// What was run: pictures that are finite, and runs that were refused with a message before the first frame.
#[derive(Default)]
struct Outcome {
    pictures: usize,
    refused: usize,
}

impl Outcome {
    /// Counts a run of some frames.
    ///
    /// # Panics
    /// If it fails in a frame, or if a colour is not finite.
    fn add(&mut self, what: &str, setup: Setup, frames: u32) {
        let Some(mut run) = self.start(what, setup) else { return };
        run.frames(frames).unwrap_or_else(|error| panic!("{what}: {error}"));
        self.check(what, &mut run);
    }

    /// Starts a run; none if it is refused.
    fn start(&mut self, what: &str, setup: Setup) -> Option<epigraph::Run> {
        match setup.start() {
            Ok(run) => Some(run),
            Err(error) => {
                let message = error.to_string();
                assert!(message.len() > 20, "{what}: the message says too little: {message}");
                self.refused += 1;
                None
            }
        }
    }

    fn check(&mut self, what: &str, run: &mut epigraph::Run) {
        let name = ["antialias.color", "fill.color"].into_iter().find(|name| run.snapshot(name).is_ok());
        let name = name.expect("one of them is kept");
        let color = run.snapshot(name).expect("it is kept").get::<[f32; 4]>();
        assert!(color.as_flattened().iter().all(|x| x.is_finite()), "{what}: a colour is not finite");
        self.pictures += 1;
    }

    fn text(&self) -> String {
        let counts = [(self.pictures, "pictures"), (self.refused, "refused")];
        let some = counts.into_iter().filter(|(count, _)| *count > 0);
        some.map(|(count, what)| format!("{count} {what}")).collect::<Vec<_>>().join(", ")
    }
}

/// The port with a graph's linear colours.
fn colors(name: &str) -> &'static str {
    if name.starts_with("epi") || name.ends_with("complex-pixels.ron") {
        "antialias.color"
    } else {
        "fill.color"
    }
}

fn setup(name: &str, place: &Place, size: [u32; 2], samples: u32, side: Side) -> Setup {
    let device = if side == Side::Gpu { Device::on(gpu()) } else { Device::CPU };
    let setup = Setup::new(graph(name)).at(place).size(size).samples(Samples::Count(samples));
    setup.device(&device).profile(false).poison(true).keep(&[colors(name)])
}

/// A graph that is running on the GPU: as long as it is, others use its compiled shaders.
fn warm(name: &str, place: &Place, size: [u32; 2]) -> epigraph::Run {
    let mut run = setup(name, place, size, 20, Side::Gpu).start().unwrap_or_else(|error| panic!("{error}"));
    run.frames(2).unwrap_or_else(|error| panic!("{error}"));
    run
}

fn cornell(change: impl FnOnce(&mut Scene)) -> Place {
    let mut scene = Scene::load("cornell").expect("a built-in scene");
    change(&mut scene);
    Place::new(Arc::new(scene), "shake").expect("a camera path")
}

/// A cube on a floor under a lamp, of any size.
fn cube(scale: f32, offset: f32, light: impl FnOnce(&mut SceneBuilder)) -> Result<Scene, String> {
    let mut builder = SceneBuilder::new();
    let material = builder.material(Material::diffuse("", Vec3::splat(0.7)));
    let at = |p: Vec3| p * scale + offset;
    let floor = [[-2.0, 2.0], [2.0, 2.0], [2.0, -2.0], [-2.0, -2.0]]
        .map(|[x, z]: [f32; 2]| at(Vec3::new(x, -0.5, z)));
    let cube = Shape::cuboid(at(Vec3::splat(-0.5)), at(Vec3::splat(0.5)));
    for shape in [Shape::quad(floor), cube] {
        builder.add(&shape, material).map_err(|error| error.to_string())?;
    }
    light(&mut builder);
    let camera =
        Camera::look_at(at(Vec3::new(2.0, 1.5, 3.0)), at(Vec3::ZERO), 0.8, 1e-2 * scale, 1e2 * scale);
    builder.build("cube", camera, Vec3::splat(0.1), 0.0, CREASE_ANGLE).map_err(|error| error.to_string())
}

fn lamp(scale: f32, intensity: f32) -> impl FnOnce(&mut SceneBuilder) {
    move |builder| builder.point_light(Vec3::new(1.0, 3.0, 2.0) * scale, Vec3::splat(intensity))
}

// ---- Cases

/// Runs a case on a side.
type Case = fn(Side) -> Outcome;

/// What is extreme, what is right, and the case.
const CASES: [(&str, &str, Case); 11] = [
    ("images of 1x1, 1x64, 17x1, 8192x3, 16384x2", "finite", sizes),
    ("budgets of 0, 1, 100% and 1300% of the pixels", "finite; black without samples", budgets),
    ("fields of view of 0.01, 0.1, 1, 120, 179, 179.9 degrees", "finite", fields),
    ("far / near 10 to 10^9", "finite", ranges),
    ("scenes of 10^-6 to 10^6 m", "finite, and not black", scales),
    (
        "lights of 0, 10^-40, 10^18, 10^30, negative; NaN and infinite",
        "finite; the last two are refused",
        lights,
    ),
    (
        "samples from elsewhere with radiance NaN, infinite, negative, 10^30, 10^-45, and such positions",
        "finite",
        odd_samples,
    ),
    (
        "degenerate, sliver, coplanar, double triangles; the eye on a vertex, in the plane of a face",
        "finite",
        triangles,
    ),
    ("edges of 10^6 m, 1 mm before the eye: 10^9 pixels long", "finite", long_edges),
    ("mirrored and singular cameras, NaN; no time step", "finite", cameras),
    ("no surface at all; one triangle; the eye inside a cube", "finite", little),
];

/// The table of cases; the last column is the GPU's.
pub fn cases() -> String {
    let _warm = GRAPHS.map(|name| warm(name, &cornell(|_| ()), [24, 16]));
    let lines = CASES.map(|(what, right, case)| {
        let sides = [Side::Cpu, Side::Gpu].map(|side| case(side).text());
        [what, "`render-cache`, `epi`, `epi-filtered`", right]
            .map(String::from)
            .into_iter()
            .chain(sides)
            .collect()
    });
    markdown(&["extreme", "graphs", "right is", "CPU", "GPU"], &lines)
}

fn sizes(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    let place = cornell(|_| ());
    for name in GRAPHS {
        for size in [[1, 1], [1, 64], [17, 1], [8192, 3], [16384, 2]] {
            outcome.add(
                &format!("{name} {size:?}"),
                setup(name, &place, size, size[0] * size[1] / 10 + 1, side),
                3,
            );
        }
    }
    outcome
}

fn budgets(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    let place = cornell(|_| ());
    for name in GRAPHS {
        for samples in [0, 1, 384, 5000] {
            let what = format!("{name} {samples} samples");
            let mut run =
                outcome.start(&what, setup(name, &place, [24, 16], samples, side)).expect("it starts");
            run.frames(3).expect("it runs");
            outcome.check(&what, &mut run);
            let image = run.snapshot("image").expect("the picture").get::<[u8; 4]>();
            let is_black = image.iter().all(|pixel| *pixel == [0, 0, 0, 255]);
            assert!(is_black == (samples == 0) || samples == 1, "{what}");
        }
    }
    outcome
}

fn fields(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    for degrees in [0.01f32, 0.1, 1.0, 120.0, 179.0, 179.9] {
        let place = cornell(|scene| scene.camera.fov_y = degrees.to_radians());
        for name in GRAPHS {
            outcome.add(&format!("{name} {degrees} degrees"), setup(name, &place, [48, 32], 400, side), 3);
        }
    }
    outcome
}

fn ranges(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    for exponent in 1..=9 {
        let place =
            cornell(|scene| (scene.camera.near, scene.camera.far) = (1e-3, 1e-3 * 10f32.powi(exponent)));
        for name in GRAPHS {
            outcome.add(&format!("{name} 1:10^{exponent}"), setup(name, &place, [48, 32], 400, side), 3);
        }
    }
    outcome
}

fn scales(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    for exponent in [-6, -3, 0, 3, 6] {
        let scale = 10f32.powi(exponent);
        let scene = cube(scale, 0.0, lamp(scale, 20.0 * scale * scale)).expect("a scene");
        let place = Place::new(Arc::new(scene), "orbit").expect("a path");
        for name in GRAPHS {
            let what = format!("{name} {scale:e} m");
            let mut run = outcome.start(&what, setup(name, &place, [48, 32], 800, side)).expect("it starts");
            run.frames(4).expect("it runs");
            outcome.check(&what, &mut run);
            let image = run.snapshot("image").expect("the picture").get::<[u8; 4]>();
            let lit = image.iter().filter(|pixel| pixel[1] > 100).count();
            assert!(lit > 300, "{what}: {lit} bright pixels");
        }
    }
    outcome
}

fn lights(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    for intensity in [0.0, 1e-40, 1e18, 1e30, f32::NAN, f32::INFINITY, -1.0] {
        match cube(1.0, 0.0, lamp(1.0, intensity)) {
            Ok(scene) => {
                let place = Place::new(Arc::new(scene), "orbit").expect("a path");
                for name in GRAPHS {
                    outcome.add(
                        &format!("{name} light {intensity}"),
                        setup(name, &place, [48, 32], 400, side),
                        3,
                    );
                }
            }
            Err(message) => {
                assert!(message.contains("light"), "{message}");
                outcome.refused += 1;
            }
        }
    }
    assert_eq!(outcome.refused, 2, "NaN and infinity are no lights");
    outcome
}

/// Samples of all kinds of numbers.
struct Odd;

impl SampleSource for Odd {
    fn answer(&self, query: &Query, samples: &mut [Sample]) {
        const VALUES: [f32; 10] =
            [0.0, -0.0, 1e-45, 1e-40, 1.0, -1.0, 1e30, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        for (i, (request, sample)) in query.requests().zip(samples).enumerate() {
            let value = |at: usize| VALUES[(i + at + query.frame.index as usize) % 10];
            let ray = query.ray(request);
            let position = ray.origin + ray.direction * 2.0;
            let position = if i % 3 == 0 { Vec3::new(value(1), value(4), value(7)) } else { position };
            *sample = Sample {
                position: position.into(),
                hit: if i % 7 == 0 { HIT_BACKGROUND } else { HIT_SURFACE },
                radiance: [value(0), value(3), value(6)],
                body: 0,
                pixel: request.pixel,
                aim: request.aim,
                reuse: request.reuse,
                view: request.view,
                variance: value(2),
                normal: value(5).to_bits(),
                sharpness: value(8),
                ..Sample::default()
            };
        }
    }

    fn pace(&self) -> Pace {
        Pace::Exact
    }
}

fn odd_samples(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    let place = cornell(|_| ());
    for name in GRAPHS {
        outcome.add(name, setup(name, &place, [48, 32], 400, side).source(Odd), 6);
    }
    outcome
}

fn triangles(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    let shape = crate::edges::odd_shape(1.0, 0.0);
    let corners = shape.triangles[0].map(|at| shape.positions[at as usize]);
    for eye in [corners[0], 0.5 * (corners[0] + corners[1]), Vec3::new(3.0, 2.0, 4.0)] {
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::splat(0.7)));
        builder.add(&shape, material).expect("a shape");
        builder.point_light(Vec3::new(1.0, 3.0, 2.0), Vec3::splat(20.0));
        let camera = Camera::look_at(eye, Vec3::new(0.3, 0.6, 0.4), 1.0, 1e-3, 1e3);
        let scene = builder.build("odd", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).expect("a scene");
        let place = Place::new(Arc::new(scene), "shake").expect("a path");
        for name in GRAPHS {
            outcome.add(&format!("{name} from {eye}"), setup(name, &place, [48, 32], 400, side), 3);
        }
    }
    outcome
}

fn long_edges(side: Side) -> Outcome {
    let mut builder = SceneBuilder::new();
    let material = builder.material(Material::diffuse("", Vec3::splat(0.7)));
    let beam = |x: f32| {
        let [low, high] = [[-1e6, -1e-3], [1e6, -2e-3]].map(|[z, y]: [f32; 2]| Vec3::new(x, y, z));
        Shape {
            positions: vec![low, high, low + 1e-3 * Vec3::X],
            triangles: vec![[0, 1, 2]],
            ..Shape::default()
        }
    };
    (0..20).for_each(|i| builder.add(&beam(1e-3 * (i as f32 - 10.0)), material).expect("a beam"));
    builder.point_light(Vec3::Y, Vec3::ONE);
    let camera = Camera::look_at(Vec3::ZERO, Vec3::new(0.01, -0.02, -1.0), 1.0, 1e-3, 1e6);
    let place = Place::new(
        Arc::new(builder.build("beams", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).expect("a scene")),
        "shake",
    );
    let place = place.expect("a path");
    let mut outcome = Outcome::default();
    for name in GRAPHS {
        outcome.add(name, setup(name, &place, [48, 32], 400, side), 3);
    }
    outcome
}

fn cameras(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    let place = cornell(|_| ());
    for name in GRAPHS {
        let mut run = outcome.start(name, setup(name, &place, [48, 32], 400, side)).expect("it starts");
        run.frames(2).expect("it runs");
        let usual = run.next_frame().view;
        let nothing = [0.0; 3];
        let views = [
            usual,
            View { right: usual.right.map(|x| -x), ..usual },
            View { forward: nothing, ..usual },
            View { right: nothing, up: nothing, ..usual },
            View { right: usual.forward, up: usual.forward, ..usual },
            View { tan_x: 0.0, tan_y: 0.0, ..usual },
            View { eye: [f32::NAN; 3], ..usual },
            View { forward: [f32::INFINITY; 3], ..usual },
            View { eye: [1e9; 3], ..usual },
            usual,
        ];
        for (number, view) in views.into_iter().enumerate() {
            // The same view three times: nothing moves between these frames.
            let mut frame = run.next_frame();
            (frame.view, frame.previous, frame.predicted) = (view, view, view);
            run.run(&frame, true).unwrap_or_else(|error| panic!("{name}, view {number}: {error}"));
            outcome.check(&format!("{name}, view {number}"), &mut run);
        }
    }
    outcome
}

fn little(side: Side) -> Outcome {
    let mut outcome = Outcome::default();
    let camera = Camera::look_at(Vec3::ZERO, Vec3::X, 1.0, 0.1, 10.0);
    let empty = Scene::empty("nothing", camera, [Vec3::ZERO, Vec3::ONE]);
    let with = |shape: &Shape| {
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::ONE));
        builder.add(shape, material).expect("a shape");
        builder.build("little", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).expect("a scene")
    };
    let triangle = Shape {
        positions: vec![Vec3::X, Vec3::X + Vec3::Y, Vec3::X + Vec3::Z],
        triangles: vec![[0, 1, 2]],
        ..Shape::default()
    };
    for scene in [empty, with(&triangle), with(&Shape::cuboid(Vec3::splat(-1.0), Vec3::ONE))] {
        let place = Place::new(Arc::new(scene), "still").expect("a path");
        for name in GRAPHS {
            outcome.add(name, setup(name, &place, [24, 16], 100, side), 3);
        }
    }
    outcome
}

// ---- Parameters

/// Graphs that have all stages with parameters between them.
const WITH_ALL: [&str; 4] =
    ["epi-filtered.ron", "render-cache.ron", "experiments/complex-pixels.ron", "streams.ron"];

/// The values at the ends of a parameter's range, or all of them, as RON.
fn ends(spec: &ParamSpec) -> Vec<String> {
    match (&spec.kind, spec.range) {
        (ParamKind::Bool, _) => ["true", "false"].map(String::from).to_vec(),
        (ParamKind::Choice(names), _) => names.clone(),
        (ParamKind::U32 | ParamKind::I32, Some((low, high))) => vec![low.to_string(), high.to_string()],
        (ParamKind::F32, Some((low, high))) => [low, high].map(|x| format!("{x:?}")).to_vec(),
        (ParamKind::F32OrAuto, Some((low, high))) => {
            vec!["Auto".into(), format!("{low:?}"), format!("{high:?}")]
        }
        _ => vec![],
    }
}

/// Every parameter of every stage at both ends of its range, one at a time. Values with which a device cannot run, such
/// as memory that it does not have, are refused before the first frame.
pub fn parameters() -> String {
    let registry = epigraph_stages::registry();
    let moving = Place::load("cornell-moving", "orbit").expect("a built-in scene");
    let points: Vec<Vec3> =
        (0..1000).map(|i| Vec3::from([i % 13, i % 17, i % 19].map(|x| x as f32 / 10.0))).collect();
    let encoding =
        epigraph_scenes::streams::Settings { codec: Codec::Brick, levels: 3, ..Default::default() };
    let set = encode(&Points::from(points), &encoding).expect("points");
    let cloud =
        Place::new(Arc::new(Scene::of_points("points", Arc::new(set.into()))), "orbit").expect("a path");
    let mut seen = BTreeSet::new();
    let mut lines = vec![];
    for name in WITH_ALL {
        let place = if name == "streams.ron" { &cloud } else { &moving };
        let _warm = warm(name, place, [24, 16]);
        let settings = Settings { prune: false, ..Settings::new([24, 16], 20, place.facts()) };
        let (whole, _) =
            compile(&graph(name), &registry, &settings).unwrap_or_else(|problems| panic!("{problems}"));
        let values: Vec<(String, String, String)> = whole
            .nodes
            .iter()
            .flat_map(|node| {
                let specs = if seen.insert(node.kind.clone()) { node.stage.specs() } else { vec![] };
                specs
                    .into_iter()
                    .flat_map(|spec| {
                        ends(&spec)
                            .into_iter()
                            .map(move |value| (spec.name.clone(), value))
                            .collect::<Vec<_>>()
                    })
                    .map(|(param, value)| (node.name.clone(), param, value))
                    .collect::<Vec<_>>()
            })
            .collect();
        let sides = [Side::Cpu, Side::Gpu].map(|side| {
            let mut outcome = Outcome::default();
            // 4 GiB of main memory may be there, but taking them slows down whatever else runs.
            let is_fair = |value: &&(String, String, String)| {
                side == Side::Gpu || value.1 != "cache" || value.2 != "4095"
            };
            for (node, param, value) in values.iter().filter(is_fair) {
                let what = format!("{name}, {node}.{param} = {value} on {side}");
                let setup = setup(name, place, [24, 16], 20, side).poison(false).prune(false);
                let setup = setup.set(node, param, value).unwrap_or_else(|error| panic!("{what}: {error}"));
                let refused = outcome.refused;
                outcome.add(&what, setup, 2);
                // These have to agree with another node, or need memory.
                let may_be = ["normals", "accumulate", "variance", "compaction", "points_per_pixel", "cache"];
                let may_be = may_be.contains(&param.as_str());
                assert!(outcome.refused == refused || may_be, "{what} is refused");
            }
            outcome.text()
        });
        let name = name.trim_end_matches(".ron");
        lines.push([format!("`{name}`"), values.len().to_string()].into_iter().chain(sides).collect());
    }
    // Kinds with parameters that no graph had. Those of a shader file or a part are its own.
    let missing: Vec<_> = registry
        .kinds()
        .filter(|kind| !kind.specs().is_empty() && !seen.contains(kind.name()))
        .map(|kind| kind.name())
        .collect();
    assert!(missing.iter().all(|kind| ["graph", "wgsl"].contains(kind)), "{missing:?} are in no graph");
    markdown(&["graph", "values (of stages that no graph above has)", "CPU", "GPU"], &lines)
}

// ---- Worlds that are moved

/// A cube on a floor as an OBJ file, at an offset; all coordinates are multiples of 1/64 m.
fn obj(offset: DVec3) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("numerics");
    fs::create_dir_all(&folder).expect("the build's folder can be written");
    let path = folder.join(format!("moved-{}.obj", offset.x));
    let mut text = String::new();
    let mut vertex = |at: [f64; 3]| {
        let at = DVec3::from(at) + offset;
        text += &format!("v {} {} {}\n", at.x, at.y, at.z);
    };
    [[-2.0, -0.5, 2.0], [2.0, -0.5, 2.0], [2.0, -0.5, -2.0], [-2.0, -0.5, -2.0]]
        .into_iter()
        .for_each(&mut vertex);
    for i in 0..8 {
        vertex([i & 1, i >> 1 & 1, i >> 2].map(|side| f64::from(side) - 0.5 + 1.0 / 64.0));
    }
    // The box reaches as far up as down, so that its centre is the offset.
    vertex([0.0, 0.5 + 1.0 / 32.0, 0.0]);
    vertex([0.25, 0.5, 0.0]);
    vertex([0.0, 0.5, 0.25]);
    text += "f 1 2 3 4\n";
    for face in [
        [5, 7, 8, 6],
        [9, 10, 12, 11],
        [5, 6, 10, 9],
        [7, 11, 12, 8],
        [5, 9, 11, 7],
        [6, 8, 12, 10],
        [13, 14, 15, 15],
    ] {
        text += &format!("f {} {} {}\nf {} {} {}\n", face[0], face[1], face[2], face[0], face[2], face[3]);
    }
    fs::write(&path, text.replace("f 13 15 15\n", "")).expect("the build's folder can be written");
    path
}

fn picture(name: &str, place: &Place, side: Side) -> Vec<[u8; 4]> {
    let samples = if name == "streams.ron" { 1 } else { 1500 };
    let mut run =
        setup(name, place, [96, 64], samples, side).start().unwrap_or_else(|error| panic!("{name}: {error}"));
    run.frames(6).unwrap_or_else(|error| panic!("{name}: {error}"));
    run.snapshot("image").expect("the picture").get()
}

/// The same world at the origin and at 10^3 to 10^8 m, whole pictures: how many pixels differ.
pub fn moved_worlds() -> String {
    let offset = |exponent: i32| {
        if exponent == 0 { DVec3::ZERO } else { DVec3::new(1.0, -0.5, 0.25) * 10f64.powi(exponent) }
    };
    let scan: Vec<DVec3> = (0..40_000)
        .map(|i| {
            let [u, v] = [i % 200, i / 200].map(|at| f64::from(at) / 64.0 - 1.5625);
            DVec3::new(u, ((u * 3.0).sin() * 8.0).round() / 64.0, v)
        })
        .collect();
    let surfaces = |exponent: i32| {
        let path = obj(offset(exponent));
        Place::load(path.to_str().expect("a path of UTF-8"), "orbit")
            .unwrap_or_else(|error| panic!("{error}"))
    };
    let points = |exponent: i32| {
        let moved: Vec<DVec3> = scan.iter().map(|&at| at + offset(exponent)).collect();
        let set = encode(&Points::from_double(&moved), &Default::default()).expect("points");
        Place::new(Arc::new(Scene::of_points("scan", Arc::new(set.into()))), "orbit").expect("a path")
    };
    let shown = |name: &str, exponent: i32, side: Side| {
        picture(name, &if name == "streams.ron" { points(exponent) } else { surfaces(exponent) }, side)
    };
    let mut lines = vec![];
    for name in [GRAPHS[0], GRAPHS[1], GRAPHS[2], "streams.ron"] {
        let place = if name == "streams.ron" { points(0) } else { surfaces(0) };
        let _warm = warm(name, &place, [96, 64]);
        let here = [Side::Cpu, Side::Gpu].map(|side| shown(name, 0, side));
        for image in &here {
            let lit = image.iter().filter(|pixel| pixel[1] > 20).count();
            assert!(lit > 500, "{name}: {lit} pixels are not dark");
        }
        let differing: Vec<[usize; 2]> = (3..=8)
            .map(|exponent| {
                let there = [Side::Cpu, Side::Gpu].map(|side| shown(name, exponent, side));
                [0, 1].map(|side| here[side].iter().zip(&there[side]).filter(|(a, b)| a != b).count())
            })
            .collect();
        for (exponent, differing) in (3..=8).zip(&differing) {
            assert_eq!(*differing, [0, 0], "{name} at 10^{exponent} m");
        }
        let cells = [0, 1].map(|side| {
            let all: Vec<String> = differing.iter().map(|of| of[side].to_string()).collect();
            all.join(", ")
        });
        let name = name.trim_end_matches(".ron");
        lines.push(
            [format!("`{name}`"), "10^3, 10^4, 10^5, 10^6, 10^7, 10^8 m".into()]
                .into_iter()
                .chain(cells)
                .collect(),
        );
    }
    markdown(
        &["graph", "moved by", "pixels of 6144 that differ, CPU", "pixels of 6144 that differ, GPU"],
        &lines,
    )
}
