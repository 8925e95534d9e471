//! The toolbar: menus, running, the camera's path, sampling, placement, and the file.

use egui::{Button, ComboBox, DragValue, Response, RichText, Slider, Ui, WidgetType};

use crate::{
    engine::{Backend, Command, Pace},
    menu,
    name::Named,
    session::{SCALES, Session},
    theme,
};

/// Common frame sizes.
const SIZES: [[u32; 2]; 6] = [[256, 256], [512, 512], [640, 480], [768, 768], [1024, 1024], [1280, 720]];

/// Shows it.
pub fn show(ui: &mut Ui, session: &mut Session) {
    ui.add_space(3.0);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 6.0;
        menu::show(ui, session);
        ui.separator();
        running(ui, session);
        ui.separator();
        path(ui, session);
        ui.separator();
        sampling(ui, session);
        ui.separator();
        placing(ui, session);
        ui.separator();
        file(ui, session);
    });
    ui.add_space(3.0);
}

/// A button with a symbol; `name` is its accessible name.
fn sign(ui: &mut Ui, enabled: bool, sign: impl Into<RichText>, name: &str) -> Response {
    let button = ui.add_enabled(enabled, Button::new(sign.into()).min_size([24.0, 0.0].into()));
    button.named(WidgetType::Button, name)
}

/// A box to choose one of `all`: values, with their names and descriptions. `name` is its accessible name.
fn choice<T>(ui: &mut Ui, value: &mut T, all: &[(T, &str, &str)], name: &str) -> Response
where
    T: Copy + PartialEq + ToString,
{
    let combo = ComboBox::from_id_salt(name).selected_text(value.to_string());
    let combo = combo.show_ui(ui, |ui| {
        for (each, label, doc) in all {
            ui.selectable_value(value, *each, *label).on_hover_text(*doc);
        }
    });
    combo.response.named(WidgetType::ComboBox, name)
}

fn running(ui: &mut Ui, session: &mut Session) {
    let paused = session.state.paused;
    let label = if paused { "▶ Run" } else { "⏸ Pause" };
    if ui.add(Button::new(label).min_size([72.0, 0.0].into())).on_hover_text("Run or pause").clicked() {
        session.engine.send(Command::Pause(!paused));
    }
    let step = ui.add_enabled(paused, Button::new("Step"));
    if step
        .on_hover_text("Run one frame")
        .on_disabled_hover_text("Pause first to run one frame at a time")
        .clicked()
    {
        session.engine.send(Command::Step(1));
    }
    if ui.button("Reset").on_hover_text("Discard the cloud of samples and restart from frame 0").clicked() {
        session.engine.send(Command::Reset);
    }
}

/// Recording and playing the camera's path.
fn path(ui: &mut Ui, session: &mut Session) {
    let recording = session.recorded_seconds();
    let (text, name) = match recording {
        Some(_) => (RichText::new("⏹").color(theme::palette(ui).bad), "Stop recording the path"),
        None => (RichText::new("⏺"), "Record a path"),
    };
    let hint = match recording {
        Some(seconds) => format!("Recording the camera's path, {seconds:.1} s. Stop (F9)"),
        None => "Record the camera's path while you fly (F9)".into(),
    };
    if sign(ui, session.camera().is_some(), text, name).on_hover_text(hint).clicked() {
        session.toggle_recorder();
    }
    let playing = session.is_playing();
    let (text, name) = if playing { ("⏹", "Stop playing") } else { ("⏵", "Play the path") };
    let hint = match session.route() {
        _ if playing => "Stop playing (F10)".into(),
        Some(route) => {
            format!("Play {} from its beginning: the same frames each time (F10)", route.label())
        }
        None => String::new(),
    };
    let enabled = playing || session.route().is_some() && session.camera().is_some();
    let button = sign(ui, enabled, text, name).on_hover_text(hint);
    if button.on_disabled_hover_text("Record a path, or choose one from the Camera menu").clicked() {
        session.toggle_playback();
    }
}

fn sampling(ui: &mut Ui, session: &mut Session) {
    let label = ui.label("Samples");
    let slider = Slider::new(&mut session.settings.samples, 0.1..=100.0)
        .logarithmic(true)
        .suffix("%")
        .max_decimals(1)
        .clamping(egui::SliderClamping::Always);
    let response = ui.add(slider).labelled_by(label.id);
    if response.on_hover_text("Maximum number of samples per frame, as a share of its pixels").changed() {
        session.engine.send(Command::Samples(session.settings.samples / 100.0));
    }
    let before = session.settings.pacing;
    choice(ui, &mut session.settings.pacing, &Pace::ALL, "Samples arrive")
        .on_hover_text("When samples arrive");
    if session.settings.pacing != before {
        session.engine.send(Command::Pace(session.settings.pacing));
    }
}

fn placing(ui: &mut Ui, session: &mut Session) {
    let before = session.settings.backend;
    choice(ui, &mut session.settings.backend, &Backend::ALL, "Backend")
        .on_hover_text("Default placement for nodes without `on:`");
    if session.settings.backend != before {
        session.engine.send(Command::Backend(session.settings.backend));
    }
    let text = |[width, height]: [u32; 2]| format!("{width}×{height}");
    let combo = ComboBox::from_id_salt("size").selected_text(text(session.settings.size)).width(86.0);
    let response = combo.show_ui(ui, |ui| {
        for size in SIZES {
            if ui.selectable_value(&mut session.settings.size, size, text(size)).changed() {
                session.resize();
            }
        }
    });
    response
        .response
        .named(WidgetType::ComboBox, "Frame size")
        .on_hover_text("Width and height of the frame, pixels");
    let before = session.settings.scale;
    let scale =
        DragValue::new(&mut session.settings.scale).range(SCALES).speed(0.01).fixed_decimals(2).prefix("× ");
    let scale = ui.add(scale).named(WidgetType::DragValue, "Resolution scale");
    let [width, height] = session.frame_size();
    if scale.on_hover_text(format!("Resolution scale: frames are {width}×{height}")).changed()
        && session.settings.scale != before
    {
        session.resize();
    }
}

fn file(ui: &mut Ui, session: &mut Session) {
    let document = &mut session.document;
    if sign(ui, document.can_undo(), "⟲", "Undo").on_hover_text("Undo (Ctrl+Z)").clicked() {
        document.undo();
    }
    if sign(ui, document.can_redo(), "⟳", "Redo").on_hover_text("Redo (Ctrl+Shift+Z)").clicked() {
        document.redo();
    }
    let dirty = document.is_dirty();
    let save = ui.add_enabled(dirty, Button::new(if dirty { "Save *" } else { "Save" }));
    if save.on_hover_text("Save (Ctrl+S); only the characters that you edited change").clicked() {
        session.save();
    }
}
