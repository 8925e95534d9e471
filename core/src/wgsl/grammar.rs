//! The declarations in a shader's comments: the lines of a doc comment that begin with `=`. Each is a list of clauses.
//!
//! The tables below are the whole grammar. Parser, messages and documentation follow from them: a form's text is both what
//! is matched and what is printed. In a text, words of small letters stand for themselves, `a/b` for either, `[...]` for
//! what may be left out, and the names in [`Hole::NAMED`] for what the author fills in.

use crate::{
    error::{GraphError, Span, Spanned},
    port::{Extent, Format},
    reflect::outline::{Line, is_declaration},
    shader::Shape,
};

/// A name of a port, an entry point or a choice.
pub(super) type Name = Spanned<String>;

/// One form of a clause.
pub(super) struct Form<C> {
    /// How it is written.
    pub text: &'static str,
    /// What it means, one sentence.
    pub doc: &'static str,
    make: fn(&Filled) -> C,
}

const fn form<C>(text: &'static str, doc: &'static str, make: fn(&Filled) -> C) -> Form<C> {
    Form { text, doc, make }
}

/// A clause above a bound variable.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum PortClause {
    Output,
    LastFrame,
    Optional,
    Scratch,
    Kept,
    FieldOf(Name),
    Means(Name),
    In(f64, f64),
    AnyValue,
    Format(Format),
    Extent(Extent),
    /// A list with one element for each item of the quantity with this singular.
    Each(Name),
}

/// A clause above a member of the struct of `params`.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum ParamClause {
    Value { default: Name, range: Option<(f64, f64)>, unit: String },
    Choice { default: Name, choices: Vec<Name> },
}

/// A clause above an entry point.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum EntryClause {
    Over(Name),
    Blocks(u32, Name),
    Groups(u32),
    GroupsFrom(Name),
    Draw(Draw),
    Fragment(Name),
    Depth,
    Clear(f64),
}

/// What a vertex entry point draws.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Draw {
    pub vertices: u32,
    pub shape: Shape,
    pub per: Name,
    pub into: Vec<Name>,
}

/// A clause at the top of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum FileClause {
    PerView,
    Column(Name),
}

/// Something that takes declarations.
pub(super) trait Subject: Sized + 'static {
    /// In words.
    const WHAT: &'static str;
    /// Where its declarations are written.
    const WHERE: &'static str;
    const FORMS: &'static [Form<Self>];
}

impl Subject for PortClause {
    const WHAT: &'static str = "a port";
    const WHERE: &'static str = "above a variable with @group and @binding, in a line `/// = ...`";
    const FORMS: &'static [Form<Self>] = &[
        form("output", "Written anew in each frame.", |_| Self::Output),
        form("scratch", "An output that makes sense only to this stage.", |_| Self::Scratch),
        form("kept", "An output that keeps its contents from frame to frame; zero at the start.", |_| {
            Self::Kept
        }),
        form("last frame", "An input with the value of the frame before; zero in the first frame.", |_| {
            Self::LastFrame
        }),
        form("optional", "An input that may stay unconnected; `#ifdef HAS_PORT` keeps what uses it.", |_| {
            Self::Optional
        }),
        form("field of PORT", "The variable `PORT_x` is the field `x` of the bundle PORT.", |filled| {
            Self::FieldOf(filled.name(0))
        }),
        form("means MEANING", "What the values mean: the meaning of a port of another stage.", |filled| {
            Self::Means(filled.name(0))
        }),
        form("in LOW..HIGH", "What its numbers may be: checked with `--watch`.", |filled| {
            Self::In(filled.number(0), filled.number(1))
        }),
        form("any value", "Its floats may also be infinite or NaN: for `--watch`.", |_| Self::AnyValue),
        form(
            "format FORMAT",
            "Of an output that is a texture_2d: a draw writes it, later passes read it.",
            |filled| Self::Format(filled.format(0)),
        ),
        form("per pixel", "One element for each pixel of the frame.", |_| Self::Extent(Extent::Frame(1))),
        form("per NxN pixels", "One element for each square of NxN pixels.", |filled| {
            Self::Extent(Extent::Frame(filled.whole(0)))
        }),
        form("per corner", "One for each corner of a pixel: one more than the frame on each axis.", |_| {
            Self::Extent(Extent::Corners)
        }),
        form("per request", "A list with one element for each sample that a frame may request.", |_| {
            Self::Extent(Extent::Requests)
        }),
        form(
            "per QUANTITY",
            "A list with one element for each item of a quantity, such as `edge`.",
            |filled| Self::Each(filled.name(0)),
        ),
        form("SHARE per pixel", "A list with this many elements for each pixel, rounded up.", |filled| {
            Self::Extent(Extent::PerPixel(filled.number(0) as f32))
        }),
        form("like PORT", "As many elements as another port of this shader.", |filled| {
            Self::Extent(Extent::Like(filled.name(0).value.into()))
        }),
        form(
            "bit per element of PORT",
            "A list of u32 with one bit for each element of another port.",
            |filled| Self::Extent(Extent::BitsOf(filled.name(0).value.into())),
        ),
        form("COUNT elements/element", "A list of this length.", |filled| {
            Self::Extent(Extent::Fixed([filled.whole(0), 1]))
        }),
        form("WxH", "This width and height.", |filled| Self::Extent(Extent::Fixed(filled.size(0)))),
    ];
}

