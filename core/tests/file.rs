//! Graph files: what is read, where each problem stands, and that edits change only what they should.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use epigraph_core::{Download, GraphError, GraphFile, Problems, Side, Source, moved_path, relative};

const CACHE: &str = r##"#![enable(implicit_some)]
// The cache, shortened. Its name: "cache" (not a string of the file).
Graph(
    version: 1,
    doc: "Reproject, cull; fill: {holes}, /* not a comment */",
    nodes: {
        "cloud":   (kind: "point_cloud", params: (points_per_pixel: 1.14)), // the store
        "project": (kind: "project", inputs: { "cloud": "cloud.cloud" }),
        /* culling, /* nested */ in the neighbourhood */
        "cull": (
            kind: "depth_cull",
            on: Gpu,
            inputs: {
                "id": "project.id", // ids
                // depths
                "depth": "project.depth",
            },
            params: (
                threshold: 0.05, // relative
                rule: Relative,
                weights: [1, 2, /* three */ 3],
                label: r#"a "raw" ) string"#
            ),
        ),
        "größe":   (kind: "dither", on: Cpu, download: Latent(2), bypass: true),
        // more to come
    },
    outputs: { "image": "cull.color" },
)
"##;

fn parse(text: &str) -> GraphFile {
    GraphFile::parse("g.ron", text).unwrap_or_else(|problems| panic!("{problems}"))
}

fn problems(text: &str) -> Problems {
    match GraphFile::parse("g.ron", text) {
        Ok(_) => panic!("parsed without a problem:\n{text}"),
        Err(problems) => problems,
    }
}

fn source(text: &str) -> Source {
    text.parse().unwrap()
}

/// `text` with the one occurrence of `old` replaced.
fn with(text: &str, old: &str, new: &str) -> String {
    assert_eq!(text.matches(old).count(), 1, "{old:?} must stand once");
    text.replace(old, new)
}

/// "line:column: message" of each problem, and its underlined length.
fn told(text: &str) -> Vec<(String, usize)> {
    let tell = |problem: &epigraph_core::Problem| {
        let place = problem.place.as_ref().unwrap();
        (format!("{}:{}: {}", place.line, place.column, problem.error), place.length)
    };
    problems(text).0.iter().map(tell).collect()
}

#[track_caller]
fn assert_told(text: &str, expected: &[(&str, usize)]) {
    let expected: Vec<_> =
        expected.iter().map(|(message, length)| ((*message).to_owned(), *length)).collect();
    assert_eq!(told(text), expected);
}

/// A whole file around the text of its nodes, which begins at line 2.
fn nodes(nodes: &str) -> String {
    format!("(version: 1, outputs: {{}}, nodes: {{\n{nodes}}})")
}

/// A whole file with one node, whose fields after its kind begin at line 3.
fn node(fields: &str) -> String {
    nodes(&format!("\"n\": (kind: \"k\",\n{fields})"))
}

#[test]
fn reads_the_whole_shape() {
    let file = parse(CACHE);
    assert_eq!((file.version, file.doc.as_str()), (1, "Reproject, cull; fill: {holes}, /* not a comment */"));
    let names: Vec<&str> = file.nodes.iter().map(|node| node.name.value.as_str()).collect();
    assert_eq!(names, ["cloud", "project", "cull", "größe"]);

    let cull = file.node("cull").unwrap();
    assert_eq!(cull.kind.value, "depth_cull");
    assert_eq!(cull.on.as_ref().map(|on| on.value), Some(Side::Gpu));
    assert_eq!((&cull.download, cull.bypass), (&None, false));
    let inputs: Vec<_> =
        cull.inputs.iter().map(|input| (input.port.value.as_str(), input.from.value.to_string())).collect();
    assert_eq!(inputs, [("id", "project.id".to_owned()), ("depth", "project.depth".to_owned())]);
    let params: Vec<_> =
        cull.params.iter().map(|param| (param.name.value.as_str(), param.value.value.as_str())).collect();
    let expected = [
        ("threshold", "0.05"),
        ("rule", "Relative"),
        ("weights", "[1, 2, /* three */ 3]"),
        ("label", "r#\"a \"raw\" ) string\"#"),
    ];
    assert_eq!(params, expected);

    let dither = file.node("größe").unwrap();
    assert_eq!(dither.on.as_ref().map(|on| on.value), Some(Side::Cpu));
    assert_eq!(dither.download.as_ref().map(|download| download.value), Some(Download::Latent(2)));
    assert!(dither.bypass && dither.inputs.is_empty() && dither.params.is_empty());

    assert_eq!(file.outputs[0].name.value, "image");
    assert_eq!(file.outputs[0].from.value, source("cull.color"));
    assert!(file.node("nobody").is_none());
}

#[test]
fn every_span_is_the_text_it_was_read_from() {
    let file = parse(CACHE);
    let text = |span: epigraph_core::Span| &file.text[span.start..span.end];
    for node in &file.nodes {
        assert_eq!(text(node.name.span), format!("\"{}\"", node.name.value));
        assert_eq!(text(node.kind.span), format!("\"{}\"", node.kind.value));
        for input in &node.inputs {
            assert_eq!(text(input.port.span), format!("\"{}\"", input.port.value));
            assert_eq!(text(input.from.span), format!("\"{}\"", input.from.value));
        }
        for param in &node.params {
            assert_eq!(text(param.name.span), param.name.value);
            assert_eq!(text(param.value.span), param.value.value);
        }
        if let Some(on) = &node.on {
            assert_eq!(text(on.span), format!("{:?}", on.value));
        }
    }
    let place = file.place(file.nodes[3].download.as_ref().unwrap().span);
    assert_eq!((place.line, place.column, place.length), (25, 56, 9));
    assert_eq!(place.file, "g.ron");
}

