//! Output files of plots.

use std::path::Path;

use epigraph_pictures::Target;

use crate::error::CliError;

/// The output file of a plot.
///
/// # Errors
/// If its name does not end in `.svg`, or if it cannot be written.
pub fn target(path: &Path) -> Result<Target, CliError> {
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("svg")) {
        return Err(CliError::write(path, "the plot is written as SVG; name it FILE.svg"));
    }
    Ok(Target::new(path)?)
}
