//! The scalars that an element consists of.

use std::fmt;

use epigraph_core::{Element, Format, Scalar, Snapshot};
use half::f16;

/// A scalar's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// A number.
    Float(f32),
    /// A natural number.
    Unsigned(u32),
    /// A whole number.
    Signed(i32),
}

impl Number {
    /// As a float, rounded where it must be.
    pub fn as_f32(self) -> f32 {
        match self {
            Self::Float(value) => value,
            Self::Unsigned(value) => value as f32,
            Self::Signed(value) => value as f32,
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // Very small and large ones would fill the line with zeros.
            Self::Float(value) if *value != 0.0 && !(1e-4..1e7).contains(&value.abs()) => {
                write!(f, "{value:.4e}")
            }
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

/// One scalar of every element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lane {
    /// Member and letter, such as `position.x`; empty for the only one.
    pub name: String,
    storage: Storage,
    offset: usize,
    stride: usize,
}

impl Lane {
    /// Whether its numbers are floats.
    pub fn is_float(&self) -> bool {
        matches!(self.storage, Storage::F32 | Storage::F16 | Storage::Unorm8)
    }

    /// The number of an element; none past the end.
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

/// The scalars of an element: r, g, b, a of texels; x, y, z, w of vectors, after their member's name.
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

/// One letter for each; nothing for the only one.
fn letters(count: usize, letters: &'static str) -> impl Iterator<Item = String> {
    letters.chars().take(count).map(move |letter| if count == 1 { String::new() } else { letter.into() })
}
