//! The materials of scene files.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};
use serde::Deserialize;

use super::file::ShapeSpec;
use super::model::Model;
use super::{images, uvs};
use crate::limits::{MAX_RADIANCE, is_radiance};
use crate::{
    Alpha, Map, Maps, Material, Medium, NoteKind, Report, SceneBuilder, Shape, Texture, Wrap, f0_of_ior,
};

/// A material of a scene file: the fields of a [`Material`], whose maps are image files.
///
/// Without `surface`, `metallic`, `roughness`, `ior`, `f0` and `transmission` it is diffuse.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct MaterialSpec {
    /// Reflectance, or the tint of a metal or of glass, each channel in [0, 1]. Default: white, if it has a map.
    pub color: Option<Vec3>,
    /// How it scatters light, by a name instead of the next five fields.
    pub surface: Option<SurfaceSpec>,
    /// From 0, a dielectric, to 1, a metal. Default 0, or 1 if it has a map.
    pub metallic: Option<f32>,
    /// Perceptual roughness in [0, 1]; 0 reflects like a mirror. Default 1, or 0 if it transmits light.
    pub roughness: Option<f32>,
    /// Index of refraction of a dielectric, at least 1. Default 1.5.
    pub ior: Option<f32>,
    /// Reflectance of a dielectric at normal incidence, in [0, 1]. Default: by its index of refraction.
    pub f0: Option<f32>,
    /// How much of the light that enters a dielectric passes through it, in [0, 1]. Default 0, or 1 if it has a map.
    pub transmission: Option<f32>,
    /// The inside of a body that transmits light. Without it, the surface is a thin sheet, which does not bend light.
    pub medium: Option<MediumSpec>,
    /// Emitted radiance. Default: none, or 1 if it has a map. Emissive panels become lights.
    pub emission: Option<Vec3>,
    /// Opacity in [0, 1], as `alpha` says. Default 1.
    pub opacity: Option<f32>,
    /// How opacity shows. Default: `Opaque`, not at all.
    pub alpha: Alpha,
    /// Whether the back side emits too. Default: false.
    pub double_sided: bool,
    /// Whether it shows its colour whatever light there is. Default: false.
    pub unlit: bool,
    /// Images that multiply the factors above, and normals.
    pub maps: MapSpecs,
}

/// How a material of a scene file scatters light, by name.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub enum SurfaceSpec {
    /// Lambertian.
    #[default]
    Diffuse,
    /// A GGX lobe over a Lambertian base.
    Glossy {
        /// Perceptual roughness in (0, 1].
        roughness: f32,
        /// Reflectance at normal incidence, in [0, 1]. Default 0.04.
        #[serde(default = "dielectric_f0")]
        f0: f32,
    },
    /// Perfect reflection.
    Mirror,
}

fn dielectric_f0() -> f32 {
    crate::DIELECTRIC_F0
}

/// The inside of a body of a scene file that transmits light; the material has its index of refraction.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct MediumSpec {
    /// Absorption, 1/m per colour channel. Default: none.
    pub absorption: Vec3,
}

/// The maps of a material of a scene file; see [`Maps`].
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct MapSpecs {
    /// Of the colour, as sRGB.
    pub color: Option<MapSpec>,
    /// Of the opacity, in the alpha channel, or in the red one if the image is opaque.
    pub opacity: Option<MapSpec>,
    /// Of `metallic`, in the blue channel.
    pub metallic: Option<MapSpec>,
    /// Of the roughness, in the green channel.
    pub roughness: Option<MapSpec>,
    /// Of the transmission, in the red channel.
    pub transmission: Option<MapSpec>,
    /// Of the emission, as sRGB.
    pub emission: Option<MapSpec>,
    /// Normals: right as red, up as green, out of the surface as blue.
    pub normal: Option<MapSpec>,
}

