//! The columns of the papers' timing tables.

use epigraph_stages::column;

/// One of the papers' columns.
pub struct Column {
    /// Its name in the papers' table, by which stages name it.
    pub name: &'static str,
    /// The work that it counts.
    pub doc: &'static str,
}

/// The number of columns.
pub const COUNT: usize = 8;

/// The columns in the papers' order. Stages that name none of them (tone mapping, a user's own) and transfers count as
/// the rest of the frame.
pub const COLUMNS: [Column; COUNT] = [
    Column { name: column::P1, doc: "update points, request samples" },
    Column { name: column::P2, doc: "project points" },
    Column { name: column::P3, doc: "predicted projection" },
    Column { name: column::P4, doc: "depth cull" },
    Column { name: column::E1, doc: "find silhouettes and shadow edges" },
    Column { name: column::E2, doc: "rasterise edges" },
    Column { name: column::I1, doc: "classify pixels" },
    Column { name: column::I2, doc: "reachability, interpolation, anti-aliasing" },
];

/// The range of [`COLUMNS`] that depends on the number of edges.
pub const EDGES: std::ops::RangeInclusive<usize> = 4..=5;

/// The index in [`COLUMNS`] of the column of that name, if it is one of the papers'.
pub fn of(name: &str) -> Option<usize> {
    COLUMNS.iter().position(|column| column.name == name)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_column_is_some_stages() {
        let registry = epigraph_stages::registry();
        let named: BTreeSet<_> = registry
            .kinds()
            .filter_map(|kind| kind.declaration()?.column)
            .filter(|name| *name != column::TRACE)
            .collect();
        assert_eq!(named, COLUMNS.iter().map(|column| column.name).collect());
    }

    #[test]
    fn a_column_that_is_not_in_the_table_counts_as_the_rest() {
        assert_eq!(["P1", "I2", "trace", "G1"].map(of), [Some(0), Some(7), None, None]);
    }

    #[test]
    fn the_edge_columns_are_those_named_e() {
        let is_edges =
            |(index, column): (usize, &Column)| column.name.starts_with('E') == EDGES.contains(&index);
        assert!(COLUMNS.iter().enumerate().all(is_edges));
    }
}
