//! Reading images in their own terms: from a port's numbers to a picture and to words. Knows nothing of windows.
//!
//! | mode | shown as |
//! |---|---|
//! | [`Mode::Color`] | linear light, clamped and sRGB-encoded; bytes as they are |
//! | [`Mode::Grey`] | black at the range's low end, white at its high end |
//! | [`Mode::FalseColor`] | the same along a ramp of even lightness steps |
//! | [`Mode::Depth`] | 1/z between the nearest and the farthest: bright is near |
//! | [`Mode::Names`] | a colour for each number: ids, faces, edges |
//!
//! What is no number is loud in every mode: NaN magenta, infinity cyan, poison orange. Elements that stand for nothing
//! (0xFFFFFFFF, infinite depth) have the quiet colour [`EMPTY`].

mod lanes;
mod ramp;
#[cfg(test)]
mod tests;

use epigraph_core::{Element, Format, Snapshot};
pub use lanes::{Lane, Number, lanes};
pub use ramp::ramp;

/// The colour of elements that stand for nothing.
pub const EMPTY: [u8; 3] = [24, 28, 48];
/// The colour of NaN.
pub const NAN: [u8; 3] = [255, 0, 255];
/// The colour of infinity where it is not a depth.
pub const INFINITE: [u8; 3] = [0, 255, 255];
/// The colour of memory that was never written, in poison mode.
pub const POISONED: [u8; 3] = [255, 128, 0];

/// The u32 that stands for nothing.
const NONE: u32 = u32::MAX;
/// What poison mode fills integers with.
const POISON: u32 = 0xDEAD_BEEF;

/// Ends of the names of ports whose numbers only tell things apart.
const NAMING: [&str; 5] = ["id", "face", "edge", "slot", "n8"];

/// Shares of the values that lie below the dark and the bright end of an automatic range.
const PERCENTILES: [f64; 2] = [0.01, 0.99];

/// Shade of the farthest depth, so that it differs from nothing.
const DARKEST_DEPTH: f32 = 0.15;

/// How numbers become colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Three lanes as a colour.
    Color,
    /// One lane from black to white.
    Grey,
    /// One lane along a ramp of colours.
    FalseColor,
    /// One lane as a distance.
    Depth,
    /// One lane as a name.
    Names,
}

impl Mode {
    /// All, with what people call them.
    pub const ALL: [(Self, &str); 5] = [
        (Self::Color, "Colour"),
        (Self::Grey, "Grey"),
        (Self::FalseColor, "False colour"),
        (Self::Depth, "Depth"),
        (Self::Names, "Ids"),
    ];

    /// What people call it.
    pub fn label(self) -> &'static str {
        Self::ALL.iter().find(|(mode, _)| *mode == self).map_or("", |(_, label)| label)
    }

    /// What suits a port: by its name, and by what its elements are.
    pub fn of(snapshot: &Snapshot) -> Self {
        let port = snapshot.name.rsplit('.').next().unwrap_or_default();
        let lanes = lanes(&snapshot.element);
        let floats = lanes.iter().all(|lane| lane.is_float());
        match lanes.len() {
            _ if port == "depth" || port == "filtered" => Self::Depth,
            3.. if floats => Self::Color,
            _ if !floats && NAMING.iter().any(|end| port.ends_with(end)) => Self::Names,
            _ => Self::Grey,
        }
    }
}

/// How a port is to be shown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Look {
    /// None: what suits the port.
    pub mode: Option<Mode>,
    /// Which lane, in modes of one lane.
    pub lane: usize,
    /// Values at the dark and the bright end; none: from the image's own values.
    pub range: Option<[f32; 2]>,
    /// Shades follow the logarithm of the value.
    pub log: bool,
}

/// A port as a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// sRGB, row by row from the top.
    pub colors: Vec<[u8; 3]>,
    /// The mode in which it is shown.
    pub mode: Mode,
    /// Values at the dark and the bright end, where the mode has such.
    pub range: Option<[f32; 2]>,
    /// How many pixels are NaN, infinite or poisoned.
    pub odd: usize,
}

/// Shows an image.
pub fn picture(snapshot: &Snapshot, look: &Look) -> Picture {
    let mode = look.mode.unwrap_or_else(|| Mode::of(snapshot));
    let lanes = lanes(&snapshot.element);
    let lane = lanes.get(look.lane).or(lanes.first());
    let size = [snapshot.dims.width as usize, snapshot.dims.height as usize];
    let (colors, range) = match (mode, lane) {
        (_, None) => (vec![EMPTY; snapshot.dims.count()], None),
        (Mode::Color, Some(lane)) => (colors(snapshot, &lanes, lane), None),
        (Mode::Names, Some(lane)) => (lane.numbers(snapshot).map(name_color).collect(), None),
        (Mode::Depth, Some(lane)) => depth(snapshot, lane, look.range),
        (Mode::Grey | Mode::FalseColor, Some(lane)) => amounts(snapshot, lane, look, mode),
    };
    let odd = colors.iter().filter(|color| [NAN, INFINITE, POISONED].contains(color)).count();
    Picture { size, colors, mode, range, odd }
}

/// What a pixel holds, in words: every lane with its name. None outside the image.
pub fn describe(snapshot: &Snapshot, [x, y]: [usize; 2]) -> Option<String> {
    let (width, height) = (snapshot.dims.width as usize, snapshot.dims.height as usize);
    if x >= width || y >= height {
        return None;
    }
    let port = snapshot.name.rsplit('.').next().unwrap_or_default();
    let text = |lane: &Lane| {
        let number = lane.number(snapshot, y * width + x)?;
        let number = match number {
            Number::Unsigned(NONE) => "none".to_owned(),
            Number::Unsigned(POISON) => "poison".to_owned(),
            // Depths are kept as bits where atomics compare them.
            Number::Unsigned(bits) if port == "depth" => format!("{} m", f32::from_bits(bits)),
            number => number.to_string(),
        };
        Some(if lane.name.is_empty() { number } else { format!("{} {number}", lane.name) })
    };
    Some(lanes(&snapshot.element).iter().filter_map(text).collect::<Vec<_>>().join("  "))
}

