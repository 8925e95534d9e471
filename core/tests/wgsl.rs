//! The kind `wgsl`: ports and parameters come from a user's file, and what is wrong with it is told where it stands.

use std::{
    collections::BTreeMap,
    fs,
    path::PathBuf,
    sync::atomic::{AtomicU32, Ordering},
};

use epigraph_core::{
    Access, AnyStage, Element, Extent, Format, GraphFile, NodeContext, ParamKind, Pass, PortElement,
    Problems, Scalar, ShaderLibrary, ShaderModule, Threads, wgsl_kind,
};

const GLOW: &str = "
#import frame
struct Params {
    /// Strength of the glow,
    /// where 1 doubles it.
    /// = 0.5 in 0..2
    strength: f32,
    /** Half the width of the kernel.
     * = 3 in 1..16 unit pixels
     */
    radius: u32,
    shift: i32,
}
@group(0) @binding(1) var<uniform> params: Params;
/// What shall glow.
@group(0) @binding(2) var color: texture_2d<f32>;
@group(0) @binding(3) var id: texture_2d<u32>;
struct Lamp { place: vec3<f32>, power: f32 }
@group(0) @binding(4) var<storage, read> lamps: array<Lamp>;
@group(0) @binding(5) var<storage, read_write> counts: array<atomic<u32>>;
/// The glowing image.
@group(0) @binding(6) var image: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(64) fn count() {
    atomicAdd(&counts[0], textureLoad(id, vec2(0), 0).x + u32(lamps[0].power));
}
@compute @workgroup_size(8, 8) fn glow(@builtin(global_invocation_id) at: vec3<u32>) {
    let light = textureLoad(color, at.xy, 0) * params.strength;
    textureStore(image, at.xy, light + f32(frame.index + params.radius) + f32(params.shift));
}
";

/// A folder of its own that goes away with it.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let name = format!("epigraph-wgsl-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(name);
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Left behind it does no harm.
        let _ = fs::remove_dir_all(&self.0);
    }
}

epigraph_core::meanings! {
    /// Distance, metres.
    DEPTH = "depth";
}

/// Makes the stage of a graph with one node whose params are `params`, beside a shader file of that text.
fn make(shader: &str, params: &str) -> Result<Box<dyn AnyStage>, Problems> {
    let folder = Folder::new();
    fs::write(folder.0.join("user.wgsl"), shader).unwrap();
    let graph = folder.0.join("graph.ron");
    let text = format!(
        r#"Graph(
    version: 1,
    nodes: {{
        "mine": (kind: "wgsl", params: ({params})),
    }},
    outputs: {{ "image": "mine.image" }},
)"#
    );
    fs::write(&graph, text).unwrap();
    let file = GraphFile::load(&graph)?;
    let library = ShaderLibrary {
        modules: vec![ShaderModule::new("frame.wgsl", epigraph_shaders::text("shared/frame.wgsl"))],
        ..ShaderLibrary::default()
    };
    let cx = NodeContext {
        file: &file,
        node: file.node("mine").unwrap(),
        connected: &|_| true,
        meaning: &|name| (name == DEPTH.name).then_some(DEPTH),
        library: &library,
        places: &BTreeMap::new(),
    };
    wgsl_kind().make(&cx)
}

fn made(shader: &str, params: &str) -> Box<dyn AnyStage> {
    make(shader, params).unwrap_or_else(|problems| panic!("{problems}"))
}

fn problems(shader: &str, params: &str) -> Problems {
    make(shader, params).err().expect("it should not be made")
}

/// Asserts that there is one problem and that its text holds all the parts.
fn assert_problem(shader: &str, params: &str, parts: &[&str]) {
    let problems = problems(shader, params);
    assert_eq!(problems.0.len(), 1, "{problems}");
    let text = problems.to_string();
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
}

const USER: &str = "shader: \"user.wgsl\"";

