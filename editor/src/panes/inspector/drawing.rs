//! The small drawings of the inspector: a pixel enlarged, and the pixels around one.

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Sense, Stroke, StrokeKind, Ui, pos2, vec2};
use epigraph_core::{Around, Finding, Mark, Role};
use epigraph_pictures::{
    edges::{EDGE, REACHED},
    tone,
};

use crate::theme;

/// Width and height of a drawing, points.
pub const SIDE: f32 = 96.0;

/// A cell that counts, in the colour of the viewer's maps.
const COUNTS: Color32 = Color32::from_rgb(REACHED[0], REACHED[1], REACHED[2]);
/// An edge, in the viewer's colour for edges.
const LINE: Color32 = Color32::from_rgb(EDGE[0], EDGE[1], EDGE[2]);
/// A cell that counts against the pixel.
const AGAINST: Color32 = Color32::from_rgb(186, 74, 70);
/// A crossed eighth of a pixel's side.
const CROSSED: Color32 = Color32::from_rgb(240, 170, 60);

/// The display colour of linear radiance.
pub fn screen(linear: [f32; 3]) -> Color32 {
    let [r, g, b] = tone::to_srgb8(linear);
    Color32::from_rgb(r, g, b)
}

/// Draws a finding, if it has a drawing.
pub fn show(ui: &mut Ui, finding: &Finding) {
    match finding {
        Finding::Around(around) => show_around(ui, around),
        Finding::Sketch(marks) => show_sketch(ui, marks),
        _ => {}
    }
}

fn show_around(ui: &mut Ui, Around { name, cells }: &Around) {
    let count = cells.len().isqrt().max(1);
    let (rect, response) = ui.allocate_exact_size(vec2(SIDE, SIDE), Sense::hover());
    let side = SIDE / count as f32;
    let painter = ui.painter_at(rect);
    for (index, cell) in cells.iter().enumerate() {
        let corner = rect.min + vec2((index % count) as f32, (index / count) as f32) * side;
        let square = Rect::from_min_size(corner, vec2(side, side)).shrink(0.75);
        let fill = match (cell.role, cell.linear) {
            (_, Some(linear)) => screen(linear),
            (Role::Counts, _) => COUNTS,
            (Role::Against, _) => AGAINST,
            (Role::Apart, _) => ui.visuals().faint_bg_color,
            (Role::None, _) => ui.visuals().extreme_bg_color,
        };
        painter.rect_filled(square, 1.0, fill);
        if cell.role == Role::Apart {
            cross(&painter, square, contrast(fill).gamma_multiply(0.5));
        }
        if 2 * index + 1 == cells.len() {
            painter.rect_stroke(square, 1.0, Stroke::new(1.5, theme::ACCENT), StrokeKind::Inside);
        }
        // Short texts fit into their cells; the others are shown on hover.
        if cell.text.len() <= 3 && side >= 16.0 {
            let font = FontId::proportional(8.5);
            painter.text(square.center(), Align2::CENTER_CENTER, &cell.text, font, contrast(fill));
        }
    }
    let hovered = response.hover_pos().and_then(|at| {
        let [x, y] =
            [at.x - rect.left(), at.y - rect.top()].map(|along| ((along / side) as usize).min(count - 1));
        cells.get(y * count + x).map(|cell| (x, y, cell))
    });
    let text = match hovered {
        Some((x, y, cell)) if !cell.text.is_empty() => {
            let middle = (count / 2) as i32;
            format!("{name}\n({:+}, {:+}): {}", x as i32 - middle, y as i32 - middle, cell.text)
        }
        _ => name.to_string(),
    };
    response.on_hover_text(text);
}

fn cross(painter: &Painter, square: Rect, color: Color32) {
    let inner = square.shrink(square.width() * 0.3);
    painter.line_segment([inner.left_top(), inner.right_bottom()], Stroke::new(1.0, color));
    painter.line_segment([inner.right_top(), inner.left_bottom()], Stroke::new(1.0, color));
}

fn show_sketch(ui: &mut Ui, marks: &[Mark]) {
    let (rect, response) = ui.allocate_exact_size(vec2(SIDE, SIDE), Sense::hover());
    let painter = ui.painter_at(rect);
    let pixel = rect.shrink(5.0);
    painter.rect(
        pixel,
        0.0,
        ui.visuals().extreme_bg_color,
        Stroke::new(1.0, ui.visuals().weak_text_color()),
        StrokeKind::Inside,
    );
    let at = |[x, y]: [f32; 2]| -> Pos2 {
        pos2(pixel.left() + x * pixel.width(), pixel.top() + y * pixel.height())
    };
    for mark in marks {
        match *mark {
            Mark::Crossing(ends) => {
                painter.line_segment(ends.map(at), Stroke::new(4.0, CROSSED));
            }
            Mark::Edge(ends) => {
                painter.line_segment(ends.map(at), Stroke::new(2.0, LINE));
            }
            Mark::Sample(corners) => {
                let [low, high] = corners.map(at);
                painter.rect_filled(Rect::from_min_max(low, high), 0.0, ui.visuals().strong_text_color());
            }
            Mark::Aim(place) => {
                painter.circle_stroke(at(place), 3.5, Stroke::new(1.5, COUNTS));
            }
        }
    }
    response.on_hover_text(
        "The pixel, enlarged. Orange: edges cross its sides there, in eighths; blue line: its edge; square: the cell of its \
         sample; green ring: the position of the next sample",
    );
}

/// Black or white, whichever is readable on a colour.
fn contrast(on: Color32) -> Color32 {
    let light = 2 * u32::from(on.r()) + 5 * u32::from(on.g()) + u32::from(on.b()) > 8 * 140;
    if light { Color32::BLACK } else { Color32::WHITE }
}
