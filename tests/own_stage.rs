//! Copies the package `examples/own_stage` out of the workspace and builds it there. It shares the workspace's target
//! folder, so that the dependencies are not built again.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

/// The repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace")
}

/// The target folder of this test: the test itself is `target/release/deps/NAME-...`.
pub fn target() -> PathBuf {
    env::current_exe().expect("a path").ancestors().nth(3).expect("a target folder").to_owned()
}

/// Runs a program to its end and returns its output.
pub fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let [printed, errors] =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(output.status.success(), "{command:?}:\n{printed}\n{errors}");
    printed
}

/// Runs Cargo in a folder, with the workspace's target folder.
pub fn cargo(folder: &Path, arguments: &[&str]) {
    let mut cargo = Command::new(env!("CARGO"));
    run(cargo.current_dir(folder).args(arguments).args(["--offline", "--target-dir"]).arg(target()));
}

/// Empties a folder, or creates it.
pub fn fresh(folder: PathBuf) -> PathBuf {
    if folder.exists() {
        fs::remove_dir_all(&folder).unwrap();
    }
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Copies a folder without the files that Cargo generates.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let (path, to) = (entry.path(), to.join(entry.file_name()));
        if !path.is_dir() {
            fs::copy(&path, &to).unwrap();
        } else if entry.file_name() != "target" {
            copy(&path, &to);
        }
    }
}

/// Copies the package. The copy has the same path in each run, as Cargo rebuilds a package that has moved.
pub fn package() -> PathBuf {
    let name = format!("own_stage{}", root().display()).replace(['/', '\\', ':'], "-");
    let folder = fresh(env::temp_dir().join(name));
    copy(&root().join("examples/own_stage"), &folder);
    let manifest = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
    let manifest = manifest.replace("path = \"../../", &format!("path = \"{}/", root().display()));
    fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    folder
}

/// Builds a program of the package's copy, with more arguments for Cargo. Returns its path.
pub fn build(package: &Path, program: &str, arguments: &[&str]) -> PathBuf {
    cargo(package, &[&["build", "--release", "--bin", program], arguments].concat());
    target().join("release").join(format!("{program}{}", env::consts::EXE_SUFFIX))
}
