//! The window: a toolbar, panes that can be dragged about, a line that says how things stand.

use eframe::{CreationContext, Frame};
use egui::{Context, Key, KeyboardShortcut, Modifiers, Ui};
use egui_tiles::{Container, Linear, LinearDir, Tile, TileId, Tiles, Tree};

use crate::{
    document::Document,
    engine::Options,
    panes::{Pane, Panes, Viewer},
    session::Session,
    status, theme, toolbar,
};

const UNDO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Z);
const REDO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
const SAVE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::S);

/// Shares of the window's width that the three columns take.
const COLUMNS: [f32; 3] = [0.26, 0.5, 0.24];
/// Shares of the right column's height: parameters, times.
const RIGHT: [f32; 2] = [0.55, 0.45];

/// The editor.
pub struct App {
    /// What the panes share.
    pub session: Session,
    tree: Tree<Pane>,
}

impl App {
    /// Opens a document on a scene.
    pub fn new(creation: &CreationContext, document: Document, options: Options) -> Self {
        theme::apply(&creation.egui_ctx);
        let context = creation.egui_ctx.clone();
        let session = Session::new(document, options, move || context.request_repaint());
        Self { session, tree: layout() }
    }

    fn shortcuts(&mut self, context: &Context) {
        // Taken before any widget sees them: a text field has an undo of its own.
        let pressed = |shortcut| context.input_mut(|input| input.consume_shortcut(shortcut));
        if pressed(&REDO) {
            self.session.document.redo();
        } else if pressed(&UNDO) {
            self.session.document.undo();
        }
        if pressed(&SAVE) {
            self.session.save();
        }
    }

    /// The viewers in the window.
    pub fn viewers(&self) -> impl Iterator<Item = &Viewer> {
        self.tree.tiles.iter().filter_map(|(_, tile)| match tile {
            Tile::Pane(Pane::Viewer(viewer)) => Some(viewer),
            _ => None,
        })
    }

    /// Shows a pane that lies behind another tab.
    pub fn show(&mut self, wanted: impl Fn(&Pane) -> bool) {
        self.tree.make_active(|_, tile| matches!(tile, Tile::Pane(pane) if wanted(pane)));
    }

    fn jump(&mut self) {
        if self.session.jump.is_some() {
            self.show(|pane| matches!(pane, Pane::Text(_)));
        }
    }

    fn title(&self) -> String {
        let star = if self.session.document.is_dirty() { "*" } else { "" };
        format!("{star}{} - Epigraph", self.session.document.path())
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _: &mut Frame) {
        self.shortcuts(ui.ctx());
        let mut watched: Vec<String> = self.viewers().map(|viewer| viewer.port.clone()).collect();
        watched.sort();
        self.session.sync(watched);
        ui.ctx().send_viewport_cmd(egui::ViewportCommand::Title(self.title()));

        egui::Panel::top("toolbar").show(ui, |ui| toolbar::show(ui, &mut self.session));
        egui::Panel::bottom("status").show(ui, |ui| status::show(ui, &mut self.session));
        self.jump();
        egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| {
            let mut panes = Panes { session: &mut self.session };
            self.tree.ui(&mut panes, ui);
        });
    }
}

/// The panes as they stand at first.
fn layout() -> Tree<Pane> {
    let mut tiles = Tiles::default();
    let left = [Pane::Nodes(Default::default()), Pane::Text(Default::default())];
    let left = left.into_iter().map(|pane| tiles.insert_pane(pane)).collect::<Vec<_>>();
    let left = tiles.insert_tab_tile(left);
    let middle = [Pane::Viewer(Viewer::default()), Pane::Canvas(Default::default())];
    let middle = middle.into_iter().map(|pane| tiles.insert_pane(pane)).collect::<Vec<_>>();
    let middle = tiles.insert_tab_tile(middle);
    let parameters = tabbed(&mut tiles, Pane::Parameters);
    let times = tabbed(&mut tiles, Pane::Times(Default::default()));
    let right = shares(&mut tiles, LinearDir::Vertical, &[parameters, times], &RIGHT);
    let root = shares(&mut tiles, LinearDir::Horizontal, &[left, middle, right], &COLUMNS);
    Tree::new("panes", root, tiles)
}

/// A pane alone under its tab, where others can be dropped.
fn tabbed(tiles: &mut Tiles<Pane>, pane: Pane) -> TileId {
    let pane = tiles.insert_pane(pane);
    tiles.insert_tab_tile(vec![pane])
}

fn shares(tiles: &mut Tiles<Pane>, direction: LinearDir, children: &[TileId], shares: &[f32]) -> TileId {
    let mut linear = Linear::new(direction, children.to_vec());
    for (child, share) in children.iter().zip(shares) {
        linear.shares.set_share(*child, *share);
    }
    tiles.insert_container(Container::Linear(linear))
}
