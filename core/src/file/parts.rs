//! Graphs made of graphs. A node `"NAME": (kind: "graph", params: (file: "part.ron"), inputs: { "x": "NODE.PORT" })`
//! includes all nodes of another file, a part. Within the part, `"inputs.x"` is whatever the including node connects to
//! `x`; outside, the part's outputs are ports of the including node, and its nodes have addresses `NAME/NODE`. `on` and
//! `download` of the including node are the defaults for nodes of the part that can run there. The part's own parameters
//! are set beside `file`; `set: { "NODE": (param: value) }` in the including node overrides parameters of its nodes.
//!
//! [`GraphFile::flatten`] expands everything to one list of nodes, each with the file it comes from, so that checking
//! and compiling need not know about parts, parameters of graphs or repeated nodes.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap, HashSet},
    path::{Path, PathBuf},
};

use index_vec::IndexVec;

use super::{
    GraphFile, GraphValue, InputDef, Library, NodeDef, Origin, OutputDef, ParamDef, Source, handed,
    parse::is_identifier,
    repeat::{copy_of, no_copy, times, times_expected},
};
use crate::{
    error::{GraphError, Problem, Problems, Span, Spanned},
    id::FlatId,
    side::{Download, Side},
};

/// The kind of a node that includes a file, which is no stage's.
pub const PART_KIND: &str = "graph";

/// The parameter that names the file.
pub(super) const FILE_PARAM: &str = "file";

/// The node whose ports are a part's inputs.
pub(super) const INPUTS: &str = "inputs";

/// Most nodes of a flattened graph, and most files that it is read from: parts that contain parts, and nodes that are
/// repeated, multiply.
const MOST_NODES: usize = 10_000;
const MOST_FILES: usize = 1000;

/// Most files within each other.
const MOST_DEPTH: usize = 64;

/// Most parts that one wire may lead through: those of a wire that leads in a circle are endless.
const LONGEST_WIRE: u32 = 1000;

/// A node of the flattened graph, with the file that its places refer to.
pub(crate) struct FlatNode<'f> {
    pub def: NodeDef,
    pub file: &'f GraphFile,
    /// The defaults that the part's node gives.
    pub default: PartDefaults,
    /// The places of parameters that are written in other files, by parameter name.
    pub places: BTreeMap<String, ParamPlaces<'f>>,
    /// Its address in the text: that of the node that it is a copy of.
    pub written: String,
    /// Its inputs that read an input of a part that is not connected, and that.
    pub open: Vec<(String, Source)>,
}

/// The files that the name and the value of a parameter are written in. They differ where a node takes the value from
/// its graph.
#[derive(Clone, Copy)]
pub struct ParamPlaces<'f> {
    /// The name's file.
    pub name: &'f GraphFile,
    /// The value's file.
    pub value: &'f GraphFile,
}

/// Default placement of a part's nodes.
#[derive(Clone, Copy, Default)]
pub(crate) struct PartDefaults {
    pub side: Option<Side>,
    /// The part that gives the side: its index in [`Flat::placed`].
    pub part: Option<usize>,
    pub download: Option<Download>,
}

/// A part that is placed as a whole.
pub(crate) struct PlacedPart<'f> {
    /// The address of its node.
    pub node: String,
    pub on: Spanned<Side>,
    /// The file that its node is in.
    pub file: &'f GraphFile,
}

/// A flattened graph.
pub(crate) struct Flat<'f> {
    pub file: &'f GraphFile,
    pub nodes: IndexVec<FlatId, FlatNode<'f>>,
    pub outputs: Vec<OutputDef>,
    /// The parameters of the graph itself, and of its parts.
    pub params: Vec<GraphValue>,
    /// The nodes, stages and parts, that have taken the place of others, by address.
    pub swaps: BTreeMap<String, Swap<'f>>,
    /// The parts whose nodes have a side by default.
    pub placed: Vec<PlacedPart<'f>>,
}

/// A node that has taken the place of another.
pub(crate) struct Swap<'f> {
    pub node: &'f NodeDef,
    /// The graph that it is in.
    pub file: &'f GraphFile,
    /// Its file, if it is a part.
    pub part: Option<&'f GraphFile>,
}

impl Swap<'_> {
    /// The file that names the new node.
    pub fn path(&self) -> &str {
        self.file.path_at(self.node.kind.span)
    }
}

/// The state of reading a file's parts.
struct Reading<'r> {
    library: &'r dyn Library,
    /// The files around the one being read: their paths as written, and what tells files apart.
    within: Vec<(String, PathBuf)>,
    /// The number of files read.
    files: usize,
}

