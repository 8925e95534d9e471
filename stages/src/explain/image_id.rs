//! The pixel that shows a point.

use epigraph_core::{Finding, Site};

use super::ImageId;
use crate::shared::{cloud::NOT_DRAWN, words::pixel};

pub(super) fn at(stage: &ImageId, site: &Site) -> Option<Vec<Finding>> {
    let seen = *site.wrote(stage.cloud_image_id)?.get(site.element?)?;
    Some(vec![match seen {
        NOT_DRAWN => Finding::Why("No pixel shows the point, so it will age faster.".into()),
        seen => Finding::value("shown at", pixel(seen as usize, site.size()[0])),
    }])
}
