//! glTF 2.0, text and binary. What a file has that is not in the model as it stands is in the model's report; only
//! damage to its geometry refuses it.

mod accessors;
mod cameras;
mod container;
mod extensions;
mod instances;
mod json;
mod lights;
mod materials;
mod meshopt;
mod nodes;
mod primitives;
mod textures;

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use super::model::{Model, plain_material};
use super::origin::origin_of;
use crate::{Material, NoteKind, Report, Shape};
use container::Container;
use instances::INSTANCING;
use json::name_of;
use materials::Described;
use nodes::Tree;
use primitives::{Joints, Setting, Triangles};

/// Reads a `.gltf` or `.glb` file; `external` returns the bytes of a file that it references, relative to its folder.
pub(super) fn read(
    bytes: &[u8],
    external: impl Fn(&str) -> Result<Vec<u8>, String>,
) -> Result<Model, String> {
    let file = Container::open(bytes, &external)?;
    let tree = Tree::of(&file.root)?;
    let mut reader = Reader::new(&file, &tree);
    extensions::note(&file.root, &mut reader.report);
    for animation in &file.root.animations {
        reader.report.add(NoteKind::LeftOut, "an animation", &animation.name);
    }
    for &node in &tree.shown {
        reader.node(node)?;
    }
    Ok(reader.finish())
}

/// The shapes of a mesh with their materials.
type Shapes = Arc<Vec<(Triangles, Option<usize>)>>;

/// A shape at a place in the file's space.
struct Piece {
    shape: Arc<Shape>,
    material: Option<usize>,
    world: DAffine3,
}

struct Reader<'a> {
    file: &'a Container<'a>,
    tree: &'a Tree,
    materials: Vec<Described>,
    /// Triangles and vertices of all primitives so far. Many primitives may share one buffer, so these can be far more
    /// than the file has bytes.
    size: [usize; 2],
    /// The meshes that stand still, by index.
    meshes: HashMap<usize, Shapes>,
    pieces: Vec<Piece>,
    /// With the names of their nodes.
    lights: Vec<(lights::Placed, String)>,
    cameras: Vec<(cameras::Placed, String)>,
    report: Report,
}

impl<'a> Reader<'a> {
    fn new(file: &'a Container<'a>, tree: &'a Tree) -> Self {
        Self {
            file,
            tree,
            materials: Described::all(&file.root),
            size: [0; 2],
            meshes: HashMap::new(),
            pieces: vec![],
            lights: vec![],
            cameras: vec![],
            report: Report::default(),
        }
    }

    fn node(&mut self, index: usize) -> Result<(), String> {
        let (file, node, world) = (self.file, &self.file.root.nodes[index], self.tree.worlds[index]);
        let name = name_of(Some(&node.name), "node", index);
        if let Some(mesh) = node.mesh {
            let places = match node.extensions.get(INSTANCING) {
                Some(value) => {
                    file.instances(value).map_err(|error| format!("node {index}, {INSTANCING}: {error}"))?
                }
                None => vec![DAffine3::IDENTITY],
            };
            let joints = node.skin.and_then(|skin| match Joints::of(file, self.tree, skin) {
                Ok(joints) => Some(joints),
                Err(error) => {
                    self.report.add(NoteKind::LeftOut, format!("a skin: {error}"), &name);
                    None
                }
            });
            let shapes = self.mesh(mesh, node.weights.as_deref(), joints.as_ref(), places.len())?;
            let anchor = joints.map_or(DVec3::ZERO, |joints| joints.anchor);
            for (Triangles { shape, skinned }, material) in shapes.iter() {
                // A skinned mesh is where its joints are, wherever its node is.
                let world = if *skinned { DAffine3::from_translation(anchor) } else { world };
                self.pieces.extend(places.iter().map(|place| Piece {
                    shape: shape.clone(),
                    material: *material,
                    world: world * *place,
                }));
            }
        }
        if let Some(light) = lights::Placed::of(&file.root, node, &name, &world, &mut self.report) {
            self.lights.push((light, name.clone()));
        }
        if let Some(camera) = node.camera {
            self.camera(camera, &node.name, &world);
        }
        Ok(())
    }

