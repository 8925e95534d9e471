use glam::{Affine3A, Quat};

use super::*;
use crate::{Camera, Material, Motion, MotionKey, Rng, SceneBuilder, Shape, shadow_segments};

/// Wider penumbrae than by default, so that there are more boundaries.
const SETTINGS: ShadowSettings =
    ShadowSettings { capacity: 1 << 18, contact: 0.002, max_penumbra: 0.2, effort: 1 << 33 };

fn builder() -> SceneBuilder {
    let mut builder = SceneBuilder::new();
    builder.material(Material::diffuse("", Vec3::ONE));
    builder
}

fn built(builder: SceneBuilder) -> Tracer {
    let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
    Tracer::new(Arc::new(builder.build("test", camera, Vec3::ZERO, 0.0, 40.0).unwrap()))
}

/// A motion that makes a body movable. The tests set its poses themselves.
fn motion() -> Motion {
    let key = MotionKey { time: 0.0, translate: Vec3::ZERO, rotate: Quat::IDENTITY };
    Motion { pivot: Vec3::ZERO, keys: vec![key], looped: false }
}

fn shift(x: f32, y: f32, z: f32) -> Pose {
    Pose { translation: Vec3::new(x, y, z), ..Pose::REST }
}

fn floor() -> Shape {
    Shape::cuboid(Vec3::new(-6.0, -0.2, -6.0), Vec3::new(6.0, 0.0, 6.0))
}

fn cube(center: [f32; 3], half: f32) -> Shape {
    Shape::cuboid(Vec3::splat(-half), Vec3::splat(half)).moved(center.into())
}

/// A floor, nine boxes of which every third one can move, a static point light, a static lamp, and a lamp that can
/// move.
fn random_scene(rng: &mut Rng) -> Tracer {
    let mut builder = builder();
    builder.add(&floor(), 0).unwrap();
    let mut between = |low: f32, high: f32| low + (high - low) * rng.next_f32();
    for index in 0..9 {
        let place = Vec3::new(between(-2.5, 2.5), between(0.3, 2.0), between(-2.5, 2.5));
        let turn = Quat::from_euler(glam::EulerRot::XYZ, between(0.0, 6.0), between(0.0, 6.0), 1.0);
        let size = Vec3::new(between(0.1, 0.4), between(0.1, 0.4), between(0.1, 0.6));
        let shape = Shape::cuboid(-size, size).transformed(Affine3A::from_rotation_translation(turn, place));
        if index % 3 == 0 {
            builder.moving(motion(), |builder| builder.add(&shape, 0)).unwrap();
        } else {
            builder.add(&shape, 0).unwrap();
        }
    }
    builder.point_light(Vec3::new(between(-2.0, 2.0), 5.0, between(-2.0, 2.0)), Vec3::ONE);
    let corner = Vec3::new(between(-2.0, 2.0), 4.5, between(-2.0, 2.0));
    builder.quad_light(corner, 0.3 * Vec3::X, 0.2 * Vec3::Z, Vec3::ONE).unwrap();
    let lamp = Vec3::new(between(-2.0, 2.0), 4.0, between(-2.0, 2.0));
    builder.moving(motion(), |b| b.quad_light(lamp, 0.2 * Vec3::X, 0.3 * Vec3::Z, Vec3::ONE)).unwrap();
    built(builder)
}

/// `boxes` boxes in one place, above a floor and below a lamp.
fn crowd(boxes: usize) -> Tracer {
    let mut builder = builder();
    builder.add(&floor(), 0).unwrap();
    for _ in 0..boxes {
        builder.add(&cube([0.0, 1.0, 0.0], 0.3), 0).unwrap();
    }
    builder.quad_light(Vec3::new(-0.1, 5.0, -0.1), 0.2 * Vec3::X, 0.2 * Vec3::Z, Vec3::ONE).unwrap();
    built(builder)
}

#[test]
fn where_too_much_lies_in_one_place_the_rest_is_left_out_and_counted() {
    let tracer = crowd(200);
    let search =
        |effort| shadow_segments(&tracer, &ShadowSettings { effort, ..SETTINGS }, &|_| true).unwrap();
    let all = search(SETTINGS.effort);
    assert_eq!((all.incomplete, all.dropped), (0, 0));
    assert!(all.segments.len() >= 200 * 4);
    let some = search(1 << 22);
    // Each box has eight edges that some corners of the lamp see as outlines, and the floor has four.
    assert!(some.incomplete > 200, "{}", some.incomplete);
    assert!(some.segments.len() < all.segments.len());
    // What is found is right.
    assert!(some.segments.iter().all(|segment| all.segments.contains(segment)));
    // Events that cost little are searched in full.
    assert!(search(1 << 28).incomplete == 0);
}

