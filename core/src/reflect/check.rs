//! Compares a shader with its stage's declaration.

mod draw;

use std::borrow::Cow;

use naga::{ShaderStage, StorageAccess};

use super::{
    CHECKS, Check as OwnCheck, Composed, Entry, Reflected, Space, Variable, has_checks, join,
    outline::Outline, validate, watched,
};
use crate::{
    error::GraphError,
    frame::Frame,
    params::ParamSpec,
    port::{Access, Element, FieldRef, Member, Port, Scalar},
    shader::{Pass, Shader, ShaderLibrary, Threads},
    stage::{AnyStage, Declaration},
};

/// Storage buffers that an entry point may use on every WebGPU device we target (Chromium's limit).
const MAX_BUFFERS: usize = 10;
/// Storage textures that an entry point may use (WebGPU's default limit).
const MAX_STORAGE_TEXTURES: usize = 4;
/// Workgroups along an axis (WebGPU's default limit).
const MAX_GROUPS: u32 = 65_535;
/// Threads of a workgroup (WebGPU's default limit).
const MAX_INVOCATIONS: u64 = 256;
/// Bytes of workgroup memory (WebGPU's default limit).
const MAX_WORKGROUP_BYTES: u32 = 16384;

/// The problems of a stage's shader: that it does not parse or validate, otherwise all that [`check`] finds.
pub fn check_stage(stage: &dyn AnyStage, library: &ShaderLibrary) -> Vec<GraphError> {
    let declaration = stage.declaration();
    let Some(shader) = &declaration.shader else { return Vec::new() };
    let checked = with_checks(shader, library).and_then(|shader| {
        let composed = join(&shader, library)?;
        let reflected = validate(&composed, declaration.needs)?;
        let outline = Outline::of(composed.own());
        let misfits = misfits(&reflected, declaration, &stage.specs()).into_iter();
        let place = |about: Option<String>| outline.place(&about?);
        let error = |Misfit { about, message }: Misfit| match place(about) {
            Some(span) => composed.own_error(span, &message),
            None => composed.error_anywhere(&message),
        };
        Ok(misfits.map(error).chain(errors_of_checks(&composed, declaration)).collect())
    });
    checked.unwrap_or_else(|error| vec![error])
}

/// The shader with its checks, if it has any: it is valid without them then, too, but for what they name.
fn with_checks(shader: &Shader, library: &ShaderLibrary) -> Result<Shader, GraphError> {
    Ok(if has_checks(shader, library)? { watched(shader) } else { shader.clone() })
}

/// The checks of ports that the stage does not write.
pub(crate) fn errors_of_checks(composed: &Composed, declaration: &Declaration) -> Vec<GraphError> {
    let outputs = declaration.ports.iter().filter(|port| port.is_output());
    let known: Vec<String> =
        outputs.flat_map(|port| (0..port.fields.len()).map(|field| port.variable(field))).collect();
    let strangers = composed.checks.iter().filter(|check| !known.contains(&check.port));
    let error = |check: &OwnCheck| {
        let unknown = GraphError::unknown("output", &check.port, &known);
        composed.error(check.at, &format!("#check: {unknown}"))
    };
    strangers.map(error).collect()
}

/// All differences between a shader and its stage's declaration. There must be a variable for each field of each port,
/// with the right kind, element type and access; `params` laid out as the parameters; `frame` laid out as [`Frame`];
/// entry points for each pass, which return what the targets of a draw take; all within the portable limits. `shader`
/// is the file's name for messages.
///
/// Optional ports may be absent (their variable is behind an `#ifdef`), and so may the targets of a draw.
pub fn check(
    reflected: &Reflected,
    shader: &str,
    declaration: &Declaration,
    specs: &[ParamSpec],
) -> Vec<GraphError> {
    let shader_error = |misfit: Misfit| GraphError::Shader {
        shader: shader.to_owned(),
        message: misfit.message,
        place: None,
    };
    misfits(reflected, declaration, specs).into_iter().map(shader_error).collect()
}

