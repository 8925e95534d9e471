//! A pixel in words.

use epigraph_core::Snapshot;

use crate::{
    Lane, Number, lanes,
    look::{NONE, POISON, is_depth, port_of},
    size,
};

/// What a pixel holds: every lane with its name. None outside the image.
pub fn describe(snapshot: &Snapshot, [x, y]: [usize; 2]) -> Option<String> {
    let [width, height] = size(snapshot.dims);
    if x >= width || y >= height {
        return None;
    }
    let depth = is_depth(port_of(snapshot));
    let text = |lane: &Lane| {
        let number = lane.number(snapshot, y * width + x)?;
        let number = match number {
            Number::Unsigned(NONE) => "none".to_owned(),
            Number::Unsigned(POISON) => "poison".to_owned(),
            // Depths are kept as bits where atomics compare them.
            Number::Unsigned(bits) if depth => format!("{} m", Number::Float(f32::from_bits(bits)).brief()),
            Number::Float(_) if depth => format!("{} m", number.brief()),
            number => number.brief(),
        };
        Some(if lane.name.is_empty() { number } else { format!("{} {number}", lane.name) })
    };
    Some(lanes(&snapshot.element).iter().filter_map(text).collect::<Vec<_>>().join("  "))
}
