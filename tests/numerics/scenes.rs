//! What comes from the scene: how bodies move, and where rays meet surfaces.

use std::sync::{Arc, LazyLock};

use epigraph_core::{
    Harness, Host, Settings, Side, View,
    testing::{Random, settings},
};
use epigraph_scenes::{
    CREASE_ANGLE, Camera, Material, Motion as Path, MotionKey, Scene, SceneBuilder, Shape, Tracer,
};
use epigraph_stages::{
    Pace, World,
    gbuffer::Gbuffer,
    mesh::{Mesh, MeshParams},
    motion::Motion,
    shared::{
        moves::Move,
        octahedral::{NO_NORMAL, decode_oct16},
        requests::{HIT_SURFACE, Request, Sample, VIEW_NOW},
    },
    surfaces::{SurfaceLook, Surfaces},
    trace::{Light, Trace, TraceParams},
};
use epigraph_tests::gpu;
use glam::{DMat3, DQuat, DVec3, Quat, Vec3};

use crate::{
    Group,
    interval::{Interval, ulp},
    measured,
    table::{Expected, Measure, Row, Unit},
};

pub static ROWS: Group = LazyLock::new(|| {
    measured(&[|| vec![moves()], || hits().into(), || vec![soft_light()], || surfaces().into()])
});

fn camera() -> Camera {
    Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 1.0, 0.1, 100.0)
}

fn host(scene: Arc<Scene>) -> Host {
    let mut host = Host::default();
    host.insert(World::new(Arc::new(Tracer::new(scene)), Pace::Exact, 1));
    host
}

fn build(builder: SceneBuilder) -> Arc<Scene> {
    Arc::new(builder.build("test", camera(), Vec3::ZERO, 0.0, CREASE_ANGLE).expect("a scene"))
}

/// The motion of each body between two frames: its pose now after the inverse of that before.
fn moves() -> Row {
    let mut measure = Measure::within(
        "motion",
        "rows of the moves",
        "turns and shifts of 10^-6 to 10^6 m, pivots to 10^6 m; rest, and no time step: exact",
        "f64",
        6.0,
        Unit::Of("ULP of 1, or of the distance from the origin"),
    )
    .on_cpu_only();
    let mut random = Random(1);
    for exponent in [-6, -3, 0, 3, 6] {
        let scale = 10f32.powi(exponent);
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::ONE));
        for body in 0..20 {
            let mut any = || Vec3::from([0; 3].map(|_| scale * random.between(-1.0, 1.0)));
            let (pivot, from, to, shape) =
                (any(), any(), any(), Shape::cuboid(Vec3::ZERO, Vec3::splat(scale)));
            let turn = if body % 3 == 0 {
                Quat::IDENTITY
            } else {
                Quat::from_axis_angle(any().normalize_or(Vec3::X), 1.0)
            };
            let key = |time, translate, rotate| MotionKey { time, translate, rotate };
            // Some rest between the frames.
            let end = if body == 4 { (from, Quat::IDENTITY) } else { (to, turn) };
            let keys = vec![key(0.0, from, Quat::IDENTITY), key(1.0, end.0, end.1)];
            builder
                .moving(Path { pivot, keys, looped: false }, |builder| builder.add(&shape, material))
                .expect("a body");
        }
        let scene = build(builder);
        for index in [0, 1, 17, 29, 40] {
            let facts = Settings { facts: World::facts(&scene, false), ..settings([1, 1], 1) };
            let mut harness = Harness::<Motion>::new((), &facts);
            harness.frame.index = index;
            let out = harness
                .run(Side::Cpu, &epigraph_stages::registry(), &host(scene.clone()), None)
                .expect("it runs");
            let got = out.get::<Move>("moves");
            let [now, before] = [index, index.saturating_sub(1)].map(|frame| scene.poses_at(frame));
            let (mut numbers, mut expected) = (vec![], vec![]);
            for (got, (now, before)) in got[1..].iter().zip(now.iter().zip(&before)) {
                let matrix = |rotation: Quat| {
                    let DQuat { x, y, z, w } = rotation.as_dquat();
                    DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
                };
                let turn = matrix(now.rotation) * matrix(before.rotation).transpose();
                let [there, here] = [now, before].map(|pose| pose.translation.as_dvec3());
                let shift = there - turn * here;
                let far = there.length().max(here.length());
                let rests = now == before;
                for (axis, row) in [got.x, got.y, got.z].into_iter().enumerate() {
                    let exact = turn.row(axis);
                    for (column, exact) in [exact.x, exact.y, exact.z, shift[axis]].into_iter().enumerate() {
                        let unit = if column < 3 { ulp(1.0) } else { ulp(far) };
                        let exact = if rests { f64::from(u8::from(axis == column)) } else { exact };
                        let slack = if rests { 0.0 } else { 8.0 * unit };
                        numbers.push(row[column]);
                        expected.push(Expected {
                            exact,
                            allowed: Interval { low: exact - slack, high: exact + slack },
                            unit,
                        });
                    }
                }
            }
            measure.compare(
                Side::Cpu,
                &format!("scale {scale:e}, frame {index}"),
                [4, numbers.len() / 4],
                &numbers,
                &expected,
            );
        }
    }
    measure.row()
}

