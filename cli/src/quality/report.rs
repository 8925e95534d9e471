//! The report: a table in Markdown, and JSON.

use epigraph::Change;
use epigraph_core::{Gpu, Side};
use serde_json::{Value, json};

use super::{Figures, FrameFigures, Row, distinct};
use crate::{args::QualityArgs, edge_mask};

/// The report of a quality run.
pub struct Report<'a> {
    /// The command line.
    pub args: &'a QualityArgs,
    /// The default side of nodes.
    pub side: Side,
    /// The GPU, if that is the side.
    pub gpu: Option<&'a Gpu>,
    /// The figures, in the order of measurement.
    pub rows: &'a [Row],
}

impl Report<'_> {
    /// The settings of the comparison in one line.
    pub fn setting(&self) -> String {
        let QualityArgs { size, spp, seed, .. } = self.args;
        let [width, height] = size.0;
        let changes = self.args.changes.all().map(|change| format!(", {}", change.piece()));
        format!(
            "{width}x{height}, references of {spp} samples a pixel, seed {seed}, {}{}",
            self.side,
            changes.collect::<String>()
        )
    }

    /// The compared frames of each camera: `39 (still); 19, 24, 29 (orbit)`.
    pub fn frames(&self) -> String {
        let one = |row: &Row| {
            let frames: Vec<String> = row.frames.iter().map(|frame| frame.frame.to_string()).collect();
            format!("{} ({})", frames.join(", "), row.camera)
        };
        distinct(self.rows.iter().map(one)).join("; ")
    }

    /// The rows grouped by scene and camera.
    pub fn groups(&self) -> impl Iterator<Item = &[Row]> {
        self.rows.chunk_by(|a, b| (&a.scene, &a.camera) == (&b.scene, &b.camera))
    }

    /// The table and the verdicts.
    pub fn text(&self) -> String {
        let samples = distinct(self.rows.iter().map(|row| row.samples.to_string()));
        let mut table = vec![[vec![String::new()], samples].concat()];
        for line in self.groups().flat_map(by_graph) {
            let name = format!("{}, {}, {}", line[0].scene, line[0].camera, line[0].graph);
            table.push(std::iter::once(name).chain(line.iter().map(cell)).collect());
        }
        format!(
            "PSNR in dB / within {0} pixels of reference edges, mean FLIP / within {0} pixels of reference edges\n{1}\n\
             frames {2}\n\n{3}\n{4}",
            edge_mask::REACH,
            self.setting(),
            self.frames(),
            markdown(&table),
            self.verdicts()
        )
    }

    /// For each graph but the first, the number of cases in which its FLIP is lower than the first one's.
    fn verdicts(&self) -> String {
        let graphs = distinct(self.rows.iter().map(|row| row.graph.as_str()));
        let of = |graph| self.rows.iter().filter(move |row| row.graph == graph);
        let mut text = String::new();
        for other in graphs.iter().skip(1) {
            let pairs: Vec<(&Row, &Row)> = of(graphs[0]).zip(of(other)).collect();
            let what = format!("{other} against {}: FLIP", graphs[0]);
            text += &verdict(&what, &pairs, |row| Some(row.whole()));
            text += &verdict(&format!("{what} near edges"), &pairs, Row::edges);
        }
        text
    }

    /// The figures for programs; see the help of the command.
    pub fn json(&self) -> Value {
        let args = self.args;
        let set: Vec<String> = args.changes.all().map(Change::piece).collect();
        json!({
            "size": args.size.0,
            "seed": args.seed,
            "backend": self.side.to_string(),
            "adapter": self.gpu.map(Gpu::name),
            "spp": args.spp,
            "mode": format!("{:?}", args.mode).to_lowercase(),
            "set": set,
            "edge_reach": edge_mask::REACH,
            "rows": self.rows.iter().map(of_row).collect::<Vec<_>>(),
        })
    }
}

/// The rows grouped by graph: each group has one row for each number of samples.
pub fn by_graph(rows: &[Row]) -> impl Iterator<Item = &[Row]> {
    rows.chunk_by(|a, b| a.graph == b.graph)
}

/// The number of pairs in which the second row is better, the mean change, and the pairs in which it is not better.
fn verdict(what: &str, pairs: &[(&Row, &Row)], pick: fn(&Row) -> Option<Figures>) -> String {
    let flips: Vec<(&Row, f64, f64)> = pairs
        .iter()
        .filter_map(|(first, other)| Some((*other, pick(first)?.flip, pick(other)?.flip)))
        .collect();
    let (mut worse, mut logs) = (Vec::new(), 0.0);
    for &(row, first, other) in &flips {
        if other >= first {
            worse.push(format!("{}, {}, {}", row.scene, row.camera, row.samples));
        }
        logs += (other.max(1e-9) / first.max(1e-9)).ln();
    }
    if flips.is_empty() {
        return String::new();
    }
    let change = 100.0 * ((logs / flips.len() as f64).exp() - 1.0);
    let lower = flips.len() - worse.len();
    let mut text =
        format!("{what} lower in {lower} of {} cases, {change:+.0}% (geometric mean)", flips.len());
    if !worse.is_empty() {
        text += &format!("; not lower: {}", worse.join("; "));
    }
    text + "\n"
}

