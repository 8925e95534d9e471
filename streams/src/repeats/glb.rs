//! Shapes and instances as a glTF file: `EXT_mesh_gpu_instancing` draws all copies of a shape by one call.

use epigraph_files::{FileError, Target};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::shape::{Instance, Repeats, Shape};
use crate::{NO_NORMAL, unpack_normal};

const INSTANCING: &str = "EXT_mesh_gpu_instancing";
const EMISSIVE: &str = "KHR_materials_emissive_strength";

// Numbers of the glTF specification.
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// A material of the metallic-roughness model.
#[derive(Clone, Debug, PartialEq)]
pub struct GlbMaterial {
    /// Its name; may be empty.
    pub name: String,
    /// Linear colour, and alpha; each 0 to 1.
    pub color: [f32; 4],
    /// 0 to 1.
    pub metallic: f32,
    /// 0 to 1.
    pub roughness: f32,
    /// Linear; 0 or more.
    pub emission: [f32; 3],
}

/// Why there is no glTF file of shapes and instances.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GlbError {
    /// An instance has a material that is not in the list.
    #[error("an instance has material {material}, but there are only {count} materials")]
    Material {
        /// The material by its index.
        material: u32,
        /// The number of materials.
        count: usize,
    },
    /// The file would be too long for its header.
    #[error("the glTF file would have {0} bytes, more than the 4 GiB of a binary one")]
    TooLong(usize),
}

impl Repeats {
    /// The surface as a binary glTF 2.0 file. Each shape is a mesh, once for each material; a mesh with several
    /// instances is one node with `EXT_mesh_gpu_instancing`, which readers must support. Instances name materials by
    /// their index in the list; with an empty list, none has a material.
    ///
    /// Shapes with a vertex that has no normal are written without normals: readers then compute flat ones.
    ///
    /// # Errors
    /// An instance has a material that is not in a list that is not empty, or the file is longer than 4 GiB.
    pub fn to_glb(&self, materials: &[GlbMaterial]) -> Result<Vec<u8>, GlbError> {
        let mut file = File::default();
        for (shape, instances) in self.instances_by_shape() {
            let attributes = file.attributes(shape);
            let indices = file.indices(shape);
            let mut instances = instances.to_vec();
            instances.sort_by_key(|instance| instance.material);
            for alike in instances.chunk_by(|a, b| a.material == b.material) {
                let mut primitive = json!({ "attributes": attributes, "indices": indices });
                if let Some(material) = alike[0].material.filter(|_| !materials.is_empty()) {
                    if material as usize >= materials.len() {
                        return Err(GlbError::Material { material, count: materials.len() });
                    }
                    primitive["material"] = material.into();
                }
                file.meshes.push(json!({ "primitives": [primitive] }));
                file.node(alike);
            }
        }
        file.finish(self.origin, materials)
    }

    /// Writes [`Repeats::to_glb`] to a file, whole or not at all.
    ///
    /// # Errors
    /// As [`Repeats::to_glb`], or the system's error; the message names the file.
    pub fn write_glb(&self, materials: &[GlbMaterial], target: &Target) -> Result<(), FileError> {
        let bytes = self.to_glb(materials).map_err(|error| FileError::write(target.path(), error))?;
        target.write(&bytes)
    }
}

/// A file while it is made.
#[derive(Default)]
struct File {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    instancing: bool,
}

