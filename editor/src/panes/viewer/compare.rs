//! Comparison of two images: the one in view, and another port, another graph's port, a file, or an earlier image of
//! the same port that the user holds.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use egui::{
    Align2, Color32, ColorImage, ComboBox, Context, CursorIcon, DragValue, FontId, Key, Painter, Rect, Sense,
    Stroke, TextEdit, TextureHandle, Ui, WidgetInfo, WidgetType, pos2, vec2,
};
use epigraph_core::Snapshot;
use epigraph_pictures::{Difference, Picture, Ramp, metrics};
use epigraph_stages::meaning::WHITE;

use super::{
    beside, header,
    layer::{Layer, Painted, pixels, upload},
    pictures::Pictures,
    place::{Placed, WHOLE},
};
use crate::{
    engine::{GraphInfo, State},
    name::Named,
    session::Session,
    task::Task,
    theme,
};

/// Step of the wipe's line per arrow key, as a share of the image.
const WIPE_STEP: f32 = 0.01;

/// The other image of a comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum With {
    /// The held image.
    Held,
    /// A port, `node.port`, or the graph's first output if it is empty.
    Port(String),
    /// The same port of the graph beside, or its first output if it has none of that name.
    Graph,
    /// An image file.
    File,
}

/// The display of both images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Way {
    /// One image left of a line, the other right of it.
    #[default]
    Wipe,
    /// The difference of displayed colours.
    Difference,
    /// The perceived difference.
    Flip,
}

const WAYS: [(Way, &str, &str); 3] = [
    (Way::Wipe, "Wipe", "One left of the line, the other right of it; drag the line"),
    (Way::Difference, "Difference", "Difference of the displayed colours, per channel"),
    (Way::Flip, "FLIP map", "Perceived difference: black is none, pale yellow the largest"),
];

/// Measures of the difference between two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Root mean square error: of linear light if both images are linear, else of displayed colours.
    pub rmse: f64,
    /// Peak signal-to-noise ratio of displayed colours, decibels.
    pub psnr: f64,
    /// Mean structural similarity.
    pub ssim: f64,
    /// Mean FLIP.
    pub flip: f64,
}

/// Measurements, made on another thread than the window's.
struct Measured {
    figures: Figures,
    /// FLIP's map as colours.
    map: Arc<ColorImage>,
}

/// The two images that are measured.
#[derive(Clone)]
struct Pair([Arc<Painted>; 2]);

impl PartialEq for Pair {
    fn eq(&self, other: &Self) -> bool {
        self.0.iter().zip(&other.0).all(|(a, b)| Arc::ptr_eq(a, b))
    }
}

/// A held image, and the number of frames run by then.
#[derive(Clone)]
struct Held {
    image: Arc<Snapshot>,
    frames: u32,
}

/// Whether a graph fits the exposure to its picture.
fn fits_exposure(graph: &GraphInfo) -> bool {
    let mut ports = graph.nodes.iter().flat_map(|node| &node.ports).map(|info| &info.port);
    ports.any(|port| port.is_output() && port.meaning == Some(WHITE))
}

/// A comparison.
pub struct Compare {
    /// The image to compare with.
    pub with: With,
    /// The display of both.
    pub way: Way,
    /// The position of the wipe's line, as a share of the image's width.
    pub wipe: f32,
    /// Gain of the differences.
    gain: f32,
    held: Option<Held>,
    path: String,
    /// The requested file, and the number of requests.
    asked: Option<(PathBuf, u32)>,
    file: Task<(PathBuf, u32), Result<Arc<Snapshot>, String>>,
    /// The other image in the last frame of the window.
    last: Option<Arc<Snapshot>>,
    measured: Task<Pair, Measured>,
    /// FLIP's map on the graphics card, and the pair that it belongs to.
    flip: Option<(Pair, TextureHandle)>,
    trouble: Option<String>,
    /// The label of the graph beside and its port.
    beside: Option<String>,
}

impl Compare {
    /// Holds an image, to be compared with later ones. `frames` is the number of frames run so far.
    pub fn holding(image: Option<Arc<Snapshot>>, frames: u32) -> Self {
        Self {
            with: With::Held,
            way: Way::Wipe,
            wipe: 0.5,
            gain: 4.0,
            held: image.map(|image| Held { image, frames }),
            path: String::new(),
            asked: None,
            file: Task::default(),
            last: None,
            measured: Task::default(),
            flip: None,
            trouble: None,
            beside: None,
        }
    }

    /// Holds another image.
    pub fn hold(&mut self, image: Arc<Snapshot>, frames: u32) {
        (self.held, self.with) = (Some(Held { image, frames }), With::Held);
    }

