//! A package with a stage of its own, and two programs that know it: the command line and the editor.

pub mod median;

use epigraph::Registry;

/// The stages that come with Epigraph, and the one of this package.
pub fn registry() -> Registry {
    epigraph::registry().with::<median::Median>()
}
