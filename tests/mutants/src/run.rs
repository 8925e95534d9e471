//! Runs the tests with a mutant.

use std::{
    error::Error,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use serde_json::Value;

use crate::{MUTATED, Mutant, cargo};

/// What the tests make of a mutant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// A test failed, or the tests took too long.
    Noticed,
    /// All passed.
    Missed,
    /// The shader does not compile.
    Invalid,
}

/// The tests of whole graphs that take seconds and notice most: the module, and the parts that it concerns.
const WIDE: [(&str, &[&str]); 6] = [
    ("measures::texts", &["core"]),
    ("measures::graphs", &["core", "stages", "scenes"]),
    ("measures::scenes", &["scenes"]),
    ("measures::models", &["scenes"]),
    ("measures::pictures", &["pictures"]),
    ("sides::", &["core", "stages", "wgsl"]),
];

/// A program of tests, or some of its tests.
#[derive(Clone)]
struct Program {
    /// Its package, such as `epigraph-core`, and its name.
    package: String,
    name: String,
    path: PathBuf,
    folder: PathBuf,
    /// Only tests whose names contain this.
    filter: &'static str,
    /// The parts whose mutants it may notice; none if that is any part's.
    parts: &'static [&'static str],
    /// Tests that fail with the switches alone: some read the sources.
    skipped: Vec<String>,
    /// What it takes without a mutant.
    took: Duration,
}

/// The programs of tests, built with all mutants.
pub struct Tests {
    programs: Vec<Program>,
    quick: bool,
    place: PathBuf,
}

impl Tests {
    /// Builds them, and checks that they pass without a mutant.
    pub fn build(copy: &Path, place: &Path, quick: bool) -> Result<Self, Box<dyn Error>> {
        let packages = MUTATED.into_iter().chain(["tests"]).map(|name| format!("-pepigraph-{name}"));
        let built = cargo(copy, place)
            .args(["test", "--release", "--no-run", "--message-format=json"])
            .args(packages)
            .stderr(Stdio::inherit())
            .output()?;
        if !built.status.success() {
            return Err("the tests do not build with the mutants".into());
        }
        let mut programs = Vec::new();
        for line in String::from_utf8(built.stdout)?.lines() {
            let value: Value = serde_json::from_str(line)?;
            let (Some(path), Some(manifest), Some(name)) = (
                value["executable"].as_str(),
                value["manifest_path"].as_str(),
                value["target"]["name"].as_str(),
            ) else {
                continue;
            };
            // Benches measure, and the tests of other packages call Cargo.
            if value["target"]["kind"][0] == "bench" || name == "outside" || name == "allocations" {
                continue;
            }
            let folder = Path::new(manifest).parent().ok_or("a manifest without a folder")?.to_owned();
            let package =
                folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            let (name, path) = (name.to_owned(), path.into());
            let parts: &[&str] = match &*package {
                _ if name == "numerics" => &["stages", "wgsl"],
                "core" => &["core"],
                "stages" => &["stages", "wgsl"],
                "scenes" => &["scenes"],
                "pictures" => &["pictures"],
                _ => &[],
            };
            let (filter, skipped, took) = ("", Vec::new(), Duration::from_secs(600));
            let program = Program { package, name, path, folder, filter, parts, skipped, took };
            if program.name == "suite" {
                programs.extend(WIDE.map(|(filter, parts)| Program { filter, parts, ..program.clone() }));
                if quick {
                    continue;
                }
            }
            programs.push(program);
        }
        let mut tests = Self { programs: Vec::new(), quick, place: place.to_owned() };
        for mut program in programs {
            let start = Instant::now();
            let (mut passes, printed) = tests.run(0, &program, program.filter, None, None)?;
            program.took = start.elapsed();
            let seconds = program.took.as_secs_f64();
            let Program { package, name, filter, .. } = &program;
            eprintln!("{package} {name} {filter} {seconds:.1} s without a mutant");
            if !passes {
                let failed = printed
                    .lines()
                    .filter_map(|line| line.strip_prefix("test ")?.strip_suffix(" ... FAILED"));
                program.skipped = failed.map(str::to_owned).collect();
                eprintln!(
                    "  without the tests that fail with the switches alone: {}",
                    program.skipped.join(", ")
                );
                (passes, _) = tests.run(0, &program, program.filter, None, None)?;
            }
            if !passes {
                return Err(format!("{} fails without a mutant", program.name).into());
            }
            tests.programs.push(program);
        }
        tests.programs.sort_by_key(|program| (program.parts.is_empty(), program.took));
        Ok(tests)
    }

