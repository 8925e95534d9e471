//! The graph as boxes and wires: a projection of the document, made anew whenever the document changes. Positions are
//! the canvas's own; everything else is an edit of the file.

use std::{collections::HashMap, sync::Arc};

use egui::{Color32, Frame, Pos2, Sense, Stroke, Ui, pos2};
use egui_snarl::{
    InPin, InPinId, NodeId, OutPin, OutPinId, Snarl,
    ui::{PinInfo, PinPlacement, SnarlPin, SnarlStyle, SnarlViewer},
};
use epigraph_core::{Element, GraphFile, Source};

use crate::{
    document::{Pin, Tag, pins},
    session::Session,
    theme,
};

/// Between columns of boxes, and between boxes of a column.
const ALLEY: f32 = 56.0;
const GAP: f32 = 36.0;
/// Width of a box beside its texts, and of a letter.
const RIM: f32 = 52.0;
const LETTER: f32 = 7.0;
/// Height of a box without pins, and of a row of pins.
const BOX: f32 = 60.0;
const ROW: f32 = 24.0;

/// A box.
#[derive(Clone, Debug, PartialEq)]
struct Item {
    name: String,
    kind: String,
    bypass: bool,
    inputs: Vec<Pin>,
    outputs: Vec<Pin>,
}

/// The canvas's own state.
#[derive(Default)]
pub struct CanvasPane {
    file: Option<Arc<GraphFile>>,
    snarl: Snarl<Item>,
    places: HashMap<String, Pos2>,
    search: String,
}

impl CanvasPane {
    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        let Some(file) = session.document.file().cloned() else {
            ui.weak("The text has never been sound; mend it in the text pane.");
            return;
        };
        if self.file.as_ref().is_none_or(|shown| !Arc::ptr_eq(shown, &file)) {
            self.project(&file, session);
            self.file = Some(file);
        }
        let mut viewer = Canvas { session, search: &mut self.search, places: &mut self.places };
        // Pins inside their box would push the names of outputs under them (egui-snarl 0.12).
        let pins = Some(PinPlacement::Edge);
        let style = SnarlStyle { collapsible: Some(false), pin_placement: pins, ..SnarlStyle::new() };
        egui_snarl::ui::SnarlWidget::new().id_salt("canvas").style(style).show(
            &mut self.snarl,
            &mut viewer,
            ui,
        );
        for (at, item) in self.snarl.nodes_pos() {
            self.places.insert(item.name.clone(), at);
        }
    }

    /// Boxes and wires of a file; those that were there stay where they were.
    fn project(&mut self, file: &GraphFile, session: &Session) {
        let items: Vec<Item> = file
            .nodes
            .iter()
            .map(|node| {
                let [inputs, outputs] = pins(file, node, &session.registry);
                let (name, kind) = (node.name.value.clone(), node.kind.value.clone());
                Item { name, kind, bypass: node.bypass, inputs, outputs }
            })
            .collect();
        let places = arrange(file, &items);
        self.snarl = Snarl::new();
        let ids: HashMap<&str, (NodeId, &Item)> = items
            .iter()
            .zip(places)
            .map(|(item, place)| {
                let place = *self.places.entry(item.name.clone()).or_insert(place);
                (item.name.as_str(), (self.snarl.insert_node(place, item.clone()), item))
            })
            .collect();
        for node in &file.nodes {
            let Some((to, item)) = ids.get(node.name.value.as_str()) else { continue };
            for input in &node.inputs {
                let Some((from, source)) = ids.get(input.from.value.node.as_str()) else { continue };
                let output = source.outputs.iter().position(|pin| pin.name == input.from.value.port);
                let input = item.inputs.iter().position(|pin| pin.name == input.port.value);
                if let (Some(output), Some(input)) = (output, input) {
                    self.snarl.connect(OutPinId { node: *from, output }, InPinId { node: *to, input });
                }
            }
        }
    }
}

