//! Shaders against declarations: what fits passes, and every kind of misfit is told with what to change.

use epigraph_core::{
    Access, CpuContext, Declaration, EditedTexts, Element, Extent, Field, FieldRef, Format, Frame,
    GraphError, GraphFile, Io, Lifetime, Member, Needs, ParamKind, ParamSpec, Pass, Port, PortElement,
    Reflected, Registry, Shader, ShaderLibrary, ShaderModule, Shape, Space, Stage, Threads, check_shader,
    check_stage, compose_shader, item, texel,
};

const FRAME: &str = epigraph_shaders::text("shared/frame.wgsl");
const INDEX: &str = epigraph_shaders::text("shared/index.wgsl");

item! {
    /// An element with a hole that the padding fills.
    pub struct Point {
        /// Place.
        position: [f32; 3],
        /// Frames since it was sampled.
        age: u32,
    }
}

fn library() -> ShaderLibrary {
    ShaderLibrary {
        modules: vec![ShaderModule::new("shared/frame.wgsl", FRAME), ShaderModule::new("index", INDEX)],
        ..ShaderLibrary::default()
    }
}

fn shader(source: &str, defines: &[&'static str]) -> Shader {
    let defines = defines.iter().map(|&name| name.into()).collect();
    Shader { defines, ..Shader::new("test.wgsl", source.to_owned()) }
}

fn compose(source: &str) -> Reflected {
    compose_shader(&shader(source, &[]), &library(), Needs::default())
        .unwrap_or_else(|error| panic!("{error}"))
}

fn compose_error(source: &str) -> String {
    compose_shader(&shader(source, &[]), &library(), Needs::default())
        .expect_err("it should not compose")
        .to_string()
}

fn port(name: &'static str, access: Access, element: Element) -> Port {
    Port {
        name: name.into(),
        doc: "A port.".into(),
        access,
        fields: vec![Field { name: "".into(), element }],
        meaning: None,
        scratch: false,
        rules: Default::default(),
        extent: Extent::Any,
        extent_on_cpu: None,
        lifetime: Lifetime::Transient,
        optional: false,
        table: &[],
    }
}

fn declaration(ports: Vec<Port>) -> Declaration {
    let threads = Threads::Over(FieldRef { port: 0, field: 0 });
    Declaration {
        ports,
        passes: vec![Pass::Compute { entry: "main".into(), threads }],
        ..Declaration::default()
    }
}

fn spec(name: &str, kind: ParamKind) -> ParamSpec {
    ParamSpec {
        name: name.into(),
        doc: String::new(),
        unit: String::new(),
        kind,
        range: None,
        default: "0".into(),
    }
}

/// The texts of all misfits.
fn misfits(source: &str, declaration: &Declaration, specs: &[ParamSpec]) -> Vec<String> {
    check_shader(&compose(source), "test.wgsl", declaration, specs)
        .iter()
        .map(GraphError::to_string)
        .collect()
}

/// Asserts that there is one misfit and that its text holds all the parts.
fn assert_misfit(source: &str, declaration: &Declaration, specs: &[ParamSpec], parts: &[&str]) {
    let found = misfits(source, declaration, specs);
    assert_eq!(found.len(), 1, "{found:#?}");
    for part in parts {
        assert!(found[0].contains(part), "`{part}` is not in:\n{}", found[0]);
    }
}

const MAIN: &str = "@compute @workgroup_size(8, 8) fn main() {}\n";

fn with_main(variables: &str) -> String {
    format!("{variables}\n{MAIN}")
}

fn depth_in() -> Port {
    port("depth", Access::Read, texel::R32Float::element())
}

fn color_out() -> Port {
    port("color", Access::Write, texel::Rgba16Float::element())
}

fn cloud() -> Port {
    let field = |name: &'static str, element| Field { name: name.into(), element };
    let fields = vec![field("points", Point::element()), field("meta", u32::element())];
    Port { fields, ..port("cloud", Access::Update, u32::element()) }
}

const CLOUD: &str = "
    struct Point { position: vec3<f32>, age: u32 }
    @group(0) @binding(2) var<storage, read_write> cloud_points: array<Point>;
    @group(0) @binding(3) var<storage, read_write> cloud_meta: array<atomic<u32>>;";

#[test]
fn a_fitting_shader_passes() {
    let source = "
        #import frame
        #import index
        struct Params { threshold: f32, diagonal: u32, shift: i32 }
        struct Point { position: vec3<f32>, age: u32 }
        const SIZE = 64u;
        var<workgroup> sums: array<atomic<u32>, 64>;
        @group(0) @binding(1) var<uniform> params: Params;
        @group(0) @binding(2) var<storage, read_write> cloud_points: array<Point>;
        @group(0) @binding(3) var<storage, read_write> cloud_meta: array<atomic<u32>>;
        @group(0) @binding(4) var depth: texture_2d<f32>;
        @group(0) @binding(5) var color: texture_storage_2d<rgba16float, write>;
        @compute @workgroup_size(SIZE) fn main(
            @builtin(global_invocation_id) id: vec3<u32>,
            @builtin(num_workgroups) groups: vec3<u32>,
        ) {
            let i = linear_index(id, groups, SIZE);
            atomicAdd(&sums[i % SIZE], frame.seed);
            cloud_points[i].age += params.diagonal + atomicLoad(&cloud_meta[i]);
            textureStore(color, id.xy, textureLoad(depth, id.xy, 0) * params.threshold);
        }";
    let specs = [
        spec("threshold", ParamKind::F32),
        spec("path", ParamKind::Text),
        spec("diagonal", ParamKind::Bool),
        spec("shift", ParamKind::I32),
    ];
    let reflected = compose(source);
    let declared = declaration(vec![cloud(), depth_in(), color_out()]);
    assert_eq!(check_shader(&reflected, "test.wgsl", &declared, &specs), []);

    let (_, main) = reflected.entry("main").unwrap();
    let mut used: Vec<&str> =
        main.uses.iter().map(|&index| reflected.variables[index].name.as_str()).collect();
    used.sort_unstable();
    assert_eq!(used, ["cloud_meta", "cloud_points", "color", "depth", "frame", "params"]);
    assert_eq!((main.workgroup_size, main.workgroup_bytes), ([64, 1, 1], 256));
}

#[test]
fn the_frame_module_mirrors_the_frame() {
    let reflected = compose(&format!("#import frame\n{MAIN}"));
    let (_, frame) = reflected.variable("frame").unwrap();
    assert_eq!((frame.group, frame.binding), (0, 0));
    assert_eq!(frame.space, Space::Uniform(Frame::element()));
}

#[test]
fn a_moved_frame_member_is_found() {
    let moved = FRAME.replace("near: f32", "nearest: f32");
    assert_ne!(moved, FRAME);
    assert_misfit(
        &with_main(&moved),
        &declaration(vec![]),
        &[],
        &["`view.nearest: f32` at byte 12", "expected member `view.near: f32` at byte 12"],
    );
    let grown = FRAME.replace("samples: u32,", "samples: u32, more: vec4<f32>,");
    assert_misfit(
        &with_main(&grown),
        &declaration(vec![]),
        &[],
        &["`more: vec4<f32>` at byte 224 is not expected"],
    );
}

#[test]
fn a_linear_index_is_a_plain_function() {
    let source = "
        #import index
        @group(0) @binding(0) var<storage, read_write> list: array<u32>;
        @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
            list[0] = linear_index(id, id, 64u);
        }";
    let list = port("list", Access::Write, u32::element());
    assert_eq!(misfits(source, &declaration(vec![list]), &[]), [""; 0]);
}

