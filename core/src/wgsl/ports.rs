//! Ports: the bound variables of a shader, with what is declared above them.

use naga::StorageAccess;

use super::{
    Wrong,
    grammar::{Declared, Name, PortClause},
};
use crate::{
    error::{GraphError, Span, Spanned},
    port::{Access, Element, Extent, Field, FieldRef, Format, Lifetime, Port, Scalar},
    reflect::{Reflected, Space, Variable},
    registry::Registry,
    rule::Rule,
};

/// A bound variable with what is declared above it.
pub(super) struct Bound {
    pub name: Name,
    pub declared: Declared<PortClause>,
}

/// The ports of a shader, and where its variables are in them.
#[derive(Default)]
pub(super) struct Ports {
    pub ports: Vec<Port>,
    /// The field of each variable, by the variable's name.
    fields: Vec<(String, FieldRef)>,
    /// What the file leaves open and the node assumes, in sentences.
    pub assumed: Vec<String>,
}

impl Ports {
    /// The field that is bound to a variable.
    pub fn field(&self, variable: &str) -> Option<FieldRef> {
        self.fields.iter().find(|(name, _)| name == variable).map(|(_, field)| *field)
    }

    /// What a pass may name: a variable, or a bundle.
    pub fn find(&self, name: &Name) -> Result<FieldRef, String> {
        let bundle = self.ports.iter().position(|port| port.name == name.value.as_str());
        let bundle = bundle.map(|port| FieldRef { port: port as u16, field: 0 });
        self.field(&name.value).or(bundle).ok_or_else(|| {
            let known = self.fields.iter().map(|(name, _)| name);
            GraphError::unknown("port", &name.value, known).to_string()
        })
    }
}

/// The ports of the variables but for outputs that are `dropped`. Reports every variable that cannot be one, and every
/// clause that does not fit.
pub(super) fn ports(
    reflected: &Reflected,
    bound: &[Bound],
    registry: &Registry,
    connected: &dyn Fn(&str) -> bool,
    dropped: &dyn Fn(&str) -> bool,
    wrong: &mut Wrong,
) -> Ports {
    let mut found = Ports::default();
    let mut drafts = Vec::new();
    for variable in reflected.variables.iter().filter(|variable| !super::is_reserved(&variable.name)) {
        let bound = bound.iter().find(|bound| bound.name.value == variable.name);
        if dropped(&variable.name) && is_output(variable, bound) {
            continue;
        }
        let field = draft(variable, bound, &mut drafts, wrong);
        found.fields.extend(field.map(|field| (variable.name.clone(), field)));
    }
    fields_without_bundle(&drafts, wrong);
    found.ports = drafts.iter().map(|draft| draft.port(registry, &mut found.assumed, wrong)).collect();
    for (index, draft) in drafts.iter().enumerate() {
        found.ports[index].extent = draft.extent(index, &found.ports, registry, &mut found.assumed, wrong);
    }
    for (index, draft) in drafts.iter().enumerate() {
        if let Some(clause) = &draft.said.extent
            && is_circle(index, &found.ports, connected)
        {
            wrong.at(
                clause.span,
                format!("the extent of `{}` depends on itself; give one of the ports its own", draft.name),
            );
        }
    }
    found
}

/// A port of which some variables have been seen.
struct Draft<'r> {
    name: String,
    /// The name of its first variable, unless that is an imported module's.
    place: Option<Span>,
    fields: Vec<Field>,
    variables: Vec<(&'r Variable, Accessed)>,
    said: Said,
    doc: String,
}

/// How a shader may use a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Accessed {
    Reads,
    Writes,
    Both,
}

/// All clauses above the variables of a port, each at most once.
#[derive(Default)]
struct Said {
    output: Option<Span>,
    scratch: Option<Span>,
    kept: Option<Span>,
    last_frame: Option<Span>,
    optional: Option<Span>,
    field_of: Option<(Span, Name)>,
    means: Option<Name>,
    /// `None` within: any value.
    values: Option<(Span, Option<(f64, f64)>)>,
    format: Option<(Span, Format)>,
    extent: Option<Spanned<PortClause>>,
}

