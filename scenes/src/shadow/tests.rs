use std::sync::Arc;

use super::*;
use crate::{Camera, Light, Material, Rng, Scene, SceneBuilder, Shape};

/// A scene under construction. All coordinates passed to it are multiplied by `scale`.
struct World {
    builder: SceneBuilder,
    scale: f32,
}

impl World {
    fn new(scale: f32) -> Self {
        let mut builder = SceneBuilder::new();
        builder.material(Material::diffuse("", Vec3::ONE));
        Self { builder, scale }
    }

    fn add(&mut self, shape: Shape) {
        let scale = glam::Affine3A::from_scale(Vec3::splat(self.scale));
        self.builder.add(&shape.transformed(scale), 0).unwrap();
    }

    /// Adds a square at height `y` that faces up, with its corners at (x ± half, z ± half).
    fn square(&mut self, y: f32, half: f32, [x, z]: [f32; 2]) {
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
        self.add(Shape::quad(corners.map(|[u, v]| Vec3::new(x + half * u, y, z + half * v))));
    }

    /// Adds a square of two metres at height 1 with a culled back, that faces up or down.
    fn culled_square(&mut self, up: bool) {
        let culled = self.builder.material(Material { culled: true, ..Material::diffuse("", Vec3::ONE) });
        let mut corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
        if !up {
            corners.reverse();
        }
        let quad = Shape::quad(corners.map(|[x, z]| Vec3::new(x, 1.0, z) * self.scale));
        self.builder.add(&quad, culled).unwrap();
    }

    fn point(&mut self, position: [f32; 3]) {
        self.builder.point_light(Vec3::from(position) * self.scale, Vec3::ONE);
    }

    /// Adds a square light at height `y` that shines down, centred on the y axis.
    fn lamp(&mut self, y: f32, half: f32) {
        let [corner, u, v] = [Vec3::new(-half, y, -half), Vec3::X * 2.0 * half, Vec3::Z * 2.0 * half];
        let [corner, u, v] = [corner, u, v].map(|p| p * self.scale);
        self.builder.quad_light(corner, u, v, Vec3::ONE).unwrap();
    }

    fn scene(self) -> Arc<Scene> {
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        Arc::new(self.builder.build("test", camera, Vec3::ZERO, 0.0, 40.0).unwrap())
    }
}

/// Settings with which penumbrae of any width are found.
const WIDE: ShadowSettings =
    ShadowSettings { capacity: 1 << 18, contact: 0.002, max_penumbra: 1.0, effort: 1 << 33 };

fn find(scene: &Arc<Scene>, settings: &ShadowSettings) -> Vec<ShadowSegment> {
    let goes_on = |share| (0.0..1.0).contains(&share);
    let found = shadow_segments(&Tracer::new(scene.clone()), settings, &goes_on).unwrap();
    assert_eq!(found.dropped, 0);
    found.segments
}

fn length(segments: &[ShadowSegment]) -> f32 {
    segments.iter().map(|segment| segment.ends[0].distance(segment.ends[1])).sum()
}

fn of_kind(segments: &[ShadowSegment], kind: ShadowKind) -> Vec<ShadowSegment> {
    segments.iter().filter(|segment| segment.kind == kind).copied().collect()
}

/// Asserts that segments cover the sides of a closed polygon at height `y` exactly once.
#[track_caller]
fn assert_outline(segments: &[ShadowSegment], y: f32, corners: &[[f32; 2]], scale: f32, tolerance: f32) {
    let corner = |i: usize| Vec3::new(corners[i % corners.len()][0], y, corners[i % corners.len()][1]);
    let mut total = 0.0;
    for side in 0..corners.len() {
        let (from, along) = (corner(side), corner(side + 1) - corner(side));
        let on = |p: Vec3| {
            let p = p / scale;
            let t = (p - from).dot(along) / along.length_squared();
            let slack = tolerance / along.length();
            (-slack..1.0 + slack).contains(&t) && p.distance(from + t * along) < tolerance
        };
        let here: Vec<_> = segments.iter().filter(|s| s.ends.iter().all(|&p| on(p))).copied().collect();
        let covered = length(&here) / scale;
        assert!((covered - along.length()).abs() < tolerance, "side {side}: {covered} of {}", along.length());
        total += covered;
    }
    let all = length(segments) / scale;
    assert!((all - total).abs() < tolerance, "{} lie elsewhere", all - total);
}

