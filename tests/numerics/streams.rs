//! Point sets of vertex transformation streams: which nodes are shown, and where their points are.

use std::sync::{Arc, LazyLock};

use epigraph_core::{
    Harness, Host, Settings, Side, View,
    testing::{Random, settings},
};
use epigraph_scenes::{
    Scene, Tracer,
    streams::{Codec, PointSet, Points, encode},
};
use epigraph_stages::{
    Pace, World,
    shared::streams::{BRICKS, NO_ATTRIBUTE, StreamNode, StreamPool},
    stream_cut::{StreamCut, StreamCutParams},
    stream_decode::{Expand, Show, StreamDecode, StreamDecodeParams},
};
use glam::{DVec3, Vec3};

use crate::{
    Group, both,
    interval::{Interval, Number, ulp},
    measured,
    pixels::sides,
    table::{Expected, Measure, Row, Unit},
};

pub static ROWS: Group = LazyLock::new(|| measured(&[|| vec![cuts()], || decoded().into()]));

/// A cut through a made-up point set: the lists that the decoder takes, and the points that they stand for.
struct Cut {
    words: Vec<u32>,
    nodes: Vec<StreamNode>,
    pools: Vec<StreamPool>,
    /// The node and the cell of each point, and its words of colour and normal.
    points: Vec<(usize, [u32; 3], u32, u32)>,
    vertices: u32,
}

impl Cut {
    /// Pools of 1 to 4 words of tags, bricks, and single points, in nodes of a size and at an offset.
    fn random(nodes: usize, scale: f32, offset: f32, random: &mut Random) -> Self {
        let mut cut = Self { words: vec![], nodes: vec![], pools: vec![], points: vec![], vertices: 0 };
        for node in 0..nodes {
            let angle = random.between(0.0, 6.2);
            let (sin, cos) = angle.sin_cos();
            let mut at = || offset + scale * random.between(-100.0, 100.0);
            let frame = StreamNode {
                origin: [at(), at(), at()],
                cell: scale,
                x: [cos, sin, 0.0],
                y: [-sin, cos, 0.0],
                z: [0.0, 0.0, 1.0],
                rotation: [0.0, 0.0, 0.0, 1.0],
                first_point: cut.points.len() as u32,
                index: node as u32,
                ..StreamNode::default()
            };
            cut.nodes.push(frame);
            let first = cut.points.len();
            for tag_words in [2, 1, 4, 0] {
                let is_brick = tag_words == 2;
                let begin = cut.words.len() as u32;
                let translations: Vec<[u32; 3]> = match is_brick {
                    true => (0..64).map(|i| [i % 4, i / 4 % 4, i / 16]).collect(),
                    false => (0..32 * tag_words).map(|_| [0; 3].map(|_| random.below(40))).collect(),
                };
                let pack = |[x, y, z]: [u32; 3]| x | y << 7 | z << 14;
                if !is_brick {
                    cut.words.extend(translations.iter().copied().map(pack));
                }
                let count = 1 + random.below(20);
                let vertices: Vec<[u32; 3]> = (0..count)
                    .map(|_| [0; 3].map(|_| random.below(if is_brick { 31 } else { 88 })))
                    .collect();
                let vertices: Vec<_> =
                    vertices.into_iter().map(|at| if is_brick { at.map(|x| 4 * x) } else { at }).collect();
                let place = cut.words.len() as u32;
                cut.words.extend(vertices.iter().copied().map(pack));
                let tags_at = cut.words.len() as u32;
                let mut pool = StreamPool {
                    node: node as u32,
                    tag_words,
                    translations: if is_brick { BRICKS } else { begin },
                    vertices: place,
                    tags: tags_at,
                    first_vertex: cut.vertices,
                    first_point: cut.points.len() as u32,
                    number: 3,
                };
                if tag_words == 0 {
                    pool.translations = 0;
                }
                cut.pools.push(pool);
                cut.vertices += count;
                for vertex in vertices {
                    if tag_words == 0 {
                        cut.points.push((node, vertex, 0, 0));
                    }
                    for word in 0..tag_words {
                        // At least one point of each vertex.
                        let tags = if word == 0 { random.bits() | 1 } else { random.bits() & random.bits() };
                        cut.words.push(tags);
                        for bit in (0..32).filter(|bit| tags >> bit & 1 == 1) {
                            let by = translations[(32 * word + bit) as usize];
                            let cell = std::array::from_fn(|axis| vertex[axis] + by[axis]);
                            cut.points.push((node, cell, 0, 0));
                        }
                    }
                }
            }
            // Colours and normals, of some nodes only.
            let count = cut.points.len() - first;
            let (mut colors, mut normals) = (NO_ATTRIBUTE, NO_ATTRIBUTE);
            if node % 3 > 0 {
                colors = cut.words.len() as u32;
                for point in &mut cut.points[first..] {
                    point.2 = [0, 0xFF_FFFF, random.bits()][random.below(3) as usize];
                    cut.words.push(point.2);
                }
            }
            if node % 3 == 2 {
                normals = cut.words.len() as u32;
                for point in &mut cut.points[first..first + count] {
                    // Unit vectors on the octahedron, and none.
                    point.3 = if random.below(5) == 0 { 0x8000_8000 } else { random.bits() & 0x3FFF_3FFF };
                    cut.words.push(point.3);
                }
            }
            let node = cut.nodes.last_mut().expect("just added");
            (node.colors, node.normals) = (colors, normals);
        }
        cut
    }
}

