//! The material files of OBJ, with their extension for physically based rendering.
//!
//! What a material is depends on which statements it has:
//! - `Pr`, `Pm` and their maps make it one of the metallic-roughness model.
//! - `illum` 6 and 7 with an index of refraction `Ni` above 1 make it glass, tinted by `Tf`, unless `d` dissolves it.
//! - `illum` 3 and up reflect their surroundings; below, `Ks` is the coat of a dielectric, whose reflectance at normal
//!   incidence is by custom 0.08 times the "specular" that exporters write.
//! - `d`, or else `Tr`, lets what is behind shine through, without bending light.
//!
//! The exponent `Ns` becomes a roughness by the rule with which Blender wrote it, Ns = (30 (1 - roughness))^2.

use glam::Vec3;

use super::maps::{Picture, Textures};
use super::{keyword, number, shortened, statements, without_comment};
use crate::limits::{MAX_RADIANCE, is_radiance};
use crate::{Alpha, DIELECTRIC_F0, Maps, Material, NoteKind, Report, Texture, f0_of_ior};

/// The roughness from which a coat is too wide and weak to tell from diffuse.
const ROUGHEST_COAT: f32 = 0.6;
/// The least roughness that an exponent means.
const SMOOTHEST: f32 = 0.02;
/// Diffuse light of less than this share of the mirrored light is that of a metal, whose tint is that of the mirrored light.
const METAL: f32 = 0.1;

/// A material as the file has it.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    pub name: String,
    diffuse: Option<Vec3>,
    specular: Vec3,
    emission: Vec3,
    /// The colour of light that passes through.
    filter: Option<Vec3>,
    exponent: Option<f32>,
    ior: Option<f32>,
    dissolve: Option<f32>,
    transparency: Option<f32>,
    illum: Option<u32>,
    roughness: Option<f32>,
    metallic: Option<f32>,
    maps: Pictures,
}

/// The maps of a material as the file has them. Most have none.
#[derive(Clone, Debug, Default)]
struct Pictures {
    diffuse: Option<Box<Picture>>,
    emission: Option<Box<Picture>>,
    dissolve: Option<Box<Picture>>,
    roughness: Option<Box<Picture>>,
    metallic: Option<Box<Picture>>,
    normal: Option<Box<Picture>>,
    /// Of heights by the letter, but many files have normals here.
    bump: Option<Box<Picture>>,
}

impl Pictures {
    fn all(&self) -> impl Iterator<Item = &Picture> {
        let Self { diffuse, emission, dissolve, roughness, metallic, normal, bump } = self;
        [diffuse, emission, dissolve, roughness, metallic, normal, bump]
            .into_iter()
            .flatten()
            .map(Box::as_ref)
    }
}

/// Reads the materials of a file; `folder` is that of the file from the mesh's, with a slash at its end, or empty. What is
/// wrong with a value is noted, and the value is that of a material without it.
pub(super) fn read(text: &str, folder: &str, report: &mut Report) -> Vec<Mtl> {
    let mut list: Vec<Mtl> = Vec::new();
    for (_, line) in statements(text) {
        let (keyword, rest) = keyword(&line);
        if keyword == "newmtl" {
            list.push(Mtl { name: rest.to_owned(), ..Mtl::default() });
        } else if let Some(material) = list.last_mut() {
            material.line(keyword, rest, folder, report);
        }
    }
    list
}

impl Mtl {
    fn line(&mut self, keyword: &str, rest: &str, folder: &str, report: &mut Report) {
        let name = self.name.as_str();
        let lower = keyword.to_ascii_lowercase();
        match lower.as_str() {
            "kd" => self.diffuse = color(rest, name, report).or(self.diffuse),
            "ks" => self.specular = color(rest, name, report).unwrap_or(self.specular),
            "ke" => self.emission = color(rest, name, report).unwrap_or(self.emission),
            "tf" => self.filter = color(rest, name, report).or(self.filter),
            "ns" => self.exponent = value(rest, name, report).or(self.exponent),
            "ni" => self.ior = value(rest, name, report).or(self.ior),
            "d" => {
                let rest = rest.strip_prefix("-halo").unwrap_or(rest);
                self.dissolve = value(rest, name, report).or(self.dissolve);
            }
            "tr" => self.transparency = value(rest, name, report).or(self.transparency),
            "illum" => self.illum = value(rest, name, report).map(|model| model as u32).or(self.illum),
            "pr" => self.roughness = value(rest, name, report).or(self.roughness),
            "pm" => self.metallic = value(rest, name, report).or(self.metallic),
            "ps" | "pc" | "aniso" if value(rest, name, report).is_some_and(|share| share != 0.0) => {
                let what = match lower.as_str() {
                    "ps" => "the sheen of a material",
                    "pc" => "the clear coat of a material",
                    _ => "the anisotropy of a material",
                };
                report.add(NoteKind::LeftOut, what, name);
            }
            // What goes with those; light from nowhere, which no tracer has; how sharply it is mirrored.
            "ps" | "pc" | "pcr" | "aniso" | "anisor" | "ka" | "sharpness" | "map_aat" => {}
            // It is nearly always the map of the diffuse colour.
            "map_ka" => {}
            "map_kd" | "map_ke" | "map_d" | "map_pr" | "map_pm" | "norm" | "map_norm" | "map_kn" | "bump"
            | "map_bump" => {
                let maps = &mut self.maps;
                let slot = match lower.as_str() {
                    "map_kd" => &mut maps.diffuse,
                    "map_ke" => &mut maps.emission,
                    "map_d" => &mut maps.dissolve,
                    "map_pr" => &mut maps.roughness,
                    "map_pm" => &mut maps.metallic,
                    "bump" | "map_bump" => &mut maps.bump,
                    _ => &mut maps.normal,
                };
                let picture = Picture::parse(rest, folder, &self.name, report).map(Box::new);
                *slot = picture.or(slot.take());
            }
            _ if keyword.is_empty() || keyword.starts_with('#') => {}
            _ => {
                let what = "a statement of a material that is not known";
                report.add(NoteKind::LeftOut, what, &shortened(keyword));
            }
        }
    }

