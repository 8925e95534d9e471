//! Changes to a graph that fit into a word: options of a command line, and variants of a graph by name.

use std::{collections::BTreeSet, path::Path};

use epigraph_core::{
    Access, Declaration, GraphError, GraphFile, Place, Port, Problem, Problems, Registry, Source,
};

use crate::graphs::Shipped;

/// A change to a graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    what: What,
    /// The change as written, without the option's name.
    text: String,
    /// The option's text for messages: `--swap interpolate=mine.wgsl`, or `+swap:interpolate=mine.wgsl` in a name.
    option: String,
}

/// The kinds of change, in the order in which those of one graph are made.
#[derive(Clone, Debug, PartialEq)]
enum What {
    Swap { node: String, with: String },
    Insert { to: Source, with: String },
    Wire { to: Source, from: Option<Source> },
    Set { node: String, param: String, value: String },
}

/// Reads a change of one kind.
type Parse = fn(&str) -> Result<Change, String>;

/// The words that mark a change within a graph's name, other than a parameter.
const WORDS: [(&str, Parse); 3] =
    [("swap", Change::swap), ("insert", Change::insert), ("wire", Change::wire)];

/// What disconnects an input.
const NONE: &str = "none";

impl Change {
    /// The change as it follows a plus in a graph's name: `interpolate.sigma=0.5`, `swap:interpolate=mine.wgsl`.
    pub fn piece(&self) -> String {
        match self.what {
            What::Swap { .. } => format!("swap:{}", self.text),
            What::Insert { .. } => format!("insert:{}", self.text),
            What::Wire { .. } => format!("wire:{}", self.text),
            What::Set { .. } => self.text.clone(),
        }
    }

    /// Another definition for a node: `NODE=FILE.wgsl`, `NODE=KIND` or `NODE=PART.ron`.
    ///
    /// # Errors
    /// Text of another form.
    pub fn swap(text: &str) -> Result<Self, String> {
        let expected = "expected NODE=FILE.wgsl, NODE=KIND or NODE=PART.ron, such as interpolate=mine.wgsl";
        let (node, with) = halves(text, expected)?;
        Ok(Self::new("swap", text, What::Swap { node: node.into(), with: with.into() }))
    }

    /// A new node in a wire, given by the input where the wire ends: `NODE.PORT=FILE.wgsl`, `=KIND` or `=PART.ron`.
    ///
    /// # Errors
    /// Text of another form.
    pub fn insert(text: &str) -> Result<Self, String> {
        let expected = "expected NODE.PORT=FILE.wgsl, NODE.PORT=KIND or NODE.PORT=PART.ron, such as \
                        tonemap.color=median.wgsl, where NODE.PORT is the input that the new node comes before";
        let (to, with) = halves(text, expected)?;
        let to = to.parse().map_err(|_| expected)?;
        Ok(Self::new("insert", text, What::Insert { to, with: with.into() }))
    }

    /// An input that is connected to another port, `NODE.PORT=NODE.PORT`, or disconnected, `NODE.PORT=none`.
    ///
    /// # Errors
    /// Text of another form.
    pub fn wire(text: &str) -> Result<Self, String> {
        let expected = "expected NODE.PORT=NODE.PORT, the input first, such as tonemap.color=spread.color, or \
                        NODE.PORT=none";
        let (to, from) = halves(text, expected)?;
        let to = to.parse().map_err(|_| expected)?;
        let from = match from {
            NONE => None,
            from => Some(from.parse().map_err(|_| expected)?),
        };
        Ok(Self::new("wire", text, What::Wire { to, from }))
    }

    /// A parameter: `NODE.PARAM=VALUE`, or `PARAM=VALUE` for one of the graph's own or of its only node that has it.
    ///
    /// # Errors
    /// Text of another form.
    pub fn set(text: &str) -> Result<Self, String> {
        let expected = "expected node.param=value, such as cull.threshold=0.1, or param=value";
        let (name, value) = halves(text, expected)?;
        let (node, param) = match name.rsplit_once('.') {
            Some((node, param)) if !node.is_empty() => (node, param),
            Some(_) => return Err(expected.into()),
            None => ("", name),
        };
        if param.is_empty() {
            return Err(expected.into());
        }
        let (node, param, value) = (node.into(), param.into(), value.into());
        Ok(Self::new("set", text, What::Set { node, param, value }))
    }

