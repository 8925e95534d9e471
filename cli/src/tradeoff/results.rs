//! The results of an experiment: a table, CSV and JSON, of the cells that are there.

use serde_json::{Map, Value, json};

use super::{
    cell::{Cell, Found, Measured, Outcome, Reached, Record},
    experiment::{Experiment, tidy},
    figure::{Cost, INEFFICIENCY, Metric, REFERENCE},
};
use crate::table::Table;

/// All results.
pub struct Results<'a> {
    /// What the file says.
    pub experiment: &'a Experiment,
    /// The cells that are there, in the order of the experiment.
    pub records: &'a [Record],
    /// The answers of the searches that are there.
    pub found: &'a [Found],
    /// Number of cells and searches that are not there.
    pub missing: usize,
}

/// A column with its description.
type Column = (&'static str, &'static str);

impl Results<'_> {
    /// The columns of errors: the same in every run on one machine.
    fn errors(&self) -> impl Iterator<Item = Column> {
        self.experiment.metrics.iter().map(|metric| (metric.column(), metric.doc())).chain(REFERENCE)
    }

    /// The columns of costs; times last.
    fn costs() -> impl Iterator<Item = Column> {
        Cost::ALL.iter().map(|cost| (cost.column(), cost.doc())).chain([INEFFICIENCY])
    }

    /// A line for each cell.
    pub fn csv(&self) -> String {
        let figures: Vec<&str> = self.errors().chain(Self::costs()).map(|(name, _)| name).collect();
        let head = ["cell"].iter().chain(&SETTING).chain(&["budget", "seed"]).chain(&figures);
        let head = head.chain(&["at_reference_noise", "backend", "cpu", "failed"]);
        let mut text = line(head.map(|name| (*name).to_owned()));
        for record in self.records {
            let cell = &record.cell;
            let budget = [cell.budget.clone(), cell.seed.to_string()];
            let fields = [cell.key.clone()].into_iter().chain(setting(cell)).chain(budget);
            let figure = |name: &&str| record.figure(name).map_or(String::new(), |value| value.to_string());
            let (backend, machine, failed) = match &record.result {
                Outcome::Measured(measured) => {
                    let Measured { backend, machine, .. } = &**measured;
                    (backend.clone(), machine["cpu"].as_str().unwrap_or_default().to_owned(), String::new())
                }
                Outcome::Failed(message) => (String::new(), String::new(), message.clone()),
            };
            let noise = at_noise(record).map_or(String::new(), |at| at.to_string());
            let figures = figures.iter().map(figure);
            text += &line(fields.chain(figures).chain([noise, backend, machine, failed]));
        }
        text
    }

    /// A line for each search. An answer beyond what was tried has an interval that is open at one end.
    pub fn searches_csv(&self) -> String {
        let figures = || self.errors().chain(Self::costs()).map(|(name, _)| name);
        let goal = ["figure", "target", "over", "answer", "value", "low", "high"];
        let head = ["search"].into_iter().chain(SETTING).chain(goal).chain(figures()).chain(["failed"]);
        let mut text = line(head.map(str::to_owned));
        for Found { key, cell, over, column, target, result } in self.found {
            let none = String::new;
            let (answer, [value, low, high]) = match result {
                Reached::Within { value, interval: [low, high], .. } => {
                    ("within", [value.to_string(), low.to_string(), high.to_string()])
                }
                Reached::Below(value) => ("below", [none(), none(), value.to_string()]),
                Reached::Above(value) => ("above", [none(), value.to_string(), none()]),
                Reached::Failed(_) => ("failed", [none(), none(), none()]),
            };
            let failed = match result {
                Reached::Failed(message) => message.clone(),
                _ => none(),
            };
            let goal =
                [column.clone(), target.to_string(), over.clone(), answer.to_owned(), value, low, high];
            let fields = [key.clone()].into_iter().chain(setting(cell)).chain(goal);
            let figures = figures().map(|name| result.figure(name).map_or(none(), |value| value.to_string()));
            text += &line(fields.chain(figures).chain([failed]));
        }
        text
    }

    /// Everything for programs. `command` is the command line.
    pub fn json(&self, command: &[String], machine: &Value) -> Value {
        let columns: Map<String, Value> =
            self.errors().chain(Self::costs()).map(|(name, doc)| (name.to_owned(), doc.into())).collect();
        let cell = |record: &Record| {
            let mut value = json!(record);
            if let Some(at) = at_noise(record) {
                value["at_reference_noise"] = at.into();
            }
            value
        };
        json!({
            "doc": self.experiment.doc,
            "command": command,
            "version": env!("CARGO_PKG_VERSION"),
            "machine": machine,
            "columns": columns,
            "cells": self.records.iter().map(cell).collect::<Vec<_>>(),
            "searches": self.found,
            "missing": self.missing,
        })
    }

    /// The tables.
    pub fn text(&self) -> String {
        let tables =
            [(self.records.is_empty(), self.cells_text()), (self.found.is_empty(), self.searches_text())];
        let tables = tables.into_iter().filter(|(empty, _)| !empty).map(|(_, text)| text);
        tables.collect::<Vec<_>>().join("\n")
    }

    /// A table of the searches: where a figure reaches its target, and what else is so there.
    fn searches_text(&self) -> String {
        let metrics = self.experiment.metrics.iter().take(3);
        let columns: Vec<(&str, usize)> = metrics
            .map(|metric| (metric.column(), metric.digits()))
            .chain([(Cost::TotalMs.column(), 2)])
            .collect();
        let names = columns.iter().map(|(column, _)| format!(">{column}"));
        let head = ["graph", "scene", "camera", "size", "search", "over", ">value", ">interval", ">paths/px"];
        let head: Vec<String> =
            head.map(str::to_owned).into_iter().chain(names).chain([String::new()]).collect();
        let mut table = Table::new(&head.iter().map(String::as_str).collect::<Vec<_>>());
        for Found { cell, over, column, target, result, .. } in self.found {
            let size = format!("{}x{}", cell.size[0], cell.size[1]);
            let none = || "-".to_owned();
            let figure = |column: &str, digits: usize| {
                result.figure(column).map_or_else(none, |value| format!("{value:.digits$}"))
            };
            let (value, interval, note) = match result {
                Reached::Within { value, interval: [low, high], .. } => {
                    let [value, low, high] = [value, low, high].map(|value| short(*value));
                    (value, format!("{low} - {high}"), String::new())
                }
                Reached::Below(value) => {
                    (none(), format!("< {value}"), "reached below what was tried".to_owned())
                }
                Reached::Above(value) => (none(), format!("> {value}"), "not reached".to_owned()),
                Reached::Failed(message) => {
                    (none(), none(), format!("failed: {}", message.lines().next().unwrap_or_default()))
                }
            };
            let what = [
                cell.variation(),
                cell.scene.clone(),
                cell.camera.clone(),
                size,
                format!("{column} {target}"),
                over.clone(),
            ];
            let paths = figure(Cost::PathsPerPixel.column(), 3);
            let figures = columns.iter().map(|(column, digits)| figure(column, *digits));
            table.line(
                what.into_iter().chain([value, interval, paths]).chain(figures).chain([note]).collect(),
            );
        }
        table.to_string()
    }

    /// A table with a line for each set of repetitions: means over the seeds.
    fn cells_text(&self) -> String {
        let Some(first) = self.experiment.metrics.first().copied() else { return String::new() };
        let shown = |metric: &Metric| self.experiment.metrics.contains(metric) && *metric != first;
        let others: Vec<Metric> = [Metric::Flip, Metric::Psnr, Metric::RelMse, Metric::EdgeFlip]
            .into_iter()
            .filter(shown)
            .take(3)
            .collect();
        let metrics: Vec<Metric> = [first].into_iter().chain(others).collect();
        let names = metrics.iter().map(|metric| format!(">{}", metric.column()));
        let head = ["graph", "scene", "camera", "size", "budget", ">paths/px"].map(str::to_owned);
        let tail = [">frame ms", ">trace ms", ""].map(str::to_owned);
        let head: Vec<String> = head.into_iter().chain(names).chain(tail).collect();
        let mut table = Table::new(&head.iter().map(String::as_str).collect::<Vec<_>>());
        for group in groups(self.records) {
            let cell = &group[0].cell;
            let mean = |column: &str| mean(group, column);
            let number = |column: &str, digits: usize| {
                mean(column).map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
            };
            let failed = group.iter().find_map(|record| match &record.result {
                Outcome::Failed(message) => Some(message.lines().next().unwrap_or_default()),
                Outcome::Measured(_) => None,
            });
            let note = match failed {
                Some(message) => format!("failed: {message}"),
                None if group.iter().any(|record| at_noise(record) == Some(true)) => {
                    "at the reference's noise".into()
                }
                None => String::new(),
            };
            let size = format!("{}x{}", cell.size[0], cell.size[1]);
            let paths = cell.paths_per_pixel.map_or_else(|| "-".to_owned(), |paths| format!("{paths:.3}"));
            let what =
                [cell.variation(), cell.scene.clone(), cell.camera.clone(), size, cell.budget.clone(), paths];
            let figures = metrics.iter().map(|metric| number(metric.column(), metric.digits()));
            let times = [Cost::FrameMs, Cost::TraceMs].map(|cost| number(cost.column(), 2));
            table.line(what.into_iter().chain(figures).chain(times).chain([note]).collect());
        }
        table.to_string()
    }
}

