//! What the surface at each pixel's centre is, without the light on it (`algorithms.md` section 13).
//!
//! The surface is the first one that a ray through the pixel's centre meets, as the tracer sees it: beyond the near
//! plane, at the positions of this frame, without holes and culled backs. Glass and mirrors are surfaces like any
//! other: the ports tell of them, not of what shows through or in them.
//!
//! On the CPU rays find the surfaces, and the lists of triangles are not read. On the GPU the triangles are drawn, then
//! each pixel's ray is followed to the triangle that it shows. The rasteriser rounds corners to a fraction of a pixel:
//! where an edge passes a pixel's centre as closely, the sides may show different triangles. Materials that look
//! different from point to point, by textures or colours of the mesh, are known on the CPU alone.

use epigraph_core::{
    CpuContext, Extent, Facts, Frame, In, Io, Out, Pass, Shape, Side, Stage, constants, scratch, texel,
};
use epigraph_scenes::{Scene, Surface, Tracer};
use half::f16;
use rayon::prelude::*;

use crate::{
    World, facts,
    meaning::{
        ALBEDO, CORNERS, DEPTH, EMISSION, FACE, FACES, LOOKS, MOTION, MOVES, NORMAL, ROUGHNESS, VERTICES,
    },
    shared::{
        moves::Move,
        octahedral::{NO_NORMAL, encode_oct16},
        segments::NO_FACE,
        source::Ray,
        view::{dot, place_in_image},
    },
    surfaces::{self, SurfaceLook},
};

constants! {
    /// The motion, on both axes, of what was not in front of the eye in the last frame: outside of every image.
    pub const NOWHERE: f32 = 1e9;
    /// From metres to depths below 1 for the rasteriser: a power of two, for distances of up to 10^12 metres.
    const DEPTH_SCALE: f32 = 1.0 / (1u64 << 40) as f32;
}

/// See the module.
pub struct Gbuffer {
    moves: Option<In<Move>>,
    id: Out<u32>,
    depth: Out<f32>,
    normal: Out<u32>,
    albedo: Out<texel::Rgba16Float>,
    emission: Out<texel::Rgba32Float>,
    roughness: Out<f32>,
    motion: Out<[f32; 2]>,
}

