//! Wording of explanations.

use epigraph_core::Mark;

use super::{cloud::NO_POINT, edge_pixel::slot_position};

/// The neighbours of a pixel in the order of [`super::edge_pixel::DIRECTIONS`].
pub const NEIGHBOURS: [&str; 8] =
    ["right", "lower right", "below", "lower left", "left", "upper left", "above", "upper right"];

/// A distance.
pub fn metres(z: f32) -> String {
    if z.is_finite() { format!("{z:.3} m") } else { "none".into() }
}

/// A place or direction in the world, metres.
pub fn place([x, y, z]: [f32; 3]) -> String {
    format!("({x:.3}, {y:.3}, {z:.3})")
}

/// A share as per cent.
pub fn percent(share: f32) -> String {
    format!("{:.0}%", 100.0 * share)
}

/// A count and its noun, with an s in the plural.
pub fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

/// The point that a pixel shows.
pub fn point(id: u32) -> String {
    if id == NO_POINT { "none".into() } else { format!("{id}") }
}

/// The index of a pixel as column and row.
pub fn pixel(index: usize, width: usize) -> String {
    format!("({}, {})", index % width, index / width)
}

/// A place in a pixel, in 1/65536 of it: x in the low 16 bits, y in the high ones.
pub fn aim(bits: u32) -> [f32; 2] {
    [bits & 0xFFFF, bits >> 16].map(|share| share as f32 / 65536.0)
}

/// Where a pixel's perimeter is crossed.
pub fn crossings(ring: u32) -> Vec<Mark> {
    let slots = (0..32).filter(|slot| ring >> slot & 1 != 0);
    slots.map(|slot| Mark::Crossing(slot_sides(slot))).collect()
}

/// The ends of a slot, in pixels from the top left corner of the pixel.
fn slot_sides(slot: u32) -> [[f32; 2]; 2] {
    let centre = slot_position(slot);
    let along = if slot >> 3 & 1 == 0 { [1, 0] } else { [0, 1] };
    [-1, 1].map(|sign| [0, 1].map(|axis| (centre[axis] + sign * along[axis]) as f32 / 16.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_cover_the_perimeter() {
        // Bit 3 of the top side, bit 6 of the right one: an eighth of a pixel each.
        let marks = crossings(1 << 3 | 1 << 14);
        let expected = [[[0.375, 0.0], [0.5, 0.0]], [[1.0, 0.75], [1.0, 0.875]]];
        assert_eq!(marks, expected.map(Mark::Crossing));
    }

    #[test]
    fn words() {
        assert_eq!((count(1, "point"), count(2, "point")), ("1 point".into(), "2 points".into()));
        assert_eq!((metres(2.5), metres(f32::INFINITY)), ("2.500 m".into(), "none".into()));
        assert_eq!(
            (pixel(13, 5), point(NO_POINT), aim(0xC000_4000)),
            ("(3, 2)".into(), "none".into(), [0.25, 0.75])
        );
    }
}