#[test]
fn a_missing_variable_is_told_with_its_declaration() {
    let source = with_main(
        "@group(0) @binding(0) var<storage, read_write> cloud_points: array<Point>; struct Point { position: vec3<f32>, age: u32 }",
    );
    assert_misfit(
        &source,
        &declaration(vec![cloud()]),
        &[],
        &[
            "test.wgsl",
            "port `cloud` has no variable `cloud_meta`",
            "@group(0) @binding(1) var<storage, read_write> cloud_meta: array<u32>;",
        ],
    );
    assert_misfit(
        MAIN,
        &declaration(vec![color_out()]),
        &[],
        &["port `color` has no variable `color`; add `@group(0) @binding(0) var color: "],
    );
}

#[test]
fn a_near_name_is_hinted_on_both_sides() {
    let found = misfits(
        &with_main("@group(0) @binding(0) var dept: texture_2d<f32>;"),
        &declaration(vec![depth_in()]),
        &[],
    );
    assert_eq!(found.len(), 2, "{found:#?}");
    assert!(found[0].contains("@binding(1) var depth: texture_2d<f32>;`, or rename `dept`"), "{}", found[0]);
    assert!(found[1].contains("unknown variable `dept`, did you mean `depth`?"), "{}", found[1]);
}

#[test]
fn optional_ports_may_be_absent() {
    let optional = Port { optional: true, ..depth_in() };
    let written = Port { optional: true, ..color_out() };
    assert_eq!(misfits(MAIN, &declaration(vec![optional, written]), &[]), [""; 0]);
}

#[test]
fn wrong_kinds_of_variable_are_told() {
    let cases = [
        ("var<storage, read> depth: array<f32>;", "`var depth: texture_2d<f32>`"),
        ("var depth: texture_3d<f32>;", "the shader has `var depth: texture_3d<f32>`"),
        ("var depth: texture_2d<u32>;", "its format is r32float"),
        ("var depth: texture_storage_2d<r32float, read>;", "an input is read as a sampled texture"),
        ("var depth: sampler;", "the shader has `var depth: sampler`"),
    ];
    for (variable, part) in cases {
        let source = with_main(&format!("@group(0) @binding(0) {variable}"));
        assert_misfit(&source, &declaration(vec![depth_in()]), &[], &["port `depth`", part]);
    }
}

#[test]
fn outputs_are_storage_textures_of_their_format() {
    let cases = [
        ("var color: texture_2d<f32>;", "declare it `var color: texture_storage_2d<rgba16float, write>`"),
        ("var color: texture_storage_2d<rgba32float, write>;", "its format is rgba16float"),
        ("var color: texture_storage_2d<rgba16float, read>;", "textureStore"),
    ];
    for (variable, part) in cases {
        let source = with_main(&format!("@group(0) @binding(0) {variable}"));
        assert_misfit(&source, &declaration(vec![color_out()]), &[], &["port `color`", part]);
    }
}

#[test]
fn inputs_are_not_writable() {
    for access in [Access::Read, Access::History] {
        assert_misfit(
            &with_main("@group(0) @binding(0) var<storage, read_write> list: array<u32>;"),
            &declaration(vec![port("list", access, u32::element())]),
            &[],
            &["an input is only read", "declare it `var<storage, read> list: array<u32>`"],
        );
    }
}

#[test]
fn outputs_are_writable() {
    assert_misfit(
        &with_main("@group(0) @binding(0) var<storage, read> list: array<u32>;"),
        &declaration(vec![port("list", Access::Write, u32::element())]),
        &[],
        &["no variable of it is writable", "`var<storage, read_write> list: array<u32>`"],
    );
}

#[test]
fn element_types_are_compared() {
    let cases = [
        ("array<f32>", "its elements are f32, expected its elements are u32"),
        ("array<vec2<u32>>", "its elements are vec2<u32>"),
        ("array<atomic<i32>>", "its elements are i32"),
        ("array<u32, 4>", "it is a buffer of 32-bit scalars"),
        ("array<mat4x4<f32>>", "it is a buffer of 32-bit scalars"),
    ];
    for (ty, part) in cases {
        let source = with_main(&format!("@group(0) @binding(0) var<storage, read_write> list: {ty};"));
        assert_misfit(
            &source,
            &declaration(vec![port("list", Access::Update, u32::element())]),
            &[],
            &[part],
        );
    }
}