    /// The pictures of its maps.
    pub fn pictures(&self) -> impl Iterator<Item = &Picture> {
        self.maps.all()
    }

    /// The material, with the maps that are among the textures.
    pub fn to_material(&self, textures: &Textures, report: &mut Report) -> Material {
        let name = self.name.as_str();
        let mut repair = |what: &str| report.add(NoteKind::Repaired, what, name);
        let unit = |color: Vec3| color.clamp(Vec3::ZERO, Vec3::ONE);
        let default = if self.maps.diffuse.is_some() { 1.0 } else { 0.7 };
        let mut color = self.diffuse.unwrap_or(Vec3::splat(default));
        if color.max_element() > 1.0 || color.min_element() < 0.0 {
            repair("a colour beyond 0 to 1, taken as the nearest one within");
            color = unit(color);
        }
        let shows =
            |picture: &Option<Box<Picture>>| picture.as_ref().is_some_and(|p| textures.index(p).is_some());
        if color == Vec3::ZERO && shows(&self.maps.diffuse) {
            repair("a black colour that hides its texture, taken as white");
            color = Vec3::ONE;
        }
        let mut emission = self.emission.max(Vec3::ZERO);
        if !is_radiance(emission) {
            repair("an emission too large for a scene");
            emission = emission.min(Vec3::splat(MAX_RADIANCE));
        }
        if emission == Vec3::ZERO && shows(&self.maps.emission) {
            emission = Vec3::ONE;
        }
        let opacity = match (self.dissolve, self.transparency) {
            (Some(dissolve), _) => dissolve.clamp(0.0, 1.0),
            // By the letter it is invisible, but so say exporters to whom it is opacity.
            (None, Some(transparency)) if transparency >= 1.0 => {
                repair("`Tr 1` without `d`, taken as opaque");
                1.0
            }
            (None, Some(transparency)) => 1.0 - transparency.max(0.0),
            (None, None) => 1.0,
        };
        if opacity == 0.0 {
            report.add(NoteKind::LeftOut, "a surface that `d 0` makes invisible", name);
        }
        let mut material = Material { emission, ..self.surface(color, opacity, textures, report) };
        if opacity < 1.0 || shows(&self.maps.dissolve) {
            material.alpha = Alpha::Blend;
            material.opacity = opacity;
        }
        material.maps = self.maps(textures, report);
        material
    }

