//! Epigraph's core: graph file -> checked graph -> plan -> execution. It knows no algorithm.
//!
//! A [`GraphFile`] is text with the place of everything in it. [`Registry`] turns its nodes into stages, each of which
//! has declared its ports once ([`Io`]). Shaders are composed and compared with those ports by naga, without a GPU.

pub use bytemuck;
pub use serde;

mod capture;
mod compile;
mod error;
mod executor;
mod explain;
mod file;
mod frame;
mod graph;
mod harness;
mod id;
mod params;
mod plan;
mod port;
mod reflect;
mod registry;
mod shader;
mod side;
mod stage;
pub mod testing;
mod wgsl;

pub use capture::{Capture, Snapshot};
pub use compile::compile;
pub use error::{GraphError, Place, Problem, Problems, Span, Spanned};
pub use executor::{AdapterChoice, Executor, Gpu, RunError};
pub use explain::{Around, Cell, Finding, Mark, Role, Site};
pub use file::*;
pub use frame::{Facts, Frame, View};
pub use graph::{Culled, Graph, MAX_LATENCY, MAX_SIDE, Node, PortRef, Settings};
pub use harness::{Harness, Outputs};
pub use id::{NodeId, SlotId, StepId, StorageId, TapId};
pub use params::{ParamError, ParamKind, ParamSpec, ParamValue, Params, parse_value};
pub use plan::{Bindings, Life, Plan, PlannedNode, Slot, SlotPair, Step, Storage, Tap, TapField, Value};
pub use port::{
    Access, Dims, Element, Extent, Field, FieldRef, Format, In, ItemMember, Lifetime, Member, Out, Port,
    PortElement, Scalar, plain, texel,
};
pub use reflect::{Entry, Reflected, Space, Variable, check as check_shader, compose as compose_shader};
pub use registry::{Kind, NodeContext, Registry};
pub use shader::{Needs, Pass, Shader, ShaderLibrary, Threads};
pub use side::{Download, PerSide, Side};
pub use stage::{AnyStage, Bundle, CpuContext, CpuMemory, Declaration, Host, Io, Stage};
pub use wgsl::{wgsl_kind, wgsl_kind_from};
