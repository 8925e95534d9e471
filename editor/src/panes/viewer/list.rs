//! A port's list of elements as a table: pages of rows, sorted by any column.

use std::sync::Arc;

use egui::{Align, Button, DragValue, Layout, RichText, ScrollArea, Sense, Ui, vec2};
use epigraph_core::Snapshot;
use epigraph_pictures::{Table, grouped};

use crate::task::Task;
use crate::theme;

const ROW: f32 = 19.0;
const INDEX_WIDTH: f32 = 74.0;
const COLUMN_WIDTH: f32 = 86.0;
/// Space between columns.
const GAP: f32 = 4.0;

/// The sort key and direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sorting {
    /// The column.
    pub column: usize,
    /// True if the largest come first.
    pub descending: bool,
}

/// A request to sort a port's fields.
#[derive(Clone)]
struct Sorted {
    fields: Vec<Arc<Snapshot>>,
    sorting: Sorting,
}

impl PartialEq for Sorted {
    fn eq(&self, other: &Self) -> bool {
        self.sorting == other.sorting && same(&self.fields, &other.fields)
    }
}

fn same(a: &[Arc<Snapshot>], b: &[Arc<Snapshot>]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b))
}

/// A list on screen.
#[derive(Default)]
pub struct List {
    newest: Option<Table>,
    /// The sort order; `None` for the list's own order.
    pub sorting: Option<Sorting>,
    sorted: Task<Sorted, (Table, Vec<u32>)>,
    /// The first row of the page.
    top: usize,
    /// The element that was last jumped to.
    marked: Option<usize>,
    wanted: usize,
    /// The fraction of a row left over from scrolling.
    scrolled: f32,
}

impl List {
    /// Takes the newest elements.
    pub fn update(&mut self, fields: Vec<Arc<Snapshot>>) {
        if self.newest.as_ref().is_none_or(|table| !same(table.fields(), &fields)) {
            self.newest = Some(Table::new(fields));
        }
    }

    /// The table in view and the order of its rows: the newest one, or the last sorted one.
    fn shown(&self) -> Option<(&Table, Option<&[u32]>)> {
        match self.sorted.result().filter(|_| self.sorting.is_some()) {
            Some((_, (table, order))) => Some((table, Some(order))),
            None => Some((self.newest.as_ref()?, None)),
        }
    }

    /// The elements of a page of `rows` rows.
    pub fn page(&self, rows: usize) -> Vec<usize> {
        let Some((table, order)) = self.shown() else { return Vec::new() };
        let element = |row: usize| order.map_or(row, |order| order[row] as usize);
        (self.top..(self.top + rows).min(table.rows)).map(element).collect()
    }

    /// Shows it.
    pub fn show(&mut self, ui: &mut Ui) {
        if let (Some(sorting), Some(newest)) = (self.sorting, &self.newest) {
            let table = newest.clone();
            let sorted = Sorted { fields: newest.fields().to_vec(), sorting };
            self.sorted.want(ui.ctx(), sorted, move || {
                let order = table.order(sorting.column, sorting.descending);
                (table, order)
            });
        }
        let rows = (((ui.available_height() - 3.0 * ROW - 14.0) / ROW) as usize).max(1);
        self.bar(ui, rows);
        let Some((table, _)) = self.shown() else { return };
        let table = table.clone();
        ScrollArea::horizontal().auto_shrink([false, false]).show(ui, |ui| {
            ui.spacing_mut().item_spacing = vec2(GAP, 0.0);
            self.headings(ui, &table);
            ui.separator();
            let page = self.page(rows);
            for (index, element) in page.iter().enumerate() {
                self.row(ui, &table, index, *element);
            }
        });
        let over = ui.rect_contains_pointer(ui.min_rect());
        let delta = ui.input(|input| input.smooth_scroll_delta().y);
        if over && delta != 0.0 {
            self.scrolled -= delta / ROW;
            let whole = self.scrolled.trunc();
            self.scrolled -= whole;
            self.go(self.top as i64 + whole as i64, table.rows, rows);
        }
    }