/// `29.3 / 20.4, .0261 / .1030`.
fn cell(row: &Row) -> String {
    let (whole, edges) = (row.whole(), row.edges());
    let near = |pick: fn(Figures) -> String| edges.map_or("-".into(), pick);
    format!(
        "{:.1} / {}, {} / {}",
        whole.psnr,
        near(|figures| format!("{:.1}", figures.psnr)),
        flip(whole.flip),
        near(|figures| flip(figures.flip))
    )
}

/// Four decimals without a leading zero.
fn flip(value: f64) -> String {
    format!("{value:.4}").trim_start_matches('0').to_owned()
}

/// A Markdown table whose columns are aligned as plain text too. The first row has the headings.
fn markdown(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width =
        |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0).max(3)).collect();
    let mut text = String::new();
    for (index, row) in rows.iter().enumerate() {
        let cells = row.iter().zip(&widths).map(|(cell, &width)| format!("| {cell:<width$} "));
        text += &(cells.collect::<String>() + "|\n");
        if index == 0 {
            let rule = widths.iter().map(|width| format!("|{}", "-".repeat(width + 2)));
            text += &(rule.collect::<String>() + "|\n");
        }
    }
    text
}

fn of_row(row: &Row) -> Value {
    let frame = |frame: &FrameFigures| {
        let mut value = of_figures(frame.whole);
        value["frame"] = json!(frame.frame);
        value["edges"] = json!(frame.edges.map(of_figures));
        value
    };
    let mut value = of_figures(row.whole());
    value["graph"] = json!(row.graph);
    value["scene"] = json!(row.scene);
    value["camera"] = json!(row.camera);
    value["samples"] = json!(row.samples.to_string());
    value["samples_per_frame"] = json!(row.count);
    value["edges"] = json!(row.edges().map(of_figures));
    if let Some(edges) = value["edges"].as_object_mut() {
        edges.insert("share".into(), json!(row.edge_share));
    }
    value["frames"] = row.frames.iter().map(frame).collect();
    value
}

/// JSON has no infinity: the PSNR of equal pictures becomes null.
fn of_figures(figures: Figures) -> Value {
    json!({ "psnr": figures.psnr, "flip": figures.flip })
}

#[cfg(test)]
mod tests {
    use super::*;
    use epigraph::Samples;

    fn row(graph: &str, share: f64, whole: [f64; 2], edges: Option<[f64; 2]>) -> Row {
        let figures = |[psnr, flip]: [f64; 2]| Figures { psnr, flip };
        Row {
            graph: graph.into(),
            scene: "cornell".into(),
            camera: "still".into(),
            samples: Samples::Share(share),
            count: 1,
            edge_share: 0.25,
            frames: vec![FrameFigures { frame: 39, whole: figures(whole), edges: edges.map(figures) }],
        }
    }

    #[test]
    fn cells_hold_all_four_figures() {
        assert_eq!(cell(&row("a", 0.01, [29.34, 0.0261], Some([20.0, 0.103]))), "29.3 / 20.0, .0261 / .1030");
        assert_eq!(cell(&row("a", 0.01, [f64::INFINITY, 0.0], None)), "inf / -, .0000 / -");
        assert_eq!(flip(1.0), "1.0000");
    }

    #[test]
    fn the_table_is_markdown() {
        let rows = [["", "1%"], ["cornell", "29.3"]].map(|row| row.map(String::from).to_vec());
        assert_eq!(markdown(&rows), "|         | 1%   |\n|---------|------|\n| cornell | 29.3 |\n");
    }

    #[test]
    fn the_verdict_names_the_cases_that_are_not_better() {
        let first = [row("a", 0.01, [30.0, 0.04], None), row("a", 0.02, [30.0, 0.02], None)];
        let other = [row("b", 0.01, [30.0, 0.01], None), row("b", 0.02, [30.0, 0.02], None)];
        let pairs: Vec<_> = first.iter().zip(&other).collect();
        // The geometric mean of 1/4 and 1 is 1/2.
        assert_eq!(
            verdict("FLIP", &pairs, |row| Some(row.whole())),
            "FLIP lower in 1 of 2 cases, -50% (geometric mean); not lower: cornell, still, 2%\n"
        );
        assert_eq!(verdict("FLIP", &pairs, Row::edges), "");
    }

    #[test]
    fn missing_figures_are_null() {
        let value = of_row(&row("a", 0.01, [f64::INFINITY, 0.0], None));
        assert!(value["psnr"].is_null() && value["edges"].is_null());
        let value = of_row(&row("a", 0.07, [30.0, 0.5], Some([20.0, 0.75])));
        assert_eq!(value["edges"], json!({ "share": 0.25, "psnr": 20.0, "flip": 0.75 }));
        assert_eq!((&value["samples"], &value["frames"][0]["frame"]), (&json!("7%"), &json!(39)));
    }
}
