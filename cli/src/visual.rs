//! Ports as pictures: what the numbers mean decides how they are shown.
//!
//! | element | shown as |
//! |---|---|
//! | `rgba8unorm` | as it is |
//! | other colours (four floats) | linear light, clamped, sRGB-encoded; magenta where a channel is NaN |
//! | depth: one float, or its bits in a u32, at a port `depth` | 1/z between near and far: bright is near |
//! | one or two floats | grey, or red and green, between the 1st and the 99th percentile |
//! | integers at a port whose name ends in `id`, `face`, `edge` or `slot` | a colour for each number |
//! | other integers: masks, priorities, counts, sums | grey, white at the largest |
//!
//! Elements without a value (NaN, infinite or far depths, 0xFFFFFFFF) have the colour [`EMPTY`].

use epigraph_core::{Dims, Element, Format, Snapshot};

use crate::{
    columns::{self, Value},
    tone,
};

/// The colour of elements without a value.
pub const EMPTY: [u8; 3] = [24, 28, 48];

/// The colour of colours that are not a number.
const NOT_A_NUMBER: [u8; 3] = [255, 0, 255];

/// The u32 that stands for nothing: ids of empty pixels.
const NONE: u32 = u32::MAX;

/// Ends of the names of ports whose numbers only tell things apart.
const NAMING: [&str; 4] = ["id", "face", "edge", "slot"];

/// Shares of the values that lie below the darkest and the brightest shade.
const PERCENTILES: [f64; 2] = [0.01, 0.99];

/// Darkest shade of a depth that there is, so that it differs from [`EMPTY`].
const DARKEST_DEPTH: f32 = 0.15;

/// What a picture depends on beside the port.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Depths from here on count as empty, metres.
    pub far: f32,
}

impl Default for Look {
    fn default() -> Self {
        Self { far: f32::INFINITY }
    }
}

/// Whether elements of these dims make an image, in a run of frames of `size`.
pub fn is_image(element: &Element, dims: Dims, size: [u32; 2]) -> bool {
    matches!(element, Element::Texel(_)) || dims.height > 1 || [dims.width, dims.height] == size
}

/// A snapshot's elements as sRGB bytes, in their order.
pub fn show(snapshot: &Snapshot, look: &Look) -> Vec<[u8; 3]> {
    let columns = columns::of(&snapshot.element);
    let lanes: Vec<Vec<Value>> = columns.iter().map(|column| column.values(snapshot).collect()).collect();
    let port = snapshot.name.rsplit('.').next().unwrap_or_default();
    match lanes.as_slice() {
        [r, g, b, _] if snapshot.element == Element::Texel(Format::Rgba8Unorm) => {
            zip3(&floats(r), &floats(g), &floats(b), |color| color.map(tone::to_byte))
        }
        [r, g, b, ..] if is_float(r) && is_float(g) && is_float(b) => {
            zip3(&floats(r), &floats(g), &floats(b), color)
        }
        [only] if port == "depth" => depth(&bits_as_floats(only), look.far),
        [only] if is_float(only) => {
            let shades = shades(&floats(only), look.far);
            shades.iter().map(|shade| shade.map_or(EMPTY, |shade| [shade; 3])).collect()
        }
        [x, y] if is_float(x) && is_float(y) => {
            let (x, y) = (shades(&floats(x), look.far), shades(&floats(y), look.far));
            x.iter()
                .zip(&y)
                .map(|pair| if let (Some(x), Some(y)) = pair { [*x, *y, 0] } else { EMPTY })
                .collect()
        }
        [first, ..] if NAMING.iter().any(|end| port.ends_with(end)) => names(&integers(first)),
        [first, ..] => amounts(&integers(first)),
        [] => vec![EMPTY; snapshot.dims.count()],
    }
}

fn zip3(r: &[f32], g: &[f32], b: &[f32], show: impl Fn([f32; 3]) -> [u8; 3]) -> Vec<[u8; 3]> {
    r.iter().zip(g).zip(b).map(|((&r, &g), &b)| show([r, g, b])).collect()
}

fn color(linear: [f32; 3]) -> [u8; 3] {
    if linear.iter().any(|channel| channel.is_nan()) { NOT_A_NUMBER } else { tone::to_srgb8(linear) }
}

fn is_float(lane: &[Value]) -> bool {
    matches!(lane.first(), Some(Value::Float(_)))
}

fn floats(lane: &[Value]) -> Vec<f32> {
    let float = |value: &Value| match *value {
        Value::Float(value) => value,
        Value::Unsigned(value) => value as f32,
        Value::Signed(value) => value as f32,
    };
    lane.iter().map(float).collect()
}

/// Depths are kept as floats, or as their bits where atomics compare them.
fn bits_as_floats(lane: &[Value]) -> Vec<f32> {
    let float = |value: &Value| match *value {
        Value::Float(value) => value,
        Value::Unsigned(bits) => f32::from_bits(bits),
        Value::Signed(value) => value as f32,
    };
    lane.iter().map(float).collect()
}

fn integers(lane: &[Value]) -> Vec<u32> {
    let integer = |value: &Value| match *value {
        Value::Float(value) => value.to_bits(),
        Value::Unsigned(value) => value,
        Value::Signed(value) => value as u32,
    };
    lane.iter().map(integer).collect()
}

