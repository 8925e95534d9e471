//! The report: tables in Markdown, and JSON.

use std::iter;

use epigraph::Samples;
use epigraph_core::Gpu;
use serde_json::{Value, json};

use super::{changes, distinct};
use crate::{
    args::QualityArgs,
    edge_mask,
    tradeoff::{
        cell::{Cell, FrameErrors, Outcome, Record},
        experiment::{Budget, tidy},
        figure::{Cost, EDGE_SHARE, Metric, REFERENCE_FLIP, REFERENCE_PSNR, STATIC_SHARE},
        plot::views,
        study::{LeftOut, Study},
    },
    values::Percent,
};

/// Where a picture's PSNR is not so many decibels below the reference's own, more than 10^-0.5 = 0.32 of the squared error
/// are the reference's.
const CLEAR: f64 = 5.0;

/// Traced paths that differ from the budget by more than this share of it are reported.
const TOLERANCE: f64 = 0.02;

/// The report of a quality run.
pub struct Report<'a> {
    /// The command line.
    pub args: &'a QualityArgs,
    /// What was measured.
    pub study: &'a Study<'a>,
    /// The GPU, if nodes run there by default.
    pub gpu: Option<&'a Gpu>,
    /// The figures, in the order of measurement.
    pub records: &'a [Record],
}

impl Report<'_> {
    /// The settings of the comparison in a line.
    pub fn about(&self) -> String {
        format!("{}; frames {}", self.setting(), self.frames())
    }

    fn setting(&self) -> String {
        let [width, height] = self.args.size.0;
        let changes: Vec<String> = changes(self.args).iter().map(|piece| format!(", {piece}")).collect();
        format!(
            "{width}x{height}, references of {} paths a pixel (mode {}), seed {}, {}{}",
            self.args.spp.0,
            self.study.mode,
            self.args.seed,
            self.study.device.side,
            changes.concat()
        ) + &self.args.density.map_or(String::new(), |Percent(share)| {
            format!(", samples for {} of the pixels", Samples::Share(share))
        })
    }

    /// The compared frames of each camera: `39 (still); 19, 24, 29 (orbit)`.
    fn frames(&self) -> String {
        let one = |Record { cell, .. }: &Record| {
            let frames: Vec<String> = cell.compare.iter().map(u32::to_string).collect();
            format!("{} ({})", frames.join(", "), cell.camera)
        };
        distinct(self.records.iter().map(one)).join("; ")
    }

    /// The tables, what is known of the references, and the verdicts.
    pub fn text(&self) -> String {
        format!(
            "PSNR in dB / mean FLIP / flicker of static pixels / ms of a frame without tracing + ms of tracing\n{}\n\
             in brackets: light paths a sample\n\n{}\nwithin {} pixels of reference edges: PSNR in dB / mean FLIP\n\n{}\n{}\n{}",
            self.about(),
            self.table(whole),
            edge_mask::REACH,
            self.table(near_edges),
            self.notes(),
            self.verdicts()
        )
    }

    /// A line for each graph in each view, a column for each budget.
    fn table(&self, cell: fn(&Record, Budget) -> String) -> String {
        let budgets = self.study.experiment.budgets.iter().map(|budget| budget.value);
        let headings = budgets.clone().map(|budget| match budget {
            Budget::PathsPerPixel(paths) => paths.to_string(),
            Budget::Samples(samples) => format!("{samples} as samples"),
        });
        let mut table =
            vec![iter::once("light paths a pixel and frame".to_owned()).chain(headings).collect()];
        for line in views(self.records).flat_map(by_graph) {
            let Cell { scene, camera, graph, .. } = &line[0].cell;
            let paths = distinct(line.iter().filter_map(|record| record.cell.paths_per_sample));
            let paths = paths.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
            let paths = if paths.is_empty() { paths } else { format!(" ({paths})") };
            let name = format!("{scene}, {camera}, {graph}{paths}");
            let cells = budgets.clone().map(|budget| {
                let record = line.iter().find(|record| record.cell.budget == budget.to_string());
                record.map_or("-".into(), |record| cell(record, budget))
            });
            table.push(iter::once(name).chain(cells).collect::<Vec<_>>());
        }
        markdown(&table)
    }

    /// The error of each reference, and whatever a reader of the table must know.
    fn notes(&self) -> String {
        let mut text = String::new();
        for view in views(self.records) {
            text += &reference(view, self.args.spp.0);
        }
        for LeftOut { graph, why, .. } in &self.study.left_out {
            text += &format!("{graph}: {why}\n");
        }
        for record in self.records {
            text += &other_paths(record);
            if let Outcome::Failed(message) = &record.result {
                text += &format!("{}: failed: {message}\n", name(&record.cell));
            }
        }
        text
    }

    /// For each graph but the first, the number of cases in which its FLIP is lower than the first one's.
    fn verdicts(&self) -> String {
        let graphs = distinct(self.records.iter().map(|record| record.cell.graph.as_str()));
        let of = |graph| self.records.iter().filter(move |record| record.cell.graph == graph);
        let mut text = String::new();
        for other in graphs.iter().skip(1) {
            let alike = |a: &Cell, b: &Cell| a.view() == b.view() && a.budget == b.budget;
            let first = |other: &Record| of(graphs[0]).find(|first| alike(&first.cell, &other.cell));
            let pairs: Vec<_> = of(other).filter_map(|other| Some((first(other)?, other))).collect();
            let what = format!("{other} against {}: FLIP", graphs[0]);
            text += &verdict(&what, &pairs, Metric::Flip);
            text += &verdict(&format!("{what} near edges"), &pairs, Metric::EdgeFlip);
        }
        text
    }

    /// The figures for programs; see the help of the command.
    pub fn json(&self) -> Value {
        let args = self.args;
        let failed = |record: &Record| {
            let Outcome::Failed(message) = &record.result else { return None };
            let Cell { graph, scene, camera, budget, .. } = &record.cell;
            Some(
                json!({ "graph": graph, "scene": scene, "camera": camera, "budget": budget, "message": message }),
            )
        };
        let left_out = |LeftOut { graph, budget, why }: &LeftOut| json!({ "graph": graph, "budget": budget, "message": why });
        json!({
            "size": args.size.0,
            "seed": args.seed,
            "backend": self.study.device.side.to_string(),
            "adapter": self.gpu.map(Gpu::name),
            "spp": args.spp.0,
            "mode": self.study.mode.to_string().to_lowercase(),
            "set": changes(args),
            "edge_reach": edge_mask::REACH,
            "rows": self.records.iter().filter(|record| record.measured().is_some()).map(of_record).collect::<Vec<_>>(),
            "left_out": self.study.left_out.iter().map(left_out).collect::<Vec<_>>(),
            "failed": self.records.iter().filter_map(failed).collect::<Vec<_>>(),
        })
    }
}

