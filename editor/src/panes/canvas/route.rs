//! The paths of wires: level through the gaps between boxes, and curved from one gap to the next. They are recomputed
//! when boxes move, so that wires never cross boxes.

use std::collections::BTreeSet;

use egui::{Pos2, Rect, epaint::CubicBezierShape, pos2};

/// Room between a wire and a box.
const MARGIN: f32 = 9.0;
/// Between wires from different pins that pass the same gap.
const LANE: f32 = 7.0;
/// Between wires that turn back at the same column, and how many of them there is room for.
const TURN: f32 = 4.0;
const TURNS: usize = 8;
/// Length of a wire's straight run out of a pin before it turns.
const REACH: f32 = 34.0;
/// Number of points that a curve is flattened to.
const STEPS: usize = 14;

/// A column of boxes.
struct Column {
    left: f32,
    right: f32,
    /// Occupied ranges of height, each with its owner: `None` for a box, else the wires' pin.
    taken: Vec<(f32, f32, Option<usize>)>,
}

/// The paths of wires between pins, as polylines. Each wire comes with the number of its source pin:
/// wires from one pin may share their path.
pub fn routes(boxes: &[Rect], wires: &[(Pos2, Pos2, usize)]) -> Vec<Vec<Pos2>> {
    let mut columns = columns(boxes);
    let mut routes = vec![Vec::new(); wires.len()];
    // Short wires first: they have fewer alternatives.
    let mut order: Vec<usize> = (0..wires.len()).collect();
    order.sort_by(|a, b| {
        let span = |wire: usize| (wires[wire].1.x - wires[wire].0.x).abs();
        span(*a).total_cmp(&span(*b))
    });
    for wire in order {
        let (from, to, pin) = wires[wire];
        routes[wire] = curve(&way(from, to, pin, &mut columns));
    }
    routes
}

/// Groups boxes whose widths overlap.
fn columns(boxes: &[Rect]) -> Vec<Column> {
    let mut sorted: Vec<&Rect> = boxes.iter().collect();
    sorted.sort_by(|a, b| a.left().total_cmp(&b.left()));
    let mut columns: Vec<Column> = Vec::new();
    for rect in sorted {
        let taken = (rect.top() - MARGIN, rect.bottom() + MARGIN, None);
        match columns.last_mut() {
            Some(column) if rect.left() < column.right => {
                column.right = column.right.max(rect.right());
                column.taken.push(taken);
            }
            _ => columns.push(Column { left: rect.left(), right: rect.right(), taken: vec![taken] }),
        }
    }
    columns
}

/// A point of a path: true if the wire runs to the right there.
type Turn = (Pos2, bool);

fn way(from: Pos2, to: Pos2, pin: usize, columns: &mut [Column]) -> Vec<Turn> {
    let forward = to.x > from.x;
    let mut way = vec![(from, true)];
    let mut passed: Vec<&mut Column> = columns
        .iter_mut()
        .filter(|column| {
            if forward {
                column.left >= from.x && column.right <= to.x
            } else {
                // A wire back passes all columns from its target to its source.
                column.right >= to.x && column.left <= from.x
            }
        })
        .collect();
    if !forward {
        passed.reverse();
    }
    let mut at = from;
    for column in passed {
        let middle = (column.left + column.right) / 2.0;
        let share = if forward { ((middle - at.x) / (to.x - at.x)).clamp(0.0, 1.0) } else { 0.0 };
        let y = column.free([at.y, to.y], share, pin);
        column.taken.push((y - LANE, y + LANE, Some(pin)));
        // Wires that turn back at the same column are drawn side by side.
        let turn = if forward { MARGIN } else { MARGIN + TURN * column.turns(pin) as f32 };
        let ends = [pos2(column.left - turn, y), pos2(column.right + turn, y)];
        way.extend(if forward { ends } else { [ends[1], ends[0]] }.map(|end| (end, forward)));
        at = pos2(if forward { ends[1].x } else { ends[0].x }, y);
    }
    way.push((to, true));
    way
}

impl Column {
    /// Number of other pins' wires that have passed it.
    fn turns(&self, pin: usize) -> usize {
        let pins: BTreeSet<usize> =
            self.taken.iter().filter_map(|(.., by)| *by).take_while(|by| *by != pin).collect();
        pins.len() % TURNS
    }

