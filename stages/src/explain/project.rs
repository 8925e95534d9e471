//! What the projection did at a pixel: every point that falls into it, the nearest first.

use epigraph_core::{Finding, Site};

use super::{Project, ProjectParams, is_drawn};
use crate::shared::{
    cloud::NO_POINT,
    view::{SEVERAL, Several},
    words::{count, metres, point},
};

/// How many of the points behind are named.
const NAMED: usize = 3;

pub(super) fn at(stage: &Project, params: &ProjectParams, site: &Site) -> Option<Vec<Finding>> {
    let (id, depth) = (site.wrote(stage.id)?[site.at()], site.wrote(stage.depth)?[site.at()]);
    let fallen = fallen(&site.read(stage.position)?, &site.read(stage.meta)?, params, site);
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
            let named = behind.iter().take(NAMED).map(|(z, id)| format!("{id} at {}", metres(*z)));
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

/// Distance and id of the points that fall into the pixel, the nearest first and of equally near ones the lowest id.
fn fallen(position: &[[f32; 4]], meta: &[u32], params: &ProjectParams, site: &Site) -> Vec<(f32, u32)> {
    let frame = site.frame();
    let mut fallen = Vec::new();
    for (chunk, position) in position.chunks(SEVERAL).enumerate() {
        let several = Several::project(&frame.view, position, frame.size);
        for i in 0..position.len() {
            let id = chunk * SEVERAL + i;
            if let Some(point) = several.get(i)
                && is_drawn(meta[id], params.max_age)
                && point.pixel() == site.pixel
            {
                fallen.push((point.z, id as u32));
            }
        }
    }
    fallen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    fallen
}
