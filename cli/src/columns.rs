//! The scalars that an element consists of, by name.

use epigraph_core::{Element, Format, Member, Scalar, Snapshot};
use half::f16;

/// How a scalar is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// IEEE single.
    F32,
    /// IEEE half.
    F16,
    /// Unsigned.
    U32,
    /// Signed.
    I32,
    /// A byte that stands for 0 to 1.
    Unorm8,
}

/// A scalar's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A number.
    Float(f32),
    /// A natural number.
    Unsigned(u32),
    /// A whole number.
    Signed(i32),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Float(value) => write!(f, "{value}"),
            Self::Unsigned(value) => write!(f, "{value}"),
            Self::Signed(value) => write!(f, "{value}"),
        }
    }
}

/// One scalar of every element of a snapshot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Member and lane, such as `position.x`; only the lane, or nothing, for plain vectors and scalars.
    pub name: String,
    /// How it is stored.
    pub kind: Kind,
    offset: usize,
}

impl Column {
    /// Its values, one for each element.
    pub fn values<'a>(&'a self, snapshot: &'a Snapshot) -> impl Iterator<Item = Value> + 'a {
        let stride = snapshot.element.bytes().max(1) as usize;
        snapshot.bytes.chunks_exact(stride).map(|element| self.value(element))
    }

    fn value(&self, element: &[u8]) -> Value {
        let bytes = &element[self.offset..];
        let word = || u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        match self.kind {
            Kind::F32 => Value::Float(f32::from_bits(word())),
            Kind::F16 => Value::Float(f16::from_le_bytes([bytes[0], bytes[1]]).to_f32()),
            Kind::U32 => Value::Unsigned(word()),
            Kind::I32 => Value::Signed(word() as i32),
            Kind::Unorm8 => Value::Float(f32::from(bytes[0]) / 255.0),
        }
    }
}

/// The columns of an element. Texels have the lanes r, g, b, a; vectors x, y, z, w.
pub fn of(element: &Element) -> Vec<Column> {
    match element {
        Element::Texel(format) => {
            let (kind, bytes, lanes) = match format {
                Format::R32Float => (Kind::F32, 4, 1),
                Format::R32Uint => (Kind::U32, 4, 1),
                Format::Rgba8Unorm => (Kind::Unorm8, 1, 4),
                Format::Rgba16Float => (Kind::F16, 2, 4),
                Format::Rgba32Float => (Kind::F32, 4, 4),
            };
            lane_names(lanes, "rgba")
                .enumerate()
                .map(|(lane, name)| Column { name, kind, offset: lane * bytes })
                .collect()
        }
        // Snapshots are of outputs, which have a format.
        Element::AnyFloatTexel => Vec::new(),
        Element::Item { members, .. } => members.iter().flat_map(of_member).collect(),
    }
}

fn of_member(member: &Member) -> impl Iterator<Item = Column> + '_ {
    let kind = match member.scalar {
        Scalar::F32 => Kind::F32,
        Scalar::U32 => Kind::U32,
        Scalar::I32 => Kind::I32,
    };
    lane_names(member.lanes as usize, "xyzw").enumerate().map(move |(lane, name)| {
        let parts = [member.name.as_ref(), name.as_str()];
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        Column { name: parts.join("."), kind, offset: member.offset as usize + 4 * lane }
    })
}

/// One letter for each lane; nothing for the only one.
fn lane_names(lanes: usize, letters: &'static str) -> impl Iterator<Item = String> {
    letters.chars().take(lanes).map(move |letter| if lanes == 1 { String::new() } else { letter.to_string() })
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Dims, PortElement, texel};

    use super::*;

    epigraph_core::item! {
        struct Point {
            position: [f32; 3],
            age: u32,
        }
    }

    fn snapshot(element: Element, bytes: Vec<u8>) -> Snapshot {
        let dims = Dims { width: bytes.len() as u32 / element.bytes(), height: 1 };
        Snapshot { name: "a.b".into(), field: String::new(), element, dims, frame: 0, bytes }
    }

    fn names(element: Element) -> Vec<String> {
        of(&element).into_iter().map(|column| column.name).collect()
    }

    #[test]
    fn members_and_lanes_have_names() {
        assert_eq!(names(Point::element()), ["position.x", "position.y", "position.z", "age"]);
        assert_eq!(names(<[f32; 2]>::element()), ["x", "y"]);
        assert_eq!(names(u32::element()), [""]);
        assert_eq!(names(texel::Rgba8Unorm::element()), ["r", "g", "b", "a"]);
    }

    #[test]
    fn values_are_read_as_they_are_stored() {
        let point = Point { position: [1.5, -2.0, f32::INFINITY], age: u32::MAX };
        let points = snapshot(Point::element(), bytemuck::bytes_of(&[Point::default(), point]).to_vec());
        let columns = of(&points.element);
        let second: Vec<String> =
            columns.iter().map(|column| column.values(&points).nth(1).unwrap().to_string()).collect();
        assert_eq!(second, ["1.5", "-2", "inf", "4294967295"]);

        let texels = snapshot(texel::Rgba8Unorm::element(), vec![0, 51, 255, 0]);
        let green = of(&texels.element)[1].values(&texels).next();
        assert_eq!(green, Some(Value::Float(0.2)));
    }
}
