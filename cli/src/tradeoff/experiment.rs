//! Experiment files: what to measure. Every problem has its line and column.

mod fields;
mod reader;

use std::{fmt, path::Path};

use epigraph::{Backend, Samples};
use epigraph_core::{GraphError, Place, Problem, Problems, ron_problem};

use self::{
    fields::Fields,
    reader::{Reader, options},
};
use super::figure::{Cost, Metric};
use crate::{error::CliError, values::Light};

/// A value and its place in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed<T> {
    /// The value.
    pub value: T,
    /// Its place; `None` of what no file says.
    pub place: Option<Place>,
}

impl<T> Placed<T> {
    /// A problem with it.
    pub fn problem(&self, what: impl ToString) -> Problem {
        let problem = Problem::new(GraphError::Invalid(what.to_string()));
        self.place.clone().into_iter().fold(problem, Problem::at)
    }
}

/// A graph and the name that the results give it.
#[derive(Clone, Debug)]
pub struct Named {
    /// The name.
    pub label: String,
    /// The graph, with its changes: `epi+sigma=0.5`.
    pub variant: String,
}

/// The number of samples per frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// A count, or a share of the pixels.
    Samples(Samples),
    /// Light paths per pixel and frame: samples times the graph's paths per sample, by the pixels.
    PathsPerPixel(f64),
}

impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Samples(samples) => write!(f, "{samples}"),
            Self::PathsPerPixel(paths) => write!(f, "{paths} paths/pixel"),
        }
    }
}

/// The frames of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// How many run.
    pub count: u32,
    /// Those that are compared, ascending.
    pub compare: Vec<u32>,
}

/// What a search reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// An equal error.
    Metric(Metric),
    /// An equal time.
    Cost(Cost),
}

impl Goal {
    /// The column of its figures.
    pub fn column(self) -> &'static str {
        match self {
            Self::Metric(metric) => metric.column(),
            Self::Cost(cost) => cost.column(),
        }
    }
}

/// What a search varies.
#[derive(Clone, Debug, PartialEq)]
pub enum Over {
    /// The samples per frame, from the fewest to the most to try.
    Samples([Samples; 2]),
    /// A parameter.
    Param {
        /// Its name, as in `vary`.
        name: String,
        /// The smallest and the largest value to try.
        range: [f64; 2],
        /// The samples per frame.
        budget: Placed<Budget>,
    },
}

impl Over {
    /// Its name in the results.
    pub fn name(&self) -> &str {
        match self {
            Self::Samples(_) => "samples",
            Self::Param { name, .. } => name,
        }
    }
}

/// A search for what makes a figure reach a target.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    /// The figure.
    pub goal: Goal,
    /// What it is to be.
    pub target: f64,
    /// What is varied.
    pub over: Over,
}

/// A parameter with a value, as RON text.
pub type Set = (String, String);

/// A checked experiment.
#[derive(Debug)]
pub struct Experiment {
    /// What it is about.
    pub doc: String,
    /// The graphs.
    pub graphs: Vec<Placed<Named>>,
    /// The scenes by name or file.
    pub scenes: Vec<Placed<String>>,
    /// The camera paths.
    pub cameras: Vec<Placed<String>>,
    /// Width and height of images in pixels.
    pub sizes: Vec<Placed<[u32; 2]>>,
    /// The frames.
    pub frames: Frames,
    /// Those of a camera that stands still, if they are others.
    pub still: Option<Frames>,
    /// The frame in which the camera or the scene changes abruptly. All frames from there on are compared.
    pub change: Option<u32>,
    /// Samples per frame.
    pub budgets: Vec<Placed<Budget>>,
    /// The share of the pixels that get a sample, if paths per sample follow from it and the budget; `None`: they are the
    /// graphs' own.
    pub density: Option<f64>,
    /// Whether a budget is left out for graphs that cannot have it, as long as others can. Else it is a problem.
    pub leaves_out: bool,
    /// The parameters of each variation of a graph; one of them may be the graph unchanged.
    pub variations: Vec<Vec<Placed<Set>>>,
    /// Searches, in every view with every variation.
    pub searches: Vec<Placed<Search>>,
    /// Random seeds: each is a repetition.
    pub seeds: Vec<u32>,
    /// The metrics, without duplicates. The first one is plotted.
    pub metrics: Vec<Metric>,
    /// The costs over which errors are plotted.
    pub costs: Vec<Cost>,
    /// Samples per pixel of the references.
    pub spp: u32,
    /// Light transport of the references; `None`: that of the graphs' samples.
    pub mode: Option<Light>,
    /// Default placement of nodes.
    pub backend: Backend,
}

