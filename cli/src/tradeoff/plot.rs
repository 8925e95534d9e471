//! Plots: error over cost with the Pareto front, error over frames, and several errors over light paths; a panel for each
//! scene, camera and size.

use std::collections::BTreeSet;

use epigraph_pictures::svg::{Anchor, Svg};

use super::{
    cell::{Cell, Record},
    figure::{Cost, Metric, REFERENCE_FLIP, REFERENCE_PSNR},
    results::{groups, mean},
};
use crate::{
    axis::{Axis, number},
    svg::{HEADING, LABEL, LINES, QUIET, TITLE, grid, line_color},
};

/// Left and right margin, pixels.
pub const MARGIN: f64 = 36.0;
/// Size of a panel's axes, and distance from one panel to the next.
const PANEL: [f64; 2] = [460.0, 320.0];
const STEP: [f64; 2] = [556.0, 412.0];
/// Width of the numbers of the vertical axis.
const NUMBERS: f64 = 52.0;
/// Most panels in a row.
const COLUMNS: usize = 2;
/// About the width of a letter of the labels and of the quiet texts, pixels.
pub const LETTER: f64 = 7.0;
pub const QUIET_LETTER: f64 = 6.0;
/// Height of a line of text, pixels.
pub const LINE: f64 = 17.0;
/// The colour of the front.
const FRONT: &str = "#57606a";

/// A place in a panel.
#[derive(Clone, Debug, PartialEq)]
struct Point {
    at: [f64; 2],
    /// What is written beside it.
    text: String,
}

/// The points of one variation of a graph.
#[derive(Debug, PartialEq)]
struct Series {
    /// The variation.
    name: String,
    /// What has a colour of its own: the variation, or the graph if there are many.
    group: String,
    points: Vec<Point>,
}

/// A panel.
struct Panel {
    title: String,
    /// The vertical axis: its name, and whether it is logarithmic. Panels with the same one share its scale.
    down: (String, bool),
    series: Vec<Series>,
    /// Whether the front is drawn, and if so, whether more is better.
    front: Option<bool>,
    /// A value across the whole panel, and what it is.
    level: Option<(f64, &'static str)>,
}

/// A plot.
struct Plot<'a> {
    title: &'a str,
    about: String,
    across: (&'a str, bool),
    panels: Vec<Panel>,
}

/// A metric over a cost: a point for each set of repetitions, a line for each variation of a graph. `None` if there
/// is nothing to show.
pub fn over_cost(doc: &str, records: &[Record], metric: Metric, cost: Cost) -> Option<String> {
    let naming = Naming::of(records);
    let panel = |view: &[Record]| Panel {
        title: view[0].cell.view(),
        down: down(metric),
        series: series(view, metric, cost, &naming, |cell| naming.label(cell)),
        front: Some(metric.more_is_better()),
        level: None,
    };
    let times = if cost.is_time() { "; times of this machine" } else { "" };
    Plot {
        title: doc,
        about: format!(
            "{}{}; rings: the Pareto front, which nothing else beats in both; means over the seeds{times}",
            metric.column(),
            if metric.more_is_better() { " (more is better)" } else { " (less is better)" }
        ),
        across: (cost.unit(), true),
        panels: views(records).map(panel).collect(),
    }
    .svg()
}

/// Metrics over light paths per pixel and frame, or over samples if a graph has no number of paths: for each view a panel
/// for each metric, with the reference's own error. `None` if there is nothing to show.
pub fn over_paths(title: &str, about: String, records: &[Record], metrics: &[Metric]) -> Option<String> {
    let has_paths = records.iter().all(|record| record.cell.paths_per_pixel.is_some());
    let cost = if has_paths { Cost::PathsPerPixel } else { Cost::Samples };
    let naming = Naming::of(records);
    let panel = |view: &[Record], metric: Metric| Panel {
        title: view[0].cell.view(),
        down: down(metric),
        series: series(view, metric, cost, &naming, |_| String::new()),
        front: None,
        level: level(view, metric),
    };
    let panels = views(records).flat_map(|view| metrics.iter().map(move |metric| panel(view, *metric)));
    let panels = panels.filter(|panel| panel.points().next().is_some()).collect();
    Plot { title, about, across: (cost.unit(), true), panels }.svg()
}

/// A line over a cost for each variation of a graph, with a point for each set of repetitions.
fn series(
    view: &[Record],
    metric: Metric,
    cost: Cost,
    naming: &Naming,
    text: impl Fn(&Cell) -> String,
) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for group in groups(view) {
        let cell = &group[0].cell;
        let Some(at) = mean(group, cost.column()).zip(mean(group, metric.column())) else { continue };
        let (name, point) = (cell.variation(), Point { at: at.into(), text: text(cell) });
        match all.iter_mut().find(|series| series.name == name) {
            Some(series) => series.points.push(point),
            None => all.push(Series { name, group: naming.group(cell), points: vec![point] }),
        }
    }
    all
}

