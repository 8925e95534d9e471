//! The scene's triangles under an eight-wide bounding volume hierarchy (obvhs), in coordinates scaled to a common
//! size, with a triangle test that lets no ray slip through a shared edge.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray, RayHit};

use crate::Mesh;

/// The largest coordinate is scaled to [2^9, 2^10): the hierarchy's own tolerances are absolute (1e-4), so that
/// the scene has to be large against them.
const SCALED_EXPONENT: i32 = 10;

/// Boxes grow by this much on each side, in scaled units: more than the rounding of the slab test, so that a ray
/// along a box's face is not lost.
const PAD: f32 = 1.0 / 1024.0;

/// Where a ray meets the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Intersection {
    /// Index into `Mesh::triangles`.
    pub face: u32,
    /// Barycentric weights of the triangle's corners, sum 1.
    pub weights: Vec3,
}

/// A triangle's corners in scaled coordinates.
#[derive(Clone, Copy)]
struct Triangle([Vec3A; 3]);

impl Triangle {
    /// The signed volumes that the ray's line spans with each edge (Plücker coordinates): all of one sign exactly
    /// where the line passes inside, and proportional to the weight of the opposite corner. An edge's value from
    /// one side is bitwise the negative of that from the other, so that neighbours never both miss.
    #[inline(always)]
    fn volumes(&self, ray: &Ray) -> ([Vec3A; 3], Vec3) {
        let [a, b, c] = self.0.map(|corner| corner - ray.origin);
        let volume = |p: Vec3A, q: Vec3A| (q - p).cross(q + p).dot(ray.direction);
        ([a, b, c], Vec3::new(volume(b, c), volume(c, a), volume(a, b)))
    }

    /// Distance along the ray, infinite for a miss. Interpolated between the corners' distances, so that a
    /// triangle seen edge-on still gives a point of itself.
    #[inline(always)]
    fn intersect(&self, ray: &Ray) -> f32 {
        let (corners, v) = self.volumes(ray);
        if v.min_element() < 0.0 && v.max_element() > 0.0 {
            return f32::INFINITY;
        }
        let along = Vec3::from(corners.map(|corner| corner.dot(ray.direction)));
        // A degenerate triangle gives 0/0, which fails the comparison.
        let t = v.dot(along) / (v.x + v.y + v.z);
        if t > ray.tmin && t <= ray.tmax { t } else { f32::INFINITY }
    }
}

/// The hierarchy and its triangles.
pub(super) struct Bvh {
    nodes: CwBvh,
    /// In the order of the hierarchy's leaves.
    triangles: Vec<Triangle>,
    /// World to scaled coordinates: a power of two, so that scaling is exact.
    scale: f32,
}

impl Bvh {
    /// Builds the hierarchy; takes about a second for a million triangles.
    pub fn new(mesh: &Mesh) -> Self {
        let largest = mesh.positions.iter().map(|p| p.abs().max_element()).fold(0.0, f32::max);
        let scale = power_of_two_scale(largest);
        let scaled =
            |face: &[u32; 3]| Triangle(face.map(|i| Vec3A::from(mesh.positions[i as usize]) * scale));
        let boxes: Vec<Aabb> = mesh.triangles.iter().map(|face| padded_box(&scaled(face))).collect();
        let nodes = build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Duration::default());
        let triangles =
            nodes.primitive_indices.iter().map(|&i| scaled(&mesh.triangles[i as usize])).collect();
        Self { nodes, triangles, scale }
    }

    /// The nearest triangle along the ray; `direction` is of unit length.
    pub fn closest(&self, origin: Vec3, direction: Vec3) -> Option<Intersection> {
        let ray = self.ray(origin, direction, f32::INFINITY);
        let mut hit = RayHit::none();
        self.nodes.ray_traverse(ray, &mut hit, |ray, i| self.triangles[i].intersect(ray));
        let triangle = self.triangles.get(hit.primitive_id as usize)?;
        let (_, v) = triangle.volumes(&ray);
        let face = self.nodes.primitive_indices[hit.primitive_id as usize];
        Some(Intersection { face, weights: v / (v.x + v.y + v.z) })
    }

    /// Whether nothing lies between two points.
    pub fn visible(&self, from: Vec3, to: Vec3) -> bool {
        let (direction, distance) = (to - from).normalize_and_length();
        let ray = self.ray(from, direction, distance * self.scale);
        self.nodes.ray_traverse_miss(ray, |ray, i| self.triangles[i].intersect(ray))
    }

    fn ray(&self, origin: Vec3, direction: Vec3, tmax: f32) -> Ray {
        // Adding zero turns -0 into +0: obvhs takes the sign of a zero direction in two different ways.
        let direction = Vec3A::from(direction) + Vec3A::ZERO;
        Ray::new(Vec3A::from(origin) * self.scale, direction, 0.0, tmax)
    }
}

/// The power of two that brings `largest` to [2^9, 2^10).
fn power_of_two_scale(largest: f32) -> f32 {
    if largest.is_normal() {
        let exponent = largest.log2().floor() as i32 + 1;
        2f32.powi((SCALED_EXPONENT - exponent).clamp(-126, 126))
    } else {
        1.0
    }
}

fn padded_box(triangle: &Triangle) -> Aabb {
    let [a, b, c] = triangle.0;
    Aabb::new(a.min(b).min(c) - Vec3A::splat(PAD), a.max(b).max(c) + Vec3A::splat(PAD))
}
