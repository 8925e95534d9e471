//! Where edges cross a pixel's sides, which edges these are, and which of them are hidden.

use std::sync::atomic::AtomicU32;

use epigraph_core::{Finding, Site};

use super::{DepthTest, EdgeRaster, EdgeRasterParams, Image, Lines, List, SHADOWS, VERTEX};
use crate::shared::{
    edge_pixel::ring_at,
    words::{count, crossings, metres},
};

/// Maximum number of listed edges.
const MOST_LISTED: usize = 6;

pub(super) fn at(stage: &EdgeRaster, params: &EdgeRasterParams, site: &Site) -> Option<Vec<Finding>> {
    let mask = site.wrote(stage.mask)?;
    let vertex = site.wrote(stage.vertex)?[site.at()];
    let filtered = site.read(stage.filtered)?;
    let width = site.size()[0];
    let ring = ring_at(&mask, site.pixel, width);

    let sides = ["top", "right", "bottom", "left"];
    let crossed = (0..4).filter_map(|side| {
        let slots = ring >> (8 * side) & 0xFF;
        (slots != 0).then(|| format!("{} {}", slots.count_ones(), sides[side as usize]))
    });
    let crossed = crossed.collect::<Vec<_>>().join(", ");
    let crossed = if ring == 0 { "none".into() } else { crossed };
    let mut findings = vec![Finding::value("crossings", crossed)];
    if ring != 0 {
        findings.push(Finding::Sketch(crossings(ring)));
    }
    if vertex & VERTEX != 0 {
        let [x, y] = [vertex & 0xFF, vertex >> 8 & 0xFF].map(|along| along as f32 / 16.0);
        findings.push(Finding::value("vertex", format!("at ({x:.2}, {y:.2}) of the pixel")));
    }

    let nothing: [AtomicU32; 0] = [];
    let image = Image {
        view: site.frame().view,
        size: site.frame().size.map(|side| side as i32),
        depth_test: params.depth_test,
        max_penumbra: params.max_penumbra,
        halves: 0,
        filtered: &filtered,
        mask: &nothing,
        vertex: &nothing,
    };
    let mut found = Vec::new();
    for list in [&stage.silhouettes, &stage.shadows].into_iter().flatten() {
        edges(&image, list, site, &mut found)?;
    }
    let depth = metres(filtered[site.at()]);
    findings.push(Finding::Why(match found.len() {
        0 => "No edge, visible or hidden, crosses the sides of this pixel.".into(),
        many => {
            let more =
                if many > MOST_LISTED { format!("; and {} more", many - MOST_LISTED) } else { String::new() };
            found.truncate(MOST_LISTED);
            let test = match params.depth_test {
                DepthTest::Off => "No edge is hidden (`depth_test: Off`)".into(),
                _ => {
                    format!("Edges farther than the depth beside a side are hidden; this pixel's is {depth}")
                }
            };
            format!(
                "{} its sides: {}{more}. {test}.",
                count(many, "edge") + if many == 1 { " meets" } else { " meet" },
                found.join("; ")
            )
        }
    }));
    Some(findings)
}

/// Appends a description of each edge of a list that crosses the pixel's sides, hidden or not.
fn edges(image: &Image, list: &List, site: &Site, found: &mut Vec<String>) -> Option<()> {
    let [x, y] = site.pixel.map(|along| along as i32);
    let segments = site.read(list.segments)?;
    let count = match list.count {
        Some(count) => site.read(count)?[0] as usize,
        None => segments.len(),
    };
    let what = if list.names.meaning == SHADOWS.meaning { "shadow of edge" } else { "edge" };
    for segment in segments.iter().take(count) {
        let Some(snapped) = image.snap(segment) else { continue };
        let mut meets = false;
        let mut shown = false;
        let mut soft = false;
        let mut nearest = f32::INFINITY;
        for (axis, first, along) in [(0, x, y), (1, y, x)] {
            let lines = Lines::new(&snapped, axis, image.size[axis], 0);
            for line in (first..=first + 1).filter(|line| (lines.first..=lines.last).contains(line)) {
                let crossing = lines.crossing(line, axis == 0);
                if crossing.slot < 0 || crossing.slot >> 3 != along {
                    continue;
                }
                let mut owner = [x, y];
                owner[axis] = line;
                meets = true;
                nearest = nearest.min(crossing.z);
                let sharp = snapped.penumbra <= image.max_penumbra * crossing.z;
                soft |= !sharp;
                shown |= sharp && image.is_shown(crossing.z, owner, axis);
            }
        }
        if meets {
            let state = match (shown, soft) {
                (true, _) => "visible",
                (false, true) => "its penumbra too wide for an edge",
                (false, false) => "hidden",
            };
            found.push(format!("{what} {} at {}, {state}", segment.edge, metres(nearest)));
        }
    }
    Some(())
}
