//! `docs/wgsl.md` says what is so: its tables are those of the parser and of the modules, its worked values are computed,
//! its examples run.

use std::{collections::BTreeMap, env, fs, path::PathBuf, process};

use epigraph::graphs;
use epigraph_core::{GraphFile, Registry, Settings, ShaderModule, Side, WgslFile, imports, wgsl_clauses};
use epigraph_tests::{Run, Stage, sampled};

fn document() -> String {
    fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/wgsl.md")).unwrap()
}

/// The text between a heading and the next one of the same or a higher level.
fn section<'t>(text: &'t str, heading: &str) -> &'t str {
    let start = text.find(&format!("\n{heading}\n")).unwrap_or_else(|| panic!("no section {heading}"));
    let rest = &text[start + 1..];
    let level = heading.chars().take_while(|c| *c == '#').count();
    let is_end = |line: &str| {
        let hashes = line.chars().take_while(|c| *c == '#').count();
        (1..=level).contains(&hashes) && line[hashes..].starts_with(' ')
    };
    let lines = rest.split_inclusive('\n').skip(1).take_while(|line| !is_end(line));
    &rest[..lines.map(str::len).sum::<usize>() + heading.len() + 1]
}

/// The rows of all tables of a text, cell by cell, without headings. A code span's marks are left out.
fn rows(text: &str) -> Vec<Vec<String>> {
    let cells = |line: &str| -> Vec<String> {
        let line = line.trim().trim_matches('|').replace("\\|", "\u{1}");
        line.split('|').map(|cell| cell.trim().replace('\u{1}', "|")).collect()
    };
    let lines: Vec<&str> = text.lines().collect();
    let is_row = |index: usize| {
        let line = lines[index];
        let is_rule = |index: usize| lines.get(index).is_some_and(|line| line.starts_with("|---"));
        line.starts_with('|') && !is_rule(index) && !is_rule(index + 1)
    };
    (0..lines.len()).filter(|&index| is_row(index)).map(|index| cells(lines[index])).collect()
}

/// What is between the marks of a code span.
fn code(cell: &str) -> &str {
    let inner = cell.strip_prefix('`').and_then(|rest| rest.strip_suffix('`'));
    inner.unwrap_or_else(|| panic!("`{cell}` is no code"))
}

#[test]
fn the_declarations_are_those_of_the_parser() {
    let text = document();
    let headings = [
        ("a port", "### Ports"),
        ("a parameter", "### Parameters"),
        ("an entry point", "### Passes"),
        ("the file", "### The file"),
    ];
    for (subject, heading) in headings {
        let written: Vec<(String, String)> = rows(section(&text, heading))
            .into_iter()
            .map(|row| (code(&row[0]).to_owned(), row[1].clone()))
            .collect();
        let clauses = wgsl_clauses().into_iter().filter(|clause| clause.subject == subject);
        let known: Vec<(String, String)> =
            clauses.map(|clause| (clause.form.to_owned(), clause.doc.to_owned())).collect();
        assert_eq!(written, known, "{heading}");
    }
    assert!(
        wgsl_clauses().iter().all(|clause| headings.iter().any(|(subject, _)| clause.subject == *subject))
    );
}

/// What a module declares: the text of each function, struct, constant and variable by its name.
fn declared(module: &ShaderModule) -> BTreeMap<String, String> {
    let code: Vec<&str> = module.source.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let code = code.join("\n");
    let spaced = |text: &str| {
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        text.replace(", }", " }").replace(",)", ")").replace("( ", "(")
    };
    let mut found = BTreeMap::new();
    for item in code.split("\n").map(str::trim_end).enumerate().filter(|(_, line)| !line.starts_with(' ')) {
        let (index, line) = item;
        let rest = code.split('\n').skip(index).collect::<Vec<_>>().join("\n");
        let name = |text: &str| text.split(['(', ':', ' ', '{']).next().unwrap_or_default().to_owned();
        if let Some(function) = line.strip_prefix("fn ") {
            let signature = rest.strip_prefix("fn ").unwrap().split('{').next().unwrap_or_default();
            found.insert(name(function), spaced(signature));
        } else if let Some(structure) = line.strip_prefix("struct ") {
            let body = rest.split_inclusive('}').next().unwrap_or_default();
            found.insert(name(structure), spaced(body));
        } else if let Some(constant) = line.strip_prefix("const ") {
            found.insert(name(constant), spaced(constant.split('=').next().unwrap_or_default()));
        } else if let Some((_, variable)) = line.split_once("> ").filter(|_| line.contains("var<")) {
            found.insert(name(variable), spaced(variable.trim_end_matches(';')));
        }
    }
    for constant in &module.constants {
        found.insert(constant.name().to_owned(), format!("{}: {}", constant.name(), constant.ty()));
    }
    found
}

