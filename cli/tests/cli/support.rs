//! Runs the program in an empty folder.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
};

use tempfile::TempDir;

/// An empty folder to run in.
pub struct Place(TempDir);

/// The result of a run.
pub struct Run {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Place {
    /// Makes a new empty folder.
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    /// The path of a file in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file in it.
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).expect("the folder is writable");
    }

    /// The names of the files in it, sorted.
    pub fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).expect("the folder exists");
        let name = |entry: std::io::Result<fs::DirEntry>| entry.expect("readable").file_name();
        let mut names: Vec<String> =
            entries.map(name).map(|name| name.to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// Runs `epigraph` in it with these words.
    pub fn run(&self, words: &str) -> Run {
        run(&mut command(self.0.path(), words))
    }

    /// Starts `epigraph` in it.
    #[cfg(target_os = "linux")]
    pub fn start(&self, words: &str) -> Running {
        let mut command = command(self.0.path(), words);
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Running(command.spawn().expect("the program was built"))
    }

    /// Runs `epigraph` without any graphics driver.
    pub fn run_without_gpu(&self, words: &str) -> Run {
        // The Vulkan loader then looks for drivers in this file alone (two names: it was renamed).
        let nothing = self.path("no-driver.json");
        let mut command = command(self.0.path(), words);
        run(command.env("VK_DRIVER_FILES", &nothing).env("VK_ICD_FILENAMES", &nothing))
    }

    /// Runs `epigraph`, which must fail with code 1, not panic, and leave the folder as it was. Returns its message.
    pub fn fails(&self, words: &str) -> String {
        let before = self.files();
        let run = self.run(words);
        assert_eq!(run.code, Some(1), "`{words}` gave {:?}\n{}\n{}", run.code, run.stdout, run.stderr);
        assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
        assert_eq!(self.files(), before, "`{words}` left something behind");
        run.stderr
    }

    /// Runs `epigraph`, which must succeed. Returns its output.
    pub fn succeeds(&self, words: &str) -> String {
        let run = self.run(words);
        assert_eq!(run.code, Some(0), "`{words}` gave\n{}\n{}", run.stdout, run.stderr);
        run.stdout
    }
}

/// A running program.
#[cfg(target_os = "linux")]
pub struct Running(Child);

#[cfg(target_os = "linux")]
impl Running {
    /// Its process.
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// Waits until it ends.
    pub fn wait(self) -> Run {
        Run::of(self.0.wait_with_output().expect("it was started"))
    }
}

impl Run {
    fn of(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Self { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }
}

fn command(folder: &Path, words: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_epigraph"));
    command.args(words.split_whitespace()).current_dir(folder);
    command
}

fn run(command: &mut Command) -> Run {
    Run::of(command.output().expect("the program was built"))
}
