//! Meshes, silhouettes, boundaries of shadows and where edges cross pixels.

use std::sync::{Arc, LazyLock};

use epigraph_core::{
    Harness, Host, Settings, Side, View,
    testing::{Random, settings},
};
use epigraph_scenes::{CREASE_ANGLE, Camera, Material, Scene, SceneBuilder, Shape, Tracer};
use epigraph_stages::{
    Pace, World,
    compact::Compact,
    edge_raster::{self, DepthTest, EdgeRaster, EdgeRasterParams},
    mesh::{Mesh, MeshParams, Normals, decode_f16, encode_f16},
    shadow_edges::{ShadowEdges, ShadowEdgesParams},
    shared::{
        octahedral::{decode_oct16, encode_oct16},
        segments::{MeshEdge, Segment},
    },
    silhouette::{Silhouette, SilhouetteParams},
};
use glam::{DVec3, Vec3};

use crate::{
    Group, both,
    interval::{Interval, Number},
    measured,
    pixels::sides,
    table::{Measure, Row, Unit},
};

pub static ROWS: Group = LazyLock::new(|| {
    measured(&[
        || meshes().into(),
        || silhouettes().into(),
        || vec![crossings()],
        || lines().into(),
        || vec![shadows()],
    ])
});

// ---- Meshes

/// Triangles of all kinds at a place: a cube, slivers, flat ones, the same one twice, coplanar ones.
pub fn odd_shape(scale: f32, offset: f32) -> Shape {
    let mut random = Random(9);
    let mut shape = Shape::cuboid(Vec3::ZERO, Vec3::ONE);
    for height in [1.0, 1e-2, 1e-4, 1e-6, 0.0] {
        for _ in 0..20 {
            let mut any = || Vec3::from([0; 3].map(|_| random.between(-2.0, 2.0)));
            let (a, b, c) = (any(), any(), any());
            // The third corner is near the middle of the first side.
            shape.positions.extend([a, b, 0.5 * (a + b) + height * c]);
            let first = shape.positions.len() as u32 - 3;
            shape.triangles.push([first, first + 1, first + 2]);
        }
    }
    let twice = shape.triangles[13];
    shape.triangles.extend([twice, [twice[0], twice[2], twice[1]]]);
    for at in &mut shape.positions {
        *at = *at * scale + offset;
    }
    shape
}

fn scene_of(shapes: &[Shape], lights: &[Vec3], camera: Camera) -> Arc<Scene> {
    let mut builder = SceneBuilder::new();
    let material = builder.material(Material::diffuse("", Vec3::splat(0.8)));
    shapes.iter().for_each(|shape| builder.add(shape, material).expect("a shape"));
    lights.iter().for_each(|&at| builder.point_light(at, Vec3::ONE));
    Arc::new(builder.build("odd", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).expect("a scene"))
}

const CAMERA: (Vec3, Vec3) = (Vec3::new(3.0, 4.0, 5.0), Vec3::ZERO);

fn looking(scale: f32) -> Camera {
    Camera::look_at(CAMERA.0 * scale, CAMERA.1, 1.0, 1e-3 * scale, 1e3 * scale)
}

fn host(scene: &Arc<Scene>) -> Host {
    let mut host = Host::default();
    host.insert(World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact, 1));
    host
}

fn facts(scene: &Scene) -> Settings {
    Settings { facts: World::facts(scene, false), ..settings([4, 4], 1) }
}

/// Scales and offsets of meshes, metres.
fn places() -> impl Iterator<Item = (f32, f32)> {
    let scales = (-6..=6).map(|exponent| (10f32.powi(exponent), 0.0));
    scales.chain((1..=7).map(|exponent| (1.0, 10f32.powi(exponent))))
}

