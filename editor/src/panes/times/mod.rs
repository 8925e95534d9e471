//! The cost of a frame: each step, over the last frames and within one; transfers between the sides; the cloud.

mod cloud;
mod lanes;
mod plot;
mod steps;
mod summary;

use egui::Ui;
use summary::{StepSummary, median, summarize};

use crate::session::Session;

/// The pages of the pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Part {
    #[default]
    Steps,
    Plot,
    Frame,
    Cloud,
}

const PARTS: [(Part, &str, &str); 4] = [
    (
        Part::Steps,
        "Steps",
        "Times of each step, median and last frame, and bytes transferred between CPU and GPU",
    ),
    (Part::Plot, "Plot", "Times of the steps over the last frames"),
    (Part::Frame, "Frame", "Timeline of the last frame's steps on each side"),
    (Part::Cloud, "Cloud", "Occupancy of the cloud, ages of its points, number of new samples"),
];

/// The pane's own state.
#[derive(Default)]
pub struct TimesPane {
    part: Part,
    plot: plot::Choice,
    /// The frame of [`Self::steps`].
    last: Option<u32>,
    steps: Vec<StepSummary>,
}

impl TimesPane {
    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        let records = session.state.records.clone();
        let Some(record) = records.last() else {
            ui.weak(if session.state.paused {
                "Step or run to see the times of frames."
            } else {
                "No frame has run yet."
            });
            return;
        };
        if self.last != Some(record.frame) {
            self.last = Some(record.frame);
            self.steps = summarize(&records);
        }
        ui.horizontal(|ui| {
            for (part, label, doc) in PARTS {
                ui.selectable_value(&mut self.part, part, label).on_hover_text(doc);
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let frames: Vec<f32> = records.iter().map(|record| record.ms).collect();
                let text = format!("{:.1} ms", median(&frames));
                ui.strong(text).on_hover_text(format!(
                    "Median of the last {} frames; the last one took {:.1} ms",
                    frames.len(),
                    record.ms
                ));
            });
        });
        ui.add_space(2.0);
        match self.part {
            Part::Steps => steps::show(ui, session, &self.steps),
            Part::Plot => self.plot.show(ui, &self.steps, &records),
            Part::Frame => lanes::show(ui, session, record),
            Part::Cloud => cloud::show(ui, session, &records),
        }
    }
}

/// A number of bytes as text.
fn bytes(count: u64) -> String {
    match count {
        0..1024 => format!("{count} B"),
        1024..1_048_576 => format!("{:.0} KiB", count as f64 / 1024.0),
        _ => format!("{:.1} MiB", count as f64 / 1_048_576.0),
    }
}
