//! The columns of the papers' timing tables, and the stage kinds that each of them counts.

/// One of the papers' columns.
pub struct Column {
    /// Its name in the papers' table.
    pub name: &'static str,
    /// The work that it counts.
    pub doc: &'static str,
    /// The stage kinds that do this work.
    kinds: &'static [&'static str],
}

/// The number of columns.
pub const COUNT: usize = 8;

/// The columns in the papers' order. Other stages (tone mapping, a user's own shaders) and transfers count as the rest of
/// the frame.
pub const COLUMNS: [Column; COUNT] = [
    Column {
        name: "P1",
        doc: "update points, request samples",
        kinds: &["point_cloud", "replace", "integrate", "motion", "carry", "age", "dither"],
    },
    Column { name: "P2", doc: "project points", kinds: &["project", "image_id"] },
    Column { name: "P3", doc: "predicted projection", kinds: &["predict"] },
    Column { name: "P4", doc: "depth cull", kinds: &["depth_cull"] },
    Column {
        name: "E1",
        doc: "find silhouettes and shadow edges",
        kinds: &["mesh", "silhouette", "compact", "shadow_edges"],
    },
    Column { name: "E2", doc: "rasterise edges", kinds: &["edge_raster"] },
    Column { name: "I1", doc: "classify pixels", kinds: &["classify"] },
    Column {
        name: "I2",
        doc: "reachability, interpolation, anti-aliasing",
        kinds: &["reach", "reach_cull", "interpolate", "fill", "spread", "subdivide", "antialias"],
    },
];

/// The range of [`COLUMNS`] that depends on the number of edges.
pub const EDGES: std::ops::RangeInclusive<usize> = 4..=5;

/// The index in [`COLUMNS`] of the column that counts stages of `kind`.
pub fn of(kind: &str) -> Option<usize> {
    COLUMNS.iter().position(|column| column.kinds.contains(&kind))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kinds that belong to no step of the papers' table.
    const REST: [&str; 3] = ["trace", "tonemap", "wgsl"];

    #[test]
    fn every_kind_belongs_to_a_column_or_to_the_rest() {
        let registry = epigraph_stages::registry();
        for name in registry.kinds().map(epigraph_core::Kind::name) {
            assert!(of(name).is_some() != REST.contains(&name), "which column counts `{name}`?");
        }
    }

    #[test]
    fn the_edge_columns_are_those_named_e() {
        assert!(COLUMNS[EDGES].iter().all(|column| column.name.starts_with('E')));
        assert_eq!(
            COLUMNS.iter().filter(|column| column.name.starts_with('E')).count(),
            COLUMNS[EDGES].len()
        );
    }

    #[test]
    fn no_kind_is_counted_twice() {
        let mut kinds: Vec<&str> = COLUMNS.iter().flat_map(|column| column.kinds).copied().collect();
        let count = kinds.len();
        kinds.sort_unstable();
        kinds.dedup();
        assert_eq!(kinds.len(), count);
    }
}