/// A difference between a shader and its stage's declaration.
pub(crate) struct Misfit {
    /// The variable or entry point that it concerns, unless that is missing.
    pub about: Option<String>,
    pub message: String,
}

/// What [`check`] reports.
pub(crate) fn misfits(reflected: &Reflected, declaration: &Declaration, specs: &[ParamSpec]) -> Vec<Misfit> {
    let mut check = Check { reflected, declaration, errors: Errors::default() };
    for (index, port) in declaration.ports.iter().enumerate() {
        check.port(port, index as u16);
    }
    check.params(specs);
    check.frame();
    check.strangers();
    check.bindings();
    for pass in &declaration.passes {
        check.pass(pass);
    }
    for entry in &reflected.entries {
        check.limits(entry);
    }
    check.errors.misfits
}

struct Check<'a> {
    reflected: &'a Reflected,
    declaration: &'a Declaration,
    errors: Errors,
}

/// The misfits that have been found.
#[derive(Default)]
struct Errors {
    /// What is being checked.
    about: Option<String>,
    misfits: Vec<Misfit>,
}

impl Errors {
    fn about(&mut self, name: &str) {
        self.about = Some(name.to_owned());
    }

    fn push(&mut self, message: String) {
        self.misfits.push(Misfit { about: self.about.clone(), message });
    }
}

impl<'a> Check<'a> {
    fn is_target(&self, at: FieldRef) -> bool {
        self.declaration.passes.iter().flat_map(Pass::targets).any(|target| *target == at)
    }

    /// The name of the variable of a field.
    fn variable(&self, at: FieldRef) -> String {
        self.declaration.ports[at.port as usize].variable(at.field as usize)
    }

    /// The variables that an entry point uses.
    fn used(&self, entry: &'a Entry) -> impl Iterator<Item = &'a Variable> + use<'a> {
        let reflected = self.reflected;
        entry.uses.iter().map(|&used| &reflected.variables[used])
    }

    fn port(&mut self, port: &Port, index: u16) {
        let mut writable = false;
        let mut complete = true;
        for field in 0..port.fields.len() {
            let name = port.variable(field);
            self.errors.about(&name);
            let target = self.is_target(FieldRef { port: index, field: field as u16 });
            writable |= target;
            let Some((_, variable)) = self.reflected.variable(&name) else {
                if !port.optional && !target {
                    self.missing(&name, port, field);
                }
                complete = false;
                continue;
            };
            writable |= variable.space.writable();
            if let Some(why) = mismatch(variable, port, field, target) {
                let wanted = wanted(&name, port, field);
                self.errors.push(format!(
                    "port `{}`: {why}; the shader has `{}`, declare it `{wanted}`",
                    port.name, variable.wgsl
                ));
                complete = false;
            }
        }
        if port.access == Access::Write && complete && !writable {
            self.errors.push(format!(
                "port `{}` is an output, but no variable of it is writable; declare `{}`",
                port.name,
                wanted(&port.variable(0), port, 0)
            ));
        }
    }

    fn missing(&mut self, name: &str, port: &Port, field: usize) {
        let free = (0..).find(|&binding| self.reflected.variables.iter().all(|v| v.binding != binding));
        let near = match GraphError::unknown("variable", name, self.unclaimed()) {
            GraphError::Unknown { nearest, .. } if !nearest.is_empty() => {
                format!(", or rename `{}` if that is meant", nearest[0])
            }
            _ => String::new(),
        };
        self.errors.push(format!(
            "port `{}` has no variable `{name}`; add `@group(0) @binding({}) {};`{near}",
            port.name,
            free.unwrap_or_default(),
            wanted(name, port, field),
        ));
    }

