//! Lists the folder's graphs, so that a new one need not be named anywhere.

use std::{env, fs, path::Path};

fn main() {
    println!("cargo::rerun-if-changed=.");
    let root = env::var("CARGO_MANIFEST_DIR").expect("set by Cargo");
    let mut files: Vec<String> = Vec::new();
    for folder in ["", "parts/"] {
        let entries = fs::read_dir(Path::new(&root).join(folder)).expect("a folder of this package");
        let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        files.extend(names.filter(|name| name.ends_with(".ron")).map(|name| format!("{folder}{name}")));
    }
    files.sort();
    let pairs =
        files.iter().map(|file| format!("({file:?}, include_str!({:?})),\n", Path::new(&root).join(file)));
    let out = env::var("OUT_DIR").expect("set by Cargo");
    fs::write(Path::new(&out).join("files.rs"), format!("&[\n{}]", pairs.collect::<String>()))
        .expect("writable");
}
