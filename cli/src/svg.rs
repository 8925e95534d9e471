//! Files for plots.

use std::path::Path;

use epigraph_pictures::Target;

use crate::error::CliError;

/// A plot's file to be.
///
/// # Errors
/// That its name is no plot's, or that it cannot be written.
pub fn target(path: &Path) -> Result<Target, CliError> {
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("svg")) {
        return Err(CliError::write(path, "the plot is drawn as SVG; name it FILE.svg"));
    }
    Ok(Target::new(path)?)
}
