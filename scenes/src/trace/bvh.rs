//! Finds the triangles that rays hit, with eight-wide bounding volume hierarchies (obvhs). Coordinates are scaled to a
//! common size, and the triangle test is watertight: no ray slips through a shared edge.
//!
//! Static geometry has one hierarchy. Each body has its own, of its triangles at rest, and its pose transforms rays to
//! it. So no hierarchy is rebuilt when bodies move.

use std::{sync::Arc, time::Duration};

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x8};
use glam::{DVec3, UVec2, Vec3, Vec3A, Vec4, Vec4Swizzles};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::cwbvh::{CwBvh, node::CwBvhNode};
use obvhs::ray::Ray;
use obvhs::traverse;

use crate::boxes::make_unlike;
use crate::{Mesh, Pose, Scene};

/// The largest coordinate is scaled to [2^29, 2^30), so that what is small is large compared to the tolerance of obvhs,
/// which is absolute: it skips what rays leave within a distance of 1e-4. Volumes times distances are within f32.
const SCALED_EXPONENT: i32 = 30;

/// obvhs's tolerance.
const NEAREST: f32 = 1e-4;

/// Boxes are enlarged by this much on each side, in scaled units. It exceeds the rounding error of the slab test, so
/// that rays along a box's face are not lost.
const PAD: f32 = (1 << (SCALED_EXPONENT - 20)) as f32;

/// Distances of less than this share of those to a triangle's corners are computed in f64; the error of f32 is a few times
/// 1e-7 of those.
const CLOSE: f32 = 2e-6;

/// No close distance is larger, in scaled units: nothing in the scene is farther from a point in it than four times its
/// largest coordinate.
const CLOSE_AT_MOST: f32 = CLOSE * (4_u64 << SCALED_EXPONENT) as f32;

/// The hit of a ray with the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Intersection {
    /// Index into `Mesh::triangles`.
    pub face: u32,
    /// Barycentric weights of the triangle's corners, sum 1.
    pub weights: Vec3,
}

/// A triangle's corners in scaled coordinates: one lane for each corner, so that what is computed for each takes one
/// instruction. The fourth lane is 0.
#[derive(Clone, Copy)]
struct Triangle {
    x: Vec4,
    y: Vec4,
    z: Vec4,
}

/// What a ray's intersection with a triangle follows from.
struct Spanned {
    /// The signed volumes that the ray's line spans with each edge (Plücker coordinates).
    volumes: Vec3A,
    /// The distances of the corners along the ray.
    along: Vec3A,
}

impl Spanned {
    fn sum(&self) -> f32 {
        self.volumes.x + self.volumes.y + self.volumes.z
    }

    /// The barycentric weights of the corners.
    fn weights(&self) -> Vec3 {
        Vec3::from(self.volumes) / self.sum()
    }
}

impl Triangle {
    fn new([a, b, c]: [Vec3A; 3]) -> Self {
        let lanes = |of: fn(Vec3A) -> f32| Vec4::new(of(a), of(b), of(c), 0.0);
        Self { x: lanes(|p| p.x), y: lanes(|p| p.y), z: lanes(|p| p.z) }
    }

    fn corners(&self) -> [Vec3A; 3] {
        [0, 1, 2].map(|corner| Vec3A::new(self.x[corner], self.y[corner], self.z[corner]))
    }

    /// The volumes have the same sign if and only if the line intersects the triangle, and each is proportional to the
    /// weight of the opposite corner. Both triangles at an edge compute exactly opposite values for it, so that a ray never
    /// misses both.
    #[inline(always)]
    fn spanned(&self, ray: &Ray) -> Spanned {
        let [x, y, z] = [self.x - ray.origin.x, self.y - ray.origin.y, self.z - ray.origin.z];
        let Vec3 { x: dx, y: dy, z: dz } = ray.direction.into();
        // From one end of each corner's opposite edge to the other, and their sum.
        let edge = |of: Vec4| (of.zxyw() - of.yzxw(), of.zxyw() + of.yzxw());
        let ((ex, sx), (ey, sy), (ez, sz)) = (edge(x), edge(y), edge(z));
        let [nx, ny, nz] = [ey * sz - sy * ez, ez * sx - sz * ex, ex * sy - sx * ey];
        let dot = |x: Vec4, y: Vec4, z: Vec4| Vec3A::from_vec4(x * dx + y * dy + z * dz);
        Spanned { volumes: dot(nx, ny, nz), along: dot(x, y, z) }
    }