impl File {
    /// Appends numbers, and returns their accessor. `target` says what a vertex shader reads them as.
    fn accessor(&mut self, bytes: &[u8], kind: u32, shape: &str, count: usize, target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.views.push(view);
        self.binary.extend(bytes);
        pad(&mut self.binary, 0);
        let view = self.views.len() - 1;
        self.accessors
            .push(json!({ "bufferView": view, "componentType": kind, "count": count, "type": shape }));
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]], target: Option<u32>) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, FLOAT, &format!("VEC{N}"), values.len(), target)
    }

    /// The accessors of a shape's vertices.
    fn attributes(&mut self, shape: &Shape) -> Value {
        let positions: Vec<Vec3> = shape.positions().collect();
        let bounds = positions
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &at| (low.min(at), high.max(at)));
        let arrays: Vec<[f32; 3]> = positions.iter().map(Vec3::to_array).collect();
        let position = self.floats(&arrays, Some(ARRAY_BUFFER));
        self.accessors[position]["min"] = json!(bounds.0.to_array());
        self.accessors[position]["max"] = json!(bounds.1.to_array());
        let mut attributes = json!({ "POSITION": position });
        if let Some(normals) = shape.normals().filter(|normals| !normals.contains(&NO_NORMAL)) {
            let normals: Vec<[f32; 3]> =
                normals.iter().map(|&normal| unpack_normal(normal).to_array()).collect();
            attributes["NORMAL"] = self.floats(&normals, Some(ARRAY_BUFFER)).into();
        }
        if let Some(colors) = shape.colors() {
            let bytes: Vec<u8> =
                colors.iter().flat_map(|&color| linear(color)).flat_map(u16::to_le_bytes).collect();
            let accessor = self.accessor(&bytes, UNSIGNED_SHORT, "VEC4", colors.len(), Some(ARRAY_BUFFER));
            self.accessors[accessor]["normalized"] = true.into();
            attributes["COLOR_0"] = accessor.into();
        }
        attributes
    }

    /// The accessor of a shape's triangles.
    fn indices(&mut self, shape: &Shape) -> usize {
        let corners = shape.triangles().iter().flatten();
        // The largest number of 16 bits is not an index: it restarts strips.
        let (bytes, kind): (Vec<u8>, u32) = if shape.vertex_count() <= usize::from(u16::MAX) {
            (corners.flat_map(|&vertex| (vertex as u16).to_le_bytes()).collect(), UNSIGNED_SHORT)
        } else {
            (corners.flat_map(|vertex| vertex.to_le_bytes()).collect(), UNSIGNED_INT)
        };
        self.accessor(&bytes, kind, "SCALAR", 3 * shape.triangles().len(), Some(ELEMENT_ARRAY_BUFFER))
    }

    /// A node with the last mesh at the places of instances.
    fn node(&mut self, instances: &[Instance]) {
        let mesh = self.meshes.len() - 1;
        if let [instance] = instances {
            let (rotation, translation) = (instance.rotation.to_array(), instance.translation.to_array());
            self.nodes.push(json!({ "mesh": mesh, "rotation": rotation, "translation": translation }));
            return;
        }
        self.instancing = true;
        let translations: Vec<[f32; 3]> =
            instances.iter().map(|instance| instance.translation.to_array()).collect();
        let rotations: Vec<[f32; 4]> =
            instances.iter().map(|instance| instance.rotation.to_array()).collect();
        let translations = self.floats(&translations, None);
        let rotations = self.floats(&rotations, None);
        let attributes = json!({ "TRANSLATION": translations, "ROTATION": rotations });
        self.nodes.push(json!({ "mesh": mesh, "extensions": { INSTANCING: { "attributes": attributes } } }));
    }

    /// The bytes of the file: a header, and a chunk each for the description and for the numbers.
    fn finish(mut self, origin: DVec3, materials: &[GlbMaterial]) -> Result<Vec<u8>, GlbError> {
        let mut roots: Vec<usize> = (0..self.nodes.len()).collect();
        if origin != DVec3::ZERO {
            // Numbers of the description are doubles.
            self.nodes.push(json!({ "translation": origin.to_array(), "children": roots }));
            roots = vec![self.nodes.len() - 1];
        }
        let mut root = json!({
            "asset": { "version": "2.0", "generator": "Epigraph" },
            "scene": 0,
            "scenes": [{ "nodes": roots }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.binary.len() }],
        });
        let strong = materials.iter().any(|material| strength(material) > 1.0);
        let used: Vec<&str> = [(self.instancing, INSTANCING), (strong, EMISSIVE)]
            .into_iter()
            .filter(|used| used.0)
            .map(|used| used.1)
            .collect();
        if !used.is_empty() {
            root["extensionsUsed"] = json!(used);
        }
        if self.instancing {
            // Without it, readers would show one copy of each shape, at the origin.
            root["extensionsRequired"] = json!([INSTANCING]);
        }
        if !materials.is_empty() {
            root["materials"] = materials.iter().map(described).collect();
        }
        let mut text = root.to_string().into_bytes();
        pad(&mut text, b' ');
        let length = 12 + 8 + text.len() + 8 + self.binary.len();
        let Ok(total) = u32::try_from(length) else { return Err(GlbError::TooLong(length)) };
        let mut bytes = Vec::with_capacity(length);
        bytes.extend(b"glTF");
        bytes.extend([2, total].iter().flat_map(|word| word.to_le_bytes()));
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.binary)] {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(chunk);
        }
        Ok(bytes)
    }
}

/// Chunks, and numbers of up to 4 bytes, begin at multiples of 4.
fn pad(bytes: &mut Vec<u8>, with: u8) {
    bytes.resize(bytes.len().next_multiple_of(4), with);
}

/// An sRGB colour as 16 bits of linear light, which is what glTF multiplies the material's colour with.
fn linear([red, green, blue, alpha]: [u8; 4]) -> [u16; 4] {
    // IEC 61966-2-1.
    let light = |byte: u8| {
        let srgb = f32::from(byte) / 255.0;
        let linear = if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) };
        (linear * 65535.0).round() as u16
    };
    [light(red), light(green), light(blue), u16::from(alpha) * 257]
}

/// The factor by which emission exceeds the 1 that glTF itself has.
fn strength(material: &GlbMaterial) -> f32 {
    material.emission.into_iter().fold(0.0, f32::max)
}

fn described(material: &GlbMaterial) -> Value {
    let GlbMaterial { name, color, metallic, roughness, emission } = material;
    let strength = strength(material).max(1.0);
    let mut described = json!({
        "name": name,
        "pbrMetallicRoughness": { "baseColorFactor": color, "metallicFactor": metallic, "roughnessFactor": roughness },
        "emissiveFactor": emission.map(|channel| channel / strength),
    });
    if strength > 1.0 {
        described["extensions"] = json!({ EMISSIVE: { "emissiveStrength": strength } });
    }
    described
}
