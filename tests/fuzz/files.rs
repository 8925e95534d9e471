//! The kinds of file that are read: seeds, and what to do with one.

use std::{fs, path::Path, sync::Arc};

use epigraph::{Place, graphs::Shipped};
use epigraph_core::{GraphFile, Settings, WgslFile, compile};
use epigraph_pictures::Picture;
use epigraph_scenes::{CameraPath, Rng, Scene, TraceSettings, Tracer};
use epigraph_streams::{
    Codec, Model, Node, Points,
    repeats::{Repeats, Surface, find},
};
use glam::Vec3;

/// A kind of file.
pub struct Kind {
    /// Its folder in the corpus.
    pub name: &'static str,
    /// The name of the file that is read.
    pub file: &'static str,
    /// Correct files.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Files that these name, which are not damaged.
    pub companions: fn() -> Vec<(&'static str, Vec<u8>)>,
    /// Reads a file, and uses what it holds; whether it was accepted.
    pub read: fn(&Path) -> bool,
    /// Mutants in an ordinary run.
    pub count: usize,
}

fn none() -> Vec<(&'static str, Vec<u8>)> {
    Vec::new()
}

/// All files of a folder of the repository with an ending.
fn shipped(folder: &str, ending: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder);
    let mut paths: Vec<_> =
        fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("readable").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|end| end == ending));
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("readable")).collect()
}

pub const GRAPHS: Kind = Kind {
    name: "graphs",
    file: "graph.ron",
    seeds: || {
        let mut seeds = shipped("graphs", "ron");
        // With the nodes of all parts.
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/epi.ron");
        let epi = GraphFile::load_with(&path, &Shipped).expect("a shipped graph");
        seeds.push(epi.full(&epigraph::registry(), Path::new("")).expect("a shipped graph").into_bytes());
        seeds.extend([
            br#"Graph(version: 1, base: "epi", outputs: { "edges": "interpolate.color" }, set: { "view/cull": (threshold: 0.1) })"#
                .to_vec(),
            br#"Graph(version: 1, params: { "t": (default: 0.2, range: (0.0, 1.0), doc: "x") }, nodes: {
                "cache": (kind: "graph", params: (file: "render-cache"), set: { "view/cull": (threshold: Param("t")) }),
            }, outputs: { "image": "cache.image" })"#
                .to_vec(),
        ]);
        seeds
    },
    companions: || {
        let part = br#"Graph(version: 1, nodes: { "t": (kind: "tonemap", inputs: { "color": "inputs.a" }) },
            outputs: { "b": "t.image" })"#;
        let itself = br#"Graph(version: 1, nodes: { "g": (kind: "graph", params: (file: "graph.ron")) }, outputs: {})"#;
        vec![("part.ron", part.to_vec()), ("self.ron", itself.to_vec())]
    },
    read: |path| {
        let registry = epigraph::registry();
        let facts = Place::load("cornell", "still").expect("a built-in scene").facts();
        let settings = Settings::new([32, 24], 10, facts);
        let compiled =
            GraphFile::load_with(path, &Shipped).and_then(|file| compile(&file, &registry, &settings));
        // As the user sees them.
        compiled.map_err(|problems| assert!(problems.to_string().len() < 4 << 20)).is_ok()
    },
    count: 400,
};

/// Loads a scene, and traces some rays and follows its motions if it is one.
fn see(path: &Path) -> bool {
    let Ok(scene) = Scene::load(path.to_str().expect("a UTF-8 path")) else { return false };
    let poses = [0, 7, u32::MAX].map(|frame| scene.poses_at(frame));
    let paths = ["orbit", "fly", "shake"].map(|path| CameraPath::parse(path, &scene));
    let tracer = Tracer::new(Arc::new(scene.posed(&poses[1])));
    for path in paths.into_iter().flatten() {
        let camera = path.camera(11);
        let mut random = Rng::new(0, 1);
        for at in 0..16 {
            let direction = camera.direction(f64::from(at) as f32, 8.0, [16, 16]);
            tracer.trace(camera.eye, direction, &TraceSettings::default(), &mut random);
        }
    }
    true
}

const TETRAHEDRON: &[u8] =
    b"o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nf 1 3 2\nf 1//1 2//1 4//1\nf 1/1/1 4 3\nf 2 3 4\n";

