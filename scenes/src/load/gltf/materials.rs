//! Materials.

use glam::Vec3;

use crate::{DIELECTRIC_F0, Material};

/// Reads factors only, no textures; emission that a texture would mask is ignored.
pub(super) fn convert(material: &gltf::json::Material) -> Material {
    let pbr = &material.pbr_metallic_roughness;
    let [r, g, b, _] = pbr.base_color_factor.0;
    let base = Vec3::new(r, g, b).clamp(Vec3::ZERO, Vec3::ONE);
    let extensions = material.extensions.as_ref();
    let strength = extensions.and_then(|all| all.emissive_strength.as_ref());
    let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
    let emission = match material.emissive_texture {
        Some(_) => Vec3::ZERO,
        None => Vec3::from(material.emissive_factor.0) * strength,
    };
    let roughness = pbr.roughness_factor.0.clamp(0.0, 1.0);
    Material {
        metallic: pbr.metallic_factor.0.clamp(0.0, 1.0),
        emission: emission.max(Vec3::ZERO),
        double_sided: material.double_sided,
        ..Material::glossy(material.name.clone().unwrap_or_default(), base, roughness, DIELECTRIC_F0)
    }
}
