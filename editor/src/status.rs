//! The status line at the bottom: problems, else the frame rate.

use egui::{Align, Label, Layout, ProgressBar, RichText, ScrollArea, Sense, Ui};
use epigraph_scenes::texture_progress;

use crate::{
    engine::{Command, Phase, Playing},
    files::short,
    intent::{Intent, Jump},
    session::Session,
    theme,
};

/// Maximum height of the list of problems, points.
const MOST: f32 = 120.0;

/// Shows it.
pub fn show(ui: &mut Ui, session: &mut Session) {
    ui.add_space(2.0);
    problems(ui, session);
    ui.horizontal(|ui| {
        notes(ui, session);
        state(ui, session);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| figures(ui, session));
    });
    ui.add_space(2.0);
}

/// All problems, each with its position. A click shows it in the text.
fn problems(ui: &mut Ui, session: &mut Session) {
    if session.problems().is_empty() {
        return;
    }
    let mut jump = None;
    ScrollArea::vertical().max_height(MOST).show(ui, |ui| {
        for problem in session.problems() {
            let place = problem.place.as_ref();
            let lead = place.map_or(String::new(), |place| {
                format!("{}:{}:{}  ", short(&place.file), place.line, place.column)
            });
            let node = problem.node.as_ref().map_or(String::new(), |node| format!("{node}: "));
            let text =
                RichText::new(format!("⚠ {lead}{node}{}", problem.error)).color(theme::palette(ui).bad);
            let response = ui.add(Label::new(text).wrap().sense(Sense::click()));
            let response = response.on_hover_text("Show in text");
            if let (true, Some(place)) = (response.clicked(), place) {
                jump = Some(Jump { path: place.file.clone(), at: (place.line, place.column) });
            }
        }
    });
    if let Some(jump) = jump {
        session.push(Intent::Jump(jump));
    }
    ui.separator();
}

/// A button that lists what of the scene's files is not in the scene as it stands.
fn notes(ui: &mut Ui, session: &Session) {
    let notes = session.state.report.notes();
    if notes.is_empty() {
        return;
    }
    let title =
        if notes.len() == 1 { "scene: 1 note".into() } else { format!("scene: {} notes", notes.len()) };
    ui.menu_button(title, |ui| {
        for note in notes {
            ui.label(note.to_string());
        }
    })
    .response
    .on_hover_text("What of the scene's files is left out, approximated, repaired or added");
}

fn state(ui: &mut Ui, session: &Session) {
    let state = &session.state;
    if !session.engine.is_alive() {
        ui.colored_label(theme::palette(ui).bad, "the engine has stopped; save and restart the editor");
    } else if let Phase::Failed(why) = &state.phase {
        ui.colored_label(theme::palette(ui).bad, format!("{why}; choose another with File, Open scene"));
    } else if state.phase == Phase::Loading {
        ui.spinner();
        ui.label(match texture_progress() {
            [_, 0] => "reading the scene …".to_owned(),
            [done, wanted] => format!("reading the scene: {done} of {wanted} textures …"),
        });
    } else if let Some(trouble) = &state.trouble {
        ui.colored_label(theme::palette(ui).bad, trouble);
    } else if let Some(bad) = &state.bad {
        let text = RichText::new(format!("paused: {bad}")).color(theme::palette(ui).bad);
        ui.add(Label::new(text).truncate()).on_hover_text(bad.to_string());
    } else if let Some(seconds) = session.recorded_seconds() {
        ui.label(format!("recording the camera's path, {seconds:.1} s"));
    } else if let (Some(playing), true) = (&state.playing, session.is_playing()) {
        progress(ui, session, playing);
    } else if let Some(notice) = session.notice() {
        ui.label(notice);
    } else if !session.problems().is_empty() {
        ui.label("the last good graph keeps running");
    } else {
        let document = &session.document;
        let dirty = if document.is_dirty() { "  (not saved)" } else { "" };
        ui.weak(format!("{}{dirty}", document.path()));
    }
}

/// The progress of a path.
fn progress(ui: &mut Ui, session: &Session, playing: &Playing) {
    let what = if playing.recorded { "recording frame" } else { "playing frame" };
    ui.label(format!("{what} {} of {}", playing.frame, playing.frames));
    let bar = ProgressBar::new(playing.frame as f32 / playing.frames as f32);
    ui.add(bar.desired_width(160.0).desired_height(10.0));
    if ui.small_button("Cancel").clicked() {
        session.engine.send(Command::Stop);
    }
}

fn figures(ui: &mut Ui, session: &Session) {
    let state = &session.state;
    let Some(graph) = &state.graph else { return };
    let bytes: u64 = graph.bytes.iter().sum();
    let mut figures = vec![
        if state.frames == 1 { "1 frame".into() } else { format!("{} frames", state.frames) },
        format!("{:.1} ms", state.frame_ms),
        format!("{:.0} frames/s", state.rate),
        format!("{} samples/frame", state.samples),
        format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20)),
        graph.gpu.clone().unwrap_or_else(|| "CPU".into()),
    ];
    if state.paused {
        figures[2] = "paused".into();
    } else if let Some(rate) = session.window_rate() {
        figures.insert(3, format!("window {rate}/s"));
    }
    // This layout runs from the right.
    for figure in figures.into_iter().rev() {
        ui.weak(figure);
    }
}