fn square(half: f32) -> [[f32; 2]; 4] {
    [[-half, -half], [-half, half], [half, half], [half, -half]]
}

#[test]
fn a_point_light_projects_a_square() {
    for scale in [1e-3, 1.0, 1e6] {
        let mut world = World::new(scale);
        // The floor is shifted so that its diagonal crosses the shadow.
        world.square(0.0, 5.0, [0.5, 1.0]);
        world.square(2.0, 1.0, [0.0; 2]);
        world.point([0.0, 4.0, 0.0]);
        let scene = world.scene();
        let segments = find(&scene, &ShadowSettings::default());
        // A point light has no penumbra.
        assert_eq!(segments, find(&scene, &ShadowSettings { max_penumbra: 0.0, ..Default::default() }));
        assert_eq!(segments.len(), 4, "the cuts of the floor's two triangles are not joined");
        assert!(segments.iter().all(|s| s.kind == ShadowKind::Hard && s.penumbra == 0.0));
        assert_outline(&segments, 0.0, &square(2.0), scale, 1e-5);
    }
}

#[test]
fn a_lamp_may_be_turned_any_way() {
    for (scale, seed) in [(1.0, 1), (1.0, 2), (1e3, 3), (1e3, 4)] {
        let mut rng = Rng::new(seed, 0);
        let [x, y, z] = [0; 3].map(|_| 6.0 * rng.next_f32());
        let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, x, y, z);
        let mut world = World::new(scale);
        for (height, half) in [(0.0, 5.0), (2.0, 1.0)] {
            let corners = [[-half, -half], [-half, half], [half, half], [half, -half]];
            world.add(Shape::quad(corners.map(|[x, z]| turn * Vec3::new(x, height, z))));
        }
        let [corner, u, v] = [Vec3::new(-0.5, 4.0, -0.5), Vec3::X, Vec3::Z].map(|p| scale * (turn * p));
        world.builder.quad_light(corner, u, v, Vec3::ONE).unwrap();
        let segments = find(&world.scene(), &WIDE);
        // Squares of 3 and 5 m, as those of `a_lamp_gives_umbra_and_penumbra`.
        for (kind, around) in [(ShadowKind::Umbra, 12.0), (ShadowKind::Penumbra, 20.0)] {
            let found = length(&of_kind(&segments, kind)) / scale;
            assert!((found - around).abs() < 5e-3, "{kind:?}, seed {seed}: {found}");
        }
    }
}

#[test]
fn a_blocker_may_reach_exactly_a_metre_from_the_plane_of_its_shadow() {
    // Straight above each side of a square of a metre, which is twice as large as a shadow.
    for [x, z] in [[0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]] {
        let mut world = World::new(1.0);
        world.square(0.0, 5.0, [0.5, 1.0]);
        world.square(2.0, 0.5, [0.0; 2]);
        world.point([x, 4.0, z]);
        let segments = find(&world.scene(), &ShadowSettings::default());
        assert_outline(&segments, 0.0, &square(1.0).map(|[u, v]| [u - x, v - z]), 1.0, 1e-4);
    }
}

#[test]
fn by_default_a_quarter_of_a_million_segments_are_kept() {
    let ShadowSettings { capacity, contact, max_penumbra, effort } = ShadowSettings::default();
    assert_eq!((capacity, effort), (262_144, 8_589_934_592));
    assert_eq!((contact, max_penumbra), (0.002, 0.02));
}

#[test]
fn vectors_a_billionth_of_a_radian_apart_are_parallel() {
    for (a, b) in [(1.0, 1.0), (1e6, 1e-3), (1e-3, 1e6)] {
        let turned = |angle: f64| across(a * DVec3::X, b * DVec3::new(1.0, angle, 0.0));
        assert_eq!([turned(0.5e-9), turned(-0.5e-9)], [None; 2]);
        assert_eq!([turned(1.5e-9), turned(-1.5e-9)], [Some(DVec3::Z), Some(-DVec3::Z)]);
    }
    assert_eq!([across(DVec3::ZERO, DVec3::X), across(DVec3::X, DVec3::ZERO)], [None; 2]);
}

