//! Files as people have them, beside the same scene as a plain file: a floor, a box and a ball.

use glam::{DVec3, Vec3};

use super::tests::Folder;
use crate::{Alpha, Light, NoteKind, Scene};

/// The corners of the box, and its sides.
const BOX: [[f32; 3]; 8] = [
    [-0.7, 0.0, 0.7],
    [0.7, 0.0, 0.7],
    [0.7, 1.4, 0.7],
    [-0.7, 1.4, 0.7],
    [-0.7, 0.0, -0.7],
    [0.7, 0.0, -0.7],
    [0.7, 1.4, -0.7],
    [-0.7, 1.4, -0.7],
];
const SIDES: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [5, 4, 7, 6], [1, 5, 6, 2], [4, 0, 3, 7], [3, 2, 6, 7], [4, 5, 1, 0]];
const FLOOR: [[f32; 3]; 4] = [[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]];

/// A ball of eight triangles beside the box: its vertices and faces.
const BALL: [[f32; 3]; 6] = [
    [1.5, 0.25, 1.0],
    [1.0, 0.25, 1.0],
    [1.25, 0.5, 1.0],
    [1.25, 0.0, 1.0],
    [1.25, 0.25, 1.25],
    [1.25, 0.25, 0.75],
];
const FACETS: [[usize; 3]; 8] =
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];

const NAMES: [&str; 3] = ["floor", "red", "blue"];
const MATERIALS: &str =
    "newmtl floor\nKd 0.6 0.6 0.6\nnewmtl red\nKd 0.8 0.1 0.1\nnewmtl blue\nKd 0.1 0.2 0.8\n";

/// The vertices of one of the three, and its faces.
struct Thing {
    vertices: Vec<[f32; 3]>,
    faces: Vec<Vec<usize>>,
}

fn things() -> [Thing; 3] {
    [
        Thing { vertices: FLOOR.to_vec(), faces: vec![vec![0, 1, 2, 3]] },
        Thing { vertices: BOX.to_vec(), faces: SIDES.iter().map(|side| side.to_vec()).collect() },
        Thing { vertices: BALL.to_vec(), faces: FACETS.iter().map(|facet| facet.to_vec()).collect() },
    ]
}

/// The scene as OBJ. `vertex` makes the line of a vertex of the thing with that index, `corner` the word of a corner.
fn obj_of(vertex: impl Fn(usize, Vec3) -> String, corner: impl Fn(usize) -> String) -> String {
    let (mut text, mut first) = ("mtllib scene.mtl\n".to_owned(), 1);
    for (index, Thing { vertices, faces }) in things().into_iter().enumerate() {
        text += &format!("o {name}\nusemtl {name}\n", name = NAMES[index]);
        text.extend(vertices.iter().map(|at| vertex(index, Vec3::from(*at)) + "\n"));
        for face in faces {
            let words: Vec<String> = face.iter().map(|&place| corner(first + place)).collect();
            text += &format!("f {}\n", words.join(" "));
        }
        first += vertices.len();
    }
    text
}

fn plain(_: usize, at: Vec3) -> String {
    format!("v {} {} {}", at.x, at.y, at.z)
}

fn obj() -> String {
    obj_of(plain, |vertex| vertex.to_string())
}

/// The scene as PLY, with more properties and numbers of vertices.
fn ply_of(properties: &str, numbers: [&str; 3]) -> String {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (thing, numbers) in things().into_iter().zip(numbers) {
        faces.extend(thing.faces.iter().map(|face| {
            let words: Vec<String> = face.iter().map(|place| (vertices.len() + place).to_string()).collect();
            format!("{} {}\n", face.len(), words.join(" "))
        }));
        vertices.extend(thing.vertices.iter().map(|[x, y, z]| format!("{x} {y} {z} {numbers}\n")));
    }
    format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n{properties}\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n{}{}",
        vertices.len(),
        faces.len(),
        vertices.concat(),
        faces.concat()
    )
}

/// The triangles, each with its colour and normals.
fn look(scene: &Scene) -> Vec<([Vec3; 3], Vec3, Option<[Vec3; 3]>)> {
    let of = |face| {
        let color = scene.look(face, Vec3::splat(1.0 / 3.0)).color;
        (scene.mesh.corners(face), color, scene.mesh.corner_normals.get(face).copied())
    };
    (0..scene.mesh.triangles.len()).map(of).collect()
}