    /// Names that the declaration assigns to variables.
    fn claimed(&self) -> Vec<String> {
        let ports = self.declaration.ports.iter();
        ports.flat_map(|port| (0..port.fields.len()).map(|field| port.variable(field))).collect()
    }

    fn unclaimed(&self) -> Vec<&'a str> {
        let claimed = self.claimed();
        let names = self.reflected.variables.iter().map(|variable| variable.name.as_str());
        names.filter(|name| !claimed.iter().any(|known| known == name) && !is_reserved(name)).collect()
    }

    fn params(&mut self, specs: &[ParamSpec]) {
        let Some((_, variable)) = self.reflected.variable("params") else { return };
        self.errors.about("params");
        let members: Vec<Member> = specs
            .iter()
            .filter_map(|spec| Some((spec.name.clone(), spec.kind.scalar()?)))
            .enumerate()
            .map(|(index, (name, scalar))| Member {
                name: name.into(),
                scalar,
                lanes: 1,
                offset: 4 * index as u32,
            })
            .collect();
        if members.is_empty() {
            self.errors.push(format!("the stage has no parameters; remove `{}`", variable.wgsl));
            return;
        }
        let stride = 4 * members.len() as u32;
        self.uniform(variable, Element::Item { name: "Params".into(), stride, members: members.into() });
    }

    fn frame(&mut self) {
        if let Some((_, variable)) = self.reflected.variable("frame") {
            self.errors.about("frame");
            self.uniform(variable, Frame::element());
        }
    }

    fn uniform(&mut self, variable: &Variable, expected: Element) {
        let (name, found) = (&variable.name, &variable.wgsl);
        match &variable.space {
            Space::Uniform(element) => {
                if let Some(difference) = difference(element, &expected) {
                    let wanted = struct_text(&expected);
                    self.errors
                        .push(format!("`{found}` differs in layout from the stage: {difference}{wanted}"));
                }
            }
            _ => {
                let Element::Item { name: ty, .. } = &expected else { return };
                let wanted = struct_text(&expected);
                self.errors
                    .push(format!("`{name}` is `{found}`, declare it `var<uniform> {name}: {ty}`{wanted}"));
            }
        }
    }

    fn strangers(&mut self) {
        for name in self.unclaimed() {
            self.errors.about(name);
            let unknown = GraphError::unknown("variable", name, self.claimed());
            self.errors
                .push(format!("{unknown}; a shader binds only ports of the stage, `params` and `frame`"));
        }
    }

    fn bindings(&mut self) {
        for (index, variable) in self.reflected.variables.iter().enumerate() {
            let (name, group, binding) = (&variable.name, variable.group, variable.binding);
            self.errors.about(name);
            if group != 0 {
                self.errors.push(format!("`{name}` is in @group({group}); everything is bound in @group(0)"));
            }
            let earlier = &self.reflected.variables[..index];
            if let Some(other) = earlier.iter().find(|other| (other.group, other.binding) == (group, binding))
            {
                // `frame` is in an imported module, which need not change.
                if is_reserved(name) {
                    self.errors.about(&other.name);
                }
                self.errors.push(format!(
                    "`{name}` and `{}` both have @binding({binding}); give each its own number",
                    other.name
                ));
            }
        }
    }

    fn pass(&mut self, pass: &Pass) {
        match pass {
            Pass::Compute { entry, threads } => {
                if let Some(entry) = self.entry(entry, ShaderStage::Compute) {
                    self.threads(entry, *threads);
                }
            }
            Pass::Draw { .. } => self.draw(pass),
        }
    }

    fn threads(&mut self, entry: &'a Entry, threads: Threads) {
        let name = &entry.name;
        match threads {
            Threads::Blocks(_, 0) => {
                self.errors
                    .push(format!("`{name}` should have one thread for each 0 elements; give 1 or more"));
            }
            Threads::Groups(count) if count > MAX_GROUPS => self.errors.push(format!(
                "`{name}` has {count} workgroups; {MAX_GROUPS} along an axis work on every device"
            )),
            Threads::Indirect(counts) => {
                let variable = self.variable(counts);
                let port = &self.declaration.ports[counts.port as usize];
                let element = &port.fields[counts.field as usize].element;
                let is_u32 = |member: &Member| member.scalar == Scalar::U32;
                if !matches!(element, Element::Item { members, .. } if members.iter().all(is_u32)) {
                    self.errors.push(format!(
                        "the numbers of workgroups of `{name}` come from `{variable}`, which is {element}; they should \
                         come from a buffer of u32"
                    ));
                }
                if self.used(entry).any(|used| used.name == variable && used.space.writable()) {
                    self.errors.push(format!(
                        "`{name}` uses `{variable}`, which is writable, but has its numbers of workgroups from there; \
                         write them in an earlier pass, and do not use `{variable}` in this one"
                    ));
                }
            }
            Threads::Over(_) | Threads::Blocks(..) | Threads::Groups(_) => {}
        }
    }

    fn entry(&mut self, name: &str, stage: ShaderStage) -> Option<&'a Entry> {
        self.errors.about(name);
        let attribute = stage_name(stage);
        let reflected = self.reflected;
        match reflected.entry(name) {
            Some((_, entry)) if entry.stage == stage => return Some(entry),
            Some((_, entry)) => {
                let found = stage_name(entry.stage);
                self.errors
                    .push(format!("entry point `{name}` is @{found}; this pass needs it to be @{attribute}"));
            }
            None => {
                let entries = reflected.entries.iter().filter(|entry| entry.stage == stage);
                let unknown = GraphError::unknown("entry point", name, entries.map(|entry| &entry.name));
                self.errors.push(format!("{unknown}; the stage runs it as @{attribute}"));
            }
        }
        None
    }

    fn limits(&mut self, entry: &Entry) {
        self.errors.about(&entry.name);
        // The buffer of the checks is there in watched runs only.
        let used = entry.uses.iter().map(|&index| &self.reflected.variables[index]);
        let used = || used.clone().filter(|variable| variable.name != CHECKS).map(|variable| &variable.space);
        let buffers = used().filter(|space| matches!(space, Space::Buffer { .. })).count();
        let textures = used().filter(|space| matches!(space, Space::StorageTexture { .. })).count();
        let invocations: u64 = entry.workgroup_size.iter().map(|&size| u64::from(size)).product();
        let counts = [
            ("storage buffers", buffers as u64, MAX_BUFFERS as u64),
            ("storage textures", textures as u64, MAX_STORAGE_TEXTURES as u64),
            ("threads a workgroup", invocations, MAX_INVOCATIONS),
            ("bytes of workgroup memory", entry.workgroup_bytes.into(), MAX_WORKGROUP_BYTES.into()),
        ];
        for (what, found, limit) in counts {
            if found > limit {
                self.errors.push(format!(
                    "entry point `{}` has {found} {what}; {limit} work on every device",
                    entry.name
                ));
            }
        }
    }
}

