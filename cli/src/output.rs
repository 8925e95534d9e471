//! What commands write: results on stdout, and files.
//!
//! Every command names its files first ([`Outputs`]), so that a mistyped path costs no work; then it reads all of its
//! inputs; then it is [`Outputs::ready`], unless one of the files is an input. At the end it writes all files together.

use std::{
    io::{self, Write},
    path::Path,
};

use epigraph_files::{Draft, Target, commit};
use serde_json::Value;

use crate::error::CliError;

/// Writes to stdout. A closed pipe (`| head`) is not an error.
pub fn print(text: &str) -> Result<(), CliError> {
    match io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(CliError::write(Path::new("stdout"), error))
        }
        _ => Ok(()),
    }
}

/// The files that a command will write, each with the option that names it. No two are the same file.
#[derive(Default)]
pub struct Outputs(Vec<(&'static str, Target)>);

/// One of these files.
#[derive(Clone, Copy, Debug)]
pub struct Output(usize);

/// The destination of JSON.
#[derive(Clone, Copy, Debug)]
pub enum Json {
    /// No JSON.
    None,
    /// Stdout, instead of the text.
    Stdout,
    /// A file, in addition to the text on stdout.
    File(Output),
}

impl Outputs {
    /// Adds the file that an option names.
    ///
    /// # Errors
    /// If the file cannot be written, or if another option names the same one: the later one would replace what the
    /// earlier one wrote.
    pub fn add(&mut self, option: &'static str, path: &Path) -> Result<Output, CliError> {
        let target = Target::new(path)?;
        let same = self.0.iter().find(|(_, other)| other.is(&target)).map(|(option, _)| *option);
        if let Some(other) = same.or_else(|| target.standard_stream()) {
            let text = format!("{other} and {option} both write {}; name another file", path.display());
            return Err(CliError::Input(text));
        }
        self.0.push((option, target));
        Ok(Output(self.0.len() - 1))
    }

    /// Adds the file of `--json`, unless that is `-`.
    ///
    /// # Errors
    /// Those of [`Outputs::add`].
    pub fn json(&mut self, path: Option<&Path>) -> Result<Json, CliError> {
        match path {
            None => Ok(Json::None),
            Some(path) if path == Path::new("-") => Ok(Json::Stdout),
            Some(path) => Ok(Json::File(self.add("--json", path)?)),
        }
    }

    /// Call this when all inputs are read, and before the work begins.
    ///
    /// # Errors
    /// If one of the files is an input.
    pub fn ready(self) -> Result<Ready, CliError> {
        self.spare_inputs()?;
        Ok(Ready { outputs: self, drafts: Vec::new() })
    }

    fn spare_inputs(&self) -> Result<(), CliError> {
        for (option, target) in &self.0 {
            if let Some(input) = target.input() {
                let (path, input) = (target.path().display(), input.display());
                let text = format!(
                    "{option} {path} would replace {input}, which the command reads; name another file"
                );
                return Err(CliError::Input(text));
            }
        }
        Ok(())
    }
}

/// The files of a command that has read its inputs. They take their places together, in [`Ready::commit`].
pub struct Ready {
    outputs: Outputs,
    drafts: Vec<Draft>,
}

impl Ready {
    /// The path of a file.
    pub fn path(&self, file: Output) -> &Path {
        self.outputs.0[file.0].1.path()
    }

    /// Writes a file beside its place; a pipe or a device gets the bytes.
    ///
    /// # Errors
    /// The system's error.
    pub fn put(&mut self, file: Output, bytes: &[u8]) -> Result<(), CliError> {
        self.drafts.push(self.outputs.0[file.0].1.draft(bytes)?);
        Ok(())
    }

    /// Puts all files in their places. If a file cannot be written, all old ones stay.
    ///
    /// # Errors
    /// The system's error. If a file is an input that was read only after [`Outputs::ready`].
    pub fn commit(self) -> Result<(), CliError> {
        self.outputs.spare_inputs()?;
        Ok(commit(self.drafts)?)
    }

    /// Writes `value` to the destination of JSON, puts all files in their places, and prints `text` unless the JSON goes
    /// to stdout.
    ///
    /// # Errors
    /// Those of [`Ready::put`] and [`Ready::commit`], and an error of stdout.
    pub fn finish(mut self, json: Json, value: &Value, text: &str) -> Result<(), CliError> {
        let value = format!("{value:#}\n");
        if let Json::File(file) = json {
            self.put(file, value.as_bytes())?;
        }
        self.commit()?;
        print(if matches!(json, Json::Stdout) { &value } else { text })
    }
}
