//! Stacked bars: the time of each node and transfer, by the side that it runs on; a bar for each graph at each budget.

use std::collections::BTreeMap;

use epigraph_pictures::svg::{Anchor, Svg};

use super::{
    cell::{NodeCost, Record},
    plot::{LETTER, LINE, MARGIN, Mark, heading, legend, views},
    results::groups,
};
use crate::{
    axis::{number, round_step},
    svg::{GRID, HEADING, LABEL, LINES, QUIET},
};

/// Width of the longest bar, height of all, and distance from one to the next.
const BAR: [f64; 2] = [640.0, 14.0];
const STEP: f64 = 30.0;
/// Height of the line below a bar that has the colour of a side.
const SIDE: f64 = 3.0;
/// Room for the heading and the numbers of a panel.
const HEAD: f64 = 46.0;
/// The longest name of a bar, in letters.
const MOST_LETTERS: usize = 60;
/// Room for the times at the end of a bar.
const TIMES: f64 = 260.0;

/// Colours of nodes after [`LINES`].
const MORE_COLORS: [&str; 4] = ["#e59a8f", "#8fb4dc", "#93c9a4", "#d8b46a"];
/// Nodes beyond those with colours, and transfers.
const OTHERS: (&str, &str) = ("other nodes", "#c3c8ce");
const TRANSFERS: (&str, &str) = ("transfers", "#1b1f24");
/// The colours of sides.
const SIDES: [(&str, &str); 3] = [("cpu", "#8c959f"), ("gpu", "#1797a6"), ("transfer", "#1b1f24")];

/// What a node took, and on which side.
struct Part {
    node: String,
    /// Of [`SIDES`].
    side: usize,
    ms: f64,
}

/// The times of one graph at one budget.
struct Bar {
    name: String,
    /// By side, then in the order of the plan.
    parts: Vec<Part>,
}

/// The bars of all views. `None` if nothing was timed.
pub fn stacks(doc: &str, records: &[Record]) -> Option<String> {
    let panels: Vec<(String, Vec<Bar>)> = views(records)
        .map(|view| (view[0].cell.view(), groups(view).filter_map(Bar::of).collect::<Vec<_>>()))
        .filter(|(_, bars)| !bars.is_empty())
        .collect();
    let bars = || panels.iter().flat_map(|(_, bars)| bars);
    let most = bars().map(|bar| bar.ms(|_| true)).fold(0.0, f64::max);
    if most <= 0.0 {
        return None;
    }
    let colors = colors(bars());
    let letters = bars().map(|bar| bar.name.chars().count()).max().unwrap_or(0).min(MOST_LETTERS);
    let left = MARGIN + LETTER * letters as f64 + 12.0;
    let width = left + BAR[0] + TIMES + MARGIN;
    let mut svg = Svg::default();
    let about = "ms per frame of each node: its median over the frames, the mean of that over the seeds; the line below \
                 a bar shows the side; times of this machine";
    let mut y = heading(&mut svg, doc, about, width);
    y = legend(&mut svg, Mark::Area, &colors, width, y) + LINE;
    y = legend(&mut svg, Mark::Area, &SIDES, width, y) + 30.0;
    let scale = BAR[0] / most;
    for (view, bars) in &panels {
        svg.text([MARGIN, y], view, Anchor::Start, HEADING);
        let top = y + HEAD - 16.0;
        let step = round_step(most / 8.0);
        for nth in 0..=(most / step) as u32 {
            let ms = f64::from(nth) * step;
            let x = left + ms * scale;
            svg.line([x, top], [x, top + STEP * bars.len() as f64], GRID, 1.0);
            svg.text([x, top - 6.0], &number(ms), Anchor::Middle, QUIET);
        }
        for (nth, bar) in bars.iter().enumerate() {
            bar.draw(&mut svg, [left, top + STEP * nth as f64 + 6.0], scale, &colors);
        }
        y = top + STEP * bars.len() as f64 + 34.0;
    }
    Some(svg.finish([width, y - 16.0]))
}

