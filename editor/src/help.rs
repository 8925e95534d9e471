//! The window that lists keys and mouse.

use egui::{Align2, Context, Grid, Key, Ui, Vec2, Window};

/// The effect of a key or of the mouse.
type Line = (&'static str, &'static str);

/// A title and the entries under it.
type Part = (&'static str, &'static [Line]);

/// Width of the keys, and between the columns, points.
const KEYS: f32 = 132.0;
const COLUMN_GAP: f32 = 24.0;

const COLUMNS: [&[Part]; 2] = [
    &[
        (
            "In a view",
            &[
                ("Drag", "orbit around the point ahead"),
                ("Right drag", "look around"),
                ("W A S D, Q E", "fly; down and up"),
                ("Wheel", "zoom to pixels"),
                ("Shift drag, middle drag", "move the image"),
                ("Double click", "fit the image into the pane"),
            ],
        ),
        (
            "Running",
            &[
                ("Space", "pause, run"),
                ("Full stop", "run one frame"),
                ("Home", "back to the scene's own view"),
                ("F9", "record the camera's path, stop recording"),
                ("F10", "play the path, stop playing"),
                ("1 to 9", "show the port of that key in the active view"),
                ("Ctrl 1 to 9", "assign the port in view to that key"),
            ],
        ),
    ],
    &[
        (
            "Files",
            &[
                ("Ctrl O", "open a graph"),
                ("Ctrl S, Ctrl Shift S", "save, save as"),
                ("Ctrl Z, Ctrl Shift Z", "undo, redo changes from any pane"),
                ("Ctrl E", "save an image"),
                ("Ctrl Shift C", "copy a command line for the picture in view"),
            ],
        ),
        (
            "Navigation",
            &[
                ("F6, Shift F6", "next pane, previous pane"),
                ("Tab, Shift Tab", "next widget, previous widget"),
                ("Enter or Space", "press the focused widget"),
                ("Arrows", "move a slider, or the focus"),
                ("Escape", "leave a field, a menu, a dialog"),
                ("F1", "this help"),
            ],
        ),
    ],
];

/// Shows it while it is open.
pub fn show(context: &Context, open: &mut bool) {
    if *open && context.input_mut(|input| input.consume_key(egui::Modifiers::NONE, Key::Escape)) {
        *open = false;
    }
    let window = Window::new("Keys and mouse").open(open).collapsible(false).resizable(false);
    window.anchor(Align2::CENTER_CENTER, Vec2::ZERO).show(context, |ui| {
        ui.spacing_mut().item_spacing.x = COLUMN_GAP;
        ui.horizontal_top(|ui| {
            for column in COLUMNS {
                ui.vertical(|ui| column.iter().for_each(|part| lines(ui, part)));
            }
        });
    });
}

fn lines(ui: &mut Ui, (title, lines): &Part) {
    ui.strong(*title);
    Grid::new(title).num_columns(2).min_col_width(KEYS).spacing([12.0, 4.0]).show(ui, |ui| {
        for (keys, what) in *lines {
            ui.weak(*keys);
            ui.label(*what);
            ui.end_row();
        }
    });
    ui.add_space(10.0);
}
