//! The row above the canvas, and the context menu of a block.

use egui::{Button, RichText, Ui};
use epigraph_core::{Difference, Side};

use super::{CanvasPane, model::Role, sight::Sight};
use crate::{
    document::{Tag, fitting, home, swap, write},
    files::short,
    intent::{Ask, Intent, Jump},
    session::Session,
    theme,
};

impl CanvasPane {
    /// The path to the open part, and the actions on the whole canvas.
    pub(super) fn header(&mut self, ui: &mut Ui, session: &mut Session, sight: &Sight) {
        ui.horizontal(|ui| {
            self.breadcrumb(ui, session);
            changes(ui, session);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                export(ui, session, sight);
                let thumbnails = ui.selectable_label(self.thumbnails, "Thumbnails");
                if thumbnails.on_hover_text("Show each node's output as a small live image. Copying the visible ones takes a little time in each frame").clicked() {
                    self.thumbnails = !self.thumbnails;
                }
                let heat = ui.selectable_label(self.heat, "Cost");
                if heat.on_hover_text("Tint nodes by their milliseconds").clicked() {
                    self.heat = !self.heat;
                }
                if ui.button("Fit").on_hover_text("Show the whole graph (F)").clicked() {
                    self.wants_fit = true;
                }
                if ui.button("Arrange").on_hover_text("Arrange all boxes along the wires").clicked() {
                    self.arrange(session, sight);
                }
                if ui.button("+ Add").on_hover_text("Add a stage; right click the background to add it at the pointer").clicked() {
                    self.search_at(self.view.pane.center());
                }
            });
        });
    }

    fn breadcrumb(&mut self, ui: &mut Ui, session: &Session) {
        ui.spacing_mut().item_spacing.x = 4.0;
        let name = short(session.document.path()).to_owned();
        if self.part.is_empty() {
            ui.label(RichText::new(name).strong());
            return;
        }
        let mut target = None;
        if ui.link(name).on_hover_text("Back to the whole graph; Backspace goes up one level").clicked() {
            target = Some(String::new());
        }
        let parts: Vec<&str> = self.part.split('/').collect();
        for (index, part) in parts.iter().enumerate() {
            ui.weak("/");
            if index + 1 == parts.len() {
                ui.label(RichText::new(*part).strong());
            } else if ui.link(*part).clicked() {
                target = Some(parts[..=index].join("/"));
            }
        }
        if let Some(target) = target {
            self.open(target);
        }
    }

    /// The actions on a block, and on all selected ones.
    pub(super) fn block_menu(&mut self, ui: &mut Ui, session: &mut Session, sight: &Sight, index: usize) {
        let block = &sight.model.blocks[index];
        if block.role == Role::Part && ui.button("Open").on_hover_text("Double click").clicked() {
            self.open(block.address.clone());
            ui.close();
        }
        let several = self.selection.len() > 1;
        if block.role == Role::Stage {
            let label = if block.bypass { "Run again" } else { "Bypass" };
            let hint = "Pass its input through as its output, if the types fit (B)";
            if ui.button(label).on_hover_text(hint).clicked() {
                self.bypass(session, sight);
                ui.close();
            }
        }
        if block.is_node() {
            if ui.add_enabled(!several, Button::new("Rename").shortcut_text("F2")).clicked() {
                self.start_renaming(block);
                ui.close();
            }
            if ui.add(Button::new("Duplicate").shortcut_text("Ctrl+D")).clicked() {
                self.duplicate(session, sight);
                ui.close();
            }
        }
        if block.role == Role::Stage {
            let address = block.address.clone();
            ui.menu_button("Swap for", |ui| swap_menu(ui, session, &address, &block.kind));
            ui.menu_button("Run on", |ui| side_menu(ui, session, &address));
        }
        if block.is_node() {
            ui.separator();
            if ui.add(Button::new("Delete").shortcut_text("Del")).clicked() {
                self.delete(session, sight);
                ui.close();
            }
        }
    }
}

