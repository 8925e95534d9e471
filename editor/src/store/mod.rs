//! State that outlives the window: the session, and unsaved changes.
//!
//! Both are RON files in the user's configuration folder. A thread of its own writes each file whole or not at all. A
//! file that cannot be read counts as missing, and is reported.

mod keeper;
mod recovery;
mod session;

use std::{
    io,
    path::{Path, PathBuf},
};

use serde::{Serialize, de::DeserializeOwned};

use keeper::Keeper;
use recovery::Kept;
pub use recovery::Recovery;
pub use session::{Seen, Stored};

/// The session's file.
const SESSION: &str = "session.ron";

/// The folder of these files.
pub struct Store {
    folder: PathBuf,
    keeper: Keeper,
    /// The last saved session.
    session: String,
    /// The document as of the last recovery file, if there is one.
    kept: Option<Kept>,
}

impl Store {
    /// In the user's folder for configuration: `XDG_CONFIG_HOME` or `~/.config` on Linux, `~/Library/Application
    /// Support` on macOS, roaming `AppData` on Windows. `None` if there is no such folder.
    pub fn of_user() -> Option<Self> {
        Some(Self::at(dirs::config_dir()?.join("epigraph-editor")))
    }

    /// A store in this folder, which is created with its first file.
    pub fn at(folder: PathBuf) -> Self {
        Self { folder, keeper: Keeper::start(), session: String::new(), kept: None }
    }

    /// The last session.
    ///
    /// # Errors
    /// There is a session that cannot be read.
    pub fn session(&self) -> Result<Option<Stored>, String> {
        self.read(SESSION)
    }

    /// Saves the session, unless it equals the last saved one.
    pub fn keep_session(&mut self, stored: &Stored<impl Serialize>) {
        let Ok(text) = text(stored) else { return };
        if text != self.session {
            self.session.clone_from(&text);
            self.keeper.write(self.folder.join(SESSION), text);
        }
    }

    /// Waits until everything is written.
    pub fn flush(&mut self) {
        self.keeper.flush();
    }

    fn read<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, String> {
        let path = self.folder.join(name);
        let wrong = |why: String| format!("{}: {why}", path.display());
        match epigraph_files::text(&path) {
            Ok(text) => ron::from_str(&text).map(Some).map_err(|error| wrong(error.to_string())),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(wrong(error.to_string())),
        }
    }
}

fn text(value: &impl Serialize) -> ron::Result<String> {
    ron::ser::to_string_pretty(value, ron::ser::PrettyConfig::default())
}

/// The absolute path of a file, with links resolved if it exists.
fn real(path: &str) -> String {
    let path = Path::new(path);
    path.canonicalize()
        .or_else(|_| std::path::absolute(path))
        .map_or(path.to_owned(), |path| path)
        .display()
        .to_string()
}
