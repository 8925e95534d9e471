//! The columns of the papers' table of a frame's time ([`Io::column`](epigraph_core::Io::column)).

/// Update the point cloud and choose the next samples.
pub const P1: &str = "P1";
/// Project the points.
pub const P2: &str = "P2";
/// Predict the next view.
pub const P3: &str = "P3";
/// Cull hidden points.
pub const P4: &str = "P4";
/// Find silhouettes and shadow boundaries.
pub const E1: &str = "E1";
/// Rasterise edges.
pub const E2: &str = "E2";
/// Classify pixels.
pub const I1: &str = "I1";
/// Reachability, interpolation, anti-aliasing.
pub const I2: &str = "I2";
/// Tracing, which is not in the papers' table.
pub const TRACE: &str = "trace";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stage_counts_towards_its_column() {
        let all = [
            (
                P1,
                "age albedo carry dither integrate motion pending point_cloud replace stream_cut stream_decode",
            ),
            (P2, "image_id project"),
            (P3, "predict"),
            (P4, "depth_cull"),
            (E1, "compact mesh shadow_edges silhouette"),
            (E2, "edge_raster"),
            (I1, "classify"),
            (I2, "antialias fill interpolate reach reach_cull refine spread subdivide"),
            (TRACE, "trace"),
        ];
        let registry = crate::registry();
        for kind in registry.kinds() {
            let Some(declaration) = kind.declaration() else { continue };
            let of = all.iter().find(|(_, kinds)| kinds.split(' ').any(|name| name == kind.name()));
            // The rest of the frame: tone mapping, and what no paper has.
            assert_eq!(declaration.column, of.map(|(column, _)| *column), "{}", kind.name());
        }
    }
}
