//! What is wrong with a shader file is reported at its line and column, with what to write instead.

use super::{BUNDLE, GLOW, IMAGE, LIST, MAIN, READ, USER, assert_problem, problems, unconnected, whole};

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
        (
            "@fragment fn paint() {}",
            "no draw uses `paint`; add `fragment paint` above its @vertex entry point",
        ),
    ];
    for (variable, part) in cases {
        assert_problem(&with(variable), USER, &["shader user.wgsl", part]);
    }
    assert_problem("", USER, &["it has no entry point"]);
}

#[test]
fn malformed_parameters_are_told() {
    let cases = [
        (
            "strength: f32",
            "strength: vec2<f32>",
            "7:5",
            "`strength` cannot be a parameter; those are f32, u32 and i32",
        ),
        ("strength: f32", "0: f32", "7:5", "`0` is no name"),
        ("strength: f32", "shader: f32", "7:5", "this name is reserved for the shader file"),
        ("= 0.5 in 0..2", "= 0.5 in 0-2", "6:18", "expected a number after `in`, found `0-2`"),
        ("= 0.5 in 0..2", "= 0.5 in 2..0", "6:11", "the range 2..0 is empty; write the lower value first"),
        ("= 0.5 in 0..2", "= 0.5 in 0..", "6:21", "expected a number after `..`, found the end of the line"),
        (
            "= 0.5 in 0..2",
            "= 0.5 on 0..2",
            "6:15",
            "or a comma or the end of the line after `0.5`, found `on`",
        ),
        ("= 0.5 in 0..2", "= 2.5 in 0..2", "6:11", "the default 2.5: outside its range; expected a number"),
        ("= 3 in", "= 3.5 in", "9:10", "the default: found `3.5`; expected a whole number"),
        (
            "= 0.5 in 0..2",
            "=",
            "6:10",
            "a parameter takes `DEFAULT [in LOW..HIGH] [unit UNIT]`, `DEFAULT of CHOICES`",
        ),
        ("where 1 doubles it.", "= 1.0", "6:11", "`strength` has its default already; remove one"),
        ("= 0.5 in 0..2", "= true", "6:11", "write `strength: u32` and `= true`"),
        ("= 3 in 1..16 unit pixels", "= true in 0..1", "9:10", "only a u32 without range is true or false"),
        ("= 0.5 in 0..2", "= A of A, B", "6:11", "only a u32 is set by names; write `strength: u32`"),
        (
            "= 3 in 1..16 unit pixels",
            "= A of A, B, A",
            "9:21",
            "`A` is `RADIUS_A` in WGSL, as is another choice",
        ),
        (
            "= 3 in 1..16 unit pixels",
            "= A of A, A",
            "9:18",
            "`A` is `RADIUS_A` in WGSL, as is another choice",
        ),
        (
            "= 3 in 1..16 unit pixels",
            "= Tnt of Tent, Box",
            "9:10",
            "unknown choice `Tnt`, did you mean `Tent`?",
        ),
        (
            "= 3 in 1..16 unit pixels",
            "= Tent of 1, 2",
            "9:18",
            "expected names with commas between them after `of`",
        ),
    ];
    for (from, to, place, part) in cases {
        let shader = GLOW.replace(from, to);
        assert_ne!(shader, GLOW);
        assert_problem(&shader, USER, &[&format!("user.wgsl:{place}: "), part]);
    }
}

