//! The graph, scene and settings at the start of the program: those of the arguments, or else of the last session.

use crate::{
    document::Document,
    engine::Options,
    files::find_graph,
    store::{Store, Stored},
};

/// The graph to open if none is named.
const FIRST: &str = "epi";

/// The initial contents of the window.
pub struct Opening {
    /// The graph.
    pub document: Document,
    /// The engine's initial settings.
    pub options: Options,
    /// The last session.
    pub stored: Option<Stored>,
    /// The store that keeps the session.
    pub store: Option<Store>,
    /// A notice for the user.
    pub notice: Option<String>,
}

impl Opening {
    /// Opens the named graph and scene, or if none is named, the last session's, or else the defaults. The settings are
    /// the last session's. If that session cannot be read, a notice says so.
    ///
    /// # Errors
    /// The named graph cannot be read.
    pub fn new(
        store: Option<Store>,
        graph: Option<&str>,
        scene: Option<&str>,
        options: Options,
    ) -> Result<Self, String> {
        let (stored, mut notice) = match store.as_ref().map_or(Ok(None), Store::session) {
            Ok(stored) => (stored, None),
            Err(error) => {
                (None, Some(format!("the last session could not be read, so this is a new one: {error}")))
            }
        };
        let open = |name: &str| Document::open(&find_graph(name)).map_err(|problems| problems.to_string());
        let last = stored.as_ref().map(|stored| stored.graph.as_str());
        let document = match (graph, last) {
            (Some(name), _) => open(name)?,
            (None, None) => open(FIRST)?,
            (None, Some(last)) => match open(last) {
                Ok(document) => document,
                Err(error) => {
                    notice = Some(error);
                    open(FIRST)?
                }
            },
        };
        let mut options = options;
        if let Some(stored) = &stored {
            options.scene.clone_from(&stored.scene);
            options.size = stored.size;
            options.samples = stored.samples / 100.0;
            options.backend = stored.backend;
            options.pacing = stored.pacing;
        }
        if let Some(scene) = scene {
            options.scene = scene.into();
        }
        Ok(Self { document, options, stored, store, notice })
    }
}
