//! Prefix sums in shaders: `shaders/shared/scan.wgsl`.

epigraph_core::constants! {
    /// Workgroups of each of the two passes, and the number of sums that the first one writes.
    pub const SCAN_BLOCKS: u32 = 256;
}