#[test]
fn what_is_wrong_with_a_declaration_is_told_at_its_place() {
    // The declaration above `list`, the column in its line, and the message.
    let cases = [
        ("= outptu", 7, "unknown clause `outptu`, did you mean `output`?"),
        ("= bogus", 7, "unknown clause: `bogus`; a port takes `output`, `scratch`, `kept`"),
        ("=", 6, "unknown clause: the end of the line; a port takes `output`"),
        ("= output, per pixel,", 25, "unknown clause: the end of the line"),
        ("= output,, per pixel", 14, "unknown clause: `,`"),
        ("= output per pixel", 14, "expected a comma or the end of the line after `output`, found `per`"),
        ("= last fram", 12, "expected `frame` after `last`, found `fram`; did you mean `frame`?"),
        (
            "= per",
            10,
            "expected `pixel` or `corner` or `request` or a square such as 8x8 or a quantity after `per`",
        ),
        ("= output, per pxel", 19, "unknown quantity `pxel`, did you mean `pixel`?"),
        ("= output, per lamp", 19, "known: pixel, corner, request, street lamp"),
        ("= output, per 4x2 pixels", 19, "expected a square such as 8x8 after `per`, found `4x2`"),
        ("= output, 0 elements", 15, "expected a whole number from 1 to 4294967295, found `0`"),
        (
            "= output, 4294967296 elements",
            15,
            "expected a whole number from 1 to 4294967295, found `4294967296`",
        ),
        (
            "= output, 65536x65536",
            15,
            "expected a width and a height such as 16x16 with fewer than 2^32 elements, found",
        ),
        ("= output, -1 per pixel", 15, "expected a number above 0, found `-1`"),
        ("= output, nan per pixel", 15, "unknown clause: `nan`"),
        ("= output, like", 19, "expected the name of a port after `like`, found the end of the line"),
        ("= output, like givn", 15, "unknown port `givn`, did you mean `given`?"),
        ("= output, like list", 15, "the extent of `list` depends on itself; give one of the ports its own"),
        ("= output, bit per element of mage", 15, "unknown port `mage`, did you mean `image`?"),
        ("= output", 0, "`list` is an output, but its number of elements is unknown; add `per pixel`"),
        (
            "= output, kept, last frame, per pixel",
            21,
            "`list` cannot be an output and an input of the frame before",
        ),
        (
            "= last frame, output, per pixel",
            19,
            "`list` cannot be an output and an input of the frame before",
        ),
        (
            "= last frame",
            7,
            "may be written, but the frame before is only read; declare it `var<storage, read>`",
        ),
        ("= optional", 7, "`list` is written; only an input that is only read may stay unconnected"),
        ("= output, output, per pixel", 15, "`output` of `list` is given twice; remove one"),
        ("= output, per pixel, 7 elements", 26, "the number of elements of `list` is given twice"),
        ("= means depht", 13, "unknown meaning `depht`, did you mean `depth`?"),
        ("= means depth, means depth", 20, "the meaning of `list` is given twice"),
        ("= field of cloud", 7, "a field of `cloud` is a variable `cloud_x`; rename `list` to `cloud_list`"),
        ("= field of li", 7, "a field of `li` is a variable `li_x`"),
        ("= over list", 7, "`over list` belongs above an entry point, in a line `/// = ...`"),
        ("= 16 groups", 7, "`16 groups` belongs above an entry point"),
        ("= per view", 11, "unknown quantity `view`"),
        ("= 0.5 in 0..1", 7, "`0.5 in 0..1` belongs above a member of the struct of `params`"),
        ("= column P1", 7, "`column P1` belongs at the top of the file, in a line `//! = ...`"),
    ];
    let mut wrong = Vec::new();
    for (declaration, column, part) in cases {
        let shader = whole(&[(&format!("/// {declaration}"), LIST), ("", READ), ("", IMAGE)], MAIN);
        // What is missing is told at the variable.
        let place = if column == 0 { "user.wgsl:3:48: ".into() } else { format!("user.wgsl:2:{column}: ") };
        let text = problems(&shader, USER).to_string();
        if !(text.contains(&place) && text.contains(part)) {
            wrong.push(format!("{declaration}: {part}\n{place}\n{text}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn declarations_that_contradict_each_other_are_told() {
    const OTHER: &str = "var<storage, read_write> other: array<vec2<u32>>";
    let first = |declaration| whole(&[(declaration, LIST), ("", READ), ("", IMAGE)], MAIN);
    let bundle = |from: &str, to: &str| {
        let shader = whole(BUNDLE, MAIN);
        assert!(shader.contains(from), "{from}");
        shader.replacen(from, to, 1)
    };
    let top = |text: &str| format!("{text}\n{}", first(""));
    let entry = |text: &str| format!("{}{text}", first(""));
    let cases = [
        (
            whole(&[("/// = output, per pixel", READ), ("", IMAGE)], MAIN),
            "2:7",
            "is only read, so it is no output",
        ),
        (
            whole(&[("/// = kept", "var t: texture_2d<u32>"), ("", IMAGE)], MAIN),
            "2:7",
            "is only read, so it is no output",
        ),
        (
            whole(&[("/// = format r32uint", "var t: texture_2d<f32>"), ("", IMAGE)], MAIN),
            "2:7",
            "`var t: texture_2d<f32>` has no texels of r32uint; this is for texture_2d<u32>",
        ),
        (
            whole(&[("/// = format r32float", IMAGE)], MAIN),
            "2:7",
            "has no texels of r32float; this is for texture_2d<f32>",
        ),
        (
            whole(&[("/// = format r16float", IMAGE)], MAIN),
            "2:14",
            "expected r32float, r32uint, rgba8unorm, rgba16float or",
        ),
        (
            whole(&[("/// = format r32float", "var t: texture_2d<f32>"), ("", IMAGE)], MAIN),
            "3:27",
            "port `t`: an output is written with textureStore",
        ),
        (
            whole(
                &[("/// = output, like other", LIST), ("/// = output, like list", OTHER), ("", IMAGE)],
                MAIN,
            ),
            "4:15",
            "the extent of `other` depends on itself",
        ),
        (
            whole(&[("/// = output, bit per element of list", OTHER), ("", LIST), ("", IMAGE)], MAIN),
            "2:15",
            "bits are in words; declare `other` as array<u32>",
        ),
        (
            whole(&[("/// = 0.5 per pixel", IMAGE)], MAIN),
            "2:7",
            "`image` is a texture, but this is the length of a list",
        ),
        (bundle("/// = field of cloud\n", "\n"), "6:42", "`cloud_meta` is called like a field of `cloud`"),
        (
            bundle("field of cloud\n", "field of cloud, field of clod\n"),
            "5:23",
            "the bundle of `cloud_meta` is given twice",
        ),
        (
            bundle("field of cloud\n", "field of cloud, optional\n"),
            "5:23",
            "`optional` of `cloud_meta` is given twice",
        ),
        (
            bundle("/// = field of cloud\n", "/// = field of image\n"),
            "5:7",
            "a field of `image` is a variable `image_x`",
        ),
        (
            whole(
                &[("/// = field of list", "var<storage, read> list_x: array<u32>"), ("", LIST), ("", IMAGE)],
                MAIN,
            ),
            "5:48",
            "`list` is both a variable and a bundle",
        ),
        (top("//! = column P7"), "1:14", "unknown column `P7`, did you mean `P1`?"),
        (
            top("//! = per view"),
            "1:7",
            "`per view` is for what follows from inputs and view alone, but `list` depends",
        ),
        (top("//! = column P1\n//! = column P1"), "2:7", "this is given twice"),
        (top("//! = over list"), "1:7", "`over list` belongs above an entry point"),
        (entry("//! = per view"), "9:5", "nothing here takes this declaration"),
        (entry("/// = output\nfn helper() {}"), "9:5", "nothing here takes this declaration"),
        (entry("fn helper() {\n    /// = output\n}"), "10:9", "nothing here takes this declaration"),
        (
            entry("struct Other {\n    /// = 0.5\n    x: f32,\n}"),
            "10:9",
            "nothing here takes this declaration",
        ),
        (entry("/// = 0.5"), "9:5", "nothing here takes this declaration"),
        (
            first("").replace("@compute", "/// = over lst\n@compute"),
            "8:12",
            "unknown port `lst`, did you mean `list`?",
        ),
        (
            first("").replace("@compute", "/// = 70000 groups\n@compute"),
            "9:35",
            "`main` has 70000 workgroups; 65535 along an axis work on",
        ),
        (
            first("").replace("@compute", "/// = 16 groups, over list\n@compute"),
            "8:18",
            "the number of threads of `main` is given twice",
        ),
        (first("").replace("@compute", "/// = output\n@compute"), "8:7", "`output` belongs above a variable"),
        (
            first("").replace("@compute", "/// = one per 0 of list\n@compute"),
            "8:15",
            "expected a whole number from 1",
        ),
        (
            whole(&[("", READ), ("/// = 4096 elements", IMAGE)], MAIN),
            "4:7",
            "`image` is a texture, but this is the length of a list",
        ),
        (whole(&[("", READ), ("/// = output, 0 per pixel", LIST), ("", IMAGE)], MAIN), "4:15", ""),
        (format!("{}@fragment fn paint() {{}}\n", first("")), "9:14", "no draw uses `paint`"),
        (
            "/// = kept\n@group(0) @binding(0) var<uniform> params: Params;\nstruct Params { a: f32 }\n"
                .to_owned()
                + MAIN,
            "1:5",
            "nothing here takes this declaration",
        ),
        (
            "@group(1) @binding(0) var<uniform> params: Params;\nstruct Params { a: f32 }\n".to_owned()
                + &whole(&[("", IMAGE)], MAIN),
            "1:36",
            "`params` is in @group(1); everything is bound in @group(0)",
        ),
        (
            whole(&[("/// = in 0..1", READ), ("", IMAGE)], MAIN),
            "2:7",
            "`given` is only read; its values are checked where they are written",
        ),
        (first("/// = in 3..1"), "2:7", "the range of `list` is empty; the lower number comes first"),
        (first("/// = in 0.5..1"), "2:7", "`list` has whole numbers; give whole numbers as the range"),
        (first("/// = in 0..1.5"), "2:7", "`list` has whole numbers; give whole numbers as the range"),
        (
            format!(
                "struct Pair {{ low: u32, high: f32 }}\n{}",
                whole(&[("/// = in 0..1", "var<storage, read_write> pairs: array<Pair>"), ("", IMAGE)], MAIN)
            ),
            "3:7",
            "`pairs` has floats and whole numbers; a range is for numbers of one kind",
        ),
        (
            "@group(0) @binding(0) var<uniform> params: vec4<f32>;\n".to_owned() + MAIN,
            "1:36",
            "`params` is a uniform struct of f32, u32 and i32 that this file declares",
        ),
    ];
    let mut wrong = Vec::new();
    for (shader, place, part) in cases {
        let text = problems(&shader, USER).to_string();
        let is_told = |line: &str| line.contains(part) && line.contains(&format!("user.wgsl:{place}: "));
        if !text.lines().any(is_told) {
            wrong.push(format!("{part}\n{place}\n{text}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn checks_are_of_what_the_file_writes() {
    let checked = |port: &str| {
        let main = MAIN.replace("{", &format!("{{\n#check {port}[0]: true, \"it is\"\n"));
        whole(&[("", LIST), ("", READ), ("", IMAGE)], &main)
    };
    super::made(&checked("list"), USER);
    assert_problem(&checked("given"), USER, &["user.wgsl:9:1: ", "#check: unknown output `given`"]);
}

#[test]
fn members_that_depend_on_their_values_are_refused() {
    let params = "@group(0) @binding(0) var<uniform> params: Params;\nstruct Params {\n/// = true\na: u32,\n#ifdef A\nb: u32,\n#endif\n}\n";
    let part = "the members of `params` depend on their values; keep the struct out of #ifdef";
    assert_problem(&format!("{params}{MAIN}"), USER, &["graph.ron:4:49", part]);
}

#[test]
fn all_wrong_declarations_are_told_together() {
    let shader =
        whole(&[("/// = outptu, per pxel\n/// = kpet", LIST), ("/// = last fram", READ), ("", IMAGE)], MAIN);
    assert_eq!(problems(&shader, USER).0.len(), 3);
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
    // Together with what is wrong with the file.
    let broken = GLOW.replace("* params.strength", "* params.strenth");
    let problems = super::problems(&broken, &format!("{USER}, radius: 17"));
    let text = problems.to_string();
    assert!(text.contains("user.wgsl:28:55") && text.contains("`radius` is 17, outside 1 to 16"), "{text}");
}

#[test]
fn the_file_is_named_and_found() {
    assert_problem(GLOW, "", &["graph.ron:4:9", "names its shader file"]);
    assert_problem(GLOW, "shader: \"other.wgsl\"", &["graph.ron:4:49", "cannot read", "/other.wgsl:"]);
    assert_problem(GLOW, "shader: 3", &["graph.ron:4:49", "parameter `shader`", "expected a text in quotes"]);
}

#[test]
fn an_input_that_may_be_absent_is_declared_and_used_as_such() {
    let used =
        "@compute @workgroup_size(8, 8) fn main() { textureStore(image, vec2(0), vec4(f32(given[0]))); }\n";
    let cases = [
        // Unconnected, but used.
        (
            whole(&[("/// = optional", READ), ("", IMAGE)], used),
            "6:35",
            "put that between `#ifdef HAS_GIVEN` and `#endif`",
        ),
        (
            whole(&[("/// = optional", READ), ("", IMAGE)], &format!("/// = over given\n{MAIN}")),
            "6:12",
            "nothing is connected to `given`; put the entry point between `#ifdef HAS_GIVEN` and `#endif`",
        ),
        // Left out, but not optional.
        (
            whole(&[("#ifdef HAS_GIVEN", READ), ("#endif", IMAGE)], MAIN),
            "3:42",
            "`given` is an input that is left out by #ifdef; add `optional`",
        ),
        (
            whole(
                &[("", IMAGE), ("#ifndef HAS_OTHER", READ), ("#endif", &IMAGE.replace("image", "other"))],
                MAIN,
            ),
            "5:42",
            "`given` is there only without some input; move it out of #ifndef",
        ),
    ];
    // Only where it is connected.
    let drawn = format!(
        "{}#ifdef HAS_GIVEN\n@fragment fn paint() {{}}\n#endif\n",
        whole(&[("/// = optional", READ), ("", IMAGE)], MAIN)
    );
    let cases = cases.into_iter().chain([(drawn, "8:14", "no draw uses `paint`")]);
    for (shader, place, part) in cases {
        let text = unconnected(&shader).err().map(|problems| problems.to_string()).unwrap_or_default();
        let is_told = |line: &str| line.contains(part) && line.contains(&format!("user.wgsl:{place}: "));
        assert!(text.lines().any(is_told), "{part}\n{place}\n{text}");
    }
    let guarded = format!(
        "#import frame\n#ifdef HAS_GIVEN\n/// = optional\n@group(0) @binding(1) {READ};\n#endif\n\
        @group(0) @binding(2) {IMAGE};\n{MAIN}"
    );
    assert!(unconnected(&guarded).unwrap().declaration().ports[0].optional);
}

/// Draws points of `given` into `image`; what is in angle brackets can be replaced.
const DRAW: &str = "\
/// = draw 1 point vertex per given into image, fragment paint
@vertex fn place(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(given[index]), 0.0, 0.0, 1.0);
}
@fragment fn paint() -> @location(0) vec4<f32> {
    return vec4(1.0);
}
";

#[test]
fn draws_are_checked() {
    let with = |from: &str, to: &str| {
        let shader = whole(&[("", READ), ("", IMAGE), ("", LIST)], DRAW);
        assert!(shader.contains(from), "{from}");
        shader.replacen(from, to, 1)
    };
    let id = |to: &str| {
        with("r32float", "r32uint").replacen("fragment paint", &format!("fragment paint, {to}"), 1)
    };
    // Line 8 is that of the declaration.
    let cases = [
        (
            with("/// = draw", "/// draw"),
            "9:12",
            "`place` draws nothing yet; add `/// = draw 3 triangle vertices",
        ),
        (with(", fragment paint", ""), "8:7", "the draw has no fragment entry point; add `fragment NAME`"),
        (
            with("fragment paint", "fragment piant"),
            "8:58",
            "unknown fragment entry point `piant`, did you mean `paint`?",
        ),
        (
            with("1 point vertex", "4 triangle vertices"),
            "9:12",
            "the draw of `place` has 4 vertices for each element; triangles need a multiple of 3",
        ),
        (with("1 point vertex", "0 point vertex"), "8:12", "expected a whole number from 1"),
        (with("point", "square"), "8:14", "expected `point`, `line` or `triangle` after `1`, found `square`"),
        (with("per given", "per gvien"), "8:31", "unknown port `gvien`, did you mean `given`?"),
        (
            with("into image", "into list"),
            "9:12",
            "`list` is not a texture output; a draw has no other targets",
        ),
        (with("into image", "into given"), "9:12", "`given` is not a texture output"),
        (
            with("into image", "into image and image"),
            "9:12",
            "the draw of `place` has the target `image` twice",
        ),
        (
            with("into image", "into image and"),
            "8:48",
            "expected a comma or the end of the line after `image`, found `and`",
        ),
        (with("write>", "read_write>"), "9:12", "`image` is not a texture output"),
        (id("clear 0.5"), "9:12", "`image` has texels of u32; 0.5 cannot be what it is cleared to"),
        (id("clear -1"), "9:12", "`image` has texels of u32; -1 cannot be what it is cleared to"),
        (id("depth, depth"), "8:72", "this is given twice"),
        (id("16 groups"), "8:65", "`place` is @vertex; threads are those of a @compute entry point"),
        (id("depth"), "12:14", "`paint` returns vec4<f32> at @location(0); for `image`, return u32"),
        (
            with("fn place(", "fn place(@location(3) at: f32, "),
            "9:12",
            "`place` takes @location(3), but there are no vertex buffers",
        ),
        (
            with("fn paint(", "fn paint(@location(1) glow: f32"),
            "12:14",
            "`paint` takes f32 at @location(1), but `place` returns nothing there",
        ),
        (
            with("texture_storage_2d<r32float", "texture_storage_2d<rgba32float")
                .replace("vec4<f32> {\n    return vec4(1.0)", "vec2<f32> {\n    return vec2(1.0)"),
            "12:14",
            "`paint` returns vec2<f32> at @location(0); for `image`, return vec4<f32>",
        ),
        (
            with("return vec4(1.0)", "textureStore(image, vec2(0), vec4(1.0)); return vec4(1.0)"),
            "12:14",
            "`paint` uses `image`, which this pass draws to",
        ),
        (
            with("@fragment", "/// = depth\n@fragment"),
            "12:7",
            "`paint` is no @compute or @vertex entry point, so it takes no declaration",
        ),
        (
            with(
                "@fragment",
                "/// = depth\n@compute @workgroup_size(1) fn main() { list[0] = 1u; }\n@fragment",
            ),
            "12:7",
            "`main` is @compute; a draw is declared above a @vertex entry point",
        ),
    ];
    let mut wrong = Vec::new();
    for (shader, place, part) in cases {
        let text = problems(&shader, USER).to_string();
        let is_told = |line: &str| line.contains(part) && line.contains(&format!("user.wgsl:{place}: "));
        if !text.lines().any(is_told) {
            wrong.push(format!("{part}\n{place}\n{text}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn numbers_of_workgroups_are_checked() {
    let main = |text: &str| {
        format!("/// = groups from {text}\n@compute @workgroup_size(64) fn main() {{ list[0] = list[1]; }}\n")
    };
    let shader = |text: &str| {
        let declarations = [BUNDLE[0], BUNDLE[1], ("", LIST), ("", IMAGE)];
        whole(&declarations, &main(text))
    };
    assert_problem(
        &shader("cloud"),
        USER,
        &["user.wgsl:11:19: ", "`cloud` is a bundle; name one of its fields, such as `cloud_radiance`"],
    );
    assert_problem(
        &shader("image"),
        USER,
        &[
            "user.wgsl:12:33: ",
            "the numbers of workgroups of `main` come from `image`, which is texture<r32float>",
        ],
    );
    assert_problem(
        &shader("list"),
        USER,
        &[
            "user.wgsl:12:33: ",
            "`main` uses `list`, which is writable, but has its numbers of workgroups from there",
        ],
    );
    assert!(super::make(&shader("cloud_meta"), USER).is_ok());
}

#[test]
fn what_naga_gives_no_place_has_one() {
    let cases = [
        // In a function, and at the top level.
        ("list[0] = 1.0[list[0]];", "", "8:35", "Invalid access into expression"),
        ("", "@group(0) @binding(7) ;\n", "9:1", "we had the attribute but no var?"),
        // A brace that is missing is not looked for in a module.
        ("if list[0] > 1u {", "", "8:42", "this `{` is never closed; add the `}` that is missing after it"),
    ];
    for (body, after, place, part) in cases {
        let main = format!(
            "@compute @workgroup_size(8, 8) fn main() {{ textureStore(image, vec2(0), vec4(1.0)); {body} }}\n{after}"
        );
        let shader = whole(&[("", READ), ("", LIST), ("", IMAGE)], &main);
        assert_problem(&shader, USER, &[&format!("user.wgsl:{place}: "), part]);
    }
}

#[test]
fn a_condition_that_nothing_defines_is_told_at_its_name() {
    let shader = whole(&[("", READ), ("", IMAGE)], MAIN);
    let line = shader.lines().count() + 3;
    let text = format!("{shader}#ifdef WATCH\n#endif\n  #ifndef  NUMBERED // why\n#endif\n");
    assert_problem(
        &text,
        USER,
        &[
            &format!("user.wgsl:{line}:12: "),
            "unknown name after #ifdef `NUMBERED`; known: HAS_GIVEN, WATCH\n",
            " ^^^^^^^^",
        ],
    );
    assert_problem(
        &format!("{}#ifdef LOUD\n#endif\n", whole(&[("", IMAGE)], MAIN)),
        USER,
        &[
            "unknown name after #ifdef `LOUD`; known: WATCH; an optional input or a parameter that is true or false \
           defines one\n",
        ],
    );
}

#[test]
fn a_clash_with_a_module_is_told_in_the_shader() {
    let shader = whole(&[("", READ), ("", IMAGE)], MAIN).replace("@binding(1)", "@binding(0)");
    let main =
        shader.replace("textureStore(image, vec2(0)", "textureStore(image, vec2(frame.index + given[0])");
    assert_problem(
        &main,
        USER,
        &["user.wgsl:3:23: ", "`given` and `frame` both have @binding(0); give each its own number"],
    );
    let shader = whole(&[("", READ), ("", IMAGE)], &format!("const View: u32 = 1u;\n{MAIN}"));
    assert_problem(&shader, USER, &["user.wgsl:6:7: ", "redefinition of `View`"]);
}