    fn new(option: &str, text: &str, what: What) -> Self {
        Self { what, text: text.into(), option: format!("--{option} {text}") }
    }

    /// Makes the change.
    fn apply(&self, file: &GraphFile, registry: &Registry) -> Result<GraphFile, Problems> {
        let option = &self.option;
        match &self.what {
            What::Swap { node, with } => {
                let address = file.whole()?.address_of(node);
                let fields = format!("replace: {{ {address:?}: ({}) }}", definition(with));
                file.changed(option, &fields, &Shipped)
            }
            What::Insert { to, with } => {
                self.put_before(file, to, with, registry).map_err(|problems| at(problems, option))
            }
            What::Wire { to, from } => {
                let whole = file.whole()?;
                let to = full(&whole, to).to_string();
                let from = from
                    .as_ref()
                    .map_or("None".into(), |from| format!("{:?}", full(&whole, from).to_string()));
                file.changed(option, &format!("rewire: {{ {to:?}: {from} }}"), &Shipped)
            }
            What::Set { node, param, value } => {
                let whole = file.whole()?;
                let node = match node.as_str() {
                    "" if whole.param(param).is_some() => String::new(),
                    "" => owner(file, param, registry).map_err(|problems| at(problems, option))?,
                    node => whole.address_of(node),
                };
                file.with_param(option, &node, param, value)
            }
        }
    }

    /// Inserts a node before an input or an output.
    fn put_before(
        &self,
        file: &GraphFile,
        to: &Source,
        with: &str,
        registry: &Registry,
    ) -> Result<GraphFile, Problems> {
        let whole = file.whole()?;
        let to = full(&whole, to);
        let from = whole.wire_into(&to.node, &to.port).ok_or_else(|| no_wire(&whole, &to))?;
        let name = free_name(&whole, with);
        let node = |inputs: &str| format!("nodes: {{ {name:?}: ({}{inputs}) }}", definition(with));
        // The node alone, to see its ports.
        let alone = file.changed(&self.option, &node(""), &Shipped)?;
        let [input, output] = ports(&alone, &name, [&to.port, &from.port], registry)?;
        let inputs = format!(", inputs: {{ {input:?}: {:?} }}", from.to_string());
        let rewire = format!("rewire: {{ {:?}: {:?} }}", to.to_string(), format!("{name}.{output}"));
        file.changed(&self.option, &format!("{}, {rewire}", node(&inputs)), &Shipped)
    }
}

/// Both sides of the first `=`.
fn halves<'t>(text: &'t str, expected: &str) -> Result<(&'t str, &'t str), String> {
    text.split_once('=').filter(|(a, b)| !a.is_empty() && !b.is_empty()).ok_or_else(|| expected.into())
}

/// What a node is, from the word for it: a shader file, a graph file or a kind.
fn definition(with: &str) -> String {
    match Path::new(with).extension().and_then(|ending| ending.to_str()) {
        Some("wgsl") => format!("kind: \"wgsl\", params: (shader: {with:?})"),
        Some("ron") => format!("kind: \"graph\", params: (file: {with:?})"),
        _ => format!("kind: {with:?}"),
    }
}

/// A port by the address of its node.
fn full(whole: &GraphFile, port: &Source) -> Source {
    Source { node: whole.address_of(&port.node), port: port.port.clone() }
}

/// Gives problems without a place that of an option.
fn at(mut problems: Problems, option: &str) -> Problems {
    for problem in &mut problems.0 {
        problem.place.get_or_insert_with(|| Place::file(option));
    }
    problems
}

/// A name for a new node: that of its file, or of its kind, with a number if it is taken.
fn free_name(whole: &GraphFile, with: &str) -> String {
    let stem = match definition(with).starts_with("kind: \"wgsl\"") || with.ends_with(".ron") {
        true => Path::new(with).file_stem().unwrap_or_default().to_string_lossy().replace('.', "-"),
        false => with.to_owned(),
    };
    let names = (1..).map(|number| if number == 1 { stem.clone() } else { format!("{stem}{number}") });
    names.into_iter().find(|name| whole.node(name).is_none()).expect("numbers do not end")
}

