//! A package with a stage of its own.

pub mod stage;

use epigraph::Registry;

/// The stages that come with Epigraph, and the one of this package.
pub fn registry() -> Registry {
    epigraph::registry().with::<stage::StarterStage>()
}
