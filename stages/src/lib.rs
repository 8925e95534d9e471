//! The stages of Epigraph: one file for each step of an algorithm, with its ports, parameters and CPU twin; the shader
//! with the same name is in `shaders/`. [`meaning`] names what their ports hold, [`column`](mod@column) the columns
//! of the table of times.
//!
//! [`registry`] contains all of them, for [`epigraph_core::compile`]. A stage can also run alone, on given data:
//!
//! ```
//! use epigraph_core::{Facts, Harness, Host, Settings, Side};
//! use epigraph_stages::depth_cull::{DepthCull, DepthCullParams};
//!
//! # fn main() -> Result<(), epigraph_core::RunError> {
//! // One row of pixels: a near surface, through which a point of a far one shows.
//! let depths = [1.0f32, 1.0, 9.0, 1.0, 1.0];
//! let settings = Settings::new([5, 1], 0, Facts::none());
//! let mut harness = Harness::<DepthCull>::new(DepthCullParams::default(), &settings);
//! harness.set("id", &[0u32, 1, 2, 3, 4]);
//! harness.set("depth", &depths.map(f32::to_bits));
//! let out = harness.run(Side::Cpu, &epigraph_stages::registry(), &Host::default(), None)?;
//! assert_eq!(out.get::<u32>("id"), [0, 1, u32::MAX, 3, 4]);
//! # Ok(())
//! # }
//! ```

/// The shader with this name in the folder `shaders`. That is a package of its own, so this differs from
/// [`epigraph_core::shader!`], which looks in the current package.
macro_rules! shader {
    ($name:literal) => {
        epigraph_core::Shader::new(
            concat!($name, ".wgsl"),
            const { epigraph_shaders::text(concat!($name, ".wgsl")) },
        )
        .from_file(std::path::Path::new(epigraph_shaders::FOLDER).join(concat!($name, ".wgsl")))
    };
}

pub mod age;
pub mod albedo;
pub mod antialias;
pub mod atrous;
pub mod carry;
pub mod classify;
pub mod column;
pub mod compact;
pub mod depth_cull;
pub mod dither;
pub mod edge_raster;
pub mod facts;
pub mod fill;
pub mod gbuffer;
pub mod image_id;
pub mod integrate;
pub mod interpolate;
pub mod meaning;
pub mod mesh;
pub mod motion;
pub mod pending;
pub mod point_cloud;
pub mod predict;
pub mod project;
pub mod reach;
pub mod reach_cull;
pub mod refine;
pub mod replace;
pub mod shadow_edges;
pub mod shared;
pub mod silhouette;
pub mod spread;
pub mod stream_cut;
pub mod stream_decode;
pub mod subdivide;
pub mod surfaces;
pub mod tonemap;
pub mod trace;

pub use shared::{
    source::{Pace, Query, Ray, SampleSource},
    world::World,
};

use std::path::Path;

use epigraph_core::{Registry, ShaderModule, wgsl_kind};

/// All stages, and the shader modules that any shader may import.
pub fn registry() -> Registry {
    let registry = Registry::default()
        .with::<age::Age>()
        .with::<albedo::Albedo>()
        .with::<antialias::Antialias>()
        .with::<atrous::Atrous>()
        .with::<carry::Carry>()
        .with::<classify::Classify>()
        .with::<compact::Compact>()
        .with::<depth_cull::DepthCull>()
        .with::<dither::Dither>()
        .with::<edge_raster::EdgeRaster>()
        .with::<fill::Fill>()
        .with::<gbuffer::Gbuffer>()
        .with::<image_id::ImageId>()
        .with::<integrate::Integrate>()
        .with::<interpolate::Interpolate>()
        .with::<mesh::Mesh>()
        .with::<motion::Motion>()
        .with::<pending::Pending>()
        .with::<point_cloud::PointCloud>()
        .with::<predict::Predict>()
        .with::<project::Project>()
        .with::<reach::Reach>()
        .with::<reach_cull::ReachCull>()
        .with::<refine::Refine>()
        .with::<replace::Replace>()
        .with::<shadow_edges::ShadowEdges>()
        .with::<silhouette::Silhouette>()
        .with::<spread::Spread>()
        .with::<stream_cut::StreamCut>()
        .with::<stream_decode::StreamDecode>()
        .with::<subdivide::Subdivide>()
        .with::<surfaces::Surfaces>()
        .with::<tonemap::Tonemap>()
        .with::<trace::Trace>()
        .with_kind(wgsl_kind());
    let modules = epigraph_shaders::FILES.iter().filter(|(path, _)| path.starts_with("shared/"));
    let registry = modules.fold(registry, |registry, (path, text)| {
        let file = Path::new(epigraph_shaders::FOLDER).join(path);
        registry.with_module(ShaderModule::new(*path, *text).from_file(file))
    });
    registry
        .with_constants("albedo", shared::albedo::CONSTANTS)
        .with_constants("cloud", shared::cloud::CONSTANTS)
        .with_constants("edge_pixel", shared::edge_pixel::CONSTANTS)
        .with_constants("estimate", shared::estimate::CONSTANTS)
        .with_constants("moves", shared::moves::CONSTANTS)
        .with_constants("octahedral", shared::octahedral::CONSTANTS)
        .with_constants("requests", shared::requests::CONSTANTS)
        .with_constants("scan", shared::scan::CONSTANTS)
        .with_constants("segments", shared::segments::CONSTANTS)
        .with_constants("streams", shared::streams::CONSTANTS)
}
