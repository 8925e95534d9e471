//! Graphs with changes: written out in full they give the same pictures, byte for byte; a shader takes the place of a
//! stage; and the README's section about it is true.

use std::fs;

use epigraph::{Change, Registry, changed, graphs::Shipped};
use epigraph_core::{AUTO, GraphFile, ParamKind, ParamSpec, Settings, testing::Random};
use epigraph_stages::registry;
use epigraph_tests::{GRAPHS, Run, Stage, facts, graph};

/// A value of a parameter, near its default where that has a wide range, so that most of them make sense together.
fn value(spec: &ParamSpec, random: &mut Random) -> Option<String> {
    let (low, high) = spec.range?;
    let between =
        |random: &mut Random, low: f64, high: f64| f64::from(random.between(low as f32, high as f32));
    Some(match &spec.kind {
        ParamKind::F32OrAuto if random.below(2) == 0 => AUTO.into(),
        ParamKind::F32 | ParamKind::F32OrAuto => {
            let default: f64 = spec.default.parse().ok()?;
            let low = low.max(default * 0.5);
            format!("{:?}", between(random, low, high.min(default * 1.5).max(low)) as f32)
        }
        ParamKind::U32 | ParamKind::I32 => {
            let default: f64 = spec.default.parse().ok()?;
            format!("{:.0}", between(random, low.max(default - 2.0), high.min(default + 2.0)).round())
        }
        _ => return None,
    })
}

fn choice(spec: &ParamSpec, random: &mut Random) -> Option<String> {
    match &spec.kind {
        ParamKind::Choice(names) => Some(names[random.below(names.len() as u32) as usize].clone()),
        ParamKind::Bool => Some((random.below(2) == 0).to_string()),
        _ => value(spec, random),
    }
}

/// A random change to one of the graph's nodes.
fn random_change(file: &GraphFile, registry: &Registry, random: &mut Random) -> Option<Change> {
    let stages = file.stages(registry).ok()?;
    let node = &stages[random.below(stages.len() as u32) as usize];
    let whole = file.whole().ok()?;
    // Copies of a repeated node have one stage and the same wires: these are changed in the node that is written.
    let written = &node.written;
    let (def, _) = whole.node_at(written)?;
    let kind = def.kind.value.clone();
    Some(match random.below(4) {
        0 if kind != "wgsl" => Change::swap(&format!("{written}={kind}")),
        1 => {
            // Its input from where another of its kind is from: the stage before it, if there is one of the same
            // elements.
            let wires: Vec<String> = def.inputs.iter().map(|input| input.port.value.clone()).collect();
            let port = wires.get(random.below(wires.len().max(1) as u32) as usize)?;
            let optional =
                node.stage.declaration().ports.iter().any(|known| known.name == *port && known.optional);
            match optional {
                true => Change::wire(&format!("{written}.{port}=none")),
                false => {
                    let from = whole.wire_into(written, port)?;
                    let (before, _) = whole.node_at(&from.node)?;
                    let source = before
                        .inputs
                        .first()
                        .and_then(|input| whole.wire_into(&from.node, &input.port.value))?;
                    Change::wire(&format!("{written}.{port}={source}"))
                }
            }
        }
        _ => {
            let specs = node.stage.specs();
            let spec = specs.get(random.below(specs.len().max(1) as u32) as usize)?;
            Change::set(&format!("{}.{}={}", node.address, spec.name, choice(spec, random)?))
        }
    })
    .map(|change| change.expect("well formed"))
}

fn picture(file: &GraphFile) -> Vec<u8> {
    let settings = Settings::new([40, 32], 200, facts(true));
    let mut run = Run::new(file, Stage { scene: "cornell", camera: "orbit", settings });
    run.frames(4);
    let output = run.picture().expect("shipped graphs have one");
    run.captured(&output).bytes
}

#[test]
fn shipped_graphs_with_random_changes_are_the_same_in_full() {
    let registry = registry();
    let mut random = Random(12);
    let folder = std::env::temp_dir().join(format!("epigraph-swap-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    for name in GRAPHS {
        let base = graph(name);
        let plain = picture(&base);
        let (mut compiled, mut different) = (0, 0);
        for step in 0..32 {
            let count = step.min(1 + random.below(3));
            let changes: Vec<Change> =
                (0..count).filter_map(|_| random_change(&base, &registry, &mut random)).collect();
            let pieces: Vec<String> = changes.iter().map(Change::piece).collect();
            let what = format!("{name}+{}", pieces.join("+"));
            let file = changed(base.clone(), &changes, &registry).unwrap_or_else(|p| panic!("{what}: {p}"));
            // Some wires do not fit, and some values need others.
            let settings = Settings::new([40, 32], 200, facts(true));
            if epigraph_core::compile(&file, &registry, &settings).is_err() {
                continue;
            }
            let path = folder.join("full.ron");
            fs::write(&path, file.full(&registry, &path).unwrap_or_else(|p| panic!("{what}: {p}"))).unwrap();
            let full = GraphFile::load_with(&path, &Shipped).unwrap_or_else(|p| panic!("{what}: {p}"));
            assert!(full.parts.is_empty() && full.base.is_none());
            let expected = picture(&file);
            assert!(picture(&full) == expected, "{what}: another picture in full\n{}", full.text);
            compiled += 1;
            different += usize::from(expected != plain);
        }
        println!("{name}: {compiled} compiled, {different} gave another picture");
        assert!(
            compiled > 10 && different > 2,
            "{name}: {compiled} compiled, {different} gave another picture"
        );
    }
    fs::remove_dir_all(&folder).unwrap();
}
