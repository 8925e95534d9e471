//! A port as an image: pan, zoom to pixels, read values; and the camera, flown with mouse and keys.

use std::sync::Arc;

use egui::{
    Align2, Color32, ColorImage, ComboBox, DragValue, FontId, Key, Painter, PointerButton, Pos2, Rect,
    Response, Sense, TextureHandle, TextureOptions, Ui, Vec2, pos2, vec2,
};
use epigraph_core::Snapshot;
use serde::{Deserialize, Serialize};
use epigraph_pictures::{Look, Mode, Ramp, Shown as Picture, describe, lanes, show};

use crate::{engine::GraphInfo, session::Session};

/// Points a pixel may take at most.
const MAX_ZOOM: f32 = 256.0;
/// Points a pixel takes from which on its values are written into it.
const LEGIBLE: f32 = 72.0;
/// Radians that the camera turns for each point of a drag.
const TURN: f32 = 0.006;
/// How fast the wheel zooms: doublings for each point of scrolling.
const WHEEL: f32 = 1.0 / 150.0;

/// One view of a port.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Viewer {
    /// Tells it from the others.
    pub id: u64,
    /// The port as `node.port`; empty for the graph's first output.
    pub port: String,
    /// How it is shown.
    pub look: Look,
    /// Points for each pixel; none fits the image into the pane.
    zoom: Option<f32>,
    /// The image's middle from the pane's middle, points.
    offset: Vec2,
    /// The picture on screen, and what it was made of.
    #[serde(skip)]
    shown: Option<Shown>,
}

struct Shown {
    snapshot: Arc<Snapshot>,
    look: Look,
    picture: Picture,
    texture: TextureHandle,
}

impl Viewer {
    /// A view of a port, `node.port`, or of the graph's first output where it is empty.
    pub fn new(id: u64, port: String) -> Self {
        Self { id, port, ..Self::default() }
    }

