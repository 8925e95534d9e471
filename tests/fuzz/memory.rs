//! The time and the memory that mutants take.

use std::{
    fmt::{self, Display, Formatter},
    fs,
    time::{Duration, Instant},
};

/// The slowest of some mutants, and the one that took most memory beyond ten times its size.
#[derive(Default)]
pub struct Figures {
    slowest: Option<(Duration, usize)>,
    largest: Option<Memory>,
}

/// What a mutant took.
struct Memory {
    /// The file's size in bytes.
    file: usize,
    /// The most memory in use at once, in bytes, beside what was in use before.
    taken: usize,
    mutant: usize,
}

impl Memory {
    fn beyond(&self) -> usize {
        self.taken.saturating_sub(10 * self.file)
    }
}

impl Figures {
    /// Notes what reading a mutant of `size` bytes, by its number, takes.
    pub fn of<T>(&mut self, mutant: usize, size: usize, read: impl FnOnce() -> T) -> T {
        // From now on the peak is that of this file (proc(5)). Where there is no such file, the peak is not known.
        let before = fs::write("/proc/self/clear_refs", "5").ok().and_then(|()| peak());
        let start = Instant::now();
        let read = read();
        let time = start.elapsed();
        if self.slowest.as_ref().is_none_or(|(longest, _)| time > *longest) {
            self.slowest = Some((time, mutant));
        }
        if let (Some(before), Some(after)) = (before, peak()) {
            let memory = Memory { file: size, taken: after.saturating_sub(before), mutant };
            if self.largest.as_ref().is_none_or(|largest| memory.beyond() > largest.beyond()) {
                self.largest = Some(memory);
            }
        }
        read
    }
}

impl Display for Figures {
    /// Two cells of a table.
    fn fmt(&self, to: &mut Formatter) -> fmt::Result {
        if let Some((time, mutant)) = &self.slowest {
            write!(to, "{:.3} s ({mutant})", time.as_secs_f64())?;
        }
        write!(to, " | ")?;
        if let Some(Memory { file, taken, mutant }) = &self.largest {
            write!(to, "{:.1} MB for {:.1} kB ({mutant})", *taken as f64 / 1e6, *file as f64 / 1e3)?;
        }
        Ok(())
    }
}

/// The most memory that the process had at once since the peak was reset, in bytes.
fn peak() -> Option<usize> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: usize = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kilobytes)
}
