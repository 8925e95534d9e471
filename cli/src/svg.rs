//! Plots: their output files, fonts, colours and grids.

use std::path::Path;

use epigraph_pictures::svg::{Anchor, Font, Svg};

use crate::{
    axis::Axis,
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

/// The colour of the line that is called `name`, of lines with these names.
pub fn line_color(names: &[&str], name: &str) -> &'static str {
    let nth = names.iter().position(|known| *known == name).unwrap_or(0);
    LINES[nth % LINES.len()]
}

/// Draws the grid of a panel, with the numbers of the axis across below it and those of the other one to its left.
pub fn grid(
    svg: &mut Svg,
    [across, down]: [&Axis; 2],
    [left, top]: [f64; 2],
    [width, height]: [f64; 2],
    numbers: [fn(f64) -> String; 2],
) {
    for value in across.ticks() {
        let x = across.at(value);
        svg.line([x, top], [x, top + height], GRID, 1.0);
        svg.text([x, top + height + 15.0], &numbers[0](value), Anchor::Middle, QUIET);
    }
    for value in down.ticks() {
        let y = down.at(value);
        svg.line([left, y], [left + width, y], GRID, 1.0);
        svg.text([left - 6.0, y + 4.0], &numbers[1](value), Anchor::End, QUIET);
    }
}

/// Adds the file of `--plot` or `--figure`.
///
/// # Errors
/// If its name does not end in `.svg`, and those of [`Outputs::add`].
pub fn add(outputs: &mut Outputs, option: &'static str, path: &Path) -> Result<Output, CliError> {
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("svg")) {
        let text = format!("the {} is written as SVG; name it FILE.svg", option.trim_start_matches('-'));
        return Err(CliError::write(path, text));
    }
    outputs.add(option, path)
}
