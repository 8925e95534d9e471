//! The arithmetic of the stages at the extremes of what they may be given, against oracles in f64 and whole numbers; and
//! `docs/numerics.md`, whose tables this suite makes:
//!
//! ```sh
//! UPDATE_SNAPSHOTS=1 cargo test --release -p epigraph-tests --test numerics
//! ```
//!
//! Each group of stages has a file, with a list of [`Row`]s that is measured once. The document's tables are those rows;
//! a bound that is too small fails where it is exceeded, one that is too large in [`Measure::row`](table::Measure::row).

mod depth;
mod interval;
mod table;

use std::{env, fs, path::Path, sync::LazyLock};

use epigraph_core::testing::{Both, run_both};
use table::Row;

/// The rows of a group of stages, measured at the first use.
type Group = LazyLock<Vec<Row>>;

/// Titles of the groups, and their rows.
const GROUPS: [(&str, &Group); 1] = [("Projection and depth", &depth::ROWS)];

/// Makes a table with columns of its own.
type Make = fn() -> String;

/// Such tables, by the names of their places in the document.
const TABLES: [(&str, Make); 2] = [("shifts of depths", depth::shifts), ("stored depths", depth::encodings)];

/// The document with its tables made anew. Each has its place between two comments.
fn made_anew(document: &str) -> String {
    let mut tables: Vec<(String, String)> = Vec::new();
    for (title, rows) in GROUPS {
        let lines: Vec<_> = rows.iter().map(|row| row.cells().to_vec()).collect();
        tables.push((title.into(), table::markdown(&Row::HEADINGS, &lines)));
    }
    tables.extend(TABLES.map(|(name, make)| (name.to_owned(), make())));
    let mut text = document.to_owned();
    for (name, table) in tables {
        let (start, end) = (format!("<!-- table: {name} -->\n"), "<!-- end -->");
        let from = text.find(&start).unwrap_or_else(|| panic!("docs/numerics.md has no place for `{name}`"))
            + start.len();
        let to = from + text[from..].find(end).unwrap_or_else(|| panic!("`{name}` has no end"));
        text.replace_range(from..to, &table);
    }
    text
}

/// The text without what depends on the driver: the last column of tables, which is the GPU's.
fn without_gpu(text: &str) -> String {
    let strip = |line: &str| match line.strip_prefix("| ").and_then(|line| line.strip_suffix(" |")) {
        Some(cells) => cells.rsplit_once(" | ").map_or("", |(cells, _)| cells).to_owned(),
        None => line.to_owned(),
    };
    text.lines().map(strip).collect::<Vec<_>>().join("\n")
}

/// The figures of the CPU are the same on every machine, but for the last digit of mathematical functions; those of the
/// GPU depend on its driver, and only have to hold the bound.
#[test]
fn the_documents_tables_are_what_is_measured() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/numerics.md");
    let document = fs::read_to_string(&path).expect("docs/numerics.md");
    let made = made_anew(&document);
    if env::var_os("UPDATE_SNAPSHOTS").is_some() {
        fs::write(&path, &made).expect("docs/numerics.md can be written");
        return;
    }
    let [old, new] = [&document, &made].map(|text| without_gpu(text));
    let lines = old.lines().zip(new.lines()).filter(|(old, new)| old != new);
    let changed: Vec<_> = lines.map(|(old, new)| format!("- {old}\n+ {new}\n")).collect();
    assert!(
        old == new,
        "docs/numerics.md is out of date; with UPDATE_SNAPSHOTS=1 this test writes it:\n{}",
        changed.concat()
    );
}

/// Runs a frame of both sides, with the shaders' modules.
#[track_caller]
fn both<S: epigraph_core::Stage>(harness: &mut epigraph_core::Harness<S>) -> Both {
    run_both(harness, &epigraph_stages::registry())
}
