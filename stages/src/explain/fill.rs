//! The points from which a pixel's colour is computed, and the reason for its priority.

use epigraph_core::{Cell, Finding, Role, Site};

use super::{Empty, Fill, FillParams, Priority, REACH, WEIGHTS_SUM};
use crate::shared::{
    cloud::{AGE, AGE_ONE, NO_POINT, decode_radiance},
    words::count,
};

pub(super) fn at(stage: &Fill, params: &FillParams, site: &Site) -> Option<Vec<Finding>> {
    let at = site.at();
    let (id, radiance) = (site.read(stage.id)?, site.read(stage.radiance)?);
    let color = site.wrote(stage.color)?[at];
    let mut findings = vec![
        Finding::color("colour", &color),
        Finding::value("priority", format!("{} of 255", site.wrote(stage.priority)?[at])),
    ];
    let shown = |offset: [i32; 2]| {
        let point = id[site.beside(offset)?];
        (point != NO_POINT).then(|| radiance.get(point as usize).copied().map(decode_radiance))?
    };
    let within = |reach: i32| (-reach..=reach).flat_map(move |dy| (-reach..=reach).map(move |dx| [dx, dy]));
    let near: Vec<[i32; 2]> = within(1).filter(|offset| shown(*offset).is_some()).collect();
    // 4 for the centre, 2 for edges, 1 for corners.
    let weight = |[dx, dy]: [i32; 2]| 4 >> (dx.abs() + dy.abs()) as u32;
    let near_weight: u32 = near.iter().map(|offset| weight(*offset)).sum();
    let in_wide = || within(REACH as i32).filter(|offset| shown(*offset).is_some()).count();
    let wide = if params.wide { in_wide() } else { 0 };

    let own = id[at] != NO_POINT;
    let alone = own && params.keep_points;
    let reach = if near.is_empty() && params.wide { REACH as i32 } else { 1 };
    findings.push(site.around("Points around", reach, |offset| {
        let linear = shown(offset);
        let counts = linear.is_some() && (!alone || offset == [0, 0]);
        let role = match (counts, linear) {
            (true, _) => Role::Counts,
            (false, Some(_)) => Role::Apart,
            (false, None) => Role::None,
        };
        let text = if counts && reach == 1 { weight(offset).to_string() } else { String::new() };
        Cell { role, linear, text }
    }));
    let kernel = if params.wide { "7×7" } else { "3×3" };
    findings.push(Finding::Why(match (near.len(), wide) {
        _ if alone => "It shows its own point as it is.".into(),
        (1.., _) => {
            format!("The mean of {} in the 3×3 pixels, weights 4, 2 and 1.", count(near.len(), "point"))
        }
        (0, 1..) => format!("No point in the 3×3 pixels: the mean of {} in the 7×7.", count(wide, "point")),
        (0, 0) if params.empty == Empty::Hold => {
            format!("No point in the {kernel} pixels: the colour of the last frame.")
        }
        (0, 0) => format!("No point in the {kernel} pixels: black."),
    }));
    let missing = WEIGHTS_SUM - near_weight.min(WEIGHTS_SUM);
    findings.push(Finding::Why(match (own, params.priority) {
        (true, rule) => {
            let age = site.read(stage.meta)?.get(id[at] as usize)? & AGE;
            let how = if rule == Priority::Measured { "half that age" } else { "that age" };
            format!("Its point has age {:.1}: the priority is {how}.", age as f32 / AGE_ONE as f32)
        }
        (false, Priority::Measured) => format!(
            "It shows no point, and {missing}/{WEIGHTS_SUM} of the kernel's weight is missing: the priority is \
             255 times the sixth power of this share."
        ),
        (false, Priority::Classic) => format!(
            "It shows no point, and {missing}/{WEIGHTS_SUM} of the kernel's weight is missing: the priority is \
             255 times this share."
        ),
    }));
    Some(findings)
}
