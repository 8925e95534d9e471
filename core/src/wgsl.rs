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
//! A port named after the meaning of another stage's port, such as `depth` or `priority`, has that meaning; any other
//! port takes the meaning of what is connected to it.
//!
//! Two names are not ports: `frame`, after `#import frame`, and `params`, a uniform struct of f32, u32 and i32, each of
//! which is a parameter of the node. Its `///` comment is its documentation; a line of it that starts with `=` gives
//! the default (else 0), the range (else any value) and the unit (else none):
//!
//! ```wgsl
//! struct Params {
//!     /// Strength of the glow.
//!     /// = 0.5 in 0..2
//!     strength: f32,
//!     /// Half the width of the kernel.
//!     /// = 3 in 1..16 unit pixels
//!     radius: u32,
//! }
//! @group(0) @binding(1) var<uniform> params: Params;
//! ```
//!
//! Every `@compute` entry point is a pass, in file order, with one thread for each element of the first writable port
//! that it uses.

use std::{fs, path::PathBuf};

use naga::{ShaderStage, StorageAccess};

use crate::{
    error::{GraphError, Problem, Problems},
    facts::Facts,
    file::{FlatNode, GraphFile},
    params::{ParamError, ParamKind, ParamSpec, ParamValue, parse_ron, parse_value},
    port::{Access, Element, Extent, Field, FieldRef, Format, Lifetime, Meaning, Member, Port, Scalar},
    reflect::{self, Reflected, Space, Variable},
    registry::{Kind, NodeContext, folder},
    shader::{Needs, Pass, Shader, Threads},
    stage::{AnyStage, CpuContext, Declaration},
};

/// The kind `wgsl`: a node names a shader file, whose variables are its ports and parameters.
///
/// A line of a parameter's comment gives its default and range: `/// = 0.5 in 0..2 unit m`.
pub fn wgsl_kind() -> Box<dyn Kind> {
    Box::new(WgslKind)
}

impl GraphFile {
    /// The shader files of all nodes of kind `wgsl`, including those of parts, each with its node's address.
    pub fn shaders(&self) -> Vec<(String, PathBuf)> {
        // Problems of parts are reported when compiling.
        let nodes = self.flatten().map(|flat| flat.nodes).unwrap_or_default();
        let shader = |node: FlatNode| {
            let param = node.def.params.iter().find(|param| param.name.value == "shader")?;
            let file = node.places.get("shader").map_or(node.file, |places| places.value);
            let path: String = parse_ron(&param.value.value).ok()?;
            Some((node.def.name.value.clone(), folder(file).join(path)))
        };
        nodes.into_iter().filter(|node| node.def.kind.value == KIND).filter_map(shader).collect()
    }
}

/// The name in graph files.
const KIND: &str = "wgsl";

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
            name: "shader".into(),
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
        let Some(param) = cx.node.params.iter().find(|param| param.name.value == "shader") else {
            let message = "a `wgsl` node names its shader file: write params: (shader: \"FILE.wgsl\")";
            return Err(cx.problem(GraphError::Invalid(message.into()), cx.node.name.span).into());
        };
        let problem = |error| cx.value_problem(param, error);

        let path: String = parse_ron(&param.value.value).map_err(|error| {
            let expected = ParamKind::Text.words();
            problem(GraphError::Value { name: "shader".into(), expected, cause: error.cause })
        })?;
        let file = cx.folder(param).join(&path);
        let edited = cx.library.edited.get(&file).map(|text| text.to_string());
        let source = edited.map_or_else(|| fs::read_to_string(&file), Ok).map_err(|error| {
            problem(GraphError::Io { action: "read", cause: format!("{}: {error}", file.display()) })
        })?;

        let shader = Shader::new(path, source).from_file(file);
        let reflected = reflect::compose(&shader, cx.library, Needs { atomic64: true });
        let reflected =
            reflected.map_err(|error| match reflect::at_its_line(error, &shader, cx.library) {
                Ok(placed) => placed.node(&cx.node.name.value),
                Err(error) => problem(error),
            })?;
        let name = shader.name.clone();
        let mut messages = Vec::new();
        let declaration = declare(shader, &reflected, cx.meaning, &mut messages);
        let own = parameters(&reflected, &mut messages);
        let mut specs = self.specs();
        specs.extend(own.iter().map(|(spec, _)| spec.clone()));
        let errors = messages.into_iter().map(|message| GraphError::Shader {
            shader: name.to_string(),
            message,
            place: None,
        });
        let mut errors: Vec<GraphError> = errors.collect();
        if errors.is_empty() {
            errors = reflect::check(&reflected, &name, &declaration, &specs);
        }
        let problems: Vec<Problem> = errors.into_iter().map(problem).collect();
        Problems(problems).into_result()?;

        let mut words: Vec<u32> = own.iter().map(|&(_, word)| word).collect();
        cx.set_params(&specs, |index, text| match index.checked_sub(1) {
            // The path has been read.
            None => Ok(()),
            Some(own) => parse_word(&specs[index], text).map(|word| words[own] = word),
        })
        .into_result()?;
        Ok(Box::new(WgslStage { declaration, specs, words }))
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

