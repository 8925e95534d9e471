//! PLY, text and binary: vertices with normals and colours, and faces of any number of corners or strips of triangles.

mod header;

use std::io::Read;

use glam::{DVec3, Vec3};

use super::model::Model;
use super::polygons::{Assembly, Polygons};
use crate::{MeshError, NoteKind, Report};
use header::{Element, Format, Header, Kind, Property};

/// Bytes of a packed file's header that are looked at before all is unpacked.
const LONGEST_HEADER: u64 = 1 << 16;

/// Reads a whole PLY file.
pub(super) fn read(bytes: &[u8]) -> Result<Model, String> {
    let header = Header::parse(bytes)?;
    check_counts(&header)?;
    let vertex = header.element("vertex").ok_or("no element `vertex` in the header")?;
    if let Some(missing) =
        ["x", "y", "z"].iter().find(|name| !vertex.properties.iter().any(|p| p.name == **name))
    {
        return Err(format!("the element `vertex` has no property `{missing}`"));
    }
    let mut reader = Reader { vertices: vertex.count, ..Reader::default() };
    let mut body = Body { rest: &bytes[header.length..], format: header.format, has_more_words: false };
    for element in &header.elements {
        reader.elements(&mut body, element)?;
    }
    if body.has_more_words {
        reader.report.add(
            NoteKind::LeftOut,
            "words at the end of lines, which the header does not declare",
            "",
        );
    }
    reader.finish()
}

/// Refuses a file whose header, at its `start`, declares more vertices or faces than a scene may have. A start that is no
/// header is left to [`read`].
pub(super) fn check_start(start: impl Read) -> Result<(), String> {
    let mut bytes = Vec::new();
    // What is wrong with the rest is found when it is read.
    let _ = start.take(LONGEST_HEADER).read_to_end(&mut bytes);
    Header::parse(&bytes).map_or(Ok(()), |header| check_counts(&header))
}

fn check_counts(header: &Header) -> Result<(), String> {
    let count = |name: &str| header.element(name).map_or(0, |element| element.count);
    MeshError::of_size(count("face"), count("vertex"))
        .map_err(|error| format!("the header declares too much: {error}"))
}

/// The elements that have not been read yet.
struct Body<'a> {
    rest: &'a [u8],
    format: Format,
    /// Whether a line of a text had more words than its element has numbers.
    has_more_words: bool,
}

impl<'a> Body<'a> {
    /// The next number, NaN if its word is none; `None` at the end of the file.
    fn number(&mut self, kind: Kind) -> Option<f64> {
        if self.format == Format::Text {
            return self.word().map(parse);
        }
        Some(match kind {
            Kind::I8 => i8::from_le_bytes(self.bytes()?).into(),
            Kind::U8 => u8::from_le_bytes(self.bytes()?).into(),
            Kind::I16 => i16::from_le_bytes(self.bytes()?).into(),
            Kind::U16 => u16::from_le_bytes(self.bytes()?).into(),
            Kind::I32 => i32::from_le_bytes(self.bytes()?).into(),
            Kind::U32 => u32::from_le_bytes(self.bytes()?).into(),
            Kind::I64 => i64::from_le_bytes(self.bytes()?) as f64,
            Kind::U64 => u64::from_le_bytes(self.bytes()?) as f64,
            Kind::F32 => f32::from_le_bytes(self.bytes()?).into(),
            Kind::F64 => f64::from_le_bytes(self.bytes()?),
        })
    }

