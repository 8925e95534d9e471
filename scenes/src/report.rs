use std::fmt;

/// What loading did with a part of a file that it could not use as it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoteKind {
    /// It is not in the picture.
    LeftOut,
    /// The picture shows something simpler.
    Approximated,
    /// It was invalid and was replaced.
    Repaired,
    /// The scene got something that the file does not have.
    Added,
}

impl fmt::Display for NoteKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::LeftOut => "left out",
            Self::Approximated => "approximated",
            Self::Repaired => "repaired",
            Self::Added => "added",
        })
    }
}

/// One sentence of a [`Report`], and everything that it is true of.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Note {
    /// What loading did.
    pub kind: NoteKind,
    /// What it concerns, such as "the extension KHR_materials_clearcoat".
    pub what: String,
    /// How often it occurs.
    pub count: usize,
    /// The first [`Note::NAMES`] different names of where it occurs, in the order of the file; may be empty.
    pub names: Vec<String>,
}

impl Note {
    /// The most names that a note keeps.
    pub const NAMES: usize = 5;
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, what, count, names } = self;
        write!(f, "{kind}: {what}")?;
        if *count > 1 {
            write!(f, ", {count} times")?;
        }
        match names.get(Self::NAMES - 1) {
            Some(_) => write!(f, " ({}, ...)", names[..Self::NAMES - 1].join(", ")),
            None if names.is_empty() => Ok(()),
            None => write!(f, " ({})", names.join(", ")),
        }
    }
}

/// Everything in a scene's files that was left out, approximated or repaired, by name and count.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(transparent)]
pub struct Report {
    notes: Vec<Note>,
}

impl Report {
    /// Adds one occurrence of `what`, at the thing called `name` (may be empty).
    pub fn add(&mut self, kind: NoteKind, what: impl Into<String>, name: &str) {
        self.add_many(kind, what, name, 1);
    }

    /// Adds `count` occurrences of `what` at one thing; none if `count` is 0.
    pub fn add_many(&mut self, kind: NoteKind, what: impl Into<String>, name: &str, count: usize) {
        let names = if name.is_empty() { vec![] } else { vec![name.to_owned()] };
        if count > 0 {
            self.merge(Note { kind, what: what.into(), count, names });
        }
    }

    /// Adds all notes of another report.
    pub fn extend(&mut self, other: &Self) {
        other.notes.iter().for_each(|note| self.merge(note.clone()));
    }

    fn merge(&mut self, note: Note) {
        match self.notes.iter_mut().find(|old| (old.kind, &old.what) == (note.kind, &note.what)) {
            Some(old) => {
                old.count += note.count;
                for name in note.names {
                    if old.names.len() < Note::NAMES && !old.names.contains(&name) {
                        old.names.push(name);
                    }
                }
            }
            None => self.notes.push(note),
        }
    }

    /// The notes, in the order in which they first occurred.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// Whether everything of the files is in the scene as it stands.
    pub fn is_empty(&self) -> bool {
        self.notes.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_shows_four_names_and_keeps_five() {
        for (count, shown) in
            [(1, " (a)"), (4, " (a, b, c, d)"), (5, " (a, b, c, d, ...)"), (7, " (a, b, c, d, ...)")]
        {
            let mut report = Report::default();
            for name in ["a", "b", "c", "d", "e", "f", "g"].into_iter().take(count) {
                report.add(NoteKind::LeftOut, "it", name);
            }
            let note = &report.notes()[0];
            assert!(note.to_string().ends_with(shown), "{note}");
            assert_eq!(note.names.len(), count.min(5));
        }
    }

    #[test]
    fn notes_are_grouped_counted_and_named() {
        let mut report = Report::default();
        assert!(report.is_empty());
        for name in ["ball", "box", "ball", "floor", "lamp", "door", "key"] {
            report.add(NoteKind::LeftOut, "the second UV set", name);
        }
        report.add(NoteKind::Repaired, "a normal that is not a number", "");
        report.add_many(NoteKind::Repaired, "a normal that is not a number", "", 1);
        report.add_many(NoteKind::Repaired, "a normal that is missing", "", 0);
        report.add(NoteKind::Approximated, "the spot's cone", "lamp");
        report.add(NoteKind::Added, "a light", "");
        let mut twice = report.clone();
        twice.extend(&report);
        let lines = |report: &Report| report.notes().iter().map(Note::to_string).collect::<Vec<_>>();
        assert_eq!(
            lines(&report),
            [
                "left out: the second UV set, 7 times (ball, box, floor, lamp, ...)",
                "repaired: a normal that is not a number, 2 times",
                "approximated: the spot's cone (lamp)",
                "added: a light",
            ]
        );
        let counts = |report: &Report| report.notes().iter().map(|note| note.count).collect::<Vec<_>>();
        assert_eq!((counts(&report), counts(&twice)), (vec![7, 2, 1, 1], vec![14, 4, 2, 2]));
    }
}
