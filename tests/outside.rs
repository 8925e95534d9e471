//! Epigraph as a dependency: the packages contain all files that they need, a package outside the workspace adds a
//! stage, and every selection of packages builds the same libraries. The tests call Cargo and share the workspace's
//! target folder, so that the dependencies are not built again.

mod own_stage;

use std::{collections::BTreeSet, env, fs, process::Command};

use epigraph_pictures::{Difference, Picture};
use own_stage::{build, cargo, fresh, package, root, run, target};

#[test]
fn every_package_compiles_from_its_own_files() {
    fresh(target().join("package"));
    cargo(root(), &["package", "--workspace", "--no-verify", "--allow-dirty"]);
    let folder = fresh(target().join("packaged"));
    let mut manifest =
        String::from("[workspace]\nresolver = \"3\"\nmembers = [\"*\"]\n\n[patch.crates-io]\n");
    for entry in fs::read_dir(target().join("package")).unwrap().map(Result::unwrap) {
        let Some(package) =
            entry.file_name().to_str().and_then(|name| name.strip_suffix(".crate").map(str::to_owned))
        else {
            continue;
        };
        // -m gives all files the present time: Cargo compares times, and all files of a package have the same old one.
        run(Command::new("tar").arg("-xzmf").arg(entry.path()).arg("-C").arg(&folder));
        let (name, _) = package.rsplit_once('-').expect("name and version");
        manifest += &format!("{name} = {{ path = \"{package}\" }}\n");
    }
    fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    cargo(&folder, &["check", "--release", "--workspace"]);
}

/// The test of the package's editor is in `editor/tests/real_window.rs`.
#[test]
fn a_package_of_ones_own_adds_a_stage() {
    let folder = package();
    // The package's own tests: its shader and its twin agree.
    cargo(&folder, &["test", "--release", "--lib"]);

    let program = build(&folder, "own_stage", &[]);
    let own_stage = |words: &str| run(Command::new(&program).current_dir(&folder).args(words.split(' ')));
    assert!(own_stage("stages median").contains("factor"));
    let picture = |name: &str, words: &str| {
        own_stage(&format!("render median.ron --size 96x64 --frames 8 --samples 20% --out {name} {words}"));
        Picture::read(&folder.join(name)).unwrap()
    };
    let cpu = picture("cpu.png", "--backend cpu");
    let gpu = picture("gpu.png", "--backend gpu");
    let without = picture("without.png", "--backend cpu --set median.factor=100");
    // The same limit as for all graphs, as rounding may move a request for a sample.
    assert!(Difference::new(&cpu, &gpu).flip() < 0.002);
    assert!(Difference::new(&cpu, &without).flip() > 0.002);

    // A package that the program begins passes its tests as it is, and its stage has an effect.
    own_stage("stages --new shine --rust");
    let shine = folder.join("shine");
    cargo(&shine, &["test", "--release", "--lib"]);
    let program = build(&shine, "shine-stage", &[]);
    let picture = |name: &str, words: &str| {
        let render = format!("render shine.ron --size 96x64 --frames 8 --samples 20% --out {name} {words}");
        run(Command::new(&program).current_dir(&shine).args(render.split(' ')));
        Picture::read(&shine.join(name)).unwrap()
    };
    let cpu = picture("cpu.png", "--backend cpu");
    let gpu = picture("gpu.png", "--backend gpu");
    let without = picture("without.png", "--backend cpu --set shine.amount=0");
    assert!(Difference::new(&cpu, &gpu).flip() < 0.002);
    assert!(Difference::new(&cpu, &without).flip() > 0.002);
}

/// The tool that changes the code and looks whether a test notices is a package of its own.
#[test]
fn the_tool_that_tests_the_tests_is_tested() {
    cargo(&root().join("tests/mutants"), &["test", "--release"]);
}

/// The packages of a build, as `naga v30.0.1 default,wgsl-in`: name, version and features. A library is listed twice if
/// programs and macros use it with different features.
fn tree(arguments: &str) -> BTreeSet<String> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(root()).args(["tree", "--offline", "--prefix", "none", "--format", "{p} {f}"]);
    let printed = run(cargo.args(arguments.split(' ')));
    let lines = printed.lines().map(|line| line.trim_end_matches(" (*)").trim_end());
    lines.filter(|line| !line.is_empty()).map(str::to_owned).collect()
}

#[test]
fn all_selections_of_packages_share_their_libraries() {
    // Cargo leaves out the features of dev-dependencies when it builds no test.
    let kinds = ["normal,build", "normal,build,dev"];
    let all = tree("--workspace --edges normal,build,dev");
    assert!(all.iter().any(|package| package.starts_with("naga ")), "{all:?}");
    let members = tree("--workspace --depth 0");
    let names = members.iter().filter_map(|package| package.split(' ').next());
    let own_stage = "--manifest-path examples/own_stage/Cargo.toml";
    let selections = names
        .map(|name| format!("--package {name}"))
        .chain(["--workspace".into(), own_stage.into(), format!("{own_stage} --features editor")])
        .flat_map(|selection| kinds.map(|kind| format!("{selection} --edges {kind}")));
    let own = root().display().to_string();
    let mut others = String::new();
    for selection in selections {
        for library in tree(&selection).difference(&all).filter(|package| !package.contains(&own)) {
            others += &format!("cargo tree {selection}: {library}\n");
        }
    }
    assert!(
        others.is_empty(),
        "Cargo would compile these libraries, and all that depend on them, a second time. Add the missing features to \
         features/Cargo.toml. If versions differ, copy Cargo.lock to examples/own_stage/ and run `cargo tree` \
         there.\n{others}"
    );
}
