//! The selected node: its description, its side, and its parameters from the stage's declaration.

use std::sync::Arc;

use egui::{Checkbox, ComboBox, DragValue, Grid, RichText, ScrollArea, Slider, SliderClamping, TextEdit, Ui};
use epigraph_core::{GraphFile, NodeDef, ParamKind, ParamSpec, Side};

use crate::{
    document::{Tag, fitting, home, param_text, remove_param, swap},
    intent::{Intent, Jump},
    session::Session,
    theme,
};

/// Wider ranges get no slider.
const WIDEST: f64 = 1e5;

/// Shows it.
pub fn show(ui: &mut Ui, session: &mut Session) {
    let Some(address) = session.selected.clone() else {
        ui.weak("Select a node to see its parameters.");
        return;
    };
    let Some(file) = session.document.file().cloned() else { return };
    let Some((node, within)) = file.node_at(&address) else {
        ui.weak(format!("The graph no longer has the node {address}."));
        return;
    };
    let Some(kind) = session.registry.get(&node.kind.value) else {
        part(ui, session, &address);
        return;
    };
    let (doc, specs) = (kind.doc(), kind.specs());
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.horizontal_wrapped(|ui| {
            ui.heading(&address);
            let place = within.place(node.name.span);
            if ui.small_button("Show in text").clicked() {
                session.push(Intent::Jump(Jump { path: place.file, at: (place.line, place.column) }));
            }
        });
        ui.weak(doc);
        ui.add_space(4.0);
        let broken = !session.document.problems().is_empty();
        ui.add_enabled_ui(!broken, |ui| {
            Grid::new("parameters").num_columns(3).spacing([8.0, 6.0]).show(ui, |ui| {
                placing(ui, session, &file, &address, node);
                for spec in &specs {
                    parameter(ui, session, &file, &address, spec);
                }
            });
        });
        if specs.is_empty() {
            ui.weak("This stage has no parameters.");
        }
        if broken {
            ui.colored_label(theme::palette(ui).bad, "Fix the text first.");
        }
    });
}

/// The nodes in a part.
fn part(ui: &mut Ui, session: &mut Session, address: &str) {
    ui.strong(address);
    ui.weak("A part: a graph with these nodes.");
    let Some(graph) = session.state.graph.clone() else { return };
    let prefix = format!("{address}/");
    for node in graph.nodes.iter().filter(|node| node.name.starts_with(&prefix)) {
        if ui.link(&node.name).clicked() {
            session.selected = Some(node.name.clone());
        }
    }
}

/// The stage kind and the side.
fn placing(ui: &mut Ui, session: &mut Session, file: &Arc<GraphFile>, address: &str, node: &NodeDef) {
    let present = node.kind.value.as_str();
    let label = ui
        .label("stage")
        .on_hover_text("The node's stage; you can replace it by another that fits its wires");
    let mut chosen = None;
    let combo = ComboBox::from_id_salt("kind").selected_text(present).width(120.0);
    let combo = combo.show_ui(ui, |ui| {
        for kind in fitting(file, address, &session.registry) {
            let doc = session.registry.get(kind).map_or("", |kind| kind.doc());
            if ui.selectable_label(kind == present, kind).on_hover_text(doc).clicked() && kind != present {
                chosen = Some(kind);
            }
        }
    });
    combo.response.labelled_by(label.id);
    ui.end_row();
    if let Some(kind) = chosen {
        let registry = epigraph_stages::registry();
        session.edit(Tag::Once, |file| swap(file, address, kind, &registry));
    }

    let label = ui.label("runs on").on_hover_text("The node's side; by default, the toolbar's backend");
    let mut on = node.on.as_ref().map(|on| on.value);
    let text = |on: Option<Side>| match on {
        None => "default",
        Some(Side::Cpu) => "CPU",
        Some(Side::Gpu) => "GPU",
    };
    let before = on;
    let combo = ComboBox::from_id_salt("on").selected_text(text(on)).width(120.0);
    let combo = combo.show_ui(ui, |ui| {
        for side in [None, Some(Side::Cpu), Some(Side::Gpu)] {
            ui.selectable_value(&mut on, side, text(side));
        }
    });
    combo.response.labelled_by(label.id);
    ui.end_row();
    if on != before {
        session.edit(Tag::Once, |file| home(file, address).and_then(|(file, name)| file.set_on(name, on)));
    }
}

