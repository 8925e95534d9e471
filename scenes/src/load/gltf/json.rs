//! The JSON of a glTF file, as far as it is read. Damage in what a picture can do without does not refuse the file.

use gltf::json::deserialize::from_value;
use gltf::json::{Accessor, Buffer, Camera, Mesh, Skin, Value, buffer};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};

/// An object of extensions by name.
pub(super) type Extensions = std::collections::BTreeMap<String, Value>;

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Root {
    #[serde(default)]
    pub accessors: Vec<Accessor>,
    #[serde(default)]
    pub animations: Vec<Named>,
    #[serde(default)]
    pub buffers: Vec<Buffer>,
    #[serde(default)]
    pub buffer_views: Vec<buffer::View>,
    #[serde(default)]
    pub cameras: Vec<Lenient<Camera>>,
    #[serde(default)]
    pub extensions: Extensions,
    #[serde(default)]
    pub extensions_required: Vec<String>,
    #[serde(default)]
    pub extensions_used: Vec<String>,
    #[serde(default)]
    pub images: Vec<Lenient<Image>>,
    #[serde(default)]
    pub materials: Vec<Lenient<Material>>,
    #[serde(default)]
    pub meshes: Vec<Mesh>,
    #[serde(default)]
    pub nodes: Vec<Node>,
    #[serde(default)]
    pub samplers: Vec<Lenient<Sampler>>,
    pub scene: Option<usize>,
    #[serde(default)]
    pub scenes: Vec<Scene>,
    #[serde(default)]
    pub skins: Vec<Skin>,
    #[serde(default)]
    pub textures: Vec<Lenient<Texture>>,
}

/// Looked at before the rest, which depends on the version.
#[derive(Debug, Deserialize)]
pub(super) struct Head {
    pub asset: Asset,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Asset {
    pub version: String,
    pub min_version: Option<String>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Named {
    #[serde(default)]
    pub name: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub nodes: Vec<usize>,
}

/// The gltf crate has transforms in f32, which resolve half a metre at the coordinates of a map.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub name: String,
    pub children: Vec<usize>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    pub mesh: Option<usize>,
    pub skin: Option<usize>,
    pub camera: Option<usize>,
    pub weights: Option<Vec<f32>>,
    pub extensions: Extensions,
}

/// A light of `KHR_lights_punctual`.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Light {
    #[serde(rename = "type")]
    pub kind: String,
    #[serde(default = "white")]
    pub color: [f32; 3],
    #[serde(default = "one")]
    pub intensity: f32,
    pub range: Option<f32>,
    pub spot: Option<Spot>,
}

/// The angles of a spot's cone, radians.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Spot {
    #[serde(default)]
    pub inner_cone_angle: f32,
    pub outer_cone_angle: Option<f32>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Image {
    pub name: String,
    pub uri: Option<String>,
    pub buffer_view: Option<usize>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Sampler {
    pub mag_filter: Option<u32>,
    pub wrap_s: Option<u32>,
    pub wrap_t: Option<u32>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Texture {
    pub sampler: Option<usize>,
    pub source: Option<usize>,
    pub extensions: Extensions,
}

/// A material's reference to a texture.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub index: usize,
    #[serde(default)]
    pub tex_coord: u32,
    /// Of a normal map's slopes.
    #[serde(default = "one")]
    pub scale: f32,
    #[serde(default)]
    pub extensions: Extensions,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Material {
    pub name: String,
    pub pbr_metallic_roughness: MetallicRoughness,
    pub normal_texture: Option<TextureInfo>,
    pub occlusion_texture: Option<TextureInfo>,
    pub emissive_texture: Option<TextureInfo>,
    pub emissive_factor: [f32; 3],
    pub alpha_mode: String,
    pub alpha_cutoff: f32,
    pub double_sided: bool,
    pub extensions: Extensions,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            pbr_metallic_roughness: MetallicRoughness::default(),
            normal_texture: None,
            occlusion_texture: None,
            emissive_texture: None,
            emissive_factor: [0.0; 3],
            alpha_mode: "OPAQUE".to_owned(),
            alpha_cutoff: 0.5,
            double_sided: false,
            extensions: Extensions::new(),
        }
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct MetallicRoughness {
    pub base_color_factor: [f32; 4],
    pub base_color_texture: Option<TextureInfo>,
    pub metallic_factor: f32,
    pub roughness_factor: f32,
    pub metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for MetallicRoughness {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

/// `KHR_texture_transform`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct TextureTransform {
    pub offset: [f32; 2],
    pub rotation: f32,
    pub scale: [f32; 2],
    pub tex_coord: Option<u32>,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

/// `KHR_materials_emissive_strength`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct EmissiveStrength {
    #[serde(default = "one")]
    pub emissive_strength: f32,
}

/// `KHR_materials_ior`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default)]
pub(super) struct Ior {
    pub ior: f32,
}

impl Default for Ior {
    fn default() -> Self {
        Self { ior: 1.5 }
    }
}

/// `KHR_materials_specular`.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Specular {
    pub specular_factor: f32,
    pub specular_texture: Option<TextureInfo>,
    pub specular_color_factor: [f32; 3],
    pub specular_color_texture: Option<TextureInfo>,
}

impl Default for Specular {
    fn default() -> Self {
        Self {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: [1.0; 3],
            specular_color_texture: None,
        }
    }
}

/// `KHR_materials_transmission`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Transmission {
    pub transmission_factor: f32,
    pub transmission_texture: Option<TextureInfo>,
}

/// `KHR_materials_volume`.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Volume {
    pub thickness_factor: f32,
    pub attenuation_distance: f32,
    pub attenuation_color: [f32; 3],
}

impl Default for Volume {
    fn default() -> Self {
        Self { thickness_factor: 0.0, attenuation_distance: f32::INFINITY, attenuation_color: [1.0; 3] }
    }
}

/// `KHR_materials_pbrSpecularGlossiness`.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct SpecularGlossiness {
    pub diffuse_factor: [f32; 4],
    pub diffuse_texture: Option<TextureInfo>,
    pub specular_factor: [f32; 3],
    pub glossiness_factor: f32,
    pub specular_glossiness_texture: Option<TextureInfo>,
}

impl Default for SpecularGlossiness {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

fn one() -> f32 {
    1.0
}

/// An object of an array, or `None` if it is not what it should be.
#[derive(Debug)]
pub(super) struct Lenient<T>(pub Option<T>);

impl<'de, T: DeserializeOwned> Deserialize<'de> for Lenient<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self(from_value(Value::deserialize(deserializer)?).ok()))
    }
}

/// The name of an object, or its kind and index if it has none.
pub(super) fn name_of(name: Option<&str>, kind: &str, index: usize) -> String {
    match name {
        Some(name) if !name.is_empty() => name.to_owned(),
        _ => format!("{kind} {index}"),
    }
}