#[test]
fn the_modules_are_documented_function_by_function() {
    let registry = epigraph_stages::registry();
    let text = document();
    let imports = section(&text, "## Imports");
    let known: Vec<String> =
        registry.library.modules.iter().map(|module| format!("`{}`", module.import())).collect();
    let headings: Vec<&str> = imports.lines().filter_map(|line| line.strip_prefix("### ")).collect();
    let mut sorted = headings.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, known, "the modules of shaders/shared/ and the headings");
    for module in &registry.library.modules {
        let written = rows(section(imports, &format!("### `{}`", module.import())));
        let name = |text: &str| {
            let text = text.strip_prefix("struct ").unwrap_or(text);
            text.split(['(', ':', ' ', '{']).next().unwrap_or_default().to_owned()
        };
        let written: BTreeMap<String, String> =
            written.iter().map(|row| (name(code(&row[0])), code(&row[0]).to_owned())).collect();
        assert_eq!(written, declared(module), "{}", module.name);
    }
}

/// A folder with these files, removed with it.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, files: &[(String, String)]) -> Self {
        let folder = Self(env::temp_dir().join(format!("epigraph-docs-{name}-{}", process::id())));
        fs::create_dir_all(&folder.0).unwrap();
        for (name, text) in files {
            fs::write(folder.0.join(name), text).unwrap();
        }
        folder
    }

    fn graph(&self, name: &str) -> GraphFile {
        let path = self.0.join(name);
        graphs::load(path.to_str().unwrap(), &epigraph_stages::registry())
            .unwrap_or_else(|problems| panic!("{problems}"))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Left behind it does no harm.
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn run(graph: &GraphFile, frames: u32) -> Run {
    run_with(graph, frames, Settings { poison: true, ..sampled([61, 43], 0.1) })
}

fn run_with(graph: &GraphFile, frames: u32, settings: Settings) -> Run {
    let settings = Settings { side: Side::Gpu, ..settings };
    let mut run = Run::new(graph, Stage { scene: "cornell", camera: "orbit", settings });
    run.frames(frames);
    run
}

/// Evaluates comparisons on the GPU; returns those that do not hold.
fn wrong(registry: &Registry, pairs: &[(String, String)]) -> Vec<String> {
    let modules = registry.library.modules.iter().map(|module| format!("#import {}\n", module.import()));
    let compared = pairs.iter().enumerate().map(|(index, (expression, value))| {
        format!("    right[{index}] = u32(all(({expression}) == ({value})));\n")
    });
    let shader = format!(
        "{}/// = output, {} elements\n@group(0) @binding(1) var<storage, read_write> right: array<u32>;\n\
         @compute @workgroup_size(1) fn main() {{\n{}}}\n",
        modules.collect::<String>(),
        pairs.len(),
        compared.collect::<String>()
    );
    let graph = r#"Graph(version: 1, nodes: { "values": (kind: "wgsl", params: (shader: "values.wgsl")) },
        outputs: { "right": "values.right" })"#;
    let name = format!("values-{}", pairs.len());
    let folder =
        Folder::new(&name, &[("values.wgsl".into(), shader), ("values.ron".into(), graph.to_owned())]);
    let right = run(&folder.graph("values.ron"), 1).captured("right").get::<u32>();
    let wrong = pairs.iter().zip(right).filter(|(_, right)| *right == 0);
    wrong.map(|((expression, value), _)| format!("{expression} is not {value}")).collect()
}