    /// Reads a file to compare with.
    pub fn open(&mut self, path: &Path) {
        let times = self.asked.as_ref().map_or(0, |(_, times)| times + 1);
        self.path = path.display().to_string();
        self.asked = Some((path.to_owned(), times));
        self.with = With::File;
    }

    /// The port to compare with, if the other image is a port's.
    pub fn port(&self) -> Option<&str> {
        if let With::Port(port) = &self.with { Some(port) } else { None }
    }

    /// The measures of the newest pair of images.
    pub fn figures(&self) -> Option<&Figures> {
        self.measured.result().map(|(_, measured)| &measured.figures).filter(|_| self.trouble.is_none())
    }

    /// True if a newer pair of images is being measured.
    pub fn is_behind(&self) -> bool {
        self.measured.is_behind()
    }

    /// The reason why the images cannot be compared.
    pub fn trouble(&self) -> Option<&str> {
        self.trouble.as_deref()
    }

    /// The controls and the measures.
    pub fn header(&mut self, ui: &mut Ui, session: &mut Session, graph: &GraphInfo, shown: Option<&Layer>) {
        let frames = session.state.frames;
        ui.horizontal_wrapped(|ui| {
            ui.label("compared with");
            self.choose(ui, graph);
            let hold = ui.add_enabled(shown.is_some(), egui::Button::new("Hold"));
            if hold.on_hover_text("Hold this image, and compare later ones with it").clicked()
                && let Some(layer) = shown
            {
                self.hold(layer.snapshot.clone(), frames);
            }
            for (way, label, doc) in WAYS {
                ui.selectable_value(&mut self.way, way, label).on_hover_text(doc);
            }
            if self.way == Way::Difference {
                let gain =
                    DragValue::new(&mut self.gain).range(1.0..=256.0).speed(0.1).prefix("× ").max_decimals(1);
                ui.add(gain).on_hover_text("Gain of the differences");
            }
        });
        match self.with {
            With::File => self.file_row(ui),
            With::Graph => beside::row(ui, session),
            With::Held | With::Port(_) => {}
        }
        let beside = session.state.other.as_ref().and_then(|other| other.graph.as_deref());
        let beside = beside.filter(|_| self.with == With::Graph);
        if [Some(graph), beside].into_iter().flatten().any(fits_exposure) {
            ui.colored_label(theme::palette(ui).bad, "exposure is Auto: set a number to compare pictures")
                .on_hover_text("Each picture finds its own, so that they also differ by exposure");
        }
        self.figures_row(ui);
    }

    fn choose(&mut self, ui: &mut Ui, graph: &GraphInfo) {
        let mut chosen = self.with.clone();
        let combo =
            ComboBox::from_id_salt("against").selected_text(self.name(graph)).width(190.0).height(420.0);
        let response = combo.show_ui(ui, |ui| {
            if self.held.is_some() {
                ui.selectable_value(&mut chosen, With::Held, self.held_name());
            }
            ui.selectable_value(&mut chosen, With::Graph, "another graph …")
                .on_hover_text("Runs beside this one, with the same views and number of samples");
            ui.selectable_value(&mut chosen, With::File, "an image file …");
            ui.separator();
            header::ports(ui, graph, true, |ui, name, label, doc| {
                ui.selectable_value(&mut chosen, With::Port(name), label).on_hover_text(doc);
            });
        });
        response
            .response
            .named(WidgetType::ComboBox, "Compared with")
            .on_hover_text("The image to compare with");
        self.with = chosen;
    }

