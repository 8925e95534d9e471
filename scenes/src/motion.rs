//! Rigid motion: bodies, their poses, and posed scenes.

use std::ops::Range;

use glam::{Quat, Vec3};

use crate::limits::{is_near, is_time};
use crate::mesh::bounds_of;
use crate::{Light, Scene};

/// Frame rate at which cameras and bodies move.
pub const FRAMES_PER_SECOND: f32 = 30.0;

/// Maximum number of bodies of a scene: points of a cloud store their body in 8 bits, where 0 means static.
pub const MAX_BODIES: usize = 255;

/// A rotation about the origin, then a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The rotation, of unit length.
    pub rotation: Quat,
    /// The translation, metres.
    pub translation: Vec3,
}

impl Pose {
    /// The pose at rest.
    pub const REST: Self = Self { rotation: Quat::IDENTITY, translation: Vec3::ZERO };

    /// Transforms a point.
    pub fn point(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }

    /// Transforms a direction.
    pub fn vector(&self, vector: Vec3) -> Vec3 {
        self.rotation * vector
    }

    /// The inverse transform.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// The composition that applies `first`, then this pose.
    pub fn after(&self, first: &Self) -> Self {
        Self {
            rotation: (self.rotation * first.rotation).normalize(),
            translation: self.point(first.translation),
        }
    }

    fn light(&self, light: &Light) -> Light {
        match *light {
            Light::Point { position, intensity } => {
                Light::Point { position: self.point(position), intensity }
            }
            Light::Spot { position, axis, intensity, cosines } => {
                let [position, axis] = [self.point(position), self.vector(axis).normalize()];
                Light::Spot { position, axis, intensity, cosines }
            }
            Light::Quad { corner, u, v, radiance } => {
                Light::Quad { corner: self.point(corner), u: self.vector(u), v: self.vector(v), radiance }
            }
        }
    }
}

/// The pose of a body at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionKey {
    /// Time in seconds.
    pub time: f32,
    /// Translation, metres.
    pub translate: Vec3,
    /// Rotation about [`Motion::pivot`].
    pub rotate: Quat,
}

/// A path through key poses, a function of the frame index alone, at 30 frames per second.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// The point about which keys rotate, for the body at rest, metres.
    pub pivot: Vec3,
    /// In ascending order of time, at least one.
    pub keys: Vec<MotionKey>,
    /// True if it restarts after the last key; otherwise it stays there.
    pub looped: bool,
}

impl Motion {
    /// The pose of a frame. Between two keys, translations are interpolated linearly and rotations along the shorter
    /// arc.
    pub fn pose(&self, frame: u32) -> Pose {
        let (first, last) = (&self.keys[0], &self.keys[self.keys.len() - 1]);
        // In f64, so that motion stays smooth even after hours of frames.
        let seconds = f64::from(frame) / f64::from(FRAMES_PER_SECOND);
        let [begin, end] = [first.time, last.time].map(f64::from);
        let seconds = if self.looped && end > begin {
            begin + (seconds - begin).rem_euclid(end - begin)
        } else {
            seconds.clamp(begin, end)
        };
        let next = self.keys.partition_point(|key| f64::from(key.time) <= seconds);
        let before = &self.keys[next.saturating_sub(1)];
        let after = self.keys.get(next).unwrap_or(before);
        let interval = f64::from(after.time) - f64::from(before.time);
        let t = if interval > 0.0 { ((seconds - f64::from(before.time)) / interval) as f32 } else { 0.0 };
        let rotation = before.rotate.slerp(after.rotate, t).normalize();
        let translate = before.translate.lerp(after.translate, t);
        Pose { rotation, translation: translate + (self.pivot - rotation * self.pivot) }
    }

    /// Whether there is a key, all numbers are within the limits of a scene, and times ascend.
    pub(crate) fn is_valid(&self) -> bool {
        let is_sane = |key: &MotionKey| is_time(key.time) && is_near(key.translate) && key.rotate.is_finite();
        let ascends = |pair: &[MotionKey]| pair[0].time < pair[1].time;
        let keys = &self.keys;
        !keys.is_empty() && is_near(self.pivot) && keys.iter().all(is_sane) && keys.windows(2).all(ascends)
    }

