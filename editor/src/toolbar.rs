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

const BACKENDS: [(Backend, &str, &str); 3] = [
    (Backend::Auto, "Auto", "A hardware GPU if there is one, else the CPU."),
    (Backend::Cpu, "CPU", "Native code."),
    (Backend::Gpu, "GPU", "Any GPU adapter, software ones included."),
];

const PACINGS: [(Pace, &str, &str); 2] = [
    (Pace::Async, "When traced", "Samples arrive once they are traced; no frame waits for them."),
    (
        Pace::Exact,
        "Each frame",
        "All samples arrive in the frame that requests them: every run gives the same picture.",
    ),
];

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

fn running(ui: &mut Ui, session: &mut Session) {
    let paused = session.state.paused;
    let label = if paused { "▶ Run" } else { "⏸ Pause" };
    if ui.add(Button::new(label).min_size([72.0, 0.0].into())).on_hover_text("Run or pause").clicked() {
        session.engine.send(Command::Pause(!paused));
    }
    let step = ui.add_enabled(paused, Button::new("Step"));
    if step
        .on_hover_text("Run one frame")
        .on_disabled_hover_text("Pause first, to run one frame at a time")
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
        _ if playing => "Leave the path (F10)".into(),
        Some(route) => {
            format!("Play {} from its beginning: the same frames each time (F10)", route.label())
        }
        None => String::new(),
    };
    let enabled = playing || session.route().is_some() && session.camera().is_some();
    let button = sign(ui, enabled, text, name).on_hover_text(hint);
    if button.on_disabled_hover_text("Record a path, or choose one in the menu Camera").clicked() {
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
    if response.on_hover_text("Most samples per frame, as a share of its pixels").changed() {
        session.engine.send(Command::Samples(session.settings.samples / 100.0));
    }
    let pacing = session.settings.pacing;
    let shown = PACINGS.iter().find(|(known, ..)| *known == pacing).map_or("", |(_, label, _)| label);
    let combo = ComboBox::from_id_salt("pacing").selected_text(shown).width(96.0);
    let response = combo.show_ui(ui, |ui| {
        for (pacing, label, doc) in PACINGS {
            if ui.selectable_value(&mut session.settings.pacing, pacing, label).on_hover_text(doc).changed() {
                session.engine.send(Command::Pace(pacing));
            }
        }
    });
    response.response.named(WidgetType::ComboBox, "Samples arrive").on_hover_text("When samples arrive");
}

fn placing(ui: &mut Ui, session: &mut Session) {
    let backend = session.settings.backend;
    let shown = BACKENDS.iter().find(|(known, ..)| *known == backend).map_or("", |(_, label, _)| label);
    let combo = ComboBox::from_id_salt("backend").selected_text(shown);
    let response = combo.show_ui(ui, |ui| {
        for (backend, label, doc) in BACKENDS {
            if ui.selectable_value(&mut session.settings.backend, backend, label).on_hover_text(doc).changed()
            {
                session.engine.send(Command::Backend(backend));
            }
        }
    });
    response
        .response
        .named(WidgetType::ComboBox, "Backend")
        .on_hover_text("Default placement for nodes without `on:`");
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
    if save.on_hover_text("Ctrl+S: only the characters that you edited change").clicked() {
        session.save();
    }
}