impl Said {
    /// Adds a clause. Returns what it says if that has been said.
    fn add(&mut self, clause: &Spanned<PortClause>) -> Result<(), &'static str> {
        fn set<T>(slot: &mut Option<T>, value: T, what: &'static str) -> Result<(), &'static str> {
            if slot.is_some() {
                return Err(what);
            }
            *slot = Some(value);
            Ok(())
        }
        let span = clause.span;
        match &clause.value {
            PortClause::Output => set(&mut self.output, span, "`output`"),
            PortClause::Scratch => set(&mut self.scratch, span, "`scratch`"),
            PortClause::Kept => set(&mut self.kept, span, "`kept`"),
            PortClause::LastFrame => set(&mut self.last_frame, span, "`last frame`"),
            PortClause::Optional => set(&mut self.optional, span, "`optional`"),
            PortClause::FieldOf(name) => set(&mut self.field_of, (span, name.clone()), "the bundle"),
            PortClause::Means(name) => set(&mut self.means, name.clone(), "the meaning"),
            PortClause::In(low, high) => {
                set(&mut self.values, (span, Some((*low, *high))), "what its values may be")
            }
            PortClause::AnyValue => set(&mut self.values, (span, None), "what its values may be"),
            PortClause::Format(format) => set(&mut self.format, (span, *format), "the format"),
            PortClause::Extent(_) | PortClause::Each(_) => {
                set(&mut self.extent, clause.clone(), "the number of elements")
            }
        }
    }

    fn add_all(&mut self, clauses: &[Spanned<PortClause>], variable: &str, wrong: &mut Wrong) {
        for clause in clauses {
            if let Err(what) = self.add(clause) {
                wrong.at(clause.span, format!("{what} of `{variable}` is given twice; remove one"));
            }
        }
    }
}

/// Adds a variable to the port that it belongs to. `None`, with a message, if it belongs to none.
fn draft<'r>(
    variable: &'r Variable,
    bound: Option<&Bound>,
    drafts: &mut Vec<Draft<'r>>,
    wrong: &mut Wrong,
) -> Option<FieldRef> {
    let place = bound.map(|bound| bound.name.span);
    let (accessed, element) = match accessed(variable) {
        Ok(both) => both,
        Err(message) => {
            wrong.at(place, message);
            return None;
        }
    };
    let clauses = bound.map_or(&[][..], |bound| &bound.declared.clauses);
    let is_of_field = |clause: &Spanned<PortClause>| matches!(clause.value, PortClause::FieldOf(_));
    let (of_field, of_port): (Vec<_>, Vec<_>) = clauses.iter().cloned().partition(is_of_field);
    let mut said = Said::default();
    said.add_all(&of_field, &variable.name, wrong);
    let (name, field) = match said.field_of {
        None => (variable.name.clone(), ""),
        Some((span, Name { value: bundle, .. })) => {
            let field = variable.name.strip_prefix(bundle.as_str()).and_then(|rest| rest.strip_prefix('_'));
            let Some(field) = field.filter(|field| !field.is_empty()) else {
                let found = &variable.name;
                wrong.at(
                    span,
                    format!("a field of `{bundle}` is a variable `{bundle}_x`; rename `{found}` to `{bundle}_{found}`"),
                );
                return None;
            };
            (bundle, field)
        }
    };
    let index = drafts.iter().position(|draft| draft.name == name).unwrap_or(drafts.len());
    if index == drafts.len() {
        let (fields, variables, said, doc) = Default::default();
        drafts.push(Draft { name: name.clone(), place, fields, variables, said, doc });
    }
    let draft = &mut drafts[index];
    if draft.fields.iter().any(|other| other.name.is_empty() || field.is_empty()) {
        wrong.at(place, format!("`{name}` is both a variable and a bundle; rename one of them"));
        return None;
    }
    draft.fields.push(Field { name: field.to_owned().into(), element });
    draft.variables.push((variable, accessed));
    draft.said.add_all(&of_port, &variable.name, wrong);
    if draft.doc.is_empty() {
        draft.doc = bound.map_or(String::new(), |bound| bound.declared.prose.clone());
    }
    Some(FieldRef { port: index as u16, field: draft.fields.len() as u16 - 1 })
}

