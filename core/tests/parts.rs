//! Parameters of graphs, and nodes that are repeated in a row, computed on the CPU: what reaches which node, what an
//! edit writes, and where each mistake is reported.

use epigraph_core::{
    CpuContext, Executor, Extent, Facts, Frame, GraphFile, Host, In, Io, Out, Problems, Registry, Settings,
    Stage, compile, params, testing::Random,
};

params! {
    /// Parameters of [`Digit`].
    pub struct DigitParams {
        /// Added to the digit.
        add: f32 = 0.0, in 0.0..=9.0;
        /// The digit.
        level: u32 = 0;
    }
}

/// Appends a digit to a number.
struct Digit {
    from: Option<In<f32>>,
    to: Out<f32>,
}

impl Stage for Digit {
    const KIND: &'static str = "digit";
    const DOC: &'static str = "Appends a digit to a number.";
    type Params = DigitParams;

    fn declare(_: &DigitParams, io: &mut Io) -> Self {
        let from = io.optional("from", "A number; 0 if not connected.", Extent::Any);
        Self { from, to: io.write("to", "The longer number.", Extent::Fixed([1, 1])) }
    }

    fn cpu(&self, params: &DigitParams, cx: &CpuContext) -> Result<(), String> {
        let from = self.from.map_or(0.0, |from| cx.read(from)[0]);
        cx.write(self.to)[0] = 10.0 * from + params.level as f32 + params.add;
        Ok(())
    }
}

fn file(params: &str, nodes: &str, output: &str, parts: &[(&str, &str)]) -> Result<GraphFile, Problems> {
    let text = format!(
        "Graph(version: 1, params: {{ {params} }}, nodes: {{\n{nodes}\n}}, outputs: {{ \"out\": \"{output}\" }})"
    );
    read(&text, parts)
}

fn read(text: &str, parts: &[(&str, &str)]) -> Result<GraphFile, Problems> {
    GraphFile::parse("top.ron", text)?.with_parts(&|path: &std::path::Path| {
        let name = path.display().to_string();
        let part = parts.iter().find(|(known, _)| *known == name);
        part.map(|(_, text)| (*text).to_owned()).ok_or(std::io::ErrorKind::NotFound.into())
    })
}

/// The number that the output holds.
#[track_caller]
fn number(file: &GraphFile) -> f32 {
    let (registry, settings) = (Registry::default().with::<Digit>(), Settings::new([1, 1], 0, Facts::none()));
    let (graph, plan) = compile(file, &registry, &settings).unwrap_or_else(|problems| panic!("{problems}"));
    let mut executor = Executor::new(graph, plan, &settings, &registry, None).unwrap();
    executor.run(&Frame::default(), &Host::default(), true).unwrap();
    executor.snapshot("out", "").unwrap().unwrap().get::<f32>()[0]
}

#[track_caller]
fn problems(file: Result<GraphFile, Problems>) -> Problems {
    let (registry, settings) = (Registry::default().with::<Digit>(), Settings::new([1, 1], 0, Facts::none()));
    let problems = file.and_then(|file| compile(&file, &registry, &settings).map(drop));
    problems.expect_err("it is broken")
}

/// Each problem as `FILE TEXT: MESSAGE`, with the underlined text.
#[track_caller]
fn told(file: Result<GraphFile, Problems>) -> Vec<String> {
    let tell = |problem: &epigraph_core::Problem| {
        let place = problem.place.as_ref().unwrap();
        let underlined: String = place.text.chars().skip(place.column - 1).take(place.length).collect();
        let node = problem.node.as_ref().map_or(String::new(), |node| format!("{node}: "));
        format!("{} {underlined}: {node}{}", place.file, problem.error)
    };
    problems(file).0.iter().map(tell).collect()
}

#[track_caller]
fn tells(file: Result<GraphFile, Problems>, wanted: &[&str]) {
    assert_eq!(told(file), wanted);
}

const ROW: &str = r#"Graph(version: 1, params: {
    "shift": (default: 0.0, doc: "Added to each digit.", range: (0.0, 5.0), unit: "ones"),
    "digits": (default: 3, range: (1, 9)),
}, nodes: {
    "row": (kind: "digit", repeat: (times: Param("digits"), through: { "from": "to" }, count: "level"),
        inputs: { "from": "inputs.from" }, params: (add: Param("shift"))),
}, outputs: { "to": "row.to" })"#;