/// Where rays meet a triangle, and how bright a point light makes it there.
fn hits() -> [Row; 3] {
    const DOMAIN: &str = "scales 10^-6 to 10^6 m, offsets to 10^8 m, 0.01 to 179 degrees, grazing rays";
    let mut plane = Measure::within(
        "trace",
        "distance of a hit from the plane",
        DOMAIN,
        "f64",
        4.0,
        Unit::Of("2^-24 of the largest coordinate"),
    )
    .on_cpu_only();
    let mut aside = Measure::within(
        "trace",
        "distance of a hit from the ray",
        "the same",
        "f64",
        5.0,
        Unit::Of("10^-6 of the triangle's size"),
    )
    .on_cpu_only();
    let mut light = Measure::within(
        "trace",
        "radiance below a point light",
        "distances of 10^-3 to 10^6 m; intensity 10^-20 to 10^20",
        "f64: ρ/π I cos / d²",
        8.0,
        Unit::Of("ULP"),
    )
    .on_cpu_only();
    let mut random = Random(2);
    let scales = [-6, -3, 0, 3, 6].map(|exponent| (10f32.powi(exponent), 0.0f32, 60.0));
    let offsets = [3, 5, 7, 8].map(|exponent| (1e-1 * 10f32.powi(exponent - 2), 10f32.powi(exponent), 60.0));
    let fields = [0.01, 1.0, 179.0].map(|fov| (1.0, 0.0, fov));
    for (scale, offset, fov) in scales.into_iter().chain(offsets).chain(fields) {
        let eye = Vec3::new(offset, -offset, 0.5 * offset);
        // A large triangle in front of the eye, tilted: rays graze it.
        let tilt = [0.0, 3.0, 0.3][random.below(3) as usize];
        let corner = |x: f32, y: f32| eye + scale * Vec3::new(x, y, -1.0 - tilt * y.clamp(-0.3, 1e9));
        let corners = [corner(-600.0, -0.3), corner(600.0, -0.3), corner(0.0, 900.0)];
        let shape = Shape { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Shape::default() };
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::splat(0.5)));
        builder.add(&shape, material).expect("a triangle");
        let lamp = eye + scale * Vec3::new(0.3, 0.4, 0.1);
        let intensity = [1e-20, 1.0, 1e20][random.below(3) as usize];
        builder.point_light(lamp, Vec3::splat(intensity));
        let scene = build(builder);

        let tan = (f64::from(fov as f32).to_radians() / 2.0).tan() as f32;
        let view = View {
            eye: eye.into(),
            near: 1e-3 * scale,
            far: 1e3 * scale,
            tan_x: tan,
            tan_y: tan,
            ..View::default()
        };
        let size = [64, 64];
        let requests: Vec<Request> = (0..512)
            .map(|_| Request {
                pixel: random.below(64 * 64),
                aim: random.bits(),
                reuse: u32::MAX,
                view: VIEW_NOW,
            })
            .collect();
        let facts = Settings { samples: 512, ..settings(size, 512) };
        let params = TraceParams { spp: 1, mode: Light::Direct, max_bounces: 0 };
        let mut harness = Harness::<Trace>::new(params, &facts);
        harness.frame.view = view;
        harness.set("requests", &requests);
        let out = harness.run(Side::Cpu, &epigraph_stages::registry(), &host(scene), None).expect("it runs");
        let name = format!("scale {scale:e}, offset {offset:e}, {fov} degrees, intensity {intensity:e}");
        let double = |at: [f32; 3]| DVec3::from(at.map(f64::from));
        let [a, b, c] = corners.map(|at| at.as_dvec3());
        let normal = (b - a).cross(c - a).normalize();
        let largest = f64::from(eye.abs().max_element().max(600.0 * scale));
        let (mut worst, mut count, mut found, mut expected) = ([0f64; 2], 0, vec![], vec![]);
        for sample in out.get::<Sample>("samples").iter().filter(|sample| sample.hit == HIT_SURFACE) {
            let [x, y] = [sample.aim & 0xFFFF, sample.aim >> 16].map(|share| f64::from(share) / 65536.0);
            let [x, y] = [f64::from(sample.pixel % 64) + x, f64::from(sample.pixel / 64) + y]
                .map(|at| at / 32.0 - 1.0);
            let ray = DVec3::new(x * f64::from(tan), -y * f64::from(tan), -1.0).normalize();
            let at = double(sample.position);
            let along = (at - eye.as_dvec3()).dot(ray);
            let from_ray = (at - eye.as_dvec3() - along * ray).length();
            let from_plane = (at - a).dot(normal).abs();
            worst = [worst[0].max(from_plane), worst[1].max(from_ray)];
            count += 1;
            // The light of the place that was found.
            let to_lamp = lamp.as_dvec3() - at;
            let cosine = to_lamp.normalize().dot(normal).abs();
            let exact = 0.5 / std::f64::consts::PI * f64::from(intensity) * cosine / to_lamp.length_squared();
            if offset == 0.0 && (1e-30..1e30).contains(&exact) {
                found.push(sample.radiance[1]);
                let slack = 64.0 * ulp(exact);
                expected.push(Expected {
                    exact,
                    allowed: Interval { low: exact - slack, high: exact + slack },
                    unit: ulp(exact),
                });
            }
        }
        assert!(count > 0, "{name}: no ray meets the triangle");
        plane.record(Side::Cpu, &name, worst[0] / ((-24f64).exp2() * largest), count);
        let size = f64::from(1200.0 * scale);
        aside.record(Side::Cpu, &name, worst[1] / (1e-6 * size), count);
        light.compare(Side::Cpu, &name, [found.len(), 1], &found, &expected);
    }
    [plane.row(), aside.row(), light.row()]
}

