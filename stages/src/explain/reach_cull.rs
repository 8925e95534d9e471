//! Why a sample was culled or stays: its distance compared with those of the samples that it reaches.

use epigraph_core::{Cell, Finding, Role, Site};
use fearless_simd::Level;

use super::{ReachCull, ReachCullParams, Samples};
use crate::shared::{
    cloud::NO_POINT,
    words::{metres, point},
};

pub(super) fn at(stage: &ReachCull, params: &ReachCullParams, site: &Site) -> Option<Vec<Finding>> {
    let at = site.at();
    let (kept, depth, r24) = (site.read(stage.kept)?, site.read(stage.depth)?, site.read(stage.r24)?);
    let id = site.wrote(stage.id)?[at];
    let mut findings = vec![Finding::value("point", point(id))];
    if kept[at] == NO_POINT {
        findings.push(Finding::Why("There is no sample here to cull.".into()));
        return Some(findings);
    }
    // Each pass compares samples with those that the pass before left, so all passes up to the deciding one run again.
    let [width, height] = site.size();
    let (scale, level) = (1.0 + params.threshold, Level::baseline());
    let mut left = kept.to_vec();
    let mut pass = 0;
    while pass + 1 < params.passes {
        let mut next = vec![NO_POINT; left.len()];
        Samples { id: &left, depth: &depth, r24: &r24, width, height, scale, level }.cull(0, None, &mut next);
        if next[at] == NO_POINT {
            break;
        }
        left = next;
        pass += 1;
    }
    let samples = Samples { id: &left, depth: &depth, r24: &r24, width, height, scale, level };
    let [x, y] = site.pixel.map(|along| along as usize);
    let [voters, nearer] = samples.ballot(x, y);
    let z = f32::from_bits(depth[at]);
    let limit = format!("clearly nearer than its {}: below {}", metres(z), metres(z / scale));
    findings.push(Finding::Why(match (id == NO_POINT, voters) {
        (true, _) => format!(
            "Culled in pass {}: {nearer} of the {voters} samples within reach are {limit}. Half of them are enough.",
            pass + 1
        ),
        _ if params.passes == 0 => "Stays: nothing is culled with `passes: 0`.".into(),
        (false, 0) => "Stays: there is no other sample within reach.".into(),
        (false, _) => {
            format!("Stays: {nearer} of the {voters} samples within reach are {limit}. Half would cull it.")
        }
    }));
    let cell = |offset: [i32; 2]| {
        let Some(other) = site.beside(offset).filter(|other| left[*other] != NO_POINT) else {
            return Cell::default();
        };
        let z_other = f32::from_bits(depth[other]);
        let role = match offset {
            [0, 0] => Role::Counts,
            _ if r24[at] & crate::reach::bit_of(offset) == 0 => Role::Apart,
            _ if z_other * scale < z => Role::Against,
            _ => Role::Counts,
        };
        Cell { role, text: metres(z_other), linear: None }
    };
    findings.push(site.around("Samples around; red: clearly nearer, grey: not within reach", 2, cell));
    Some(findings)
}
