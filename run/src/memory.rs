//! Main memory: the peak use of the process, and the available amount.

use std::path::Path;

use epigraph_pictures::readable;

use crate::Error;

/// Peak main memory of the process in bytes; `None` if the system does not report it.
pub fn peak() -> Option<u64> {
    field("/proc/self/status", "VmHWM:")
}

/// Main memory available without swapping, in bytes; `None` if the system does not report it.
pub fn available() -> Option<u64> {
    field("/proc/meminfo", "MemAvailable:")
}

/// Checks that about `bytes` bytes of main memory are available. Systems that overcommit memory would otherwise kill
/// the process later without a message.
///
/// # Errors
/// [`Error::Memory`] if less is available.
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

/// The value of a line `NAME  N kB` in a file of Linux's `/proc`, in bytes.
fn field(file: &str, name: &str) -> Option<u64> {
    let text = epigraph_files::text(Path::new(file)).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}