impl Subject for ParamClause {
    const WHAT: &'static str = "a parameter";
    const WHERE: &'static str = "above a member of the struct of `params`, in a line `/// = ...`";
    const FORMS: &'static [Form<Self>] = &[
        form(
            "DEFAULT [in LOW..HIGH] [unit UNIT]",
            "The default, the range and the unit; `true` or `false` make a u32 a yes or no.",
            |filled| Self::Value {
                default: filled.name(0),
                range: filled.has("LOW").then(|| (filled.number(1), filled.number(2))),
                unit: if filled.has("UNIT") { filled.last().value } else { String::new() },
            },
        ),
        form("DEFAULT of CHOICES", "A u32 that is set by one of these names.", |filled| Self::Choice {
            default: filled.name(0),
            choices: filled.names(1),
        }),
    ];
}

impl Subject for EntryClause {
    const WHAT: &'static str = "an entry point";
    const WHERE: &'static str = "above an entry point, in a line `/// = ...`";
    const FORMS: &'static [Form<Self>] = &[
        form("over PORT", "One thread for each element of a port.", |filled| Self::Over(filled.name(0))),
        form(
            "one per COUNT of PORT",
            "One thread for each COUNT elements of a port, rounded up.",
            |filled| Self::Blocks(filled.whole(0), filled.name(1)),
        ),
        form("COUNT groups/group", "This many workgroups.", |filled| Self::Groups(filled.whole(0))),
        form(
            "groups from PORT",
            "As many workgroups along x, y and z as the first three u32 of a buffer say.",
            |filled| Self::GroupsFrom(filled.name(0)),
        ),
        form(
            "draw COUNT SHAPE vertices/vertex per PORT into TARGETS",
            "A vertex entry point: draws points, lines or triangles of this many vertices for each element of a port.",
            |filled| {
                Self::Draw(Draw {
                    vertices: filled.whole(0),
                    shape: filled.shape(1),
                    per: filled.name(2),
                    into: filled.names(3),
                })
            },
        ),
        form("fragment NAME", "The fragment entry point of the draw.", |filled| {
            Self::Fragment(filled.name(0))
        }),
        form("depth", "At each pixel, the fragment of least depth stays.", |_| Self::Depth),
        form("clear NUMBER", "What the targets of the draw are cleared to; 0 if not given.", |filled| {
            Self::Clear(filled.number(0))
        }),
    ];
}

impl Subject for FileClause {
    const WHAT: &'static str = "the file";
    const WHERE: &'static str = "at the top of the file, in a line `//! = ...`";
    const FORMS: &'static [Form<Self>] = &[
        form("per view", "Runs only when its inputs or the view have changed.", |_| Self::PerView),
        form("column NAME", "The column of the table of times that it counts towards.", |filled| {
            Self::Column(filled.name(0))
        }),
    ];
}

