//! Splits RON text into blocks and items, with the place of each.
//!
//! The text must be RON, which ron checks beforehand: this module only needs to know where strings, characters and
//! comments end, so that a bracket or a comma within them does not count.

use crate::error::Span;

/// A bracketed list: `Name(a: 1)`, `{ "a": 1 }` or `[1]`.
pub(super) struct Block {
    /// The name before the bracket.
    pub name: Option<Span>,
    /// Byte of the opening bracket.
    pub open: usize,
    /// Byte of the closing bracket.
    pub close: usize,
    /// The items between the commas.
    pub items: Vec<Item>,
}

/// `key: value` or `value`, both without surrounding space and comments.
pub(super) struct Item {
    /// The text before the colon.
    pub key: Option<Span>,
    /// The value.
    pub value: Span,
    /// Byte of the comma that follows.
    pub comma: Option<usize>,
}

impl Item {
    /// First byte of the key, or of the value if there is no key.
    pub fn start(&self) -> usize {
        self.key.unwrap_or(self.value).start
    }
}

/// The place of the document's value, after `#![...]` attributes; `None` for an empty document.
pub(super) fn root(text: &str) -> Option<Span> {
    let mut tokens = Tokens { text, at: 0, end: text.len() };
    let mut first = tokens.next()?;
    while text[first.span.start..].starts_with('#') {
        let mut depth = 0;
        for token in tokens.by_ref() {
            match token.kind {
                TokenKind::Open => depth += 1,
                TokenKind::Close => depth -= 1,
                _ => continue,
            }
            if depth == 0 {
                break;
            }
        }
        first = tokens.next()?;
    }
    let end = tokens.last().map_or(first.span.end, |token| token.span.end);
    Some(Span { start: first.span.start, end })
}

/// Splits the value at `span` into its items; `None` unless it is a bracketed list.
pub(super) fn block(text: &str, span: Span) -> Option<Block> {
    let mut tokens = Tokens { text, at: span.start, end: span.end };
    let first = tokens.next()?;
    let (name, open) = match first.kind {
        TokenKind::Open => (None, first),
        TokenKind::Other => (Some(first.span), tokens.next().filter(|token| token.kind == TokenKind::Open)?),
        _ => return None,
    };
    let mut items = Vec::new();
    let (mut key, mut value) = (None, None::<Span>);
    let mut depth = 0;
    for token in tokens {
        match token.kind {
            TokenKind::Comma | TokenKind::Close if depth == 0 => {
                let closing = token.kind == TokenKind::Close;
                if let Some(value) = value.take() {
                    let comma = (!closing).then_some(token.span.start);
                    items.push(Item { key: key.take(), value, comma });
                }
                if closing {
                    return Some(Block { name, open: open.span.start, close: token.span.start, items });
                }
                continue;
            }
            TokenKind::Colon if depth == 0 && key.is_none() => {
                key = value.take();
                continue;
            }
            TokenKind::Open => depth += 1,
            TokenKind::Close => depth -= 1,
            _ => {}
        }
        value =
            Some(Span { start: value.map_or(token.span.start, |value| value.start), end: token.span.end });
    }
    None
}

/// The innermost bracket that is open at byte `at`; the text need not be RON.
pub(super) fn open_bracket(text: &str, at: usize) -> Option<usize> {
    let mut open = Vec::new();
    for token in (Tokens { text, at: 0, end: text.len() }).take_while(|token| token.span.start < at) {
        match token.kind {
            TokenKind::Open => open.push(token.span.start),
            TokenKind::Close => drop(open.pop()),
            _ => {}
        }
    }
    open.pop()
}

#[derive(Clone, Copy, PartialEq)]
enum TokenKind {
    Open,
    Close,
    Comma,
    Colon,
    Other,
}

struct Token {
    kind: TokenKind,
    span: Span,
}

/// The tokens of `text[at..end]`. A number may be split into several tokens; nothing here depends on it.
struct Tokens<'a> {
    text: &'a str,
    at: usize,
    end: usize,
}

impl Iterator for Tokens<'_> {
    type Item = Token;

    fn next(&mut self) -> Option<Token> {
        let rest = &self.text[self.at..self.end];
        let start = self.at + trivia(rest);
        let rest = &self.text[start..self.end];
        let first = rest.chars().next()?;
        let (kind, length) = match first {
            '(' | '[' | '{' => (TokenKind::Open, 1),
            ')' | ']' | '}' => (TokenKind::Close, 1),
            ',' => (TokenKind::Comma, 1),
            ':' => (TokenKind::Colon, 1),
            _ => (TokenKind::Other, other(rest, first)),
        };
        self.at = start + length;
        Some(Token { kind, span: Span { start, end: self.at } })
    }
}

