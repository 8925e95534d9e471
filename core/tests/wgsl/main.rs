//! The kind `wgsl`: ports and parameters come from a user's file, and what is wrong with it is told where it stands.

mod errors;
mod run;

use std::{
    collections::BTreeMap,
    fs,
    path::PathBuf,
    sync::atomic::{AtomicU32, Ordering},
};

use epigraph_core::{
    Access, AnyStage, CpuContext, EditedTexts, Element, Extent, FieldRef, Format, GraphFile, Io, Lifetime,
    NodeContext, ParamKind, Pass, Port, PortElement, Problems, Quantity, Registry, Rule, Runs, Scalar,
    ShaderModule, Shape, Stage, Threads, WgslFile, wgsl_kind,
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

/// Has a meaning, a quantity and a column for others to name.
struct Ranged;

const LAMPS: Quantity = Quantity { name: "lamps", one: "street lamp" };

impl Stage for Ranged {
    const KIND: &'static str = "ranged";
    const DOC: &'static str = "Depths of lamps.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.write::<f32>("range", DEPTH, LAMPS.list());
        io.column("P1");
        Self
    }

    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

/// Makes the stage of a graph with one node whose params are `params`, beside a shader file of that text.
fn make(shader: &str, params: &str) -> Result<Box<dyn AnyStage>, Problems> {
    make_with(shader, params, "\"more\": \"other.more\"", &|_| true)
}

/// The same without parameters and inputs.
fn unconnected(shader: &str) -> Result<Box<dyn AnyStage>, Problems> {
    make_with(shader, USER, "", &|_| false)
}

fn make_with(
    shader: &str,
    params: &str,
    inputs: &str,
    connected: &dyn Fn(&str) -> bool,
) -> Result<Box<dyn AnyStage>, Problems> {
    let folder = Folder::new();
    fs::write(folder.0.join("user.wgsl"), shader).unwrap();
    let graph = folder.0.join("graph.ron");
    let text = format!(
        r#"Graph(
    version: 1,
    nodes: {{
        "mine": (kind: "wgsl", params: ({params}), inputs: {{ {inputs} }}),
    }},
    outputs: {{ "image": "mine.image" }},
)"#
    );
    fs::write(&graph, text).unwrap();
    let file = GraphFile::load(&graph)?;
    let registry = Registry::default()
        .with::<Ranged>()
        .with_module(ShaderModule::new("frame.wgsl", epigraph_shaders::text("shared/frame.wgsl")));
    let cx = NodeContext {
        file: &file,
        node: file.node("mine").unwrap(),
        connected,
        registry: &registry,
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

/// What a file with this text declares by itself.
fn file(text: &str) -> Result<WgslFile, Problems> {
    let text = text.to_owned();
    let registry = Registry::default()
        .with::<Ranged>()
        .with_module(ShaderModule::new("frame.wgsl", epigraph_shaders::text("shared/frame.wgsl")))
        .with_edited(EditedTexts::new(move |file| (file == "user.wgsl").then(|| text.as_str().into())));
    WgslFile::load("user.wgsl".as_ref(), &registry)
}

#[test]
fn a_file_tells_what_it_declares_and_what_a_node_assumes() {
    let text = "//! Counts.
struct Params {
    /// = 3 in 3..3 unit pixels
    radius: u32,
    loud: u32,
    shift: f32,
    /// = true
    up: u32,
}
@group(0) @binding(0) var<uniform> params: Params;
#ifdef HAS_GIVEN
/// = optional
@group(0) @binding(1) var<storage, read> given: array<u32>;
#endif
@group(0) @binding(2) var<storage, read_write> list: array<u32>;
@group(0) @binding(3) var image: texture_storage_2d<r32float, write>;
#ifdef UP
@compute @workgroup_size(8, 8) fn main() { textureStore(image, vec2(0), vec4(params.shift)); }
#endif
@compute @workgroup_size(64) fn count() {
    list[0] = params.radius + params.loud + params.up;
#ifdef HAS_GIVEN
    list[1] = given[0];
#endif
}
";
    let found = file(text).unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!(found.doc, "Counts.");
    let specs: Vec<_> =
        found.specs.iter().map(|spec| (&*spec.name, &spec.kind, &*spec.default, &*spec.unit)).collect();
    assert_eq!(
        specs,
        [
            ("radius", &ParamKind::U32, "3", "pixels"),
            ("loud", &ParamKind::U32, "0", ""),
            ("shift", &ParamKind::F32, "0.0", ""),
            ("up", &ParamKind::Bool, "true", ""),
        ]
    );
    let ports: Vec<_> =
        found.declaration.ports.iter().map(|port| (&*port.name, port.access, port.optional)).collect();
    assert_eq!(
        ports,
        [("given", Access::Read, true), ("list", Access::Update, false), ("image", Access::Write, false)]
    );
    assert!(!found.declaration.needs.atomic64 && found.declaration.passes.len() == 2);
    let updated = "`list` is updated in place; `= output` would have it written anew.";
    assert_eq!(
        found.assumed,
        [
            updated,
            "`image` is as large as the frame.",
            "`main` has a thread for each element of `image`, the first port that it writes.",
            "`count` has a thread for each element of `list`, the first port that it writes.",
        ]
    );
    let keys = "var<storage, read_write> list: array<atomic<u64>>";
    let main = "@compute @workgroup_size(64) fn main() { atomicMin(&list[0], 7lu); }";
    let found = file(&whole(&[("", "var color: texture_2d<f32>"), ("", keys), ("", IMAGE)], main)).unwrap();
    assert_eq!(
        found.assumed,
        [
            updated,
            "`image` is as large as `color`, the first input texture.",
            "`main` has a thread for each element of `list`, the first port that it writes.",
            "The device has 64-bit atomics.",
        ]
    );
    // Problems stand in the file.
    let text = file(&text.replace("3 in 3..3", "3 in 4..3")).unwrap_err().to_string();
    assert!(text.starts_with("user.wgsl:3:"), "{text}");
}

#[test]
fn the_shader_files_of_a_graph_are_those_of_its_nodes_of_this_kind() {
    let text = r#"Graph(version: 1, nodes: {
        "mine": (kind: "wgsl", params: (shader: "user.wgsl")),
        "other": (kind: "ranged", params: (shader: "other.wgsl")),
    }, outputs: {})"#;
    let file = GraphFile::parse("deep/graph.ron", text).unwrap();
    assert_eq!(file.shaders(), [("mine".to_owned(), PathBuf::from("deep/user.wgsl"))]);
}

