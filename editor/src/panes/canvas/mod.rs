//! The graph as boxes and wires, which the user can edit. The canvas is a projection of the document, rebuilt whenever
//! the document changes: every edit goes to the document first.
//!
//! [`model`] holds the graph, [`facts`] the engine's information about it, [`shape`] and [`arrange`] the sizes and
//! positions of boxes, [`route`] the paths of wires; none of these needs a window. [`sight`] combines them for one
//! frame of the window, [`paint`] draws it, [`hand`] handles mouse and keys, [`act`] edits the document.

mod act;
mod arrange;
mod facts;
mod hand;
mod menu;
mod model;
mod paint;
mod route;
mod search;
mod shape;
mod sight;
mod thumbnails;
mod vector;
mod view;
mod watch;

use std::{
    collections::{BTreeSet, HashMap},
    sync::Arc,
};

use egui::{
    Color32, FontId, Id, Key, Pos2, Rect, Sense, TextEdit, Ui, UiBuilder, Vec2, WidgetInfo, WidgetType, pos2,
    vec2,
};
use epigraph_core::{GraphFile, Snapshot};

use self::{
    facts::{PictureOf, contains},
    hand::Gesture,
    model::Model,
    paint::Brush,
    search::{Found, Search},
    shape::HEAD,
    sight::Sight,
    thumbnails::Thumbnails,
    view::View,
    watch::Watch,
};
use crate::{engine::GraphInfo, intent::Intent, session::Session};

/// Weight of new times in the running mean, so that they are readable.
const WEIGHT: f32 = 0.1;
/// Height of the row of buttons, and of the legend.
const HEADER: f32 = 30.0;
const LEGEND: f32 = 24.0;
/// Gap between boxes that have grown.
const ROOM: f32 = 14.0;

/// The canvas's own state.
pub struct CanvasPane {
    /// The address of the part that is shown; empty for the graph itself.
    part: String,
    shown: Option<Projected>,
    /// The path of the document that it shows.
    path: String,
    /// Automatic positions of boxes that the user has not placed, and the conditions they were computed for.
    auto: HashMap<String, Pos2>,
    arranged: Arranged,
    view: View,
    wants_fit: bool,
    selection: BTreeSet<String>,
    /// The session's selected node as last seen.
    seen: Option<String>,
    /// The selected wire, by the block and the input at its end.
    wire: Option<(String, String)>,
    gesture: Gesture,
    search: Option<Search>,
    renaming: Option<Renaming>,
    /// The last frame, and the smoothed milliseconds of the graph's steps.
    times: (u32, Vec<f32>),
    heat: bool,
    thumbnails: bool,
    images: Thumbnails,
    /// Ports whose values the thumbnails show.
    watched: Watch,
}

/// Blocks and wires, and their sources.
struct Projected {
    file: Arc<GraphFile>,
    graph: Option<Arc<GraphInfo>>,
    model: Arc<Model>,
}

/// The conditions of the last automatic arrangement. If they change, it is computed again.
#[derive(Clone, Debug, Default, PartialEq)]
struct Arranged {
    part: String,
    runs: bool,
    thumbnails: bool,
}

/// A node whose name is being typed.
struct Renaming {
    address: String,
    text: String,
    opened: bool,
}

impl Default for CanvasPane {
    fn default() -> Self {
        Self {
            part: String::new(),
            shown: None,
            path: String::new(),
            auto: HashMap::new(),
            arranged: Arranged::default(),
            view: View::default(),
            wants_fit: true,
            selection: BTreeSet::new(),
            seen: None,
            wire: None,
            gesture: Gesture::Idle,
            search: None,
            renaming: None,
            times: (0, Vec::new()),
            heat: true,
            thumbnails: false,
            images: Thumbnails::default(),
            watched: Watch::default(),
        }
    }
}

