//! The window: a toolbar, movable panes, and a status line.

use std::sync::Arc;

use eframe::{CreationContext, Frame};
use egui::{Context, Key, KeyboardShortcut, Modifiers, Ui};
use egui_tiles::{Container, Linear, LinearDir, Tile, TileId, Tiles, Tree};
use epigraph::Registry;

use crate::{
    dialog::{Answer, Dialog},
    document::{Document, Sources},
    engine::{Command, Options},
    help,
    intent::{Ask, Intent},
    keyboard,
    offers::Offers,
    opening::Opening,
    panes::{Pane, Panes, TextPane, Viewer},
    session::{SCALES, Session},
    status,
    store::{Seen, Store, Stored},
    theme, toolbar, widgets,
};

const SHIFTED: Modifiers = Modifiers::COMMAND.plus(Modifiers::SHIFT);
const UNDO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Z);
const REDO: KeyboardShortcut = KeyboardShortcut::new(SHIFTED, Key::Z);
const SAVE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::S);
const COPY: KeyboardShortcut = KeyboardShortcut::new(SHIFTED, Key::C);
const HELP: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::F1);
const RECORD: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::F9);
const PLAY: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::F10);

const NEXT_PANE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::NONE, Key::F6);
const PANE_BEFORE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::SHIFT, Key::F6);

/// Keys that open a dialog.
const DIALOGS: [(KeyboardShortcut, Ask); 3] = [
    (KeyboardShortcut::new(SHIFTED, Key::S), Ask::SaveGraph),
    (KeyboardShortcut::new(Modifiers::COMMAND, Key::O), Ask::OpenGraph),
    (KeyboardShortcut::new(Modifiers::COMMAND, Key::E), Ask::SaveImage),
];

/// Shares of the window's width for the three columns.
const COLUMNS: [f32; 3] = [0.25, 0.49, 0.26];
/// Shares of the right column's height: parameters, times.
const RIGHT: [f32; 2] = [0.55, 0.45];

/// Ports that the number keys 1 to 9 recall.
pub type Slots = [Option<String>; 9];

/// The editor.
pub struct App {
    /// The state that panes share.
    pub session: Session,
    /// Ports on the number keys.
    pub slots: Slots,
    pub(crate) tree: Tree<Pane>,
    /// The viewer in use, by its id; it may have been closed since.
    pub(crate) used: u64,
    /// Number of viewers created so far.
    pub(crate) made: u64,
    /// Ports that panes watch, besides those that viewers show.
    pub(crate) watched: Vec<String>,
    pub(crate) dialog: Option<Dialog>,
    /// True if the help is open.
    pub(crate) help: bool,
    store: Option<Store>,
    /// Choices about unsaved changes.
    offers: Offers,
    /// When the files were last checked for changes, seconds of the window's time.
    looked: f64,
}

/// Seconds between checks of the files.
const REFRESH: f64 = 1.0;

const DIGITS: [Key; 9] =
    [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];

impl App {
    /// Opens a document on a scene, without restoring or saving a session.
    pub fn new(creation: &CreationContext, document: Document, options: Options) -> Self {
        let opening = Opening { document, options, stored: None, store: None, notice: None };
        Self::open(creation, opening, epigraph::registry())
    }

    /// Opens the window at the start of the program, with these kinds of stage.
    pub fn open(creation: &CreationContext, opening: Opening, registry: Registry) -> Self {
        let Opening { mut document, options, stored, store, notice } = opening;
        document.use_sources(Arc::new(Sources::new(&registry)));
        theme::apply(&creation.egui_ctx);
        widgets::publish(&creation.egui_ctx);
        let context = creation.egui_ctx.clone();
        let offers = Offers::new(store.as_ref().and_then(|store| store.recovery(&document)), &document);
        let mut session = Session::new(document, options, registry, move || context.request_repaint());
        if let Some(notice) = notice {
            session.tell(notice);
        }
        let mut tree = layout();
        let mut slots = Slots::default();
        if let Some(stored) = stored {
            session.settings.theme = stored.theme;
            session.settings.scale = stored.scale.clamp(*SCALES.start(), *SCALES.end());
            session.resize();
            if let Some(seen) = stored.seen {
                session.look_from(seen);
            }
            slots = stored.slots;
            tree = whole(stored.panes).unwrap_or(tree);
        }
        let mut app = Self {
            session,
            slots,
            tree,
            used: 0,
            made: 0,
            watched: Vec::new(),
            dialog: None,
            help: false,
            store,
            offers,
            looked: 0.0,
        };
        app.made = app.viewers().map(|viewer| viewer.id + 1).max().unwrap_or_default();
        app.used = app.viewers().map(|viewer| viewer.id).min().unwrap_or_default();
        app
    }

