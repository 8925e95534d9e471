//! glTF 2.0, text and binary: the node tree's triangles, `EXT_mesh_gpu_instancing`, metallic-roughness factors, emission,
//! `KHR_lights_punctual` and the first perspective camera. Textures, skins, morph targets, animations and sparse accessors are not read.
//!
//! Light intensities are taken as they stand (1 cd as 1 W/sr), as viewers do that show them at exposure 1. A
//! directional light becomes a point far away, a spot a point without a cone.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::f32::consts::PI;
use std::rc::Rc;

use glam::{Affine3A, Mat4, Quat, Vec3, Vec4};
use gltf::accessor::{DataType, Dimensions};
use gltf::khr_lights_punctual::Kind;
use gltf::mesh::Mode;

use super::model::Model;
use crate::limits::{MAX_COORDINATE, MAX_INTENSITY, MAX_RADIANCE, is_intensity, is_near, is_radiance};
use crate::{Camera, Light, Material, MeshError, Shape, Surface};

/// Distance of a directional light in radii of the scene: its light is parallel and uniform to 2%.
const SUN_DISTANCE: f32 = 100.0;

/// Copies of a node's mesh, each with a translation, a rotation and a scale.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Reads a `.gltf` or `.glb` file; `external` returns the bytes of a file that it references, relative to its folder.
pub(super) fn read(
    bytes: &[u8],
    external: impl Fn(&str) -> Result<Vec<u8>, String>,
) -> Result<Model, String> {
    check_header(bytes)?;
    let unchecked = gltf::Gltf::from_slice_without_validation(bytes).map_err(|error| error.to_string())?;
    let mut blob = unchecked.blob;
    check_positions(unchecked.document.as_json())?;
    let mut root = unchecked.document.into_json();
    // Read here; the gltf crate does not know it, and refuses what it does not know.
    root.extensions_required.retain(|name| name != INSTANCING);
    let file = gltf::Document::from_json(root).map_err(|error| error.to_string())?;
    let mut buffers = Vec::new();
    // Each file once, however many buffers it has.
    let mut files: HashMap<String, Rc<Vec<u8>>> = HashMap::new();
    for buffer in file.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => {
                Rc::new(blob.take().ok_or_else(|| "the binary chunk of its buffer is missing".to_owned())?)
            }
            gltf::buffer::Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => {
                    Rc::new(decode_base64(data.split_once(";base64,").map_or("", |(_, text)| text))?)
                }
                None => match files.entry(decode_percent(uri)) {
                    Entry::Occupied(read) => read.get().clone(),
                    Entry::Vacant(new) => {
                        let data = Rc::new(external(new.key())?);
                        new.insert(data).clone()
                    }
                },
            },
        };
        if data.len() < buffer.length() {
            return Err(format!(
                "buffer {} has {} bytes instead of {}: the file is truncated or damaged",
                buffer.index(),
                data.len(),
                buffer.length()
            ));
        }
        buffers.push(data);
    }

    let mut reader = Reader { buffers: &buffers, model: Model::default(), size: [0; 2], suns: vec![] };
    reader.model.materials = file.materials().map(|material| convert_material(&material)).collect();
    if let Some(index) = reader.model.materials.iter().position(|m| !is_radiance(m.emission)) {
        return Err(format!("material {index}: its emission may be at most {MAX_RADIANCE:e}"));
    }
    reader.nodes(&file)?;
    Ok(reader.finish())
}

/// A GLB header contains the file's length. Truncation is the most common damage, so it gets its own message.
fn check_header(bytes: &[u8]) -> Result<(), String> {
    if !bytes.starts_with(b"glTF") {
        return Ok(());
    }
    let promised = bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    match promised {
        Some(length) if (12..=bytes.len()).contains(&length) => Ok(()),
        Some(length) => {
            Err(format!("it has {} bytes instead of the {length} of its header: truncated", bytes.len()))
        }
        None => Err("it ends inside its header: truncated".to_owned()),
    }
}

/// The gltf crate's validation looks up the positions' accessor before it checks that it exists.
fn check_positions(root: &gltf::json::Root) -> Result<(), String> {
    let positions = gltf::json::validation::Checked::Valid(gltf::Semantic::Positions);
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    match primitives.filter_map(|p| p.attributes.get(&positions)).find(|i| i.value() >= root.accessors.len())
    {
        Some(index) => {
            Err(format!("a mesh refers to accessor {} of {}", index.value(), root.accessors.len()))
        }
        None => Ok(()),
    }
}

struct Reader<'a> {
    buffers: &'a [Rc<Vec<u8>>],
    model: Model,
    /// Triangles and vertices of all primitives so far. Many primitives may share one buffer, so these can be far more
    /// than the file has bytes.
    size: [usize; 2],
    /// Direction and irradiance of the directional lights, until the size of the scene is known.
    suns: Vec<(Vec3, Vec3)>,
}

