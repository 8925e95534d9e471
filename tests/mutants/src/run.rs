//! Runs the tests with a mutant.

use std::{
    collections::HashSet,
    error::Error,
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::Mutex,
    thread,
    time::{Duration, Instant},
};

use serde_json::Value;

use crate::{MUTATED, Mutant, cargo, two_at_a_time};

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
const WIDE: [(&str, &[&str]); 7] = [
    ("broken::", &["core"]),
    ("measures::texts", &["core"]),
    ("measures::graphs", &["core", "stages", "scenes"]),
    ("measures::scenes", &["scenes"]),
    ("measures::models", &["scenes"]),
    ("measures::pictures", &["pictures"]),
    ("sides::", &["core", "stages", "wgsl"]),
];

/// Tests of one program run together as long as they take less than this.
const TOGETHER: Duration = Duration::from_secs(2);

/// A program of tests.
struct Program {
    path: PathBuf,
    folder: PathBuf,
    /// Whether its tests are those of modules.
    of_modules: bool,
    tests: Vec<Test>,
}

/// A test, and what it does without a mutant.
struct Test {
    name: String,
    /// The parts whose mutants it may notice; none if that is any part's.
    parts: &'static [&'static str],
    took: Duration,
    /// The mutants of Rust code that it reaches, by number, and the files of the shaders that it loads.
    reached: HashSet<String>,
}

/// [`Test::took`] and [`Test::reached`].
type Reach = (Duration, HashSet<String>);

/// Tests of a program that run together.
struct Batch<'t> {
    program: &'t Program,
    tests: Vec<&'t Test>,
    took: Duration,
}

/// The programs of tests, built with all mutants.
pub struct Tests {
    programs: Vec<Program>,
    quick: bool,
    place: PathBuf,
}

