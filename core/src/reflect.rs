//! Shaders as values: naga composes, validates and lists them variable by variable, without a GPU.

mod check;
mod compose;
pub(crate) mod outline;

use naga::common::wgsl::{ToWgsl, TypeContext, address_space_str};

use crate::{
    error::{GraphError, Span},
    port::{Element, Format, Member, Scalar},
    shader::{Needs, Shader, ShaderLibrary},
};

pub(crate) use check::{Misfit, errors_of_checks, misfits};
pub use check::{check, check_stage};
pub use compose::imports;
pub(crate) use compose::{
    CHECK_WORDS, CHECKS, Check, Composed, WATCH, at_its_line, compose as join, conditions, error_in,
    has_checks, is_edited, watched,
};

/// A composed and validated shader with its variables by name.
#[derive(Clone, Debug)]
pub struct Reflected {
    /// The whole shader, as passed to wgpu.
    pub module: naga::Module,
    /// The validator's results.
    pub info: naga::valid::ModuleInfo,
    /// All bound variables in declaration order; those of imported modules come last.
    pub variables: Vec<Variable>,
    /// All entry points, in declaration order.
    pub entries: Vec<Entry>,
}

/// A bound variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// `@group`.
    pub group: u32,
    /// `@binding`.
    pub binding: u32,
    /// Its address space and type.
    pub space: Space,
    /// Its declaration in WGSL without attributes: `var<storage, read> weights: array<f32>`.
    pub wgsl: String,
}

/// A variable's address space and type.
#[derive(Clone, Debug, PartialEq)]
pub enum Space {
    /// `var<uniform>`. Members of nested structs are named `view.eye`.
    Uniform(Element),
    /// `var<storage>` of type `array<T>`.
    Buffer {
        /// `read_write`; else `read`.
        writable: bool,
        /// The type of one array element. `atomic<T>` counts as `T`, and `atomic<u64>` as `vec2<u32>`.
        element: Element,
    },
    /// `texture_2d<f32>` or `texture_2d<u32>`.
    Texture(Scalar),
    /// `texture_storage_2d`.
    StorageTexture {
        /// Texel format.
        format: Format,
        /// Read, write or both.
        access: naga::StorageAccess,
    },
    /// Anything that no port binds: a sampler, a cube map, a buffer that is not an array of 32-bit scalars, vectors or
    /// structs of those.
    Other,
}

impl Space {
    /// Whether the shader may write it.
    pub fn writable(&self) -> bool {
        match self {
            Self::Buffer { writable, .. } => *writable,
            Self::StorageTexture { access, .. } => access.contains(naga::StorageAccess::STORE),
            Self::Uniform(_) | Self::Texture(_) | Self::Other => false,
        }
    }
}

/// An entry point.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its name.
    pub name: String,
    /// Compute, vertex or fragment.
    pub stage: naga::ShaderStage,
    /// Threads of a workgroup; zeros if not compute.
    pub workgroup_size: [u32; 3],
    /// Bytes of `var<workgroup>` memory that it uses.
    pub workgroup_bytes: u32,
    /// Indices of the [`Reflected::variables`] that it uses, directly or through functions.
    pub uses: Vec<usize>,
    /// Those of them that it reads.
    pub reads: Vec<usize>,
    /// Those of them that it writes.
    pub writes: Vec<usize>,
    /// Atomic operations in its text and that of the functions that it calls, as often as it calls them. Atomic loads
    /// and stores are none.
    pub atomics: u32,
}

impl Reflected {
    /// The variable with this name, with its index.
    pub fn variable(&self, name: &str) -> Option<(usize, &Variable)> {
        self.variables.iter().enumerate().find(|(_, variable)| variable.name == name)
    }

    /// The entry point with this name, with its index.
    pub fn entry(&self, name: &str) -> Option<(usize, &Entry)> {
        self.entries.iter().enumerate().find(|(_, entry)| entry.name == name)
    }
}

