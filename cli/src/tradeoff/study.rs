//! An experiment with everything that it names opened and checked: graphs, scenes, devices, and all of its cells.

use std::{
    fmt::{Display, Write},
    path::Path,
    sync::Arc,
};

use epigraph::{Device, Error, Registry, Samples, Setup};
use epigraph_core::{GraphFile, Node, ParamKind, Problems, Side};
use epigraph_files::{Fingerprint, MOST_DATA};
use epigraph_scenes::Scene;
use epigraph_stages::meaning::SAMPLES;

use super::{
    cell::Cell,
    experiment::{Budget, Experiment, Frames, Over, Placed, Search, Set, tidy},
};
use crate::{args::ChangeArgs, error::CliError, open, values::Light};

/// The most cells of an experiment.
const MOST_CELLS: usize = 100_000;

/// A scene and a camera path through it.
pub struct View {
    /// The scene as the experiment names it.
    pub scene: String,
    /// The path, likewise.
    pub camera: String,
    /// Both, loaded.
    pub place: epigraph::Place,
    /// The scene's fingerprint.
    pub print: Fingerprint,
}

/// A graph with one of the variations.
struct Variation<'e> {
    label: &'e str,
    variant: String,
    params: &'e [Placed<Set>],
    file: GraphFile,
    graph: &'e Placed<super::experiment::Named>,
}

/// A variation of a graph in a view.
#[derive(Clone)]
pub struct Setting {
    /// Its cells, but for budget and seed.
    pub cell: Cell,
    /// The fingerprint of the graph.
    print: Fingerprint,
}

/// A budget that a graph cannot have.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// The graph with the parameters that vary.
    pub graph: String,
    /// The budget as in the experiment.
    pub budget: String,
    /// Why not, and what to do.
    pub why: String,
}

/// What is known of a graph that compiles for a view.
struct Checked {
    /// Light paths of a sample, if a node has them.
    paths: Option<u32>,
    /// The light of samples, with the parameter that says so.
    light: Option<(String, Light)>,
    /// The fingerprint of the graph with its shaders.
    print: Fingerprint,
}

/// A search in a setting.
pub struct Task {
    /// The name of its file.
    pub key: String,
    /// Where.
    pub setting: Setting,
    /// What is searched.
    pub search: Search,
    /// The smallest and the largest value.
    pub range: [f64; 2],
    /// Whether values are whole numbers.
    pub whole: bool,
}

/// A checked experiment.
pub struct Study<'e> {
    /// What the file says.
    pub experiment: &'e Experiment,
    /// The stages.
    pub registry: &'e Arc<Registry>,
    /// The default device of nodes.
    pub device: Device,
    /// Light transport of the references.
    pub mode: Light,
    /// All cells; those of one view follow each other.
    pub cells: Vec<Cell>,
    /// What is left out, in words, with the graph and the budget.
    pub left_out: Vec<LeftOut>,
    /// All searches.
    pub tasks: Vec<Task>,
    settings: Vec<Setting>,
    views: Vec<View>,
    graphs: Vec<(String, GraphFile)>,
    build: Fingerprint,
}

impl<'e> Study<'e> {
    /// Opens and checks everything.
    ///
    /// # Errors
    /// Whatever keeps a cell from being measured on some machine, with its place in the experiment's file.
    pub fn open(experiment: &'e Experiment, registry: &'e Arc<Registry>) -> Result<Self, CliError> {
        let device = Device::open(experiment.backend)?;
        let variations = variations(experiment, registry)?;
        let views = views(experiment)?;
        let per_view = variations.len().saturating_mul(experiment.sizes.len());
        let per_setting = (experiment.budgets.len() * experiment.seeds.len()).max(1);
        let count = views.len().saturating_mul(per_view).saturating_mul(per_setting);
        if count > MOST_CELLS {
            let text =
                format!("the experiment has {count} cells; {MOST_CELLS} are the limit: vary less at a time");
            return Err(CliError::Input(text));
        }
        let (build, cells, tasks, left_out) = (build()?, Vec::new(), Vec::new(), Vec::new());
        let (settings, graphs, mode) = (Vec::new(), Vec::new(), Light::Direct);
        let mut study = Self {
            experiment,
            registry,
            device,
            mode,
            cells,
            left_out,
            tasks,
            settings,
            views,
            graphs,
            build,
        };
        (study.settings, study.mode) = study.all_settings(&variations)?;
        (study.cells, study.left_out) = study.all_cells()?;
        study.tasks = study.all_tasks()?;
        study.graphs = variations.into_iter().map(|variation| (variation.variant, variation.file)).collect();
        Ok(study)
    }

