//! Where nodes run.

use std::{fmt, str::FromStr, sync::Arc};

use epigraph_core::{AdapterChoice, Gpu, Plan, PlannedNode, RunError, Side};
use serde::{Deserialize, Serialize};

use crate::{Error, memory};

/// Where the nodes run that the graph file does not place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Backend {
    /// A hardware GPU if there is one, else the CPU.
    #[default]
    Auto,
    /// Any GPU adapter, software ones such as Mesa's lavapipe included.
    Gpu,
    /// Native code.
    Cpu,
}

impl Backend {
    /// All, by name, with what they are.
    pub const ALL: [(Self, &str, &str); 3] = [
        (Self::Auto, "auto", "A hardware GPU if there is one, else the CPU"),
        (Self::Gpu, "gpu", "Any GPU adapter, software ones such as Mesa's lavapipe included"),
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

/// The side where nodes run by default, and the GPU if one is open.
#[derive(Clone)]
pub struct Device {
    /// The default side.
    pub side: Side,
    /// The GPU that nodes on that side use. A plan on the CPU with single nodes on the GPU opens one when it needs it.
    pub gpu: Option<Arc<Gpu>>,
}

impl Device {
    /// The CPU.
    pub const CPU: Self = Self { side: Side::Cpu, gpu: None };

    /// Opens what a backend asks for.
    ///
    /// # Errors
    /// [`RunError::NoGpu`] where [`Backend::Gpu`] finds no adapter.
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

    /// As [`Device::open`], with a GPU that is open already wherever it will do.
    ///
    /// # Errors
    /// As [`Device::open`].
    pub fn reopen(backend: Backend, gpu: Option<Arc<Gpu>>) -> Result<Self, RunError> {
        match (backend, gpu) {
            (Backend::Cpu, gpu) => Ok(Self { side: Side::Cpu, gpu }),
            (Backend::Gpu, Some(gpu)) => Ok(Self::on(gpu)),
            (Backend::Auto, Some(gpu)) if !gpu.is_software() => Ok(Self::on(gpu)),
            (Backend::Auto, Some(gpu)) => Ok(Self { side: Side::Cpu, gpu: Some(gpu) }),
            (_, None) => Self::open(backend),
        }
    }

    /// This GPU.
    pub fn on(gpu: Arc<Gpu>) -> Self {
        Self { side: Side::Gpu, gpu: Some(gpu) }
    }

    /// The GPU that a plan needs, opened if it is not yet; none for a plan on the CPU alone.
    ///
    /// # Errors
    /// That there is none, naming the node that needs it.
    pub fn gpu_for(&self, plan: &Plan) -> Result<Option<Arc<Gpu>>, Error> {
        let Some(PlannedNode { name, kind, .. }) = plan.nodes.iter().find(|node| node.side == Side::Gpu)
        else {
            return Ok(None);
        };
        if self.gpu.is_some() {
            return Ok(self.gpu.clone());
        }
        let gpu = Gpu::open(AdapterChoice::Any)
            .map_err(|error| Error::Input(format!("node `{name}` ({kind}) runs on a GPU here: {error}")))?;
        Ok(Some(Arc::new(gpu)))
    }
}

/// Makes sure that main memory holds a plan and the copies of the ports that are kept.
pub(crate) fn require_memory(plan: &Plan, gpu: Option<&Gpu>) -> Result<(), Error> {
    let tapped =
        plan.taps.iter().flat_map(|tap| &tap.fields).map(|field| plan.storages[field.storage].bytes());
    // A software GPU's memory is the machine's.
    let gpu_bytes = if gpu.is_some_and(Gpu::is_software) { plan.bytes(Side::Gpu) } else { 0 };
    memory::require(plan.bytes(Side::Cpu) + gpu_bytes + tapped.sum::<u64>())
}
