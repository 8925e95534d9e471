//! Experiment files: what to measure. Every problem has its line and column.

use std::{fmt, marker::PhantomData, path::Path, str::FromStr};

use epigraph::{Backend, Change, Samples};
use epigraph_core::{GraphError, Place, Problem, Problems, Span, ron_problem};
use ron::{Options, extensions::Extensions, value::RawValue};
use serde::{
    Deserialize, Deserializer,
    de::{DeserializeOwned, Error, MapAccess, Visitor},
};

use super::figure::{Cost, Metric};
use crate::{
    error::CliError,
    values::{Light, Size},
};

/// The version of the format that this program reads.
const VERSION: u32 = 1;

/// The last frame that can be compared: all before it run too.
const MOST_FRAMES: u32 = 10_000_000;

/// The most variations of a graph.
const MOST_VARIATIONS: usize = 10_000;

/// Most values of a range.
const MOST_STEPS: f64 = 10_000.0;

/// The fewest repetitions from which a search can tell noise.
const LEAST_SEEDS: usize = 3;

/// The fewest frames from a change on, to find the steady value of the error after it.
const LEAST_AFTER_CHANGE: u32 = 8;

/// The most samples per pixel of a reference.
const MOST_SPP: u32 = 1_000_000;

/// A value and its place in the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed<T> {
    /// The value.
    pub value: T,
    /// Its place.
    pub place: Place,
}

impl<T> Placed<T> {
    /// A problem with it.
    pub fn problem(&self, what: impl ToString) -> Problem {
        Problem::new(GraphError::Invalid(what.to_string())).at(self.place.clone())
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
    /// Number of frames that run.
    pub frames: u32,
    /// The frames that are compared, ascending.
    pub compare: Vec<u32>,
    /// The frame in which the camera or the scene changes abruptly. All frames from there on are compared.
    pub change: Option<u32>,
    /// Samples per frame.
    pub budgets: Vec<Placed<Budget>>,
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
    /// Light transport of the references.
    pub mode: Light,
    /// Default placement of nodes.
    pub backend: Backend,
}

/// The fields of a file, and those of its `quick`.
#[derive(Default, Deserialize)]
#[serde(rename = "Tradeoff", deny_unknown_fields)]
struct Fields<'t> {
    #[serde(borrow, default)]
    version: Option<&'t RawValue>,
    #[serde(borrow, default)]
    doc: Option<&'t RawValue>,
    #[serde(borrow, default)]
    graphs: Option<&'t RawValue>,
    #[serde(borrow, default)]
    scenes: Option<&'t RawValue>,
    #[serde(borrow, default)]
    cameras: Option<&'t RawValue>,
    #[serde(borrow, default)]
    sizes: Option<&'t RawValue>,
    #[serde(borrow, default)]
    frames: Option<&'t RawValue>,
    #[serde(borrow, default)]
    compare: Option<&'t RawValue>,
    #[serde(borrow, default)]
    change: Option<&'t RawValue>,
    #[serde(borrow, default)]
    budgets: Option<&'t RawValue>,
    #[serde(borrow, default)]
    vary: Option<&'t RawValue>,
    #[serde(borrow, default)]
    search: Option<&'t RawValue>,
    #[serde(borrow, default)]
    seeds: Option<&'t RawValue>,
    #[serde(borrow, default)]
    metrics: Option<&'t RawValue>,
    #[serde(borrow, default)]
    costs: Option<&'t RawValue>,
    #[serde(borrow, default)]
    reference: Option<&'t RawValue>,
    #[serde(borrow, default)]
    backend: Option<&'t RawValue>,
    #[serde(borrow, default)]
    quick: Option<&'t RawValue>,
}

impl<'t> Fields<'t> {
    /// These, where they are given, and else the others.
    fn or(self, others: Self) -> Self {
        Self {
            version: others.version,
            doc: others.doc,
            graphs: self.graphs.or(others.graphs),
            scenes: self.scenes.or(others.scenes),
            cameras: self.cameras.or(others.cameras),
            sizes: self.sizes.or(others.sizes),
            frames: self.frames.or(others.frames),
            compare: self.compare.or(others.compare),
            change: self.change.or(others.change),
            budgets: self.budgets.or(others.budgets),
            vary: self.vary.or(others.vary),
            search: self.search.or(others.search),
            seeds: self.seeds.or(others.seeds),
            metrics: self.metrics.or(others.metrics),
            costs: self.costs.or(others.costs),
            reference: self.reference.or(others.reference),
            backend: self.backend.or(others.backend),
            quick: None,
        }
    }
}

