//! Wavefront OBJ: positions, colours, normals and texture coordinates, polygons, and the materials of its MTL files.
//!
//! Files are read as people have them. A number that is none, a name that is not defined or a statement that is not known
//! costs what depends on it, and a note in the report; only a face whose vertex does not exist, or a file without a usable
//! face, is an error.

mod attributes;
mod maps;
mod mtl;
mod smooth;

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::ops::Range;

use epigraph_files::MOST_TEXT;
use glam::{DVec3, Vec2, Vec3, Vec4};

use super::model::Model;
use super::polygons::{Assembly, Polygons};
use super::{colors, lossy};
use crate::limits::MAX_COORDINATE;
use crate::{Material, MeshError, NoteKind, Report};
use attributes::Attributes;
use maps::Textures;
use mtl::Mtl;
use smooth::SmoothNormals;

/// Reads an OBJ file; `beside` returns the bytes of a file that it names, of at most so many.
///
/// Every run of faces between `o`, `g` and `usemtl` lines becomes a part.
pub(super) fn read(
    text: &str,
    beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>,
) -> Result<Model, String> {
    let mut reader = Reader::default();
    for (number, line) in statements(text) {
        reader.line(&line, number, &beside).map_err(|message| format!("line {number}: {message}"))?;
    }
    reader.finish(text, beside)
}

/// The statements of a text with the number of the line on which each begins. A line that ends in a backslash goes on in
/// the next one, unless it is a comment.
fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    // Line feeds, with or without carriage returns, which are blanks; or carriage returns alone.
    let end = if text.contains('\n') { '\n' } else { '\r' };
    // Some files end in zeros or in the mark by which DOS ended texts.
    let mut lines =
        text.split(end).map(|line| line.trim_matches(|c: char| c.is_whitespace() || c.is_control())).zip(1..);
    std::iter::from_fn(move || {
        let (line, number) = lines.next()?;
        let Some(mut begun) = line.strip_suffix('\\').filter(|_| !line.starts_with('#')) else {
            return Some((number, Cow::Borrowed(line)));
        };
        let mut whole = String::new();
        loop {
            whole.extend([begun, " "]);
            let (next, _) = lines.next().unwrap_or_default();
            match next.strip_suffix('\\') {
                Some(next) => begun = next,
                None => return Some((number, Cow::Owned(whole + next))),
            }
        }
    })
}

