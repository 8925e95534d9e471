//! Encoding and decoding as a whole.

use std::{
    collections::{BTreeMap, BTreeSet},
    ops::ControlFlow,
    sync::Mutex,
};

use glam::{DVec3, Quat, Vec3};

use crate::{
    file::block,
    testing::{Random, colored, scan},
    *,
};

/// Points of all kinds: scans, clouds, lines, planes, lattices, heaps of equal points; some far from the origin.
fn sets() -> Vec<Vec<Vec3>> {
    let mut random = Random(11);
    let mut sets = vec![scan(3000, 1), scan(20_000, 2), vec![Vec3::ONE], vec![Vec3::ZERO; 9]];
    for round in 0..30 {
        let flat = [Vec3::ONE, Vec3::new(1.0, 1.0, 0.0), Vec3::X, Vec3::new(1.0, 0.01, 0.001)][round % 4];
        let lattice = [0.0, 1.0 / 16.0, 1.0 / 5.0][round % 3];
        let count = 1 + random.below(1500) as usize;
        let turn = Quat::from_euler(glam::EulerRot::XYZ, random.unit() * 6.0, random.unit() * 6.0, 1.0);
        let move_by = Vec3::splat([0.0, 1000.0][round % 2]);
        let mut point = || {
            let at = Vec3::from([0; 3].map(|_| random.unit()));
            let at = if lattice > 0.0 { (at / lattice).round() * lattice } else { at };
            turn * (at * flat) + move_by
        };
        sets.push((0..count).map(|_| point()).collect());
    }
    sets
}

/// The cells of a frame that contain points, with the indices of these, found without the encoder.
fn occupied(frame: &Frame, points: &[Vec3]) -> BTreeMap<Cell, Vec<usize>> {
    let mut cells: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for (index, point) in points.iter().enumerate() {
        let at = frame.coordinates(*point).map(|along| (along.floor() as i32).clamp(0, GRID as i32 - 1));
        cells.entry(Cell::new(at).unwrap()).or_default().push(index);
    }
    cells
}

const CODECS: [Codec; 4] = [Codec::Packed, Codec::Brick, Codec::Streams, Codec::Best];

#[test]
fn each_occupied_cell_is_decoded_once() {
    for (index, points) in sets().into_iter().enumerate() {
        let points = Points::from(points);
        for (pools, translations) in [(0, 96), (1, 88), (2, 96), (5, 128), (3, 7)] {
            let settings = Settings { levels: 4, pools, translations, ..Settings::default() };
            let models = CODECS.map(|codec| encode(&points, &Settings { codec, ..settings }).unwrap());
            let expected: Vec<Cell> =
                occupied(models[0].nodes()[0].frame(), &points.positions).into_keys().collect();
            for (codec, model) in CODECS.iter().zip(&models) {
                assert_eq!(Model::from_bytes(&model.to_bytes()).as_ref(), Ok(model));
                let root = &model.nodes()[0];
                let mut cells = root.cells();
                cells.sort();
                assert_eq!(cells, expected, "set {index}, {codec:?}, {settings:?}");
                assert_eq!(root.points(), points.positions.len());
                assert_eq!(root.merged(), points.positions.len() - expected.len());
                for node in model.nodes() {
                    let unique: BTreeSet<Cell> = node.cells().into_iter().collect();
                    assert_eq!(unique.len(), node.cell_count());
                }
                let leaves: usize = model.leaves().map(Node::points).sum();
                assert_eq!(leaves, points.positions.len());
            }
            let [packed, bricks, streams, best] = &models;
            for index in 0..packed.nodes().len() {
                let of = |model: &Model| block(&model.nodes()[index]).len();
                let smallest = of(packed).min(of(bricks)).min(of(streams));
                assert!(of(best) <= smallest, "{} {smallest}", of(best));
                let same = |a: &Model| {
                    let (a, b) = (&a.nodes()[index], &packed.nodes()[index]);
                    let sorted = |node: &Node| BTreeSet::from_iter(node.cells());
                    a.frame() == b.frame() && a.children() == b.children() && sorted(a) == sorted(b)
                };
                assert!(same(bricks) && same(streams) && same(best));
            }
            assert!(packed.nodes().iter().all(|node| node.pools().is_empty()));
            assert!(bricks.nodes().iter().all(|node| node.singles().is_empty()));
            for node in streams.nodes() {
                assert!(node.pools().len() <= pools);
                assert!(node.pools().iter().all(|pool| pool.translations().len() <= translations));
                assert!(Layout::PACKED.node(node) <= Layout::PACKED.points(node.cell_count()));
            }
        }
    }
}