fn is_reserved(name: &str) -> bool {
    matches!(name, "params" | "frame" | CHECKS)
}

fn stage_name(stage: ShaderStage) -> &'static str {
    match stage {
        ShaderStage::Vertex => "vertex",
        ShaderStage::Fragment => "fragment",
        ShaderStage::Compute => "compute",
        _ => "another stage",
    }
}

/// The declaration that the shader should have for a field of a port.
fn wanted(name: &str, port: &Port, field: usize) -> String {
    let writes = matches!(port.access, Access::Update | Access::Write);
    match &port.fields[field].element {
        Element::Texel(format) if writes => {
            format!("var {name}: texture_storage_2d<{}, write>", format.wgsl())
        }
        Element::Texel(format) => {
            format!("var {name}: texture_2d<{}>", format.scalar().wgsl())
        }
        Element::AnyFloatTexel => format!("var {name}: texture_2d<f32>"),
        element @ Element::Item { .. } => {
            let access = if writes { "read_write" } else { "read" };
            format!("var<storage, {access}> {name}: {element}")
        }
    }
}

/// Why a variable does not fit a field of a port.
fn mismatch(variable: &Variable, port: &Port, field: usize, target: bool) -> Option<Cow<'static, str>> {
    let reads_only = matches!(port.access, Access::Read | Access::History);
    match (&port.fields[field].element, &variable.space) {
        (Element::Texel(format), Space::Texture(scalar)) => {
            if *scalar != format.scalar() {
                return Some(format!("its format is {}", format.wgsl()).into());
            }
            // An output is declared as a sampled texture only if it is a render target, not a storage texture.
            (port.access == Access::Write && !target)
                .then_some("an output is written with textureStore".into())
        }
        (Element::AnyFloatTexel, Space::Texture(Scalar::F32)) => None,
        (Element::Texel(_), Space::StorageTexture { .. }) if reads_only => {
            Some("an input is read as a sampled texture".into())
        }
        (Element::Texel(wanted), Space::StorageTexture { format, access }) => {
            if wanted != format {
                Some(format!("its format is {}", wanted.wgsl()).into())
            } else if !access.contains(StorageAccess::STORE) {
                Some("an output is written with textureStore".into())
            } else {
                None
            }
        }
        (Element::Item { name, members, .. }, Space::Buffer { writable, element }) => {
            if reads_only && *writable {
                return Some("an input is only read".into());
            }
            let expected = &port.fields[field].element;
            if let Some(difference) = difference(element, expected) {
                return Some(format!("{difference}{}", struct_text(expected)).into());
            }
            // Members agree; a struct must also have the stage's name for it, so that readers find one from the other.
            let is_struct = members.iter().all(|member| !member.name.is_empty());
            match element {
                Element::Item { name: found, .. } if is_struct && found != name => {
                    Some(format!("its struct is named {name}").into())
                }
                _ => None,
            }
        }
        (Element::Item { .. }, _) => {
            Some("it is a buffer of 32-bit scalars, vectors or structs of those".into())
        }
        (Element::Texel(_) | Element::AnyFloatTexel, _) => Some("it is a two-dimensional texture".into()),
    }
}

