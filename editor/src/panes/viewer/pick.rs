//! Picking a pixel to inspect.

use egui::{Painter, Rect, Response, Stroke, StrokeKind, Ui, vec2};

use super::Placed;
use crate::{intent::Intent, session::Session, theme};

/// Picks the clicked pixel of the frame, whose width and height are `frame`, and marks the picked one.
pub fn pick(ui: &Ui, session: &mut Session, response: &Response, placed: &Placed, frame: [u32; 2]) {
    let (size, frame) = (placed.size, frame.map(|side| side.max(1) as usize));
    if response.clicked()
        && let Some(at) = response.interact_pointer_pos().filter(|at| placed.image.contains(*at))
    {
        // Ports may be coarser than the frame.
        let at = placed.pixel(at);
        let scaled = |axis: usize| (at[axis] * frame[axis] / size[axis].max(1)).min(frame[axis] - 1);
        session.push(Intent::Inspect([scaled(0) as u32, scaled(1) as u32]));
    }
    if let Some(picked) = session.inspection.pixel() {
        let scale = vec2(placed.image.width() / frame[0] as f32, placed.image.height() / frame[1] as f32);
        let corner = placed.image.min + vec2(picked[0] as f32, picked[1] as f32) * scale;
        mark(&ui.painter_at(placed.pane), Rect::from_min_size(corner, scale));
    }
}

/// Marks a pixel with a frame around it, large enough to be found, visible on light and dark.
fn mark(painter: &Painter, pixel: Rect) {
    let around = pixel.expand((6.0 - 0.5 * pixel.width()).max(1.0));
    for (width, color) in [(3.0, egui::Color32::from_black_alpha(170)), (1.5, theme::ACCENT)] {
        painter.rect_stroke(around, 1.0, Stroke::new(width, color), StrokeKind::Middle);
    }
}
