//! The elements of a PLY file, number by number.

use super::header::{Format, Kind, Property};

/// The elements that have not been read yet.
pub(super) struct Body<'a> {
    pub rest: &'a [u8],
    pub format: Format,
    /// Whether each element of a text ends with its line. If not, lines are like blanks.
    pub has_lines: bool,
    /// Whether a line of a text had more words than its element has numbers.
    pub has_more_words: bool,
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

    /// Goes to the next line of a text that has lines.
    pub fn end_element(&mut self) {
        if self.format == Format::Text && self.has_lines {
            let end =
                self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(self.rest.len());
            self.has_more_words |= !self.rest[..end].trim_ascii().is_empty();
            self.rest = &self.rest[end..];
        }
    }

    /// Reads the numbers of a property one by one: one, or those of a list.
    pub fn property(&mut self, property: &Property, mut each: impl FnMut(f64)) -> Result<(), Stop> {
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
pub(super) enum Stop {
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
