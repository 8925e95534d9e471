//! What the command line lets choose.

use std::fmt;

use clap::ValueEnum;
use epigraph_core::Side;

/// What `--backend` may say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Choice {
    /// Every node in native code.
    Cpu,
    /// Every node that has a shader on a GPU, a software one where there is no other.
    Gpu,
    /// The papers' split between CPU and GPU: graph `hybrid`.
    Hybrid,
    /// All of them.
    All,
}

/// Which side does the work of a row.
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
    /// All of them, in the order of the tables.
    pub const ALL: [Self; 3] = [Self::Cpu, Self::Gpu, Self::Hybrid];

    /// Where nodes run by default.
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

/// What the frame's time is followed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Sweep {
    /// Square images of 256 to 4096 pixels a side (2048 on a software GPU).
    Pixels,
    /// Clouds of 0.25 to 4 points for each pixel.
    Points,
    /// The scenes by their number of edges; measures nothing more.
    Edges,
    /// Nothing.
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