    /// Returns true if the poses of any two frames differ.
    pub fn moves(&self) -> bool {
        self.keys
            .windows(2)
            .any(|pair| (pair[0].translate, pair[0].rotate) != (pair[1].translate, pair[1].rotate))
    }

    /// A box that contains these points in every frame and at rest.
    pub(crate) fn swept(&self, points: &[Vec3]) -> [Vec3; 2] {
        let [low, high] = bounds_of(points);
        let [from, to] = self
            .keys
            .iter()
            .fold([Vec3::ZERO; 2], |[from, to], key| [from.min(key.translate), to.max(key.translate)]);
        if self.keys.iter().all(|key| key.rotate == Quat::IDENTITY) {
            return [low + from, high + to];
        }
        // A rotation keeps each point's distance from the pivot.
        let radius = points.iter().map(|point| point.distance(self.pivot)).fold(0.0, f32::max);
        [low.min(self.pivot + from - radius), high.max(self.pivot + to + radius)]
    }
}

/// A part of a scene that moves as a rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Its vertices, which no other face uses.
    pub vertices: Range<usize>,
    /// Its triangles.
    pub faces: Range<usize>,
    /// Its edges.
    pub edges: Range<usize>,
    /// Its lights.
    pub lights: Range<usize>,
    /// Its motion.
    pub motion: Motion,
    /// Its geometry at rest.
    pub(crate) rest: Rest,
}

/// The pose-dependent data of a body, at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Rest {
    pub positions: Vec<Vec3>,
    pub face_normals: Vec<Vec3>,
    pub corner_normals: Vec<[Vec3; 3]>,
    pub lights: Vec<Light>,
}

impl Body {
    /// Lowest and highest corner of the box around it at rest (an inverted infinite box if it has no surface).
    pub fn bounds_at_rest(&self) -> [Vec3; 2] {
        bounds_of(&self.rest.positions)
    }
}

impl Scene {
    /// The poses of its bodies in a frame.
    pub fn poses_at(&self, frame: u32) -> Vec<Pose> {
        self.bodies.iter().map(|body| body.motion.pose(frame)).collect()
    }

    /// The scene with its bodies in these poses, one for each body; bodies without a pose stay in place. Static data is
    /// shared; the vertices, normals and lights of bodies whose pose changes are rewritten.
    pub fn posed(&self, poses: &[Pose]) -> Self {
        let mut scene = self.clone();
        for ((body, now), &pose) in self.bodies.iter().zip(&mut scene.poses).zip(poses) {
            if *now == pose {
                continue;
            }
            *now = pose;
            let mesh = &mut scene.mesh;
            let rest = &body.rest;
            set(&mut mesh.positions[body.vertices.clone()], &rest.positions, |&p| pose.point(p));
            set(&mut mesh.face_normals[body.faces.clone()], &rest.face_normals, |&n| pose.vector(n));
            if let Some(normals) = mesh.corner_normals.get_mut(body.faces.clone()) {
                set(normals, &rest.corner_normals, |n| n.map(|n| pose.vector(n)));
            }
        }
        scene.lights = self.posed_lights(&scene.poses);
        scene
    }

    /// The lights with the bodies in these poses, one for each.
    pub fn posed_lights(&self, poses: &[Pose]) -> Vec<Light> {
        let mut lights = self.lights.clone();
        for (body, pose) in self.bodies.iter().zip(poses) {
            set(&mut lights[body.lights.clone()], &body.rest.lights, |light| pose.light(light));
        }
        lights
    }

    /// The body of a triangle, counted from 1; 0 if it is static.
    pub fn body_of_face(&self, face: u32) -> u32 {
        let body = self.bodies.iter().position(|body| body.faces.contains(&(face as usize)));
        // There are at most `MAX_BODIES`.
        body.map_or(0, |body| body as u32 + 1)
    }
}

