//! Materials.

use glam::Vec3;

use crate::{Material, Surface};

/// Reads factors only, no textures; emission that a texture would mask is ignored.
pub(super) fn convert(material: &gltf::json::Material) -> Material {
    /// A metal smoother than this is a mirror.
    const MIRROR_ROUGHNESS: f32 = 0.08;
    /// A dielectric rougher than this has too weak a lobe to tell from diffuse.
    const DIFFUSE_ROUGHNESS: f32 = 0.6;
    let pbr = &material.pbr_metallic_roughness;
    let [r, g, b, _] = pbr.base_color_factor.0;
    let base = Vec3::new(r, g, b).clamp(Vec3::ZERO, Vec3::ONE);
    let (metallic, roughness) =
        (pbr.metallic_factor.0.clamp(0.0, 1.0), pbr.roughness_factor.0.clamp(0.0, 1.0));
    let surface = if metallic > 0.5 && roughness < MIRROR_ROUGHNESS {
        Surface::Mirror
    } else if metallic > 0.5 || roughness < DIFFUSE_ROUGHNESS {
        let f0 = 0.04 + metallic * (base.max_element() - 0.04).max(0.0);
        Surface::Glossy { roughness: roughness.max(0.02), f0 }
    } else {
        Surface::Diffuse
    };
    // A glossy lobe has no colour of its own here, so half a metal's tint goes to the diffuse part.
    let color = if surface == Surface::Mirror { base } else { base * (1.0 - 0.5 * metallic) };
    let extensions = material.extensions.as_ref();
    let strength = extensions.and_then(|all| all.emissive_strength.as_ref());
    let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
    let emission = match material.emissive_texture {
        Some(_) => Vec3::ZERO,
        None => Vec3::from(material.emissive_factor.0) * strength,
    };
    Material {
        name: material.name.clone().unwrap_or_default(),
        color,
        surface,
        emission: emission.max(Vec3::ZERO),
    }
}