    /// The view of a cell.
    pub fn view(&self, cell: &Cell) -> &View {
        let is = |view: &&View| (&view.scene, &view.camera) == (&cell.scene, &cell.camera);
        self.views.iter().find(is).expect("cells are made of these views")
    }

    /// The settings of a cell's run.
    ///
    /// # Errors
    /// Those of a graph with a value of a search, which has to be opened.
    pub fn setup(&self, cell: &Cell) -> Result<Setup, CliError> {
        let is = |graph: &&(String, GraphFile)| graph.0 == cell.variant;
        let file = match self.graphs.iter().find(is) {
            Some((_, file)) => file.clone(),
            None => open::graph(&cell.variant, &ChangeArgs::default(), self.registry)?,
        };
        let samples = Samples::Count(cell.samples);
        Ok(self.setup_of(&file, self.view(cell), cell.size).samples(samples).seed(cell.seed))
    }

    fn setup_of(&self, file: &GraphFile, view: &View, size: [u32; 2]) -> Setup {
        Setup::new(file.clone())
            .registry(self.registry.clone())
            .at(&view.place)
            .device(&self.device)
            .size(size)
    }

    /// Every graph with every variation in every view, checked; and the light transport of the references, which is
    /// that of all graphs.
    fn all_settings(&self, variations: &[Variation]) -> Result<(Vec<Setting>, Light), Problems> {
        let Experiment { sizes, frames, still, .. } = self.experiment;
        let mut mode = self.experiment.mode;
        let (mut settings, mut problems) = (Vec::new(), Problems::default());
        for view in &self.views {
            let Frames { count, compare } =
                still.as_ref().filter(|_| !view.place.path.moves()).unwrap_or(frames);
            for (size, variation) in sizes.iter().flat_map(|size| variations.iter().map(move |of| (size, of)))
            {
                let problem = |error: &dyn Display| {
                    let first = variation.params.first();
                    first.map_or_else(|| variation.graph.problem(error), |set| set.problem(error))
                };
                match self.check(&variation.file, view, size.value) {
                    Ok(Checked { paths, light, print }) => {
                        if let Some((param, light)) = light {
                            let mode = *mode.get_or_insert(light);
                            if mode != light {
                                problems.add(|| {
                                    problem(&other_light(
                                        &variation.variant,
                                        &param,
                                        light,
                                        mode,
                                        self.experiment.mode.is_some(),
                                    ))
                                });
                            }
                        }
                        let cell = Cell {
                            key: String::new(),
                            graph: variation.label.to_owned(),
                            variant: variation.variant.clone(),
                            params: variation.params.iter().map(|set| set.value.clone()).collect(),
                            scene: view.scene.clone(),
                            camera: view.camera.clone(),
                            size: size.value,
                            frames: *count,
                            compare: compare.clone(),
                            budget: String::new(),
                            samples: 0,
                            paths_per_sample: paths,
                            paths_per_pixel: None,
                            seed: 0,
                        };
                        settings.push(Setting { cell, print });
                    }
                    Err(error) => problems.add(|| problem(&error)),
                }
            }
        }
        // The same problem in several views is one.
        problems.0.dedup();
        problems.into_result()?;
        Ok((settings, mode.unwrap_or(Light::Direct)))
    }

