//! Draws the canvas.

use std::collections::BTreeSet;

use egui::{
    Align2, Color32, CornerRadius, FontId, Painter, Pos2, Rect, Shape as Mark, Stroke, StrokeKind, Visuals,
    epaint::text::{LayoutJob, TextFormat, TextWrapping},
    pos2, vec2,
};
use epigraph_core::{Element, Side};
use epigraph_pictures::readable;

use super::{
    facts::{Crossing, Facts},
    model::{Block, PinRef, Role, Wire},
    shape::{HEAD, INFO, NAME, PAD, PIN},
    sight::Sight,
    view::View,
};
use crate::{document::Pin, theme};

/// Radius of a pin, and of its hit area.
pub const PIN_RADIUS: f32 = 4.5;
/// Smallest font size of names, and of the text below them.
const SMALLEST: f32 = 11.0;
const SMALLEST_INFO: f32 = 10.0;
/// Corner radius of boxes.
const CORNER: f32 = 6.0;
/// The colour of the highest cost.
pub const HOT: Color32 = Color32::from_rgb(214, 84, 40);
/// Opacity of everything that does not fit the wire being drawn.
const DIM: f32 = 0.28;
/// Opacity of everything that does not run.
const IDLE: f32 = 0.5;

/// Highlighted items of the canvas.
pub struct Marks<'a> {
    /// Addresses of selected blocks.
    pub selection: &'a BTreeSet<String>,
    /// The block under the pointer.
    pub hovered: Option<usize>,
    /// The wire under the pointer, and the selected one.
    pub wires: [Option<usize>; 2],
    /// Blocks with problems.
    pub wrong: &'a BTreeSet<usize>,
    /// The pin whose wire is being drawn.
    pub held: Option<PinRef>,
    /// True if costs tint the heads.
    pub heat: bool,
}

/// Draws on a pane.
pub struct Brush<'a> {
    /// The painter.
    pub painter: &'a Painter,
    /// The window's colours.
    pub visuals: &'a Visuals,
    /// The visible part of the canvas.
    pub view: View,
}