/// What a view's reference says of a metric of its own.
fn level(view: &[Record], metric: Metric) -> Option<(f64, &'static str)> {
    let (column, what) = match metric {
        Metric::Psnr => (REFERENCE_PSNR, "the reference's own error"),
        Metric::Flip => (REFERENCE_FLIP, "between halves of the reference"),
        _ => return None,
    };
    mean(view, column).map(|value| (value, what))
}

/// A metric over the compared frames: a line for each variation of a graph at each budget. `None` if fewer than two
/// frames are compared.
pub fn over_frames(doc: &str, records: &[Record], metric: Metric) -> Option<String> {
    let naming = Naming::of(records);
    let several = |record: &Record| record.cell.compare.len() > 1;
    let line = |group: &[Record]| {
        let cell = &group[0].cell;
        let of_frame = |frame: &u32| {
            let figures = group.iter().filter_map(|record| {
                let frames = &record.measured()?.frames;
                frames
                    .iter()
                    .find(|found| found.frame == *frame)?
                    .errors
                    .get(metric.column())
                    .copied()
                    .flatten()
            });
            let figures: Vec<f64> = figures.collect();
            let mean = figures.iter().sum::<f64>() / figures.len() as f64;
            (!figures.is_empty()).then(|| Point { at: [f64::from(*frame), mean], text: String::new() })
        };
        let mut points: Vec<Point> = cell.compare.iter().filter_map(of_frame).collect();
        points.last_mut()?.text = naming.label(cell);
        Some(Series { name: cell.variation(), group: naming.group(cell), points })
    };
    let panel = |view: &[Record]| Panel {
        title: view[0].cell.view(),
        down: down(metric),
        series: groups(view).filter_map(line).collect(),
        front: None,
        level: None,
    };
    let plot = Plot {
        title: doc,
        about: format!("{} of each compared frame; means over the seeds", metric.column()),
        across: ("frame", records.iter().all(|record| spans_decades(&record.cell.compare))),
        panels: views(records).map(panel).collect(),
    };
    records.iter().any(several).then(|| plot.svg()).flatten()
}

/// Whether these frames, in order, are better shown on a logarithmic axis: as of a picture that converges.
fn spans_decades(frames: &[u32]) -> bool {
    frames.first().zip(frames.last()).is_some_and(|(&first, &last)| first > 0 && last / first >= 100)
}

/// How variations are coloured and points labelled.
struct Naming {
    by_graph: bool,
    several_budgets: bool,
}

impl Naming {
    fn of(records: &[Record]) -> Self {
        let count = |of: &dyn Fn(&Cell) -> String| {
            records.iter().map(|record| of(&record.cell)).collect::<BTreeSet<_>>().len()
        };
        Self {
            by_graph: count(&Cell::variation) > LINES.len(),
            several_budgets: count(&|cell| cell.budget.clone()) > 1,
        }
    }

    /// What has a colour.
    fn group(&self, cell: &Cell) -> String {
        if self.by_graph { cell.graph.clone() } else { cell.variation() }
    }

    /// What the colour does not say: the budget if there are several, and parameters.
    fn label(&self, cell: &Cell) -> String {
        let params = cell.params.iter().map(|(param, value)| {
            let name = param.rsplit_once('.').map_or(param.as_str(), |(_, name)| name);
            format!("{name} {value}")
        });
        let params: Vec<String> =
            if self.by_graph || !self.several_budgets { params.collect() } else { Vec::new() };
        let budget = self.several_budgets.then(|| cell.budget.clone());
        let parts: Vec<String> = params.into_iter().chain(budget).collect();
        if parts.is_empty() { cell.graph.clone() } else { parts.join(", ") }
    }
}

/// The records by scene, camera and size.
pub fn views(records: &[Record]) -> impl Iterator<Item = &[Record]> {
    records.chunk_by(|a, b| a.cell.view() == b.cell.view())
}