impl GraphFile {
    /// Reads the files of all parts and the base, recursively.
    ///
    /// # Errors
    /// All problems of all files, each with its place.
    pub fn with_parts(mut self, library: &dyn Library) -> Result<Self, Problems> {
        self.read_parts(&mut Reading { library, within: Vec::new(), files: 0 })?;
        Ok(self)
    }

    fn read_parts(&mut self, reading: &mut Reading) -> Result<(), Problems> {
        reading.within.push((self.path.clone(), identity(&self.path, self.origin)));
        let mut problems = Problems::default();
        let mut read = |nodes: &[NodeDef]| -> Vec<(String, Self)> {
            let mut parts = Vec::new();
            for node in nodes.iter().filter(|node| node.kind.value == PART_KIND) {
                match self.read_part(node, reading) {
                    Ok(part) => parts.push((node.name.value.clone(), part)),
                    Err(found) => problems.append(found),
                }
            }
            parts
        };
        let parts = read(&self.nodes);
        let replaced = self.base.as_ref().map(|changes| read(&changes.replace));
        // One that is known already was not read from a file.
        let base = self.base.as_ref().filter(|changes| changes.graph.is_none()).map(|changes| &changes.base);
        let base = base.map(|base| self.read_named(base, None, reading)).transpose();
        reading.within.pop();
        self.parts = parts;
        if let Some(changes) = &mut self.base {
            changes.parts = replaced.unwrap_or_default();
        }
        match (base, &mut self.base) {
            (Ok(Some(base)), Some(changes)) => changes.graph = Some(Box::new(base)),
            (Ok(_), _) => {}
            (Err(found), _) => problems.append(found),
        }
        problems.into_result()
    }

    fn read_part(&self, node: &NodeDef, reading: &mut Reading) -> Result<Self, Problems> {
        let problem = |error, span| Problem::new(error).at(self.place(span)).node(&node.name.value);
        let Some(param) = node.params.iter().find(|param| param.name.value == FILE_PARAM) else {
            if let [param] = &node.params[..] {
                let error = GraphError::unknown("parameter", &param.name.value, [FILE_PARAM]);
                return Err(problem(error, param.name.span).into());
            }
            let text = "a node of kind `graph` names its file: params: (file: \"PART.ron\")";
            return Err(problem(GraphError::Invalid(text.into()), node.kind.span).into());
        };
        let name = ron::from_str(&param.value.value).map_err(|error| {
            let (name, expected) = (FILE_PARAM.into(), "a path in double quotes".into());
            problem(GraphError::Value { name, expected, cause: error.code.to_string() }, param.value.span)
        })?;
        let name = Spanned { value: name, span: param.value.span };
        self.read_named(&name, Some(&node.name.value), reading)
    }

    /// Reads a graph that this file names, in a node or as its base, with all that it names.
    fn read_named(
        &self,
        name: &Spanned<String>,
        node: Option<&str>,
        reading: &mut Reading,
    ) -> Result<Self, Problems> {
        let problem = |error| {
            let problem = Problem::new(error).at(self.place(name.span));
            Problems::from(Problem { node: node.map(str::to_owned), ..problem })
        };
        let found = self.find_named(&name.value, reading.library).map_err(problem)?;
        let file = identity(&found.path, found.origin);
        let chain = |from: usize| -> String {
            let files = reading.within[from..].iter().map(|(path, _)| &path[..]).chain([&found.path[..]]);
            files.collect::<Vec<_>>().join(" -> ")
        };
        if let Some(at) = reading.within.iter().position(|(_, known)| *known == file) {
            return Err(problem(GraphError::Invalid(match reading.within.len() - at {
                1 => format!("{} contains itself", found.path),
                _ => format!("{} contains itself: {}", found.path, chain(at)),
            })));
        }
        if reading.within.len() >= MOST_DEPTH {
            let text = format!("more than {MOST_DEPTH} graphs are within each other: {}", chain(0));
            return Err(problem(GraphError::Invalid(text)));
        }
        if reading.files >= MOST_FILES {
            let text = format!("the graph is made of more than {MOST_FILES} files: {}", chain(0));
            // Once; the others are not read either.
            let is_first = reading.files == MOST_FILES;
            reading.files = MOST_FILES + 1;
            return Err(if is_first { problem(GraphError::Invalid(text)) } else { Problems::default() });
        }
        reading.files += 1;
        let mut graph = Self::parse(&found.path, &found.text)?;
        graph.origin = found.origin;
        graph.read_parts(reading)?;
        Ok(graph)
    }

