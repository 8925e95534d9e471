//! Graphs that change another graph: what comes out of them, what is refused and where, and that a graph written out in
//! full computes the same. The stages compute single numbers on the CPU.

use std::{
    collections::{BTreeMap, BTreeSet},
    io,
    path::Path,
};

use epigraph_core::{
    CpuContext, Executor, Extent, Facts, Frame, GraphFile, Host, In, Io, Library, Origin, Out, Problems,
    Registry, Settings, Side, Stage, compile, params,
};

const ONE: Extent = Extent::Fixed([1, 1]);

params! {
    /// Parameters of [`Number`].
    pub struct NumberParams {
        /// The number.
        value: f32 = 1.0;
    }
}

struct Number(Out<f32>);

impl Stage for Number {
    const KIND: &'static str = "number";
    const DOC: &'static str = "Gives a number.";
    type Params = NumberParams;
    fn declare(_: &NumberParams, io: &mut Io) -> Self {
        Self(io.write("out", "The number.", ONE))
    }
    fn cpu(&self, params: &NumberParams, cx: &CpuContext) -> Result<(), String> {
        cx.write(self.0)[0] = params.value;
        Ok(())
    }
}

/// A stage with the ports `a`, `b` (which may stay unconnected) and `out`.
macro_rules! of_two {
    ($name:ident, $params:ident, $kind:literal, $parameter:ident, |$p:ident, $a:ident, $b:ident| $result:expr) => {
        params! {
            /// Parameters of a stage of the tests.
            pub struct $params {
                /// A number.
                $parameter: f32 = 2.0, in -100.0..=100.0;
            }
        }

        struct $name(In<f32>, Option<In<f32>>, Out<f32>);

        impl Stage for $name {
            const KIND: &'static str = $kind;
            const DOC: &'static str = "A stage of the tests.";
            type Params = $params;
            fn declare(_: &$params, io: &mut Io) -> Self {
                let (a, b) = (io.read("a", "A number.", ONE), io.optional("b", "Another number.", ONE));
                Self(a, b, io.write("out", "The result.", ONE))
            }
            fn cpu(&self, params: &$params, cx: &CpuContext) -> Result<(), String> {
                let ($p, $a, $b) =
                    (params.$parameter, cx.read(self.0)[0], self.1.map_or(0.0, |b| cx.read(b)[0]));
                cx.write(self.2)[0] = $result;
                Ok(())
            }
        }
    };
}

of_two!(Add, AddParams, "add", amount, |amount, a, b| a + b + amount);
of_two!(Scale, ScaleParams, "scale", factor, |factor, a, b| a * factor + 10.0 * b);

/// A stage that cannot take the place of `add` where all ports are in use.
struct Other(In<f32>, In<u32>, Out<f32>, Out<u32>);

impl Stage for Other {
    const KIND: &'static str = "other";
    const DOC: &'static str = "A stage of the tests with other ports.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        let (b, guide) = (io.read("b", "A number.", ONE), io.read("guide", "What to do.", ONE));
        Self(b, guide, io.write("result", "The result.", ONE), io.write("count", "How many.", ONE))
    }
    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        let (b, guide) = (cx.read(self.0)[0], cx.read(self.1)[0]);
        (cx.write(self.2)[0], cx.write(self.3)[0]) = (b, guide);
        Ok(())
    }
}

/// `add`, but with whole numbers.
struct Count(In<u32>, Out<u32>);

impl Stage for Count {
    const KIND: &'static str = "count";
    const DOC: &'static str = "A stage of the tests with other elements.";
    type Params = ();
    fn declare((): &(), io: &mut Io) -> Self {
        Self(io.read("a", "A number.", ONE), io.write("out", "The next one.", ONE))
    }
    fn cpu(&self, (): &(), cx: &CpuContext) -> Result<(), String> {
        cx.write(self.1)[0] = cx.read(self.0)[0] + 1;
        Ok(())
    }
}

fn registry() -> Registry {
    Registry::default().with::<Number>().with::<Add>().with::<Scale>().with::<Other>().with::<Count>()
}

/// Files of a test, and graphs that its program has.
#[derive(Default)]
struct Texts {
    files: BTreeMap<&'static str, String>,
    shipped: BTreeMap<&'static str, &'static str>,
}

impl Library for Texts {
    fn read(&self, path: &Path) -> io::Result<String> {
        let text = path.to_str().and_then(|path| self.files.get(path));
        text.cloned().ok_or_else(|| io::ErrorKind::NotFound.into())
    }
    fn shipped(&self, name: &str) -> Option<(String, String)> {
        let bare = name.strip_prefix("graphs/").unwrap_or(name);
        let bare = bare.strip_suffix(".ron").unwrap_or(bare);
        Some((format!("graphs/{bare}.ron"), (*self.shipped.get(bare)?).to_owned()))
    }
    fn names(&self) -> Vec<String> {
        self.shipped.keys().filter(|name| !name.contains('/')).map(|name| (*name).to_owned()).collect()
    }
}

/// One part, and a node that reads it: `out` is ((3 + 1) * 2 + 1) + 5 + 10 * 0 = 14.
const BASE: &str = r#"Graph(
    version: 1,
    doc: "The base.",
    nodes: {
        "three": (kind: "number", params: (value: 3.0)),
        "part": (kind: "graph", params: (file: "parts/part.ron"), set: { "two": (factor: 2.0) },
            inputs: { "x": "three.out", "y": "one.out" }),
        "one": (kind: "number"),
        "last": (kind: "add", inputs: { "a": "part.result", "b": "part/first.out" }, params: (amount: 1.0)),
    },
    outputs: { "image": "last.out" },
)"#;

/// (x + 1) * factor + 10 * y.
const PART: &str = r#"Graph(
    version: 1,
    nodes: {
        "first": (kind: "add", inputs: { "a": "inputs.x" }, params: (amount: 1.0)),
        "two": (kind: "scale", inputs: { "a": "first.out", "b": "inputs.y" }, params: (factor: 4.0)),
    },
    outputs: { "result": "two.out", "given": "inputs.x" },
)"#;

fn texts(change: &str) -> Texts {
    let shipped = BTreeMap::from([("base", BASE), ("parts/part", PART)]);
    Texts { files: BTreeMap::from([("change.ron", change.to_owned())]), shipped }
}

fn loaded(texts: &Texts) -> Result<GraphFile, Problems> {
    GraphFile::load_with(Path::new("change.ron"), texts)
}

