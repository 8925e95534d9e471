//! The kind `wgsl`: a user's shader file as a stage, with nothing written in Rust.
//!
//! ```ron
//! "glow": (kind: "wgsl", inputs: { "color": "fill.color" }, params: (shader: "glow.wgsl", strength: 0.8)),
//! ```
//!
//! The node's `shader` is a path from the graph file's folder. Everything in the shader's `@group(0)` is a port of the
//! variable's name, and its `///` comment is the port's documentation:
//!
//! | variable | port |
//! |---|---|
//! | `texture_2d<f32>`, `texture_2d<u32>` | input; any float format, or r32uint |
//! | `texture_storage_2d<FORMAT, write>` | output, as large as the first input texture, else as the frame |
//! | `texture_storage_2d<FORMAT, read_write>` | updated in place |
//! | `var<storage, read> array<T>` | input |
//! | `var<storage, read_write> array<T>` | updated in place |
//!
//! Two names are not ports: `frame`, after `#import frame`, and `params`, a uniform struct of f32, u32 and i32, each of
//! which is a parameter of the node. Every `@compute` entry point is a pass, in file order, with one thread for each
//! element of the first writable port that it uses.
//!
//! Lines of the comments that start with `=` declare what differs from that; `grammar.rs` has the tables of all clauses,
//! `docs/wgsl.md` explains them.
//!
//! ```wgsl
//! struct Params {
//!     /// Strength of the glow.
//!     /// = 0.5 in 0..2
//!     strength: f32,
//! }
//! @group(0) @binding(1) var<uniform> params: Params;
//! /// Brightness of each tile.
//! /// = output, per 8x8 pixels
//! @group(0) @binding(2) var<storage, read_write> tiles: array<f32>;
//! ```
//!
//! A node is made in these steps: `reflect::outline` finds comments and names in the text, `grammar` reads the
//! declarations, then `params`, `ports` and `passes` make of them, and of what naga reflects, what a stage declares.

mod grammar;
mod params;
mod passes;
mod ports;

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
};

use grammar::{Declared, FileClause, Name, Subject};
use params::Member;
use passes::EntryPoint;
use ports::{Bound, Ports};

use crate::{
    constant::Constant,
    error::{GraphError, Place, Problem, Problems, Span, Spanned},
    facts::Facts,
    file::{FlatNode, GraphFile},
    params::{ParamKind, ParamSpec, parse_ron},
    port::{Access, Lifetime, Port},
    reflect::{
        self, Composed, Misfit, Reflected,
        outline::{self, Item, ItemKind, Line, Outline},
    },
    registry::{Kind, NodeContext, Registry},
    shader::{Needs, Shader, ShaderLibrary},
    stage::{AnyStage, CpuContext, Declaration, Runs},
};

/// The kind `wgsl`: a node names a shader file, whose variables are its ports and parameters.
pub fn wgsl_kind() -> Box<dyn Kind> {
    Box::new(WgslKind)
}

/// A form of a clause that a shader file may declare in a comment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WgslClause {
    /// What it is declared for: "a port", "a parameter", "an entry point" or "the file".
    pub subject: &'static str,
    /// How it is written: words of small letters stand for themselves, `a/b` for either, `[...]` may be left out.
    pub form: &'static str,
    /// What it means, one sentence.
    pub doc: &'static str,
}

/// All clauses that a shader file may declare.
pub fn wgsl_clauses() -> Vec<WgslClause> {
    fn of<C: Subject>() -> impl Iterator<Item = WgslClause> {
        C::FORMS.iter().map(|form| WgslClause { subject: C::WHAT, form: form.text, doc: form.doc })
    }
    let ports = of::<grammar::PortClause>().chain(of::<grammar::ParamClause>());
    ports.chain(of::<grammar::EntryClause>()).chain(of::<FileClause>()).collect()
}

