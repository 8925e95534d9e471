//! What a WGSL text declares at its top level, with the comments above it and all places. naga's modules keep comments
//! without their places.

use crate::error::{Span, Spanned};

/// The top level of a text.
#[derive(Debug, Default)]
pub(crate) struct Outline<'t> {
    /// The lines of `//!` before everything else.
    pub head: Vec<Line<'t>>,
    /// Variables, structs and functions, in order.
    pub items: Vec<Item<'t>>,
    /// Declarations above anything that takes none.
    pub stray: Vec<Line<'t>>,
}

/// A line of a doc comment, without its marks.
pub(crate) type Line<'t> = Spanned<&'t str>;

#[derive(Debug)]
pub(crate) struct Item<'t> {
    pub kind: ItemKind<'t>,
    pub name: Spanned<&'t str>,
    pub doc: Vec<Line<'t>>,
}

#[derive(Debug)]
pub(crate) enum ItemKind<'t> {
    /// A variable with `@group` and `@binding`; the first word of its type.
    Bound(&'t str),
    /// A function with `@compute`, `@vertex` or `@fragment`.
    Entry,
    /// A struct with its members.
    Struct(Vec<Item<'t>>),
    /// A member of a struct; the first word of its type.
    Member(&'t str),
}

/// Whether a line of a doc comment is a declaration.
pub(crate) fn is_declaration(line: &Line) -> bool {
    line.value.starts_with('=')
}

impl<'t> Outline<'t> {
    /// The place of the name of a bound variable or an entry point.
    pub fn place(&self, name: &str) -> Option<Span> {
        let is_found = |item: &&Item| {
            item.name.value == name && matches!(item.kind, ItemKind::Bound(_) | ItemKind::Entry)
        };
        self.items.iter().find(is_found).map(|item| item.name.span)
    }

    pub fn of(text: &'t str) -> Self {
        let mut reader = Reader { tokens: tokens(text), next: 0, outline: Self::default() };
        reader.items();
        reader.outline
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Word,
    Mark(char),
    /// `///` or `/** */`.
    Doc,
    /// `//!` or `/*! */`.
    Head,
}

#[derive(Clone, Copy, Debug)]
struct Token<'t> {
    kind: Kind,
    text: &'t str,
    start: usize,
}

impl<'t> Token<'t> {
    fn spanned(&self) -> Spanned<&'t str> {
        Spanned { value: self.text, span: Span { start: self.start, end: self.start + self.text.len() } }
    }

    /// The lines of a comment.
    fn lines(&self) -> Vec<Line<'t>> {
        let line = |(start, line): (usize, &'t str)| {
            let inner = line.trim_end().trim_end_matches("*/").trim_end();
            let value = inner.trim_start().trim_start_matches(['/', '*', '!']).trim_start();
            let start = self.start + start + inner.len() - value.len();
            Spanned { value, span: Span { start, end: start + value.len() } }
        };
        let mut start = 0;
        let lines = self.text.split_inclusive('\n').map(|line| {
            start += line.len();
            (start - line.len(), line)
        });
        lines.map(line).collect()
    }
}

/// All tokens but plain comments and the lines of directives.
fn tokens(text: &str) -> Vec<Token<'_>> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let line = || rest.find('\n').unwrap_or(rest.len());
        let (kind, length) = if rest.starts_with("//") {
            let kind = match rest.as_bytes().get(2) {
                Some(b'/') => Some(Kind::Doc),
                Some(b'!') => Some(Kind::Head),
                _ => None,
            };
            (kind, line())
        } else if rest.starts_with("/*") {
            let kind = match rest.as_bytes().get(2) {
                Some(b'*') => Some(Kind::Doc),
                Some(b'!') => Some(Kind::Head),
                _ => None,
            };
            (kind, comment(rest))
        } else if c == '#' {
            (None, line())
        } else if c.is_alphanumeric() || c == '_' {
            let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_'));
            (Some(Kind::Word), end.unwrap_or(rest.len()))
        } else {
            ((!c.is_whitespace()).then_some(Kind::Mark(c)), c.len_utf8())
        };
        if let Some(kind) = kind {
            tokens.push(Token { kind, text: &rest[..length], start: at });
        }
        at += length;
    }
    tokens
}

