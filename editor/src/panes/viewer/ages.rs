//! Images of ids, shown as the ages of their points.

use std::sync::Arc;

use egui::{Context, Ui};
use epigraph_core::Snapshot;
use epigraph_pictures::{ages, frames_ago};
use epigraph_stages::meaning::{DATE, POINTS};
use serde::{Deserialize, Serialize};

use crate::{
    engine::{GraphInfo, NodeInfo, PortInfo, State},
    task::Task,
};

/// The field of a cloud that holds ages.
const META: &str = "meta";

/// The property of the points that an image of ids shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Property {
    /// The ids themselves.
    #[default]
    Ids,
    /// The age, in the stage's own unit.
    Ages,
    /// The number of frames since the points were added.
    Frames,
}

impl Property {
    const ALL: [(Self, &str, &str); 3] = [
        (Self::Ids, "Ids", "Which point each pixel shows"),
        (Self::Ages, "Ages", "Age of that point, at most 255; points are replaced at about 128"),
        (Self::Frames, "Frames", "Number of frames since that point was added to the cloud"),
    ];
}

/// The ages of an image's points, while they are shown.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct Ages {
    property: Property,
    #[serde(skip)]
    from: Option<Ports>,
    #[serde(skip)]
    made: Task<Sources, Option<Arc<Snapshot>>>,
}

/// The ports, as `node.port`, that describe the points.
struct Ports {
    cloud: String,
    dates: Option<String>,
}

/// The sources of an image of ages: the ids, the cloud's field of ages, and the dates if needed.
#[derive(Clone)]
struct Sources {
    property: Property,
    fields: Vec<Arc<Snapshot>>,
    /// The number of their frame.
    frame: u32,
}

impl PartialEq for Sources {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&Arc<Snapshot>, &Arc<Snapshot>)| Arc::ptr_eq(a, b);
        self.property == other.property
            && self.fields.len() == other.fields.len()
            && self.fields.iter().zip(&other.fields).all(same)
    }
}

impl Sources {
    fn image(&self) -> Option<Arc<Snapshot>> {
        let image = match (self.property, self.fields.as_slice()) {
            (Property::Ages, [id, meta]) => ages(id, meta),
            (Property::Frames, [id, meta, dates]) => frames_ago(id, meta, dates, self.frame),
            _ => None,
        };
        image.map(Arc::new)
    }
}

impl Ages {
    /// The ports that are needed in addition to the ids.
    pub fn watched(&self) -> impl Iterator<Item = String> {
        self.from.iter().flat_map(|from| [Some(from.cloud.clone()), from.dates.clone()]).flatten()
    }

    /// The image for the ids of the port `name`: the ids themselves, or the ages of their points; `None` until those
    /// are computed.
    pub fn image(
        &mut self,
        context: &Context,
        graph: &GraphInfo,
        state: &State,
        name: &str,
        id: &Arc<Snapshot>,
    ) -> Option<Arc<Snapshot>> {
        self.from =
            (self.property != Property::Ids).then(|| cloud_of(graph, name)).flatten().map(|cloud| Ports {
                dates: (self.property == Property::Frames).then(|| dates_of(graph, &cloud)).flatten(),
                cloud,
            });
        let Some(from) = &self.from else { return Some(id.clone()) };
        let mut fields =
            vec![id.clone(), state.fields(&from.cloud).find(|field| field.field == META)?.clone()];
        if self.property == Property::Frames {
            fields.push(state.fields(from.dates.as_deref()?).next()?.clone());
        }
        // All sources are of the last frame.
        let sources = Sources { property: self.property, fields, frame: state.frames.saturating_sub(1) };
        let asked = sources.clone();
        self.made.want(context, sources, move || asked.image());
        let (sources, image) = self.made.result()?;
        image.clone().filter(|_| sources.property == self.property && sources.fields[0].name == id.name)
    }

    /// True if newer ages are being computed.
    pub fn is_behind(&self) -> bool {
        self.from.is_some() && self.made.is_behind()
    }

    /// Offers the choices. If the user changed the choice, returns true if the image now shows numbers rather than ids.
    pub fn choose(&mut self, ui: &mut Ui, graph: &GraphInfo, name: &str) -> Option<bool> {
        let before = self.property;
        for (property, label, doc) in Property::ALL {
            let known = property != Property::Frames
                || cloud_of(graph, name).is_some_and(|cloud| dates_of(graph, &cloud).is_some());
            ui.add_enabled_ui(known, |ui| {
                ui.selectable_value(&mut self.property, property, label)
                    .on_hover_text(doc)
                    .on_disabled_hover_text("No stage of this graph stores the dates of points");
            });
        }
        (self.property != before).then_some(self.property != Property::Ids)
    }
}

/// The port with the cloud whose points a node reads, or else the graph's first cloud.
fn cloud_of(graph: &GraphInfo, port: &str) -> Option<String> {
    let node = graph.node(port.rsplit_once('.')?.0);
    let source = |node: &NodeInfo| {
        let is_cloud = |info: &&PortInfo| info.source.is_some() && info.port.meaning == Some(POINTS);
        node.ports.iter().find(is_cloud).and_then(|info| info.source.clone())
    };
    node.and_then(source).or_else(|| graph.nodes.iter().find_map(source))
}

/// The port with the dates of a cloud's points: an output of a node that the cloud passes on its way to `cloud`.
fn dates_of(graph: &GraphInfo, cloud: &str) -> Option<String> {
    let mut at = cloud.to_owned();
    loop {
        let node = graph.node(at.rsplit_once('.')?.0)?;
        if let Some(dates) = node.ports.iter().find(|info| info.port.meaning == Some(DATE)) {
            return Some(format!("{}.{}", node.name, dates.port.name));
        }
        // A port that is updated in place has the same name as input and output.
        at = graph.port(&at)?.source.clone()?;
    }
}