/// The points that no other one beats: whoever costs less has a worse figure. In ascending order of the cost.
fn front<'p>(points: impl Iterator<Item = &'p Point>, more: bool) -> Vec<&'p Point> {
    let value = |point: &Point| if more { -point.at[1] } else { point.at[1] };
    let mut points: Vec<&Point> = points.collect();
    points.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]).then(value(a).total_cmp(&value(b))));
    let mut best = f64::INFINITY;
    points.retain(|point| {
        let better = value(point) < best;
        best = best.min(value(point));
        better
    });
    points
}

impl Plot<'_> {
    fn svg(&self) -> Option<String> {
        // Panels share one scale, so that they can be compared: across all of them, down those of the same metric.
        let xs = || self.panels.iter().flat_map(Panel::points).map(|point| point.at[0]);
        let columns = self.panels.len().min(COLUMNS);
        if columns == 0 {
            return None;
        }
        let width = (2.0 * MARGIN + STEP[0] * columns as f64).max(2.0 * MARGIN + STEP[0] * 1.3);
        let mut svg = Svg::default();
        let names: Vec<&str> = {
            let mut known = BTreeSet::new();
            let all = self.panels.iter().flat_map(|panel| &panel.series).map(|series| series.group.as_str());
            all.filter(|name| known.insert(*name)).collect()
        };
        let top = heading(&mut svg, self.title, &self.about, width);
        let colors: Vec<(&str, &str)> = names.iter().map(|name| (*name, line_color(&names, name))).collect();
        let top = legend(&mut svg, Mark::Line, &colors, width, top) + 46.0;
        for (index, panel) in self.panels.iter().enumerate() {
            let left = MARGIN + NUMBERS + STEP[0] * (index % columns) as f64;
            let top = top + STEP[1] * (index / columns) as f64;
            let across = Axis::new(xs(), self.across.1, [left, left + PANEL[0]])?;
            let down = Axis::new(self.ys(&panel.down), panel.down.1, [top + PANEL[1], top])?;
            self.axes(&mut svg, &across, &down, panel, [left, top]);
            svg.text([left, top - 9.0], &panel.title, Anchor::Start, HEADING);
            panel.draw(&mut svg, [&across, &down], left + PANEL[0], &names);
        }
        let rows = self.panels.len().div_ceil(columns) as f64;
        Some(svg.finish([width, top + STEP[1] * rows - 20.0]))
    }

    /// What panels with this axis show.
    fn ys<'p>(&'p self, down: &'p (String, bool)) -> impl Iterator<Item = f64> + 'p {
        let alike = self.panels.iter().filter(move |panel| panel.down == *down);
        alike.flat_map(|panel| {
            let level = panel.level.map(|(value, _)| value);
            panel.points().map(|point| point.at[1]).chain(level)
        })
    }

    fn axes(&self, svg: &mut Svg, across: &Axis, down: &Axis, panel: &Panel, [left, top]: [f64; 2]) {
        let [width, height] = PANEL;
        grid(svg, [across, down], [left, top], PANEL, [short; 2]);
        let scale = |logarithmic| if logarithmic { ", logarithmic" } else { "" };
        let name = format!("{}{}", self.across.0, scale(self.across.1));
        svg.text([left + width / 2.0, top + height + 34.0], &name, Anchor::Middle, LABEL);
        let name = format!("{}{}", panel.down.0, scale(panel.down.1));
        svg.text([left + width, top - 9.0], &name, Anchor::End, QUIET);
    }
}

impl Panel {
    fn points(&self) -> impl Iterator<Item = &Point> {
        self.series.iter().flat_map(|series| &series.points)
    }

