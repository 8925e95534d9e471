//! The cost of each step, as bars, the most expensive first.

use egui::{Align2, FontId, Rect, ScrollArea, Sense, Ui, WidgetInfo, WidgetType, pos2, vec2};
use epigraph_core::Side;

use super::{StepSummary, bytes};
use crate::{session::Session, theme};

/// Widths of the columns with figures, points.
const FIGURE: f32 = 46.0;

/// Shows them.
pub fn show(ui: &mut Ui, session: &mut Session, steps: &[StepSummary]) {
    let moved: u64 = steps.iter().map(|step| step.last.moved).sum();
    ui.horizontal(|ui| {
        ui.weak("ms");
        if moved > 0 {
            ui.weak(format!("{} between CPU and GPU", bytes(moved)));
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.spacing_mut().item_spacing.x = 14.0;
            ui.weak("last");
            ui.weak("median");
        });
    });
    let largest = steps.iter().map(|step| step.median).fold(0.01, f32::max);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 1.0;
        let mut order: Vec<&StepSummary> = steps.iter().collect();
        order.sort_by(|a, b| b.median.total_cmp(&a.median));
        for step in order {
            if bar(ui, step, step.median / largest) && step.node.is_some() {
                session.selected.clone_from(&step.node);
            }
        }
    });
}

/// Draws a bar with name and figures. Returns true if it was clicked.
fn bar(ui: &mut Ui, step: &StepSummary, share: f32) -> bool {
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), 18.0), Sense::click());
    let color = if step.side == Side::Cpu { theme::palette(ui).cpu } else { theme::palette(ui).gpu };
    let width = (rect.width() * share.clamp(0.0, 1.0)).max(1.0);
    let filled = Rect::from_min_size(rect.min, vec2(width, rect.height()));
    ui.painter().rect_filled(filled, 2.0, color.gamma_multiply(0.35));
    let font = FontId::proportional(12.0);
    let (plain, weak) = (ui.visuals().text_color(), ui.visuals().weak_text_color());
    let text = if response.hovered() { ui.visuals().strong_text_color() } else { plain };
    let at = |x: f32| pos2(x, rect.center().y);
    let right = rect.right() - 4.0;
    ui.painter().text(at(right), Align2::RIGHT_CENTER, format!("{:.2}", step.last.ms), font.clone(), weak);
    let median = format!("{:.2}", step.median);
    ui.painter().text(at(right - FIGURE), Align2::RIGHT_CENTER, median, font.clone(), text);
    let moved = if step.last.moved > 0 { bytes(step.last.moved) } else { String::new() };
    let moved = ui.painter().text(at(right - 2.0 * FIGURE), Align2::RIGHT_CENTER, moved, font.clone(), weak);
    let room = Rect::from_min_max(rect.min, pos2(moved.left() - 4.0, rect.bottom()));
    ui.painter().with_clip_rect(room.intersect(ui.clip_rect())).text(
        at(rect.left() + 4.0),
        Align2::LEFT_CENTER,
        &step.name,
        font,
        text,
    );
    let name = &step.name;
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, format!("time of {name}")));
    response.on_hover_text(name).clicked()
}
