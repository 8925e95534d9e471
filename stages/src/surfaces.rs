//! Provides what the scene's triangles and materials look like to shaders that draw them: the vertices are those of
//! [`crate::mesh`].

use std::sync::{Arc, Mutex, PoisonError};

use epigraph_core::{CpuContext, Facts, Io, Out, Stage, constants, item};
use epigraph_scenes::{Look, Material, Scene};

use crate::{
    World, facts,
    meaning::{CORNERS, LOOKS},
    mesh::{EVERYTHING, fill, moved_since},
    shared::octahedral::{NO_NORMAL, encode_oct16},
};

constants! {
    /// The bits of a triangle's `w` with the index of its material.
    pub const MATERIAL: u32 = 0xFF_FFFF;
    /// Where in `w` the number of its body begins, 0 for everything static.
    pub const BODY_SHIFT: u32 = 24;
    /// Flag of a look: no triangle of the material is seen.
    pub const HOLE: u32 = 1;
    /// Flag of a look: triangles are not seen from behind.
    pub const CULLED: u32 = 2;
    /// Flag of a look: the back side emits as the front does.
    pub const BOTH_SIDES: u32 = 4;
}

item! {
    /// What a material looks like, without its maps.
    pub struct SurfaceLook {
        /// The share of light that it scatters, as [`Look::albedo`].
        albedo: [f32; 3],
        /// Perceptual roughness, 0 to 1.
        roughness: f32,
        /// Radiance that its front emits.
        emission: [f32; 3],
        /// [`HOLE`], [`CULLED`] and [`BOTH_SIDES`].
        flags: u32,
    }
}

impl SurfaceLook {
    /// The look of a material.
    pub fn of(material: &Material) -> Self {
        let look = Look::of(material);
        let flag = |flag: u32, is_set: bool| if is_set { flag } else { 0 };
        Self {
            albedo: look.albedo().into(),
            roughness: look.roughness,
            emission: (look.opacity * if look.unlit { look.color } else { look.emission }).into(),
            flags: flag(HOLE, look.opacity == 0.0)
                | flag(CULLED, material.culled)
                | flag(BOTH_SIDES, look.unlit || look.double_sided),
        }
    }
}

/// The scene's surfaces as lists, from the [`World`] that the application provides. They are written in the first
/// frame, and again when the application shows another scene; the normals of moving bodies, whenever they have moved.
pub struct Surfaces {
    corners: Out<[u32; 4]>,
    looks: Out<SurfaceLook>,
    /// The scene that was written last, in its pose.
    written: Mutex<Option<Arc<Scene>>>,
}

impl Stage for Surfaces {
    const KIND: &'static str = "surfaces";
    const DOC: &'static str =
        "What the scene's triangles and materials look like, for shaders that draw them.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        let corners = io.persistent(
            "corners",
            CORNERS.doc(
                "Of each triangle the shading normals at its corners, on an octahedron, 0x80008000 where it is flat; in \
                 w the index of its material, bits 0 to 23, and the number of its body.",
            ),
            facts::FACES.list(),
        );
        let looks = io.persistent("looks", LOOKS, facts::MATERIALS.list());
        Self { corners, looks, written: Mutex::default() }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let tracer = cx.host::<World>()?.at(cx.frame().index);
        let scene = tracer.scene();
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        let moved = written.as_ref().and_then(|before| moved_since(before, scene));
        let ranges = match &moved {
            None => {
                fill(&mut cx.write(self.looks), &[EVERYTHING], &scene.materials, |_, material| {
                    SurfaceLook::of(material)
                })?;
                vec![EVERYTHING]
            }
            Some(bodies) => {
                cx.unchanged(self.looks);
                bodies.iter().map(|body| body.faces.clone()).collect()
            }
        };
        if ranges.is_empty() {
            cx.unchanged(self.corners);
        } else {
            let mut bodies = vec![0; scene.mesh.triangles.len()];
            for (body, number) in scene.bodies.iter().zip(1..) {
                bodies[body.faces.clone()].fill(number);
            }
            fill(&mut cx.write(self.corners), &ranges, &bodies, |face, body| corners(scene, face, *body))?;
        }
        *written = Some(scene.clone());
        Ok(())
    }

    fn needless((): &(), facts: &Facts) -> Option<&'static str> {
        (facts.count(facts::FACES) == Some(0)).then_some("the scene has no faces")
    }
}

