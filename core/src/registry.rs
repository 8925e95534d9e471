//! The stage kinds that graph files may name.

use std::{collections::BTreeMap, marker::PhantomData, path::Path, sync::OnceLock};

use crate::{
    constant::Constant,
    error::{GraphError, Problem, Problems, Span},
    facts::{Facts, Quantity},
    file::{GraphFile, NodeDef, ParamDef, ParamPlaces},
    params::{ParamError, ParamSpec, Params},
    port::{Extent, Meaning, Port},
    shader::{EditedTexts, ShaderLibrary, ShaderModule},
    stage::{AnyStage, Bound, Declaration, Stage},
};

/// A node's definition in its file, and what its kind may query about its surroundings.
pub struct NodeContext<'a> {
    /// The file, for error places and relative paths.
    pub file: &'a GraphFile,
    /// The node.
    pub node: &'a NodeDef,
    /// Whether an input will be connected.
    pub connected: &'a dyn Fn(&str) -> bool,
    /// All kinds, whose meanings, quantities and columns a node may name, and the shader modules.
    pub registry: &'a Registry,
    /// The places of parameters that are written outside `file`, by parameter name.
    pub places: &'a BTreeMap<String, ParamPlaces<'a>>,
}

impl NodeContext<'_> {
    /// A problem of this node at a place of its file.
    pub fn problem(&self, error: GraphError, span: Span) -> Problem {
        self.problem_in(self.file, error, span)
    }

    /// A problem of a parameter's name.
    pub fn name_problem(&self, param: &ParamDef, error: GraphError) -> Problem {
        self.problem_in(self.places(param).name, error, param.name.span)
    }

    /// A problem of a parameter's value.
    pub fn value_problem(&self, param: &ParamDef, error: GraphError) -> Problem {
        self.problem_in(self.places(param).value, error, param.value.span)
    }

    fn problem_in(&self, file: &GraphFile, error: GraphError, span: Span) -> Problem {
        Problem::new(error).at(file.place(span)).node(&self.node.name.value)
    }

    /// The base folder of a relative path in a parameter: that of the file that the path is written in.
    pub fn folder(&self, param: &ParamDef) -> &Path {
        self.places(param).value.folder_at(param.value.span)
    }

    fn places(&self, param: &ParamDef) -> ParamPlaces<'_> {
        let here = ParamPlaces { name: self.file, value: self.file };
        self.places.get(&param.name.value).copied().unwrap_or(here)
    }

    /// Sets each parameter that the node names by calling `set(index, text)`; reports all unknown names, values that do
    /// not parse and values out of range.
    pub fn set_params(
        &self,
        specs: &[ParamSpec],
        mut set: impl FnMut(usize, &str) -> Result<(), ParamError>,
    ) -> Problems {
        let mut problems = Problems::default();
        for param in &self.node.params {
            let Some(index) = specs.iter().position(|spec| spec.name == param.name.value) else {
                let known = || specs.iter().map(|spec| &spec.name);
                let error = || GraphError::unknown("parameter", &param.name.value, known());
                problems.add(|| self.name_problem(param, error()));
                continue;
            };
            if let Err(error) = set(index, &param.value.value) {
                let error = specs[index].refusal(&param.value.value, error);
                problems.add(|| self.value_problem(param, error));
            }
        }
        problems
    }
}

/// Makes stages of one kind.
pub trait Kind: Send + Sync {
    /// Its name in graph files.
    fn name(&self) -> &'static str;
    /// One line.
    fn doc(&self) -> &'static str;
    /// The kind's parameters that do not depend on the node.
    fn specs(&self) -> Vec<ParamSpec>;
    /// Its ports, shader and passes with default parameters and every optional input connected; `None` if they depend
    /// on the node.
    fn declaration(&self) -> Option<Declaration>;
    /// The function that is its CPU twin, as profilers name it; `None` if it runs only on the GPU.
    fn twin(&self) -> Option<String> {
        None
    }
    /// Makes a stage with the node's parameters, or returns all problems.
    fn make(&self, cx: &NodeContext) -> Result<Box<dyn AnyStage>, Problems>;
}

struct StageKind<S>(PhantomData<fn() -> S>);

impl<S: Stage> Kind for StageKind<S> {
    fn name(&self) -> &'static str {
        S::KIND
    }
    fn doc(&self) -> &'static str {
        S::DOC
    }
    fn specs(&self) -> Vec<ParamSpec> {
        S::Params::specs()
    }
    fn declaration(&self) -> Option<Declaration> {
        Some(Bound::<S>::new(S::Params::default(), &|_| true).declaration)
    }
    fn twin(&self) -> Option<String> {
        Some(format!("<{} as epigraph_core::stage::Stage>::cpu", std::any::type_name::<S>()))
    }
    fn make(&self, cx: &NodeContext) -> Result<Box<dyn AnyStage>, Problems> {
        let mut params = S::Params::default();
        cx.set_params(&S::Params::specs(), |index, text| params.set(index, text)).into_result()?;
        Ok(Box::new(Bound::<S>::new(params, cx.connected)))
    }
}