fn meshes() -> [Row; 4] {
    const DOMAIN: &str =
        "a cube, slivers to 10^-6, flat, double, coplanar triangles; scales 10^-6 to 10^6; offsets to 10^7 m";
    let mut lists =
        Measure::exact("mesh", "vertices, faces, edges, normals of flat faces", DOMAIN, "the scene's lists")
            .on_cpu_only();
    let of_unit = |quantity, bound| {
        Measure::within("mesh", quantity, "the same", "f64", bound, Unit::Of("10^-6 rad")).on_cpu_only()
    };
    let mut angles =
        [of_unit("normals, F32", 0.06), of_unit("normals, F16", 400.0), of_unit("normals, Oct16", 70.0)];
    for (scale, offset) in places() {
        let scene = scene_of(&[odd_shape(scale, offset)], &[], looking(1.0));
        let mesh = &scene.mesh;
        let exact: Vec<DVec3> = (0..mesh.triangles.len())
            .map(|face| {
                let [a, b, c] = mesh.corners(face).map(Vec3::as_dvec3);
                (b - a).cross(c - a).normalize_or_zero()
            })
            .collect();
        let name = format!("scale {scale:e}, offset {offset:e}");
        for (which, normals) in [Normals::F32, Normals::F16, Normals::Oct16].into_iter().enumerate() {
            let mut harness = Harness::<Mesh>::new(MeshParams { normals }, &facts(&scene));
            let out =
                harness.run(Side::Cpu, &epigraph_stages::registry(), &host(&scene), None).expect("it runs");
            let found: Vec<Vec3> = match normals {
                Normals::F32 => {
                    out.get::<[f32; 4]>("normals").iter().map(|n| Vec3::from_slice(&n[..3])).collect()
                }
                Normals::F16 => {
                    out.get::<[u32; 2]>("normals").into_iter().map(|n| decode_f16(n).into()).collect()
                }
                Normals::Oct16 => out.get::<u32>("normals").into_iter().map(decode_oct16).collect(),
            };
            let mut wrong = 0;
            for (found, exact) in found.iter().zip(&exact) {
                let found = found.as_dvec3();
                if *exact == DVec3::ZERO || found == DVec3::ZERO {
                    wrong += usize::from(*exact != found);
                    continue;
                }
                let angle = found.cross(*exact).length().atan2(found.dot(*exact));
                angles[which].record(Side::Cpu, &name, angle * 1e6, 1);
            }
            lists.count(Side::Cpu, &name, wrong, exact.len());
            let words = |list: &[[u32; 4]]| list.as_flattened().to_vec();
            let faces: Vec<_> = mesh
                .triangles
                .iter()
                .zip(&**mesh.object)
                .map(|(&[a, b, c], &object)| [a, b, c, object])
                .collect();
            lists.compare_words(Side::Cpu, &name, [1, 1], &out.get("faces"), &words(&faces));
            let vertices: Vec<_> =
                mesh.positions.iter().map(|p| [p.x, p.y, p.z, 1.0].map(f32::to_bits)).collect();
            lists.compare_words(Side::Cpu, &name, [1, 1], &out.get("vertices"), &words(&vertices));
            let edges = mesh.edges.iter().flat_map(|edge| {
                [edge.vertices[0], edge.vertices[1], edge.faces[0], edge.faces[1], edge.kind as u32, 0]
            });
            lists.compare_words(Side::Cpu, &name, [1, 1], &out.get("edges"), &edges.collect::<Vec<_>>());
        }
    }
    let [f32, f16, oct16] = angles;
    [lists.row(), f32.row(), f16.row(), oct16.row()]
}