impl GraphFile {
    /// The shader files of all nodes of kind `wgsl`, including those of parts, each with its node's address.
    pub fn shaders(&self) -> Vec<(String, PathBuf)> {
        // Problems of parts and of changes are reported when compiling.
        let Ok(whole) = self.whole() else { return Vec::new() };
        let nodes = whole.flatten().map(|flat| flat.nodes).unwrap_or_default();
        let shader = |node: FlatNode| {
            let param = node.def.params.iter().find(|param| param.name.value == SHADER)?;
            let file = node.places.get(SHADER).map_or(node.file, |places| places.value);
            let path: String = parse_ron(&param.value.value).ok()?;
            Some((node.def.name.value.clone(), file.folder_at(param.value.span).join(path)))
        };
        nodes.into_iter().filter(|node| node.def.kind.value == KIND).filter_map(shader).collect()
    }
}

/// The name in graph files.
const KIND: &str = "wgsl";

/// The parameter that names the file.
const SHADER: &str = "shader";

/// The uniform of the parameters.
const PARAMS: &str = "params";

/// Whether a variable of this name is no port.
fn is_reserved(variable: &str) -> bool {
    matches!(variable, "frame" | PARAMS)
}

struct WgslKind;

impl Kind for WgslKind {
    fn name(&self) -> &'static str {
        KIND
    }
    fn doc(&self) -> &'static str {
        "Runs a shader file of your own; its variables are the ports and parameters."
    }
    fn specs(&self) -> Vec<ParamSpec> {
        vec![ParamSpec {
            name: SHADER.into(),
            doc: "Path of the WGSL file, from the graph file's folder.".into(),
            unit: String::new(),
            kind: ParamKind::Text,
            range: None,
            default: "\"\"".into(),
        }]
    }
    fn declaration(&self) -> Option<Declaration> {
        None
    }
    fn make(&self, cx: &NodeContext) -> Result<Box<dyn AnyStage>, Problems> {
        let Some(param) = cx.node.params.iter().find(|param| param.name.value == SHADER) else {
            let message = "a `wgsl` node names its shader file: write params: (shader: \"FILE.wgsl\")";
            return Err(cx.problem(GraphError::Invalid(message.into()), cx.node.name.span).into());
        };
        let problem = |error| cx.value_problem(param, error);
        let path: String = parse_ron(&param.value.value).map_err(|error| {
            let expected = ParamKind::Text.words();
            problem(GraphError::Value { name: SHADER.into(), expected, cause: error.cause })
        })?;
        let library = &cx.registry.library;
        let mut shader = load(cx.folder(param).join(&path), path, library).map_err(problem)?;
        let inputs = cx.node.inputs.iter().map(|input| input.port.value.as_str());
        shader.defines = inputs.filter(|input| (cx.connected)(input)).map(has).collect();

        // Errors of the shader at their lines, as far as they have any; else where the graph names the file.
        let placed = |errors: Vec<GraphError>, shader: &Shader| {
            let placed = errors.into_iter().map(|error| match reflect::at_its_line(error, shader, library) {
                Ok(placed) => placed.node(&cx.node.name.value),
                Err(error) => problem(error),
            });
            Problems(placed.collect())
        };
        let own = parameters(&shader, library).map_err(|errors| placed(errors, &shader))?;
        let mut specs = self.specs();
        specs.extend(own.iter().map(|(spec, _)| spec.clone()));
        let mut words: Vec<u32> = own.iter().map(|&(_, word)| word).collect();
        let wrong_values = cx.set_params(&specs, |index, text| match index.checked_sub(1) {
            // The path has been read.
            None => Ok(()),
            Some(own) => params::word(&specs[index], text).map(|word| words[own] = word),
        });
        let read = read(&shader, &specs, &words, cx.registry, cx.connected);
        let read = read.map_err(|errors| {
            let mut problems = placed(errors, &shader);
            problems.append(wrong_values.clone());
            problems
        })?;
        wrong_values.into_result()?;
        Ok(Box::new(WgslStage { declaration: read.declaration, specs, words }))
    }
}

