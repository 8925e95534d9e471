use std::{fs, path::PathBuf};

use epigraph_core::{AUTO, ParamKind, ParamSpec, Side, Source};

use super::*;
use crate::files;

/// Copies the shipped graphs and their parts to `folder`. Returns the paths of the graphs.
pub(crate) fn shipped(folder: &Path) -> Vec<PathBuf> {
    let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
    let mut files = Vec::new();
    fs::create_dir(folder.join("parts")).unwrap();
    for (from, to) in [(graphs.clone(), folder.to_owned()), (graphs.join("parts"), folder.join("parts"))] {
        for entry in fs::read_dir(from).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "ron") {
                let copy = to.join(path.file_name().unwrap());
                fs::copy(&path, &copy).unwrap();
                files.extend((to == folder).then_some(copy));
            }
        }
    }
    files.sort();
    assert!(files.len() >= 4, "{files:?}");
    files
}

/// xorshift32 (Marsaglia 2003): random enough to choose edits.
pub(crate) struct Random(pub u32);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0 as usize % bound.max(1)
    }

    fn pick<'a, T>(&mut self, all: &'a [T]) -> Option<&'a T> {
        all.get(self.below(all.len()))
    }
}

fn value(spec: &ParamSpec, random: &mut Random) -> String {
    let share = random.below(1000) as f64 / 1000.0;
    let (low, high) = spec.range.unwrap_or((0.0, 10.0));
    match &spec.kind {
        ParamKind::Bool => (random.below(2) == 0).to_string(),
        ParamKind::U32 | ParamKind::I32 => ((low + share * (high - low).min(100.0)) as i64).to_string(),
        ParamKind::F32OrAuto if random.below(2) == 0 => AUTO.into(),
        ParamKind::F32 | ParamKind::F32OrAuto => format!("{:?}", low + share * (high - low)),
        ParamKind::Choice(names) => random.pick(names).cloned().unwrap_or_default(),
        ParamKind::Text => "\"x.ron\"".into(),
    }
}

/// Addresses and kinds of all nodes.
fn addresses(file: &GraphFile, prefix: &str) -> Vec<(String, String)> {
    let own = file.nodes.iter().map(|node| (format!("{prefix}{}", node.name.value), node.kind.value.clone()));
    let parts = file.parts.iter().flat_map(|(name, part)| addresses(part, &format!("{prefix}{name}/")));
    own.chain(parts).collect()
}

/// Makes a random edit; many fail.
pub(crate) fn random_edit(document: &mut Document, random: &mut Random) {
    let registry = epigraph_stages::registry();
    let Some(file) = document.whole().cloned() else { return };
    let nodes = addresses(&file, "");
    let own: Vec<String> = file.nodes.iter().map(|node| node.name.value.clone()).collect();
    let (Some((address, kind)), Some(node), Some(other)) =
        (random.pick(&nodes).cloned(), random.pick(&own).cloned(), random.pick(&own).cloned())
    else {
        return;
    };
    let specs = registry.get(&kind).map(|kind| kind.specs()).unwrap_or_default();
    let source = Source { node: other.clone(), port: "color".into() };
    let choice = random.below(18);
    let number = random.below(1000);
    // Many of these fail. The tests check that undo restores the texts and that the engine survives.
    let _ = document.edit_placed(Tag::Once, |file, places| match choice {
        0..=3 => match random.pick(&specs) {
            Some(spec) => file.set_param(&address, &spec.name, &value(spec, random)),
            None => Ok(()),
        },
        4 => match random.pick(&specs) {
            Some(spec) => remove_param(file, &address, &spec.name, &spec.default),
            None => Ok(()),
        },
        5 => file.set_input(&node, "color", Some(&source)),
        6 => file.set_input(&node, "cloud", None),
        7 => file.set_on(&node, [None, Some(Side::Cpu), Some(Side::Gpu)][number % 3]),
        8 => file.set_bypass(&node, number < 500),
        9 => file.add_node(&format!("new{number}"), "fill"),
        10 if own.len() > 3 => file.remove_node(&node),
        10 => Ok(()),
        11 => file.rename_node(&node, &format!("{node}_{number}")),
        12 => nodes::duplicate(file, &[node, other]).map(|_| ()),
        13 if own.len() > 20 => nodes::remove(file, &[node, other]),
        13 => Ok(()),
        14 => nodes::bypass(file, &[address.clone(), address], number < 500),
        15 => nodes::rename(file, &address, &format!("n{number}"))
            .map(|new| places::rename(places, &address, &new)),
        16 => nodes::add(file, nodes::split(&address).0, "fill").map(|_| ()),
        _ => {
            places.insert(address, [number as f32, 10.0]);
            Ok(())
        }
    });
    if random.below(20) == 0 {
        // Typing a character, which may break the text; then undo it.
        let paths: Vec<String> = document.paths().map(Into::into).collect();
        let path = random.pick(&paths).unwrap().clone();
        let mut text = document.text(&path).to_owned();
        let places: Vec<usize> = text.char_indices().map(|(at, _)| at).collect();
        text.insert(*random.pick(&places).unwrap(), ['x', ',', '\n', '}'][number % 4]);
        document.type_text(&path, &text);
        if !document.problems().is_empty() {
            document.undo();
        }
    }
}

