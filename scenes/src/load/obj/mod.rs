//! Wavefront OBJ: positions, vertex colours, normals, polygons, and the materials of its MTL files.
//!
//! Files are read as people have them. A number that is none, a name that is not defined or a statement that is not known
//! costs what depends on it, and a note in the report; only a face whose vertex does not exist, or a file without a usable
//! face, is an error.

mod mtl;

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::ops::Range;

use epigraph_files::MOST_TEXT;
use glam::{DVec3, Vec3};

use super::lossy;
use super::model::Model;
use super::polygons::{Assembly, Polygons};
use crate::limits::MAX_COORDINATE;
use crate::{Material, MeshError, NoteKind, Report};

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
    reader.finish(text)
}

/// The statements of a text with the number of the line on which each begins. A line that ends in a backslash goes on in
/// the next one, unless it is a comment.
fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    // Line feeds, with or without carriage returns, which are blanks; or carriage returns alone.
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let mut lines = text.split(end).map(str::trim).zip(1..);
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

/// A word that is a number, or NaN.
fn number(word: &str) -> f64 {
    word.parse().unwrap_or(f64::NAN)
}

/// The beginning of a text from a file, for messages.
fn shortened(text: &str) -> String {
    text.chars().take(60).collect()
}

/// Means that a corner has no normal.
const NONE: u32 = u32::MAX;
/// The index of a normal that does not exist.
const MISSING: u32 = u32::MAX - 1;

/// The material of faces: its index, or its name as long as no library has defined it.
type Named = Result<usize, String>;

/// A run of faces of one object and material.
struct Part {
    name: String,
    material: Option<Named>,
    polygons: Range<usize>,
    /// Whether some of its faces are in a smoothing group.
    is_smooth: bool,
}

