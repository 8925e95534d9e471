//! Finds the edges of the mesh that are silhouettes from the eye (`algorithms.md` section 2.1).
//!
//! A pass over the faces tests once for each whether it faces the eye; edges then only need the bits of their two
//! faces. An edge between smoothly joined faces is a silhouette if exactly one of them faces the eye, a crease if
//! either does, a border if its face does, or always. Since all edges of a face see the same bit, the silhouettes of a
//! closed mesh are closed loops, however the bit was rounded.
//!
//! A prefix sum compacts the silhouettes into a list, in edge order. The papers read the bits of the edges back and did
//! this on the CPU: that is `compaction: Readback`, followed by the stage [`crate::compact`].

use epigraph_core::{CpuContext, Extent, Facts, In, Io, Out, Stage, Threads, choice, params, scratch};
use glam::Vec3;
use rayon::prelude::*;

use crate::{
    column,
    compact::Compaction,
    facts,
    meaning::{DRAWN, EDGES, FACES, NORMALS, VERTICES},
    mesh::{Normals, decode_f16},
    shared::{
        octahedral::decode_oct16,
        scan::SCAN_BLOCKS,
        segments::{CREASE, MeshEdge, REGULAR},
    },
};

choice! {
    /// Where the silhouettes are collected.
    pub enum Collect {
        /// Here, by a prefix sum.
        PrefixSum,
        /// By a node of kind `compact` that reads `drawn`, on the CPU: as in the papers.
        Readback,
    }
}

params! {
    /// Parameters of [`Silhouette`].
    pub struct SilhouetteParams {
        /// How the normals of faces are stored, as in the node of kind `mesh`.
        normals: Normals = Normals::F32;
        /// Where the silhouettes are collected.
        compaction: Collect = Collect::PrefixSum;
        /// Draw edges with one face always; otherwise only if their face faces the eye.
        two_sided_borders: bool = true;
    }
}

/// See the module.
pub struct Silhouette {
    vertices: In<[f32; 4]>,
    faces: In<[u32; 4]>,
    normals: NormalsIn,
    edges: In<MeshEdge>,
    facing: Out<u32>,
    drawn: Out<u32>,
    compaction: Option<Compaction>,
}

enum NormalsIn {
    F32(In<[f32; 4]>),
    F16(In<[u32; 2]>),
    Oct16(In<u32>),
}

impl Stage for Silhouette {
    const KIND: &'static str = "silhouette";
    const DOC: &'static str = "Finds the edges of the mesh that are silhouettes for the eye.";
    type Params = SilhouetteParams;

    fn declare(params: &SilhouetteParams, io: &mut Io) -> Self {
        io.column(column::E1);
        io.shader(shader!("silhouette"));
        io.per_view();
        let vertices = io.read("vertices", VERTICES, facts::VERTICES.list());
        let faces = io.read("faces", FACES, facts::FACES.list());
        let (name, doc) = ("normals", "Normals of the triangles.");
        let normals = match params.normals {
            Normals::F32 => NormalsIn::F32(io.read(name, NORMALS.doc(doc), facts::FACES.list())),
            Normals::F16 => {
                io.define("F16");
                NormalsIn::F16(io.read(name, NORMALS.doc(doc), facts::FACES.list()))
            }
            Normals::Oct16 => {
                io.define("OCT16");
                NormalsIn::Oct16(io.read(name, NORMALS.doc(doc), facts::FACES.list()))
            }
        };
        let edges = io.read("edges", EDGES, facts::EDGES.list());
        let bits_of = |list: &'static str| Extent::BitsOf(list.into());
        let facing = io.write("facing", "Bits of the faces that face the eye.", bits_of("faces"));
        let drawn = io.write("drawn", DRAWN, bits_of("edges"));

        io.dispatch("face_eye", faces);
        io.dispatch("choose", edges);
        let compaction = (params.compaction == Collect::PrefixSum).then(|| {
            let compaction = Compaction::declare(io, vertices, edges);
            io.define("PREFIX_SUM");
            io.write::<u32>("sums", scratch("Silhouettes, by block."), Extent::Fixed([SCAN_BLOCKS, 1]));
            io.compute("add_up", Threads::Groups(SCAN_BLOCKS));
            io.compute("collect", Threads::Groups(SCAN_BLOCKS));
            compaction
        });
        Self { vertices, faces, normals, edges, facing, drawn, compaction }
    }

