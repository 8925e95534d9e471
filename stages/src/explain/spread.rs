//! Where the colour of a hole comes from.

use std::collections::{HashMap, VecDeque};

use epigraph_core::{Cell, Finding, Role, Site};

use super::{HOLE, Method, ROUND, SQUARES, Spread, SpreadParams, TILE, joined};
use crate::shared::words::{count, pixel};

pub(super) fn at(stage: &Spread, params: &SpreadParams, site: &Site) -> Option<Vec<Finding>> {
    let at = site.at();
    let filled = site.wrote(stage.filled)?;
    let color = site.wrote(stage.color)?;
    let mut findings = vec![Finding::color("colour", &color[at])];
    let why = match (filled[at], params.method) {
        (0, _) => "Not a hole: it keeps its colour.".into(),
        (HOLE, Method::Off) => "A hole that stays black, as filling is off (`method: Off`).".into(),
        (HOLE, _) if color[at][3] <= 0.0 => "A hole that stays black: the image contains no colour.".into(),
        (HOLE, _) => {
            findings.push(site.around("Pixels around that have colours", 1, |offset| {
                let other = site.beside(offset).filter(|other| filled[*other] != HOLE);
                let linear = other.map(|other| [color[other][0], color[other][1], color[other][2]]);
                Cell {
                    role: if linear.is_some() { Role::Counts } else { Role::None },
                    linear,
                    text: String::new(),
                }
            }));
            let spread = if params.method == Method::Spread { "No colour spread this far. " } else { "" };
            format!("{spread}Filled with the mean of {}, regardless of edges.", smallest(&filled, site))
        }
        (round, _) => {
            let n8 = site.read(stage.n8)?;
            let [width, height] = site.size();
            let (steps, from) = sources(&filled, &n8, [width, height], at, (params.rounds * ROUND) as usize)?;
            findings.push(site.around("Colours around that spread here", 1, |offset| {
                let other = site.beside(offset);
                let lends = other.is_some_and(|other| from.contains(&other));
                let linear = other.map(|other| [color[other][0], color[other][1], color[other][2]]);
                let role = if lends || offset == [0, 0] { Role::Counts } else { Role::Apart };
                Cell { role, linear, text: String::new() }
            }));
            let names: Vec<String> = from.iter().map(|from| pixel(*from, width)).collect();
            format!(
                "A hole, filled in round {round}: colours came {} without crossing an edge, at last from {}.",
                count(steps, "step"),
                names.join(", ")
            )
        }
    };
    findings.push(Finding::Why(why));
    Some(findings)
}

/// The number of steps from a hole to the nearest colour, and the pixels joined to the hole that are one step nearer.
fn sources(
    filled: &[u32],
    n8: &[u32],
    [width, height]: [usize; 2],
    hole: usize,
    most: usize,
) -> Option<(usize, Vec<usize>)> {
    let mut found = HashMap::from([(hole, 0)]);
    let mut next = VecDeque::from([hole]);
    while let Some(p) = next.pop_front() {
        let steps = found[&p];
        if filled[p] == 0 {
            let from = joined(width, height, n8, hole);
            let lends = |q: &usize| leads(filled, n8, [width, height], *q, steps - 1);
            return Some((steps, from.filter(lends).collect()));
        }
        for q in joined(width, height, n8, p).filter(|_| steps < most) {
            found.entry(q).or_insert_with(|| {
                next.push_back(q);
                steps + 1
            });
        }
    }
    None
}

/// Returns true if a path of `steps` steps leads from a pixel to a colour.
fn leads(filled: &[u32], n8: &[u32], [width, height]: [usize; 2], from: usize, steps: usize) -> bool {
    let mut front = vec![from];
    for _ in 0..steps {
        front = front.into_iter().flat_map(|p| joined(width, height, n8, p)).collect();
        front.sort_unstable();
        front.dedup();
    }
    front.into_iter().any(|p| filled[p] == 0)
}

/// Describes the smallest square or block around the pixel that contains colours.
fn smallest(filled: &[u32], site: &Site) -> String {
    let [width, height] = site.size();
    let [x, y] = site.pixel.map(|along| along as usize);
    let holds = |columns: std::ops::Range<usize>, rows: std::ops::Range<usize>| {
        let colours = rows.flat_map(|y| columns.clone().map(move |x| y * width + x));
        colours.filter(|p| filled[*p] != HOLE).count()
    };
    for reach in SQUARES {
        let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
        let found = holds(columns, y.saturating_sub(reach)..(y + reach + 1).min(height));
        if found > 0 {
            let side = 2 * reach + 1;
            return format!("{} in the {side}×{side} pixels around", count(found, "colour"));
        }
    }
    let mut side = TILE;
    loop {
        let start = [x / side * side, y / side * side];
        let end = [(start[0] + side).min(width), (start[1] + side).min(height)];
        let found = holds(start[0]..end[0], start[1]..end[1]);
        if found > 0 || side > width.max(height) {
            return format!("{} in its block of {side}×{side} pixels", count(found, "colour"));
        }
        side *= 2;
    }
}
