//! The numbers of accessors. Offsets, strides and counts of a file are checked against its buffers before use.

use std::array::from_fn;

use gltf::json::Accessor;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;

use super::container::Container;
use super::meshopt::Compressed;
use crate::limits::MAX_TRIANGLES;

/// The largest element, a matrix of sixteen floats, as zeros: what an accessor without data consists of.
const ZEROS: [u8; 64] = [0; 64];

impl Container<'_> {
    pub fn accessor(&self, index: usize) -> Result<&Accessor, String> {
        let missing = || format!("accessor {index} does not exist: there are {}", self.root.accessors.len());
        self.root.accessors.get(index).ok_or_else(missing)
    }

    /// The number of elements of an accessor. No more than a scene's triangles have corners.
    pub fn count(&self, index: usize) -> Result<usize, String> {
        let count = self.accessor(index)?.count.0;
        match usize::try_from(count) {
            Ok(count) if count <= 3 * MAX_TRIANGLES => Ok(count),
            _ => Err(format!(
                "accessor {index} has {count} elements, but at most {} are read",
                3 * MAX_TRIANGLES
            )),
        }
    }

    /// How many numbers an element has, and of which type.
    pub fn kind(&self, index: usize) -> Result<(ComponentType, usize), String> {
        let accessor = self.accessor(index)?;
        match (&accessor.component_type, &accessor.type_) {
            (Checked::Valid(component), Checked::Valid(kind @ (Type::Mat2 | Type::Mat3)))
                if component.0 != ComponentType::F32 =>
            {
                Err(format!("accessor {index} has {kind:?} of whole numbers, which nothing here has"))
            }
            (Checked::Valid(component), Checked::Valid(kind)) => Ok((component.0, kind.multiplicity())),
            _ => Err(format!("accessor {index} has an unknown type")),
        }
    }

    /// Elements of `N` numbers. Whole numbers become floats; normalized ones, floats from 0 or -1 to 1.
    pub fn vectors<const N: usize>(&self, index: usize) -> Result<Vec<[f32; N]>, String> {
        fn each<const N: usize, const S: usize>(bytes: &[u8], read: impl Fn([u8; S]) -> f32) -> [f32; N] {
            let (numbers, _) = bytes.as_chunks::<S>();
            from_fn(|i| read(numbers[i]))
        }
        let (component, numbers) = self.kind(index)?;
        if numbers != N {
            return Err(format!("accessor {index} has {numbers} numbers an element instead of {N}"));
        }
        let normalized = self.accessor(index)?.normalized;
        // The most negative number stands for -1 too.
        let scaled =
            move |number: f32, largest: f32| if normalized { (number / largest).max(-1.0) } else { number };
        match component {
            ComponentType::F32 => self.elements(index, |bytes| each(bytes, f32::from_le_bytes)),
            ComponentType::I8 => {
                self.elements(index, |b| each(b, |[n]| scaled(n.cast_signed().into(), 127.0)))
            }
            ComponentType::U8 => self.elements(index, |b| each(b, |[n]| scaled(n.into(), 255.0))),
            ComponentType::I16 => {
                self.elements(index, |b| each(b, |n| scaled(i16::from_le_bytes(n).into(), 32767.0)))
            }
            ComponentType::U16 => {
                self.elements(index, |b| each(b, |n| scaled(u16::from_le_bytes(n).into(), 65535.0)))
            }
            ComponentType::U32 => Err(format!("accessor {index} has 32-bit integers, where floats belong")),
        }
    }

    /// Vertex indices.
    pub fn indices(&self, index: usize) -> Result<Vec<u32>, String> {
        match self.kind(index)? {
            (kind @ (ComponentType::U8 | ComponentType::U16 | ComponentType::U32), 1) => {
                self.elements(index, |bytes| whole(kind, bytes))
            }
            _ => Err("indices have to be unsigned integers".to_owned()),
        }
    }

    /// The numbers of the joints that move each vertex.
    pub fn joints(&self, index: usize) -> Result<Vec<[u32; 4]>, String> {
        match self.kind(index)? {
            (kind @ (ComponentType::U8 | ComponentType::U16), 4) => {
                self.elements(index, |bytes| from_fn(|i| whole(kind, &bytes[i * kind.size()..])))
            }
            _ => Err("joints have to be four unsigned bytes or shorts".to_owned()),
        }
    }

    /// Each element of an accessor, `convert`ed from its bytes.
    fn elements<T: Clone>(&self, index: usize, convert: impl Fn(&[u8]) -> T) -> Result<Vec<T>, String> {
        let (accessor, (component, numbers), count) =
            (self.accessor(index)?, self.kind(index)?, self.count(index)?);
        let size = component.size() * numbers;
        let within = |error| format!("accessor {index}: {error}");
        let mut elements: Vec<T> = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let pieces = self.pieces(view.value(), offset, size, count).map_err(within)?;
                pieces.map(&convert).collect()
            }
            None => vec![convert(&ZEROS[..size]); count],
        };
        if let Some(sparse) = &accessor.sparse {
            let Checked::Valid(kind) = sparse.indices.component_type else {
                return Err(format!("accessor {index}: its sparse indices have an unknown type"));
            };
            let changes = usize::try_from(sparse.count.0).ok().filter(|&changes| changes <= count);
            let changes =
                changes.ok_or_else(|| format!("accessor {index}: more elements change than it has"))?;
            let (at, to) = (&sparse.indices, &sparse.values);
            let places = self.pieces(at.buffer_view.value(), at.byte_offset.0, kind.0.size(), changes);
            let values = self.pieces(to.buffer_view.value(), to.byte_offset.0, size, changes);
            for (place, value) in places.map_err(within)?.zip(values.map_err(within)?) {
                let place = whole(kind.0, place) as usize;
                let element = elements.get_mut(place);
                *element.ok_or_else(|| format!("accessor {index}: element {place} of {count} changes"))? =
                    convert(value);
            }
        }
        Ok(elements)
    }

    /// `count` pieces of `size` bytes of a buffer view, from an offset on, as far apart as the view says.
    fn pieces(
        &self,
        view: usize,
        offset: u64,
        size: usize,
        count: usize,
    ) -> Result<impl Iterator<Item = &[u8]>, String> {
        let (data, stride) = self.view(view)?;
        let stride = stride.unwrap_or(size);
        let data = usize::try_from(offset).ok().and_then(|offset| data.get(offset..));
        let needed = count.checked_sub(1).map_or(Some(0), |gaps| gaps.checked_mul(stride)?.checked_add(size));
        match (data, needed) {
            (Some(data), Some(needed)) if stride >= size && needed <= data.len() => {
                Ok((0..count).map(move |i| &data[i * stride..][..size]))
            }
            _ => Err("it reaches beyond its buffer".to_owned()),
        }
    }

    /// The bytes of a buffer view, and the distance between its elements if it has one.
    pub fn view(&self, index: usize) -> Result<(&[u8], Option<usize>), String> {
        let view = self.root.buffer_views.get(index);
        let view = view.ok_or_else(|| format!("buffer view {index} does not exist"))?;
        let within = |error| format!("buffer view {index}: {error}");
        let unpack = || {
            Compressed::of(view).map(|compressed| {
                let compressed = compressed?;
                let offset = compressed.byte_offset as u64;
                compressed.decode(self.range(compressed.buffer, offset, compressed.byte_length as u64)?)
            })
        };
        let data = match self.unpacked[index].get_or_init(unpack) {
            Some(unpacked) => unpacked.as_deref().map_err(Clone::clone),
            None => {
                self.range(view.buffer.value(), view.byte_offset.unwrap_or_default().0, view.byte_length.0)
            }
        };
        Ok((data.map_err(within)?, view.byte_stride.map(|stride| stride.0)))
    }

    /// A range of a buffer's bytes.
    fn range(&self, buffer: usize, offset: u64, length: u64) -> Result<&[u8], String> {
        let data = self.buffers.get(buffer).ok_or_else(|| format!("buffer {buffer} does not exist"))?;
        let data = data.as_ref().map_err(Clone::clone)?;
        let start = usize::try_from(offset).ok();
        let end = offset.checked_add(length).and_then(|end| usize::try_from(end).ok());
        start
            .zip(end)
            .and_then(|(start, end)| data.get(start..end))
            .ok_or_else(|| "it reaches beyond its buffer".into())
    }
}