    fn draw(&self, svg: &mut Svg, [across, down]: [&Axis; 2], right: f64, names: &[&str]) {
        let screen = |point: &Point| [across.at(point.at[0]), down.at(point.at[1])];
        let shown = |point: &&Point| across.shows(point.at[0]) && down.shows(point.at[1]);
        let all = || self.points().filter(shown);
        let front = self.front.map_or(Vec::new(), |more| front(all(), more));
        let path: Vec<[f64; 2]> = front.iter().map(|point| screen(point)).collect();
        svg.dashed(&path, FRONT, 1.4);
        if let Some((value, what)) = self.level.filter(|(value, _)| down.shows(*value)) {
            let y = down.at(value);
            svg.dashed(&[[right - PANEL[0], y], [right, y]], FRONT, 1.4);
            svg.text([right - 6.0, y - 5.0], what, Anchor::End, QUIET);
        }
        for series in &self.series {
            let mut points: Vec<[f64; 2]> = series.points.iter().filter(shown).map(screen).collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let color = line_color(names, &series.group);
            svg.polyline(&points, color, 2.0);
            points.into_iter().for_each(|point| svg.dot(point, 3.6, color));
        }
        for point in &path {
            svg.ring(*point, 6.5, FRONT, 1.6);
        }
        // The front's points are labelled first, the others where there is room.
        let mut taken: Vec<[f64; 4]> = Vec::new();
        let rest = all().filter(|point| !front.contains(point));
        for point in front.iter().copied().chain(rest).filter(|point| !point.text.is_empty()) {
            let [x, y] = screen(point);
            let width = QUIET_LETTER * point.text.chars().count() as f64;
            // To the right, or to the left where the panel ends.
            let left = if x + 8.0 + width > right { x - 8.0 - width } else { x + 8.0 };
            let room = [left, y - 16.0, left + width, y - 3.0];
            let overlaps = |other: &[f64; 4]| {
                room[0] < other[2] && other[0] < room[2] && room[1] < other[3] && other[1] < room[3]
            };
            if !taken.iter().any(overlaps) {
                svg.text([room[0], y - 5.0], &point.text, Anchor::Start, QUIET);
                taken.push(room);
            }
        }
    }
}

/// Title and description of a plot. Returns where a legend can begin.
pub fn heading(svg: &mut Svg, title: &str, about: &str, width: f64) -> f64 {
    let mut y = 40.0;
    for line in wrapped(title, ((width - 2.0 * MARGIN) / 10.5) as usize) {
        svg.text([MARGIN, y], &line, Anchor::Start, TITLE);
        y += 26.0;
    }
    for line in wrapped(about, ((width - 2.0 * MARGIN) / QUIET_LETTER) as usize) {
        svg.text([MARGIN, y], &line, Anchor::Start, QUIET);
        y += LINE;
    }
    y + 10.0
}

/// What a legend shows of a colour.
#[derive(Clone, Copy)]
pub enum Mark {
    /// A line with a point.
    Line,
    /// A rectangle.
    Area,
}

/// Names with their colours. Returns where they end.
pub fn legend(svg: &mut Svg, mark: Mark, entries: &[(&str, &str)], width: f64, mut y: f64) -> f64 {
    let mut x = MARGIN;
    for (name, color) in entries {
        let entry = 34.0 + LETTER * name.chars().count() as f64 + 18.0;
        if x > MARGIN && x + entry > width - MARGIN {
            (x, y) = (MARGIN, y + LINE);
        }
        match mark {
            Mark::Line => {
                svg.line([x, y - 4.0], [x + 24.0, y - 4.0], color, 2.4);
                svg.dot([x + 12.0, y - 4.0], 3.8, color);
            }
            Mark::Area => svg.rect([x + 6.0, y - 10.0], [18.0, 11.0], color),
        }
        svg.text([x + 31.0, y], name, Anchor::Start, LABEL);
        x += entry;
    }
    y
}

/// The name of a metric's axis, and whether it is logarithmic.
fn down(metric: Metric) -> (String, bool) {
    let name = match metric.unit() {
        "" => metric.name().to_owned(),
        unit => format!("{}, {unit}", metric.name()),
    };
    (name, !metric.more_is_better())
}

/// A number of an axis: large ones with a suffix.
pub fn short(value: f64) -> String {
    let suffixes = [(1e9, "G"), (1e6, "M"), (1e3, "k")];
    let large =
        suffixes.iter().find(|(unit, _)| value.abs() >= 10.0 * unit || (*unit > 1e3 && value.abs() >= *unit));
    large.map_or_else(|| number(value), |(unit, suffix)| format!("{}{suffix}", number(value / unit)))
}

