//! PLY, ASCII and binary: vertices with optional normals, and faces of any number of corners (fanned into triangles).
//! Colours and other properties are skipped.

use std::io::{BufReader, Cursor, Read};

use glam::Vec3;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{Header, Property, PropertyAccess};

use super::model::Model;
use crate::{MeshError, Shape};

/// An element of any kind; the kind determines which fields are used.
#[derive(Default)]
struct Element {
    position: Vec3,
    normal: Vec3,
    corners: Vec<i64>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) {
        let slot = match name {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            "vertex_indices" | "vertex_index" => {
                self.corners = match property {
                    Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
                    Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
                    _ => vec![],
                };
                return;
            }
            _ => return,
        };
        *slot = match property {
            Property::Float(value) => value,
            Property::Double(value) => value as f32,
            Property::Char(value) => value.into(),
            Property::UChar(value) => value.into(),
            Property::Short(value) => value.into(),
            Property::UShort(value) => value.into(),
            Property::Int(value) => value as f32,
            Property::UInt(value) => value as f32,
            _ => f32::NAN,
        };
    }
}

/// Reads a whole PLY file.
pub(super) fn read(bytes: &[u8]) -> Result<Model, String> {
    let parser = Parser::<Element>::new();
    let mut reader = BufReader::new(Cursor::new(bytes));
    let header = parser.read_header(&mut reader).map_err(one_line)?;
    check_counts(&header)?;
    for (name, element) in &header.elements {
        // Every element takes at least a byte, so a count beyond the file's length is wrong.
        if element.count > bytes.len() || element.properties.is_empty() && element.count > 0 {
            return Err(format!(
                "the header declares {} elements `{name}`, more than the file can contain",
                element.count
            ));
        }
    }
    let mut payload = parser
        .read_payload(&mut reader, &header)
        .map_err(|error| format!("after the header, {}", one_line(error)))?;
    let vertices = payload.shift_remove("vertex").ok_or("no element `vertex` in the header")?;
    let faces = payload
        .shift_remove("face")
        .ok_or("no element `face` in the header: a point cloud has no surface")?;

    let has_normals = header.elements["vertex"].properties.contains_key("nx");
    let mut shape = Shape { positions: vertices.iter().map(|v| v.position).collect(), ..Shape::default() };
    for (face, element) in faces.iter().enumerate() {
        let corners = &element.corners;
        let triangles = shape.triangles.len() + corners.len().saturating_sub(2);
        MeshError::of_size(triangles, vertices.len()).map_err(|error| format!("face {face}: {error}"))?;
        for k in 2..corners.len() {
            let mut triangle = [0; 3];
            for (index, corner) in triangle.iter_mut().zip([corners[0], corners[k - 1], corners[k]]) {
                *index = u32::try_from(corner).ok().filter(|&i| (i as usize) < vertices.len()).ok_or_else(
                    || {
                        format!(
                            "face {face} refers to vertex {corner}, but there are only {} vertices",
                            vertices.len()
                        )
                    },
                )?;
            }
            shape.triangles.push(triangle);
            if has_normals {
                shape.normals.push(triangle.map(|i| vertices[i as usize].normal.normalize_or_zero()));
            }
        }
    }
    Ok(Model::from_shape(shape))
}

/// Refuses a file whose header, at its `start`, declares more vertices or faces than a scene may have. A start that is no
/// header is left to [`read`].
pub(super) fn check_start(start: impl Read) -> Result<(), String> {
    match Parser::<Element>::new().read_header(&mut BufReader::new(start)) {
        Ok(header) => check_counts(&header),
        Err(_) => Ok(()),
    }
}

fn check_counts(header: &Header) -> Result<(), String> {
    let count = |name: &str| header.elements.get(name).map_or(0, |element| element.count);
    MeshError::of_size(count("face"), count("vertex"))
        .map_err(|error| format!("the header declares too much: {error}"))
}