impl Reader<'_> {
    /// Walks the node tree of the default scene, or the first scene, or all nodes without a parent.
    fn nodes(&mut self, file: &gltf::Document) -> Result<(), String> {
        let roots: Vec<gltf::Node> = match file.default_scene().or_else(|| file.scenes().next()) {
            Some(scene) => scene.nodes().collect(),
            None => {
                let children: HashSet<usize> =
                    file.nodes().flat_map(|node| node.children().map(|child| child.index())).collect();
                file.nodes().filter(|n| !children.contains(&n.index())).collect()
            }
        };
        let mut seen = vec![false; file.nodes().len()];
        let mut open: Vec<(gltf::Node, Affine3A)> =
            roots.into_iter().rev().map(|node| (node, Affine3A::IDENTITY)).collect();
        while let Some((node, parent)) = open.pop() {
            if std::mem::replace(&mut seen[node.index()], true) {
                return Err(format!("node {} has two parents or is its own ancestor", node.index()));
            }
            let local = Affine3A::from_mat4(Mat4::from_cols_array_2d(&node.transform().matrix()));
            let world = parent * local;
            self.node(file, &node, world)?;
            let mut children: Vec<_> = node.children().map(|child| (child, world)).collect();
            children.reverse();
            open.extend(children);
        }
        Ok(())
    }

    fn node(&mut self, file: &gltf::Document, node: &gltf::Node, world: Affine3A) -> Result<(), String> {
        if let Some(mesh) = node.mesh() {
            let places = match node.extension_value(INSTANCING) {
                Some(value) => self
                    .instances(file, value)
                    .map_err(|error| format!("node {}, {INSTANCING}: {error}", node.index()))?,
                None => vec![Affine3A::IDENTITY],
            };
            for primitive in mesh.primitives() {
                let shape = self
                    .primitive(&primitive, places.len())
                    .map_err(|e| format!("mesh {}, primitive {}: {e}", mesh.index(), primitive.index()))?;
                let material = primitive.material().index();
                let placed = shape
                    .iter()
                    .flat_map(|shape| places.iter().map(|place| shape.transformed(world * *place)));
                self.model.parts.extend(placed.map(|shape| (shape, material)));
            }
        }
        if let Some(light) = node.light() {
            let intensity = light.intensity() * Vec3::from(light.color());
            if !is_near(world.translation.into()) || !is_intensity(intensity) {
                return Err(format!(
                    "the light of node {}: coordinates must be at most {MAX_COORDINATE:e} m, and color * intensity at \
                     most {MAX_INTENSITY:e}",
                    node.index()
                ));
            }
            match light.kind() {
                Kind::Directional => {
                    self.suns.push((world.transform_vector3(Vec3::NEG_Z).normalize_or_zero(), intensity));
                }
                Kind::Point | Kind::Spot { .. } => {
                    self.model.lights.push(Light::Point { position: world.translation.into(), intensity });
                }
            }
        }
        if let (None, Some(camera)) = (self.model.camera, node.camera()) {
            // Only the JSON shows without a panic if a camera has the lens that its type requires.
            let lens = file.as_json().cameras[camera.index()].perspective.as_ref();
            let convert = |lens| convert_camera(lens, world);
            self.model.camera = lens
                .map(convert)
                .transpose()
                .map_err(|error| format!("camera {}, of node {}: {error}", camera.index(), node.index()))?;
        }
        Ok(())
    }

    /// The transforms of `EXT_mesh_gpu_instancing`: what an instance lacks is the identity.
    fn instances(&self, file: &gltf::Document, value: &gltf::json::Value) -> Result<Vec<Affine3A>, String> {
        let accessor = |name: &str| {
            let Some(index) = value.get("attributes").and_then(|all| all.get(name)) else { return Ok(None) };
            let found = index.as_u64().and_then(|index| file.accessors().nth(usize::try_from(index).ok()?));
            found.map(Some).ok_or_else(|| format!("{name} refers to accessor {index}, which does not exist"))
        };
        let vectors = |name: &str| accessor(name)?.map(|accessor| self.vectors(&accessor)).transpose();
        let (translations, scales) = (vectors("TRANSLATION")?, vectors("SCALE")?);
        let rotations = accessor("ROTATION")?.map(|accessor| self.rotations(&accessor)).transpose()?;
        let counts = [
            translations.as_ref().map(Vec::len),
            rotations.as_ref().map(Vec::len),
            scales.as_ref().map(Vec::len),
        ];
        let count = counts.into_iter().flatten().next().ok_or("it has no TRANSLATION, ROTATION or SCALE")?;
        if counts.into_iter().flatten().any(|other| other != count) {
            return Err("its attributes have different numbers of elements".into());
        }
        let place = |index: usize| {
            let vector = |all: &Option<Vec<Vec3>>, none| all.as_ref().map_or(none, |all| all[index]);
            let rotation = rotations.as_ref().map_or(Quat::IDENTITY, |all| all[index]);
            Affine3A::from_scale_rotation_translation(
                vector(&scales, Vec3::ONE),
                rotation,
                vector(&translations, Vec3::ZERO),
            )
        };
        Ok((0..count).map(place).collect())
    }

    /// Unit quaternions of floats or of normalized signed integers.
    fn rotations(&self, accessor: &gltf::Accessor) -> Result<Vec<Quat>, String> {
        let number = |b: &[u8], at: usize| match accessor.data_type() {
            DataType::I8 => f32::from(b[at].cast_signed()) / 127.0,
            DataType::I16 => f32::from(i16::from_le_bytes([b[2 * at], b[2 * at + 1]])) / 32767.0,
            _ => f32::from_le_bytes([b[4 * at], b[4 * at + 1], b[4 * at + 2], b[4 * at + 3]]),
        };
        let is_known = matches!(accessor.data_type(), DataType::F32 | DataType::I8 | DataType::I16);
        if !is_known || accessor.dimensions() != Dimensions::Vec4 {
            return Err("ROTATION has to be four floats, signed bytes or shorts".to_owned());
        }
        let rotations = self.elements(accessor, |b| Vec4::from([0, 1, 2, 3].map(|at| number(b, at))))?;
        let unit = |(index, rotation): (usize, Vec4)| {
            let found = rotation.try_normalize().map(Quat::from_vec4);
            found.ok_or_else(|| format!("rotation {index} is {rotation}, which is no direction"))
        };
        rotations.into_iter().enumerate().map(unit).collect()
    }

    /// The triangles of a primitive, or `None` if it consists of points or lines. There will be so many copies.
    fn primitive(&mut self, primitive: &gltf::Primitive, copies: usize) -> Result<Option<Shape>, String> {
        let corners_of: fn(u32) -> [u32; 3] = match primitive.mode() {
            Mode::Triangles => |t| [3 * t, 3 * t + 1, 3 * t + 2],
            // Every other triangle of a strip has the opposite winding.
            Mode::TriangleStrip => |t| if t % 2 == 0 { [t, t + 1, t + 2] } else { [t + 1, t, t + 2] },
            Mode::TriangleFan => |t| [0, t + 1, t + 2],
            _ => return Ok(None),
        };
        let positions = primitive.get(&gltf::Semantic::Positions).ok_or("it has no positions")?;
        let corners = primitive.indices().map_or(positions.count(), |indices| indices.count());
        let triangles = if primitive.mode() == Mode::Triangles { corners / 3 } else { corners };
        self.size[0] = self.size[0].saturating_add(triangles.saturating_mul(copies));
        self.size[1] = self.size[1].saturating_add(positions.count().saturating_mul(copies));
        // Before any of it is made.
        let [triangles, vertices] = self.size;
        MeshError::of_size(triangles, vertices).map_err(|error| error.to_string())?;
        let positions = self.vectors(&positions)?;
        let normals = primitive.get(&gltf::Semantic::Normals).map(|a| self.vectors(&a)).transpose()?;
        let indices = match primitive.indices() {
            Some(accessor) => self.indices(&accessor)?,
            None => (0..positions.len() as u32).collect(),
        };
        let count = match primitive.mode() {
            Mode::Triangles => indices.len() / 3,
            _ => indices.len().saturating_sub(2),
        };
        let mut shape = Shape { positions, ..Shape::default() };
        for t in 0..count as u32 {
            let triangle = corners_of(t).map(|corner| indices[corner as usize]);
            if let Some(&index) = triangle.iter().find(|&&i| i as usize >= shape.positions.len()) {
                return Err(format!("face {t} refers to vertex {index} of {}", shape.positions.len()));
            }
            shape.triangles.push(triangle);
            if let Some(normals) = &normals {
                let normal = |i: u32| normals.get(i as usize).map_or(Vec3::ZERO, |n| n.normalize_or_zero());
                shape.normals.push(triangle.map(normal));
            }
        }
        // Before a transform spreads a NaN over its vertex.
        shape.check().map_err(|error| error.to_string())?;
        Ok(Some(shape))
    }

    fn vectors(&self, accessor: &gltf::Accessor) -> Result<Vec<Vec3>, String> {
        if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
            return Err("positions and normals have to be three 32-bit floats".to_owned());
        }
        let read = |b: &[u8], at: usize| f32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
        self.elements(accessor, |b| Vec3::new(read(b, 0), read(b, 4), read(b, 8)))
    }

    fn indices(&self, accessor: &gltf::Accessor) -> Result<Vec<u32>, String> {
        match (accessor.data_type(), accessor.dimensions()) {
            (DataType::U8, Dimensions::Scalar) => self.elements(accessor, |b| b[0].into()),
            (DataType::U16, Dimensions::Scalar) => {
                self.elements(accessor, |b| u16::from_le_bytes([b[0], b[1]]).into())
            }
            (DataType::U32, Dimensions::Scalar) => {
                self.elements(accessor, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            }
            _ => Err("indices have to be unsigned integers".to_owned()),
        }
    }

    /// Each element of an accessor, `convert`ed from its bytes. Offsets, strides and counts of the file are checked
    /// against the buffer before use.
    fn elements<T>(&self, accessor: &gltf::Accessor, convert: impl Fn(&[u8]) -> T) -> Result<Vec<T>, String> {
        let outside = || format!("accessor {} reaches beyond its buffer", accessor.index());
        let (size, count) = (accessor.size(), accessor.count());
        if accessor.sparse().is_some() {
            return Err(format!("accessor {} is sparse, which is not supported", accessor.index()));
        }
        let view = accessor.view().ok_or_else(|| format!("accessor {} has no data", accessor.index()))?;
        let buffer = &self.buffers[view.buffer().index()];
        let end = view.offset().checked_add(view.length()).ok_or_else(outside)?;
        let data =
            buffer.get(view.offset()..end).and_then(|d| d.get(accessor.offset()..)).ok_or_else(outside)?;
        let stride = view.stride().unwrap_or(size);
        if count == 0 {
            return Ok(vec![]);
        }
        let needed = (count - 1).checked_mul(stride).and_then(|n| n.checked_add(size)).ok_or_else(outside)?;
        if stride < size || needed > data.len() {
            return Err(outside());
        }
        Ok((0..count).map(|i| convert(&data[i * stride..][..size])).collect())
    }

    fn finish(mut self) -> Model {
        let [low, high] = self.model.bounds();
        let (centre, radius) = (low.midpoint(high), 0.5 * low.distance(high));
        let distance = SUN_DISTANCE * radius;
        for (direction, irradiance) in self.suns {
            self.model.lights.push(Light::Point {
                position: centre - distance * direction,
                intensity: irradiance * distance * distance,
            });
        }
        if let Some(camera) = self.model.camera.as_mut().filter(|camera| camera.far == f32::INFINITY) {
            camera.far = camera.near + camera.eye.distance(centre) + 4.0 * radius;
        }
        self.model
    }
}