    fn file_row(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let edit = TextEdit::singleline(&mut self.path)
                .hint_text("reference.exr or .png; or drop a file on the window")
                .desired_width(ui.available_width() - 60.0);
            let edit = ui.add(edit);
            edit.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "image file"));
            let entered = edit.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            if ui.button("Open").clicked() || entered {
                self.open(&PathBuf::from(self.path.trim()));
            }
        });
    }

    fn figures_row(&self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            if let Some(trouble) = &self.trouble {
                ui.colored_label(theme::palette(ui).bad, trouble);
                return;
            }
            match self.measured.result() {
                _ if self.with == With::File && self.asked.is_none() => {
                    ui.weak(
                        "Enter the name of a PNG or EXR file of the same size, or drop one on the window.",
                    );
                }
                Some((_, Measured { figures, .. })) => {
                    for (name, value, doc) in figures.named() {
                        ui.weak(name).on_hover_text(doc);
                        ui.label(value).on_hover_text(doc);
                    }
                }
                None => {
                    ui.weak("comparing …");
                }
            }
            if self.measured.is_busy() {
                ui.add(egui::Spinner::new().size(12.0));
            }
        });
    }

    fn held_name(&self) -> String {
        let name =
            |held: &Held| format!("held: {}, frame {}", held.image.name, held.frames.saturating_sub(1));
        self.held.as_ref().map_or("nothing".into(), name)
    }

    fn name(&self, graph: &GraphInfo) -> String {
        match &self.with {
            With::Held => self.held_name(),
            With::Port(port) if port.is_empty() => header::output(graph),
            With::Port(port) => port.clone(),
            With::Graph => self.beside.clone().unwrap_or_else(|| "another graph".into()),
            With::File => match &self.asked {
                Some((path, _)) => path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
                None => "an image file …".into(),
            },
        }
    }

    /// The other image, if the one in view can be compared with it. Call it once for each frame of the window.
    pub fn other(
        &mut self,
        ui: &Ui,
        graph: &GraphInfo,
        state: &State,
        image: &Snapshot,
    ) -> Option<Arc<Snapshot>> {
        let other = self.source(ui, graph, state, &image.name).and_then(|other| match other {
            Some(other) if other.dims != image.dims => Err(format!(
                "this image has {} pixels and the other one {}: only images of the same size can be compared",
                image.dims, other.dims
            )),
            other => Ok(other),
        });
        match other {
            Ok(other) => {
                self.trouble = None;
                self.last.clone_from(&other);
                other
            }
            Err(trouble) => {
                (self.trouble, self.last) = (Some(trouble), None);
                None
            }
        }
    }

    /// Gain of the differences, if they are shown.
    pub fn gain(&self) -> Option<f32> {
        (self.way == Way::Difference).then_some(self.gain)
    }

    /// Measures the difference between the pictures; once for each frame of the window.
    pub fn measure(&mut self, context: &Context, pictures: &Pictures) {
        let (Some(image), Some(other), None) = (&pictures.image, &pictures.other, &self.trouble) else {
            self.flip = None;
            return;
        };
        let pair = Pair([image.painted.clone(), other.painted.clone()]);
        let asked = pair.clone();
        self.measured.want(context, pair, move || Measured::of(&asked));
        if let (Way::Flip, Some((pair, measured))) = (self.way, self.measured.result())
            && self.flip.as_ref().is_none_or(|(of, _)| of != pair)
        {
            let texture = self.flip.take().map(|(_, texture)| texture);
            self.flip = Some((pair.clone(), upload(texture, context, measured.map.clone())));
        }
    }

    fn source(
        &mut self,
        ui: &Ui,
        graph: &GraphInfo,
        state: &State,
        shown: &str,
    ) -> Result<Option<Arc<Snapshot>>, String> {
        match &self.with {
            With::Held => match &self.held {
                Some(held) => Ok(Some(held.image.clone())),
                None => Err("nothing is held yet".into()),
            },
            With::Port(port) => {
                let name = header::name(graph, port);
                // Until the port is captured, its last image stays.
                Ok(state
                    .fields(&name)
                    .next()
                    .cloned()
                    .or_else(|| self.last.clone().filter(|last| last.name == name)))
            }
            With::Graph => {
                let image = beside::image(state, shown)?;
                self.beside = image.as_ref().map(|image| beside::name(state, image));
                Ok(image)
            }
            With::File => {
                let Some(asked) = self.asked.clone() else { return Ok(None) };
                let path = asked.0.clone();
                self.file.want(ui.ctx(), asked, move || {
                    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                    let picture = Picture::read(&path).map_err(|error| error.to_string())?;
                    Ok(Arc::new(picture.to_port(&name)))
                });
                match self.file.result() {
                    Some((_, read)) => read.clone().map(Some),
                    None => Ok(None),
                }
            }
        }
    }

    /// Draws over the image in view.
    pub fn paint(&self, painter: &Painter, graph: &GraphInfo, placed: &Placed, pictures: &Pictures) {
        let (Some(image), Some(other)) = (&pictures.image, &pictures.other) else { return };
        let map = |texture: &TextureHandle| {
            painter.image(texture.id(), placed.image, WHOLE, Color32::WHITE);
        };
        match (self.way, &pictures.difference, &self.flip) {
            (Way::Wipe, ..) => {
                let right = placed.pane.with_min_x(self.line(placed));
                let clipped = painter.with_clip_rect(right.intersect(painter.clip_rect()));
                clipped.image(other.texture.id(), placed.image, WHOLE, Color32::WHITE);
                tag(painter, placed, Align2::LEFT_TOP, format!("now: {}", image.snapshot.name));
                tag(painter, placed, Align2::RIGHT_TOP, self.name(graph));
            }
            (Way::Difference, Some(texture), _) => map(texture),
            // Until the difference is computed, the image in view stays.
            (Way::Difference, None, _) => {}
            (Way::Flip, _, Some((_, texture))) => map(texture),
            (Way::Flip, _, None) => {
                let font = FontId::proportional(13.0);
                let text = format!("comparing with {} …", self.name(graph));
                painter.text(placed.pane.center(), Align2::CENTER_CENTER, text, font, Color32::WHITE);
            }
        }
    }

    /// The draggable line between both images.
    pub fn wipe_line(&mut self, ui: &Ui, placed: &Placed, pictures: &Pictures) {
        if self.way != Way::Wipe || pictures.other.is_none() {
            return;
        }
        let x = self.line(placed);
        let visible = placed.visible();
        let grip = Rect::from_center_size(pos2(x, visible.center().y), vec2(13.0, visible.height()));
        let response = ui.interact(grip, ui.id().with("wipe"), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::slider(true, f64::from(self.wipe), "wipe line"));
        let response = response.on_hover_cursor(CursorIcon::ResizeHorizontal);
        if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.dragged()) {
            self.wipe = (pointer.x - placed.image.left()) / placed.image.width();
        }
        if response.clicked() {
            response.request_focus();
        }
        if response.has_focus() {
            let step = ui.input(|input| {
                f32::from(input.key_pressed(Key::ArrowRight)) - f32::from(input.key_pressed(Key::ArrowLeft))
            });
            self.wipe += step * WIPE_STEP;
        }
        self.wipe = self.wipe.clamp(0.0, 1.0);
        let lit = response.hovered() || response.dragged() || response.has_focus();
        let painter = ui.painter_at(placed.pane);
        painter.vline(x, visible.y_range(), Stroke::new(3.0, Color32::from_black_alpha(120)));
        let color = if lit { theme::ACCENT } else { Color32::WHITE };
        painter.vline(x, visible.y_range(), Stroke::new(1.0, color));
        let knob = Rect::from_center_size(pos2(x, visible.center().y), vec2(9.0, 26.0));
        painter.rect(
            knob,
            4.0,
            color,
            Stroke::new(1.0, Color32::from_black_alpha(160)),
            egui::StrokeKind::Outside,
        );
    }

    /// The line's position on screen, clamped to the visible part of the image.
    fn line(&self, placed: &Placed) -> f32 {
        let visible = placed.visible();
        (placed.image.left() + self.wipe * placed.image.width())
            .clamp(visible.left(), visible.right().max(visible.left()))
    }
}

