use std::ops::{Add, Mul};
use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};

/// Means "no face" in [`Edge::faces`].
pub const NO_FACE: u32 = u32::MAX;

/// The kinds of edge that the silhouette test distinguishes (`algorithms.md` section 2.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EdgeKind {
    /// Two faces that meet smoothly.
    Regular,
    /// Two faces that meet at more than the crease angle: drawn whenever either faces the eye.
    Crease,
    /// One face only.
    Border,
}

/// An edge between two welded vertices, with the one or two faces that share it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Indices into [`Mesh::positions`]; the lower first.
    pub vertices: [u32; 2],
    /// The faces on both sides, the lower first; `NO_FACE` second for a border. Where a face whose back is culled
    /// ([`Material::culled`](crate::Material::culled)) ends, it is on both sides of a crease, which is drawn while the face
    /// is seen.
    pub faces: [u32; 2],
    /// Regular, crease or border.
    pub kind: EdgeKind,
}

/// All triangles of a scene, with welded vertices: equal positions share an index unless they belong to different
/// bodies. Data that does not depend on motion is shared by all poses of a scene.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions, metres.
    pub positions: Vec<Vec3>,
    /// Counter-clockwise seen from the front.
    pub triangles: Arc<Vec<[u32; 3]>>,
    /// Unit normal of each triangle (zero for a degenerate one).
    pub face_normals: Vec<Vec3>,
    /// Shading normals per corner if the source has them (empty: flat shading everywhere).
    pub corner_normals: Vec<[Vec3; 3]>,
    /// Two sets of texture coordinates per corner, each empty if no part of the source has it.
    pub corner_uvs: Arc<[Vec<[Vec2; 3]>; 2]>,
    /// The frames of normal maps per corner, as [`Shape::tangents`](crate::Shape::tangents), with bodies at rest; empty if
    /// no part of the source has them.
    pub corner_tangents: Arc<Vec<[Vec4; 3]>>,
    /// Factors on colour and opacity per corner, linear; empty if no part of the source has them.
    pub corner_colors: Arc<Vec<[Vec4; 3]>>,
    /// Index into `Scene::materials` of each triangle.
    pub material: Arc<Vec<u32>>,
    /// The object of each triangle.
    pub object: Arc<Vec<u32>>,
    /// Every edge, in ascending order of its vertices.
    pub edges: Arc<Vec<Edge>>,
}

impl Mesh {
    /// The corners of triangle `face`, metres.
    #[inline]
    pub fn corners(&self, face: usize) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[face];
        let at = |vertex: u32| self.positions[vertex as usize];
        [at(a), at(b), at(c)]
    }

    /// Lowest and highest corner of the axis-aligned box around all vertices.
    pub fn bounds(&self) -> [Vec3; 2] {
        bounds_of(&self.positions)
    }
}

/// Lowest and highest corner of the box around `points` (an inverted infinite box if there are none).
pub(crate) fn bounds_of(points: &[Vec3]) -> [Vec3; 2] {
    points.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], &p| [low.min(p), high.max(p)])
}

/// The mean of three corners' values with these barycentric weights.
pub(crate) fn interpolate<T: Add<Output = T> + Mul<f32, Output = T>>([a, b, c]: [T; 3], weights: Vec3) -> T {
    a * weights.x + b * weights.y + c * weights.z
}