impl CanvasPane {
    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        let Some(file) = session.document.whole().cloned() else {
            ui.weak("The text has not been valid yet; fix it in the text pane.");
            return;
        };
        if self.path != session.document.path() {
            *self = Self {
                path: session.document.path().into(),
                heat: self.heat,
                thumbnails: self.thumbnails,
                ..Self::default()
            };
        }
        let Some(model) = self.model(&file, session) else { return };
        self.smooth(session);
        self.follow(session, &model);
        let mut sight = self.look(ui, session, &file, model);
        // The boxes are placed before the buttons are shown, as the buttons' actions need their positions.
        let whole = ui.available_rect_before_wrap();
        let pane = whole.with_min_y(whole.top() + HEADER);
        self.view.resize(pane.with_max_y((pane.bottom() - LEGEND).max(pane.top() + 1.0)));
        self.place(session, &mut sight);
        self.header(ui, session, &sight);

        let ground = ui.interact(self.view.pane, ui.id().with("canvas"), Sense::CLICK | Sense::DRAG);
        ground.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, "canvas"));
        ui.scope_builder(UiBuilder::new().max_rect(pane), |ui| {
            ui.set_clip_rect(pane.intersect(ui.clip_rect()));
            if std::mem::take(&mut self.wants_fit) {
                self.view.fit(sight.bounds());
            }
            let over = self.handle(ui, session, &sight, &ground);
            self.paint(ui, session, &sight, &over, pane);
            self.watch(ui, session, &sight);
            self.rename_field(ui, session, &sight);
            self.search_list(ui, session, &sight);
        });
    }

    /// Shows the contents of a part, or the graph itself.
    pub fn open(&mut self, part: String) {
        if part != self.part {
            self.part = part;
            self.shown = None;
            self.wants_fit = true;
            (self.wire, self.search, self.renaming) = (None, None, None);
        }
    }

    /// Blocks and wires of the current document.
    fn model(&mut self, file: &Arc<GraphFile>, session: &Session) -> Option<Arc<Model>> {
        let graph = session.state.graph.as_ref();
        if let Some(shown) = &self.shown
            && Arc::ptr_eq(&shown.file, file)
            && shown.graph.as_ref().map(Arc::as_ptr) == graph.map(Arc::as_ptr)
        {
            return Some(shown.model.clone());
        }
        let read = |part: &str| Model::new(file, part, &session.registry, graph.map(Arc::as_ref));
        let model = match read(&self.part) {
            Some(model) => model,
            // The part is gone.
            None => {
                self.part.clear();
                self.wants_fit = true;
                read("")?
            }
        };
        self.selection.retain(|address| model.block(address).is_some());
        let mut model = model;
        model.mark(session.document.differences());
        let model = Arc::new(model);
        self.shown = Some(Projected { file: file.clone(), graph: graph.cloned(), model: model.clone() });
        Some(model)
    }

    /// Takes over the selection of other panes.
    fn follow(&mut self, session: &Session, model: &Model) {
        if session.selected != self.seen {
            self.seen.clone_from(&session.selected);
            let selected = session.selected.as_deref();
            let blocks = model.blocks.iter().map(|block| &block.address);
            self.selection =
                blocks.filter(|block| selected.is_some_and(|node| contains(block, node))).cloned().collect();
        }
    }

    /// Updates the smoothed times with the last frame's.
    fn smooth(&mut self, session: &Session) {
        let (seen, times) = &mut self.times;
        let state = &session.state;
        if times.len() != state.times.len() {
            times.clone_from(&state.times);
        } else if *seen != state.frames {
            for (smooth, ms) in times.iter_mut().zip(&state.times) {
                *smooth += (ms - *smooth) * if *smooth == 0.0 { 1.0 } else { WEIGHT };
            }
        }
        *seen = state.frames;
    }

    fn look(&self, ui: &Ui, session: &Session, file: &GraphFile, model: Arc<Model>) -> Sight {
        let measure = |text: &str, size: f32| {
            let font = FontId::proportional(size);
            ui.fonts_mut(|fonts| fonts.layout_no_wrap(text.to_owned(), font, Color32::PLACEHOLDER).size().x)
        };
        let graph = session.state.graph.as_deref();
        let run = graph.map(|graph| (graph, &self.times.1[..]));
        Sight::new(model, file, run, self.thumbnails, &measure)
    }

    /// Gives every block a position: the user's, or an automatic one.
    fn place(&mut self, session: &Session, sight: &mut Sight) {
        let places = session.document.places().clone();
        let arranged = Arranged {
            part: self.part.clone(),
            runs: session.state.graph.is_some(),
            thumbnails: self.thumbnails,
        };
        let addresses = || sight.model.blocks.iter().map(|block| &block.address);
        if arranged != self.arranged {
            self.arranged = arranged;
            self.wants_fit |= addresses().all(|address| !places.contains_key(address));
            for address in addresses() {
                self.auto.remove(address);
            }
        }
        let known = |auto: &HashMap<String, Pos2>, address: &str| {
            places.get(address).map(|place| Pos2::from(*place)).or_else(|| auto.get(address).copied())
        };
        let placed: Vec<Option<Pos2>> = addresses().map(|address| known(&self.auto, address)).collect();
        if placed.contains(&None) {
            self.fill_in(sight, &placed);
        }
        let moving = match self.gesture {
            Gesture::Move(by) => by,
            _ => Vec2::ZERO,
        };
        let shift = |address: &str| if self.selection.contains(address) { moving } else { Vec2::ZERO };
        sight.place(|address| known(&self.auto, address).unwrap_or_default() + shift(address));
        if moving == Vec2::ZERO && self.spread(sight, &|address| places.contains_key(address)) {
            sight.place(|address| known(&self.auto, address).unwrap_or_default());
        }
    }

    /// Places the blocks without a position relative to a neighbour, as in the automatic arrangement.
    fn fill_in(&mut self, sight: &Sight, placed: &[Option<Pos2>]) {
        let arranged = sight.arranged(self.view.pane.size());
        let shift = |index: usize| {
            let wished = arranged.get(&sight.model.blocks[index].address)?;
            Some(placed[index]? - *wished)
        };
        let any = (0..placed.len()).find_map(shift).unwrap_or_default();
        for (index, block) in
            sight.model.blocks.iter().enumerate().filter(|(index, _)| placed[*index].is_none())
        {
            let beside = sight.model.neighbours(index).find_map(shift).unwrap_or(any);
            let wished = arranged.get(&block.address).copied().unwrap_or_default();
            self.auto.insert(block.address.clone(), wished + beside);
        }
    }

    /// Moves automatically placed boxes down if they overlap others after growing. Returns true if any moved.
    fn spread(&mut self, sight: &Sight, fixed: &dyn Fn(&str) -> bool) -> bool {
        let mut order: Vec<usize> = (0..sight.rects.len()).collect();
        order.sort_by(|a, b| sight.rects[*a].top().total_cmp(&sight.rects[*b].top()));
        let is_fixed = |index: &usize| fixed(&sight.model.blocks[*index].address);
        let mut done: Vec<Rect> =
            order.iter().filter(|index| is_fixed(index)).map(|index| sight.rects[*index]).collect();
        let mut moved = false;
        for index in order.into_iter().filter(|index| !is_fixed(index)) {
            let mut rect = sight.rects[index];
            while let Some(above) = done.iter().find(|above| above.expand(0.5 * ROOM).intersects(rect)) {
                rect = rect.translate(vec2(0.0, above.bottom() + ROOM - rect.top()));
                moved = true;
            }
            if rect != sight.rects[index] {
                self.auto.insert(sight.model.blocks[index].address.clone(), rect.min);
            }
            done.push(rect);
        }
        moved
    }

    fn paint(&mut self, ui: &Ui, session: &Session, sight: &Sight, over: &hand::Over, pane: Rect) {
        let problems = session.problems().iter().filter_map(|problem| problem.node.as_deref());
        let wrong = problems
            .filter_map(|node| sight.model.blocks.iter().position(|block| contains(&block.address, node)));
        let wrong: BTreeSet<usize> = wrong.collect();
        let marks = hand::marks(self, sight, over, &wrong);
        let painter = ui.painter_at(self.view.pane);
        let brush = Brush { painter: &painter, visuals: ui.visuals(), view: self.view };
        brush.ground();
        brush.wires(sight, &marks);
        for index in 0..sight.model.blocks.len() {
            brush.block(sight, index, &marks);
            self.thumbnail(&painter, sight, index);
        }
        for (index, (crossing, at)) in sight.crossings.iter().zip(&sight.chips).enumerate() {
            brush.chip(crossing, *at, over.chip == Some(index));
        }
        let pointer = ui.input(|input| input.pointer.latest_pos());
        if let (Some(held), Some(pointer)) = (marks.held, pointer) {
            brush.held_wire(sight, held, pointer);
        }
        if let (Gesture::Select(from, _), Some(pointer)) = (&self.gesture, pointer) {
            brush.selection(Rect::from_two_pos(*from, self.view.back(pointer)));
        }
        let view = View { pane: pane.with_min_y(self.view.pane.bottom()), ..self.view };
        let below = Brush { painter: &ui.painter_at(view.pane), view, ..brush };
        below.legend(self.heat.then(|| sight.hottest()), !sight.crossings.is_empty());
    }

    fn thumbnail(&self, painter: &egui::Painter, sight: &Sight, index: usize) {
        let Some((picture, rect)) = self.picture(sight, index) else { return };
        match self.images.get(&picture.port) {
            Some(texture) => {
                let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                painter.image(texture.id(), rect, whole, Color32::WHITE);
            }
            None => {
                painter.rect_filled(rect, 0.0, Color32::from_gray(24));
            }
        }
    }

    /// A block's thumbnail port, and its rectangle on screen.
    fn picture<'a>(&self, sight: &'a Sight, index: usize) -> Option<(&'a PictureOf, Rect)> {
        let (place, picture) = (sight.shapes[index].thumbnail?, sight.facts[index].picture.as_ref()?);
        Some((picture, self.view.rect(place.translate(sight.rects[index].min.to_vec2()))))
    }

    /// Requests the ports of the thumbnails, and takes their newest values.
    fn watch(&mut self, ui: &Ui, session: &mut Session, sight: &Sight) {
        if !self.thumbnails {
            self.watched = Watch::default();
            self.images.clear();
            return;
        }
        let pictures = (0..sight.model.blocks.len()).filter_map(|index| self.picture(sight, index));
        let ports: Vec<(&str, bool)> =
            pictures.map(|(of, rect)| (of.port.as_str(), rect.intersects(self.view.pane))).collect();
        if let Some(wait) = self.watched.see(ports.iter().copied(), ui.input(|input| input.time)) {
            ui.ctx().request_repaint_after_secs(wait as f32);
        }
        for port in self.watched.ports() {
            session.push(Intent::Watch(port.clone()));
        }
        let in_sight = |snapshot: &&Arc<Snapshot>| ports.contains(&(snapshot.name.as_str(), true));
        self.images.update(ui.ctx(), session.state.snapshots.iter().filter(in_sight));
    }

    fn rename_field(&mut self, ui: &mut Ui, session: &mut Session, sight: &Sight) {
        let Some(renaming) = &mut self.renaming else { return };
        let Some(block) = sight.model.block(&renaming.address) else {
            self.renaming = None;
            return;
        };
        let rect = self.view.rect(sight.rects[block]);
        let rect = rect.with_max_y(rect.top() + (HEAD * self.view.zoom).max(24.0)).with_min_x(rect.left());
        let size = vec2(rect.width().max(120.0), 24.0);
        let edit = TextEdit::singleline(&mut renaming.text).id(Id::new("rename"));
        let response = ui.put(Rect::from_min_size(rect.min, size), edit);
        response.widget_info(|| WidgetInfo::text_edit(true, "", &renaming.text, "new name"));
        if !std::mem::replace(&mut renaming.opened, true) {
            response.request_focus();
            return;
        }
        let escaped = ui.input(|input| input.key_pressed(Key::Escape));
        if response.lost_focus() || escaped {
            let (address, text) = (renaming.address.clone(), renaming.text.trim().to_owned());
            self.renaming = None;
            if !escaped {
                self.rename(session, sight, &address, &text);
            }
        }
    }

    fn search_list(&mut self, ui: &Ui, session: &mut Session, sight: &Sight) {
        let Some(mut search) = self.search.take() else { return };
        match search.show(ui, &session.registry) {
            Found::Open => self.search = Some(search),
            Found::Closed => {}
            Found::Kind(kind, port) => self.add(session, sight, &search, kind, port.as_deref()),
        }
    }
}
