//! Passes: the entry points of a shader, with what is declared above them.

use naga::ShaderStage;

use super::{
    Wrong,
    grammar::{Declared, Draw, EntryClause, Name},
    ports::Ports,
};
use crate::{
    error::{GraphError, Span, Spanned},
    port::{FieldRef, Port},
    reflect::{Entry, Reflected},
    shader::{Pass, Threads},
};

/// An entry point with what is declared above it.
pub(super) struct EntryPoint {
    pub name: Name,
    pub declared: Declared<EntryClause>,
}

/// The passes of the entry points, in order. Reports every entry point that is part of no pass, and every clause that
/// does not fit. Adds what is assumed to the ports' assumptions.
pub(super) fn passes(
    reflected: &Reflected,
    points: &[EntryPoint],
    ports: &mut Ports,
    connected: &dyn Fn(&str) -> bool,
    wrong: &mut Wrong,
) -> Vec<Pass> {
    let mut assumed = Vec::new();
    let mut reader = Reader { reflected, points, ports, connected, wrong, assumed: &mut assumed };
    let passes = reader.all();
    ports.assumed.append(&mut assumed);
    passes
}

struct Reader<'a, 'w> {
    reflected: &'a Reflected,
    points: &'a [EntryPoint],
    ports: &'a Ports,
    connected: &'a dyn Fn(&str) -> bool,
    wrong: &'a mut Wrong<'w>,
    assumed: &'a mut Vec<String>,
}

