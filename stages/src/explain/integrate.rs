//! Whether a point entered the cloud in this frame, and whether a colour changed near the pixel.

use epigraph_core::{Finding, Site};

use super::{Integrate, IntegrateParams, REACH};
use crate::shared::{
    cloud::{CHANGED, FRESH, decode_radiance},
    words::place,
};

pub(super) fn at(stage: &Integrate, params: &IntegrateParams, site: &Site) -> Option<Vec<Finding>> {
    let mut findings = Vec::new();
    let stamp = site.frame().index.wrapping_add(1);
    if site.wrote(stage.changed)?[site.at()] == stamp {
        let side = 2 * REACH + 1;
        findings.push(Finding::Why(format!(
            "A new sample in the {side}×{side} pixels differs by more than {} in tone-mapped luma from the point \
             that it renews, so the points shown here count as changed.",
            params.threshold
        )));
    }
    if let Some(point) = site.element {
        let meta = *site.wrote(stage.cloud_meta)?.get(point)?;
        if meta & FRESH != 0 {
            let [x, y, z, _] = site.wrote(stage.cloud_position)?[point];
            findings.push(Finding::value("sample", place([x, y, z])));
            findings
                .push(Finding::color("radiance", &decode_radiance(site.wrote(stage.cloud_radiance)?[point])));
            findings
                .push(Finding::Why("The sample arrived in the last frame and takes this slot now.".into()));
        } else if meta & CHANGED != 0 {
            findings.push(Finding::value("point", "flagged as changed"));
        }
    }
    Some(findings)
}