#[test]
fn the_nearest_receiver_takes_the_shadow() {
    let mut world = World::new(1.0);
    world.square(0.0, 5.0, [0.0; 2]);
    world.square(2.0, 1.0, [0.0; 2]);
    // Above the other square: it receives no shadow, and its own falls on that square and not on the floor.
    world.square(3.0, 0.2, [0.1, 0.0]);
    world.point([0.0, 4.0, 0.0]);
    let segments = find(&world.scene(), &ShadowSettings::default());
    let at = |y: f32| segments.iter().filter(|s| s.ends[0].y == y).copied().collect::<Vec<_>>();
    assert_eq!((at(3.0).len(), at(2.0).len(), at(0.0).len()), (0, 4, 4));
    assert_outline(&at(2.0), 2.0, &square(0.4).map(|[x, z]| [x + 0.2, z]), 1.0, 1e-5);
    assert_outline(&at(0.0), 0.0, &square(2.0), 1.0, 1e-5);
}

#[test]
fn a_shadow_ends_where_another_one_covers_it() {
    let mut world = World::new(1.0);
    world.square(0.0, 9.0, [0.0; 2]);
    // Two blockers at different heights whose shadows have half sides of 2 and centres at x = 0 and x = 3: they overlap
    // for x in 1..2.
    world.square(2.0, 1.0, [0.0; 2]);
    world.square(3.0, 0.5, [0.75, 0.25]);
    world.point([0.0, 4.0, 0.0]);
    let segments = find(&world.scene(), &ShadowSettings::default());
    let floor: Vec<_> = segments.into_iter().filter(|s| s.ends[0].y == 0.0).collect();
    let union = [
        [-2.0, -2.0],
        [-2.0, 2.0],
        [1.0, 2.0],
        [1.0, 3.0],
        [5.0, 3.0],
        [5.0, -1.0],
        [2.0, -1.0],
        [2.0, -2.0],
    ];
    // The ends of boundaries are located to within 1/65,536 of the scene's diagonal.
    assert_outline(&floor, 0.0, &union, 1.0, 2e-3);
}

#[test]
fn a_lamp_gives_umbra_and_penumbra() {
    for scale in [1e-3, 1.0, 1e6] {
        let mut world = World::new(scale);
        world.square(0.0, 5.0, [0.5, 1.0]);
        world.square(2.0, 1.0, [0.0; 2]);
        world.lamp(4.0, 0.5);
        let segments = find(&world.scene(), &WIDE);
        // The ray from a light's end at x = w passes the blocker's edge at x = 1 halfway down, and so meets the floor
        // at x = 1 + (1 - w).
        for (kind, half) in [(ShadowKind::Umbra, 1.5), (ShadowKind::Penumbra, 2.5)] {
            assert_outline(&of_kind(&segments, kind), 0.0, &square(half), scale, 1e-3);
        }
        // The penumbra is 1 wide, rounded up to half octaves of the scene's diagonal.
        assert!(segments.iter().all(|s| (0.999..1.42).contains(&(s.penumbra / scale))));
    }
}

#[test]
fn vertices_of_blockers_meet_edges_of_lights() {
    // A diamond |x| + |z| < 1 halfway between the floor and a square lamp.
    let mut world = World::new(1.0);
    world.square(0.0, 5.0, [0.5, 1.0]);
    let tips = [[0.0, -1.0], [-1.0, 0.0], [0.0, 1.0], [1.0, 0.0]];
    world.add(Shape::quad(tips.map(|[x, z]| Vec3::new(x, 2.0, z))));
    world.lamp(4.0, 0.5);
    let segments = find(&world.scene(), &WIDE);
    // The diamond, enlarged twice, is eroded (umbra) and dilated (penumbra) by the square of the light.
    assert_outline(&of_kind(&segments, ShadowKind::Umbra), 0.0, &tips, 1.0, 1e-3);
    let octagon = [
        [-0.5, -2.5],
        [-2.5, -0.5],
        [-2.5, 0.5],
        [-0.5, 2.5],
        [0.5, 2.5],
        [2.5, 0.5],
        [2.5, -0.5],
        [0.5, -2.5],
    ];
    assert_outline(&of_kind(&segments, ShadowKind::Penumbra), 0.0, &octagon, 1.0, 1e-3);
}

