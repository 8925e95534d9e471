//! Provides the triangles and edges of the scene to the stages that find silhouettes and shadows.

use std::{
    ops::Range,
    slice,
    sync::{Arc, Mutex, PoisonError},
};

use epigraph_core::{CpuContext, Facts, Io, Out, PortElement, Rule, Stage, choice, params};
use epigraph_scenes::{Body, Edge, EdgeKind, Scene};
use half::f16;

use crate::{
    World, column, facts,
    meaning::{EDGES, FACES, NORMALS, VERTICES},
    shared::{
        octahedral::encode_oct16,
        segments::{BORDER, CREASE, MeshEdge, REGULAR},
    },
};

choice! {
    /// How the normals of faces are stored.
    pub enum Normals {
        /// Three f32 and one of padding: 16 bytes a face.
        F32,
        /// Three f16 and one of padding: 8 bytes.
        F16,
        /// Octahedral, two 16-bit integers: 4 bytes.
        Oct16,
    }
}

params! {
    /// Parameters of [`Mesh`].
    pub struct MeshParams {
        /// How the normals of faces are stored. Stages that read them need the same setting; the port's type depends on
        /// it, so a mismatch is an error.
        normals: Normals = Normals::F32;
    }
}

/// The scene's mesh as lists, from the [`World`] that the application provides. They are written in the first frame,
/// and again when the application shows another scene; vertices and normals of moving bodies, whenever they have moved.
pub struct Mesh {
    vertices: Out<[f32; 4]>,
    faces: Out<[u32; 4]>,
    normals: NormalsOut,
    edges: Out<MeshEdge>,
    /// The scene that was written last, in its pose.
    written: Mutex<Option<Arc<Scene>>>,
}

enum NormalsOut {
    F32(Out<[f32; 4]>),
    F16(Out<[u32; 2]>),
    Oct16(Out<u32>),
}

impl Stage for Mesh {
    const KIND: &'static str = "mesh";
    const DOC: &'static str = "The scene's vertices, faces, normals and edges.";
    type Params = MeshParams;

    fn declare(params: &MeshParams, io: &mut Io) -> Self {
        io.column(column::E1);
        io.seldom();
        let vertices =
            io.persistent("vertices", VERTICES.doc("Positions, metres; w = 1."), facts::VERTICES.list());
        let faces = io.persistent("faces", FACES, facts::FACES.list());
        let (name, doc) = ("normals", "Unit normals of the triangles, zero where one is degenerate.");
        let normals = match params.normals {
            Normals::F32 => {
                // A unit vector is rounded in each of its components.
                const UNIT: &[Rule] = &[Rule::floats(-1.0 - 1e-6, 1.0 + 1e-6)];
                NormalsOut::F32(io.persistent(name, NORMALS.doc(doc).within(UNIT), facts::FACES.list()))
            }
            Normals::F16 => NormalsOut::F16(io.persistent(name, NORMALS.doc(doc), facts::FACES.list())),
            Normals::Oct16 => NormalsOut::Oct16(io.persistent(name, NORMALS.doc(doc), facts::FACES.list())),
        };
        let edges = io.persistent(
            "edges",
            EDGES.doc("Vertices, faces and kind of every edge, in rising order."),
            facts::EDGES.list(),
        );
        Self { vertices, faces, normals, edges, written: Mutex::default() }
    }

    fn cpu(&self, _: &MeshParams, cx: &CpuContext) -> Result<(), String> {
        let tracer = cx.host::<World>()?.at(cx.frame().index);
        let scene = tracer.scene();
        let mesh = &scene.mesh;
        let mut written = self.written.lock().unwrap_or_else(PoisonError::into_inner);
        let moved = written.as_ref().and_then(|before| moved_since(before, scene));
        let (vertices, faces): (Vec<_>, Vec<_>) = match &moved {
            None => {
                fill(
                    &mut cx.write(self.faces),
                    slice::from_ref(&EVERYTHING),
                    &mesh.triangles,
                    |face, &[a, b, c]| [a, b, c, mesh.object[face]],
                )?;
                fill(&mut cx.write(self.edges), slice::from_ref(&EVERYTHING), &mesh.edges, |_, edge| {
                    mesh_edge(edge)
                })?;
                (vec![EVERYTHING], vec![EVERYTHING])
            }
            Some(bodies) => {
                cx.unchanged(self.faces);
                cx.unchanged(self.edges);
                bodies.iter().map(|body| (body.vertices.clone(), body.faces.clone())).unzip()
            }
        };
        write(cx, self.vertices, &vertices, &mesh.positions, |p| [p.x, p.y, p.z, 1.0])?;
        let normals = &mesh.face_normals;
        match self.normals {
            NormalsOut::F32(out) => write(cx, out, &faces, normals, |n| [n.x, n.y, n.z, 0.0])?,
            NormalsOut::F16(out) => write(cx, out, &faces, normals, |&n| encode_f16(n.into()))?,
            NormalsOut::Oct16(out) => write(cx, out, &faces, normals, |&n| encode_oct16(n))?,
        }
        *written = Some(scene.clone());
        Ok(())
    }

