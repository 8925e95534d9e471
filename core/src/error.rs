//! Everything that can be wrong with a graph, as data: each problem names its place, what was found and what to do.

use std::fmt;

/// A range of a graph file's text, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

/// A value and the place it was read from.
#[derive(Clone, Debug, PartialEq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// Its place in the text.
    pub span: Span,
}

/// Maximum number of problems that are reported together; the rest is counted. Each carries its line's text, so a broken
/// data file must not produce thousands.
pub(crate) const MOST_PROBLEMS: usize = 100;

/// What an unknown stage kind is called.
pub const STAGE_KIND: &str = "stage kind";

/// The kinds of problem. Texts follow one pattern: what is wrong, what was expected, what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GraphError {
    /// The file cannot be read or written.
    #[error("cannot {action}: {cause}")]
    Io {
        /// "read" or "write".
        action: &'static str,
        /// The operating system's message.
        cause: String,
    },
    /// The text is not RON, or does not have the structure of a graph file.
    #[error("{0}")]
    Syntax(String),
    /// A file of a newer format version.
    #[error("unsupported version {found} of the graph format; this program reads version 1")]
    Version {
        /// The version in the file.
        found: u32,
    },
    /// A name that is used twice where it must be unique.
    #[error("duplicate {what} `{name}`")]
    Duplicate {
        /// "node", "parameter", "input" or "output".
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A name that does not exist.
    #[error("unknown {what} `{found}`{}{}", hint(nearest, known), elsewhere(what, nearest))]
    Unknown {
        /// What the name refers to: "stage kind", "parameter", "node", "port", "input", "field".
        what: &'static str,
        /// The name as written.
        found: String,
        /// The most similar known names, if they are similar enough; several only if they are equally similar.
        nearest: Vec<String>,
        /// All known names.
        known: Vec<String>,
    },
    /// A parameter's value that does not parse as its type.
    #[error("parameter `{name}`: {cause}; expected {expected}")]
    Value {
        /// The parameter.
        name: String,
        /// The type, with its range or choices.
        expected: String,
        /// The parser's message.
        cause: String,
    },
    /// A parameter outside its range.
    #[error("parameter `{name}` is {found}, outside {low} to {high}")]
    Range {
        /// The parameter.
        name: String,
        /// The value as written.
        found: String,
        /// Lowest value.
        low: f64,
        /// Highest value.
        high: f64,
    },
    /// An input that must be connected is not.
    #[error("input `{port}` ({doc}) is not connected; write inputs: {{ \"{port}\": \"NODE.PORT\" }}")]
    Missing {
        /// The port.
        port: String,
        /// Its sentence.
        doc: String,
    },
    /// A node that takes the place of another, but has not the ports that this needs.
    #[error(
        "{new} cannot take the place of {old}, as their ports differ:{}\n  connect inputs anew by rewire: {{ \"NODE.PORT\": \
         \"NODE.PORT\" }} in a graph file, or by --wire NODE.PORT=NODE.PORT",
        lines(differences)
    )]
    Swap {
        /// The new node's kind or file.
        new: String,
        /// The replaced node's kind or file.
        old: String,
        /// Each difference in words: outputs that others read, inputs that must be connected, types.
        differences: Vec<String>,
    },
    /// A wire between ports of different element types.
    #[error("`{source_port}` gives {found}, but `{port}` takes {expected}")]
    Type {
        /// The consuming port.
        port: String,
        /// The producing `node.port`.
        source_port: String,
        /// The element type that the port takes.
        expected: String,
        /// The element type that is connected.
        found: String,
    },
    /// A wire between ports of different extents.
    #[error("`{source_port}` is {found}, but `{port}` takes {expected}")]
    Extent {
        /// The consuming port.
        port: String,
        /// The producing `node.port`.
        source_port: String,
        /// The extent that the port takes.
        expected: String,
        /// The extent that is connected.
        found: String,
    },
    /// Nodes that wait for each other within one frame.
    #[error("these nodes wait for each other within a frame: {}; let one of them read last frame's value through a history input", .path.join(" -> "))]
    Cycle {
        /// The nodes along the cycle; the first is repeated at the end.
        path: Vec<String>,
    },
    /// Two nodes that update one version of a resource in place.
    #[error(
        "`{source_port}` is updated in place by both `{first}` and `{second}`; let the later one take `{first}`'s output"
    )]
    DoublyWritten {
        /// The producing `node.port`.
        source_port: String,
        /// One updating node.
        first: String,
        /// The other.
        second: String,
    },
    /// Problems beyond the first hundred.
    #[error("{0} more problems")]
    More(usize),
    /// A wire that is not allowed: history of an updated resource, a placement that a stage does not support, and so
    /// on.
    #[error("{0}")]
    Invalid(String),
    /// A shader that does not parse, validate or fit its ports.
    #[error("shader {shader}: {}", placed(message, place))]
    Shader {
        /// The shader file's name.
        shader: String,
        /// naga's message, or how the shader differs from the ports.
        message: String,
        /// The place in the shader's file or in an imported module's, unless the message contains it.
        place: Option<Box<Place>>,
    },
}