/// What loading says of the file; that there is a light is not of it.
fn notes(scene: &Scene) -> String {
    let of_file = scene.report.notes().iter().filter(|note| note.kind != NoteKind::Added);
    of_file.map(|note| note.to_string() + "\n").collect()
}

struct Place(Folder);

impl Place {
    fn new(test: &str) -> Self {
        let folder = Folder::new(test);
        folder.file("scene.mtl", MATERIALS);
        Self(folder)
    }

    fn load(&self, name: &str, content: impl AsRef<[u8]>) -> Scene {
        Scene::load(&self.0.file(name, content)).unwrap_or_else(|error| panic!("{error}"))
    }
}

#[test]
fn obj_files_that_show_the_same() {
    let place = Place::new("same-obj");
    let control = place.load("control.obj", obj());
    assert_eq!(control.mesh.triangles.len(), 2 + 12 + 8 + 2);
    place.0.file("bom.mtl", format!("\u{feff}{}", MATERIALS.replace('\n', "\r\n")));
    place.0.file("hash.mtl", MATERIALS.replace("newmtl ", "newmtl Material #"));
    place.0.file("a.mtl", MATERIALS.split("newmtl blue").next().unwrap());
    place.0.file("b.mtl", "newmtl blue\n  Kd\t0.1 0.2 0.8  \n");
    place.0.file("one.mtl", MATERIALS.replace("Kd 0.6 0.6 0.6", "Ka 0 \nKd 0.6 \nKs 0 "));
    let hash = obj().replace("usemtl ", "usemtl Material #").replace("scene.mtl", "hash.mtl");
    for (name, text) in [
        ("bom and crlf", format!("\u{feff}{}", obj().replace('\n', "\r\n"))),
        ("bom in the materials", obj().replace("scene.mtl", "bom.mtl")),
        ("number signs", hash),
        ("lists", obj().replace("scene.mtl", "a.mtl b.mtl")),
        ("one number", obj().replace("scene.mtl", "one.mtl")),
        ("dot and backslash", obj().replace("scene.mtl", ".\\scene.mtl")),
        ("another machine", obj().replace("scene.mtl", "C:\\Users\\me\\Scene.MTL")),
        ("continued", obj().replace(" 2 3", " \\\n 2 \\\n 3")),
        ("utf16, low bytes first", format!("\u{feff}{}", obj())),
        ("utf16, high bytes first", format!("\u{feff}{}", obj())),
    ] {
        let bytes = match name {
            "utf16, low bytes first" => text.encode_utf16().flat_map(u16::to_le_bytes).collect(),
            "utf16, high bytes first" => text.encode_utf16().flat_map(u16::to_be_bytes).collect(),
            _ => text.into_bytes(),
        };
        let scene = place.load("case.obj", bytes);
        assert_eq!(look(&scene), look(&control), "{name}");
        assert_eq!(notes(&scene), "", "{name}");
    }
}

#[test]
fn obj_files_that_lack_something() {
    let place = Place::new("lacks-obj");
    let control = place.load("control.obj", obj());
    let shapes = |scene: &Scene| look(scene).into_iter().map(|(at, ..)| at).collect::<Vec<_>>();
    let bare = place.load("bare.obj", obj().replace("scene.mtl", "not_sent_along.mtl"));
    assert_eq!(shapes(&bare), shapes(&control));
    assert!(look(&bare)[..22].iter().all(|(_, color, _)| *color == Vec3::splat(0.7)));
    assert_eq!(
        notes(&bare),
        "left out: a material library that is missing or cannot be read (not_sent_along.mtl)\n"
    );

    // Normals that are not numbers are those of the faces; the others are kept.
    let normal = |normals: &str| format!("{normals}{}", obj_of(plain, |vertex| format!("{vertex}//1")));
    let smooth = place.load("smooth.obj", normal("vn 0.6 0.8 0\n"));
    assert_eq!(look(&smooth)[0].2, Some([Vec3::new(0.6, 0.8, 0.0); 3]));
    let nan = place.load("nan.obj", normal("vn nan nan nan\n"));
    assert_eq!(shapes(&nan), shapes(&control));
    for (face, (_, _, normals)) in look(&nan).into_iter().enumerate() {
        assert_eq!(normals, Some([nan.mesh.face_normals[face]; 3]));
    }
    assert_eq!(notes(&nan), "repaired: a normal that is not a number, replaced by the face's\n");
}