#[test]
fn undoing_random_edits_restores_every_file_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    for (seed, path) in shipped(folder.path()).iter().enumerate() {
        let mut document = Document::open(path).unwrap();
        assert_eq!(document.problems(), []);
        let opened = document.contents.texts.clone();
        let places = document.places().clone();
        let mut random = Random(2_463_534_242 + seed as u32);
        for _ in 0..500 {
            random_edit(&mut document, &mut random);
        }
        let count = document.past.len();
        assert!(count > 100, "{}: {count} edits", path.display());
        assert!(document.is_dirty());
        let edited = document.contents.texts.clone();
        while document.can_undo() {
            document.undo();
        }
        for (path, text) in &opened {
            assert_eq!(document.text(path), &**text, "{path}");
            let stored = fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}"));
            assert_eq!(stored, **text, "{path}");
        }
        assert!(!document.is_dirty() && *document.places() == places);
        // There may be one more to redo: the last thing that happened may have been that one was undone.
        (0..count).for_each(|_| document.redo());
        assert_eq!(document.contents.texts, edited);
    }
}

#[test]
fn every_parameter_of_every_stage_can_be_set_and_removed() {
    let registry = epigraph_stages::registry();
    let mut random = Random(99);
    let mut parameters = 0;
    for kind in registry.kinds() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.ron");
        let text = format!(
            "Graph(\n    version: 1,\n    nodes: {{\n        // The only one.\n        \"node\": (kind: \"{}\"),\n    }},\n    outputs: {{}},\n)\n",
            kind.name()
        );
        fs::write(&path, &text).unwrap();
        let mut document = Document::open(&path).unwrap();
        assert_eq!(document.problems(), []);
        for spec in kind.specs() {
            parameters += 1;
            let given = value(&spec, &mut random);
            document.edit(Tag::Once, |file| file.set_param("node", &spec.name, &given)).unwrap();
            // Both the document and a fresh parse read the value that was set.
            let written = document.text(document.path()).to_owned();
            let file = GraphFile::parse("one.ron", &written).unwrap();
            assert_eq!(param_text(&file, "node", &spec.name), Some(given.as_str()), "{}", kind.name());
            let held = document.file().and_then(|file| param_text(file, "node", &spec.name));
            assert_eq!(held, Some(given.as_str()));
            assert!(written.contains("// The only one."));
            document.edit(Tag::Once, |file| remove_param(file, "node", &spec.name, &spec.default)).unwrap();
            let held = document.file().and_then(|file| param_text(file, "node", &spec.name));
            assert_eq!((held, document.problems()), (None, &[][..]), "{}.{}", kind.name(), spec.name);
            document.undo();
            document.undo();
            assert_eq!(document.text(document.path()), text);
        }
    }
    assert!(parameters > 40, "{parameters}");
}

/// A document in this folder that uses the same part twice.
fn small(folder: &Path) -> Document {
    let part = r#"Graph(version: 1, nodes: { "in": (kind: "fill", params: (sigma: 0.5)) }, outputs: { "o": "in.color" })"#;
    let main = "Graph(\n    version: 1,\n    nodes: {\n        // Kept.\n        \"a\": (kind: \"graph\", params: (file: \"part.ron\")),\n        \"b\": (kind: \"graph\", params: (file: \"part.ron\"), set: { \"in\": (radius: 2) }),\n        \"c\": (kind: \"fill\"),\n    },\n    outputs: { \"image\": \"a.o\" },\n)\n";
    fs::write(folder.join("part.ron"), part).unwrap();
    fs::write(folder.join("main.ron"), main).unwrap();
    Document::open(&folder.join("main.ron")).unwrap()
}