struct WgslStage {
    declaration: Declaration,
    specs: Vec<ParamSpec>,
    words: Vec<u32>,
}

impl AnyStage for WgslStage {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }
    fn run_cpu(&self, _: &CpuContext) -> Result<(), String> {
        Err("a `wgsl` stage runs on the GPU only".into())
    }
    fn words(&self) -> Vec<u32> {
        self.words.clone()
    }
    fn specs(&self) -> Vec<ParamSpec> {
        self.specs.clone()
    }
    fn needless(&self, _: &Facts) -> Option<&'static str> {
        None
    }
}

/// The shader of a file, which messages call by `name`.
fn load(file: PathBuf, name: String, library: &ShaderLibrary) -> Result<Shader, GraphError> {
    let edited = library.edited.get(&file).map(|text| text.to_string());
    let source = edited
        .map_or_else(|| epigraph_files::text(&file), Ok)
        .map_err(|error| GraphError::Io { action: "read", cause: format!("{}: {error}", file.display()) })?;
    Ok(Shader::new(name, source).from_file(file))
}

/// The name for `#ifdef` that says that an input is connected.
fn has(input: &str) -> Cow<'static, str> {
    format!("HAS_{}", input.to_uppercase()).into()
}

/// Collects what is wrong with a shader, at its places.
struct Wrong<'c> {
    composed: &'c Composed,
    errors: Vec<GraphError>,
}

impl Wrong<'_> {
    fn into_result(self) -> Result<(), Vec<GraphError>> {
        if self.errors.is_empty() { Ok(()) } else { Err(self.errors) }
    }

    /// Reports the declarations among some lines, which take none.
    fn strays(&mut self, lines: &[Line]) {
        for line in lines.iter().filter(|line| outline::is_declaration(line)) {
            let subjects = "a port, a parameter or an entry point";
            self.at(line.span, format!("nothing here takes this declaration; it belongs above {subjects}"));
        }
    }

    /// At a range of the shader's own text; `None` for what is wrong with all of it.
    fn at(&mut self, place: impl Into<Option<Span>>, message: impl AsRef<str>) {
        let message = message.as_ref();
        self.errors.push(match place.into() {
            Some(span) => self.composed.own_error(span, message),
            None => self.composed.error_anywhere(message),
        });
    }
}

/// All declarations of a text.
struct Declarations {
    /// Those at the top.
    file: Declared<FileClause>,
    bound: Vec<Bound>,
    /// The variable `params`.
    params_name: Option<Name>,
    params: Vec<Member>,
    points: Vec<EntryPoint>,
}

impl Declarations {
    /// Reads the shader's own text. Reports every clause that fits no form, and every declaration above something that
    /// takes none.
    fn read(wrong: &mut Wrong) -> Self {
        let composed = wrong.composed;
        let outline = Outline::of(composed.own());
        wrong.strays(&outline.stray);
        let mut declarations = Self {
            file: declared(&outline.head, wrong),
            bound: Vec::new(),
            params_name: None,
            params: Vec::new(),
            points: Vec::new(),
        };
        let of_params = |item: &&Item| item.name.value == PARAMS && matches!(item.kind, ItemKind::Bound(_));
        let params = outline.items.iter().find(of_params);
        let members_of = match params {
            Some(Item { kind: ItemKind::Bound(ty), .. }) => Some(*ty),
            _ => None,
        };
        let mut has_members = false;
        for item in &outline.items {
            let name = owned(&item.name);
            match &item.kind {
                ItemKind::Bound(_) if is_reserved(&name.value) => {
                    wrong.strays(&item.doc);
                    declarations.params_name = Some(name);
                }
                ItemKind::Bound(_) => {
                    declarations.bound.push(Bound { name, declared: declared(&item.doc, wrong) });
                }
                ItemKind::Entry => {
                    declarations.points.push(EntryPoint { name, declared: declared(&item.doc, wrong) });
                }
                ItemKind::Struct(members) if members_of == Some(&*name.value) => {
                    has_members = true;
                    for member in members {
                        let ItemKind::Member(ty) = member.kind else { continue };
                        let (name, ty) = (owned(&member.name), ty.to_owned());
                        declarations.params.push(Member { name, ty, declared: declared(&member.doc, wrong) });
                    }
                }
                ItemKind::Struct(members) => members.iter().for_each(|member| wrong.strays(&member.doc)),
                ItemKind::Member(_) => {}
            }
        }
        if let (Some(params), false) = (params, has_members) {
            wrong.at(
                params.name.span,
                "`params` is a uniform struct of f32, u32 and i32 that this file declares",
            );
        }
        declarations
    }
}