/// Composes, parses, validates and lists a shader.
///
/// A line `#import NAME` includes the library's module of that name (its file name without folder and `.wgsl`);
/// `#ifdef`, `#ifndef`, `#else` and `#endif` depend on [`Shader::defines`]. Names from an imported module need no
/// prefix. 64-bit integers are accepted only with [`Needs::atomic64`].
///
/// Errors: [`GraphError::Shader`] with the file, the line and naga's message.
pub fn compose(shader: &Shader, library: &ShaderLibrary, needs: Needs) -> Result<Reflected, GraphError> {
    validate(&join(shader, library)?, needs)
}

/// Parses, validates and lists a composed shader; the second half of [`compose`].
pub(crate) fn validate(composed: &Composed, needs: Needs) -> Result<Reflected, GraphError> {
    let analysed = analyse(&composed.text, needs);
    let (module, info) = analysed.map_err(|Fault { places, message }| {
        if let Some(unclosed) = composed.unclosed() {
            return unclosed;
        }
        // Of two places, that in the shader: it is more likely to be wrong than a module.
        let own = places.iter().find(|place| composed.is_own(**place)).or(places.first());
        let text = &composed.text;
        let found = own.copied().or_else(|| faulty_function(text, needs, &message));
        match found.or_else(|| faulty_line(text, needs, &message)) {
            Some(place) => composed.error(place, &message),
            None => composed.error_anywhere(&message),
        }
    })?;
    Ok(reflect(module, info))
}

/// What is wrong with a text, and the places that naga names, the most important one first.
struct Fault {
    places: Vec<Span>,
    message: String,
}

impl Fault {
    fn new(spans: impl Iterator<Item = naga::Span>, message: String) -> Self {
        // Some spans are of implied types, which do not occur in the text.
        let ranges = spans.filter_map(|span| span.to_range());
        Self { places: ranges.map(|range| Span { start: range.start, end: range.end }).collect(), message }
    }
}

/// Parses and validates.
fn analyse(text: &str, needs: Needs) -> Result<(naga::Module, naga::valid::ModuleInfo), Fault> {
    let options = naga::front::wgsl::Options {
        // wgpu keeps one entry point of a module for a pipeline, but the comments of all, and then rejects the module.
        parse_doc_comments: false,
        capabilities: naga::valid::Capabilities::all(),
    };
    let module = naga::front::wgsl::Frontend::new_with_options(options).parse(text).map_err(|error| {
        let label = error.labels().find(|(span, _)| span.is_defined());
        let mut message = error.message().to_owned();
        // A label that only repeats words of the message says nothing new.
        let is_new = |label: &str| label.split_whitespace().any(|word| !error.message().contains(word));
        if let Some((_, label)) = label.filter(|(_, label)| is_new(label)) {
            message += &format!(" ({label})");
        }
        for note in error.notes() {
            message += &format!("; {note}");
        }
        Fault::new(error.labels().map(|(span, _)| span), message)
    })?;

    let mut capabilities = naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32;
    if needs.atomic64 {
        capabilities |=
            naga::valid::Capabilities::SHADER_INT64 | naga::valid::Capabilities::SHADER_INT64_ATOMIC_MIN_MAX;
    }
    let info = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
        .validate(&module)
        .map_err(|error| {
            if let Some(fault) = collision(error.as_inner(), &module) {
                return fault;
            }
            let causes: Vec<String> =
                std::iter::successors(Some(error.as_inner() as &dyn std::error::Error), |error| {
                    error.source()
                })
                .map(ToString::to_string)
                .collect();
            Fault::new(error.spans().map(|(span, _)| *span), causes.join(": "))
        })?;
    Ok((module, info))
}

/// Two variables with one binding.
fn collision(error: &naga::valid::ValidationError, module: &naga::Module) -> Option<Fault> {
    let naga::valid::ValidationError::EntryPoint {
        source: naga::valid::EntryPointError::BindingCollision(second),
        ..
    } = error
    else {
        return None;
    };
    let variables = &module.global_variables;
    let binding = variables[*second].binding;
    let (first, _) = variables.iter().find(|(_, variable)| variable.binding == binding)?;
    let [a, b] = [first, *second].map(|variable| variables[variable].name.as_deref().unwrap_or_default());
    let message =
        format!("`{a}` and `{b}` both have @binding({}); give each its own number", binding?.binding);
    Some(Fault::new([first, *second].into_iter().map(|variable| variables.get_span(variable)), message))
}

