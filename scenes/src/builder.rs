use std::{mem, ops::Range, sync::Arc};

use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use crate::edges::find_edges;
use crate::limits::{MAX_COORDINATE, MAX_INTENSITY, MAX_RADIANCE, MAX_TIME, MAX_TRIANGLES};
use crate::mesh::bounds_of;
use crate::motion::{Body, MAX_BODIES, Motion, Pose, Rest};
use crate::shape::append;
use crate::weld::weld_bodies;
use crate::{Camera, Light, Material, Mesh, NoteKind, Report, Scene, Shape, Sky, Texture};

/// Default crease angle in degrees: faces that meet at a larger angle form a crease.
pub const CREASE_ANGLE: f32 = 40.0;

/// The reason why a list of triangles is unusable.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} is not finite: ({}, {}, {})", position.x, position.y, position.z)]
    NotFinite {
        /// Index of the vertex, in the order of addition.
        vertex: usize,
        /// Its position.
        position: Vec3,
    },
    /// A face refers to a vertex that does not exist.
    #[error("face {face} refers to vertex {index}, but there are only {vertices} vertices (0 to {})", vertices.saturating_sub(1))]
    IndexOutOfRange {
        /// Index of the face within its object.
        face: usize,
        /// The invalid vertex index.
        index: u32,
        /// Number of vertices of its object.
        vertices: usize,
    },
    /// There is no triangle with three different corners.
    #[error("the mesh has no triangles")]
    Empty,
    /// A vertex is beyond [`MAX_COORDINATE`].
    #[error(
        "vertex {vertex} is at ({}, {}, {}), farther out than {MAX_COORDINATE:e} m: make the model smaller",
        position.x, position.y, position.z
    )]
    TooFar {
        /// Index of the vertex, in the order of addition.
        vertex: usize,
        /// Its position.
        position: Vec3,
    },
    /// There are more vertices or triangles than [`MAX_TRIANGLES`].
    #[error(
        "that makes {triangles} triangles and {vertices} vertices, but a scene may have at most {MAX_TRIANGLES} of each"
    )]
    TooLarge {
        /// Number of triangles.
        triangles: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A number of a light is not finite or too large.
    #[error(
        "light {0}: coordinates must be at most {MAX_COORDINATE:e} m, a point's intensity at most {MAX_INTENSITY:e}, and \
         a quad's radiance at most {MAX_RADIANCE:e}"
    )]
    Light(usize),
    /// There is no light, and no room to add one.
    #[error(
        "the scene is too large for the light that is added where there is none, outside of it: add a light, or make the \
         scene smaller"
    )]
    NoRoomForLight,
    /// The camera is unusable.
    #[error(
        "the camera needs an eye at most {MAX_COORDINATE:e} m out, a field of view between 0 and 180 degrees, and \
         distances 0 < near <= far"
    )]
    Camera,
    /// The motion of a body is unusable.
    #[error(
        "body {0}: its motion needs at least one key, times in ascending order of at most {MAX_TIME:e} s, and \
         coordinates of at most {MAX_COORDINATE:e} m"
    )]
    Motion(usize),
    /// The scene has more moving bodies than ids for them.
    #[error("{0} bodies move, but there may be at most {MAX_BODIES}")]
    TooManyBodies(usize),
}

impl MeshError {
    /// Refuses more triangles or vertices than a scene may have.
    pub(crate) fn of_size(triangles: usize, vertices: usize) -> Result<(), Self> {
        if triangles.max(vertices) > MAX_TRIANGLES {
            return Err(Self::TooLarge { triangles, vertices });
        }
        Ok(())
    }
}

/// The ranges of vertices, faces and lights that were added for a moving body.
#[derive(Clone, Debug)]
struct Moving {
    motion: Motion,
    triangles: Range<usize>,
    lights: Range<usize>,
    /// A box that contains it in every frame.
    swept: [Vec3; 2],
}