    fn all_cells(&self) -> Result<(Vec<Cell>, Vec<LeftOut>), Problems> {
        let Experiment { budgets, seeds, leaves_out, .. } = self.experiment;
        let (mut cells, mut left_out, mut problems) = (Vec::new(), Vec::new(), Problems::default());
        let of_setting =
            |setting| budgets.iter().map(|budget| self.spend(budget, setting)).collect::<Vec<_>>();
        let all: Vec<Vec<_>> = self.settings.iter().map(of_setting).collect();
        let fits = |nth: usize| all.iter().any(|of_setting| of_setting[nth].is_ok());
        let optional: Vec<bool> = (0..budgets.len()).map(|nth| *leaves_out && fits(nth)).collect();
        for (setting, of_setting) in self.settings.iter().zip(all) {
            for ((budget, is_optional), spent) in budgets.iter().zip(&optional).zip(of_setting) {
                match spent {
                    Ok((setting, samples)) => {
                        let text = budget.value.to_string();
                        cells.extend(seeds.iter().map(|seed| self.cell(&setting, &text, samples, *seed)));
                    }
                    Err(others) if *is_optional => {
                        let (graph, budget) = (setting.cell.variation(), budget.value.to_string());
                        let one = LeftOut { graph, budget, why: others.to_string() };
                        // Once for all views.
                        if !left_out.contains(&one) {
                            left_out.push(one);
                        }
                    }
                    Err(others) => problems.append(others),
                }
            }
        }
        problems.0.dedup();
        problems.into_result()?;
        Ok((cells, left_out))
    }

    /// The samples per frame of a budget, and the setting with as many paths a sample as the experiment's density leaves
    /// for each of them.
    fn spend(&self, budget: &Placed<Budget>, setting: &Setting) -> Result<(Setting, u32), Problems> {
        let mut setting = setting.clone();
        if let Some(density) = self.experiment.density
            && let Budget::PathsPerPixel(per_pixel) = budget.value
            && setting.cell.paths_per_sample.is_some()
        {
            let params = setting.cell.params.clone();
            let paths = (per_pixel / density).round().max(1.0);
            setting = self.with(&setting, "spp", paths).map_err(|error| budget.problem(error))?;
            // It is a part of the budget, and not what varies.
            setting.cell.params = params;
        }
        let samples = samples(budget, &setting.cell)?;
        Ok((setting, samples))
    }

    /// The cell of a setting with this number of samples and this seed.
    pub fn cell(&self, setting: &Setting, budget: &str, samples: u32, seed: u32) -> Cell {
        let [width, height] = setting.cell.size.map(f64::from);
        let paths = |paths| f64::from(samples) * f64::from(paths) / (width * height);
        let mut cell = Cell {
            budget: budget.to_owned(),
            samples,
            paths_per_pixel: setting.cell.paths_per_sample.map(paths),
            seed,
            ..setting.cell.clone()
        };
        cell.key = self.key(&cell, setting.print).to_string();
        cell
    }

    /// Every search in every setting.
    fn all_tasks(&self) -> Result<Vec<Task>, CliError> {
        let mut tasks = Vec::new();
        for setting in &self.settings {
            for search in &self.experiment.searches {
                let mut print = self.key(&setting.cell, setting.print);
                let seeds = &self.experiment.seeds;
                write!(print, " {:?} {seeds:?}", search.value).expect("a fingerprint takes all text");
                let (range, whole) = self.range(setting, search)?;
                let (key, setting, search) = (print.to_string(), setting.clone(), search.value.clone());
                tasks.push(Task { key, setting, search, range, whole });
            }
        }
        Ok(tasks)
    }

    /// The values that a search tries, and whether they are whole numbers.
    fn range(&self, setting: &Setting, search: &Placed<Search>) -> Result<([f64; 2], bool), Problems> {
        match &search.value.over {
            Over::Samples(range) => {
                let [width, height] = setting.cell.size;
                let [from, to] = range.map(|samples| samples.of(setting.cell.size));
                if from > to || to > width * height {
                    let text = format!(
                        "the search is from {from} to {to} samples in an image of {width}x{height}; expected rising \
                         numbers, at most one per pixel"
                    );
                    return Err(search.problem(text).into());
                }
                Ok(([from, to].map(f64::from), true))
            }
            Over::Param { name, range, budget } => {
                let at = |value: f64| self.with(setting, name, value);
                for end in range {
                    let with = at(*end).map_err(|error| search.problem(error))?;
                    samples(budget, &with.cell)?;
                }
                // A parameter that takes both ends, but nothing between whole numbers, has whole numbers.
                let whole = range.iter().all(|end| end.fract() == 0.0) && at(range[0] + 0.5).is_err();
                Ok((*range, whole))
            }
        }
    }