impl Stage for Gbuffer {
    const KIND: &'static str = "gbuffer";
    const DOC: &'static str =
        "What the surface at each pixel's centre is: geometry and material, without light.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(shader!("gbuffer"));
        io.constants(CONSTANTS);
        io.constants(surfaces::CONSTANTS);
        io.read::<[f32; 4]>("vertices", VERTICES, facts::VERTICES.list());
        let faces: In<[u32; 4]> = io.read("faces", FACES, facts::FACES.list());
        io.read::<[u32; 4]>("corners", CORNERS, facts::FACES.list());
        io.read::<SurfaceLook>("looks", LOOKS, facts::MATERIALS.list());
        let moves = io.optional(
            "moves",
            MOVES.doc("How each body has moved since the last frame; without it, `motion` is the camera's."),
            Extent::Any,
        );
        if moves.is_some() {
            io.define("MOVES");
        }
        let pixels = || Extent::Frame(1);
        let drawn: Out<texel::R32Uint> =
            io.write("drawn", scratch("The triangle that the rasteriser drew."), pixels());
        io.pass(Pass::Draw {
            vertex: "corner".into(),
            fragment: "draw".into(),
            shape: Shape::Triangles,
            vertices: 3,
            count: faces.into(),
            targets: vec![drawn.into()],
            depth: true,
            clear: NO_FACE.into(),
        });
        io.dispatch("resolve", drawn);
        Self {
            moves,
            id: io.write("id", FACE.doc("The triangle; 0xFFFFFFFF if there is none."), pixels()),
            depth: io.write(
                "depth",
                DEPTH.doc("Distance along the view axis, metres; that of the far plane if there is none, and at most."),
                pixels(),
            ),
            normal: io.write(
                "normal",
                NORMAL.doc(
                    "The shading normal, as interpolated and bent by a normal map, on the side of the triangle that is \
                     seen: two signed 16-bit integers on an octahedron, x low; 0x80008000 if there is none.",
                ),
                pixels(),
            ),
            albedo: io.write(
                "albedo",
                ALBEDO.doc(
                    "The share of light that all lobes of the surface scatter, seen along its normal: colour + f0 (1 - \
                     metallic), by channel; 0 where it is unlit. Alpha is 1; all is 0 if there is none.",
                ),
                pixels(),
            ),
            emission: io.write(
                "emission",
                EMISSION.doc("Radiance that the surface emits towards the eye. Alpha is 1; all is 0 if there is none."),
                pixels(),
            ),
            roughness: io.write(
                "roughness",
                ROUGHNESS.doc("Perceptual roughness, 0 to 1; 0 if there is none."),
                pixels(),
            ),
            motion: io.write(
                "motion",
                MOTION.doc(
                    "Where this point of the surface was in the last frame's image, minus the pixel's centre, in pixels, \
                     x right and y down; 1e9 twice if it was not in front of the eye. If there is none, by direction.",
                ),
                pixels(),
            ),
        }
    }

    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let frame = cx.frame();
        let tracer = cx.host::<World>()?.at(frame.index);
        let moves = self.moves.map(|moves| cx.read(moves));
        let eye = Eye {
            frame,
            tracer: &tracer,
            moves: moves.as_deref().unwrap_or_default(),
            rests: frame.view == frame.previous,
        };
        let width = frame.size[0] as usize;
        let (mut id, mut depth, mut normal) =
            (cx.write(self.id), cx.write(self.depth), cx.write(self.normal));
        let (mut albedo, mut emission) = (cx.write(self.albedo), cx.write(self.emission));
        let (mut roughness, mut motion) = (cx.write(self.roughness), cx.write(self.motion));
        let rows = (
            id.par_chunks_mut(width),
            depth.par_chunks_mut(width),
            normal.par_chunks_mut(width),
            albedo.par_chunks_mut(width),
            emission.par_chunks_mut(width),
            roughness.par_chunks_mut(width),
            motion.par_chunks_mut(width),
        );
        let rows = rows.into_par_iter().enumerate();
        rows.for_each(|(y, (id, depth, normal, albedo, emission, roughness, motion))| {
            for x in 0..width {
                let seen = eye.sees([x as f32 + 0.5, y as f32 + 0.5]);
                id[x] = seen.id;
                depth[x] = seen.depth;
                normal[x] = seen.normal;
                albedo[x] = seen.albedo.map(f16::from_f32);
                emission[x] = seen.emission;
                roughness[x] = seen.roughness;
                motion[x] = seen.motion;
            }
        });
        Ok(())
    }

    fn unable((): &(), side: Side, facts: &Facts) -> Option<&'static str> {
        (side == Side::Gpu && facts.holds(facts::LOOKS_VARY) == Some(true)).then_some(
            "the scene has textures or colours of its mesh, which only the CPU form of this stage knows",
        )
    }
}

/// What the ports tell of a pixel.
struct Pixel {
    id: u32,
    depth: f32,
    normal: u32,
    albedo: [f32; 4],
    emission: [f32; 4],
    roughness: f32,
    motion: [f32; 2],
}

/// The frame's view of the scene.
struct Eye<'a> {
    frame: &'a Frame,
    tracer: &'a Tracer,
    /// By body number; empty if nothing moves.
    moves: &'a [Move],
    /// Whether the view is that of the last frame.
    rests: bool,
}