/// How the shader may use a variable, and its elements; or why it cannot be a port.
fn accessed(variable: &Variable) -> Result<(Accessed, Element), String> {
    Ok(match &variable.space {
        Space::Texture(Scalar::F32) => (Accessed::Reads, Element::AnyFloatTexel),
        Space::Texture(_) => (Accessed::Reads, Element::Texel(Format::R32Uint)),
        Space::StorageTexture { format, access } if *access == StorageAccess::STORE => {
            (Accessed::Writes, Element::Texel(*format))
        }
        Space::StorageTexture { format, access } if access.contains(StorageAccess::STORE) => {
            (Accessed::Both, Element::Texel(*format))
        }
        Space::Buffer { writable: true, element } => (Accessed::Both, element.clone()),
        Space::Buffer { writable: false, element } => (Accessed::Reads, element.clone()),
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
    })
}

fn is_output(variable: &Variable, bound: Option<&Bound>) -> bool {
    let clauses = bound.map_or(&[][..], |bound| &bound.declared.clauses);
    let is_role = |clause: &PortClause| {
        matches!(clause, PortClause::Output | PortClause::Scratch | PortClause::Kept | PortClause::Format(_))
    };
    clauses.iter().any(|clause| is_role(&clause.value))
        || matches!(accessed(variable), Ok((Accessed::Writes, _)))
}

/// Reports variables that are called like a field of a bundle.
fn fields_without_bundle(drafts: &[Draft], wrong: &mut Wrong) {
    let (ports, bundles): (Vec<&Draft>, Vec<&Draft>) =
        drafts.iter().partition(|draft| draft.said.field_of.is_none() && draft.fields[0].name.is_empty());
    for Draft { name, place, .. } in ports {
        let of =
            |bundle: &&&Draft| name.strip_prefix(&*bundle.name).is_some_and(|rest| rest.starts_with('_'));
        if let Some(Draft { name: bundle, .. }) = bundles.iter().find(of) {
            let text = format!(
                "`{name}` is called like a field of `{bundle}`; add `field of {bundle}`, or rename it"
            );
            wrong.at(*place, text);
        }
    }
}

