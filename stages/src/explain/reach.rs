//! Which of the surrounding pixels a pixel reaches, and why it does not reach the others.

use epigraph_core::{Cell, Finding, Role, Site};

use super::{ALL_REACHED, Reach, bit_of};
use crate::shared::{
    edge_pixel::{CLASS, COMPLEX, SIMPLE},
    words::{NEIGHBOURS, count},
};

pub(super) fn at(stage: &Reach, site: &Site) -> Option<Vec<Finding>> {
    let at = site.at();
    let (n8, r24, cls) = (site.wrote(stage.n8)?[at], site.wrote(stage.r24)?[at], site.read(stage.cls)?);
    let joined = |bit: u32| {
        let names = (0..8).filter(|d| n8 >> (4 * d) & bit != 0).map(|d| NEIGHBOURS[d]);
        names.collect::<Vec<_>>().join(", ")
    };
    let mut findings = vec![Finding::value("reaches", format!("{} of 24", r24.count_ones()))];
    if r24 != ALL_REACHED {
        // The rows of the matrices: the neighbours joined to the primary region, and those joined to the secondary one.
        let [primary, secondary] = [joined(0b0011), joined(0b1100)];
        let or_none = |names: String| if names.is_empty() { "nothing".into() } else { names };
        findings.push(Finding::value("joins", or_none(primary)));
        if cls[at] & CLASS == SIMPLE {
            findings.push(Finding::value("other side", or_none(secondary)));
        }
    }
    let cell = |offset: [i32; 2]| {
        let role = match site.beside(offset) {
            None => Role::None,
            Some(_) if offset == [0, 0] || r24 & bit_of(offset) != 0 => Role::Counts,
            Some(_) => Role::Apart,
        };
        Cell { role, ..Cell::default() }
    };
    findings.push(site.around("Reached pixels", 2, cell));

    let [mut outside, mut complex, mut parted] = [0; 3];
    let offsets = (-2..=2).flat_map(|dy| (-2..=2).map(move |dx| [dx, dy]));
    for offset in offsets.filter(|offset| *offset != [0, 0] && r24 & bit_of(*offset) == 0) {
        match site.beside(offset) {
            None => outside += 1,
            Some(at) if cls[at] & CLASS == COMPLEX => complex += 1,
            Some(_) => parted += 1,
        }
    }
    let reasons = [
        (parted, "beyond an edge, or on paths that turn too much"),
        (complex, "complex, and so not joined to others"),
        (outside, "outside the image"),
    ];
    let reasons = reasons.iter().filter(|(number, _)| *number > 0);
    let reasons: Vec<String> = reasons.map(|(number, why)| format!("{number} {why}")).collect();
    findings.push(Finding::Why(if cls[at] & CLASS == COMPLEX {
        "The pixel is complex: its regions are unknown, so it reaches no other pixel.".into()
    } else if reasons.is_empty() {
        "No edge separates it from any of the 5×5 pixels.".into()
    } else {
        let missing = 24 - r24.count_ones() as usize;
        format!("{} cannot be reached: {}.", count(missing, "pixel"), reasons.join("; "))
    }));
    Some(findings)
}
