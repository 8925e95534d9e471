//! The searches of an experiment: with how many samples does a graph reach an error, or fill a time?

use indicatif::ProgressBar;

use super::{
    Work,
    bisect::{self, Answer, Target},
    cell::{Figures, Found, Outcome, Reached, Record},
    experiment::{Goal, Search},
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
        let Search { goal, target, .. } = task.search;
        let (key, column) = (task.key.clone(), goal.column().to_owned());
        Ok(Found { key, cell: task.setting.cell.clone(), column, target, result })
    }

    fn reached(&self, task: &Task, bar: &ProgressBar) -> Result<Reached, CliError> {
        let Search { goal, target, .. } = task.search;
        let (falls, ratios) = match goal {
            Goal::Metric(metric) => (!metric.more_is_better(), !metric.more_is_better()),
            Goal::Cost(_) => (false, true),
        };
        let range = task.range();
        let references = references(self.study, &task.setting.cell, self.store)?;
        let column = goal.column();
        let target = Target { value: target, falls, ratios, range };
        let answer = bisect::search(&target, |samples| {
            let records = self.repetitions(task, samples, &references, bar)?;
            let figure = |record: &Record| {
                let figure = record.figure(column).filter(|figure| !ratios || *figure > 0.0);
                figure.ok_or_else(|| CliError::Input(format!("there is no {column} at {samples} samples")))
            };
            records.iter().map(figure).collect::<Result<Vec<f64>, CliError>>()
        })?;
        Ok(match answer {
            Answer::Fewer => Reached::Fewer(range[0]),
            Answer::More => Reached::More(range[1]),
            Answer::Within { samples, interval } => {
                let records = self.repetitions(task, samples.round() as u32, &references, bar)?;
                let columns = records
                    .iter()
                    .filter_map(Record::measured)
                    .flat_map(|measured| measured.errors.keys().chain(measured.costs.keys()).cloned());
                let figures: Figures =
                    columns.map(|column| (column.clone(), mean(&records, &column))).collect();
                Reached::Within { samples, interval, figures }
            }
        })
    }

    /// The cells of all seeds with this number of samples, from the store or measured and kept.
    fn repetitions(
        &self,
        task: &Task,
        samples: u32,
        references: &References,
        bar: &ProgressBar,
    ) -> Result<Vec<Record>, CliError> {
        let seeds = self.study.experiment.seeds.iter();
        let record = |seed: &u32| {
            let cell = self.study.cell(&task.setting, &samples.to_string(), samples, *seed);
            bar.set_message(format!("searching {}: {}", task.label(), cell.label()));
            if let Some(record) = self.store.cell(&cell.key)?.filter(|record| record.measured().is_some()) {
                return Ok(record);
            }
            let result = self.cell(&cell, references, bar)?;
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
    /// The fewest and the most samples.
    pub fn range(&self) -> [u32; 2] {
        self.search.range.map(|samples| samples.of(self.setting.cell.size))
    }

    /// What is searched: `flip 0.02`.
    pub fn label(&self) -> String {
        format!("{} {}", self.search.goal.column(), self.search.target)
    }
}