/// Each value once, in the order of their first occurrence.
fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for value in values {
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}

/// The count of a quantity, computed from what the application states.
type Count = dyn Fn(&Facts) -> Option<u32> + Send + Sync;

/// All stage kinds, and the shader modules that they share.
#[derive(Default)]
pub struct Registry {
    kinds: BTreeMap<&'static str, Box<dyn Kind>>,
    /// Shared shader modules.
    pub library: ShaderLibrary,
    counts: Vec<(Quantity, Box<Count>)>,
    /// The ports of all kinds, once they are asked for: to declare a kind anew for each node would take longer than all
    /// other checks of the node.
    ports: OnceLock<Vec<Port>>,
}

impl Registry {
    /// Adds a stage.
    pub fn with<S: Stage>(self) -> Self {
        self.with_kind(Box::new(StageKind::<S>(PhantomData)))
    }

    /// Adds a kind that is not a plain stage, such as `wgsl`.
    pub fn with_kind(mut self, kind: Box<dyn Kind>) -> Self {
        self.kinds.insert(kind.name(), kind);
        self.ports = OnceLock::new();
        self
    }

    /// Adds a shared shader module.
    pub fn with_module(mut self, module: ShaderModule) -> Self {
        self.library.modules.push(module);
        self
    }

    /// Takes these texts for shaders, those of `wgsl` nodes and those that are embedded: for an editor, which has texts
    /// that no file holds yet. [`compile`](crate::compile) checks each shader that differs from what is embedded.
    pub fn with_edited(mut self, texts: EditedTexts) -> Self {
        self.library.edited = texts;
        self
    }

    /// Gives constants, made with [`crate::constants!`], to the module with this name.
    ///
    /// # Panics
    /// If there is no such module.
    pub fn with_constants(mut self, module: &str, constants: &[Constant]) -> Self {
        let module = self.library.modules.iter_mut().find(|known| known.import() == module);
        module.expect("a module before its constants").constants.extend_from_slice(constants);
        self
    }

    /// Defines the count of a quantity of your own. `count` is called with what the application states; it returns `None` if
    /// that is not enough.
    pub fn with_count(
        mut self,
        quantity: Quantity,
        count: impl Fn(&Facts) -> Option<u32> + Send + Sync + 'static,
    ) -> Self {
        self.counts.push((quantity, Box::new(count)));
        self
    }

    /// What the application states, with what the stages' crates derive from it.
    pub(crate) fn facts(&self, stated: &Facts) -> Facts {
        let add = |facts: Facts, (quantity, count): &(Quantity, Box<Count>)| match count(&facts) {
            Some(count) => facts.with(*quantity, count),
            None => facts,
        };
        self.counts.iter().fold(stated.clone(), add)
    }

    /// The kind with this name.
    pub fn get(&self, name: &str) -> Option<&dyn Kind> {
        self.kinds.get(name).map(Box::as_ref)
    }

    /// The meanings of the stages' ports, each once.
    pub fn meanings(&self) -> Vec<Meaning> {
        distinct(self.ports().iter().filter_map(|port| port.meaning))
    }

    /// The meaning with this name, among those of the stages' ports.
    pub fn meaning(&self, name: &str) -> Option<Meaning> {
        self.ports().iter().filter_map(|port| port.meaning).find(|meaning| meaning.name == name)
    }

    /// The quantities that are the length of a stage's list or have a count of their own, each once.
    pub fn quantities(&self) -> Vec<Quantity> {
        let lists = self.ports().iter().filter_map(|port| match port.extent {
            Extent::Each(quantity) => Some(quantity),
            _ => None,
        });
        distinct(lists.chain(self.counts.iter().map(|(quantity, _)| *quantity)))
    }

    /// The columns of the table of times that stages count towards, each once.
    pub fn columns(&self) -> Vec<&'static str> {
        distinct(self.kinds().filter_map(Kind::declaration).filter_map(|declared| declared.column))
    }

    fn ports(&self) -> &[Port] {
        self.ports.get_or_init(|| {
            self.kinds().filter_map(Kind::declaration).flat_map(|declared| declared.ports).collect()
        })
    }

    /// All kinds in alphabetical order.
    pub fn kinds(&self) -> impl Iterator<Item = &dyn Kind> {
        self.kinds.values().map(Box::as_ref)
    }
}
