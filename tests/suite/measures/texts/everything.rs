//! Graph files that use everything that such a file can have: what they become, and messages about damage to them.

use std::{collections::BTreeMap, io, path::Path, sync::Arc};

use epigraph_core::{
    EditedTexts, Facts, GraphFile, Library, Problems, Registry, Settings, Side, compile, wgsl_kind,
};

use super::{
    DAMAGES, damaged, tokens,
    zoo::{self, SHEETS},
};
use crate::measures::{Figures, assert_same};

/// Changes the graph `middle`, which the program has.
const TOP: &str = r#"#![enable(implicit_some)]
Graph(
    version: 1,
    doc: "On top.",
    base: "middle",
    params: {
        "weight": (default: 1.5, doc: "More of it."),
        "more": (default: 3, range: (1, 8), unit: "levels"),
    },
    replace: {
        "row/inner/mark": (kind: "graph", params: (file: "parts/marks.ron", level: Param("more"))),
        "show": (kind: "mix", params: (weight: Param("weight"))),
        "inner": (kind: "graph", params: (file: "parts/inner.ron", times: 3, shift: 0),
            set: { "blend/1": (loud: true) }),
    },
    nodes: {
        "last": (kind: "mix", inputs: { "a": "row/inner/blend/0.out", "b": "inner.out" },
            params: (level: Param("more"))),
        "shade": (kind: "wgsl", inputs: { "list": "last.out" }, params: (shader: "shade.wgsl", bright: 0.75), on: Gpu),
    },
    rewire: {
        "show.b": "shade.done",
        "inner.guide": "source.far",
        "row/inner/blend.b": None,
        "outputs.bits": "row.bits",
    },
    set: { "row/inner/blend": (weight: 0.125), "row/inner": (shift: 4), "row/0/inner/blend/1": (way: Down) },
    outputs: { "last": "shade.done" },
)
"#;

/// A whole graph. It includes one part alone, and one with it in a row.
const MIDDLE: &str = r#"#![enable(implicit_some)] Graph(version: 1, params: {
    "weight": (default: 0.25, range: (0.0, 2.0)), "copies": (default: 2),
}, nodes: {
    "source": (kind: "source"),
    "inner": (kind: "graph", on: Gpu, params: (file: "parts/inner.ron", weight: Param("weight"), times: 2),
        inputs: { "a": "source.out" }, set: { "blend": (shift: 2), "blend/1": (way: Up) }),
    "row": (kind: "graph", repeat: (times: Param("copies"), through: { "a": "out" }), params: (file: "parts/row.ron"),
        inputs: { "a": "inner.out", "more": "source.far" },
        set: { "1/inner/blend/0": (loud: false), "inner": (times: 4) }),
    "show": (kind: "mix", inputs: { "a": "row.out" }, on: Cpu, download: Latent(2)),
    "spare": (kind: "filter", inputs: { "a": "row.out" }, bypass: true),
    "after": (kind: "filter", inputs: { "a": "spare.out" }, bypass: false),
}, outputs: { "image": "show.out", "bits": "inner.bits", "after": "after.out" })
"#;

const INNER: &str = r#"Graph(version: 1, doc: "An inner part.", params: {
    "weight": (default: 0.5, doc: "How much.", range: (0.0, 2.0), unit: "kg"),
    "way": (default: Down, choices: [Up, Down]), "times": (default: 2, range: (1, 4)), "shift": (default: -1),
    "loud": (default: false),
}, nodes: {
    "blend": (kind: "mix", repeat: (times: Param("times"), through: { "a": "out" }, count: "level"),
        inputs: { "a": "inputs.a", "b": "inputs.guide" },
        params: (weight: Param("weight"), way: Param("way"), shift: Param("shift"), loud: Param("loud"))),
    "mark": (kind: "mark", inputs: { "a": "blend.out" }),
    "pick": (kind: "pick", inputs: { "a": "blend.out", "bits": "mark.bits" }, on: Cpu),
}, outputs: { "out": "blend.out", "bits": "mark.bits", "picked": "pick.out", "same": "inputs.a" })
"#;

const ROW: &str = r#"Graph(version: 1, nodes: {
    "inner": (kind: "graph", params: (file: "inner.ron"), inputs: { "a": "inputs.a", "guide": "inputs.more" }),
    "filter": (kind: "filter", inputs: { "a": "inner.same" }, download: Sync),
}, outputs: { "out": "inner.out", "bits": "inner.bits", "smooth": "filter.out" })
"#;

