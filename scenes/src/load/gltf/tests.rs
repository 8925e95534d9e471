use glam::{Quat, Vec2, Vec4};

use super::lights::Placed;
use super::*;
use crate::{Alpha, DIELECTRIC_F0, Light, Wrap};

/// A GLB of `json` and the positions of one triangle.
fn glb(json: &str) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let bin: Vec<u8> =
        [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0_f32].iter().flat_map(|f| f.to_le_bytes()).collect();
    let mut file = b"glTF".to_vec();
    let total = 12 + 8 + json.len() + 8 + bin.len();
    file.extend([2, total as u32, json.len() as u32].iter().flat_map(|n| n.to_le_bytes()));
    file.extend(b"JSON");
    file.extend(json);
    file.extend((bin.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bin);
    file
}

const JSON: &str = r#"{
    "asset": {"version": "2.0"},
    "extensionsUsed": ["KHR_lights_punctual"],
    "extensions": {"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1, 0.5, 0.25], "intensity": 8},
        {"type": "directional", "intensity": 3}]}},
    "scene": 0,
    "scenes": [{"nodes": [0, 1, 2, 3]}],
    "nodes": [
        {"mesh": 0, "translation": [0, 0, -3], "scale": [1, 2, 1]},
        {"translation": [1, 2, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        {"extensions": {"KHR_lights_punctual": {"light": 1}}},
        {"camera": 0, "translation": [0, 0, 5]}],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.25}}],
    "materials": [{"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0}}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36}]
}"#;

fn no_files(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("no file {name}"))
}

#[test]
fn triangle_with_lights_camera_and_material() {
    let scene = read(&glb(JSON), no_files).unwrap().into_scene("test").unwrap();
    assert_eq!(scene.mesh.corners(0)[2], Vec3::new(0.0, 4.0, -3.0));
    assert_eq!((scene.materials[0].name.as_str(), scene.materials[0].color), ("red", Vec3::X));
    assert_eq!(
        scene.lights[0],
        Light::Point { position: Vec3::new(1.0, 2.0, 3.0), intensity: Vec3::new(8.0, 4.0, 2.0) }
    );
    // The directional light shines along -z with 3 units of irradiance.
    let Light::Point { position, intensity } = scene.lights[1] else { panic!("{:?}", scene.lights[1]) };
    let towards = position - scene.mesh.corners(0)[0];
    assert!(towards.normalize().dot(Vec3::Z) > 0.999);
    assert!((intensity.x / towards.length_squared() - 3.0).abs() < 0.1);
    assert_eq!((scene.camera.eye, scene.camera.fov_y, scene.camera.near), (5.0 * Vec3::Z, 0.5, 0.25));
    assert!((scene.camera.rotation * Vec3::NEG_Z - Vec3::NEG_Z).length() < 1e-6);
    assert!(scene.camera.far > 8.0 && scene.camera.far.is_finite());
}

#[test]
fn every_truncation_is_an_error() {
    let file = glb(JSON);
    for length in 0..file.len() {
        assert!(read(&file[..length], no_files).is_err(), "{length} bytes were enough");
    }
}