/// Faces that face the eye, the edges that are drawn, and their list.
fn silhouettes() -> [Row; 3] {
    const DOMAIN: &str = "the meshes of `mesh`; eyes around them, and in the planes of faces; all normals";
    let mut facing =
        Measure::exact("silhouette", "faces that face the eye", DOMAIN, "intervals: n·p near 0 either way");
    let mut drawn = Measure::exact(
        "silhouette",
        "edges drawn, their list",
        "the same; one- and two-sided borders",
        "section 2.1",
    );
    let mut compact =
        Measure::exact("compact", "the list of edges drawn", "the same", "section 2.1").on_cpu_only();
    let mut random = Random(8);
    for (number, (scale, offset)) in places().enumerate() {
        let scene = scene_of(&[odd_shape(scale, offset)], &[], looking(1.0));
        let mesh = &scene.mesh;
        let normals = [Normals::F32, Normals::F16, Normals::Oct16][number % 3];
        let two_sided_borders = number % 2 == 0;
        for eye in 0..4 {
            let eye: [f32; 3] = match eye {
                // In the plane of a face, and at one of its corners.
                0 => (0.5 * (mesh.positions[0] + mesh.positions[1])).into(),
                1 => mesh.positions[2].into(),
                _ => [0; 3].map(|_| offset + scale * random.between(-3.0, 3.0)),
            };
            let params = SilhouetteParams { normals, two_sided_borders, ..SilhouetteParams::default() };
            let mut harness = Harness::<Silhouette>::new(params, &facts(&scene));
            harness.frame.view = View { eye, ..View::default() };
            let vertices: Vec<[f32; 4]> = mesh.positions.iter().map(|p| p.extend(1.0).into()).collect();
            let edges: Vec<MeshEdge> = mesh
                .edges
                .iter()
                .map(|edge| MeshEdge {
                    vertices: edge.vertices,
                    faces: edge.faces,
                    kind: edge.kind as u32,
                    pad: 0,
                })
                .collect();
            harness.set("vertices", &vertices);
            harness.set("faces", &mesh.triangles.iter().map(|&[a, b, c]| [a, b, c, 0]).collect::<Vec<_>>());
            harness.set("edges", &edges);
            let list = &mesh.face_normals;
            let stored: Vec<Vec3> = match normals {
                Normals::F32 => {
                    harness
                        .set("normals", &list.iter().map(|n| n.extend(0.0).to_array()).collect::<Vec<_>>());
                    list.clone()
                }
                Normals::F16 => {
                    let words: Vec<_> = list.iter().map(|&n| encode_f16(n.into())).collect();
                    harness.set("normals", &words);
                    words.into_iter().map(|word| decode_f16(word).into()).collect()
                }
                Normals::Oct16 => {
                    let words: Vec<_> = list.iter().map(|&n| encode_oct16(n)).collect();
                    harness.set("normals", &words);
                    words.into_iter().map(decode_oct16).collect()
                }
            };
            let outputs = both(&mut harness);
            for (side, outputs) in sides(&outputs) {
                let name = format!("scale {scale:e}, offset {offset:e}, eye {eye:?}, {normals:?}");
                let bits = outputs.get::<u32>("facing");
                let faces_eye = |face: u32| bits[face as usize / 32] >> (face % 32) & 1 == 1;
                let expected: Vec<u32> = (0..stored.len())
                    .map(|face| {
                        let at = mesh.corners(face)[0];
                        let product = |axis: usize| {
                            let p = Interval::given(at[axis]) - Interval::given(eye[axis]);
                            // Octahedral normals are decoded in each shader, with roundings of their own.
                            let n = f64::from(stored[face][axis]);
                            let near = if normals == Normals::Oct16 { 1e-6 } else { 0.0 };
                            Interval { low: n - near, high: n + near } * p
                        };
                        let product = product(0) + product(1) + product(2);
                        let got = u32::from(faces_eye(face as u32));
                        match (product.high < 0.0, product.low >= 0.0) {
                            (true, _) => 1,
                            (_, true) => 0,
                            _ => got,
                        }
                    })
                    .collect();
                let got: Vec<u32> = (0..stored.len() as u32).map(|face| u32::from(faces_eye(face))).collect();
                facing.compare_words(side, &name, [1, 1], &got, &expected);
                let chosen: Vec<u32> = (0..)
                    .zip(&edges)
                    .filter(|(_, edge)| {
                        let first = faces_eye(edge.faces[0]);
                        match edge.kind {
                            0 => first != faces_eye(edge.faces[1]),
                            1 => first || faces_eye(edge.faces[1]),
                            _ => first || two_sided_borders,
                        }
                    })
                    .map(|(at, _)| at)
                    .collect();
                let segments: Vec<Segment> = chosen
                    .iter()
                    .map(|&at| {
                        let [a, b] = edges[at as usize].vertices.map(|at| mesh.positions[at as usize].into());
                        Segment { a, flags: 0, b, edge: at }
                    })
                    .collect();
                let words = |segments: &[Segment]| -> Vec<u32> {
                    segments
                        .iter()
                        .flat_map(|s| {
                            [s.a.map(f32::to_bits), [s.flags, s.edge, 0], s.b.map(f32::to_bits)].concat()
                        })
                        .collect()
                };
                let found = outputs.get::<Segment>("segments");
                drawn.compare_words(side, &name, [1, 1], &outputs.get("count"), &[chosen.len() as u32]);
                drawn.compare_words(side, &name, [1, 1], &words(&found[..chosen.len()]), &words(&segments));
                if side == Side::Cpu {
                    let mut collect = Harness::<Compact>::new((), &facts(&scene));
                    collect.set("vertices", &vertices);
                    collect.set("edges", &edges);
                    collect.set("drawn", &outputs.get::<u32>("drawn"));
                    let out = collect
                        .run(side, &epigraph_stages::registry(), &Host::default(), None)
                        .expect("it runs");
                    let found = out.get::<Segment>("segments");
                    compact.compare_words(
                        side,
                        &name,
                        [1, 1],
                        &words(&found[..chosen.len()]),
                        &words(&segments),
                    );
                }
            }
        }
    }
    [facing.row(), drawn.row(), compact.row()]
}

