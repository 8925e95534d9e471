//! What a draw requires of its targets and entry points.

use naga::{Binding, BuiltIn, Handle, ShaderStage, Type, TypeInner, common::wgsl::TypeContext};

use super::Check;
use crate::{
    port::{Access, Element, FieldRef, Format},
    reflect::{Entry, Variable},
    shader::{MAX_TARGETS, Pass, Shape},
};

/// Bytes of a pixel in all targets together (WebGPU's default limit for colour attachments).
const MAX_TARGET_BYTES: u32 = 32;
/// Values that a vertex entry point may pass on (WebGPU's default limit).
const MAX_VARYINGS: usize = 16;

impl<'a> Check<'a> {
    /// Checks a [`Pass::Draw`].
    pub fn draw(&mut self, pass: &Pass) {
        let Pass::Draw { vertex, fragment, shape, vertices, targets, depth, clear, .. } = pass else {
            return;
        };
        self.errors.about(vertex);
        let formats = self.targets(vertex, targets, *clear);
        let each = shape.vertices();
        if *vertices == 0 || vertices % each != 0 {
            let shape = format!("{shape:?}").to_lowercase();
            self.errors.push(format!(
                "the draw of `{vertex}` has {vertices} vertices for each element; {shape} need a multiple of {each}, \
                 at least {each}"
            ));
        }
        let vertex = self.entry(vertex, ShaderStage::Vertex);
        let fragment = self.entry(fragment, ShaderStage::Fragment);
        for entry in [vertex, fragment].into_iter().flatten() {
            let is_target =
                |used: &&Variable| targets.iter().any(|target| self.variable(*target) == used.name);
            if let Some(target) = self.used(entry).find(is_target) {
                let target = &target.name;
                self.errors.about(&entry.name);
                self.errors.push(format!("`{}` uses `{target}`, which this pass draws to", entry.name));
            }
        }
        if let Some(vertex) = vertex {
            self.vertex(vertex, *shape, *vertices);
        }
        // A target that was left out would shift the others.
        if let Some(fragment) = fragment
            && formats.len() == targets.len()
        {
            self.fragment(fragment, &formats, *depth);
        }
        if let (Some(vertex), Some(fragment)) = (vertex, fragment) {
            self.varyings(vertex, fragment);
        }
    }