/// Columns from left to right along the wires, in each the order of the file. Wires from later nodes, which carry last
/// frame's values, do not count.
fn arrange(file: &GraphFile, items: &[Item]) -> Vec<Pos2> {
    let mut columns: Vec<usize> = Vec::new();
    for (index, node) in file.nodes.iter().enumerate() {
        let before = |name: &str| file.nodes[..index].iter().position(|node| node.name.value == name);
        let sources = node.inputs.iter().filter_map(|input| before(&input.from.value.node));
        columns.push(sources.map(|source| columns[source] + 1).max().unwrap_or(0));
    }
    let count = columns.iter().max().map_or(0, |last| last + 1);
    let mut widths = vec![0.0_f32; count];
    for (item, column) in items.iter().zip(&columns) {
        widths[*column] = widths[*column].max(width(item));
    }
    let left = |column: usize| widths[..column].iter().map(|width| width + ALLEY).sum::<f32>();
    let mut heights = vec![0.0; count];
    let place = |(item, column): (&Item, &usize)| {
        let at = pos2(left(*column), heights[*column]);
        heights[*column] += BOX + ROW * item.inputs.len().max(item.outputs.len()) as f32 + GAP;
        at
    };
    items.iter().zip(&columns).map(place).collect()
}

/// About how wide a box is: its title with the milliseconds, or its longest pins side by side.
fn width(item: &Item) -> f32 {
    let longest = |pins: &[Pin]| pins.iter().map(|pin| pin.name.len()).max().unwrap_or(0);
    let letters = (longest(&item.inputs) + longest(&item.outputs)).max(item.name.len() + 8);
    RIM + LETTER * letters as f32
}

struct Canvas<'a> {
    session: &'a mut Session,
    search: &'a mut String,
    places: &'a mut HashMap<String, Pos2>,
}

impl Canvas<'_> {
    /// Milliseconds of a node, or of all nodes of a part.
    fn ms(&self, name: &str) -> Option<f32> {
        let graph = self.session.state.graph.as_ref()?;
        let prefix = format!("{name}/");
        let within = |step: &&str| *step == name || step.starts_with(&prefix);
        let times = graph.steps.iter().zip(&self.session.state.times);
        let times = times.filter(|(step, _)| step.node.as_deref().as_ref().is_some_and(within));
        times.map(|(_, ms)| *ms).reduce(|sum, ms| sum + ms)
    }

    fn is_selected(&self, name: &str) -> bool {
        let selected = self.session.selected.as_deref();
        selected.is_some_and(|selected| selected.split('/').next() == Some(name))
    }

    fn set_input(&mut self, node: &str, port: &str, source: Option<&Source>) {
        self.session.edit(Tag::Once, |file| file.set_input(node, port, source));
    }
}

/// One colour for each kind of element, so that wires that fit look alike.
fn pin_info(pin: &Pin) -> PinInfo {
    let color = match pin.fields.as_deref() {
        Some([only]) => match &only.element {
            Element::Texel(_) | Element::AnyFloatTexel => Color32::from_rgb(230, 180, 80),
            Element::Item { name, .. } if name == "u32" => Color32::from_rgb(120, 190, 220),
            Element::Item { .. } => Color32::from_rgb(150, 200, 120),
        },
        Some(_) => Color32::from_rgb(200, 130, 200),
        None => Color32::GRAY,
    };
    PinInfo::circle().with_fill(color).with_wire_color(color.gamma_multiply(0.8))
}

fn explain(pin: &Pin) -> String {
    let optional = if pin.optional { "; may stay without a wire" } else { "" };
    format!("{}\n{}{optional}", pin.doc, pin.words())
}