/// The centre of a cell (section 6).
fn center<N: Number>(node: &StreamNode, cell: [u32; 3]) -> [N; 3] {
    let at = cell.map(|at| (N::given(at as f32) + N::given(0.5)) * N::given(node.cell));
    std::array::from_fn(|axis| {
        let along = |direction: [f32; 3], by: usize| N::given(direction[axis]) * at[by];
        N::given(node.origin[axis]) + along(node.x, 0) + along(node.y, 1) + along(node.z, 2)
    })
}

fn decoded() -> [Row; 3] {
    const DOMAIN: &str =
        "800 to 33,000 points; cells of 10^-9 to 10^6 m at 0 to 10^8 m; pools, bricks, singles";
    let mut position = Measure::within(
        "stream_decode",
        "positions",
        DOMAIN,
        "f64",
        2.5,
        Unit::Of("ULP of the largest term"),
    );
    let mut radiance = Measure::within(
        "stream_decode",
        "stored radiance",
        "the same; colours and normals of all bits, none; light 0 and 1",
        "f64",
        1.1,
        Unit::Of("1/512 of the brightest channel, or 2^-25"),
    );
    let mut slots =
        Measure::exact("stream_decode", "which slots hold a point", "the same", "the sum of the tags");
    let mut random = Random(1);
    for (number, (nodes, scale, offset)) in
        [(1, 1.0, 0.0), (12, 1e-9, 0.0), (12, 1e6, 0.0), (12, 1e-2, 1e4), (3, 1.0, 1e8), (40, 1e-3, 1.0)]
            .into_iter()
            .enumerate()
    {
        let cut = Cut::random(nodes, scale, offset, &mut random);
        let points = cut.points.len() as u32;
        let size = [64, 64];
        // Some slots more than points.
        let points_per_pixel = (points as f32 / 4096.0 + 0.1).max(0.2);
        let light = [0.0, 1.0, 0.8][number % 3];
        for expand in [Expand::Prefix, Expand::Product] {
            let params = StreamDecodeParams { expand, show: Show::Color, light, points_per_pixel };
            let mut harness = Harness::<StreamDecode>::new(params, &settings(size, 1));
            harness.set("words", &cut.words);
            harness.set("nodes", &cut.nodes);
            harness.set("pools", &cut.pools);
            let starts = (f64::from(points_per_pixel / 256.0) * 4096.0).round().max(1.0) as usize;
            let starts: Vec<u32> = (0..starts as u32)
                .map(|start| {
                    let first = (256 * start).min(points - 1);
                    (cut.pools.partition_point(|pool| pool.first_point <= first) - 1) as u32
                })
                .collect();
            harness.set("starts", &starts);
            let groups = [cut.vertices.min(32768), cut.vertices.div_ceil(32768), 1];
            let rest = [points, cut.vertices, cut.pools.len() as u32, nodes as u32, 0];
            harness.set("numbers", &[groups.as_slice(), &rest].concat());
            let forward = harness.frame.view.forward;
            for (side, outputs) in sides(&both(&mut harness)) {
                let name = format!("{points} points, cell {scale:e}, offset {offset:e}, {expand:?}");
                let meta = outputs.get::<u32>("cloud.meta");
                let live: Vec<u32> =
                    (0..meta.len() as u32).map(|slot| u32::from(slot < points) << 16).collect();
                slots.compare_words(side, &name, [1, 1], &meta, &live);
                let (place, color) =
                    (outputs.get::<[f32; 4]>("cloud.position"), outputs.get::<u32>("cloud.radiance"));
                let (mut places, mut exact_places, mut colors, mut exact_colors) =
                    (vec![], vec![], vec![], vec![]);
                for (slot, &(node, cell, word, normal)) in cut.points.iter().enumerate() {
                    let frame = &cut.nodes[node];
                    let (exact, allowed) = (center::<f64>(frame, cell), center::<Interval>(frame, cell));
                    let largest =
                        frame.origin.into_iter().fold(frame.cell * 128.0, |most, x| most.max(x.abs()));
                    for axis in 0..3 {
                        places.push(place[slot][axis]);
                        exact_places.push(Expected {
                            exact: exact[axis],
                            allowed: allowed[axis],
                            unit: ulp(largest.into()),
                        });
                    }
                    let linear = |code: u32| {
                        let code = f64::from(code) / 255.0;
                        if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
                    };
                    let own = match frame.colors {
                        NO_ATTRIBUTE => [0.7; 3],
                        _ => [0, 8, 16].map(|shift| linear(word >> shift & 255)),
                    };
                    let facing = match (frame.normals, normal) {
                        (NO_ATTRIBUTE, _) | (_, 0x8000_8000) => None,
                        (_, bits) => {
                            // Section 2.1: two coordinates of an unfolded octahedron.
                            let [x, y] = [bits as i16, (bits >> 16) as i16].map(|at| f64::from(at) / 32767.0);
                            let z = 1.0 - x.abs() - y.abs();
                            let fold = (-z).max(0.0);
                            let n = DVec3::new(x - fold.copysign(x), y - fold.copysign(y), z);
                            Some(n.normalize().dot(DVec3::from(forward.map(f64::from))).abs())
                        }
                    };
                    let light = f64::from(light);
                    let bright = facing.map_or(1.0, |facing| 1.0 - light + light * facing);
                    let exact = own.map(|channel| channel * bright);
                    let unit = (exact.into_iter().fold(0.0, f64::max) / 512.0).max((-25f64).exp2());
                    let scale = (f64::from(color[slot] >> 27) - 24.0).exp2();
                    for (channel, exact) in exact.into_iter().enumerate() {
                        colors.push((f64::from(color[slot] >> (9 * channel) & 511) * scale) as f32);
                        let allowed = Interval { low: exact - 1.2 * unit, high: exact + 1.2 * unit };
                        exact_colors.push(Expected { exact, allowed, unit });
                    }
                }
                let shape = [3, cut.points.len()];
                position.compare(side, &name, shape, &places, &exact_places);
                radiance.compare(side, &name, shape, &colors, &exact_colors);
            }
        }
    }
    [position.row(), radiance.row(), slots.row()]
}

