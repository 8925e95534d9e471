use std::fs;

use egui_kittest::{SnapshotError, try_image_snapshot_options};

use super::*;

#[test]
fn the_window() {
    let mut opened = window("epi.ron");
    compare(&mut opened, "window");
}

#[test]
fn the_window_in_the_light_theme() {
    compare(&mut light_window("epi.ron"), "window-light");
}

#[test]
fn the_help_on_a_screen_of_high_density() {
    let builder = egui_kittest::Harness::builder().with_size(WINDOW).with_pixels_per_point(2.0);
    let mut opened = Opened::shipped("render-cache.ron", builder, support::options([256, 192]));
    (0..FRAMES).for_each(|_| opened.frames(1));
    opened.harness.key_press(egui::Key::F1);
    opened.harness.run_steps(4);
    compare(&mut opened, "help-high-density");
}

#[test]
fn a_menu_and_dialogs() {
    let mut opened = window("epi.ron");
    opened.click("Camera");
    compare(&mut opened, "menu");
    opened.harness.key_press(egui::Key::Escape);
    opened.choose(&["File", "Open scene …"]);
    compare(&mut opened, "dialog-scene");
    opened.click("Cancel");
    let mut opened = light_window("epi.ron");
    opened.choose(&["Output", "Save image …"]);
    compare(&mut opened, "dialog-image-light");
}

#[test]
fn one_letter_of_the_status_line_is_a_difference() {
    // An update writes the window's picture, so it could not differ.
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let stored = options();
    fs::copy(stored.output_path.join("window.png"), folder.path().join("window.png")).unwrap();
    let aside = stored.output_path(folder.path());
    let mut opened = window("epi.ron");
    let compared =
        |opened: &mut Opened| try_image_snapshot_options(&opened.harness.render().unwrap(), "window", &aside);
    compared(&mut opened).unwrap();
    opened.harness.state_mut().session.tell("../graphs/epj.ron");
    opened.harness.run_steps(2);
    let other = compared(&mut opened);
    assert!(matches!(other, Err(SnapshotError::Diff { .. })), "{other:?}");
}
