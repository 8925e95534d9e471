//! Plans of random graphs, and what is wrong with those that have none.

use epigraph_core::{Facts, GraphFile, Settings, Side, Source, compile, testing::Random};

use super::zoo::{KINDS, MOVES, SHEETS, registry};
use crate::measures::{Figures, assert_same};

/// The kinds that begin a graph: they give what others take.
const FIRST: [&str; 3] = ["source", "cloud", "mark"];

/// A port that a node may take, of the right elements and of an earlier node but for one in `strange` cases.
fn wire(nodes: &[usize], at: usize, input: &str, strange: u32, random: &mut Random) -> Option<String> {
    let is_strange = random.below(strange) == 0;
    let is_late = nodes.get(at).is_some_and(|&kind| KINDS[kind].0 == "delay") || random.below(strange) == 0;
    let element = |kind: &str, port: &str| match (kind, port) {
        ("picture", _) => 3,
        (_, "points") => 2,
        (_, "bits" | "pages" | "corners" | "wanted" | "work") => 1,
        _ => 0,
    };
    let mut ports = Vec::new();
    for (index, &node) in nodes.iter().enumerate().take(if is_late { nodes.len() } else { at }) {
        let (kind, _, outputs) = KINDS[node];
        let fits = |port: &&&str| is_strange || element(kind, port) == element("", input);
        ports.extend(outputs.iter().filter(fits).map(|port| format!("n{index}.{port}")));
    }
    if ports.is_empty() {
        return None;
    }
    // Late ones more often, so that chains form.
    let [a, b] = [0, 1].map(|_| random.below(ports.len() as u32) as usize);
    Some(ports.swap_remove(a.max(b)))
}

/// A graph of random nodes.
fn graph(random: &mut Random) -> String {
    let (more, strange) = (random.below(9), if random.below(12) == 0 { 3 } else { 200 });
    let named = |name| KINDS.iter().position(|(kind, ..)| *kind == name).expect("one of the kinds");
    let first = FIRST.map(named).into_iter();
    let nodes: Vec<usize> =
        first.chain((0..more).map(|_| random.below(KINDS.len() as u32) as usize)).collect();
    let mut text = "#![enable(implicit_some)]\nGraph(version: 1, nodes: {\n".to_owned();
    for (index, &kind) in nodes.iter().enumerate() {
        let (kind, inputs, _) = KINDS[kind];
        let mut wires: Vec<String> = Vec::new();
        for input in inputs {
            let from = wire(&nodes, index, input, strange, random).filter(|_| random.below(80) != 0);
            wires.extend(from.map(|from| format!("{input:?}: {from:?}")));
        }
        text += &format!("\"n{index}\": (kind: {kind:?}, inputs: {{ {} }}", wires.join(", "));
        let is_native = ["small", "mark", "pick", "print", "cloud"].contains(&kind);
        text += match random.below(9) {
            0 => ", on: Cpu",
            1 | 2 if !is_native || random.below(40) == 0 => ", on: Gpu",
            3 => ", on: Cpu, download: Latent(2)",
            4 if random.below(40) == 0 => ", download: Latent(17)",
            5 if random.below(6) == 0 => ", bypass: true",
            _ => "",
        };
        if kind == "mix" {
            let weight = ["0.5", "2.0", "1", "2.5"][(random.below(31) / 10) as usize];
            let (way, level) = (["Up", "Down"][random.below(2) as usize], random.below(100));
            text += &format!(", params: (weight: {weight}, way: {way}, level: {level})");
        }
        text += "),\n";
    }
    let mut outputs = Vec::new();
    for index in 0..1 + random.below(3) {
        let input = ["a", "a", "a", "points"][random.below(4) as usize];
        let from = wire(&nodes, nodes.len(), input, strange, random);
        outputs.extend(from.map(|from| format!("\"o{index}\": {from:?}")));
    }
    text + &format!("}}, outputs: {{ {} }})", outputs.join(", "))
}

/// Random settings.
fn settings(random: &mut Random) -> Settings {
    let mut facts = Facts::none();
    if random.below(5) > 0 {
        facts = facts.with(SHEETS, random.below(9));
    }
    if random.below(3) > 0 {
        facts = facts.stating(MOVES, random.below(3) == 0);
    }
    let size = [1 + random.below(70), 1 + random.below(50)];
    let mut settings = Settings::new(size, random.below(20), facts);
    settings.side = Side::ALL[random.below(2) as usize];
    settings.prune = random.below(3) > 0;
    settings.pooling = random.below(3) > 0;
    settings.taps = (0..random.below(3))
        .map(|_| Source { node: format!("n{}", random.below(4)), port: "out".into() })
        .collect();
    settings
}

#[test]
fn plans_of_random_graphs_are_as_before() {
    let (registry, mut figures, mut random) = (registry(), Figures::new(), Random(4));
    let mut planned = 0;
    for round in 0..4000 {
        let (text, settings) = (graph(&mut random), settings(&mut random));
        let said = GraphFile::parse("random.ron", &text).and_then(|file| {
            let (graph, plan) = compile(&file, &registry, &settings)?;
            let full = file.full(&registry, "full.ron".as_ref())?;
            let names = |at| graph.name(graph.root(at));
            let outputs: Vec<_> =
                graph.outputs.iter().map(|(name, at)| (name, names(*at), graph.meaning(*at))).collect();
            Ok(format!("{plan}{}\n{plan:?}\n{outputs:?}\n{full}", plan.dot()))
        });
        planned += usize::from(said.is_ok());
        let said = said.unwrap_or_else(|problems| problems.to_string());
        figures.entry(format!("random graphs {:02}", round / 100)).or_default().text(&said);
    }
    assert_same("random-graphs", &figures);
    // Both matter.
    assert!((1000..3000).contains(&planned), "{planned} have a plan");
}
