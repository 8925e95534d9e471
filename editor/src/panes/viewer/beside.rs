//! The comparison with another graph: the choice of the graph, and its cost.

use std::sync::Arc;

use egui::{ComboBox, TextEdit, Ui, WidgetInfo, WidgetType};
use epigraph_core::Snapshot;

use crate::{engine::State, files::short, name::Named, session::Session, theme};

/// The choice of the graph, and the frame times of both.
pub fn row(ui: &mut Ui, session: &mut Session) {
    ui.horizontal_wrapped(|ui| {
        let saved = format!("{} as saved", short(session.document.path()));
        let beside = &mut session.beside;
        let mut chosen = beside.path.clone();
        let shown = chosen.as_deref().map_or(saved.as_str(), short);
        let combo = ComboBox::from_id_salt("beside").selected_text(shown).width(190.0).height(420.0);
        let response = combo.show_ui(ui, |ui| {
            ui.selectable_value(&mut chosen, None, &saved).on_hover_text(
                "Compare with the saved graph, to see the effect of your changes on picture and cost",
            );
            for choice in beside.choices() {
                ui.selectable_value(&mut chosen, Some(choice.text.clone()), short(&choice.text))
                    .on_hover_text(&choice.doc);
            }
        });
        response
            .response
            .named(WidgetType::ComboBox, "Graph beside")
            .on_hover_text("The graph to compare with");
        beside.path = chosen;
        let changes = TextEdit::singleline(&mut beside.changes).hint_text("+sigma=0.5").desired_width(140.0);
        let changes = ui.add(changes).on_hover_text(
            "Changes to that graph, as they follow a graph's name on the command line: +view/cull.threshold=0.1, \
             +swap:spread=mine.wgsl, +insert:tonemap.color=median.wgsl, +wire:tonemap.color=spread.color",
        );
        changes.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Changes to the graph beside"));
        if let (None, Some(other)) = (beside.trouble(), &session.state.other)
            && other.graph.is_some()
        {
            let doc = "Frame times of this graph and of the other";
            ui.weak("frame").on_hover_text(doc);
            let (own, other) = (session.state.frame_ms, other.frame_ms);
            ui.label(format!("{own:.1} ms, other {other:.1} ms")).on_hover_text(doc);
        }
    });
    if let Some(trouble) = session.beside.trouble() {
        ui.colored_label(theme::palette(ui).bad, trouble);
    }
}

/// The output of the graph beside at the port of that name, else its first output; `None` until it has run a frame.
///
/// # Errors
/// The reason why it does not run.
pub fn image(state: &State, port: &str) -> Result<Option<Arc<Snapshot>>, String> {
    let Some(other) = &state.other else { return Ok(None) };
    if let Some(trouble) = &other.trouble {
        return Err(format!("{} does not run: {trouble}", short(&other.path)));
    }
    let output = other.graph.as_ref().and_then(|graph| graph.outputs.first());
    let named = |name: &str| other.snapshots.iter().find(|snapshot| snapshot.name == name);
    let image = named(port).or_else(|| output.and_then(|(name, _)| named(name)));
    Ok(image.cloned())
}

/// The label of the graph beside and its port.
pub fn name(state: &State, image: &Snapshot) -> String {
    let graph = state.other.as_ref().map_or("", |other| short(&other.path));
    format!("{graph}: {}", image.name)
}
