//! What each step of a frame costs.

use std::collections::VecDeque;

use egui::{Align2, FontId, Rect, ScrollArea, Sense, Ui, pos2, vec2};
use egui_plot::{Line, Plot, PlotPoints};
use epigraph_core::Side;

use crate::{session::Session, theme};

/// Frames that the plot shows.
const FRAMES: usize = 240;

/// New times count this much in the bars, so that they can be read.
const WEIGHT: f32 = 0.1;

/// The times of the last frames.
#[derive(Default)]
pub struct TimesPane {
    frames: VecDeque<f32>,
    last: u32,
    /// Names of steps with their smoothed times.
    smooth: Vec<(String, f32)>,
}

impl TimesPane {
    /// Shows them.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        self.take(session);
        let Some(graph) = session.state.graph.clone() else {
            ui.weak("No graph runs yet.");
            return;
        };
        ui.weak(format!("Milliseconds of the last {FRAMES} frames"));
        let points: PlotPoints =
            self.frames.iter().enumerate().map(|(index, ms)| [index as f64, f64::from(*ms)]).collect();
        Plot::new("frames")
            .height(72.0)
            .show_x(false)
            .show_axes([false, true])
            .allow_drag(false)
            .allow_zoom(false)
            .allow_scroll(false)
            .include_y(0.0)
            .include_x(0.0)
            .include_x(FRAMES as f64)
            .show(ui, |plot| plot.line(Line::new("frame, ms", points).color(theme::ACCENT)));
        ui.add_space(4.0);
        let largest = self.smooth.iter().map(|(_, ms)| *ms).fold(0.01, f32::max);
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 1.0;
            let mut order: Vec<usize> = (0..self.smooth.len()).collect();
            order.sort_by(|a, b| self.smooth[*b].1.total_cmp(&self.smooth[*a].1));
            for index in order {
                let (name, ms) = &self.smooth[index];
                let step = graph.steps.get(index);
                let side = step.map_or(Side::Cpu, |step| step.side);
                if bar(ui, name, *ms, *ms / largest, side)
                    && let Some(node) = step.and_then(|step| step.node.clone())
                {
                    session.selected = Some(node);
                }
            }
        });
    }

    fn take(&mut self, session: &Session) {
        let state = &session.state;
        let Some(graph) = &state.graph else { return };
        let same = self.smooth.iter().map(|(name, _)| name).eq(graph.steps.iter().map(|step| &step.name));
        if !same {
            self.smooth = graph.steps.iter().map(|step| (step.name.clone(), 0.0)).collect();
        }
        if state.frames == self.last {
            return;
        }
        self.last = state.frames;
        self.frames.push_back(state.frame_ms);
        while self.frames.len() > FRAMES {
            self.frames.pop_front();
        }
        for ((_, smooth), ms) in self.smooth.iter_mut().zip(&state.times) {
            *smooth += if *smooth == 0.0 { *ms } else { WEIGHT * (ms - *smooth) };
        }
    }
}

/// A bar with a name and a figure; whether it was clicked.
fn bar(ui: &mut Ui, name: &str, ms: f32, share: f32, side: Side) -> bool {
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), 18.0), Sense::click());
    let color = if side == Side::Cpu { theme::CPU } else { theme::GPU };
    let width = (rect.width() * share.clamp(0.0, 1.0)).max(1.0);
    ui.painter().rect_filled(
        Rect::from_min_size(rect.min, vec2(width, rect.height())),
        2.0,
        color.gamma_multiply(0.35),
    );
    let font = FontId::proportional(12.0);
    let text = if response.hovered() { ui.visuals().strong_text_color() } else { ui.visuals().text_color() };
    let (left, right) = (pos2(rect.left() + 4.0, rect.center().y), pos2(rect.right() - 4.0, rect.center().y));
    ui.painter().text(left, Align2::LEFT_CENTER, name, font.clone(), text);
    ui.painter().text(right, Align2::RIGHT_CENTER, format!("{ms:.2}"), font, text);
    response
        .widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, format!("time of {name}")));
    response.clicked()
}
