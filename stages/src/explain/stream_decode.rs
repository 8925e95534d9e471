//! The vertex and the translation that made a point.

use epigraph_core::{Finding, Site};
use epigraph_scenes::streams::Cell;

use super::{StreamDecode, cut};
use crate::shared::{streams::START_STEP, words::count};

pub(super) fn at(stage: &StreamDecode, site: &Site) -> Option<Vec<Finding>> {
    let (words, nodes) = (site.read(stage.words)?, site.read(stage.nodes)?);
    let (pools, numbers) = (site.read(stage.pools)?, site.read(stage.numbers)?);
    let (starts, sums) = (site.read(stage.starts)?, site.wrote(stage.sums)?);
    let cut = cut(&words, &nodes, &pools, &sums, &numbers);
    let slot = u32::try_from(site.element?).ok()?;
    let start = *starts.get((slot / START_STEP) as usize)?;
    let point = cut.points_from(slot, start as usize).next()?;
    let pool = &pools[point.pool];
    let node = &nodes[pool.node as usize];
    let mut findings = vec![
        Finding::value("node", format!("{}, level {}, place {}", node.index, node.level, node.place)),
        Finding::value("cell", format!("{:?}", point.cell)),
    ];
    match point.translation {
        None => findings.push(Finding::Why("No pool contains the point: it is stored by itself.".into())),
        Some(translation) => {
            let vertex = Cell::from_bits(words[(pool.vertices + point.vertex) as usize])?;
            let by = [0, 1, 2].map(|axis| point.cell.at()[axis] - vertex.at()[axis]);
            findings.push(Finding::value("pool", pool.number.to_string()));
            findings.push(Finding::value("vertex", format!("{} at {vertex:?}", point.vertex)));
            findings.push(Finding::value("translation", format!("{translation} by {by:?}")));
            let of_vertex = count(cut.points_of(pool, point.vertex) as usize, "point");
            findings.push(Finding::Why(format!("The vertex and its tags make {of_vertex}.")));
        }
    }
    Some(findings)
}