// ---- Crossings

/// A view in which the x and y of a point at z = 1 are its pixel coordinates, relative to the image's middle.
fn pixel_view(size: [u32; 2]) -> View {
    let [tan_x, tan_y] = size.map(|side| 0.5 * side as f32);
    View { tan_x, tan_y, near: 0.5, far: 1000.0, ..View::default() }
}

/// The point at distance z that projects to a place in 1/256 pixel, exactly.
fn point([x, y]: [i64; 2], z: f32, size: [u32; 2]) -> [f32; 3] {
    let [x, y] = [x as f32 / 256.0 - 0.5 * size[0] as f32, y as f32 / 256.0 - 0.5 * size[1] as f32];
    [x * z, -y * z, -z]
}

/// A crossing: the line's axis (0 vertical) and number, and the slot along it.
type Crossing = (usize, i128, i128);

/// The crossings of a segment with lines `step` apart, by the rule of section 2.2, in whole numbers of any size.
fn crossings_of(a: [i64; 2], b: [i64; 2], step: i128, size: [u32; 2]) -> Vec<Crossing> {
    let mut found = vec![];
    for axis in [0, 1] {
        let along = |p: [i64; 2]| [p[axis], p[1 - axis]].map(i128::from);
        let [a, b] = if a[axis] <= b[axis] { [along(a), along(b)] } else { [along(b), along(a)] };
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        for line in 0..=i128::from(size[axis]) * 256 / step {
            // A vertex on the line lies beyond it.
            if (a[0] >= step * line) == (b[0] >= step * line) {
                continue;
            }
            let (numerator, denominator) = (8 * (a[1] * dx + (step * line - a[0]) * dy), 256 * dx);
            // The perturbation moves a crossing at the end of a slot back on vertical lines, if the segment descends.
            let slot = if axis == 0 && dy > 0 {
                -(-numerator).div_euclid(denominator) - 1
            } else {
                numerator.div_euclid(denominator)
            };
            if (0..8 * i128::from(size[1 - axis])).contains(&slot) {
                found.push((axis, line, slot));
            }
        }
    }
    found
}

/// Whether an edge at distance z shows: at the owner of a side, or the pixel before it.
fn shows(test: DepthTest, z: f32, owner: Option<f32>, other: Option<f32>) -> bool {
    let at = |depth: Option<f32>| depth.is_some_and(|depth| z <= depth);
    match test {
        DepthTest::Off => true,
        DepthTest::Either => at(owner) || at(other),
        DepthTest::Owner => at(if owner.is_some() { owner } else { other }),
        DepthTest::Both => [owner, other].into_iter().flatten().all(|depth| z <= depth),
    }
}

