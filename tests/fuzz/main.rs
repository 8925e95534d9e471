//! Damaged files and command lines: whatever they hold, the program says what is wrong, or works. It does not panic or
//! abort, and takes at most [`LONGEST`] and [`MOST_KILOBYTES`].
//!
//! Each kind of file has seeds, in `files.rs`, and a corpus of what was found, in `corpus/KIND/`. A process of its own
//! reads one damaged file after the other, so that one that ends the process can be named. `EPIGRAPH_FUZZ=50` tries 50
//! times as many, `EPIGRAPH_FUZZ_MUTANTS=20000` that many of each kind, `EPIGRAPH_FUZZ_SEED=2` others. With `--nocapture`
//! each kind prints a line of figures; `README.md` has those of a long run.

// `ulimit` and signals.
#![cfg(unix)]

mod command;
mod files;
mod memory;
mod mutate;
mod shaders;

use std::{
    env, fs,
    os::unix::process::ExitStatusExt,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    process::{Command, ExitStatus, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

use epigraph_core::testing::Random;

use files::Kind;
use memory::Figures;

/// The longest that a file may take.
const LONGEST: Duration = Duration::from_secs(60);

/// Address space of a process: 2 GB of memory, and room for what is reserved and not used.
const MOST_KILOBYTES: u64 = 3 << 20;

/// How many times as many files and command lines to try as in an ordinary run.
pub fn times() -> usize {
    number("EPIGRAPH_FUZZ").unwrap_or(1)
}

fn number(name: &str) -> Option<usize> {
    env::var(name)
        .ok()
        .map(|text| text.parse().unwrap_or_else(|_| panic!("{name} is a number, not `{text}`")))
}

fn random(place: usize) -> Random {
    let seed = number("EPIGRAPH_FUZZ_SEED").unwrap_or(1);
    Random((seed as u64) << 32 | place as u64)
}

/// Starts a program with limits on its memory.
pub fn limited(program: &Path) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -v {MOST_KILOBYTES} && ulimit -c 0 && exec \"$0\" \"$@\"")]);
    // Each thread reserves address space. Large blocks go back to the system when they are freed, so that what a file takes
    // is not hidden by what one before it left.
    let environment =
        [("RAYON_NUM_THREADS", "2"), ("MALLOC_ARENA_MAX", "2"), ("MALLOC_MMAP_THRESHOLD_", "65536")];
    command.arg(program).envs(environment).stdin(Stdio::null());
    command
}

/// What is wrong with the way a process ended, if `is_sound` does not hold for its exit code.
pub fn fault(status: ExitStatus, is_sound: impl Fn(i32) -> bool) -> Option<String> {
    match (status.code(), status.signal()) {
        (Some(code), _) if is_sound(code) => None,
        (Some(code), _) => Some(format!("exit code {code}")),
        (None, signal) => Some(format!("ended by signal {}", signal.unwrap_or_default())),
    }
}

/// The folder of a kind's corpus.
fn corpus(kind: &Kind) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fuzz/corpus").join(kind.name)
}

/// The variable by which a test tells the process that it starts where to work.
const FOLDER: &str = "EPIGRAPH_FUZZ_FOLDER";