/// Lines of at most `width` letters, broken between words.
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                *line += &format!(" {word}");
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        svg::GRID,
        tradeoff::cell::{
            Outcome,
            tests::{cell, record},
        },
    };

    fn point(x: f64, y: f64) -> Point {
        Point { at: [x, y], text: String::new() }
    }

    #[test]
    fn the_front_has_what_nothing_beats() {
        let points = [
            point(1.0, 9.0),
            point(2.0, 9.5),
            point(3.0, 4.0),
            point(3.0, 5.0),
            point(7.0, 4.0),
            point(8.0, 1.0),
        ];
        let found = |more| front(points.iter(), more).iter().map(|point| point.at).collect::<Vec<_>>();
        assert_eq!(found(false), [[1.0, 9.0], [3.0, 4.0], [8.0, 1.0]]);
        assert_eq!(found(true), [[1.0, 9.0], [2.0, 9.5]]);
    }

    #[test]
    fn each_variation_is_a_line_and_the_front_has_rings() {
        let records = [
            ("epi", 5, 0.5, 2.0),
            ("epi", 9, 0.25, 4.0),
            ("render-cache", 5, 0.75, 1.0),
            ("render-cache", 9, 0.7, 5.0),
        ]
        .map(|(graph, samples, flip, ms)| record(cell(graph, samples, 1), flip, ms));
        let svg = over_cost("What?", &records, Metric::Flip, Cost::TotalMs).unwrap();
        // A line in the legend and one in the panel for each graph.
        assert_eq!(svg.matches("<polyline").count() - svg.matches(GRID).count(), 2 * 2 + 1);
        // The dearest point of the render cache is beaten.
        assert_eq!(svg.matches("stroke-width=\"1.6\"").count(), 3);
        assert!(over_frames("What?", &records, Metric::Flip).is_none(), "one frame is compared");
        assert!(over_cost("What?", &records, Metric::Ssim, Cost::TotalMs).is_none(), "it was not measured");
    }

    #[test]
    fn frames_over_decades_have_a_logarithmic_axis() {
        assert!(spans_decades(&[3, 31, 300]) && !spans_decades(&[3, 31, 299]));
        assert!(!spans_decades(&[0, 31, 300]), "frame 0 would not be there");
        assert!(!spans_decades(&[]));
    }

    #[test]
    fn each_metric_has_a_panel_and_the_references_error() {
        let records =
            [("epi", 5, 0.5), ("epi", 9, 0.25), ("render-cache", 5, 0.75)].map(|(graph, samples, flip)| {
                let mut record = record(cell(graph, samples, 1), flip, 1.0);
                if let Outcome::Measured(measured) = &mut record.result {
                    measured.errors.insert("psnr".into(), Some(30.0 - 10.0 * flip));
                    measured.errors.insert("reference_psnr".into(), Some(40.0));
                }
                record
            });
        let svg = over_paths("What?", "How.".into(), &records, &[Metric::Psnr, Metric::Flip]).unwrap();
        // In both panels, a line for each graph that has more than a point, one dot each, and two in the legend.
        assert_eq!(
            (svg.matches("<circle").count(), svg.matches(">cornell, orbit, 10x10<").count()),
            (2 * 3 + 2, 2)
        );
        assert_eq!(svg.matches(">the reference's own error<").count(), 1);
        assert!(svg.contains(">PSNR, dB<") && svg.contains(">FLIP, logarithmic<"), "{svg}");
        assert!(svg.contains(">paths per pixel and frame, logarithmic<"), "{svg}");
        assert!(!svg.contains("between halves"), "it was not measured");
    }

    #[test]
    fn many_variations_have_the_colours_of_their_graphs() {
        let with = |value: u32| {
            let params = vec![("cull.threshold".to_owned(), value.to_string())];
            record(Cell { params, ..cell("epi", 5, 1) }, 0.1, f64::from(value + 1))
        };
        let few: Vec<Record> = (0..8).map(with).collect();
        let many: Vec<Record> = (0..9).map(with).collect();
        let of = |records: &[Record]| {
            let naming = Naming::of(records);
            (naming.group(&records[1].cell), naming.label(&records[1].cell))
        };
        assert_eq!(of(&few), ("epi cull.threshold=1".into(), "threshold 1".into()));
        assert_eq!(of(&many), ("epi".into(), "threshold 1".into()));
        let budgets = [record(cell("epi", 5, 1), 0.1, 1.0), record(cell("epi", 9, 1), 0.1, 1.0)];
        assert_eq!(of(&budgets), ("epi".into(), "9".into()));
    }

    #[test]
    fn texts_are_broken_between_words_and_large_numbers_short() {
        assert_eq!(wrapped("one two  three", 7), ["one two", "three"]);
        assert_eq!([0.05, 2000.0, 20_000.0, 3e6, 2.5e10].map(short), ["0.05", "2000", "20k", "3M", "25G"]);
    }
}
