//! `EXT_mesh_gpu_instancing`: copies of a node's mesh, each with a translation, a rotation and a scale.

use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use gltf::json::Value;
use gltf::json::accessor::ComponentType;

use super::container::Container;

pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

impl Container<'_> {
    /// The transforms of the instances: what one lacks is the identity.
    pub fn instances(&self, value: &Value) -> Result<Vec<DAffine3>, String> {
        let accessor = |name: &str| {
            let Some(index) = value.get("attributes").and_then(|all| all.get(name)) else { return Ok(None) };
            let found = index.as_u64().and_then(|index| usize::try_from(index).ok());
            let found = found.filter(|&index| index < self.root.accessors.len());
            found.map(Some).ok_or_else(|| format!("{name} refers to accessor {index}, which does not exist"))
        };
        let vectors = |name: &str| accessor(name)?.map(|index| self.vectors::<3>(index)).transpose();
        let (translations, scales) = (vectors("TRANSLATION")?, vectors("SCALE")?);
        let rotations = accessor("ROTATION")?.map(|index| self.rotations(index)).transpose()?;
        let counts = [
            translations.as_ref().map(Vec::len),
            rotations.as_ref().map(Vec::len),
            scales.as_ref().map(Vec::len),
        ];
        let count = counts.into_iter().flatten().next().ok_or("it has no TRANSLATION, ROTATION or SCALE")?;
        if counts.into_iter().flatten().any(|other| other != count) {
            return Err("its attributes have different numbers of elements".into());
        }
        let place = |index: usize| {
            let vector = |all: &Option<Vec<[f32; 3]>>, none: DVec3| {
                all.as_ref().map_or(none, |all| Vec3::from(all[index]).as_dvec3())
            };
            let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |all| all[index]);
            DAffine3::from_scale_rotation_translation(
                vector(&scales, DVec3::ONE),
                rotation,
                vector(&translations, DVec3::ZERO),
            )
        };
        Ok((0..count).map(place).collect())
    }

    /// Unit quaternions of floats or of normalized signed integers.
    fn rotations(&self, index: usize) -> Result<Vec<DQuat>, String> {
        let of_known_type = match self.kind(index)? {
            (ComponentType::F32, 4) => true,
            (ComponentType::I8 | ComponentType::I16, 4) => self.accessor(index)?.normalized,
            _ => false,
        };
        if !of_known_type {
            return Err("ROTATION has to be four floats, or normalized signed bytes or shorts".to_owned());
        }
        let unit = |(index, rotation): (usize, [f32; 4])| {
            let rotation = Vec4::from(rotation);
            let found = rotation.try_normalize().map(|unit| DQuat::from_vec4(unit.as_dvec4()).normalize());
            found.ok_or_else(|| format!("rotation {index} is {rotation}, which is no direction"))
        };
        self.vectors::<4>(index)?.into_iter().enumerate().map(unit).collect()
    }
}
