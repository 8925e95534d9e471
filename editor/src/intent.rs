//! What panes ask of the window while they are drawn. The window does all of it in one place once they are.

use egui_tiles::TileId;

/// One thing that a pane asks for; [`crate::app::App::handle`] does it.
#[derive(Clone, Debug, PartialEq)]
pub enum Intent {
    /// Show a port, `node.port`, in the viewer in use; the graph's first output where it is empty.
    Show(String),
    /// Show a place in a text.
    Jump(Jump),
    /// Open a dialog.
    Ask(Ask),
    /// Pick a pixel of the frame, by column and row, and show it through the whole graph.
    Inspect([u32; 2]),
    /// Take a port's values, `node.port`, in the next frames; asked again in each frame of the window.
    Watch(String),
    /// Make the viewer with this [`crate::panes::Viewer::id`] the one in use.
    Use(u64),
    /// Add a viewer to these tabs.
    AddViewer(TileId),
    /// Put the command line that makes the picture in view on the clipboard.
    CopyCommandLine,
    /// Put the panes back as they were at first.
    ResetPanes,
    /// Open the help.
    Help,
}

/// A place in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Jump {
    /// The file.
    pub path: String,
    /// Line and column, from 1.
    pub at: (usize, usize),
}

/// What a dialog asks the user for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// A graph to copy, then a name for the copy.
    NewGraph,
    /// A graph to open.
    OpenGraph,
    /// A scene to open.
    OpenScene,
    /// A recorded path to open.
    OpenPath,
    /// A name for the graph.
    SaveGraph,
    /// A name for the path at hand.
    SavePath,
    /// A port, and a name for its image.
    SaveImage,
    /// A name for the frames of the path at hand.
    RecordFrames,
}
