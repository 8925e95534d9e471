//! Occupancy of the cloud, ages of its points, and number of new samples.

use std::sync::Arc;

use egui::{ProgressBar, Ui};
use egui_plot::{Bar, BarChart, Plot};
use epigraph_core::Meaning;
use epigraph_stages::meaning::{AGES, ARRIVED, POINTS};

use crate::{
    engine::{GraphInfo, NodeInfo, PortInfo, Record},
    intent::Intent,
    session::Session,
    theme,
};

/// Number of ages per bar.
const BIN: usize = 8;

/// Shows it.
pub fn show(ui: &mut Ui, session: &mut Session, records: &[Arc<Record>]) {
    let Some(graph) = session.state.graph.clone() else { return };
    let Some(ages) = output(&graph, AGES) else {
        ui.weak("No stage of this graph counts the points of the cloud by age.");
        return;
    };
    // The lists are small, and are captured only while this page is shown.
    let arrived = output(&graph, ARRIVED);
    for (_, port) in [Some(&ages), arrived.as_ref()].into_iter().flatten() {
        session.push(Intent::Watch(port.clone()));
    }

    let counts = session.state.fields(&ages.1).next().map(|snapshot| snapshot.get::<u32>());
    let Some(counts) = counts else {
        ui.weak(if session.state.paused {
            "Step or run to see the cloud."
        } else {
            "Waiting for a frame …"
        });
        return;
    };
    let slots = ages
        .0
        .ports
        .iter()
        .find(|info| info.port.meaning == Some(POINTS))
        .map_or(0, |info| info.dims.count());
    let live: u32 = counts.iter().sum();
    let color = theme::palette(ui).cpu;
    let share = live as f32 / slots.max(1) as f32;
    ui.add(
        ProgressBar::new(share)
            .text(format!("{live} of {slots} slots, {:.1}%", 100.0 * share))
            .fill(color.gamma_multiply(0.6)),
    )
    .on_hover_text("Slots of the cloud that hold a point");
    samples(ui, session, arrived.as_ref().map(|found| found.1.as_str()), records);

    let bar = |(index, ages): (usize, &[u32])| {
        let count = f64::from(ages.iter().sum::<u32>());
        Bar::new((index * BIN) as f64 + 0.5 * BIN as f64, count).width(BIN as f64 * 0.9).name(format!(
            "age {} to {}",
            index * BIN,
            (index + 1) * BIN - 1
        ))
    };
    let bars: Vec<Bar> = counts.chunks(BIN).enumerate().map(bar).collect();
    ui.weak("points by age, 0 to 255");
    Plot::new("ages")
        .height((ui.available_height() - 4.0).max(60.0))
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .include_x(0.0)
        .include_x(256.0)
        .include_y(0.0)
        .show(ui, |plot| plot.bar_chart(BarChart::new("points", bars).color(color)));
}

/// Number of samples in the last frame, and per second.
fn samples(ui: &mut Ui, session: &Session, arrived: Option<&str>, records: &[Arc<Record>]) {
    let Some(count) =
        arrived.and_then(|name| session.state.fields(name).next()?.get::<u32>().first().copied())
    else {
        return;
    };
    ui.horizontal(|ui| {
        ui.label(format!("{count} samples in the last frame"));
        if let Some(rate) = rate(records).filter(|_| !session.state.paused) {
            ui.weak(format!("{:.1} thousand per second", f64::from(count) * rate / 1000.0))
                .on_hover_text("At this number per frame and the current frame rate");
        }
    });
}

/// Recent frames per second.
fn rate(records: &[Arc<Record>]) -> Option<f64> {
    const FRAMES: usize = 30;
    let recent = &records[records.len().saturating_sub(FRAMES)..];
    let seconds = recent.last()?.at - recent.first()?.at;
    (seconds > 0.0).then(|| (recent.len() - 1) as f64 / seconds)
}

/// The first output with this meaning, as `node.port`, and its node.
fn output(graph: &GraphInfo, meaning: Meaning) -> Option<(&NodeInfo, String)> {
    graph.nodes.iter().find_map(|node| {
        let is_it = |info: &&PortInfo| info.port.is_output() && info.port.meaning == Some(meaning);
        let found = node.ports.iter().find(is_it)?;
        Some((node, format!("{}.{}", node.name, found.port.name)))
    })
}