pub const SCENES: Kind = Kind {
    name: "scenes",
    file: "scene.ron",
    seeds: || {
        let mut seeds = shipped("scenes", "ron");
        // The others' meshes come by download.
        seeds.retain(|seed| !String::from_utf8_lossy(seed).contains("File("));
        seeds.extend([
            br#"#![enable(implicit_some)]
Scene(
    version: 1,
    camera: (eye: (0, 1, 4), target: (0, 0.5, 0), fov: 35),
    background: (0.1, 0.2, 0.3), crease_angle: 30, weld_distance: 0.001,
    motions: { "m": (keys: [(time: 0), (time: 2, translate: (1, 0, 0), rotate: (0, 90, 0))], looped: true, pivot: (0, 0, 1)) },
    materials: {
        "clay": (color: (0.7, 0.4, 0.3)), "metal": (color: (0.2, 0.2, 0.2), surface: Glossy(roughness: 0.3, f0: 0.4)),
        "lamp": (color: (0, 0, 0), emission: (5, 5, 5)), "mirror": (color: (1, 1, 1), surface: Mirror),
    },
    objects: [
        (shape: File("a.obj"), material: "clay", height: 2, rotate: (10, 20, 30)),
        (shape: Box(low: (0, 0, 0), high: (1, 1, 1)), material: "mirror", smooth: 40, repeat: (count: 3, step: (0, 0, 2)), motion: "m"),
        (shape: Quad(corner: (0, 3, 0), u: (1, 0, 0), v: (0, 0, 1)), material: "lamp"),
        (shape: Sphere(center: (0, 1, 0), radius: 0.5), material: "metal", scale: 0.5, translate: (1, 2, 3)),
        (shape: Cylinder(base: (0, 0, 0), radius: 0.5, height: 2)),
    ],
    lights: [Point(position: (0, 5, 0), intensity: (1, 1, 1), motion: "m"),
        Quad(corner: (-1, 3, -1), u: (2, 0, 0), v: (0, 0, 2), radiance: (9, 9, 9))],
)"#
            .to_vec(),
            br#"Scene(version: 1, objects: [(shape: Builtin("cornell"))])"#.to_vec(),
            br#"Scene(
    version: 1,
    materials: {
        "tin": (metallic: 0.9, roughness: 0.2, maps: (
            color: (file: "a.png", uv_set: 0, rotate: 30), normal: (file: "a.png", slope: 2))),
        "jar": (color: (1, 1, 1), ior: 1.3, f0: 0.1, transmission: 0.9, medium: (absorption: (1, 2, 3)),
            double_sided: true),
        "net": (alpha: Mask(0.5), maps: (
            color: (file: "a.png"),
            opacity: (file: "a.png", channel: Red, scale: (2, -3), translate: (0.1, 9), wrap: (Clamp, Mirror),
                nearest: true),
            emission: (file: "none.png"), roughness: (file: "a.png"))),
        "sign": (color: (1, 0, 0), unlit: true, opacity: 0.5, alpha: Blend),
    },
    objects: [
        (shape: File("a.obj"), material: "tin"),
        (shape: Box(low: (0, 0, 0), high: (1, 1, 1)), material: "tin"),
        (shape: Sphere(center: (0, 1, 0), radius: 0.5), material: "net"),
        (shape: Cylinder(base: (0, 0, 0), radius: 0.5, height: 2), material: "jar"),
        (shape: Quad(corner: (0, 3, 0), u: (1, 0, 0), v: (0, 0, 1)), material: "sign"),
    ],
)"#
            .to_vec(),
        ]);
        seeds
    },
    companions: || vec![("a.obj", TETRAHEDRON.to_vec()), ("a.png", small_picture())],
    read: see,
    count: 400,
};

pub const FLIGHTS: Kind = Kind {
    name: "flights",
    file: "flight.ron",
    seeds: || {
        vec![
            br#"(looped: true, keys: [
    (time: 0.0, eye: (0.0, 1.0, 4.0), target: (0.0, 1.0, 0.0)),
    (time: 1.5, eye: (1.0, 1.0, 3.0), target: (0.0, 1.0, 0.0)),
    (time: 2.0, eye: (0.0, 2.0, 3.0), target: (0.0, 1.0, -1.0)),
])"#
            .to_vec(),
            b"(keys: [(time: 0.0, eye: (0.0, 1.0, 4.0), target: (0.0, 1.0, 0.0))])".to_vec(),
        ]
    },
    companions: none,
    read: |path| {
        let scene = Scene::load("cornell").expect("a built-in scene");
        let Ok(path) = CameraPath::parse(&format!("fly:{}", path.display()), &scene) else { return false };
        for frame in [0, 1, 30, 59, 1000, u32::MAX] {
            let camera = path.camera(frame);
            assert!(camera.eye.is_finite() && camera.rotation.is_finite(), "{camera:?}");
        }
        true
    },
    count: 3000,
};

