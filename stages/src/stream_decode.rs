//! Decodes the points of a cut into the cloud that `project` and the other stages show (`algorithms.md` section 6).
//!
//! A point is a vertex moved by a translation that its tags name. *Prefix* makes no pair in vain: the tags of each
//! vertex are counted, a prefix sum says which points are a vertex's, and there is a thread for each point. *Product*
//! is the paper's way: a thread for each pair of a vertex and a translation, most of which end without a point. Both
//! give the same points in the same slots.

use std::{array, sync::LazyLock};

use epigraph_core::{
    Access, CpuContext, Extent, Finding, In, Io, Out, Site, Stage, Threads, choice, constants, params,
    scratch,
};
use glam::Vec3;
use rayon::prelude::*;

use crate::{
    column,
    meaning::{POINTS as CLOUD, STREAM_NODES, STREAM_NUMBERS, STREAM_POOLS, STREAM_WORDS},
    shared::{
        cloud::{LIVE, encode_radiance},
        color::decode_srgb,
        octahedral::{NO_NORMAL, decode_oct16},
        scan::SCAN_BLOCKS,
        streams::{Cut, Decoded, NO_ATTRIBUTE, POINTS, POOLS, START_STEP, StreamNode, StreamPool, VERTICES},
        view::dot,
    },
};

#[path = "explain/stream_decode.rs"]
mod explain;

constants! {
    /// The colour of points without one.
    const GREY: f32 = 0.7;
}

choice! {
    /// How the GPU expands pools.
    pub enum Expand {
        /// A thread for each point, which finds its vertex by a prefix sum over the tags.
        Prefix,
        /// A thread for each pair of a vertex and a translation, as in the paper.
        Product,
    }
}

choice! {
    /// What the colour of a point shows.
    pub enum Show {
        /// The point's own colour, a light grey if it has none.
        Color,
        /// How often the node was split from the root on.
        Level,
        /// Which of the node's pools the point is from; grey if it is from none.
        Pool,
    }
}

params! {
    /// Parameters of [`StreamDecode`].
    pub struct StreamDecodeParams {
        /// How the GPU expands pools; the CPU has a single method.
        expand: Expand = Expand::Prefix;
        /// What the colour of a point shows.
        show: Show = Show::Color;
        /// How much of the light comes from the eye, so that surfaces that turn away from it are darker. The rest comes
        /// from all sides. Points without a normal are lit in full.
        light: f32 = 0.8, in 0.0..=1.0;
        /// Slots of the cloud, for each pixel of the image; the same number as that of `stream_cut`.
        points_per_pixel: f32 = 4.0, in 0.01..=256.0, unit "points/pixel";
    }
}

/// See the module.
pub struct StreamDecode {
    words: In<u32>,
    nodes: In<StreamNode>,
    pools: In<StreamPool>,
    starts: In<u32>,
    numbers: In<u32>,
    position: Out<[f32; 4]>,
    radiance: Out<u32>,
    meta: Out<u32>,
    sums: Out<u32>,
}

impl Stage for StreamDecode {
    const KIND: &'static str = "stream_decode";
    const DOC: &'static str = "Decodes the points of a cut through a point set.";
    type Params = StreamDecodeParams;

    fn declare(params: &StreamDecodeParams, io: &mut Io) -> Self {
        io.column(column::P1);
        io.per_view();
        let words = io.read("words", STREAM_WORDS, Extent::Any);
        let nodes = io.read("nodes", STREAM_NODES, Extent::Any);
        let pools = io.read("pools", STREAM_POOLS, Extent::Any);
        let per_pixel = params.points_per_pixel;
        let starts = io.read(
            "starts",
            "The pool of every 256th point.",
            Extent::PerPixel(per_pixel / START_STEP as f32),
        );
        let numbers = io.read("numbers", STREAM_NUMBERS, Extent::Any);
        let doc = "The points: position, RGB9E5 radiance, age and flags.";
        let mut cloud = io.bundle(Access::Write, "cloud", CLOUD.doc(doc), Extent::PerPixel(per_pixel));
        let (position, radiance, meta) =
            (cloud.write("position"), cloud.write("radiance"), cloud.write("meta"));
        let sums = io.write("sums", scratch("The points before each vertex."), Extent::Like("cloud".into()));
        let doc = "The points of each block of vertices.";
        io.write::<u32>("blocks", scratch(doc), Extent::Fixed([SCAN_BLOCKS, 1]));

        io.shader(shader!("stream_decode"));
        io.constants(CONSTANTS);
        io.compute("count", Threads::Groups(SCAN_BLOCKS));
        io.compute("sum", Threads::Groups(SCAN_BLOCKS));
        match params.expand {
            Expand::Prefix => io.dispatch("decode", position),
            Expand::Product => {
                io.dispatch("clear", position);
                io.compute("pairs", Threads::Indirect(numbers.into()));
            }
        }
        Self { words, nodes, pools, starts, numbers, position, radiance, meta, sums }
    }

