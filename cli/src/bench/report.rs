//! The benchmark's figures as text tables.

use epigraph_pictures::grouped;

use super::{
    Results, Row, SOFTWARE_WARNING, Split, Sweep,
    column::{self, COLUMNS},
    measure::Measured,
    papers::{self, Paper},
    times::{Times, growth},
};
use crate::{args::BenchArgs, machine::Machine, table::Table};

/// The report of a benchmark run.
pub struct Report<'a> {
    /// The command line.
    pub args: &'a BenchArgs,
    /// The machine that ran it.
    pub machine: &'a Machine,
    /// The requested sweeps.
    pub sweeps: &'a [Sweep],
    /// The measured rows.
    pub results: &'a Results,
}

impl Report<'_> {
    /// The rows of a sweep, each with the quantity that the sweep varies, by backend and graph and in ascending order
    /// of the quantity.
    pub fn sweep(&self, sweep: Sweep) -> Vec<(f64, &Row)> {
        let results = self.results;
        let rows = match sweep {
            _ if !self.sweeps.contains(&sweep) => return Vec::new(),
            Sweep::Pixels => &results.pixels,
            Sweep::Points => &results.points,
            Sweep::Edges => &results.rows,
            Sweep::None => return Vec::new(),
        };
        let quantity = |row: &Row| match sweep {
            Sweep::Points => row.measured.points as f64,
            Sweep::Edges => f64::from(row.measured.edges),
            Sweep::Pixels | Sweep::None => pixels(row.measured.size),
        };
        let mut rows: Vec<(f64, &Row)> = rows.iter().map(|row| (quantity(row), row)).collect();
        let line = |row: &Row| (row.backend as u8, row.variant.as_ref().map(|(nth, _)| *nth));
        rows.sort_by(|a, b| line(a.1).cmp(&line(b.1)).then(a.0.total_cmp(&b.0)));
        rows
    }

    /// The measured rows, scene by scene.
    pub fn scenes(&self) -> impl Iterator<Item = &[Row]> {
        self.results.rows.chunk_by(|a, b| a.scene == b.scene)
    }

    /// The name of a row's backend in tables and plots, with the graph if there are several.
    pub fn label(&self, row: &Row) -> String {
        let Row { backend, variant, .. } = row;
        let software = if self.machine.software && *backend != Split::Cpu { " (software)" } else { "" };
        let variant = variant.as_ref().map_or(String::new(), |(_, name)| format!(" {name}"));
        format!("{backend}{variant}{software}")
    }

    /// A remark on a row whose warm-up was cut short because it took too long. With --quick the heading says so.
    fn not_full(&self, row: &Row) -> &'static str {
        if row.measured.filled || self.args.quick { "" } else { ", cloud not full" }
    }

    /// The report as text.
    pub fn text(&self) -> String {
        let mut text = self.heading();
        for rows in self.scenes() {
            text += &self.scene_text(rows);
        }
        for sweep in [Sweep::Pixels, Sweep::Points, Sweep::Edges] {
            text += &self.sweep_text(sweep);
        }
        if !self.results.skipped.is_empty() {
            text += "\nskipped\n";
        }
        for skipped in &self.results.skipped {
            text += &format!("  {}: {}\n", skipped.what, skipped.why);
        }
        text
    }

    fn heading(&self) -> String {
        let mut text = String::new();
        let mut line = |name: &str, value: String| text += &format!("{name:<9}{value}\n");
        line("machine", self.machine.text());
        if self.machine.software {
            line("WARNING", SOFTWARE_WARNING.into());
        }
        line("papers", format!("{}, about {} points", papers::MACHINE, grouped(papers::POINTS)));
        line("", papers::SOURCE.into());
        let warm_up = if self.args.quick {
            "short because of --quick: the point cloud is not full"
        } else {
            "long enough to fill the point cloud, unless noted otherwise"
        };
        line("warm-up", format!("{warm_up}; its frames are not counted"));
        line("times", "medians in ms over the counted frames; medians of parts need not add up".into());
        for column in &COLUMNS {
            line(column.name, column.doc.into());
        }
        line("rest", "tone mapping, transfers, commands and waiting".into());
        line("GPU", "all work on the GPU".into());
        line("frame", "wall-clock time without tracing samples".into());
        line("p95", "95th percentile of the frame time".into());
        line(
            "vs",
            "speed-up: the papers' frame time divided by ours; GPU is their hybrid, CPU the original".into(),
        );
        text
    }

    fn scene_text(&self, rows: &[Row]) -> String {
        let Some(first) = rows.first() else { return String::new() };
        let measured = &first.measured;
        let [width, height] = measured.size;
        let mut text = format!(
            "\n{}: {} edges, {} points, {width}x{height}, camera {}, {} samples per frame\n",
            first.scene,
            grouped(measured.edges.into()),
            grouped(measured.points),
            self.args.camera,
            grouped(measured.samples.into()),
        );
        let mut table = table("row", "vs GPU", "vs CPU");
        let paper = papers::of(&first.scene);
        for row in rows {
            let ratio = |theirs| ratio(theirs, row).map_or(NONE.into(), |ratio| format!("{ratio:.2}x"));
            let cells = cells(&row.measured.times, Some(row.measured.p95));
            add(&mut table, self.label(row), cells, [ratio(|p| &p.gpu), ratio(|p| &p.cpu)]);
        }
        if let Some(paper) = paper {
            for (name, times) in [("papers' GPU", &paper.gpu), ("papers' CPU", &paper.cpu)] {
                add(&mut table, name.into(), cells(times, None), [NONE.into(), NONE.into()]);
            }
        }
        text += &table.to_string();
        for row in rows {
            let Measured { warm_up, frames, trace, .. } = &row.measured;
            let counted = format!("{frames} frames counted after {warm_up}{}", self.not_full(row));
            text += &format!(
                "{}: graph {}, {counted}, tracing {} ms in addition to the frame\n",
                self.label(row),
                row.graph,
                ms(*trace)
            );
        }
        if let Some(paper) = paper {
            let [width, height] = papers::SIZE;
            let edges = grouped(paper.edges.into());
            text += &format!("papers: {}, {edges} edges, {width}x{height}\n", paper.theirs);
        }
        text
    }

    fn sweep_text(&self, sweep: Sweep) -> String {
        let rows = self.sweep(sweep);
        // A single row shows no growth.
        if rows.len() < 2 || by_line(&rows).all(|rows| rows.len() < 2) {
            return String::new();
        }
        // Only E1 and E2 depend on the number of edges; the whole frame depends on pixels and points.
        let cost = |row: &Row| {
            let times = &row.measured.times;
            match sweep {
                Sweep::Edges => times.columns[column::EDGES].iter().flatten().copied().reduce(|a, b| a + b),
                _ => Some(times.frame),
            }
        };
        let one = sweep.to_string();
        let mut table = table("", &format!("ns/{}", one.trim_end_matches('s')), "trace");
        for (quantity, row) in &rows {
            let what = match sweep {
                Sweep::Pixels => format!("{0}x{0}", row.measured.size[0]),
                Sweep::Edges => format!("{} {one} ({})", grouped(*quantity as u64), row.scene),
                Sweep::Points | Sweep::None => format!("{} {one}", grouped(*quantity as u64)),
            };
            let name = format!("{}, {what}{}", self.label(row), self.not_full(row));
            let each = cost(row).map_or(NONE.into(), |cost| format!("{:.1}", cost * 1e6 / quantity.max(1.0)));
            let cells = cells(&row.measured.times, Some(row.measured.p95));
            add(&mut table, name, cells, [each, ms(row.measured.trace)]);
        }
        let scene = if sweep == Sweep::Edges { String::new() } else { format!(" of {}", rows[0].1.scene) };
        let mut text = format!("\nframe time{scene} by {sweep}\n{table}");
        let name = if sweep == Sweep::Edges { "E1 + E2" } else { "frame" };
        for rows in by_line(&rows) {
            let points: Vec<(f64, f64)> = rows.iter().filter_map(|(x, row)| Some((*x, cost(row)?))).collect();
            if let Some(power) = growth(&points) {
                // Adding zero turns -0.00 into 0.00.
                let power = (power * 100.0).round() / 100.0 + 0.0;
                text += &format!("{}: {name} ~ {sweep}^{power:.2}\n", self.label(rows[0].1));
            }
        }
        text
    }
}

