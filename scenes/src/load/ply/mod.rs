//! PLY, text and binary: vertices with normals, colours and texture coordinates, faces of any number of corners, which may
//! have colours and texture coordinates of their own, and strips of triangles.

mod body;
mod header;

use std::io::Read;
use std::ops::Range;
use std::sync::Arc;

use epigraph_files::MOST_DATA;
use glam::{DVec3, Vec2, Vec3, Vec4};

use super::model::Model;
use super::polygons::{Assembly, Polygons};
use super::{colors, images};
use crate::{Alpha, Map, Material, MeshError, NoteKind, Report, Texture};
use body::{Body, Stop};
pub use header::ply_header;
use header::{Element, Header, Kind, Property};

/// Bytes of a packed file's header that are looked at before all is unpacked.
const LONGEST_HEADER: u64 = 1 << 16;

/// Reads a whole PLY file; `beside` returns the bytes of a file that it names, of at most so many.
pub(super) fn read(
    bytes: &[u8],
    beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>,
) -> Result<Model, String> {
    let header = Header::parse(bytes)?;
    check_counts(&header)?;
    let vertex = header.element("vertex").ok_or("no element `vertex` in the header")?;
    if let Some(missing) =
        ["x", "y", "z"].iter().find(|name| !vertex.properties.iter().any(|p| p.name == **name))
    {
        return Err(format!("the element `vertex` has no property `{missing}`"));
    }
    let read_all = |has_lines: bool| {
        let mut reader = Reader { vertices: vertex.count, ..Reader::default() };
        let rest = &bytes[header.length..];
        let mut body = Body { rest, format: header.format, has_lines, has_more_words: false };
        let read = header.elements.iter().try_for_each(|element| reader.elements(&mut body, element));
        (read, reader, body)
    };
    let (mut read, mut reader, mut body) = read_all(true);
    if read.is_err() && body.has_more_words {
        // Some write several elements in a line, which shows by the numbers' coming out even.
        let freely = read_all(false);
        if freely.0.is_ok() && freely.2.rest.trim_ascii().is_empty() {
            (read, reader, body) = freely;
        }
    }
    read?;
    if !body.rest.trim_ascii().is_empty() {
        reader.report.add(NoteKind::LeftOut, "what follows the last element", "");
    }
    if body.has_more_words {
        reader.report.add(
            NoteKind::LeftOut,
            "words at the end of lines, which the header does not declare",
            "",
        );
    }
    reader.finish(&header.textures, beside)
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

/// The names of the numbers that a vertex may have, by their places in [`Values`].
const VERTEX: [&[&str]; IGNORED] = [
    &["x"],
    &["y"],
    &["z"],
    &["nx"],
    &["ny"],
    &["nz"],
    &["red", "diffuse_red", "r"],
    &["green", "diffuse_green", "g"],
    &["blue", "diffuse_blue", "b"],
    &["alpha", "diffuse_alpha", "a"],
    &["u", "s", "texture_u"],
    &["v", "t", "texture_v"],
];
const NORMAL: Range<usize> = 3..6;
const COLOR: Range<usize> = 6..9;
/// Colour and opacity.
const COLORS: Range<usize> = 6..10;
const UV: Range<usize> = 10..12;
/// The place of numbers that are not used.
const IGNORED: usize = 12;
/// The numbers of a vertex, or those of a face that vertices have too.
type Values = [f64; IGNORED + 1];
/// White, with nothing else.
const NO_VALUES: Values = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0];

/// The names of the list of a face's vertices.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];
/// The list of the texture coordinates of a face's corners, and the number of their texture.
const CORNER_UVS: &str = "texcoord";
const TEXTURE: &str = "texnumber";

/// What to do with a property.
struct Use<'a> {
    property: &'a Property,
    /// Its place in [`Values`], and what its number is multiplied by.
    place: usize,
    unit: f64,
}