fn no_wire(whole: &GraphFile, to: &Source) -> GraphError {
    if to.node == "outputs" {
        let known = whole.outputs.iter().map(|output| &output.name.value);
        return GraphError::unknown("output", &to.port, known);
    }
    match whole.node_at(&to.node) {
        Some((node, _)) => {
            let known = node.inputs.iter().map(|input| &input.port.value);
            GraphError::unknown("connected input", &to.port, known)
        }
        None => whole.no_node(&to.node),
    }
}

/// The input and the output by which a new node is put in a wire: those with the name of a port at the wire's ends, or
/// else the only ones.
fn ports(
    file: &GraphFile,
    name: &str,
    ends: [&str; 2],
    registry: &Registry,
) -> Result<[String; 2], Problems> {
    let whole = file.whole()?;
    let choose = |what: &str, all: Vec<(String, bool)>| -> Result<String, GraphError> {
        let named = ends.iter().find(|end| all.iter().any(|(port, _)| port == *end));
        let needed: Vec<&String> = all.iter().filter(|(_, needed)| *needed).map(|(port, _)| port).collect();
        match (named, &needed[..], &all[..]) {
            (Some(named), ..) => Ok((*named).to_owned()),
            (None, [only], _) => Ok((*only).clone()),
            (None, [], [(only, _)]) => Ok(only.clone()),
            _ => {
                let all: Vec<&str> = all.iter().map(|(port, _)| port.as_str()).collect();
                let list = if all.is_empty() { "none".to_owned() } else { all.join(", ") };
                Err(GraphError::Invalid(format!(
                    "which {what} of `{name}` belongs into the wire? One that is called `{}` would, but it has {list}; \
                     write a graph file with `base`, `nodes` and `rewire`",
                    ends[0]
                )))
            }
        }
    };
    if let Some((_, part)) = whole.parts.iter().find(|(part, _)| part == name) {
        let inputs: BTreeSet<&str> = part.taken();
        let input = choose("input", inputs.iter().map(|port| ((*port).to_owned(), true)).collect())?;
        let outputs = part.outputs.iter().map(|output| (output.name.value.clone(), true));
        return Ok([input, choose("output", outputs.collect())?]);
    }
    let stages = file.stages(registry)?;
    let stage = stages.iter().find(|stage| stage.address == name).expect("the node was added");
    let Declaration { ports, .. } = stage.stage.declaration();
    let side = |is_such: fn(&Port) -> bool| {
        let ports = ports.iter().filter(|port| is_such(port) && !port.scratch);
        ports.map(|port| (port.name.to_string(), !port.optional)).collect::<Vec<_>>()
    };
    let input = choose("input", side(Port::is_input))?;
    // What is changed in place leaves where it entered.
    let updated = ports.iter().any(|port| port.name == input && port.access == Access::Update);
    let output = if updated { input.clone() } else { choose("output", side(Port::is_output))? };
    Ok([input, output])
}

/// The nodes that stand for parts with a parameter of this name, by their addresses. What they hand it to is set through
/// them.
fn parts_with(file: &GraphFile, param: &str, folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (part, within) in &file.parts {
        let address = format!("{folder}{part}");
        if within.param(param).is_some() {
            found.push(address);
        } else {
            found.extend(parts_with(within, param, &format!("{address}/")));
        }
    }
    found
}

