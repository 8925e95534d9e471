//! Shows a port as an image that can be panned, zoomed and compared, or as a table if it is a list. Mouse and keys in
//! the image move the camera.

mod ages;
mod beside;
mod compare;
mod header;
mod histogram;
mod layer;
mod legend;
mod list;
mod overlay;
mod pick;
mod pictures;
mod place;
mod steer;

use std::sync::Arc;

use egui::{Color32, Response, Sense, Ui, vec2};
use epigraph_core::Snapshot;
use epigraph_pictures::{Look, Shown, describe};
use epigraph_stages::meaning::{ID, KEPT};
use serde::{Deserialize, Serialize};

use self::{
    ages::Ages,
    histogram::HistogramView,
    layer::Layer,
    pictures::{Order, Pictures, Wish},
    place::{Place, Placed, WHOLE},
};
pub use self::{
    compare::{Compare, Figures, Way, With},
    list::{List, Sorting},
};
use crate::{
    engine::{GraphInfo, State},
    intent::Intent,
    session::Session,
};

/// The background around images.
const GROUND: Color32 = Color32::from_gray(14);

/// One view of a port.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Viewer {
    /// The viewer's id.
    pub id: u64,
    /// The port as `node.port`; empty for the graph's first output.
    pub port: String,
    /// The settings with which it is shown.
    pub look: Look,
    /// The comparison with another image, if any.
    #[serde(skip)]
    pub compare: Option<Box<Compare>>,
    /// The table, if the port is a list.
    #[serde(skip)]
    pub list: Option<Box<List>>,
    place: Place,
    #[serde(skip)]
    pictures: Box<Pictures>,
    #[serde(skip)]
    histogram: HistogramView,
    histogram_open: bool,
    ages: Ages,
}

impl Viewer {
    /// A view of a port, `node.port`, or if that is empty, of the graph's first output.
    pub fn new(id: u64, port: String) -> Self {
        Self { id, port, ..Self::default() }
    }

    /// The picture on screen.
    pub fn picture(&self) -> Option<&Shown> {
        self.layer().map(|layer| &layer.shown)
    }

    /// The values of the picture on screen.
    pub fn snapshot(&self) -> Option<&Arc<Snapshot>> {
        self.layer().map(|layer| &layer.snapshot)
    }

    /// True if the picture is stale.
    pub fn is_behind(&self) -> bool {
        self.pictures.is_behind() || self.ages.is_behind()
    }

    /// The image on screen.
    fn layer(&self) -> Option<&Layer> {
        self.pictures.image.as_ref()
    }