impl Draft<'_> {
    /// The port, but for its extent.
    fn port(&self, registry: &Registry, assumed: &mut Vec<String>, wrong: &mut Wrong) -> Port {
        let name = &self.name;
        let access = self.access(assumed, wrong);
        if let Some(optional) =
            self.said.optional.filter(|_| !matches!(access, Access::Read | Access::History))
        {
            wrong.at(
                optional,
                format!("`{name}` is written; only an input that is only read may stay unconnected"),
            );
        }
        let meaning = match &self.said.means {
            Some(said) => {
                let meaning = registry.meaning(&said.value);
                if meaning.is_none() {
                    let known = registry.meanings().into_iter().map(|meaning| meaning.name);
                    wrong.at(said.span, GraphError::unknown("meaning", &said.value, known).to_string());
                }
                meaning
            }
            None => registry
                .meaning(name)
                .inspect(|_| assumed.push(format!("`{name}` means {name}, by its name."))),
        };
        let doc = match meaning {
            _ if !self.doc.is_empty() => self.doc.clone(),
            Some(meaning) => meaning.doc.to_owned(),
            None => self.variables[0].0.wgsl.clone(),
        };
        let mut fields = self.fields.clone();
        if let Some((span, format)) = self.said.format {
            match &self.variables[..] {
                [(Variable { space: Space::Texture(scalar), .. }, _)] if *scalar == format.scalar() => {
                    fields[0].element = Element::Texel(format);
                }
                [(Variable { wgsl, .. }, _), ..] => {
                    let (format, scalar) = (format.wgsl(), format.scalar().wgsl());
                    wrong.at(
                        span,
                        format!("`{wgsl}` has no texels of {format}; this is for texture_2d<{scalar}>"),
                    );
                }
                [] => {}
            }
        }
        let kept = self.said.kept.is_some();
        Port {
            name: name.clone().into(),
            doc: doc.into(),
            access,
            meaning,
            scratch: self.said.scratch.is_some(),
            rules: self.rules(&fields, access, wrong).into(),
            fields,
            extent: Extent::Any,
            extent_on_cpu: None,
            lifetime: if kept { Lifetime::Persistent } else { Lifetime::Transient },
            optional: self.said.optional.is_some(),
            table: &[],
        }
    }

    /// What the values may be, as declared.
    fn rules(&self, fields: &[Field], access: Access, wrong: &mut Wrong) -> Vec<Rule> {
        let Some((span, range)) = self.said.values else { return Vec::new() };
        let name = &self.name;
        if matches!(access, Access::Read | Access::History) {
            wrong.at(span, format!("`{name}` is only read; its values are checked where they are written"));
        }
        let Some((low, high)) = range else { return vec![Rule::any()] };
        if low > high {
            wrong.at(span, format!("the range of `{name}` is empty; the lower number comes first"));
        }
        let scalars = fields.iter().flat_map(|field| field.element.scalars());
        let floats: Vec<bool> = scalars.map(|scalar| scalar == Scalar::F32).collect();
        if floats.iter().any(|float| *float != floats[0]) {
            let text = format!("`{name}` has floats and whole numbers; a range is for numbers of one kind");
            wrong.at(span, text);
        }
        if floats.first() == Some(&true) {
            return vec![Rule::floats(low as f32, high as f32)];
        }
        if [low, high].iter().any(|bound| bound.fract() != 0.0) {
            wrong.at(span, format!("`{name}` has whole numbers; give whole numbers as the range"));
        }
        vec![Rule::wholes(low as i64, high as i64)]
    }

    fn access(&self, assumed: &mut Vec<String>, wrong: &mut Wrong) -> Access {
        let Self { name, variables, said, .. } = self;
        let find = |reads: bool| variables.iter().find(|(_, how)| (*how == Accessed::Reads) == reads);
        let drawn = said.format.map(|(span, _)| span);
        match (said.output.or(said.scratch).or(said.kept).or(drawn), said.last_frame) {
            (Some(output), Some(last)) => {
                let second = if output.start < last.start { last } else { output };
                wrong.at(
                    second,
                    format!("`{name}` cannot be an output and an input of the frame before; remove one"),
                );
                Access::Write
            }
            (Some(output), None) => {
                if let (Some((Variable { wgsl, .. }, _)), None) = (find(true), drawn) {
                    wrong.at(
                        output,
                        format!(
                            "`{wgsl}` is only read, so it is no output; declare it `var<storage, read_write>` or \
                             `texture_storage_2d<FORMAT, write>`, or add `format FORMAT` if a draw writes it"
                        ),
                    );
                }
                Access::Write
            }
            (None, Some(last)) => {
                if let Some((Variable { wgsl, .. }, _)) = find(false) {
                    wrong.at(
                        last,
                        format!(
                            "`{wgsl}` may be written, but the frame before is only read; declare it `var<storage, read>`, \
                             or `texture_2d<f32>`"
                        ),
                    );
                }
                Access::History
            }
            (None, None) if find(false).is_none() => Access::Read,
            (None, None) if variables.iter().all(|(_, how)| *how == Accessed::Writes) => Access::Write,
            (None, None) => {
                assumed.push(format!("`{name}` is updated in place; `= output` would have it written anew."));
                Access::Update
            }
        }
    }

    /// The extent as declared, otherwise that of an output's texture as far as it can be guessed.
    fn extent(
        &self,
        index: usize,
        ports: &[Port],
        registry: &Registry,
        assumed: &mut Vec<String>,
        wrong: &mut Wrong,
    ) -> Extent {
        let name = &self.name;
        if let Some(clause) = &self.said.extent {
            return self.declared_extent(clause, ports, registry, wrong).unwrap_or(Extent::Any);
        }
        if ports[index].access != Access::Write {
            return Extent::Any;
        }
        if !is_texture(&ports[index]) {
            let forms = "`per pixel`, `like PORT`, `4096 elements` or the like";
            wrong.at(
                self.place,
                format!("`{name}` is an output, but its number of elements is unknown; add {forms}"),
            );
            return Extent::Any;
        }
        // One that is always there; that of the frame before may depend on this output.
        let is_size = |port: &&Port| {
            is_texture(port) && matches!(port.access, Access::Read | Access::Update) && !port.optional
        };
        match ports.iter().find(is_size) {
            Some(size) => {
                assumed.push(format!("`{name}` is as large as `{}`, the first input texture.", size.name));
                Extent::Like(size.name.clone())
            }
            None => {
                assumed.push(format!("`{name}` is as large as the frame."));
                Extent::Frame(1)
            }
        }
    }

    fn declared_extent(
        &self,
        clause: &Spanned<PortClause>,
        ports: &[Port],
        registry: &Registry,
        wrong: &mut Wrong,
    ) -> Option<Extent> {
        let Self { name, fields, .. } = self;
        let extent = match &clause.value {
            PortClause::Extent(extent) => extent.clone(),
            PortClause::Each(one) => {
                let quantities = registry.quantities();
                let Some(quantity) = quantities.iter().find(|quantity| quantity.one == one.value) else {
                    let known = ["pixel", "corner", "request"].into_iter();
                    let known = known.chain(quantities.iter().map(|quantity| quantity.one));
                    wrong.at(one.span, GraphError::unknown("quantity", &one.value, known).to_string());
                    return None;
                };
                quantity.list()
            }
            other => unreachable!("{other:?} is no extent"),
        };
        if let Extent::Like(other) | Extent::BitsOf(other) = &extent
            && !ports.iter().any(|port| port.name == *other)
        {
            let known = ports.iter().map(|port| &port.name);
            wrong.at(clause.span, GraphError::unknown("port", other, known).to_string());
            return None;
        }
        let of_texture = fields.iter().any(|field| !matches!(field.element, Element::Item { .. }));
        let is_list = match &extent {
            Extent::PerPixel(_) | Extent::Requests | Extent::Each(_) | Extent::BitsOf(_) => true,
            Extent::Fixed([_, height]) => *height == 1,
            _ => false,
        };
        if of_texture && is_list {
            wrong.at(
                clause.span,
                format!("`{name}` is a texture, but this is the length of a list; declare it `var<storage, ...> array<T>`"),
            );
        }
        let is_word = |field: &Field| matches!(&field.element, Element::Item { name, .. } if name == "u32");
        if matches!(extent, Extent::BitsOf(_)) && !fields.iter().all(is_word) {
            wrong.at(clause.span, format!("bits are in words; declare `{name}` as array<u32>"));
        }
        Some(extent)
    }
}

fn is_texture(port: &Port) -> bool {
    matches!(port.fields[0].element, Element::Texel(_) | Element::AnyFloatTexel)
}

/// Whether a port's extent is that of another, and so on back to itself.
fn is_circle(start: usize, ports: &[Port], connected: &dyn Fn(&str) -> bool) -> bool {
    let mut at = start;
    for _ in ports {
        let port = &ports[at];
        // A connected input has the extent of its source.
        let (Extent::Like(other) | Extent::BitsOf(other), false) =
            (&port.extent, port.is_input() && connected(&port.name))
        else {
            return false;
        };
        let Some(next) = ports.iter().position(|port| port.name == *other) else { return false };
        at = next;
        if at == start {
            return true;
        }
    }
    false
}