/// Colours, texture coordinates, smoothing, a polygon with a notch, lines that go on, and coordinates far out.
const MANY_FORMS: &[u8] = b"mtllib a.mtl b.mtl\no c\nv 700000 0 0 1 0 0\nv 700002 0 0 0 1 0\nv 700002 1 0 0 0 1\nv 700001 0.5 0 1 1 1\n\
    v 700000 1 -5e6 nan 1 1\nv nan 0 0\nvt 0 0\nvt 1 0.5\nvn nan 0 1\ns 1\nusemtl many forms\nf 1/1 2/2/1 3//1 4/1 \\\n 5/2\n\
    s off\nusemtl glass # clear\nf 1 2 4\nf 2 3\nf 1 2 6\nl 1 2\ncstype bezier\ncurv 0 1 1 2\n#MRGB ff00ff00\n";

const MATERIALS: &[u8] = b"newmtl lamp\nKd 0 0 0\nKe 5 4 3\nnewmtl metal\nKd 0.1 0.2 0.3\nKs 0.5 0.5 0.5\nNs 225\nillum 3\n\
    newmtl many forms\nKd 1\nPr 0.5\nPm 1\nmap_Kd -s 2 2 1 -o 0.5 0 -clamp on a.png\nmap_d -imfchan r a.png\nd 0.5\nbump -bm 2 a.png\n\
    norm a.png\nmap_Pr .\\A.PNG\nmap_Ke a.png\nKe 1 1 1\nTr 0.5\nnewmtl glass\nillum 7\nNi 1.5\nTf 1 0.9 0.9\nKd spectral x\n";

fn small_picture() -> Vec<u8> {
    epigraph_pictures::png([2, 2], &[[255, 0, 0], [128, 128, 255], [0, 255, 0], [9, 9, 9]])
        .expect("it is encoded")
}

const QUAD: &[u8] =
    b"mtllib a.mtl\no quad\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl lamp\nf -1 -2 -3 -4\nusemtl metal\nf 1 2 3\n";

/// The sides of the squares of [`hills`].
const SIDE: u16 = 24;

/// The vertices and the triangles of a hilly square of 1152 triangles: enough that memory grows with the file.
fn hills() -> (Vec<Vec3>, Vec<[u16; 3]>) {
    let row = SIDE + 1;
    let height = |x: u16, z: u16| (0.7 * f32::from(x)).sin() + (0.5 * f32::from(z)).cos();
    let vertex = |i: u16| Vec3::new((i % row).into(), height(i % row, i / row), (i / row).into());
    let square = |i: u16| {
        let corner = i / SIDE * row + i % SIDE;
        [[corner, corner + row, corner + 1], [corner + 1, corner + row, corner + row + 1]]
    };
    ((0..row * row).map(vertex).collect(), (0..SIDE * SIDE).flat_map(square).collect())
}

pub const OBJ: Kind = Kind {
    name: "obj",
    file: "mesh.obj",
    seeds: || {
        let (positions, triangles) = hills();
        let vertices = positions.iter().map(|Vec3 { x, y, z }| format!("v {x} {y} {z}\n"));
        let faces = triangles.iter().map(|face| face.map(|vertex| vertex + 1));
        let hills: String = vertices.chain(faces.map(|[a, b, c]| format!("f {a} {b} {c}\n"))).collect();
        vec![TETRAHEDRON.to_vec(), QUAD.to_vec(), MANY_FORMS.to_vec(), hills.into_bytes()]
    },
    companions: || vec![("a.mtl", MATERIALS.to_vec()), ("a.png", small_picture())],
    read: see,
    count: 1200,
};

pub const MTL: Kind = Kind {
    name: "mtl",
    file: "a.mtl",
    seeds: || vec![MATERIALS.to_vec()],
    companions: || vec![("mesh.obj", [QUAD, MANY_FORMS].concat()), ("a.png", small_picture())],
    read: |path| see(&path.with_file_name("mesh.obj")),
    count: 800,
};

