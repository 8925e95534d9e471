//! The points that are projected to a pixel, the nearest first.

use epigraph_core::{Finding, Site};

use super::{Project, ProjectParams, fallen};
use crate::shared::{
    cloud::NO_POINT,
    words::{count, metres, point},
};

/// Maximum number of points behind the nearest one that are listed.
const NAMED: usize = 3;

pub(super) fn at(stage: &Project, params: &ProjectParams, site: &Site) -> Option<Vec<Finding>> {
    let (id, depth) = (site.wrote(stage.id)?[site.at()], site.wrote(stage.depth)?[site.at()]);
    let (position, meta) = (site.read(stage.position)?, site.read(stage.meta)?);
    let fallen = fallen(&position, &meta, params.max_age, site.frame(), site.pixel);
    let mut findings = vec![Finding::value("point", point(id))];
    if id == NO_POINT {
        findings.push(Finding::Why("No point of the cloud falls into this pixel.".into()));
        return Some(findings);
    }
    let cells = 1 << (params.subpixel_bits / 2);
    let cell = site.wrote(stage.subpixel)?[site.at()];
    findings.push(Finding::value("distance", metres(f32::from_bits(depth))));
    let place = format!("({}, {}) of {cells}×{cells}", cell % cells, cell / cells);
    findings.push(Finding::value("cell", place));
    let behind: Vec<_> = fallen.iter().filter(|(_, other)| *other != id).collect();
    findings.push(Finding::Why(match behind.len() {
        0 => "The only point that falls into this pixel.".into(),
        others => {
            let named = behind.iter().take(NAMED).map(|(point, id)| format!("{id} at {}", metres(point.z)));
            let more = if others > NAMED { " and more" } else { "" };
            format!(
                "The nearest of {} that fall into this pixel. Behind it: {}{more}.",
                count(others + 1, "point"),
                named.collect::<Vec<_>>().join(", ")
            )
        }
    }));
    Some(findings)
}