/// Ports and passes of a shader; adds a message for every variable or entry point that cannot be one.
fn declare(
    shader: Shader,
    reflected: &Reflected,
    meaning: &dyn Fn(&str) -> Option<Meaning>,
    messages: &mut Vec<String>,
) -> Declaration {
    // The port of each variable, by the variable's index.
    let mut port_of = vec![None; reflected.variables.len()];
    let mut ports: Vec<Port> = Vec::new();
    for (index, variable) in reflected.variables.iter().enumerate() {
        if matches!(variable.name.as_str(), "frame" | "params") {
            continue;
        }
        match port(variable, meaning) {
            Ok(port) => {
                port_of[index] = Some(ports.len());
                ports.push(port);
            }
            Err(message) => messages.push(message),
        }
    }
    let is_texture =
        |port: &&Port| matches!(port.fields[0].element, Element::Texel(_) | Element::AnyFloatTexel);
    let size = ports.iter().filter(is_texture).find(|port| port.is_input()).map(|port| port.name.clone());
    for port in ports.iter_mut().filter(|port| port.access == Access::Write) {
        port.extent = size.clone().map_or(Extent::Frame(1), Extent::Like);
    }

    let mut passes = Vec::new();
    for entry in &reflected.entries {
        if entry.stage != ShaderStage::Compute {
            messages.push(format!(
                "`{}` is not a @compute entry point; a `wgsl` node runs only those",
                entry.name
            ));
            continue;
        }
        let written =
            entry.uses.iter().filter_map(|&used| port_of[used]).find(|&port| ports[port].is_output());
        match written {
            Some(port) => passes.push(Pass::Compute {
                entry: entry.name.clone().into(),
                threads: Threads::Over(FieldRef { port: port as u16, field: 0 }),
            }),
            None => messages.push(format!(
                "entry point `{}` writes no port; give it a texture_storage_2d or a storage buffer to write",
                entry.name
            )),
        }
    }
    if reflected.entries.is_empty() {
        messages.push("it has no @compute entry point".into());
    }
    let wide = |(_, ty): (naga::Handle<naga::Type>, &naga::Type)| match ty.inner {
        naga::TypeInner::Scalar(scalar)
        | naga::TypeInner::Vector { scalar, .. }
        | naga::TypeInner::Atomic(scalar) => {
            scalar.width == 8 && scalar.kind != naga::ScalarKind::AbstractInt
        }
        _ => false,
    };
    let needs = Needs { atomic64: reflected.module.types.iter().any(wide) };
    Declaration { ports, shader: Some(shader), passes, needs, ..Declaration::default() }
}

/// The port of a variable, or why it cannot be one.
fn port(variable: &Variable, meaning: &dyn Fn(&str) -> Option<Meaning>) -> Result<Port, String> {
    let store_only = StorageAccess::STORE;
    let (access, element) = match &variable.space {
        Space::Texture(Scalar::F32) => (Access::Read, Element::AnyFloatTexel),
        Space::Texture(_) => (Access::Read, Element::Texel(Format::R32Uint)),
        Space::StorageTexture { format, access } if *access == store_only => {
            (Access::Write, Element::Texel(*format))
        }
        Space::StorageTexture { format, access } if access.contains(StorageAccess::STORE) => {
            (Access::Update, Element::Texel(*format))
        }
        Space::Buffer { writable, element } => {
            (if *writable { Access::Update } else { Access::Read }, element.clone())
        }
        Space::StorageTexture { .. } => {
            return Err(format!("`{}` is only read; declare it texture_2d", variable.wgsl));
        }
        Space::Uniform(_) | Space::Other => {
            let formats: Vec<_> = Format::ALL.into_iter().map(Format::wgsl).collect();
            return Err(format!(
                "`{}` cannot be a port; ports are texture_2d<f32>, texture_2d<u32>, texture_storage_2d of {}, and \
                 storage buffers array<T> of 32-bit scalars, vectors and structs of those",
                variable.wgsl,
                formats.join(", ")
            ));
        }
    };
    let doc = if variable.doc.is_empty() { &variable.wgsl } else { &variable.doc };
    Ok(Port {
        name: variable.name.clone().into(),
        doc: doc.clone().into(),
        access,
        fields: vec![Field { name: "".into(), element }],
        meaning: meaning(&variable.name),
        scratch: false,
        extent: Extent::Any,
        lifetime: Lifetime::Transient,
        optional: false,
    })
}