pub const PLY: Kind = Kind {
    name: "ply",
    file: "mesh.ply",
    seeds: || {
        let header = |format: &str, vertices: usize, faces: usize| {
            format!(
                "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
                 property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
            )
        };
        let ascii = header("ascii", 4, 2) + "0 0 0\n1 0 0\n1 1 0\n0 1 1\n3 0 1 2\n4 0 1 2 3\n";
        let mut binary = header("binary_little_endian", 4, 2).into_bytes();
        for value in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0_f32] {
            binary.extend(value.to_le_bytes());
        }
        for face in [&[0, 1, 2][..], &[0, 1, 2, 3]] {
            binary.push(face.len() as u8);
            binary.extend(face.iter().flat_map(|index: &i32| index.to_le_bytes()));
        }
        let many_forms = "ply\r\nformat ascii 1.0\r\ncomment TextureFile a.png\r\ncomment TextureFile b.png\r\nelement vertex 5\r\n\
            property double x\r\nproperty double y\r\nproperty double z\r\nproperty float nx\r\nproperty float ny\r\n\
            property float nz\r\nproperty uchar red\r\nproperty uchar green\r\nproperty uchar blue\r\nproperty uchar alpha\r\n\
            property float s\r\nproperty float t\r\nelement face 2\r\nproperty list uchar int vertex_indices\r\n\
            property list uchar float texcoord\r\nproperty int texnumber\r\nproperty ushort red\r\nproperty ushort green\r\n\
            property ushort blue\r\nelement tristrips 1\r\nproperty list int int vertex_indices\r\nelement edge 1\r\n\
            property int vertex1\r\nend_header\r\n\r\n500000 0 0 0 0 1 1 2 3 4 0 0\r\n500002 0 0 0 0 nan 1 2 3 255 0 1\r\n\
            500002 1 0 0 1 0 1 2 3 4 0.5 1\r\n500000.5 0.25 0 0 0 1 9 9 9 9 0 0\r\nnan 1 0 0 0 1 1 2 3 4 0 0\r\n\
            4 0 1 2 3 8 0 0 1 0 1 1 0 1 0 65535 0 0\r\n3 0 1 4 6 0 0 1 0 1 1 1 0 9 9\r\n6 0 1 2 -1 3 2\r\n7\r\n";
        let (positions, triangles) = hills();
        let mut hills = header("binary_little_endian", positions.len(), triangles.len()).into_bytes();
        hills.extend(positions.iter().flat_map(|at| at.to_array()).flat_map(f32::to_le_bytes));
        for face in triangles {
            hills.push(3);
            hills.extend(face.iter().flat_map(|&vertex| i32::from(vertex).to_le_bytes()));
        }
        vec![ascii.into_bytes(), binary, many_forms.into(), hills]
    },
    companions: || vec![("a.png", small_picture())],
    read: see,
    count: 1800,
};

/// A triangle, lights, a camera and a material; the buffer is in another file, or in the binary chunk.
fn gltf_json(buffer: &str) -> String {
    r#"{
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "point", "color": [1, 0.5, 0.25], "intensity": 8}, {"type": "directional", "intensity": 3}]}},
        "scene": 0, "scenes": [{"nodes": [0, 1, 2, 3]}],
        "nodes": [
            {"mesh": 0, "translation": [0, 0, -3], "scale": [1, 2, 1], "children": [4]},
            {"translation": [1, 2, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"extensions": {"KHR_lights_punctual": {"light": 1}}},
            {"camera": 0, "translation": [0, 0, 5]}, {"mesh": 0, "rotation": [0, 0, 0, 1]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.25, "zfar": 50}}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}, "emissiveFactor": [1, 1, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 0}, "indices": 1, "material": 0, "mode": 4}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [2, 2, 0]},
            {"bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 3}],
        "buffers": [BUFFER]
    }"#
    .replace("BUFFER", buffer)
}

