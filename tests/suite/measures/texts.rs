//! Graph files and shaders: messages about damage, plans, graphs in full, and edits.

mod declarations;
mod everything;
mod random_graphs;
mod zoo;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use epigraph::graphs::Shipped;
use epigraph_core::{
    Download, EditedTexts, GraphFile, Problems, Registry, Settings, Side, StageOf, WgslFile, check_stage,
    compile,
};
use epigraph_stages::registry;
use epigraph_tests::{GRAPHS, facts, graph};

use super::{Figures, assert_same};

/// The folder of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a folder in the repository").to_owned()
}

/// The byte ranges of words, and of marks of one letter.
fn tokens(text: &str) -> Vec<(usize, usize)> {
    let mut tokens: Vec<(usize, usize)> = Vec::new();
    let mut in_word = false;
    for (at, c) in text.char_indices() {
        let is_word = c.is_alphanumeric() || "_.\"/".contains(c);
        match tokens.last_mut() {
            Some(last) if is_word && in_word => last.1 = at + c.len_utf8(),
            _ if c.is_whitespace() => {}
            _ => tokens.push((at, at + c.len_utf8())),
        }
        in_word = is_word;
    }
    tokens
}

/// The number of ways to damage a text.
const DAMAGES: usize = 6;

/// A text with one of its tokens left out, doubled, changed by a letter, replaced by a later one, swapped with the next
/// one, or with another number in it.
fn damaged(text: &str, tokens: &[(usize, usize)], index: usize, damage: usize) -> String {
    let (start, end) = tokens[index];
    let word = &text[start..end];
    let (later, to) = tokens[(index + 7) % tokens.len()];
    let (next, after) = tokens.get(index + 1).copied().unwrap_or((end, end));
    let new = match damage {
        0 => String::new(),
        1 => format!("{word} {word}"),
        2 => match word.strip_suffix('"') {
            Some(quoted) => format!("{quoted}x\""),
            None => format!("{word}1"),
        },
        3 => text[later..to].to_owned(),
        4 => {
            return format!(
                "{}{}{}{word}{}",
                &text[..start],
                &text[next..after],
                &text[end..next],
                &text[after..]
            );
        }
        _ => match word.find(|c: char| c.is_ascii_digit()) {
            Some(at) => {
                format!("{}{}{}", &word[..at], ["0", "-1", "257", "4294967296"][index % 4], &word[at + 1..])
            }
            None => format!("{word} 2"),
        },
    };
    format!("{}{new}{}", &text[..start], &text[end..])
}

/// Adds what is said of damage to every `step`th token of a file.
fn damage(file: &Path, step: usize, figures: &mut Figures, say: impl Fn(&str) -> String) {
    let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let text: String = text
        .lines()
        .filter(|line| !line.trim_start().starts_with("// "))
        .flat_map(|line| [line, "\n"])
        .collect();
    let all = tokens(&text);
    let name = file.strip_prefix(root()).expect("a file of the repository").display().to_string();
    for (index, damage) in (0..all.len()).step_by(step).zip((0..DAMAGES).cycle()) {
        let said = say(&damaged(&text, &all, index, damage)).replace(&*root().to_string_lossy(), "");
        figures.entry(name.clone()).or_default().text(&said);
    }
}

fn settings(side: Side) -> Settings {
    Settings { side, ..Settings::new([64, 48], 100, facts(true)) }
}

/// The plan of a graph, and the graph in full.
fn made(file: &GraphFile, registry: &Registry, side: Side) -> Result<String, Problems> {
    let (_, plan) = compile(file, registry, &settings(side))?;
    let full = file.full(registry, &root().join("graphs/full.ron"))?;
    Ok(format!("{plan}\n{}\n{:?}\n{full}", plan.dot(), file.differences()))
}

#[test]
fn messages_about_damaged_graphs_and_the_plans_of_others_are_as_before() {
    let (registry, mut figures) = (registry(), Figures::new());
    for name in GRAPHS {
        let file = root().join("graphs").join(name);
        damage(&file, 1, &mut figures, |text| {
            let parsed = GraphFile::parse(&file.display().to_string(), text);
            let made = parsed
                .and_then(|file| file.with_parts(&Shipped))
                .and_then(|file| made(&file, &registry, Side::Gpu));
            made.unwrap_or_else(|problems| problems.to_string())
        });
        for side in Side::ALL {
            let made = made(&graph(name), &registry, side).unwrap_or_else(|problems| panic!("{problems}"));
            let made = made.replace(&*root().to_string_lossy(), "");
            figures.entry(format!("{name} on the {side}")).or_default().text(&made);
        }
    }
    assert_same("graph-messages", &figures);
}

