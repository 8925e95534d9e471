//! The search box that adds a node by its name or description.

use egui::{Area, Button, Frame, Id, Key, Modifiers, Order, Pos2, ScrollArea, TextEdit, Ui};
use epigraph_core::{Declaration, Port, Registry};

use crate::document::Pin;

/// Width of the list, and its largest height.
const WIDTH: f32 = 320.0;
const HEIGHT: f32 = 300.0;

/// An open search.
pub struct Search {
    /// The position for the node, in points of the canvas.
    pub at: Pos2,
    /// The corner of the list, on screen.
    pub corner: Pos2,
    /// The pin whose wire the node will take: its block's address, whether it is an output, and the pin
    /// itself.
    pub wire: Option<(String, bool, Pin)>,
    text: String,
    row: usize,
    opened: bool,
}

/// The result of a search in a frame of the window.
pub enum Found {
    /// Still open.
    Open,
    /// Closed without a choice.
    Closed,
    /// A stage kind, and the port that takes the wire.
    Kind(&'static str, Option<String>),
}

/// A kind that matches.
struct Match {
    kind: &'static str,
    doc: &'static str,
    /// The port that takes the wire.
    port: Option<String>,
}

impl Search {
    /// A search for a node at a position.
    pub fn new(at: Pos2, corner: Pos2, wire: Option<(String, bool, Pin)>) -> Self {
        Self { at, corner, wire, text: String::new(), row: 0, opened: false }
    }

    /// Shows it.
    pub fn show(&mut self, ui: &Ui, registry: &Registry) -> Found {
        let pressed = |key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        // Handled before the text field sees them.
        if pressed(Key::Escape) {
            return Found::Closed;
        }
        let matches = self.matches(registry);
        let step =
            usize::from(pressed(Key::ArrowDown)) as isize - usize::from(pressed(Key::ArrowUp)) as isize;
        self.row = self.row.saturating_add_signed(step).min(matches.len().saturating_sub(1));
        let mut found = Found::Open;
        if pressed(Key::Enter)
            && let Some(chosen) = matches.get(self.row)
        {
            found = Found::Kind(chosen.kind, chosen.port.clone());
        }
        let room = ui.ctx().content_rect().max - egui::vec2(WIDTH + 24.0, HEIGHT + 60.0);
        let area = Area::new(Id::new("add a node")).order(Order::Foreground).fixed_pos(self.corner.min(room));
        let shown = area.show(ui.ctx(), |ui| {
            Frame::popup(ui.style()).show(ui, |ui| {
                ui.set_width(WIDTH);
                self.field(ui);
                if let Some((node, output, pin)) = &self.wire {
                    let what = if *output { "reads" } else { "writes" };
                    ui.weak(format!(
                        "Stages with a port that {what} {}, for {node}.{}",
                        pin.words(),
                        pin.name
                    ));
                }
                if matches.is_empty() {
                    ui.weak("No stage matches.");
                }
                ScrollArea::vertical().max_height(HEIGHT).auto_shrink([false, true]).show(ui, |ui| {
                    for (row, one) in matches.iter().enumerate() {
                        if self.entry(ui, row, one, step != 0) {
                            found = Found::Kind(one.kind, one.port.clone());
                        }
                    }
                });
            });
        });
        // The click that opened it does not close it.
        if self.opened && shown.response.clicked_elsewhere() {
            return Found::Closed;
        }
        self.opened = true;
        found
    }

    fn field(&mut self, ui: &mut Ui) {
        let edit = TextEdit::singleline(&mut self.text).hint_text("Add a stage: name or description");
        let field = ui.add(edit.desired_width(f32::INFINITY));
        if !self.opened {
            field.request_focus();
        }
        if field.changed() {
            self.row = 0;
        }
    }

