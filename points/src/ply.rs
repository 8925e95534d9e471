//! PLY: ASCII and both binaries.

use std::{
    fmt::Display,
    io::{self, BufRead, Read, Write},
    str::FromStr,
};

use epigraph_scenes::ply_header;
use epigraph_streams::{Node, unpack_color, unpack_normal};
use glam::{DVec3, Vec3};
use ply_rs_bw::{
    parser::Parser,
    ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyType, ScalarType},
};

use crate::{MOST_POINTS, cloud::Cloud};

/// The longest header, in bytes.
const LONGEST_HEADER: u64 = 1 << 20;

/// The longest line of an ASCII file, in bytes.
const LONGEST_LINE: usize = 1 << 20;

/// A vertex, with the properties that are read.
struct Vertex {
    position: DVec3,
    color: [u8; 4],
    normal: Vec3,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { position: DVec3::ZERO, color: [255; 4], normal: Vec3::ZERO }
    }

    fn set_property(&mut self, name: &str, property: Property) {
        match name {
            "x" => self.position.x = number(&property),
            "y" => self.position.y = number(&property),
            "z" => self.position.z = number(&property),
            "nx" => self.normal.x = number(&property) as f32,
            "ny" => self.normal.y = number(&property) as f32,
            "nz" => self.normal.z = number(&property) as f32,
            _ => {
                if let Some(channel) = CHANNELS.iter().position(|names| names.contains(&name)) {
                    self.color[channel] = byte(&property);
                }
            }
        }
    }
}

/// The names of red, green, blue and alpha.
const CHANNELS: [[&str; 2]; 4] = [
    ["red", "diffuse_red"],
    ["green", "diffuse_green"],
    ["blue", "diffuse_blue"],
    ["alpha", "diffuse_alpha"],
];

fn number(property: &Property) -> f64 {
    match *property {
        Property::Char(value) => value.into(),
        Property::UChar(value) => value.into(),
        Property::Short(value) => value.into(),
        Property::UShort(value) => value.into(),
        Property::Int(value) => value.into(),
        Property::UInt(value) => value.into(),
        Property::Float(value) => value.into(),
        Property::Double(value) => value,
        _ => f64::NAN,
    }
}

/// A channel of a colour: fractions are parts of 1, words of 16 bits parts of 65,535, other integers bytes.
fn byte(property: &Property) -> u8 {
    let scale = match property {
        Property::Float(_) | Property::Double(_) => 255.0,
        Property::UShort(_) => 1.0 / 257.0,
        _ => 1.0,
    };
    (scale * number(property)).round() as u8
}

/// A face by the indices of its vertices.
struct Face(Vec<i64>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, name: &str, property: Property) {
        if name != "vertex_indices" && name != "vertex_index" {
            return;
        }
        self.0 = match property {
            Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
            _ => Vec::new(),
        };
    }
}

/// An element of another kind.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}

