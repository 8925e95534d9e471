//! The tables as a picture: stacked bars for each scene beside the papers', and lines that show how the frame time
//! scales.

use epigraph_pictures::{
    grouped,
    svg::{Anchor, Font, Svg},
};

use super::{
    Row, SOFTWARE_WARNING, Split, Sweep,
    column::COLUMNS,
    papers,
    report::{Report, by_line, ms},
    times::Times,
};
use crate::{
    axis::{Axis, Log, number, round_step, span},
    svg::{GRID, HEADING, LABEL, QUIET, TITLE, grid},
};

/// Width of the picture, pixels.
const WIDTH: f64 = 1280.0;
/// Left and right margin.
const MARGIN: f64 = 36.0;

/// Colours of the columns: blues for points, oranges for edges, greens for the image; then the rest.
const COLORS: [&str; COLUMNS.len()] =
    ["#0b4f8a", "#2f7fbf", "#6baed6", "#a6cbe3", "#c8500a", "#f79646", "#8cc78a", "#2f8f4e"];
const REST: &str = "#c4c4c8";

/// Colours of the lines of cpu, gpu and hybrid, for each of the first graphs.
const LINES: [[&str; 3]; 3] =
    [["#2563a8", "#c0392b", "#7d5ba6"], ["#2f8f4e", "#d9822b", "#7d5ba6"], ["#0fa3a3", "#b5496b", "#7d5ba6"]];

/// A warning.
const LOUD: Font = Font { size: 12.5, color: "#b42318", bold: true };

/// Left and right ends of the bars in milliseconds, and of the bars in shares.
const BARS: [f64; 2] = [MARGIN + 128.0, 760.0];
const SHARES: [f64; 2] = [930.0, WIDTH - MARGIN];
const BAR: f64 = 17.0;
const ROW: f64 = 22.0;

/// The axis ends at this multiple of the longest bar that is not a software GPU's; longer bars are cut.
const ROOM_FOR_SOFTWARE: f64 = 1.15;

/// Draws the whole picture.
pub fn svg(report: &Report) -> String {
    let mut svg = Svg::default();
    let mut y = heading(&mut svg, report);
    y = bars(&mut svg, report, y);
    y = panels(&mut svg, report, y);
    svg.finish([WIDTH, y])
}

fn heading(svg: &mut Svg, report: &Report) -> f64 {
    let [width, height] = report.args.size.0;
    let title = format!("Time of a frame at {width}x{height}, camera {}", report.args.camera);
    svg.text([MARGIN, 46.0], &title, Anchor::Start, TITLE);
    svg.text([MARGIN, 68.0], &format!("here: {}", report.machine.text()), Anchor::Start, QUIET);
    svg.text([MARGIN, 85.0], &format!("papers: {}", papers::MACHINE), Anchor::Start, QUIET);
    let mut y = 85.0;
    if report.machine.software {
        y += 20.0;
        svg.text([MARGIN, y], SOFTWARE_WARNING, Anchor::Start, LOUD);
    }
    y += 20.0;
    let legend = COLUMNS.iter().map(|column| (column.name, column.doc)).zip(COLORS);
    for (index, ((name, doc), color)) in legend.chain([(("rest", "of the frame"), REST)]).enumerate() {
        let x = MARGIN + (index % 3) as f64 * 400.0;
        let y = y + (index / 3) as f64 * 19.0;
        svg.rect([x, y], [12.0, 12.0], color);
        svg.text([x + 18.0, y + 10.5], name, Anchor::Start, HEADING);
        svg.text([x + 56.0, y + 10.5], doc, Anchor::Start, LABEL);
    }
    y + 3.0 * 19.0 + 26.0
}

/// A bar: its name, its times, and whether we measured it.
struct Bar<'a> {
    name: String,
    times: &'a Times,
    ours: bool,
}

/// One scene's bars, ours first.
fn scene_bars<'a>(report: &Report, rows: &'a [Row]) -> Vec<Bar<'a>> {
    let ours = rows.iter().map(|row| Bar { name: report.label(row), times: &row.measured.times, ours: true });
    let paper = papers::of(&rows[0].scene).into_iter();
    let theirs = paper.flat_map(|paper| [("papers' GPU", &paper.gpu), ("papers' CPU", &paper.cpu)]);
    ours.chain(theirs.map(|(name, times)| Bar { name: name.into(), times, ours: false })).collect()
}