    fn cpu(&self, params: &SilhouetteParams, cx: &CpuContext) -> Result<(), String> {
        match self.normals {
            NormalsIn::F32(normals) => {
                let normals = &cx.read(normals)[..];
                self.face_eye(cx, |face| Vec3::from_slice(&normals[face][..3]));
            }
            NormalsIn::F16(normals) => {
                let normals = &cx.read(normals)[..];
                self.face_eye(cx, |face| decode_f16(normals[face]).into());
            }
            NormalsIn::Oct16(normals) => {
                let normals = &cx.read(normals)[..];
                self.face_eye(cx, |face| decode_oct16(normals[face]));
            }
        }
        self.choose(cx, params.two_sided_borders);
        if let Some(compaction) = &self.compaction {
            compaction.run(cx, &cx.write(self.drawn));
        }
        Ok(())
    }

    fn needless(_: &SilhouetteParams, facts: &Facts) -> Option<&'static str> {
        (facts.count(facts::FACES) == Some(0)).then_some("the scene has no faces")
    }
}

impl Silhouette {
    /// A face faces the eye if the eye is on the side of its plane to which its normal points, not in the plane.
    fn face_eye(&self, cx: &CpuContext, normal: impl Fn(usize) -> Vec3 + Sync) {
        let (vertices, faces) = (&cx.read(self.vertices)[..], &cx.read(self.faces)[..]);
        let eye = Vec3::from(cx.frame().view.eye);
        fill_bits(&mut cx.write(self.facing), faces, |face, &[v0, ..]| {
            let p = Vec3::from_slice(&vertices[v0 as usize][..3]) - eye;
            normal(face).dot(p) < 0.0
        });
    }

    fn choose(&self, cx: &CpuContext, two_sided_borders: bool) {
        let facing = &cx.write(self.facing)[..];
        let faces_eye = |face: u32| facing[face as usize / 32] >> (face % 32) & 1 == 1;
        fill_bits(&mut cx.write(self.drawn), &cx.read(self.edges), |_, edge| {
            let first = faces_eye(edge.faces[0]);
            match edge.kind {
                REGULAR => first != faces_eye(edge.faces[1]),
                CREASE => first || faces_eye(edge.faces[1]),
                _ => first || two_sided_borders,
            }
        });
    }
}

/// Writes a bit for each item, 32 to a word.
fn fill_bits<T: Sync>(words: &mut [u32], items: &[T], bit: impl Fn(usize, &T) -> bool + Sync) {
    words.par_iter_mut().zip(items.par_chunks(32)).enumerate().with_min_len(64).for_each(
        |(index, (word, items))| {
            let bit = |(i, item)| u32::from(bit(32 * index + i, item)) << i;
            *word = items.iter().enumerate().map(bit).fold(0, |word, bit| word | bit);
        },
    );
}

#[cfg(test)]
mod tests {
    use std::{collections::HashSet, f32::consts::TAU};

    use epigraph_core::{Harness, Outputs, Settings, Side, View};
    use epigraph_scenes::{CREASE_ANGLE, Camera, Material, Scene, SceneBuilder, Shape};

    use super::*;
    use crate::{
        World,
        compact::Compact,
        mesh::encode_f16,
        shared::{
            octahedral::encode_oct16,
            segments::{BORDER, NO_FACE, Segment},
            testing::{Random, run_alike, run_both, run_cpu, settings},
        },
    };

    /// The lists of a mesh.
    struct Lists {
        settings: Settings,
        vertices: Vec<[f32; 4]>,
        faces: Vec<[u32; 4]>,
        normals: Vec<Vec3>,
        edges: Vec<MeshEdge>,
    }

    impl Lists {
        fn of(scene: &Scene) -> Self {
            let mesh = &scene.mesh;
            Self {
                settings: Settings { facts: World::facts(scene, false), ..settings([8, 8], 0) },
                vertices: mesh.positions.iter().map(|p| p.extend(1.0).into()).collect(),
                faces: mesh.triangles.iter().map(|&[a, b, c]| [a, b, c, 0]).collect(),
                normals: mesh.face_normals.clone(),
                edges: mesh
                    .edges
                    .iter()
                    .map(|edge| MeshEdge {
                        vertices: edge.vertices,
                        faces: edge.faces,
                        kind: edge.kind as u32,
                        pad: 0,
                    })
                    .collect(),
            }
        }

