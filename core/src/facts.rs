//! What an application states about the content it shows, by name.
//!
//! Quantities and facts have no meaning here. A crate of stages defines its own as constants, the application states
//! them in [`Settings::facts`](crate::Settings::facts), and stages use them: a quantity as the length of a list, both
//! to detect that a stage is not needed ([`Stage::needless`](crate::Stage::needless)). A crate can derive further
//! quantities from what the application states: [`Registry::with_count`](crate::Registry::with_count).
//!
//! What is not stated is unknown, not zero or false: no stage counts as needless because of it, and a list that is as long
//! as an unknown quantity is an error.
//!
//! ```
//! use epigraph_core::{Extent, Fact, Facts, Quantity};
//!
//! /// The sheets of the map.
//! const SHEETS: Quantity = Quantity { name: "sheets", one: "sheet" };
//! /// The map shows heights.
//! const HAS_HEIGHTS: Fact = Fact { name: "has_heights" };
//!
//! let facts = Facts::none().with(SHEETS, 12).stating(HAS_HEIGHTS, true);
//! assert!(facts.count(SHEETS) == Some(12) && facts.holds(HAS_HEIGHTS) == Some(true));
//! assert_eq!(Facts::none().count(SHEETS), None);
//! assert_eq!(SHEETS.list().to_string(), "a list of one per sheet");
//! ```

use std::collections::BTreeMap;

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

/// What an application states. As JSON, `counts` and `facts` by name.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Facts {
    counts: BTreeMap<&'static str, u32>,
    facts: BTreeMap<&'static str, bool>,
}

impl Facts {
    /// Nothing is stated: for graphs whose stages ask for nothing.
    pub const fn none() -> Self {
        Self { counts: BTreeMap::new(), facts: BTreeMap::new() }
    }

    /// States the count of a quantity.
    pub fn with(mut self, quantity: Quantity, count: u32) -> Self {
        self.counts.insert(quantity.name, count);
        self
    }

    /// States whether a fact holds.
    pub fn stating(mut self, fact: Fact, holds: bool) -> Self {
        self.facts.insert(fact.name, holds);
        self
    }

    /// The count of a quantity; `None` if it is not stated.
    pub fn count(&self, quantity: Quantity) -> Option<u32> {
        self.counts.get(quantity.name).copied()
    }

    /// Whether a fact holds; `None` if that is not stated.
    pub fn holds(&self, fact: Fact) -> Option<bool> {
        self.facts.get(fact.name).copied()
    }
}