/// A file with everything else that is read; its numbers are in the same buffer.
fn rich_gltf_json(buffer: &str) -> String {
    r#"{
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing", "EXT_meshopt_compression"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "spot", "range": 9, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}}]}},
        "nodes": [
            {"mesh": 0, "skin": 0, "weights": [0.5, 0.25]},
            {"mesh": 1, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 9}}}, "name": "copies"},
            {"matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1], "children": [3]},
            {"mesh": 1, "extensions": {"KHR_node_visibility": {"visible": true}}},
            {"camera": 0, "translation": [0, 0, 5]}, {"camera": 1, "translation": [0, 0, 5], "extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "skins": [{"joints": [2, 3], "inverseBindMatrices": 6}],
        "cameras": [
            {"type": "orthographic", "name": "plan", "orthographic": {"xmag": 2, "ymag": 1, "znear": 0.1, "zfar": 9}},
            {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.25, "zfar": 2, "aspectRatio": 1.5}}],
        "images": [{"uri": "a.png"}, {"bufferView": 2}, {"uri": "data:image/png;base64,iVBORw0KGgo="}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1}, {"source": 2},
            {"extensions": {"EXT_texture_webp": {"source": 0}, "KHR_texture_basisu": {"source": 1}}}],
        "materials": [
            {"name": "paint", "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
                "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0, 1], "metallicFactor": 0.5, "roughnessFactor": 0.2,
                    "baseColorTexture": {"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": {
                        "offset": [0.5, 0], "rotation": 1.5, "scale": [2, 3], "texCoord": 0}}},
                    "metallicRoughnessTexture": {"index": 3}},
                "normalTexture": {"index": 0, "scale": 0.5}, "occlusionTexture": {"index": 1, "strength": 0.5},
                "emissiveTexture": {"index": 0}, "emissiveFactor": [1, 1, 0],
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3}, "KHR_materials_ior": {"ior": 1.3}}},
            {"name": "glass", "alphaMode": "BLEND", "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 0.9, "transmissionTexture": {"index": 0}},
                "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [0.5, 1, 1]},
                "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 0]}, "KHR_materials_unlit": {}}},
            {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [1, 1, 1, 0.5], "glossinessFactor": 0.5,
                "diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 0}, "specularFactor": [1, 0.5, 0.5]}}}],
        "meshes": [
            {"weights": [1], "primitives": [{"material": 0, "indices": 1, "targets": [{"POSITION": 7}, {"NORMAL": 0, "TANGENT": 0}], "attributes": {
                "POSITION": 0, "NORMAL": 0, "TANGENT": 11, "TEXCOORD_0": 2, "TEXCOORD_1": 2, "COLOR_0": 3, "JOINTS_0": 4, "WEIGHTS_0": 5}}]},
            {"name": "bits", "primitives": [
                {"material": 1, "attributes": {"POSITION": 7}, "indices": 8}, {"mode": 5, "attributes": {"POSITION": 10}},
                {"material": 2, "mode": 6, "attributes": {"POSITION": 0, "TEXCOORD_0": 2, "COLOR_1": 3}}, {"mode": 1, "attributes": {"POSITION": 0}}]}],
        "animations": [{"name": "walk", "channels": [], "samplers": []}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"},
            {"bufferView": 2, "byteOffset": 24, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC4"},
            {"bufferView": 2, "byteOffset": 36, "componentType": 5121, "count": 3, "type": "VEC4"},
            {"bufferView": 2, "byteOffset": 48, "componentType": 5126, "count": 3, "type": "VEC4"},
            {"bufferView": 2, "byteOffset": 96, "componentType": 5126, "count": 2, "type": "MAT4"},
            {"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {"count": 1,
                "indices": {"bufferView": 2, "byteOffset": 224, "componentType": 5121}, "values": {"bufferView": 2, "byteOffset": 228}}},
            {"bufferView": 3, "componentType": 5123, "count": 3, "type": "SCALAR"},
            {"bufferView": 2, "byteOffset": 240, "componentType": 5126, "count": 2, "type": "VEC3"},
            {"bufferView": 4, "componentType": 5122, "count": 3, "type": "VEC3"},
            {"bufferView": 2, "byteOffset": 52, "componentType": 5126, "count": 3, "type": "VEC4"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 3},
            {"buffer": 0, "byteOffset": 40, "byteLength": 264},
            {"buffer": 1, "byteLength": 6, "extensions": {"EXT_meshopt_compression": {
                "buffer": 0, "byteOffset": 304, "byteLength": 8, "byteStride": 2, "count": 3, "mode": "INDICES"}}},
            {"buffer": 0, "byteOffset": 40, "byteLength": 24, "byteStride": 8}],
        "buffers": [BUFFER, {"byteLength": 6}]
    }"#
    .replace("BUFFER", buffer)
}

fn gltf_bytes() -> Vec<u8> {
    let floats = |all: &[f32]| all.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let positions = floats(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0]);
    let coordinates = floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let (colors, joints) = ([255, 128, 0, 255].repeat(3), [0, 1, 0, 0].repeat(3));
    let weights = floats(&[0.75, 0.25, 0.0, 0.0].repeat(3));
    let matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let matrices = floats(&matrix.repeat(2));
    let (changed, to, places) =
        ([2, 0, 0, 0], floats(&[1.0, 3.0, 0.0]), floats(&[0.0, 0.0, 1.0, 5.0, 0.0, 0.0]));
    // The indices 0, 1 and 2.
    let compressed = [0xD1, 0, 4, 4, 0, 0, 0, 0];
    let all: [&[u8]; 11] = [
        &positions,
        &[0, 1, 2, 0],
        &coordinates,
        &colors,
        &joints,
        &weights,
        &matrices,
        &changed,
        &to,
        &places,
        &compressed,
    ];
    all.concat()
}

