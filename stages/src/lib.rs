//! The stages of Epigraph: one file for each step of an algorithm, with its ports, parameters and CPU twin; the shader
//! of the same name lies in `shaders/`.

pub mod age;
pub mod depth_cull;
pub mod dither;
pub mod fill;
pub mod image_id;
pub mod integrate;
pub mod point_cloud;
pub mod predict;
pub mod project;
pub mod replace;
pub mod shared;
pub mod tonemap;
pub mod trace;

pub use shared::world::{Pace, World};

use epigraph_core::{Registry, wgsl_kind};

/// All stages, and the shader modules that any shader may import.
pub fn registry() -> Registry {
    macro_rules! module {
        ($name:literal) => {
            (
                concat!("shared/", $name, ".wgsl"),
                include_str!(concat!("../../shaders/shared/", $name, ".wgsl")),
            )
        };
    }
    let modules = [
        module!("cloud"),
        module!("frame"),
        module!("index"),
        module!("requests"),
        module!("scan"),
        module!("view"),
        module!("wide"),
    ];
    let registry = Registry::default()
        .with::<age::Age>()
        .with::<depth_cull::DepthCull>()
        .with::<dither::Dither>()
        .with::<fill::Fill>()
        .with::<image_id::ImageId>()
        .with::<integrate::Integrate>()
        .with::<point_cloud::PointCloud>()
        .with::<predict::Predict>()
        .with::<project::Project>()
        .with::<replace::Replace>()
        .with::<tonemap::Tonemap>()
        .with::<trace::Trace>()
        .with_kind(wgsl_kind());
    modules.into_iter().fold(registry, |registry, (name, text)| registry.with_module(name, text))
}