    pub(super) fn part_mut(&mut self, node: &str) -> Option<&mut Self> {
        self.parts.iter_mut().find(|(name, _)| name == node).map(|(_, part)| part)
    }

    pub(super) fn part(&self, node: &str) -> Option<&Self> {
        self.parts.iter().find(|(name, _)| name == node).map(|(_, part)| part)
    }

    /// The address of a node given by its own name alone, or of something in it (`node/2`): the name itself if the graph
    /// has such a node, otherwise the address in its parts if it is unambiguous. Other names are returned unchanged.
    pub fn address_of(&self, name: &str) -> String {
        let head = name.split('/').next().unwrap_or(name);
        match &self.called(head)[..] {
            [address] if self.enter(name).is_none() => format!("{address}{}", &name[head.len()..]),
            _ => name.to_owned(),
        }
    }

    /// The addresses of all nodes with this name, in this file and in its parts.
    fn called(&self, name: &str) -> Vec<String> {
        let is_it = |address: &String| address.rsplit('/').next() == Some(name);
        self.addresses().into_iter().filter(is_it).collect()
    }

    /// The addresses of all nodes, including those in parts. Copies of a repeated node are not told apart.
    pub(super) fn addresses(&self) -> Vec<String> {
        let own = self.nodes.iter().map(|node| node.name.value.clone());
        let inner = |(node, part): &(String, Self)| -> Vec<String> {
            part.addresses().iter().map(|address| format!("{node}/{address}")).collect()
        };
        own.chain(self.parts.iter().flat_map(inner)).collect()
    }

    /// What to report of an address that no node has.
    pub fn no_node(&self, address: &str) -> GraphError {
        match &self.called(address)[..] {
            several @ [_, _, ..] => {
                let several = several.join(", ");
                GraphError::Invalid(format!(
                    "several nodes are called `{address}`: {several}; write which one"
                ))
            }
            _ => GraphError::unknown_node(address, self.addresses()),
        }
    }

    /// Splits an address into a node of this file, the number of a copy if that node is repeated, and the address of a
    /// node within it. The names of nodes may have slashes themselves.
    pub fn enter<'a>(&self, address: &'a str) -> Option<(&NodeDef, Option<u32>, Option<&'a str>)> {
        if let Some(node) = self.node(address) {
            return Some((node, None, None));
        }
        let mut slashes = address.match_indices('/').map(|(at, _)| (&address[..at], &address[at + 1..]));
        let (node, rest) = slashes.find_map(|(name, rest)| Some((self.node(name)?, rest)))?;
        let (copy, rest) = if node.repeat.is_some() { copy_of(rest) } else { (None, Some(rest)) };
        Some((node, copy, rest))
    }

    /// The node with this address and the file that contains it, a part or this one. All copies of a repeated node are
    /// written as one.
    pub fn node_at(&self, address: &str) -> Option<(&NodeDef, &Self)> {
        let (node, _, rest) = self.enter(address)?;
        match rest {
            Some(rest) => self.part(&node.name.value)?.node_at(rest),
            None => Some((node, self)),
        }
    }

    /// Flattens the graph: replaces each node that includes a part by the part's nodes, each repeated node by its copies,
    /// and each parameter of a graph by its value.
    pub(crate) fn flatten(&self) -> Result<Flat<'_>, Problems> {
        let flat = Flat {
            file: self,
            nodes: IndexVec::new(),
            outputs: Vec::new(),
            params: Vec::new(),
            swaps: BTreeMap::new(),
            placed: Vec::new(),
        };
        let mut builder = Builder {
            flat,
            problems: Problems::default(),
            parts: 0,
            is_over: false,
            counted: HashSet::new(),
        };
        let scope = Scope::whole(self);
        builder.add(&scope, "", PartDefaults::default());
        builder.check_names();
        let Builder { mut flat, mut problems, .. } = builder;
        for output in &self.outputs {
            match scope.resolve(&output.from.value) {
                Ok(Some(source)) => {
                    let from = Spanned { value: source, span: output.from.span };
                    flat.outputs.push(OutputDef { name: output.name.clone(), from });
                }
                Ok(None) => {}
                Err(error) => {
                    let place = || self.place(output.from.span);
                    problems.add(|| Problem::new(error).at(place()).port(&output.name.value));
                }
            }
        }
        problems.into_result()?;
        Ok(flat)
    }
}

