//! Keyboard navigation between panes: each pane can have the focus as a whole, and Tab then moves to its widgets.

use egui::{Context, Id, Rect, Sense, StrokeKind, Ui, WidgetInfo, WidgetType};
use egui_tiles::{Tile, TileId, Tree};

use crate::{panes::Pane, theme};

/// The id of a pane's focus.
fn pane_id(tile: TileId) -> Id {
    Id::new("pane").with(tile)
}

/// Makes a pane focusable as a whole, before its widgets, and draws a frame around it if it has the focus.
pub fn pane(ui: &Ui, tile: TileId, title: &str) {
    let rect = ui.max_rect();
    let response = ui.interact(rect, pane_id(tile), Sense::focusable_noninteractive());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Panel, true, format!("Pane {title}")));
    if response.has_focus() {
        let stroke = egui::Stroke::new(2.0, theme::palette(ui).accent);
        ui.painter().rect_stroke(rect.shrink(1.0), 2.0, stroke, StrokeKind::Inside);
    }
}

/// True if a pane as a whole has the focus, so that single-key shortcuts still work.
pub fn is_on_pane(context: &Context, tree: &Tree<Pane>) -> bool {
    let focused = context.memory(|memory| memory.focused());
    in_order(tree).into_iter().any(|tile| focused == Some(pane_id(tile)))
}

/// Moves the focus to the next pane, or to the previous one.
pub fn next_pane(context: &Context, tree: &Tree<Pane>, back: bool) {
    let panes = in_order(tree);
    let focused = context.memory(|memory| memory.focused());
    // A pane is also current if one of its widgets has the focus.
    let place = focused.and_then(|id| context.read_response(id)).map(|response| response.rect.center());
    let current = panes.iter().position(|tile| {
        focused == Some(pane_id(*tile)) || place.is_some_and(|at| rect(tree, *tile).contains(at))
    });
    let count = panes.len();
    let step = |at: usize| if back { (at + count - 1) % count } else { (at + 1) % count };
    let next = current.map_or(if back { count.saturating_sub(1) } else { 0 }, step);
    if let Some(tile) = panes.get(next) {
        context.memory_mut(|memory| memory.request_focus(pane_id(*tile)));
    }
}

/// The visible panes, column by column from the left, each from the top.
fn in_order(tree: &Tree<Pane>) -> Vec<TileId> {
    let mut panes: Vec<TileId> = tree
        .active_tiles()
        .into_iter()
        .filter(|tile| matches!(tree.tiles.get(*tile), Some(Tile::Pane(_))))
        .collect();
    let key = |tile: &TileId| rect(tree, *tile).min;
    panes.sort_by(|a, b| key(a).x.total_cmp(&key(b).x).then(key(a).y.total_cmp(&key(b).y)));
    panes
}

fn rect(tree: &Tree<Pane>, tile: TileId) -> Rect {
    tree.tiles.rect(tile).unwrap_or(Rect::NOTHING)
}
