//! Main memory: how much the process has used at most, and how much there is.

use std::fs;

use epigraph_pictures::readable;

use crate::Error;

/// Most bytes that the process has held in main memory at once; none where the system does not say.
pub fn peak() -> Option<u64> {
    field("/proc/self/status", "VmHWM:")
}

/// Bytes that may be had without swapping; none where the system does not say.
pub fn available() -> Option<u64> {
    field("/proc/meminfo", "MemAvailable:")
}

/// Makes sure that there are about so many bytes, because systems that promise more than they have end the program
/// later without a word.
pub fn require(bytes: u64) -> Result<(), Error> {
    match available() {
        Some(free) if bytes > free => Err(Error::Memory(format!(
            "this needs {} of memory, but only {} are free; choose a smaller size",
            readable(bytes),
            readable(free)
        ))),
        _ => Ok(()),
    }
}

/// A line `NAME  N kB` of one of Linux's files, in bytes.
fn field(file: &str, name: &str) -> Option<u64> {
    let text = fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}