impl Flat<'_> {
    /// The port that a name refers to, through outputs of parts.
    pub fn resolve(&self, source: &Source) -> Result<Source, GraphError> {
        let source = Source { node: self.file.address_of(&source.node), port: source.port.clone() };
        if self.file.enter(&source.node).is_none() {
            return Err(self.file.no_node(&source.node));
        }
        Ok(Scope::whole(self.file).resolve(&source)?.unwrap_or(source))
    }
}

/// The text of a value, and the file it is in.
#[derive(Clone)]
struct Given<'f> {
    text: Spanned<String>,
    file: &'f GraphFile,
}

/// A parameter that an including node overrides.
#[derive(Clone)]
struct Set<'f> {
    /// The address of its node in the file of the scope; empty for the node of the scope itself.
    node: &'f str,
    name: &'f Spanned<String>,
    /// The file that the name is in.
    file: &'f GraphFile,
    value: Given<'f>,
}

/// A file within the flattened graph: resolves its names.
struct Scope<'s, 'f> {
    file: &'f GraphFile,
    prefix: String,
    /// The scope, node and copy that include the file; `None` for the top-level file.
    outer: Option<(&'s Scope<'s, 'f>, &'f NodeDef, Option<u32>)>,
    /// The values of the file's own parameters.
    values: HashMap<&'f str, Given<'f>>,
    /// Parameters that including nodes override; those of outer files last.
    set: Vec<Set<'f>>,
}

impl<'s, 'f> Scope<'s, 'f> {
    fn whole(file: &'f GraphFile) -> Self {
        let values = file.params.iter().map(|param| (&param.name.value[..], defaulted(file, &param.default)));
        Self { file, prefix: String::new(), outer: None, values: values.collect(), set: Vec::new() }
    }

