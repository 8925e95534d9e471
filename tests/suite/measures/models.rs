//! Models with materials, maps, skies and the rarer forms of their formats.

use std::{fmt::Write as _, fs, path::Path, sync::Arc};

use epigraph_core::testing::Random;
use epigraph_pictures::{exr, png};
use epigraph_scenes::{
    Job, LoadOptions, Mode, Rng, Scene, SceneFacts, ShadowSettings, Sky, TraceSettings, Tracer, reference,
    shadow_segments,
};
use glam::{Mat4, Quat, Vec3};

use super::{Figures, assert_same};

/// All shapes with maps in all ways to lay them on, under a sky.
const SHAPES: &str = include_str!("models/shapes.ron");

/// A built-in scene as an object.
const BUILTIN: &str = r#"Scene(version: 1, objects: [(shape: Builtin("still-life"), height: 2)])"#;

/// Maps and options of material files.
const MTL: &str = include_str!("models/maps.mtl");

/// A quad for each material, with texture coordinates, some beyond the image, and a line; a concave face with colours
/// but no texture coordinates.
fn obj() -> String {
    let mut text = String::from("mtllib maps.mtl\n");
    for (index, name) in ["one", "two", "three", "four", "five", "six"].into_iter().enumerate() {
        let x = index as f32 * 0.7 - 2.0;
        write!(
            text,
            "g {name}\nusemtl {name}\ns {}\nv {x} 0 0.4\nv {} 0.1 0.5\nv {} 0.8 0.2\nv {x} 0.7 0\n\
             vt -0.2 0.1\nvt 1.3 0\nvt 1.1 1.2\nvt 0 0.9\nf -4/-4 -3/-3 -2/-2 -1/-1\nl -4 -1\n",
            index % 3,
            x + 0.6,
            x + 0.5
        )
        .expect("a string");
    }
    text + "usemtl none\nv -2 0 1 0.2 0.4 0.6\nv 2 0 1 1 0 0\nv 2 0 2 0 1 0\nv 1 0 1.4 0 0 1\n\
            v -2 0 2 0.5 0.5 0.5\nf 25 26 27 28 29\n"
}