#[test]
fn a_blocker_smaller_than_the_light_has_no_umbra() {
    let mut world = World::new(1.0);
    world.square(0.0, 5.0, [0.0; 2]);
    world.square(2.0, 0.25, [0.0; 2]);
    world.lamp(4.0, 1.0);
    let segments = find(&world.scene(), &WIDE);
    assert_eq!(of_kind(&segments, ShadowKind::Umbra), []);
    assert_outline(&of_kind(&segments, ShadowKind::Penumbra), 0.0, &square(1.5), 1.0, 1e-3);
}

#[test]
fn penumbrae_above_the_maximum_width_are_dropped() {
    let mut world = World::new(1.0);
    world.square(0.0, 5.0, [0.0; 2]);
    world.square(2.0, 1.0, [0.0; 2]);
    world.lamp(4.0, 0.5);
    let scene = world.scene();
    let share = 1.0 / scene.bounds[0].distance(scene.bounds[1]);
    let count = |max_penumbra| find(&scene, &ShadowSettings { max_penumbra, ..WIDE }).len();
    assert_eq!(count(0.99 * share), 0);
    assert!(count(1.01 * share) > 7);
}

#[test]
fn a_box_on_the_floor_has_no_boundaries_along_its_own_edges() {
    let mut world = World::new(1.0);
    world.square(0.0, 6.0, [0.3, 0.7]);
    world.add(Shape::cuboid(Vec3::new(-1.0, 0.0, -1.0), Vec3::ONE));
    world.point([4.0, 3.0, 0.0]);
    let segments = find(&world.scene(), &ShadowSettings::default());
    // The last side of the polygon lies under the box, where it touches the floor: there is no boundary.
    let outline = [[1.0, 1.0], [-0.5, 1.5], [-3.5, 1.5], [-3.5, -1.5], [-0.5, -1.5], [1.0, -1.0]];
    let shadow = |from: [f32; 2], to: [f32; 2]| (to[0] - from[0]).hypot(to[1] - from[1]);
    let expected: f32 = outline.windows(2).map(|side| shadow(side[0], side[1])).sum();
    assert!((length(&segments) - expected).abs() < 2e-3, "{} of {expected}", length(&segments));
    assert_eq!(segments.len(), 5);
    let contact = |s: &ShadowSegment| s.ends.iter().all(|p| p.x > 0.99);
    assert!(!segments.iter().any(contact));
}

#[test]
fn boundaries_begin_at_the_contact_distance() {
    let ground = Shape::quad(square(5.0).map(|[x, z]| Vec3::new(x, 0.0, z)));
    let wall = [[-1.0, 0.0], [1.0, 0.0], [1.0, 0.5], [-1.0, 0.5]];
    let wall = Shape::quad(wall.map(|[z, y]| Vec3::new(0.0, y, z)));
    for (one_object, contact, begin) in
        [(true, 0.1, 0.3), (true, 0.2, 0.6), (false, 0.1, 0.03), (false, 0.5, 0.15), (true, 0.0, 0.0)]
    {
        let mut world = World::new(1.0);
        if one_object {
            world.add(Shape::union([ground.clone(), wall.clone()]));
        } else {
            world.add(ground.clone());
            world.add(wall.clone());
        }
        world.point([-3.0, 2.0, 0.0]);
        let segments = find(&world.scene(), &ShadowSettings { contact, ..ShadowSettings::default() });
        // The light is 3 in front of the wall at x = 0, and the shadow reaches to x = 1, where it is 4/3 as wide.
        let begins = segments.iter().flat_map(|s| s.ends).map(|p| p.x).fold(f32::INFINITY, f32::min);
        assert!((begins - begin).abs() < 1e-3, "{begins}, expected {begin}");
        let expected = 8.0 / 3.0 + 2.0 * (1.0 - begin) * (10f32.sqrt() / 3.0);
        assert!((length(&segments) - expected).abs() < 5e-3, "{} of {expected}", length(&segments));
    }
}

