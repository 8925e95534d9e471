//! The selected node: its description, its side, and its parameters from the stage's declaration. With no node selected,
//! the parameters of the graph.

use std::sync::Arc;

use egui::{
    Button, Checkbox, ComboBox, DragValue, Grid, Response, RichText, ScrollArea, Slider, SliderClamping,
    TextEdit, Ui,
};
use epigraph_core::{AUTO, Changed, GraphFile, NodeDef, ParamKind, ParamSpec, Side, handed};

use crate::{
    document::{Tag, fitting, home, nodes, param_text, remove_param, swap},
    files::short,
    intent::{Intent, Jump},
    session::Session,
    theme,
};

/// Wider ranges get no slider.
const WIDEST: f64 = 1e5;

/// Shows it.
pub fn show(ui: &mut Ui, session: &mut Session) {
    let Some(file) = session.document.whole().cloned() else { return };
    let Some(address) = session.selected.clone() else {
        graph(ui, session, &file);
        return;
    };
    let Some((node, within)) = file.node_at(&address) else {
        ui.weak(format!("The graph no longer has the node {address}."));
        return;
    };
    let kind = session.registry.get(&node.kind.value);
    let part = within.parts.iter().find(|(name, _)| *name == node.name.value).map(|(_, part)| part);
    // The shader of a `wgsl` node has parameters too, which only the running graph knows.
    let running = session.state.graph.clone();
    let running =
        running.as_ref().and_then(|graph| graph.node(&address)).filter(|info| info.kind == node.kind.value);
    let specs = match (part, running, kind) {
        (Some(part), ..) => part.params.iter().map(|param| param.spec.clone()).collect(),
        (None, Some(running), _) => running.specs.clone(),
        (None, None, kind) => kind.map(|kind| kind.specs()).unwrap_or_default(),
    };
    let doc = part.map_or_else(|| kind.map_or("", |kind| kind.doc()), |part| &part.doc).to_owned();
    let is_stage = kind.is_some();
    let counted = node.repeat.as_ref().and_then(|repeat| repeat.count.as_ref()).map(|count| &count.value);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.horizontal_wrapped(|ui| {
            ui.heading(&address);
            let place = within.place(node.name.span);
            if ui.small_button("Show in text").clicked() {
                session.push(Intent::Jump(Jump { path: place.file, at: (place.line, place.column) }));
            }
        });
        ui.weak(doc);
        changes(ui, session, &address);
        ui.add_space(4.0);
        let broken = !session.document.problems().is_empty();
        ui.add_enabled_ui(!broken, |ui| {
            Grid::new("parameters").num_columns(3).spacing([8.0, 6.0]).show(ui, |ui| {
                if is_stage {
                    placing(ui, session, &file, &address, node);
                }
                for spec in &specs {
                    if counted == Some(&spec.name) {
                        ui.label(&spec.name).on_hover_text(explain(spec));
                        ui.weak("counts the copies");
                        ui.end_row();
                    } else {
                        parameter(ui, session, &file, &Owner::Node(address.clone()), spec);
                    }
                }
            });
        });
        if specs.is_empty() && part.is_none() {
            ui.weak("This stage has no parameters.");
        }
        if part.is_some() {
            ui.add_space(4.0);
            inside(ui, session, &address);
        }
        if broken {
            ui.colored_label(theme::palette(ui).bad, "Fix the text first.");
        }
    });
}

/// The changes of the graph to a node of its base, and a button that removes them.
fn changes(ui: &mut Ui, session: &mut Session, address: &str) {
    let document = &session.document;
    let own: Vec<_> = document.differences().iter().filter(|found| found.node == address).collect();
    let (Some(base), false) = (document.base(), own.is_empty()) else { return };
    let words: Vec<String> = own.iter().map(|found| found.what.to_string()).collect();
    let is_new = own.iter().any(|found| found.what == Changed::Added);
    let text = format!("Changed from {}: {}", short(base), words.join("; "));
    let mut restored = false;
    ui.horizontal_wrapped(|ui| {
        ui.colored_label(theme::palette(ui).changed, text);
        let button = ui.add_enabled(!is_new, Button::new("As in the base").small());
        restored = button.on_hover_text("Removes the changes to this node from the file").clicked();
    });
    if restored {
        session.edit(Tag::Once, |file| file.restore_node(address));
    }
}

