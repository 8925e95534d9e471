//! Materials, as they are before their images are read.

use glam::{Affine2, Mat2, Vec2, Vec3};
use gltf::json::deserialize::from_value;
use serde::de::DeserializeOwned;

use super::json::{
    self, EmissiveStrength, Extensions, Ior, Lenient, Root, Specular, SpecularGlossiness, TextureInfo,
    TextureTransform, Transmission, Volume, name_of,
};
use super::textures::metallic;
use crate::limits::{MAX_RADIANCE, is_radiance};
use crate::{Alpha, DIELECTRIC_F0, Map, Maps, Material, Medium, NoteKind, Report, Wrap, f0_of_ior};

pub(super) const EMISSIVE_STRENGTH: &str = "KHR_materials_emissive_strength";
pub(super) const IOR: &str = "KHR_materials_ior";
pub(super) const SPECULAR: &str = "KHR_materials_specular";
pub(super) const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";
pub(super) const TRANSMISSION: &str = "KHR_materials_transmission";
pub(super) const UNLIT: &str = "KHR_materials_unlit";
pub(super) const VOLUME: &str = "KHR_materials_volume";
pub(super) const TEXTURE_TRANSFORM: &str = "KHR_texture_transform";
pub(super) const WEBP: &str = "EXT_texture_webp";

/// Attenuation colours below this absorb as much as this one, within the attenuation distance.
const DARKEST: f32 = 1e-4;

/// A material whose maps name images of the file.
#[derive(Clone, Debug)]
pub(super) struct Described {
    /// The texture of a map is an index into the file's images.
    pub material: Material,
    /// The numbers of the attributes `TEXCOORD_n` that are the mesh's two sets of texture coordinates.
    pub uv_sets: Vec<u32>,
    /// How to make maps of the images of a specular-glossiness material.
    pub glossiness: Option<Glossiness>,
    notes: Report,
}

/// What is needed to convert the images of a specular-glossiness material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glossiness {
    pub diffuse: Vec3,
    pub specular: Vec3,
    pub glossiness: f32,
    /// Of specular colour and glossiness. Its texture is an image.
    pub map: Map,
}

impl Described {
    /// All materials of a file.
    pub fn all(root: &Root) -> Vec<Self> {
        root.materials.iter().enumerate().map(|(index, material)| Self::new(root, index, material)).collect()
    }

    /// Notes what its material has that is not used.
    pub fn note(&self, report: &mut Report) {
        report.extend(&self.notes);
    }

    fn new(root: &Root, index: usize, material: &Lenient<json::Material>) -> Self {
        let plain = json::Material::default();
        let own = material.0.as_ref();
        let name = name_of(own.map(|material| material.name.as_str()), "material", index);
        let mut reader = Reader { root, name: &name, uv_sets: vec![], notes: Report::default() };
        if own.is_none() {
            reader.note(NoteKind::LeftOut, "a material that is not valid");
        }
        let (material, glossiness) = reader.material(own.unwrap_or(&plain));
        let Reader { uv_sets, notes, .. } = reader;
        Self { material, uv_sets, glossiness, notes }
    }
}

/// Reads one material.
struct Reader<'a> {
    root: &'a Root,
    name: &'a str,
    uv_sets: Vec<u32>,
    notes: Report,
}

