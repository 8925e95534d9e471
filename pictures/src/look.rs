//! Ports as pictures: the meaning of the numbers decides how they are shown. If a port declares no meaning, its
//! elements do.
//!
//! | mode | shown as | suits |
//! |---|---|---|
//! | [`Mode::Color`] | linear light, exposed, clamped and sRGB-encoded; bytes as they are; two lanes as red and green in their ranges | floats in two lanes or more |
//! | [`Mode::Grey`] | black at the range's dark end, white at its bright end | all other ports |
//! | [`Mode::FalseColor`] | the same along a [`Ramp`] | |
//! | [`Mode::Depth`] | 1/z between the farthest and the nearest: bright is near | [`meaning::DEPTH`] |
//! | [`Mode::Names`] | a colour for each number | [`meaning::ID`], [`meaning::FACE`] |
//! | [`Mode::Edges`] | where edges cross a pixel's sides | [`meaning::CROSSINGS`] |
//! | [`Mode::Classes`] | empty, simple, complex | [`meaning::CLASS`] |
//! | [`Mode::Normals`] | x, y and z from -1 to 1 as red, green and blue | [`meaning::NORMAL`] |
//! | [`Mode::Reach`] | grey, white where all of the 5x5 pixels are reached | [`meaning::REACH`] |
//!
//! Odd values are loud: NaN magenta, infinity cyan, poison orange. Elements without a value (0xFFFFFFFF, far or
//! infinite depth) have the quiet colour [`EMPTY`].

#[cfg(test)]
mod tests;

use epigraph_core::{Element, Format, Meaning, Snapshot};
use epigraph_stages::{
    meaning,
    shared::{
        edge_pixel::{SIMPLE, class_of},
        octahedral::{NO_NORMAL, decode_oct16},
    },
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{Curve, Lane, Number, Paint, Ramp, Scale, edges, lanes, size, tone};

/// The colour of elements without a value.
pub const EMPTY: [u8; 3] = [24, 28, 48];
/// The colour of NaN.
pub const NAN: [u8; 3] = [255, 0, 255];
/// The colour of infinity, except as a depth.
pub const INFINITE: [u8; 3] = [0, 255, 255];
/// The colour of memory that was never written, in poison mode.
pub const POISONED: [u8; 3] = [255, 128, 0];

/// The u32 that means "no value".
pub(crate) const NONE: u32 = u32::MAX;
/// The integer that poison mode fills memory with.
pub(crate) const POISON: u32 = 0xDEAD_BEEF;

/// Shares of the values below the dark and the bright end of an automatic range.
const PERCENTILES: [f64; 2] = [0.01, 0.99];

/// The highest priority.
const MOST_PRIORITY: f32 = 255.0;

/// Bits of a word of [`meaning::REACH`].
const REACHABLE: f32 = 24.0;

/// How numbers become colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Mode {
    /// Three lanes as a colour.
    Color,
    /// One lane from black to white.
    Grey,
    /// One lane along a ramp of colours.
    FalseColor,
    /// One lane as a distance.
    Depth,
    /// One lane as ids, with a colour for each.
    Names,
    /// Crossings of edges.
    Edges,
    /// Classes of pixels.
    Classes,
    /// The number of reached pixels among 5x5.
    Reach,
    /// Unit vectors on an octahedron.
    Normals,
}

impl Mode {
    /// All modes, with their labels.
    pub const ALL: [(Self, &str); 9] = [
        (Self::Color, "Colour"),
        (Self::Grey, "Grey"),
        (Self::FalseColor, "False colour"),
        (Self::Depth, "Depth"),
        (Self::Names, "Ids"),
        (Self::Edges, "Edges"),
        (Self::Classes, "Classes"),
        (Self::Reach, "Reach"),
        (Self::Normals, "Normals"),
    ];