    fn cpu(&self, params: &StreamDecodeParams, cx: &CpuContext) -> Result<(), String> {
        let (words, nodes) = (&cx.read(self.words)[..], &cx.read(self.nodes)[..]);
        let (pools, numbers) = (&cx.read(self.pools)[..], &cx.read(self.numbers)[..]);
        let starts = &cx.read(self.starts)[..];
        let (position, radiance) = (&mut cx.write(self.position)[..], &mut cx.write(self.radiance)[..]);
        let (meta, sums) = (&mut cx.write(self.meta)[..], &mut cx.write(self.sums)[..]);

        let mut cut = cut(words, nodes, pools, &[], numbers);
        let mut points = 0;
        for (pool, found) in cut.pools.iter().enumerate() {
            for vertex in 0..cut.vertices_of(pool) {
                sums[(found.first_vertex + vertex) as usize] = points;
                points += cut.points_of(found, vertex);
            }
        }
        cut.sums = sums;
        let step = START_STEP as usize;
        let slots = position.par_chunks_mut(step).zip(radiance.par_chunks_mut(step));
        let shade = Shade { params, cut: &cut, forward: cx.frame().view.forward };
        slots.zip(meta.par_chunks_mut(step)).enumerate().for_each(|(chunk, ((position, radiance), meta))| {
            meta.fill(0);
            let start = starts.get(chunk).or(starts.last()).map_or(0, |&pool| pool as usize);
            let first = (chunk * step) as u32;
            let slots = position.iter_mut().zip(radiance).zip(meta).zip(first..);
            for ((((position, radiance), meta), slot), point) in slots.zip(cut.points_from(first, start)) {
                let frame = nodes[pools[point.pool].node as usize].frame();
                let [x, y, z] = frame.center(point.cell).into();
                *position = [x, y, z, 1.0];
                *radiance = encode_radiance(shade.color(&point, slot));
                *meta = LIVE;
            }
        });
        Ok(())
    }

    fn explain(&self, _: &StreamDecodeParams, site: &Site) -> Option<Vec<Finding>> {
        explain::at(self, site)
    }
}

/// The cut of these lists.
fn cut<'a>(
    words: &'a [u32],
    nodes: &'a [StreamNode],
    pools: &'a [StreamPool],
    sums: &'a [u32],
    numbers: &[u32],
) -> Cut<'a> {
    let of = |place: u32| numbers[place as usize];
    let pools = &pools[..of(POOLS) as usize];
    Cut { words, nodes, pools, sums, points: of(POINTS), vertices: of(VERTICES) }
}

/// What decides about the colours of points.
struct Shade<'a> {
    params: &'a StreamDecodeParams,
    cut: &'a Cut<'a>,
    /// The direction of the view.
    forward: [f32; 3],
}

impl Shade<'_> {
    /// The linear colour of the point in a slot.
    fn color(&self, point: &Decoded, slot: u32) -> [f32; 3] {
        let pool = &self.cut.pools[point.pool];
        let node = &self.cut.nodes[pool.node as usize];
        let attribute = |first: u32| {
            (first != NO_ATTRIBUTE).then(|| self.cut.words[(first + slot - node.first_point) as usize])
        };
        let color = match self.params.show {
            Show::Color => attribute(node.colors)
                .map_or([GREY; 3], |color| [0, 8, 16].map(|shift| SRGB[(color >> shift & 255) as usize])),
            Show::Level => hue(node.level),
            Show::Pool if pool.tag_words == 0 => [0.2; 3],
            Show::Pool => hue(8 * node.index + pool.number),
        };
        let light = match attribute(node.normals) {
            None | Some(NO_NORMAL) => 1.0,
            Some(normal) => {
                let normal: [f32; 3] = decode_oct16(normal).into();
                let facing = dot(normal, turned_back(node.rotation, self.forward)).abs();
                let length = dot(normal, normal).sqrt();
                1.0 - self.params.light + self.params.light * facing / length
            }
        };
        color.map(|channel| channel * light)
    }
}