/// A graph with a name or parameters.
#[derive(Deserialize)]
#[serde(rename = "Graph", deny_unknown_fields)]
struct GraphFields<'t> {
    #[serde(borrow)]
    graph: &'t RawValue,
    #[serde(borrow, default)]
    name: Option<&'t RawValue>,
    #[serde(borrow, default)]
    set: Option<&'t RawValue>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum BudgetField {
    Samples(Parsed<Samples>),
    PathsPerPixel(f64),
}

#[derive(Deserialize)]
#[serde(rename = "Search", deny_unknown_fields)]
struct SearchFields<'t> {
    #[serde(default)]
    metric: Option<Metric>,
    #[serde(default)]
    cost: Option<Cost>,
    target: f64,
    #[serde(default)]
    over: OverField,
    #[serde(borrow, default)]
    from: Option<&'t RawValue>,
    #[serde(borrow, default)]
    to: Option<&'t RawValue>,
    #[serde(borrow, default)]
    budget: Option<&'t RawValue>,
}

#[derive(Default, Deserialize)]
enum OverField {
    #[default]
    Samples,
    Param(String),
}

#[derive(Deserialize)]
enum Vary<'t> {
    Grid(#[serde(borrow)] Entries<'t>),
    OneAtATime(#[serde(borrow)] Entries<'t>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
enum Steps {
    Range { from: f64, to: f64, step: f64 },
}

#[derive(Deserialize)]
#[serde(rename = "Reference", deny_unknown_fields)]
struct ReferenceFields<'t> {
    #[serde(borrow)]
    spp: &'t RawValue,
    #[serde(default)]
    mode: Mode,
}

#[derive(Clone, Copy, Default, Deserialize)]
enum Mode {
    #[default]
    Direct,
    Path,
}

/// The entries of a map in the order of the file, duplicates included.
struct Entries<'t>(Vec<(&'t RawValue, &'t RawValue)>);

impl<'de: 't, 't> Deserialize<'de> for Entries<'t> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct All<'t>(PhantomData<Entries<'t>>);
        impl<'de: 't, 't> Visitor<'de> for All<'t> {
            type Value = Entries<'t>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a map: { \"PARAM\": VALUE, ... }")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Entries(entries))
            }
        }
        from.deserialize_map(All(PhantomData))
    }
}

/// A value that is written as on the command line: in quotes, or as a whole number.
struct Parsed<T>(T);

impl<'de, T: FromStr<Err: fmt::Display>> Deserialize<'de> for Parsed<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Text<T>(PhantomData<T>);
        impl<T: FromStr<Err: fmt::Display>> Visitor<'_> for Text<T> {
            type Value = Parsed<T>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a text in quotes, or a whole number")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
                text.parse().map(Parsed).map_err(E::custom)
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
                self.visit_str(&number.to_string())
            }
        }
        from.deserialize_any(Text(PhantomData))
    }
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

/// How files are read: `implicit_some`, as in graphs and scenes.
fn options() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

/// Reads the values of a file and collects all problems. Where there is a problem, what it returns does not count.
struct Reader<'t> {
    path: &'t str,
    text: &'t str,
    problems: Problems,
}

