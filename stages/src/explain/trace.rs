//! The sample that was traced for the pixel, if any.

use epigraph_core::{Finding, Site};

use super::Trace;
use crate::shared::{
    requests::{HIT_NONE, HIT_SURFACE, VIEW_LATE, VIEW_PREDICTED},
    words::place,
};

pub(super) fn at(stage: &Trace, site: &Site) -> Option<Vec<Finding>> {
    let samples = site.wrote(stage.samples)?;
    let mut findings = Vec::new();
    for sample in samples.iter().filter(|sample| sample.hit != HIT_NONE && sample.pixel as usize == site.at())
    {
        let view = match sample.view {
            VIEW_PREDICTED => ", of the predicted view",
            VIEW_LATE => ", requested in an earlier frame",
            _ => "",
        };
        let what = match (sample.hit, sample.body) {
            (HIT_SURFACE, 0) => format!("a surface at {}{view}", place(sample.position)),
            (HIT_SURFACE, body) => format!("moving body {body} at {}{view}", place(sample.position)),
            _ => format!("nothing in direction {}{view}", place(sample.position)),
        };
        findings.push(Finding::value("ray hit", what));
        findings.push(Finding::color("radiance", &sample.radiance));
        findings.push(Finding::Why("It enters the cloud in the next frame.".into()));
    }
    Some(findings)
}