    /// The names and formats of the targets; wrong ones are reported and left out.
    fn targets(&mut self, vertex: &str, targets: &[FieldRef], clear: f64) -> Vec<(String, Format)> {
        if targets.is_empty() || targets.len() > MAX_TARGETS {
            let count = targets.len();
            self.errors.push(format!(
                "the draw of `{vertex}` has {count} targets; it should have at least one, and {MAX_TARGETS} work on \
                 every device"
            ));
        }
        let mut formats = Vec::new();
        for (index, &target) in targets.iter().enumerate() {
            let port = &self.declaration.ports[target.port as usize];
            let name = self.variable(target);
            match port.fields[target.field as usize].element {
                _ if targets[..index].contains(&target) => {
                    self.errors.push(format!("the draw of `{vertex}` has the target `{name}` twice"));
                }
                Element::Texel(format) if port.access == Access::Write => formats.push((name, format)),
                _ => {
                    self.errors.push(format!("`{name}` is not a texture output; a draw has no other targets"))
                }
            }
        }
        let bytes: u32 = formats.iter().map(|(_, format)| attachment_bytes(*format)).sum();
        if bytes > MAX_TARGET_BYTES {
            self.errors.push(format!(
                "the targets of `{vertex}` have {bytes} bytes a pixel; {MAX_TARGET_BYTES} work on every device"
            ));
        }
        let is_u32 = clear.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&clear);
        if let Some((name, _)) = formats.iter().find(|(_, format)| !is_u32 && !format.is_float()) {
            self.errors.push(format!("`{name}` has texels of u32; {clear} cannot be what it is cleared to"));
        }
        formats
    }

    fn vertex(&mut self, entry: &'a Entry, shape: Shape, vertices: u32) {
        let name = &entry.name;
        self.errors.about(name);
        for (binding, _) in self.inputs(entry) {
            match binding {
                Binding::BuiltIn(BuiltIn::InstanceIndex) => self.errors.push(format!(
                    "`{name}` takes @builtin(instance_index), which is always 0; the element is \
                     @builtin(vertex_index) / {vertices}u"
                )),
                Binding::Location { location, .. } => self.errors.push(format!(
                    "`{name}` takes @location({location}), but there are no vertex buffers; take \
                     @builtin(vertex_index) and read a port"
                )),
                Binding::BuiltIn(_) => {}
            }
        }
        for Variable { name: used, .. } in self.used(entry).filter(|used| used.space.writable()) {
            self.errors.push(format!(
                "`{name}` uses `{used}`, which is writable; a vertex entry point can only read"
            ));
        }
        let passed =
            self.outputs(entry).into_iter().filter(|(binding, _)| location(binding).is_some()).count();
        // The size of a point takes the place of one.
        let limit = MAX_VARYINGS - usize::from(shape == Shape::Points);
        if passed > limit {
            self.errors.push(format!("`{name}` returns {passed} values; {limit} work on every device"));
        }
    }

    /// Compares what a fragment entry point returns with the targets.
    fn fragment(&mut self, entry: &Entry, targets: &[(String, Format)], depth: bool) {
        let name = &entry.name;
        self.errors.about(name);
        let outputs = self.outputs(entry);
        for (index, (target, format)) in targets.iter().enumerate() {
            let wanted = || match format.channels() {
                1 => format.scalar().wgsl().to_owned(),
                lanes => format!("vec{lanes}<{}>", format.scalar().wgsl()),
            };
            let found = outputs.iter().find(|(binding, _)| location(binding) == Some(index as u32));
            match found {
                None => self.errors.push(format!(
                    "`{name}` returns nothing at @location({index}); for `{target}`, return {} there",
                    wanted()
                )),
                Some((_, ty)) if !self.covers(*ty, *format) => self.errors.push(format!(
                    "`{name}` returns {} at @location({index}); for `{target}`, return {}",
                    self.type_text(*ty),
                    wanted()
                )),
                Some(_) => {}
            }
        }
        for (binding, _) in outputs {
            match binding {
                Binding::BuiltIn(BuiltIn::FragDepth) if !depth => self
                    .errors
                    .push(format!("`{name}` returns @builtin(frag_depth), but its draw has no depth test")),
                Binding::Location { location, .. } if *location as usize >= targets.len() => {
                    let count = targets.len();
                    self.errors.push(format!(
                        "`{name}` returns @location({location}), but its draw has {count} targets, numbered from 0"
                    ));
                }
                _ => {}
            }
        }
    }

    /// Compares what a fragment entry point takes with what the vertex entry point returns.
    fn varyings(&mut self, vertex: &Entry, fragment: &Entry) {
        self.errors.about(&fragment.name);
        let outputs = self.outputs(vertex);
        for (taken, ty) in self.inputs(fragment) {
            let Binding::Location { location: at, interpolation, sampling, .. } = taken else { continue };
            let takes = format!("`{}` takes {} at @location({at})", fragment.name, self.type_text(ty));
            let returns = match outputs.iter().find(|(binding, _)| location(binding) == Some(*at)) {
                None => "nothing there".to_owned(),
                Some((_, returned)) if *returned != ty => self.type_text(*returned),
                Some((returned, _)) => match returned {
                    Binding::Location { interpolation: i, sampling: s, .. }
                        if (i, s) == (interpolation, sampling) =>
                    {
                        continue;
                    }
                    _ => "it with another @interpolate".to_owned(),
                },
            };
            self.errors.push(format!("{takes}, but `{}` returns {returns}", vertex.name));
        }
    }

    /// Whether a value of this type has all channels of a texel.
    fn covers(&self, ty: Handle<Type>, format: Format) -> bool {
        let (scalar, lanes) = match self.reflected.module.types[ty].inner {
            TypeInner::Scalar(scalar) => (scalar, 1),
            TypeInner::Vector { size, scalar } => (scalar, size as u32),
            _ => return false,
        };
        let kind = if format.is_float() { naga::ScalarKind::Float } else { naga::ScalarKind::Uint };
        scalar == naga::Scalar { kind, width: 4 } && lanes >= format.channels()
    }

    /// What an entry point takes, with its attributes.
    fn inputs(&self, entry: &Entry) -> Vec<Varying<'a>> {
        let arguments = &self.function(entry).arguments;
        arguments.iter().flat_map(|argument| self.flattened(argument.binding.as_ref(), argument.ty)).collect()
    }

    /// What an entry point returns, with its attributes.
    fn outputs(&self, entry: &Entry) -> Vec<Varying<'a>> {
        let result = self.function(entry).result.as_ref();
        result.map_or_else(Vec::new, |result| self.flattened(result.binding.as_ref(), result.ty))
    }

    fn function(&self, entry: &Entry) -> &'a naga::Function {
        let mut entries = self.reflected.module.entry_points.iter();
        &entries.find(|found| found.name == entry.name).expect("reflected from the module").function
    }

    /// A value with attributes, or the members of a struct.
    fn flattened(&self, binding: Option<&'a Binding>, ty: Handle<Type>) -> Vec<Varying<'a>> {
        match (binding, &self.reflected.module.types[ty].inner) {
            (Some(binding), _) => vec![(binding, ty)],
            (None, TypeInner::Struct { members, .. }) => {
                members.iter().filter_map(|member| Some((member.binding.as_ref()?, member.ty))).collect()
            }
            (None, _) => Vec::new(),
        }
    }

    fn type_text(&self, ty: Handle<Type>) -> String {
        self.reflected.module.types.type_to_string(ty)
    }
}

/// A value that enters or leaves an entry point.
type Varying<'a> = (&'a Binding, Handle<Type>);

fn location(binding: &Binding) -> Option<u32> {
    match binding {
        Binding::Location { location, .. } => Some(*location),
        Binding::BuiltIn(_) => None,
    }
}

/// Bytes that a pixel of a target counts towards the limit, by WebGPU's table of formats.
fn attachment_bytes(format: Format) -> u32 {
    match format {
        Format::R32Float | Format::R32Uint => 4,
        Format::Rgba8Unorm | Format::Rgba16Float => 8,
        Format::Rgba32Float => 16,
    }
}
