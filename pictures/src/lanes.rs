//! The scalars of an element.

use std::fmt;

use epigraph_core::{Dims, Element, Format, Scalar, Snapshot};
use half::f16;

/// A scalar's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// A number.
    Float(f32),
    /// An unsigned integer.
    Unsigned(u32),
    /// A signed integer.
    Signed(i32),
}

impl Number {
    /// As a float, rounded if necessary.
    pub fn as_f32(self) -> f32 {
        match self {
            Self::Float(value) => value,
            Self::Unsigned(value) => value as f32,
            Self::Signed(value) => value as f32,
        }
    }

    /// The 32 bits that store it; those of an f32 for narrower floats.
    pub fn bits(self) -> u32 {
        match self {
            Self::Float(value) => value.to_bits(),
            Self::Unsigned(value) => value,
            Self::Signed(value) => value as u32,
        }
    }

    /// As short text: very small and very large floats with an exponent.
    pub fn brief(self) -> String {
        match self {
            Self::Float(value)
                if value != 0.0 && value.is_finite() && !(1e-4..1e7).contains(&value.abs()) =>
            {
                format!("{value:.4e}")
            }
            number => number.to_string(),
        }
    }

    /// As text of about three digits.
    pub fn short(self) -> String {
        self.rounded(3)
    }

    /// As text of `digits` significant digits; integers with all of theirs.
    pub fn rounded(self, digits: usize) -> String {
        match self {
            Self::Float(value) if value == 0.0 || !value.is_finite() => value.to_string(),
            Self::Float(value) if !(1e-3..1e5).contains(&value.abs()) => {
                format!("{value:.*e}", digits.saturating_sub(2))
            }
            Self::Float(value) => {
                let before = value.abs().log10().floor() as i32 + 1;
                let after = (digits as i32 - before).clamp(0, digits as i32 + 2) as usize;
                let text = format!("{value:.after$}");
                if after == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_owned() }
            }
            number => number.to_string(),
        }
    }
}

/// Enough digits to read the same number back.
impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Float(value) => write!(f, "{value}"),
            Self::Unsigned(value) => write!(f, "{value}"),
            Self::Signed(value) => write!(f, "{value}"),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Storage {
    F32,
    F16,
    U32,
    I32,
    Unorm8,
}

/// One scalar of all elements.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lane {
    /// Member and letter, such as `position.x`; empty for a single scalar.
    pub name: String,
    storage: Storage,
    offset: usize,
    stride: usize,
}

impl Lane {
    /// True if its numbers are floats.
    pub fn is_float(&self) -> bool {
        matches!(self.storage, Storage::F32 | Storage::F16 | Storage::Unorm8)
    }

    /// True if its numbers are unsigned integers.
    pub fn is_unsigned(&self) -> bool {
        self.storage == Storage::U32
    }

    /// The number of an element; `None` past the end.
    pub fn number(&self, snapshot: &Snapshot, index: usize) -> Option<Number> {
        let start = index * self.stride;
        snapshot.bytes.get(start..start + self.stride).map(|element| self.of(element))
    }

    /// The numbers of all elements.
    pub fn numbers<'a>(&'a self, snapshot: &'a Snapshot) -> impl Iterator<Item = Number> + 'a {
        snapshot.bytes.chunks_exact(self.stride).map(|element| self.of(element))
    }

    fn of(&self, element: &[u8]) -> Number {
        let bytes = &element[self.offset..];
        let word = || u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        match self.storage {
            Storage::F32 => Number::Float(f32::from_bits(word())),
            Storage::F16 => Number::Float(f16::from_le_bytes([bytes[0], bytes[1]]).to_f32()),
            Storage::U32 => Number::Unsigned(word()),
            Storage::I32 => Number::Signed(word() as i32),
            Storage::Unorm8 => Number::Float(f32::from(bytes[0]) / 255.0),
        }
    }
}

/// The scalars of an element: r, g, b, a of texels; x, y, z, w of vectors, each after its member's name.
pub fn lanes(element: &Element) -> Vec<Lane> {
    let stride = element.bytes() as usize;
    match element {
        Element::Texel(format) => {
            let (storage, bytes, count) = match format {
                Format::R32Float => (Storage::F32, 4, 1),
                Format::R32Uint => (Storage::U32, 4, 1),
                Format::Rgba8Unorm => (Storage::Unorm8, 1, 4),
                Format::Rgba16Float => (Storage::F16, 2, 4),
                Format::Rgba32Float => (Storage::F32, 4, 4),
            };
            let lane = |(index, name)| Lane { name, storage, offset: index * bytes, stride };
            letters(count, "rgba").enumerate().map(lane).collect()
        }
        // Only inputs have such elements, and snapshots are of outputs.
        Element::AnyFloatTexel => Vec::new(),
        Element::Item { members, .. } => {
            let mut lanes = Vec::new();
            for member in members.iter() {
                let storage = match member.scalar {
                    Scalar::F32 => Storage::F32,
                    Scalar::U32 => Storage::U32,
                    Scalar::I32 => Storage::I32,
                };
                for (index, letter) in letters(member.lanes as usize, "xyzw").enumerate() {
                    let dot = if member.name.is_empty() || letter.is_empty() { "" } else { "." };
                    let name = format!("{}{dot}{letter}", member.name);
                    lanes.push(Lane { name, storage, offset: member.offset as usize + 4 * index, stride });
                }
            }
            lanes
        }
    }
}