    /// Distance along the ray, infinite for a miss, and of triangles that do not `count` at the hit's weights. It is
    /// interpolated between the corners' distances, so that the hit lies in the triangle even if the ray is nearly
    /// parallel to it.
    #[inline(always)]
    fn intersect(&self, ray: &Ray, count: impl Fn(Vec3) -> bool) -> f32 {
        let spanned = self.spanned(ray);
        let Spanned { volumes, along } = spanned;
        if volumes.min_element() < 0.0 && volumes.max_element() > 0.0 {
            return f32::INFINITY;
        }
        let mut t = volumes.dot(along) / spanned.sum();
        // A triangle may be far larger than the distance at which rays start off it.
        if t.abs() < CLOSE_AT_MOST && t.abs() < CLOSE * along.abs().max_element() {
            t = self.close_distance(ray);
        }
        // A degenerate triangle gives 0/0, which fails the comparison.
        let is_hit = t > ray.tmin && t <= ray.tmax && count(spanned.weights());
        if is_hit { t } else { f32::INFINITY }
    }

    /// The distance in f64.
    #[cold]
    fn close_distance(&self, ray: &Ray) -> f32 {
        let origin = ray.origin.as_dvec3();
        let direction = ray.direction.as_dvec3();
        let [a, b, c] = self.corners().map(|corner| corner.as_dvec3() - origin);
        let volume = |p: DVec3, q: DVec3| (q - p).cross(q + p).dot(direction);
        let v = DVec3::new(volume(b, c), volume(c, a), volume(a, b));
        // Rounding in f32 may have let in a ray that passes just outside.
        let v = (v * v.element_sum().signum()).max(DVec3::ZERO);
        let along = DVec3::new(a.dot(direction), b.dot(direction), c.dot(direction));
        (v.dot(along) / v.element_sum()) as f32
    }
}

/// The hierarchies of a scene, those of the bodies in their present poses.
#[derive(Clone)]
pub(super) struct Bvhs {
    still: Arc<Bvh>,
    bodies: Vec<(Arc<Bvh>, Pose)>,
}

impl Bvhs {
    /// Builds the hierarchies, which takes about a second for a million triangles.
    pub fn new(scene: &Scene) -> Self {
        let mesh = &scene.mesh;
        let largest = mesh.positions.iter().map(|p| p.abs().max_element()).fold(0.0, f32::max);
        let moving = scene.bodies.iter().flat_map(|_| scene.bounds);
        let scale = power_of_two_scale(moving.map(|p| p.abs().max_element()).fold(largest, f32::max));
        let mut moves = vec![false; mesh.triangles.len()];
        let bodies = scene.bodies.iter().map(|body| {
            moves[body.faces.clone()].fill(true);
            let first = body.vertices.start;
            let position = |vertex: u32| body.rest.positions[vertex as usize - first];
            let faces = body.faces.clone().map(|face| face as u32).collect();
            (Arc::new(Bvh::new(mesh, faces, position, scale)), Pose::REST)
        });
        let bodies = bodies.collect();
        let still = (0..mesh.triangles.len() as u32).filter(|&face| !moves[face as usize]).collect();
        let still = Arc::new(Bvh::new(mesh, still, |vertex| mesh.positions[vertex as usize], scale));
        Self { still, bodies }.posed(&scene.poses)
    }

    /// The same hierarchies with the bodies in other poses.
    pub fn posed(&self, poses: &[Pose]) -> Self {
        let bodies = self.bodies.iter().zip(poses);
        // Transforms rays from the world to the body.
        let bodies = bodies.map(|((bvh, _), pose)| (bvh.clone(), pose.inverse())).collect();
        Self { still: self.still.clone(), bodies }
    }

    /// The nearest triangle along the ray, `start` metres from its origin or farther, that counts at the point that the
    /// ray hits; `direction` is of unit length.
    pub fn closest(
        &self,
        origin: Vec3,
        direction: Vec3,
        start: f32,
        counts: impl Fn(Intersection) -> bool,
    ) -> Option<Intersection> {
        let start = start * self.still.scale;
        let mut nearest = self.still.closest(origin, direction, [start, f32::INFINITY], &counts);
        for (bvh, pose) in &self.bodies {
            let limit = nearest.map_or(f32::INFINITY, |(distance, _)| distance);
            let nearer = bvh.closest(pose.point(origin), pose.vector(direction), [start, limit], &counts);
            nearest = nearer.or(nearest);
        }
        nearest.map(|(_, intersection)| intersection)
    }