/// Whether a text has this fault. Types and expressions are numbered, so the same fault may have other numbers.
fn has_fault(text: &str, needs: Needs, message: &str) -> bool {
    let words = |message: &str| message.replace(|c: char| c.is_ascii_digit(), "");
    analyse(text, needs).is_err_and(|fault| words(&fault.message) == words(message))
}

/// The name of the function that is to blame for a message without a place: without its body, the message is another.
fn faulty_function(text: &str, needs: Needs, message: &str) -> Option<Span> {
    let is_to_blame = |body: Span| {
        let without = format!("{}{}", &text[..body.start], &text[body.end..]);
        !has_fault(&without, needs, message)
    };
    outline::functions(text).into_iter().find(|(_, body)| is_to_blame(*body)).map(|(name, _)| name)
}

/// The line that is to blame for such a message: with it the text has the fault, without it and what follows it has not.
fn faulty_line(text: &str, needs: Needs, message: &str) -> Option<Span> {
    let ends: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).collect();
    let line = ends.partition_point(|&end| !has_fault(&text[..end], needs, message));
    let end = *ends.get(line)?;
    let start = line.checked_sub(1).map_or(0, |before| ends[before] + 1);
    Some(Span { start, end })
}

fn reflect(module: naga::Module, info: naga::valid::ModuleInfo) -> Reflected {
    let bound: Vec<_> = module
        .global_variables
        .iter()
        .filter_map(|(handle, variable)| Some((handle, variable, variable.binding?)))
        .collect();
    let variables = bound
        .iter()
        .map(|(_, variable, binding)| {
            let name = variable.name.clone().unwrap_or_default();
            let space = match address_space_str(variable.space) {
                (Some(space), Some(access)) => format!("<{space}, {access}>"),
                (Some("storage"), None) => "<storage, read>".to_owned(),
                (Some(space), None) => format!("<{space}>"),
                (None, _) => String::new(),
            };
            Variable {
                wgsl: format!("var{space} {name}: {}", module.types.type_to_string(variable.ty)),
                name,
                group: binding.group,
                binding: binding.binding,
                space: space_of(&module, variable),
            }
        })
        .collect();

    let mut layouter = naga::proc::Layouter::default();
    // The validator has already laid out the same types.
    layouter.update(module.to_ctx()).expect("a valid module can be laid out");
    let entries = module
        .entry_points
        .iter()
        .enumerate()
        .map(|(index, entry)| {
            let used = info.get_entry_point(index);
            let with = |uses: naga::valid::GlobalUse| {
                (0..bound.len()).filter(|&index| used[bound[index].0].intersects(uses)).collect()
            };
            Entry {
                name: entry.name.clone(),
                stage: entry.stage,
                workgroup_size: entry.workgroup_size,
                workgroup_bytes: module
                    .global_variables
                    .iter()
                    .filter(|(handle, variable)| {
                        variable.space == naga::AddressSpace::WorkGroup && !used[*handle].is_empty()
                    })
                    .map(|(_, variable)| layouter[variable.ty].size)
                    .sum(),
                uses: with(naga::valid::GlobalUse::all()),
                reads: with(naga::valid::GlobalUse::READ | naga::valid::GlobalUse::ATOMIC),
                writes: with(naga::valid::GlobalUse::WRITE | naga::valid::GlobalUse::ATOMIC),
                atomics: atomics(&module, &entry.function.body),
            }
        })
        .collect();
    Reflected { variables, entries, module, info }
}

/// The atomic operations of a block and all that it calls.
fn atomics(module: &naga::Module, block: &naga::Block) -> u32 {
    use naga::Statement;
    let within = |block: &naga::Block| atomics(module, block);
    let of = |statement: &Statement| match statement {
        Statement::Atomic { .. } | Statement::ImageAtomic { .. } => 1,
        Statement::Call { function, .. } => within(&module.functions[*function].body),
        Statement::Block(block) => within(block),
        Statement::If { accept, reject, .. } => within(accept) + within(reject),
        Statement::Switch { cases, .. } => cases.iter().map(|case| within(&case.body)).sum(),
        Statement::Loop { body, continuing, .. } => within(body) + within(continuing),
        _ => 0,
    };
    block.iter().map(of).sum()
}