impl<'a> Reader<'a, '_> {
    fn all(&mut self) -> Vec<Pass> {
        let mut passes = Vec::new();
        for entry in &self.reflected.entries {
            self.check_used(entry);
            match entry.stage {
                ShaderStage::Compute => passes.extend(self.compute(entry)),
                ShaderStage::Vertex => passes.extend(self.draw(entry)),
                _ => self.fragment(entry),
            }
        }
        if self.reflected.entries.is_empty() {
            self.wrong.at(
                None,
                "it has no entry point; write one, such as `@compute @workgroup_size(8, 8) fn main()`",
            );
        }
        passes
    }

    fn point(&self, entry: &Entry) -> Option<&'a EntryPoint> {
        self.points.iter().find(|point| point.name.value == entry.name)
    }

    fn place(&self, entry: &Entry) -> Option<Span> {
        self.point(entry).map(|point| point.name.span)
    }

    fn clauses(&self, entry: &Entry) -> &'a [Spanned<EntryClause>] {
        self.point(entry).map_or(&[], |point| &point.declared.clauses)
    }

    fn port(&self, field: FieldRef) -> &'a Port {
        &self.ports.ports[field.port as usize]
    }

    /// Whether a port is an input that nothing is connected to.
    fn is_absent(&self, port: &Port) -> bool {
        port.optional && !(self.connected)(&port.name)
    }

    /// Reports the use of inputs that nothing is connected to.
    fn check_used(&mut self, entry: &Entry) {
        for &used in &entry.uses {
            let variable = &self.reflected.variables[used].name;
            let port = self.ports.field(variable).map(|field| self.port(field));
            if let Some(Port { name, .. }) = port.filter(|port| self.is_absent(port)) {
                let (place, define) = (self.place(entry), name.to_uppercase());
                let text = format!(
                    "`{}` uses `{variable}`, but nothing is connected to `{name}`; put that between `#ifdef \
                     HAS_{define}` and `#endif`",
                    entry.name
                );
                self.wrong.at(place, text);
            }
        }
    }

    /// The field that a clause names.
    fn find(&mut self, name: &Name) -> Option<FieldRef> {
        let found = self.ports.find(name).and_then(|field| {
            let port = self.port(field);
            if self.is_absent(port) {
                return Err(format!(
                    "nothing is connected to `{}`; put the entry point between `#ifdef HAS_{}` and `#endif`",
                    port.name,
                    port.name.to_uppercase()
                ));
            }
            Ok(field)
        });
        found.map_err(|message| self.wrong.at(name.span, message)).ok()
    }

    /// The same for a clause that needs one variable: not a bundle as a whole.
    fn find_one(&mut self, name: &Name) -> Option<FieldRef> {
        let field = self.find(name)?;
        if self.ports.field(&name.value).is_none() {
            let first = self.port(field).variable(0);
            self.wrong.at(
                name.span,
                format!("`{}` is a bundle; name one of its fields, such as `{first}`", name.value),
            );
            return None;
        }
        Some(field)
    }

    /// The pass of a compute entry point.
    fn compute(&mut self, entry: &Entry) -> Option<Pass> {
        let name = &entry.name;
        let clauses = self.clauses(entry);
        let is_of_draw = |clause: &&Spanned<EntryClause>| {
            matches!(
                clause.value,
                EntryClause::Draw(_) | EntryClause::Fragment(_) | EntryClause::Depth | EntryClause::Clear(_)
            )
        };
        if let Some(clause) = clauses.iter().find(is_of_draw) {
            self.wrong.at(
                clause.span,
                format!("`{name}` is @compute; a draw is declared above a @vertex entry point"),
            );
            return None;
        }
        if let [_, second, ..] = clauses {
            self.wrong
                .at(second.span, format!("the number of threads of `{name}` is given twice; remove one"));
            return None;
        }
        let threads = match clauses.first() {
            None => self.over_written(entry)?,
            Some(Spanned { value: clause, .. }) => self.threads(clause)?,
        };
        Some(Pass::Compute { entry: name.clone().into(), threads })
    }

    /// One thread for each element of the first port that an entry point writes.
    fn over_written(&mut self, entry: &Entry) -> Option<Threads> {
        let (name, place) = (&entry.name, self.place(entry));
        let written = entry.writes.iter().map(|&index| &self.reflected.variables[index].name);
        let Some(field) = written.filter_map(|variable| self.ports.field(variable)).next() else {
            let text = format!(
                "entry point `{name}` writes no port; give it a texture_storage_2d or a storage buffer to write"
            );
            self.wrong.at(place, text);
            return None;
        };
        let port = &self.port(field).name;
        self.assumed.push(format!(
            "`{name}` has a thread for each element of `{port}`, the first port that it writes."
        ));
        Some(Threads::Over(field))
    }

    fn threads(&mut self, clause: &EntryClause) -> Option<Threads> {
        match clause {
            EntryClause::Over(port) => self.find(port).map(Threads::Over),
            EntryClause::Blocks(size, port) => self.find(port).map(|port| Threads::Blocks(port, *size)),
            EntryClause::Groups(count) => Some(Threads::Groups(*count)),
            EntryClause::GroupsFrom(name) => self.find_one(name).map(Threads::Indirect),
            other => unreachable!("{other:?} is no number of threads"),
        }
    }

    /// The pass of a vertex entry point.
    fn draw(&mut self, entry: &Entry) -> Option<Pass> {
        let (name, place) = (&entry.name, self.place(entry));
        let (mut draw, mut fragment, mut depth, mut clear) = (None, None, None, None);
        for Spanned { value: clause, span } in self.clauses(entry) {
            let again = match clause {
                EntryClause::Draw(clause) => draw.replace((clause, *span)).is_some(),
                EntryClause::Fragment(name) => fragment.replace(name).is_some(),
                EntryClause::Depth => depth.replace(()).is_some(),
                EntryClause::Clear(value) => clear.replace(*value).is_some(),
                _ => {
                    self.wrong.at(
                        *span,
                        format!("`{name}` is @vertex; threads are those of a @compute entry point"),
                    );
                    return None;
                }
            };
            if again {
                self.wrong.at(*span, "this is given twice; remove one");
                return None;
            }
        }
        let Some((Draw { vertices, shape, per, into }, span)) = draw else {
            let text = format!(
                "`{name}` draws nothing yet; add `/// = draw 3 triangle vertices per PORT into TARGET, fragment NAME`"
            );
            self.wrong.at(place, text);
            return None;
        };
        let Some(fragment) = fragment else {
            self.wrong.at(span, "the draw has no fragment entry point; add `fragment NAME`");
            return None;
        };
        let fragments = self.reflected.entries.iter().filter(|entry| entry.stage == ShaderStage::Fragment);
        let mut fragments = fragments.map(|entry| &entry.name);
        if !fragments.clone().any(|name| *name == fragment.value) {
            let error = GraphError::unknown("fragment entry point", &fragment.value, &mut fragments);
            self.wrong.at(fragment.span, error.to_string());
            return None;
        }
        let count = self.find(per)?;
        let targets: Vec<FieldRef> = into.iter().filter_map(|name| self.find_one(name)).collect();
        if targets.len() < into.len() {
            return None;
        }
        Some(Pass::Draw {
            vertex: name.clone().into(),
            fragment: fragment.value.clone().into(),
            shape: *shape,
            vertices: *vertices,
            count,
            targets,
            depth: depth.is_some(),
            clear: clear.unwrap_or(0.0),
        })
    }

    /// Reports declarations of a fragment entry point, which takes none.
    fn fragment(&mut self, entry: &Entry) {
        if let Some(clause) = self.clauses(entry).first() {
            let text =
                format!("`{}` is no @compute or @vertex entry point, so it takes no declaration", entry.name);
            self.wrong.at(clause.span, text);
        }
    }
}

/// Reports fragment entry points that no draw names.
pub(super) fn check_fragments(reflected: &Reflected, points: &[EntryPoint], wrong: &mut Wrong) {
    let clauses = || points.iter().flat_map(|point| &point.declared.clauses);
    for Entry { name, .. } in reflected.entries.iter().filter(|entry| entry.stage == ShaderStage::Fragment) {
        let is_named = |clause: &Spanned<EntryClause>| matches!(&clause.value, EntryClause::Fragment(fragment) if fragment.value == *name);
        if !clauses().any(is_named) {
            let point = points.iter().find(|point| point.name.value == *name);
            let text = format!("no draw uses `{name}`; add `fragment {name}` above its @vertex entry point");
            wrong.at(point.map(|point| point.name.span), text);
        }
    }
}