/// The only node, a stage or a part, that has a parameter of this name.
fn owner(file: &GraphFile, param: &str, registry: &Registry) -> Result<String, Problems> {
    let stages = file.stages(registry)?;
    let specs = |stage: &epigraph_core::StageOf| stage.stage.specs();
    let has = stages.iter().filter(|stage| specs(stage).iter().any(|spec| spec.name == param));
    let parts = parts_with(&*file.whole()?, param, "");
    let of_part = |node: &str| parts.iter().any(|part| node.starts_with(&format!("{part}/")));
    let owners: BTreeSet<&str> =
        has.map(|stage| stage.written.as_str()).filter(|node| !of_part(node)).collect();
    let owners: Vec<&str> = parts.iter().map(String::as_str).chain(owners).collect();
    match &owners[..] {
        [only] => Ok((*only).to_owned()),
        [] => {
            let own = file.whole()?.params.iter().map(|param| param.name.value.clone()).collect::<Vec<_>>();
            let known: BTreeSet<String> =
                stages.iter().flat_map(specs).map(|spec| spec.name).chain(own).collect();
            let nearest = match GraphError::unknown("parameter", param, known) {
                // A list of all parameters of all nodes helps nobody.
                GraphError::Unknown { what, found, nearest, .. } => {
                    GraphError::Unknown { what, found, nearest, known: Vec::new() }
                }
                error => error,
            };
            Err(Problem::new(nearest).into())
        }
        several => {
            let several: Vec<String> = several.iter().map(|node| format!("{node}.{param}")).collect();
            let text =
                format!("several nodes have a parameter `{param}`; write one of {}", several.join(", "));
            Err(Problem::new(GraphError::Invalid(text)).into())
        }
    }
}

/// Makes changes to a graph: swaps first, then insertions, wires and parameters, whatever their order, so that a
/// parameter is that of the node that has come in.
///
/// # Errors
/// Changes that do not fit the graph. What only the stages know, such as names of ports and parameters, is reported on
/// compiling. Places are the changes' texts.
pub fn changed<'c>(
    file: GraphFile,
    changes: impl IntoIterator<Item = &'c Change>,
    registry: &Registry,
) -> Result<GraphFile, Problems> {
    let mut changes: Vec<&Change> = changes.into_iter().collect();
    changes.sort_by_key(|change| match change.what {
        What::Swap { .. } => 0,
        What::Insert { .. } => 1,
        What::Wire { .. } => 2,
        What::Set { .. } => 3,
    });
    changes.into_iter().try_fold(file, |file, change| change.apply(&file, registry))
}

/// Splits the name of a variant into that of its graph and the changes: `epi+sigma=0.5+swap:interpolate=mine.wgsl`. A
/// file of the whole name is no variant.
///
/// # Errors
/// A change that is not of the form of its kind.
pub fn split(name: &str) -> Result<(&str, Vec<Change>), Problems> {
    let exists = |name: &str| Path::new(name).is_file();
    let begins = |at: &usize| is_change(&name[at + 1..]);
    let starts: Vec<usize> = name.match_indices('+').map(|(at, _)| at).filter(begins).collect();
    // A path may have a plus too.
    let first = if exists(name) {
        starts.len()
    } else {
        starts.iter().rposition(|at| exists(&name[..*at])).unwrap_or(0)
    };
    let starts = &starts[first..];
    let ends = starts.iter().skip(1).copied().chain([name.len()]);
    let changes = starts.iter().zip(ends).map(|(start, end)| {
        let (option, text) = (&name[*start..end], &name[start + 1..end]);
        let change =
            WORDS.iter().find_map(|(word, parse)| Some(parse(text.strip_prefix(word)?.strip_prefix(':')?)));
        let change = change.unwrap_or_else(|| Change::set(text)).map_err(|expected| {
            Problems::from(Problem::new(GraphError::Invalid(expected)).at(Place::file(option)))
        })?;
        Ok(Change { option: option.to_owned(), ..change })
    });
    let changes: Result<Vec<Change>, Problems> = changes.collect();
    Ok((starts.first().map_or(name, |start| &name[..*start]), changes?))
}