/// An unsigned integer at the start of some bytes.
fn whole(kind: ComponentType, bytes: &[u8]) -> u32 {
    match kind {
        ComponentType::U8 => bytes[0].into(),
        ComponentType::U16 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
        _ => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::gltf::tests::Making;

    fn open<T>(making: &Making, look: impl FnOnce(&Container) -> T) -> T {
        let file = making.file(r#""nodes": []"#);
        look(&Container::open(&file, &|_| Err(String::new())).unwrap())
    }

    #[test]
    fn accessors_have_up_to_as_many_elements_as_a_scene_has_corners() {
        let most = 3 * MAX_TRIANGLES;
        let mut making = Making::default();
        for count in [most, most + 1] {
            making.accessor(format!(r#""componentType": 5126, "count": {count}, "type": "VEC3""#));
        }
        let message = "accessor 1 has 15000001 elements, but at most 15000000 are read";
        open(&making, |file| {
            assert_eq!([file.count(0), file.count(1)], [Ok(most), Err(message.to_owned())]);
        });
    }

    #[test]
    fn joints_are_four_bytes_or_shorts() {
        let numbers = [[1, 2, 3, 250], [7, 0, 9, 4]];
        let mut making = Making::default();
        for (component, size) in [(5121, 1), (5123, 2)] {
            let bytes: Vec<u8> = numbers
                .as_flattened()
                .iter()
                .flat_map(|number: &u32| {
                    (number * (1 + 256 * (size as u32 - 1))).to_le_bytes()[..size].to_vec()
                })
                .collect();
            let view = making.view(&bytes, "");
            making.accessor(format!(
                r#""bufferView": {view}, "componentType": {component}, "count": 2, "type": "VEC4""#
            ));
        }
        open(&making, |file| {
            assert_eq!(file.joints(0).unwrap(), numbers);
            assert_eq!(file.joints(1).unwrap(), numbers.map(|all| all.map(|number| 257 * number)));
        });
    }

    #[test]
    fn none_or_all_elements_may_be_in_a_buffer_or_change() {
        let mut making = Making::default();
        let empty = making.view(&[], "");
        making
            .accessor(format!(r#""bufferView": {empty}, "componentType": 5126, "count": 0, "type": "VEC3""#));
        let (places, values) = (making.view(&[1, 0], ""), making.view(&[7, 0, 8, 0], ""));
        making.accessor(format!(
            r#""componentType": 5123, "count": 2, "type": "SCALAR", "sparse": {{"count": 2,
            "indices": {{"bufferView": {places}, "componentType": 5121}}, "values": {{"bufferView": {values}}}}}"#
        ));
        open(&making, |file| {
            assert_eq!(file.vectors::<3>(0).unwrap(), [[0.0; 3]; 0]);
            assert_eq!(file.indices(1).unwrap(), [8, 7]);
        });
    }
}