#[test]
fn obj_files_with_colours_and_opacity() {
    let place = Place::new("colours-obj");
    let control = place.load("control.obj", obj());
    // sRGB codes of the control's colours, as a table of linear light has them.
    let codes = [[0.797_738; 3], [0.906_332, 0.349_191, 0.349_191], [0.349_191, 0.484_529, 0.906_332]];
    let colored = |thing: usize, at: Vec3| {
        let [r, g, b] = codes[thing];
        format!("v {} {} {} {r} {g} {b}", at.x, at.y, at.z)
    };
    let text = obj_of(colored, |vertex| vertex.to_string()).replace("mtllib scene.mtl\n", "");
    let text: String =
        text.lines().filter(|line| !line.starts_with("usemtl")).map(|line| line.to_owned() + "\n").collect();
    let scene = place.load("colours.obj", text);
    for ((at, color, _), (expected_at, expected, _)) in look(&scene).into_iter().zip(look(&control)).take(22)
    {
        assert!(at == expected_at && color.distance(expected) < 1e-4, "{color} {expected}");
    }
    place.0.file("d.mtl", MATERIALS.replace("Kd 0.8 0.1 0.1", "Kd 0.8 0.1 0.1\nd 0.1\nTr 0.9\nillum 4"));
    let scene = place.load("d.obj", obj().replace("scene.mtl", "d.mtl"));
    assert_eq!(look(&scene), look(&control));
    let opacities: Vec<f32> = (0..22).map(|face| scene.look(face, Vec3::X).opacity).collect();
    assert_eq!(opacities, [vec![1.0; 2], vec![0.1; 12], vec![1.0; 8]].concat());
    let of_box = &scene.materials[scene.mesh.material[2] as usize];
    assert_eq!(of_box.alpha, Alpha::Blend);
}

#[test]
fn an_obj_file_with_a_texture() {
    let place = Place::new("texture-obj");
    let picture = image::RgbImage::from_fn(2, 2, |x, y| {
        image::Rgb([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9; 3]][(x + 2 * y) as usize])
    });
    let mut png = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    place.0.file("Checker 1.PNG", png.into_inner());
    place.0.file("tex.mtl", "newmtl tex\nmap_Kd .\\checker 1.png\n");
    let text = "mtllib tex.mtl\nusemtl tex\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    let scene = place.load("tex.obj", text);
    assert_eq!(notes(&scene), "");
    // The first triangle has the corners at the lower left, lower right and upper right.
    let at = |u: f32, v: f32| scene.look(0, Vec3::new(1.0 - u, u - v, v)).color;
    assert!(at(0.25, 0.25).distance(Vec3::Z) < 1e-5 && at(0.75, 0.75).distance(Vec3::Y) < 1e-5);
    assert!(at(0.75, 0.25).distance(Vec3::splat(9.0 / 255.0 / 12.92)) < 1e-4);
}

#[test]
fn concave_outlines_keep_their_notch() {
    let place = Place::new("concave");
    let vertices =
        "v -1 -1 0\nv 1 -1 0\nv 1 -0.4 0\nv -0.4 -0.4 0\nv -0.4 0.4 0\nv 1 0.4 0\nv 1 1 0\nv -1 1 0\n";
    let whole = place.load("c.obj", format!("{vertices}f 1 2 3 4 5 6 7 8\n"));
    let parts = place.load("parts.obj", format!("{vertices}f 1 2 3 4\nf 1 4 5 8\nf 5 6 7 8\n"));
    let area = |scene: &Scene| -> f32 {
        let of = |face: usize| {
            let [a, b, c] = scene.mesh.corners(face);
            0.5 * (b - a).cross(c - a).z
        };
        (0..6).map(of).sum()
    };
    assert!((area(&whole) - 2.88).abs() < 1e-5 && (area(&parts) - 2.88).abs() < 1e-5);
    // No triangle has a point in the notch.
    for face in 0..6 {
        let centre = whole.mesh.corners(face).into_iter().sum::<Vec3>() / 3.0;
        assert!(centre.x < -0.4 || centre.y.abs() > 0.4, "{centre}");
    }
    assert_eq!(notes(&whole), "");
}

