//! The bytes that a pixel shows.

use epigraph_core::{Finding, Site};

use super::{Tonemap, TonemapParams, auto};

pub(super) fn at(stage: &Tonemap, params: &TonemapParams, site: &Site) -> Option<Vec<Finding>> {
    let [r, g, b, _] = site.wrote(stage.image)?[site.at()];
    let linear = site.read(stage.color)?[site.at()];
    let mut findings = vec![Finding::value("sRGB", format!("{r}, {g}, {b}"))];
    let gain = match (params.exposure, &stage.auto) {
        (None, Some(auto)) => {
            let gain = auto::gain(site.wrote(auto.white)?[0]);
            findings.push(Finding::value("exposure", format!("{:+.2} EV, Auto", gain.log2())));
            gain
        }
        (exposure, _) => exposure.unwrap_or_default().exp2(),
    };
    let brightest = linear[..3].iter().fold(0f32, |most, channel| most.max(channel * gain));
    if linear[..3].iter().any(|channel| channel.is_nan()) {
        findings.push(Finding::Why("Its radiance is not a number (NaN), which is shown as magenta.".into()));
    } else if brightest > 1.0 && [r, g, b].contains(&255) {
        findings.push(Finding::Why(format!("Too bright for the screen: {brightest:.2} is clamped to 1.")));
    }
    Some(findings)
}
