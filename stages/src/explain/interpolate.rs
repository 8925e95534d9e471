//! The samples from which a pixel's colour is computed, and the reason for its priority.

use epigraph_core::{Cell, Finding, Role, Site};

use super::{
    Image, Interpolate, InterpolateParams, Priority, REACH, SPAN, Space, Weights, offsets, taps,
    without_point,
};
use crate::fill::with_point;
use crate::shared::{
    cloud::{AGE, AGE_ONE, NO_POINT},
    edge_pixel::{CLASS, COMPLEX},
    words::{count, percent},
};

pub(super) fn at(stage: &Interpolate, params: &InterpolateParams, site: &Site) -> Option<Vec<Finding>> {
    let at = site.at();
    let [_, _, _, share] = site.wrote(stage.color)?[at];
    let (id, subpixel) = (site.read(stage.id)?, site.read(stage.subpixel)?);
    let (cls, r24) = (site.read(stage.cls)?[at], site.read(stage.r24)?[at]);
    let radiance = site.read(stage.radiance)?;
    let weights = Weights::new(params);
    let taps = taps(cls, r24);

    let ([width, height], pixel) = (site.size(), site.pixel.map(|along| along as usize));
    // The cells show linear radiance, even if tone-mapped radiance is averaged.
    let image = Image {
        radiance: &radiance,
        mean: None,
        albedos: None,
        id: &id,
        subpixel: &subpixel,
        width,
        height,
        space: Space::Linear,
    };
    let sample = |offset| image.tap(&weights, pixel, offset);
    let counts = |[dx, dy]: [i32; 2]| {
        let tap = (dy + REACH as i32) * SPAN as i32 + dx + REACH as i32;
        taps >> tap & 1 != 0
    };
    let [.., total] = image.sum_at(&weights, pixel, taps);
    let (used, apart): (Vec<[i32; 2]>, Vec<_>) =
        offsets().filter(|offset| sample(*offset).is_some()).partition(|offset| counts(*offset));
    let (used, apart) = (used.len(), apart.len());

    let mut findings = vec![Finding::color("colour", &site.wrote(stage.color)?[at])];
    let priority = site.wrote(stage.priority)?[at];
    findings.push(Finding::value("weight", format!("{} of the kernel's", percent(share))));
    findings.push(Finding::value("priority", format!("{priority} of 255")));
    let cell = |offset| match sample(offset) {
        None => Cell::default(),
        Some((weight, linear)) if counts(offset) => {
            Cell { role: Role::Counts, linear: Some(linear), text: percent(weight / total) }
        }
        Some((_, linear)) => Cell { role: Role::Apart, linear: Some(linear), text: String::new() },
    };
    findings.push(site.around("Samples by weight; crossed out: not within reach", REACH as i32, cell));
    let apart = match apart {
        0 => String::new(),
        apart => format!(" {} nearby cannot be reached.", count(apart, "sample")),
    };
    findings.push(Finding::Why(match used {
        0 => format!("No sample within reach: the pixel is a hole.{apart}"),
        _ if cls & CLASS == COMPLEX => {
            format!("Complex, so its regions are unknown: the mean of all {} nearby.", count(used, "sample"))
        }
        _ => format!("The weighted mean of {}.{apart}", count(used, "sample")),
    }));
    let age = match id[at] {
        NO_POINT => None,
        point => Some(site.read(stage.meta)?.get(point as usize)? & AGE),
    };
    findings.push(Finding::Why(why_priority(params.priority, age, share)));
    if params.uncertain {
        let by_age = match age {
            Some(age) => with_point(params.priority, age),
            None => without_point(params.priority, share),
        };
        let factor = f64::from(priority) / f64::from(by_age.max(1));
        findings.push(Finding::Why(format!(
            "Its colour is so uncertain that the priority is {factor:.2} times that, at most 255."
        )));
    }
    Some(findings)
}

/// The reason for the priority, but for its uncertainty. `age` is the age of the pixel's own point, in 8.8 fixed point.
fn why_priority(rule: Priority, age: Option<u32>, share: f32) -> String {
    let missing = percent(1.0 - share);
    match (rule, age) {
        (Priority::Measured, Some(age)) => {
            format!("Its sample has age {:.1}: the priority is half that age.", age as f32 / AGE_ONE as f32)
        }
        (Priority::Classic, Some(age)) => {
            format!("Its sample has age {:.1}: that is the priority.", age as f32 / AGE_ONE as f32)
        }
        (Priority::Measured, None) => format!(
            "It has no sample of its own, and {missing} of the kernel's weight is missing: the priority is \
             255 times the sixth power of this share."
        ),
        (Priority::Classic, None) => format!(
            "It has no sample of its own, and {missing} of the kernel's weight is missing: the priority is \
             255 times this share."
        ),
    }
}