    /// A setting with another value of a parameter.
    fn with(&self, setting: &Setting, name: &str, value: f64) -> Result<Setting, CliError> {
        let mut cell = setting.cell.clone();
        let text = tidy(value, 10);
        cell.variant += &format!("+{name}={text}");
        cell.params.push((name.to_owned(), text));
        let file = open::graph(&cell.variant, &ChangeArgs::default(), self.registry)?;
        let Checked { paths, print, .. } = self.check(&file, self.view(&cell), cell.size)?;
        cell.paths_per_sample = paths;
        Ok(Setting { cell, print })
    }

    /// The setting and the samples per frame at a value of a search.
    ///
    /// # Errors
    /// The parameter does not take the value.
    pub fn at(&self, task: &Task, value: f64) -> Result<(Setting, u32), CliError> {
        match &task.search.over {
            Over::Samples(_) => Ok((task.setting.clone(), value as u32)),
            Over::Param { name, budget, .. } => {
                let setting = self.with(&task.setting, name, value)?;
                let samples = samples(budget, &setting.cell)?;
                Ok((setting, samples))
            }
        }
    }

    /// Compiles a graph for a view.
    fn check(&self, file: &GraphFile, view: &View, size: [u32; 2]) -> Result<Checked, CliError> {
        let compiled = self.setup_of(file, view, size).samples(Samples::Count(1)).compile()?;
        compiled.picture()?;
        // Pictures are compared at the references' exposure.
        open::require_fixed_exposure(compiled.graph())?;
        let full = file.full(self.registry, Path::new(""))?;
        let mut print = Fingerprint::default();
        print.take(full.as_bytes());
        for shader in compiled.graph().nodes.iter().filter_map(|node| node.declaration().shader.as_ref()) {
            print.take(shader.source.as_bytes());
        }
        let nodes = &compiled.graph().nodes;
        Ok(Checked { paths: nodes.iter().find_map(paths_of), light: nodes.iter().find_map(light_of), print })
    }

    /// The fingerprint of everything that a cell's errors depend on.
    fn key(&self, cell: &Cell, graph: Fingerprint) -> Fingerprint {
        let (Experiment { spp, metrics, change, .. }, mode) = (self.experiment, self.mode);
        let view = self.view(cell);
        let mut print = view.print;
        let adapter =
            self.device.gpu.as_ref().filter(|_| self.device.side == Side::Gpu).map(|gpu| gpu.name());
        let path = &view.place.path;
        let Cell { size, frames, compare, samples, seed, .. } = cell;
        write!(
            print,
            " {} {graph} {} {path:?} {adapter:?} {size:?} {frames} {compare:?} {change:?} {samples} {seed} {spp} \
             {mode:?} {metrics:?}",
            self.build, self.device.side
        )
        .expect("a fingerprint takes all text");
        print
    }
}

/// All graphs with all variations, opened.
fn variations<'e>(experiment: &'e Experiment, registry: &Registry) -> Result<Vec<Variation<'e>>, CliError> {
    let (mut all, mut problems): (Vec<Variation>, _) = (Vec::new(), Problems::default());
    for graph in &experiment.graphs {
        let named = &graph.value;
        let base = match open::graph(&named.variant, &ChangeArgs::default(), registry) {
            Ok(base) => base,
            Err(error) => {
                problems.add(|| graph.problem(error));
                continue;
            }
        };
        if let Some(other) =
            all.iter().find(|other| other.label == named.label && other.graph.value.variant != named.variant)
        {
            let text = format!(
                "two graphs are called `{}`; give one another name: (graph: {:?}, name: \"...\")",
                other.label, named.variant
            );
            problems.add(|| graph.problem(text));
            continue;
        }
        for params in &experiment.variations {
            let sets = params.iter().map(|set| format!("+{}={}", set.value.0, set.value.1));
            let variant = named.variant.clone() + &sets.collect::<String>();
            if all.iter().any(|other| other.variant == variant && other.label == named.label) {
                continue;
            }
            let file = if params.is_empty() {
                Ok(base.clone())
            } else {
                open::graph(&variant, &ChangeArgs::default(), registry)
            };
            match file {
                Ok(file) => all.push(Variation { label: &named.label, variant, params, file, graph }),
                // The last one that was added: those before it are in other variations, too.
                Err(error) => problems
                    .add(|| params.last().map_or_else(|| graph.problem(&error), |set| set.problem(&error))),
            }
        }
    }
    problems.0.dedup();
    problems.into_result()?;
    Ok(all)
}

