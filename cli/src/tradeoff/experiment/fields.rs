//! What an experiment's file may contain, not yet read into values: only the reader knows what makes sense.

use std::{fmt, marker::PhantomData, str::FromStr};

use epigraph::Samples;
use ron::value::RawValue;
use serde::{
    Deserialize, Deserializer,
    de::{Error, MapAccess, Visitor},
};

use crate::tradeoff::figure::{Cost, Metric};

/// The fields of a file, and those of its `quick`.
#[derive(Default, Deserialize)]
#[serde(rename = "Tradeoff", deny_unknown_fields)]
pub(super) struct Fields<'t> {
    #[serde(borrow, default)]
    pub(super) version: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) doc: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) graphs: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) scenes: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) cameras: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) sizes: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) frames: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) compare: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) change: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) budgets: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) vary: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) search: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) seeds: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) metrics: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) costs: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) reference: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) backend: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) quick: Option<&'t RawValue>,
}

impl<'t> Fields<'t> {
    /// These, where they are given, and else the others.
    pub(super) fn or(self, others: Self) -> Self {
        Self {
            version: others.version,
            doc: others.doc,
            graphs: self.graphs.or(others.graphs),
            scenes: self.scenes.or(others.scenes),
            cameras: self.cameras.or(others.cameras),
            sizes: self.sizes.or(others.sizes),
            frames: self.frames.or(others.frames),
            compare: self.compare.or(others.compare),
            change: self.change.or(others.change),
            budgets: self.budgets.or(others.budgets),
            vary: self.vary.or(others.vary),
            search: self.search.or(others.search),
            seeds: self.seeds.or(others.seeds),
            metrics: self.metrics.or(others.metrics),
            costs: self.costs.or(others.costs),
            reference: self.reference.or(others.reference),
            backend: self.backend.or(others.backend),
            quick: None,
        }
    }
}

/// A graph with a name or parameters.
#[derive(Deserialize)]
#[serde(rename = "Graph", deny_unknown_fields)]
pub(super) struct GraphFields<'t> {
    #[serde(borrow)]
    pub(super) graph: &'t RawValue,
    #[serde(borrow, default)]
    pub(super) name: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) set: Option<&'t RawValue>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum BudgetField {
    Samples(Parsed<Samples>),
    PathsPerPixel(f64),
}

#[derive(Deserialize)]
#[serde(rename = "Search", deny_unknown_fields)]
pub(super) struct SearchFields<'t> {
    #[serde(default)]
    pub(super) metric: Option<Metric>,
    #[serde(default)]
    pub(super) cost: Option<Cost>,
    pub(super) target: f64,
    #[serde(default)]
    pub(super) over: OverField,
    #[serde(borrow, default)]
    pub(super) from: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) to: Option<&'t RawValue>,
    #[serde(borrow, default)]
    pub(super) budget: Option<&'t RawValue>,
}

#[derive(Default, Deserialize)]
pub(super) enum OverField {
    #[default]
    Samples,
    Param(String),
}

#[derive(Deserialize)]
pub(super) enum Vary<'t> {
    Grid(#[serde(borrow)] Entries<'t>),
    OneAtATime(#[serde(borrow)] Entries<'t>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) enum Steps {
    Range { from: f64, to: f64, step: f64 },
}

#[derive(Deserialize)]
#[serde(rename = "Reference", deny_unknown_fields)]
pub(super) struct ReferenceFields<'t> {
    #[serde(borrow)]
    pub(super) spp: &'t RawValue,
    #[serde(default)]
    pub(super) mode: Option<Mode>,
}

#[derive(Clone, Copy, Deserialize)]
pub(super) enum Mode {
    Direct,
    Path,
}

/// The entries of a map in the order of the file, duplicates included.
pub(super) struct Entries<'t>(pub(super) Vec<(&'t RawValue, &'t RawValue)>);

impl<'de: 't, 't> Deserialize<'de> for Entries<'t> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct All<'t>(PhantomData<Entries<'t>>);
        impl<'de: 't, 't> Visitor<'de> for All<'t> {
            type Value = Entries<'t>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a map: { \"PARAM\": VALUE, ... }")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Entries(entries))
            }
        }
        from.deserialize_map(All(PhantomData))
    }
}

/// A value that is written as on the command line: in quotes, or as a whole number.
pub(super) struct Parsed<T>(pub(super) T);

impl<'de, T: FromStr<Err: fmt::Display>> Deserialize<'de> for Parsed<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Text<T>(PhantomData<T>);
        impl<T: FromStr<Err: fmt::Display>> Visitor<'_> for Text<T> {
            type Value = Parsed<T>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a text in quotes, or a whole number")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
                text.parse().map(Parsed).map_err(E::custom)
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
                self.visit_str(&number.to_string())
            }
        }
        from.deserialize_any(Text(PhantomData))
    }
}
