//! Rows of the tables of `docs/numerics.md`: what a stage claims, and the worst that was measured on each side.

use std::{fmt::Write as _, fs, path::PathBuf};

use epigraph_core::Side;
use epigraph_tests::gpu;

use crate::interval::Interval;

/// What an oracle says about one number.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// The exact result, of f64 arithmetic.
    pub exact: f64,
    /// The results that WGSL allows.
    pub allowed: Interval,
    /// The unit of errors here, such as one ULP of the exact result.
    pub unit: f64,
}

/// The unit of a bound, in words.
#[derive(Clone, Copy, PartialEq)]
pub enum Unit {
    /// Elements that differ: the bound is 0.
    Differences,
    /// Anything else, by its name.
    Of(&'static str),
}

/// Compares what a stage wrote with what an oracle expects, and keeps the worst.
pub struct Measure {
    stage: &'static str,
    quantity: &'static str,
    domain: &'static str,
    oracle: &'static str,
    bound: f64,
    unit: Unit,
    /// The worst error and the number of values: of the CPU twin, and of the shader.
    sides: [(f64, usize); 2],
    /// The sides on which the stage runs.
    runs: [bool; 2],
    is_chance: bool,
}

/// A finished row.
pub struct Row {
    measure: Measure,
}

impl Measure {
    /// Whole numbers and bits, which have to be equal.
    pub fn exact(
        stage: &'static str,
        quantity: &'static str,
        domain: &'static str,
        oracle: &'static str,
    ) -> Self {
        Self::within(stage, quantity, domain, oracle, 0.0, Unit::Differences)
    }

    /// Numbers whose errors are at most `bound` units.
    pub fn within(
        stage: &'static str,
        quantity: &'static str,
        domain: &'static str,
        oracle: &'static str,
        bound: f64,
        unit: Unit,
    ) -> Self {
        let sides = [(0.0, 0); 2];
        Self { stage, quantity, domain, oracle, bound, unit, sides, runs: [true; 2], is_chance: false }
    }

    /// A figure of chance, such as a z-value: the bound is that of the test's level, however small the figure is.
    pub fn statistic(
        stage: &'static str,
        quantity: &'static str,
        domain: &'static str,
        oracle: &'static str,
        unit: &'static str,
        bound: f64,
    ) -> Self {
        Self { is_chance: true, ..Self::within(stage, quantity, domain, oracle, bound, Unit::Of(unit)) }
    }

    /// For stages that run on the CPU only.
    pub fn on_cpu_only(mut self) -> Self {
        self.runs = [true, false];
        self
    }

    /// For stages that run on the GPU only.
    pub fn on_gpu_only(mut self) -> Self {
        self.runs = [false, true];
        self
    }

    /// Compares numbers. `size` is that of the picture that they make: a list is one row.
    ///
    /// # Panics
    /// With the names of three pictures (what was got, what was expected, and the difference) if a number is not
    /// allowed, or its error is larger than the bound. The bound is claimed of the CPU and of software GPUs; others may
    /// use all of what WGSL allows.
    #[track_caller]
    pub fn compare(&mut self, side: Side, case: &str, size: [usize; 2], got: &[f32], expected: &[Expected]) {
        assert_eq!(got.len(), expected.len(), "{}", self.name(case));
        let is_bound = side == Side::Cpu || gpu().is_software();
        let mut wrong = None;
        for (at, (&got, expected)) in got.iter().zip(expected).enumerate() {
            let got = f64::from(got);
            let error =
                if got == expected.exact { 0.0 } else { (got - expected.exact).abs() / expected.unit };
            let worst = &mut self.sides[usize::from(side == Side::Gpu)];
            *worst = (worst.0.max(error), worst.1 + 1);
            // The negation catches NaN.
            let is_good = expected.allowed.contains(got) && (!is_bound || error <= self.bound);
            if !is_good && wrong.as_ref().is_none_or(|(_, most, _)| error > *most) {
                wrong = Some((at, error, *expected));
            }
        }
        if let Some((at, error, Expected { exact, allowed, .. })) = wrong {
            let expected: Vec<f32> = expected.iter().map(|expected| expected.exact as f32).collect();
            panic!(
                "{} on {side}: number {at} of {} is {:e}, exactly it is {exact:e}; allowed are {:e} to {:e}, \
                 an error of {error:.3} where {} is claimed; {}",
                self.name(case),
                got.len(),
                got[at],
                allowed.low,
                allowed.high,
                self.bound_text(),
                show(&self.name(case), size, got, &expected)
            );
        }
    }

