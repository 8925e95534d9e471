//! Names and positions of the window's widgets, for a program that drives it from outside with mouse and keyboard.

use std::{collections::HashMap, env, fs, path::PathBuf};

use egui::{
    Context, FullOutput, Plugin,
    accesskit::{Node, NodeId},
};
use serde::{Deserialize, Serialize};

/// The environment variable with the file, in RON, that a list of [`Widget`] is written to after each frame that
/// changes it.
pub const VARIABLE: &str = "EPIGRAPH_WIDGETS";

/// A widget, as assistive technology sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Widget {
    /// Its role: a `Button`, a `Slider`.
    pub role: String,
    /// Its name: its own text, or the text of its label.
    pub name: String,
    /// Its value; the text of a label.
    pub value: String,
    /// Left, top, right and bottom in the window, pixels.
    pub rect: [f64; 4],
}

/// Writes the widgets to the file in [`VARIABLE`], if it is set.
pub fn publish(context: &Context) {
    if let Some(path) = env::var_os(VARIABLE) {
        context.enable_accesskit();
        context.add_plugin(Widgets { path: path.into(), written: Vec::new() });
    }
}

struct Widgets {
    path: PathBuf,
    written: Vec<Widget>,
}

impl Plugin for Widgets {
    fn debug_name(&self) -> &'static str {
        "widgets"
    }

    fn output_hook(&mut self, context: &Context, output: &mut FullOutput) {
        let Some(update) = &output.platform_output.accesskit_update else { return };
        let nodes: HashMap<NodeId, &Node> = update.nodes.iter().map(|(id, node)| (*id, node)).collect();
        let scale = f64::from(context.pixels_per_point());
        let widgets = update.nodes.iter().filter_map(|(_, node)| {
            let label = node.labelled_by().first().and_then(|id| nodes.get(id)?.value());
            let [name, value] = [node.label().or(label), node.value()].map(Option::unwrap_or_default);
            let rect = node.bounds()?;
            Some(Widget {
                role: format!("{:?}", node.role()),
                name: name.into(),
                value: value.into(),
                rect: [rect.x0, rect.y0, rect.x1, rect.y1].map(|side| side * scale),
            })
        });
        let widgets: Vec<Widget> =
            widgets.filter(|widget| !(widget.name.is_empty() && widget.value.is_empty())).collect();
        if widgets != self.written
            && let Ok(text) = ron::to_string(&widgets)
            && fs::write(&self.path, text).is_ok()
        {
            self.written = widgets;
        }
    }
}
