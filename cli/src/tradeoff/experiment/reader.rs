//! Reads the values of an experiment's file.

use epigraph::{Backend, Change, Samples};
use epigraph_core::{GraphError, Place, Problem, Problems, Span, ron_problem};
use ron::{Options, extensions::Extensions, value::RawValue};
use serde::{Deserialize, de::DeserializeOwned};

use super::{
    Budget, Experiment, Frames, Goal, Named, Over, Placed, Search, Set,
    fields::{
        BudgetField, Entries, Fields, GraphFields, Mode, OverField, Parsed, ReferenceFields, SearchFields,
        Steps, Vary,
    },
    tidy,
};
use crate::{
    tradeoff::figure::{Cost, Metric},
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

/// How files are read: `implicit_some`, as in graphs and scenes.
pub fn options() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

/// Reads the values of a file and collects all problems. Where there is a problem, what it returns does not count.
pub struct Reader<'t> {
    pub path: &'t str,
    pub text: &'t str,
    pub problems: Problems,
}

impl<'t> Reader<'t> {
    pub fn experiment(&mut self, fields: Fields<'t>, quick: bool) -> Experiment {
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
        let (spp, mode) = fields.reference.map_or((256, None), |raw| self.reference(raw));
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
            frames: Frames { count: frames, compare },
            still: None,
            change,
            budgets,
            density: None,
            leaves_out: false,
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
            .filter_map(|raw| Some(Placed { value: self.read(raw)?, place: Some(self.place(raw)) }))
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
        let place = Some(self.place(raw));
        if raw.trim().get_ron().starts_with(['"', 'r']) {
            let name: String = self.read(raw)?;
            return Some(Placed { value: Named { label: crate::open::label(&name), variant: name }, place });
        }
        let fields: GraphFields = self.read(raw)?;
        let mut variant: String = self.read(fields.graph)?;
        let place = Some(self.place(fields.graph));
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
        Some(Placed { value: (name, text), place: Some(self.place(value)) })
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
        Some(Placed { value, place: Some(self.place(raw)) })
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
                let (target, place) = (fields.target, Some(self.place(raw)));
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
        let place = Some(self.place(raw));
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

    fn reference(&mut self, raw: &'t RawValue) -> (u32, Option<Light>) {
        let Some(ReferenceFields { spp, mode }) = self.read(raw) else { return (1, None) };
        let mode = mode.map(|mode| match mode {
            Mode::Direct => Light::Direct,
            Mode::Path => Light::Path,
        });
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
        Placed { value, place: Some(Place::file(self.path)) }
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
