//! The two sides that a node can run on, and how results get from one to the other.

use std::{
    fmt,
    ops::{Index, IndexMut},
};

use serde::{Deserialize, Serialize};

/// Where a node runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Side {
    /// The stage's native twin.
    Cpu,
    /// The stage's shader.
    Gpu,
}

impl Side {
    /// Both sides.
    pub const ALL: [Self; 2] = [Self::Cpu, Self::Gpu];

    /// The other side.
    pub fn other(self) -> Self {
        match self {
            Self::Cpu => Self::Gpu,
            Self::Gpu => Self::Cpu,
        }
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        })
    }
}

/// How GPU results reach a node that runs on the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Download {
    /// This frame's values: submit and wait.
    #[default]
    Sync,
    /// The values of this many frames ago, without waiting.
    Latent(u32),
}

/// One value for each side, indexed by [`Side`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PerSide<T> {
    /// The CPU's.
    pub cpu: T,
    /// The GPU's.
    pub gpu: T,
}

impl<T> PerSide<T> {
    /// Calls `make` for each side.
    pub fn new(mut make: impl FnMut(Side) -> T) -> Self {
        Self { cpu: make(Side::Cpu), gpu: make(Side::Gpu) }
    }
}

impl<T> Index<Side> for PerSide<T> {
    type Output = T;

    fn index(&self, side: Side) -> &T {
        match side {
            Side::Cpu => &self.cpu,
            Side::Gpu => &self.gpu,
        }
    }
}

impl<T> IndexMut<Side> for PerSide<T> {
    fn index_mut(&mut self, side: Side) -> &mut T {
        match side {
            Side::Cpu => &mut self.cpu,
            Side::Gpu => &mut self.gpu,
        }
    }
}