        fn of_shape(shape: &Shape) -> Self {
            Self::of_material(shape, Material::diffuse("", Vec3::ONE))
        }

        fn of_material(shape: &Shape, material: Material) -> Self {
            let mut builder = SceneBuilder::new();
            let material = builder.material(material);
            builder.add(shape, material).unwrap();
            let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1, 10.0);
            Self::of(&builder.build("test", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap())
        }

        fn harness(&self, params: SilhouetteParams) -> Harness<Silhouette> {
            let normals = params.normals;
            let mut harness = Harness::new(params, &self.settings);
            harness.set("vertices", &self.vertices);
            harness.set("faces", &self.faces);
            harness.set("edges", &self.edges);
            match normals {
                Normals::F32 => harness.set("normals", &self.list(|n| n.extend(0.0).to_array())),
                Normals::F16 => harness.set("normals", &self.list(|n| encode_f16(n.into()))),
                Normals::Oct16 => harness.set("normals", &self.list(encode_oct16)),
            }
            harness
        }

        fn list<T>(&self, encode: impl Fn(Vec3) -> T) -> Vec<T> {
            self.normals.iter().map(|&n| encode(n)).collect()
        }
    }

    /// The silhouettes that the twin lists in a frame.
    fn segments(harness: &mut Harness<Silhouette>) -> Vec<Segment> {
        listed(&run_alike(harness))
    }

    fn listed(out: &Outputs) -> Vec<Segment> {
        let mut segments = out.get::<Segment>("segments");
        segments.truncate(out.get::<u32>("count")[0] as usize);
        segments
    }

    fn edges_of(segments: &[Segment]) -> Vec<u32> {
        segments.iter().map(|segment| segment.edge).collect()
    }

    /// A quad in the plane z = 0 that faces +z: a regular edge and four borders.
    fn quad() -> Lists {
        Lists::of_shape(&Shape::quad([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y]))
    }

    fn all_of(lists: &Lists, kind: u32) -> Vec<u32> {
        (0..lists.edges.len() as u32).filter(|&edge| lists.edges[edge as usize].kind == kind).collect()
    }

    #[test]
    fn borders_are_drawn_from_the_front_or_from_both_sides() {
        let lists = quad();
        let borders = all_of(&lists, BORDER);
        assert_eq!(borders.len(), 4);
        let seen = |two_sided_borders, z| {
            let mut harness =
                lists.harness(SilhouetteParams { two_sided_borders, ..SilhouetteParams::default() });
            harness.frame.view.eye = [0.3, 0.2, z];
            edges_of(&segments(&mut harness))
        };
        // At z = 0, the eye is exactly in the plane of the faces, which then do not face it.
        for (two_sided, z, shown) in [
            (true, 2.0, true),
            (true, -2.0, true),
            (true, 0.0, true),
            (false, 2.0, true),
            (false, -2.0, false),
            (false, 0.0, false),
        ] {
            let expected = if shown { borders.clone() } else { vec![] };
            assert_eq!(seen(two_sided, z), expected, "two-sided {two_sided}, z = {z}");
        }
    }

    #[test]
    fn faces_with_culled_backs_have_edges_from_the_front_only() {
        let culled = Material { culled: true, ..Material::diffuse("", Vec3::ONE) };
        let quad = Shape::quad([Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y]);
        let lists = Lists::of_material(&quad, culled);
        let borders = all_of(&lists, CREASE);
        assert_eq!((borders.len(), all_of(&lists, BORDER)), (4, vec![]));
        let mut harness = lists.harness(SilhouetteParams::default());
        for (z, shown) in [(2.0, borders), (-2.0, vec![])] {
            harness.frame.view.eye = [0.3, 0.2, z];
            assert_eq!(edges_of(&segments(&mut harness)), shown, "z = {z}");
        }
    }