/// A map of a material of a scene file: an image, and how it lies on the surface.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct MapSpec {
    /// A PNG, JPEG or WebP file, relative to the scene file's folder.
    pub file: String,
    /// The channel that a map of one number reads. Default: as [`MapSpecs`] says.
    #[serde(default)]
    pub channel: Option<ChannelSpec>,
    /// Factor on the slopes of normals. Default 1.
    #[serde(default)]
    pub slope: Option<f32>,
    /// The set of texture coordinates: 0, or 1 where a mesh file has a second one. Default 0.
    #[serde(default)]
    pub uv_set: usize,
    /// Factors on the texture coordinates: at 2, the image is there twice. They are scaled, then rotated, then moved.
    #[serde(default = "whole")]
    pub scale: Vec2,
    /// Rotation of the texture coordinates, counter-clockwise in the image, degrees.
    #[serde(default)]
    pub rotate: f32,
    /// Translation of the texture coordinates, in widths and heights of the image, to the right and down.
    #[serde(default)]
    pub translate: Vec2,
    /// What lies beyond the image to the left and right, and above and below. Default: `Repeat` for both.
    #[serde(default)]
    pub wrap: [Wrap; 2],
    /// Whether the nearest texel counts, instead of the four around, interpolated. Default: false.
    #[serde(default)]
    pub nearest: bool,
}

fn whole() -> Vec2 {
    Vec2::ONE
}

/// A channel of an image.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
pub enum ChannelSpec {
    /// The first.
    Red,
    /// The second.
    Green,
    /// The third.
    Blue,
    /// Opacity.
    Alpha,
}

/// The images of some materials' maps as textures, by file; `read` gives the bytes of one. What is missing or no image is
/// noted.
pub(super) fn images<'a>(
    materials: impl Iterator<Item = &'a MaterialSpec>,
    read: impl Fn(&str) -> Option<Vec<u8>>,
    report: &mut Report,
) -> HashMap<String, Arc<Texture>> {
    let names: BTreeSet<&String> =
        materials.flat_map(|material| material.maps.all()).map(|(_, map)| &map.file).collect();
    let mut files = Vec::new();
    for name in names {
        match read(name) {
            Some(bytes) => files.push((name.clone(), bytes)),
            None => report.add(NoteKind::LeftOut, "a texture that is missing or cannot be read", name),
        }
    }
    let mut textures = HashMap::new();
    for (decoded, (name, _)) in images::decode(&files).into_iter().zip(&files) {
        match decoded {
            Ok(texture) => {
                textures.insert(name.clone(), texture);
            }
            Err(message) => report.add(NoteKind::LeftOut, format!("a texture, as {message}"), name),
        }
    }
    textures
}

impl MaterialSpec {
    /// Checks its numbers, and that every field has an effect.
    pub(super) fn check(&self) -> Result<(), String> {
        let unit = |value: f32| (0.0..=1.0).contains(&value);
        let Self { metallic, roughness, f0, transmission, opacity, .. } = *self;
        let shares = [metallic, roughness, f0, transmission, opacity].into_iter().flatten();
        if !self.color.iter().flat_map(Vec3::to_array).chain(shares).all(unit) {
            return Err(
                "color, metallic, roughness, f0, transmission and opacity must be between 0 and 1".to_owned()
            );
        }
        if let Some(SurfaceSpec::Glossy { roughness, f0 }) = self.surface
            && !(roughness > 0.0 && unit(roughness) && unit(f0))
        {
            return Err("Glossy needs a roughness above 0 and at most 1, and f0 between 0 and 1".to_owned());
        }
        let emission = self.emission.unwrap_or_default();
        if !is_radiance(emission) || emission.min_element() < 0.0 {
            return Err(format!("emission must be between 0 and {MAX_RADIANCE:e}"));
        }
        let absorption = self.medium.unwrap_or_default().absorption;
        let bends = self.ior.is_none_or(|ior| (1.0..f32::INFINITY).contains(&ior));
        if !(bends && absorption.min_element() >= 0.0 && absorption.is_finite()) {
            return Err("ior must be a number of at least 1, and absorption must not be negative".to_owned());
        }
        if let Alpha::Mask(cutoff) = self.alpha
            && !unit(cutoff)
        {
            return Err("the cutoff of a Mask must be between 0 and 1".to_owned());
        }
        for (name, map) in self.maps.all() {
            map.check(name).map_err(|message| format!("maps.{name}: {message}"))?;
        }
        self.check_use()
    }