fn crossings() -> Row {
    let mut measure = Measure::exact(
        "edge_raster",
        "crossings and vertices",
        "edges on corners and sides of pixels, 0 to 65,000 px long; all depth tests, methods; 1x1 to 16384x2",
        "section 2.2 in 128-bit integers",
    );
    let mut random = Random(7);
    for size in [[1, 1], [1, 33], [31, 17], [16384, 2]] {
        for (number, depth_test) in
            [DepthTest::Off, DepthTest::Either, DepthTest::Owner, DepthTest::Both].into_iter().enumerate()
        {
            let shape = size.map(|side| side as usize);
            // On half of the pixels, edges at distance 1 are hidden.
            let filtered: Vec<f32> =
                (0..shape[0] * shape[1]).map(|_| [0.5, 1.0][random.below(2) as usize]).collect();
            let ends: Vec<[[i64; 2]; 2]> = (0..24)
                .map(|kind| {
                    let mut end = || {
                        std::array::from_fn::<i64, 2, _>(|axis| {
                            let inside = i64::from(random.below(256 * size[axis] + 512)) - 256;
                            match kind % 4 {
                                // On corners; anywhere; far outside, up to the limit of the drawing space.
                                0 | 3 => inside / 256 * 256,
                                1 => inside,
                                _ => i64::from(random.below(16_000_000)) - 8_000_000,
                            }
                        })
                    };
                    let [a, b] = [end(), end()];
                    // Along a side, or nowhere.
                    if kind % 4 == 3 { [a, [if kind % 8 == 3 { a[0] } else { b[0] }, a[1]]] } else { [a, b] }
                })
                .collect();
            let segments: Vec<Segment> = ends
                .iter()
                .map(|&[a, b]| Segment {
                    a: point(a, 1.0, size),
                    b: point(b, 1.0, size),
                    ..Segment::default()
                })
                .collect();
            let depth = |x: i64, y: i64| {
                let inside = (0..size[0] as i64).contains(&x) && (0..size[1] as i64).contains(&y);
                inside.then(|| filtered[(y * size[0] as i64 + x) as usize])
            };
            let (mut mask, mut vertex) =
                (vec![0u32; (shape[0] + 1) * (shape[1] + 1)], vec![0u32; shape[0] * shape[1]]);
            for &[a, b] in &ends {
                for (axis, line, slot) in crossings_of(a, b, 256, size) {
                    let (line, row) = (line as i64, (slot / 8) as i64);
                    let [x, y] = if axis == 0 { [line, row] } else { [row, line] };
                    let other = if axis == 0 { depth(x - 1, y) } else { depth(x, y - 1) };
                    if shows(depth_test, 1.0, depth(x, y), other) {
                        mask[y as usize * (shape[0] + 1) + x as usize] |= 1 << (slot % 8 + 8 * axis as i128);
                    }
                }
                for [x, y] in [a, b].into_iter().filter(|_| a != b) {
                    let pixel = [x.div_euclid(256), y.div_euclid(256)];
                    if depth(pixel[0], pixel[1]).is_some_and(|z| depth_test == DepthTest::Off || 1.0 <= z) {
                        let at = [x, y].map(|along| ((along.rem_euclid(256) as u32) + 8) / 16);
                        let word = &mut vertex[pixel[1] as usize * shape[0] + pixel[0] as usize];
                        *word = (*word).max(0x1_0000 | at[1] << 8 | at[0]);
                    }
                }
            }
            // The rasteriser's target has a column more than the image: 16384 is too wide for it.
            let rasterises = number % 2 == 1 && size[0] < 16384;
            let method = if rasterises { edge_raster::Method::Lines } else { edge_raster::Method::Compute };
            let params = EdgeRasterParams { method, depth_test, ..EdgeRasterParams::default() };
            let mut harness = Harness::<EdgeRaster>::new(params, &settings(size, 1));
            harness.frame.view = pixel_view(size);
            harness.set("silhouettes", &segments);
            harness.set("filtered", &filtered);
            for (side, outputs) in sides(&both(&mut harness)) {
                let name = format!("{size:?} {depth_test:?} {method:?}");
                measure.compare_words(side, &name, shape.map(|side| side + 1), &outputs.get("mask"), &mask);
                measure.compare_words(side, &name, shape, &outputs.get("vertex"), &vertex);
            }
        }
    }
    measure.row()
}

