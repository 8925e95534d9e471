//! No other package reads or writes files by itself: each file is read up to a limit, and written whole or not at all.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// What reads or writes files, or begins to.
const CALLS: [&str; 12] = [
    "fs::read(",
    "fs::read_to_string",
    "fs::write(",
    "fs::copy(",
    "fs::rename(",
    "fs::hard_link(",
    "File::open",
    "File::create",
    "OpenOptions",
    "NamedTempFile",
    "tempfile::",
    "image::open",
];

/// Packages whose code programs run; tests and build scripts may do as they like.
const PACKAGES: [&str; 11] = [
    "core", "stages", "scenes", "pictures", "streams", "points", "graphs", "run", "cli", "editor", "shaders",
];

/// The editor's list of its widgets, which it writes in every frame for a program that drives it, is no user's file.
const EXCEPT: &str = "editor/src/widgets.rs";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace")
}

/// All source files below a folder that are no tests.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let is_test = |path: &PathBuf| path.file_stem().is_some_and(|name| name == "tests" || name == "build");
    let entries =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).filter(|path| !is_test(path));
    let files = entries.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] });
    files.filter(|path| path.extension().is_some_and(|ending| ending == "rs")).collect()
}

/// The lines that call one of [`CALLS`], without comments and without the tests at the end.
fn calls(text: &str) -> Vec<&str> {
    let code = text.lines().take_while(|line| !line.starts_with("#[cfg(test)]"));
    let code = code.filter(|line| !line.trim_start().starts_with("//"));
    code.filter(|line| CALLS.iter().any(|call| line.contains(call))).collect()
}

#[test]
fn files_are_read_and_written_here_only() {
    let mut found = Vec::new();
    for path in PACKAGES.iter().flat_map(|package| sources(&root().join(package))) {
        if path == root().join(EXCEPT) {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        found.extend(calls(&text).into_iter().map(|line| format!("{}: {}", path.display(), line.trim())));
    }
    assert!(found.is_empty(), "use epigraph_files:\n{}", found.join("\n"));
}

/// A command that makes a [`epigraph_files::Target`] by itself could replace its own input.
#[test]
fn commands_write_through_their_outputs() {
    let mut writers: Vec<String> = sources(&root().join("cli/src"))
        .into_iter()
        .filter(|path| fs::read_to_string(path).unwrap().contains("Target::new"))
        .map(|path| path.strip_prefix(root()).unwrap().display().to_string())
        .collect();
    writers.sort();
    // The folder makes one to see whether it can be made. What `tradeoff` keeps in its folder it reads and replaces.
    assert_eq!(writers, ["cli/src/folder.rs", "cli/src/output.rs", "cli/src/tradeoff/store.rs"]);
}

#[test]
fn calls_are_found() {
    let text = "// fs::read(a)\nlet a = std::fs::read(path)?;\nlet b = text(path)?;\n#[cfg(test)]\nfs::write(path, a);\n";
    assert_eq!(calls(text), ["let a = std::fs::read(path)?;"]);
    assert!(sources(&root().join("files")).iter().any(|path| path.ends_with("src/write.rs")));
    assert_eq!(sources(&root().join("shaders")), [root().join("shaders/lib.rs")]);
}