/// The parameters of the graph itself.
fn graph(ui: &mut Ui, session: &mut Session, file: &Arc<GraphFile>) {
    ui.weak("Select a node to see its parameters.");
    if file.params.is_empty() {
        return;
    }
    ui.add_space(4.0);
    ui.strong("Parameters of the graph");
    let broken = !session.document.problems().is_empty();
    ui.add_enabled_ui(!broken, |ui| {
        Grid::new("parameters").num_columns(3).spacing([8.0, 6.0]).show(ui, |ui| {
            for param in &file.params {
                parameter(ui, session, file, &Owner::Graph, &param.spec);
            }
        });
    });
}

/// The nodes in a part.
fn inside(ui: &mut Ui, session: &mut Session, address: &str) {
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
        let registry = session.registry.clone();
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

/// Whose parameter is shown.
#[derive(Clone)]
enum Owner {
    /// A node's, by address.
    Node(String),
    /// The graph's own.
    Graph,
}

impl Owner {
    fn text<'f>(&self, file: &'f GraphFile, spec: &ParamSpec) -> Option<&'f str> {
        match self {
            Self::Node(address) => param_text(file, address, &spec.name),
            Self::Graph => None,
        }
    }

    /// Whether the graph gives the parameter another value than its base.
    fn differs(&self, session: &Session, spec: &ParamSpec) -> bool {
        let node = match self {
            Self::Node(address) => &address[..],
            Self::Graph => "",
        };
        let mut changes = session.document.differences().iter().filter(|found| found.node == node);
        changes.any(|found| matches!(&found.what, Changed::Set(param, _) if *param == spec.name))
    }

    /// Sets the parameter; changes made one after the other are one step back.
    fn set(&self, session: &mut Session, spec: &ParamSpec, value: &str) {
        let address = match self {
            Self::Node(address) => &address[..],
            Self::Graph => "",
        };
        session.edit(Tag::Param(address.into(), spec.name.clone()), |file| match self {
            Self::Node(address) => file.set_param(address, &spec.name, value),
            Self::Graph => file.set_graph_param(&spec.name, value),
        });
    }
}

fn parameter(ui: &mut Ui, session: &mut Session, file: &GraphFile, owner: &Owner, spec: &ParamSpec) {
    let written = owner.text(file, spec);
    let differs = owner.differs(session, spec);
    let name = RichText::new(&spec.name);
    let label = ui.label(if written.is_some() || differs { name.strong() } else { name });
    let label = label.on_hover_text(explain(spec));
    let mut value = written.unwrap_or(&spec.default).to_owned();
    let response = match (handed(&value), owner) {
        (Some(param), Owner::Node(address)) => taken(ui, session, file, address, &param, &mut value),
        _ => widget(ui, &mut value, spec),
    };
    let response = response.labelled_by(label.id).on_hover_text(explain(spec));
    if response.changed() && Some(value.as_str()) != written {
        owner.set(session, spec, &value);
    }
    if response.drag_stopped() || response.lost_focus() {
        session.document.seal();
    }
    ui.horizontal(|ui| {
        match owner {
            Owner::Node(address) => {
                let then = match differs {
                    true => "then the base's value applies".to_owned(),
                    false => format!("the stage's default is {}", spec.default),
                };
                if reset(ui, spec, written.is_some(), &then).clicked() {
                    session.edit(Tag::Once, |file| remove_param(file, address, &spec.name, &spec.default));
                }
            }
            Owner::Graph if differs => {
                if reset(ui, spec, true, "then the base's value applies").clicked() {
                    session.edit(Tag::Once, |file| file.restore_param(&spec.name));
                }
            }
            Owner::Graph => {}
        }
        ui.weak(&spec.unit);
    });
    ui.end_row();
}

