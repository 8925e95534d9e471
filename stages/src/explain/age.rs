//! How much a point aged, and why.

use epigraph_core::{Finding, Site};

use super::{AGE_OF_EVICTION, Age, AgeParams, increment};
use crate::shared::cloud::{AGE, AGE_ONE, CHANGED, FRESH, LIVE, NOT_DRAWN};

pub(super) fn at(stage: &Age, params: &AgeParams, site: &Site) -> Option<Vec<Finding>> {
    let point = site.element?;
    let metas = site.wrote(stage.cloud_meta)?;
    let before = *site.before(stage.cloud_meta)?.get(point)?;
    let after = metas[point];
    let units = |age: u32| age as f32 / AGE_ONE as f32;
    let rate = site.wrote(stage.rate)?[0];
    let arrived = site.read(stage.arrived)?[0] as f32;
    let step = increment(rate, arrived, metas.len() as u32);
    let mut findings = vec![Finding::value("age", format!("{:.2} of 255", units(after & AGE)))];
    findings.push(Finding::Why(if before & LIVE == 0 {
        "The slot was empty.".into()
    } else if before & FRESH != 0 {
        "It entered the cloud in this frame, so it does not age yet.".into()
    } else {
        let mut parts = vec![format!(
            "{:.2} for the frame (about {rate:.0} of {} points are replaced in one)",
            units(step),
            metas.len()
        )];
        if before & AGE > 0 && site.read(stage.cloud_image_id)?[point] == NOT_DRAWN {
            let times = params.not_drawn_penalty;
            parts.push(format!("{times} times as much because no pixel showed it in the last frame"));
        }
        if before & CHANGED != 0 {
            parts.push(format!("{} because a colour changed near it", params.change_penalty));
        }
        let gone = after & LIVE == 0;
        let end = if gone {
            format!(" Points of age {} or more leave the cloud.", units(AGE_OF_EVICTION))
        } else {
            String::new()
        };
        format!("Its age was {:.2} and rises by {}.{end}", units(before & AGE), parts.join(", and "))
    }));
    Some(findings)
}
