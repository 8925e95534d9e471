//! Whether the pixel asks for a sample.

use epigraph_core::{Finding, Site};

use super::{Dither, Kind};
use crate::shared::{
    cloud::NO_POINT,
    requests::{NO_PIXEL, VIEW_PREDICTED},
    words::{aim, count},
};

pub(super) fn at(stage: &Dither, kind: Kind, site: &Site) -> Option<Vec<Finding>> {
    let requests = site.wrote(stage.requests)?;
    let asked = requests.iter().filter(|request| request.pixel != NO_PIXEL).count();
    let mut findings = Vec::new();
    for request in requests.iter().filter(|request| request.pixel as usize == site.at()) {
        let [x, y] = aim(request.aim);
        let place = format!("at ({x:.2}, {y:.2}) of the pixel");
        let what = match request.reuse {
            _ if request.view == VIEW_PREDICTED => "of the predicted view".into(),
            NO_POINT => "for a pixel without a point".into(),
            point => format!("to renew point {point}"),
        };
        findings.push(Finding::value("request", format!("{place}, {what}")));
    }
    let chosen = match kind {
        Kind::Systematic => "picked in proportion to priority along a space-filling curve",
        Kind::BlueNoise => "picked by priority and a mask of blue noise",
        Kind::Serpentine => "picked by error diffusion of the priorities",
    };
    let its = if findings.is_empty() { "none of them is" } else { "one of them is" };
    let mut why = format!("{} in this frame, {chosen}: {its} for this pixel.", count(asked, "request"));
    // `None` if the priorities arrive late: the requests were then chosen by older ones.
    if let Some(priority) = site.read(stage.priority) {
        let total: u64 = priority.iter().map(|&priority| u64::from(priority)).sum();
        let expected = asked as f64 * f64::from(priority[site.at()]) / total.max(1) as f64;
        why += &format!(" Its priority of {} is {:.0}% of a request.", priority[site.at()], 100.0 * expected);
    }
    findings.push(Finding::Why(why));
    Some(findings)
}
