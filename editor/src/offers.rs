//! Choices about unsaved changes: those of the last session, and those to files that another program has changed too.

use egui::{Align2, Color32, Context, RichText, ScrollArea, Ui, Window};

use crate::{
    differences::{Line, differences},
    document::Document,
    files::short,
    store::{Recovery, Store},
    theme,
};

/// The texts of a file: on disk, and with the unsaved changes.
type Texts = (String, [String; 2]);

/// The open choices.
#[derive(Default)]
pub struct Offers {
    /// Unsaved changes of the last session, until the user has decided about them.
    recovery: Option<Recovery>,
    /// The files of these that another program has changed since.
    changed: Vec<String>,
    /// The differences to show.
    shown: Option<Vec<Texts>>,
}

/// What the user wants.
#[derive(Clone, Copy, PartialEq)]
enum Choice {
    Mine,
    Differences,
    Theirs,
}

impl Offers {
    /// Offers the unsaved changes of the last session.
    pub fn new(recovery: Option<Recovery>, document: &Document) -> Self {
        let mut offers = Self { recovery, ..Self::default() };
        offers.refresh(document);
        offers
    }

    /// Whether the user has yet to decide about the unsaved changes of the last session.
    pub fn has_recovery(&self) -> bool {
        self.recovery.is_some()
    }

    /// Finds out which files another program has changed.
    pub fn refresh(&mut self, document: &Document) {
        self.changed = self.recovery.as_ref().map_or(Vec::new(), |recovery| recovery.changed_since(document));
    }

    /// Shows the choices above the panes, and carries them out.
    pub fn show(&mut self, ui: &mut Ui, document: &mut Document, store: Option<&mut Store>) {
        let conflicts: Vec<String> = document.conflicts().map(|(path, _)| path.to_owned()).collect();
        if self.recovery.is_some() || !conflicts.is_empty() {
            egui::Panel::top("offers").show(ui, |ui| {
                ui.add_space(3.0);
                self.recovery(ui, document, store);
                for path in &conflicts {
                    ui.push_id(path, |ui| self.conflict(ui, document, path));
                }
                ui.add_space(3.0);
            });
        }
        self.window(ui.ctx());
    }

    /// The choice about the unsaved changes of the last session.
    fn recovery(&mut self, ui: &mut Ui, document: &mut Document, store: Option<&mut Store>) {
        let Some(recovery) = &self.recovery else { return };
        match row(ui, &self.words(recovery), RESTORE) {
            None => {}
            Some(Choice::Differences) => self.shown = Some(recovery.compared(document)),
            Some(choice) => {
                self.shown = None;
                if let (Choice::Mine, Some(recovery)) = (choice, self.recovery.take()) {
                    recovery.take_over(document);
                } else if let Some(store) = store {
                    store.discard(document);
                }
            }
        }
    }

    /// The choice about a file that another program has changed.
    fn conflict(&mut self, ui: &mut Ui, document: &mut Document, path: &str) {
        let text = format!("{} has unsaved changes, and another program has changed the file.", short(path));
        let Some(choice) = row(ui, &text, KEEP) else { return };
        self.shown = None;
        match choice {
            Choice::Mine => document.keep_mine(path),
            Choice::Theirs => document.take_theirs(path),
            Choice::Differences => {
                let theirs = document.conflicts().find(|(known, _)| *known == path);
                let theirs = theirs.map_or(String::new(), |(_, text)| text.to_owned());
                self.shown = Some(vec![(path.to_owned(), [theirs, document.mine(path)])]);
            }
        }
    }

    fn words(&self, recovery: &Recovery) -> String {
        let names: Vec<&str> = self.changed.iter().map(|path| short(path)).collect();
        let since = match names.is_empty() {
            true => String::new(),
            false => format!(" Another program has changed {} since.", names.join(", ")),
        };
        format!("{} when the program ended.{since}", recovery.what())
    }

    /// The window with the differences.
    fn window(&mut self, context: &Context) {
        let Some(shown) = &self.shown else { return };
        let mut open = true;
        // In the middle, so that it does not cover the choices.
        let (middle, size) = (context.content_rect().center(), [760.0, 440.0]);
        let window = Window::new("Differences").open(&mut open).default_size(size).collapsible(false);
        window.pivot(Align2::CENTER_CENTER).default_pos(middle).show(context, |ui| {
            let palette = theme::palette(ui);
            let (theirs, mine) = (palette.bad, palette.accent);
            ui.horizontal(|ui| {
                ui.colored_label(theirs, "- in the file");
                ui.colored_label(mine, "+ with your unsaved changes");
            });
            ui.separator();
            ScrollArea::both().auto_shrink(false).show(ui, |ui| {
                for (path, [file, unsaved]) in shown {
                    ui.strong(path);
                    let lines = differences(file, unsaved);
                    if lines.is_empty() {
                        ui.weak("No line differs.");
                    }
                    lines.into_iter().for_each(|found| line(ui, found, theirs, mine));
                }
            });
        });
        if !open {
            self.shown = None;
        }
    }
}

/// The buttons of a choice, and what they do.
type Labels = [(&'static str, &'static str); 2];

const RESTORE: Labels = [
    ("Restore", "Restore the unsaved changes; Undo returns to the file as it is"),
    ("Discard", "Delete the unsaved changes; the files stay as they are"),
];

const KEEP: Labels = [
    ("Keep mine", "Keep the unsaved changes; saving replaces what the other program wrote"),
    ("Discard mine", "Take what the other program wrote; Undo brings the unsaved changes back"),
];

/// A sentence with its choices.
fn row(ui: &mut Ui, text: &str, [mine, theirs]: Labels) -> Option<Choice> {
    let mut chosen = None;
    ui.horizontal_wrapped(|ui| {
        ui.strong(text);
        let show = ("Show differences", "Show the lines in which the file and the unsaved changes differ");
        let buttons = [(mine, Choice::Mine), (show, Choice::Differences), (theirs, Choice::Theirs)];
        for ((label, hint), choice) in buttons {
            if ui.button(label).on_hover_text(hint).clicked() {
                chosen = Some(choice);
            }
        }
    });
    chosen
}

fn line(ui: &mut Ui, line: Line, theirs: Color32, mine: Color32) {
    let text = |mark: &str, text: &str| RichText::new(format!("{mark} {text}")).monospace();
    let text = match line {
        Line::Both(both) => text(" ", both),
        Line::First(first) => text("-", first).color(theirs),
        Line::Second(second) => text("+", second).color(mine),
        Line::Gap => RichText::new("⋯").weak(),
    };
    ui.add(egui::Label::new(text).extend());
}
