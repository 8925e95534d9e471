//! Decodes buffer views that are compressed with `EXT_meshopt_compression` or `KHR_meshopt_compression`, after the
//! bitstreams of their specifications. The library meshoptimizer is C++, and this program builds with Rust alone.

mod attributes;
mod filters;
mod indices;

use gltf::json::deserialize::from_value;
use gltf::json::{Value, buffer::View};
use serde::Deserialize;

/// The extensions, which have the same members.
pub(super) const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Bytes that a buffer view unpacks to at most: as many as positions, normals, colours and coordinates of the vertices
/// of the largest scene.
const MOST_BYTES: usize = 1 << 28;

/// A compressed buffer view.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Compressed {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: usize,
    pub byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: String,
    #[serde(default = "none")]
    filter: String,
}

fn none() -> String {
    "NONE".to_owned()
}

impl Compressed {
    /// How a buffer view is compressed, if it is.
    pub fn of(view: &View) -> Option<Result<Self, String>> {
        let extensions = &view.extensions.as_ref()?.others;
        let value: &Value = MESHOPT.iter().find_map(|name| extensions.get(*name))?;
        Some(from_value(value.clone()).map_err(|error| format!("its compression is not valid: {error}")))
    }

    /// The elements in `data`, one after the other.
    pub fn decode(&self, data: &[u8]) -> Result<Vec<u8>, String> {
        let Self { byte_stride: stride, count, ref mode, ref filter, .. } = *self;
        if count.checked_mul(stride).is_none_or(|bytes| bytes > MOST_BYTES) {
            return Err(format!("it unpacks to more than {MOST_BYTES} bytes"));
        }
        let fits = match mode.as_str() {
            "ATTRIBUTES" => (4..=256).contains(&stride) && stride % 4 == 0,
            "TRIANGLES" => matches!(stride, 2 | 4) && count % 3 == 0,
            "INDICES" => matches!(stride, 2 | 4),
            _ => return Err(format!("its compression has an unknown mode, {mode}")),
        };
        if !fits {
            return Err(format!("{count} elements of {stride} bytes cannot be compressed as {mode}"));
        }
        let decoded = match mode.as_str() {
            "ATTRIBUTES" => attributes::decode(data, count, stride),
            "TRIANGLES" => indices::triangles(data, count).map(|all| indices::bytes(&all, stride)),
            _ => indices::sequence(data, count).map(|all| indices::bytes(&all, stride)),
        };
        let mut decoded = decoded.ok_or("its compressed data is damaged")?;
        if !filters::apply(filter, &mut decoded, stride) {
            return Err(format!("its compression has a filter {filter} of elements of {stride} bytes"));
        }
        Ok(decoded)
    }
}