    /// The picture on screen.
    pub fn picture(&self) -> Option<&Picture> {
        self.shown.as_ref().map(|shown| &shown.picture)
    }

    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        if session.viewer == self.id
            && let Some(port) = session.wanted.take()
        {
            self.choose(port);
        }
        if session.viewer == self.id {
            session.viewed.clone_from(&self.port);
        }
        let Some(graph) = session.state.graph.clone() else {
            ui.centered_and_justified(|ui| ui.weak("Nothing runs yet."));
            return;
        };
        ui.horizontal(|ui| self.header(ui, &graph));
        let name = self.name(&graph);
        self.look.far = session.rig.map_or(f32::INFINITY, |rig| rig.camera.far);
        match session.state.fields(&name).next().cloned() {
            Some(snapshot) => self.update(ui, snapshot),
            // Until its first frame, the picture before stays.
            None if self.shown.is_some() => {}
            None => {
                let hint = if session.state.paused {
                    "Paused: Step or Run shows it."
                } else {
                    "Waiting for a frame …"
                };
                ui.weak(hint);
                return;
            }
        }
        let footer = ui.text_style_height(&egui::TextStyle::Body) + 6.0;
        let size = vec2(ui.available_width(), (ui.available_height() - footer).max(16.0));
        let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
        response.widget_info(|| {
            egui::WidgetInfo::labeled(egui::WidgetType::Image, true, format!("image of {name}"))
        });
        if response.hovered() || response.clicked() {
            session.viewer = self.id;
        }
        let place = self.place(rect);
        self.paint(&ui.painter_at(rect), rect, place);
        self.zoom_and_pan(ui, &response, rect, place);
        steer(ui, session, &response);
        self.footer(ui, &response, place);
    }

    fn choose(&mut self, port: String) {
        if port != self.port {
            *self = Self { id: self.id, port, zoom: self.zoom, offset: self.offset, ..Self::default() };
        }
    }

    fn name(&self, graph: &GraphInfo) -> String {
        match &self.port[..] {
            "" => graph.outputs.first().map_or(String::new(), |(name, _)| name.clone()),
            port => port.to_owned(),
        }
    }

    fn header(&mut self, ui: &mut Ui, graph: &GraphInfo) {
        let mut chosen = self.port.clone();
        let shown = if chosen.is_empty() { format!("output {}", self.name(graph)) } else { chosen.clone() };
        let combo = ComboBox::from_id_salt("port").selected_text(shown).width(170.0).height(420.0);
        let response = combo.show_ui(ui, |ui| {
            for (name, from) in graph.outputs.iter().take(1) {
                ui.selectable_value(&mut chosen, String::new(), format!("output {name}")).on_hover_text(from);
            }
            for node in graph.steps.iter().filter_map(|step| graph.node(step.node.as_deref()?)) {
                for info in
                    node.ports.iter().filter(|info| info.port.is_output() && info.is_image(graph.size))
                {
                    let name = format!("{}.{}", node.name, info.port.name);
                    ui.selectable_value(&mut chosen, name.clone(), name)
                        .on_hover_text(info.port.doc.as_ref());
                }
            }
        });
        response.response.on_hover_text("Which port to see");
        self.choose(chosen);

        let mode = self.look.mode;
        let automatic = self.picture().map_or(String::new(), |picture| picture.mode.label().to_owned());
        let text = mode.map_or(automatic, |mode| mode.label().to_owned());
        let combo = ComboBox::from_id_salt("mode").selected_text(text).width(92.0);
        let response = combo.show_ui(ui, |ui| {
            ui.selectable_value(&mut self.look.mode, None, "What suits the port");
            for (mode, label) in Mode::ALL {
                ui.selectable_value(&mut self.look.mode, Some(mode), label);
            }
        });
        response.response.on_hover_text("How numbers become colours");
        self.lanes(ui);
        self.range(ui);
        if ui
            .selectable_label(self.zoom.is_none(), "Fit")
            .on_hover_text("Fit the image into the pane")
            .clicked()
        {
            (self.zoom, self.offset) = (None, Vec2::ZERO);
        }
        if ui
            .selectable_label(self.zoom == Some(1.0), "1:1")
            .on_hover_text("One point for each pixel")
            .clicked()
        {
            (self.zoom, self.offset) = (Some(1.0), Vec2::ZERO);
        }
    }

    /// Which lane, where there are several and the mode shows one.
    fn lanes(&mut self, ui: &mut Ui) {
        let Some(shown) = &self.shown else { return };
        let lanes = lanes(&shown.snapshot.element);
        if lanes.len() < 2 || shown.picture.mode == Mode::Color {
            return;
        }
        let text = lanes.get(self.look.lane).map_or("", |lane| &lane.name);
        ComboBox::from_id_salt("lane").selected_text(text).width(40.0).show_ui(ui, |ui| {
            for (index, lane) in lanes.iter().enumerate() {
                ui.selectable_value(&mut self.look.lane, index, &lane.name);
            }
        });
    }

    /// The ends of the range, where the mode has one.
    fn range(&mut self, ui: &mut Ui) {
        let Some(range) = self.picture().and_then(|picture| picture.range) else { return };
        let mut ends = self.look.range.unwrap_or(range);
        let speed = ((range[1] - range[0]).abs() * 0.005).max(1e-4);
        let low = ui.add(DragValue::new(&mut ends[0]).speed(speed).max_decimals(3));
        let high = ui.add(DragValue::new(&mut ends[1]).speed(speed).max_decimals(3));
        let changed = low.on_hover_text("Value at the dark end").changed()
            | high.on_hover_text("Value at the bright end").changed();
        if changed {
            self.look.range = Some(ends);
        }
        if self.look.range.is_some() && ui.button("Auto").on_hover_text("Range from the image").clicked() {
            self.look.range = None;
        }
        if self.picture().is_some_and(|picture| picture.mode != Mode::Depth) {
            ui.checkbox(&mut self.look.log, "log").on_hover_text("Shades follow the logarithm");
        }
    }

    fn update(&mut self, ui: &Ui, snapshot: Arc<Snapshot>) {
        if let Some(shown) = &self.shown
            && Arc::ptr_eq(&shown.snapshot, &snapshot)
            && shown.look == self.look
        {
            return;
        }
        let look = self.look;
        let picture = show(&snapshot, &look);
        let bytes: Vec<u8> = picture.colors.iter().flatten().copied().collect();
        let image = ColorImage::from_rgb(picture.size, &bytes);
        let texture = match self.shown.take() {
            Some(Shown { mut texture, .. }) => {
                texture.set(image, TextureOptions::NEAREST);
                texture
            }
            None => ui.ctx().load_texture("viewer", image, TextureOptions::NEAREST),
        };
        self.shown = Some(Shown { snapshot, look, picture, texture });
    }

    /// Where the image lies.
    fn place(&self, pane: Rect) -> Rect {
        let size = self.picture().map_or([1, 1], |picture| picture.size);
        let size = vec2(size[0].max(1) as f32, size[1].max(1) as f32);
        let fit = (pane.width() / size.x).min(pane.height() / size.y);
        Rect::from_center_size(pane.center() + self.offset, size * self.zoom.unwrap_or(fit))
    }

    fn zoom_and_pan(&mut self, ui: &Ui, response: &Response, pane: Rect, place: Rect) {
        let shift = ui.input(|input| input.modifiers.shift);
        let pans = response.dragged_by(PointerButton::Middle)
            || response.dragged_by(PointerButton::Primary) && shift;
        let width = self.picture().map_or(1, |picture| picture.size[0].max(1)) as f32;
        let zoom = place.width() / width;
        if pans {
            self.zoom = Some(zoom);
            self.offset += response.drag_delta();
        }
        if let Some(pointer) = response.hover_pos() {
            let wheel = ui.input(|input| input.smooth_scroll_delta().y * WHEEL);
            let pinch = ui.input(|input| input.zoom_delta()).log2();
            let factor = (wheel + pinch).exp2();
            if factor != 1.0 {
                let new = (zoom * factor).clamp(1.0 / 16.0, MAX_ZOOM);
                // The pixel under the pointer stays there.
                let middle = pointer + (place.center() - pointer) * (new / zoom);
                (self.zoom, self.offset) = (Some(new), middle - pane.center());
            }
        }
        if response.double_clicked() {
            (self.zoom, self.offset) = (None, Vec2::ZERO);
        }
    }

    fn paint(&self, painter: &Painter, pane: Rect, place: Rect) {
        painter.rect_filled(pane, 0.0, Color32::from_gray(14));
        let Some(shown) = &self.shown else { return };
        let whole = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
        painter.image(shown.texture.id(), place, whole, Color32::WHITE);
        self.values(painter, pane, place, shown);
        legend(painter, pane, &shown.picture, self.look.log);
    }

    /// Every pixel's values, where there is room.
    fn values(&self, painter: &Painter, pane: Rect, place: Rect, shown: &Shown) {
        let [width, height] = shown.picture.size;
        let zoom = place.width() / width.max(1) as f32;
        if zoom < LEGIBLE {
            return;
        }
        let visible = pane.intersect(place);
        let from = pixel(place, shown.picture.size, visible.min);
        let to = pixel(place, shown.picture.size, visible.max);
        for y in from[1]..=to[1].min(height.saturating_sub(1)) {
            for x in from[0]..=to[0].min(width.saturating_sub(1)) {
                let Some(text) = describe(&shown.snapshot, [x, y]) else { continue };
                let [r, g, b] = shown.picture.colors[y * width + x];
                let light = 2 * u32::from(r) + 5 * u32::from(g) + u32::from(b) > 8 * 140;
                let color = if light { Color32::BLACK } else { Color32::WHITE };
                let middle = place.min + vec2(x as f32 + 0.5, y as f32 + 0.5) * zoom;
                let text = text.replace("  ", "\n");
                painter.text(middle, Align2::CENTER_CENTER, text, FontId::proportional(10.0), color);
            }
        }
    }

    fn footer(&self, ui: &mut Ui, response: &Response, place: Rect) {
        let Some(shown) = &self.shown else { return };
        let size = shown.picture.size;
        let hovered = response.hover_pos().filter(|pointer| place.contains(*pointer));
        let text = match hovered.map(|pointer| pixel(place, size, pointer)) {
            Some([x, y]) => {
                let value = describe(&shown.snapshot, [x, y]).unwrap_or_default();
                format!("({x}, {y})  {value}")
            }
            None => {
                "Drag: orbit   Right drag: look   W A S D Q E: fly   Wheel: zoom   Shift drag: pan".into()
            }
        };
        ui.horizontal(|ui| {
            ui.weak(text);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let zoom = 100.0 * place.width() / size[0].max(1) as f32;
                ui.weak(format!("{}×{}  {zoom:.0}%", size[0], size[1]));
                if shown.picture.odd > 0 {
                    ui.colored_label(
                        crate::theme::BAD,
                        format!("{} pixels are no number", shown.picture.odd),
                    );
                }
            });
        });
    }
}