#[test]
fn accepts_every_way_to_write_a_file() {
    for text in [
        "(version:1,nodes:{},outputs:{})",
        "Graph ( nodes: {}, outputs: {}, version: 1 )",
        "#![enable(implicit_some)]\n#![enable(unwrap_newtypes,)]\n\n(version: 1, nodes: {}, outputs: {},)",
        "// a\n/* b */ ( /* c */ version /* d */ : /* e */ 1 /* f */ , nodes: {}, outputs: {}) // g",
        "#![enable(implicit_some)] // (\n// )\nGraph(version: 0x1, r#nodes: {}, outputs: {})",
        "(\r\n\tversion: 1,\r\n\tnodes: {\r\n},\r\n\toutputs: {}\r\n)\r\n",
        "(version: 1, doc: r##\"a \"# b\"##, nodes: {}, outputs: {})",
    ] {
        let file = parse(text);
        assert_eq!(file.text, text);
        assert_eq!((file.version, file.nodes.len(), file.outputs.len()), (1, 0, 0), "{text}");
    }
}

#[test]
fn literals_may_hold_brackets_commas_and_quotes() {
    let values = [
        "','",
        "'\\''",
        "'\\\\'",
        "'\"'",
        "''' ",
        "b'('",
        "b\"),\\\"\"",
        "br#\"\")\"#",
        "r\"\\\"",
        "\"\\\\\"",
        "\"//\"",
        "-1.5e-3",
        "[(1, 2), (3, 4)]",
        "{ \"a\": 1, 'b': 2 }",
        "r#a.b",
        "Some(Other(1))",
        "()",
        "0..=3",
    ];
    for value in values {
        let file = parse(&node(&format!("params: (a: 1, b: {value}, c: 3)")));
        let params: Vec<&str> = file.nodes[0].params.iter().map(|param| param.value.value.as_str()).collect();
        assert_eq!(params, ["1", value.trim(), "3"]);
    }
}

#[test]
fn syntax_errors_stand_where_ron_stopped() {
    assert_told("", &[("1:1: Unexpected end of RON", 1)]);
    assert_told("// only\n/* comments */\n", &[("3:1: Unexpected end of RON", 1)]);
    assert_told("// only", &[("1:8: Unexpected end of RON", 1)]);
    assert_told("(version: 1, nodes: {}", &[("1:23: Expected comma; the `(` at 1:1 is still open here", 1)]);
    assert_told("(\n  \"é\" version: 1)", &[("2:7: Expected comma; the `(` at 1:1 is still open here", 1)]);
    assert_told("(\n  doc: \"größe\", nodes: @)", &[("2:24: Unexpected char '@'", 1)]);
    assert_told("(doc: \"a\\q\")", &[("1:9: Unknown escape character", 2)]);
    assert_told("(doc: \"no end)\n\n\n", &[("1:7: Expected end of string", 1)]);
    assert_told("(version: 1)\n\n (again)", &[("3:2: Non-whitespace trailing characters", 1)]);
}

#[test]
fn fields_of_the_graph_are_checked() {
    assert_told("5", &[("1:1: expected Graph(version: 1, nodes: { ... }, outputs: { ... }), found `5`", 1)]);
    assert_told(
        " Grap(version: 1)",
        &[(
            "1:2: expected Graph(version: 1, nodes: { ... }, outputs: { ... }), found `Grap(version: 1)`",
            16,
        )],
    );
    assert_told(
        "(\n)",
        &[
            ("1:1: `version` is missing; write version: 1", 1),
            ("1:1: `nodes` is missing; write nodes: { \"NODE\": (kind: \"KIND\") }", 1),
            ("1:1: `outputs` is missing; write outputs: { \"NAME\": \"NODE.PORT\" }", 1),
        ],
    );
    assert_told(
        "(version: 2, nodes: {}, outputs: {})",
        &[("1:11: unsupported version 2 of the graph format; this program reads version 1", 1)],
    );
    assert_told(
        "(version: \"1\", doc: 3, nodes: [], outputs: (), version: 1, node: {})",
        &[
            ("1:11: expected a whole number, found `\"1\"`", 3),
            ("1:21: expected a text in double quotes, found `3`", 1),
            ("1:31: expected { \"NODE\": (kind: \"KIND\"), ... }, found `[]`", 2),
            ("1:44: expected { \"NAME\": \"NODE.PORT\", ... }, found `()`", 2),
            ("1:48: duplicate field `version`", 7),
            ("1:60: unknown field `node`, did you mean `nodes`?", 4),
        ],
    );
}

