use std::fs;

use egui_kittest::{SnapshotError, try_image_snapshot_options};

use super::*;

#[test]
fn the_window() {
    let mut opened = window("epi.ron");
    compare(&mut opened, "window");
}

#[test]
fn one_letter_of_the_status_line_is_a_difference() {
    // Updating writes what is found, so that nothing could differ.
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let stored = options();
    fs::copy(stored.output_path.join("window.png"), folder.path().join("window.png")).unwrap();
    let aside = stored.output_path(folder.path());
    let mut opened = window("epi.ron");
    let mut compared = |notice: Option<&str>| {
        opened.harness.state_mut().session.notice = notice.map(Into::into);
        opened.harness.run_steps(2);
        try_image_snapshot_options(&opened.harness.render().unwrap(), "window", &aside)
    };
    compared(None).unwrap();
    let other = compared(Some("../graphs/epj.ron"));
    assert!(matches!(other, Err(SnapshotError::Diff { .. })), "{other:?}");
}