fn scalar_of(scalar: naga::Scalar) -> Option<Scalar> {
    match (scalar.kind, scalar.width) {
        (naga::ScalarKind::Float, 4) => Some(Scalar::F32),
        (naga::ScalarKind::Uint, 4) => Some(Scalar::U32),
        (naga::ScalarKind::Sint, 4) => Some(Scalar::I32),
        _ => None,
    }
}

fn space_of(module: &naga::Module, variable: &naga::GlobalVariable) -> Space {
    use naga::{AddressSpace, ArraySize, ImageClass, ImageDimension, TypeInner};
    let known = match (variable.space, &module.types[variable.ty].inner) {
        (AddressSpace::Uniform, inner) => {
            let layout = inner.size(module.to_ctx());
            element_of(module, variable.ty, layout).map(Space::Uniform)
        }
        (AddressSpace::Storage { access }, TypeInner::Array { base, size: ArraySize::Dynamic, stride }) => {
            element_of(module, *base, *stride).map(|element| Space::Buffer {
                writable: access.contains(naga::StorageAccess::STORE),
                element,
            })
        }
        (AddressSpace::Handle, TypeInner::Image { dim: ImageDimension::D2, arrayed: false, class }) => {
            match *class {
                ImageClass::Sampled { kind: naga::ScalarKind::Float, multi: false } => {
                    Some(Space::Texture(Scalar::F32))
                }
                ImageClass::Sampled { kind: naga::ScalarKind::Uint, multi: false } => {
                    Some(Space::Texture(Scalar::U32))
                }
                ImageClass::Storage { format, access } => Format::ALL
                    .into_iter()
                    .find(|known| known.wgsl() == format.to_wgsl())
                    .map(|format| Space::StorageTexture { format, access }),
                _ => None,
            }
        }
        _ => None,
    };
    known.unwrap_or(Space::Other)
}

/// The layout of a type; `None` if it contains anything but 32-bit scalars, vectors and structs of those.
fn element_of(module: &naga::Module, ty: naga::Handle<naga::Type>, stride: u32) -> Option<Element> {
    let mut members = Vec::new();
    add_members(module, ty, "", 0, &mut members)?;
    let name = match (&module.types[ty].name, &members[..]) {
        (Some(name), _) => name.clone(),
        (None, [plain]) => plain.wgsl_type(),
        (None, _) => return None,
    };
    Some(Element::Item { name: name.into(), stride, members: members.into() })
}

fn add_members(
    module: &naga::Module,
    ty: naga::Handle<naga::Type>,
    name: &str,
    offset: u32,
    members: &mut Vec<Member>,
) -> Option<()> {
    use naga::TypeInner;
    let (scalar, lanes) = match module.types[ty].inner {
        TypeInner::Scalar(scalar) => (scalar, 1),
        TypeInner::Vector { size, scalar } => (scalar, size as u32),
        // Everywhere else, the two halves of a 64-bit atomic are a vec2<u32>.
        TypeInner::Atomic(naga::Scalar::U64) => (naga::Scalar::U32, 2),
        TypeInner::Atomic(scalar) => (scalar, 1),
        TypeInner::Struct { members: ref inner, .. } => {
            for member in inner {
                let own = member.name.as_deref().unwrap_or_default();
                let path = if name.is_empty() { own.to_owned() } else { format!("{name}.{own}") };
                add_members(module, member.ty, &path, offset + member.offset, members)?;
            }
            return Some(());
        }
        _ => return None,
    };
    members.push(Member { name: name.to_owned().into(), scalar: scalar_of(scalar)?, lanes, offset });
    Some(())
}

impl Member {
    /// Its type in WGSL, such as `vec3<f32>`.
    pub(crate) fn wgsl_type(&self) -> String {
        match self.lanes {
            1 => self.scalar.wgsl().to_owned(),
            lanes => format!("vec{lanes}<{}>", self.scalar.wgsl()),
        }
    }
}