#[test]
fn struct_layouts_are_compared() {
    let declared = declaration(vec![cloud()]);
    assert_eq!(misfits(&with_main(CLOUD), &declared, &[]), [""; 0]);
    let cases = [
        (
            "struct Point { position: vec3<f32>, years: u32 }",
            "member `years: u32` at byte 12, expected member `age",
        ),
        (
            "struct Point { age: u32, position: vec3<f32> }",
            "member `age: u32` at byte 0, expected member `position",
        ),
        (
            "struct Point { position: vec3<f32>, age: f32 }",
            "member `age: f32` at byte 12, expected member `age: u32`",
        ),
        ("struct Point { position: vec3<f32> }", "member `age: u32` at byte 12 is missing"),
        (
            "struct Point { position: vec3<f32>, age: u32, id: u32 }",
            "member `id: u32` at byte 16 is not expected",
        ),
        (
            "struct Point { position: vec3<f32>, @size(8) age: u32 }",
            "one element takes 32 bytes, expected 16",
        ),
    ];
    for (written, part) in cases {
        let source = with_main(&CLOUD.replace("struct Point { position: vec3<f32>, age: u32 }", written));
        let expected = "with struct Point { position: vec3<f32>, age: u32 }";
        assert_misfit(&source, &declared, &[], &["port `cloud`", part, expected]);
    }
    assert_misfit(&with_main(&CLOUD.replace("Point", "Dot")), &declared, &[], &["its struct is named Point"]);
    // A struct within a struct cannot be told in one line.
    let Element::Item { name, stride, members } = Point::element() else { panic!("a struct") };
    let renamed =
        |member: &Member| Member { name: format!("inner.{}", member.name).into(), ..member.clone() };
    let members = vec![members[0].clone(), renamed(&members[1])].into();
    let nested = declaration(vec![port("list", Access::Update, Element::Item { name, stride, members })]);
    let list = "struct Point { position: vec3<f32>, age: u32 }
        @group(0) @binding(0) var<storage, read_write> list: array<Point>;";
    let found = misfits(&with_main(list), &nested, &[]);
    assert!(found.len() == 1 && found[0].contains("expected member `inner.age"), "{found:#?}");
    assert!(!found[0].contains("with struct"), "{found:#?}");
}

#[test]
fn params_are_compared() {
    let specs = [spec("low", ParamKind::F32), spec("count", ParamKind::U32)];
    let declared = declaration(vec![]);
    let params = |text: &str| {
        with_main(&format!("struct Params {text} @group(0) @binding(0) var<uniform> params: Params;"))
    };
    assert_eq!(misfits(&params("{ low: f32, count: u32 }"), &declared, &specs), [""; 0]);
    assert_eq!(misfits(MAIN, &declared, &specs), [""; 0]);

    let cases = [
        ("{ count: u32, low: f32 }", "member `count: u32` at byte 0, expected member `low: f32` at byte 0"),
        ("{ low: f32 }", "member `count: u32` at byte 4 is missing"),
        ("{ low: f32, count: i32 }", "expected member `count: u32`"),
        ("{ low: f32, @align(16) count: u32 }", "at byte 16, expected member `count: u32` at byte 4"),
    ];
    for (written, part) in cases {
        let expected = "with struct Params { low: f32, count: u32 }";
        assert_misfit(&params(written), &declared, &specs, &[part, expected]);
    }
    assert_misfit(
        &params("{ low: f32 }"),
        &declared,
        &[],
        &["no parameters; remove `var<uniform> params: Params`"],
    );
    assert_misfit(
        &with_main("@group(0) @binding(0) var<storage, read> params: array<f32>;"),
        &declared,
        &specs,
        &["declare it `var<uniform> params: Params`"],
    );
}

#[test]
fn groups_and_bindings_are_checked() {
    let declared = declaration(vec![depth_in()]);
    assert_misfit(
        &with_main("@group(1) @binding(0) var depth: texture_2d<f32>;"),
        &declared,
        &[],
        &["`depth` is in @group(1)", "@group(0)"],
    );
    assert_misfit(
        &with_main("#import frame\n@group(0) @binding(0) var depth: texture_2d<f32>;"),
        &declared,
        &[],
        &["`frame` and `depth` both have @binding(0)"],
    );
}

#[test]
fn entry_points_are_checked() {
    let declared = declaration(vec![]);
    assert_misfit(
        "@compute @workgroup_size(1) fn mian() {}",
        &declared,
        &[],
        &["unknown entry point `main`, did you mean `mian`?", "@compute"],
    );
    assert_misfit("@fragment fn main() {}", &declared, &[], &["`main` is @fragment", "to be @compute"]);
}

/// A draw of triangles for each element of `list` into these targets.
fn raster(targets: Vec<Port>) -> Declaration {
    let at = |port| FieldRef { port, field: 0 };
    let draw = Pass::Draw {
        vertex: "place".into(),
        fragment: "paint".into(),
        shape: Shape::Triangles,
        vertices: 6,
        count: at(0),
        targets: (1..=targets.len() as u16).map(at).collect(),
        depth: false,
        clear: 0.0,
    };
    let compute = Pass::Compute { entry: "main".into(), threads: Threads::Over(at(0)) };
    let list = port("list", Access::Read, <[f32; 4]>::element());
    Declaration {
        ports: [list].into_iter().chain(targets).collect(),
        passes: vec![draw, compute],
        ..Declaration::default()
    }
}

fn ids() -> Port {
    port("ids", Access::Write, texel::R32Uint::element())
}

const RASTER: &str = "
    @group(0) @binding(0) var<storage, read> list: array<vec4<f32>>;
    struct Vertex { @builtin(position) position: vec4<f32>, @location(0) size: f32 }
    @vertex fn place(@builtin(vertex_index) i: u32) -> Vertex { return Vertex(list[i / 6u], 1.0); }
    @fragment fn paint() -> @location(0) u32 { return 1u; }
    @compute @workgroup_size(8, 8) fn main() {}";

#[test]
fn targets_may_be_absent_or_read_but_not_by_their_pass() {
    let declared = raster(vec![ids()]);
    let ids = "@group(0) @binding(1) var ids: texture_2d<u32>;";
    assert_eq!(misfits(RASTER, &declared, &[]), [""; 0]);
    assert_eq!(misfits(&format!("{RASTER}\n{ids}"), &declared, &[]), [""; 0]);
    let circular = RASTER.replace("return 1u", "return textureLoad(ids, vec2(0), 0).x");
    assert_misfit(&format!("{circular}\n{ids}"), &declared, &[], &["`paint` uses `ids`", "draws to"]);
}