impl Brush<'_> {
    fn palette(&self) -> &'static theme::Palette {
        theme::palette_of(self.visuals)
    }

    /// The colour of a pin on this theme's background.
    fn tone(&self, color: Color32) -> Color32 {
        if self.visuals.dark_mode { color } else { on_paper(color) }
    }

    /// The background: dots, so that panning is visible.
    pub fn ground(&self) {
        let View { pane, zoom, .. } = self.view;
        self.painter.rect_filled(pane, 0.0, self.visuals.extreme_bg_color);
        let step = 32.0 * zoom;
        if step < 12.0 {
            return;
        }
        let color = self.visuals.weak_text_color().gamma_multiply(0.22);
        let first = self.view.point(Pos2::ZERO);
        let start = |from: f32, at: f32| at + (from - at).rem_euclid(step);
        let (mut y, left) = (start(first.y, pane.top()), start(first.x, pane.left()));
        while y < pane.bottom() {
            let mut x = left;
            while x < pane.right() {
                self.painter.circle_filled(pos2(x, y), 1.0, color);
                x += step;
            }
            y += step;
        }
    }

    /// All wires.
    pub fn wires(&self, sight: &Sight, marks: &Marks) {
        for (index, (wire, route)) in sight.model.wires.iter().zip(&sight.routes).enumerate() {
            let lit = marks.wires.contains(&Some(index));
            let touched = |pin: PinRef| {
                marks.hovered == Some(pin.block)
                    || marks.selection.contains(&sight.model.blocks[pin.block].address)
            };
            let near = touched(wire.from) || touched(wire.to);
            let dim = if marks.held.is_some() { DIM } else { 1.0 };
            let strength = if lit {
                1.0
            } else if near {
                0.95
            } else {
                0.62
            };
            let color = self.wire_color(sight, wire).gamma_multiply(strength * dim);
            let width = if lit {
                3.2
            } else if near {
                2.4
            } else {
                1.8
            };
            let points: Vec<Pos2> = route.iter().map(|point| self.view.point(*point)).collect();
            self.line(points, Stroke::new(width * self.view.zoom.clamp(0.6, 1.4), color), wire.history);
        }
    }

    /// A line; dashed for values of the previous frame.
    fn line(&self, points: Vec<Pos2>, stroke: Stroke, dashed: bool) {
        if dashed {
            self.painter.extend(Mark::dashed_line(&points, stroke, 6.0, 4.0));
        } else {
            self.painter.add(Mark::line(points, stroke));
        }
    }

    /// The wire that is being drawn, from a pin to the pointer.
    pub fn held_wire(&self, sight: &Sight, pin: PinRef, to: Pos2) {
        let from = self.view.point(sight.pin(pin));
        let reach = ((to.x - from.x).abs() / 2.0).max(30.0) * if pin.output { 1.0 } else { -1.0 };
        let stroke = Stroke::new(2.4, self.tone(color(sight.model.at(pin))));
        let points = [from, from + vec2(reach, 0.0), to - vec2(reach, 0.0), to];
        self.painter.add(egui::epaint::CubicBezierShape::from_points_stroke(
            points,
            false,
            Color32::TRANSPARENT,
            stroke,
        ));
    }

    fn wire_color(&self, sight: &Sight, wire: &Wire) -> Color32 {
        self.tone(color(sight.model.at(wire.from)))
    }

    /// A block with its contents, without its thumbnail.
    pub fn block(&self, sight: &Sight, index: usize, marks: &Marks) {
        let (block, facts, shape) = (&sight.model.blocks[index], &sight.facts[index], &sight.shapes[index]);
        let rect = self.view.rect(sight.rects[index]);
        if !self.view.pane.intersects(rect) {
            return;
        }
        let idle = facts.why.is_some() || block.bypass;
        let joinable = marks.held.is_none_or(|held| {
            held.block == index
                || sight.pins().any(|pin| pin.block == index && sight.model.refusal(held, pin).is_none())
        });
        let opacity = if joinable { 1.0 } else { DIM + 0.2 };
        let zoom = self.view.zoom;
        let corner = CornerRadius::same((CORNER * zoom.clamp(0.5, 1.5)) as u8);
        let fill = self.visuals.window_fill().gamma_multiply(1.0);
        self.painter.rect_filled(rect, corner, fill);
        let head = self.head(rect, facts, marks.heat.then(|| sight.hottest()), idle, corner, zoom);
        self.border(rect, block, marks, index, corner);

        let ink =
            self.visuals.strong_text_color().gamma_multiply(opacity * if idle { IDLE + 0.2 } else { 1.0 });
        if self.view.is_near() {
            self.head_texts(rect, head, block, facts, ink);
            if let (Some(why), Some(top)) = (&facts.why, shape.why) {
                let at = rect.min + vec2(PAD, top) * zoom;
                let width = rect.width() - 2.0 * PAD * zoom;
                let color = self.visuals.warn_fg_color.gamma_multiply(opacity);
                self.text(
                    at,
                    Align2::LEFT_TOP,
                    &format!("off: {why}"),
                    (INFO * zoom, color),
                    width,
                    2,
                    false,
                );
            }
        } else {
            // Only the area above the thumbnail.
            let room =
                shape.thumbnail.map_or(rect, |picture| rect.with_max_y(rect.top() + picture.top() * zoom));
            self.overview(room, block, facts, ink);
        }
        for pin in sight.pins().filter(|pin| pin.block == index) {
            self.pin(sight, pin, marks, opacity * if idle { IDLE } else { 1.0 });
        }
    }

    /// The head's background: the more the block costs, the warmer its tint.
    fn head(
        &self,
        rect: Rect,
        facts: &Facts,
        hottest: Option<f32>,
        idle: bool,
        corner: CornerRadius,
        zoom: f32,
    ) -> Rect {
        let height = if self.view.is_near() { (HEAD - 6.0) * zoom } else { rect.height() };
        let head = rect.with_max_y(rect.top() + height.min(rect.height()));
        let plain = self
            .visuals
            .widgets
            .noninteractive
            .bg_fill
            .lerp_to_gamma(self.visuals.widgets.inactive.bg_fill, 0.55);
        let share = match (hottest, facts.ms) {
            (Some(hottest), Some(ms)) if hottest > 0.0 && !idle => warmth(ms / hottest),
            _ => 0.0,
        };
        let whole = height >= rect.height();
        let corner = if whole { corner } else { CornerRadius { sw: 0, se: 0, ..corner } };
        self.painter.rect_filled(head, corner, plain.lerp_to_gamma(HOT, 0.8 * share));
        head
    }

    fn border(&self, rect: Rect, block: &Block, marks: &Marks, index: usize, corner: CornerRadius) {
        let selected = marks.selection.contains(&block.address);
        let stroke = match () {
            () if marks.wrong.contains(&index) => Stroke::new(2.0, self.palette().bad),
            () if selected => Stroke::new(2.5, self.palette().accent),
            () if marks.hovered == Some(index) => {
                Stroke::new(1.5, self.visuals.widgets.hovered.fg_stroke.color.gamma_multiply(0.7))
            }
            () => Stroke::new(1.0, self.visuals.widgets.inactive.fg_stroke.color.gamma_multiply(0.35)),
        };
        if block.role == Role::Part {
            // A second edge behind the first: the block contains a graph.
            let behind = rect.translate(vec2(3.0, 3.0) * self.view.zoom.max(0.6));
            let clip = self.painter.with_clip_rect(
                Rect::from_min_max(pos2(rect.left(), rect.bottom()), behind.max + vec2(2.0, 2.0))
                    .intersect(self.view.pane),
            );
            clip.rect_stroke(behind, corner, stroke, StrokeKind::Middle);
            let clip = self.painter.with_clip_rect(
                Rect::from_min_max(pos2(rect.right(), rect.top()), behind.max + vec2(2.0, 2.0))
                    .intersect(self.view.pane),
            );
            clip.rect_stroke(behind, corner, stroke, StrokeKind::Middle);
        }
        self.painter.rect_stroke(rect, corner, stroke, StrokeKind::Middle);
        if !block.changes.is_empty() {
            // A bar beside the block, as editors mark changed lines.
            let bar = rect.with_max_x(rect.left()).expand2(vec2(2.5, -f32::from(corner.nw)));
            self.painter.rect_filled(bar, CornerRadius::same(2), self.palette().changed);
        }
    }

    fn head_texts(&self, rect: Rect, head: Rect, block: &Block, facts: &Facts, ink: Color32) {
        let zoom = self.view.zoom;
        let right = rect.right() - PAD * zoom;
        let mut width = rect.width() - 2.0 * PAD * zoom;
        if let Some(ms) = facts.ms {
            let at = pos2(right, head.top() + 7.0 * zoom);
            let text = milliseconds(ms);
            let drawn = self.text(at, Align2::RIGHT_TOP, &text, (INFO * zoom, ink), width, 1, false);
            width -= drawn.width() + 6.0 * zoom;
        }
        let left = rect.left() + PAD * zoom;
        self.text(
            pos2(left, head.top() + 3.0 * zoom),
            Align2::LEFT_TOP,
            &block.name,
            (NAME * zoom, ink),
            width,
            1,
            block.bypass,
        );
        let at = pos2(left, head.top() + 21.0 * zoom);
        self.text(
            at,
            Align2::LEFT_TOP,
            &facts.info(block),
            (INFO * zoom, ink.gamma_multiply(0.8)),
            rect.width() - 2.0 * PAD * zoom,
            1,
            false,
        );
    }

    /// Zoomed out: the name as large as possible, and the cost or why it does not run.
    fn overview(&self, rect: Rect, block: &Block, facts: &Facts, ink: Color32) {
        let zoom = self.view.zoom;
        let (size, small) = ((NAME * zoom).max(SMALLEST), (INFO * zoom).max(SMALLEST_INFO));
        let below = match &facts.why {
            Some(why) => format!("off: {why}"),
            None => facts.ms.map(milliseconds).unwrap_or_default(),
        };
        let inner = rect.width() - 8.0;
        let room = rect.height() - 6.0 - 1.2 * size;
        let rows = ((room / (1.25 * small)) as usize).min(if below.is_empty() { 0 } else { 4 });
        let lines = if facts.why.is_some() { rows } else { rows.min(1) };
        let top = rect.center().y - 0.6 * (size + lines as f32 * small);
        let at = pos2(rect.center().x, top.max(rect.top() + 2.0));
        let name = self.text(at, Align2::CENTER_TOP, &block.name, (size, ink), inner, 1, block.bypass);
        if lines > 0 {
            let at = pos2(at.x, name.bottom());
            self.text(at, Align2::CENTER_TOP, &below, (small, ink.gamma_multiply(0.85)), inner, lines, false);
        }
    }

    fn pin(&self, sight: &Sight, at: PinRef, marks: &Marks, opacity: f32) {
        let zoom = self.view.zoom;
        let pin = sight.model.at(at);
        let place = self.view.point(sight.pin(at));
        let fits = marks.held.map(|held| held == at || sight.model.refusal(held, at).is_none());
        let opacity = match fits {
            Some(false) => DIM,
            Some(true) => 1.0,
            None => opacity,
        };
        let missing = !at.output && !pin.optional && sight.model.wire_to(at).is_none();
        let color = self.tone(color(pin)).gamma_multiply(opacity);
        let radius = (PIN_RADIUS * zoom).clamp(2.0, 8.0);
        if fits == Some(true) {
            self.painter.circle_filled(place, radius + 4.0, color.gamma_multiply(0.35));
        }
        let rim = if missing {
            Stroke::new(1.8, self.palette().bad)
        } else {
            Stroke::new(1.0, self.visuals.extreme_bg_color)
        };
        self.painter.circle(place, radius, color, rim);
        if !self.view.is_near() {
            return;
        }
        let rect = self.view.rect(sight.rects[at.block]);
        let ink =
            if missing { self.palette().bad } else { self.visuals.text_color().gamma_multiply(opacity) };
        let (x, anchor) = if at.output {
            (rect.right() - PAD * zoom, Align2::RIGHT_CENTER)
        } else {
            (rect.left() + PAD * zoom, Align2::LEFT_CENTER)
        };
        self.text(
            pos2(x, place.y),
            anchor,
            &pin.name,
            (PIN * zoom, ink),
            rect.width() - 2.0 * PAD * zoom,
            1,
            false,
        );
    }

    /// A transfer on its wire.
    pub fn chip(&self, crossing: &Crossing, at: Pos2, hovered: bool) {
        let rect = chip_rect(self.view, crossing, at);
        let color = if crossing.to == Side::Gpu { self.palette().gpu } else { self.palette().cpu };
        let size = INFO * self.view.zoom.max(0.62);
        self.painter.rect_filled(rect, rect.height() / 2.0, self.visuals.window_fill());
        let stroke = Stroke::new(if hovered { 2.2 } else { 1.4 }, color);
        self.painter.rect_stroke(rect, rect.height() / 2.0, stroke, StrokeKind::Middle);
        let text = if self.view.is_near() { chip_text(crossing) } else { arrow(crossing).into() };
        self.text(
            rect.center(),
            Align2::CENTER_CENTER,
            &text,
            (size, self.visuals.strong_text_color()),
            f32::INFINITY,
            1,
            false,
        );
    }

    /// One or more lines of text, cut if they exceed the width.
    fn text(
        &self,
        at: Pos2,
        anchor: Align2,
        text: &str,
        (size, color): (f32, Color32),
        width: f32,
        rows: usize,
        struck: bool,
    ) -> Rect {
        // Few font sizes, so that zooming does not fill the font's texture.
        let font = FontId::proportional((size * 2.0).round() / 2.0);
        let strikethrough = if struck { Stroke::new(1.0, color) } else { Stroke::NONE };
        let format = TextFormat { strikethrough, ..TextFormat::simple(font, color) };
        let mut job = LayoutJob::single_section(text.to_owned(), format);
        job.wrap = TextWrapping {
            max_width: width.max(4.0),
            max_rows: rows,
            break_anywhere: rows == 1,
            ..TextWrapping::default()
        };
        let galley = self.painter.layout_job(job);
        let rect = anchor.anchor_size(at, galley.size());
        self.painter.galley(rect.min, galley, color);
        rect
    }

    /// The legend of tints, colours and dashes, in a row of its own.
    pub fn legend(&self, hottest: Option<f32>, crossings: bool) {
        let pane = self.view.pane;
        let mut x = pane.left() + 8.0;
        let y = pane.center().y + 2.0;
        let ink = self.visuals.text_color();
        let word = |x: &mut f32, text: &str| {
            let drawn =
                self.text(pos2(*x, y), Align2::LEFT_CENTER, text, (11.0, ink), f32::INFINITY, 1, false);
            *x = drawn.right() + 12.0;
        };
        if let Some(hottest) = hottest {
            let bar = Rect::from_min_size(pos2(x, y - 5.0), vec2(54.0, 10.0));
            const STEPS: usize = 18;
            let plain = self.visuals.widgets.inactive.bg_fill;
            for step in 0..STEPS {
                let share = step as f32 / (STEPS - 1) as f32;
                let slice =
                    Rect::from_min_size(bar.min + vec2(3.0 * step as f32, 0.0), vec2(3.2, bar.height()));
                self.painter.rect_filled(slice, 0.0, plain.lerp_to_gamma(HOT, 0.8 * warmth(share)));
            }
            x = bar.right() + 5.0;
            word(&mut x, &format!("0 to {}", milliseconds(hottest)));
        }
        for (example, text) in KINDS {
            self.painter.circle_filled(pos2(x + 4.0, y), 4.0, self.tone(example));
            x += 12.0;
            word(&mut x, text);
        }
        self.line(vec![pos2(x, y), pos2(x + 20.0, y)], Stroke::new(1.8, ink), true);
        x += 25.0;
        word(&mut x, "previous frame");
        if crossings {
            word(&mut x, "⬆ upload  ⬇ download");
        }
    }

    /// The selection box.
    pub fn selection(&self, rect: Rect) {
        let rect = self.view.rect(rect);
        self.painter.rect(
            rect,
            2.0,
            self.palette().accent.gamma_multiply(0.12),
            Stroke::new(1.0, self.palette().accent),
            StrokeKind::Middle,
        );
    }
}