impl Declarations {
    /// The place of a variable or entry point.
    fn place(&self, name: &str) -> Option<Span> {
        let bound = self.bound.iter().map(|bound| &bound.name);
        let mut names = bound.chain(self.points.iter().map(|point| &point.name)).chain(&self.params_name);
        names.find(|known| known.value == name).map(|found| found.span)
    }
}

fn owned(name: &Line) -> Name {
    Spanned { value: name.value.to_owned(), span: name.span }
}

fn declared<C: Subject>(doc: &[Line], wrong: &mut Wrong) -> Declared<C> {
    Declared::read(doc, &mut |span, message| wrong.at(span, message))
}

/// The parameters that a shader declares, each with its default as a uniform word.
fn parameters(shader: &Shader, library: &ShaderLibrary) -> Result<Vec<(ParamSpec, u32)>, Vec<GraphError>> {
    let composed = reflect::join(shader, library).map_err(|error| vec![error])?;
    let mut wrong = Wrong { composed: &composed, errors: Vec::new() };
    let declarations = Declarations::read(&mut wrong);
    let parameters = params::parameters(&declarations.params, &mut wrong);
    wrong.into_result()?;
    Ok(parameters)
}

/// What a shader is as a stage.
struct Read {
    declaration: Declaration,
    doc: String,
    /// What the file leaves open and the node assumes, in sentences.
    assumed: Vec<String>,
}

/// A shader as a stage, with these values of its parameters (the first of `specs` is the file) and these inputs
/// connected.
fn read(
    shader: &Shader,
    specs: &[ParamSpec],
    words: &[u32],
    registry: &Registry,
    connected: &dyn Fn(&str) -> bool,
) -> Result<Read, Vec<GraphError>> {
    let library = &registry.library;
    let mut shader = shader.clone();
    let own = || specs[1..].iter().zip(words);
    shader.defines.extend(own().filter_map(|(spec, word)| params::define(spec, *word)).map(Cow::Owned));
    shader.constants = own().flat_map(|(spec, _)| Constant::of_choice(spec)).collect();

    let composed = reflect::join(&shader, library).map_err(|error| vec![error])?;
    let mut wrong = Wrong { composed: &composed, errors: Vec::new() };
    let declarations = Declarations::read(&mut wrong);
    let again = params::parameters(&declarations.params, &mut wrong);
    if wrong.errors.is_empty() && !again.iter().map(|(spec, _)| spec).eq(&specs[1..]) {
        wrong.at(None, "the members of `params` depend on their values; keep the struct out of #ifdef");
    }
    wrong.into_result()?;
    let reflected = reflect::validate(&composed, EVERYTHING).map_err(|error| vec![error])?;

    let mut wrong = Wrong { composed: &composed, errors: Vec::new() };
    let mut ports = all_ports(&shader, &reflected, &declarations, registry, connected, &mut wrong)?;
    let passes = passes::passes(&reflected, &declarations.points, &mut ports, connected, &mut wrong);
    let Ports { ports, mut assumed, .. } = ports;
    check_conditions(&shader, &ports, &specs[1..], &mut wrong);
    let (runs, column) = of_file(&declarations.file, &ports, registry, &mut wrong);
    let needs = Needs { atomic64: reflected.module.types.iter().any(|(_, ty)| is_wide(ty)) };
    if needs.atomic64 {
        assumed.push("The device has 64-bit atomics.".into());
    }
    let declaration = Declaration {
        ports,
        shader: Some(shader.clone()),
        passes,
        needs,
        runs,
        column,
        ..Declaration::default()
    };
    if wrong.errors.is_empty() {
        for Misfit { about, message } in reflect::misfits(&reflected, &declaration, specs) {
            wrong.at(about.and_then(|name| declarations.place(&name)), message);
        }
    }
    wrong.into_result()?;
    let wrong = |error| vec![error];
    if reflect::has_checks(&shader, library).map_err(wrong)? {
        let watched = reflect::join(&reflect::watched(&shader), library).map_err(wrong)?;
        reflect::validate(&watched, needs).map_err(wrong)?;
        let errors = reflect::errors_of_checks(&watched, &declaration);
        if !errors.is_empty() {
            return Err(errors);
        }
    }
    Ok(Read { declaration, doc: declarations.file.prose, assumed })
}

