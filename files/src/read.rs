//! Reading, up to a limit.

use std::{
    collections::BTreeSet,
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
};

/// The limit for texts, in bytes: graphs, shaders, scenes, flights, material libraries.
pub const MOST_TEXT: u64 = 16 << 20;

/// The limit for models and pictures, in bytes.
pub const MOST_DATA: u64 = 1 << 30;

/// U+FEFF in UTF-8. Some editors begin a file with it.
const MARK: &[u8] = b"\xEF\xBB\xBF";

/// The files that this process has read, by their paths without links.
static READ: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// The text of a file of at most [`MOST_TEXT`] bytes, without a byte-order mark at its beginning.
///
/// # Errors
/// The file cannot be read, is longer, or is not UTF-8 text.
pub fn text(path: &Path) -> io::Result<String> {
    text_of(bytes(path, MOST_TEXT)?)
}

/// The text of a file's contents, without a byte-order mark at its beginning.
///
/// # Errors
/// It is not UTF-8 text.
pub fn text_of(mut bytes: Vec<u8>) -> io::Result<String> {
    bytes.drain(..bytes.len() - without_mark(&bytes).len());
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        io::Error::new(io::ErrorKind::InvalidData, format!("it is not UTF-8 text (byte {at})"))
    })
}

/// The contents of a file of at most `most` bytes.
///
/// # Errors
/// The file cannot be read, or is longer.
pub fn bytes(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let data = file.metadata()?;
    let mut bytes = Vec::new();
    if data.is_file() {
        noted().insert(path.canonicalize()?);
        if data.len() > most {
            return Err(too_long(most));
        }
        bytes.try_reserve_exact(data.len() as usize)?;
    }
    // The length is unknown for a pipe, infinite for a device such as /dev/zero, and 0 for the files of /proc.
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_long(most)) } else { Ok(bytes) }
}

/// UTF-8 text without a byte-order mark.
pub fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(MARK).unwrap_or(text)
}

/// The files that this process has read.
pub(crate) fn noted() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A set of paths is valid whatever a thread that panicked did to it.
    READ.lock().unwrap_or_else(PoisonError::into_inner)
}

fn too_long(most: u64) -> io::Error {
    let cause = format!("it is longer than {} MiB, the limit for a file of this kind", most >> 20);
    io::Error::new(io::ErrorKind::FileTooLarge, cause)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_is_read_up_to_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::write(&path, vec![7; 1 << 20]).unwrap();
        assert_eq!(bytes(&path, 1 << 20).unwrap(), vec![7; 1 << 20]);
        fs::write(&path, vec![7; (1 << 20) + 1]).unwrap();
        let error = bytes(&path, 1 << 20).unwrap_err().to_string();
        assert_eq!(error, "it is longer than 1 MiB, the limit for a file of this kind");
        // A file with a hole, whose length memory could not hold.
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(bytes(&path, 1 << 20).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(bytes(&folder.path().join("none"), 1).unwrap_err().kind(), io::ErrorKind::NotFound);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_without_end_are_refused_and_files_without_a_length_read() {
        let error = text(Path::new("/dev/zero")).unwrap_err();
        assert!(error.to_string().contains("longer than 16 MiB"), "{error}");
        let status = Path::new("/proc/self/status");
        assert_eq!(fs::metadata(status).unwrap().len(), 0);
        assert!(text(status).unwrap().contains("VmRSS"));
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_the_text() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        for (written, read) in [("\u{FEFF}Graph(", "Graph("), ("Graph(\u{FEFF}", "Graph(\u{FEFF}"), ("", "")]
        {
            fs::write(&path, written).unwrap();
            assert_eq!(text(&path).unwrap(), read);
        }
        fs::write(&path, b"ab\xFF").unwrap();
        assert_eq!(text(&path).unwrap_err().to_string(), "it is not UTF-8 text (byte 2)");
    }
}
