//! Automatic placement of boxes: columns from left to right along the wires, in the manner of Sugiyama, Tagawa and
//! Toda ("Methods for Visual Understanding of Hierarchical System Structures", 1981): wires that close a cycle are set
//! aside, each box gets the column after its last source, barycentres improve the order within columns until few wires
//! cross, and boxes are moved up or down so that wires run level. A graph that would be too small to read in one row is
//! folded into several rows, like lines of text.

use std::collections::BTreeSet;

use egui::{Pos2, Vec2, pos2};

/// Gap between the boxes of a column.
const GAP: f32 = 30.0;
/// Gap between columns, and its increase for each output whose wires leave the column.
const ALLEY: f32 = 46.0;
const LANE: f32 = 3.0;
/// Gap between rows, and its increase for each output whose wires lead from one row to the next.
const CORRIDOR: f32 = 44.0;
const TRACK: f32 = 7.0;
/// Maximum number of rows, and the least factor by which more rows must increase the zoom.
const ROWS: usize = 4;
const WORTH: f32 = 1.12;
/// Height reserved for a wire that passes a column.
const PASSAGE: f32 = 12.0;
/// Number of sweeps that improve the order, and of those that improve the heights.
const SWEEPS: usize = 12;

/// A wire between boxes: indices, and the heights of its ends from the tops of the boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The box it begins at, and how far below its top.
    pub from: (usize, f32),
    /// The box it ends at, and how far below its top.
    pub to: (usize, f32),
    /// True if it carries the previous frame's value, which does not constrain the order.
    pub back: bool,
    /// Width that it needs between columns for the transfer drawn on it.
    pub room: f32,
}

/// An item of a column: a box, or a passing wire.
#[derive(Clone, Debug)]
struct Item {
    size: Vec2,
    column: usize,
    top: f32,
}

/// The segment of a wire from one column to the next.
#[derive(Clone, Copy)]
struct Stretch {
    from: (usize, f32),
    to: (usize, f32),
    room: f32,
}

/// Top left corners of boxes of these sizes, for a pane of the size `room`. All coordinates are at least 0.
pub fn arrange(sizes: &[Vec2], links: &[Link], room: Vec2) -> Vec<Pos2> {
    let links = acyclic(sizes.len(), links);
    let columns = columns(sizes.len(), &links);
    let mut items: Vec<Item> = sizes
        .iter()
        .zip(&columns)
        .map(|(size, column)| Item { size: *size, column: *column, top: 0.0 })
        .collect();
    let stretches = stretches(&mut items, &links);
    let mut order = vec![Vec::new(); columns.iter().max().map_or(0, |last| last + 1)];
    for (index, item) in items.iter().enumerate() {
        order[item.column].push(index);
    }
    untangle(&mut order, &items, &stretches);
    level(&order, &mut items, &stretches);
    let corners = fold(&columns_of(&order, &items, &stretches, sizes.len()), room);
    items[..sizes.len()]
        .iter()
        .map(|item| pos2(corners[item.column].x, (corners[item.column].y + item.top).round()))
        .collect()
}

/// The links without those that carry the previous frame's values and without those that would still close a cycle.
fn acyclic(count: usize, links: &[Link]) -> Vec<Link> {
    let mut forward: Vec<Link> = Vec::new();
    let mut after = vec![Vec::new(); count];
    let reaches = |after: &[Vec<usize>], from: usize, to: usize| {
        let (mut seen, mut waiting) = (vec![false; count], vec![from]);
        while let Some(node) = waiting.pop() {
            if node == to {
                return true;
            }
            if !std::mem::replace(&mut seen[node], true) {
                waiting.extend(&after[node]);
            }
        }
        false
    };
    // Wires that follow the file's order take precedence, as authors write nodes in reading order.
    let mut sorted: Vec<&Link> = links.iter().filter(|link| !link.back).collect();
    sorted.sort_by_key(|link| link.from.0 >= link.to.0);
    for link in sorted {
        if !reaches(&after, link.to.0, link.from.0) {
            after[link.from.0].push(link.to.0);
            forward.push(*link);
        }
    }
    forward
}

/// The column of each box: after all its sources, or without sources, just before the first box that reads from it.
fn columns(count: usize, links: &[Link]) -> Vec<usize> {
    let mut columns = vec![0; count];
    // Each round settles at least one more column of a graph without cycles.
    for _ in 0..count {
        for link in links {
            columns[link.to.0] = columns[link.to.0].max(columns[link.from.0] + 1);
        }
    }
    let has_source = |node: usize| links.iter().any(|link| link.to.0 == node);
    for node in (0..count).filter(|node| !has_source(*node)) {
        let fed = links.iter().filter(|link| link.from.0 == node).map(|link| columns[link.to.0]);
        columns[node] = fed.min().map_or(0, |first| first - 1);
    }
    columns
}

