//! The rows above the image: the port and its look.

use egui::{ComboBox, DragValue, Ui, WidgetType};
use epigraph_pictures::{Lane, Mode, Ramp, lanes};

use super::{Viewer, compare::Compare, place::Place};
use crate::{
    engine::{GraphInfo, NodeInfo},
    name::Named,
};

const STOPS: std::ops::RangeInclusive<f32> = -16.0..=16.0;

/// The name of a port's snapshots; an empty name means the first output.
pub fn name(graph: &GraphInfo, port: &str) -> String {
    match port {
        "" => graph.outputs.first().map_or(String::new(), |(name, _)| name.clone()),
        port => port.to_owned(),
    }
}

/// The label of the first output.
pub fn output(graph: &GraphInfo) -> String {
    format!("output {}", name(graph, ""))
}

/// Offers ports: images, and lists too unless `images` is set. `offer` gets the port, its label and its contents in
/// words.
pub fn ports(
    ui: &mut Ui,
    graph: &GraphInfo,
    images: bool,
    mut offer: impl FnMut(&mut Ui, String, String, String),
) {
    if let Some((_, from)) = graph.outputs.first() {
        offer(ui, String::new(), output(graph), from.clone());
    }
    let nodes = || graph.steps.iter().filter_map(|step| graph.node(step.node.as_deref()?));
    let mut section = |ui: &mut Ui, images: bool| {
        for (node, info) in
            nodes().flat_map(|node: &NodeInfo| node.ports.iter().map(move |info| (node, info)))
        {
            if info.port.is_output() && info.is_image(graph.size) == images {
                let name = format!("{}.{}", node.name, info.port.name);
                offer(ui, name.clone(), name, format!("{}\n{}", info.port.doc, info.dims));
            }
        }
    };
    section(ui, true);
    if !images {
        ui.separator();
        ui.weak("lists");
        section(ui, false);
    }
}

impl Viewer {
    /// The first row: the port, its mode, and buttons for histogram, comparison and zoom.
    pub(super) fn header(&mut self, ui: &mut Ui, graph: &GraphInfo, frames: u32) {
        ui.horizontal_wrapped(|ui| {
            self.choose_port(ui, graph);
            if self.list.is_some() {
                return;
            }
            self.choose_mode(ui);
            ui.toggle_value(&mut self.histogram_open, "Histogram").on_hover_text("Histogram of the values");
            let mut comparing = self.compare.is_some();
            let doc = "Compare with an earlier image, another port, another graph, or a file";
            if ui.toggle_value(&mut comparing, "Compare").on_hover_text(doc).changed() {
                let image = self.layer().map(|layer| layer.snapshot.clone());
                self.compare = comparing.then(|| Box::new(Compare::holding(image, frames)));
            }
            let zoom = |ui: &mut Ui, place: &mut Place, zoom, label, doc| {
                if ui.selectable_label(place.zoom == zoom, label).on_hover_text(doc).clicked() {
                    *place = Place::centered(zoom);
                }
            };
            zoom(ui, &mut self.place, None, "Fit", "Fit the image into the pane");
            zoom(ui, &mut self.place, Some(1.0), "1:1", "One point for each pixel");
        });
    }

    fn choose_port(&mut self, ui: &mut Ui, graph: &GraphInfo) {
        let mut chosen = self.port.clone();
        let shown = if chosen.is_empty() { output(graph) } else { chosen.clone() };
        let combo = ComboBox::from_id_salt("port").selected_text(shown).width(170.0).height(420.0);
        let response = combo.show_ui(ui, |ui| {
            ports(ui, graph, false, |ui, name, label, doc| {
                ui.selectable_value(&mut chosen, name, label).on_hover_text(doc);
            });
        });
        response.response.named(WidgetType::ComboBox, "Port in view").on_hover_text("The port to show");
        self.choose(chosen);
    }

    fn choose_mode(&mut self, ui: &mut Ui) {
        let mode = self.look.mode;
        let automatic = self.picture().map_or("", |picture| picture.mode.label());
        let text = mode.map_or(automatic, Mode::label);
        let combo = ComboBox::from_id_salt("mode").selected_text(text).width(104.0).height(420.0);
        let response = combo.show_ui(ui, |ui| {
            ui.selectable_value(&mut self.look.mode, None, "Automatic");
            for (mode, label) in Mode::ALL {
                ui.selectable_value(&mut self.look.mode, Some(mode), label);
            }
        });
        response.response.named(WidgetType::ComboBox, "Shown as").on_hover_text("How numbers map to colours");
        if self.look.mode != mode {
            // The old mode's range does not apply to the new mode.
            self.look.range = None;
        }
    }

