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

/// What an image of ids shows of its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Told {
    /// The ids themselves.
    #[default]
    Ids,
    /// The age, in the stage's own unit.
    Ages,
    /// The number of frames since they came.
    Frames,
}

impl Told {
    const ALL: [(Self, &str, &str); 3] = [
        (Self::Ids, "Ids", "Which point each pixel shows"),
        (
            Self::Ages,
            "Ages",
            "How old that point is: about 128 when its turn to be replaced comes, at most 255",
        ),
        (Self::Frames, "Frames", "How many frames ago that point came into the cloud"),
    ];
}

/// The ages of an image's points, while they are shown.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct Ages {
    told: Told,
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

/// The sources of an image of ages: the ids, the cloud's words, and the dates if there are any.
#[derive(Clone)]
struct Sources {
    told: Told,
    fields: Vec<Arc<Snapshot>>,
    /// The number of their frame.
    frame: u32,
}

impl PartialEq for Sources {
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&Arc<Snapshot>, &Arc<Snapshot>)| Arc::ptr_eq(a, b);
        self.told == other.told
            && self.fields.len() == other.fields.len()
            && self.fields.iter().zip(&other.fields).all(same)
    }
}

impl Sources {
    fn image(&self) -> Option<Arc<Snapshot>> {
        let image = match (self.told, self.fields.as_slice()) {
            (Told::Ages, [id, meta]) => ages(id, meta),
            (Told::Frames, [id, meta, dates]) => frames_ago(id, meta, dates, self.frame),
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

    /// The image to show for the ids of the port `name`: the ids, or the ages of their points as soon as those are
    /// computed; `None` until then.
    pub fn image(
        &mut self,
        context: &Context,
        graph: &GraphInfo,
        state: &State,
        name: &str,
        id: &Arc<Snapshot>,
    ) -> Option<Arc<Snapshot>> {
        self.from = (self.told != Told::Ids).then(|| cloud_of(graph, name)).flatten().map(|cloud| Ports {
            dates: (self.told == Told::Frames).then(|| dates_of(graph, &cloud)).flatten(),
            cloud,
        });
        let Some(from) = &self.from else { return Some(id.clone()) };
        let mut fields =
            vec![id.clone(), state.fields(&from.cloud).find(|field| field.field == META)?.clone()];
        if self.told == Told::Frames {
            fields.push(state.fields(from.dates.as_deref()?).next()?.clone());
        }
        // All sources are of the last frame that ran.
        let sources = Sources { told: self.told, fields, frame: state.frames.saturating_sub(1) };
        let asked = sources.clone();
        self.made.want(context, sources, move || asked.image());
        let (sources, image) = self.made.result()?;
        image.clone().filter(|_| sources.told == self.told && sources.fields[0].name == id.name)
    }

    /// True if newer ages are to come.
    pub fn is_behind(&self) -> bool {
        self.from.is_some() && self.made.is_behind()
    }

    /// Offers the choices; returns whether the choice changed, and if so whether it is a number.
    pub fn choose(&mut self, ui: &mut Ui, graph: &GraphInfo, name: &str) -> Option<bool> {
        let before = self.told;
        for (told, label, doc) in Told::ALL {
            let known = told != Told::Frames
                || cloud_of(graph, name).is_some_and(|cloud| dates_of(graph, &cloud).is_some());
            ui.add_enabled_ui(known, |ui| {
                ui.selectable_value(&mut self.told, told, label)
                    .on_hover_text(doc)
                    .on_disabled_hover_text("No stage of this graph stores the dates of points");
            });
        }
        (self.told != before).then_some(self.told != Told::Ids)
    }
}

/// The port of the cloud that a node takes its points from, or else the graph's first one.
fn cloud_of(graph: &GraphInfo, port: &str) -> Option<String> {
    let node = graph.node(port.rsplit_once('.')?.0);
    let source = |node: &NodeInfo| {
        let is_cloud = |info: &&PortInfo| info.source.is_some() && info.port.meaning == Some(POINTS);
        node.ports.iter().find(is_cloud).and_then(|info| info.source.clone())
    };
    node.and_then(source).or_else(|| graph.nodes.iter().find_map(source))
}

/// The port with the dates of a cloud's points: that of a node on the way from the cloud's memory to `cloud`.
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