fn bars(svg: &mut Svg, report: &Report, top: f64) -> f64 {
    let longest = |software: bool| {
        let rows = report.results.rows.iter();
        let ours = rows.filter(|row| software || !(report.machine.software && row.backend != Split::Cpu));
        let theirs = report.scenes().filter_map(|rows| papers::of(&rows[0].scene));
        let theirs = theirs.flat_map(|paper| [paper.gpu.frame, paper.cpu.frame]);
        ours.map(|row| row.measured.times.frame).chain(theirs).fold(0.0, f64::max)
    };
    let plain = if longest(false) > 0.0 { longest(false) } else { longest(true) };
    let most = longest(true).min(plain * ROOM_FOR_SOFTWARE);
    if most <= 0.0 {
        return top;
    }
    let per_ms = (BARS[1] - BARS[0]) / most;

    svg.text([BARS[0], top], "milliseconds per frame", Anchor::Start, HEADING);
    svg.text([SHARES[0], top], "share of the frame", Anchor::Start, HEADING);
    let heights = report.scenes().map(|rows| 34.0 + scene_bars(report, rows).len() as f64 * ROW);
    let bottom = top + 26.0 + heights.sum::<f64>();
    let step = round_step(most / 6.0);
    let ticks = (0..).map(|tick| f64::from(tick) * step).take_while(|value| *value <= most);
    axis(svg, ticks.map(|value| (BARS[0] + value * per_ms, number(value))), [top + 26.0, bottom]);
    let quarters = [0.0, 0.25, 0.5, 0.75, 1.0];
    let at = |share: f64| (SHARES[0] + share * (SHARES[1] - SHARES[0]), format!("{:.0}%", share * 100.0));
    axis(svg, quarters.into_iter().map(at), [top + 26.0, bottom]);

    let mut y = top + 26.0;
    for rows in report.scenes() {
        let edges = format!("{}, {} edges", rows[0].scene, grouped(rows[0].measured.edges.into()));
        let paper = papers::of(&rows[0].scene);
        let theirs =
            paper.map(|paper| format!(" | papers: {}, {} edges", paper.theirs, grouped(paper.edges.into())));
        svg.text([MARGIN, y + 22.0], &(edges + &theirs.unwrap_or_default()), Anchor::Start, HEADING);
        y += 32.0;
        for bar in scene_bars(report, rows) {
            draw_bar(svg, &bar, y, per_ms);
            y += ROW;
        }
        y += 2.0;
    }
    bottom + 48.0
}

/// Vertical lines with their numbers above.
fn axis(svg: &mut Svg, ticks: impl Iterator<Item = (f64, String)>, [top, bottom]: [f64; 2]) {
    for (x, text) in ticks {
        svg.line([x, top], [x, bottom], GRID, 1.0);
        svg.text([x, top - 5.0], &text, Anchor::Middle, QUIET);
    }
}

fn draw_bar(svg: &mut Svg, bar: &Bar, y: f64, per_ms: f64) {
    let times = bar.times;
    svg.text([BARS[0] - 10.0, y + 13.0], &bar.name, Anchor::End, if bar.ours { LABEL } else { QUIET });
    let columns = times.columns.iter().map(|ms| ms.unwrap_or(0.0)).zip(COLORS);
    let parts: Vec<(f64, &str)> = columns.chain([(times.rest, REST)]).collect();
    let sum: f64 = parts.iter().map(|(ms, _)| ms).sum();
    let [mut x, mut share] = [BARS[0], SHARES[0]];
    for (ms, color) in parts.into_iter().filter(|(ms, _)| *ms > 0.0) {
        // Parts that overlap in time sum to more than the frame; the bar has the length of the frame.
        let part = ms * times.frame / sum;
        let end = (x + part * per_ms).min(BARS[1]);
        svg.rect([x, y], [end - x, BAR], color);
        x = end;
        let width = ms / sum * (SHARES[1] - SHARES[0]);
        svg.rect([share, y], [width, BAR], color);
        share += width;
    }
    if times.frame * per_ms > BARS[1] - BARS[0] + 0.5 {
        cut(svg, [BARS[1] - 14.0, y]);
    }
    let text = format!("{} ms, {:.1} fps", ms(times.frame), times.fps());
    svg.text([x + 8.0, y + 13.0], &text, Anchor::Start, if bar.ours { LABEL } else { QUIET });
}