#[test]
fn a_drag_is_one_step_of_undo() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = small(folder.path());
    let drag = |document: &mut Document, value: &str| {
        let tag = Tag::Param("c".into(), "sigma".into());
        document.edit(tag, |file| file.set_param("c", "sigma", value)).unwrap();
    };
    for value in ["0.1", "0.2", "0.3"] {
        drag(&mut document, value);
    }
    document.seal();
    drag(&mut document, "0.4");
    document.undo();
    assert_eq!(param_text(document.file().unwrap(), "c", "sigma"), Some("0.3"));
    document.undo();
    assert_eq!(param_text(document.file().unwrap(), "c", "sigma"), None);
    assert!(!document.can_undo() && !document.is_dirty());
    document.redo();
    assert_eq!(param_text(document.file().unwrap(), "c", "sigma"), Some("0.3"));
}

#[test]
fn a_part_changes_everywhere_and_is_saved_to_its_own_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = small(folder.path());
    let main = fs::read_to_string(folder.path().join("main.ron")).unwrap();
    document.edit(Tag::Once, |file| file.set_param("a/in", "sigma", "0.7")).unwrap();
    let file = document.file().unwrap();
    assert_eq!(param_text(file, "b/in", "sigma"), Some("0.7"));
    assert_eq!(param_text(file, "b/in", "radius"), Some("2"));
    document.save().unwrap();
    assert!(!document.is_dirty());
    assert_eq!(fs::read_to_string(folder.path().join("main.ron")).unwrap(), main);
    assert!(fs::read_to_string(folder.path().join("part.ron")).unwrap().contains("sigma: 0.7"));
    document.edit(Tag::Once, |file| remove_param(file, "a/in", "sigma", "1.0")).unwrap();
    document.edit(Tag::Once, |file| remove_param(file, "b/in", "radius", "1")).unwrap();
    let file = document.file().unwrap();
    assert_eq!(param_text(file, "a/in", "sigma"), None);
    assert_eq!(param_text(file, "b/in", "radius"), Some("1"));
}

#[test]
fn a_broken_text_keeps_the_last_good_graph_and_can_be_saved() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = small(folder.path());
    let path = document.path().to_owned();
    let good = document.file().unwrap().clone();
    let broken = document.text(&path).replace("version: 1,", "version: 1");
    document.type_text(&path, &broken);
    let place = document.problems()[0].place.clone().unwrap();
    assert_eq!((place.line, place.file), (3, path.clone()));
    assert_eq!(document.file(), Some(&good));
    assert!(document.edit(Tag::Once, |file| file.set_on("c", Some(Side::Cpu))).is_err());
    document.save().unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), broken);
    let mut again = Document::open(Path::new(&path)).unwrap();
    assert!(again.file().is_none() && !again.problems().is_empty());
    let mended = broken.replace("version: 1", "version: 1,");
    again.type_text(&path, &mended);
    assert!(again.problems().is_empty() && again.file().is_some());
}

#[test]
fn changes_by_another_program_are_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = small(folder.path());
    let path = document.path().to_owned();
    document.edit(Tag::Once, |file| file.set_bypass("c", true)).unwrap();
    fs::write(&path, "theirs").unwrap();
    assert!(document.save().unwrap_err().to_string().contains("another program"));
    assert!(document.is_dirty());
    assert_eq!(fs::read_to_string(&path).unwrap(), "theirs");
    assert_eq!(document.conflicts().collect::<Vec<_>>(), [(path.as_str(), "theirs")]);
}