    fn shortcuts(&mut self, context: &Context) {
        // Consumed before any widget sees them, as text fields have an undo of their own.
        let pressed = |shortcut: &_| context.input_mut(|input| input.consume_shortcut(shortcut));
        if pressed(&HELP) {
            self.help = !self.help;
        }
        if self.dialog.is_some() {
            return;
        }
        // Shortcuts with more modifiers first: their keys would also match those with fewer.
        for (shortcut, ask) in &DIALOGS {
            if pressed(shortcut) {
                self.ask(*ask);
            }
        }
        if pressed(&COPY) {
            self.handle(context, Intent::CopyCommandLine);
        }
        if pressed(&RECORD) {
            self.session.toggle_recorder();
        }
        if pressed(&PLAY) {
            self.session.toggle_playback();
        }
        if pressed(&REDO) {
            self.session.document.redo();
        } else if pressed(&UNDO) {
            self.session.document.undo();
        }
        if pressed(&SAVE) {
            self.session.save();
        }
        for (slot, key) in DIGITS.into_iter().enumerate() {
            if pressed(&KeyboardShortcut::new(Modifiers::COMMAND, key)) {
                self.assign(slot);
            }
        }
        for (key, back) in [(PANE_BEFORE, true), (NEXT_PANE, false)] {
            if pressed(&key) {
                keyboard::next_pane(context, &self.tree, back);
            }
        }
        if context.egui_wants_keyboard_input() && !keyboard::is_on_pane(context, &self.tree) {
            return;
        }
        let pressed = |key| context.input(|input| input.key_pressed(key) && input.modifiers.is_none());
        if let Some(slot) = DIGITS.into_iter().position(pressed) {
            self.recall(slot);
        }
        if pressed(Key::Space) {
            self.session.engine.send(Command::Pause(!self.session.state.paused));
        }
        if pressed(Key::Period) && self.session.state.paused {
            self.session.engine.send(Command::Step(1));
        }
        if pressed(Key::Home) {
            self.session.move_camera(|rig| rig.go_home());
        }
    }

    /// True if the picture of a visible viewer is stale.
    pub fn is_drawing(&self) -> bool {
        self.tree.active_tiles().into_iter().any(|tile| match self.tree.tiles.get(tile) {
            Some(Tile::Pane(Pane::Viewer(viewer))) => viewer.is_behind(),
            _ => false,
        })
    }

    /// Switches to another graph. Unsaved changes of the previous one are kept until it is opened again.
    pub fn go_on(&mut self, mut document: Document) {
        self.keep();
        document.use_sources(self.session.document.sources().clone());
        if let Some(store) = &mut self.store {
            store.change_document();
        }
        let recovery = self.store.as_ref().and_then(|store| store.recovery(&document));
        self.offers = Offers::new(recovery, &document);
        self.session.open(document);
        self.slots = Slots::default();
        self.show_port(String::new());
    }

    /// Saves the session for the next start of the program.
    fn keep(&mut self) {
        let Some(store) = &mut self.store else { return };
        // The unsaved changes of the last session must not be overwritten before the user has decided about them.
        if !self.offers.has_recovery() {
            store.keep_unsaved(&self.session.document);
        }
        let (session, settings) = (&self.session, &self.session.settings);
        store.keep_session(&Stored {
            graph: session.document.path().into(),
            scene: session.scene().into(),
            seen: session.camera().map(|camera| Seen {
                scene: session.scene().into(),
                eye: camera.eye,
                rotation: camera.rotation,
            }),
            size: settings.size,
            scale: settings.scale,
            samples: settings.samples,
            backend: settings.backend,
            pacing: settings.pacing,
            theme: settings.theme,
            slots: self.slots.clone(),
            panes: &self.tree,
        });
    }

    /// Brings a pane to the front if another tab hides it.
    pub fn show(&mut self, wanted: impl Fn(&Pane) -> bool) {
        self.tree.make_active(|_, tile| matches!(tile, Tile::Pane(pane) if wanted(pane)));
    }