const IMAGE: Color32 = Color32::from_rgb(230, 180, 80);
const NUMBERS: Color32 = Color32::from_rgb(110, 185, 220);
const RECORDS: Color32 = Color32::from_rgb(150, 200, 120);
const BUNDLE: Color32 = Color32::from_rgb(205, 135, 205);
const KINDS: [(Color32, &str); 4] =
    [(IMAGE, "texture"), (NUMBERS, "numbers"), (RECORDS, "records"), (BUNDLE, "bundle")];

/// One colour for each kind of element, so that compatible wires look alike.
pub fn color(pin: &Pin) -> Color32 {
    match pin.fields.as_deref() {
        Some([only]) => match &only.element {
            Element::Texel(_) | Element::AnyFloatTexel => IMAGE,
            Element::Item { members, .. } if members.len() == 1 && members[0].name.is_empty() => NUMBERS,
            Element::Item { .. } => RECORDS,
        },
        Some(_) => BUNDLE,
        None => Color32::GRAY,
    }
}

/// A colour for a light background.
pub fn on_paper(color: Color32) -> Color32 {
    let [r, g, b, _] = color.to_array().map(|channel| (f32::from(channel) * 0.72) as u8);
    Color32::from_rgb(r, g, b)
}

/// The rectangle of a transfer.
pub fn chip_rect(view: View, crossing: &Crossing, at: Pos2) -> Rect {
    let zoom = view.zoom.max(0.62);
    // The approximate width of its text.
    let width = if view.is_near() { 12.0 + 6.4 * chip_text(crossing).chars().count() as f32 } else { 20.0 };
    Rect::from_center_size(view.point(at), vec2(width, 20.0) * zoom)
}

/// The strength of the tint for a share of the highest cost. It is not linear, so that small costs are visible.
fn warmth(share: f32) -> f32 {
    share.clamp(0.0, 1.0).powf(0.7)
}

fn arrow(crossing: &Crossing) -> &'static str {
    if crossing.to == Side::Gpu { "⬆" } else { "⬇" }
}

fn chip_text(crossing: &Crossing) -> String {
    format!("{} {}", arrow(crossing), readable(crossing.bytes))
}

/// Milliseconds as text.
pub fn milliseconds(ms: f32) -> String {
    if ms < 10.0 { format!("{ms:.2} ms") } else { format!("{ms:.1} ms") }
}