impl Experiment {
    /// Reads a file; `quick` selects its quick form.
    ///
    /// # Errors
    /// All problems of the file. Graphs, scenes and cameras are not yet looked up.
    pub fn read(path: &Path, quick: bool) -> Result<Self, CliError> {
        let text = epigraph_files::text(path).map_err(|error| CliError::read(path, error))?;
        Ok(Self::parse(&path.display().to_string(), &text, quick)?)
    }

    fn parse(path: &str, text: &str, quick: bool) -> Result<Self, Problems> {
        let mut reader = Reader { path, text, problems: Problems::default() };
        let fields: Fields = options().from_str(text).map_err(|error| ron_problem(path, text, 0, &error))?;
        let experiment = reader.experiment(fields, quick);
        reader.problems.into_result()?;
        Ok(experiment)
    }
}

/// A number in so many digits, without the rounding errors of sums; a whole one without a point, as whole parameters
/// need.
pub fn tidy(value: f64, digits: usize) -> String {
    let rounded: f64 = format!("{value:.*e}", digits - 1).parse().expect("a number was formatted");
    rounded.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(fields: &str) -> Result<Experiment, String> {
        let text = format!("Tradeoff(version: 1, graphs: [\"epi\"], scenes: [\"cornell\"],\n{fields})");
        Experiment::parse("t.ron", &text, false).map_err(|problems| problems.to_string())
    }

    fn sets(experiment: &Experiment) -> Vec<String> {
        let text = |sets: &Vec<Placed<Set>>| {
            sets.iter().map(|set| format!("{}={}", set.value.0, set.value.1)).collect::<Vec<_>>().join(" ")
        };
        experiment.variations.iter().map(text).collect()
    }

    #[test]
    fn what_is_left_out_has_defaults() {
        let experiment = parse("").unwrap();
        assert_eq!((experiment.frames.count, experiment.frames.compare), (30, vec![29]));
        assert_eq!((experiment.spp, experiment.mode), (256, None));
        assert_eq!((experiment.sizes[0].value, experiment.seeds), ([256, 256], vec![1]));
        assert_eq!((experiment.metrics.len(), experiment.variations.len()), (Metric::ALL.len(), 1));
    }

    #[test]
    fn all_frames_from_a_change_on_are_compared() {
        let experiment = parse("frames: 30, change: 20").unwrap();
        assert_eq!((experiment.change, experiment.frames.compare), (Some(20), (20..30).collect()));
    }

    #[test]
    fn parameters_vary_as_a_grid_or_one_at_a_time() {
        let vary = "{ \"a.b\": [Best, \"x\"], \"c\": Range(from: 2, to: 8, step: 3) }";
        let grid = parse(&format!("vary: Grid({vary})")).unwrap();
        let all = [
            "a.b=Best c=2",
            "a.b=Best c=5",
            "a.b=Best c=8",
            "a.b=\"x\" c=2",
            "a.b=\"x\" c=5",
            "a.b=\"x\" c=8",
        ];
        assert_eq!(sets(&grid), all);
        let one = parse(&format!("vary: OneAtATime({vary})")).unwrap();
        assert_eq!(sets(&one), ["", "a.b=Best", "a.b=\"x\"", "c=2", "c=5", "c=8"]);
        let tenths = parse("vary: Grid({ \"a\": Range(from: 0.1, to: 0.3, step: 0.1) })").unwrap();
        assert_eq!(sets(&tenths), ["a=0.1", "a=0.2", "a=0.3"]);
    }

    #[test]
    fn graphs_have_names_and_changes() {
        let text = "Tradeoff(version: 1, scenes: [\"room\"], graphs: [
            \"graphs/epi.ron\", (graph: \"epi\", name: \"4 bits\", set: { \"subpixel_bits\": 4 }),
            (graph: \"epi\", set: { \"a.b\": C }),
        ], quick: (frames: 3), frames: 9)";
        let experiment = Experiment::parse("t.ron", text, true).unwrap();
        let named: Vec<_> = experiment.graphs.iter().map(|graph| &graph.value).collect();
        let pairs: Vec<_> =
            named.iter().map(|named| (named.label.as_str(), named.variant.as_str())).collect();
        assert_eq!(
            pairs,
            [("epi", "graphs/epi.ron"), ("4 bits", "epi+subpixel_bits=4"), ("epi+a.b=C", "epi+a.b=C")]
        );
        assert_eq!(experiment.frames, Frames { count: 3, compare: vec![2] });
    }

    #[test]
    fn budgets_are_written_as_on_the_command_line() {
        let experiment = parse("budgets: [Samples(\"5%\"), Samples(300), PathsPerPixel(0.2)]").unwrap();
        let texts: Vec<String> = experiment.budgets.iter().map(|budget| budget.value.to_string()).collect();
        assert_eq!(texts, ["5%", "300", "0.2 paths/pixel"]);
    }

    #[test]
    fn damaged_experiments_are_refused_or_read() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/tradeoffs");
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let files: Vec<_> = files.filter(|path| path.is_file()).collect();
        let seeds: Vec<String> = files.iter().map(|path| std::fs::read_to_string(path).unwrap()).collect();
        let mut random = epigraph_core::testing::Random(3);
        let (mut read, mut refused) = (0, 0);
        for nth in 0..3000 {
            let mut text: Vec<char> = seeds[nth % seeds.len()].chars().collect();
            for _ in 0..1 + random.below(3) {
                let at = random.below(text.len() as u32) as usize;
                let end = (at + random.below(12) as usize).min(text.len());
                match random.below(4) {
                    0 => drop(text.drain(at..end)),
                    1 => {
                        let copy: Vec<char> = text[at..end].to_vec();
                        let to = random.below(text.len() as u32) as usize;
                        text.splice(to..to, copy);
                    }
                    2 => {
                        text[at] = ['(', ')', '[', ']', '{', '}', '"', ',', ':', '9', '-', '\u{e9}']
                            [random.below(12) as usize]
                    }
                    _ => {
                        let last = text.len() - 1;
                        text.swap(at, end.min(last));
                    }
                }
                if text.is_empty() {
                    text.push(' ');
                }
            }
            let text: String = text.into_iter().collect();
            match Experiment::parse("t.ron", &text, nth % 2 == 0) {
                Ok(_) => read += 1,
                Err(problems) => {
                    refused += 1;
                    assert!(problems.to_string().starts_with("t.ron:"), "{problems}");
                }
            }
        }
        assert!(read > 100 && refused > 100, "{read} are read, {refused} refused");
    }

    #[test]
    fn searches_need_no_budgets() {
        let text = "seeds: [1, 2, 3], search: [
            Search(metric: Psnr, target: 30, over: Samples), (cost: TotalMs, target: 9, to: \"50%\"),
        ]";
        let experiment = parse(text).unwrap();
        let [first, second] = &experiment.searches[..] else { panic!("{experiment:?}") };
        let all = Over::Samples([Samples::Share(0.001), Samples::Share(1.0)]);
        assert_eq!(first.value, Search { goal: Goal::Metric(Metric::Psnr), target: 30.0, over: all });
        let half = Over::Samples([Samples::Share(0.001), Samples::Share(0.5)]);
        assert_eq!(second.value, Search { goal: Goal::Cost(Cost::TotalMs), target: 9.0, over: half });
        assert!(experiment.budgets.is_empty());
    }

    #[test]
    fn searches_are_over_samples_or_a_parameter() {
        let text = "seeds: [1, 2, 3], search: [Search(metric: Flip, target: 0.1, over: Param(\"cull.threshold\"), \
                    from: 0, to: 0.5, budget: PathsPerPixel(0.2))]";
        let experiment = parse(text).unwrap();
        let Over::Param { name, range, budget } = &experiment.searches[0].value.over else {
            panic!("{experiment:?}")
        };
        assert_eq!((name.as_str(), *range), ("cull.threshold", [0.0, 0.5]));
        assert_eq!(budget.value, Budget::PathsPerPixel(0.2));
    }

    #[test]
    fn problems_have_places_and_say_what_to_do() {
        for (fields, wanted) in [
            ("sceens: []", "t.ron:2:1: unknown field `sceens`, did you mean `scenes`?"),
            ("metrics: [Flip, Relmse]", "t.ron:2:17: unknown name `Relmse`, did you mean `RelMse`?"),
            ("budgets: [Sample(\"5%\")]", "t.ron:2:11: unknown name `Sample`, did you mean `Samples`?"),
            (
                "budgets: [Samples(\"0%\")]",
                "t.ron:2:20: expected the number of samples per frame: a count from 1",
            ),
            ("budgets: [PathsPerPixel(0)]", "t.ron:2:11: 0 paths per pixel; expected a number above 0"),
            (
                "frames: 10, compare: [9, 10]",
                "t.ron:2:26: frame 10 does not run; with frames: 10, they are 0 to 9",
            ),
            ("frames: 30, change: 23", "t.ron:2:21: a change in frame 23 of 30; at least 8 frames must run"),
            ("change: 9, compare: [9]", "t.ron:2:21: leave `compare` out: with `change`, all frames"),
            ("change: 9, metrics: [Latency]", "t.ron:2:21: add Flip, from which Latency is measured"),
            ("metrics: [Flip, Latency]", "t.ron:2:10: Latency needs the frame of an abrupt change"),
            ("frames: 0", "t.ron:2:9: 0 is not in 1 to 10000000"),
            ("seeds: []", "t.ron:2:8: an empty list leaves nothing to measure"),
            ("vary: Gird({})", "t.ron:2:7: unknown name `Gird`, did you mean `Grid`?"),
            ("vary: Grid({ \"a\": [1], \"a\": [2] })", "t.ron:2:24: duplicate parameter `a`"),
            (
                "vary: Grid({ \"a\": Range(from: 1, to: 0, step: 1) })",
                "t.ron:2:19: a range from 1 to 0 cannot have",
            ),
            ("vary: Grid({ \".a\": [1] })", "t.ron:2:14: expected node.param=value"),
            (
                "vary: Grid({ \"a\": Range(from: 1, to: 500, step: 1), \"b\": Range(from: 1, to: 500, step: 1) })",
                "t.ron:2:7: 250000 variations of each graph; 10000 are the limit",
            ),
            ("reference: (spp: 1)", "t.ron:2:18: expected an even number of samples per pixel"),
            ("sizes: [\"64\"]", "t.ron:2:10: expected WIDTHxHEIGHT in pixels"),
            ("backend: \"cup\"", "t.ron:2:11: expected auto, gpu or cpu"),
            (
                "search: [Search(metric: Flip, target: 0.1)]",
                "t.ron:2:10: a search compares repetitions; name at least 3",
            ),
            (
                "search: [Search(target: 0.1)], seeds: [1, 2, 3]",
                "t.ron:2:10: a search is for a metric or a cost",
            ),
            ("search: [Search(cost: Rays, target: 1)]", "t.ron:2:10: Rays needs no search; name a time"),
            ("search: [Search(metric: Flip, target: 0)]", "t.ron:2:10: the target is 0"),
            (
                "search: [Search(metric: Flip, target: 1)], metrics: [Psnr]",
                "t.ron:2:10: add Flip to `metrics`",
            ),
            ("search: [Search(metric: Flip, target: 1, over: Spp)]", "t.ron:2:48: unknown name `Spp`"),
            (
                "search: [Search(metric: Flip, target: 1, from: 1, to: 9, budget: Samples(3))], seeds: [1, 2, 3]",
                "t.ron:2:66: a search over samples finds its own budget",
            ),
            (
                "search: [Search(metric: Flip, target: 1, over: Param(\"a\"), to: 9)], seeds: [1, 2, 3]",
                "t.ron:2:10: a search over `a` needs both ends",
            ),
            (
                "search: [Search(metric: Flip, target: 1, over: Param(\"a\"), from: 9, to: 9)], seeds: [1, 2, 3]",
                "t.ron:2:66: from 9 to 9; expected rising numbers",
            ),
            ("quick: (version: 1)", "t.ron:2:8: `quick` has other fields than the file"),
            ("frames: 3", ""),
        ] {
            let text = parse(fields).err().unwrap_or_default();
            assert!(text.starts_with(wanted), "{wanted}\nis not\n{text}");
        }
        let text = |text: &str| Experiment::parse("t.ron", text, true).unwrap_err().to_string();
        assert!(text("Tradeoff(version: 2)").contains("t.ron:1:19: unsupported version 2"));
        let all = text("Tradeoff(frames: \"x\")");
        for part in
            ["add version: 1", "add graphs: [\"epi\"]", "add scenes:", "which --quick needs", "t.ron:1:18: "]
        {
            assert!(all.contains(part), "{part} is not in\n{all}");
        }
        assert!(
            text("Tradeoff(version: 1").contains("the `(` at 1:9 is still open here"),
            "{}",
            text("Tradeoff(version: 1")
        );
    }
}
