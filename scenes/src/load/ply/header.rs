//! The header of a PLY file.

/// The longest header, in bytes.
const LONGEST: usize = 1 << 20;

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Text,
    LittleEndian,
    BigEndian,
}

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Kind {
    fn of(name: &str) -> Result<Self, String> {
        Ok(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return Err(format!("`{name}` is no type of number")),
        })
    }
}

/// A number of each element, or a list of them.
#[derive(Debug)]
pub struct Property {
    pub name: String,
    pub kind: Kind,
    /// The type of a list's length.
    pub list: Option<Kind>,
}

/// A kind of thing in the file.
#[derive(Debug)]
pub struct Element {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
}

/// What a file consists of.
#[derive(Debug)]
pub struct Header {
    pub format: Format,
    pub elements: Vec<Element>,
    /// The names of pictures.
    pub textures: Vec<String>,
    /// The number of bytes before the first element.
    pub length: usize,
}

impl Header {
    pub fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|element| element.name == name)
    }

    /// Reads the header at the beginning of a file. Its lines may end in line feeds, carriage returns, or both.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        let mut header = Self { format: Format::Text, elements: Vec::new(), textures: Vec::new(), length: 0 };
        let mut lines = Lines { bytes, at: 0, ends_in_both: false };
        let cut_off = || "cut off: it ends within its header".to_owned();
        let is_ply = b"ply".starts_with(&bytes[..bytes.len().min(3)]);
        if !is_ply || lines.next().ok_or_else(cut_off)? != "ply" {
            return Err("it does not begin with the word `ply`, so it is not a PLY file".to_owned());
        }
        let mut format = None;
        for number in 2.. {
            let line = lines.next().ok_or_else(cut_off)?;
            if line == "end_header" {
                break;
            }
            header.line(&line, &mut format).map_err(|message| format!("line {number}: {message}"))?;
        }
        header.format = format.ok_or("its header lacks the line `format`")?;
        header.length = lines.at;
        Ok(header)
    }

    fn line(&mut self, line: &str, format: &mut Option<Format>) -> Result<(), String> {
        let (keyword, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        let words: Vec<&str> = rest.split_ascii_whitespace().collect();
        match (keyword, &words[..]) {
            ("format", ["ascii", ..]) => *format = Some(Format::Text),
            ("format", ["binary_little_endian", ..]) => *format = Some(Format::LittleEndian),
            ("format", ["binary_big_endian", ..]) => *format = Some(Format::BigEndian),
            ("element", [name, count]) => {
                let count = count.parse().map_err(|_| format!("`{count}` is no number of elements"))?;
                self.elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ("property", types @ ([_, name] | ["list", _, _, name])) => {
                let element = self.elements.last_mut().ok_or("a property precedes the first element")?;
                let list = if types.len() == 4 { Some(Kind::of(types[1])?) } else { None };
                let kind = Kind::of(types[types.len() - 2])?;
                element.properties.push(Property { name: (*name).to_owned(), kind, list });
            }
            ("comment", [tag, ..]) if tag.eq_ignore_ascii_case("texturefile") => {
                self.textures.push(rest.trim_start()[tag.len()..].trim().to_owned());
            }
            ("comment" | "obj_info" | "", _) => {}
            _ => {
                let line: String = line.chars().take(60).collect();
                return Err(format!("`{line}` is no line of a header"));
            }
        }
        Ok(())
    }
}

/// The header with which a PLY file begins, as lines that end in line feeds, with one blank between words, whatever is
/// between them in the file; and the header's length in the file, bytes. `None` if the header does not end within `start`.
pub fn ply_header(start: &[u8]) -> Option<(String, usize)> {
    let mut lines = Lines { bytes: start, at: 0, ends_in_both: false };
    let mut text = String::new();
    loop {
        let line = lines.next()?;
        if !line.is_empty() {
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            text += &words.join(" ");
            text.push('\n');
        }
        if line == "end_header" {
            return Some((text, lines.at));
        }
    }
}

/// The lines of the header, without blanks at their ends.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Whether the first line ends in a carriage return and a line feed. If not, a line feed after a carriage return at the
    /// end of the header is data.
    ends_in_both: bool,
}

impl Lines<'_> {
    fn next(&mut self) -> Option<String> {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().take(LONGEST).position(|byte| matches!(byte, b'\n' | b'\r'))?;
        let end = &rest[length..];
        let is_first = self.at == 0;
        self.ends_in_both |= is_first && end.starts_with(b"\r\n");
        let both = end.starts_with(b"\r\n") && self.ends_in_both;
        self.at += length + if both { 2 } else { 1 };
        (self.at <= LONGEST).then(|| String::from_utf8_lossy(&rest[..length]).trim().to_owned())
    }
}