/// A perspective camera; one without a far plane gets an infinite `far` for now.
fn convert_camera(lens: &gltf::json::camera::Perspective, world: Affine3A) -> Result<Camera, String> {
    let axis = |v: Vec3| world.transform_vector3(v).try_normalize();
    let frame = || {
        let (back, up) = (axis(Vec3::Z)?, axis(Vec3::Y)?);
        let right = up.cross(back).try_normalize()?;
        Some(Quat::from_mat3(&glam::Mat3::from_cols(right, back.cross(right), back)))
    };
    let rotation = frame().ok_or("the transform of its node has no view direction")?;
    let eye = Vec3::from(world.translation);
    if !is_near(eye) {
        return Err(format!("its eye is at {eye}, farther out than {MAX_COORDINATE:e} m"));
    }
    let (near, fov_y) = (lens.znear, lens.yfov);
    let far = lens.zfar.unwrap_or(f32::INFINITY);
    if !(1e-3..PI - 1e-3).contains(&fov_y) {
        return Err(format!("yfov is {fov_y}; a field of view lies between 0 and pi"));
    }
    if !(near.is_normal() && near > 0.0 && near < far) {
        return Err(format!("znear is {near} and zfar {far}; znear must be above 0 and below zfar"));
    }
    Ok(Camera { eye, rotation, fov_y, near, far })
}

