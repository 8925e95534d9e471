//! Small changes to the code, one at a time: which of them does a test notice?
//!
//! The workspace is copied. All mutants of its Rust code are compiled into the copy at once, each behind a switch, and
//! an environment variable switches one on (`rust.rs`). A mutant of a shader is a text that takes the place of the
//! shader's when it is loaded (`wgsl.rs`). For each mutant of a sample, the tests run until one fails (`run.rs`).

mod run;
mod rust;
mod wgsl;

use std::{
    collections::HashSet,
    error::Error,
    fs,
    ops::Range,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use clap::Parser;
use serde_json::Value;

/// What is mutated: the name in the report, and the folder.
const PARTS: [(&str, &str); 5] = [
    ("core", "core/src"),
    ("stages", "stages/src"),
    ("scenes", "scenes/src"),
    ("pictures", "pictures/src"),
    ("wgsl", "shaders"),
];

/// The switch, in each mutated crate. It also appends the mutants that a test reaches to a file, as lines.
const SWITCH: &str = r#"
/// Whether this mutant is switched on.
#[allow(dead_code)]
pub(crate) fn mutant(id: u32) -> bool {
    use std::{env, fs::File, io::Write, sync::{LazyLock, atomic::{AtomicBool, Ordering::Relaxed}}};
    static STATE: LazyLock<(Option<u32>, Option<(File, Vec<AtomicBool>)>)> = LazyLock::new(|| {
        let on = env::var("EPIGRAPH_MUTANT").ok().and_then(|id| id.parse().ok());
        let file = env::var("EPIGRAPH_MUTANTS_REACHED").ok();
        let file = file.map(|path| File::options().append(true).open(path).expect("a file of mutants"));
        (on, file.map(|file| (file, (0..1 << 17).map(|_| AtomicBool::new(false)).collect())))
    });
    let (on, reached) = &*STATE;
    if let Some((file, seen)) = reached
        && !seen[id as usize].load(Relaxed)
        && !seen[id as usize].swap(true, Relaxed)
    {
        (&*file).write_all(format!("{id}\n").as_bytes()).expect("writing to a file of mutants");
    }
    *on == Some(id)
}
"#;

/// Where core loads the text of a shader, and what the copy does first.
const LOADER: &str = "core/src/shader.rs";
const LOADS: &str =
    "pub(crate) fn or_embedded<'t>(&self, file: Option<&Path>, embedded: &'t str) -> Cow<'t, str> {";
const LOADS_MUTANT: &str = r#"
        if let (Ok(reached), Some(file)) = (std::env::var("EPIGRAPH_MUTANTS_REACHED"), file) {
            use std::io::Write;
            let path = file.to_string_lossy();
            let name = path.rfind("shaders/").map_or(&*path, |at| &path[at..]);
            let mut reached = std::fs::File::options().append(true).open(reached).expect("a file of mutants");
            reached.write_all(format!("{name}\n").as_bytes()).expect("writing to a file of mutants");
        }
        if let (Ok(mutated), Some(file), Ok(text)) =
            (std::env::var("EPIGRAPH_MUTANT_OF"), file, std::env::var("EPIGRAPH_MUTANT_TEXT"))
            && file.ends_with(&mutated)
        {
            return Cow::Owned(std::fs::read_to_string(text).expect("the mutant's text"));
        }"#;

/// A small change to the code.
pub struct Mutant {
    pub id: u32,
    /// Path from the workspace's root.
    pub file: String,
    pub line: usize,
    pub column: usize,
    /// `FROM -> TO`.
    pub change: String,
    /// The line of the source.
    pub source: String,
}

impl Mutant {
    /// Names the mutant as long as its line stays the same.
    fn key(&self) -> String {
        format!("{}\t{}\t{}\t{}", self.file, self.column, self.change, self.source)
    }
}

/// Changes the code in small ways, one at a time, and reports which changes no test notices.
#[derive(Parser)]
struct Args {
    /// Parts to mutate: core, stages, scenes, pictures, wgsl; all of them if none is given
    parts: Vec<String>,
    /// Mutants per part, drawn at random; without it, all
    #[arg(long, value_name = "N")]
    sample: Option<usize>,
    /// Seed of the draw
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Only mutants of files whose path contains this
    #[arg(long, value_name = "TEXT")]
    file: Option<String>,
    /// Only list the mutants
    #[arg(long)]
    list: bool,
    /// Skip the tests of whole graphs for mutants that the tests of their crate do not notice
    #[arg(long)]
    quick: bool,
    /// Append the results to this file, as CSV
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    if let Some(other) = args.parts.iter().find(|part| !PARTS.iter().any(|(name, _)| name == part)) {
        let names = PARTS.map(|(name, _)| name).join(", ");
        return Err(format!("unknown part `{other}`; there are {names}").into());
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize()?;
    let place = root.join("target/mutants");
    let copy = place.join("copy");
    let wanted = |name: &str| args.parts.is_empty() || args.parts.iter().any(|part| part == name);
    copy_workspace(&root, &copy, &wanted)?;

    // Equivalent mutants, by key, each with the reason above it.
    let equivalent: HashSet<String> = include_str!("../equivalent.txt")
        .lines()
        .filter(|line| !line.starts_with('#') && !line.is_empty())
        .map(str::to_owned)
        .collect();
    let mut rust = Vec::new();
    let mut shaders = Vec::new();
    let mut mutants: Vec<(usize, Mutant)> = Vec::new();
    for (part, (name, folder)) in PARTS.iter().enumerate().filter(|(_, (name, _))| wanted(name)) {
        for path in files(&root, folder)? {
            let is_shader = *name == "wgsl" && path.ends_with(".wgsl");
            if !is_shader && !(*name != "wgsl" && is_source(&path)) {
                continue;
            }
            let text = fs::read_to_string(root.join(&path))?;
            let first = mutants.len() as u32;
            if is_shader {
                let found = wgsl::find(&path, &text, first);
                for wgsl::Text { mutant, text } in found {
                    mutants.push((part, mutant));
                    shaders.push(text);
                }
            } else {
                let (found, edits) =
                    rust::find(&path, &text, first).map_err(|error| format!("{path}: {error}"))?;
                mutants.extend(found.into_iter().map(|mutant| (part, mutant)));
                rust.push((path, text, edits));
            }
        }
    }
    let first_shader = mutants.len() - shaders.len();
    if wanted("wgsl") && !wanted("core") {
        rust.push((LOADER.into(), fs::read_to_string(root.join(LOADER))?, rust::Edits::default()));
    }

    let broken = if args.list { HashSet::new() } else { compile(&place, &copy, &rust, &mutants)? };
    let chosen = |(_, mutant): &&(usize, Mutant)| {
        args.file.as_ref().is_none_or(|text| mutant.file.contains(text))
            && !broken.contains(&mutant.id)
            && !equivalent.contains(&mutant.key())
    };
    if args.list {
        for (_, mutant) in mutants.iter().filter(chosen) {
            println!(
                "{}:{}:{}: {}    {}",
                mutant.file, mutant.line, mutant.column, mutant.change, mutant.source
            );
        }
        return Ok(());
    }

    let tests = run::Tests::build(&copy, &place, &wanted, args.quick)?;
    let mut random = args.seed;
    let mut report = String::new();
    let position = |name: &String| PARTS.iter().position(|(known, _)| known == name);
    let mut parts: Vec<usize> = args.parts.iter().filter_map(position).collect();
    if parts.is_empty() {
        parts = (0..PARTS.len()).collect();
    }
    for part in parts {
        let (name, _) = PARTS[part];
        let mut here: Vec<&Mutant> =
            mutants.iter().filter(chosen).filter(|(of, _)| *of == part).map(|(_, mutant)| mutant).collect();
        if here.is_empty() {
            continue;
        }
        let all = here.len();
        shuffle(&mut here, &mut random);
        here.truncate(args.sample.unwrap_or(all));
        let done: Mutex<Vec<(&Mutant, run::Verdict)>> = Mutex::default();
        two_at_a_time(&here, |worker, &mutant| {
            let text = (mutant.id as usize).checked_sub(first_shader).map(|index| &*shaders[index]);
            let verdict = tests.try_mutant(worker, name, mutant, text).map_err(|error| error.to_string())?;
            let mut done = done.lock().expect("no worker panics");
            done.push((mutant, verdict));
            let Mutant { file, line, change, .. } = mutant;
            eprintln!("{name} {}/{}: {verdict:?} {file}:{line}: {change}", done.len(), here.len());
            match &args.out {
                Some(out) => append(out, name, mutant, verdict).map_err(|error| error.to_string()),
                None => Ok(()),
            }
        })?;
        let done = done.into_inner().expect("no worker panics");
        let count = |verdict| done.iter().filter(|(_, found)| *found == verdict).count();
        let (noticed, missed) = (count(run::Verdict::Noticed), count(run::Verdict::Missed));
        let tried = noticed + missed;
        for (Mutant { file, line, column, change, source, .. }, verdict) in &done {
            if *verdict == run::Verdict::Missed {
                report += &format!("{file}:{line}:{column}: {change}    {source}\n");
            }
        }
        let share = 100.0 * noticed as f64 / tried.max(1) as f64;
        report += &format!("{name}: {noticed} of {tried} noticed, {share:.1}% (of {all} mutants)\n\n");
    }
    print!("{report}");
    Ok(())
}

/// Does the work for each item, by two workers with numbers 0 and 1: much of a test runs on one thread.
fn two_at_a_time<T: Sync>(
    items: &[T],
    work: impl Fn(usize, &T) -> Result<(), String> + Sync,
) -> Result<(), String> {
    let next = AtomicUsize::new(0);
    let each = &|worker: usize| {
        while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
            work(worker, item)?;
        }
        Ok(())
    };
    thread::scope(|scope| {
        let workers = [0, 1].map(|worker| scope.spawn(move || each(worker)));
        workers.into_iter().try_for_each(|worker| worker.join().expect("no worker panics"))
    })
}

/// The files under a folder, by Git.
fn files(root: &Path, folder: &str) -> Result<Vec<String>, Box<dyn Error>> {
    let git = ["ls-files", "--cached", "--others", "--exclude-standard", "-z", folder];
    let listed = Command::new("git").current_dir(root).args(git).output()?;
    if !listed.status.success() {
        return Err(String::from_utf8_lossy(&listed.stderr).into());
    }
    let listed = String::from_utf8(listed.stdout)?;
    let mut files: Vec<String> =
        listed.split('\0').filter(|file| root.join(file).is_file()).map(str::to_owned).collect();
    files.sort();
    Ok(files)
}

/// Whether a Rust file belongs to the program, and not to its tests.
fn is_source(path: &str) -> bool {
    path.ends_with(".rs")
        && !path.ends_with("tests.rs")
        && !path.ends_with("/cases.rs")
        && !path.contains("/tests/")
        && !path.ends_with("/testing.rs")
}

/// Writes a file unless it is there already, so that Cargo compiles only what has changed.
fn write(path: &Path, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
    if fs::read(path).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    Ok(fs::write(path, bytes)?)
}

/// Copies all files but those that are mutated, of the parts that are wanted, and removes those that are gone.
fn copy_workspace(root: &Path, copy: &Path, wanted: &dyn Fn(&str) -> bool) -> Result<(), Box<dyn Error>> {
    let files = files(root, ".")?;
    for path in &files {
        let is_in = |(name, folder): &(&str, &str)| {
            *name != "wgsl" && wanted(name) && path.starts_with(&format!("{folder}/"))
        };
        let mutated = PARTS.iter().any(is_in) || wanted("wgsl") && path == LOADER;
        if !mutated || !is_source(path) {
            write(&copy.join(path), &fs::read(root.join(path))?)?;
        }
    }
    remove_others(copy, &files.iter().map(|path| copy.join(path)).collect())
}

/// Removes all files in a folder but those that are to stay. A module that has moved would be there twice.
fn remove_others(folder: &Path, stay: &HashSet<PathBuf>) -> Result<(), Box<dyn Error>> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            remove_others(&path, stay)?;
        } else if !stay.contains(&path) {
            fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// Compiles the mutants in, and finds those that do not compile.
fn compile(
    place: &Path,
    copy: &Path,
    rust: &[(String, String, rust::Edits)],
    mutants: &[(usize, Mutant)],
) -> Result<HashSet<u32>, Box<dyn Error>> {
    let list = place.join("broken.txt");
    let known: HashSet<String> =
        fs::read_to_string(&list).unwrap_or_default().lines().map(str::to_owned).collect();
    let mut broken: HashSet<u32> = mutants
        .iter()
        .filter(|(_, mutant)| known.contains(&mutant.key()))
        .map(|(_, mutant)| mutant.id)
        .collect();
    loop {
        let mut places = Vec::new();
        for (path, text, edits) in rust {
            let mut mutated = edits.apply(text, &broken);
            if path.ends_with("src/lib.rs") {
                mutated.text += SWITCH;
            }
            if path == LOADER {
                let at = mutated
                    .text
                    .find(LOADS)
                    .ok_or_else(|| format!("{LOADER} no longer loads shaders as expected"))?;
                mutated.text.insert_str(at + LOADS.len(), LOADS_MUTANT);
                // No mutants there: this code is not the program's.
                for (_, place) in &mut mutated.places {
                    let shift = if place.start > at { LOADS_MUTANT.len() } else { 0 };
                    *place = place.start + shift..place.end + shift;
                }
            }
            write(&copy.join(path), mutated.text.as_bytes())?;
            places.push((path.as_str(), mutated.places));
        }
        let errors = errors(copy, place)?;
        if errors.is_empty() {
            return Ok(broken);
        }
        eprintln!("{} errors; leaving out the mutants that do not compile", errors.len());
        let before = broken.len();
        for Trouble { file, spans, text } in &errors {
            let here = || places.iter().filter(|(path, _)| path == file).flat_map(|(_, places)| places);
            let innermost = spans.iter().find_map(|at| {
                let around = here().filter(|(_, place)| place.start <= at.start && at.end <= place.end);
                around.min_by_key(|(_, place)| place.len())
            });
            // What a mutant borrows can be in the way of another statement: then all mutants near it go.
            let near = |distance: usize| {
                let start = spans.iter().map(|at| at.start).min().unwrap_or(0).saturating_sub(distance);
                let end = spans.iter().map(|at| at.end).max().unwrap_or(0) + distance;
                here().filter(move |(_, place)| place.start < end && start < place.end)
            };
            let distance = NEAR.into_iter().find(|&distance| near(distance).count() > 0);
            match (innermost, distance) {
                (Some((mutant, _)), _) => drop(broken.insert(*mutant)),
                (None, Some(distance)) => broken.extend(near(distance).map(|(mutant, _)| *mutant)),
                (None, None) => return Err(format!("an error that is no mutant's\n{text}").into()),
            }
        }
        assert!(broken.len() > before, "errors that leaving out mutants does not mend");
        let keys: Vec<String> = mutants
            .iter()
            .filter(|(_, mutant)| broken.contains(&mutant.id))
            .map(|(_, mutant)| mutant.key())
            .collect();
        fs::write(&list, keys.join("\n"))?;
    }
}

/// Crates whose code is mutated.
const MUTATED: [&str; 4] = ["core", "scenes", "pictures", "stages"];

/// Cargo in the copy. Mutated code is many times longer, and optimising it takes longer than its tests.
fn cargo(copy: &Path, place: &Path) -> Command {
    let mut cargo = Command::new("cargo");
    cargo.current_dir(copy).env("CARGO_TARGET_DIR", place.join("target"));
    for name in MUTATED {
        cargo.arg("--config").arg(format!("profile.release.package.epigraph-{name}.opt-level=1"));
    }
    cargo
}

/// A compiler's error.
struct Trouble {
    file: String,
    /// The bytes that it names, those of its own place first.
    spans: Vec<Range<usize>>,
    text: String,
}

/// Bytes around an error in which mutants may be its cause: the nearest that there are.
const NEAR: [usize; 3] = [400, 1600, 6400];

/// The compiler's errors about the copy.
fn errors(copy: &Path, place: &Path) -> Result<Vec<Trouble>, Box<dyn Error>> {
    let packages = MUTATED.map(|name| format!("-pepigraph-{name}"));
    let checked = cargo(copy, place)
        .args(["check", "--release", "--keep-going", "--message-format=json"])
        .args(packages)
        .stderr(Stdio::inherit())
        .output()?;
    let mut errors = Vec::new();
    for line in String::from_utf8(checked.stdout)?.lines() {
        let value: Value = serde_json::from_str(line)?;
        let message = &value["message"];
        if message["level"] != "error" {
            continue;
        }
        let text = message["rendered"].as_str().unwrap_or_default().to_owned();
        let mut spans: Vec<&Value> = message["spans"].as_array().into_iter().flatten().collect();
        spans.sort_by_key(|span| span["is_primary"] != true);
        let Some(file) = spans.first().and_then(|span| span["file_name"].as_str()).map(str::to_owned) else {
            // The count of errors at the end.
            continue;
        };
        let byte = |span: &Value, name: &str| span[name].as_u64().unwrap_or(0) as usize;
        let spans = spans.iter().filter(|span| span["file_name"] == *file);
        let spans = spans.map(|span| byte(span, "byte_start")..byte(span, "byte_end")).collect();
        errors.push(Trouble { file, spans, text });
    }
    if errors.is_empty() && !checked.status.success() {
        return Err("cargo check failed".into());
    }
    Ok(errors)
}

/// Fisher and Yates's shuffle with SplitMix64.
fn shuffle<T>(items: &mut [T], state: &mut u64) {
    for last in (1..items.len()).rev() {
        *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        items.swap(last, ((z ^ (z >> 31)) % (last as u64 + 1)) as usize);
    }
}

/// Appends a line of CSV.
fn append(out: &Path, part: &str, mutant: &Mutant, verdict: run::Verdict) -> Result<(), Box<dyn Error>> {
    use std::io::Write;
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let Mutant { file, line, column, change, source, .. } = mutant;
    let mut file_out = fs::OpenOptions::new().create(true).append(true).open(out)?;
    writeln!(file_out, "{part},{verdict:?},{file},{line},{column},{},{}", quoted(change), quoted(source))?;
    Ok(())
}
