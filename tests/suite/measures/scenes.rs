//! Scenes, camera paths, rays, shadow boundaries and the edges of references.

use std::{
    fs,
    path::Path,
    sync::{Arc, LazyLock},
};

use epigraph_core::testing::Random;
use epigraph_scenes::{
    Camera, CameraPath, Job, Mode, Rng, Scene, SceneFacts, ShadowSearch, ShadowSettings, TraceSettings,
    Tracer, keyframes, predict, reference, shadow_segments,
};
use glam::Vec3;

use super::{Figures, assert_same};

/// A scene with every kind of surface, shape, light and motion. Its floor is a mesh of its own, in three formats.
const SHOW: &str = r##"#![enable(implicit_some)]
Scene(
    version: 1,
    camera: (eye: (0.3, 1.6, 4.2), target: (0.1, 0.7, 0), fov: 48),
    background: (0.1, 0.15, 0.3),
    crease_angle: 31,
    motions: {
        "round": (
            keys: [
                (time: 0),
                (time: 0.7, translate: (0.3, 0.1, 0), rotate: (10, 80, 5)),
                (time: 1.9, translate: (-0.2, 0.2, 0.3), rotate: (0, 200, 0)),
            ],
            pivot: (0.5, 0.2, 0.1),
            looped: true,
        ),
        "once": (keys: [(time: 0.1), (time: 0.5, translate: (0, -0.4, 0.2))]),
    },
    materials: {
        "clay": (color: (0.7, 0.4, 0.3)),
        "metal": (color: (0.2, 0.25, 0.3), surface: Glossy(roughness: 0.3, f0: 0.6)),
        "paint": (color: (0.1, 0.5, 0.2), surface: Glossy(roughness: 0.55)),
        "mirror": (color: (0.9, 0.85, 0.8), surface: Mirror),
        "ember": (color: (0.3, 0.1, 0), emission: (2, 0.7, 0.1)),
    },
    objects: [
        (shape: File("floor.ENDING"), material: "clay", scale: 2, translate: (0, -0.1, 0)),
        (shape: Sphere(center: (-0.9, 0.5, 0.2), radius: 0.5), material: "metal"),
        (shape: Cylinder(base: (0.9, 0, 0.4), radius: 0.3, height: 0.8), material: "paint", rotate: (0, 20, 9)),
        (shape: Box(low: (0, 0, -0.2), high: (0.4, 0.6, 0.2)), material: "paint", motion: "round"),
        (shape: Quad(corner: (-2, 0, -1.5), u: (4, 0, 0), v: (0, 2, 0)), material: "mirror"),
        (shape: Sphere(center: (0.2, 1.4, -0.4), radius: 0.15), material: "ember", motion: "once"),
        (shape: Box(low: (0, 0, 0), high: (1, 1, 1)), material: "clay", height: 0.3, translate: (-1.6, 0, 0.9),
         smooth: 100, repeat: (count: 3, step: (0.45, 0, 0.1))),
    ],
    lights: [
        Quad(corner: (-0.5, 2.6, -0.5), u: (1, 0, 0), v: (0, 0.1, 0.8), radiance: (9, 8, 7)),
        Point(position: (1.5, 1.8, 1.5), intensity: (2, 3, 4), motion: "once"),
    ],
)"##;

/// A plate with a step, with normals at some corners.
const FLOOR_OBJ: &str = "mtllib floor.mtl\no plate\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\nvn 0 1 0\nvn 0.1 0.9 0\n\
    usemtl dull\nf 1//1 2//2 3//1 4//-1\no step\nv -0.2 0.02 0.1\nv 0.2 0.03 0.1\nv 0 0.05 -0.2\nusemtl shiny\nf -3 -2 -1\n";
const FLOOR_MTL: &str = "newmtl dull\nKd 0.4 0.5 0.6\n# grey\nnewmtl shiny\nKd 0.1 0.2 0.1\nKs 0.5 0.5 0.4\nNs 90\nPr 0.4\n\
    Ke 0 0.1 0.2\nillum 2\n";