    #[test]
    fn creases_are_drawn_if_one_of_their_faces_faces_the_eye() {
        // Diagonals of the cube's sides are regular edges between coplanar faces, and never silhouettes.
        let lists = Lists::of_shape(&Shape::cuboid(Vec3::ZERO, Vec3::ONE));
        let creases = all_of(&lists, CREASE);
        assert_eq!((lists.edges.len(), creases.len()), (18, 12));
        let seen = |eye: [f32; 3]| {
            let mut harness = lists.harness(SilhouetteParams::default());
            harness.frame.view.eye = eye;
            segments(&mut harness)
        };
        // Eyes that see one side, two and three, and one in the plane of a side.
        assert_eq!(seen([0.5, 0.5, 3.0]).len(), 4);
        assert_eq!(seen([3.0, 0.5, 3.0]).len(), 7);
        assert_eq!(seen([3.0, 3.0, 3.0]).len(), 9);
        assert_eq!(seen([1.0, 0.5, 3.0]).len(), 4);
        assert_eq!(seen([0.5, 0.5, 0.5]).len(), 0);
        for segment in seen([3.0, 3.0, 3.0]) {
            let edge = &lists.edges[segment.edge as usize];
            let [a, b] = edge.vertices.map(|vertex| lists.vertices[vertex as usize]);
            assert_eq!([segment.a, segment.b], [a, b].map(|[x, y, z, _]| [x, y, z]));
        }
    }

    #[test]
    fn degenerate_faces_do_not_face_the_eye() {
        let mut lists = quad();
        lists.normals.fill(Vec3::ZERO);
        for normals in [Normals::F32, Normals::F16, Normals::Oct16] {
            let params = SilhouetteParams { normals, two_sided_borders: false, ..Default::default() };
            let mut harness = lists.harness(params);
            harness.frame.view.eye = [0.0, 0.0, 5.0];
            assert_eq!(segments(&mut harness), [], "{normals:?}");
        }
    }

    /// Eyes around and inside a mesh, some in special positions.
    fn eyes(center: Vec3, reach: f32, count: usize) -> Vec<Vec3> {
        let mut random = Random(9);
        let mut eyes: Vec<Vec3> = (0..count)
            .map(|_| center + reach * Vec3::from([0; 3].map(|_| random.between(-1.0, 1.0))))
            .collect();
        eyes.extend([center, center + reach * Vec3::Z, center + 1e6 * Vec3::X]);
        eyes
    }

    #[test]
    fn closed_meshes_have_closed_silhouettes() {
        let torus = Shape::surface(48, 24, |u, v| {
            let (u, v) = (TAU * (u % 48) as f32 / 48.0, TAU * (v % 24) as f32 / 24.0);
            Vec3::new((1.0 + 0.4 * v.cos()) * u.cos(), 0.4 * v.sin(), (1.0 + 0.4 * v.cos()) * u.sin())
        });
        let shapes = [
            (Lists::of_shape(&Shape::sphere(1.0, 40, 20)), Vec3::ZERO, 3.0),
            (Lists::of_shape(&torus), Vec3::ZERO, 3.0),
            (Lists::of(&Scene::load("chains").unwrap()), Vec3::Y, 3.0),
        ];
        for (index, (mut lists, center, reach)) in shapes.into_iter().enumerate() {
            assert!(lists.edges.iter().all(|edge| edge.faces[1] != NO_FACE), "shape {index} is not closed");
            // This test is about outlines, and creases are drawn inside of outlines too.
            lists.edges.iter_mut().for_each(|edge| edge.kind = REGULAR);
            for normals in [Normals::F32, Normals::F16, Normals::Oct16] {
                let mut harness = lists.harness(SilhouetteParams { normals, ..Default::default() });
                let mut seen = 0;
                for eye in eyes(center, reach, 6) {
                    harness.frame.view.eye = eye.into();
                    let both = run_both(&mut harness);
                    for out in [&both.cpu, &both.gpu] {
                        let edges = edges_of(&listed(out));
                        seen += edges.len();
                        assert!(are_closed(&lists, &edges), "shape {index}, eye {eye}, {normals:?}");
                    }
                }
                assert!(seen > 200, "shape {index} has {seen} edges on silhouettes");
            }
        }
    }