pub const GLTF: Kind = Kind {
    name: "gltf",
    file: "mesh.gltf",
    seeds: || {
        let bin = |length: usize| format!(r#"{{"byteLength": {length}, "uri": "a.bin"}}"#);
        vec![gltf_json(&bin(40)).into_bytes(), rich_gltf_json(&bin(gltf_bytes().len())).into_bytes()]
    },
    companions: || vec![("a.bin", gltf_bytes()), ("a.png", small_picture())],
    read: see,
    count: 1600,
};

fn glb(json: impl Into<Vec<u8>>, bytes: &[u8]) -> Vec<u8> {
    let mut json = json.into();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF".to_vec();
    let total = 12 + 8 + json.len() + 8 + bytes.len();
    file.extend([2, total as u32, json.len() as u32].iter().flat_map(|number| number.to_le_bytes()));
    file.extend(b"JSON");
    file.extend(json);
    file.extend((bytes.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bytes);
    file
}

fn glb_hills() -> Vec<u8> {
    let (positions, triangles) = hills();
    let mut bytes: Vec<u8> =
        positions.iter().flat_map(|at| at.to_array()).flat_map(f32::to_le_bytes).collect();
    let begin = bytes.len();
    bytes.extend(triangles.iter().flatten().flat_map(|vertex| vertex.to_le_bytes()));
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": {}, "type": "VEC3"}},
            {{"bufferView": 1, "componentType": 5123, "count": {}, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": {begin}}},
            {{"buffer": 0, "byteOffset": {begin}, "byteLength": {}}}],
        "buffers": [{{"byteLength": {}}}]}}"#,
        positions.len(),
        3 * triangles.len(),
        bytes.len() - begin,
        bytes.len(),
    );
    glb(json, &bytes)
}

/// A GLB file whose chunks have the lengths that they have in the file: otherwise nothing else is tried if bytes were
/// inserted or left out.
fn with_right_lengths(bytes: &[u8]) -> Option<Vec<u8>> {
    let binary = bytes.windows(4).position(|word| word == b"BIN\0")?;
    let json = bytes.get(20..binary.checked_sub(4)?)?;
    Some(glb(json, &bytes[binary + 4..]))
}

