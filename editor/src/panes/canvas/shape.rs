//! The shape of a box: its size, and the positions of its pins and texts, in points of the canvas from the box's top
//! left corner.

use egui::{Rect, Vec2, pos2, vec2};

use super::{
    facts::Facts,
    model::{Block, PinRef},
};

/// Font size of the name, of the line below it, and of the pins' names.
pub const NAME: f32 = 15.0;
pub const INFO: f32 = 12.0;
pub const PIN: f32 = 13.0;
/// Between a box's border and its contents.
pub const PAD: f32 = 10.0;
/// Height of the name with the line below.
pub const HEAD: f32 = 44.0;
/// Height of a row of pins, and of a line of text.
pub const ROW: f32 = 19.0;
pub const LINE: f32 = 16.0;
/// Between the names of an input and an output in a row.
const BETWEEN: f32 = 18.0;
/// Glyph widths do not scale exactly with the font size.
const SLACK: f32 = 8.0;
/// Between the last pin and the border or the next element.
const FOOT: f32 = 7.0;
/// Least and greatest width of a box. Longer texts are cut.
const WIDTHS: [f32; 2] = [132.0, 280.0];
/// Largest height of a thumbnail.
const THUMBNAIL: f32 = 96.0;

/// The layout of a box.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Size of the whole box.
    pub size: Vec2,
    /// The thumbnail.
    pub thumbnail: Option<Rect>,
    /// Top of the text that says why it does not run.
    pub why: Option<f32>,
}

impl Shape {
    /// The shape of a block. `measure` gives the width of a text of some height.
    pub fn new(block: &Block, facts: &Facts, thumbnails: bool, measure: &dyn Fn(&str, f32) -> f32) -> Self {
        let name = |pins: &[crate::document::Pin], row: usize| {
            pins.get(row).map_or(0.0, |pin| measure(&pin.name, PIN) + PAD)
        };
        let rows = block.inputs.len().max(block.outputs.len());
        let pins = (0..rows).map(|row| name(&block.inputs, row) + name(&block.outputs, row) + BETWEEN);
        let title = SLACK
            + 3.0 * PAD
            + measure(&block.name, NAME)
            + facts.ms.map_or(0.0, |_| measure("00.00 ms", INFO));
        let info = SLACK + 2.0 * PAD + measure(&facts.info(block), INFO);
        let width = pins.fold(title.max(info), f32::max).clamp(WIDTHS[0], WIDTHS[1]).ceil();

        let mut height = HEAD + ROW * rows as f32 + FOOT;
        let why = facts.why.as_ref().map(|_| height);
        if why.is_some() {
            height += 2.0 * LINE + FOOT;
        }
        let picture = facts.picture.as_ref().filter(|_| thumbnails);
        let thumbnail = picture.map(|picture| {
            let [w, h] = picture.size.map(|side| side.max(1) as f32);
            let scale = ((width - 2.0 * PAD) / w).min(THUMBNAIL / h);
            let size = vec2(w, h) * scale;
            Rect::from_min_size(pos2((width - size.x) / 2.0, height), size)
        });
        if let Some(thumbnail) = thumbnail {
            height = thumbnail.bottom() + PAD;
        }
        Self { size: vec2(width, height), thumbnail, why }
    }

    /// The position of a pin, on the box's border.
    pub fn pin(&self, at: PinRef) -> Vec2 {
        vec2(if at.output { self.size.x } else { 0.0 }, HEAD + ROW * (at.pin as f32 + 0.5))
    }
}
