//! The images of a file's materials.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::container::{Container, decode_data, decode_percent};
use super::json::Image;
use super::materials::{Described, Glossiness};
use crate::load::images;
use crate::texture::linear_of;
use crate::{DIELECTRIC_F0, Map, Material, NoteKind, Report, Texture};

/// Reads the images of the materials in use, and gives all materials with maps of the textures. A map of an image that
/// cannot be read is left out.
pub(super) fn load(
    file: &Container,
    materials: Vec<Described>,
    used: &BTreeSet<usize>,
    report: &mut Report,
) -> (Vec<Material>, Vec<Arc<Texture>>) {
    let wanted: BTreeSet<usize> = used.iter().flat_map(|&index| materials[index].images()).collect();
    let mut files = Vec::new();
    let mut indices = Vec::new();
    for index in wanted {
        let (name, bytes) = file.image(index);
        match bytes {
            Ok(bytes) => {
                indices.push(index);
                files.push((name, bytes));
            }
            Err(error) => report.add(NoteKind::LeftOut, format!("an image: {error}"), &name),
        }
    }
    let mut textures = Vec::new();
    let mut found = BTreeMap::new();
    for ((index, (name, _)), decoded) in indices.iter().zip(&files).zip(images::decode(&files)) {
        match decoded {
            Ok(texture) => {
                found.insert(*index, textures.len());
                textures.push(texture);
            }
            Err(error) => report.add(NoteKind::LeftOut, format!("an image: {error}"), name),
        }
    }
    let mut room = images::room_beside(&textures);
    let with = |described: Described| described.with(&found, &mut textures, &mut room, report);
    let materials = materials.into_iter().map(with).collect();
    (materials, textures)
}

impl Container<'_> {
    /// The name and the bytes of an image, or why there are none.
    fn image(&self, index: usize) -> (String, Result<Cow<'_, [u8]>, String>) {
        let unnamed = format!("image {index}");
        let Some(Image { name, uri, buffer_view }) =
            self.root.images.get(index).and_then(|image| image.0.as_ref())
        else {
            return (unnamed, Err("it is not valid".to_owned()));
        };
        let path = uri.as_deref().filter(|uri| !uri.starts_with("data:"));
        let name = match path {
            Some(path) => decode_percent(path),
            None if name.is_empty() => unnamed,
            None => name.clone(),
        };
        let bytes = match (uri, path, buffer_view) {
            (_, Some(_), _) => (self.external)(&name)
                .map(Cow::Owned)
                .map_err(|_| "its file is missing or cannot be read".to_owned()),
            (Some(data), None, _) => decode_data(&data["data:".len()..]).map(Cow::Owned),
            (None, None, Some(view)) => self.view(*view).map(|(bytes, _)| Cow::Borrowed(bytes)),
            (None, None, None) => Err("it has no data".to_owned()),
        };
        (name, bytes)
    }
}

impl Described {
    /// The images that its maps use.
    fn images(&self) -> impl Iterator<Item = usize> {
        let glossiness = self.glossiness.map(|glossiness| glossiness.map.texture);
        self.material.maps.all().map(|map| map.texture).chain(glossiness)
    }

    /// The material with maps of textures, which are `found` by their images. There is `room` for more texels.
    fn with(
        self,
        found: &BTreeMap<usize, usize>,
        textures: &mut Vec<Arc<Texture>>,
        room: &mut u64,
        report: &mut Report,
    ) -> Material {
        let mut material = self.material;
        let of_texture = |map: Map| Some(Map { texture: *found.get(&map.texture)?, ..map });
        let maps = &mut material.maps;
        let emits_by_map = maps.emission.is_some();
        for map in [
            &mut maps.color,
            &mut maps.opacity,
            &mut maps.metallic,
            &mut maps.roughness,
            &mut maps.transmission,
            &mut maps.emission,
        ] {
            *map = map.and_then(of_texture);
        }
        maps.normal = maps.normal.and_then(|(map, scale)| Some((of_texture(map)?, scale)));
        if emits_by_map && maps.emission.is_none() {
            // What the image would show is not known.
            material.emission = Vec3::ZERO;
        }
        if let Some(glossiness) = self.glossiness
            && let Some(map) = of_texture(glossiness.map)
            && !glossiness.convert(&mut material, map, textures, room)
        {
            let what =
                "a specular-glossiness texture whose conversion does not fit into the 1 GiB for textures";
            report.add(NoteKind::LeftOut, what, &material.name);
        }
        material
    }
}