/// A shader with these declarations above its bound variables.
fn whole(lines: &[(&str, &str)], entry: &str) -> String {
    let mut text = String::from("#import frame\n");
    for (binding, (declaration, variable)) in lines.iter().enumerate() {
        text += &format!("{declaration}\n@group(0) @binding({}) {variable};\n", binding + 1);
    }
    text + entry
}

const READ: &str = "var<storage, read> given: array<u32>";
const LIST: &str = "var<storage, read_write> list: array<u32>";
const IMAGE: &str = "var image: texture_storage_2d<r32float, write>";
const MAIN: &str = "@compute @workgroup_size(8, 8) fn main() { textureStore(image, vec2(0), vec4(1.0)); }\n";

/// The port `list` with a declaration.
fn list(declaration: &str) -> Port {
    let stage = made(&whole(&[(declaration, LIST), ("", READ), ("", IMAGE)], MAIN), USER);
    stage.declaration().ports[0].clone()
}

#[test]
fn extents_are_declared() {
    let cases = [
        ("per pixel", Extent::Frame(1)),
        ("per 4x4 pixels", Extent::Frame(4)),
        ("0.25 per pixel", Extent::PerPixel(0.25)),
        ("per corner", Extent::Corners),
        ("per request", Extent::Requests),
        ("per street lamp", LAMPS.list()),
        ("like given", Extent::Like("given".into())),
        ("bit per element of given", Extent::BitsOf("given".into())),
        ("4096 elements", Extent::Fixed([4096, 1])),
        ("1 element", Extent::Fixed([1, 1])),
        ("16x9", Extent::Fixed([16, 9])),
    ];
    for (text, extent) in cases {
        let port = list(&format!("/// Numbers.\n/// = output, {text}\n/// Many."));
        assert_eq!((port.access, &port.extent), (Access::Write, &extent), "{text}");
        assert_eq!(port.doc, "Numbers. Many.");
        // Of what is updated, the extent is checked.
        let port = list(&format!("/// = {text}"));
        assert_eq!((port.access, port.extent), (Access::Update, extent), "{text}");
    }
}

#[test]
fn roles_are_declared() {
    let role = |declaration| {
        let port = list(declaration);
        (port.access, port.lifetime, port.scratch)
    };
    assert_eq!(role(""), (Access::Update, Lifetime::Transient, false));
    assert_eq!(role("/// = output, per pixel"), (Access::Write, Lifetime::Transient, false));
    assert_eq!(role("/// = scratch, per pixel"), (Access::Write, Lifetime::Transient, true));
    assert_eq!(role("/// = per pixel\n/// = kept"), (Access::Write, Lifetime::Persistent, false));
    assert_eq!(role("/** = scratch, kept, per pixel */"), (Access::Write, Lifetime::Persistent, true));

    let stage = made(&whole(&[("/// = last frame", READ), ("", IMAGE)], MAIN), USER);
    assert_eq!(stage.declaration().ports[0].access, Access::History);
}

