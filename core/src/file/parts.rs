//! Graphs made of graphs. A node `"NAME": (kind: "graph", params: (file: "part.ron"), inputs: { "x": "NODE.PORT" })`
//! includes all nodes of another file, a part. Within the part, `"inputs.x"` is whatever the including node connects to
//! `x`; outside, the part's outputs are ports of the including node, and its nodes have addresses `NAME/NODE`. `on` and
//! `download` of the including node are the defaults for nodes of the part that can run there. `set: { "NODE": (param:
//! value) }` in the including node overrides parameters of the part.
//!
//! [`GraphFile::flatten`] expands everything to one list of nodes, each with the file it comes from, so that checking
//! and compiling need not know about parts.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    io,
    path::Path,
};

use index_vec::IndexVec;

use super::{GraphFile, NodeDef, OutputDef, ParamDef, Source};
use crate::{
    error::{GraphError, Problem, Problems, Span, Spanned},
    id::FlatId,
    side::{Download, Side},
};

/// The kind of a node that includes a file.
pub(crate) const PART_KIND: &str = "graph";

/// The parameter that names the file.
const FILE_PARAM: &str = "file";

/// The node whose ports are a part's inputs.
const INPUTS: &str = "inputs";

/// A node of the flattened graph, with the file that its places refer to.
pub(crate) struct FlatNode<'f> {
    pub def: NodeDef,
    pub file: &'f GraphFile,
    /// The defaults that the part's node gives.
    pub default: PartDefaults,
    /// The files of parameters that an including node overrides, by parameter name.
    pub set_in: BTreeMap<String, &'f GraphFile>,
}

/// Default placement of a part's nodes.
#[derive(Clone, Copy, Default)]
pub(crate) struct PartDefaults {
    pub side: Option<Side>,
    pub download: Option<Download>,
}

/// A flattened graph.
pub(crate) struct Flat<'f> {
    pub file: &'f GraphFile,
    pub nodes: IndexVec<FlatId, FlatNode<'f>>,
    pub outputs: Vec<OutputDef>,
}

impl GraphFile {
    /// Reads the files of all parts, recursively. `read` returns the text of a path.
    ///
    /// # Errors
    /// All problems of all parts, each with its file.
    pub fn with_parts(mut self, read: &dyn Fn(&Path) -> io::Result<String>) -> Result<Self, Problems> {
        self.read_parts(read, &mut Vec::new())?;
        Ok(self)
    }

    fn read_parts(
        &mut self,
        read: &dyn Fn(&Path) -> io::Result<String>,
        within: &mut Vec<String>,
    ) -> Result<(), Problems> {
        within.push(self.path.clone());
        let mut problems = Problems::default();
        let mut parts = Vec::new();
        for node in self.nodes.iter().filter(|node| node.kind.value == PART_KIND) {
            match self.read_part(node, read, within) {
                Ok(part) => parts.push((node.name.value.clone(), part)),
                Err(found) => problems.0.extend(found.0),
            }
        }
        within.pop();
        problems.into_result()?;
        self.parts = parts;
        Ok(())
    }

    fn read_part(
        &self,
        node: &NodeDef,
        read: &dyn Fn(&Path) -> io::Result<String>,
        within: &mut Vec<String>,
    ) -> Result<Self, Problems> {
        let problem = |error, span| Problem::new(error).at(self.place(span)).node(&node.name.value);
        if let Some(param) = node.params.iter().find(|param| param.name.value != FILE_PARAM) {
            let error = GraphError::unknown("parameter", &param.name.value, [FILE_PARAM]);
            return Err(problem(error, param.name.span).into());
        }
        let Some(param) = node.params.iter().find(|param| param.name.value == FILE_PARAM) else {
            let text = "a node of kind `graph` names its file: params: (file: \"PART.ron\")";
            return Err(problem(GraphError::Invalid(text.into()), node.kind.span).into());
        };
        let name: String = ron::from_str(&param.value.value).map_err(|error| {
            let (name, expected) = (FILE_PARAM.into(), "a path in double quotes".into());
            problem(GraphError::Value { name, expected, cause: error.code.to_string() }, param.value.span)
        })?;
        let path = Path::new(&self.path).parent().unwrap_or(Path::new("")).join(name);
        let shown = path.display().to_string();
        if within.contains(&shown) {
            let error = GraphError::Invalid(format!("{shown} contains itself"));
            return Err(problem(error, param.value.span).into());
        }
        let text = read(&path).map_err(|error| {
            let cause = format!("{shown}: {error}");
            problem(GraphError::Io { action: "read", cause }, param.value.span)
        })?;
        let mut part = Self::parse(&shown, &text)?;
        part.read_parts(read, within)?;
        Ok(part)
    }