/// What the graph changes in its base: a list to go through.
fn changes(ui: &mut Ui, session: &mut Session) {
    let Some(base) = session.document.base().map(str::to_owned) else { return };
    let differences = session.document.differences().clone();
    let count = match differences.len() {
        1 => "1 change".to_owned(),
        count => format!("{count} changes"),
    };
    let text = RichText::new(format!("{count} to {}", short(&base))).color(theme::palette(ui).changed);
    let menu = ui.menu_button(text, |ui| {
        for found in differences.iter() {
            let Difference { node, what, .. } = found;
            let of_graph = node.is_empty();
            let text = if of_graph { what.to_string() } else { format!("{node}: {what}") };
            if ui.button(text).clicked() {
                if node != "outputs" {
                    session.selected = (!of_graph).then(|| node.clone());
                }
                if let Some(file) = session.document.file() {
                    let place = file.place(found.span);
                    session.push(Intent::Jump(Jump { path: place.file, at: (place.line, place.column) }));
                }
                ui.close();
            }
        }
        if differences.is_empty() {
            ui.weak("It is the base so far: edits of its nodes are written here as changes.");
        }
        ui.separator();
        if ui.button("Write out in full …").clicked() {
            session.push(Intent::Ask(Ask::FullGraph));
            ui.close();
        }
    });
    menu.response.on_hover_text("The graph holds only what differs from its base; marked boxes are changed");
}

/// The stages that fit a node's wires.
fn swap_menu(ui: &mut Ui, session: &mut Session, address: &str, present: &str) {
    let Some(file) = session.document.whole().cloned() else { return };
    let kinds: Vec<&str> =
        fitting(&file, address, &session.registry).into_iter().filter(|kind| *kind != present).collect();
    if kinds.is_empty() {
        ui.weak("No other stage fits its wires.");
    }
    for kind in kinds {
        let doc = session.registry.get(kind).map_or("", |kind| kind.doc());
        if ui.button(kind).on_hover_text(doc).clicked() {
            let registry = session.registry.clone();
            session.edit(Tag::Once, |file| swap(file, address, kind, &registry));
            ui.close();
        }
    }
}

fn side_menu(ui: &mut Ui, session: &mut Session, address: &str) {
    let Some(file) = session.document.whole().cloned() else { return };
    let node = file.node_at(address).map(|(node, _)| node);
    let present = node.and_then(|node| node.on.as_ref()).map(|on| on.value);
    for (on, label) in [(None, "the toolbar's backend"), (Some(Side::Cpu), "CPU"), (Some(Side::Gpu), "GPU")] {
        if ui.selectable_label(on == present, label).clicked() {
            session
                .edit(Tag::Once, |file| home(file, address).and_then(|(file, name)| file.set_on(name, on)));
            ui.close();
        }
    }
}

/// Writes the graph as a drawing.
fn export(ui: &mut Ui, session: &mut Session, sight: &Sight) {
    let menu = ui.menu_button("Export", |ui| {
        let path = std::path::PathBuf::from(session.document.path());
        let graph = session.state.graph.clone();
        let mut save = |ending: &str, text: &str| {
            let path = path.with_extension(ending);
            session.tell(match write(&path, text) {
                Ok(()) => format!("written to {}", path.display()),
                Err(problems) => problems.to_string(),
            });
        };
        let svg = format!("As {}", short(&path.with_extension("svg").display().to_string()));
        if ui.button(svg).on_hover_text("Draw this canvas to a file beside the graph").clicked() {
            save("svg", &super::vector::svg(sight));
            ui.close();
        }
        let dot = format!("As {}", short(&path.with_extension("dot").display().to_string()));
        let button = ui.add_enabled(graph.is_some(), Button::new(dot));
        if button.on_hover_text("Write the running plan for Graphviz, like `epigraph check --dot`").clicked()
        {
            save("dot", graph.as_ref().map_or("", |graph| &graph.dot));
            ui.close();
        }
    });
    menu.response.on_hover_text("Write the graph as a drawing");
}
