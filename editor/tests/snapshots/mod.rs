//! Pictures of the window, compared with the reviewed ones that lie beside this file.
//!
//! The frames in them are the CPU's, exact, and counted; times are not measured. So what may differ from machine to
//! machine is only how the driver draws the window: the coverage of a glyph's or a line's edge, by a few levels. That is
//! what [`THRESHOLD`] lets pass, in every pixel; [`FAILURES`] lets pass the few where a texel's border falls on a pixel's
//! centre.
//!
//! `UPDATE_SNAPSHOTS=1 cargo test --release -p epigraph-editor --test window` writes those anew that no longer fit; look
//! at each before it is committed.

mod canvas;
mod panes;
mod whole;

use egui_kittest::{SnapshotOptions, SnapshotResult, try_image_snapshot_options};

use crate::support::{self, Opened, WINDOW};

/// How far a pixel's colour may be off: the squared distance in YIQ, in which a grey of `d` levels of 255 is 0.5053 d² off.
/// These are four levels.
const THRESHOLD: f32 = 8.1;

/// How many pixels may be off by more.
const FAILURES: usize = 8;

fn options() -> SnapshotOptions {
    SnapshotOptions::new().threshold(THRESHOLD).max_failed_pixels(FAILURES)
}

/// Frames of the graph in a picture: enough for the cloud to cover the image.
const FRAMES: u32 = 12;

/// A window of 1280x720 on a shipped graph after some frames, in which every step counts as a millisecond.
pub fn window(graph: &str) -> Opened {
    let builder = egui_kittest::Harness::builder().with_size(WINDOW);
    let mut opened = Opened::shipped(graph, builder, support::options([256, 192]));
    // One by one, so that the window sees each of them.
    (0..FRAMES).for_each(|_| opened.frames(1));
    opened
}

/// The same in the light theme.
pub fn light_window(graph: &str) -> Opened {
    let mut opened = window(graph);
    opened.harness.state_mut().session.settings.theme = egui::ThemePreference::Light;
    opened.harness.run_steps(3);
    opened
}

/// Compares the window with the stored picture of that name.
///
/// # Panics
/// Where they differ by more than the tolerance: the difference lies beside the picture.
#[track_caller]
pub fn compare(opened: &mut Opened, name: &str) {
    if let Err(error) = try_compare(opened, name) {
        panic!("{error}");
    }
}

fn try_compare(opened: &mut Opened, name: &str) -> SnapshotResult {
    let image = opened.harness.render().unwrap();
    try_image_snapshot_options(&image, name, &options())
}