#[test]
fn variables_become_ports() {
    let stage = made(GLOW, USER);
    let declaration = stage.declaration();
    assert!(!declaration.cpu && !declaration.needs.atomic64);
    let ports: Vec<_> =
        declaration.ports.iter().map(|port| (&*port.name, port.access, &port.extent)).collect();
    assert_eq!(
        ports,
        [
            ("color", Access::Read, &Extent::Any),
            ("id", Access::Read, &Extent::Any),
            ("lamps", Access::Read, &Extent::Any),
            ("counts", Access::Update, &Extent::Any),
            ("image", Access::Write, &Extent::Like("color".into())),
        ]
    );
    let element = |name| &declaration.ports[declaration.port(name).unwrap()].fields[0].element;
    assert_eq!(*element("color"), Element::AnyFloatTexel);
    assert_eq!(*element("id"), Element::Texel(Format::R32Uint));
    assert_eq!(*element("counts"), u32::element());
    assert_eq!(*element("image"), Element::Texel(Format::Rgba16Float));
    let Element::Item { name, stride, members } = element("lamps") else { panic!("a buffer") };
    assert_eq!((&**name, *stride), ("Lamp", 16));
    let members: Vec<_> = members.iter().map(|m| (&*m.name, m.scalar, m.lanes, m.offset)).collect();
    assert_eq!(members, [("place", Scalar::F32, 3, 0), ("power", Scalar::F32, 1, 12)]);

    assert_eq!(declaration.ports[0].doc, "What shall glow.");
    assert_eq!(declaration.ports[1].doc, "var id: texture_2d<u32>");
}

