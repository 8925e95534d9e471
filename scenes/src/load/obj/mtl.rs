//! The material files of OBJ.

use glam::Vec3;

use super::{keyword, number, shortened, statements, without_comment};
use crate::limits::{MAX_RADIANCE, is_radiance};
use crate::{Material, NoteKind, Report};

/// A material as the file has it.
struct Mtl {
    name: String,
    diffuse: Vec3,
    specular: Vec3,
    emission: Vec3,
    exponent: f32,
    illum: u32,
}

/// Reads the materials of a file. What is wrong with a value is noted, and the value is that of a material without it.
pub(super) fn read(text: &str, report: &mut Report) -> Vec<Material> {
    let mut list: Vec<Mtl> = Vec::new();
    for (_, line) in statements(text) {
        let (keyword, rest) = keyword(&line);
        if keyword == "newmtl" {
            list.push(Mtl {
                name: rest.to_owned(),
                diffuse: Vec3::splat(0.7),
                specular: Vec3::ZERO,
                emission: Vec3::ZERO,
                exponent: 0.0,
                illum: 2,
            });
        }
        if let Some(material) = list.last_mut() {
            material.line(keyword, rest, report);
        }
    }
    list.into_iter().map(Mtl::into_material).collect()
}

impl Mtl {
    fn line(&mut self, keyword: &str, rest: &str, report: &mut Report) {
        let name = &self.name;
        let mut color = |slot: &mut Vec3| *slot = color(rest, name, report).unwrap_or(*slot);
        match keyword {
            "Kd" => color(&mut self.diffuse),
            "Ks" => color(&mut self.specular),
            "Ke" => {
                color(&mut self.emission);
                if !is_radiance(self.emission) {
                    report.add(NoteKind::Repaired, format!("an emission beyond {MAX_RADIANCE:e}"), name);
                    self.emission = self.emission.min(Vec3::splat(MAX_RADIANCE));
                }
            }
            "Ns" | "illum" => {
                let value = number(without_comment(rest).trim());
                if !value.is_finite() {
                    report.add(NoteKind::Repaired, "a material's value that is not a number", name);
                } else if keyword == "Ns" {
                    self.exponent = value as f32;
                } else {
                    self.illum = value as u32;
                }
            }
            // Light from nowhere, which no tracer has, and how sharply it is mirrored.
            "Ka" | "map_Ka" | "sharpness" | "newmtl" => {}
            _ if keyword.is_empty() || keyword.starts_with('#') => {}
            _ => report.add(
                NoteKind::LeftOut,
                format!("the statement `{}` of a material", shortened(keyword)),
                name,
            ),
        }
    }

    /// Model 3 and up reflect their surroundings (a metal); below, a specular colour is a coat of a dielectric, whose
    /// reflectance at normal incidence is by custom 0.08 times the "specular" that exporters write.
    ///
    /// The exponent becomes a roughness by the rule with which Blender wrote it, Ns = (30 (1 - roughness))^2; beyond
    /// 0.6 the lobe is too wide and weak to tell from diffuse.
    fn into_material(self) -> Material {
        const ROUGHEST_COAT: f32 = 0.6;
        let roughness = (1.0 - self.exponent.max(0.0).sqrt() / 30.0).clamp(0.02, 1.0);
        let specular = self.specular.max_element().clamp(0.0, 1.0);
        let color = self.diffuse.clamp(Vec3::ZERO, Vec3::ONE);
        let material = match self.illum {
            3.. if specular > 0.0 && roughness <= 0.02 => Material::mirror(self.name, color),
            3.. if specular > 0.0 => Material::glossy(self.name, color, roughness, specular),
            2 if specular > 0.0 && roughness < ROUGHEST_COAT => {
                Material::glossy(self.name, color, roughness, 0.08 * specular)
            }
            _ => Material::diffuse(self.name, color),
        };
        Material { emission: self.emission.max(Vec3::ZERO), ..material }
    }
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
