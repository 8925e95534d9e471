//! Overlays on enlarged pixels: values, edges, and maps of reachable pixels.

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, pos2, vec2};
use epigraph_pictures::{Mode, edges, in_pixel};

use super::{layer::Layer, place::Placed};
use crate::theme;

/// Zoom, in points per pixel, from which values are written into pixels.
const LEGIBLE: f32 = 44.0;
/// Zoom from which edges are drawn into pixels.
const STROKES: f32 = 6.0;
/// Zoom from which maps of the reachable pixels are drawn into pixels.
const MAPS: f32 = 14.0;

/// Brightness of the image behind edges.
const FAINT: u8 = 70;
const GRID: Color32 = Color32::from_rgb(44, 49, 72);

/// An sRGB colour.
pub fn rgb([r, g, b]: [u8; 3]) -> Color32 {
    Color32::from_rgb(r, g, b)
}

/// Factor on the image's own colours, so that the overlay stands out.
pub fn tint(layer: &Layer, placed: &Placed) -> Color32 {
    match layer.shown.mode {
        Mode::Edges if placed.zoom() >= STROKES => Color32::from_gray(FAINT),
        _ => Color32::WHITE,
    }
}

/// Draws into the visible pixels.
pub fn draw(painter: &Painter, placed: &Placed, layer: &Layer) {
    let zoom = placed.zoom();
    match layer.shown.mode {
        Mode::Edges if zoom >= STROKES => crossings(painter, placed, layer),
        Mode::Classes if zoom >= STROKES => chords(painter, placed, layer),
        Mode::Reach if zoom >= MAPS => maps(painter, placed, layer),
        Mode::Edges | Mode::Classes | Mode::Reach => {}
        _ if zoom >= LEGIBLE => values(painter, placed, layer),
        _ => {}
    }
}

fn values(painter: &Painter, placed: &Placed, layer: &Layer) {
    let size = (placed.zoom() / 4.5).clamp(9.0, 14.0);
    for pixel in placed.pixels() {
        let text = in_pixel(&layer.snapshot, &layer.look, pixel).join("\n");
        let color = layer.shown.colors.get(pixel[1] * placed.size[0] + pixel[0]).copied().unwrap_or_default();
        let middle = placed.square(pixel).center();
        painter.text(middle, Align2::CENTER_CENTER, text, FontId::proportional(size), legible_on(color));
    }
}

/// Black or white, whichever has more contrast on a colour.
fn legible_on([r, g, b]: [u8; 3]) -> Color32 {
    let light = 2 * u32::from(r) + 5 * u32::from(g) + u32::from(b) > 8 * 140;
    if light { Color32::BLACK } else { Color32::WHITE }
}

fn crossings(painter: &Painter, placed: &Placed, layer: &Layer) {
    let pixels = placed.size.map(|side| side.saturating_sub(1));
    grid(painter, placed);
    for pixel in placed.pixels() {
        let ring = edges::perimeter(&layer.words, pixels, pixel).unwrap_or(0);
        let color = if ring.count_ones() > 2 { edges::CLASSES[2].1 } else { edges::EDGE };
        strokes(painter, placed, pixel, ring, rgb(color));
    }
}

fn chords(painter: &Painter, placed: &Placed, layer: &Layer) {
    for pixel in placed.pixels() {
        let word = layer.words.get(pixel[1] * placed.size[0] + pixel[0]).copied().unwrap_or(0);
        strokes(painter, placed, pixel, edges::chord(word), Color32::from_gray(20));
    }
}

fn strokes(painter: &Painter, placed: &Placed, pixel: [usize; 2], ring: u32, color: Color32) {
    let point = |place: [f32; 2]| placed.point([pixel[0] as f32 + place[0], pixel[1] as f32 + place[1]]);
    let stroke = Stroke::new((placed.zoom() / 10.0).clamp(1.0, 3.0), color);
    for edge in edges::strokes(ring) {
        painter.line_segment([point(edge.from), point(edge.to)], stroke);
    }
}

/// The grid between pixels.
fn grid(painter: &Painter, placed: &Placed) {
    let visible = placed.visible();
    let [from, to] = [placed.pixel(visible.min), placed.pixel(visible.max)];
    let stroke = Stroke::new(1.0, GRID);
    for x in from[0]..=to[0] {
        painter.vline(placed.point([x as f32, 0.0]).x, visible.y_range(), stroke);
    }
    for y in from[1]..=to[1] {
        painter.hline(visible.x_range(), placed.point([0.0, y as f32]).y, stroke);
    }
}

/// A small map in each pixel of the 5x5 pixels around it.
fn maps(painter: &Painter, placed: &Placed, layer: &Layer) {
    for pixel in placed.pixels() {
        let word = layer.words.get(pixel[1] * placed.size[0] + pixel[0]).copied().unwrap_or(0);
        let square = placed.square(pixel);
        painter.rect_filled(square, 0.0, Color32::from_gray(12));
        map(painter, square.shrink(0.06 * square.width()), word);
    }
}

/// The 5x5 pixels around one: the centre, the reached pixels, and the others.
pub fn map(painter: &Painter, within: Rect, r24: u32) {
    // Whole points: with fractions, many maps would alias into stripes.
    let side = (within.width() / 5.0).floor().max(1.0);
    let first = (within.center() - vec2(2.5, 2.5) * side).round();
    let gap = if side < 5.0 { 0.0 } else { 1.0 };
    for (index, color) in edges::reach_glyph(r24).into_iter().enumerate() {
        let corner = first + vec2((index % 5) as f32, (index / 5) as f32) * side;
        painter.rect_filled(Rect::from_min_size(corner, vec2(side - gap, side - gap)), 0.0, rgb(color));
    }
}

/// Marks the pixels that the pixel under the pointer reaches: in the image, or if pixels are small, on a map in a
/// corner of the pane.
pub fn reach_of(painter: &Painter, placed: &Placed, layer: &Layer, [x, y]: [usize; 2]) {
    let Some(word) = layer.words.get(y * placed.size[0] + x).filter(|_| layer.shown.mode == Mode::Reach)
    else {
        return;
    };
    if placed.zoom() < STROKES {
        const SIDE: f32 = 90.0;
        let corner = placed.pane.right_bottom() - vec2(SIDE + 10.0, SIDE + 10.0);
        let within = Rect::from_min_size(corner, vec2(SIDE, SIDE));
        painter.rect_filled(within.expand(4.0), 3.0, Color32::from_black_alpha(200));
        return map(painter, within, *word);
    }
    for (index, color) in edges::reach_glyph(*word).into_iter().enumerate() {
        let corner = [x as f32 + (index % 5) as f32 - 2.0, y as f32 + (index / 5) as f32 - 2.0];
        let min: Pos2 = placed.point(corner);
        let max = min + vec2(placed.zoom(), placed.zoom());
        let square = Rect::from_min_max(min, pos2(max.x, max.y)).shrink(1.0);
        let color = match color {
            edges::BARRED => rgb(edges::CLASSES[2].1),
            edges::SELF => theme::ACCENT,
            color => rgb(color),
        };
        let stroke = Stroke::new(2.0, color);
        painter.rect_stroke(square, 0.0, stroke, egui::StrokeKind::Inside);
    }
}