impl Glossiness {
    /// Makes maps of the metallic-roughness model from those of the material's diffuse colour, and of specular colour
    /// and glossiness, as many texels as the latter. Many materials may share these. False if there is no `room` for the
    /// texels.
    fn convert(
        &self,
        material: &mut Material,
        map: Map,
        textures: &mut Vec<Arc<Texture>>,
        room: &mut u64,
    ) -> bool {
        let specular = textures[map.texture].clone();
        let Some(left) = room.checked_sub(2 * specular.texels.len() as u64) else { return false };
        *room = left;
        let diffuse = material.maps.color.map(|map| textures[map.texture].clone());
        let [width, height] = specular.size;
        let convert = |(index, &[r, g, b, gloss]): (usize, &[u8; 4])| {
            let [x, y] = [index as u32 % width, index as u32 / width];
            let [p, q, s, opacity] = diffuse.as_ref().map_or([255; 4], |texture| {
                let [columns, rows] = texture.size;
                let at = [x * columns / width, y * rows / height];
                texture.texels[at[1] as usize * columns as usize + at[0] as usize]
            });
            let linear = |texel: [u8; 3]| Vec3::from(texel.map(linear_of));
            let (color, metallic) =
                metallic(self.diffuse * linear([p, q, s]), self.specular * linear([r, g, b]));
            let [r, g, b] = color.to_array().map(code_of);
            let roughness = 255.0 - self.glossiness * f32::from(gloss);
            ([r, g, b, opacity], [0, roughness.round() as u8, (255.0 * metallic).round() as u8, 255])
        };
        let (colors, mixed) = specular.texels.par_iter().enumerate().map(convert).unzip();
        let name = &specular.name;
        let mut add = |name: String, texels| {
            textures.push(Arc::new(Texture { name, size: specular.size, texels }));
            textures.len() - 1
        };
        let color = Map { texture: add(format!("{name}, base colour"), colors), ..map };
        let mixed = Map { texture: add(format!("{name}, metallic and roughness"), mixed), ..map };
        material.color = Vec3::ONE;
        [material.metallic, material.roughness] = [1.0; 2];
        material.maps.color = Some(color);
        material.maps.opacity = material.maps.opacity.map(|_| color.of_channel(3));
        material.maps.metallic = Some(mixed.of_channel(2));
        material.maps.roughness = Some(mixed.of_channel(1));
        true
    }
}

/// The base colour and the share of metal with which the metallic-roughness model reflects about as much as a diffuse
/// and a specular colour do.
///
/// With base colour c and metal m, the diffuse part is c (1 - m) (1 - f) and the specular part f (1 - m) + c m, for the
/// reflectance f of dielectrics. m solves both for their brightness; c follows from the part that tells more of it.
pub(super) fn metallic(diffuse: Vec3, specular: Vec3) -> (Vec3, f32) {
    const F: f32 = DIELECTRIC_F0;
    let brightness = |color: Vec3| (color * color).dot(Vec3::new(0.299, 0.587, 0.114)).sqrt();
    let diffuse = diffuse * (1.0 - specular.max_element());
    let [d, s] = [brightness(diffuse) / (1.0 - F), brightness(specular)];
    let metal = if s <= F {
        0.0
    } else {
        // F m^2 + (d + s - 2 F) m + F - s = 0.
        let half = 0.5 * (d + s - 2.0 * F);
        ((-half + (half * half + F * (s - F)).sqrt()) / F).clamp(0.0, 1.0)
    };
    let of_diffuse = diffuse / ((1.0 - F) * (1.0 - metal).max(1e-6));
    let of_specular = (specular - F * (1.0 - metal)) / metal.max(1e-6);
    (of_diffuse.lerp(of_specular, metal * metal).clamp(Vec3::ZERO, Vec3::ONE), metal)
}