/// Reads the vertices of a file. If it has faces, vertices without normals get the means of theirs.
pub(crate) fn read(mut file: impl BufRead) -> Result<Cloud, String> {
    let mut start = Vec::new();
    file.by_ref().take(LONGEST_HEADER).read_to_end(&mut start).map_err(one_line)?;
    // What has no end of a header is refused with the parser's reason.
    let (text, length) =
        ply_header(&start).map_or((start.clone(), start.len()), |(text, end)| (text.into_bytes(), end));
    let header = Parser::<Other>::new().read_header(&mut text.as_slice()).map_err(one_line)?;
    let mut file = start[length..].chain(file);
    let vertex = header.elements.get("vertex").ok_or("no element `vertex` in the header")?;
    let has = |name: &str| vertex.properties.contains_key(name);
    if let Some(missing) = ["x", "y", "z"].into_iter().find(|name| !has(name)) {
        return Err(format!("element `vertex` has no property `{missing}`"));
    }
    if vertex.count > MOST_POINTS {
        return Err(format!("it has {} points; the most of a point set are {MOST_POINTS}", vertex.count));
    }
    let is_double =
        |name: &str| matches!(vertex.properties[name].data_type, PropertyType::Scalar(ScalarType::Double));
    let has_colors = CHANNELS[..3].iter().all(|names| names.iter().any(|name| has(name)));
    let has_normals = ["nx", "ny", "nz"].into_iter().all(has);
    let needs_faces = !has_normals && header.elements.get("face").is_some_and(|face| face.count > 0);
    let mut cloud = Cloud { single: !["x", "y", "z"].into_iter().any(is_double), ..Cloud::default() };
    for (name, element) in &header.elements {
        if element.properties.is_empty() && element.count > 0 {
            return Err(format!("element `{name}` has no properties"));
        }
        match name.as_str() {
            "vertex" => for_each::<Vertex>(&mut file, &header, element, |vertex| {
                cloud.push(vertex.position)?;
                if has_colors {
                    cloud.colors.push(vertex.color);
                }
                if has_normals {
                    cloud.normals.push(vertex.normal);
                }
                Ok(())
            })?,
            "face" if needs_faces => {
                cloud.normals.resize(cloud.positions.len(), Vec3::ZERO);
                for_each::<Face>(&mut file, &header, element, |face| add_normal(&mut cloud, &face.0))?;
            }
            // What follows the points, and is of no use, need not be read.
            _ if !cloud.positions.is_empty() && !needs_faces => break,
            _ => for_each::<Other>(&mut file, &header, element, |_| Ok(()))?,
        }
    }
    Ok(cloud)
}

/// Adds the normal of a face, as long as its area, to those of its vertices.
fn add_normal(cloud: &mut Cloud, corners: &[i64]) -> Result<(), String> {
    let count = cloud.positions.len();
    let index = |&corner: &i64| {
        let index = usize::try_from(corner).ok().filter(|&index| index < count);
        index.ok_or_else(|| format!("it refers to vertex {corner}, but there are only {count} before it"))
    };
    let corners = corners.iter().map(index).collect::<Result<Vec<_>, _>>()?;
    let at: Vec<DVec3> = corners.iter().map(|&corner| cloud.positions[corner]).collect();
    let normal: DVec3 = (2..at.len()).map(|k| (at[k - 1] - at[0]).cross(at[k] - at[0])).sum();
    // Vertices whose coordinates are no numbers are left out later.
    if normal.is_finite() {
        corners.into_iter().for_each(|corner| cloud.normals[corner] += normal.as_vec3());
    }
    Ok(())
}

/// Reads the elements of a kind one by one.
fn for_each<E: PropertyAccess>(
    file: &mut impl BufRead,
    header: &Header,
    element: &ElementDef,
    mut add: impl FnMut(E) -> Result<(), String>,
) -> Result<(), String> {
    let parser = Parser::<E>::new();
    for index in 0..element.count {
        let read = match header.encoding {
            Encoding::Ascii => read_line(file, element),
            Encoding::BinaryLittleEndian => parser.read_little_endian_element(file, element),
            Encoding::BinaryBigEndian => parser.read_big_endian_element(file, element),
        };
        let place = |cause: String| format!("{} {index} of {}: {cause}", element.name, element.count);
        let read = read.map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => place("the file ends before it".into()),
            _ => place(one_line(error)),
        })?;
        add(read).map_err(place)?;
    }
    Ok(())
}

/// Reads an element from a line. The parser's own function knows no `nan`, which scanners write for what they missed.
fn read_line<E: PropertyAccess>(file: &mut impl BufRead, element: &ElementDef) -> io::Result<E> {
    let line = next_line(file)?;
    let mut words = line.split_ascii_whitespace();
    let mut next = || words.next().ok_or("its line ends early").map_err(io::Error::other);
    let mut read = E::new();
    for (name, property) in &element.properties {
        let value = match &property.data_type {
            PropertyType::Scalar(kind) => scalar(next()?, kind)?,
            PropertyType::List(_, kind) => {
                let count: usize = parse(next()?)?;
                match kind {
                    ScalarType::Float | ScalarType::Double => {
                        Property::ListDouble((0..count).map(|_| parse(next()?)).collect::<Result<_, _>>()?)
                    }
                    _ => Property::ListInt((0..count).map(|_| parse(next()?)).collect::<Result<_, _>>()?),
                }
            }
        };
        read.set_property(name, value);
    }
    Ok(read)
}