fn row(beside: &str, set: &str) -> Result<GraphFile, Problems> {
    let node = format!(r#""r": (kind: "graph", params: (file: "row.ron"{beside}){set}),"#);
    file("", &node, "r.to", &[("row.ron", ROW)])
}

#[test]
fn copies_form_a_row_and_count() {
    let nodes = r#"
        "one": (kind: "digit", params: (level: 7)),
        "row": (kind: "digit", repeat: (times: 4, through: { "from": "to" }, count: "level"), inputs: { "from": "one.to" }),
        "last": (kind: "digit", inputs: { "from": "row.to" }, params: (level: 9)),"#;
    assert_eq!(number(&file("", nodes, "last.to", &[]).unwrap()), 701_239.0);
    // One copy alone is read by its number.
    assert_eq!(number(&file("", nodes, "row/1.to", &[]).unwrap()), 701.0);
    // Without a parameter that counts, all are the same.
    let alike = nodes.replace(", count: \"level\"", "");
    assert_eq!(number(&file("", &alike, "last.to", &[]).unwrap()), 700_009.0);
    // The first input of a row may stay unconnected.
    let open = nodes
        .replace("inputs: { \"from\": \"one.to\" }),\n        \"last", "),\n        \"last")
        .replace(" count: \"level\"), )", " count: \"level\"))");
    assert_eq!(number(&file("", &open, "row.to", &[]).unwrap()), 123.0);
}

#[test]
fn a_parameter_of_a_graph_reaches_all_nodes_that_take_it() {
    let top = r#""shift": (default: 1.0), "digit": (default: 2)"#;
    let nodes = r#"
        "a": (kind: "digit", params: (level: Param("digit"), add: Param("shift"))),
        "b": (kind: "digit", params: (level: 4, add: Param("shift")), inputs: { "from": "a.to" }),"#;
    let mut graph = file(top, nodes, "b.to", &[]).unwrap();
    assert_eq!(number(&graph), 35.0);
    graph.set_graph_param("shift", "2.0 // more").unwrap();
    assert_eq!(number(&graph), 46.0);
    assert!(graph.text.contains(r#""shift": (default: 2.0), "#), "{}", graph.text);
    // A number over it takes the node out.
    graph.set_param("a", "add", "0.0").unwrap();
    assert_eq!(number(&graph), 26.0);
}

#[test]
fn the_including_node_sets_a_parts_parameters() {
    assert_eq!(number(&row("", "").unwrap()), 12.0);
    assert_eq!(number(&row(", shift: 1.0, digits: 4", "").unwrap()), 1234.0);
    let mut graph = row("", "").unwrap();
    graph.set_param("r", "shift", "2.0").unwrap();
    assert!(graph.text.contains(r#"(file: "row.ron", shift: 2.0)"#), "{}", graph.text);
    assert_eq!(number(&graph), 234.0);
    // Through two files, under another name; and set from outside of both.
    let middle = r#"Graph(version: 1, params: { "up": (default: 4.0) }, nodes: {
        "r": (kind: "graph", params: (file: "row.ron", shift: Param("up"), digits: 2)),
    }, outputs: { "to": "r.to" })"#;
    let parts = [("middle.ron", middle), ("row.ron", ROW)];
    for (node, wanted) in [
        (r#"(file: "middle.ron")"#, 45.0),
        (r#"(file: "middle.ron", up: 1.0)"#, 12.0),
        (r#"(file: "middle.ron"), set: { "r": (shift: 3.0) }"#, 34.0),
        (r#"(file: "middle.ron"), set: { "r": (digits: 3), "r/row": (add: 0.0) }"#, 12.0),
        (r#"(file: "middle.ron"), set: { "r/row/1": (add: 0.0) }"#, 41.0),
    ] {
        let nodes = format!(r#""m": (kind: "graph", params: {node}),"#);
        assert_eq!(number(&file("", &nodes, "m.to", &parts).unwrap()), wanted, "{node}");
    }
}

#[test]
fn a_part_is_repeated_as_well_as_a_stage() {
    let part = r#"Graph(version: 1, params: { "digit": (default: 5) }, nodes: {
        "digit": (kind: "digit", inputs: { "from": "inputs.from" }, params: (level: Param("digit"))),
    }, outputs: { "from": "digit.to" })"#;
    let row = |set: &str| {
        let node = format!(
            r#""p": (kind: "graph", repeat: (times: 3, through: "from", count: "digit"), params: (file: "part.ron"){set}),"#
        );
        file("", &node, "p.from", &[("part.ron", part)])
    };
    assert_eq!(number(&row("").unwrap()), 12.0);
    assert_eq!(number(&row(r#", set: { "1": (digit: 8) }"#).unwrap()), 82.0);
    assert_eq!(number(&row(r#", set: { "1/digit": (level: 7), "digit": (level: 3) }"#).unwrap()), 373.0);
    let mut graph = row("").unwrap();
    graph.set_param("p/2/digit", "level", "6").unwrap();
    assert!(graph.text.contains(r#"set: { "2/digit": (level: 6) }"#), "{}", graph.text);
    assert_eq!(number(&graph), 16.0);
    graph.set_param("p/0", "digit", "9").unwrap();
    assert_eq!(number(&graph), 916.0);
    // All of them: the part's text still hands out its parameter.
    graph.set_param("p/digit", "level", "1").unwrap();
    assert!(graph.text.contains(r#""0": (digit: 9), "digit": (level: 1) }"#), "{}", graph.text);
    assert_eq!(number(&graph), 116.0);
    tells(
        row(r#", set: { "3": (digit: 8) }"#),
        &["top.ron \"3\": p: there is no copy 3 of 3; they are numbered 0 to 2"],
    );
}

#[test]
fn one_copy_is_set_by_its_number() {
    let nodes =
        r#""row": (kind: "digit", repeat: (times: 3, through: { "from": "to" }), set: { "2": (level: 7) }),"#;
    let mut graph = file("", nodes, "row.to", &[]).unwrap();
    assert_eq!(number(&graph), 7.0);
    graph.set_param("row/1", "level", "6").unwrap();
    graph.set_param("row/2", "level", "8").unwrap();
    assert!(graph.text.contains(r#"set: { "2": (level: 8), "1": (level: 6) }"#), "{}", graph.text);
    assert_eq!(number(&graph), 68.0);
    // All of them.
    graph.set_param("row", "add", "1").unwrap();
    assert_eq!(number(&graph), 179.0);
    let far = graph.set_param("row/3", "level", "1").unwrap_err().to_string();
    assert_eq!(far, "node `row/3`: there is no copy 3 of 3; they are numbered 0 to 2");
    tells(
        file("", nodes, "row/3.to", &[]),
        &["top.ron \"row/3.to\": there is no copy 3 of 3; they are numbered 0 to 2"],
    );
}

#[test]
fn parameters_of_graphs_are_checked_where_they_are_written() {
    let declared = |declared: &str| {
        file(declared, r#""a": (kind: "digit", params: (add: Param("p"))),"#, "a.to", &[]).map(drop)
    };
    for good in [
        r#""p": (default: 1)"#,
        r#""p": (default: 1, range: (0.0, 2.0), doc: "Words.", unit: "m")"#,
        r#""p": (default: 0.1, range: (0.1, 2))"#,
        r#""p": (default: 2, range: (2, 2))"#,
    ] {
        declared(good).unwrap_or_else(|problems| panic!("{good}: {problems}"));
    }
    for (text, wanted) in [
        (r#""p": ()"#, "`default` is missing; write default: VALUE"),
        (r#""p": (default: 3.0, range: (0.0, 2.0))"#, "parameter `p` is 3.0, outside 0 to 2"),
        (
            r#""p": (default: 1, range: (2, 1))"#,
            "expected finite numbers, the lower one first, found `(2, 1)`",
        ),
        (
            r#""p": (default: 1.0, range: (-inf, 2.0))"#,
            "expected finite numbers, the lower one first, found `(-inf, 2.0)`",
        ),
        (
            r#""p": (default: 1.0, range: (0.0, inf))"#,
            "expected finite numbers, the lower one first, found `(0.0, inf)`",
        ),
        (r#""p": (default: 1, range: 2)"#, "expected a range as (LOW, HIGH), found `2`"),
        (r#""p": (default: true, range: (0, 1))"#, "parameter `p` is true or false, which has no range"),
        (r#""p": (default: A, choices: [B, C])"#, "parameter `p`: there is no `A`; expected one of B, C"),
        (
            r#""p": (default: A)"#,
            "expected a number, true or false, a text in double quotes, or one of the names in `choices`, found `A`",
        ),
        (r#""p": (default: B, choices: [B, "C"])"#, "expected names as [ONE, OTHER], found `[B, \"C\"]`"),
        (r#""p": (default: B, choices: ["B"])"#, "expected names as [ONE, OTHER], found `[\"B\"]`"),
        (r#""p": (defualt: 1)"#, "unknown field `defualt`, did you mean `default`?"),
        (r#""a b": (default: 1)"#, "`a b` cannot name a parameter of a graph"),
        (r#""file": (default: 1)"#, "`file` cannot name a parameter of a graph"),
        (r#""p": (default: 1), "p": (default: 2)"#, "duplicate parameter `p`"),
    ] {
        let text = declared(text).expect_err(text).to_string();
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
    // The kind of value follows from how default and range are written.
    for (text, kind) in [
        ("default: 1", "a whole number"),
        ("default: 0", "a whole number"),
        ("default: 0, range: (0, 1)", "a whole number"),
        ("default: -1", "a whole number, negative allowed"),
        ("default: 1, range: (-1, 1)", "a whole number, negative allowed"),
        ("default: 1, range: (0.0, 1.0)", "a number"),
        ("default: 1.0", "a number"),
        ("default: false", "true or false"),
        ("default: \"a\"", "a text in quotes"),
        ("default: A, choices: [A, B]", "one of A, B"),
    ] {
        let text = format!("Graph(version: 1, params: {{ \"p\": ({text}) }}, nodes: {{}}, outputs: {{}})");
        assert_eq!(read(&text, &[]).unwrap().params[0].spec.kind.words(), kind, "{text}");
    }
}

#[test]
fn values_that_a_parameter_of_a_graph_cannot_have_are_refused_where_they_are_written() {
    tells(row(", shift: 9.0", ""), &["top.ron 9.0: r: parameter `shift` is 9.0, outside 0 to 5"]);
    tells(row(", digits: 0", ""), &["top.ron 0: r: parameter `digits` is 0, outside 1 to 9"]);
    // What the stage refuses, though the graph's own range allows it.
    let wide = r#""shift": (default: 1.0, range: (0.0, 100.0))"#;
    let node = r#""a": (kind: "digit", params: (add: Param("shift"))),"#;
    let mut graph = file(wide, node, "a.to", &[]).unwrap();
    graph.set_graph_param("shift", "50.0").unwrap();
    tells(Ok(graph), &["top.ron 50.0: a: parameter `add` is 50.0, outside 0 to 9"]);
    // Times, from a parameter without a range.
    let row = r#""a": (kind: "digit", repeat: (times: Param("n"), through: { "from": "to" })),"#;
    tells(
        file("\"n\": (default: 300)", row, "a.to", &[]),
        &[
            "top.ron 300: a: parameter `times`: found `300`; expected a whole number from 1 to 256, or Param(\"NAME\")",
        ],
    );
}

#[test]
fn names_that_nothing_takes_are_refused() {
    tells(
        row(", shft: 1.0", ""),
        &["top.ron shft: r: unknown parameter of the graph `shft`, did you mean `shift`?"],
    );
    tells(
        row("", r#", set: { "row": (ad: 1.0) }"#),
        &["top.ron ad: r/row/0: unknown parameter `ad`, did you mean `add`?"],
    );
    tells(
        row("", r#", set: { "rwo": (add: 1.0) }"#),
        &["top.ron \"rwo\": r: unknown node `rwo`, did you mean `row`?"],
    );
    tells(
        row("", r#", set: { "row/3": (add: 1.0) }"#),
        &["top.ron \"row/3\": r: there is no copy 3 of 3; they are numbered 0 to 2"],
    );
    let node = r#""a": (kind: "digit", params: (add: Param("sum"))),"#;
    tells(
        file("", node, "a.to", &[]),
        &[
            "top.ron Param(\"sum\"): a: the graph has no parameters; write params: { \"sum\": (default: VALUE) } beside `nodes`",
        ],
    );
    tells(
        file("\"some\": (default: 1)", node, "a.to", &[]),
        &["top.ron Param(\"sum\"): a: unknown parameter of the graph `sum`; known: some"],
    );
    // A parameter that no node takes may be declared, but not set.
    let mut graph = file("\"some\": (default: 1)", r#""a": (kind: "digit"),"#, "a.to", &[]).unwrap();
    assert_eq!(number(&graph), 0.0);
    let text = graph.set_graph_param("some", "2").unwrap_err().to_string();
    assert_eq!(text, "no node takes the parameter `some`; hand it on by Param(\"some\")");
    let part = r#"Graph(version: 1, params: { "some": (default: 1) }, nodes: {}, outputs: {})"#;
    let node = r#""p": (kind: "graph", params: (file: "part.ron", some: 2)), "a": (kind: "digit"),"#;
    tells(
        file("", node, "a.to", &[("part.ron", part)]),
        &["top.ron some: p: no node takes the parameter `some`; hand it on by Param(\"some\")"],
    );
    let row = r#""a": (kind: "digit", repeat: (times: Param("n"), through: { "from": "to" })),"#;
    tells(
        file("", row, "a.to", &[]),
        &[
            "top.ron Param(\"n\"): a: the graph has no parameters; write params: { \"n\": (default: VALUE) } beside `nodes`",
        ],
    );
    let node = r#""a": (kind: "digit", params: (add: Param(sum))),"#;
    let text = problems(file("", node, "a.to", &[])).to_string();
    assert!(
        text.contains("expected a parameter of the graph as Param(\"NAME\"), found `Param(sum)`"),
        "{text}"
    );

    // Parameters of a part, set from around it.
    let middle = r#"Graph(version: 1, nodes: { "r": (kind: "graph", params: (file: "row.ron")) }, outputs: { "to": "r.to" })"#;
    let set = |set: &str| {
        let node = format!(r#""m": (kind: "graph", params: (file: "middle.ron"), set: {{ {set} }}),"#);
        file("", &node, "m.to", &[("middle.ron", middle), ("row.ron", ROW)])
    };
    tells(
        set(r#""r": (file: "nosuchfile.ron")"#),
        &["top.ron file: m/r: a part's `file` is named where the part is included, in its `params`"],
    );
    tells(
        set(r#""r": (bogus: 3)"#),
        &["top.ron bogus: m/r: unknown parameter of the graph `bogus`; known: shift, digits"],
    );
}

#[test]
fn faults_of_repeated_nodes_are_told_once_and_where_they_stand() {
    let row = |repeat: &str, rest: &str| {
        let nodes = format!(r#""a": (kind: "digit", repeat: ({repeat}){rest}),"#);
        file("", &nodes, "a.to", &[])
    };
    let chain = r#"through: { "from": "to" }"#;
    tells(
        row(&format!("times: 3, {chain}"), ", params: (ad: 1)"),
        &["top.ron ad: a/0: unknown parameter `ad`, did you mean `add`?"],
    );
    // Wrong ports are told even if there is only one copy.
    for times in [1, 3] {
        tells(
            row(&format!(r#"times: {times}, through: {{ "form": "too" }}"#), ""),
            &[
                "top.ron \"form\": a/0: unknown input `form`, did you mean `from`?",
                "top.ron \"too\": a/0: unknown output port `too`, did you mean `to`?",
            ],
        );
        tells(
            row(&format!("times: {times}, {chain}, count: \"levle\""), ""),
            &["top.ron \"levle\": a/0: unknown parameter `levle`, did you mean `level`?"],
        );
    }
    tells(
        row(&format!("times: 2, {chain}, count: \"level\""), ", params: (level: 3)"),
        &["top.ron level: a: `repeat` counts `level`; do not set it here"],
    );
    for (repeat, wanted) in [
        ("times: 0, through: \"a\"", "expected a whole number from 1 to 256, or Param(\"NAME\"), found `0`"),
        ("times: 257, through: \"a\"", "expected a whole number from 1 to 256"),
        ("times: -1, through: \"a\"", "expected a whole number from 1 to 256"),
        ("times: 1.5, through: \"a\"", "expected a whole number from 1 to 256"),
        ("times: 2", "`through` is missing; write through: { \"INPUT\": \"OUTPUT\" }"),
        ("through: \"a\"", "`times` is missing; write times: N"),
        ("times: 2, through: {}", "expected at least one input and output, found `{}`"),
        ("times: 2, through: { \"a\": 3 }", "expected an output port in double quotes, found `3`"),
        ("times: 2, throu: \"a\"", "unknown field `throu`, did you mean `through`?"),
        ("times: 2, through: \"a\", count: \"a b\"", "`a b` cannot name a parameter"),
    ] {
        let text = row(repeat, "").expect_err(repeat).to_string();
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
    let text = problems(file("", r#""a": (kind: "digit"),"#, "a/0.to", &[])).to_string();
    assert!(text.contains("unknown node `a/0`; known: a"), "{text}");
}

#[test]
fn what_multiplies_is_bounded() {
    // Nodes: 256 x 256 of them.
    let row = r#"Graph(version: 1, nodes: {
        "n": (kind: "digit", repeat: (times: 256, through: { "from": "to" }), inputs: { "from": "inputs.from" }),
    }, outputs: { "to": "n.to" })"#;
    let node = r#""p": (kind: "graph", repeat: (times: 256, through: { "from": "to" }), params: (file: "row.ron")),"#;
    let text = problems(file("", node, "p.to", &[("row.ron", row)])).to_string();
    let expected = "row.ron:2:9: node `p/39/n`: the graph has more than 10000 nodes or parts, as parts that contain parts and \
                    repeated nodes multiply: top.ron -> row.ron";
    assert!(text.contains(expected), "{text}");
    assert_eq!(text.matches("the graph has more").count(), 1);
    // Parts without nodes: 32 x 32 x 32 of them.
    let empty = "Graph(version: 1, nodes: {}, outputs: { \"to\": \"inputs.from\" })";
    let through = "repeat: (times: 32, through: { \"from\": \"to\" })";
    let holds = |part: &str| {
        format!(
            "Graph(version: 1, nodes: {{ \"n\": (kind: \"graph\", {through}, params: (file: {part:?}), inputs: {{ \"from\": \
             \"inputs.from\" }}) }}, outputs: {{ \"to\": \"n.to\" }})"
        )
    };
    let (outer, inner) = (holds("inner.ron"), holds("empty.ron"));
    let parts = [("row.ron", &outer[..]), ("inner.ron", &inner), ("empty.ron", empty)];
    let text = problems(file("", &node.replace("256", "32"), "p.to", &parts)).to_string();
    assert!(text.contains("multiply: top.ron -> row.ron -> inner.ron"), "{text}");
    // Files: each includes the next one twice.
    let include = |name, level| format!(r#""{name}": (kind: "graph", params: (file: "{}.ron"))"#, level + 1);
    let nodes = |level| match level {
        12 => r#""d": (kind: "digit")"#.to_owned(),
        _ => format!("{}, {}", include("a", level), include("b", level)),
    };
    let parts: Vec<(String, String)> = (0..=12)
        .map(|level| {
            (
                format!("{level}.ron"),
                format!("Graph(version: 1, nodes: {{ {} }}, outputs: {{}})", nodes(level)),
            )
        })
        .collect();
    let parts: Vec<(&str, &str)> = parts.iter().map(|(name, text)| (&name[..], &text[..])).collect();
    let node = r#""p": (kind: "graph", params: (file: "0.ron")),"#;
    let text = problems(file("", node, "p.to", &parts)).to_string();
    let expected = "the graph is made of more than 1000 files: top.ron -> 0.ron -> 1.ron -> 2.ron";
    assert_eq!(text.matches("the graph is made of more").count(), 1);
    assert!(text.contains(expected), "{text}");
    // Files within each other.
    let parts: Vec<(String, String)> = (0..100)
        .map(|level| {
            let include = format!(r#""a": (kind: "graph", params: (file: "{}.ron"))"#, level + 1);
            (format!("{level}.ron"), format!("Graph(version: 1, nodes: {{ {include} }}, outputs: {{}})"))
        })
        .collect();
    let parts: Vec<(&str, &str)> = parts.iter().map(|(name, text)| (&name[..], &text[..])).collect();
    let text = problems(file("", node.replace("row", "0").as_str(), "p.to", &parts)).to_string();
    let expected =
        "62.ron:1:64: node `a`: more than 64 graphs are within each other: top.ron -> 0.ron -> 1.ron -> ";
    assert!(text.contains(expected), "{text}");
    // As many as that, and not one more, may be.
    for (last, fits) in [(62, true), (63, false)] {
        let end = "Graph(version: 1, nodes: { \"d\": (kind: \"digit\") }, outputs: {})".to_owned();
        let chain: Vec<(&str, &str)> = parts
            .iter()
            .enumerate()
            .map(|(level, (name, text))| (*name, if level == last { &end[..] } else { text }))
            .collect();
        let file = file("", &format!("{node} \"a\": (kind: \"digit\")"), "a.to", &chain);
        assert_eq!(file.is_ok(), fits, "{last}");
    }
    // 39 * 256 + 16 are 10,000.
    for (last, fits) in [(16, true), (17, false)] {
        let node = |name: String, times: u32| {
            let repeat = format!("repeat: (times: {times}, through: {{ \"from\": \"to\" }})");
            format!("\"{name}\": (kind: \"digit\", {repeat}),")
        };
        let nodes: String = (0..39).map(|index| node(format!("n{index}"), 256)).collect();
        let found = file("", &(nodes + &node("last".into(), last)), "last.to", &[]).unwrap();
        assert_eq!(found.stages(&Registry::default().with::<Digit>()).is_ok(), fits, "{last}");
    }
    // The same of parts without nodes.
    for (last, fits) in [(16, true), (17, false)] {
        let node = |name: String, times: u32| {
            let repeat = format!("repeat: (times: {times}, through: {{ \"from\": \"to\" }})");
            format!("\"{name}\": (kind: \"graph\", {repeat}, params: (file: \"empty.ron\")),")
        };
        let nodes: String = (0..39).map(|index| node(format!("n{index}"), 256)).collect();
        let found =
            file("", &(nodes + &node("last".into(), last)), "last.to", &[("empty.ron", empty)]).unwrap();
        assert_eq!(found.stages(&Registry::default().with::<Digit>()).is_ok(), fits, "{last}");
    }
    for (count, fits) in [(1000, true), (1001, false)] {
        let node = |index| format!("\"n{index}\": (kind: \"graph\", params: (file: \"63.ron\")),");
        let nodes: String = (0..count).map(node).collect();
        let end = ("63.ron", "Graph(version: 1, nodes: { \"d\": (kind: \"digit\") }, outputs: {})");
        let file = file("", &format!("{nodes} \"a\": (kind: \"digit\")"), "a.to", &[end]);
        assert_eq!(file.is_ok(), fits, "{count}");
    }
}

#[test]
fn a_file_that_contains_itself_is_known_by_any_path() {
    let folder = std::env::temp_dir().join(format!("epigraph-parts-itself-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("x")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write(
        "self.ron",
        r#"Graph(version: 1, nodes: {"a": (kind: "graph", params: (file: "x/../self.ron"))}, outputs: {})"#,
    );
    write(
        "a.ron",
        r#"Graph(version: 1, nodes: {"a": (kind: "graph", params: (file: "x/../b.ron"))}, outputs: {})"#,
    );
    write("b.ron", r#"Graph(version: 1, base: "./x/../a.ron")"#);
    write("base.ron", r#"Graph(version: 1, base: "x/../base.ron")"#);
    let load = |name: &str| GraphFile::load(&folder.join(name)).unwrap_err().to_string();
    let found = ["self.ron", "base.ron", "a.ron"].map(load);
    std::fs::remove_dir_all(&folder).unwrap();
    for (found, expected) in
        found.iter().zip(["x/../self.ron contains itself", "x/../base.ron contains itself"])
    {
        assert!(found.contains(expected) && !found.contains(" -> "), "{found}");
    }
    let chain = "x/.././x/../a.ron contains itself: ";
    assert!(found[2].contains(chain) && found[2].contains("x/../b.ron -> "), "{}", found[2]);
}

#[test]
fn of_many_problems_the_first_are_listed_and_the_rest_counted() {
    let joined =
        |item: &dyn Fn(usize) -> String, between: &str| (0..4000).map(item).collect::<Vec<_>>().join(between);
    let one =
        |text: &str| format!("Graph(version: 1, nodes: {{ {text} }}, outputs: {{ \"out\": \"a.to\" }})");
    let params = |between| {
        one(&format!("\"a\": (kind: \"digit\", params: ({}))", joined(&|i| format!("p{i}: 1"), between)))
    };
    let inputs = |between: &str| {
        let inputs = joined(&|i| format!("\"p{i}\": \"b.to\""), between);
        one(&format!("\"a\": (kind: \"digit\", inputs: {{ {inputs} }})"))
    };
    let kinds = |between: &str| {
        let nodes =
            (0..3000).map(|i| format!("\"n{i}\": (kind: \"k{i}\")")).collect::<Vec<_>>().join(between);
        one(&format!("\"a\": (kind: \"digit\"), {nodes}"))
    };
    let wires = |between: &str| {
        let wire = |i| format!("\"n{i}\": (kind: \"digit\", inputs: {{ \"from\": \"m{i}.to\" }})");
        one(&format!("\"a\": (kind: \"digit\"), {}", (0..3000).map(wire).collect::<Vec<_>>().join(between)))
    };
    let set = |between: &str| {
        let set = joined(&|i| format!("\"b{i}\": (x: 1)"), between);
        one(&format!("\"a\": (kind: \"graph\", params: (file: \"p.ron\"), set: {{ {set} }})"))
    };
    let change = |between: &str| {
        format!(
            "Graph(version: 1, base: \"p.ron\", set: {{ {} }})",
            joined(&|i| format!("\"b{i}\": (x: 1)"), between)
        )
    };
    let part = r#"Graph(version: 1, nodes: {"n": (kind: "digit")}, outputs: { "to": "n.to" })"#;
    for between in [", ", ",\n"] {
        for (text, first, count) in [
            (params(between), "unknown parameter `p0`", 4000),
            // Each port is unknown, and so is the node that it is connected to.
            (inputs(between), "node `a`", 8000),
            (kinds(between), "unknown stage kind `k0`", 3000),
            (wires(between), "unknown node `m0`", 3000),
            (set(between), "unknown node `b0`", 4000),
            (change(between), "unknown node `b0`", 4000),
        ] {
            let start = std::time::Instant::now();
            let found = problems(read(&text, &[("p.ron", part)]));
            let took = start.elapsed().as_secs_f64();
            let told = found.to_string();
            assert!(told.contains(first), "{}", &told[..1000]);
            assert_eq!(found.0.len(), 101, "{first}");
            let more = found.0[100].error.to_string();
            assert!(more == format!("{} more problems", count - 100), "{first}: {more}");
            // Each with a piece of its line, not all of it.
            assert!(told.len() < 100_000, "{first}: {} bytes", told.len());
            assert!(took < 5.0, "{first}: {took} s");
        }
    }
}

#[test]
fn a_place_in_a_long_line_is_shown_with_what_is_around_it() {
    let long = format!("{} wrong {}", "é".repeat(500), "z".repeat(500));
    let place = epigraph_core::Place::of("g.ron", &long, epigraph_core::Span { start: 1001, end: 1006 });
    assert_eq!((place.line, place.column, place.length), (1, 502, 5));
    assert_eq!(place.text, format!("...{} wrong {}...", "é".repeat(79), "z".repeat(74)));
    let underlined: String = place.text.chars().skip(place.lead).take(place.length).collect();
    assert_eq!(underlined, "wrong");
    let problem = epigraph_core::Problem::new(epigraph_core::GraphError::Invalid("no".into())).at(place);
    assert!(problem.to_string().ends_with(&format!("| {}^^^^^", " ".repeat(83))), "{problem}");
    // Lines are cut only if they are longer than that, and marked where they are cut.
    let at = |line: &str, start| {
        epigraph_core::Place::of("g.ron", line, epigraph_core::Span { start, end: start + 1 })
    };
    let letters = "abcdefghij".repeat(41);
    for start in [0, 79, 80, 81, 399] {
        assert_eq!(
            (at(&letters[..400], start).text, at(&letters[..400], start).lead),
            (letters[..400].into(), start)
        );
    }
    let cut = &letters[..401];
    for (start, text, lead) in [
        (0, format!("{}...", &cut[..160]), 0),
        (80, format!("{}...", &cut[..160]), 80),
        (81, format!("...{}...", &cut[1..161]), 83),
        (240, format!("...{}...", &cut[160..320]), 83),
        (320, format!("...{}...", &cut[240..400]), 83),
        (321, format!("...{}", &cut[241..401]), 83),
        (400, format!("...{}", &cut[320..401]), 83),
    ] {
        assert_eq!((at(cut, start).text, at(cut, start).lead), (text, lead), "{start}");
    }
    // Names as long as the line are not compared with others.
    let name = "n".repeat(100_000);
    let node = format!("\"{name}\": (kind: \"digit\", inputs: {{ \"from\": \"{}m.to\" }})", &name[1..]);
    let text = problems(file("", &node, "a.to", &[])).to_string();
    assert!(text.contains("unknown node `nnn"), "{}", &text[..200]);
}

#[test]
fn a_part_passes_on_what_is_connected_to_it() {
    let part = r#"Graph(version: 1, nodes: {}, outputs: { "same": "inputs.from" })"#;
    let nodes = r#"
        "a": (kind: "digit", params: (level: 4)),
        "p": (kind: "graph", params: (file: "part.ron"), inputs: { "from": "a.to" }),
        "b": (kind: "digit", params: (level: 2), inputs: { "from": "p.same" }),"#;
    assert_eq!(number(&file("", nodes, "b.to", &[("part.ron", part)]).unwrap()), 42.0);
    let circle = r#""p": (kind: "graph", params: (file: "part.ron"), inputs: { "from": "p.same" }),"#;
    let text = problems(file("", circle, "p.same", &[("part.ron", part)])).to_string();
    assert!(text.contains("the wire from `p.same` leads in a circle through parts"), "{text}");
}

/// What is wrong in a part, in whatever way, is a problem with its place.
#[test]
fn mutants_of_a_part_are_refused_or_run() {
    let mut random = Random(11);
    let (registry, settings) = (Registry::default().with::<Digit>(), Settings::new([1, 1], 0, Facts::none()));
    let words = [
        "Param(\"shift\")",
        "\"row\"",
        "3",
        "-1",
        "0.5",
        "(",
        ")",
        "{",
        "\"",
        ":",
        ",",
        "times",
        "row/1",
        "Param",
        "inputs.from",
    ];
    let outer = r#"Graph(version: 1, nodes: {
        "r": (kind: "graph", repeat: (times: 2, through: { "from": "to" }), params: (file: "row.ron", shift: 1.0), set: { "1/row": (add: 2.0) }),
    }, outputs: { "out": "r.to" })"#;
    let (mut run, mut refused) = (0, 0);
    for _ in 0..3000 {
        let (start, length) = (random.below(ROW.len() as u32) as usize, random.below(12) as usize);
        let end = (start + length).min(ROW.len());
        let word = words[random.below(words.len() as u32) as usize];
        let part = format!("{}{word}{}", &ROW[..start], &ROW[end..]);
        match read(outer, &[("row.ron", &part)])
            .and_then(|file| compile(&file, &registry, &settings).map(drop))
        {
            Ok(()) => run += 1,
            Err(problems) => {
                assert!(problems.0.iter().all(|problem| problem.place.is_some()), "{part}\n{problems}");
                refused += 1;
            }
        }
    }
    assert!(run > 10 && refused > 1000, "{run} run, {refused} are refused");
}
