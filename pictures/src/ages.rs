//! The ages of the points that pixels show.

use epigraph_core::{Element, Meaning, PortElement, Snapshot};
use epigraph_stages::{
    meaning,
    shared::cloud::{AGE, AGE_ONE, LIVE},
};

use crate::{Number, lanes, look::NONE};

/// The age, an integer from 0 to 255, of the point that each pixel shows, from an image of ids and the cloud's `meta`;
/// no value where there is no live point. On average, a point's age is 128 when it is due to be replaced. `None` if
/// either is not a list of words.
pub fn ages(id: &Snapshot, meta: &Snapshot) -> Option<Snapshot> {
    let meta = words(meta)?;
    of_points(id, meaning::AGE, |point| is_live(*meta.get(point)?).then_some((meta[point] & AGE) / AGE_ONE))
}

/// The number of frames before frame `now` at which the point of each pixel came, from an image of ids and the cloud's
/// `meta` and `dates` (frame numbers + 1). No value where there is no live point or it has no date. `None` if one of
/// the three is not a list of words.
pub fn frames_ago(id: &Snapshot, meta: &Snapshot, dates: &Snapshot, now: u32) -> Option<Snapshot> {
    let (meta, dates) = (words(meta)?, words(dates)?);
    of_points(id, meaning::FRAMES_AGO, |point| {
        let came = dates.get(point)?.checked_sub(1)?;
        is_live(*meta.get(point)?).then_some(now.saturating_sub(came))
    })
}

fn is_live(meta: u32) -> bool {
    meta & LIVE != 0
}

/// An image of a property of the point that each pixel shows.
fn of_points(id: &Snapshot, meaning: Meaning, known: impl Fn(usize) -> Option<u32>) -> Option<Snapshot> {
    let known = |id: u32| known(id as usize).unwrap_or(NONE);
    let bytes = words(id)?.into_iter().flat_map(|id| known(id).to_le_bytes()).collect();
    let element: Element = u32::element();
    let name = format!("{} {meaning}", id.name);
    Some(Snapshot { name, meaning: Some(meaning), element, bytes, ..id.clone() })
}

/// The elements, if each is one u32.
fn words(snapshot: &Snapshot) -> Option<Vec<u32>> {
    match lanes(&snapshot.element).as_slice() {
        [only] if only.is_unsigned() => Some(only.numbers(snapshot).map(Number::bits).collect()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use epigraph_core::Dims;

    use super::*;

    fn snapshot(name: &str, data: &[u32]) -> Snapshot {
        Snapshot {
            name: name.into(),
            field: String::new(),
            meaning: None,
            element: u32::element(),
            dims: Dims { width: data.len() as u32, height: 1 },
            frame: 5,
            bytes: bytemuck::cast_slice(data).to_vec(),
        }
    }

    #[test]
    fn pixels_have_the_age_of_their_point() {
        let meta = snapshot("a.cloud", &[LIVE | (3 * AGE_ONE + 17), 9 * AGE_ONE, LIVE]);
        let found = ages(&snapshot("b.id", &[2, 0, 1, NONE, 7]), &meta).unwrap();
        assert_eq!(found.get::<u32>(), [0, 3, NONE, NONE, NONE]);
        assert_eq!((found.name.as_str(), found.frame), ("b.id age", 5));
        let floats = Snapshot { element: f32::element(), ..meta.clone() };
        assert!(ages(&meta, &floats).is_none());
    }

    #[test]
    fn pixels_tell_how_many_frames_ago_their_point_came() {
        let meta = snapshot("a.cloud", &[LIVE, 0, LIVE, LIVE]);
        // Frames 2 and 9; no date; frame 11.
        let dates = snapshot("a.dates", &[3, 10, 0, 12]);
        let id = snapshot("b.id", &[3, 0, 1, 2, NONE, 7]);
        let found = frames_ago(&id, &meta, &dates, 11).unwrap();
        assert_eq!(found.get::<u32>(), [0, 9, NONE, NONE, NONE, NONE]);
        assert_eq!(found.name, "b.id frames ago");
        let floats = Snapshot { element: f32::element(), ..dates.clone() };
        assert!(frames_ago(&id, &meta, &floats, 11).is_none());
    }
}
