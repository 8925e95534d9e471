//! The session as a serializable value.

use egui::ThemePreference;
use egui_tiles::Tree;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    engine::{Backend, Pace},
    panes::Pane,
};

/// The user's view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// The scene.
    pub scene: String,
    /// The eye, metres.
    pub eye: Vec3,
    /// From camera to world space.
    pub rotation: Quat,
}

/// The state to restore when the program starts again. It is serialized from a borrowed tree of panes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Stored<Panes = Tree<Pane>> {
    /// The graph's file.
    pub graph: String,
    /// The scene's name or file.
    pub scene: String,
    /// The user's view.
    pub seen: Option<Seen>,
    /// Width and height of the frame, pixels.
    pub size: [u32; 2],
    /// The resolution's scale.
    pub scale: f32,
    /// Maximum number of samples per frame, percent of its pixels.
    pub samples: f32,
    /// Default placement for nodes without `on:`.
    pub backend: Backend,
    /// When samples arrive.
    pub pacing: Pace,
    /// Light, dark, or following the system.
    pub theme: ThemePreference,
    /// Ports on the number keys.
    pub slots: [Option<String>; 9],
    /// Panes and viewers.
    pub panes: Panes,
}