/// The next line that is not blank. It ends in a line feed, a carriage return, or both.
fn next_line(file: &mut impl BufRead) -> io::Result<String> {
    let mut line = Vec::new();
    loop {
        let bytes = file.fill_buf()?;
        let is_last = bytes.is_empty();
        let end = bytes.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        let length = end.unwrap_or(bytes.len());
        line.extend(&bytes[..length]);
        file.consume(length + usize::from(end.is_some()));
        if line.len() > LONGEST_LINE {
            return Err(io::Error::other(format!("its line has more than {LONGEST_LINE} bytes")));
        }
        if (end.is_some() || is_last) && !line.trim_ascii().is_empty() {
            return String::from_utf8(line).map_err(|_| io::Error::other("it is no text"));
        }
        if is_last {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        if end.is_some() {
            line.clear();
        }
    }
}

fn scalar(word: &str, kind: &ScalarType) -> io::Result<Property> {
    Ok(match kind {
        ScalarType::Char => Property::Char(parse(word)?),
        ScalarType::UChar => Property::UChar(parse(word)?),
        ScalarType::Short => Property::Short(parse(word)?),
        ScalarType::UShort => Property::UShort(parse(word)?),
        ScalarType::Int => Property::Int(parse(word)?),
        ScalarType::UInt => Property::UInt(parse(word)?),
        ScalarType::Float => Property::Float(parse(word)?),
        ScalarType::Double => Property::Double(parse(word)?),
    })
}

fn parse<T: FromStr<Err: Display>>(word: &str) -> io::Result<T> {
    word.parse().map_err(|error| io::Error::other(format!("`{word}`: {error}")))
}

/// The parser's messages have several indented lines, of which the first ones say what is wrong.
fn one_line(error: io::Error) -> String {
    let text = error.to_string();
    let lines: Vec<&str> = text.lines().take(2).map(str::trim).collect();
    lines.join(" ").chars().take(300).collect()
}

/// Writes the points of nodes as a binary file: positions from `origin`, in double precision if it is not zero, colours
/// and normals if the nodes have them. A normal that is zero is written as such.
///
/// # Errors
/// The writer's error.
pub fn write(mut to: impl Write, origin: DVec3, nodes: &[&Node]) -> io::Result<()> {
    let count: usize = nodes.iter().map(|node| node.cell_count()).sum();
    let kind = if origin == DVec3::ZERO { "float" } else { "double" };
    let has = |values: fn(&Node) -> Option<&[u32]>| nodes.first().is_some_and(|node| values(node).is_some());
    let (has_colors, has_normals) = (has(Node::colors), has(Node::normals));
    write!(
        to,
        "ply\nformat binary_little_endian 1.0\ncomment written by Epigraph\nelement vertex {count}\n"
    )?;
    ["x", "y", "z"].iter().try_for_each(|name| writeln!(to, "property {kind} {name}"))?;
    if has_colors {
        CHANNELS.iter().try_for_each(|[name, _]| writeln!(to, "property uchar {name}"))?;
    }
    if has_normals {
        ["nx", "ny", "nz"].iter().try_for_each(|name| writeln!(to, "property float {name}"))?;
    }
    writeln!(to, "end_header")?;
    for node in nodes {
        for (index, position) in node.positions().into_iter().enumerate() {
            if origin == DVec3::ZERO {
                position.to_array().iter().try_for_each(|at| to.write_all(&at.to_le_bytes()))?;
            } else {
                let position = origin + position.as_dvec3();
                position.to_array().iter().try_for_each(|at| to.write_all(&at.to_le_bytes()))?;
            }
            if let Some(colors) = node.colors() {
                to.write_all(&unpack_color(colors[index]))?;
            }
            if let Some(normals) = node.normals() {
                let normal = unpack_normal(normals[index]).to_array();
                normal.iter().try_for_each(|at| to.write_all(&at.to_le_bytes()))?;
            }
        }
    }
    Ok(())
}