impl Tests {
    /// Builds them, and runs each test without a mutant to see what it reaches. Tests that fail with the switches alone,
    /// because they read the sources, are left out, as are those that concern none of the parts.
    pub fn build(
        copy: &Path,
        place: &Path,
        wanted: &dyn Fn(&str) -> bool,
        quick: bool,
    ) -> Result<Self, Box<dyn Error>> {
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
            let parts: &[&str] = match &*package {
                _ if name == "numerics" => &["stages", "wgsl"],
                "core" => &["core"],
                "stages" => &["stages", "wgsl"],
                "scenes" => &["scenes"],
                "pictures" => &["pictures"],
                _ => &[],
            };
            let listed = Command::new(path).args(["--list", "--format", "terse"]).output()?;
            let listed = String::from_utf8(listed.stdout)?;
            let names = listed.lines().filter_map(|line| line.strip_suffix(": test"));
            let tests = names.filter_map(|test| {
                let wide = WIDE.iter().find(|(filter, _)| name == "suite" && test.starts_with(filter));
                let parts = match wide {
                    Some((_, parts)) if quick => parts,
                    None if quick && name == "suite" => return None,
                    _ => parts,
                };
                let concerns = parts.is_empty() || parts.iter().any(|part| wanted(part));
                concerns.then(|| Test {
                    name: test.to_owned(),
                    parts,
                    took: Duration::from_secs(600),
                    reached: HashSet::new(),
                })
            });
            let tests = tests.collect();
            let of_modules = name.starts_with("epigraph");
            programs.push(Program { path: path.into(), folder, of_modules, tests });
        }
        let mut tests = Self { programs, quick, place: place.to_owned() };
        tests.record()?;
        Ok(tests)
    }

    /// Runs each test without a mutant, two at a time.
    fn record(&mut self) -> Result<(), Box<dyn Error>> {
        let each: Vec<(usize, usize)> = (0..self.programs.len())
            .flat_map(|program| (0..self.programs[program].tests.len()).map(move |test| (program, test)))
            .collect();
        let found = Mutex::new(Vec::new());
        two_at_a_time(&each, |worker, &(program, test)| {
            let result = self.reach(worker, program, test).map_err(|error| error.to_string())?;
            found.lock().expect("no worker panics").push((program, test, result));
            Ok(())
        })?;
        for (program, test, result) in found.into_inner().expect("no worker panics") {
            let test = &mut self.programs[program].tests[test];
            match result {
                Some((took, reached)) => (test.took, test.reached) = (took, reached),
                None => eprintln!("without a test that fails with the switches alone: {}", test.name),
            }
        }
        for program in &mut self.programs {
            program.tests.retain(|test| !test.reached.is_empty());
            program.tests.sort_by_key(|test| test.took);
            let took: Duration = program.tests.iter().map(|test| test.took).sum();
            eprintln!(
                "{}: {} tests, {:.1} s",
                program.path.display(),
                program.tests.len(),
                took.as_secs_f64()
            );
        }
        Ok(())
    }

    /// How long a test takes without a mutant, and what it reaches; none if it fails.
    fn reach(&self, worker: usize, program: usize, test: usize) -> Result<Option<Reach>, Box<dyn Error>> {
        let program = &self.programs[program];
        let test = &program.tests[test];
        let file = self.text(worker).with_extension("reached");
        fs::write(&file, "")?;
        let start = Instant::now();
        let batch = Batch { program, tests: vec![test], took: test.took };
        let (passes, _) = self.run(worker, &batch, ("EPIGRAPH_MUTANTS_REACHED", file.as_os_str()))?;
        let reached = fs::read_to_string(&file)?.lines().map(str::to_owned).collect();
        Ok(passes.then(|| (start.elapsed(), reached)))
    }

    /// Runs the tests that concern a mutant and reach it, until one fails. A shader's mutant is a text.
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
        let (id, module) = (mutant.id.to_string(), module(&mutant.file));
        // Few parts of the core matter to whole graphs once it runs.
        let texts = ["file", "wgsl", "reflect", "error.rs", "full.rs", "registry.rs", "shader.rs"];
        let of_texts = self.quick
            && part == "core"
            && texts.iter().any(|name| mutant.file.starts_with(&format!("core/src/{name}")));
        let reaches = |test: &Test| match text {
            Some(_) => test.reached.contains(&mutant.file),
            None => test.reached.contains(&id),
        };
        let concerns = |test: &&Test| {
            (test.parts.is_empty() || test.parts.contains(&part))
                && !(of_texts
                    && ["measures::graphs", "sides::"].iter().any(|wide| test.name.starts_with(wide)))
                && reaches(test)
        };
        // First the tests of the module, then those of others.
        let mut batches: Vec<(bool, Batch)> = Vec::new();
        for program in &self.programs {
            for own in [true, false] {
                let is_own = |test: &&Test| (program.of_modules && test.name.starts_with(&module)) == own;
                for test in program.tests.iter().filter(concerns).filter(is_own) {
                    match batches.last_mut() {
                        Some((of, batch))
                            if *of == own
                                && std::ptr::eq(batch.program, program)
                                && batch.took + test.took < TOGETHER =>
                        {
                            batch.took += test.took;
                            batch.tests.push(test);
                        }
                        _ => batches.push((own, Batch { program, tests: vec![test], took: test.took })),
                    }
                }
            }
        }
        batches.sort_by_key(|(own, batch)| (!own, batch.took));
        let (name, value) = match text {
            Some(_) => ("EPIGRAPH_MUTANT_OF", &mutant.file),
            None => ("EPIGRAPH_MUTANT", &id),
        };
        for (_, batch) in &batches {
            let (passes, printed) = self.run(worker, batch, (name, value.as_ref()))?;
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

    /// Runs tests with a variable of the environment. Returns whether they pass, and what they printed.
    fn run(
        &self,
        worker: usize,
        batch: &Batch,
        (name, value): (&str, &OsStr),
    ) -> Result<(bool, String), Box<dyn Error>> {
        let mut command = Command::new(&batch.program.path);
        command.current_dir(&batch.program.folder).stdin(Stdio::null()).arg("--exact");
        command.args(batch.tests.iter().map(|test| &test.name));
        command.env(name, value).env("EPIGRAPH_MUTANT_TEXT", self.text(worker));
        // So that the cause is there as soon as the test has failed.
        command.arg("--nocapture");
        // Into a file: a full pipe would stop the program.
        let log = self.text(worker).with_extension("log");
        let out = fs::File::create(&log)?;
        let mut child = command.stderr(out.try_clone()?).stdout(out).spawn()?;
        let (start, most) = (Instant::now(), 4 * batch.took + Duration::from_secs(30));
        let passes = loop {
            if let Some(status) = child.try_wait()? {
                break status.success();
            }
            // One failure is enough.
            let has_failed = fs::read_to_string(&log).is_ok_and(|log| log.contains("... FAILED\n"));
            if has_failed || start.elapsed() > most {
                child.kill()?;
                child.wait()?;
                break false;
            }
            thread::sleep(Duration::from_millis(5));
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