    /// The ports that the engine must capture for it.
    pub fn watched(&self) -> impl Iterator<Item = String> {
        let against = self.compare.as_deref().and_then(Compare::port).map(str::to_owned);
        [Some(self.port.clone()), against].into_iter().flatten().chain(self.ages.watched())
    }

    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        let Some(graph) = session.state.graph.clone() else {
            ui.centered_and_justified(|ui| ui.weak("No graph runs yet."));
            return;
        };
        let state = session.state.clone();
        let name = header::name(&graph, &self.port);
        if self.compare.as_ref().is_some_and(|compare| compare.with == With::Graph) {
            session.beside.want(&name);
        }
        self.look.far = session.camera().map_or(f32::INFINITY, |camera| camera.far);
        self.take(ui, &graph, &state, &name);
        self.header(ui, &graph, state.frames);
        if let Some(list) = &mut self.list {
            let response = ui.interact(ui.max_rect(), ui.id().with("list"), Sense::hover());
            if response.contains_pointer() && ui.input(|input| input.pointer.any_pressed()) {
                session.push(Intent::Use(self.id));
            }
            return list.show(ui);
        }
        if self.layer().is_none() {
            let hint = if self.is_behind() {
                "Drawing …"
            } else if state.paused {
                "Paused: Step or Run to see it."
            } else {
                "Waiting for a frame …"
            };
            ui.weak(hint);
            return;
        }
        self.look_row(ui, &graph, &name);
        if let (true, Some(layer)) = (self.histogram_open, &self.pictures.image) {
            self.histogram.show(ui, layer, self.pictures.histogram.as_ref(), &mut self.look);
        }
        if let Some(compare) = &mut self.compare {
            compare.header(ui, session, &graph, self.pictures.image.as_ref());
        }
        self.image(ui, session, &graph, &name);
    }

    /// Takes the newest elements of the port.
    fn take(&mut self, ui: &Ui, graph: &GraphInfo, state: &State, name: &str) {
        let fields: Vec<Arc<Snapshot>> = state.fields(name).cloned().collect();
        let Some(first) = fields.first().cloned() else { return };
        let is_image =
            fields.len() == 1 && epigraph_pictures::is_image(&first.element, first.dims, graph.size);
        if !is_image {
            *self.pictures = Pictures::default();
            return self.list.get_or_insert_default().update(fields);
        }
        self.list = None;
        let Some(image) = self.ages.image(ui.ctx(), graph, state, name, &first) else { return };
        let other = self.compare.as_deref_mut().and_then(|compare| compare.other(ui, graph, state, &image));
        let gain = self.compare.as_deref().and_then(Compare::gain);
        let wish = Wish { look: self.look, histogram: self.histogram_open, gain };
        self.pictures.update(ui.ctx(), Order { image, other, wish });
        if let Some(compare) = &mut self.compare {
            compare.measure(ui.ctx(), &self.pictures);
        }
    }

    /// True if the port holds ids of points.
    fn is_of_points(&self, graph: &GraphInfo) -> bool {
        let meaning = graph.port(&self.port).and_then(|info| info.port.meaning);
        meaning.is_some_and(|meaning| [ID, KEPT].contains(&meaning))
    }

    /// Shows another port.
    pub fn choose(&mut self, port: String) {
        if port != self.port {
            let compare = self.compare.take();
            let (id, place, histogram_open) = (self.id, self.place, self.histogram_open);
            *self = Self { id, port, place, compare, histogram_open, ..Self::default() };
        }
    }

    /// Compares with an image file that is dropped on the window.
    pub fn take_dropped(&mut self, ui: &Ui) {
        let dropped = ui.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
        let Some(path) = dropped else { return };
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        if ["png", "exr"].iter().any(|known| ending == *known) {
            self.compare.get_or_insert_with(|| Box::new(Compare::holding(None, 0))).open(&path);
        }
    }

    /// The image and its overlays.
    fn image(&mut self, ui: &mut Ui, session: &mut Session, graph: &GraphInfo, name: &str) {
        let Some(layer) = &self.pictures.image else { return };
        let footer = ui.text_style_height(&egui::TextStyle::Body) + 6.0;
        let size = vec2(ui.available_width(), (ui.available_height() - footer).max(16.0));
        let (pane, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
        response.widget_info(|| {
            egui::WidgetInfo::labeled(egui::WidgetType::Image, true, format!("image of {name}"))
        });
        if response.hovered() || response.clicked() {
            session.push(Intent::Use(self.id));
        }
        let placed = self.place.put(pane, layer.shown.size);
        paint(ui, graph, &placed, &self.pictures, self.compare.as_deref(), &response);
        if let Some(compare) = &mut self.compare {
            compare.wipe_line(ui, &placed, &self.pictures);
        }
        pick::pick(ui, session, &response, &placed, graph.size);
        self.place.steer(ui, &response, &placed);
        steer::steer(ui, session, &response);
        foot(ui, &response, &placed, layer);
    }
}

fn paint(
    ui: &Ui,
    graph: &GraphInfo,
    placed: &Placed,
    pictures: &Pictures,
    compare: Option<&Compare>,
    response: &Response,
) {
    let Some(layer) = &pictures.image else { return };
    let painter = ui.painter_at(placed.pane);
    painter.rect_filled(placed.pane, 0.0, GROUND);
    painter.image(layer.texture.id(), placed.image, WHOLE, overlay::tint(layer, placed));
    match compare {
        Some(compare) => compare.paint(&painter, graph, placed, pictures),
        None => {
            overlay::draw(&painter, placed, layer);
            if let Some(pixel) = hovered(response, placed) {
                overlay::reach_of(&painter, placed, layer, pixel);
            }
        }
    }
    if compare.is_none_or(|compare| compare.way == Way::Wipe) {
        legend::draw(&painter, placed.pane, layer);
    }
}

/// The pixel under the pointer.
fn hovered(response: &Response, placed: &Placed) -> Option<[usize; 2]> {
    let pointer = response.hover_pos().filter(|pointer| placed.image.contains(*pointer))?;
    Some(placed.pixel(pointer))
}

/// The line below the image: the pixel under the pointer, or help on the mouse.
fn foot(ui: &mut Ui, response: &Response, placed: &Placed, layer: &Layer) {
    let text = match hovered(response, placed) {
        Some([x, y]) => {
            let value = describe(&layer.snapshot, [x, y]).unwrap_or_default();
            format!("({x}, {y})  {value}")
        }
        None => "Click: inspect   Drag: orbit   Right drag: look   W A S D Q E: fly   Wheel: zoom   Shift drag: pan".into(),
    };
    ui.horizontal(|ui| {
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let [width, height] = placed.size;
            ui.weak(format!("{width}×{height}  {:.0}%", 100.0 * placed.zoom()));
            if layer.shown.odd > 0 {
                let text = format!("{} pixels are NaN or infinite", layer.shown.odd);
                ui.colored_label(crate::theme::palette(ui).bad, text);
            }
            ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                ui.add(egui::Label::new(egui::RichText::new(text).weak()).truncate());
            });
        });
    });
}
