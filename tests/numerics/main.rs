//! The arithmetic of the stages at the extremes of what they may be given, against oracles in f64 and whole numbers.
//! This suite makes the tables of `docs/numerics.md`:
//!
//! ```sh
//! UPDATE_SNAPSHOTS=1 cargo test --release -p epigraph-tests --test numerics
//! ```
//!
//! Each group of stages has a file, with a list of [`Row`]s that is measured once. The document's tables are those
//! rows. A bound that is too small fails where it is exceeded, one that is too large in
//! [`Measure::row`](table::Measure::row).

mod chance;
mod cloud;
mod colors;
mod depth;
mod device;
mod edges;
mod extremes;
mod interval;
mod noise;
mod pixels;
mod project;
mod scenes;
mod streams;
mod table;

use std::{any::Any, collections::BTreeSet, env, fs, panic::catch_unwind, path::Path, sync::LazyLock};

use epigraph_core::testing::{Both, run_both};
use table::Row;

/// The rows of a group of stages, measured at the first use.
type Group = LazyLock<Vec<Row>>;

/// The rows of all these functions.
///
/// # Panics
/// With the messages of all that fail.
fn measured(functions: &[fn() -> Vec<Row>]) -> Vec<Row> {
    let results = functions.iter().map(catch_unwind);
    let (rows, errors): (Vec<_>, Vec<_>) = results.partition(Result::is_ok);
    let text = |error: Box<dyn Any + Send>| error.downcast_ref::<String>().cloned().unwrap_or_default();
    let errors: Vec<_> = errors.into_iter().filter_map(Result::err).map(text).collect();
    assert!(errors.is_empty(), "{} failed:\n{}", errors.len(), errors.join("\n"));
    rows.into_iter().flatten().flatten().collect()
}

/// Titles of the groups, and their rows.
const GROUPS: [(&str, &Group); 11] = [
    ("device", &device::ROWS),
    ("depth", &depth::ROWS),
    ("projection", &project::ROWS),
    ("cloud", &cloud::ROWS),
    ("edges", &edges::ROWS),
    ("pixels", &pixels::ROWS),
    ("colours", &colors::ROWS),
    ("noise", &noise::ROWS),
    ("requests", &chance::ROWS),
    ("scene", &scenes::ROWS),
    ("streams", &streams::ROWS),
];

/// Makes a table with columns of its own.
type Make = fn() -> String;

/// Such tables, by the names of their places in the document.
const TABLES: [(&str, Make); 6] = [
    ("shifts of depths", depth::shifts),
    ("stored depths", depth::encodings),
    ("errors of places", project::errors_in_pixels),
    ("extremes", extremes::cases),
    ("parameters", extremes::parameters),
    ("moved worlds", extremes::moved_worlds),
];

/// The document with its tables made anew. Each has its place between two comments.
fn made_anew(document: &str) -> String {
    let mut tables: Vec<(String, String)> = Vec::new();
    for (title, rows) in GROUPS {
        let lines: Vec<_> = rows.iter().map(|row| row.cells().to_vec()).collect();
        tables.push((title.into(), table::markdown(&Row::HEADINGS, &lines)));
    }
    tables.extend(TABLES.map(|(name, make)| (name.to_owned(), make())));
    let places = document.matches("<!-- table: ").count();
    assert!(places == tables.len(), "docs/numerics.md has {places} places for {} tables", tables.len());
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

#[test]
fn projection_and_depth_hold_what_they_claim() {
    assert!(!depth::ROWS.is_empty() && !project::ROWS.is_empty());
}

#[test]
fn the_cloud_holds_what_it_claims() {
    assert!(!cloud::ROWS.is_empty());
}

#[test]
fn edges_hold_what_they_claim() {
    assert!(!edges::ROWS.is_empty());
}

#[test]
fn regions_and_reachability_hold_what_they_claim() {
    assert!(!pixels::ROWS.is_empty());
}

#[test]
fn colours_hold_what_they_claim() {
    assert!(!colors::ROWS.is_empty());
}

#[test]
fn filters_of_noise_hold_what_they_claim() {
    assert!(!noise::ROWS.is_empty());
}

#[test]
fn the_device_holds_what_wgsl_claims() {
    assert!(!device::ROWS.is_empty());
}

#[test]
fn every_stage_has_a_row() {
    let with: BTreeSet<&str> = GROUPS.iter().flat_map(|(_, rows)| rows.iter().map(Row::stage)).collect();
    let registry = epigraph_stages::registry();
    let without: Vec<&str> =
        registry.kinds().map(|kind| kind.name()).filter(|name| !with.contains(name)).collect();
    // A part is the nodes that it includes.
    assert!(without.iter().all(|name| *name == "graph"), "{without:?} have no row");
}

#[test]
fn requests_hold_what_they_claim() {
    assert!(!chance::ROWS.is_empty());
}

#[test]
fn samples_and_motion_hold_what_they_claim() {
    assert!(!scenes::ROWS.is_empty());
}

#[test]
fn point_sets_hold_what_they_claim() {
    assert!(!streams::ROWS.is_empty());
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