    /// Runs the tests that concern a mutant until one fails. A shader's mutant is a text.
    pub fn try_mutant(
        &self,
        worker: usize,
        part: &str,
        mutant: &Mutant,
        text: Option<&str>,
    ) -> Result<Verdict, Box<dyn Error>> {
        if let Some(text) = text {
            fs::write(self.text(worker), text)?;
        }
        let module = module(&mutant.file);
        let concern = |program: &&Program| program.parts.contains(&part);
        // First the tests of the module, which take a second.
        let own = self.programs.iter().filter(concern).filter(|program| program.name.starts_with("epigraph"));
        let own = own.map(|program| (program, &*module));
        // The tests of other modules do not load a shader of one stage, and few parts of the core matter once it runs.
        let of_one_stage = self.quick && part == "wgsl" && !mutant.file.contains("shared/");
        let texts = ["file", "wgsl", "reflect", "error.rs", "full.rs", "registry.rs", "shader.rs"];
        let of_texts = self.quick
            && part == "core"
            && texts.iter().any(|name| mutant.file.starts_with(&format!("core/src/{name}")));
        let others = self.programs.iter().filter(|program| {
            program.parts.is_empty()
                || concern(program)
                    && !(of_one_stage && program.name.starts_with("epigraph"))
                    && !(of_texts && ["measures::graphs", "sides::"].contains(&program.filter))
        });
        for (program, filter) in own.chain(others.map(|program| (program, program.filter))) {
            let (passes, printed) =
                self.run(worker, program, filter, Some(mutant.id), text.map(|_| &*mutant.file))?;
            if !passes {
                let invalid = text.is_some() && printed.contains("is not valid WGSL");
                return Ok(if invalid { Verdict::Invalid } else { Verdict::Noticed });
            }
        }
        Ok(Verdict::Missed)
    }

    /// The file of a worker for the text of a shader's mutant.
    fn text(&self, worker: usize) -> PathBuf {
        self.place.join(format!("mutant{worker}.wgsl"))
    }

    /// Runs a program. Returns whether its tests pass, and what it printed.
    fn run(
        &self,
        worker: usize,
        program: &Program,
        filter: &str,
        mutant: Option<u32>,
        shader: Option<&str>,
    ) -> Result<(bool, String), Box<dyn Error>> {
        let mut command = Command::new(&program.path);
        command.current_dir(&program.folder).stdin(Stdio::null());
        if !filter.is_empty() {
            command.arg(filter);
        }
        for name in &program.skipped {
            command.args(["--skip", name]);
        }
        if let Some(file) = shader {
            command.env("EPIGRAPH_MUTANT_OF", file).env("EPIGRAPH_MUTANT_TEXT", self.text(worker));
        } else if let Some(id) = mutant {
            command.env("EPIGRAPH_MUTANT", id.to_string());
        }
        // So that the cause is there as soon as the test has failed.
        command.arg("--nocapture");
        // Into a file: a full pipe would stop the program.
        let log = self.text(worker).with_extension("log");
        let out = fs::File::create(&log)?;
        let mut child = command.stderr(out.try_clone()?).stdout(out).spawn()?;
        let (start, most) = (Instant::now(), 4 * program.took + Duration::from_secs(30));
        let passes = loop {
            if let Some(status) = child.try_wait()? {
                break status.success();
            }
            // One failure is enough, except to find out which tests fail without a mutant.
            let has_failed =
                mutant.is_some() && fs::read_to_string(&log).is_ok_and(|log| log.contains("... FAILED\n"));
            if has_failed || start.elapsed() > most {
                child.kill()?;
                child.wait()?;
                break false;
            }
            thread::sleep(Duration::from_millis(20));
        };
        Ok((passes, String::from_utf8_lossy(&fs::read(&log)?).into_owned()))
    }
}

/// The module of a file, as tests name it: `shared::view::` for `stages/src/shared/view.rs`.
fn module(file: &str) -> String {
    let path = file.split_once("/src/").or(file.split_once("shaders/")).map_or(file, |(_, path)| path);
    let path = path.trim_end_matches(".rs").trim_end_matches(".wgsl").trim_end_matches("/mod");
    format!("{}::", path.replace('/', "::"))
}