    /// Returns true if nothing that counts lies between two points. `spend` is called before each test of a triangle; once
    /// it returns false, the search ends as if the triangle were in the way.
    pub fn visible(
        &self,
        from: Vec3,
        to: Vec3,
        counts: impl Fn(Intersection) -> bool,
        spend: impl Fn() -> bool,
    ) -> bool {
        let (direction, distance) = (to - from).normalize_and_length();
        self.still.visible(from, direction, distance, &counts, &spend)
            && self.bodies.iter().all(|(bvh, pose)| {
                bvh.visible(pose.point(from), pose.vector(direction), distance, &counts, &spend)
            })
    }
}

/// The children of a node whose boxes a ray meets before its end, as [`CwBvhNode::intersect_ray`] gives them, to the same bit.
/// Eight boxes at a time.
#[inline(always)]
fn children_met<S: Simd>(simd: S, node: &CwBvhNode, ray: &Ray, oct_inv4: u32) -> u32 {
    let scale = (node.compute_extent() * ray.inv_direction).to_array();
    let start = ((Vec3A::from(node.p) - ray.origin) * ray.inv_direction).to_array();
    let low = [&node.child_min_x, &node.child_min_y, &node.child_min_z];
    let high = [&node.child_max_x, &node.child_max_y, &node.child_max_z];
    let direction = ray.direction.to_array();
    // Where the ray passes the planes of an axis on which it enters the boxes, or leaves them.
    let passes = |axis: usize, enters: bool| {
        let planes = if (direction[axis] < 0.0) == enters { high[axis] } else { low[axis] };
        let planes: f32x8<S> = planes.map(f32::from).simd_into(simd);
        planes * scale[axis] + start[axis]
    };
    let nearest = f32x8::splat(simd, NEAREST);
    let enters = passes(0, true).max(passes(1, true)).max(passes(2, true)).max(nearest);
    let leaves =
        passes(0, false).min(passes(1, false)).min(passes(2, false)).min(f32x8::splat(simd, ray.tmax));
    let mut met = enters.simd_le(leaves).to_bitmask();
    let (bits, places) = node.get_child_and_index_bits(oct_inv4);
    let mut children = 0;
    while met != 0 {
        let shift = 8 * met.trailing_zeros();
        children |= (bits >> shift & 0xFF) << (places >> shift & 0xFF);
        met &= met - 1;
    }
    children as u32
}

/// A hierarchy and its triangles.
struct Bvh {
    nodes: CwBvh,
    /// In the order of the hierarchy's leaves.
    triangles: Vec<Triangle>,
    /// World to scaled coordinates: a power of two, so that scaling is exact.
    scale: f32,
    /// The vector instructions to use. Results do not depend on them.
    level: Level,
}

