//! Plots FLIP over samples per frame: a panel for each scene and camera, a line for each graph.

use epigraph_pictures::svg::{Anchor, Svg};

use super::{
    Figures, Row, distinct,
    report::{Report, by_graph},
};
use crate::{
    axis::{Axis, Log, number, span},
    edge_mask,
    svg::{HEADING, LABEL, QUIET, TITLE, grid, line_color},
};

/// Left and right margin, pixels.
const MARGIN: f64 = 36.0;
/// Size of a panel's axes, and distance from one panel to the next.
const PANEL: [f64; 2] = [300.0, 210.0];
const STEP: [f64; 2] = [376.0, 292.0];
/// Width of the numbers of the vertical axis.
const NUMBERS: f64 = 40.0;
/// Where the first row of panels begins.
const TOP: f64 = 168.0;
/// Least number of panel columns, so that the title fits.
const LEAST_COLUMNS: usize = 2;

/// A kind of line: its width, the radius of its dots, and the figures that it shows.
type Kind = (f64, f64, fn(&Row) -> Option<Figures>);
const WHOLE: Kind = (2.4, 3.8, |row| Some(row.whole()));
const EDGES: Kind = (1.1, 2.4, Row::edges);

/// Draws all panels: scenes from left to right and cameras from top to bottom, or for a single scene, its cameras from
/// left to right.
pub fn svg(report: &Report) -> String {
    let mut svg = Svg::default();
    let names = |name: fn(&Row) -> &str| distinct(report.rows.iter().map(name));
    let [graphs, scenes, cameras] =
        [names(|row| &row.graph), names(|row| &row.scene), names(|row| &row.camera)];
    heading(&mut svg, report, &graphs);
    let flips = |row: &Row| [WHOLE, EDGES].map(|(.., pick)| pick(row).map(|figures| figures.flip));
    // All panels share one scale, so that they can be compared. A logarithmic scale cannot show zero.
    let xs = span(report.rows.iter().map(|row| percent(report, row)));
    let ys = span(report.rows.iter().flat_map(flips).flatten().filter(|flip| *flip > 0.0));
    let [columns, rows] = if scenes.len() > 1 { [&scenes, &cameras] } else { [&cameras, &scenes] };
    if let (Some(xs), Some(ys)) = (xs, ys) {
        for group in report.groups() {
            let place = |names: &[&str]| {
                let of_group =
                    |name: &&str| [&group[0].scene, &group[0].camera].iter().any(|own| own == name);
                names.iter().position(of_group).unwrap_or(0) as f64
            };
            let left = MARGIN + NUMBERS + STEP[0] * place(columns);
            let top = TOP + STEP[1] * place(rows);
            let across = Axis::Log(Log::new(xs, [left, left + PANEL[0]]));
            let down = Axis::Log(Log::new(ys, [top + PANEL[1], top]));
            axes(&mut svg, &across, &down, [left, top]);
            let title = format!("{}, {}", group[0].scene, group[0].camera);
            svg.text([left, top - 9.0], &title, Anchor::Start, HEADING);
            for line in by_graph(group) {
                let at = |row: &Row, flip: f64| [across.at(percent(report, row)), down.at(flip)];
                draw(&mut svg, line, at, line_color(&graphs, &line[0].graph));
            }
        }
    }
    let width = 2.0 * MARGIN + STEP[0] * columns.len().max(LEAST_COLUMNS) as f64;
    svg.finish([width, TOP + STEP[1] * rows.len() as f64])
}

/// Samples per frame in per cent of the pixels.
fn percent(report: &Report, row: &Row) -> f64 {
    let [width, height] = report.args.size.0.map(f64::from);
    100.0 * f64::from(row.count) / (width * height)
}

/// Draws both lines of a graph.
fn draw(svg: &mut Svg, rows: &[Row], at: impl Fn(&Row, f64) -> [f64; 2], color: &str) {
    for (width, radius, pick) in [EDGES, WHOLE] {
        let flips = rows.iter().filter_map(|row| Some((row, pick(row)?.flip)));
        let mut points: Vec<[f64; 2]> =
            flips.filter(|(_, flip)| *flip > 0.0).map(|(row, flip)| at(row, flip)).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        svg.polyline(&points, color, width);
        points.into_iter().for_each(|point| svg.dot(point, radius, color));
    }
}

fn heading(svg: &mut Svg, report: &Report, graphs: &[&str]) {
    svg.text([MARGIN, 44.0], "Difference from a converged picture", Anchor::Start, TITLE);
    svg.text([MARGIN, 66.0], &report.setting(), Anchor::Start, QUIET);
    let frames = format!("mean FLIP (0: none) of frames {}; both axes logarithmic", report.frames());
    svg.text([MARGIN, 83.0], &frames, Anchor::Start, QUIET);
    let mut x = MARGIN;
    let mut entry = |text: &str, color: &str, width: f64, radius: f64| {
        svg.line([x, 107.0], [x + 24.0, 107.0], color, width);
        svg.dot([x + 12.0, 107.0], radius, color);
        svg.text([x + 31.0, 111.5], text, Anchor::Start, LABEL);
        // A letter of the label's font is about 7 pixels wide.
        x += 31.0 + 7.0 * text.chars().count() as f64 + 18.0;
    };
    for graph in graphs {
        entry(graph, line_color(graphs, graph), WHOLE.0, WHOLE.1);
    }
    let near = format!("thin: within {} pixels of reference edges", edge_mask::REACH);
    entry(&near, QUIET.color, EDGES.0, EDGES.1);
}

fn axes(svg: &mut Svg, across: &Axis, down: &Axis, [left, top]: [f64; 2]) {
    let [width, height] = PANEL;
    grid(svg, [across, down], [left, top], PANEL, [|value| format!("{}%", number(value)), number]);
    let middle = left + width / 2.0;
    svg.text([middle, top + height + 33.0], "samples per frame, in % of the pixels", Anchor::Middle, LABEL);
}