/// What each output of a graph gives.
fn results(file: &GraphFile) -> Result<BTreeMap<String, f32>, Problems> {
    let settings = Settings::new([4, 4], 0, Facts::none());
    let (graph, plan) = compile(file, &registry(), &settings)?;
    let names: Vec<String> = graph.outputs.iter().map(|(name, _)| name.clone()).collect();
    let mut executor = Executor::new(graph, plan, &settings, &registry(), None).unwrap();
    executor.run(&Frame { size: [4, 4], ..Frame::default() }, &Host::default(), true).unwrap();
    let result = |name: String| {
        let value = executor.snapshot(&name, "").unwrap().unwrap().get::<f32>()[0];
        (name, value)
    };
    Ok(names.into_iter().map(result).collect())
}

/// A graph file with a base and these changes.
fn change(fields: &str) -> String {
    format!("Graph(version: 1, base: \"base\",\n{fields})")
}

#[track_caller]
fn image(fields: &str) -> f32 {
    let file = loaded(&texts(&change(fields))).unwrap_or_else(|problems| panic!("{problems}"));
    results(&file).unwrap_or_else(|problems| panic!("{problems}"))["image"]
}

#[test]
fn a_graph_without_changes_is_its_base() {
    // ((3 + 1) * 2 + 10 * 1) + (3 + 1) + 1.
    assert_eq!(image(""), 23.0);
    let file = loaded(&texts(&change(""))).unwrap();
    let whole = file.whole().unwrap();
    assert_eq!(whole.doc, "The base.");
    assert!(whole.base.is_none() && file.nodes.is_empty() && file.base.is_some());
}