#[test]
fn one_field_of_a_bundle_may_be_a_target() {
    let field = |name: &'static str, element| Field { name: name.into(), element };
    let fields = vec![field("ids", texel::R32Uint::element()), field("sums", u32::element())];
    let declared = raster(vec![Port { fields, ..port("out", Access::Write, u32::element()) }]);
    let sums = "@group(0) @binding(1) var<storage, read_write> out_sums: array<u32>;";
    assert_eq!(misfits(&format!("{RASTER}\n{sums}"), &declared, &[]), [""; 0]);
    assert_misfit(RASTER, &declared, &[], &["port `out` has no variable `out_sums`"]);
}

#[test]
fn the_entry_points_of_a_draw_are_checked() {
    let declared = raster(vec![ids()]);
    let cases = [
        (
            "@vertex fn place",
            "@vertex fn plaice",
            "unknown entry point `place`, did you mean `plaice`?; the stage runs it as @vertex",
        ),
        (
            "@fragment fn paint",
            "@fragment fn pain",
            "unknown entry point `paint`, did you mean `pain`?; the stage runs it as @fragment",
        ),
        (
            "@fragment fn paint() -> @location(0) u32 { return 1u; }",
            "@compute @workgroup_size(1) fn paint() {}",
            "`paint` is @compute; this pass needs it to be @fragment",
        ),
        (
            "@builtin(vertex_index) i: u32",
            "@builtin(vertex_index) i: u32, @builtin(instance_index) j: u32",
            "`place` takes @builtin(instance_index), which is always 0; the element is @builtin(vertex_index) / 6u",
        ),
        (
            "@builtin(vertex_index) i: u32",
            "@builtin(vertex_index) i: u32, @location(3) at: vec2<f32>",
            "`place` takes @location(3), but there are no vertex buffers",
        ),
        (
            "return Vertex(list[i / 6u], 1.0);",
            "sums[0] = 1u; return Vertex(list[i / 6u], 1.0);",
            "`place` uses `sums`, which is writable",
        ),
        (
            "fn paint()",
            "fn paint(@location(1) size: f32)",
            "`paint` takes f32 at @location(1), but `place` returns nothing",
        ),
        (
            "fn paint()",
            "fn paint(@location(0) size: vec2<f32>)",
            "`paint` takes vec2<f32> at @location(0), but `place` returns f32",
        ),
        (
            "fn paint()",
            "fn paint(@location(0) @interpolate(flat) size: f32)",
            "`place` returns it with another @interpolate",
        ),
    ];
    let sums = "@group(0) @binding(1) var<storage, read_write> sums: array<u32>;";
    let source = format!("{RASTER}\n{sums}");
    let mut declared_with_sums = declared.clone();
    declared_with_sums.ports.push(port("sums", Access::Write, u32::element()));
    for (right, wrong, part) in cases {
        assert!(source.contains(right), "{right}");
        assert_misfit(&source.replace(right, wrong), &declared_with_sums, &[], &[part]);
    }
    // The fragment entry point may write.
    let writing = source.replace("return 1u", "sums[0] = 1u; return 1u");
    assert_eq!(misfits(&writing, &declared_with_sums, &[]), [""; 0]);
    let passed =
        RASTER.replace("fn paint()", "fn paint(@builtin(position) at: vec4<f32>, @location(0) size: f32)");
    assert_eq!(misfits(&passed, &declared, &[]), [""; 0]);
}

#[test]
fn what_a_fragment_returns_is_compared_with_the_targets() {
    let color = || port("color", Access::Write, texel::Rgba16Float::element());
    let two = raster(vec![ids(), color()]);
    let paint = |returned: &str| {
        let pixel = format!("struct Pixel {{ {returned} }}");
        let old = "fn paint() -> @location(0) u32 { return 1u; }";
        format!("{pixel}\n{}", RASTER.replace(old, "fn paint() -> Pixel { var pixel: Pixel; return pixel; }"))
    };
    let right = "@location(1) color: vec4<f32>, @location(0) id: u32";
    assert_eq!(misfits(&paint(right), &two, &[]), [""; 0]);
    let cases = [
        (
            "@location(0) id: u32",
            "`paint` returns nothing at @location(1); for `color`, return vec4<f32> there",
        ),
        (
            "@location(0) id: u32, @location(1) color: vec3<f32>",
            "`paint` returns vec3<f32> at @location(1); for `color`, return vec4<f32>",
        ),
        (
            "@location(0) id: u32, @location(1) color: vec4<u32>",
            "`paint` returns vec4<u32> at @location(1); for `color`, return vec4<f32>",
        ),
        (
            "@location(0) id: f32, @location(1) color: vec4<f32>",
            "`paint` returns f32 at @location(0); for `ids`, return u32",
        ),
        (
            "@location(0) id: u32, @location(1) color: vec4<f32>, @location(2) more: f32",
            "`paint` returns @location(2), but its draw has 2 targets",
        ),
        (
            "@location(0) id: u32, @location(1) color: vec4<f32>, @builtin(frag_depth) depth: f32",
            "`paint` returns @builtin(frag_depth), but its draw has no depth test",
        ),
    ];
    for (returned, part) in cases {
        assert_misfit(&paint(returned), &two, &[], &[part]);
    }
    let mut tested = two;
    let Pass::Draw { depth, .. } = &mut tested.passes[0] else { unreachable!() };
    *depth = true;
    assert_eq!(misfits(&paint(&format!("{right}, @builtin(frag_depth) depth: f32")), &tested, &[]), [""; 0]);
    // A target takes the channels that it has.
    assert_eq!(
        misfits(&RASTER.replace("u32 { return 1u", "vec2<u32> { return vec2(1u)"), &raster(vec![ids()]), &[]),
        [""; 0]
    );
}

