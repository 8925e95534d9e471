//! The class of a pixel, a drawing of its edge, and whether its sample counts.

use epigraph_core::{Finding, Mark, Site};

use super::{Ambiguous, Bend, Classify, ClassifyParams, Grid};
use crate::shared::{
    cloud::NO_POINT,
    edge_pixel::{
        AMBIGUOUS, CLASS, COMPLEX, Chord, PIXEL_AREA, SIMPLE, VALID, ends, primary_area, ring_at,
        slot_position,
    },
    words::{aim, count, crossings, percent},
};

pub(super) fn at(stage: &Classify, params: &ClassifyParams, site: &Site) -> Option<Vec<Finding>> {
    let at = site.at();
    let ring = ring_at(&site.read(stage.mask)?, site.pixel, site.size()[0]);
    let (cls, target) = (site.wrote(stage.cls)?[at], site.wrote(stage.aim)?[at]);
    let has_sample = site.read(stage.id)?[at] != NO_POINT;
    let cell = site.read(stage.subpixel)?[at];
    let vertex = match stage.vertex {
        Some(vertex) => site.read(vertex)?[at],
        None => 0,
    };
    let grid = Grid { log2: params.subpixel_bits / 2, guess: params.ambiguous == Ambiguous::Guess };

    let crossed = ring.count_ones() as usize;
    let class = match cls & CLASS {
        SIMPLE => "simple: an edge cuts it in two".into(),
        COMPLEX => format!("complex: {}, so its regions are unknown", count(crossed, "crossing")),
        _ if crossed == 1 => "empty: an edge ends within it, but does not cut it".into(),
        _ => "empty: no edge crosses it".to_owned(),
    };
    let mut findings = vec![Finding::value("class", class)];
    let mut marks = Vec::new();
    if has_sample {
        let size = 1.0 / (1 << grid.log2) as f32;
        let corner = grid.place(cell).map(|index| index as f32 * size);
        marks.push(Mark::Sample([corner, corner.map(|along| along + size)]));
    }
    if cls & CLASS == SIMPLE {
        let share = primary_area(cls) as f32 / PIXEL_AREA as f32;
        let side = if cls & VALID != 0 { "its sample's side" } else { "the larger side" };
        findings.push(Finding::value("primary", format!("{} of the pixel, {side}", percent(share))));
        marks.extend(edge(cls, vertex));
        let [x, y] = aim(target);
        findings.push(Finding::value("next aim", format!("at ({x:.2}, {y:.2}) of the pixel")));
        marks.push(Mark::Aim([x, y]));
    }
    if ring != 0 {
        marks.extend(crossings(ring));
        findings.push(Finding::Sketch(marks));
    }
    findings.push(Finding::Why(why(cls, has_sample, grid)));
    Some(findings)
}

/// The edge of a simple pixel: its chord, or two lines if it bends.
fn edge(cls: u32, vertex: u32) -> Vec<Mark> {
    let [p, q] = ends(cls);
    let [first, last] = [p, q].map(slot_position);
    let share = |place: [i32; 2]| place.map(|along| along as f32 / 16.0);
    match Bend::new(Chord::new(p, q), [first, last], vertex) {
        None => vec![Mark::Edge([share(first), share(last)])],
        Some(_) => {
            let corner = [vertex & 0xFF, vertex >> 8 & 0xFF].map(|along| along as f32 / 16.0);
            vec![Mark::Edge([share(first), corner]), Mark::Edge([corner, share(last)])]
        }
    }
}

/// Whether the pixel has a sample that counts, and why.
fn why(cls: u32, has_sample: bool, grid: Grid) -> String {
    let cells = 1 << grid.log2;
    match (has_sample, cls & AMBIGUOUS != 0, cls & CLASS) {
        (false, ..) => "No sample here.".into(),
        (true, true, _) if grid.guess => format!(
            "Ambiguous: the sample's cell, one of {cells}×{cells}, touches the edge. The sample counts as on the \
             side of the cell's centre."
        ),
        (true, true, _) => format!(
            "Ambiguous: the sample's cell, one of {cells}×{cells}, touches the edge, so the sample's side is unknown. \
             It does not count, and the next sample is aimed away from the edge."
        ),
        (true, false, SIMPLE) => "The sample counts: its cell does not touch the edge.".into(),
        (true, false, _) => "The sample counts: only samples of simple pixels can be ambiguous.".into(),
    }
}