#[test]
fn messages_about_damaged_shaders_are_as_before() {
    let mut figures = Figures::new();
    let edited: Arc<Mutex<(PathBuf, Arc<str>)>> = Arc::new(Mutex::new((PathBuf::new(), "".into())));
    let known = edited.clone();
    let registry = registry().with_edited(EditedTexts::new(move |file| {
        let known = known.lock().expect("no panics");
        (known.0 == file).then(|| known.1.clone())
    }));
    let edit = |file: &Path, text: &str| *edited.lock().expect("no panics") = (file.to_owned(), text.into());
    let declared =
        ["tests/wgsl/edge_raster", "tests/wgsl/age", "tests/wgsl/interpolate", "graphs/experiments/lines"];
    for name in declared {
        let file = root().join(name).with_extension("wgsl");
        damage(&file, 2, &mut figures, |text| {
            edit(&file, text);
            match WgslFile::load(&file, &registry) {
                Ok(WgslFile { doc, declaration, specs, assumed }) => {
                    format!("{doc} {declaration:?} {specs:?} {assumed:?}")
                }
                Err(problems) => problems.to_string(),
            }
        });
    }
    let epi = graph("epi.ron");
    let all = graph("experiments/complex-pixels.ron").stages(&registry).expect("a shipped graph");
    for StageOf { stage, .. } in all {
        let Some(shader) = &stage.declaration().shader else { continue };
        let file = shader.file.as_ref().expect("in the repository");
        let name = file.file_stem().expect("a file").to_string_lossy().into_owned();
        // The path that the registry has may lead through another folder.
        let plain = root().join("shaders").join(&name).with_extension("wgsl");
        damage(&plain, 11, &mut figures, |text| {
            edit(file, text);
            check_stage(&*stage, &registry.library).iter().map(|error| format!("{error}\n")).collect()
        });
        if ["classify", "edge_raster", "silhouette", "project"].contains(&&*name) {
            damage(&plain, 13, &mut figures, |text| {
                edit(file, text);
                let compiled = compile(&epi, &registry, &settings(Side::Gpu));
                compiled.map_or_else(|problems| problems.to_string(), |_| "fits".into())
            });
        }
    }
    assert_same("shader-messages", &figures);
}

/// A graph without the line breaks and commas that the shipped ones have.
const DENSE: &str = r#"#![enable(implicit_some)] Graph(version: 1, params: {"p": (default: 0.5)}, /* a */ nodes: {
    "a": (kind: "points", params: (points_per_pixel: 2.0, /* b */ x: Param("p") ), on: Cpu ), "b": (kind: "age",
      inputs: {"cloud": "a.cloud", /* c */ "arrived": "a.b" } ) /* d */
      , "c": (kind:"fill",inputs:{},params:()), "d": (kind: "fill")}, // e
    outputs: {"image": "b.cloud", "other": "c.d" })"#;

/// Adds what edits of all kinds make of a file.
fn edits(name: &str, file: &GraphFile, registry: &Registry, figures: &mut Figures) {
    let mut add = |what: &str, edit: &dyn Fn(&mut GraphFile) -> Result<(), Problems>| {
        let mut edited = file.clone();
        let said = edit(&mut edited).map_or_else(|problems| problems.to_string(), |()| edited.text);
        let said = said.replace(&*root().to_string_lossy(), "");
        figures.entry(format!("{name} {what}")).or_default().text(&said);
    };
    let stages = file.stages(registry).unwrap_or_default();
    let addresses = stages.iter().map(|stage| stage.written.clone());
    let own = file.nodes.iter().map(|node| node.name.value.clone());
    for node in addresses.chain(own).chain(["none".into()]) {
        let stage = stages.iter().find(|stage| stage.written == node);
        let ports =
            stage.iter().flat_map(|stage| &stage.stage.declaration().ports).map(|port| port.name.to_string());
        for port in ports.chain(["cloud".into(), "new".into()]) {
            add("set_input", &|file| file.set_input(&node, &port, "x.y".parse().ok().as_ref()));
            add("set_input none", &|file| file.set_input(&node, &port, None));
        }
        let specs = stage.iter().flat_map(|stage| stage.stage.specs()).map(|spec| spec.name);
        for param in specs.chain(["points_per_pixel".into(), "x".into()]) {
            add("set_param", &|file| file.set_param(&node, &param, "7.5"));
            add("unset_param", &|file| file.unset_param(&node, &param));
            add("remove_param", &|file| file.remove_param(&node, &param));
        }
        for on in [None, Some(Side::Cpu), Some(Side::Gpu)] {
            add("set_on", &|file| file.set_on(&node, on));
        }
        for download in [None, Some(Download::Sync), Some(Download::Latent(3))] {
            add("set_download", &|file| file.set_download(&node, download));
        }
        add("set_bypass", &|file| file.set_bypass(&node, true));
        add("set_bypass and back", &|file| {
            file.set_bypass(&node, true).and_then(|()| file.set_bypass(&node, false))
        });
        add("set_kind", &|file| file.set_kind(&node, "fill"));
        add("add_node", &|file| file.add_node(&node, "fill"));
        add("copy_node", &|file| file.copy_node(&node, "copy"));
        add("remove_node", &|file| file.remove_node(&node));
        add("rename_node", &|file| file.rename_node(&node, "renamed"));
        add("rename_node", &|file| file.rename_node(&node, "a.b"));
        add("restore_node", &|file| file.restore_node(&node));
    }
    for output in ["image", "other", "new"] {
        add("set_output", &|file| file.set_output(output, "x.y".parse().ok().as_ref()));
        add("set_output none", &|file| file.set_output(output, None));
    }
    for param in ["sigma", "levels", "p", "new"] {
        add("set_graph_param", &|file| file.set_graph_param(param, "3.0"));
        add("restore_param", &|file| file.restore_param(param));
    }
    add("add_node", &|file| file.add_node("new", "age").and_then(|()| file.remove_node("new")));
}

#[test]
fn edits_are_as_before() {
    let mut figures = Figures::new();
    let dense = GraphFile::parse("dense.ron", DENSE).unwrap_or_else(|problems| panic!("{problems}"));
    let shipped = GRAPHS.iter().map(|name| (*name, graph(name)));
    for (name, file) in shipped.chain([("dense.ron", dense)]) {
        edits(name, &file, &registry(), &mut figures);
    }
    for (name, file) in everything::files() {
        edits(name, &file, &everything::registry(), &mut figures);
    }
    assert_same("edits", &figures);
}