/// The papers' frame time divided by ours, or `None` if the papers lack the scene or the image sizes differ.
pub fn ratio(theirs: fn(&Paper) -> &Times, ours: &Row) -> Option<f64> {
    let paper = papers::of(&ours.scene).filter(|_| ours.measured.size == papers::SIZE)?;
    Some(theirs(paper).frame / ours.measured.times.frame.max(1e-6))
}

/// The rows grouped by backend and graph.
pub fn by_line<'a>(rows: &'a [(f64, &'a Row)]) -> impl Iterator<Item = &'a [(f64, &'a Row)]> {
    rows.chunk_by(|a, b| (a.1.backend, &a.1.variant) == (b.1.backend, &b.1.variant))
}

/// The cell of a missing figure.
const NONE: &str = "-";

/// A table with the headings name, columns, rest, GPU, frame, p95, fps, and two more.
fn table(name: &str, first: &str, second: &str) -> Table {
    let mut headings = vec![name.to_owned()];
    headings.extend(COLUMNS.iter().map(|column| format!(">{}", column.name)));
    headings.extend([">rest", ">GPU", ">frame", ">p95", ">fps"].map(String::from));
    headings.extend([first, second].map(|heading| format!(">{heading}")));
    Table::new(&headings.iter().map(String::as_str).collect::<Vec<_>>())
}

fn add(table: &mut Table, name: String, cells: [String; COLUMNS.len() + 5], last: [String; 2]) {
    let mut row: [String; COLUMNS.len() + 8] = std::array::from_fn(|_| String::new());
    for (cell, text) in row.iter_mut().zip([name].into_iter().chain(cells).chain(last)) {
        *cell = text;
    }
    table.row(row);
}

fn cells(times: &Times, p95: Option<f64>) -> [String; COLUMNS.len() + 5] {
    let some = |value: Option<f64>| value.map_or(NONE.into(), ms);
    let [p1, p2, p3, p4, e1, e2, i1, i2] = times.columns.map(some);
    let fps = format!("{:.1}", times.fps());
    [p1, p2, p3, p4, e1, e2, i1, i2, ms(times.rest), some(times.gpu), ms(times.frame), some(p95), fps]
}

/// Milliseconds, with about three significant digits.
pub fn ms(value: f64) -> String {
    match value {
        value if value < 1.0 => format!("{value:.3}"),
        value if value < 100.0 => format!("{value:.2}"),
        value => format!("{value:.1}"),
    }
}

fn pixels(size: [u32; 2]) -> f64 {
    f64::from(size[0]) * f64::from(size[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!([0.1234, 5.678, 134.73].map(ms), ["0.123", "5.68", "134.7"]);
    }
}