    /// Returns true if the edges form closed loops: an even number of them meets in every vertex.
    fn are_closed(lists: &Lists, edges: &[u32]) -> bool {
        let mut odd = HashSet::new();
        for vertex in edges.iter().flat_map(|&edge| lists.edges[edge as usize].vertices) {
            if !odd.remove(&vertex) {
                odd.insert(vertex);
            }
        }
        odd.is_empty()
    }

    #[test]
    fn the_test_for_closed_loops_can_fail() {
        let lists = Lists::of_shape(&Shape::cuboid(Vec3::ZERO, Vec3::ONE));
        let mut harness = lists.harness(SilhouetteParams::default());
        harness.frame.view.eye = [0.5, 0.5, 3.0];
        let edges = edges_of(&segments(&mut harness));
        assert!(are_closed(&lists, &edges) && !are_closed(&lists, &edges[1..]));
    }

    /// Asserts that both sides list the same silhouettes, except for those of at most `allowed` faces.
    #[track_caller]
    fn assert_sides_agree(lists: &Lists, params: SilhouetteParams, eye: Vec3, allowed: u32) {
        let mut harness = lists.harness(params);
        harness.frame.view = View { eye: eye.into(), ..View::default() };
        let both = run_both(&mut harness);
        let words = |name, items: usize| {
            let words = [&both.cpu, &both.gpu].map(|out| out.get::<u32>(name));
            assert!(words.iter().all(|words| words.len() == items.div_ceil(32)), "`{name}`");
            words
        };
        let differing = |name, items| {
            let [cpu, gpu] = words(name, items);
            cpu.iter().zip(gpu).map(|(cpu, gpu)| (cpu ^ gpu).count_ones()).sum::<u32>()
        };
        let faces = differing("facing", lists.faces.len());
        assert!(faces <= allowed, "{faces} faces differ");
        // Each face that differs changes at most three edges.
        assert!(differing("drawn", lists.edges.len()) <= 3 * faces);

        // Each side's list contains exactly the edges of its own bits, in order.
        for (out, side) in [(&both.cpu, Side::Cpu), (&both.gpu, Side::Gpu)] {
            let words = out.get::<u32>("drawn");
            let drawn = |edge: &u32| words[*edge as usize / 32] >> (edge % 32) & 1 == 1;
            let expected: Vec<u32> = (0..lists.edges.len() as u32).filter(drawn).collect();
            let segments = listed(out);
            assert_eq!(edges_of(&segments), expected, "on {side}");
            for segment in segments {
                let edge = &lists.edges[segment.edge as usize];
                let ends =
                    edge.vertices.map(|vertex| Vec3::from_slice(&lists.vertices[vertex as usize][..3]));
                assert_eq!([segment.a, segment.b].map(Vec3::from), ends);
                assert_eq!(segment.flags, 0);
            }
        }
    }

    #[test]
    fn both_sides_agree() {
        let lists = Lists::of(&Scene::load("chains").unwrap());
        for normals in [Normals::F32, Normals::F16, Normals::Oct16] {
            for eye in eyes(Vec3::Y, 3.0, 2) {
                // If a shader fuses the three products, their sum may round to the other side of zero.
                let params = SilhouetteParams { normals, ..SilhouetteParams::default() };
                assert_sides_agree(&lists, params, eye, 4);
            }
        }
        let quad = quad();
        for two_sided_borders in [true, false] {
            let params = SilhouetteParams { two_sided_borders, ..SilhouetteParams::default() };
            assert_sides_agree(&quad, params, Vec3::new(0.2, 0.3, 4.0), 0);
        }
    }

    #[test]
    fn small_normals_change_few_edges() {
        let lists = Lists::of(&Scene::load("chains").unwrap());
        let seen = |normals| {
            let mut harness = lists.harness(SilhouetteParams { normals, ..Default::default() });
            harness.frame.view.eye = [0.9, 1.85, 4.5];
            edges_of(&segments(&mut harness))
        };
        let exact = seen(Normals::F32);
        for normals in [Normals::F16, Normals::Oct16] {
            let other = seen(normals);
            let missing = exact.iter().filter(|edge| other.binary_search(edge).is_err()).count();
            assert!(missing <= exact.len() / 50, "{normals:?}: {missing} of {}", exact.len());
        }
    }

