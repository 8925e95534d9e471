//! Syntax highlighting: comments, strings, numbers and keywords, and highlighted ranges.

use std::{ops::Range, sync::Arc};

use egui::{Color32, FontId, Galley, Stroke, TextFormat, Ui, text::LayoutJob};

use crate::theme;

/// The language of a text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Language {
    /// Graph files.
    #[default]
    Ron,
    /// Shaders.
    Wgsl,
}

impl Language {
    /// The language of a file, by its name.
    pub fn of(path: &str) -> Self {
        if path.ends_with(".wgsl") { Self::Wgsl } else { Self::Ron }
    }
}

/// WGSL's keywords.
const KEYWORDS: [&str; 24] = [
    "alias",
    "break",
    "case",
    "const",
    "const_assert",
    "continue",
    "continuing",
    "default",
    "discard",
    "else",
    "enable",
    "false",
    "fn",
    "for",
    "if",
    "let",
    "loop",
    "override",
    "return",
    "struct",
    "switch",
    "true",
    "var",
    "while",
];

/// A highlighted range of a text.
#[derive(Clone, Debug, PartialEq)]
pub struct Highlight {
    /// The byte range.
    pub range: Range<usize>,
    /// The reason for the highlight.
    pub kind: HighlightKind,
}

/// The reason for a highlight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HighlightKind {
    /// A problem.
    Wrong,
    /// A search result.
    Found,
    /// The current search result.
    Current,
}

/// The laid out text, with syntax colours and highlights.
pub fn layout(ui: &Ui, language: Language, text: &str, highlights: &[Highlight]) -> Arc<Galley> {
    let palette = theme::palette(ui);
    let font = FontId::monospace(12.0);
    let mut job = LayoutJob::default();
    job.wrap.max_width = f32::INFINITY;
    for (range, color) in tokens(language, text, ui.visuals().dark_mode, ui.visuals().text_color()) {
        // Split the token where a highlight begins or ends in it.
        let mut cuts: Vec<usize> =
            highlights.iter().flat_map(|highlight| [highlight.range.start, highlight.range.end]).collect();
        cuts.retain(|cut| range.contains(cut) && *cut > range.start);
        cuts.push(range.end);
        cuts.sort_unstable();
        let mut start = range.start;
        for end in cuts {
            let mut format = TextFormat::simple(font.clone(), color);
            let over = highlights
                .iter()
                .filter(|highlight| highlight.range.start <= start && end <= highlight.range.end);
            over.for_each(|highlight| mark(&mut format, highlight.kind, palette));
            job.append(&text[start..end], 0.0, format);
            start = end;
        }
    }
    ui.fonts_mut(|fonts| fonts.layout_job(job))
}

fn mark(format: &mut TextFormat, kind: HighlightKind, palette: &theme::Palette) {
    match kind {
        HighlightKind::Wrong => {
            format.underline = Stroke::new(2.0, palette.bad);
            format.background = palette.bad.gamma_multiply(0.2);
        }
        HighlightKind::Found => format.background = palette.accent.gamma_multiply(0.25),
        HighlightKind::Current => format.background = palette.accent.gamma_multiply(0.6),
    }
}

/// Splits a text into coloured ranges without gaps: comments, strings, numbers, keywords, and everything else.
fn tokens(language: Language, text: &str, dark: bool, plain: Color32) -> Vec<(Range<usize>, Color32)> {
    let shade = |dark_color: [u8; 3], light_color: [u8; 3]| {
        let [r, g, b] = if dark { dark_color } else { light_color };
        Color32::from_rgb(r, g, b)
    };
    let comment = shade([120, 150, 110], [70, 110, 60]);
    let string = shade([206, 160, 120], [150, 70, 30]);
    let number = shade([150, 195, 225], [20, 90, 140]);
    let keyword = shade([190, 160, 220], [110, 50, 150]);
    let wgsl = language == Language::Wgsl;
    let word = |text: &str| text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    let bytes = text.as_bytes();
    let mut tokens: Vec<(Range<usize>, Color32)> = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let rest = &text[at..];
        let (length, color) = match bytes[at] {
            b'/' if rest.starts_with("//") => (rest.find('\n').unwrap_or(rest.len()), comment),
            b'/' if rest.starts_with("/*") => (rest.find("*/").map_or(rest.len(), |end| end + 2), comment),
            b'"' if !wgsl => (string_length(rest), string),
            // Attributes such as @compute, and directives such as #import.
            b'@' | b'#' if wgsl => (1 + word(&rest[1..]), string),
            b'0'..=b'9' => {
                (rest.find(|c: char| !c.is_alphanumeric() && c != '.').unwrap_or(rest.len()), number)
            }
            byte if byte.is_ascii_alphabetic() || byte == b'_' => {
                let length = word(rest);
                let is_keyword = wgsl && KEYWORDS.contains(&&rest[..length]);
                (length, if is_keyword { keyword } else { plain })
            }
            _ => (rest.chars().next().map_or(1, char::len_utf8), plain),
        };
        match tokens.last_mut() {
            Some((range, last)) if *last == color => range.end = at + length,
            _ => tokens.push((at..at + length, color)),
        }
        at += length;
    }
    tokens
}

/// Length in bytes of the quoted string at the beginning of `text`.
fn string_length(text: &str) -> usize {
    let mut escaped = false;
    for (at, byte) in text.bytes().enumerate().skip(1) {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = true,
            b'"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colored(language: Language, text: &str) -> Vec<(&str, Color32)> {
        let tokens = tokens(language, text, true, Color32::WHITE);
        let joined: String = tokens.iter().map(|(range, _)| &text[range.clone()]).collect();
        assert_eq!(joined, text, "tokens cover the text without gaps");
        tokens.into_iter().map(|(range, color)| (&text[range], color)).collect()
    }

    #[test]
    fn graph_files() {
        let text = "Graph( // é \"no\"\n \"a\\\"b\": (x: 0.5, n9: -3) /* c */, \"open";
        let tokens = colored(Language::Ron, text);
        assert!(tokens.iter().any(|(token, _)| *token == "\"a\\\"b\""));
        let colors: std::collections::BTreeSet<_> =
            tokens.iter().map(|(_, color)| color.to_array()).collect();
        assert_eq!(colors.len(), 4);
    }

    #[test]
    fn shaders() {
        let text = "#import frame\n@compute fn main() { let x = 0.5; } // \"é\"";
        let tokens = colored(Language::Wgsl, text);
        let of = |wanted: &str| tokens.iter().find(|(token, _)| *token == wanted).map(|(_, color)| *color);
        assert_eq!((of("#import"), of("fn").is_some()), (of("@compute"), true));
        assert_eq!(of("fn"), of("let"));
        assert_ne!(of("fn"), of("#import"));
        assert!(of("0.5").is_some());
    }
}