    pub(super) fn part_mut(&mut self, node: &str) -> Option<&mut Self> {
        self.parts.iter_mut().find(|(name, _)| name == node).map(|(_, part)| part)
    }

    pub(super) fn part(&self, node: &str) -> Option<&Self> {
        self.parts.iter().find(|(name, _)| name == node).map(|(_, part)| part)
    }

    /// The address of a node given by its own name alone: the name itself if the graph has such a node, otherwise the
    /// address in its parts if it is unambiguous. Other names are returned unchanged.
    pub fn address_of(&self, name: &str) -> String {
        let mut found = Vec::new();
        self.find(name, "", &mut found);
        match &found[..] {
            [address] if self.nodes.iter().all(|node| node.name.value != name) => address.clone(),
            _ => name.to_owned(),
        }
    }

    fn find(&self, name: &str, prefix: &str, found: &mut Vec<String>) {
        let own = self.nodes.iter().filter(|node| node.name.value == name);
        found.extend(own.map(|_| format!("{prefix}{name}")));
        for (node, part) in &self.parts {
            part.find(name, &format!("{prefix}{node}/"), found);
        }
    }

    /// The names of all nodes, including those in parts.
    pub(super) fn names(&self) -> Vec<&str> {
        let own = self.nodes.iter().map(|node| node.name.value.as_str());
        own.chain(self.parts.iter().flat_map(|(_, part)| part.names())).collect()
    }

    /// The node with this address and the file that contains it, a part or this one.
    pub fn node_at(&self, address: &str) -> Option<(&NodeDef, &Self)> {
        match address.split_once('/') {
            Some((node, rest)) => self.part(node)?.node_at(rest),
            None => Some((self.node(address)?, self)),
        }
    }

    /// Flattens the graph: replaces each node that includes a part by the part's nodes.
    pub(crate) fn flatten(&self) -> Result<Flat<'_>, Problems> {
        let mut flat = Flat { file: self, nodes: IndexVec::new(), outputs: Vec::new() };
        let mut problems = Problems::default();
        let scope = Scope::whole(self);
        add(&scope, PartDefaults::default(), &mut flat, &mut problems);
        for output in &self.outputs {
            match scope.resolve(&output.from.value) {
                Ok(Some(source)) => {
                    let from = Spanned { value: source, span: output.from.span };
                    flat.outputs.push(OutputDef { name: output.name.clone(), from });
                }
                Ok(None) => {}
                Err(error) => {
                    let problem = Problem::new(error).at(self.place(output.from.span));
                    problems.0.push(problem.port(&output.name.value));
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
        let scope = Scope::whole(self.file);
        let source = Source { node: self.file.address_of(&source.node), port: source.port.clone() };
        Ok(scope.resolve(&source)?.unwrap_or(source))
    }
}

/// A file within the flattened graph: resolves its names.
struct Scope<'f> {
    file: &'f GraphFile,
    prefix: String,
    /// What the including node connects; `None` for the top-level file.
    inputs: Option<HashMap<String, Source>>,
    /// Parameters that including nodes override, by the address of their node in this file; outer files last.
    set: Vec<Set<'f>>,
}

/// A parameter that an including node overrides.
#[derive(Clone)]
struct Set<'f> {
    node: &'f str,
    param: &'f ParamDef,
    file: &'f GraphFile,
}

impl<'f> Scope<'f> {
    fn whole(file: &'f GraphFile) -> Self {
        Self { file, prefix: String::new(), inputs: None, set: Vec::new() }
    }

    fn inner(&self, node: &str, file: &'f GraphFile, inputs: HashMap<String, Source>) -> Self {
        Self { file, prefix: format!("{}{node}/", self.prefix), inputs: Some(inputs), set: Vec::new() }
    }

