//! Mouse and key input on the canvas.

use std::collections::BTreeSet;

use egui::{
    CursorIcon, EventFilter, Id, Key, KeyboardShortcut, Modifiers, PointerButton, Pos2, Rect, Response,
    Sense, Ui, Vec2, WidgetInfo, WidgetType, vec2,
};

use epigraph_pictures::readable;

use super::{
    CanvasPane,
    facts::{Crossing, Facts},
    model::{Block, PinRef, Role},
    paint::{Marks, PIN_RADIUS, chip_rect, milliseconds},
    route,
    search::Search,
    shape::{HEAD, ROW},
    sight::Sight,
};
use crate::{
    document::{Pin, Tag, nodes},
    intent::Intent,
    session::Session,
    theme,
};

/// Zoom per point of scrolling, in doublings.
const WHEEL: f32 = 1.0 / 180.0;
/// Largest distance at which the pointer hits a wire, points on screen.
const NEAR: f32 = 6.0;
/// Distance that the arrow keys move blocks; less with shift.
const STRIDES: [f32; 2] = [16.0, 2.0];
/// Least size of a pin's hit area.
const TOUCH: f32 = 7.0;

/// The pointer's action.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Gesture {
    /// Nothing.
    #[default]
    Idle,
    /// Moves the selected blocks by this offset so far.
    Move(Vec2),
    /// Draws a selection box from this point of the canvas. The blocks in it are added to the set.
    Select(Pos2, BTreeSet<String>),
    /// Draws a wire.
    Wire(Held),
}

/// A wire being dragged. It refers to blocks and pins by name, as the document may change meanwhile.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// The block of the fixed pin.
    address: String,
    /// True if that is an output.
    output: bool,
    /// The name of the fixed pin.
    port: String,
    /// The input that it was disconnected from: block and port.
    taken: Option<(String, String)>,
}

impl Held {
    /// The fixed pin.
    pub fn pin(&self, sight: &Sight) -> Option<PinRef> {
        sight.model.pin(&self.address, self.output, &self.port)
    }
}

/// The item under the pointer.
#[derive(Default)]
pub struct Over {
    /// A block.
    pub block: Option<usize>,
    /// A wire.
    pub wire: Option<usize>,
    /// A transfer.
    pub chip: Option<usize>,
}

impl CanvasPane {
    /// Handles mouse and keys; returns the item under the pointer.
    pub(super) fn handle(
        &mut self,
        ui: &mut Ui,
        session: &mut Session,
        sight: &Sight,
        ground: &Response,
    ) -> Over {
        let mut over = Over::default();
        self.navigate(ui, ground);
        self.ground(ui, session, sight, ground, &mut over);
        for (index, at) in sight.chips.iter().enumerate() {
            if chip(ui, sight, &sight.crossings[index], chip_rect(self.view, &sight.crossings[index], *at))
                .hovered()
            {
                over.chip = Some(index);
            }
        }
        let mut focused = false;
        for index in 0..sight.model.blocks.len() {
            let response = self.block(ui, session, sight, index);
            focused |= response.has_focus();
            if response.hovered() {
                over.block = Some(index);
            }
        }
        let pins: Vec<PinRef> = sight.pins().collect();
        for pin in pins {
            self.pin(ui, session, sight, pin, &mut over);
        }
        self.gesture(ui, session, sight, ground);
        let inside = ui.rect_contains_pointer(self.view.pane);
        if (inside || focused)
            && !ui.ctx().text_edit_focused()
            && self.search.is_none()
            && self.renaming.is_none()
        {
            self.keys(ui, session, sight);
        }
        over
    }

