//! Placement of nodes on CPU and GPU.

use std::{fmt, str::FromStr, sync::Arc};

use epigraph_core::{AdapterChoice, Gpu, INSTALL_GPU, Plan, PlannedNode, RunError, Side};
use serde::{Deserialize, Serialize};

use crate::{Error, memory};

/// Default placement for nodes without `on:`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Backend {
    /// A hardware GPU if available, else the CPU.
    #[default]
    Auto,
    /// Any GPU adapter, including software ones such as Mesa's lavapipe.
    Gpu,
    /// Native code.
    Cpu,
}

impl Backend {
    /// All backends, with name and description.
    pub const ALL: [(Self, &str, &str); 3] = [
        (Self::Auto, "auto", "A hardware GPU if available, else the CPU"),
        (Self::Gpu, "gpu", "Any GPU adapter, including software ones such as Mesa's lavapipe"),
        (Self::Cpu, "cpu", "Native code"),
    ];
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = Self::ALL.iter().find(|(backend, ..)| backend == self);
        f.write_str(found.map_or("", |(_, name, _)| name))
    }
}

impl FromStr for Backend {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(_, name, _)| *name == text);
        found.map(|(backend, ..)| *backend).ok_or_else(|| "expected auto, gpu or cpu".into())
    }
}

/// The default side of nodes, and the GPU if one is open.
#[derive(Clone)]
pub struct Device {
    /// The default side.
    pub side: Side,
    /// The GPU for nodes on that side. If it is absent and some nodes are placed on the GPU, one is opened for them.
    pub gpu: Option<Arc<Gpu>>,
}

impl Device {
    /// The CPU.
    pub const CPU: Self = Self { side: Side::Cpu, gpu: None };

    /// Opens the device of a backend.
    ///
    /// # Errors
    /// [`RunError::NoGpu`] if [`Backend::Gpu`] finds no adapter.
    pub fn open(backend: Backend) -> Result<Self, RunError> {
        match backend {
            Backend::Cpu => Ok(Self::CPU),
            Backend::Gpu => Ok(Self::on(Arc::new(Gpu::open(AdapterChoice::Any)?))),
            Backend::Auto => match Gpu::open(AdapterChoice::Hardware) {
                Ok(gpu) => Ok(Self::on(Arc::new(gpu))),
                Err(_) => Ok(Self::CPU),
            },
        }
    }

    /// Like [`Device::open`], but uses the given GPU if it is suitable.
    ///
    /// # Errors
    /// Those of [`Device::open`].
    pub fn reopen(backend: Backend, gpu: Option<Arc<Gpu>>) -> Result<Self, RunError> {
        match (backend, gpu) {
            (Backend::Cpu, gpu) => Ok(Self { side: Side::Cpu, gpu }),
            (Backend::Gpu, Some(gpu)) => Ok(Self::on(gpu)),
            (Backend::Auto, Some(gpu)) if !gpu.is_software() => Ok(Self::on(gpu)),
            (Backend::Auto, Some(gpu)) => Ok(Self { side: Side::Cpu, gpu: Some(gpu) }),
            (_, None) => Self::open(backend),
        }
    }

    /// A GPU that is already open.
    pub fn on(gpu: Arc<Gpu>) -> Self {
        Self { side: Side::Gpu, gpu: Some(gpu) }
    }

    /// The GPU that a plan needs, opened if necessary; `None` if no node runs on a GPU.
    ///
    /// # Errors
    /// If there is no GPU. The error names a node that needs it.
    pub fn gpu_for(&self, plan: &Plan) -> Result<Option<Arc<Gpu>>, Error> {
        let Some(PlannedNode { name, kind, .. }) = plan.nodes.iter().find(|node| node.side == Side::Gpu)
        else {
            return Ok(None);
        };
        if self.gpu.is_some() {
            return Ok(self.gpu.clone());
        }
        // The default side is the CPU, so this node runs on a GPU by its kind or by the graph file.
        let gpu = Gpu::open(AdapterChoice::Any).map_err(|error| match error {
            RunError::NoGpu => Error::Input(format!(
                "node `{name}` ({kind}) runs on a GPU, but none was found; {INSTALL_GPU}"
            )),
            error => error.into(),
        })?;
        Ok(Some(Arc::new(gpu)))
    }
}

/// Checks that main memory can hold a plan and the copies of kept ports.
pub(crate) fn require_memory(plan: &Plan, gpu: Option<&Gpu>) -> Result<(), Error> {
    let tapped =
        plan.taps.iter().flat_map(|tap| &tap.fields).map(|field| plan.storages[field.storage].bytes());
    // A software GPU uses main memory.
    let gpu_bytes = if gpu.is_some_and(Gpu::is_software) { plan.bytes(Side::Gpu) } else { 0 };
    memory::require(plan.bytes(Side::Cpu) + gpu_bytes + tapped.sum::<u64>())
}