#[test]
fn a_vertex_passes_on_few_values() {
    let source = |count: u8| {
        let members: String = (0..count).map(|i| format!("@location({i}) {}: f32,", letter(i))).collect();
        RASTER.replace("@location(0) size: f32", &members).replace(
            "return Vertex(list[i / 6u], 1.0)",
            "var vertex: Vertex; vertex.position = list[i / 6u]; return vertex",
        )
    };
    let triangles = raster(vec![ids()]);
    assert_eq!(misfits(&source(16), &triangles, &[]), [""; 0]);
    assert_misfit(&source(17), &triangles, &[], &["`place` returns 17 values; 16 work on every device"]);
    let mut points = triangles;
    let Pass::Draw { shape, .. } = &mut points.passes[0] else { unreachable!() };
    *shape = Shape::Points;
    assert_eq!(misfits(&source(15), &points, &[]), [""; 0]);
    assert_misfit(&source(16), &points, &[], &["`place` returns 16 values; 15 work on every device"]);
}

/// Asserts that a changed draw into `ids` has one misfit, which holds `part`.
fn assert_misdrawn(part: &str, change: impl Fn(&mut Pass)) {
    let mut declared = raster(vec![ids()]);
    change(&mut declared.passes[0]);
    assert_misfit(RASTER, &declared, &[], &[part]);
}

#[test]
fn the_numbers_of_a_draw_are_checked() {
    for (to, count, part) in [
        (Shape::Triangles, 4, "has 4 vertices for each element; triangles need a multiple of 3, at least 3"),
        (Shape::Lines, 3, "has 3 vertices for each element; lines need a multiple of 2, at least 2"),
        (Shape::Points, 0, "has 0 vertices for each element; points need a multiple of 1, at least 1"),
    ] {
        assert_misdrawn(part, |pass| {
            let Pass::Draw { shape, vertices, .. } = pass else { unreachable!() };
            (*shape, *vertices) = (to, count);
        });
    }
    for (to, text) in [(0.5, "0.5"), (-1.0, "-1"), (4294967296.0, "4294967296"), (f64::NAN, "NaN")] {
        let part = format!("`ids` has texels of u32; {text} cannot be what it is cleared to");
        assert_misdrawn(&part, |pass| {
            let Pass::Draw { clear, .. } = pass else { unreachable!() };
            *clear = to;
        });
    }
}

#[test]
fn targets_are_few_texture_outputs() {
    let declared = raster(vec![]);
    let found = misfits(RASTER, &declared, &[]);
    assert!(
        found[0].contains("the draw of `place` has 0 targets; it should have at least one"),
        "{found:#?}"
    );

    let returned = |members: &str| {
        let old = "fn paint() -> @location(0) u32 { return 1u; }";
        let new =
            format!("fn paint() -> Pixel {{ var pixel: Pixel; return pixel; }} struct Pixel {{ {members} }}");
        RASTER.replace(old, &new)
    };
    let many = |count: usize| {
        let named = |i: usize| Port {
            name: format!("t{i}").into(),
            ..port("", Access::Write, texel::R32Uint::element())
        };
        let members: String =
            (0..count).map(|i| format!("@location({i}) {}: u32,", letter(i as u8))).collect();
        misfits(&returned(&members), &raster((0..count).map(named).collect()), &[])
    };
    let part = "the draw of `place` has 9 targets; it should have at least one, and 8 work on every device";
    let found = many(9);
    assert!(found[0].contains(part), "{found:#?}");
    assert_eq!(many(8), [""; 0]);
    // Each format counts with what WebGPU's table says.
    let (one, four) = (["f32", "u32"], "vec4<f32>");
    for (formats, bytes) in [
        (&[Format::R32Uint, Format::R32Float, Format::Rgba8Unorm, Format::Rgba32Float][..], 32),
        (&[Format::R32Uint, Format::R32Float, Format::Rgba16Float, Format::Rgba32Float], 32),
        (&[Format::Rgba16Float, Format::Rgba8Unorm, Format::Rgba16Float, Format::Rgba8Unorm], 32),
        (&[Format::Rgba32Float; 3], 48),
        (&[Format::R32Uint, Format::R32Float, Format::R32Uint, Format::Rgba8Unorm, Format::Rgba32Float], 36),
        (&[Format::Rgba16Float, Format::Rgba8Unorm, Format::R32Float, Format::Rgba32Float], 36),
    ] {
        let ty = |format: &Format| match format {
            Format::R32Float => one[0],
            Format::R32Uint => one[1],
            _ => four,
        };
        let members: String = (0..formats.len())
            .map(|i| format!("@location({i}) {}: {},", letter(i as u8), ty(&formats[i])))
            .collect();
        let named = |(i, format): (usize, &Format)| Port {
            name: format!("t{i}").into(),
            ..port("", Access::Write, Element::Texel(*format))
        };
        let declared = raster(formats.iter().enumerate().map(named).collect());
        let told = format!(
            "shader test.wgsl: the targets of `place` have {bytes} bytes a pixel; 32 work on every device"
        );
        let expected = if bytes > 32 { vec![told] } else { vec![] };
        assert_eq!(misfits(&returned(&members), &declared, &[]), expected, "{formats:?}");
    }

    assert_misdrawn("the draw of `place` has the target `ids` twice", |pass| {
        let Pass::Draw { targets, .. } = pass else { unreachable!() };
        targets.push(targets[0]);
    });
    for (target, variable) in [
        (port("sums", Access::Write, u32::element()), "var<storage, read_write> sums: array<u32>"),
        (port("sums", Access::Read, texel::R32Uint::element()), "var sums: texture_2d<u32>"),
    ] {
        let source = format!("{RASTER}\n@group(0) @binding(1) {variable};");
        assert_misfit(&source, &raster(vec![target]), &[], &["`sums` is not a texture output"]);
    }
}

