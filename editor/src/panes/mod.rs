//! The panes, one file each.

mod canvas;
mod inspector;
mod nodes;
mod parameters;
mod text;
mod times;
pub mod viewer;

pub use canvas::CanvasPane;
use egui::{Ui, WidgetText};
use egui_tiles::{Behavior, SimplificationOptions, Tabs, Tile, TileId, Tiles, UiResponse};
pub use inspector::InspectorPane;
pub use nodes::NodesPane;
use serde::{Deserialize, Serialize};
pub use text::{Language, TextPane};
pub use times::TimesPane;
pub use viewer::Viewer;

use crate::{intent::Intent, keyboard, session::Session};

/// The contents of a tile. Sessions save the settings that are not skipped.
#[derive(Serialize, Deserialize)]
pub enum Pane {
    /// An image.
    Viewer(Box<Viewer>),
    /// The list of nodes.
    Nodes(#[serde(skip)] NodesPane),
    /// The selected node's parameters.
    Parameters,
    /// The graph's text.
    Text(#[serde(skip)] TextPane),
    /// The graph as boxes and wires.
    Canvas(#[serde(skip)] Box<CanvasPane>),
    /// The texts of the graph's shaders.
    Shader(#[serde(skip, default = "TextPane::shaders")] TextPane),
    /// One pixel, traced through the graph.
    Inspector(#[serde(skip)] InspectorPane),
    /// The times of the nodes.
    Times(#[serde(skip)] TimesPane),
}

/// The panes of a session.
pub struct Panes<'a> {
    /// Their shared state.
    pub session: &'a mut Session,
    /// Number of viewers; the last one cannot be closed.
    pub viewers: usize,
}

impl Behavior<Pane> for Panes<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, tile: TileId, pane: &mut Pane) -> UiResponse {
        keyboard::pane(ui, tile, self.tab_title_for_pane(pane).text());
        let frame = egui::Frame::new().inner_margin(6).fill(ui.visuals().panel_fill);
        frame.show(ui, |ui| {
            // The frame fills the tile, even if the pane's contents do not.
            ui.set_min_size(ui.available_size());
            match pane {
                Pane::Viewer(viewer) => viewer.show(ui, self.session),
                Pane::Nodes(nodes) => nodes.show(ui, self.session),
                Pane::Parameters => parameters::show(ui, self.session),
                Pane::Text(text) | Pane::Shader(text) => text.show(ui, self.session),
                Pane::Canvas(canvas) => canvas.show(ui, self.session),
                Pane::Inspector(inspector) => inspector.show(ui, self.session),
                Pane::Times(times) => times.show(ui, self.session),
            }
        });
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &Pane) -> WidgetText {
        match pane {
            Pane::Viewer(viewer) if viewer.port.is_empty() => "View".into(),
            Pane::Viewer(viewer) => viewer.port.clone().into(),
            Pane::Nodes(_) => "Nodes".into(),
            Pane::Parameters => "Parameters".into(),
            Pane::Text(_) => "Text".into(),
            Pane::Shader(_) => "Shader".into(),
            Pane::Canvas(_) => "Canvas".into(),
            Pane::Inspector(_) => "Pixel".into(),
            Pane::Times(_) => "Times".into(),
        }
    }

    fn is_tab_closable(&self, tiles: &Tiles<Pane>, tile: TileId) -> bool {
        self.viewers > 1 && matches!(tiles.get(tile), Some(Tile::Pane(Pane::Viewer(_))))
    }

    fn tab_bar_trailing_ui(&mut self, tiles: &Tiles<Pane>, ui: &mut Ui, tile: TileId, tabs: &Tabs) {
        let is_viewer = |tile: &TileId| matches!(tiles.get(*tile), Some(Tile::Pane(Pane::Viewer(_))));
        if tabs.children.iter().any(is_viewer) {
            ui.add_space(4.0);
            let more = ui.add(egui::Button::new("+ View").frame(false));
            if more.on_hover_text("Add a view; drag its tab to put it beside this one").clicked() {
                self.session.push(Intent::AddViewer(tile));
            }
        }
    }

    fn simplification_options(&self) -> SimplificationOptions {
        // A single pane keeps its tab, so that other tabs can be dropped on it.
        SimplificationOptions { all_panes_must_have_tabs: true, ..SimplificationOptions::default() }
    }

    fn gap_width(&self, _: &egui::Style) -> f32 {
        4.0
    }
}
