//! The histogram of the image, with draggable ends of the range.

use egui::{
    Align2, Color32, CursorIcon, FontId, Rect, Sense, Stroke, Ui, WidgetInfo, WidgetType, pos2, vec2,
};
use epigraph_pictures::{Histogram, Look, Number};

use super::layer::Layer;
use crate::theme;

const HEIGHT: f32 = 66.0;
const LABELS: f32 = 14.0;
const TICKS: usize = 6;
/// Least distance between the ends, as a share of the axis.
const NARROWEST: f32 = 0.005;

const CHANNELS: [Color32; 3] =
    [Color32::from_rgb(235, 90, 90), Color32::from_rgb(95, 205, 110), Color32::from_rgb(90, 140, 250)];

/// The histogram of an image.
#[derive(Default)]
pub struct HistogramView {
    /// The axis, frozen while an end is dragged.
    dragged: Option<Histogram>,
}

impl HistogramView {
    /// Shows a layer's histogram once it is counted. A drag sets the look's range.
    pub fn show(&mut self, ui: &mut Ui, layer: &Layer, counted: Option<&Option<Histogram>>, look: &mut Look) {
        let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, "histogram"));
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
        let Some(counted) = counted else { return };
        let Some(histogram) = self.dragged.clone().or_else(|| counted.clone()) else {
            let text = "No histogram: these values are not quantities.";
            let color = ui.visuals().weak_text_color();
            painter.text(rect.center(), Align2::CENTER_CENTER, text, FontId::proportional(12.0), color);
            return;
        };
        let plot = Rect::from_min_max(rect.min + vec2(8.0, 4.0), rect.max - vec2(8.0, LABELS));
        bars(&painter, plot, &histogram);
        ticks(ui, &painter, plot, &histogram);
        if let Some(scale) = layer.shown.scale {
            let dragged = self.ends(ui, plot, &histogram, scale.range, look);
            if dragged && self.dragged.is_none() {
                self.dragged = Some(histogram.clone());
            } else if !dragged {
                self.dragged = None;
            }
        }
        if let Some(pointer) = response.hover_pos().filter(|pointer| plot.contains(*pointer)) {
            let share = (pointer.x - plot.left()) / plot.width();
            let bins = histogram.counts.first().map_or(1, Vec::len);
            let bin = ((share * bins as f32) as usize).min(bins - 1);
            let counts: Vec<String> = histogram.counts.iter().map(|counts| counts[bin].to_string()).collect();
            let value = Number::Float(histogram.axis.value(share)).short();
            response.on_hover_text_at_pointer(format!("about {value}: {} pixels", counts.join(", ")));
        }
    }

    /// Draws the ends of the range as draggable lines. Returns true while one is dragged.
    fn ends(&self, ui: &Ui, plot: Rect, histogram: &Histogram, range: [f32; 2], look: &mut Look) -> bool {
        let axis = &histogram.axis;
        let shares = range.map(|end| axis.share(end));
        let mut any = false;
        for (end, name) in ["dark end", "bright end"].into_iter().enumerate() {
            let x = plot.left() + shares[end] * plot.width();
            let line = Rect::from_center_size(pos2(x, plot.center().y), vec2(11.0, plot.height() + 6.0));
            let response = ui.interact(line, ui.id().with(name), Sense::drag());
            response.widget_info(|| WidgetInfo::labeled(WidgetType::Slider, true, name));
            let response = response.on_hover_cursor(CursorIcon::ResizeHorizontal);
            if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.dragged()) {
                any = true;
                let share = ((pointer.x - plot.left()) / plot.width()).clamp(0.0, 1.0);
                let share = match end {
                    0 => share.min(shares[1] - NARROWEST),
                    _ => share.max(shares[0] + NARROWEST),
                };
                let mut range = range;
                range[end] = axis.value(share);
                look.range = Some(range);
            }
            let lit = response.hovered() || response.dragged();
            let color = if lit { theme::palette(ui).accent } else { ui.visuals().text_color() };
            let painter = ui.painter();
            painter.vline(x, plot.y_range(), Stroke::new(if lit { 2.0 } else { 1.0 }, color));
            let grip = Rect::from_center_size(pos2(x, plot.top() + 3.0), vec2(7.0, 7.0));
            painter.rect_filled(grip, 2.0, color);
        }
        any
    }
}

/// Draws the bars, with logarithmic heights so that rare values are visible too.
fn bars(painter: &egui::Painter, plot: Rect, histogram: &Histogram) {
    let most = histogram.counts.iter().flatten().copied().max().unwrap_or(0).max(1);
    let height = |count: u32| plot.height() * (count as f32).ln_1p() / (most as f32).ln_1p();
    let single = histogram.counts.len() == 1;
    for (row, counts) in histogram.counts.iter().enumerate() {
        let width = plot.width() / counts.len() as f32;
        for (bin, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
            let left = plot.left() + bin as f32 * width;
            let bar = Rect::from_min_max(
                pos2(left, plot.bottom() - height(*count)),
                pos2(left + width, plot.bottom()),
            );
            let color = if single { Color32::from_gray(150) } else { CHANNELS[row % 3].gamma_multiply(0.5) };
            painter.rect_filled(bar, 0.0, color);
        }
    }
}

fn ticks(ui: &Ui, painter: &egui::Painter, plot: Rect, histogram: &Histogram) {
    let color = ui.visuals().weak_text_color();
    let mut labels: Vec<(f32, f32)> = histogram
        .axis
        .ticks(TICKS)
        .into_iter()
        .map(|value| (plot.left() + histogram.axis.share(value) * plot.width(), value))
        .collect();
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut free = f32::NEG_INFINITY;
    for (x, value) in labels {
        let text = painter.layout_no_wrap(Number::Float(value).short(), FontId::proportional(10.0), color);
        let left = (x - 0.5 * text.size().x).clamp(plot.left(), plot.right() - text.size().x);
        if left > free + 6.0 {
            free = left + text.size().x;
            painter.vline(x, plot.bottom()..=plot.bottom() + 2.0, Stroke::new(1.0, color));
            painter.galley(pos2(left, plot.bottom() + 1.0), text, color);
        }
    }
}