fn parameter(ui: &mut Ui, session: &mut Session, file: &GraphFile, address: &str, spec: &ParamSpec) {
    let written = param_text(file, address, &spec.name);
    let name = RichText::new(&spec.name);
    let label = ui.label(if written.is_some() { name.strong() } else { name });
    let label = label.on_hover_text(explain(spec));
    let mut value = written.unwrap_or(&spec.default).to_owned();
    let response = widget(ui, &mut value, spec).labelled_by(label.id).on_hover_text(explain(spec));
    if response.changed() && Some(value.as_str()) != written {
        let tag = Tag::Param(address.into(), spec.name.clone());
        session.edit(tag, |file| file.set_param(address, &spec.name, &value));
    }
    if response.drag_stopped() || response.lost_focus() {
        session.document.seal();
    }
    ui.horizontal(|ui| {
        let reset = reset(ui, spec, written.is_some());
        if reset.clicked() {
            session.edit(Tag::Once, |file| remove_param(file, address, &spec.name, &spec.default));
        }
        ui.weak(&spec.unit);
    });
    ui.end_row();
}

/// Removes the parameter from the file.
fn reset(ui: &mut Ui, spec: &ParamSpec, enabled: bool) -> egui::Response {
    let reset = ui.add_enabled(enabled, egui::Button::new("⟲").frame(false));
    let name = format!("default of {}", spec.name);
    reset.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, enabled, &name));
    reset.on_hover_text(format!("Remove it from the file; the stage's default is {}", spec.default))
}

fn explain(spec: &ParamSpec) -> String {
    let range = spec.range.map_or(String::new(), |(low, high)| format!(", {low} to {high}"));
    let unit = if spec.unit.is_empty() { String::new() } else { format!(" {}", spec.unit) };
    format!("{}\n{}{range}{unit}; default {}", spec.doc, spec.kind.words(), spec.default)
}

/// A widget for the RON text of a parameter of that kind.
fn widget(ui: &mut Ui, value: &mut String, spec: &ParamSpec) -> egui::Response {
    match &spec.kind {
        ParamKind::Bool => {
            let mut on = value.trim() == "true";
            let response = ui.add(Checkbox::without_text(&mut on));
            if response.changed() {
                *value = on.to_string();
            }
            response
        }
        ParamKind::Choice(names) => {
            let before = value.clone();
            let combo = ComboBox::from_id_salt(&spec.name).selected_text(value.as_str()).width(120.0);
            let mut response = combo
                .show_ui(ui, |ui| {
                    for name in names {
                        ui.selectable_value(value, name.clone(), name);
                    }
                })
                .response;
            if *value != before {
                response.mark_changed();
            }
            response
        }
        ParamKind::Text => ui.add(TextEdit::singleline(value).desired_width(120.0)),
        ParamKind::F32 | ParamKind::U32 | ParamKind::I32 => number(ui, value, spec),
    }
}

fn number(ui: &mut Ui, value: &mut String, spec: &ParamSpec) -> egui::Response {
    let whole = spec.kind != ParamKind::F32;
    let Ok(before) = value.trim().parse::<f64>() else {
        return ui.add(TextEdit::singleline(value).desired_width(120.0));
    };
    let mut number = before;
    let (low, high) = spec.range.unwrap_or((f64::MIN, f64::MAX));
    // A value outside its range stays as written until the user edits it.
    let response = if high - low <= WIDEST {
        let slider = Slider::new(&mut number, low..=high).clamping(SliderClamping::Edits);
        ui.add(if whole { slider.integer() } else { slider.max_decimals(4) })
    } else {
        let speed = if whole { 1.0 } else { (before.abs() * 0.01).max(0.001) };
        let drag = DragValue::new(&mut number).range(low..=high).speed(speed).clamp_existing_to_range(false);
        ui.add(if whole { drag.fixed_decimals(0) } else { drag })
    };
    if response.changed() && number != before {
        // As f32, so that 0.1 is written as 0.1.
        *value = if whole { format!("{number:.0}") } else { format!("{:?}", number as f32) };
    }
    response
}
