use super::*;

use std::io::Write;
use std::sync::Arc;
use std::time::Instant;

use glam::{Affine3A, Vec3};

use crate::Light;

/// A folder of its own for one test, removed at its end.
pub(super) struct Folder(PathBuf);

impl Folder {
    pub fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("epigraph-scenes-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
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
        ("nan.obj", "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n".to_owned(), "line 2, `1 nan 0`"),
        ("empty.obj", String::new(), "it is empty"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n".to_owned(), "no faces"),
        ("flat.obj", "v 0 0 0\nv 0 0 0\nv 1 0 0\nf 1 2 3\n".to_owned(), "no triangles"),
        ("empty.ply", String::new(), "it is empty"),
        ("empty.glb", String::new(), "it is empty"),
        ("text.glb", "glTF is nice".to_owned(), "truncated"),
        ("empty.gltf", r#"{"asset": {"version": "2.0"}}"#.to_owned(), "no triangles"),
        ("broken.gltf", r#"{"asset": {"#.to_owned(), "EOF"),
        ("broken.ply.gz", "\u{1f}\u{8b}".to_owned(), "the word `ply`"),
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
    assert!(message.contains("vertex 1, (1, NaN, 0)"), "{message}");
    let mut binary = nan.split("0 0 0").next().unwrap().replace("ascii", "binary_big_endian").into_bytes();
    for value in [0.0, 0.0, 0.0, 1.0, f32::NAN, 0.0, 0.0, 1.0, 0.0] {
        binary.extend(value.to_be_bytes());
    }
    binary.push(3);
    binary.extend([0, 1, 2_i32].iter().flat_map(|i| i.to_be_bytes()));
    let message = error(&folder.file("nan-binary.ply", binary));
    assert!(message.contains("vertex 1, (1, NaN, 0)"), "{message}");
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

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
     element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 2 0\n3 0 1 2\n";

#[test]
fn a_compressed_mesh_is_the_mesh() {
    let folder = Folder::new("gzip");
    let [plain, packed] = [("a.ply", PLY.as_bytes().to_vec()), ("b.PLY.GZ", gzip(PLY.as_bytes()))]
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
    assert_eq!((metal.name.as_str(), metal.roughness, metal.f0), ("metal", 0.3, 0.4));
}

const LIGHT: &str = "lights: [Point(position: (0, 9, 0), intensity: (1, 1, 1))]";

/// The scene of one object, and more members of the file.
fn scene_of(folder: &Folder, object: &str, members: &str) -> Scene {
    let text = format!("Scene(version: 1, objects: [({object})], {LIGHT}, {members})");
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
    // Or (2, 3, 6), on either side of the eye.
    for (z, target) in [(7, 0), (-5, 9)] {
        let camera = format!("camera: (eye: (-1, -2, {z}), target: (0, 0, {target}), fov: 90)");
        let camera = scene_of(&folder, "shape: Box(low: (0, 0, 1), high: (1, 1, 1))", &camera).camera;
        assert!((camera.far - 14.0).abs() < 1e-5 && (camera.near - 7e-3).abs() < 1e-6, "{camera:?}");
    }
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
fn numbers_of_a_scene_file_are_taken_up_to_the_ends_of_their_ranges() {
    let boxed = "shape: Box(low: (0, 0, 0), high: (1, 1, 1))";
    let refused = |object: &str, members: &str| {
        let text = format!("Scene(version: 1, objects: [({boxed}, {object})], {members})");
        SceneFile::parse(&text).err()
    };
    let fov = |degrees: &str| format!("camera: (eye: (0, 0, 4), target: (0, 0, 0), fov: {degrees})");
    let crease = |degrees: &str| format!("crease_angle: {degrees}");
    let weld = |metres: &str| format!("weld_distance: {metres}");
    for (members, numbers, expected) in [
        (&fov as &dyn Fn(&str) -> String, ["0.5", "179.5"].as_slice(), None),
        (&fov, &["0", "-0.5", "180", "180.5", "NaN"], Some("a fov between 0 and 180")),
        (&crease, &["0", "0.5", "180"], None),
        (&crease, &["-0.5", "180.5", "NaN"], Some("crease_angle must be between 0 and 180")),
        (&weld, &["0", "0.5", "2"], None),
        (&weld, &["-0.5", "inf", "NaN"], Some("weld_distance must not be negative")),
    ] {
        for number in numbers {
            let message = refused("", &members(number));
            let fits = message.as_ref().map(|text| expected.is_some_and(|expected| text.contains(expected)));
            assert_eq!(fits, expected.map(|_| true), "{}: {message:?}", members(number));
        }
    }
    for (member, numbers, is_fine) in [
        ("smooth", ["0", "0.5", "180"].as_slice(), true),
        ("smooth", &["-0.5", "180.5", "NaN"], false),
        ("scale", &["0.5", "-0.5"], true),
        ("scale", &["0", "inf", "NaN"], false),
        ("height", &["0.5", "-0.5"], true),
        ("height", &["0", "inf", "NaN"], false),
    ] {
        for number in numbers {
            let message = refused(&format!("{member}: {number}"), "");
            let expected = "object 0: scale and height must not be 0, and smooth must be between 0 and 180";
            assert_eq!(message, (!is_fine).then(|| expected.to_owned()), "{member}: {number}");
        }
    }
}

#[test]
fn faces_are_smoothed_across_the_smallest_angles() {
    let folder = Folder::new("ridge");
    // Two sides of a roof that is nearly flat: they meet at 0.4 degrees.
    let height = 0.2_f64.to_radians().tan();
    let ridge = format!(
        "v -1 0 -1\nv -1 0 1\nv 0 {height} -1\nv 0 {height} 1\nv 1 0 -1\nv 1 0 1\nf 1 2 4 3\nf 3 4 6 5\n"
    );
    folder.file("a.obj", ridge);
    let bend_at_ridge = |smooth: &str| {
        let mesh = scene_of(&folder, &format!("shape: File(\"a.obj\"), smooth: {smooth}"), "").mesh;
        let at = mesh.corners(0).iter().position(|corner| corner.x == 0.0).unwrap();
        mesh.corner_normals[0][at].distance(mesh.face_normals[0])
    };
    assert!(bend_at_ridge("0.5") > 1e-3 && bend_at_ridge("0.3") < 1e-6);
    let ball = "shape: Sphere(center: (0, 0, 0), radius: 1), smooth: 0.5";
    let message = error(&folder.file("s.ron", format!("Scene(version: 1, objects: [({ball})])")));
    assert!(message.contains("object 0: `smooth` is for shapes without normals"), "{message}");
}

#[test]
fn a_scene_file_reports_what_is_left_out_of_its_models() {
    let folder = Folder::new("left-out");
    folder.file("a.mtl", "newmtl m\nmap_Kd none.png\n");
    folder.file("a.obj", format!("mtllib a.mtl\nusemtl m\n{TETRAHEDRON}"));
    let report = scene_of(&folder, r#"shape: File("a.obj")"#, "").report;
    let notes: Vec<_> = report.notes().iter().map(ToString::to_string).collect();
    assert_eq!(notes, ["left out: a texture that is missing (none.png)"]);
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
        _ => panic!("a point light"),
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
        ("high: (1, 1, 1)", "high: (1, 1, NaN)", "object 1: a Box needs"),
        ("eye: (0, 1, 4)", "eye: (0, 1, 2e9)", "the camera needs an eye"),
        ("eye: (0, 1, 4)", "eye: (0, NaN, 4)", "the camera needs an eye"),
        ("target: (0, 0.5, 0)", "target: (0, -2e9, 0)", "the camera needs an eye"),
        ("0.1, 0.2, 0.3", "0.1, 1e20, 0.3", "background: each channel must be a number of at most 1e18"),
        ("emission: (5, 5, 5)", "emission: (5, 1e20, 5)", "material `panel`"),
        (
            "translate: (0, 1, 0)",
            "translate: (0, 3e38, 0)",
            "motion `rise`: all numbers must be finite, coordinates",
        ),
        ("pivot: (0, 0, 1)", "pivot: (0, 0, 2e9)", "motion `rise`"),
        ("time: 2", "time: 2e9", "motion `rise`"),
        ("high: (1, 1, 1)", "high: (1, 1, 2e9)", "object 1: a Box needs"),
        ("translate: (1, 0.5, 0)", "translate: (1, 3e38, 0)", "object 0: all numbers must be finite"),
        ("step: (0, 0, 2)", "step: (0, 0, 1e9)", "object 1: all numbers must be finite"),
        ("height: 2", "height: 1e10", "object 0: vertex"),
        ("height: 2", "rotate: (0, inf, 0)", "object 0: all numbers must be finite"),
        ("height: 2", "scale: 1e30", "object 0: vertex 1 is at (1, 1000000000000000000000000000000, 0)"),
        ("(0, 5, 0), int", "(0, 2e9, 0), int", "light 0"),
        ("intensity: (1, 1, 1)", "intensity: (1, 1e31, 1)", "light 0"),
    ] {
        let text = SCENE.replacen(from, to, 1);
        assert_ne!(text, SCENE, "{from}");
        let message = error(&folder.file("scene.ron", text));
        assert!(message.contains(expected), "{from} -> {to}: {message}");
    }
}

#[test]
fn shapes_without_size_are_refused_at_once() {
    let folder = Folder::new("no-size");
    let bad = ["NaN", "inf", "-inf", "0", "-1", "2e9"];
    let all = |form: &str| bad.map(|number| form.replace('#', number));
    let sphere = all("Sphere(center: (0, 0, 0), radius: #)");
    let radius = all("Cylinder(base: (0, 0, 0), radius: #, height: 1)");
    let height = all("Cylinder(base: (0, 0, 0), radius: 1, height: #)");
    // Of corners, zero and negative numbers are as good as others.
    let finite = |form: &str| ["NaN", "inf", "-2e9"].map(|number| form.replace('#', number));
    let centers = finite("Sphere(center: (0, #, 0), radius: 1)");
    let bases = finite("Cylinder(base: (#, 0, 0), radius: 1, height: 1)");
    let low = finite("Box(low: (#, 0, 0), high: (1, 1, 1))");
    let corner = finite("Quad(corner: (0, 0, #), u: (1, 0, 0), v: (0, 1, 0))");
    let side = finite("Quad(corner: (0, 0, 0), u: (#, 0, 0), v: (0, 1, 0))");
    let flat = [
        "Box(low: (1, 0, 0), high: (1, 0, 5))".to_owned(),
        "Quad(corner: (0, 0, 0), u: (1, 0, 0), v: (3, 0, 0))".to_owned(),
    ];
    let shapes = [&sphere[..], &radius, &height, &centers, &bases, &low, &corner, &side, &flat].concat();
    for shape in shapes {
        let kind = shape.split('(').next().unwrap();
        let text = format!("Scene(version: 1, objects: [(shape: {shape})])");
        let message = error(&folder.file("scene.ron", text));
        assert!(message.contains(&format!("object 0: a {kind} needs ")), "{shape}: {message}");
    }
    let sheet = "shape: Quad(corner: (0, 0, 0), u: (0, 0, 1), v: (1, 0, 0)), height: 2";
    let message = error(&folder.file("scene.ron", format!("Scene(version: 1, objects: [({sheet})])")));
    assert!(message.contains("object 0: `height` scales an object to this height, but this one is flat"));
    let sheet = "shape: Box(low: (0, 0, 0), high: (1, 0, 1))";
    assert_eq!(scene_of(&folder, sheet, "").bounds[1], Vec3::new(1.0, 0.0, 1.0));
}

#[test]
fn numbers_at_the_limit_are_traced_and_numbers_beyond_it_refused() {
    let folder = Folder::new("far");
    let motion = |far: &str| {
        format!(
            "Scene(version: 1, motions: {{ \"far\": (keys: [(time: 0), (time: 1, translate: (-{far}, {far}, 0), \
             rotate: (0, 90, 0))]) }}, objects: [(shape: Sphere(center: (0, 0, 0), radius: {far}), motion: \"far\")], \
             camera: (eye: (0, 0, {far}), target: (0, 0, 0), fov: 40), {LIGHT})"
        )
    };
    for far in ["1e21", "1.1e9"] {
        assert!(Scene::load(&folder.file("far.ron", motion(far))).is_err(), "{far}");
    }
    let scene = Arc::new(Scene::load(&folder.file("far.ron", motion("1e9"))).unwrap());
    let tracer = crate::Tracer::new(Arc::new(scene.posed(&scene.poses_at(15))));
    let mut random = crate::Rng::new(0, 1);
    let camera = scene.camera;
    let direction = camera.direction(32.0, 32.0, [64, 64]);
    let hit = tracer.trace(camera.eye, direction, &crate::TraceSettings::default(), &mut random);
    assert!(hit.radiance.is_finite());

    let unlit = motion("1e9").replace(LIGHT, "");
    let message = error(&folder.file("far.ron", unlit));
    assert!(message.contains("too large for the light that is added where there is none"), "{message}");

    let far_obj = TETRAHEDRON.replace("v 0 1 0", "v 0 2e9 0");
    let far_ply = PLY.replace("1 0 0", "1 2e9 0");
    for (name, content, expected) in [
        ("far.obj", far_obj, "line 3: the vertex `0 2e9 0` is farther out than 1e9 m"),
        ("far.ply", far_ply, "vertex 1 is at (1, 2000000000, 0), farther out than 1e9 m"),
    ] {
        let message = error(&folder.file(name, content));
        assert!(message.contains(expected) && message.contains(name), "{message}");
    }
}

#[test]
fn what_a_file_promises_is_refused_before_it_is_made() {
    let folder = Folder::new("promises");
    let copies = |shape: &str, count: u32| {
        let object = format!("(shape: {shape}, repeat: (count: {count}, step: (1, 0, 0)))");
        let start = Instant::now();
        let message = error(&folder.file("copies.ron", format!("Scene(version: 1, objects: [{object}])")));
        assert!(start.elapsed().as_secs_f64() < 1.0);
        message
    };
    let sphere = copies("Sphere(center: (0, 0, 0), radius: 1)", 100_000);
    let text = "object 0: that makes 396800000 triangles and 214500000 vertices, but a scene may have at most 5000000";
    assert!(sphere.contains(text), "{sphere}");
    // What several objects make together counts too.
    let several = (0..1000)
        .map(|_| "(shape: Box(low: (0, 0, 0), high: (1, 1, 1)), repeat: (count: 100000, step: (0, 0, 0)))");
    let text = format!("Scene(version: 1, objects: [{}])", several.collect::<Vec<_>>().join(","));
    let message = error(&folder.file("several.ron", text));
    assert!(message.contains("object 4: that makes 6000000 triangles"), "{message}");

    for (element, promise) in [("vertex 3", "vertex 300000000"), ("face 1", "face 5000001")] {
        let ply = PLY.replace(element, promise);
        let number = promise.split(' ').nth(1).unwrap();
        // Packed, the promise is found without unpacking: what follows is not even gzip.
        let mut packed = gzip(ply.as_bytes());
        packed.extend(gzip(&[b' '; 100_000]).into_iter().take(20));
        for path in [folder.file("a.ply", ply), folder.file("a.ply.gz", packed)] {
            let message = error(&path);
            let expected = "the header declares too much: that makes ";
            assert!(message.contains(expected) && message.contains(number), "{message}");
        }
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
fn names_that_are_as_good_as_wrong_get_no_hint() {
    // Three of four and of six letters are alike, in their order: 1/3 (3/4 + 3/6 + 1) is 0.75. One more is above it.
    assert_eq!(nearest("xabcyz", ["abcd"].into_iter()), "");
    assert_eq!(nearest("xabcy", ["abcd"].into_iter()), ", did you mean `abcd`?");
}

#[test]
fn a_mesh_that_was_not_fetched_names_the_command() {
    let text = r#"Scene(version: 1, objects: [(shape: File("data/dragon.ply.gz"))])"#;
    let folder = Folder::new("not-fetched");
    let file = SceneFile::parse(text).unwrap();
    let error = file
        .into_scene(
            "dragon",
            Path::new("dragon.ron"),
            std::slice::from_ref(&folder.0),
            Some("dragon"),
            &LoadOptions::default(),
        )
        .unwrap_err();
    assert!(error.to_string().contains("run `scenes/fetch dragon`"), "{error}");
}

/// A file of the tetrahedron with these members.
fn tetrahedron_with(folder: &Folder, members: &str) -> String {
    folder.file("a.obj", TETRAHEDRON);
    folder.file("s.ron", format!(r#"Scene(version: 1, objects: [(shape: File("a.obj"))], {members})"#))
}

#[test]
fn a_scene_file_has_spots() {
    let folder = Folder::new("spots");
    let spot = |members: &str| {
        tetrahedron_with(
            &folder,
            &format!(
                "lights: [Spot(position: (1, 4, 2), target: (1, 0, 2), intensity: (3, 2, 1), {members})]"
            ),
        )
    };
    let cone = |members: &str| match Scene::load(&spot(members)).unwrap().lights[..] {
        [Light::Spot { position, axis, intensity, cosines }] => {
            assert_eq!((position, axis), (Vec3::new(1.0, 4.0, 2.0), Vec3::NEG_Y));
            assert_eq!(intensity, Vec3::new(3.0, 2.0, 1.0));
            cosines
        }
        ref others => panic!("{others:?}"),
    };
    let near = |found: [f32; 2], expected: [f32; 2]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
    };
    near(cone(""), [1.0, 0.5_f32.sqrt()]);
    near(cone("inner: 30, outer: 60"), [0.75_f32.sqrt(), 0.5]);
    // Both ends of what angles may be, and cones without a soft border.
    for angle in [0.0_f32, 45.0, 180.0] {
        near(cone(&format!("inner: {angle}, outer: {angle}")), [angle.to_radians().cos(); 2]);
    }
    for wrong in ["inner: 50", "inner: -1", "outer: 181", "outer: NaN"] {
        assert!(error(&spot(wrong)).contains("light 0: all numbers must be finite"), "{wrong}");
    }
    let aimless = tetrahedron_with(
        &folder,
        "lights: [Spot(position: (1, 4, 2), target: (1, 4, 2), intensity: (1, 1, 1))]",
    );
    assert!(error(&aimless).contains("a spot a target"));
}

#[test]
fn a_scene_file_has_a_sky_unless_another_is_given() {
    let folder = Folder::new("sky");
    let mut png = std::io::Cursor::new(Vec::new());
    let image = image::RgbImage::from_fn(2, 1, |x, _| image::Rgb([if x == 0 { 188 } else { 255 }; 3]));
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    folder.file("sky.png", png.into_inner());
    let path = tetrahedron_with(&folder, r#"sky: Some("sky.png")"#);
    let scene = Scene::load(&path).unwrap();
    // 188 is the code of about half the light. The sky lights the scene, so that nothing is added.
    let left = scene.beyond(Vec3::NEG_X).x;
    assert!((left - 0.502_886).abs() < 1e-5 && scene.beyond(Vec3::X).x == 1.0, "{left}");
    assert!(scene.lights.is_empty() && scene.report.is_empty(), "{:?}", scene.report);
    let given = Some(Arc::new(Sky::new("", [1, 1], vec![Vec3::splat(7.0)]).unwrap()));
    let options = LoadOptions { sky: given, ..LoadOptions::default() };
    assert_eq!(Scene::load_with(&path, &options).unwrap().beyond(Vec3::X).x, 7.0);
    let missing = error(&tetrahedron_with(&folder, r#"sky: Some("none.hdr")"#));
    assert!(missing.contains("`none.hdr` does not exist (looked for "), "{missing}");
}

#[test]
fn single_sided_materials_of_gltf_files_have_culled_backs_if_wanted() {
    let folder = Folder::new("sides");
    // The last triangle has no material.
    let triangle =
        |material: &str| format!(r#"{{"primitives": [{{"attributes": {{"POSITION": 0}}{material}}}]}}"#);
    let materials = [r#", "material": 0"#, r#", "material": 1"#, r#", "material": 2"#, ""];
    let meshes = materials.map(triangle).join(", ");
    let file = format!(
        r#"{{"asset": {{"version": "2.0"}}, "meshes": [{meshes}],
        "nodes": [{{"mesh": 0}}, {{"mesh": 1}}, {{"mesh": 2}}, {{"mesh": 3}}],
        "materials": [{{"name": "one"}}, {{"name": "two", "doubleSided": true}}, {{"name": "glass",
            "extensions": {{"KHR_materials_transmission": {{"transmissionFactor": 1}}}}}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
        "buffers": [{{"byteLength": 36, "uri":
            "data:;base64,AACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAA"}}]}}"#
    );
    let path = folder.file("a.gltf", file);
    let scene_file = r#"Scene(version: 1, objects: [(shape: File("a.gltf"))])"#;
    for path in [path, folder.file("a.ron", scene_file)] {
        let culled = |single_sided: bool| {
            let options = LoadOptions { single_sided, ..LoadOptions::default() };
            let scene = Scene::load_with(&path, &options).unwrap();
            [0, 1, 2, 3].map(|index| scene.materials[index].culled)
        };
        assert_eq!((culled(false), culled(true)), ([false; 4], [true, false, false, true]), "{path}");
    }
}