#[test]
fn only_surfaces_that_scatter_light_show_shadows() {
    let diffuse = |color| Material::diffuse("", color);
    let glossy = |color| Material::glossy("", color, 0.5, 0.04);
    for (material, sides) in [
        (diffuse(Vec3::ONE), 4),
        (diffuse(Vec3::X), 4),
        (diffuse(Vec3::ZERO), 0),
        (Material::mirror("", Vec3::ONE), 0),
        (Material::glass("", Vec3::ONE, 1.5), 0),
        (Material::metal("", Vec3::ONE, 0.3), 4),
        (Material { f0: 0.0, ..Material::metal("", Vec3::ONE, 0.3) }, 4),
        (Material { roughness: 0.3, ..Material::glass("", Vec3::ONE, 1.5) }, 4),
        (Material { transmission: 0.5, ..Material::glass("", Vec3::ONE, 1.5) }, 4),
        (Material { transmission: 0.5, ..Material::glass("", Vec3::ZERO, 1.5) }, 0),
        (Material::glossy("", Vec3::ZERO, 0.0, 0.04), 4),
        (Material { unlit: true, ..diffuse(Vec3::ONE) }, 0),
        (glossy(Vec3::ZERO), 4),
        (glossy(Vec3::ONE), 4),
    ] {
        let mut world = World::new(1.0);
        let floor = Shape::quad(square(5.0).map(|[x, z]| Vec3::new(x, 0.0, z)));
        let description = format!("{material:?}");
        let material = world.builder.material(material);
        world.builder.add(&floor, material).unwrap();
        world.square(2.0, 1.0, [0.0; 2]);
        world.point([0.0, 4.0, 0.0]);
        let segments = find(&world.scene(), &ShadowSettings::default());
        assert_eq!(segments.len(), sides, "{description}");
    }
}

#[test]
fn scenes_without_shadows_give_no_segments() {
    let mut world = World::new(1.0);
    world.square(0.0, 5.0, [0.0; 2]);
    assert_eq!(find(&world.scene(), &WIDE), []);
    let mut world = World::new(1.0);
    world.add(Shape::sphere(1.0, 16, 8));
    world.point([3.0, 0.0, 0.0]);
    world.lamp(5.0, 0.5);
    assert_eq!(find(&world.scene(), &WIDE), [], "a convex body cannot cast a shadow on itself");
}

/// Returns true if the segment between two points misses every triangle (Möller and Trumbore 1997, in f64). It uses
/// neither the tracer's hierarchies nor its triangle test.
fn clear(scene: &Scene, from: DVec3, to: DVec3) -> bool {
    let ray = to - from;
    !(0..scene.mesh.triangles.len()).any(|face| {
        let [a, b, c] = scene.mesh.corners(face).map(|p| p.as_dvec3());
        let (u, v) = (b - a, c - a);
        let p = ray.cross(v);
        let inverse = 1.0 / u.dot(p);
        let s = from - a;
        let q = s.cross(u);
        let (x, y, t) = (s.dot(p) * inverse, ray.dot(q) * inverse, v.dot(q) * inverse);
        x >= 0.0 && y >= 0.0 && x + y <= 1.0 && t > 0.0 && t < 1.0
    })
}

/// Two points on either side of a segment's middle, on the receiver and slightly above it, on the side of a light.
fn sides(scene: &Scene, segment: &ShadowSegment, light: DVec3) -> [DVec3; 2] {
    let [a, b] = segment.ends.map(|p| p.as_dvec3());
    let middle = a.midpoint(b);
    let normal = scene.mesh.face_normals[segment.face as usize].as_dvec3();
    let normal = normal * normal.dot(light - middle).signum();
    let across = normal.cross(b - a).normalize();
    let size = f64::from(scene.bounds[0].distance(scene.bounds[1]));
    [-1.0, 1.0].map(|side| middle + across * (side * 2e-4 * size) + normal * (1e-6 * size))
}