/// Length in bytes of the space and comments at the start of `text`. Block comments nest.
pub(super) fn trivia(text: &str) -> usize {
    let mut rest = text;
    loop {
        // ron treats the two direction marks as space, though Unicode does not.
        rest = rest.trim_start_matches(|c: char| c.is_whitespace() || matches!(c, '\u{200E}' | '\u{200F}'));
        if rest.starts_with("//") {
            rest = rest.find('\n').map_or("", |newline| &rest[newline..]);
        } else if rest.starts_with("/*") {
            rest = &rest[block_comment(rest)..];
        } else {
            return text.len() - rest.len();
        }
    }
}

fn block_comment(text: &str) -> usize {
    let (mut at, mut depth) = (0, 0);
    loop {
        let rest = &text[at..];
        if rest.starts_with("/*") {
            depth += 1;
        } else if rest.starts_with("*/") {
            depth -= 1;
        } else {
            match rest.chars().next() {
                Some(c) => at += c.len_utf8(),
                None => return at,
            }
            continue;
        }
        at += 2;
        if depth == 0 {
            return at;
        }
    }
}

/// Length of the string, character, word or sign at the start of `text`.
fn other(text: &str, first: char) -> usize {
    match first {
        '"' => 1 + quoted(&text[1..], '"'),
        '\'' => 1 + character(&text[1..]),
        _ if is_word(first) => {
            let word = text.find(|c| !is_word(c)).unwrap_or(text.len());
            word + suffix(&text[..word], &text[word..])
        }
        _ => first.len_utf8(),
    }
}

fn is_word(c: char) -> bool {
    c == '_' || c.is_alphanumeric()
}

/// Length of the rest after the prefixes of raw strings, byte strings, bytes and raw identifiers.
fn suffix(word: &str, rest: &str) -> usize {
    match word {
        "b" if rest.starts_with('"') => 1 + quoted(&rest[1..], '"'),
        "b" if rest.starts_with('\'') => 1 + character(&rest[1..]),
        "r" | "br" => {
            let hashes = rest.len() - rest.trim_start_matches('#').len();
            let body = &rest[hashes..];
            if let Some(body) = body.strip_prefix('"') {
                let terminator = format!("\"{}", &rest[..hashes]);
                hashes + 1 + body.find(&terminator).map_or(body.len(), |end| end + terminator.len())
            } else {
                // A raw identifier may contain these characters besides those of a word.
                hashes
                    + body.find(|c| !(is_word(c) || "+-.".contains(c))).unwrap_or(body.len()) * hashes.min(1)
            }
        }
        _ => 0,
    }
}

/// Length up to and including the closing `quote`, which does not count after a backslash.
fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices() {
        if c == quote && !escaped {
            return at + c.len_utf8();
        }
        escaped = c == '\\' && !escaped;
    }
    text.len()
}

