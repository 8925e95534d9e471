//! The lines in which two texts differ.

/// Number of equal lines shown around those that differ.
const AROUND: usize = 3;

/// Largest product of two numbers of lines that are compared line by line. More are shown as replaced as a whole.
const COMPARED: usize = 4_000_000;

/// A line of the comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line<'t> {
    /// In both texts.
    Both(&'t str),
    /// Only in the first text.
    First(&'t str),
    /// Only in the second text.
    Second(&'t str),
    /// Equal lines that are left out.
    Gap,
}

/// The lines that differ, with a few equal ones around them; empty if the texts are equal.
pub fn differences<'t>(first: &'t str, second: &'t str) -> Vec<Line<'t>> {
    let (first, second): (Vec<&str>, Vec<&str>) = (first.lines().collect(), second.lines().collect());
    let lines = merged(&first, &second);
    let differs = |line: &Line| !matches!(line, Line::Both(_));
    let is_near = |index: usize| {
        let near = index.saturating_sub(AROUND)..(index + AROUND + 1).min(lines.len());
        lines[near].iter().any(differs)
    };
    let mut shown: Vec<Line> = Vec::new();
    for (index, line) in lines.iter().enumerate() {
        if is_near(index) {
            shown.push(*line);
        } else if shown.last().is_some_and(|last| *last != Line::Gap) {
            shown.push(Line::Gap);
        }
    }
    shown.pop_if(|last| *last == Line::Gap);
    shown
}

/// All lines of both texts in order, with as many as possible in both.
fn merged<'t>(first: &[&'t str], second: &[&'t str]) -> Vec<Line<'t>> {
    let start = first.iter().zip(second).take_while(|(a, b)| a == b).count();
    let ends = first[start..].iter().rev().zip(second[start..].iter().rev());
    let end = ends.take_while(|(a, b)| a == b).count();
    let (a, b) = (&first[start..first.len() - end], &second[start..second.len() - end]);

    let both = |lines: &[&'t str]| lines.iter().map(|line| Line::Both(line)).collect::<Vec<_>>();
    let mut lines = both(&first[..start]);
    let (mut i, mut j) = (0, 0);
    if a.len() * b.len() <= COMPARED {
        let common = common(a, b);
        let width = b.len() + 1;
        while i < a.len() && j < b.len() {
            if a[i] == b[j] {
                lines.push(Line::Both(a[i]));
                (i, j) = (i + 1, j + 1);
            } else if common[(i + 1) * width + j] >= common[i * width + j + 1] {
                lines.push(Line::First(a[i]));
                i += 1;
            } else {
                lines.push(Line::Second(b[j]));
                j += 1;
            }
        }
    }
    lines.extend(a[i..].iter().map(|line| Line::First(line)));
    lines.extend(b[j..].iter().map(|line| Line::Second(line)));
    lines.extend(both(&first[first.len() - end..]));
    lines
}

/// For each pair of lines, in rows of one more than the lines of `b`: the length of the longest common subsequence of
/// what follows from there.
fn common(a: &[&str], b: &[&str]) -> Vec<u32> {
    let width = b.len() + 1;
    let mut common = vec![0; (a.len() + 1) * width];
    for i in (0..a.len()).rev() {
        for j in (0..b.len()).rev() {
            common[i * width + j] = if a[i] == b[j] {
                common[(i + 1) * width + j + 1] + 1
            } else {
                common[(i + 1) * width + j].max(common[i * width + j + 1])
            };
        }
    }
    common
}

#[cfg(test)]
mod tests {
    use super::{Line::*, *};

    #[test]
    fn lines_that_differ_are_shown_with_a_few_around_them() {
        assert_eq!(differences("a\nb\n", "a\nb\n"), []);
        assert_eq!(differences("a\nb\nc\n", "a\nx\nc\n"), [Both("a"), First("b"), Second("x"), Both("c")]);
        assert_eq!(differences("", "a\n"), [Second("a")]);
        assert_eq!(differences("a", ""), [First("a")]);
        // Most lines stay: only one of the two is gone.
        assert_eq!(
            differences("a\nb\na\nc", "a\nc\nd"),
            [Both("a"), First("b"), First("a"), Both("c"), Second("d")]
        );
        let many: Vec<String> = (0..20).map(|line| line.to_string()).collect();
        let (first, second) =
            (many.join("\n"), many.join("\n").replace("\n9\n", "\n9a\n").replace("\n17\n", "\n"));
        let expected = [
            Both("6"),
            Both("7"),
            Both("8"),
            First("9"),
            Second("9a"),
            Both("10"),
            Both("11"),
            Both("12"),
            Gap,
            Both("14"),
            Both("15"),
            Both("16"),
            First("17"),
            Both("18"),
            Both("19"),
        ];
        assert_eq!(differences(&first, &second), expected);
    }

    #[test]
    fn both_texts_can_be_put_together_from_the_lines() {
        let text = |bits: u32| {
            (0..10).map(|line| ["a", "b", "c"][(bits >> (3 * line)) as usize % 3]).collect::<Vec<_>>()
        };
        let mut bits = 1u32;
        for _ in 0..500 {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let (first, second) = (text(bits), text(bits.rotate_left(13)));
            let lines = merged(&first, &second);
            let of = |own: fn(&Line) -> bool| -> Vec<&str> {
                let lines = lines.iter().filter(|line| own(line));
                lines
                    .map(|line| match *line {
                        Both(text) | First(text) | Second(text) => text,
                        Gap => "",
                    })
                    .collect()
            };
            assert_eq!(of(|line| !matches!(line, Second(_))), first);
            assert_eq!(of(|line| !matches!(line, First(_))), second);
        }
    }

    #[test]
    fn long_texts_are_compared_without_much_memory() {
        let lines = |of: &str| (0..3000).map(|line| format!("{of}{line}\n")).collect::<String>();
        let (first, second) = (lines("a"), lines("b"));
        let shown = differences(&first, &second);
        assert_eq!((shown.len(), shown[0], shown[3000]), (6000, First("a0"), Second("b0")));
    }
}
