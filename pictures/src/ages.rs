//! How old the points are that pixels show.

use epigraph_core::{Element, PortElement, Snapshot};
use epigraph_stages::shared::cloud::{AGE, AGE_ONE, LIVE};

use crate::{Number, lanes, look::NONE};

/// The whole age, 0 to 255, of the point that each pixel shows, from an image of ids and the `meta` of the cloud; nothing
/// where there is no live point. On average, a point is 128 old when its turn to be replaced comes. None if one of both
/// is no list of words.
pub fn ages(id: &Snapshot, meta: &Snapshot) -> Option<Snapshot> {
    let words = |snapshot: &Snapshot| -> Option<Vec<u32>> {
        match lanes(&snapshot.element).as_slice() {
            [only] if only.is_unsigned() => Some(only.numbers(snapshot).map(Number::bits).collect()),
            _ => None,
        }
    };
    let meta = words(meta)?;
    let age = |id: u32| match meta.get(id as usize) {
        Some(meta) if meta & LIVE != 0 => (meta & AGE) / AGE_ONE,
        _ => NONE,
    };
    let bytes = words(id)?.into_iter().flat_map(|id| age(id).to_le_bytes()).collect();
    let element: Element = u32::element();
    Some(Snapshot { name: format!("{} age", id.name), element, bytes, ..id.clone() })
}

#[cfg(test)]
mod tests {
    use epigraph_core::Dims;

    use super::*;

    #[test]
    fn pixels_have_the_age_of_their_point() {
        let snapshot = |name: &str, data: &[u32]| Snapshot {
            name: name.into(),
            field: String::new(),
            element: u32::element(),
            dims: Dims { width: data.len() as u32, height: 1 },
            frame: 5,
            bytes: bytemuck::cast_slice(data).to_vec(),
        };
        let meta = snapshot("a.cloud", &[LIVE | (3 * AGE_ONE + 17), 9 * AGE_ONE, LIVE]);
        let found = ages(&snapshot("b.id", &[2, 0, 1, NONE, 7]), &meta).unwrap();
        assert_eq!(found.get::<u32>(), [0, 3, NONE, NONE, NONE]);
        assert_eq!((found.name.as_str(), found.frame), ("b.id age", 5));
        let floats = Snapshot { element: f32::element(), ..meta.clone() };
        assert!(ages(&meta, &floats).is_none());
    }
}