/// Collects shapes, materials and lights and builds a [`Scene`].
///
/// Face and vertex indices in errors count from 0 within the added shape.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<[Vec3; 3]>,
    uvs: [Vec<[Vec2; 3]>; 2],
    tangents: Vec<[Vec4; 3]>,
    colors: Vec<[Vec4; 3]>,
    material: Vec<u32>,
    object: Vec<u32>,
    objects: u32,
    materials: Vec<Material>,
    textures: Vec<Arc<Texture>>,
    lights: Vec<Light>,
    has_own_light: bool,
    /// See [`Scene::added`].
    added: Range<usize>,
    sky: Option<Arc<Sky>>,
    moving: Vec<Moving>,
    /// See [`Scene::origin`]; what is added is relative to it.
    pub(crate) origin: DVec3,
    /// See [`Scene::cameras`].
    pub(crate) cameras: Vec<(String, Camera)>,
    /// What the files of the scene have that is not in it as it stands.
    pub(crate) report: Report,
}

impl SceneBuilder {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a material and returns its index.
    pub fn material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        self.materials.len() as u32 - 1
    }

    /// Adds a texture that maps of materials use, once however often it is added, and returns its index.
    pub fn texture(&mut self, texture: &Arc<Texture>) -> usize {
        let found = self.textures.iter().position(|known| Arc::ptr_eq(known, texture));
        found.unwrap_or_else(|| {
            self.textures.push(texture.clone());
            self.textures.len() - 1
        })
    }

    /// Adds a shape of one material as an object of its own.
    ///
    /// # Errors
    /// A vertex that is not finite or too far out, an index out of range, or more elements than [`MAX_TRIANGLES`].
    pub fn add(&mut self, shape: &Shape, material: u32) -> Result<(), MeshError> {
        shape.check()?;
        self.check_room(shape.triangles.len(), shape.positions.len())?;
        let base = self.positions.len();
        self.positions.extend(&shape.positions);
        self.triangles.extend(shape.triangles.iter().map(|t| t.map(|i| i + base as u32)));
        let triangles = self.triangles.len();
        append(&mut self.normals, &shape.normals, triangles, [Vec3::ZERO; 3]);
        for (set, added) in self.uvs.iter_mut().zip(&shape.uvs) {
            append(set, added, triangles, [Vec2::ZERO; 3]);
        }
        append(&mut self.tangents, &shape.tangents, triangles, [Vec4::ZERO; 3]);
        append(&mut self.colors, &shape.colors, triangles, [Vec4::ONE; 3]);
        self.material.resize(self.triangles.len(), material);
        self.object.resize(self.triangles.len(), self.objects);
        self.objects += 1;
        Ok(())
    }

    /// Refuses to grow by so many triangles and vertices if the scene would have too many.
    pub(crate) fn check_room(&self, triangles: usize, vertices: usize) -> Result<(), MeshError> {
        MeshError::of_size(
            self.triangles.len().saturating_add(triangles),
            self.positions.len().saturating_add(vertices),
        )
    }

    /// Moves everything that `add` adds as one body.
    ///
    /// # Errors
    /// Those of `add`.
    pub fn moving<E>(
        &mut self,
        motion: Motion,
        add: impl FnOnce(&mut Self) -> Result<(), E>,
    ) -> Result<(), E> {
        let [positions, triangles, lights] = [self.positions.len(), self.triangles.len(), self.lights.len()];
        add(self)?;
        self.moving.push(Moving {
            swept: motion.swept(&self.positions[positions..]),
            motion,
            triangles: triangles..self.triangles.len(),
            lights: lights..self.lights.len(),
        });
        Ok(())
    }

    /// Moves everything that `add` adds as one body if there is a motion.
    ///
    /// # Errors
    /// Those of `add`.
    pub(crate) fn moving_if<E>(
        &mut self,
        motion: Option<Motion>,
        add: impl FnOnce(&mut Self) -> Result<(), E>,
    ) -> Result<(), E> {
        match motion {
            Some(motion) => self.moving(motion, add),
            None => add(self),
        }
    }

    /// Adds a point light of the given radiant intensity (W/sr).
    pub fn point_light(&mut self, position: Vec3, intensity: Vec3) {
        self.has_own_light = true;
        self.lights.push(Light::Point { position, intensity });
    }

    /// Adds a spot light; see [`Light::Spot`].
    pub fn spot_light(&mut self, position: Vec3, axis: Vec3, intensity: Vec3, cosines: [f32; 2]) {
        self.has_own_light = true;
        self.lights.push(Light::Spot { position, axis, intensity, cosines });
    }

    /// Lights the scene by a sky.
    pub fn sky(&mut self, sky: Arc<Sky>) {
        self.has_own_light = true;
        self.sky = Some(sky);
    }

    /// Adds a quad light that emits towards `u x v`, and its two triangles.
    ///
    /// # Errors
    /// Those of [`add`](Self::add).
    pub fn quad_light(&mut self, corner: Vec3, u: Vec3, v: Vec3, radiance: Vec3) -> Result<(), MeshError> {
        self.has_own_light = true;
        let name = format!("light {}", self.lights.len());
        let material = self.material(Material::lamp(name, radiance));
        self.register_quad_light(corner, u, v, radiance);
        self.add(&Shape::quad([corner, corner + u, corner + u + v, corner + v]), material)
    }

    /// The same where the scene's files have no light.
    ///
    /// # Errors
    /// Those of [`add`](Self::add).
    pub(crate) fn added_quad_light(
        &mut self,
        corner: Vec3,
        u: Vec3,
        v: Vec3,
        radiance: Vec3,
    ) -> Result<(), MeshError> {
        let first = self.triangles.len();
        self.quad_light(corner, u, v, radiance)?;
        self.added = first..self.triangles.len();
        Ok(())
    }

    /// Declares that an emissive parallelogram that is already part of the mesh is a light.
    pub(crate) fn register_quad_light(&mut self, corner: Vec3, u: Vec3, v: Vec3, radiance: Vec3) {
        self.lights.push(Light::Quad { corner, u, v, radiance });
    }

    /// The material with index `material`.
    pub(crate) fn material_at(&self, material: u32) -> &Material {
        &self.materials[material as usize]
    }

    /// Whether there is a light that is not just an emissive surface.
    pub(crate) fn has_own_light(&self) -> bool {
        self.has_own_light
    }

    /// The corners of all triangles, and their materials.
    pub(crate) fn faces(&self) -> impl Iterator<Item = ([Vec3; 3], &Material)> {
        let corners = self.triangles.iter().map(|triangle| triangle.map(|i| self.positions[i as usize]));
        corners.zip(self.material.iter().map(|&material| &self.materials[material as usize]))
    }

    /// Returns true if a triangle with three different corners was added.
    pub(crate) fn has_triangles(&self) -> bool {
        self.triangles.iter().any(|triangle| {
            let [a, b, c] = triangle.map(|i| self.positions[i as usize]);
            a != b && b != c && c != a
        })
    }

    /// Lowest and highest corner of a box that contains everything added so far in every frame.
    pub(crate) fn bounds(&self) -> [Vec3; 2] {
        self.swept(bounds_of(&self.positions))
    }

    /// Extends a box to contain all moving bodies in every frame.
    fn swept(&self, bounds: [Vec3; 2]) -> [Vec3; 2] {
        let boxes = self.moving.iter().map(|moving| moving.swept);
        boxes.fold(bounds, |[low, high], swept| [low.min(swept[0]), high.max(swept[1])])
    }

    /// Welds the vertices (at most `weld_distance` metres apart; 0: equal ones), finds the edges (a crease where
    /// normals differ by more than `crease_angle` degrees) and makes the scene.
    ///
    /// A triangle that uses one welded vertex twice has no area and is dropped. A triangle of three different collinear
    /// vertices is kept, with a zero normal, because the edges around it need it.
    ///
    /// # Errors
    /// [`MeshError::Empty`] if no triangle is left, [`MeshError::TooManyBodies`], and numbers of the camera, the lights
    /// and the motions that are out of range.
    pub fn build(
        mut self,
        name: &str,
        camera: Camera,
        background: Vec3,
        weld_distance: f32,
        crease_angle: f32,
    ) -> Result<Scene, MeshError> {
        if self.moving.len() > MAX_BODIES {
            return Err(MeshError::TooManyBodies(self.moving.len()));
        }
        self.drop_unused_vertices();
        let (map, positions) = weld_bodies(&self.positions, &self.body_of_vertices(), weld_distance);
        let mut mesh = Mesh { positions, ..Mesh::default() };
        let mut triangles = Vec::with_capacity(self.triangles.len());
        let mut kept = Vec::with_capacity(self.triangles.len());
        for (face, triangle) in self.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|i| map[i as usize]);
            if a != b && b != c && c != a {
                triangles.push([a, b, c]);
                // There are at most `MAX_TRIANGLES`.
                kept.push(face as u32);
            }
        }
        drop(map);
        // What the mesh has by now in another form would only take memory while edges are found.
        (self.positions, self.triangles) = (Vec::new(), Vec::new());
        if triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        if !camera.is_valid() {
            return Err(MeshError::Camera);
        }
        if let Some(light) = self.lights.iter().position(|light| !light.is_valid()) {
            return Err(MeshError::Light(light));
        }
        if let Some(body) = self.moving.iter().position(|moving| !moving.motion.is_valid()) {
            return Err(MeshError::Motion(body));
        }
        mesh.triangles = Arc::new(triangles);
        mesh.face_normals =
            (0..kept.len()).into_par_iter().map(|face| face_normal(mesh.corners(face))).collect();
        mesh.corner_normals = kept_of(mem::take(&mut self.normals), &kept);
        for (corners, &flat) in mesh.corner_normals.iter_mut().zip(&mesh.face_normals) {
            corners.iter_mut().filter(|normal| **normal == Vec3::ZERO).for_each(|normal| *normal = flat);
        }
        mesh.corner_uvs = Arc::new(mem::take(&mut self.uvs).map(|set| kept_of(set, &kept)));
        mesh.corner_tangents = Arc::new(kept_of(mem::take(&mut self.tangents), &kept));
        mesh.corner_colors = Arc::new(kept_of(mem::take(&mut self.colors), &kept));
        mesh.material = Arc::new(kept_of(mem::take(&mut self.material), &kept));
        mesh.object = Arc::new(kept_of(mem::take(&mut self.object), &kept));
        let material = |face: u32| self.materials.get(mesh.material[face as usize] as usize);
        let culled = |face: u32| material(face).is_some_and(|material| material.culled);
        let angle = crease_angle.to_radians();
        let edges = find_edges(&mesh.triangles, &mesh.object, &mesh.face_normals, angle, culled);
        mesh.edges = Arc::new(edges);
        let bounds = self.swept(mesh.bounds());
        let bodies: Vec<Body> = self.moving.iter().map(|moving| self.body(moving, &kept, &mesh)).collect();
        if self.origin != DVec3::ZERO {
            let DVec3 { x, y, z } = self.origin;
            let what = format!("an origin at ({x}, {y}, {z}), from which camera paths count");
            self.report.add(NoteKind::Added, what, "");
        }
        Ok(Scene {
            name: name.to_owned(),
            origin: self.origin,
            mesh,
            materials: self.materials,
            textures: Arc::new(self.textures),
            lights: self.lights,
            added: faces_of(&self.added, &kept),
            background,
            sky: self.sky,
            camera,
            cameras: Arc::new(self.cameras),
            bounds,
            poses: vec![Pose::REST; bodies.len()],
            bodies: Arc::new(bodies),
            points: None,
            report: Arc::new(self.report),
        })
    }

    /// The body of each vertex, counted from 1; 0 for static ones.
    fn body_of_vertices(&self) -> Vec<u32> {
        let mut body = vec![0; self.positions.len()];
        for (number, moving) in (1..).zip(&self.moving) {
            for &vertex in self.triangles[moving.triangles.clone()].iter().flatten() {
                body[vertex as usize] = number;
            }
        }
        body
    }

    /// A body of the finished mesh. Faces keep their order, welded vertices are in the order of their faces, and edges
    /// in that of their vertices, so the parts of a body are contiguous in every list.
    fn body(&self, moving: &Moving, kept: &[u32], mesh: &Mesh) -> Body {
        let Moving { motion, triangles, lights, .. } = moving;
        let faces = faces_of(triangles, kept);
        let named = || mesh.triangles[faces.clone()].iter().flatten().map(|&vertex| vertex as usize);
        let first = named().min().unwrap_or(0);
        let vertices = first..named().max().map_or(first, |last| last + 1);
        let edge = |vertex: usize| mesh.edges.partition_point(|edge| (edge.vertices[0] as usize) < vertex);
        let rest = Rest {
            positions: mesh.positions[vertices.clone()].to_vec(),
            face_normals: mesh.face_normals[faces.clone()].to_vec(),
            corner_normals: mesh.corner_normals.get(faces.clone()).map_or(vec![], <[_]>::to_vec),
            lights: self.lights[lights.clone()].to_vec(),
        };
        Body {
            edges: edge(vertices.start)..edge(vertices.end),
            vertices,
            faces,
            lights: lights.clone(),
            motion: motion.clone(),
            rest,
        }
    }

    /// Drops vertices without triangles, which would only enlarge the bounds.
    fn drop_unused_vertices(&mut self) {
        let mut index = vec![u32::MAX; self.positions.len()];
        for &i in self.triangles.iter().flatten() {
            index[i as usize] = 0;
        }
        let mut used = 0;
        for (old, new) in index.iter_mut().enumerate().filter(|(_, new)| **new == 0) {
            self.positions[used] = self.positions[old];
            *new = used as u32;
            used += 1;
        }
        self.positions.truncate(used);
        for i in self.triangles.iter_mut().flatten() {
            *i = index[*i as usize];
        }
    }
}

