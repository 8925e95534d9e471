//! Editors for the texts of the graph and its parts, and of its shaders. A changed text runs as soon as it is valid;
//! errors are shown at their lines.

mod places;
mod search;
mod syntax;

use std::ops::Range;

use egui::{
    Align, Align2, ComboBox, FontId, Galley, Margin, Rect, ScrollArea, Shape, Stroke, StrokeKind, TextBuffer,
    TextEdit, Ui, WidgetInfo, WidgetType, pos2,
    text::{CCursor, CCursorRange},
    text_edit::TextEditOutput,
    vec2,
};
use epigraph_core::{Problem, Side};
use search::Search;
pub use syntax::Language;
use syntax::{Highlight, HighlightKind};

use crate::{files::short, intent::Jump, session::Session, theme};

/// Room for line numbers, points.
const GUTTER: f32 = 34.0;

/// A text pane's own state.
#[derive(Default)]
pub struct TextPane {
    /// The language of its texts.
    pub language: Language,
    /// The file shown; empty for the first.
    path: String,
    buffer: String,
    search: Search,
    /// The selected node in the last frame of the window.
    selected: Option<String>,
    /// The cursor in the last frame of the window, as an index of a character.
    cursor: Option<usize>,
    /// The position to go to.
    jump: Option<Jump>,
}

/// A range of text to scroll to.
struct View {
    bytes: Range<usize>,
    /// True if the cursor moves there too, and the text gets the focus.
    focus: bool,
}

impl TextPane {
    /// A pane for shaders.
    pub fn shaders() -> Self {
        Self { language: Language::Wgsl, ..Self::default() }
    }