/// What a shader may use before it is known what it needs.
const EVERYTHING: Needs = Needs { atomic64: true };

/// The ports of a shader, among them the optional inputs that are not connected, whose variables may be left out then.
fn all_ports(
    shader: &Shader,
    reflected: &Reflected,
    declarations: &Declarations,
    registry: &Registry,
    connected: &dyn Fn(&str) -> bool,
    wrong: &mut Wrong,
) -> Result<Ports, Vec<GraphError>> {
    let mut full = shader.clone();
    let all = reflect::conditions(&shader.source)
        .map(|(define, _)| define)
        .filter(|define| define.starts_with("HAS_"));
    full.defines.extend(all.map(|define| Cow::Owned(define.to_owned())));
    let composed = reflect::join(&full, &registry.library).map_err(|error| vec![error])?;
    if composed.own() == wrong.composed.own() {
        passes::check_fragments(reflected, &declarations.points, wrong);
        return Ok(ports::ports(reflected, &declarations.bound, registry, connected, &|_| false, wrong));
    }
    let mut other = Wrong { composed: &composed, errors: Vec::new() };
    let Declarations { bound, points, .. } = Declarations::read(&mut other);
    other.into_result()?;
    let whole = reflect::validate(&composed, EVERYTHING).map_err(|error| vec![error])?;
    let mut other = Wrong { composed: &composed, errors: Vec::new() };
    passes::check_fragments(&whole, &points, &mut other);
    let absent = |variable: &str| reflected.variable(variable).is_none();
    let ports = ports::ports(&whole, &bound, registry, connected, &absent, &mut other);
    for Bound { name, .. } in &bound {
        let port = ports.field(&name.value).map(|field| &ports.ports[field.port as usize]);
        if absent(&name.value) && port.is_some_and(|port| !port.optional || connected(&port.name)) {
            other.at(
                name.span,
                format!("`{}` is an input that is left out by #ifdef; add `optional`", name.value),
            );
        }
    }
    for Bound { name, .. } in &declarations.bound {
        if whole.variable(&name.value).is_none() {
            wrong.at(
                name.span,
                format!("`{}` is there only without some input; move it out of #ifndef", name.value),
            );
        }
    }
    wrong.errors.extend(other.errors);
    Ok(ports)
}

/// Checks that something defines the name of every `#ifdef`: an input that may be connected, or a parameter.
fn check_conditions(shader: &Shader, ports: &[Port], specs: &[ParamSpec], wrong: &mut Wrong) {
    let inputs = ports.iter().filter(|port| port.is_input()).map(|port| has(&port.name).into_owned());
    let known = inputs.chain(specs.iter().flat_map(params::defines)).chain([reflect::WATCH.to_owned()]);
    let known: Vec<String> = known.collect();
    for (define, span) in reflect::conditions(&shader.source) {
        if known.iter().all(|known| known != define) {
            let mut message = GraphError::unknown("name after #ifdef", define, &known).to_string();
            if known.len() == 1 {
                message += "; an optional input or a parameter that is true or false defines one";
            }
            wrong.errors.push(reflect::error_in(&shader.name, &shader.source, span, &message));
        }
    }
}

