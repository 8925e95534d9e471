//! The text of the graph and its parts: what is typed runs as soon as it is sound, and errors stand where they are.

use std::{ops::Range, sync::Arc};

use egui::{
    Align, Color32, ComboBox, FontId, Galley, Margin, ScrollArea, Stroke, TextBuffer, TextEdit, TextFormat,
    Ui, pos2,
    text::{CCursor, CCursorRange, LayoutJob},
};
use epigraph_core::Problem;

use crate::{
    session::{Jump, Session},
    status::file_name,
    theme,
};

/// Room for line numbers, points.
const GUTTER: f32 = 34.0;

/// The text pane's own state.
#[derive(Default)]
pub struct TextPane {
    /// The file shown; empty for the graph's own.
    path: String,
    buffer: String,
}

impl TextPane {
    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        let jump = session.jump.take();
        if let Some(jump) = &jump {
            self.path = jump.path.clone();
        }
        let paths: Vec<String> = session.document.paths().map(Into::into).collect();
        if !paths.contains(&self.path) {
            self.path = session.document.path().to_owned();
        }
        ComboBox::from_id_salt("file").selected_text(file_name(&self.path)).show_ui(ui, |ui| {
            for path in paths {
                let name = file_name(&path).to_owned();
                ui.selectable_value(&mut self.path, path, name);
            }
        });
        if session.document.text(&self.path) != self.buffer {
            self.buffer = session.document.text(&self.path).to_owned();
        }
        let errors = errors(&self.path, &self.buffer, session.problems());
        ScrollArea::both().auto_shrink(false).show(ui, |ui| self.editor(ui, session, &errors, jump));
    }

    fn editor(&mut self, ui: &mut Ui, session: &mut Session, errors: &[Range<usize>], jump: Option<Jump>) {
        let mut layouter = |ui: &Ui, text: &dyn TextBuffer, _: f32| layout(ui, text.as_str(), errors);
        let id = ui.make_persistent_id(("text", &self.path));
        let output = TextEdit::multiline(&mut self.buffer)
            .id(id)
            .code_editor()
            .frame(egui::Frame::new().inner_margin(Margin {
                left: GUTTER as i8,
                right: 4,
                top: 2,
                bottom: 2,
            }))
            .desired_width(f32::INFINITY)
            .layouter(&mut layouter)
            .show(ui);
        numbers(ui, &output.galley, output.galley_pos.y, output.response.rect.left());
        if output.response.changed() {
            session.document.type_text(&self.path, &self.buffer);
            // Each line of typing can be undone on its own.
            if ui.input(|input| input.key_pressed(egui::Key::Enter)) {
                session.document.seal();
            }
        }
        if output.response.lost_focus() {
            session.document.seal();
        }
        if let Some(jump) = jump {
            let at = character(&self.buffer, jump.at);
            let mut state = output.state;
            state.cursor.set_char_range(Some(CCursorRange::one(CCursor::new(at))));
            state.store(ui.ctx(), id);
            output.response.request_focus();
            let place = output.galley.pos_from_cursor(CCursor::new(at));
            ui.scroll_to_rect(place.translate(output.galley_pos.to_vec2()), Some(Align::Center));
        }
    }
}

/// The index of a character by its line and column, from 1.
fn character(text: &str, (line, column): (usize, usize)) -> usize {
    let before: usize =
        text.split_inclusive('\n').take(line.saturating_sub(1)).map(|line| line.chars().count()).sum();
    before + column.saturating_sub(1)
}

/// The bytes that problems of this file concern.
fn errors(path: &str, text: &str, problems: &[Problem]) -> Vec<Range<usize>> {
    let places = problems.iter().filter_map(|problem| problem.place.as_ref());
    let range = |place: &epigraph_core::Place| {
        let line: usize = text.split_inclusive('\n').take(place.line - 1).map(str::len).sum();
        let rest = text[line..].lines().next().unwrap_or("");
        let byte = |column: usize| rest.char_indices().nth(column).map_or(rest.len(), |(at, _)| at);
        let (start, end) = (byte(place.column - 1), byte(place.column - 1 + place.length));
        // At a line's end there is nothing to underline but its last character.
        let start =
            if start == end { rest.char_indices().next_back().map_or(0, |(at, _)| at) } else { start };
        line + start..line + end
    };
    places.filter(|place| place.file == path && place.line > 0).map(range).collect()
}

/// Line numbers beside the text.
fn numbers(ui: &Ui, galley: &Galley, top: f32, left: f32) {
    let font = FontId::monospace(10.0);
    let color = ui.visuals().weak_text_color();
    let mut begins = true;
    let mut number = 0;
    for row in &galley.rows {
        if begins {
            number += 1;
            let at = pos2(left + GUTTER - 8.0, top + row.pos.y + 0.5 * row.size.y);
            if ui.clip_rect().y_range().contains(at.y) {
                ui.painter().text(at, egui::Align2::RIGHT_CENTER, number, font.clone(), color);
            }
        }
        begins = row.ends_with_newline;
    }
}