/// The element of a triangle of a body.
fn corners(scene: &Scene, face: usize, body: u32) -> [u32; 4] {
    let mesh = &scene.mesh;
    let [a, b, c] = mesh.corner_normals.get(face).map_or([NO_NORMAL; 3], |normals| normals.map(encode_oct16));
    [a, b, c, mesh.material[face] & MATERIAL | body << BODY_SHIFT]
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Harness, Host, Outputs, Settings, Side};
    use epigraph_scenes::{Alpha, Tracer};
    use glam::Vec3;

    use super::*;
    use crate::{
        Pace,
        shared::{octahedral::decode_oct16, testing::settings},
    };

    fn host(scene: &Arc<Scene>) -> Host {
        let mut host = Host::default();
        host.insert(World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact, 1));
        host
    }

    fn harness(scene: &Scene) -> Harness<Surfaces> {
        Harness::new((), &Settings { facts: World::facts(scene, false), ..settings([4, 4], 1) })
    }

    fn run(harness: &mut Harness<Surfaces>, host: &Host) -> Outputs {
        harness.run(Side::Cpu, &crate::registry(), host, None).unwrap()
    }

    #[test]
    fn looks_by_hand() {
        let all = |value: f32| Vec3::splat(value);
        let of = |material: Material| {
            let SurfaceLook { albedo, roughness, emission, flags } = SurfaceLook::of(&material);
            ([albedo[0], roughness, emission[0]], flags)
        };
        let lamp = Material::lamp("", all(3.0));
        assert_eq!(of(Material::glossy("", all(0.5), 0.25, 0.25)), ([0.75, 0.25, 0.0], 0));
        assert_eq!(of(Material { double_sided: true, ..lamp.clone() }), ([0.0, 1.0, 3.0], BOTH_SIDES));
        let veil = Material { alpha: Alpha::Blend, opacity: 0.5, culled: true, ..lamp };
        assert_eq!(of(veil.clone()), ([0.0, 1.0, 1.5], CULLED));
        assert_eq!(of(Material { alpha: Alpha::Mask(0.6), ..veil }), ([0.0, 1.0, 0.0], CULLED | HOLE));
        let unlit = Material { unlit: true, ..Material::diffuse("", all(0.5)) };
        assert_eq!(of(unlit), ([0.0, 1.0, 0.5], BOTH_SIDES));
    }

    #[test]
    fn the_lists_are_those_of_the_scene_in_its_pose() {
        for name in ["cornell-moving", "chains"] {
            let scene = Arc::new(Scene::load(name).unwrap());
            let (host, mut harness) = (host(&scene), harness(&scene));
            for index in [0, 9, 9, 70] {
                harness.frame.index = index;
                let out = run(&mut harness, &host);
                let posed = scene.posed(&scene.poses_at(index));
                let corners = out.get::<[u32; 4]>("corners");
                assert_eq!(out.get::<SurfaceLook>("looks").len(), scene.materials.len());
                assert_eq!(corners.len(), scene.mesh.triangles.len());
                for (face, of) in corners.iter().enumerate() {
                    assert_eq!(of[3] & MATERIAL, scene.mesh.material[face]);
                    assert_eq!(of[3] >> BODY_SHIFT, scene.body_of_face(face as u32));
                    for corner in 0..3 {
                        let expected =
                            posed.mesh.corner_normals.get(face).map_or(Vec3::ZERO, |all| all[corner]);
                        let found = decode_oct16(of[corner]).normalize_or_zero();
                        assert!(found.distance(expected) < 1e-4, "{name}, frame {index}, triangle {face}");
                    }
                }
            }
        }
    }

    #[test]
    fn an_empty_scene_has_lists_of_zeros() {
        let camera = epigraph_scenes::Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.0, 0.1, 100.0);
        let scene = Arc::new(Scene::empty("test", camera, [Vec3::ZERO; 2]));
        let out = run(&mut harness(&scene), &host(&scene));
        assert_eq!(out.get::<[u32; 4]>("corners"), [[0; 4]]);
        assert_eq!(out.get::<SurfaceLook>("looks"), [SurfaceLook::default()]);
    }
}