/// The cut is where cells have become small enough: every node above it has too large ones, or it is a leaf.
fn cuts() -> Row {
    let mut measure = Measure::exact(
        "stream_cut",
        "nodes of the cut",
        "eyes within the points to 10^6 sizes away; cells of 0.05 to 1000 px; sizes of 10^-6 to 10^6 m",
        "recursion, f64",
    )
    .on_cpu_only();
    let mut random = Random(2);
    for scale in [1e-6f32, 1.0, 1e6] {
        let positions: Vec<Vec3> = (0..20_000)
            .map(|_| {
                let direction = Vec3::from([0; 3].map(|_| random.between(-1.0, 1.0))).normalize_or(Vec3::X);
                direction * scale * random.between(0.9, 1.0)
            })
            .collect();
        let encoding =
            epigraph_scenes::streams::Settings { codec: Codec::Brick, levels: 6, ..Default::default() };
        let set = PointSet::from(encode(&Points::from(positions), &encoding).expect("points"));
        let scene = Arc::new(Scene::of_points("shell", Arc::new(set)));
        for distance in [0.0, 0.5, 3.0, 100.0, 1e6] {
            for cell in [0.05, 1.0, 30.0, 1000.0] {
                let params = StreamCutParams {
                    cell,
                    points_per_pixel: 256.0,
                    upload: 4_194_303,
                    ..StreamCutParams::default()
                };
                let facts = Settings { facts: World::facts(&scene, false), ..settings([64, 48], 1) };
                let mut harness = Harness::<StreamCut>::new(params, &facts);
                let eye = [0.1 * scale, 0.2 * scale, distance * scale];
                let view = View {
                    eye,
                    near: 1e-2 * scale,
                    far: 1e7 * scale,
                    tan_x: 0.8,
                    tan_y: 0.6,
                    ..View::default()
                };
                harness.frame.view = view;
                let mut host = Host::default();
                host.insert(World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact, 1));
                let out = harness.run(Side::Cpu, &epigraph_stages::registry(), &host, None).expect("it runs");
                let count = out.get::<u32>("numbers")[6] as usize;
                let got: Vec<u32> =
                    out.get::<StreamNode>("nodes")[..count].iter().map(|node| node.index).collect();
                let model = &scene.points.as_ref().expect("points").models()[0];
                let mut expected = vec![];
                let mut open = vec![0];
                while let Some(index) = open.pop() {
                    let node = &model.nodes()[index];
                    let Some(size) = cell_in_image(node, &view, [64, 48]) else { continue };
                    // No cut may depend on how single precision rounds the size.
                    assert!((size / f64::from(cell) - 1.0).abs() > 1e-5, "another distance is needed");
                    match node.children() {
                        Some(children)
                            if size > f64::from(cell)
                                && children.iter().any(|&child| {
                                    cell_in_image(&model.nodes()[child], &view, [64, 48]).is_some()
                                }) =>
                        {
                            open.extend(children)
                        }
                        _ => expected.push(index as u32),
                    }
                }
                expected.sort_unstable();
                measure.compare_words(
                    Side::Cpu,
                    &format!("size {scale:e} m, distance {distance}, cell {cell}"),
                    [1, 1],
                    &got,
                    &expected,
                );
            }
        }
    }
    measure.row()
}