/// Balls and boxes in random positions above a floor.
fn heap(seed: u64, scale: f32, light: impl Fn(&mut World, &mut Rng)) -> Arc<Scene> {
    let mut rng = Rng::new(seed, 0);
    let mut world = World::new(scale);
    world.square(0.0, 4.0, [0.0; 2]);
    for i in 0..8 {
        let mut between = |low: f32, high: f32| low + (high - low) * rng.next_f32();
        let place = Vec3::new(between(-1.5, 1.5), between(0.3, 2.2), between(-1.5, 1.5));
        let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, between(0.0, 6.0), between(0.0, 6.0), 1.0);
        let size = between(0.1, 0.3);
        let shape = match i % 2 {
            0 => Shape::sphere(size, 16, 8),
            _ => Shape::cuboid(Vec3::splat(-size), Vec3::splat(size)),
        };
        world.add(shape.transformed(glam::Affine3A::from_rotation_translation(turn, place)));
    }
    light(&mut world, &mut rng);
    world.scene()
}

#[test]
fn exactly_one_side_of_every_hard_boundary_is_lit() {
    for (seed, scale) in [(1, 1.0), (2, 1e-3), (3, 1e6), (4, 1.0), (5, 37.0)] {
        let scene = heap(seed, scale, |world, rng| {
            world.point([4.0 * rng.next_f32() - 2.0, 5.0, 4.0 * rng.next_f32() - 2.0]);
        });
        let Light::Point { position, .. } = scene.lights[0] else { panic!("a point light") };
        let light = position.as_dvec3();
        let segments = find(&scene, &ShadowSettings::default());
        assert!(segments.len() > 100, "{}", segments.len());
        let wrong = segments.iter().filter(|segment| {
            let [one, other] = sides(&scene, segment, light).map(|from| clear(&scene, light, from));
            one == other
        });
        // These rays start ten times farther from the boundary than those of the search, and so miss thin slivers of
        // light or shadow.
        let (wrong, allowed) = (wrong.count(), segments.len() / 50);
        assert!(wrong <= allowed, "{wrong} of {} at seed {seed}", segments.len());
    }
}

#[test]
fn every_change_of_light_has_a_boundary() {
    let (mut changes, mut missed) = (0, 0);
    for seed in [11, 12] {
        let scene = heap(seed, 1.0, |world, _| world.point([0.4, 5.0, -0.3]));
        let light = DVec3::new(0.4f32.into(), 5.0, (-0.3f32).into());
        let segments = find(&scene, &ShadowSettings::default());
        let off_a_boundary = |p: DVec3| {
            segments.iter().all(|segment| {
                let [a, b] = segment.ends.map(|end| end.as_dvec3());
                let t = ((p - a).dot(b - a) / a.distance_squared(b)).clamp(0.0, 1.0);
                p.distance(a.lerp(b, t)) > 1e-4
            })
        };
        let lit = |x: f64, z: f64| clear(&scene, light, DVec3::new(x, 1e-6, z));
        for line in 0..60 {
            let z = 2.0 * (f64::from(line) + 0.37) / 60.0 * 2.0 - 2.0;
            let place = |step: i32| 4.0 * f64::from(step) / 400.0 - 2.0;
            for step in 0..400 {
                let (mut here, mut there) = (place(step), place(step + 1));
                if lit(here, z) == lit(there, z) {
                    continue;
                }
                for _ in 0..20 {
                    let middle = 0.5 * (here + there);
                    if lit(middle, z) == lit(here, z) { here = middle } else { there = middle }
                }
                changes += 1;
                missed += usize::from(off_a_boundary(DVec3::new(here, 0.0, z)));
            }
        }
    }
    // Where outlines cross, the search does not locate the ends of short segments: it keeps or drops them whole.
    assert!(changes > 150 && missed <= changes / 100, "{missed} of {changes}");
}