#[test]
fn a_scene_without_edges_takes_no_effort() {
    let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
    let mut scene = Scene::empty("", camera, [Vec3::ZERO, Vec3::ONE]);
    scene.lights.push(Light::Point { position: Vec3::Y, intensity: Vec3::ONE });
    let settings = ShadowSettings { effort: 1, ..SETTINGS };
    let found = shadow_segments(&Tracer::new(Arc::new(scene)), &settings, &|_| true).unwrap();
    assert_eq!(found, ShadowSegments::default());
}

#[test]
fn an_incremental_search_equals_a_full_one_to_the_bit() {
    let (mut work, mut changes) = (ShadowWork::default(), 0);
    for seed in 0..6 {
        let mut rng = Rng::new(seed, 0);
        let mut tracer = random_scene(&mut rng);
        let mut search = ShadowSearch::new(SETTINGS);
        let mut last = search.find(&tracer, &|_| true).unwrap();
        for _ in 0..8 {
            let mut poses = tracer.scene().poses.clone();
            for pose in &mut poses {
                // Half of the bodies do not move, a quarter move a little and a quarter move far.
                let size = [0.0, 0.0, 0.1, 2.0][(rng.next_f32() * 4.0) as usize];
                let mut between = || size * (2.0 * rng.next_f32() - 1.0);
                let turn = Quat::from_euler(glam::EulerRot::XYZ, between(), between(), between());
                let step = Vec3::new(between(), 0.3 * between(), between());
                *pose = Pose { rotation: turn, translation: step }.after(pose);
            }
            tracer = tracer.posed(&poses);
            let now = search.find(&tracer, &|_| true).unwrap();
            let from_nothing = shadow_segments(&Tracer::new(tracer.scene().clone()), &SETTINGS, &|_| true);
            assert_eq!(Some(&now), from_nothing.as_ref(), "seed {seed}");
            assert!(now.segments.len() > 50);
            let ShadowWork { own, touched, kept } = search.work();
            work =
                ShadowWork { own: work.own + own, touched: work.touched + touched, kept: work.kept + kept };
            changes += usize::from(now != last);
            last = now;
        }
    }
    // The test is only meaningful if there are enough events of each kind.
    assert!(
        changes > 20 && work.own > 1000 && work.touched > 1000 && work.kept > 1000,
        "{changes}, {work:?}"
    );
}

#[test]
fn a_body_far_from_everything_searches_its_own_events_only() {
    let mut builder = builder();
    builder.add(&floor(), 0).unwrap();
    builder.add(&cube([0.0, 1.0, 0.0], 0.3), 0).unwrap();
    builder.add(&cube([0.5, 2.0, 0.4], 0.2), 0).unwrap();
    builder.moving(motion(), |builder| builder.add(&cube([0.0, 1.0, 0.0], 0.2), 0)).unwrap();
    builder.point_light(Vec3::new(0.0, 5.0, 0.0), Vec3::ONE);
    builder.quad_light(Vec3::new(0.37, 4.0, 0.13), 0.2 * Vec3::X, 0.2 * Vec3::Z, Vec3::ONE).unwrap();
    let tracer = built(builder);
    let mut search = ShadowSearch::new(SETTINGS);
    search.find(&tracer.posed(&[shift(4.5, -0.7, 4.5)]), &|_| true).unwrap();
    let all = search.work();
    assert!(all.own > 20 && all.touched + all.kept == 0, "{all:?}");

    let there = tracer.posed(&[shift(4.6, -0.6, 4.5)]);
    let found = search.find(&there, &|_| true).unwrap();
    let ShadowWork { own, touched, kept } = search.work();
    assert!(own > 0 && own < all.own / 2 && touched == 0 && kept > 10, "{:?}", search.work());
    // The result includes the shadow of the moved body.
    let body = &there.scene().bodies[0].edges;
    assert!(found.segments.iter().any(|segment| body.contains(&(segment.edge as usize))));

    // The body moves between the light and the other objects, and out again.
    for pose in [shift(0.2, 1.8, 0.2), shift(4.6, -0.6, 4.5)] {
        search.find(&tracer.posed(&[pose]), &|_| true).unwrap();
        assert!(search.work().touched > 5, "{:?}", search.work());
    }
    // If nothing has moved, nothing is searched.
    let ShadowWork { own, touched, kept } = search.work();
    search.find(&tracer.posed(&[shift(4.6, -0.6, 4.5)]), &|_| true).unwrap();
    assert_eq!(search.work(), ShadowWork { own: 0, touched: 0, kept: own + touched + kept });
}