pub const GLB: Kind = Kind {
    name: "glb",
    file: "mesh.glb",
    seeds: || {
        let bytes = gltf_bytes();
        let rich = rich_gltf_json(&format!(r#"{{"byteLength": {}}}"#, bytes.len()));
        vec![glb(gltf_json(r#"{"byteLength": 40}"#), &bytes), glb(rich, &bytes), glb_hills()]
    },
    companions: || vec![("a.png", small_picture())],
    read: |path| {
        let as_it_is = see(path);
        let Some(mended) = with_right_lengths(&fs::read(path).expect("readable")) else { return as_it_is };
        fs::write(path, mended).expect("writable");
        see(path) || as_it_is
    },
    count: 2400,
};

fn picture(path: &Path) -> bool {
    let Ok(picture) = Picture::read(path) else { return false };
    assert_eq!(picture.colors.len(), picture.size[0] * picture.size[1]);
    true
}

pub const PNG: Kind = Kind {
    name: "png",
    file: "picture.png",
    seeds: || {
        let colors: Vec<[u8; 3]> = (0..63).map(|i| [i, 2 * i, 255 - i]).collect();
        vec![epigraph_pictures::png([9, 7], &colors).expect("it is encoded")]
    },
    companions: none,
    read: picture,
    count: 3000,
};

pub const EXR: Kind = Kind {
    name: "exr",
    file: "picture.exr",
    seeds: || {
        let colors: Vec<[f32; 3]> = (0..63).map(|i| [i as f32, 0.5, -1.0]).collect();
        vec![epigraph_pictures::exr([9, 7], &colors).expect("it is encoded")]
    },
    companions: none,
    read: picture,
    count: 3000,
};

pub const WGSL: Kind = Kind {
    name: "wgsl",
    file: "shader.wgsl",
    seeds: || [shipped("graphs/experiments", "wgsl"), shipped("tests/wgsl", "wgsl")].concat(),
    companions: none,
    read: |path| WgslFile::load(path, &epigraph::registry()).is_ok(),
    count: 300,
};

/// A file of streams whose checksums are those of its bytes, as far as it has them: otherwise nothing else is tried.
fn with_right_checksums(mut bytes: Vec<u8>) -> Vec<u8> {
    // `docs/vts.md`: the header, and records of the table.
    const HEADER: usize = 48;
    const RECORD: usize = 76;
    let word = |bytes: &[u8], at: usize| {
        let word = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes(word.try_into().expect("four bytes")) as usize)
    };
    let table = bytes.len().saturating_sub(HEADER) / RECORD;
    let count = word(&bytes, 16).unwrap_or(0).min(table);
    for begin in (0..count).map(|node| HEADER + node * RECORD) {
        let [offset, length] = [60, 68].map(|at| word(&bytes, begin + at).expect("within the table"));
        if let Some(block) = bytes.get(offset..).and_then(|rest| rest.get(..length)) {
            let checksum = crc32fast::hash(block);
            bytes[begin + 72..][..4].copy_from_slice(&checksum.to_le_bytes());
        }
    }
    if let Some(checked) = bytes.get(16..HEADER + count * RECORD) {
        let checksum = crc32fast::hash(checked);
        bytes[12..16].copy_from_slice(&checksum.to_le_bytes());
    }
    bytes
}

fn vts(bytes: &[u8]) -> bool {
    let Ok(model) = Model::from_bytes(bytes) else { return false };
    for node in model.nodes() {
        assert_eq!(node.positions().len(), node.cell_count());
        assert!(node.colors().is_none_or(|colors| colors.len() == node.cell_count()));
    }
    assert!(Model::from_bytes(&model.to_bytes()).is_ok_and(|same| same.nodes().len() == model.nodes().len()));
    let mut ply = Vec::new();
    let leaves: Vec<&Node> = model.leaves().collect();
    epigraph_points::ply::write(&mut ply, model.origin(), &leaves).expect("memory");
    true
}

pub const VTS: Kind = Kind {
    name: "vts",
    file: "points.vts",
    seeds: || {
        let at = |i: u32| Vec3::new((i % 40) as f32, (i / 40) as f32, (i * i % 97) as f32 / 16.0);
        let plain = Points::from((0..1600).map(at).collect::<Vec<_>>());
        let colors = Some((0..1600).map(|i| [i as u8, 2, 3, 255]).collect());
        let colored = Points { colors, normals: Some(plain.positions.clone()), ..plain.clone() };
        let encode = |points: &Points, codec, levels| {
            let settings = epigraph_streams::Settings { codec, levels, ..Default::default() };
            epigraph_streams::encode(points, &settings).expect("points").to_bytes()
        };
        vec![
            encode(&plain, Codec::Streams, 2),
            encode(&plain, Codec::Brick, 1),
            encode(&colored, Codec::Best, 3),
            encode(&colored, Codec::Packed, 1),
        ]
    },
    companions: none,
    read: |path| {
        let bytes = fs::read(path).expect("readable");
        let as_it_is = vts(&bytes);
        vts(&with_right_checksums(bytes)) || as_it_is
    },
    count: 2000,
};

fn repeats(bytes: &[u8]) -> bool {
    let Ok(repeats) = Repeats::from_file(bytes) else { return false };
    assert_eq!(Repeats::from_file(&repeats.to_file()).as_ref(), Ok(&repeats));
    assert!(repeats.to_glb(&[]).is_ok());
    true
}

pub const REPEATS: Kind = Kind {
    name: "repeats",
    file: "parts.vts",
    seeds: || {
        let cube =
            [0, 1, 2, 3, 4, 5, 6, 7].map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32));
        let corners =
            [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7]];
        let positions: Vec<Vec3> =
            (0..6).flat_map(|i| cube.map(|at| at * (1 + i / 4) as f32 + 9.0 * i as f32)).collect();
        let triangles: Vec<[u32; 3]> =
            (0..6).flat_map(|i| corners.map(|corners| corners.map(|vertex| 8 * i + vertex))).collect();
        let plain = Surface { positions: &positions, triangles: &triangles, ..Default::default() };
        let materials: Vec<u32> = (0..triangles.len() as u32).map(|triangle| triangle / 24).collect();
        let colors = vec![[1, 2, 3, 4]; positions.len()];
        let colored = Surface {
            normals: Some(&positions),
            colors: Some(&colors),
            materials: Some(&materials),
            ..plain
        };
        let file = |surface| find(&surface, &Default::default()).expect("a mesh").repeats.to_file();
        vec![file(plain), file(colored)]
    },
    companions: none,
    read: |path| {
        let bytes = fs::read(path).expect("readable");
        let as_it_is = repeats(&bytes);
        // `docs/vts.md`: the repeats follow the header and begin with a checksum.
        let mut mended = with_right_checksums(bytes);
        if let Some((checksum, rest)) = mended.get_mut(48..).and_then(<[u8]>::split_first_chunk_mut) {
            *checksum = crc32fast::hash(rest).to_le_bytes();
        }
        repeats(&mended) || as_it_is
    },
    count: 2000,
};

fn points(path: &Path) -> bool {
    let Ok(input) = epigraph_points::read(path.to_str().expect("a UTF-8 path")) else { return false };
    let points = input.points;
    assert!(!points.positions.is_empty() && points.positions.iter().all(|at| at.is_finite()));
    let settings = epigraph_streams::Settings { levels: 2, codec: Codec::Brick, ..Default::default() };
    epigraph_streams::encode(&points, &settings).is_ok()
}

/// Scans, with colours and normals; meshes are [`PLY`].
pub const SCAN: Kind = Kind {
    name: "scan",
    file: "scan.ply",
    seeds: || {
        let header = |format: &str, list: &str| {
            format!(
                "ply\nformat {format} 1.0\nelement vertex 3\nproperty double x\nproperty float y\nproperty short z\n\
                 property uchar red\nproperty uchar green\nproperty float blue\nproperty float nx\nproperty float ny\n\
                 property float nz\n{list}end_header\n"
            )
        };
        let ascii = header("ascii", "property list uchar int other\n")
            + "0 1 2 3 4 0.5 0 0 1 0\n1e6 nan 2 3 4 0.5 0 1 0 2 5 6\n7 8 9 3 4 0.5 1 0 0 1 3\n";
        let mut binary = header("binary_big_endian", "").into_bytes();
        for number in [0.0, 1.0, 2.0_f32] {
            binary.extend(f64::from(number).to_be_bytes());
            binary.extend(number.to_be_bytes());
            binary.extend([0, 5, 7, 8]);
            [number; 4].iter().for_each(|part| binary.extend(part.to_be_bytes()));
        }
        [vec![ascii.into_bytes(), binary], (PLY.seeds)()].concat()
    },
    companions: none,
    read: points,
    count: 2000,
};

pub const XYZ: Kind = Kind {
    name: "xyz",
    file: "scan.xyz",
    seeds: || vec![b"# a scan\n1 2 3 4 5 6\n-1.5,2e3;4 0 128 255\n".to_vec(), b"1 2 3\n4 5 6\n".to_vec()],
    companions: none,
    read: points,
    count: 1000,
};

/// LAS files of some points with colours, or LAZ: of the old formats, and of those since LAS 1.4, in which a chunk of
/// LAZ has layers.
fn las(compressed: bool) -> Vec<Vec<u8>> {
    let file = |format: u8| {
        let mut builder = las::Builder::from((1, if format < 6 { 2 } else { 4 }));
        builder.point_format = las::point::Format::new(format).expect("a format");
        builder.point_format.is_compressed = compressed;
        builder.point_format.extra_bytes = 1;
        if format == 7 {
            builder.evlrs.push(las::Vlr { data: vec![1, 2, 3], ..Default::default() });
        }
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join(if compressed { "a.laz" } else { "a.las" });
        let header = builder.into_header().expect("a header");
        let mut writer = las::Writer::from_path(&path, header).expect("a writer");
        for i in 0..300_u16 {
            let at = f64::from(i);
            let color = Some(las::Color { red: i * 200, green: i, blue: 7 });
            let gps_time = (format >= 6).then_some(at);
            let extra_bytes = vec![i as u8];
            let point =
                las::Point { x: at, y: at * at, z: 1.0, color, gps_time, extra_bytes, ..Default::default() };
            writer.write_point(point).expect("a point");
        }
        writer.close().expect("written");
        fs::read(path).expect("written")
    };
    [2, 7].map(file).into()
}

pub const LAS: Kind =
    Kind { name: "las", file: "scan.las", seeds: || las(false), companions: none, read: points, count: 2000 };

pub const LAZ: Kind =
    Kind { name: "laz", file: "scan.laz", seeds: || las(true), companions: none, read: points, count: 2000 };
