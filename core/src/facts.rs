//! What an application states about the content it shows, by name.
//!
//! Quantities and facts have no meaning here. A crate of stages defines its own as constants, the application states
//! them in [`Settings::facts`](crate::Settings::facts), and stages use them: a quantity as the length of a list, both
//! to detect that a stage is not needed ([`Stage::needless`](crate::Stage::needless)). A crate can derive further
//! quantities from what the application states: [`Registry::with_count`](crate::Registry::with_count).
//!
//! ```
//! use epigraph_core::{Extent, Fact, Facts, Quantity};
//!
//! /// The sheets of the map.
//! const SHEETS: Quantity = Quantity { name: "sheets", one: "sheet" };
//! /// The map shows heights.
//! const HAS_HEIGHTS: Fact = Fact { name: "has_heights" };
//!
//! let facts = Facts::default().with(SHEETS, 12).stating(HAS_HEIGHTS, true);
//! assert!(facts.count(SHEETS) == 12 && facts.holds(HAS_HEIGHTS));
//! assert_eq!(SHEETS.list().to_string(), "a list of one per sheet");
//! ```

use std::collections::{BTreeMap, BTreeSet};

/// Something that can be counted, such as the edges of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// Its name; quantities of the same name are the same.
    pub name: &'static str,
    /// The singular, as in "a list of one per edge".
    pub one: &'static str,
}

/// Something that is true or not, such as that the camera moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fact {
    /// Its name; facts of the same name are the same.
    pub name: &'static str,
}

/// What an application states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    counts: BTreeMap<&'static str, u32>,
    holding: BTreeSet<&'static str>,
}

impl Facts {
    /// States the count of a quantity.
    pub fn with(mut self, quantity: Quantity, count: u32) -> Self {
        self.counts.insert(quantity.name, count);
        self
    }

    /// States whether a fact holds.
    pub fn stating(mut self, fact: Fact, holds: bool) -> Self {
        if holds {
            self.holding.insert(fact.name);
        } else {
            self.holding.remove(fact.name);
        }
        self
    }

    /// The count of a quantity; 0 if not stated.
    pub fn count(&self, quantity: Quantity) -> u32 {
        self.counts.get(quantity.name).copied().unwrap_or(0)
    }

    /// Whether a fact is stated to hold.
    pub fn holds(&self, fact: Fact) -> bool {
        self.holding.contains(fact.name)
    }
}