    /// Refuses fields that would have no effect.
    fn check_use(&self) -> Result<(), String> {
        let maps = &self.maps;
        let refuse =
            |is_useless: bool, message: &str| if is_useless { Err(message.to_owned()) } else { Ok(()) };
        refuse(self.color.is_none() && maps.color.is_none(), "give `color`, or a map of it")?;
        refuse(
            self.surface.is_some() && self.is_physical(),
            "`surface` stands for metallic, roughness, ior, f0 and transmission; drop it, or drop these and their maps",
        )?;
        for (name, factor, map) in [
            ("color", self.color, &maps.color),
            ("metallic", self.metallic.map(Vec3::splat), &maps.metallic),
            ("roughness", self.roughness.map(Vec3::splat), &maps.roughness),
            ("transmission", self.transmission.map(Vec3::splat), &maps.transmission),
            ("emission", self.emission, &maps.emission),
            ("opacity", self.opacity.map(Vec3::splat), &maps.opacity),
        ] {
            refuse(
                map.is_some() && factor == Some(Vec3::ZERO),
                &format!("the map of `{name}` multiplies it, but it is 0; make it larger, or drop the map"),
            )?;
        }
        let transmits = self.transmission.unwrap_or_default() > 0.0 || maps.transmission.is_some();
        refuse(
            self.medium.is_some() && !transmits,
            "`medium` is what light passes through: give `transmission`",
        )?;
        refuse(
            self.alpha == Alpha::Opaque && (self.opacity.is_some() || maps.opacity.is_some()),
            "opacity shows with `alpha: Blend` or `alpha: Mask(0.5)`: give one, or drop the opacity",
        )?;
        let is_lit = self.surface.is_some()
            || self.is_physical()
            || self.emission.is_some()
            || maps.all().any(|(name, _)| name != "color" && name != "opacity");
        refuse(
            self.unlit && is_lit,
            "an unlit surface shows its color and opacity alone; drop what else it has, or `unlit`",
        )
    }

    /// Whether it says more of how it scatters light than its colour.
    fn is_physical(&self) -> bool {
        let Self { metallic, roughness, ior, f0, transmission, maps, .. } = self;
        [metallic, roughness, ior, f0, transmission].into_iter().any(Option::is_some)
            || [&maps.metallic, &maps.roughness, &maps.transmission].into_iter().any(Option::is_some)
    }

    /// The material, with the maps of these images by file. A map whose image is missing is left out; its emission is then
    /// not known, and left out too.
    pub(super) fn to_material(
        &self,
        name: &str,
        images: &HashMap<String, Arc<Texture>>,
        builder: &mut SceneBuilder,
    ) -> Material {
        let image = |map: &Option<MapSpec>| map.as_ref().and_then(|map| images.get(&map.file));
        let factor = |own: Option<f32>, map| own.unwrap_or(f32::from(u8::from(image(map).is_some())));
        let color = self.color.unwrap_or(Vec3::ONE);
        let transmission = factor(self.transmission, &self.maps.transmission);
        let ior = self.ior.unwrap_or(1.5);
        let surface = match self.surface {
            Some(SurfaceSpec::Glossy { roughness, f0 }) => Material::glossy(name, color, roughness, f0),
            Some(SurfaceSpec::Mirror) => Material::mirror(name, color),
            None if self.is_physical() => {
                let is_clear = transmission > 0.0 && image(&self.maps.roughness).is_none();
                let roughness = self.roughness.unwrap_or(if is_clear { 0.0 } else { 1.0 });
                let inside = |medium: MediumSpec| Medium { ior, absorption: medium.absorption };
                Material {
                    metallic: factor(self.metallic, &self.maps.metallic),
                    transmission,
                    medium: self.medium.filter(|_| transmission > 0.0).map(inside),
                    ..Material::glossy(name, color, roughness, self.f0.unwrap_or(f0_of_ior(ior)))
                }
            }
            Some(SurfaceSpec::Diffuse) | None => Material::diffuse(name, color),
        };
        let emission = match (&self.maps.emission, image(&self.maps.emission)) {
            (Some(_), None) => Vec3::ZERO,
            (map, _) => self.emission.unwrap_or(Vec3::splat(f32::from(u8::from(map.is_some())))),
        };
        Material {
            emission,
            opacity: self.opacity.unwrap_or(1.0),
            alpha: self.alpha,
            double_sided: self.double_sided,
            unlit: self.unlit,
            maps: self.maps.of(images, builder),
            ..surface
        }
    }
}