/// The sRGB code of a linear value (IEC 61966-2-1).
fn code_of(linear: f32) -> u8 {
    let code = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (255.0 * code).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Maps;

    #[test]
    fn diffuse_and_specular_colours_become_a_base_colour_and_metal() {
        // What each base colour reflects, by the model.
        for (base, metal) in
            [(Vec3::new(0.8, 0.2, 0.1), 0.0), (Vec3::new(0.99, 0.77, 0.34), 1.0), (Vec3::splat(0.6), 0.5)]
        {
            let specular = base.lerp(Vec3::splat(DIELECTRIC_F0), 1.0 - metal);
            let diffuse = base * (1.0 - metal) * (1.0 - DIELECTRIC_F0) / (1.0 - specular.max_element());
            let found = metallic(diffuse, specular);
            assert!(
                (found.1 - metal).abs() < 1e-3 && found.0.distance(base) < 1e-3,
                "{found:?}: {base}, {metal}"
            );
        }
        assert_eq!(metallic(Vec3::splat(0.96), Vec3::ZERO), (Vec3::ONE, 0.0));
        // What reflects as a dielectric does is none of metal, however dark it is, and nothing is more than a metal.
        let grey = |bright: f32| Vec3::splat(bright);
        assert_eq!(metallic(Vec3::ZERO, grey(DIELECTRIC_F0)).1, 0.0);
        for step in 5..=100 {
            let (color, metal) = metallic(Vec3::ZERO, grey(0.01 * step as f32));
            assert!((0.999..=1.0).contains(&metal), "{step}: {metal}");
            assert!(color.distance(grey(0.01 * step as f32)) < 1e-4, "{step}: {color}");
        }
    }

    #[test]
    fn materials_that_share_a_texture_are_converted_as_long_as_there_is_room() {
        let texture = Texture { name: "gloss".to_owned(), size: [3, 1], texels: vec![[255, 0, 0, 128]; 3] };
        let mut textures = vec![Arc::new(texture)];
        let json = r#"{"asset": {"version": "2.0"}, "images": [{}], "textures": [{"source": 0}], "materials": [{"extensions": {
            "KHR_materials_pbrSpecularGlossiness": {"specularGlossinessTexture": {"index": 0}}}}]}"#;
        let described = Described::all(&gltf::json::deserialize::from_str(json).unwrap()).remove(0);
        let (found, mut room, mut report) = (BTreeMap::from([(0, 0)]), 13, Report::default());
        for is_converted in [true, true, false] {
            let material = described.clone().with(&found, &mut textures, &mut room, &mut report);
            assert_eq!(material.maps.color.is_some(), is_converted);
        }
        assert_eq!((room, textures.len()), (1, 5));
        assert!(report.notes()[0].to_string().starts_with("left out: a specular-glossiness texture whose"));
    }

    #[test]
    fn a_diffuse_texture_of_another_size_is_read_at_the_same_place() {
        // Each texel of 3 x 2 has an opacity of its own; the specular texture is twice as wide and three times as high.
        let texture = |size: [u32; 2], texels| Arc::new(Texture { name: String::new(), size, texels });
        let diffuse = texture([3, 2], (0..6).map(|texel| [200, 100, 50, 10 * texel]).collect());
        let specular = texture([6, 6], vec![[0, 0, 0, 255]; 36]);
        let mut textures = vec![diffuse, specular];
        let json = r#"{"asset": {"version": "2.0"}, "images": [{}, {}], "textures": [{"source": 0}, {"source": 1}],
            "materials": [{"extensions": {"KHR_materials_pbrSpecularGlossiness": {
                "diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 1}}}}]}"#;
        let described = Described::all(&gltf::json::deserialize::from_str(json).unwrap()).remove(0);
        let (found, mut room) = (BTreeMap::from([(0, 0), (1, 1)]), 1000);
        let material = described.with(&found, &mut textures, &mut room, &mut Report::default());
        let colors = &textures[material.maps.color.unwrap().texture];
        assert_eq!(colors.size, [6, 6]);
        for (texel, color) in colors.texels.iter().enumerate() {
            let (x, y) = (texel % 6 / 2, texel / 6 / 3);
            assert_eq!(color[3], 10 * (3 * y + x) as u8, "{texel}");
        }
    }

    #[test]
    fn factors_multiply_textures_before_these_are_converted() {
        let texture = |texel| Texture { name: "gloss".to_owned(), size: [1, 1], texels: vec![texel] };
        let of = |diffuse: Vec3, specular: Vec3, texels: [[u8; 4]; 2]| {
            let mut textures = texels.map(|texel| Arc::new(texture(texel))).to_vec();
            let maps = Maps {
                color: Some(Map::new(0)),
                opacity: Some(Map::new(0).of_channel(3)),
                ..Maps::default()
            };
            let mut material = Material { maps, ..Material::diffuse("", Vec3::ONE) };
            let glossiness = Glossiness { diffuse, specular, glossiness: 0.5, map: Map::new(1) };
            assert!(glossiness.convert(&mut material, Map::new(1), &mut textures, &mut 2));
            let maps = material.maps;
            assert_eq!((maps.color, maps.opacity), (Some(Map::new(2)), Some(Map::new(2).of_channel(3))));
            assert_eq!(
                [maps.metallic, maps.roughness],
                [2, 1].map(|channel| Some(Map::new(3).of_channel(channel)))
            );
            [&textures[2], &textures[3]].map(|texture| texture.texels[0])
        };
        // Two fifths of metal of a grey of 0.6 by the factors alone: 0.6 has the code 203.
        let specular = Vec3::splat(0.6).lerp(Vec3::splat(DIELECTRIC_F0), 0.6);
        let diffuse = Vec3::splat(0.6) * 0.6 * (1.0 - DIELECTRIC_F0) / (1.0 - specular.x);
        let white = [255, 255, 255, 50];
        assert_eq!(of(diffuse, specular, [[255; 4], white]), [[203, 203, 203, 255], [0, 230, 102, 255]]);
        // The code 188 is half of the light: a metal of a quarter, and a dielectric of a quarter, which has the code 137.
        let (half, grey) = (Vec3::splat(0.5), [188, 188, 188, 9]);
        assert_eq!(of(Vec3::ZERO, half, [[255; 4], grey])[0], [137, 137, 137, 255]);
        assert_eq!(of(half, Vec3::ZERO, [grey, white])[0], [140, 140, 140, 9]);
    }

    #[test]
    fn codes_are_the_inverse_of_values() {
        assert!((0..=255).all(|code| code_of(linear_of(code)) == code));
    }
}