#[test]
fn coordinates_of_seven_digits_are_as_good_as_small_ones() {
    let place = Place::new("far");
    let far = |_: usize, at: Vec3| {
        let [x, y, z] = at.as_dvec3().to_array();
        format!("v {} {} {}", 691_234.0 + x, 313.0 + y, z - 5_334_567.0)
    };
    let control = place.load("near.obj", obj());
    let scene = place.load("far.obj", obj_of(far, |vertex| vertex.to_string()));
    let DVec3 { x, y, z } = scene.origin;
    let shift = (scene.origin - DVec3::new(691_234.0, 313.0, -5_334_567.0)).as_vec3();
    let told = format!("an origin at ({x}, {y}, {z}), from which camera paths count");
    assert!(scene.report.notes().iter().any(|note| note.what == told), "{:?}", scene.report);
    for ((at, color, _), (expected_at, expected, _)) in look(&scene).into_iter().zip(look(&control)) {
        // The digits of seven figures and six decimals.
        assert!(at.iter().zip(expected_at).all(|(at, near)| (*at + shift).distance(near) < 1e-5), "{at:?}");
        assert_eq!(color, expected);
    }
}

/// A scene file with two meshes, a box, a camera, a light and a motion, all by `x` and `z` from where they are near.
fn scene_file(x: f64, z: f64) -> String {
    format!(
        r#"Scene(
            version: 1,
            camera: (eye: ({}, 1.5, {}), target: ({}, 0.5, {}), fov: 40),
            motions: {{ "turn": (pivot: ({}, 0, {}), keys: [(time: 0), (time: 1, rotate: (0, 90, 0))]) }},
            objects: [
                (shape: Box(low: (0, 0, 0), high: (1, 1, 1)), translate: ({}, 0.25, {})),
                (shape: File("a.obj")),
                (shape: File("b.obj"), motion: "turn"),
            ],
            lights: [Point(position: ({}, 5, {}), intensity: (9, 9, 9)),
                Spot(position: ({}, 6, {}), target: ({}, 0, {}), intensity: (9, 9, 9)),
                Quad(corner: ({}, 4, {}), u: (1, 0, 0), v: (0, 0, 1), radiance: (1, 1, 1), motion: "turn")],
        )"#,
        x + 0.25,
        z + 8.0,
        x,
        z,
        x + 3.5,
        z - 1.25,
        x - 2.0,
        z + 0.125,
        x,
        z + 1.0,
        x - 1.0,
        z - 2.0,
        x,
        z,
        x + 1.5,
        z
    )
}

#[test]
fn a_scene_file_places_far_meshes_beside_each_other() {
    let (x, z) = (500_000.25, -4_649_776.5);
    let load = |x: f64, z: f64, test: &str| {
        let place = Place::new(test);
        for (name, shift) in [("a.obj", 0.0), ("b.obj", 3.375)] {
            let moved = |_: usize, at: Vec3| {
                // Binary fractions, which f64 adds without rounding.
                let at = (at * 16.0).round().as_dvec3() / 16.0;
                format!("v {} {} {}", at.x + x + shift, at.y, at.z + z)
            };
            place.0.file(name, obj_of(moved, |vertex| vertex.to_string()));
        }
        place.load("scene.ron", scene_file(x, z))
    };
    let (near, far) = (load(0.0, 0.0, "near-scene"), load(x, z, "far-scene"));
    assert_eq!((near.origin, far.origin), (DVec3::ZERO, DVec3::new(500_000.0, 1.0, -4_649_777.0)));
    let shift = (far.origin - DVec3::new(x, 0.0, z)).as_vec3();
    // At rest and in motion, on all sides.
    for frame in [0, 15] {
        let [near, far] = [&near, &far].map(|scene| scene.posed(&scene.poses_at(frame)));
        for (at, expected) in far.mesh.positions.iter().zip(&near.mesh.positions) {
            assert!((*at + shift).distance(*expected) < 2e-5, "frame {frame}: {at} {expected}");
        }
        for (light, expected) in far.lights.iter().zip(&near.lights) {
            let place = |light: &Light| match *light {
                Light::Point { position, .. } | Light::Spot { position, .. } => position,
                Light::Quad { corner, .. } => corner,
            };
            assert!((place(light) + shift).distance(place(expected)) < 2e-5, "frame {frame}: {light:?}");
        }
    }
    assert_eq!((far.camera.eye + shift, far.camera.rotation), (near.camera.eye, near.camera.rotation));
}

