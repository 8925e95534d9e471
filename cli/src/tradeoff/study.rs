//! An experiment with everything that it names opened and checked: graphs, scenes, devices, and all of its cells.

use std::{fmt::Write, path::Path, sync::Arc};

use epigraph::{Device, Error, Registry, Samples, Setup};
use epigraph_core::{GraphFile, Node, Problems, Side};
use epigraph_files::{Fingerprint, MOST_DATA};
use epigraph_scenes::Scene;
use epigraph_stages::meaning::SAMPLES;

use super::{
    cell::Cell,
    experiment::{Budget, Experiment, Placed, Set},
    references::way,
};
use crate::{args::ChangeArgs, error::CliError, open};

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

/// A checked experiment.
pub struct Study<'e> {
    /// What the file says.
    pub experiment: &'e Experiment,
    /// The stages.
    pub registry: &'e Arc<Registry>,
    /// The default device of nodes.
    pub device: Device,
    /// All cells; those of one view follow each other.
    pub cells: Vec<Cell>,
    views: Vec<View>,
    graphs: Vec<(String, GraphFile)>,
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
        let mut study = Self { experiment, registry, device, cells: Vec::new(), views, graphs: Vec::new() };
        study.cells = study.all_cells(&variations)?;
        study.graphs = variations.into_iter().map(|variation| (variation.variant, variation.file)).collect();
        Ok(study)
    }

    /// The view of a cell.
    pub fn view(&self, cell: &Cell) -> &View {
        let is = |view: &&View| (&view.scene, &view.camera) == (&cell.scene, &cell.camera);
        self.views.iter().find(is).expect("cells are made of these views")
    }

    /// The settings of a cell's run.
    pub fn setup(&self, cell: &Cell) -> Setup {
        let is = |graph: &&(String, GraphFile)| graph.0 == cell.variant;
        let (_, file) = self.graphs.iter().find(is).expect("cells are made of these graphs");
        let samples = Samples::Count(cell.samples);
        self.setup_of(file, self.view(cell), cell.size).samples(samples).seed(cell.seed)
    }

    fn setup_of(&self, file: &GraphFile, view: &View, size: [u32; 2]) -> Setup {
        Setup::new(file.clone())
            .registry(self.registry.clone())
            .at(&view.place)
            .device(&self.device)
            .size(size)
    }

    fn all_cells(&self, variations: &[Variation]) -> Result<Vec<Cell>, CliError> {
        let Experiment { sizes, frames, compare, budgets, seeds, .. } = self.experiment;
        let count = [self.views.len(), sizes.len(), variations.len(), budgets.len(), seeds.len()];
        let count: usize = count.into_iter().fold(1, usize::saturating_mul);
        if count > MOST_CELLS {
            let text =
                format!("the experiment has {count} cells; {MOST_CELLS} are the limit: vary less at a time");
            return Err(CliError::Input(text));
        }
        let build = build()?;
        let (mut cells, mut problems) = (Vec::new(), Problems::default());
        for view in &self.views {
            for size in sizes {
                for variation in variations {
                    let (paths, print) = match self.check(variation, view, size.value) {
                        Ok(checked) => checked,
                        Err(others) => {
                            problems.append(others);
                            continue;
                        }
                    };
                    for budget in budgets {
                        let samples = match samples(budget, size.value, paths, &variation.variant) {
                            Ok(samples) => samples,
                            Err(others) => {
                                problems.append(others);
                                continue;
                            }
                        };
                        let pixels = f64::from(size.value[0]) * f64::from(size.value[1]);
                        for &seed in seeds {
                            let mut cell = Cell {
                                key: String::new(),
                                graph: variation.label.to_owned(),
                                variant: variation.variant.clone(),
                                params: variation.params.iter().map(|set| set.value.clone()).collect(),
                                scene: view.scene.clone(),
                                camera: view.camera.clone(),
                                size: size.value,
                                frames: *frames,
                                compare: compare.clone(),
                                budget: budget.value.to_string(),
                                samples,
                                paths_per_pixel: paths.map(|paths| f64::from(samples * paths) / pixels),
                                seed,
                            };
                            cell.key = self.key(&cell, view, build, print);
                            cells.push(cell);
                        }
                    }
                }
            }
        }
        // The same problem in several views is one.
        problems.0.dedup();
        problems.into_result()?;
        Ok(cells)
    }

    /// Compiles a graph for a view. Returns the light paths of a sample, if a node has them, and a fingerprint of the graph
    /// with its shaders.
    fn check(
        &self,
        variation: &Variation,
        view: &View,
        size: [u32; 2],
    ) -> Result<(Option<u32>, Fingerprint), Problems> {
        let of_graph = |error: Error| {
            let problem = variation.params.first().map(|set| set.problem(&error));
            Problems::from(problem.unwrap_or_else(|| variation.graph.problem(&error)))
        };
        let setup = self.setup_of(&variation.file, view, size).samples(Samples::Count(1));
        let compiled = setup.compile().map_err(of_graph)?;
        compiled.picture().map_err(of_graph)?;
        // Pictures are compared at the references' exposure.
        if let Err(error) = open::require_fixed_exposure(compiled.graph()) {
            return Err(of_graph(Error::Input(error.to_string())));
        }
        let full = variation.file.full(self.registry, Path::new(""));
        let full = full.map_err(|problems| of_graph(problems.into()))?;
        let mut print = Fingerprint::default();
        print.take(full.as_bytes());
        for shader in compiled.graph().nodes.iter().filter_map(|node| node.declaration().shader.as_ref()) {
            print.take(shader.source.as_bytes());
        }
        Ok((compiled.graph().nodes.iter().find_map(paths_of), print))
    }

    /// The fingerprint of everything that a cell's errors depend on.
    fn key(&self, cell: &Cell, view: &View, build: Fingerprint, graph: Fingerprint) -> String {
        let Experiment { spp, mode, metrics, .. } = self.experiment;
        let mut print = view.print;
        way(&mut print, &view.place, cell.frames);
        let adapter =
            self.device.gpu.as_ref().filter(|_| self.device.side == Side::Gpu).map(|gpu| gpu.name());
        let Cell { size, frames, compare, samples, seed, .. } = cell;
        write!(
            print,
            " {build} {graph} {} {adapter:?} {size:?} {frames} {compare:?} {samples} {seed} {spp} {mode:?} {metrics:?}",
            self.device.side
        )
        .expect("a fingerprint takes all text");
        print.to_string()
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

/// The light paths of a sample, if a node that takes samples has such a parameter.
fn paths_of(node: &Node) -> Option<u32> {
    let is_source = |port: &epigraph_core::Port| port.is_output() && port.meaning == Some(SAMPLES);
    node.declaration().ports.iter().find(|port| is_source(port))?;
    let specs = node.stage.specs();
    let in_words = specs.iter().filter(|spec| spec.kind.scalar().is_some());
    let nth = in_words.clone().position(|spec| spec.name == "spp")?;
    node.stage.words().get(nth).copied()
}

/// The samples per frame of a budget.
fn samples(
    budget: &Placed<Budget>,
    size: [u32; 2],
    paths: Option<u32>,
    variant: &str,
) -> Result<u32, Problems> {
    let pixels = size[0] * size[1];
    let samples = match budget.value {
        Budget::Samples(samples) => samples.of(size),
        Budget::PathsPerPixel(per_pixel) => {
            let Some(paths) = paths else {
                let text = format!(
                    "`{variant}` has no node with samples and a parameter `spp`; state the budget as Samples(\"5%\")"
                );
                return Err(budget.problem(text).into());
            };
            let samples = (per_pixel * f64::from(pixels) / f64::from(paths)).round();
            samples.clamp(1.0, f64::from(u32::MAX)) as u32
        }
    };
    if samples > pixels {
        let per_sample = paths.map_or(String::new(), |paths| format!(" of {paths} paths"));
        let text = format!(
            "{} is {samples} samples{per_sample}, more than one per pixel; an image of {}x{} has {pixels} pixels",
            budget.value, size[0], size[1]
        );
        return Err(budget.problem(text).into());
    }
    Ok(samples)
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

    fn budget(value: Budget) -> Placed<Budget> {
        Placed { value, place: Place::file("t.ron") }
    }

    #[test]
    fn budgets_become_samples() {
        let of = |value, paths| samples(&budget(value), [100, 50], paths, "mine");
        assert_eq!(of(Budget::Samples(Samples::Share(0.05)), None), Ok(250));
        // 0.2 x 5000 pixels / 4 paths.
        assert_eq!(of(Budget::PathsPerPixel(0.2), Some(4)), Ok(250));
        assert_eq!(of(Budget::PathsPerPixel(1e-9), Some(4)), Ok(1));
        let text = |value, paths| of(value, paths).unwrap_err().to_string();
        assert_eq!(
            text(Budget::PathsPerPixel(8.0), Some(4)),
            "t.ron: 8 paths/pixel is 10000 samples of 4 paths, more than one per pixel; an image of 100x50 has 5000 pixels"
        );
        assert!(text(Budget::PathsPerPixel(1.0), None).contains("`mine` has no node with samples"));
        assert!(
            text(Budget::Samples(Samples::Count(5001)), None).contains("5001 is 5001 samples, more than")
        );
    }
}
