//! A page that a person reads: pictures side by side, plots, figures. One file, which needs no other and no network.

use base64::{Engine, engine::general_purpose::STANDARD};
use epigraph_pictures::{Picture, png, tone};
use serde_json::{Value, json};

use super::{
    cell::Record,
    experiment::Experiment,
    figure::{Cost, Metric},
    results::groups,
};

/// The page with places for its contents, each `{{NAME}}`.
const PAGE: &str = include_str!("page.html");

/// The most pictures, so that browsers can open the page.
const MOST_PICTURES: usize = 300;

/// A picture on the page.
pub struct Shown {
    /// The scene, the camera and the size.
    pub view: String,
    /// What made it.
    pub label: String,
    /// Its errors in words.
    pub figures: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The PNG file.
    pub png: Vec<u8>,
}

impl Shown {
    /// The picture of a cell.
    pub fn of(record: &Record, metrics: &[Metric], png: Vec<u8>) -> Self {
        let cell = &record.cell;
        let figure =
            |metric: &Metric| Some(format!("{} {:.4}", metric.column(), record.figure(metric.column())?));
        let figures: Vec<String> = metrics.iter().take(4).filter_map(figure).collect();
        Self {
            view: cell.view(),
            label: format!("{}, {}", cell.variation(), cell.budget),
            figures: figures.join(", "),
            size: cell.size,
            png,
        }
    }

    /// The converged picture of a cell's view.
    ///
    /// # Errors
    /// The encoder's error.
    pub fn reference(record: &Record, spp: u32, picture: &Picture) -> Result<Self, String> {
        let colors: Vec<[u8; 3]> = picture.colors.iter().copied().map(tone::to_srgb8).collect();
        Ok(Self {
            view: record.cell.view(),
            label: "reference".into(),
            figures: format!("{spp} samples per pixel"),
            size: record.cell.size,
            png: png(picture.size, &colors)?,
        })
    }
}

/// The page. `plots` are SVG files; of `pictures` at most the first [`MOST_PICTURES`] are shown.
pub fn page(
    experiment: &Experiment,
    records: &[Record],
    plots: &[String],
    pictures: &[Shown],
    about: &str,
) -> String {
    let few = &pictures[..pictures.len().min(MOST_PICTURES)];
    let data: Vec<Value> = few
        .iter()
        .map(|shown| {
            let src = format!("data:image/png;base64,{}", STANDARD.encode(&shown.png));
            let Shown { view, label, figures, size, .. } = shown;
            json!({ "view": view, "label": label, "figures": figures, "size": size, "src": src })
        })
        .collect();
    // Within a script, only `</script>` would end it.
    let data = Value::from(data).to_string().replace('<', "\\u003c");
    let frame = experiment.compare.last().map_or(String::new(), u32::to_string);
    let mut shown = format!(
        "Frame {frame} of the first seed, as displayed; the figures are means over the compared frames."
    );
    if few.len() < pictures.len() {
        shown += &format!(" The first {} of {} pictures.", few.len(), pictures.len());
    }
    let plots = plots.iter().map(|svg| format!("<div class=\"plot\">{svg}</div>\n"));
    let title = if experiment.doc.is_empty() { "Trade-off" } else { &experiment.doc };
    let note = "Means over the seeds. Click a heading to sort.";
    let parts = [
        ("title", escaped(title)),
        ("about", escaped(about)),
        ("shown", escaped(&shown)),
        ("note", note.to_owned()),
        ("plots", plots.collect()),
        ("table", table(experiment, records)),
        ("data", data),
    ];
    filled(&parts)
}

/// The page with these contents. What is put in is not looked through again.
fn filled(parts: &[(&str, String)]) -> String {
    let (mut page, mut rest) = (String::new(), PAGE);
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").expect("the page closes what it opens");
        let part = parts.iter().find(|(known, _)| *known == name).expect("the page names known parts");
        page += before;
        page += &part.1;
        rest = after;
    }
    page + rest
}

fn table(experiment: &Experiment, records: &[Record]) -> String {
    let metrics = experiment.metrics.iter().map(|metric| (metric.column(), metric.doc()));
    let costs = [Cost::PathsPerPixel, Cost::FrameMs, Cost::TraceMs].map(|cost| (cost.column(), cost.doc()));
    let columns: Vec<(&str, &str)> = costs.into_iter().chain(metrics).collect();
    let mut text = String::from("<table><thead><tr>");
    for name in ["graph", "scene", "camera", "size", "budget"] {
        text += &format!("<th>{name}</th>");
    }
    for (name, doc) in &columns {
        text += &format!("<th title=\"{}\">{name}</th>", escaped(doc));
    }
    text += "</tr></thead><tbody>\n";
    for group in groups(records) {
        let cell = &group[0].cell;
        let size = format!("{}x{}", cell.size[0], cell.size[1]);
        let failed = if group.iter().all(|record| record.measured().is_none()) { " (failed)" } else { "" };
        let what =
            [cell.variation() + failed, cell.scene.clone(), cell.camera.clone(), size, cell.budget.clone()];
        let figure = |(name, _): &(&str, &str)| {
            super::results::mean(group, name).map_or(String::new(), |value| format!("{value:.4}"))
        };
        let fields = what.into_iter().chain(columns.iter().map(figure));
        let fields = fields.map(|field| format!("<td>{}</td>", escaped(&field)));
        text += &format!("<tr>{}</tr>\n", fields.collect::<String>());
    }
    text + "</tbody></table>"
}

/// Text with HTML's special characters escaped.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_put_in_is_not_looked_through_again() {
        let parts = ["title", "about", "shown", "note", "plots", "table", "data"];
        let page = filled(&parts.map(|name| (name, format!("[{name} {{{{about}}}}]"))));
        assert!(page.contains("<title>[title {{about}}]</title>") && page.ends_with("</html>\n"));
        assert_eq!(page.matches("{{about}}").count(), 8);
    }

    #[test]
    fn texts_cannot_break_the_page() {
        assert_eq!(escaped("<a href=\"x\"> & co"), "&lt;a href=&quot;x&quot;&gt; &amp; co");
        // It names nothing that is elsewhere.
        assert!(!PAGE.contains("http") && !PAGE.contains("<link") && !PAGE.contains("src="));
    }
}