#[test]
fn changes_of_every_kind_are_made() {
    for (fields, expected) in [
        // Another stage takes over the wires of the same ports: (4 * 2 + 10) * 3 + 10 * 4.
        (r#"replace: { "last": (kind: "scale", params: (factor: 3.0)) }"#, 94.0),
        // Its parameters are its own: the default of factor is 2.
        (r#"replace: { "last": (kind: "scale") }"#, 76.0),
        // Wires may be given with it.
        (r#"replace: { "last": (kind: "scale", inputs: { "b": "three.out" }) }"#, 66.0),
        // A node in a part, with its wires within the part, and without what the base sets there: (4 + 1 + 2) + 4 + 1.
        (r#"replace: { "part/two": (kind: "add") }"#, 12.0),
        // The same with a wire from outside: 4 + 3 + 2 + 4 + 1.
        (r#"replace: { "part/two": (kind: "add", inputs: { "b": "three.out" }) }"#, 14.0),
        // And one that the part did not have: 4 + 18 + 4 + 1.
        (
            r#"replace: { "part/two": (kind: "add", inputs: { "b": "twice.out" }, params: (amount: 0.0)) },
               nodes: { "twice": (kind: "scale", inputs: { "a": "three.out" }, params: (factor: 6.0)) }"#,
            27.0,
        ),
        // A wire from within the part: 4 + 4 + 2 + 4 + 1.
        (r#"replace: { "part/two": (kind: "add", inputs: { "b": "part/first.out" }) }"#, 15.0),
        // An added node between two others: (18 * 2) + 4 + 1.
        (
            r#"nodes: { "twice": (kind: "scale", inputs: { "a": "part.result" }) }, rewire: { "last.a": "twice.out" }"#,
            41.0,
        ),
        // A wire into a part, and one of a node in a part: ((1 + 1) * 2 + 10) + 2 + 1; ((3 + 1) * 2 + 10 * 3) + 4 + 1.
        (r#"rewire: { "part.x": "one.out" }"#, 17.0),
        (r#"rewire: { "part/two.b": "three.out" }"#, 43.0),
        (r#"rewire: { "part/two.b": "part.given" }"#, 43.0),
        (r#"rewire: { "part/first.b": "one.out" }"#, 26.0),
        // An added part, whose factor is 4: (18 + 1) * 4 + 10 * 3 + 4 + 1.
        (
            r#"nodes: { "more": (kind: "graph", params: (file: "parts/part.ron"), inputs: { "x": "part.result", "y": "three.out" }) },
               rewire: { "last.a": "more.result" }"#,
            111.0,
        ),
        // Optional inputs may be disconnected.
        (r#"rewire: { "last.b": None, "part/two.b": None }"#, 9.0),
        // Parameters, also where the base sets them for a node of its part.
        (r#"set: { "last": (amount: 100.0) }"#, 122.0),
        (r#"set: { "part/two": (factor: 3.0) }"#, 27.0),
        (r#"set: { "part/two": (factor: 3.0), "part/first": (amount: 2.0) }"#, 31.0),
        // Outputs.
        (r#"rewire: { "outputs.image": "three.out" }"#, 3.0),
        (r#"outputs: { "image": "part/first.out" }"#, 4.0),
    ] {
        assert_eq!(image(fields), expected, "{fields}");
    }
}

#[test]
fn outputs_are_added_beside_those_of_the_base() {
    let file = loaded(&texts(&change(r#"outputs: { "more": "part.given" }"#))).unwrap();
    assert_eq!(results(&file).unwrap(), BTreeMap::from([("image".into(), 23.0), ("more".into(), 3.0)]));
}

#[test]
fn a_part_is_replaced_by_another_file_or_by_a_stage() {
    let mut texts = texts(&change(r#"replace: { "part": (kind: "graph", params: (file: "mine.ron")) }"#));
    let mine = r#"Graph(version: 1, nodes: {
        "first": (kind: "scale", inputs: { "a": "inputs.x" }, params: (factor: 10.0)),
    }, outputs: { "result": "first.out" })"#;
    texts.files.insert("mine.ron", mine.into());
    assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], 61.0);
    // The other way round, and changes within a new part.
    let change = r#"Graph(version: 1, base: "base",
        replace: {
            "part/first": (kind: "add", params: (amount: 5.0)),
            "part": (kind: "graph", params: (file: "mine.ron")),
            "one": (kind: "graph", params: (file: "more.ron")),
        },
        nodes: { "new": (kind: "number", params: (value: 7.0)) },
        rewire: { "last.b": "new.out" },
    )"#;
    texts.files.insert("change.ron", change.into());
    let more = r#"Graph(version: 1, nodes: { "x": (kind: "number") }, outputs: { "out": "x.out" })"#;
    texts.files.insert("more.ron", more.into());
    assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], 8.0 + 7.0 + 1.0);
    let change =
        r#"Graph(version: 1, base: "base", replace: { "one": (kind: "number", params: (value: 2.0)) })"#;
    texts.files.insert("change.ron", change.into());
    assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], 33.0);
}

#[test]
fn a_new_node_knows_what_it_keeps_of_the_old_one() {
    let fields = r#"replace: {
        "part": (kind: "add", inputs: { "x": "one.out" }),
        "last": (kind: "scale"),
        "three": (kind: "number", params: (value: 2.0)),
        "one": (kind: "graph", params: (file: "parts/part.ron"), inputs: { "x": "three.out" }),
    }"#;
    let loaded = loaded(&texts(&change(fields))).unwrap_or_else(|problems| panic!("{problems}"));
    let whole = loaded.whole().unwrap();
    let kept = |name: &str| {
        let replaced = whole.node(name).unwrap().replaced.clone().unwrap();
        (replaced.what, replaced.kept.join(" "), replaced.dropped.join(" "), replaced.params.join(" "))
    };
    let expected = |[what, kept, dropped, params]: [&str; 4]| {
        (what.to_owned(), kept.to_owned(), dropped.to_owned(), params.to_owned())
    };
    // A part's file is what it is, and no parameter.
    assert_eq!(kept("part"), expected(["parts/part.ron", "y", "", ""]));
    assert_eq!(kept("last"), expected(["add", "a b", "", "amount"]));
    assert_eq!(kept("three"), expected(["number", "", "", ""]));
    assert_eq!(kept("one"), expected(["number", "", "", ""]));
    // In a part, whose node takes what it is not given.
    let fields = r#"replace: { "part/two": (kind: "graph", params: (file: "parts/part.ron")) }"#;
    let loaded = self::loaded(&texts(&change(fields))).unwrap_or_else(|problems| panic!("{problems}"));
    let whole = loaded.whole().unwrap();
    let replaced = whole.node_at("part/two").unwrap().0.replaced.clone().unwrap();
    assert_eq!(
        [&replaced.kept, &replaced.dropped, &replaced.params],
        [&vec![], &vec!["a", "b"], &vec!["factor"]]
    );
}

#[test]
fn a_base_may_have_a_base_and_so_may_a_part() {
    let outer = r#"Graph(version: 1, base: "inner.ron", set: { "last": (amount: 0.0) },
        rewire: { "new.b": "three.out" })"#;
    let mut texts = texts(outer);
    let inner = r#"Graph(version: 1, base: "base",
        nodes: { "new": (kind: "add", inputs: { "a": "one.out" }) },
        rewire: { "part/first.a": "new.out" },
        set: { "last": (amount: 50.0) },
    )"#;
    texts.files.insert("inner.ron", inner.into());
    // new = 1 + 3 + 2; ((6 + 1) * 2 + 10) + 7.
    assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], 31.0);

    let part = r#"Graph(version: 1, base: "parts/part", set: { "first": (amount: 2.0) },
        nodes: { "more": (kind: "add", inputs: { "a": "two.out", "b": "inputs.z" }) },
        outputs: { "result": "more.out" },
    )"#;
    texts.files.insert("part.ron", part.into());
    let change = r#"Graph(version: 1, base: "base",
        replace: { "part": (kind: "graph", params: (file: "part.ron"), inputs: { "z": "one.out" }) })"#;
    texts.files.insert("change.ron", change.into());
    // (3 + 2) * 4 + 10 + 1 + 2, + 5 + 1.
    assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], 39.0);
}

#[test]
fn parameters_of_graphs_reach_replaced_nodes_and_have_other_defaults() {
    let mut texts = texts("");
    let base = r#"Graph(version: 1,
        params: { "much": (default: 2.0, range: (0.0, 9.0)) },
        nodes: {
            "three": (kind: "number", params: (value: 3.0)),
            "part": (kind: "graph", params: (file: "parts/part.ron"), inputs: { "x": "three.out" }),
            "last": (kind: "add", inputs: { "a": "part.result" }, params: (amount: Param("much"))),
        },
        outputs: { "image": "last.out" },
    )"#;
    texts.files.insert("base.ron", base.into());
    for (fields, expected) in [
        ("", 18.0),
        (r#"params: { "much": (default: 3) }"#, 19.0),
        (r#"set: { "part/two": (factor: Param("much")) }"#, 10.0),
        (r#"replace: { "part/two": (kind: "scale", params: (factor: Param("much"))) }"#, 10.0),
        (
            r#"params: { "much": (default: 5.0), "more": (default: 100.0) },
               replace: { "part/two": (kind: "scale", params: (factor: Param("much"))) },
               set: { "last": (amount: Param("more")) }"#,
            120.0,
        ),
        // Given by the part: a node that is repeated stays so.
        (r#"set: { "part/two": (factor: 1.0) }"#, 6.0),
    ] {
        texts.files.insert("change.ron", format!("Graph(version: 1, base: \"base.ron\", {fields})"));
        let file = loaded(&texts).unwrap_or_else(|problems| panic!("{problems}"));
        let results = results(&file).unwrap_or_else(|problems| panic!("{fields}: {problems}"));
        assert_eq!(results["image"], expected, "{fields}");
    }
    // Two levels down, the value is that of the graph around.
    let inner = r#"Graph(version: 1, base: "base.ron",
        replace: { "part/two": (kind: "scale", params: (factor: Param("much"))) })"#;
    texts.files.insert("inner.ron", inner.into());
    let outer = r#"Graph(version: 1,
        nodes: { "inner": (kind: "graph", params: (file: "inner.ron", much: 4.0)) },
        outputs: { "image": "inner.image" },
    )"#;
    texts.files.insert("change.ron", outer.into());
    assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], 20.0);

    texts.files.insert(
        "change.ron",
        r#"Graph(version: 1, base: "base.ron", params: { "much": (default: 10.0) })"#.into(),
    );
    let text = compile(&loaded(&texts).unwrap(), &registry(), &Settings::new([4, 4], 0, Facts::none()))
        .err()
        .unwrap()
        .to_string();
    assert!(text.starts_with("change.ron:1:") && text.contains("`much` is 10.0, outside 0 to 9"), "{text}");
}

#[test]
fn a_change_gives_parameters_of_the_base_other_defaults_words_and_ranges() {
    let base = BASE.replacen(
        "nodes:",
        "params: { \"much\": (default: 2.0, range: (0.0, 9.0), doc: \"How much.\", unit: \"kg\") },\n    nodes:",
        1,
    );
    let mut texts = texts("");
    texts.files.insert("base.ron", base);
    let mut spec = |fields: &str| {
        texts.files.insert("change.ron", format!("Graph(version: 1, base: \"base.ron\", {fields})"));
        let file = loaded(&texts).unwrap();
        let whole = file.whole().unwrap();
        let spec = &whole.params[0].spec;
        (spec.default.clone(), spec.range, spec.doc.clone(), spec.unit.clone(), whole.doc.clone())
    };
    let all = |default: &str, range, doc: &str, unit: &str, of: &str| {
        (default.to_owned(), Some(range), doc.to_owned(), unit.to_owned(), of.to_owned())
    };
    assert_eq!(spec(""), all("2.0", (0.0, 9.0), "How much.", "kg", "The base."));
    assert_eq!(
        spec(r#"doc: "Changed.", params: { "much": (default: 3.0) }"#),
        all("3.0", (0.0, 9.0), "How much.", "kg", "Changed.")
    );
    assert_eq!(
        spec(r#"params: { "much": (default: 30.0, range: (1.0, 99.0), doc: "More.", unit: "g") }"#),
        all("30.0", (1.0, 99.0), "More.", "g", "The base.")
    );
}

#[test]
fn repeated_nodes_are_swapped_in_all_copies() {
    let mut texts = texts("");
    let base = r#"Graph(version: 1,
        nodes: {
            "three": (kind: "number", params: (value: 3.0)),
            "row": (kind: "add", repeat: (times: 3, through: { "a": "out" }), inputs: { "a": "three.out" }),
        },
        outputs: { "image": "row.out" },
    )"#;
    texts.files.insert("base.ron", base.into());
    for (fields, expected) in [
        ("", 9.0),
        (r#"replace: { "row": (kind: "scale") }"#, 24.0),
        (r#"set: { "row/1": (amount: 10.0) }"#, 17.0),
        (r#"replace: { "row": (kind: "scale") }, set: { "row/1": (factor: 1.0) }"#, 12.0),
        (r#"replace: { "row": (kind: "scale", repeat: (times: 1, through: { "a": "out" })) }"#, 6.0),
    ] {
        texts.files.insert("change.ron", format!("Graph(version: 1, base: \"base.ron\", {fields})"));
        let results =
            results(&loaded(&texts).unwrap()).unwrap_or_else(|problems| panic!("{fields}: {problems}"));
        assert_eq!(results["image"], expected, "{fields}");
    }
    let text = r#"Graph(version: 1, base: "base.ron", replace: { "row/1": (kind: "scale") })"#;
    texts.files.insert("change.ron", text.into());
    let text = loaded(&texts).unwrap().whole().unwrap_err().to_string();
    assert!(text.contains("`1` is one of a node's copies"), "{text}");
}

#[test]
fn a_new_wire_into_a_repeated_part_is_no_link_of_its_chain() {
    let mut texts = texts("");
    let part = r#"Graph(version: 1, nodes: {
        "sum": (kind: "add", inputs: { "a": "inputs.a" }),
        "twice": (kind: "add", inputs: { "a": "sum.out" }, params: (amount: 0.0)),
    }, outputs: { "out": "twice.out" })"#;
    let base = r#"Graph(version: 1, nodes: {
        "three": (kind: "number", params: (value: 3.0)),
        "row": (kind: "graph", params: (file: "part.ron"), repeat: (times: 3, through: { "a": "out" }),
            inputs: { "a": "three.out" }),
    }, outputs: { "image": "row.out" })"#;
    texts.files.extend([("part.ron", part.to_owned()), ("base.ron", base.to_owned())]);
    // Each copy adds 2, and 3 for each new wire, though the first copy's `a` comes from there, too.
    for (rewire, expected) in [
        ("", 9.0),
        (r#""row/sum.b": "three.out""#, 18.0),
        (r#""row/sum.b": "three.out", "row/twice.b": "three.out""#, 27.0),
    ] {
        texts
            .files
            .insert("change.ron", format!("Graph(version: 1, base: \"base.ron\", rewire: {{ {rewire} }})"));
        assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], expected, "{rewire}");
    }
}

/// What is reported of a graph with these changes.
#[track_caller]
fn refused(texts: &Texts) -> String {
    let settings = Settings::new([4, 4], 0, Facts::none());
    let result = loaded(texts).and_then(|file| compile(&file, &registry(), &settings).map(drop));
    result.expect_err("it is broken").to_string()
}

#[test]
fn mistakes_are_told_where_they_stand() {
    for (fields, wanted) in [
        (r#"replace: { "lst": (kind: "add") }"#, "change.ron:2:12: unknown node `lst`, did you mean `last`?"),
        (
            r#"replace: { "two": (kind: "add") }"#,
            "change.ron:2:12: unknown node `two`, did you mean `part/two`?",
        ),
        (
            r#"replace: { "last": (kind: "ad") }"#,
            "change.ron:2:27: node `last`: unknown stage kind `ad`, did you mean `add`?",
        ),
        (
            r#"replace: { "last": (kind: "add", params: (amoun: 3.0)) }"#,
            "change.ron:2:43: node `last`: unknown parameter `amoun`, did you mean `amount`?",
        ),
        (
            r#"replace: { "last": (kind: "add", inputs: { "c": "one.out" }) }"#,
            "change.ron:2:44: node `last`: unknown input `c`",
        ),
        (
            r#"replace: { "last": (kind: "add", inputs: { "b": "first.out" }) }"#,
            "change.ron:2:49: node `last`: unknown node `first`, did you mean `part/first`?",
        ),
        (
            r#"replace: { "part/two": (kind: "scale", inputs: { "b": "on.out" }) }"#,
            "change.ron:2:55: node `part/two`: unknown node `on`, did you mean `one`?",
        ),
        (
            r#"replace: { "part/two": (kind: "scale", inputs: { "b": "part.reslt" }) }"#,
            "change.ron:2:55: node `part`: unknown output of a part `reslt`, did you mean `result`?",
        ),
        (
            r#"replace: { "part": (kind: "graph", params: (file: "nothing.ron")) }"#,
            "change.ron:2:51: node `part`: cannot read: nothing.ron: entity not found; the path starts at the folder of \
             the graph file, and graphs that come with the program are base",
        ),
        (
            r#"nodes: { "last": (kind: "add") }"#,
            "change.ron:2:10: node `last`: the base has a node `last` already; put this one into `replace`",
        ),
        (r#"rewire: { "last.c": "one.out" }"#, "change.ron:2:11: node `last`: unknown input `c`"),
        (
            r#"rewire: { "first.a": "one.out" }"#,
            "change.ron:2:11: unknown node `first`, did you mean `part/first`?",
        ),
        (r#"rewire: { "last": "one.out" }"#, "change.ron:2:11: `last` is not a port; write \"NODE.PORT\""),
        (r#"rewire: { "last.a": 3 }"#, "change.ron:2:21: expected a port as \"NODE.PORT\", found `3`"),
        (
            r#"rewire: { "last.a": "ones.out" }"#,
            "change.ron:2:21: node `last`: unknown node `ones`, did you mean `one`?",
        ),
        (
            r#"rewire: { "part/first.a": "one.ou" }"#,
            "change.ron:2:27: node `part/first`: unknown output port `ou`, did you mean `out`?",
        ),
        (
            r#"rewire: { "part/first.b": None }"#,
            "change.ron:2:11: node `first`: unknown connected input `b`, did you mean `a`?",
        ),
        (
            r#"rewire: { "last.a": None }"#,
            "change.ron:2:11: node `last`: input `a` (A number.) is not connected",
        ),
        (
            r#"rewire: { "outputs.imag": "one.out" }"#,
            "change.ron:2:11: unknown output of the base `imag`, did you mean `image`?",
        ),
        (
            r#"rewire: { "outputs.image": None }"#,
            "change.ron:2:28: the output `image` cannot be disconnected",
        ),
        (r#"set: { "two": (factor: 3.0) }"#, "change.ron:2:8: unknown node `two`, did you mean `part/two`?"),
        (
            r#"set: { "part/tow": (factor: 3.0) }"#,
            "change.ron:2:8: node `part`: unknown node `tow`, did you mean `two`?",
        ),
        (
            r#"set: { "part/two": (factr: 3.0) }"#,
            "change.ron:2:21: node `part/two`: unknown parameter `factr`, did you mean `factor`?",
        ),
        (
            r#"set: { "last": (amount: 1000.0) }"#,
            "change.ron:2:25: node `last`: parameter `amount` is 1000.0, outside -100 to 100",
        ),
        (
            r#"set: { "part": (file: "mine.ron") }"#,
            "change.ron:2:17: node `part`: the file of a part is changed by replace: { \"part\": (kind: \"graph\", params: \
             (file: \"mine.ron\")) }",
        ),
        (
            r#"set: { "part": (bogus: 3) }"#,
            "change.ron:2:17: node `part`: graphs/parts/part.ron has no parameter `bogus`, nor any other; its nodes are: \
             part/first, part/two",
        ),
        (
            r#"outputs: { "more": "part.rsult" }"#,
            "change.ron:2:20: unknown output of a part `rsult`, did you mean `result`?",
        ),
    ] {
        let text = refused(&texts(&change(fields)));
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
    let text = refused(&texts(&change(r#"set: { "part": (file: "mine.ron") }"#)));
    assert!(text.ends_with(" ^^^^"), "the name is marked: {text}");
    for (text, wanted) in [
        (r#"Graph(version: 1, base: "bas")"#, "change.ron:1:25: cannot read: bas: "),
        (
            r#"Graph(version: 1, base: 3)"#,
            "change.ron:1:25: expected the name of a graph, or a path, in double quotes",
        ),
        (r#"Graph(version: 1, base: "change.ron")"#, "change.ron:1:25: change.ron contains itself"),
        (
            r#"Graph(version: 1, nodes: {}, outputs: {}, set: {})"#,
            "change.ron:1:43: `set` changes another graph; name it: write base: \"GRAPH\"",
        ),
        (r#"Graph(version: 1, base: "base", replac: {})"#, "unknown field `replac`, did you mean `replace`?"),
    ] {
        let text = refused(&texts(text));
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
}

#[test]
fn ports_that_differ_are_told_at_once() {
    let text = refused(&texts(&change(r#"replace: { "last": (kind: "other") }"#)));
    let wanted = "change.ron:2:27: node `last`: other cannot take the place of add, as their ports differ:
  the input `guide` (array<u32>: What to do) is new and not connected
  the output `out` is missing: the graph's output `image` is connected to it
  the input `a` is not taken any more
  connect inputs anew by rewire: { \"NODE.PORT\": \"NODE.PORT\" } in a graph file, or by --wire NODE.PORT=NODE.PORT
";
    assert!(text.starts_with(wanted), "{text}");
    let text = refused(&texts(&change(r#"replace: { "part/first": (kind: "other") }"#)));
    for wanted in [
        "change.ron:2:33: node `part/first`: other cannot",
        "the output `out` is missing: `part/two.a` takes it as array<f32>",
        "the output `out` is missing: `last.b` takes it as array<f32>",
    ] {
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
    let text = refused(&texts(&change(r#"replace: { "part/first": (kind: "count") }"#)));
    for wanted in [
        "the input `a` takes array<u32>, but `three.out` gives array<f32>",
        "the output `out` gives array<u32>, but `last.b` takes array<f32>",
    ] {
        assert!(text.contains(wanted), "{wanted}\nnot in\n{text}");
    }
    // One that is connected, and whose readers take another output, fits.
    let fields = r#"replace: { "part/first": (kind: "other", inputs: { "b": "three.out", "guide": "c.out" }) },
        nodes: { "c": (kind: "count", inputs: { "a": "part/first.count" }) },
        rewire: { "part/two.a": "part/first.result", "last.b": None }"#;
    let text = refused(&texts(&change(fields)));
    assert!(
        text.starts_with("change.ron:2:79: node `part/first`: these nodes wait for each other"),
        "{text}"
    );
}

#[test]
fn ports_of_parts_that_differ_are_told_at_once() {
    let mut texts = texts(&change(r#"replace: { "part": (kind: "graph", params: (file: "mine.ron")) }"#));
    let mine = r#"Graph(version: 1, nodes: {
        "inner": (kind: "add", inputs: { "a": "inputs.z", "b": "inputs.y" }),
    }, outputs: { "reslt": "inner.out" })"#;
    texts.files.insert("mine.ron", mine.into());
    let text = refused(&texts);
    let wanted = "change.ron:2:27: node `part`: mine.ron cannot take the place of parts/part.ron, as their ports differ:
  the input `z` (array<f32>: A number) is new and not connected
  the output `first.out` is missing: `last.b` takes it as array<f32>
  the output `result` is missing: `last.a` takes it as array<f32>
  the input `x` is not taken any more
  connect inputs anew by";
    assert!(text.starts_with(wanted), "{text}");
}

#[test]
fn a_new_node_runs_where_the_old_one_did_if_it_can() {
    let base =
        BASE.replace(r#""last": (kind: "add","#, r#""last": (kind: "add", on: Cpu, download: Latent(2),"#);
    let mut texts = texts("");
    texts.files.insert("base.ron", base);
    let mut side = |fields: &str| {
        texts.files.insert("change.ron", format!("Graph(version: 1, base: \"base.ron\", {fields})"));
        let settings = Settings { side: Side::Gpu, ..Settings::new([4, 4], 0, Facts::none()) };
        let compiled = compile(&loaded(&texts).unwrap(), &registry(), &settings);
        let (graph, _) = compiled.unwrap_or_else(|problems| panic!("{problems}"));
        let node = &graph.nodes[graph.node("last").unwrap()];
        (node.side, node.download)
    };
    let latent = epigraph_core::Download::Latent;
    assert_eq!(side(r#"replace: { "last": (kind: "scale") }"#), (Side::Cpu, latent(2)));
    assert_eq!(side(r#"replace: { "last": (kind: "scale", download: Latent(3)) }"#), (Side::Cpu, latent(3)));
}

#[test]
fn what_an_option_changes_is_told_by_its_text() {
    let base = loaded(&texts(BASE)).unwrap();
    let option = |option: &str, fields: &str| {
        let file = GraphFile::changed(&base, option, fields, &Texts::default());
        file.and_then(|file| compile(&file, &registry(), &Settings::new([4, 4], 0, Facts::none())).map(drop))
            .unwrap_err()
            .to_string()
    };
    let text = option("--swap lst=add", r#"replace: { "lst": (kind: "add") }"#);
    assert_eq!(text, "--swap lst=add: unknown node `lst`, did you mean `last`?");
    let text = option("--swap last=ad", r#"replace: { "last": (kind: "ad") }"#);
    assert_eq!(text, "--swap last=ad: node `last`: unknown stage kind `ad`, did you mean `add`?");
    let text =
        option("--swap part=a/b.ron", r#"replace: { "part": (kind: "graph", params: (file: "a/b.ron")) }"#);
    let wanted = "--swap part=a/b.ron: node `part`: cannot read: a/b.ron: entity not found; the path starts at the current \
                  folder";
    assert_eq!(text, wanted);
    let file = GraphFile::changed(
        &base,
        "--set last.amount=0.0",
        r#"set: { "last": (amount: 0.0) }"#,
        &Texts::default(),
    );
    let file = file.unwrap();
    assert_eq!((file.origin, file.name().as_str()), (Origin::Option, "change.ron --set last.amount=0.0"));
    assert_eq!(results(&file).unwrap()["image"], 22.0);
}

#[test]
fn an_option_sets_a_parameter_of_a_node_or_of_the_graph() {
    let mut texts = texts("");
    let base = BASE.replace("amount: 1.0", "amount: Param(\"much\")");
    texts.files.insert(
        "change.ron",
        base.replacen("nodes:", "params: { \"much\": (default: 1.0) },\n    nodes:", 1),
    );
    let base = loaded(&texts).unwrap();
    let set = |file: &GraphFile, node: &str, param: &str, value: &str| {
        file.with_param(&format!("--set {node}.{param}"), node, param, value)
    };
    let image = |file: Result<GraphFile, Problems>| results(&file.unwrap()).unwrap()["image"];
    assert_eq!(image(Ok(base.clone())), 23.0);
    assert_eq!(image(set(&base, "last", "amount", "0.0")), 22.0);
    assert_eq!(image(set(&base, "part/first", "amount", "2.0")), 26.0);
    let more = set(&base, "", "much", "5.0").unwrap();
    assert_eq!(image(Ok(more.clone())), 27.0);
    assert_eq!(image(set(&more, "part/two", "factor", "1.0")), 23.0);
    assert_eq!((more.origin, more.name().as_str()), (Origin::Option, "change.ron --set .much"));
    let told = |file: Result<GraphFile, Problems>| {
        file.and_then(|file| results(&file)).expect_err("it is broken").to_string()
    };
    for (node, param, value, wanted) in [
        ("last", "a b", "1.0", "--set last.a b: `a b` cannot name a parameter"),
        ("", "a-b", "1.0", "--set .a-b: `a-b` cannot name a parameter"),
        ("", "mch", "1.0", "--set .mch: unknown parameter of the graph `mch`, did you mean `much`?"),
        ("last", "amount", "(", "--set last.amount: "),
        ("", "much", "1, 2", "--set .much: "),
        ("lst", "amount", "1.0", "--set lst.amount: unknown node `lst`, did you mean `last`?"),
        ("last", "amoun", "1.0", "--set last.amoun: node `last`: unknown parameter `amoun`"),
        ("", "much", "true", "--set .much: "),
    ] {
        let text = told(set(&base, node, param, value));
        assert!(text.starts_with(wanted), "{wanted}\nis not\n{text}");
    }
    // The stage refuses it, at the option that gave it, whatever came after.
    let text = told(set(&set(&base, "", "much", "900.0").unwrap(), "one", "value", "2.0"));
    assert!(text.starts_with("--set .much: "), "{text}");
    let text = GraphFile::changed(&base, "--swap last=", "replace: {", &texts).unwrap_err().to_string();
    assert!(text.starts_with("--swap last=: ") && !text.contains('^'), "{text}");
}

#[test]
fn graphs_of_the_program_are_found_by_name_unless_there_is_such_a_file() {
    let mut texts = texts(
        r#"Graph(version: 1, nodes: { "b": (kind: "graph", params: (file: "base")) }, outputs: { "image": "b.image" })"#,
    );
    assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], 23.0);
    let file = loaded(&texts).unwrap();
    let base = &file.parts[0].1;
    assert_eq!((base.path.as_str(), base.origin), ("graphs/base.ron", Origin::Shipped));
    let mut edited = base.clone();
    edited.set_param("three", "value", "4.0").unwrap();
    assert_eq!((edited.path.as_str(), edited.origin), ("graphs/base.ron", Origin::Shipped));
    assert_eq!(
        (base.parts[0].1.path.as_str(), base.parts[0].1.origin),
        ("graphs/parts/part.ron", Origin::Shipped)
    );
    for name in ["base.ron", "graphs/base.ron"] {
        texts.files.insert("change.ron", format!("Graph(version: 1, base: \"{name}\")"));
        assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], 23.0, "{name}");
    }
    // A file wins, and what is beside it.
    let own = BASE.replace("3.0", "4.0").replace("parts/part.ron", "mine.ron");
    texts.files.insert("base.ron", own);
    texts.files.insert("mine.ron", PART.replace("amount: 1.0", "amount: 0.0"));
    assert_eq!(results(&loaded(&texts).unwrap()).unwrap()["image"], 23.0);
    texts.files.insert("change.ron", r#"Graph(version: 1, base: "base")"#.into());
    assert_eq!(loaded(&texts).unwrap().base.unwrap().graph.unwrap().origin, Origin::Shipped);
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

/// Random fields of a change. Most of them fit the base.
fn random_change(random: &mut Random) -> String {
    const NODES: [&str; 6] = ["three", "part/first", "part/two", "one", "last", "new"];
    const SOURCES: [&str; 7] =
        ["three.out", "one.out", "part/first.out", "part/two.out", "part.result", "part.given", "new.out"];
    let number = |random: &mut Random| format!("{}.{}", random.below(9), random.below(9));
    let mut fields = BTreeMap::<&str, BTreeMap<String, String>>::new();
    for _ in 0..1 + random.below(4) {
        let mut put =
            |field, key: &str, value: String| fields.entry(field).or_default().insert(key.to_owned(), value);
        match random.below(6) {
            0 => {
                let (kind, param) = [("add", "amount"), ("scale", "factor")][random.below(2)];
                let value = number(random);
                let wires = match random.below(2) {
                    0 => String::new(),
                    _ => format!("inputs: {{ \"a\": \"{}\" }}, ", random.pick(&SOURCES)),
                };
                let value = format!("(kind: \"{kind}\", {wires}params: ({param}: {value}))");
                put("replace", random.pick(&["part/first", "part/two", "last"]), value);
            }
            1 => {
                let value = format!("(kind: \"number\", params: (value: {}))", number(random));
                put("replace", random.pick(&["three", "one"]), value);
            }
            2 => {
                let value =
                    format!("(kind: \"add\", inputs: {{ \"a\": \"{}\" }})", random.pick(&SOURCES[..6]));
                put("nodes", "new", value);
            }
            3 => {
                let to = format!("{}.{}", random.pick(&NODES), random.pick(&["a", "b"]));
                let from = match random.below(6) {
                    0 => "None".to_owned(),
                    _ => format!("\"{}\"", random.pick(&SOURCES)),
                };
                put("rewire", &to, from);
            }
            4 => {
                let (node, param) = [
                    ("three", "value"),
                    ("part/first", "amount"),
                    ("part/two", "factor"),
                    ("last", "amount"),
                ][random.below(4)];
                let value = format!("({param}: {})", number(random));
                put("set", node, value);
            }
            _ => drop(put(
                "outputs",
                random.pick(&["image", "more"]),
                format!("\"{}\"", random.pick(&SOURCES)),
            )),
        };
    }
    let fields = fields.into_iter().map(|(field, items)| {
        let items: Vec<String> =
            items.into_iter().map(|(key, value)| format!("\"{key}\": {value}")).collect();
        format!("{field}: {{ {} }}", items.join(", "))
    });
    fields.collect::<Vec<_>>().join(",\n")
}

#[test]
fn a_changed_graph_written_out_in_full_computes_the_same() {
    let mut random = Random(1);
    let (mut same, mut refused) = (0, 0);
    for step in 0..3000 {
        let fields = random_change(&mut random);
        let texts = texts(&change(&fields));
        let file = loaded(&texts).unwrap_or_else(|problems| panic!("{fields}\n{problems}"));
        match results(&file) {
            Ok(expected) => {
                let text =
                    file.full(&registry(), Path::new("full.ron")).unwrap_or_else(|p| panic!("{fields}\n{p}"));
                let full = GraphFile::parse("full.ron", &text).unwrap_or_else(|p| panic!("{text}\n{p}"));
                assert!(full.parts.is_empty() && full.base.is_none());
                assert_eq!(results(&full).unwrap(), expected, "step {step}:\n{fields}\n{text}");
                // Written out again, it is the same.
                assert_eq!(
                    full.full(&registry(), Path::new("full.ron"))
                        .unwrap()
                        .lines()
                        .skip(1)
                        .collect::<Vec<_>>(),
                    text.lines().skip(1).collect::<Vec<_>>()
                );
                same += 1;
            }
            Err(problems) => {
                // Whatever is wrong with a change is told in its file.
                for problem in &problems.0 {
                    assert!(problem.place.is_some(), "{fields}\n{problem}");
                }
                refused += 1;
            }
        }
    }
    assert!(same > 1000 && refused > 300, "{same} the same, {refused} refused");
}

/// Nodes, wires and parameters with everything that they can have, in two files.
#[test]
fn everything_in_a_changed_graph_keeps_its_file_and_place() {
    let nodes = |name: &str| {
        format!(
            r#""{name}": (kind: "scale", repeat: (times: 3, through: {{ "a": "out", "b": "out" }}, count: "factor"),
            on: Cpu, download: Sync, inputs: {{ "a": "three.out", "b": "part.given" }}, params: (factor: 0.5),
            set: {{ "1": (factor: 7.0), "2": () }}),"#
        )
    };
    let base = BASE.replace("\"three\":", &format!("{}\n\"three\":", nodes("row")));
    let fields = format!(
        r#"params: {{ "p": (default: 2.5) }}, nodes: {{ {} "taker": (kind: "number", params: (value: Param("p"))) }},
        replace: {{ {} "part": (kind: "graph", params: (file: "parts/part.ron"), set: {{ "two": (factor: 1.0) }}) }},
        rewire: {{ "last.b": None, "last.a": "new.out", "outputs.image": "taker.out" }},
        set: {{ "three": (value: 4.0), "part/first": (amount: 8.0) }}, outputs: {{ "more": "last.out" }}"#,
        nodes("new"),
        nodes("row")
    );
    let mut texts = texts(&change(&fields).replace("base: \"base\"", "base: \"base.ron\""));
    texts.files.insert("base.ron", format!("#![enable(implicit_some)]\n{base}"));
    let file = texts.files.get_mut("change.ron").unwrap();
    *file = format!("#![enable(implicit_some)] {file}");
    let loaded = loaded(&texts).unwrap_or_else(|problems| panic!("{problems}"));
    let whole = loaded.whole().unwrap_or_else(|problems| panic!("{problems}"));
    let mut seen = BTreeMap::new();
    // The text at a place, as far as it is on the place's first line.
    let mut check = |span, expected: &str| {
        let place = whole.place(span);
        let text = &texts.files[&*place.file];
        let line = text.lines().nth(place.line - 1).unwrap();
        let found: String = line.chars().skip(place.column - 1).take(place.length).collect();
        assert_eq!(found, expected, "{}:{}:{}", place.file, place.line, place.column);
        *seen.entry(place.file).or_insert(0) += 1;
    };
    let quoted = |text: &str| format!("{text:?}");
    for node in &whole.nodes {
        check(node.name.span, &quoted(&node.name.value));
        check(node.kind.span, &quoted(&node.kind.value));
        node.on.iter().for_each(|on| check(on.span, &format!("{:?}", on.value)));
        node.download.iter().for_each(|download| check(download.span, &format!("{:?}", download.value)));
        for input in &node.inputs {
            // `rewire` names the node too.
            let is_rewired = node.name.value == "last";
            let port = if is_rewired { "last.a" } else { &input.port.value };
            check(input.port.span, &quoted(port));
            check(input.from.span, &quoted(&input.from.value.to_string()));
        }
        if let Some(repeat) = &node.repeat {
            check(repeat.times.span, &repeat.times.value);
            repeat.count.iter().for_each(|count| check(count.span, &quoted(&count.value)));
            for (input, output) in &repeat.through {
                check(input.span, &quoted(&input.value));
                check(output.span, &quoted(&output.value));
            }
        }
        let names: BTreeSet<&str> = node.params.iter().map(|param| param.name.value.as_str()).collect();
        assert_eq!(names.len(), node.params.len(), "a parameter of `{}` is there twice", node.name.value);
        let set = node.set.iter().flat_map(|(_, params)| params);
        for param in node.params.iter().chain(set) {
            check(param.name.span, &param.name.value);
            check(param.value.span, &param.value.value);
        }
        // Set in the change for a node of a part, or where the part is included.
        for (address, _) in &node.set {
            let place = whole.place(address.span);
            let name = if place.text.contains("\"part/first\"") { "part/first" } else { &address.value };
            check(address.span, &quoted(name));
        }
        node.cut.iter().for_each(|cut| check(cut.span, "\"last.b\""));
    }
    for output in &whole.outputs {
        check(output.from.span, &quoted(&output.from.value.to_string()));
    }
    for param in &whole.params {
        check(param.name.span, &quoted(&param.name.value));
        check(param.default.span, &param.default.value);
    }
    assert_eq!(whole.node("last").unwrap().cut.len(), 1);
    assert!(seen["base.ron"] >= 10 && seen["change.ron"] >= 40, "{seen:?}");
}

#[test]
fn files_of_the_same_text_are_told_apart() {
    // Each changes the one in the next folder, the last one the base.
    let mut texts = texts("");
    let text = r#"Graph(version: 1, base: "next/change.ron", set: { "three": (value: 7.0) })"#;
    let paths = ["change.ron", "next/change.ron", "next/next/change.ron"];
    paths.into_iter().for_each(|path| drop(texts.files.insert(path, text.into())));
    texts.files.insert("next/next/next/change.ron", BASE.into());
    texts.files.insert("next/next/next/parts/part.ron", PART.into());
    let loaded = loaded(&texts).unwrap_or_else(|problems| panic!("{problems}"));
    let whole = loaded.whole().unwrap();
    let [param] = &whole.node("three").unwrap().params[..] else { panic!("one parameter") };
    // The outermost counts.
    let place = whole.place(param.value.span);
    assert_eq!((place.file.as_str(), place.line, place.column), ("change.ron", 1, 68));
}

#[test]
fn garbage_in_a_change_is_refused_without_a_panic() {
    let whole = change(
        r#"params: { "p": (default: 1.0) },
        replace: { "part/two": (kind: "scale", on: Cpu, inputs: { "b": "new.out" }, params: (factor: Param("p"))) },
        nodes: { "new": (kind: "add", inputs: { "a": "part.given" }) },
        rewire: { "last.a": "new.out", "last.b": None, "outputs.image": "last.out" },
        set: { "part/first": (amount: 3.0) },
        outputs: { "more": "part/two.out" },"#,
    );
    loaded(&texts(&whole)).and_then(|file| results(&file)).unwrap_or_else(|problems| panic!("{problems}"));
    let alphabet: Vec<char> = "()[]{}:,\"/.rN 1-\nabtwo".chars().collect();
    let mut random = Random(3);
    let (mut refused, mut ran) = (0, 0);
    for _ in 0..4000 {
        let at = random.below(whole.len());
        let skip = random.below(6).min(whole.len() - at);
        let noise: String = (0..random.below(4)).map(|_| alphabet[random.below(alphabet.len())]).collect();
        let text = format!("{}{noise}{}", &whole[..at], &whole[at + skip..]);
        let result = loaded(&texts(&text)).and_then(|mut file| {
            let result = results(&file);
            // Edits fail or give a file that is read again.
            let source = "one.out".parse().unwrap();
            let _ = file.set_param("part/two", "factor", "2.0");
            let _ = file.set_input("last", "b", Some(&source));
            let _ = file.set_bypass("part/first", true);
            let _ = file.rename_node("new", "other");
            let _ = file.remove_node("other");
            assert!(GraphFile::parse("change.ron", &file.text).is_ok(), "{}", file.text);
            result
        });
        match result {
            Ok(_) => ran += 1,
            Err(problems) => {
                assert!(!problems.to_string().is_empty());
                refused += 1;
            }
        }
    }
    assert!(refused > 1500 && ran > 300, "{refused} refused, {ran} ran");
}

#[test]
fn flat_names_do_not_meet_those_of_parts() {
    let text = r#"Graph(version: 1, nodes: {
        "part": (kind: "graph", params: (file: "parts/part"), inputs: { "x": "part/one.out", "y": "part/one.out" }),
        "part/one": (kind: "number"),
        "part/two": (kind: "number"),
    }, outputs: { "image": "part.result" })"#;
    let text = refused(&texts(text));
    assert!(text.contains("change.ron:4:9: duplicate node `part/two`"), "{text}");
}

#[test]
fn a_graph_in_full_has_the_wires_that_a_new_node_takes() {
    for (kind, inputs) in [
        ("number", ""),
        ("count", "            inputs: {\n                \"a\": \"part/two.out\",\n            },\n"),
    ] {
        let file = loaded(&texts(&change(&format!("replace: {{ \"last\": (kind: \"{kind}\") }}")))).unwrap();
        let full = file.full(&registry(), Path::new("full.ron")).unwrap();
        let node = format!("        \"last\": (\n            kind: \"{kind}\",\n{inputs}        ),\n");
        assert!(full.contains(&node), "{node}\nis not in\n{full}");
    }
}

#[test]
fn a_graph_in_full_reads_well() {
    let file = loaded(&texts(&change(
        r#"replace: { "part/two": (kind: "add", on: Cpu, bypass: true, inputs: { "b": "one.out" }) }"#,
    )));
    let text = file.unwrap().full(&registry(), Path::new("full.ron")).unwrap();
    let expected = r#"// change.ron in full.
Graph(
    version: 1,
    doc: "The base.",
    nodes: {
        "three": (
            kind: "number",
            params: (value: 3.0),
        ),
        "part/first": (
            kind: "add",
            inputs: {
                "a": "three.out",
            },
            params: (amount: 1.0),
        ),
        "part/two": (
            kind: "add",
            on: Cpu,
            bypass: true,
            inputs: {
                "b": "one.out",
                "a": "part/first.out",
            },
        ),
        "one": (
            kind: "number",
        ),
        "last": (
            kind: "add",
            inputs: {
                "a": "part/two.out",
                "b": "part/first.out",
            },
            params: (amount: 1.0),
        ),
    },
    outputs: {
        "image": "last.out",
    },
)
"#;
    assert_eq!(text, expected);
}
