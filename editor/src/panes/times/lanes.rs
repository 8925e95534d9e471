//! One frame as lanes: the steps over time on the CPU, on the GPU, and the transfers between them.

use egui::{Align2, Color32, FontId, Painter, Rect, Sense, Stroke, Ui, WidgetInfo, WidgetType, pos2, vec2};
use epigraph_core::Side;

use super::{bytes, summary};
use crate::{
    engine::{Record, StepInfo},
    session::Session,
    theme,
};

/// Height of a lane and of the scale, points.
const LANE: f32 = 40.0;
const SCALE: f32 = 16.0;
/// Room for the lanes' names.
const NAMES: f32 = 62.0;
/// The colour of transfers.
const TRANSFER: Color32 = Color32::from_rgb(222, 170, 80);

/// The lanes from the top.
const LANES: [&str; 3] = ["CPU", "transfers", "GPU"];

/// Shows it.
pub fn show(ui: &mut Ui, session: &mut Session, record: &Record) {
    let mut steps = summary::steps(record);
    steps.retain(|(_, cost)| cost.ms > 0.0 || cost.moved > 0);
    let used: Vec<usize> =
        (0..LANES.len()).filter(|lane| steps.iter().any(|(step, _)| lane_of(step) == *lane)).collect();
    let end = steps.iter().map(|(_, cost)| cost.end()).fold(record.ms, f32::max).max(0.01);
    ui.horizontal(|ui| {
        ui.weak(format!("Frame {}: {:.2} ms", record.frame, record.ms));
        let moved: u64 = record.steps.iter().map(|cost| cost.moved).sum();
        if moved > 0 {
            ui.weak(format!("{} transferred", bytes(moved)));
        }
    });
    let size = vec2(ui.available_width(), used.len() as f32 * LANE + SCALE);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, "lanes of the last frame"));
    let painter = ui.painter_at(rect);
    let (left, width) = (rect.left() + NAMES, (rect.width() - NAMES - 4.0).max(1.0));
    let x = |ms: f32| left + width * ms / end;
    scale(ui, &painter, rect, end, x);

    let mut hovered = None;
    for (row, lane) in used.iter().enumerate() {
        let top = rect.top() + row as f32 * LANE;
        let middle = pos2(rect.left() + 2.0, top + 0.5 * LANE);
        let font = FontId::proportional(12.0);
        painter.text(middle, Align2::LEFT_CENTER, LANES[*lane], font, ui.visuals().text_color());
        painter.hline(rect.x_range(), top + LANE - 1.0, Stroke::new(1.0, ui.visuals().faint_bg_color));
        for (step, cost) in steps.iter().filter(|(step, _)| lane_of(step) == *lane) {
            let bar = Rect::from_x_y_ranges(
                x(cost.start)..=x(cost.end()).max(x(cost.start) + 1.5),
                top + 5.0..=top + LANE - 6.0,
            );
            let is_hovered = response.hover_pos().is_some_and(|at| bar.expand(1.0).contains(at));
            let is_selected = step.node.is_some() && session.selected == step.node;
            draw(&painter, bar, step, is_hovered, is_selected);
            if is_hovered {
                hovered = Some((*step, *cost));
            }
        }
    }
    if let Some((step, cost)) = hovered {
        if response.clicked() && step.node.is_some() {
            session.selected.clone_from(&step.node);
        }
        let moved =
            if cost.moved > 0 { format!("\n{} transferred", bytes(cost.moved)) } else { String::new() };
        response.on_hover_text(format!(
            "{}\n{:.3} ms, starts at {:.3} ms{moved}",
            step.name, cost.ms, cost.start
        ));
    }
    ui.weak(
        "Click a bar to select its node. If the GPU measures its own times, its lane shows the previous frame.",
    );
}

fn lane_of(step: &StepInfo) -> usize {
    match (&step.node, step.side) {
        (None, _) => 1,
        (Some(_), Side::Cpu) => 0,
        (Some(_), Side::Gpu) => 2,
    }
}

fn draw(painter: &Painter, bar: Rect, step: &StepInfo, is_hovered: bool, is_selected: bool) {
    let color = [theme::CPU, TRANSFER, theme::GPU][lane_of(step)];
    painter.rect_filled(bar, 1.0, color.gamma_multiply(if is_hovered { 1.0 } else { 0.65 }));
    if is_selected {
        painter.rect_stroke(bar, 1.0, Stroke::new(1.5, theme::ACCENT), egui::StrokeKind::Outside);
    }
    // A bar's name is written into it if it fits.
    let name = step.name.rsplit('/').next().unwrap_or(&step.name);
    let galley = painter.layout_no_wrap(name.to_owned(), FontId::proportional(11.0), Color32::BLACK);
    if galley.size().x + 4.0 < bar.width() {
        painter.galley(bar.center() - 0.5 * galley.size(), galley, Color32::BLACK);
    }
}

/// Marks at round numbers of milliseconds.
fn scale(ui: &Ui, painter: &Painter, rect: Rect, end: f32, x: impl Fn(f32) -> f32) {
    let step = round_step(end / 4.0);
    let color = ui.visuals().weak_text_color();
    let mut at = 0.0;
    while at <= end {
        let line = Stroke::new(1.0, ui.visuals().faint_bg_color);
        painter.vline(x(at), rect.top()..=rect.bottom() - SCALE, line);
        let text = if at == 0.0 { "0 ms".to_owned() } else { format!("{at}") };
        painter.text(
            pos2(x(at), rect.bottom()),
            Align2::LEFT_BOTTOM,
            text,
            FontId::proportional(10.0),
            color,
        );
        at += step;
    }
}

/// The smallest step of 1, 2 or 5 times a power of ten that is at least this value.
fn round_step(least: f32) -> f32 {
    let power = 10f32.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * power)
        .into_iter()
        .find(|step| *step >= least)
        .unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_at_round_numbers() {
        let close = |a: f32, b: f32| (a - b).abs() < 1e-6 * b;
        assert!(close(round_step(0.7), 1.0) && close(round_step(3.0), 5.0) && close(round_step(0.011), 0.02));
    }
}
