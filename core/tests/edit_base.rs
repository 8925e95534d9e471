//! Edits of graphs that change another graph: what is written, that the result is as asked, and what is refused.

use std::{io, path::Path};

use epigraph_core::{Download, GraphFile, Problems, Side, Source};

const BASE: &str = r#"Graph(
    version: 1,
    params: {
        "height": (default: 2.0, doc: "A height.", range: (0.0, 5.0)),
        "way": (default: Up, choices: [Up, Down]),
    },
    nodes: {
        "tall": (kind: "number", params: (value: Param("height"))),
        "turn": (kind: "number", bypass: true, params: (value: Param("way"))),
        "three": (kind: "number", params: (value: 3.0)),
        "part": (kind: "graph", params: (file: "part.ron", much: 2.0), set: { "two": (factor: 2.0) },
            inputs: { "x": "three.out", "y": "one.out" }),
        "one": (kind: "number", on: Cpu, download: Latent(1)),
        "row": (kind: "add", repeat: (times: 3, through: { "a": "out" }, count: "level"), inputs: { "a": "one.out" },
            set: { "1": (amount: 5.0) }),
        "rows": (kind: "add", repeat: (times: 2, through: { "a": "out" }), inputs: { "a": "one.out" },
            set: { "1": (amount: Param("height")) }),
        "shade": (kind: "wgsl", inputs: { "color": "row.out" }, params: (shader: "shade.wgsl", light: 0.5)),
        "last": (kind: "add", inputs: { "a": "part.result", "b": "part/first.out" }, params: (amount: 1.0)),
    },
    outputs: { "image": "last.out" },
)"#;

const PART: &str = r#"Graph(
    version: 1,
    params: { "much": (default: 1.0) },
    nodes: {
        "first": (kind: "add", inputs: { "a": "inputs.x" }, params: (amount: Param("much"))),
        "two": (kind: "scale", inputs: { "a": "first.out", "b": "inputs.y" }, params: (factor: 4.0, shift: 1.0)),
        "steps": (kind: "add", repeat: (times: 2, through: { "a": "out" }, count: "level"), inputs: { "a": "inputs.x" },
            params: (amount: 3.0), set: { "1": (amount: 4.0) }),
        "taken": (kind: "add", repeat: (times: 2, through: { "a": "out" }), inputs: { "a": "inputs.x" },
            set: { "1": (amount: Param("much")) }),
    },
    outputs: { "result": "two.out" },
)"#;

fn read(path: &Path) -> io::Result<String> {
    match path.to_str() {
        Some("deep/base.ron") => Ok(BASE.into()),
        Some("deep/part.ron") => Ok(PART.into()),
        _ => Err(io::ErrorKind::NotFound.into()),
    }
}

const EMPTY: &str = "Graph(\n    version: 1,\n    base: \"deep/base.ron\", // why\n)\n";

fn parse(text: &str) -> GraphFile {
    let file = GraphFile::parse("change.ron", text).and_then(|file| file.with_parts(&read));
    file.unwrap_or_else(|problems| panic!("{problems}\n{text}"))
}

fn source(text: &str) -> Source {
    text.parse().unwrap()
}

type Edit = fn(&mut GraphFile) -> Result<(), Problems>;

/// The text of a change with these lines in it.
fn with(lines: &str) -> String {
    EMPTY.replace(")\n", &format!("{lines})\n"))
}

/// Applies an edit to a text with these lines, and compares the lines after it.
#[track_caller]
fn assert_edit(before: &str, edit: Edit, after: &str) {
    let mut file = parse(&with(before));
    edit(&mut file).unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!(file.text, with(after));
    // The base is still known.
    assert_eq!(file, parse(&file.text));
}