/// Every scene with every camera path.
fn views(experiment: &Experiment) -> Result<Vec<View>, CliError> {
    let (mut views, mut problems): (Vec<View>, _) = (Vec::new(), Problems::default());
    for scene in &experiment.scenes {
        // All camera paths share the tracer and the shadow edges that stages cache.
        let mut shared: Option<(epigraph::Place, Fingerprint)> = None;
        for camera in &experiment.cameras {
            let (name, path) = (&scene.value, &camera.value);
            if views.iter().any(|view| (&view.scene, &view.camera) == (name, path)) {
                continue;
            }
            let place = match &shared {
                Some((place, _)) => place.along(path).map_err(|error| camera.problem(error).into()),
                None => open::place(name, path).map_err(|error| match error {
                    CliError::Run(Error::Path(error)) => camera.problem(error).into(),
                    error => Problems::from(scene.problem(error)),
                }),
            };
            match place.and_then(|place| with_surfaces(scene, place)) {
                Ok(place) => {
                    let print =
                        shared.take().map_or_else(|| Scene::fingerprint(&place.scene), |(_, print)| print);
                    shared = Some((place.clone(), print));
                    views.push(View { scene: name.clone(), camera: path.clone(), place, print });
                }
                Err(others) => problems.append(others),
            }
        }
    }
    problems.0.dedup();
    problems.into_result()?;
    Ok(views)
}

fn with_surfaces(scene: &Placed<String>, place: epigraph::Place) -> Result<epigraph::Place, Problems> {
    match place.scene.has_only_points() {
        true => Err(scene
            .problem(format!("`{}` has points and no surfaces to trace rays to", scene.value))
            .into()),
        false => Ok(place),
    }
}

/// A parameter of a node that takes samples, and its value in the uniform.
fn source_param(node: &Node, name: &str) -> Option<(ParamKind, u32)> {
    let is_source = |port: &epigraph_core::Port| port.is_output() && port.meaning == Some(SAMPLES);
    node.declaration().ports.iter().find(|port| is_source(port))?;
    let mut specs = node.stage.specs();
    specs.retain(|spec| spec.kind.scalar().is_some());
    let nth = specs.iter().position(|spec| spec.name == name)?;
    Some((specs.swap_remove(nth).kind, *node.stage.words().get(nth)?))
}

/// The light paths of a sample, if a node that takes samples has such a parameter.
fn paths_of(node: &Node) -> Option<u32> {
    source_param(node, "spp").map(|(_, paths)| paths)
}

/// The light that samples have, if a node that takes samples has such a parameter, with its name.
fn light_of(node: &Node) -> Option<(String, Light)> {
    let (ParamKind::Choice(names), chosen) = source_param(node, "mode")? else { return None };
    let light =
        Light::ALL.into_iter().find(|light| names.get(chosen as usize) == Some(&light.to_string()))?;
    Some((format!("{}.mode", node.name), light))
}

/// That a graph's samples have other light than the references. `given`: the experiment says which those have.
fn other_light(variant: &str, param: &str, light: Light, mode: Light, given: bool) -> String {
    let (whose, instead) = if given {
        ("the references have", "leave the mode of the references out, which is then that of the graphs")
    } else {
        ("graphs before it with", "measure it in a run of its own")
    };
    format!(
        "`{variant}` takes samples with {param}={light}, but {whose} mode {mode}: the light that only one of them has would \
         count as an error; add `+{param}={mode}` to the graph (`--set {param}={mode}` to all), or {instead}"
    )
}