    /// Panning and zooming by wheel and the other buttons.
    fn navigate(&mut self, ui: &Ui, ground: &Response) {
        if !ui.rect_contains_pointer(self.view.pane) {
            return;
        }
        let (scroll, pinch, pointer) =
            ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta(), input.pointer.hover_pos()));
        let by = (scroll * WHEEL).exp2() * pinch;
        if let (Some(pointer), true) = (pointer, (by - 1.0).abs() > 1e-4) {
            self.view.zoom(by, pointer);
        }
        self.pan(ground);
    }

    fn pan(&mut self, response: &Response) {
        if response.dragged_by(PointerButton::Middle) || response.dragged_by(PointerButton::Secondary) {
            self.view.pan(response.drag_delta());
        }
    }

    fn ground(&mut self, ui: &Ui, session: &mut Session, sight: &Sight, ground: &Response, over: &mut Over) {
        let pointer = ground.hover_pos().or(ground.interact_pointer_pos());
        if let (Some(pointer), Gesture::Idle) = (pointer.map(|at| self.view.back(at)), &self.gesture) {
            let distances = sight.routes.iter().map(|route| route::distance(route, pointer) * self.view.zoom);
            let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            over.wire = nearest.filter(|(_, distance)| *distance < NEAR).map(|(wire, _)| wire);
        }
        if let Some(wire) = over.wire.filter(|_| ground.hovered()) {
            ground.clone().on_hover_cursor(CursorIcon::PointingHand).on_hover_ui_at_pointer(|ui| {
                let wire = &sight.model.wires[wire];
                ui.strong(format!("{} → {}", sight.model.name(wire.from), sight.model.name(wire.to)));
                ui.label(sight.model.at(wire.from).words());
                ui.weak("Click and press Delete, or drag its end off, to remove it");
            });
        }
        let extend = ui.input(|input| input.modifiers.shift || input.modifiers.command);
        if ground.drag_started_by(PointerButton::Primary)
            && let Some(at) = ui.input(|input| input.pointer.press_origin())
        {
            let kept = if extend { self.selection.clone() } else { BTreeSet::new() };
            self.gesture = Gesture::Select(self.view.back(at), kept);
        }
        if ground.clicked() {
            match over.wire {
                Some(wire) => {
                    let to = sight.model.wires[wire].to;
                    self.select(session, Vec::new());
                    self.wire =
                        Some((sight.model.blocks[to.block].address.clone(), sight.model.at(to).name.clone()));
                }
                None if !extend => self.select(session, Vec::new()),
                None => {}
            }
        }
        if ground.secondary_clicked()
            && let Some(at) = ground.interact_pointer_pos()
        {
            self.search_at(at);
        }
    }

    fn block(&mut self, ui: &mut Ui, session: &mut Session, sight: &Sight, index: usize) -> Response {
        let (block, facts) = (&sight.model.blocks[index], &sight.facts[index]);
        let rect = self.view.rect(sight.rects[index]);
        let id = ui.id().with(("block", &block.address));
        let response = ui.interact(rect, id, Sense::click_and_drag());
        let selected = self.selection.contains(&block.address);
        response.widget_info(|| {
            WidgetInfo::selected(
                WidgetType::SelectableLabel,
                true,
                selected,
                format!("node {}", describe(block, facts)),
            )
        });
        self.pan(&response);
        let extend = ui.input(|input| input.modifiers.shift || input.modifiers.command);
        let chosen = || vec![block.address.clone()];
        if response.gained_focus() {
            self.select(session, chosen());
            self.view.reveal(sight.rects[index]);
        }
        if response.has_focus() {
            // Arrows move the block, not the focus.
            let filter =
                EventFilter { horizontal_arrows: true, vertical_arrows: true, ..EventFilter::default() };
            ui.memory_mut(|memory| memory.set_focus_lock_filter(id, filter));
        }
        if response.clicked() {
            if extend {
                let others = self.selection.iter().filter(|address| **address != block.address).cloned();
                let all = others.chain((!selected).then(|| block.address.clone())).collect();
                self.select(session, all);
            } else {
                self.select(session, chosen());
            }
        }
        if response.double_clicked() && block.role == Role::Part {
            self.open(block.address.clone());
        }
        if (response.drag_started_by(PointerButton::Primary) || response.secondary_clicked()) && !selected {
            self.select(session, chosen());
        }
        if response.drag_started_by(PointerButton::Primary) {
            self.gesture = Gesture::Move(Vec2::ZERO);
        }
        if let (Gesture::Move(by), true) = (&mut self.gesture, response.dragged_by(PointerButton::Primary)) {
            *by += response.drag_delta() / self.view.zoom;
        }
        response.context_menu(|ui| self.block_menu(ui, session, sight, index));
        if self.gesture == Gesture::Idle {
            response.clone().on_hover_ui(|ui| block_hint(ui, block, facts));
        }
        response
    }

    fn pin(&mut self, ui: &mut Ui, session: &mut Session, sight: &Sight, at: PinRef, over: &mut Over) {
        let (block, pin) = (&sight.model.blocks[at.block], sight.model.at(at));
        let place = self.view.point(sight.pin(at));
        if !self.view.pane.expand(20.0).contains(place) {
            return;
        }
        let id = ui.id().with(("pin", &block.address, at.output, &pin.name));
        let size = (2.0 * PIN_RADIUS * self.view.zoom).max(TOUCH) + 4.0;
        let response =
            ui.interact(Rect::from_center_size(place, Vec2::splat(size)), id, Sense::CLICK | Sense::DRAG);
        let side = if at.output { "output" } else { "input" };
        let name = format!("{side} {}.{}", block.label(), pin.name);
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &name));
        if self.view.is_near() {
            self.pin_name(ui, session, sight, at, id, over);
        }
        self.pan(&response);
        if response.hovered() {
            over.block = Some(at.block);
        }
        if self.gesture == Gesture::Idle {
            response
                .clone()
                .on_hover_cursor(CursorIcon::Crosshair)
                .on_hover_ui(|ui| pin_hint(ui, session, sight, at));
        }
        if response.drag_started_by(PointerButton::Primary) {
            let wire = if at.output { None } else { sight.model.wire_to(at) };
            // Dragging from an input with a wire picks up that wire.
            let (from, taken) = match wire {
                Some(wire) => (wire.from, Some((block.address.clone(), pin.name.clone()))),
                None => (at, None),
            };
            let address = sight.model.blocks[from.block].address.clone();
            let port = sight.model.at(from).name.clone();
            self.gesture = Gesture::Wire(Held { address, output: from.output, port, taken });
        }
        let wired = !at.output && sight.model.wire_to(at).is_some();
        response.context_menu(|ui| {
            if ui.add_enabled(wired, egui::Button::new("Disconnect")).clicked() {
                self.disconnect(session, sight, &block.address, &pin.name);
                ui.close();
            }
        });
    }

    /// Shows the name of a pin. A click on an output's name shows its values in the viewer.
    fn pin_name(&self, ui: &Ui, session: &mut Session, sight: &Sight, at: PinRef, id: Id, over: &mut Over) {
        let (block, pin) = (&sight.model.blocks[at.block], sight.model.at(at));
        let rect = sight.rects[at.block];
        let row = Rect::from_min_size(
            egui::pos2(rect.left(), rect.top() + HEAD + ROW * at.pin as f32),
            vec2(rect.width(), ROW),
        );
        let half = if at.output { row.with_min_x(row.center().x) } else { row.with_max_x(row.center().x) };
        let sense = if at.output && block.is_node() { Sense::CLICK } else { Sense::HOVER };
        let response = ui.interact(self.view.rect(half.shrink2(vec2(6.0, 1.0))), id.with("name"), sense);
        if response.hovered() {
            over.block = Some(at.block);
        }
        if response.clicked() {
            // The pin of a node within a part is named `NODE.PORT`.
            let between = if pin.name.contains('.') { '/' } else { '.' };
            session.push(Intent::Show(format!("{}{between}{}", block.address, pin.name)));
        }
        if self.gesture == Gesture::Idle {
            response.on_hover_ui(|ui| pin_hint(ui, session, sight, at));
        }
    }

    /// Continues the pointer's action, and ends it when the button is released.
    fn gesture(&mut self, ui: &Ui, session: &mut Session, sight: &Sight, ground: &Response) {
        let (down, pointer, escape) = ui.input(|input| {
            (input.pointer.primary_down(), input.pointer.latest_pos(), input.key_pressed(Key::Escape))
        });
        if escape {
            self.gesture = Gesture::Idle;
        }
        let Some(pointer) = pointer else { return };
        if let (Gesture::Select(from, kept), true) = (&self.gesture, down) {
            let lasso = Rect::from_two_pos(*from, self.view.back(pointer));
            let caught = sight.model.blocks.iter().zip(&sight.rects);
            let caught =
                caught.filter(|(_, rect)| lasso.intersects(**rect)).map(|(block, _)| block.address.clone());
            self.selection = kept.iter().cloned().chain(caught).collect();
        }
        if down || self.gesture == Gesture::Idle {
            return;
        }
        match std::mem::take(&mut self.gesture) {
            Gesture::Idle => {}
            Gesture::Select(..) => {
                let selection: Vec<String> = self.selection.iter().cloned().collect();
                self.select(session, selection);
            }
            // The blocks are drawn where the pointer has taken them.
            Gesture::Move(by) if by != Vec2::ZERO => self.shift(session, sight, Vec2::ZERO, Tag::Once),
            Gesture::Move(_) => {}
            Gesture::Wire(held) => self.drop_wire(session, sight, &held, pointer, ground),
        }
    }

    /// Drops a wire on a pin, on a block, or on the background.
    fn drop_wire(
        &mut self,
        session: &mut Session,
        sight: &Sight,
        held: &Held,
        pointer: Pos2,
        ground: &Response,
    ) {
        let Some(from) = held.pin(sight) else { return };
        let reach = TOUCH.max(PIN_RADIUS * self.view.zoom) + 5.0;
        let pins = sight.pins().filter(|pin| *pin != from);
        let near = pins.map(|pin| (self.view.point(sight.pin(pin)).distance(pointer), pin));
        let near = near.filter(|(distance, _)| *distance < reach).min_by(|a, b| a.0.total_cmp(&b.0));
        let on = sight.rects.iter().position(|rect| self.view.rect(*rect).contains(pointer));
        let target = match (near, on) {
            (Some((_, pin)), _) => Some(pin),
            (None, Some(block)) => match self.only_fit(session, sight, from, block) {
                Some(pin) => Some(pin),
                None => return,
            },
            (None, None) => None,
        };
        match (target, &held.taken) {
            (Some(to), Some((address, port))) if sight.model.pin(address, false, port) == Some(to) => {}
            (Some(to), Some((address, port))) if !to.output => {
                self.reconnect(session, sight, (address, port), to)
            }
            (Some(to), _) => self.connect(session, sight, from, to),
            (None, Some((address, port))) => self.disconnect(session, sight, address, port),
            (None, None) if ground.rect.contains(pointer) => {
                let wire = (held.address.clone(), held.output, sight.model.at(from).clone());
                self.search = Some(Search::new(self.view.back(pointer), pointer, Some(wire)));
            }
            (None, None) => {}
        }
    }

    /// The pin of a block that a wire fits, if the choice is unambiguous; else a notice explains why not.
    fn only_fit(&self, session: &mut Session, sight: &Sight, from: PinRef, block: usize) -> Option<PinRef> {
        let fits = |pin: &PinRef| pin.block == block && sight.model.refusal(from, *pin).is_none();
        let fitting: Vec<PinRef> = sight.pins().filter(fits).collect();
        let free: Vec<PinRef> =
            fitting.iter().copied().filter(|pin| pin.output || sight.model.wire_to(*pin).is_none()).collect();
        match (&free[..], &fitting[..]) {
            ([only], _) | ([], [only]) => return Some(*only),
            ([], []) => {
                let (pin, words) = (sight.model.name(from), sight.model.at(from).words());
                let name = &sight.model.blocks[block].name;
                session.tell(format!("no port of {name} fits {pin}, which holds {words}"));
            }
            _ => {
                let names: Vec<&str> = fitting.iter().map(|pin| sight.model.at(*pin).name.as_str()).collect();
                session
                    .tell(format!("several ports fit; drop the wire on one of them: {}", names.join(", ")));
            }
        }
        None
    }

    fn keys(&mut self, ui: &Ui, session: &mut Session, sight: &Sight) {
        let shortcut = |modifiers, key| {
            ui.input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(modifiers, key)))
        };
        if shortcut(Modifiers::COMMAND, Key::A) {
            let all = sight.model.blocks.iter().map(|block| block.address.clone()).collect();
            self.select(session, all);
        }
        if shortcut(Modifiers::COMMAND, Key::D) {
            self.duplicate(session, sight);
        }
        let pressed = |key| {
            ui.input(|input| input.key_pressed(key) && !input.modifiers.command && !input.modifiers.alt)
        };
        if pressed(Key::Delete) {
            self.delete(session, sight);
        }
        if pressed(Key::Backspace) {
            self.open(nodes::split(&self.part).0.to_owned());
        }
        if pressed(Key::F) {
            self.wants_fit = true;
        }
        if pressed(Key::B) {
            self.bypass(session, sight);
        }
        if pressed(Key::Escape) {
            self.select(session, Vec::new());
        }
        let single = || {
            sight
                .model
                .blocks
                .iter()
                .find(|block| self.selection.len() == 1 && self.selection.contains(&block.address))
        };
        if let (true, Some(block)) = (pressed(Key::F2), single()) {
            self.start_renaming(block);
        } else if let (true, Some(block)) =
            (pressed(Key::Enter), single().filter(|block| block.role == Role::Part))
        {
            self.open(block.address.clone());
        }
        let stride = STRIDES[usize::from(ui.input(|input| input.modifiers.shift))];
        let held = |key| f32::from(u8::from(pressed(key)));
        let by =
            vec2(held(Key::ArrowRight) - held(Key::ArrowLeft), held(Key::ArrowDown) - held(Key::ArrowUp))
                * stride;
        if by != Vec2::ZERO && !self.selection.is_empty() {
            self.shift(session, sight, by, Tag::Moving);
        }
    }
}