fn set<T, S>(to: &mut [T], from: &[S], element: impl Fn(&S) -> T) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = element(from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::{MAX_COORDINATE, MAX_TIME};
    use crate::{CREASE_ANGLE, Camera, Material, SceneBuilder, Shape};

    fn key(time: f32, translate: [f32; 3], degrees: f32) -> MotionKey {
        let rotate = Quat::from_rotation_y(degrees.to_radians());
        MotionKey { time, translate: translate.into(), rotate }
    }

    fn motion(looped: bool) -> Motion {
        let keys = vec![key(0.5, [0.0; 3], 0.0), key(1.5, [2.0, 0.0, 0.0], 90.0), key(2.5, [0.0; 3], 0.0)];
        Motion { pivot: Vec3::new(1.0, 5.0, 0.0), keys, looped }
    }

    #[test]
    fn poses_go_from_key_to_key() {
        let motion = motion(false);
        assert_eq!(motion.pose(0), Pose::REST);
        assert_eq!(motion.pose(15), Pose::REST);
        // A quarter turn about (1, y, 0) takes the origin from the -x to the +z side of the pivot; then it is
        // translated.
        assert!(motion.pose(45).point(Vec3::ZERO).distance(Vec3::new(3.0, 0.0, 1.0)) < 1e-6);
        let half = motion.pose(30).point(Vec3::new(1.0, 7.0, 0.0));
        assert!(half.distance(Vec3::new(2.0, 7.0, 0.0)) < 1e-6, "the pivot is only moved: {half}");
        assert_eq!(motion.pose(75), motion.pose(9999));
    }

    #[test]
    fn times_ascend() {
        let mut motion = motion(false);
        assert!(motion.is_valid());
        motion.keys[1].time = motion.keys[0].time;
        assert!(!motion.is_valid());
        motion.keys.clear();
        assert!(!motion.is_valid());
    }

    #[test]
    fn each_number_outside_its_limits_makes_a_motion_invalid() {
        let with = |change: &dyn Fn(&mut Motion)| {
            let mut motion = motion(false);
            change(&mut motion);
            motion.is_valid()
        };
        let far = Vec3::new(0.0, MAX_COORDINATE, 0.0);
        assert!(with(&|motion| (motion.pivot, motion.keys[1].translate) = (far, far)));
        assert!(with(&|motion| motion.keys[2].time = MAX_TIME));
        let (pivot, translate) = (1.01 * far, 1.01 * far);
        assert!(!with(&|motion| motion.pivot = pivot));
        assert!(!with(&|motion| motion.keys[1].translate = translate));
        assert!(!with(&|motion| motion.keys[2].time = 1.01 * MAX_TIME));
        assert!(!with(&|motion| motion.keys[1].rotate.z = f32::NAN));
        assert!(!with(&|motion| motion.keys.swap(0, 1)));
    }

    #[test]
    fn a_loop_repeats() {
        let motion = motion(true);
        for frame in [15, 20, 47, 74] {
            let (now, later) = (motion.pose(frame), motion.pose(frame + 60));
            let distance = |p: Vec3| now.point(p).distance(later.point(p));
            assert!(distance(Vec3::ZERO) < 1e-5 && distance(Vec3::ONE) < 1e-5);
        }
        assert_ne!(motion.pose(15), motion.pose(40));
    }

    #[test]
    fn inverse_and_composition() {
        let motion = motion(false);
        let (one, other) = (motion.pose(33), motion.pose(41));
        let p = Vec3::new(0.3, -2.0, 7.0);
        assert!(one.inverse().point(one.point(p)).distance(p) < 1e-5);
        let step = other.after(&one.inverse());
        assert!(step.point(one.point(p)).distance(other.point(p)) < 1e-5);
    }

    #[test]
    fn swept_boxes_hold_every_frame() {
        let points = [Vec3::ZERO, Vec3::new(0.5, 1.0, -2.0), Vec3::ONE];
        let mut slide = motion(true);
        slide.keys.iter_mut().for_each(|key| key.rotate = Quat::IDENTITY);
        for motion in [motion(true), motion(false), slide] {
            let [low, high] = motion.swept(&points);
            for p in (0..90).flat_map(|frame| points.map(|p| motion.pose(frame).point(p))) {
                assert!(p.cmpge(low - 1e-5).all() && p.cmple(high + 1e-5).all(), "{p}");
            }
        }
    }

    /// A floor, a box that slides along it, a quad light that turns, another box; both boxes and the floor touch.
    fn scene() -> Scene {
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::ONE));
        let floor = Shape::quad([Vec3::ZERO, Vec3::Z, Vec3::X + Vec3::Z, Vec3::X]);
        let cube = Shape::cuboid(Vec3::ZERO, Vec3::ONE);
        builder.add(&floor, material).unwrap();
        builder.moving(motion(false), |b| b.add(&cube, material)).unwrap();
        builder.add(&cube.moved(Vec3::X), material).unwrap();
        builder.moving(motion(true), |b| b.quad_light(Vec3::Y * 4.0, Vec3::X, Vec3::Z, Vec3::ONE)).unwrap();
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        builder.build("test", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap()
    }

    #[test]
    fn bodies_are_complete_and_disjoint() {
        let scene = scene();
        assert_eq!(scene.bodies.len(), 2);
        let Body { vertices, faces, edges, lights, .. } = &scene.bodies[0];
        assert_eq!((vertices.len(), faces.len(), edges.len(), lights.len()), (8, 12, 18, 0));
        assert_eq!(scene.bodies[1].lights, 0..1);
        for body in scene.bodies.iter() {
            for (face, triangle) in scene.mesh.triangles.iter().enumerate() {
                let inside = triangle.map(|vertex| body.vertices.contains(&(vertex as usize)));
                assert_eq!(inside, [body.faces.contains(&face); 3]);
            }
            for (index, edge) in scene.mesh.edges.iter().enumerate() {
                let inside = edge.vertices.map(|vertex| body.vertices.contains(&(vertex as usize)));
                assert_eq!(inside, [body.edges.contains(&index); 2]);
            }
        }
        // 8 + 4 + 2 faces in the order in which they were added, the floor first.
        assert_eq!([0, 2, 13, 14, 26].map(|face| scene.body_of_face(face)), [0, 1, 1, 0, 2]);
    }

    #[test]
    fn a_posed_scene_equals_one_moved_by_hand() {
        let rest = scene();
        let poses = rest.poses_at(45);
        let posed = rest.posed(&poses);
        assert_eq!(posed.poses, poses);
        for (vertex, (&before, &after)) in rest.mesh.positions.iter().zip(&posed.mesh.positions).enumerate() {
            let body = rest.bodies.iter().position(|body| body.vertices.contains(&vertex));
            assert_eq!(after, body.map_or(before, |body| poses[body].point(before)));
        }
        for face in 0..posed.mesh.triangles.len() {
            let [a, b, c] = posed.mesh.corners(face);
            assert!((b - a).cross(c - a).normalize().distance(posed.mesh.face_normals[face]) < 1e-5);
        }
        let (Light::Quad { corner, u, v, .. }, body) = (posed.lights[0], &rest.bodies[1]) else {
            panic!("a quad light")
        };
        for point in [corner, corner + u, corner + v, corner + u + v] {
            let near = |p: &Vec3| p.distance(point) < 1e-5;
            assert!(posed.mesh.positions[body.vertices.clone()].iter().any(near));
        }
        // Posing from another pose gives the same as from rest, also in reverse.
        assert_eq!(
            posed.posed(&rest.poses_at(50)).mesh.positions,
            rest.posed(&rest.poses_at(50)).mesh.positions
        );
        assert_eq!(posed.posed(&[Pose::REST; 2]).lights, rest.lights);
        for point in &posed.mesh.positions {
            assert!(point.cmpge(rest.bounds[0] - 1e-5).all() && point.cmple(rest.bounds[1] + 1e-5).all());
        }
    }

    #[test]
    fn shading_normals_turn_with_their_body() {
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::ONE));
        let ball = Shape::sphere(1.0, 8, 4);
        builder.add(&ball, material).unwrap();
        builder.moving(motion(false), |b| b.add(&ball, material)).unwrap();
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        let rest = builder.build("test", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap();
        let pose = Pose { rotation: Quat::from_rotation_x(0.7), translation: Vec3::Y };
        let posed = rest.posed(&[pose]);
        let half = ball.triangles.len();
        assert_eq!(posed.mesh.corner_normals[..half], rest.mesh.corner_normals[..half]);
        let turned = |normals: &[Vec3; 3]| normals.map(|normal| pose.rotation * normal);
        let expected: Vec<[Vec3; 3]> = rest.mesh.corner_normals[half..].iter().map(turned).collect();
        assert_eq!(posed.mesh.corner_normals[half..], expected);
    }

    #[test]
    fn a_loop_may_start_late() {
        let key = |time: f32, x: f32| MotionKey { time, translate: x * Vec3::X, rotate: Quat::IDENTITY };
        let motion = |begin: f32, end: f32| Motion {
            pivot: Vec3::ZERO,
            keys: vec![key(begin, 0.0), key(end, 8.0)],
            looped: true,
        };
        // At 0, 0.5, 1, 2, 2.5 and 3.5 seconds; it takes two.
        for (frame, x) in [(0, 4.0), (15, 6.0), (30, 0.0), (60, 4.0), (75, 6.0), (105, 2.0)] {
            assert!((motion(1.0, 3.0).pose(frame).translation.x - x).abs() < 1e-5, "frame {frame}");
        }
        // At 0, 0.5, 2 and 5.5 seconds; it takes four.
        for (frame, x) in [(0, 6.0), (15, 7.0), (60, 2.0), (165, 1.0)] {
            assert!((motion(1.0, 5.0).pose(frame).translation.x - x).abs() < 1e-5, "frame {frame}");
        }
    }

    #[test]
    fn the_swept_box_is_that_of_all_keys() {
        let motion = |translate: Vec3, rotate: Quat| {
            let rest = MotionKey { time: 0.0, translate: Vec3::ZERO, rotate: Quat::IDENTITY };
            Motion {
                pivot: Vec3::X,
                keys: vec![rest, MotionKey { time: 1.0, translate, rotate }],
                looped: false,
            }
        };
        let points = [Vec3::new(3.0, 0.0, 0.0), Vec3::new(2.0, 1.0, 0.0)];
        let swept = |translate, rotate| motion(translate, rotate).swept(&points);
        let [x, y] = [Vec3::new(-1.0, 0.0, 0.0), Vec3::new(0.0, 5.0, 0.0)];
        assert_eq!(swept(x, Quat::IDENTITY), [Vec3::new(1.0, 0.0, 0.0), Vec3::new(3.0, 1.0, 0.0)]);
        assert_eq!(swept(y, Quat::IDENTITY), [Vec3::new(2.0, 0.0, 0.0), Vec3::new(3.0, 6.0, 0.0)]);
        // The farthest point is 2 from the pivot.
        let turned = swept(y, Quat::from_rotation_z(1.0));
        assert_eq!(turned, [Vec3::new(-1.0, -2.0, -2.0), Vec3::new(3.0, 7.0, 2.0)]);
        let down = swept(Vec3::new(-4.0, -5.0, -6.0), Quat::from_rotation_z(1.0));
        assert_eq!(down, [Vec3::new(-5.0, -7.0, -8.0), Vec3::new(3.0, 2.0, 2.0)]);
        // A quarter of a metre from it.
        let small = motion(y, Quat::from_rotation_z(1.0)).swept(&[1.25 * Vec3::X]);
        assert_eq!(small, [Vec3::new(0.75, -0.25, -0.25), Vec3::new(1.25, 5.25, 0.25)]);
    }
}