    fn refresh(&mut self, context: &Context) {
        let now = context.input(|input| input.time);
        if now - self.looked > REFRESH {
            self.looked = now;
            self.session.refresh();
            self.offers.refresh(&self.session.document);
            self.keep();
        }
        context.request_repaint_after_secs(REFRESH as f32);
    }

    /// The ports that panes, viewers and the dialog watch. Clears the panes' list.
    fn take_watched(&mut self) -> Vec<String> {
        let mut watched = std::mem::take(&mut self.watched);
        watched.extend(self.viewers().flat_map(Viewer::watched));
        watched.extend(self.dialog.iter().filter_map(Dialog::watched));
        watched
    }

    /// Shows the open dialog, and carries out its action.
    fn dialog(&mut self, ui: &Ui) {
        let Some(mut dialog) = self.dialog.take() else { return };
        match dialog.show(ui, &self.known(&dialog)) {
            Answer::Open => self.dialog = Some(dialog),
            Answer::Cancel => {}
            Answer::Accept => {
                if let Err(error) = self.perform(&dialog) {
                    dialog.fail(error);
                    self.dialog = Some(dialog);
                }
            }
        }
    }

    fn title(&self) -> String {
        let star = if self.session.document.is_dirty() { "*" } else { "" };
        format!("{star}{} - Epigraph", self.session.document.path())
    }
}

impl eframe::App for App {
    fn on_exit(&mut self) {
        self.keep();
    }

    fn ui(&mut self, ui: &mut Ui, _: &mut Frame) {
        let theme = self.session.settings.theme;
        if ui.ctx().options(|options| options.theme_preference) != theme {
            ui.ctx().set_theme(theme);
        }
        self.shortcuts(ui.ctx());
        self.refresh(ui.ctx());
        let watched = self.take_watched();
        self.session.sync(watched, ui.input(|input| input.time));
        if let Some(viewer) = self.viewer_in_use_mut() {
            viewer.take_dropped(ui);
        }
        ui.ctx().send_viewport_cmd(egui::ViewportCommand::Title(self.title()));

        egui::Panel::top("toolbar").show(ui, |ui| toolbar::show(ui, &mut self.session));
        egui::Panel::bottom("status").show(ui, |ui| status::show(ui, &mut self.session));
        self.offers.show(ui, &mut self.session.document, self.store.as_mut());
        egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| {
            let viewers = self.viewers().count();
            self.tree.ui(&mut Panes { session: &mut self.session, viewers }, ui);
        });
        for intent in self.session.take_intents() {
            self.handle(ui.ctx(), intent);
        }
        self.dialog(ui);
        help::show(ui.ctx(), &mut self.help);
    }
}

/// The panes of a session, unless one is missing that the user could not open again.
fn whole(tree: Tree<Pane>) -> Option<Tree<Pane>> {
    let kinds = |tree: &Tree<Pane>| -> Vec<_> {
        let panes = tree.tiles.iter().filter_map(|(_, tile)| match tile {
            Tile::Pane(pane) => Some(std::mem::discriminant(pane)),
            Tile::Container(_) => None,
        });
        panes.collect()
    };
    let there = kinds(&tree);
    (tree.root.is_some() && kinds(&layout()).iter().all(|kind| there.contains(kind))).then_some(tree)
}

/// The default layout of the panes.
pub(crate) fn layout() -> Tree<Pane> {
    let mut tiles = Tiles::default();
    let left = [
        Pane::Nodes(Default::default()),
        Pane::Text(Default::default()),
        Pane::Shader(TextPane::shaders()),
        Pane::Inspector(Default::default()),
    ];
    let left = left.into_iter().map(|pane| tiles.insert_pane(pane)).collect::<Vec<_>>();
    let left = tiles.insert_tab_tile(left);
    let middle = [Pane::Viewer(Box::default()), Pane::Canvas(Default::default())];
    let middle = middle.into_iter().map(|pane| tiles.insert_pane(pane)).collect::<Vec<_>>();
    let middle = tiles.insert_tab_tile(middle);
    let parameters = tabbed(&mut tiles, Pane::Parameters);
    let times = tabbed(&mut tiles, Pane::Times(Default::default()));
    let right = shares(&mut tiles, LinearDir::Vertical, &[parameters, times], &RIGHT);
    let root = shares(&mut tiles, LinearDir::Horizontal, &[left, middle, right], &COLUMNS);
    Tree::new("panes", root, tiles)
}

/// Puts a single pane under a tab, so that other tabs can be dropped there.
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