    /// What this file and the files that include it override in the part of `node`.
    fn set_within(&self, node: &'f NodeDef) -> Vec<Set<'f>> {
        let own = node.set.iter().flat_map(|(address, params)| {
            params.iter().map(|param| Set { node: &address.value, param, file: self.file })
        });
        let outer = self.set.iter().filter_map(|set| {
            let rest = set.node.strip_prefix(node.name.value.as_str())?.strip_prefix('/')?;
            Some(Set { node: rest, ..set.clone() })
        });
        own.chain(outer).collect()
    }

    /// The address of a port in the flattened graph; `None` for a part's input that is not connected.
    fn resolve(&self, source: &Source) -> Result<Option<Source>, GraphError> {
        if let (INPUTS, Some(inputs)) = (source.node.as_str(), &self.inputs) {
            return Ok(inputs.get(&source.port).cloned());
        }
        let (head, rest) = match source.node.split_once('/') {
            Some((head, rest)) => (head, Some(rest)),
            None => (source.node.as_str(), None),
        };
        let Some(part) = self.file.part(head) else {
            return Ok(Some(Source {
                node: format!("{}{}", self.prefix, source.node),
                port: source.port.clone(),
            }));
        };
        let scope = self.inner(head, part, HashMap::new());
        match rest {
            Some(rest) => scope.resolve(&Source { node: rest.into(), port: source.port.clone() }),
            None => {
                let output = part.outputs.iter().find(|output| output.name.value == source.port);
                let output = output.ok_or_else(|| {
                    let known = part.outputs.iter().map(|output| &output.name.value);
                    GraphError::unknown("output of a part", &source.port, known)
                })?;
                scope.resolve(&output.from.value)
            }
        }
    }
}

fn add<'f>(scope: &Scope<'f>, default: PartDefaults, flat: &mut Flat<'f>, problems: &mut Problems) {
    for node in &scope.file.nodes {
        let name = format!("{}{}", scope.prefix, node.name.value);
        let mut problem = |error, span: Span, port: Option<&str>| {
            let mut problem = Problem::new(error).at(scope.file.place(span)).node(&name);
            problem.port = port.map(str::to_owned);
            problems.0.push(problem);
        };
        let mut def = node.clone();
        def.name.value.clone_from(&name);
        def.inputs.clear();
        for input in &node.inputs {
            match scope.resolve(&input.from.value) {
                Ok(Some(source)) => {
                    let mut input = input.clone();
                    input.from.value = source;
                    def.inputs.push(input);
                }
                Ok(None) => {}
                Err(error) => problem(error, input.from.span, Some(&input.port.value)),
            }
        }
        if node.kind.value != PART_KIND {
            if let Some((address, _)) = node.set.first() {
                let text = "`set` is for parts; a stage's own parameters are set in `params`";
                problem(GraphError::Invalid(text.into()), address.span, None);
            }
            let mut set_in = BTreeMap::new();
            for set in scope.set.iter().filter(|set| set.node == node.name.value) {
                def.params.retain(|param| param.name.value != set.param.name.value);
                def.params.push(set.param.clone());
                set_in.insert(set.param.name.value.clone(), set.file);
            }
            flat.nodes.push(FlatNode { def, file: scope.file, default, set_in });
            continue;
        }
        if node.bypass {
            problem(
                GraphError::Invalid("a part cannot be bypassed; bypass its nodes".into()),
                node.name.span,
                None,
            );
        }
        let Some(part) = scope.file.part(&node.name.value) else {
            problem(GraphError::Invalid("its file has not been read".into()), node.kind.span, None);
            continue;
        };
        for (address, _) in node.set.iter().filter(|(address, _)| part.node_at(&address.value).is_none()) {
            problem(GraphError::unknown("node", &address.value, part.names()), address.span, None);
        }
        let taken: BTreeSet<&str> = part
            .nodes
            .iter()
            .flat_map(|node| &node.inputs)
            .filter(|input| input.from.value.node == INPUTS)
            .map(|input| input.from.value.port.as_str())
            .collect();
        for input in &node.inputs {
            if !taken.contains(input.port.value.as_str()) {
                let error = GraphError::unknown("input", &input.port.value, &taken);
                problem(error, input.port.span, Some(&input.port.value));
            }
        }
        let inputs =
            def.inputs.iter().map(|input| (input.port.value.clone(), input.from.value.clone())).collect();
        let inner = Scope { set: scope.set_within(node), ..scope.inner(&node.name.value, part, inputs) };
        let default = PartDefaults {
            side: def.on.map(|on| on.value).or(default.side),
            download: def.download.map(|download| download.value).or(default.download),
        };
        add(&inner, default, flat, problems);
    }
}