/// The length of the block comment that a text begins with. They nest.
fn comment(text: &str) -> usize {
    let mut depth = 0;
    let mut at = 0;
    while at < text.len() {
        let rest = &text.as_bytes()[at..];
        if rest.starts_with(b"/*") {
            depth += 1;
            at += 2;
        } else if rest.starts_with(b"*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                break;
            }
        } else {
            at += 1;
        }
    }
    at.min(text.len())
}

/// The first opening brace of a text that no later one closes.
pub(crate) fn unclosed(text: &str) -> Option<Span> {
    let mut open = Vec::new();
    for token in tokens(text) {
        match token.kind {
            Kind::Mark('{') => open.push(token.spanned().span),
            Kind::Mark('}') => drop(open.pop()),
            _ => {}
        }
    }
    open.first().copied()
}

/// The names of all functions, and what is between the braces of their bodies.
pub(crate) fn functions(text: &str) -> Vec<(Span, Span)> {
    let mut reader = Reader { tokens: tokens(text), next: 0, outline: Outline::default() };
    let mut functions = Vec::new();
    while let Some(token) = reader.peek() {
        reader.next += 1;
        if (token.kind, token.text) != (Kind::Word, "fn") {
            continue;
        }
        let Some(name) = reader.take_word() else { continue };
        reader.skip_to(&['{', ';']);
        let start = reader.end();
        reader.skip_block();
        // The closing brace is one byte.
        functions.push((name.span, Span { start, end: (reader.end() - 1).max(start) }));
    }
    functions
}

struct Reader<'t> {
    tokens: Vec<Token<'t>>,
    next: usize,
    outline: Outline<'t>,
}