/// The text in colours, errors underlined.
fn layout(ui: &Ui, text: &str, errors: &[Range<usize>]) -> Arc<Galley> {
    let font = FontId::monospace(12.0);
    let mut job = LayoutJob::default();
    job.wrap.max_width = f32::INFINITY;
    for (range, color) in tokens(text, ui.visuals().dark_mode, ui.visuals().text_color()) {
        // A token is cut where an error begins or ends in it.
        let mut cuts: Vec<usize> = errors.iter().flat_map(|error| [error.start, error.end]).collect();
        cuts.retain(|cut| range.contains(cut) && *cut > range.start);
        cuts.push(range.end);
        cuts.sort_unstable();
        let mut start = range.start;
        for end in cuts {
            let wrong = errors.iter().any(|error| error.start <= start && end <= error.end);
            let mut format = TextFormat::simple(font.clone(), color);
            if wrong {
                format.underline = Stroke::new(2.0, theme::BAD);
                format.background = theme::BAD.gamma_multiply(0.2);
            }
            job.append(&text[start..end], 0.0, format);
            start = end;
        }
    }
    ui.fonts_mut(|fonts| fonts.layout_job(job))
}

/// Comments, strings, numbers and all else, without gaps.
fn tokens(text: &str, dark: bool, plain: Color32) -> Vec<(Range<usize>, Color32)> {
    let shade = |dark_color: [u8; 3], light_color: [u8; 3]| {
        let [r, g, b] = if dark { dark_color } else { light_color };
        Color32::from_rgb(r, g, b)
    };
    let comment = shade([120, 150, 110], [70, 110, 60]);
    let string = shade([206, 160, 120], [150, 70, 30]);
    let number = shade([150, 195, 225], [20, 90, 140]);
    let bytes = text.as_bytes();
    let mut tokens: Vec<(Range<usize>, Color32)> = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let rest = &text[at..];
        let (length, color) = match bytes[at] {
            b'/' if rest.starts_with("//") => (rest.find('\n').unwrap_or(rest.len()), comment),
            b'/' if rest.starts_with("/*") => (rest.find("*/").map_or(rest.len(), |end| end + 2), comment),
            b'"' => (string_length(rest), string),
            b'0'..=b'9' => {
                (rest.find(|c: char| !c.is_alphanumeric() && c != '.').unwrap_or(rest.len()), number)
            }
            byte if byte.is_ascii_alphabetic() || byte == b'_' => {
                (rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len()), plain)
            }
            _ => (rest.chars().next().map_or(1, char::len_utf8), plain),
        };
        match tokens.last_mut() {
            Some((range, last)) if *last == color => range.end = at + length,
            _ => tokens.push((at..at + length, color)),
        }
        at += length;
    }
    tokens
}

/// Bytes of the string in quotes that `text` begins with.
fn string_length(text: &str) -> usize {
    let mut escaped = false;
    for (at, byte) in text.bytes().enumerate().skip(1) {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = true,
            b'"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use epigraph_core::GraphFile;

    use super::*;

    #[test]
    fn tokens_cover_the_text_without_gaps() {
        let text = "Graph( // é \"no\"\n \"a\\\"b\": (x: 0.5, n9: -3) /* c */, \"open";
        let tokens = tokens(text, true, Color32::WHITE);
        let joined: String = tokens.iter().map(|(range, _)| &text[range.clone()]).collect();
        assert_eq!(joined, text);
        let string = tokens.iter().find(|(range, _)| range.contains(&text.find("\"a").unwrap())).unwrap();
        assert_eq!(&text[string.0.clone()], "\"a\\\"b\"");
        let colors: std::collections::BTreeSet<_> =
            tokens.iter().map(|(_, color)| color.to_array()).collect();
        assert_eq!(colors.len(), 4);
    }

    #[test]
    fn errors_are_the_bytes_of_their_place() {
        let text = "Graph(\n    version: 1,\n    nodes: { \"é\": (kind: 3) },\n    outputs: {},\n)\n";
        let problems = GraphFile::parse("a.ron", text).unwrap_err().0;
        let found = errors("a.ron", text, &problems);
        assert_eq!(found.iter().map(|range| &text[range.clone()]).collect::<Vec<_>>(), ["3"]);
        assert!(errors("b.ron", text, &problems).is_empty());
        assert_eq!(character(text, (3, 15)), text[..text.find('é').unwrap()].chars().count());
    }
}