/// A glTF file: its text, and its data, which are one buffer with one view for each accessor.
#[derive(Default)]
struct Making {
    data: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Making {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let at = self.data.len();
        self.data.extend(bytes);
        self.views.push(format!(r#"{{"buffer": 0, "byteOffset": {at}, "byteLength": {}}}"#, bytes.len()));
        self.views.len() - 1
    }

    fn accessor(&mut self, view: usize, count: usize, component: u32, kind: &str, more: &str) -> usize {
        self.accessors.push(format!(
            r#"{{"bufferView": {view}, "count": {count}, "componentType": {component}, "type": "{kind}"{more}}}"#
        ));
        self.accessors.len() - 1
    }

    fn floats(&mut self, kind: &str, width: usize, numbers: &[f32], more: &str) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.accessor(view, numbers.len() / width, 5126, kind, more)
    }
}

/// A glTF file with a patch of four faces in many roles: textured, skinned, morphed, instanced, quantised, sparse.
fn gltf() -> (String, Vec<u8>) {
    let mut making = Making::default();
    let grid: Vec<[f32; 2]> =
        (0..9).map(|index| [(index % 3) as f32 / 2.0, (index / 3) as f32 / 2.0]).collect();
    let flat =
        |of: &dyn Fn([f32; 2]) -> Vec<f32>| -> Vec<f32> { grid.iter().flat_map(|at| of(*at)).collect() };
    let points = flat(&|[x, y]| vec![2.0 * x - 1.0, 2.0 * y - 1.0, 0.3 * (x - y) * (x + 0.4)]);
    let positions = making.floats("VEC3", 3, &points, "");
    let normals = making.floats(
        "VEC3",
        3,
        &flat(&|[x, y]| Vec3::new(0.2 * x, -0.3 * y, 1.0).normalize().to_array().into()),
        "",
    );
    let tangents = making.floats(
        "VEC4",
        4,
        &flat(&|[x, y]| vec![1.0, 0.1 * x, 0.2 * y, if x < 0.6 { 1.0 } else { -1.0 }]),
        "",
    );
    let uvs = making.floats("VEC2", 2, &flat(&|[x, y]| vec![1.4 * x - 0.2, 1.0 - y]), "");
    let others = making.floats("VEC2", 2, &flat(&|[x, y]| vec![y, 2.0 * x]), "");
    let colors: Vec<u8> = flat(&|[x, y]| vec![255.0, 255.0 * x, 90.0 + 100.0 * y, 200.0])
        .iter()
        .map(|&part| part as u8)
        .collect();
    let view = making.view(&colors);
    let colors = making.accessor(view, 9, 5121, "VEC4", r#", "normalized": true"#);
    let corners: Vec<u16> =
        [0_u16, 1, 3, 4].into_iter().flat_map(|a| [a, a + 1, a + 4, a, a + 4, a + 3]).collect();
    let view = making.view(&corners.iter().flat_map(|corner| corner.to_le_bytes()).collect::<Vec<_>>());
    let indices = making.accessor(view, corners.len(), 5123, "SCALAR", "");
    // Joints: one that turns, one that mirrors.
    let joints: Vec<u8> =
        (0..9).flat_map(|index| [u8::from(index > 3), 1 - u8::from(index > 3), 0, 0]).collect();
    let view = making.view(&joints);
    let joints = making.accessor(view, 9, 5121, "VEC4", "");
    let weights = making.floats("VEC4", 4, &flat(&|[x, _]| vec![1.0 - 0.4 * x, 0.4 * x, 0.0, 0.0]), "");
    let binds: Vec<f32> = [Mat4::from_translation(Vec3::new(0.1, -0.2, 0.0)), Mat4::from_rotation_z(0.3)]
        .iter()
        .flat_map(|m| m.to_cols_array())
        .collect();
    let binds = making.floats("MAT4", 16, &binds, "");
    let swollen = making.floats("VEC3", 3, &flat(&|[x, y]| vec![0.0, 0.1 * x, 0.5 * y]), "");
    // Three of the points are elsewhere.
    let places = making.view(&[1, 4, 7]);
    let values: Vec<u8> =
        [0.0_f32, -1.2, 0.5, 0.1, 0.2, 0.6, 0.0, 1.3, 0.1].iter().flat_map(|n| n.to_le_bytes()).collect();
    let values = making.view(&values);
    let base: Vec<u8> = points.iter().flat_map(|n| n.to_le_bytes()).collect();
    let base = making.view(&base);
    let sparse = format!(
        r#", "sparse": {{"count": 3, "indices": {{"bufferView": {places}, "componentType": 5121}},
            "values": {{"bufferView": {values}}}}}"#
    );
    let sparse = making.accessor(base, 9, 5126, "VEC3", &sparse);
    let small: Vec<u8> = points.iter().flat_map(|n| ((n / 1.4 * 32_767.0) as i16).to_le_bytes()).collect();
    let small: Vec<u8> = small.chunks(6).flat_map(|three| [three, &[0, 0]].concat()).collect();
    let view = making.view(&small);
    making.views[view] = making.views[view].replace('}', r#", "byteStride": 8}"#);
    let quantised = making.accessor(view, 9, 5122, "VEC3", r#", "normalized": true"#);
    let shifts = making.floats("VEC3", 3, &[0.0, 0.0, 0.0, 0.9, 0.1, 0.2, -0.8, 0.2, -0.3], "");
    let turns: Vec<f32> =
        [0.0, 0.7, -0.9].iter().flat_map(|&turn| Quat::from_rotation_y(turn).to_array()).collect();
    let turns = making.floats("VEC4", 4, &turns, "");
    let sizes = making.floats("VEC3", 3, &[1.0, 1.0, 1.0, 0.5, 0.6, 0.7, -0.5, 0.5, 0.5], "");

    let full = format!(
        r#"{{"POSITION": {positions}, "NORMAL": {normals}, "TANGENT": {tangents},
            "TEXCOORD_0": {uvs}, "TEXCOORD_1": {others}, "COLOR_0": {colors}}}"#
    );
    let mapped = format!(r#"{{"POSITION": {positions}, "TEXCOORD_0": {uvs}, "TEXCOORD_1": {others}}}"#);
    let primitive = |attributes: &str, material: usize, more: &str| {
        format!(
            r#"{{"primitives": [{{"attributes": {attributes}, "indices": {indices}, "material": {material}{more}}}]}}"#
        )
    };
    let skinned = format!(
        r#"{{"POSITION": {positions}, "NORMAL": {normals}, "JOINTS_0": {joints}, "WEIGHTS_0": {weights}}}"#
    );
    let morph = format!(r#", "targets": [{{"POSITION": {swollen}}}]"#);
    let mut meshes: Vec<String> = (0..MATERIALS.lines().count() - 2)
        .map(|material| primitive(if material < 2 { &full } else { &mapped }, material, ""))
        .collect();
    let of_materials = meshes.len();
    meshes.push(primitive(&skinned, 0, ""));
    meshes.push(
        primitive(&format!(r#"{{"POSITION": {positions}}}"#), 1, &morph)
            .replace("]}]}", r#"]}], "weights": [0.6]}"#),
    );
    meshes.push(primitive(&format!(r#"{{"POSITION": {sparse}}}"#), 2, ""));
    meshes.push(primitive(&format!(r#"{{"POSITION": {quantised}}}"#), 3, ""));
    let mut nodes: Vec<String> = (0..of_materials)
        .map(|mesh| {
            let [column, row] = [mesh % 5, mesh / 5].map(|at| at as f32);
            let [x, y] = [2.2 * column - 4.4, 2.2 * row];
            format!(r#"{{"mesh": {mesh}, "translation": [{x}, {y}, 0], "rotation": [0, 0.2, 0, 0.9797959]}}"#)
        })
        .collect();
    let first = nodes.len();
    nodes.push(format!(r#"{{"mesh": {of_materials}, "skin": 0}}"#));
    nodes.push(r#"{"translation": [0, -2, 1], "rotation": [0, 0, 0.3, 0.9539392]}"#.into());
    nodes.push(r#"{"translation": [1, -2, 1.5], "scale": [-1, 1, 0.8]}"#.into());
    nodes.push(format!(r#"{{"mesh": {}, "translation": [3, -2, 1]}}"#, of_materials + 1));
    nodes.push(format!(r#"{{"mesh": {}, "translation": [-3, -2, 1]}}"#, of_materials + 2));
    nodes.push(format!(
        r#"{{"mesh": {}, "scale": [0.7, 0.7, 0.7], "translation": [-5, -2, 0], 
            "extensions": {{"EXT_mesh_gpu_instancing":
            {{"attributes": {{"TRANSLATION": {shifts}, "ROTATION": {turns}, "SCALE": {sizes}}}}}}}}}"#,
        of_materials + 3
    ));
    for light in 0..3 {
        let at = light as f32;
        nodes.push(format!(
            r#"{{"translation": [{at}, 4, 3], "rotation": [-0.5, 0, 0, 0.8660254],
                "extensions": {{"KHR_lights_punctual": {{"light": {light}}}}}}}"#
        ));
    }
    nodes.push(r#"{"camera": 0, "translation": [0.5, 1.2, 9]}"#.into());
    nodes.push(r#"{"camera": 1, "translation": [0.5, 1.2, 9], "name": "plan"}"#.into());
    let all: Vec<String> = (0..nodes.len()).map(|node| node.to_string()).collect();
    let text = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [{}]}}], "scene": 0,
        "extensionsUsed": ["KHR_mesh_quantization", "EXT_mesh_gpu_instancing",
            "KHR_texture_transform", "KHR_lights_punctual"],
        "extensions": {{"KHR_lights_punctual": {{"lights": [
            {{"type": "point", "intensity": 40, "color": [1, 0.9, 0.8]}},
            {{"type": "spot", "intensity": 60, "spot": {{"innerConeAngle": 0.2, "outerConeAngle": 0.6}}}},
            {{"type": "directional", "intensity": 0.5, "color": [0.4, 0.5, 1]}}]}}}},
        "cameras": [
            {{"type": "perspective", "perspective": {{"yfov": 0.7, "znear": 0.2, "zfar": 40, "aspectRatio": 1.5}}}},
            {{"type": "orthographic", "orthographic": {{"xmag": 3, "ymag": 2, "znear": 0.1, "zfar": 30}}}}],
        "skins": [{{"joints": [{}, {}], "inverseBindMatrices": {binds}}}],
        "images": [{{"uri": "a.png"}}, {{"uri": "b.png"}}, {{"uri": "n.png"}}],
        "samplers": [{{}}, {{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}}],
        "textures": [{{"source": 0, "sampler": 0}}, {{"source": 1, "sampler": 1}}, {{"source": 2}}],
        "materials": {}, "meshes": [{}], "nodes": [{}], "accessors": [{}], "bufferViews": [{}],
        "buffers": [{{"uri": "all.bin", "byteLength": {}}}]}}"#,
        all.join(", "),
        first + 1,
        first + 2,
        MATERIALS,
        meshes.join(",\n"),
        nodes.join(",\n"),
        making.accessors.join(",\n"),
        making.views.join(",\n"),
        making.data.len(),
    );
    (text, making.data)
}

/// The materials of the glTF file, one in each line.
const MATERIALS: &str = include_str!("models/materials.json");

/// A point cloud's triangles with normals, texture coordinates and colours of two widths.
const PLY: &str = include_str!("models/plate.ply");

fn write_pictures(folder: &Path) {
    let mut random = Random(4);
    let mut picture = |name: &str, size: [usize; 2], of: fn(&mut Random) -> [u8; 3]| {
        let texels: Vec<[u8; 3]> = (0..size[0] * size[1]).map(|_| of(&mut random)).collect();
        fs::write(folder.join(name), png(size, &texels).expect("a picture")).expect("a temporary folder");
    };
    let any = |random: &mut Random| [0; 3].map(|_: u8| random.below(256) as u8);
    picture("a.png", [4, 3], any);
    picture("b.png", [3, 5], any);
    picture("n.png", [4, 4], |random| [random.below(120) as u8 + 68, random.below(120) as u8 + 68, 220]);
    let mut texels: Vec<[f32; 3]> =
        (0..8 * 4).map(|_| [0.0; 3].map(|_: f32| random.between(0.0, 1.0))).collect();
    texels[11] = [40.0, 30.0, 20.0];
    texels[16..24].fill([0.0; 3]);
    fs::write(folder.join("sky.exr"), exr([8, 4], &texels).expect("a picture")).expect("a temporary folder");
}

#[test]
fn models_and_their_materials_are_as_before() {
    let folder = std::env::temp_dir().join(format!("epigraph-models-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    write_pictures(&folder);
    let (text, data) = gltf();
    let texts = [
        ("shapes.ron", SHAPES.to_owned()),
        ("all.gltf", text.clone()),
        ("maps.mtl", MTL.to_owned()),
        ("maps.obj", obj()),
        ("plate.ply", PLY.to_owned()),
        ("builtin.ron", BUILTIN.to_owned()),
        ("bare.gltf", text.replace("a.png", "gone.png").replace("KHR_lights_punctual", "OTHER_lights")),
    ];
    for (name, text) in texts {
        fs::write(folder.join(name), text).expect("a temporary folder");
    }
    fs::write(folder.join("all.bin"), data).expect("a temporary folder");
    let sky = Arc::new(Sky::load(&folder.join("sky.exr")).expect("a sky"));
    let mut figures = Figures::new();
    for (name, single_sided, has_sky) in [
        ("shapes.ron", false, false),
        ("shapes.ron", true, false),
        ("all.gltf", false, false),
        ("all.gltf", true, true),
        ("bare.gltf", false, false),
        ("maps.obj", false, false),
        ("maps.obj", false, true),
        ("plate.ply", false, false),
        ("still-life", false, false),
        ("builtin.ron", false, false),
    ] {
        let options = LoadOptions { sky: has_sky.then(|| sky.clone()), single_sided };
        let path = folder.join(name).display().to_string();
        let path = if name.contains('.') { &path } else { name };
        let scene = Scene::load_with(path, &options).unwrap_or_else(|error| panic!("{error}"));
        let scene = Arc::new(Scene { name: name.into(), ..scene });
        let mut add = |what: &str, value: &dyn std::fmt::Debug| {
            let name = format!("{name} {single_sided} {has_sky} {what}");
            // The folder has another name each time.
            let text = format!("{value:?}").replace(&folder.display().to_string(), "");
            figures.entry(name).or_default().debug(&Text(text));
        };
        add("scene", &scene);
        add("facts", &SceneFacts::of(&scene));
        let notes: Vec<String> = scene.report.notes().iter().map(ToString::to_string).collect();
        add("notes", &notes);
        let tracer = Arc::new(Tracer::new(scene.clone()));
        for frame in if scene.bodies.is_empty() { vec![0] } else { vec![0, 20] } {
            let tracer = tracer.at(frame);
            for (mode, spp, max_bounces) in [(Mode::Direct, 2, 8), (Mode::Path, 2, 1), (Mode::Path, 1, 6)] {
                let size = [45, 33];
                let jobs: Vec<Job> = (0..size[0] * size[1])
                    .map(|pixel| {
                        let [x, y] = [pixel % size[0], pixel / size[0]].map(|at| at as f32 + 0.41);
                        let direction = scene.camera.direction(x, y, size);
                        Job { origin: scene.camera.eye, direction, start: 0.0, key: Rng::key(frame, pixel) }
                    })
                    .collect();
                let mut hits = vec![Default::default(); jobs.len()];
                tracer.trace_batch(&jobs, &TraceSettings { spp, mode, max_bounces }, 3, &mut hits);
                add(&format!("{mode:?} {spp} {max_bounces}"), &hits);
            }
        }
        add("edges", &reference::edges(&tracer, &scene.camera, [60, 41]));
        if name == "maps.obj" || name == "plate.ply" {
            add("shadows", &shadow_segments(&tracer, &ShadowSettings::default(), &|_| true));
        }
    }
    let figure = figures.entry("sky".into()).or_default();
    let mut random = Random(8);
    for _ in 0..200 {
        let way = [0.0; 3].map(|_: f32| random.between(-1.0, 1.0));
        figure.debug(&sky.radiance(Vec3::from(way).normalize_or(Vec3::Y)));
    }
    fs::remove_dir_all(&folder).expect("it is there");
    assert_same("models", &figures);
}

/// A text that is its own debug text.
struct Text(String);

impl std::fmt::Debug for Text {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}