/// The parser's messages have several indented lines, of which the first is sufficient.
fn one_line(error: std::io::Error) -> String {
    let text = error.to_string();
    let mut lines = text.lines().map(str::trim);
    let (first, second) = (lines.next().unwrap_or_default(), lines.next());
    second.map_or(first.to_owned(), |second| format!("{first} {second}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ASCII: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty double y\n\
        property float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3\n";

    fn binary() -> Vec<u8> {
        let mut bytes =
            b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
            property float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement face 1\n\
            property list uchar uint vertex_index\nend_header\n"
                .to_vec();
        for vertex in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0_f32]] {
            for value in vertex.into_iter().chain([0.0, 0.0, 2.0]) {
                bytes.extend(value.to_le_bytes());
            }
        }
        bytes.push(3);
        bytes.extend([0, 1, 2_u32].iter().flat_map(|i| i.to_le_bytes()));
        bytes
    }

    #[test]
    fn ascii_polygons_become_triangles() {
        let shape = &read(ASCII.as_bytes()).unwrap().parts[0].0;
        assert_eq!(shape.positions[2], Vec3::new(1.0, 1.0, 0.0));
        assert_eq!(shape.triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn binary_with_normals() {
        let shape = &read(&binary()).unwrap().parts[0].0;
        assert_eq!(shape.triangles, [[0, 1, 2]]);
        assert_eq!(shape.normals, [[Vec3::Z; 3]]);
    }

    #[test]
    fn coordinates_and_corners_of_any_type() {
        let list_types = ["char", "uchar", "short", "ushort", "int", "uint"];
        for kind in list_types.into_iter().chain(["float", "double"]) {
            let list = if list_types.contains(&kind) { kind } else { "int" };
            let properties: String =
                ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property {kind} {name}\n")).concat();
            let file = format!(
                "ply\nformat ascii 1.0\nelement vertex 3\n{properties}element face 1\n\
                property list uchar {list} vertex_indices\nend_header\n\
                2 3 5 2 3 6\n7 11 13 1 4 8\n17 19 23 6 2 3\n3 2 0 1\n"
            );
            let shape = &read(file.as_bytes()).unwrap().parts[0].0;
            let positions = [[2.0, 3.0, 5.0], [7.0, 11.0, 13.0], [17.0, 19.0, 23.0]];
            assert_eq!(shape.positions, positions.map(Vec3::from_array), "{kind}");
            assert_eq!(shape.triangles, [[2, 0, 1]], "{kind}");
            // The lengths of the normals are 7, 9 and 7.
            let expected = [
                [6.0 / 7.0, 2.0 / 7.0, 3.0 / 7.0],
                [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0],
                [1.0 / 9.0, 4.0 / 9.0, 8.0 / 9.0],
            ];
            for (normal, expected) in shape.normals[0].iter().zip(expected) {
                assert!(normal.distance(Vec3::from_array(expected)) < 1e-6, "{kind}: {normal}");
            }
        }
    }

    #[test]
    fn every_truncation_is_an_error() {
        // The line feed at the end may be missing.
        for length in 0..ASCII.len() - 2 {
            assert!(read(&ASCII.as_bytes()[..length]).is_err(), "{length} bytes were enough");
        }
        let binary = binary();
        for length in 0..binary.len() {
            assert!(read(&binary[..length]).is_err(), "{length} bytes were enough");
        }
    }

    #[test]
    fn wrong_counts_and_indices_are_errors() {
        let huge = ASCII.replace("vertex 4", "vertex 4000000000000");
        assert!(read(huge.as_bytes()).unwrap_err().contains("4000000000000"));
        let wrong = ASCII.replace("4 0 1 2 3", "4 0 1 2 -3");
        assert!(read(wrong.as_bytes()).unwrap_err().contains("face 0 refers to vertex -3"));
    }

    #[test]
    fn no_damaged_byte_panics() {
        for file in [ASCII.as_bytes().to_vec(), binary()] {
            for at in 0..file.len() {
                for damage in [0, b'9', b'-', 0xff] {
                    let mut damaged = file.clone();
                    damaged[at] = damage;
                    let _ = read(&damaged).map(|model| model.into_scene("damaged").is_ok());
                }
            }
        }
    }
}