    fn needless(_: &MeshParams, facts: &Facts) -> Option<&'static str> {
        (facts.count(facts::FACES) == Some(0)).then_some("the scene has no faces")
    }
}

/// All of a list, of any length.
pub(crate) const EVERYTHING: Range<usize> = 0..usize::MAX;

/// The bodies whose pose differs from that in `before`; `None` for another scene.
pub(crate) fn moved_since<'a>(before: &Arc<Scene>, scene: &'a Arc<Scene>) -> Option<Vec<&'a Body>> {
    if Arc::ptr_eq(before, scene) {
        return Some(Vec::new());
    }
    // Poses of one scene share the same bodies.
    let same = !scene.bodies.is_empty() && Arc::ptr_eq(&before.bodies, &scene.bodies);
    let poses = before.poses.iter().zip(&scene.poses);
    same.then(|| scene.bodies.iter().zip(poses).filter(|(_, (a, b))| a != b).map(|(body, _)| body).collect())
}

/// Writes the elements of the items in the given ranges; without ranges, the list is unchanged.
fn write<S, T: PortElement>(
    cx: &CpuContext,
    out: Out<T>,
    ranges: &[Range<usize>],
    items: &[S],
    element: impl Fn(&S) -> T::Cpu,
) -> Result<(), String> {
    if ranges.is_empty() {
        cx.unchanged(out);
        return Ok(());
    }
    fill(&mut cx.write(out), ranges, items, |_, item| element(item))
}

/// Writes one element for each item of some ranges; a list without items has one element, all zeros.
pub(crate) fn fill<S, T: bytemuck::Pod>(
    out: &mut [T],
    ranges: &[Range<usize>],
    items: &[S],
    element: impl Fn(usize, &S) -> T,
) -> Result<(), String> {
    if out.len() != items.len().max(1) {
        return Err(format!(
            "the graph was compiled for a scene with a list of {} elements where this one has {}; compile it again",
            out.len(),
            items.len()
        ));
    }
    if items.is_empty() {
        out[0] = T::zeroed();
    }
    for range in ranges {
        let range = range.start..range.end.min(items.len());
        for (index, (out, item)) in range.clone().zip(out[range.clone()].iter_mut().zip(&items[range])) {
            *out = element(index, item);
        }
    }
    Ok(())
}

fn mesh_edge(edge: &Edge) -> MeshEdge {
    let kind = match edge.kind {
        EdgeKind::Regular => REGULAR,
        EdgeKind::Crease => CREASE,
        EdgeKind::Border => BORDER,
    };
    MeshEdge { vertices: edge.vertices, faces: edge.faces, kind, pad: 0 }
}

/// A normal as three f16, the first in the low bits; WGSL's `unpack2x16float` decodes them.
pub fn encode_f16([x, y, z]: [f32; 3]) -> [u32; 2] {
    let bits = |value| u32::from(f16::from_f32(value).to_bits());
    [bits(x) | bits(y) << 16, bits(z)]
}

/// The inverse of [`encode_f16`].
pub fn decode_f16([xy, z]: [u32; 2]) -> [f32; 3] {
    [xy & 0xFFFF, xy >> 16, z & 0xFFFF].map(|bits| f16::from_bits(bits as u16).to_f32())
}

#[cfg(test)]
mod tests {
    use epigraph_core::{Harness, Host, Settings, Side};
    use epigraph_scenes::{NO_FACE, Tracer};
    use glam::Vec3;

    use super::*;
    use crate::{
        Pace,
        shared::{
            octahedral::decode_oct16,
            testing::{Random, settings},
        },
    };

