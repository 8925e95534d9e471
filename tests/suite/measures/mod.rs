//! Figures of what scenes and stages compute, compared with those of the version before: each change of a result is
//! seen, however small, and whoever made it decides whether it is right. The other tests say what is right.
//!
//! A figure sums up many values in one line: a checksum of integers and words, and for floats how many there are, the
//! sum of their magnitudes, and a sum with random weights, which differs if values change places. Sums have a tolerance,
//! as mathematical functions round in other ways on other systems. If a figure changes for a good reason:
//!
//! ```sh
//! UPDATE_SNAPSHOTS=1 cargo test --release -p epigraph-tests --test suite measures
//! git diff --stat tests/suite/snapshots
//! ```
//!
//! This also writes the texts that figures sum up, such as messages, to `target/tmp/measures`: to see what changed, run it on
//! the version before too, and compare the folders.

mod graphs;
mod models;
mod pictures;
mod scenes;
mod texts;

use std::{collections::BTreeMap, env, fmt, fs, path::Path};

use epigraph_core::testing::Random;

/// Sums may differ by this share of the root of the sum of squares. Roundings, of 1e-7 of each value, add up at random to a
/// hundredth of it.
const TOLERANCE: f64 = 1e-5;

/// Sums up values. See the module.
struct Figure {
    checksum: u32,
    numbers: usize,
    magnitude: f64,
    squares: f64,
    weighted: f64,
    weights: Random,
    /// The texts that were added.
    texts: String,
}

impl Default for Figure {
    fn default() -> Self {
        Self {
            checksum: 0,
            numbers: 0,
            magnitude: 0.0,
            squares: 0.0,
            weighted: 0.0,
            weights: Random(7),
            texts: String::new(),
        }
    }
}

impl Figure {
    /// Adds integers, words and the like (FNV-1a).
    fn exact(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.checksum = (self.checksum ^ u32::from(byte)).wrapping_mul(0x0100_0193);
        }
    }

    /// Adds a text for people.
    fn text(&mut self, text: &str) {
        self.exact(text.as_bytes());
        self.texts += text;
        self.texts.push('\n');
    }

    /// Adds a float. Large ones count little more than small ones.
    fn number(&mut self, number: f64) {
        if !number.is_finite() {
            return self.exact(number.to_string().as_bytes());
        }
        let number = number.asinh();
        self.numbers += 1;
        self.magnitude += number.abs();
        self.squares += number * number;
        self.weighted += number * f64::from(self.weights.between(-1.0, 1.0));
    }

    /// Adds the text of a value: its floats as numbers, and all else as it is.
    fn debug(&mut self, value: &impl fmt::Debug) {
        let text = format!("{value:?}");
        let mut rest = text.as_str();
        while let Some(start) = rest.find(|first: char| first.is_ascii_digit()) {
            let start = start - usize::from(rest[..start].ends_with('-'));
            let is_part = |c: char| c.is_ascii_digit() || ".e-".contains(c);
            let end = rest[start..].find(|c| !is_part(c)).map_or(rest.len(), |length| start + length);
            self.exact(&rest.as_bytes()[..start]);
            match rest[start..end].parse() {
                Ok(number) if rest[start..end].contains(['.', 'e']) => self.number(number),
                _ => self.exact(&rest.as_bytes()[start..end]),
            }
            rest = &rest[end..];
        }
        self.exact(rest.as_bytes());
    }

    /// Whether this is the figure that a line has.
    fn is(&self, line: &str) -> bool {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let [checksum, numbers, sums @ ..] = &fields[..] else { return false };
        let is_near = |(sum, text): (&f64, &&str)| {
            text.parse().is_ok_and(|known: f64| (sum - known).abs() <= TOLERANCE * self.squares.sqrt() + 1e-9)
        };
        *checksum == format!("{:08x}", self.checksum)
            && *numbers == self.numbers.to_string()
            && sums.len() == 2
            && [self.magnitude, self.weighted].iter().zip(sums).all(is_near)
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08x} {} {:.9e} {:.9e}", self.checksum, self.numbers, self.magnitude, self.weighted)
    }
}

/// Figures by name.
type Figures = BTreeMap<String, Figure>;

/// The differences between figures and a text with `NAME: FIGURE` in each line.
fn differences(figures: &Figures, text: &str) -> Vec<String> {
    let known: BTreeMap<&str, &str> = text.lines().filter_map(|line| line.rsplit_once(": ")).collect();
    let gone = known.keys().filter(|name| !figures.contains_key(**name));
    let gone = gone.map(|name| format!("{name}: is gone"));
    let other = figures.iter().filter_map(|(name, figure)| match known.get(&**name) {
        Some(line) if figure.is(line) => None,
        Some(line) => Some(format!("{name}: was {line}, is {figure}")),
        None => Some(format!("{name}: is new")),
    });
    gone.chain(other).collect()
}

/// Compares figures with the file that has them, or writes it anew.
#[track_caller]
fn assert_same(name: &str, figures: &Figures) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("suite/snapshots/{name}.txt"));
    if env::var_os("UPDATE_SNAPSHOTS").is_some() {
        let lines: String = figures.iter().map(|(name, figure)| format!("{name}: {figure}\n")).collect();
        fs::write(&path, lines).expect("the folder of the snapshots");
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("measures");
        fs::create_dir_all(&folder).expect("the folder of temporary files");
        for (name, figure) in figures.iter().filter(|(_, figure)| !figure.texts.is_empty()) {
            fs::write(folder.join(name.replace('/', "-")), &figure.texts)
                .expect("the folder of temporary files");
        }
    }
    let text = fs::read_to_string(&path).unwrap_or_default();
    let different = differences(figures, &text);
    assert!(
        different.is_empty(),
        "{} of {} figures in {} changed. If that is right, run this test with UPDATE_SNAPSHOTS=1.\n{}",
        different.len(),
        figures.len(),
        path.display(),
        different[..different.len().min(20)].join("\n")
    );
}

#[test]
fn figures_change_with_every_value_but_not_with_rounding() {
    let figure = |values: &[f64], text: &str| {
        let mut figure = Figure::default();
        values.iter().for_each(|&value| figure.number(value));
        figure.debug(&text);
        figure
    };
    let mut random = Random(3);
    let values: Vec<f64> = (0..2000).map(|_| f64::from(random.between(-3.0, 50.0))).collect();
    let line = figure(&values, "a 1.5 3").to_string();
    assert!(figure(&values, "a 1.5 3").is(&line));
    assert!(figure(&values, "a 1.50000001 3").is(&line));
    assert!(!figure(&values, "a 1.6 3").is(&line));
    assert!(!figure(&values, "a 1.5 4").is(&line));
    assert!(!figure(&values, "b 1.5 3").is(&line));
    let rounded: Vec<f64> =
        values.iter().map(|value| value * (1.0 + f64::from(random.between(-1e-7, 1e-7)))).collect();
    assert!(figure(&rounded, "a 1.5 3").is(&line));
    for index in [0, 999, 1999] {
        let mut other = values.clone();
        other[index] += 0.2;
        assert!(!figure(&other, "a 1.5 3").is(&line));
    }
    let mut swapped = values.clone();
    swapped.swap(3, 4);
    assert!(!figure(&swapped, "a 1.5 3").is(&line));
    // Names that are gone or new count, too.
    let figures = Figures::from([("a".into(), figure(&values, "")), ("b".into(), figure(&[], ""))]);
    let text = format!("a: {}\nc: {}\n", figures["a"], figures["b"]);
    assert_eq!(differences(&figures, &text), ["c: is gone", "b: is new"]);
}
