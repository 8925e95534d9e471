//! Writing: a file is replaced whole or not at all.
//!
//! A file is first written beside its place under a short name of its own, a *draft*, and renamed when it is complete.
//! Its writer holds a lock on the draft as long as it lives, so that the next one can tell which drafts were left behind
//! by a process that was killed.

use std::{
    collections::BTreeSet,
    env,
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use tempfile::{NamedTempFile, TempDir};

use crate::{
    FileError,
    identity::{Identity, folder_of, is_stream},
    read::noted,
};

/// How the names of drafts begin and end. Some random letters are between.
const DRAFT: [&str; 2] = [".epigraph-", ".tmp"];

/// A file to be written later, in a folder that was found to be writable. Links to it stay, and lead to the new file;
/// pipes and devices get the bytes.
#[derive(Clone, Debug)]
pub struct Target {
    path: PathBuf,
    /// `None` for a stream.
    file: Option<Identity>,
}

impl Target {
    /// Checks that the file can be written, so that no work is lost to a mistyped path. Leaves nothing behind.
    ///
    /// # Errors
    /// The path is a folder, its folder does not exist, or one of them is write-protected.
    pub fn new(path: &Path) -> Result<Self, FileError> {
        let fail = |error: io::Error| FileError::write(path, error);
        if path.is_dir() {
            return Err(FileError::write(path, "it is a folder; name a file in it"));
        }
        if path.file_name().is_none() {
            return Err(FileError::write(path, "it has no name"));
        }
        let folder = folder_of(path);
        if !folder.is_dir() {
            let cause = format!("there is no folder {}; make it first", folder.display());
            return Err(FileError::write(path, cause));
        }
        let file = Identity::of(path).map_err(fail)?;
        if let Some(file) = &file {
            if path.exists() {
                // Renaming would replace even a write-protected file, which its owner does not want.
                fs::OpenOptions::new().append(true).open(path).map_err(fail)?;
            }
            // Dropping the draft removes it again.
            beside(file.path()).map_err(fail)?;
        }
        Ok(Self { path: path.to_owned(), file })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether both are one file, of which the last to be written would be left.
    pub fn is(&self, other: &Self) -> bool {
        matches!((&self.file, &other.file), (Some(a), Some(b)) if a.is(b))
    }

    /// Where this process writes its results or messages, `stdout` or `stderr`, if that is this file.
    pub fn standard_stream(&self) -> Option<&'static str> {
        let file = self.file.as_ref()?;
        Identity::of_standard_streams().into_iter().find_map(|(name, other)| file.is(&other).then_some(name))
    }

    /// The path of the file, if this process has read it: writing would replace an input.
    pub fn input(&self) -> Option<PathBuf> {
        let file = self.file.as_ref()?;
        let is = |input: &&PathBuf| {
            Identity::of(input).is_ok_and(|other| other.is_some_and(|other| file.is(&other)))
        };
        noted().iter().find(is).cloned()
    }

    /// Writes the whole file, or leaves the old one in place.
    ///
    /// # Errors
    /// The system's error.
    pub fn write(&self, bytes: &[u8]) -> Result<(), FileError> {
        self.draft(bytes)?.commit()
    }

    /// A draft with these bytes.
    ///
    /// # Errors
    /// The system's error.
    pub fn draft(&self, bytes: &[u8]) -> Result<Draft, FileError> {
        let draft = self.begin()?;
        draft.file().write_all(bytes).map_err(|error| FileError::write(&self.path, error))?;
        Ok(draft)
    }

    /// Begins a file that is written in pieces.
    ///
    /// # Errors
    /// The system's error.
    pub fn begin(&self) -> Result<Draft, FileError> {
        let fail = |error: io::Error| FileError::write(&self.path, error);
        if is_stream(&self.path) {
            let stream = fs::OpenOptions::new().write(true).open(&self.path).map_err(fail)?;
            return Ok(Draft { path: self.path.clone(), to: To::Stream(stream) });
        }
        let file =
            Identity::of(&self.path).map_err(fail)?.ok_or(io::ErrorKind::NotFound.into()).map_err(fail)?;
        let beside = beside(file.path()).map_err(fail)?;
        if let Ok(old) = fs::metadata(file.path()) {
            beside.as_file().set_permissions(old.permissions()).map_err(fail)?;
        }
        Ok(Draft { path: self.path.clone(), to: To::File { beside, place: file.path().to_owned() } })
    }
}

/// A file that replaces its target when committed. Dropping it leaves the old file as it was, and nothing else.
#[derive(Debug)]
pub struct Draft {
    /// The target as the user names it.
    path: PathBuf,
    to: To,
}

#[derive(Debug)]
enum To {
    /// A pipe or a device.
    Stream(File),
    /// A file, written beside the place that it takes.
    File { beside: NamedTempFile, place: PathBuf },
}

impl Draft {
    /// A handle to write through. Writes after [`Draft::commit`] may be lost.
    ///
    /// # Errors
    /// The system's error.
    pub fn writer(&self) -> Result<File, FileError> {
        self.file().try_clone().map_err(|error| FileError::write(&self.path, error))
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// The system's error; the old file stays.
    pub fn commit(self) -> Result<(), FileError> {
        commit(vec![self])
    }

    fn file(&self) -> &File {
        match &self.to {
            To::Stream(stream) => stream,
            To::File { beside, .. } => beside.as_file(),
        }
    }

    /// Waits until the system has stored all bytes, which is where a full disk shows at the latest.
    fn store(&self) -> Result<(), FileError> {
        match &self.to {
            To::Stream(_) => Ok(()),
            To::File { beside, .. } => {
                beside.as_file().sync_all().map_err(|error| FileError::write(&self.path, error))
            }
        }
    }

    /// The file that it replaces, opened.
    fn old(&self) -> Option<File> {
        match &self.to {
            To::Stream(_) => None,
            To::File { place, .. } => File::open(place).ok(),
        }
    }

    /// Puts the file in its place, and returns the path as the user names it.
    fn place(self) -> Result<PathBuf, FileError> {
        if let To::File { beside, place } = self.to {
            beside.persist(place).map_err(|error| FileError::write(&self.path, error.error))?;
        }
        Ok(self.path)
    }
}

/// Puts files that belong together in their places: only when all of them are stored, and then at once, one rename after
/// the other.
///
/// # Errors
/// The system's error. All old files stay, unless it is a rename that fails after another: the error then says which
/// files are new.
pub fn commit(drafts: Vec<Draft>) -> Result<(), FileError> {
    drafts.iter().try_for_each(Draft::store)?;
    // A rename that ends the old file waits while its blocks are freed, which takes milliseconds; one that leaves it open
    // takes microseconds. So few are killed between two of them. Windows does not replace files that are open.
    let _old: Vec<File> = drafts.iter().filter(|_| cfg!(unix)).filter_map(Draft::old).collect();
    let mut new: Vec<String> = Vec::new();
    for draft in drafts {
        let path = draft.path.clone();
        match draft.place() {
            Ok(path) => new.push(path.display().to_string()),
            Err(error) if new.is_empty() => return Err(error),
            Err(error) => {
                let cause = format!("{}; {} is new already, the rest is old", error.cause(), new.join(", "));
                return Err(FileError::write(&path, cause));
            }
        }
    }
    Ok(())
}

/// An empty folder among the system's temporary files. It is removed, with all that is in it, when this is dropped.
#[derive(Debug)]
pub struct TemporaryFolder(TempDir);

impl TemporaryFolder {
    /// A new folder with a name of its own.
    ///
    /// # Errors
    /// The system's.
    pub fn new() -> Result<Self, FileError> {
        tempfile::tempdir().map(Self).map_err(|error| FileError::write(&env::temp_dir(), error))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

/// Writes a new folder with these files, by their paths in it, whole or not at all.
///
/// # Errors
/// The path exists, its folder does not, or the system's error.
pub fn write_folder(path: &Path, files: &[(String, String)]) -> Result<(), FileError> {
    let fail = |error: io::Error| FileError::write(path, error);
    if path.exists() {
        return Err(fail(io::ErrorKind::AlreadyExists.into()));
    }
    let parent = folder_of(path);
    sweep_once(parent);
    let draft =
        tempfile::Builder::new().prefix(DRAFT[0]).suffix(DRAFT[1]).tempdir_in(parent).map_err(fail)?;
    // Where a folder cannot be locked, nobody removes what is left behind.
    let lock = File::open(draft.path()).and_then(|folder| folder.lock().map(|()| folder));
    for (file, text) in files {
        let file = draft.path().join(file);
        fs::create_dir_all(folder_of(&file)).map_err(fail)?;
        let mut file = File::create_new(file).map_err(fail)?;
        file.write_all(text.as_bytes()).and_then(|()| file.sync_all()).map_err(fail)?;
    }
    fs::rename(draft.path(), path).map_err(fail)?;
    drop(lock);
    Ok(())
}

/// A draft in the folder of a file, locked by this process. First removes drafts that were left behind there.
fn beside(file: &Path) -> io::Result<NamedTempFile> {
    let folder = folder_of(file);
    sweep_once(folder);
    let mut builder = tempfile::Builder::new();
    builder.prefix(DRAFT[0]).suffix(DRAFT[1]);
    #[cfg(unix)]
    {
        // The permissions of any new file, less the user's umask; the default lets nobody else read it.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    loop {
        let draft = builder.tempfile_in(folder)?;
        // Where a file system knows no locks, nobody removes what is left behind.
        let locked = draft.as_file().lock().is_ok();
        // Before it was locked, another process may have removed it.
        if !locked || draft.path().exists() {
            return Ok(draft);
        }
    }
}

/// Removes the drafts that earlier processes left behind in a folder, when this process first writes there.
fn sweep_once(folder: &Path) {
    static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let Ok(folder) = folder.canonicalize() else { return };
    if SWEPT.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.clone()) {
        sweep(&folder);
    }
}

/// Removes the drafts in a folder whose writers no longer live.
fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let is_draft =
            name.to_str().is_some_and(|name| name.starts_with(DRAFT[0]) && name.ends_with(DRAFT[1]));
        let Some(kind) = entry.file_type().ok().filter(|kind| is_draft && (kind.is_file() || kind.is_dir()))
        else {
            continue;
        };
        let Ok(file) = File::open(entry.path()) else { continue };
        if file.try_lock().is_ok() {
            let remove = if kind.is_dir() { fs::remove_dir_all } else { fs::remove_file::<PathBuf> };
            // If it cannot be removed, it stays: that is no reason not to write.
            let _ = remove(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_temporary_folder_goes_with_all_that_is_in_it() {
        let folder = TemporaryFolder::new().unwrap();
        let path = folder.path().to_owned();
        fs::write(path.join("a"), "a").unwrap();
        assert_ne!(TemporaryFolder::new().unwrap().path(), path);
        drop(folder);
        assert!(!path.exists());
    }

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let target = Target::new(&path).unwrap();
        assert!(!path.exists(), "only write() makes the file");
        target.write(b"one").unwrap();
        Target::new(&path).unwrap().write(b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_fails_or_is_given_up_leaves_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let draft = Target::new(&path).unwrap().begin().unwrap();
        draft.writer().unwrap().write_all(b"half").unwrap();
        drop(draft);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);

        // A folder takes the place in the meantime.
        let target = Target::new(&folder.path().join("b")).unwrap();
        fs::create_dir(target.path()).unwrap();
        fs::write(target.path().join("c"), "").unwrap();
        let text = target.begin().unwrap_err().to_string();
        assert!(text.starts_with(&format!("cannot write {}: ", target.path().display())), "{text}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_so_do_permissions() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("a.txt"), folder.path().join("link.txt"));
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        fs::write(&path, "old").unwrap();
        let usual = mode(&path);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        symlink(&path, &link).unwrap();
        Target::new(&link).unwrap().write(b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!((fs::read(&path).unwrap(), mode(&path)), (b"new".to_vec(), 0o640));

        let fresh = folder.path().join("b.txt");
        Target::new(&fresh).unwrap().write(b"new").unwrap();
        assert_eq!(mode(&fresh), usual);
    }

    #[cfg(unix)]
    #[test]
    fn a_private_file_stays_private() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        let draft = Target::new(&path).unwrap().begin().unwrap();
        // Nobody else may read the draft either.
        assert_eq!(draft.file().metadata().unwrap().permissions().mode() & 0o777, 0o600);
        draft.commit().unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_file_that_is_not_there_yet_stays_and_makes_it() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("deep")).unwrap();
        symlink("deep/next", path("link")).unwrap();
        symlink("file", path("deep/next")).unwrap();
        Target::new(&path("link")).unwrap().write(b"new").unwrap();
        assert_eq!(fs::read(path("deep/file")).unwrap(), b"new");
        assert!([path("link"), path("deep/next")].iter().all(|path| path.is_symlink()));
        assert_eq!(fs::read_dir(path("deep")).unwrap().count(), 2);
        symlink("none/file", path("astray")).unwrap();
        assert!(Target::new(&path("astray")).is_err());
    }

    #[test]
    fn a_name_may_be_as_long_as_the_system_takes() {
        let folder = tempfile::tempdir().unwrap();
        for length in [249, 255] {
            let path = folder.path().join("n".repeat(length));
            Target::new(&path).unwrap().write(b"new").unwrap();
            assert_eq!(fs::read(&path).unwrap(), b"new");
        }
        assert!(Target::new(&folder.path().join("n".repeat(256))).is_err());
    }

    #[test]
    fn drafts_of_writers_that_were_killed_go_and_those_of_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for name in [".epigraph-x.tmp", ".epigraph-x", ".a.txt.tmp"] {
            fs::write(path(name), "half").unwrap();
        }
        Target::new(&path("b.txt")).unwrap().write(b"whole").unwrap();
        let left = [".epigraph-x", ".a.txt.tmp", "b.txt"].iter().all(|name| path(name).exists());
        assert!(left && !path(".epigraph-x.tmp").exists());
        let other = Target::new(&path("a.txt")).unwrap().draft(b"half").unwrap();
        sweep(folder.path());
        other.commit().unwrap();
        assert_eq!(fs::read(path("a.txt")).unwrap(), b"half");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 4);
    }

    #[test]
    fn a_folder_is_written_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let file = |name: &str| (name.to_owned(), "text".to_owned());
        // What was left behind by a writer that was killed goes.
        fs::create_dir_all(path(".epigraph-x.tmp/deep")).unwrap();
        write_folder(&path("new"), &[file("a"), file("deep/b")]).unwrap();
        assert_eq!(fs::read(path("new/deep/b")).unwrap(), b"text");
        // What fails goes.
        for (name, files) in [("new", [file("a"), file("b")]), ("other", [file("a"), file("a/b")])] {
            assert!(write_folder(&path(name), &files).is_err());
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn files_that_belong_together_are_all_new_or_all_old() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a", "b", "c"].map(|name| folder.path().join(name));
        let drafts = |bytes: &[u8]| -> Vec<Draft> {
            paths.iter().map(|path| Target::new(path).unwrap().draft(bytes).unwrap()).collect()
        };
        let all = || paths.each_ref().map(|path| fs::read_to_string(path).unwrap());
        commit(drafts(b"one")).unwrap();
        let two = drafts(b"two");
        assert_eq!(all(), ["one"; 3]);
        drop(two);
        assert_eq!(all(), ["one"; 3]);

        // A folder takes a place after all was stored.
        let two = drafts(b"two");
        fs::remove_file(&paths[1]).unwrap();
        fs::create_dir(&paths[1]).unwrap();
        let text = commit(two).unwrap_err().to_string();
        let says =
            [&format!("cannot write {}: ", paths[1].display()), &format!("{} is new", paths[0].display())];
        assert!(says.iter().all(|part| text.contains(*part)) && text.ends_with("the rest is old"), "{text}");
        assert_eq!(fs::read(&paths[2]).unwrap(), b"one");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn what_was_read_is_an_input() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("deep")).unwrap();
        fs::write(path("a"), "").unwrap();
        fs::write(path("b"), "").unwrap();
        let input = |name: &str| Target::new(&path(name)).unwrap().input();
        assert_eq!((input("a"), input("new")), (None, None));
        crate::text(&path("a")).unwrap();
        let real = path("a").canonicalize().unwrap();
        fs::hard_link(path("a"), path("hard")).unwrap();
        assert_eq!(
            (input("a"), input("deep/../a"), input("hard")),
            (Some(real.clone()), Some(real.clone()), Some(real))
        );
        assert_eq!((input("b"), input("new")), (None, None));
        // Another file takes its name, and the name of the link leads to what was read no longer.
        fs::remove_file(path("a")).unwrap();
        assert_eq!(input("hard"), None);
    }

    /// Root may write what is write-protected, but not a program that runs.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_the_system_protects_is_not_replaced() {
        let refused = Target::new(&env::current_exe().unwrap()).unwrap_err().to_string();
        assert!(refused.contains("cannot write") && refused.contains("busy"), "{refused}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_pipe_gets_the_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::read(pipe).unwrap()
        });
        // Looking whether it can be written must not be taken for its end.
        let target = Target::new(&pipe).unwrap();
        target.write(b"through").unwrap();
        assert_eq!(reader.join().unwrap(), b"through");
        assert!(is_stream(&pipe) && target.input().is_none() && !target.is(&target));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_are_written_to_and_not_replaced() {
        use std::os::unix::fs::FileTypeExt;
        let is_device = |path: &str| fs::metadata(path).unwrap().file_type().is_char_device();
        Target::new(Path::new("/dev/null")).unwrap().write(b"gone").unwrap();
        assert!(Target::new(Path::new("/dev/full")).unwrap().write(b"too much").is_err());
        assert!(is_device("/dev/null") && is_device("/dev/full"));
    }

    #[test]
    fn what_cannot_be_written_is_found_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        let text = |path: &Path| Target::new(path).unwrap_err().to_string();
        assert!(text(folder.path()).contains("it is a folder"));
        assert!(text(&folder.path().join("none/a.png")).contains("there is no folder"));
        let file = folder.path().join("a.txt");
        fs::write(&file, "").unwrap();
        assert!(text(&file.join("b.txt")).contains("there is no folder"));
        assert!(text(Path::new("")).contains("it has no name"));
    }
}