/// The edge of a node's cells in pixels where its box is nearest to the eye; `None` if the box is outside the view.
fn cell_in_image(node: &epigraph_scenes::streams::Node, view: &View, size: [u32; 2]) -> Option<f64> {
    let frame = node.frame();
    let cells = node.cells();
    let ends = |axis: usize| {
        let along = cells.iter().map(|cell| cell.at()[axis]);
        [along.clone().min().expect("cells"), along.max().expect("cells") + 1].map(f64::from)
    };
    let (x, y, z) = (ends(0), ends(1), ends(2));
    let corners = (0..8).map(|i| {
        let at = [x[i & 1], y[i >> 1 & 1], z[i >> 2]].map(|at| at * f64::from(frame.cell));
        let place = frame.origin.as_dvec3()
            + (0..3).map(|axis| frame.axes[axis].as_dvec3() * at[axis]).sum::<DVec3>();
        // The default view looks along -z.
        let p = place - DVec3::from(view.eye.map(f64::from));
        [p.x, p.y, -p.z]
    });
    let corners: Vec<_> = corners.collect();
    let [tan_x, tan_y, near] = [view.tan_x, view.tan_y, view.near].map(f64::from);
    let all = |outside: &dyn Fn(f64, f64, f64) -> bool| corners.iter().all(|&[x, y, z]| outside(x, y, z));
    let beside = all(&|x, _, z| x > z * tan_x) || all(&|x, _, z| -x > z * tan_x);
    let above = all(&|_, y, z| y > z * tan_y) || all(&|_, y, z| -y > z * tan_y);
    if all(&|_, _, z| z < near) || beside || above {
        return None;
    }
    let nearest = corners.iter().map(|corner| corner[2]).fold(f64::INFINITY, f64::min).max(near);
    Some(f64::from(frame.cell) * f64::from(size[1]) / (2.0 * tan_y * nearest))
}
