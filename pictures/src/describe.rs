//! Pixels and numbers as text.

use epigraph_core::Snapshot;
use epigraph_stages::shared::{
    edge_pixel::{AMBIGUOUS, CLASS, PIXEL_AREA, PRIMARY_IS_A, SIMPLE, VALID, ends, primary_area},
    octahedral::{NO_NORMAL, decode_oct16},
};

use crate::{
    Lane, Look, Mode, Number,
    edges::{CLASSES, class},
    lanes,
    look::{NONE, POISON, is_depth},
    size,
};

/// The contents of a pixel: every lane with its name, and the words of the edge-and-point image decoded. `None` outside
/// the image.
pub fn describe(snapshot: &Snapshot, at: [usize; 2]) -> Option<String> {
    let index = index(snapshot, at)?;
    let lanes = lanes(&snapshot.element);
    if let [only] = lanes.as_slice()
        && let Some(word) = only.number(snapshot, index).map(Number::bits).filter(|word| *word != POISON)
    {
        match Mode::of(snapshot) {
            Mode::Classes => return Some(class_in_words(word)),
            Mode::Edges => return Some(crossings_in_words(word)),
            Mode::Normals => return Some(normal_in_words(word)),
            Mode::Reach => return Some(format!("reaches {} of 24", (word & 0xFF_FFFF).count_ones())),
            _ => {}
        }
    }
    let depth = is_depth(snapshot);
    let text = |lane: &Lane| {
        let number = lane.number(snapshot, index)?;
        let number = match number {
            Number::Unsigned(NONE) => "none".to_owned(),
            Number::Unsigned(POISON) => "poison".to_owned(),
            // Depths that take part in atomic comparisons are stored as their bits.
            Number::Unsigned(bits) if depth => format!("{} m", Number::Float(f32::from_bits(bits)).brief()),
            Number::Float(_) if depth => format!("{} m", number.brief()),
            number => number.brief(),
        };
        Some(if lane.name.is_empty() { number } else { format!("{} {number}", lane.name) })
    };
    Some(lanes.iter().filter_map(text).collect::<Vec<_>>().join("  "))
}

fn normal_in_words(code: u32) -> String {
    if code == NO_NORMAL {
        return "none".to_owned();
    }
    let [x, y, z] = decode_oct16(code).normalize_or_zero().to_array();
    format!("x {x:.3}  y {y:.3}  z {z:.3}")
}

/// The text drawn into a pixel, a few digits per lane; empty if the pixel has no value or lies outside the image.
pub fn in_pixel(snapshot: &Snapshot, look: &Look, at: [usize; 2]) -> Vec<String> {
    let Some(index) = index(snapshot, at) else { return Vec::new() };
    let mode = look.mode_for(snapshot);
    let all = lanes(&snapshot.element);
    let text = |lane: &Lane| match lane.number(snapshot, index)? {
        Number::Unsigned(NONE) => None,
        Number::Unsigned(POISON) => Some("poison".to_owned()),
        number if mode == Mode::Depth => Some(Number::Float(f32::from_bits(number.bits())).short()),
        number => Some(number.short()),
    };
    match mode {
        Mode::Color => {
            let mut channels = look.channels.to_vec();
            channels.dedup();
            channels.iter().filter_map(|lane| text(all.get(*lane)?)).collect()
        }
        _ => all.get(look.lane).or(all.first()).and_then(text).into_iter().collect(),
    }
}

/// A size in bytes with a readable unit: `12.3 MiB`.
pub fn readable(bytes: u64) -> String {
    const UNITS: [&str; 4] = ["KiB", "MiB", "GiB", "TiB"];
    if bytes < 1024 {
        return format!("{bytes} B");
    }
    let mut value = bytes as f64 / 1024.0;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.1} {}", UNITS[unit])
}

/// A number with its digits in groups of three: 1,305,164.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

fn index(snapshot: &Snapshot, [x, y]: [usize; 2]) -> Option<usize> {
    let [width, height] = size(snapshot.dims);
    (x < width && y < height).then_some(y * width + x)
}

