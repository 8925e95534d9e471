//! `#import` and `#ifdef`, line by line, and the constants from Rust.
//!
//! Declarations in WGSL may come in any order, so importing a module means appending its text to the shader's, once. A
//! file's constants from Rust are put before it. The result is plain WGSL: names stay as written, naga sees every doc
//! comment, and a place in it is a line of one file. (naga_oil was tried. In imported modules it rejects type aliases
//! and struct members that end in a digit, and loses constants without a type; it renames what it imports, and in the
//! importing shader also members of the same name.)
//!
//! `#check PORT[ELEMENT]: CONDITION, "TEXT"` is a line of WGSL only where the run is watched: it notes the least
//! element for which the condition does not hold.

use std::{borrow::Cow, ops::Range};

use super::outline;
use crate::{
    error::{GraphError, Place, Problem, Span},
    shader::{Shader, ShaderLibrary, ShaderModule},
};

/// The name for `#ifdef` that holds where the run is watched.
pub(crate) const WATCH: &str = "WATCH";

/// The variable to which the checks of a watched shader write: for each, the least element that fails, and room for a
/// copy of it.
pub(crate) const CHECKS: &str = "watch_checks";

/// Words of a check in that variable.
pub(crate) const CHECK_WORDS: usize = 64;

/// Its binding; the last one that WebGPU allows by default.
const CHECKS_BINDING: u32 = 999;

/// A `#check` of a shader.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Check {
    /// The variable of the port.
    pub port: String,
    /// What should hold.
    pub text: String,
    /// Its statement in the composed text.
    pub at: Span,
}

/// A shader followed by the modules that it imports, as one WGSL text.
pub(crate) struct Composed {
    pub text: String,
    /// Its checks, if it is composed for a watched run.
    pub checks: Vec<Check>,
    /// The shader's file.
    name: String,
    parts: Vec<Part>,
}

struct Part {
    name: String,
    /// First byte in the text; the part ends where the next one starts.
    start: usize,
}

/// The index of the shader's own part: its constants come first.
const OWN: usize = 1;

impl Composed {
    /// A problem at a range of the text, reported at the file and line that it comes from.
    pub fn error(&self, at: Span, message: &str) -> GraphError {
        let index = self.parts.partition_point(|part| part.start <= at.start).saturating_sub(1);
        let Part { name, start } = &self.parts[index];
        let local = Span { start: at.start - start, end: at.end.saturating_sub(*start) };
        // A part ends with the end of a line, and a problem is shown with one line.
        error_in(name, &self.text[*start..], local, message)
    }

    /// The shader's own part of the text, in which each line has its number in the file.
    pub fn own(&self) -> &str {
        &self.text[self.own_range()]
    }

    /// Whether a range of the text is in the shader's own part.
    pub fn is_own(&self, at: Span) -> bool {
        self.own_range().contains(&at.start)
    }

    fn own_range(&self) -> Range<usize> {
        self.parts[OWN].start..self.parts.get(OWN + 1).map_or(self.text.len(), |next| next.start)
    }

    /// A problem at a range of the shader's own part.
    pub fn own_error(&self, at: Span, message: &str) -> GraphError {
        error_in(&self.name, self.own(), at, message)
    }

    /// The problem of the first file with a brace that is not closed. What is read after it, perhaps in the next file,
    /// makes no sense to naga.
    pub fn unclosed(&self) -> Option<GraphError> {
        self.parts.iter().enumerate().find_map(|(index, part)| {
            let end = self.parts.get(index + 1).map_or(self.text.len(), |next| next.start);
            let text = &self.text[part.start..end];
            let message = "this `{` is never closed; add the `}` that is missing after it";
            Some(error_in(&part.name, text, outline::unclosed(text)?, message))
        })
    }

    /// A problem of the whole shader.
    pub fn error_anywhere(&self, message: &str) -> GraphError {
        let (shader, message) = (self.name.clone(), message.to_owned());
        GraphError::Shader { shader, message, place: None }
    }
}

/// A problem of a shader at its line in the file that it stands in: the shader's own, or that of a module that an editor
/// has a text of. The error itself where there is no such file.
pub(crate) fn at_its_line(
    error: GraphError,
    shader: &Shader,
    library: &ShaderLibrary,
) -> Result<Problem, GraphError> {
    let GraphError::Shader { shader: name, message, place: Some(place) } = error else { return Err(error) };
    let file = if place.file == shader.name {
        shader.file.as_ref()
    } else {
        let module = library.modules.iter().find(|module| place.file == module.name);
        module.and_then(|module| module.file.as_ref()).filter(|file| library.edited.get(file).is_some())
    };
    let Some(file) = file else {
        return Err(GraphError::Shader { shader: name, message, place: Some(place) });
    };
    let place = Place { file: file.display().to_string(), ..*place };
    Ok(Problem::new(GraphError::Shader { shader: name, message, place: None }).at(place))
}

