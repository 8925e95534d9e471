//! Pictures of the window, compared with reviewed ones beside this file.
//!
//! Their frames run on the CPU, with exact samples and a fixed number of frames; times are not measured. So pictures
//! differ between machines only in the driver's rasterisation: the coverage at the edges of glyphs and lines may differ
//! by a few levels, within [`THRESHOLD`] in every pixel. [`FAILURES`] allows for the few pixels whose centre lies on
//! the border of a texel.
//!
//! `UPDATE_SNAPSHOTS=1 cargo test --release -p epigraph-editor --test window` replaces the pictures that differ. Look
//! at each before you commit it.

mod canvas;
mod panes;
mod whole;

use egui_kittest::{SnapshotOptions, SnapshotResult, try_image_snapshot_options};

use crate::support::{self, Opened, WINDOW};

/// Largest difference of a pixel's colour: the squared distance in YIQ, which is 0.5053 d² for greys that differ by `d`
/// levels of 255. This is four levels.
const THRESHOLD: f32 = 8.1;

/// The number of pixels that may differ by more.
const FAILURES: usize = 8;

fn options() -> SnapshotOptions {
    SnapshotOptions::new().threshold(THRESHOLD).max_failed_pixels(FAILURES)
}

/// Number of frames before a picture: enough for the cloud to cover the image.
const FRAMES: u32 = 12;

/// A window of 1280x720 on a shipped graph after [`FRAMES`] frames, in which every step counts as a millisecond.
pub fn window(graph: &str) -> Opened {
    let builder = egui_kittest::Harness::builder().with_size(WINDOW);
    let mut opened = Opened::shipped(graph, builder, support::options([256, 192]));
    // One at a time, so that the window sees each frame.
    (0..FRAMES).for_each(|_| opened.frames(1));
    opened
}

/// Like [`window`], in the light theme.
pub fn light_window(graph: &str) -> Opened {
    let mut opened = window(graph);
    opened.harness.state_mut().session.settings.theme = egui::ThemePreference::Light;
    opened.harness.run_steps(3);
    opened
}

/// Compares the window with the stored picture of this name.
///
/// # Panics
/// They differ by more than the tolerance. A picture of the difference is written beside the stored one.
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
