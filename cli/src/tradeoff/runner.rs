//! Measures cells one after the other, and keeps those that are done.

use std::{collections::BTreeSet, process::ExitCode};

use epigraph_pictures::Difference;
use indicatif::ProgressBar;
use serde_json::Value;

use super::{
    cell::{Cell, Outcome, Record},
    measure::{References, measure, reference_frames, references},
    references::Wanted,
    store::Store,
    study::Study,
};
use crate::{INTERRUPTED, error::CliError, interrupt, open, progress};

/// What measures the cells of a study.
pub struct Runner<'a> {
    /// The study.
    pub study: &'a Study<'a>,
    /// Where cells and references are kept, if they are.
    pub store: Option<&'a Store>,
    /// The machine, as the results name it.
    pub machine: &'a Value,
}

impl<'a> Runner<'a> {
    /// Measures the cells that are not kept from an earlier run. Returns all cells in the order of the study.
    ///
    /// # Errors
    /// Those of [`Runner::run`].
    pub fn all(&self) -> Result<Vec<Record>, CliError> {
        let open = open_cells(self.study, self.store)?;
        let done = self.study.cells.len() - open.len();
        if done > 0 {
            eprintln!("{done} of {} cells are done already", self.study.cells.len());
        }
        let measured = self.run(&open)?;
        self.store.map_or(Ok(measured), |store| records(self.study, store))
    }

    /// Measures cells. What keeps a cell from being measured is its result.
    ///
    /// # Errors
    /// [`CliError::Interrupted`], and files that cannot be written.
    pub fn run(&self, todo: &[&Cell]) -> Result<Vec<Record>, CliError> {
        if let Some(store) = self.store {
            self.trace_references(todo.iter().copied(), store)?;
        }
        let frames: u64 = todo.iter().map(|cell| u64::from(cell.frames)).sum();
        let bar = progress::bar(frames, "", "frames");
        let mut records = Vec::with_capacity(todo.len());
        // Cells of one view follow each other and share the references.
        for view in todo.chunk_by(|a, b| a.view() == b.view()) {
            // They have a progress bar of their own.
            let references = bar.suspend(|| references(self.study, view[0], self.store));
            if let Err(CliError::Interrupted) = &references {
                return Err(CliError::Interrupted);
            }
            for (nth, cell) in view.iter().enumerate() {
                bar.set_message(format!(
                    "{} ({} of {} in {})",
                    cell.label(),
                    nth + 1,
                    view.len(),
                    cell.view()
                ));
                let result = match &references {
                    Ok(references) => self.cell(cell, references, &bar)?,
                    Err(error) => Outcome::Failed(error.to_string()),
                };
                if let Outcome::Failed(message) = &result {
                    bar.suspend(|| eprintln!("failed: {}: {message}", cell.label()));
                }
                let record = Record { cell: (*cell).clone(), result };
                if let Some(store) = self.store {
                    store.keep_cell(&record)?;
                }
                records.push(record);
            }
        }
        bar.finish_and_clear();
        for scene in todo.chunk_by(|a, b| a.scene == b.scene) {
            open::warn_of_bad_samples(self.study.view(scene[0]).place.tracer().non_finite());
        }
        Ok(records)
    }

    /// Traces the references that are not in the store. One that fails is reported with its cells.
    ///
    /// # Errors
    /// [`CliError::Interrupted`].
    pub fn trace_references<'c>(
        &self,
        todo: impl Iterator<Item = &'c Cell>,
        store: &Store,
    ) -> Result<(), CliError> {
        let mut keys = BTreeSet::new();
        let all: Vec<Wanted> = todo
            .flat_map(|cell| wanted(self.study, cell))
            .filter(|wanted| keys.insert(wanted.key().to_owned()))
            .collect();
        let bar = progress::bar(all.len() as u64, "tracing references", "references");
        for wanted in &all {
            interrupt::check()?;
            open::tracer_of_surfaces(wanted.take.place)?;
            if let Err(CliError::Interrupted) = wanted.ensure(store) {
                return Err(CliError::Interrupted);
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// Measures a cell. What keeps it from being measured is its result.
    ///
    /// # Errors
    /// [`CliError::Interrupted`], and pictures that cannot be kept.
    pub fn cell(&self, cell: &Cell, references: &References, bar: &ProgressBar) -> Result<Outcome, CliError> {
        match measure(self.study, cell, references, self.machine.clone(), || bar.inc(1)) {
            Ok((measured, picture)) => {
                if let Some(store) = self.store {
                    let last =
                        cell.compare.last().expect("an experiment compares at least one of its frames");
                    let errors = Difference::new(&references[last].converged.picture, &picture).errors;
                    store.keep_picture(&cell.key, &picture, &errors)?;
                }
                Ok(Outcome::Measured(Box::new(measured)))
            }
            Err(CliError::Interrupted) => Err(CliError::Interrupted),
            Err(error) => Ok(Outcome::Failed(error.to_string())),
        }
    }
}

/// The references that a cell needs.
pub fn wanted<'a>(study: &'a Study, cell: &'a Cell) -> impl Iterator<Item = Wanted<'a>> {
    let frames = reference_frames(study.experiment, cell);
    frames.into_iter().map(|frame| Wanted::new(study, cell, frame))
}

/// Whether a cell is not in the store, or failed.
///
/// # Errors
/// Those of [`Store::cell`].
pub fn is_open_cell(cell: &Cell, store: &Store) -> Result<bool, CliError> {
    Ok(store.cell(&cell.key)?.is_none_or(|record| record.measured().is_none()))
}

/// The cells that are not measured yet.
///
/// # Errors
/// Those of [`Store::cell`].
pub fn open_cells<'s>(study: &'s Study, store: Option<&Store>) -> Result<Vec<&'s Cell>, CliError> {
    open_ones(&study.cells, store, is_open_cell)
}

/// Those of a list that are not done; without a folder, all.
///
/// # Errors
/// Those of `is_open`.
pub fn open_ones<'s, T>(
    all: &'s [T],
    store: Option<&Store>,
    is_open: impl Fn(&T, &Store) -> Result<bool, CliError>,
) -> Result<Vec<&'s T>, CliError> {
    let mut open = Vec::new();
    for one in all {
        if store.map_or(Ok(true), |store| is_open(one, store))? {
            open.push(one);
        }
    }
    Ok(open)
}

/// The cells that are in the store, in the order of the study.
///
/// # Errors
/// Those of [`Store::cell`].
pub fn records(study: &Study, store: &Store) -> Result<Vec<Record>, CliError> {
    let mut records = Vec::new();
    for cell in &study.cells {
        // The names in the file may be those of another experiment with the same cell.
        records.extend(store.cell(&cell.key)?.map(|record| Record { cell: cell.clone(), ..record }));
    }
    Ok(records)
}

/// The end of a command that was interrupted, and that goes on from what is kept when it is called again.
///
/// # Errors
/// Those of [`Store::cell`].
pub fn interrupted(study: &Study, store: &Store) -> Result<ExitCode, CliError> {
    let kept = study.cells.len() - open_cells(study, Some(store))?.len();
    eprintln!(
        "interrupted; {kept} of {} cells are done and kept in {}: the same command goes on from there",
        study.cells.len(),
        store.root().file("cells").display()
    );
    Ok(ExitCode::from(INTERRUPTED))
}
