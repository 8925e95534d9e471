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
