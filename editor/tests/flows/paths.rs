use super::output::rendered;
use crate::support::{Opened, words};
use egui::{Key, pos2};
use egui_kittest::kittest::Queryable;

/// Waits for the end of a path that was started after `commands` commands.
fn played(opened: &mut Opened, commands: u64) {
    opened.until("the path", |app| {
        let state = &app.session.state;
        state.commands > commands && state.playing.as_ref().is_some_and(|playing| !playing.is_under_way())
    });
}

/// Plays the current path to its end. Returns the number of frames, and the bytes of the last picture.
fn play(opened: &mut Opened) -> (u32, Vec<u8>) {
    let before = opened.app().session.state.commands;
    opened.click("Play the path");
    played(opened, before);
    let state = &opened.app().session.state;
    (state.frames, opened.app().session.snapshot("").unwrap().bytes.clone())
}

#[test]
fn a_recorded_path_is_played_saved_and_rendered_by_the_command_line() {
    let mut opened = Opened::new("epi.ron");
    opened.frames(3);
    let home = opened.app().session.camera().unwrap();
    opened.click("Record a path");
    opened.harness.hover_at(pos2(640.0, 380.0));
    opened.harness.run_steps(2);
    opened.harness.key_down(Key::W);
    opened.harness.run_steps(20);
    opened.harness.key_down(Key::D);
    opened.harness.run_steps(20);
    opened.harness.key_up(Key::W);
    opened.harness.key_up(Key::D);
    opened.click("Stop recording the path");
    let flown = opened.app().session.camera().unwrap();
    assert!(flown.eye.distance(home.eye) > 0.01);

    let first = play(&mut opened);
    assert!(first.0 > 15, "{} frames", first.0);
    let end = opened.app().session.state.camera.unwrap();
    assert!(end.eye.distance(flown.eye) < 1e-5, "{end:?}, {flown:?}");
    assert!(first == play(&mut opened));

    // A command line needs a saved path.
    assert!(opened.app().command_line().unwrap_err().contains("save the path first"));
    let file = opened.folder().join("flight.path.ron");
    opened.choose(&["Camera", "Save path …"]);
    opened.name(&file);
    opened.until("the file", |_| file.is_file());
    let line = opened.app().command_line().unwrap().to_string();
    assert!(line.contains(&format!("--camera fly:{}", file.display())), "{line}");
    let picture = rendered(&opened, &words(&line));
    assert!(picture == opened.shown());

    // Opening the file plays the same path.
    opened.click("Reset");
    opened.until("the reset", |app| app.session.state.frames == 0);
    let before = opened.app().session.state.commands;
    opened.choose(&["Camera", "Open path …"]);
    opened.name(&file);
    played(&mut opened, before);
    assert!(first.1 == opened.app().session.snapshot("").unwrap().bytes);
}

#[test]
fn moving_the_camera_stops_a_path() {
    let mut opened = Opened::new("render-cache.ron");
    opened.frames(1);
    opened.choose(&["Camera", "Play shake"]);
    opened.until("some frames", |app| {
        app.session.state.playing.as_ref().is_some_and(|playing| playing.frame > 2)
    });
    assert!(opened.app().session.is_playing());
    let line = opened.harness.query_by_label_contains("playing frame").is_some();
    assert!(line, "the status line says so");
    opened.harness.hover_at(pos2(640.0, 380.0));
    opened.harness.drag_at(pos2(640.0, 380.0));
    opened.harness.run_steps(1);
    opened.harness.hover_at(pos2(680.0, 380.0));
    opened.harness.run_steps(2);
    opened.harness.drop_at(pos2(680.0, 380.0));
    opened.until("the end", |app| !app.session.is_playing() && app.session.state.playing.is_none());
}