    /// Buttons to turn pages, the jump field, and the number of rows.
    fn bar(&mut self, ui: &mut Ui, page: usize) {
        let Some(count) = self.shown().map(|(table, _)| table.rows) else { return };
        ui.horizontal(|ui| {
            let top = self.top as i64;
            let last = count.saturating_sub(page) as i64;
            let turns = [
                ("⏮", 0, "First page"),
                ("◀", top - page as i64, "Previous page"),
                ("▶", top + page as i64, "Next page"),
                ("⏭", last, "Last page"),
            ];
            for (label, to, doc) in turns {
                let possible = if to <= top { top > 0 } else { top < last };
                if ui.add_enabled(possible, Button::new(label)).on_hover_text(doc).clicked() {
                    self.go(to, count, page);
                }
            }
            let to = (self.top + page).min(count);
            let [from, until, all] = [(self.top + 1).min(to), to, count].map(|row| grouped(row as u64));
            ui.label(format!("{from}–{until} of {all}"));
            ui.separator();
            let label = ui.label("row");
            let jump = DragValue::new(&mut self.wanted).range(0..=count.saturating_sub(1)).speed(1.0);
            let jump = ui.add(jump).labelled_by(label.id);
            if jump.on_hover_text("Jump to the element with this index. Click to type").changed() {
                self.marked = Some(self.wanted);
                self.go(self.row_of(self.wanted) as i64 - page as i64 / 3, count, page);
            }
            if self.sorted.is_busy() {
                ui.add(egui::Spinner::new().size(13.0));
                ui.weak("sorting …");
            }
        });
    }

    /// The row of an element.
    fn row_of(&self, element: usize) -> usize {
        let order = self.shown().and_then(|(_, order)| order);
        order.and_then(|order| order.iter().position(|row| *row as usize == element)).unwrap_or(element)
    }

    fn go(&mut self, row: i64, count: usize, page: usize) {
        self.top = row.clamp(0, count.saturating_sub(page) as i64) as usize;
    }

    /// The headings. Clicks cycle through: smallest first, largest first, unsorted.
    fn headings(&mut self, ui: &mut Ui, table: &Table) {
        ui.horizontal(|ui| {
            cell(ui, INDEX_WIDTH, |ui| {
                ui.weak("row");
            });
            for (column, heading) in table.columns.iter().enumerate() {
                let sorting = self.sorting.filter(|sorting| sorting.column == column);
                let arrow = sorting.map_or("", |sorting| if sorting.descending { " ⏷" } else { " ⏶" });
                cell(ui, COLUMN_WIDTH, |ui| {
                    let text = RichText::new(format!("{}{arrow}", heading.name)).strong();
                    let button = ui.add(Button::new(text).frame(false).truncate());
                    if button.on_hover_text("Sort: smallest first, largest first, unsorted").clicked() {
                        self.sorting = match sorting.map(|sorting| sorting.descending) {
                            None => Some(Sorting { column, descending: false }),
                            Some(false) => Some(Sorting { column, descending: true }),
                            Some(true) => None,
                        };
                        self.top = 0;
                    }
                });
            }
        });
    }

    fn row(&self, ui: &mut Ui, table: &Table, index: usize, element: usize) {
        let width = INDEX_WIDTH + table.columns.len() as f32 * (COLUMN_WIDTH + GAP);
        let (rect, _) = ui.allocate_exact_size(vec2(width.max(ui.available_width()), ROW), Sense::hover());
        let fill = match () {
            () if self.marked == Some(element) => theme::palette(ui).accent.gamma_multiply(0.35),
            () if index % 2 == 1 => ui.visuals().faint_bg_color,
            () => egui::Color32::TRANSPARENT,
        };
        ui.painter().rect_filled(rect, 2.0, fill);
        let mut line =
            ui.new_child(egui::UiBuilder::new().max_rect(rect).layout(Layout::left_to_right(Align::Center)));
        line.spacing_mut().item_spacing.x = GAP;
        cell(&mut line, INDEX_WIDTH, |ui| {
            ui.label(RichText::new(element.to_string()).monospace().weak());
        });
        for column in 0..table.columns.len() {
            cell(&mut line, COLUMN_WIDTH, |ui| {
                ui.label(RichText::new(table.text(element, column)).monospace());
            });
        }
    }
}

/// A cell of fixed width with right-aligned contents.
fn cell(ui: &mut Ui, width: f32, contents: impl FnOnce(&mut Ui)) {
    ui.allocate_ui_with_layout(vec2(width, ROW), Layout::right_to_left(Align::Center), |ui| {
        ui.set_min_width(width);
        ui.set_max_width(width);
        contents(ui);
    });
}
