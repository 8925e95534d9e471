//! `epigraph stages --new`: a stage to begin with, as a shader file or as a package in Rust.

use std::path::Path;

use epigraph::{Registry, graphs};
use epigraph_files::{text, write_folder};

use crate::{
    error::CliError,
    output::{Outputs, print},
};

/// The checkout that this program was built from. Elsewhere the packages are found by their version.
const CHECKOUT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// The packages that a stage needs, with their folders in the checkout. Macros expect `epigraph-core` under its name.
const PACKAGES: [(&str, &str); 4] =
    [("epigraph", "run"), ("epigraph-cli", "cli"), ("epigraph-core", "core"), ("epigraph-stages", "stages")];

/// The name that the starters' files have in the place of the stage's.
const STARTER: &str = "STARTER";

/// The shader, with the comments that make it a stage without Rust.
const SHADER: &str = include_str!("starter/shader.wgsl");

/// Writes the files and says what to do with them.
///
/// # Errors
/// A name that cannot be a stage's, or a file that exists.
pub fn write(path: &Path, rust: bool, outputs: Outputs, registry: &Registry) -> Result<(), CliError> {
    let name = name(path, registry)?;
    let text = if rust { package(path, &name)? } else { shader(path, &name, outputs)? };
    print(&text)
}

/// The stage's name: the last part of the path.
fn name(path: &Path, registry: &Registry) -> Result<String, CliError> {
    let refuse = |why: &str| Err(CliError::Input(format!("--new {}: {why}", path.display())));
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return refuse("name the stage, for example `--new glow`");
    };
    let name = name.strip_suffix(".wgsl").unwrap_or(name);
    let fits = |char: char| char.is_ascii_lowercase() || char.is_ascii_digit() || char == '_';
    if !name.starts_with(|first: char| first.is_ascii_lowercase()) || !name.chars().all(fits) {
        return refuse("a stage's name has small letters, digits and underscores, and begins with a letter");
    }
    if registry.get(name).is_some() {
        return refuse("there is such a kind of stage; choose another name");
    }
    if graphs::load("epi", registry)?.node(name).is_some() {
        return refuse("the graph `epi`, which the new stage is put into, has a node of this name");
    }
    Ok(name.to_owned())
}

/// Writes a shader file and a graph with it.
fn shader(path: &Path, name: &str, mut outputs: Outputs) -> Result<String, CliError> {
    let params = format!("shader: \"{name}.wgsl\", amount: 0.5");
    let texts = [SHADER.replace(STARTER, name), graph(name, "wgsl", &params, "epigraph")];
    let paths = ["wgsl", "ron"].map(|ending| path.with_file_name(format!("{name}.{ending}")));
    let mut files = Vec::new();
    for (path, text) in paths.iter().zip(texts) {
        absent(path)?;
        files.push((outputs.add("--new", path)?, text));
    }
    let mut outputs = outputs.ready()?;
    for (file, text) in files {
        outputs.put(file, text.as_bytes())?;
    }
    outputs.commit()?;
    let [shader, graph] = paths.each_ref().map(|path| path.display());
    Ok(format!(
        "wrote {shader} and {graph}\n\n\
         render it:            epigraph {graph}\n\
         how it is understood: epigraph stages {shader}\n\
         what it can declare:  epigraph stages wgsl\n\
         edit it and watch:    epigraph-editor {graph}\n"
    ))
}

/// Writes a package.
fn package(path: &Path, name: &str) -> Result<String, CliError> {
    absent(path)?;
    let checkout =
        Path::new(CHECKOUT).canonicalize().ok().filter(|root| root.join("run/Cargo.toml").exists());
    let version = env!("CARGO_PKG_VERSION");
    let packages = PACKAGES.map(|(package, folder)| match &checkout {
        Some(root) => format!("{package} = {{ path = {:?} }}", root.join(folder)),
        None => format!("{package} = \"{version}\""),
    });
    let type_name: String = name
        .split('_')
        .flat_map(|word| {
            let mut chars = word.chars();
            chars.next().map(|first| first.to_ascii_uppercase()).into_iter().chain(chars)
        })
        .collect();
    let fill = |text: &str| {
        text.replace(STARTER, name).replace("Starter", &type_name).replace("EPIGRAPH", &packages.join("\n"))
    };

    let mut files = vec![
        ("Cargo.toml".to_owned(), fill(include_str!("starter/package/manifest.toml"))),
        ("src/lib.rs".into(), fill(include_str!("starter/package/lib.rs"))),
        ("src/main.rs".into(), fill(include_str!("starter/package/main.rs"))),
        ("src/stage.rs".into(), fill(include_str!("starter/package/stage.rs"))),
        (format!("shaders/{name}.wgsl"), fill(&bare_shader())),
        (format!("{name}.ron"), graph(name, name, "amount: 0.5", "cargo run --release --")),
    ];
    let built = match &checkout {
        Some(root) => format!("; --target-dir {} takes what is built there", root.join("target").display()),
        None => String::new(),
    };
    // The versions that Epigraph is tested with.
    if let Some(lock) = checkout.as_ref().and_then(|root| text(&root.join("Cargo.lock")).ok()) {
        files.push(("Cargo.lock".into(), lock));
    }
    write_folder(path, &files)?;
    let listed: Vec<&str> = files.iter().map(|(file, _)| file.as_str()).collect();
    Ok(format!(
        "wrote {}: {}\n\n\
         go there:             cd {}\n\
         test it:              cargo test --release\n\
         render on the CPU:    cargo run --release -- {name}.ron\n\
         render on the GPU:    cargo run --release -- {name}.ron --backend gpu --size 256x256 --frames 10\n\n\
         The first build takes minutes{built}.\n",
        path.display(),
        listed.join(", "),
        path.display(),
    ))
}

/// The shader of a stage in Rust, which declares itself what the comments declare.
fn bare_shader() -> String {
    let code = SHADER.split("\n\n").filter(|block| !block.starts_with("// A stage in one file"));
    let code = code.collect::<Vec<_>>().join("\n\n").replacen("//!", "//", 1);
    let lines = code.split_inclusive('\n').filter(|line| !line.trim_start().starts_with("///"));
    lines.collect()
}

/// The graph with the stage in it.
fn graph(name: &str, kind: &str, params: &str, program: &str) -> String {
    let text = include_str!("starter/graph.ron").replace(STARTER, name).replace("PROGRAM", program);
    text.replace("KIND,", &format!("\"{kind}\",")).replace("PARAMS", params)
}

/// Checks that a file does not exist.
fn absent(path: &Path) -> Result<(), CliError> {
    if path.exists() {
        return Err(CliError::write(path, "it exists; choose another name"));
    }
    Ok(())
}