/// What an author fills in.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hole {
    /// An identifier.
    Name,
    /// Identifiers with commas between them.
    Names,
    /// Identifiers with `and` between them.
    Targets,
    /// `point`, `line` or `triangle`.
    Shape,
    /// The name of a texel format.
    Format,
    /// One word.
    Word,
    /// The rest of the clause.
    Rest,
    /// The same, unless it starts with a number.
    Words,
    /// A finite number.
    Number,
    /// A number above zero.
    Share,
    /// A whole number from 1.
    Count,
    /// Two whole numbers from 1.
    Size,
    /// The same number twice.
    Square,
}

impl Hole {
    const NAMED: &'static [(&'static str, Self, &'static str)] = &[
        ("PORT", Self::Name, "the name of a port"),
        ("NAME", Self::Name, "a name"),
        ("CHOICES", Self::Names, "names with commas between them"),
        ("TARGETS", Self::Targets, "names of textures with `and` between them"),
        ("SHAPE", Self::Shape, "`point`, `line` or `triangle`"),
        ("FORMAT", Self::Format, "r32float, r32uint, rgba8unorm, rgba16float or rgba32float"),
        ("DEFAULT", Self::Word, "a value"),
        ("UNIT", Self::Rest, "a unit"),
        ("MEANING", Self::Rest, "a meaning"),
        ("QUANTITY", Self::Words, "a quantity"),
        ("NUMBER", Self::Number, "a number"),
        ("LOW", Self::Number, "a number"),
        ("HIGH", Self::Number, "a number"),
        ("SHARE", Self::Share, "a number above 0"),
        ("COUNT", Self::Count, "a whole number from 1 to 4294967295"),
        ("WxH", Self::Size, "a width and a height such as 16x16 with fewer than 2^32 elements"),
        ("NxN", Self::Square, "a square such as 8x8"),
    ];

    fn is_number(self) -> bool {
        matches!(self, Self::Number | Self::Share | Self::Count | Self::Size | Self::Square)
    }
}

/// A token of a declaration or of a form's text: a word, a comma, two dots or a bracket.
type Token<'t> = Spanned<&'t str>;

/// The tokens of a text whose first byte is at `start`.
fn tokens(text: &str, start: usize) -> Vec<Token<'_>> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let rest = &text[at..];
        let length = match rest.chars().next().expect("not at the end") {
            c if c.is_whitespace() => {
                at += c.len_utf8();
                continue;
            }
            ',' | '[' | ']' => 1,
            _ if rest.starts_with("..") => 2,
            _ => {
                let ends = rest.find(|c: char| c.is_whitespace() || ",[]".contains(c)).unwrap_or(rest.len());
                rest[..ends].find("..").unwrap_or(ends)
            }
        };
        let span = Span { start: start + at, end: start + at + length };
        tokens.push(Spanned { value: &rest[..length], span });
        at += length;
    }
    tokens
}

/// A declaration as written.
struct Given<'t> {
    line: &'t Line<'t>,
    tokens: Vec<Token<'t>>,
}

impl<'t> Given<'t> {
    /// The declaration in a line that starts with `=`.
    fn of(line: &'t Line<'t>) -> Self {
        Self { line, tokens: tokens(&line.value[1..], line.span.start + 1) }
    }

    fn get(&self, index: usize) -> Option<&Token<'t>> {
        self.tokens.get(index)
    }

    /// The place of the next comma, or the end.
    fn end_of_clause(&self, from: usize) -> usize {
        let words = self.tokens.iter().skip(from).take_while(|token| token.value != ",");
        from + words.count()
    }

    /// The text of some tokens, at least one.
    fn text_of(&self, from: usize, to: usize) -> &'t str {
        let base = self.line.span.start;
        &self.line.value[self.tokens[from].span.start - base..self.tokens[to - 1].span.end - base]
    }
}

/// What was filled into a form.
struct Filled {
    holes: Vec<(&'static str, Value, Span)>,
    /// Whether any of the form's own words was there.
    has_literal: bool,
}

#[derive(Clone, Debug)]
enum Value {
    Text(String),
    Names(Vec<Name>),
    Number(f64),
    Whole(u32),
    Size([u32; 2]),
    Shape(Shape),
    Format(Format),
}

/// The holes of a form are known where its clause is made, so each access names one that is there.
impl Filled {
    fn has(&self, name: &str) -> bool {
        self.holes.iter().any(|(hole, ..)| *hole == name)
    }