    /// The label shown to users.
    pub fn label(self) -> &'static str {
        Self::ALL.iter().find(|(mode, _)| *mode == self).map_or("", |(_, label)| label)
    }

    /// The default mode for a snapshot.
    pub fn of(snapshot: &Snapshot) -> Self {
        Self::of_port(snapshot.meaning, &snapshot.element)
    }

    /// The default mode for a port of that meaning and element.
    pub fn of_port(meaning: Option<Meaning>, element: &Element) -> Self {
        let lanes = lanes(element);
        let floats = lanes.iter().all(Lane::is_float);
        match (meaning, lanes.len()) {
            (Some(meaning::DEPTH), 1) => Self::Depth,
            (Some(meaning::CLASS), 1) if !floats => Self::Classes,
            (Some(meaning::CROSSINGS), 1) if !floats => Self::Edges,
            (Some(meaning::REACH), 1) if !floats => Self::Reach,
            (Some(meaning::NORMAL), 1) if !floats => Self::Normals,
            (Some(meaning::ID | meaning::FACE), _) if !floats => Self::Names,
            (_, 2..) if floats => Self::Color,
            _ => Self::Grey,
        }
    }
}

/// The settings with which a port is shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Look {
    /// `None`: the port's default.
    pub mode: Option<Mode>,
    /// The lane, in modes of one lane.
    pub lane: usize,
    /// The lanes shown as red, green and blue in [`Mode::Color`].
    pub channels: [usize; 3],
    /// Float colours are scaled by two to the power of this.
    pub exposure: f32,
    /// Values at the dark and the bright end; `None`: from the image's own values.
    pub range: Option<[f32; 2]>,
    /// Shades follow the logarithm of the value.
    pub log: bool,
    /// The colours of [`Mode::FalseColor`].
    pub ramp: Ramp,
    /// Depths from here on count as empty, metres.
    pub far: f32,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            mode: None,
            lane: 0,
            channels: [0, 1, 2],
            exposure: 0.0,
            range: None,
            log: false,
            ramp: Ramp::default(),
            far: f32::INFINITY,
        }
    }
}

impl Look {
    /// The mode for a port.
    pub fn mode_for(&self, snapshot: &Snapshot) -> Mode {
        self.mode.unwrap_or_else(|| Mode::of(snapshot))
    }

    /// The mapping from a port's values to shades, in modes that have a range; `None` if the port has no values either.
    pub fn scale(&self, snapshot: &Snapshot) -> Option<Scale> {
        let lanes = lanes(&snapshot.element);
        let lane = lanes.get(self.lane).or(lanes.first())?;
        let curve = if self.log { Curve::Log } else { Curve::Linear };
        let (curve, paint) = match self.mode_for(snapshot) {
            Mode::Grey => (curve, Paint::Grey),
            Mode::FalseColor => (curve, Paint::Ramp(self.ramp)),
            Mode::Depth => (Curve::Reciprocal, Paint::Depth),
            _ => return None,
        };
        let range = match self.range {
            Some(range) => range,
            None => self.automatic(snapshot, lane, curve)?,
        };
        Some(Scale { range, curve, paint })
    }

    /// The number shown for an element, or the loud or quiet colour of one that is not a quantity.
    fn amount(&self, snapshot: &Snapshot) -> impl Fn(Number) -> Result<f32, Shade> + Sync + use<> {
        let depth = self.mode_for(snapshot) == Mode::Depth || is_depth(snapshot);
        let far = self.far;
        move |number| {
            if !depth {
                return special(number).map_or(Ok(number.as_f32()), Err);
            }
            // Depths that take part in atomic comparisons are stored as their bits.
            let z = f32::from_bits(number.bits());
            match number {
                // Stages may write `far` with a rounding error.
                _ if z > 0.0 && z.is_finite() && z < 0.999 * far => Ok(z),
                Number::Unsigned(POISON) => Err(Odd(POISONED)),
                // All bits set, the depth where no point fell, is a NaN as well.
                _ if z.is_nan() && number.bits() != NONE => Err(Odd(NAN)),
                _ => Err(Plain(EMPTY)),
            }
        }
    }