/// Splits links into segments from column to column, and adds an item for each column that they pass. Links from the
/// same pin share these items.
fn stretches(items: &mut Vec<Item>, links: &[Link]) -> Vec<Stretch> {
    let mut stretches = Vec::new();
    let mut passages: Vec<((usize, u32), usize, usize)> = Vec::new();
    for link in links {
        let pin = (link.from.0, link.from.1.to_bits());
        let (mut at, mut room) = (link.from, link.room);
        for column in items[link.from.0].column + 1..items[link.to.0].column {
            let known = passages.iter().find(|(of, passed, _)| *of == pin && *passed == column);
            let passage = match known {
                Some((_, _, item)) => *item,
                None => {
                    let size = Vec2::new(0.0, PASSAGE);
                    items.push(Item { size, column, top: 0.0 });
                    passages.push((pin, column, items.len() - 1));
                    items.len() - 1
                }
            };
            let next = (passage, PASSAGE / 2.0);
            stretches.push(Stretch { from: at, to: next, room });
            (at, room) = (next, 0.0);
        }
        stretches.push(Stretch { from: at, to: link.to, room });
    }
    stretches
}

/// Orders columns by the mean position of their items' neighbours, alternately from the left and from the right, and
/// keeps the order with the fewest crossings.
fn untangle(order: &mut Vec<Vec<usize>>, items: &[Item], stretches: &[Stretch]) {
    let mut best = (crossings(order, items, stretches), order.clone());
    for sweep in 0..SWEEPS {
        let from_left = sweep % 2 == 0;
        let count = order.len();
        for step in 1..count {
            let column = if from_left { step } else { count - 1 - step };
            let places = places(order, items.len());
            let centre = |item: usize| {
                let joined = stretches.iter().filter_map(|stretch| match from_left {
                    true if stretch.to.0 == item => Some(places[stretch.from.0] + share(stretch.from, items)),
                    false if stretch.from.0 == item => Some(places[stretch.to.0] + share(stretch.to, items)),
                    _ => None,
                });
                mean(joined).unwrap_or(places[item])
            };
            let centres: Vec<f32> = (0..items.len()).map(centre).collect();
            order[column].sort_by(|a, b| centres[*a].total_cmp(&centres[*b]));
        }
        let found = crossings(order, items, stretches);
        if found < best.0 {
            best = (found, order.clone());
        }
    }
    *order = best.1;
}

/// The index of each item in its column.
fn places(order: &[Vec<usize>], count: usize) -> Vec<f32> {
    let mut places = vec![0.0; count];
    for column in order {
        for (place, item) in column.iter().enumerate() {
            places[*item] = place as f32;
        }
    }
    places
}

/// The relative height of a wire's end in its box, so that the order of pins counts.
fn share((item, height): (usize, f32), items: &[Item]) -> f32 {
    height / items[item].size.y.max(1.0)
}

fn crossings(order: &[Vec<usize>], items: &[Item], stretches: &[Stretch]) -> usize {
    let places = places(order, items.len());
    let ends: Vec<(usize, f32, f32)> = stretches
        .iter()
        .map(|stretch| {
            let end = |end: (usize, f32)| places[end.0] + 0.9 * share(end, items);
            (items[stretch.from.0].column, end(stretch.from), end(stretch.to))
        })
        .collect();
    let cross = |a: &(usize, f32, f32), b: &(usize, f32, f32)| a.0 == b.0 && (a.1 - b.1) * (a.2 - b.2) < 0.0;
    ends.iter().enumerate().map(|(index, a)| ends[..index].iter().filter(|b| cross(a, b)).count()).sum()
}

fn mean(values: impl Iterator<Item = f32>) -> Option<f32> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / count as f32)
}

/// The median; of an even number of values, the lower one, so that at least one wire runs level.
fn middle(mut values: Vec<f32>) -> Option<f32> {
    values.sort_by(f32::total_cmp);
    values.get(values.len().saturating_sub(1) / 2).copied()
}

/// Finds heights for the items so that wires run level, as far as the order allows.
fn level(order: &[Vec<usize>], items: &mut [Item], stretches: &[Stretch]) {
    for column in order {
        stack(column, items, &vec![0.0; column.len()]);
    }
    for sweep in 0..SWEEPS {
        // The last sweeps consider both sides.
        let (left, right) = (sweep % 2 == 0 || sweep + 4 > SWEEPS, sweep % 2 == 1 || sweep + 4 > SWEEPS);
        let count = order.len();
        for step in 0..count {
            let column = &order[if sweep % 2 == 0 { step } else { count - 1 - step }];
            let wish = |item: &usize| {
                let joined = stretches.iter().filter_map(|stretch| {
                    if left && stretch.to.0 == *item {
                        Some(items[stretch.from.0].top + stretch.from.1 - stretch.to.1)
                    } else if right && stretch.from.0 == *item {
                        Some(items[stretch.to.0].top + stretch.to.1 - stretch.from.1)
                    } else {
                        None
                    }
                });
                middle(joined.collect()).unwrap_or(items[*item].top)
            };
            let wishes: Vec<f32> = column.iter().map(wish).collect();
            stack(column, items, &wishes);
        }
    }
}