impl<'a> Use<'a> {
    fn of(property: &'a Property) -> Self {
        let place = VERTEX.iter().position(|names| names.contains(&property.name.as_str()));
        let place = place.filter(|_| property.list.is_none()).unwrap_or(IGNORED);
        // Integers are shares of the largest one, if it is that of a byte or a word without a sign.
        let unit = match property.kind {
            _ if !COLORS.contains(&place) => 1.0,
            Kind::F32 | Kind::F64 => 1.0,
            Kind::U16 => 1.0 / f64::from(u16::MAX),
            _ => 1.0 / f64::from(u8::MAX),
        };
        Self { property, place, unit }
    }
}

/// Whether all places of a range are among those of some properties.
fn has(uses: &[Use], places: Range<usize>) -> bool {
    places.into_iter().all(|place| uses.iter().any(|one| one.place == place))
}

fn color_of(values: &Values) -> Vec4 {
    let color = Vec4::from([6, 7, 8, 9].map(|place| values[place] as f32));
    if color.is_finite() { color } else { Vec4::NAN }
}

/// Texture coordinates with v downwards.
fn uv_of(u: f64, v: f64) -> Vec2 {
    let uv = Vec2::new(u as f32, (1.0 - v) as f32);
    if uv.is_finite() { uv } else { Vec2::Y }
}

#[derive(Default)]
struct Reader {
    report: Report,
    /// The number of vertices that the header declares.
    vertices: usize,
    polygons: Polygons,
    /// Unit vectors, or zero for what is no direction; none if the vertices have no normals.
    normals: Vec<Vec3>,
    /// Of vertices, and of corners: as in the file, or none.
    colors: Vec<Vec4>,
    corner_colors: Vec<Vec4>,
    uvs: Vec<Vec2>,
    corner_uvs: Vec<Vec2>,
    /// The number of each polygon's texture, if faces have it.
    texture_numbers: Vec<f64>,
}