/// Whether an editor has another text of the shader, or of a module that it imports, than the program has embedded.
pub(crate) fn is_edited(shader: &Shader, library: &ShaderLibrary) -> bool {
    let mut texts = vec![library.edited.or_embedded(shader.file.as_deref(), &shader.source)];
    let mut seen: Vec<&str> = Vec::new();
    while let Some(text) = texts.pop() {
        if matches!(text, Cow::Owned(_)) {
            return true;
        }
        for module in imports(&text).filter_map(|import| library.module(import)) {
            if !seen.contains(&module.import()) {
                seen.push(module.import());
                texts.push(library.edited.or_embedded(module.file.as_deref(), &module.source));
            }
        }
    }
    false
}

/// The names after `#import` in a shader or module, whether their lines are kept or not.
pub fn imports(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter_map(directive).filter_map(|words| match words[..] {
        ["import", module] => Some(module),
        _ => None,
    })
}

/// The names after `#ifdef` and `#ifndef` in a shader, and their places.
pub(crate) fn conditions(text: &str) -> impl Iterator<Item = (&str, Span)> {
    let mut next = 0;
    text.split_inclusive('\n').filter_map(move |line| {
        let start = next;
        next += line.len();
        let words = directive(line)?;
        let ["ifdef" | "ifndef", define] = words[..] else { return None };
        let start = start + line.find(define)?;
        Some((define, Span { start, end: start + define.len() }))
    })
}

/// The words of a directive, without the `#`; none for a line of WGSL.
fn directive(line: &str) -> Option<Vec<&str>> {
    let directive = line.trim_start().strip_prefix('#')?;
    Some(directive.split("//").next().unwrap_or_default().split_whitespace().collect())
}

/// A problem of a shader at a place in its own text.
pub(crate) fn error_in(name: &str, source: &str, at: Span, message: &str) -> GraphError {
    let place = Some(Box::new(Place::of(name, source, at)));
    GraphError::Shader { shader: name.to_owned(), message: message.to_owned(), place }
}

/// A shader for a watched run.
pub(crate) fn watched(shader: &Shader) -> Shader {
    let mut shader = shader.clone();
    shader.defines.push(WATCH.into());
    shader
}

/// Whether the text of a shader, or of a module that it imports, has checks or lines for watched runs only.
pub(crate) fn has_checks(shader: &Shader, library: &ShaderLibrary) -> Result<bool, GraphError> {
    Ok(compose(&watched(shader), library)?.text != compose(shader, library)?.text)
}

/// Composes a shader: `#import NAME` includes the library's module of that name, `#ifdef NAME`, `#ifndef NAME`, `#else`
/// and `#endif` keep or drop lines depending on the shader's defines. Directives are on lines of their own, which are
/// blank in the result, so that line numbers stay the same. Constants from Rust precede the file that uses them and
/// count as a file of their own.
pub(crate) fn compose(shader: &Shader, library: &ShaderLibrary) -> Result<Composed, GraphError> {
    let mut composed = Composed {
        text: String::new(),
        checks: Vec::new(),
        name: shader.name.to_string(),
        parts: Vec::new(),
    };
    let mut imports: Vec<String> = Vec::new();
    let mut next = 0;
    let (mut name, mut source, mut file) = (&*shader.name, &*shader.source, shader.file.as_deref());
    let mut constants = &shader.constants[..];
    loop {
        composed.parts.push(Part { name: format!("constants of {name}"), start: composed.text.len() });
        constants.iter().for_each(|constant| constant.declare(&mut composed.text));
        composed.parts.push(Part { name: name.to_owned(), start: composed.text.len() });
        let text = library.edited.or_embedded(file, source);
        preprocess(name, &text, shader, library, &mut imports, &mut composed)?;
        let Some(module) = imports.get(next).and_then(|import| library.module(import)) else {
            if !composed.checks.is_empty() {
                composed.parts.push(Part { name: "checks".into(), start: composed.text.len() });
                composed.text += &format!(
                    "@group(0) @binding({CHECKS_BINDING}) var<storage, read_write> {CHECKS}: array<atomic<u32>>;\n"
                );
            }
            return Ok(composed);
        };
        next += 1;
        (name, source, file) = (&*module.name, &*module.source, module.file.as_deref());
        constants = &module.constants;
    }
}