impl MapSpecs {
    /// All maps by their names.
    fn all(&self) -> impl Iterator<Item = (&'static str, &MapSpec)> {
        let Self { color, opacity, metallic, roughness, transmission, emission, normal } = self;
        let named = [
            ("color", color),
            ("opacity", opacity),
            ("metallic", metallic),
            ("roughness", roughness),
            ("transmission", transmission),
            ("emission", emission),
            ("normal", normal),
        ];
        named.into_iter().filter_map(|(name, map)| Some((name, map.as_ref()?)))
    }

    /// Gives a shape the coordinates that the maps need, if it is not from a file, and notes those that are missing.
    pub(super) fn place(&self, shape: &ShapeSpec, model: &mut Model, name: &str, report: &mut Report) {
        let is_used = |set: usize| self.all().any(|(_, map)| map.uv_set == set);
        for (part, _) in model.parts.iter_mut().filter(|_| is_used(0)) {
            let corners = |triangle: &[u32; 3]| triangle.map(|corner| part.positions[corner as usize]);
            let uvs = part.triangles.iter().map(|triangle| uvs::of_triangle(shape, corners(triangle)));
            if let Some(uvs) = uvs.collect() {
                part.uvs[0] = uvs;
            }
        }
        let lacks = |part: &Shape| [0, 1].into_iter().any(|set| is_used(set) && part.uvs[set].is_empty());
        if model.parts.iter().any(|(part, _)| lacks(part)) {
            report.add(NoteKind::Approximated, uvs::WITHOUT_UVS, name);
        }
    }

    /// The maps whose images are there; these become textures of the scene.
    fn of(&self, images: &HashMap<String, Arc<Texture>>, builder: &mut SceneBuilder) -> Maps {
        let mut map = |spec: &Option<MapSpec>, channel: fn(&Texture) -> usize| {
            let spec = spec.as_ref()?;
            let image = images.get(&spec.file)?;
            let channel = spec.channel.map_or_else(|| channel(image), |channel| channel as usize);
            Some(spec.to_map(builder.texture(image)).of_channel(channel))
        };
        Maps {
            color: map(&self.color, |_| 0),
            opacity: map(&self.opacity, |image| if image.is_opaque() { 0 } else { 3 }),
            metallic: map(&self.metallic, |_| 2),
            roughness: map(&self.roughness, |_| 1),
            transmission: map(&self.transmission, |_| 0),
            emission: map(&self.emission, |_| 0),
            normal: map(&self.normal, |_| 0).zip(self.normal.as_ref().map(|spec| spec.slope.unwrap_or(1.0))),
        }
    }
}

impl MapSpec {
    /// Checks the map called `name`.
    fn check(&self, name: &str) -> Result<(), String> {
        if self.channel.is_some() && ["color", "emission", "normal"].contains(&name) {
            return Err("it has three channels; drop `channel`".to_owned());
        }
        if self.slope.is_some() && name != "normal" {
            return Err("`slope` is for normals; drop it".to_owned());
        }
        let numbers = [self.slope.unwrap_or_default(), self.rotate];
        let pairs = [self.scale, self.translate];
        if !numbers.into_iter().all(f32::is_finite)
            || !pairs.into_iter().all(Vec2::is_finite)
            || self.uv_set > 1
        {
            return Err("all numbers must be finite, and uv_set 0 or 1".to_owned());
        }
        Ok(())
    }