const MARKS: &str = r#"Graph(version: 1, params: { "level": (default: 7, range: (0, 99)) }, nodes: {
    "mix": (kind: "mix", inputs: { "a": "inputs.a" }, params: (level: Param("level"))),
    "mark": (kind: "mark", inputs: { "a": "mix.out" }),
}, outputs: { "bits": "mark.bits" })
"#;

const SHADE: &str = "/// Brighter.
struct Params {
    /// How bright.
    /// = 0.5 in 0..1
    bright: f32,
}
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> list: array<f32>;
/// = output, like list
@group(0) @binding(2) var<storage, read_write> done: array<f32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&done) { done[id.x] = params.bright * list[id.x]; }
}
";

/// Files by path, and the graphs that come with the program.
struct Texts(BTreeMap<&'static str, String>);

impl Library for Texts {
    fn read(&self, path: &Path) -> io::Result<String> {
        let known = self.0.get(&*path.to_string_lossy()).filter(|_| path != Path::new("middle.ron"));
        known.cloned().ok_or(io::ErrorKind::NotFound.into())
    }
    fn shipped(&self, name: &str) -> Option<(String, String)> {
        let path = if name == "middle" { "middle.ron" } else { name };
        Some((path.to_owned(), self.0.get(path)?.clone()))
    }
    fn names(&self) -> Vec<String> {
        vec!["middle".into()]
    }
}

fn texts() -> Texts {
    let texts = [
        ("top.ron", TOP),
        ("middle.ron", MIDDLE),
        ("parts/inner.ron", INNER),
        ("parts/row.ron", ROW),
        ("parts/marks.ron", MARKS),
    ];
    Texts(texts.map(|(path, text)| (path, text.to_owned())).into())
}

/// The kinds that the graphs use.
pub fn registry() -> Registry {
    let edited = |path: &Path| (path == Path::new("shade.wgsl")).then(|| Arc::from(SHADE));
    zoo::registry().with_kind(wgsl_kind()).with_edited(EditedTexts::new(edited))
}

/// The graphs with their parts and bases, by name.
pub fn files() -> Vec<(&'static str, GraphFile)> {
    let texts = texts();
    let load = |(name, text): (&&'static str, &String)| {
        let file = GraphFile::parse(name, text).and_then(|file| file.with_parts(&texts));
        (*name, file.unwrap_or_else(|problems| panic!("{problems}")))
    };
    texts.0.iter().map(load).collect()
}

fn settings(side: Side) -> Settings {
    Settings { side, ..Settings::new([31, 17], 10, Facts::none().with(SHEETS, 3)) }
}

/// All that can be said of the graph.
fn said(texts: &Texts, registry: &Registry, side: Side) -> Result<String, Problems> {
    let file = GraphFile::load_with("top.ron".as_ref(), texts)?;
    let (graph, plan) = compile(&file, registry, &settings(side))?;
    let full = file.full(registry, "else/where/full.ron".as_ref())?;
    let (params, shaders) = (&graph.params, file.shaders());
    let whole = file.whole()?;
    let wires: Vec<_> = file
        .stages(registry)?
        .iter()
        .flat_map(|stage| {
            let ports =
                stage.stage.declaration().ports.iter().map(|port| (stage.address.clone(), port.name.clone()));
            ports.collect::<Vec<_>>()
        })
        .map(|(node, port)| whole.wire_into(&node, &port))
        .collect();
    Ok(format!(
        "{plan}\n{full}\n{params:?}\n{shaders:?}\n{:?}\n{wires:?}\n{}",
        file.differences(),
        file.name()
    ))
}

#[test]
fn messages_about_damaged_files_with_everything_are_as_before() {
    let (registry, mut figures) = (registry(), Figures::new());
    for side in Side::ALL {
        let said = said(&texts(), &registry, side).unwrap_or_else(|problems| panic!("{problems}"));
        figures.entry(format!("whole on the {side}")).or_default().text(&said);
    }
    for path in texts().0.keys() {
        let text = &texts().0[path];
        let all = tokens(text);
        for index in 0..all.len() {
            for damage in 0..DAMAGES {
                let mut texts = texts();
                texts.0.insert(path, damaged(text, &all, index, damage));
                let said = said(&texts, &registry, Side::Gpu).unwrap_or_else(|problems| problems.to_string());
                figures.entry(format!("{path} {damage}")).or_default().text(&said);
            }
        }
    }
    assert_same("everything", &figures);
}