/// One letter per scalar; empty for a single one.
fn letters(count: usize, letters: &'static str) -> impl Iterator<Item = String> {
    letters.chars().take(count).map(move |letter| if count == 1 { String::new() } else { letter.into() })
}

/// True if elements of these dims form an image in frames of `size`.
pub fn is_image(element: &Element, dims: Dims, size: [u32; 2]) -> bool {
    matches!(element, Element::Texel(_)) || dims.height > 1 || [dims.width, dims.height] == size
}

/// Dims as width and height.
pub fn size(dims: Dims) -> [usize; 2] {
    [dims.width as usize, dims.height as usize]
}

#[cfg(test)]
mod tests {
    use epigraph_core::{PortElement, texel};

    use super::*;

    #[test]
    fn textures_and_what_has_rows_or_the_size_of_the_frame_are_images() {
        let [texel, word] = [Element::Texel(Format::R32Uint), u32::element()];
        for (element, [width, height], image) in [
            (&texel, [5, 1], true),
            (&texel, [7, 3], true),
            (&word, [7, 3], true),
            (&word, [8, 4], true),
            (&word, [5, 1], false),
            (&word, [21, 1], false),
        ] {
            assert_eq!(
                is_image(element, Dims { width, height }, [7, 3]),
                image,
                "{element}, {width}x{height}"
            );
        }
        // A frame of one row.
        assert!(is_image(&word, Dims { width: 5, height: 1 }, [5, 1]));
    }

    epigraph_core::item! {
        struct Point {
            position: [f32; 3],
            age: u32,
        }
    }

    fn snapshot(element: Element, bytes: Vec<u8>) -> Snapshot {
        let dims = Dims { width: bytes.len() as u32 / element.bytes(), height: 1 };
        Snapshot { name: "a.b".into(), field: String::new(), meaning: None, element, dims, frame: 0, bytes }
    }

    fn names(element: Element) -> Vec<String> {
        lanes(&element).into_iter().map(|lane| lane.name).collect()
    }

    #[test]
    fn members_and_lanes_have_names() {
        assert_eq!(names(Point::element()), ["position.x", "position.y", "position.z", "age"]);
        assert_eq!(names(<[f32; 2]>::element()), ["x", "y"]);
        assert_eq!(names(u32::element()), [""]);
        assert_eq!(names(texel::Rgba8Unorm::element()), ["r", "g", "b", "a"]);
    }

    #[test]
    fn numbers_are_read_as_they_are_stored() {
        let point = Point { position: [1.5, -2.0, f32::INFINITY], age: u32::MAX };
        let points = snapshot(Point::element(), bytemuck::bytes_of(&[Point::default(), point]).to_vec());
        let lanes_of = lanes(&points.element);
        let second = lanes_of.iter().map(|lane| lane.number(&points, 1).unwrap().to_string());
        assert_eq!(second.collect::<Vec<_>>(), ["1.5", "-2", "inf", "4294967295"]);
        assert_eq!(lanes_of[3].number(&points, 2), None);

        let texels = snapshot(texel::Rgba8Unorm::element(), vec![0, 51, 255, 0]);
        let green = lanes(&texels.element)[1].numbers(&texels).next();
        assert_eq!(green, Some(Number::Float(0.2)));
    }

    #[test]
    fn numbers_can_be_brief() {
        let brief = [0.0, 0.25, 1.5e-7, -2e30, f32::INFINITY].map(|value| Number::Float(value).brief());
        assert_eq!(brief, ["0", "0.25", "1.5000e-7", "-2.0000e30", "inf"]);
        let short = [0.0, 0.123_456, -12.3456, 100.0, 1.5, 2e-9].map(|value| Number::Float(value).short());
        assert_eq!(short, ["0", "0.123", "-12.3", "100", "1.5", "2.0e-9"]);
        assert_eq!(Number::Float(-0.001_971_152_1).rounded(6), "-0.00197115");
        assert_eq!(Number::Unsigned(1_234_567).rounded(3), "1234567");
    }
}