#[test]
fn false_claims_of_a_broken_file_are_errors() {
    for (from, to) in [
        (r#""count": 3"#, r#""count": 400000000000"#),
        (r#""count": 3"#, r#""count": 4"#),
        (r#""byteLength": 36}],"#, r#""byteLength": 36, "byteOffset": 18446744073709551615}],"#),
        (r#""byteLength": 36}],"#, r#""byteLength": 36, "byteStride": 4}],"#),
        (r#""bufferView": 0"#, r#""bufferView": 7"#),
        ("5126", "5125"),
        ("VEC3", "VEC2"),
        (r#""buffers": [{"byteLength": 36}]"#, r#""buffers": [{"byteLength": 37}]"#),
        (r#""buffers": [{"byteLength": 36}]"#, r#""buffers": [{"byteLength": 36, "uri": "gone.bin"}]"#),
        (r#""mesh": 0"#, r#""mesh": 0, "children": [0]"#),
        (r#""POSITION": 0"#, r#""POSITION": 1"#),
        (r#""mesh": 0"#, r#""mesh": 1"#),
        (r#""version": "2.0""#, r#""version": "2.0", "minVersion": 5"#),
    ] {
        assert_ne!(JSON, JSON.replacen(from, to, 1), "{from}");
        let result = read(&glb(&JSON.replacen(from, to, 1)), no_files);
        assert!(result.is_err(), "{from} -> {to}");
    }
}

/// The notes of a model's report.
fn notes(model: &Model) -> Vec<String> {
    model.report.notes().iter().map(ToString::to_string).collect()
}

#[test]
fn a_camera_keeps_its_planes_or_is_left_out() {
    let with = |lens: &str| {
        let old = r#""yfov": 0.5, "znear": 0.25"#;
        read(&glb(&JSON.replacen(old, lens, 1)), no_files).unwrap()
    };
    let model = with(r#""yfov": 0.5, "znear": 0.00001, "zfar": 99"#);
    assert!(model.report.is_empty());
    let camera = model.into_scene("").unwrap().camera;
    assert_eq!((camera.near, camera.far), (1e-5, 99.0));
    // The triangle is 8 m away.
    for (far, hides) in [("8.1", false), ("7.9", true), ("0.00005", true)] {
        let model = with(&format!(r#""yfov": 0.5, "znear": 0.00001, "zfar": {far}"#));
        let expected = "left out: a far plane that hides some of the scene (camera 0)";
        assert_eq!(notes(&model), &[expected][..usize::from(hides)]);
        let camera = model.camera.unwrap();
        assert!(camera.near == 1e-5 && (8.0..20.0).contains(&camera.far), "{camera:?}");
    }
    for lens in [r#""yfov": 3.1405, "znear": 1"#, r#""yfov": 0.0011, "znear": 1"#] {
        assert!(with(lens).camera.is_some(), "{lens}");
    }
    for (lens, expected) in [
        (r#""yfov": 0.5, "znear": 0"#, "znear is 0; znear must be above 0 and below zfar"),
        (r#""yfov": 0.5, "znear": -1"#, "znear is -1"),
        (r#""yfov": 0.5, "znear": 2, "zfar": 1"#, "znear is 2 and zfar 1"),
        (r#""yfov": 0.5, "znear": 1, "zfar": 1"#, "znear is 1 and zfar 1"),
        (r#""yfov": 3.2, "znear": 1"#, "yfov is 3.2"),
        (r#""yfov": 3.1407, "znear": 1"#, "yfov is 3.1407"),
        (r#""yfov": 0.0009, "znear": 1"#, "yfov is 0.0009"),
        (r#""yfov": "wide""#, "a camera: its lens is not valid"),
    ] {
        let model = with(lens);
        assert!(model.camera.is_none());
        let [note] = &notes(&model)[..] else { panic!("{:?}", model.report) };
        assert!(note.contains(expected) && note.ends_with("(camera 0)"), "{lens}: {note}");
    }
}

#[test]
fn numbers_beyond_the_limits_are_left_out_by_name() {
    for (from, to, expected) in [
        ("[1, 2, 3]", "[1, 2e9, 3]", "left out: a light that is too strong or too far away (node 1)"),
        (
            r#""intensity": 8"#,
            r#""intensity": 2e30"#,
            "left out: a light of an intensity that is not valid (node 1)",
        ),
        (r#""intensity": 8"#, r#""intensity": "8""#, "left out: a light that is not valid (node 1)"),
        (r#""light": 0"#, r#""light": 2"#, "left out: a light that is not valid (node 1)"),
        (r#""type": "point""#, r#""type": "area""#, "left out: a light of an unknown kind (node 1)"),
        (r#""intensity": 8"#, r#""intensity": 8, "range": 9"#, "left out: the range of a light (node 1)"),
        (
            r#""name": "red", "#,
            r#""emissiveFactor": [0, 1e20, 0], "#,
            "repaired: an emission beyond 1e18 (material 0)",
        ),
        (
            r#""metallicFactor": 0"#,
            r#""metallicFactor": []"#,
            "left out: a material that is not valid (material 0)",
        ),
        (r#""material": 0"#, r#""material": 1"#, "repaired: a material that does not exist (mesh 0)"),
        ("[0, 0, 5]", "[0, 0, 5e9]", "left out: a camera that is too far away (camera 0)"),
    ] {
        assert!(JSON.contains(from), "{from}");
        let model = read(&glb(&JSON.replacen(from, to, 1)), no_files).unwrap();
        assert_eq!(notes(&model), [expected]);
        assert!(model.into_scene("").is_ok());
    }
    let far = read(&glb(&JSON.replacen("[1, 2, 1]", "[1, 2e9, 1]", 1)), no_files).unwrap();
    assert_eq!(far.check().unwrap_err().to_string().find("vertex 2 is at (0, 4000000000, -3)"), Some(0));
}

#[test]
fn meshes_that_share_a_buffer_are_counted_before_they_are_made() {
    // A buffer of 4 MB, which 400 primitives use.
    let primitive = r#"{"attributes": {"POSITION": 0}, "material": 0}"#;
    let json = JSON
        .replacen(primitive, &[primitive; 400].join(","), 1)
        .replacen(r#""count": 3"#, r#""count": 300000"#, 1)
        .replacen(r#""byteLength": 36}],"#, r#""byteLength": 3600000}],"#, 1)
        .replacen(r#"[{"byteLength": 36}]"#, r#"[{"byteLength": 3600000, "uri": "a.bin"}]"#, 1);
    let reads = std::cell::Cell::new(0);
    let files = |_: &str| {
        reads.set(reads.get() + 1);
        Ok(vec![0; 3_600_000])
    };
    let message = read(json.as_bytes(), files).unwrap_err();
    let expected = "mesh 0, primitive 16: that makes 1700000 triangles and 5100000 vertices";
    assert!(message.contains(expected), "{message}");
    assert_eq!(reads.get(), 1);
    // A file is read once, however many buffers it has.
    let twice = json.replacen(
        r#"[{"byteLength": 3600000, "uri": "a.bin"}]"#,
        r#"[{"byteLength": 3600000, "uri": "a.bin"}, {"byteLength": 3600000, "uri": "a.bin"}]"#,
        1,
    );
    read(twice.as_bytes(), files).unwrap_err();
    assert_eq!(reads.get(), 2);
}

#[test]
fn an_orthographic_camera_becomes_one_far_away() {
    let lens = r#""perspective": {"yfov": 0.5, "znear": 0.25}"#;
    assert!(JSON.contains(lens));
    let with = |members: &str| {
        let other = format!(r#""orthographic": {{{members}}}"#);
        read(&glb(&JSON.replacen(lens, &other, 1)), no_files).unwrap()
    };
    let model = with(r#""xmag": 3, "ymag": 2, "zfar": 9, "znear": 0.1"#);
    assert_eq!(notes(&model), ["approximated: an orthographic camera, by one far away (camera 0)"]);
    let camera = model.camera.unwrap();
    assert!(camera.is_valid() && camera.rotation * Vec3::NEG_Z == Vec3::NEG_Z);
    // It shows three metres to each side and two up and down, at the front and at the back.
    for z in [-2.0, -3.0, -4.0] {
        let corner = camera.direction(300.0, 0.0, [300, 200]) * (camera.eye.z - z);
        assert!(corner.x / 3.0 > 0.99 && corner.x / 3.0 < 1.01, "{corner}");
        assert!(corner.y / 2.0 > 0.99 && corner.y / 2.0 < 1.01, "{corner}");
    }
    assert!((camera.eye.z - camera.near - 4.9).abs() < 1e-3 && camera.eye.z - camera.far < -4.0);
    for (members, expected) in [
        (
            r#""xmag": 0, "ymag": 2, "zfar": 9, "znear": 0.1"#,
            "a camera: xmag is 0 and ymag 2; they must be above 0",
        ),
        (r#""xmag": 1, "ymag": 2, "zfar": 1, "znear": 1"#, "a camera: znear is 1 and zfar 1;"),
        (r#""xmag": 1, "ymag": 2"#, "a camera: its lens is not valid"),
    ] {
        let [note] = &notes(&with(members))[..] else { panic!("one note") };
        assert!(note.contains(expected), "{note}");
    }
}

#[test]
fn cameras_are_found_by_name() {
    let nodes = r#""nodes": [
        {"mesh": 0}, {"name": "top", "camera": 0}, {"camera": 1}, 
        {"name": "top", "camera": 1, "translation": [0, 0, 7]},
        {"camera": 0}, {"name": "top", "camera": 0}],"#;
    let cameras = r#""cameras": [
        {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.25, "aspectRatio": 1.5}},
        {"name": "side", "type": "perspective", "perspective": {"yfov": 0.75, "znear": 0.25}}],"#;
    let (start, end) = (JSON.find("\"scene\": 0").unwrap(), JSON.find("\"materials\"").unwrap());
    let json = format!("{}{nodes}{cameras}{}", &JSON[..start], &JSON[end..]);
    let scene = read(&glb(&json), no_files).unwrap().into_scene("").unwrap();
    let names: Vec<&str> = scene.cameras.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["top", "side", "top 2", "camera 0", "top 3"]);
    assert_eq!((scene.camera, scene.camera.aspect), (scene.cameras[0].1, Some(1.5)));
    let camera = |text: &str| crate::CameraPath::parse(text, &scene).map(|path| path.camera(5));
    assert_eq!(camera("file:top 2").unwrap(), scene.cameras[2].1);
    assert_eq!(camera("file:side").unwrap().fov_y, 0.75);
    assert_eq!(
        camera("file:back").unwrap_err().to_string(),
        "camera path `file:back`: the scene's cameras are top, side, top 2, camera 0, top 3"
    );
}

#[test]
fn no_damaged_byte_panics() {
    let file = glb(JSON);
    for at in 0..file.len() {
        for damage in [0, b'9', b'-', 0xff] {
            let mut damaged = file.clone();
            damaged[at] = damage;
            let _ = read(&damaged, no_files).map(|model| model.into_scene("damaged").is_ok());
        }
    }
}

#[test]
fn embedded_and_external_buffers() {
    let zeros = "A".repeat(48);
    let uri = format!(
        r#""buffers": [{{"uri": "data:application/octet-stream;base64,{zeros}", "byteLength": 36}}]"#
    );
    let embedded = JSON.replace(r#""buffers": [{"byteLength": 36}]"#, &uri);
    assert!(read(embedded.as_bytes(), no_files).is_ok());
    let external = JSON.replace(r#"[{"byteLength": 36}]"#, r#"[{"byteLength": 36, "uri": "a%20b.bin"}]"#);
    let files = |name: &str| if name == "a b.bin" { Ok(vec![0; 36]) } else { no_files(name) };
    assert!(read(external.as_bytes(), files).is_ok());
}

/// Number of vertices in [`vertices`]: more than 16 bits can count.
const VERTICES: u32 = 0x1_0300;

/// A buffer of positions (i, 2 i, 3 i) and normals (0, i, 0), each pair followed by four bytes of something else,
/// and the indices.
fn vertices(indices: &[u8]) -> Vec<u8> {
    let vertex = |i: u32| {
        let i = i as f32;
        [i, 2.0 * i, 3.0 * i, 0.0, i, 0.0, f32::NAN].map(f32::to_le_bytes).concat()
    };
    (0..VERTICES).flat_map(vertex).chain(indices.iter().copied()).collect()
}

/// The shapes of a file with one primitive: members of its JSON object, bytes of its indices, and the JSON of their
/// accessor.
fn shapes(primitive: &str, indices: &[u8], accessor: &str, count: u32) -> Vec<Shape> {
    let buffer = vertices(indices);
    let (stride, first) = (28, 28 * VERTICES);
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "NORMAL": 1}}{primitive}}}]}}],
        "accessors": [
            {{"bufferView": 0, "componentType": 5126, "count": {count}, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 2, 3]}},
            {{"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": {count}, "type": "VEC3"}},
            {{"bufferView": 1, "byteOffset": 4, "type": "SCALAR", {accessor}}}],
        "bufferViews": [
            {{"buffer": 0, "byteLength": {first}, "byteStride": {stride}}},
            {{"buffer": 0, "byteOffset": {}, "byteLength": {}}}],
        "buffers": [{{"byteLength": {}, "uri": "a.bin"}}]}}"#,
        first - 4,
        indices.len() + 4,
        buffer.len(),
    );
    let model = read(json.as_bytes(), |_| Ok(buffer.clone())).unwrap();
    model.parts.into_iter().map(|(shape, _)| shape).collect()
}

/// What the program itself writes of parts that repeat.
#[test]
fn instances_of_our_own_files() {
    use epigraph_streams::repeats::{Settings, Surface, find};
    let wedge = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from);
    let copy = |angle, by: Vec3| wedge.map(|at| Quat::from_rotation_y(angle) * at + by);
    let positions = [wedge, copy(1.0, Vec3::X * 9.0), copy(-2.0, Vec3::Y * 9.0)].concat();
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let of_part = |part: u32| faces.map(|corners| corners.map(|corner: u32| corner + 4 * part));
    let triangles: Vec<[u32; 3]> = (0..3).flat_map(of_part).collect();
    let surface = Surface { positions: &positions, triangles: &triangles, ..Surface::default() };
    let found = find(&surface, &Settings::default()).unwrap();
    let model = read(&found.repeats.to_glb(&[]).unwrap(), |_| unreachable!()).unwrap();
    assert_eq!(model.parts.len(), 3);
    for (part, (shape, _)) in model.parts.iter().enumerate() {
        let expected = &positions[4 * part..][..4];
        assert_eq!((shape.positions.len(), shape.triangles.len()), (4, 4));
        for at in expected {
            assert!(shape.positions.iter().any(|found| found.distance(*at) < 1e-4), "{part}: {at}");
        }
    }
}

/// A triangle at places whose numbers are after its vertices. `attributes` and `accessors` describe them.
fn instanced(numbers: &[u8], attributes: &str, accessors: &str) -> Result<Vec<Shape>, String> {
    let corners: Vec<u8> =
        [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0].into_iter().flat_map(f32::to_le_bytes).collect();
    let buffer = [&corners, numbers].concat();
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "extensionsRequired": ["{INSTANCING}"],
        "nodes": [{{"mesh": 0, "translation": [0, 0, 5],
            "extensions": {{"{INSTANCING}": {{"attributes": {{{attributes}}}}}}}}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
        "accessors": [
            {{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 2, 0]}}
            {accessors}],
        "bufferViews": [
            {{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": {}}}],
        "buffers": [{{"byteLength": {}, "uri": "a.bin"}}]}}"#,
        numbers.len(),
        buffer.len(),
    );
    let model = read(json.as_bytes(), |_| Ok(buffer.clone()))?;
    Ok(model.parts.into_iter().map(|(shape, _)| shape).collect())
}

#[test]
fn instances_are_scaled_turned_and_moved_in_this_order() {
    // A quarter turn around z as shorts, then twice the size, then a step along x.
    let half = (32767.0 * 0.5f32.sqrt()).round() as i16;
    let rotation: Vec<u8> = [0, 0, half, half].into_iter().flat_map(i16::to_le_bytes).collect();
    let floats = |all: &[f32]| all.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let numbers = [rotation, floats(&[2.0, 2.0, 2.0]), floats(&[10.0, 0.0, 0.0])].concat();
    let shapes = instanced(
        &numbers,
        r#""ROTATION": 1, "SCALE": 2, "TRANSLATION": 3"#,
        r#", {"bufferView": 1, "componentType": 5122, "normalized": true, "count": 1, "type": "VEC4"},
           {"bufferView": 1, "byteOffset": 8, "componentType": 5126, "count": 1, "type": "VEC3"},
           {"bufferView": 1, "byteOffset": 20, "componentType": 5126, "count": 1, "type": "VEC3"}"#,
    )
    .unwrap();
    let expected = [[10.0, 0.0, 5.0], [10.0, 2.0, 5.0], [6.0, 0.0, 5.0]].map(Vec3::from);
    assert_eq!(shapes.len(), 1);
    assert!(
        shapes[0].positions.iter().zip(expected).all(|(found, at)| found.distance(at) < 1e-4),
        "{shapes:?}"
    );
}

#[test]
fn instances_that_do_not_fit_are_errors() {
    let two = r#", {"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5126, "count": 1, "type": "VEC4"},
        {"bufferView": 1, "componentType": 5126, "count": 9, "type": "VEC3"}"#;
    let ones: Vec<u8> = [1.0f32; 6].into_iter().flat_map(f32::to_le_bytes).collect();
    for (attributes, expected) in [
        (r#""TRANSLATION": 1, "ROTATION": 2"#, "different numbers"),
        (r#""TRANSLATION": 4"#, "TRANSLATION refers to accessor 4, which does not exist"),
        (r#""TRANSLATION": 7"#, "accessor 7, which does not exist"),
        (r#""TRANSLATION": -1"#, "accessor -1, which does not exist"),
        (r#""TRANSLATION": 3"#, "reaches beyond its buffer"),
        (r#""ROTATION": 1"#, "four floats, or normalized signed bytes or shorts"),
        ("", "no TRANSLATION, ROTATION or SCALE"),
    ] {
        let error = instanced(&ones, attributes, two).unwrap_err();
        assert!(error.contains("node 0, EXT_mesh_gpu_instancing") && error.contains(expected), "{error}");
    }
    let none = instanced(&[0; 24], r#""ROTATION": 2"#, two).unwrap_err();
    assert!(none.contains("rotation 0 is [0, 0, 0, 0], which is no direction"), "{none}");
    assert_eq!(instanced(&ones, r#""SCALE": 1"#, two).unwrap().len(), 2);
}

/// Triangles that begin with their lowest vertex.
fn turned(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let lowest_first = |t: &[u32; 3]| {
        let lowest = (0..3).min_by_key(|&corner| t[corner]).unwrap_or(0);
        [0, 1, 2].map(|corner| t[(lowest + corner) % 3])
    };
    triangles.iter().map(lowest_first).collect()
}

#[test]
fn triangles_strips_and_fans() {
    let strip = [[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]];
    let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
    let list = [[0, 1, 2], [3, 4, 5]];
    for (mode, count, expected) in [
        ("", 6, &list[..]),
        (r#", "mode": 4"#, 6, &list),
        (r#", "mode": 4"#, 8, &list),
        (r#", "mode": 4"#, 5, &list[..1]),
        (r#", "mode": 5"#, 6, &strip),
        (r#", "mode": 5"#, 3, &strip[..1]),
        (r#", "mode": 5"#, 2, &[]),
        (r#", "mode": 6"#, 6, &fan),
        (r#", "mode": 6"#, 3, &fan[..1]),
        (r#", "mode": 6"#, 1, &[]),
    ] {
        let shapes = shapes(mode, &[0; 8], r#""componentType": 5121, "count": 1"#, count);
        let [shape] = &shapes[..] else {
            assert!(expected.is_empty() && shapes.is_empty(), "{mode} of {count} vertices");
            continue;
        };
        assert_eq!(turned(&shape.triangles), expected, "{mode} of {count} vertices");
        assert_eq!(shape.positions.len(), count as usize);
    }
    for points_or_lines in 0..4 {
        let mode = format!(r#", "mode": {points_or_lines}"#);
        assert!(shapes(&mode, &[0; 8], r#""componentType": 5121, "count": 1"#, 6).is_empty());
    }
}

#[test]
fn vertices_are_found_by_indices_of_any_type() {
    let bytes = |list: &[u32], size: usize| -> Vec<u8> {
        list.iter().flat_map(|index| index.to_le_bytes()[..size].to_vec()).collect()
    };
    for (kind, size, list) in [
        (5121, 1, [0xFE, 3, 2]),
        (5123, 2, [0xFFFE, 0x0102, 0x0201]),
        (5125, 4, [0x1_0203, 0x0102, 0x1_0001]),
    ] {
        let accessor = format!(r#""componentType": {kind}, "count": 3"#);
        let [shape] = &shapes(r#", "indices": 2"#, &bytes(&list, size), &accessor, VERTICES)[..] else {
            panic!("one primitive, one shape")
        };
        assert_eq!(shape.triangles, [list]);
        let at = |index: u32| shape.positions[index as usize];
        assert!(list.iter().all(|&i| at(i) == i as f32 * Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!(shape.normals, [[Vec3::Y; 3]]);
    }
}

#[test]
fn the_default_scene_or_the_first_or_all_nodes() {
    // Node 1 is a child of node 0. Each node's mesh is one triangle at the place of the node.
    let nodes = r#""nodes": [
        {"mesh": 0, "translation": [10, 0, 0], "children": [1]},
        {"mesh": 0, "matrix": [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 1, 0, 0, 5, 0, 1]},
        {"mesh": 0, "rotation": [0, 0, 1, 0]}],"#;
    let start = JSON.find("\"scene\": 0").unwrap();
    let end = JSON.find("\"cameras\"").unwrap();
    let (parent, child, other) =
        (Vec3::new(12.0, 0.0, 0.0), Vec3::new(10.0, 9.0, 0.0), Vec3::new(-2.0, 0.0, 0.0));
    for (scenes, expected) in [
        (r#""scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [2]}],"#, &[other][..]),
        (r#""scenes": [{"nodes": [0]}, {"nodes": [2]}],"#, &[parent, child]),
        (r#""scenes": [{"nodes": [2, 0]}],"#, &[other, parent, child]),
        ("", &[parent, child, other]),
    ] {
        let json = format!("{}{scenes}{nodes}{}", &JSON[..start], &JSON[end..]);
        let model = read(&glb(&json), no_files).unwrap();
        // The second vertex is at x = 2.
        let found: Vec<Vec3> = model.parts.iter().map(|(shape, _)| shape.positions[1]).collect();
        let near = found.iter().zip(expected).all(|(a, b)| a.distance(*b) < 1e-5);
        assert!(near && found.len() == expected.len(), "{scenes}: {found:?}");
    }
}

#[test]
fn metals_and_dielectrics() {
    let of = |members: &str| {
        let from = r#""pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0}"#;
        assert!(JSON.contains(from));
        let model = read(&glb(&JSON.replacen(from, members, 1)), no_files).unwrap();
        model.materials[0].clone()
    };
    for (metallic, roughness) in [(0.0, 1.0), (0.0, 0.25), (1.0, 0.0), (1.0, 0.5), (0.5, 0.75)] {
        let factors = format!(r#""metallicFactor": {metallic}, "roughnessFactor": {roughness}"#);
        let found =
            of(&format!(r#""pbrMetallicRoughness": {{"baseColorFactor": [0.5, 0.8, 0.2, 1], {factors}}}"#));
        assert_eq!((found.metallic, found.roughness), (metallic, roughness));
        assert!((found.f0 - DIELECTRIC_F0).abs() < 1e-6);
        assert_eq!(found.color, Vec3::new(0.5, 0.8, 0.2));
    }
    let emissive = r#""emissiveFactor": [1, 0.5, 0]"#;
    let strong = r#""extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}"#;
    assert_eq!(of(emissive).emission, Vec3::new(1.0, 0.5, 0.0));
    assert_eq!(of(&format!("{emissive}, {strong}")).emission, Vec3::new(8.0, 4.0, 0.0));
}

/// A file in the making: its buffer and accessors.
#[derive(Default)]
pub(super) struct Making {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Making {
    /// Adds a buffer view and gives its index.
    pub(super) fn view(&mut self, bytes: &[u8], members: &str) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0xFF);
        let (offset, length) = (self.bytes.len(), bytes.len());
        self.views
            .push(format!(r#"{{"buffer": 0, "byteOffset": {offset}, "byteLength": {length}{members}}}"#));
        self.bytes.extend(bytes);
        self.views.len() - 1
    }

    /// Adds an accessor with the given members and gives its index.
    pub(super) fn accessor(&mut self, members: impl Into<String>) -> usize {
        self.accessors.push(members.into());
        self.accessors.len() - 1
    }

    /// Adds an accessor of floats.
    pub(super) fn floats(&mut self, kind: &str, count: usize, numbers: &[f32]) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let view = self.view(&bytes, "");
        self.accessor(format!(
            r#""bufferView": {view}, "componentType": 5126, "count": {count}, "type": "{kind}""#
        ))
    }

    /// The file with the other members of its JSON.
    pub(super) fn file(&self, rest: &str) -> Vec<u8> {
        let accessors: Vec<String> = self.accessors.iter().map(|members| format!("{{{members}}}")).collect();
        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, {rest}, "accessors": [{}], "bufferViews": [{}],
            "buffers": [{{"byteLength": {}}}]}}"#,
            accessors.join(", "),
            self.views.join(", "),
            self.bytes.len()
        );
        let json = json.as_bytes();
        let mut file = b"glTF".to_vec();
        file.extend(
            [2, (28 + json.len() + self.bytes.len()) as u32, json.len() as u32]
                .map(u32::to_le_bytes)
                .concat(),
        );
        file.extend(b"JSON");
        file.extend(json);
        file.extend((self.bytes.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(&self.bytes);
        file
    }

    fn model(&self, rest: &str) -> Model {
        read(&self.file(rest), no_files).unwrap()
    }
}

/// The corners of a triangle in the plane z = 0.
pub(super) const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 2.0, 0.0];

/// One node with a mesh of one primitive of these members.
fn one(primitive: &str) -> String {
    format!(r#""nodes": [{{"mesh": 0}}], "meshes": [{{"name": "wedge", "primitives": [{{{primitive}}}]}}]"#)
}

fn near(found: &[Vec3], expected: &[[f32; 3]]) {
    let all_near = found.iter().zip(expected).all(|(a, b)| a.distance(Vec3::from(*b)) < 1e-5);
    assert!(all_near && found.len() == expected.len(), "{found:?} instead of {expected:?}");
}

#[test]
fn sparse_accessors_change_some_elements_or_zeros() {
    let mut making = Making::default();
    let whole = making.view(&TRIANGLE.map(f32::to_le_bytes).concat(), "");
    let places = making.view(&[9, 9, 1, 2], "");
    let values = making.view(&[5.0, 0.0, 1.0, 0.0, 6.0, 1.0_f32].map(f32::to_le_bytes).concat(), "");
    let sparse = |count: usize, offset: usize| {
        format!(
            r#""sparse": {{"count": {count}, "indices": {{"bufferView": {places}, "byteOffset": {offset},
            "componentType": 5121}}, "values": {{"bufferView": {values}}}}}"#
        )
    };
    let positions = |view: &str, sparse: &str| {
        let mut making =
            Making { bytes: making.bytes.clone(), views: making.views.clone(), accessors: vec![] };
        making.accessor(format!(r#"{view}"componentType": 5126, "count": 3, "type": "VEC3", {sparse}"#));
        read(&making.file(&one(r#""attributes": {"POSITION": 0}"#)), no_files)
            .map(|model| model.parts[0].0.positions.clone())
    };
    let base = format!(r#""bufferView": {whole}, "#);
    near(&positions(&base, &sparse(2, 2)).unwrap(), &[[0.0; 3], [5.0, 0.0, 1.0], [0.0, 6.0, 1.0]]);
    near(&positions(&base, &sparse(1, 3)).unwrap(), &[[0.0; 3], [4.0, 0.0, 0.0], [5.0, 0.0, 1.0]]);
    near(&positions("", &sparse(2, 2)).unwrap(), &[[0.0; 3], [5.0, 0.0, 1.0], [0.0, 6.0, 1.0]]);
    for (sparse, expected) in [
        (sparse(1, 0), "accessor 0: element 9 of 3 changes"),
        (sparse(4, 0), "accessor 0: more elements change than it has"),
        (sparse(2, 3), "accessor 0: it reaches beyond its buffer"),
    ] {
        let message = positions(&base, &sparse).unwrap_err();
        assert!(message.starts_with("mesh 0, primitive 0: ") && message.contains(expected), "{message}");
    }
}

#[test]
fn matrices_are_of_floats() {
    let of = |component: u32, kind: &str| {
        let mut making = Making::default();
        let view = making.view(&[0; 256], "");
        making.accessor(format!(
            r#""bufferView": {view}, "componentType": {component}, "count": 3, "type": "{kind}""#
        ));
        read(&making.file(&one(r#""attributes": {"POSITION": 0}"#)), no_files).unwrap_err()
    };
    for (component, kind) in [(5121, "MAT2"), (5123, "MAT3")] {
        assert!(of(component, kind).contains("of whole numbers, which nothing here has"), "{kind}");
    }
    for (component, kind) in [(5126, "MAT2"), (5126, "MAT3"), (5121, "MAT4")] {
        assert!(!of(component, kind).contains("of whole numbers, which nothing here has"), "{kind}");
    }
}

#[test]
fn quantized_positions_and_normals_are_scaled_where_they_are_normalized() {
    let bytes = |size: usize, numbers: &[i32]| -> Vec<u8> {
        numbers.iter().flat_map(|number| number.to_le_bytes()[..size].to_vec()).collect()
    };
    for (component, size, largest) in [(5120, 1, 127), (5121, 1, 255), (5122, 2, 32767), (5123, 2, 65535)] {
        for normalized in [false, true] {
            let mut making = Making::default();
            // Four bytes a vertex of bytes, eight of shorts.
            let corners = [0, 0, 0, 7, largest, 0, 0, 7, 0, largest / 2, 0, 7];
            let view = making.view(&bytes(size, &corners), &format!(r#", "byteStride": {}"#, 4 * size));
            let up = making.view(&bytes(1, &[0, 0, 127, 0].repeat(3)), r#", "byteStride": 4"#);
            making.accessor(format!(
                r#""bufferView": {view}, "componentType": {component}, "normalized": {normalized}, "count": 3,
                "type": "VEC3""#
            ));
            making.accessor(format!(
                r#""bufferView": {up}, "componentType": 5120, "normalized": true, "count": 3, "type": "VEC3""#
            ));
            let rest = one(r#""attributes": {"POSITION": 0, "NORMAL": 1}"#);
            let model = making.model(&format!(r#""extensionsRequired": ["KHR_mesh_quantization"], {rest}"#));
            let unit = if normalized { largest as f32 } else { 1.0 };
            let expected =
                [[0.0; 3], [largest as f32 / unit, 0.0, 0.0], [0.0, (largest / 2) as f32 / unit, 0.0]];
            near(&model.parts[0].0.positions, &expected);
            assert_eq!(model.parts[0].0.normals, [[Vec3::Z; 3]]);
            assert!(model.report.is_empty(), "{:?}", model.report);
        }
    }
    // The most negative number of a signed type is -1 too.
    let mut making = Making::default();
    let view = making.view(&[128, 127, 129, 0], "");
    making.accessor(format!(
        r#""bufferView": {view}, "componentType": 5120, "normalized": true, "count": 1, "type": "VEC3""#
    ));
    let file = making.file(r#""nodes": []"#);
    assert_eq!(Container::open(&file, &no_files).unwrap().vectors::<3>(0), Ok(vec![[-1.0, 1.0, -1.0]]));
}

#[test]
fn a_skinned_mesh_is_where_its_joints_are() {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    making.floats("VEC3", 3, &[0.0, 0.0, 1.0].repeat(3));
    // Those without weight may be any number.
    let joints = making.view(&[9, 9, 9, 9, 1, 9, 9, 9, 0, 1, 9, 9], "");
    making.accessor(format!(r#""bufferView": {joints}, "componentType": 5121, "count": 3, "type": "VEC4""#));
    // The third corner is moved by both, in weights that add up to less than 1; the first by none.
    making.floats("VEC4", 3, &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.25, 0.25, 0.0, 0.0]);
    let moved = |x: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0];
    making.floats("MAT4", 2, &[moved(0.0), moved(-1.0)].concat());
    let rest = |skin: &str, attributes: &str| {
        format!(
            r#""nodes": [
                {{"mesh": 0, "skin": 0, "translation": [0, 0, 77], "scale": [9, 9, 9]}},
                {{"translation": [10, 0, 0], "children": [2]}},
                {{"scale": [2, 2, 2], "translation": [0, 0, 1]}}],
            "skins": [{{{skin}}}],
            "meshes": [{{"name": "wedge", "primitives": [{{"attributes": {{"POSITION": 0{attributes}}}}}]}}]"#
        )
    };
    let (skin, attributes) =
        (r#""joints": [1, 2], "inverseBindMatrices": 4"#, r#", "NORMAL": 1, "JOINTS_0": 2, "WEIGHTS_0": 3"#);
    let model = making.model(&rest(skin, attributes));
    // Joint 0 moves by 10 along x. Joint 1 takes 1 off x, doubles, and moves by (10, 0, 1).
    near(&model.parts[0].0.positions, &[[10.0, 0.0, 0.0], [16.0, 0.0, 1.0], [9.0, 3.0, 0.5]]);
    assert!(model.parts[0].0.normals[0].iter().all(|normal| normal.distance(Vec3::Z) < 1e-6));
    assert!(model.report.is_empty(), "{:?}", model.report);
    // Without matrices, the joints' own.
    let model = making.model(&rest(r#""joints": [1, 2]"#, attributes));
    near(&model.parts[0].0.positions, &[[10.0, 0.0, 0.0], [18.0, 0.0, 1.0], [10.0, 3.0, 0.5]]);
    // What does not fit is left out, and the mesh is where its node is.
    for (skin, attributes, expected) in [
        (r#""joints": [1]"#, attributes, "the skin of a primitive: joint 1 of 1 (wedge)"),
        (skin, r#", "JOINTS_0": 2"#, "the skin of a primitive: it has no joints for each vertex (wedge)"),
        (r#""joints": [9]"#, attributes, "a skin: joint 9 does not exist (node 0)"),
        (r#""joints": []"#, attributes, "a skin: it has no joints (node 0)"),
        (
            r#""joints": [1, 2, 0], "inverseBindMatrices": 4"#,
            attributes,
            "a skin: it has 3 joints, but 2 matrices for them (node 0)",
        ),
    ] {
        let model = making.model(&rest(skin, attributes));
        assert_eq!(notes(&model), [format!("left out: {expected}")]);
        near(&model.parts[0].0.positions, &[[0.0, 0.0, 77.0], [36.0, 0.0, 77.0], [0.0, 18.0, 77.0]]);
    }
}

#[test]
fn joints_that_mirror_turn_triangles() {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    let joints = making.view(&[0; 12], "");
    making.accessor(format!(r#""bufferView": {joints}, "componentType": 5121, "count": 3, "type": "VEC4""#));
    making.floats("VEC4", 3, &[1.0, 0.0, 0.0, 0.0].repeat(3));
    let model = making.model(
        r#""nodes": [{"mesh": 0, "skin": 0}, {"scale": [-1, 1, 1]}], "skins": [{"joints": [1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}]}]"#,
    );
    let shape = &model.parts[0].0;
    let [a, b, c] = shape.triangles[0].map(|vertex| shape.positions[vertex as usize]);
    assert!((b - a).cross(c - a).z > 0.0);
}

#[test]
fn morph_targets_have_the_weights_of_the_node_or_the_mesh() {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    making.floats("VEC3", 3, &[0.0, 0.0, 1.0].repeat(3));
    making.floats("VEC3", 3, &[0.0, 0.0, 8.0, 0.0, 0.0, 8.0, 0.0, 0.0, 8.0]);
    making.floats("VEC3", 3, &[1.0, 0.0, 0.0].repeat(3));
    for (node, mesh, height) in [
        ("", "", 0.0),
        ("", r#", "weights": [0, 0.5]"#, 4.0),
        ("", r#", "weights": [0, 1]"#, 8.0),
        (r#", "weights": [0, 0.25]"#, r#", "weights": [0, 0.5]"#, 2.0),
        (r#", "weights": []"#, r#", "weights": [0, 0.5]"#, 0.0),
        ("", r#", "weights": [0.5]"#, 0.0),
    ] {
        let model = making.model(&format!(
            r#""nodes": [{{"mesh": 0{node}}}], "meshes": [{{"primitives": [{{
                "attributes": {{"POSITION": 0, "NORMAL": 1}},
                "targets": [{{"NORMAL": 3}}, {{"POSITION": 2}}]}}]{mesh}}}]"#
        ));
        let shape = &model.parts[0].0;
        near(&shape.positions, &[[0.0, 0.0, height], [4.0, 0.0, height], [0.0, 2.0, height]]);
        let turned = mesh.contains("[0.5]");
        let expected = if turned { Vec3::new(0.5, 0.0, 1.0).normalize() } else { Vec3::Z };
        assert!(shape.normals[0].iter().all(|normal| normal.distance(expected) < 1e-6));
    }
}

#[test]
fn what_is_not_a_number_is_left_out_or_repaired() {
    let nan = f32::NAN;
    let mut making = Making::default();
    // The last vertex belongs to no triangle.
    let corners = [TRIANGLE.as_slice(), &[nan, 0.0, 0.0], &[1.0, f32::INFINITY, 0.0]].concat();
    making.floats("VEC3", 5, &corners);
    making.floats("VEC3", 5, &[0.0, 0.0, 1.0, nan, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    let indices = making.view(&[0, 1, 2, 0, 1, 3, 2, 0, 1], "");
    making
        .accessor(format!(r#""bufferView": {indices}, "componentType": 5121, "count": 9, "type": "SCALAR""#));
    let model = making.model(&one(r#""attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2"#));
    let shape = &model.parts[0].0;
    assert_eq!(shape.triangles, [[0, 1, 2], [2, 0, 1]]);
    assert_eq!(shape.normals, [[Vec3::Z, Vec3::ZERO, Vec3::ZERO], [Vec3::ZERO, Vec3::Z, Vec3::ZERO]]);
    assert_eq!(shape.bounds(), [Vec3::ZERO, Vec3::new(4.0, 2.0, 0.0)]);
    assert_eq!(
        notes(&model),
        [
            "left out: a triangle with a corner that is not a number (wedge)",
            "repaired: a triangle with a normal that is no direction, 2 times (wedge)"
        ]
    );
    let scene = model.into_scene("").unwrap();
    assert_eq!(scene.mesh.corner_normals[0], [Vec3::Z; 3], "flat where there is no direction");
}

#[test]
fn primitives_without_triangles_are_named() {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    making.accessor(r#""componentType": 5121, "count": 0, "type": "SCALAR""#);
    let good = r#"{"attributes": {"POSITION": 0}}"#;
    for (primitive, expected) in [
        (r#""attributes": {"POSITION": 0}, "mode": 0"#, "points"),
        (r#""attributes": {"POSITION": 0}, "mode": 1"#, "lines"),
        (r#""attributes": {"POSITION": 0}, "mode": 3"#, "lines"),
        (r#""attributes": {"POSITION": 0}, "mode": 7"#, "a primitive of an unknown kind"),
        (r#""attributes": {"NORMAL": 0}"#, "a primitive without positions"),
        (r#""attributes": {"POSITION": 0}, "indices": 1"#, "a primitive without triangles"),
        (r#""attributes": {"POSITION": 1}"#, "a primitive without triangles"),
    ] {
        let model = making.model(&format!(
            r#""nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{{{primitive}}}, {good}]}}]"#
        ));
        assert_eq!((model.parts.len(), notes(&model)), (1, vec![format!("left out: {expected} (mesh 0)")]));
    }
    let message = read(
        &making.file(&one(&format!(
            r#""attributes": {{"POSITION": 1}}, "extensions": {{"{}": {{}}}}"#,
            primitives::DRACO
        ))),
        no_files,
    )
    .unwrap_err();
    assert!(
        message.contains("it is compressed with KHR_draco_mesh_compression, which is not read"),
        "{message}"
    );
    // With a fallback it is read.
    let model = making.model(&one(&format!(
        r#""attributes": {{"POSITION": 0}}, "extensions": {{"{}": {{}}}}"#,
        primitives::DRACO
    )));
    assert_eq!((model.parts.len(), notes(&model).len()), (1, 0));
}

#[test]
fn unknown_extensions_are_named_with_what_has_them() {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    let model = making.model(
        r#""extensionsUsed": ["EXT_a", "EXT_b", "EXT_e"], "extensionsRequired": ["EXT_b", "KHR_mesh_quantization"],
        "nodes": [{"mesh": 0, "name": "hall", "extensions": {"EXT_a": {}}}, {"extensions": {"EXT_a": 1}}],
        "materials": [{"extensions": {"EXT_d": {}}}, {"name": "wood", "extensions": {"EXT_b": {}, "EXT_c": 3}}],
        "animations": [{"name": "walk"}, {}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0}, "material": 1, "extensions": {"EXT_c": {}}}]}]"#,
    );
    assert_eq!(
        notes(&model),
        [
            "left out: the extension EXT_c, 2 times (mesh 0, wood)",
            "left out: the extension EXT_a, 2 times (hall, node 1)",
            "left out: the extension EXT_b (wood)",
            "left out: the extension EXT_e",
            "left out: an animation, 2 times (walk)",
        ]
    );
}

#[test]
fn hidden_nodes_are_not_shown() {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    let hidden = r#""extensions": {"KHR_node_visibility": {"visible": false}}"#;
    let model = making.model(&format!(
        r#""nodes": [{{"children": [1], {hidden}}}, {{"mesh": 0}}, {{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}]"#
    ));
    assert_eq!(model.parts.len(), 1);
}

#[test]
fn a_box_around_turned_pieces_holds_all_their_corners() {
    let positions = vec![Vec3::new(1.0, 2.0, 4.0), Vec3::new(-1.0, -3.0, -5.0), Vec3::new(0.0, 0.0, 6.0)];
    // The last vertex is not used.
    let positions = [positions, vec![Vec3::splat(100.0)]].concat();
    let shape = Arc::new(Shape { positions, triangles: vec![[0, 1, 2]], ..Shape::default() });
    let quarter = std::f64::consts::FRAC_PI_2;
    for (turn, low, high) in [
        (DAffine3::IDENTITY, [-1.0, -3.0, -5.0], [1.0, 2.0, 6.0]),
        (DAffine3::from_rotation_x(quarter), [-1.0, -6.0, -3.0], [1.0, 5.0, 2.0]),
        (DAffine3::from_rotation_y(quarter), [-5.0, -3.0, -1.0], [6.0, 2.0, 1.0]),
        (DAffine3::from_rotation_z(quarter), [-2.0, -1.0, -5.0], [3.0, 1.0, 6.0]),
    ] {
        let [far, here] = [1e6, 0.0].map(|x| DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)) * turn);
        let piece = |world| Piece { shape: shape.clone(), material: None, world };
        let found = bounds(&[piece(here)]);
        for (found, expected) in found.into_iter().zip([low, high]) {
            assert!(found.distance(expected.into()) < 1e-9, "{found} instead of {expected:?}");
        }
        let [_, end] = bounds(&[piece(here), piece(far)]);
        assert!((end.x - 1e6 - high[0]).abs() < 1e-6, "{end}");
    }
}

#[test]
fn a_box_around_turned_pieces_holds_each_of_its_corners() {
    let shape = Shape::cuboid(Vec3::splat(-1.0), Vec3::ONE);
    let shape = Arc::new(shape);
    // Each corner in turn is the highest.
    for corner in 0..8 {
        let axis = DVec3::from([0, 1, 2].map(|bit| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 }));
        let world = DAffine3::from_quat(glam::DQuat::from_rotation_arc(axis.normalize(), DVec3::Y));
        let [low, high] = bounds(&[Piece { shape: shape.clone(), material: None, world }]);
        let expected = 3_f64.sqrt();
        assert!((high.y - expected).abs() < 1e-9 && (low.y + expected).abs() < 1e-9, "{axis}: {low} {high}");
    }
}

#[test]
fn a_mesh_that_stands_still_is_made_once() {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    let joints = making.view(&[0; 12], "");
    making.accessor(format!(r#""bufferView": {joints}, "componentType": 5121, "count": 3, "type": "VEC4""#));
    making.floats("VEC4", 3, &[1.0, 0.0, 0.0, 0.0].repeat(3));
    let bytes = making.file(
        r#""nodes": [{"translation": [0, 0, 5]}], "skins": [{"joints": [0]}], "meshes": [{"weights": [1],
            "primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2},
                "targets": [{"POSITION": 0}]}]}]"#,
    );
    let file = Container::open(&bytes, &no_files).unwrap();
    let tree = Tree::of(&file.root).unwrap();
    let skin = Joints::of(&file, &tree, 0).unwrap();
    let mut reader = Reader::new(&file, &tree);
    let corner = |shapes: &Shapes| (shapes[0].0.shape.positions[1].x, shapes[0].0.skinned);
    // Whatever others were made before, and in between.
    for _ in 0..2 {
        let moved = reader.mesh(0, Some(&[0.5]), None, 1).unwrap();
        let skinned = reader.mesh(0, None, Some(&skin), 1).unwrap();
        let both = reader.mesh(0, Some(&[0.0]), Some(&skin), 1).unwrap();
        let still = [(); 2].map(|()| reader.mesh(0, None, None, 1).unwrap());
        assert_eq!([&moved, &skinned, &both].map(corner), [(6.0, false), (8.0, true), (4.0, true)]);
        assert_eq!(corner(&still[0]), (8.0, false));
        assert!(Arc::ptr_eq(&still[0], &still[1]));
    }
}

#[test]
fn places_far_out_keep_double_precision() {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    let meshes = r#""meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]"#;
    let turned = r#""rotation": [0.7071067811865476, 0, 0, 0.7071067811865476]"#;
    let model = making.model(&format!(
        r#""nodes": [
            {{"translation": [691234.125, 312.0, -5334567.25], "children": [1, 2, 3]}},
            {{"mesh": 0, {turned}, "translation": [0.03, 0, 0]}},
            {{"translation": [0, 3.07, 0], "extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}},
            {{"translation": [0.01, 0, 9], "camera": 0}}],
        "extensions": {{"KHR_lights_punctual": {{"lights": [{{"type": "point"}}]}}}},
        "cameras": [{{"type": "perspective", "perspective": {{"yfov": 1, "znear": 0.1}}}}], {meshes}"#
    ));
    let at = |place: Vec3| (model.origin + place.as_dvec3()) - DVec3::new(691_234.125, 312.0, -5_334_567.25);
    let close = |found: DVec3, expected: [f64; 3]| assert!(found.distance(expected.into()) < 1e-6, "{found}");
    close(at(model.parts[0].0.positions[0]), [0.03, 0.0, 0.0]);
    close(at(model.parts[0].0.positions[2]), [0.03, 0.0, 2.0]);
    let [Light::Point { position, .. }] = model.lights[..] else { panic!("{:?}", model.lights) };
    close(at(position), [0.0, 3.07, 0.0]);
    close(at(model.camera.unwrap().eye), [0.01, 0.0, 9.0]);
}

/// A PNG file of 2 x 1 texels, opaque red and half transparent blue.
fn png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(vec![]);
    let texel = |x, _| image::Rgba(if x == 0 { [255, 0, 0, 255] } else { [0, 0, 188, 128] });
    let texels = image::RgbaImage::from_fn(2, 1, texel);
    texels.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// A model of one triangle with texture coordinates 0, 1 and 2, whose image is that of [`png`] in the file.
pub(super) fn textured(material: &str, textures: &str) -> Model {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    for set in 0..3 {
        let set = set as f32;
        making.floats("VEC2", 3, &[set, 0.0, set, 1.0, 0.5, set]);
    }
    let image = making.view(&png(), "");
    making.model(&format!(
        r#""materials": [{{"name": "paint", {material}}}], {textures},
        "images": [{{"bufferView": {image}, "name": "checks", "mimeType": "image/png"}}],
        "nodes": [{{"mesh": 0}}],
        "meshes": [{{"name": "wedge", "primitives": [{{"material": 0, "attributes": {{
            "POSITION": 0, "TEXCOORD_0": 1, "TEXCOORD_1": 2, "TEXCOORD_2": 3}}}}]}}]"#
    ))
}

pub(super) const TEXTURES: &str = r#""textures": [{"source": 0}]"#;

#[test]
fn images_are_in_the_file_or_beside_it() {
    let material = r#""materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
            "normalTexture": {"index": 0}, "emissiveTexture": {"index": 0}, "emissiveFactor": [1, 2, 3]}],
        "textures": [{"source": 0}]"#;
    let mesh = r#""nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"material": 0, "attributes": {"POSITION": 0, "TEXCOORD_0": 0}}]}]"#;
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let bits: Vec<u8> = png().iter().flat_map(|byte| (0..8).rev().map(move |bit| byte >> bit & 1)).collect();
    let six = |bits: &[u8]| bits.iter().fold(0, |all, bit| 2 * all + bit) << (6 - bits.len());
    let base64: String = bits.chunks(6).map(|bits| char::from(digits[usize::from(six(bits))])).collect();
    let files = |name: &str| if name == "my checks.png" { Ok(png()) } else { no_files(name) };
    let mesh = mesh.replace(r#", "TEXCOORD_0": 0"#, "");
    let load = |image: &str| {
        read(&making.file(&format!(r#"{material}, "images": [{image}], {mesh}"#)), files).unwrap()
    };
    for image in [
        r#"{"uri": "my%20checks.png"}"#.to_owned(),
        format!(r#"{{"uri": "data:image/png;base64,{base64}"}}"#),
    ] {
        let model = load(&image);
        let maps = model.materials[0].maps;
        let map = maps.color.unwrap();
        assert_eq!(model.textures[map.texture].texels, [[255, 0, 0, 255], [0, 0, 188, 128]]);
        assert_eq!((maps.normal, maps.emission), (Some((map, 1.0)), Some(map)));
        assert_eq!(model.materials[0].emission, Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(
            notes(&model),
            ["approximated: a texture where its mesh has no coordinates, by one texel (mesh 0)"]
        );
    }
    for (image, expected) in [
        (r#"{"uri": "gone.png"}"#, "an image: its file is missing or cannot be read (gone.png)"),
        (r#"{"uri": "data:image/png;base64,iVBO"}"#, "an image: it is not PNG, JPEG, WebP, BMP or TGA"),
        (r#"{"bufferView": 0}"#, "an image: it is not PNG, JPEG, WebP, BMP or TGA"),
        (r#"{"bufferView": 9, "name": "x"}"#, "an image: buffer view 9 does not exist (x)"),
        (r#"{"name": "x"}"#, "an image: it has no data (x)"),
        (r#"{"uri": 7}"#, "an image: it is not valid (image 0)"),
    ] {
        let model = load(image);
        assert!(model.materials[0].maps.is_empty() && model.textures.is_empty());
        assert_eq!(model.materials[0].emission, Vec3::ZERO, "what the image would show is not known");
        assert!(notes(&model)[1].contains(expected), "{image}: {:?}", notes(&model));
    }
}

#[test]
fn maps_have_their_channels_samplers_and_coordinates() {
    let textures = r#""textures": [{"source": 0, "sampler": 0}, {"source": 0}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]"#;
    let model = textured(
        r#""pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 2},
                "metallicRoughnessTexture": {"index": 1}},
            "normalTexture": {"index": 1, "scale": 0.5, "texCoord": 1, "extensions": {"KHR_texture_transform": {
                "offset": [0.5, 0.25], "rotation": 1.5707963267948966, "scale": [2, 4], "texCoord": 0}}},
            "emissiveTexture": {"index": 0, "texCoord": 2}, "emissiveFactor": [1, 2, 3], "alphaMode": "BLEND""#,
        textures,
    );
    assert!(model.report.is_empty(), "{:?}", model.report);
    let material = &model.materials[0];
    let maps = material.maps;
    let (color, mixed, (normal, scale)) = (maps.color.unwrap(), maps.metallic.unwrap(), maps.normal.unwrap());
    assert_eq!((color.wrap, color.nearest, color.channel), ([Wrap::Clamp, Wrap::Mirror], true, 0));
    assert_eq!((mixed.wrap, mixed.nearest, mixed.channel), ([Wrap::Repeat; 2], false, 2));
    assert_eq!((maps.roughness, maps.opacity), (Some(mixed.of_channel(1)), Some(color.of_channel(3))));
    assert_eq!((maps.emission, scale, maps.transmission), (Some(color), 0.5, None));
    assert_eq!(material.emission, Vec3::new(1.0, 2.0, 3.0));
    // The image is read once.
    assert_eq!((model.textures.len(), maps.all().map(|map| map.texture).max()), (1, Some(0)));
    // The two sets that are used are the mesh's two.
    let shape = &model.parts[0].0;
    assert_eq!(shape.uvs[color.uv_set], [[[2.0, 0.0], [2.0, 1.0], [0.5, 2.0]].map(Vec2::from)]);
    assert_eq!(shape.uvs[normal.uv_set], [[[0.0, 0.0], [0.0, 1.0], [0.5, 0.0]].map(Vec2::from)]);
    assert_eq!((mixed.uv_set, maps.emission.unwrap().uv_set), (normal.uv_set, color.uv_set));
    // Scaled, turned and moved in this order: one unit along v goes along u.
    let at = |u, v| normal.transform.transform_point2(Vec2::new(u, v));
    assert!(at(0.0, 0.0).distance(Vec2::new(0.5, 0.25)) < 1e-6);
    assert!(at(0.0, 1.0).distance(Vec2::new(4.5, 0.25)) < 1e-6);
    assert!(at(1.0, 0.0).distance(Vec2::new(0.5, -1.75)) < 1e-6);
}

#[test]
fn what_a_material_has_that_is_not_used_is_named() {
    let color = |info: &str| format!(r#""pbrMetallicRoughness": {{"baseColorTexture": {info}}}"#);
    for (material, textures, expected) in [
        (color(r#"{"index": 3}"#), TEXTURES, "left out: a base colour texture that does not exist (paint)"),
        (
            color(r#"{"index": 0}"#),
            r#""textures": [{}]"#,
            "left out: a base colour texture without an image (paint)",
        ),
        // There is one image.
        (
            color(r#"{"index": 0}"#),
            r#""textures": [{"source": 1}]"#,
            "left out: a base colour texture without an image (paint)",
        ),
        (
            color(r#"{"index": 0}"#),
            r#""textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]"#,
            "left out: a base colour texture in the format of KHR_texture_basisu, which is not read: convert it to PNG \
             or JPEG (paint)",
        ),
        (
            color(r#"{"index": 0}, "metallicRoughnessTexture": {"index": 0, "texCoord": 1}"#)
                + r#", "normalTexture": {"index": 0, "texCoord": 2}"#,
            TEXTURES,
            "left out: a normal texture with a third set of coordinates (paint)",
        ),
        (
            r#""occlusionTexture": {"index": 0}"#.to_owned(),
            TEXTURES,
            "left out: an occlusion texture, as light is traced (paint)",
        ),
        (r#""alphaMode": "GLOW""#.to_owned(), TEXTURES, "left out: an unknown alpha mode (paint)"),
        (
            r#""extensions": {"KHR_materials_ior": {"ior": "much"}}"#.to_owned(),
            TEXTURES,
            "left out: the extension KHR_materials_ior, which is not valid (paint)",
        ),
        (
            r#""extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}"#.to_owned(),
            TEXTURES,
            "left out: the extension KHR_materials_clearcoat (paint)",
        ),
        (
            r#""extensions": {"KHR_materials_specular": {"specularColorFactor": [1, 0.5, 1]}}"#.to_owned(),
            TEXTURES,
            "approximated: the colour of a dielectric's reflection, by grey (paint)",
        ),
        (
            r#""extensions": {"KHR_materials_specular": {"specularTexture": {"index": 0}}}"#.to_owned(),
            TEXTURES,
            "left out: a texture of a dielectric's reflection (paint)",
        ),
    ] {
        let model = textured(&material, textures);
        assert_eq!(notes(&model), [expected], "{material}");
    }
    // A texture with a fallback, and one as WebP, are read.
    for extension in ["KHR_texture_basisu", "EXT_texture_webp"] {
        let source = usize::from(extension == "KHR_texture_basisu");
        let textures = format!(
            r#""textures": [{{"source": 0, "extensions": {{"{extension}": {{"source": {source}}}}}}}]"#
        );
        let model = textured(&color(r#"{"index": 0}"#), &textures);
        assert!(model.report.is_empty() && model.materials[0].maps.color.is_some());
    }
    // What a map would have shown is not known.
    let model = textured(r#""emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 9}"#, TEXTURES);
    assert_eq!(model.materials[0].emission, Vec3::ZERO);
}

#[test]
fn extensions_of_materials() {
    let of = |extensions: &str| {
        let model = textured(&format!(r#""extensions": {{{extensions}}}, "alphaMode": "MASK""#), TEXTURES);
        assert!(model.report.is_empty(), "{:?}", model.report);
        model.materials[0].clone()
    };
    let plain = of("");
    assert_eq!((plain.alpha, plain.transmission), (Alpha::Mask(0.5), 0.0));
    assert!((plain.f0 - DIELECTRIC_F0).abs() < 1e-6);
    assert!(!plain.unlit && plain.medium.is_none());
    assert!(of(r#""KHR_materials_unlit": {}"#).unlit);
    assert!((of(r#""KHR_materials_ior": {"ior": 2}"#).f0 - 1.0 / 9.0).abs() < 1e-6);
    assert_eq!(of(r#""KHR_materials_ior": {"ior": 0}"#).f0, 1.0);
    let specular =
        of(r#""KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1.5, 1.5, 1.5]}"#);
    assert!((specular.f0 - 0.03).abs() < 1e-6);
    let thin = of(
        r#""KHR_materials_transmission": {"transmissionFactor": 0.75, "transmissionTexture": {"index": 0}}"#,
    );
    assert_eq!((thin.transmission, thin.medium), (0.75, None));
    assert_eq!(thin.maps.transmission.unwrap().channel, 0);
    let solid = of(
        r#""KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_ior": {"ior": 1.25},
        "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0]}"#,
    );
    let medium = solid.medium.unwrap();
    assert_eq!((medium.ior, medium.absorption.x), (1.25, 0.0));
    // Half of it is left after two metres.
    assert!(((-2.0 * medium.absorption.y).exp() - 0.5).abs() < 1e-6 && medium.absorption.z > 4.0);
    let clear = of(
        r#""KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": 1}"#,
    );
    assert_eq!(clear.medium.unwrap().absorption, Vec3::ZERO);
}

#[test]
fn specular_glossiness_is_converted() {
    let of = |members: &str| {
        let extension = format!(r#""extensions": {{"KHR_materials_pbrSpecularGlossiness": {{{members}}}}}"#);
        let model = textured(&extension, TEXTURES);
        assert!(model.report.is_empty(), "{:?}", model.report);
        model
    };
    let model = of(
        r#""diffuseFactor": [0.25, 0.5, 0.75, 1], "specularFactor": [0.04, 0.04, 0.04], "glossinessFactor": 0.75"#,
    );
    let material = &model.materials[0];
    assert_eq!((material.metallic, material.roughness, material.f0), (0.0, 0.25, DIELECTRIC_F0));
    assert!(material.color.distance(Vec3::new(0.25, 0.5, 0.75)) < 1e-6);
    let model = of(r#""diffuseFactor": [0, 0, 0, 1], "specularFactor": [1, 0.75, 0.25]"#);
    assert!(
        model.materials[0].metallic > 0.999
            && model.materials[0].color.distance(Vec3::new(1.0, 0.75, 0.25)) < 1e-3
    );
    assert_eq!(model.materials[0].roughness, 0.0);
    // Red metal of glossiness 1, then a dark surface of glossiness 128 / 255 with blue reflections, half as glossy.
    let model = of(
        r#""diffuseFactor": [0, 0, 0, 1], "glossinessFactor": 0.5, "specularGlossinessTexture": {"index": 0}"#,
    );
    let material = &model.materials[0];
    let [color, mixed] =
        [material.maps.color, material.maps.metallic].map(|map| &model.textures[map.unwrap().texture].texels);
    assert_eq!((material.color, material.metallic, material.roughness), (Vec3::ONE, 1.0, 1.0));
    assert_eq!((color[0], color[1][2].abs_diff(188) < 3), ([255, 0, 0, 255], true));
    assert_eq!(mixed.iter().map(|texel| texel[1]).collect::<Vec<_>>(), [128, 191]);
    assert!(mixed.iter().all(|texel| texel[2] > 250), "{mixed:?}");
}

#[test]
fn vertex_colours_have_three_or_four_numbers() {
    let colors = [[1.0, 0.5, 0.0, 0.25], [0.0, 1.0, 1.0, 0.5], [2.0, f32::NAN, 0.5, 1.0]];
    let expected = [[1.0, 0.5, 0.0, 0.25], [0.0, 1.0, 1.0, 0.5], [1.0, 1.0, 0.5, 1.0]].map(Vec4::from);
    for count in [3, 4] {
        let mut making = Making::default();
        making.floats("VEC3", 3, &TRIANGLE);
        let numbers: Vec<f32> = colors.iter().flat_map(|color| color[..count].to_vec()).collect();
        making.floats(&format!("VEC{count}"), 3, &numbers);
        let view = making.view(&[255, 0, 51, 0].repeat(3), r#", "byteStride": 4"#);
        making.accessor(format!(
            r#""bufferView": {view}, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC{count}""#
        ));
        let model = making.model(&one(r#""attributes": {"POSITION": 0, "COLOR_0": 1}"#));
        let opacity = |color: Vec4| if count == 3 { color.truncate().extend(1.0) } else { color };
        assert_eq!(model.parts[0].0.colors, [expected.map(opacity)]);
        let model = making.model(&one(r#""attributes": {"POSITION": 0, "COLOR_0": 2, "COLOR_1": 1}"#));
        assert_eq!(model.parts[0].0.colors[0][0].truncate(), Vec3::new(1.0, 0.0, 0.2));
        assert_eq!(notes(&model), ["left out: a second set of vertex colours (wedge)"]);
    }
}

#[test]
fn spots_shine_into_cones() {
    let of = |spot: &str| {
        let json = JSON.replacen(r#""type": "point""#, &format!(r#""type": "spot"{spot}"#), 1).replacen(
            r#"{"translation": [1, 2, 3],"#,
            r#"{"translation": [1, 2, 3], "rotation": [0.7071068, 0, 0, 0.7071068], "scale": [3, 3, 3],"#,
            1,
        );
        let model = read(&glb(&json), no_files).unwrap();
        let Light::Spot { position, axis, intensity, cosines } = model.lights[0] else {
            panic!("{:?}", model.lights)
        };
        assert_eq!((position, intensity), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(8.0, 4.0, 2.0)));
        assert!(axis.distance(Vec3::Y) < 1e-6, "{axis}");
        (cosines.map(|cosine| cosine.acos()), notes(&model))
    };
    for (spot, angles, valid) in [
        ("", [0.0, 0.25 * std::f32::consts::PI], true),
        (r#", "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.25}"#, [0.2, 0.25], true),
        (r#", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.25}"#, [0.25, 0.25], true),
        (r#", "spot": {"innerConeAngle": 0.26, "outerConeAngle": 0.25}"#, [0.25, 0.25], false),
        // As wide as half of all directions.
        (r#", "spot": {"outerConeAngle": 1.5707964}"#, [0.0, 0.5 * std::f32::consts::PI], true),
        (r#", "spot": {"outerConeAngle": 1.5708}"#, [0.0, 0.5 * std::f32::consts::PI], false),
        (r#", "spot": {"innerConeAngle": -0.001, "outerConeAngle": 0.25}"#, [0.0, 0.25], false),
        (r#", "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.25}"#, [0.25, 0.25], false),
        (
            r#", "spot": {"innerConeAngle": -1, "outerConeAngle": 3}"#,
            [0.0, 0.5 * std::f32::consts::PI],
            false,
        ),
    ] {
        let (found, notes) = of(spot);
        assert!(found.iter().zip(angles).all(|(a, b)| (a - b).abs() < 1e-3), "{spot}: {found:?}");
        let expected = "repaired: a spot's cone that is not valid (node 1)";
        assert_eq!(notes, &[expected][usize::from(valid)..]);
    }
}

#[test]
fn lights_are_placed_about_the_origin_of_the_scene() {
    let (position, origin) = (DVec3::new(1e6, 2.0, -5.0), DVec3::new(1e6 - 1.0, -4.0, 5.0));
    let (at, bounds) = (Vec3::new(1.0, 6.0, -10.0), [Vec3::ZERO, Vec3::new(2.0, 4.0, 4.0)]);
    let (intensity, axis, cosines) = (Vec3::new(3.0, 2.0, 1.0), Vec3::X, [0.9, 0.8]);
    // A radius of 3 m is a hundredth of the sun's distance, whose square makes up for it.
    let sun = Vec3::new(1.0, 2.0, 2.0) - 300.0 * axis;
    for (placed, expected) in [
        (Placed::Point { position, intensity }, Light::Point { position: at, intensity }),
        (
            Placed::Spot { position, axis, intensity, cosines },
            Light::Spot { position: at, axis, intensity, cosines },
        ),
        (
            Placed::Directional { direction: axis, irradiance: intensity },
            Light::Point { position: sun, intensity: 9e4 * intensity },
        ),
    ] {
        assert_eq!(placed.light(origin, bounds), expected);
    }
}

#[test]
fn compressed_buffer_views_are_unpacked() {
    let hex = "e1fe1e001e5e0e021efffff00696001401007687566778a9866589689801690000";
    let stream: Vec<u8> =
        (0..hex.len() / 2).map(|i| u8::from_str_radix(&hex[2 * i..][..2], 16).unwrap()).collect();
    for extension in meshopt::MESHOPT {
        let mut making = Making::default();
        let place = |i: usize| [(i % 3) as f32, (i / 3) as f32, 0.0];
        making.floats("VEC3", 9, (0..9).map(place).collect::<Vec<_>>().as_flattened());
        let packed = making.view(&stream, "");
        let offset = making.bytes.len() - stream.len();
        let indices = making.accessor(format!(
            r#""bufferView": {}, "componentType": 5123, "count": 30, "type": "SCALAR""#,
            packed + 1
        ));
        // The buffer of what it unpacks to need not be there.
        making.views.push(format!(
            r#"{{"buffer": 1, "byteLength": 60, "extensions": {{"{extension}": {{"buffer": 0, "byteOffset": {offset},
            "byteLength": {}, "byteStride": 2, "count": 30, "mode": "TRIANGLES"}}}}}}"#,
            stream.len()
        ));
        let rest = one(&format!(r#""attributes": {{"POSITION": 0}}, "indices": {indices}"#));
        let model = making.model(&format!(r#""extensionsRequired": ["{extension}"], {rest}"#));
        assert!(model.report.is_empty(), "{:?}", model.report);
        assert_eq!(model.parts[0].0.triangles[..2], [[0, 3, 1], [1, 3, 4]]);
        assert_eq!(model.parts[0].0.triangles.len(), 10);
        making.bytes[offset] = 0;
        let message = read(&making.file(&rest), no_files).unwrap_err();
        assert!(message.contains("buffer view 2: its compressed data is damaged"), "{message}");
    }
}

/// The normals that a normal map of (1, -1, -1) makes of the z axis, seen from the front and from behind, on a triangle whose
/// file has this tangent and normal.
fn bent(tangent: [f32; 4], scale: &str, attributes: &str) -> [Vec3; 2] {
    let mut making = Making::default();
    making.floats("VEC3", 3, &TRIANGLE);
    making.floats("VEC3", 3, &[[0.0, 0.0, 1.0]; 3].concat());
    making.floats("VEC4", 3, &[tangent; 3].concat());
    making.floats("VEC2", 3, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let mut red = std::io::Cursor::new(vec![]);
    image::RgbImage::from_pixel(1, 1, image::Rgb([255, 0, 0]))
        .write_to(&mut red, image::ImageFormat::Png)
        .unwrap();
    let image = making.view(red.get_ref(), "");
    let joints = making.view(&[0; 12], "");
    making.accessor(format!(r#""bufferView": {joints}, "componentType": 5121, "count": 3, "type": "VEC4""#));
    making.floats("VEC4", 3, &[1.0, 0.0, 0.0, 0.0].repeat(3));
    let model = making.model(&format!(
        r#""materials": [{{"normalTexture": {{"index": 0}}}}], "textures": [{{"source": 0}}],
        "images": [{{"bufferView": {image}}}], "skins": [{{"joints": [1]}}],
        "nodes": [{{"mesh": 0{}, "scale": {scale}}}, {{"scale": {scale}}}],
        "meshes": [{{"primitives": [{{"material": 0, "attributes": {{"POSITION": 0, {attributes}}}}}]}}]"#,
        if attributes.contains("JOINTS") { r#", "skin": 0"# } else { "" }
    ));
    assert!(model.report.is_empty(), "{:?}", model.report);
    let scene = model.into_scene("").unwrap();
    [true, false].map(|front| {
        let normal = scene.mesh.face_normals[0] * if front { 1.0 } else { -1.0 };
        scene.mapped_normal(0, Vec3::splat(1.0 / 3.0), front, normal) * 3f32.sqrt()
    })
}

#[test]
fn tangents_of_the_file_turn_its_normal_maps() {
    let all = r#""NORMAL": 1, "TANGENT": 2, "TEXCOORD_0": 3"#;
    let skinned = r#""NORMAL": 1, "TANGENT": 2, "TEXCOORD_0": 3, "JOINTS_0": 4, "WEIGHTS_0": 5"#;
    let plain = "[1, 1, 1]";
    for (tangent, scale, attributes, expected) in [
        // Right is -x, and up is -y or +y.
        ([-1.0, 0.0, 0.0, 1.0], plain, all, [-1.0, 1.0, -1.0]),
        ([-1.0, 0.0, 0.0, -1.0], plain, all, [-1.0, -1.0, -1.0]),
        // The mirror image of the first.
        ([-1.0, 0.0, 0.0, 1.0], "[-1, 1, 1]", all, [1.0, 1.0, -1.0]),
        // Joints do what nodes do.
        ([-1.0, 0.0, 0.0, 1.0], plain, skinned, [-1.0, 1.0, -1.0]),
        ([-1.0, 0.0, 0.0, -1.0], plain, skinned, [-1.0, -1.0, -1.0]),
        ([-1.0, 0.0, 0.0, 1.0], "[-1, 1, 1]", skinned, [1.0, 1.0, -1.0]),
        ([-1.0, 0.0, 0.0, -1.0], "[-1, 1, 1]", skinned, [1.0, -1.0, -1.0]),
        // By the texture coordinates: right is +x, and up is -y.
        ([-1.0, 0.0, 0.0, 0.0], plain, all, [1.0, 1.0, -1.0]),
        ([f32::NAN, 1.0, 0.0, 1.0], plain, all, [1.0, 1.0, -1.0]),
        // Tangents without normals do not count.
        ([-1.0, 0.0, 0.0, -1.0], plain, r#""TANGENT": 2, "TEXCOORD_0": 3"#, [1.0, 1.0, -1.0]),
    ] {
        let [front, back] = bent(tangent, scale, attributes);
        assert!(front.distance(Vec3::from(expected)) < 1e-5, "{tangent:?}, {scale}: {front}");
        assert!(back.distance(-front) < 1e-5, "seen from behind: {back}");
    }
}