/// The nodes that have a colour, those with the most time, then the colours of the rest.
fn colors<'b>(bars: impl Iterator<Item = &'b Bar>) -> Vec<(&'b str, &'static str)> {
    let mut times: BTreeMap<&str, f64> = BTreeMap::new();
    let (mut nodes, mut has_transfers) = (Vec::new(), false);
    for part in bars.flat_map(|bar| &bar.parts) {
        if SIDES[part.side].0 == "transfer" {
            has_transfers = true;
            continue;
        }
        if !times.contains_key(part.node.as_str()) {
            nodes.push(part.node.as_str());
        }
        *times.entry(&part.node).or_default() += part.ms;
    }
    let mut by_time = nodes.clone();
    by_time.sort_by(|a, b| times[b].total_cmp(&times[a]));
    by_time.truncate(LINES.len() + MORE_COLORS.len());
    // In the order of the plans.
    let colored = nodes.iter().copied().filter(|node| by_time.contains(node));
    let mut colors: Vec<(&str, &'static str)> = colored.zip(LINES.into_iter().chain(MORE_COLORS)).collect();
    colors.extend((nodes.len() > colors.len()).then_some(OTHERS));
    colors.extend(has_transfers.then_some(TRANSFERS));
    colors
}

impl Bar {
    /// The means of a group of repetitions, unless all failed.
    fn of(group: &[Record]) -> Option<Self> {
        let measured: Vec<_> = group.iter().filter_map(Record::measured).collect();
        let (count, first) = (measured.len() as f64, measured.first()?);
        let part = |(nth, cost): (usize, &NodeCost)| {
            // All seeds run the same plan.
            let ms = measured
                .iter()
                .filter_map(|measured| measured.nodes.get(nth))
                .map(|cost| cost.ms)
                .sum::<f64>();
            let side = cost.backend.as_deref().unwrap_or("transfer");
            let side = SIDES.iter().position(|(name, _)| *name == side)?;
            Some(Part { node: cost.node.clone(), side, ms: ms / count })
        };
        let mut parts: Vec<Part> = first.nodes.iter().enumerate().filter_map(part).collect();
        parts.sort_by_key(|part| part.side);
        let cell = &group[0].cell;
        Some(Self { name: format!("{}, {}", cell.variation(), cell.budget), parts })
    }

    fn ms(&self, chosen: impl Fn(&Part) -> bool) -> f64 {
        self.parts.iter().filter(|part| chosen(part)).map(|part| part.ms).sum()
    }

    fn draw(&self, svg: &mut Svg, [left, top]: [f64; 2], scale: f64, colors: &[(&str, &str)]) {
        let name: String = self.name.chars().take(MOST_LETTERS).collect();
        svg.text([left - 10.0, top + 11.5], &name, Anchor::End, LABEL);
        let mut x = left;
        for part in &self.parts {
            let is_transfer = SIDES[part.side].0 == "transfer";
            let color =
                colors.iter().find(|(node, _)| *node == part.node).map_or(OTHERS.1, |(_, color)| color);
            let width = part.ms * scale;
            svg.rect([x, top], [width, BAR[1]], if is_transfer { TRANSFERS.1 } else { color });
            x += width;
        }
        let time = |(side, (name, color)): (usize, &(&'static str, &'static str))| {
            (*name, *color, self.ms(|part| part.side == side))
        };
        let sides: Vec<_> = SIDES.iter().enumerate().map(time).filter(|(.., ms)| *ms > 0.0).collect();
        let mut from = left;
        for (_, color, ms) in &sides {
            svg.rect([from, top + BAR[1] + 1.0], [ms * scale, SIDE], color);
            from += ms * scale;
        }
        let mut text = format!("{:.2}", self.ms(|_| true));
        if sides.len() > 1 {
            let sides: Vec<String> = sides.iter().map(|(name, _, ms)| format!("{name} {ms:.2}")).collect();
            text += &format!(" ({})", sides.join(", "));
        }
        svg.text([x + 8.0, top + 11.5], &text, Anchor::Start, QUIET);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tradeoff::cell::{
        Outcome,
        tests::{cell, record},
    };

    fn timed(graph: &str, seed: u32, nodes: &[(&str, Option<&str>, f64)]) -> Record {
        let mut record = record(cell(graph, 5, seed), 0.1, 1.0);
        if let Outcome::Measured(measured) = &mut record.result {
            let cost = |(node, side, ms): &(&str, Option<&str>, f64)| NodeCost {
                node: (*node).into(),
                kind: "kind".into(),
                backend: side.map(String::from),
                ms: *ms,
                bytes_moved: 0.0,
            };
            measured.nodes = nodes.iter().map(cost).collect();
        }
        record
    }

    #[test]
    fn bars_are_means_by_side() {
        let nodes = |ms: f64| {
            [("cull", Some("gpu"), ms), ("download x", None, 1.0), ("trace", Some("cpu"), 2.0 * ms)]
        };
        let bar = Bar::of(&[timed("epi", 1, &nodes(1.0)), timed("epi", 2, &nodes(3.0))]).unwrap();
        let parts: Vec<_> = bar.parts.iter().map(|part| (part.node.as_str(), part.side, part.ms)).collect();
        assert_eq!(parts, [("trace", 0, 4.0), ("cull", 1, 2.0), ("download x", 2, 1.0)]);
        let svg = stacks("What?", &[timed("epi", 1, &nodes(1.0))]).unwrap();
        assert!(svg.contains(">4.00 (cpu 2.00, gpu 1.00, transfer 1.00)<"), "{svg}");
        // A bar that fills the width: half of it is the tracer's.
        assert_eq!(svg.matches("width=\"320.00\" height=\"14.00\"").count(), 1, "{svg}");
        assert!(stacks("What?", &[record(cell("epi", 5, 1), 0.1, 1.0)]).is_none(), "nothing was timed");
    }

    #[test]
    fn the_nodes_with_the_most_time_have_colours() {
        let names: Vec<String> = (0..14).map(|nth| format!("n{nth}")).collect();
        let nodes: Vec<_> = names
            .iter()
            .enumerate()
            .map(|(nth, name)| (name.as_str(), Some("cpu"), 1.0 + nth as f64))
            .collect();
        let bar = Bar::of(&[timed("epi", 1, &nodes)]).unwrap();
        let colors = colors([&bar].into_iter());
        assert_eq!(colors.len(), 13);
        assert_eq!((colors[0].0, colors[11].0, colors[12]), ("n2", "n13", OTHERS));
    }
}