/// A direction in the space of a model that a unit quaternion rotates.
fn turned_back(rotation: [f32; 4], direction: [f32; 3]) -> [f32; 3] {
    let (direction, axis) = (Vec3::from(direction), Vec3::from_slice(&rotation));
    let across = 2.0 * direction.cross(axis);
    (direction + rotation[3] * across + across.cross(axis)).into()
}

/// The linear values of sRGB bytes.
static SRGB: LazyLock<[f32; 256]> =
    LazyLock::new(|| array::from_fn(|byte| decode_srgb(byte as f64 / 255.0) as f32));

/// A colour for a number, far from those of the numbers beside it.
fn hue(number: u32) -> [f32; 3] {
    let bits = (number + 1).wrapping_mul(0x9E37_79B1);
    [24, 16, 8].map(|shift| ((bits >> shift & 255) as f32 + 16.0) / 271.0)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DVec3, Quat};

    use super::*;
    use crate::{
        Pace, World,
        shared::{
            cloud::decode_radiance,
            testing::{Random, run_alike, run_both, settings},
        },
        stream_cut::{StreamCut, StreamCutParams},
    };
    use epigraph_core::{Harness, Host, Outputs, Settings, Side, View, testing::Both};
    use epigraph_scenes::{
        Scene, Tracer,
        streams::{Codec, Model, Place, PointSet, Points, encode, unpack_color, unpack_normal},
    };

    fn harness(params: StreamDecodeParams, size: [u32; 2]) -> Harness<StreamDecode> {
        Harness::new(params, &settings(size, 0))
    }

    /// Figure 4 (b) of the paper in a grid of unit cells, and a point by itself.
    fn figure(expand: Expand) -> Harness<StreamDecode> {
        let at = |x: u32, y: u32, z: u32| x | y << 7 | z << 14;
        let words = [
            [at(0, 0, 0), at(0, 0, 1), at(3, 0, 0), at(3, 0, 1)],
            [at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0)],
            [13, 7, 11, 11],
            [at(9, 8, 7), 0, 0, 0],
        ];
        let node = StreamNode {
            cell: 1.0,
            x: [1.0, 0.0, 0.0],
            y: [0.0, 1.0, 0.0],
            z: [0.0, 0.0, 1.0],
            rotation: [0.0, 0.0, 0.0, 1.0],
            colors: NO_ATTRIBUTE,
            normals: NO_ATTRIBUTE,
            ..StreamNode::default()
        };
        let pool = StreamPool { tag_words: 1, vertices: 4, tags: 8, ..StreamPool::default() };
        let single =
            StreamPool { vertices: 12, first_vertex: 4, first_point: 12, number: 1, ..StreamPool::default() };
        let mut harness = harness(StreamDecodeParams { expand, ..StreamDecodeParams::default() }, [2, 2]);
        harness.set("words", &words.concat());
        harness.set("nodes", &[node]);
        harness.set("pools", &[pool, single]);
        harness.set("starts", &[0u32]);
        harness.set("numbers", &[5u32, 1, 1, 13, 5, 2, 1, 0]);
        harness
    }

    #[test]
    fn the_table_of_the_figure_is_twelve_points() {
        for expand in [Expand::Prefix, Expand::Product] {
            let out = run_alike(&mut figure(expand));
            let points = [
                [0, 0, 0],
                [3, 0, 0],
                [3, 0, 1],
                [1, 0, 0],
                [1, 0, 1],
                [4, 0, 0],
                [1, 1, 0],
                [1, 1, 1],
                [4, 1, 1],
                [0, 1, 0],
                [0, 1, 1],
                [3, 1, 1],
                [9, 8, 7],
            ];
            let expected = points.map(|[x, y, z]| [x, y, z, 0].map(|c: u16| f32::from(c) + 0.5));
            let found = out.get::<[f32; 4]>("cloud.position");
            for (found, expected) in found.iter().zip(expected) {
                assert_eq!((found[..3].to_vec(), found[3]), (expected[..3].to_vec(), 1.0), "{expand:?}");
            }
            let meta = out.get::<u32>("cloud.meta");
            assert_eq!(meta, [[LIVE; 13].as_slice(), &[0; 3]].concat(), "{expand:?}");
        }
    }

    /// Some of a bumpy sphere, with a colour and a normal for each point.
    fn sphere(count: usize, bare: bool) -> Points {
        let mut random = Random(3);
        let directions: Vec<Vec3> = (0..count)
            .map(|_| Vec3::from([0; 3].map(|_| random.between(-1.0, 1.0))).normalize_or(Vec3::X))
            .collect();
        let radius = |d: &Vec3| 1.0 + 0.1 * (7.0 * d.x).sin() * (5.0 * d.y).cos();
        let color = |d: &Vec3| d.to_array().map(|c| (127.0 + 127.0 * c) as u8);
        Points {
            colors: (!bare).then(|| directions.iter().map(color).map(|[r, g, b]| [r, g, b, 255]).collect()),
            normals: (!bare).then(|| directions.clone()),
            ..Points::from(directions.iter().map(|d| *d * radius(d)).collect::<Vec<_>>())
        }
    }

    /// A model of points with these settings.
    fn model(points: &Points, codec: Codec, levels: u32) -> Model {
        let settings = epigraph_scenes::streams::Settings { codec, levels, ..Default::default() };
        encode(points, &settings).unwrap()
    }

    /// Gives the decoder a cut in full detail.
    fn decoder(points: PointSet, params: StreamDecodeParams) -> Harness<StreamDecode> {
        let scene = Arc::new(Scene::of_points("sphere", Arc::new(points)));
        let settings = Settings { facts: World::facts(&scene, false), ..settings([128, 128], 0) };
        let mut cut =
            Harness::<StreamCut>::new(StreamCutParams { cell: 0.05, ..Default::default() }, &settings);
        let view =
            View { eye: [0.1, 0.2, 4.0], tan_x: 0.7, tan_y: 0.7, near: 0.1, far: 10.0, ..View::default() };
        cut.frame.view = view;
        let mut host = Host::default();
        host.insert(World::new(Arc::new(Tracer::new(scene)), Pace::Exact, 1));
        let out = cut.run(Side::Cpu, &crate::registry(), &host, None).unwrap();
        let mut decode = harness(params, [128, 128]);
        decode.frame.view = view;
        for list in ["words", "starts", "numbers"] {
            decode.set(list, &out.get::<u32>(list));
        }
        decode.set("nodes", &out.get::<StreamNode>("nodes"));
        decode.set("pools", &out.get::<StreamPool>("pools"));
        decode
    }

    /// What the nodes in most detail decode to: positions, colours and normals.
    fn expected(model: &Model) -> Vec<([f32; 3], [u8; 4], Vec3)> {
        let of = |node: &epigraph_scenes::streams::Node| {
            let none = u32::MAX;
            let colors = node.colors().map_or(vec![none; node.cell_count()], <[u32]>::to_vec);
            let normals = node.normals().map_or(vec![NO_NORMAL; node.cell_count()], <[u32]>::to_vec);
            let points = node.positions().into_iter().zip(colors).zip(normals);
            points
                .map(|((at, color), normal)| (at.into(), unpack_color(color), unpack_normal(normal)))
                .collect::<Vec<_>>()
        };
        model.leaves().flat_map(of).collect()
    }

    /// Compares both sides. The shader may round a colour to the next step of RGB9E5.
    fn agree(both: Both) -> Outputs {
        both.assert_equal::<u32>("cloud.meta");
        both.assert_equal::<[u32; 4]>("cloud.position");
        let [cpu, gpu] = [&both.cpu, &both.gpu].map(|out| out.get::<u32>("cloud.radiance"));
        let live = both.cpu.get::<u32>("cloud.meta");
        for ((cpu, gpu), _) in cpu.iter().zip(&gpu).zip(live).filter(|(_, meta)| *meta == LIVE) {
            let [cpu, gpu] = [*cpu, *gpu].map(decode_radiance);
            assert!([0, 1, 2].iter().all(|&i| (cpu[i] - gpu[i]).abs() < 1.0 / 250.0), "{cpu:?} {gpu:?}");
        }
        both.cpu
    }

    #[test]
    fn every_codec_and_both_ways_decode_to_the_cells_of_the_model() {
        for (codec, levels, bare, count) in [
            (Codec::Packed, 1, true, 20_000),
            // More vertices than workgroups in a row.
            (Codec::Packed, 1, false, 40_000),
            (Codec::Brick, 3, false, 20_000),
            (Codec::Streams, 2, false, 20_000),
            (Codec::Best, 4, true, 20_000),
            (Codec::Best, 4, false, 20_000),
        ] {
            let points = sphere(count, bare);
            for expand in [Expand::Prefix, Expand::Product] {
                let params = StreamDecodeParams { expand, ..StreamDecodeParams::default() };
                let model = model(&points, codec, levels);
                let mut decoder = decoder(model.clone().into(), params);
                let forward = Vec3::from(decoder.frame.view.forward);
                let out = agree(run_both(&mut decoder));
                let expected = expected(&model);
                let (position, radiance) =
                    (out.get::<[f32; 4]>("cloud.position"), out.get::<u32>("cloud.radiance"));
                let meta = out.get::<u32>("cloud.meta");
                assert_eq!(meta.iter().filter(|&&meta| meta == LIVE).count(), expected.len());
                for (slot, (at, color, normal)) in expected.iter().enumerate() {
                    assert_eq!((position[slot], meta[slot]), ([at[0], at[1], at[2], 1.0], LIVE));
                    let light = if bare { 1.0 } else { 0.2 + 0.8 * normal.dot(forward).abs() };
                    let found = decode_radiance(radiance[slot]);
                    for channel in 0..3 {
                        let linear =
                            if bare { GREY } else { decode_srgb(f64::from(color[channel]) / 255.0) as f32 };
                        assert!(
                            (found[channel] - linear * light).abs() < 1.0 / 500.0,
                            "{slot}: {found:?} {color:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn copies_are_turned_and_moved_and_lit_as_they_are_turned() {
        let model = model(&sphere(2_000, false), Codec::Best, 1);
        let turned = Place {
            model: 0,
            rotation: Quat::from_rotation_x(1.0) * Quat::from_rotation_y(-0.7),
            translation: Vec3::new(0.4, 0.0, -1.0),
        };
        let straight = Place { rotation: Quat::IDENTITY, translation: Vec3::ZERO, ..turned };
        let set = PointSet::new(DVec3::ZERO, vec![model.clone()], vec![straight, turned]);
        let mut decoder = decoder(set, StreamDecodeParams { light: 1.0, ..StreamDecodeParams::default() });
        let forward = Vec3::from(decoder.frame.view.forward);
        let out = agree(run_both(&mut decoder));
        let (position, radiance) = (out.get::<[f32; 4]>("cloud.position"), out.get::<u32>("cloud.radiance"));
        let expected = expected(&model);
        let both =
            [straight, turned].into_iter().flat_map(|place| expected.iter().map(move |of| (place, of)));
        for (slot, (place, (at, color, normal))) in both.enumerate() {
            let distance = place.apply(Vec3::from(*at)).distance(Vec3::from_slice(&position[slot]));
            assert!(distance < 1e-5, "{slot}: {distance}");
            let light = (place.rotation * *normal).dot(forward).abs();
            let red = decode_srgb(f64::from(color[0]) / 255.0) as f32 * light;
            assert!((decode_radiance(radiance[slot])[0] - red).abs() < 1.0 / 500.0, "{slot}");
        }
    }

    #[test]
    fn levels_and_pools_have_colours_of_their_own() {
        let points = sphere(20_000, true);
        for (show, least) in [(Show::Level, 1), (Show::Pool, 8)] {
            let params = StreamDecodeParams { show, ..StreamDecodeParams::default() };
            let out = agree(run_both(&mut decoder(model(&points, Codec::Streams, 4).into(), params)));
            let (radiance, meta) = (out.get::<u32>("cloud.radiance"), out.get::<u32>("cloud.meta"));
            let mut seen: Vec<u32> = radiance
                .into_iter()
                .zip(meta)
                .filter(|(_, meta)| *meta == LIVE)
                .map(|(seen, _)| seen)
                .collect();
            seen.sort_unstable();
            seen.dedup();
            assert!(seen.len() >= least && seen.len() <= 25, "{show:?}: {}", seen.len());
        }
    }

    #[test]
    fn a_cut_without_points_is_an_empty_cloud() {
        for expand in [Expand::Prefix, Expand::Product] {
            let mut harness = figure(expand);
            harness.set("numbers", &[0u32, 0, 1, 0, 0, 0, 0, 0]);
            assert_eq!(run_alike(&mut harness).get::<u32>("cloud.meta"), [0; 16]);
        }
    }
}