    /// The shapes of a mesh, of which there will be so many copies.
    fn mesh(
        &mut self,
        index: usize,
        weights: Option<&[f32]>,
        joints: Option<&Joints>,
        copies: usize,
    ) -> Result<Shapes, String> {
        let stands_still = weights.is_none() && joints.is_none();
        if let Some(shapes) = self.meshes.get(&index).filter(|_| stands_still) {
            let shapes = shapes.clone();
            for (Triangles { shape, .. }, _) in shapes.iter() {
                self.size[0] = self.size[0].saturating_add(shape.triangles.len().saturating_mul(copies));
                self.size[1] = self.size[1].saturating_add(shape.positions.len().saturating_mul(copies));
            }
            crate::MeshError::of_size(self.size[0], self.size[1])
                .map_err(|e| format!("mesh {index}: {e}"))?;
            return Ok(shapes);
        }
        let mesh = self.file.root.meshes.get(index).ok_or_else(|| format!("mesh {index} does not exist"))?;
        let name = name_of(mesh.name.as_deref(), "mesh", index);
        let weights = weights.or(mesh.weights.as_deref()).unwrap_or_default();
        let mut shapes = Vec::new();
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let material = primitive.material.map(|material| material.value());
            let material = material.filter(|&material| {
                let exists = material < self.materials.len();
                if !exists {
                    self.report.add(NoteKind::Repaired, "a material that does not exist", &name);
                }
                exists
            });
            let uv_sets = material.map_or(&[][..], |material| &self.materials[material].uv_sets);
            let has_bumps =
                material.is_some_and(|material| self.materials[material].material.maps.normal.is_some());
            let setting = Setting { name: &name, weights, joints, uv_sets, has_bumps, copies };
            let triangles = self.file.primitive(primitive, setting, &mut self.size, &mut self.report);
            let triangles =
                triangles.map_err(|error| format!("mesh {index}, primitive {number}: {error}"))?;
            shapes.extend(triangles.map(|triangles| (triangles, material)));
        }
        let shapes = Arc::new(shapes);
        if stands_still {
            self.meshes.insert(index, shapes.clone());
        }
        Ok(shapes)
    }

    /// The camera of a node, by the name of the node, its own, or its number.
    fn camera(&mut self, index: usize, node: &str, world: &DAffine3) {
        let camera = self.file.root.cameras.get(index).and_then(|camera| camera.0.as_ref());
        let own = camera.and_then(|camera| camera.name.as_deref());
        let name = if node.is_empty() { name_of(own, "camera", index) } else { node.to_owned() };
        let lenses = camera.map(|camera| (&camera.perspective, &camera.orthographic));
        let placed = match lenses {
            Some((Some(lens), _)) => cameras::Placed::perspective(lens, world),
            Some((None, Some(lens))) => cameras::Placed::orthographic(lens, world),
            _ => Err("its lens is not valid".to_owned()),
        };
        match placed {
            Ok(camera) => {
                if camera.is_orthographic() {
                    let what = "an orthographic camera, by one far away";
                    self.report.add(NoteKind::Approximated, what, &name);
                }
                self.cameras.push((camera, name));
            }
            Err(error) => self.report.add(NoteKind::LeftOut, format!("a camera: {error}"), &name),
        }
    }

    fn finish(self) -> Model {
        let Self { file, materials, meshes, pieces, lights, cameras, mut report, .. } = self;
        drop(meshes);
        let used: BTreeSet<usize> = pieces.iter().filter_map(|piece| piece.material).collect();
        used.iter().for_each(|&material| materials[material].note(&mut report));
        let (mut materials, textures) = textures::load(file, materials, &used, &mut report);
        let plain = materials.len();
        if pieces.iter().any(|piece| piece.material.is_none()) {
            materials.push(Material { culled: true, ..plain_material() });
        }
        let [low, high] = bounds(&pieces);
        let origin = origin_of(low, high);
        let part = |Piece { shape, material, world }: Piece| {
            let shape = placed(shape, &DAffine3 { translation: world.translation - origin, ..world });
            (shape, Some(material.unwrap_or(plain)))
        };
        let parts = pieces.into_par_iter().map(part).collect();
        let mut model = Model { origin, parts, materials, textures, ..Model::default() };
        let bounds = model.bounds();
        for (light, name) in lights {
            let light = light.light(origin, bounds);
            if light.is_valid() {
                model.lights.push(light);
            } else {
                report.add(NoteKind::LeftOut, "a light that is too strong or too far away", &name);
            }
        }
        for (camera, name) in cameras {
            let (camera, cuts) = camera.camera(origin, bounds);
            if !camera.is_valid() {
                report.add(NoteKind::LeftOut, "a camera that is too far away", &name);
                continue;
            }
            if cuts {
                report.add(NoteKind::LeftOut, "a far plane that hides some of the scene", &name);
            }
            // The first is the scene's view.
            model.camera.get_or_insert(camera);
            let is_new = |name: &String| model.cameras.iter().all(|(known, _)| known != name);
            let names = [name.clone()].into_iter().chain((2..).map(|copy| format!("{name} {copy}")));
            let name = names.into_iter().find(is_new).unwrap_or_default();
            model.cameras.push((name, camera));
        }
        model.report = report;
        model
    }
}

/// Lowest and highest corner of a box around all triangles.
fn bounds(pieces: &[Piece]) -> [DVec3; 2] {
    let mut boxes: HashMap<*const Shape, [Vec3; 2]> = HashMap::new();
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    for piece in pieces {
        let [low, high] = *boxes.entry(Arc::as_ptr(&piece.shape)).or_insert_with(|| {
            let used =
                piece.shape.triangles.iter().flatten().map(|&vertex| piece.shape.positions[vertex as usize]);
            used.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
        });
        for corner in 0..8 {
            let side = |axis: usize| f64::from(if corner >> axis & 1 == 0 { low[axis] } else { high[axis] });
            let at = piece.world.transform_point3(DVec3::new(side(0), side(1), side(2)));
            bounds = [bounds[0].min(at), bounds[1].max(at)];
        }
    }
    bounds
}

/// A shape moved by a transform in double precision. One that mirrors also turns the triangles, so that fronts stay
/// fronts.
fn placed(shape: Arc<Shape>, place: &DAffine3) -> Shape {
    let mut shape = Arc::unwrap_or_clone(shape);
    if *place == DAffine3::IDENTITY {
        return shape;
    }
    for at in &mut shape.positions {
        *at = place.transform_point3(at.as_dvec3()).as_vec3();
    }
    let of_normals = place.matrix3.inverse().transpose().as_mat3();
    for normal in shape.normals.iter_mut().flatten() {
        *normal = (of_normals * *normal).normalize_or_zero();
    }
    let matrix = place.matrix3.as_mat3();
    shape.turn_tangents(|tangent| matrix * tangent);
    if place.matrix3.determinant() < 0.0 {
        shape.turn_over();
    }
    shape
}

#[cfg(test)]
mod cases;
#[cfg(test)]
mod tests;