/// A description of a block for screen readers.
fn describe(block: &Block, facts: &Facts) -> String {
    let mut words = block.label();
    if let Some(times) = &block.times {
        words += &format!(", {times} in a row");
    }
    if let Some(why) = &facts.why {
        words += &format!(", off: {why}");
    }
    if !block.changes.is_empty() {
        words += &format!(", changed: {}", block.changes.join("; "));
    }
    words
}

fn block_hint(ui: &mut Ui, block: &Block, facts: &Facts) {
    ui.set_max_width(340.0);
    let kind = if block.kind.is_empty() || block.kind == block.name {
        String::new()
    } else {
        format!("  ({})", block.kind)
    };
    let times = block.times.as_ref().map_or(String::new(), |times| format!(", {times} in a row"));
    ui.strong(format!("{}{kind}{times}", block.name));
    ui.label(&block.doc);
    if let Some(why) = &facts.why {
        ui.colored_label(ui.visuals().warn_fg_color, format!("It does not run: {why}"));
    } else if facts.nodes[1] > 0 {
        ui.label(format!("{} of its {} nodes are left out", facts.nodes[1], facts.nodes[0] + facts.nodes[1]));
    }
    if facts.saved > 0 {
        ui.weak(format!("That saves writing {} in a frame", readable(facts.saved)));
    }
    if let Some(ms) = facts.ms {
        ui.weak(format!("{}, writes {}", milliseconds(ms), readable(facts.bytes)));
    }
    if !block.changes.is_empty() {
        let text = format!("Changed from the base: {}", block.changes.join("; "));
        ui.colored_label(theme::palette(ui).changed, text);
    }
    if block.role == Role::Part {
        ui.weak("Double click to open it");
    }
}