#[test]
fn colours_and_normals_follow_their_cells() {
    let given = colored(scan(20_000, 2));
    for codec in CODECS {
        // The hierarchy has changed the order of the points.
        let model = encode(&given, &Settings { codec, levels: 4, ..Settings::default() }).unwrap();
        for node in model.nodes() {
            assert_eq!(node.colors().map(<[u32]>::len), Some(node.cell_count()));
            assert_eq!(node.normals().map(<[u32]>::len), Some(node.cell_count()));
        }
        let root = &model.nodes()[0];
        let points_of = occupied(root.frame(), &given.positions);
        let mut alone = 0;
        for (index, cell) in root.cells().iter().enumerate() {
            let [point] = points_of[cell][..] else { continue };
            alone += 1;
            assert_eq!(unpack_color(root.colors().unwrap()[index]), given.colors.as_ref().unwrap()[point]);
            let normal = given.positions[point].normalize();
            assert!(unpack_normal(root.normals().unwrap()[index]).angle_between(normal) < 1e-3);
        }
        assert!(alone > 8000, "{alone}");
    }
    // Four points in one cell, and one far away.
    let corners = [[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.1, 0.1]];
    let positions = corners.iter().map(|[x, y]| Vec3::new(*x, *y, 0.0)).chain([Vec3::splat(1000.0)]);
    let points = Points {
        colors: Some(vec![[0; 4], [0; 4], [255; 4], [255; 4], [1, 2, 3, 4]]),
        normals: Some(vec![Vec3::X, 9.0 * Vec3::X, Vec3::Y, Vec3::ZERO, Vec3::NAN]),
        ..Points::from(positions.collect::<Vec<_>>())
    };
    let model = encode(&points, &Settings { levels: 1, ..Settings::default() }).unwrap();
    let root = &model.nodes()[0];
    let mut colors: Vec<_> = root.colors().unwrap().iter().map(|word| unpack_color(*word)).collect();
    colors.sort();
    assert_eq!(colors, [[1, 2, 3, 4], [188, 188, 188, 128]]);
    let mut normals: Vec<_> = root.normals().unwrap().iter().map(|word| unpack_normal(*word)).collect();
    normals.sort_by_key(|normal| *normal != Vec3::ZERO);
    assert_eq!(normals[0], Vec3::ZERO);
    assert!(normals[1].abs_diff_eq(Vec3::new(2.0, 1.0, 0.0).normalize(), 1e-4), "{}", normals[1]);
}

/// Half a cell along each axis, and what single precision loses far from the origin.
#[test]
fn decoded_points_are_within_half_a_cell() {
    for (index, points) in sets().into_iter().enumerate() {
        let model = encode(&points.clone().into(), &Settings::default()).unwrap();
        let decoded: Vec<(&Frame, Vec3)> = model
            .leaves()
            .flat_map(|leaf| leaf.positions().into_iter().map(|at| (leaf.frame(), at)))
            .collect();
        for point in points.iter().step_by(37) {
            let rounding = 4.0 * f32::EPSILON * (point.abs().max_element() + 1.0);
            let near = decoded.iter().any(|(frame, at)| {
                let offset = *at - *point;
                frame.axes.iter().all(|axis| axis.dot(offset).abs() <= 0.5 * frame.cell + rounding)
            });
            assert!(near, "set {index}: {point}");
        }
        // The other way round, for the root: no decoded point is far from all points.
        let root = &model.nodes()[0];
        let reach = 0.5 * 3_f32.sqrt() * root.frame().cell + 1e-3;
        for at in root.positions().iter().step_by(53) {
            assert!(points.iter().any(|point| point.distance(*at) <= reach), "set {index}: {at}");
        }
    }
}

#[test]
fn the_number_of_cores_does_not_matter() {
    let with = |threads, points: &[Vec3], settings| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let points = colored(points.to_vec());
        pool.install(|| encode(&points, &settings)).unwrap().to_bytes()
    };
    // Several blocks of the sums, whose order could matter; then transforms and pools.
    let many = scan(3 * frame::BLOCK, 4);
    let settings = Settings { levels: 3, pools: 0, palette: 1, ..Settings::default() };
    assert!(with(1, &many, settings) == with(5, &many, settings));
    let points = &many[..30_000];
    let settings = Settings { levels: 3, ..Settings::default() };
    assert!(with(1, points, settings) == with(5, points, settings));
}