/// Edges in perspective, clipped at the near plane and at the drawing space: every crossing that is marked is near the
/// exact line, and none is missing.
fn lines() -> [Row; 2] {
    let measure = |domain, bound, unit| {
        Measure::within(
            "edge_raster",
            "distance of crossings from the line",
            domain,
            "f64",
            bound,
            Unit::Of(unit),
        )
    };
    let mut short =
        measure("edges of 1 to 10^4 px, in front of the eye and past it; offsets to 10^5 m", 0.07, "pixels");
    let mut long = measure(
        "edges of 10^6 and 10^7 px; the same offsets",
        1.0,
        "2^-24 of the length, beyond 0.07 pixels",
    );
    let size = [64, 48];
    let mut random = Random(6);
    for offset in [0.0, 1e2, 1e4, 1e5] {
        for length in [1.0, 1e2, 1e4, 1e6, 1e7] {
            for number in 0..12 {
                let eye = [offset, -offset, 0.5 * offset];
                let view = View { eye, tan_x: 0.8, tan_y: 0.6, near: 0.1, far: 1e9, ..View::default() };
                // Through a place in the image, at a distance at which single precision knows it to 1/1000 pixel.
                let z = 1f32.max(offset);
                let middle = [0.8, 0.6].map(|tan: f32| tan * z * random.between(-0.9, 0.9));
                let (angle, slope) = (random.between(0.0, 6.3), random.between(-0.5, 0.5));
                let reach = length * z * 0.8 / 32.0 * 0.5;
                // Some end behind the eye.
                let slope = if number % 3 == 2 { slope + slope.signum() } else { slope };
                let end = |sign: f32| {
                    let [x, y] =
                        [middle[0] + sign * reach * angle.cos(), middle[1] + sign * reach * angle.sin()];
                    [x + eye[0], y + eye[1], -z * (1.0 + sign * slope) + eye[2]]
                };
                let segment = Segment { a: end(-1.0), b: end(1.0), ..Segment::default() };
                let params = EdgeRasterParams { depth_test: DepthTest::Off, ..EdgeRasterParams::default() };
                let mut harness = Harness::<EdgeRaster>::new(params, &settings(size, 1));
                harness.frame.view = view;
                harness.set("silhouettes", &[segment]);
                harness.set("filtered", &vec![1e9f32; 64 * 48]);
                // The plane of the eye and the segment, in f64, as a linear function of the place in the image.
                let from_eye = |p: [f32; 3]| DVec3::from(p.map(f64::from)) - DVec3::from(eye.map(f64::from));
                let (a, b) = (from_eye(segment.a), from_eye(segment.b));
                let plane = a.cross(b);
                let steps = [view.tan_x, view.tan_y].map(f64::from);
                let steps = [plane.x * steps[0] / 32.0, -plane.y * steps[1] / 24.0];
                let at_middle = -plane.z;
                let distance = |[x, y]: [f64; 2]| {
                    ((x - 32.0) * steps[0] + (y - 24.0) * steps[1] + at_middle).abs()
                        / steps[0].hypot(steps[1])
                };
                for (side, outputs) in sides(&both(&mut harness)) {
                    let name = format!("offset {offset:e}, {length:e} px");
                    let mask = outputs.get::<u32>("mask");
                    let (mut worst, mut marked) = (0f64, 0);
                    for (corner, bits) in mask.iter().enumerate() {
                        for bit in (0..16).filter(|bit| bits >> bit & 1 == 1) {
                            let (x, y) = ((corner % 65) as f64, (corner / 65) as f64);
                            let slot = (f64::from(bit % 8) + 0.5) / 8.0;
                            worst = worst.max(distance(if bit < 8 { [x, y + slot] } else { [x + slot, y] }));
                            marked += 1;
                        }
                    }
                    // Lines that the segment surely crosses within the image.
                    let mut sure = 0;
                    for axis in [0, 1] {
                        let project = |p: DVec3| {
                            let tan = f64::from([view.tan_x, -view.tan_y][axis]);
                            0.5 * f64::from(size[axis]) * (1.0 + [p.x, p.y][axis] / -p.z / tan)
                        };
                        let ends = [project(a), project(b)];
                        let is_before = a.z < -0.2 && b.z < -0.2;
                        for line in 0..=size[axis] {
                            let ratio = -steps[axis] / steps[1 - axis];
                            let [here, there] = [0, 1].map(|which| 0.5 * f64::from(size[(axis + which) % 2]));
                            let at = there + (f64::from(line) - here) * ratio - at_middle / steps[1 - axis];
                            let inside = (0.1..f64::from(size[1 - axis]) - 0.1).contains(&at);
                            let range = ends[0].min(ends[1]) + 0.1..ends[0].max(ends[1]) - 0.1;
                            let surely = is_before && range.contains(&f64::from(line));
                            sure += usize::from(inside && surely && ratio.abs() < 10.0);
                        }
                    }
                    // At 10^7 px, a line may be off by half a pixel: near the image's corners it may be missed.
                    if length < 1e6 {
                        assert!(
                            marked >= sure,
                            "{name} on {side}: {marked} crossings are marked of at least {sure}"
                        );
                        short.record(side, &name, worst, marked);
                    } else {
                        long.record(
                            side,
                            &name,
                            (worst - 0.07).max(0.0) / (f64::from(length) * (-24f64).exp2()),
                            marked,
                        );
                    }
                }
            }
        }
    }
    [short.row(), long.row()]
}