#[test]
fn a_light_that_moves_searches_its_own_events_only() {
    let mut builder = builder();
    builder.add(&floor(), 0).unwrap();
    builder.add(&cube([0.0, 1.0, 0.0], 0.3), 0).unwrap();
    builder.point_light(Vec3::new(1.0, 5.0, 0.0), Vec3::ONE);
    let light = Vec3::new(-1.0, 4.0, 0.0);
    let moving = |b: &mut SceneBuilder| {
        b.point_light(light, Vec3::ONE);
        Ok::<_, crate::MeshError>(())
    };
    builder.moving(motion(), moving).unwrap();
    let tracer = built(builder);
    let mut search = ShadowSearch::new(SETTINGS);
    let before = search.find(&tracer, &|_| true).unwrap().segments;
    let moved = tracer.posed(&[shift(0.0, 0.5, 0.3)]);
    let after = search.find(&moved, &|_| true).unwrap().segments;
    let ShadowWork { own, touched, kept } = search.work();
    assert!(own > 0 && touched == 0 && kept > 0, "{:?}", search.work());
    // Segments are ordered by light: those of the first light are unchanged.
    let same = before.iter().zip(&after).take_while(|(a, b)| a == b).count();
    assert!(same > 0 && same < after.len());
    assert_eq!(after, shadow_segments(&moved, &SETTINGS, &|_| true).unwrap().segments);
}

#[test]
fn after_an_interruption_the_next_search_is_a_full_one() {
    let mut rng = Rng::new(77, 0);
    let tracer = random_scene(&mut rng);
    let mut search = ShadowSearch::new(SETTINGS);
    search.find(&tracer, &|_| true).unwrap();
    let moved = tracer.posed(&vec![shift(0.3, 0.0, 0.1); tracer.scene().bodies.len()]);
    assert_eq!(search.find(&moved, &|_| false), None);
    let found = search.find(&tracer, &|_| true).unwrap();
    assert_eq!(found, shadow_segments(&tracer, &SETTINGS, &|_| true).unwrap());
}

#[test]
fn another_scene_is_searched_in_full() {
    let mut rng = Rng::new(5, 0);
    let (one, other) = (random_scene(&mut rng), random_scene(&mut rng));
    let mut search = ShadowSearch::new(SETTINGS);
    search.find(&one, &|_| true).unwrap();
    assert_eq!(search.find(&other, &|_| true), shadow_segments(&other, &SETTINGS, &|_| true));
}

#[test]
fn in_a_usual_scene_each_event_may_take_ample_effort() {
    // With the floor 9 and 65 boxes: 162 and 1,170 edges. In the first scene all are measured, in the second 1,024, and in
    // the third 341 for each of three lights, and each counts for three.
    for (boxes, lights, count, times) in [(8, 1, 162, 1), (64, 1, 1024, 1), (64, 3, 341, 3)] {
        let mut builder = builder();
        for place in 0..boxes {
            let [x, z] = [place % 8, place / 8].map(|step| 0.8 * step as f32 - 2.8);
            builder.add(&cube([x, 1.0, z], 0.2), 0).unwrap();
        }
        builder.add(&floor(), 0).unwrap();
        for light in 0..lights {
            builder.point_light(Vec3::new(0.3 * light as f32, 5.0, 0.1), Vec3::ONE);
        }
        let tracer = built(builder);
        let scene = tracer.scene();
        let edges = scene.mesh.edges.len();
        let known = |effort| Known::new(&tracer, &ShadowSettings { effort, ..SETTINGS });
        let all = known(SETTINGS.effort);
        let blockers = Blockers::new(&scene.mesh, &all.around, all.reach);
        let mut spent = 0;
        for light in &scene.lights {
            let source = Source::new(light).unwrap();
            let finder = Finder::new(&tracer, &all.receivers, &source, &SETTINGS, all.reach);
            let facing = blockers.facing(&source, 0..scene.mesh.triangles.len());
            for event in
                (0..count).flat_map(|nth| blockers.edge_events(&source, &facing, nth * edges / count))
            {
                spent += times * (AMPLE - finder.find(&event, AMPLE, &mut Vec::new()));
            }
        }
        let shared = |effort: u64| effort / (lights * edges) as u64;
        assert!(
            edges / count == times as usize && spent > 10_000 && shared(spent) < AMPLE,
            "{edges}, {spent}"
        );
        assert_eq!([known(spent), known(spent + 1)].map(|known| known.effort), [AMPLE; 2]);
        assert_eq!(known(spent - 1).effort, shared(spent - 1));
        assert_eq!(all.effort, shared(SETTINGS.effort));
        assert!(all.effort > AMPLE);
    }
}

