//! The canvas as a vector drawing, in colours for a light background.

use egui::{Pos2, Rect, pos2};
use epigraph_pictures::{
    readable,
    svg::{Anchor, Font, Svg},
};

use super::{
    model::PinRef,
    paint::{PIN_RADIUS, color, milliseconds, on_paper},
    shape::{HEAD, INFO, NAME, PAD, PIN},
    sight::Sight,
};
use crate::document::Pin;

/// Room around the boxes.
const FRAME: f32 = 24.0;
const INK: &str = "#1c1c1c";
const WEAK: &str = "#5c5c5c";
const IDLE: &str = "#9a9a9a";
const BORDER: &str = "#8a8a8a";
const HEADS: &str = "#e9ecf1";
const PAPER: &str = "#fbfbfc";

/// The drawing, as the text of an SVG file.
pub fn svg(sight: &Sight) -> String {
    let bounds = sight.bounds().expand(FRAME);
    let drawing = Drawing { origin: bounds.min };
    let mut svg = Svg::default();
    for (wire, route) in sight.model.wires.iter().zip(&sight.routes) {
        let points: Vec<[f64; 2]> = route.iter().map(|point| drawing.at(*point)).collect();
        let color = hex(sight.model.at(wire.from));
        if wire.history {
            svg.dashed(&points, &color, 1.6);
        } else {
            svg.polyline(&points, &color, 1.8);
        }
    }
    for index in 0..sight.model.blocks.len() {
        drawing.block(&mut svg, sight, index);
    }
    for (crossing, at) in sight.crossings.iter().zip(&sight.chips) {
        let text = format!("{} {}", crossing.verb(), readable(crossing.bytes));
        let width = 7.0 * text.len() as f32 + 8.0;
        let rect = Rect::from_center_size(*at, egui::vec2(width, 18.0));
        drawing.framed(&mut svg, rect, PAPER);
        drawing.text(&mut svg, pos2(at.x, at.y + 4.0), &text, Anchor::Middle, INFO, INK, false);
    }
    svg.finish([f64::from(bounds.width()), f64::from(bounds.height())])
}

struct Drawing {
    origin: Pos2,
}

impl Drawing {
    fn at(&self, point: Pos2) -> [f64; 2] {
        [f64::from(point.x - self.origin.x), f64::from(point.y - self.origin.y)]
    }

    fn rect(&self, svg: &mut Svg, rect: Rect, color: &str) {
        svg.rect(self.at(rect.min), [f64::from(rect.width()), f64::from(rect.height())], color);
    }

    fn framed(&self, svg: &mut Svg, rect: Rect, fill: &str) {
        self.rect(svg, rect.expand(0.5), BORDER);
        self.rect(svg, rect.shrink(0.5), fill);
    }

    fn text(
        &self,
        svg: &mut Svg,
        at: Pos2,
        text: &str,
        anchor: Anchor,
        size: f32,
        color: &'static str,
        bold: bool,
    ) {
        svg.text(self.at(at), text, anchor, Font { size: f64::from(size), color, bold });
    }

    fn block(&self, svg: &mut Svg, sight: &Sight, index: usize) {
        let (block, facts, rect) = (&sight.model.blocks[index], &sight.facts[index], sight.rects[index]);
        let idle = block.bypass || facts.why.is_some();
        let (ink, weak) = if idle { (IDLE, IDLE) } else { (INK, WEAK) };
        // Without its thumbnail, which shows a single moment.
        let rect =
            sight.shapes[index].thumbnail.map_or(rect, |picture| rect.with_max_y(rect.top() + picture.top()));
        self.framed(svg, rect, PAPER);
        self.rect(svg, rect.shrink(0.5).with_max_y(rect.top() + HEAD - 6.0), HEADS);
        let left = rect.left() + PAD;
        self.text(svg, pos2(left, rect.top() + 17.0), &block.name, Anchor::Start, NAME, ink, true);
        self.text(svg, pos2(left, rect.top() + 32.0), &facts.info(block), Anchor::Start, INFO, weak, false);
        if let Some(ms) = facts.ms {
            let at = pos2(rect.right() - PAD, rect.top() + 17.0);
            self.text(svg, at, &milliseconds(ms), Anchor::End, INFO, weak, false);
        }
        if let (Some(why), Some(top)) = (&facts.why, sight.shapes[index].why) {
            let at = pos2(left, rect.top() + top + INFO);
            self.text(svg, at, &format!("off: {why}"), Anchor::Start, INFO, weak, false);
        }
        for (output, anchor, x) in [(false, Anchor::Start, left), (true, Anchor::End, rect.right() - PAD)] {
            for (pin, known) in block.pins(output).iter().enumerate() {
                let place = sight.pin(PinRef { block: index, output, pin });
                svg.dot(self.at(place), f64::from(PIN_RADIUS), &hex(known));
                self.text(svg, pos2(x, place.y + 0.35 * PIN), &known.name, anchor, PIN, ink, false);
            }
        }
    }
}

/// A pin's colour in SVG notation.
fn hex(pin: &Pin) -> String {
    let [r, g, b, _] = on_paper(color(pin)).to_array();
    format!("#{r:02x}{g:02x}{b:02x}")
}
