//! Progress on stderr, if stderr is a terminal.

use std::{fmt::Write, time::Duration};

use epigraph_scenes::texture_progress;
use indicatif::{ProgressBar, ProgressState, ProgressStyle};

/// A bar with the label `what`, of `total` steps that are called `unit`.
pub fn bar(total: u64, what: &str, unit: &str) -> ProgressBar {
    let template = format!("{{msg}} [{{wide_bar}}] {{pos}}/{{len}} {unit}, {{eta}} left");
    let bar = ProgressBar::new(total).with_message(what.to_owned());
    // If indicatif rejects the template, the default style is good enough.
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// Shows a spinner while `work` runs, and how many textures are read if it reads some.
pub fn spinner<T>(what: String, work: impl FnOnce() -> T) -> T {
    let spinner = ProgressBar::new_spinner().with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}{textures}") {
        spinner.set_style(style.with_key("textures", textures));
    }
    spinner.enable_steady_tick(Duration::from_millis(100));
    let done = work();
    spinner.finish_and_clear();
    done
}

fn textures(_: &ProgressState, to: &mut dyn Write) {
    let [done, wanted] = texture_progress();
    if wanted > 0 {
        // What cannot be written is not shown.
        let _ = write!(to, ": {done} of {wanted} textures");
    }
}
