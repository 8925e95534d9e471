//! Plots: their output files, fonts and colours.

use std::path::Path;

use epigraph_pictures::svg::Font;

use crate::{
    error::CliError,
    output::{Output, Outputs},
};

/// Colours of lines, repeated if there are more.
pub const LINES: [&str; 8] =
    ["#c0392b", "#2563a8", "#2f8f4e", "#7d5ba6", "#c8760a", "#57606a", "#1797a6", "#b8479a"];

/// The title of a plot.
pub const TITLE: Font = Font { size: 22.0, color: "#1b1f24", bold: true };
/// The title of a panel.
pub const HEADING: Font = Font { size: 14.0, color: "#1b1f24", bold: true };
/// Names of axes and lines.
pub const LABEL: Font = Font { size: 12.5, color: "#30363d", bold: false };
/// Numbers and remarks.
pub const QUIET: Font = Font { size: 11.5, color: "#6e7781", bold: false };
/// The colour of the grid.
pub const GRID: &str = "#e3e6ea";

/// Adds the file of `--plot`.
///
/// # Errors
/// If its name does not end in `.svg`, and those of [`Outputs::add`].
pub fn add(outputs: &mut Outputs, path: &Path) -> Result<Output, CliError> {
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("svg")) {
        return Err(CliError::write(path, "the plot is written as SVG; name it FILE.svg"));
    }
    outputs.add("--plot", path)
}