#[test]
fn what_concerns_the_base_is_written_down_as_a_change() {
    let cases: [(&str, Edit, &str); 39] = [
        ("", |f| f.set_param("last", "amount", "2.0"), "    set: { \"last\": (amount: 2.0) },\n"),
        ("", |f| f.set_param("two", "factor", "5.0"), "    set: { \"part/two\": (factor: 5.0) },\n"),
        ("", |f| f.set_param("part", "much", "5.0"), "    set: { \"part\": (much: 5.0) },\n"),
        ("", |f| f.set_param("row/1", "amount", "6.0"), "    set: { \"row/1\": (amount: 6.0) },\n"),
        (
            "    set: { \"last\": (amount: 2.0) },\n",
            |f| f.set_param("last", "amount", "3.0"),
            "    set: { \"last\": (amount: 3.0) },\n",
        ),
        (
            "    set: { \"last\": (amount: 2.0) },\n",
            |f| f.set_param("one", "value", "3.0"),
            "    set: { \"last\": (amount: 2.0), \"one\": (value: 3.0) },\n",
        ),
        // What a change sets comes before what it writes elsewhere.
        (
            "    nodes: { \"new\": (kind: \"add\") },\n    set: { \"new\": (amount: 1.0) },\n",
            |f| f.set_param("new", "amount", "2.0"),
            "    nodes: { \"new\": (kind: \"add\") },\n    set: { \"new\": (amount: 2.0) },\n",
        ),
        ("", |f| f.set_graph_param("height", "3.0"), "    params: { \"height\": (default: 3.0) },\n"),
        (
            "    params: { \"height\": (default: 3.0) },\n",
            |f| f.set_graph_param("height", "4.0"),
            "    params: { \"height\": (default: 4.0) },\n",
        ),
        (
            "",
            |f| f.set_graph_param("way", "Down"),
            "    params: { \"way\": (default: Down, choices: [Up, Down]) },\n",
        ),
        ("    params: { \"height\": (default: 3.0) },\n", |f| f.restore_param("height"), "    params: {},\n"),
        ("    set: { \"last\": (amount: 2.0) },\n", |f| f.remove_param("last", "amount"), "    set: {},\n"),
        (
            "",
            |f| f.set_input("last", "a", Some(&source("three.out"))),
            "    rewire: { \"last.a\": \"three.out\" },\n",
        ),
        (
            "",
            |f| f.set_input("part/two", "b", Some(&source("part/first.out"))),
            "    rewire: { \"part/two.b\": \"part/first.out\" },\n",
        ),
        ("", |f| f.set_input("last", "b", None), "    rewire: { \"last.b\": None },\n"),
        // As it is in the base: no change is left.
        (
            "    rewire: { \"last.a\": \"three.out\" },\n",
            |f| f.set_input("last", "a", Some(&source("part.result"))),
            "    rewire: {},\n",
        ),
        (
            "",
            |f| f.set_output("image", Some(&source("one.out"))),
            "    outputs: { \"image\": \"one.out\" },\n",
        ),
        ("", |f| f.set_output("more", Some(&source("one.out"))), "    outputs: { \"more\": \"one.out\" },\n"),
        ("    outputs: { \"more\": \"one.out\" },\n", |f| f.set_output("more", None), "    outputs: {},\n"),
        ("", |f| f.add_node("new", "add"), "    nodes: { \"new\": (kind: \"add\") },\n"),
        ("", |f| f.set_kind("last", "scale"), "    replace: { \"last\": (kind: \"scale\") },\n"),
        // The definition as it is in the base, with paths from here; wires stay by themselves.
        (
            "",
            |f| f.set_on("shade", Some(Side::Gpu)),
            "    replace: { \"shade\": (kind: \"wgsl\", params: (shader: \"deep/shade.wgsl\", light: 0.5), on: Gpu) },\n",
        ),
        (
            "",
            |f| f.set_download("one", Some(Download::Sync)),
            "    replace: { \"one\": (kind: \"number\", on: Cpu, download: Sync) },\n",
        ),
        (
            "",
            |f| f.set_bypass("part/first", true),
            "    replace: { \"part/first\": (kind: \"add\", params: (amount: 2.0), bypass: true) },\n",
        ),
        (
            "",
            |f| f.set_bypass("part/two", true),
            "    replace: { \"part/two\": (kind: \"scale\", params: (shift: 1.0, factor: 2.0), bypass: true) },\n",
        ),
        (
            "",
            |f| f.copy_node("last", "new"),
            "    nodes: { \"new\": (kind: \"add\", inputs: { \"a\": \"part.result\", \"b\": \"part/first.out\" }, params: (amount: \
             1.0)) },\n",
        ),
        (
            "",
            |f| f.copy_node("part", "new"),
            "    nodes: { \"new\": (kind: \"graph\", inputs: { \"x\": \"three.out\", \"y\": \"one.out\" }, params: (file: \
             \"deep/part.ron\", much: 2.0), set: { \"two\": (factor: 2.0) }) },\n",
        ),
        (
            "",
            |f| f.copy_node("row", "new"),
            "    nodes: { \"new\": (kind: \"add\", repeat: (times: 3, through: { \"a\": \"out\" }, count: \"level\"), inputs: { \"a\": \
             \"one.out\" }, set: { \"1\": (amount: 5.0) }) },\n",
        ),
        // What it takes from its graph, it goes on taking.
        (
            "",
            |f| f.set_on("tall", Some(Side::Cpu)),
            "    replace: { \"tall\": (kind: \"number\", params: (value: Param(\"height\")), on: Cpu) },\n",
        ),
        (
            "",
            |f| f.set_on("row", Some(Side::Cpu)),
            "    replace: { \"row\": (kind: \"add\", set: { \"1\": (amount: 5.0) }, on: Cpu) },\n",
        ),
        (
            "",
            |f| f.set_on("rows", Some(Side::Cpu)),
            "    replace: { \"rows\": (kind: \"add\", set: { \"1\": (amount: Param(\"height\")) }, on: Cpu) },\n",
        ),
        // The number of a copy is not a parameter that it is given.
        (
            "",
            |f| f.set_on("part/steps", Some(Side::Cpu)),
            "    replace: { \"part/steps\": (kind: \"add\", params: (amount: 3.0), set: { \"1\": (amount: 4.0) }, on: Cpu) \
             },\n",
        ),
        // Of the node as it is in the base.
        (
            "    set: { \"last\": (amount: 2.0) },\n",
            |f| f.set_on("last", Some(Side::Cpu)),
            "    set: { \"last\": (amount: 2.0) },\n    replace: { \"last\": (kind: \"add\", params: (amount: 1.0), on: Cpu) },\n",
        ),
        (
            "",
            |f| f.set_on("one", Some(Side::Gpu)),
            "    replace: { \"one\": (kind: \"number\", on: Gpu, download: Latent(1)) },\n",
        ),
        (
            "",
            |f| f.set_on("turn", Some(Side::Gpu)),
            "    replace: { \"turn\": (kind: \"number\", bypass: true, params: (value: Param(\"way\")), on: Gpu) },\n",
        ),
        // A part goes with its node.
        (
            "    replace: { \"part\": (kind: \"graph\", params: (file: \"deep/part.ron\")) },\n",
            |f| f.restore_node("part"),
            "    replace: {},\n",
        ),
        (
            "    nodes: { \"new\": (kind: \"graph\", params: (file: \"deep/part.ron\")) },\n",
            |f| f.rename_node("new", "other"),
            "    nodes: { \"other\": (kind: \"graph\", params: (file: \"deep/part.ron\")) },\n",
        ),
        (
            "    nodes: { \"new\": (kind: \"graph\", params: (file: \"deep/part.ron\")) },\n",
            |f| f.copy_node("new", "other"),
            "    nodes: { \"new\": (kind: \"graph\", params: (file: \"deep/part.ron\")), \"other\": (kind: \"graph\", params: \
             (file: \"deep/part.ron\")) },\n",
        ),
        (
            "    nodes: { \"new\": (kind: \"add\") },\n    set: { \"new\": (amount: 1.0), \"last\": (amount: 2.0) },\n",
            |f| f.remove_node("new"),
            "    nodes: {},\n    set: { \"last\": (amount: 2.0) },\n",
        ),
    ];
    for (before, edit, after) in cases {
        assert_edit(before, edit, after);
    }
}

