//! The costs of steps over the last frames, as lines or stacked.

use std::{collections::BTreeSet, sync::Arc};

use egui::{Color32, ScrollArea, Ui};
use egui_plot::{FilledArea, Line, Plot, PlotPoints};

use super::StepSummary;
use crate::engine::{RECORDED, Record};

/// Number of steps that are plotted by default: the most expensive ones.
const FIRST: usize = 6;

/// Colours that distinguish the plotted steps, also in grey and for most colour-blind users: those of Okabe and Ito
/// (2008), and some between.
const COLORS: [Color32; 10] = [
    Color32::from_rgb(230, 159, 0),
    Color32::from_rgb(86, 180, 233),
    Color32::from_rgb(0, 158, 115),
    Color32::from_rgb(240, 228, 66),
    Color32::from_rgb(213, 94, 0),
    Color32::from_rgb(204, 121, 167),
    Color32::from_rgb(60, 110, 200),
    Color32::from_rgb(150, 200, 150),
    Color32::from_rgb(190, 160, 230),
    Color32::from_rgb(170, 130, 90),
];

/// The plotted steps and the style.
#[derive(Default)]
pub struct Choice {
    /// Names of steps; `None` until the user chooses.
    chosen: Option<BTreeSet<String>>,
    stacked: bool,
}

impl Choice {
    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, steps: &[StepSummary], records: &[Arc<Record>]) {
        let mut order: Vec<&StepSummary> = steps.iter().collect();
        order.sort_by(|a, b| b.median.total_cmp(&a.median));
        let first = || order.iter().take(FIRST).map(|step| step.name.clone()).collect();
        let mut chosen = self.chosen.clone().unwrap_or_else(first);
        let plotted: Vec<&StepSummary> =
            order.iter().copied().filter(|step| chosen.contains(&step.name)).collect();

        let height = (ui.available_height() * 0.55).max(60.0);
        let plot = Plot::new("frames")
            .height(height)
            .show_x(false)
            .show_axes([false, true])
            .allow_drag(false)
            .allow_zoom(false)
            .allow_scroll(false)
            .include_y(0.0)
            .include_x(0.0)
            .include_x(RECORDED as f64);
        let stacked = self.stacked;
        plot.show(ui, |plot| {
            if stacked {
                for (index, [low, high]) in stack(&plotted).into_iter().enumerate() {
                    let xs: Vec<f64> = (0..low.len()).map(|frame| frame as f64).collect();
                    let color = COLORS[index % COLORS.len()];
                    plot.add(
                        FilledArea::new(plotted[index].name.as_str(), &xs, &low, &high)
                            .fill_color(color.gamma_multiply(0.8)),
                    );
                }
            } else {
                for (index, step) in plotted.iter().enumerate() {
                    plot.line(line(&step.name, &step.series, COLORS[index % COLORS.len()]));
                }
            }
            let frames: Vec<f32> = records.iter().map(|record| record.ms).collect();
            plot.line(line("frame", &frames, Color32::GRAY));
        });
        ui.horizontal(|ui| {
            ui.weak(format!("ms over {RECORDED} frames; grey: whole frame"));
            ui.checkbox(&mut self.stacked, "stacked").on_hover_text("Stack the steps");
        });
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.horizontal_wrapped(|ui| {
                ui.spacing_mut().item_spacing = egui::vec2(10.0, 2.0);
                let costs = |step: &&&StepSummary| step.median > 0.0 || chosen.contains(&step.name);
                for step in order.iter().filter(costs).collect::<Vec<_>>() {
                    let place = plotted.iter().position(|plotted| plotted.name == step.name);
                    let color =
                        place.map_or(ui.visuals().weak_text_color(), |place| COLORS[place % COLORS.len()]);
                    let mut on = place.is_some();
                    let label = egui::RichText::new(&step.name).color(color).size(12.0);
                    let response = ui.checkbox(&mut on, label);
                    if response.on_hover_text(format!("median {:.2} ms", step.median)).changed() {
                        if on {
                            chosen.insert(step.name.clone());
                        } else {
                            chosen.remove(&step.name);
                        }
                        self.chosen = Some(chosen.clone());
                    }
                }
            });
        });
    }
}

fn line<'a>(name: &str, series: &[f32], color: Color32) -> Line<'a> {
    let points: PlotPoints =
        series.iter().enumerate().map(|(frame, ms)| [frame as f64, f64::from(*ms)]).collect();
    Line::new(name, points).color(color).width(1.5)
}

/// The lower and upper limit of each step in each frame.
fn stack(steps: &[&StepSummary]) -> Vec<[Vec<f64>; 2]> {
    let mut low = vec![0.0; steps.first().map_or(0, |step| step.series.len())];
    let next = |step: &&StepSummary| {
        let high: Vec<f64> = low.iter().zip(&step.series).map(|(low, ms)| low + f64::from(*ms)).collect();
        [std::mem::replace(&mut low, high.clone()), high]
    };
    steps.iter().map(next).collect()
}

#[cfg(test)]
mod tests {
    use epigraph_core::Side;

    use super::*;
    use crate::engine::StepCost;

    #[test]
    fn stacked_steps_lie_on_each_other() {
        let step = |series: &[f32]| StepSummary {
            name: String::new(),
            node: None,
            side: Side::Cpu,
            last: StepCost::default(),
            median: 0.0,
            series: series.into(),
        };
        let (a, b) = (step(&[1.0, 2.0]), step(&[0.5, 0.25]));
        assert_eq!(stack(&[&a, &b]), [[vec![0.0, 0.0], vec![1.0, 2.0]], [vec![1.0, 2.0], vec![1.5, 2.25]]]);
        assert!(stack(&[]).is_empty());
    }
}
