use super::*;

use std::io::Write;

use glam::{Affine3A, Vec3};

use crate::{Light, Surface};

/// A folder of its own for one test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("epigraph-scenes-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        let path = self.0.join(name);
        std::fs::write(&path, content).unwrap();
        path.to_str().unwrap().to_owned()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn error(name: &str) -> String {
    Scene::load(name).unwrap_err().to_string()
}

const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

#[test]
fn an_unknown_name_gets_a_hint_and_the_list() {
    let message = error("cornel");
    assert!(message.contains("did you mean `cornell`?") && message.contains("chains"), "{message}");
    assert!(!error("zzz").contains("did you mean"));
    assert!(error("picture.png").contains(".glb"));
}

#[test]
fn a_missing_file_is_named() {
    assert!(error("no/such/file.glb").starts_with("no/such/file.glb: "));
}

#[test]
fn a_mesh_without_light_or_camera_gets_both() {
    let folder = Folder::new("plain");
    let scene = Scene::load(&folder.file("a.obj", TETRAHEDRON)).unwrap();
    assert_eq!(scene.mesh.triangles.len(), 4 + 2);
    assert!(matches!(scene.lights[..], [Light::Quad { .. }]));
}

#[test]
fn broken_meshes_are_errors() {
    let folder = Folder::new("broken");
    for (name, content, expected) in [
        ("nan.obj", TETRAHEDRON.replace("v 1 0 0", "v 1 nan 0"), "line 2"),
        ("empty.obj", String::new(), "no triangles"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n".to_owned(), "no triangles"),
        ("flat.obj", "v 0 0 0\nv 0 0 0\nv 1 0 0\nf 1 2 3\n".to_owned(), "no triangles"),
        ("library.obj", format!("mtllib none.mtl\n{TETRAHEDRON}"), "none.mtl"),
        ("empty.ply", String::new(), "magic"),
        ("empty.glb", String::new(), "EOF"),
        ("text.glb", "glTF is nice".to_owned(), "truncated"),
        ("empty.gltf", r#"{"asset": {"version": "2.0"}}"#.to_owned(), "no triangles"),
        ("broken.gltf", r#"{"asset": {"#.to_owned(), "EOF"),
        ("broken.ply.gz", "\u{1f}\u{8b}".to_owned(), "magic"),
        ("wrong.ron", "Scene(version: 1, objects: [), lights: [])".to_owned(), "line 1, column"),
    ] {
        let message = error(&folder.file(name, content));
        assert!(message.contains(expected) && message.contains(name), "{name}: {message}");
    }
    let message = error(&folder.file("cut.ply.gz", [0x1f, 0x8b, 8, 0, 0]));
    assert!(message.contains("unpacked"), "{message}");
    let nan = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n";
    let message = error(&folder.file("nan.ply", nan));
    assert!(message.contains("1 nan 0"), "{message}");
    let mut binary = nan.split("0 0 0").next().unwrap().replace("ascii", "binary_big_endian").into_bytes();
    for value in [0.0, 0.0, 0.0, 1.0, f32::NAN, 0.0, 0.0, 1.0, 0.0] {
        binary.extend(value.to_be_bytes());
    }
    binary.push(3);
    binary.extend([0, 1, 2_i32].iter().flat_map(|i| i.to_be_bytes()));
    let message = error(&folder.file("nan-binary.ply", binary));
    assert!(message.contains("vertex 1 is not finite: (1, NaN, 0)"), "{message}");
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed.write_all(bytes).unwrap();
    packed.finish().unwrap()
}

#[test]
fn compressed_data_has_a_limit() {
    let bytes: Vec<u8> = (0..=255).cycle().take(1000).collect();
    // A file may consist of several compressed parts.
    let parts = [gzip(&bytes[..300]), gzip(&bytes[300..])].concat();
    for packed in [gzip(&bytes), parts] {
        assert_eq!(unpack(packed.clone(), 1000).unwrap(), bytes);
        assert_eq!(unpack(packed.clone(), u64::MAX - 1).unwrap(), bytes);
        assert_eq!(unpack(packed.clone(), 999).unwrap_err(), "it unpacks to more than 999 bytes");
        assert!(unpack(packed, 0).is_err());
    }
    // What is not compressed takes no more memory than its file.
    assert_eq!(unpack(bytes.clone(), 10).unwrap(), bytes);
}

#[test]
fn a_compressed_mesh_is_the_mesh() {
    let folder = Folder::new("gzip");
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 2 0\n3 0 1 2\n";
    let [plain, packed] = [("a.ply", ply.as_bytes().to_vec()), ("b.PLY.GZ", gzip(ply.as_bytes()))]
        .map(|(name, bytes)| Scene::load(&folder.file(name, bytes)).unwrap());
    assert_eq!(plain.mesh.corners(0), [Vec3::ZERO, Vec3::X, 2.0 * Vec3::Y]);
    assert_eq!(plain.mesh.positions, packed.mesh.positions);
}

const SCENE: &str = r#"Scene(
    version: 1,
    camera: (eye: (0, 1, 4), target: (0, 0.5, 0), fov: 35),
    background: (0.1, 0.2, 0.3),
    motions: {
        "rise": (keys: [(time: 0), (time: 2, translate: (0, 1, 0), rotate: (0, 90, 0))], pivot: (0, 0, 1)),
    },
    materials: {
        "clay": (color: (0.7, 0.4, 0.3)),
        "panel": (color: (0, 0, 0), emission: (5, 5, 5)),
        "metal": (color: (0.2, 0.2, 0.2), surface: Glossy(roughness: 0.3, f0: 0.4)),
    },
    objects: [
        (shape: File("a.obj"), material: "metal", height: 2, translate: (1, 0.5, 0), smooth: 100),
        (shape: Box(low: (0, 0, 0), high: (1, 1, 1)), material: "clay", repeat: (count: 3, step: (0, 0, 2))),
        (shape: Quad(corner: (0, 3, 0), u: (1, 0, 0), v: (0, 0, 1)), material: "panel"),
    ],
    lights: [Point(position: (0, 5, 0), intensity: (1, 1, 1))],
)"#;

#[test]
fn a_scene_file_places_shapes_and_lights() {
    let folder = Folder::new("scene");
    folder.file("a.obj", TETRAHEDRON);
    let scene = Scene::load(&folder.file("scene.ron", SCENE)).unwrap();
    assert_eq!(scene.mesh.triangles.len(), 4 + 3 * 12 + 2);
    // The tetrahedron of height 1 is scaled to 2 and stands centred on (1, 0.5, 0).
    let corners: Vec<Vec3> = (0..4).flat_map(|face| scene.mesh.corners(face)).collect();
    let [low, high] = crate::mesh::bounds_of(&corners);
    assert_eq!((low, high), (Vec3::new(0.0, 0.5, -1.0), Vec3::new(2.0, 2.5, 1.0)));
    assert_eq!(scene.bounds[1].z, 5.0);
    assert_eq!(scene.lights.len(), 2, "the panel is a light too");
    assert_eq!(scene.background, Vec3::new(0.1, 0.2, 0.3));
    let metal = &scene.materials[scene.mesh.material[0] as usize];
    assert_eq!((metal.name.as_str(), metal.surface), ("metal", Surface::Glossy { roughness: 0.3, f0: 0.4 }));
}

/// The scene of one object, and more members of the file.
fn scene_of(folder: &Folder, object: &str, members: &str) -> Scene {
    let light = "lights: [Point(position: (0, 9, 0), intensity: (1, 1, 1))]";
    let text = format!("Scene(version: 1, objects: [({object})], {light}, {members})");
    Scene::load(&folder.file("scene.ron", text)).unwrap()
}

#[test]
fn shapes_of_a_scene_file_fill_their_boxes() {
    let folder = Folder::new("shapes");
    let boxed = "shape: Box(low: (0, 0, 0), high: (1, 2, 3))";
    for (object, low, high) in [
        ("shape: Box(low: (1, -2, 3), high: (-1, 2, 4))", [-1.0, -2.0, 3.0], [1.0, 2.0, 4.0]),
        ("shape: Quad(corner: (1, 2, 3), u: (2, 0, 0), v: (0, 0, -1))", [1.0, 2.0, 2.0], [3.0, 2.0, 3.0]),
        ("shape: Sphere(center: (1, 2, 3), radius: 0.5)", [0.5, 1.5, 2.5], [1.5, 2.5, 3.5]),
        ("shape: Cylinder(base: (1, 2, 3), radius: 0.5, height: 4)", [0.5, 2.0, 2.5], [1.5, 6.0, 3.5]),
        (&format!("{boxed}, scale: 2, translate: (1, 0, 0)"), [1.0, 0.0, 0.0], [3.0, 4.0, 6.0]),
        (&format!("{boxed}, height: 1, translate: (1, 0, 0)"), [0.75, 0.0, -0.75], [1.25, 1.0, 0.75]),
        (&format!("{boxed}, repeat: (count: 3, step: (0, 0, 5))"), [0.0, 0.0, 0.0], [1.0, 2.0, 13.0]),
        // About z, then x, then y.
        (&format!("{boxed}, rotate: (90, 0, 90)"), [-2.0, -3.0, 0.0], [0.0, 0.0, 1.0]),
        (&format!("{boxed}, rotate: (90, 90, 90)"), [0.0, -3.0, 0.0], [1.0, 0.0, 2.0]),
    ] {
        let [found_low, found_high] = scene_of(&folder, object, "").bounds;
        let near = found_low.distance(low.into()) < 1e-5 && found_high.distance(high.into()) < 1e-5;
        assert!(near, "{object}: {found_low} to {found_high}");
    }
}

#[test]
fn members_of_a_scene_file_shape_the_scene() {
    let folder = Folder::new("members");
    let boxed = "shape: Box(low: (0, 0, 0), high: (1, 1, 1))";
    let creases = |members| crate::SceneFacts::of(&scene_of(&folder, boxed, members)).crease_edges;
    assert_eq!([creases(""), creases("crease_angle: 89"), creases("crease_angle: 91")], [12, 12, 0]);
    // Copies 0.05 apart: at 0.04, each keeps its 8 vertices.
    let copies = format!("{boxed}, repeat: (count: 2, step: (1.05, 0, 0))");
    let vertices = |members| scene_of(&folder, &copies, members).mesh.positions.len();
    assert_eq!(
        [vertices(""), vertices("weld_distance: 0.04"), vertices("weld_distance: 0.06")],
        [16, 16, 12]
    );
    // The corner farthest from the eye is (1, 1, 4) away.
    let camera = scene_of(&folder, boxed, "camera: (eye: (0, 0, 4), target: (0, 0, 0), fov: 90)").camera;
    assert!(
        (camera.far - 2.0 * 18f32.sqrt()).abs() < 1e-5 && (camera.near - 1e-3 * 18f32.sqrt()).abs() < 1e-6
    );
    // Only shapes without normals are smoothed, and only if the file says so.
    assert!(scene_of(&folder, boxed, "").mesh.corner_normals.is_empty());
    let smooth = scene_of(&folder, &format!("{boxed}, smooth: 100"), "").mesh;
    assert!(smooth.corner_normals[0][0].distance(smooth.face_normals[0]) > 0.1);
    // A ball has normals of its own. At the corners of its facets, flat normals are up to 0.07 off.
    let ball = scene_of(&folder, "shape: Sphere(center: (0, 0, 0), radius: 1)", "").mesh;
    for (face, normals) in ball.corner_normals.iter().enumerate() {
        assert!(
            normals.iter().zip(ball.corners(face)).all(|(normal, corner)| normal.distance(corner) < 0.04)
        );
    }
}

#[test]
fn objects_and_lights_of_a_scene_file_move() {
    let folder = Folder::new("motion");
    folder.file("a.obj", TETRAHEDRON);
    let text = SCENE
        .replace("repeat: (count", "motion: \"rise\", repeat: (count")
        .replace("intensity: (1, 1, 1)", "intensity: (1, 1, 1), motion: \"rise\"");
    let scene = Scene::load(&folder.file("scene.ron", text)).unwrap();
    assert_eq!(scene.bodies.len(), 2);
    assert_eq!((scene.bodies[0].faces.clone(), scene.bodies[1].faces.len()), (4..4 + 3 * 12, 0));
    // Half a second, an eighth of the way: the shape of the three boxes, and the light, rise and turn as one.
    let posed = scene.posed(&scene.poses_at(15));
    let before = &scene.mesh.positions[scene.bodies[0].vertices.clone()];
    let after = &posed.mesh.positions[scene.bodies[0].vertices.clone()];
    let turn = Affine3A::from_rotation_y(22.5_f32.to_radians());
    let moved = |p: Vec3| turn.transform_point3(p - Vec3::Z) + Vec3::new(0.0, 0.25, 1.0);
    assert!(before.iter().zip(after).all(|(&before, after)| moved(before).distance(*after) < 1e-5));
    let lights = [&scene, &posed].map(|scene| match scene.lights[scene.bodies[1].lights.start] {
        Light::Point { position, .. } => position,
        Light::Quad { .. } => panic!("a point light"),
    });
    assert!(moved(lights[0]).distance(lights[1]) < 1e-5);
    assert!(posed.mesh.positions[..4] == scene.mesh.positions[..4], "the tetrahedron stands still");
}

#[test]
fn errors_in_a_scene_file_say_where() {
    let folder = Folder::new("scene-errors");
    folder.file("a.obj", TETRAHEDRON);
    for (from, to, expected) in [
        ("fov: 35", "fow: 35", "line 3, column"),
        ("fov: 35", "fov: 180", "fov between 0 and 180"),
        ("version: 1", "version: 2", "version 2"),
        ("material: \"clay\"", "material: \"clai\"", "did you mean `clay`?"),
        ("a.obj", "b.obj", "`b.obj` does not exist"),
        ("0.7, 0.4, 0.3", "0.7, 1.4, 0.3", "material `clay`"),
        ("height: 2", "height: 0", "object 0"),
        ("height: 2", "height: 2, scale: 3", "object 0: `height` sets its scale; drop `scale` or `height`"),
        (
            "shape: Box(low: (0, 0, 0), high: (1, 1, 1))",
            "smooth: 30, shape: Sphere(center: (0, 0, 0), radius: 1)",
            "object 1: `smooth` is for shapes without normals",
        ),
        ("count: 3", "count: 4000000000", "repeat.count"),
        ("Glossy(roughness: 0.3", "Glossy(roughness: 0", "material `metal`"),
        ("(0, 5, 0), int", "(0, inf, 0), int", "light 0"),
        ("time: 2", "time: 0", "motion `rise`: the time of key 1 is not after that of key 0"),
        ("(0, 90, 0)", "(0, inf, 0)", "motion `rise`: all numbers must be finite"),
        ("[(time: 0), (time: 2, translate: (0, 1, 0), rotate: (0, 90, 0))]", "[]", "`keys` is empty"),
        ("smooth: 100", "motion: \"raise\"", "object 0: unknown motion `raise`, did you mean `rise`?"),
        ("intensity: (1, 1, 1)", "intensity: (1, 1, 1), motion: \"x\"", "light 0: unknown motion `x`"),
        ("high: (1, 1, 1)", "high: (1, 1, NaN)", "not finite"),
    ] {
        let text = SCENE.replacen(from, to, 1);
        assert_ne!(text, SCENE, "{from}");
        let message = error(&folder.file("scene.ron", text));
        assert!(message.contains(expected), "{from} -> {to}: {message}");
    }
}

#[test]
fn a_scene_file_can_take_a_builtin() {
    let folder = Folder::new("builtin");
    let text = r#"Scene(version: 1, objects: [(shape: Builtin("cornell"), scale: 2)])"#;
    let scene = Scene::load(&folder.file("big.ron", text)).unwrap();
    let original = Scene::load("cornell").unwrap();
    assert_eq!(crate::SceneFacts::of(&scene), crate::SceneFacts::of(&original));
    assert_eq!(scene.bounds[1], 2.0 * original.bounds[1]);
    let ([Light::Quad { u, .. }], [Light::Quad { u: original, .. }]) =
        (&scene.lights[..], &original.lights[..])
    else {
        panic!("{:?}", scene.lights)
    };
    assert!((u.length() - 2.0 * original.length()).abs() < 0.3);
}

#[test]
fn a_mesh_that_was_not_fetched_names_the_command() {
    let text = r#"Scene(version: 1, objects: [(shape: File("data/dragon.ply.gz"))])"#;
    let folder = Folder::new("not-fetched");
    let file = SceneFile::parse(text).unwrap();
    let error = file
        .into_scene("dragon", Path::new("dragon.ron"), std::slice::from_ref(&folder.0), Some("dragon"))
        .unwrap_err();
    assert!(error.to_string().contains("run `scenes/fetch dragon`"), "{error}");
}
