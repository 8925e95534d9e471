//! What is told: a table that is also Markdown, and JSON.

use epigraph_core::{Gpu, Side};
use serde_json::{Value, json};

use super::{Figures, Row};
use crate::{args::QualityArgs, edge_mask};

/// Everything there is to tell.
pub struct Report<'a> {
    /// The command line.
    pub args: &'a QualityArgs,
    /// Where nodes ran that do not say.
    pub side: Side,
    /// The GPU, if that is the side.
    pub gpu: Option<&'a Gpu>,
    /// In the order in which they were measured.
    pub rows: &'a [Row],
}

impl Report<'_> {
    /// What was compared with what, in a line or two.
    pub fn setting(&self) -> String {
        let QualityArgs { size, spp, seed, .. } = self.args;
        let [width, height] = size.0;
        let set: Vec<String> = self
            .args
            .set
            .iter()
            .map(|setting| format!(", {}.{} {}", setting.node, setting.param, setting.value))
            .collect();
        format!(
            "{width}x{height}, references of {spp} samples a pixel, seed {seed}, {}{}",
            self.side,
            set.concat()
        )
    }

    /// Which frames each camera's figures are of: `still: 39; orbit: 19, 24, 29`.
    pub fn frames(&self) -> String {
        let mut cameras: Vec<&Row> = Vec::new();
        for row in self.rows {
            if cameras.iter().all(|known| known.camera != row.camera) {
                cameras.push(row);
            }
        }
        let one = |row: &&Row| {
            let frames: Vec<String> = row.frames.iter().map(|frame| frame.frame.to_string()).collect();
            format!("{}: {}", row.camera, frames.join(", "))
        };
        cameras.iter().map(one).collect::<Vec<_>>().join("; ")
    }

    /// Neighbouring rows of one scene and camera.
    pub fn groups(&self) -> impl Iterator<Item = &[Row]> {
        self.rows.chunk_by(|a, b| (&a.scene, &a.camera) == (&b.scene, &b.camera))
    }

    /// The table and what it comes to.
    pub fn text(&self) -> String {
        let mut table = vec![
            std::iter::once(String::new())
                .chain(self.args.samples.iter().map(ToString::to_string))
                .collect::<Vec<_>>(),
        ];
        for row in self.lines() {
            let [first, ..] = row else { continue };
            let name = format!("{}, {}, {}", first.scene, first.camera, first.graph);
            table.push(std::iter::once(name).chain(row.iter().map(cell)).collect());
        }
        format!(
            "PSNR / within {} pixels of reference edges (dB), mean FLIP / within {0} pixels of reference edges\n{}\n\
             frames {}\n\n{}\n{}",
            edge_mask::REACH,
            self.setting(),
            self.frames(),
            markdown(&table),
            self.verdicts()
        )
    }

    /// A graph's rows of one scene and camera: one for each number of samples.
    pub fn lines(&self) -> impl Iterator<Item = &[Row]> {
        self.rows.chunks(self.args.samples.len().max(1))
    }

    /// For each graph but the first, in how many cases its FLIP is lower than the first one's.
    fn verdicts(&self) -> String {
        let length = self.args.samples.len().max(1);
        let mut text = String::new();
        let Some(group) = self.groups().next() else { return text };
        let graphs = group.len() / length;
        // Groups of equal scenes and cameras named twice in a row would run together.
        let groups = || self.rows.chunks(length * graphs);
        for nth in 1..graphs {
            let pairs: Vec<(&Row, &Row)> = groups()
                .flat_map(|group| group[..length].iter().zip(&group[nth * length..(nth + 1) * length]))
                .collect();
            let [first, other] = [&group[0].graph, &group[nth * length].graph];
            for (what, pick) in [
                ("FLIP", (|row| Some(row.whole())) as fn(&Row) -> Option<Figures>),
                ("FLIP near edges", Row::edges),
            ] {
                text += &verdict(&format!("{other} against {first}: {what}"), &pairs, pick);
            }
        }
        text
    }

    /// The figures for programs; see the help of the command.
    pub fn json(&self) -> Value {
        let args = self.args;
        let set: Vec<String> = args
            .set
            .iter()
            .map(|setting| format!("{}.{}={}", setting.node, setting.param, setting.value))
            .collect();
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

/// In how many pairs the second row is the better one, by how much, and where it is not.
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

/// Four decimals without the zero before the point.
fn flip(value: f64) -> String {
    format!("{value:.4}").trim_start_matches('0').to_owned()
}

/// A Markdown table whose columns are aligned in plain text too; the first row has the headings.
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
    let frame = |frame: &super::FrameFigures| {
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

/// JSON has no infinity: equal pictures have no PSNR.
fn of_figures(figures: Figures) -> Value {
    json!({ "psnr": figures.psnr, "flip": figures.flip })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{quality::FrameFigures, values::Samples};

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
    fn the_verdict_names_what_is_not_better() {
        let first = [row("a", 0.01, [30.0, 0.04], None), row("a", 0.02, [30.0, 0.02], None)];
        let other = [row("b", 0.01, [30.0, 0.01], None), row("b", 0.02, [30.0, 0.02], None)];
        let pairs: Vec<_> = first.iter().zip(&other).collect();
        // A quarter and the same: half, as a geometric mean.
        assert_eq!(
            verdict("FLIP", &pairs, |row| Some(row.whole())),
            "FLIP lower in 1 of 2 cases, -50% (geometric mean); not lower: cornell, still, 2%\n"
        );
        assert_eq!(verdict("FLIP", &pairs, Row::edges), "");
    }

    #[test]
    fn what_is_no_number_is_null() {
        let value = of_row(&row("a", 0.01, [f64::INFINITY, 0.0], None));
        assert!(value["psnr"].is_null() && value["edges"].is_null());
        let value = of_row(&row("a", 0.07, [30.0, 0.5], Some([20.0, 0.75])));
        assert_eq!(value["edges"], json!({ "share": 0.25, "psnr": 20.0, "flip": 0.75 }));
        assert_eq!((&value["samples"], &value["frames"][0]["frame"]), (&json!("7%"), &json!(39)));
    }
}