#[test]
fn the_user_decides_about_files_that_another_program_has_changed_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = small(folder.path());
    let path = document.path().to_owned();
    let part = folder.path().join("part.ron").display().to_string();
    let on_disk = |path: &str| fs::read_to_string(path).unwrap();
    let conflicts = |document: &Document| -> Vec<String> {
        document.conflicts().map(|(path, _)| files::short(path).to_owned()).collect()
    };
    let (first, old) = (on_disk(&path), on_disk(&part));
    document.edit(Tag::Once, |file| file.set_bypass("c", true)).unwrap();
    document.edit(Tag::Once, |file| file.set_param("a/in", "sigma", "0.75")).unwrap();
    let mine = document.text(&path).to_owned();
    assert!(!document.refresh() && conflicts(&document).is_empty());

    // Nothing is written while there is a conflict, not even the other file.
    let theirs = first.replace("// Kept.", "// Theirs.");
    fs::write(&path, &theirs).unwrap();
    assert!(!document.refresh());
    assert_eq!(conflicts(&document), ["main.ron"]);
    document.save().unwrap_err();
    assert_eq!((on_disk(&path), on_disk(&part)), (theirs.clone(), old));

    // Theirs is taken, and mine comes back by undo.
    document.take_theirs(&path);
    assert_eq!((conflicts(&document), document.text(&path)), (vec![], theirs.as_str()));
    document.undo();
    assert_eq!((conflicts(&document), document.text(&path)), (vec![], mine.as_str()));
    // Now it is made to their text, so that saving replaces that.
    assert!(!document.refresh() && conflicts(&document).is_empty());
    let later = first.replace("// Kept.", "// Later.");
    fs::write(&path, &later).unwrap();
    document.refresh();
    assert_eq!(conflicts(&document), ["main.ron"]);
    document.keep_mine(&path);
    assert!(conflicts(&document).is_empty() && document.text(&path) == mine && document.is_dirty());
    document.refresh();
    assert!(conflicts(&document).is_empty());
    document.save().unwrap();
    assert!(on_disk(&path) == mine && on_disk(&part).contains("0.75") && !document.is_dirty());

    // The same change by another program is none.
    document.edit(Tag::Once, |file| file.set_bypass("c", false)).unwrap();
    fs::write(&path, document.text(&path)).unwrap();
    document.refresh();
    assert!(conflicts(&document).is_empty() && !document.is_dirty());
    // What the user takes back by undo is no conflict any more, and the file is reloaded.
    document.edit(Tag::Once, |file| file.set_bypass("c", true)).unwrap();
    fs::write(&path, &theirs).unwrap();
    document.refresh();
    assert_eq!(conflicts(&document), ["main.ron"]);
    document.undo();
    assert!(document.refresh() && conflicts(&document).is_empty());
    assert_eq!(document.text(&path), theirs);
}

#[test]
fn the_user_decides_about_box_positions_that_another_program_has_changed_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = small(folder.path());
    let layout = folder.path().join("main.layout.ron");
    let theirs = "Layout(version: 1, nodes: {\"c\": (1, 2)})";
    let put = |document: &mut Document, at: [f32; 2]| {
        document.place(Tag::Once, |places| {
            places.insert("c".into(), at);
        });
    };
    // Without unsaved positions, theirs are shown.
    fs::write(&layout, theirs).unwrap();
    assert!(document.refresh() && !document.is_dirty());
    assert_eq!(document.places()["c"], [1.0, 2.0]);

    put(&mut document, [10.0, 20.0]);
    fs::write(&layout, theirs.replace('2', "3")).unwrap();
    assert!(!document.refresh());
    let path = document.layout_path();
    assert_eq!(document.conflicts().map(|(path, _)| path).collect::<Vec<_>>(), [&path]);
    document.save().unwrap_err();
    assert_eq!(fs::read_to_string(&layout).unwrap(), theirs.replace('2', "3"));
    document.take_theirs(&path);
    assert!(document.places()["c"] == [1.0, 3.0] && !document.is_dirty());
    document.undo();
    assert!(document.places()["c"] == [10.0, 20.0] && document.is_dirty());
    fs::write(&layout, theirs).unwrap();
    document.refresh();
    document.keep_mine(&path);
    document.save().unwrap();
    assert!(fs::read_to_string(&layout).unwrap().contains("(10, 20)"));
    assert!(!document.refresh() && !document.is_dirty() && document.conflicts().next().is_none());
}

#[test]
fn a_swap_keeps_the_wires_and_parameters_that_both_kinds_have() {
    let folder = tempfile::tempdir().unwrap();
    let epi = shipped(folder.path()).into_iter().find(|path| path.ends_with("epi.ron")).unwrap();
    let registry = epigraph_stages::registry();
    let mut document = Document::open(&epi).unwrap();
    let fits = fitting(document.file().unwrap(), "interpolate", &registry);
    assert!(fits.contains(&"fill") && fits.contains(&"interpolate"), "{fits:?}");
    assert!(!fits.contains(&"mesh") && !fits.contains(&"tonemap"), "{fits:?}");
    assert!(fitting(document.file().unwrap(), "view", &registry).is_empty());
    document.edit(Tag::Once, |file| swap(file, "interpolate", "fill", &registry)).unwrap();
    let node = document.file().unwrap().node("interpolate").unwrap().clone();
    assert_eq!(node.kind.value, "fill");
    let inputs: Vec<&str> = node.inputs.iter().map(|input| input.port.value.as_str()).collect();
    assert_eq!(inputs, ["cloud", "id", "previous"]);
    assert_eq!(node.inputs[2].from.value.to_string(), "interpolate.color");
    assert!(
        document.text(document.path()).contains("// Each pixel's primary region takes the weighted mean")
    );
    document.undo();
    assert!(!document.can_undo() && !document.is_dirty());
}

