//! Which extensions are read, and what is said of the others.

use std::collections::BTreeSet;

use super::instances::INSTANCING;
use super::json::{Root, name_of};
use super::lights::LIGHTS;
use super::materials;
use super::meshopt::MESHOPT;
use super::primitives::DRACO;
use crate::{NoteKind, Report};

/// What is read, or has notes of its own: compressed primitives, and textures in formats without a fallback.
const KNOWN: [&str; 19] = [
    INSTANCING,
    LIGHTS,
    DRACO,
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    MESHOPT[0],
    MESHOPT[1],
    materials::EMISSIVE_STRENGTH,
    materials::IOR,
    materials::SPECULAR,
    materials::SPECULAR_GLOSSINESS,
    materials::TRANSMISSION,
    materials::UNLIT,
    materials::VOLUME,
    materials::TEXTURE_TRANSFORM,
    materials::WEBP,
    "KHR_texture_basisu",
    "EXT_texture_avif",
    "MSFT_texture_dds",
];

/// Notes each unknown extension where nodes, primitives and the materials in use have it, and those that the file only
/// declares.
pub(super) fn note(root: &Root, report: &mut Report) {
    let primitives = || {
        root.meshes.iter().enumerate().flat_map(|(index, mesh)| {
            let name = name_of(mesh.name.as_deref(), "mesh", index);
            mesh.primitives.iter().map(move |primitive| (primitive, name.clone()))
        })
    };
    let of_primitives = primitives().flat_map(|(primitive, name)| {
        let extensions = primitive.extensions.iter().flat_map(|all| all.others.keys());
        extensions.map(move |extension| (extension.clone(), name.clone()))
    });
    let of_nodes = root.nodes.iter().enumerate().flat_map(|(index, node)| {
        let name = name_of(Some(&node.name), "node", index);
        node.extensions.keys().map(move |extension| (extension.clone(), name.clone()))
    });
    let used: BTreeSet<usize> = primitives().filter_map(|(p, _)| Some(p.material?.value())).collect();
    let of_materials = used.iter().filter_map(|&index| Some((index, root.materials.get(index)?.0.as_ref()?)));
    let of_materials = of_materials.flat_map(|(index, material)| {
        let name = name_of(Some(&material.name), "material", index);
        material.extensions.keys().map(move |extension| (extension.clone(), name.clone()))
    });
    let mut found = BTreeSet::new();
    for (extension, name) in of_primitives.chain(of_nodes).chain(of_materials) {
        if !KNOWN.contains(&extension.as_str()) {
            report.add(NoteKind::LeftOut, format!("the extension {extension}"), &name);
            found.insert(extension);
        }
    }
    let declared: BTreeSet<&String> = root.extensions_used.iter().chain(&root.extensions_required).collect();
    for extension in declared {
        if !KNOWN.contains(&extension.as_str()) && !found.contains(extension) {
            report.add(NoteKind::LeftOut, format!("the extension {extension}"), "");
        }
    }
}
