//! The triangles of primitives: vertices moved by morph targets and joints, and repaired where they are not numbers.

use std::sync::Arc;

use glam::{DAffine3, DMat4, DVec3, Vec2, Vec3, Vec4};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::container::Container;
use super::nodes::Tree;
use crate::load::uvs::WITHOUT_UVS;
use crate::{MeshError, NoteKind, Report, Shape};

/// An extension without which its primitives have no vertices.
pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// What a primitive needs to know of what is around it.
#[derive(Clone, Copy)]
pub(super) struct Setting<'a> {
    /// The name of its mesh.
    pub name: &'a str,
    /// The weights of its morph targets.
    pub weights: &'a [f32],
    /// The joints of its skin.
    pub joints: Option<&'a Joints>,
    /// The numbers of the texture coordinates that its material uses.
    pub uv_sets: &'a [u32],
    /// Whether its material has a normal map.
    pub has_bumps: bool,
    /// There will be so many copies of it.
    pub copies: usize,
}

/// The joints of a skin in its bind pose or wherever else the file's nodes put them.
pub(super) struct Joints {
    /// From the mesh's space to that of the file, less the anchor.
    matrices: Vec<DAffine3>,
    /// A point near the joints, so that skinned vertices are small numbers.
    pub anchor: DVec3,
}

impl Joints {
    /// The joints of the skin with this index.
    pub fn of(file: &Container, tree: &Tree, skin: usize) -> Result<Self, String> {
        let skin = file.root.skins.get(skin).ok_or_else(|| format!("skin {skin} does not exist"))?;
        let world = |joint: usize| {
            tree.worlds.get(joint).copied().ok_or_else(|| format!("joint {joint} does not exist"))
        };
        let worlds: Vec<DAffine3> =
            skin.joints.iter().map(|joint| world(joint.value())).collect::<Result<_, _>>()?;
        let anchor = worlds.first().ok_or("it has no joints")?.translation;
        let binds = match skin.inverse_bind_matrices {
            Some(accessor) => file.vectors::<16>(accessor.value())?,
            None => vec![DMat4::IDENTITY.as_mat4().to_cols_array(); worlds.len()],
        };
        if binds.len() < worlds.len() {
            return Err(format!("it has {} joints, but {} matrices for them", worlds.len(), binds.len()));
        }
        let matrices = worlds.iter().zip(&binds).map(|(world, bind)| {
            DAffine3::from_translation(-anchor)
                * *world
                * DAffine3::from_mat4(DMat4::from_cols_array(&bind.map(f64::from)))
        });
        Ok(Self { matrices: matrices.collect(), anchor })
    }
}

/// The triangles of a primitive.
#[derive(Clone)]
pub(super) struct Triangles {
    pub shape: Arc<Shape>,
    /// Whether they are where their joints are, relative to the anchor; otherwise they are in the space of their node.
    pub skinned: bool,
}

/// Vertex positions, and what else the primitive has and the picture needs.
struct Vertices {
    positions: Vec<Vec3>,
    normals: Option<Vec<Vec3>>,
    /// Of normal maps, with the sign of the map's other axis.
    tangents: Option<Vec<Vec4>>,
    uvs: [Option<Vec<Vec2>>; 2],
    colors: Option<Vec<Vec4>>,
}