/// The parameters in `params`, each with its default as a uniform word; adds a message for every invalid one.
fn parameters(reflected: &Reflected, messages: &mut Vec<String>) -> Vec<(ParamSpec, u32)> {
    let Some((_, variable)) = reflected.variable("params") else { return Vec::new() };
    let Space::Uniform(Element::Item { members, .. }) = &variable.space else {
        messages.push(format!("`{}` should be a uniform struct of f32, u32 and i32", variable.wgsl));
        return Vec::new();
    };
    let mut parameters = Vec::new();
    for (index, member) in members.iter().enumerate() {
        match parameter(member, index, member_doc(reflected, index)) {
            Ok(parameter) => parameters.push(parameter),
            Err(message) => messages.push(format!("parameter `{}`: {message}", member.name)),
        }
    }
    parameters
}

/// The lines of the comment above member `index` of the struct of `params`.
fn member_doc(reflected: &Reflected, index: usize) -> Vec<&str> {
    let module = &reflected.module;
    let params =
        module.global_variables.iter().find(|(_, variable)| variable.name.as_deref() == Some("params"));
    let lines =
        params.and_then(|(_, params)| module.doc_comments.as_ref()?.struct_members.get(&(params.ty, index)));
    lines.into_iter().flatten().flat_map(|comment| reflect::uncomment(comment)).collect()
}

fn parameter(member: &Member, index: usize, doc: Vec<&str>) -> Result<(ParamSpec, u32), String> {
    if member.name.is_empty() || member.lanes != 1 || member.offset != 4 * index as u32 {
        return Err("only f32, u32 and i32 can be parameters, one after the other".into());
    }
    if member.name == "shader" {
        return Err("this name is reserved for the shader file; choose another".into());
    }
    let (settings, prose): (Vec<&str>, Vec<&str>) = doc.into_iter().partition(|line| line.starts_with('='));
    let (kind, zero) = match member.scalar {
        Scalar::F32 => (ParamKind::F32, 0f32.ron()),
        Scalar::U32 => (ParamKind::U32, 0u32.ron()),
        Scalar::I32 => (ParamKind::I32, 0i32.ron()),
    };
    let mut spec = ParamSpec {
        name: member.name.to_string(),
        doc: prose.join(" ").trim().to_owned(),
        unit: String::new(),
        kind,
        range: None,
        default: zero,
    };
    match settings[..] {
        [] => {}
        [line] => {
            set_default(&mut spec, line).ok_or_else(|| {
                format!("`{line}` is not of the form `= DEFAULT`, `= DEFAULT in LOW..HIGH` or either with `unit UNIT`")
            })?;
        }
        _ => return Err("its comment gives the default twice".into()),
    }
    let word = parse_word(&spec, &spec.default).map_err(|error| {
        format!("its default {}: {}, expected {}", spec.default, error.cause, spec.kind.words())
    })?;
    Ok((spec, word))
}

/// Reads `= DEFAULT in LOW..HIGH unit UNIT`.
fn set_default(spec: &mut ParamSpec, line: &str) -> Option<()> {
    let rest = line.strip_prefix('=')?;
    let (rest, unit) = rest.split_once(" unit ").unwrap_or((rest, ""));
    let (default, range) = match rest.split_once(" in ") {
        Some((default, range)) => (default, Some(range)),
        None => (rest, None),
    };
    if let Some(range) = range {
        let (low, high) = range.split_once("..")?;
        let (low, high): (f64, f64) = (low.trim().parse().ok()?, high.trim().parse().ok()?);
        // Rejects NaN too.
        spec.range = Some((low <= high).then_some((low, high))?);
    }
    spec.default = default.trim().to_owned();
    spec.unit = unit.trim().to_owned();
    (!spec.default.is_empty()).then_some(())
}

/// A parameter's word in the uniform.
fn parse_word(spec: &ParamSpec, text: &str) -> Result<u32, ParamError> {
    match spec.kind.scalar() {
        Some(Scalar::I32) => parse_value::<i32>(text, spec.range).map(|value| value.bits()),
        Some(Scalar::F32) => parse_value::<f32>(text, spec.range).map(|value| value.bits()),
        _ => parse_value::<u32>(text, spec.range).map(|value| value.bits()),
    }
}