/// The values at [`PERCENTILES`]; none where there are no values.
fn range(mut values: Vec<f32>) -> Option<[f32; 2]> {
    values.sort_unstable_by(f32::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(PERCENTILES.map(|share| values[(share * last as f64).round() as usize]))
}

/// Where `value` lies between `low` (0) and `high` (1).
fn between(value: f32, [low, high]: [f32; 2]) -> f32 {
    if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 }
}

fn shades(values: &[f32], far: f32) -> Vec<Option<u8>> {
    // Stages write exactly the far plane's distance where there is nothing.
    let is_value = |value: f32| value.is_finite() && value != far;
    let range = range(values.iter().copied().filter(|&value| is_value(value)).collect());
    let shade = |&value: &f32| {
        let range = range.filter(|_| is_value(value))?;
        Some(tone::to_byte(between(value, range)))
    };
    values.iter().map(shade).collect()
}

fn depth(depths: &[f32], far: f32) -> Vec<[u8; 3]> {
    // Stages may write `far` with a rounding error.
    let nearness = |z: f32| (z > 0.0 && z.is_finite() && z < 0.999 * far).then(|| 1.0 / z);
    let range = range(depths.iter().filter_map(|&z| nearness(z)).collect());
    let shade = |&z: &f32| {
        let shade = nearness(z).zip(range).map(|(value, range)| between(value, range));
        shade.map_or(EMPTY, |shade| [tone::to_byte(DARKEST_DEPTH + (1.0 - DARKEST_DEPTH) * shade); 3])
    };
    depths.iter().map(shade).collect()
}

fn names(values: &[u32]) -> Vec<[u8; 3]> {
    values.iter().map(|&value| if value == NONE { EMPTY } else { hashed(value) }).collect()
}

fn amounts(values: &[u32]) -> Vec<[u8; 3]> {
    let largest = values.iter().copied().filter(|&value| value != NONE).max().unwrap_or(0);
    let shade = |value: u32| tone::to_byte((f64::from(value) / f64::from(largest.max(1))) as f32);
    values.iter().map(|&value| if value == NONE { EMPTY } else { [shade(value); 3] }).collect()
}

/// A colour that differs from those of other numbers nearby, never dark.
fn hashed(value: u32) -> [u8; 3] {
    // The output function of PCG (O'Neill 2014), RXS-M-XS of 32 bits.
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    let word = (word >> 22) ^ word;
    [word, word >> 8, word >> 16].map(|bits| 64 + (bits & 0xFF) as u8 / 4 * 3)
}

#[cfg(test)]
mod tests {
    use epigraph_core::{PortElement, texel};

    use super::*;

    fn shown<T: bytemuck::Pod>(name: &str, element: Element, data: &[T]) -> Vec<[u8; 3]> {
        let bytes: Vec<u8> = bytemuck::cast_slice(data).to_vec();
        let dims = Dims { width: data.len() as u32, height: 1 };
        let look = Look { far: 100.0 };
        show(&Snapshot { name: name.into(), field: String::new(), element, dims, frame: 0, bytes }, &look)
    }

    #[test]
    fn colours_are_encoded_and_nan_stands_out() {
        let colors = [[0.18f32, 9.0, -1.0, 1.0], [f32::NAN, 0.0, 0.0, 1.0]];
        assert_eq!(
            shown("fill.color", texel::Rgba32Float::element(), &colors),
            [[118, 255, 0], NOT_A_NUMBER]
        );
    }

    #[test]
    fn depth_is_bright_where_near_and_empty_where_far() {
        let depths = [1.0f32, 2.0, 4.0, 100.0, f32::INFINITY];
        let as_floats = shown("cull.depth", f32::element(), &depths);
        let as_bits = shown("project.depth", u32::element(), &depths.map(f32::to_bits));
        assert_eq!(as_floats, as_bits);
        assert_eq!((as_floats[0], as_floats[3], as_floats[4]), ([255; 3], EMPTY, EMPTY));
        assert!(as_floats[1] > as_floats[2] && as_floats[2] > EMPTY);
    }

    #[test]
    fn integers_are_amounts_or_names() {
        assert_eq!(shown("a.mask", u32::element(), &[0u32, 1]), [[0; 3], [255; 3]]);
        assert_eq!(shown("a.priority", u32::element(), &[0u32, 100, 200]), [[0; 3], [128; 3], [255; 3]]);
        let ids = shown("a.id", u32::element(), &[5u32, 5, 1_000_000, NONE]);
        assert!(ids[0] == ids[1] && ids[0] != ids[2] && ids[3] == EMPTY);
        assert_eq!(shown("a.sum", u32::element(), &[NONE, NONE]), [EMPTY; 2]);
    }

    #[test]
    fn values_alone_or_equal_have_a_shade() {
        assert_eq!(shown("a.rate", f32::element(), &[3.0f32, 3.0, f32::NAN]), [[255; 3], [255; 3], EMPTY]);
        assert_eq!(shown("a.rate", f32::element(), &[f32::NAN]), [EMPTY]);
    }
}