#[test]
fn files_changed_by_another_program_are_reloaded_unless_they_have_unsaved_changes() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = small(folder.path());
    let part = folder.path().join("part.ron");
    assert!(!document.refresh());
    let changed = fs::read_to_string(&part).unwrap().replace("0.5", "0.25");
    fs::write(&part, &changed).unwrap();
    assert!(document.refresh() && !document.is_dirty());
    assert_eq!(param_text(document.file().unwrap(), "a/in", "sigma"), Some("0.25"));
    document.edit(Tag::Once, |file| file.set_param("a/in", "sigma", "0.75")).unwrap();
    fs::write(&part, changed.replace("0.25", "0.1")).unwrap();
    assert!(!document.refresh());
    assert_eq!(param_text(document.file().unwrap(), "a/in", "sigma"), Some("0.75"));
}

#[test]
fn wires_must_fit_the_elements_of_pins() {
    let folder = tempfile::tempdir().unwrap();
    let epi = shipped(folder.path()).into_iter().find(|path| path.ends_with("epi.ron")).unwrap();
    let document = Document::open(&epi).unwrap();
    let file = document.file().unwrap();
    let registry = epigraph_stages::registry();
    let pin = |node: &str, side: usize, name: &str| {
        let pins = pins(file, file.node(node).unwrap(), &registry);
        pins[side].iter().find(|pin| pin.name == name).cloned().unwrap()
    };
    // Every wire of the file fits, also those to and from parts.
    for node in &file.nodes {
        for input in &node.inputs {
            let (to, from) = (&input.port.value, &input.from.value);
            let (taken, given) = (pin(&node.name.value, 0, to), pin(&from.node, 1, &from.port));
            assert!(taken.fields.is_some() && given.fields.is_some(), "{} {to}", node.name.value);
            assert!(taken.accepts(&given), "{} {to}: {} {}", node.name.value, taken.words(), given.words());
        }
    }
    assert!(!pin("tonemap", 0, "color").accepts(&pin("view", 1, "id")));
    assert!(!pin("interpolate", 0, "cloud").accepts(&pin("view", 1, "depth")));
}

#[test]
fn box_positions_are_saved_beside_the_graph_and_can_be_undone() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = small(folder.path());
    let layout = folder.path().join("main.layout.ron");
    let main = document.text(document.path()).to_owned();
    document.save().unwrap();
    assert!(!layout.exists(), "nothing was moved");

    let revision = document.revision();
    document.place(Tag::Once, |places| {
        places.insert("c".into(), [10.4, -20.0]);
        places.insert("a/in".into(), [3.0, 4.0]);
        places.insert("gone".into(), [5.0, 6.0]);
    });
    assert_eq!(document.revision(), revision, "the graph is the same");
    assert!(document.is_dirty() && !layout.exists());
    document
        .edit_placed(Tag::Once, |file, places| {
            let new = nodes::rename(file, "a", "z")?;
            places::rename(places, "a", &new);
            Ok(())
        })
        .unwrap();
    assert!(document.places().contains_key("z/in") && !document.places().contains_key("a/in"));
    document.undo();
    assert!(document.places().contains_key("a/in"));
    document.save().unwrap();
    assert!(!document.is_dirty());
    assert_eq!(fs::read_to_string(folder.path().join("main.ron")).unwrap(), main);

    let again = Document::open(&folder.path().join("main.ron")).unwrap();
    assert_eq!(**again.places(), Places::from([("a/in".into(), [3.0, 4.0]), ("c".into(), [10.0, -20.0])]));
    assert!(!again.is_dirty());
    document.undo();
    assert!(document.places().is_empty() && document.is_dirty());
}

