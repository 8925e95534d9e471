//! Why a point was culled or stays: its distance compared with those of the points around it.

use epigraph_core::{Cell, Finding, Role, Site};
use fearless_simd::Level;

use super::{DepthCull, DepthCullParams, Image, Rule, ZBuffer};
use crate::{
    project::EMPTY_DEPTH,
    shared::{
        cloud::NO_POINT,
        words::{metres, percent, point},
    },
};

pub(super) fn at(stage: &DepthCull, params: &DepthCullParams, site: &Site) -> Option<Vec<Finding>> {
    let at = site.at();
    let (before, id) = (site.before(stage.id)?[at], site.wrote(stage.id)?[at]);
    let depth = &site.read(stage.depth)?[..];
    let mut findings = vec![
        Finding::value("point", point(id)),
        Finding::value("edge depth", metres(site.wrote(stage.filtered)?[at])),
    ];
    if before == NO_POINT {
        findings.push(Finding::Why("There is no point here to cull.".into()));
        return Some(findings);
    }
    let z = f32::from_bits(depth[at]);
    let [width, height] = site.size();
    let pixel = site.pixel.map(|along| along as usize);
    let level = Level::baseline();
    let image = |depth| Image { depth, width, height, level };
    let far = site.frame().view.far;
    match params.rule {
        Rule::Majority => {
            let first_vote = &site.wrote(stage.first_vote?)?[..];
            let first = first_vote[at] == EMPTY_DEPTH;
            let deciding = if first { depth } else { first_vote };
            findings.extend(vote(image(deciding), params.threshold, z, id == NO_POINT, first, site));
        }
        Rule::Relative => {
            let mean = image(depth).mean_at(pixel, |z| z);
            let limit = mean.map(|mean| mean * (1.0 + params.threshold));
            findings.push(beyond(
                z,
                limit,
                id == NO_POINT,
                &format!("{} farther than", percent(params.threshold)),
            ));
        }
        Rule::SeedExact => {
            let buffer = ZBuffer { near: site.frame().view.near, far };
            let mean = image(depth).mean_at(pixel, |z| buffer.depth(z));
            let limit = mean.map(|mean| buffer.distance(buffer.shift(params.threshold, mean)));
            let shift = format!("{} behind", metres(params.threshold * (far - buffer.near)));
            findings.push(beyond(z, limit, id == NO_POINT, &shift));
        }
    }
    Some(findings)
}

/// The vote that decided, and the points that voted.
fn vote(image: Image, threshold: f32, z: f32, is_dropped: bool, first: bool, site: &Site) -> [Finding; 2] {
    let scale = 1.0 + threshold;
    let [x, y] = site.pixel.map(|along| along as usize);
    let [voters, nearer] = image.ballot(x, y, scale);
    let enough = image.majority(x, y, voters);
    let limit = format!("clearly nearer than its {}: below {}", metres(z), metres(z / scale));
    let why = match (is_dropped, voters) {
        (true, _) => {
            let vote = if first { "first" } else { "second" };
            format!(
                "Culled in the {vote} vote: {nearer} of the {voters} other points in the 5×5 pixels are {limit}. \
                 {enough} are enough to cull it."
            )
        }
        (false, 0) => "Stays: there is no other point in the 5×5 pixels.".into(),
        (false, _) => format!(
            "Stays: {nearer} of the {voters} other points in the 5×5 pixels are {limit}. {enough} would cull it."
        ),
    };
    let cell = |offset| {
        let depth = site.beside(offset).map_or(EMPTY_DEPTH, |at| image.depth[at]);
        let other = f32::from_bits(depth);
        match depth {
            EMPTY_DEPTH => Cell::default(),
            _ if other * scale < z => Cell { role: Role::Against, text: metres(other), linear: None },
            _ => Cell { role: Role::Counts, text: metres(other), linear: None },
        }
    };
    [Finding::Why(why), site.around("Points around; red: clearly nearer", 2, cell)]
}

/// The outcome of a rule that compares with a mean.
fn beyond(z: f32, limit: Option<f32>, is_dropped: bool, shift: &str) -> Finding {
    let limit = limit.unwrap_or(f32::INFINITY);
    let (what, how) = if is_dropped { ("Culled", "beyond") } else { ("Stays", "within") };
    Finding::Why(format!(
        "{what}: {} is {how} {}, which is {shift} the mean of the 3×3 pixels.",
        metres(z),
        metres(limit)
    ))
}