/// Reads from the start of some bytes; `None` at their end.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|bytes| bytes[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What meshoptimizer makes of [`vertices`], in both versions of its format.
    const ATTRIBUTES: [&str; 2] = [
        "a0070002060a0e12161a1e22262a2e32363aff0000003e42464a04800000000a0ddddddddddddddddddd0000000000000000 \
         00070000ff80804040404020202020202020ff0000002010101005308000007e800000000000000000000000000000000000 \
         000000000000000000000000e80300000000",
        "a19b680002060a0e12161a1e22262a2e32363a3e42464a020ddddddddddddddd0f000d0d0d0d011200070f020ff8f4c4f262 \
         e262e010f81c0f003e01030100000000000000000000000000000000e803000000000152",
    ];
    /// And of [`CORNERS`], some of whose triangles begin with another corner then.
    const TRIANGLES: [&str; 2] = [
        "e0fe1f001f5f0f021ffffff006020202020296001401007687566778a9866589689801690000",
        "e1fe1e001e5e0e021efffff00696001401007687566778a9866589689801690000",
    ];
    const INDICES: &str = "d1000c060008040a0c06000804060c060008040a0c06000804001e100c040600000000";
    const CORNERS: [[u16; 3]; 10] = [
        [0, 3, 1],
        [1, 3, 4],
        [1, 4, 2],
        [2, 4, 5],
        [3, 6, 4],
        [4, 6, 7],
        [4, 7, 5],
        [5, 7, 8],
        [8, 0, 4],
        [7, 8, 6],
    ];

    fn bytes(hex: &str) -> Vec<u8> {
        let digits: Vec<u32> = hex.chars().filter_map(|digit| digit.to_digit(16)).collect();
        digits.chunks(2).map(|pair| (16 * pair[0] + pair[1]) as u8).collect()
    }

    /// Twenty vertices of two shorts and a float.
    fn vertices() -> Vec<u8> {
        let vertex = |i: u16| {
            let [a, b] = [i * i, 1000 - 7 * i].map(u16::to_le_bytes);
            [&a[..], &b, &(0.5 * f32::from(i)).to_le_bytes()].concat()
        };
        (0..20).flat_map(vertex).collect()
    }

    fn compressed(mode: &str, byte_stride: usize, count: usize) -> Compressed {
        let (mode, filter) = (mode.to_owned(), none());
        Compressed { buffer: 0, byte_offset: 0, byte_length: 0, byte_stride, count, mode, filter }
    }

    #[test]
    fn streams_of_meshoptimizer_are_decoded() {
        for stream in ATTRIBUTES {
            assert_eq!(compressed("ATTRIBUTES", 8, 20).decode(&bytes(stream)).unwrap(), vertices());
        }
        let corners = |stride: usize, all: [[u16; 3]; 10]| -> Vec<u8> {
            let corner = |index: u16| u32::from(index).to_le_bytes().into_iter().take(stride);
            all.as_flattened().iter().flat_map(|&index| corner(index)).collect()
        };
        let mut turned = CORNERS;
        turned[4].rotate_right(1);
        for stride in [2, 4] {
            for stream in TRIANGLES {
                let found = compressed("TRIANGLES", stride, 30).decode(&bytes(stream)).unwrap();
                assert_eq!(found, corners(stride, turned));
            }
            let found = compressed("INDICES", stride, 30).decode(&bytes(INDICES)).unwrap();
            assert_eq!(found, corners(stride, CORNERS));
        }
    }

    #[test]
    fn damaged_streams_are_errors_or_garbage() {
        let streams = [
            ("ATTRIBUTES", 8, 20, ATTRIBUTES[0]),
            ("ATTRIBUTES", 8, 20, ATTRIBUTES[1]),
            ("TRIANGLES", 2, 30, TRIANGLES[0]),
            ("TRIANGLES", 2, 30, TRIANGLES[1]),
            ("INDICES", 4, 30, INDICES),
        ];
        for (mode, stride, count, stream) in streams {
            let (stream, compressed) = (bytes(stream), compressed(mode, stride, count));
            for at in 0..stream.len() {
                assert!(compressed.decode(&stream[..at]).is_err(), "{mode}: {at} bytes were enough");
                for value in 0..=255 {
                    let mut damaged = stream.clone();
                    damaged[at] = value;
                    let found = compressed.decode(&damaged);
                    assert!(at > 0 || value == stream[0] || found.is_err() || value >> 4 == stream[0] >> 4);
                }
            }
            assert!(compressed.decode(&[&stream[..], &[0]].concat()).is_err(), "{mode}: one byte more");
        }
    }

    #[test]
    fn elements_that_cannot_be_are_named() {
        for (mode, stride, count, expected) in [
            ("ATTRIBUTES", 6, 3, "3 elements of 6 bytes cannot be compressed as ATTRIBUTES"),
            ("ATTRIBUTES", 260, 3, "3 elements of 260 bytes"),
            ("ATTRIBUTES", 0, 3, "3 elements of 0 bytes"),
            ("TRIANGLES", 2, 4, "4 elements of 2 bytes cannot be compressed as TRIANGLES"),
            ("INDICES", 1, 4, "4 elements of 1 bytes"),
            ("LINES", 2, 4, "an unknown mode, LINES"),
            ("ATTRIBUTES", 256, usize::MAX, "it unpacks to more than"),
            ("ATTRIBUTES", 256, (1 << 20) + 1, "it unpacks to more than 268435456 bytes"),
            // As much as may be, and the smallest and largest elements.
            ("ATTRIBUTES", 256, 1 << 20, "its compressed data is damaged"),
            ("ATTRIBUTES", 4, 4, "its compressed data is damaged"),
        ] {
            let message = compressed(mode, stride, count).decode(&[0xA0]).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
        let odd = Compressed { filter: "OCTAHEDRAL".to_owned(), ..compressed("ATTRIBUTES", 12, 0) };
        let empty = [&[0xA0][..], &[0; 32]].concat();
        assert!(odd.decode(&empty).unwrap_err().contains("a filter OCTAHEDRAL of elements of 12 bytes"));
    }
}