    /// Compares whole numbers and bits.
    ///
    /// # Panics
    /// As [`Measure::compare`], if any differs.
    #[track_caller]
    pub fn compare_words(&mut self, side: Side, case: &str, size: [usize; 2], got: &[u32], expected: &[u32]) {
        assert_eq!(got.len(), expected.len(), "{}", self.name(case));
        self.sides[usize::from(side == Side::Gpu)].1 += got.len();
        if let Some(at) = (0..got.len()).find(|&at| got[at] != expected[at]) {
            let count = (0..got.len()).filter(|&at| got[at] != expected[at]).count();
            let [shown, right] =
                [got, expected].map(|words| words.iter().map(|&word| word as f32).collect::<Vec<_>>());
            panic!(
                "{} on {side}: {count} of {} differ; the first, number {at}, is {:#x} and should be {:#x}; {}",
                self.name(case),
                got.len(),
                got[at],
                expected[at],
                show(&self.name(case), size, &shown, &right)
            );
        }
    }

    /// Counts values that were compared otherwise, and those of them that are wrong.
    ///
    /// # Panics
    /// If any is.
    #[track_caller]
    pub fn count(&mut self, side: Side, case: &str, wrong: usize, count: usize) {
        self.sides[usize::from(side == Side::Gpu)].1 += count;
        assert!(wrong == 0, "{} on {side}: {wrong} of {count} are wrong", self.name(case));
    }

    /// An error that was measured otherwise, of `count` values.
    ///
    /// # Panics
    /// If it is larger than the bound.
    #[track_caller]
    pub fn record(&mut self, side: Side, case: &str, error: f64, count: usize) {
        let worst = &mut self.sides[usize::from(side == Side::Gpu)];
        *worst = (worst.0.max(error), worst.1 + count);
        let is_bound = side == Side::Cpu || gpu().is_software();
        assert!(
            error <= self.bound || !is_bound && error.is_finite(),
            "{} on {side}: an error of {error:.3}; {} is claimed",
            self.name(case),
            self.bound_text()
        );
    }

    fn name(&self, case: &str) -> String {
        format!("{}, {}, {case}", self.stage, self.quantity)
    }

    fn bound_text(&self) -> String {
        match self.unit {
            Unit::Differences => "0 differ".into(),
            // As in "4 · 2^-24 of the largest coordinate".
            Unit::Of(unit) if unit.starts_with(|c: char| c.is_ascii_digit()) => {
                format!("{} · {unit}", self.bound)
            }
            Unit::Of(unit) => format!("{} {unit}", self.bound),
        }
    }

    /// The row.
    ///
    /// # Panics
    /// If a side was not compared, or if the bound is more than twice the worst error: it would not notice a stage that
    /// becomes worse.
    #[track_caller]
    pub fn row(self) -> Row {
        let compared = self.sides.map(|side| side.1 > 0);
        assert!(compared == self.runs, "{}: a side was not compared", self.name("all"));
        let worst = self.sides.iter().fold(0f64, |worst, side| worst.max(side.0));
        assert!(
            self.bound <= 2.0 * worst || self.is_chance || !gpu().is_software(),
            "{}: {} is claimed, but the worst is {worst:.4}: claim less",
            self.name("all"),
            self.bound_text()
        );
        Row { measure: self }
    }
}

impl Row {
    /// The stage's kind.
    pub fn stage(&self) -> &'static str {
        self.measure.stage
    }

    pub const HEADINGS: [&str; 8] =
        ["stage", "quantity", "over", "oracle", "claimed", "values a side", "worst, CPU", "worst, GPU"];

    /// The texts of its cells.
    pub fn cells(&self) -> [String; 8] {
        let Measure { stage, quantity, domain, oracle, unit, sides, runs, .. } = &self.measure;
        let worst = |(worst, count): (f64, usize)| match unit {
            Unit::Differences => format!("0 of {count}"),
            Unit::Of(_) => rounded_up(worst),
        };
        let cell = |side: usize, other: &str| {
            if runs[side] { worst(sides[side]) } else { format!("runs on the {other}") }
        };
        [
            format!("`{stage}`"),
            (*quantity).into(),
            (*domain).into(),
            (*oracle).into(),
            self.measure.bound_text(),
            sides[0].1.max(sides[1].1).to_string(),
            cell(0, "GPU"),
            cell(1, "CPU"),
        ]
    }
}

/// Two digits, not less than the number.
pub fn rounded_up(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let step = 10f64.powf(x.abs().log10().floor() - 1.0);
    let rounded = (x / step * (1.0 - 1e-12)).ceil() * step;
    if (1e-3..1e6).contains(&rounded) {
        let digits = (1.0 - rounded.log10().floor()).max(0.0) as usize;
        format!("{rounded:.digits$}")
    } else {
        format!("{rounded:.1e}")
    }
}

