//! glTF files as people have them, beside the same scene as a plain file: a floor, a red box and a blue ball.

use std::f32::consts::FRAC_PI_2;

use glam::{DVec3, Quat, Vec2, Vec3};

use super::tests::Making;
use crate::load::tests::Folder;
use crate::{Alpha, Light, Scene, Shape};

/// The three things, with the members of their materials.
fn things() -> [(Shape, &'static str); 3] {
    let floor = [[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]].map(Vec3::from);
    let ball = Shape::sphere(0.4, 12, 8).moved(Vec3::new(1.2, 0.4, 0.9));
    [
        (
            Shape::quad(floor),
            r#""pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.6, 0.6, 1], "metallicFactor": 0}"#,
        ),
        (
            Shape::cuboid(Vec3::new(-0.7, 0.0, -0.7), Vec3::new(0.7, 1.4, 0.7)),
            r#""pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.1, 0.1, 1], "metallicFactor": 0}"#,
        ),
        (ball, r#""pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.8, 1], "metallicFactor": 0}"#),
    ]
}

/// A file of the three things, as it is or changed.
struct Case {
    making: Making,
    /// The members of each thing's attributes, primitive, material and node.
    attributes: [String; 3],
    primitives: [String; 3],
    materials: [String; 3],
    nodes: [String; 3],
    /// More nodes, and more members of the file.
    more_nodes: Vec<String>,
    rest: String,
}

impl Case {
    fn new() -> Self {
        let mut making = Making::default();
        let mut attributes = [const { String::new() }; 3];
        let mut primitives = attributes.clone();
        for (index, (shape, _)) in things().iter().enumerate() {
            let positions: Vec<f32> = shape.positions.iter().flat_map(Vec3::to_array).collect();
            let at = making.floats("VEC3", shape.positions.len(), &positions);
            let corners: Vec<u8> =
                shape.triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect();
            let (view, count) = (making.view(&corners, ""), 3 * shape.triangles.len());
            let indices = making.accessor(format!(
                r#""bufferView": {view}, "componentType": 5125, "count": {count}, "type": "SCALAR""#
            ));
            attributes[index] = format!(r#""POSITION": {at}"#);
            primitives[index] = format!(r#""indices": {indices}"#);
        }
        let materials = things().map(|(_, material)| material.to_owned());
        let nodes = [const { String::new() }; 3];
        Self { making, attributes, primitives, materials, nodes, more_nodes: vec![], rest: String::new() }
    }

    fn file(&self) -> Vec<u8> {
        let Self { attributes, primitives, materials, nodes, more_nodes, rest, .. } = self;
        let list = |of: &dyn Fn(usize) -> String| [0, 1, 2].map(of).join(", ");
        let meshes = list(&|i| {
            let (attributes, primitive) = (&attributes[i], &primitives[i]);
            format!(r#"{{"primitives": [{{"material": {i}, "attributes": {{{attributes}}}, {primitive}}}]}}"#)
        });
        let materials = list(&|i| format!("{{{}}}", materials[i]));
        let mut all = vec![list(&|i| format!(r#"{{"mesh": {i}{}}}"#, nodes[i]))];
        all.extend(more_nodes.iter().cloned());
        let nodes = all.join(", ");
        self.making
            .file(&format!(r#""meshes": [{meshes}], "materials": [{materials}], "nodes": [{nodes}]{rest}"#))
    }

    fn load(&self, test: &str) -> Scene {
        let folder = Folder::new(&format!("gltf-{test}"));
        Scene::load(&folder.file("case.glb", self.file())).unwrap_or_else(|error| panic!("{test}: {error}"))
    }

    /// An accessor of texture coordinates of the box, which are x and y of its front.
    fn unwrap_box(&mut self) {
        let shape = &things()[1].0;
        let uvs: Vec<f32> =
            shape.positions.iter().flat_map(|at| [(at.x + 0.7) / 1.4, 1.0 - at.y / 1.4]).collect();
        let at = self.making.floats("VEC2", shape.positions.len(), &uvs);
        self.attributes[1] += &format!(r#", "TEXCOORD_0": {at}"#);
    }

    /// The members of textures and an image of 2 x 2 texels, rows from the top.
    fn picture(&mut self, texels: [[u8; 4]; 4]) {
        let picture = image::RgbaImage::from_raw(2, 2, texels.concat()).unwrap();
        let mut png = std::io::Cursor::new(vec![]);
        picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let view = self.making.view(&png.into_inner(), "");
        self.rest += &format!(
            r#", "images": [{{"bufferView": {view}, "mimeType": "image/png"}}],
            "textures": [{{"source": 0, "sampler": 0}}], "samplers": [{{"magFilter": 9728}}]"#
        );
    }
}

/// The triangles of the three things, each with its colour.
fn look(scene: &Scene) -> Vec<([Vec3; 3], Vec3)> {
    let of = |face| (scene.mesh.corners(face), scene.look(face, Vec3::splat(1.0 / 3.0)).color);
    (0..things().map(|(shape, _)| shape.triangles.len()).iter().sum()).map(of).collect()
}

/// What loading says of the file.
fn notes(scene: &Scene) -> Vec<String> {
    let of_file = scene.report.notes().iter().filter(|note| note.kind != crate::NoteKind::Added);
    of_file.map(ToString::to_string).collect()
}

fn assert_like(scene: &Scene, control: &Scene, tolerance: f32, case: &str) {
    for ((at, color), (expected_at, expected)) in look(scene).into_iter().zip(look(control)) {
        let near = at.iter().zip(expected_at).all(|(at, expected)| at.distance(expected) <= tolerance);
        assert!(near && color == expected, "{case}: {at:?} {color} instead of {expected_at:?} {expected}");
    }
    assert_eq!(scene.mesh.triangles.len(), control.mesh.triangles.len(), "{case}");
    assert_eq!(notes(scene), [""; 0], "{case}");
}

#[test]
fn other_ways_to_write_the_same() {
    let control = Case::new().load("control");
    assert_eq!(look(&control).len(), 2 + 12 + 12 * 14);

    // Half of the box's vertices as sparse changes.
    let mut sparse = Case::new();
    let shape = &things()[1].0;
    let wrong: Vec<f32> =
        shape.positions.iter().flat_map(|at| [at.x, at.y * f32::from(at.y < 1.0), at.z]).collect();
    let base = sparse.making.view(&wrong.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<_>>(), "");
    let high: Vec<u8> =
        (0..shape.positions.len() as u8).filter(|&i| shape.positions[usize::from(i)].y > 1.0).collect();
    let values: Vec<u8> = high
        .iter()
        .flat_map(|&i| shape.positions[usize::from(i)].to_array())
        .flat_map(f32::to_le_bytes)
        .collect();
    let (places, values) = (sparse.making.view(&high, ""), sparse.making.view(&values, ""));
    let at = sparse.making.accessor(format!(
        r#""bufferView": {base}, "componentType": 5126, "count": {}, "type": "VEC3", "sparse": {{"count": {},
        "indices": {{"bufferView": {places}, "componentType": 5121}}, "values": {{"bufferView": {values}}}}}"#,
        shape.positions.len(),
        high.len()
    ));
    sparse.attributes[1] = format!(r#""POSITION": {at}"#);
    assert_like(&sparse.load("sparse"), &control, 0.0, "sparse");

    // Positions as shorts from -2 to 2, which the nodes scale.
    let mut quantized = Case::new();
    for (index, (shape, _)) in things().iter().enumerate() {
        let short = |n: f32| (((n + 2.0) / 4.0 * 65535.0).round() as u16).to_le_bytes();
        let shorts: Vec<u8> =
            shape.positions.iter().flat_map(|at| [at.x, at.y, at.z, 0.0].map(short)).flatten().collect();
        let view = quantized.making.view(&shorts, r#", "byteStride": 8"#);
        let at = quantized.making.accessor(format!(
            r#""bufferView": {view}, "componentType": 5123, "count": {}, "type": "VEC3""#,
            shape.positions.len()
        ));
        quantized.attributes[index] = format!(r#""POSITION": {at}"#);
        let scale = 4.0 / 65535.0;
        quantized.nodes[index] =
            format!(r#", "translation": [-2, -2, -2], "scale": [{scale}, {scale}, {scale}]"#);
    }
    quantized.rest = r#", "extensionsRequired": ["KHR_mesh_quantization"]"#.to_owned();
    assert_like(&quantized.load("quantized"), &control, 1e-4, "quantized");

    // The box in centimetres and lying, skinned to a joint below an armature that says so.
    let mut skinned = Case::new();
    let lying: Vec<f32> =
        shape.positions.iter().flat_map(|at| [100.0 * at.x, -100.0 * at.z, 100.0 * at.y]).collect();
    let count = shape.positions.len();
    let at = skinned.making.floats("VEC3", count, &lying);
    let view = skinned.making.view(&vec![0; 4 * count], "");
    let joints = skinned.making.accessor(format!(
        r#""bufferView": {view}, "componentType": 5121, "count": {count}, "type": "VEC4""#
    ));
    let weights = skinned.making.floats("VEC4", count, &[1.0, 0.0, 0.0, 0.0].repeat(count));
    skinned.attributes[1] = format!(r#""POSITION": {at}, "JOINTS_0": {joints}, "WEIGHTS_0": {weights}"#);
    skinned.nodes[1] = r#", "skin": 0, "scale": [7, 7, 7]"#.to_owned();
    let [x, _, _, w] = Quat::from_rotation_x(-FRAC_PI_2).to_array();
    skinned.more_nodes = vec![
        format!(r#"{{"rotation": [{x}, 0, 0, {w}], "scale": [0.01, 0.01, 0.01], "children": [4]}}"#),
        "{}".to_owned(),
    ];
    skinned.rest = r#", "skins": [{"joints": [4]}]"#.to_owned();
    assert_like(&skinned.load("skinned"), &control, 1e-6, "skinned");

    // A texture that says 0 makes a metal of factor 1 none.
    let mut masked = Case::new();
    masked.unwrap_box();
    masked.picture([[255, 255, 0, 255]; 4]);
    masked.materials[1] = r#""pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.1, 0.1, 1],
        "metallicRoughnessTexture": {"index": 0}}"#
        .to_owned();
    let scene = masked.load("masked");
    assert_like(&scene, &control, 0.0, "metal by a texture");
    let box_look = scene.look(2, Vec3::splat(1.0 / 3.0));
    assert_eq!((box_look.metallic, box_look.roughness), (0.0, 1.0));

    // What a picture needs not, required.
    let mut required = Case::new();
    required.rest = r#", "extensionsRequired": ["KHR_materials_unlit", "KHR_texture_transform"]"#.to_owned();
    assert_like(&required.load("required"), &control, 0.0, "required extensions");
}

#[test]
fn maps_on_the_box() {
    let checks = [[255, 0, 0, 255], [0, 255, 0, 0], [0, 0, 255, 255], [255, 255, 255, 0]];
    let point = |scene: &Scene, u: f32, v: f32| {
        // The faces of the front, and where on them.
        let (x, y) = (1.4 * u - 0.7, 1.4 * (1.0 - v));
        let faces = (2..14).filter(|&face| scene.mesh.face_normals[face].z > 0.5);
        let weights = |face: usize| {
            let [a, b, c] = scene.mesh.corners(face).map(Vec3::truncate);
            let area = |p: Vec2, q: Vec2, r: Vec2| (q - p).perp_dot(r - p);
            let at = Vec2::new(x, y);
            Vec3::new(area(at, b, c), area(a, at, c), area(a, b, at)) / area(a, b, c)
        };
        let (face, weights) =
            faces.map(|face| (face, weights(face))).find(|(_, w)| w.min_element() > -1e-4).unwrap();
        scene.look(face, weights)
    };
    let load = |material: &str, test: &str| {
        let mut case = Case::new();
        case.unwrap_box();
        case.picture(checks);
        case.materials[1] = material.to_owned();
        let scene = case.load(test);
        assert_eq!(notes(&scene), [""; 0]);
        scene
    };
    let color = r#""pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}}"#;
    let scene = load(color, "colour");
    for (u, v, expected) in
        [(0.2, 0.2, Vec3::X), (0.8, 0.2, Vec3::Y), (0.2, 0.8, Vec3::Z), (0.8, 0.8, Vec3::ONE)]
    {
        assert_eq!((point(&scene, u, v).color, point(&scene, u, v).opacity), (expected, 1.0));
    }
    let scene = load(&format!(r#"{color}, "alphaMode": "MASK""#), "mask");
    assert_eq!([0.2, 0.8].map(|u| point(&scene, u, 0.2).opacity), [1.0, 0.0]);
    assert_eq!(scene.materials[1].alpha, Alpha::Mask(0.5));
    let scene = load(r#""emissiveFactor": [2, 2, 2], "emissiveTexture": {"index": 0}"#, "lamp");
    assert_eq!([0.2, 0.8].map(|u| point(&scene, u, 0.2).emission), [2.0 * Vec3::X, 2.0 * Vec3::Y]);
    // Twice as many checks, which begin half way.
    let turned = color.replace(
        r#""index": 0"#,
        r#""index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2], "offset": [0.5, 0]}}"#,
    );
    let scene = load(&turned, "transform");
    assert_eq!(
        [0.1, 0.35, 0.6, 0.85].map(|u| point(&scene, u, 0.1).color),
        [Vec3::Y, Vec3::X, Vec3::Y, Vec3::X]
    );
    let scene = load(
        r#""extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}},
            "pbrMetallicRoughness": {"metallicFactor": 0}"#,
        "glass",
    );
    assert_eq!(point(&scene, 0.5, 0.5).transmission, 1.0);
    let scene = load(
        r#""pbrMetallicRoughness": {"baseColorFactor": [1, 0.77, 0.34, 1], "roughnessFactor": 0.2}"#,
        "gold",
    );
    let gold = point(&scene, 0.5, 0.5);
    assert_eq!((gold.metallic, gold.color), (1.0, Vec3::new(1.0, 0.77, 0.34)));
}

#[test]
fn twelve_boxes_and_a_spot() {
    let mut case = Case::new();
    let places: Vec<f32> =
        (0..12_u8).flat_map(|i| [2.0 * f32::from(i % 4), 0.0, 2.0 * f32::from(i / 4)]).collect();
    let at = case.making.floats("VEC3", 12, &places);
    case.nodes[1] = format!(
        r#", "extensions": {{"EXT_mesh_gpu_instancing": {{"attributes": {{"TRANSLATION": {at}}}}}}}"#
    );
    case.more_nodes = vec![
        r#"{"translation": [0.6, 4, 0.9], "rotation": [-0.70710678, 0, 0, 0.70710678],
            "extensions": {"KHR_lights_punctual": {"light": 0}}}"#
            .to_owned(),
    ];
    case.rest = r#", "extensions": {"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 60, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.22}}]}}"#
        .to_owned();
    let scene = case.load("twelve");
    assert_eq!(scene.mesh.triangles.len(), 2 + 12 * 12 + 12 * 14);
    let [Light::Spot { position, axis, cosines, .. }] = scene.lights[..] else {
        panic!("{:?}", scene.lights)
    };
    assert!(position == Vec3::new(0.6, 4.0, 0.9) && axis.distance(Vec3::NEG_Y) < 1e-6);
    assert!((cosines[1].acos() - 0.22).abs() < 1e-4);
}

#[test]
fn places_of_seven_digits_are_as_good_as_small_ones() {
    let (mut near, mut far) = (Case::new(), Case::new());
    for index in 0..3 {
        near.nodes[index] = r#", "scale": [10, 10, 10]"#.to_owned();
        far.nodes[index] =
            r#", "translation": [691234.5, 312.0, -5334567.25], "scale": [10, 10, 10]"#.to_owned();
    }
    let (near, far) = (near.load("near"), far.load("far"));
    let shift = (far.origin - DVec3::new(691_234.5, 312.0, -5_334_567.25)).as_vec3();
    for ((at, color), (expected_at, expected)) in look(&far).into_iter().zip(look(&near)) {
        assert!(at.iter().zip(expected_at).all(|(at, expected)| (*at + shift).distance(expected) < 1e-4));
        assert_eq!(color, expected);
    }
    // The view, and the light that is added, are there too.
    assert!(
        (far.camera.eye + shift).distance(near.camera.eye) < 0.01 && near.lights.len() == far.lights.len()
    );
}

#[test]
fn cameras_of_a_file_are_those_of_a_scene_file_that_has_it() {
    let folder = Folder::new("gltf-cameras-of-scene");
    for (file, name) in [("a.glb", "front"), ("b.glb", "side")] {
        let mut case = Case::new();
        for node in &mut case.nodes {
            *node = r#", "translation": [691234.5, 312.0, -5334567.25]"#.to_owned();
        }
        let place = r#""translation": [691235.5, 313.0, -5334559.25]"#;
        case.more_nodes = vec![format!(r#"{{"name": "{name}", "camera": 0, {place}}}"#)];
        case.rest =
            r#", "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]"#.to_owned();
        folder.file(file, case.file());
    }
    // Where objects are moved to is where the scene has its origin, but their cameras stay.
    let text = r#"Scene(version: 1, objects: [(shape: File("a.glb"), translate: (1000, 0, 0)), (shape: File("b.glb"))])"#;
    let scene = Scene::load(&folder.file("scene.ron", text)).unwrap();
    assert!((scene.origin.x - 692_234.5).abs() < 10.0, "{}", scene.origin);
    let names: Vec<&str> = scene.cameras.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!((names, scene.camera), (vec!["front", "side"], scene.cameras[0].1));
    for (_, camera) in &*scene.cameras {
        let eye = camera.eye.as_dvec3() + scene.origin;
        assert!(eye.distance(DVec3::new(691_235.5, 313.0, -5_334_559.25)) < 1e-3, "{eye}");
    }
}

#[test]
fn cameras_show_what_the_file_shows() {
    let with = |lens: &str, place: &str, test: &str| {
        let mut case = Case::new();
        case.more_nodes = vec![format!(r#"{{"camera": 0, {place}}}"#)];
        case.rest = format!(r#", "cameras": [{{"type": "perspective", "perspective": {{"yfov": {lens}}}}}]"#);
        case.load(test)
    };
    // Whether the image shows all corners of the box and the ball.
    let shows_all = |scene: &Scene, size: [u32; 2]| {
        (2..look(scene).len()).flat_map(|face| scene.mesh.corners(face)).all(|corner| {
            let seen = scene.camera.rotation.inverse() * (corner - scene.camera.eye);
            let height = -seen.z * scene.camera.half_height(size);
            seen.y.abs() < height && seen.x.abs() < height * size[0] as f32 / size[1] as f32
        })
    };
    let wide =
        with(r#"0.5, "znear": 0.1, "aspectRatio": 1.7778"#, r#""translation": [0.45, 0.7, 5]"#, "wide");
    for (size, expected) in [([160, 90], true), ([90, 90], true), ([90, 160], true), ([160, 45], true)] {
        assert_eq!(shows_all(&wide, size), expected, "{size:?}");
    }
    let any = with(r#"0.5, "znear": 0.1"#, r#""translation": [0.45, 0.7, 5]"#, "any");
    assert!(shows_all(&any, [160, 90]) && !shows_all(&any, [90, 160]));
    // A far plane within the scene hides nothing.
    let cut = with(r#"0.6, "znear": 0.1, "zfar": 5"#, r#""translation": [0.45, 0.7, 5]"#, "cut");
    assert!(cut.mesh.positions.iter().all(|at| cut.camera.eye.z - at.z < cut.camera.far));
    assert_eq!(notes(&cut), ["left out: a far plane that hides some of the scene (camera 0)"]);
}