fn class_in_words(cls: u32) -> String {
    let mut text = CLASSES[class(cls)].0.to_owned();
    if cls & CLASS == SIMPLE {
        let [p, q] = ends(cls);
        let region = if cls & PRIMARY_IS_A != 0 { "A" } else { "B" };
        text += &format!("  slots {p} and {q}  primary {region} {}/{PIXEL_AREA}", primary_area(cls));
    }
    let flags = [(VALID, "has a sample"), (AMBIGUOUS, "its sample is ambiguous")];
    for (_, said) in flags.iter().filter(|(flag, _)| cls & flag != 0) {
        text += "  ";
        text += said;
    }
    text
}

fn crossings_in_words(mask: u32) -> String {
    let side = |name: &str, mask: u32| {
        let eighths: Vec<String> =
            (0..8).filter(|bit| mask >> bit & 1 != 0).map(|bit| bit.to_string()).collect();
        (!eighths.is_empty()).then(|| format!("{name} {}", eighths.join(" ")))
    };
    let sides: Vec<String> = [side("left", mask), side("top", mask >> 8)].into_iter().flatten().collect();
    if sides.is_empty() { "no crossing at the left or top".to_owned() } else { sides.join("  ") }
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Dims, Element, Meaning, PortElement, texel};
    use epigraph_stages::meaning::{self, CROSSINGS, DEPTH, RADIANCE, REACH};

    use super::*;

    fn snapshot<T: bytemuck::Pod>(meaning: Meaning, element: Element, data: &[T]) -> Snapshot {
        let dims = Dims { width: data.len() as u32, height: 1 };
        let bytes = bytemuck::cast_slice(data).to_vec();
        Snapshot {
            name: "a.b".into(),
            field: String::new(),
            meaning: Some(meaning),
            element,
            dims,
            frame: 0,
            bytes,
        }
    }

    fn told(meaning: Meaning, word: u32) -> String {
        describe(&snapshot(meaning, u32::element(), &[word]), [0, 0]).unwrap()
    }

    #[test]
    fn words_of_edges_are_decoded() {
        // E1 of algorithms.md section 2.6: slots 14 and 28, A has 192 of 512.
        let simple = SIMPLE | 14 << 2 | 28 << 7 | PRIMARY_IS_A | 192 << 13 | VALID;
        assert_eq!(told(meaning::CLASS, simple), "simple  slots 14 and 28  primary A 192/512  has a sample");
        assert_eq!(told(meaning::CLASS, 2), "complex");
        assert_eq!(told(REACH, 0x0033FF), "reaches 12 of 24");
        assert_eq!(told(CROSSINGS, 1 << 3 | 1 << 14), "left 3  top 6");
        assert_eq!(told(CROSSINGS, 0), "no crossing at the left or top");
        assert_eq!(told(meaning::CLASS, POISON), "poison");
    }

    #[test]
    fn bytes_are_readable() {
        let texts = [0, 1023, 1024, 1536 * 1024, 5 << 40].map(readable);
        assert_eq!(texts, ["0 B", "1023 B", "1.0 KiB", "1.5 MiB", "5.0 TiB"]);
    }

    #[test]
    fn thousands_are_set_apart() {
        let texts = [0, 999, 1000, 75, 110_592, 1_305_164].map(grouped);
        assert_eq!(texts, ["0", "999", "1,000", "75", "110,592", "1,305,164"]);
    }

    #[test]
    fn little_is_said_within_pixels() {
        let colors = snapshot(RADIANCE, texel::Rgba32Float::element(), &[[0.123_456f32, 2.0, 0.0, 1.0]]);
        assert_eq!(in_pixel(&colors, &Look::default(), [0, 0]), ["0.123", "2", "0"]);
        let alpha = Look { channels: [3; 3], ..Look::default() };
        assert_eq!(in_pixel(&colors, &alpha, [0, 0]), ["1"]);
        assert!(in_pixel(&colors, &alpha, [1, 0]).is_empty());
        let depth = snapshot(DEPTH, u32::element(), &[1.5f32.to_bits(), NONE]);
        assert_eq!(in_pixel(&depth, &Look::default(), [0, 0]), ["1.5"]);
        assert!(in_pixel(&depth, &Look::default(), [1, 0]).is_empty());
    }
}