    /// The second row: the mode's settings, if it has any.
    pub(super) fn look_row(&mut self, ui: &mut Ui, graph: &GraphInfo, name: &str) {
        let Some(layer) = self.layer() else { return };
        let (mode, lanes) = (layer.shown.mode, lanes(&layer.snapshot.element));
        match mode {
            Mode::Color => {
                ui.horizontal_wrapped(|ui| self.color_row(ui, &lanes));
            }
            Mode::Grey | Mode::FalseColor | Mode::Depth => {
                ui.horizontal_wrapped(|ui| {
                    self.ages_row(ui, graph, name);
                    self.lane(ui, &lanes);
                    if mode == Mode::FalseColor {
                        let combo = ComboBox::from_id_salt("ramp").selected_text(self.look.ramp.label());
                        let response = combo.width(84.0).show_ui(ui, |ui| {
                            for (ramp, label) in Ramp::ALL {
                                ui.selectable_value(&mut self.look.ramp, ramp, label);
                            }
                        });
                        response
                            .response
                            .named(WidgetType::ComboBox, "Ramp")
                            .on_hover_text("The colours of the ramp");
                    }
                    self.range(ui, mode);
                });
            }
            Mode::Names if self.is_of_points(graph) || lanes.len() > 1 => {
                ui.horizontal_wrapped(|ui| {
                    self.ages_row(ui, graph, name);
                    self.lane(ui, &lanes);
                });
            }
            _ => {}
        }
    }

    /// The order of channels, and the exposure.
    fn color_row(&mut self, ui: &mut Ui, lanes: &[Lane]) {
        let count = lanes.len();
        let look = &mut self.look;
        let letter = |lane: usize| lanes.get(lane).map_or("–".to_owned(), |lane| lane.name.to_uppercase());
        if count > 2 {
            let all = lanes[..3].iter().map(|lane| lane.name.to_uppercase()).collect::<String>();
            ui.selectable_value(&mut look.channels, [0, 1, 2], all).on_hover_text("All channels");
            for lane in 0..count.min(4) {
                let doc = format!("Only {}, as grey", letter(lane));
                ui.selectable_value(&mut look.channels, [lane; 3], letter(lane)).on_hover_text(doc);
            }
            ui.separator();
        }
        for (channel, name) in ["red", "green", "blue"].into_iter().enumerate() {
            let combo =
                ComboBox::from_id_salt(name).selected_text(letter(look.channels[channel])).width(30.0);
            let response = combo.show_ui(ui, |ui| {
                for lane in 0..count {
                    ui.selectable_value(&mut look.channels[channel], lane, letter(lane));
                }
            });
            let what = format!("Lane shown as {name}");
            response.response.named(WidgetType::ComboBox, &what).on_hover_text(&what);
        }
        let is_light = lanes.iter().all(Lane::is_float) && count > 2 && !self.is_encoded();
        if is_light {
            ui.separator();
            let exposure = DragValue::new(&mut self.look.exposure)
                .range(STOPS)
                .speed(0.02)
                .max_decimals(2)
                .prefix("exposure ");
            let exposure = ui.add(exposure.suffix(" stops")).named(WidgetType::DragValue, "Exposure");
            exposure
                .on_hover_text("Each stop doubles the brightness, in this view only. Double click to type");
            if self.look.exposure != 0.0 && ui.button("0").on_hover_text("Reset the exposure").clicked() {
                self.look.exposure = 0.0;
            }
        }
    }

    fn is_encoded(&self) -> bool {
        use epigraph_core::{Element, Format};
        self.layer().is_some_and(|layer| layer.snapshot.element == Element::Texel(Format::Rgba8Unorm))
    }

    /// The choice to show ids as the ages of their points.
    fn ages_row(&mut self, ui: &mut Ui, graph: &GraphInfo, name: &str) {
        if self.is_of_points(graph)
            && let Some(is_number) = self.ages.choose(ui, graph, name)
        {
            self.look.range = None;
            self.look.mode = is_number.then_some(Mode::FalseColor);
        }
    }

    /// The choice of the lane, if there are several.
    fn lane(&mut self, ui: &mut Ui, lanes: &[Lane]) {
        if lanes.len() < 2 {
            return;
        }
        let text = lanes.get(self.look.lane).map_or("", |lane| &lane.name);
        let response = ComboBox::from_id_salt("lane").selected_text(text).width(40.0).show_ui(ui, |ui| {
            for (index, lane) in lanes.iter().enumerate() {
                ui.selectable_value(&mut self.look.lane, index, &lane.name);
            }
        });
        response.response.named(WidgetType::ComboBox, "Lane").on_hover_text("The lane to show");
    }

    /// The ends of the range.
    fn range(&mut self, ui: &mut Ui, mode: Mode) {
        let Some(range) = self.picture().and_then(|picture| Some(picture.scale?.range)) else { return };
        let mut ends = range;
        let speed = ((range[1] - range[0]).abs() * 0.005).max(1e-4);
        let low = ui.add(DragValue::new(&mut ends[0]).speed(speed).max_decimals(3));
        let low = low.named(WidgetType::DragValue, "Value at the dark end");
        ui.weak("to");
        let high = ui.add(DragValue::new(&mut ends[1]).speed(speed).max_decimals(3));
        let high = high.named(WidgetType::DragValue, "Value at the bright end");
        let changed = low.on_hover_text("Value at the dark end").changed()
            | high.on_hover_text("Value at the bright end").changed();
        if changed {
            self.look.range = Some(ends);
        }
        if mode != Mode::Depth {
            ui.checkbox(&mut self.look.log, "log").on_hover_text("Logarithmic scale");
        }
        if self.look.range.is_some()
            && ui.button("Auto").on_hover_text("Take the range from the image").clicked()
        {
            self.look.range = None;
        }
    }
}
