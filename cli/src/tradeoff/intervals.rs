//! The answers of searches, drawn: how many samples per frame each graph needs, or which value of a parameter, with the
//! interval.

use epigraph_pictures::svg::{Anchor, Svg};

use super::{
    cell::{Found, Reached},
    plot::{self, LETTER, MARGIN, heading},
    results::short,
};
use crate::{
    axis::Axis,
    svg::{GRID, HEADING, LABEL, LINES, QUIET},
};

/// Width of the axis, and distance from one answer to the next.
const WIDTH: f64 = 560.0;
const STEP: f64 = 26.0;
/// Room for the numbers of the axis below a panel.
const NUMBERS: f64 = 30.0;
/// Room for the words at the end of an answer.
const WORDS: f64 = 190.0;
/// Half the height of an interval's ends.
const END: f64 = 4.0;

/// A panel for each search and view, with a line for each variation of a graph. `None` if there are no answers.
pub fn intervals(doc: &str, found: &[Found]) -> Option<String> {
    let letters = found.iter().map(|found| found.cell.variation().chars().count()).max()?;
    let left = MARGIN + LETTER * letters as f64 + 12.0;
    let width = left + WIDTH + WORDS + MARGIN;
    let mut svg = Svg::default();
    let about = "samples per frame, or values of a parameter; lines: the interval in which the answer is, dots: the most \
                 likely one; arrows: it is beyond what was tried";
    let mut y = heading(&mut svg, doc, about, width) + 18.0;
    let mut panels: Vec<(String, Vec<&Found>)> = Vec::new();
    for answer in found {
        let Found { cell, over, column, target, .. } = answer;
        let title = format!("{column} {target} over {over}: {}", cell.view());
        match panels.iter_mut().find(|(known, _)| *known == title) {
            Some((_, answers)) => answers.push(answer),
            None => panels.push((title, vec![answer])),
        }
    }
    let mut is_empty = true;
    for (title, answers) in &panels {
        // Panels of one quantity share a scale.
        let alike = || {
            found.iter().filter(|other| other.over == answers[0].over).flat_map(|other| other.result.values())
        };
        let logarithmic = alike().all(|value| value > 0.0);
        let Some(axis) = Axis::new(alike(), logarithmic, [left, left + WIDTH]) else { continue };
        is_empty = false;
        svg.text([MARGIN, y], title, Anchor::Start, HEADING);
        let (top, bottom) = (y + 10.0, y + 16.0 + STEP * answers.len() as f64);
        for value in axis.ticks() {
            let x = axis.at(value);
            svg.line([x, top], [x, bottom], GRID, 1.0);
            svg.text([x, bottom + 15.0], &plot::short(value), Anchor::Middle, QUIET);
        }
        for (nth, answer) in answers.iter().enumerate() {
            let y = top + STEP * (nth as f64 + 0.5) + 3.0;
            svg.text([left - 10.0, y + 4.0], &answer.cell.variation(), Anchor::End, LABEL);
            draw(&mut svg, &answer.result, &axis, LINES[nth % LINES.len()], [left, y]);
        }
        y = bottom + NUMBERS + 20.0;
    }
    (!is_empty).then(|| svg.finish([width, y - 14.0]))
}

fn draw(svg: &mut Svg, answer: &Reached, axis: &Axis, color: &str, [left, y]: [f64; 2]) {
    let beside = left + WIDTH + 10.0;
    let words = match answer {
        Reached::Within { value, interval, .. } => {
            let [low, high] = interval.map(|value| axis.at(value));
            svg.line([low, y], [high, y], color, 2.4);
            for x in [low, high] {
                svg.line([x, y - END], [x, y + END], color, 1.6);
            }
            svg.dot([axis.at(*value), y], 4.0, color);
            let [low, high] = interval.map(short);
            format!("{} ({low} to {high})", short(*value))
        }
        Reached::Below(value) => {
            arrow(svg, axis.at(*value), y, -1.0, color);
            format!("below {}", short(*value))
        }
        Reached::Above(value) => {
            arrow(svg, axis.at(*value), y, 1.0, color);
            format!("above {}", short(*value))
        }
        Reached::Failed(_) => "failed".to_owned(),
    };
    svg.text([beside, y + 4.0], &words, Anchor::Start, QUIET);
}

/// An arrow from the last value that was tried.
fn arrow(svg: &mut Svg, x: f64, y: f64, way: f64, color: &str) {
    let tip = x + 22.0 * way;
    svg.line([x, y], [tip, y], color, 2.4);
    svg.line([x, y - END], [x, y + END], color, 1.6);
    svg.polygon(&[[tip + 6.0 * way, y], [tip - 2.0 * way, y - 5.0], [tip - 2.0 * way, y + 5.0]], color);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tradeoff::cell::{Figures, tests::cell};

    fn found(graph: &str, over: &str, result: Reached) -> Found {
        let (cell, column) = (cell(graph, 0, 0), "flip".into());
        Found { key: graph.into(), cell, over: over.into(), column, target: 0.04, result }
    }

    fn within(value: f64, interval: [f64; 2]) -> Reached {
        Reached::Within { value, interval, figures: Figures::new() }
    }

    #[test]
    fn answers_have_intervals_or_arrows() {
        let all = [
            found("epi", "samples", within(209.4, [192.0, 246.0])),
            found("render-cache", "samples", Reached::Above(9216.0)),
            found("mine", "samples", Reached::Below(9.0)),
            found("epi", "sigma", within(0.25, [0.0, 0.5])),
        ];
        let svg = intervals("What?", &all).unwrap();
        for text in [
            "flip 0.04 over samples: cornell, orbit, 10x10",
            "209.4 (192 to 246)",
            "above 9216",
            "below 9",
            "flip 0.04 over sigma: cornell, orbit, 10x10",
            "0.25 (0 to 0.5)",
        ] {
            assert!(svg.contains(&format!(">{text}<")), "{text} is not in {svg}");
        }
        assert_eq!((svg.matches("<circle").count(), svg.matches("<polygon").count()), (2, 2));
        assert!(intervals("What?", &[]).is_none());
        let failed = found("epi", "samples", Reached::Failed("no".into()));
        assert!(intervals("What?", &[failed]).is_none(), "nothing to draw");
    }
}