/// In which frames it runs, and the column of the table of times.
fn of_file(
    file: &Declared<FileClause>,
    ports: &[Port],
    registry: &Registry,
    wrong: &mut Wrong,
) -> (Runs, Option<&'static str>) {
    let (mut per_view, mut column) = (None, None);
    for Spanned { value: clause, span } in &file.clauses {
        let slot = match clause {
            FileClause::PerView => per_view.replace(*span),
            FileClause::Column(name) => {
                let columns = registry.columns();
                let found = columns.iter().copied().find(|known| *known == name.value);
                if found.is_none() {
                    wrong.at(name.span, GraphError::unknown("column", &name.value, columns).to_string());
                }
                column.replace((found, *span)).map(|(_, span)| span)
            }
        };
        if slot.is_some() {
            wrong.at(*span, "this is given twice; remove one");
        }
    }
    let remembers = |port: &&Port| {
        matches!(port.access, Access::Update | Access::History) || port.lifetime == Lifetime::Persistent
    };
    if let (Some(span), Some(port)) = (per_view, ports.iter().find(remembers)) {
        let name = &port.name;
        wrong.at(span, format!("`per view` is for what follows from inputs and view alone, but `{name}` depends on the frame before"));
    }
    let runs = if per_view.is_some() { Runs::PerView } else { Runs::Always };
    (runs, column.and_then(|(column, _)| column))
}

/// Whether a type is made of 64-bit numbers.
fn is_wide(ty: &naga::Type) -> bool {
    match ty.inner {
        naga::TypeInner::Scalar(scalar)
        | naga::TypeInner::Vector { scalar, .. }
        | naga::TypeInner::Atomic(scalar) => {
            scalar.width == 8 && scalar.kind != naga::ScalarKind::AbstractInt
        }
        _ => false,
    }
}

/// What a shader file declares.
#[derive(Clone, Debug)]
pub struct WgslFile {
    /// Its documentation.
    pub doc: String,
    /// Ports and passes with default parameters and every optional input connected.
    pub declaration: Declaration,
    /// Its parameters.
    pub specs: Vec<ParamSpec>,
    /// What it leaves open and a node assumes, in sentences.
    pub assumed: Vec<String>,
}

impl WgslFile {
    /// Reads a shader file as a node of kind `wgsl` would.
    ///
    /// # Errors
    /// All that is wrong with it, at its places.
    pub fn load(file: &Path, registry: &Registry) -> Result<Self, Problems> {
        let whole = |error| Problem::new(error).at(Place::file(&file.display().to_string()));
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let library = &registry.library;
        let mut shader = load(file.to_owned(), name, library).map_err(whole)?;
        let all = reflect::conditions(&shader.source)
            .map(|(define, _)| define)
            .filter(|define| define.starts_with("HAS_"));
        shader.defines = all.map(|define| Cow::Owned(define.to_owned())).collect();
        let placed = |errors: Vec<GraphError>| {
            let placed = |error| reflect::at_its_line(error, &shader, library).unwrap_or_else(whole);
            Problems(errors.into_iter().map(placed).collect())
        };
        let own = parameters(&shader, library).map_err(placed)?;
        let mut specs = WgslKind.specs();
        let words: Vec<u32> = own.iter().map(|&(_, word)| word).collect();
        specs.extend(own.into_iter().map(|(spec, _)| spec));
        let read = read(&shader, &specs, &words, registry, &|_| true).map_err(placed)?;
        specs.remove(0);
        Ok(Self { doc: read.doc, declaration: read.declaration, specs, assumed: read.assumed })
    }
}
