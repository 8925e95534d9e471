//! What has been encoded so far, kept beside the output.

use std::{
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use epigraph_files::{FileError, Journal, is_stream};
use epigraph_streams::{Kept, Settings};

use crate::{args::EncodeArgs, error::CliError};

/// The file `OUT.part`; without one, nothing is kept.
#[derive(Default)]
pub struct Part {
    /// What an earlier run has done.
    pub kept: Kept,
    writer: Mutex<Option<Writer>>,
}

struct Writer {
    journal: Journal,
    /// Bytes of the file that are of an earlier run.
    valid: u64,
    /// Bytes that are not in the file yet.
    pending: Vec<u8>,
    begin: Instant,
    after: Duration,
    /// Whether the file is there.
    exists: bool,
}

impl Part {
    /// Reads what an earlier run with these settings has kept.
    pub fn new(args: &EncodeArgs, settings: &Settings) -> Result<Self, CliError> {
        if is_stream(&args.out) {
            return Ok(Self::default());
        }
        let journal = Journal::beside(&args.out);
        let bytes = journal.read()?;
        if !bytes.is_empty() && !Kept::is_kept(&bytes) {
            let path = journal.path().display();
            let text = format!(
                "{path} is in the way: it is no part of an earlier run; move it, or choose another --out"
            );
            return Err(CliError::Input(text));
        }
        let kept = Kept::read(&bytes, settings);
        if kept.count() > 0 {
            eprintln!("note: goes on from {}: {} nodes are done", journal.path().display(), kept.count());
        }
        let valid = kept.length() as u64;
        let writer = Writer {
            journal,
            valid,
            pending: if valid == 0 { Kept::header(settings) } else { Vec::new() },
            begin: Instant::now(),
            after: Duration::from_secs(args.keep_after.into()),
            exists: kept.count() > 0,
        };
        Ok(Self { kept, writer: Mutex::new(Some(writer)) })
    }

    fn writer(&self) -> MutexGuard<'_, Option<Writer>> {
        self.writer.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps the record of a node. If the file cannot be written, says so and keeps no more.
    pub fn keep(&self, record: &[u8]) {
        let mut guard = self.writer();
        let Some(writer) = &mut *guard else { return };
        writer.pending.extend_from_slice(record);
        if writer.begin.elapsed() < writer.after {
            return;
        }
        match writer.journal.append(writer.valid, &writer.pending) {
            Ok(()) => {
                writer.exists = true;
                writer.pending.clear();
            }
            Err(error) => {
                eprintln!("warning: {error}; an interruption will lose what is done");
                *guard = None;
            }
        }
    }

    /// After an interruption.
    pub fn say_how_to_go_on(&self) {
        if let Some(writer) = &*self.writer()
            && writer.exists
        {
            let path = writer.journal.path().display();
            eprintln!("note: what is done is kept in {path}; the same command goes on from there");
        }
    }

    /// Removes the file when all is done.
    pub fn remove(self) -> Result<(), FileError> {
        let writer = self.writer.into_inner().unwrap_or_else(PoisonError::into_inner);
        writer.map_or(Ok(()), |writer| writer.journal.remove())
    }
}
