//! The choices of the command line: backends and sweeps.

use std::fmt;

use clap::ValueEnum;
use epigraph_core::Side;

/// The values of `--backend`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Choice {
    /// Every node in native code.
    Cpu,
    /// Every node that has a shader on a GPU, or a software GPU if there is no other.
    Gpu,
    /// The papers' split between CPU and GPU: graph `hybrid`.
    Hybrid,
    /// All three.
    All,
}

/// The side that does the work of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Native code.
    Cpu,
    /// A GPU.
    Gpu,
    /// The papers' split.
    Hybrid,
}

impl Split {
    /// All splits, in the order of the tables.
    pub const ALL: [Self; 3] = [Self::Cpu, Self::Gpu, Self::Hybrid];

    /// The default side of nodes.
    pub fn side(self) -> Side {
        if self == Self::Cpu { Side::Cpu } else { Side::Gpu }
    }
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Hybrid => "hybrid",
        })
    }
}

/// The quantity over which the frame time is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Sweep {
    /// Square images of 256 to 4096 pixels a side (2048 on a software GPU).
    Pixels,
    /// Clouds of 0.25 to 4 points per pixel.
    Points,
    /// The number of edges of the scenes; needs no further measurement.
    Edges,
    /// No sweep.
    None,
}

impl fmt::Display for Sweep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pixels => "pixels",
            Self::Points => "points",
            Self::Edges => "edges",
            Self::None => "none",
        })
    }
}