    /// Shows a matching kind. Returns true if it was chosen.
    fn entry(&self, ui: &mut Ui, row: usize, one: &Match, scroll: bool) -> bool {
        let text = egui::RichText::new(one.kind).strong();
        let port = one.port.as_ref().map_or(String::new(), |port| format!("  {port}"));
        let button = Button::selectable(row == self.row, text).right_text(egui::RichText::new(port).weak());
        let response = ui.add(button.min_size(egui::vec2(WIDTH, 0.0)));
        response.widget_info(|| {
            egui::WidgetInfo::labeled(egui::WidgetType::Button, true, format!("add {}", one.kind))
        });
        if scroll && row == self.row {
            response.scroll_to_me(None);
        }
        let chosen = response.clicked();
        ui.add(egui::Label::new(egui::RichText::new(one.doc).weak().size(11.0)).wrap());
        chosen
    }

    /// The kinds that match, best first: those whose names begin with the query, whose names contain it, whose
    /// descriptions contain all of its words.
    fn matches(&self, registry: &Registry) -> Vec<Match> {
        let wanted = self.text.trim().to_lowercase();
        let mut matches: Vec<(usize, Match)> = Vec::new();
        for kind in registry.kinds() {
            let port = match &self.wire {
                None => None,
                Some((_, output, pin)) => {
                    match kind.declaration().and_then(|kind| fitting(&kind, pin, *output)) {
                        Some(port) => Some(port),
                        None => continue,
                    }
                }
            };
            if let Some(rank) = rank(&wanted, kind.name(), kind.doc()) {
                matches.push((rank, Match { kind: kind.name(), doc: kind.doc(), port }));
            }
        }
        matches.sort_by_key(|(rank, _)| *rank);
        matches.into_iter().map(|(_, found)| found).collect()
    }
}

/// How well a kind matches, 0 best; `None` if it does not.
fn rank(wanted: &str, name: &str, doc: &str) -> Option<usize> {
    let doc = doc.to_lowercase();
    match () {
        () if name.starts_with(wanted) => Some(0),
        () if name.contains(&wanted.replace(' ', "_")) => Some(1),
        () if wanted.split_whitespace().all(|word| name.contains(word) || doc.contains(word)) => Some(2),
        () => None,
    }
}

/// The first port of a kind that can be connected to a pin, required ones first.
fn fitting(kind: &Declaration, pin: &Pin, output: bool) -> Option<String> {
    let fits = |port: &&Port| {
        let own = Pin::of(port);
        if output { port.is_input() && own.accepts(pin) } else { port.is_output() && pin.accepts(&own) }
    };
    let mut ports: Vec<&Port> = kind.ports.iter().filter(fits).collect();
    ports.sort_by_key(|port| port.optional);
    ports.first().map(|port| port.name.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_before_descriptions() {
        let registry = epigraph_stages::registry();
        let mut search = Search::new(Pos2::ZERO, Pos2::ZERO, None);
        search.text = "cull".into();
        let found: Vec<&str> = search.matches(&registry).iter().map(|found| found.kind).collect();
        assert!(found.starts_with(&["depth_cull", "reach_cull"]), "{found:?}");
        search.text = "depth cu".into();
        assert_eq!(search.matches(&registry)[0].kind, "depth_cull");
        search.text = "no such stage".into();
        assert!(search.matches(&registry).is_empty());
        search.text.clear();
        assert_eq!(search.matches(&registry).len(), registry.kinds().count());
    }

    #[test]
    fn a_wire_leaves_only_stages_that_can_take_it() {
        let registry = epigraph_stages::registry();
        let fill = registry.get("fill").and_then(|kind| kind.declaration()).unwrap();
        let color = fill.ports.iter().find(|port| port.name == "color").map(Pin::of).unwrap();
        let search = Search::new(Pos2::ZERO, Pos2::ZERO, Some(("fill".into(), true, color)));
        let found = search.matches(&registry);
        let port =
            |kind: &str| found.iter().find(|found| found.kind == kind).and_then(|found| found.port.clone());
        assert_eq!(port("tonemap").as_deref(), Some("color"));
        assert!(port("silhouette").is_none() && port("mesh").is_none());
    }
}