/// Like [`quoted`] for a character literal, whose first character may be a quote itself.
fn character(text: &str) -> usize {
    match text.chars().next() {
        Some('\'') => 1 + quoted(&text[1..], '\''),
        _ => quoted(text, '\''),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    fn tokens(text: &str) -> Vec<&str> {
        let tokens = Tokens { text, at: 0, end: text.len() };
        tokens.map(|Token { span, .. }| &text[span.start..span.end]).collect()
    }

    #[test]
    fn brackets_and_commas_in_literals_and_comments_do_not_count() {
        for (text, expected) in [
            (r#"a: "x, (y" , b"#, vec!["a", ":", r#""x, (y""#, ",", "b"]),
            (r#""a\"),", "\\",)"#, vec![r#""a\"),""#, ",", r#""\\""#, ",", ")"]),
            (r##"r#"a", "b"#, r"\", c"##, vec![r##"r#"a", "b"#"##, ",", r#"r"\""#, ",", "c"]),
            (r####"r##"a"#,"## x"####, vec![r####"r##"a"#,"##"####, "x"]),
            (r#"b"a,\"b", b'\'', b',' , c"#, vec![r#"b"a,\"b""#, ",", r"b'\''", ",", "b','", ",", "c"]),
            (r##"br#"a", "b"#, br"c,d""##, vec![r##"br#"a", "b"#"##, ",", r#"br"c,d""#]),
            ("',' '\\'' ''' 'é',", vec!["','", "'\\''", "'''", "'é'", ","]),
            ("r#a+b-c.d, r#e", vec!["r#a+b-c.d", ",", "r#e"]),
            ("a /* , /* ( */ ) */ b // , (\n c", vec!["a", "b", "c"]),
            ("\u{200e}a\u{200f} /* é */:(é)", vec!["a", ":", "(", "é", ")"]),
            // What is not closed ends with the text.
            ("\"a, b", vec!["\"a, b"]),
            ("r#\"a\", b", vec!["r#\"a\", b"]),
            ("a /* b", vec!["a"]),
            // Neither a raw string nor a raw identifier.
            ("r##ab , c", vec!["r##ab", ",", "c"]),
            ("b", vec!["b"]),
            ("", vec![]),
        ] {
            assert_eq!(tokens(text), expected, "{text}");
        }
    }

    /// What [`block`] should find: the spans that a text was written with.
    #[derive(Debug, Default, PartialEq)]
    struct Written {
        name: Option<Span>,
        open: usize,
        close: usize,
        items: Vec<WrittenItem>,
    }

    /// Key, value, comma, and what is in the value.
    type WrittenItem = (Option<Span>, Span, Option<usize>, Option<Written>);

    fn trivia_at_random(text: &mut String, random: &mut Random) {
        const TRIVIA: [&str; 8] =
            [" ", "\n    ", "// a, (\n", "/* ] , */", "/* /* \" */ ) */ ", "\u{200E}", "\t", "//\n"];
        for _ in 0..random.below(3) {
            *text += TRIVIA[random.below(8) as usize];
        }
    }

    /// Writes a value, and returns its span and what is in it.
    fn value_at_random(text: &mut String, depth: u32, random: &mut Random) -> (Span, Option<Written>) {
        const LITERALS: [&str; 10] = [
            "1",
            "-2.5e+3",
            "é_1",
            r#""a, (\"""#,
            "'('",
            r"'\''",
            r##"r#")", "#"##,
            r#"b"]\\""#,
            "b','",
            "r#in",
        ];
        let start = text.len();
        if depth == 0 || random.below(2) == 0 {
            *text += LITERALS[random.below(10) as usize];
            return (Span { start, end: text.len() }, None);
        }
        let mut written = Written::default();
        if random.below(3) == 0 {
            *text += ["Name", "é", "r#if"][random.below(3) as usize];
            written.name = Some(Span { start, end: text.len() });
            trivia_at_random(text, random);
        }
        let [open, close] = [['(', ')'], ['[', ']'], ['{', '}']][random.below(3) as usize];
        written.open = text.len();
        text.push(open);
        let count = random.below(4);
        for index in 0..count {
            trivia_at_random(text, random);
            let key = (random.below(2) == 0).then(|| {
                let (key, _) = value_at_random(text, 0, random);
                trivia_at_random(text, random);
                text.push(':');
                trivia_at_random(text, random);
                key
            });
            let (value, inner) = value_at_random(text, depth - 1, random);
            trivia_at_random(text, random);
            let comma = (index + 1 < count || random.below(2) == 0).then(|| {
                text.push(',');
                text.len() - 1
            });
            written.items.push((key, value, comma, inner));
        }
        trivia_at_random(text, random);
        written.close = text.len();
        text.push(close);
        (Span { start, end: text.len() }, Some(written))
    }

    /// What [`block`] finds, recursively.
    fn read(text: &str, span: Span) -> Option<Written> {
        let Block { name, open, close, items } = block(text, span)?;
        let item = |Item { key, value, comma }| (key, value, comma, read(text, value));
        Some(Written { name, open, close, items: items.into_iter().map(item).collect() })
    }

    /// All pairs of brackets.
    fn brackets(written: &Written, found: &mut Vec<[usize; 2]>) {
        found.push([written.open, written.close]);
        written.items.iter().filter_map(|item| item.3.as_ref()).for_each(|inner| brackets(inner, found));
    }

    #[test]
    fn random_values_are_split_as_they_were_written() {
        let mut random = Random(3);
        for _ in 0..2000 {
            let mut text = String::new();
            trivia_at_random(&mut text, &mut random);
            for _ in 0..random.below(3) {
                text += "#![enable(implicit_some, [a])]";
                trivia_at_random(&mut text, &mut random);
            }
            let (span, written) = value_at_random(&mut text, 4, &mut random);
            trivia_at_random(&mut text, &mut random);
            assert_eq!(root(&text), Some(span), "{text}");
            assert_eq!(read(&text, span), written, "{text}");
            let mut all = Vec::new();
            written.iter().for_each(|written| brackets(written, &mut all));
            for at in (span.start..=text.len()).filter(|at| text.is_char_boundary(*at)) {
                let around = all.iter().filter(|[open, close]| *open < at && at <= *close);
                let innermost = around.map(|[open, _]| *open).max();
                assert_eq!(open_bracket(&text[..], at), innermost, "{at} in {text}");
            }
        }
        assert_eq!(root(" // nothing"), None);
    }
}