impl Eye<'_> {
    /// What is at a position in the image, pixels.
    fn sees(&self, at: [f32; 2]) -> Pixel {
        let view = &self.frame.view;
        let ray = Ray::through(view, at, self.frame.size);
        let Some(surface) = self.tracer.surface(ray.origin, ray.direction, ray.near) else {
            let [x, y, z] = ray.direction.to_array();
            return Pixel {
                id: NO_FACE,
                depth: view.far,
                normal: NO_NORMAL,
                albedo: [0.0; 4],
                emission: [0.0; 4],
                roughness: 0.0,
                motion: self.motion(at, [x, y, z, 0.0], &Move::REST),
            };
        };
        let Surface { position, face, normal, albedo, emission, roughness } = surface;
        let distance = dot((position - ray.origin).to_array(), view.forward);
        // Rounding has moved `position` by some millionths of the triangle's size, also across the ray.
        let [x, y, z] = (ray.origin + ray.direction * distance).to_array();
        Pixel {
            id: face,
            depth: distance.min(view.far),
            normal: encode_oct16(normal),
            albedo: albedo.extend(1.0).to_array(),
            emission: emission.extend(1.0).to_array(),
            roughness,
            motion: self.motion(at, [x, y, z, 1.0], self.moved(self.tracer.scene(), face)),
        }
    }

    /// How the body of a triangle has moved.
    fn moved(&self, scene: &Scene, face: u32) -> &Move {
        if self.moves.is_empty() { &Move::REST } else { &self.moves[scene.body_of_face(face) as usize] }
    }

    /// Where a point (w = 1) or direction (w = 0), which is at a position in the image, was in the last frame's.
    fn motion(&self, at: [f32; 2], [x, y, z, w]: [f32; 4], moved: &Move) -> [f32; 2] {
        let stays = *moved == Move::REST;
        if stays && self.rests {
            return [0.0; 2];
        }
        let [x, y, z] = if stays { [x, y, z] } else { moved.point_before([x, y, z]) };
        let [x, y, z] = place_in_image(&self.frame.previous, [x, y, z, w], self.frame.size);
        if z > 0.0 { [x - at[0], y - at[1]] } else { [NOWHERE; 2] }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use epigraph_core::{Harness, Host, Outputs, Settings, Side, View};
    use epigraph_scenes::{
        CREASE_ANGLE, Camera, CameraPath, Material, Motion, MotionKey, SceneBuilder, Shape, TraceSettings,
    };
    use glam::{Quat, Vec3};

    use super::*;
    use crate::{
        Pace,
        mesh::{Mesh, MeshParams},
        shared::{
            cloud::NO_POINT,
            octahedral::decode_oct16,
            requests::{HIT_BACKGROUND, HIT_SURFACE, PIXEL_CENTER, Request, Sample, VIEW_NOW},
            testing::settings,
        },
        surfaces::Surfaces,
    };

    /// A stage in front of a scene.
    struct Seat {
        scene: Arc<Scene>,
        host: Host,
        harness: Harness<Gbuffer>,
        mesh: Harness<Mesh>,
        surfaces: Harness<Surfaces>,
    }

    impl Seat {
        fn new(scene: Arc<Scene>, size: [u32; 2]) -> Self {
            let mut host = Host::default();
            host.insert(World::new(Arc::new(Tracer::new(scene.clone())), Pace::Exact, 1));
            let settings = Settings { facts: World::facts(&scene, false), ..settings(size, 1) };
            let (mesh, surfaces) =
                (Harness::new(MeshParams::default(), &settings), Harness::new((), &settings));
            Self { scene, host, harness: Harness::new((), &settings), mesh, surfaces }
        }

        /// A scene as a builder fills it.
        fn of(fill: impl FnOnce(&mut SceneBuilder), size: [u32; 2]) -> Self {
            let mut builder = SceneBuilder::new();
            fill(&mut builder);
            let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.0, 0.1, 100.0);
            Self::new(Arc::new(builder.build("test", camera, Vec3::ZERO, 0.0, CREASE_ANGLE).unwrap()), size)
        }

        /// Frame `index` along a camera path, with the moves of the bodies.
        fn frame(&mut self, path: &CameraPath, index: u32) -> Outputs {
            let size = self.harness.frame.size;
            self.harness.frame = World::frame_of(path, index, size, 1, 1);
            let [now, before] = [index, index.saturating_sub(1)].map(|frame| self.scene.poses_at(frame));
            let moved = now.iter().zip(&before).map(|(now, before)| Move::of(&now.after(&before.inverse())));
            let mut moves = vec![Move::REST];
            moves.extend(moved);
            self.harness.set("moves", &moves);
            self.run()
        }

        fn run(&mut self) -> Outputs {
            self.run_on(Side::Cpu)
        }

        /// Runs a frame; one on the GPU leaves the frame's number as it is.
        fn run_on(&mut self, side: Side) -> Outputs {
            let (registry, frame) = (crate::registry(), self.harness.frame);
            (self.mesh.frame, self.surfaces.frame) = (frame, frame);
            let mesh = self.mesh.run(Side::Cpu, &registry, &self.host, None).unwrap();
            let surfaces = self.surfaces.run(Side::Cpu, &registry, &self.host, None).unwrap();
            self.harness.set("vertices", &mesh.get::<[f32; 4]>("vertices"));
            self.harness.set("faces", &mesh.get::<[u32; 4]>("faces"));
            self.harness.set("corners", &surfaces.get::<[u32; 4]>("corners"));
            self.harness.set("looks", &surfaces.get::<SurfaceLook>("looks"));
            let gpu = (side == Side::Gpu).then(epigraph_core::testing::gpu);
            let out = self.harness.run(side, &registry, &self.host, gpu).unwrap();
            if side == Side::Gpu {
                self.harness.frame = frame;
            }
            out
        }

        /// Runs a frame on the GPU and on the CPU, which must agree but for `allowed` pixels, and returns what the CPU
        /// wrote.
        #[track_caller]
        fn run_alike(&mut self, allowed: usize) -> Outputs {
            let gpu = self.run_on(Side::Gpu);
            let cpu = self.run();
            let differ = differences(&self.harness.frame, &cpu, &gpu);
            assert!(differ.len() <= allowed, "{} pixels, {allowed} may; {}", differ.len(), differ[0]);
            cpu
        }
    }

    /// The pixels in which the sides differ, in words. Where they show the same triangle, they round sums in their own
    /// ways.
    fn differences(frame: &Frame, cpu: &Outputs, gpu: &Outputs) -> Vec<String> {
        let [ids, gpu_ids] = [cpu, gpu].map(|out| out.get::<u32>("id"));
        let [depths, gpu_depths] = [cpu, gpu].map(|out| out.get::<f32>("depth"));
        let [normals, gpu_normals] = [cpu, gpu].map(normals);
        let [albedos, gpu_albedos] = [cpu, gpu].map(|out| out.get::<[f16; 4]>("albedo"));
        let [emissions, gpu_emissions] = [cpu, gpu].map(|out| out.get::<[f32; 4]>("emission"));
        let [roughness, gpu_roughness] = [cpu, gpu].map(|out| out.get::<f32>("roughness"));
        let [motions, gpu_motions] = [cpu, gpu].map(|out| out.get::<[f32; 2]>("motion"));
        let far = |a: f32, b: f32, tolerance: f32| (a - b).abs() > tolerance * a.abs().max(b.abs()).max(1.0);
        let wrong = |pixel: usize| {
            let (depth, gpu_depth) = (depths[pixel], gpu_depths[pixel]);
            if ids[pixel] != gpu_ids[pixel] {
                return Some(format!(
                    "triangle {} and {}, {depth} and {gpu_depth} m",
                    ids[pixel], gpu_ids[pixel]
                ));
            }
            // The ray may pass just outside of the triangle that was drawn, and then meets its edge.
            if far(depth, gpu_depth, 3e-5) {
                return Some(format!("depth {depth} and {gpu_depth}"));
            }
            if normals[pixel].distance(gpu_normals[pixel]) > 1e-3 {
                return Some(format!("normal {} and {}", normals[pixel], gpu_normals[pixel]));
            }
            let albedo = |lanes: [f16; 4]| lanes.map(f16::to_f32);
            let (albedo, gpu_albedo) = (albedo(albedos[pixel]), albedo(gpu_albedos[pixel]));
            // A step of f16.
            if (0..4).any(|lane| far(albedo[lane], gpu_albedo[lane], 1e-3)) {
                return Some(format!("albedo {albedo:?} and {gpu_albedo:?}"));
            }
            if (emissions[pixel], roughness[pixel]) != (gpu_emissions[pixel], gpu_roughness[pixel]) {
                return Some(format!("emission {:?} and {:?}", emissions[pixel], gpu_emissions[pixel]));
            }
            let (motion, gpu_motion) = (motions[pixel], gpu_motions[pixel]);
            (0..2)
                .any(|axis| far(motion[axis], gpu_motion[axis], 1e-3))
                .then(|| format!("motion {motion:?} and {gpu_motion:?}"))
        };
        (0..(frame.size[0] * frame.size[1]) as usize)
            .filter_map(|pixel| Some(format!("pixel {pixel}: {} on the CPU and the GPU", wrong(pixel)?)))
            .collect()
    }

    /// A square of this half side, `z` metres in front of the eye, which faces it.
    fn square(half: f32, z: f32) -> Shape {
        let corner = |x: f32, y: f32| Vec3::new(x, y, -z);
        Shape::quad([corner(-half, -half), corner(half, -half), corner(half, half), corner(-half, half)])
    }

    const VIEW: View = View {
        eye: [0.0; 3],
        near: 1.0,
        right: [1.0, 0.0, 0.0],
        far: 100.0,
        up: [0.0, 1.0, 0.0],
        tan_x: 1.0,
        forward: [0.0, 0.0, -1.0],
        tan_y: 1.0,
    };

    /// The unit normals of the pixels, zero for none.
    fn normals(out: &Outputs) -> Vec<Vec3> {
        out.get::<u32>("normal").into_iter().map(|code| decode_oct16(code).normalize_or_zero()).collect()
    }

    #[test]
    fn one_pixel_by_hand() {
        let metal = Material::metal("", Vec3::new(0.5, 0.25, 0.125), 0.75);
        // So that the axis passes the squares above their diagonals.
        let aside = Vec3::new(0.2, 0.0, 0.0);
        let mut seat = Seat::of(
            |builder| {
                let [white, metal] =
                    [Material::diffuse("", Vec3::ONE), metal].map(|one| builder.material(one));
                builder.add(&square(10.0, 8.0).moved(aside), white).unwrap();
                builder.add(&square(1.0, 5.0).moved(aside), metal).unwrap();
            },
            [1, 1],
        );
        seat.harness.frame.view = VIEW;
        seat.harness.frame.previous = VIEW;
        let out = seat.run_alike(0);
        assert_eq!(out.get::<u32>("id"), [3]);
        assert_eq!(out.get::<f32>("depth"), [5.0]);
        assert_eq!(normals(&out), [Vec3::Z]);
        assert_eq!(
            out.get::<f16>("albedo").iter().map(|f| f.to_f32()).collect::<Vec<_>>(),
            [0.5, 0.25, 0.125, 1.0]
        );
        assert_eq!(out.get::<[f32; 4]>("emission"), [[0.0, 0.0, 0.0, 1.0]]);
        assert_eq!(out.get::<f32>("roughness"), [0.75]);
        assert_eq!(out.get::<[f32; 2]>("motion"), [[0.0; 2]]);
        // Behind the near plane, the far square; beyond the far plane, its distance; no surface at all.
        let view = |near, far| View { near, far, ..VIEW };
        for (near, far, depth, is_face) in
            [(5.5, 100.0, 8.0, true), (1.0, 4.0, 4.0, true), (8.5, 100.0, 100.0, false)]
        {
            seat.harness.frame.view = view(near, far);
            let out = seat.run_alike(0);
            assert_eq!(out.get::<f32>("depth"), [depth], "{near} {far}");
            assert_eq!(out.get::<u32>("id")[0] != NO_FACE, is_face, "{near} {far}");
        }
        let out = seat.run_alike(0);
        assert_eq!((out.get::<u32>("normal"), out.get::<f32>("roughness")), (vec![NO_NORMAL], vec![0.0]));
        assert_eq!(
            (out.get::<[u16; 4]>("albedo"), out.get::<[f32; 4]>("emission")),
            (vec![[0; 4]], vec![[0.0; 4]])
        );
    }

    #[test]
    fn it_sees_what_the_tracer_samples() {
        let size = [61, 47];
        for (name, camera, index) in
            [("still-life", "still", 0), ("cornell-moving", "orbit", 40), ("room", "fly", 7)]
        {
            let scene = Arc::new(Scene::load(name).unwrap());
            let path = CameraPath::parse(camera, &scene).unwrap();
            let mut seat = Seat::new(scene.clone(), size);
            let out = seat.frame(&path, index);
            let frame = seat.harness.frame;
            let frame = Frame { index, ..frame };
            let requests: Vec<_> = (0..size[0] * size[1])
                .map(|pixel| Request { pixel, aim: PIXEL_CENTER, reuse: NO_POINT, view: VIEW_NOW })
                .collect();
            let mut samples = vec![Sample::default(); requests.len()];
            let world = seat.host.get::<World>().unwrap();
            world.answer(&frame, &requests, &TraceSettings::default(), &mut samples);
            let (ids, depths) = (out.get::<u32>("id"), out.get::<f32>("depth"));
            for (pixel, sample) in samples.iter().enumerate() {
                let (id, depth) = (ids[pixel], depths[pixel]);
                if sample.hit == HIT_SURFACE {
                    let away = Vec3::from(sample.position) - Vec3::from(frame.view.eye);
                    assert_eq!(depth, dot(away.into(), frame.view.forward), "{name}, pixel {pixel}");
                    assert_eq!(scene.body_of_face(id), sample.body, "{name}, pixel {pixel}");
                } else {
                    assert_eq!((id, depth, sample.hit), (NO_FACE, frame.view.far, HIT_BACKGROUND));
                }
            }
        }
    }

    /// Where a point is in an image, in f64.
    fn projected(view: &View, p: [f64; 3], size: [u32; 2]) -> [f64; 2] {
        let dot = |axis: [f32; 3]| {
            (0..3).map(|i| (p[i] - f64::from(view.eye[i])) * f64::from(axis[i])).sum::<f64>()
        };
        let z = dot(view.forward);
        let half = size.map(|side| 0.5 * f64::from(side));
        [
            half[0] * (1.0 + dot(view.right) / z / f64::from(view.tan_x)),
            half[1] * (1.0 - dot(view.up) / z / f64::from(view.tan_y)),
        ]
    }

    #[test]
    fn motion_leads_to_where_the_point_was() {
        let size = [64, 64];
        let scene = Arc::new(Scene::load("cornell-moving").unwrap());
        let path = CameraPath::parse("shake", &scene).unwrap();
        let mut seat = Seat::new(scene.clone(), size);
        let mut on_bodies = 0;
        for index in [0, 1, 40, 75] {
            let out = seat.frame(&path, index);
            let frame = World::frame_of(&path, index, size, 1, 1);
            let (ids, depths, motion) =
                (out.get::<u32>("id"), out.get::<f32>("depth"), out.get::<[f32; 2]>("motion"));
            for (pixel, (&id, &depth)) in ids.iter().zip(&depths).enumerate() {
                if id == NO_FACE {
                    continue;
                }
                let at = [pixel % 64, pixel / 64].map(|side| side as f32 + 0.5);
                let ray = Ray::through(&frame.view, at, size);
                let point = ray.origin + ray.direction * depth;
                // At rest, and from there to where the body was.
                let body = scene.body_of_face(id);
                let pose = |frame: u32| match body {
                    0 => epigraph_scenes::Pose::REST,
                    body => scene.bodies[body as usize - 1].motion.pose(frame),
                };
                let before = pose(index.saturating_sub(1)).point(pose(index).inverse().point(point));
                let then = projected(&frame.previous, before.to_array().map(f64::from), size);
                for axis in 0..2 {
                    let expected = then[axis] - f64::from(at[axis]);
                    // The point's coordinates are exact to 1e-7 m; a pixel is some millimetres wide.
                    assert!(
                        (f64::from(motion[pixel][axis]) - expected).abs() < 1e-3,
                        "frame {index}, pixel {pixel}"
                    );
                }
                assert!(index > 0 || motion[pixel] == [0.0; 2]);
                on_bodies += usize::from(body > 0 && motion[pixel] != [0.0; 2]);
            }
        }
        assert!(on_bodies > 300, "{on_bodies}");
    }

    #[test]
    fn a_body_that_shifts_moves_its_pixels_and_the_rest_stays() {
        // 3 m away, 0.3 m to the right in a frame: a tenth of the distance is 0.05 of the image of tangent 1.
        let key = |time, x| MotionKey { time, translate: Vec3::new(x, 0.0, 0.0), rotate: Quat::IDENTITY };
        let motion =
            Motion { pivot: Vec3::ZERO, keys: vec![key(0.0, 0.0), key(1.0 / 30.0, 0.3)], looped: false };
        let mut seat = Seat::of(
            |builder| {
                let white = builder.material(Material::diffuse("", Vec3::ONE));
                builder.add(&square(50.0, 10.0), white).unwrap();
                builder.moving(motion, |builder| builder.add(&square(0.4, 3.0), white)).unwrap();
            },
            [40, 39],
        );
        let path = CameraPath::parse("still", &seat.scene).unwrap();
        seat.frame(&path, 0);
        seat.harness.frame.view = VIEW;
        seat.harness.frame.previous = VIEW;
        let frame = seat.harness.frame;
        seat.harness.frame = Frame { index: 1, ..frame };
        seat.harness.set("moves", &[Move::REST, Move { x: [1.0, 0.0, 0.0, 0.3], ..Move::REST }]);
        let out = seat.run_alike(0);
        let (depth, motion) = (out.get::<f32>("depth"), out.get::<[f32; 2]>("motion"));
        let on_body = depth.iter().zip(&motion).filter(|(depth, _)| **depth < 5.0).map(|(_, motion)| motion);
        let on_body: Vec<_> = on_body.collect();
        assert!(
            !on_body.is_empty() && on_body.iter().all(|m| (m[0] + 2.0).abs() < 1e-4 && m[1].abs() < 1e-4)
        );
        assert!(depth.iter().zip(&motion).all(|(depth, motion)| *depth < 5.0 || *motion == [0.0; 2]));
    }

    #[test]
    fn the_background_moves_by_direction_and_what_was_behind_the_eye_is_nowhere() {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, 1.0, 0.1, 100.0);
        let mut seat = Seat::new(Arc::new(Scene::empty("test", camera, [Vec3::ZERO; 2])), [2, 2]);
        let (sin, cos) = 0.1f32.sin_cos();
        // The camera turned to the right by 0.1, and went any distance.
        let before = View { eye: [5.0, 0.0, 3.0], ..VIEW };
        seat.harness.frame.previous = before;
        seat.harness.frame.view = View { right: [cos, 0.0, sin], forward: [sin, 0.0, -cos], ..VIEW };
        let out = seat.run_alike(0);
        assert_eq!((out.get::<u32>("id"), out.get::<f32>("depth")), (vec![NO_FACE; 4], vec![100.0; 4]));
        // The direction through the middle of the left upper pixel: forward - right / 2 + up / 2.
        let (x, z) = (sin - 0.5 * cos, -cos - 0.5 * sin);
        let [u, v] = out.get::<[f32; 2]>("motion")[0];
        assert!(
            (u - (1.0 + x / -z - 0.5)).abs() < 1e-5 && (v - (1.0 - 0.5 / -z - 0.5)).abs() < 1e-5,
            "{u} {v}"
        );
        seat.harness.frame.previous = View { forward: [0.0, 0.0, 1.0], right: [-1.0, 0.0, 0.0], ..VIEW };
        assert_eq!(seat.run_alike(0).get::<[f32; 2]>("motion"), [[NOWHERE; 2]; 4]);
    }

    #[test]
    fn degenerate_triangles_and_holes_are_not_seen() {
        let mut seat = Seat::of(
            |builder| {
                let white = builder.material(Material::diffuse("", Vec3::ONE));
                let culled = builder.material(Material { culled: true, ..Material::diffuse("", Vec3::ONE) });
                let hole = Material {
                    alpha: epigraph_scenes::Alpha::Mask(0.5),
                    opacity: 0.4,
                    ..Material::diffuse("", Vec3::ONE)
                };
                let hole = builder.material(hole);
                let line = [Vec3::new(-1.0, 0.0, -2.0), Vec3::new(1.0, 0.0, -2.0), Vec3::new(0.0, 0.0, -2.0)];
                let line = Shape {
                    positions: line.to_vec(),
                    triangles: vec![[0, 1, 2], [0, 0, 1]],
                    ..Shape::default()
                };
                builder.add(&line, white).unwrap();
                let mut back = square(5.0, 3.0);
                back.triangles.iter_mut().for_each(|triangle| triangle.swap(0, 1));
                builder.add(&back, culled).unwrap();
                builder.add(&square(5.0, 4.0), hole).unwrap();
                builder.add(&square(50.0, 6.0), white).unwrap();
            },
            [5, 4],
        );
        seat.harness.frame.view = VIEW;
        assert_eq!(seat.run_alike(0).get::<f32>("depth"), [6.0; 20]);
    }

    #[test]
    fn both_sides_agree() {
        // Pixels whose centres an edge passes within a few thousandths of a pixel: more where triangles are small.
        for (name, camera, size, index, allowed) in [
            ("cornell", "orbit", [61, 47], 9, 2),
            ("cornell", "still", [1, 1], 0, 0),
            ("chains", "fly", [128, 96], 20, 40),
            ("room", "orbit", [160, 120], 3, 70),
            ("cornell-moving", "shake", [97, 64], 41, 4),
            ("cornell-moving", "still", [97, 64], 80, 4),
        ] {
            let scene = Arc::new(Scene::load(name).unwrap());
            let path = CameraPath::parse(camera, &scene).unwrap();
            let mut seat = Seat::new(scene, size);
            seat.frame(&path, index);
            seat.harness.frame.index = index;
            let (gpu, cpu) = (seat.run_on(Side::Gpu), seat.run());
            let differ = differences(&seat.harness.frame, &cpu, &gpu);
            let other: Vec<_> = differ.iter().filter(|text| !text.contains("triangle")).collect();
            assert!(other.is_empty(), "{name} {camera}: {other:#?}");
            assert!(differ.len() <= allowed, "{name} {camera}: {} pixels; {differ:#?}", differ.len());
        }
    }

    #[test]
    fn looks_that_vary_are_left_to_the_cpu() {
        let why = |name: &str, side: Side| {
            let facts = World::facts(&Scene::load(name).unwrap(), false);
            Gbuffer::unable(&(), side, &facts)
        };
        assert!(why("still-life", Side::Gpu).is_some_and(|why| why.contains("textures")));
        assert_eq!([why("still-life", Side::Cpu), why("cornell", Side::Gpu)], [None; 2]);
    }

    #[test]
    fn the_comparison_can_fail() {
        let scene = Arc::new(Scene::load("cornell").unwrap());
        let path = CameraPath::parse("orbit", &scene).unwrap();
        let mut seat = Seat::new(scene, [32, 24]);
        let [one, other] = [3, 30].map(|index| seat.frame(&path, index));
        assert!(differences(&seat.harness.frame, &one, &other).len() > 100);
    }
}
