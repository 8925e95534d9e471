//! Which colours a pixel mixes that an edge cuts in two.

use epigraph_core::{Finding, Site};

use super::{Antialias, AntialiasParams, Neighbour, weights};
use crate::shared::{
    edge_pixel::{CLASS, DIRECTIONS, PIXEL_AREA, SIMPLE, primary_area},
    words::{NEIGHBOURS, percent},
};

pub(super) fn at(stage: &Antialias, params: &AntialiasParams, site: &Site) -> Option<Vec<Finding>> {
    let at = site.at();
    let (cls, n8, primary) = (site.read(stage.cls)?[at], site.read(stage.n8)?[at], site.read(stage.primary)?);
    let mut findings = vec![Finding::color("colour", &site.wrote(stage.color)?[at])];
    let why = |text: &str| Finding::Why(text.into());
    if cls & CLASS != SIMPLE {
        findings.push(why("The pixel keeps its colour: it is not simple, that is, cut in two by one edge."));
        return Some(findings);
    }
    if params.neighbour == Neighbour::Off {
        findings.push(why("The pixel keeps its colour, as anti-aliasing is off (`neighbour: Off`)."));
        return Some(findings);
    }
    let share = primary_area(cls) as f32 / PIXEL_AREA as f32;
    let weights = weights(params.neighbour, cls, n8, |d| site.beside(DIRECTIONS[d]).is_some());
    let total: f32 = weights.iter().sum();
    if total == 0.0 {
        findings.push(why(
            "The pixel keeps its colour: no neighbour beyond its edge is joined to its secondary region.",
        ));
        return Some(findings);
    }
    findings.push(Finding::color(format!("own, {}", percent(share)), &primary[at]));
    let mut names = Vec::new();
    for (d, weight) in weights.into_iter().enumerate().filter(|(_, weight)| *weight > 0.0) {
        let weight = (1.0 - share) * weight / total;
        let beyond = &primary[site.beside(DIRECTIONS[d])?];
        findings.push(Finding::color(format!("{}, {}", NEIGHBOURS[d], percent(weight)), beyond));
        names.push(NEIGHBOURS[d]);
    }
    findings.push(Finding::Why(format!(
        "An edge cuts it: {} of its area has its own colour, the rest the colour beyond the edge ({}).",
        percent(share),
        names.join(" and ")
    )));
    Some(findings)
}