#[test]
fn long_segments_with_narrow_penumbrae_matter_most() {
    let segment = |length: f32, penumbra: f32| {
        let ends = [Vec3::ZERO, length * Vec3::Y];
        ShadowSegment { ends, kind: crate::ShadowKind::Umbra, penumbra, edge: 0, face: 0 }
    };
    // In a scene of 10 m, the penumbra counts from 0.01 m on: 100, 80, 90 and 90.9 of their length.
    let all = [segment(1.0, 0.0), segment(2.0, 0.015), segment(0.9, 0.0), segment(10.0, 0.1)];
    for (capacity, expected) in
        [(0, &[][..]), (1, &[0]), (2, &[0, 3]), (3, &[0, 2, 3]), (4, &[0, 1, 2, 3]), (9, &[0, 1, 2, 3])]
    {
        let mut kept = all.to_vec();
        keep_important(&mut kept, capacity, 10.0);
        assert_eq!(kept, expected.iter().map(|&index: &usize| all[index]).collect::<Vec<_>>(), "{capacity}");
    }
}

#[test]
fn the_reach_is_the_largest_coordinate_in_any_frame() {
    let reach = |still: Vec3, moved: Vec3| {
        let mut builder = builder();
        builder.add(&cube([0.0; 3], 3.0), 0).unwrap();
        builder.point_light(still, Vec3::ONE);
        let key = |time: f32, translate: Vec3| MotionKey { time, translate, rotate: Quat::IDENTITY };
        let motion =
            Motion { pivot: Vec3::ZERO, keys: vec![key(0.0, Vec3::ZERO), key(1.0, moved)], looped: false };
        let light = |builder: &mut SceneBuilder| {
            builder.point_light(Vec3::Y, Vec3::ONE);
            Ok::<_, crate::MeshError>(())
        };
        builder.moving(motion, light).unwrap();
        reach_of(built(builder).scene())
    };
    assert_eq!(reach(Vec3::ZERO, Vec3::ZERO), 3.0);
    assert_eq!(reach(-70.0 * Vec3::X, Vec3::ZERO), 70.0);
    assert_eq!(reach(Vec3::ZERO, -90.0 * Vec3::Y), 89.0);
}

#[test]
fn progress_is_the_share_that_is_done() {
    let shares = std::sync::Mutex::new(Vec::new());
    let progress = |share: f32| {
        shares.lock().unwrap().push(share);
        true
    };
    let work = Work::new(4096, &progress);
    assert!((0..4096).all(|_| work.step()));
    assert_eq!(*shares.lock().unwrap(), [0.0, 0.25, 0.5, 0.75]);
}

#[test]
fn a_flat_body_searches_what_it_shadows() {
    let mut builder = builder();
    builder.add(&floor(), 0).unwrap();
    builder.add(&cube([0.5, 1.0, 0.0], 0.3), 0).unwrap();
    // Squares across each axis, at rest far from all rays.
    for axis in 0..3 {
        let [u, v] = [1, 2].map(|next| 0.5 * Vec3::AXES[(axis + next) % 3]);
        let square = Shape::quad([-u - v, u - v, u + v, v - u]);
        builder.moving(motion(), |builder| builder.add(&square, 0)).unwrap();
    }
    builder.point_light(Vec3::new(0.0, 5.0, 0.0), Vec3::ONE);
    let tracer = built(builder);
    let away = [shift(5.0, 0.6, 5.0), shift(-5.0, 0.6, 5.0), shift(5.0, 0.6, -5.0)];
    for body in 0..3 {
        let mut search = ShadowSearch::new(SETTINGS);
        search.find(&tracer.posed(&away), &|_| true).unwrap();
        let mut poses = away;
        // Between the light and the cube.
        poses[body] = shift(0.3, 2.5, 0.1);
        let moved = tracer.posed(&poses);
        assert_eq!(search.find(&moved, &|_| true), shadow_segments(&moved, &SETTINGS, &|_| true), "{body}");
        assert!(search.work().touched > 0, "{body}");
    }
}