/// Tries the corpus and the mutants of a kind of file. `test` is the name of the test that calls this.
fn try_all(test: &str, kind: &Kind) {
    if let Some(folder) = env::var_os(FOLDER) {
        return read_all(kind, Path::new(&folder));
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = env::current_exe().expect("the test's program");
    let stderr = fs::File::create(folder.path().join("stderr")).expect("a file");
    let mut child = limited(&program)
        .args([test, "--exact", "--nocapture"])
        .env(FOLDER, folder.path())
        .stdout(Stdio::null())
        .stderr(stderr)
        .spawn()
        .expect("the test's program starts");
    let file = folder.path().join(kind.file);
    // Each file is written over the one before.
    let written = || fs::metadata(&file).and_then(|data| data.modified()).ok();
    let (mut last, mut since) = (None, Instant::now());
    let fault = loop {
        if let Some(status) = child.try_wait().expect("it was started") {
            break fault(status, |code| code == 0);
        }
        let now = written();
        if now != last {
            (last, since) = (now, Instant::now());
        }
        if since.elapsed() > LONGEST {
            child.kill().expect("it was started");
            child.wait().expect("it was started");
            break Some(format!("took more than {} s", LONGEST.as_secs()));
        }
        sleep(Duration::from_millis(20));
    };
    let said = fs::read_to_string(folder.path().join("stderr")).unwrap_or_default();
    if let Some(fault) = fault {
        let kept = folder.keep();
        panic!("{fault}: {}\n{said}", kept.join(kind.file).display());
    }
    // The figures; what precedes them are panics of libraries that their callers catch.
    eprintln!("{}", said.lines().last().unwrap_or_default());
}

/// Reads the corpus and the mutants, one after the other, in the process that [`try_all`] has started.
fn read_all(kind: &Kind, folder: &Path) {
    let mut known: Vec<(String, Vec<u8>)> = Vec::new();
    for entry in fs::read_dir(corpus(kind)).into_iter().flatten() {
        let path = entry.expect("readable").path();
        known.push((path.display().to_string(), fs::read(&path).expect("readable")));
    }
    known.sort();
    for (name, bytes) in (kind.companions)() {
        fs::write(folder.join(name), bytes).expect("writable");
    }
    let seeds = (kind.seeds)();
    let write = |bytes: &[u8]| {
        let path = folder.join(kind.file);
        // Anew: writing over a file waits for the disk.
        let _ = fs::remove_file(&path);
        fs::write(&path, bytes).expect("writable");
        path
    };
    let try_one = |what: &str, path: &Path| {
        let read = catch_unwind(AssertUnwindSafe(|| (kind.read)(path)));
        read.unwrap_or_else(|_| panic!("{what} panicked"))
    };
    let read = |what: &str, bytes: &[u8]| try_one(what, &write(bytes));
    known.iter().for_each(|(name, bytes)| {
        read(name, bytes);
    });
    for (number, seed) in seeds.iter().enumerate() {
        assert!(read("a seed", seed), "seed {number} is not accepted");
    }
    let all: Vec<&[u8]> =
        seeds.iter().map(Vec::as_slice).chain(known.iter().map(|(_, bytes)| &bytes[..])).collect();
    let count = number("EPIGRAPH_FUZZ_MUTANTS").unwrap_or(kind.count * times());
    let mut figures = Figures::default();
    let accepted = (0..count).filter(|&number| {
        let mut random = random(number);
        let mutant =
            mutate::mutant(&seeds[number % seeds.len()], mutate::choose(&mut random, &all), &mut random);
        let path = write(&mutant);
        figures.of(number, mutant.len(), || try_one(&format!("mutant {number}"), &path))
    });
    // Otherwise nothing but the readers' first lines is tried.
    let accepted = accepted.count();
    eprintln!("| {} | {count} | {accepted} | {figures} |", kind.name);
    assert!(accepted > count / 100, "{accepted} of {count} mutants are accepted");
}

#[test]
fn graphs() {
    try_all("graphs", &files::GRAPHS);
}

#[test]
fn scenes() {
    try_all("scenes", &files::SCENES);
}

#[test]
fn flights() {
    try_all("flights", &files::FLIGHTS);
}

#[test]
fn obj() {
    try_all("obj", &files::OBJ);
}

#[test]
fn mtl() {
    try_all("mtl", &files::MTL);
}

#[test]
fn ply() {
    try_all("ply", &files::PLY);
}

#[test]
fn gltf() {
    try_all("gltf", &files::GLTF);
}

#[test]
fn glb() {
    try_all("glb", &files::GLB);
}

#[test]
fn png() {
    try_all("png", &files::PNG);
}

#[test]
fn exr() {
    try_all("exr", &files::EXR);
}

#[test]
fn wgsl() {
    try_all("wgsl", &files::WGSL);
}

#[test]
fn vts() {
    try_all("vts", &files::VTS);
}

#[test]
fn repeats() {
    try_all("repeats", &files::REPEATS);
}

#[test]
fn scan() {
    try_all("scan", &files::SCAN);
}

#[test]
fn xyz() {
    try_all("xyz", &files::XYZ);
}

#[test]
fn las() {
    try_all("las", &files::LAS);
}

#[test]
fn laz() {
    try_all("laz", &files::LAZ);
}

#[test]
fn command_lines() {
    command::try_all();
}