/// The faces of the mesh that are left of a range of added triangles; `kept` has the triangle of each face, in ascending
/// order.
fn faces_of(triangles: &Range<usize>, kept: &[u32]) -> Range<usize> {
    let face = |old: usize| kept.partition_point(|&face| (face as usize) < old);
    face(triangles.start)..face(triangles.end)
}

/// The entries of the triangles that are kept, or none if there are none.
fn kept_of<T: Copy>(mut all: Vec<T>, kept: &[u32]) -> Vec<T> {
    if all.len() > kept.len() {
        return kept.iter().map(|&old| all[old as usize]).collect();
    }
    all.shrink_to_fit();
    all
}

/// Unit normal of a counter-clockwise triangle, or zero if it has no area. Computed in f64, as the cross product of a
/// scan's tiny triangles underflows in f32.
fn face_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = [a, b, c].map(Vec3::as_dvec3);
    (b - a).cross(c - a).normalize_or_zero().as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EdgeKind;

    fn build(shape: &Shape) -> Result<Scene, MeshError> {
        let mut builder = SceneBuilder::new();
        builder.add(shape, 0)?;
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        builder.build("test", camera, Vec3::ZERO, 0.0, CREASE_ANGLE)
    }

    #[test]
    fn a_cube_has_12_creases_and_6_regular_diagonals() {
        let cube = build(&Shape::cuboid(Vec3::ZERO, Vec3::ONE)).unwrap().mesh;
        let count = |kind| cube.edges.iter().filter(|e| e.kind == kind).count();
        assert_eq!((cube.positions.len(), cube.triangles.len()), (8, 12));
        assert_eq!((count(EdgeKind::Crease), count(EdgeKind::Regular), count(EdgeKind::Border)), (12, 6, 0));
        assert!(cube.edges.is_sorted_by_key(|e| (e.vertices, e.faces)));
        for (face, normal) in cube.face_normals.iter().enumerate() {
            let centre = cube.corners(face).iter().sum::<Vec3>() / 3.0;
            assert!(normal.dot(centre - 0.5) > 0.4, "face {face} looks inwards");
        }
    }

    #[test]
    fn crease_angle_is_a_parameter() {
        let mut builder = SceneBuilder::new();
        builder.add(&Shape::cuboid(Vec3::ZERO, Vec3::ONE), 0).unwrap();
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
        let scene = builder.build("test", camera, Vec3::ZERO, 0.0, 91.0).unwrap();
        assert!(scene.mesh.edges.iter().all(|e| e.kind == EdgeKind::Regular));
    }

    #[test]
    fn bad_vertices_and_indices_are_named() {
        let mut shape = Shape::quad([Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y]);
        shape.positions[2].y = f32::NAN;
        let message = build(&shape).unwrap_err().to_string();
        assert!(message.contains("vertex 2") && message.contains("NaN"), "{message}");
        shape.positions[2].y = 1.0;
        shape.triangles[1][2] = 4;
        let message = build(&shape).unwrap_err().to_string();
        assert!(message.contains("face 1") && message.contains("vertex 4"), "{message}");
        assert_eq!(build(&Shape::default()).unwrap_err(), MeshError::Empty);
    }

    #[test]
    fn a_collapsed_triangle_is_dropped_and_a_flat_one_kept() {
        let mut shape = Shape::quad([Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y]);
        shape.positions.extend([Vec3::X, 2.0 * Vec3::X, Vec3::splat(9.0)]);
        shape.triangles.extend([[0, 1, 4], [0, 1, 5]]);
        let scene = build(&shape).unwrap();
        assert_eq!(scene.mesh.triangles.len(), 3);
        assert_eq!(scene.mesh.face_normals[2], Vec3::ZERO);
        assert_eq!(scene.bounds[1], Vec3::new(2.0, 1.0, 1.0), "an unused vertex widened the bounds");
    }

    #[test]
    fn a_scene_has_at_most_so_many_triangles_and_vertices() {
        for (triangles, vertices) in [(MAX_TRIANGLES, MAX_TRIANGLES), (0, MAX_TRIANGLES), (MAX_TRIANGLES, 0)]
        {
            assert_eq!(MeshError::of_size(triangles, vertices), Ok(()));
        }
        for (triangles, vertices) in [(MAX_TRIANGLES + 1, 0), (0, MAX_TRIANGLES + 1)] {
            let error = MeshError::TooLarge { triangles, vertices };
            assert_eq!(MeshError::of_size(triangles, vertices), Err(error));
        }
    }

    #[test]
    fn only_three_different_corners_make_a_triangle() {
        let has_triangles = |corners: [Vec3; 3]| {
            let mut builder = SceneBuilder::new();
            let triangle =
                Shape { positions: corners.into(), triangles: vec![[0, 1, 2]], ..Shape::default() };
            builder.add(&triangle, 0).unwrap();
            builder.has_triangles()
        };
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert!(has_triangles([a, b, c]));
        assert!(
            [[a, a, b], [a, b, b], [a, b, a], [a, a, a]].into_iter().all(|corners| !has_triangles(corners))
        );
    }

    #[test]
    fn a_scene_has_at_most_255_moving_bodies() {
        let motion = || {
            let key = crate::MotionKey { time: 0.0, translate: Vec3::ZERO, rotate: glam::Quat::IDENTITY };
            Motion { pivot: Vec3::ZERO, keys: vec![key], looped: false }
        };
        let with = |count: usize| {
            let mut builder = SceneBuilder::new();
            for _ in 0..count {
                let shape = Shape::quad([Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y]);
                builder.moving(motion(), |builder| builder.add(&shape, 0)).unwrap();
            }
            let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
            builder.build("test", camera, Vec3::ZERO, 0.0, CREASE_ANGLE)
        };
        assert_eq!(with(255).unwrap().bodies.len(), 255);
        assert_eq!(with(256).unwrap_err(), MeshError::TooManyBodies(256));
    }
}