    /// A mesh of as many faces as the papers' dragon, 871,414, with 1.3 million edges.
    #[test]
    fn more_than_a_million_edges_close_on_both_sides() {
        let lists = Lists::of_shape(&Shape::sphere(1.0, 768, 569));
        assert_eq!((lists.faces.len(), lists.edges.len()), (872_448, 1_308_672));
        let mut harness = lists.harness(SilhouetteParams::default());
        harness.frame.view.eye = [0.9, 1.3, 2.5];
        let both = run_both(&mut harness);
        for out in [&both.cpu, &both.gpu] {
            let edges = edges_of(&listed(out));
            assert!(edges.is_sorted() && are_closed(&lists, &edges));
            // The outline goes around once, mostly along diagonals of the grid.
            assert!(edges.len() > 900 && edges.len() < 5000, "{}", edges.len());
        }
    }

    /// Triangles that share no edges.
    fn loose_triangles(count: u32) -> Lists {
        let mut random = Random(5);
        let positions: Vec<Vec3> =
            (0..3 * count).map(|_| Vec3::from([0; 3].map(|_| random.between(-1.0, 1.0)))).collect();
        let triangles = (0..count).map(|face| [0, 1, 2].map(|corner| 3 * face + corner)).collect();
        Lists::of_shape(&Shape { positions, triangles, ..Shape::default() })
    }

    #[test]
    fn a_mesh_of_borders_only() {
        let lists = loose_triangles(1000);
        assert_eq!(all_of(&lists, BORDER).len(), 3000);
        for eye in eyes(Vec3::ZERO, 2.0, 3) {
            for two_sided_borders in [true, false] {
                let params = SilhouetteParams { two_sided_borders, ..SilhouetteParams::default() };
                assert_sides_agree(&lists, params.clone(), eye, 2);
                let mut harness = lists.harness(params);
                harness.frame.view.eye = eye.into();
                let edges = edges_of(&segments(&mut harness));
                if two_sided_borders {
                    assert_eq!(edges, all_of(&lists, BORDER));
                } else {
                    // The edges of whole triangles, as some face the eye and some do not.
                    assert!(are_closed(&lists, &edges));
                    assert!(edges.len() > 300 && edges.len() < 2700, "{} from {eye}", edges.len());
                }
            }
        }
    }

    #[test]
    fn the_eye_in_the_plane_of_faces_is_the_same_on_both_sides() {
        let cube = Lists::of_shape(&Shape::cuboid(Vec3::ZERO, Vec3::ONE));
        // Eyes in the plane of one side, two sides and three; on an edge; within a side.
        let eyes = [[1.0, 0.5, 3.0], [1.0, 1.0, 3.0], [1.0, 1.0, 1.0], [1.0, 1.0, 0.5], [1.0, 0.5, 0.25]];
        for eye in eyes.map(Vec3::from) {
            for two_sided_borders in [true, false] {
                let params = SilhouetteParams { two_sided_borders, ..SilhouetteParams::default() };
                assert_sides_agree(&cube, params.clone(), eye, 0);
                assert_sides_agree(&quad(), params, Vec3::new(eye.x, eye.y, 0.0), 0);
            }
        }
    }

    #[test]
    fn collecting_on_the_cpu_gives_the_same_list() {
        let lists = Lists::of(&Scene::load("chains").unwrap());
        let eye = [0.9, 1.85, 4.5];
        let mut whole = lists.harness(SilhouetteParams::default());
        whole.frame.view.eye = eye;
        let params = SilhouetteParams { compaction: Collect::Readback, ..SilhouetteParams::default() };
        let mut marks = lists.harness(params);
        marks.frame.view.eye = eye;
        let drawn = run_both(&mut marks).gpu.get::<u32>("drawn");

        let mut compact = Harness::<Compact>::new((), &lists.settings);
        compact.set("vertices", &lists.vertices);
        compact.set("edges", &lists.edges);
        compact.set("drawn", &drawn);
        let out = run_cpu(&mut compact);
        let count = out.get::<u32>("count")[0] as usize;
        assert_eq!(out.get::<Segment>("segments")[..count], segments(&mut whole));
    }
}