    fn name(&self, index: usize) -> Name {
        match &self.holes[index] {
            (_, Value::Text(text), span) => Spanned { value: text.clone(), span: *span },
            other => unreachable!("{other:?} is no text"),
        }
    }

    fn last(&self) -> Name {
        self.name(self.holes.len() - 1)
    }

    fn names(&self, index: usize) -> Vec<Name> {
        match &self.holes[index].1 {
            Value::Names(names) => names.clone(),
            other => unreachable!("{other:?} is no list"),
        }
    }

    fn shape(&self, index: usize) -> Shape {
        match self.holes[index].1 {
            Value::Shape(shape) => shape,
            ref other => unreachable!("{other:?} is no shape"),
        }
    }

    fn format(&self, index: usize) -> Format {
        match self.holes[index].1 {
            Value::Format(format) => format,
            ref other => unreachable!("{other:?} is no format"),
        }
    }

    fn number(&self, index: usize) -> f64 {
        match self.holes[index].1 {
            Value::Number(number) => number,
            ref other => unreachable!("{other:?} is no number"),
        }
    }

    fn whole(&self, index: usize) -> u32 {
        match self.holes[index].1 {
            Value::Whole(number) => number,
            ref other => unreachable!("{other:?} is not whole"),
        }
    }

    fn size(&self, index: usize) -> [u32; 2] {
        match self.holes[index].1 {
            Value::Size(size) => size,
            ref other => unreachable!("{other:?} is no size"),
        }
    }
}

/// Where the tokens cease to fit a form, and what would fit there.
struct Miss {
    at: usize,
    expected: Expected,
    /// Whether everything but a number's value fits.
    close: bool,
}

enum Expected {
    /// One of these words.
    Words(Vec<&'static str>),
    /// Something of this kind.
    Thing(&'static str),
    End,
}

/// Matches the tokens from `start` on with a form. Returns what was filled in and the place after the clause.
fn fit(text: &'static str, given: &Given, start: usize) -> Result<(Filled, usize), Miss> {
    let mut filled = Filled { holes: Vec::new(), has_literal: false };
    let mut wrong_number = None;
    let end = fill_all(text, given, start, &mut filled, &mut wrong_number);
    match (end, wrong_number) {
        (end, None) => Ok((filled, end?)),
        (end, Some(miss)) => Err(Miss { close: end.is_ok(), ..miss }),
    }
}

/// As [`fit`]. The first number of a wrong value goes to `wrong_number`, and matching goes on.
fn fill_all(
    text: &'static str,
    given: &Given,
    mut next: usize,
    filled: &mut Filled,
    wrong_number: &mut Option<Miss>,
) -> Result<usize, Miss> {
    let pieces = tokens(text, 0);
    let mut index = 0;
    while let Some(piece) = pieces.get(index) {
        index += 1;
        let found = given.get(next).map(|token| token.value);
        let named = Hole::NAMED.iter().find(|(name, ..)| *name == piece.value);
        if let Some(&(name, hole, what)) = named {
            match fill(hole, given, next) {
                Some((value, end)) => {
                    let span =
                        Span { start: given.tokens[next].span.start, end: given.tokens[end - 1].span.end };
                    filled.holes.push((name, value, span));
                    next = end;
                }
                None => {
                    let miss = Miss { at: next, expected: Expected::Thing(what), close: false };
                    if !(hole.is_number() && found.is_some_and(starts_a_number)) {
                        return Err(miss);
                    }
                    wrong_number.get_or_insert(miss);
                    next += 1;
                }
            }
        } else if piece.value == "[" {
            if found != pieces.get(index).map(|first| first.value) {
                index += pieces[index..].iter().take_while(|piece| piece.value != "]").count() + 1;
            }
        } else if piece.value != "]" {
            if !found.is_some_and(|found| piece.value.split('/').any(|word| word == found)) {
                let expected = Expected::Words(piece.value.split('/').collect());
                return Err(Miss { at: next, expected, close: false });
            }
            filled.has_literal = true;
            next += 1;
        }
    }
    if given.end_of_clause(next) != next {
        return Err(Miss { at: next, expected: Expected::End, close: false });
    }
    Ok(next)
}

/// Reads what fills a hole; also the place after it.
fn fill(hole: Hole, given: &Given, next: usize) -> Option<(Value, usize)> {
    let word = given.get(next).map(|token| token.value).filter(|word| ![",", ".."].contains(word))?;
    let one = |value: Option<Value>| Some((value?, next + 1));
    let named = |token: &Token| {
        is_name(token.value).then(|| Spanned { value: token.value.to_owned(), span: token.span })
    };
    let is_end = |at: usize| given.end_of_clause(at) == at;
    match hole {
        Hole::Name => one(is_name(word).then(|| Value::Text(word.to_owned()))),
        Hole::Word => one(Some(Value::Text(word.to_owned()))),
        Hole::Words if starts_a_number(word) => None,
        Hole::Rest | Hole::Words => {
            let end = given.end_of_clause(next);
            Some((Value::Text(given.text_of(next, end).to_owned()), end))
        }
        Hole::Names => {
            let mut names = Vec::new();
            let mut end = next;
            // A name that is followed by another word begins another clause.
            while let Some(name) = given.get(end).and_then(named).filter(|_| is_end(end + 1)) {
                names.push(name);
                end += 2;
            }
            (!names.is_empty()).then_some((Value::Names(names), end - 1))
        }
        Hole::Targets => {
            let mut names = vec![named(given.get(next)?)?];
            let mut end = next + 1;
            while given.get(end).is_some_and(|token| token.value == "and")
                && let Some(name) = given.get(end + 1).and_then(named)
            {
                names.push(name);
                end += 2;
            }
            Some((Value::Names(names), end))
        }
        Hole::Shape => one(shape(word).map(Value::Shape)),
        Hole::Format => one(Format::ALL.into_iter().find(|format| format.wgsl() == word).map(Value::Format)),
        Hole::Number => one(number(word).map(Value::Number)),
        Hole::Share => {
            let is_share = |share: &f64| *share as f32 > 0.0 && (*share as f32).is_finite();
            one(number(word).filter(is_share).map(Value::Number))
        }
        Hole::Count => one(whole(word).map(Value::Whole)),
        Hole::Size => one(size(word).map(Value::Size)),
        Hole::Square => one(size(word).filter(|[w, h]| w == h).map(|[side, _]| Value::Whole(side))),
    }
}

/// Whether a word is an identifier.
pub(super) fn is_name(word: &str) -> bool {
    let mut letters = word.chars();
    letters.next().is_some_and(|c| c.is_alphabetic() || c == '_')
        && letters.all(|c| c.is_alphanumeric() || c == '_')
}

fn shape(word: &str) -> Option<Shape> {
    match word {
        "point" => Some(Shape::Points),
        "line" => Some(Shape::Lines),
        "triangle" => Some(Shape::Triangles),
        _ => None,
    }
}

fn starts_a_number(word: &str) -> bool {
    word.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
}

fn number(word: &str) -> Option<f64> {
    word.parse().ok().filter(|number: &f64| number.is_finite())
}

fn whole(word: &str) -> Option<u32> {
    word.parse().ok().filter(|&number| number > 0)
}

/// A width and height whose product is below 2^32.
fn size(word: &str) -> Option<[u32; 2]> {
    let (width, height) = word.split_once('x')?;
    let (width, height) = (whole(width)?, whole(height)?);
    width.checked_mul(height).map(|_| [width, height])
}

/// What is declared above one thing: the prose of its comment, and the clauses of all of its declarations.
pub(super) struct Declared<C> {
    pub prose: String,
    pub clauses: Vec<Spanned<C>>,
}

impl<C: Subject> Declared<C> {
    /// Reads a comment. Calls `wrong` for each clause that fits no form.
    pub fn read(doc: &[Line], wrong: &mut dyn FnMut(Span, String)) -> Self {
        let (lines, prose): (Vec<&Line>, Vec<&Line>) = doc.iter().partition(|line| is_declaration(line));
        let prose: Vec<&str> = prose.iter().map(|line| line.value).collect();
        let mut clauses = Vec::new();
        for line in lines {
            let given = Given::of(line);
            let end = Span { start: line.span.end, end: line.span.end };
            let mut next = 0;
            loop {
                match clause(&given, next) {
                    Ok((clause, end)) => {
                        clauses.push(clause);
                        next = end;
                    }
                    Err((at, message)) => {
                        wrong(given.get(at).map_or(end, |token| token.span), message);
                        next = given.end_of_clause(at);
                    }
                }
                if next >= given.tokens.len() {
                    break;
                }
                // Over the comma.
                next += 1;
            }
        }
        Self { prose: prose.join(" ").trim().to_owned(), clauses }
    }
}

/// The clause that begins at `start`, and the place after it; else the place of what is wrong, and a message.
fn clause<C: Subject>(given: &Given, start: usize) -> Result<(Spanned<C>, usize), (usize, String)> {
    let mut misses: Vec<Miss> = Vec::new();
    for form in C::FORMS {
        match fit(form.text, given, start) {
            Ok((filled, end)) => {
                let span =
                    Span { start: given.tokens[start].span.start, end: given.tokens[end - 1].span.end };
                return Ok((Spanned { value: (form.make)(&filled), span }, end));
            }
            Err(miss) => misses.push(miss),
        }
    }
    if let Some(place) = elsewhere(given, start) {
        let clause = given.text_of(start, given.end_of_clause(start));
        return Err((start, format!("`{clause}` belongs {place}")));
    }
    // A number of a wrong value says more than a form that ends elsewhere.
    let close = misses.iter().any(|miss| miss.close);
    misses.retain(|miss| miss.close == close);
    let at = misses.iter().map(|miss| miss.at).max().unwrap_or(start);
    misses.retain(|miss| miss.at == at);

    let found = given.get(at).map_or("the end of the line".into(), |token| format!("`{}`", token.value));
    let words = || {
        let words = misses.iter().filter_map(|miss| match &miss.expected {
            Expected::Words(words) => Some(words),
            _ => None,
        });
        words.flatten().copied()
    };
    let nearest = given.get(at).and_then(|token| GraphError::unknown("word", token.value, words()).nearest());
    let hint = nearest.map_or(String::new(), |word| format!("did you mean `{word}`?"));
    if at > start || close {
        let things = misses.iter().filter_map(|miss| match miss.expected {
            Expected::Thing(what) => Some(what.to_owned()),
            Expected::End => Some("a comma or the end of the line".to_owned()),
            Expected::Words(_) => None,
        });
        let expected: Vec<String> = words().map(|word| format!("`{word}`")).chain(things).collect();
        let after =
            if at > start { format!(" after `{}`", given.tokens[at - 1].value) } else { String::new() };
        let hint = if hint.is_empty() { hint } else { format!("; {hint}") };
        return Err((at, format!("expected {}{after}, found {found}{hint}", expected.join(" or "))));
    }
    if hint.is_empty() {
        let forms: Vec<String> = C::FORMS.iter().map(|form| format!("`{}`", form.text)).collect();
        return Err((at, format!("unknown clause: {found}; {} takes {}", C::WHAT, forms.join(", "))));
    }
    Err((at, format!("unknown clause {found}, {hint}")))
}

/// Where a clause belongs, if it is one of another subject.
fn elsewhere(given: &Given, start: usize) -> Option<&'static str> {
    fn fits<C: Subject>(given: &Given, start: usize) -> Option<&'static str> {
        let fits = |form: &Form<C>| fit(form.text, given, start).is_ok_and(|(filled, _)| filled.has_literal);
        C::FORMS.iter().any(fits).then_some(C::WHERE)
    }
    fits::<PortClause>(given, start)
        .or_else(|| fits::<EntryClause>(given, start))
        .or_else(|| fits::<FileClause>(given, start))
        .or_else(|| fits::<ParamClause>(given, start))
}