#[derive(Default)]
struct Reader {
    report: Report,
    polygons: Polygons,
    /// The index of the normal of each of the polygons' corners.
    corner_normals: Vec<u32>,
    /// Unit vectors, or zero for what is no direction.
    normals: Vec<Vec3>,
    /// The first vertex whose coordinates are not numbers, and its line.
    first_bad_vertex: Option<(usize, String)>,
    /// The largest vertex number of a face, and the face's line: vertices may follow faces.
    largest: (u32, usize),
    materials: Vec<Material>,
    by_name: HashMap<String, usize>,
    /// The material files that were read, or looked for.
    libraries: HashSet<String>,
    lacks_library: bool,
    /// The name of the present object or group.
    name: String,
    material: Option<Named>,
    is_smooth: bool,
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
            "s" => self.is_smooth = !matches!(rest, "off" | "0" | ""),
            "l" => self.leave_out("a line"),
            "p" => self.leave_out("a point"),
            "curv" | "curv2" | "surf" => self.leave_out("a free-form curve or surface"),
            // These belong to curves and surfaces; texture coordinates to textures.
            "vp" | "cstype" | "deg" | "bmat" | "step" | "parm" | "trim" | "hole" | "scrv" | "sp" | "con"
            | "end" | "vt" => {}
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
        self.polygons.at.push(at);
        MeshError::of_size(0, self.polygons.at.len())
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
            let [vertex, normal] = self.corner(word)?;
            if vertex >= self.largest.0 {
                self.largest = (vertex, line);
            }
            self.polygons.corners.push(vertex);
            self.corner_normals.push(normal);
        }
        self.polygons.close(&self.name, &mut self.report).map_err(|error| error.to_string())?;
        self.corner_normals.truncate(self.polygons.corners.len());
        Ok(())
    }

    /// The vertex and normal of `vertex`, `vertex/texture`, `vertex//normal` or all three; from 1, or negative from the
    /// latest.
    fn corner(&self, word: &str) -> Result<[u32; 2], String> {
        let mut fields = word.split('/');
        let field = fields.next().unwrap_or_default();
        let number: i64 =
            field.parse().map_err(|_| format!("`{}` is not a vertex number", shortened(field)))?;
        let count = self.polygons.at.len();
        let vertex = resolve(number, count)
            .ok_or_else(|| format!("vertex {number} does not exist: only {count} are defined so far"))?;
        let normal = match fields.nth(1) {
            None | Some("") => NONE,
            Some(field) => {
                field.parse().ok().and_then(|number| resolve(number, self.normals.len())).unwrap_or(MISSING)
            }
        };
        Ok([vertex, normal])
    }

    /// Reads the material files of a line: one name, which may have blanks in it, or several.
    fn library(&mut self, names: &str, beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>) {
        // Once each, however often they are named.
        if !self.libraries.insert(names.to_owned()) {
            return;
        }
        let uncommented = before_comment(names);
        let whole = [names, uncommented].into_iter().find_map(|name| beside(name, MOST_TEXT).ok());
        let found: Vec<(&str, Option<Vec<u8>>)> = match whole {
            Some(bytes) => vec![(names, Some(bytes))],
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
            for material in mtl::read(&lossy(&bytes), &mut self.report) {
                self.by_name.insert(material.name.clone(), self.materials.len());
                self.materials.push(material);
            }
        }
    }

    /// The index of the material of that name, or of the name without what may be a comment.
    fn material(&self, name: &str) -> Option<usize> {
        let defined = |name: &str| self.by_name.get(name).copied();
        let is_commented = |material: &Material| before_comment(&material.name) == name;
        defined(name)
            .or_else(|| defined(before_comment(name)))
            .or_else(|| self.materials.iter().position(is_commented))
    }

    fn finish_part(&mut self) {
        let polygons = self.parts.last().map_or(0, |part| part.polygons.end)..self.polygons.len();
        if !polygons.is_empty() {
            let (name, material) = (self.name.clone(), self.material.clone());
            self.parts.push(Part { name, material, polygons, is_smooth: self.is_smooth });
        }
    }

    fn finish(mut self, text: &str) -> Result<Model, String> {
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
        let mut assembly = Assembly::new(&self.polygons).map_err(|vertex| {
            let mut vertices = statements(text).filter(|(_, line)| keyword(line).0 == "v");
            let (number, line) = vertices.nth(vertex).unwrap_or_default();
            let limit = format!("farther out than {MAX_COORDINATE:e} m: make the model smaller");
            format!("line {number}: the vertex `{}` is {limit}", shortened(keyword(&line).1))
        })?;
        let mut model = Model { origin: assembly.origin, ..Model::default() };
        for part in &self.parts {
            let name = &part.name;
            let (mut shape, corners) = assembly.shape(part.polygons.clone(), name, &mut self.report);
            if corners.is_empty() {
                continue;
            }
            if corners.iter().flatten().any(|&corner| self.corner_normals[corner] != NONE) {
                let mut normal = |corner: usize| match self.corner_normals[corner] {
                    NONE => Vec3::ZERO,
                    index => self.normals.get(index as usize).copied().unwrap_or_else(|| {
                        let what = "a normal that does not exist, replaced by the face's";
                        self.report.add(NoteKind::Repaired, what, name);
                        Vec3::ZERO
                    }),
                };
                shape.normals = corners.iter().map(|corners| corners.map(&mut normal)).collect();
            } else if part.is_smooth {
                let what = "a smoothing group without normals, shaded flat";
                self.report.add(NoteKind::Approximated, what, name);
            }
            let material = match &part.material {
                None => None,
                Some(Ok(index)) => Some(*index),
                Some(Err(name)) => {
                    let defined_later = self.material(name);
                    if defined_later.is_none() && !self.lacks_library {
                        let what = "a material that is not defined, shown as plain grey";
                        self.report.add(NoteKind::LeftOut, what, &shortened(name));
                    }
                    defined_later
                }
            };
            model.parts.push((shape, material));
        }
        if model.parts.is_empty() {
            let example = self.first_bad_vertex.map_or_else(String::new, |(line, text)| {
                format!(", such as those of the vertex in line {line}, `{text}`")
            });
            return Err(format!("no face is usable: all have coordinates that are not numbers{example}"));
        }
        model.materials = self.materials;
        model.report = self.report;
        Ok(model)
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
