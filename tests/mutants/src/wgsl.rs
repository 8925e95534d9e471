//! Mutants of shaders: one text each, which takes the place of the shader's when a test loads it.

use crate::Mutant;

/// A mutant and its text.
pub struct Text {
    pub mutant: Mutant,
    pub text: String,
}

/// Binary operators stand between spaces; brackets of types do not.
const OPERATORS: [(&str, &str); 18] = [
    (" < ", " <= "),
    (" <= ", " < "),
    (" > ", " >= "),
    (" >= ", " > "),
    (" == ", " != "),
    (" != ", " == "),
    (" + ", " - "),
    (" - ", " + "),
    (" * ", " / "),
    (" / ", " * "),
    (" % ", " * "),
    (" & ", " | "),
    (" | ", " & "),
    (" ^ ", " & "),
    (" << ", " >> "),
    (" >> ", " << "),
    (" && ", " || "),
    (" || ", " && "),
];

const CALLS: [(&str, &str); 4] =
    [("min(", "max("), ("max(", "min("), ("floor(", "ceil("), ("ceil(", "floor(")];

/// The mutants of a file, numbered from `first`.
pub fn find(file: &str, text: &str, first: u32) -> Vec<Text> {
    let mut found = Vec::new();
    let mut depth = 0;
    // Whether the braces around are those of a function.
    let mut function = false;
    let mut offset = 0;
    for (number, line) in text.split_inclusive('\n').enumerate() {
        let code = line.split("//").next().unwrap_or_default();
        if depth == 0 && code.contains("fn ") {
            function = true;
        }
        let inside = function && depth > 0 && !code.trim_start().starts_with('#');
        let constant = depth == 0 && code.starts_with("const ");
        if inside || constant {
            for (at, from, to) in changes(code) {
                let mut text = text.to_owned();
                text.replace_range(offset + at..offset + at + from.len(), &to);
                let mutant = Mutant {
                    id: first + found.len() as u32,
                    file: file.to_owned(),
                    line: number + 1,
                    column: at + 1,
                    change: format!("{} -> {}", from.trim(), to.trim()),
                    source: line.trim().to_owned(),
                };
                found.push(Text { mutant, text });
            }
        }
        depth += code.matches('{').count() as i32 - code.matches('}').count() as i32;
        function &= depth > 0 || !code.contains('}');
        offset += line.len();
    }
    found
}

/// The changes of a line: where, what, and what takes its place.
fn changes(code: &str) -> Vec<(usize, String, String)> {
    let mut found = Vec::new();
    for (from, to) in OPERATORS {
        found.extend(code.match_indices(from).map(|(at, _)| (at, from.to_owned(), to.to_owned())));
    }
    for (from, to) in CALLS {
        let whole =
            |at: usize| !code[..at].ends_with(|before: char| before.is_alphanumeric() || before == '_');
        let calls = code.match_indices(from).filter(|(at, _)| whole(*at));
        found.extend(calls.map(|(at, _)| (at, from.to_owned(), to.to_owned())));
    }
    found.extend(numbers(code));
    let statement = code.trim();
    // Without a barrier, software drivers compute the same.
    let acts = statement.ends_with(';')
        && ![
            "let ",
            "var ",
            "return",
            "const ",
            "break",
            "continue",
            "discard",
            "workgroupBarrier",
            "storageBarrier",
            "}",
        ]
        .iter()
        .any(|other| statement.starts_with(other))
        && (statement.contains(" = ") || statement.contains("= ") || statement.ends_with(");"))
        && statement.matches('(').count() == statement.matches(')').count();
    if acts && let Some(at) = code.find(statement) {
        found.push((at, statement.to_owned(), ";".into()));
    }
    if let Some(condition) = statement.strip_prefix("if ").and_then(|rest| rest.strip_suffix(" {"))
        && let Some(at) = code.find(condition)
    {
        found.push((at, condition.to_owned(), format!("!({condition})")));
    }
    found.sort_by_key(|(at, ..)| *at);
    found
}

/// Numbers, but for those in types and attributes.
fn numbers(code: &str) -> Vec<(usize, String, String)> {
    let mut found = Vec::new();
    let bytes = code.as_bytes();
    let part = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'.';
    let mut at = 0;
    while at < bytes.len() {
        if !part(bytes[at]) {
            at += 1;
            continue;
        }
        let mut end = at;
        while end < bytes.len()
            && (part(bytes[end]) || b"+-".contains(&bytes[end]) && is_exponent(&bytes[at..end]))
        {
            end += 1;
        }
        let (word, in_type) =
            (&code[at..end], bytes.get(end) == Some(&b'>') || code.trim_start().starts_with('@'));
        if word.starts_with(|first: char| first.is_ascii_digit())
            && !in_type
            && let Some(to) = other(word)
        {
            found.push((at, word.to_owned(), to));
        }
        at = end;
    }
    found
}

/// Whether a number so far ends with the letter of an exponent.
fn is_exponent(word: &[u8]) -> bool {
    word[0].is_ascii_digit() && word.last() == Some(&b'e') && !word.starts_with(b"0x")
}

/// Another number near this one.
fn other(word: &str) -> Option<String> {
    let digits = word.trim_end_matches(['u', 'i', 'f', 'h']);
    if let Some(hex) = word.strip_prefix("0x") {
        let value = u64::from_str_radix(hex.trim_end_matches(['u', 'i']), 16).ok()?;
        return Some(format!("{:#x}{}", value ^ 1, if word.ends_with('u') { "u" } else { "" }));
    }
    let suffix = &word[digits.len()..];
    if let Ok(value) = digits.parse::<u64>() {
        return Some(format!("{}{suffix}", if value < 2 { value + 1 } else { value - 1 }));
    }
    let value: f64 = digits.parse().ok()?;
    Some(format!("{:?}{suffix}", if value == 0.0 { 1.0 } else { 2.0 * value }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_change_and_nothing_outside_functions() {
        let text = "\
struct S {
    a: array<u32, 4>,
}
const LIMIT = 3u;
@compute @workgroup_size(8, 8)
fn f(a: vec2<u32>) {
    if a.x < 2u {
        b[0] = min(a.y, 0x10u) + 1.5e-3; // a < b
    }
    workgroupBarrier();
}
";
        let found = find("f.wgsl", text, 5);
        let changes: Vec<_> = found.iter().map(|text| text.mutant.change.as_str()).collect();
        assert_eq!(
            changes,
            [
                "3u -> 2u",
                "a.x < 2u -> !(a.x < 2u)",
                "< -> <=",
                "2u -> 1u",
                "b[0] = min(a.y, 0x10u) + 1.5e-3; -> ;",
                "0 -> 1",
                "min( -> max(",
                "0x10u -> 0x11u",
                "+ -> -",
                "1.5e-3 -> 0.003"
            ]
        );
        assert!(found[8].text.contains("min(a.y, 0x10u) - 1.5e-3; // a < b"));
        assert_eq!((found[8].mutant.id, found[8].mutant.line), (13, 8));
    }
}
