//! Constants that a shader and its twin share are declared once, in Rust.
//!
//! A shader may declare only constants that its twin does not have: the size of a workgroup and numbers derived from
//! it, the length of a list that only the shader uses, the markers of a loop.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use epigraph_core::{Constant, ParamKind};

/// The Rust files in a folder and its subfolders, each with its text.
fn rust_files(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            files.push((path, text));
        }
    }
    files
}

/// The names of the numeric constants that a Rust or WGSL text declares.
fn numbers(text: &str) -> BTreeSet<&str> {
    let name = |line| -> Option<&str> {
        let (_, declared): (&str, &str) = str::split_once(line, "const ")?;
        let (name, rest) = declared.split_once(':')?;
        let (ty, _) = rest.split_once('=')?;
        ["u32", "usize", "i32", "f32"].contains(&ty.trim()).then_some(name)
    };
    text.lines().filter_map(name).collect()
}

#[test]
fn no_shader_declares_a_constant_of_its_twin() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let rust = rust_files(&source);
    for (path, wgsl) in epigraph_shaders::FILES {
        let name = Path::new(path).with_extension("rs");
        let is_twin = |twin: &Path| twin.ends_with(&name) || twin.starts_with(source.join("shared"));
        for (twin, text) in rust.iter().filter(|(twin, _)| is_twin(twin)) {
            let both: Vec<_> = numbers(wgsl).intersection(&numbers(text)).copied().collect();
            assert!(both.is_empty(), "{path} and {} both declare {both:?}: use `constants!`", twin.display());
        }
    }
}

#[test]
fn the_twin_defines_every_name_after_ifdef() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let rust = rust_files(&source);
    let mut found = 0;
    for (path, wgsl) in epigraph_shaders::FILES {
        let name = Path::new(path).with_extension("rs");
        let condition = |line: &'static str| {
            let line = line.trim_start();
            line.strip_prefix("#ifdef ").or_else(|| line.strip_prefix("#ifndef ")).map(str::trim)
        };
        for define in wgsl.lines().filter_map(condition) {
            let quoted = format!("\"{define}\"");
            let is_twin = |twin: &Path| path.starts_with("shared/") || twin.ends_with(&name);
            let defines = |(twin, text): &(PathBuf, String)| is_twin(twin) && text.contains(&quoted);
            assert!(rust.iter().any(defines), "{path}: nothing defines {define}");
            found += 1;
        }
    }
    assert!(found > 20, "{found}");
}

#[test]
fn shaders_name_the_variants_of_choices() {
    for kind in epigraph_stages::registry().kinds() {
        let Some(shader) = kind.declaration().and_then(|declaration| declaration.shader) else { continue };
        for param in kind.specs().iter().filter(|spec| matches!(spec.kind, ParamKind::Choice(_))) {
            let read = format!("params.{}", param.name);
            for after in shader.source.split(&read).skip(1) {
                let compared = after.trim_start_matches([' ', '=', '!']);
                let names = Constant::of_choice(param);
                let is_named = names.iter().any(|constant| compared.starts_with(constant.name()));
                // A `switch` may use the variants' names as cases.
                assert!(
                    is_named || after.starts_with(" {"),
                    "{}: `{read}{}`",
                    shader.name,
                    after.lines().next().unwrap()
                );
            }
        }
    }
}

#[test]
fn shaders_use_all_constants_of_their_stages() {
    for kind in epigraph_stages::registry().kinds() {
        let Some(shader) = kind.declaration().and_then(|declaration| declaration.shader) else { continue };
        let specs = kind.specs();
        let choices: Vec<Constant> = specs.iter().flat_map(Constant::of_choice).collect();
        for constant in shader.constants.iter().filter(|constant| !choices.contains(constant)) {
            let words = shader.source.split(|c: char| !c.is_alphanumeric() && c != '_');
            assert!(words.into_iter().any(|word| word == constant.name()), "{}: {constant:?}", shader.name);
        }
    }
}