/// The samples per frame of a budget in a setting.
fn samples(budget: &Placed<Budget>, cell: &Cell) -> Result<u32, Problems> {
    let Cell { size, paths_per_sample: paths, variant, .. } = cell;
    let (image, pixels) = (format!("an image of {}x{}", size[0], size[1]), size[0] * size[1]);
    let of_paths = match paths {
        None => String::new(),
        Some(1) => " of 1 path".into(),
        Some(paths) => format!(" of {paths} paths"),
    };
    let samples = match budget.value {
        Budget::Samples(samples) => f64::from(samples.of(*size)),
        Budget::PathsPerPixel(per_pixel) => {
            let Some(paths) = paths else {
                let text = format!(
                    "`{variant}` has no node with samples and a parameter `spp`; state the budget in samples, such as 5%"
                );
                return Err(budget.problem(text).into());
            };
            per_pixel * f64::from(pixels) / f64::from(*paths)
        }
    };
    if samples < 1.0 {
        let text = format!(
            "{} is less than one sample{of_paths} in {image}: state a larger budget, or give `{variant}` fewer paths a \
             sample (`spp`)",
            budget.value
        );
        return Err(budget.problem(text).into());
    }
    let samples = samples.round();
    if samples > f64::from(pixels) {
        let less = match budget.value {
            Budget::Samples(_) => String::new(),
            Budget::PathsPerPixel(_) => {
                format!(": state a smaller budget, or give `{variant}` more paths a sample (`spp`)")
            }
        };
        let text = format!(
            "{} is {samples} samples{of_paths}, more than one per pixel; {image} has {pixels} pixels{less}",
            budget.value
        );
        return Err(budget.problem(text).into());
    }
    Ok(samples as u32)
}

/// The fingerprint of this program: another build may compute other pictures.
fn build() -> Result<Fingerprint, CliError> {
    let path = std::env::current_exe()
        .map_err(|error| CliError::Input(format!("the program's own file: {error}")))?;
    let bytes = epigraph_files::bytes(&path, MOST_DATA).map_err(|error| CliError::read(&path, error))?;
    let mut print = Fingerprint::default();
    print.take(&bytes);
    Ok(print)
}

#[cfg(test)]
mod tests {
    use epigraph_core::Place;

    use super::*;
    use crate::tradeoff::cell::tests::cell;

    fn budget(value: Budget) -> Placed<Budget> {
        Placed { value, place: Some(Place::file("t.ron")) }
    }

    #[test]
    fn budgets_become_samples() {
        let of = |value, paths_per_sample| {
            samples(&budget(value), &Cell { paths_per_sample, size: [100, 50], ..cell("mine", 0, 1) })
        };
        assert_eq!(of(Budget::Samples(Samples::Share(0.05)), None), Ok(250));
        // 0.2 x 5000 pixels / 4 paths.
        assert_eq!(of(Budget::PathsPerPixel(0.2), Some(4)), Ok(250));
        assert_eq!(
            (of(Budget::PathsPerPixel(4.0), Some(4)), of(Budget::PathsPerPixel(2e-4), Some(1))),
            (Ok(5000), Ok(1))
        );
        let text = |value, paths| of(value, paths).unwrap_err().to_string();
        assert_eq!(
            text(Budget::PathsPerPixel(8.0), Some(4)),
            "t.ron: 8 paths/pixel is 10000 samples of 4 paths, more than one per pixel; an image of 100x50 has 5000 \
             pixels: state a smaller budget, or give `mine` more paths a sample (`spp`)"
        );
        assert_eq!(
            text(Budget::PathsPerPixel(1e-4), Some(1)),
            "t.ron: 0.0001 paths/pixel is less than one sample of 1 path in an image of 100x50: state a larger budget, \
             or give `mine` fewer paths a sample (`spp`)"
        );
        assert!(text(Budget::PathsPerPixel(1.0), None).contains("`mine` has no node with samples"));
        assert!(
            text(Budget::Samples(Samples::Count(5001)), None).contains("5001 is 5001 samples, more than")
        );
    }
}
