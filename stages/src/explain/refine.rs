//! How much of the mean of a pixel's own samples the picture shows.

use epigraph_core::{Finding, Site};

use super::{FEWEST, FIRST, Refine, share_of_mean};
use crate::shared::{edge_pixel::DIRECTIONS, words::percent};

pub(super) fn at(stage: &Refine, site: &Site) -> Option<Vec<Finding>> {
    let at = site.at();
    let count = site.wrote(stage.count)?[at];
    let mut findings = vec![
        Finding::color("colour", &site.wrote(stage.refined)?[at]),
        Finding::color("before", &site.read(stage.color)?[at]),
    ];
    let number = count.saturating_sub(FIRST);
    if number < FEWEST {
        findings.push(Finding::Why(format!(
            "The pixel keeps its colour: since the camera rests, {number} samples were spread over it, and fewer than \
             {FEWEST} tell nothing."
        )));
        return Some(findings);
    }
    let evidence = site.wrote(stage.evidence)?;
    let around = DIRECTIONS.iter().filter_map(|&direction| site.beside(direction)).chain([at]);
    let share = share_of_mean(at, number, around, &evidence, &site.read(stage.color)?);
    findings.push(Finding::color(format!("mean of {number} samples"), &site.wrote(stage.mean)?[at]));
    let [noise, difference] = evidence[at].map(f32::sqrt);
    findings.push(Finding::value("its noise", format!("{noise:.4}")));
    findings.push(Finding::value("its difference", format!("{difference:.4}")));
    findings.push(Finding::Why(format!(
        "The mean replaces {} of the colour: the share of their difference, here and in the pixels around, that noise does \
         not explain.",
        percent(share)
    )));
    Some(findings)
}