/// Reads factors only, no textures; emission that a texture would mask is ignored.
fn convert_material(material: &gltf::Material) -> Material {
    /// A metal smoother than this is a mirror.
    const MIRROR_ROUGHNESS: f32 = 0.08;
    /// A dielectric rougher than this has too weak a lobe to tell from diffuse.
    const DIFFUSE_ROUGHNESS: f32 = 0.6;
    let pbr = material.pbr_metallic_roughness();
    let [r, g, b, _] = pbr.base_color_factor();
    let base = Vec3::new(r, g, b).clamp(Vec3::ZERO, Vec3::ONE);
    let (metallic, roughness) =
        (pbr.metallic_factor().clamp(0.0, 1.0), pbr.roughness_factor().clamp(0.0, 1.0));
    let surface = if metallic > 0.5 && roughness < MIRROR_ROUGHNESS {
        Surface::Mirror
    } else if metallic > 0.5 || roughness < DIFFUSE_ROUGHNESS {
        let f0 = 0.04 + metallic * (base.max_element() - 0.04).max(0.0);
        Surface::Glossy { roughness: roughness.max(0.02), f0 }
    } else {
        Surface::Diffuse
    };
    // A glossy lobe has no colour of its own here, so half a metal's tint goes to the diffuse part.
    let color = if surface == Surface::Mirror { base } else { base * (1.0 - 0.5 * metallic) };
    let emission = match material.emissive_texture() {
        Some(_) => Vec3::ZERO,
        None => Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0),
    };
    Material {
        name: material.name().unwrap_or_default().to_owned(),
        color,
        surface,
        emission: emission.max(Vec3::ZERO),
    }
}

/// Standard base64 (RFC 4648 section 4), padded or not.
fn decode_base64(text: &str) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for c in text.trim_end_matches('=').bytes() {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return Err(format!("`{}` is not base64", char::from(c).escape_default())),
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    Ok(bytes)
}

