//! The legend of the colours.

use egui::{Align2, Color32, FontId, Painter, Rect, Stroke, pos2, vec2};
use epigraph_pictures::{Curve, Mode, Number, Paint, Scale, edges};
use epigraph_stages::meaning;

use super::{layer::Layer, overlay::rgb};

const BAR: egui::Vec2 = vec2(220.0, 10.0);
const MARGIN: f32 = 10.0;
const FONT: f32 = 11.0;
const TICKS: usize = 5;
/// Number of pixels around the centre of a 5x5 neighbourhood.
const REACHABLE: f32 = 24.0;

/// Draws the legend into the lower left corner of the pane, if the mode has one.
pub fn draw(painter: &Painter, pane: Rect, layer: &Layer) {
    let shown = &layer.shown;
    match (shown.mode, shown.scale, layer.classes) {
        (Mode::Classes, _, Some(shares)) => {
            let entry = |class: usize| {
                let (name, color) = edges::CLASSES[class];
                (format!("{name} {:.1}%", 100.0 * shares[class]), color)
            };
            swatches(painter, pane, &[0, 1, 2].map(entry));
        }
        (Mode::Edges, ..) => {
            let [loose, _, complex] = edges::CLASSES.map(|(_, color)| color);
            let entries = [("one edge", edges::EDGE), ("more", complex), ("end of an edge", loose)];
            swatches(painter, pane, &entries.map(|(text, color)| (text.to_owned(), color)));
        }
        (Mode::Reach, ..) => {
            let scale = Scale { range: [0.0, REACHABLE], curve: Curve::Linear, paint: Paint::Grey };
            bar(painter, pane, &scale, "of 24 pixels reached");
        }
        (mode, Some(scale), _) => {
            bar(painter, pane, &scale, if mode == Mode::Depth { "distance, m" } else { unit(layer) })
        }
        _ => {}
    }
}

fn unit(layer: &Layer) -> &'static str {
    match layer.snapshot.meaning {
        Some(meaning::AGE) => "age; 255 is the oldest",
        Some(meaning::FRAMES_AGO) => "frames ago",
        _ => "",
    }
}

fn swatches(painter: &Painter, pane: Rect, entries: &[(String, [u8; 3])]) {
    let font = FontId::proportional(FONT);
    let texts: Vec<_> = entries
        .iter()
        .map(|(text, _)| painter.layout_no_wrap(text.clone(), font.clone(), Color32::WHITE))
        .collect();
    let width: f32 = texts.iter().map(|text| text.size().x + 30.0).sum();
    let area = Rect::from_min_size(pane.left_bottom() + vec2(MARGIN, -MARGIN - 22.0), vec2(width, 22.0));
    painter.rect_filled(area, 3.0, Color32::from_black_alpha(190));
    let mut left = area.left() + 8.0;
    for ((_, color), text) in entries.iter().zip(texts) {
        let square = Rect::from_center_size(pos2(left + 5.0, area.center().y), vec2(10.0, 10.0));
        painter.rect(
            square,
            1.0,
            rgb(*color),
            Stroke::new(1.0, Color32::from_gray(110)),
            egui::StrokeKind::Outside,
        );
        let next = left + text.size().x + 30.0;
        painter.galley(pos2(left + 16.0, area.center().y - 0.5 * text.size().y), text, Color32::WHITE);
        left = next;
    }
}

/// A bar of the colours from the dark to the bright end, with labels at round values.
fn bar(painter: &Painter, pane: Rect, scale: &Scale, unit: &str) {
    let title =
        if scale.curve == Curve::Log { format!("{unit} log").trim().to_owned() } else { unit.to_owned() };
    let title_height = if title.is_empty() { 0.0 } else { 15.0 };
    let size = vec2(BAR.x.min(pane.width() - 4.0 * MARGIN) + 28.0, 38.0 + title_height);
    let area = Rect::from_min_size(pane.left_bottom() + vec2(MARGIN, -MARGIN - size.y), size);
    painter.rect_filled(area, 3.0, Color32::from_black_alpha(190));
    let corner = area.min + vec2(14.0, 6.0);
    let font = FontId::proportional(FONT);
    painter.text(corner - vec2(0.0, 2.0), Align2::LEFT_TOP, title, font.clone(), Color32::from_gray(190));
    let bar = Rect::from_min_size(corner + vec2(0.0, title_height), vec2(area.width() - 28.0, BAR.y));
    gradient(painter, bar, scale);
    let mut free = f32::NEG_INFINITY;
    let mut labels = scale.ticks(TICKS);
    labels.sort_by(|a, b| scale.share(*a).total_cmp(&scale.share(*b)));
    for value in labels {
        let x = bar.left() + scale.share(value) * bar.width();
        painter.vline(x, bar.bottom()..=bar.bottom() + 3.0, Stroke::new(1.0, Color32::from_gray(200)));
        let text =
            painter.layout_no_wrap(Number::Float(value).short(), font.clone(), Color32::from_gray(225));
        let left = x - 0.5 * text.size().x;
        // Ticks that are close together share one label.
        if left > free + 4.0 {
            free = left + text.size().x;
            painter.galley(pos2(left, bar.bottom() + 3.0), text, Color32::WHITE);
        }
    }
}

/// A bar of the colours from left to right.
pub fn gradient(painter: &Painter, bar: Rect, scale: &Scale) {
    const STEPS: usize = 64;
    for step in 0..STEPS {
        let color = rgb(scale.color_at(step as f32 / (STEPS - 1) as f32));
        let left = bar.left() + bar.width() * step as f32 / STEPS as f32;
        let slice =
            Rect::from_min_size(pos2(left, bar.top()), vec2(bar.width() / STEPS as f32 + 0.5, bar.height()));
        painter.rect_filled(slice, 0.0, color);
    }
}
