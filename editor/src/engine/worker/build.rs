//! Compiling a graph file into a running graph.

use std::{
    collections::HashMap,
    sync::{Arc, PoisonError},
};

use epigraph::{Device, Setup};
use epigraph_core::{EditedTexts, GraphFile, Problems};

use super::{ReadShaders, Worker, samples};
use crate::engine::running::{Running, Taps, problems};

/// How the running graph must be rebuilt, if at all.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Rebuild {
    No,
    /// Compile the same graph again, to capture other ports.
    Taps,
    /// Compile again and keep the contents of persistent and history storages.
    Keep,
    /// Compile again and start from frame 0.
    Afresh,
}

impl Worker {
    /// Compiles the last given file. If that fails, recompiles the last good one with the current settings.
    pub(super) fn build(&mut self) {
        let mut rebuild = std::mem::replace(&mut self.rebuild, Rebuild::No);
        if self.afresh {
            rebuild = Rebuild::Afresh;
        }
        self.afresh = rebuild == Rebuild::Afresh;
        // A user who only watches other ports may not have read the message yet.
        if !self.lost && rebuild > Rebuild::Taps {
            self.state.trouble = None;
        }
        self.state.problems = Vec::new();
        self.rebuild_other(rebuild);
        let newest = self.file.clone().map(|file| (file, self.shaders.clone()));
        // If none has compiled yet, the last good shaders are those in the files and the embedded ones.
        let as_built = || Some((self.file.clone()?, Arc::default()));
        let last = self.good.clone().or_else(as_built);
        for (file, shaders) in [newest, last].into_iter().flatten() {
            *self.read.lock().unwrap_or_else(PoisonError::into_inner) = shaders.clone();
            let taps = self.taps();
            match self.compile(&file, taps) {
                Ok(made) => {
                    self.good = Some((file, shaders));
                    self.afresh = false;
                    self.replace(made, rebuild);
                    return;
                }
                // Report the problems of the newest file only.
                Err(problems) if self.state.problems.is_empty() => self.state.problems = problems.0,
                Err(_) => {}
            }
        }
    }

    pub(super) fn compile(&mut self, file: &GraphFile, taps: Taps) -> Result<Running, Problems> {
        let device = Device::reopen(self.options.backend, self.gpu.clone()).map_err(problems)?;
        let setup = Setup::new(file.clone())
            .registry(self.registry.clone())
            .at(&self.place)
            .host(self.host.clone())
            .live()
            .size(self.options.size)
            .samples(samples(self.options.samples))
            .seed(self.options.seed)
            .watch(self.options.guarded)
            .device(&device);
        let made = Running::new(setup, taps)?;
        self.gpu = made.run.gpu().cloned().or(device.gpu);
        Ok(made)
    }

    /// Makes a graph the running one, with the kept storages of the previous one.
    fn replace(&mut self, mut made: Running, rebuild: Rebuild) {
        self.stopped = false;
        if rebuild == Rebuild::Afresh {
            self.running = None;
            self.before = None;
            self.index = 0;
            self.shown = None;
            self.state.frames = 0;
            if self.path.is_none() {
                self.state.playing = None;
            }
            // Samples requested before the reset that are still being traced belong to no frame.
            self.renew_host();
        }
        // A graph that has not run a frame has written nothing, so inherit from the one before it.
        let old = match (self.running.take(), self.before.take()) {
            (Some(running), _) if running.run.executor.frames() > 0 => Some(running),
            (running, before) => before.or(running),
        };
        if let Some(mut old) = old {
            made.is_timed = rebuild == Rebuild::Taps && old.is_timed;
            if let Err(error) = made.run.executor.inherit(&mut old.run.executor) {
                self.state.trouble = Some(format!("the cloud could not be kept: {error}"));
            }
            self.before = Some(old);
        }
        self.run_graph(made);
    }

    pub(super) fn run_graph(&mut self, mut running: Running) {
        running.run.set_host(self.host.clone());
        // Until a frame has run, show the steps' times in the previous graph.
        let known = self.state.graph.iter().flat_map(|graph| &graph.steps).zip(&self.state.times);
        let known: HashMap<&str, f32> = known.map(|(step, ms)| (step.name.as_str(), *ms)).collect();
        let steps = running.info.steps.iter();
        let times = steps.map(|step| known.get(step.name.as_str()).copied().unwrap_or_default()).collect();
        self.state.times = times;
        self.state.graph = Some(running.info.clone());
        self.running = Some(running);
        self.capture = None;
    }
}

/// Edited shader texts, which override the shader files.
pub fn edited(read: &ReadShaders) -> EditedTexts {
    let read = read.clone();
    EditedTexts::new(move |path| read.lock().unwrap_or_else(PoisonError::into_inner).get(path).cloned())
}