/// The mean of many samples of a square light is the integral over it.
fn soft_light() -> Row {
    let mut measure = Measure::statistic(
        "trace",
        "mean radiance below a square light",
        "lights of 10^-3 to 10 m, 1 m away; 1 to 16 paths; 64 places",
        "f64 integral",
        "standard errors (z-test, level 10^-6 over all places)",
        5.9,
    )
    .on_cpu_only();
    for (number, side) in [1e-3, 0.3, 10.0].into_iter().enumerate() {
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::splat(0.5)));
        let floor =
            [[-8.0, 8.0], [8.0, 8.0], [8.0, -8.0], [-8.0, -8.0]].map(|[x, z]: [f32; 2]| Vec3::new(x, 0.0, z));
        builder.add(&Shape::quad(floor), material).expect("a floor");
        let corner = Vec3::new(-0.5 * side, 1.0, -0.5 * side);
        builder.quad_light(corner, Vec3::X * side, Vec3::Z * side, Vec3::splat(2.0)).expect("a light");
        let scene = build(builder);
        // From above, through the floor's middle: the light is above the eye.
        let view = View {
            eye: [0.0, 0.9, 0.0],
            right: [1.0, 0.0, 0.0],
            up: [0.0, 0.0, -1.0],
            forward: [0.0, -1.0, 0.0],
            tan_x: 1.0,
            tan_y: 1.0,
            near: 0.01,
            far: 100.0,
        };
        let requests: Vec<Request> = (0..64)
            .map(|pixel| Request { pixel, aim: 0x8000_8000, reuse: u32::MAX, view: VIEW_NOW })
            .collect();
        let spp = [1, 4, 16][number];
        let mut harness = Harness::<Trace>::new(
            TraceParams { spp, mode: Light::Direct, max_bounces: 0 },
            &settings([8, 8], 64),
        );
        harness.frame.view = view;
        harness.set("requests", &requests);
        const FRAMES: u32 = 400;
        let host = host(scene);
        let mut sums = vec![[0f64; 2]; 64];
        let mut places = vec![DVec3::ZERO; 64];
        for index in 0..FRAMES {
            harness.frame.index = index;
            let out = harness.run(Side::Cpu, &epigraph_stages::registry(), &host, None).expect("it runs");
            for sample in out.get::<Sample>("samples") {
                let value = f64::from(sample.radiance[1]);
                let sum = &mut sums[sample.pixel as usize];
                *sum = [sum[0] + value, sum[1] + value * value];
                places[sample.pixel as usize] = DVec3::from(sample.position.map(f64::from));
            }
        }
        let mut worst = 0f64;
        for ([sum, squares], at) in sums.into_iter().zip(places) {
            const STEPS: usize = 400;
            let step = f64::from(side) / STEPS as f64;
            let grid = (0..STEPS * STEPS).map(|i| {
                let [x, z] = [i % STEPS, i / STEPS].map(|k| f64::from(-0.5 * side) + (k as f64 + 0.5) * step);
                let d = DVec3::new(x, 1.0, z) - at;
                // Both cosines are the height over the distance.
                d.y * d.y / d.length_squared().powi(2)
            });
            let exact = 0.5 / std::f64::consts::PI * 2.0 * grid.sum::<f64>() * step * step;
            let n = f64::from(FRAMES);
            let mean = sum / n;
            let deviation = ((squares / n - mean * mean).max(0.0) / (n - 1.0)).sqrt();
            // Where samples hardly differ, what remains are the roundings of single precision.
            worst = worst.max((mean - exact).abs() / deviation.max(1e-6 * exact));
        }
        measure.record(Side::Cpu, &format!("side {side}"), worst, 64);
    }
    measure.row()
}