/// The keyword of a statement, and what follows it.
fn keyword(line: &str) -> (&str, &str) {
    let (keyword, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
    (keyword, rest.trim_ascii_start())
}

/// What precedes a comment. Names may have the sign in them, so only numbers are read up to it.
fn without_comment(words: &str) -> &str {
    words.split('#').next().unwrap_or_default()
}

/// A name without what may be a comment: a number sign after a blank, and the rest.
fn before_comment(name: &str) -> &str {
    name.split_once(" #").or_else(|| name.split_once("\t#")).map_or(name, |(name, _)| name.trim_end())
}

/// A word that is a number, or NaN. A comma is a decimal point: some programs write numbers as their user's country does.
fn number(word: &str) -> f64 {
    word.parse().or_else(|_| word.replace(',', ".").parse()).unwrap_or(f64::NAN)
}

/// The beginning of a text from a file, for messages.
fn shortened(text: &str) -> String {
    text.chars().take(60).collect()
}

/// Means that a corner has no normal or texture coordinates.
const NONE: u32 = u32::MAX;
/// The index of those that do not exist.
const MISSING: u32 = u32::MAX - 1;

/// The material of faces: its index, or its name as long as no library has defined it.
type Named = Result<usize, String>;

/// A run of faces of one object and material.
struct Part {
    name: String,
    material: Option<Named>,
    polygons: Range<usize>,
}

#[derive(Default)]
struct Reader {
    report: Report,
    polygons: Polygons,
    /// The index of the normal of each of the polygons' corners.
    corner_normals: Vec<u32>,
    /// That of the texture coordinates.
    corner_uvs: Vec<u32>,
    /// Unit vectors, or zero for what is no direction.
    normals: Vec<Vec3>,
    /// With v downwards.
    uvs: Vec<Vec2>,
    /// As in the file, NaN where a vertex has none; only up to the last vertex that has one.
    colors: Vec<Vec4>,
    /// The first vertex whose coordinates are not numbers, and its line.
    first_bad_vertex: Option<(usize, String)>,
    /// The largest vertex number of a face, and the face's line: vertices may follow faces.
    largest: (u32, usize),
    materials: Vec<Mtl>,
    by_name: HashMap<String, usize>,
    /// The material files that were read, or looked for.
    libraries: HashSet<String>,
    lacks_library: bool,
    /// The name of the present object or group.
    name: String,
    material: Option<Named>,
    /// The present smoothing group; 0 for none.
    group: u32,
    /// The smoothing group of each polygon, only up to the last one that is in any.
    groups: Vec<u32>,
    parts: Vec<Part>,
}

impl Reader {
    fn line(
        &mut self,
        line: &str,
        number: usize,
        beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>,
    ) -> Result<(), String> {
        let (keyword, rest) = keyword(line);
        match keyword {
            "v" => self.vertex(without_comment(rest), number).map_err(|error| error.to_string())?,
            "vn" => self.normal(without_comment(rest)),
            "vt" => self.texture_coordinates(without_comment(rest)),
            // `fo` is the face of old files.
            "f" | "fo" => self.face(without_comment(rest), number)?,
            "o" | "g" => {
                self.finish_part();
                rest.clone_into(&mut self.name);
            }
            "usemtl" => {
                self.finish_part();
                let named = || self.material(rest).ok_or_else(|| rest.to_owned());
                self.material = (!rest.is_empty()).then(named);
            }
            "mtllib" => self.library(rest, beside),
            "s" => {
                self.group = if rest == "on" { 1 } else { without_comment(rest).trim().parse().unwrap_or(0) }
            }
            "l" => self.leave_out("a line"),
            "p" => self.leave_out("a point"),
            "curv" | "curv2" | "surf" => self.leave_out("a free-form curve or surface"),
            // These belong to curves and surfaces.
            "vp" | "cstype" | "deg" | "bmat" | "step" | "parm" | "trim" | "hole" | "scrv" | "sp" | "con"
            | "end" => {}
            "#MRGB" => self.packed_colors(rest),
            _ if keyword.is_empty() || keyword.starts_with('#') => {}
            _ => self.report.add(NoteKind::LeftOut, "a statement that is not known", &shortened(keyword)),
        }
        Ok(())
    }

    fn leave_out(&mut self, what: &str) {
        self.report.add(NoteKind::LeftOut, what, &self.name);
    }

    fn vertex(&mut self, rest: &str, line: usize) -> Result<(), MeshError> {
        let mut words = rest.split_ascii_whitespace();
        let mut next = || words.next().map_or(f64::NAN, number);
        let at = DVec3::new(next(), next(), next());
        if !at.is_finite() && self.first_bad_vertex.is_none() {
            self.first_bad_vertex = Some((line, shortened(rest.trim())));
        }
        // Three more numbers are a colour; a single one is a weight.
        if let (Some(red), Some(green), Some(blue)) = (words.next(), words.next(), words.next()) {
            let [red, green, blue] = [red, green, blue].map(|word| number(word) as f32);
            self.colors.resize(self.polygons.at.len(), Vec4::NAN);
            let color = Vec4::new(red, green, blue, 1.0);
            if !color.is_finite() {
                let what = "a colour of a vertex that is not made of numbers, taken as white";
                self.report.add(NoteKind::Repaired, what, &self.name);
            }
            self.colors.push(if color.is_finite() { color } else { Vec4::NAN });
        }
        self.polygons.at.push(at);
        MeshError::of_size(0, self.polygons.at.len())
    }

    /// Colours of the next vertices that have none as ZBrush writes them: eight hexadecimal digits each, for a mask, red,
    /// green and blue.
    fn packed_colors(&mut self, digits: &str) {
        for code in digits.trim().as_bytes().chunks_exact(8) {
            let code = std::str::from_utf8(code).ok().and_then(|code| u32::from_str_radix(code, 16).ok());
            if self.colors.len() < self.polygons.at.len() {
                let [_, red, green, blue] = code.map_or([255; 4], u32::to_be_bytes).map(f32::from);
                self.colors.push(Vec4::new(red, green, blue, 255.0) / 255.0);
            }
        }
    }

    fn texture_coordinates(&mut self, rest: &str) {
        let mut words = rest.split_ascii_whitespace().map(number);
        let (u, v) = (words.next().unwrap_or(f64::NAN), words.next().unwrap_or(0.0));
        let uv = Vec2::new(u as f32, (1.0 - v) as f32);
        if !uv.is_finite() {
            self.report.add(
                NoteKind::Repaired,
                "texture coordinates that are not numbers, taken as 0",
                &self.name,
            );
        }
        self.uvs.push(if uv.is_finite() { uv } else { Vec2::Y });
    }

    fn normal(&mut self, rest: &str) {
        let mut words = rest.split_ascii_whitespace();
        let mut next = || words.next().map_or(f64::NAN, number);
        let normal = DVec3::new(next(), next(), next());
        if !normal.is_finite() {
            let what = "a normal that is not a number, replaced by the face's";
            self.report.add(NoteKind::Repaired, what, &self.name);
        }
        self.normals.push(normal.normalize_or_zero().as_vec3());
    }

    fn face(&mut self, words: &str, line: usize) -> Result<(), String> {
        for word in words.split_ascii_whitespace() {
            let [vertex, uv, normal] = self.corner(word)?;
            if vertex >= self.largest.0 {
                self.largest = (vertex, line);
            }
            self.polygons.corners.push(vertex);
            self.corner_uvs.push(uv);
            self.corner_normals.push(normal);
        }
        self.polygons.close(&self.name, &mut self.report).map_err(|error| error.to_string())?;
        self.corner_uvs.truncate(self.polygons.corners.len());
        self.corner_normals.truncate(self.polygons.corners.len());
        let kept = self.polygons.len();
        if self.group > 0 && kept > self.groups.len() {
            self.groups.resize(kept - 1, 0);
            self.groups.push(self.group);
        }
        Ok(())
    }

    /// The vertex, texture coordinates and normal of `vertex`, `vertex/texture`, `vertex//normal` or all three; from 1, or negative from the
    /// latest.
    fn corner(&self, word: &str) -> Result<[u32; 3], String> {
        let mut fields = word.split('/');
        let field = fields.next().unwrap_or_default();
        let number: i64 =
            field.parse().map_err(|_| format!("`{}` is not a vertex number", shortened(field)))?;
        let count = self.polygons.at.len();
        let vertex = resolve(number, count)
            .ok_or_else(|| format!("vertex {number} does not exist: only {count} are defined so far"))?;
        let mut next = |count: usize| match fields.next() {
            None | Some("") => NONE,
            Some(field) => field.parse().ok().and_then(|number| resolve(number, count)).unwrap_or(MISSING),
        };
        Ok([vertex, next(self.uvs.len()), next(self.normals.len())])
    }

    /// Reads the material files of a line: one name, which may have blanks in it, or several.
    fn library(&mut self, names: &str, beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>) {
        // Once each, however often they are named.
        if !self.libraries.insert(names.to_owned()) {
            return;
        }
        let uncommented = before_comment(names);
        let read = |name| beside(name, MOST_TEXT).ok().map(|bytes| (name, Some(bytes)));
        let found: Vec<(&str, Option<Vec<u8>>)> = match [names, uncommented].into_iter().find_map(read) {
            Some(whole) => vec![whole],
            None => {
                let words = uncommented.split_ascii_whitespace();
                words.map(|word| (word, beside(word, MOST_TEXT).ok())).collect()
            }
        };
        let missing = "a material library that is missing or cannot be read";
        if found.iter().all(|(_, bytes)| bytes.is_none()) {
            self.report.add(NoteKind::LeftOut, missing, uncommented);
            self.lacks_library = true;
            return;
        }
        for (name, bytes) in found {
            let Some(bytes) = bytes else {
                self.report.add(NoteKind::LeftOut, missing, name);
                self.lacks_library = true;
                continue;
            };
            let folder = &name[..name.rfind(['/', '\\']).map_or(0, |slash| slash + 1)];
            for material in mtl::read(&lossy(&bytes), folder, &mut self.report) {
                self.by_name.insert(material.name.clone(), self.materials.len());
                self.materials.push(material);
            }
        }
    }

    /// The index of the material of that name, or of the name without what may be a comment.
    fn material(&self, name: &str) -> Option<usize> {
        let defined = |name: &str| self.by_name.get(name).copied();
        let is_commented = |material: &Mtl| before_comment(&material.name) == name;
        defined(name)
            .or_else(|| defined(before_comment(name)))
            .or_else(|| self.materials.iter().position(is_commented))
    }

    fn finish_part(&mut self) {
        let polygons = self.parts.last().map_or(0, |part| part.polygons.end)..self.polygons.len();
        if !polygons.is_empty() {
            let (name, material) = (self.name.clone(), self.material.clone());
            self.parts.push(Part { name, material, polygons });
        }
    }

    fn finish(
        mut self,
        text: &str,
        beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>,
    ) -> Result<Model, String> {
        self.finish_part();
        let (largest, line) = self.largest;
        let vertices = self.polygons.at.len();
        if largest as usize >= vertices && self.polygons.len() > 0 {
            return Err(format!(
                "line {line}: vertex {} does not exist: only {vertices} are defined",
                largest + 1
            ));
        }
        if self.polygons.len() == 0 {
            return Err(match vertices {
                0 => "it has neither vertices nor faces: it is not an OBJ file, or cut off".to_owned(),
                _ => "it has vertices, but no faces: `epigraph encode` makes a point set of them".to_owned(),
            });
        }
        // Whoever writes one writes all so.
        let mut vertices = statements(text).filter(|(_, line)| keyword(line).0 == "v").take(100);
        if vertices.any(|(_, line)| line.contains(',')) {
            self.report.add(NoteKind::Repaired, "numbers with a decimal comma", "");
        }
        let of_parts: Vec<Option<usize>> = (0..self.parts.len()).map(|part| self.material_of(part)).collect();
        let mut model = self.materials(&of_parts, beside);
        colors::linear(&mut self.colors);
        let mut assembly = Assembly::new(&self.polygons).map_err(|vertex| {
            let mut vertices = statements(text).filter(|(_, line)| keyword(line).0 == "v");
            let (number, line) = vertices.nth(vertex).unwrap_or_default();
            let limit = format!("farther out than {MAX_COORDINATE:e} m: make the model smaller");
            format!("line {number}: the vertex `{}` is {limit}", shortened(keyword(&line).1))
        })?;
        model.origin = assembly.origin;
        let lacks_normals = !self.groups.is_empty() && self.corner_normals.contains(&NONE);
        let smooth = lacks_normals.then(|| SmoothNormals::of(&self.polygons, &self.groups));
        // Where colours are all that there is, they are not those of plain grey.
        let mut white = None;
        for (part, mut material) in self.parts.iter().zip(of_parts) {
            let (mut shape, corners) = assembly.shape(part.polygons.clone(), &part.name, &mut self.report);
            if corners.is_empty() {
                continue;
            }
            let mut attributes =
                Attributes { reader: &self, corners: &corners, name: &part.name, report: Report::default() };
            attributes.normals(smooth.as_ref(), &mut shape);
            attributes.colors(&mut shape);
            if material.is_some_and(|index| !model.materials[index].maps.is_empty()) {
                attributes.uvs(&mut shape);
            }
            let report = attributes.report;
            self.report.extend(&report);
            if material.is_none() && !shape.colors.is_empty() {
                material = Some(*white.get_or_insert_with(|| {
                    model.materials.push(Material::diffuse("vertex colours", Vec3::ONE));
                    model.materials.len() - 1
                }));
            }
            model.parts.push((shape, material));
        }
        if model.parts.is_empty() {
            let example = self.first_bad_vertex.map_or_else(String::new, |(line, text)| {
                format!(", such as those of the vertex in line {line}, `{text}`")
            });
            return Err(format!("no face is usable: all have coordinates that are not numbers{example}"));
        }
        model.report = self.report;
        Ok(model)
    }

    /// The index of the material of a part, also if it was defined later.
    fn material_of(&mut self, part: usize) -> Option<usize> {
        let name = match self.parts[part].material.as_ref()? {
            Ok(index) => return Some(*index),
            Err(name) => name,
        };
        let defined_later = self.material(name);
        if defined_later.is_none() && !self.lacks_library {
            let what = "a material that is not defined, shown as plain grey";
            self.report.add(NoteKind::LeftOut, what, &shortened(name));
        }
        defined_later
    }

    /// A model of the materials, those that are used with their textures.
    fn materials(
        &mut self,
        of_parts: &[Option<usize>],
        beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>,
    ) -> Model {
        let mut is_used = vec![false; self.materials.len()];
        of_parts.iter().flatten().for_each(|&index| is_used[index] = true);
        let used = || self.materials.iter().zip(&is_used).filter(|(_, used)| **used).map(|(mtl, _)| mtl);
        let textures = Textures::load(used().flat_map(Mtl::pictures), beside, &mut self.report);
        // What is not used need not be reported.
        let mut unused = Report::default();
        let material = |(mtl, is_used): (&Mtl, &bool)| {
            mtl.to_material(&textures, if *is_used { &mut self.report } else { &mut unused })
        };
        let materials = self.materials.iter().zip(&is_used).map(material).collect();
        Model { materials, textures: textures.all, ..Model::default() }
    }
}

/// The index that a number of a face means, if it can be one: from 1, or negative from the latest of `count`. What it means
/// may not be defined yet.
fn resolve(number: i64, count: usize) -> Option<u32> {
    let index = if number < 0 { count as i64 + number } else { number - 1 };
    u32::try_from(index).ok().filter(|&index| index < MISSING)
}
#[cfg(test)]
mod tests;
