//! The searches of an experiment: with how many samples, or at which value of a parameter, does a graph reach an error or
//! fill a time?

use indicatif::ProgressBar;

use super::{
    Work,
    bisect::{self, Answer, Target},
    cell::{Figures, Found, Outcome, Reached, Record},
    experiment::{Goal, Over},
    measure::{References, references},
    results::mean,
    study::Task,
};
use crate::error::CliError;

impl Work<'_> {
    /// Searches. What keeps the search from being made is its answer.
    ///
    /// # Errors
    /// [`CliError::Interrupted`], and files that cannot be written.
    pub fn search(&self, task: &Task, bar: &ProgressBar) -> Result<Found, CliError> {
        let result = match self.reached(task, bar) {
            Err(CliError::Interrupted) => return Err(CliError::Interrupted),
            Err(error) => Reached::Failed(error.to_string()),
            Ok(reached) => reached,
        };
        let Task { key, search, setting, .. } = task;
        let column = search.goal.column().to_owned();
        Ok(Found {
            key: key.clone(),
            cell: setting.cell.clone(),
            over: search.over.name().to_owned(),
            column,
            target: search.target,
            result,
        })
    }

    fn reached(&self, task: &Task, bar: &ProgressBar) -> Result<Reached, CliError> {
        let (goal, value) = (task.search.goal, task.search.target);
        let (falls, ratios) = match goal {
            Goal::Metric(metric) => (!metric.more_is_better(), !metric.more_is_better()),
            Goal::Cost(_) => (false, true),
        };
        // More samples lower errors and take time; what a parameter does, it has to show.
        let falls = matches!(task.search.over, Over::Samples(_)).then_some(falls);
        let references = references(self.study, &task.setting.cell, Some(self.store))?;
        let column = goal.column();
        let Task { range, whole, .. } = *task;
        let target = Target { value, falls, ratios, range, whole };
        let answer = bisect::search(&target, |at| {
            let records = self.repetitions(task, at, &references, bar)?;
            let figure = |record: &Record| {
                let figure = record.figure(column).filter(|figure| !ratios || *figure > 0.0);
                figure.ok_or_else(|| CliError::Input(format!("there is no {column} at {at}")))
            };
            records.iter().map(figure).collect::<Result<Vec<f64>, CliError>>()
        })?;
        Ok(match answer {
            Answer::Below => Reached::Below(range[0]),
            Answer::Above => Reached::Above(range[1]),
            Answer::Within { value, interval } => {
                let at = if whole { value.round() } else { value };
                let records = self.repetitions(task, at, &references, bar)?;
                let columns = records
                    .iter()
                    .filter_map(Record::measured)
                    .flat_map(|measured| measured.errors.keys().chain(measured.costs.keys()).cloned());
                let figures: Figures =
                    columns.map(|column| (column.clone(), mean(&records, &column))).collect();
                Reached::Within { value, interval, figures }
            }
        })
    }

    /// The cells of all seeds at a value, from the store or measured and kept.
    fn repetitions(
        &self,
        task: &Task,
        at: f64,
        references: &References,
        bar: &ProgressBar,
    ) -> Result<Vec<Record>, CliError> {
        let seeds = self.study.experiment.seeds.iter();
        let (setting, samples) = self.study.at(task, at)?;
        let record = |seed: &u32| {
            let cell = self.study.cell(&setting, &samples.to_string(), samples, *seed);
            bar.set_message(format!("searching {}: {}", task.label(), cell.label()));
            if let Some(record) = self.store.cell(&cell.key)?.filter(|record| record.measured().is_some()) {
                return Ok(record);
            }
            let result = self.runner().cell(&cell, references, bar)?;
            let record = Record { cell, result };
            self.store.keep_cell(&record)?;
            match &record.result {
                Outcome::Failed(message) => Err(CliError::Input(message.clone())),
                Outcome::Measured(_) => Ok(record),
            }
        };
        seeds.map(record).collect()
    }
}

impl Task {
    /// What is searched: `flip 0.02`, or `flip 0.02 over sigma at 5%`.
    pub fn label(&self) -> String {
        let (column, target) = (self.search.goal.column(), self.search.target);
        match &self.search.over {
            Over::Samples(_) => format!("{column} {target}"),
            Over::Param { name, budget, .. } => format!("{column} {target} over {name} at {}", budget.value),
        }
    }
}