    /// The next bytes, the lowest first.
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        let mut bytes = *bytes;
        if self.format == Format::BigEndian {
            bytes.reverse();
        }
        Some(bytes)
    }

    fn word(&mut self) -> Option<&'a [u8]> {
        let text = self.rest.trim_ascii_start();
        let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
        let word;
        (word, self.rest) = text.split_at(end);
        (!word.is_empty()).then_some(word)
    }

    /// Goes to the next line of a text.
    fn end_element(&mut self) {
        if self.format == Format::Text {
            let end =
                self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(self.rest.len());
            self.has_more_words |= !self.rest[..end].trim_ascii().is_empty();
            self.rest = &self.rest[end..];
        }
    }

    /// Reads the numbers of a property one by one: one, or those of a list.
    fn property(&mut self, property: &Property, mut each: impl FnMut(f64)) -> Result<(), Stop> {
        let count = match property.list {
            None => 1.0,
            Some(kind) => self.number(kind).ok_or(Stop::End)?,
        };
        if !(count >= 0.0 && count <= f64::from(u32::MAX)) {
            return Err(Stop::Length);
        }
        (0..count as usize).try_for_each(|_| {
            each(self.number(property.kind).ok_or(Stop::End)?);
            Ok(())
        })
    }
}

/// Why an element cannot be read.
enum Stop {
    /// The file ends.
    End,
    /// The length of a list is no number of elements.
    Length,
    /// Something else, as what follows its name.
    Other(String),
}

/// A number in a text. Most are short integers.
fn parse(word: &[u8]) -> f64 {
    if word.len() < 10 && word.iter().all(u8::is_ascii_digit) {
        return word.iter().fold(0_u32, |number, digit| 10 * number + u32::from(digit - b'0')).into();
    }
    std::str::from_utf8(word).ok().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN)
}

/// The names of the numbers that a vertex may have, by their places in [`Values`].
const VERTEX: [&[&str]; IGNORED] = [&["x"], &["y"], &["z"], &["nx"], &["ny"], &["nz"]];
/// The place of numbers that are not used.
const IGNORED: usize = 6;
/// The numbers of a vertex.
type Values = [f64; IGNORED + 1];

/// The names of the list of a face's vertices.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

#[derive(Default)]
struct Reader {
    report: Report,
    /// The number of vertices that the header declares.
    vertices: usize,
    polygons: Polygons,
    /// Unit vectors, or zero for what is no direction; none if the vertices have no normals.
    normals: Vec<Vec3>,
}

impl Reader {
    /// Reads all elements of a kind.
    fn elements(&mut self, body: &mut Body, element: &Element) -> Result<(), String> {
        let Element { name, count, properties } = element;
        let place_of = |property: &Property| {
            let place = VERTEX.iter().position(|names| names.contains(&property.name.as_str()));
            place.filter(|_| property.list.is_none()).unwrap_or(IGNORED)
        };
        let places: Vec<usize> = properties.iter().map(place_of).collect();
        match name.as_str() {
            "vertex" => {
                let unused = properties.iter().zip(&places).filter(|(_, place)| **place == IGNORED);
                unused
                    .for_each(|(property, _)| self.leave_out("data of vertices that is not shown", property));
            }
            "face" | "tristrips" => {
                let unused = properties.iter().filter(|property| !CORNERS.contains(&property.name.as_str()));
                unused.for_each(|property| self.leave_out("data of faces that is not shown", property));
            }
            _ => self.report.add_many(NoteKind::LeftOut, "an element that is not known", name, *count),
        }
        // Nothing of it is in the file.
        if properties.is_empty() {
            return Ok(());
        }
        let has_normals = [3, 4, 5].iter().all(|place| places.contains(place));
        for index in 0..*count {
            let read = match name.as_str() {
                "vertex" => self.vertex(body, properties, &places, has_normals),
                "face" => self.face(body, properties),
                "tristrips" => self.strips(body, properties),
                _ => properties.iter().try_for_each(|property| body.property(property, |_| {})),
            };
            read.map_err(|stop| match stop {
                Stop::End => {
                    format!("cut off: it ends within {name} {index} of {count}; copy or download it again")
                }
                Stop::Length => format!("{name} {index} has a list whose length is no number"),
                Stop::Other(message) => format!("{name} {index}{message}"),
            })?;
            body.end_element();
        }
        Ok(())
    }

    fn leave_out(&mut self, what: &str, property: &Property) {
        self.report.add(NoteKind::LeftOut, what, &property.name);
    }