const FLOOR_PLY: &str = "ply\nformat ascii 1.0\ncomment a plate\nelement vertex 5\nproperty double x\nproperty float y\n\
    property float z\nproperty uchar red\nproperty float nx\nproperty float ny\nproperty float nz\nelement face 2\n\
    property list uchar int vertex_indices\nend_header\n-1 0 1 9 0 1 0\n1 0 1 9 0 1 0\n1 0 -1 9 0.2 1 0\n-1 0 -1 9 0 1 0\n\
    0 0.3 0 9 0 1 0.1\n4 0 1 2 3\n3 0 1 4\n";
const FLOOR_GLTF: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [1, 0]}],
    "nodes": [{"mesh": 0, "translation": [0, 0.01, 0], "scale": [1, 2, 1]}, {"children": [2], "rotation": [0, 0.6, 0, 0.8]},
      {"mesh": 0, "matrix": [0.5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0.5, 0, 0.1, 0.05, 0.2, 1]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 5, "material": 0},
      {"attributes": {"POSITION": 0}, "mode": 6}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.3, 0.6, 0.2, 1], "metallicFactor": 0.4,
      "roughnessFactor": 0.5}, "emissiveFactor": [0, 0.1, 0]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, 0, -1], "max": [1, 0.1, 1]},
      {"bufferView": 1, "componentType": 5123, "count": 4, "type": "SCALAR"}],
    "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 8}],
    "buffers": [{"byteLength": 56, "uri": "floor.bin"}]}"#;

/// The scene with its floor in a format.
fn show(folder: &Path, ending: &str) -> Scene {
    let path = folder.join(format!("{ending}.ron"));
    fs::write(&path, SHOW.replace("ENDING", ending)).expect("a temporary folder");
    let mut scene = Scene::load(&path.display().to_string()).unwrap_or_else(|error| panic!("{error}"));
    scene.name = ending.into();
    scene
}

/// The scenes of this file, and those made by code.
static SCENES: LazyLock<Vec<Arc<Scene>>> = LazyLock::new(scenes);