    /// The scope of a part that a node of this scope includes.
    fn inner<'i>(&'i self, node: &'f NodeDef, copy: Option<u32>, part: &'f GraphFile) -> Scope<'i, 'f> {
        let (own, set): (Vec<_>, Vec<_>) =
            self.set_for(node, copy).into_iter().partition(|set| set.node.is_empty());
        let value = |param: &'f super::GraphParam| {
            let name = &param.name.value;
            let set = own.iter().rev().find(|set| set.name.value == *name).map(|set| set.value.clone());
            let beside = || self.params(node, copy).into_iter().find(|(known, _)| known.value == *name);
            let value = set.or_else(|| Some(beside()?.1));
            (&name[..], value.unwrap_or_else(|| defaulted(part, &param.default)))
        };
        let values = part.params.iter().map(value).collect();
        let prefix = format!("{}/", self.name(node, copy));
        Scope { file: part, prefix, outer: Some((self, node, copy)), values, set }
    }

    /// The address of a node in the flattened graph.
    fn name(&self, node: &NodeDef, copy: Option<u32>) -> String {
        let copy = copy.map_or(String::new(), |copy| format!("/{copy}"));
        format!("{}{}{copy}", self.prefix, node.name.value)
    }

    /// What is written for a value, or for the parameter of the graph that it hands on.
    fn given(&self, text: &Spanned<String>) -> Given<'f> {
        let value = handed(&text.value).and_then(|name| self.values.get(&name[..]).cloned());
        value.unwrap_or_else(|| Given { text: text.clone(), file: self.file })
    }

    /// The parameters of a node, without those that are set elsewhere.
    fn params(&self, node: &'f NodeDef, copy: Option<u32>) -> Vec<(Spanned<String>, Given<'f>)> {
        let written = node.params.iter().map(|param| (param.name.clone(), self.given(&param.value)));
        let counted = node.repeat.as_ref().zip(copy).and_then(|(repeat, copy)| repeat.counted(copy));
        let counted = counted.map(|ParamDef { name, value }| (name, Given { text: value, file: self.file }));
        written.chain(counted).collect()
    }

    /// How often a node is repeated; `None` if it is there once.
    ///
    /// # Errors
    /// The text that is no number of copies.
    fn times(&self, node: &NodeDef) -> Result<Option<u32>, Given<'f>> {
        let Some(repeat) = &node.repeat else { return Ok(None) };
        let given = self.given(&repeat.times);
        times(&given.text.value).map(Some).ok_or(given)
    }

    /// Checks that a node has this copy.
    fn check_copy(&self, node: &NodeDef, copy: Option<u32>) -> Result<(), GraphError> {
        match (copy, self.times(node).ok().flatten()) {
            (Some(copy), Some(times)) if copy >= times => Err(no_copy(copy, times)),
            _ => Ok(()),
        }
    }

    /// What this file and the files that include it override in a node, by addresses within that node. Later ones count:
    /// those of outer files, and of one file those for single copies.
    fn set_for(&self, node: &'f NodeDef, copy: Option<u32>) -> Vec<Set<'f>> {
        let within = |rest: &'f str| match copy {
            None => Some(rest),
            Some(copy) => match copy_of(rest) {
                (Some(other), rest) => (other == copy).then_some(rest.unwrap_or("")),
                (None, rest) => rest,
            },
        };
        let own = node.set.iter().flat_map(|(address, params)| {
            let params = params.iter().filter_map(|param| {
                let (node, value) = (within(&address.value)?, self.given(&param.value));
                Some((address.value.len(), Set { node, name: &param.name, file: self.file, value }))
            });
            params.collect::<Vec<_>>()
        });
        let mut own: Vec<_> = own.collect();
        // `2/blur` counts more than `blur`.
        own.sort_by_key(|(length, _)| *length);
        let outer = self.set.iter().filter_map(|set| {
            let rest = set.node.strip_prefix(&node.name.value[..])?;
            let rest = if rest.is_empty() { rest } else { rest.strip_prefix('/')? };
            Some(Set { node: within(rest)?, ..set.clone() })
        });
        own.into_iter().map(|(_, set)| set).chain(outer).collect()
    }

    /// Whether a node has this copy, and a node within it this address.
    ///
    /// # Errors
    /// That there is no such copy.
    fn reaches(&self, node: &'f NodeDef, copy: Option<u32>, rest: Option<&str>) -> Result<bool, GraphError> {
        self.check_copy(node, copy)?;
        let Some(rest) = rest else { return Ok(true) };
        let Some(part) = self.file.part(&node.name.value) else { return Ok(false) };
        match part.enter(rest) {
            Some((inner, of, rest)) => self.inner(node, copy, part).reaches(inner, of, rest),
            None => Ok(false),
        }
    }

    /// The port that an input of a node takes, in the names of this file.
    fn input(&self, node: &NodeDef, copy: Option<u32>, port: &str) -> Option<Source> {
        let before = copy.and_then(|copy| copy.checked_sub(1));
        let through = node.repeat.as_ref().zip(before).and_then(|(repeat, before)| {
            let output = repeat.output_to(port)?.value.clone();
            Some(Source { node: format!("{}/{before}", node.name.value), port: output })
        });
        let written = || node.inputs.iter().find(|input| input.port.value == port);
        through.or_else(|| Some(written()?.from.value.clone()))
    }

    /// The address of a port in the flattened graph; `None` for a part's input that is not connected.
    fn resolve(&self, source: &Source) -> Result<Option<Source>, GraphError> {
        self.follow(source, LONGEST_WIRE)
    }

    fn follow(&self, source: &Source, left: u32) -> Result<Option<Source>, GraphError> {
        let Some(left) = left.checked_sub(1) else {
            return Err(GraphError::Invalid(format!(
                "the wire from `{source}` leads in a circle through parts"
            )));
        };
        if let (INPUTS, Some((outer, node, copy))) = (source.node.as_str(), self.outer) {
            let input = outer.input(node, copy, &source.port);
            return input.map_or(Ok(None), |source| outer.follow(&source, left));
        }
        let whole = |node| Some(Source { node, port: source.port.clone() });
        let Some((node, copy, rest)) = self.file.enter(&source.node) else {
            return Ok(whole(format!("{}{}", self.prefix, source.node)));
        };
        self.check_copy(node, copy)?;
        // The last copy is what leaves a row.
        let last = || self.times(node).ok().flatten().map(|times| times - 1);
        let copy = copy.or_else(last);
        let Some(part) = self.file.part(&node.name.value) else {
            let rest = rest.map_or(String::new(), |rest| format!("/{rest}"));
            return Ok(whole(self.name(node, copy) + &rest));
        };
        let scope = self.inner(node, copy, part);
        match rest {
            Some(rest) => scope.follow(&Source { node: rest.into(), port: source.port.clone() }, left),
            None => {
                let output = part.outputs.iter().find(|output| output.name.value == source.port);
                if output.is_none() && node.replaced.is_some() {
                    // Reported with all other differences between the part and what it replaces.
                    return Ok(whole(self.name(node, copy)));
                }
                let output = output.ok_or_else(|| {
                    let known = part.outputs.iter().map(|output| &output.name.value);
                    GraphError::unknown("output of a part", &source.port, known)
                })?;
                scope.follow(&output.from.value, left)
            }
        }
    }
}