#[test]
fn what_cannot_be_encoded_says_why() {
    let error =
        |points: &[Vec3], settings| encode(&points.to_vec().into(), &settings).unwrap_err().to_string();
    let default = Settings::default();
    assert_eq!(error(&[], default), "there are no points to encode");
    assert_eq!(
        error(&[Vec3::ONE, Vec3::new(0.0, f32::NAN, 0.0)], default),
        "point 1 is at [0, NaN, 0]; coordinates must be numbers of at most 1e30"
    );
    assert_eq!(
        error(&[Vec3::splat(-2e30)], default),
        "point 0 is at [-2000000000000000000000000000000, -2000000000000000000000000000000, \
         -2000000000000000000000000000000]; coordinates must be numbers of at most 1e30"
    );
    let points = [Vec3::ONE];
    let fails = |points: Points| encode(&points, &default).unwrap_err().to_string();
    let one = Points::from(vec![Vec3::ONE]);
    let colors = Some(vec![[0; 4]; 2]);
    assert_eq!(fails(Points { colors, ..one.clone() }), "1 points have 2 colors");
    assert_eq!(fails(Points { normals: Some(vec![]), ..one.clone() }), "1 points have 0 normals");
    assert_eq!(
        fails(Points { origin: DVec3::INFINITY, ..one }),
        "the origin is at [inf, inf, inf]; coordinates must be numbers"
    );
    let setting = |settings| error(&points, settings);
    assert_eq!(setting(Settings { levels: 0, ..default }), "levels must be 1 to 24, not 0");
    assert_eq!(setting(Settings { pools: 65, ..default }), "pools must be 0 to 64, not 65");
    assert_eq!(setting(Settings { translations: 129, ..default }), "translations must be 1 to 128, not 129");
    assert_eq!(setting(Settings { palette: 0, ..default }), "palette must be 1 to 65536, not 0");
    assert_eq!(setting(Settings { threshold: f64::NAN, ..default }), "threshold must be 0 to 1, not NaN");
}

#[test]
fn the_largest_and_the_smallest_points_are_encoded() {
    for scale in [1e30, 1e-30] {
        let points = scan(500, 5).into_iter().map(|point| point / 2.0 * scale).collect::<Vec<_>>();
        let model = encode(&points.into(), &Settings::default()).unwrap();
        assert!(model.nodes().iter().all(|node| node.positions().iter().all(|at| at.is_finite())));
        assert!(model.nodes()[0].cell_count() > 400);
    }
}

#[test]
fn encoding_tells_how_far_it_is_and_stops_when_asked() {
    let points = scan(2000, 6).into();
    let settings = Settings { levels: 3, ..Settings::default() };
    let seen = Mutex::new(Vec::new());
    let watch = |step: Step, part: f64| {
        seen.lock().unwrap().push((step, part));
        ControlFlow::Continue(())
    };
    encode_watched(&points, &settings, &watch).unwrap();
    let seen = seen.into_inner().unwrap();
    for step in [Step::Divide, Step::Store] {
        let parts: Vec<f64> = seen.iter().filter(|(of, _)| *of == step).map(|(_, part)| *part).collect();
        assert!(parts.contains(&0.0) && parts.contains(&1.0) && parts.len() > 6, "{step:?}: {parts:?}");
        assert!(parts.iter().all(|part| (0.0..=1.0).contains(part)), "{step:?}: {parts:?}");
    }
    assert!(seen.is_sorted_by_key(|(step, _)| *step));
    for at in [(Step::Divide, 0.0), (Step::Divide, 0.3), (Step::Store, 0.2), (Step::Store, 1.0)] {
        let watch =
            |step, part| if (step, part) >= at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        assert_eq!(encode_watched(&points, &settings, &watch), Err(EncodeError::Stopped), "{at:?}");
    }
}

#[test]
fn the_nodes_of_a_level_hold_all_points() {
    // A point far away is a leaf of the second level.
    let points = Points::from([scan(500, 1), vec![Vec3::splat(90.0)]].concat());
    let model = encode(&points, &Settings { levels: 4, ..Settings::default() }).unwrap();
    assert_eq!(model.levels(), 4);
    for (level, count) in (1..=5).zip([1, 2, 3, 5, 5]) {
        let nodes: Vec<&Node> = model.level(level).collect();
        assert_eq!(nodes.len(), count, "{level}");
        assert_eq!(nodes.iter().map(|node| node.points()).sum::<usize>(), 501);
    }
    assert!(model.level(4).eq(model.leaves()));
}
