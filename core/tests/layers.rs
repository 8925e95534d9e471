//! The crate's modules lie in layers: no module uses another that uses it in turn, directly or through others.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use petgraph::{algo::tarjan_scc, graph::DiGraph};

/// All source files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
}

/// A file's lines without comments and without the tests at its end.
fn code(text: &str) -> String {
    let lines = text.lines().take_while(|line| !line.starts_with("#[cfg(test)]"));
    lines.filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// The names that follow `crate::` in some code, alone or in a list.
fn names(code: &str) -> BTreeSet<&str> {
    let mut names = BTreeSet::new();
    for (at, found) in code.match_indices("crate::") {
        // Macros write `$crate::`, which is resolved where they are used.
        if code[..at].ends_with(|before: char| before == '$' || before == '_' || before.is_alphanumeric()) {
            continue;
        }
        let rest = &code[at + found.len()..];
        match rest.strip_prefix('{') {
            Some(list) => names.extend(listed(list)),
            None => names.extend(name(rest)),
        }
    }
    names
}

fn name(text: &str) -> Option<&str> {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').next().filter(|name| !name.is_empty())
}

/// The first name of each item of a list, up to the brace that closes it.
fn listed(list: &str) -> Vec<&str> {
    let (mut names, mut depth, mut start) = (Vec::new(), 0, 0);
    for (at, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                names.extend(name(list[start..at].trim_start()));
                start = at + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    names
}

/// Each module of the crate with those that it uses.
fn modules() -> BTreeMap<String, BTreeSet<String>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut modules: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for path in sources(&root) {
        let first = path.strip_prefix(&root).unwrap().components().next().unwrap();
        let module = Path::new(first.as_os_str()).file_stem().unwrap().to_str().unwrap().to_owned();
        let text = fs::read_to_string(&path).unwrap();
        let uses = modules.entry(module.clone()).or_default();
        uses.extend(names(&code(&text)).into_iter().map(str::to_owned).filter(|used| *used != module));
    }
    modules.remove("lib");
    modules
}

/// The groups of modules that use each other in a circle.
fn circles(modules: &BTreeMap<String, BTreeSet<String>>) -> Vec<Vec<&str>> {
    let mut graph = DiGraph::new();
    let nodes: BTreeMap<&str, _> = modules.keys().map(|name| (&**name, graph.add_node(&**name))).collect();
    for (module, uses) in modules {
        for used in uses {
            // A name at the root of the crate would hide which module it comes from.
            let used = nodes.get(&**used).unwrap_or_else(|| panic!("{module}: `crate::{used}` is no module"));
            graph.update_edge(nodes[&**module], *used, ());
        }
    }
    let groups = tarjan_scc(&graph).into_iter().filter(|group| group.len() > 1);
    groups.map(|group| group.into_iter().map(|node| graph[node]).collect()).collect()
}

#[test]
fn no_modules_use_each_other_in_a_circle() {
    let modules = modules();
    assert!(modules["executor"].contains("plan") && modules["plan"].contains("graph"), "{modules:?}");
    assert_eq!(circles(&modules), Vec::<Vec<&str>>::new());
}

#[test]
fn a_circle_is_found() {
    let mut modules = modules();
    modules.get_mut("stage").unwrap().insert("executor".into());
    let circles = circles(&modules);
    assert!(
        circles.iter().any(|circle| circle.contains(&"stage") && circle.contains(&"plan")),
        "{circles:?}"
    );
}

#[test]
fn what_runs_lies_above_what_is_only_a_value() {
    let modules = modules();
    let users = |of: &str| -> Vec<&str> {
        modules.iter().filter(|(_, uses)| uses.contains(of)).map(|(name, _)| &**name).collect()
    };
    assert_eq!(users("wgsl"), Vec::<&str>::new());
    assert_eq!(users("testing"), Vec::<&str>::new());
    assert_eq!(users("harness"), ["testing"]);
    assert_eq!(users("executor"), ["harness", "testing"]);
    // Plans come from graphs alone.
    assert!(["registry", "file", "reflect"].iter().all(|above| !modules["plan"].contains(*above)));
}

#[test]
fn names_are_found_in_every_form() {
    let code = code(
        "use crate::{\n    a::{B, C},\n    d,\n};\n// crate::comment\nfn f(x: crate::e::F) { $crate::g() }\nuse crate::h;",
    );
    assert_eq!(names(&code).into_iter().collect::<Vec<_>>(), ["a", "d", "e", "h"]);
}