#[test]
fn an_unusable_layout_is_reported_and_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    small(folder.path());
    let layout = folder.path().join("main.layout.ron");
    let broken = [
        "Layout(",
        "Layout(version: 2, nodes: {})",
        "Layout(version: 1, nodes: {\"a\": (inf, 1)})",
        "Layout(version: 1, places: {})",
    ];
    for text in broken {
        fs::write(&layout, text).unwrap();
        let mut document = Document::open(&folder.path().join("main.ron")).unwrap();
        assert!(document.file().is_some() && document.places().is_empty());
        let notice = document.take_notice().unwrap();
        assert!(notice.contains("main.layout.ron") && notice.contains("arranged automatically"), "{notice}");
        document.edit(Tag::Once, |file| file.set_bypass("c", true)).unwrap();
        document.save().unwrap();
        assert_eq!(fs::read_to_string(&layout).unwrap(), text);
    }
}

#[test]
fn copies_are_wired_to_each_other_and_comments_stay() {
    let folder = tempfile::tempdir().unwrap();
    let epi = shipped(folder.path()).into_iter().find(|path| path.ends_with("epi.ron")).unwrap();
    let mut document = Document::open(&epi).unwrap();
    let before = document.text(document.path()).to_owned();
    let chosen = ["spread".to_owned(), "antialias".into(), "edges".into()];
    let mut copies = Vec::new();
    document
        .edit(Tag::Once, |file| {
            copies = nodes::duplicate(file, &chosen)?;
            Ok(())
        })
        .unwrap();
    assert_eq!(copies, ["spread2", "antialias2", "edges2"]);
    let file = document.file().unwrap().clone();
    let from = |node: &str, port: &str| {
        let input = file.node(node).unwrap().inputs.iter().find(|input| input.port.value == port).unwrap();
        input.from.value.to_string()
    };
    assert_eq!(from("antialias2", "primary"), "spread2.color");
    assert_eq!(from("antialias2", "cls"), "edges2.cls");
    assert_eq!(from("spread2", "primary"), "interpolate.color");
    assert_eq!(from("antialias", "primary"), "spread.color");
    let after = document.text(document.path());
    assert!(before.lines().all(|line| after.contains(line)));
    document.edit(Tag::Once, |file| nodes::remove(file, &copies)).unwrap();
    assert_eq!(document.text(document.path()), before);
    document.undo();
    document.undo();
    assert!(!document.can_undo() && !document.is_dirty());
}

#[test]
fn a_node_that_an_outer_graph_refers_to_cannot_be_renamed() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = small(folder.path());
    let error = document.edit(Tag::Once, |file| nodes::rename(file, "b/in", "x").map(|_| ())).unwrap_err();
    assert!(error.to_string().contains("main.ron refers to it by name"), "{error}");
    assert!(!document.is_dirty());
    let free = nodes::free_name(document.file().unwrap(), "c");
    assert_eq!(free, "c2");
}

/// A graph that changes the edge-and-point image, in a folder.
fn change(folder: &Path) -> Document {
    let path = folder.join("change.ron");
    let text = "Graph(\n    version: 1,\n    base: \"epi\", // why\n    set: { \"interpolate\": (sigma: 0.5) },\n)\n";
    fs::write(&path, text).unwrap();
    let document = Document::open(&path).unwrap();
    assert_eq!(document.problems(), []);
    document
}