/// What tells a graph from others: of a file, its real path, whatever the way to it.
fn identity(path: &str, origin: Origin) -> PathBuf {
    let path = Path::new(path);
    match origin {
        Origin::File => path.canonicalize().unwrap_or_else(|_| path.to_owned()),
        Origin::Shipped | Origin::Option => path.to_owned(),
    }
}

fn defaulted<'f>(file: &'f GraphFile, text: &Spanned<String>) -> Given<'f> {
    Given { text: text.clone(), file }
}

/// Collects the nodes of a flattened graph, and all problems.
struct Builder<'f> {
    flat: Flat<'f>,
    problems: Problems,
    /// The number of parts, of all copies.
    parts: usize,
    /// True once there are too many nodes.
    is_over: bool,
    /// The files and the spans of problems that are not listed.
    counted: HashSet<(usize, Span)>,
}

impl<'f> Builder<'f> {
    /// Reports a problem, once for all copies of a node and all places that include a file.
    fn report(&mut self, file: &GraphFile, span: Span, problem: impl FnOnce() -> Problem) {
        if self.problems.is_full() {
            // To be told apart by its place alone, without making it.
            if self.counted.insert((std::ptr::from_ref(file) as usize, span)) {
                self.problems.count(1);
            }
            return;
        }
        let problem = problem().at(file.place(span));
        let known = |other: &Problem| (&other.error, &other.place) == (&problem.error, &problem.place);
        if !self.problems.0.iter().any(known) {
            self.problems.0.push(problem);
        }
    }

    fn problem(&mut self, file: &GraphFile, node: &str, span: Span, error: impl FnOnce() -> GraphError) {
        self.report(file, span, || Problem::new(error()).node(node));
    }

    /// Reports nodes whose address is that of a node in a part.
    fn check_names(&mut self) {
        let mut names = BTreeSet::new();
        for node in &self.flat.nodes {
            let name = &node.def.name;
            if !names.insert(&name.value) {
                let error = || GraphError::Duplicate { what: "node", name: name.value.clone() };
                self.problems.add(|| Problem::new(error()).at(node.file.place(name.span)));
            }
        }
    }

    /// Adds the nodes of a scope; `written` is the address of its part in the text, with a slash.
    fn add(&mut self, scope: &Scope<'_, 'f>, written: &str, default: PartDefaults) {
        let file = scope.file;
        // Those that a change hands into a part have no name of their own.
        for param in file.params.iter().filter(|param| is_identifier(&param.name.value)) {
            let part = scope.prefix.trim_end_matches('/').to_owned();
            let value = scope.values[&param.name.value[..]].text.value.clone();
            self.flat.params.push(GraphValue { part, spec: param.spec.clone(), value });
        }
        for node in &file.nodes {
            let times = scope.times(node).unwrap_or_else(|given| {
                let place = given.file.place(given.text.span);
                // Unless the including node has been told already, or the graph has no such parameter.
                let is_told = self.problems.0.iter().any(|problem| problem.place.as_ref() == Some(&place));
                if !is_told && handed(&given.text.value).is_none() {
                    let (name, expected) = ("times".into(), times_expected());
                    let cause = format!("found `{}`", given.text.value);
                    let error = GraphError::Value { name, expected, cause };
                    self.problem(given.file, &scope.name(node, None), given.text.span, || error);
                }
                Some(1)
            });
            self.check_written(scope, node);
            let copies = times.map_or(vec![None], |times| (0..times).map(Some).collect());
            for copy in copies {
                // Parts without nodes multiply too.
                if self.is_over || self.flat.nodes.len().max(self.parts) >= MOST_NODES {
                    self.end(scope, node);
                    return;
                }
                self.add_node(scope, node, copy, format!("{written}{}", node.name.value), default);
            }
        }
    }

    /// Reports, once, that the graph has too many nodes, at the node and by the files that lead to it.
    fn end(&mut self, scope: &Scope<'_, 'f>, node: &NodeDef) {
        if std::mem::replace(&mut self.is_over, true) {
            return;
        }
        let mut files = vec![&scope.file.path[..]];
        let mut within = scope;
        while let Some((outer, ..)) = within.outer {
            files.push(&outer.file.path);
            within = outer;
        }
        files.reverse();
        let text = format!(
            "the graph has more than {MOST_NODES} nodes or parts, as parts that contain parts and repeated nodes multiply: {}",
            files.join(" -> ")
        );
        self.problem(scope.file, &scope.name(node, None), node.name.span, || GraphError::Invalid(text));
    }

