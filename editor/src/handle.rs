//! Handling of the requests that panes made while they were drawn.

use egui::Context;
use egui_tiles::{Container, Tile, TileId};

use crate::{
    app::{App, layout},
    intent::{Intent, Jump},
    output::CommandLine,
    panes::{Language, Pane, Viewer},
};

impl App {
    /// Carries out a pane's request.
    pub(crate) fn handle(&mut self, context: &Context, intent: Intent) {
        match intent {
            Intent::Show(port) => self.show_port(port),
            Intent::Jump(jump) => self.jump(jump),
            Intent::Ask(ask) => self.ask(ask),
            Intent::Inspect(pixel) => {
                self.session.inspection.pick(pixel);
                self.show(|pane| matches!(pane, Pane::Inspector(_)));
            }
            Intent::Watch(port) => self.watched.push(port),
            Intent::Use(viewer) => self.used = viewer,
            Intent::AddViewer(tile) => self.add_viewer(tile),
            Intent::CopyCommandLine => self.copy_command_line(context),
            Intent::ResetPanes => self.tree = layout(),
            Intent::Help => self.help = true,
        }
    }

    /// The viewers in the window.
    pub fn viewers(&self) -> impl Iterator<Item = &Viewer> {
        self.tree.tiles.tiles().filter_map(|tile| match tile {
            Tile::Pane(Pane::Viewer(viewer)) => Some(viewer.as_ref()),
            _ => None,
        })
    }

    /// The viewer in use; if it was closed, the oldest one.
    pub fn viewer_in_use(&self) -> Option<&Viewer> {
        self.viewers().min_by_key(|viewer| (viewer.id != self.used, viewer.id))
    }

    /// The viewer in use, mutable.
    pub(crate) fn viewer_in_use_mut(&mut self) -> Option<&mut Viewer> {
        let used = self.used;
        let viewers = self.tree.tiles.tiles_mut().filter_map(|tile| match tile {
            Tile::Pane(Pane::Viewer(viewer)) => Some(viewer.as_mut()),
            _ => None,
        });
        viewers.min_by_key(|viewer| (viewer.id != used, viewer.id))
    }

    /// The port in the viewer in use; empty for the graph's first output.
    pub fn port_in_view(&self) -> &str {
        self.viewer_in_use().map_or("", |viewer| &viewer.port)
    }

    pub(crate) fn show_port(&mut self, port: String) {
        let Some(viewer) = self.viewer_in_use_mut() else { return };
        viewer.choose(port);
        let id = viewer.id;
        self.used = id;
        self.show(|pane| matches!(pane, Pane::Viewer(viewer) if viewer.id == id));
    }

    fn jump(&mut self, jump: Jump) {
        let language = Language::of(&jump.path);
        let is_meant = |pane: &Pane| match pane {
            Pane::Text(text) | Pane::Shader(text) => text.language == language,
            _ => false,
        };
        self.show(is_meant);
        for tile in self.tree.tiles.tiles_mut() {
            if let Tile::Pane(pane) = tile
                && is_meant(pane)
                && let Pane::Text(text) | Pane::Shader(text) = pane
            {
                text.jump(jump.clone());
            }
        }
    }

    fn add_viewer(&mut self, to: TileId) {
        let viewer = Viewer::new(self.made, self.port_in_view().to_owned());
        self.made += 1;
        self.used = viewer.id;
        let tile = self.tree.tiles.insert_pane(Pane::Viewer(Box::new(viewer)));
        if let Some(Tile::Container(Container::Tabs(tabs))) = self.tree.tiles.get_mut(to) {
            tabs.add_child(tile);
            tabs.set_active(tile);
        }
    }

    /// The command line that renders the picture in view.
    ///
    /// # Errors
    /// The graph or the path must be saved first, or no frame has run yet.
    pub fn command_line(&self) -> Result<CommandLine, String> {
        self.session.command_line(self.port_in_view())
    }

    /// Copies the command line to the clipboard, or reports why there is none.
    fn copy_command_line(&mut self, context: &Context) {
        let notice = match self.command_line() {
            Ok(line) => {
                context.copy_text(line.to_string());
                "copied the command line to the clipboard".into()
            }
            Err(error) => error,
        };
        self.session.tell(notice);
    }

    /// Assigns the port in view to a number key.
    pub(crate) fn assign(&mut self, slot: usize) {
        let port = self.port_in_view().to_owned();
        let shown = if port.is_empty() { "the output" } else { &port };
        self.session.tell(format!("key {} now shows {shown}", slot + 1));
        self.slots[slot] = Some(port);
    }

    /// Shows the port assigned to a number key.
    pub(crate) fn recall(&mut self, slot: usize) {
        match self.slots[slot].clone() {
            Some(port) => self.show_port(port),
            None => {
                let key = slot + 1;
                self.session
                    .tell(format!("key {key} has no port yet; Ctrl+{key} assigns the port in view to it"));
            }
        }
    }
}