#[test]
fn a_change_is_shown_whole_and_edited_as_a_change() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = change(folder.path());
    assert!(document.file().unwrap().nodes.is_empty());
    let whole = document.whole().unwrap();
    assert!(whole.node_at("view/cull").is_some() && whole.base.is_none());
    assert_eq!(param_text(whole, "interpolate", "sigma"), Some("0.5"));
    assert_eq!(document.base(), Some("epi"));

    document.edit(Tag::Once, |file| file.set_param("view/cull", "threshold", "0.2")).unwrap();
    // Without the change the base's own value applies; over that, the stage's default is written.
    for expected in ["0.7", "0.5", "0.7", "0.5"] {
        document.edit(Tag::Once, |file| remove_param(file, "interpolate", "sigma", "0.5")).unwrap();
        assert_eq!(param_text(document.whole().unwrap(), "interpolate", "sigma"), Some(expected));
    }
    let source = "spread.color".parse().unwrap();
    let end = nodes::End::Input("tonemap", "color");
    document.edit(Tag::Once, |file| nodes::connect(file, "", end, Some(&source))).unwrap();
    // In a part of the base: ports as the part names them.
    for (from, written) in [("project.depth", "view/project.depth"), ("inputs.cloud", "cloud.cloud")] {
        let end = nodes::End::Input("cull", "depth");
        let from = from.parse().unwrap();
        document.edit(Tag::Once, |file| nodes::connect(file, "view", end, Some(&from))).unwrap();
        let held = document.text(document.path()).contains(&format!("\"view/cull.depth\": \"{written}\""));
        assert_eq!(held, written != "view/project.depth", "as in the base, it is no change");
    }
    let told: Vec<String> =
        document.differences().iter().map(|found| format!("{} {}", found.node, found.what)).collect();
    let expected = [
        "tonemap color takes spread.color",
        "view/cull depth takes cloud.cloud",
        "view/cull threshold: 0.2",
        "interpolate sigma: 0.5",
    ];
    assert_eq!(told, expected);
    assert_eq!(document.differences_of("view").count(), 2);
    document.edit(Tag::Once, |file| file.restore_node("view/cull")).unwrap();
    assert_eq!(document.differences_of("view").count(), 0);

    // Another stage keeps the wires that it has too; what it needs from the frame before comes from itself.
    let registry = epigraph_stages::registry();
    document.edit(Tag::Once, |file| swap(file, "interpolate", "fill", &registry)).unwrap();
    let text = document.text(document.path());
    assert!(text.contains(r#""interpolate": (kind: "fill")"#), "{text}");
    let whole = document.whole().unwrap();
    let wire = |port: &str| whole.wire_into("interpolate", port).map(|from| from.to_string());
    assert_eq!(wire("cloud").as_deref(), Some("cloud.cloud"));
    assert_eq!(wire("previous").as_deref(), Some("interpolate.color"));
    document.undo();

    // What a change cannot do is told.
    for refused in [
        document.edit(Tag::Once, |file| nodes::remove(file, &["fill".into(), "spread".into()])),
        document.edit(Tag::Once, |file| nodes::remove(file, &["spread".into()])),
        document.edit(Tag::Once, |file| nodes::add(file, "view", "fill").map(drop)),
        document.edit(Tag::Once, |file| nodes::duplicate(file, &["view/cull".into()]).map(drop)),
        document.edit(Tag::Once, |file| nodes::rename(file, "spread", "other").map(drop)),
        document.edit(Tag::Once, |file| nodes::connect(file, "view", nodes::End::Output("depth"), None)),
    ] {
        let text = refused.unwrap_err().to_string();
        assert!(text.contains("a change cannot") || text.contains("unknown node `fill`"), "{text}");
    }
}

#[test]
fn texts_that_come_with_the_program_stay_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = change(folder.path());
    let paths: Vec<String> = document.paths().map(Into::into).collect();
    let fixed: Vec<&String> = paths.iter().filter(|path| document.is_fixed(path)).collect();
    assert_eq!(
        fixed,
        ["graphs/epi.ron", "graphs/parts/cloud.ron", "graphs/parts/edges.ron", "graphs/parts/view.ron"]
    );
    let before = document.text("graphs/epi.ron").to_owned();
    document.type_text("graphs/epi.ron", "");
    assert_eq!(document.text("graphs/epi.ron"), before);
    assert!(!document.refresh() && !document.is_dirty() && !document.can_undo());
    document.edit(Tag::Once, |file| file.set_param("spread", "rounds", "3")).unwrap();
    document.save().unwrap();
    assert!(fs::read_to_string(document.path()).unwrap().contains("\"spread\": (rounds: 3)"));
    assert!(!Path::new("graphs").exists());
}

#[test]
fn undoing_random_edits_of_a_change_gives_back_every_byte() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = change(folder.path());
    let opened = document.contents.texts.clone();
    let mut random = Random(12);
    let mut changed = 0;
    for _ in 0..600 {
        random_edit(&mut document, &mut random);
        assert_eq!(document.text("graphs/epi.ron"), &*opened["graphs/epi.ron"]);
        changed = changed.max(document.differences().len());
        // Whatever was done, the text that is there is read again as it is.
        let file = document.file().unwrap();
        let again = GraphFile::load_with(Path::new(&file.path), &Known(&document.contents.texts)).unwrap();
        assert_eq!(again.text, file.text);
        again.whole().unwrap();
    }
    assert!(document.past.len() > 150 && changed > 10, "{} edits, {changed} changes", document.past.len());
    while document.can_undo() {
        document.undo();
    }
    for (path, text) in &opened {
        assert_eq!(document.text(path), &**text, "{path}");
    }
    assert!(!document.is_dirty());
}