#[test]
fn what_a_change_defines_itself_is_edited_there() {
    let lines = "    replace: { \"last\": (kind: \"scale\", inputs: { \"b\": \"three.out\" }) },\n    nodes: { \"new\": (kind: \
                 \"add\", inputs: { \"a\": \"one.out\" }) },\n    rewire: { \"last.a\": \"new.out\" },\n";
    let cases: [(Edit, &str, &str); 8] = [
        (
            |f| f.set_param("last", "factor", "2.0"),
            "{ \"b\": \"three.out\" })",
            "{ \"b\": \"three.out\" }, params: (factor: 2.0))",
        ),
        (
            |f| f.set_on("last", Some(Side::Cpu)),
            "{ \"b\": \"three.out\" })",
            "{ \"b\": \"three.out\" }, on: Cpu)",
        ),
        (|f| f.set_kind("last", "add"), "\"scale\"", "\"add\""),
        (|f| f.set_input("last", "b", Some(&source("one.out"))), "\"three.out\"", "\"one.out\""),
        // The base connects it too.
        (
            |f| f.set_input("last", "b", None),
            "{ \"b\": \"three.out\" }) },\n    nodes: { \"new\": (kind: \"add\", inputs: { \"a\": \"one.out\" }) },\n    rewire: { \
             \"last.a\": \"new.out\" }",
            "{}) },\n    nodes: { \"new\": (kind: \"add\", inputs: { \"a\": \"one.out\" }) },\n    rewire: { \"last.a\": \"new.out\", \
             \"last.b\": None }",
        ),
        (|f| f.set_input("new", "a", Some(&source("three.out"))), "\"one.out\"", "\"three.out\""),
        (
            |f| f.rename_node("new", "old"),
            "\"new\": (kind: \"add\", inputs: { \"a\": \"one.out\" }) },\n    rewire: { \"last.a\": \"new.out\"",
            "\"old\": (kind: \"add\", inputs: { \"a\": \"one.out\" }) },\n    rewire: { \"last.a\": \"old.out\"",
        ),
        (
            |f| f.remove_node("new"),
            "{ \"new\": (kind: \"add\", inputs: { \"a\": \"one.out\" }) },\n    rewire: { \"last.a\": \"new.out\" }",
            "{},\n    rewire: {}",
        ),
    ];
    for (edit, old, new) in cases {
        assert_eq!(lines.matches(old).count(), 1, "{old}");
        assert_edit(lines, edit, &lines.replace(old, new));
    }
    assert_edit(
        lines,
        |f| f.restore_node("last"),
        &lines
            .replace("{ \"last\": (kind: \"scale\", inputs: { \"b\": \"three.out\" }) }", "{}")
            .replace("{ \"last.a\": \"new.out\" }", "{}"),
    );
}