fn lines(differences: &[String]) -> String {
    differences.iter().map(|difference| format!("\n  {difference}")).collect()
}

fn placed(message: &str, place: &Option<Box<Place>>) -> String {
    match place {
        Some(place) => {
            format!("line {}, column {}: {message}, in `{}`", place.line, place.column, place.text.trim())
        }
        None => message.to_owned(),
    }
}

/// Stages of other crates are known to programs of those crates only.
fn elsewhere(what: &str, nearest: &[String]) -> &'static str {
    if what == STAGE_KIND && nearest.is_empty() {
        "; stages of another crate run in the program of that crate"
    } else {
        ""
    }
}

fn hint(nearest: &[String], known: &[String]) -> String {
    match nearest {
        [] if known.is_empty() => String::new(),
        [] if known.len() > MOST_KNOWN => {
            let (listed, more) = (known[..MOST_KNOWN].join(", "), known.len() - MOST_KNOWN);
            format!("; known: {listed}, and {more} more")
        }
        [] => format!("; known: {}", known.join(", ")),
        nearest => format!(", did you mean {}?", quoted(nearest)),
    }
}

/// Names in backquotes: `a`, `b` or `c`.
fn quoted(names: &[String]) -> String {
    let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match names.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} or {last}", others.join(", ")),
        None => String::new(),
    }
}

impl GraphError {
    /// An unknown name, with the most similar known name if it is similar enough to be a typo. Of the address of a node in
    /// a part, its own name alone may be meant.
    pub fn unknown<S: AsRef<str>>(
        what: &'static str,
        found: &str,
        known: impl IntoIterator<Item = S>,
    ) -> Self {
        let known: Vec<String> = known.into_iter().map(|name| name.as_ref().to_owned()).collect();
        let nearest = nearest(found, &known, |name| strsim::damerau_levenshtein(name, found));
        let nearest = nearest.into_iter().take(1).collect();
        Self::Unknown { what, found: found.to_owned(), nearest, known }
    }

    /// The known name that is nearest to an unknown one, if one is similar enough.
    pub(crate) fn nearest(self) -> Option<String> {
        match self {
            Self::Unknown { nearest, .. } => nearest.into_iter().next(),
            _ => None,
        }
    }

    /// An unknown node, where the known ones are addresses: `fill` may mean `cache/fill`.
    pub fn unknown_node<S: AsRef<str>>(found: &str, known: impl IntoIterator<Item = S>) -> Self {
        let known: Vec<String> = known.into_iter().map(|name| name.as_ref().to_owned()).collect();
        let distance = |address: &str| {
            let tails = address.match_indices('/').map(|(at, _)| &address[at + 1..]);
            let tails = [address].into_iter().chain(tails);
            tails.map(|tail| strsim::damerau_levenshtein(tail, found)).min().unwrap_or(usize::MAX)
        };
        let mut nearest = nearest(found, &known, distance);
        nearest.truncate(MOST_HINTS);
        Self::Unknown { what: "node", found: found.to_owned(), nearest, known }
    }
}