/// The first difference between two layouts, as text.
fn difference(found: &Element, expected: &Element) -> Option<String> {
    let (
        Element::Item { stride, members, .. },
        Element::Item { stride: expected_stride, members: expected, .. },
    ) = (found, expected)
    else {
        return Some("one is a texture".into());
    };
    for index in 0..members.len().max(expected.len()) {
        match (members.get(index), expected.get(index)) {
            (Some(found), Some(expected)) if found == expected => {}
            (Some(found), Some(expected)) => {
                return Some(format!("{}, expected {}", words(found), words(expected)));
            }
            (Some(found), None) => return Some(format!("{} is not expected", words(found))),
            (None, Some(expected)) => return Some(format!("{} is missing", words(expected))),
            (None, None) => {}
        }
    }
    (stride != expected_stride)
        .then(|| format!("one element takes {stride} bytes, expected {expected_stride}"))
}

fn words(member: &Member) -> String {
    match member.name.as_ref() {
        "" => format!("its elements are {}", member.wgsl_type()),
        name => format!("member `{name}: {}` at byte {}", member.wgsl_type(), member.offset),
    }
}

/// `, with struct Point { age: u32 }` for structs without nested structs, otherwise empty.
fn struct_text(element: &Element) -> String {
    let Element::Item { name, members, .. } = element else { return String::new() };
    if members.iter().any(|member| member.name.is_empty() || member.name.contains('.')) {
        return String::new();
    }
    let members: Vec<String> =
        members.iter().map(|member| format!("{}: {}", member.name, member.wgsl_type())).collect();
    format!(", with struct {name} {{ {} }}", members.join(", "))
}