    fn to_map(&self, texture: usize) -> Map {
        // v points down, so that this turns counter-clockwise.
        let angle = -self.rotate.to_radians();
        Map {
            uv_set: self.uv_set,
            transform: Affine2::from_scale_angle_translation(self.scale, angle, self.translate),
            wrap: self.wrap,
            nearest: self.nearest,
            ..Map::new(texture)
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec4;

    use super::*;
    use crate::load::tests::Folder;
    use crate::{Hit, Rng, Scene, TraceSettings, Tracer};

    const COLOR: Vec3 = Vec3::new(0.7, 0.4, 0.3);

    /// A scene of a quad of this material.
    fn scene_of(folder: &Folder, material: &str) -> Result<Scene, String> {
        let text = format!(
            "Scene(version: 1, materials: {{\"m\": ({material})}}, objects: [(shape: Quad(corner: (-1, -1, 0), u: (2, \
             0, 0), v: (0, 2, 0)), material: \"m\")])"
        );
        Scene::load(&folder.file("scene.ron", text)).map_err(|error| error.to_string())
    }

    fn image(folder: &Folder, name: &str, texels: [[u8; 4]; 4]) {
        let texels = image::RgbaImage::from_raw(2, 2, texels.concat()).unwrap();
        let mut bytes = std::io::Cursor::new(Vec::new());
        texels.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        folder.file(name, bytes.into_inner());
    }

    #[test]
    fn a_scene_file_has_every_factor_of_a_material() {
        let folder = Folder::new("factors");
        let diffuse = Material::diffuse("m", COLOR);
        let glossy = |roughness, f0| Material::glossy("m", COLOR, roughness, f0);
        let inside = Medium { ior: 1.4, absorption: Vec3::new(1.0, 2.0, 3.0) };
        for (text, expected) in [
            ("", diffuse.clone()),
            ("surface: Diffuse", diffuse.clone()),
            ("surface: Glossy(roughness: 0.3)", glossy(0.3, 0.04)),
            ("surface: Mirror", Material::mirror("m", COLOR)),
            ("roughness: 0.3", glossy(0.3, f0_of_ior(1.5))),
            ("ior: 1", glossy(1.0, 0.0)),
            ("ior: 1.33", glossy(1.0, f0_of_ior(1.33))),
            ("ior: 1.33, f0: 0.1", glossy(1.0, 0.1)),
            ("metallic: 0.8, roughness: 0", Material { metallic: 0.8, ..glossy(0.0, f0_of_ior(1.5)) }),
            ("transmission: 0.5", Material { transmission: 0.5, ..glossy(0.0, f0_of_ior(1.5)) }),
            ("transmission: 1, medium: (), ior: 1.4", Material::glass("m", COLOR, 1.4)),
            (
                "transmission: 1, medium: (absorption: (1, 2, 3)), ior: 1.4, roughness: 0.2",
                Material { roughness: 0.2, medium: Some(inside), ..Material::glass("m", COLOR, 1.4) },
            ),
            ("alpha: Blend, opacity: 0.3", Material { alpha: Alpha::Blend, opacity: 0.3, ..diffuse.clone() }),
            ("alpha: Mask(0.4)", Material { alpha: Alpha::Mask(0.4), ..diffuse.clone() }),
            ("unlit: true", Material { unlit: true, ..diffuse.clone() }),
            (
                "emission: (90, 80, 70), double_sided: true",
                Material { emission: Vec3::new(90.0, 80.0, 70.0), double_sided: true, ..diffuse },
            ),
        ] {
            let scene = scene_of(&folder, &format!("color: (0.7, 0.4, 0.3), {text}")).unwrap();
            assert_eq!(scene.materials[0], expected, "{text}");
        }
    }

    #[test]
    fn maps_are_textures_of_the_scene() {
        let folder = Folder::new("maps");
        image(&folder, "a.png", [[255, 0, 0, 255]; 4]);
        image(&folder, "holes.png", [[255, 0, 0, 255], [0; 4], [0; 4], [0; 4]]);
        let scene = scene_of(
            &folder,
            "maps: (color: (file: \"a.png\"), metallic: (file: \"a.png\"), roughness: (file: \"a.png\", channel: \
             Alpha), opacity: (file: \"holes.png\", wrap: (Clamp, Mirror), nearest: true), emission: (file: \"a.png\", \
             scale: (2, 1), rotate: 90, translate: (0.5, 0.25)), normal: (file: \"a.png\", slope: 0.5)), alpha: \
             Mask(0.5)",
        )
        .unwrap();
        assert_eq!((scene.textures.len(), scene.textures[1].name.as_str()), (2, "holes.png"));
        let material = &scene.materials[0];
        // Factors of maps are 1 if the file has none.
        assert_eq!((material.color, material.emission), (Vec3::ONE, Vec3::ONE));
        assert_eq!((material.metallic, material.roughness), (1.0, 1.0));
        let maps = material.maps;
        let plain = Map::new(0);
        assert_eq!((maps.color, maps.metallic), (Some(plain), Some(plain.of_channel(2))));
        assert_eq!((maps.roughness, maps.normal), (Some(plain.of_channel(3)), Some((plain, 0.5))));
        let holes = Map { texture: 1, channel: 3, wrap: [Wrap::Clamp, Wrap::Mirror], nearest: true, ..plain };
        assert_eq!(maps.opacity, Some(holes));
        // Twice to the right is twice up, and then to the right and down.
        let turned = maps.emission.unwrap().transform.transform_point2(Vec2::X);
        assert!(turned.distance(Vec2::new(0.5, 0.25 - 2.0)) < 1e-6, "{turned}");
        // An opaque image has its opacity in the red channel.
        let grey =
            scene_of(&folder, "color: (1, 1, 1), alpha: Blend, maps: (opacity: (file: \"a.png\"))").unwrap();
        assert_eq!(grey.materials[0].maps.opacity, Some(plain));
    }

    #[test]
    fn maps_read_their_channels_unless_the_file_says_otherwise() {
        let folder = Folder::new("channels");
        image(&folder, "a.png", [[255; 4]; 4]);
        let names = ["metallic", "roughness", "transmission", "emission", "normal"];
        let maps = names.map(|name| format!("{name}: (file: \"a.png\")")).join(", ");
        let scene = scene_of(&folder, &format!("color: (1, 1, 1), maps: ({maps})")).unwrap();
        let plain = Map::new(0);
        let expected = Maps {
            metallic: Some(plain.of_channel(2)),
            roughness: Some(plain.of_channel(1)),
            transmission: Some(plain.of_channel(0)),
            emission: Some(plain),
            normal: Some((plain, 1.0)),
            ..Maps::default()
        };
        assert_eq!(scene.materials[0].maps, expected);
    }

    #[test]
    fn coordinates_of_the_second_set_are_those_of_mesh_files() {
        let folder = Folder::new("second-set");
        image(&folder, "a.png", [[255; 4]; 4]);
        let notes = |set: usize| {
            let color = format!("maps: (color: (file: \"a.png\", uv_set: {set}))");
            let report = scene_of(&folder, &color).unwrap().report;
            let all = report.notes().iter().filter(|note| note.kind == NoteKind::Approximated);
            all.map(ToString::to_string).collect::<Vec<_>>()
        };
        assert_eq!(notes(0), [""; 0]);
        let expected = "approximated: a texture where its mesh has no coordinates, by one texel (object 0)";
        assert_eq!(notes(1), [expected]);
    }

    #[test]
    fn what_is_missing_is_reported_and_does_not_shine() {
        let folder = Folder::new("missing");
        folder.file("page.png", "<html>");
        let scene = scene_of(
            &folder,
            "color: (0.5, 0.5, 0.5), emission: (9, 9, 9), maps: (metallic: (file: \"none.png\"), emission: (file: \
             \"page.png\"))",
        )
        .unwrap();
        let notes: Vec<String> = scene.report.notes().iter().map(ToString::to_string).collect();
        assert_eq!(notes[0], "left out: a texture that is missing or cannot be read (none.png)");
        assert!(notes[1].starts_with("left out: a texture, as it is a web page"), "{notes:?}");
        let material = &scene.materials[0];
        assert_eq!((material.metallic, material.emission, material.maps), (0.0, Vec3::ZERO, Maps::default()));
        // What lets no light through has no inside.
        let clear = "color: (1, 1, 1), medium: (), maps: (transmission: (file: \"none.png\"))";
        let scene = scene_of(&folder, clear).unwrap();
        assert_eq!((scene.materials[0].transmission, scene.materials[0].medium), (0.0, None));
    }

    #[test]
    fn meshes_without_coordinates_are_reported() {
        let folder = Folder::new("no-uvs");
        image(&folder, "a.png", [[255; 4]; 4]);
        folder.file("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        let text = "Scene(version: 1, materials: {\"m\": (maps: (color: (file: \"a.png\")))}, objects: [(shape: \
                    File(\"a.obj\"), material: \"m\")])";
        let scene = Scene::load(&folder.file("scene.ron", text)).unwrap();
        let note = scene.report.notes()[0].to_string();
        assert_eq!(
            note,
            "approximated: a texture where its mesh has no coordinates, by one texel (object 0)"
        );
    }

    #[test]
    fn fields_that_are_wrong_or_have_no_effect_are_refused() {
        let folder = Folder::new("senseless");
        let white = "color: (1, 1, 1)";
        for (text, expected) in [
            ("metalic: 1", "line 1, column"),
            ("maps: (color: (fil: \"a.png\"))", "line 1, column"),
            ("maps: (specular: (file: \"a.png\"))", "line 1, column"),
            ("roughness: 1.5", "between 0 and 1"),
            ("transmission: NaN", "between 0 and 1"),
            ("ior: 0.9", "ior must be a number of at least 1"),
            ("ior: inf", "ior must be a number of at least 1"),
            ("transmission: 1, medium: (absorption: (0, -1, 0))", "absorption must not be negative"),
            ("emission: (0, -1, 0)", "emission must be between 0 and 1e18"),
            ("alpha: Mask(2)", "the cutoff of a Mask must be between 0 and 1"),
            ("alpha: Cutout", "line 1, column"),
            ("surface: Mirror, roughness: 0.1", "`surface` stands for metallic"),
            ("medium: ()", "give `transmission`"),
            ("transmission: 0, medium: ()", "give `transmission`"),
            ("opacity: 0.5", "opacity shows with `alpha: Blend`"),
            ("maps: (opacity: (file: \"a.png\"))", "opacity shows with `alpha: Blend`"),
            (
                "metallic: 0, maps: (metallic: (file: \"a.png\"))",
                "the map of `metallic` multiplies it, but it is 0",
            ),
            ("unlit: true, roughness: 0.3", "an unlit surface shows its color"),
            ("unlit: true, emission: (1, 1, 1)", "an unlit surface shows its color"),
            ("unlit: true, maps: (normal: (file: \"a.png\"))", "an unlit surface shows its color"),
            ("maps: (color: (file: \"a.png\", channel: Red))", "maps.color: it has three channels"),
            ("maps: (roughness: (file: \"a.png\", slope: 2))", "maps.roughness: `slope` is for normals"),
            (
                "maps: (normal: (file: \"a.png\", uv_set: 2))",
                "maps.normal: all numbers must be finite, and uv_set",
            ),
            ("maps: (normal: (file: \"a.png\", scale: (inf, 1)))", "maps.normal: all numbers must be finite"),
        ] {
            let message = scene_of(&folder, &format!("{white}, {text}")).unwrap_err();
            assert!(message.contains(expected), "{text}: {message}");
            assert!(expected.starts_with("line") || message.contains("material `m`: "), "{message}");
        }
        let message = scene_of(&folder, "roughness: 0.5").unwrap_err();
        assert!(message.contains("material `m`: give `color`, or a map of it"), "{message}");
    }

    #[test]
    fn images_stand_upright_on_every_shape() {
        let folder = Folder::new("upright");
        let texels: [[u8; 4]; 4] = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255; 4]];
        image(&folder, "a.png", texels);
        let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
        // Where each is seen from, and what is up there.
        let sides = [(x, y), (-x, y), (z, y), (-z, y), (y, -z), (-y, z)];
        for (shape, views) in [
            ("Quad(corner: (-1, -1, 0), u: (2, 0, 0), v: (0, 2, 0))", &sides[2..3]),
            ("Box(low: (-1, -1, -1), high: (1, 1, 1))", &sides[..]),
            ("Sphere(center: (0, 0, 0), radius: 1)", &sides[2..3]),
            ("Cylinder(base: (0, -1, 0), radius: 1, height: 2)", &[sides[2], sides[4], sides[5]]),
        ] {
            let text = format!(
                "Scene(version: 1, materials: {{\"m\": (unlit: true, maps: (color: (file: \"a.png\", nearest: \
                 true)))}}, objects: [(shape: {shape}, material: \"m\", scale: 2, translate: (0, 0, 9))])"
            );
            let tracer = Tracer::new(Arc::new(Scene::load(&folder.file("scene.ron", text)).unwrap()));
            for &(towards, up) in views {
                let right = up.cross(towards);
                for (index, texel) in texels.iter().enumerate() {
                    let [s, t] = [[-0.5, 0.5], [0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]][index];
                    let eye = 9.0 * z + 5.0 * towards + s * right + t * up;
                    let Hit { radiance, .. } =
                        tracer.trace(eye, -towards, &TraceSettings::default(), &mut Rng::new(0, 0));
                    let expected = Vec4::from(texel.map(f32::from)).truncate() / 255.0;
                    assert_eq!(radiance, expected, "{shape} from {towards}, texel {index}");
                }
            }
        }
    }
}
