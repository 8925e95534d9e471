//! Shaders against declarations: what fits passes, and every kind of misfit is told with what to change.

use epigraph_core::{
    Access, Declaration, Element, Extent, Field, FieldRef, Format, Frame, GraphError, Lifetime, Needs,
    ParamKind, ParamSpec, Pass, Port, PortElement, Reflected, Shader, ShaderLibrary, ShaderModule, Shape,
    Space, Threads, check_shader, compose_shader, item, texel,
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
    Shader { defines: defines.to_vec(), ..Shader::new("test.wgsl", source.to_owned()) }
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
        extent: Extent::Any,
        lifetime: Lifetime::Transient,
        optional: false,
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
    assert_eq!(misfits(MAIN, &declaration(vec![optional]), &[]), [""; 0]);
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

fn raster(target: Port) -> Declaration {
    let at = |port| FieldRef { port, field: 0 };
    let points = Pass::Draw {
        vertex: "place".into(),
        fragment: "paint".into(),
        shape: Shape::Points,
        vertices: 1,
        count: at(0),
        targets: vec![at(1)],
        depth: true,
        clear: 0.0,
    };
    let compute = Pass::Compute { entry: "main".into(), threads: Threads::Over(at(1)) };
    Declaration {
        ports: vec![port("list", Access::Read, <[f32; 4]>::element()), target],
        passes: vec![points, compute],
        ..Declaration::default()
    }
}

const RASTER: &str = "
    @group(0) @binding(0) var<storage, read> list: array<vec4<f32>>;
    @vertex fn place(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> { return list[i]; }
    @fragment fn paint() -> @location(0) u32 { return 1u; }
    @compute @workgroup_size(8, 8) fn main() {}";

#[test]
fn raster_targets_may_be_absent_or_read_but_not_by_their_pass() {
    let declared = raster(port("id", Access::Write, texel::R32Uint::element()));
    let id = "@group(0) @binding(1) var id: texture_2d<u32>;";
    assert_eq!(misfits(RASTER, &declared, &[]), [""; 0]);
    assert_eq!(misfits(&format!("{RASTER}\n{id}"), &declared, &[]), [""; 0]);
    let circular = RASTER.replace("return 1u", "return textureLoad(id, vec2(0), 0).x");
    assert_misfit(&format!("{circular}\n{id}"), &declared, &[], &["`paint` uses `id`", "draws to"]);
}

#[test]
fn portable_limits_are_checked() {
    let buffers: String = (0..11)
        .map(|i| {
            format!("@group(0) @binding({i}) var<storage, read_write> list_{}: array<u32>;\n", letter(i))
        })
        .collect();
    let uses: String = (0..11).map(|i| format!("list_{}[0] = 1u;", letter(i))).collect();
    let fields = (0..11).map(|i| Field { name: letter(i).into(), element: u32::element() }).collect();
    let list = Port { fields, ..port("list", Access::Update, u32::element()) };
    assert_misfit(
        &format!("{buffers} @compute @workgroup_size(1) fn main() {{ {uses} }}"),
        &declaration(vec![list]),
        &[],
        &["`main` has 11 storage buffers; 10"],
    );

    let images: String = (0..5)
        .map(|i| {
            format!("@group(0) @binding({i}) var out_{}: texture_storage_2d<r32uint, write>;\n", letter(i))
        })
        .collect();
    let uses: String =
        (0..5).map(|i| format!("textureStore(out_{}, vec2(0), vec4(1u));", letter(i))).collect();
    let fields =
        (0..5).map(|i| Field { name: letter(i).into(), element: texel::R32Uint::element() }).collect();
    let out = Port { fields, ..port("out", Access::Write, u32::element()) };
    assert_misfit(
        &format!("{images} @compute @workgroup_size(1) fn main() {{ {uses} }}"),
        &declaration(vec![out]),
        &[],
        &["`main` has 5 storage textures; 4"],
    );

    let declared = declaration(vec![]);
    assert_misfit(
        "@compute @workgroup_size(16, 16, 2) fn main() {}",
        &declared,
        &[],
        &["512 threads a workgroup; 256"],
    );
    assert_misfit(
        "var<workgroup> big: array<u32, 4097>; @compute @workgroup_size(1) fn main() { big[0] = 1u; }",
        &declared,
        &[],
        &["16388 bytes of workgroup memory; 16384"],
    );
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

    // The constants shift no line, and one that the file declares again is told there.
    for (source, expected) in [
        ("#import cloud\nfn f() -> u32 {\n    return ALLE;\n}", "shader test.wgsl: line 3"),
        ("#import cloud\n\nconst ALL: u32 = 1u;", "shader test.wgsl: line 3, column 7"),
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