impl Reader {
    /// Reads all elements of a kind.
    fn elements(&mut self, body: &mut Body, element: &Element) -> Result<(), String> {
        let Element { name, count, properties } = element;
        let uses: Vec<Use> = properties.iter().map(Use::of).collect();
        let (what, is_used): (_, fn(&Use) -> bool) = match name.as_str() {
            "vertex" => ("data of vertices that is not shown", |one| one.place != IGNORED),
            "face" => ("data of faces that is not shown", |one| {
                let name = one.property.name.as_str();
                COLORS.contains(&one.place)
                    || CORNERS.contains(&name)
                    || [CORNER_UVS, TEXTURE].contains(&name)
            }),
            "tristrips" => {
                ("data of faces that is not shown", |one| CORNERS.contains(&one.property.name.as_str()))
            }
            _ => {
                self.report.add_many(NoteKind::LeftOut, "an element that is not known", name, *count);
                ("", |_| true)
            }
        };
        for one in uses.iter().filter(|one| !is_used(one)) {
            self.report.add(NoteKind::LeftOut, what, &one.property.name);
        }
        // Nothing of it is in the file.
        if properties.is_empty() {
            return Ok(());
        }
        // No more than the rest of the file can hold: a vertex has three numbers at least, a face four.
        let most = (body.rest.len() / 3).min(*count);
        match name.as_str() {
            "vertex" => self.polygons.at.reserve_exact(most),
            "face" => self.polygons.reserve(most),
            _ => {}
        }
        let has_attributes = [NORMAL, COLOR, UV].map(|places| has(&uses, places));
        for index in 0..*count {
            let read = match name.as_str() {
                "vertex" => self.vertex(body, &uses, has_attributes),
                "face" => self.face(body, &uses, has_attributes[1]),
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

    fn vertex(&mut self, body: &mut Body, uses: &[Use], has_attributes: [bool; 3]) -> Result<(), Stop> {
        let mut values = NO_VALUES;
        for Use { property, place, unit } in uses {
            body.property(property, |number| values[*place] = unit * number)?;
        }
        let [x, y, z, nx, ny, nz, _, _, _, _, u, v, _] = values;
        self.polygons.at.push(DVec3::new(x, y, z));
        let [has_normal, has_color, has_uv] = has_attributes;
        if has_normal {
            let normal = DVec3::new(nx, ny, nz);
            if !normal.is_finite() {
                let what = "a normal that is not a number, replaced by the face's";
                self.report.add(NoteKind::Repaired, what, "");
            }
            self.normals.push(normal.normalize_or_zero().as_vec3());
        }
        if has_color {
            let color = color_of(&values);
            if color.is_nan() {
                let what = "a colour that is not made of numbers, taken as white";
                self.report.add(NoteKind::Repaired, what, "");
            }
            self.colors.push(color);
        }
        self.uvs.extend(has_uv.then(|| uv_of(u, v)));
        Ok(())
    }

    fn face(&mut self, body: &mut Body, uses: &[Use], has_color: bool) -> Result<(), Stop> {
        let mut values = NO_VALUES;
        let mut uvs = Vec::new();
        let (mut has_uvs, mut texture) = (false, None);
        let begin = self.polygons.corners.len();
        for Use { property, place, unit } in uses {
            if CORNERS.contains(&property.name.as_str()) {
                let Self { polygons, vertices, .. } = self;
                let mut wrong = None;
                body.property(property, |number| match index(number, *vertices) {
                    Some(vertex) => polygons.corners.push(vertex),
                    None => wrong = Some(number),
                })?;
                check_vertex(wrong, *vertices)?;
            } else if property.name == CORNER_UVS {
                has_uvs = true;
                body.property(property, |number| uvs.push(number))?;
            } else if property.name == TEXTURE {
                body.property(property, |number| texture = Some(number))?;
            } else {
                body.property(property, |number| values[*place] = unit * number)?;
            }
        }
        let before = self.polygons.len();
        self.polygons.close("", &mut self.report).map_err(|error| Stop::Other(format!(": {error}")))?;
        if self.polygons.len() == before {
            return Ok(());
        }
        let corners = begin..self.polygons.corners.len();
        if has_color {
            self.corner_colors.extend(corners.clone().map(|_| color_of(&values)));
        }
        if has_uvs {
            if uvs.len() != 2 * corners.len() {
                let what = "texture coordinates of a face that do not fit its corners, taken as 0";
                self.report.add(NoteKind::Repaired, what, "");
            }
            let number = |place: usize| uvs.get(place).copied().unwrap_or(0.0);
            self.corner_uvs
                .extend((0..corners.len()).map(|corner| uv_of(number(2 * corner), number(2 * corner + 1))));
        }
        self.texture_numbers.extend(texture);
        Ok(())
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

    fn finish(
        mut self,
        names: &[String],
        beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>,
    ) -> Result<Model, String> {
        let count = self.polygons.len();
        if count == 0 {
            return Err("it has points, but no faces: `epigraph encode` makes a point set of them".to_owned());
        }
        let has_corner_uvs = self.corner_uvs.len() == self.polygons.corners.len();
        let has_uvs = has_corner_uvs || !self.uvs.is_empty();
        let (textures, by_number) = if has_uvs {
            self.textures(names, beside)
        } else {
            let unused = |name: &String| {
                self.report.add(NoteKind::LeftOut, "a texture without texture coordinates", name)
            };
            names.iter().for_each(unused);
            (vec![], vec![])
        };
        if has_uvs && names.is_empty() {
            self.report.add(NoteKind::LeftOut, "texture coordinates without a texture", "");
        }
        let has_corner_colors = self.corner_colors.len() == self.polygons.corners.len();
        let colors = if has_corner_colors { &mut self.corner_colors } else { &mut self.colors };
        let is_transparent = repair_opacities(colors, &mut self.report);
        colors::linear(colors);
        let (colors, corner_colors) = (&self.colors, &self.corner_colors);

        let mut assembly = Assembly::new(&self.polygons).map_err(|vertex| {
            let position = self.polygons.at[vertex].as_vec3();
            MeshError::TooFar { vertex, position }.to_string()
        })?;
        assembly.in_file_order = true;
        let mut model = Model { origin: assembly.origin, textures, ..Model::default() };
        // The polygons of each texture; of the first one if faces do not say.
        let number = |polygon: usize| self.texture_numbers.get(polygon).map_or(0, |number| *number as usize);
        let pictures = by_number.len().max(1);
        for picture in 0..pictures {
            let of_picture = |polygon: &usize| number(*polygon).min(pictures - 1) == picture;
            let (mut shape, corners) = assembly.shape((0..count).filter(of_picture), "", &mut self.report);
            if corners.is_empty() {
                continue;
            }
            let vertex = |corner: usize| self.polygons.corners[corner] as usize;
            let each = |value: &dyn Fn(usize) -> Vec4| corners.iter().map(|all| all.map(value)).collect();
            if !self.normals.is_empty() {
                shape.normals =
                    corners.iter().map(|all| all.map(|corner| self.normals[vertex(corner)])).collect();
            }
            let shown = |color: Vec4| if color.is_nan() { Vec4::ONE } else { color };
            if has_corner_colors {
                shape.colors = each(&|corner| shown(corner_colors[corner]));
            } else if !colors.is_empty() {
                shape.colors = each(&|corner| shown(colors[vertex(corner)]));
            }
            let texture = by_number.get(picture).copied().flatten();
            if texture.is_some() {
                let uv = |corner: usize| {
                    if has_corner_uvs { self.corner_uvs[corner] } else { self.uvs[vertex(corner)] }
                };
                shape.uvs[0] = corners.iter().map(|all| all.map(uv)).collect();
            }
            let material = (texture.is_some() || !shape.colors.is_empty()).then(|| {
                let mut material =
                    Material::diffuse(names.get(picture).map_or("vertex colours", String::as_str), Vec3::ONE);
                material.maps.color = texture.map(Map::new);
                if is_transparent {
                    material.alpha = Alpha::Blend;
                }
                model.materials.push(material);
                model.materials.len() - 1
            });
            model.parts.push((shape, material));
        }
        if model.parts.is_empty() {
            let is_bad = |at: &DVec3| !at.is_finite();
            let bad = self.polygons.at.iter().position(is_bad).unwrap_or_default();
            let DVec3 { x, y, z } = self.polygons.at[bad];
            return Err(format!(
                "no face is usable: all have coordinates that are not numbers, such as those of vertex {bad}, ({x}, {y}, {z})"
            ));
        }
        model.report = self.report;
        Ok(model)
    }

    /// The textures of the files with these names, and for each name its texture, if it could be read.
    fn textures(
        &mut self,
        names: &[String],
        beside: impl Fn(&str, u64) -> Result<Vec<u8>, String>,
    ) -> (Vec<Arc<Texture>>, Vec<Option<usize>>) {
        let files: Vec<(String, Vec<u8>)> =
            names.iter().map(|name| (name.clone(), beside(name, MOST_DATA).unwrap_or_default())).collect();
        let (mut textures, mut by_number) = (Vec::new(), Vec::new());
        for (result, (name, bytes)) in images::decode(&files).into_iter().zip(&files) {
            by_number.push(match result {
                Ok(texture) => {
                    textures.push(texture);
                    Some(textures.len() - 1)
                }
                Err(message) => {
                    let what = match bytes.is_empty() {
                        true => "a texture that is missing".to_owned(),
                        false => format!("a texture, as {message}"),
                    };
                    self.report.add(NoteKind::LeftOut, what, name);
                    None
                }
            });
        }
        (textures, by_number)
    }
}

/// Whether some of the colours let light through. Opacities that are all 0 are taken as 1, and noted.
fn repair_opacities(colors: &mut [Vec4], report: &mut Report) -> bool {
    if !colors.is_empty() && colors.iter().all(|color| color.w == 0.0) {
        report.add(NoteKind::Repaired, "opacities that are all 0, taken as 1", "");
        colors.iter_mut().for_each(|color| color.w = 1.0);
    }
    colors.iter().any(|color| color.w < 1.0)
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