impl Container<'_> {
    /// The triangles of a primitive; `None` if it has none. `size` counts the triangles and vertices of all primitives.
    pub fn primitive(
        &self,
        primitive: &Primitive,
        setting: Setting,
        size: &mut [usize; 2],
        report: &mut Report,
    ) -> Result<Option<Triangles>, String> {
        let Setting { name, weights, joints, uv_sets, has_bumps, copies } = setting;
        let mut leave_out = |what: &str| {
            report.add(NoteKind::LeftOut, what, name);
            Ok(None)
        };
        let corners_of: fn(u32) -> [u32; 3] = match primitive.mode {
            Checked::Valid(Mode::Triangles) => |t| [3 * t, 3 * t + 1, 3 * t + 2],
            // Every other triangle of a strip has the opposite winding.
            Checked::Valid(Mode::TriangleStrip) => {
                |t| if t % 2 == 0 { [t, t + 1, t + 2] } else { [t + 1, t, t + 2] }
            }
            Checked::Valid(Mode::TriangleFan) => |t| [0, t + 1, t + 2],
            Checked::Valid(Mode::Points) => return leave_out("points"),
            Checked::Valid(Mode::Lines | Mode::LineLoop | Mode::LineStrip) => return leave_out("lines"),
            Checked::Invalid => return leave_out("a primitive of an unknown kind"),
        };
        let Some(at) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
            return leave_out("a primitive without positions");
        };
        let accessor = self.accessor(at.value())?;
        let is_draco = primitive.extensions.as_ref().is_some_and(|all| all.others.contains_key(DRACO));
        if is_draco && accessor.buffer_view.is_none() {
            return Err(format!(
                "it is compressed with {DRACO}, which is not read: decompress the file, for example with `npx \
                 @gltf-transform/cli cp in.glb out.glb`"
            ));
        }
        let count = self.count(at.value())?;
        let corners = primitive.indices.map_or(Ok(count), |indices| self.count(indices.value()))?;
        let listed = primitive.mode == Checked::Valid(Mode::Triangles);
        let triangles = if listed { corners / 3 } else { corners.saturating_sub(2) };
        size[0] = size[0].saturating_add(triangles.saturating_mul(copies));
        size[1] = size[1].saturating_add(count.saturating_mul(copies));
        // Before any of it is made.
        MeshError::of_size(size[0], size[1]).map_err(|error| error.to_string())?;
        if triangles == 0 {
            return leave_out("a primitive without triangles");
        }

        let has = |semantic| primitive.attributes.contains_key(&Checked::Valid(semantic));
        if uv_sets.iter().any(|&set| !has(Semantic::TexCoords(set))) {
            report.add(NoteKind::Approximated, WITHOUT_UVS, name);
        }
        if has(Semantic::Colors(1)) {
            report.add(NoteKind::LeftOut, "a second set of vertex colours", name);
        }
        let mut vertices = self.vertices(primitive, uv_sets, has_bumps)?;
        self.morph(primitive, weights, &mut vertices)?;
        let skinned = joints.map(|joints| self.skin(primitive, joints, &mut vertices));
        let turns = match skinned {
            None => false,
            Some(Ok(mirrors)) => mirrors,
            Some(Err(ref error)) => {
                report.add(NoteKind::LeftOut, format!("the skin of a primitive: {error}"), name);
                false
            }
        };
        let indices = primitive.indices.map(|indices| self.indices(indices.value())).transpose()?;
        let corner = |at: u32| indices.as_ref().map_or(at, |indices| indices[at as usize]);
        let shape = assemble(
            vertices,
            (0..triangles as u32).map(|t| {
                let [a, b, c] = corners_of(t).map(corner);
                if turns { [a, c, b] } else { [a, b, c] }
            }),
            name,
            report,
        )?;
        // Before a transform spreads a NaN over its vertex.
        shape.check().map_err(|error| error.to_string())?;
        Ok(Some(Triangles { shape: Arc::new(shape), skinned: matches!(skinned, Some(Ok(_))) }))
    }

    fn vertices(&self, primitive: &Primitive, uv_sets: &[u32], has_bumps: bool) -> Result<Vertices, String> {
        let at = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|at| at.value());
        let points = |semantic| at(semantic).map(|accessor| self.points(accessor)).transpose();
        let uvs = |set: usize| {
            let accessor = uv_sets.get(set).and_then(|&number| at(Semantic::TexCoords(number)));
            let uvs = accessor.map(|accessor| self.vectors::<2>(accessor)).transpose()?;
            Ok::<_, String>(uvs.map(|uvs| uvs.into_iter().map(Vec2::from).collect()))
        };
        let normals = points(Semantic::Normals)?;
        // The format has no tangents without normals.
        let tangents = at(Semantic::Tangents).filter(|_| has_bumps && normals.is_some());
        let tangents = tangents.map(|accessor| self.vectors::<4>(accessor)).transpose()?;
        Ok(Vertices {
            positions: points(Semantic::Positions)?.unwrap_or_default(),
            normals,
            tangents: tangents.map(|tangents| tangents.into_iter().map(Vec4::from).collect()),
            uvs: [uvs(0)?, uvs(1)?],
            colors: at(Semantic::Colors(0)).map(|accessor| self.colors(accessor)).transpose()?,
        })
    }

    /// Colours with or without opacity.
    fn colors(&self, accessor: usize) -> Result<Vec<Vec4>, String> {
        // A number that is none is no factor.
        let share = |factor: f32| if factor.is_nan() { 1.0 } else { factor.clamp(0.0, 1.0) };
        Ok(match self.kind(accessor)? {
            (_, 3) => {
                self.vectors(accessor)?.into_iter().map(|c| Vec3::from(c).map(share).extend(1.0)).collect()
            }
            _ => self.vectors(accessor)?.into_iter().map(|c| Vec4::from(c).map(share)).collect(),
        })
    }

    fn points(&self, accessor: usize) -> Result<Vec<Vec3>, String> {
        Ok(self.vectors::<3>(accessor)?.into_iter().map(Vec3::from).collect())
    }

    /// Adds the morph targets, by their weights.
    fn morph(&self, primitive: &Primitive, weights: &[f32], vertices: &mut Vertices) -> Result<(), String> {
        let targets = primitive.targets.iter().flatten();
        for (target, &weight) in targets.zip(weights).filter(|(_, weight)| **weight != 0.0) {
            let normals = vertices.normals.as_mut();
            for (vectors, by) in
                [(Some(&mut vertices.positions), target.positions), (normals, target.normals)]
            {
                if let (Some(vectors), Some(by)) = (vectors, by) {
                    let by = self.points(by.value())?;
                    vectors.iter_mut().zip(by).for_each(|(vector, by)| *vector += weight * by);
                }
            }
            if let (Some(tangents), Some(by)) = (vertices.tangents.as_mut(), target.tangents) {
                let by = self.points(by.value())?;
                tangents.iter_mut().zip(by).for_each(|(tangent, by)| *tangent += (weight * by).extend(0.0));
            }
        }
        Ok(())
    }

    /// Moves the vertices with their joints, and says whether the joints mirror them.
    fn skin(&self, primitive: &Primitive, joints: &Joints, vertices: &mut Vertices) -> Result<bool, String> {
        let mut sets = Vec::new();
        for set in 0.. {
            let at = |semantic| primitive.attributes.get(&Checked::Valid(semantic));
            let (Some(joints), Some(weights)) = (at(Semantic::Joints(set)), at(Semantic::Weights(set)))
            else {
                break;
            };
            sets.push((self.joints(joints.value())?, self.vectors::<4>(weights.value())?));
        }
        let count = vertices.positions.len();
        if sets.is_empty()
            || sets.iter().any(|(joints, weights)| joints.len() < count || weights.len() < count)
        {
            return Err("it has no joints for each vertex".to_owned());
        }
        let matrix = |vertex: usize| {
            let mut matrix = DAffine3::ZERO;
            let mut total = 0.0;
            let pairs =
                sets.iter().flat_map(|(joints, weights)| joints[vertex].into_iter().zip(weights[vertex]));
            for (joint, weight) in pairs.filter(|(_, weight)| *weight > 0.0) {
                let of_joint = joints.matrices.get(joint as usize);
                let of_joint =
                    of_joint.ok_or_else(|| format!("joint {joint} of {}", joints.matrices.len()))?;
                let weight = f64::from(weight);
                matrix.matrix3 += weight * of_joint.matrix3;
                matrix.translation += weight * of_joint.translation;
                total += weight;
            }
            // Rounded weights add up to nearly 1. What no joint moves stays with the first.
            if total > 0.0 {
                matrix.matrix3 *= total.recip();
                matrix.translation /= total;
            } else {
                matrix = joints.matrices[0];
            }
            Ok(matrix)
        };
        // All of them, or none if one is wrong.
        let matrices: Vec<DAffine3> = (0..count).map(matrix).collect::<Result<_, String>>()?;
        for (position, matrix) in vertices.positions.iter_mut().zip(&matrices) {
            *position = matrix.transform_point3(position.as_dvec3()).as_vec3();
        }
        for (normal, matrix) in vertices.normals.iter_mut().flatten().zip(&matrices) {
            *normal = (matrix.matrix3.inverse().transpose().as_mat3() * *normal).normalize_or_zero();
        }
        let mirrors = joints.matrices[0].matrix3.determinant() < 0.0;
        for (tangent, matrix) in vertices.tangents.iter_mut().flatten().zip(&matrices) {
            let side = if mirrors { -tangent.w } else { tangent.w };
            *tangent = (matrix.matrix3.as_mat3() * tangent.truncate()).extend(side);
        }
        Ok(mirrors)
    }
}