#[test]
fn ranges_of_values_are_declared() {
    for (declaration, rules) in [
        ("", vec![]),
        ("/// = any value", vec![Rule::any()]),
        ("/// = in 0..5", vec![Rule::wholes(0, 5)]),
        ("/// = in -3..-3", vec![Rule::wholes(-3, -3)]),
    ] {
        assert_eq!(*list(declaration).rules, rules, "{declaration}");
    }
    let floats = "var<storage, read_write> list: array<vec2<f32>>";
    let stage = made(&whole(&[("/// = in 0.5..1.5", floats), ("", IMAGE)], MAIN), USER);
    assert_eq!(*stage.declaration().ports[0].rules, [Rule::floats(0.5, 1.5)]);
}

#[test]
fn meanings_are_declared() {
    assert_eq!(list("/// = means depth").meaning, Some(DEPTH));
    assert_eq!(list("").meaning, None);
}

#[test]
fn an_output_is_not_as_large_as_the_frame_before() {
    let texture = |name: &str| format!("var {name}: texture_2d<f32>");
    let (before, aside, color) = (texture("before"), texture("aside"), texture("color"));
    let lines: [(&str, &str); 4] =
        [("/// = last frame", &before), ("/// = optional", &aside), ("", &color), ("", IMAGE)];
    let extent = |lines: &[(&str, &str)]| {
        let stage = made(&whole(lines, MAIN), USER);
        stage.declaration().ports.last().unwrap().extent.clone()
    };
    assert_eq!(extent(&lines), Extent::Like("color".into()));
    assert_eq!(extent(&[lines[0], lines[1], lines[3]]), Extent::Frame(1));
}

const BUNDLE: &[(&str, &str)] = &[
    ("/// All points.\n/// = field of cloud, optional", "var<storage, read> cloud_radiance: array<u32>"),
    ("/// = field of cloud", "var<storage, read> cloud_meta: array<u32>"),
    ("", IMAGE),
];

#[test]
fn fields_make_a_bundle() {
    let stage = made(&whole(BUNDLE, MAIN), USER);
    let [cloud, image] = &stage.declaration().ports[..] else { panic!("two ports") };
    assert_eq!((&*cloud.name, cloud.access, cloud.optional), ("cloud", Access::Read, true));
    assert_eq!((&*cloud.doc, &*image.name), ("All points.", "image"));
    let fields: Vec<_> = cloud.fields.iter().map(|field| &*field.name).collect();
    assert_eq!(fields, ["radiance", "meta"]);

    // One that is written makes it an update of all.
    let updated =
        whole(BUNDLE, MAIN).replace("read> cloud_meta", "read_write> cloud_meta").replace(", optional", "");
    let stage = made(&updated, USER);
    assert_eq!(stage.declaration().ports[0].access, Access::Update);
    let written = updated.replace("read> cloud_radiance", "read_write> cloud_radiance");
    let written = written.replace(
        "field of cloud\n@group(0) @binding(2)",
        "field of cloud, kept, per pixel\n@group(0) @binding(2)",
    );
    let port = &made(&written, USER).declaration().ports[0].clone();
    assert_eq!(
        (port.access, port.lifetime, &port.extent),
        (Access::Write, Lifetime::Persistent, &Extent::Frame(1))
    );
}

#[test]
fn threads_are_declared() {
    let threads = |declaration: &str| {
        let main = format!("{declaration}\n{MAIN}");
        let stage = made(&whole(&[BUNDLE[0], BUNDLE[1], ("", LIST), ("", IMAGE)], &main), USER);
        match &stage.declaration().passes[..] {
            [Pass::Compute { threads, .. }] => *threads,
            other => panic!("{other:?}"),
        }
    };
    let at = |port, field| FieldRef { port, field };
    assert_eq!(threads("/// Draws."), Threads::Over(at(2, 0)));
    assert_eq!(threads("/// = over list"), Threads::Over(at(1, 0)));
    assert_eq!(threads("/// = over cloud_meta"), Threads::Over(at(0, 1)));
    assert_eq!(threads("/// = over cloud"), Threads::Over(at(0, 0)));
    assert_eq!(threads("/// = one per 256 of list"), Threads::Blocks(at(1, 0), 256));
    assert_eq!(threads("/// = 16 groups"), Threads::Groups(16));
    assert_eq!(threads("/// = 1 group"), Threads::Groups(1));
}