    /// Checks what can be checked before the node's kind is known.
    fn check_written(&mut self, scope: &Scope<'_, 'f>, node: &'f NodeDef) {
        let (file, name) = (scope.file, scope.name(node, None));
        for value in node.values() {
            if let Some(param) = handed(&value.value).filter(|param| file.param(param).is_none()) {
                let known = file.params.iter().map(|param| &param.name.value);
                let error = || match file.params.is_empty() {
                    true => GraphError::Invalid(format!(
                        "the graph has no parameters; write params: {{ {param:?}: (default: VALUE) }} beside `nodes`"
                    )),
                    false => GraphError::unknown("parameter of the graph", &param, known),
                };
                self.problem(file, &name, value.span, error);
            }
        }
        let counted = node.repeat.as_ref().and_then(|repeat| repeat.count.as_ref());
        if let Some(param) =
            node.params.iter().find(|param| Some(&param.name.value) == counted.map(|c| &c.value))
        {
            let text = format!("`repeat` counts `{}`; do not set it here", param.name.value);
            self.problem(file, &name, param.name.span, || GraphError::Invalid(text));
        }
        let part = file.part(&node.name.value);
        for (address, _) in &node.set {
            if node.kind.value != PART_KIND && node.repeat.is_none() {
                let text =
                    "`set` is for parts and repeated nodes; a stage's own parameters are set in `params`";
                self.problem(file, &name, address.span, || GraphError::Invalid(text.into()));
                break;
            }
            if node.kind.value == PART_KIND && part.is_none() {
                continue;
            }
            let (copy, rest) = if node.repeat.is_some() {
                copy_of(&address.value)
            } else {
                (None, Some(&address.value[..]))
            };
            let found = scope.reaches(node, copy, rest);
            if matches!(found, Ok(true)) {
                continue;
            }
            let error = || match found {
                Ok(_) => {
                    let copies =
                        (0..scope.times(node).ok().flatten().unwrap_or(0)).map(|copy| copy.to_string());
                    let known = copies.chain(part.into_iter().flat_map(GraphFile::addresses));
                    GraphError::unknown_node(&address.value, known)
                }
                Err(error) => error,
            };
            self.problem(file, &name, address.span, error);
        }
    }

    fn add_node(
        &mut self,
        scope: &Scope<'_, 'f>,
        node: &'f NodeDef,
        copy: Option<u32>,
        written: String,
        default: PartDefaults,
    ) {
        let name = scope.name(node, copy);
        let part = scope.file.part(&node.name.value);
        let mut default = default;
        if let Some(replaced) = &node.replaced {
            self.flat.swaps.insert(name.clone(), Swap { node, file: scope.file, part });
            default = PartDefaults {
                side: replaced.on.or(default.side),
                part: default.part.filter(|_| replaced.on.is_none()),
                download: replaced.download.or(default.download),
            };
        }
        if node.kind.value != PART_KIND {
            let mut open = Vec::new();
            let mut def = NodeDef { inputs: self.inputs(scope, node, copy, &mut open), ..node.clone() };
            def.name.value = name;
            let mut places = BTreeMap::new();
            def.params.clear();
            for (name, value) in scope.params(node, copy) {
                put(&mut def.params, &mut places, name, scope.file, value);
            }
            for set in scope.set_for(node, copy).into_iter().filter(|set| set.node.is_empty()) {
                put(&mut def.params, &mut places, set.name.clone(), set.file, set.value);
            }
            places.retain(|_, places: &mut ParamPlaces| !places.are(scope.file));
            self.flat.nodes.push(FlatNode { def, file: scope.file, default, places, written, open });
            return;
        }
        if node.bypass {
            let error = || GraphError::Invalid("a part cannot be bypassed; bypass its nodes".into());
            self.problem(scope.file, &name, node.name.span, error);
        }
        let Some(part) = part else {
            let error = || GraphError::Invalid("its file has not been read".into());
            self.problem(scope.file, &name, node.kind.span, error);
            return;
        };
        self.check_inputs(scope, node, &name, part);
        self.check_params(scope, node, copy, part);
        self.parts += 1;
        let placed = node.on.clone().map(|on| {
            self.flat.placed.push(PlacedPart { node: name.clone(), on, file: scope.file });
            self.flat.placed.len() - 1
        });
        let default = PartDefaults {
            side: node.on.as_ref().map(|on| on.value).or(default.side),
            part: placed.or(default.part),
            download: node.download.as_ref().map(|download| download.value).or(default.download),
        };
        self.add(&scope.inner(node, copy, part), &(written + "/"), default);
    }