    fn host(scene: &Arc<Scene>) -> Host {
        let mut host = Host::default();
        host.insert(World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact, 1));
        host
    }

    fn harness(normals: Normals, scene: &Scene) -> Harness<Mesh> {
        let settings = Settings { facts: World::facts(scene, false), ..settings([4, 4], 1) };
        Harness::new(MeshParams { normals }, &settings)
    }

    #[test]
    fn every_frame_has_the_lists_of_the_scene() {
        let scene = Arc::new(Scene::load("cornell").unwrap());
        let mut harness = harness(Normals::F32, &scene);
        for frame in 0..2 {
            let out = harness.run(Side::Cpu, &crate::registry(), &host(&scene), None).unwrap();
            let (vertices, faces) = (out.get::<[f32; 4]>("vertices"), out.get::<[u32; 4]>("faces"));
            let (normals, edges) = (out.get::<[f32; 4]>("normals"), out.get::<MeshEdge>("edges"));
            assert_eq!((faces.len(), edges.len()), (36, 58), "frame {frame}");
            let at = |vertex: u32| {
                let [x, y, z, w] = vertices[vertex as usize];
                assert_eq!(w, 1.0);
                Vec3::new(x, y, z)
            };
            for (face, normal) in faces.iter().zip(&normals) {
                let [a, b, c] = [at(face[0]), at(face[1]), at(face[2])];
                let n = (b - a).cross(c - a).normalize();
                assert!(n.distance(Vec3::from_slice(&normal[..3])) < 1e-5);
            }
            for edge in &edges {
                assert_eq!(edge.kind == BORDER, edge.faces[1] == NO_FACE);
                for &face in edge.faces.iter().filter(|&&face| face != NO_FACE) {
                    assert!(edge.vertices.iter().all(|vertex| faces[face as usize][..3].contains(vertex)));
                }
            }
            assert_eq!(edges.iter().filter(|edge| edge.kind == BORDER).count(), 8);
        }
    }

    #[test]
    fn a_new_scene_is_written_if_it_has_the_same_size_and_refused_otherwise() {
        let scene = Arc::new(Scene::load("cornell").unwrap());
        let mut harness = harness(Normals::F32, &scene);
        harness.run(Side::Cpu, &crate::registry(), &host(&scene), None).unwrap();
        let mut moved = Scene::load("cornell").unwrap();
        moved.mesh.positions[3].x += 1.0;
        let expected = moved.mesh.positions[3].x;
        let out = harness.run(Side::Cpu, &crate::registry(), &host(&Arc::new(moved)), None).unwrap();
        assert_eq!(out.get::<[f32; 4]>("vertices")[3][0], expected);

        let other = Arc::new(Scene::load("chains").unwrap());
        let error = harness.run(Side::Cpu, &crate::registry(), &host(&other), None).err().unwrap();
        assert!(error.to_string().contains("compile it again"), "{error}");
    }

    #[test]
    fn moved_bodies_are_written_again() {
        let scene = Arc::new(Scene::load("cornell-moving").unwrap());
        let host = host(&scene);
        let mut harness = harness(Normals::F32, &scene);
        for index in [0, 9, 9, 70] {
            harness.frame.index = index;
            let out = harness.run(Side::Cpu, &crate::registry(), &host, None).unwrap();
            let posed = scene.posed(&scene.poses_at(index)).mesh;
            let lists = |name, expected: &[Vec3]| {
                let list = out.get::<[f32; 4]>(name);
                assert!(
                    list.iter().zip(expected).all(|(a, b)| Vec3::from_slice(a) == *b),
                    "{name}, frame {index}"
                );
                assert_eq!(list.len(), expected.len());
            };
            lists("vertices", &posed.positions);
            lists("normals", &posed.face_normals);
            assert_eq!(out.get::<u32>("edges"), scene.mesh.edges.iter().flat_map(words).collect::<Vec<_>>());
        }
    }

    fn words(edge: &Edge) -> Vec<u32> {
        bytemuck::cast_slice(&[mesh_edge(edge)]).to_vec()
    }

    /// The angle between a unit vector and another of any length, radians.
    fn angle(a: Vec3, b: Vec3) -> f32 {
        a.cross(b).length().atan2(a.dot(b))
    }

    #[test]
    fn small_formats_are_accurate() {
        let mut random = Random(11);
        let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
        let random = (0..10_000).map(|_| {
            let mut axis = || random.between(-1.0, 1.0);
            Vec3::new(axis(), axis(), axis()).normalize_or_zero()
        });
        let (mut worst_f16, mut worst_oct16) = (0f32, 0f32);
        for n in axes.into_iter().chain(random).filter(|&n| n != Vec3::ZERO) {
            worst_f16 = worst_f16.max(angle(n, decode_f16(encode_f16(n.into())).into()));
            worst_oct16 = worst_oct16.max(angle(n, decode_oct16(encode_oct16(n))));
        }
        // Each of the three numbers has an error of at most half a unit in the last place of numbers near 1: 2^-12.
        assert!(worst_f16 < 3f32.sqrt() / 4096.0 && worst_f16 > 1e-4, "{worst_f16}");
        assert!(worst_oct16 < 7e-5 && worst_oct16 > 1e-5, "{worst_oct16}");
        for axis in axes {
            assert_eq!(decode_oct16(encode_oct16(axis)), axis);
        }
    }

    #[test]
    fn a_zero_normal_is_decoded_as_zero() {
        assert_eq!(decode_f16(encode_f16([0.0; 3])), [0.0; 3]);
        assert_eq!(decode_oct16(encode_oct16(Vec3::ZERO)), Vec3::ZERO);
    }
}