/// Puts the items of a column as close to their wished heights as their order and sizes allow, in the least-squares
/// sense. After subtracting each item's minimum distance from the first item, this is isotonic regression, solved by
/// pooling adjacent violators.
fn stack(column: &[usize], items: &mut [Item], wishes: &[f32]) {
    let mut offsets = Vec::with_capacity(column.len());
    let mut bottom = 0.0;
    for item in column {
        offsets.push(bottom);
        bottom += items[*item].size.y + if items[*item].size.x > 0.0 { GAP } else { PASSAGE };
    }
    let mut pools: Vec<(f32, usize)> = Vec::new();
    for (wish, offset) in wishes.iter().zip(&offsets) {
        let mut pool = (wish - offset, 1);
        while let Some((above, count)) = pools.pop_if(|above| above.0 > pool.0) {
            let both = count + pool.1;
            pool = ((above * count as f32 + pool.0 * pool.1 as f32) / both as f32, both);
        }
        pools.push(pool);
    }
    let places = pools.into_iter().flat_map(|(place, count)| std::iter::repeat_n(place, count));
    for ((item, place), offset) in column.iter().zip(places).zip(offsets) {
        items[*item].top = place + offset;
    }
}

/// The extent of a column.
struct Column {
    width: f32,
    /// Gap to the next column.
    alley: f32,
    top: f32,
    bottom: f32,
    /// Number of outputs whose wires lead from it to the next column.
    tracks: usize,
}

fn columns_of(order: &[Vec<usize>], items: &[Item], stretches: &[Stretch], boxes: usize) -> Vec<Column> {
    let column = |(column, members): (usize, &Vec<usize>)| {
        let own = || members.iter().filter(|item| **item < boxes).map(|item| &items[*item]);
        let leaving = || stretches.iter().filter(|stretch| items[stretch.from.0].column == column);
        let pins: BTreeSet<(usize, u32)> =
            leaving().map(|stretch| (stretch.from.0, stretch.from.1.to_bits())).collect();
        Column {
            width: own().map(|item| item.size.x).fold(0.0, f32::max),
            alley: ALLEY
                + LANE * pins.len().min(10) as f32
                + leaving().map(|stretch| stretch.room).fold(0.0, f32::max),
            top: own().map(|item| item.top).fold(f32::INFINITY, f32::min),
            bottom: own().map(|item| item.top + item.size.y).fold(f32::NEG_INFINITY, f32::max),
            tracks: pins.len(),
        }
    };
    order.iter().enumerate().map(column).collect()
}

/// The offset of each column and its boxes, to the right and down. Uses more rows if they increase the zoom enough.
fn fold(columns: &[Column], room: Vec2) -> Vec<Pos2> {
    let mut best: Option<(f32, Vec<Pos2>)> = None;
    for rows in 1..=ROWS.min(columns.len()) {
        let (corners, size) = in_rows(columns, rows);
        let zoom = (room.x / size.x.max(1.0)).min(room.y / size.y.max(1.0));
        if best.as_ref().is_none_or(|(known, _)| *known < 1.0 && zoom > known * WORTH) {
            best = Some((zoom, corners));
        }
    }
    best.map(|(_, corners)| corners).unwrap_or_default()
}

/// The offsets of the columns in `rows` rows of about equal width, and the total size. The columns of all rows are
/// aligned, so that wires can pass between them.
fn in_rows(columns: &[Column], rows: usize) -> (Vec<Pos2>, Vec2) {
    let rows = split(columns, rows);
    let widest = rows.iter().map(|row| row.len()).max().unwrap_or(0);
    let (mut lefts, mut x, mut end) = (Vec::new(), 0.0, 0.0);
    for place in 0..widest {
        let stacked = || rows.iter().filter_map(|row| row.get(place));
        lefts.push(x);
        end = x + stacked().map(|column| column.width).fold(0.0, f32::max);
        x = end + stacked().map(|column| column.alley).fold(0.0, f32::max);
    }
    let (mut corners, mut y) = (Vec::new(), 0.0);
    for row in &rows {
        if !corners.is_empty() {
            y += CORRIDOR;
        }
        let top = row.iter().map(|column| column.top).fold(f32::INFINITY, f32::min);
        let bottom = row.iter().map(|column| column.bottom).fold(f32::NEG_INFINITY, f32::max);
        corners.extend((0..row.len()).map(|place| pos2(lefts[place], y - top)));
        y += bottom - top + row.last().map_or(0.0, |last| TRACK * last.tracks as f32);
    }
    (corners, Vec2::new(end, y))
}