#[test]
fn numbers_of_threads_are_checked() {
    let list = || port("list", Access::Update, u32::element());
    let at = FieldRef { port: 0, field: 0 };
    let dispatch = |list: Port, threads| {
        let passes = vec![Pass::Compute { entry: "main".into(), threads }];
        Declaration { ports: vec![list], passes, ..Declaration::default() }
    };
    let source = |body: &str, ty: &str, access: &str| {
        format!(
            "@group(0) @binding(0) var<storage, {access}> list: array<{ty}>;
            @compute @workgroup_size(1) fn main() {{ {body} }}"
        )
    };
    let unused = source("", "u32", "read_write");
    assert_eq!(misfits(&unused, &dispatch(list(), Threads::Groups(65_535)), &[]), [""; 0]);
    assert_misfit(
        &unused,
        &dispatch(list(), Threads::Groups(65_536)),
        &[],
        &["`main` has 65536 workgroups; 65535 along an axis"],
    );
    assert_misfit(
        &unused,
        &dispatch(list(), Threads::Blocks(at, 0)),
        &[],
        &["one thread for each 0 elements"],
    );

    // Numbers of workgroups are u32 in any arrangement.
    let indirect = Threads::Indirect(at);
    assert_eq!(misfits(&unused, &dispatch(list(), indirect), &[]), [""; 0]);
    let atomics = source("", "atomic<u32>", "read_write");
    assert_eq!(misfits(&atomics, &dispatch(list(), indirect), &[]), [""; 0]);
    let vectors = port("list", Access::Update, <[u32; 4]>::element());
    assert_eq!(misfits(&source("", "vec4<u32>", "read_write"), &dispatch(vectors, indirect), &[]), [""; 0]);
    let floats = port("list", Access::Update, f32::element());
    assert_misfit(
        &source("", "f32", "read_write"),
        &dispatch(floats, indirect),
        &[],
        &["the numbers of workgroups of `main` come from `list`, which is array<f32>", "a buffer of u32"],
    );
    let texels = port("list", Access::Read, texel::R32Uint::element());
    assert_misfit(
        "@group(0) @binding(0) var list: texture_2d<u32>; @compute @workgroup_size(1) fn main() {}",
        &dispatch(texels, indirect),
        &[],
        &["come from `list`, which is texture<r32uint>"],
    );

    // The pass may read them, but not from a variable that it could write.
    assert_misfit(
        &source("let x = list[0];", "u32", "read_write"),
        &dispatch(list(), indirect),
        &[],
        &["`main` uses `list`, which is writable", "write them in an earlier pass"],
    );
    let read = port("list", Access::Read, u32::element());
    assert_eq!(misfits(&source("let x = list[0];", "u32", "read"), &dispatch(read, indirect), &[]), [""; 0]);
}

#[test]
fn portable_limits_are_checked() {
    // As many as every device has, and one more.
    let with = |count: u8, variable: &str, write: &str, element: Element| {
        let variables: String = (0..count)
            .map(|i| format!("@group(0) @binding({i}) {};\n", variable.replace("NAME", &letter(i))))
            .collect();
        let writes: String = (0..count).map(|i| write.replace("NAME", &letter(i))).collect();
        let field = |i| Field { name: letter(i).into(), element: element.clone() };
        let port =
            Port { fields: (0..count).map(field).collect(), ..port("out", Access::Update, element.clone()) };
        let source = format!("{variables} @compute @workgroup_size(1) fn main() {{ {writes} }}");
        misfits(&source, &declaration(vec![port]), &[])
    };
    let buffers = |count| {
        with(count, "var<storage, read_write> out_NAME: array<u32>", "out_NAME[0] = 1u;", u32::element())
    };
    let images = |count| {
        with(
            count,
            "var out_NAME: texture_storage_2d<r32uint, write>",
            "textureStore(out_NAME, vec2(0), vec4(1u));",
            texel::R32Uint::element(),
        )
    };
    assert_eq!((buffers(10), images(4)), (vec![], vec![]));
    let told = "shader test.wgsl: entry point `main` has";
    assert_eq!(buffers(11), [format!("{told} 11 storage buffers; 10 work on every device")]);
    assert_eq!(images(5), [format!("{told} 5 storage textures; 4 work on every device")]);
    let of = |source: &str| misfits(source, &declaration(vec![]), &[]);
    let threads = |count: u32| of(&format!("@compute @workgroup_size(16, {count}) fn main() {{}}"));
    let bytes = |count: u32| {
        of(&format!(
            "var<workgroup> big: array<u32, {count}>; @compute @workgroup_size(1) fn main() {{ big[0] = 1u; }}"
        ))
    };
    assert_eq!((threads(16), bytes(4096)), (vec![], vec![]));
    assert_eq!(threads(17), [format!("{told} 272 threads a workgroup; 256 work on every device")]);
    assert_eq!(bytes(4097), [format!("{told} 16388 bytes of workgroup memory; 16384 work on every device")]);
}

#[test]
fn atomic_operations_are_counted_in_every_statement() {
    for (body, count) in [
        ("atomicAdd(&list[0], 1u);", 1),
        ("let old = atomicMax(&list[0], 1u) + atomicLoad(&list[1]); atomicStore(&list[1], old);", 1),
        ("{ atomicAdd(&list[0], 1u); { atomicAdd(&list[1], 1u); } }", 2),
        ("if list_is() { atomicAdd(&list[0], 1u); } else { twice(); }", 3),
        ("switch 1u { case 1u, 2u: { twice(); } case 3u: {} default: { atomicAdd(&list[0], 1u); } }", 3),
        ("for (var i = 0u; i < 3u; i += atomicAdd(&list[0], 1u)) { twice(); }", 3),
        ("loop { twice(); continuing { twice(); twice(); break if true; } }", 6),
        ("twice(); twice();", 4),
    ] {
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> list: array<atomic<u32>>;
            fn list_is() -> bool {{ return atomicLoad(&list[0]) == 1u; }}
            fn twice() {{ atomicAdd(&list[0], 1u); atomicSub(&list[0], 1u); }}
            @compute @workgroup_size(1) fn main() {{ {body} }}"
        );
        assert_eq!(compose(&source).entries[0].atomics, count, "{body}");
    }
}

fn letter(index: u8) -> String {
    char::from(b'a' + index).to_string()
}