/// The records of one view by graph: each group has one for each budget.
fn by_graph(records: &[Record]) -> impl Iterator<Item = &[Record]> {
    records.chunk_by(|a, b| a.cell.graph == b.cell.graph)
}

/// What a cell of the table stands for.
fn name(cell: &Cell) -> String {
    format!("{}, {}, {}, {}", cell.scene, cell.camera, cell.graph, cell.budget)
}

/// The number of pairs in which the second one is better, the mean change, and the pairs in which it is not better.
fn verdict(what: &str, pairs: &[(&Record, &Record)], metric: Metric) -> String {
    let figure = |record: &Record| record.figure(metric.column());
    let flips: Vec<(&Cell, f64, f64)> = pairs
        .iter()
        .filter_map(|(first, other)| Some((&other.cell, figure(first)?, figure(other)?)))
        .collect();
    let (mut worse, mut logs) = (Vec::new(), 0.0);
    for &(cell, first, other) in &flips {
        if other >= first {
            worse.push(format!("{}, {}, {}", cell.scene, cell.camera, cell.budget));
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

/// `36.4 / .0261 / .0102 / 4.2+1.3`; after its light paths if the budget is in samples.
fn whole(record: &Record, budget: Budget) -> String {
    if record.measured().is_none() {
        return "failed".into();
    }
    let is_samples = matches!(budget, Budget::Samples(_));
    let paths = record.cell.paths_per_pixel.filter(|_| is_samples);
    let paths = paths.map_or(String::new(), |paths| format!("{}: ", tidy(paths, 3)));
    let star = if near_reference(record) == Some(true) { "*" } else { "" };
    let [frame, trace] = [Cost::FrameMs, Cost::TraceMs].map(|cost| ms(record.figure(cost.column())));
    format!(
        "{paths}{}{star} / {} / {} / {frame}+{trace}",
        decibels(record.figure(Metric::Psnr.column())),
        flip(record.figure(Metric::Flip.column())),
        flip(record.figure(Metric::Flicker.column()))
    )
}

/// `29.3 / .1030`.
fn near_edges(record: &Record, _: Budget) -> String {
    let figure = |metric: Metric| record.figure(metric.column());
    format!("{} / {}", decibels(figure(Metric::EdgePsnr)), flip(figure(Metric::EdgeFlip)))
}

/// What is known of the references of a view, and how many paths they need for the picture that is nearest to them.
fn reference(view: &[Record], spp: u32) -> String {
    let Some(first) = view.iter().find(|record| record.measured().is_some()) else { return String::new() };
    let Cell { scene, camera, .. } = &first.cell;
    let share =
        |column: &str| first.figure(column).map_or("-".into(), |share| format!("{:.1}%", 100.0 * share));
    let own = first.figure(REFERENCE_PSNR);
    let error = own.map_or("without noise".into(), |own| format!("{own:.1} dB from the truth"));
    let mut text = format!(
        "{scene}, {camera}: references are {error}, FLIP between their halves {}; {} of the pixels are near edges, {} \
         static\n",
        flip(first.figure(REFERENCE_FLIP)),
        share(EDGE_SHARE),
        share(STATIC_SHARE)
    );
    let starred = view.iter().filter(|record| near_reference(record) == Some(true));
    let best = starred.filter_map(|record| record.figure(Metric::Psnr.column())).reduce(f64::max);
    if let Some((best, own)) = best.zip(own) {
        text += &format!(
            "* less than {CLEAR} dB below the references of {scene}, {camera}: the picture is better than the figure; \
             --spp {} should be enough\n",
            enough(spp, best, own)
        );
    }
    text
}

/// Paths per pixel of a reference, a power of two, that is clear of a picture with `psnr`, measured with references of
/// `spp` paths that have a PSNR of `own`.
fn enough(spp: u32, psnr: f64, own: f64) -> u64 {
    let squared = |decibels: f64| 10_f64.powf(-0.1 * decibels);
    // What is measured is the sum of both. A picture that is as good as its reference may be much better.
    let picture = (squared(psnr) - squared(own)).max(squared(psnr) / 16.0);
    let share = squared(CLEAR);
    let wanted = picture * share / (1.0 - share);
    ((f64::from(spp) * squared(own) / wanted).ceil() as u64).next_power_of_two()
}

/// Whether a picture is so near to its reference that this has a large part in the difference; `None` if nothing is known
/// of the reference.
fn near_reference(record: &Record) -> Option<bool> {
    let own = record.figure(REFERENCE_PSNR)?;
    // A picture without a PSNR is equal to the reference.
    Some(record.figure(Metric::Psnr.column()).is_none_or(|psnr| psnr > own - CLEAR))
}

/// That a graph traced fewer paths than it was allowed to, or more, if its samples are not those of the budget.
fn other_paths(record: &Record) -> String {
    let asked = record.cell.paths_per_pixel;
    match asked.zip(record.figure(Cost::PathsTraced.column())) {
        Some((asked, traced)) if (traced - asked).abs() > TOLERANCE * asked => {
            let [asked, traced] = [asked, traced].map(|paths| tidy(paths, 3));
            format!("{}: {traced} paths a pixel were traced, not {asked}\n", name(&record.cell))
        }
        _ => String::new(),
    }
}

/// One decimal, or a dash.
fn decibels(value: Option<f64>) -> String {
    value.map_or("-".into(), |value| format!("{value:.1}"))
}

/// Four decimals without a leading zero, or a dash.
fn flip(value: Option<f64>) -> String {
    value.map_or("-".into(), |value| format!("{value:.4}").trim_start_matches('0').to_owned())
}

/// Milliseconds in three digits or so.
fn ms(value: Option<f64>) -> String {
    value
        .map_or("-".into(), |value| if value < 100.0 { format!("{value:.1}") } else { format!("{value:.0}") })
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

/// A row of the JSON.
fn of_record(record: &Record) -> Value {
    let cell = &record.cell;
    let figure = |column: &str| record.figure(column);
    let mut value = json!({
        "graph": cell.graph,
        "scene": cell.scene,
        "camera": cell.camera,
        "budget": cell.budget,
        "samples_per_frame": cell.samples,
        "paths_per_sample": cell.paths_per_sample,
        "paths_per_pixel": cell.paths_per_pixel,
        "paths_traced": figure(Cost::PathsTraced.column()),
        "near_reference": near_reference(record),
        "frame_ms": figure(Cost::FrameMs.column()),
        "trace_ms": figure(Cost::TraceMs.column()),
        "reference": { "psnr": figure(REFERENCE_PSNR), "flip": figure(REFERENCE_FLIP) },
        "static_share": figure(STATIC_SHARE),
    });
    let all = |value: &mut Value, of: &dyn Fn(Metric) -> Option<f64>| {
        for metric in [Metric::Psnr, Metric::Flip, Metric::Flicker] {
            value[metric.column()] = json!(of(metric));
        }
        let flip = of(Metric::EdgeFlip);
        value["edges"] = json!(flip.map(|flip| json!({ "psnr": of(Metric::EdgePsnr), "flip": flip })));
    };
    all(&mut value, &|metric| figure(metric.column()));
    if let Some(edges) = value["edges"].as_object_mut() {
        edges.insert("share".into(), json!(figure(EDGE_SHARE)));
    }
    let frame = |FrameErrors { frame, errors }: &FrameErrors| {
        let mut value = json!({ "frame": frame });
        all(&mut value, &|metric| errors.get(metric.column()).copied().flatten());
        value
    };
    value["frames"] =
        record.measured().into_iter().flat_map(|measured| &measured.frames).map(frame).collect();
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tradeoff::cell::tests::{cell, record};

    /// A record with these figures.
    fn with(graph: &str, samples: u32, figures: &[(&str, f64)]) -> Record {
        let mut record = record(cell(graph, samples, 1), 0.0261, 12.34);
        if let Outcome::Measured(measured) = &mut record.result {
            let pairs = figures.iter().map(|(name, value)| ((*name).to_owned(), Some(*value)));
            let (costs, errors): (Vec<_>, Vec<_>) =
                pairs.partition(|(name, _)| name.ends_with("ms") || name.starts_with("paths"));
            measured.errors.extend(errors);
            measured.costs.extend(costs);
        }
        record
    }

    #[test]
    fn cells_hold_all_figures() {
        let figures = [
            ("psnr", 29.34),
            ("flicker", 0.01234),
            ("frame_ms", 4.21),
            ("trace_ms", 134.2),
            ("edge_psnr", 20.0),
            ("edge_flip", 0.103),
        ];
        let record = with("a", 5, &figures);
        let paths = Budget::PathsPerPixel(0.2);
        assert_eq!(whole(&record, paths), "29.3 / .0261 / .0123 / 4.2+134");
        // The cell's 0.2 paths.
        assert_eq!(whole(&record, Budget::Samples(Samples::Count(5))), "0.2: 29.3 / .0261 / .0123 / 4.2+134");
        assert_eq!(near_edges(&record, paths), "20.0 / .1030");
        assert_eq!(near_edges(&with("a", 5, &[]), paths), "- / -");
        assert_eq!((flip(Some(1.0)), ms(None)), ("1.0000".into(), "-".into()));
        let failed = Record { result: Outcome::Failed("no".into()), ..record };
        assert_eq!(whole(&failed, paths), "failed");
    }

    #[test]
    fn pictures_near_their_reference_have_a_star() {
        let near = |psnr: f64| near_reference(&with("a", 5, &[("psnr", psnr), ("reference_psnr", 40.0)]));
        assert_eq!([34.9, 35.1].map(near), [Some(false), Some(true)]);
        assert_eq!(near_reference(&with("a", 5, &[("psnr", 50.0)])), None);
        assert_eq!(near_reference(&with("a", 5, &[("reference_psnr", 40.0)])), Some(true), "equal pictures");
        let starred = with("a", 5, &[("psnr", 36.0), ("reference_psnr", 40.0)]);
        assert!(whole(&starred, Budget::PathsPerPixel(0.2)).starts_with("36.0* / "));
        let text = reference(&[starred, with("b", 5, &[("psnr", 30.0)])], 256);
        assert!(
            text.starts_with(
                "cornell, orbit: references are 40.0 dB from the truth, FLIP between their halves -"
            ),
            "{text}"
        );
        assert!(
            text.contains("\n* less than 5 dB below the references of cornell, orbit")
                && text.contains("--spp 512 "),
            "{text}"
        );
    }

    #[test]
    fn enough_paths_are_clear_of_the_picture() {
        let squared = |decibels: f64| 10_f64.powf(-0.1 * decibels);
        for (psnr, own) in [(36.0, 40.0), (38.0, 41.0), (30.0, 30.5), (44.0, 49.0)] {
            let picture = squared(psnr) - squared(own);
            // The error of a reference falls with its paths; the picture is then measured anew.
            let margin = |spp: u64| {
                let reference = squared(own) * 256.0 / spp as f64;
                10.0 * ((picture + reference) / reference).log10()
            };
            let spp = enough(256, psnr, own);
            assert!(margin(spp) >= CLEAR && margin(spp / 2) < CLEAR, "{psnr} of {own}: {spp}");
        }
        // A picture that is nearer to the reference than the truth is.
        assert_eq!(enough(256, 42.0, 40.0), 16_384);
    }

    #[test]
    fn a_graph_that_does_not_keep_to_its_budget_is_named() {
        let traced = |paths: f64| other_paths(&with("a", 5, &[("paths_traced", paths)]));
        assert_eq!([0.197, 0.2, 0.203].map(traced), ["", "", ""]);
        assert_eq!(traced(0.1), "cornell, orbit, a, 5: 0.1 paths a pixel were traced, not 0.2\n");
        assert_eq!(traced(1.0), "cornell, orbit, a, 5: 1 paths a pixel were traced, not 0.2\n");
    }

    #[test]
    fn the_table_is_markdown() {
        let rows = [["", "1%"], ["cornell", "29.3"]].map(|row| row.map(String::from).to_vec());
        assert_eq!(markdown(&rows), "|         | 1%   |\n|---------|------|\n| cornell | 29.3 |\n");
    }

    #[test]
    fn the_verdict_names_the_cases_that_are_not_better() {
        let of = |graph, samples, flip| record(cell(graph, samples, 1), flip, 1.0);
        let (first, other) = ([of("a", 1, 0.04), of("a", 2, 0.02)], [of("b", 1, 0.01), of("b", 2, 0.02)]);
        let pairs: Vec<_> = first.iter().zip(&other).collect();
        // The geometric mean of 1/4 and 1 is 1/2.
        assert_eq!(
            verdict("FLIP", &pairs, Metric::Flip),
            "FLIP lower in 1 of 2 cases, -50% (geometric mean); not lower: cornell, orbit, 2\n"
        );
        assert_eq!(verdict("FLIP", &pairs, Metric::EdgeFlip), "");
    }

    #[test]
    fn missing_figures_are_null() {
        let value = of_record(&with("a", 5, &[]));
        assert!(value["psnr"].is_null() && value["edges"].is_null() && value["near_reference"].is_null());
        let figures = [("psnr", 30.0), ("edge_psnr", 20.0), ("edge_flip", 0.75), ("edge_share", 0.25)];
        let value = of_record(&with("a", 7, &figures));
        assert_eq!(value["edges"], json!({ "share": 0.25, "psnr": 20.0, "flip": 0.75 }));
        assert_eq!((&value["budget"], &value["frames"][0]["frame"]), (&json!("7"), &json!(2)));
    }
}