    /// The numbers of a lane, without loud and quiet elements.
    pub(crate) fn amounts(&self, snapshot: &Snapshot, lane: &Lane) -> Vec<f32> {
        let amount = self.amount(snapshot);
        lane.numbers(snapshot).filter_map(|number| amount(number).ok()).collect()
    }

    /// The default range of an image: from the lowest value to the highest, without a hundredth at either end; from 0
    /// for integers; the full range for priorities. `None` if there are no values.
    fn automatic(&self, snapshot: &Snapshot, lane: &Lane, curve: Curve) -> Option<[f32; 2]> {
        let values = || self.amounts(snapshot, lane);
        if curve == Curve::Reciprocal {
            // From far to near, by 1/z as they are shaded.
            let nearness = values().into_iter().map(f32::recip).collect();
            return percentiles(nearness).map(|ends| ends.map(f32::recip));
        }
        if snapshot.meaning == Some(meaning::PRIORITY) {
            return Some([0.0, MOST_PRIORITY]);
        }
        if lane.is_float() || is_depth(snapshot) {
            return percentiles(values());
        }
        // All zeros are dark.
        Some([0.0, values().into_iter().reduce(f32::max)?.max(1.0)])
    }
}

/// A port as a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// sRGB, row by row from the top.
    pub colors: Vec<[u8; 3]>,
    /// The mode in which it is shown.
    pub mode: Mode,
    /// The mapping from values to shades, if the mode has a range.
    pub scale: Option<Scale>,
    /// Number of pixels that are NaN, infinite or poisoned.
    pub odd: usize,
}

/// A pixel's colour.
#[derive(Clone, Copy)]
enum Shade {
    Plain([u8; 3]),
    /// The colour of a value that is not a quantity.
    Odd([u8; 3]),
}

use Shade::{Odd, Plain};

/// Shows an image.
pub fn show(snapshot: &Snapshot, look: &Look) -> Shown {
    let mode = look.mode_for(snapshot);
    let lanes = lanes(&snapshot.element);
    let scale = look.scale(snapshot);
    let shades = match (mode, lanes.get(look.lane).or(lanes.first())) {
        (_, None) => vec![Plain(EMPTY); snapshot.dims.count()],
        (Mode::Color, Some(_)) => colors(snapshot, &lanes, look),
        (Mode::Grey | Mode::FalseColor | Mode::Depth, Some(lane)) => {
            let (amount, color) =
                (look.amount(snapshot), |value| scale.map_or(EMPTY, |scale| scale.color(value)));
            each(snapshot, lane, |number| {
                amount(number).map_or_else(|shade| shade, |value| Plain(color(value)))
            })
        }
        (Mode::Names, Some(lane)) => words(snapshot, lane, hashed),
        (Mode::Classes, Some(lane)) => words(snapshot, lane, edges::class_color),
        (Mode::Reach, Some(lane)) => {
            words(snapshot, lane, |r24| [tone::to_byte((r24 & 0xFF_FFFF).count_ones() as f32 / REACHABLE); 3])
        }
        (Mode::Normals, Some(lane)) => each(snapshot, lane, |number| match number.bits() {
            NO_NORMAL => Plain(EMPTY),
            POISON => Odd(POISONED),
            code => Plain((0.5 + 0.5 * decode_oct16(code).normalize_or_zero()).to_array().map(tone::to_byte)),
        }),
        (Mode::Edges, Some(lane)) => crossings(snapshot, lane),
    };
    let odd = shades.iter().filter(|shade| matches!(shade, Odd(_))).count();
    let colors = shades.into_iter().map(|(Plain(color) | Odd(color))| color).collect();
    Shown { size: size(snapshot.dims), colors, mode, scale, odd }
}

/// True if the values are distances.
pub(crate) fn is_depth(snapshot: &Snapshot) -> bool {
    snapshot.meaning == Some(meaning::DEPTH)
}

/// The shade of every element by its number.
fn each(snapshot: &Snapshot, lane: &Lane, shade: impl Fn(Number) -> Shade + Sync) -> Vec<Shade> {
    let shade = |index: usize| lane.number(snapshot, index).map_or(Plain(EMPTY), &shade);
    (0..snapshot.dims.count()).into_par_iter().map(shade).collect()
}