impl<'t> Reader<'t> {
    fn peek(&self) -> Option<Token<'t>> {
        self.tokens.get(self.next).copied()
    }

    /// The end of the last token that was read.
    fn end(&self) -> usize {
        self.tokens[self.next - 1].spanned().span.end
    }

    fn take_word(&mut self) -> Option<Spanned<&'t str>> {
        let word = self.peek().filter(|token| token.kind == Kind::Word)?;
        self.next += 1;
        Some(word.spanned())
    }

    fn take_mark(&mut self, mark: char) -> bool {
        let found = self.peek().is_some_and(|token| token.kind == Kind::Mark(mark));
        self.next += usize::from(found);
        found
    }

    fn stray(&mut self, doc: Vec<Line<'t>>) {
        self.outline.stray.extend(doc.into_iter().filter(is_declaration));
    }

    fn items(&mut self) {
        while self.peek().is_some_and(|token| token.kind == Kind::Head) {
            let lines = self.tokens[self.next].lines();
            self.outline.head.extend(lines);
            self.next += 1;
        }
        while self.next < self.tokens.len() {
            self.item();
        }
    }

    fn item(&mut self) {
        let (doc, attributes) = self.preamble();
        let Some(token) = self.peek() else { return self.stray(doc) };
        self.next += 1;
        let is = |wanted: &[&str]| attributes.iter().any(|attribute| wanted.contains(attribute));
        match (token.kind, token.text) {
            (Kind::Word, "var") => {
                if self.take_mark('<') {
                    self.skip_to(&['>']);
                }
                let name = self.take_word();
                self.take_mark(':');
                let ty = self.take_word().map_or("", |word| word.value);
                match name {
                    Some(name) if is(&["group", "binding"]) => {
                        self.outline.items.push(Item { kind: ItemKind::Bound(ty), name, doc });
                    }
                    _ => self.stray(doc),
                }
                self.skip_to(&[';']);
            }
            (Kind::Word, "fn") => {
                match self.take_word() {
                    Some(name) if is(&["compute", "vertex", "fragment"]) => {
                        self.outline.items.push(Item { kind: ItemKind::Entry, name, doc });
                    }
                    _ => self.stray(doc),
                }
                self.skip_to(&['{', ';']);
                self.skip_block();
            }
            (Kind::Word, "struct") => {
                self.stray(doc);
                let name = self.take_word();
                self.skip_to(&['{', ';']);
                let members = self.members();
                if let Some(name) = name {
                    let kind = ItemKind::Struct(members);
                    self.outline.items.push(Item { kind, name, doc: Vec::new() });
                }
            }
            (Kind::Word, _) => {
                self.stray(doc);
                self.skip_to(&[';']);
            }
            (Kind::Mark('{'), _) => {
                self.stray(doc);
                self.skip_block();
            }
            _ => self.stray(doc),
        }
    }

    /// The comments and attributes before an item.
    fn preamble(&mut self) -> (Vec<Line<'t>>, Vec<&'t str>) {
        let (mut doc, mut attributes) = (Vec::new(), Vec::new());
        while let Some(token) = self.peek() {
            match token.kind {
                Kind::Doc => doc.extend(token.lines()),
                Kind::Head => self.stray(token.lines()),
                Kind::Mark('@') => {
                    if let Some(name) = self.tokens.get(self.next + 1).filter(|name| name.kind == Kind::Word)
                    {
                        attributes.push(name.text);
                        self.next += 1;
                    }
                    if self.tokens.get(self.next + 1).is_some_and(|token| token.kind == Kind::Mark('(')) {
                        self.next += 2;
                        self.skip_to(&[')']);
                        continue;
                    }
                }
                _ => break,
            }
            self.next += 1;
        }
        (doc, attributes)
    }

    /// Skips to the end of the next of these marks outside of brackets.
    fn skip_to(&mut self, ends: &[char]) {
        let mut depth = 0;
        while let Some(token) = self.peek() {
            self.next += 1;
            match token.kind {
                Kind::Mark(mark) if depth == 0 && ends.contains(&mark) => return,
                Kind::Mark('(' | '[' | '{') => depth += 1,
                Kind::Mark(')' | ']' | '}') => depth = (depth - 1).max(0),
                Kind::Doc | Kind::Head => self.stray(token.lines()),
                _ => {}
            }
        }
    }

    /// Skips the rest of a block whose opening brace has been read.
    fn skip_block(&mut self) {
        self.skip_to(&['}']);
    }

    /// The members of a struct whose opening brace has been read.
    fn members(&mut self) -> Vec<Item<'t>> {
        let mut members = Vec::new();
        loop {
            let (doc, _) = self.preamble();
            match self.take_word() {
                Some(name) if self.take_mark(':') => {
                    let ty = self.peek().filter(|token| token.kind == Kind::Word).map_or("", |ty| ty.text);
                    members.push(Item { kind: ItemKind::Member(ty), name, doc });
                }
                _ => self.stray(doc),
            }
            loop {
                let Some(token) = self.peek() else { return members };
                self.next += 1;
                match token.kind {
                    Kind::Mark('}') => return members,
                    Kind::Mark(',') => break,
                    Kind::Doc | Kind::Head => self.stray(token.lines()),
                    _ => {}
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "//! A blur.
//! = per view
#import frame
/// The numbers.
struct Params {
    /// How far.
    /// = 0.5
    radius: f32,
    @size(16) pad: array<vec2<f32>, 3>, /** Twice.
     * = 3 in 1..16
     */
    times: u32,
}
/// = nothing
const A: u32 = 1u;
@group(0) @binding(1) var<uniform> params: Params;
/// What comes out, \u{fc}ber alles.
/// = output,
///   = kept
@group(0) @binding(2) var<storage, read_write> sums: array<atomic<u32>>;
var<workgroup> tile: array<f32, 64>;
/* /// = hidden /* nested */ */
/// Runs.
@compute @workgroup_size(8, (8))
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x > 3u { return; }
    /// = within
}
fn helper() {}
";

    fn texts<'t>(lines: &[Line<'t>]) -> Vec<&'t str> {
        lines.iter().map(|line| line.value).collect()
    }

    #[test]
    fn the_head_may_be_in_comments_of_both_forms() {
        let outline = Outline::of("//! One.\n/*! Two.\n * Three.\n */\n/* No. */\nconst A: u32 = 1u;\n");
        assert_eq!(texts(&outline.head), ["One.", "Two.", "Three.", ""]);
    }

    #[test]
    fn items_have_their_comments() {
        let outline = Outline::of(TEXT);
        assert_eq!(texts(&outline.head), ["A blur.", "= per view"]);
        let items: Vec<_> = outline.items.iter().map(|item| (item.name.value, texts(&item.doc))).collect();
        assert_eq!(
            items,
            [
                ("Params", vec![]),
                ("params", vec![]),
                ("sums", vec!["What comes out, \u{fc}ber alles.", "= output,", "= kept"]),
                ("main", vec!["Runs."]),
            ]
        );
        let ItemKind::Struct(members) = &outline.items[0].kind else { panic!("a struct") };
        let members: Vec<_> = members.iter().map(|item| (item.name.value, texts(&item.doc))).collect();
        assert_eq!(
            members,
            [
                ("radius", vec!["How far.", "= 0.5"]),
                ("pad", vec![]),
                ("times", vec!["Twice.", "= 3 in 1..16", ""]),
            ]
        );
        assert_eq!(texts(&outline.stray), ["= nothing", "= within"]);
    }

    #[test]
    fn declarations_above_what_takes_none_are_stray() {
        for item in [
            "const A = 1u;",
            "alias T = u32;",
            "override o: u32;",
            "struct S { a: u32 }",
            "var<workgroup> t: array<u32, 4>;",
            "@group(0) var;",
            "fn f() { let a = 1u; }",
            "{ /// = within\n }",
            ";",
            ") ]",
            "",
        ] {
            let text = format!("/// Words.\n/// = nothing\n{item}\n/// = 3\n@compute fn last() {{}}");
            let outline = Outline::of(&text);
            let within = if item.contains("within") { vec!["= within"] } else { vec![] };
            let expected = if item.is_empty() { vec![] } else { [vec!["= nothing"], within].concat() };
            assert_eq!(texts(&outline.stray), expected, "{item}");
            let last = outline.items.last().expect("the function");
            let own = if item.is_empty() { vec!["Words.", "= nothing", "= 3"] } else { vec!["= 3"] };
            assert_eq!((last.name.value, texts(&last.doc)), ("last", own), "{item}");
        }
        assert_eq!(texts(&Outline::of("/// = nothing").stray), ["= nothing"]);
    }

    #[test]
    fn what_stands_within_something_is_no_item() {
        for text in [
            "fn f() { { { } } @group(0) var hidden: u32; }",
            "{ @group(0) var hidden: u32; }",
            "var<private> a: u32 = (@vertex fn hidden);",
            "const A = f(@vertex fn hidden);",
            "/*/ @vertex fn hidden() {} */",
            "/* /* */ @vertex fn hidden() {} */",
            "/* /* *//* */ @vertex fn hidden() {} */",
        ] {
            assert!(Outline::of(text).items.is_empty(), "{text}");
        }
        // Behind a type there may be anything.
        let outline =
            Outline::of("struct S { a: array<u32, max(2, 3)> /** = within */ /// = too\n, b: u32 }");
        let ItemKind::Struct(members) = &outline.items[0].kind else { panic!("a struct") };
        let names: Vec<_> = members.iter().map(|item| item.name.value).collect();
        assert_eq!((names, texts(&outline.stray)), (vec!["a", "b"], vec!["= within", "= too"]));
    }

    #[test]
    fn places_are_those_of_the_text() {
        let outline = Outline::of(TEXT);
        let all = outline.items.iter().flat_map(|item| item.doc.iter().chain([&item.name]));
        for line in all.chain(&outline.head).chain(&outline.stray) {
            assert_eq!(&TEXT[line.span.start..line.span.end], line.value);
        }
    }

    #[test]
    fn functions_have_a_body() {
        let text = "fn a(b: array<f32, 3>) -> f32 { if b { return 1.0; } }\n// fn c() {}\nfn d() {} fn";
        let found: Vec<_> = functions(text).into_iter().map(|(name, body)| [name, body]).collect();
        let texts = found.iter().map(|spans| spans.map(|span| &text[span.start..span.end]));
        assert_eq!(texts.collect::<Vec<_>>(), [["a", " if b { return 1.0; } "], ["d", ""]]);
    }

    #[test]
    fn a_brace_that_is_not_closed_is_found() {
        let at = |text| unclosed(text).map(|span| span.start);
        assert_eq!(at("fn a() { if b { } }\nfn c() {} // {"), None);
        assert_eq!(at("fn a() { if b { }\nfn c() {}"), Some(7));
        assert_eq!(at("} {"), Some(2));
    }

    #[test]
    fn a_cut_text_ends_somewhere() {
        for (end, _) in TEXT.char_indices() {
            Outline::of(&TEXT[..end]);
            Outline::of(&TEXT[end..]);
        }
    }
}