/// Whether what follows a plus in a name begins a change, and is not the rest of a file's name or of a number.
fn is_change(text: &str) -> bool {
    let of_word = |(word, _): &(&str, _)| text.strip_prefix(word).is_some_and(|rest| rest.starts_with(':'));
    let is_name =
        |name: &str| name.chars().all(|c| c.is_alphanumeric() || "._/-".contains(c)) && !name.is_empty();
    WORDS.iter().any(of_word) || text.split_once('=').is_some_and(|(name, _)| is_name(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_split_where_a_change_begins() {
        for (name, base, changes) in [
            ("epi", "epi", &[][..]),
            ("epi+sigma=0.5", "epi", &["sigma=0.5"]),
            (
                "epi+interpolate.sigma=1e+5+view/cull.threshold=+2",
                "epi",
                &["interpolate.sigma=1e+5", "view/cull.threshold=+2"],
            ),
            (
                "a+b.ron+swap:x=y+z.wgsl+insert:a.b=c.wgsl",
                "a+b.ron",
                &["swap:x=y+z.wgsl", "insert:a.b=c.wgsl"],
            ),
            ("epi+wire:a.b=none+wire:a.c=d/e.f", "epi", &["wire:a.b=none", "wire:a.c=d/e.f"]),
            ("C++", "C++", &[]),
        ] {
            let (found, found_changes) = split(name).unwrap();
            let found_changes: Vec<String> = found_changes.iter().map(Change::piece).collect();
            assert_eq!(
                (found, &found_changes[..]),
                (base, &changes.iter().map(|c| (*c).to_owned()).collect::<Vec<_>>()[..])
            );
        }
        let (_, changes) = split("epi+swap:a=b.wgsl+a.x=3").unwrap();
        assert_eq!((changes[0].option.as_str(), changes[1].option.as_str()), ("+swap:a=b.wgsl", "+a.x=3"));
        for (wrong, text) in [
            ("epi+swap:interpolate", "+swap:interpolate: expected NODE=FILE.wgsl"),
            ("epi+insert:tonemap=a.wgsl", "+insert:tonemap=a.wgsl: expected NODE.PORT=FILE.wgsl"),
            ("epi+wire:tonemap.color=spread", "+wire:tonemap.color=spread: expected NODE.PORT=NODE.PORT"),
            ("epi+sigma=", "+sigma=: expected node.param=value"),
            ("epi+.sigma=3", "+.sigma=3: expected node.param=value"),
        ] {
            let found = split(wrong).unwrap_err().to_string();
            assert!(found.starts_with(text), "{found}");
        }
    }

    #[test]
    fn a_file_wins_over_a_variant() {
        let folder = tempfile();
        let path = |name: &str| folder.join(name).display().to_string();
        std::fs::write(folder.join("epi+sigma=1"), "").unwrap();
        assert_eq!(split(&path("epi+sigma=1")).unwrap().1.len(), 0);
        let (base, changes) = (path("epi+sigma=1"), path("epi+sigma=1") + "+x.y=2");
        assert_eq!(split(&changes).unwrap().0, base);
        assert_eq!(split(&path("epi+x=1")).unwrap().0, path("epi"));
        std::fs::remove_dir_all(&folder).unwrap();
    }

    fn tempfile() -> std::path::PathBuf {
        let folder = std::env::temp_dir().join(format!("epigraph-change-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    /// What a variant of a shipped graph gives on compiling.
    fn compiled(name: &str) -> Result<epigraph_core::Graph, Problems> {
        let registry = epigraph_stages::registry();
        let file = crate::graphs::load(name, &registry)?;
        let facts = crate::Place::load("cornell", "orbit").expect("a built-in scene").facts();
        let settings = epigraph_core::Settings::new([32, 32], 10, facts);
        let settings = epigraph_core::Settings { prune: false, ..settings };
        epigraph_core::compile(&file, &registry, &settings).map(|(graph, _)| graph)
    }

    #[test]
    fn variants_of_shipped_graphs_are_what_they_say() {
        let graph = compiled(
            "epi+insert:antialias.primary=spread+spread2.rounds=3+wire:spread2.n8=edges.n8+sigma=0.5+swap:spread=spread",
        )
        .unwrap();
        let node = |name: &str| &graph.nodes[graph.node(name).unwrap()];
        let before = node("antialias").sources.iter().flatten().next().unwrap();
        assert_eq!(graph.name(*before), "spread2.color");
        let sigma = node("interpolate").stage.words();
        let plain = compiled("epi+interpolate.sigma=0.5").unwrap();
        assert_eq!(sigma, plain.nodes[plain.node("interpolate").unwrap()].stage.words());
        assert_ne!(sigma, compiled("epi").unwrap().nodes[plain.node("interpolate").unwrap()].stage.words());
        let wired = compiled("epi+wire:tonemap.color=spread.color").unwrap();
        let tonemap = &wired.nodes[wired.node("tonemap").unwrap()];
        assert_eq!(wired.name(tonemap.sources[0].unwrap()), "spread.color");
        // An inner node by its own name.
        let culled =
            compiled("render-cache+swap:cull=depth_cull+insert:cull.depth=spread+wire:predict.cloud=none");
        let text = culled.err().unwrap().to_string();
        assert!(text.contains("+insert:cull.depth=spread: "), "{text}");
        assert!(compiled("render-cache+swap:cull=depth_cull+cull.threshold=0.2").is_ok());
    }

    #[test]
    fn a_shader_runs_on_the_gpu_where_the_stage_before_it_ran_on_the_cpu() {
        let side = |name: &str| {
            let graph = compiled(name).unwrap_or_else(|problems| panic!("{problems}"));
            let age = &graph.nodes[graph.node("cloud/age").unwrap()];
            (age.kind.clone(), age.side)
        };
        assert_eq!(side("hybrid"), ("age".into(), epigraph_core::Side::Cpu));
        assert_eq!(side("hybrid+swap:age=age"), ("age".into(), epigraph_core::Side::Cpu));
        let shader = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/wgsl/age.wgsl");
        assert_eq!(side(&format!("hybrid+swap:age={shader}")), ("wgsl".into(), epigraph_core::Side::Gpu));
    }

    #[test]
    fn mistakes_in_variants_are_told_by_their_text() {
        for (name, wanted) in [
            (
                "epi+swap:interpolat=fill",
                "+swap:interpolat=fill: unknown node `interpolat`, did you mean `interpolate`?",
            ),
            (
                "epi+swap:interpolate=fil",
                "+swap:interpolate=fil: node `interpolate`: unknown stage kind `fil`, did you mean `fill`?",
            ),
            (
                "epi+swap:interpolate=no.wgsl",
                "+swap:interpolate=no.wgsl: node `interpolate`: cannot read: no.wgsl: ",
            ),
            ("epi+swap:view=no.ron", "+swap:view=no.ron: node `view`: cannot read: no.ron: No such file"),
            (
                "epi+insert:tonemap.colour=tonemap",
                "+insert:tonemap.colour=tonemap: unknown connected input `colour`, did you mean `color`?",
            ),
            (
                "epi+insert:tonemp.color=tonemap",
                "+insert:tonemp.color=tonemap: unknown node `tonemp`, did you mean `tonemap`?",
            ),
            (
                "epi+insert:outputs.img=tonemap",
                "+insert:outputs.img=tonemap: unknown output `img`; known: image",
            ),
            (
                "epi+insert:tonemap.color=fill",
                "+insert:tonemap.color=fill: which input of `fill` belongs into the wire?",
            ),
            (
                "epi+wire:tonemap.color=cull.idd",
                "+wire:tonemap.color=cull.idd: node `tonemap`: unknown output port `idd`, did you mean `id`?",
            ),
            ("epi+sigm=0.5", "+sigm=0.5: unknown parameter `sigm`, did you mean `sigma`?"),
            (
                "epi+threshold=0.5",
                "+threshold=0.5: several nodes have a parameter `threshold`; write one of cloud/integrate.threshold, \
              edges/reach_cull.threshold, view/cull.threshold",
            ),
            (
                "epi+interpolate.sigm=0.5",
                "+interpolate.sigm=0.5: node `interpolate`: unknown parameter `sigm`, did you mean `sigma`?",
            ),
            ("epi+interpolate.sigma=x", "+interpolate.sigma=x: node `interpolate`: parameter `sigma`: "),
            (
                "epi+interpolate.sigma=1)",
                "+interpolate.sigma=1): parameter `sigma`: Non-whitespace trailing characters",
            ),
            ("epy+sigma=1", "unknown graph or file `epy`, did you mean `epi`?"),
        ] {
            let text = compiled(name).err().unwrap_or_else(|| panic!("{name} compiles")).to_string();
            assert!(text.starts_with(wanted), "{wanted}\nis not\n{text}");
        }
    }
}
