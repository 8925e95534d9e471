//! Requests of panes to the window, made while they are drawn. The window handles all of them in one place afterwards.

use egui_tiles::TileId;

/// A pane's request, which the app carries out once all panes are drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Intent {
    /// Show a port, `node.port`, in the viewer in use; if it is empty, the graph's first output.
    Show(String),
    /// Show a position in a text.
    Jump(Jump),
    /// Open a dialog.
    Ask(Ask),
    /// Pick a pixel of the frame, by column and row, and inspect it.
    Inspect([u32; 2]),
    /// Capture a port, `node.port`, in the next frames; repeated in each frame of the window.
    Watch(String),
    /// Make the viewer with this [`crate::panes::Viewer::id`] the one in use.
    Use(u64),
    /// Add a viewer to these tabs.
    AddViewer(TileId),
    /// Copy the command line that renders the picture in view to the clipboard.
    CopyCommandLine,
    /// Restore the default layout of the panes.
    ResetPanes,
    /// Open the help.
    Help,
}

/// A position in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Jump {
    /// The file.
    pub path: String,
    /// Line and column, from 1.
    pub at: (usize, usize),
}

/// The purpose of a dialog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// A graph to copy, then a name for the copy.
    NewGraph,
    /// A graph to change, then a name for the file with the changes.
    NewChange,
    /// A graph to open.
    OpenGraph,
    /// A scene to open.
    OpenScene,
    /// A recorded path to open.
    OpenPath,
    /// A name for the graph.
    SaveGraph,
    /// A name for the whole graph as one file.
    FullGraph,
    /// A name for the current path.
    SavePath,
    /// A port, and a name for its image.
    SaveImage,
    /// A name for the frames of the current path.
    RecordFrames,
}
