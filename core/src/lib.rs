//! Epigraph's core: graph file -> checked graph -> plan -> execution. It knows no algorithm.
//!
//! A [`GraphFile`] is text with the place of everything in it. [`Registry`] turns its nodes into stages, each of which
//! declares its ports once ([`Io`]). naga composes shaders and compares them with those ports, without a GPU.
//! [`compile`] makes a [`Plan`], which needs no GPU either; an [`Executor`] allocates its memory and runs it.
//!
//! ```
//! use epigraph_core::{Facts,
//!     CpuContext, Executor, Extent, Frame, GraphFile, Host, Io, Out, Registry, Settings, Stage, compile, params,
//! };
//!
//! params! {
//!     /// Parameters of [`Ramp`].
//!     pub struct RampParams {
//!         /// Difference between neighbouring pixels.
//!         step: f32 = 1.0, in 0.0..=10.0;
//!     }
//! }
//!
//! /// Values that grow from pixel to pixel. It has no shader, so it runs on the CPU only.
//! struct Ramp {
//!     values: Out<f32>,
//! }
//!
//! impl Stage for Ramp {
//!     const KIND: &'static str = "ramp";
//!     const DOC: &'static str = "Values that grow from pixel to pixel.";
//!     type Params = RampParams;
//!
//!     fn declare(_: &RampParams, io: &mut Io) -> Self {
//!         Self { values: io.write("values", "In reading order.", Extent::Frame(1)) }
//!     }
//!
//!     fn cpu(&self, params: &RampParams, cx: &CpuContext) -> Result<(), String> {
//!         for (index, value) in cx.write(self.values).iter_mut().enumerate() {
//!             *value = index as f32 * params.step;
//!         }
//!         Ok(())
//!     }
//! }
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = r#"Graph(
//!     version: 1,
//!     nodes: { "ramp": (kind: "ramp", params: (step: 0.5)) },
//!     outputs: { "values": "ramp.values" },
//! )"#;
//! let file = GraphFile::parse("ramp.ron", text)?;
//! let (registry, settings) = (Registry::default().with::<Ramp>(), Settings::new([2, 2], 0, Facts::none()));
//! let (graph, plan) = compile(&file, &registry, &settings)?;
//! let mut executor = Executor::new(graph, plan, &settings, &registry, None)?;
//! executor.run(&Frame { size: [2, 2], ..Frame::default() }, &Host::default(), true)?;
//! let values = executor.snapshot("values", "")?.expect("an output").get::<f32>();
//! assert_eq!(values, [0.0, 0.5, 1.0, 1.5]);
//!
//! // An error names its place, and suggests what was probably meant.
//! let file = GraphFile::parse("ramp.ron", &text.replace("step", "stop"))?;
//! let problems = compile(&file, &registry, &settings).err().expect("a parameter that there is not");
//! assert!(problems.to_string().contains("did you mean `step`?"));
//! # Ok(())
//! # }
//! ```

pub use bytemuck;
pub use fearless_simd;
pub use serde;

mod capture;
mod compile;
mod constant;
mod error;
mod executor;
mod explain;
mod facts;
mod file;
mod frame;
mod full;
mod graph;
mod harness;
mod id;
mod params;
mod plan;
mod port;
mod reflect;
mod registry;
mod rule;
mod shader;
mod side;
mod stage;
pub mod testing;
mod values;
mod watch;
mod wgsl;
mod work;

pub use capture::{Capture, Snapshot};
pub use compile::compile;
pub use constant::Constant;
pub use error::{GraphError, Place, Problem, Problems, STAGE_KIND, Span, Spanned};
pub use executor::{AdapterChoice, Executor, Gpu, INSTALL_GPU, RunError};
pub use explain::{Around, Cell, Finding, Mark, Role, Site};
pub use facts::{Fact, Facts, Quantity};
pub use file::*;
pub use frame::{Frame, View};
pub use graph::{Culled, Graph, MAX_LATENCY, MAX_SIDE, Node, PortRef, Settings, StageOf};
pub use harness::{Harness, Outputs};
pub use id::{NodeId, SlotId, StepId, StorageId, TapId};
pub use params::{AUTO, ParamError, ParamKind, ParamSpec, ParamValue, Params, parse_value};
pub use plan::{Bindings, Life, Plan, PlannedNode, Slot, SlotPair, Step, Storage, Tap, TapField, Value};
pub use port::{
    Access, Dims, Element, Extent, Field, FieldRef, Format, Holds, In, ItemMember, Lifetime, Meaning, Member,
    Out, Port, PortElement, Scalar, plain, scratch, share_of, texel,
};
pub use reflect::{
    Entry, Reflected, Space, Variable, check as check_shader, check_stage, compose as compose_shader, imports,
};
pub use registry::{Kind, NodeContext, Registry};
pub use rule::{Limit, Rule};
pub use shader::{EditedTexts, Needs, Pass, Shader, ShaderLibrary, ShaderModule, Shape, Threads};
pub use side::{Download, PerSide, Side};
pub use stage::{AnyStage, Bundle, CpuContext, CpuMemory, Declaration, Host, Io, Runs, Stage};
pub use values::Wrong;
pub use watch::{BadValue, Checks};
pub use wgsl::{WgslClause, WgslFile, wgsl_clauses, wgsl_kind};
pub use work::{WithWork, Work};