impl Reader<'_> {
    fn note(&mut self, kind: NoteKind, what: impl Into<String>) {
        self.notes.add(kind, what, self.name);
    }

    /// An extension of the material, if it has it.
    fn extension<T: DeserializeOwned>(&mut self, extensions: &Extensions, name: &str) -> Option<T> {
        let value = extensions.get(name)?;
        let read = from_value(value.clone()).ok();
        if read.is_none() {
            self.note(NoteKind::LeftOut, format!("the extension {name}, which is not valid"));
        }
        read
    }

    fn material(&mut self, material: &json::Material) -> (Material, Option<Glossiness>) {
        let pbr = &material.pbr_metallic_roughness;
        let extensions = &material.extensions;
        let share = |factor: f32| factor.clamp(0.0, 1.0);
        let [r, g, b, opacity] = pbr.base_color_factor.map(share);
        let color = self.map(pbr.base_color_texture.as_ref(), "a base colour texture");
        let mixed = self.map(pbr.metallic_roughness_texture.as_ref(), "a metallic-roughness texture");
        let alpha = match material.alpha_mode.as_str() {
            "MASK" => Alpha::Mask(material.alpha_cutoff),
            "BLEND" => Alpha::Blend,
            "OPAQUE" => Alpha::Opaque,
            _ => {
                self.note(NoteKind::LeftOut, "an unknown alpha mode");
                Alpha::Opaque
            }
        };
        let opaque = alpha == Alpha::Opaque;
        let mut read = Material {
            opacity,
            alpha,
            metallic: share(pbr.metallic_factor),
            double_sided: material.double_sided,
            unlit: extensions.contains_key(UNLIT),
            maps: Maps {
                color,
                opacity: color.filter(|_| !opaque).map(|map| map.of_channel(3)),
                metallic: mixed.map(|map| map.of_channel(2)),
                roughness: mixed.map(|map| map.of_channel(1)),
                ..Maps::default()
            },
            ..Material::glossy(&material.name, Vec3::new(r, g, b), share(pbr.roughness_factor), 0.0)
        };
        read.maps.normal = material.normal_texture.as_ref().and_then(|info| {
            let map = self.map(Some(info), "a normal texture")?;
            Some((map, info.scale))
        });
        if material.occlusion_texture.is_some() {
            self.note(NoteKind::LeftOut, "an occlusion texture, as light is traced");
        }
        self.emission(material, &mut read);
        self.dielectric(extensions, &mut read);
        // Light leaves a body through the backs of its surface.
        read.culled = !material.double_sided && read.transmission == 0.0;
        let glossiness = self
            .extension::<SpecularGlossiness>(extensions, SPECULAR_GLOSSINESS)
            .and_then(|glossy| self.glossiness(&glossy, &mut read));
        (read, glossiness)
    }

    fn emission(&mut self, material: &json::Material, read: &mut Material) {
        let strength = self.extension::<EmissiveStrength>(&material.extensions, EMISSIVE_STRENGTH);
        let strength = strength.map_or(1.0, |strength| strength.emissive_strength);
        read.emission = (Vec3::from(material.emissive_factor) * strength).max(Vec3::ZERO);
        if !is_radiance(read.emission) {
            self.note(NoteKind::Repaired, format!("an emission beyond {MAX_RADIANCE:e}"));
            read.emission = read.emission.min(Vec3::splat(MAX_RADIANCE));
        }
        if read.emits() && material.emissive_texture.is_some() {
            read.maps.emission = self.map(material.emissive_texture.as_ref(), "an emissive texture");
            if read.maps.emission.is_none() {
                // What the texture would show is not known.
                read.emission = Vec3::ZERO;
            }
        }
    }

    /// What a surface that is no metal reflects and lets through.
    fn dielectric(&mut self, extensions: &Extensions, read: &mut Material) {
        let ior = self.extension::<Ior>(extensions, IOR).unwrap_or_default().ior;
        // The extension has 0 for a surface that reflects everything.
        let ior = if ior == 0.0 || ior >= 1.0 { ior } else { Ior::default().ior };
        let specular = self.extension::<Specular>(extensions, SPECULAR).unwrap_or_default();
        let tint = Vec3::from(specular.specular_color_factor);
        if tint != Vec3::splat(tint.x) {
            self.note(NoteKind::Approximated, "the colour of a dielectric's reflection, by grey");
        }
        for texture in [&specular.specular_texture, &specular.specular_color_texture] {
            if texture.is_some() {
                self.note(NoteKind::LeftOut, "a texture of a dielectric's reflection");
            }
        }
        let brightness = tint.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        read.f0 = ((f0_of_ior(ior) * brightness).min(1.0) * specular.specular_factor).clamp(0.0, 1.0);
        let Some(transmission) = self.extension::<Transmission>(extensions, TRANSMISSION) else { return };
        read.transmission = transmission.transmission_factor.clamp(0.0, 1.0);
        read.maps.transmission =
            self.map(transmission.transmission_texture.as_ref(), "a transmission texture");
        let volume = self.extension::<Volume>(extensions, VOLUME).unwrap_or_default();
        if volume.thickness_factor > 0.0 && read.transmission > 0.0 {
            let passes = Vec3::from(volume.attenuation_color).clamp(Vec3::splat(DARKEST), Vec3::ONE);
            let distance =
                if volume.attenuation_distance > 0.0 { volume.attenuation_distance } else { f32::INFINITY };
            let absorption = -passes.map(f32::ln) / distance;
            read.medium = Some(Medium { ior: ior.max(1.0), absorption });
        }
    }

    /// Converts a specular-glossiness material, apart from its images.
    fn glossiness(&mut self, glossy: &SpecularGlossiness, read: &mut Material) -> Option<Glossiness> {
        let [r, g, b, opacity] = glossy.diffuse_factor.map(|factor| factor.clamp(0.0, 1.0));
        let diffuse = Vec3::new(r, g, b);
        let specular = Vec3::from(glossy.specular_factor).clamp(Vec3::ZERO, Vec3::ONE);
        let glossiness = glossy.glossiness_factor.clamp(0.0, 1.0);
        let color = self.map(glossy.diffuse_texture.as_ref(), "a diffuse texture");
        let both = self.map(glossy.specular_glossiness_texture.as_ref(), "a specular-glossiness texture");
        read.opacity = opacity;
        read.maps.color = color;
        read.maps.opacity = color.filter(|_| read.alpha != Alpha::Opaque).map(|map| map.of_channel(3));
        read.roughness = 1.0 - glossiness;
        [read.maps.metallic, read.maps.roughness] = [None; 2];
        (read.color, read.metallic) = metallic(diffuse, specular);
        if read.metallic == 0.0 {
            read.f0 = specular.max_element().min(DIELECTRIC_F0);
        }
        both.map(|map| Glossiness { diffuse, specular, glossiness, map })
    }

    /// A texture, by what it is called if it cannot be used.
    fn map(&mut self, info: Option<&TextureInfo>, what: &str) -> Option<Map> {
        let info = info?;
        let mut leave_out = |why: &str| {
            self.notes.add(NoteKind::LeftOut, format!("{what}{why}"), self.name);
            None
        };
        let Some(Lenient(Some(texture))) = self.root.textures.get(info.index) else {
            return leave_out(" that does not exist");
        };
        let webp =
            texture.extensions.get(WEBP).and_then(|webp| webp.get("source")).and_then(|index| index.as_u64());
        let image = webp.and_then(|index| usize::try_from(index).ok()).or(texture.source);
        let Some(image) = image.filter(|&image| image < self.root.images.len()) else {
            return match texture.extensions.keys().next() {
                Some(extension) => leave_out(&format!(
                    " in the format of {extension}, which is not read: convert it to PNG or JPEG"
                )),
                None => leave_out(" without an image"),
            };
        };
        let transform = info.extensions.get(TEXTURE_TRANSFORM);
        let transform = transform.and_then(|value| from_value::<TextureTransform>(value.clone()).ok());
        let transform = transform.unwrap_or_default();
        let set = transform.tex_coord.unwrap_or(info.tex_coord);
        let uv_set = match self.uv_sets.iter().position(|known| *known == set) {
            Some(known) => known,
            None if self.uv_sets.len() < 2 => {
                self.uv_sets.push(set);
                self.uv_sets.len() - 1
            }
            None => return leave_out(" with a third set of coordinates"),
        };
        let sampler = texture.sampler.and_then(|index| self.root.samplers.get(index)?.0.as_ref());
        let wrap = |mode: Option<u32>| match mode {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let (sin, cos) = transform.rotation.sin_cos();
        let turned =
            Mat2::from_cols_array(&[cos, -sin, sin, cos]) * Mat2::from_diagonal(transform.scale.into());
        Some(Map {
            uv_set,
            transform: Affine2::from_mat2_translation(turned, Vec2::from(transform.offset)),
            wrap: [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)].map(wrap),
            nearest: sampler.and_then(|sampler| sampler.mag_filter) == Some(9728),
            ..Map::new(image)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::gltf::tests::{TEXTURES, textured};

    fn material(members: &str) -> Material {
        textured(members, TEXTURES).materials.remove(0)
    }

    fn with(extensions: &str) -> Material {
        material(&format!(r#""extensions": {{{extensions}}}"#))
    }

    #[test]
    fn factors_beyond_0_to_1_are_taken_as_the_nearest_one_within() {
        for (factor, expected) in [("-1", 0.0), ("0", 0.0), ("0.25", 0.25), ("1", 1.0), ("2", 1.0)] {
            let plain = material(&format!(
                r#""pbrMetallicRoughness": {{"baseColorFactor": [{factor}, {factor}, {factor}, {factor}],
                "metallicFactor": {factor}, "roughnessFactor": {factor}}}"#
            ));
            assert_eq!((plain.color, plain.opacity), (Vec3::splat(expected), expected), "{factor}");
            assert_eq!((plain.metallic, plain.roughness), (expected, expected), "{factor}");
            let clear = with(&format!(r#""{TRANSMISSION}": {{"transmissionFactor": {factor}}}"#));
            assert_eq!(clear.transmission, expected, "{factor}");
            // An index of 0 stands for a surface that reflects everything.
            let bright =
                with(&format!(r#""{IOR}": {{"ior": 0}}, "{SPECULAR}": {{"specularFactor": {factor}}}"#));
            assert_eq!(bright.f0, expected, "{factor}");
            let glossy = with(&format!(
                r#""{SPECULAR_GLOSSINESS}": {{"diffuseFactor": [{factor}, 0, 0, {factor}], "specularFactor": [0, 0, 0],
                "glossinessFactor": {factor}}}"#
            ));
            assert_eq!((glossy.opacity, glossy.roughness), (expected, 1.0 - expected), "{factor}");
            // The diffuse part of a dielectric is what it does not reflect.
            let red = (expected / (1.0 - DIELECTRIC_F0)).min(1.0);
            assert!(glossy.color.distance(red * Vec3::X) < 1e-6, "{factor}: {}", glossy.color);
        }
        // A colour of reflection beyond 1 makes no more of it than all.
        let tinted = r#"{"specularFactor": 0.5, "specularColorFactor": [1.5, 1.5, 1.5]}"#;
        assert_eq!(with(&format!(r#""{IOR}": {{"ior": 0}}, "{SPECULAR}": {tinted}"#)).f0, 0.5);
        let bright = material(r#""emissiveFactor": [0.5, 1e20, 2e18]"#);
        assert_eq!(bright.emission, Vec3::new(0.5, 1e18, 1e18));
    }

    #[test]
    fn indices_of_refraction_begin_with_that_of_nothing() {
        let f0 = |ior: &str| with(&format!(r#""{IOR}": {{"ior": {ior}}}"#)).f0;
        for (ior, expected) in
            [("0", 1.0), ("1", 0.0), ("1.5", 0.04), ("3", 0.25), ("0.5", 0.04), ("-1", 0.04)]
        {
            assert!((f0(ior) - expected).abs() < 1e-6, "{ior}: {}", f0(ior));
        }
    }

    #[test]
    fn light_is_absorbed_within_bodies_that_have_an_inside() {
        let medium = |transmission: &str, volume: &str| {
            let transmission = format!(r#""{TRANSMISSION}": {{"transmissionFactor": {transmission}}}"#);
            with(&format!(r#"{transmission}, "{VOLUME}": {{{volume}}}"#)).medium
        };
        let half = r#", "attenuationColor": [0.5, 0.5, 0.5]"#;
        for (transmission, thickness) in [("0", "1"), ("1", "0"), ("1", "-1")] {
            let volume = format!(r#""thicknessFactor": {thickness}"#);
            assert_eq!(medium(transmission, &volume), None, "{transmission} {thickness}");
        }
        for (distance, absorption) in [("0", 0.0), ("-1", 0.0), ("0.5", 2.0), ("1", 1.0), ("2", 0.5)] {
            let volume = format!(r#""thicknessFactor": 0.5, "attenuationDistance": {distance}{half}"#);
            let found = medium("0.5", &volume).unwrap();
            let expected = absorption * std::f32::consts::LN_2;
            assert!((found.absorption - expected).abs().max_element() < 1e-6, "{distance}: {found:?}");
        }
    }

    #[test]
    fn specular_and_glossiness_take_the_place_of_metal_and_roughness() {
        let of = |alpha: &str, members: &str| {
            material(&format!(
                r#""pbrMetallicRoughness": {{"baseColorFactor": [1, 1, 1, 0.75],
                "baseColorTexture": {{"index": 0, "texCoord": 1}}, "metallicRoughnessTexture": {{"index": 0}}}},
                "alphaMode": "{alpha}", "extensions": {{"{SPECULAR_GLOSSINESS}": {{{members}}}}}"#
            ))
        };
        let plain = of("BLEND", r#""diffuseFactor": [1, 1, 1, 0.25]"#);
        assert_eq!((plain.opacity, plain.maps), (0.25, Maps::default()));
        let diffuse = r#""diffuseTexture": {"index": 0}"#;
        let map = of("OPAQUE", diffuse).maps;
        assert_eq!((map.color.map(|map| map.channel), map.opacity), (Some(0), None));
        assert_eq!(of("BLEND", diffuse).maps.opacity, map.color.map(|map| map.of_channel(3)));
        // A dielectric reflects as much as its brightest channel, or what dielectrics do.
        for (specular, f0) in
            [("[0.01, 0.03, 0.02]", 0.03), ("[0.04, 0.04, 0.04]", 0.04), ("[0.05, 0, 0]", 0.04)]
        {
            let found =
                of("OPAQUE", &format!(r#""diffuseFactor": [1, 1, 1, 1], "specularFactor": {specular}"#));
            assert_eq!((found.metallic, found.f0), (0.0, f0), "{specular}");
        }
    }

    #[test]
    fn coordinates_are_changed_by_what_a_transform_has_and_no_more() {
        let at = |members: &str| {
            let transform = format!(r#""extensions": {{"{TEXTURE_TRANSFORM}": {{{members}}}}}"#);
            let color = format!(r#""baseColorTexture": {{"index": 0, {transform}}}"#);
            let map = material(&format!(r#""pbrMetallicRoughness": {{{color}}}"#)).maps.color.unwrap();
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|uv| map.transform.transform_point2(uv.into()))
        };
        for (members, expected) in [
            ("", [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
            (r#""offset": [0.5, 0.25]"#, [[0.5, 0.25], [1.5, 0.25], [0.5, 1.25]]),
            (r#""scale": [2, 3]"#, [[0.0, 0.0], [2.0, 0.0], [0.0, 3.0]]),
            // A quarter turn.
            (r#""rotation": 1.5707963267948966"#, [[0.0, 0.0], [0.0, -1.0], [1.0, 0.0]]),
        ] {
            let near = at(members).iter().zip(expected).all(|(found, at)| found.distance(at.into()) < 1e-6);
            assert!(near, "{members}: {:?}", at(members));
        }
    }
}