/// A number of samples, or the value of a parameter, in four digits.
pub fn short(value: f64) -> String {
    if value.abs() >= 1000.0 { format!("{value:.0}") } else { tidy(value, 4) }
}

/// The records in groups of repetitions.
pub fn groups(records: &[Record]) -> impl Iterator<Item = &[Record]> {
    records.chunk_by(|a, b| a.cell.repeats(&b.cell))
}

/// The mean of a column over the records that have it.
pub fn mean<'r>(records: impl IntoIterator<Item = &'r Record>, column: &str) -> Option<f64> {
    let values: Vec<f64> = records.into_iter().filter_map(|record| record.figure(column)).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Whether a picture is as near to its reference as the reference to the truth, so that more says nothing: its FLIP
/// is not above that of the reference's halves, or its RMSE not above sqrt(2) times the reference's, of which half
/// the square is the reference's own. `None` if neither was measured.
fn at_noise(record: &Record) -> Option<bool> {
    let [flip, rmse, ..] = REFERENCE.map(|(name, _)| record.figure(name));
    let flip = record.figure(Metric::Flip.column()).zip(flip).map(|(found, noise)| found <= noise);
    let rmse = record.figure(Metric::Rmse.column()).zip(rmse);
    let rmse = rmse.map(|(found, noise)| found <= std::f64::consts::SQRT_2 * noise);
    flip.into_iter().chain(rmse).reduce(|a, b| a || b)
}

/// The columns of [`setting`].
const SETTING: [&str; 9] =
    ["graph", "variant", "params", "scene", "camera", "width", "height", "frames", "compare"];

/// What a cell or a search runs, but for budgets and seeds.
fn setting(cell: &Cell) -> [String; 9] {
    let params: Vec<String> = cell.params.iter().map(|(param, value)| format!("{param}={value}")).collect();
    let compare: Vec<String> = cell.compare.iter().map(u32::to_string).collect();
    [
        cell.graph.clone(),
        cell.variant.clone(),
        params.join(" "),
        cell.scene.clone(),
        cell.camera.clone(),
        cell.size[0].to_string(),
        cell.size[1].to_string(),
        cell.frames.to_string(),
        compare.join(" "),
    ]
}

/// A line of CSV (RFC 4180).
fn line(fields: impl Iterator<Item = String>) -> String {
    let quoted = |field: String| {
        let plain = !field.contains(['"', ',', '\n', '\r']);
        if plain { field } else { format!("\"{}\"", field.replace('"', "\"\"")) }
    };
    fields.map(quoted).collect::<Vec<_>>().join(",") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tradeoff::cell::tests::{cell, record};

    #[test]
    fn fields_with_commas_and_quotes_are_quoted() {
        let fields = ["a", "b,c", "say \"no\"", "1\n2", ""].map(String::from);
        assert_eq!(line(fields.into_iter()), "a,\"b,c\",\"say \"\"no\"\"\",\"1\n2\",\n");
    }

    #[test]
    fn repetitions_are_a_group_with_a_mean() {
        let records = [(5, 1, 0.25), (5, 2, 0.75), (9, 1, 0.5)]
            .map(|(samples, seed, flip)| record(cell("epi", samples, seed), flip, 1.0));
        let means: Vec<_> = groups(&records).map(|group| mean(group, "flip")).collect();
        assert_eq!(means, [Some(0.5), Some(0.5)]);
        assert_eq!(mean(&records, "psnr"), None);
    }

    #[test]
    fn the_references_noise_is_recognised() {
        let with = |flip: f64, noise: &[(&str, f64)]| {
            let mut record = record(cell("epi", 5, 1), flip, 1.0);
            if let Outcome::Measured(measured) = &mut record.result {
                measured.errors.extend(noise.iter().map(|(name, value)| ((*name).to_owned(), Some(*value))));
            }
            at_noise(&record)
        };
        assert_eq!(with(0.02, &[("reference_flip", 0.01)]), Some(false));
        assert_eq!(with(0.01, &[("reference_flip", 0.01)]), Some(true));
        let rmse =
            |found: f64| with(0.02, &[("reference_flip", 0.01), ("rmse", found), ("reference_rmse", 1.0)]);
        assert_eq!((rmse(1.4), rmse(1.5)), (Some(true), Some(false)));
        assert_eq!(with(0.02, &[]), None);
    }
}