/// A parameter that the node takes from its graph: its name there, and a field for a value of the node's own, which is
/// taken when the field is left.
fn taken(
    ui: &mut Ui,
    session: &mut Session,
    file: &GraphFile,
    address: &str,
    param: &str,
    value: &mut String,
) -> Response {
    let part = nodes::part_of(file, address);
    let running = session.state.graph.as_ref().and_then(|graph| graph.value(part, param).cloned());
    let declared = || nodes::scope(file, part)?.param(param).map(|param| param.default.value.clone());
    let present = running.or_else(declared).unwrap_or_default();
    ui.horizontal(|ui| {
        let link = ui.link(param).on_hover_text(format!("Taken from the graph's parameter {param}"));
        if link.clicked() {
            session.selected = (!part.is_empty()).then(|| part.to_owned());
        }
        let id = ui.id().with(("taken", address, param));
        let mut text = ui.data(|data| data.get_temp::<String>(id)).unwrap_or_default();
        let field = TextEdit::singleline(&mut text).hint_text(present).desired_width(80.0);
        let mut response = ui.add(field);
        if response.lost_focus() && !text.trim().is_empty() {
            value.clone_from(&text);
            text.clear();
            response.mark_changed();
        }
        ui.data_mut(|data| data.insert_temp(id, text));
        response
    })
    .inner
}

/// Removes the parameter from the file; `then` says what applies then.
fn reset(ui: &mut Ui, spec: &ParamSpec, enabled: bool, then: &str) -> Response {
    let reset = ui.add_enabled(enabled, Button::new("⟲").frame(false));
    let name = format!("default of {}", spec.name);
    reset.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, enabled, &name));
    reset.on_hover_text(format!("Remove it from the file; {then}"))
}

fn explain(spec: &ParamSpec) -> String {
    let range = spec.range.map_or(String::new(), |(low, high)| format!(", {low} to {high}"));
    let unit = if spec.unit.is_empty() { String::new() } else { format!(" {}", spec.unit) };
    format!("{}\n{}{range}{unit}; default {}", spec.doc, spec.kind.words(), spec.default)
}

/// A widget for the RON text of a parameter of that kind.
fn widget(ui: &mut Ui, value: &mut String, spec: &ParamSpec) -> Response {
    match &spec.kind {
        ParamKind::Bool => {
            let mut on = value.trim() == "true";
            let response = ui.add(Checkbox::without_text(&mut on));
            // Without a text, its own name is empty, and hides the label's.
            let state = on;
            response.widget_info(|| {
                egui::WidgetInfo::selected(egui::WidgetType::Checkbox, true, state, &spec.name)
            });
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
        ParamKind::F32OrAuto => number_or_auto(ui, value, spec),
    }
}

/// A number, and a button that leaves it to the stage.
fn number_or_auto(ui: &mut Ui, value: &mut String, spec: &ParamSpec) -> Response {
    ui.horizontal(|ui| {
        let mut auto = value.trim() == AUTO;
        let number = (!auto).then(|| number(ui, value, spec));
        let button = ui.toggle_value(&mut auto, AUTO);
        let changed = button.changed();
        let mut response = number.unwrap_or(button);
        if changed {
            *value = if auto { AUTO.into() } else { a_number(spec) };
            response.mark_changed();
        }
        response
    })
    .inner
}

/// The default, or the number nearest to 0 if that is `Auto`.
fn a_number(spec: &ParamSpec) -> String {
    let (low, high) = spec.range.unwrap_or((f64::MIN, f64::MAX));
    if spec.default == AUTO { format!("{:?}", 0f64.clamp(low, high)) } else { spec.default.clone() }
}

fn number(ui: &mut Ui, value: &mut String, spec: &ParamSpec) -> Response {
    let whole = matches!(spec.kind, ParamKind::U32 | ParamKind::I32);
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