impl Bvh {
    /// Builds the hierarchy of some faces.
    fn new(mesh: &Mesh, faces: Vec<u32>, position: impl Fn(u32) -> Vec3, scale: f32) -> Self {
        let scaled =
            |&face: &u32| mesh.triangles[face as usize].map(|vertex| Vec3A::from(position(vertex)) * scale);
        let mut boxes: Vec<Aabb> = faces.iter().map(|face| padded_box(scaled(face))).collect();
        make_unlike(&mut boxes, PAD);
        let mut nodes = build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Duration::default());
        drop(boxes);
        nodes.primitive_indices.iter_mut().for_each(|index| *index = faces[*index as usize]);
        let triangles = nodes.primitive_indices.iter().map(|face| Triangle::new(scaled(face))).collect();
        Self { nodes, triangles, scale, level: Level::new() }
    }

    /// The nearest triangle along the ray within a range of distances, with its distance. All distances are in scaled
    /// units; `direction` is of unit length.
    fn closest(
        &self,
        origin: Vec3,
        direction: Vec3,
        range: [f32; 2],
        counts: impl Fn(Intersection) -> bool,
    ) -> Option<(f32, Intersection)> {
        let ray = self.ray(origin, direction, range);
        let (distance, leaf) = dispatch!(self.level, simd => self.nearest_leaf(simd, ray, &counts))?;
        let (face, triangle) = (self.nodes.primitive_indices[leaf], &self.triangles[leaf]);
        Some((distance, Intersection { face, weights: triangle.spanned(&ray).weights() }))
    }

    /// The nearest triangle, by its place among the leaves, with its distance.
    #[inline(always)]
    fn nearest_leaf<S: Simd>(
        &self,
        simd: S,
        mut ray: Ray,
        counts: impl Fn(Intersection) -> bool,
    ) -> Option<(f32, usize)> {
        let mut state = self.nodes.new_traversal(ray.direction);
        let (mut node, mut nearest);
        nearest = None;
        traverse!(self.nodes, node, state, children_met(simd, node, &ray, state.oct_inv4), {
            let leaf = state.primitive_id as usize;
            let distance = self.intersect(&ray, leaf, &counts);
            if distance < ray.tmax {
                ray.tmax = distance;
                nearest = Some((distance, leaf));
            }
        });
        nearest
    }

    /// Returns true if nothing that counts lies within `distance` metres along the ray; `direction` is of unit length.
    fn visible(
        &self,
        from: Vec3,
        direction: Vec3,
        distance: f32,
        counts: impl Fn(Intersection) -> bool,
        spend: impl Fn() -> bool,
    ) -> bool {
        let ray = self.ray(from, direction, [0.0, distance * self.scale]);
        dispatch!(self.level, simd => !self.is_blocked(simd, &ray, &counts, &spend))
    }

    /// Whether a triangle that counts lies along the ray, or `spend` returns false.
    #[inline(always)]
    fn is_blocked<S: Simd>(
        &self,
        simd: S,
        ray: &Ray,
        counts: impl Fn(Intersection) -> bool,
        spend: impl Fn() -> bool,
    ) -> bool {
        let mut state = self.nodes.new_traversal(ray.direction);
        let mut node;
        traverse!(self.nodes, node, state, children_met(simd, node, ray, state.oct_inv4), {
            if !spend() || self.intersect(ray, state.primitive_id as usize, &counts) < ray.tmax {
                return true;
            }
        });
        false
    }

    #[inline(always)]
    fn intersect(&self, ray: &Ray, leaf: usize, counts: impl Fn(Intersection) -> bool) -> f32 {
        let face = self.nodes.primitive_indices[leaf];
        self.triangles[leaf].intersect(ray, |weights| counts(Intersection { face, weights }))
    }

    fn ray(&self, origin: Vec3, direction: Vec3, [start, end]: [f32; 2]) -> Ray {
        // Adding zero turns -0 into +0: obvhs treats the sign of a zero direction inconsistently.
        let direction = Vec3A::from(direction) + Vec3A::ZERO;
        Ray::new(Vec3A::from(origin) * self.scale, direction, start, end)
    }
}

/// The power of two that brings `largest` to [2^29, 2^30).
fn power_of_two_scale(largest: f32) -> f32 {
    if largest.is_normal() {
        let exponent = largest.log2().floor() as i32 + 1;
        2f32.powi((SCALED_EXPONENT - exponent).clamp(-126, 126))
    } else {
        1.0
    }
}