/// The pixel under a point.
fn pixel(place: Rect, size: [usize; 2], at: Pos2) -> [usize; 2] {
    let share = (at - place.min) / place.size();
    let index =
        |share: f32, size: usize| ((share * size as f32).max(0.0) as usize).min(size.saturating_sub(1));
    [index(share.x, size[0]), index(share.y, size[1])]
}

/// The ramp with the values at its ends.
fn legend(painter: &Painter, pane: Rect, picture: &Picture, log: bool) {
    let (Some([low, high]), Mode::FalseColor) = (picture.range, picture.mode) else { return };
    let bar = Rect::from_min_size(pane.left_bottom() + vec2(10.0, -34.0), vec2(160.0, 10.0));
    painter.rect_filled(
        bar.expand2(vec2(6.0, 4.0)).with_max_y(pane.bottom() - 6.0),
        3.0,
        Color32::from_black_alpha(160),
    );
    const STEPS: usize = 64;
    for step in 0..STEPS {
        let [r, g, b] = Ramp::Spectrum.color(step as f32 / (STEPS - 1) as f32);
        let left = bar.left() + bar.width() * step as f32 / STEPS as f32;
        let slice =
            Rect::from_min_size(pos2(left, bar.top()), vec2(bar.width() / STEPS as f32 + 0.5, bar.height()));
        painter.rect_filled(slice, 0.0, Color32::from_rgb(r, g, b));
    }
    let font = FontId::proportional(11.0);
    let scale = if log { " (log)" } else { "" };
    painter.text(
        bar.left_bottom(),
        Align2::LEFT_TOP,
        format!("{low:.4}{scale}"),
        font.clone(),
        Color32::WHITE,
    );
    painter.text(bar.right_bottom(), Align2::RIGHT_TOP, format!("{high:.4}"), font, Color32::WHITE);
}

/// Mouse and keys move the camera.
fn steer(ui: &Ui, session: &mut Session, response: &Response) {
    let shift = ui.input(|input| input.modifiers.shift);
    let drag = response.drag_delta() * TURN;
    if response.dragged_by(PointerButton::Primary) && !shift {
        session.move_camera(|rig| rig.orbit(drag.x, drag.y));
    }
    if response.dragged_by(PointerButton::Secondary) {
        session.move_camera(|rig| rig.look(drag.x, drag.y));
    }
    // Keys belong to a text field while one has the focus.
    let typing = ui.ctx().memory(|memory| memory.focused().is_some_and(|id| id != response.id));
    if !response.hovered() || typing || ui.input(|input| input.modifiers.command) {
        return;
    }
    let (held, seconds) = ui.input(|input| {
        let axis = |plus: Key, minus: Key| f32::from(input.key_down(plus)) - f32::from(input.key_down(minus));
        let held = [axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S)];
        (held, input.stable_dt.min(0.1))
    });
    if held != [0.0; 3] {
        session.move_camera(|rig| rig.fly(held, seconds));
        ui.ctx().request_repaint();
    }
}