impl SnarlViewer<Item> for Canvas<'_> {
    fn title(&mut self, item: &Item) -> String {
        item.name.clone()
    }

    fn node_frame(
        &mut self,
        frame: Frame,
        node: NodeId,
        _: &[InPin],
        _: &[OutPin],
        snarl: &Snarl<Item>,
    ) -> Frame {
        if self.is_selected(&snarl[node].name) {
            frame.stroke(Stroke::new(2.0, theme::ACCENT))
        } else {
            frame
        }
    }

    fn show_header(&mut self, node: NodeId, _: &[InPin], _: &[OutPin], ui: &mut Ui, snarl: &mut Snarl<Item>) {
        let item = &snarl[node];
        let name = egui::RichText::new(&item.name);
        let name = if item.bypass { name.strikethrough().weak() } else { name.strong() };
        let doc = self.session.registry.get(&item.kind).map_or("a graph of its own", |kind| kind.doc());
        let title = ui.add(egui::Label::new(name).sense(Sense::click()).selectable(false));
        if title.on_hover_text(format!("{}: {doc}", item.kind)).clicked() {
            self.session.selected = Some(item.name.clone());
        }
        if let Some(ms) = self.ms(&item.name) {
            ui.weak(format!("{ms:.1} ms"));
        }
    }

    fn inputs(&mut self, item: &Item) -> usize {
        item.inputs.len()
    }

    fn show_input(&mut self, pin: &InPin, ui: &mut Ui, snarl: &mut Snarl<Item>) -> impl SnarlPin + 'static {
        let input = &snarl[pin.id.node].inputs[pin.id.input];
        let missing = pin.remotes.is_empty() && !input.optional;
        let text = egui::RichText::new(&input.name);
        let text = if missing { text.color(theme::BAD) } else { text };
        ui.add(egui::Label::new(text).extend()).on_hover_text(explain(input));
        pin_info(input)
    }

    fn outputs(&mut self, item: &Item) -> usize {
        item.outputs.len()
    }

    fn show_output(&mut self, pin: &OutPin, ui: &mut Ui, snarl: &mut Snarl<Item>) -> impl SnarlPin + 'static {
        let item = &snarl[pin.id.node];
        let output = &item.outputs[pin.id.output];
        let label = ui.add(egui::Label::new(&output.name).sense(Sense::click()).selectable(false).extend());
        if label.on_hover_text(format!("{}\nClick to see it", explain(output))).clicked() {
            self.session.wanted = Some(format!("{}.{}", item.name, output.name));
        }
        pin_info(output)
    }

    fn connect(&mut self, from: &OutPin, to: &InPin, snarl: &mut Snarl<Item>) {
        let (source, target) = (&snarl[from.id.node], &snarl[to.id.node]);
        let (output, input) = (&source.outputs[from.id.output], &target.inputs[to.id.input]);
        if !input.accepts(output) {
            let (given, taken) = (output.words(), input.words());
            let text =
                format!("{}.{} gives {given}, but {} takes {taken}", source.name, output.name, input.name);
            self.session.notice = Some(text);
            return;
        }
        let wire = Source { node: source.name.clone(), port: output.name.clone() };
        let (node, port) = (target.name.clone(), input.name.clone());
        self.set_input(&node, &port, Some(&wire));
    }

    fn disconnect(&mut self, _: &OutPin, to: &InPin, snarl: &mut Snarl<Item>) {
        self.drop_inputs(to, snarl);
    }

    fn drop_inputs(&mut self, to: &InPin, snarl: &mut Snarl<Item>) {
        let item = &snarl[to.id.node];
        let (node, port) = (item.name.clone(), item.inputs[to.id.input].name.clone());
        self.set_input(&node, &port, None);
    }

    fn drop_outputs(&mut self, _: &OutPin, _: &mut Snarl<Item>) {
        // Many wires at once go too easily by a slip; each can be taken off at its end.
    }

    fn has_node_menu(&mut self, _: &Item) -> bool {
        true
    }

    fn show_node_menu(
        &mut self,
        node: NodeId,
        _: &[InPin],
        _: &[OutPin],
        ui: &mut Ui,
        snarl: &mut Snarl<Item>,
    ) {
        let item = &snarl[node];
        let name = item.name.clone();
        if ui.button(if item.bypass { "Run it again" } else { "Bypass" }).clicked() {
            let bypass = !item.bypass;
            self.session.edit(Tag::Once, |file| file.set_bypass(&name, bypass));
            ui.close();
        }
        if ui.button("Delete").clicked() {
            self.session.edit(Tag::Once, |file| file.remove_node(&name));
            ui.close();
        }
    }

    fn has_graph_menu(&mut self, _: Pos2, _: &mut Snarl<Item>) -> bool {
        true
    }

    fn show_graph_menu(&mut self, pos: Pos2, ui: &mut Ui, snarl: &mut Snarl<Item>) {
        ui.add(egui::TextEdit::singleline(self.search).hint_text("Add a stage"));
        let kinds: Vec<(&str, &str)> =
            self.session.registry.kinds().map(|kind| (kind.name(), kind.doc())).collect();
        egui::ScrollArea::vertical().max_height(260.0).show(ui, |ui| {
            for (kind, doc) in kinds.into_iter().filter(|(kind, _)| kind.contains(self.search.as_str())) {
                if ui.button(kind).on_hover_text(doc).clicked() {
                    let taken = |name: &str| snarl.nodes().any(|item| item.name == name);
                    let names = (2..).map(|number| format!("{kind}{number}"));
                    let name = std::iter::once(kind.to_owned()).chain(names).find(|name| !taken(name));
                    let name = name.unwrap_or_default();
                    self.places.insert(name.clone(), pos);
                    self.session.edit(Tag::Once, |file| file.add_node(&name, kind));
                    self.session.selected = Some(name);
                    ui.close();
                }
            }
        });
    }
}