fn padded_box([a, b, c]: [Vec3A; 3]) -> Aabb {
    Aabb::new(a.min(b).min(c) - Vec3A::splat(PAD), a.max(b).max(c) + Vec3A::splat(PAD))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CREASE_ANGLE, Camera, Material, SceneBuilder, Shape};

    #[test]
    fn eight_boxes_at_a_time_are_met_as_one_by_one() {
        let mut rng = super::super::Rng::new(5, 1);
        let mut near = |reach: f32| Vec3A::from_array([0; 3].map(|_| reach * (2.0 * rng.next_f32() - 1.0)));
        let boxes: Vec<Aabb> = (0..200)
            .map(|_| {
                let (center, half) = (near(1e9), near(3e8).abs());
                Aabb::new(center - half, center + half)
            })
            .collect();
        let nodes = build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Duration::default()).nodes;
        let mut met = 0;
        for turn in 0..400 {
            let (origin, mut direction) = (near(1e9), near(1.0).normalize());
            // Along an axis, and in its plane.
            match turn % 8 {
                0 => direction = Vec3A::AXES[turn / 8 % 3] * direction.x.signum(),
                1 => direction[turn / 8 % 3] = 0.0,
                _ => (),
            }
            let end = if turn % 3 == 0 { f32::INFINITY } else { 1e9 };
            let ray = Ray::new(origin, direction, 0.0, end);
            for node in &nodes {
                for oct_inv4 in [0, 0x0505_0505, 0x0707_0707] {
                    let plain = node.intersect_ray(&ray, oct_inv4);
                    for level in [Level::new(), Level::baseline()] {
                        let found = dispatch!(level, simd => children_met(simd, node, &ray, oct_inv4));
                        assert_eq!(found, plain, "{level:?}, {ray:?}");
                    }
                    met += plain.count_ones();
                }
            }
        }
        assert!(met > 10_000, "{met}");
    }

    #[test]
    fn the_largest_coordinate_is_scaled_to_one_binade() {
        for largest in [1e-20, 0.75, 0.999, 1.0, 1.001, 555.0, 1e9] {
            let (scale, range) = (power_of_two_scale(largest), 2f32.powi(29)..2f32.powi(30));
            assert!(range.contains(&(largest * scale)) && scale.log2().fract() == 0.0, "{largest}: {scale}");
        }
        assert_eq!([0.0, f32::INFINITY, f32::NAN].map(power_of_two_scale), [1.0; 3]);
        for side in [1e-6, 555.0] {
            let mut builder = SceneBuilder::new();
            let material = builder.material(Material::diffuse("", Vec3::ONE));
            builder.add(&Shape::cuboid(Vec3::ZERO, side * Vec3::ONE), material).unwrap();
            let camera = Camera::look_at(Vec3::X, Vec3::ZERO, 1.0, 0.1, 10.0);
            let scene = builder.build("", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap();
            assert_eq!(Bvhs::new(&scene).still.scale, power_of_two_scale(side));
        }
    }

    #[test]
    fn a_body_is_where_its_pose_puts_it_and_nowhere_else() {
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::ONE));
        let cube = Shape::cuboid(-0.5 * Vec3::ONE, 0.5 * Vec3::ONE);
        builder.add(&cube.moved(9.0 * Vec3::X), material).unwrap();
        let key = crate::MotionKey { time: 0.0, translate: Vec3::ZERO, rotate: glam::Quat::IDENTITY };
        let motion = crate::Motion { pivot: Vec3::ZERO, keys: vec![key], looped: false };
        builder.moving(motion, |builder| builder.add(&cube, material)).unwrap();
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        let scene = builder.build("", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap();
        let rest = Bvhs::new(&scene);
        let pose = Pose { translation: 4.0 * Vec3::X, ..Pose::REST };
        // Hierarchies of a scene at rest that is posed, and of a posed scene.
        let found = [rest.posed(&[pose]), Bvhs::new(&scene.posed(&[pose])), rest].map(|bvhs| {
            [0.0, 4.0, 9.0].map(|x| {
                let from = Vec3::new(x, 0.1, 5.0);
                let hit = bvhs.closest(from, Vec3::NEG_Z, 0.0, |_| true);
                let blocked = !bvhs.visible(from, from - 9.0 * Vec3::Z, |_| true, || true);
                assert_eq!(hit.is_some(), blocked);
                blocked
            })
        });
        assert_eq!(found, [[false, true, true], [false, true, true], [true, false, true]]);
    }

    #[test]
    fn a_row_of_equal_boxes_is_traced() {
        let mut builder = SceneBuilder::new();
        let material = builder.material(Material::diffuse("", Vec3::ONE));
        let cube = Shape::cuboid(Vec3::ZERO, Vec3::ONE);
        for copy in 0..40_000_u16 {
            builder.add(&cube.moved(2.0 * f32::from(copy) * Vec3::Z), material).unwrap();
        }
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, 1.0, 0.1, 10.0);
        let scene = builder.build("row", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap();
        // Half a second; a minute if each pass joined one pair.
        let bvhs = Bvhs::new(&scene);
        let hit = bvhs.closest(Vec3::new(0.5, 0.5, -1.0), Vec3::Z, 0.0, |_| true).unwrap();
        assert!(scene.mesh.corners(hit.face as usize).iter().all(|corner| corner.z == 0.0));
    }
}