/// Most nodes that a message suggests.
const MOST_HINTS: usize = 4;

/// Most known names that a message lists.
const MOST_KNOWN: usize = 100;

/// Length of a name in bytes above which it is not compared with others: the time grows with the product of both.
const LONGEST_NAME: usize = 256;

/// The names at the least distance, if that is small enough for a typo of `found`.
fn nearest(found: &str, known: &[String], distance: impl Fn(&str) -> usize) -> Vec<String> {
    if found.len() > LONGEST_NAME {
        return Vec::new();
    }
    let of = |name: &String| if name.len() > LONGEST_NAME { usize::MAX } else { distance(name) };
    let distances: Vec<usize> = known.iter().map(of).collect();
    let least = distances.iter().copied().min().unwrap_or(usize::MAX);
    if least > found.chars().count().div_ceil(3) {
        return Vec::new();
    }
    let at_least = |(name, distance): (&String, usize)| (distance == least).then(|| name.clone());
    known.iter().zip(distances).filter_map(at_least).collect()
}

/// Line and column (from 1, in characters) of a problem, with the line's text for display.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The file's name as the user gave it.
    pub file: String,
    /// Line, from 1; 0 for the file as a whole.
    pub line: usize,
    /// Column in characters, from 1; 0 for the file as a whole.
    pub column: usize,
    /// Number of characters to underline, at least one.
    pub length: usize,
    /// The line; of a long one, the part around the place.
    pub text: String,
    /// Number of characters of `text` before those to underline.
    pub lead: usize,
}

/// The longest line in characters that is displayed whole, and the number of characters that are displayed before and
/// after the place in a longer one.
const LONGEST_LINE: usize = 400;
const AROUND: usize = 80;

impl Place {
    /// A file as a whole: line and column 0.
    pub fn file(file: &str) -> Self {
        Self { file: file.to_owned(), line: 0, column: 0, length: 0, text: String::new(), lead: 0 }
    }

    /// The place of `span` in `source`.
    pub fn of(file: &str, source: &str, span: Span) -> Self {
        let start = floor_char_boundary(source, span.start);
        let end = floor_char_boundary(source, span.end.max(start));
        let line_start = source[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let line = source[line_start..].lines().next().unwrap_or("");
        let column = source[line_start..start].chars().count() + 1;
        let on_line = source[start..end].lines().next().unwrap_or("").chars().count();
        let (text, lead) = excerpt(line, column - 1);
        Self {
            file: file.to_owned(),
            line: source[..start].bytes().filter(|byte| *byte == b'\n').count() + 1,
            column,
            length: on_line.max(1),
            text,
            lead,
        }
    }
}

/// A line, or the part of a long one around the character `at`; and the position of that character in it.
fn excerpt(line: &str, at: usize) -> (String, usize) {
    if line.chars().nth(LONGEST_LINE).is_none() {
        return (line.to_owned(), at);
    }
    let first = at.saturating_sub(AROUND);
    let mut rest = line.chars().skip(first);
    let shown: String = rest.by_ref().take(2 * AROUND).collect();
    let before = if first > 0 { "..." } else { "" };
    let after = if rest.next().is_some() { "..." } else { "" };
    (format!("{before}{shown}{after}"), at - first + before.len())
}

fn floor_char_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// One problem and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// What is wrong.
    pub error: GraphError,
    /// The file, and the place in it if known.
    pub place: Option<Place>,
    /// The node it concerns.
    pub node: Option<String>,
    /// The port it concerns.
    pub port: Option<String>,
}

impl Problem {
    /// A problem without a place.
    pub fn new(error: GraphError) -> Self {
        Self { error, place: None, node: None, port: None }
    }

    /// Adds a place.
    pub fn at(mut self, place: Place) -> Self {
        self.place = Some(place);
        self
    }

    /// Adds the node.
    pub fn node(mut self, name: &str) -> Self {
        self.node = Some(name.to_owned());
        self
    }