/// Marks a bar that is longer than drawn.
fn cut(svg: &mut Svg, [x, y]: [f64; 2]) {
    for shift in [0.0, 6.0] {
        let x = x + shift;
        svg.polygon([[x, y + BAR], [x + 5.0, y], [x + 8.0, y], [x + 3.0, y + BAR]].as_slice(), "white");
    }
}

/// Draws the sweeps side by side.
fn panels(svg: &mut Svg, report: &Report, top: f64) -> f64 {
    let sweeps = [
        (Sweep::Pixels, "pixels"),
        (Sweep::Points, "points of the cloud"),
        (Sweep::Edges, "edges of the scene"),
    ];
    let panels: Vec<_> = sweeps
        .into_iter()
        .map(|(sweep, name)| (sweep, name, report.sweep(sweep)))
        .filter(|(.., rows)| span(rows.iter().map(|(x, _)| *x)).is_some_and(|[low, high]| high > low))
        .collect();
    if panels.is_empty() {
        return top;
    }
    svg.text([MARGIN, top], "How frame time scales (ms, both axes logarithmic)", Anchor::Start, HEADING);
    let mut lines: Vec<&Row> = Vec::new();
    for (.., rows) in &panels {
        for row in by_line(rows).map(|rows| rows[0].1) {
            if lines.iter().all(|known| report.label(known) != report.label(row)) {
                lines.push(row);
            }
        }
    }
    let mut x = 460.0;
    for row in lines {
        let label = report.label(row);
        svg.line([x, top - 4.5], [x + 22.0, top - 4.5], color(row), 2.5);
        svg.text([x + 29.0, top], &label, Anchor::Start, LABEL);
        // Letters of this font are about half as wide as high.
        x += 150f64.max(50.0 + 0.55 * LABEL.size * label.len() as f64);
    }
    let [width, height, gap] = [350.0, 250.0, 54.0];
    for (index, (sweep, name, rows)) in panels.iter().enumerate() {
        let x = MARGIN + 34.0 + index as f64 * (width + gap);
        let what = if *sweep == Sweep::Edges { String::new() } else { format!(", {}", rows[0].1.scene) };
        let title = format!("{name}{what}");
        panel(svg, rows, &title, [x, top + 22.0], [width, height]);
    }
    top + 22.0 + height + 56.0
}

/// The colour of a row's line.
fn color(row: &Row) -> &'static str {
    let nth = row.variant.as_ref().map_or(0, |(nth, _)| *nth);
    LINES[nth % LINES.len()][row.backend as usize]
}

fn panel(svg: &mut Svg, rows: &[(f64, &Row)], title: &str, [left, top]: [f64; 2], [width, height]: [f64; 2]) {
    let frames = || rows.iter().map(|(_, row)| row.measured.times.frame);
    let (Some(xs), Some(ys)) = (span(rows.iter().map(|(x, _)| *x)), span(frames())) else { return };
    let across = Axis::Log(Log::new(xs, [left, left + width]));
    let down = Axis::Log(Log::new(ys, [top + height, top]));
    grid(svg, [&across, &down], [left, top], [width, height], [short, number]);
    svg.text([left + width / 2.0, top + height + 34.0], title, Anchor::Middle, LABEL);
    for rows in by_line(rows) {
        let color = color(rows[0].1);
        let points: Vec<[f64; 2]> =
            rows.iter().map(|(x, row)| [across.at(*x), down.at(row.measured.times.frame)]).collect();
        svg.polyline(&points, color, 2.0);
        for point in &points {
            svg.dot(*point, 3.5, color);
        }
    }
}

/// A count in short form: 1.3M.
fn short(value: f64) -> String {
    match value {
        value if value >= 1e6 => format!("{}M", number(value / 1e6)),
        value if value >= 1e3 => format!("{}k", number(value / 1e3)),
        value => number(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_show_round_numbers() {
        assert_eq!([0.7, 1.0, 13.0, 420.0].map(round_step), [1.0, 1.0, 20.0, 500.0]);
        assert_eq!([500.0, 20_000.0, 1_300_000.0].map(short), ["500", "20k", "1.3M"]);
    }
}
