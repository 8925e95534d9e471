//! Reads what callgrind writes: how many instructions ran in each function and those that it called. The format is that of
//! <https://valgrind.org/docs/manual/cl-format.html>.

use std::collections::HashMap;

/// Instructions by function.
#[derive(Debug, Default, PartialEq)]
pub struct Profile(HashMap<String, u64>);

impl Profile {
    /// Reads a file.
    ///
    /// # Errors
    /// The first line that does not fit, with its number.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut names = HashMap::new();
        let mut inclusive = HashMap::new();
        let mut positions = 1;
        let mut lines = text.lines().enumerate();
        let mut callee = None;
        while let Some((number, line)) = lines.next() {
            let bad = || format!("line {}: {line}", number + 1);
            if let Some(kinds) = line.strip_prefix("positions:") {
                positions = kinds.split_whitespace().count();
            } else if let Some(name) = line.strip_prefix("fn=") {
                // Its costs are not needed, but the name may be.
                resolve(&mut names, name).ok_or_else(bad)?;
            } else if let Some(name) = line.strip_prefix("cfn=") {
                callee = Some(resolve(&mut names, name).ok_or_else(bad)?);
            } else if line.starts_with("calls=") {
                // The next line has what the calls cost altogether. Its first event is instructions.
                let callee = callee.take().ok_or_else(bad)?;
                let (_, costs) = lines.next().ok_or_else(bad)?;
                let cost: u64 =
                    costs.split(' ').nth(positions).and_then(|cost| cost.parse().ok()).ok_or_else(bad)?;
                *inclusive.entry(callee).or_default() += cost;
            }
        }
        Ok(Self(inclusive))
    }

    /// Instructions of a function and of all that it called; 0 if it was not called.
    pub fn of(&self, function: &str) -> u64 {
        self.0.get(function).copied().unwrap_or(0)
    }
}

/// The name that a `(number) name` defines, or that a `(number)` stands for.
fn resolve(names: &mut HashMap<String, String>, text: &str) -> Option<String> {
    let Some((id, name)) = text.strip_prefix('(').and_then(|text| text.split_once(')')) else {
        return Some(text.into());
    };
    match name.strip_prefix(' ') {
        Some(name) => {
            names.insert(id.into(), name.into());
            Some(name.into())
        }
        None => names.get(id).cloned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: main calls `a` twice and `b` once, `a` calls `b`. Functions and files have numbers of their own.
    const SAMPLE: &str = "\
version: 1
creator: by hand
positions: line
events: Ir

fl=(1) main.rs
fn=(1) main
3 5
cfi=(2) a.rs
cfn=(2) <a::A as Stage>::cpu
calls=2 10
4 130
cfn=(3) b (in b.rs)
calls=1 20
+1 7

fl=(2)
fn=(2)
10 100
cfn=(3)
calls=3 20
* 30

fn=(3)
20 37

totals: 142
";

    #[test]
    fn calls_count_with_all_that_they_call() {
        let profile = Profile::parse(SAMPLE).unwrap();
        assert_eq!(
            ["<a::A as Stage>::cpu", "b (in b.rs)", "main"].map(|name| profile.of(name)),
            [130, 37, 0]
        );
    }

    #[test]
    fn addresses_and_further_events_are_skipped() {
        let text =
            SAMPLE.replace("positions: line", "positions: instr line").replace("4 130", "0x1a 4 130 9");
        let text = text.replace("+1 7", "+2 +1 7 1").replace("* 30", "* * 30 2");
        assert_eq!(Profile::parse(&text), Profile::parse(SAMPLE));
    }

    #[test]
    fn what_does_not_fit_is_named_with_its_line() {
        for (good, bad, line) in [
            ("4 130", "4 many", "line 11: calls=2 10"),
            ("fn=(3)\n20", "fn=(4)\n20", "line 24: fn=(4)"),
            ("cfn=(2) <a::A as Stage>::cpu\n", "", "line 10: calls=2 10"),
            ("4 130\n", "", "line 11: calls=2 10"),
        ] {
            let text = SAMPLE.replace(good, bad);
            assert_ne!(text, SAMPLE);
            assert_eq!(Profile::parse(&text).unwrap_err(), line, "{bad}");
        }
    }
}