#[test]
fn conditions_keep_and_drop_lines() {
    let source = "
        #ifdef WIDE
        @group(0) @binding(0) var wide: texture_2d<f32>;
        #ifndef DEEP // a remark
        @group(0) @binding(1) var flat: texture_2d<f32>;
        #else
        @group(0) @binding(1) var deep: texture_2d<f32>;
        #endif
        #else
        #import nothing
        @group(0) @binding(0) var narrow: texture_2d<f32>;
        #endif
        @compute @workgroup_size(1) fn main() {}";
    let names = |defines: &[&'static str]| -> Vec<String> {
        let reflected = compose_shader(&shader(source, defines), &library(), Needs::default());
        reflected.unwrap_or_else(|error| panic!("{error}")).variables.into_iter().map(|v| v.name).collect()
    };
    assert_eq!(names(&["WIDE"]), ["wide", "flat"]);
    assert_eq!(names(&["WIDE", "DEEP"]), ["wide", "deep"]);
    assert!(compose_error(source).contains("line 10, column 9: unknown module `nothing`"));
}

#[test]
fn directives_are_checked() {
    let cases = [
        ("#ifdef A\n", "line 1, column 1: missing `#endif`"),
        ("\n#else\n", "line 2, column 1: `#else` without"),
        ("#ifdef A\n#else\n#else\n#endif", "line 3, column 1: `#else` without"),
        ("#endif", "line 1, column 1: `#endif` without"),
        ("#define A 1", "unknown directive; known: `#import MODULE`"),
        ("#import", "unknown directive"),
        ("#import fram", "unknown module `fram`, did you mean `frame`?"),
    ];
    for (source, part) in cases {
        let error = compose_error(source);
        assert!(error.contains(part), "`{part}` is not in:\n{error}");
    }
}

#[test]
fn modules_import_each_other_once() {
    let mut library = library();
    library.modules.push(ShaderModule::new(
        "a.wgsl",
        "#import b\n#import frame\nfn a() -> u32 { return b() + frame.seed; }",
    ));
    library.modules.push(ShaderModule::new("b.wgsl", "#import a\nfn b() -> u32 { return 7u; }\n"));
    let source = "#import a\n@compute @workgroup_size(1) fn main() { let x = a(); }";
    let reflected = compose_shader(&shader(source, &[]), &library, Needs::default()).unwrap();
    assert_eq!(reflected.variables.len(), 1);
    assert_eq!(reflected.entries[0].uses, [0]);
}

#[test]
fn errors_name_the_file_and_the_line() {
    let error = compose_error("#import frame\n\nfn f() -> u32 {\n    return frame.sed;\n}\n");
    assert!(error.contains("shader test.wgsl: line 4"), "{error}");
    assert!(error.contains("`sed`") && error.contains("in `return frame.sed;`"), "{error}");

    // At the first byte of a file.
    for (text, line) in [("? fn", "? fn"), ("#import frame\n? fn", "? fn")] {
        let error = compose_error(text);
        assert!(
            error.contains("shader test.wgsl: line") && error.ends_with(&format!("in `{line}`")),
            "{error}"
        );
    }
    let mut first = library();
    first.modules.push(ShaderModule::new("first.wgsl", "? fn"));
    let error = compose_shader(&shader("#import first\n", &[]), &first, Needs::default()).unwrap_err();
    assert!(error.to_string().contains("shader first.wgsl: line 1, column 1"), "{error}");

    // What naga gives no place, too.
    let error = compose_error("  @group(0) @binding(0) ;\nfn f() {}\n");
    assert!(error.contains("line 1, column 1: ") && error.contains("we had the attribute"), "{error}");

    let invalid = compose_error("\nfn f() -> u32 {\n}\n");
    assert!(invalid.contains("test.wgsl: line 2") && invalid.contains("return"), "{invalid}");

    let mut broken = library();
    broken.modules.push(ShaderModule::new("broken.wgsl", "// é\nfn g() -> u32 { return 1.5; }"));
    let error = compose_shader(&shader("#import frame\n#import broken\n", &[]), &broken, Needs::default());
    let error = error.unwrap_err().to_string();
    assert!(error.contains("shader broken.wgsl: line 2"), "{error}");
}

#[test]
fn constants_come_from_rust() {
    mod declared {
        epigraph_core::constants! {
            /// Every bit.
            pub const ALL: u32 = u32::MAX;
            pub const LEAST: i32 = i32::MIN;
            pub const TENTH: f32 = 0.1;
        }
    }
    mod imported {
        epigraph_core::constants! {
            pub const LIVE: u32 = 1 << 16;
        }
    }
    let mut library = library();
    let source = "fn is_live(bits: u32) -> bool { return (bits & LIVE) != 0u; }";
    library
        .modules
        .push(ShaderModule { constants: imported::CONSTANTS.to_vec(), ..ShaderModule::new("cloud", source) });
    let compose = |source: &str| {
        let shader = Shader { constants: declared::CONSTANTS.to_vec(), ..shader(source, &[]) };
        compose_shader(&shader, &library, Needs::default())
    };
    let asserted = "
        #import cloud
        const_assert ALL == 0xFFFFFFFFu;
        const_assert LEAST == -2147483647i - 1i;
        const_assert TENTH == 0.1f;
        const_assert LIVE == 0x10000u;
        @compute @workgroup_size(1) fn main() { let x = is_live(ALL); }";
    compose(asserted).unwrap_or_else(|error| panic!("{error}"));

    let two = Registry::default()
        .with_module(ShaderModule::new("a.wgsl", ""))
        .with_module(ShaderModule::new("b.wgsl", ""))
        .with_constants("b", imported::CONSTANTS);
    let counts: Vec<usize> = two.library.modules.iter().map(|module| module.constants.len()).collect();
    assert_eq!(counts, [0, 1]);

    // The constants shift no line, and one that the file declares again is told there.
    for (source, expected) in [
        ("#import cloud\nfn f() -> u32 {\n    return ALLE;\n}", "shader test.wgsl: line 3"),
        ("#import cloud\n\nconst ALL: u32 = 1u;", "shader test.wgsl: line 3, column 7"),
        ("#import cloud\n\nconst LIVE: u32 = 1u;", "shader test.wgsl: line 3, column 7"),
        ("fn f() -> u32 {\n    return ALL;\n", "shader test.wgsl: line"),
    ] {
        let error = compose(source).unwrap_err().to_string();
        assert!(error.contains(expected), "`{expected}` is not in:\n{error}");
    }
    library.modules.push(ShaderModule {
        constants: imported::CONSTANTS.to_vec(),
        ..ShaderModule::new("broken", "\nfn f() -> u32 {\n    return LIFE;\n}")
    });
    let error = compose_shader(&shader("#import broken\n", &[]), &library, Needs::default());
    let error = error.unwrap_err().to_string();
    assert!(error.contains("shader broken: line 3"), "{error}");
}