/// The check in a line: its port, its text, and the statement that it becomes as the check of this index.
fn check(line: &str, index: usize) -> Result<[String; 3], &'static str> {
    const FORM: &str = "a check is `#check PORT[ELEMENT]: CONDITION, \"TEXT\"`";
    let parse = || {
        let (port, rest) = line.trim().strip_prefix("#check")?.split_once('[')?;
        let mut depth = 1;
        let close = rest.find(|letter| {
            depth += i32::from(letter == '[') - i32::from(letter == ']');
            depth == 0
        })?;
        let (element, condition) = (&rest[..close], rest[close + 1..].trim_start().strip_prefix(':')?);
        let (condition, text) = condition.strip_suffix('"')?.rsplit_once('"')?;
        let (port, condition) = (port.trim(), condition.trim_end().strip_suffix(',')?.trim());
        let complete = [port, element.trim(), condition, text].iter().all(|part| !part.is_empty());
        let place = index * CHECK_WORDS;
        let statement = format!("if !({condition}) {{ atomicMin(&{CHECKS}[{place}], u32({element})); }}");
        complete.then_some([port.to_owned(), text.to_owned(), statement])
    };
    parse().ok_or(FORM)
}

/// An open `#ifdef`.
struct Condition {
    /// Whether the surrounding lines are kept.
    outer: bool,
    holds: bool,
    in_else: bool,
    at: Span,
}

fn preprocess(
    name: &str,
    source: &str,
    shader: &Shader,
    library: &ShaderLibrary,
    imports: &mut Vec<String>,
    composed: &mut Composed,
) -> Result<(), GraphError> {
    let Composed { text: out, checks, .. } = composed;
    let mut conditions: Vec<Condition> = Vec::new();
    let mut start = 0;
    for line in source.split_inclusive('\n') {
        let indent = line.len() - line.trim_start().len();
        let at = Span { start: start + indent, end: start + line.trim_end().len() };
        start += line.len();
        let fail = |message: &str| error_in(name, source, at, message);
        let keep = conditions.last().is_none_or(|condition| condition.outer && condition.holds);

        let Some(directive) = directive(line) else {
            if keep {
                out.push_str(line.trim_end_matches(['\r', '\n']));
            }
            out.push('\n');
            continue;
        };
        if directive[..].first() == Some(&"check") {
            let [port, text, statement] = check(line, checks.len()).map_err(fail)?;
            if keep && shader.defines.iter().any(|known| known == WATCH) {
                let at = Span { start: out.len(), end: out.len() + statement.len() };
                out.push_str(&statement);
                checks.push(Check { port, text, at });
            }
            out.push('\n');
            continue;
        }
        out.push('\n');
        match directive[..] {
            ["import", module] if keep => {
                if library.module(module).is_none() {
                    let known = library.modules.iter().map(ShaderModule::import);
                    return Err(fail(&GraphError::unknown("module", module, known).to_string()));
                }
                if !imports.iter().any(|known| known == module) {
                    imports.push(module.to_owned());
                }
            }
            ["import", _] => {}
            [word @ ("ifdef" | "ifndef"), define] => {
                let holds = shader.defines.iter().any(|known| known == define) == (word == "ifdef");
                conditions.push(Condition { outer: keep, holds, in_else: false, at });
            }
            ["else"] => match conditions.last_mut() {
                Some(condition) if !condition.in_else => {
                    condition.holds = !condition.holds;
                    condition.in_else = true;
                }
                _ => return Err(fail("`#else` without an `#ifdef` or `#ifndef` before it")),
            },
            ["endif"] => {
                if conditions.pop().is_none() {
                    return Err(fail("`#endif` without an `#ifdef` or `#ifndef` before it"));
                }
            }
            _ => {
                return Err(fail(
                    "unknown directive; known: `#import MODULE`, `#ifdef NAME`, `#ifndef NAME`, `#else`, `#endif` and \
                     `#check PORT[ELEMENT]: CONDITION, \"TEXT\"`",
                ));
            }
        }
    }
    match conditions.last() {
        Some(open) => Err(error_in(name, source, open.at, "missing `#endif`")),
        None => Ok(()),
    }
}