/// Lines as a table of Markdown.
pub fn markdown(headings: &[&str], lines: &[Vec<String>]) -> String {
    let mut text = String::new();
    let row = |cells: Vec<&str>| format!("| {} |\n", cells.join(" | "));
    text += &row(headings.to_vec());
    text += &row(vec!["---"; headings.len()]);
    for line in lines {
        assert_eq!(line.len(), headings.len());
        assert!(line.iter().all(|cell| !cell.trim().is_empty()), "an empty cell: {line:?}");
        text += &row(line.iter().map(String::as_str).collect());
    }
    text
}

/// Writes the pictures of a failure to `target/numerics` and says where.
fn show(name: &str, size: [usize; 2], got: &[f32], expected: &[f32]) -> String {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("numerics");
    let file = name.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    let difference: Vec<f32> = got.iter().zip(expected).map(|(got, expected)| got - expected).collect();
    let mut names = String::new();
    fs::create_dir_all(&folder).expect("the build's folder can be written");
    for (what, values) in [("got", got), ("expected", expected), ("difference", &difference)] {
        // Lists that are not a whole number of rows are one row.
        let size = if size[0] * size[1] == values.len() { size } else { [values.len(), 1] };
        let colors: Vec<[f32; 3]> = values.iter().map(|&value| [value; 3]).collect();
        let path = folder.join(format!("{file}-{what}.exr"));
        let bytes = epigraph_pictures::exr(size, &colors).expect("a picture of f32");
        fs::write(&path, bytes).expect("the build's folder can be written");
        write!(names, "{}{}", if names.is_empty() { "see " } else { ", " }, path.display()).expect("a text");
    }
    names
}

mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    fn one(exact: f64) -> Expected {
        Expected { exact, allowed: Interval { low: exact - 1.0, high: exact + 1.0 }, unit: 0.1 }
    }

    fn failure(run: impl FnOnce()) -> String {
        let error = catch_unwind(AssertUnwindSafe(run)).expect_err("it fails");
        error.downcast_ref::<String>().expect("a message").clone()
    }

    #[test]
    fn a_failure_leaves_what_was_got_and_expected_and_the_difference_as_pictures() {
        let mut measure = Measure::within("none", "a test", "-", "-", 2.0, Unit::Of("tenths"));
        measure.compare(Side::Cpu, "good", [2, 1], &[1.0, 2.125], &[one(1.0), one(2.0)]);
        let message = failure(|| {
            measure.compare(Side::Cpu, "bad", [2, 1], &[1.0, 2.75], &[one(1.0), one(2.0)]);
        });
        assert!(
            message.contains("number 1 of 2 is 2.75e0, exactly it is 2e0") && message.contains("7.500"),
            "{message}"
        );
        let read = |what: &str| {
            let mut path = message.split_whitespace().map(|word| word.trim_end_matches(','));
            let path = path.find(|word| word.ends_with(&format!("-{what}.exr"))).expect("named");
            let picture = epigraph_pictures::Picture::read(path.as_ref()).expect("a picture");
            picture.colors.iter().map(|color| color[0]).collect::<Vec<_>>()
        };
        assert_eq!((read("got"), read("expected")), (vec![1.0, 2.75], vec![1.0, 2.0]));
        assert_eq!(read("difference"), [0.0, 0.75]);
    }

    #[test]
    fn bounds_are_tight_and_both_sides_are_compared() {
        let measure = || {
            let mut measure =
                Measure::within("none", "a test", "-", "-", 2.0, Unit::Of("tenths")).on_cpu_only();
            measure.record(Side::Cpu, "a case", 0.9, 1);
            measure
        };
        assert!(failure(|| _ = measure().row()).contains("claim less"));
        let mut tight = measure();
        tight.record(Side::Cpu, "another", 1.0, 1);
        tight.row();
        let both = Measure { runs: [true; 2], bound: 1.0, ..measure() };
        assert!(failure(|| _ = both.row()).contains("a side was not compared"));
        assert!(failure(|| measure().record(Side::Cpu, "a third", 2.1, 1)).contains("an error of 2.1"));
    }

    #[test]
    fn not_a_number_and_other_words_are_failures() {
        let mut measure = Measure::exact("none", "bits", "-", "-");
        assert!(
            failure(|| measure.compare_words(Side::Cpu, "a", [1, 2], &[1, 2], &[1, 3]))
                .contains("1 of 2 differ")
        );
        let mut measure = Measure::within("none", "NaN", "-", "-", 1.0, Unit::Of("tenths"));
        failure(|| measure.compare(Side::Cpu, "NaN", [1, 1], &[f32::NAN], &[one(1.0)]));
    }

    #[test]
    fn figures_are_rounded_up_to_two_digits() {
        for (x, text) in
            [(0.0, "0"), (0.5, "0.50"), (0.501, "0.51"), (12.1, "13"), (3e-7, "3.0e-7"), (99.1, "100")]
        {
            assert_eq!(rounded_up(x), text);
        }
    }
}