impl<'t> Reader<'t> {
    fn experiment(&mut self, fields: Fields<'t>, quick: bool) -> Experiment {
        self.version(fields.version);
        let fields = self.with_quick(fields, quick);
        let number = |reader: &mut Self, raw: Option<&'t RawValue>, default: u32, most: u32| {
            raw.map_or(default, |raw| reader.number(raw, most))
        };
        let frames = number(self, fields.frames, 30, MOST_FRAMES);
        let change = fields.change.and_then(|raw| self.change(raw, frames));
        let compare = match (fields.compare, change) {
            (None, None) => vec![frames.max(1) - 1],
            (None, Some(change)) => (change..frames).collect(),
            (Some(raw), None) => self.compare(raw, frames),
            (Some(raw), Some(_)) => {
                self.problem(
                    raw,
                    "leave `compare` out: with `change`, all frames from there on are compared",
                );
                Vec::new()
            }
        };
        let (spp, mode) = fields.reference.map_or((256, Light::Direct), |raw| self.reference(raw));
        let graphs = self.required(fields.graphs, "graphs: [\"epi\"]");
        let graphs = graphs.into_iter().filter_map(|raw| self.graph(raw)).collect();
        let scenes = self.required(fields.scenes, "scenes: [\"cornell\"]");
        let budgets = match fields.budgets {
            Some(raw) => self.list(raw).into_iter().filter_map(|raw| self.budget(raw)).collect(),
            // A search finds its own.
            None if fields.search.is_some() => Vec::new(),
            None => vec![self.nowhere(Budget::Samples(Samples::Share(0.05)))],
        };
        let sizes = self.each_or(fields.sizes, Parsed(Size([256, 256]))).into_iter();
        let seeds = self.distinct(fields.seeds, &[1]);
        let metrics = self.distinct(fields.metrics, Metric::ALL);
        if let Some(raw) = fields.metrics
            && metrics.contains(&Metric::Latency)
        {
            if !metrics.contains(&Metric::Flip) {
                self.problem(raw, "add Flip, from which Latency is measured");
            }
            if change.is_none() {
                self.problem(raw, "Latency needs the frame of an abrupt change: change: 30");
            }
        }
        let searches = fields.search.map_or(Vec::new(), |raw| self.list(raw));
        let searches =
            searches.into_iter().filter_map(|raw| self.search(raw, &metrics, seeds.len())).collect();
        Experiment {
            doc: fields.doc.and_then(|raw| self.read(raw)).unwrap_or_default(),
            graphs,
            scenes: self.each(scenes),
            cameras: self.each_or(fields.cameras, "orbit".to_owned()),
            sizes: sizes
                .map(|Placed { value: Parsed(Size(value)), place }| Placed { value, place })
                .collect(),
            frames,
            compare,
            change,
            budgets,
            variations: fields.vary.map_or_else(|| vec![Vec::new()], |raw| self.variations(raw)),
            searches,
            seeds,
            metrics,
            costs: self.distinct(fields.costs, &[Cost::PathsPerPixel, Cost::TotalMs]),
            spp,
            mode,
            backend: fields
                .backend
                .and_then(|raw| self.read(raw))
                .map_or(Backend::Auto, |Parsed(value)| value),
        }
    }

    fn version(&mut self, raw: Option<&'t RawValue>) {
        match raw {
            None => self.missing("version: 1"),
            Some(raw) => {
                if let Some(found) = self.read::<u32>(raw).filter(|found| *found != VERSION) {
                    self.problem(
                        raw,
                        format!("unsupported version {found}; this program reads version {VERSION}"),
                    );
                }
            }
        }
    }

    fn with_quick(&mut self, fields: Fields<'t>, quick: bool) -> Fields<'t> {
        let short = fields.quick.and_then(|raw| Some((raw, self.read::<Fields>(raw)?)));
        if let Some((raw, short)) = &short
            && (short.version.is_some() || short.doc.is_some() || short.quick.is_some())
        {
            self.problem(raw, "`quick` has other fields than the file, but no `version`, `doc` or `quick`");
        }
        match (quick, short) {
            (false, _) => fields,
            (true, Some((_, short))) => short.or(fields),
            (true, None) => {
                self.missing("quick: (sizes: [\"64x64\"], frames: 10), which --quick needs");
                fields
            }
        }
    }

    /// A list that must be there and have entries.
    fn required(&mut self, raw: Option<&'t RawValue>, example: &str) -> Vec<&'t RawValue> {
        match raw {
            None => {
                self.missing(example);
                Vec::new()
            }
            Some(raw) => self.list(raw),
        }
    }

    /// The entries of a list, of which there must be at least one.
    fn list(&mut self, raw: &'t RawValue) -> Vec<&'t RawValue> {
        let list: Vec<&RawValue> = self.read(raw).unwrap_or_default();
        if list.is_empty() && self.problems.0.is_empty() {
            self.problem(
                raw,
                "an empty list leaves nothing to measure; name at least one, or leave the field out",
            );
        }
        list
    }

    fn each<T: DeserializeOwned>(&mut self, list: Vec<&'t RawValue>) -> Vec<Placed<T>> {
        list.into_iter()
            .filter_map(|raw| Some(Placed { value: self.read(raw)?, place: self.place(raw) }))
            .collect()
    }

    /// The values of a list, or only the default.
    fn each_or<T: DeserializeOwned>(&mut self, raw: Option<&'t RawValue>, default: T) -> Vec<Placed<T>> {
        match raw {
            Some(raw) => {
                let list = self.list(raw);
                self.each(list)
            }
            None => vec![self.nowhere(default)],
        }
    }

    /// The values of a list without duplicates, or the default.
    fn distinct<T: DeserializeOwned + PartialEq + Clone>(
        &mut self,
        raw: Option<&'t RawValue>,
        default: &[T],
    ) -> Vec<T> {
        let Some(raw) = raw else { return default.to_vec() };
        let list = self.list(raw);
        let mut known = Vec::new();
        for Placed { value, .. } in self.each(list) {
            if !known.contains(&value) {
                known.push(value);
            }
        }
        known
    }

    fn graph(&mut self, raw: &'t RawValue) -> Option<Placed<Named>> {
        let place = self.place(raw);
        if raw.trim().get_ron().starts_with(['"', 'r']) {
            let name: String = self.read(raw)?;
            return Some(Placed { value: Named { label: crate::open::label(&name), variant: name }, place });
        }
        let fields: GraphFields = self.read(raw)?;
        let mut variant: String = self.read(fields.graph)?;
        let place = self.place(fields.graph);
        for (param, value) in
            fields.set.and_then(|set| self.read::<Entries>(set)).map_or(Vec::new(), |set| set.0)
        {
            let Placed { value: (param, value), .. } = self.set(param, value)?;
            variant += &format!("+{param}={value}");
        }
        let label = match fields.name {
            Some(name) => self.read(name)?,
            None => crate::open::label(&variant),
        };
        Some(Placed { value: Named { label, variant }, place })
    }

    /// A parameter with a value.
    fn set(&mut self, param: &'t RawValue, value: &'t RawValue) -> Option<Placed<Set>> {
        let name: String = self.read(param)?;
        let text = value.trim().get_ron().to_owned();
        if let Err(expected) = Change::set(&format!("{name}={text}")) {
            self.problem(param, expected);
            return None;
        }
        Some(Placed { value: (name, text), place: self.place(value) })
    }

    fn budget(&mut self, raw: &'t RawValue) -> Option<Placed<Budget>> {
        let value = match self.read(raw)? {
            BudgetField::Samples(Parsed(samples)) => Budget::Samples(samples),
            BudgetField::PathsPerPixel(paths) if paths > 0.0 && paths.is_finite() => {
                Budget::PathsPerPixel(paths)
            }
            BudgetField::PathsPerPixel(paths) => {
                self.problem(raw, format!("{paths} paths per pixel; expected a number above 0, such as 0.2"));
                return None;
            }
        };
        Some(Placed { value, place: self.place(raw) })
    }

    fn search(&mut self, raw: &'t RawValue, metrics: &[Metric], seeds: usize) -> Option<Placed<Search>> {
        let fields: SearchFields = self.read(raw)?;
        let goal = match (fields.metric, fields.cost) {
            (Some(metric), None) => Some(Goal::Metric(metric)),
            (None, Some(cost)) => Some(Goal::Cost(cost)),
            _ => None,
        };
        let problem = match goal {
            None => "a search is for a metric or a cost; write Search(metric: Flip, target: 0.02) or \
                     Search(cost: TotalMs, target: 10)"
                .into(),
            Some(Goal::Metric(metric)) if !metrics.contains(&metric) => {
                format!("add {metric:?} to `metrics`, which leaves it out")
            }
            Some(Goal::Cost(cost)) if !cost.is_time() => {
                format!("{cost:?} needs no search; name a time: FrameMs, TraceMs or TotalMs")
            }
            _ if fields.target <= 0.0 || !fields.target.is_finite() => {
                format!("the target is {}; expected a number above 0", fields.target)
            }
            _ if seeds < LEAST_SEEDS => {
                format!("a search compares repetitions; name at least {LEAST_SEEDS} seeds: seeds: [1, 2, 3]")
            }
            Some(goal) => {
                let (target, place) = (fields.target, self.place(raw));
                let over = self.over(raw, fields)?;
                return Some(Placed { value: Search { goal, target, over }, place });
            }
        };
        self.problem(raw, problem);
        None
    }

    fn over(&mut self, raw: &'t RawValue, fields: SearchFields<'t>) -> Option<Over> {
        let OverField::Param(name) = fields.over else {
            if let Some(budget) = fields.budget {
                self.problem(budget, "a search over samples finds its own budget; leave `budget` out");
                return None;
            }
            let mut samples = |given: Option<&'t RawValue>, default| match given {
                None => Some(Samples::Share(default)),
                Some(raw) => self.read(raw).map(|Parsed(samples)| samples),
            };
            return Some(Over::Samples([samples(fields.from, 0.001)?, samples(fields.to, 1.0)?]));
        };
        if let Err(expected) = Change::set(&format!("{name}=0")) {
            self.problem(raw, expected);
            return None;
        }
        let (Some(from), Some(to)) = (fields.from, fields.to) else {
            self.problem(raw, format!("a search over `{name}` needs both ends: from: 0.01, to: 0.5"));
            return None;
        };
        let range: [f64; 2] = [self.read(from)?, self.read(to)?];
        if !range.iter().all(|end| end.is_finite()) || range[0] >= range[1] {
            self.problem(from, format!("from {} to {}; expected rising numbers", range[0], range[1]));
            return None;
        }
        let budget = match fields.budget {
            Some(raw) => self.budget(raw)?,
            None => self.nowhere(Budget::Samples(Samples::Share(0.05))),
        };
        Some(Over::Param { name, range, budget })
    }

    /// Every combination of the parameters' values, or each value alone beside the unchanged graph.
    fn variations(&mut self, raw: &'t RawValue) -> Vec<Vec<Placed<Set>>> {
        let Some(vary) = self.read::<Vary>(raw) else { return Vec::new() };
        let (Vary::Grid(Entries(entries)) | Vary::OneAtATime(Entries(entries))) = &vary;
        let mut names: Vec<String> = Vec::new();
        let mut params: Vec<Vec<Placed<Set>>> = Vec::new();
        for &(param, values) in entries {
            let Some(name) = self.read::<String>(param) else { continue };
            if names.contains(&name) {
                self.problem(param, format!("duplicate parameter `{name}`"));
            }
            names.push(name.clone());
            params.push(self.values(param, values, &name));
        }
        let all: usize = match vary {
            Vary::Grid(_) => params.iter().map(Vec::len).fold(1, usize::saturating_mul),
            Vary::OneAtATime(_) => params.iter().map(Vec::len).sum::<usize>() + 1,
        };
        if all > MOST_VARIATIONS {
            let text = format!(
                "{all} variations of each graph; {MOST_VARIATIONS} are the limit: vary less at a time"
            );
            self.problem(raw, text);
            return Vec::new();
        }
        match vary {
            Vary::Grid(_) => params.into_iter().fold(vec![Vec::new()], |grid, values| {
                let with = |row: &Vec<Placed<Set>>| {
                    values.iter().map(|value| [row.clone(), vec![value.clone()]].concat()).collect::<Vec<_>>()
                };
                grid.iter().flat_map(with).collect()
            }),
            Vary::OneAtATime(_) => {
                [Vec::new()].into_iter().chain(params.into_iter().flatten().map(|set| vec![set])).collect()
            }
        }
    }

    /// The values of a parameter: a list, or a range with a step.
    fn values(&mut self, param: &'t RawValue, raw: &'t RawValue, name: &str) -> Vec<Placed<Set>> {
        if raw.trim().get_ron().starts_with('[') {
            return self.list(raw).into_iter().filter_map(|value| self.set(param, value)).collect();
        }
        let Some(Steps::Range { from, to, step }) = self.read(raw) else { return Vec::new() };
        let count = ((to - from) / step * (1.0 + 1e-9)).floor();
        if !(0.0..MOST_STEPS).contains(&count) {
            self.problem(raw, format!("a range from {from} to {to} cannot have steps of {step}"));
            return Vec::new();
        }
        let place = self.place(raw);
        let at = |index: u32| (name.to_owned(), tidy(from + step * f64::from(index), 10));
        (0..=count as u32).map(|index| Placed { value: at(index), place: place.clone() }).collect()
    }

    fn compare(&mut self, raw: &'t RawValue, frames: u32) -> Vec<u32> {
        let mut compare = Vec::new();
        for entry in self.list(raw) {
            match self.read::<u32>(entry) {
                Some(frame) if frame < frames => compare.push(frame),
                Some(frame) => self.problem(
                    entry,
                    format!(
                        "frame {frame} does not run; with frames: {frames}, they are 0 to {}",
                        frames.max(1) - 1
                    ),
                ),
                None => {}
            }
        }
        compare.sort_unstable();
        compare.dedup();
        compare
    }

    fn change(&mut self, raw: &'t RawValue, frames: u32) -> Option<u32> {
        let change = self.read::<u32>(raw)?;
        if change.saturating_add(LEAST_AFTER_CHANGE) > frames {
            self.problem(
                raw,
                format!(
                    "a change in frame {change} of {frames}; at least {LEAST_AFTER_CHANGE} frames must run from there \
                     on to find the steady error"
                ),
            );
            return None;
        }
        Some(change)
    }

    fn reference(&mut self, raw: &'t RawValue) -> (u32, Light) {
        let Some(ReferenceFields { spp, mode }) = self.read(raw) else { return (1, Light::Direct) };
        let mode = match mode {
            Mode::Direct => Light::Direct,
            Mode::Path => Light::Path,
        };
        let known = self.problems.0.len();
        let found = self.number(spp, MOST_SPP);
        if found % 2 == 1 && self.problems.0.len() == known {
            self.problem(spp, "expected an even number of samples per pixel, as its halves are compared");
        }
        (found, mode)
    }

    /// A whole number from 1.
    fn number(&mut self, raw: &'t RawValue, most: u32) -> u32 {
        match self.read::<u32>(raw) {
            Some(number) if (1..=most).contains(&number) => number,
            Some(number) => {
                self.problem(raw, format!("{number} is not in 1 to {most}"));
                1
            }
            None => 1,
        }
    }

    fn read<T: Deserialize<'t>>(&mut self, raw: &'t RawValue) -> Option<T> {
        let part = raw.get_ron();
        match options().from_str(part) {
            Ok(value) => Some(value),
            Err(error) => {
                let (path, text, from) = (self.path, self.text, self.begin(raw));
                self.problems.add(|| ron_problem(path, text, from, &error));
                None
            }
        }
    }

    /// The byte of the text at which a value begins.
    fn begin(&self, raw: &'t RawValue) -> usize {
        raw.get_ron().as_ptr() as usize - self.text.as_ptr() as usize
    }

    fn place(&self, raw: &'t RawValue) -> Place {
        let raw = raw.trim();
        let start = self.begin(raw);
        Place::of(self.path, self.text, Span { start, end: start + raw.get_ron().len() })
    }

    /// A value that the file does not have.
    fn nowhere<T>(&self, value: T) -> Placed<T> {
        Placed { value, place: Place::file(self.path) }
    }

    fn problem(&mut self, raw: &'t RawValue, what: impl ToString) {
        let place = self.place(raw);
        self.problems.add(|| Problem::new(GraphError::Invalid(what.to_string())).at(place));
    }

    fn missing(&mut self, example: &str) {
        let text = format!("a field is missing; add {example}");
        let place = Place::file(self.path);
        self.problems.add(|| Problem::new(GraphError::Invalid(text)).at(place));
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
        assert_eq!((experiment.frames, experiment.compare, experiment.spp), (30, vec![29], 256));
        assert_eq!((experiment.sizes[0].value, experiment.seeds), ([256, 256], vec![1]));
        assert_eq!((experiment.metrics.len(), experiment.variations.len()), (Metric::ALL.len(), 1));
    }

    #[test]
    fn all_frames_from_a_change_on_are_compared() {
        let experiment = parse("frames: 30, change: 20").unwrap();
        assert_eq!((experiment.change, experiment.compare), (Some(20), (20..30).collect()));
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
        assert_eq!((experiment.frames, experiment.compare), (3, vec![2]));
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