#[test]
fn fields_of_a_node_are_checked() {
    assert_told(&node("kin: 1"), &[("3:1: unknown field `kin`, did you mean `kind`?", 3)]);
    assert_told(
        &node("position: (1, 2)"),
        &[(
            "3:1: unknown field `position`; known: kind, repeat, on, download, bypass, inputs, params, set",
            8,
        )],
    );
    assert_told(&node("kind: \"again\""), &[("3:1: duplicate field `kind`", 4)]);
    assert_told(&node("on: Gup"), &[("3:5: unknown side `Gup`, did you mean `Gpu`?", 3)]);
    assert_told(&node("on: Tpu2000"), &[("3:5: unknown side `Tpu2000`; known: Gpu, Cpu", 7)]);
    assert_told(&node("on: \"gpu\""), &[("3:5: expected Gpu or Cpu, found `\"gpu\"`", 5)]);
    assert_told(&node("download: Late(1)"), &[("3:11: unknown download `Late`, did you mean `Latent`?", 7)]);
    assert_told(&node("download: Latent"), &[("3:11: expected Sync or Latent(FRAMES), found `Latent`", 6)]);
    assert_told(
        &node("download: Latent(-1)"),
        &[("3:11: expected Sync or Latent(FRAMES), found `Latent(-1)`", 10)],
    );
    assert_told(&node("bypass: yes"), &[("3:9: expected true or false, found `yes`", 3)]);
    assert_told(
        &nodes("\"n\": (kind: 5)"),
        &[("2:13: expected a stage kind in double quotes, found `5`", 1)],
    );
    assert_told(&nodes("\"n\": ()"), &[("2:1: `kind` is missing; write kind: \"KIND\"", 3)]);
    assert_told(&nodes("\"n\": {}"), &[("2:6: expected (kind: \"KIND\", ...), found `{}`", 2)]);
    assert_told(
        &nodes("\"n\": Node(kind: \"k\")"),
        &[("2:6: expected (kind: \"KIND\", ...), found `Node(kind: \"k\")`", 15)],
    );
    assert_told(&nodes("n: (kind: \"k\")"), &[("2:1: expected a name in double quotes, found `n`", 1)]);
    assert_told(&nodes("\"n\": (kind: \"k\"), \"n\": (kind: \"j\")"), &[("2:19: duplicate node `n`", 3)]);
    assert_told(
        &nodes("\"a.b\": (kind: \"k\"), \"\": (kind: \"k\")"),
        &[
            ("2:1: `a.b` cannot name a node; use a name without a dot or a slash", 5),
            ("2:21: `` cannot name a node; use a name without a dot or a slash", 2),
        ],
    );
}

#[test]
fn wires_and_parameters_are_checked() {
    assert_told(&node("inputs: { \"p\": \"a\" }"), &[("3:16: `a` is not a port; write \"NODE.PORT\"", 3)]);
    assert_told(
        &node("inputs: { \"p\": \"a.b.c\" }"),
        &[("3:16: `a.b.c` is not a port; write \"a/b.c\"", 7)],
    );
    assert_told(&node("inputs: { \"p\": \".b\" }"), &[("3:16: `.b` is not a port; write \"NODE.PORT\"", 4)]);
    assert_told(&node("inputs: { \"p\": 1 }"), &[("3:16: expected a port as \"NODE.PORT\", found `1`", 1)]);
    assert_told(&node("inputs: { \"p\": \"a.b\", \"p\": \"a.c\" }"), &[("3:23: duplicate input `p`", 3)]);
    assert_told(
        &node("inputs: [\"a.b\"]"),
        &[("3:9: expected { \"PORT\": \"NODE.PORT\", ... }, found `[\"a.b\"]`", 7)],
    );
    assert_told(&node("params: (a: 1, a: 2)"), &[("3:16: duplicate parameter `a`", 1)]);
    assert_told(
        &node("params: (1, 2)"),
        &[
            ("3:10: expected (name: value, ...), found `1`", 1),
            ("3:13: expected (name: value, ...), found `2`", 1),
        ],
    );
    assert_told(
        &node("params: { \"a\": 1 }"),
        &[("3:9: expected (name: value, ...), found `{ \"a\": 1 }`", 10)],
    );
    assert_told(
        "(version: 1, nodes: {}, outputs: { \"o\": \"a.b\", \"o\": \"a.c\", \"p\": \"a\" })",
        &[("1:48: duplicate output `o`", 3), ("1:65: `a` is not a port; write \"NODE.PORT\"", 3)],
    );
}

#[test]
fn all_problems_of_a_file_come_at_once_and_name_their_node() {
    let text = r#"Graph(
    version: 9, // größer als eins
    nodes: {
        "größe": (kid: "dither", on: Gup), // ü
        "cull": (
            kind: "depth_cull",
            inputs: { "id": "project", "depth": 3, "id": "a.b" },
	        params: (a: 1, a: 2),
        ),
        "cull": (kind: "again"),
    },
    output: {},
)"#;
    let found = problems(text);
    let tell = |problem: &epigraph_core::Problem| {
        let place = problem.place.as_ref().unwrap();
        let or_none = |name: &Option<String>| name.clone().unwrap_or_default();
        (place.line, place.column, or_none(&problem.node), or_none(&problem.port))
    };
    let places: Vec<_> = found.0.iter().map(tell).collect();
    let expected = [
        (1, 1, "", ""),           // no outputs
        (2, 14, "", ""),          // version 9
        (4, 9, "größe", ""),      // no kind
        (4, 19, "größe", ""),     // kid
        (4, 38, "größe", ""),     // Gup
        (7, 29, "cull", "id"),    // "project"
        (7, 49, "cull", "depth"), // 3
        (7, 52, "cull", ""),      // the second "id"
        (8, 25, "cull", ""),      // the second a
        (10, 9, "", ""),          // the second "cull"
        (12, 5, "", ""),          // output
    ];
    let expected =
        expected.map(|(line, column, node, port)| (line, column, node.to_owned(), port.to_owned()));
    assert_eq!(places, expected);
    let shown = found.to_string();
    assert!(shown.contains("g.ron:4:38: node `größe`: unknown side `Gup`, did you mean `Gpu`?"), "{shown}");
    assert!(shown.contains("   |                                      ^^^"), "{shown}");
}