/// The surface that each pixel shows: a body that has moved, before a camera that has, too.
fn surfaces() -> [Row; 4] {
    let row = |quantity, domain, oracle, bound, unit| {
        Measure::within("gbuffer", quantity, domain, oracle, bound, Unit::Of(unit))
    };
    let mut lists =
        Measure::exact("surfaces", "materials and bodies; normals of a flat body", "the same", "the scene")
            .on_cpu_only();
    let mut depth = row(
        "distance of `depth` along the pixel's ray from the plane",
        "scales 10^-6 to 10^6 m, offsets to 10^7 m, 1 to 120 degrees",
        "f64",
        4.0,
        "2^-24 of the largest coordinate",
    );
    let mut normal = row("angle of `normal`", "the same", "f64: the triangle's", 3.0, "10^-5 rad");
    let mut motion = row(
        "`motion`",
        "the same; camera and body turned by 0.1, shifted by a tenth of the distance",
        "f64, of the point at `depth`",
        5.0,
        "2^-24 of the image's width, times the largest coordinate over the distance",
    );
    let size = [48, 48];
    let mut random = Random(3);
    let scales = [-6, -3, 0, 3, 6].map(|exponent| (10f32.powi(exponent), 0.0f32, 60.0));
    let offsets = [3, 5, 7].map(|exponent| (1e-1 * 10f32.powi(exponent - 2), 10f32.powi(exponent), 60.0));
    let fields = [1.0, 120.0].map(|fov| (1.0, 0.0, fov));
    for (scale, offset, fov) in scales.into_iter().chain(offsets).chain(fields) {
        let eye = Vec3::new(offset, -offset, 0.5 * offset);
        let tan = (f64::from(fov as f32).to_radians() / 2.0).tan() as f32;
        // A triangle that fills the image, tilted, 1 to 3 scales away.
        let tilt = 0.3 * random.between(-1.0, 1.0);
        let corner = |x: f32, y: f32| eye + scale * Vec3::new(tan * x, tan * y, -2.0 - tan * tilt * x);
        let corners = [corner(-9.0, -9.0), corner(9.0, -9.0), corner(0.0, 12.0)];
        let shape = Shape { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Shape::default() };
        // At rest in the frame that is shown: it was turned and elsewhere before.
        let key = |time, translate, rotate| MotionKey { time, translate, rotate };
        let shift = 0.1 * scale * Vec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), 0.0);
        let before = key(0.0, shift, Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 0.1));
        let keys = vec![before, key(1.0 / 30.0, Vec3::ZERO, Quat::IDENTITY)];
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::splat(0.5)));
        builder
            .moving(Path { pivot: corners[0], keys, looped: false }, |builder| builder.add(&shape, material))
            .expect("a body");
        let scene = build(builder);

        let view = View {
            eye: eye.into(),
            near: 1e-3 * scale,
            far: 1e3 * scale,
            tan_x: tan,
            tan_y: tan,
            ..View::default()
        };
        let (sin, cos) = 0.1f32.sin_cos();
        let previous = View {
            eye: (eye + 0.1 * scale * Vec3::new(1.0, -0.5, 0.3)).into(),
            right: [cos, 0.0, sin],
            forward: [sin, 0.0, -cos],
            ..view
        };
        let [now, then] = [1, 0].map(|frame| scene.poses_at(frame)[0]);
        let moved = Move::of(&now.after(&then.inverse()));
        let facts = Settings { facts: World::facts(&scene, false), ..settings(size, 1) };
        let (registry, host) = (epigraph_stages::registry(), host(scene.clone()));
        let mut mesh = Harness::<Mesh>::new(MeshParams::default(), &facts);
        let mut surfaces = Harness::<Surfaces>::new((), &facts);
        (mesh.frame.index, surfaces.frame.index) = (1, 1);
        let mesh = mesh.run(Side::Cpu, &registry, &host, None).expect("it runs");
        let surfaces = surfaces.run(Side::Cpu, &registry, &host, None).expect("it runs");
        let mut harness = Harness::<Gbuffer>::new((), &facts);
        harness.frame.view = view;
        harness.frame.previous = previous;
        harness.set("moves", &[Move::REST, moved]);
        harness.set("vertices", &mesh.get::<[f32; 4]>("vertices"));
        harness.set("faces", &mesh.get::<[u32; 4]>("faces"));
        harness.set("corners", &surfaces.get::<[u32; 4]>("corners"));
        harness.set("looks", &surfaces.get::<SurfaceLook>("looks"));

        let name = format!("scale {scale:e}, offset {offset:e}, {fov} degrees");
        let double = |at: [f32; 3]| DVec3::from(at.map(f64::from));
        // In the pose in which it is shown, rounded as its vertices are.
        let posed = scene.posed(&scene.poses_at(1));
        let [a, b, c] = posed.mesh.corners(0).map(|at| at.as_dvec3());
        let facing = (b - a).cross(c - a).normalize();
        let largest =
            f64::from(posed.mesh.positions.iter().map(|at| at.abs().max_element()).fold(0.0, f32::max));
        let largest = largest.max(f64::from(eye.abs().max_element()));
        let corners = surfaces.get::<[u32; 4]>("corners");
        let flat = [NO_NORMAL, NO_NORMAL, NO_NORMAL, 1 << 24];
        lists.compare_words(Side::Cpu, &name, [4, 1], corners.as_flattened(), &flat);
        for side in Side::ALL {
            harness.frame.index = 1;
            let out = harness.run(side, &registry, &host, (side == Side::Gpu).then(gpu)).expect("it runs");
            let ids = out.get::<u32>("id");
            let (depths, normals) = (out.get::<f32>("depth"), out.get::<u32>("normal"));
            let motions = out.get::<[f32; 2]>("motion");
            assert!(ids.iter().all(|&id| id == 0), "{name}: the triangle fills the image");
            let mut worst = [0f64; 3];
            for pixel in 0..48 * 48 {
                let [x, y] = [pixel % 48, pixel / 48].map(|side| (side as f64 + 0.5) / 24.0 - 1.0);
                let ray = DVec3::new(x * f64::from(tan), -y * f64::from(tan), -1.0);
                let z = f64::from(depths[pixel]);
                let at = eye.as_dvec3() + ray * z;
                let off = (at - a).dot(facing).abs() / ((-24f64).exp2() * largest.max(z));
                let turn = decode_oct16(normals[pixel]).as_dvec3().normalize().cross(facing).length() / 1e-5;
                // Rotations are undone by their transpose.
                let rows = [moved.x, moved.y, moved.z].map(|row| row.map(f64::from));
                let gone = DVec3::from([0, 1, 2].map(|axis| at[axis] - rows[axis][3]));
                let was = DVec3::from(
                    [0, 1, 2].map(|axis| (0..3).map(|row| rows[row][axis] * gone[row]).sum::<f64>()),
                );
                let from = was - double(previous.eye);
                let distance = from.dot(double(previous.forward));
                let u = from.dot(double(previous.right)) / distance / f64::from(tan);
                let v = from.dot(double(previous.up)) / distance / f64::from(tan);
                let exact = [24.0 * (u - x), 24.0 * (-v - y)];
                let unit = (-24f64).exp2() * 48.0 * (largest / z).max(1.0) / f64::from(tan).min(1.0);
                let off_motion =
                    [0, 1].map(|axis| (f64::from(motions[pixel][axis]) - exact[axis]).abs() / unit);
                let found = [off, turn, off_motion[0].max(off_motion[1])];
                worst = std::array::from_fn(|index| worst[index].max(found[index]));
            }
            for (measure, worst) in [&mut depth, &mut normal, &mut motion].into_iter().zip(worst) {
                measure.record(side, &name, worst, 48 * 48);
            }
        }
    }
    [depth.row(), normal.row(), motion.row(), lists.row()]
}