#[test]
fn a_change_goes_to_another_folder_and_out_in_full() {
    let folder = tempfile::tempdir().unwrap();
    let graphs = shipped(folder.path());
    let epi = graphs.iter().find(|path| path.ends_with("epi.ron")).unwrap();
    fs::write(folder.path().join("mine.wgsl"), "").unwrap();
    fs::create_dir(folder.path().join("deep")).unwrap();
    let registry = epigraph_stages::registry();

    let mut document = Document::new_change(epi, &folder.path().join("change.ron")).unwrap();
    assert!(document.text(document.path()).contains("base: \"epi.ron\""));
    assert!(Document::new_change(epi, &folder.path().join("change.ron")).is_err(), "it is there already");
    document
        .edit(Tag::Once, |file| {
            file.set_kind("spread", "wgsl")?;
            file.set_param("spread", "shader", "\"mine.wgsl\"")?;
            file.set_param("interpolate", "sigma", "0.5")
        })
        .unwrap();
    document.save().unwrap();
    document.save_as(&folder.path().join("deep/change.ron")).unwrap();
    assert_eq!(document.problems(), []);
    let text = document.text(document.path());
    assert!(text.contains("base: \"../epi.ron\"") && text.contains("shader: \"../mine.wgsl\""), "{text}");
    // A base that is a file may be edited in its text.
    let base = folder.path().join("deep/../epi.ron").display().to_string();
    assert!(!document.is_fixed(&base), "{:?}", document.paths().collect::<Vec<_>>());
    let typed = document.text(&base).replace("rounds: 8", "rounds: 9");
    document.type_text(&base, &typed);
    assert_eq!(document.problems(), []);

    document.edit(Tag::Once, |file| file.restore_node("spread")).unwrap();
    let path = folder.path().join("full.ron");
    write(&path, &document.full(&path, &registry).unwrap()).unwrap();
    let mut full = Document::open(&path).unwrap();
    assert_eq!((full.problems().len(), full.base()), (0, None));
    assert_eq!(param_text(full.whole().unwrap(), "spread", "rounds"), Some("9"));
    // Names with slashes are names like any other.
    full.edit(Tag::Once, |file| {
        file.set_param("view/cull", "threshold", "0.3")?;
        assert_eq!(nodes::rename(file, "view/cull", "sieve")?, "sieve");
        assert_eq!(
            nodes::duplicate(file, &["view/project".into(), "sieve".into()])?,
            ["view/project2", "sieve2"]
        );
        nodes::connect(file, "", nodes::End::Input("sieve2", "id"), Some(&"view/project.id".parse().unwrap()))
    })
    .unwrap();
    let file = full.file().unwrap();
    assert_eq!(param_text(file, "sieve", "threshold"), Some("0.3"));
    let wire = |node: &str| {
        file.node(node).unwrap().inputs.iter().find(|input| input.port.value == "depth").cloned()
    };
    assert_eq!(wire("sieve2").unwrap().from.value.to_string(), "view/project2.depth");
    assert_eq!(wire("sieve").unwrap().from.value.to_string(), "view/project.depth");
}

#[test]
fn every_graph_and_experiment_opens_whole() {
    let graphs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
    let registry = epigraph_stages::registry();
    let (mut opened, mut changes) = (0, 0);
    for folder in [graphs.clone(), graphs.join("experiments")] {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|extension| extension != "ron") {
                continue;
            }
            let document = Document::open(&path).unwrap();
            assert_eq!(document.problems(), [], "{}", path.display());
            let whole = document.whole().unwrap();
            assert!(!whole.is_change() && whole.nodes.len() > 2, "{}", path.display());
            assert_eq!(document.base().is_some(), !document.differences().is_empty(), "{}", path.display());
            changes += document.differences().len();
            opened += 1;
            // Beside the graph, the whole is the same graph.
            let full = document.full(&path, &registry).unwrap();
            let full = GraphFile::parse("full.ron", &full).unwrap();
            assert!(!full.is_change() && full.nodes.len() >= whole.nodes.len(), "{}", path.display());
        }
    }
    assert!(opened >= 12 && changes >= 8, "{opened} opened, {changes} changes");
}
