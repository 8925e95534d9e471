//! The menus at the left of the toolbar. Actions that other widgets share are in [`Session`].

use egui::{Button, ThemePreference, Ui, containers::menu::menu_style};

use crate::{
    intent::{Ask, Intent},
    route::Route,
    session::Session,
};

/// Paths that come with the program.
const ROUTES: [(&str, &str); 3] = [
    ("orbit", "Back and forth around the point that the scene's camera looks at"),
    ("fly", "A gentle loop forwards and sideways"),
    ("shake", "A hand-held camera"),
];

/// Shows them.
pub fn show(ui: &mut Ui, session: &mut Session) {
    ui.scope(|ui| {
        menu_style(ui.style_mut());
        ui.menu_button("File", |ui| file(ui, session));
        ui.menu_button("Camera", |ui| camera(ui, session));
        ui.menu_button("Output", |ui| output(ui, session));
        ui.menu_button("Window", |ui| window(ui, session));
    });
}

/// An entry with its shortcut. Returns true if it was chosen.
fn entry(ui: &mut Ui, enabled: bool, text: &str, keys: &str) -> bool {
    ui.add_enabled(enabled, Button::new(text).shortcut_text(keys)).clicked()
}

fn ask(ui: &mut Ui, session: &mut Session, enabled: bool, text: &str, keys: &str, ask: Ask) {
    if entry(ui, enabled, text, keys) {
        session.push(Intent::Ask(ask));
    }
}

fn file(ui: &mut Ui, session: &mut Session) {
    ask(ui, session, true, "New from a graph …", "", Ask::NewGraph);
    ask(ui, session, true, "New change to a graph …", "", Ask::NewChange);
    ask(ui, session, true, "Open graph …", "Ctrl+O", Ask::OpenGraph);
    ask(ui, session, true, "Open scene …", "", Ask::OpenScene);
    ui.separator();
    if entry(ui, session.document.is_dirty(), "Save", "Ctrl+S") {
        session.save();
    }
    ask(ui, session, true, "Save as …", "Ctrl+Shift+S", Ask::SaveGraph);
    ask(ui, session, true, "Write out in full …", "", Ask::FullGraph);
    ui.separator();
    if entry(ui, session.document.can_undo(), "Undo", "Ctrl+Z") {
        session.document.undo();
    }
    if entry(ui, session.document.can_redo(), "Redo", "Ctrl+Shift+Z") {
        session.document.redo();
    }
}

fn camera(ui: &mut Ui, session: &mut Session) {
    let ready = session.camera().is_some();
    if entry(ui, ready, "Home", "Home") {
        session.move_camera(|rig| rig.go_home());
    }
    ui.separator();
    if session.recorded_seconds().is_some() {
        if entry(ui, true, "Stop recording the path", "F9") {
            session.toggle_recorder();
        }
    } else if entry(ui, ready, "Record a path while flying", "F9") {
        session.toggle_recorder();
    }
    if session.is_playing() {
        if entry(ui, true, "Stop playing", "F10") {
            session.toggle_playback();
        }
    } else {
        let what = session.route().map_or("a path".into(), Route::label);
        if entry(ui, ready && session.route().is_some(), &format!("Play {what}"), "F10") {
            session.toggle_playback();
        }
    }
    for (name, doc) in ROUTES {
        if ui.add_enabled(ready, Button::new(format!("Play {name}"))).on_hover_text(doc).clicked() {
            session.play(Route::named(name));
        }
    }
    ui.separator();
    ask(ui, session, ready, "Open path …", "", Ask::OpenPath);
    ask(ui, session, session.route().is_some(), "Save path …", "", Ask::SavePath);
}

fn output(ui: &mut Ui, session: &mut Session) {
    let runs = session.state.graph.is_some();
    ask(ui, session, runs, "Save image …", "Ctrl+E", Ask::SaveImage);
    ask(ui, session, runs && session.route().is_some(), "Record the path's frames …", "", Ask::RecordFrames);
    ui.separator();
    if entry(ui, runs, "Copy as a command line", "Ctrl+Shift+C") {
        session.push(Intent::CopyCommandLine);
    }
    ui.separator();
    let mut guarded = session.is_guarded();
    let hint = "Check every number that a node writes: at a NaN, an infinity, a negative colour or an index beyond its \
                list, pause and show node and pixel";
    if ui.checkbox(&mut guarded, "Pause at the first bad number").on_hover_text(hint).changed() {
        session.guard(guarded);
    }
}

fn window(ui: &mut Ui, session: &mut Session) {
    for (theme, text) in [
        (ThemePreference::Light, "Light"),
        (ThemePreference::Dark, "Dark"),
        (ThemePreference::System, "System"),
    ] {
        ui.radio_value(&mut session.settings.theme, theme, text);
    }
    ui.separator();
    if entry(ui, true, "Reset panes", "") {
        session.push(Intent::ResetPanes);
    }
    if entry(ui, true, "Keys and mouse", "F1") {
        session.push(Intent::Help);
    }
}