    /// The wires into a stage; also those that are `open`, as they lead to an input of a part that is not connected.
    fn inputs(
        &mut self,
        scope: &Scope<'_, 'f>,
        node: &NodeDef,
        copy: Option<u32>,
        open: &mut Vec<(String, Source)>,
    ) -> Vec<InputDef> {
        let through = node.repeat.iter().flat_map(|repeat| &repeat.through).filter(|_| copy > Some(0));
        let through = through.map(|(input, output)| (input, output.span));
        let taken: BTreeSet<&str> = through.clone().map(|(input, _)| input.value.as_str()).collect();
        let written = node.inputs.iter().map(|input| (&input.port, input.from.span));
        let written = written.filter(|(port, _)| !taken.contains(port.value.as_str()));
        let mut inputs = Vec::new();
        for (port, span) in written.chain(through) {
            let Some(source) = scope.input(node, copy, &port.value) else { continue };
            match scope.resolve(&source) {
                Ok(Some(value)) => {
                    inputs.push(InputDef { port: port.clone(), from: Spanned { value, span } })
                }
                Ok(None) => {
                    let part = scope.prefix.trim_end_matches('/').to_owned();
                    open.push((port.value.clone(), Source { node: part, port: source.port }));
                }
                Err(error) => {
                    let name = scope.name(node, copy);
                    self.report(scope.file, span, || Problem::new(error).node(&name).port(&port.value));
                }
            }
        }
        inputs
    }

    /// Checks the names and the sources of what is connected to a part.
    fn check_inputs(&mut self, scope: &Scope<'_, 'f>, node: &NodeDef, name: &str, part: &GraphFile) {
        let taken = part.taken();
        let through = node.repeat.iter().flat_map(|repeat| &repeat.through);
        let ports =
            node.inputs.iter().map(|input| &input.port).chain(through.clone().map(|(input, _)| input));
        for port in ports.filter(|port| !taken.contains(port.value.as_str())) {
            let error = || GraphError::unknown("input", &port.value, &taken);
            self.report(scope.file, port.span, || Problem::new(error()).node(name).port(&port.value));
        }
        let first = |output: &Spanned<String>| Source {
            node: format!("{}/0", node.name.value),
            port: output.value.clone(),
        };
        let chained = through.map(|(input, output)| (input, first(output), output.span));
        let written =
            node.inputs.iter().map(|input| (&input.port, input.from.value.clone(), input.from.span));
        for (port, source, span) in written.chain(chained) {
            if let Err(error) = scope.resolve(&source) {
                self.report(scope.file, span, || Problem::new(error).node(name).port(&port.value));
            }
        }
    }

    /// Checks the parameters of a part: those beside `file`, and those that are set elsewhere.
    fn check_params(
        &mut self,
        scope: &Scope<'_, 'f>,
        node: &'f NodeDef,
        copy: Option<u32>,
        part: &'f GraphFile,
    ) {
        let beside = scope.params(node, copy).into_iter().filter(|(name, _)| name.value != FILE_PARAM);
        let beside = beside.map(|(name, value)| (name, scope.file, value));
        let set = scope.set_for(node, copy).into_iter().filter(|set| set.node.is_empty());
        let set = set.map(|set| (set.name.clone(), set.file, set.value));
        let address = scope.name(node, copy);
        for (name, file, value) in beside.chain(set) {
            if name.value == FILE_PARAM {
                self.problem(file, &address, name.span, file_elsewhere);
                continue;
            }
            match part.settable(&name.value, &address) {
                Ok(param) => {
                    if let Err(error) = param.spec.check(&value.text.value) {
                        let error = param.spec.refusal(&value.text.value, error);
                        self.problem(value.file, &address, value.text.span, || error);
                    }
                }
                Err(error) => self.problem(file, &address, name.span, || error),
            }
        }
    }
}

/// What to report of setting a part's file from outside.
pub(super) fn file_elsewhere() -> GraphError {
    let text = "a part's `file` is named where the part is included, in its `params`";
    GraphError::Invalid(text.into())
}

/// Adds a parameter, or replaces the one of this name.
fn put<'f>(
    params: &mut Vec<ParamDef>,
    places: &mut BTreeMap<String, ParamPlaces<'f>>,
    name: Spanned<String>,
    file: &'f GraphFile,
    value: Given<'f>,
) {
    params.retain(|param| param.name.value != name.value);
    places.insert(name.value.clone(), ParamPlaces { name: file, value: value.file });
    params.push(ParamDef { name, value: value.text });
}

impl ParamPlaces<'_> {
    fn are(&self, file: &GraphFile) -> bool {
        [self.name, self.value].into_iter().all(|own| std::ptr::eq(own, file))
    }
}