#[test]
fn wide_atomics_stand_for_pairs_where_admitted() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> keys: array<atomic<u64>>;
        @compute @workgroup_size(1) fn main() { atomicMin(&keys[0], 5lu); }";
    let error = compose_error(source);
    assert!(error.contains("64"), "{error}");
    let reflected = compose_shader(&shader(source, &[]), &library(), Needs { atomic64: true }).unwrap();
    let declared = declaration(vec![port("keys", Access::Update, <[u32; 2]>::element())]);
    assert_eq!(check_shader(&reflected, "test.wgsl", &declared, &[]), []);
}

#[test]
fn any_float_texture_takes_all_float_formats() {
    assert!(Element::AnyFloatTexel.accepts(&Element::Texel(Format::Rgba8Unorm)));
    assert!(!Element::AnyFloatTexel.accepts(&Element::Texel(Format::R32Uint)));
    assert!(!Element::AnyFloatTexel.accepts(&f32::element()));
    assert!(Element::Texel(Format::R32Uint).accepts(&Element::Texel(Format::R32Uint)));
    assert!(!Element::Texel(Format::R32Float).accepts(&Element::Texel(Format::R32Uint)));
}

/// Draws, with a target twice, and computes.
struct Placed;

impl Stage for Placed {
    const KIND: &'static str = "placed";
    const DOC: &'static str = "Has a shader that an editor changes.";
    type Params = ();

    fn declare((): &(), io: &mut Io) -> Self {
        io.shader(Shader::new("placed.wgsl", MAIN).from_file("placed.wgsl"));
        let list = io.read::<[f32; 4]>("list", "Places.", Extent::Any);
        let ids = io.write::<texel::R32Uint>("ids", "Numbers.", Extent::Frame(1));
        io.pass(Pass::Draw {
            vertex: "place".into(),
            fragment: "paint".into(),
            shape: Shape::Triangles,
            vertices: 6,
            count: list.into(),
            targets: vec![ids.into(), ids.into()],
            depth: false,
            clear: 0.0,
        });
        io.dispatch("main", list);
        Self
    }

    fn cpu(&self, (): &(), _: &CpuContext) -> Result<(), String> {
        Ok(())
    }
}

#[test]
fn misfits_are_told_where_they_stand() {
    let told = |source: &str| -> Vec<(usize, String, String)> {
        let text = source.to_owned();
        let mut registry = Registry::default().with::<Placed>();
        registry.library = library();
        let registry = registry.with_edited(EditedTexts::new(move |_| Some(text.as_str().into())));
        let graph = r#"Graph(version: 1, nodes: { "placed": (kind: "placed") }, outputs: {})"#;
        let stages = GraphFile::parse("placed.ron", graph).unwrap().stages(&registry).unwrap();
        let misfit = |error| {
            let GraphError::Shader { message, place: Some(place), .. } = error else { panic!("{error}") };
            let word = place.text.chars().skip(place.lead).take(place.length).collect();
            (place.line, word, message)
        };
        check_stage(&*stages[0].stage, &registry.library).into_iter().map(misfit).collect()
    };
    let draw = "@vertex fn place(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
            return vec4(f32(textureLoad(ids, vec2(i), 0).x));
        }
        @fragment fn paint(@location(1) size: f32) -> @location(0) u32 { return 1u; }
        @compute @workgroup_size(8, 8) fn main() {}
        @compute @workgroup_size(257) fn extra() {}";
    let found = told(&format!(
        "#import frame
        @group(0) @binding(0) var<storage, read> list: array<vec2<f32>>;
        @group(1) @binding(1) var ids: texture_2d<u32>;
        @group(0) @binding(2) var<uniform> params: vec4<f32>;
        @group(0) @binding(3) var<storage, read_write> first: array<u32>;
        @group(0) @binding(3) var<storage, read_write> second: array<u32>;
        {draw}"
    ));
    let expected = [
        (2, "list", "port `list`: its elements are vec2<f32>"),
        (4, "params", "the stage has no parameters"),
        (5, "first", "unknown variable `first`"),
        (6, "second", "unknown variable `second`"),
        (3, "ids", "`ids` is in @group(1)"),
        (6, "second", "`second` and `first` both have @binding(3)"),
        (2, "list", "`frame` and `list` both have @binding(0)"),
        (7, "place", "the draw of `place` has the target `ids` twice"),
        (7, "place", "`place` uses `ids`, which this pass draws to"),
        (10, "paint", "`paint` takes f32 at @location(1)"),
        (12, "extra", "entry point `extra` has 257 threads a workgroup"),
    ];
    assert_eq!(found.len(), expected.len(), "{found:#?}");
    for ((line, word, message), (at, name, part)) in found.iter().zip(expected) {
        assert_eq!((*line, &**word), (at, name), "{message}");
        assert!(message.starts_with(part), "`{part}` does not begin:\n{message}");
    }
    let found = told(&format!(
        "@group(0) @binding(0) var<storage, read> list: array<vec4<f32>>;
        @group(0) @binding(1) var ids: texture_2d<u32>;
        @group(0) @binding(2) var<uniform> frame: vec4<f32>;
        {draw}"
    ));
    assert_eq!((found[0].0, &*found[0].1), (3, "frame"), "{found:#?}");
    // A directive from its mark to its last word; and what takes the name of the checks' variable.
    for (source, line, word, part) in [
        ("\n    #define A 1  \n", 2, "#define A 1", "unknown directive"),
        (
            "@compute @workgroup_size(1) fn main() {\n#check ids[0]: true, \"so\"\n}\nconst watch_checks = 1u;",
            4,
            "watch_checks",
            "redefinition of `watch_checks`",
        ),
    ] {
        let found = told(source);
        assert_eq!((found[0].0, &*found[0].1), (line, word), "{found:#?}");
        assert!(found.len() == 1 && found[0].2.contains(part), "{found:#?}");
    }
}