    /// How it scatters light.
    fn surface(&self, color: Vec3, opacity: f32, textures: &Textures, report: &mut Report) -> Material {
        let name = self.name.as_str();
        let has = |map: &Option<Box<Picture>>| map.as_ref().is_some_and(|p| textures.index(p).is_some());
        let exponent = self.exponent.unwrap_or(0.0).max(0.0);
        let roughness = (1.0 - exponent.sqrt() / 30.0).max(SMOOTHEST);
        let ior = self.ior.filter(|ior| *ior > 1.0 && ior.is_finite());
        let is_physical = self.roughness.is_some() || self.metallic.is_some();
        if is_physical || has(&self.maps.roughness) || has(&self.maps.metallic) {
            let written = self.exponent.map_or(1.0, |_| roughness);
            let default = if has(&self.maps.roughness) { 1.0 } else { written };
            return Material {
                metallic: self
                    .metallic
                    .unwrap_or(f32::from(u8::from(has(&self.maps.metallic))))
                    .clamp(0.0, 1.0),
                ..Material::glossy(
                    name,
                    color,
                    self.roughness.unwrap_or(default).clamp(0.0, 1.0),
                    ior.map_or(DIELECTRIC_F0, f0_of_ior),
                )
            };
        }
        let specular = self.specular.clamp(Vec3::ZERO, Vec3::ONE);
        let strength = specular.max_element();
        let is_refracting = matches!(self.illum, Some(6 | 7)) && self.filter != Some(Vec3::ZERO);
        if let (true, 1.0, Some(ior)) = (is_refracting, opacity, ior) {
            let tint = self.filter.unwrap_or(Vec3::ONE).clamp(Vec3::ZERO, Vec3::ONE);
            let roughness = if roughness <= SMOOTHEST || self.exponent.is_none() { 0.0 } else { roughness };
            return Material { roughness, ..Material::glass(name, tint, ior) };
        }
        let mirrors = matches!(self.illum, Some(3..)) && strength > 0.0 && opacity == 1.0;
        let is_metal = mirrors && color.max_element() < METAL * strength && !has(&self.maps.diffuse);
        let mirrored = if is_metal { specular } else { color };
        if mirrors && roughness <= SMOOTHEST {
            return Material::mirror(name, mirrored);
        }
        if is_metal {
            return Material::metal(name, mirrored, roughness);
        }
        if strength - specular.min_element() > 0.02 {
            report.add(NoteKind::Approximated, "a tinted highlight of a material, shown white", name);
        }
        if mirrors {
            return Material::glossy(name, color, roughness, strength);
        }
        match self.illum.unwrap_or(2) {
            2.. if strength > 0.0 && roughness < ROUGHEST_COAT => {
                let f0 = if opacity < 1.0 { ior.map(f0_of_ior) } else { None };
                Material::glossy(name, color, roughness, f0.unwrap_or(0.08 * strength))
            }
            _ => Material::diffuse(name, color),
        }
    }

    fn maps(&self, textures: &Textures, report: &mut Report) -> Maps {
        let Pictures { diffuse, emission, dissolve, roughness, metallic, normal, bump } = &self.maps;
        let indexed = |picture: &Option<Box<Picture>>| {
            let picture = picture.as_ref()?;
            Some((picture.clone(), textures.index(picture)?))
        };
        let whole = |picture| indexed(picture).map(|(picture, index)| picture.map(index));
        let share = |picture, is_opacity| {
            indexed(picture).map(|(picture, index)| picture.map_of_number(index, is_opacity, &textures.all))
        };
        let mut bumps = indexed(bump);
        if bumps.as_ref().is_some_and(|(_, index)| !has_normals(&textures.all[*index])) {
            report.add(NoteKind::LeftOut, "a map of heights", &self.name);
            bumps = None;
        }
        Maps {
            color: whole(diffuse),
            opacity: share(dissolve, true),
            metallic: share(metallic, false),
            roughness: share(roughness, false),
            transmission: None,
            emission: whole(emission),
            normal: indexed(normal).or(bumps).map(|(picture, index)| (picture.map(index), picture.bumps)),
        }
    }
}

/// Whether a picture shows normals: on average they point up, which is light blue.
pub(super) fn has_normals(texture: &Texture) -> bool {
    let mut sums = [0_u64; 3];
    for texel in &texture.texels {
        sums.iter_mut().zip(texel).for_each(|(sum, channel)| *sum += u64::from(*channel));
    }
    let [red, green, blue] = sums.map(|sum| sum as f64 / (255 * texture.texels.len().max(1)) as f64);
    let is_middle = |mean: f64| (mean - 0.5).abs() < 0.15;
    is_middle(red) && is_middle(green) && blue > 0.7
}

/// A number.
fn value(rest: &str, name: &str, report: &mut Report) -> Option<f32> {
    let value = number(without_comment(rest).split_ascii_whitespace().next().unwrap_or_default()) as f32;
    if !value.is_finite() {
        report.add(NoteKind::Repaired, "a material's value that is not a number", name);
        return None;
    }
    Some(value)
}

/// A colour of three numbers, or of one for all channels.
fn color(rest: &str, name: &str, report: &mut Report) -> Option<Vec3> {
    let words: Vec<&str> = without_comment(rest).split_ascii_whitespace().collect();
    if let Some(form @ ("spectral" | "xyz")) = words.first().copied() {
        report.add(NoteKind::LeftOut, format!("a colour as `{form}`"), name);
        return None;
    }
    let first = words.first().map_or(f64::NAN, |word| number(word));
    let channel = |index: usize| words.get(index).map_or(first, |word| number(word)) as f32;
    let color = Vec3::new(first as f32, channel(1), channel(2));
    if !color.is_finite() {
        report.add(NoteKind::Repaired, "a colour that is not made of numbers", name);
        return None;
    }
    Some(color)
}