    /// Goes to a position in one of its texts.
    pub fn jump(&mut self, jump: Jump) {
        self.jump = Some(jump);
    }

    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        let jump = self.jump.take();
        if let Some(jump) = &jump {
            self.path = jump.path.clone();
        }
        let chosen = session.selected != self.selected;
        self.selected.clone_from(&session.selected);
        if let (true, Some(path)) = (chosen && jump.is_none(), self.home(session)) {
            self.path = path;
        }
        let paths = self.paths(session);
        let Some(first) = paths.first() else {
            ui.strong("This graph has no shader that can be edited.");
            ui.weak(
                "A node of kind `wgsl` runs a shader file, whose variables are the node's ports and parameters. Add one on \
                 the canvas and give it a file: params: (shader: \"mine.wgsl\").",
            );
            return;
        };
        if !paths.contains(&self.path) {
            self.path.clone_from(first);
        }
        if session.document.text(&self.path) != self.buffer {
            self.buffer = session.document.text(&self.path).to_owned();
        }
        let mut view = None;
        ui.horizontal(|ui| {
            let files = ComboBox::from_id_salt(("file", self.language == Language::Wgsl))
                .selected_text(short(&self.path))
                .width(96.0)
                .show_ui(ui, |ui| {
                    for path in paths {
                        let name = short(&path).to_owned();
                        ui.selectable_value(&mut self.path, path, name);
                    }
                });
            files.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, "File"));
            view = self.search.show(ui, &self.buffer).map(|bytes| View { bytes, focus: false });
        });
        if session.document.is_fixed(&self.path) {
            ui.weak("It comes with the program and stays as it is: edits of its nodes are changes in the graph's own file.");
        }
        if self.twin_runs(session) {
            ui.weak("On the CPU, the stage's Rust twin runs instead of this shader.");
        }
        if let Some(jump) = jump {
            let at = places::byte(&self.buffer, places::character(&self.buffer, jump.at));
            view = Some(View { bytes: at..at, focus: true });
        } else if chosen && let Some(bytes) = self.node_lines(session) {
            view = view.or(Some(View { bytes, focus: false }));
        }
        ScrollArea::both().auto_shrink(false).show(ui, |ui| self.editor(ui, session, view));
    }

    /// The files in its language: the graph's own and its parts', or the shaders.
    fn paths(&self, session: &Session) -> Vec<String> {
        match self.language {
            Language::Ron => {
                let paths = session.document.paths().filter(|path| Language::of(path) == self.language);
                paths.map(Into::into).collect()
            }
            Language::Wgsl => session.document.shaders().map(|(path, _)| path.to_owned()).collect(),
        }
    }

    /// The file that contains the selected node, or the node's shader.
    fn home(&self, session: &Session) -> Option<String> {
        let selected = session.selected.as_deref()?;
        match self.language {
            Language::Ron => {
                // Where a graph changes the node, else where it is from.
                let document = &session.document;
                let file = document.file().filter(|file| file.node_span(selected).is_some());
                match file {
                    Some(file) => Some(file.path.clone()),
                    None => {
                        let (node, within) = document.whole()?.node_at(selected)?;
                        Some(within.place(node.name.span).file)
                    }
                }
            }
            Language::Wgsl => session.document.shader_of(selected).map(str::to_owned),
        }
    }

    /// True if all nodes with the shown shader run on the CPU.
    fn twin_runs(&self, session: &Session) -> bool {
        let users: Vec<&str> = session.document.users_of(&self.path).collect();
        let nodes = session.state.graph.iter().flat_map(|graph| &graph.nodes);
        let mut sides = nodes.filter(|node| users.contains(&node.name.as_str())).map(|node| node.side);
        sides.next().is_some_and(|first| first == Side::Cpu && sides.all(|side| side == Side::Cpu))
    }

    /// The byte range of the selected node, if it is in the shown file and the text has no problems.
    fn node_lines(&self, session: &Session) -> Option<Range<usize>> {
        let is_sound = session.document.problems().is_empty() && self.language == Language::Ron;
        let file = session.document.file().filter(|_| is_sound)?;
        places::of_node(file, session.selected.as_deref()?, &self.path)
    }

    fn editor(&mut self, ui: &mut Ui, session: &mut Session, view: Option<View>) {
        let path = self.path.clone();
        let problems = places::wrong(&path, &self.buffer, session.problems());
        let problems: Vec<(Range<usize>, Problem)> =
            problems.into_iter().map(|(range, problem)| (range, problem.clone())).collect();
        let mut highlights: Vec<Highlight> = Vec::new();
        let mut highlight =
            |range: &Range<usize>, kind| highlights.push(Highlight { range: range.clone(), kind });
        self.search.found.iter().for_each(|range| highlight(range, HighlightKind::Found));
        self.search.current().into_iter().for_each(|range| highlight(range, HighlightKind::Current));
        problems.iter().for_each(|(range, _)| highlight(range, HighlightKind::Wrong));

        let lines = self.node_lines(session);
        let behind = ui.painter().add(Shape::Noop);
        let language = self.language;
        let mut layouter =
            |ui: &Ui, text: &dyn TextBuffer, _: f32| syntax::layout(ui, language, text.as_str(), &highlights);
        let id = ui.make_persistent_id(("text", &self.path));
        let output = TextEdit::multiline(&mut self.buffer)
            .interactive(!session.document.is_fixed(&self.path))
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
        if let Some(lines) = lines {
            ui.painter().set(behind, self.behind(ui, &output, lines));
        }
        let name = format!("Text of {}", short(&self.path));
        ui.ctx().accesskit_node_builder(output.response.id, |node| node.set_label(name));
        let left = output.response.rect.left();
        numbers(ui, &output.galley, output.galley_pos.y, left);
        self.tell(ui, &output, &problems);
        if output.response.changed() {
            session.document.type_text(&self.path, &self.buffer);
            // Each typed line can be undone separately.
            if ui.input(|input| input.key_pressed(egui::Key::Enter)) {
                session.document.seal();
            }
        }
        if output.response.lost_focus() {
            session.document.seal();
        }
        self.follow_cursor(session, &output);
        if let Some(view) = view {
            self.bring(ui, output, &view);
        }
    }

    /// A band behind the lines of the selected node.
    fn behind(&self, ui: &Ui, output: &TextEditOutput, bytes: Range<usize>) -> Shape {
        let [top, bottom] = [bytes.start, bytes.end].map(|at| self.place(output, at));
        let rows = top.top()..=bottom.bottom();
        let across = output.response.rect.left()..=ui.clip_rect().right();
        let band = Rect::from_x_y_ranges(across.start() + GUTTER - 5.0..=*across.end(), rows.clone());
        let bar = Rect::from_x_y_ranges(across.start() + GUTTER - 6.0..=across.start() + GUTTER - 3.5, rows);
        Shape::Vec(vec![
            Shape::rect_filled(band, 0.0, theme::palette(ui).accent.gamma_multiply(0.1)),
            Shape::rect_filled(bar, 0.0, theme::palette(ui).accent.gamma_multiply(0.8)),
        ])
    }

    /// The rectangle at which a byte is drawn.
    fn place(&self, output: &TextEditOutput, at: usize) -> Rect {
        let character = self.buffer[..at.min(self.buffer.len())].chars().count();
        output.galley.pos_from_cursor(CCursor::new(character)).translate(output.galley_pos.to_vec2())
    }

    /// Draws the problems: each after the end of its line, or below it if there is no room.
    fn tell(&self, ui: &Ui, output: &TextEditOutput, problems: &[(Range<usize>, Problem)]) {
        let seen = ui.clip_rect();
        for (range, problem) in problems {
            let rest = &self.buffer[range.end..];
            let end = self.place(output, range.end + rest.find('\n').unwrap_or(rest.len()));
            let font = FontId::proportional(11.5);
            let room = (seen.width() - GUTTER - 16.0).max(80.0);
            let galley =
                ui.painter().layout(format!("⚠ {}", problem.error), font, theme::palette(ui).bad, room);
            let beside = end.right_center() + vec2(14.0, -0.5 * galley.size().y);
            let fits = galley.rows.len() == 1 && beside.x + galley.size().x + 8.0 < seen.right();
            let at = if fits { beside } else { pos2(seen.left() + GUTTER + 4.0, end.bottom() + 3.0) };
            let back = Rect::from_min_size(at, galley.size()).expand2(vec2(5.0, 2.0));
            ui.painter().rect(
                back,
                3.0,
                ui.visuals().window_fill,
                Stroke::new(1.0, theme::palette(ui).bad.gamma_multiply(0.6)),
                StrokeKind::Outside,
            );
            ui.painter().galley(at, galley, theme::palette(ui).bad);
        }
    }

    /// Selects the node at the cursor, if the user has moved it.
    fn follow_cursor(&mut self, session: &mut Session, output: &TextEditOutput) {
        let cursor =
            output.cursor_range.filter(|_| output.response.has_focus()).map(|range| range.primary.index.0);
        let moved = cursor != self.cursor;
        self.cursor = cursor;
        // Typing moves the cursor too, but does not change the selection.
        let Some(at) = cursor.filter(|_| moved && !output.response.changed()) else { return };
        let node = match self.language {
            Language::Wgsl => {
                let users: Vec<&str> = session.document.users_of(&self.path).collect();
                let is_selected = |user: &&&str| session.selected.as_deref() == Some(**user);
                users.iter().find(is_selected).or(users.first()).map(|user| (*user).to_owned())
            }
            Language::Ron if session.document.problems().is_empty() => {
                let file = session.document.file();
                file.and_then(|file| places::node_at(file, &self.path, places::byte(&self.buffer, at)))
            }
            Language::Ron => None,
        };
        if node.is_some() {
            // The node is already in view, so `show` must not scroll to it.
            self.selected.clone_from(&node);
            session.selected = node;
        }
    }

    fn bring(&self, ui: &mut Ui, output: TextEditOutput, view: &View) {
        if view.focus {
            let character = self.buffer[..view.bytes.start].chars().count();
            let mut state = output.state.clone();
            state.cursor.set_char_range(Some(CCursorRange::one(CCursor::new(character))));
            state.store(ui.ctx(), output.response.id);
            output.response.request_focus();
        }
        let [start, end] = [view.bytes.start, view.bytes.end].map(|at| self.place(&output, at));
        let (seen, content) = (ui.clip_rect().size(), output.response.rect.left());
        // A range higher than the pane is shown from its top; lines are shown from their beginning if the start fits.
        let fits = end.bottom() - start.top() < seen.y;
        let left =
            if start.right() - content + 60.0 < seen.x { content } else { start.left() - 0.5 * seen.x };
        let rows = start.top()..=if fits { end.bottom() } else { start.bottom() };
        let shown = Rect::from_x_y_ranges(left..=left + seen.x, rows);
        ui.scroll_to_rect(shown, Some(if fits { Align::Center } else { Align::Min }));
    }
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
                ui.painter().text(at, Align2::RIGHT_CENTER, number, font.clone(), color);
            }
        }
        begins = row.ends_with_newline;
    }
}
