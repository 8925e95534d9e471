//! Text that was not saved when the program ended, whatever ended it.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{Store, real, text};
use crate::document::Document;

/// Unsaved texts of a graph and its parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recovery {
    /// The graph's file.
    pub graph: String,
    /// Files and their texts.
    pub texts: Vec<(String, String)>,
}

impl Store {
    /// Keeps what is unsaved in a document, and forgets it once it is saved; nothing happens while neither has changed.
    pub fn keep_unsaved(&mut self, document: &Document) {
        let now = (document.revision(), document.path().to_owned());
        let dirty = document.is_dirty();
        if !dirty {
            if let Some((_, path)) = self.kept.take() {
                self.keeper.remove(self.recovery_file(&path));
            }
        } else if self.kept.as_ref() != Some(&now) {
            let texts = document.unsaved().map(|(path, text)| (real(path), text.to_owned())).collect();
            let recovery = Recovery { graph: real(document.path()), texts };
            if let Ok(text) = text(&recovery) {
                self.keeper.write(self.recovery_file(document.path()), text);
            }
            self.kept = Some(now);
        }
    }

    /// Another document is open from now on: what is kept of the one before stays.
    pub fn change_document(&mut self) {
        self.kept = None;
    }

    /// What was unsaved of a document when it was open last, where that differs from what it says now.
    pub fn recovery(&self, document: &Document) -> Option<Recovery> {
        let name = self.recovery_file(document.path());
        let recovery: Recovery = self.read(name.file_name()?.to_str()?).ok()??;
        let differs = |path: &str| {
            recovery.texts.iter().any(|(of, text)| *of == real(path) && document.text(path) != text)
        };
        (recovery.graph == real(document.path()) && document.paths().any(differs)).then_some(recovery)
    }

    /// Forgets what was unsaved.
    pub fn discard(&mut self, document: &Document) {
        self.keeper.remove(self.recovery_file(document.path()));
    }

    fn recovery_file(&self, path: &str) -> PathBuf {
        // FNV-1a, so that a path of any length and any letters makes a file name.
        let hash = real(path).bytes().fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
        });
        self.folder.join(format!("unsaved-{hash:016x}.ron"))
    }
}

impl Recovery {
    /// Makes the document say it, as one change.
    pub fn take_over(self, document: &mut Document) {
        let paths: Vec<String> = document.paths().map(Into::into).collect();
        let texts = paths.into_iter().filter_map(|path| {
            let (_, text) = self.texts.iter().find(|(of, _)| *of == real(&path))?;
            Some((path, text.clone()))
        });
        document.replace_texts(texts.collect());
    }
}