    /// Adds the port.
    pub fn port(mut self, name: &str) -> Self {
        self.port = Some(name.to_owned());
        self
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) if place.line == 0 => write!(f, "{}: ", place.file)?,
            Some(place) => write!(f, "{}:{}:{}: ", place.file, place.line, place.column)?,
            None => {}
        }
        if let Some(node) = &self.node {
            write!(f, "node `{node}`: ")?;
        }
        write!(f, "{}", self.error)?;
        if let Some(place) = &self.place
            && !place.text.is_empty()
        {
            let number = place.line.to_string();
            let pad = " ".repeat(number.len());
            // Tabs keep their width in the line of markers.
            let lead: String =
                place.text.chars().take(place.lead).map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
            let shown = place.text.chars().count().saturating_sub(place.lead);
            let marks = "^".repeat(place.length.min(shown.max(1)));
            write!(f, "\n {pad} |\n {number} | {}\n {pad} | {lead}{marks}", place.text)?;
        }
        Ok(())
    }
}

/// All problems found in one pass; never empty when returned as an error.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problems(pub Vec<Problem>);

impl Problems {
    /// Adds a problem. Beyond the first hundred, it is counted and not made.
    pub fn add(&mut self, problem: impl FnOnce() -> Problem) {
        if self.is_full() { self.count(1) } else { self.0.push(problem()) }
    }

    /// Adds those of another part.
    pub fn append(&mut self, others: Self) {
        for problem in others.0 {
            match problem.error {
                GraphError::More(more) => self.count(more),
                _ => self.add(|| problem),
            }
        }
    }

    /// Whether further problems are only counted.
    pub(crate) fn is_full(&self) -> bool {
        self.0.len() >= MOST_PROBLEMS
    }

    /// Counts problems that are not listed.
    pub(crate) fn count(&mut self, more: usize) {
        match self.0.last_mut() {
            Some(Problem { error: GraphError::More(counted), .. }) => *counted += more,
            _ => self.0.push(Problem::new(GraphError::More(more))),
        }
    }

    /// `Ok` if there are no problems.
    pub fn into_result(self) -> Result<(), Self> {
        if self.0.is_empty() { Ok(()) } else { Err(self) }
    }
}

impl From<Problem> for Problems {
    fn from(problem: Problem) -> Self {
        Self(vec![problem])
    }
}

