//! Searching in a text.

use std::ops::Range;

use egui::{Button, Key, Modifiers, TextEdit, Ui, WidgetInfo, WidgetType};

use super::places;

/// Width of the field, points.
const WIDTH: f32 = 96.0;

/// The search text, its matches, and the current match.
#[derive(Default)]
pub struct Search {
    wanted: String,
    current: usize,
    /// The matches in the current text.
    pub found: Vec<Range<usize>>,
}

impl Search {
    /// Shows the field and its buttons. Returns the match to scroll to, if the user has moved to another one.
    pub fn show(&mut self, ui: &mut Ui, text: &str) -> Option<Range<usize>> {
        self.found = places::found(text, &self.wanted);
        let field = TextEdit::singleline(&mut self.wanted).hint_text("Search").desired_width(WIDTH);
        let response = ui
            .add(field)
            .on_hover_text("Ctrl+F; Enter goes to the next match, Shift+Enter to the previous one");
        response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Search the text"));
        if ui.input_mut(|input| input.consume_key(Modifiers::COMMAND, Key::F)) {
            response.request_focus();
        }
        let mut step = 0;
        if response.changed() {
            self.found = places::found(text, &self.wanted);
            self.current = 0;
        }
        if response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter)) {
            step = if ui.input(|input| input.modifiers.shift) { -1 } else { 1 };
            response.request_focus();
        }
        if self.wanted.is_empty() {
            return None;
        }
        if ui.add(named("◀", "previous match")).clicked() {
            step = -1;
        }
        if ui.add(named("▶", "next match")).clicked() {
            step = 1;
        }
        let count = self.found.len();
        self.current = self.current.min(count.saturating_sub(1));
        if count > 0 {
            self.current = (self.current as isize + step).rem_euclid(count as isize) as usize;
        }
        let shown = if count == 0 { "no match".into() } else { format!("{} of {count}", self.current + 1) };
        ui.weak(shown);
        (step != 0 || response.changed()).then(|| self.found.get(self.current).cloned())?
    }

    /// The current match.
    pub fn current(&self) -> Option<&Range<usize>> {
        self.found.get(self.current)
    }
}

/// A small button with a symbol; `name` is its accessible name and hover text.
fn named(text: &str, name: &'static str) -> impl egui::Widget {
    let text = text.to_owned();
    move |ui: &mut Ui| {
        let response = ui.add(Button::new(text).small());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, name));
        response.on_hover_text(name)
    }
}