#[test]
fn the_worked_values_are_what_the_shaders_compute() {
    let text = document();
    let table = rows(section(&text, "## Encodings")).into_iter().filter(|row| row[1].starts_with('`'));
    let pairs: Vec<(String, String)> =
        table.map(|row| (code(&row[0]).to_owned(), code(&row[1]).to_owned())).collect();
    assert!(pairs.len() > 20, "{pairs:?}");
    let registry = epigraph_stages::registry();
    assert_eq!(wrong(&registry, &pairs), [""; 0]);
    let other = [("decode_radiance(0x81010100u)".into(), "vec3(1.0, 0.5, 0.3)".into()), pairs[1].clone()];
    assert_eq!(wrong(&registry, &other).len(), 1, "the comparison can fail");
}

/// The files of the examples: the name stands in the line before each block.
fn examples(text: &str) -> Vec<(String, String)> {
    let mut files = Vec::new();
    let mut blocks = text.split("\n```");
    let mut before = blocks.next().unwrap_or_default();
    while let (Some(block), Some(after)) = (blocks.next(), blocks.next()) {
        let name = before.trim_end().rsplit('\n').next().unwrap_or_default();
        let name = name.strip_prefix('`').and_then(|name| name.strip_suffix("`:"));
        let (_, body) = block.split_once('\n').expect("a block has lines");
        files.extend(name.map(|name| (name.to_owned(), format!("{body}\n"))));
        before = after;
    }
    files
}

#[test]
fn the_examples_run() {
    let text = document();
    let files = examples(section(&text, "## Examples"));
    let folder = Folder::new("examples", &files);
    let registry = epigraph_stages::registry();
    let graphs: Vec<&String> =
        files.iter().map(|(name, _)| name).filter(|name| name.ends_with(".ron")).collect();
    assert_eq!((graphs.len(), files.len()), (6, 12));
    let shipped = run(&graphs::load("epi", &registry).unwrap(), 4).captured("image");
    for name in graphs {
        let shader = name.replace(".ron", ".wgsl");
        let file = WgslFile::load(&folder.0.join(&shader), &registry).unwrap_or_else(|p| panic!("{p}"));
        assert!(!file.doc.is_empty(), "{shader} has a line of documentation");
        assert!(
            file.specs.iter().all(|spec| !spec.doc.is_empty()),
            "{shader}: every parameter has a sentence"
        );
        let image = run(&folder.graph(name), 4).captured("image");
        run_with(&folder.graph(name), 4, Settings { watch: true, ..sampled([61, 43], 0.1) });
        let differ = image.bytes.iter().zip(&shipped.bytes).filter(|(a, b)| a != b).count();
        println!("{name}: {differ} of {} bytes differ from epi", image.bytes.len());
        assert!(differ > image.bytes.len() / 100, "{name}: {differ} bytes");
    }
}

#[test]
fn examples_that_are_shipped_are_the_shipped_files() {
    let files = examples(&document());
    for name in ["accumulate", "atrous"] {
        for ending in ["wgsl", "ron"] {
            let path = format!("{}/../graphs/experiments/{name}.{ending}", env!("CARGO_MANIFEST_DIR"));
            let shipped = fs::read_to_string(path).unwrap();
            // The comment above the graph is its figures.
            let start = if ending == "ron" { shipped.find("Graph(").unwrap() } else { 0 };
            let (_, shown) = files.iter().find(|(file, _)| *file == format!("{name}.{ending}")).unwrap();
            assert_eq!(shown.trim(), shipped[start..].trim(), "{name}.{ending}");
        }
    }
}

#[test]
fn all_imports_of_the_examples_are_used() {
    for (name, text) in examples(&document()).iter().filter(|(name, _)| name.ends_with(".wgsl")) {
        let registry = epigraph_stages::registry();
        for import in imports(text) {
            let module = registry.library.module(import).unwrap_or_else(|| panic!("{name}: {import}"));
            let is_used = declared(module).keys().any(|known| {
                text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == known)
            });
            assert!(is_used, "{name} uses nothing of {import}");
        }
    }
}