#[test]
fn each_entry_point_is_a_pass_over_what_it_writes() {
    let stage = made(GLOW, USER);
    let passes: Vec<_> = stage
        .declaration()
        .passes
        .iter()
        .map(|pass| match pass {
            Pass::Compute { entry, threads: Threads::Over(at) } => {
                (&**entry, &*stage.declaration().ports[at.port as usize].name)
            }
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(passes, [("count", "counts"), ("glow", "image")]);
}

#[test]
fn members_become_parameters() {
    let stage = made(GLOW, USER);
    let specs = stage.specs();
    let shown: Vec<_> =
        specs.iter().map(|s| (&*s.name, s.kind.clone(), &*s.default, s.range, &*s.unit, &*s.doc)).collect();
    assert_eq!(
        shown[1..],
        [
            (
                "strength",
                ParamKind::F32,
                "0.5",
                Some((0.0, 2.0)),
                "",
                "Strength of the glow, where 1 doubles it."
            ),
            ("radius", ParamKind::U32, "3", Some((1.0, 16.0)), "pixels", "Half the width of the kernel."),
            ("shift", ParamKind::I32, "0", None, "", ""),
        ]
    );
    assert_eq!(stage.words(), [0.5f32.to_bits(), 3, 0]);
}

#[test]
fn parameters_are_set() {
    let stage = made(GLOW, &format!("{USER}, shift: -2, strength: 1.25"));
    assert_eq!(stage.words(), [1.25f32.to_bits(), 3, -2i32 as u32]);
}

#[test]
fn wrong_parameters_are_told_together() {
    let problems = problems(GLOW, &format!("{USER}, strenght: 1.0, radius: 17, shift: 1.5"));
    let text = problems.to_string();
    assert_eq!(problems.0.len(), 3, "{text}");
    for part in
        ["`strenght`, did you mean `strength`?", "`radius` is 17, outside 1 to 16", "parameter `shift`"]
    {
        assert!(text.contains(part), "`{part}` is not in:\n{text}");
    }
}

#[test]
fn without_an_input_texture_an_output_is_as_large_as_the_frame() {
    let shader = "
        @group(0) @binding(0) var image: texture_storage_2d<r32float, write>;
        @compute @workgroup_size(8, 8) fn main() { textureStore(image, vec2(0), vec4(1.0)); }";
    assert_eq!(made(shader, USER).declaration().ports[0].extent, Extent::Frame(1));
}

#[test]
fn wide_atomics_are_needed_where_they_are_used() {
    let shader = "
        @group(0) @binding(0) var<storage, read_write> keys: array<atomic<u64>>;
        @compute @workgroup_size(64) fn main() { atomicMin(&keys[0], 7lu); }";
    let stage = made(shader, USER);
    assert!(stage.declaration().needs.atomic64);
    assert_eq!(stage.declaration().ports[0].fields[0].element, <[u32; 2]>::element());
}

#[test]
fn the_file_is_named_and_found() {
    assert_problem(GLOW, "", &["graph.ron:4:9", "names its shader file"]);
    assert_problem(GLOW, "shader: \"other.wgsl\"", &["graph.ron:4:49", "cannot read", "/other.wgsl:"]);
    assert_problem(GLOW, "shader: 3", &["graph.ron:4:49", "parameter `shader`", "expected a text in quotes"]);
}

#[test]
fn shader_errors_have_the_shaders_line() {
    let broken = GLOW.replace("* params.strength", "* params.strenth");
    assert_problem(&broken, USER, &["user.wgsl:28:55: node `mine`: shader user.wgsl:", "strenth"]);
    // What is wrong without a line of its own stands where the file is named.
    assert_problem("", USER, &["graph.ron:4:49"]);
}

#[test]
fn what_cannot_be_a_port_is_told() {
    let main = "@compute @workgroup_size(1) fn main() { textureStore(image, vec2(0), vec4(1.0)); }";
    let with = |variable: &str| {
        format!("@group(0) @binding(0) var image: texture_storage_2d<r32float, write>;\n{variable}\n{main}")
    };
    let cases = [
        ("@group(0) @binding(1) var s: sampler;", "`var s: sampler` cannot be a port"),
        ("@group(0) @binding(1) var<uniform> u: vec4<f32>;", "`var<uniform> u: vec4<f32>` cannot be a port"),
        (
            "@group(0) @binding(1) var t: texture_storage_2d<r32float, read>;",
            "is only read; declare it texture_2d",
        ),
        ("@group(1) @binding(1) var t: texture_2d<f32>;", "`t` is in @group(1)"),
        ("@compute @workgroup_size(1) fn idle() {}", "`idle` writes no port"),
        ("@fragment fn paint() {}", "`paint` is not a @compute entry point"),
    ];
    for (variable, part) in cases {
        assert_problem(&with(variable), USER, &["shader user.wgsl", part]);
    }
    assert_problem("", USER, &["it has no @compute entry point"]);
}

#[test]
fn malformed_parameters_are_told() {
    let cases = [
        ("strength: f32", "strength: vec2<f32>", "only f32, u32 and i32"),
        ("strength: f32", "shader: f32", "this name is reserved for the shader file"),
        ("= 0.5 in 0..2", "= 0.5 in 0-2", "`= 0.5 in 0-2` is not of the form"),
        ("= 0.5 in 0..2", "= 0.5 in 2..0", "is not of the form"),
        ("= 0.5 in 0..2", "= 2.5 in 0..2", "its default 2.5: outside its range"),
        ("= 3 in", "= 3.5 in", "its default 3.5: "),
        ("= 0.5 in 0..2", "=", "is not of the form"),
        ("where 1 doubles it.", "= 1.0", "gives the default twice"),
    ];
    for (from, to, part) in cases {
        let shader = GLOW.replace(from, to);
        assert_ne!(shader, GLOW);
        let text = problems(&shader.replace("params.strength", "1.0"), USER).to_string();
        assert!(
            text.contains("shader user.wgsl: parameter `") && text.contains(part),
            "`{part}` is not in:\n{text}"
        );
    }
}

#[test]
fn a_port_that_is_called_like_a_meaning_has_it() {
    let shader = "@group(0) @binding(0) var<storage, read> depth: array<f32>;
        @group(0) @binding(1) var image: texture_storage_2d<r32float, write>;
        @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
            textureStore(image, id.xy, vec4(depth[id.x]));
        }";
    let stage = made(shader, "shader: \"user.wgsl\"");
    let meanings: Vec<_> = stage.declaration().ports.iter().map(|port| port.meaning).collect();
    assert_eq!(meanings, [Some(DEPTH), None]);
}