    fn vertex(
        &mut self,
        body: &mut Body,
        properties: &[Property],
        places: &[usize],
        has_normals: bool,
    ) -> Result<(), Stop> {
        let mut values: Values = [0.0; IGNORED + 1];
        for (property, place) in properties.iter().zip(places) {
            body.property(property, |number| values[*place] = number)?;
        }
        let [x, y, z, nx, ny, nz, _] = values;
        self.polygons.at.push(DVec3::new(x, y, z));
        if has_normals {
            let normal = DVec3::new(nx, ny, nz);
            if !normal.is_finite() {
                let what = "a normal that is not a number, replaced by the face's";
                self.report.add(NoteKind::Repaired, what, "");
            }
            self.normals.push(normal.normalize_or_zero().as_vec3());
        }
        Ok(())
    }

    fn face(&mut self, body: &mut Body, properties: &[Property]) -> Result<(), Stop> {
        for property in properties {
            if CORNERS.contains(&property.name.as_str()) {
                let Self { polygons, vertices, .. } = self;
                let mut wrong = None;
                body.property(property, |number| match index(number, *vertices) {
                    Some(vertex) => polygons.corners.push(vertex),
                    None => wrong = Some(number),
                })?;
                check_vertex(wrong, *vertices)?;
            } else {
                body.property(property, |_| {})?;
            }
        }
        self.polygons.close("", &mut self.report).map_err(|error| Stop::Other(format!(": {error}")))
    }

    /// Strips of triangles, each next one turned the other way; -1 begins a new strip.
    fn strips(&mut self, body: &mut Body, properties: &[Property]) -> Result<(), Stop> {
        for property in properties {
            let is_corners = CORNERS.contains(&property.name.as_str());
            let mut numbers = Vec::new();
            body.property(property, |number| numbers.push(number))?;
            for strip in numbers.split(|number| *number == -1.0).filter(|_| is_corners) {
                for (place, corners) in strip.windows(3).enumerate() {
                    let [a, b, c] = if place % 2 == 0 { [0, 1, 2] } else { [1, 0, 2] }.map(|k| corners[k]);
                    // Strips repeat corners to turn.
                    if a == b || b == c || c == a {
                        continue;
                    }
                    for number in [a, b, c] {
                        let vertex = index(number, self.vertices);
                        check_vertex(vertex.is_none().then_some(number), self.vertices)?;
                        self.polygons.corners.extend(vertex);
                    }
                    let closed = self.polygons.close("", &mut self.report);
                    closed.map_err(|error| Stop::Other(format!(": {error}")))?;
                }
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Model, String> {
        if self.polygons.len() == 0 {
            return Err("it has points, but no faces: `epigraph encode` makes a point set of them".to_owned());
        }
        let mut assembly = Assembly::new(&self.polygons).map_err(|vertex| {
            let position = self.polygons.at[vertex].as_vec3();
            MeshError::TooFar { vertex, position }.to_string()
        })?;
        assembly.in_file_order = true;
        let (mut shape, corners) = assembly.shape(0..self.polygons.len(), "", &mut self.report);
        if corners.is_empty() {
            let is_bad = |at: &DVec3| !at.is_finite();
            let bad = self.polygons.at.iter().position(is_bad).unwrap_or_default();
            let DVec3 { x, y, z } = self.polygons.at[bad];
            return Err(format!(
                "no face is usable: all have coordinates that are not numbers, such as those of vertex {bad}, ({x}, {y}, {z})"
            ));
        }
        if !self.normals.is_empty() {
            let normal = |corner: usize| self.normals[self.polygons.corners[corner] as usize];
            shape.normals = corners.iter().map(|corners| corners.map(normal)).collect();
        }
        let origin = assembly.origin;
        Ok(Model { origin, report: self.report, ..Model::from_shape(shape) })
    }
}

/// The vertex that a number means, if there is one.
fn index(number: f64, vertices: usize) -> Option<u32> {
    (number >= 0.0 && number < vertices as f64 && number.fract() == 0.0).then_some(number as u32)
}

fn check_vertex(wrong: Option<f64>, vertices: usize) -> Result<(), Stop> {
    match wrong {
        Some(number) => {
            Err(Stop::Other(format!(" refers to vertex {number}, but there are only {vertices} vertices")))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
