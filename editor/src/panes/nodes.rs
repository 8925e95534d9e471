//! The list of nodes in execution order, with their costs and outputs.

use egui::{Align, Button, Layout, RichText, ScrollArea, Sense, TextEdit, Ui, WidgetInfo, WidgetType, vec2};
use epigraph_core::Side;
use epigraph_pictures::readable;

use crate::{
    engine::{GraphInfo, NodeInfo},
    intent::Intent,
    session::Session,
    theme,
};

/// The list's own state.
#[derive(Default)]
pub struct NodesPane {
    search: String,
}

impl NodesPane {
    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        let search = TextEdit::singleline(&mut self.search).hint_text("Search nodes and kinds");
        let search = ui.add(search.desired_width(f32::INFINITY));
        search.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Search nodes and kinds"));
        ui.add_space(2.0);
        let Some(graph) = session.state.graph.clone() else {
            ui.weak("No graph runs yet.");
            return;
        };
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            let matches = |name: &str, kind: &str| name.contains(&self.search) || kind.contains(&self.search);
            for node in graph.steps.iter().filter_map(|step| graph.node(step.node.as_deref()?)) {
                if matches(&node.name, &node.kind) {
                    row(ui, session, &graph, node);
                }
            }
            let left_out: Vec<_> =
                graph.left_out.iter().filter(|node| matches(&node.name, &node.kind)).collect();
            if !left_out.is_empty() {
                ui.add_space(6.0);
                ui.weak(left_out_line(&graph));
            }
            for node in left_out {
                let selected = session.selected.as_ref() == Some(&node.name);
                ui.horizontal(|ui| {
                    let button = ui.add(Button::selectable(selected, RichText::new(&node.name).weak()));
                    if button.on_hover_text(&node.why).clicked() {
                        session.selected = Some(node.name.clone());
                    }
                    let bytes = node.bytes.filter(|bytes| *bytes > 0);
                    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                        if let Some(bytes) = bytes {
                            ui.weak(readable(bytes)).on_hover_text("What it would write in a frame");
                        }
                    });
                });
            }
        });
    }
}

/// How many nodes do not run in this scene or graph, and what that saves.
fn left_out_line(graph: &GraphInfo) -> String {
    let nodes = match graph.left_out.len() {
        1 => "1 node".into(),
        many => format!("{many} nodes"),
    };
    let bytes: u64 = graph.left_out.iter().filter_map(|node| node.bytes).sum();
    let saved =
        if bytes > 0 { format!(", which would write {} in a frame", readable(bytes)) } else { String::new() };
    format!("Left out as not needed: {nodes}{saved}")
}

fn row(ui: &mut Ui, session: &mut Session, graph: &GraphInfo, node: &NodeInfo) {
    let selected = session.selected.as_deref() == Some(&node.name);
    ui.horizontal(|ui| {
        let (color, side) = match node.side {
            Side::Cpu => (theme::palette(ui).cpu, "Runs on the CPU"),
            Side::Gpu => (theme::palette(ui).gpu, "Runs on the GPU"),
        };
        let (rect, dot) = ui.allocate_exact_size(vec2(10.0, 10.0), Sense::hover());
        ui.painter().circle_filled(rect.center(), 3.5, color);
        dot.on_hover_text(side);
        let doc = session.registry.get(&node.kind).map_or("", |kind| kind.doc());
        let button = ui.add(Button::selectable(selected, &node.name));
        if button.on_hover_text(format!("{}: {doc}", node.kind)).clicked() {
            session.selected = if selected { None } else { Some(node.name.clone()) };
        }
        if !node.name.ends_with(&node.kind) {
            ui.weak(&node.kind);
        }
        let changes: Vec<String> =
            session.document.differences_of(&node.name).map(|found| found.what.to_string()).collect();
        if !changes.is_empty() {
            let text = RichText::new("changed").small().color(theme::palette(ui).changed);
            ui.label(text).on_hover_text(changes.join("; "));
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if let Some(ms) = graph.node_ms(&node.name, &session.state.times) {
                ui.weak(format!("{ms:.2} ms"));
            }
        });
    });
    if selected {
        ui.indent(&node.name, |ui| ports(ui, session, node));
    }
}

/// The node's outputs, with a button that shows each.
fn ports(ui: &mut Ui, session: &mut Session, node: &NodeInfo) {
    for info in node.ports.iter().filter(|info| info.port.is_output()) {
        let name = format!("{}.{}", node.name, info.port.name);
        ui.horizontal(|ui| {
            let elements = info.port.fields.first().map_or(String::new(), |field| field.element.to_string());
            let meaning = info.port.meaning.map_or(String::new(), |meaning| format!("\nmeaning: {meaning}"));
            let doc = format!("{}\n{elements}, {}{meaning}", info.port.doc, info.port.extent);
            if ui.small_button(format!("View {}", info.port.name)).on_hover_text(doc).clicked() {
                session.push(Intent::Show(name));
            }
            ui.weak(format!("{}", info.dims));
        });
    }
}