#[test]
fn an_umbra_sees_no_part_of_a_lamp_and_unshadowed_points_see_all_of_it() {
    let mut counts = [0; 2];
    for seed in [1, 2] {
        let scene = heap(seed, 1.0, |world, _| world.lamp(5.0, 0.15));
        let Light::Quad { corner, u, v, .. } = scene.lights[0] else { panic!("a quad light") };
        let [corner, u, v] = [corner, u, v].map(|p| p.as_dvec3());
        let mut wrong = 0;
        let segments = find(&scene, &WIDE);
        for segment in &segments {
            let shares = sides(&scene, segment, corner).map(|from| {
                // The rays end just below the lamp, as its own triangles would block them.
                let place =
                    |i: i32| corner + u * (f64::from(i % 8) + 0.5) / 8.0 + v * (f64::from(i / 8) + 0.5) / 8.0;
                (0..64).filter(|&i| clear(&scene, from, place(i) - DVec3::Y * 1e-6)).count()
            });
            let (umbra, all) = (shares.contains(&0), shares.contains(&64));
            counts[usize::from(segment.kind == ShadowKind::Penumbra)] += 1;
            wrong += usize::from(if segment.kind == ShadowKind::Umbra { !umbra } else { !all });
        }
        // The search tests five points of the lamp, this test 64.
        assert!(wrong <= segments.len() / 100, "{wrong} of {} at seed {seed}", segments.len());
    }
    assert!(counts.iter().all(|&count| count > 100), "{counts:?}");
}

#[test]
fn the_boxes_of_cornell_have_closed_penumbrae() {
    let scene = Arc::new(Scene::load("cornell").unwrap());
    let segments = find(&scene, &WIDE);
    for kind in [ShadowKind::Umbra, ShadowKind::Penumbra] {
        let kind = of_kind(&segments, kind);
        // Faces 0 to 9 are the walls, 10 to 33 the boxes, and the last two the light.
        assert!(!kind.is_empty() && kind.iter().all(|s| scene.mesh.edges[s.edge as usize].faces[0] >= 10));
        // The ends at which no other segment begins: where a boundary meets a box, reaches the open front of the room,
        // or enters another shadow.
        let ends: Vec<Vec3> = kind.iter().flat_map(|s| s.ends).collect();
        let lonely = |p: &&Vec3| ends.iter().filter(|q| q.distance(**p) < 2e-3).count() == 1;
        let lonely = ends.iter().filter(lonely).count();
        assert!(lonely <= 12, "{lonely} of {} ends are open", ends.len());
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let scene = heap(7, 1.0, |world, _| world.lamp(5.0, 0.1));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| find(&scene, &WIDE))
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn beyond_the_capacity_the_longest_segments_are_kept_in_order() {
    let scene = heap(8, 1.0, |world, _| world.point([0.0, 5.0, 0.0]));
    let all = find(&scene, &ShadowSettings::default());
    let capacity = all.len() / 3;
    let settings = ShadowSettings { capacity, ..ShadowSettings::default() };
    let some = shadow_segments(&Tracer::new(scene), &settings, &|_| true).unwrap();
    assert_eq!((some.segments.len(), some.dropped), (capacity, all.len() - capacity));
    let mut rest = all.iter();
    assert!(some.segments.iter().all(|kept| rest.any(|segment| segment == kept)), "the order changed");
    let mut lengths: Vec<f32> = all.iter().map(|&s| length(&[s])).collect();
    lengths.sort_by(f32::total_cmp);
    let shortest = some.segments.iter().map(|&s| length(&[s])).fold(f32::INFINITY, f32::min);
    assert!(shortest >= lengths[all.len() - capacity]);
}

#[test]
fn a_cancelled_search_returns_nothing() {
    let scene = heap(9, 1.0, |world, _| world.lamp(5.0, 0.1));
    assert_eq!(shadow_segments(&Tracer::new(scene), &WIDE, &|share| !(0.0..1.0).contains(&share)), None);
}

#[test]
fn a_culled_back_casts_no_shadow() {
    for (up, corners) in [(true, &[][..]), (false, &[[-2.0, -2.0], [-2.0, 2.0], [2.0, 2.0], [2.0, -2.0]])] {
        let mut world = World::new(1.0);
        world.square(0.0, 5.0, [0.0, 0.0]);
        world.culled_square(up);
        world.point([0.0, 2.0, 0.0]);
        let segments = find(&world.scene(), &WIDE);
        if corners.is_empty() {
            assert_eq!(segments, []);
        } else {
            assert_outline(&segments, 0.0, corners, 1.0, 1e-3);
        }
    }
}
