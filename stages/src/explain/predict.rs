//! Whether the predicted view has points near the pixel.

use epigraph_core::{Finding, Site};

use super::{CELL, Predict};

pub(super) fn at(stage: &Predict, site: &Site) -> Option<Vec<Finding>> {
    let width = site.frame().size[0].div_ceil(CELL);
    let [x, y] = site.pixel.map(|along| along / CELL);
    let occupied = site.wrote(stage.occupancy)?[(y * width + x) as usize] != 0;
    let frame = site.frame();
    Some(vec![Finding::Why(match occupied {
        _ if frame.predicted == frame.view => {
            "The camera does not move, so there is nothing to predict.".into()
        }
        true => format!("The predicted view has a point in these {CELL}×{CELL} pixels."),
        false => format!(
            "The predicted view has no point in these {CELL}×{CELL} pixels, so one may be requested in advance."
        ),
    })])
}