#[test]
fn a_mesh_that_is_placed_near_needs_no_origin() {
    let place = Place::new("placed-near");
    let far =
        |_: usize, at: Vec3| format!("v {} {} {}", 500_000.0 + f64::from(at.x), at.y, f64::from(at.z) - 4e6);
    place.0.file("far.obj", obj_of(far, |vertex| vertex.to_string()));
    let of = |members: &str| {
        place
            .load("scene.ron", format!("Scene(version: 1, objects: [(shape: File(\"far.obj\"), {members})])"))
    };
    let low = |scene: &Scene| {
        look(scene).iter().flat_map(|(corners, ..)| *corners).take(66).reduce(Vec3::min).unwrap()
    };
    let moved = of("translate: (-500000, 0, 4000000)");
    assert!(moved.origin == DVec3::ZERO && low(&moved).distance(Vec3::new(-2.0, 0.0, -2.0)) < 1e-5);
    // By its height it is placed by its box.
    let scaled = of("height: 2.8, translate: (1, 0, 0)");
    assert!(scaled.origin == DVec3::ZERO && low(&scaled).distance(Vec3::new(-3.0, 0.0, -4.0)) < 1e-4);
    // Half the size, and turned: from (x, z) to (z, -x).
    let turned = of("scale: 0.5, rotate: (0, 90, 0)");
    let expected = DVec3::new(-2e6, 0.35, -250_000.0).round();
    assert!(turned.origin.distance(expected) < 2.0, "{}", turned.origin);
}

#[test]
fn ply_files_that_show_the_same() {
    let place = Place::new("same-ply");
    let control = place.load("control.ply", ply_of("", [""; 3]));
    let blank = place.load("blank.ply", ply_of("", [""; 3]).replace("end_header\n", "end_header\n\n"));
    assert_eq!((look(&blank), notes(&blank)), (look(&control), String::new()));
    // A vertex that is not a number, and that no face uses.
    let text = ply_of("", [""; 3]).replace("vertex 18", "vertex 19");
    let unused =
        place.load("unused.ply", text.replace("1.25 0.25 0.75 \n", "1.25 0.25 0.75 \nnan nan nan\n"));
    assert_eq!((look(&unused), notes(&unused)), (look(&control), String::new()));
    // And one that a face uses.
    let used = place.load("used.ply", ply_of("", [""; 3]).replace("1.25 0.25 0.75", "nan 0.25 0.75"));
    assert_eq!(used.mesh.triangles.len(), control.mesh.triangles.len() - 4);
    assert_eq!(notes(&used), "left out: a face with a corner that is not a number, 4 times\n");

    let rgb = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let colored = place.load("colours.ply", ply_of(rgb, ["203 203 203", "231 89 89", "89 124 231"]));
    let expected = place.load("control.obj", obj());
    for ((_, color, _), (_, expected, _)) in look(&colored).into_iter().zip(look(&expected)).take(22) {
        assert!(color.distance(expected) < 0.005, "{color} {expected}");
    }
}

#[test]
fn files_that_are_not_what_their_names_say() {
    let place = Place::new("not");
    let error =
        |name: &str, content: &[u8]| Scene::load(&place.0.file(name, content)).unwrap_err().to_string();
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 123456\n";
    for name in ["a.glb", "a.gltf", "a.obj", "a.ply", "a.ron", "a.vts"] {
        assert!(error(name, pointer).contains("a git-lfs pointer"), "{name}");
        assert!(error(name, b"<!DOCTYPE html><html>").contains("a web page"), "{name}");
        assert!(error(name, b"").contains("it is empty"), "{name}");
    }
    let text = ply_of("", [""; 3]);
    let message = error("cut.ply", &text.as_bytes()[..text.len() - 20]);
    assert!(message.contains("cut.ply: cut off: it ends within face 13 of 15"), "{message}");
}