fn colors(snapshot: &Snapshot, lanes: &[Lane], first: &Lane) -> Vec<[u8; 3]> {
    if snapshot.element == Element::Texel(Format::Rgba8Unorm) {
        return snapshot.bytes.chunks_exact(4).map(|texel| [texel[0], texel[1], texel[2]]).collect();
    }
    // One or two lanes are red, or red and green.
    let lane = |index: usize| if index == 0 { Some(first) } else { lanes.get(index) };
    let value = |index: usize, pixel: usize| {
        lane(index).and_then(|lane| lane.number(snapshot, pixel)).map_or(0.0, Number::as_f32)
    };
    let color = |pixel: usize| {
        let linear = [value(0, pixel), value(1, pixel), value(2, pixel)];
        match linear {
            _ if linear.iter().any(|value| value.is_nan()) => NAN,
            _ if linear.iter().any(|value| value.is_infinite()) => INFINITE,
            _ => linear.map(|value| byte(encode(value))),
        }
    };
    (0..snapshot.dims.count()).map(color).collect()
}

/// The loud or quiet colour of what has no place in a range.
fn special(number: Number) -> Option<[u8; 3]> {
    match number {
        Number::Unsigned(NONE) => Some(EMPTY),
        Number::Unsigned(POISON) => Some(POISONED),
        Number::Float(value) if value.is_nan() => Some(NAN),
        Number::Float(value) if value.is_infinite() => Some(INFINITE),
        _ => None,
    }
}

fn amounts(snapshot: &Snapshot, lane: &Lane, look: &Look, mode: Mode) -> (Vec<[u8; 3]>, Option<[f32; 2]>) {
    let curve = |value: f32| if look.log { value.max(f32::MIN_POSITIVE).ln() } else { value };
    let plain = lane.numbers(snapshot).filter(|number| special(*number).is_none()).map(Number::as_f32);
    let range = look.range.or_else(|| automatic(plain.collect(), lane.is_float()));
    let ends = range.map(|range| range.map(curve));
    let shade = |number: Number| {
        if let Some(color) = special(number) {
            return color;
        }
        let share = ends.map_or(0.0, |ends| between(curve(number.as_f32()), ends));
        if mode == Mode::FalseColor { ramp(share) } else { [byte(share); 3] }
    };
    (lane.numbers(snapshot).map(shade).collect(), range)
}

fn depth(snapshot: &Snapshot, lane: &Lane, range: Option<[f32; 2]>) -> (Vec<[u8; 3]>, Option<[f32; 2]>) {
    let z = |number: Number| match number {
        Number::Unsigned(bits) => f32::from_bits(bits),
        number => number.as_f32(),
    };
    let is_depth = |z: &f32| *z > 0.0 && z.is_finite();
    let range = range.or_else(|| automatic(lane.numbers(snapshot).map(z).filter(is_depth).collect(), true));
    let ends = range.map(|[near, far]| [1.0 / far, 1.0 / near]);
    let shade = |number: Number| {
        if number == Number::Unsigned(POISON) {
            return POISONED;
        }
        let z = z(number);
        match ends {
            // All bits set are a NaN as well: what no point has reached.
            _ if z.is_nan() && number != Number::Unsigned(NONE) => NAN,
            Some(ends) if is_depth(&z) => {
                [byte(DARKEST_DEPTH + (1.0 - DARKEST_DEPTH) * between(1.0 / z, ends)); 3]
            }
            _ => EMPTY,
        }
    };
    (lane.numbers(snapshot).map(shade).collect(), range)
}

/// From 0, or the lowest of the values, to the highest, a hundredth at either end left out for floats.
fn automatic(mut values: Vec<f32>, floats: bool) -> Option<[f32; 2]> {
    if !floats {
        return Some([0.0, values.into_iter().reduce(f32::max)?]);
    }
    let last = values.len().checked_sub(1)?;
    let mut at = |share: f64| {
        let (_, value, _) =
            values.select_nth_unstable_by((share * last as f64).round() as usize, f32::total_cmp);
        *value
    };
    Some(PERCENTILES.map(&mut at))
}

/// Where `value` lies between `low` (0) and `high` (1).
fn between(value: f32, [low, high]: [f32; 2]) -> f32 {
    if high > low {
        ((value - low) / (high - low)).clamp(0.0, 1.0)
    } else {
        f32::from(u8::from(value >= high))
    }
}

fn name_color(number: Number) -> [u8; 3] {
    if let Some(color) = special(number) {
        return color;
    }
    let bits = match number {
        Number::Float(value) => value.to_bits(),
        Number::Unsigned(value) => value,
        Number::Signed(value) => value as u32,
    };
    // The output function of PCG (O'Neill 2014), RXS-M-XS of 32 bits: neighbours get unlike colours, none is dark.
    let state = bits.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    let word = (word >> 22) ^ word;
    [word, word >> 8, word >> 16].map(|bits| 64 + (bits & 0xFF) as u8 / 4 * 3)
}

/// A linear value, clamped to [0, 1], as sRGB in [0, 1] (IEC 61966-2-1).
fn encode(linear: f32) -> f32 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// A value in [0, 1] as a byte, rounded to nearest.
fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}