#[test]
fn draws_are_declared() {
    let shader = whole(
        &[("", READ), ("", IMAGE), ("", &IMAGE.replace("image", "other").replace("r32float", "r32uint"))],
        "/// = draw 6 triangle vertices per given into other and image, fragment paint, depth, clear 4294967295
        @vertex fn place() -> @builtin(position) vec4<f32> { return vec4(f32(given[0])); }
        struct Colors { @location(0) id: u32, @location(1) light: vec4<f32> }
        @fragment fn paint() -> Colors { return Colors(1u, vec4(1.0)); }
        /// = draw 2 line vertices per given into image, fragment shade
        @vertex fn again() -> @builtin(position) vec4<f32> { return vec4(f32(given[0])); }
        @fragment fn shade() -> @location(0) f32 { return 1.0; }
        /// = groups from given
        @compute @workgroup_size(64) fn last() {}",
    );
    let at = |port| FieldRef { port, field: 0 };
    let draw = Pass::Draw {
        vertex: "place".into(),
        fragment: "paint".into(),
        shape: Shape::Triangles,
        vertices: 6,
        count: at(0),
        targets: vec![at(2), at(1)],
        depth: true,
        clear: 4294967295.0,
    };
    let again = Pass::Draw {
        vertex: "again".into(),
        fragment: "shade".into(),
        shape: Shape::Lines,
        vertices: 2,
        count: at(0),
        targets: vec![at(1)],
        depth: false,
        clear: 0.0,
    };
    let last = Pass::Compute { entry: "last".into(), threads: Threads::Indirect(at(0)) };
    assert_eq!(made(&shader, USER).declaration().passes, [draw, again, last]);
}

#[test]
fn the_file_is_documented_and_declared_at_its_top() {
    let text = format!("//! Draws.\n//! = per view, column P1\n{}", whole(&[("", IMAGE)], MAIN));
    let stage = made(&text, USER);
    assert_eq!(stage.declaration().runs, Runs::PerView);
    assert_eq!(stage.declaration().column, Some("P1"));
}

const CHOICE: &str = "
struct Params {
    /// = Tent of Tent, WideBox
    kernel: u32,
    /// = true
    merge: u32,
}
@group(0) @binding(1) var<uniform> params: Params;
/// = output, per pixel
@group(0) @binding(2) var<storage, read_write> list: array<u32>;
#ifdef MERGE
/// = scratch, 7 elements
@group(0) @binding(3) var<storage, read_write> merged: array<u32>;
#endif
@compute @workgroup_size(8, 8) fn main() {
#ifdef KERNEL_WIDE_BOX
    list[0] = select(1u, 2u, params.kernel == KERNEL_WIDE_BOX);
#else
    list[0] = select(1u, 2u, params.kernel == KERNEL_TENT);
#endif
}
#ifdef MERGE
@compute @workgroup_size(64) fn merge() { merged[0] = params.merge; }
#endif
";

#[test]
fn choices_are_set_by_name() {
    let stage = made(CHOICE, USER);
    let kinds: Vec<_> = stage.specs().into_iter().map(|spec| (spec.kind, spec.default)).collect();
    let choice = ParamKind::Choice(vec!["Tent".into(), "WideBox".into()]);
    assert_eq!(kinds[1..], [(choice, "Tent".to_owned()), (ParamKind::Bool, "true".to_owned())]);
    assert_eq!(stage.words(), [0, 1]);
    let shape = |stage: &dyn AnyStage| (stage.declaration().ports.len(), stage.declaration().passes.len());
    assert_eq!(shape(&*stage), (2, 2));

    let stage = made(CHOICE, &format!("{USER}, kernel: WideBox, merge: false"));
    assert_eq!(stage.words(), [1, 0]);
    assert_eq!(shape(&*stage), (1, 1));

    assert_problem(
        CHOICE,
        &format!("{USER}, kernel: Widebox"),
        &["graph.ron:4:", "parameter `kernel`: there is no `Widebox`; expected one of Tent, WideBox"],
    );
    assert_problem(
        CHOICE,
        &format!("{USER}, kernel: \"Tent\""),
        &["graph.ron:4:", "expected one of Tent, WideBox"],
    );
    assert_problem(CHOICE, &format!("{USER}, merge: 1"), &["graph.ron:4:", "expected true or false"]);
}