#[test]
fn escapes_in_names_are_understood() {
    let text = node(r#"inputs: { "p\u{71}": "\x61.b", r"q": r"c.d" }, params: (r#type: 1)"#);
    let mut file = parse(&text);
    let inputs: Vec<_> = file.nodes[0]
        .inputs
        .iter()
        .map(|input| format!("{} {}", input.port.value, input.from.value))
        .collect();
    assert_eq!(inputs, ["pq a.b", "q c.d"]);
    assert_eq!(file.nodes[0].params[0].name.value, "type");
    assert_told(&node(r#"inputs: { "p": "a.b", "\u{70}": "a.c" }"#), &[("3:23: duplicate input `p`", 8)]);

    file.set_param("n", "type", "2").unwrap();
    file.set_input("n", "pq", Some(&source("x.y"))).unwrap();
    assert_eq!(file.text, with(&with(&text, "r#type: 1", "r#type: 2"), r#""\x61.b""#, "\"x.y\""));
    file.rename_node("n", "a \"quoted\"\\ name").unwrap();
    assert!(file.node("a \"quoted\"\\ name").is_some());
    assert!(file.text.contains(r#""a \"quoted\"\\ name": (kind"#));
    for odd in ["\0\t\r\n\u{7f}", "\u{200e}\u{301}\u{feff}", "'), ({"] {
        file.add_node(odd, odd).unwrap();
        assert_eq!(file.node(odd).unwrap().kind.value, odd);
    }
}

#[test]
fn garbage_is_refused_without_a_panic() {
    for open in ["(", "[", "{", "a(", "(a:", "{\"a\":", "Some(", "/*", "\"", "r#", "#![", "'"] {
        let deep = open.repeat(1_000_000 / open.len());
        assert!(!problems(&deep).0.is_empty());
        assert!(!problems(&node(&format!("params: (a: {deep})"))).0.is_empty());
    }
    let mut random = Random(7);
    let alphabet: Vec<char> = "()[]{}:,\"'\\/*#!r b1.-\n\tüé∂\u{200E}aG".chars().collect();
    let noise: String = (0..1_000_000).map(|_| alphabet[random.below(alphabet.len())]).collect();
    assert!(!problems(&noise).0.is_empty());
    // Small pieces of noise within a good file reach further into the reader than a whole file of it.
    for round in 0..20_000 {
        let at = random.below(CACHE.len());
        let at = (0..=at).rev().find(|at| CACHE.is_char_boundary(*at)).unwrap();
        let length = random.below(4);
        let noise: String = (0..length).map(|_| alphabet[random.below(alphabet.len())]).collect();
        let skip = CACHE[at..].chars().take(round % 3).map(char::len_utf8).sum::<usize>();
        let text = format!("{}{noise}{}", &CACHE[..at], &CACHE[at + skip..]);
        match GraphFile::parse("g.ron", &text) {
            Ok(mut file) => {
                let _ = file.set_param("cull", "threshold", "1");
                let _ = file.remove_node("cloud");
            }
            Err(problems) => assert!(!problems.to_string().is_empty()),
        }
    }
}

#[test]
fn countless_problems_are_cut_short() {
    let found = |count: usize| problems(&node(&format!("params: ({})", "a: 1, ".repeat(count + 1))));
    assert_eq!(found(100).0.len(), 100);
    for (count, last) in [(101, "1 more problems in g.ron"), (19_999, "19899 more problems in g.ron")] {
        let found = found(count);
        assert_eq!((found.0.len(), found.0[100].error.to_string()), (101, last.into()));
    }
}

#[test]
fn deep_values_within_reason_are_kept() {
    let deep = format!("{}1{}", "[".repeat(60), "]".repeat(60));
    assert_eq!(parse(&node(&format!("params: (a: {deep})"))).nodes[0].params[0].value.value, deep);
}

/// Applies an edit and compares the whole text.
#[track_caller]
fn assert_edit(before: &str, edit: impl FnOnce(&mut GraphFile) -> Result<(), Problems>, after: &str) {
    let mut file = parse(before);
    edit(&mut file).unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!(file.text, after);
    assert_eq!(file, parse(after));
}

#[test]
fn parameters_are_set_in_place() {
    let set = |param: &'static str, value: &'static str| {
        move |file: &mut GraphFile| file.set_param("cull", param, value)
    };
    assert_edit(CACHE, set("threshold", "0.1"), &with(CACHE, "0.05", "0.1"));
    assert_edit(CACHE, set("threshold", "  0.1 // mine"), &with(CACHE, "0.05", "0.1"));
    assert_edit(CACHE, set("rule", "Absolute"), &with(CACHE, "rule: Relative", "rule: Absolute"));
    assert_edit(CACHE, set("weights", "[4]"), &with(CACHE, "[1, 2, /* three */ 3]", "[4]"));
}

#[test]
fn parameters_are_added_in_the_style_of_the_block() {
    let set = |node: &'static str| move |file: &mut GraphFile| file.set_param(node, "added", "(1, 2)");
    let label = "label: r#\"a \"raw\" ) string\"#\n";
    let longer = "label: r#\"a \"raw\" ) string\"#,\n                added: (1, 2)\n";
    assert_edit(CACHE, set("cull"), &with(CACHE, label, longer));
    assert_edit(CACHE, set("cloud"), &with(CACHE, "_pixel: 1.14)", "_pixel: 1.14, added: (1, 2))"));
    let wires = "inputs: { \"cloud\": \"cloud.cloud\" })";
    let more = "inputs: { \"cloud\": \"cloud.cloud\" }, params: (added: (1, 2)))";
    assert_edit(CACHE, set("project"), &with(CACHE, wires, more));
    assert_edit(CACHE, set("größe"), &with(CACHE, "bypass: true)", "bypass: true, params: (added: (1, 2)))"));

    let cases = [
        ("params: ()", "params: (p: 1)"),
        ("params: ( )", "params: (p: 1)"),
        ("params: (/* none */)", "params: (/* none */ p: 1)"),
        ("params: (a: 1,)", "params: (a: 1, p: 1,)"),
        ("params: (a: 1 /* one */)", "params: (a: 1 /* one */, p: 1)"),
        ("params: (a: 1, /* one */)", "params: (a: 1, /* one */ p: 1,)"),
        ("params: (\n)", "params: (\n    p: 1,\n)"),
        ("params: (\n  // none\n  )", "params: (\n  // none\n      p: 1,\n  )"),
        ("params: (a: 1,\n  b: 2)", "params: (a: 1,\n  b: 2, p: 1)"),
        ("params: (\n\t\ta: 1,\n\t)", "params: (\n\t\ta: 1,\n\t\tp: 1,\n\t)"),
        ("params: (\r\n  a: 1\r\n)", "params: (\r\n  a: 1,\r\n  p: 1\r\n)"),
        ("params: (\n  a: 1 // one,\n)", "params: (\n  a: 1, // one,\n  p: 1\n)"),
        ("params: (a: 1 // one\n/* ) */)", "params: (a: 1 // one\n/* ) */, p: 1)"),
        ("bypass: true,", "bypass: true, params: (p: 1),"),
        ("// nothing else\n", "// nothing else\n    params: (p: 1),\n"),
    ];
    for (before, after) in cases {
        assert_edit(&node(before), |file| file.set_param("n", "p", "1"), &node(after));
    }
}

#[test]
fn parameters_are_removed_with_their_comma_and_line() {
    let remove = |param: &'static str| move |file: &mut GraphFile| file.remove_param("cull", param);
    assert_edit(CACHE, remove("rule"), &with(CACHE, "                rule: Relative,\n", ""));
    assert_edit(CACHE, remove("threshold"), &with(CACHE, "threshold: 0.05, // rel", "// rel"));
    let last = "3],\n                label: r#\"a \"raw\" ) string\"#\n";
    assert_edit(CACHE, remove("label"), &with(CACHE, last, "3]\n"));

    let cases = [
        ("params: (p: 1)", "params: ()"),
        ("params: ( p: 1, )", "params: ()"),
        ("params: (p: 1, b: 2)", "params: (b: 2)"),
        ("params: (a: 1, p: 1, b: 2)", "params: (a: 1, b: 2)"),
        ("params: (a: 1, p: 1)", "params: (a: 1)"),
        ("params: ( a: 1, p: 1 )", "params: ( a: 1 )"),
        ("params: ( p: 1 /* one */ )", "params: ( /* one */ )"),
        ("params: (a: 1, p: 1,)", "params: (a: 1,)"),
        ("params: (a: 1, /* p */ p: 1)", "params: (a: 1 /* p */)"),
        ("params: (a: 1, p: 1 /* p */, b: 2)", "params: (a: 1, /* p */ b: 2)"),
        ("params: (a: 1,\n  p: 1)", "params: (a: 1)"),
        ("params: (\n  p: 1)", "params: ()"),
        ("params: (\n  p: 1 )", "params: ()"),
        ("params: ( // one\n  p: 1)", "params: ( // one\n)"),
        ("params: (a: 1, // one\n  p: 1)", "params: (a: 1 // one\n)"),
        ("params: (p: 1,\n  b: 2)", "params: (\n  b: 2)"),
        ("params: (\n  p: 1,\n)", "params: (\n)"),
        ("params: (\n  a: 1, p: 1,\n  b: 2,\n)", "params: (\n  a: 1,\n  b: 2,\n)"),
        ("params: (\n  p: [\n    1,\n  ],\n  b: 2,\n)", "params: (\n  b: 2,\n)"),
        ("params: (\r\n  a: 1,\r\n  p: 1\r\n)", "params: (\r\n  a: 1\r\n)"),
    ];
    for (before, after) in cases {
        assert_edit(&node(before), |file| file.remove_param("n", "p"), &node(after));
    }
}

#[test]
fn wires_are_set_and_removed() {
    let wire = |port: &'static str, from: Option<&'static str>| {
        move |file: &mut GraphFile| file.set_input("cull", port, from.map(source).as_ref())
    };
    assert_edit(CACHE, wire("id", Some("a.b")), &with(CACHE, "project.id", "a.b"));
    let depth = "\"depth\": \"project.depth\",\n";
    let age = "\"depth\": \"project.depth\",\n                \"age\": \"cloud.age\",\n";
    assert_edit(CACHE, wire("age", Some("cloud.age")), &with(CACHE, depth, age));
    assert_edit(CACHE, wire("id", None), &with(CACHE, "\"id\": \"project.id\", // ids", "// ids"));
    assert_edit(
        CACHE,
        wire("depth", None),
        &with(CACHE, "                \"depth\": \"project.depth\",\n", ""),
    );
    assert_edit(CACHE, wire("nothing", None), CACHE);

    let add = |file: &mut GraphFile| file.set_input("cloud", "in", Some(&source("a.b")));
    assert_edit(CACHE, add, &with(CACHE, "1.14))", "1.14), inputs: { \"in\": \"a.b\" })"));
    let clear = |file: &mut GraphFile| file.set_input("project", "cloud", None);
    assert_edit(CACHE, clear, &with(CACHE, "{ \"cloud\": \"cloud.cloud\" }", "{}"));

    let output = |name: &'static str, from: Option<&'static str>| {
        move |file: &mut GraphFile| file.set_output(name, from.map(source).as_ref())
    };
    assert_edit(CACHE, output("image", Some("a.b")), &with(CACHE, "cull.color", "a.b"));
    let both = "\"cull.color\", \"depth\": \"cull.depth\" }";
    assert_edit(CACHE, output("depth", Some("cull.depth")), &with(CACHE, "\"cull.color\" }", both));
    assert_edit(CACHE, output("image", None), &with(CACHE, "{ \"image\": \"cull.color\" }", "{}"));
}

#[test]
fn fields_of_a_node_are_set_and_cleared() {
    assert_edit(CACHE, |file| file.set_kind("cull", "other"), &with(CACHE, "depth_cull", "other"));
    assert_edit(CACHE, |file| file.set_on("cull", Some(Side::Cpu)), &with(CACHE, "on: Gpu", "on: Cpu"));
    assert_edit(CACHE, |file| file.set_on("cull", None), &with(CACHE, "            on: Gpu,\n", ""));
    let latent = |file: &mut GraphFile| file.set_download("größe", Some(Download::Latent(3)));
    assert_edit(CACHE, latent, &with(CACHE, "Latent(2)", "Latent(3)"));
    assert_edit(CACHE, |file| file.set_bypass("größe", false), &with(CACHE, ", bypass: true", ""));
    let bypass = |file: &mut GraphFile| file.set_bypass("cull", true);
    let after = "            ),\n            bypass: true,\n        ),\n        \"gr";
    assert_edit(CACHE, bypass, &with(CACHE, "            ),\n        ),\n        \"gr", after));
}

#[test]
fn nodes_are_added_renamed_and_removed() {
    let comment = "        // more to come\n";
    let added = format!("{comment}        \"tone\": (kind: \"tonemap\"),\n");
    assert_edit(CACHE, |file| file.add_node("tone", "tonemap"), &with(CACHE, comment, &added));
    let empty = "(version: 1, nodes: {}, outputs: {})";
    assert_edit(
        empty,
        |file| file.add_node("a", "b"),
        &with(empty, "s: {},", "s: { \"a\": (kind: \"b\") },"),
    );

    let renamed = with(CACHE, "\"project\": ", "\"reproject\": ");
    let renamed = with(&with(&renamed, "project.id", "reproject.id"), "project.depth", "reproject.depth");
    assert_edit(CACHE, |file| file.rename_node("project", "reproject"), &renamed);
    let renamed = with(&with(CACHE, "\"cull\": ", "\"k\": "), "cull.color", "k.color");
    assert_edit(CACHE, |file| file.rename_node("cull", "k"), &renamed);
    assert_edit(CACHE, |file| file.rename_node("cull", "cull"), CACHE);

    let node = "        \"project\": (kind: \"project\", inputs: { \"cloud\": \"cloud.cloud\" }),\n";
    let removed = with(&with(CACHE, node, ""), "\"id\": \"project.id\", // ids", "// ids");
    let removed = with(&removed, "                \"depth\": \"project.depth\",\n", "");
    assert_edit(CACHE, |file| file.remove_node("project"), &removed);
    let store = "\"cloud\":   (kind: \"point_cloud\", params: (points_per_pixel: 1.14)), // the";
    let removed = with(&with(CACHE, store, "// the"), "{ \"cloud\": \"cloud.cloud\" }", "{}");
    assert_edit(CACHE, |file| file.remove_node("cloud"), &removed);
}

#[test]
fn a_copy_is_written_like_its_node() {
    let text = "(version: 1, nodes: {\n  \"a\": (\n    kind: \"b\", // Why.\n    inputs: { \"x\": \"a.y\" },\n  ),\n}, outputs: {})";
    let copy =
        "  ),\n  \"a2\": (\n    kind: \"b\", // Why.\n    inputs: { \"x\": \"a.y\" },\n  ),\n}, outputs: {})";
    assert_edit(text, |file| file.copy_node("a", "a2"), &with(text, "  ),\n}, outputs: {})", copy));
}

#[test]
fn wires_from_within_a_part_follow_its_name_and_go_with_it() {
    let text = r#"(version: 1, nodes: { "p": (kind: "graph", params: (file: "p.ron")), "q": (kind: "k", inputs: { "a": "p/n.c", "b": "pp.c" }) }, outputs: { "o": "p/n.c" })"#;
    let renamed = with(&with(text, "{ \"p\":", "{ \"r\":"), "\"a\": \"p/n.c\"", "\"a\": \"r/n.c\"");
    let renamed = with(&renamed, "\"o\": \"p/n.c\"", "\"o\": \"r/n.c\"");
    assert_edit(text, |file| file.rename_node("p", "r"), &renamed);
    let removed = r#"(version: 1, nodes: { "q": (kind: "k", inputs: { "b": "pp.c" }) }, outputs: {})"#;
    assert_edit(text, |file| file.remove_node("p"), removed);
}

#[test]
fn a_failed_edit_leaves_the_file_as_it_was() {
    type Edit = fn(&mut GraphFile) -> Result<(), Problems>;
    let cases: [(Edit, &str); 18] = [
        (|file| file.set_param("cul", "a", "1"), "unknown node `cul`, did you mean `cull`?"),
        (|file| file.set_kind("x", "k"), "unknown node `x`; known: cloud, project, cull, größe"),
        (|file| file.remove_node("x"), "unknown node `x`"),
        (|file| file.rename_node("x", "y"), "unknown node `x`"),
        (|file| file.remove_param("cull", "rul"), "unknown parameter `rul`, did you mean `rule`?"),
        (|file| file.set_param("cull", "a b", "1"), "`a b` cannot name a parameter"),
        (|file| file.set_param("cull", "", "1"), "`` cannot name a parameter"),
        (|file| file.set_param("cull", "a", ""), "parameter `a`: Unexpected end of RON"),
        (|file| file.set_param("cull", "a", "1, b: 2"), "parameter `a`: Non-whitespace trailing characters"),
        (|file| file.set_param("cull", "a", "1)"), "parameter `a`: Non-whitespace trailing characters"),
        (|file| file.set_param("cull", "a", "/* 1"), "parameter `a`: Unclosed block comment"),
        (|file| file.add_node("cull", "k"), "duplicate node `cull`"),
        (|file| file.add_node("a.b", "k"), "`a.b` cannot name a node"),
        (|file| file.copy_node("x", "y"), "unknown node `x`"),
        (|file| file.copy_node("cull", "cloud"), "duplicate node `cloud`"),
        (|file| file.rename_node("cull", "cloud"), "duplicate node `cloud`"),
        (|file| file.rename_node("cull", ""), "`` cannot name a node"),
        (
            |file| file.set_input("cull", "id", Some(&Source { node: "a.b".into(), port: "c".into() })),
            "`a.b.c` is not a port",
        ),
    ];
    for (edit, message) in cases {
        let mut file = parse(CACHE);
        let problems = edit(&mut file).expect_err(message).to_string();
        assert!(problems.contains(message), "{problems}");
        assert_eq!(file, parse(CACHE));
    }
}

/// A linear congruential generator (Knuth's MMIX constants), its high bits.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % bound
    }

    fn pick<'a>(&mut self, of: &[&'a str]) -> &'a str {
        of[self.below(of.len())]
    }
}

/// What the edits should lead to: per node its kind, side, wires and parameters; and the outputs.
#[derive(Clone, Debug, Default, PartialEq)]
struct Model {
    nodes: BTreeMap<String, ModelNode>,
    outputs: BTreeMap<String, Source>,
}

#[derive(Clone, Debug, Default, PartialEq)]
struct ModelNode {
    kind: String,
    on: Option<Side>,
    bypass: bool,
    inputs: BTreeMap<String, Source>,
    params: BTreeMap<String, String>,
}

impl Model {
    fn of(file: &GraphFile) -> Self {
        let node = |node: &epigraph_core::NodeDef| {
            let inputs = node.inputs.iter().map(|input| (input.port.value.clone(), input.from.value.clone()));
            let params =
                node.params.iter().map(|param| (param.name.value.clone(), param.value.value.clone()));
            let model = ModelNode {
                kind: node.kind.value.clone(),
                on: node.on.as_ref().map(|on| on.value),
                bypass: node.bypass,
                inputs: inputs.collect(),
                params: params.collect(),
            };
            (node.name.value.clone(), model)
        };
        let output =
            |output: &epigraph_core::OutputDef| (output.name.value.clone(), output.from.value.clone());
        Self {
            nodes: file.nodes.iter().map(node).collect(),
            outputs: file.outputs.iter().map(output).collect(),
        }
    }

    fn sources(&mut self) -> impl Iterator<Item = &mut Source> {
        let inputs = self.nodes.values_mut().flat_map(|node| node.inputs.values_mut());
        inputs.chain(self.outputs.values_mut())
    }
}

/// One random edit of both; `None` where the file should refuse it.
fn random_edit(
    random: &mut Random,
    file: &mut GraphFile,
    model: &Model,
) -> (Result<(), Problems>, Option<Model>) {
    const NAMES: [&str; 8] = ["cloud", "project", "cull", "größe", "a", "b c", "\"q\"", "d\\"];
    const PORTS: [&str; 4] = ["id", "depth", "cloud", "é\u{301}"];
    const PARAMS: [&str; 5] = ["threshold", "rule", "weights", "label", "p"];
    const VALUES: [&str; 6] = ["1", "[1, /* 2 */ 3]", "\"),(\"", "(a: 1, b: 2)", "'\"'", "[ // one\n 1\n]"];
    let mut next = model.clone();
    let name = random.pick(&NAMES);
    let from = Source { node: random.pick(&NAMES).into(), port: random.pick(&PORTS).into() };
    let from = (random.below(2) == 0).then_some(from);
    let known = next.nodes.contains_key(name);
    let node = next.nodes.entry(name.to_owned()).or_default();
    let (result, allowed) = match random.below(10) {
        0 | 1 => {
            let (param, value) = (random.pick(&PARAMS), random.pick(&VALUES));
            node.params.insert(param.into(), value.into());
            (file.set_param(name, param, value), known)
        }
        2 => {
            let param = random.pick(&PARAMS);
            let removed = node.params.remove(param).is_some();
            (file.remove_param(name, param), known && removed)
        }
        3 | 4 => {
            let port = random.pick(&PORTS);
            node.inputs.remove(port);
            node.inputs.extend(from.clone().map(|from| (port.to_owned(), from)));
            (file.set_input(name, port, from.as_ref()), known)
        }
        5 => {
            node.on = [None, Some(Side::Cpu), Some(Side::Gpu)][random.below(3)];
            let on = node.on;
            (file.set_on(name, on), known)
        }
        6 => {
            node.kind = random.pick(&PORTS).into();
            node.bypass = random.below(2) == 0;
            let bypass = node.bypass;
            let kind = node.kind.clone();
            (file.set_kind(name, &kind).and_then(|()| file.set_bypass(name, bypass)), known)
        }
        7 if random.below(2) == 0 => {
            next.nodes.remove(name);
            next.outputs.retain(|_, from| from.node != name);
            for node in next.nodes.values_mut() {
                node.inputs.retain(|_, from| from.node != name);
            }
            (file.remove_node(name), known)
        }
        7 => {
            node.kind = "k".into();
            (file.add_node(name, "k"), !known)
        }
        8 => {
            let new = random.pick(&NAMES);
            let is_free = new == name || !model.nodes.contains_key(new);
            if let Some(node) = next.nodes.remove(name) {
                next.nodes.insert(new.into(), node);
            }
            for from in next.sources().filter(|from| from.node == name) {
                from.node = new.into();
            }
            (file.rename_node(name, new), known && is_free)
        }
        _ => {
            let output = random.pick(&PORTS);
            next = model.clone();
            next.outputs.remove(output);
            next.outputs.extend(from.clone().map(|from| (output.to_owned(), from)));
            (file.set_output(output, from.as_ref()), true)
        }
    };
    (result, allowed.then_some(next))
}

/// Comments of the first file that stand outside every item and so survive all edits.
const LASTING: [&str; 4] = [
    "// The cache, shortened. Its name: \"cache\" (not a string of the file).\n",
    "// the store\n",
    "/* culling, /* nested */ in the neighbourhood */",
    "// more to come\n",
];

#[test]
fn random_edits_give_the_expected_graph_and_keep_comments() {
    let crowded = CACHE.replace("\n            ", " ").replace("// ids", "").replace("// depths", "");
    let crowded = crowded.replace("// relative", "/* relative */");
    for (seed, start) in [CACHE.to_owned(), CACHE.replace('\n', "\r\n"), crowded].iter().enumerate() {
        let mut random = Random(seed as u64);
        let mut file = parse(start);
        let mut model = Model::of(&file);
        let (mut done, mut refused) = (0, 0);
        for step in 0..4000 {
            let before = file.clone();
            let (result, expected) = random_edit(&mut random, &mut file, &model);
            assert_eq!(result.is_ok(), expected.is_some(), "step {step}: {result:?}\n{}", before.text);
            match expected {
                Some(expected) => {
                    assert_eq!(Model::of(&file), expected, "step {step}:\n{}\n{}", before.text, file.text);
                    model = expected;
                    done += 1;
                }
                None => {
                    assert_eq!(file, before);
                    refused += 1;
                }
            }
            assert_eq!(file, parse(&file.text));
            for comment in LASTING {
                assert!(
                    file.text.contains(comment.trim_end()),
                    "step {step} lost {comment:?}:\n{}",
                    file.text
                );
            }
        }
        assert!(done > 1000 && refused > 100, "{done} done, {refused} refused");
    }
}

/// A folder of its own for a test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("epigraph-file-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn loads_what_the_file_says() {
    let folder = Folder::new("load");
    let path = folder.0.join("cache.ron");
    fs::write(&path, CACHE).unwrap();
    let loaded = GraphFile::load(&path).unwrap();
    assert_eq!((loaded.text.as_str(), loaded.path.as_str()), (CACHE, path.to_str().unwrap()));
}

#[test]
fn a_relative_path_leads_there() {
    let folder = Folder::new("relative");
    let root = &folder.0;
    fs::create_dir_all(root.join("a/b")).unwrap();
    fs::create_dir_all(root.join("c")).unwrap();
    fs::write(root.join("c/x.ron"), "").unwrap();
    assert_eq!(relative(&root.join("a/b"), &root.join("c/x.ron")), Path::new("../../c/x.ron"));
    assert_eq!(relative(&root.join("c"), &root.join("c/x.ron")), Path::new("x.ron"));
    let moved = |value: &str, to: &str| moved_path(value, &root.join("a"), &root.join(to));
    assert_eq!(moved("\"../c/x.ron\"", "a/b").as_deref(), Some("\"../../c/x.ron\""));
    assert_eq!(moved("\"../c/x.ron\"", "c").as_deref(), Some("\"x.ron\""));
    assert_eq!([moved("\"../c/x.ron\"", "a"), moved("3", "c")], [None, None]);
}

#[test]
fn unreadable_files_are_problems() {
    let folder = Folder::new("unreadable");
    let binary = folder.0.join("binary.ron");
    fs::write(&binary, [0xff, 0xfe, 0]).unwrap();
    for path in [folder.0.clone(), folder.0.join("missing.ron"), binary] {
        let problems = GraphFile::load(&path).unwrap_err();
        assert!(matches!(problems.0[0].error, GraphError::Io { action: "read", .. }));
        assert_eq!(problems.0[0].place.as_ref().unwrap().file, path.display().to_string());
    }
}