fn pin_hint(ui: &mut Ui, session: &Session, sight: &Sight, at: PinRef) {
    ui.set_max_width(340.0);
    let (block, pin) = (&sight.model.blocks[at.block], sight.model.at(at));
    ui.strong(&pin.name);
    if !pin.doc.is_empty() {
        ui.label(&pin.doc);
    }
    ui.weak(elements(pin));
    let graph = session.state.graph.as_ref();
    let info = graph
        .and_then(|graph| graph.node(&block.address)?.ports.iter().find(|info| info.port.name == pin.name));
    let meaning = info.map_or(pin.meaning, |info| info.port.meaning);
    if let Some(meaning) = meaning {
        ui.weak(format!("meaning: {meaning}"));
    }
    if let Some(info) = info {
        ui.weak(format!("now {}", info.dims));
    }
    if pin.history {
        ui.weak("reads the previous frame's value");
    }
    if !at.output && pin.optional {
        ui.weak("optional");
    }
    if at.output && block.is_node() {
        ui.weak("Click its name to see it; drag to connect");
    }
}

/// Element type and extent.
fn elements(pin: &Pin) -> String {
    match &pin.extent {
        Some(extent) => format!("{}, {extent}", pin.words()),
        None => pin.words().into_owned(),
    }
}

fn chip(ui: &Ui, sight: &Sight, crossing: &Crossing, rect: Rect) -> Response {
    let wire = &sight.model.wires[crossing.wire];
    let what = format!("{} of {}", crossing.verb(), sight.model.name(wire.from));
    let response = ui.interact(rect, ui.id().with(("transfer", &what)), Sense::click());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &what));
    response.clone().on_hover_ui(|ui| {
        ui.strong(&what);
        ui.label(format!("{} per frame in {}", readable(crossing.bytes), milliseconds(crossing.ms)));
        ui.weak(crossing.waits());
    });
    response
}

/// The marks of the item under the pointer and of the wire being dragged.
pub fn marks<'a>(pane: &'a CanvasPane, sight: &Sight, over: &Over, wrong: &'a BTreeSet<usize>) -> Marks<'a> {
    let held = match &pane.gesture {
        Gesture::Wire(held) => held.pin(sight),
        _ => None,
    };
    let chosen = pane.wire.as_ref().and_then(|(address, port)| {
        let to = sight.model.pin(address, false, port)?;
        sight.model.wires.iter().position(|wire| wire.to == to)
    });
    Marks {
        selection: &pane.selection,
        hovered: over.block.filter(|_| held.is_none()),
        wires: [over.wire, chosen],
        wrong,
        held,
        heat: pane.heat,
    }
}