    /// A height that no box and no other pin's wire occupies: on the way from one height to the other, if possible on
    /// the straight line, else with the smallest detour.
    fn free(&self, [from, to]: [f32; 2], share: f32, pin: usize) -> f32 {
        let wanted = from + (to - from) * share;
        let others = || self.taken.iter().filter(|(.., by)| *by != Some(pin));
        let is_free = |y: f32| others().all(|(top, bottom, _)| y <= *top || y >= *bottom);
        let ends = others().flat_map(|(top, bottom, _)| [*top, *bottom]);
        let own = self.taken.iter().filter(|(.., by)| *by == Some(pin)).map(|(top, _, _)| top + LANE);
        let candidates = std::iter::once(wanted).chain(own).chain(ends).filter(|y| is_free(*y));
        let cost = |y: f32| (y - from).abs() + (y - to).abs() + 0.1 * (y - wanted).abs();
        candidates.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(wanted)
    }
}

fn curve(way: &[Turn]) -> Vec<Pos2> {
    let mut points: Vec<Pos2> = way.first().map(|(start, _)| *start).into_iter().collect();
    for pair in way.windows(2) {
        let [(a, a_right), (b, b_right)] = [pair[0], pair[1]];
        if (a.y - b.y).abs() < 0.5 && a_right == b_right && (b.x > a.x) == a_right {
            points.push(b);
            continue;
        }
        let ahead = if a_right { b.x - a.x } else { a.x - b.x };
        let reach = if a_right == b_right && ahead > 0.0 { ahead * 0.55 } else { REACH };
        let handle =
            |at: Pos2, right: bool, sign: f32| pos2(at.x + if right { sign } else { -sign } * reach, at.y);
        let bezier = CubicBezierShape::from_points_stroke(
            [a, handle(a, a_right, 1.0), handle(b, b_right, -1.0), b],
            false,
            egui::Color32::TRANSPARENT,
            egui::Stroke::NONE,
        );
        points.extend((1..=STEPS).map(|step| bezier.sample(step as f32 / STEPS as f32)));
    }
    points
}

/// The distance of a point from a path.
pub fn distance(route: &[Pos2], to: Pos2) -> f32 {
    let pieces = route.windows(2).map(|ends| {
        let along = ends[1] - ends[0];
        let share = ((to - ends[0]).dot(along) / along.length_sq().max(1e-6)).clamp(0.0, 1.0);
        (ends[0] + along * share).distance(to)
    });
    pieces.fold(f32::INFINITY, f32::min)
}

/// The point of a path at this distance from its beginning, or its middle if it is shorter than twice that.
pub fn along(route: &[Pos2], length: f32) -> Pos2 {
    let whole: f32 = route.windows(2).map(|ends| ends[0].distance(ends[1])).sum();
    let mut left = length.min(whole / 2.0);
    for ends in route.windows(2) {
        let piece = ends[0].distance(ends[1]);
        if piece >= left {
            return ends[0].lerp(ends[1], if piece > 0.0 { left / piece } else { 0.0 });
        }
        left -= piece;
    }
    route.last().copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use egui::vec2;

    use super::*;

    fn row() -> Vec<Rect> {
        (0..4).map(|index| Rect::from_min_size(pos2(200.0 * index as f32, 0.0), vec2(100.0, 80.0))).collect()
    }

    fn clear(route: &[Pos2], boxes: &[Rect]) -> bool {
        boxes.iter().all(|rect| route.iter().all(|point| !rect.shrink(1.0).contains(*point)))
    }

    #[test]
    fn wires_avoid_boxes_and_wires_of_other_pins() {
        let boxes = row();
        let (from, to) = (pos2(100.0, 40.0), pos2(600.0, 40.0));
        let found = routes(&boxes, &[(from, to, 0), (from, to, 1), (from, to, 0)]);
        assert!(found.iter().all(|route| clear(route, &boxes)), "{found:?}");
        assert!(found.iter().all(|route| route[0] == from && route[route.len() - 1] == to));
        let y = |route: &[Pos2]| route.iter().find(|point| (point.x - 191.0).abs() < 0.5).unwrap().y;
        assert_eq!(y(&found[0]), y(&found[2]));
        assert!((y(&found[0]) - y(&found[1])).abs() >= LANE);
    }

    #[test]
    fn a_wire_back_avoids_all_boxes() {
        let boxes = row();
        let found = routes(
            &boxes,
            &[(pos2(700.0, 40.0), pos2(0.0, 40.0), 0), (pos2(300.0, 20.0), pos2(200.0, 60.0), 1)],
        );
        assert!(found.iter().all(|route| clear(route, &boxes)), "{found:?}");
    }

    #[test]
    fn distances_from_and_along_a_wire() {
        let route = [pos2(0.0, 0.0), pos2(10.0, 0.0), pos2(10.0, 10.0)];
        assert_eq!(distance(&route, pos2(5.0, 3.0)), 3.0);
        assert_eq!(distance(&route, pos2(14.0, 13.0)), 5.0);
        assert_eq!(along(&route, 4.0), pos2(4.0, 0.0));
        assert_eq!(along(&route, 100.0), pos2(10.0, 0.0));
    }
}
