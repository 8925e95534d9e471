//! Output files of plots.

use std::path::Path;

use crate::{
    error::CliError,
    output::{Output, Outputs},
};

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