#[test]
fn what_a_change_cannot_do_is_refused() {
    let cases: [(Edit, &str); 18] = [
        (
            |f| f.remove_node("last"),
            "node `last`: it is a node of the base, `deep/base.ron`, and a change cannot remove it; bypass it",
        ),
        (|f| f.remove_node("part/two"), "node `part/two`: it is a node of the base"),
        (
            |f| f.set_on("part/taken", Some(Side::Cpu)),
            "node `part/taken`: its copies take parameters of its part, which have no name outside; edit the part's file",
        ),
        (
            |f| f.rename_node("last", "first"),
            "it is a node of the base, `deep/base.ron`, and a change cannot give it another name",
        ),
        (|f| f.remove_node("las"), "unknown node `las`"),
        (|f| f.add_node("last", "add"), "duplicate node `last`"),
        (|f| f.copy_node("last", "one"), "duplicate node `one`"),
        (|f| f.copy_node("part/two", "new"), "a change cannot add nodes there"),
        (|f| f.set_param("lst", "amount", "1"), "unknown node `lst`, did you mean `last`?"),
        (|f| f.set_param("part", "file", "\"x.ron\""), "the file of a part is changed by replace"),
        (|f| f.set_param("last", "a b", "1"), "`a b` cannot name a parameter"),
        (|f| f.set_input("lst", "a", Some(&source("one.out"))), "unknown node `lst`, did you mean `last`?"),
        (
            |f| f.set_output("image", None),
            "`image` is an output of the base, `deep/base.ron`, and a change cannot remove it",
        ),
        (|f| f.set_kind("lst", "add"), "unknown node `lst`, did you mean `last`?"),
        (|f| f.remove_param("last", "amount"), "unknown parameter `amount`"),
        (
            |f| f.set_graph_param("heigt", "3.0"),
            "unknown parameter of the graph `heigt`, did you mean `height`?",
        ),
        (|f| f.set_graph_param("height", "9.0"), "0 to 5"),
        (|f| f.restore_param("height"), "unknown parameter of the graph `height`"),
    ];
    for (edit, message) in cases {
        let mut file = parse(EMPTY);
        let problems = edit(&mut file).expect_err(message).to_string();
        assert!(problems.contains(message), "{message}\nnot in\n{problems}");
        assert_eq!(file, parse(EMPTY));
    }
}

#[test]
fn differences_are_told_in_words_and_places() {
    let lines = "    params: { \"height\": (default: 3.0), \"more\": (default: 1) },\n    replace: { \"shade\": (kind: \"add\") \
                 },\n    nodes: { \"new\": (kind: \"add\") },\n    rewire: { \"last.a\": \
                 \"new.out\", \"last.b\": None },\n    set: { \"part/two\": (factor: 1.0) },\n    outputs: { \"image\": \"new.out\" },\n";
    let file = parse(&with(lines));
    let told: Vec<String> =
        file.differences().iter().map(|found| format!("{} {}", found.node, found.what)).collect();
    let expected = [
        " height: 3.0",
        " new parameter more: 1",
        "shade in the place of shade.wgsl",
        "new added",
        "last a takes new.out",
        "last b is disconnected",
        "part/two factor: 1.0",
        "outputs image takes new.out",
    ];
    assert_eq!(told, expected);
    for found in file.differences() {
        assert!(!file.place(found.span).text.is_empty());
    }
    assert_eq!(parse(&with("")).differences(), []);
    let span = file.node_span("part/two").unwrap();
    assert_eq!(&file.text[span.start..span.end], "\"part/two\": (factor: 1.0)");
    assert_eq!(file.node_span("one"), None);
}
