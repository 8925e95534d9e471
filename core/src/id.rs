//! Typed indices, so that a node's index cannot be used as a storage's.

use index_vec::define_index_type;

define_index_type! {
    /// A node of a flattened file: index in [`Flat::nodes`](crate::file::Flat::nodes).
    pub(crate) struct FlatId = u32;
}

define_index_type! {
    /// A node that runs: index in [`Graph::nodes`](crate::Graph::nodes) and [`Plan::nodes`](crate::Plan::nodes).
    pub struct NodeId = u32;
}

define_index_type! {
    /// Index in [`Plan::storages`](crate::Plan::storages).
    pub struct StorageId = u32;
}

define_index_type! {
    /// Index in one side's [`Plan::slots`](crate::Plan::slots).
    pub struct SlotId = u32;
}

define_index_type! {
    /// Index in [`Plan::steps`](crate::Plan::steps).
    pub struct StepId = u32;
}

define_index_type! {
    /// Index in [`Plan::taps`](crate::Plan::taps).
    pub struct TapId = u32;
}