fn colors(snapshot: &Snapshot, lanes: &[Lane], look: &Look) -> Vec<Shade> {
    let chosen = look.channels.map(|lane| lanes.get(lane));
    let values = |pixel: usize| {
        chosen.map(|lane| lane.and_then(|lane| lane.number(snapshot, pixel)).map_or(0.0, Number::as_f32))
    };
    let is_encoded = snapshot.element == Element::Texel(Format::Rgba8Unorm);
    // Two lanes are not light but directions and the like.
    let ranges =
        chosen.map(|lane| look.automatic(snapshot, lane.filter(|_| lanes.len() == 2)?, Curve::Linear));
    let gain = look.exposure.exp2();
    let color = |pixel: usize| match values(pixel) {
        values if values.iter().any(|value| value.is_nan()) => Odd(NAN),
        values if values.iter().any(|value| value.is_infinite()) => Odd(INFINITE),
        values if is_encoded => Plain(values.map(tone::to_byte)),
        values if lanes.len() == 2 => Plain(std::array::from_fn(|channel| {
            let scale =
                ranges[channel].map(|range| Scale { range, curve: Curve::Linear, paint: Paint::Grey });
            scale.map_or(0, |scale| tone::to_byte(scale.share(values[channel])))
        })),
        values => Plain(tone::to_srgb8(values.map(|value| gain * value))),
    };
    (0..snapshot.dims.count()).into_par_iter().map(color).collect()
}

/// The loud or quiet colour of a value that has no place in a range.
fn special(number: Number) -> Option<Shade> {
    match number {
        Number::Unsigned(NONE) => Some(Plain(EMPTY)),
        Number::Unsigned(POISON) => Some(Odd(POISONED)),
        Number::Float(value) if value.is_nan() => Some(Odd(NAN)),
        Number::Float(value) if value.is_infinite() => Some(Odd(INFINITE)),
        _ => None,
    }
}

fn words(snapshot: &Snapshot, lane: &Lane, color: impl Fn(u32) -> [u8; 3] + Sync) -> Vec<Shade> {
    each(snapshot, lane, |number| special(number).unwrap_or_else(|| Plain(color(number.bits()))))
}

/// Pixels that edges cross: those that are cut in two, those where more happens, and dim, those that an edge ends in.
fn crossings(snapshot: &Snapshot, lane: &Lane) -> Vec<Shade> {
    let mask: Vec<u32> = lane.numbers(snapshot).map(Number::bits).collect();
    let corners = size(snapshot.dims);
    let pixels = corners.map(|side| side.saturating_sub(1));
    let shade = |index: usize| {
        if mask[index] == POISON {
            return Odd(POISONED);
        }
        let ring = edges::perimeter(&mask, pixels, [index % corners[0], index / corners[0]]).unwrap_or(0);
        Plain(match class_of(ring) {
            _ if ring == 0 => EMPTY,
            SIMPLE => edges::EDGE,
            class => edges::class_color(class),
        })
    };
    (0..mask.len()).into_par_iter().map(shade).collect()
}

/// The values at [`PERCENTILES`].
fn percentiles(mut values: Vec<f32>) -> Option<[f32; 2]> {
    let last = values.len().checked_sub(1)?;
    let mut at = |share: f64| {
        let (_, value, _) =
            values.select_nth_unstable_by((share * last as f64).round() as usize, f32::total_cmp);
        *value
    };
    Some(PERCENTILES.map(&mut at))
}

/// A colour that differs from those of other numbers nearby, never dark.
fn hashed(value: u32) -> [u8; 3] {
    // The output function of PCG (O'Neill 2014), RXS-M-XS of 32 bits.
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    let word = (word >> 22) ^ word;
    [word, word >> 8, word >> 16].map(|bits| 64 + (bits & 0xFF) as u8 / 4 * 3)
}