// ---- Shadows

/// The shadow of a square on a floor below a point light: its outline is known exactly.
fn shadows() -> Row {
    let mut measure = Measure::within(
        "shadow_edges",
        "distance of a boundary from the exact outline",
        "scales 10^-3 to 10^6; offsets to 1000 times the size",
        "f64",
        0.5,
        Unit::Of("2^-24 of the largest coordinate"),
    )
    .on_cpu_only();
    let scales = [1e-3, 1.0, 1e3, 1e6].map(|scale| (scale, 0.0));
    for (scale, offset) in scales.into_iter().chain([1e2, 1e3, 1e4].map(|offset| (1.0, offset))) {
        let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) * scale + offset;
        let square = |half: f32, y: f32| {
            Shape::quad([at(-half, y, half), at(half, y, half), at(half, y, -half), at(-half, y, -half)])
        };
        let light = at(0.1, 4.0, -0.2);
        let camera = Camera::look_at(at(3.0, 4.0, 5.0), at(0.0, 0.0, 0.0), 1.0, 1e-2 * scale, 1e2 * scale);
        let scene = scene_of(&[square(5.0, 0.0), square(1.0, 2.0)], &[light], camera);
        let params = ShadowEdgesParams { capacity: 1000, ..ShadowEdgesParams::default() };
        let mut harness = Harness::<ShadowEdges>::new(params, &settings([4, 4], 1));
        let out = harness.run(Side::Cpu, &epigraph_stages::registry(), &host(&scene), None).expect("it runs");
        let (count, segments) = (out.get::<u32>("count")[0] as usize, out.get::<Segment>("segments"));
        // The light is as far above the square as the square above the floor: the shadow is twice as large.
        let corners = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|[x, z]: [f32; 2]| {
            let (light, corner) = (light.as_dvec3(), at(x, 2.0, z).as_dvec3());
            let floor = f64::from(at(0.0, 0.0, 0.0).y);
            light + (corner - light) * ((floor - light.y) / (corner.y - light.y))
        });
        let largest = f64::from(5.0 * scale + offset);
        let (mut worst, mut length) = (0f64, 0.0);
        for segment in &segments[..count] {
            let ends = [segment.a, segment.b].map(|end| Vec3::from(end).as_dvec3());
            length += ends[0].distance(ends[1]);
            let from_side = |i: usize, end: DVec3| {
                let (a, b) = (corners[i], corners[(i + 1) % 4]);
                (end - a).cross((b - a).normalize()).length()
            };
            let of_side = |i| ends.iter().map(|&end| from_side(i, end)).fold(0.0, f64::max);
            worst = worst.max((0..4).map(of_side).fold(f64::INFINITY, f64::min));
        }
        let name = format!("scale {scale:e}, offset {offset:e}");
        // Nearly all of the outline, four times four: some is lost at the corners, where rays decide.
        let share = length / (16.0 * f64::from(scale));
        assert!((0.97..1.01).contains(&share), "{name}: {share} of the outline");
        measure.record(Side::Cpu, &name, worst / (largest * (-24f64).exp2()), count);
    }
    measure.row()
}