/// A tangent of unit length with a sign; zero if it is none.
fn unit_tangent(tangent: Vec4) -> Vec4 {
    let along = tangent.truncate().normalize_or_zero();
    if along == Vec3::ZERO || tangent.w == 0.0 || tangent.w.is_nan() {
        return Vec4::ZERO;
    }
    along.extend(tangent.w.signum())
}

/// The shape of these triangles. One with a corner that is not a number is left out; a normal that is no direction
/// becomes that of its face.
fn assemble(
    mut vertices: Vertices,
    triangles: impl ExactSizeIterator<Item = [u32; 3]>,
    name: &str,
    report: &mut Report,
) -> Result<Shape, String> {
    let Vertices { positions, normals, .. } = &mut vertices;
    let count = positions.len();
    let finite = positions.iter().find(|position| position.is_finite()).copied().unwrap_or_default();
    let mut broken = vec![];
    for (vertex, position) in positions.iter_mut().enumerate().filter(|(_, position)| !position.is_finite()) {
        broken.resize(count, false);
        broken[vertex] = true;
        // Does not enlarge what is around it.
        *position = finite;
    }
    for normal in normals.iter_mut().flatten() {
        *normal = normal.normalize_or_zero();
    }
    let mut shape = Shape { triangles: Vec::with_capacity(triangles.len()), ..Shape::default() };
    shape.normals.reserve(if normals.is_some() { triangles.len() } else { 0 });
    let (mut left_out, mut flat) = (0, 0);
    for (face, triangle) in triangles.enumerate() {
        if let Some(&index) = triangle.iter().find(|&&index| index as usize >= count) {
            return Err(format!("face {face} refers to vertex {index} of {count}"));
        }
        if !broken.is_empty() && triangle.iter().any(|&index| broken[index as usize]) {
            left_out += 1;
            continue;
        }
        shape.triangles.push(triangle);
        if let Some(normals) = normals {
            let corners = triangle.map(|index| normals.get(index as usize).copied().unwrap_or(Vec3::ZERO));
            flat += usize::from(corners.contains(&Vec3::ZERO));
            shape.normals.push(corners);
        }
    }
    fn at_corners<T: Copy>(triangles: &[[u32; 3]], values: Option<Vec<T>>, none: T) -> Vec<[T; 3]> {
        let Some(values) = values else { return vec![] };
        let value = |index: u32| values.get(index as usize).copied().unwrap_or(none);
        triangles.iter().map(|corners| corners.map(value)).collect()
    }
    let Vertices { positions, tangents, uvs, colors, .. } = vertices;
    // What is no direction follows from the texture coordinates.
    let tangents = tangents.map(|all| all.into_iter().map(unit_tangent).collect());
    shape.tangents = at_corners(&shape.triangles, tangents, Vec4::ZERO);
    shape.positions = positions;
    shape.uvs = uvs.map(|set| at_corners(&shape.triangles, set, Vec2::ZERO));
    shape.colors = at_corners(&shape.triangles, colors, Vec4::ONE);
    report.add_many(NoteKind::LeftOut, "a triangle with a corner that is not a number", name, left_out);
    report.add_many(NoteKind::Repaired, "a triangle with a normal that is no direction", name, flat);
    Ok(shape)
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, Quat};

    use super::*;
    use crate::load::gltf::read;
    use crate::load::gltf::tests::{Making, TRIANGLE};
    use crate::load::model::Model;

    fn load(making: &Making, rest: &str) -> Result<Model, String> {
        read(&making.file(rest), |name| Err(format!("no file {name}")))
    }

    /// A mesh of one triangle with normals that are not upright, and with tangents and joints, which `attributes` may name.
    fn making() -> Making {
        let mut making = Making::default();
        making.floats("VEC3", 3, &TRIANGLE);
        making.floats("VEC3", 3, &[0.0, 0.6, 0.8].repeat(3));
        making.floats("VEC4", 3, &[1.0, 0.0, 0.0, -1.0].repeat(3));
        let joints = making.view(&[0; 12], "");
        let joints = format!(r#""bufferView": {joints}, "componentType": 5121, "type": "VEC4""#);
        making.accessor(format!(r#"{joints}, "count": 3"#));
        making.floats("VEC4", 3, &[1.0, 0.0, 0.0, 0.0].repeat(3));
        making.accessor(format!(r#"{joints}, "count": 2"#));
        making.floats("VEC4", 2, &[1.0, 0.0, 0.0, 0.0].repeat(2));
        making
    }

    /// A node of a mesh with these attributes, and a second node, both placed alike. Joints are those of the second.
    fn placed(attributes: &str, place: &str) -> String {
        let skin = if attributes.contains("JOINTS") { r#", "skin": 0"# } else { "" };
        format!(
            r#""nodes": [{{"mesh": 0{skin}, {place}}}, {{{place}}}], "skins": [{{"joints": [1]}}],
            "meshes": [{{"name": "wedge", "primitives": [{{"attributes": {{"POSITION": 0, {attributes}}}}}]}}]"#
        )
    }

    const NODE: &str = r#""NORMAL": 1"#;
    const JOINT: &str = r#""NORMAL": 1, "JOINTS_0": 3, "WEIGHTS_0": 4"#;

    #[test]
    fn normals_stay_upright_on_surfaces_that_are_turned_and_stretched() {
        let turn = DQuat::from_axis_angle(DVec3::new(2.0, 3.0, 6.0) / 7.0, 1.25);
        let [x, y, z, w] = turn.to_array();
        let place = format!(r#""rotation": [{x}, {y}, {z}, {w}], "scale": [3, 2, 5]"#);
        for attributes in [NODE, JOINT] {
            let model = load(&making(), &placed(attributes, &place)).unwrap();
            let shape = &model.parts[0].0;
            // By the inverse of the scale.
            let expected = turn.as_quat() * Vec3::new(0.0, 0.6 / 2.0, 0.8 / 5.0).normalize();
            assert!(shape.normals[0].iter().all(|normal| normal.distance(expected) < 1e-6), "{shape:?}");
            let corner = Quat::from_array([x, y, z, w].map(|n| n as f32)) * Vec3::new(12.0, 0.0, 0.0);
            assert!(shape.positions[1].distance(corner) < 1e-5, "{shape:?}");
        }
    }

    #[test]
    fn only_what_mirrors_turns_triangles_over() {
        for attributes in [NODE, JOINT] {
            for (scale, is_turned) in [("[1, 1, 1]", false), ("[1, 1, -1]", true), ("[1, 1, 0]", false)] {
                let place = format!(r#""scale": {scale}"#);
                let model = load(&making(), &placed(attributes, &place)).unwrap();
                let shape = &model.parts[0].0;
                let [a, b, c] = shape.triangles[0].map(|vertex| shape.positions[vertex as usize]);
                assert_eq!((b - a).cross(c - a).z < 0.0, is_turned, "{attributes} {scale}");
            }
        }
    }

    #[test]
    fn a_skin_needs_joints_and_weights_of_each_vertex() {
        let expected = "left out: the skin of a primitive: it has no joints for each vertex (wedge)";
        for (joints, weights, notes) in [(3, 4, 0), (5, 4, 1), (3, 6, 1), (5, 6, 1)] {
            let attributes = format!(r#""JOINTS_0": {joints}, "WEIGHTS_0": {weights}"#);
            let model = load(&making(), &placed(&attributes, r#""name": "a""#)).unwrap();
            let found: Vec<String> = model.report.notes().iter().map(ToString::to_string).collect();
            assert_eq!(found, vec![expected; notes], "{attributes}");
        }
    }

    #[test]
    fn morph_targets_bend_tangents_and_leave_their_signs() {
        let mut making = making();
        let to = making.floats("VEC3", 3, &[0.0, 2.0, 0.0].repeat(3));
        let model = load(
            &making,
            &format!(
                r#""nodes": [{{"mesh": 0, "weights": [0.5]}}], "materials": [{{"normalTexture": {{"index": 0}}}}],
                "textures": [{{"source": 0}}], "images": [{{}}], "meshes": [{{"primitives": [{{"material": 0,
                "attributes": {{"POSITION": 0, "NORMAL": 1, "TANGENT": 2}}, "targets": [{{"TANGENT": {to}}}]}}]}}]"#
            ),
        )
        .unwrap();
        let half = 0.5_f32.sqrt();
        for tangent in model.parts[0].0.tangents[0] {
            assert!(tangent.distance(Vec4::new(half, half, 0.0, -1.0)) < 1e-6, "{tangent}");
        }
    }

    #[test]
    fn corners_are_vertices_that_the_primitive_has() {
        let of = |last: u8| {
            let mut making = making();
            let view = making.view(&[0, 1, last], "");
            let indices = making.accessor(format!(
                r#""bufferView": {view}, "componentType": 5121, "count": 3, "type": "SCALAR""#
            ));
            let primitive = format!(r#"{{"attributes": {{"POSITION": 0}}, "indices": {indices}}}"#);
            load(
                &making,
                &format!(r#""nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{primitive}]}}]"#),
            )
            .map(|model| model.parts[0].0.triangles.len())
        };
        assert_eq!(of(2), Ok(1));
        let expected = "mesh 0, primitive 0: face 0 refers to vertex 3 of 3";
        assert_eq!(of(3), Err(expected.to_owned()));
    }

    #[test]
    fn copies_of_meshes_are_counted_before_they_are_made() {
        // A mesh of 100,000 triangles with as many vertices as corners.
        let mut making = Making::default();
        making.accessor(r#""componentType": 5126, "count": 300000, "type": "VEC3""#);
        let of = |copies: usize| {
            let nodes = vec![r#"{"mesh": 0}"#; copies].join(", ");
            let meshes = r#""meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]"#;
            load(&making, &format!(r#""nodes": [{nodes}], {meshes}"#)).map(|model| model.parts.len())
        };
        assert_eq!(of(16), Ok(16));
        let message = of(17).unwrap_err();
        assert!(
            message.starts_with("mesh 0: that makes 1700000 triangles and 5100000 vertices"),
            "{message}"
        );
    }
}