impl Measured {
    fn of(Pair(images): &Pair) -> Self {
        let [a, b] = [0, 1].map(|index| Picture::of_port(&images[index].snapshot, &images[index].shown));
        let difference = Difference::new(&b, &a);
        let rmse = if a.linear == b.linear {
            metrics::rmse(&a.colors, &b.colors)
        } else {
            metrics::rmse(&a.srgb(), &b.srgb())
        };
        let (psnr, ssim, flip) = (difference.psnr(), difference.ssim(), difference.flip());
        let map: Vec<[u8; 3]> = difference.errors.iter().map(|error| Ramp::Magma.color(*error)).collect();
        let map = Arc::new(pixels(images[0].shown.size, &map));
        Self { figures: Figures { rmse, psnr, ssim, flip }, map }
    }
}

impl Figures {
    /// The measures as shown in the pane: name, value, explanation.
    fn named(&self) -> [(&'static str, String, &'static str); 4] {
        [
            (
                "FLIP",
                format!("{:.4}", self.flip),
                "Mean FLIP at 67 pixels per degree: 0 is no difference, 1 the largest",
            ),
            ("PSNR", format!("{:.2} dB", self.psnr), "Peak signal-to-noise ratio of the displayed colours"),
            ("SSIM", format!("{:.4}", self.ssim), "Mean structural similarity: 1 for equal images"),
            (
                "RMSE",
                format!("{:.5}", self.rmse),
                "Root mean square error; of linear light if both images are linear, else of displayed colours",
            ),
        ]
    }
}

/// A label in a corner of an image.
fn tag(painter: &Painter, placed: &Placed, corner: Align2, text: String) {
    let text = painter.layout_no_wrap(text, FontId::proportional(11.0), Color32::WHITE);
    let area = corner.align_size_within_rect(text.size() + vec2(12.0, 6.0), placed.visible().shrink(6.0));
    painter.rect_filled(area, 3.0, Color32::from_black_alpha(190));
    painter.galley(area.min + vec2(6.0, 3.0), text, Color32::WHITE);
}