fn split(columns: &[Column], rows: usize) -> Vec<&[Column]> {
    let whole: f32 = columns.iter().map(|column| column.width + column.alley).sum();
    let (mut split, mut start, mut done) = (Vec::new(), 0, 0.0);
    for (index, column) in columns.iter().enumerate() {
        let width = column.width + column.alley;
        // A column belongs to the row that its centre falls into.
        if index > start && done + 0.5 * width > whole * (split.len() + 1) as f32 / rows as f32 {
            split.push(&columns[start..index]);
            start = index;
        }
        done += width;
    }
    split.push(&columns[start..]);
    split
}

#[cfg(test)]
mod tests {
    use egui::{Rect, vec2};

    use super::*;

    /// A pane that fits any graph in one row.
    const WIDE: Vec2 = vec2(1e6, 1e6);

    fn link(from: usize, to: usize) -> Link {
        Link { from: (from, 20.0), to: (to, 20.0), back: false, room: 0.0 }
    }

    fn rects(sizes: &[Vec2], places: &[Pos2]) -> Vec<Rect> {
        places.iter().zip(sizes).map(|(place, size)| Rect::from_min_size(*place, *size)).collect()
    }

    #[test]
    fn boxes_never_overlap_and_wires_lead_to_the_right() {
        let sizes: Vec<Vec2> =
            (0..12).map(|index| vec2(100.0 + 7.0 * index as f32, 60.0 + 11.0 * (index % 4) as f32)).collect();
        let links: Vec<Link> =
            [(0, 1), (0, 5), (1, 2), (2, 3), (3, 4), (0, 4), (6, 4), (7, 3), (7, 4), (8, 9), (9, 3)]
                .map(|(a, b)| link(a, b))
                .into();
        let places = arrange(&sizes, &links, WIDE);
        let rects = rects(&sizes, &places);
        for (index, rect) in rects.iter().enumerate() {
            for other in &rects[..index] {
                assert!(!rect.expand(10.0).intersects(*other), "{rect} {other}");
            }
        }
        for link in &links {
            assert!(rects[link.from.0].right() < rects[link.to.0].left());
        }
        assert!(places.iter().all(|place| place.x >= 0.0 && place.y >= 0.0));
    }

    #[test]
    fn a_chain_is_level_and_a_source_is_beside_its_reader() {
        let sizes = [vec2(100.0, 80.0); 5];
        // Only 3 reads from 4.
        let places = arrange(&sizes, &[link(0, 1), link(1, 2), link(2, 3), link(4, 3)], WIDE);
        assert!(places[..3].windows(2).all(|pair| (pair[0].y - pair[1].y).abs() < 1.0), "{places:?}");
        assert_eq!(places[4].x, places[2].x);
    }

    #[test]
    fn a_cycle_is_cut_at_the_wire_against_file_order() {
        let sizes = [vec2(100.0, 80.0); 3];
        let places = arrange(&sizes, &[link(2, 0), link(0, 1), link(1, 2), link(1, 1)], WIDE);
        assert!(places[0].x < places[1].x && places[1].x < places[2].x, "{places:?}");
    }

    #[test]
    fn wires_are_untangled() {
        let sizes = [vec2(100.0, 80.0); 6];
        let places = arrange(&sizes, &[link(0, 5), link(1, 4), link(2, 3)], WIDE);
        let upside_down = |a: usize, b: usize| places[a].y < places[b].y;
        assert_eq!(upside_down(0, 1), upside_down(5, 4));
        assert_eq!(upside_down(1, 2), upside_down(4, 3));
    }

    #[test]
    fn a_long_chain_is_folded_if_that_increases_the_zoom() {
        let sizes = [vec2(150.0, 80.0); 12];
        let links: Vec<Link> = (1..12).map(|index| link(index - 1, index)).collect();
        let extent = |room: Vec2| {
            let rects = rects(&sizes, &arrange(&sizes, &links, room));
            let all = rects.iter().fold(Rect::NOTHING, |all, rect| all.union(*rect));
            for (index, rect) in rects.iter().enumerate() {
                assert!(rects[..index].iter().all(|other| !rect.expand(10.0).intersects(*other)));
            }
            all.size()
        };
        let (flat, folded) = (extent(vec2(4000.0, 300.0)), extent(vec2(600.0, 500.0)));
        assert!(flat.y < 100.0 && flat.x > 1800.0, "{flat}");
        let zoom = |size: Vec2| (600.0 / size.x).min(500.0 / size.y);
        assert!(zoom(folded) > 2.0 * zoom(flat), "{folded} {flat}");
    }
}