impl From<GraphError> for Problems {
    fn from(error: GraphError) -> Self {
        Problem::new(error).into()
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.0.iter().enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            write!(f, "{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_suggested_up_to_a_third_of_their_letters_and_a_length() {
        let told = |found: &str, known: &[&str]| GraphError::unknown("port", found, known).to_string();
        // A third of the letters, rounded up, may be wrong.
        assert_eq!(told("abcd", &["abxy"]), "unknown port `abcd`, did you mean `abxy`?");
        assert_eq!(told("abcd", &["axyz"]), "unknown port `abcd`; known: axyz");
        assert_eq!(told("abc", &["abx"]), "unknown port `abc`, did you mean `abx`?");
        assert_eq!(told("abc", &["axy"]), "unknown port `abc`; known: axy");
        assert_eq!(told("a", &[]), "unknown port `a`");
        // The first of several that are as near.
        assert_eq!(told("abc", &["xyz", "abd", "abe"]), "unknown port `abc`, did you mean `abd`?");
        let long = "n".repeat(257);
        assert!(told(&long[1..], &[&long[2..], &long]).ends_with(&format!("did you mean `{}`?", &long[2..])));
        assert!(told(&long[2..], &[&long[1..]]).contains("did you mean"));
        assert!(told(&long[1..], &[&long]).contains("; known: nnn"), "a known one is too long");
        assert!(told(&long, &[&long[1..]]).contains("; known: nnn"), "it is too long itself");
    }

    #[test]
    fn of_many_names_the_first_are_listed() {
        let known: Vec<String> = (0..101).map(|index| format!("{index:03}")).collect();
        let told = |count: usize| GraphError::unknown("port", "out", &known[..count]).to_string();
        assert!(told(100).ends_with(", 098, 099"), "{}", told(100));
        assert!(told(101).ends_with(", 099, and 1 more"), "{}", told(101));
        // And four nodes that are as near.
        let near = |parts: &[&str]| {
            GraphError::unknown_node("fill", parts.iter().map(|part| format!("{part}/fill"))).to_string()
        };
        assert_eq!(near(&["a"]), "unknown node `fill`, did you mean `a/fill`?");
        assert_eq!(near(&["a", "b"]), "unknown node `fill`, did you mean `a/fill` or `b/fill`?");
        let five = near(&["a", "b", "c/d", "e", "f"]);
        assert_eq!(five, "unknown node `fill`, did you mean `a/fill`, `b/fill`, `c/d/fill` or `e/fill`?");
        assert_eq!(
            GraphError::unknown(STAGE_KIND, "mine", ["age"]).to_string(),
            "unknown stage kind `mine`; known: age; stages of another crate run in the program of that crate"
        );
        assert_eq!(GraphError::unknown("port", "aeg", ["age"]).nearest(), Some("age".into()));
        assert_eq!(GraphError::More(3).nearest(), None);
    }

    #[test]
    fn places_are_lines_and_columns_of_characters() {
        let text = "éa\nbçd\r\n\nend";
        let place = |start, end| {
            let Place { line, column, length, text, lead, .. } = Place::of("f", text, Span { start, end });
            (line, column, length, text, lead)
        };
        assert_eq!(place(0, 2), (1, 1, 1, "éa".into(), 0));
        assert_eq!(place(2, 3), (1, 2, 1, "éa".into(), 1));
        // The end of a line belongs to it.
        assert_eq!(place(3, 4), (1, 3, 1, "éa".into(), 2));
        assert_eq!(place(4, 8), (2, 1, 3, "bçd".into(), 0));
        // Within a letter: at its begin.
        assert_eq!(place(6, 6), (2, 2, 1, "bçd".into(), 1));
        assert_eq!(place(7, 14), (2, 3, 1, "bçd".into(), 2));
        assert_eq!(place(10, 10), (3, 1, 1, String::new(), 0));
        assert_eq!(place(11, 14), (4, 1, 3, "end".into(), 0));
        assert_eq!(place(99, 3), (4, 4, 1, "end".into(), 3));
        let Place { line, column, length, text, lead, .. } = Place::file("f");
        assert_eq!((line, column, length, &*text, lead), (0, 0, 0, "", 0), "a file as a whole");
        let problem = Problem::new(GraphError::Invalid("no".into()));
        let shown =
            |start, end| problem.clone().at(Place::of("f", "\tab\tcd", Span { start, end })).to_string();
        assert_eq!(shown(4, 6), "f:1:5: no\n   |\n 1 | \tab\tcd\n   | \t  \t^^");
        assert_eq!(shown(6, 6), "f:1:7: no\n   |\n 1 | \tab\tcd\n   | \t  \t  ^");
        assert_eq!(problem.clone().at(Place::file("f")).node("n").to_string(), "f: node `n`: no");
        // Of a longer place, what the line shows of it is marked.
        let longer = |start| Place { length: 9, ..Place::of("f", "abc", Span { start, end: 3 }) };
        let marks = |start| problem.clone().at(longer(start)).to_string().matches('^').count();
        assert_eq!([0, 1, 2, 3].map(marks), [3, 2, 1, 1]);
    }

    #[test]
    fn a_hundred_problems_are_listed_and_the_rest_counted() {
        let filled = |count| {
            let mut problems = Problems::default();
            (0..count)
                .for_each(|index| problems.add(|| Problem::new(GraphError::Invalid(index.to_string()))));
            problems
        };
        let last = |problems: &Problems| problems.0.last().unwrap().error.to_string();
        assert_eq!((filled(99).is_full(), filled(100).is_full()), (false, true));
        assert_eq!((filled(100).0.len(), last(&filled(100))), (100, "99".into()));
        assert_eq!((filled(101).0.len(), last(&filled(101))), (101, "1 more problems".into()));
        let mut two = filled(60);
        two.append(filled(103));
        assert_eq!((two.0.len(), last(&two)), (101, "63 more problems".into()));
        two.append(filled(2));
        assert_eq!(last(&two), "65 more problems");
    }
}