/// Decodes percent-encoded characters, such as `%20`, in a file name of a URI.
fn decode_percent(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let code = tail.get(..2).and_then(|hex| u8::from_str_radix(std::str::from_utf8(hex).ok()?, 16).ok());
        match (first, code) {
            (b'%', Some(byte)) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            _ => {
                bytes.push(first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A GLB of `json` and the positions of one triangle.
    fn glb(json: &str) -> Vec<u8> {
        let mut json = json.as_bytes().to_vec();
        json.resize(json.len().next_multiple_of(4), b' ');
        let bin: Vec<u8> =
            [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0_f32].iter().flat_map(|f| f.to_le_bytes()).collect();
        let mut file = b"glTF".to_vec();
        let total = 12 + 8 + json.len() + 8 + bin.len();
        file.extend([2, total as u32, json.len() as u32].iter().flat_map(|n| n.to_le_bytes()));
        file.extend(b"JSON");
        file.extend(json);
        file.extend((bin.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(bin);
        file
    }

    const JSON: &str = r#"{
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "point", "color": [1, 0.5, 0.25], "intensity": 8},
            {"type": "directional", "intensity": 3}]}},
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2, 3]}],
        "nodes": [
            {"mesh": 0, "translation": [0, 0, -3], "scale": [1, 2, 1]},
            {"translation": [1, 2, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"extensions": {"KHR_lights_punctual": {"light": 1}}},
            {"camera": 0, "translation": [0, 0, 5]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.25}}],
        "materials": [{"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [2, 2, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}]
    }"#;

    fn no_files(name: &str) -> Result<Vec<u8>, String> {
        Err(format!("no file {name}"))
    }

    #[test]
    fn a_file_that_is_shorter_than_its_header_says_is_truncated() {
        let whole = glb(JSON);
        assert!(check_header(&whole).is_ok() && check_header(b"{}").is_ok());
        // What follows the promised length does not count. Twelve bytes are a header without anything.
        for (promised, fits) in
            [(whole.len() - 1, true), (12, true), (11, false), (0, false), (whole.len() + 1, false)]
        {
            let mut file = whole.clone();
            file[8..12].copy_from_slice(&(promised as u32).to_le_bytes());
            let said = check_header(&file);
            let expected =
                format!("it has {} bytes instead of the {promised} of its header: truncated", whole.len());
            assert_eq!(said, if fits { Ok(()) } else { Err(expected) });
        }
        let said = check_header(&whole[..11]).unwrap_err();
        assert_eq!(said, "it ends inside its header: truncated");
    }

    #[test]
    fn triangle_with_lights_camera_and_material() {
        let scene = read(&glb(JSON), no_files).unwrap().into_scene("test").unwrap();
        assert_eq!(scene.mesh.corners(0)[2], Vec3::new(0.0, 4.0, -3.0));
        assert_eq!((scene.materials[0].name.as_str(), scene.materials[0].color), ("red", Vec3::X));
        assert_eq!(
            scene.lights[0],
            Light::Point { position: Vec3::new(1.0, 2.0, 3.0), intensity: Vec3::new(8.0, 4.0, 2.0) }
        );
        // The directional light shines along -z with 3 units of irradiance.
        let Light::Point { position, intensity } = scene.lights[1] else { panic!("{:?}", scene.lights[1]) };
        let towards = position - scene.mesh.corners(0)[0];
        assert!(towards.normalize().dot(Vec3::Z) > 0.999);
        assert!((intensity.x / towards.length_squared() - 3.0).abs() < 0.1);
        assert_eq!((scene.camera.eye, scene.camera.fov_y, scene.camera.near), (5.0 * Vec3::Z, 0.5, 0.25));
        assert!((scene.camera.rotation * Vec3::NEG_Z - Vec3::NEG_Z).length() < 1e-6);
        assert!(scene.camera.far > 8.0 && scene.camera.far.is_finite());
    }

    #[test]
    fn every_truncation_is_an_error() {
        let file = glb(JSON);
        for length in 0..file.len() {
            assert!(read(&file[..length], no_files).is_err(), "{length} bytes were enough");
        }
    }

    #[test]
    fn false_claims_of_a_broken_file_are_errors() {
        for (from, to) in [
            (r#""count": 3"#, r#""count": 400000000000"#),
            (r#""count": 3"#, r#""count": 4"#),
            (r#""byteLength": 36}],"#, r#""byteLength": 36, "byteOffset": 18446744073709551615}],"#),
            (r#""byteLength": 36}],"#, r#""byteLength": 36, "byteStride": 4}],"#),
            (r#""bufferView": 0, "#, ""),
            (r#""bufferView": 0"#, r#""bufferView": 7"#),
            ("5126", "5125"),
            ("VEC3", "VEC2"),
            (r#""buffers": [{"byteLength": 36}]"#, r#""buffers": [{"byteLength": 37}]"#),
            (r#""buffers": [{"byteLength": 36}]"#, r#""buffers": [{"byteLength": 36, "uri": "gone.bin"}]"#),
            (r#""mesh": 0"#, r#""mesh": 0, "children": [0]"#),
            (r#""POSITION": 0"#, r#""POSITION": 1"#),
            (r#""type": "point""#, r#""type": "spot""#),
            (r#""mesh": 0"#, r#""mesh": 1"#),
            (r#""light": 1"#, r#""light": 2"#),
            (r#""version": "2.0""#, r#""version": "2.0", "minVersion": 5"#),
        ] {
            assert_ne!(JSON, JSON.replacen(from, to, 1), "{from}");
            let result = read(&glb(&JSON.replacen(from, to, 1)), no_files);
            assert!(result.is_err(), "{from} -> {to}");
        }
    }

    #[test]
    fn a_camera_keeps_its_planes_or_is_refused() {
        let with = |lens: &str| {
            let old = r#""yfov": 0.5, "znear": 0.25"#;
            read(&glb(&JSON.replacen(old, lens, 1)), no_files)
        };
        let camera =
            with(r#""yfov": 0.5, "znear": 0.00001, "zfar": 0.00005"#).unwrap().into_scene("").unwrap().camera;
        assert_eq!((camera.near, camera.far), (1e-5, 5e-5));
        for (lens, expected) in [
            (r#""yfov": 0.5, "znear": 0"#, "znear is 0 and zfar inf"),
            (r#""yfov": 0.5, "znear": -1"#, "znear is -1"),
            (
                r#""yfov": 0.5, "znear": 2, "zfar": 1"#,
                "znear is 2 and zfar 1; znear must be above 0 and below zfar",
            ),
            (r#""yfov": 0.5, "znear": 1, "zfar": 1"#, "znear is 1 and zfar 1"),
            (r#""yfov": 3.2, "znear": 1"#, "yfov is 3.2"),
        ] {
            let message = with(lens).unwrap_err();
            assert!(
                message.contains("camera 0, of node 3: ") && message.contains(expected),
                "{lens}: {message}"
            );
        }
    }

    #[test]
    fn numbers_beyond_the_limits_name_their_node() {
        for (from, to, expected) in [
            ("[1, 2, 3]", "[1, 2e9, 3]", "the light of node 1: coordinates must be at most 1e9"),
            (r#""intensity": 8"#, r#""intensity": 2e30"#, "the light of node 1: "),
            (
                r#""name": "red", "#,
                r#""emissiveFactor": [0, 1e20, 0], "#,
                "material 0: its emission may be at most 1e18",
            ),
            ("[0, 0, 5]", "[0, 0, 5e9]", "camera 0, of node 3: its eye is at [0, 0, 5000000000]"),
        ] {
            let message = read(&glb(&JSON.replacen(from, to, 1)), no_files).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
        let far = read(&glb(&JSON.replacen("[1, 2, 1]", "[1, 2e9, 1]", 1)), no_files).unwrap();
        assert_eq!(far.check().unwrap_err().to_string().find("vertex 2 is at (0, 4000000000, -3)"), Some(0));
    }

    #[test]
    fn meshes_that_share_a_buffer_are_counted_before_they_are_made() {
        // A buffer of 4 MB, which 400 primitives use.
        let primitive = r#"{"attributes": {"POSITION": 0}, "material": 0}"#;
        let json = JSON
            .replacen(primitive, &[primitive; 400].join(","), 1)
            .replacen(r#""count": 3"#, r#""count": 300000"#, 1)
            .replacen(r#""byteLength": 36}],"#, r#""byteLength": 3600000}],"#, 1)
            .replacen(r#"[{"byteLength": 36}]"#, r#"[{"byteLength": 3600000, "uri": "a.bin"}]"#, 1);
        let reads = std::cell::Cell::new(0);
        let files = |_: &str| {
            reads.set(reads.get() + 1);
            Ok(vec![0; 3_600_000])
        };
        let message = read(json.as_bytes(), files).unwrap_err();
        let expected = "mesh 0, primitive 16: that makes 1700000 triangles and 5100000 vertices";
        assert!(message.contains(expected), "{message}");
        assert_eq!(reads.get(), 1);
        // A file is read once, however many buffers it has.
        let twice = json.replacen(
            r#"[{"byteLength": 3600000, "uri": "a.bin"}]"#,
            r#"[{"byteLength": 3600000, "uri": "a.bin"}, {"byteLength": 3600000, "uri": "a.bin"}]"#,
            1,
        );
        read(twice.as_bytes(), files).unwrap_err();
        assert_eq!(reads.get(), 2);
    }

    #[test]
    fn a_camera_without_a_lens_is_ignored() {
        let lens = r#""perspective": {"yfov": 0.5, "znear": 0.25}"#;
        let other = r#""orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1}"#;
        assert!(JSON.contains(lens));
        let model = read(&glb(&JSON.replacen(lens, other, 1)), no_files).unwrap();
        assert!(model.camera.is_none());
    }

    #[test]
    fn no_damaged_byte_panics() {
        let file = glb(JSON);
        for at in 0..file.len() {
            for damage in [0, b'9', b'-', 0xff] {
                let mut damaged = file.clone();
                damaged[at] = damage;
                let _ = read(&damaged, no_files).map(|model| model.into_scene("damaged").is_ok());
            }
        }
    }

    #[test]
    fn embedded_and_external_buffers() {
        let zeros = "A".repeat(48);
        let uri = format!(
            r#""buffers": [{{"uri": "data:application/octet-stream;base64,{zeros}", "byteLength": 36}}]"#
        );
        let embedded = JSON.replace(r#""buffers": [{"byteLength": 36}]"#, &uri);
        assert!(read(embedded.as_bytes(), no_files).is_ok());
        let external = JSON.replace(r#"[{"byteLength": 36}]"#, r#"[{"byteLength": 36, "uri": "a%20b.bin"}]"#);
        let files = |name: &str| if name == "a b.bin" { Ok(vec![0; 36]) } else { no_files(name) };
        assert!(read(external.as_bytes(), files).is_ok());
    }

    #[test]
    fn base64_has_64_digits_and_any_padding() {
        // RFC 4648, section 10.
        for (text, bytes) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg==", "foob"),
            ("Zm9vYmE=", "fooba"),
            ("Zm9vYmFy", "foobar"),
        ] {
            assert_eq!(decode_base64(text).unwrap(), bytes.as_bytes());
            assert_eq!(decode_base64(text.trim_end_matches('=')).unwrap(), bytes.as_bytes());
        }
        // All digits in their order: the numbers from 0 to 63, six bits each.
        let digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let bits = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:08b}")).collect::<String>();
        let expected: String = (0..64).map(|number| format!("{number:06b}")).collect();
        assert_eq!(bits(&decode_base64(digits).unwrap()), expected);
        for wrong in ["TW?u", "TW-u", "TW_u", "T=Wu", "TW u", "TW@u", "TW[u", "TW`u", "TW{u", "TW:u", "TW.u"]
        {
            assert!(decode_base64(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn percent_signs_encode_bytes_of_file_names() {
        for (uri, name) in [
            ("plain.bin", "plain.bin"),
            ("a%20b.bin", "a b.bin"),
            ("%C3%A9t%c3%a9", "\u{e9}t\u{e9}"),
            ("100%", "100%"),
            ("5%2", "5%2"),
            ("%zz%41", "%zzA"),
        ] {
            assert_eq!(decode_percent(uri), name);
        }
    }

    /// Number of vertices in [`vertices`]: more than 16 bits can count.
    const VERTICES: u32 = 0x1_0300;

    /// A buffer of positions (i, 2 i, 3 i) and normals (0, i, 0), each pair followed by four bytes of something else,
    /// and the indices.
    fn vertices(indices: &[u8]) -> Vec<u8> {
        let vertex = |i: u32| {
            let i = i as f32;
            [i, 2.0 * i, 3.0 * i, 0.0, i, 0.0, f32::NAN].map(f32::to_le_bytes).concat()
        };
        (0..VERTICES).flat_map(vertex).chain(indices.iter().copied()).collect()
    }

    /// The shapes of a file with one primitive: members of its JSON object, bytes of its indices, and the JSON of their
    /// accessor.
    fn shapes(primitive: &str, indices: &[u8], accessor: &str, count: u32) -> Vec<Shape> {
        let buffer = vertices(indices);
        let (stride, first) = (28, 28 * VERTICES);
        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "NORMAL": 1}}{primitive}}}]}}],
            "accessors": [
                {{"bufferView": 0, "componentType": 5126, "count": {count}, "type": "VEC3",
                    "min": [0, 0, 0], "max": [1, 2, 3]}},
                {{"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": {count}, "type": "VEC3"}},
                {{"bufferView": 1, "byteOffset": 4, "type": "SCALAR", {accessor}}}],
            "bufferViews": [
                {{"buffer": 0, "byteLength": {first}, "byteStride": {stride}}},
                {{"buffer": 0, "byteOffset": {}, "byteLength": {}}}],
            "buffers": [{{"byteLength": {}, "uri": "a.bin"}}]}}"#,
            first - 4,
            indices.len() + 4,
            buffer.len(),
        );
        let model = read(json.as_bytes(), |_| Ok(buffer.clone())).unwrap();
        model.parts.into_iter().map(|(shape, _)| shape).collect()
    }

    /// What the program itself writes of parts that repeat.
    #[test]
    fn instances_of_our_own_files() {
        use epigraph_streams::repeats::{Settings, Surface, find};
        let wedge = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from);
        let copy = |angle, by: Vec3| wedge.map(|at| Quat::from_rotation_y(angle) * at + by);
        let positions = [wedge, copy(1.0, Vec3::X * 9.0), copy(-2.0, Vec3::Y * 9.0)].concat();
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let of_part = |part: u32| faces.map(|corners| corners.map(|corner: u32| corner + 4 * part));
        let triangles: Vec<[u32; 3]> = (0..3).flat_map(of_part).collect();
        let surface = Surface { positions: &positions, triangles: &triangles, ..Surface::default() };
        let found = find(&surface, &Settings::default()).unwrap();
        let model = read(&found.repeats.to_glb(&[]).unwrap(), |_| unreachable!()).unwrap();
        assert_eq!(model.parts.len(), 3);
        for (part, (shape, _)) in model.parts.iter().enumerate() {
            let expected = &positions[4 * part..][..4];
            assert_eq!((shape.positions.len(), shape.triangles.len()), (4, 4));
            for at in expected {
                assert!(shape.positions.iter().any(|found| found.distance(*at) < 1e-4), "{part}: {at}");
            }
        }
    }

    /// A triangle at places whose numbers are after its vertices. `attributes` and `accessors` describe them.
    fn instanced(numbers: &[u8], attributes: &str, accessors: &str) -> Result<Vec<Shape>, String> {
        let corners: Vec<u8> =
            [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0].into_iter().flat_map(f32::to_le_bytes).collect();
        let buffer = [&corners, numbers].concat();
        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, "extensionsRequired": ["{INSTANCING}"],
            "nodes": [{{"mesh": 0, "translation": [0, 0, 5], "extensions": {{"{INSTANCING}": {{"attributes": {{{attributes}}}}}}}}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
            "accessors": [
                {{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 2, 0]}}
                {accessors}],
            "bufferViews": [
                {{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": {}}}],
            "buffers": [{{"byteLength": {}, "uri": "a.bin"}}]}}"#,
            numbers.len(),
            buffer.len(),
        );
        let model = read(json.as_bytes(), |_| Ok(buffer.clone()))?;
        Ok(model.parts.into_iter().map(|(shape, _)| shape).collect())
    }

    #[test]
    fn instances_are_scaled_turned_and_moved_in_this_order() {
        // A quarter turn around z as shorts, then twice the size, then a step along x.
        let half = (32767.0 * 0.5f32.sqrt()).round() as i16;
        let rotation: Vec<u8> = [0, 0, half, half].into_iter().flat_map(i16::to_le_bytes).collect();
        let floats = |all: &[f32]| all.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
        let numbers = [rotation, floats(&[2.0, 2.0, 2.0]), floats(&[10.0, 0.0, 0.0])].concat();
        let shapes = instanced(
            &numbers,
            r#""ROTATION": 1, "SCALE": 2, "TRANSLATION": 3"#,
            r#", {"bufferView": 1, "componentType": 5122, "normalized": true, "count": 1, "type": "VEC4"},
               {"bufferView": 1, "byteOffset": 8, "componentType": 5126, "count": 1, "type": "VEC3"},
               {"bufferView": 1, "byteOffset": 20, "componentType": 5126, "count": 1, "type": "VEC3"}"#,
        )
        .unwrap();
        let expected = [[10.0, 0.0, 5.0], [10.0, 2.0, 5.0], [6.0, 0.0, 5.0]].map(Vec3::from);
        assert_eq!(shapes.len(), 1);
        assert!(
            shapes[0].positions.iter().zip(expected).all(|(found, at)| found.distance(at) < 1e-4),
            "{shapes:?}"
        );
    }

    #[test]
    fn instances_that_do_not_fit_are_errors() {
        let two = r#", {"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 1, "type": "VEC4"},
            {"bufferView": 1, "componentType": 5126, "count": 9, "type": "VEC3"}"#;
        let ones: Vec<u8> = [1.0f32; 6].into_iter().flat_map(f32::to_le_bytes).collect();
        for (attributes, expected) in [
            (r#""TRANSLATION": 1, "ROTATION": 2"#, "different numbers"),
            (r#""TRANSLATION": 7"#, "accessor 7, which does not exist"),
            (r#""TRANSLATION": -1"#, "accessor -1, which does not exist"),
            (r#""TRANSLATION": 3"#, "reaches beyond its buffer"),
            (r#""ROTATION": 1"#, "four floats, signed bytes or shorts"),
            ("", "no TRANSLATION, ROTATION or SCALE"),
        ] {
            let error = instanced(&ones, attributes, two).unwrap_err();
            assert!(error.contains("node 0, EXT_mesh_gpu_instancing") && error.contains(expected), "{error}");
        }
        let none = instanced(&[0; 24], r#""ROTATION": 2"#, two).unwrap_err();
        assert!(none.contains("rotation 0 is [0, 0, 0, 0], which is no direction"), "{none}");
        assert_eq!(instanced(&ones, r#""SCALE": 1"#, two).unwrap().len(), 2);
    }

    /// Triangles that begin with their lowest vertex.
    fn turned(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
        let lowest_first = |t: &[u32; 3]| {
            let lowest = (0..3).min_by_key(|&corner| t[corner]).unwrap_or(0);
            [0, 1, 2].map(|corner| t[(lowest + corner) % 3])
        };
        triangles.iter().map(lowest_first).collect()
    }

    #[test]
    fn triangles_strips_and_fans() {
        let strip = [[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]];
        let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
        let list = [[0, 1, 2], [3, 4, 5]];
        for (mode, count, expected) in [
            ("", 6, &list[..]),
            (r#", "mode": 4"#, 6, &list),
            (r#", "mode": 4"#, 8, &list),
            (r#", "mode": 4"#, 5, &list[..1]),
            (r#", "mode": 5"#, 6, &strip),
            (r#", "mode": 5"#, 3, &strip[..1]),
            (r#", "mode": 5"#, 2, &[]),
            (r#", "mode": 6"#, 6, &fan),
            (r#", "mode": 6"#, 3, &fan[..1]),
            (r#", "mode": 6"#, 1, &[]),
        ] {
            let [shape] = &shapes(mode, &[0; 8], r#""componentType": 5121, "count": 1"#, count)[..] else {
                panic!("one primitive, one shape")
            };
            assert_eq!(turned(&shape.triangles), expected, "{mode} of {count} vertices");
            assert_eq!(shape.positions.len(), count as usize);
        }
        for points_or_lines in 0..4 {
            let mode = format!(r#", "mode": {points_or_lines}"#);
            assert!(shapes(&mode, &[0; 8], r#""componentType": 5121, "count": 1"#, 6).is_empty());
        }
    }

    #[test]
    fn vertices_are_found_by_indices_of_any_type() {
        let bytes = |list: &[u32], size: usize| -> Vec<u8> {
            list.iter().flat_map(|index| index.to_le_bytes()[..size].to_vec()).collect()
        };
        for (kind, size, list) in [
            (5121, 1, [0xFE, 3, 2]),
            (5123, 2, [0xFFFE, 0x0102, 0x0201]),
            (5125, 4, [0x1_0203, 0x0102, 0x1_0001]),
        ] {
            let accessor = format!(r#""componentType": {kind}, "count": 3"#);
            let [shape] = &shapes(r#", "indices": 2"#, &bytes(&list, size), &accessor, VERTICES)[..] else {
                panic!("one primitive, one shape")
            };
            assert_eq!(shape.triangles, [list]);
            let at = |index: u32| shape.positions[index as usize];
            assert!(list.iter().all(|&i| at(i) == i as f32 * Vec3::new(1.0, 2.0, 3.0)));
            assert_eq!(shape.normals, [[Vec3::Y; 3]]);
        }
    }

    #[test]
    fn the_default_scene_or_the_first_or_all_nodes() {
        // Node 1 is a child of node 0. Each node's mesh is one triangle at the place of the node.
        let nodes = r#""nodes": [
            {"mesh": 0, "translation": [10, 0, 0], "children": [1]},
            {"mesh": 0, "matrix": [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 1, 0, 0, 5, 0, 1]},
            {"mesh": 0, "rotation": [0, 0, 1, 0]}],"#;
        let start = JSON.find("\"scene\": 0").unwrap();
        let end = JSON.find("\"cameras\"").unwrap();
        let (parent, child, other) =
            (Vec3::new(12.0, 0.0, 0.0), Vec3::new(10.0, 9.0, 0.0), Vec3::new(-2.0, 0.0, 0.0));
        for (scenes, expected) in [
            (r#""scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [2]}],"#, &[other][..]),
            (r#""scenes": [{"nodes": [0]}, {"nodes": [2]}],"#, &[parent, child]),
            (r#""scenes": [{"nodes": [2, 0]}],"#, &[other, parent, child]),
            ("", &[parent, child, other]),
        ] {
            let json = format!("{}{scenes}{nodes}{}", &JSON[..start], &JSON[end..]);
            let model = read(&glb(&json), no_files).unwrap();
            // The second vertex is at x = 2.
            let found: Vec<Vec3> = model.parts.iter().map(|(shape, _)| shape.positions[1]).collect();
            let near = found.iter().zip(expected).all(|(a, b)| a.distance(*b) < 1e-5);
            assert!(near && found.len() == expected.len(), "{scenes}: {found:?}");
        }
    }

    #[test]
    fn metals_and_dielectrics() {
        let of = |members: &str| {
            let from = r#""pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0}"#;
            assert!(JSON.contains(from));
            let model = read(&glb(&JSON.replacen(from, members, 1)), no_files).unwrap();
            let Material { color, surface, emission, .. } = model.materials[0].clone();
            (color, surface, emission)
        };
        let pbr = |metallic: f32, roughness: f32| {
            let factors = format!(r#""metallicFactor": {metallic}, "roughnessFactor": {roughness}"#);
            let (color, surface, _) = of(&format!(
                r#""pbrMetallicRoughness": {{"baseColorFactor": [0.5, 0.8, 0.2, 1], {factors}}}"#
            ));
            (color, surface)
        };
        let base = Vec3::new(0.5, 0.8, 0.2);
        let glossy = |roughness, f0| Surface::Glossy { roughness, f0 };
        for (metallic, roughness, factor, surface) in [
            (0.0, 1.0, 1.0, Surface::Diffuse),
            (0.0, 0.6, 1.0, Surface::Diffuse),
            (0.0, 0.59, 1.0, glossy(0.59, 0.04)),
            (0.0, 0.0, 1.0, glossy(0.02, 0.04)),
            (1.0, 0.0, 1.0, Surface::Mirror),
            (1.0, 0.07, 1.0, Surface::Mirror),
            (1.0, 0.08, 0.5, glossy(0.08, 0.8)),
            (1.0, 1.0, 0.5, glossy(1.0, 0.8)),
            (0.5, 0.05, 0.75, glossy(0.05, 0.42)),
            (0.5, 0.7, 0.75, Surface::Diffuse),
        ] {
            let found = pbr(metallic, roughness);
            let alike = match (found.1, surface) {
                (Surface::Glossy { roughness: r, f0: f }, Surface::Glossy { roughness, f0 }) => {
                    r == roughness && (f - f0).abs() < 1e-6
                }
                (found, expected) => found == expected,
            };
            assert!(alike && found.0.distance(factor * base) < 1e-6, "{metallic}, {roughness}: {found:?}");
        }
        let emissive = r#""emissiveFactor": [1, 0.5, 0]"#;
        let strong = r#""extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}"#;
        assert_eq!(of(emissive).2, Vec3::new(1.0, 0.5, 0.0));
        assert_eq!(of(&format!("{emissive}, {strong}")).2, Vec3::new(8.0, 4.0, 0.0));
        let masked = format!(
            r#"{emissive}, "emissiveTexture": {{"index": 0}}}}],
            "images": [{{"uri": "a.png"}}], "textures": [{{"source": 0}}], "samplers": [{{"#
        );
        assert_eq!(of(&masked).2, Vec3::ZERO, "what the texture would show is not known");
    }
}
