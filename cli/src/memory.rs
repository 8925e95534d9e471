//! Main memory: how much the process has used at most, and how much there is.

use std::fs;

use crate::error::CliError;

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
pub fn require(bytes: u64) -> Result<(), CliError> {
    match available() {
        Some(free) if bytes > free => Err(CliError::Input(format!(
            "this needs {} of memory, but only {} are free; choose a smaller --size",
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

/// Bytes for people: `12.3 MiB`.
pub fn readable(bytes: u64) -> String {
    const UNITS: [&str; 4] = ["KiB", "MiB", "GiB", "TiB"];
    if bytes < 1024 {
        return format!("{bytes} B");
    }
    let mut value = bytes as f64 / 1024.0;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.1} {}", UNITS[unit])
}

#[cfg(test)]
mod tests {
    #[test]
    fn bytes_are_readable() {
        let texts = [0, 1023, 1024, 1536 * 1024, 5 << 40].map(super::readable);
        assert_eq!(texts, ["0 B", "1023 B", "1.0 KiB", "1.5 MiB", "5.0 TiB"]);
    }
}