fn scenes() -> Vec<Arc<Scene>> {
    let folder = std::env::temp_dir().join(format!("epigraph-measures-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    let corners = [-1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.1, -1.0, -1.0, 0.0, -1.0_f32];
    let indices = [0, 1, 3, 2_u16];
    let bin = corners
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .chain(indices.iter().flat_map(|i| i.to_le_bytes()))
        .collect();
    let texts = [
        ("floor.obj", FLOOR_OBJ.into()),
        ("floor.mtl", FLOOR_MTL.into()),
        ("floor.ply", FLOOR_PLY.into()),
        ("floor.gltf", FLOOR_GLTF.into()),
        ("floor.bin", bin),
    ];
    let texts: [(&str, Vec<u8>); 5] = texts;
    for (name, bytes) in texts {
        fs::write(folder.join(name), bytes).expect("a temporary folder");
    }
    let mut scenes: Vec<Scene> = ["obj", "ply", "gltf"].map(|ending| show(&folder, ending)).into();
    // Alone, with their own materials.
    for name in ["floor.obj", "floor.ply", "floor.gltf"] {
        let mut scene =
            Scene::load(&folder.join(name).display().to_string()).unwrap_or_else(|error| panic!("{error}"));
        scene.name = name.into();
        scenes.push(scene);
    }
    fs::remove_dir_all(&folder).expect("a temporary folder");
    scenes.extend(
        ["cornell", "cornell-moving", "chains", "room"]
            .map(|name| Scene::load(name).expect("a built-in scene")),
    );
    scenes.into_iter().map(Arc::new).collect()
}

#[test]
fn scenes_and_rays_are_as_before() {
    let mut figures = Figures::new();
    for scene in &*SCENES {
        let mut add = |what: &str, value: &dyn std::fmt::Debug| {
            figures.entry(format!("{} {what}", scene.name)).or_default().debug(&value);
        };
        add("scene", &scene);
        add("facts", &SceneFacts::of(scene));
        let bodies: Vec<u32> =
            (0..scene.mesh.triangles.len() as u32).map(|face| scene.body_of_face(face)).collect();
        add("bodies", &bodies);
        let tracer = Arc::new(Tracer::new(scene.clone()));
        for frame in [0, 1, 17, 40, 1000] {
            if scene.bodies.is_empty() && frame > 0 {
                break;
            }
            let tracer = tracer.at(frame);
            if frame > 0 {
                add("posed", &tracer.scene().poses);
                add("posed", &tracer.scene().mesh.positions);
                add("posed", &tracer.scene().mesh.face_normals);
                add("posed", &tracer.scene().mesh.corner_normals);
                add("posed", &tracer.scene().lights);
            }
            for (mode, spp, max_bounces) in [
                (Mode::Direct, 1, 8),
                (Mode::Direct, 3, 0),
                (Mode::Path, 1, 0),
                (Mode::Path, 1, 1),
                (Mode::Path, 2, 8),
            ] {
                let size = [19, 15];
                let jobs: Vec<Job> = (0..size[0] * size[1])
                    .map(|pixel| {
                        let [x, y] = [pixel % size[0], pixel / size[0]].map(|at| at as f32 + 0.37);
                        let direction = scene.camera.direction(x, y, size);
                        Job { origin: scene.camera.eye, direction, start: 0.0, key: Rng::key(frame, pixel) }
                    })
                    .collect();
                let mut hits = vec![Default::default(); jobs.len()];
                tracer.trace_batch(&jobs, &TraceSettings { spp, mode, max_bounces }, 5, &mut hits);
                add(&format!("{mode:?} {spp} {max_bounces}"), &hits);
            }
            let seen: Vec<bool> = scene
                .mesh
                .positions
                .iter()
                .step_by(1 + scene.mesh.positions.len() / 300)
                .map(|&position| tracer.visible(scene.camera.eye, position))
                .collect();
            add("visible", &seen);
        }
    }
    assert_same("scenes", &figures);
}

#[test]
fn shadows_and_edges_are_as_before() {
    let mut figures = Figures::new();
    for scene in &*SCENES {
        let mut add = |what: &str, value: &dyn std::fmt::Debug| {
            figures.entry(format!("{} {what}", scene.name)).or_default().debug(&value);
        };
        let tracer = Arc::new(Tracer::new(scene.clone()));
        let edges = reference::edges(&tracer, &scene.camera, [47, 35]);
        add("edges", &edges);
        add(
            "narrow edges",
            &[[1, 9], [2, 30], [30, 1]].map(|size| reference::edges(&tracer, &scene.camera, size)),
        );
        for radius in [0.0, 1.0, 1.5, 4.0] {
            add("within", &reference::within(&edges, 47, radius));
        }
        add(
            "render",
            &reference::render(&tracer, &scene.camera, [9, 7], 3, &TraceSettings::default(), 4, &|| true),
        );
        if scene.name == "room" {
            continue;
        }
        for settings in [
            ShadowSettings::default(),
            ShadowSettings {
                contact: 0.0,
                max_penumbra: 1.0,
                capacity: 100_000,
                ..ShadowSettings::default()
            },
            ShadowSettings {
                contact: 0.2,
                max_penumbra: 0.1,
                capacity: 100_000,
                ..ShadowSettings::default()
            },
            ShadowSettings { contact: 0.01, max_penumbra: 0.3, capacity: 20, ..ShadowSettings::default() },
        ] {
            if scene.name == "chains" && settings != ShadowSettings::default() {
                break;
            }
            add(&format!("shadows {settings:?}"), &shadow_segments(&tracer, &settings, &|_| true));
            if scene.bodies.is_empty() {
                continue;
            }
            let mut search = ShadowSearch::new(settings);
            for frame in [0, 3, 4, 5, 30] {
                add(&format!("moving shadows {settings:?}"), &search.find(&tracer.at(frame), &|_| true));
                add(&format!("moving shadows {settings:?}"), &search.work());
            }
        }
    }
    assert_same("shadows", &figures);
}

/// A scene of shapes and lights at random places, of which some touch, lie in one plane, or face away from a light; if
/// `moves`, some of them move.
fn random_scene(random: &mut Random, moves: bool) -> Scene {
    let mut motions = String::new();
    let mut moving: Vec<&str> = Vec::new();
    if moves {
        let mut number = || f64::from(random.below(17)) / 8.0 - 1.0;
        for name in ["one", "other"] {
            let keys: String = [0.0, 0.2, 0.7]
                .map(|time| {
                    let [x, y, z, turn] = [number(), number(), number(), 90.0 * number()];
                    format!("(time: {time}, translate: ({x}, {y}, {z}), rotate: (0, {turn}, {turn})),")
                })
                .concat();
            motions += &format!("\"{name}\": (keys: [{keys}]),");
        }
        let motion = |_| ["", ", motion: \"one\"", ", motion: \"other\""][random.below(3) as usize];
        moving = (0..5).map(motion).collect();
    }
    let motion = |index: usize| moving.get(index).copied().unwrap_or_default();
    // Multiples of a quarter, so that some numbers are equal.
    let mut near = |low: i32, high: i32| f64::from(low + random.below((high - low) as u32 + 1) as i32) / 4.0;
    let mut objects = String::from("(shape: Quad(corner: (-4, 0, 4), u: (8, 0, 0), v: (0, 0, -8))),");
    for index in 0..3 {
        let motion = motion(index);
        let [x, y, z] = [near(-6, 6), near(0, 4), near(-6, 6)];
        objects += &match near(0, 3) as u32 + near(0, 8) as u32 {
            0 => format!("(shape: Sphere(center: ({x}, {y}, {z}), radius: {}){motion}),", near(1, 3)),
            1 => {
                let [u, v] = [(near(-4, 4), near(1, 4)), (near(1, 4), near(-4, 4))];
                let sides = format!("u: ({}, {}, 0.5), v: (0.3, {}, {})", u.0, u.1, v.0, v.1);
                format!("(shape: Quad(corner: ({x}, {y}, {z}), {sides}){motion}),")
            }
            _ => {
                let [a, b, c] = [near(1, 6), near(1, 4), near(1, 6)];
                let turn = near(0, 3) * 100.0;
                format!(
                    "(shape: Box(low: (0, 0, 0), high: ({a}, {b}, {c})), translate: ({x}, {y}, {z}), rotate: (0, {turn}, 0){motion}),"
                )
            }
        };
    }
    let mut lights = String::new();
    for index in 3..5 {
        let motion = motion(index);
        let [x, y, z] = [near(-8, 8), near(4, 16), near(-8, 8)];
        lights += &match near(0, 7) < 1.0 {
            true => format!("Point(position: ({x}, {y}, {z}), intensity: (9, 8, 7){motion}),"),
            false => {
                let [a, b, c, d] = [near(1, 6), near(-2, 2), near(1, 6), near(-2, 2)];
                format!(
                    "Quad(corner: ({x}, {y}, {z}), u: ({a}, {b}, 0), v: (0, {d}, {c}), radiance: (5, 5, 5){motion}),"
                )
            }
        };
    }
    let camera = format!("(eye: ({}, 3, 9), target: (0, 1, 0), fov: 50)", near(-20, 20));
    let text = format!(
        "Scene(version: 1, camera: Some({camera}), motions: {{ {motions} }}, objects: [{objects}], lights: [{lights}])"
    );
    let path = std::env::temp_dir().join(format!("epigraph-random-{moves}-{}.ron", std::process::id()));
    fs::write(&path, &text).expect("a temporary folder");
    let scene = Scene::load(&path.display().to_string()).unwrap_or_else(|error| panic!("{error}: {text}"));
    fs::remove_file(&path).expect("it is there");
    scene
}

#[test]
fn shadows_and_edges_of_random_scenes_are_as_before() {
    let mut figures = Figures::new();
    let mut random = Random(9);
    for index in 0..40 {
        let scene = Arc::new(random_scene(&mut random, false));
        let tracer = Tracer::new(scene.clone());
        let figure = figures.entry(format!("scene {index}")).or_default();
        for contact in [0.0, 0.002, 0.1] {
            let settings =
                ShadowSettings { contact, max_penumbra: 0.3, capacity: 10_000, ..ShadowSettings::default() };
            figure.debug(&shadow_segments(&tracer, &settings, &|_| true));
        }
        figure.debug(&reference::edges(&tracer, &scene.camera, [40, 31]));
        let settings = TraceSettings { mode: Mode::Path, ..TraceSettings::default() };
        figure.debug(&reference::render(&tracer, &scene.camera, [12, 9], 1, &settings, 4, &|| true));
    }
    assert_same("random-scenes", &figures);
}

#[test]
fn shadows_of_random_scenes_in_motion_are_as_before() {
    let mut figures = Figures::new();
    let mut random = Random(10);
    for index in 0..40 {
        let scene = Arc::new(random_scene(&mut random, true));
        let tracer = Arc::new(Tracer::new(scene.clone()));
        let figure = figures.entry(format!("moving scene {index}")).or_default();
        for (contact, max_penumbra, capacity) in [(0.002, 0.02, 1000), (0.0, 0.3, 10_000), (0.05, 1.0, 40)] {
            let mut search = ShadowSearch::new(ShadowSettings {
                contact,
                max_penumbra,
                capacity,
                ..ShadowSettings::default()
            });
            for frame in [0, 3, 3, 9, 30] {
                let tracer = tracer.at(frame);
                let found = search.find(&tracer, &|_| true);
                figure.debug(&found);
                figure.debug(&search.work());
                // What moved is all that was searched again.
                let settings =
                    ShadowSettings { contact, max_penumbra, capacity, ..ShadowSettings::default() };
                assert_eq!(
                    found,
                    shadow_segments(&tracer, &settings, &|_| true),
                    "scene {index}, frame {frame}"
                );
            }
        }
    }
    assert_same("moving-shadows", &figures);
}

#[test]
fn cameras_and_random_numbers_are_as_before() {
    let mut figures = Figures::new();
    let scene = Scene::load("cornell").expect("a built-in scene");
    let chains = Scene::load("chains").expect("a built-in scene");
    for scene in [&scene, &chains] {
        for text in [
            "still",
            "orbit",
            "orbit:2.5",
            "orbit:3:360",
            "orbit:-7:100",
            "fly",
            "shake",
            "view:1,2,3:0,0,0,1",
            "view:0.1,-0.2,3:0.5,-0.5,0.5,0.5",
        ] {
            let path = CameraPath::parse(text, scene).expect("a camera path");
            let cameras: Vec<Camera> =
                [0, 1, 2, 7, 29, 30, 31, 100, 451, 100_000].map(|frame| path.camera(frame)).into();
            let figure = figures.entry(format!("{} {text}", scene.name)).or_default();
            figure.debug(&(path.frames(), path.moves()));
            figure.debug(&cameras);
            figure.debug(&cameras.iter().map(CameraPath::view).collect::<Vec<_>>());
            figure.debug(&keyframes(&[(0.5, cameras[0]), (1.25, cameras[3])]));
            figure
                .debug(&cameras.windows(2).map(|pair| predict(&pair[0], &pair[1], 1.5)).collect::<Vec<_>>());
        }
        for looped in [true, false] {
            let text = format!(
                "(looped: {looped}, keys: [(time: 0.5, eye: (0, 0, 3), target: (0, 0, 0)), (time: 1, eye: (1, 0, 3), \
                 target: (0, 1, 0)), (time: 2.5, eye: (0, 1, 4), target: (0, 0, -1))])"
            );
            let path = CameraPath::through(&text, Path::new("flight.ron"), scene).expect("a flight");
            let figure = figures.entry(format!("{} flight {looped}", scene.name)).or_default();
            figure.debug(&(path.frames(), path.moves()));
            (0..120).for_each(|frame| figure.debug(&path.camera(frame)));
        }
    }
    let figure = figures.entry("random numbers".into()).or_default();
    for seed in [0, 1, 77] {
        for (frame, pixel) in [(0, 0), (1, 0), (0, 1), (1000, 99_999)] {
            let key = Rng::key(frame, pixel);
            figure.debug(&key);
            for mut random in
                [Rng::new(seed, key), Rng::nth(seed, key, 0), Rng::nth(seed, key, 1), Rng::nth(seed, key, 6)]
            {
                figure.debug(&random.subpixel());
                for _ in 0..20 {
                    figure.debug(&(random.next_u32(), random.next_f32(), random.next_pair()));
                }
            }
        }
    }
    for size in [[1, 1], [40, 30], [30, 40]] {
        for [x, y] in [[0.0, 0.0], [12.5, 7.25], [30.0, 1.0]] {
            figure.debug(&scene.camera.direction(x, y, size));
        }
    }
    figure.debug(&Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 0.0, 3.0), 0.5, 0.1, 9.0));
    assert_same("cameras", &figures);
}
